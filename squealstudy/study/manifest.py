"""The manifest: the study as run, versions, hashes, threads, timings; and whose directory it is."""

from __future__ import annotations

import contextlib
import os
import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import squealstudy
from squealstudy.errors import ResultsError
from squealstudy.models.catalogue import MODELS
from squealstudy.study.plan import Plan
from squealstudy.study.results_manifest import read_manifest, version_of
from squealstudy.study.rounds import map_facts

LOCK = ".lock"
PACKAGES = (
    "numpy",
    "scipy",
    "pandas",
    "pyarrow",
    "numba",
    "joblib",
    "scikit-fem",
    "pydantic",
)


def new_manifest(plan: Plan, jobs: int) -> dict[str, Any]:
    """Manifest of a run that begins."""
    study = plan.study
    return {
        "status": "running",
        "name": study.definition.study.name,
        "kind": study.definition.study.kind,
        "model": study.model.name,
        "options": dict(study.options),
        **point_facts(plan),
        "band_hz": list(plan.band_hz),
        "parameters": list(study.shown_parameters),
        "sweeps": [s.parameter.name for s in study.sweeps],
        "units": {p: parameter_unit(plan, p) for p in study.shown_parameters} | torque_unit(plan),
        "nominal": {p: plan.nominal_values[p] for p in study.shown_parameters},
        "grid_shape": plan.grid_shape,
        "design": study.definition.design.model_dump(mode="json", exclude={"limit"}),
        "transient": plan.in_time[0] if plan.in_time else None,
        "regularisation": plan.regularisation,
        "study": study.text,
        "versions": versions(),
        "python": platform.python_version(),
        "machine": {"processor": platform.machine(), "cores": os.cpu_count()},
        "threads": {"workers": jobs, "blas_threads_a_worker": 1},
        "timings": {},
    }


def versions() -> dict[str, str]:
    """Versions of squealstudy and of what its numbers rest on."""
    return {"squealstudy": squealstudy.__version__} | {name: version(name) for name in PACKAGES}


def point_facts(plan: Plan) -> dict[str, Any]:
    """What a manifest says of the design points; it changes where a design grows."""
    facts = {
        "study_hash": plan.study_hash,
        "structures": [s.key for s in plan.structures],
        "basis_enriched": plan.enriched,
        "n_points": len(plan.tasks),
    }
    found = map_facts(plan)
    return facts if found is None else {**facts, "boundary": found}


def parameter_unit(plan: Plan, name: str) -> str:
    """Unit of a shown parameter; empty for a pure number."""
    plain = {p.name: p.unit for p in plan.study.model.parameters}
    return plain.get(name, "")


def torque_unit(plan: Plan) -> dict[str, str]:
    """Unit of the columns ``torque_*`` of a transient study; nothing of others."""
    if plan.study.definition.study.kind != "transient":
        return {}
    return {"torque": plan.study.model.torque_unit}


def check_ownership(directory: Path, plan: Plan) -> dict[str, Any] | None:
    """The manifest that is there, if this study may write here; raises as `check_owner`."""
    study = plan.study.definition.study
    return check_owner(directory, (study.name, study.kind, plan.study.model.name))


def check_owner(directory: Path, mine: tuple[str, str, str]) -> dict[str, Any] | None:
    """The manifest that is there, if a study of this (name, kind, model) may write here.

    Raises
    ------
    ResultsError
        Where the path is a file, the directory holds something else, or another study's results.
    """
    if directory.exists() and not directory.is_dir():
        raise ResultsError(f"{directory}: expected a directory for results, found a file")
    found = read_manifest(directory)
    if found is None:
        if directory.is_dir() and any(p.name != LOCK for p in directory.iterdir()):
            raise ResultsError(
                f"{directory}: the directory is not empty and holds no results of squealstudy; "
                "choose another with --output"
            )
        return None
    theirs = (found.get("name"), found.get("kind"), found.get("model"))
    if mine != theirs:
        raise ResultsError(
            f"{directory}: belongs to study '{theirs[0]}' ({theirs[1]}, {theirs[2]}), not to "
            f"'{mine[0]}' ({mine[1]}, {mine[2]}); choose another with --output"
        )
    return found


def outdated(directory: Path, found: dict[str, Any] | None) -> str:
    """Why a directory's numbers are not those of this version of squealstudy; empty if they are."""
    if found is None or found["model"] not in MODELS:
        return ""
    made_by = version_of(found)
    changes = MODELS[str(found["model"])].changed_since(made_by)
    if not changes:
        return ""
    what = "; ".join(change.what for change in changes)
    return f"{directory}: made by squealstudy {made_by}, since when {what}"


@contextlib.contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the directory for one run; ResultsError where another run holds it.

    The lock dies with its process, so a killed run never blocks the next.
    """
    import fcntl

    directory.mkdir(parents=True, exist_ok=True)
    with (directory / LOCK).open("w") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ResultsError(f"{directory}: another run is writing here") from error
        yield
