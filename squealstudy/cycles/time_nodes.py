"""Solves a cycle at nodes of its period, where Fourier series are too short for its corners.

A contact that sticks or opens for a hundredth of a period needs hundreds of harmonics. Series of a
few agree with each other and have another motion there, and other multipliers. At a thousand nodes
the trapezoidal rule has all of it: Newton's method on all nodes at once, whose equations are those
of small deviations from one node to the next, with the period as one unknown more.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import period_at
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.cycles.propagators import product
from squealstudy.errors import ConvergenceError

N_NODES = 1024  # of a period
N_PARTS = 32  # parts of a period whose steps are multiplied side by side
# change of a tangent from one node to the next, over its range: of a series of 59 harmonics less
MIN_CORNER = 0.25
MIN_RANGE = 1e-6  # a tangent is constant if its range over the largest coefficient is smaller
MAX_NEWTON_STEPS = 20
SOLVED = 1e-8  # residual over the largest velocity
DAMPED_SHARE = 0.5  # of a step of Newton's method that would make the residual larger
MAX_FREQUENCY_CHANGE = 0.02  # relative: beyond it another motion was found
N_STORED = 2  # cycles at nodes that are stored: errors of levels and of multipliers need the same


class NodeStates(NamedTuple):
    """States at the nodes of a period.

    Attributes
    ----------
    q, v : ndarray (N, n)
        Displacements and velocities.
    omega : float
        rad/s.
    local : LocalForces
    pull : ndarray (N, n)
        Acceleration.
    """

    q: np.ndarray
    v: np.ndarray
    omega: float
    local: LocalForces
    pull: np.ndarray


# oscillators, series, and the cycle at nodes, if there is one
_latest: deque[tuple[Oscillator, PeriodicMotion, NodeStates | None]] = deque(maxlen=N_STORED)


class NodeChange(NamedTuple):
    """Changes of `NodeStates`: q, v (N, n) and omega."""

    q: np.ndarray
    v: np.ndarray
    omega: float


def has_corners(osc: Oscillator, cycle: PeriodicMotion) -> bool:
    """Whether tangents of the contact jump somewhere in the period."""
    states = _states_of(osc, cycle)
    damping, stiffness = _tangents(osc, states)
    for tangent, linear in ((damping, osc.C), (stiffness, osc.K)):
        width = np.ptp(tangent, axis=0)
        jump = np.abs(tangent - np.roll(tangent, -1, axis=0)).max(axis=0)
        changes = width > MIN_RANGE * max(np.abs(linear).max(), np.abs(tangent).max())
        if (jump[changes] > MIN_CORNER * width[changes]).any():
            return True
    return False


def cycle_at_nodes(osc: Oscillator, cycle: PeriodicMotion) -> NodeStates:
    """The cycle at `N_NODES` nodes that a series leads to; the last ones are stored.

    Raises
    ------
    ConvergenceError
        Where Newton's method does not end near the series.
    """
    for last_osc, last_cycle, stored in tuple(_latest):
        if last_osc is osc and last_cycle is cycle:
            solved = stored
            break
    else:
        solved = None
        with suppress(ConvergenceError):
            solved = _converged(osc, _states_of(osc, cycle), cycle.omega)
        _latest.append((osc, cycle, solved))
    if solved is None:
        raise ConvergenceError("not_converged", "no cycle at nodes near the series")
    return solved


def with_half_the_nodes(osc: Oscillator, states: NodeStates) -> NodeStates:
    """The cycle at every other node, by the rule over twice the distance.

    Raises
    ------
    ConvergenceError
        Where Newton's method does not end near the states.
    """
    return _converged(osc, _states(osc, states.q[::2], states.v[::2], states.omega), states.omega)


def _converged(osc: Oscillator, states: NodeStates, omega: float) -> NodeStates:
    """States that satisfy the rule, by Newton's method; ConvergenceError if not near omega."""
    lacks = _lacks(states)
    size = _size(lacks, states)
    for _ in range(MAX_NEWTON_STEPS):
        if size < SOLVED or not np.isfinite(size):
            break
        change = _newton_step(osc, states, lacks)
        for share in (1.0, DAMPED_SHARE):
            tried = _changed(osc, states, change, share)
            tried_lacks = _lacks(tried)
            if (tried_size := _size(tried_lacks, tried)) < size:
                break
        states, lacks, size = tried, tried_lacks, tried_size
    if not (size < SOLVED and abs(states.omega / omega - 1.0) < MAX_FREQUENCY_CHANGE):
        raise ConvergenceError("not_converged", "no cycle at nodes near the series")
    return states


def monodromy_at_nodes(osc: Oscillator, cycle: PeriodicMotion) -> np.ndarray:
    """Matrix (2 n, 2 n) of `floquet.monodromy`, of `cycle_at_nodes`.

    Raises
    ------
    ConvergenceError
        Where there is no cycle at nodes near the series.
    """
    before, after = _step_matrices(osc, cycle_at_nodes(osc, cycle))
    return product(np.linalg.solve(after, before))


def _states_of(osc: Oscillator, cycle: PeriodicMotion) -> NodeStates:
    synthesis, slope = period_at(N_NODES, cycle.harmonics)
    return _states(osc, synthesis @ cycle.Q, cycle.omega * (slope @ cycle.Q), cycle.omega)


def _states(osc: Oscillator, q: np.ndarray, v: np.ndarray, omega: float) -> NodeStates:
    local = osc.evaluate(q, v)
    return NodeStates(q, v, omega, local, osc.spread(local.f) - v @ osc.C.T - q @ osc.K.T)


def _changed(osc: Oscillator, states: NodeStates, change: NodeChange, share: float) -> NodeStates:
    """The states after a share of a change."""
    q, v = states.q + share * change.q, states.v + share * change.v
    return _states(osc, q, v, states.omega + share * change.omega)


def _tangents(osc: Oscillator, states: NodeStates) -> tuple[np.ndarray, np.ndarray]:
    """Damping and stiffness (N, n, n)."""
    local = states.local
    return osc.C - osc.projected(local.by_w), osc.K - osc.projected(local.by_y)


def _ahead(values: np.ndarray) -> np.ndarray:
    return np.roll(values, -1, axis=0)


def _lacks(states: NodeStates) -> np.ndarray:
    """By what steps (N, 2 n) miss the trapezoidal rule, of (omega q, v)."""
    half = np.pi / len(states.q)
    of_q = (_ahead(states.q) - states.q) * states.omega - half * (states.v + _ahead(states.v))
    means = half / states.omega * (states.pull + _ahead(states.pull))
    return np.hstack([of_q, _ahead(states.v) - states.v - means])


def _size(lacks: np.ndarray, states: NodeStates) -> float:
    return float(np.linalg.norm(lacks) / np.abs(states.v).max())


def _step_matrices(osc: Oscillator, states: NodeStates) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (N, 2 n, 2 n) of a deviation before and after each step."""
    n, half, omega = osc.n, np.pi / len(states.q), states.omega
    C, K = _tangents(osc, states)
    rates = np.zeros((len(C), 2 * n, 2 * n))
    rates[:, :n, n:] = np.eye(n)
    rates[:, n:, :n], rates[:, n:, n:] = -K / omega**2, -C / omega
    identity = np.eye(2 * n)
    return identity + half * rates, identity - half * _ahead(rates)


def _newton_step(osc: Oscillator, states: NodeStates, lacks: np.ndarray) -> NodeChange:
    """Change by Newton's method; at the first node across the motion."""
    n, half, omega = osc.n, np.pi / len(states.q), states.omega
    before, after = _step_matrices(osc, states)
    by_omega = np.hstack(  # by log omega
        [
            (_ahead(states.q) - states.q) * omega,
            half / omega * (states.pull + _ahead(states.pull)),
        ]
    )
    right = np.stack([-lacks, -by_omega], axis=2)
    steps = np.linalg.solve(after, np.concatenate([before, right], axis=2))
    within, ahead = _paths(steps)
    closing = np.zeros((2 * n + 1, 2 * n + 1))
    closing[:-1] = np.delete(ahead[-1], 2 * n, axis=1)
    closing[:-1, :-1] -= np.eye(2 * n)
    closing[-1, :-1] = np.concatenate([states.v[0], states.pull[0] / omega])
    try:
        begin = np.linalg.solve(closing, np.append(-ahead[-1, :, 2 * n], 0.0))
    except np.linalg.LinAlgError as error:
        raise ConvergenceError("singular", "a cycle at nodes is singular") from error
    rest = np.array([1.0, begin[-1]])
    firsts = ahead[:-1] @ np.concatenate([begin[:-1], rest])
    change = (
        within[:, :, :, : 2 * n] @ firsts[:, None, :, None] + within[..., 2 * n :] @ rest[:, None]
    )
    change = change.reshape(-1, 2 * n)
    return NodeChange(change[:, :n] / omega, change[:, n:], float(omega * begin[-1]))


def _paths(steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Products of steps (N, m, m + 2), each a matrix and two columns that it adds.

    Returns
    -------
    within : ndarray (G, N / G, m, m + 2)
        From the first node of each of G equal parts to every node of the part.
    ahead : ndarray (G + 1, m, m + 2)
        From the first node of all to the first of each part, and to the end.
    """
    count, m, width = steps.shape
    parts = steps.reshape(N_PARTS, count // N_PARTS, m, width)
    within = np.empty((N_PARTS, parts.shape[1] + 1, m, width))
    within[:, 0] = np.eye(m, width)
    for k in range(parts.shape[1]):
        within[:, k + 1] = _next(parts[:, k], within[:, k])
    ahead = np.empty((N_PARTS + 1, m, width))
    ahead[0] = np.eye(m, width)
    for k in range(N_PARTS):
        ahead[k + 1] = _next(within[k, -1], ahead[k])
    return within[:, :-1], ahead


def _next(step: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Path (.., m, m + 2) with one step more."""
    m = step.shape[-2]
    further: np.ndarray = step[..., :m] @ path
    further[..., m:] += step[..., m:]
    return further
