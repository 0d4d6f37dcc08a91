"""Types of the facts in a manifest, by which every manifest is checked at all depths.

A seal shows that a manifest has not changed, not who wrote it. Facts of all studies are here; those
of a kind are FACTS in ``facts.py`` of its folder. Other facts are never read. Older versions of
squealstudy have fewer facts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, Field, ValidationError

from squealstudy.engine.fact_types import Count, FactGroup, Finite, Name, Positive, Range, Text
from squealstudy.engine.result_names import FOLDER, PICTURE
from squealstudy.errors import ResultsError, printable
from squealstudy.study.kinds import facts_of

MAX_BYTES = 2**28  # of a manifest; one of 20,000 design points with checks has 2**20
Table = dict[str, Any]


def _name_pattern(pattern: re.Pattern[str], noun: str) -> AfterValidator:
    def check(name: str) -> str:
        if not pattern.fullmatch(name):
            raise ValueError(f"'{printable(name)[:100]}' is not the name of {noun}")
        return name

    return AfterValidator(check)


Megabytes = Annotated[float, Field(ge=0.0, le=1e12, allow_inf_nan=False)]
PictureName = Annotated[str, _name_pattern(PICTURE, "a picture beside the tables")]
FolderName = Annotated[str, _name_pattern(FOLDER, "a folder below")]


class DesignFacts(FactGroup):
    """The design: how the design points are chosen."""

    type: Name = "grid"
    samples: Count | None = None
    seed: Count | None = None
    levels: Count | None = None


class ModelFileFacts(FactGroup):
    """A model from a file: hashes of its files, defaults and components."""

    path: Name
    files: list[Name]
    defaults: dict[str, Finite]
    components: list[Name]
    prepared: list[Text] = Field(default_factory=list)  # older results have none


class RotationFacts(FactGroup):
    """Facts of a model that turns."""

    effective_radius: Finite
    rotation_speed: Finite


class SharedFacts(FactGroup):
    """One basis over a range of structures."""

    range: Text
    used: bool
    error: Finite | None
    reductions: Count = 0


class CodeFacts(FactGroup):
    """A file of code that results were made with."""

    name: Name
    hash: Annotated[str, Field(pattern=r"^[0-9a-zA-Z]{1,128}$")]
    sources: dict[str, str] = Field(default_factory=dict)


class Setting(FactGroup):
    """A setting that [fidelity] chose, or the next cheaper or dearer one."""

    settings: Text | None = None
    reason: Text = ""
    estimated_error: float | None = None
    seconds: Finite | None = None


class ChosenSetting(Setting):
    """The chosen setting, whose text and error are always known."""

    settings: Text
    estimated_error: float
    seconds: Finite


class FidelityAudit(FactGroup):
    """Design points of a finished study that were solved by the reference."""

    error: float | None
    passed: bool
    points: list[Any]
    against: Text


class FidelityFacts(FactGroup):
    """The settings that [fidelity] chose, and their neighbours."""

    chosen: ChosenSetting
    cheaper: Setting
    dearer: Setting
    reason: Text
    tolerance: Positive
    audit: FidelityAudit | None = None


class Timings(FactGroup):
    """Seconds of stages, and counts of what was solved in them."""

    total_s: Finite | None = None


class Facts(FactGroup):
    """The facts that every kind of study has."""

    name: Name
    kind: Name
    model: Name
    status: Name = ""
    finished_at: Name = ""
    study_hash: Name = ""
    study: str = ""
    n_points: Count = 0
    n_failed: Count = 0
    n_inaccurate: Count = 0
    parameters: list[Name] = Field(default_factory=list)
    sweeps: list[Name] = Field(default_factory=list)
    units: dict[str, Name] = Field(default_factory=dict)
    nominal: dict[str, Finite] = Field(default_factory=dict)
    options: dict[str, str | int] = Field(default_factory=dict)
    tables: dict[str, list[Name]] = Field(default_factory=dict)
    knots_between: dict[str, list[Finite]] = Field(default_factory=dict)
    structures: list[Name] = Field(default_factory=list)
    basis_enriched: bool = False
    band_hz: Range | None = None
    grid_shape: list[Count] | None = None
    versions: dict[str, Name] = Field(default_factory=dict)
    python: Name = ""
    machine: dict[str, str | int] = Field(default_factory=dict)
    threads: dict[str, str | int] = Field(default_factory=dict)
    timings: Timings = Timings()
    peak_memory_mb: dict[str, Megabytes] = Field(default_factory=dict)
    design: DesignFacts = DesignFacts()
    model_file: ModelFileFacts | None = None
    matrices_folder: Text = ""
    matrix_files: list[Name] = Field(default_factory=list)
    rotation: RotationFacts | None = None
    shared_basis: SharedFacts | None = None
    fidelity: FidelityFacts | None = None
    pictures: list[PictureName] = Field(default_factory=list)
    beside: dict[FolderName, Text] = Field(default_factory=dict)
    extensions: list[CodeFacts] = Field(default_factory=list)


def check_facts(content: Mapping[str, Any], path: Path) -> None:
    """Raise ResultsError about the first wrong fact of a manifest."""
    kinds = facts_of(str(content.get("kind")))
    for model in (Facts, kinds) if kinds else (Facts,):
        _check(model, content, path)
    if nulls := sorted(key for key in NEVER_NULL if key in content and content[key] is None):
        raise _no_fact(path, nulls[0], "null is no value of it")


# facts that may be absent, but not null: readers test for their keys
NEVER_NULL = ("band_hz", "model_file", "rotation", "shared_basis", "fidelity")


def _check(model: type[BaseModel], content: Mapping[str, Any], path: Path) -> None:
    try:
        model.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise _no_fact(path, ".".join(map(str, first["loc"])), first["msg"]) from None


def _no_fact(path: Path, key: str, why: str) -> ResultsError:
    text = f"key '{printable(key)[:200]}': {printable(why)[:300]}"
    return ResultsError(f"{path}: not a manifest as squealstudy writes it: {text}")
