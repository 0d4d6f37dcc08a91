"""Friction that reverses within a sample: dense sampling, events located in time, curves."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from squealstudy.cycles.contact import ContactForces
from squealstudy.cycles.continuation import Steps, newton
from squealstudy.cycles.equations import CycleEquations
from squealstudy.cycles.growth import FAR, growth_curve, refined
from squealstudy.cycles.harmonics import series_at, with_harmonics
from squealstudy.cycles.oscillator import Oscillator
from squealstudy.errors import ConvergenceError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.laws import law_row
from squealstudy.laws.contact_law import contact_law
from squealstudy.laws.friction_law import FrictionLaw

FRICTION, SPEED, BOUND_SPEED, DRIVE = 0.1, 1.0, 2e-3, 0.05


def contact_forces(points=1):
    """Points of unit area and pressure that slide at a speed of one."""
    made = np.zeros((layout.N_POINT_ROWS, points))
    made[layout.POINT_AREA] = made[layout.POINT_FRICTION] = 1.0
    made[layout.POINT_SPEED] = SPEED
    made[layout.POINT_NORMAL], made[layout.POINT_T1] = 1.0, -FRICTION
    made[layout.POINT_GAP], made[layout.POINT_STIFFNESS] = -1.0, 1.0
    friction = FrictionLaw(FRICTION, FRICTION / BOUND_SPEED)
    return ContactForces(made, law_row(contact_law("bilateral", stiffness=1.0), friction))


def mass_on_a_belt():
    """q'' - .05 q' + q = friction beyond that of steady sliding."""
    forces = contact_forces()
    B = np.zeros((1, 3, 1))
    B[0, 1, 0] = 1.0
    return Oscillator(np.array([[-DRIVE]]), np.eye(1), B, forces, turning=forces.turning)


def in_time():
    """Amplitude q at q' = 0 and period of the stable cycle: exact pieces between located events."""
    pieces = {}
    for part in (1, 0, -1):  # slides, sticks, slides back
        slope = FRICTION / BOUND_SPEED if part == 0 else 0.0
        force = FRICTION * (1.0 - SPEED / BOUND_SPEED if part == 0 else 1.0 - part)
        pieces[part] = np.array([[0.0, 1.0, 0.0], [-1.0, DRIVE - slope, force], [0.0, 0.0, 0.0]])

    def next_event(part, state, levels):
        """Time, state and level at which q' first comes to one of the levels."""
        look = 2e-4 if part == 0 else 1e-2

        def moved(state, s):
            return expm(s * pieces[part]) @ state

        step, before = expm(look * pieces[part]), state
        for k in range(100_000):
            after = step @ before
            for level in levels:
                # where the piece begins there is no event
                if k and (before[1] - level) * (after[1] - level) <= 0.0:
                    off = partial(lambda a, v, s: moved(a, s)[1] - v, before, level)
                    s = brentq(off, 0.0, look, xtol=1e-15)
                    return k * look + s, moved(before, s), level
            before = after
        raise AssertionError("no event")

    def a_period_on(amplitude):
        t, state, part = 0.0, np.array([amplitude, 0.0, 1.0]), 1
        upper, lower = BOUND_SPEED - SPEED, -BOUND_SPEED - SPEED
        while True:
            levels = {1: [upper, 0.0], 0: [upper, lower], -1: [lower]}[part]
            spent, state, level = next_event(part, state, levels)
            t += spent
            if level == 0.0 and state[0] > 0.0:
                return state[0], t
            if level != 0.0:
                part = 0 if part else (1 if level == upper else -1)

    amplitude = brentq(lambda a: a_period_on(a)[0] - a, 1.02, 1.4, xtol=1e-11)
    return amplitude, a_period_on(amplitude)[1]


def amplitude_of(motion):
    """Largest q."""
    theta = np.linspace(-np.pi, np.pi, 20001)
    return float((series_at(theta, motion.harmonics)[0] @ motion.Q).max())


def cycle(osc, harmonics):
    """The stable cycle: that of the least amplitude, on a curve from a small motion on."""
    lam, phi = 0.5 * DRIVE + 1j, np.ones(1, complex)
    equations, curve = growth_curve(
        osc, lam, phi, 0.5, 5, lambda m: np.abs(m.Q).max() > 1.6, Steps(first=0.1, largest=0.2)
    )
    assert curve.end == FAR
    motion = equations.motion(curve.at("C")[0].u)
    equations = CycleEquations(osc, harmonics, 1.0)
    return refined(equations, replace(motion, Q=with_harmonics(motion.Q, harmonics)))[0]


# -- forces ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("across", [0.0, 5e-4, 0.03], ids=["straight", "in the zone", "aside"])
def test_harmonics_of_reversing_friction_are_those_of_dense_samples(across):
    def harmonics(forces, samples):
        theta = 2 * np.pi * np.arange(samples) / samples
        y, w = np.zeros((samples, 1, 3)), np.zeros((samples, 1, 3))
        w[:, 0, 1] = 1.3 * np.cos(theta) + 0.2 * np.sin(2 * theta)
        w[:, 0, 2] = across * (1.0 + 0.3 * np.cos(theta))
        local = forces(y, w)
        weights = np.exp(-1j * np.arange(6)[:, None] * theta) / samples
        return weights @ local.f[:, 0, 1:], weights @ local.by_w[:, 0, 1, 1]

    made = contact_forces()
    exact, slopes = harmonics(made, 2**17)
    plain, _ = harmonics(made, 64)
    found, found_slopes = harmonics(made.turning, 64)
    off = np.abs(found - exact).max()
    assert off < 2e-3 * FRICTION
    assert off < 0.2 * np.abs(plain - exact).max()
    assert np.abs(found_slopes - slopes).max() < 0.1 * np.abs(slopes).max()


def test_friction_that_does_not_turn_is_left_as_it_was():
    made = contact_forces(2)
    theta = 2 * np.pi * np.arange(64) / 64
    y, w = np.zeros((64, 2, 3)), np.zeros((64, 2, 3))
    w[:, :, 1], w[:, :, 2] = 0.8 * np.cos(theta)[:, None], 0.1
    for one, other in zip(made.turning(y, w), made(y, w), strict=True):
        np.testing.assert_array_equal(one, other)


# -- cycles ----------------------------------------------------------------------------------------
def test_a_cycle_that_reverses_is_that_of_located_events():
    """With few samples too, of which alone the same balance is lost."""
    amplitude, period = in_time()
    assert amplitude > SPEED + BOUND_SPEED
    osc = replace(mass_on_a_belt(), samples=64)
    errors = []
    for harmonics in (10, 40):
        found = cycle(osc, harmonics)
        errors.append(abs(2 * np.pi / found.omega / period - 1.0))
        assert amplitude_of(found) == pytest.approx(amplitude, rel=3e-3)
    assert amplitude_of(found) == pytest.approx(amplitude, rel=1e-3)
    assert errors[1] < 1e-4 < errors[0] < 1e-3
    with pytest.raises(ConvergenceError):
        cycle(replace(osc, turning=None), 10)


# -- continuation ----------------------------------------------------------------------------------
class Circle:
    """x^2 + y^2 = 1."""

    tolerance = 1e-12

    def residual(self, u):
        return np.array([u @ u - 1.0])

    def jacobian(self, u):
        return self.residual(u), 2.0 * u[None]

    def accepted(self, u):
        pass


def test_the_nearest_solution_is_found_where_the_plane_misses_the_curve():
    start, normal = np.array([1.05, 0.1]), np.array([1.0, 0.0])
    with pytest.raises(ConvergenceError):
        newton(Circle(), start, normal, 1.05)
    u, residual, *_ = newton(Circle(), start, normal, None)
    assert residual < 1e-12
    np.testing.assert_allclose(u, start / np.linalg.norm(start), atol=1e-3)
