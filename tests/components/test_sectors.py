"""A sector of a disc becomes the disc: by `repeat`, and by *CYCLIC SYMMETRY MODEL of CalculiX."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calculix import CCX, run
from component_meshes import LINING, STEEL, box, rigid_shapes
from scipy.sparse.linalg import eigsh

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.constraints import Coupling, Tie
from squealstudy.models.components.discrete import point_mass
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.faces import boundary
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.materials import Orientation
from squealstudy.models.components.mesh import ElementBlock, SolidMesh
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.sectors import Repetition, repeated

COUNT = 6
POINT, AXIS = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 2.0])
HOW = Repetition(POINT, AXIS, COUNT)
INNER, OUTER = 40.0, 70.0


def bent(mesh, angle):
    """A box r, share of the angle [rad], z as a piece of a ring about the axis."""
    r, share, z = mesh.nodes.T
    r, phi = INNER + (OUTER - INNER) * r, angle * share
    x = np.column_stack([r * np.cos(phi), r * np.sin(phi), z])
    return replace(mesh, nodes=x + POINT)


def sector(name="C3D20", around=2, **more):
    return bent(box(name, (2, around, 1), (1.0, 1.0, 9.0), **more), 2 * np.pi / COUNT)


def whole(name="C3D20", around=2, **more):
    """The ring by its own cells: the last nodes are the first ones."""
    mesh = bent(box(name, (2, COUNT * around, 1), (1.0, 1.0, 9.0), **more), 2 * np.pi)
    _, first, at = np.unique(
        np.round(mesh.nodes, 6), axis=0, return_index=True, return_inverse=True
    )
    (block,) = mesh.blocks
    return replace(
        mesh,
        nodes=mesh.nodes[first],
        numbers=np.arange(len(first)) + 1,
        blocks=(replace(block, nodes=at.ravel()[block.nodes]),),
    )


def frequencies(mesh, n, rule="full"):
    mesh, expansion = expanded(mesh)
    K, M = (
        expansion.restricted(A).tocsc() for A in (stiffness_matrix(mesh), mass_matrix(mesh, rule))
    )
    roots = eigsh(K, n + 6, M, sigma=-1e7, return_eigenvectors=False)
    return np.sqrt(np.sort(roots)[6:]) / (2 * np.pi)


def oriented(mesh, axes):
    return replace(
        mesh,
        materials={"S": LINING},
        orientations={"O": axes},
        orientation=np.full(mesh.n_elements, "O", dtype=object),
    )


@pytest.mark.parametrize("name", ["C3D8", "C3D10", "C3D15", "C3D20"])
def test_the_ring_has_the_frequencies_of_one_mesh(name):
    around = 2 if name in ("C3D8", "C3D20") else 3
    disc, expected = repeated(sector(name, around), HOW), whole(name, around)
    assert len(disc.nodes) == len(expected.nodes)
    np.testing.assert_allclose(frequencies(disc, 20), frequencies(expected, 20), rtol=1e-9)
    rigid = rigid_shapes(disc.nodes)
    assert abs(stiffness_matrix(disc) @ rigid).max() < 1e-6 * abs(stiffness_matrix(disc)).max()
    assert (np.diff(disc.numbers) > 0).all()
    assert len(set(disc.labels)) == disc.n_elements


def test_material_axes_turn_with_the_sectors():
    axes = Orientation("cylindrical", tuple(POINT), tuple(POINT + AXIS))
    disc, expected = (oriented(mesh, axes) for mesh in (sector(), whole()))
    found = frequencies(repeated(disc, HOW), 12)
    np.testing.assert_allclose(found, frequencies(expected, 12), rtol=1e-9)
    fixed = oriented(sector(), Orientation("rectangular", (1.0, 0, 0), (0, 1.0, 0)))
    of_no_name = replace(fixed, orientations={}, orientation=np.full(fixed.n_elements, ""))
    turned, other = (frequencies(repeated(m, HOW), 12) for m in (fixed, of_no_name))
    np.testing.assert_allclose(turned, other, rtol=1e-12)
    assert abs(turned / found - 1).max() > 1e-3


def with_surfaces(mesh):
    """All outer faces, those at z = 0, and those of the cut at angle zero."""
    faces = boundary(mesh)
    (block,) = mesh.blocks
    x = mesh.nodes - POINT
    own = [x[block.nodes[e][list(block.kind.shape.faces[f - 1])]] for e, f in faces]
    flat = np.array([abs(p[:, 2]).max() < 1e-9 for p in own])
    cut = np.array([abs(p[:, 1]).max() < 1e-9 for p in own])
    return replace(
        mesh,
        surfaces={"ALL": faces, "RUB": faces[flat], "CUT": faces[cut]},
        node_sets={"LOW": np.flatnonzero(abs(x[:, 2]) < 1e-9)},
        element_sets={"E": np.arange(2)},
    )


def test_sets_are_those_of_all_sectors_and_cuts_are_gone():
    one = with_surfaces(sector())
    disc = repeated(one, HOW)
    assert len(disc.surfaces["RUB"]) == COUNT * len(one.surfaces["RUB"])
    np.testing.assert_array_equal(disc.surfaces["ALL"], boundary(disc))
    assert "CUT" not in disc.surfaces
    assert disc.element_sets["E"].size == COUNT * 2
    assert (abs(disc.nodes[disc.node_sets["LOW"]][:, 2] - POINT[2]) < 1e-9).all()
    assert disc.node_sets["LOW"].size == (abs(disc.nodes[:, 2] - POINT[2]) < 1e-9).sum()


def test_bodies_that_touch_stay_apart_and_a_hub_on_the_axis_is_one():
    inner, outer = sector(), sector()
    outer = replace(outer, nodes=outer.nodes + np.array([0, 0, 9.0]))
    n = len(inner.nodes)
    hub = n + len(outer.nodes)
    (a,), (b,) = inner.blocks, outer.blocks
    both = SolidMesh(
        origin=inner.origin,
        nodes=np.vstack([inner.nodes, outer.nodes, POINT]),
        numbers=np.arange(hub + 1) + 1,
        blocks=(
            ElementBlock(
                "C3D20",
                np.vstack([a.nodes, n + b.nodes]),
                np.arange(1, 1 + len(a.labels) + len(b.labels)),
            ),
        ),
        materials={"S": STEEL},
        material=np.full(2 * len(a.labels), "S", dtype=object),
        constraints=(Coupling("hub", "rigid", hub, np.array([0, 1, 2])),),
    )
    disc = repeated(both, HOW)
    assert disc.body_of.max() == 1
    assert len({c.reference for c in disc.constraints}) == 1
    np.testing.assert_allclose(disc.nodes[disc.constraints[0].reference], POINT)
    with_mass = replace(both, constraints=(), discrete=(point_mass("mass", 0, 1.0),))
    with pytest.raises(ModelError, match="mass is on a side of the sector"):
        repeated(with_mass, HOW)


def test_sides_that_do_not_meet_are_refused():
    with pytest.raises(ModelError, match=r"a turn by 360/7 degrees brings no node .* sides do not"):
        repeated(sector(), Repetition(POINT, AXIS, 7))
    one = sector("C3D8", 1)
    moved = one.nodes.copy()
    side = np.isclose(np.arctan2(*(one.nodes - POINT)[:, [1, 0]].T), 2 * np.pi / COUNT)
    r = np.hypot(*(one.nodes - POINT)[:, :2].T)
    inner = side & (r > INNER + 1) & (r < OUTER - 1)
    moved[inner, :2] = POINT[:2] + 0.9 * (one.nodes[inner] - POINT)[:, :2]
    with pytest.raises(ModelError, match=r"facets of a side of the sector lie on those"):
        repeated(replace(one, nodes=moved), HOW)


@pytest.mark.parametrize("count", [2, 3, 5, 7])
def test_a_wedge_with_nodes_on_the_axis_meets_itself_there_alone(count):
    """Of a quarter of a square: only four of it fill a turn, fewer leave gaps, more overlap."""
    wedge = box("C3D8", (2, 2, 1), lengths=(2.0, 2.0, 1.0), materials={"S": STEEL})
    axis = np.array([0.0, 0.0, 1.0])
    whole = repeated(wedge, Repetition(np.zeros(3), axis, 4))
    assert whole.n_elements == 16
    assert len(whole.nodes) == 50
    with pytest.raises(ModelError, match=rf"a turn by 360/{count} degrees brings no facet"):
        repeated(wedge, Repetition(np.zeros(3), axis, count))


def sector_deck(folder, *more, name="C3D8", mesh=None):
    """A sector of ring as a deck of CalculiX, with the surfaces of its cuts."""
    mesh = with_surfaces(sector(name) if mesh is None else mesh)
    phi = np.arctan2(*(mesh.nodes - POINT)[:, [1, 0]].T)
    ends = {
        key: np.flatnonzero(np.isclose(phi, at)) for key, at in (("A", 0), ("B", 2 * np.pi / COUNT))
    }
    mesh = replace(mesh, node_sets=ends, surfaces={})
    points = ",".join(f"{x:g}" for x in (*POINT, *(POINT + AXIS)))
    lines = [
        *("*SURFACE, NAME=LEFT, TYPE=NODE", "A", "*SURFACE, NAME=RIGHT, TYPE=NODE", "B"),
        *("*TIE, CYCLIC SYMMETRY, NAME=T, POSITION TOLERANCE=1.", "LEFT, RIGHT"),
        *(f"*CYCLIC SYMMETRY MODEL, N={COUNT}, NGRAPH=2", points),
        *more,
    ]
    write_inp(mesh, folder / "a.inp", lines)
    return mesh, lines


def test_a_deck_is_the_whole_ring(tmp_path):
    sector_deck(tmp_path)
    found = read_inp(tmp_path / "a.inp")
    np.testing.assert_allclose(frequencies(found, 9), frequencies(whole("C3D8"), 9), rtol=1e-9)
    as_sector = read_inp(tmp_path / "a.inp", pass_over=["CYCLIC SYMMETRY MODEL"])
    assert as_sector.n_elements == found.n_elements / COUNT
    assert not as_sector.constraints
    told = [note.why for note in as_sector.passed_over if note.keyword == "*TIE"]
    assert told == ["there is no *CYCLIC SYMMETRY MODEL that is read"]


@pytest.mark.skipif(CCX is None, reason="there is no program ccx")
@pytest.mark.parametrize("alike", [True, False])
def test_frequencies_are_those_of_calculix_by_nodal_diameters(tmp_path, alike):
    mesh = sector("C3D20")
    if not alike:  # the slave's side is one that the master's facets do not match
        r = np.hypot(*(mesh.nodes - POINT)[:, :2].T)
        side = np.isclose(np.arctan2(*(mesh.nodes - POINT)[:, [1, 0]].T), 0)
        middle = side & (r > INNER + 1) & (r < OUTER - 1)
        moved = mesh.nodes.copy()
        bump = 4.0 * (1 - ((r - 55) / 15) ** 2)
        moved[middle, 0] += bump[middle]
        mesh = replace(mesh, nodes=moved)
    step = ("*STEP", "*FREQUENCY", "10", "*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=3")
    mesh, lines = sector_deck(tmp_path, name="C3D20", mesh=mesh)
    run(tmp_path, mesh, *lines, *step, "*END STEP")
    rows = [line.split() for line in (tmp_path / "job.dat").read_text().splitlines()]
    theirs = np.sort([float(r[4]) for r in rows if len(r) == 6 and r[1].isdigit()])
    theirs = theirs[theirs > 10]
    disc = read_mesh(tmp_path / "a.inp", ComponentTable(mesh="a.inp"))
    assert any(isinstance(c, Tie) for c in disc.constraints) != alike
    ours = frequencies(disc, 20, "as_stiffness")
    for hz in ours[:14]:
        assert abs(theirs / hz - 1).min() < 2e-5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("N=6", "N=6.5", "line .*: N=6.5 sectors are no whole body: expected 2 to 1000"),
        ("N=6", "N=1000000", "N=1e.06 sectors are no whole body"),
        ("NGRAPH=2\n1,2,3,1,2,5", "NGRAPH=2\n1,2,3,1,2,3", "the two points of the axis are one"),
        ("1,2,3,1,2,5", "1,2,3", "expected 6 numbers"),
        ("MODEL, N", "MODEL, MATRIX=M, N", "the parameter MATRIX is not supported"),
    ],
)
def test_bad_cards_are_named(tmp_path, old, new, message):
    sector_deck(tmp_path)
    text = (tmp_path / "a.inp").read_text()
    assert old in text
    (tmp_path / "a.inp").write_text(text.replace(old, new))
    with pytest.raises(ModelError, match=message):
        read_inp(tmp_path / "a.inp")


def test_the_key_of_a_model_file(tmp_path):
    mesh = with_surfaces(sector("C3D8"))
    write_inp(mesh, tmp_path / "a.inp")
    how = {"axis": list(AXIS), "point": list(POINT), "count": COUNT}
    table = ComponentTable.model_validate({"mesh": "a.inp", "repeat": how})
    found = read_mesh(tmp_path / "a.inp", table)
    np.testing.assert_allclose(frequencies(found, 9), frequencies(whole("C3D8"), 9), rtol=1e-9)
    for wrong in ({**how, "count": 1}, {**how, "axis": [0, 0, 0]}):
        with pytest.raises(ValueError, match=r"count|axis"):
            ComponentTable.model_validate({"mesh": "a.inp", "repeat": wrong})
