"""The manifest: the study as run, versions, hashes, threads, timings; and whose directory it is."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from squealstudy.engine.journal import JOURNAL, Journal
from squealstudy.engine.kind import Planned, as_kind
from squealstudy.engine.manifest_file import read_manifest, version_of
from squealstudy.engine.plan import Plan
from squealstudy.engine.recorded_code import RECORDS, recorded_extensions
from squealstudy.engine.result_names import (
    CHUNKS,
    HISTORIES,
    LOCK,
    MANIFEST,
    REFERENCES,
    RUN_FILES,
    SET_ASIDE,
    STATES,
    expect_inside,
)
from squealstudy.errors import ModelError, ResultsError
from squealstudy.files import TEMPORARY
from squealstudy.linalg.factor import MODULES
from squealstudy.machine.locks import HeldError, lock
from squealstudy.machine.resources import cores
from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue import MODELS
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.lumped.definition import NAME as LUMPED
from squealstudy.models.lumped.definition import LumpedDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import SLIDING_SPEED
from squealstudy.models.parameter import ModelDefinition
from squealstudy.parameter import Parameter
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.family import data_folder, file_digests
from squealstudy.study.tabled import knots_between
from squealstudy.version import __version__

SIDE_STUDIES = "beside"  # key: folders of studies run with it, and why one could not be
MATRICES_FOLDER = "matrices_folder"  # key: where the files of own matrices are
MATRIX_FILES = "matrix_files"  # key: hashes of these files, one for each term
FINISHED_AT = "finished_at"  # key: when the tables were written, UTC
PACKAGES = (
    "numpy",
    "scipy",
    "pandas",
    "pyarrow",
    "numba",
    "scikit-fem",
    "pydantic",
)


def new_manifest(plan: Planned, jobs: int) -> dict[str, Any]:
    """Manifest of a run that begins."""
    name, kind, model = plan.owner
    return {
        "status": "running",
        "name": name,
        "kind": kind,
        "model": model,
        **identity_facts(plan),
        "parameters": [],
        "sweeps": [],
        "units": {},
        **as_kind(plan.kind).manifest(plan),
        "versions": versions(),
        "python": platform.python_version(),
        "machine": {"processor": platform.machine(), "cores": cores()},
        "threads": {"workers": jobs, "blas_threads_a_worker": 1},
        "timings": {},
    }


def identity_facts(plan: Planned) -> dict[str, Any]:
    """Hash and number of the design points; they change where a design grows."""
    return {"study_hash": plan.study_hash, "n_points": len(plan.tasks)}


def versions() -> dict[str, str]:
    """Versions of squealstudy and of what its numbers rest on."""
    return {"squealstudy": __version__} | _installed()


@cache
def _installed() -> dict[str, str]:
    """Versions of packages, whose metadata are read once a process."""
    factors = (name for name in MODULES.values() if find_spec(name))
    return {name: version(name) for name in (*PACKAGES, *factors)}


def model_facts(plan: Plan) -> dict[str, Any]:
    """Facts of a study's model in the manifest: its parameters, design and structures."""
    study, parameters = plan.study, plan.study.shown_parameters
    followed = [t.name for t in study.model.tables]
    units = {p.name: p.unit for p in study.model.parameters}
    return {
        "options": dict(study.options),
        "structures": list(plan.structures),
        "basis_enriched": plan.enriched,
        "band_hz": list(plan.band_hz),
        "parameters": list(parameters),
        "sweeps": [s.parameter.name for s in study.sweeps],
        # empty for a pure number
        "units": {p: units.get(p, "") for p in (*parameters, *followed)},
        "nominal": {p: plan.nominal_values[p] for p in parameters},
        "tables": {t.name: list(t.over) for t in study.model.tables},
        "knots_between": knots_between(study.model.tables, study.sweeps),
        **_rotation(plan),
        "grid_shape": plan.grid_shape,
        "design": study.definition.design.model_dump(mode="json", exclude={"limit"}),
        "study": study.source.text,
        RECORDS: recorded_extensions(study.extensions),
        **_model_file(study),
        **_matrices(study),
    }


def _matrices(study: ResolvedStudy) -> dict[str, Any]:
    """Folder of the files of a matrix family, as the results may be elsewhere, and their hashes."""
    if not isinstance(study.model, FamilyDefinition):
        return {}
    folder = data_folder(study.definition.model, study.source.path)
    digests = file_digests(study.model, study.source)
    return {MATRICES_FOLDER: str(folder.resolve()), MATRIX_FILES: digests}


def _rotation(plan: Plan) -> dict[str, Any]:
    """Radius [m] of the sliding speed and rotation [rad/s] of a model that turns, nominal."""
    values = plan.nominal_values
    radius = plan.study.model.effective_radius(plan.study.options, values)
    if radius is None:
        return {}
    speed = values[SLIDING_SPEED.name] / radius
    return {"rotation": {"effective_radius": radius, "rotation_speed": speed}}


def _model_file(study: ResolvedStudy) -> dict[str, Any]:
    """Description of a model file, as the catalogue has it of its models."""
    model = study.model
    if not isinstance(model, FileDefinition):
        return {}
    from squealstudy.study.preparations import preparations  # meshes are slow to load

    content = {
        "path": model.path,
        "files": list(model.files),
        "defaults": model.defaults(),
        "components": list(model.components),
        "prepared": list(preparations(study)),
    }
    return {"model_file": content}


def model_of(manifest: Mapping[str, Any]) -> ModelDefinition:
    """The model of results: its parameters, their defaults, its components."""
    model_facts = manifest.get("model_file")
    if model_facts is None:
        if (model := str(manifest["model"])) not in MODELS:
            raise ResultsError(f"results of a model '{model}', which is not known here")
        return MODELS[model]
    parameters = tuple(Parameter(n, float(v), "", "") for n, v in model_facts["defaults"].items())
    components = tuple(model_facts["components"])
    name = str(manifest["model"])
    sort = LumpedDefinition if name == LUMPED else FileDefinition
    return sort(name, "", (), parameters, components, _not_built, path=model_facts["path"])


def _not_built(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, float],  # noqa: ARG001
) -> Assembly:
    raise ModelError("results do not hold the files of their model")


def check_owner(
    directory: Path, mine: tuple[str, str, str], journal: Journal | None = None
) -> dict[str, Any] | None:
    """The manifest that is there, if a study of this (name, kind, model) may write here.

    None where there is none yet, or where it is damaged and the journal tells whose it is. The
    journal is read where it is not given.

    Raises
    ------
    ResultsError
        Where the path is a file, the directory holds something else, or another study's results,
        or where nobody can tell whose they are.
    """
    if directory.exists() and not directory.is_dir():
        raise ResultsError(f"{directory}: expected a directory for results, found a file")
    _expect_no_way_out(directory)
    begun_by = (journal or Journal(directory)).owner
    try:
        manifest = read_manifest(directory)
    except ResultsError as error:
        if begun_by is None:
            raise ResultsError(f"{error}; choose another directory with --output") from error
        manifest = None  # the journal tells whose it is
    if manifest is not None:
        theirs = manifest["name"], manifest["kind"], manifest["model"]
    elif begun_by is not None:
        theirs = begun_by
    elif directory.is_dir() and (foreign := sorted(filter(_foreign, directory.iterdir()))):
        raise ResultsError(
            f"{directory}: the directory is not empty ({foreign[0].name}) and holds no results of "
            "squealstudy; choose another with --output"
        )
    else:
        return None
    if mine != theirs:
        raise ResultsError(
            f"{directory}: belongs to study '{theirs[0]}' ({theirs[1]}, {theirs[2]}), not to "
            f"'{mine[0]}' ({mine[1]}, {mine[2]}); choose another with --output"
        )
    return manifest


def _expect_no_way_out(directory: Path) -> None:
    """Raise ResultsError where a link would have a run write outside its directory."""
    folders = (CHUNKS, HISTORIES, STATES, REFERENCES)
    aside = (f"{SET_ASIDE}/{folder}" for folder in folders)
    tables = (path.name for path in directory.glob("*.parquet"))
    for name in (MANIFEST, JOURNAL, LOCK, *folders, SET_ASIDE, *aside, *tables):
        if (directory / name).is_symlink():
            expect_inside(directory, name)


def _foreign(path: Path) -> bool:
    """Whether no run can have left this that was killed early, or whose directory was removed."""
    if path.is_dir():
        below = [p.relative_to(path.parent).as_posix() for p in path.rglob("*") if p.is_file()]
        return not below or not all(map(RUN_FILES.fullmatch, below))
    return path.name not in (LOCK, JOURNAL) and not path.match(TEMPORARY)


def outdated(directory: Path, manifest: dict[str, Any] | None) -> str:
    """Why a directory's numbers are not those of this version of squealstudy; empty if they are."""
    if manifest is None or manifest["model"] not in MODELS:
        return ""
    made_by = version_of(manifest)
    changes = MODELS[str(manifest["model"])].changed_since(made_by)
    if not changes:
        return ""
    what = "; ".join(change.what for change in changes)
    return f"{directory}: made by squealstudy {made_by}, since when {what}"


@contextlib.contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Hold the directory for one run; ResultsError where another run holds it.

    The lock dies with its process, so a killed run never blocks the next.
    """
    try:
        with lock(directory / LOCK, wait=False):
            yield
    except HeldError as error:
        raise ResultsError(f"{directory}: another run is writing here") from error
