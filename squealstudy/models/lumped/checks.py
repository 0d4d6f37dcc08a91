"""What must hold in the file of a lumped model, at its defaults: PlacedError where it does not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.numbers import expression
from squealstudy.models.lumped.parts import Coordinates, LumpedParts
from squealstudy.models.lumped.tables import GROUND, MOVING, LumpedFile
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.wording import listed

LISTS = ("mass", "spring", "damper", "contact", "load")
# singular value of unit rows below which a motion is held by nothing
UNSUPPORTED_SINGULAR_VALUE = 1e-9
TAKES_PART = 0.05  # of the largest part: a coordinate that is named


def check_tables(file: LumpedFile) -> None:
    """Names, what is between what, and keys that need each other."""
    _check_names(file)
    masses = tuple(table.name for table in file.mass)
    for kind in ("spring", "damper"):
        for i, table in enumerate(getattr(file, kind)):
            _check_ends(table.between, masses, (GROUND,), (kind, i, "between"))
    for i, contact in enumerate(file.contact):
        keys: KeyPath = ("contact", i)
        _check_ends(contact.between, masses, (GROUND, *MOVING), (*keys, "between"))
        if (contact.stiffness is None) == (contact.area is None):
            expected = "expected a stiffness, N/m, or an area, m2"
            raise PlacedError(keys, expected + ("" if contact.area is None else "; not both"))
        if contact.friction and contact.sliding is None:
            text = "the key 'sliding' is missing: the direction in which the second slides past "
            raise PlacedError(keys, text + "the first; or friction = false")
        if contact.friction and contact.between[1] == GROUND:
            text = f'the ground does not slide: expected "{MOVING[0]}", or friction = false'
            raise PlacedError((*keys, "between"), text)
        if not contact.friction and contact.sliding is not None:
            raise PlacedError((*keys, "sliding"), "a contact without friction has no such key")
        if not contact.friction and contact.friction_factor != 1.0:
            raise PlacedError(
                (*keys, "friction_factor"), "a contact without friction has no such key"
            )
    for i, load in enumerate(file.load):
        _expect_mass(load.on, masses, ("load", i, "on"))
        if (load.force is None) == (load.area is None):
            expected = "expected a force, N, or an area, m2, on which the brake pressure acts"
            raise PlacedError(("load", i), expected + ("" if load.area is None else "; not both"))
    _check_arms(file)
    _check_loads(file)


def _check_names(file: LumpedFile) -> None:
    for kind in LISTS:
        first: dict[str, int] = {}
        for i in range(len(getattr(file, kind))):
            name = file.name_of(kind, i)
            if name in first:
                text = f"'{name}' is the name of {kind}[{first[name] + 1}] already"
                raise PlacedError((kind, i, "name"), f"{text}: expected another")
            first[name] = i
    for i, table in enumerate(file.mass):
        if table.name in (GROUND, MOVING[0]):
            text = f"'{table.name}' means what does not vibrate: expected another name"
            raise PlacedError(("mass", i, "name"), text)


def _check_ends(
    ends: tuple[str, str], masses: tuple[str, ...], others: tuple[str, ...], keys: KeyPath
) -> None:
    _expect_mass(ends[0], masses, (*keys, 0))
    if ends[1] not in others:
        _expect_mass(ends[1], (*masses, *others), (*keys, 1))
    if ends[0] == ends[1]:
        raise PlacedError(keys, f"expected two that differ, got '{ends[0]}' twice")


def _expect_mass(name: str, known: tuple[str, ...], keys: KeyPath) -> None:
    if name not in known:
        text = f"there is no mass '{name}', expected one of {', '.join(known)}"
        raise PlacedError(keys, text, name, known)


def _check_arms(file: LumpedFile) -> None:
    arms = [table.radius is not None for table in file.contact if table.friction]
    if any(arms) and not all(arms):
        text = "the key 'radius' is missing: expected of all contacts with friction, or of none"
        without = (i for i, t in enumerate(file.contact) if t.friction and t.radius is None)
        raise PlacedError(("contact", next(without)), text)


def _check_loads(file: LumpedFile) -> None:
    """That there is contact, that something presses, and that each load comes to a contact."""
    if not file.contact:
        key = ("load", 0) if file.load else ()
        text = "there is no [[contact]]: expected one that the load presses"
        raise PlacedError(key or ("contact",), text)
    if not file.load and all(table.gap == 0.0 for table in file.contact):
        text = "there is no [[load]], and no contact has a gap: nothing presses the contact"
        raise PlacedError(("load",), text)
    touching = {end for table in file.contact for end in table.between}
    for i, load in enumerate(file.load):
        if not _reached(load.on, file) & touching:
            text = f"no contact is pressed: neither '{load.on}' nor what springs join to it is in a"
            raise PlacedError(("load", i, "on"), f"{text} [[contact]]")


def _reached(mass: str, file: LumpedFile) -> set[str]:
    """The mass and those that springs join to it."""
    masses = {table.name for table in file.mass}
    reached, new = set[str](), {mass}
    while new:
        reached |= new
        ends = (set(table.between) for table in file.spring)
        new = set().union(*(e for e in ends if e & reached)) & masses - reached
    return reached


def check_used(file: LumpedFile, own: Iterable[str]) -> None:
    """That expressions use each parameter of the file, and no others."""
    own, used = tuple(own), set[str]()
    for keys, text in texts_of(file):
        try:
            names = expression(text).names
        except ExpressionError as error:
            raise PlacedError(keys, str(error)) from None
        for name in names:
            if name not in own:
                listing = f", expected one of {', '.join(own)}" if own else ""
                what = f"there is no parameter '{name}' under [parameters]{listing}"
                raise PlacedError(keys, what, name, own)
        used |= set(names)
    for name in own:
        if name not in used:
            text = "no number of the file uses it: expected its name in one, or no such parameter"
            raise PlacedError(("parameters", name), text)


def texts_of(file: LumpedFile) -> Iterator[tuple[KeyPath, str]]:
    """Expressions of the file and their keys."""
    numbers = {
        "mass": ("mass", "inertia"),
        "spring": ("stiffness", "cubic", "gap"),
        "damper": ("damping",),
        "contact": ("stiffness", "area", "gap", "friction_factor", "speed_factor", "radius"),
        "load": ("force", "area"),
    }
    directions = ("direction", "normal", "sliding")
    for kind in LISTS:
        for i, table in enumerate(getattr(file, kind)):
            for key in numbers[kind]:
                if isinstance(text := getattr(table, key), str):
                    yield (kind, i, key), text
            for key in directions:
                parts = getattr(table, key, None)
                if isinstance(parts, tuple):
                    for k, part in enumerate(parts):
                        if isinstance(part, str):
                            yield (kind, i, key, k), part


def check_held(file: LumpedFile, parts: LumpedParts) -> None:
    """That springs or contact hold every motion, at the values of `parts`."""
    rows = [s.row[0] for s in parts.springs if s.size[0] > 0.0]
    points, numbers = parts.contact.N[0], parts.contact.spring_points[0]
    acts = np.ones(len(points), dtype=bool)
    acts[len(points) - len(numbers) :] = numbers[:, 0] > 0.0
    holding_rows = np.vstack([*rows, *points[acts]])
    holding_rows = holding_rows / np.linalg.norm(holding_rows, axis=1, keepdims=True)
    _, sizes, motions = np.linalg.svd(holding_rows)
    free = motions[int((sizes > UNSUPPORTED_SINGULAR_VALUE).sum()) :]
    if not len(free):
        return
    space = Coordinates(file)
    part = np.abs(free[0])
    moving = [space.names[j] for j in np.flatnonzero(part > TAKES_PART * part.max())]
    motions_text = listed([f"'{mass}' along {axis}" for mass, axis in moving])
    number = next(i for i, table in enumerate(file.mass) if table.name == moving[0][0])
    together = "" if len(moving) == 1 else ", moving together"
    text = f"nothing holds {motions_text}{together}: expected a [[spring]] or [[contact]] that does"
    raise PlacedError(("mass", number, "name"), text)
