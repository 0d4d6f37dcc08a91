"""The working point against the full-order equations, closed forms and a plain Newton."""

from __future__ import annotations

import re
from dataclasses import replace

import dense_gaps
import numpy as np
import pytest
import reference
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from conftest import NOMINAL, build_model

import squealstudy as sq
from squealstudy.errors import ConvergenceError
from squealstudy.laws import contact_law
from squealstudy.linalg.factor import factorise
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import contact_space, independent_columns
from squealstudy.reduction.gap_equations import GapJacobian
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.reduction.working_point import (
    known_working_point,
    open_share,
    working_point,
    working_point_result,
)

NO_SHAPES = np.zeros((2, 0))


@pytest.fixture(scope="module")
def recover(brake):
    """Displacements q from gaps: one solve with K0, as in the docstring of `working_point`."""
    c, k_c = brake.assembly.contact, brake.space.k_c
    K = reference.static_stiffness(brake.assembly)
    factor = factorise((K + k_c * (c.N.T @ sp.diags(c.area) @ c.N)).tocsc())

    def solve(point, operating):
        f = operating.brake_pressure * brake.assembly.load + brake.assembly.constant_load
        p = point.contact_pressure
        normal = c.N.T @ (c.area * (p + k_c * (point.gap - c.gap0)))
        return factor.solve(f + normal - operating.friction * (c.T.T @ (c.area * p)))

    return solve


def full_order_residual(brake, q, operating):
    """Imbalance of all degrees of freedom, with the pressures of q itself, relative to the forces
    that balance (load, contact, friction). Double precision itself leaves up to 3e-11 of them:
    2.2e-16 |K| |q|.
    """
    c = brake.assembly.contact
    p, _ = operating.law.evaluate(c.gap0 + c.N @ q)
    imbalance = reference.static_imbalance(brake.assembly, q, p, operating)
    friction = operating.friction * (c.T.T @ (c.area * p))
    forces = (operating.brake_pressure * brake.assembly.load, c.N.T @ (c.area * p), friction)
    return np.linalg.norm(imbalance) / sum(np.linalg.norm(f) for f in forces)


def round_off_of_gaps(brake, off, point, operating):
    """Contact forces of what solving for q leaves of the gaps, `off` [m], as a share of the load.

    A stiff law turns 1e-15 m of round-off into forces far above that of K q.
    """
    c = brake.assembly.contact
    forces = c.N.T @ (c.area * point.tangent * off)
    return np.linalg.norm(forces) / np.linalg.norm(operating.brake_pressure * brake.assembly.load)


@pytest.mark.parametrize("lam", [5e4, 5e5, 5e6])
@pytest.mark.parametrize("friction", [0.0, 0.35, 0.7])
def test_full_order_equations_hold(brake, recover, friction, lam):
    for pressure in (1e5, 12e5, 40e5):
        operating = OperatingPoint(friction, pressure, 0.5, contact_law(lam=lam))
        point = working_point(brake.space, operating)
        q = recover(point, operating)
        gap = brake.assembly.contact.N @ q
        np.testing.assert_allclose(gap, point.gap, atol=1e-10 * np.abs(point.gap).max())
        off = round_off_of_gaps(brake, gap - point.gap, point, operating)
        assert full_order_residual(brake, q, operating) <= 1e-10 + off
        assert point.residual <= 1e-11
        assert point.iterations <= 25


@pytest.mark.parametrize("kind", ["unilateral", "power"])
@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_lift_off(brake, recover, kind, friction):
    law = contact_law(kind, stiffness=5e11 if kind == "unilateral" else 2e14)
    operating = OperatingPoint(friction, 12e5, 0.5, law)
    point = working_point(brake.space, operating)
    assert full_order_residual(brake, recover(point, operating), operating) <= 1e-10
    is_open = point.gap >= 0
    assert is_open.any()
    np.testing.assert_array_equal(point.contact_pressure == 0, is_open)
    np.testing.assert_array_equal(point.tangent == 0, is_open)
    area = brake.assembly.contact.area
    assert point.open_share >= area[is_open].sum() / area.sum()
    assert 0 < point.open_share < 0.9


def test_bilateral_law_is_one_linear_solve(brake):
    c = brake.assembly.contact
    operating = OperatingPoint(0.5, 12e5, 0.5, contact_law("bilateral", stiffness=5e11))
    point = working_point(brake.space, operating)
    k_n = sp.diags(5e11 * c.area)
    rubs = sp.diags(5e11 * c.area * (point.gap < 0))  # what pulls has no friction
    K = reference.static_stiffness(brake.assembly) + c.N.T @ k_n @ c.N - 0.5 * c.T.T @ rubs @ c.N
    gap = c.N @ spla.splu(K.tocsc()).solve(12e5 * brake.assembly.load)
    np.testing.assert_allclose(point.gap, gap, atol=1e-8 * np.abs(gap).max())
    assert (gap > 0).any()  # bilateral: it pulls there
    assert point.contact_pressure.min() < 0


def test_agrees_with_a_plain_full_order_newton(brake, recover):
    operating = OperatingPoint(0.35, 3e5, 1.0, contact_law(lam=2e5))
    # started elsewhere: at the equilibrium of another pressure and friction
    other = replace(operating, brake_pressure=2 * operating.brake_pressure, friction=0.0)
    q0 = recover(working_point(brake.space, other), other)
    q, p = reference.newton_equilibrium(brake.assembly, operating, q0)
    point = working_point(brake.space, operating)
    np.testing.assert_allclose(point.contact_pressure, p, rtol=1e-7)
    gap = brake.assembly.contact.N @ q
    np.testing.assert_allclose(point.gap, gap, atol=1e-9 * np.abs(gap).max())


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_forces_balance(brake, recover, friction):
    assembly = brake.assembly
    operating = replace(NOMINAL, friction=friction)
    point = working_point(brake.space, operating)
    q = recover(point, operating)
    springs = assembly.K_springs(static=True) @ q

    def axial(force, *names):
        return sum(force[assembly.slices[name]][2::3].sum() for name in names)

    force = assembly.contact.area * point.contact_pressure
    inner, outer = np.split(force, 2)
    push = operating.brake_pressure * 25e-4
    # the fluid pushes the inner pad along +z and the caliper, which holds the outer pad, along -z;
    # friction acts in the plane of the disc
    assert inner.sum() == pytest.approx(push - axial(springs, "inner_pad"), rel=1e-9)
    assert outer.sum() == pytest.approx(push + axial(springs, "caliper", "outer_pad"), rel=1e-9)
    # soft axial springs of guides and abutments take little of it
    assert inner.sum() == pytest.approx(push, rel=0.05)
    assert outer.sum() == pytest.approx(push, rel=0.05)
    # all that goes to the ground, in x, y, z
    total = springs.reshape(-1, 3).sum(axis=0)
    drag = -friction * (assembly.contact.T.T @ force).reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(total, drag, atol=1e-7 * push)  # action and reaction: zero
    np.testing.assert_allclose(drag, 0.0, atol=1e-9 * push)


def test_reference_stiffness_changes_nothing(brake):
    c = brake.assembly.contact
    other = contact_space(brake.assembly, 20 * brake.space.k_c, np.zeros((brake.assembly.n_dof, 0)))
    point = working_point(other, NOMINAL)
    np.testing.assert_allclose(point.gap, brake.point.gap, atol=1e-9 * np.abs(point.gap).max())
    assert c.area @ point.contact_pressure == pytest.approx(
        c.area @ brake.point.contact_pressure, rel=1e-9
    )


def test_start_changes_nothing(brake):
    far = working_point(brake.space, replace(NOMINAL, brake_pressure=2e5, friction=0.1))
    point = working_point(brake.space, NOMINAL, far.gap)
    np.testing.assert_allclose(point.gap, brake.point.gap, rtol=1e-9, atol=1e-15)
    again = working_point(brake.space, NOMINAL, brake.point.gap)
    assert again.iterations <= 2


@pytest.mark.parametrize(
    "law",
    [
        contact_law(lam=5e6),
        contact_law("unilateral", stiffness=5e12),
        contact_law("power", stiffness=2e15),
    ],
)
def test_stiff_contact_from_gaps_of_a_soft_one(brake, law):
    # those gaps mean pressures of 1e16 Pa here; opening to 0.1 mm takes 300 gap scales
    operating = OperatingPoint(1.5, 40e5, 0.5, law)
    cold = working_point(brake.space, operating)
    warm = working_point(brake.space, operating, brake.point.gap)
    np.testing.assert_allclose(warm.gap, cold.gap, atol=1e-9 * np.abs(cold.gap).max())
    assert cold.iterations <= 25
    assert warm.iterations <= 25


@pytest.mark.parametrize("law", [contact_law(), contact_law("unilateral", stiffness=5e11)])
def test_equals_a_dense_newton(brake, law):
    """With a factor of low rank that serves for several steps, from scaled gaps."""
    for friction, pressure in ((0.0, 2e5), (0.7, 30e5)):
        operating = OperatingPoint(friction, pressure, 0.5, law)
        found = working_point(brake.space, operating, brake.point.gap)
        g = dense_gaps.newton(brake.space, operating, found.gap + 1e-7)
        np.testing.assert_allclose(found.gap, g, atol=1e-10 * np.abs(g).max())
        _, kappa = law.evaluate(g)
        assert np.abs(found.tangent - kappa).max() <= 1e-8 * kappa.max() + found.tangent_error


def test_newton_s_matrix_by_low_rank_is_the_dense_one(brake):
    space, rng = brake.space, np.random.default_rng(0)
    F = rng.standard_normal((3, len(space.area)))
    for point in (NOMINAL, replace(NOMINAL, friction=0.0, brake_pressure=40e5)):
        p, kappa = point.law.evaluate(brake.point.gap + 1e-7 * rng.standard_normal(len(F[0])))
        J = dense_gaps.jacobian(space, point, p, kappa)
        found = GapJacobian(space, point, p, kappa)
        np.testing.assert_allclose(found.solve(F) @ J.T, F, atol=1e-9)
        np.testing.assert_allclose(found.solve(F[0]), found.solve(F)[0], atol=1e-11)


def test_columns_that_span_all_rows():
    """Two sets of rows that share no column, of ranks 3 and 2, and columns of zeros."""
    rng = np.random.default_rng(0)
    parts = [rng.standard_normal((9, r)) @ rng.standard_normal((r, 7)) for r in (3, 2)]
    N = np.zeros((18, 30))
    N[::2, 3:10], N[1::2, 12:19] = parts
    columns, independent, Z = independent_columns(sp.csr_matrix(N))
    np.testing.assert_array_equal(columns, [*range(3, 10), *range(12, 19)])
    assert len(independent) == len(Z) == 5
    np.testing.assert_allclose(N[:, columns[independent]] @ Z, N[:, columns], atol=1e-13)
    assert np.abs(Z).max() < 10


def test_known_gaps_are_verified(brake):
    known = known_working_point(brake.space, NOMINAL, brake.point.gap)
    np.testing.assert_array_equal(known.gap, brake.point.gap)
    np.testing.assert_array_equal(known.tangent, brake.point.tangent)
    assert known.residual < 1e-11
    # gaps of a slightly different pressure, or lost ones, are no working point of this one
    others = [replace(NOMINAL, brake_pressure=p) for p in (12.001e5, 12e5 * (1 + 1e-7))]
    for other in (*others, replace(NOMINAL, friction=0.5001)):
        assert known_working_point(brake.space, other, brake.point.gap) is None
    assert known_working_point(brake.space, NOMINAL, np.nan * brake.point.gap) is None


def test_open_share_is_that_of_the_area_without_pressure():
    """Below 1 % of the mean over the area, which is 7.5 kPa."""
    area, p = np.array([1e-4, 3e-4, 4e-4]), np.array([3.998e6, 7.4e3, 5e5])
    assert open_share(area, p) == pytest.approx(3 / 8)
    assert open_share(area, np.maximum(p, 7.6e3)) == 0.0
    assert open_share(area, np.full(3, 9.9e3), loaded=1e6) == 1.0
    assert open_share(area, np.full(3, 1.1e4), loaded=1e6) == 0.0


def test_a_contact_that_the_load_does_not_close_is_open(brake):
    """Springs hold it apart: the pressures are even, and nothing beside those of the load."""
    apart = replace(brake.space, gap0=brake.space.gap0 + 0.05)
    point = working_point(apart, NOMINAL)
    area, p = apart.area, point.contact_pressure
    assert (area @ p) < 1e-3 * (brake.space.area @ brake.point.contact_pressure)
    assert point.open_share == 1.0
    assert known_working_point(apart, NOMINAL, point.gap).open_share == 1.0


@pytest.mark.parametrize("law", [contact_law(), contact_law("power", stiffness=1e14, exponent=2)])
def test_the_imbalance_tells_what_the_contact_stiffness_may_be_off_by(law):
    """By gaps that err by ten times their imbalance: exactly so, small, of the exponential law."""
    area, g = np.array([1e-4, 3e-4, 2e-4]), np.array([-2e-6, -1e-6, -4e-6])
    F = 1e-12 * np.array([1.0, -3.0, 2.0])
    p, kappa = law.evaluate(g)
    found = working_point_result(area, g, p, kappa, 3, 1e-9, F).tangent_error
    moved = (area @ law.evaluate(g - 10 * np.abs(F))[1]) / (area @ kappa) - 1
    if law.kind == "exponential":
        assert found == pytest.approx(moved, rel=1e-4)
    assert moved <= 1.001 * found <= 3 * moved
    unloaded = working_point_result(area, g, 0 * p, 0 * kappa, 3, 1e-9, F)
    assert unloaded.tangent_error == 0.0
    gives_way = working_point_result(area, g, p, -kappa, 3, 1e-9, F).tangent_error
    assert gives_way == pytest.approx(found, rel=1e-12)


def test_more_pressure_closes_the_contact(brake):
    points = [
        working_point(brake.space, replace(NOMINAL, brake_pressure=p)) for p in (2e5, 12e5, 40e5)
    ]
    area = brake.assembly.contact.area
    force = [area @ p.contact_pressure for p in points]
    np.testing.assert_allclose(np.array(force) / force[0], [1, 6, 20], rtol=0.05)


# -- changes of component modes ------------------------------------------------------------------
def test_changed_compliances_equal_a_new_factorisation(brake):
    assembly = brake.assembly
    changes = {("inner_pad", 7): 1.5, ("inner_pad", 8): 0.5}
    columns, dk = {}, np.zeros((1308, 1308))
    before = 0
    pad = next(c for c in assembly.components if c.name == "inner_pad")
    for name in assembly.component_names:
        if name == "inner_pad":
            break
        before += brake.modes[name].phi.shape[1]
    for (name, mode), scale in changes.items():
        modes = brake.modes[name]
        change = (scale**2 - 1) * modes.omega[mode - 1] ** 2
        columns[before + mode - 1] = change
        U = pad.M @ modes.phi[:, mode - 1]
        dk += change * np.outer(U, U)
    stiffer = replace(pad, K=(pad.K + sp.csr_matrix((dk + dk.T) / 2)).tocsr())
    parts = tuple(stiffer if c.name == "inner_pad" else c for c in assembly.components)
    rebuilt = contact_space(
        replace(assembly, components=parts), brake.space.k_c, np.zeros((assembly.n_dof, 0))
    )
    changed = brake.space.changed(columns)
    spaces = (rebuilt, brake.space, changed)
    for new, old, found in zip(*map(dense_gaps.compliances, spaces), strict=True):
        assert np.abs(found - new).max() < 1e-9 * np.abs(new).max()
        assert np.abs(old - new).max() > 1e-4 * np.abs(new).max()  # the change is there
    a, b = working_point(changed, NOMINAL), working_point(rebuilt, NOMINAL)
    np.testing.assert_allclose(a.gap, b.gap, atol=1e-9 * np.abs(b.gap).max())
    assert brake.space.changed({3: 0.0}) is brake.space


# -- minimal models ------------------------------------------------------------------------------
@pytest.mark.parametrize("k_c", [1e5, 5e11, 1e14])
def test_hulten_contact_forces(k_c):
    mu, F = 0.4, 70.0
    assembly = build_model("hulten", normal_force=F)
    space = contact_space(assembly, k_c, NO_SHAPES)
    point = working_point(space, OperatingPoint(mu, 1.0, 0.5, assembly.contact.law))
    force = assembly.contact.area * point.contact_pressure
    exact = np.array([F * (1 + mu), F * (1 - mu)]) / (1 + mu**2)
    np.testing.assert_allclose(force, exact, rtol=1e-10)


@pytest.mark.parametrize("k_c", [1e5, 5e11, 1e14])
def test_hoffmann_contact_force(k_c):
    # far too soft a reference stiffness must not stall the step control either
    mu, F = 0.3, 100.0
    assembly = build_model("hoffmann", normal_force=F)
    point = working_point(
        contact_space(assembly, k_c, NO_SHAPES),
        OperatingPoint(mu, 1.0, 0.5, assembly.contact.law),
    )
    k3 = 4e6 / 3
    y = np.linalg.solve([[2e6, 1e6 - mu * k3], [1e6, 2e6]], [0.0, -F])[1]
    assert assembly.contact.area[0] * point.contact_pressure[0] == pytest.approx(-k3 * y, rel=1e-10)


def test_sprag_has_no_equilibrium():
    # inclined the other way, the springs press the mass into the belt as friction drags it:
    # beyond mu = S_yy / S_yx (S the compliance of the springs) any contact force calls for more
    law = contact_law("exponential", p0=1e5, lam=5e5)
    assembly = build_model("hoffmann", alpha1=30.0, alpha2=150.0)
    contact = replace(assembly.contact, law=law, area=np.array([1e-4]))
    assembly = replace(assembly, contact=contact)
    S = np.linalg.inv(assembly.K_springs().toarray())
    limit = S[1, 1] / S[1, 0]
    assert limit > 0
    operating = OperatingPoint(0.0, 1.0, 0.5, law)
    space = contact_space(assembly, mean_contact_stiffness(assembly, operating), NO_SHAPES)
    for friction in (0.0, 0.5 * limit, 0.9 * limit):
        assert working_point(space, replace(operating, friction=friction)).contact_pressure[0] > 0
    with pytest.raises(ConvergenceError, match="no steady sliding") as failure:
        working_point(space, replace(operating, friction=1.5 * limit))
    assert failure.value.status == "working_point"


def test_a_free_motion_has_no_working_point():
    # both springs upright: nothing holds the mass along the belt, to round-off of cos 90 deg
    assembly = build_model("hoffmann", alpha1=90.0, alpha2=90.0)
    with pytest.raises(ConvergenceError, match="singular") as failure:
        contact_space(assembly, 5e11, NO_SHAPES)
    assert failure.value.status == "singular"


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_spring_that_bears_less_than_the_load_is_reached_from_where_it_holds(friction):
    """Least root of k2 d + (k + k3 d^2) d = F: beside the spring a support bears the rest."""
    values = {"contact_stiffness": 2.6e6, "contact.cubic_stiffness": -5.7e17}
    model = sq.model(
        "hoffmann",
        contact_law="cubic",
        k2=1.356e6,
        normal_force=1000.0,
        friction=friction,
        **values,
    )
    steady = model.at().steady
    area = 2.6e6 / 5e11  # m2, at which the stiffness of contact is 5e11 Pa/m
    d = -steady.gap[0]
    force = area * (2.6e6 / area + values["contact.cubic_stiffness"] * d**2) * d
    assert steady.force[0, 0] == pytest.approx(force, rel=1e-9)
    assert d < (2.6e6 / area / (3 * 5.7e17)) ** 0.5  # which is where it gives way
    assert steady.iterations <= 10


def test_softening_contact_that_is_balanced_by_an_open_gap_alone_has_no_steady_sliding():
    """Roots of the law on two springs: closed ones at 600 N, at 700 N only an open gap."""
    k1, k2 = (2e6 / 3 * (2.0 + side * np.sqrt(3.0)) for side in (-1, 1))
    (k11, k12), (_, k22) = sum(
        k * np.outer(n, n) for k, n in ((k1, (-(0.75**0.5), 0.5)), (k2, (0.75**0.5, 0.5)))
    )
    mu, stiffness, third, area = 0.2, 4e6 / 3, -5.4e17, 4e6 / 3 / 5e11
    loads = np.array([300.0, 600.0, 700.0, 3000.0])
    closed = []
    for load in loads:  # with k11 x = -mu p - k12 g along the belt
        soft = k22 - k12**2 / k11
        share = 1.0 + mu * k12 / k11
        linear = soft + share * stiffness
        roots = np.roots([share * third * area, 0.0, linear, load])
        real = roots[np.abs(roots.imag) < 1e-12].real
        force = -(stiffness * real + third * area * real**3)
        closed.append(bool(((real < 0.0) & (force > 0.0)).any()))
        assert ((real > 0.0) & (force > 0.0)).any()  # the open gap that presses is always there
    assert closed == [True, True, False, False]
    values = {"friction": mu, "contact.cubic_stiffness": third}
    model = sq.model("hoffmann", contact_law="cubic", **values)
    together = model.at(normal_force=loads).steady
    np.testing.assert_array_equal(together.status == "ok", closed)
    assert together.message[-1].startswith("the softening contact gives way under the load")
    for load, is_closed in zip(loads.tolist(), closed, strict=True):
        if is_closed:
            assert model.at(normal_force=load).steady.gap[0] < 0.0
        else:
            with pytest.raises(ConvergenceError, match="the softening contact gives way"):
                _ = model.at(normal_force=load).steady


def test_next_to_no_load_on_an_exponential_contact_has_no_equilibrium_in_words():
    model = sq.model("hoffmann", contact_law="exponential", normal_force=1e-320)
    text = "no steady sliding equilibrium found at friction 0.[25]: does"  # no pressure acts
    with pytest.raises(ConvergenceError, match=text):
        model.at(friction=0.2).modes()
    assert re.match(text, model.at(friction=[0.2, 0.3]).modes().message[0])
