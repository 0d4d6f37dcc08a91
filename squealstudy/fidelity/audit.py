"""The audit of a finished study: random points once more, by the next better settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.engine.plan import Plan
from squealstudy.engine.store import read_chunks
from squealstudy.fidelity.frequency_search import exact_method
from squealstudy.fidelity.ladders import BASIS, free_ladders
from squealstudy.fidelity.scene import Scene
from squealstudy.fidelity.time_search import ALL_MODES, QUIET
from squealstudy.modes.rungs import rung_named

SEED = 5


@dataclass(frozen=True)
class Audit:
    """What the audit found.

    Attributes
    ----------
    error : float or None
        Largest, None where no point could be audited.
    points : tuple of int
        Which, among the study's design points.
    against : str
        What they were solved by.
    """

    error: float | None
    points: tuple[int, ...]
    against: str


def drawn_points(scene: Scene, round_: int) -> tuple[int, ...]:
    """Random design points, others in each round."""
    count = min(scene.section.audit, len(scene.plan.tasks))
    rng = np.random.default_rng([SEED, round_])
    return tuple(int(i) for i in rng.permutation(len(scene.plan.tasks))[:count])


def audit(
    scene: Scene, plan: Plan, directory: Path, changes: Mapping[str, Any], points: Sequence[int]
) -> Audit:
    """Hold the study's own rows of some points against better settings.

    Complex modes against exact solves, of the brake at full order; runs against half the step,
    more contact points and all modes. Points that failed are left out.
    """
    better, against = _better(scene, changes)
    found = _own_findings(scene, plan, directory, points)
    usable = [i for i in points if found[i]["status"] == "ok"]
    if not usable:
        return Audit(None, (), against)
    quiet = QUIET if scene.in_time else {}
    truth = scene.measure({**changes, **better, **quiet}, usable).findings
    pairs = [(i, truth[str(n)]) for n, i in enumerate(usable)]
    kept = [(i, true) for i, true in pairs if true["status"] == "ok"]
    if not kept:
        return Audit(None, (), against)
    error = max(scene.point_error(found[i], true) for i, true in kept)
    return Audit(error, tuple(i for i, _ in kept), against)


def _own_findings(
    scene: Scene, plan: Plan, directory: Path, points: Sequence[int]
) -> dict[int, dict[str, Any]]:
    """What the finished study says of some of its points."""
    ids = {i: plan.tasks[i].point_id for i in points}
    schema = plan.kind.schema
    rows = read_chunks(directory, set(ids.values()), schema)
    read = scene.measuring.finding
    return {i: read(rows[name]) for i, name in ids.items()}


def _better(scene: Scene, changes: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Settings one rung up from the chosen ones, and in words."""
    if not scene.in_time:
        exact = exact_method(scene.study)
        words = "the full-order model" if rung_named(exact).unreduced else "exact solves"
        return {"modes.method": exact}, words
    better: dict[str, Any] = {}
    words_of = []
    for name, ladder in free_ladders(scene.study).items():
        keys = {key for rung in ladder.rungs for key in rung.changes}
        own = {k: changes[k] for k in keys if k in changes}
        if name == BASIS:
            better |= ALL_MODES if own else {}
            words_of += ["all modes"] if own else []
            continue
        at = [dict(r.changes) for r in ladder.rungs].index(own)
        if at + 1 < len(ladder.rungs):
            better |= ladder.rungs[at + 1].changes
            words_of.append(ladder.rungs[at + 1].label)
    if "transient.step" not in better:  # explicit, or the last rung
        step = 0.5 * float(changes.get("transient.step", scene.study.section.step))
        better["transient.step"] = step
        words_of.append(f"step {step:.3g} s")
    return better, ", ".join(words_of)
