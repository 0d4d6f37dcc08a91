"""The brake M0 over disc speed: a plain POD, sweep basis and windows."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.band_roots import roots_in_band
from squealstudy.linalg.companion import Eigenpairs, all_roots
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.modes.reanalysis.estimate import two_sided_error
from squealstudy.modes.reanalysis.family_problem import FamilyProblem
from squealstudy.modes.reanalysis.ritz import ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import SweepBasis, build_sweep_basis
from squealstudy.modes.rungs.windows import Windows
from squealstudy.study.definition import load_study
from squealstudy.study.family import read_family
from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS, Weights

from .measure import timed
from .rungs import Cover, Holds, cover, ritz_hold

STUDY = Path(__file__).resolve().parents[2] / "outside_data" / "m0_speed.toml"
LOW, HIGH = 2 * np.pi, 40 * np.pi
REGION_GROWTH, REGION_TOP = -7.0, 4e4  # the published region, 1/s and rad/s
TRAINED_GROWTH = -12.0  # modes a little below: at another speed they are in the region
BAND_HZ = (200.0, 6400.0)
REPEATS = 15
BATCH = 32  # points timed together: that is how they come in a study
RESOLVED = 1e-10  # relative: below it the full-order roots are no reference
TRUSTED = 1e-3  # estimated relative error up to which a root of a projection is taken for one


@dataclass
class M0Row:
    """A rung on M0; the error is max_i min_j |lam_i - lam_j| / max |lam| of the worst speed."""

    name: str
    speeds: int
    d: int
    reduce_s: float
    ms: list[float] = field(default_factory=list)
    error: float = 0.0
    note: str = ""

    def add(self, exact: np.ndarray, lam: np.ndarray, ms: float) -> None:
        """One speed."""
        error = np.abs(exact[:, None] - lam[None, :]).min(axis=1).max() / np.abs(exact).max()
        self.error = max(self.error, float(error))
        self.ms.append(ms)

    def __str__(self) -> str:
        return (
            f"{self.name:<28}{self.speeds:>7}{self.d:>6}{self.reduce_s:>10.1f}"
            f"{np.median(self.ms):>12.3f}{self.error:>10.1e}  {self.note}"
        )


HEAD = f"{'rung':<28}{'speeds':>7}{'d':>6}{'reduce s':>10}{'ms a point':>12}{'error':>10}"


def omega_log(t: np.ndarray) -> dict[str, float]:
    """Speed between its bounds by its logarithm, t in [-1, 1]."""
    return {"omega": float(LOW * (HIGH / LOW) ** ((float(t[0]) + 1) / 2))}


def omega_inverse(t: np.ndarray) -> dict[str, float]:
    """Speed by its inverse."""
    slow, fast = 1 / LOW, 1 / HIGH
    return {"omega": float(1 / (slow + (fast - slow) * (float(t[0]) + 1) / 2))}


def in_region(lam: np.ndarray) -> np.ndarray:
    """Roots of the published region, one of each pair."""
    kept: np.ndarray = (lam.real > REGION_GROWTH) & (np.abs(lam) < REGION_TOP) & (lam.imag > 0)
    return kept


class M0:
    """The family, its exact modes at training speeds, exact roots at others."""

    def __init__(self, tests: int) -> None:
        study = load_study(STUDY)
        self.family: MatrixFamily = read_family(study.model, study.source)
        self.problem = FamilyProblem(
            self.family, 1, omega_log, BAND_HZ, 100, least_growth=TRAINED_GROWTH
        )
        self.theta = np.random.default_rng(2016).uniform(-1, 1, (tests, 1))
        self._modes: dict[float, tuple[Eigenpairs, float]] = {}

    @cached_property
    def weights(self) -> list[Weights]:
        """Of the speeds nothing is trained on."""
        return [self.problem.weights(t) for t in self.theta]

    @cached_property
    def exact(self) -> tuple[list[np.ndarray], float]:
        """Their roots in the region, and milliseconds a point."""
        found, times = [], []
        for w in self.weights:
            (M, C, K), assembled = timed(lambda w=w: self.family.combined(w))
            roots, ms = timed(lambda M=M, C=C, K=K: roots_in_band(M, C, K, self.problem.band, 100))
            found.append(roots.lam[in_region(roots.lam)])
            times.append(assembled + ms)
        return found, float(np.median(times))

    def modes(self, speeds: np.ndarray) -> tuple[list[Eigenpairs], float]:
        """Exact pairs at speeds, each solved once, and the seconds all of them take."""
        for omega in speeds:
            if omega not in self._modes:
                t = 2 * np.log(omega / LOW) / np.log(HIGH / LOW) - 1
                pairs, ms = timed(lambda t=t: self.problem.pairs(np.array([t]), 1.0)[1])
                self._modes[omega] = pairs, ms / 1e3
        chosen = [self._modes[omega] for omega in speeds]
        return [p for p, _ in chosen], sum(s for _, s in chosen)

    def pod(self, speeds: np.ndarray, d: int, name: str) -> M0Row | None:
        """Plain POD: right modes in real and imaginary parts, SVD, Galerkin, dense roots.

        Set-up counts half of a two-sided solve a speed: no left modes are needed.
        """
        pairs, seconds = self.modes(speeds)
        started = time.process_time()
        X = np.hstack([p.X / np.linalg.norm(p.X, axis=0) for p in pairs])
        U, s, _ = la.svd(np.hstack([X.real, X.imag]), full_matrices=False)
        if d > len(s):
            return None
        V = U[:, :d]
        small = [(t.order, V.T @ (t.matrix @ V)) for t in self.family.terms]
        row = M0Row(name, len(speeds), d, seconds / 2 + time.process_time() - started)

        def solve(weights: Weights) -> np.ndarray:
            parts = {STIFFNESS: 0.0, DAMPING: 0.0, MASS: 0.0}
            for (order, A), w in zip(small, weights, strict=True):
                parts[order] = parts[order] + w * A
            both = np.linalg.solve(parts[MASS], np.hstack([parts[DAMPING], parts[STIFFNESS]]))
            return all_roots(both[:, :d], both[:, d:])

        self._run(row, solve)
        return row

    def _run(self, row: M0Row, solve) -> None:
        for w, exact in zip(self.weights, self.exact[0], strict=True):
            lam, first = timed(lambda w=w: solve(w))
            times = [first] + [timed(lambda w=w: solve(w))[1] for _ in range(REPEATS)]
            row.add(exact, lam, float(np.median(times)))

    def windows(self, tolerance: float, most: int) -> list[M0Row]:
        """Sweep basis of all modes of the band over the inverse speed, and patches of it."""
        problem = FamilyProblem(self.family, 1, omega_inverse, BAND_HZ, 100)
        basis, basis_ms = timed(lambda: build_sweep_basis(problem, tolerance / 3, most))
        speeds = np.array([omega_log(t)["omega"] for t in self.theta])
        theta = (2 * (1 / speeds - 1 / LOW) / (1 / HIGH - 1 / LOW) - 1)[:, None]
        r, trained = basis.V.shape[1], len(basis.trained)
        name = f"{tolerance:.0e}"
        rows = [M0Row(f"sweep_basis {name}", trained, r, basis_ms / 1e3)]
        self._run(rows[0], lambda w: all_roots(*(A[0] for A in basis.small.matrices([w]))))
        rows[0].note = coverage(self._basis_ratios(problem, basis))
        solver = Windows(problem, basis, tolerance)
        return [*rows, self._ritz(solver, theta, f"windows {name}", basis_ms)]

    def _ritz(self, solver: Windows, theta: np.ndarray, name: str, basis_ms: float) -> M0Row:
        row, patches = self._covered(solver, theta, name, ritz_hold(solver, theta))
        row.reduce_s += basis_ms / 1e3
        ratios: list[float] = []
        for followed, own in patches:
            for i, point in solver._points(followed, theta, np.array(own)):
                ratios += true_to_estimate(self.exact[0][i], point.lam, point.error)
            batch = [self.weights[i] for i in own]
            lam = ritz_roots(followed.patch, solver.basis, theta[own], batch).lam
            many = np.resize(theta[own], (BATCH, 1)), (batch * BATCH)[:BATCH]
            _, ms = timed(lambda p=followed.patch, m=many: ritz_roots(p, solver.basis, *m))
            for k, i in enumerate(own):
                row.add(self.exact[0][i], lam[k], ms / BATCH)
        row.note += f"; {coverage(ratios)}"
        return row

    def _covered(
        self, solver: Windows, theta: np.ndarray, name: str, holds: Holds
    ) -> tuple[M0Row, Cover]:
        patches, ms = timed(lambda: cover(solver, theta, holds))
        left = len(theta) - sum(len(own) for _, own in patches)
        note = f"{len(patches)} patches" + (f", {left} speeds left" if left else "")
        trained, r = len(solver.basis.trained), solver.basis.V.shape[1]
        return M0Row(name, trained, r, ms / 1e3, note=note), patches

    def _basis_ratios(self, problem: FamilyProblem, basis: SweepBasis) -> list[float]:
        ratios = []
        for w, exact in zip(self.weights, self.exact[0], strict=True):
            pairs = basis.pairs(w)
            pairs = pairs.take(in_region(pairs.lam))
            error = two_sided_error(problem, w, basis.expand(w, pairs))
            ratios += true_to_estimate(exact, pairs.lam, np.abs(error))
        return ratios


def true_to_estimate(exact: np.ndarray, lam: np.ndarray, error: np.ndarray) -> list[float]:
    """True error over its estimate for each exact root, where it is above round-off."""
    nearest = np.abs(exact[:, None] - lam[None]).argmin(axis=1)
    true = np.abs(exact - lam[nearest])
    told = (true > RESOLVED * np.abs(exact)) & (true < TRUSTED * np.abs(exact))
    return list(true[told] / error[nearest][told])


def coverage(ratios: list[float]) -> str:
    """Shares of true errors within 2 and 5 times their estimates."""
    if not ratios:
        return "no error above round-off"
    shares = [np.mean(np.array(ratios) <= k) for k in (2, 5)]
    return f"true error <= 2x estimate in {shares[0]:.1%}, <= 5x in {shares[1]:.1%}"
