"""Missed and spurious unstable modes: random design points by the windows, each again by dense.

Run:  python studies/benchmarks/unstable_check.py --mesh medium --top 8000 --points 2000 --jobs 2
      --box map | box     friction and the logarithm of the pressure at 0.5 m/s; with the speed too

An unstable mode of the dense problem is missed where no root of the windows lies within MATCHED of
it; one of the windows is spurious where no dense root does. Only growth rates count that exceed 3
tolerances times the root's modulus. The largest error of light modes (|zeta| < 5 %) is told beside,
and the shares of light modes whose true error is within 2 and 5 estimates.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from functools import partial
from multiprocessing import get_context

import one_thread  # noqa: F401

# isort: split

import numpy as np
from reanalysis_rungs.brake import brake_problem

from squealstudy.linalg.companion import all_roots
from squealstudy.modes.reanalysis.estimate import EstimatedRoots
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import (
    Linearisation,
    in_band,
    lightly_damped,
)
from squealstudy.modes.reanalysis.sweep_basis import build_sweep_basis
from squealstudy.modes.rungs.windows import Windows

MATCHED = 1e-2  # relative distance of roots that are the same mode
EDGE = 1.01  # beyond the band a root has its partner too
ROUND_OFF = 1e-11  # relative: true errors below say nothing about an estimate
CHUNK = 50


def exact_roots(arguments: argparse.Namespace, theta: np.ndarray) -> list[np.ndarray]:
    """Roots of the dense problem in the band and a little beyond; none of points that fail."""
    problem = brake_problem(arguments.mesh, arguments.top, arguments.box)
    found = []
    for sample in problem.samples(theta):
        lam = np.zeros(0, dtype=complex)
        if isinstance(sample, Linearisation):
            _, C, K = problem.system.matrices(sample.weights)
            lam = all_roots(C, K)
        found.append(lam[in_band(lam, problem.band, EDGE)])
    return found


def growing(lam: np.ndarray, band: tuple[float, float], tolerance: float) -> np.ndarray:
    """Which roots in the band grow by more than 3 tolerances."""
    grows: np.ndarray = in_band(lam, band, 1.0) & (lam.real > 3.0 * tolerance * np.abs(lam))
    return grows


def unmatched(lam: np.ndarray, others: np.ndarray) -> int:
    """Roots without a partner among the others."""
    if not len(lam) or not len(others):
        return len(lam)
    distance = np.abs(lam[:, None] - others).min(axis=1)
    return int((distance > MATCHED * np.abs(lam)).sum())


def compared(
    points: dict[int, EstimatedRoots],
    exact: list[np.ndarray],
    band: tuple[float, float],
    tolerance: float,
) -> str:
    """The figures of the comparison."""
    missed = spurious = unstable = 0
    errors, ratios = [], []
    for row, p in points.items():
        lam = exact[row]
        mine, theirs = p.lam[growing(p.lam, band, tolerance)], lam[growing(lam, band, tolerance)]
        unstable += len(theirs)
        missed += unmatched(theirs, p.lam)
        spurious += unmatched(mine, lam)
        slight = lightly_damped(p.lam)
        true = np.abs(p.lam[slight][:, None] - lam).min(axis=1)
        relative = true / np.abs(p.lam[slight])
        errors.append(relative.max(initial=0.0))
        told = relative > ROUND_OFF
        ratios += list(true[told] / p.error[slight][told])
    r, e = np.array(ratios), np.array(errors)
    return (
        f"{unstable} unstable modes in {len(points)} points: {missed} missed, {spurious} spurious\n"
        f"largest relative error of light roots {e.max():.1e}, "
        f"{(e <= tolerance).mean():.2%} of the points within {tolerance:g}\n"
        f"{len(r)} light roots: true error within 2 estimates {(r <= 2).mean():.2%}, within 5 "
        f"{(r <= 5).mean():.3%}, largest ratio {r.max():.2f}"
    )


def main() -> None:
    """Solve twice and compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", default="medium")
    parser.add_argument("--top", type=float, default=8000.0, help="Hz")
    parser.add_argument("--box", choices=("map", "box"), default="map")
    parser.add_argument("--points", type=int, default=2000)
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=11)
    arguments = parser.parse_args()
    problem = brake_problem(arguments.mesh, arguments.top, arguments.box)
    d = problem.dimension
    theta = np.random.default_rng(arguments.seed).uniform(-1, 1, (arguments.points, d))
    basis = build_sweep_basis(problem, arguments.tolerance / 3)
    windows = Windows(problem, basis, arguments.tolerance)
    started = time.perf_counter()
    solved = dict(windows.solve(Box(-np.ones(d), np.ones(d)), theta))
    points = {i: p for i, p in solved.items() if isinstance(p, EstimatedRoots)}
    ms = 1e3 * (time.perf_counter() - started) / len(theta)
    print(
        f"{arguments.mesh} brake, {problem.system.n} coordinates, basis {basis.V.shape[1]} in "
        f"{basis.seconds:.0f} s; points {ms:.1f} ms each: {dict(windows.counts)}, "
        f"{dict(Counter(p.method for p in points.values()))}",
        flush=True,
    )
    parts = np.split(theta, range(CHUNK, len(theta), CHUNK))
    started = time.perf_counter()
    if arguments.jobs == 1:
        found = [exact_roots(arguments, part) for part in parts]
    else:
        with get_context("spawn").Pool(arguments.jobs) as pool:
            found = pool.map(partial(exact_roots, arguments), parts)
    ms = 1e3 * (time.perf_counter() - started) / len(theta)
    lost = len(solved) - len(points)
    print(f"dense: {ms:.0f} ms a point on {arguments.jobs} cores; no working point: {lost}")
    exact = [lam for part in found for lam in part]
    print(compared(points, exact, problem.band, arguments.tolerance))


if __name__ == "__main__":
    main()
