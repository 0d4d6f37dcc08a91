"""K, M and C of a component from files, and the nodes of a mesh that they belong to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.linalg.factor import is_definite
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.dimensions import DAMPER, LENGTH, MASS, STIFFNESS
from squealstudy.models.components.expansion import Expansion
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.node_maps import FreedomsOf, read_map
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.matrices.files import read_component_matrix, read_recovery
from squealstudy.models.matrices.labelled import LabelledMatrix

Matrices = tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix | None]  # K, M, C
INDEPENDENT = 1e-12  # least eigenvalue of the Gram matrix of independent columns of length one
IDENTITY = 1e-6  # largest error of a recovery matrix at nodes that have rows in the matrices
TURN_ROUND_OFF = 1e-14  # entries below become 0 after a rotation
DIGITS = 2e-5  # frequency that ten digits leave to rigid motions, over sqrt(max K_ii / M_ii)
MAX_NODE_SETS = 1000  # most nodes without elements that become node sets of one node each
SKEW = 1e-8  # largest asymmetry over the largest entry: round-off of the digits of a file


def symmetric(A: sp.spmatrix) -> sp.csr_matrix:
    """The symmetric part of a matrix that is symmetric except for round-off."""
    return ((A + A.T) / 2).tocsr()


def placed_matrices(
    folder: Path, units: str, name: str, table: ComponentTable, mesh: SolidMesh, turn: np.ndarray
) -> tuple[SolidMesh, Matrices, Expansion]:
    """Read K, M and C of a component, and place their rows on the nodes of a mesh.

    Degrees of freedom are displacements of nodes, ascending, then rotations of nodes, then modal
    coordinates.

    Parameters
    ----------
    folder : Path
        Of the model file.
    units : str
        Its system of units.
    name : str
    table : ComponentTable
    mesh : SolidMesh
    turn : ndarray (3, 3)
        Rotation of the component.

    Returns
    -------
    mesh : SolidMesh
        Without nodes that belong neither to an element nor to a row. A node that belongs to a row
        alone is a node set NODE7, unless there are too many.
    matrices : K, M and C (n, n)
        In SI units; C is None without a file.
    expansion : Expansion
        Displacements and rotations of the nodes from the degrees of freedom.

    Raises
    ------
    PlacedError
        A file cannot be read or does not fit the mesh; a matrix is not symmetric, or cannot be
        rotated.
    """
    freedoms = FreedomsOf(mesh, str(table.nodes))
    read: list[tuple[sp.csr_matrix, np.ndarray]] = []
    scalars: dict[int, int] = {}  # scalar points, and which modal coordinate each is
    for key, dimension in (("K", STIFFNESS), ("M", MASS), ("C", DAMPER)):
        if table.file_of(key) is None:
            continue
        keys: KeyPath = ("components", name, key)
        path = folder / str(table.file_of(key))
        try:
            A = read_component_matrix(path, table.name_of(key))
        except ModelError as error:
            raise PlacedError(keys, str(error)) from error
        if isinstance(A, LabelledMatrix):
            A, rows = A.matrix, _named_freedoms(path, A, freedoms, table, keys, scalars)
        else:
            rows = _freedoms(folder, name, table, mesh, A.shape[0], key, freedoms)
        skew = abs(A - A.T)
        if skew.nnz and skew.max() > SKEW * abs(A).max():
            raise PlacedError(keys, f"{path.name} is not symmetric: is a half of it missing?")
        of_turns = (rows >= freedoms.count // 2) & (rows < freedoms.count)
        D = sp.diags(np.where(of_turns, LENGTH.factor(units), 1.0))  # of a length in such units
        read.append((symmetric(dimension.factor(units) * (D @ A @ D)), rows))
    mesh, read = _with_rows(mesh, read)
    n = 3 * len(mesh.nodes)
    used_rows = np.unique(np.concatenate([rows for _, rows in read]))
    displacement_dofs = np.where(used_rows < n, used_rows, -1)
    displacement_rows, turning = (
        used_rows[used_rows < n],
        used_rows[(used_rows >= n) & (used_rows < 2 * n)] - n,
    )
    row_numbers = np.arange(len(displacement_rows))
    E = sp.csr_matrix(
        (np.ones(len(displacement_rows)), (displacement_rows, row_numbers)), (n, len(used_rows))
    )
    row_numbers = len(displacement_rows) + np.arange(len(turning))
    T = sp.csr_matrix((np.ones(len(turning)), (turning, row_numbers)), (n, len(used_rows)))
    if table.recovery is not None:
        lengths = np.append(
            np.ones(len(displacement_rows)), np.full(len(turning), LENGTH.factor(units))
        )
        E = _recovered(folder, name, table, E, read[0][1], lengths)
    on_used_rows = []
    for A, rows in read:
        row_numbers = np.searchsorted(used_rows, rows)
        placed = sp.csr_matrix(
            (np.ones(len(row_numbers)), (row_numbers, np.arange(len(row_numbers)))),
            (len(used_rows), len(row_numbers)),
        )
        on_used_rows.append((placed @ A @ placed.T).tocsr())
    if not np.array_equal(turn, np.eye(3)):
        Q = _turning(name, turn, n, displacement_rows, turning, E.shape[1])
        full_turn = sp.kron(sp.eye(n // 3), turn)
        E, T = (_rounded(full_turn @ A @ Q.T) for A in (E, T))
        on_used_rows = [(Q @ A @ Q.T).tocsr() for A in on_used_rows]
    S = _scales(on_used_rows[1], displacement_dofs)
    K, M, *C = (symmetric(S @ A @ S) for A in on_used_rows)
    return (
        mesh,
        (K, M, C[0] if C else None),
        Expansion((E @ S).tocsr(), displacement_dofs, (T @ S).tocsr()),
    )


def _scales(M: sp.csr_matrix, displacement_dofs: np.ndarray) -> sp.dia_matrix:
    """Scales of rotations and modal coordinates that make their masses like those of displacements.

    Solvers lose digits where modal masses of 1 t stand beside nodes of some mg.
    """
    mass, of_nodes = M.diagonal(), displacement_dofs >= 0
    scale = np.ones(len(mass))
    is_other = ~of_nodes & (mass > 0)
    usual = mass[of_nodes & (mass > 0)]
    if len(usual):
        scale[is_other] = np.sqrt(np.median(usual) / mass[is_other])
    return sp.diags(scale)


def _with_rows(
    mesh: SolidMesh, read: list[tuple[sp.csr_matrix, np.ndarray]]
) -> tuple[SolidMesh, list[tuple[sp.csr_matrix, np.ndarray]]]:
    """The mesh without nodes that belong neither to elements nor to rows; rows numbered by it.

    All nodes of a file without elements stay.
    """
    n = len(mesh.nodes)
    every = np.concatenate([rows for _, rows in read])
    named = np.zeros(n, dtype=bool)
    named[every[every < 6 * n] // 3 % n] = True
    bare = mesh.bare
    if not bare.any():
        return mesh, read
    named |= not mesh.blocks  # all nodes of a file without elements are meant
    node_at = np.cumsum(named | ~bare) - 1
    count = int((named | ~bare).sum())
    renumbered = []
    for A, rows in read:
        part, axis = np.divmod(rows, 3)  # nodes of displacements, then of turns
        of_node = rows < 6 * n
        turns, node = np.divmod(part, n)
        dofs = 3 * (turns * count + node_at[np.where(of_node, node, 0)]) + axis
        renumbered.append((A, np.where(of_node, dofs, rows - 6 * n + 6 * count)))
    mesh = mesh.part(np.arange(mesh.n_elements), named)
    points = np.flatnonzero(mesh.bare)
    if len(points) <= MAX_NODE_SETS:
        point_sets = {f"NODE{mesh.numbers[k]}": np.array([k]) for k in points}
        mesh = replace(mesh, node_sets={**point_sets, **mesh.node_sets})
    return mesh, renumbered


def _turning(
    name: str, turn: np.ndarray, n: int, coordinates: np.ndarray, turning: np.ndarray, count: int
) -> sp.csr_matrix:
    """Matrix (count, count) that rotates degrees of freedom of nodes, not modal coordinates."""
    for places in (coordinates, turning):
        is_turning = np.zeros(n, dtype=bool)
        is_turning[places] = True
        nodes = is_turning.reshape(-1, 3)
        if (nodes.any(axis=1) != nodes.all(axis=1)).any():
            raise PlacedError(
                ("components", name, "rotate"),
                "matrices without all three directions of every node cannot be turned: place the "
                "part before they are made",
            )
    of_nodes = len(coordinates) + len(turning)
    turned = sp.kron(sp.eye(of_nodes // 3), turn)
    return sp.block_diag([turned, sp.eye(count - of_nodes)], format="csr")


def _rounded(A: sp.spmatrix) -> sp.csr_matrix:
    rounded = sp.csr_matrix(A)
    rounded.data[abs(rounded.data) < TURN_ROUND_OFF] = 0.0
    rounded.eliminate_zeros()
    return rounded


def _recovered(
    folder: Path,
    name: str,
    table: ComponentTable,
    E: sp.csr_matrix,
    rows: np.ndarray,
    of_nodes_in_si: np.ndarray,
) -> sp.csr_matrix:
    """Displacements of all nodes from degrees of freedom, by the recovery matrix of a file.

    `of_nodes_in_si` (m,) has the factors on the columns of displacements and rotations of nodes
    that make lengths of the file metres.
    """
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
    first_modal = len(of_nodes_in_si)
    scale = np.append(of_nodes_in_si, np.ones(len(rows) - first_modal))
    R = R[:, np.argsort(rows)] @ sp.diags(scale)
    of_nodes = np.flatnonzero(np.diff(E.indptr) > 0)
    off = abs(R[of_nodes] - E[of_nodes]).max()
    if off > IDENTITY:
        raise PlacedError(
            keys,
            f"{path.name} moves the nodes of the matrices' own rows otherwise than these rows (by "
            f"{off:.1g}): does it belong to them, and are its rows in the order of {table.nodes}?",
        )
    modal = R[:, first_modal:].astype(float)
    modal = modal[:, np.flatnonzero(modal.count_nonzero(axis=0))]
    gram = (modal.T @ modal).toarray()
    size = np.sqrt(np.diag(gram))
    if len(gram) and np.linalg.eigvalsh(gram / np.outer(size, size))[0] < INDEPENDENT:
        raise PlacedError(
            keys,
            f"{path.name}: its columns of modal coordinates depend on each other: expected a "
            "different motion for each",
        )
    R = R.tolil()
    R[of_nodes] = E[of_nodes]
    return R.tocsr()


def _named_freedoms(
    path: Path,
    A: LabelledMatrix,
    freedoms: FreedomsOf,
    table: ComponentTable,
    keys: KeyPath,
    scalars: dict[int, int],
) -> np.ndarray:
    """Degree of freedom of each row of a matrix that names nodes and directions, as in `read_map`.

    Scalar points are modal coordinates, numbered in the order in which they first occur.
    """
    if table.dof is not None:
        raise PlacedError(
            (*keys[:2], "dof"), f"expected no map: {path.name} names nodes and directions itself"
        )
    rows = freedoms.at(A.nodes, A.directions)
    modal = A.directions == 0
    both = A.nodes[modal & (freedoms.at(A.nodes, np.ones_like(A.directions)) >= 0)]
    if len(both):
        raise PlacedError(
            keys,
            f"{path.name} has no direction of node {both[0]}: expected 1 to 6, or the number of a "
            "scalar point, which is no node",
        )
    rows[modal] = [
        freedoms.count + scalars.setdefault(int(node), len(scalars)) for node in A.nodes[modal]
    ]
    if (rows < 0).any():
        node = A.nodes[int((rows < 0).argmax())]
        raise PlacedError(keys, f"{path.name}: {freedoms.unknown(node)}")
    return rows


def _freedoms(
    folder: Path,
    name: str,
    table: ComponentTable,
    mesh: SolidMesh,
    count: int,
    key: str,
    freedoms: FreedomsOf,
) -> np.ndarray:
    """Degree of freedom (count,) of each row of a matrix without names, as in `read_map`."""
    file = table.file_of(key)
    if table.dof is None:
        n_nodes = int((~mesh.bare).sum())
        if count != 3 * n_nodes:
            raise PlacedError(
                ("components", name, key),
                f"{file} has {count} rows, but {table.nodes} has {n_nodes} nodes, three rows "
                "each: give dof = FILE with 'node.direction' or 'modal' of each row",
            )
        return (3 * np.flatnonzero(~mesh.bare)[:, None] + np.arange(3)).ravel()
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
    """Frequency [rad/s] below which a mode is rigid, as far as the ten digits of a file tell."""
    return float(DIGITS * np.sqrt((np.abs(K.diagonal()) / M.diagonal()).max()))


def check_definite(name: str, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
    """Raise PlacedError where M is not positive definite, or K not positive semi-definite."""
    shift = least_frequency(K, M) ** 2
    for key, A, what in (("M", M, "definite"), ("K", K + shift * M, "semi-definite")):
        if not is_definite(A):
            text = f"not positive {what}: is an entry missing, or of another sign?"
            raise PlacedError(("components", name, key), text)
