"""An exponential function that loops over contact points can vectorise."""

from __future__ import annotations

import math

import numpy as np

from squealstudy.kernels.jit import exact_kernel

HIGHEST, LOWEST = 200.0, -700.0  # exp(200) = 7e86 stays finite in every product that follows
PER_LN2 = 1.0 / math.log(2.0)
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # k LN2_HIGH is exact
C2, C3, C4, C5, C6, C7 = (1.0 / math.factorial(i) for i in range(2, 8))
C8, C9, C10, C11, C12, C13 = (1.0 / math.factorial(i) for i in range(8, 14))


@exact_kernel
def exponential(x: float) -> float:
    """exp(x) to two units in the last place; 0 below -700, exp(200) beyond 200; NaN stays NaN.

    exp(x) = 2^k exp(r) with |r| <= ln(2) / 2, where the Taylor series to r^13 is good to 4e-18.
    """
    z = HIGHEST if x > HIGHEST else x
    z = LOWEST if z < LOWEST else z
    k = np.rint(z * PER_LN2)
    r = (z - k * LN2_HIGH) - k * LN2_LOW
    y = (((((C13 * r + C12) * r + C11) * r + C10) * r + C9) * r + C8) * r + C7
    y = (((((y * r + C6) * r + C5) * r + C4) * r + C3) * r + C2) * r + 1.0
    power = k if k > LOWEST * 2.0 else LOWEST * 2.0  # NaN has no integer
    y = (y * r + 1.0) * np.int64((np.int64(power) + 1023) << 52).view(np.float64)
    return 0.0 if x < LOWEST else y
