"""Design points on shared reference modes: their base state, forecast, start; smaller bases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import CUTOFF, NOMINAL
from motions import run_one

from squealstudy.errors import ParameterError
from squealstudy.laws import friction_curve
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.operating import DesignState
from squealstudy.motion.growing_modes import growing_modes, left_vectors
from squealstudy.motion.point import (
    contact_speed,
    friction_law,
    motion_point,
    perturbed,
    tangent,
)
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import Training, shared_modes, truncated, with_pod
from squealstudy.motion.simulate import simulate
from squealstudy.reduction.prepared import shape_column
from squealstudy.reduction.working_point import working_point
from squealstudy.system.linearise import linearise

BAND = (500.0, 8000.0)
KEYS = (("caliper", 7), ("caliper", 8))
NOMINAL_STATE = DesignState(NOMINAL, damping_ratio=0.005)


@pytest.fixture(scope="module")
def reference(brake, reduced):
    return shared_modes(reduced[0], brake.point, DesignState(NOMINAL), KEYS)


def changed_space(brake, reduced, state):
    omega = {k: reduced[0].k_el[reduced[0].mode_coordinate(*k)] ** 0.5 for k in KEYS}
    changes = state.stiffness_changes(omega)
    return brake.space.changed({shape_column(reduced[0], *k): v for k, v in changes.items()})


def start_of(point):
    return point.q0, point.v0


def at(brake, reduced, reference, state, point=None):
    point = point or working_point(changed_space(brake, reduced, state), state.operating)
    friction = friction_law(reference.system, state, point, 0.0, 1e-3, "regularised")
    return point, motion_point(reference, point, state, friction, BAND, 1e-7)


STATES = [
    NOMINAL_STATE,
    DesignState(replace(NOMINAL, brake_pressure=25e5, friction=0.3), damping_ratio=0.01),
    DesignState(NOMINAL, {("caliper", 7): 1.25}, {("caliper", 8): 0.05}, 0.0),
    DesignState(
        replace(NOMINAL, curve=friction_curve(static_ratio=1.5, decay_speed=0.4), sliding_speed=0.3)
    ),
]


@pytest.mark.parametrize("state", STATES)
def test_the_tangent_is_the_frequency_domain_linearised_anew(brake, reduced, reference, state):
    """Same assembly, working point, damping and basis."""
    model, phi = reduced[0], reference.phi
    point, made = at(brake, reduced, reference, state)
    C, K = tangent(reference.system, made, point, state)
    fresh = linearise(model, point, state)
    np.testing.assert_allclose(K, phi.T @ fresh.K @ phi, atol=1e-9 * np.abs(K).max())
    np.testing.assert_allclose(C, phi.T @ fresh.C @ phi, atol=1e-9 * np.abs(C).max())
    # the reference's own working point has nothing between coordinates: runs there pay nothing
    assert (made.damping_between is None) == (state is NOMINAL_STATE or not state.damping_ratio)


@pytest.mark.parametrize("state", STATES[:3])
def test_a_design_point_stays_at_its_own_steady_sliding(brake, reduced, reference, state):
    _, made = at(brake, reduced, reference, state)
    settings = MotionSettings(duration=4e-4, step=2e-6, save_every=10)
    (result,) = simulate(reference.system, [made], settings)
    assert result.outcome == "ok"
    np.testing.assert_allclose(result.history["torque"], made.static_torque, rtol=1e-9)
    # round-off in the forces does not grow to anything
    assert np.abs(result.q).max() < 1e-12


def test_growing_modes_are_sorted_and_biorthogonal(brake, reduced, reference):
    point, made = at(brake, reduced, reference, NOMINAL_STATE)
    C, K = tangent(reference.system, made, point, NOMINAL_STATE)
    modes = made.growing
    assert modes.n_unstable == (dense_roots(C, K, band(BAND))[0].real > 0).sum()
    assert (np.diff(modes.lam.real) <= 0).all()
    for lam, x, y in zip(modes.lam, modes.right.T, modes.left.T, strict=True):
        Q = lam**2 * np.eye(len(K)) + lam * C + K
        assert np.linalg.norm(Q @ x) < 1e-9 * np.linalg.norm(K)
        assert np.linalg.norm(y.conj() @ Q) < 1e-9 * np.linalg.norm(K)


def band(hz):
    return 2 * np.pi * hz[0], 2 * np.pi * hz[1]


def test_a_stable_point_follows_its_least_stable_mode(brake, reduced, reference):
    state = DesignState(replace(NOMINAL, friction=0.05), damping_ratio=0.02)
    _, made = at(brake, reduced, reference, state)
    assert made.growing.n_unstable == 0
    assert len(made.growing.lam) == 1
    assert made.growing.lam[0].real < 0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_of_neutral_modes_the_lowest_stands_for_them_whatever_round_off_says(sign):
    K = np.diag((2 * np.pi * np.array([1e3, 2e3])) ** 2)
    C = sign * np.diag([1e-9, -1e-9])
    modes = growing_modes(C, K, np.diag(K), (500.0, 5000.0), 1e-7)
    assert modes.n_unstable == 0
    assert abs(modes.lam[0]) == pytest.approx(2 * np.pi * 1e3, rel=1e-12)


def test_what_grows_above_the_band_is_told():
    """Two blocks that flutter, one inside the band and one above it."""
    low = np.array([[1.0, -0.5], [0.5, 1.1]]) * (2 * np.pi * 1e3) ** 2
    K = np.zeros((4, 4))
    K[:2, :2], K[2:, 2:] = low, low * 100
    modes = growing_modes(np.zeros((4, 4)), K, np.diag(K), (500.0, 5000.0), 1e-7)
    assert (modes.n_unstable, modes.n_above) == (1, 1)
    assert modes.frequency_outside == pytest.approx(10 * abs(modes.lam[0]) / 2 / np.pi, rel=1e-9)
    assert modes.growth_outside == pytest.approx(10 * modes.lam[0].real, rel=1e-9)


def test_what_grows_below_the_band_is_told():
    low = np.array([[1.0, -0.5], [0.5, 1.1]]) * (2 * np.pi * 1e3) ** 2
    modes = growing_modes(np.zeros((2, 2)), low, np.diag(low), (2e3, 5e3), 1e-7)
    assert (modes.n_unstable, modes.n_above, modes.n_below, modes.n_outside) == (0, 0, 1, 1)
    assert modes.frequency_outside == pytest.approx(1e3, rel=0.1)


def test_left_vectors_of_a_small_problem():
    rng = np.random.default_rng(1)
    C, K = rng.normal(size=(5, 5)), rng.normal(size=(5, 5)) + 10 * np.eye(5)
    lam, _ = dense_roots(C, K, (0.0, np.inf))
    lam = lam[lam.imag > 0]
    for root, y in zip(lam, left_vectors(C, K, lam).T, strict=True):
        Q = root**2 * np.eye(5) + root * C + K
        assert np.linalg.norm(y.conj() @ Q) < 1e-11 * np.linalg.norm(Q)


def test_the_start_has_the_velocity_asked_for(brake, reduced, reference):
    _, made = at(brake, reduced, reference, NOMINAL_STATE)
    q, v = start_of(perturbed(reference.system, made, 1e-3))
    assert contact_speed(reference.system, v) == pytest.approx(1e-3, rel=1e-12)
    # kinetic energy: the displacement at the largest velocity is small
    assert np.sum(reference.system.omega2 * q**2) < v @ v
    q, v = start_of(perturbed(reference.system, made, 2e-3, (25,)))
    assert not q.any()
    assert np.flatnonzero(v).tolist() == [24]
    assert contact_speed(reference.system, v) == pytest.approx(2e-3, rel=1e-12)
    q, v = start_of(perturbed(reference.system, made, 0.0))
    assert not q.any()
    assert not v.any()


def test_the_start_does_not_depend_on_signs_of_eigenvectors(brake, reduced, reference):
    """Nor on their phases: two runs of one study must begin alike."""
    _, made = at(brake, reduced, reference, NOMINAL_STATE)
    assert len(made.growing.lam) > 1
    turned = made.growing.right * np.exp(1j * np.arange(1, len(made.growing.lam) + 1))
    signs = np.where(np.arange(reference.system.n) % 3, 1.0, -1.0)
    names = ("N", "T1", "T2")
    other = replace(reference.system, **{k: getattr(reference.system, k) * signs for k in names})
    right = signs[:, None] * turned
    point = replace(made, growing=replace(made.growing, right=right))
    for modes in ((), (24, 25, 26)):
        expected = start_of(perturbed(reference.system, made, 1e-3, modes))
        found = start_of(perturbed(other, point, 1e-3, modes))
        for a, b in zip(expected, found, strict=True):
            np.testing.assert_allclose(signs * b, a, atol=1e-9 * np.abs(a).max())


def test_assembly_damping_replaces_the_uniform_one(brake, reduced, reference):
    state = replace(NOMINAL_STATE, assembly_damping={25: 0.03})
    _, made = at(brake, reduced, reference, state)
    _, plain = at(brake, reduced, reference, NOMINAL_STATE)
    ratio = made.c / np.maximum(plain.c, 1e-300)
    assert ratio[24] == pytest.approx(6.0)
    assert (np.delete(ratio, 24) == 1.0).all()
    with pytest.raises(ParameterError, match="assembly modes 1 to"):
        at(brake, reduced, reference, replace(NOMINAL_STATE, assembly_damping={10**6: 0.1}))


# -- smaller bases -------------------------------------------------------------------------------
def snapshots(reference, made):
    start = perturbed(reference.system, made, 0.05)
    settings = MotionSettings(duration=2e-3, step=2e-6, save_every=5, save_q=True)
    (result,) = simulate(reference.system, [start], settings)
    return result.q_history, result.history["torque"], start_of(start), settings


def test_truncation_keeps_the_modes_below(reference):
    small = truncated(reference, 8000.0)
    n = small.system.n
    assert small.n_exact == n < reference.system.n
    np.testing.assert_array_equal(small.system.omega2, reference.system.omega2[:n])
    assert small.system.omega2[-1] <= (2 * np.pi * 8000.0) ** 2
    np.testing.assert_allclose(small.system.N, reference.system.N[:, :n], atol=1e-18)
    with pytest.raises(ParameterError, match="no assembly mode"):
        truncated(reference, 1.0)


def test_pod_vectors_keep_mass_stiffness_and_damping(brake, reduced, reference):
    _, made = at(brake, reduced, reference, NOMINAL_STATE)
    rows, *_ = snapshots(reference, made)
    small = with_pod(reference, CUTOFF, Training(rows, made.growing.right), 30)
    n = small.system.n
    assert n == small.n_exact + 30
    V = reference.phi.T @ small.phi
    np.testing.assert_allclose(V.T @ V, np.eye(n), atol=1e-10)
    W = reference.system.omega2
    np.testing.assert_allclose(
        V.T @ (W[:, None] * V), np.diag(small.system.omega2), atol=1e-9 * small.system.omega2.max()
    )
    _, design = at(brake, reduced, small, NOMINAL_STATE)
    C = np.diag(design.c) + design.damping_between
    wanted = V.T @ ((2 * 0.005 * np.sqrt(np.maximum(W, 0)))[:, None] * V)
    np.testing.assert_allclose(C, wanted, atol=1e-9 * C.max())


def test_pod_vectors_of_a_run_reproduce_it(brake, reduced, reference):
    """Torque over 2 ms of strong motion: POD vectors beside the modes below the cutoff."""
    state = replace(NOMINAL_STATE, stiffness_damping=1.5e-7)  # holds what friction excites high up
    point, made = at(brake, reduced, reference, state)
    rows, torque, (q0, v0), settings = snapshots(reference, made)
    errors = {}
    for count in (0, 60):
        training = Training(rows, made.growing.right)
        small = (
            with_pod(reference, CUTOFF, training, count) if count else truncated(reference, CUTOFF)
        )
        _, design = at(brake, reduced, small, state, point)
        V = reference.phi.T @ small.phi
        result = run_one(small.system, design, settings, V.T @ q0, V.T @ v0)
        difference = result.history["torque"] - torque
        errors[count] = np.linalg.norm(difference) / np.linalg.norm(torque - torque.mean())
    assert errors[60] < 0.2 * errors[0]


def test_growth_rates_of_training_designs_are_kept_beside_few_pod_vectors(
    brake, reduced, reference
):
    point, made = at(brake, reduced, reference, NOMINAL_STATE)
    rows, *_ = snapshots(reference, made)
    errors = []
    for modes in (made.growing.right, made.growing.right[:, :0]):
        small = with_pod(reference, CUTOFF, Training(rows, modes), 16)
        _, again = at(brake, reduced, small, NOMINAL_STATE, point)
        errors.append(np.abs(again.growing.lam[0] - made.growing.lam[0]) / made.growing.lam[0].real)
    assert errors[0] < 2e-3 < errors[1]
