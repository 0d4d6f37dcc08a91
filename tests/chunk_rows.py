"""A grid of Hulten's model, random modes of its points, and the chunk files that hold them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from study_runs import plan_of
from study_texts import study_text, sweep_text

from squealstudy.engine.plan import Plan
from squealstudy.engine.rows import failed_row
from squealstudy.engine.store import Store
from squealstudy.kinds.complex_modes.rows import SCHEMA, solved_row
from squealstudy.modes.point import PointModes

GRID = (
    study_text("grid", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.6, "{num}")
    + sweep_text("damping_ratio", 0.0, 0.02, "{lines}")
    + """\
[modes]
refine_tracking = false
refine_onsets = false
reference_points = 0
"""
)
HZ = 2 * np.pi


def grid(num: int = 4, lines: int = 3) -> Plan:
    return plan_of(GRID.format(num=num, lines=lines))


def random_modes(rng: np.random.Generator, m: int, k: int = 6, real: int = 0, **more) -> PointModes:
    """Random modes, the last `real` of them overdamped; no working point, as of matrix families."""
    lam = HZ * np.sort(rng.uniform(500, 8000, m)) * (1j - rng.uniform(-0.01, 0.02, m))
    lam[m - real :] = -rng.uniform(10, 100, real)
    shapes = rng.normal(size=(m, k)) + 1j * rng.normal(size=(m, k))
    modes = PointModes(
        lam,
        rng.uniform(size=m),
        rng.dirichlet(np.ones(2), m).T,
        shapes.astype(np.complex64),
        None,
        np.full(m, np.nan),
    )
    for name, value in more.items():
        object.__setattr__(modes, name, value)
    return modes


def write_chunks(
    directory: Path, plan: Plan, modes: dict[int, PointModes | None], size: int = 3
) -> None:
    """Chunk files of `size` points in reverse order; points of None failed."""
    ids = [task.point_id for task in plan.tasks]
    rows = [
        failed_row(SCHEMA, ids[i], "lift_off", "opened", 0.5)
        if m is None
        else solved_row(ids[i], 0.1, m)
        for i, m in sorted(modes.items(), reverse=True)
    ]
    for start in range(0, len(rows), size):
        Store(directory).write_rows(rows[start : start + size], SCHEMA)


def drifting_modes(plan: Plan, m: int, k: int = 12, real: int = 0) -> dict[int, PointModes]:
    """Modes of a study whose frequencies cross, growth with friction; then overdamped ones."""
    rng = np.random.default_rng(5)
    base, drift, shapes = (
        rng.uniform(600, 6000, m),
        rng.normal(size=(m, 2)),
        random_modes(rng, m, k),
    )
    found = {}
    for i, x in enumerate(plan.coordinates * [1.0, 50.0]):
        lam = HZ * base * (1 + 0.05 * drift @ x) * (1j + 0.01 * drift[:, 0] * x[0] - 0.001)
        order = np.argsort(np.abs(lam))
        noise = 0.05 * random_modes(rng, m, k).shapes
        overdamped = random_modes(rng, real, k, real)
        found[i] = PointModes(
            np.concatenate([lam[order], overdamped.lam]),
            np.zeros(m + real),
            np.full((2, m + real), 0.5),
            np.vstack([(shapes.shapes + noise)[order], overdamped.shapes]),
            None,
            np.full(m + real, np.nan),
        )
    return found
