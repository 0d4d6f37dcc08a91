"""The rungs for comparison: two-step projection, perturbation, single vectors, and their limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from conftest import NOMINAL
from reference import MU_C, W1
from test_family_reanalysis import closed_form, dense_roots, distance, hulten, machine

from squealstudy.linalg.companion import all_pairs
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import state_working_point
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.rungs import all_rungs
from squealstudy.modes.rungs.perturbation import make_anchor, perturbed_roots
from squealstudy.modes.rungs.two_step import (
    is_symmetric,
    symmetric_modes,
    two_step_roots,
)
from squealstudy.system.linearise import StructureWeights, linearise, reduced_structure

REACH = 30.0  # of anchors: all modes


def test_two_step_converges_with_the_factor():
    problem, theta = machine(), np.array([0.3])
    exact = dense_roots(problem, theta)
    worst = []
    for factor in (1.0, 1.5, 2.0, 3.0):
        found = two_step_roots(problem, theta, factor)
        assert found.method == "two_step"
        assert found.X.shape == (60, len(found.lam))
        worst.append(distance(found.lam, exact).max())
    assert worst[0] > worst[1] > worst[2]
    assert worst[3] < 1e-9  # 900 Hz at most: all real modes
    found = two_step_roots(problem, theta, 1.5)
    true = np.abs(found.lam[:, None] - exact[None, :]).min(axis=1)
    assert (true <= found.error).all()


def test_what_rungs_promise():
    """Those for comparison keep no tolerance; all but the full order cost less than exact ones."""
    rungs = {rung.name: rung for rung in all_rungs()}
    assert {n for n, r in rungs.items() if not r.keeps_tolerance} == {"perturbation", "two_step"}
    assert {n for n, r in rungs.items() if r.exact} == {"dense", "full"}
    assert {n for n, r in rungs.items() if r.over_a_basis} == {"sweep_basis", "windows"}
    for name, rung in rungs.items():
        cost = rung.relative_cost(1000, 2)
        assert cost > 10 if name == "full" else 0 < cost <= 1
        solves = rung.setup_solves
        assert 23 <= solves <= 75 if rung.over_a_basis else solves == 0


def test_symmetric_modes_leave_friction_out(reduced):
    model, _ = reduced
    system, contact = reduced_structure(model).system, 1e3 * np.ones(len(model.N))
    kinds = [is_symmetric(t) for t in system.terms]
    names = [n for n, known in zip(StructureWeights._fields, kinds, strict=True) if not known]
    assert names == ["coupling", "turning"]  # friction, and gyroscopic terms, which damp nothing
    weights = StructureWeights(
        mass=1.0, elastic=model.k_el, springs=1.0, normal=contact, coupling=contact
    )
    phi = symmetric_modes(system, weights, 2 * np.pi * 4e3)
    K = model.K_springs + np.diag(model.k_el) + 1e3 * model.N.T @ model.N
    w2 = np.diag(phi.T @ K @ phi)
    count = (la.eigvalsh(K) <= (2 * np.pi * 4e3) ** 2).sum()
    assert phi.shape[1] == count > 5
    assert np.allclose(phi.T @ phi, np.eye(count), atol=1e-10)
    assert (w2 <= (2 * np.pi * 4e3) ** 2).all()


@pytest.mark.parametrize("order", [1, 2])
def test_perturbation_converges_at_its_order(order):
    """Of a family whose mass, damping and stiffness vary."""
    problem = machine()
    anchor = make_anchor(problem, np.array([0.2]), REACH)  # all modes
    errors, steps = [], np.array([0.2, 0.1, 0.05, 0.025])
    for step in steps:
        theta = np.array([0.2 + step])
        exact = dense_roots(problem, theta)
        errors.append(distance(perturbed_roots(problem, anchor, theta, order).lam, exact).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order + 1, abs=0.25)


def test_second_order_beats_first_away_from_coalescence_and_estimates_tell():
    problem = hulten(0.0, 0.2)
    anchor = make_anchor(problem, np.zeros(1), REACH)
    theta = np.array([0.3])
    exact = closed_form(0.13)
    first, second = (perturbed_roots(problem, anchor, theta, k) for k in (1, 2))
    assert distance(second.lam, exact).max() < 0.2 * distance(first.lam, exact).max()
    assert distance(second.lam, exact).max() < 1e-3
    for found in (first, second):
        true = np.abs(found.lam[:, None] - exact[None, :]).min(axis=1)
        assert (true <= 2 * found.error).all()
        assert (found.error <= 5 * true).all()
    assert len(first.lam) == 2


def test_other_orders_are_refused():
    problem = hulten(0.0, 0.2)
    with pytest.raises(ValueError, match="order must be 1 or 2, got 3"):
        perturbed_roots(problem, make_anchor(problem, np.zeros(1), REACH), np.zeros(1), 3)


@pytest.mark.parametrize("order", [1, 2])
def test_perturbation_fails_near_an_exceptional_point(order):
    """From a distance d to the point itself: the error falls as the root of d, not as d^2, d^3."""
    distances = np.array([1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
    errors = []
    for d in distances:
        problem = hulten(MU_C * (1 - 2 * d), MU_C)
        anchor = make_anchor(problem, np.zeros(1), REACH)
        found = perturbed_roots(problem, anchor, np.ones(1), order)
        errors.append(np.abs(found.lam - closed_form(MU_C)[0]).max() / W1)
    slope = np.polyfit(np.log(distances), np.log(errors), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.03)
    assert errors[-1] > 50 * distances[-1]


def test_perturbation_cannot_cross_an_exceptional_point():
    """Beyond it the pair is unstable; the expansion of an undamped pair stays undamped."""
    problem = hulten(MU_C * 0.98, MU_C * 1.02)
    anchor = make_anchor(problem, np.array([-0.5]), REACH)
    exact = closed_form(MU_C * 1.01)
    assert np.abs(exact.real).min() > 10.0
    for order in (1, 2):
        found = perturbed_roots(problem, anchor, np.array([0.5]), order)
        assert np.abs(found.lam.real).max() < 1e-6
        assert distance(found.lam, exact).min() > 1e-2


def test_single_vectors_cannot_cross_an_exceptional_point():
    """Two-sided Rayleigh iteration: sharp before it, without a limit beyond."""
    before, beyond = hulten(0.0, 2 * MU_C * 0.9), hulten(0.0, 2 * MU_C * 1.01)
    start = hulten(0.0, 2 * MU_C * 0.8).pairs(np.zeros(1), 1.0)[1]
    for problem, mu, reached in ((before, MU_C * 0.9, True), (beyond, MU_C * 1.01, False)):
        M, C, K = (A.toarray() for A in problem.family.combined(problem.weights(np.zeros(1))))
        exact = closed_form(mu)
        found = [
            rayleigh_iteration(M, C, K, start.lam[j], start.X[:, j], start.Y[:, j])
            for j in range(2)
        ]
        errors = [np.abs(lam - exact).min() / np.abs(exact[0]) for lam in found]
        # beyond it, round-off may throw one of the two real starts into the complex plane
        assert all(error < 1e-9 for error in errors) == reached, (mu, found)


def rayleigh_iteration(M, C, K, lam, x, y, most=40):
    """Two-sided: inverse iteration on both sides, the functional's root next to the last."""
    for _ in range(most):
        Q = lam**2 * M + lam * C + K
        slope = 2 * lam * M + C
        try:
            x, y = la.solve(Q, slope @ x), la.solve(Q.conj().T, slope.conj().T @ y)
        except (la.LinAlgError, la.LinAlgWarning):
            break
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        a, b, c = (y.conj() @ A @ x for A in (M, C, K))
        near = np.roots([a, b, c])
        lam = near[np.abs(near - lam).argmin()]
    return lam


def test_anchor_holds_conjugates_once():
    problem = machine()
    anchor = make_anchor(problem, np.array([0.2]), REACH)
    assert len(anchor.pairs.lam) == 2 * problem.system.n


DAMPED = {
    "undamped": {},
    "uniform": {"damping_ratio": 0.005, "stiffness_damping": 1.5e-7},
    "single": {"damping_ratio": 0.005, "assembly_damping": {22: 0.06, 24: 0.0}},
}


def damped_problem(prepared, damping):
    """Over friction and pressure, band up to 3.5 kHz."""

    def state_at(theta):
        point = replace(
            NOMINAL, friction=0.5 + 0.2 * theta[0], brake_pressure=12e5 + 6e5 * theta[1]
        )
        return DesignState(point, **DAMPED[damping])

    return BrakeProblem(prepared, 2, state_at, (500.0, 3500.0), exact_damping=True)


def linearised_roots(problem, theta):
    """Of the matrices that dense points solve."""
    state = problem.state_at(theta)
    prepared = problem.prepared
    system = linearise(prepared.model, state_working_point(prepared, state), state)
    lam = all_pairs(system.C, system.K).lam
    low, high = problem.band
    return lam[(lam.imag > 0) & (np.abs(lam) > low) & (np.abs(lam) < high)]


def two_step_errors(prepared, damping):
    """Relative errors of frequency and growth (m,) of the modes well inside the band."""
    problem, theta = damped_problem(prepared, damping), np.array([0.4, 0.5])
    exact, found = linearised_roots(problem, theta), two_step_roots(problem, theta, 2.0).lam
    hz = np.abs(found) / (2 * np.pi)
    found = found[(found.imag > 0) & (hz > 600) & (hz < 3400)]
    near = exact[np.abs(found[:, None] - exact[None]).argmin(axis=1)]
    return np.abs(found - near) / np.abs(near), np.abs(found.real - near.real) / np.abs(near)


@pytest.mark.parametrize(
    "damping", [pytest.param("uniform", marks=pytest.mark.full_size), "single"]
)
def test_two_step_errs_with_modal_damping_as_without(prepared, damping):
    damped, undamped = (two_step_errors(prepared, name) for name in (damping, "undamped"))
    assert damped[0].max() == pytest.approx(undamped[0].max(), rel=0.1)
    assert np.median(damped[0]) == pytest.approx(np.median(undamped[0]), rel=0.1)
    assert np.median(damped[1]) < 1e-3  # of a damping ratio of 5e-3


@pytest.mark.parametrize(
    "damping", [pytest.param("uniform", marks=pytest.mark.full_size), "single"]
)
def test_perturbation_is_of_second_order_in_modal_damping_too(prepared, damping):
    problem, errors = damped_problem(prepared, damping), []
    anchor = make_anchor(problem, np.zeros(2), REACH)
    for step in (0.1, 0.05):
        theta = step * np.array([0.4, 0.5])
        found, exact = perturbed_roots(problem, anchor, theta, 2), linearised_roots(problem, theta)
        off = np.abs(exact[:, None] - found.lam[None])
        errors.append(off.min(axis=1).max())
        assert (off.min(axis=1) <= 3 * found.error[off.argmin(axis=1)] + 1e-6).mean() > 0.9
    assert np.log2(errors[0] / errors[1]) > 2.5
