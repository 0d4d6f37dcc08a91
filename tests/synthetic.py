"""Small parametric quadratic eigenproblems of known behaviour, as the ladder's problem."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import all_pairs
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import Linearisation, in_band, in_or_below, lightly_damped
from squealstudy.modes.reanalysis.sweep_basis import build_sweep_basis
from squealstudy.modes.rungs.windows import Windows
from squealstudy.system.parametric import DAMPING, MASS, STIFFNESS, ParametricSystem, Term

HZ = 2 * np.pi
NEAR = 0.02  # relative distance of partners


class SyntheticProblem:
    """lambda^2 I + lambda C(theta) + K(theta), matrices times functions of theta.

    Parameters
    ----------
    stiffness, damping : sequence of (matrix (n, n), function theta -> float)
    dimension : int
    band_hz : (low, high)
    refused : callable
        theta -> ConvergenceError, or None where there is a working point.
    """

    exact = "dense"

    def __init__(self, stiffness, damping, dimension, band_hz, refused=lambda theta: None):
        n = len(stiffness[0][0])
        parts = [(STIFFNESS, *part) for part in stiffness] + [(DAMPING, *p) for p in damping]
        terms = (Term(MASS), *(Term(order, None, A) for order, A, _ in parts))
        self.system = ParametricSystem(n, terms)
        self.dimension, self.band = dimension, (HZ * band_hz[0], HZ * band_hz[1])
        self._functions = [f for _, _, f in parts]
        self.refused = refused
        _, _, K = self.system.matrices(self._weights(np.zeros(dimension)))
        K = (K + K.T) / 2
        lowest = la.eigvalsh(K)[0]
        if lowest < 1e-6 * np.trace(K) / n:  # rigid modes
            K = K + (1e-3 * np.trace(K) / n - min(lowest, 0.0)) * np.eye(n)
        self._K0, self._F = K, la.cholesky(K)

    def _weights(self, theta):
        return (1.0, *(float(f(theta)) for f in self._functions))

    def weights(self, theta):
        reason = self.refused(theta)
        if reason is not None:
            raise reason
        return self._weights(theta)

    def samples(self, theta, field=None):
        return [self.refused(row) or Linearisation(self._weights(row), None) for row in theta]

    def local_field(self, box, grid):
        return None

    def matrices(self, theta):
        """C and K (n, n)."""
        _, C, K = self.system.matrices(self._weights(theta))
        return C, K

    def pairs(self, theta, reach, below=False):
        found = all_pairs(*self.matrices(theta))
        keep = in_or_below if below else in_band
        return self.weights(theta), found.take(keep(found.lam, self.band, reach))

    def roots(self, theta, reach=1.0):
        """Roots inside the band, ascending in modulus; plain numpy on the companion form."""
        C, K = self.matrices(theta)
        n = len(K)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
        lam = np.linalg.eigvals(A)
        lam = lam[in_band(lam, self.band, reach)]
        return lam[np.argsort(np.abs(lam))]

    def energy_root(self, X):
        return self._F @ X

    def from_energy(self, Z):
        return la.solve_triangular(self._F, Z)

    def energy_product(self, X):
        return self._K0 @ X

    def flexibility(self, r):
        return la.solve(self._K0, r, assume_a="pos")

    def mass_product(self, X):
        return X


def constant(value=1.0):
    """A weight that does not depend on the design point."""
    return lambda theta: value


def random_brake(n, dimension, seed, top_hz=3000.0, coupling=0.1, damping=0.002):
    """Diagonal elastic stiffness, a circulatory coupling by theta_0 and dampers, n modes.

    Further parameters stiffen random patterns; frequencies spread over 200 Hz to `top_hz`.
    """
    rng = np.random.default_rng(seed)
    w = HZ * np.sort(rng.uniform(200.0, top_hz, n))
    root = np.diag(w)

    def pattern(symmetric):
        A = rng.standard_normal((n, n)) / np.sqrt(n)
        A = (A + A.T) / 2 if symmetric else A
        return root @ A @ root

    stiffness = [(np.diag(w**2), constant()), (pattern(False), lambda t: coupling * (1 + t[0]))]
    stiffness += [
        (pattern(True), lambda t, a=axis: coupling * (t[a] + 0.3 * t[a] ** 2))
        for axis in range(1, dimension)
    ]
    B = rng.standard_normal((2, n)) * np.sqrt(damping * w)
    dampers = [(np.diag(2 * damping * w), constant()), (B.T @ B, lambda t: 1 + 0.5 * t[0])]
    return SyntheticProblem(stiffness, dampers, dimension, (300.0, 0.8 * top_hz))


def random_points(count, dimension, seed=0):
    """Points (count, dimension) of the whole box."""
    return np.random.default_rng(seed).uniform(-1, 1, (count, dimension))


def whole_box(dimension):
    """[-1, 1]^d."""
    return Box(-np.ones(dimension), np.ones(dimension))


def in_order(outcomes):
    """What windows found of each row of theta, all of them."""
    by_row = dict(outcomes)
    assert sorted(by_row) == list(range(len(by_row)))
    return [by_row[row] for row in range(len(by_row))]


def solved(problem, theta, tolerance, box=None):
    """Windows over a box: the solver and its points, in the order of theta."""
    basis = build_sweep_basis(problem, tolerance / 3)
    windows = Windows(problem, basis, tolerance)
    return windows, in_order(windows.solve(box or whole_box(problem.dimension), theta))


def matched(exact, found):
    """Distance of each exact root to its partner (m,) in a one-to-one matching, and who that is."""
    distance = np.abs(exact[:, None] - found[None])
    rows, columns = linear_sum_assignment(distance)
    return distance[rows, columns], columns


class Audit:
    """Roots found by windows against exact ones, over all points.

    Attributes
    ----------
    true, estimate : ndarray
        Relative errors of light modes, and of heavy ones with `heavy_`.
    missed, spurious : int
        Roots of either set without a partner, those at the band's edge left out.
    """

    def __init__(self, problem, theta, found, tolerance):
        self.missed = self.spurious = 0
        true, estimate, damped = [], [], []
        for at, p in zip(theta, found, strict=True):
            if isinstance(p, ConvergenceError):
                continue
            exact = problem.roots(at, reach=1.0 + 50 * tolerance)
            inner, close = in_band(exact, problem.band, 1.0 - 50 * tolerance), np.abs(exact)
            partner, own = np.zeros(len(exact), dtype=bool), np.zeros(len(p.lam), dtype=bool)
            if len(exact) and len(p.lam):
                distance = np.abs(exact[:, None] - p.lam[None])
                rows, columns = linear_sum_assignment(distance)
                near = distance[rows, columns] < NEAR * close[rows]
                rows, columns = rows[near], columns[near]
                partner[rows], own[columns] = True, True
                true.append(distance[rows, columns] / close[rows])
                estimate.append(p.error[columns] / close[rows])
                damped.append(~lightly_damped(exact[rows]))
            self.missed += int((inner & ~partner).sum())
            self.spurious += int((~own).sum())
        heavy = np.concatenate(damped)
        true, estimate = np.concatenate(true), np.concatenate(estimate)
        self.true, self.estimate = true[~heavy], estimate[~heavy]
        self.heavy_true, self.heavy_estimate = true[heavy], estimate[heavy]

    def check(self, tolerance):
        """No root missed or made up; the tolerance kept; estimates as good as promised."""
        assert (self.missed, self.spurious) == (0, 0)
        assert self.true.max() <= 2 * tolerance
        seen = self.true > max(1e-10, 1e-5 * tolerance)  # below, round-off and chance rule
        ratio = self.true[seen] / self.estimate[seen]
        assert ratio.max(initial=0.0) <= 5.0
        assert (ratio <= 2.0).sum() >= 0.95 * len(ratio)
