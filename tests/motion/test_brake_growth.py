"""Both domains on one model: the brake's exponential phase grows at its complex mode's rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from conftest import NOMINAL
from motions import run_one

from squealstudy.laws import FrictionLaw
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.operating import DesignState
from squealstudy.motion.growing_modes import (
    GrowingModes,
    growth_sensors,
    projection,
)
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import shared_modes
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.working_point import working_point

ZETA = 0.005
BETA = 1.5e-7  # s; holds modes above the band, which friction excites too
BAND = (2 * np.pi * 500.0, 2 * np.pi * 8000.0)
POINTS = [(12e5, 0.5), (12e5, 0.65), (8e5, 0.4), (4e5, 0.5), (20e5, 0.6)]


def most_unstable(C, K):
    """Fastest growth below 8 kHz: root, right and left vector of lambda^2 + lambda C + K."""
    lam, right = dense_roots(C, K, BAND)
    k = np.argmax(lam.real)
    Q = lam[k] ** 2 * np.eye(len(K)) + lam[k] * C + K
    factor = la.lu_factor(Q.conj().T)  # singular but for round-off: inverse iteration
    left = np.ones(len(K), dtype=complex)
    for _ in range(3):
        left = la.lu_solve(factor, left / np.linalg.norm(left))
    left /= np.linalg.norm(left)
    assert np.linalg.norm(left.conj() @ Q) < 1e-9 * np.linalg.norm(K)
    return lam[k], right[:, k], left


@pytest.mark.parametrize(("pressure", "friction"), POINTS)
def test_growth_through_the_left_vector_is_that_of_the_mode(brake, reduced, pressure, friction):
    operating = replace(NOMINAL, brake_pressure=pressure, friction=friction)
    point = working_point(brake.space, operating)
    state = DesignState(operating, damping_ratio=ZETA, stiffness_damping=BETA)
    bare = shared_modes(reduced[0], point, state)
    lam, right, left = most_unstable(bare.C, bare.K)
    system = bare.system
    speed = operating.sliding_speed
    law = FrictionLaw(friction, friction * point.contact_pressure.max() / (0.02 * speed))
    design = MotionPoint(
        operating.law,
        law,
        speed,
        2 * ZETA * system.frequencies + BETA * system.omega2,
        growing=GrowingModes(sensors=growth_sensors(bare.C, lam, left)),
    )
    settings = MotionSettings(duration=4e-3, step=2e-6, save_every=5)
    scale = 1e-6 / np.abs(right * lam).max()  # m/s: far below what contact would notice
    q0, v0 = (scale * right).real, (scale * lam * right).real
    result = run_one(system, design, settings, q0, v0)
    assert result.outcome == "ok"
    xi = projection(result.displacement, result.velocity)
    time = result.history["time"]
    slope = np.polyfit(time, np.log(np.abs(xi)), 1)[0]
    assert slope == pytest.approx(lam.real, rel=5e-3, abs=0.1)
    assert np.ptp(np.log(np.abs(xi)) - lam.real * time) < 0.02


def test_a_component_mode_is_exactly_in_the_modal_coordinates(brake, reduced):
    """Damping a caliper mode needs no projection (Vermot des Roches et al. 2010, fig. 13)."""
    key = ("caliper", 8)
    state = DesignState(NOMINAL)
    modes = shared_modes(reduced[0], brake.point, state, component_modes=(key,))
    damped = shared_modes(reduced[0], brake.point, DesignState(NOMINAL, mode_damping={key: 0.1}))
    row = modes.system.shapes[0]
    assert row @ row == pytest.approx(1.0, abs=1e-12)
    omega = brake.modes["caliper"].omega[7]
    np.testing.assert_allclose(
        damped.C - modes.C, 2 * 0.1 * omega * np.outer(row, row), atol=1e-8 * omega
    )
