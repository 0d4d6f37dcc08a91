"""One basis for a whole box of design points, from right and left complex modes, by greedy choice.

The modes at chosen points are truncated by SVD in the energy norm. The next point is that of a
sample whose estimated error against the full problem is largest (THEORY.md eq. (37), (39)).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs, all_pairs
from squealstudy.modes.reanalysis.estimate import bounded, two_sided_error
from squealstudy.modes.reanalysis.polynomials import CollocatedSystem, collocate
from squealstudy.modes.reanalysis.problem import (
    Linearisation,
    SweptProblem,
    in_band,
    lightly_damped,
)
from squealstudy.system.parametric import Weights

BASIS_BAND_FACTOR = 1.15  # modes within this factor of the band join the basis
TESTED_BAND_FACTOR = 1.03  # errors are estimated of modes within this factor of the band
CANDIDATES = 24  # candidates for the next design point, half of them on faces of the box
TRUNCATION = 0.5  # least singular value of the basis, over the square root of the tolerance
CUTOFF_REDUCTION = 0.7  # factor on that value where another point does not help
STALLED = 0.5  # the last points have not helped if the error stays above this share
WEIGHT_TOLERANCE = 0.01  # largest error of the expansion of weights, over the tolerance
LEAST_WEIGHT_TOLERANCE = 1e-9
LEAST_CUT = 1e-9  # relative singular value at which the basis is not enlarged any more
# distance of an exact root from the nearest one of the basis, over the tolerance, beyond which the
# basis has no such mode
LACKING = 10.0
SAMPLES_A_DIMENSION = 60  # samples of weights for each parameter
MOST_SAMPLES = 240
POINTS_PER_BATCH = 64  # points whose weights are computed together

Report = Callable[[int, int], None]


@dataclass(frozen=True)
class SweepBasis:
    """A projection that serves a box of design points.

    Attributes
    ----------
    V : ndarray (n, r)
        Real basis; V^T M0 V = I and V^T K0 V is diagonal.
    flexibility : ndarray (r,)
        Inverse of that diagonal.
    small : CollocatedSystem
        The projected system.
    error : float
        Largest estimated relative error of light modes at the last candidates.
    trained : ndarray (q, d)
        Design points whose modes are in the basis.
    seconds : float
        Processor seconds that it took to make it.
    interpolated : float
        Largest error of roots, relative to their moduli, by interpolation of the problem over the
        box. Estimates at design points do not include it.
    """

    V: np.ndarray
    flexibility: np.ndarray
    small: CollocatedSystem
    error: float
    trained: np.ndarray
    seconds: float = field(compare=False, default=0.0)
    interpolated: float = 0.0

    def pairs(self, weights: Weights) -> Eigenpairs:
        """All pairs of the projected problem in reduced coordinates."""
        C, K = self.small.matrices([weights])
        return all_pairs(C[0], K[0])

    def expand(self, weights: Weights, pairs: Eigenpairs) -> Eigenpairs:
        """Reduced pairs in the coordinates of the full problem."""
        left_vectors = pairs.Y
        if not self.small.unit_mass:
            left_vectors = np.linalg.solve(self.small.mass(weights).T, left_vectors)
        return Eigenpairs(pairs.lam, self.V @ pairs.X, self.V @ left_vectors)


def sample_box(dimension: int, count: int, seed: int) -> np.ndarray:
    """Points (count, d) that fill [-1, 1]^d."""
    if not dimension:
        return np.zeros((1, 0))
    from scipy.stats import qmc  # slow to import, and few studies need it

    sobol = qmc.Sobol(dimension, scramble=True, seed=np.random.default_rng(seed))
    unit = sobol.random_base2(int(np.ceil(np.log2(max(count, 2)))))[:count]
    points: np.ndarray = 2.0 * unit - 1.0
    return points


def corners(dimension: int) -> np.ndarray:
    """The corners of [-1, 1]^d, at most the first 16."""
    if not dimension:
        return np.zeros((1, 0))
    grid = np.array(np.meshgrid(*[[-1.0, 1.0]] * dimension)).reshape(dimension, -1).T
    return grid[:16]


def build_sweep_basis(
    problem: SweptProblem,
    tolerance: float,
    max_points: int = 16,
    report: Report = lambda done, total: None,
) -> SweepBasis:
    """Make the basis of a box.

    Parameters
    ----------
    problem : SweptProblem
    tolerance : float
        Relative error of light roots.
    max_points : int
        Most design points whose modes join the basis.
    report : callable
        Called with the number of points so far, and the most.

    Raises
    ------
    ConvergenceError
        Where more than half of the samples in the box, or the first points, have no working point
        (``working_point``), or no first point has a mode in the band (``no_modes``).
    """
    started = time.process_time()
    samples = _sampled_weights(problem)
    limit = max(WEIGHT_TOLERANCE * tolerance, LEAST_WEIGHT_TOLERANCE)
    cut, last = TRUNCATION * np.sqrt(tolerance), np.inf
    blocks: list[np.ndarray] = []
    trained: list[np.ndarray] = []
    pending = _first_points(problem.dimension)
    while True:
        for theta in pending:
            block = _snapshots(problem, theta)
            if block is not None:
                blocks.append(block)
                trained.append(theta)
        report(len(trained), max_points)
        if not blocks:
            raise ConvergenceError("working_point", "no working point at the ends of the sweeps")
        if not sum(block.shape[1] for block in blocks):
            raise ConvergenceError("no_modes", "no mode lies in the band at the ends of the sweeps")
        V, flexibility = _truncated(problem, np.hstack(blocks), cut)
        small = collocate(problem.system, samples, V, V, limit)
        basis = SweepBasis(
            V=V, flexibility=flexibility, small=small, error=np.inf, trained=np.array(trained)
        )
        points, errors = _estimates(problem, basis, len(trained))
        worst, error = points[errors.argmax()], float(errors.max())
        basis = replace(basis, error=error, seconds=time.process_time() - started)
        good = error <= tolerance
        if len(trained) >= max_points or (good and _all_seen(problem, basis, worst, tolerance)):
            return basis
        stalled = not good and error > STALLED * last and len(trained) > 3
        if stalled or not problem.dimension:
            if cut < LEAST_CUT:
                return basis
            cut *= CUTOFF_REDUCTION
        last = error
        pending = _next_points(points, errors, tolerance)[: max_points - len(trained)]


def _first_points(dimension: int) -> np.ndarray:
    """Two opposite corners and the middle (3, d), as a mode may be in the band only there."""
    if not dimension:
        return np.zeros((1, 0))
    return np.vstack([corners(dimension)[[0, -1]], np.zeros((1, dimension))])


def _all_seen(
    problem: SweptProblem, basis: SweepBasis, theta: np.ndarray, tolerance: float
) -> bool:
    """Whether the basis has every light mode of the full problem at a point.

    Residuals of the modes in a basis do not show a mode that it lacks altogether.
    """
    weights, exact = problem.pairs(theta, 1.0)
    roots_in_basis = basis.pairs(weights).lam
    if not len(exact.lam):
        return True
    distance = np.abs(exact.lam[:, None] - roots_in_basis).min(axis=1)
    missed = lightly_damped(exact.lam) & (distance > LACKING * tolerance * np.abs(exact.lam))
    return not missed.any()


def _sampled_weights(problem: SweptProblem) -> list[Weights]:
    """Weights of the terms at sampled points of the box, for training a basis."""
    count = min(SAMPLES_A_DIMENSION * max(problem.dimension, 1), MOST_SAMPLES)
    points = np.vstack([corners(problem.dimension), sample_box(problem.dimension, count, 0)])
    points = points if problem.dimension else points[:1]
    weights = [
        sample.weights
        for start in range(0, len(points), POINTS_PER_BATCH)
        for sample in problem.samples(points[start : start + POINTS_PER_BATCH])
        if isinstance(sample, Linearisation)
    ]
    if len(weights) < len(points) / 2:
        raise ConvergenceError("working_point", "most of the box has no working point")
    return weights


def _snapshots(problem: SweptProblem, theta: np.ndarray) -> np.ndarray | None:
    """Real and imaginary parts of right and left modes of unit energy, in energy coordinates.

    Modes below the band are included: a basis that spans only a part of such a mode has a Ritz
    value above the mode's, perhaps in the band, where there is no mode. A point without a mode in
    the band gives no columns; one without a working point None.
    """
    try:
        _, pairs = problem.pairs(theta, BASIS_BAND_FACTOR, below=True)
    except ConvergenceError:
        return None
    if not in_band(pairs.lam, problem.band, BASIS_BAND_FACTOR).any():
        pairs = pairs.take(np.zeros(len(pairs.lam), bool))
    parts = []
    for Z in (pairs.X, pairs.Y):
        E = problem.energy_root(np.hstack([Z.real, Z.imag]))
        m = Z.shape[1]
        size = np.sqrt((E[:, :m] ** 2).sum(axis=0) + (E[:, m:] ** 2).sum(axis=0))
        parts.append(E / np.tile(np.maximum(size, 1e-300), 2))
    return np.hstack(parts)


def _truncated(
    problem: SweptProblem, snapshots: np.ndarray, cut: float
) -> tuple[np.ndarray, np.ndarray]:
    """Basis (n, r) with unit mass and diagonal K0, and the flexibilities (r,)."""
    U, s, _ = la.svd(snapshots, full_matrices=False)
    U = U[:, s > cut * s[0]]
    V = problem.from_energy(U)
    w2, y = la.eigh(U.T @ U, V.T @ problem.mass_product(V))
    return V @ y, 1.0 / w2


def _estimates(
    problem: SweptProblem, basis: SweepBasis, step: int
) -> tuple[np.ndarray, np.ndarray]:
    """A new sample of design points (n, d) and the estimated errors (n,) there."""
    points = _on_faces(sample_box(problem.dimension, CANDIDATES, 1000 + step))
    if step <= 3 and problem.dimension:
        points = np.vstack([corners(problem.dimension), points])
    return points, np.array([estimated_error(problem, basis, theta) for theta in points])


def _next_points(points: np.ndarray, errors: np.ndarray, tolerance: float) -> np.ndarray:
    """The next points for the basis: that of the largest error, and another one away from it.

    The other one is included if its error is too large, too: estimates at a new sample cost more
    than the modes at two points.
    """
    if not points.shape[1]:
        return points[:0]
    worst = int(errors.argmax())
    distance = np.linalg.norm(points - points[worst], axis=1)
    other = int((errors * distance).argmax())
    chosen = [worst, other] if errors[other] > tolerance and other != worst else [worst]
    return points[chosen]


def _on_faces(points: np.ndarray) -> np.ndarray:
    """Every other point (n, d) moved to the nearest face, where errors are mostly largest."""
    on_faces = points.copy()
    if points.shape[1]:
        rows = np.arange(0, len(points), 2)
        axis = np.abs(points[rows]).argmax(axis=1)
        on_faces[rows, axis] = np.sign(points[rows, axis])
    return on_faces


def estimated_error(problem: SweptProblem, basis: SweepBasis, theta: np.ndarray) -> float:
    """Largest estimated relative error of light modes at a point; 0 without any."""
    try:
        weights = problem.weights(theta)
    except ConvergenceError:
        return 0.0
    pairs = basis.pairs(weights)
    pairs = pairs.take(
        in_band(pairs.lam, problem.band, TESTED_BAND_FACTOR) & lightly_damped(pairs.lam)
    )
    if not len(pairs.lam):
        return 0.0
    error = bounded(two_sided_error(problem, weights, basis.expand(weights, pairs)), pairs.lam)
    return float((error / np.abs(pairs.lam)).max())
