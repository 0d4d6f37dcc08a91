"""The laws of a small model at a state, written from THEORY.md eq. (2) to (9): for the judge.

Nothing here imports the package. A contact point has a phase: open, sticking, sliding ahead or
back. Forces are those of a phase that is held fixed, so that they are smooth over a step; where it
ends is an event (`left`).
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from math import exp, inf, tanh
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np

EXPONENTIAL, UNILATERAL, POWER, BILATERAL, CUBIC = range(5)
CONTACT_CODES = {
    "exponential": EXPONENTIAL,
    "unilateral": UNILATERAL,
    "power": POWER,
    "bilateral": BILATERAL,
    "cubic": CUBIC,
}
OPEN, STICK, AHEAD, BACK = range(4)  # phases of a contact point
# rows of a state: displacement from steady sliding, velocity, and integrals over time
D, V, TORQUE, SQUARE, NORMAL, FRICTION, BELT, DAMPING, STICKS, SLIPS, OPENS = (
    0, 2, 4, 5, 6, 7, 8, 9, 10, 11, 12,
)  # fmt: skip
N_ROWS = 13
FAINT = 1e-12  # of the sliding speed: a corner so near to rest is below round-off, as its friction


def _directory() -> str:
    """Where compiled functions are kept: named by a hash, for numba looks at one file alone."""
    sources = (Path(__file__).with_name(f"event_{name}.py") for name in ("laws", "steps"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]
    return str(Path(os.environ.get("NUMBA_CACHE_DIR") or tempfile.gettempdir()) / f"judge-{digest}")


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of the judge."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, _directory()
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = before


class Case(NamedTuple):
    """A small model with its laws; 2 coordinates, one or two contact points.

    mass [kg], K (2, 2), C (2, 2), load (2,), rest (2,) [m]: place of steady sliding; N, T
    (points, 2), area (points,), speed [m/s], slope k_t [N s/m3] (inf: Coulomb's law itself), smooth
    (tanh), contact code with its two values, friction, ratio of static friction, decay [m/s], and
    the pressure below which a point counts as open [Pa].
    """

    mass: float
    K: np.ndarray
    C: np.ndarray
    load: np.ndarray
    rest: np.ndarray
    N: np.ndarray
    T: np.ndarray
    area: np.ndarray
    speed: float
    slope: float
    smooth: bool
    contact: int
    first: float
    second: float
    friction: float
    ratio: float
    decay: float
    open_below: float


@compiled
def pressure(contact: int, first: float, second: float, g: float) -> float:
    """Pressure [Pa] of a contact that is closed, at a gap [m]."""
    if contact == EXPONENTIAL:
        return first * exp(-second * g)
    if contact == POWER:
        return first * max(-g, 0.0) ** second
    if contact == CUBIC:
        return -(first * g + second * g**3)
    return -first * g


@compiled
def tangent(contact: int, first: float, second: float, g: float) -> float:
    """-dp/dg [Pa/m]; that of the closed side at a gap of zero."""
    if contact == EXPONENTIAL:
        return second * first * exp(-second * g)
    if contact == POWER:
        return second * first * max(-g, 0.0) ** (second - 1.0)
    if contact == CUBIC:
        return first + 3.0 * second * g**2
    return first


@compiled
def potential(contact: int, first: float, second: float, g: float) -> float:
    """Stored energy per area [J/m2]."""
    if contact == EXPONENTIAL:
        return first / second * exp(-second * g)
    if contact == UNILATERAL:
        return 0.5 * first * min(g, 0.0) ** 2
    if contact == POWER:
        return first * max(-g, 0.0) ** (second + 1.0) / (second + 1.0)
    if contact == CUBIC:
        return 0.5 * first * g**2 + 0.25 * second * g**4
    return 0.5 * first * g**2


@compiled
def coefficient(friction: float, ratio: float, decay: float, s: float) -> float:
    """mu at a sliding speed s [m/s]."""
    return friction * (1.0 + (ratio - 1.0) * exp(-s / decay))


@compiled
def gap(case: Case, y: np.ndarray, i: int) -> float:
    """Of point i, m."""
    return case.N[i, 0] * (case.rest[0] + y[0]) + case.N[i, 1] * (case.rest[1] + y[1])


@compiled
def sliding(case: Case, y: np.ndarray, i: int) -> float:
    """Velocity of point i along the sliding direction, m/s."""
    return case.speed + case.T[i, 0] * y[2] + case.T[i, 1] * y[3]


@compiled
def normal(case: Case, y: np.ndarray, phase: int, i: int) -> float:
    """Pressure of point i; an open one may pull, where the law does."""
    opens = case.contact == UNILATERAL or case.contact == POWER
    if phase == OPEN and opens:
        return 0.0
    return pressure(case.contact, case.first, case.second, gap(case, y, i))


@compiled
def closing(case: Case, y: np.ndarray, i: int) -> float:
    """Positive where point i presses, without a kink where it opens."""
    g = gap(case, y, i)
    if case.contact == UNILATERAL or case.contact == POWER:
        return -g
    return pressure(case.contact, case.first, case.second, g)


@compiled
def needed(case: Case, y: np.ndarray, phases: np.ndarray, i: int) -> float:
    """Traction [Pa] that keeps point i from sliding; friction elsewhere acts across to it."""
    total = 0.0
    size = 0.0
    for j in range(2):
        f = case.load[j]
        for k in range(2):
            f -= case.K[j, k] * (case.rest[k] + y[k]) + case.C[j, k] * y[2 + k]
        for k in range(len(case.area)):
            f += case.N[k, j] * case.area[k] * normal(case, y, phases[k], k)
        total += case.T[i, j] * f
        size += case.T[i, j] ** 2
    return -total / (size * case.area[i])


@compiled
def traction(case: Case, y: np.ndarray, phases: np.ndarray, i: int) -> float:
    """Friction of point i in its phase, Pa."""
    phase = phases[i]
    if phase == OPEN:
        return 0.0
    w = sliding(case, y, i)
    p = normal(case, y, phase, i)
    if case.smooth:
        s = abs(w)
        bound = coefficient(case.friction, case.ratio, case.decay, s) * max(p, 1e-300)
        t = bound * tanh(case.slope * s / bound)
        return -t if w > 0.0 else t
    if phase == STICK:
        return needed(case, y, phases, i) if case.slope == inf else -case.slope * w
    side = 1.0 if phase == AHEAD else -1.0
    s = max(side * w, -case.decay)  # a trial step may overshoot
    return -side * coefficient(case.friction, case.ratio, case.decay, s) * p


@compiled
def below(case: Case, y: np.ndarray, phase: int, i: int) -> bool:
    """Whether point i counts as open: a pressure below the hundredth of steady sliding's mean."""
    return normal(case, y, phase, i) <= case.open_below


@compiled
def rate(case: Case, y: np.ndarray, phases: np.ndarray, opened: np.ndarray, out: np.ndarray):
    """Time derivative of a state (N_ROWS,) into `out`; `opened` are the flags of `below`."""
    out[:] = 0.0
    area = case.area.sum()
    for j in range(2):
        out[D + j] = y[V + j]
        f, damping = case.load[j], 0.0
        for k in range(2):
            f -= case.K[j, k] * (case.rest[k] + y[k])
            damping += case.C[j, k] * y[V + k]
        out[V + j] = f - damping
        out[DAMPING] += y[V + j] * damping
    torque = 0.0
    for i in range(len(case.area)):
        p = case.area[i] * normal(case, y, phases[i], i)
        t = case.area[i] * traction(case, y, phases, i)
        for j in range(2):
            out[V + j] += case.N[i, j] * p + case.T[i, j] * t
        torque -= t if case.speed > 0.0 else -t
        out[NORMAL] += p
        out[FRICTION] -= sliding(case, y, i) * t
        out[BELT] -= case.speed * t
        share = case.area[i] / area
        if opened[i]:
            out[OPENS] += share
        elif phases[i] == STICK:
            out[STICKS] += share
        else:
            out[SLIPS] += share
    out[V] /= case.mass
    out[V + 1] /= case.mass
    out[TORQUE] = torque
    out[SQUARE] = torque**2


@compiled
def left(case: Case, y: np.ndarray, phases: np.ndarray, opened: np.ndarray) -> bool:
    """Whether a state has left its phases: an event lies before it."""
    for i in range(len(case.area)):
        phase = phases[i]
        if below(case, y, phase, i) != opened[i]:
            return True
        presses = case.contact == EXPONENTIAL or closing(case, y, i) > 0.0
        if presses == (phase == OPEN):
            return True
        if phase == OPEN:
            continue
        w = sliding(case, y, i)
        side = -1.0 if phase == BACK else 1.0
        if case.slope == inf:
            if phase == STICK:
                bound = coefficient(case.friction, case.ratio, case.decay, 0.0)
                if abs(needed(case, y, phases, i)) > bound * normal(case, y, phase, i):
                    return True
            elif side * w < 0.0:
                return True
            continue
        bound = coefficient(case.friction, case.ratio, case.decay, abs(w))
        bound *= normal(case, y, phase, i)
        if bound < FAINT * case.slope * abs(case.speed):
            continue
        sticks = case.slope * abs(w) < bound
        if sticks != (phase == STICK) or (not sticks and side * w < 0.0):
            return True
    return False


@compiled
def enter(case: Case, y: np.ndarray, phases: np.ndarray, opened: np.ndarray) -> None:
    """Phases of a state behind an event; Coulomb's law sets a point that sticks to rest."""
    for i in range(len(case.area)):
        before = phases[i]
        presses = case.contact == EXPONENTIAL or closing(case, y, i) > 0.0
        if not presses:
            phases[i] = OPEN
        elif case.slope == inf:
            phases[i] = _coulomb(case, y, phases, i)
        else:
            w = sliding(case, y, i)
            bound = coefficient(case.friction, case.ratio, case.decay, abs(w))
            p = normal(case, y, STICK, i)
            phases[i] = STICK if case.slope * abs(w) < bound * p else AHEAD if w > 0.0 else BACK
        if case.slope == inf and phases[i] == STICK and before != STICK:
            w = sliding(case, y, i)
            size = case.T[i, 0] ** 2 + case.T[i, 1] ** 2
            for j in range(2):
                y[V + j] -= case.T[i, j] * w / size
        opened[i] = below(case, y, phases[i], i)


@compiled
def _coulomb(case: Case, y: np.ndarray, phases: np.ndarray, i: int) -> int:
    """Phase of a closed point under Coulomb's law, from the one before."""
    before, w = phases[i], sliding(case, y, i)
    if before == OPEN or (before == AHEAD and w >= 0.0) or (before == BACK and w <= 0.0):
        return AHEAD if w > 0.0 else BACK
    phases[i] = STICK
    t = needed(case, y, phases, i)
    bound = coefficient(case.friction, case.ratio, case.decay, 0.0) * normal(case, y, STICK, i)
    if abs(t) <= bound:
        return STICK
    return AHEAD if t < 0.0 else BACK
