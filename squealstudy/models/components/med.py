"""Components from files of Salome and Code_Aster (``.med``), read by meshio and h5py."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.files import expect_room
from squealstudy.models.components.gmsh import know_cells, mesh_of_cells
from squealstudy.models.components.mesh import SolidMesh

MAX_FILE_ENTRIES = 100_000  # groups and arrays of a file
MEMORY_OVER_ARRAYS = 4.0  # memory needed, over the bytes of the file's arrays


def read_med(path: Path, *, treat_as: Mapping[str, str] | None = None) -> SolidMesh:
    """Read a component from a file of MED 3 or 4, in the units of the file, without materials.

    Groups of volumes are element sets, groups of faces are surfaces and node sets, groups of edges
    and nodes are node sets. Nodes and elements are numbered as in `read_gmsh`.

    Parameters
    ----------
    path : Path
    treat_as : dict of str -> str
        As in `read_gmsh`.

    Raises
    ------
    ModelError
        h5py is not installed; the file cannot be read, or needs too much memory; elements are not
        supported.
    """
    import meshio

    if not path.is_file():
        raise ModelError(f"there is no file {path}")
    know_cells()
    try:
        _check(path)
        file_mesh = meshio.med.read(path)
    except ModelError:
        raise
    except Exception as error:  # a damaged file is whatever its reader runs into
        reason = f"{type(error).__name__} {error}".strip()
        raise ModelError(f"{path} cannot be read as a mesh of MED: {reason}") from error
    file_mesh.points = np.asarray(file_mesh.points, dtype=float)
    if file_mesh.points.ndim != 2 or file_mesh.points.shape[1] != 3:
        raise ModelError(f"{path}: expected nodes in space")
    for block in file_mesh.cells:
        if len(block.data) and not (
            0 <= block.data.min() <= block.data.max() < len(file_mesh.points)
        ):
            raise ModelError(f"{path}: elements '{block.type}' have nodes that are not there")
    _name_groups(file_mesh)
    mesh = mesh_of_cells(path, file_mesh, treat_as or {})
    return _with_node_groups(mesh, file_mesh)


def _check(path: Path) -> None:
    """Raise ModelError without h5py, about links to other files, and about too large a file."""
    try:
        import h5py
    except ImportError:
        raise ModelError(f"{path}: MED needs h5py: pip install 'squealstudy[med]'") from None
    needed = 0
    with h5py.File(path, "r") as file:
        groups = [file]
        n_entries = 0
        while groups:
            group = groups.pop()
            for name in group:
                n_entries += 1
                if n_entries > MAX_FILE_ENTRIES:
                    raise ModelError(f"{path} has more than {MAX_FILE_ENTRIES:,} groups and arrays")
                if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                    raise ModelError(f"{path}: links to other places, which are not followed")
                entry = group[name]
                if isinstance(entry, h5py.Group):
                    groups.append(entry)
                elif entry.external or entry.is_virtual:
                    raise ModelError(f"{path}: numbers in other files, which are not read")
                else:
                    needed += entry.size * entry.dtype.itemsize
    expect_room(MEMORY_OVER_ARRAYS * needed)


def _name_groups(meshio_mesh: Any) -> None:
    """Make sets of cells from their families, by the names of the groups."""
    tags = meshio_mesh.cell_data.pop("cell_tags", None)
    if tags is None:
        return
    sets: dict[str, list[np.ndarray]] = {}
    for k, tags_of_block in enumerate(tags):
        for tag in np.unique(tags_of_block):
            for name in meshio_mesh.cell_tags.get(int(tag), ()):
                parts = sets.setdefault(
                    name.strip(), [np.zeros(0, dtype=np.int64) for _ in meshio_mesh.cells]
                )
                parts[k] = np.union1d(parts[k], np.flatnonzero(tags_of_block == tag))
    meshio_mesh.cell_sets = sets


def _with_node_groups(mesh: SolidMesh, meshio_mesh: Any) -> SolidMesh:
    """The mesh with the groups of nodes of a MED file as sets."""
    tags = meshio_mesh.point_data.get("point_tags")
    if tags is None:
        return mesh
    index_of_node = np.full(len(meshio_mesh.points) + 1, -1)
    index_of_node[mesh.numbers] = np.arange(len(mesh.numbers))
    sets = dict(mesh.node_sets)
    for tag, names in meshio_mesh.point_tags.items():
        members = index_of_node[1 + np.flatnonzero(tags == tag)]
        for name in names:
            both = np.union1d(
                sets.get(name.strip(), np.zeros(0, dtype=np.int64)), members[members >= 0]
            )
            if len(both):
                sets[name.strip()] = both
    return replace(mesh, node_sets=sets)
