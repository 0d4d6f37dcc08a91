"""Harmonic balance by alternating frequency and time, with its analytic Jacobian.

Forces are evaluated at samples of a period and projected on the harmonics (Cameron & Griffin
1989). With the Fourier coefficients of their derivatives D(theta) the Jacobian is exact for these
samples: products of two harmonics are sums of harmonics at every sample. Where friction turns
between samples it is nearly so (`kernels/turns.py`).

The added damping xi of `C + xi I` is an unknown: with it every amplitude is periodic (extended
periodic motion concept, Krack 2015, doi 10.1016/j.compstruc.2015.03.008), and xi = 0 is a cycle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.cycles.harmonics import Sampling
from squealstudy.cycles.oscillator import LocalForces, Oscillator


class Balanced(NamedTuple):
    """Imbalance of a series, and its derivatives.

    Attributes
    ----------
    R : ndarray (2 H + 1, n)
    J : ndarray ((2 H + 1) n, (2 H + 1) n)
        By the series.
    by_omega, by_xi : ndarray (2 H + 1, n)
    """

    R: np.ndarray
    J: np.ndarray
    by_omega: np.ndarray
    by_xi: np.ndarray


def imbalance(
    osc: Oscillator, Q: np.ndarray, omega: float, xi: float, local: LocalForces | None = None
) -> np.ndarray:
    """R (2 H + 1, n): what is missing to q'' + (C + xi I) q' + K q = forces, by harmonics.

    `local` are the forces `sampled` at this motion, where they are known.
    """
    rule = osc.sampling((len(Q) - 1) // 2)
    local = sampled(osc, rule, Q, omega) if local is None else local
    C = osc.C + xi * np.eye(osc.n)
    return _linear(rule, C, osc.K, Q, omega) - _harmonics(osc, rule, local.f)


def sampled(osc: Oscillator, rule: Sampling, Q: np.ndarray, omega: float) -> LocalForces:
    """Forces at the samples of a period."""
    seen = Q @ osc.rows.T
    shape = (len(rule.synthesis), *osc.B.shape[:2])
    return (osc.turning or osc.forces)(
        (rule.synthesis @ seen).reshape(shape), (omega * (rule.slope @ seen)).reshape(shape)
    )


def balanced(
    osc: Oscillator,
    Q: np.ndarray,
    omega: float,
    xi: float,
    local: LocalForces | None = None,
    precision: type = np.float64,
) -> Balanced:
    """`imbalance` of a series Q (2 H + 1, n) at omega [rad/s], xi [1/s], with derivatives.

    Those by the series are of a `precision`.
    """
    H = (len(Q) - 1) // 2
    rule = osc.sampling(H)
    local = sampled(osc, rule, Q, omega) if local is None else local
    C = osc.C + xi * np.eye(osc.n)
    R = _linear(rule, C, osc.K, Q, omega) - _harmonics(osc, rule, local.f)
    rates = (rule.slope @ (Q @ osc.rows.T)).reshape(local.f.shape)
    pushed = np.einsum("sgbc,sgc->sgb", local.by_w, rates)
    h = rule.order[:, None]
    swapped = _quarter(Q)
    by_omega = -2.0 * omega * h**2 * Q + h * (swapped @ C.T) - _harmonics(osc, rule, pushed)
    J = _jacobian(osc, rule, local, C, omega, precision)
    return Balanced(R, J, by_omega, omega * h * swapped)


def _harmonics(osc: Oscillator, rule: Sampling, f: np.ndarray) -> np.ndarray:
    """Harmonics (2 H + 1, n) of generalised forces, of samples (S, g, b) of local ones."""
    return osc.spread(rule.analysis @ f.reshape(len(f), -1))


def _quarter(Q: np.ndarray) -> np.ndarray:
    """Sines in place of cosines, minus cosines in place of sines: d/dtheta over the harmonic."""
    H = (len(Q) - 1) // 2
    return np.vstack([np.zeros_like(Q[:1]), Q[H + 1 :], -Q[1 : H + 1]])


def _linear(
    rule: Sampling, C: np.ndarray, K: np.ndarray, Q: np.ndarray, omega: float
) -> np.ndarray:
    h = rule.order[:, None]
    found: np.ndarray = Q @ K.T - (h * omega) ** 2 * Q + h * omega * (_quarter(Q) @ C.T)
    return found


def _jacobian(
    osc: Oscillator,
    rule: Sampling,
    local: LocalForces,
    C: np.ndarray,
    omega: float,
    precision: type,
) -> np.ndarray:
    """Derivatives of the imbalance by the series, ((2 H + 1) n, (2 H + 1) n).

    Of the forces, with a_m, b_m the means of D cos(m theta), D sin(m theta), twice the mean of
    D cos(j theta) cos(k theta) is a_{j-k} + a_{j+k}, and so on.
    """
    H, n = int(rule.order[-1]), osc.n
    a, b, c, d = (
        osc.projected(-np.tensordot(weights, D, 1).astype(precision))
        for D in (local.by_y, local.by_w)
        for weights in (rule.cosines, rule.sines)
    )
    J: np.ndarray = np.empty((2 * H + 1, n, 2 * H + 1, n), precision)
    # rows of cosines, columns of cosines and sines; then rows of sines
    for j, k in np.ndindex(H + 1, H + 1):
        far, near, sign, rate = j + k, abs(j - k), float(np.sign(j - k)), float(k * omega)
        J[j, :, k] = a[near] + a[far] - rate * (d[far] - sign * d[near])
        if k:
            J[j, :, H + k] = b[far] - sign * b[near] + rate * (c[near] + c[far])
        if j:
            J[H + j, :, k] = b[far] + sign * b[near] - rate * (c[near] - c[far])
        if j and k:
            J[H + j, :, H + k] = a[near] - a[far] + rate * (d[far] + sign * d[near])
    J[0] *= 0.5
    J[0, :, 0] += osc.K
    for h in range(1, H + 1):
        own, turn = osc.K - (h * omega) ** 2 * np.eye(n), h * omega * C
        J[h, :, h] += own
        J[H + h, :, H + h] += own
        J[h, :, H + h] += turn
        J[H + h, :, h] -= turn
    return J.reshape((2 * H + 1) * n, -1)
