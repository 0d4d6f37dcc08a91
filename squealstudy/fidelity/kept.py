"""Choices kept in the cache: the pilots of a study run once."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from squealstudy.engine.keys import NUMERIC_PACKAGES, content_hash, source_hash
from squealstudy.engine.store import write_json
from squealstudy.fidelity.choice import Choice, Combination, Neighbour, Untried
from squealstudy.fidelity.scene import Scene
from squealstudy.paths import cache_directory

CODE = (*NUMERIC_PACKAGES, "study", "engine", "kinds", "fidelity")


def kept_choice(scene: Scene, make: Callable[[], Choice]) -> Choice:
    """The choice of a scene, read where an earlier run made it, made and kept where not."""
    path = _path(scene)
    if path.is_file():
        return _read(json.loads(path.read_text(encoding="utf-8")))
    choice = make()
    write_json(path, asdict(choice))
    return choice


def _path(scene: Scene) -> Path:
    ids = [task.point_id for task in scene.plan.tasks]  # which know files and start states
    content = [source_hash(CODE), scene.base.tables, ids, scene.tolerance, scene.jobs]
    return cache_directory() / "fidelity" / f"{content_hash(content)}.json"


def _read(found: dict[str, Any]) -> Choice:
    cheaper, dearer = (_neighbour(found[name]) for name in ("cheaper", "dearer"))
    return Choice(_combination(found["chosen"]), cheaper, dearer, found["reason"])


def _neighbour(part: dict[str, Any]) -> Neighbour:
    return _combination(part) if "labels" in part else Untried(**part)


def _combination(part: dict[str, Any]) -> Combination:
    return Combination(**(part | {"labels": tuple(part["labels"])}))
