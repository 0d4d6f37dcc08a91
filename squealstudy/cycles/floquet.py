"""Floquet multipliers of a cycle: what becomes of small deviations in a period.

The error of the monodromy matrix (`propagators`) is estimated from three smaller numbers of steps,
and from the multiplier that must be one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from scipy.linalg import get_lapack_funcs

from squealstudy.cycles.balance import sampled
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.harmonics import sampling, series_at
from squealstudy.cycles.oscillator import Oscillator
from squealstudy.cycles.propagators import monodromy
from squealstudy.cycles.time_nodes import has_corners, monodromy_at_nodes
from squealstudy.errors import ConvergenceError
from squealstudy.root_pairs import least_assignment

MIN_STEPS_PER_PERIOD = 256
# the same for models of at most so many coordinates, whose steps cost little: contact that opens
# within a step causes an error in proportion to the length of the step
MIN_STEPS_SMALL, SMALL_MAX_COORDINATES = 1024, 12
STEPS_A_HARMONIC = 16
# The error by steps is this factor times the largest change by fewer steps, in these shares of the
# full number. Where contact opens, one number of steps may agree by chance (half the steps did so
# in 32 of 393 cycles).
COARSER_STEPS, STEPS_SAFETY_FACTOR = (0.45, 0.55, 0.7), 1.5
TRAPEZOIDAL_MIN_COORDINATES = 60  # with more coordinates the trapezoidal rule is used
TRAPEZOIDAL_STEPS = 192  # steps of a period
ERROR_MIN_MULTIPLIER = 0.97  # larger multipliers have an error of their own by that rule
LEAST_MULTIPLIER = 0.5  # smaller multipliers do not count in errors
# factor from the change with another number of harmonics to the error: in Hulten's model on a cubic
# contact that opens, the error of 11 harmonics is .038, and the change to 25 is .034
OTHER_SERIES_SAFETY_FACTOR = 1.5
FINER_SERIES_SHARE = 0.5  # share of that change that the finer series errs by: .12 in that model
SAMPLES_PER_STEP = 4  # samples of the contact points' tangents in each step
# a multiplier is beyond -1, beyond 1, or a pair is beyond the circle
FLIP, FOLD, TORUS = "flip", "fold", "torus"


@dataclass(frozen=True, eq=False)
class Floquet:
    """Multipliers of a cycle.

    Attributes
    ----------
    multipliers : ndarray (2 n,) complex
        By size, largest first, but the trivial one last.
    vectors : ndarray (2 n, 2 n) complex
        Deviations (q, q') of unit norm at theta = 0 that belong to them, in columns.
    errors : ndarray (2 n,)
        Estimated errors of their sizes. In all coordinates one number for all multipliers: from
        fewer steps, but not less than the error of the trivial one, nor than
        `OTHER_SERIES_SAFETY_FACTOR` times the change by another number of harmonics. In a basis one
        number each, from fewer steps and harmonics in a smaller basis.
    period : float
        Period of the cycle, s.
    """

    multipliers: np.ndarray
    vectors: np.ndarray
    errors: np.ndarray
    period: float

    @property
    def trivial(self) -> complex:
        """The multiplier along the motion, which is 1 but for the error."""
        return complex(self.multipliers[-1])

    @property
    def deciding(self) -> int:
        """Index of the multiplier by which the cycle is unstable for certain, or most nearly so."""
        sizes = np.abs(self.multipliers[:-1])
        beyond = sizes - 1.0 - self.errors[:-1]
        if not len(beyond) or beyond.max() > 0:
            return int(np.argmax(beyond)) if len(beyond) else -1
        return int(np.argmax(sizes + self.errors[:-1]))

    @property
    def error(self) -> float:
        """Error of the multiplier that decides stability."""
        return float(self.errors[self.deciding])

    @property
    def n_unstable(self) -> int:
        """Number of multipliers outside the unit circle by more than their error."""
        return int((np.abs(self.multipliers[:-1]) > 1.0 + self.errors[:-1]).sum())

    @property
    def stable(self) -> bool | None:
        """Whether the cycle attracts; None where the error does not let that be said."""
        if self.n_unstable:
            return False
        within = np.abs(self.multipliers[:-1]) < 1.0 - self.errors[:-1]
        return True if within.all() else None

    @property
    def saddle(self) -> bool:
        """Whether one multiplier is certainly outside the unit circle and all others inside."""
        inside = np.abs(self.multipliers[:-1]) < 1.0 - self.errors[:-1]
        return self.n_unstable == 1 and int(inside.sum()) == len(inside) - 1

    @property
    def modulus(self) -> float:
        """Modulus of the multiplier that decides stability; 0 where only the trivial one is."""
        return float(np.abs(self.multipliers[self.deciding])) if len(self.multipliers) > 1 else 0.0

    @property
    def growth_rate(self) -> float:
        """Growth rate of the deviation that decides stability, 1/s."""
        return float(np.log(max(self.modulus, 1e-300)) / self.period)

    @property
    def instability(self) -> str:
        """How the cycle is unstable, by the multiplier that decides; empty where it is not."""
        if not self.n_unstable:
            return ""
        beyond = complex(self.multipliers[self.deciding])
        if abs(beyond.imag) > self.error:
            return TORUS
        return FOLD if beyond.real > 0 else FLIP

    def at_fold(self) -> Floquet:
        """The multipliers of a fold, where the one nearest to 1 is 1 by definition.

        With the trivial one it is a double root, whose error is the square root of that of others.
        The error of both is at least twice their distance from 1.
        """
        distance_from_1 = np.abs(self.multipliers - 1.0)
        nearest = np.argsort(distance_from_1)[:2]  # the trivial one and that of the fold
        errors = self.errors.copy()
        errors[nearest] = np.maximum(errors[nearest], 2.0 * distance_from_1[nearest])
        return replace(self, errors=errors)


def floquet(osc: Oscillator, cycle: PeriodicMotion, other: PeriodicMotion | None = None) -> Floquet:
    """Multipliers of a cycle; their errors also by an `other` solution of it, if there is one.

    Where these errors leave the stability open, and the other has more harmonics, the multipliers
    of the other are returned. In a small model with corners of forces in the period, errors also
    include the change to the multipliers at nodes (`_held_against_nodes`).
    """
    multipliers = _with_error_of_steps(osc, cycle, _without_error(osc, cycle))
    if other is None:
        return multipliers
    if other.harmonics != cycle.harmonics:
        of_other = _without_error(osc, other)
        change = _size_change(multipliers, of_other)
        multipliers = _with_least_error(multipliers, OTHER_SERIES_SAFETY_FACTOR * change)
        if multipliers.stable is None and other.harmonics > cycle.harmonics:
            of_other = _with_error_of_steps(osc, other, of_other)
            cycle, multipliers = other, _with_least_error(of_other, FINER_SERIES_SHARE * change)
    return _held_against_nodes(osc, cycle, multipliers)


def _held_against_nodes(osc: Oscillator, cycle: PeriodicMotion, multipliers: Floquet) -> Floquet:
    """The multipliers, with errors by those at nodes; those at nodes if stability was open."""
    if osc.n > SMALL_MAX_COORDINATES or not has_corners(osc, cycle):
        return multipliers
    try:
        at_nodes = _ordered_multipliers(osc, cycle, monodromy_at_nodes(osc, cycle))
    except ConvergenceError:
        return multipliers
    change = _size_change(multipliers, at_nodes)
    multipliers = _with_least_error(multipliers, OTHER_SERIES_SAFETY_FACTOR * change)
    if multipliers.stable is None:
        error = max(FINER_SERIES_SHARE * change, abs(at_nodes.trivial - 1.0))
        return _with_least_error(at_nodes, error)
    return multipliers


def _with_least_error(multipliers: Floquet, error: float) -> Floquet:
    return replace(multipliers, errors=np.maximum(multipliers.errors, error))


def _without_error(osc: Oscillator, cycle: PeriodicMotion) -> Floquet:
    if osc.n > TRAPEZOIDAL_MIN_COORDINATES:
        return floquet_on(osc, np.eye(osc.n), osc.n, cycle, cycle)
    return _ordered_multipliers(osc, cycle, monodromy(osc, cycle, _n_steps(osc, cycle)))


def _with_error_of_steps(osc: Oscillator, cycle: PeriodicMotion, fine: Floquet) -> Floquet:
    """The multipliers with their error by fewer steps, not less than that of the trivial one."""
    if osc.n > TRAPEZOIDAL_MIN_COORDINATES:
        return fine
    steps = _n_steps(osc, cycle)
    coarse = (np.linalg.eigvals(monodromy(osc, cycle, round(c * steps))) for c in COARSER_STEPS)
    changes = (_difference(fine.multipliers, multipliers) for multipliers in coarse)
    error = max(abs(fine.trivial - 1.0), STEPS_SAFETY_FACTOR * max(changes))
    return replace(fine, errors=np.full(len(fine.multipliers), error))


def _n_steps(osc: Oscillator, cycle: PeriodicMotion) -> int:
    min_steps = MIN_STEPS_SMALL if osc.n <= SMALL_MAX_COORDINATES else MIN_STEPS_PER_PERIOD
    return max(min_steps, STEPS_A_HARMONIC * cycle.harmonics)


def floquet_on(
    osc: Oscillator,
    V: np.ndarray,
    few: int,
    cycle: PeriodicMotion,
    rougher: PeriodicMotion,
    precision: type = np.float64,
) -> Floquet:
    """Multipliers of a cycle in orthonormal columns V (n, r), by the trapezoidal rule.

    Parameters
    ----------
    osc : Oscillator
    V : ndarray (n, r)
    few : int
        Number of the first columns of V, which are a smaller basis.
    cycle : PeriodicMotion
    rougher : PeriodicMotion
        The same cycle with fewer harmonics.
    precision : type
        Floating-point type of `trapezoidal`.

    Errors are the changes of sizes by half as many steps for the rougher cycle in the smaller
    basis.
    """
    small = osc.on(V)
    cycle_on_basis, rough = (replace(c, Q=c.Q @ V) for c in (cycle, rougher))
    fine = _ordered_multipliers(
        small, cycle_on_basis, trapezoidal(small, cycle_on_basis, TRAPEZOIDAL_STEPS, precision)
    )
    rough = replace(rough, Q=rough.Q[:, :few])
    period_map = trapezoidal(osc.on(V[:, :few]), rough, TRAPEZOIDAL_STEPS // 2, precision)
    coarse = np.linalg.eigvals(period_map)
    sizes = np.abs(fine.vectors[: small.n]) ** 2
    inside = sizes[:few].sum(axis=0) > 0.5 * sizes.sum(axis=0)
    return replace(fine, errors=_changes(fine, coarse, inside))


def _ordered_multipliers(osc: Oscillator, cycle: PeriodicMotion, whole: np.ndarray) -> Floquet:
    """Multipliers of a monodromy matrix, in order, without an error."""
    multipliers, vectors = la.eig(whole)
    Q, omega = cycle.Q, cycle.omega
    synthesis, slope = series_at(np.zeros(1), cycle.harmonics)
    velocity = omega * (slope @ Q)[0]
    force = osc.spread(osc.evaluate(synthesis @ Q, velocity[None]).f)[0]
    acceleration = force - osc.C @ velocity - osc.K @ (synthesis @ Q)[0]
    # the deviation along the motion belongs to the trivial multiplier
    flow = np.concatenate([cycle.omega * velocity, acceleration])
    along = np.abs(flow @ vectors.conj()) * (np.abs(multipliers - 1.0) < 0.5)
    trivial_index = (
        int(np.argmax(along)) if along.any() else int(np.argmin(np.abs(multipliers - 1.0)))
    )
    order = [k for k in np.argsort(-np.abs(multipliers), kind="stable") if k != trivial_index] + [
        trivial_index
    ]
    multipliers, vectors = multipliers[order], vectors[:, order]
    vectors[: osc.n] /= cycle.omega
    vectors /= la.norm(vectors, axis=0)
    return Floquet(multipliers, vectors, np.zeros(len(multipliers)), 2 * np.pi / cycle.omega)


def _difference(fine: np.ndarray, coarse: np.ndarray) -> float:
    """Largest distance of a multiplier that counts to the nearest of the coarse ones."""
    distances = np.abs(fine[_counts(fine), None] - coarse).min(axis=1)
    return float(distances.max(initial=0.0))


def _size_change(floquet: Floquet, other: Floquet) -> float:
    """Largest difference of sizes of the multipliers that count, each paired with its nearest."""
    fine, coarse = floquet.multipliers[:-1], other.multipliers[:-1]
    fine_rows, pairs = least_assignment(np.abs(fine[:, None] - coarse))
    change = np.abs(np.abs(fine[fine_rows]) - np.abs(coarse[pairs]))
    return float(change[_counts(fine)[fine_rows]].max(initial=0.0))


def _counts(multipliers: np.ndarray) -> np.ndarray:
    """Mask of the multipliers that count in errors: the first, which is largest, and large ones."""
    size = np.abs(multipliers)
    return np.asarray(size >= min([LEAST_MULTIPLIER, *size[:1]]))


def _changes(floquet: Floquet, coarse: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Change (2 n,) of the sizes of the fine multipliers against the coarse ones.

    Multipliers near the unit circle or beyond it whose deviations lie `inside` the smaller basis,
    and the trivial one, are paired with the coarse ones; all others get the largest of these
    changes. One that is real and positive is at least as uncertain as the one that must be 1.
    """
    fine = floquet.multipliers
    fine_rows = np.flatnonzero((np.abs(fine) > ERROR_MIN_MULTIPLIER) & inside)
    fine_rows = np.union1d(fine_rows, [len(fine) - 1])
    rows, pairs = least_assignment(np.abs(fine[fine_rows, None] - coarse))
    changes = np.abs(np.abs(fine[fine_rows[rows]]) - np.abs(coarse[pairs]))
    errors = np.full(len(fine), changes.max())
    errors[fine_rows[rows]] = changes
    slow = (np.abs(fine.imag) <= errors) & (fine.real > 0)
    errors[slow] = np.maximum(errors[slow], abs(floquet.trivial - 1.0))
    return errors


def trapezoidal(
    osc: Oscillator, cycle: PeriodicMotion, steps: int, precision: type = np.float64
) -> np.ndarray:
    """The matrix of `monodromy` by the trapezoidal rule: n linear equations in each step.

    The rule turns fast deviations too slowly, but neither feeds nor damps them: it preserves the
    sizes of multipliers. In single precision, whose round-off is far below the errors of a basis,
    it costs less.
    """
    n, h = osc.n, precision(2 * np.pi / steps)
    Q: np.ndarray = np.eye(2 * n, n, dtype=precision)  # deviations in rows: LAPACK's memory order
    P = np.roll(Q, n, axis=0)
    identity: np.ndarray = np.eye(n, dtype=precision)
    (solve,) = get_lapack_funcs(("gesv",), (Q,))
    C, K = _averaged(osc, cycle, steps, precision)
    pull = -(P @ C(0).T + Q @ K(0).T)
    for step in range(1, steps + 1):
        C1, K1 = C(step % steps), K(step % steps)
        middle = Q + h / 2 * P
        right_side = P + h / 2 * (pull - middle @ K1.T)
        _, _, x, lapack_status = solve(
            identity + h / 2 * C1 + h**2 / 4 * K1, right_side.T, overwrite_b=True
        )
        if lapack_status:
            raise ConvergenceError("singular", "a step of small deviations is singular")
        Q, pull, P = middle + h / 2 * x.T, 2 / h * (x.T - P) - pull, x.T
    return np.vstack([Q.T, P.T]).astype(float)


Matrices = Callable[[int], np.ndarray]


def _averaged(
    osc: Oscillator, cycle: PeriodicMotion, steps: int, precision: type
) -> tuple[Matrices, Matrices]:
    """Functions that return damping / omega and stiffness / omega^2 (n, n) at a step's number.

    Tangents of contact points are averaged about the step with weights that fall linearly to zero
    at its neighbours: where points open, close or stick within a step, all of that counts.
    """
    local = sampled(osc, sampling(cycle.harmonics, SAMPLES_PER_STEP * steps), cycle.Q, cycle.omega)
    finer, omega = len(local.f) // steps, cycle.omega
    weights = (finer - np.abs(np.arange(1 - finer, finer))) / finer**2
    arrays = weights, osc.C / omega, osc.K / omega**2, local.by_w / omega, local.by_y / omega**2
    cast: list[np.ndarray] = [A.astype(precision) for A in arrays]
    weights, C, K, by_w, by_y = cast
    offsets = np.arange(1 - finer, finer)

    def mean(D: np.ndarray, step: int) -> np.ndarray:
        samples = D[(finer * step + offsets) % len(D)]
        return osc.projected(np.tensordot(weights, samples, 1))

    return (lambda step: C - mean(by_w, step), lambda step: K - mean(by_y, step))
