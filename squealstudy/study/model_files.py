"""Model files of both sorts, of meshed components and of lumped models, told apart by content."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy.errors import StudyFileError
from squealstudy.models.components.definition import NAME as OF_MESHES
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.lumped.definition import NAME as LUMPED
from squealstudy.models.lumped.definition import TABLES_OF_FILE
from squealstudy.study.source import SourceText

if TYPE_CHECKING:
    from squealstudy.study.added_parts import AddedPart
    from squealstudy.study.sections import StudyDefinition

TABLES = " or ".join(f"[[{name}]]" for name in TABLES_OF_FILE)  # of a lumped model, for messages


def is_lumped(path: Path) -> bool:
    """Whether a file has [[mass]] or [[term]] and no [components]; False if it cannot be read."""
    try:
        tables = tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False
    return not tables.keys().isdisjoint(TABLES_OF_FILE) and "components" not in tables


def model_of_file(definition: StudyDefinition, source: SourceText) -> FileDefinition:
    """The model of a study's ``[model] file``.

    Raises
    ------
    StudyFileError
        About the study where it names no file, or one that does not exist; about the model file
        where that is wrong.
    """
    file_name = definition.model.file
    if file_name is None:
        text = f"model '{OF_MESHES}' is what a file describes: expected file = \"...\""
        raise source.error(("model", "name"), text)
    path = source.path.parent / file_name
    if not path.is_file():
        raise source.error(("model", "file"), f"there is no file {path}")
    for name in definition.model.family_keys:
        raise source.error(("model", name), f"unknown key of a model of a file: '{name}'")
    return read_model_file(path, definition.added_parts(source))


def read_model_file(path: Path, parts: Sequence[AddedPart] = ()) -> FileDefinition:
    """The model of a model file, with the parts that a study adds; StudyFileError where wrong."""
    if is_lumped(path):
        if parts:
            raise parts[0].error("a lumped model has no sets to add to")
        from squealstudy.study.lumped import read_lumped  # its tables take a while to import

        return read_lumped(path)
    from squealstudy.study.components import read_model  # imports scikit-fem

    return read_model(path, parts)


def named_by_content(tables: Mapping[str, Any], source: SourceText) -> Mapping[str, Any]:
    """A study's tables, with the name of lumped models in [model] where its file is one.

    Raises
    ------
    StudyFileError
        The study names a lumped model, but no file or one of another sort.
    """
    section = tables.get("model")
    if not isinstance(section, Mapping):
        return tables
    name, file = section.get("name"), section.get("file")
    lumped = isinstance(file, str) and is_lumped(source.path.parent / file)
    if name == LUMPED and not lumped:
        raise _no_lumped(file, source)
    if lumped and name is None:
        return {**tables, "model": {**section, "name": LUMPED}}
    return tables


def _no_lumped(file: object, source: SourceText) -> StudyFileError:
    """Error for a model file that is not of a lumped model."""
    if not isinstance(file, str):
        text = f"model '{LUMPED}' is what a file with {TABLES} describes: expected file = \"...\""
        return source.error(("model", "name"), text)
    path = source.path.parent / file
    if not path.is_file():
        return source.error(("model", "file"), f"there is no file {path}")
    text = f"expected a file with {TABLES}, {path} has neither"
    return source.error(("model", "file"), text)
