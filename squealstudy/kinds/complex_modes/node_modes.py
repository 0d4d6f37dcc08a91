"""Modes at the finished nodes of a map, with shapes that can be compared between nodes."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la

from squealstudy.engine.cache import prepared_any
from squealstudy.engine.plan import Plan
from squealstudy.engine.store import Store
from squealstudy.kinds.complex_modes.passing_modes import Node, NodeModes
from squealstudy.kinds.complex_modes.rows import ModeColumns, read_columns
from squealstudy.reduction.prepared import PreparedFamily


class FinishedNodes:
    """Oscillating modes of the points of a boundary design, all of which are finished.

    Parameters
    ----------
    plan : Plan
        Plan of the points.
    store : Store
        Store with the chunk files of all these points.
    nodes : list of Node
        Nodes of the plan's points, in their order.
    """

    def __init__(self, plan: Plan, store: Store, nodes: list[Node]) -> None:
        self._plan, self._store = plan, store
        self._row = {node: row for row, node in enumerate(nodes)}

    def __call__(self, node: Node) -> NodeModes | None:
        """Modes of a node; None where it failed or is inaccurate."""
        row, columns = self._row[node], self._columns
        if columns.shapes is None or self._status[row] != "ok":
            return None
        count = int(self._counts[row])
        to_orthogonal, to_seen = self._coordinates(self._plan.tasks[row].structure)
        raw = np.zeros((0, len(to_orthogonal)), dtype=complex)  # no mode in the band
        if count:
            raw = columns.shapes.read(row)[:count].astype(complex)
        lam = columns.lam[self._starts[row] : self._starts[row] + count]
        return NodeModes(lam, raw @ to_orthogonal, raw @ to_seen)

    def close(self) -> None:
        """Remove the temporary file of shapes, if it was written."""
        if "_columns" in self.__dict__ and self._columns.shapes is not None:
            self._columns.shapes.remove()

    @cached_property
    def _columns(self) -> ModeColumns:
        """Results of all points, with their shapes."""
        return read_columns(
            self._store, self._plan.tasks.ids, largest_error=self._plan.method.largest_error
        )

    @cached_property
    def _status(self) -> list[str]:
        status: list[str] = self._columns.points["status"].to_pylist()
        return status

    @cached_property
    def _starts(self) -> np.ndarray:
        counts = self._columns.counts
        starts: np.ndarray = np.cumsum(counts) - counts
        return starts

    @cached_property
    def _counts(self) -> np.ndarray:
        """Number of oscillating modes (n,) of each point; they come before the real roots."""
        return self._columns.oscillating().counts

    def _coordinates(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        """Matrices that turn a structure's shapes into `shapes` and `seen` of NodeModes."""
        if self._plan.stacked:
            identity = np.eye(self._plan.first.assembly().n_dof)
            return identity, identity
        if key not in self._matrices:
            prepared = prepared_any(key)
            if isinstance(prepared, PreparedFamily):
                M, _, _ = prepared.model.matrices(self._plan.nominal_values)
                basis = (
                    prepared.shape_basis
                    / np.where(prepared.scale > 0, prepared.scale, np.inf)[:, None]
                )
                mass = basis.T @ (M @ basis)
                mass_root = _root(mass)
                self._matrices[key] = mass_root, mass_root
            else:
                sensors = prepared.sensor_shapes
                self._matrices[key] = np.eye(sensors.shape[1]), sensors.T
        return self._matrices[key]

    @cached_property
    def _matrices(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """The matrices of `_coordinates` by structure, each made once."""
        return {}


def _root(mass: np.ndarray) -> np.ndarray:
    """L with L L^T = mass (k, k); the identity where the mass matrix is not positive definite."""
    try:
        root: np.ndarray = la.cholesky((mass + mass.T) / 2, lower=True)
    except la.LinAlgError:
        return np.eye(len(mass))
    return root
