"""Matrices of a component from files, on the nodes of a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.linalg.factor import is_definite
from squealstudy.models.components.dimensions import DAMPER, MASS, STIFFNESS
from squealstudy.models.components.expansion import Expansion
from squealstudy.models.components.file_tables import ComponentTable
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import KeyPath, PlacedError
from squealstudy.models.components.node_maps import FreedomsOf, read_map
from squealstudy.models.matrices.files import read_component_matrix, read_recovery
from squealstudy.models.matrices.labelled import LabelledMatrix

Matrices = tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix | None]  # K, M, C
INDEPENDENT = 1e-12  # least eigenvalue of the products of such columns, each of length one
IDENTITY = 1e-6  # how far a recovery matrix may be off for the nodes of the rows themselves
ROUND_OFF = 1e-14
DIGITS = 2e-5  # of the highest frequency of a freedom: what ten digits leave of rigid motions
SKEW = 1e-8  # of the largest entry: matrices of files are symmetric to the digits of their texts


def symmetric(A: sp.spmatrix) -> sp.csr_matrix:
    """The symmetric part of a matrix that is symmetric but for round-off."""
    return ((A + A.T) / 2).tocsr()


def placed_matrices(
    folder: Path, units: str, name: str, table: ComponentTable, mesh: SolidMesh, turn: np.ndarray
) -> tuple[Matrices, Expansion]:
    """K, M and C over the degrees of freedom that they have, and how these move the mesh's nodes.

    Degrees of freedom are those of nodes, ascending, then modal coordinates.
    """
    n = 3 * len(mesh.nodes)
    freedoms = FreedomsOf(mesh, str(table.nodes))
    read: list[tuple[sp.csr_matrix, np.ndarray]] = []
    scalars: dict[int, int] = {}  # scalar points, and which modal coordinate each is
    for key, dimension in (("K", STIFFNESS), ("M", MASS), ("C", DAMPER)):
        if table.file_of(key) is None:
            continue
        place: KeyPath = ("components", name, key)
        path = folder / str(table.file_of(key))
        try:
            A = read_component_matrix(path, table.name_of(key))
        except ModelError as error:
            raise PlacedError(place, str(error)) from error
        if isinstance(A, LabelledMatrix):
            A, rows = A.matrix, _named(path, A, freedoms, table, place, scalars)
        else:
            rows = _freedoms(folder, name, table, len(mesh.nodes), A.shape[0], key, freedoms)
        skew = abs(A - A.T)
        if skew.nnz and skew.max() > SKEW * abs(A).max():
            raise PlacedError(place, f"{path.name} is not symmetric: is a half of it missing?")
        read.append((symmetric(dimension.factor(units) * A), rows))
    kept = np.unique(np.concatenate([rows for _, rows in read]))
    places = np.where(kept < n, kept, -1)
    own = kept[kept < n]
    E = sp.csr_matrix((np.ones(len(own)), (own, np.arange(len(own)))), (n, len(kept)))
    if table.recovery is not None:
        E = _recovered(folder, name, table, E, read[0][1])
    found = []
    for A, rows in read:
        at = np.searchsorted(kept, rows)
        placed = sp.csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), (len(kept), len(at)))
        found.append((placed @ A @ placed.T).tocsr())
    if not np.array_equal(turn, np.eye(3)):
        E, found = _turned(name, turn, E, own, found)
    K, M, *C = (symmetric(A) for A in found)
    return (K, M, C[0] if C else None), Expansion(E, places)


def _turned(
    name: str, turn: np.ndarray, E: sp.csr_matrix, own: np.ndarray, found: list[sp.csr_matrix]
) -> tuple[sp.csr_matrix, list[sp.csr_matrix]]:
    """Freedoms in axes that have turned with the part; modal coordinates stay."""
    there = np.zeros(E.shape[0], dtype=bool)
    there[own] = True
    nodes = there.reshape(-1, 3)
    if (nodes.any(axis=1) != nodes.all(axis=1)).any():
        raise PlacedError(
            ("components", name, "rotate"),
            "matrices without all three directions of every node cannot be turned: place the part "
            "before they are made",
        )
    modal = sp.eye(E.shape[1] - len(own))
    Q = sp.block_diag([sp.kron(sp.eye(len(own) // 3), turn), modal], format="csr")
    moved = sp.csr_matrix(sp.kron(sp.eye(len(nodes)), turn) @ E @ Q.T)
    moved.data[abs(moved.data) < ROUND_OFF] = 0.0
    moved.eliminate_zeros()
    return moved, [(Q @ A @ Q.T).tocsr() for A in found]


def _recovered(
    folder: Path, name: str, table: ComponentTable, E: sp.csr_matrix, rows: np.ndarray
) -> sp.csr_matrix:
    """Displacements of all nodes from degrees of freedom, by the recovery matrix of a file."""
    keys: KeyPath = ("components", name, "recovery")
    path = folder / str(table.file_of("recovery"))
    try:
        R = read_recovery(path, table.name_of("recovery"))
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error
    if R.shape != (E.shape[0], len(rows)) or len(rows) != E.shape[1]:
        raise PlacedError(
            keys,
            f"{path.name} is {R.shape[0]} x {R.shape[1]}: expected three rows for each node of "
            f"{table.nodes} and a column for each row of K, {E.shape[0]} x {E.shape[1]}",
        )
    R = R[:, np.argsort(rows)]
    of_nodes = np.flatnonzero(np.diff(E.indptr) > 0)
    off = abs(R[of_nodes] - E[of_nodes]).max()
    if off > IDENTITY:
        raise PlacedError(
            keys,
            f"{path.name} moves the nodes of the matrices' own rows otherwise than these rows (by "
            f"{off:.1g}): does it belong to them, and are its rows in the order of {table.nodes}?",
        )
    modal = R[:, np.flatnonzero(np.diff(E.tocsc().indptr) == 0)].astype(float)
    modal = modal[:, np.flatnonzero(modal.count_nonzero(axis=0))]
    gram = (modal.T @ modal).toarray()
    size = np.sqrt(np.diag(gram))
    if len(gram) and np.linalg.eigvalsh(gram / np.outer(size, size))[0] < INDEPENDENT:
        raise PlacedError(
            keys,
            f"{path.name}: its columns of degrees of freedom that are at no node depend on each "
            "other: expected a motion of its own for each",
        )
    R = R.tolil()
    R[of_nodes] = E[of_nodes]
    return R.tocsr()


def _named(
    path: Path,
    A: LabelledMatrix,
    freedoms: FreedomsOf,
    table: ComponentTable,
    place: KeyPath,
    scalars: dict[int, int],
) -> np.ndarray:
    """Degree of freedom of each row of a matrix that names them, as of `read_map`.

    Scalar points are modal coordinates in the order in which they are met.
    """
    if table.dof is not None:
        raise PlacedError(
            (*place[:2], "dof"), f"expected no map: {path.name} names nodes and directions itself"
        )
    rows = freedoms.at(A.nodes, A.directions)
    modal = A.directions == 0
    both = A.nodes[modal & (freedoms.at(A.nodes, np.ones_like(A.directions)) >= 0)]
    if len(both):
        raise PlacedError(
            place,
            f"{path.name} has no direction of node {both[0]}: expected 1, 2 or 3, or the number of "
            "a scalar point, which is no node",
        )
    rows[modal] = [
        freedoms.count + scalars.setdefault(int(node), len(scalars)) for node in A.nodes[modal]
    ]
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
    """Degree of freedom of each row of the matrix of a key (count,), as of `read_map`."""
    file = table.file_of(key)
    if table.dof is None:
        if count != 3 * n_nodes:
            raise PlacedError(
                ("components", name, key),
                f"{file} has {count} rows, but {table.nodes} has {n_nodes} nodes, three rows "
                "each: give dof = FILE with 'node.direction' or 'modal' of each row",
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


def least_frequency(K: sp.csr_matrix, M: sp.csr_matrix) -> float:
    """Below this [rad/s] a frequency is that of a rigid motion, to the ten digits of a file."""
    return float(DIGITS * np.sqrt((np.abs(K.diagonal()) / M.diagonal()).max()))


def check_definite(name: str, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
    """PlacedError where matrices of a file are no component's: M or K has a negative direction."""
    shift = least_frequency(K, M) ** 2
    for key, A, what in (("M", M, "definite"), ("K", K + shift * M, "semi-definite")):
        if not is_definite(A):
            text = f"not positive {what}: is an entry missing, or of another sign?"
            raise PlacedError(("components", name, key), text)
