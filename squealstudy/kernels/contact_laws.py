"""Contact pressure and tangent at every contact point, by integer law code.

Codes (paper, figure 3 left, eq. 5; theory.md section 1), gap g positive when open:

====  ============  =====================  =================
code  law           p(g)                   parameters a, b
====  ============  =====================  =================
0     exponential   a exp(-b g)            p0 [Pa], lambda [1/m]
1     unilateral    a max(-g, 0)           k [Pa/m], unused
2     power         a max(-g, 0)^b         c [Pa/m^b], b >= 1
3     bilateral     -a g                   k [Pa/m], unused
====  ============  =====================  =================
"""

from __future__ import annotations

import math

import numpy as np

from squealstudy.kernels.jit import kernel

EXPONENTIAL, UNILATERAL, POWER, BILATERAL = 0, 1, 2, 3
MAX_EXPONENT = 200.0  # exp(200) = 7e86 stays finite in every product that follows


@kernel
def law_at(code: int, a: float, b: float, g: float) -> tuple[float, float]:
    """Pressure p [Pa] and tangent -dp/dg [Pa/m] of one point at gap g [m]."""
    if code == 0:
        p = a * math.exp(min(-b * g, MAX_EXPONENT))
        return p, b * p
    if code == 3:
        return -a * g, a
    if g >= 0.0:
        return 0.0, 0.0
    if code == 1:
        return -a * g, a
    p = a * (-g) ** b
    return p, b * p / (-g)


@kernel
def law_arrays(code: int, a: float, b: float, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressure and tangent at gaps `g` (n,): two arrays (n,), Pa and Pa/m. NaN stays NaN."""
    p = np.empty_like(g)
    kappa = np.empty_like(g)
    for i in range(g.size):
        p[i], kappa[i] = law_at(code, a, b, g[i])
    return p, kappa
