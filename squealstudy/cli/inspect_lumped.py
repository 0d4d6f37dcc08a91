"""What `squealstudy inspect` prints of a lumped model: masses, springs, contact, frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import RenderableType

from squealstudy.models.assembly import Assembly
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.lumped.build import LumpedBuild
from squealstudy.models.lumped.parts import PER_AREA, Coordinates
from squealstudy.models.lumped.tables import TRANSLATIONS, TURNS, Direction
from squealstudy.models.model_point import ModelPoint
from squealstudy.screen import Rows, facts, grid
from squealstudy.study.lumped import read_lumped
from squealstudy.wording import in_digits

RIGID_FREQUENCY_RATIO = 1e-6  # of the highest frequency: a motion that springs do not hold


def lumped_facts(path: Path) -> Iterator[RenderableType]:
    """Tables of masses, of what is between them, of frequencies and parameters, at the defaults.

    Raises
    ------
    StudyFileError
        About what is wrong in the file.
    """
    model = read_lumped(path)
    build = model.build
    assert isinstance(build, LumpedBuild)
    options = {option.name: option.choices[0] for option in model.options}
    assembly = ModelPoint(model, options, model.defaults()).assembly()
    yield facts([("model", model.description)])
    yield ""
    space = Coordinates(build.file)
    sizes = zip(space.names, assembly.M.diagonal(), strict=True)
    masses = ([mass, axis, f"{size:g} {_unit(axis)}"] for (mass, axis), size in sizes)
    yield grid("text:mass", "text:along", "text:size", rows=masses)
    yield ""
    titles = ("text:what", "text:between", "text:along", "text:size")
    yield grid(*titles, rows=_between(build, assembly))
    yield ""
    yield facts(_frequencies(assembly))
    rows = [
        (p.name, f"{p.default:g} {p.unit}".rstrip() + f"  {p.description}")
        for p in model.parameters
        if p.structural
    ]
    if rows:
        yield "\nparameters"
        yield facts(rows)


def _unit(axis: str) -> str:
    return "kg" if axis in TRANSLATIONS else "kg m2"


def _between(build: LumpedBuild, assembly: Assembly) -> Iterator[list[str]]:
    """Springs, dampers, contacts and loads, a row each."""
    file, contact = build.file, assembly.contact
    stiffness = {s.name: s.stiffness[0] for s in assembly.springs if isinstance(s, SpringInterface)}
    others = zip(contact.pairs[len(file.contact) :], contact.spring_points, strict=True)
    numbers = dict(others)
    for i, table in enumerate(file.spring):
        name = file.name_of("spring", i)
        unit = "N m/rad" if _turns(table.direction) else "N/m"
        if table.linear:
            size = f"{stiffness[name]:g} {unit}"
        else:
            k, cubic, gap, _ = numbers[name]
            size = f"{k:g} {unit}"
            size += f", {cubic:g} {unit}3" if cubic else ""
            size += f", gap {gap:g} {unit.partition('/')[2]}" if gap else ""
            size += f", {table.side}" if table.side != "both" else ""
        ends = " - ".join(table.between)
        yield [f"spring {name}", ends, _direction_text(table.direction), size]
    for damper_table, damper in zip(file.damper, assembly.dampers, strict=True):
        unit = "N m s/rad" if _turns(damper_table.direction) else "N s/m"
        ends = " - ".join(damper_table.between)
        size = f"{damper.damping[0]:g} {unit}"
        yield [f"damper {damper.name}", ends, _direction_text(damper_table.direction), size]
    for i, point in enumerate(file.contact):
        stiffness = contact.area[i] * PER_AREA
        size = f"{stiffness:g} N/m" if point.area is None else f"{contact.area[i]:g} m2"
        slides = f", slides {_direction_text(point.sliding)}" if point.sliding else ", no friction"
        name = f"contact {file.name_of('contact', i)}"
        yield [name, " - ".join(point.between), _direction_text(point.normal) + slides, size]
    for i, load in enumerate(file.load):
        size = f"{load.force} N" if load.area is None else f"pressure on {load.area} m2"
        yield [f"load {file.name_of('load', i)}", load.on, _direction_text(load.direction), size]


def _direction_text(direction: Direction) -> str:
    return direction if isinstance(direction, str) else f"[{', '.join(map(str, direction))}]"


def _turns(direction: Direction) -> bool:
    return isinstance(direction, str) and direction.removeprefix("-") in TURNS


def _frequencies(assembly: Assembly) -> Rows:
    """Of springs alone, and with linear contact that is closed and has no friction.

    Springs with a gap or of one side are closed with the contact; third powers are left out.
    """
    root = 1.0 / np.sqrt(assembly.M.diagonal())
    others = assembly.contact.spring_points
    touching = np.full(assembly.contact.n_points - len(others), PER_AREA)
    always = (others[:, 2] == 0.0) & (others[:, 3] == 0.0)
    tangent_of_springs = np.concatenate([0.0 * touching, np.where(always, others[:, 0], 0.0)])
    springs = (assembly.K_springs() + assembly.K_contact(tangent_of_springs)).toarray()
    tangent = np.concatenate([touching, others[:, 0]])
    closed = assembly.K_springs().toarray() + assembly.K_contact(tangent).toarray()
    rows: Rows = []
    for name, K in (("springs alone", springs), ("contact closed", closed)):
        squares = np.linalg.eigvalsh(root[:, None] * K * root)
        hz = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
        free = int((hz <= RIGID_FREQUENCY_RATIO * hz.max()).sum())
        texts = [f"{free} free"] if free else []
        texts += [f"{in_digits(f, 1)} Hz" for f in hz[free:]]
        rows.append((name, ", ".join(texts)))
    return rows
