"""Matrices of a component from files, on the nodes of a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.dimensions import MASS, STIFFNESS
from squealstudy.models.components.expansion import Expansion
from squealstudy.models.components.file_tables import ComponentTable
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import KeyPath, PlacedError
from squealstudy.models.components.node_maps import FreedomsOf, read_map
from squealstudy.models.matrices.files import read_component_matrix
from squealstudy.models.matrices.labelled import LabelledMatrix

SKEW = 1e-8  # of the largest entry: matrices of files are symmetric to the digits of their texts


def symmetric(A: sp.spmatrix) -> sp.csr_matrix:
    """The symmetric part of a matrix that is symmetric but for round-off."""
    return ((A + A.T) / 2).tocsr()


def placed_matrices(
    folder: Path, units: str, name: str, table: ComponentTable, mesh: SolidMesh, turn: np.ndarray
) -> tuple[tuple[sp.csr_matrix, sp.csr_matrix], Expansion]:
    """K and M over the degrees of freedom that they have, and how these move the mesh's nodes."""
    n = 3 * len(mesh.nodes)
    freedoms = FreedomsOf(mesh, str(table.nodes))
    there = np.zeros(n, dtype=bool)
    found: list[sp.csr_matrix] = []
    for key, factor in (("K", STIFFNESS.factor(units)), ("M", MASS.factor(units))):
        place: KeyPath = ("components", name, key)
        path = folder / str(table.file_of(key))
        try:
            A = read_component_matrix(path, table.name_of(key))
        except ModelError as error:
            raise PlacedError(place, str(error)) from error
        if isinstance(A, LabelledMatrix):
            A, rows = A.matrix, _named(path, A, freedoms, table, place)
        else:
            rows = _freedoms(folder, name, table, len(mesh.nodes), A.shape[0], key, freedoms)
        skew = abs(A - A.T)
        if skew.nnz and skew.max() > SKEW * abs(A).max():
            raise PlacedError(place, f"{path.name} is not symmetric: is a half of it missing?")
        there[rows] = True
        to_nodes = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), (n, len(rows)))
        found.append(to_nodes @ symmetric(factor * A) @ to_nodes.T)
    if not np.array_equal(turn, np.eye(3)):
        if (~there).reshape(-1, 3).any(axis=1).any():
            raise PlacedError(
                ("components", name, "rotate"),
                "matrices without all three directions of every node cannot be turned: place the "
                "part before they are made",
            )
        turned = sp.kron(sp.eye(len(mesh.nodes)), turn)
        found = [turned @ A @ turned.T for A in found]
    kept = np.flatnonzero(there)
    K, M = (symmetric(A[kept][:, kept]) for A in found)
    E = sp.csr_matrix((np.ones(len(kept)), (kept, np.arange(len(kept)))), (n, len(kept)))
    return (K, M), Expansion(E, kept)


def _named(
    path: Path, A: LabelledMatrix, freedoms: FreedomsOf, table: ComponentTable, place: KeyPath
) -> np.ndarray:
    """Degree of freedom 3 * node + axis of each row of a matrix that names them."""
    if table.dof is not None:
        raise PlacedError(
            (*place[:2], "dof"), f"expected no map: {path.name} names nodes and directions itself"
        )
    rows = freedoms.at(A.nodes, A.directions)
    if (rows < 0).any():
        node = A.nodes[int((rows < 0).argmax())]
        raise PlacedError(place, f"{path.name}: {freedoms.unknown(node)}")
    return rows


def _freedoms(
    folder: Path,
    name: str,
    table: ComponentTable,
    n_nodes: int,
    count: int,
    key: str,
    freedoms: FreedomsOf,
) -> np.ndarray:
    """Degree of freedom 3 * node + axis of each row of the matrix of a key (count,)."""
    file = table.file_of(key)
    if table.dof is None:
        if count != 3 * n_nodes:
            raise PlacedError(
                ("components", name, key),
                f"{file} has {count} rows, but {table.nodes} has {n_nodes} nodes, three rows "
                "each: give dof = FILE with 'node.direction' of each row",
            )
        return np.arange(count)
    keys: KeyPath = ("components", name, "dof")
    path = folder / table.dof
    try:
        rows = read_map(path, freedoms)
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error
    if len(rows) < count:
        raise PlacedError(
            keys,
            f"row {len(rows) + 1} of {count} of {file} has no line in {path.name}, which has "
            f"{len(rows)}",
        )
    if len(rows) > count:
        raise PlacedError(keys, f"{path.name} has {len(rows)} lines, {file} has {count} rows only")
    return rows
