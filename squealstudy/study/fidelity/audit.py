"""The audit of a finished study: random points once more, by the next better settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.study.fidelity.ladders import BASIS, free_ladders, given_keys
from squealstudy.study.fidelity.scene import Scene
from squealstudy.study.fidelity.time_search import QUIET
from squealstudy.study.method import FULL
from squealstudy.study.plan import has_mesh

SEED = 5


@dataclass(frozen=True)
class Audit:
    """What the audit found.

    Attributes
    ----------
    error : float or None
        Largest, None where no point was audited.
    points : tuple of int
        Which, among the study's design points.
    against : str
        What they were solved by.
    """

    error: float | None
    points: tuple[int, ...]
    against: str


def audit(scene: Scene, changes: Mapping[str, Any], round_: int = 0) -> Audit:
    """Solve random points by the chosen settings and by better ones; other points each round.

    Complex modes are held against the full-order model; runs against half the step and, one after
    the other tried ladder, its next rung.
    """
    count = min(scene.section.audit, len(scene.plan.tasks))
    rng = np.random.default_rng([SEED, round_])
    drawn = tuple(int(i) for i in rng.permutation(len(scene.plan.tasks))[:count])
    better, against = _better(scene, changes)
    if not drawn or better is None:
        return Audit(None, (), against)
    made = scene.measure(_alone(scene, changes), drawn)
    truth = scene.measure(_alone(scene, {**changes, **better}), drawn)
    return Audit(scene.error(made, truth), drawn, against)


def _alone(scene: Scene, changes: Mapping[str, Any]) -> dict[str, Any]:
    return {**changes, **(QUIET if scene.in_time else {})}


def _better(scene: Scene, changes: Mapping[str, Any]) -> tuple[Mapping[str, Any] | None, str]:
    """Settings one rung up from the chosen ones, and in words; None where there are none."""
    if not scene.in_time:
        if not has_mesh(scene.study) and scene.variant(changes, None).method.name != FULL:
            return {"modes.method": "dense"}, "exact solves"
        return {"modes.method": FULL}, "the full-order model"
    better: dict[str, Any] = {}
    words = []
    for name, ladder in free_ladders(scene.study).items():
        keys = {key for rung in ladder.rungs for key in rung.changes}
        own = {k: changes[k] for k in keys if k in changes}
        if name == BASIS:
            if own:
                better |= {"transient.modes_below": None, "transient.pod_vectors": 0}
                words.append("all modes")
            continue
        at = [dict(r.changes) for r in ladder.rungs].index(own)
        if at + 1 < len(ladder.rungs):
            better |= ladder.rungs[at + 1].changes
            words.append(ladder.rungs[at + 1].label)
    if not better:  # all explicit: the step alone can be judged
        step = scene.study.definition.transient.step
        better, words = {"transient.step": 0.5 * step}, [f"step {0.5 * step:.3g} s"]
    return better, ", ".join(words)


def explicit(scene: Scene) -> list[str]:
    """Keys of the file that fidelity might have chosen otherwise."""
    given = given_keys(scene.study)
    return sorted(given & {"transient.step", "transient.modes_below", "model.contact_points"})
