"""A kind for million.py: complex modes of a task's points, all at once.

The matrices of Hulten's model in the normalised coordinates of the reduction are polynomials of
friction and the reciprocal speed. They are fitted to a few states that are assembled as ever, and
numpy takes the roots of all: ten times as fast as point by point. What a point comes to does not
depend on the others of its task.
What is left of a run's time is that of planning, naming, handing out, storing and tables.
"""

from __future__ import annotations

import itertools

import numpy as np

from squealstudy.engine.workers import Solved
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.problems import problem_of
from squealstudy.kinds.complex_modes.rows import solved_row
from squealstudy.kinds.complex_modes.screen import SCREEN
from squealstudy.kinds.complex_modes.solve_tasks import SolveTask
from squealstudy.modes.point import linearised_point
from squealstudy.modes.rungs import rung_named
from squealstudy.study.kinds import register_kind

FITTED = (0.1, 0.3, 0.8), (0.2, 0.5, 1.5)  # frictions and speeds of the states


class BatchedModes(ComplexModes):
    """Complex modes of Hulten's model over friction and sliding speed, many points at once."""

    name = "batched_modes"
    description = "complex modes of two degrees of freedom, many points at once"
    screen = SCREEN

    def solve(self, task: SolveTask) -> Solved:
        """Rows of the points of a task."""
        rung, first = rung_named(task.rung), task.points[0]
        problem = problem_of(task.structure, rung)
        prepared = problem.prepared
        state = first.with_values(first.values | named(FITTED[0][1], FITTED[1][1]))
        ((_, modes),) = rung.solve(problem, [state], task.box)
        row = solved_row("", 0.0, modes)  # what is not told by point is that of this state
        C, K = matrices(prepared, task)
        lam, psi = roots(C, K)
        low, high = (2 * np.pi * f for f in task.structure.band_hz)
        rows = prepared.shape_rows
        shapes = sum(rows[:, [j]] * psi[:, None, j] for j in range(rows.shape[1]))
        shapes = np.asarray(shapes, dtype=np.complex64)
        names = task.points.ids.astype(str).tolist()
        found_rows = []
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
            found_rows.append(found | {"shapes": np.ascontiguousarray(kept).tobytes()})
        return Solved(found_rows)


def matrices(prepared: object, task: SolveTask) -> tuple[np.ndarray, np.ndarray]:
    """Damping and stiffness (n, 2, 2) of the points of a task, masses normalised."""
    points = task.points
    terms = np.stack(polynomials(points.column("friction"), points.column("sliding_speed")))
    first, pairs = points[0], np.array(list(itertools.product(*FITTED)))
    known_terms = np.stack(polynomials(*pairs.T), axis=1)
    states = [first.with_values(first.values | named(*pair)).state() for pair in pairs.tolist()]
    systems = [linearised_point(prepared, state)[1] for state in states]
    found = []
    for name in ("C", "K"):
        known = np.array([getattr(system, name) for system in systems])
        fit, *_ = np.linalg.lstsq(known_terms, known.reshape(len(pairs), -1), rcond=None)
        off = np.abs(known_terms @ fit - known.reshape(len(pairs), -1)).max()
        if off > 1e-9 * np.abs(known).max():
            raise ValueError(f"{name} is no such polynomial")
        found.append(
            sum(x[:, None, None] * c.reshape(2, 2) for x, c in zip(terms, fit, strict=True))
        )
    return found[0], found[1]


def polynomials(mu: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
    """Of friction and speed (n,), that the matrices consist of."""
    return [np.ones(len(mu)), np.asarray(mu), 1 / v, mu / v]


def named(friction: float, speed: float) -> dict[str, float]:
    """A state by the names of its parameters."""
    return {"friction": friction, "sliding_speed": speed}


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
