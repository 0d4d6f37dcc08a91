"""Scattered designs: probability of instability, Sobol indices."""
