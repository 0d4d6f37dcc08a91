"""Design points in time."""
