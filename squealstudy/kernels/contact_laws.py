"""Contact pressure and tangent at a contact point, by integer law code.

Codes (THEORY.md eq. (4), (5)), gap g positive when open:

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

from squealstudy.kernels.jit import kernel
from squealstudy.kernels.law_codes import BILATERAL, EXPONENTIAL, MAX_EXPONENT, UNILATERAL


@kernel
def law_at(code: int, a: float, b: float, g: float) -> tuple[float, float]:
    """Pressure p [Pa] and tangent -dp/dg [Pa/m] of one point at gap g [m]."""
    if code == EXPONENTIAL:
        p = a * math.exp(min(-b * g, MAX_EXPONENT))
        return p, b * p
    if code == BILATERAL:
        return -a * g, a
    if g >= 0.0:
        return 0.0, 0.0
    if code == UNILATERAL:
        return -a * g, a
    p = a * (-g) ** b
    return p, b * p / (-g)
