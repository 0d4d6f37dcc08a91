"""Integer codes of the contact laws, for kernels and for those who call them without numba."""

from __future__ import annotations

EXPONENTIAL, UNILATERAL, POWER, BILATERAL = 0, 1, 2, 3
MAX_EXPONENT = 200.0  # exp(200) = 7e86 stays finite in every product that follows
