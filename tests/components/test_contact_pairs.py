"""Contact between meshes that do not match: patch tests, balance, limits, messages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from conftest import build_model
from hypothesis import given, settings
from hypothesis import strategies as st
from own_blocks import faces_on
from scipy.optimize import root
from touching import (
    AXIS,
    FACETS,
    at,
    body,
    moved,
    patch,
    plane,
    pressed,
    pressures,
    rigid,
    rows_of,
    sector,
    turned,
)

from squealstudy.errors import ModelError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.assemble import brake_faces
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.components.contact_rows import contact_rows
from squealstudy.models.components.faces import facets
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.pairs import pair
from squealstudy.models.fem.sampling import facing_surface, sample_surface


def skewed(x):
    """No facet stays a parallelogram; the outline stays a square."""
    a, b = x[0], x[1]
    along = a + 0.05 * np.sin(np.pi * a) * np.sin(4 * b)
    return np.stack([along, b + 0.05 * np.sin(np.pi * b) * np.cos(5 * a), x[2]])


def nodal(facets, surface):
    """Largest error of the nodal forces of a uniform pressure."""
    exact, _ = facets.gauss_points(6)
    right = exact.shape.T @ exact.area
    return abs(surface.shape.T @ surface.area - right).max() / abs(right).max()


# -- projection --------------------------------------------------------------------------------
def bowl(facets, depth):
    x, y, z = facets.coordinates.T
    return replace(facets, coordinates=np.column_stack([x, y, z + depth * (x * x + x * y)]))


def test_points_are_found_along_the_normal():
    """Against scipy's root finder on one master facet that is a parabolic surface."""
    slave = bowl(plane(6, (3, 2), up=False, lengths=(0.8, 0.7), origin=(0.1, 0.1)), 0.05)
    master = bowl(plane(8, (1, 1), up=True, height=-0.03), 0.3)
    p = pair(slave, master, search=1.0, quadrature="gauss")
    surface, _ = slave.gauss_points(3)
    assert p.in_reach == pytest.approx(1)
    for x, n, gap in zip(surface.points, surface.normal, p.geometric_gap, strict=True):

        def miss(g, x=x, n=n):
            X, Y, Z = x + g * n
            return Z + 0.03 - 0.3 * (X * X + X * Y)

        assert gap == pytest.approx(root(miss, 0.0, tol=1e-14).x[0], abs=1e-13)
    np.testing.assert_allclose(
        p.master.shape @ master.coordinates,
        surface.points + p.geometric_gap[:, None] * surface.normal,
        atol=1e-13,
    )


@pytest.mark.parametrize("quadrature", ["gauss", "clipped"])
def test_sign_of_the_gap_and_initial_gaps(quadrature):
    slave, master = plane(8, (2, 2), up=False), plane(8, (3, 3), up=True, height=-2e-3)
    p = pair(slave, master, search=3e-3, quadrature=quadrature)
    np.testing.assert_allclose(p.geometric_gap, 2e-3, rtol=1e-10)
    np.testing.assert_array_equal(p.gap0, 0)
    assert p.gap_spread < 1e-14
    assert p.gap_range == pytest.approx((2e-3, 2e-3))
    into = pair(slave, moved(master, 0, 0, 5e-3), search=4e-3)
    np.testing.assert_allclose(into.geometric_gap, -3e-3, rtol=1e-10)
    given_gaps = ("geometric", 2e-3), (1e-6, 1e-6)
    for initial_gap, expected in given_gaps:
        q = pair(slave, master, search=3e-3, quadrature=quadrature, initial_gap=initial_gap)
        np.testing.assert_allclose(q.gap0, expected, rtol=1e-10)


# -- a uniform pressure comes over ---------------------------------------------------------------
def uneven(upper, lower, warp=None, **settings):
    """Largest error of the contact pressures of two blocks pressed by 1 Pa."""
    return patch(upper, lower, warp, **settings)[0]


@pytest.mark.parametrize(
    ("upper", "lower"),
    [
        (("hex20", (7, 6)), ("hex20", (5, 6))),
        (("hex20", (2, 2)), ("hex20", (6, 6))),
        (("hex20", (6, 6)), ("hex20", (2, 2))),
        (("hex8", (5, 4)), ("hex8", (3, 7))),
        (("tet10", (4, 3)), ("hex20", (3, 5))),
        (("hex20", (4, 3)), ("tet10", (3, 5))),
        (("tet4", (4, 3)), ("hex8", (3, 5))),
        (("hex27", (3, 3)), ("tet10", (2, 4))),
    ],
)
@pytest.mark.parametrize("degree", [4, 8])
def test_flat_patch(upper, lower, degree):
    assert uneven(upper, lower, degree=degree) < 1e-12


def test_gauss_points_do_not_pass_the_patch_test():
    """Why clipping is there at all."""
    assert uneven(("hex20", (2, 2)), ("hex20", (6, 6)), quadrature="gauss") > 0.05


@pytest.mark.parametrize(
    ("upper", "lower"), [((7, 6), (5, 6)), ((3, 3), (9, 9)), ((9, 9), (3, 3)), ((4, 5), (6, 7))]
)
def test_curved_patch(upper, lower):
    error = uneven(("hex20", upper), ("hex20", lower), sector, pieces=4, degree=4)
    assert error < 1e-4
    if upper != (9, 9):  # Gauss points finer than the master are good as well
        assert error < 0.01 * uneven(("hex20", upper), ("hex20", lower), sector, quadrature="gauss")


def test_curved_patch_gets_better_with_refinement_and_with_the_settings():
    n = np.array([[4, 3], [3, 3]])  # of the same outline: more cells would follow the ring better
    coarse, fine = (
        uneven(*(("hex20", tuple(c)) for c in k * n), sector, pieces=4, degree=4) for k in (1, 2)
    )
    assert fine < coarse / 6
    better = uneven(*(("hex20", tuple(c)) for c in n), sector, pieces=8, degree=8)
    assert better < 0.1 * coarse


@pytest.mark.parametrize("kind", FACETS)
@pytest.mark.parametrize("other", FACETS)
def test_forces_of_a_pressure_between_all_kinds(kind, other):
    """Straight: exact on both sides."""
    slave, master = plane(kind, (4, 3), up=False), plane(other, (3, 5), up=True)
    p = pair(slave, master, search=1e-2)
    assert nodal(slave, p.slave) < 1e-13
    assert nodal(master, p.master) < 1e-13


def straightened(facets):
    """Middles of edges halfway between the corners: 8-node facets."""
    x = facets.coordinates.copy()
    (b,) = facets.blocks
    x[b[:, 4:]] = (x[b[:, :4]] + x[np.roll(b[:, :4], -1, axis=1)]) / 2
    return replace(facets, coordinates=x)


@pytest.mark.parametrize(("change", "bound"), [(straightened, 1e-6), (lambda facets: facets, 5e-5)])
def test_forces_between_distorted_facets(change, bound):
    """Shape functions of a distorted facet are no polynomials of position: not exact, but close."""
    errors = []
    for n in (1, 2):
        slave = change(plane(8, (4 * n, 3 * n), up=False, warp=skewed))
        master = change(plane(8, (3 * n, 5 * n), up=True, warp=skewed))
        p = pair(slave, master, search=1e-2)
        assert p.in_reach == pytest.approx(1, abs=1e-9)
        errors.append(max(nodal(slave, p.slave), nodal(master, p.master)))
    assert errors[0] < bound
    assert errors[1] < errors[0] / 2


@pytest.mark.parametrize("seed", range(3))
def test_badly_distorted_quadrilaterals(seed):
    """Corners of nearly 180 degrees, beyond which local coordinates turn back."""
    rng, surfaces = np.random.default_rng(seed), []
    for cells, up in (((5, 5), False), ((4, 6), True)):
        facets = plane(4, cells, up=up)
        x = facets.coordinates.copy()
        inside = ((x[:, :2] > 0.01) & (x[:, :2] < 0.99)).all(axis=1)
        x[inside, :2] += rng.uniform(-0.06, 0.06, (inside.sum(), 2))
        surfaces.append(replace(facets, coordinates=x))
    p = pair(*surfaces, search=1e-2)
    assert p.slave.area.sum() == pytest.approx(1, rel=1e-12)
    assert (p.slave.area > 0).all()
    assert nodal(surfaces[0], p.slave) < 1e-12
    assert nodal(surfaces[1], p.master) < 1e-4
    gauss = pair(*surfaces, search=1e-2, quadrature="gauss")
    assert gauss.in_reach == pytest.approx(1, rel=1e-12)


def test_hydrostatic_pressure_across_a_curved_face():
    """Both bodies under pressure all around; the contact face is a paraboloid."""

    def bulge(x):
        return np.stack([x[0], x[1], x[2] + 0.15 * x[0] * (x[0] + x[1])])

    def beside(x, y, z):
        return abs(z - 0.15 * x * (x + y)) > 0.02

    errors = []
    for n in (1, 2):
        top = body("hex20", (1, 1, 0.4), (3 * n, 2 * n, 1), (0, 0, 0), bulge)
        base = body("hex20", (1, 1, 0.4), (2 * n, 3 * n, 1), (0, 0, -0.4), bulge)
        slave, master = (b.facets(lambda *x: ~beside(*x)) for b in (top, base))
        p = pair(slave, master, search=1e-2)
        held = []  # only where a uniform shrinking towards (0, 0) moves nothing
        for b, z in ((top, 0.4), (base, -0.4)):
            a, c = (at(b, bulge(np.array([x, 0, z]))) for x in (0, 1))
            held.append(np.array([3 * a, 3 * a + 1, 3 * c + 1]))
        beyond, above = at(base, (0, 1, -0.4)), at(base, (0, 0, 0))
        held[1] = np.append(held[1], [3 * a + 2, 3 * beyond + 2, 3 * above])
        loads = [pressed(b.facets(beside)) for b in (top, base)]
        found = pressures(top, base, p, rows_of(p), loads, held, prestress=1.0)
        errors.append(abs(found - 1).max())
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 4


# -- balance -----------------------------------------------------------------------------------
shifts = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
kinds = st.sampled_from(list(FACETS))


@settings(max_examples=12)
@given(kinds, kinds, st.floats(-3, 3), shifts)
def test_balance_wherever_a_flat_slave_lies(kind, other, angle, shift):
    """The slave is wholly on the master: forces are exact, rigid motions open and slide nothing."""
    slave = turned(plane(kind, (2, 3), up=False, lengths=(0.9, 1.1)), angle, shift)
    master = plane(other, (5, 4), up=True, lengths=(5.0, 5.0), origin=(-2.5, -2.5))
    p = pair(slave, master, search=1e-2)
    assert p.in_reach == pytest.approx(1, abs=1e-12)
    assert p.slave.area.sum() == pytest.approx(0.99, rel=1e-12)
    assert (p.slave.area > 0).all()
    assert nodal(slave, p.slave) < 1e-12
    rows, R = rows_of(p), rigid(slave, master)
    for name in ("N", "T", "T_perp"):
        assert abs(getattr(rows, name) @ R).max() < 1e-12


@settings(max_examples=12)
@given(kinds, kinds, st.floats(-1, 1), st.tuples(st.floats(0.05, 0.95), st.floats(0.05, 0.95)))
def test_balance_where_the_overlap_is_partial(kind, other, angle, shift):
    """What is lost is told, areas stay positive, and the rest balances as before."""
    slave = plane(kind, (2, 3), up=False)
    master = plane(other, (3, 2), up=True, origin=shift)
    slave, master = (turned(f, angle, (0.0, 0.0)) for f in (slave, master))
    p = pair(slave, master, search=1e-2)
    overlap = (1 - shift[0]) * (1 - shift[1])
    assert p.in_reach == pytest.approx(overlap, rel=1e-10)
    assert p.slave.area.sum() == pytest.approx(overlap, rel=1e-10)
    assert (p.slave.area > 0).all()
    assert abs(p.slave.shape).max() < 20
    x, y = (1 + np.array(shift)) / 2  # the middle of the overlap, before it is turned
    middle = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, 0.0
    np.testing.assert_allclose(p.slave.area @ p.slave.points / overlap, middle, atol=1e-10)
    rows, R = rows_of(p), rigid(slave, master)
    for name in ("N", "T", "T_perp"):
        assert abs(getattr(rows, name) @ R).max() < 1e-11


@pytest.mark.parametrize("quadrature", ["gauss", "clipped"])
def test_rigid_motion_across_a_curved_gap(quadrature):
    """Two parabolic faces of different meshes touch but for chords.

    Translations give exactly nothing. A rotation w about a place at distance g gives T an amount
    w g, and N as much as the mean of g n over a facet turns away from its mean normal.
    """
    slave = bowl(plane(4, (6, 5), up=False), 0.1)
    master = bowl(plane(4, (5, 7), up=True), 0.1)
    p = pair(slave, master, search=1e-2, quadrature=quadrature)
    R, gap = rigid(slave, master), abs(p.geometric_gap).max()
    assert 1e-4 < gap < 4e-3
    rows = rows_of(p)
    assert abs(rows.N @ R[:, :3]).max() < 1e-12
    assert abs(rows.T @ R[:, :3]).max() < 1e-12
    assert abs(rows.N @ R).max() < (1e-12 if quadrature == "gauss" else 0.1 * gap)
    assert abs(rows.T @ R).max() < 1.1 * gap


# -- matching meshes ---------------------------------------------------------------------------
@pytest.mark.parametrize("kind", [4, 6, 8, 9])
@pytest.mark.parametrize("points_per_side", [1, 2, 3])
def test_clipped_is_gauss_where_straight_meshes_match(kind, points_per_side):
    slave, master = plane(kind, (3, 2), up=False), plane(kind, (3, 2), up=True)
    one, other = (
        pair(slave, master, search=1e-3, quadrature=q, points_per_side=points_per_side)
        for q in ("clipped", "gauss")
    )
    exact = points_per_side == 3 or (kind == 4 and points_per_side == 2)
    np.testing.assert_allclose(one.slave.area, other.slave.area, rtol=1e-12)
    np.testing.assert_allclose(one.slave.points, other.slave.points, atol=1e-13)
    if exact:
        assert abs(one.slave.shape - other.slave.shape).max() < 1e-12
        assert abs(one.master.shape - other.master.shape).max() < 1e-12


def at_height(mesh, z):
    """The facets of a mesh at one height, as of a file with a surface."""
    found = replace(mesh, surfaces={"FACE": faces_on(mesh, 2, z)})
    return Facets(mesh.nodes, tuple(g.nodes for g in facets(found, "FACE")), str(mesh.origin))


@pytest.mark.parametrize(
    ("name", "height"),
    [("inner_pad", 0.0), pytest.param("outer_pad", 0.012, marks=pytest.mark.full_size)],
)
def test_generated_pads_on_the_disc(name, height):
    """The same rows, by Gauss points, as those of the generated brake."""
    values = MODELS["disc_brake"].defaults()
    assert values["disc.thickness"] == 0.012
    mesher = BrakeMesher(values, COARSE)
    pad, disc = mesher.component(name), mesher.component("disc")
    keep = brake_faces(mesher)[name]["LINING"]
    slave, master = (
        at_height(mesh_of_grid(which, solid.grid, mesher.materials(which)), height)
        for which, solid in ((name, pad), ("disc", disc))
    )
    p = pair(slave, master, search=1e-4, quadrature="gauss")
    known = sample_surface(pad, keep)
    facing = facing_surface(disc, known)
    order = np.array([np.linalg.norm(p.slave.points - x, axis=1).argmin() for x in known.points])
    np.testing.assert_array_equal(np.sort(order), np.arange(len(p.gap0)))
    np.testing.assert_allclose(p.slave.area[order], known.area, rtol=1e-12)
    assert abs(p.slave.shape[order] - known.shape).max() < 1e-12
    assert abs(p.master.shape[order] - facing.shape).max() < 1e-12
    assembly = build_model("disc_brake", {"mesh": "coarse", "contact_points": 3})
    rows = contact_rows(p, name, "disc", assembly.slices, assembly.n_dof, rotation=AXIS)
    first = 0 if name == "inner_pad" else len(assembly.contact.area) - len(order)
    here = slice(first, first + len(order))
    for which in ("N", "T", "T_perp"):
        known_rows = getattr(assembly.contact, which)[here]
        assert abs(getattr(rows, which)[order] - known_rows).max() < 1e-12
    np.testing.assert_allclose(rows.radius[order], assembly.contact.radius[here], rtol=1e-12)
    np.testing.assert_allclose(rows.points[order], known.points, atol=1e-14)
    assert pair(slave, master, search=1e-4).in_reach == pytest.approx(1, abs=1e-4)


# -- limits and messages -------------------------------------------------------------------------
@pytest.mark.parametrize("quadrature", ["gauss", "clipped"])
def test_shares(quadrature):
    """A half on the master; a quarter near, a quarter far."""
    slave = plane(8, (4, 2), up=False)
    near = plane(8, (1, 3), up=True, lengths=(0.25, 1.0))
    far = plane(8, (1, 3), up=True, lengths=(0.25, 1.0), origin=(0.25, 0.0), height=-0.1)
    n = len(near.coordinates)
    both = Facets(
        np.vstack([near.coordinates, far.coordinates]), (*near.blocks, *(b + n for b in far.blocks))
    )
    p = pair(slave, both, search=1e-2, quadrature=quadrature)
    assert p.in_reach == pytest.approx(0.25, rel=1e-10)
    assert p.covered == pytest.approx(0.5, rel=1e-10)
    assert p.gap_range == pytest.approx((0.0, 0.1), abs=1e-12)
    assert abs(p.geometric_gap).max() < 1e-12


@pytest.mark.parametrize("quadrature", ["gauss", "clipped"])
def test_what_cannot_be_paired_says_so(quadrature):
    slave, master = plane(8, (2, 2), up=False), plane(8, (3, 3), up=True)
    slave, master = replace(slave, name="pad.LINING"), replace(master, name="disc.OUTER")

    def tried(message, slave=slave, master=master, search=1e-2, **changes):
        with pytest.raises(ModelError, match=message):
            pair(slave, master, search=search, quadrature=quadrature, **changes)

    away = moved(slave, 0, 0, 0.5)
    tried(r"pad.LINING on disc.OUTER: nothing lies within 0.01 m; 100 % .* 0.5 to 0.5 m", away)
    tried("no normal of the slave meets", moved(slave, 5.0, 0, 0))
    tried("point the same way", plane(8, (2, 2), up=True))
    tried("search must be", search=0.0)
    tried("search must be", search=np.nan)
    tried("initial_gap 'none' is not known", initial_gap="none")
    tried("initial_gap must be finite", initial_gap=np.inf)
    tried("points a side", points_per_side=0)
    tried("pieces >= 1", pieces=0)
    tried("pieces >= 1", degree=1)
    with pytest.raises(ModelError, match="quadrature 'mortar' is not known"):
        pair(slave, master, search=1e-2, quadrature="mortar")


def test_search_far_beyond_the_surfaces_finds_the_same():
    slave, master = plane(8, (4, 3), up=False, warp=sector), plane(8, (3, 5), up=True, warp=sector)
    near, far = (pair(slave, master, search=search) for search in (1e-3, 50.0))
    np.testing.assert_array_equal(near.slave.area, far.slave.area)
    assert abs(near.master.shape - far.master.shape).max() == 0


def test_masters_above_each_other_are_refused():
    slave, master = plane(8, (2, 2), up=False), plane(8, (3, 3), up=True)
    twice = replace(master, blocks=master.blocks * 2)
    with pytest.raises(ModelError, match="lie above each other, opposite 4 facets"):
        pair(slave, twice, search=1e-2)


def test_the_far_side_of_the_master_is_no_contact():
    """Both faces of a disc in one set: within search, only that which opposes the slave counts."""
    slave, near = plane(8, (2, 2), up=False), plane(8, (3, 3), up=True)
    far = plane(8, (3, 3), up=False, height=-0.012)
    n = len(near.coordinates)
    disc = Facets(
        np.vstack([near.coordinates, far.coordinates]), (*near.blocks, *(b + n for b in far.blocks))
    )
    for quadrature in ("gauss", "clipped"):
        p = pair(slave, disc, search=0.02, quadrature=quadrature)
        assert p.in_reach == pytest.approx(1)
        assert sp.csr_matrix(p.master.shape)[:, n:].nnz == 0


def test_mixed_facets():
    """Triangles and quadrilaterals in one surface, large beside small."""
    one = plane(8, (1, 2), up=True, lengths=(0.5, 1.0))
    other = plane(6, (7, 9), up=True, lengths=(0.5, 1.0), origin=(0.5, 0.0))
    n = len(one.coordinates)
    mixed = Facets(
        np.vstack([one.coordinates, other.coordinates]),
        (one.blocks[0], other.blocks[0] + n),
    )
    down = plane(4, (3, 4), up=False)
    p = pair(down, mixed, search=1e-2)
    assert nodal(mixed, p.master) < 1e-12
    assert p.in_reach == pytest.approx(1, rel=1e-12)
    x = mixed.coordinates * [1, 1, -1]
    back = {8: [0, 3, 2, 1, 7, 6, 5, 4], 6: [0, 2, 1, 5, 4, 3]}
    turned_over = Facets(x, tuple(b[:, back[b.shape[1]]] for b in mixed.blocks))
    q = pair(turned_over, plane(8, (4, 3), up=True), search=1e-2)
    assert nodal(turned_over, q.slave) < 1e-12
