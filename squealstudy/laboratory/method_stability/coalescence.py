"""Second-order perturbation beside an exceptional point.

Hulten's mass with equal dampers: the squares nu of its undamped frequencies are

    nu = a +- sqrt(b^2 - mu^2 w1^2 w2^2),    a, b = (w1^2 +- w2^2) / 2,

which meet at mu_c = b / (w1 w2). About an anchor at mu_0 the root has the expansion of a square
root, which converges within the distance d = mu_c - mu_0. After a step r d the third term, the
first that is left out, is S r^3 / 16 of the frequency; S = (nu_1 - nu_2) / (4 a) at the anchor.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from squealstudy.laboratory.method_stability.contract import (
    CaseResult,
    Knob,
    StabilityCase,
    alarm,
    judged,
)
from squealstudy.linalg.companion import Eigenpairs, all_pairs
from squealstudy.modes.reanalysis.estimate import EstimatedRoots
from squealstudy.modes.reanalysis.problem import DenseProblem, in_band, in_or_below
from squealstudy.modes.rungs.perturbation import make_anchor, perturbed_roots
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    ParametricSystem,
    Term,
    Weights,
)

OMEGA_1, OMEGA_2 = 2 * np.pi * 100.0, 2 * np.pi * 75.0
ESTIMATE_SAFETY_FACTOR = 2.0  # factor on the estimate, THEORY.md eq. (39)
ANCHOR_BAND_FACTOR = 2.0

KNOBS = (
    Knob("anchor", "friction whose modes are known", 0.1, low=0.0, high=2.0),
    Knob("step", "change of friction from there on", 0.01, low=1e-6, high=2.0),
    Knob("damping_ratio", "of both modes at their mean frequency", 0.01, low=0.0, high=0.5),
    Knob("tolerance", "relative error of a root that is allowed", 1e-3, low=1e-10, high=0.1),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the largest relative error of a root over the tolerance."""
    problem = SmallProblem(*flutter_matrices(knobs["damping_ratio"]))
    to = np.array([knobs["anchor"] + knobs["step"]])
    with np.errstate(all="ignore"):
        anchor = make_anchor(problem, np.array([knobs["anchor"]]), ANCHOR_BAND_FACTOR)
        estimated = perturbed_roots(problem, anchor, to, 2)
        assert isinstance(estimated, EstimatedRoots)  # every friction has a working point
        estimate = ESTIMATE_SAFETY_FACTOR * float(
            (estimated.error / np.abs(estimated.lam)).max(initial=0.0)
        )
    exact = exact_roots(to[0], knobs["damping_ratio"])
    error = distance(estimated.lam, exact)
    tolerance = knobs["tolerance"]
    return judged(
        not error <= tolerance,
        alarm("estimate", estimate, tolerance),
        predicted=predict(knobs),
        measured=error / tolerance,
        error=error,
        cost=1.0,
    )


def flutter_matrices(damping_ratio: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C, K and the matrix that friction multiplies, each (2, 2), for a mass of 1 kg."""
    C = 2 * damping_ratio * np.sqrt((OMEGA_1**2 + OMEGA_2**2) / 2) * np.eye(2)
    K = np.diag([OMEGA_1**2, OMEGA_2**2])
    friction = np.array([[0.0, -(OMEGA_2**2)], [OMEGA_1**2, 0.0]])
    return C, K, friction


def exact_roots(mu: float, damping_ratio: float) -> np.ndarray:
    """The two roots of imaginary part >= 0, rad/s."""
    a, b = (OMEGA_1**2 + OMEGA_2**2) / 2, (OMEGA_1**2 - OMEGA_2**2) / 2
    split = np.sqrt(complex(b**2 - (mu * OMEGA_1 * OMEGA_2) ** 2))
    nu = a + np.array([split, -split])
    c = 2 * damping_ratio * np.sqrt(a)
    roots: np.ndarray = -c / 2 + 1j * np.sqrt(nu - c**2 / 4)
    return roots


def distance(lam: np.ndarray, exact: np.ndarray) -> float:
    """Largest relative distance of an exact root to the nearest of lam; inf if lam has none."""
    if not len(lam) or not np.isfinite(lam).all():
        return float("inf")
    return float((np.abs(exact[:, None] - lam).min(axis=1) / np.abs(exact)).max())


def predict(knobs: Mapping[str, float]) -> float:
    """Step over the largest one that is predicted to keep the tolerance, by the third term.

    The largest step is at most the distance to coalescence.
    """
    a, b = (OMEGA_1**2 + OMEGA_2**2) / 2, (OMEGA_1**2 - OMEGA_2**2) / 2
    critical = b / (OMEGA_1 * OMEGA_2)
    away = abs(critical - knobs["anchor"])
    split = np.sqrt(abs(b**2 - (knobs["anchor"] * OMEGA_1 * OMEGA_2) ** 2))
    share = 2 * split / (4 * a)
    reach = min(1.0, (16 * knobs["tolerance"] / max(share, 1e-300)) ** (1 / 3))
    return float(knobs["step"] / max(away * reach, 1e-300))


class SmallProblem(DenseProblem):
    """The problem lambda^2 I + lambda C + K + theta F of a few modes, as rungs take it.

    Parameters
    ----------
    C, K, coupling : ndarray (n, n)
        Damping, symmetric positive definite stiffness, and F, which theta (1,) multiplies.
    band : (low, high)
        Band of ``|lambda|``, rad/s.
    """

    dimension = 1

    def __init__(
        self,
        C: np.ndarray,
        K: np.ndarray,
        coupling: np.ndarray,
        band: tuple[float, float] = (0.0, np.inf),
    ) -> None:
        self._parts, self.band = (C, K, coupling), band

    @cached_property
    def system(self) -> ParametricSystem:
        """Mass, damping, stiffness and coupling."""
        orders = (DAMPING, STIFFNESS, STIFFNESS)
        parts = zip(orders, self._parts, strict=True)
        terms = (Term(MASS), *(Term(order, None, matrix) for order, matrix in parts))
        return ParametricSystem(len(self._parts[1]), terms)

    def weights(self, theta: np.ndarray) -> Weights:
        """Weights of mass, damping, stiffness and coupling: 1, 1, 1 and theta."""
        return (1.0, 1.0, 1.0, float(theta[0]))

    def pairs(
        self, theta: np.ndarray, reach: float, below: bool = False
    ) -> tuple[Weights, Eigenpairs]:
        """Eigenpairs of imaginary part >= 0 in reach of the band; with `below` also lower ones."""
        weights = self.weights(theta)
        _, C, K = self.system.matrices(weights)
        pairs = all_pairs(C, K)
        keep = in_or_below if below else in_band
        return weights, pairs.take(keep(pairs.lam, self.band, reach))

    def nominal_stiffness(self) -> np.ndarray:
        """K (n, n)."""
        return self._parts[1]


COALESCENCE = StabilityCase(
    name="coalescence",
    title="second-order perturbation beside a lock-in",
    boundary="step over distance to coalescence where S r^3 / 16 is the tolerance, 1 at most",
    settings=KNOBS,
    measure=measure,
)
