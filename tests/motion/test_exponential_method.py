"""Method `exponential` of the product's kernels: batches, halving, Newton, energies, limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from motions import run_one, started
from newmark_reference import acceleration
from test_newmark import KICK, distance, random_system

from squealstudy.errors import ParameterError
from squealstudy.laws import friction_curve
from squealstudy.motion.integrator import integrator
from squealstudy.motion.integrators.exact_free_motion import (
    ExactFreeMotion,
    propagator_levels,
    propagators,
)
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.level_errors import energy_drift
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate

SHORT = MotionSettings(1e-3, 2e-6, 1, ExactFreeMotion(), tolerance=1e-10)
REST = np.zeros(12)


@pytest.fixture(scope="module")
def rough():
    """Stick, slip and lift-off; a batch of five frictions."""
    system, design = random_system()
    designs = [
        replace(
            design,
            friction=replace(design.friction, friction=mu, curve=friction_curve()),
            c=(1 + mu) * design.c,
        )
        for mu in (0.0, 0.1, 0.3, 0.45, 0.6)
    ]
    return system, designs, simulate(system, started(designs, REST, KICK), SHORT)


def trapezoidal(system, design, h, n_steps, q, v):
    """Slow twin: variation of constants with forces linear over a step, solved by Picard."""
    n = system.n
    load = np.concatenate([np.zeros(n), np.ones(n)])
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(system.omega2), -np.diag(design.c)]])
    X = la.expm(h * np.block([[A, np.diag(load)], [np.zeros((2 * n, 4 * n))]]))
    held = X[: 2 * n, 3 * n :]
    chain = np.zeros((6 * n, 6 * n))
    chain[: 2 * n, : 2 * n], chain[: 2 * n, 2 * n : 4 * n] = A, np.diag(load)
    chain[2 * n : 4 * n, 4 * n :] = np.eye(2 * n) / h
    ramp = la.expm(h * chain)[: 2 * n, 5 * n :]

    def pull(y):
        free = design.c * y[n:] + system.omega2 * y[:n]
        return acceleration(system, design, y[:n], y[n:]) + free

    y = np.concatenate([q, v])
    states = [y]
    for _ in range(n_steps):
        g0 = g1 = pull(y)
        base = X[: 2 * n, : 2 * n] @ y + (held - ramp) @ g0
        for _ in range(200):
            new = pull(base + ramp @ g1)
            if np.abs(new - g1).max() <= 1e-13 * np.abs(new).max():
                break
            g1 = g1 + 0.5 * (new - g1)
        y = base + ramp @ g1
        states.append(y)
    return np.array(states)


def test_slow_twin(rough):
    system, designs, results = rough
    states = trapezoidal(system, designs[2], 2e-6, 60, REST, KICK)
    np.testing.assert_allclose(
        results[2].velocity[:61],
        states[:, system.n : system.n + 2],
        atol=1e-7 * np.abs(states[:, system.n :]).max(),
    )


def test_batches_agree_with_single_runs(rough):
    system, designs, results = rough
    assert max(r.history["open"].max() for r in results) > 0.1
    assert max(r.history["stick"].max() for r in results) > 0.05
    for design, together in zip(designs, results, strict=True):
        alone = simulate(system, started([design], REST, KICK), SHORT)[0]
        assert alone.outcome == together.outcome == "ok"
        assert distance(alone, together) < 1e-6


@pytest.mark.parametrize(
    "changes",
    [
        {"aitken": False},
        {"tangential_damping": "never"},
        {"tangential_damping": "always"},
        {"contact_factor": 3.0},
        {"extrapolate": False},
    ],
)
def test_other_fixed_jacobians_reach_the_same_state(rough, changes):
    system, designs, results = rough
    settings = replace(SHORT, integrator=ExactFreeMotion(**changes), max_iterations=400)
    r = run_one(system, designs[3], settings, REST, KICK)
    assert r.outcome == "ok"
    assert distance(r, results[3]) < 1e-6


def test_a_fresh_jacobian_serves_where_the_fixed_one_fails(rough):
    system, designs, results = rough
    helped = replace(SHORT, max_iterations=4, integrator=ExactFreeMotion(max_halvings=0))
    r = run_one(system, designs[3], helped, REST, KICK)
    assert r.outcome == "ok"
    assert r.newton_steps > 500
    assert distance(r, results[3]) < 1e-6


def test_halved_steps_use_the_coefficients_of_their_size(rough):
    system, designs, _ = rough
    fine = run_one(system, designs[3], replace(SHORT, step=2.5e-7), REST, KICK)
    halved = replace(SHORT, max_iterations=5, step=4e-6)
    r = run_one(system, designs[3], halved, REST, KICK)
    coarse = run_one(system, designs[3], replace(SHORT, step=4e-6), REST, KICK)
    assert r.halvings > 10
    assert distance(r, fine) < 1.2 * distance(coarse, fine) < 0.5


def test_levels_by_squaring_are_the_propagators():
    w2 = np.concatenate([(2 * np.pi * np.geomspace(10, 2e5, 20)) ** 2, [0.0, -1e6, 1e6]])
    c = np.concatenate([0.02 * np.sqrt(w2[:20]), [3.0, 0.0, 1e4]])
    for level, rows in enumerate(propagator_levels(w2, c, 1e-5, 4)):
        wanted = propagators(w2, c, 1e-5 / 2**level)
        size = np.abs(wanted).max(axis=1, keepdims=True)
        np.testing.assert_allclose(rows / size, wanted / size, atol=1e-12)


def test_modes_beyond_the_limit_move_as_newmarks():
    w2 = np.array([1.9, 2.1]) ** 2
    exact, newmark = (m.steps(w2, 0 * w2, 1.0) for m in (ExactFreeMotion(), Newmark()))
    np.testing.assert_array_equal(exact[0, :, 1], newmark[0, :, 1])
    assert np.abs(exact[0, :, 0] - newmark[0, :, 0]).max() > 0.1
    assert np.abs(exact[1, :, 1] - newmark[1, :, 1]).max() > 1e-3  # half the step resolves it


def test_energy_balance_has_no_bias_over_smooth_motion():
    system, design = random_system()
    gentle = replace(design, d=np.zeros(1))
    drifts = []
    for step in (2e-6, 4e-6):
        settings = MotionSettings(4e-3, step, 1, ExactFreeMotion())
        r = simulate(system, started([gentle], REST, 0.01 * KICK), settings)[0]
        assert r.history["dissipated_damping"][-1] > 0.05 * r.history["modal_energy"].max()
        drifts.append(energy_drift(r))
    assert drifts[0] < 1e-3
    assert drifts[1] < 4e-3


def test_prewarping_is_newmarks():
    with pytest.raises(ParameterError, match="no such option; it takes"):
        integrator("exponential", {"prewarp": True})
