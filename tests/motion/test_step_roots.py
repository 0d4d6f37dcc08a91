"""Roots at a step, against eigenvalues of the whole step as a matrix, and against runs."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la
from conftest import benchmark
from study_runs import solved
from study_texts import study_text

from squealstudy.kernels import newmark_layout as at
from squealstudy.motion import step_roots
from squealstudy.motion.integrator import KernelIntegrator
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.step_roots import LinearMotions, _roots, integrated_roots

METHODS = {
    "exponential": ExactFreeMotion(),
    "newmark": Newmark(),
    "prewarped": Newmark(prewarp=True),
    "plain guess": ExactFreeMotion(extrapolate=False),
}


def random_system(seed: int, n: int = 4) -> tuple[np.ndarray, ...]:
    """Damping and stiffness (n, n) with friction's asymmetry, and the diagonal parts integrated."""
    rng = np.random.default_rng(seed)
    w2, c = (rng.uniform(300, 1500, n)) ** 2, rng.uniform(0, 40, n)
    K = np.diag(w2) + 0.2 * np.sqrt(np.outer(w2, w2)) * rng.normal(size=(n, n))
    C = np.diag(c) + 10 * rng.normal(size=(n, n))
    return C, K, w2, c


def roots_of(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Oscillating roots and vectors of lambda^2 + lambda C + K by the companion matrix."""
    n = len(K)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])
    lam, vectors = la.eig(A)
    chosen = lam.imag > 1
    return lam[chosen], vectors[:n, chosen]


def step_matrix(
    method: KernelIntegrator, C: np.ndarray, K: np.ndarray, w2: np.ndarray, c: np.ndarray, h: float
) -> np.ndarray:
    """A balanced step of (q, v) as a matrix: the pull at its end solved for."""
    n, t = len(K), method.step(*method.modes(w2, c, h), h)
    pull = -np.hstack([K - np.diag(w2), C - np.diag(c)])
    P = np.block([[np.diag(t[at.QQ]), np.diag(t[at.QV])], [np.diag(t[at.VQ]), np.diag(t[at.VV])]])
    first = np.vstack([np.diag(t[at.FIRST_Q]), np.diag(t[at.FIRST_V])])
    last = np.vstack([np.diag(t[at.LAST_Q]), np.diag(t[at.LAST_V])])
    return np.linalg.solve(np.eye(2 * n) - last @ pull, P + first @ pull)


def guessed_matrix(
    method: KernelIntegrator, C: np.ndarray, K: np.ndarray, w2: np.ndarray, c: np.ndarray, h: float
) -> np.ndarray:
    """A step of (q, v, pull, pull before) that evaluates the forces once, at its guess."""
    n, t = len(K), method.step(*method.modes(w2, c, h), h)
    S = -np.hstack([K - np.diag(w2), C - np.diag(c)])
    P = np.block([[np.diag(t[at.QQ]), np.diag(t[at.QV])], [np.diag(t[at.VQ]), np.diag(t[at.VV])]])
    first = np.vstack([np.diag(t[at.FIRST_Q]), np.diag(t[at.FIRST_V])])
    last = np.vstack([np.diag(t[at.LAST_Q]), np.diag(t[at.LAST_V])])
    twice = 1.0 if method.extrapolate else 0.0
    base = np.hstack([P, first, np.zeros((2 * n, n))])
    guess = np.hstack([np.zeros((n, 2 * n)), (1 + twice) * np.eye(n), -twice * np.eye(n)])
    pull = S @ (base + last @ guess)
    kept = np.hstack([np.zeros((n, 2 * n)), np.eye(n), np.zeros((n, n))])
    return np.vstack([base + last @ pull, pull, kept])


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_roots_are_eigenvalues_of_the_step(name: str, seed: int) -> None:
    method, h = METHODS[name], 3e-4  # 14 to 70 steps a period
    C, K, w2, c = random_system(seed)
    lam, right = roots_of(C, K)
    motions = LinearMotions(C[None], K[None], w2, c[None])
    owner = np.zeros(len(lam), dtype=int)
    roots = integrated_roots(motions, owner, lam, right.T, method, h)
    for found, matrix in zip(roots, (step_matrix, guessed_matrix), strict=True):
        z = np.linalg.eigvals(matrix(method, C, K, w2, c, h))
        for root, true in zip(found, lam, strict=True):
            nearest = z[np.argmin(np.abs(z - np.exp(root * h)))]
            assert np.log(nearest) / h == pytest.approx(root, rel=1e-9)
            assert abs(root - true) < 0.05 * abs(true)


STUDY = (
    study_text("growing", "transient", "hulten")
    + "[parameters]\ndamping_ratio = 0.01\n"
    + '[[sweep]]\nparameter = "friction"\nvalues = [0.3, 0.5]\n'
    + "[modes]\nband = [20.0, 1500.0]\n"
    + "[transient]\nduration = 0.25\nstep = 2e-4\nperturbation = 1e-8\ntolerance = 1e-8\n"
    + 'slope_pilot = "never"\n'
)


def hulten_growth(friction: float, zeta: float = 0.01) -> float:
    """Growth of Hulten's oscillator, two contacts at right angles, by numpy, 1/s."""
    w2 = (2 * np.pi * np.array([100.0, 75.0])) ** 2
    K = np.diag(w2) + friction * np.array([[0.0, -w2[1]], [w2[0], 0.0]])
    C = np.diag(2 * zeta * np.sqrt(w2))
    return float(roots_of(C, K)[0].real.max())


def test_a_run_grows_as_the_step_makes_it(tmp_path: Path) -> None:
    """50 steps a period: the step adds up to a thousandth, and that is told."""
    points = solved(STUDY, tmp_path / "r").points
    true = [hulten_growth(mu) for mu in (0.3, 0.5)]
    told = points["growth_rate"].to_numpy()
    np.testing.assert_allclose(points["predicted_growth_rate"], true, rtol=1e-9)
    assert (points["growth_method"] == "left_vector").all()
    error = points["growth_rate_step_error"].to_numpy()
    assert (np.abs(error) > 1e-4 * np.array(true)).all()
    np.testing.assert_allclose(told - error, true, rtol=2e-5)


def test_bounds_cover_the_growth_of_random_runs() -> None:
    coverage = benchmark("growth_coverage")
    found = coverage.coverage(2, 0.04)
    told = found[found["told"].to_numpy()]
    assert len(told) >= 0.7 * len(found)
    assert told["right"].mean() >= 0.93
    assert told["width"].median() <= 0.02


def test_design_points_side_by_side_have_the_roots_of_each_alone(monkeypatch) -> None:
    """Whatever their dampings, and however many matrices are solved at a time."""
    method, h, systems = ExactFreeMotion(), 3e-4, [random_system(seed) for seed in range(3)]
    w2, c = systems[0][2], np.array([systems[k][3] for k in (0, 1, 0)])
    motions = LinearMotions(*(np.array([s[k] for s in systems]) for k in (0, 1)), w2, c)
    pairs = [roots_of(C, K) for C, K, _, _ in systems]
    owner = np.repeat(np.arange(3), [len(lam) for lam, _ in pairs])
    lam = np.concatenate([lam for lam, _ in pairs])
    right = np.concatenate([x.T for _, x in pairs])
    together = integrated_roots(motions, owner, lam, right, method, h)
    monkeypatch.setattr(step_roots, "ENTRIES_AT_ONCE", 16)
    for k, (own, x) in enumerate(pairs):
        one = LinearMotions(motions.C[k : k + 1], motions.K[k : k + 1], w2, c[k : k + 1])
        alone = integrated_roots(one, np.zeros(len(own), dtype=int), own, x.T, method, h)
        np.testing.assert_allclose(together[:, owner == k], alone, rtol=1e-12)
        assert np.isfinite(alone).any()


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.full((3, 3), np.nan)])
def test_where_the_step_has_no_root_none_is_told(matrix):
    """No warning either: it would stand on the screen of a study."""
    made = SimpleNamespace(
        at=lambda rows: made,
        answers=lambda z: (np.ones((2, 1, 3)), None, None),
        matrices=lambda z: (matrix[None], matrix[None]),
    )
    (root,) = _roots(made, np.array([-1.0 + 600j]), np.ones((1, 3), complex), 1e-5)
    assert np.isnan(root)
