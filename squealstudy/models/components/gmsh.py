"""Components from meshes of gmsh (``.msh`` 2.2 and 4.1), read by meshio; groups become sets."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from contextlib import redirect_stderr
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.files import read_whole
from squealstudy.models.components.faces import faces_with_corners
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.gmsh_counts import check_counts
from squealstudy.models.components.mesh import ElementBlock, PassedOver, SolidMesh

SOLIDS = {
    "tetra": "C3D4",
    "tetra10": "C3D10",
    "pyramid": "C3D5",
    "pyramid13": "C3D13",
    "wedge": "C3D6",
    "wedge15": "C3D15",
    "hexahedron": "C3D8",
    "hexahedron20": "C3D20",
}
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}  # of facets
LESSER = ("vertex", "line", "line3")  # cells whose groups are node sets alone
DIMENSIONS = ("points", "curves", "surfaces", "volumes")
NAMES = re.compile(rb"\$PhysicalNames\s+(.*?)\$EndPhysicalNames", re.S)
NAME = re.compile(rb'^[ \t]*([0-3])[ \t]+(\d+)[ \t]+"(.*)"[ \t]*\r?$', re.M)
ADVICE = {
    "hexahedron27": "set Mesh.SecondOrderIncomplete = 1 for hexahedra with 20 nodes",
    "wedge18": "set Mesh.SecondOrderIncomplete = 1 for wedges with 15 nodes",
    "pyramid14": "set Mesh.SecondOrderIncomplete = 1 for pyramids with 13 nodes",
}


def read_gmsh(path: Path, *, treat_as: Mapping[str, str] | None = None) -> SolidMesh:
    """Read a component from a mesh of gmsh, in the units of the file, without materials.

    Named physical groups of volumes are element sets, those of surfaces are surfaces and node sets,
    those of curves and points are node sets. A group without a name has its number as name. Nodes
    are numbered from 1 in the order of the file, not by its tags; so are elements, one formulation
    after the other.

    Parameters
    ----------
    path : Path
    treat_as : dict of str -> str
        Formulations to use in place of others with as many nodes, such as C3D8I for C3D8.

    Returns
    -------
    SolidMesh
        `passed_over` lists facets that are not on the boundary, and nodes of no solid element.

    Raises
    ------
    ModelError
        The file cannot be read; elements, or words of `treat_as`, are not supported; there is no
        solid element; two groups have the same name.
    """
    return mesh_of_cells(path, _read(path), treat_as or {})


def mesh_of_cells(path: Path, meshio_mesh: Any, treat_as: Mapping[str, str]) -> SolidMesh:
    """The component of a mesh of meshio, as in `read_gmsh`."""
    names = _formulations(path, treat_as)
    for block in meshio_mesh.cells:
        if block.type not in (*SOLIDS, *CORNERS, *LESSER):
            advice = ADVICE.get(block.type, f"supported are {', '.join(SOLIDS)}")
            raise ModelError(f"{path}: elements '{block.type}' are not supported: {advice}")
    groups = _groups(meshio_mesh)
    blocks, sets = _solids(meshio_mesh, groups, names)
    if not blocks:
        raise ModelError(f"{path}: there is no solid element; is a group of volumes missing?")
    nodes = np.asarray(meshio_mesh.points, dtype=float)
    mesh = SolidMesh(path, nodes, np.arange(1, len(nodes) + 1), blocks, element_sets=sets)
    mesh = _with_facets(mesh, meshio_mesh, groups)
    used = np.zeros(len(nodes), dtype=bool)
    for solid in blocks:
        used[solid.nodes] = True
    if used.all():
        return mesh
    them = "it" if (~used).sum() == 1 else "them"
    why = f"{mesh.nodes_named(np.flatnonzero(~used))}: no solid element has {them}"
    note = PassedOver("$Nodes", path, 0, why)
    mesh = mesh.part(np.arange(mesh.n_elements))
    return replace(mesh, passed_over=(*mesh.passed_over, note))


def _formulations(path: Path, treat_as: Mapping[str, str]) -> dict[str, str]:
    """Formulation of each type of element of meshio."""
    element_names = list(SOLIDS.values())
    for old, new in treat_as.items():
        if old not in element_names or new not in FORMULATIONS:
            raise ModelError(
                f"{path}: treat_as {old} = '{new}': expected one of {', '.join(element_names)} "
                f"and a formulation of {', '.join(FORMULATIONS)}"
            )
    return {kind: treat_as.get(name, name) for kind, name in SOLIDS.items()}


def know_cells() -> None:
    """Tell meshio that wedge15 and pyramid13 are volumes: version 5.3.5 does not know it."""
    import meshio

    for kind in ("wedge15", "pyramid13"):
        meshio._mesh.topological_dimension.setdefault(kind, 3)


def _read(path: Path) -> Any:
    """The mesh as meshio reads it; ModelError for any error of meshio."""
    import meshio

    know_cells()
    if not path.is_file():
        raise ModelError(f"there is no file {path}")
    check_counts(path)
    _check_names(path)
    output = io.StringIO()
    try:
        with redirect_stderr(output):  # it prints what it overlooks: sections without end
            file_mesh = meshio.gmsh.read(path)
    except Exception as error:  # a damaged file is whatever its reader runs into
        reason = f"{type(error).__name__} {error}".strip()
        raise ModelError(f"{path} cannot be read as a mesh of gmsh: {reason}") from error
    if words := " ".join(output.getvalue().split()):
        raise ModelError(f"{path} cannot be read as a mesh of gmsh: {words}")
    for block in file_mesh.cells:
        if len(block.data) and not (
            0 <= block.data.min() <= block.data.max() < len(file_mesh.points)
        ):
            raise ModelError(f"{path}: elements '{block.type}' have nodes that are not there")
    return file_mesh


def _check_names(path: Path) -> None:
    """Raise ModelError where two groups have the same name, by which alone meshio knows them."""
    section = NAMES.search(read_whole(path))
    group_of: dict[bytes, tuple[int, int]] = {}
    for dimension, tag, name in NAME.findall(section[1]) if section else ():
        group = int(dimension), int(tag)
        other = group_of.setdefault(name, group)
        if other != group:
            (first_dim, first), (second_dim, second) = other, group
            raise ModelError(
                f"{path}: two physical groups are named '{name.decode(errors='replace')}', of "
                f"{DIMENSIONS[first_dim]} ({first}) and of {DIMENSIONS[second_dim]} ({second}): "
                "give them different names"
            )


def _groups(meshio_mesh: Any) -> list[dict[str, np.ndarray]]:
    """For each block of cells: the cells in each physical group, by its name.

    Format 4.1 has groups as sets; in 2.2 each cell has the number of one group.
    """
    named = {(int(tag), int(dim)): name for name, (tag, dim) in meshio_mesh.field_data.items()}
    numbers = meshio_mesh.cell_data.get("gmsh:physical")
    groups: list[dict[str, np.ndarray]] = []
    for k, block in enumerate(meshio_mesh.cells):
        cells_of: dict[str, np.ndarray] = {}
        for name, members in meshio_mesh.cell_sets.items():
            if not name.startswith("gmsh:") and members[k] is not None and len(members[k]):
                cells_of[name] = np.asarray(members[k], dtype=np.int64)
        if numbers is not None:
            for tag in np.unique(numbers[k]):
                name = named.get((int(tag), block.dim), str(tag))
                if tag and name not in cells_of:
                    cells_of[name] = np.flatnonzero(numbers[k] == tag)
        groups.append(cells_of)
    return groups


def _solids(
    meshio_mesh: Any, groups: list[dict[str, np.ndarray]], names: Mapping[str, str]
) -> tuple[tuple[ElementBlock, ...], dict[str, np.ndarray]]:
    """Blocks by formulation, and element sets. Format 2.2 lists a cell of two groups twice."""
    cells: dict[str, list[np.ndarray]] = {}
    in_groups: dict[str, list[tuple[str, np.ndarray]]] = {}
    for block, cells_of in zip(meshio_mesh.cells, groups, strict=True):
        if block.type in SOLIDS:
            kind = names[block.type]
            before = sum(map(len, cells.setdefault(kind, [])))
            cells[kind].append(np.asarray(block.data, dtype=np.int64))
            in_groups.setdefault(kind, []).extend(
                (n, before + rows) for n, rows in cells_of.items()
            )
    blocks: list[ElementBlock] = []
    sets: dict[str, list[np.ndarray]] = {}
    start = 0
    for kind, parts in cells.items():
        nodes = np.concatenate(parts)
        _, first, number = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.argsort(order)[number.ravel()]  # of each cell among those that differ
        labels = start + 1 + np.arange(len(first))
        blocks.append(ElementBlock(kind, nodes[first[order]], labels))
        for name, rows in in_groups[kind]:
            sets.setdefault(name, []).append(start + rank[rows])
        start += len(first)
    return tuple(blocks), {name: np.unique(np.concatenate(parts)) for name, parts in sets.items()}


def _with_facets(
    mesh: SolidMesh, meshio_mesh: Any, groups: list[dict[str, np.ndarray]]
) -> SolidMesh:
    """Add surfaces and node sets from the groups of facets, curves and points."""
    corners: dict[str, list[np.ndarray]] = {}
    nodes: dict[str, list[np.ndarray]] = {}
    for block, cells_of in zip(meshio_mesh.cells, groups, strict=True):
        if block.type in SOLIDS:
            continue
        for name, rows in cells_of.items():
            nodes.setdefault(name, []).append(block.data[rows].ravel())
            if block.type in CORNERS:
                four = np.full((len(rows), 4), -1)
                four[:, : CORNERS[block.type]] = block.data[rows][:, : CORNERS[block.type]]
                corners.setdefault(name, []).append(four)
    surfaces, notes = {}, []
    for name, parts in corners.items():
        facet_corners = np.unique(np.concatenate(parts), axis=0)
        faces, is_face = faces_with_corners(mesh, facet_corners)
        if len(faces):
            surfaces[name] = faces
        if missing := int((~is_face).sum()):
            why = f"{missing} of {len(facet_corners)} facets are not on the boundary of the solid"
            notes.append(PassedOver(f"physical surface {name}", mesh.origin, 0, why))
    return replace(
        mesh,
        surfaces=surfaces,
        node_sets={name: np.unique(np.concatenate(parts)) for name, parts in nodes.items()},
        passed_over=tuple(notes),
    )
