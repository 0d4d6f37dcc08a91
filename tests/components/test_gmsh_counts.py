"""Meshes of gmsh whose lines are not as many as their headers state."""

from __future__ import annotations

from pathlib import Path

import pytest

from squealstudy.errors import ModelError
from squealstudy.models.components.gmsh import read_gmsh
from squealstudy.models.components.gmsh_counts import check_counts

MESH_41 = Path(__file__).parents[1] / "meshes" / "pad_hex20.msh"
HEX = " ".join(map(str, range(1, 9)))
CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
NODES = "".join(f"{n} {x} {y} {z}\n" for n, (x, y, z) in enumerate(CORNERS, 1))
MESH_22 = f"""$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
8
{NODES}$EndNodes
$Elements
2
1 15 2 0 1 1
2 5 2 0 1 {HEX}
$EndElements
"""


def section_lines(text: str, name: str) -> range:
    lines = text.split("\n")
    return range(lines.index(f"${name}") + 2, lines.index(f"$End{name}"))


def refused(folder: Path, lines: list[str]) -> None:
    file = folder / "a.msh"
    file.write_text("\n".join(lines))
    with pytest.raises(ModelError, match=r"a\.msh"):
        check_counts(file)
    with pytest.raises(ModelError, match=r"a\.msh"):
        read_gmsh(file)


def test_sound_files_are_read(tmp_path):
    (tmp_path / "a.msh").write_text(MESH_22)
    assert read_gmsh(tmp_path / "a.msh").n_elements == 1
    assert read_gmsh(MESH_41).n_elements > 0


@pytest.mark.parametrize("name", ["Nodes", "Elements"])
@pytest.mark.parametrize("change", ["doubled", "missing"])
def test_a_line_more_or_less_is_refused(tmp_path, name, change):
    """meshio took a doubled line and lost the last element without a word."""
    for text in (MESH_22, MESH_41.read_text()):
        own = section_lines(text, name)
        for k in [*own[:3], own[len(own) // 2], own[-1]]:
            lines = text.split("\n")
            lines[k : k + 1] = [lines[k]] * (2 if change == "doubled" else 0)
            refused(tmp_path, lines)


def test_a_number_that_stands_twice_is_refused(tmp_path):
    refused(tmp_path, MESH_22.replace("\n2 5 2 0 1", "\n1 5 2 0 1").split("\n"))


NAMED = MESH_22.replace(
    "$Nodes", '$PhysicalNames\n2\n3 1 "BACK"\n3 2 "OF TWO WORDS"\n$EndPhysicalNames\n$Nodes', 1
)


@pytest.mark.parametrize("section", ["PhysicalNames", "Entities"])
def test_a_name_more_or_less_is_refused(tmp_path, section):
    """meshio took a doubled name and lost the last without a word: its elements had none."""
    tetrahedra = MESH_41.with_name("pad_tet10.msh").read_text()
    for text in (NAMED, MESH_41.read_text(), tetrahedra):
        if f"${section}\n" not in text:
            continue
        for k in section_lines(text, section):
            for times in (0, 2):
                lines = text.split("\n")
                lines[k : k + 1] = [lines[k]] * times
                refused(tmp_path, lines)


def test_names_are_read_and_two_of_one_number_refused(tmp_path):
    (tmp_path / "a.msh").write_text(NAMED)
    assert read_gmsh(tmp_path / "a.msh").n_elements == 1
    refused(tmp_path, NAMED.replace("3 2", "3 1").split("\n"))
