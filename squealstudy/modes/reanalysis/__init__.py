"""The ladder of reanalysis: full, dense, two_step, sweep_basis, windows, perturbation."""
