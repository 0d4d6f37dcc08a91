"""What layers, springs and couplings of a model file were understood as, SI units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from squealstudy.models.components.component_facts import Inspection
from squealstudy.models.components.dimensions import BEDDING, STIFFNESS, TORSION
from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.friction_factors import friction_factors
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import ModelFile, Numbers

IN_VIBRATION = "; in vibration only"  # not while the pressure is brought up
DIRECTIONS = {"cartesian": ("x", "y", "z"), "cylindrical": ("radial", "around", "axial")}


def friction_of(geometry: Geometry, numbers: Numbers, number: int) -> str:
    """`, friction_factor 0.8` of a contact that has one, or `0.7 to 0.9 of mu.csv (mean 0.8)`.

    `, friction 0.3` of one with a coefficient of its own.
    """
    if numbers.file.contact[number].friction is not None:
        return f", friction {numbers.at('contact', number, 'friction'):g}"
    written = numbers.file.contact[number].friction_factor
    if written is None:
        return ""
    factors = friction_factors(geometry, numbers, number)
    if not isinstance(written, FrictionTable):
        return f", friction_factor {factors[0]:g}"
    mean = np.average(factors, weights=geometry.contacts[number].slave.area)
    origin = written.file or "a random field"
    text = f"{factors.min():.4g} to {factors.max():.4g} of {origin} (mean {mean:.4g})"
    return f", friction_factor {text}"


def tell_interfaces(inspection: Inspection, numbers: Numbers) -> None:
    """Tell layers, springs and couplings."""
    file = numbers.file
    for name, text in (*_layers(file, numbers), *_springs(file, numbers)):
        inspection.tell(name, text)
    for i, coupling in enumerate(file.coupling):
        text = f"{coupling.kind} coupling: {coupling.node} holds {coupling.face}"
        if coupling.bedding is not None or ("coupling", i, "bedding") in numbers.given:
            text += f", {numbers.at('coupling', i, 'bedding'):.3g} {BEDDING.unit}"
        inspection.tell(coupling.name, text)


def _layers(file: ModelFile, numbers: Numbers) -> Iterator[tuple[str, str]]:
    for i, layer in enumerate(file.layer):
        normal, tangential = (numbers.at("layer", i, key) for key in ("normal", "tangential"))
        text = f"layer: {' to '.join(layer.between)}, normal {normal:.3g}, "
        text += f"in plane {tangential:.3g} {BEDDING.unit}"
        yield layer.name, text + IN_VIBRATION * (not layer.in_static)


def _springs(file: ModelFile, numbers: Numbers) -> Iterator[tuple[str, str]]:
    for i, spring in enumerate(file.spring):
        axes = DIRECTIONS[spring.axes]
        text = f"spring: {' to '.join(spring.between)}, "
        text += _along(axes, numbers.list_at("spring", i, "stiffness"), STIFFNESS.unit)
        if spring.rotary is not None:
            turns = _along(axes, numbers.list_at("spring", i, "rotary"), TORSION.unit)
            text += f"; against turns {turns}"
        yield spring.name, text + IN_VIBRATION * (not spring.in_static)


def _along(axes: Iterable[str], sizes: Iterable[float], unit: str) -> str:
    """`radial 4e+07, around 4e+07, axial 2e+05 N/m`."""
    pairs = zip(axes, sizes, strict=True)
    return ", ".join(f"{axis} {size:.3g}" for axis, size in pairs) + f" {unit}"
