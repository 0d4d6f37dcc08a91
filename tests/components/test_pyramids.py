"""Pyramids with 5 and 13 nodes: completeness, neighbours, a collapsed brick of CalculiX, files."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from calculix import CCX, apart, judged
from component_meshes import LINING, STEEL, box

from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.formulations import FORMULATIONS, integration
from squealstudy.models.components.gmsh import read_gmsh
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh import ElementBlock, SolidMesh
from squealstudy.models.components.mesh_matrices import stiffness_matrix
from squealstudy.models.element_shapes import SHAPES

INSIDE = np.array([[a * (1 - c), b * (1 - c), c] for a, b, c in product((0.1, 0.5, 0.8), repeat=3)])
ORIGIN = box("C3D8").origin


@pytest.mark.parametrize(("name", "degree"), [("pyramid5", 1), ("pyramid13", 2)])
def test_polynomials_are_reproduced(name, degree):
    shape = SHAPES[name]
    N, dN = shape.functions(INSIDE)
    for powers in product(range(degree + 1), repeat=3):
        if sum(powers) > degree:
            continue
        at_nodes, inside = (np.prod(X**powers, axis=1) for X in (shape.places, INSIDE))
        np.testing.assert_allclose(N @ at_nodes, inside, atol=1e-14)
        for axis in range(3):
            lower = np.array(powers) - np.eye(3, dtype=int)[axis]
            slope = powers[axis] * np.prod(INSIDE ** np.maximum(lower, 0), axis=1)
            np.testing.assert_allclose(dN[:, :, axis] @ at_nodes, slope, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "triangle", "square"), [("pyramid5", "tet4", "hex8"), ("pyramid13", "tet10", "hex20")]
)
def test_faces_fit_those_of_bricks_and_tetrahedra(name, triangle, square):
    shape = SHAPES[name]
    rng = np.random.default_rng(0)
    for face in shape.faces:
        other = SHAPES[square if len(face) in (4, 8) else triangle]
        neighbour = other.faces[0]
        corners = len(face) if len(face) in (3, 4) else len(face) // 2
        weights = rng.dirichlet(np.ones(corners), 20)
        if corners == 4:  # of a parallelogram: by its sides
            a, b = rng.uniform(0, 1, (2, 20))
            weights = np.column_stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b])
        mine, theirs = (
            s.functions(weights @ s.places[list(f[:corners])])[0]
            for s, f in ((shape, face), (other, neighbour))
        )
        np.testing.assert_allclose(mine[:, list(face)], theirs[:, list(neighbour)], atol=1e-13)
        rest = np.setdiff1d(np.arange(shape.nodes), face)
        np.testing.assert_allclose(mine[:, rest], 0, atol=1e-13)


@pytest.mark.skipif(CCX is None, reason="there is no program ccx")
@pytest.mark.parametrize("material", [STEEL, LINING])
def test_a_collapsed_brick_of_calculix_has_the_stiffness(tmp_path, material):
    x = np.array([[0, 0, 0], [2, 0.3, 0], [2.5, 1.3, 0.1], [0.5, 1.0, 0.1], [1.1, 0.7, 1.4]])
    given = {
        "origin": ORIGIN,
        "nodes": x,
        "numbers": np.arange(5) + 11,
        "materials": {"S": material},
        "material": np.array(["S"], dtype=object),
    }
    ours = SolidMesh(blocks=(ElementBlock("C3D5", np.arange(5)[None], np.array([1])),), **given)
    check_mesh(ours)
    row = np.array([[0, 1, 2, 3, 4, 4, 4, 4]])
    brick = SolidMesh(blocks=(ElementBlock("C3D8", row, np.array([1])),), **given)
    K, _ = judged(tmp_path, brick)
    assert apart(stiffness_matrix(ours), K) < 1e-10


@pytest.mark.parametrize("name", ["C3D5", "C3D13"])
def test_masses_are_exact_integrals(name):
    kind = FORMULATIONS[name]
    found = []
    for rule in (integration(kind.mass), integration("pyramid8")):
        N, _ = kind.shape.functions(rule.points)
        found.append(N.T * rule.weights @ N)
    np.testing.assert_allclose(found[0], found[1], atol=1e-15)


EDGES = {  # of gmsh's manual, the order of its middle nodes
    19: ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
    7: (),
}


@pytest.mark.parametrize("kind", [7, 19])
def test_files_of_gmsh(tmp_path, kind):
    x = SHAPES["pyramid5"].places * [2.0, 3.0, 4.0]
    x = np.vstack([x, *((x[i] + x[j])[None] / 2 for i, j in EDGES[kind])])
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(x))]
    lines += [f"{n} {a} {b} {c}" for n, (a, b, c) in enumerate(x, 1)]
    nodes = " ".join(str(n + 1) for n in range(len(x)))
    lines += ["$EndNodes", "$Elements", "1", f"1 {kind} 2 1 1 {nodes}", "$EndElements", ""]
    (tmp_path / "a.msh").write_text("\n".join(lines))
    mesh = read_gmsh(tmp_path / "a.msh")
    (block,) = mesh.blocks
    shape = block.kind.shape
    assert shape.nodes == len(x)
    check_mesh(mesh)
    np.testing.assert_allclose(mesh.nodes[block.nodes[0]], shape.places * [2.0, 3.0, 4.0])


def test_a_file_of_pyramids_is_read_as_it_was_written(tmp_path):
    mesh = box("C3D5", (1, 2, 1))
    write_inp(mesh, tmp_path / "a.inp")
    again = read_inp(tmp_path / "a.inp")
    np.testing.assert_array_equal(again.blocks[0].nodes, mesh.blocks[0].nodes)
    assert apart(stiffness_matrix(again), stiffness_matrix(mesh)) < 1e-14
