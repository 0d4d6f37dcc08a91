"""The kinds of study there are: those of the package, and those that extensions register."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from squealstudy.study.source import SourceText, extensions_of, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from squealstudy.study.kind import Kind
    from squealstudy.study.kind_screen import KindScreen
    from squealstudy.study.model_kind import ModelKind

# module and class of each: imported when it is asked for, a study pays for what it uses
PLACES = {
    "complex_modes": ("squealstudy.study.complex_modes.kind", "ComplexModes"),
    "transient": ("squealstudy.study.transient.kind", "Transient"),
    "sensitivity": ("squealstudy.study.sensitivity.kind", "Sensitivities"),
    "work_precision": ("squealstudy.kinds.work_precision.kind", "WorkPrecision"),
    "method_stability": ("squealstudy.kinds.method_stability.kind", "MethodStability"),
}
_known: dict[str, Kind] = {}


def kind_names() -> tuple[str, ...]:
    """Names of all kinds, as study files and manifests spell them."""
    return tuple(dict.fromkeys([*PLACES, *_known]))


def register_kind(kind: Kind) -> None:
    """Add a kind from outside the package; ValueError where another one has its name."""
    if kind.name in PLACES or type(_known.get(kind.name, kind)) is not type(kind):
        raise ValueError(f"there is a kind of study '{kind.name}' already")
    _known[kind.name] = kind


def kind_named(name: str) -> Kind:
    """The kind of that name; KeyError for another."""
    if name not in _known:
        module, kind = PLACES[name]
        _known[name] = getattr(import_module(module), kind)()
    return _known[name]


def model_kind(name: str) -> ModelKind:
    """The kind of that name, one that solves design points of a model; KeyError for another."""
    kind = kind_named(name)
    if kind.of_methods:
        raise KeyError(name)
    return cast("ModelKind", kind)


def kind_of_file(source: SourceText, tables: Mapping[str, Any]) -> Kind | None:
    """The kind that the tables of a study file name; None where they name none.

    Raises
    ------
    StudyFileError
        A kind that there is not.
    """
    extensions_of(source, tables)  # before kernels are imported: they may hold laws
    from squealstudy.study.parameters import did_you_mean

    study = tables.get("study")
    name = study.get("kind") if isinstance(study, dict) else None
    if not isinstance(name, str):
        return None
    names = kind_names()
    if name not in names:
        text = f"expected one of {', '.join(names)}, got {shown(name)}{did_you_mean(name, names)}"
        raise source.error(("study", "kind"), text)
    return kind_named(name)


def screen_of(name: str) -> KindScreen:
    """What is shown of results of a kind; KeyError for another.

    It is imported without what solves the kind's design points.
    """
    if name not in PLACES:
        return kind_named(name).screen
    module = PLACES[name][0].removesuffix("kind") + "screen"
    return cast("KindScreen", import_module(module).SCREEN)
