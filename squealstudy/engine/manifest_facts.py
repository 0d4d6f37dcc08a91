"""What the facts of a manifest must be, whoever wrote it: types, and names that stay inside.

A seal tells that a manifest is as it was written, not by whom. Facts that only one kind of study
writes are checked to be tables where they are; older versions have fewer of them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
)

from squealstudy.engine.result_names import FOLDER, PICTURE
from squealstudy.errors import ResultsError, printable

MOST_BYTES = 2**28  # of a manifest; one of 20,000 design points with checks has 2**20
Table = dict[str, Any]
Name = Annotated[str, StringConstraints(max_length=300)]


def _named(pattern: re.Pattern[str], what: str) -> AfterValidator:
    def check(name: str) -> str:
        if not pattern.fullmatch(name):
            raise ValueError(f"'{printable(name)[:100]}' is not the name of {what}")
        return name

    return AfterValidator(check)


PictureName = Annotated[str, _named(PICTURE, "a picture beside the tables")]
FolderName = Annotated[str, _named(FOLDER, "a folder below")]


class Facts(BaseModel):
    """Those that every reader relies on."""

    model_config = ConfigDict(extra="allow", strict=True)

    name: Name
    kind: Name
    model: Name
    status: Name = ""
    study_hash: Name = ""
    study: str = ""
    n_points: Annotated[int, Field(ge=0)] = 0
    n_failed: Annotated[int, Field(ge=0)] = 0
    n_inaccurate: Annotated[int, Field(ge=0)] = 0
    parameters: list[str] = []
    sweeps: list[str] = []
    units: dict[str, str] = {}
    nominal: dict[str, float] = {}
    options: dict[str, str | int] = {}
    tables: dict[str, list[str]] = {}
    versions: dict[str, str] = {}
    machine: Table = {}
    threads: Table = {}
    timings: Table = {}
    design: Table = {}
    model_file: Table = {}
    pictures: list[PictureName] = []
    beside: dict[FolderName, str] = {}
    extensions: list[Table] = []


def check_facts(content: Mapping[str, Any], path: Path) -> None:
    """Raise ResultsError naming the first fact of a manifest that is none."""
    try:
        Facts.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = printable(".".join(map(str, first["loc"])))
        raise ResultsError(
            f"{path}: not a manifest as squealstudy writes it: key '{place}': {first['msg']}"
        ) from None
