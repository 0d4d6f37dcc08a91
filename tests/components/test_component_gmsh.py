"""Meshes of gmsh: `.msh` 2.2 and 4.1, and its own `.inp`; made by tests/meshes/make_meshes.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from component_meshes import LINING, STEEL, rigid_shapes

from squealstudy.errors import ModelError
from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.faces import facets
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.gmsh import read_gmsh
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.pairs import pair

MESHES = Path(__file__).parents[1] / "meshes"
LARGEST = 60_000  # bytes of a file
FACES = {"CPS6": "faces", "CPS8": "faces"}


def of_pad(mesh):
    """With the materials of a pad."""
    return mesh.with_material("steel", STEEL, "BACK").with_material("lining", LINING, "LINING")


def area_and_normal(mesh, name):
    """Area and mean normal of a plane surface, by its corners."""
    areas = []
    for group in facets(mesh, name):
        k = group.nodes.shape[1] // 2
        x = mesh.nodes[group.nodes[:, :k]]
        sides = x[:, 1:] - x[:, :1]
        areas += [np.cross(sides[:, i], sides[:, i + 1]).sum(axis=0) / 2 for i in range(k - 2)]
    total = np.sum(areas, axis=0)
    return np.linalg.norm(total), total / np.linalg.norm(total)


@pytest.mark.parametrize("name", ["pad_tet10", "pad_hex20"])
def test_groups_are_sets_and_surfaces(name):
    mesh = read_gmsh(MESHES / f"{name}.msh")
    check_mesh(mesh)
    assert sorted(mesh.element_sets) == ["BACK", "LINING"]
    both = np.sort(np.concatenate(list(mesh.element_sets.values())))
    np.testing.assert_array_equal(both, np.arange(mesh.n_elements))
    for surface, z, outward in (("PISTON", 0.0, -1.0), ("FRICTION", 13.0, 1.0)):
        nodes = mesh.node_set(surface)
        np.testing.assert_allclose(mesh.nodes[nodes, 2], z, atol=1e-12)
        area, normal = area_and_normal(mesh, surface)
        np.testing.assert_allclose(normal, [0, 0, outward], atol=1e-12)
        assert area == pytest.approx(0.5 * 1.5 * (40**2 - 20**2), rel=0.03)
        in_set = facets(replace(mesh, surfaces={}), surface)
        assert sum(len(g.nodes) for g in in_set) == len(mesh.surfaces[surface])


def test_facets_inside_the_body_are_listed():
    mesh = read_gmsh(MESHES / "pad_tet10.msh")
    (note,) = mesh.passed_over
    assert note.keyword == "physical surface BETWEEN"
    assert note.why == "41 of 41 facets are not on the boundary of the solid"
    assert "BETWEEN" in mesh.node_sets
    with pytest.raises(ModelError, match="no facet of the boundary has all its nodes in"):
        facets(mesh, "BETWEEN")


def test_tetrahedra_and_swept_meshes_have_the_same_mass():
    inertia = []
    for name in ("pad_tet10", "pad_hex20"):
        mesh = of_pad(read_gmsh(MESHES / f"{name}.msh"))
        R = rigid_shapes(mesh.nodes)
        inertia.append(R.T @ mass_matrix(mesh) @ R)
        K = stiffness_matrix(mesh)
        assert np.abs(K @ R).max() < 1e-11 * abs(K).max() * np.abs(R).max()
    sector = 0.5 * 1.5 * (40**2 - 20**2)
    mass = sector * (5 * STEEL.density + 8 * LINING.density)
    assert [m[0, 0] for m in inertia] == pytest.approx([mass, mass], rel=5e-4)
    # the tetrahedra lie in angles 0 to 1.5 as well; arcs are parabolas in both
    np.testing.assert_allclose(*inertia, atol=2e-3 * np.abs(inertia[0]).max())


def test_inp_of_gmsh_is_the_same_mesh():
    """Hexahedra with 20 nodes and wedges with 15: gmsh itself has put them in Abaqus's order."""
    ours = of_pad(read_gmsh(MESHES / "pad_hex20.msh"))
    theirs = of_pad(read_inp(MESHES / "pad_hex20.inp", treat_as=FACES))
    assert {b.formulation for b in theirs.blocks} == {"C3D20", "C3D15"}
    assert set(ours.surfaces) <= set(theirs.surfaces)
    np.testing.assert_allclose(theirs.nodes, ours.nodes, atol=1e-11)
    for matrix in (stiffness_matrix, mass_matrix):
        A, B = matrix(ours), matrix(theirs)
        assert abs(A - B).max() < 1e-10 * abs(A).max()
    for name in ("PISTON", "FRICTION"):
        corners = [
            {frozenset(nodes) for g in facets(mesh, name) for nodes in g.nodes.tolist()}
            for mesh in (ours, theirs)
        ]
        assert corners[0] == corners[1]


def test_faces_of_two_meshes_make_a_contact_pair():
    """The same face meshed twice: tetrahedra on hexahedra and wedges."""
    lower, upper = (read_gmsh(MESHES / f"pad_{name}.msh") for name in ("tet10", "hex20"))
    upper = replace(upper, nodes=upper.nodes + np.array([0, 0, 13.0]))
    slave, master = (
        Facets(mesh.nodes, tuple(group.nodes for group in facets(mesh, name)), name)
        for mesh, name in ((lower, "FRICTION"), (upper, "PISTON"))
    )
    assert slave.areas.sum() == pytest.approx(0.5 * 1.5 * (40**2 - 20**2), rel=1e-2)
    found = pair(slave, master, search=0.1)
    assert found.in_reach > 0.99
    np.testing.assert_allclose(
        found.slave.normal, np.tile([0, 0, 1.0], (len(found.gap0), 1)), atol=1e-9
    )
    assert np.abs(found.geometric_gap).max() < 1e-9


def test_plane_elements_of_gmsh_are_refused_with_advice():
    with pytest.raises(ModelError, match=r"line \d+: element CPS8 .*treat_as CPS8 = 'faces'"):
        read_inp(MESHES / "pad_hex20.inp")


def test_elements_can_be_treated_as_others():
    mesh = read_gmsh(MESHES / "pad_hex20.msh", treat_as={"C3D20": "C3D20R"})
    assert {b.formulation for b in mesh.blocks} == {"C3D20R", "C3D15"}
    message = "expected one of C3D4, .* and a formulation of .*C3D20R"
    with pytest.raises(ModelError, match=message):
        read_gmsh(MESHES / "pad_hex20.msh", treat_as={"C3D20": "S8"})


# two hexahedra in format 2.2; the first volume belongs to two groups: its element is there twice
BLOCKS = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 7 "EDGE"
3 1 "ALL"
3 2 "FIRST"
$EndPhysicalNames
$Nodes
13
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 0 0 1
6 1 0 1
7 1 1 1
8 0 1 1
9 2 0 0
10 2 1 0
11 2 0 1
12 2 1 1
13 9 9 9
$EndNodes
$Elements
5
1 1 2 7 1 1 2
2 3 2 5 1 1 4 8 5
3 5 2 1 1 1 2 3 4 5 6 7 8
4 5 2 2 1 1 2 3 4 5 6 7 8
5 5 2 1 2 2 9 10 3 6 11 12 7
$EndElements
"""


def written(folder, text):
    path = folder / "a.msh"
    path.write_text(text, encoding="utf-8")
    return path


def test_elements_of_two_groups_and_groups_without_name(tmp_path):
    mesh = read_gmsh(written(tmp_path, BLOCKS))
    check_mesh(mesh)
    assert {k: v.tolist() for k, v in mesh.element_sets.items()} == {"ALL": [0, 1], "FIRST": [0]}
    assert {k: v.tolist() for k, v in mesh.surfaces.items()} == {"5": [[0, 6]]}
    assert {k: v.tolist() for k, v in mesh.node_sets.items()} == {"EDGE": [0, 1], "5": [0, 3, 4, 7]}
    assert [(p.keyword, p.why) for p in mesh.passed_over] == [
        ("$Nodes", "node 13: no solid element has it")
    ]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ('2 9 "ALL"', r"named 'ALL', of surfaces \(9\) and of volumes \(1\)"),
        ('1 1 "ALL"', r"named 'ALL', of curves \(1\) and of volumes \(1\)"),
        ('3 5 "FIRST"', r"named 'FIRST', of volumes \(5\) and of volumes \(2\)"),
    ],
)
def test_two_groups_of_one_name_are_refused(tmp_path, name, message):
    text = BLOCKS.replace("Names\n3\n", f"Names\n4\n{name}\n")
    for ends in ("\n", "\r\n"):
        (tmp_path / "a.msh").write_bytes(text.replace("\n", ends).encode())
        with pytest.raises(ModelError, match=message) as raised:
            read_gmsh(tmp_path / "a.msh")
        assert "give them different names" in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("$EndElements", "", r"cannot be read as a mesh of gmsh: .*\$Elements not closed"),
        ("5 5 2 1 2 2 9", "5 5 3 1 2 2 9", "cannot be read as a mesh of gmsh"),
        (BLOCKS, "", "cannot be read as a mesh of gmsh"),
        ("2.2 0 8", "3.7 0 8", "cannot be read as a mesh of gmsh"),
        ("2 1 0 0\n", "2 1 x 0\n", "cannot be read as a mesh of gmsh"),
        ("2 9 10 3 6 11 12 7", "2 9 10 3 6 11 12 77", "cannot be read.*out of bounds"),
        (
            "5 5 2 1 2 2 9 10 3 6 11 12 7",
            "5 14 2 1 2 2 9 10 3 6 1 4 5 7 8 11 12 1 2",
            "'pyramid14' .*Incomplete = 1",
        ),
        (
            "3 5 2 1 1 1 2 3 4 5 6 7 8\n4 5 2 2 1 1 2 3 4 5 6 7 8\n5 5 2 1 2 2 9 10 3 6 11 12 7\n",
            "",
            "no solid",
        ),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, new, message):
    assert old in BLOCKS
    text = BLOCKS.replace(old, new)
    if message == "no solid":
        text = text.replace("$Elements\n5\n", "$Elements\n2\n")
    path = written(tmp_path, text)
    with pytest.raises(ModelError, match=message) as raised:
        read_gmsh(path)
    assert str(path) in str(raised.value)
    with pytest.raises(ModelError, match="there is no file"):
        read_gmsh(tmp_path / "absent.msh")


def test_the_meshes_are_small():
    for path in MESHES.glob("pad*"):
        assert path.stat().st_size <= LARGEST
