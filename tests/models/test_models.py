"""Models: checks at construction, the minimal models' matrices, the generated brake's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
import scipy.sparse as sp
from conftest import benchmark, build_model

import squealstudy as sq
from squealstudy.errors import ModelError, ParameterError
from squealstudy.laws import contact_law
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.catalogue import MODELS
from squealstudy.models.component_slices import expand_rows
from squealstudy.models.fem.sampling import Surface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.reduction.cmt import ReductionSettings, component_modes, reduce_cmt
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.reduction.working_point import working_point
from squealstudy.system.linearise import linearise

I2 = sp.csr_matrix(np.eye(2))


def csr(*rows):
    return sp.csr_matrix(np.array(rows, dtype=float))


def contact(n_dof=2, **changes):
    fields = {
        "N": sp.csr_matrix((1, n_dof)),
        "T": sp.csr_matrix((1, n_dof)),
        "T_perp": sp.csr_matrix((1, n_dof)),
        "area": np.ones(1),
        "gap0": np.zeros(1),
        "radius": np.zeros(1),
        "law": contact_law(),
        "frictional": np.ones(1),
    }
    return ContactInterface(**(fields | changes))


# -- checks at construction ----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((I2, csr([1, 0, 0], [0, 1, 0])), "shape"),
        ((csr([1, 0, 0], [0, 1, 0]), I2), "shape"),
        ((csr([1, 0.1], [0, 1]), I2), "not symmetric"),
        ((I2, csr([1, 0.1], [0, 1])), "not symmetric"),
        ((csr([1, 0], [0, np.nan]), I2), "not finite"),
        ((I2, csr([np.inf, 0], [0, 1])), "not finite"),
        ((csr([-1, 0], [0, 1]), I2), "positive definite"),
        ((csr([0, 0], [0, 1]), I2), "positive definite"),
        ((I2, csr([-1, 0], [0, 1])), "semi-definite"),
        ((I2, I2, np.zeros((1, 3))), "nodes"),
    ],
)
def test_component_is_checked(arguments, message):
    with pytest.raises(ModelError, match=message):
        Component("body", *arguments)


@pytest.mark.parametrize("name", ["", "a body", "1st"])
def test_component_name_is_an_identifier(name):
    with pytest.raises(ModelError, match="identifier"):
        Component(name, I2, I2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"area": np.zeros(1)}, "positive"),
        ({"area": np.ones(2)}, "area"),
        ({"gap0": np.array([np.nan])}, "gap0"),
        ({"radius": np.zeros(0)}, "radius"),
        ({"frictional": np.array([np.inf])}, "frictional"),
        ({"T": sp.csr_matrix((2, 2))}, "'T'"),
        ({"T_perp": sp.csr_matrix((1, 3))}, "'T_perp'"),
        ({"N": csr([np.nan, 1])}, "'N'"),
    ],
)
def test_contact_is_checked(changes, message):
    with pytest.raises(ModelError, match=message):
        contact(**changes)


@pytest.mark.parametrize("stiffness", [[1.0], [1.0, -1.0], [1.0, np.nan]])
def test_springs_are_checked(stiffness):
    with pytest.raises(ModelError, match="stiffness"):
        SpringInterface("layer", I2, np.array(stiffness))


def test_assembly_is_checked():
    body = Component("body", I2, I2)
    good = Assembly((body,), contact(), (), np.zeros(2), np.zeros(2))
    for changes, message in [
        ({"components": (body, replace(body))}, "unique"),
        ({"components": ()}, "unique"),
        ({"contact": contact(3)}, "columns"),
        ({"springs": (SpringInterface("s", csr([1, 0, 0]), np.ones(1)),)}, "columns"),
        ({"load": np.zeros(3)}, "load"),
        ({"constant_load": np.array([0.0, np.inf])}, "constant_load"),
    ]:
        with pytest.raises(ModelError, match=message):
            replace(good, **changes)


def test_surface_is_checked():
    shape, up = csr([1.0]), np.array([[0.0, 0.0, 1.0]])
    points, area = np.zeros((1, 3)), np.ones(1)
    for arguments in [
        (points, np.ones(2), up, shape),
        (points, -area, up, shape),
        (points, area, up[0], shape),
        (points, area, up, csr([0.5])),
        (points[:0], area[:0], up[:0], sp.csr_matrix((0, 1))),
    ]:
        with pytest.raises(ModelError, match="surface"):
            Surface(*arguments)


def test_observation_rows_need_a_component():
    with pytest.raises(ModelError):
        expand_rows([], {}, 3)


def test_numbering_follows_the_components():
    bodies = (Component("a", I2, 2 * I2), Component("b", csr([3.0]), csr([4.0])))
    assembly = Assembly(bodies, contact(3), (), np.zeros(3), np.zeros(3))
    assert assembly.slices == {"a": slice(0, 2), "b": slice(2, 3)}
    np.testing.assert_array_equal(assembly.M.diagonal(), [1, 1, 3])
    np.testing.assert_array_equal(assembly.K_el.diagonal(), [2, 2, 4])
    rows = expand_rows([("b", csr([5.0])), ("a", csr([1.0, 2.0]))], assembly.slices, 3)
    np.testing.assert_array_equal(rows.toarray(), [[1.0, 2.0, 5.0]])


def test_static_springs_leave_out_the_others():
    springs = tuple(
        SpringInterface(name, csr([1.0, -1.0]), np.array([k]), in_static)
        for name, k, in_static in (("layer", 2.0, True), ("piston", 3.0, False))
    )
    assembly = Assembly((Component("body", I2, I2),), contact(), springs, np.zeros(2), np.zeros(2))
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    np.testing.assert_array_equal(assembly.K_springs().toarray(), 5 * pair)
    np.testing.assert_array_equal(assembly.K_springs(static=True).toarray(), 2 * pair)


# -- catalogue -----------------------------------------------------------------------------------
@pytest.mark.parametrize("name", list(MODELS))
def test_definition_tells_the_truth(name, request):
    definition = MODELS[name]
    assert definition.name == name
    names = [p.name for p in definition.parameters]
    assert len(set(names)) == len(names)
    for p in definition.parameters:
        assert p.check(p.default) == p.default
        assert p.description
    assembly = (
        request.getfixturevalue("brake").assembly if name == "disc_brake" else build_model(name)
    )
    assert assembly.component_names == definition.components


@pytest.mark.parametrize(
    ("name", "value"),
    [("friction", -0.1), ("friction", np.nan), ("mass", 0.0), ("damping_ratio", 1.5)],
)
def test_parameter_bounds(name, value):
    with pytest.raises(ParameterError, match=name):
        MODELS["hulten"].parameter(name).check(value)


# -- minimal models ------------------------------------------------------------------------------
def contact_matrix(assembly, mu):
    """K_el + springs + N^T k_n N - T^T (mu k_n) N with the law's own constant tangent."""
    c = assembly.contact
    k_n = np.diag(c.area * c.law.evaluate(np.zeros(c.n_points))[1])
    N, T = c.N.toarray(), c.T.toarray()
    K = (assembly.K_el + assembly.K_springs()).toarray()
    return K + N.T @ k_n @ N - T.T @ (mu * k_n) @ N


def test_hulten_matrix():
    mu, m, w1, w2 = 0.3, 2.5, 2 * np.pi * 130, 2 * np.pi * 60
    assembly = build_model("hulten", mass=m, frequency_1=130.0, frequency_2=60.0)
    expected = m * np.array([[w1**2, -mu * w2**2], [mu * w1**2, w2**2]])
    np.testing.assert_allclose(contact_matrix(assembly, mu), expected, rtol=1e-14)
    np.testing.assert_array_equal(assembly.M.toarray(), m * np.eye(2))
    assert assembly.K_el.nnz == 0


def test_hoffmann_matrix():
    mu, k1, k2, k3, a1, a2 = 0.4, 2e5, 5e5, 3e5, 100.0, 20.0
    assembly = build_model("hoffmann", k1=k1, k2=k2, contact_stiffness=k3, alpha1=a1, alpha2=a2)
    k, a = np.array([k1, k2]), np.deg2rad([a1, a2])
    k11, k22 = k @ np.cos(a) ** 2, k @ np.sin(a) ** 2 + k3
    k12 = k @ (np.sin(a) * np.cos(a))
    expected = [[k11, k12 - mu * k3], [k12, k22]]
    np.testing.assert_allclose(contact_matrix(assembly, mu), expected, rtol=1e-12)


def test_hoffmann_defaults_are_round_numbers():
    np.testing.assert_allclose(
        contact_matrix(build_model("hoffmann"), 0.0), [[2e6, 1e6], [1e6, 2e6]], rtol=1e-12
    )


def complex_modes(assembly, friction, damping_ratio=0.0):
    """Roots of a minimal model by the very path of the brake: working point, reduction, roots."""
    operating = OperatingPoint(friction, 1.0, 0.5, assembly.contact.law)
    stiffness = mean_contact_stiffness(assembly, operating)
    point = working_point(contact_space(assembly, stiffness, np.zeros((2, 0))), operating)
    modes = component_modes(assembly, 1e9)
    model, _ = reduce_cmt(assembly, modes, point, ReductionSettings(1e9, 1e9, 0.0))
    system = linearise(model, point, DesignState(operating, damping_ratio=damping_ratio))
    return dense_roots(system.C, system.K, (0.0, np.inf))[0]


@pytest.mark.parametrize(("f1", "f2", "mass"), [(100.0, 75.0, 1.0), (40.0, 90.0, 3.7)])
def test_hulten_flutter(f1, f2, mass):
    assembly = build_model("hulten", frequency_1=f1, frequency_2=f2, mass=mass)
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    exact, merged = reference.hulten_flutter(w1, w2)
    if (f1, f2) == (100.0, 75.0):
        assert exact == pytest.approx(0.29167, abs=5e-6)

    def flutters(mu):
        lam = complex_modes(assembly, mu)
        return (lam.real > 1e-6 * np.abs(lam)).any()

    low, high = 0.0, 0.99  # both contacts press below a friction of 1
    assert not flutters(low)
    assert flutters(high)
    while high - low > 1e-13:
        middle = (low + high) / 2
        low, high = (low, middle) if flutters(middle) else (middle, high)
    # |growth| = 1e-6 |lambda| lies about 1e-11 beyond the point: it goes with the square root
    assert high == pytest.approx(exact, rel=1e-10)
    np.testing.assert_allclose(np.abs(complex_modes(assembly, high)), merged, rtol=1e-10)


def test_hulten_beyond_flutter():
    mu, w1, w2 = 0.6, 2 * np.pi * 100.0, 2 * np.pi * 75.0
    lam = complex_modes(build_model("hulten"), mu)
    disc = (w1**2 - w2**2) ** 2 - 4 * mu**2 * w1**2 * w2**2
    square = (-(w1**2 + w2**2) + 1j * np.sqrt(-disc)) / 2
    growth = abs(np.sqrt(square).real)
    np.testing.assert_allclose(np.sort(lam.real), [-growth, growth], rtol=1e-10)
    np.testing.assert_allclose(lam.imag, abs(np.sqrt(square).imag), rtol=1e-10)


def test_hulten_damping_is_that_of_the_modes():
    lam = complex_modes(build_model("hulten"), 0.0, damping_ratio=0.03)
    np.testing.assert_allclose(-lam.real / np.abs(lam), 0.03, rtol=1e-10)
    np.testing.assert_allclose(np.abs(lam) / (2 * np.pi), [75.0, 100.0], rtol=1e-12)


@pytest.mark.parametrize(("mu", "unstable"), [(0.7499, False), (0.7501, True)])
def test_hoffmann_default_threshold(mu, unstable):
    lam = complex_modes(build_model("hoffmann"), mu)
    assert (lam.real > 1e-6 * np.abs(lam)).any() == unstable


def test_hoffmann_criterion_on_random_cases():
    rng = np.random.default_rng(20240)
    fluttered = diverged = 0
    for _ in range(100):
        k1, k2, k3 = 10 ** rng.uniform(5, 6, 3)
        a1, a2 = rng.uniform(-180, 180, 2)
        mass, mu = 10 ** rng.uniform(-1, 1), rng.uniform(0, 3)
        k, a = np.array([k1, k2]), np.deg2rad([a1, a2])
        k11, k22 = k @ np.cos(a) ** 2, k @ np.sin(a) ** 2 + k3
        k12 = k @ (np.sin(a) * np.cos(a))
        away = np.linalg.solve([[k11, k12 - mu * k3], [k12, k22]], [0.0, -1.0])[1]
        if away >= 0:  # contact that pulls has no friction
            continue
        lam = complex_modes(
            build_model(
                "hoffmann", k1=k1, k2=k2, contact_stiffness=k3, alpha1=a1, alpha2=a2, mass=mass
            ),
            mu,
        )
        disc = (k11 - k22) ** 2 + 4 * k12 * (k12 - mu * k3)
        assert abs(disc) > 1e-9 * (k11 + k22) ** 2  # no case on the edge
        oscillating = lam[lam.imag > 0]
        growing = (oscillating.real > 1e-7 * np.abs(oscillating)).any()
        assert growing == (disc < 0)
        squares = (-(k11 + k22) + np.array([-1, 1]) * np.sqrt(complex(disc))) / (2 * mass)
        for value in np.append(squares, squares.conj()):
            assert np.abs(lam**2 - value).min() < 1e-9 * (k11 + k22) / mass
        fluttered += disc < 0
        diverged += (lam.real > 1e-7 * np.abs(lam)).any() and disc > 0
    assert fluttered >= 10
    assert not diverged  # det K > 0 wherever the contact presses: q2 = -N k11 / det K


# -- generated brake -----------------------------------------------------------------------------
@pytest.fixture(scope="module")
def medium():
    return build_model("disc_brake")


@pytest.mark.full_size  # the medium mesh
def test_medium_brake_size(medium):
    dof = {c.name: c.n_dof for c in medium.components}
    assert dof == {"disc": 14148, "inner_pad": 2292, "outer_pad": 2292, "caliper": 10143}
    assert medium.contact.n_points == 648
    # two sectors of 60 degrees between 90 and 140 mm
    assert medium.contact.area.sum() == pytest.approx(np.pi * (0.14**2 - 0.09**2) / 3, rel=1e-6)


@pytest.mark.full_size
def test_medium_component_frequencies(medium):
    modes = component_modes(medium, 4500.0)
    frequencies = benchmark("component_reference").frequencies
    for name, layers in (("disc", 2), ("outer_pad", 1), ("caliper", 1)):
        exact = frequencies(name, MODELS["disc_brake"].defaults(), 4000.0, 3, layers)
        hz = modes[name].omega[6 : 6 + len(exact)] / (2 * np.pi)
        np.testing.assert_allclose(hz, exact, rtol=1e-2, err_msg=name)


def test_brake_contact_observes_the_right_motion(brake):
    c, slices = brake.assembly.contact, brake.assembly.slices
    half = c.n_points // 2  # inner pad first
    lift = np.zeros(brake.assembly.n_dof)
    lift[slices["disc"]][2::3] = 1.0  # disc along +z: away from the inner pad, into the outer one
    np.testing.assert_allclose(c.N @ lift, np.repeat([1.0, -1.0], half), atol=1e-10)
    turn = np.zeros(brake.assembly.n_dof)
    x = next(k for k in brake.assembly.components if k.name == "disc").coordinates
    turn[slices["disc"]] = np.column_stack([-x[:, 1], x[:, 0], 0 * x[:, 0]]).ravel()
    np.testing.assert_allclose(c.T @ turn, c.radius, rtol=1e-10)
    np.testing.assert_allclose(c.T_perp @ turn, 0.0, atol=1e-12)
    np.testing.assert_allclose(c.N @ turn, 0.0, atol=1e-12)
    rigid = np.tile([1.0, 2.0, 3.0], brake.assembly.n_dof // 3)
    for rows in (c.N, c.T, c.T_perp):
        np.testing.assert_allclose(rows @ rigid, 0.0, atol=1e-10)


def test_brake_load_is_a_pair(brake):
    f = brake.assembly.load.reshape(-1, 3)
    pad = brake.assembly.load[brake.assembly.slices["inner_pad"]].reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(pad, [0.0, 0.0, 25e-4], atol=1e-15)
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-15)


@pytest.mark.parametrize(("points", "thickness"), [(3, 0.0111), (4, 0.0123)])
@pytest.mark.usefixtures("meshed_as_brake")
def test_contact_points_are_an_option_and_disc_thickness_is_free(brake, points, thickness):
    options = {"mesh": "coarse", "contact_points": points}
    contact = build_model("disc_brake", options, **{"disc.thickness": thickness}).contact
    two = brake.assembly.contact  # a side
    assert contact.n_points == two.n_points * points**2 // 4
    assert contact.area.sum() == pytest.approx(two.area.sum(), rel=1e-5)


@pytest.mark.parametrize("low", [10.0, 33.3, 70.7, 75.0, 111.1, 217.3, 1234.5])
def test_modes_on_the_ends_of_the_band_are_in_it(low):
    """Frequencies that are known: round-off does not say which of them are seen."""
    model = sq.model("hulten", friction=0.0, frequency_1=low, frequency_2=1.7 * low)
    assert len(model.modes(band=(low, 1.7 * low))) == 2
    assert len(model.modes(band=(0.5 * low, low))) == 1
    assert len(model.modes(band=(1.0001 * low, 1.6999 * low))) == 0


@pytest.mark.parametrize(
    ("band", "told"),
    [
        ((500.0, 100.0), "0 <= low < high"),
        ((500.0, "a"), "a number"),
        ((500.0, np.inf), "a finite number"),
        (500.0, r"\[low, high\] in Hz, got 500"),
        (np.array(5.0), r"\[low, high\] in Hz"),
        ("x", "two frequencies"),
    ],
)
def test_band_that_is_none_is_an_error_of_the_argument(band, told: str) -> None:
    """Not of a study file that nobody wrote."""
    with pytest.raises(ParameterError, match=f"^parameter 'band': .*{told}"):
        sq.model("hoffmann").modes(band=band)
