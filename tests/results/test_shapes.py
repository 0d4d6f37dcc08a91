"""Shapes on all nodes: surfaces, energies, what feeds a mode, against the unreduced equations."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import NOMINAL, TOP, full_order

from squealstudy.errors import ModelError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.cells import NONE, CellBlock, ComponentCells
from squealstudy.models.element_shapes import SHAPES
from squealstudy.models.operating import DesignState
from squealstudy.models.turning import Rotors
from squealstudy.modes.point import band_modes, linearised_point
from squealstudy.reduction.cmt import Expansion
from squealstudy.shapes.names import _most_diameters, _over_radius, name_of
from squealstudy.shapes.shape import DAMPING, INTERFACES, Label, amplitudes, shape_of, turned
from squealstudy.shapes.surface import middles, triangles, with_middles

CUBE = SHAPES["hex8"].places
VOLUMES = {
    "hex": (1.0, 6),
    "wedge": (0.5, 5),
    "tet": (1 / 6, 4),
    "pyramid": (1 / 3, 5),
}  # and number of faces
STATE = DesignState(replace(NOMINAL, friction=0.6), damping_ratio=0.002, stiffness_damping=1.5e-7)


def nothing(u):
    return np.zeros(1)


def one_cell(kind):
    """Coordinates, cells, volume and number of faces of a cell alone."""
    points = SHAPES[kind].places
    nodes = np.arange(len(points))[None]
    cells = ComponentCells((CellBlock(kind, nodes),), np.ones(1), nothing)
    return points, cells, *VOLUMES[kind.rstrip("0123456789")]


def enclosed(points, facets):
    """Vector area and volume inside of a surface, by its triangles."""
    nodes = triangles(facets, len(points)).nodes
    a, b, c = (with_middles(facets, points)[nodes[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a) / 2
    return normal.sum(axis=0), np.einsum("ij,ij->", normal, (a + b + c) / 3) / 3


@pytest.mark.parametrize("kind", SHAPES)
def test_surface_of_a_cell_encloses_it(kind):
    points, cells, volume, faces = one_cell(kind)
    facets = cells.facets
    area, inside = enclosed(points, facets)
    assert len(facets) == faces
    assert area == pytest.approx(np.zeros(3), abs=1e-12)
    assert inside == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize("kind", ["tet10", "wedge15", "hex20"])
def test_middles_of_facets_lie_between_their_corners(kind):
    points, cells, *_ = one_cell(kind)
    for facet in cells.facets:
        corners, between = facet[:4][facet[:4] != NONE], facet[4:][facet[4:] != NONE]
        assert points[between] == pytest.approx(
            (points[corners] + points[np.roll(corners, -1)]) / 2, abs=1e-12
        )


def test_inner_faces_are_no_surface():
    """A hexahedron and the two wedges of another have one quadrilateral in common."""
    points = np.vstack([CUBE, CUBE[[1, 2, 5, 6]] + [1, 0, 0]])
    wedges = np.array([[1, 8, 9, 5, 10, 11], [1, 9, 2, 5, 11, 6]])
    cells = ComponentCells(
        (CellBlock("hex8", np.arange(8)[None]), CellBlock("wedge6", wedges)),
        np.ones(3),
        nothing,
    )
    facets = cells.facets
    area, inside = enclosed(points, facets)
    assert len(facets) == 5 + 3 + 4
    assert inside == pytest.approx(2.0)
    assert area == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize(
    ("blocks", "volumes", "text"),
    [
        ([CellBlock("pyramid", np.zeros((1, 5), int))], np.ones(1), "a type 'pyramid'"),
        ([CellBlock("tet4", np.zeros((1, 5), int))], np.ones(1), "4 nodes each"),
        ([CellBlock("tet4", np.zeros((1, 4), int))], np.ones(2), "as many volumes"),
        ([CellBlock("tet4", np.zeros((1, 4), int))], np.zeros(1), "all positive"),
    ],
)
def test_cells_that_contradict_themselves(blocks, volumes, text):
    with pytest.raises(ModelError, match=text):
        ComponentCells(tuple(blocks), volumes, nothing)


def test_drawn_lines_are_the_edges_of_facets():
    for kind in SHAPES:
        points, cells, *_ = one_cell(kind)
        facets = cells.facets
        surface = triangles(facets, len(points))
        places = with_middles(facets, points)
        length = 0.0
        for nodes, lines in zip(surface.nodes, surface.lines, strict=True):
            for k in np.flatnonzero(lines):
                a, b = places[nodes[k - 2]], places[nodes[k - 1]]
                length += np.linalg.norm(a - b)
        corners = facets[:, :4]
        around = 0.0
        for row in corners:
            own = row[row != NONE]
            around += np.linalg.norm(points[own] - points[np.roll(own, 1)], axis=1).sum()
        assert length == pytest.approx(around)


# -- the generated brake ------------------------------------------------------------------------
def test_cells_of_a_brake_hold_its_energy(brake):
    rng = np.random.default_rng(3)
    for component in brake.assembly.components:
        u = rng.standard_normal(component.n_dof) + 1j * rng.standard_normal(component.n_dof)
        energy = component.cells.energies(u)
        assert energy.min() >= 0
        assert energy.sum() == pytest.approx(np.vdot(u, component.K @ u).real, rel=1e-12)


def test_surfaces_of_a_brake_enclose_its_volume(brake):
    for component in brake.assembly.components:
        facets = component.cells.facets
        area, inside = enclosed(component.coordinates, facets)
        assert middles(facets).all()
        assert area == pytest.approx(np.zeros(3), abs=1e-9)
        assert inside == pytest.approx(component.cells.volumes.sum(), rel=2e-2)  # flat triangles


@pytest.fixture(scope="module")
def solved_point(prepared):
    """Working point, reduced system and modes of a design point with all kinds of damping."""
    point, system = linearised_point(prepared, STATE)
    lam, psi, *_ = band_modes(system, point, (500.0, TOP))
    return point, system, lam, psi


@pytest.fixture(scope="module")
def shape_at(brake, reduced, solved_point):
    model, basis = reduced
    point, system, lam, psi = solved_point
    expansion = Expansion(model, basis.blocks)

    def made(i):
        label = Label(mode=i + 1)
        return shape_of(brake.assembly, expansion, point, system, lam[i], psi[:, i], label)

    return made


def test_shape_is_scaled_and_turned(shape_at):
    for i in (0, 7):
        shape = shape_at(i)
        assert shape.amplitude.max() == pytest.approx(1.0, rel=1e-12)
        u = shape.displacement
        phases = np.linspace(0, np.pi, 181)
        size = [np.linalg.norm(shape.at(phase)) for phase in phases]
        assert np.linalg.norm(u.real) >= max(size) * (1 - 1e-12)
        largest = [np.linalg.norm(shape.at(phase), axis=1).max() for phase in phases]
        assert max(largest) == pytest.approx(1.0, rel=1e-3)


def test_turning_does_not_depend_on_the_phase_of_the_vector():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((5, 3)) + 0.3j * rng.standard_normal((5, 3))
    for phase in (0.3, 2.0, -1.2):
        v = 7.0 * np.exp(1j * phase) * u
        assert v * turned(v) == pytest.approx(u * turned(u))


def test_amplitude_of_an_ellipse():
    u = np.array([[3.0, 2.0j, 0.0]]) * np.exp(0.7j)
    assert amplitudes(u) == pytest.approx([3.0])


def test_energies_are_those_of_the_reduced_model(shape_at):
    shape = shape_at(4)
    assert sum(shape.energies.values()) == pytest.approx(1.0, rel=1e-12)
    for part in shape.parts:
        assert part.cell_energy.sum() == pytest.approx(shape.energies[part.name], rel=1e-6)
    inside = (
        sum(float(np.nansum(part.cell_energy)) for part in shape.parts) + shape.energies[INTERFACES]
    )
    assert inside == pytest.approx(1.0, rel=1e-6)
    assert np.isfinite(shape.density).all()
    assert shape.density.min() > 0


def test_parts_of_the_growth_rate_add_up_to_it(solved_point, shape_at):
    _, _, lam, _ = solved_point
    for i in np.flatnonzero(lam.imag):
        shape = shape_at(i)
        assert sum(shape.growth_from.values()) == pytest.approx(lam[i].real, abs=1e-9 * abs(lam[i]))
        assert shape.growth_from[DAMPING] < 0
        friction = sum(v for k, v in shape.growth_from.items() if k != DAMPING)
        assert shape.contact.growth.sum() == pytest.approx(friction)
        assert list(shape.growth_from) == ["inner_pad", "outer_pad", DAMPING]


def test_contact_motion_is_that_of_the_nodes(brake, shape_at, solved_point):
    shape, contact = shape_at(4), brake.assembly.contact
    u = shape.displacement.ravel()
    found = shape.contact
    assert found.pressure == pytest.approx(-solved_point[0].tangent * (contact.N @ u), rel=1e-6)
    slip = np.column_stack([contact.T @ u, contact.T_perp @ u])
    assert np.abs(found.slip - slip).max() < 1e-8
    assert found.points.shape == (contact.n_points, 3)
    assert set(found.pairs) == {"inner_pad", "outer_pad"}


def test_shape_is_that_of_the_unreduced_equations(brake, solved_point, shape_at):
    point, _, lam, _ = solved_point
    cutoff = 1.5 * TOP
    band = (500.0, 0.4 * TOP)
    found = full_order(brake.assembly, {}, point, STATE, band, cutoff)
    light = np.flatnonzero(found.lam.imag > 0)
    assert len(light) > 3
    for k in light:
        i = int(np.abs(lam - found.lam[k]).argmin())
        assert abs(lam[i] - found.lam[k]) < 1e-3 * abs(lam[i])
        u, v = shape_at(i).displacement.ravel(), found.psi[:, k]
        mac = abs(np.vdot(u, v)) ** 2 / (np.vdot(u, u) * np.vdot(v, v)).real
        assert mac > 0.999


def test_mac_tells_modes_apart(shape_at):
    one, other = shape_at(3), shape_at(9)
    turned_ = replace(one, displacement=one.displacement * np.exp(2j))
    assert one.mac(turned_) == pytest.approx(1.0)
    assert one.mac(other) < 0.5
    with pytest.raises(ModelError, match="different nodes"):
        one.mac(replace(one, displacement=one.displacement[:-1]))


def test_rigid_modes_are_expanded_as_rigid_motion(brake, reduced):
    """Six free-free modes of each component move it without strain and span all such motion."""
    model, basis = reduced
    expansion = Expansion(model, basis.blocks)
    for number, component in enumerate(brake.assembly.components):
        first = int(model.offsets[number])
        x = np.zeros((model.n, 6))
        x[first + np.arange(6), np.arange(6)] = 1.0
        moved = expansion.expand(x)[brake.assembly.slices[component.name]]
        r = component.coordinates - component.coordinates.mean(axis=0)
        rigid = np.zeros((len(r), 3, 6))
        rigid[:, [0, 1, 2], [0, 1, 2]] = 1.0
        rigid[:, :, 3:] = np.cross(np.eye(3)[None], r[:, None]).transpose(0, 2, 1)
        rigid = rigid.reshape(-1, 6)
        rest = moved - rigid @ np.linalg.lstsq(rigid, moved, rcond=None)[0]
        assert np.linalg.norm(rest) < 1e-4 * np.linalg.norm(moved)


def test_free_modes_of_a_component_are_in_the_expansion(brake, reduced):
    model, basis = reduced
    component = brake.assembly.components[0]
    _, phi = real_modes(component.M, component.K, 1500.0)
    x = np.eye(model.n, phi.shape[1])
    expanded = basis.expand(x)[brake.assembly.slices[component.name]]
    P = np.linalg.qr(phi)[0]
    assert np.linalg.norm(expanded - P @ (P.T @ expanded)) < 1e-4 * np.linalg.norm(expanded)


def test_models_without_nodes_have_no_shape(shape_at, brake, reduced, solved_point):
    point, system, lam, psi = solved_point
    model, basis = reduced
    components = tuple(
        replace(c, coordinates=np.zeros((0, 3)), cells=None) for c in brake.assembly.components
    )
    bare = replace(brake.assembly, components=components)
    expansion = Expansion(model, basis.blocks)
    with pytest.raises(ModelError, match="no mesh"):
        shape_of(bare, expansion, point, system, lam[0], psi[:, 0], Label())
    with pytest.raises(ModelError, match="overdamped"):
        shape_of(brake.assembly, expansion, point, system, -5.0 + 0j, psi[:, 0], Label())


# -- names --------------------------------------------------------------------------------------
def ring_shape(shape, u):
    """A shape whose rotor moves as u(r, theta), in its own directions, and nothing else does."""
    rotor = shape.parts[0]
    x, y, _ = shape.coordinates[rotor.nodes].T
    radial, around, axial = u(np.hypot(x, y), np.arctan2(y, x))
    r = np.hypot(x, y)
    moved = np.zeros_like(shape.displacement)
    moved[rotor.nodes] = np.column_stack(
        [(radial * x - around * y) / r, (radial * y + around * x) / r, axial + 0 * x]
    )
    only = dict.fromkeys(shape.kinetic, 0.0) | {"disc": 1.0}
    return replace(shape, displacement=moved, kinetic=only)


@pytest.mark.parametrize(
    ("u", "text", "circles"),
    [
        (lambda r, t: (0, 0, np.cos(3 * t)), "3 ND out of plane", 0),
        (lambda r, t: (0, 0, np.exp(-2j * t)), "2 ND out of plane", 0),  # a wave that travels
        (lambda r, t: (0, 0, 1.0), "0 ND out of plane", 0),
        (lambda r, t: (0, 0, (r - 0.115) * np.cos(2 * t)), "2 ND 1 NC out of plane", 1),
        (lambda r, t: (np.cos(4 * t), 0.3 * np.sin(4 * t), 0), "4 ND in plane", 0),
        (
            lambda r, t: (0, 0, np.cos(2 * t) + np.cos(3 * t) + np.cos(5 * t)),
            "disc out of plane",
            0,
        ),
    ],
)
def test_waves_of_the_disc(shape_at, u, text, circles):
    name = name_of(ring_shape(shape_at(3), u))
    assert name.text == text
    assert name.waves.circles == circles
    assert name.waves.out_of_plane == pytest.approx(float("out of" in text), abs=1e-9)


def test_kinetic_energy_is_that_of_the_masses(brake, shape_at):
    shape = shape_at(6)
    assert list(shape.rubbed) == ["disc"]
    assert len(shape.rubbed["disc"]) == len(shape.contact.points)
    assert sum(shape.kinetic.values()) == pytest.approx(1.0)
    u, slices = shape.displacement.ravel(), brake.assembly.slices
    own = {
        c.name: np.vdot(u[slices[c.name]], c.M @ u[slices[c.name]]).real
        for c in brake.assembly.components
    }
    for name, share in shape.kinetic.items():
        assert share == pytest.approx(own[name] / sum(own.values()), rel=1e-6)
        modes = sum(v for (c, _), v in shape.participation.items() if c == name)
        assert 0 <= modes <= share * (1 + 1e-9)


@pytest.mark.parametrize(
    ("kinetic", "participation", "text"),
    [
        ({"caliper": 1.0}, {("caliper", 13): 0.6, ("caliper", 2): 0.1}, "caliper 13"),
        ({"caliper": 1.0}, {("caliper", 13): 0.4, ("caliper", 9): 0.4}, "caliper"),
        (
            {"caliper": 0.3, "outer_pad": 0.7},
            {("outer_pad", 2): 0.2, ("outer_pad", 6): 0.4, ("caliper", 7): 0.29},
            "rigid outer pad + caliper 7",
        ),
        ({"outer_pad": 1.0}, {("outer_pad", 2): 0.3, ("outer_pad", 6): 0.4}, "outer pad"),
        (dict.fromkeys("abcdefg", 1 / 7), {(c, 7): 1 / 7 for c in "abcdefg"}, "mixed"),
    ],
)
def test_names_of_other_components(shape_at, kinetic, participation, text):
    shape = replace(shape_at(3), kinetic=kinetic, participation=participation)
    assert name_of(shape).text == text


def test_free_modes_of_the_disc_have_their_diameters(brake, shape_at):
    """Modes in pairs of one frequency are waves of one number of diameters."""
    disc = brake.assembly.components[0]
    omega, phi = real_modes(disc.M, disc.K, 3000.0)
    shape = shape_at(3)
    found = []
    for w, column in zip(omega[6:], phi[:, 6:].T, strict=True):
        moved = np.zeros_like(shape.displacement)
        moved[shape.parts[0].nodes] = column.reshape(-1, 3)
        waves = name_of(replace(shape, displacement=moved)).waves
        found.append((w, waves.diameters, waves.share))
    assert found[0][1] == found[1][1] == 2
    assert all(share > 0.9 for *_, share in found)
    for (w, n, _), (v, m, _) in pairwise(found):
        assert abs(w - v) > 1e-3 * w or n == m


# -- where a name would be false ------------------------------------------------------------------
def placed(shape, R, shift):
    """The same shape of a brake that stands elsewhere, about another axis."""
    contact = replace(shape.contact, points=shape.contact.points @ R.T + shift)
    return replace(
        shape,
        coordinates=shape.coordinates @ R.T + shift,
        displacement=shape.displacement @ R.T,
        contact=contact,
        rotors=Rotors(shape.rotors.names, R @ shape.rotors.point + shift, R[:, 2]),
    )


def test_names_do_not_depend_on_where_the_axis_is(shape_at):
    R = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    R[:, 0] *= np.linalg.det(R)
    for turn in (R, np.roll(np.eye(3), 1, axis=0)):
        for i in range(0, 20, 3):
            shape = shape_at(i)
            one, other = name_of(shape), name_of(placed(shape, turn, np.array([0.3, -1.0, 2.0])))
            assert other.text == one.text
            assert other.waves.share == pytest.approx(one.waves.share, rel=1e-6)
            assert other.waves.out_of_plane == pytest.approx(one.waves.out_of_plane, rel=1e-6)


def test_what_moves_as_a_rigid_body_has_no_diameters(shape_at):
    """The disc tilts: one wave around, but no mode of 1 ND."""
    tilted = ring_shape(shape_at(3), lambda r, t: (0, 0, r * np.cos(t)))
    rigid = {("disc", j): 1 / 6 for j in range(1, 7)}
    assert name_of(tilted).text == "1 ND out of plane"
    assert name_of(replace(tilted, participation=rigid)).text == "rigid disc"


def test_a_part_that_is_held_has_no_rigid_modes(shape_at):
    shape = replace(
        shape_at(3),
        kinetic={"caliper": 1.0},
        participation={("caliper", 1): 0.9},
        frequencies={("caliper", 1): 900.0},
    )
    assert name_of(shape).text == "caliper 1"


def test_modes_of_one_frequency_are_named_together(shape_at):
    """Of a symmetric part any two shapes in their plane are its modes."""
    shape = replace(
        shape_at(3),
        kinetic={"caliper": 1.0},
        participation={("caliper", 8): 0.3, ("caliper", 9): 0.4},
        frequencies={("caliper", 7): 5e3, ("caliper", 8): 6e3, ("caliper", 9): 6.0001e3},
    )
    assert name_of(shape).text == "caliper 8-9"
    apart = {("caliper", 8): 6e3, ("caliper", 9): 6.1e3}
    assert name_of(replace(shape, frequencies=apart)).text == "caliper"


def test_two_discs_are_told_apart(shape_at):
    shape = ring_shape(shape_at(3), lambda r, t: (0, 0, np.cos(3 * t)))
    rotors = replace(shape.rotors, names=("disc", "caliper"))
    two = replace(shape, rotors=rotors, rubbed={**shape.rubbed, "caliper": np.zeros(0, int)})
    assert name_of(two).text == "disc 3 ND out of plane"


@pytest.mark.parametrize("known", [True, False])
def test_a_rotor_that_is_no_ring_has_no_diameters(shape_at, known):
    """A sector, or a model without an axis: the disc is named as any component."""
    shape = ring_shape(shape_at(3), lambda r, t: (0, 0, np.cos(3 * t)))
    own = {("disc", 9): 0.7}
    if known:
        x, y, z = shape.coordinates.T
        r, theta = np.hypot(x, y), np.arctan2(y, x) * 0.8
        sector = np.column_stack([r * np.cos(theta), r * np.sin(theta), z])
        shape = replace(shape, coordinates=sector)
    else:
        shape = replace(shape, rotors=None)
    name = name_of(replace(shape, participation=own))
    assert (name.text, name.waves) == ("disc 9", None)


def test_a_drum_s_face_has_one_radius():
    """Chords spread its nodes by 0.02 %; functions of that would fit noise, with shares above 1."""
    rng = np.random.default_rng(0)
    face, disc = 0.1 - 2e-5 * rng.random(50), 0.1 + 0.05 * rng.random(50)
    np.testing.assert_array_equal(_over_radius(face), np.tile([1.0, 0.0, 0.0], (50, 1)))
    assert np.linalg.matrix_rank(_over_radius(disc)) == 3


def test_few_nodes_tell_few_diameters():
    theta = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    assert _most_diameters(theta) == 2  # 15 unknowns of 40 nodes
    assert _most_diameters(np.repeat(theta, 10)) == 9
    assert _most_diameters(theta[:10]) is None
    assert _most_diameters(theta[:35]) is None
    assert _most_diameters(np.linspace(0, 2 * np.pi, 15, endpoint=False)) is None
