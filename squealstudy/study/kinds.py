"""The kinds of study there are."""

from __future__ import annotations

from squealstudy.study.complex_modes.kind import ComplexModes
from squealstudy.study.kind import Kind
from squealstudy.study.sensitivity.kind import Sensitivities
from squealstudy.study.transient.kind import Transient

KINDS: dict[str, Kind] = {
    "complex_modes": ComplexModes(),
    "transient": Transient(),
    "sensitivity": Sensitivities(),
}


def kind_named(name: str) -> Kind:
    """The kind of that name, as study files and manifests spell it."""
    return KINDS[name]
