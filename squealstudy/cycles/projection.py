"""Few vectors on which the motions of one mode family are balanced, out of all coordinates.

Each harmonic has vectors of its own; those of the first begin with the complex mode. What the
balance in all coordinates then has missing is solved by blocks, each harmonic with the mean
tangents of the motion; this correction is the estimate of what the basis errs by, and its main
directions in elastic energy join the vectors of their harmonics (residual-driven enrichment). A
model of few coordinates is balanced as it is.
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

MAX_VECTORS_PER_HARMONIC = 100  # vectors, of a harmonic at most
# mean over the harmonics above which a basis begins anew, with the last motions
REBUILD_BASIS_SIZE = 50
# and where one motion is corrected: its own harmonics and what they lack are enough
REBUILD_BASIS_SIZE_SINGLE = 8
MAX_MOTIONS_KEPT = 12  # motions
STABILITY_BAND_FACTOR = 1.5  # times the band: complex modes in which a cycle's stability is judged
# times a cycle's size, of the motion whose difference to it is among them
NEIGHBOUR_SIZE_RATIO = 1.02
MAX_MAIN_DIRECTIONS = 60  # and main directions of its basis there, at most
# of the largest direction of modes of unit energy: what is less is there already
MODE_RANK_TOLERANCE = 1e-2
MOTION_RANK_TOLERANCE = 1e-6  # of the largest direction of these motions
MAX_ENRICHMENTS = 12  # enrichments at one motion
BY_BLOCKS = 6  # of them at most after Newton's method has failed
MIN_REL_DIRECTION = 0.1  # of the largest direction of a correction: what is less does not join
MAX_REL_SIZE_CHANGE = 0.15  # change of size by more harmonics, beyond which it is another cycle
# error of the basis above which it grows along curves, and of cycles
CURVE_BASIS_ERROR, CYCLE_BASIS_ERROR = 1e-2, 1e-3
PROJECTED_TOLERANCE = 1e-5  # of the equations in a basis, which errs by more
# of those of a cycle there, whose size follows from a small slope of damping
CYCLE_PROJECTED_TOLERANCE = 1e-8
# what is held while a motion is corrected: places among the unknowns
SIZE_HELD, DAMPING_HELD = -2, -1


class Projection:
    """Oscillator in all coordinates, and its basis for one family.

    Parameters
    ----------
    osc : Oscillator
    phi : ndarray (n,) complex
        Right vector of the mode that the family begins with.
    omega : float
        Of the mode, rad/s.
    """

    def __init__(self, osc: Oscillator, phi: np.ndarray, omega: float) -> None:
        self.whole, self.omega = osc, omega
        self.weight = np.sqrt(np.abs(np.diag(osc.K)) + omega**2)
        self.vectors: list[np.ndarray] = []  # (n, r_h) of the harmonics from 0 on
        self._blocks: Blocks | None = None
        self._moved = False  # since the blocks were made
        self._recent: list[PeriodicMotion] = []
        if osc.n > MAX_UNPROJECTED_COORDINATES:
            self.vectors = [np.zeros((osc.n, 0)), self._orthonormal([phi.real, phi.imag])]

    @property
    def complete(self) -> bool:
        """Whether the basis is that of all coordinates."""
        return not self.vectors

    @property
    def size(self) -> int:
        """Number of vectors of all harmonics, or of coordinates."""
        return sum(V.shape[1] for V in self.vectors) if self.vectors else self.whole.n

    @classmethod
    def about(cls, osc: Oscillator, motion: PeriodicMotion) -> Projection:
        """On the harmonics of a motion."""
        H = motion.harmonics
        projection = cls(osc, motion.Q[1] - 1j * motion.Q[H + 1], motion.omega)
        if not projection.complete:
            projection._begin_anew(motion)
        return projection

    def move(self, osc: Oscillator) -> None:
        """To another design, on the same basis."""
        self.whole, self._moved = osc, True

    def of_harmonics(self, harmonics: int) -> list[np.ndarray] | None:
        """Vectors (n, r_h) of the harmonics 0 to `harmonics`; None for all coordinates."""
        if self.complete:
            return None
        missing = harmonics + 1 - len(self.vectors)
        self.vectors += [np.zeros((self.whole.n, 0)) for _ in range(missing)]
        return self.vectors[: harmonics + 1]

    def equations(self, harmonics: int) -> CycleEquations:
        """Equations of motions in the basis."""
        tolerance = TOLERANCE if self.complete else PROJECTED_TOLERANCE
        vectors = self.of_harmonics(harmonics)
        return CycleEquations(self.whole, harmonics, self.omega, tolerance, vectors)

    # -- what the basis errs by --------------------------------------------------------------------
    def correction(
        self, motion: PeriodicMotion, fresh: bool = False, local: LocalForces | None = None
    ) -> PeriodicMotion:
        """By what a motion (of all coordinates) that is balanced in the basis is corrected.

        A `Blocks.step`, with the blocks of the last motion of which they were made. `local` are
        its sampled forces, where known.
        """
        H = motion.harmonics
        if self.complete:
            return PeriodicMotion(np.zeros_like(motion.Q), 0.0)
        osc = self.whole
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
        """The cycle of all coordinates near one of the basis, to first order.

        The correction keeps its size and changes the damping that it needs; the size at which none
        is needed is found in the basis.
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
        """Basis (n, r) for small deviations from a motion: what its stability is judged on.

        Complex modes of the motion's mean tangents up to `STABILITY_BAND_FACTOR` times `highest`
        [rad/s], the motion's series, the main directions of the vectors of all harmonics, and what
        becomes of it at another size. Its first columns, whose number is returned too, are the same
        without that and without modes above `highest`.
        """
        local = sampled(self.whole, self.whole.sampling(motion.harmonics), motion.Q, motion.omega)
        K, C = mean_tangents(self.whole, local, motion.parameter)
        lam, psi = dense_roots(C, K, (0.0, STABILITY_BAND_FACTOR * highest))
        low = np.abs(lam) <= highest
        own_directions = self._directions(self._unit(np.hstack(self.vectors)))[
            :, :MAX_MAIN_DIRECTIONS
        ]
        few = self._directions(
            np.hstack([self._unit(motion.Q.T), own_directions, self._unit(psi[:, low])])
        )
        more = np.hstack(
            [self._unit(X) for X in (psi[:, ~low], *(Q.T for Q in self._aside(motion)))]
        )
        directions = np.hstack([few, self._directions(more - few @ (few.T @ more))])
        Q, _ = la.qr(directions / self.weight[:, None], mode="economic")
        return np.asarray(Q), few.shape[1]

    def _aside(self, motion: PeriodicMotion) -> list[np.ndarray]:
        """Changes (2 H + 1, n) to the motion of another size: ways of slow deviations."""
        try:
            near, _ = self.solve(replace(motion, Q=NEIGHBOUR_SIZE_RATIO * motion.Q), SIZE_HELD)
            first = near.changed(self.correction(near, True))
            second = first.changed(self.correction(first))
        except ConvergenceError:
            return []
        return [first.Q - motion.Q, second.Q - motion.Q]

    def _unit(self, vectors: np.ndarray) -> np.ndarray:
        """Real and imaginary parts, weighted, of unit elastic energy; none where there is none."""
        parts = np.hstack([vectors.real, vectors.imag]) * self.weight[:, None]
        sizes = la.norm(parts, axis=0)
        nonzero = sizes > 0.0  # real roots have no imaginary part
        unit: np.ndarray = parts[:, nonzero] / sizes[nonzero]
        return unit

    @staticmethod
    def _directions(vectors: np.ndarray) -> np.ndarray:
        """Main directions of weighted vectors."""
        if not vectors.shape[1]:
            return vectors
        left_vectors, values, _ = la.svd(vectors, full_matrices=False)
        return np.asarray(left_vectors[:, values > MODE_RANK_TOLERANCE * max(values[0], 1.0)])

    def stability(
        self, motion: PeriodicMotion, highest: float, other: PeriodicMotion | None = None
    ) -> Floquet:
        """Multipliers of a cycle, in the complex modes about it up to `highest` and its basis.

        `other` is the same cycle with another number of harmonics, for their errors; of a
        projection with fewer. Without it multipliers are of double precision: on branches they are
        followed to where they pass 1.
        """
        if self.complete:
            return floquet(self.whole, motion, other)
        V, few = self.deviations(motion, highest)
        precision = np.float64 if other is None else np.float32
        return floquet_on(self.whole, V, few, motion, other or motion, precision)

    # -- enrichment --------------------------------------------------------------------------------
    def improve(
        self, motion: PeriodicMotion, target: float, held: int
    ) -> tuple[PeriodicMotion, float, float]:
        """The motion near `motion` with a basis in which it errs by less than `target`.

        Parameters
        ----------
        held : int
            `SIZE_HELD` or `DAMPING_HELD`: what does not change.

        Returns
        -------
        motion : PeriodicMotion
            Of all coordinates.
        error, residual : float

        Raises
        ------
        ConvergenceError
            Where there is no motion, or the basis would be too large.
        """
        if not self.complete:
            self.compact(motion, REBUILD_BASIS_SIZE_SINGLE)
            self.join(motion, self.correction(motion, True))  # what more harmonics need, too
        fresh, last = False, np.inf
        for number in range(MAX_ENRICHMENTS):
            try:
                motion, residual = self.solve(motion, held)
            except ConvergenceError:  # the basis does not hold it: nearer by blocks, and again
                if self.complete or number >= BY_BLOCKS:
                    raise
                motion = self._nearer(motion, held)
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
            Where there is none, or one of another size alone.
        """
        start = replace(motion, Q=with_harmonics(motion.Q, harmonics), parameter=0.0)
        try:
            cycle, _, residual = self.improve(start, CYCLE_BASIS_ERROR, DAMPING_HELD)
            if self.complete or _of_one_size(start, cycle):
                return cycle, residual
        except ConvergenceError:
            if self.complete:
                raise
        # nearer on the curve, on a basis that holds it
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
        """A correction joins the basis, and what is missing once it is made.

        Where it is larger than the motion that would tell nothing.
        """
        self.join(motion, change)
        if self.error(motion, change) < 1.0:
            nearer = motion.changed(change)
            self.join(nearer, self.correction(nearer))

    def _nearer(self, motion: PeriodicMotion, held: int) -> PeriodicMotion:
        """A motion after a step of iteration by blocks in all coordinates; the basis holds it."""
        change = self.correction(motion, True)
        self.join(motion, change)
        return motion.changed(change if held == SIZE_HELD else replace(change, parameter=0.0))

    def remember(self, motion: PeriodicMotion) -> None:
        """A basis that begins anew will hold this motion."""
        self._recent = [*self._recent[1 - MAX_MOTIONS_KEPT :], motion]

    def solve(self, motion: PeriodicMotion, held: int) -> tuple[PeriodicMotion, float]:
        """The motion of the basis near one of all coordinates, and its residual."""
        equations = self.equations(motion.harmonics)
        if held == DAMPING_HELD:
            equations.tolerance = min(equations.tolerance, CYCLE_PROJECTED_TOLERANCE)
        u = equations.pack(motion)
        equations.accepted(u)
        normal = np.zeros(len(u))
        normal[held] = 1.0
        u, residual, _, _ = newton(equations, u, normal, float(u[held]))
        return equations.motion(u), residual

    def join(self, motion: PeriodicMotion, change: PeriodicMotion) -> None:
        """The main directions of a correction join the vectors of their harmonics.

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

    def compact(self, motion: PeriodicMotion, most: int = REBUILD_BASIS_SIZE) -> None:
        """A basis of more than `most` vectors a harmonic begins anew, with the last motions."""
        if self.size > most * len(self.vectors):
            self._begin_anew(
                *(self._recent if most == REBUILD_BASIS_SIZE else self._recent[-1:]), motion
            )

    def _begin_anew(self, *motions: PeriodicMotion) -> None:
        rows = [list[np.ndarray]() for _ in range(1 + max(m.harmonics for m in motions))]
        for motion in motions:
            H, weighted = motion.harmonics, motion.Q * self.weight
            weighted /= la.norm(weighted)
            for h in range(H + 1):
                rows[h] += [weighted[h], *([weighted[H + h]] if h else [])]
        decomposed = [la.svd(np.array(r).T, full_matrices=False)[:2] for r in rows]
        least = MOTION_RANK_TOLERANCE * max(values[0] for _, values in decomposed)
        self.vectors = [
            self._orthonormal(list((vectors[:, values > least] / self.weight[:, None]).T))
            for vectors, values in decomposed
        ]

    def _orthonormal(self, vectors: list[np.ndarray]) -> np.ndarray:
        """Orthonormal vectors (n, r) of a span, turned so that stiffness is diagonal."""
        if not vectors:
            return np.zeros((self.whole.n, 0))
        X = np.array(vectors).T
        Q, _ = la.qr(X / la.norm(X, axis=0), mode="economic")
        _, turn = la.eigh(Q.T @ self.whole.K @ Q)
        orthonormal: np.ndarray = Q @ turn
        return orthonormal


def _of_one_size(one: PeriodicMotion, other: PeriodicMotion) -> bool:
    """Whether the first harmonics of two motions are nearly of one size."""
    return abs(other.size / one.size - 1.0) < MAX_REL_SIZE_CHANGE
