"""The Python face of the transient kernels: checks, histories, names of outcomes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from motions import run_one

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.integrators.newmark import prewarped
from squealstudy.motion.motion import EnergyBalance
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint


def oscillator():
    """Two modes under a sliding point of constant force; load and radius known."""
    z, one = np.zeros((1, 2)), np.ones(1)
    T = np.array([[1.0, 0.0]])
    w = np.array([100.0, 300.0])
    system = ModalSystem(
        w**2,
        z,
        T,
        z,
        one,
        one,
        0.2 * one,
        0 * one,
        0 * one,
        np.zeros((1, 3)),
        sensed=np.array([2]),
    )
    law = contact_law("exponential", p0=10.0, lam=1.0)
    return system, MotionPoint(law, FrictionLaw(0.5, 1e4), 2.0, 0.02 * w)


@pytest.mark.parametrize(
    ("key", "changes"),
    [
        ("step", {"step": 0.0}),
        ("step", {"step": -1e-6}),
        ("step", {"step": np.nan}),
        ("duration", {"duration": 1e-7}),
        ("save_every", {"save_every": -1}),
        ("tolerance", {"tolerance": 0.0}),
        ("max_iterations", {"max_iterations": 0}),
    ],
)
def test_settings_are_checked(key, changes):
    with pytest.raises(ParameterError) as error:
        MotionSettings(**({"duration": 1e-3, "step": 1e-6} | changes))
    assert error.value.key == key


def test_systems_and_designs_are_checked():
    system, design = oscillator()
    settings = MotionSettings(1e-3, 1e-4)
    with pytest.raises(ModelError, match="'T1' has shape"):
        replace(system, T1=np.zeros((2, 2)))
    with pytest.raises(ModelError, match="'omega2' has values"):
        replace(system, omega2=np.array([1.0, np.nan]))
    with pytest.raises(ModelError, match="k_t > 0"):
        FrictionLaw(0.5, 0.0)
    with pytest.raises(ModelError, match="'viscous' is none of"):
        FrictionLaw(0.5, 1.0, regularisation="viscous")
    with pytest.raises(ModelError, match="'load' needs 2"):
        simulate(system, [replace(design, load=np.zeros(3))], settings)
    with pytest.raises(ModelError, match="initial state"):
        run_one(system, design, settings, np.zeros(3), np.zeros(2))
    with pytest.raises(ModelError, match="initial state"):
        run_one(system, design, settings, np.zeros(2), np.full(2, np.inf))
    with pytest.raises(ModelError, match="'sensed' needs modes from 1 to 2"):
        replace(system, sensed=np.array([0]))
    assert simulate(system, [], settings) == []


@pytest.mark.parametrize(("save_every", "rows"), [(1, 101), (7, 15), (100, 2), (0, 0)])
def test_histories_are_decimated(save_every, rows):
    system, design = oscillator()
    settings = MotionSettings(0.01, 1e-4, save_every, save_q=True)
    r = run_one(system, design, settings, np.zeros(2), [0.0, 1.0])
    assert r.outcome == "ok"
    assert r.time == pytest.approx(0.01)
    assert r.q_history.shape == (rows, 2)
    assert r.velocity.shape == (rows, 1)
    np.testing.assert_allclose(r.history["time"], np.arange(rows) * save_every * 1e-4, atol=1e-15)
    np.testing.assert_array_equal(r.displacement[:, 0], r.q_history[:, 1])


def test_what_the_columns_hold():
    system, design = oscillator()
    r = simulate(system, [design], MotionSettings(0.05, 1e-5, 10))[0]
    h = r.history
    np.testing.assert_allclose(h["torque"], 0.2 * 0.5 * 10, rtol=1e-12)
    np.testing.assert_allclose(h["normal_force"], 10, rtol=1e-12)
    np.testing.assert_allclose(h["slip"], 1, rtol=1e-12)
    np.testing.assert_allclose(h["work_belt"], 5.0 * 2.0 * h["time"], rtol=1e-9, atol=1e-15)
    energy = r.energy
    assert h["work_belt"][-1] == pytest.approx(energy.work_belt)
    assert h["stored"][-1] == pytest.approx(energy.stored_end)
    assert h["modal_energy"][-1] == pytest.approx(energy.stored_end)
    assert abs(energy.relative) < 1e-10
    assert energy.damping > 0


def test_a_final_state_continues():
    system, design = oscillator()
    settings = MotionSettings(0.02, 1e-4)
    whole = run_one(system, design, settings, np.zeros(2), [0.3, 1.0])
    half = replace(settings, duration=0.01)
    first = run_one(system, design, half, np.zeros(2), [0.3, 1.0])
    second = run_one(system, design, half, first.q, first.v)
    np.testing.assert_allclose(second.v, whole.v, rtol=1e-9)


def test_energy_balance():
    balance = EnergyBalance(1.0, 5.0, 3.0, 1.0, 2.0, 3.5)
    assert balance.residual == pytest.approx(0.5)
    assert balance.relative == pytest.approx(0.5 / 3)
    assert EnergyBalance(0, 0, 0, 1.0, 2.0, 0.9).relative == pytest.approx(0.05)
    assert EnergyBalance(0, 0, 0, 0, 0, 0).relative == 0.0


def test_prewarping_keeps_what_it_cannot_help():
    w2, c = np.array([[1e4, 0.0, 1e16]]), np.array([[0.0, 3.0, 5.0]])
    warped, damping = prewarped(w2, c, 1e-3)
    assert warped[0, 0] == pytest.approx((2000 * np.tan(0.05)) ** 2)
    assert warped[0, 1:] == pytest.approx([0.0, 1e16])
    assert damping[0] == pytest.approx([0.0, 2000 * np.tanh(0.0015), 5.0])
