"""Where methods fail, and integrators to compare with: nothing a study of a brake needs."""
