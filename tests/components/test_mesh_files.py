"""Universal files (`.unv`) and those of Salome (`.med`): elements, groups, what is refused."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from component_meshes import STEEL, box
from own_blocks import faces_on
from test_component_judge import apart

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.gmsh import know_cells
from squealstudy.models.components.mesh_files import read_mesh
from squealstudy.models.components.mesh_matrices import mass_matrix, stiffness_matrix
from squealstudy.models.components.unv import SOLIDS, read_unv

NUMBER = {name: (number, order) for number, (name, order) in SOLIDS.items()}
FACET = {3: 91, 4: 94, 6: 92, 8: 95}
MEDS = {"C3D4": "tetra", "C3D10": "tetra10", "C3D6": "wedge", "C3D15": "wedge15"}
MEDS |= {"C3D8": "hexahedron", "C3D20": "hexahedron20", "C3D5": "pyramid"}
FACETS = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}


def end_of(mesh):
    """Facets at the end x = 3, their nodes."""
    (block,) = mesh.blocks
    faces = faces_on(mesh, 0, 3.0)
    return faces, [block.nodes[e][list(block.kind.shape.faces[f - 1])] for e, f in faces]


def around(facet):
    """Corners and middles in the order around a facet."""
    n = len(facet) // 2
    return (
        facet
        if len(facet) < 6
        else [x for pair in zip(facet[:n], facet[n:], strict=True) for x in pair]
    )


def unv(mesh):
    """As I-deas and Salome write it, with a group of solids, of facets and of nodes."""
    (block,) = mesh.blocks
    number, order = NUMBER[block.formulation]
    lines = [
        "    -1",
        "   164",
        "         1  SI: Meter (newton)",
        " 1.",
        "    -1",
        "    -1",
        "  2411",
    ]
    for n, x in zip(mesh.numbers, mesh.nodes, strict=True):
        lines += [f"{n:10}         1         1        11", "".join(f"{v:25.16E}" for v in x)]
    lines += ["    -1", "    -1", "  2412"]

    def element(label, kind, nodes):
        lines.append(f"{label:10}{kind:10}         2         1         7{len(nodes):10}")
        for k in range(0, len(nodes), 8):
            lines.append("".join(f"{v:10}" for v in nodes[k : k + 8]))

    for label, nodes in zip(block.labels, mesh.numbers[block.nodes], strict=True):
        there = np.zeros(len(order), dtype=int)
        there[list(order)] = nodes
        element(label, number, there)
    _, facets = end_of(mesh)
    for k, facet in enumerate(facets):
        element(901 + k, FACET[len(facet)], mesh.numbers[around(list(facet))])
    lines.append(f"{800:10}{11:10}{2:10}{1:10}{7:10}{2:10}")  # a rod, of three lines
    lines.append(f"{0:10}{1:10}{1:10}")
    lines.append(f"{mesh.numbers[0]:10}{mesh.numbers[1]:10}")
    lines += ["    -1", "    -1", "  2467"]
    for g, (name, kind, members) in enumerate(
        (
            ("LINING", 8, block.labels[:2]),
            ("RUB", 8, 901 + np.arange(len(facets))),
            ("FEW", 7, mesh.numbers[:3]),
        ),
        1,
    ):
        lines += [f"{g:10}" + f"{0:10}" * 6 + f"{len(members):10}", name]
        flat = [w for m in members for w in (kind, int(m), 0, 0)]
        lines += ["".join(f"{w:10}" for w in flat[k : k + 8]) for k in range(0, len(flat), 8)]
    return "\n".join([*lines, "    -1", ""])


def with_steel(mesh):
    return mesh.with_material("S", STEEL)


@pytest.mark.parametrize("name", list(NUMBER))
def test_every_element_of_universal_files(tmp_path, name):
    expected = box(name, (2, 1, 1), uneven=0.1)
    (tmp_path / "a.unv").write_text(unv(expected))
    mesh = read_mesh(tmp_path / "a.unv", ComponentTable(mesh="a.unv"))
    assert apart(stiffness_matrix(with_steel(mesh)), stiffness_matrix(expected)) < 1e-12
    np.testing.assert_array_equal(mesh.element_sets["LINING"], [0, 1])
    np.testing.assert_array_equal(mesh.node_sets["FEW"], [0, 1, 2])
    np.testing.assert_array_equal(mesh.surfaces["RUB"], end_of(expected)[0])
    assert {"dataset 164", "elements 11"} <= {note.keyword for note in mesh.passed_over}
    part = read_mesh(tmp_path / "a.unv", ComponentTable(mesh="a.unv", part="LINING"))
    assert part.n_elements == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("         3\nLINING", "         9\nLINING", "expected 9 members of a group|whole number"),
        ("       101       116", "       102       116", "element 102 is there twice"),
        (
            "        11         1         1        11\n",
            "        12         1         1        11\n",
            "node 12 is there twice, at different places",
        ),
        ("E+00   0.0", "E+00   x.0", "expected a coordinate, found 'x"),
        ("         7        20", "         7        24", "expected 20 nodes, found|element"),
    ],
)
def test_universal_files_that_are_wrong(tmp_path, old, new, message):
    text = unv(box("C3D20", (2, 1, 1))).replace(f"{2:10}\nLINING", f"{3:10}\nLINING")
    assert old in text, text[:400]
    (tmp_path / "a.unv").write_text(text.replace(old, new, 1))
    with pytest.raises(ModelError, match=rf"a\.unv, line \d+: .*({message})"):
        read_unv(tmp_path / "a.unv")


def test_formulations_of_universal_files_are_those_there_are(tmp_path):
    (tmp_path / "a.unv").write_text(unv(box("C3D8", (2, 1, 1))))
    mesh = read_unv(tmp_path / "a.unv", treat_as={"C3D8": "C3D8I"})
    assert {b.formulation for b in mesh.blocks} == {"C3D8I"}
    with pytest.raises(ModelError, match=r"expected one of C3D4, .* formulation of .*C3D8I"):
        read_unv(tmp_path / "a.unv", treat_as={"C3D8": "C3D9"})


def test_a_dataset_without_end(tmp_path):
    (tmp_path / "a.unv").write_text(unv(box("C3D8", (2, 1, 1))).rstrip().removesuffix("-1"))
    with pytest.raises(ModelError, match="this dataset has no end, -1"):
        read_unv(tmp_path / "a.unv")


def test_middle_nodes_elsewhere_are_refused(tmp_path):
    """Programs that write corners first and middles behind."""
    mesh = box("C3D20", (2, 1, 1))
    text = unv(mesh)
    nodes = mesh.numbers[mesh.blocks[0].nodes[0]]
    start = text.index("       101       116")
    end = text.index("       102       116")
    rows = ["".join(f"{v:10}" for v in nodes[k : k + 8]) for k in range(0, 20, 8)]
    head = text[start : text.index("\n", start)]
    text = text[:start] + "\n".join([head, *rows]) + "\n" + text[end:]
    (tmp_path / "a.unv").write_text(text)
    with pytest.raises(ModelError, match="middle nodes that are not on their edges"):
        read_unv(tmp_path / "a.unv")


@pytest.mark.parametrize("name", list(MEDS))
def test_every_element_of_med(tmp_path, name):
    pytest.importorskip("h5py")
    expected = box(name, (2, 1, 1), uneven=0.1)
    (block,) = expected.blocks
    faces, facets = end_of(expected)
    kinds = sorted({len(f) for f in facets})
    cells = [(MEDS[name], block.nodes)]
    cells += [(FACETS[n], np.array([f for f in facets if len(f) == n])) for n in kinds]
    tags = [np.where(np.arange(len(block.nodes)) < 2, -6, 0)]
    tags += [np.full(len(c), -7) for _, c in cells[1:]]
    points = np.zeros(len(expected.nodes), dtype=int)
    points[:3] = 2
    know_cells()
    written = meshio.Mesh(
        expected.nodes, cells, cell_data={"cell_tags": tags}, point_data={"point_tags": points}
    )
    written.cell_tags, written.point_tags = {-6: ["LINING"], -7: ["RUB", "END"]}, {2: ["FEW"]}
    meshio.med.write(tmp_path / "a.med", written)
    mesh = read_mesh(tmp_path / "a.med", ComponentTable(mesh="a.med"))
    found = with_steel(mesh)
    assert apart(stiffness_matrix(found), stiffness_matrix(expected)) < 1e-12
    assert apart(mass_matrix(found), mass_matrix(expected)) < 1e-12
    np.testing.assert_array_equal(mesh.element_sets["LINING"], [0, 1])
    np.testing.assert_array_equal(mesh.node_sets["FEW"], [0, 1, 2])
    for surface in ("RUB", "END"):
        np.testing.assert_array_equal(mesh.surfaces[surface], faces)


def test_files_of_med_that_are_none(tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "a.med").write_bytes(b"no HDF")
    with pytest.raises(ModelError, match="cannot be read as a mesh of MED"):
        read_mesh(tmp_path / "a.med", ComponentTable(mesh="a.med"))
    with h5py.File(tmp_path / "a.med", "w") as file:
        file["ENS_MAA"] = h5py.ExternalLink("other.med", "/ENS_MAA")
    with pytest.raises(ModelError, match="links to other places, which are not followed"):
        read_mesh(tmp_path / "a.med", ComponentTable(mesh="a.med"))
    with h5py.File(tmp_path / "a.med", "w") as file:
        for k in range(3):
            file.create_group(f"{k}")
    monkeypatch.setattr("squealstudy.models.components.med.MAX_FILE_ENTRIES", 2)
    with pytest.raises(ModelError, match="has more than 2 groups and arrays"):
        read_mesh(tmp_path / "a.med", ComponentTable(mesh="a.med"))


def test_coordinates_that_are_no_numbers_are_said_by_their_node(tmp_path):
    text = "4.1 0 8"
    mesh = box("C3D8", (1, 1, 1))
    nodes = "\n".join(" ".join(map(str, x)) for x in mesh.nodes.tolist())
    nodes = nodes.replace(nodes.splitlines()[3], "0.0 inf 0.0", 1)
    numbers = "\n".join(str(k + 1) for k in range(8))
    cell = " ".join(str(n + 1) for n in mesh.blocks[0].nodes[0])
    (tmp_path / "a.msh").write_text(
        f"$MeshFormat\n{text}\n$EndMeshFormat\n$Nodes\n1 8 1 8\n3 1 0 8\n{numbers}\n{nodes}\n"
        f"$EndNodes\n$Elements\n1 1 1 1\n3 1 5 1\n1 {cell}\n$EndElements\n"
    )
    with pytest.raises(ModelError, match="node 4: coordinates that are no finite numbers"):
        read_mesh(tmp_path / "a.msh", ComponentTable(mesh="a.msh"))
