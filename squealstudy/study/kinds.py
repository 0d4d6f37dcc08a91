"""The kinds of study there are."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from squealstudy.study.kind import Kind

KINDS = ("complex_modes", "transient", "sensitivity")
EXPERIMENTS = ("work_precision", "method_stability")  # studies of methods, not of brakes


def kind_named(name: str) -> Kind:
    """The kind of that name, as study files and manifests spell it; KeyError for another.

    Imported when it is asked for: a study pays for what it uses.
    """
    if name == "complex_modes":
        from squealstudy.study.complex_modes.kind import ComplexModes

        return ComplexModes()
    if name == "transient":
        from squealstudy.study.transient.kind import Transient

        return Transient()
    if name == "sensitivity":
        from squealstudy.study.sensitivity.kind import Sensitivities

        return Sensitivities()
    raise KeyError(name)
