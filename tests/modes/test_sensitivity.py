"""Derivatives of complex modes: closed forms, central differences of the reanalysis, refusals."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import scipy.linalg as la
from blocks import OPERATING as BLOCKS_OPERATING
from blocks import blocks
from conftest import COARSE, NOMINAL, build_model
from reference import MU_C, W1, W2

from squealstudy.errors import ParameterError
from squealstudy.laws import (
    FRICTION_CURVES,
    ContactLaw,
    FrictionCurve,
    contact_law,
    friction_curve,
)
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.models.catalogue import MODELS
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.point import linearised_point
from squealstudy.modes.sensitivity.mode_family import biorthogonality, known_mode, mode_family
from squealstudy.modes.sensitivity.mode_gradient import DampingGradient, RealModes
from squealstudy.modes.sensitivity.mode_sensitivities import (
    CONDITION_LIMIT,
    QUARTER,
    change_products,
    figure_slopes,
    figures,
    followed_root,
    slope_and_validity,
)
from squealstudy.modes.sensitivity.reduced import (
    ChosenModes,
    ModeChoice,
    chosen_roots,
    point_sensitivities,
    solve_families,
)
from squealstudy.modes.sensitivity.state_derivatives import StateParameter, friction_change
from squealstudy.modes.sensitivity.structural import (
    StructureBuilder,
    check_same_mesh,
    structural_sensitivities,
)
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedModel, prepare
from squealstudy.system.linearise import linearise

LARGE = 1e9  # Hz, above every mode of a minimal model
FRICTION = StateParameter("friction")


def minimal(
    name: str, friction: float, **state
) -> tuple[PreparedModel, DesignState, StructureBuilder]:
    """A minimal model, ready for sensitivities."""
    model = MODELS[name]
    values = model.defaults()
    operating = OperatingPoint(friction, 1.0, 0.5, ContactLaw.from_values("bilateral", {}))
    prepared = prepare(model.build({}, values), operating, ReductionSettings(LARGE, LARGE, 0.0))
    structure = StructureBuilder(partial(model.build, {}), values, LARGE, LARGE)
    return prepared, DesignState(operating, **state), structure


def hulten_root(friction, sign, w1=W1, w2=W2):
    """lambda = i sqrt(s), s = (a + b)/2 + sign sqrt((a - b)^2/4 - mu^2 a b), a = w1^2, b = w2^2."""
    a, b = w1**2, w2**2
    D = np.sqrt(complex((a - b) ** 2 / 4 - friction**2 * a * b))
    return 1j * np.sqrt((a + b) / 2 + sign * D)


def hulten_slope(friction, sign):
    a, b = W1**2, W2**2
    D = np.sqrt(complex((a - b) ** 2 / 4 - friction**2 * a * b))
    return 1j * (-sign * friction * a * b / D) / (2 * np.sqrt((a + b) / 2 + sign * D))


# -- closed forms --------------------------------------------------------------------------------
@pytest.mark.parametrize("friction", [0.1, 0.25, 0.4, 0.6])
def test_hulten_by_friction_in_closed_form(friction):
    prepared, state, _ = minimal("hulten", friction)
    design = solve_families(prepared, state, (1.0, 1000.0), ModeChoice(count=2))
    for mode in point_sensitivities(design, [FRICTION], 0.01, 1000.0):
        sign = min((1, -1), key=lambda s: abs(hulten_root(friction, s) - mode.lam))
        assert mode.lam == pytest.approx(hulten_root(friction, sign), rel=1e-12)
        found = mode.sensitivities[0]
        assert found.derivative == pytest.approx(hulten_slope(friction, sign), rel=1e-9)
        assert found.finite is not None
        exact = hulten_root(1.01 * friction, sign) - hulten_root(friction, sign)
        assert found.finite.change == pytest.approx(exact, rel=1e-9)
        assert mode.family.residual < 1e-13
        assert mode.biorthogonality < 1e-12


def test_hulten_by_frequency_in_closed_form():
    prepared, state, structure = minimal("hulten", 0.4)
    design = solve_families(prepared, state, (1.0, 1000.0), ModeChoice())
    (mode,) = structural_sensitivities(design, structure, ["frequency_1", "frequency_2"], 0.01)
    lam = design.families[0].lam[0]
    sign = min((1, -1), key=lambda s: abs(hulten_root(0.4, s) - lam))
    h = 1e-5
    for found, key in zip(mode, ("w1", "w2"), strict=True):
        w = {"w1": W1, "w2": W2}[key]
        ends = [hulten_root(0.4, sign, **{key: w * (1 + e)}) for e in (h, -h)]
        slope = (ends[0] - ends[1]) / (2 * h * w) * 2 * np.pi
        assert found.derivative == pytest.approx(slope, rel=1e-7)


def test_derivative_diverges_at_flutter_and_is_flagged():
    slopes = {}
    for distance in (1e-2, 1e-4, 1e-6):
        prepared, state, _ = minimal("hulten", MU_C * (1 + distance))
        design = solve_families(prepared, state, (1.0, 1000.0), ModeChoice())
        (mode,) = point_sensitivities(design, [FRICTION], 0.01, 1000.0)
        slopes[distance] = mode.sensitivities[0].derivative.real
        if distance < 1e-2:
            assert mode.near_coalescence(mode.sensitivities[0])
    assert mode.family.condition > CONDITION_LIMIT
    # growth goes as the square root of the distance, its slope as one over that
    assert slopes[1e-6] / slopes[1e-4] == pytest.approx(10.0, rel=1e-2)
    far, state, _ = minimal("hulten", 0.1)
    (mode, _) = point_sensitivities(
        solve_families(far, state, (1.0, 1000.0), ModeChoice(count=2)), [FRICTION], 0.01, 1000.0
    )
    assert not mode.near_coalescence(mode.sensitivities[0])


@pytest.mark.parametrize("friction", [0.28, 0.285, 0.3, 0.31])
def test_validity_range_is_the_distance_to_the_coalescence(friction):
    prepared, state, _ = minimal("hulten", friction)
    design = solve_families(prepared, state, (1.0, 1000.0), ModeChoice(count=1))
    (mode,) = point_sensitivities(design, [FRICTION], 0.01, 1000.0)
    assert mode.sensitivities[0].validity == pytest.approx(abs(friction - MU_C), rel=0.15)


def test_second_order_of_a_change_of_all_matrices():
    rng = np.random.default_rng(7)
    n = 4
    base = [np.eye(n), 0.05 * rng.standard_normal((n, n)), np.diag([1.0, 2.2, 3.7, 5.1])]
    base[2] = base[2] + 0.2 * rng.standard_normal((n, n))
    by = [0.4 * rng.standard_normal((n, n)) for _ in base]
    by[0] = by[0] + by[0].T

    def pencil(change):
        return QuadraticPencil(*(A + change * dA for A, dA in zip(base, by, strict=True)))

    first = mode_family(pencil(0.0), 1.5j, 2 * n)
    assert len(first.lam) == 2 * n

    def root(change):
        return mode_family(pencil(change), complex(first.lam[0]), 1).lam[0]

    mass = np.vdot(first.Y[:, 0], by[0] @ first.X[:, 0])
    products = change_products(first, *(A @ first.X for A in reversed(by)))
    slope, validity = slope_and_validity(first, products, 1.0, complex(mass))
    h = 1e-3
    half = (root(h) - 2 * root(0.0) + root(-h)) / (2 * h**2)
    assert slope == pytest.approx((root(h) - root(-h)) / (2 * h), rel=1e-4)
    assert validity == pytest.approx(QUARTER * abs(slope) / abs(half), rel=1e-3)


def test_condition_of_simple_oscillators():
    """1 undamped, 1/sqrt(1 - zeta^2) damped."""
    for zeta in (0.0, 0.3):
        M, K = np.eye(2), np.diag([1.0, 9.0]) * 1e4
        pencil = QuadraticPencil(M, 2 * zeta * np.sqrt(K), K)
        family = mode_family(pencil, 100.0 * complex(-zeta, np.sqrt(1 - zeta**2)))
        assert family.condition == pytest.approx(1 / np.sqrt(1 - zeta**2), rel=1e-12)


@pytest.mark.parametrize("n", [3, 50])
def test_a_known_mode_has_the_left_vector_of_one_that_is_looked_for(n):
    rng = np.random.default_rng(3)
    C, K = 0.05 * rng.standard_normal((n, n)), np.diag(np.arange(1.0, n + 1) ** 2)
    pencil = QuadraticPencil(np.eye(n), C, K + 0.1 * rng.standard_normal((n, n)))
    looked_for = mode_family(pencil, complex(0, 2.0), 1)
    lam, x = complex(looked_for.lam[0]), looked_for.X[:, 0] * np.exp(1j)
    found = known_mode(pencil, lam, x)
    assert found.residual < 1e-12
    assert found.lam[0] == pytest.approx(lam, rel=1e-12)
    by = rng.standard_normal((n, n))
    slopes = [
        np.vdot(f.Y[:, 0], by @ f.X[:, 0]) / np.vdot(f.Y[:, 0], pencil.slope(lam, f.X[:, 0]))
        for f in (found, looked_for)
    ]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-9)


# -- minimal models against central differences -------------------------------------------------
@pytest.mark.parametrize(
    ("model", "name"),
    [
        *(("hulten", n) for n in ("mass", "frequency_1", "normal_force")),
        *(("hoffmann", n) for n in ("k1", "alpha1", "contact_stiffness", "mass")),
    ],
)
def test_structural_derivatives_of_minimal_models(model, name):
    damped = {"damping_ratio": 0.02, "stiffness_damping": 2e-6}
    damped["assembly_damping"] = {1: 0.05}
    prepared, state, structure = minimal(model, 0.6, **damped)
    state = replace(
        state, operating=replace(state.operating, curve=friction_curve(static_ratio=1.4))
    )
    design = solve_families(prepared, state, (1.0, 1000.0), ModeChoice(count=2))
    found = structural_sensitivities(design, structure, [name], 0.01)
    full = structure.system(structure.assembly(), state, design.point)
    h = 1e-5 * structure.values[name]
    for family, (own,) in zip(design.families, found, strict=True):
        base = mode_family(full.pencil, complex(family.lam[0]))
        ends = []
        for sign in (1, -1):
            assembly = structure.assembly({name: structure.values[name] + sign * h})
            k_c, start = prepared.space.k_c, design.point.gap
            point = structure.working_point(assembly, state, k_c, start)
            moved = structure.system(assembly, state, point)
            ends.append(followed_root(full.pencil, base, moved.pencil).change)
        slope = (ends[0] - ends[1]) / (2 * h)
        assert own.derivative == pytest.approx(slope, rel=1e-5, abs=1e-8 / structure.values[name])


# -- the coarse brake ----------------------------------------------------------------------------
BRAKE_STATE = DesignState(
    replace(NOMINAL, curve=friction_curve(static_ratio=1.2)),
    {("caliper", 8): 1.05, ("inner_pad", 7): 0.97},
    {("caliper", 9): 0.01, ("caliper", 8): 0.02},
    0.002,
    {20: 0.01},
    1e-8,
)
FAMILIES = [
    FRICTION,
    *(StateParameter(n) for n in ("pressure", "sliding_speed", "contact.lambda", "contact.p0")),
    *(StateParameter(f"friction_law.{n}") for n in ("static_ratio", "decay_speed")),
    *(StateParameter(n) for n in ("damping_ratio", "stiffness_damping")),
    *(
        StateParameter(f"{c}.modes[{m}]", c, m, "frequency_scale")
        for c, m in (("caliper", (8,)), ("caliper", (9,)), ("disc", (15, 16)))
    ),
    *(StateParameter(f"caliper.{m}", "caliper", (m,), "damping_ratio") for m in (8, 10)),
    *(StateParameter(f"modes[{m}]", "", (m,), "damping_ratio") for m in (20, 22)),
]


@pytest.fixture(scope="module")
def brake_design(brake, reduced) -> ChosenModes:
    model = reduced[0]
    shapes, sensors = np.eye(model.n, 1), np.zeros((1, 1))
    prepared = PreparedModel(brake.space, model, shapes, sensors, brake.point.gap)
    return solve_families(prepared, BRAKE_STATE, (1000.0, 4000.0), ModeChoice(count=2))


@pytest.fixture(scope="module")
def brake_modes(brake_design):
    return point_sensitivities(brake_design, FAMILIES, 1e-3, 8e3)


def test_left_vectors_of_the_brake(brake_design):
    assert len(brake_design.families) == 2
    for family in brake_design.families:
        assert family.residual < 1e-9
        y, lam = family.Y[:, 0], family.lam[0]
        adjoint = brake_design.system.pencil.adjoint().apply(np.conj(lam), y)
        size = abs(lam) ** 2 * np.linalg.norm(y)
        assert np.linalg.norm(adjoint) < 1e-9 * size
    found = biorthogonality(brake_design.system.pencil, brake_design.families)
    np.testing.assert_allclose(found, np.eye(2), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("number", range(len(FAMILIES)), ids=[p.name for p in FAMILIES])
def test_brake_against_central_differences(brake_design, brake_modes, number):
    parameter, design = FAMILIES[number], brake_design
    value = parameter.value(design.state)
    reference = parameter.reference(value, 8e3)
    h = 1e-4 * (1e-5 if parameter.name == "stiffness_damping" else reference)
    lowest = 0.0 if parameter.name == "stiffness_damping" or value == 0 else -np.inf
    at = [value + h, value - h] if value - h >= lowest else [value + h, value + 2 * h]
    states = [parameter.moved(design.state, v) for v in at]
    moved = [linearised_point(design.prepared, state)[1].pencil for state in states]
    for mode in brake_modes:
        ends = [followed_root(design.system.pencil, mode.family, pencil).change for pencil in moved]
        two_sided = at[1] < value
        slope = (ends[0] - ends[1]) / (2 * h) if two_sided else (4 * ends[0] - ends[1]) / (2 * h)
        round_off = 20 * np.finfo(float).eps * abs(mode.family.lam[0]) / h  # of the two roots
        limit = 2e-5 * abs(slope) + round_off
        assert mode.sensitivities[number].derivative == pytest.approx(slope, abs=limit)


def test_friction_derivative_is_total(brake_design, brake_modes):
    """With the working point held it would be another one."""
    design, mode, h = brake_design, brake_modes[0], 1e-5
    ends = []
    for sign in (1, -1):
        moved = FRICTION.moved(design.state, 0.5 + sign * h)
        held = linearise(design.prepared.model, design.point, moved)
        pencil = QuadraticPencil(design.system.pencil.M, held.C, held.K)
        ends.append(followed_root(design.system.pencil, mode.family, pencil).change)
    held_slope = (ends[0] - ends[1]) / (2 * h)
    total = mode.sensitivities[0].derivative
    assert abs(held_slope - total) > 0.02 * abs(total)


def test_finite_changes_agree_where_the_derivative_is_said_to_hold(brake_modes):
    for mode in brake_modes:
        for found in mode.sensitivities:
            assert found.finite is not None
            assert not mode.near_coalescence(found)
            assert found.finite.match == pytest.approx(1.0, abs=0.05)
            gap = abs(found.finite.change - found.predicted)
            ratio = abs(found.step.size) / found.validity
            assert gap <= max(2 * 0.25 * ratio, 0.02) * abs(found.finite.change)


def test_stiffness_of_a_component_against_the_assembly_built_anew():
    """Component modes and damping of the state move with the structure."""
    plain = blocks()

    def build(values):
        upper, lower = plain.components
        stiffer = replace(upper, K=values["upper.stiffness"] * upper.K)
        return replace(plain, components=(stiffer, lower))

    structure = StructureBuilder(build, {"upper.stiffness": 1.0}, LARGE, LARGE)
    prepared = prepare(plain, BLOCKS_OPERATING, ReductionSettings(LARGE, LARGE, 0.0))
    state = DesignState(
        replace(BLOCKS_OPERATING, curve=friction_curve(static_ratio=1.2)),
        {("upper", 8): 1.05, ("lower", 7): 0.97},
        {("upper", 9): 0.01, ("upper", 8): 0.02},
        0.002,
        {20: 0.01},
        1e-8,
    )
    design = solve_families(prepared, state, (500.0, 4000.0), ModeChoice(count=3))
    for found in structural_sensitivities(design, structure, ["upper.stiffness"], 1e-4):
        (own,) = found
        assert own.finite is not None
        assert own.finite.match == pytest.approx(1.0, abs=1e-3)
        assert own.predicted == pytest.approx(own.finite.change, rel=1e-3)
        assert abs(own.finite.change) > 1e-3


def test_geometry_is_refused(brake):
    thicker = build_model("disc_brake", COARSE, **{"disc.thickness": 0.01200001})
    with pytest.raises(ParameterError, match=r"disc\.thickness.*geometry"):
        check_same_mesh("disc.thickness", brake.assembly, thicker)
    check_same_mesh("nothing", brake.assembly, brake.assembly)


# -- parts ---------------------------------------------------------------------------------------
LAWS = [
    contact_law(),
    contact_law("unilateral"),
    contact_law("power", stiffness=1e14, exponent=1.7),
    contact_law("bilateral"),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.kind)
def test_law_derivatives_against_central_differences(law):
    g = np.array([-9e-6, -3e-6, -1e-7, 2e-6])
    (dp, dkappa), *by_parameter = law.slopes(g)
    for name, own in zip(law.names, by_parameter, strict=True):
        value = law.value(name)
        h = 1e-6 * value
        up, down = (law.with_value(name, value + s * h).evaluate(g) for s in (1, -1))
        for found, a, b in zip(own, up, down, strict=True):
            np.testing.assert_allclose(found, (a - b) / (2 * h), rtol=1e-7, atol=1e-30)
    h = 1e-13
    slope = (law.evaluate(g + h)[1] - law.evaluate(g - h)[1]) / (2 * h)
    np.testing.assert_allclose(dp, -law.evaluate(g)[1], rtol=1e-14)
    np.testing.assert_allclose(dkappa, slope, rtol=1e-5, atol=500.0)


VALUES = {"static_ratio": 1.3, "decay_speed": 0.5, "exponent": 1.7, "viscous_rise": 0.2}
VALUES |= {f"speed_{k}": 0.16 * k for k in range(1, 9)}
VALUES |= {f"ratio_{k}": 1.0 + 0.3 / k for k in range(1, 9)}
VALUES |= {f"map_speed_{k}": 0.16 * k for k in range(1, 7)}
VALUES |= {f"map_pressure_{j}": 2e5 * j for j in range(1, 5)}
VALUES |= {f"map_ratio_{k}_{j}": 1.0 + 0.3 / k - 0.05 * j for k in range(1, 7) for j in range(1, 5)}


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (curve.name, name)
        for curve in FRICTION_CURVES
        if curve.in_package
        for name in ("friction", "sliding_speed", *(p.name for p in curve.parameters))
    ],
)
def test_friction_law_derivatives_against_central_differences(kind, name):
    names = [parameter.name for parameter in FRICTION_CURVES[kind].parameters]
    curve = FrictionCurve.from_values(kind, {n: VALUES[n.partition(".")[2]] for n in names})
    point, p = OperatingPoint(0.4, 1e6, 0.7, contact_law(), curve), np.array([5.3e5])
    h, one = 1e-6 * (2e5 if "pressure" in name else 1.0), np.ones(1)
    up, down = (
        point.with_value(name, point.value(name) + s * h).friction_at(p, one) for s in (1, -1)
    )
    found = friction_change(point, name, p, one)
    noise = 1e-16 / h  # of differences
    assert found.mu == pytest.approx((up.mu - down.mu) / (2 * h), rel=1e-8, abs=noise)
    slope = (up.by_speed - down.by_speed) / (2 * h)
    assert found.by_speed == pytest.approx(slope, rel=1e-8, abs=noise)
    assert found.speed == (1.0 if name == "sliding_speed" else 0.0)


@pytest.mark.parametrize("negative", [0, 1, 3], ids="{} of negative stiffness".format)
@pytest.mark.parametrize("zeta", [np.full(6, 0.03), np.array([0.01, 0.0, 0.2, 0.0, 0.05, 0.1])])
def test_modal_damping_derivative_by_stiffness_and_mass(zeta, negative):
    """Modes of negative stiffness (contact that has given way) have no damping."""
    rng = np.random.default_rng(1)
    n, lam = 6, complex(-0.1, 1.7)

    def positive(scale):
        A = rng.standard_normal((n, n))
        return scale * (A @ A.T + n * np.eye(n))

    M, K, dM, dK = positive(1.0), positive(4.0), positive(0.3), positive(0.5)
    if negative:
        K -= la.eigvalsh(K, M)[negative - 1 : negative + 1].mean() * M
    x, y = (rng.standard_normal(n) + 1j * rng.standard_normal(n) for _ in range(2))

    def product(t):
        w2, phi = la.eigh(K + t * dK, M + t * dM)
        modal = (M + t * dM) @ phi
        return lam * (y.conj() @ modal) * (2 * zeta * np.sqrt(np.maximum(w2, 0))) @ (modal.T @ x)

    w2, phi = la.eigh(K, M)
    assert (w2 < 0).sum() == negative
    real = RealModes(w2, phi, M @ phi, zeta, N=np.eye(n))
    gradient = DampingGradient(real, lam, phi.T @ M @ y.conj(), phi.T @ M @ x)
    found = gradient.by_stiffness(phi.T @ dK @ phi) + gradient.by_mass(phi.T @ dM @ phi)
    h = 1e-5
    assert found == pytest.approx((product(h) - product(-h)) / (2 * h), rel=1e-8)
    rows, weights = rng.standard_normal((3, n)) @ phi, rng.standard_normal(3)
    by_rows = gradient.by_rows(rows) @ weights
    assert by_rows == pytest.approx(gradient.by_stiffness(rows.T * weights @ rows), rel=1e-10)


def test_modal_damping_of_a_rigid_mode_has_no_derivative():
    """A rigid mode feels no change but for round-off, which must not be divided by nothing."""
    omega, pair = np.array([0.0, 3.0, 5.0]), np.ones(3, dtype=complex)
    gradient = DampingGradient(
        RealModes(omega**2, np.eye(3), np.eye(3), np.full(3, 0.01), N=np.eye(3)), 1j, pair, pair
    )
    dK = np.diag([0.0, 1.0, 1.0])
    told = gradient.by_stiffness(dK)
    assert told == pytest.approx(1j * 0.01 * (1 / 3 + 1 / 5))
    dK[0, 0] = 1e-12
    assert gradient.by_stiffness(dK) == told


def test_figures_by_the_chain_rule():
    lam, slope, h = np.array([-40 + 900j, 30 + 2000j]), np.array([3 - 2j, -1 + 5j]), 1e-6
    ends = [figures(lam + s * h * slope) for s in (1, -1)]
    for found, up, down in zip(figure_slopes(lam, slope), *ends, strict=True):
        np.testing.assert_allclose(found, (up - down) / (2 * h), rtol=1e-6)


def test_choice_of_modes():
    lam = np.array([-5 + 100j, 3 + 200j, 9 + 300j, 20 + 0j, -1 + 400j])
    assert chosen_roots(lam, ModeChoice()) == [9 + 300j, 3 + 200j]
    assert chosen_roots(lam, ModeChoice(count=3)) == [9 + 300j, 3 + 200j, -1 + 400j]
    near = ModeChoice(frequencies_hz=(100 / 6.28, 101 / 6.28, 390 / 6.28))
    assert chosen_roots(lam, near) == [-1 + 400j, -5 + 100j]
    assert chosen_roots(lam, ModeChoice(stability_tolerance=0.02)) == [9 + 300j]


def test_modes_of_one_name_must_have_one_value():
    parameter = StateParameter("p", "caliper", (8, 9), "frequency_scale")
    with pytest.raises(ParameterError, match="different values"):
        parameter.value(BRAKE_STATE)


def test_minimal_contact_has_no_law_parameters():
    assembly = build_model("hulten")
    assert assembly.contact.law.kind == "bilateral"
    with pytest.raises(ParameterError, match="bilateral contact law"):
        StateParameter("contact.lambda").value(DesignState(minimal("hulten", 0.1)[1].operating))
