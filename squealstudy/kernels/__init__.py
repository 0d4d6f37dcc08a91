"""Compiled kernels: numba and numpy only, functions of arrays and scalars, no classes, no raise."""
