"""The register of kinds of study: those of the package, and those of extensions."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, cast

from squealstudy.columns import register_columns
from squealstudy.extensions import note_registered
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.source import SourceText, extensions_of, not_registered
from squealstudy.wording import shown

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from pydantic import BaseModel

    from squealstudy.study.kind_protocols import ModelStudyKind, ScreenFacts, StudyKind

FOLDER = "squealstudy.kinds"  # a higher layer: its modules are imported by name, on demand
_registered: dict[str, StudyKind] = {}


@cache
def _folders() -> tuple[str, ...]:
    """Names of the kinds of the package, each of which is a folder."""
    return tuple(
        module_info.name
        for module_info in iter_modules(import_module(FOLDER).__path__)
        if module_info.ispkg
    )


def kind_names() -> tuple[str, ...]:
    """Names of all kinds, as study files and manifests spell them."""
    return (*_folders(), *_registered)


def register_kind(kind: StudyKind) -> None:
    """Add a kind from outside the package.

    Parameters
    ----------
    kind : StudyKind
        An instance of a class derived from `ModelKind`.

    Raises
    ------
    ValueError
        Another kind has its name.
    """
    registered = _registered.get(kind.name, kind)
    if kind.name in _folders() or type(registered) is not type(kind):
        raise ValueError(f"there is a kind of study '{kind.name}' already")
    _registered[kind.name] = kind
    register_columns(kind.name, kind.columns)
    note_registered(type(kind).__module__)


def kind_named(name: str) -> StudyKind:
    """The kind of that name; KeyError for another."""
    if name in _registered:
        return _registered[name]
    if name not in _folders():
        raise KeyError(name)
    return cast("StudyKind", import_module(f"{FOLDER}.{name}.kind").KIND)


def definition_of(name: str) -> type[BaseModel]:
    """Sections of a kind's study files, without its solver; KeyError for an unknown kind."""
    if name not in _folders():
        return kind_named(name).definition
    section = file_of_kind(name, "section")
    return StudyDefinition if section is None else section.DEFINITION


def facts_of(name: str) -> type[BaseModel] | None:
    """Type of the facts in a manifest of a kind; None where the kind states none."""
    facts = file_of_kind(name, "facts")
    return None if facts is None else facts.FACTS


def file_of_kind(kind: str, name: str) -> ModuleType | None:
    """A module in the folder of a kind of the package; None without one."""
    path = f"{FOLDER}.{kind}.{name}"
    return import_module(path) if kind in _folders() and find_spec(path) else None


def model_kind(name: str) -> ModelStudyKind:
    """The kind of that name, one that solves design points of a model; KeyError for another."""
    kind = kind_named(name)
    if kind.of_methods:
        raise KeyError(name)
    return cast("ModelStudyKind", kind)


def kind_of_file(source: SourceText, tables: Mapping[str, Any]) -> StudyKind | None:
    """The kind that a study file names; None where it names none.

    Executes the extensions of the study first.

    Raises
    ------
    StudyFileError
        There is no such kind, or an extension fails.
    """
    extensions_of(source, tables)  # before kernels are imported: they may hold laws
    from squealstudy.wording import did_you_mean

    study = tables.get("study")
    name = study.get("kind") if isinstance(study, dict) else None
    if not isinstance(name, str):
        return None
    names = kind_names()
    if name not in names:
        hint = did_you_mean(name, names) or not_registered(tables, name)
        text = f"expected one of {', '.join(names)}, got {shown(name)}{hint}"
        raise source.error(("study", "kind"), text)
    return kind_named(name)


def screen_of(name: str) -> ScreenFacts:
    """Screen of results of a kind; KeyError for an unknown kind.

    For a kind of the package, this does not import the code that solves design points.
    """
    if name not in _folders():
        return kind_named(name).screen
    return cast("ScreenFacts", import_module(f"{FOLDER}.{name}.screen").SCREEN)
