"""Matrices of a component from files, on the nodes of a mesh."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import (
    MASS,
    STIFFNESS,
    ComponentTable,
    KeyPath,
    PlacedError,
)
from squealstudy.models.matrices.files import read_matrix

SKEW = 1e-8  # of the largest entry: matrices of files are symmetric to the digits of their texts
DOF = re.compile(r"\s*([0-9]+)\.([0-9]+)\s*")


def symmetric(A: sp.spmatrix) -> sp.csr_matrix:
    """The symmetric part of a matrix that is symmetric but for round-off."""
    return ((A + A.T) / 2).tocsr()


def placed_matrices(
    folder: Path, units: str, name: str, table: ComponentTable, mesh: SolidMesh, turn: np.ndarray
) -> tuple[tuple[sp.csr_matrix, sp.csr_matrix], np.ndarray]:
    """K and M over all nodes of a mesh, and which degrees of freedom they lack."""
    n = 3 * len(mesh.nodes)
    found: list[sp.csr_matrix] = []
    for key, factor in (("K", STIFFNESS.factor(units)), ("M", MASS.factor(units))):
        place: KeyPath = ("components", name, key)
        path = folder / str(getattr(table, key))
        try:
            A = factor * read_matrix(path)
        except ModelError as error:
            raise PlacedError(place, str(error)) from error
        skew = abs(A - A.T)
        if skew.nnz and skew.max() > SKEW * abs(A).max():
            raise PlacedError(place, f"{path.name} is not symmetric: is a half of it missing?")
        if found and A.shape != found[0].shape:
            raise PlacedError(
                place, f"{path.name} has {A.shape[0]} rows, {table.K} has {found[0].shape[0]}"
            )
        found.append(symmetric(A))
    rows = _freedoms(folder, name, table, mesh, found[0].shape[0])
    held = np.ones(n, dtype=bool)
    held[rows] = False
    turned = not np.array_equal(turn, np.eye(3))
    if turned and held.reshape(-1, 3).any(axis=1).any():
        raise PlacedError(
            ("components", name, "rotate"),
            "matrices without all three directions of every node cannot be turned: place the part "
            "before they are made",
        )
    to_nodes = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), (n, len(rows)))
    if turned:
        to_nodes = (sp.kron(sp.eye(len(mesh.nodes)), turn) @ to_nodes).tocsr()
    K, M = (symmetric(to_nodes @ A @ to_nodes.T) for A in found)
    return (K, M), held


def _freedoms(
    folder: Path, name: str, table: ComponentTable, mesh: SolidMesh, count: int
) -> np.ndarray:
    """Degree of freedom 3 * node + axis of each row of the matrices (count,)."""
    if table.dof is None:
        if count != 3 * len(mesh.nodes):
            raise PlacedError(
                ("components", name, "K"),
                f"{table.K} has {count} rows, but {table.nodes} has {len(mesh.nodes)} nodes, three "
                "rows each: give dof = FILE with 'node.direction' of each row",
            )
        return np.arange(count)
    keys: KeyPath = ("components", name, "dof")
    path = folder / table.dof
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError as error:
        raise PlacedError(keys, f"{path} cannot be read: {error.strerror or error}") from None
    node_at = {int(number): i for i, number in enumerate(mesh.numbers)}
    rows: list[int] = []
    seen: dict[int, int] = {}
    for at, text in enumerate(lines, start=1):
        if not text.strip():
            continue
        found = DOF.fullmatch(text)
        where = f"{path.name}, line {at}"
        if found is None:
            raise PlacedError(
                keys, f"{where}: expected 'node.direction', got '{text.strip()[:40]}'"
            )
        number, direction = int(found[1]), int(found[2])
        if number not in node_at:
            raise PlacedError(
                keys,
                f"{where}: {table.nodes} has no node {number}; its nodes are "
                f"{mesh.numbers.min()} to {mesh.numbers.max()}: is it the mesh of these matrices?",
            )
        if direction not in (1, 2, 3):
            raise PlacedError(
                keys, f"{where}: direction {direction}: expected 1, 2 or 3 (no rotations)"
            )
        row = 3 * node_at[number] + direction - 1
        if row in seen:
            raise PlacedError(keys, f"{where}: {text.strip()} is in line {seen[row]} already")
        seen[row] = at
        rows.append(row)
    if len(rows) < count:
        raise PlacedError(
            keys,
            f"row {len(rows) + 1} of {count} of {table.K} has no line in {path.name}, which has "
            f"{len(rows)}",
        )
    if len(rows) > count:
        raise PlacedError(
            keys, f"{path.name} has {len(rows)} lines, {table.K} has {count} rows only"
        )
    return np.array(rows)
