"""A basis of few vectors, in which the motions of one mode family are balanced.

Each harmonic has vectors of its own; those of the first begin with the complex mode. The residual
that remains in all coordinates is solved by blocks, each harmonic with the mean tangents of the
motion. This correction estimates the error of the basis, and its main directions in elastic energy
join the vectors of their harmonics (residual-driven enrichment). A model of few coordinates has no
basis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.balance import imbalance, sampled
from squealstudy.cycles.blocks import Blocks, mean_tangents
from squealstudy.cycles.continuation import TOLERANCE, newton
from squealstudy.cycles.equations import CycleEquations, PeriodicMotion
from squealstudy.cycles.floquet import Floquet, floquet, floquet_on
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES, LocalForces, Oscillator
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.dense_qep import dense_roots

MAX_VECTORS_PER_HARMONIC = 100
# vectors, mean over the harmonics, above which a basis is rebuilt from the last motions
REBUILD_BASIS_SIZE = 50
REBUILD_BASIS_SIZE_SINGLE = 8  # the same where a single motion is corrected, not a curve
MAX_MOTIONS_KEPT = 12  # last motions from which a basis is rebuilt
# stability of a cycle: its deviations are spanned by complex modes up to this factor times a band,
STABILITY_BAND_FACTOR = 1.5
NEIGHBOUR_SIZE_RATIO = 1.02  # by the difference to the motion of this size over the cycle's,
MAX_MAIN_DIRECTIONS = 60  # and by up to so many main directions of its basis
# singular values over the largest, below which directions count as dependent: of unit-energy modes,
MODE_RANK_TOLERANCE = 1e-2
MOTION_RANK_TOLERANCE = 1e-6  # and of the last motions
MAX_ENRICHMENTS = 12  # most extensions of the basis for one motion
MAX_BLOCK_STEPS = 6  # most of these steps after a failure of Newton's method
MIN_REL_DIRECTION = 0.1  # directions with a smaller singular value, over the largest, do not join
MAX_REL_SIZE_CHANGE = 0.15  # if more harmonics change the size by more, they give another cycle
# relative error above which a basis is enriched: along curves, at cycles
CURVE_BASIS_ERROR, CYCLE_BASIS_ERROR = 1e-2, 1e-3
PROJECTED_TOLERANCE = 1e-5  # residual of the equations in a basis, below its error
CYCLE_PROJECTED_TOLERANCE = 1e-8  # at a cycle, whose size follows from a small slope of damping
# index of the unknown that is fixed while a motion is corrected
SIZE_HELD, DAMPING_HELD = -2, -1


class Projection:
    """An oscillator and the basis of one mode family.

    Parameters
    ----------
    osc : Oscillator
    phi : ndarray (n,) complex
        Right vector of the mode that the family begins with.
    omega : float
        Angular frequency of that mode, rad/s.
    """

    def __init__(self, osc: Oscillator, phi: np.ndarray, omega: float) -> None:
        self.oscillator, self.omega = osc, omega
        self.weight = np.sqrt(np.abs(np.diag(osc.K)) + omega**2)
        self.vectors: list[np.ndarray] = []  # (n, r_h), one array for each harmonic from 0 on
        self._blocks: Blocks | None = None
        self._moved = False  # whether the oscillator has changed since the blocks were made
        self._recent: list[PeriodicMotion] = []
        if osc.n > MAX_UNPROJECTED_COORDINATES:
            self.vectors = [np.zeros((osc.n, 0)), self._orthonormal([phi.real, phi.imag])]

    @property
    def complete(self) -> bool:
        """Whether motions are balanced in all coordinates, without a basis."""
        return not self.vectors

    @property
    def size(self) -> int:
        """Number of vectors of all harmonics, or of coordinates."""
        return sum(V.shape[1] for V in self.vectors) if self.vectors else self.oscillator.n

    @classmethod
    def on_harmonics_of(cls, osc: Oscillator, motion: PeriodicMotion) -> Projection:
        """The projection on the harmonics of a motion."""
        H = motion.harmonics
        projection = cls(osc, motion.Q[1] - 1j * motion.Q[H + 1], motion.omega)
        if not projection.complete:
            projection._begin_anew(motion)
        return projection

    def move(self, osc: Oscillator) -> None:
        """Use the oscillator of another design on the same basis."""
        self.oscillator, self._moved = osc, True

    def of_harmonics(self, harmonics: int) -> list[np.ndarray] | None:
        """Vectors (n, r_h) of the harmonics 0 to `harmonics`; None for all coordinates."""
        if self.complete:
            return None
        missing = harmonics + 1 - len(self.vectors)
        self.vectors += [np.zeros((self.oscillator.n, 0)) for _ in range(missing)]
        return self.vectors[: harmonics + 1]

    def equations(self, harmonics: int) -> CycleEquations:
        """Equations of motions in the basis."""
        tolerance = TOLERANCE if self.complete else PROJECTED_TOLERANCE
        vectors = self.of_harmonics(harmonics)
        return CycleEquations(self.oscillator, harmonics, self.omega, tolerance, vectors)

    # -- error of the basis ------------------------------------------------------------------------
    def correction(
        self, motion: PeriodicMotion, fresh: bool = False, local: LocalForces | None = None
    ) -> PeriodicMotion:
        """The correction, in all coordinates, of a motion that is balanced in the basis.

        It is a `Blocks.step` with the blocks of an earlier motion; with `fresh` new blocks are made
        unless that motion is near. `local` are sampled forces of the motion, if computed before.
        """
        H = motion.harmonics
        if self.complete:
            return PeriodicMotion(np.zeros_like(motion.Q), 0.0)
        osc = self.oscillator
        if local is None:
            local = sampled(osc, osc.sampling(H), motion.Q, motion.omega)
        blocks = self._blocks
        blocks_valid = blocks is not None and not self._moved and motion.near(blocks.motion)
        if blocks is None or blocks.harmonics < H or (fresh and not blocks_valid):
            blocks = self._blocks = Blocks(osc, motion, local, self.weight)
            self._moved = False
        R = imbalance(osc, motion.Q, motion.omega, motion.parameter, local)
        if not np.isfinite(R).all():
            raise ConvergenceError("not_finite", "the forces of a periodic motion are not finite")
        return blocks.step(R, motion)

    def corrected(self, cycle: PeriodicMotion) -> PeriodicMotion:
        """The cycle in all coordinates near one of the basis, to first order.

        The correction keeps the size and changes the added damping. So the basis is solved for the
        motion whose added damping the correction takes back to zero.
        """
        if self.complete:
            return cycle
        change = self.correction(cycle)
        try:
            with_damping, _ = self.solve(replace(cycle, parameter=-change.parameter), DAMPING_HELD)
        except ConvergenceError:
            with_damping = cycle
        return PeriodicMotion(with_damping.Q + change.Q, with_damping.omega + change.omega)

    def error(self, motion: PeriodicMotion, correction: PeriodicMotion) -> float:
        """Norm of a correction over that of the motion, both in elastic energy."""
        ratio = la.norm(correction.Q * self.weight) / la.norm(motion.Q * self.weight)
        return float(ratio)

    def deviations(self, motion: PeriodicMotion, highest: float) -> tuple[np.ndarray, int]:
        """Basis (n, r) of small deviations from a motion, in which its stability is judged.

        Its first columns, whose number is returned too, span the motion's series, main directions
        of the vectors of all harmonics, and complex modes of its mean tangents up to `highest`
        [rad/s]. The others add modes up to `STABILITY_BAND_FACTOR` times that, and changes of the
        motion with its size.
        """
        local = sampled(
            self.oscillator, self.oscillator.sampling(motion.harmonics), motion.Q, motion.omega
        )
        K, C = mean_tangents(self.oscillator, local, motion.parameter)
        lam, psi = dense_roots(C, K, (0.0, STABILITY_BAND_FACTOR * highest))
        low = np.abs(lam) <= highest
        basis_directions = self._directions(self._unit(np.hstack(self.vectors)))[
            :, :MAX_MAIN_DIRECTIONS
        ]
        low_directions = self._directions(
            np.hstack([self._unit(motion.Q.T), basis_directions, self._unit(psi[:, low])])
        )
        high_vectors = np.hstack(
            [self._unit(X) for X in (psi[:, ~low], *(Q.T for Q in self._changes_of_size(motion)))]
        )
        directions = np.hstack(
            [
                low_directions,
                self._directions(high_vectors - low_directions @ (low_directions.T @ high_vectors)),
            ]
        )
        Q, _ = la.qr(directions / self.weight[:, None], mode="economic")
        return np.asarray(Q), low_directions.shape[1]

    def _changes_of_size(self, motion: PeriodicMotion) -> list[np.ndarray]:
        """Differences (2 H + 1, n) to a larger motion, where slow deviations go; may be empty."""
        try:
            larger, _ = self.solve(replace(motion, Q=NEIGHBOUR_SIZE_RATIO * motion.Q), SIZE_HELD)
            once_corrected = larger.changed(self.correction(larger, True))
            twice_corrected = once_corrected.changed(self.correction(once_corrected))
        except ConvergenceError:
            return []
        return [once_corrected.Q - motion.Q, twice_corrected.Q - motion.Q]

    def _unit(self, vectors: np.ndarray) -> np.ndarray:
        """Real and imaginary parts of vectors (n, m), weighted and scaled to unit elastic energy.

        Zero columns are left out.
        """
        parts = np.hstack([vectors.real, vectors.imag]) * self.weight[:, None]
        sizes = la.norm(parts, axis=0)
        nonzero = sizes > 0.0  # real roots have no imaginary part
        unit: np.ndarray = parts[:, nonzero] / sizes[nonzero]
        return unit

    @staticmethod
    def _directions(vectors: np.ndarray) -> np.ndarray:
        """Orthonormal main directions (n, r) of weighted vectors (n, m)."""
        if not vectors.shape[1]:
            return vectors
        left_vectors, values, _ = la.svd(vectors, full_matrices=False)
        return np.asarray(left_vectors[:, values > MODE_RANK_TOLERANCE * max(values[0], 1.0)])

    def stability(
        self, motion: PeriodicMotion, highest: float, other: PeriodicMotion | None = None
    ) -> Floquet:
        """Multipliers of a cycle; on a projected model those of `deviations`.

        `other` is the same cycle with another number of harmonics (fewer in a basis), for the
        errors of the multipliers. With it the multipliers of a basis are computed in single
        precision; without it in double precision, as branches follow them to 1.
        """
        if self.complete:
            return floquet(self.oscillator, motion, other)
        V, few = self.deviations(motion, highest)
        precision = np.float64 if other is None else np.float32
        return floquet_on(self.oscillator, V, few, motion, other or motion, precision)

    # -- enrichment --------------------------------------------------------------------------------
    def improve(
        self, motion: PeriodicMotion, target: float, fixed_unknown: int
    ) -> tuple[PeriodicMotion, float, float]:
        """The motion near `motion`, the basis enriched until its error is less than `target`.

        Parameters
        ----------
        fixed_unknown : int
            `SIZE_HELD` or `DAMPING_HELD`: the unknown that keeps its value.

        Returns
        -------
        motion : PeriodicMotion
            The motion in the basis, as a series in all coordinates.
        error, residual : float
            Error of the basis, and residual of the balance.

        Raises
        ------
        ConvergenceError
            Where there is no motion, or the basis would be too large.
        """
        if not self.complete:
            self.compact(motion, REBUILD_BASIS_SIZE_SINGLE)
            self.join(motion, self.correction(motion, True))  # new harmonics have no vectors yet
        fresh, last = False, np.inf
        for number in range(MAX_ENRICHMENTS):
            try:
                motion, residual = self.solve(motion, fixed_unknown)
            except ConvergenceError:  # the basis does not span it: enrich by a block step, retry
                if self.complete or number >= MAX_BLOCK_STEPS:
                    raise
                motion = self._block_step(motion, fixed_unknown)
                continue
            change = self.correction(motion, fresh)
            error, fresh = self.error(motion, change), False
            if error < target:
                self.remember(motion)
                return motion, error, residual
            fresh = error > 0.5 * last
            last = error
            self.grow(motion, change)
        raise ConvergenceError("basis", f"the basis errs by {last:.1e} with {self.size} vectors")

    def cycle_near(self, motion: PeriodicMotion, harmonics: int) -> tuple[PeriodicMotion, float]:
        """The cycle near a motion with a number of harmonics, and its residual.

        Raises
        ------
        ConvergenceError
            Where there is none, or its size differs much.
        """
        start = replace(motion, Q=with_harmonics(motion.Q, harmonics), parameter=0.0)
        try:
            cycle, _, residual = self.improve(start, CYCLE_BASIS_ERROR, DAMPING_HELD)
            if self.complete or _of_one_size(start, cycle):
                return cycle, residual
        except ConvergenceError:
            if self.complete:
                raise
        # start from the motion on the curve, on a basis that spans it
        of_its_size = replace(
            self.improve(replace(start, parameter=motion.parameter), CURVE_BASIS_ERROR, SIZE_HELD)[
                0
            ],
            parameter=0.0,
        )
        cycle, _, residual = self.improve(of_its_size, CYCLE_BASIS_ERROR, DAMPING_HELD)
        if not _of_one_size(start, cycle):
            raise ConvergenceError("another_cycle", "more harmonics lead to another cycle")
        return cycle, residual

    def grow(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """Add a correction to the basis, and the next correction of the motion thus corrected.

        The next one is left out where the first is larger than the motion.
        """
        self.join(motion, change)
        if self.error(motion, change) < 1.0:
            nearer = motion.changed(change)
            self.join(nearer, self.correction(nearer))

    def _block_step(self, motion: PeriodicMotion, fixed_unknown: int) -> PeriodicMotion:
        """The motion after one block step in all coordinates, which is added to the basis."""
        change = self.correction(motion, True)
        self.join(motion, change)
        return motion.changed(
            change if fixed_unknown == SIZE_HELD else replace(change, parameter=0.0)
        )

    def remember(self, motion: PeriodicMotion) -> None:
        """Add a motion to those from which a basis is rebuilt."""
        self._recent = [*self._recent[1 - MAX_MOTIONS_KEPT :], motion]

    def solve(self, motion: PeriodicMotion, fixed_unknown: int) -> tuple[PeriodicMotion, float]:
        """The motion in the basis near a motion in all coordinates, and its residual."""
        equations = self.equations(motion.harmonics)
        if fixed_unknown == DAMPING_HELD:
            equations.tolerance = min(equations.tolerance, CYCLE_PROJECTED_TOLERANCE)
        u = equations.pack(motion)
        equations.accepted(u)
        normal = np.zeros(len(u))
        normal[fixed_unknown] = 1.0
        u, residual, _, _ = newton(equations, u, normal, float(u[fixed_unknown]))
        return equations.motion(u), residual

    def join(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """Add the main directions of a correction to the vectors of their harmonics.

        Raises
        ------
        ConvergenceError
            Where the basis would be too large.
        """
        H, by_harmonic = motion.harmonics, list[tuple[np.ndarray, np.ndarray]]()
        for h, V in enumerate(self.of_harmonics(H) or []):
            X = (change.Q[sorted({h, H * (h > 0) + h})] * self.weight).T
            orthonormal, _ = la.qr(self.weight[:, None] * V, mode="economic")
            vectors, values, _ = la.svd(X - orthonormal @ (orthonormal.T @ X), full_matrices=False)
            by_harmonic.append((vectors / self.weight[:, None], values))
        largest = max(values[0] for _, values in by_harmonic)
        for h, (vectors, values) in enumerate(by_harmonic):
            new = vectors[:, values > MIN_REL_DIRECTION * largest]
            if self.vectors[h].shape[1] + new.shape[1] > MAX_VECTORS_PER_HARMONIC:
                raise ConvergenceError(
                    "basis",
                    f"more than {MAX_VECTORS_PER_HARMONIC} vectors of a harmonic would be needed",
                )
            if new.shape[1]:
                self.vectors[h] = self._orthonormal([*self.vectors[h].T, *new.T])

    def compact(self, motion: PeriodicMotion, max_size: int = REBUILD_BASIS_SIZE) -> None:
        """Rebuild a basis of more than `max_size` vectors a harmonic from the last motions."""
        if self.size > max_size * len(self.vectors):
            self._begin_anew(
                *(self._recent if max_size == REBUILD_BASIS_SIZE else self._recent[-1:]), motion
            )

    def _begin_anew(self, *motions: PeriodicMotion) -> None:
        """Make the basis of each harmonic anew from some motions."""
        rows = [list[np.ndarray]() for _ in range(1 + max(m.harmonics for m in motions))]
        for motion in motions:
            H, weighted = motion.harmonics, motion.Q * self.weight
            weighted /= la.norm(weighted)
            for h in range(H + 1):
                rows[h] += [weighted[h], *([weighted[H + h]] if h else [])]
        decomposed = [la.svd(np.array(r).T, full_matrices=False)[:2] for r in rows]
        min_value = MOTION_RANK_TOLERANCE * max(values[0] for _, values in decomposed)
        self.vectors = [
            self._orthonormal(list((vectors[:, values > min_value] / self.weight[:, None]).T))
            for vectors, values in decomposed
        ]

    def _orthonormal(self, vectors: list[np.ndarray]) -> np.ndarray:
        """Orthonormal vectors (n, r) that span `vectors` and make the stiffness diagonal."""
        if not vectors:
            return np.zeros((self.oscillator.n, 0))
        X = np.array(vectors).T
        Q, _ = la.qr(X / la.norm(X, axis=0), mode="economic")
        _, turn = la.eigh(Q.T @ self.oscillator.K @ Q)
        orthonormal: np.ndarray = Q @ turn
        return orthonormal


def _of_one_size(motion: PeriodicMotion, other: PeriodicMotion) -> bool:
    """Whether the sizes of two motions are nearly the same."""
    return abs(other.size / motion.size - 1.0) < MAX_REL_SIZE_CHANGE
