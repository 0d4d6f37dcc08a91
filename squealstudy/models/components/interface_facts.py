"""Sentences on contacts, layers, springs and couplings of a model file, in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from squealstudy.laws.own_friction import SLIDING
from squealstudy.models.components.component_facts import Inspection
from squealstudy.models.components.contact_friction import state_of, tangential_of
from squealstudy.models.components.dimensions import BEDDING, STIFFNESS, TORSION
from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.friction_factors import friction_factors
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import ModelFile, Numbers
from squealstudy.models.own_law import OF_CONTACT, law_parameter_named

IN_VIBRATION = "; in vibration only"  # not in the working point
DIRECTIONS = {"cartesian": ("x", "y", "z"), "cylindrical": ("radial", "around", "axial")}


def kind_of_contact(numbers: Numbers, number: int) -> str:
    """Behaviour of a contact in its plane: sliding, stuck or frictionless."""
    table = numbers.file.contact[number]
    if table.state is None:
        return str(table.kind)
    return "sliding" if state_of(numbers, number) == SLIDING else "stuck"


def friction_of(geometry: Geometry, numbers: Numbers, number: int) -> str:
    """Text on the friction of a contact, such as ", friction_factor 0.8"; empty where it has none.

    It has the contact's own friction coefficient and friction-law parameters, the direction of slip
    and the tangential stiffness of a contact with a state, and friction factors: a number, or
    "0.7 to 0.9 of mu.csv (mean 0.8)".
    """
    table, texts = numbers.file.contact[number], []
    if table.friction is not None:
        texts.append(f"friction {numbers.at('contact', number, 'friction'):g}")
    for key in table.friction_law:
        unit = law_parameter_named(key).unit
        text = f"{key} {numbers.at('contact', number, OF_CONTACT, key):g} {unit}"
        texts.append(text.rstrip())
    if table.sliding is not None:
        texts.append(f"slips along [{', '.join(f'{part:g}' for part in table.sliding)}]")
    if table.state is not None and table.tangential is not None:
        texts.append(f"stuck by {tangential_of(numbers, number):.3g} {BEDDING.unit} in plane")
    return "".join(f", {text}" for text in texts) + _factors_of(geometry, numbers, number)


def _factors_of(geometry: Geometry, numbers: Numbers, number: int) -> str:
    """Text on the friction factors of a contact; empty where it has none."""
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
    """Add a fact for each layer, spring and coupling to an inspection."""
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
    """Name and text of each spring of the model file."""
    for i, spring in enumerate(file.spring):
        axes = DIRECTIONS[spring.axes]
        text = f"spring: {' to '.join(spring.between)}, "
        text += _along(axes, numbers.list_at("spring", i, "stiffness"), STIFFNESS.unit)
        if spring.rotary is not None:
            turns = _along(axes, numbers.list_at("spring", i, "rotary"), TORSION.unit)
            text += f"; against turns {turns}"
        yield spring.name, text + IN_VIBRATION * (not spring.in_static)


def _along(axes: Iterable[str], sizes: Iterable[float], unit: str) -> str:
    """Text such as "radial 4e+07, around 4e+07, axial 2e+05 N/m"."""
    pairs = zip(axes, sizes, strict=True)
    return ", ".join(f"{axis} {size:.3g}" for axis, size in pairs) + f" {unit}"
