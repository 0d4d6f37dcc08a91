"""A design point solved by itself: its roots in the band with the estimate of their errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from squealstudy.analysis.reanalysis.estimate import bounded, residuals, two_sided_error
from squealstudy.analysis.reanalysis.point_roots import PointRoots, failed
from squealstudy.analysis.reanalysis.problem import SweptProblem
from squealstudy.analysis.reanalysis.sweep_basis import in_band
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import Eigenpairs
from squealstudy.system.parametric import Weights


def alone(
    problem: SweptProblem,
    theta: np.ndarray,
    index: int,
    method: str,
    solve: Callable[[Weights], Eigenpairs],
) -> PointRoots:
    """Roots of a point by `solve`, which gives pairs in full coordinates from its weights.

    Errors are estimated against the full problem. A point without weights is a failed one.
    """
    sample = problem.samples(np.asarray(theta)[None])[0]
    if isinstance(sample, ConvergenceError):
        return failed(index, sample)
    pairs = solve(sample.weights)
    pairs = pairs.take(in_band(pairs.lam, problem.band, 1.0))
    pairs = pairs.take(np.argsort(np.abs(pairs.lam), kind="stable"))
    error = bounded(two_sided_error(problem, sample.weights, pairs), pairs.lam)
    residual, _ = residuals(problem, sample.weights, pairs)
    return PointRoots(index, sample, None, pairs.lam, pairs.X, error, residual, method, True)
