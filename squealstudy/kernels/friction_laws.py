"""Friction traction and its tangents at a contact point, per unit area, by integer law code.

With sliding velocity w (two tangential directions), s = |w|, e = w/s and pressure p, the traction
is t = -f(s, p) e, with the friction bound b = mu(s) max(p, 0) and
(THEORY.md eq. (7), (8); k_t is a viscous regularisation per area, N s/m3):

====  ===========  ====================
code  law          f(s, p)
====  ===========  ====================
0     regularised  min(k_t s, b)
1     smooth       b tanh(k_t s / b)
====  ===========  ====================

mu(s) = mu_d + (mu_s - mu_d) exp(-s / v_mu) falls from static to dynamic; mu_s = mu_d is constant.
A point sticks while k_t s < b, in both laws.
"""

from __future__ import annotations

import math

from squealstudy.kernels.exponential import exponential
from squealstudy.kernels.jit import exact_kernel, kernel

REGULARISED, SMOOTH = 0, 1


@kernel
def mu_at(mu_s: float, mu_d: float, v_mu: float, s: float) -> tuple[float, float]:
    """Friction coefficient and its slope dmu/ds [s/m] at sliding speed s = |w| [m/s]."""
    if mu_s == mu_d:
        return mu_d, 0.0
    fall = (mu_s - mu_d) * exponential(-s / v_mu)
    return mu_d + fall, -fall / v_mu


@exact_kernel
def resistance(code: int, k_t: float, bound: float, s: float) -> float:
    """F / s [N s/m3] at the bound b [Pa] and sliding speed s; k_t where s = 0. NaN stays NaN.

    Without branches but on `code`, so that loops over points vectorise.
    """
    drag = k_t * s
    slides = bound / s
    if code == 1:
        e = exponential(2.0 * drag / bound)
        share = 1.0 - 2.0 / (e + 1.0)
        f = k_t if s == 0.0 else slides * share
    else:
        f = k_t if drag < bound else slides
    return 0.0 if bound <= 0.0 else f


@kernel
def friction_at(
    code: int,
    mu_s: float,
    mu_d: float,
    v_mu: float,
    k_t: float,
    p: float,
    w1: float,
    w2: float,
) -> tuple[float, float, bool]:
    """Traction (t1, t2) [Pa] of one point and whether it sticks; NaN in, NaN out."""
    s = math.sqrt(w1 * w1 + w2 * w2)
    mu, _ = mu_at(mu_s, mu_d, v_mu, s)
    bound = mu * p
    f = resistance(code, k_t, bound, s)
    return -f * w1, -f * w2, k_t * s < bound


@kernel
def friction_tangent(
    code: int,
    mu_s: float,
    mu_d: float,
    v_mu: float,
    k_t: float,
    p: float,
    w1: float,
    w2: float,
) -> tuple[float, float, float, float, float]:
    """Derivatives of the traction: dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [Pa s/m], dt1/dp, dt2/dp."""
    s = math.sqrt(w1 * w1 + w2 * w2)
    mu, slope = mu_at(mu_s, mu_d, v_mu, s)
    bound = mu * p
    if bound <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    drag = k_t * s
    if s == 0.0 or (code == 0 and drag < bound):
        return -k_t, 0.0, -k_t, 0.0, 0.0
    f, along, f_p = bound, slope * p, mu
    if code == 1:
        x = drag / bound
        th = math.tanh(x)
        rest = th - x * (1.0 - th * th)
        f, along, f_p = bound * th, slope * p * rest + k_t * (1.0 - th * th), mu * rest
    e1, e2 = w1 / s, w2 / s
    across = f / s
    d11 = -(along * e1 * e1 + across * e2 * e2)
    d22 = -(along * e2 * e2 + across * e1 * e1)
    return d11, -(along - across) * e1 * e2, d22, -f_p * e1, -f_p * e2
