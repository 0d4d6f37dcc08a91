"""A kind for million.py: complex modes of a task's points, all at once.

The matrices of Hulten's model in the normalised coordinates of the reduction are polynomials of
friction and the reciprocal speed. They are fitted to a few points of a task that are solved as
ever, checked at another, and numpy takes the roots of all: ten times as fast as point by point.
What is left of a run's time is that of planning, naming, handing out, storing and tables.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from squealstudy.engine.workers import Solved
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.problems import problem_of
from squealstudy.kinds.complex_modes.screen import SCREEN
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.modes.point import linearised_point
from squealstudy.modes.rungs import rung_named
from squealstudy.study.kinds import register_kind

FITTED = 8  # points whose matrices are assembled; the last one checks the others


class BatchedModes(ComplexModes):
    """Complex modes of Hulten's model over friction and sliding speed, many points at once."""

    name = "batched_modes"
    description = "complex modes of two degrees of freedom, many points at once"
    screen = SCREEN

    def solve(self, task: SolveTask) -> Solved:
        """Rows of the points of a task."""
        (row,) = super().solve(replace(task, points=task.points[:1])).rows
        prepared = problem_of(task.structure, rung_named(task.rung)).prepared
        C, K = matrices(prepared, task)
        lam, psi = roots(C, K)
        low, high = (2 * np.pi * f for f in task.structure.band_hz)
        shapes = np.einsum("ij,njk->nik", prepared.shape_rows, psi).astype(np.complex64)
        names = task.points.ids.astype(str).tolist()
        rows = []
        for name, own, of in zip(names, lam, shapes, strict=True):
            inside = (np.abs(own) >= low) & (np.abs(own) <= high)
            found = row | {"point_id": name, "re": own.real[inside], "im": own.imag[inside]}
            count = int(inside.sum())
            found["overdamped"] = np.zeros(count, dtype=bool)
            for key in ("residual", "error_rung"):
                found[key] = np.full(count, row[key].max())
            energies = row["energies"].reshape(len(row["re"]), -1)
            found["energies"] = np.resize(energies, (count, energies.shape[1])).ravel()
            kept = of.T[inside]
            kept /= np.linalg.norm(kept, axis=1, keepdims=True)
            rows.append(found | {"shapes": np.ascontiguousarray(kept).tobytes()})
        return Solved(rows)


def matrices(prepared: object, task: SolveTask) -> tuple[np.ndarray, np.ndarray]:
    """Damping and stiffness (n, 2, 2) of the points of a task, masses normalised."""
    points = task.points
    mu, v = points.column("friction"), points.column("sliding_speed")
    terms = np.stack([np.ones(len(points)), mu, 1 / v, mu / v], axis=1)
    chosen = np.unique(np.linspace(0, len(points) - 1, FITTED).astype(int))
    systems = [linearised_point(prepared, points[int(i)].state())[1] for i in chosen]
    found = []
    for name in ("C", "K"):
        known = np.array([getattr(system, name) for system in systems])
        fit, *_ = np.linalg.lstsq(terms[chosen], known.reshape(len(chosen), -1), rcond=None)
        told = (terms @ fit).reshape(-1, *known.shape[1:])
        if not np.allclose(told[chosen], known, rtol=0, atol=1e-9 * np.abs(known).max()):
            raise ValueError(f"{name} is no such polynomial")
        found.append(told)
    return found[0], found[1]


def roots(C: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The two oscillating roots (n, 2) of each pencil with unit masses, and vectors (n, 2, 2)."""
    n = len(C)
    companion = np.zeros((n, 4, 4))
    companion[:, :2, 2:] = np.eye(2)
    companion[:, 2:, :2], companion[:, 2:, 2:] = -K, -C
    lam, z = np.linalg.eig(companion)
    order = np.argsort(np.where(lam.imag > 0, np.abs(lam), np.inf), axis=1, kind="stable")[:, :2]
    lam = np.take_along_axis(lam, order, axis=1)
    if not (lam.imag > 0).all():
        raise ValueError("a root does not oscillate")
    return lam, np.take_along_axis(z[:, :2], order[:, None], axis=2)


register_kind(BatchedModes())
