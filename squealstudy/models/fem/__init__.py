"""Finite elements of the generated models: grids, elasticity, surfaces (on top of scikit-fem)."""
