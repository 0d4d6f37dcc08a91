"""Outcome of a run in time: growth, levels, energies, class."""
