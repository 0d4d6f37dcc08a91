"""Friction that falls with the sliding speed, and damping of assembly modes, in frequency."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from blocks import OPERATING as BLOCKS_OPERATING
from blocks import blocks
from conftest import CUTOFF, NOMINAL, build_model, full_order, reduce_brake

from squealstudy.errors import ParameterError
from squealstudy.kernels.laws import friction_at, law_row
from squealstudy.laws import (
    FRICTION_CURVES,
    FrictionCurveDefinition,
    FrictionLaw,
    contact_law,
    friction_curve,
)
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.linalg.sparse_qep import DENSE_LIMIT
from squealstudy.models.catalogue import MODELS
from squealstudy.models.minimal_parts import bilateral_points
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.full_order import modes as full_order_module
from squealstudy.modes.full_order.modes import (
    full_order_roots,
    full_order_system,
    stiffness_residuals,
)
from squealstudy.motion.point import automatic_slope
from squealstudy.parameter import Parameter
from squealstudy.reduction.cmt import ReductionSettings, component_modes, reduce_cmt
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.prepared import mean_contact_stiffness, shape_column
from squealstudy.reduction.working_point import WorkingPoint, working_point
from squealstudy.root_pairs import paired_with_full_order
from squealstudy.study.design import DesignPoint
from squealstudy.system.linearise import component_frequencies, linearise

K_T = 1e12  # N s/m3: saturated long before any sliding speed here
FALLING = replace(NOMINAL, friction=0.4, curve=friction_curve(static_ratio=1.5, decay_speed=0.3))
NO_PRESSURE, ONE = np.zeros(1), np.ones(1)  # this curve does not depend on it
EVERYTHING = (0.0, np.inf)


def falling_curve(ratio, decay):
    return friction_curve(static_ratio=ratio, decay_speed=decay)


CONSTANT = replace(
    FALLING, friction=FALLING.friction_at(NO_PRESSURE, ONE).mu, curve=falling_curve(1.0, 0.5)
)


def traction(operating, p, w1, w2):
    """Kernel's traction at sliding velocity (w1, w2) under the law of an operating point."""
    law = FrictionLaw(operating.friction, K_T, operating.curve)
    t1, t2, sticks = friction_at(law_row(operating.law, law), 1.0, p, w1, w2)
    assert not sticks
    return np.array([t1, t2])


# -- the law -------------------------------------------------------------------------------------
@pytest.mark.parametrize("speed", [0.05, 0.5, 3.0])
@pytest.mark.parametrize(("ratio", "decay"), [(1.2, 0.1), (2.0, 0.5), (1.5, 4.0)])
def test_slope_is_that_of_the_kernels_law(speed, ratio, decay):
    operating = OperatingPoint(0.4, 1e5, speed, contact_law(), falling_curve(ratio, decay))
    p, h = 3e5, 1e-6
    along = (traction(operating, p, speed + h, 0.0) - traction(operating, p, speed - h, 0.0)) / (
        2 * h
    )
    across = (traction(operating, p, speed, h) - traction(operating, p, speed, -h)) / (2 * h)
    mu = -traction(operating, p, speed, 0.0)[0] / p
    own = operating.friction_at(NO_PRESSURE, ONE)
    assert own.mu == pytest.approx(mu, rel=1e-14)
    assert mu == pytest.approx(0.4 + 0.4 * (ratio - 1) * math.exp(-speed / decay), rel=1e-14)
    assert own.by_speed < 0
    assert -along[0] / p == pytest.approx(own.by_speed, rel=1e-6, abs=1e-9)
    assert -across[1] / p == pytest.approx(own.mu / speed, rel=1e-6)


@pytest.mark.parametrize("decay", [1e-3, 0.5, 100.0])
def test_constant_friction_has_no_slope(decay):
    operating = replace(NOMINAL, friction=0.37, curve=falling_curve(1.0, decay))
    assert operating.friction_at(NO_PRESSURE, ONE) == (0.37, 0.0, 0.0)


def fading(s, p, friction, weight):
    """mu = friction (1 + weight s exp(-p / 1 MPa)): over speed and pressure, and its slopes."""
    share = math.exp(-p / 1e6)
    slope = friction * weight * share
    return friction + slope * s, slope, -slope * s / 1e6


@pytest.fixture
def fading_curve(monkeypatch):
    """A curve that gives no derivatives of its own."""
    weight = Parameter("friction_law.weight", 0.5, "s/m", "of the fall", minimum=0.0)
    law = FrictionCurveDefinition(
        name="fading", description="over both", parameters=(weight,), mu=fading
    )
    monkeypatch.setitem(FRICTION_CURVES._known, "fading", law)
    return friction_curve("fading", weight=0.5)


def test_friction_that_depends_on_pressure(fading_curve):
    """The traction mu p follows the pressure by more than mu; a point at rest has its own mu."""
    p, h = np.array([2e5, 1e6, 3e6]), 1.0
    found = fading_curve.at(0.4, 0.7, p)
    np.testing.assert_allclose(found.mu, 0.4 * (1 + 0.35 * np.exp(-p / 1e6)), rtol=1e-14)
    traction = [fading_curve.at(0.4, 0.7, p + sign * h).mu * (p + sign * h) for sign in (1, -1)]
    np.testing.assert_allclose(found.following(p), (traction[0] - traction[1]) / 2, rtol=1e-8)
    assert fading_curve.at_rest(0.4, 1e6) == 0.4
    without = friction_curve(static_ratio=1.5).at(0.4, 0.7, p)
    assert without.following(p) == without.mu


def test_the_automatic_slope_is_of_the_point_with_most_friction(monkeypatch):
    """mu p is largest at 1 MPa, a ninth of it at the point that presses hardest."""
    steep = FrictionCurveDefinition(name="steep", description="with pressure", mu=falling_steeply)
    monkeypatch.setitem(FRICTION_CURVES._known, "steep", steep)
    operating = OperatingPoint(0.4, 1e6, 0.5, contact_law("bilateral"), friction_curve("steep"))
    p = np.array([1e5, 1e6, 1e7])
    point = WorkingPoint(-p, p, np.ones(3), 1, 0.0, 0.0)
    slope = automatic_slope(
        bilateral_points(np.eye(3), np.eye(3), np.ones(3)), DesignState(operating), point, 1e-3
    )
    assert slope == pytest.approx(0.2 * 1e6 / 1e-3, rel=1e-12)


def falling_steeply(s, p, friction):
    x = p / 1e6
    return friction / (1 + x**2), 0.0 * s, -2e-6 * friction * x / (1 + x**2) ** 2


def test_derivatives_of_a_curve_that_gives_none(fading_curve):
    """By speed, pressure, friction and its own parameter: those of the formula."""
    p, s = np.array([2e5, 1e6, 3e6]), 0.7
    by = fading_curve.slopes(0.4, s, p)
    e, one, nothing = np.exp(-p / 1e6), np.ones(3), np.zeros(3)
    slope = 0.4 * 0.5 * e
    exact = [
        (slope, nothing, -slope / 1e6),
        (-slope * s / 1e6, -slope / 1e6, slope * s / 1e12),
        (one + 0.5 * s * e, 0.5 * e, -0.5 * e * s / 1e6),
        (0.4 * s * e, 0.4 * e, -0.4 * e * s / 1e6),
    ]
    assert by.shape == (4, 3, 3)
    for found, formula in zip(by, exact, strict=True):
        for a, b in zip(found, formula, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9 * np.abs(b).max() + 1e-15)


def test_derivatives_of_falling_friction_are_those_of_its_curve(monkeypatch):
    """All of them, by pressure too, against differences of the curve."""
    p, curve = np.zeros(1), falling_curve(1.4, 0.3)
    given = curve.slopes(0.4, 0.2, p)
    monkeypatch.setitem(FRICTION_CURVES._known, curve.kind, replace(curve.definition, slopes=None))
    np.testing.assert_allclose(given, curve.slopes(0.4, 0.2, p), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", list(MODELS))
def test_every_model_has_the_law(name):
    model = MODELS[name]
    values = model.defaults() | {"friction_law.static_ratio": 1.5, "friction_law.decay_speed": 0.2}
    design = DesignPoint(model, {}, values)
    operating = design.operating_point()
    assert operating.curve == falling_curve(1.5, 0.2)
    assert design.state().operating == operating
    for key, low in (("friction_law.static_ratio", 0.99), ("friction_law.decay_speed", 0.0)):
        with pytest.raises(ParameterError, match=key):
            model.parameter(key).check(low)
    assert model.parameter("contact.kt").check(0.0) == 0.0
    with pytest.raises(ParameterError, match=r"contact\.kt"):
        model.parameter("contact.kt").check(-1.0)
    assert not any(p.structural for p in model.parameters if p.name.startswith("friction_law."))


# -- the brake -----------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def least_reduced(least_brake):
    return reduce_brake(least_brake)[0]


def test_working_point_slides_at_the_friction_of_its_speed(least_brake):
    falling = working_point(least_brake.space, FALLING)
    constant = working_point(least_brake.space, CONSTANT)
    np.testing.assert_array_equal(falling.gap, constant.gap)
    slow = working_point(least_brake.space, replace(FALLING, sliding_speed=0.05))
    assert np.abs(slow.contact_pressure / falling.contact_pressure - 1).max() > 0.01


def test_damping_is_the_derivative_of_the_friction_forces(least_brake, least_reduced):
    model = least_reduced
    point = working_point(least_brake.space, FALLING)
    C = linearise(model, point, DesignState(FALLING)).C
    velocity = np.random.default_rng(5).standard_normal(model.n)
    velocity *= 1e-5 / np.abs(model.T @ velocity).max()

    def force(v):
        slip = FALLING.sliding_speed + model.T @ v, model.T_perp @ v
        t = np.array(
            [traction(FALLING, *row) for row in zip(point.contact_pressure, *slip, strict=True)]
        )
        t *= (model.area * model.frictional)[:, None]
        return model.T.T @ t[:, 0] + model.T_perp.T @ t[:, 1]

    expected = -(force(velocity) - force(-velocity)) / 2
    np.testing.assert_allclose(C @ velocity, expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(C, C.T, atol=1e-12 * np.abs(C).max())


LOW_TOP = 2500.0  # Hz, of a band with half of the modes below TOP


def against_full_order(brake, model, state):
    """Roots of the reduced brake and of the unreduced one from 500 Hz to LOW_TOP."""
    changes = state.stiffness_changes(component_frequencies(model))
    space = brake.space.changed({shape_column(model, *key): dk for key, dk in changes.items()})
    point = working_point(space, state.operating)
    system = linearise(model, point, state)
    lam, _ = dense_roots(system.C, system.K, (2 * np.pi * 450.0, 2.2 * np.pi * LOW_TOP))
    full = full_order_system(brake.assembly, brake.modes, point, state, CUTOFF)
    found = full_order_roots(full, (2 * np.pi * 500.0, 2 * np.pi * LOW_TOP))
    assert stiffness_residuals(full, found.lam, found.psi).max() < 1e-8
    return lam, found.lam


def test_falling_friction_reduced_and_full(least_brake, least_reduced):
    lam, full = against_full_order(least_brake, least_reduced, DesignState(FALLING))
    error = paired_with_full_order(lam, full)
    assert error.missed == 0
    assert error.frequency_error < 2e-5
    assert error.damping_error < 2e-5
    constant = CONSTANT
    point = working_point(least_brake.space, constant)
    system = linearise(least_reduced, point, DesignState(constant))
    calm, _ = dense_roots(system.C, system.K, (2 * np.pi * 500.0, 2 * np.pi * LOW_TOP))
    assert (full.real > 0).sum() > (calm.real > 0).sum()  # the fall of friction excites


def test_full_order_finds_all_roots():
    assembly, low, high = blocks(), 500.0, 4000.0
    assert assembly.n_dof > DENSE_LIMIT
    operating = replace(BLOCKS_OPERATING, curve=friction_curve(static_ratio=1.5, decay_speed=0.3))
    point = working_point(contact_space(assembly, 1e11, np.zeros((assembly.n_dof, 0))), operating)
    state = DesignState(operating)
    found = full_order(assembly, {}, point, state, (low, high), CUTOFF).lam
    system = full_order_system(assembly, {}, point, state, CUTOFF)
    M, C, K = (A.toarray() for A in (assembly.M, system.C.sparse, system.K.sparse))
    n = len(M)
    low_half = -np.linalg.solve(M, np.hstack([K, C]))
    lam = np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, n), low_half]))
    hz = np.abs(lam) / (2 * np.pi)
    exact = lam[(lam.imag >= 0) & (hz > low) & (hz < high)]
    assert len(exact) > 10
    assert len(found) == len(exact)
    gap = np.abs(found[:, None] - exact).min(axis=0)
    assert (gap < 1e-6 * np.abs(exact)).all()


def test_assembly_damping_reduced_and_full(least_brake, least_reduced):
    shifted = {("caliper", 8): 1.25, ("disc", 9): 0.8}
    state = DesignState(
        FALLING, shifted, damping_ratio=0.005, assembly_damping={12: 0.03, 20: 0.05, 21: 0.0}
    )
    error = paired_with_full_order(*against_full_order(least_brake, least_reduced, state))
    assert error.missed == 0
    assert error.frequency_error < 1e-4
    assert error.damping_error < 1e-4


# -- damping of assembly modes -------------------------------------------------------------------
def small_model(name, operating=None, **values):
    """A minimal model as a study makes it: assembly, modes, reduction, working point."""
    assembly = build_model(name, **values)
    if operating is None:
        design = DesignPoint(MODELS[name], {}, MODELS[name].defaults() | values)
        operating = design.operating_point()
    space = contact_space(assembly, mean_contact_stiffness(assembly, operating), np.zeros((2, 0)))
    point = working_point(space, operating)
    modes = component_modes(assembly, 1e9)
    model, _ = reduce_cmt(assembly, modes, point, ReductionSettings(1e9, 1e9, 0.0))
    return assembly, modes, model, point, operating


def test_full_order_solves_are_refined_where_the_roots_without_are_not_accurate(monkeypatch):
    """Solves that are off by 1e-6 spoil the roots: it is seen in their residuals, and mended."""
    frictionless = OperatingPoint(0.0, 1.0, 0.5, contact_law("bilateral"))
    assembly, modes, _, point, operating = small_model("hoffmann", frictionless)
    exact = full_order(assembly, modes, point, DesignState(operating), (0.0, 1e6), 1e9)
    tries, found = [], full_order_module.roots_below

    def spoiled(*arguments):
        tries.append(arguments)
        lam, psi = found(*arguments)
        return (lam if len(tries) > 1 else lam * (1 + 1e-6)), psi

    monkeypatch.setattr(full_order_module, "roots_below", spoiled)
    mended = full_order(assembly, modes, point, DesignState(operating), (0.0, 1e6), 1e9)
    assert len(tries) == 2
    np.testing.assert_array_equal(mended.lam, exact.lam)


def damping_of(name, **fields):
    """Damping ratios in ascending frequency without friction: reduced, then full-order."""
    frictionless = OperatingPoint(0.0, 1.0, 0.5, contact_law("bilateral"))
    assembly, modes, model, point, operating = small_model(name, frictionless)
    state = DesignState(operating, **fields)
    system = linearise(model, point, state)
    lam, _ = dense_roots(system.C, system.K, EVERYTHING)
    full = full_order(assembly, modes, point, state, (0.0, 1e6), 1e9)
    return [-x.real / np.abs(x) for x in (lam[np.argsort(np.abs(lam))], full.lam)]


@pytest.mark.parametrize(
    ("fields", "zeta"),
    [
        ({"assembly_damping": {1: 0.02, 2: 0.3}}, (0.02, 0.3)),
        ({"assembly_damping": {2: 0.04}}, (0.0, 0.04)),
        ({"damping_ratio": 0.01, "assembly_damping": {1: 0.05}}, (0.05, 0.01)),
        ({"damping_ratio": 0.01, "assembly_damping": {1: 0.0}}, (0.0, 0.01)),
        ({"damping_ratio": 0.01}, (0.01, 0.01)),
    ],
)
@pytest.mark.parametrize("name", ["hulten", "hoffmann"])
def test_damping_of_single_modes_replaces_the_uniform_one(name, fields, zeta):
    for found in damping_of(name, **fields):
        np.testing.assert_allclose(found, zeta, rtol=1e-9, atol=1e-12)


def test_a_mode_beyond_the_basis_is_named():
    assembly, modes, model, point, operating = small_model("hulten")
    state = DesignState(operating, assembly_damping={3: 0.1})
    with pytest.raises(ParameterError, match="modes 1 to 2") as caught:
        linearise(model, point, state)
    assert caught.value.key == "modes[3].damping_ratio"
    with pytest.raises(ParameterError, match="modes 1 to 2"):
        full_order(assembly, modes, point, state, (0.0, 1e6), 1e9)


def test_design_collects_assembly_damping():
    values = {
        "modes[3,7-9].damping_ratio": 0.02,
        "modes[44].damping_ratio": 0.0,
        "caliper.modes[8].damping_ratio": 0.1,
    }
    model = MODELS["disc_brake"]
    design = DesignPoint(model, {"contact_law": "exponential"}, model.defaults() | values)
    state = design.state()
    assert state.assembly_damping == {3: 0.02, 7: 0.02, 8: 0.02, 9: 0.02, 44: 0.0}
    assert state.mode_damping == {("caliper", 8): 0.1}
    assert [p.component for p in design.mode_parameters()] == ["caliper"]
    assert [p.modes for p in design.assembly_parameters()] == [(3, 7, 8, 9), (44,)]


# -- belt oscillator -----------------------------------------------------------------------------
def belt_root(**values):
    """Root of the motion along the belt (the normal one is far above it)."""
    assembly, modes, model, point, operating = small_model("belt", **values)
    zeta = (MODELS["belt"].defaults() | values)["damping_ratio"]
    state = DesignState(operating, damping_ratio=zeta)
    system = linearise(model, point, state)
    lam, _ = dense_roots(system.C, system.K, EVERYTHING)
    full = full_order(assembly, modes, point, state, (0.0, 1e6), 1e9).lam
    first = lam[np.abs(lam).argmin()]
    assert first == pytest.approx(full[0], rel=1e-9)
    return first


def test_belt_boundary_of_the_defaults():
    exact = math.log(10) / 2
    assert belt_root(sliding_speed=exact - 1e-6).real > 0
    assert belt_root(sliding_speed=exact + 1e-6).real < 0
    assert np.abs(belt_root(sliding_speed=exact)) == pytest.approx(200 * math.pi, rel=1e-12)


def test_belt_boundary_in_general():
    rng = np.random.default_rng(11)
    unstable = 0
    for _ in range(50):
        m, k, F = 10 ** rng.uniform([-1, 4, 1], [1, 6, 4])
        mu, ratio, decay = rng.uniform([0.1, 1.1, 0.1], [0.8, 3.0, 2.0])
        xi, speed = rng.uniform([0.005, 0.1], [0.1, 3.0])
        lam = belt_root(
            **{
                "mass": m,
                "stiffness": k,
                "normal_force": F,
                "friction": mu,
                "friction_law.static_ratio": ratio,
                "friction_law.decay_speed": decay,
                "damping_ratio": xi,
                "sliding_speed": speed,
            }
        )
        omega = math.sqrt(k / m)
        boundary = decay * math.log(mu * (ratio - 1) * F / (2 * xi * math.sqrt(k * m) * decay))
        assert (lam.real > 0) == (speed < boundary)
        fall = mu * (ratio - 1) / decay * math.exp(-speed / decay)
        growth = (F * fall / m - 2 * xi * omega) / 2
        if lam.imag > 0:
            assert lam.real == pytest.approx(growth, rel=1e-8)
            assert np.abs(lam) == pytest.approx(omega, rel=1e-9)
        unstable += lam.real > 0
    assert 10 < unstable < 40
