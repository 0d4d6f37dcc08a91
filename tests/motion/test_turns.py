"""Friction that reverses within a sample: dense sampling, events located in time, curves."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from functools import partial

import cycle_models as models
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from test_cycles import contact_case

from squealstudy.cycles.balance import Balance, imbalance
from squealstudy.cycles.contact import ContactForces
from squealstudy.cycles.continuation import Steps, newton
from squealstudy.cycles.equations import CycleEquations
from squealstudy.cycles.growth import FAR
from squealstudy.cycles.harmonics import series_at, with_harmonics
from squealstudy.cycles.oscillator import Oscillator
from squealstudy.errors import ConvergenceError
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels import turns
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
    equations, curve = models.growth_curve(
        osc, lam, phi, 0.5, 5, lambda m: np.abs(m.Q).max() > 1.6, Steps(first=0.1, largest=0.2)
    )
    assert curve.end == FAR
    motion = equations.motion(curve.at("C")[0].u)
    equations = CycleEquations(osc, harmonics, 1.0)
    return models.refined(equations, replace(motion, Q=with_harmonics(motion.Q, harmonics)))[0]


def derivatives_off(osc, seed):
    """Off central differences, relative; these have converged at steps of 1e-4 to 1e-8."""
    w, size = float(np.sqrt(np.diag(osc.K)).max()), 2e-4
    Q = size * np.random.default_rng(seed).normal(size=(7, osc.n))
    found = Balance(osc, 3).balanced(Q.ravel(), 1.03 * w, 0.0).J
    exact = np.empty_like(found)
    for k in range(Q.size):
        step = np.zeros(Q.size)
        step[k] = 1e-6 * size
        step = step.reshape(Q.shape)
        ends = [imbalance(osc, Q + sign * step, 1.03 * w, 0.0).ravel() for sign in (1, -1)]
        exact[:, k] = (ends[0] - ends[1]) / (2e-6 * size)
    return np.abs(found - exact).max() / np.abs(found).max()


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


def test_points_that_are_passed_over_have_no_cell_to_integrate():
    """What is told of a point at once is what each of its cells says."""
    in_plain_python("check_what_is_passed_over")


def test_derivatives_are_those_of_differences_where_nodes_stay():
    """Shares and nodes move with the motion: what Gauss's rule errs by changes with them.

    In a process of plain Python, where the kernel's parts can be replaced.
    """
    osc = contact_case("smooth", True)
    assert osc.samples == 256
    for seed in (2, 3):
        off = derivatives_off(osc, seed)
        assert 1e-5 < off < 2e-3  # more than interpolation
    in_plain_python("check_where_nodes_stay")


def in_plain_python(check):
    """A function of this file, the parts of kernels being functions of Python."""
    code = f"import test_turns; test_turns.{check}()"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


def check_what_is_passed_over():
    """Slow points, others that hardly turn, some that reverse."""
    rng, samples, points = np.random.default_rng(1), 32, 60
    made = contact_forces(points)
    theta = 2 * np.pi * np.arange(samples)[:, None, None] / samples
    y, w = np.zeros((2, samples, points, 3))
    w[:, :, 1:] = rng.uniform(0.0, 1.4, (1, points, 2)) * np.cos(theta)
    w[:, :, 1:] += 0.05 * rng.normal(size=(1, points, 2)) * np.sin(2 * theta)
    turned, slowest = turns._turned(made.points, w)
    passed = 0
    for i in range(points):
        fastest = turns._fastest_stick(made.points, made.law, y, i)
        over = not turned[i] and (1 - turns.TURN_MIN) ** 2 * slowest[i] > fastest**2
        shares = [
            turns._turning(made.points, made.law, y, w, s, (s + 1) % samples, i, fastest)
            for s in range(samples)
        ]
        assert not (over and max(shares) > 0.0)
        speeds = (w[:, i, 1] + SPEED) ** 2 + w[:, i, 2] ** 2
        assert slowest[i] == pytest.approx(speeds.min())
        passed += over
    assert 0 < passed < points


def check_where_nodes_stay():
    osc = contact_case("smooth", True)
    for seed in (2, 3):
        with pytest.MonkeyPatch.context() as patch:
            for name in ("_turning", "_nodes"):
                patch.setattr(turns, name, first_answers(getattr(turns, name)))
            assert derivatives_off(osc, seed) < 1e-6


def first_answers(made):
    """A function of a cell (s, i) that goes on to say what it said of it at first."""
    known = {}

    def told(points, law, y, w, s, *rest):
        i = rest[1] if made.__name__ == "_turning" else rest[0]
        nodes = rest[-1]
        if (s, i) not in known:
            known[s, i] = made(points, law, y, w, s, *rest), np.copy(nodes)
        answer, kept = known[s, i]
        if np.ndim(nodes):
            nodes[:] = kept
        return answer

    return told


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
    rough = False

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
