"""Text of `squealstudy inspect` for a lumped model: masses, springs, contact, frequencies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import scipy.linalg
from rich.console import RenderableType

from squealstudy.laws.own_friction import STATES
from squealstudy.models.assembly import Assembly
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.lumped.build import LumpedBuild
from squealstudy.models.lumped.masses import MassSpace
from squealstudy.models.lumped.matrix_tables import ContactOn, DamperOn, LoadOn, Motion, SpringOn
from squealstudy.models.lumped.number_types import Direction, Number
from squealstudy.models.lumped.parts import PER_AREA
from squealstudy.models.lumped.tables import (
    TRANSLATIONS,
    TURNS,
    ContactTable,
    DamperTable,
    LoadTable,
    SpringTable,
)
from squealstudy.models.model_point import ModelPoint
from squealstudy.screen import Rows, facts, grid
from squealstudy.study.lumped import read_lumped
from squealstudy.wording import in_digits

MOST_FREQUENCIES = 12  # most frequencies in a list
RIGID_FREQUENCY_RATIO = 1e-6  # frequency over the highest below which a motion is free


def lumped_facts(path: Path) -> Iterator[RenderableType]:
    """Tables of masses, of springs, contacts and so on, of frequencies and of parameters.

    All values are at the defaults of the parameters.

    Raises
    ------
    StudyFileError
        The file is wrong.
    """
    model = read_lumped(path)
    build = model.build
    assert isinstance(build, LumpedBuild)
    options = {option.name: option.choices[0] for option in model.options}
    assembly = ModelPoint(model, options, model.defaults()).assembly()
    yield facts([("model", model.description)])
    yield ""
    yield _structure(build, assembly)
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


def _structure(build: LumpedBuild, assembly: Assembly) -> RenderableType:
    """Table of masses, or of matrices, one row each."""
    space = build.space
    if isinstance(space, MassSpace):
        sizes = zip(space.names, assembly.M.diagonal(), strict=True)
        masses = [[mass, axis, f"{size:g} {_unit(axis)}"] for (mass, axis), size in sizes]
        spinning = [t for t in space.file.mass if t.spin is not None]
        masses += [[t.name, _text(t.spin_axis), f"spin {t.spin} kg m2 rad/s"] for t in spinning]
        return grid("text:mass", "text:along", "text:size", rows=masses)
    of_all = f"{space.n} x {space.n}"
    terms = ([t.matrix, of_all, str(t.coefficient), t.file] for t in space.file.term)
    return grid("text:matrix", "text:size", "text:coefficient", "text:file", rows=terms)


def _unit(axis: str) -> str:
    return "kg" if axis in TRANSLATIONS else "kg m2"


def _between(build: LumpedBuild, assembly: Assembly) -> Iterator[list[str]]:
    """Rows on springs, dampers, contacts and loads."""
    file, contact = build.space.file, assembly.contact
    stiffness = {s.name: s.stiffness[0] for s in assembly.springs if isinstance(s, SpringInterface)}
    first = len(contact.pairs) - len(contact.spring_points)
    dampers: Sequence[DamperTable | DamperOn] = file.damper
    cubic_of = iter(contact.spring_points[len(contact.spring_points) - _cubics(dampers) :, -1])
    numbers = dict(zip(contact.pairs[first:][::-1], contact.spring_points[::-1], strict=True))
    springs: Sequence[SpringTable | SpringOn] = file.spring
    for i, table in enumerate(springs):
        name, (ends, along, turns) = file.name_of("spring", i), _ends(table)
        unit = "N m/rad" if turns else "N/m"
        if table.linear:
            size = f"{stiffness[name]:g} {unit}"
        else:
            k, cubic, gap = numbers[name][:3]
            size = f"{k:g} {unit}"
            size += f", {cubic:g} {unit}3" if cubic else ""
            size += f", gap {gap:g} {unit.partition('/')[2]}" if gap else ""
            size += f", {table.side}" if table.side != "both" else ""
        yield [f"spring {name}", ends, along, size]
    for damper_table, damper in zip(dampers, assembly.dampers, strict=True):
        ends, along, turns = _ends(damper_table)
        size = f"{damper.damping[0]:g} {'N m s/rad' if turns else 'N s/m'}"
        if not damper_table.linear:
            size += f", {next(cubic_of):g} {'N m s3/rad3' if turns else 'N s3/m3'}"
        yield [f"damper {damper.name}", ends, along, size]
    points: Sequence[ContactTable | ContactOn] = file.contact
    for i, point in enumerate(points):
        k = contact.area[i] * PER_AREA
        size = f"{k:g} N/m" if point.area is None else f"{contact.area[i]:g} m2"
        slides = f", slides {_text(point.sliding)}" if point.sliding else ", no friction"
        slides += _friction(point)
        ends = " - ".join(point.between) if isinstance(point, ContactTable) else ""
        name = f"contact {file.name_of('contact', i)}"
        yield [name, ends, _text(point.normal) + slides, size]
    loads: Sequence[LoadTable | LoadOn] = file.load
    for i, load in enumerate(loads):
        size = f"{load.force} N" if load.area is None else f"pressure on {load.area} m2"
        on = load.on if isinstance(load, LoadTable) else ""
        along = _text(load.direction if isinstance(load, LoadTable) else load.along)
        yield [f"load {file.name_of('load', i)}", on, along, size]


def _friction(point: ContactTable | ContactOn) -> str:
    """Text on the friction numbers and the state that a contact states itself."""
    texts = [f"friction {point.own_coefficient}"] if point.own_coefficient is not None else []
    texts += [f"{key} {number}" for key, number in point.friction_law.items()]
    if point.state is not None:
        names: dict[Number, str] = {number: name for name, number in STATES.items()}
        texts += [names.get(point.state, f"state {point.state}")]
        texts += [f"{point.tangential} N/m in plane"] if point.tangential is not None else []
    return "".join(f", {text}" for text in texts)


def _cubics(dampers: Sequence[DamperTable | DamperOn]) -> int:
    """Number of dampers with a cubic term."""
    return sum(not damper.linear for damper in dampers)


def _ends(table: SpringTable | DamperTable | SpringOn | DamperOn) -> tuple[str, str, bool]:
    """Ends of a spring or damper, its direction, and whether it acts on a rotation."""
    if isinstance(table, SpringOn | DamperOn):
        return "", _text(table.along), False
    turns = isinstance(table.direction, str) and table.direction.removeprefix("-") in TURNS
    return " - ".join(table.between), _text(table.direction), turns


def _text(direction: Direction | Motion) -> str:
    """A direction, or a sum of coordinates, as text."""
    if isinstance(direction, str):
        return direction
    parts = [part if isinstance(part, tuple) else ("", part) for part in direction]
    if any(name for name, _ in parts):
        return " + ".join(_factored(*part) for part in parts).replace("+ -", "- ")
    return f"[{', '.join(str(part) for _, part in parts)}]"


def _factored(name: str, factor: Number) -> str:
    signs: dict[Number, str] = {1.0: "", -1.0: "-"}
    return signs.get(factor, f"{factor} ") + name


def _frequencies(assembly: Assembly) -> Rows:
    """Frequencies with springs alone, and with closed linear contact without friction.

    Springs with a gap or of one side count as closed with the contact. Cubic terms are left out.
    """
    mass, springs = assembly.M.toarray(), assembly.K_el + assembly.K_springs()
    others = assembly.contact.spring_points
    touching = np.full(assembly.contact.n_points - len(others), PER_AREA)
    always = (others[:, 2] == 0.0) & (others[:, 3] == 0.0)
    tangent_of_springs = np.concatenate([0.0 * touching, np.where(always, others[:, 0], 0.0)])
    alone = springs + assembly.K_contact(tangent_of_springs)
    closed = springs + assembly.K_contact(np.concatenate([touching, others[:, 0]]))
    rows: Rows = []
    for name, K in (("springs alone", alone), ("contact closed", closed)):
        squares = scipy.linalg.eigh(K.toarray(), mass, eigvals_only=True)
        hz = np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)
        free = int((hz <= RIGID_FREQUENCY_RATIO * hz.max()).sum())
        texts = [f"{free} free"] if free else []
        texts += [f"{in_digits(f, 1)} Hz" for f in hz[free:][:MOST_FREQUENCIES]]
        if more := max(len(hz) - free - MOST_FREQUENCIES, 0):
            texts.append(f"{more} more up to {in_digits(hz[-1], 1)} Hz")
        rows.append((name, ", ".join(texts)))
    return rows
