"""Checks of the file of a lumped model, which raise PlacedError."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.matrix_tables import AnyFile, ContactOn
from squealstudy.models.lumped.numbers import expression
from squealstudy.models.lumped.tables import (
    GROUND,
    MOVING,
    ContactNumbers,
    ContactTable,
    LumpedFile,
)
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.models.own_law import check_law_keys

LISTS = ("term", "mass", "spring", "damper", "contact", "load")


def check_tables(file: AnyFile) -> None:
    """Check names, the ends of parts, and keys that depend on each other."""
    _check_names(file)
    if isinstance(file, LumpedFile):
        _check_masses(file)
    contacts: Sequence[ContactTable | ContactOn] = file.contact
    for i, contact in enumerate(contacts):
        keys: KeyPath = ("contact", i)
        if (contact.stiffness is None) == (contact.area is None):
            expected = "expected a stiffness, N/m, or an area, m2"
            raise PlacedError(keys, expected + ("" if contact.area is None else "; not both"))
        if contact.rubs and contact.sliding is None:
            text = "the key 'sliding' is missing: the direction in which the second slides past "
            raise PlacedError(keys, text + "the first; or friction = false")
        check_friction(contact, keys)
    for i, load in enumerate(file.load):
        if (load.force is None) == (load.area is None):
            expected = "expected a force, N, or an area, m2, on which the brake pressure acts"
            raise PlacedError(("load", i), expected + ("" if load.area is None else "; not both"))
    _check_arms(file)
    _check_loads(file)
    if isinstance(file, LumpedFile):
        _check_pressed(file)


def check_friction(contact: ContactNumbers, keys: KeyPath) -> None:
    """Check that the friction keys of a contact fit each other."""
    is_written = {
        "friction_factor": contact.friction_factor != 1.0,
        "friction_law": bool(contact.friction_law),
        "speed_factor": contact.speed_factor != 1.0,
        "state": contact.state is not None,
        "tangential": contact.tangential is not None,
        "radius": contact.radius is not None,
    }
    reasons: list[tuple[str, tuple[str, ...]]] = []
    if not contact.rubs:
        keys_of_friction = ("friction_factor", "friction_law", "state", "tangential")
        reasons.append(("a contact without friction has no such key", keys_of_friction))
    if contact.own_coefficient is not None:
        reasons.append(("a contact with its own friction has no such key", ("friction_factor",)))
    if contact.state is not None:
        text = "no sliding is imposed on a contact with a state: it has no such key"
        reasons.append((text, ("friction_law", "speed_factor", "radius")))
    else:
        text = "it is of a contact that is stuck: the key 'state' is missing"
        reasons.append((text, ("tangential",)))
    if not contact.rubs and getattr(contact, "sliding", None) is not None:
        raise PlacedError((*keys, "sliding"), "a contact without friction has no such key")
    for text, barred in reasons:
        for key in barred:
            if is_written[key]:
                raise PlacedError((*keys, key), text)
    check_law_keys(tuple(contact.friction_law), keys)


def _check_masses(file: LumpedFile) -> None:
    """Check the names of masses, and that the ends of parts exist and are allowed."""
    masses = tuple(table.name for table in file.mass)
    for i, table in enumerate(file.mass):
        if table.name in (GROUND, MOVING[0]):
            text = f"'{table.name}' is the name of a part that does not vibrate: expected another"
            raise PlacedError(("mass", i, "name"), text)
    for kind in ("spring", "damper"):
        for i, table in enumerate(getattr(file, kind)):
            _check_ends(table.between, masses, (GROUND,), (kind, i, "between"))
    for i, contact in enumerate(file.contact):
        keys: KeyPath = ("contact", i, "between")
        _check_ends(contact.between, masses, (GROUND, *MOVING), keys)
        if contact.rubs and contact.between[1] == GROUND and contact.state is None:
            text = (
                f'the ground does not slide: expected "{MOVING[0]}", friction = false, or a state'
            )
            raise PlacedError(keys, text)
        if contact.state is not None and contact.between[1] in MOVING:
            text = f"the {contact.between[1]} slides at sliding_speed: expected no such key"
            raise PlacedError(("contact", i, "state"), text)
    for i, load in enumerate(file.load):
        _expect_mass(load.on, masses, ("load", i, "on"))


def _check_names(file: AnyFile) -> None:
    """Raise PlacedError where two tables of one kind have one name."""
    for kind in LISTS:
        first: dict[str, int] = {}
        for i in range(len(getattr(file, kind, ()))):
            name = file.name_of(kind, i)
            if name in first:
                text = f"'{name}' is the name of {kind}[{first[name] + 1}] already"
                raise PlacedError((kind, i, "name"), f"{text}: expected another")
            first[name] = i


def _check_ends(
    ends: tuple[str, str], masses: tuple[str, ...], others: tuple[str, ...], keys: KeyPath
) -> None:
    """Raise PlacedError unless the first end is a mass, the second another one or of `others`."""
    _expect_mass(ends[0], masses, (*keys, 0))
    if ends[1] not in others:
        _expect_mass(ends[1], (*masses, *others), (*keys, 1))
    if ends[0] == ends[1]:
        raise PlacedError(keys, f"expected two that differ, got '{ends[0]}' twice")


def _expect_mass(name: str, masses: tuple[str, ...], keys: KeyPath) -> None:
    if name not in masses:
        text = f"there is no mass '{name}', expected one of {', '.join(dict.fromkeys(masses))}"
        raise PlacedError(keys, text, name, masses)


def _check_arms(file: AnyFile) -> None:
    braking = [i for i, t in enumerate(file.contact) if t.rubs and t.state is None]
    arms = [file.contact[i].radius is not None for i in braking]
    if any(arms) and not all(arms):
        text = "the key 'radius' is missing: expected of all contacts with friction, or of none"
        without = (i for i in braking if file.contact[i].radius is None)
        raise PlacedError(("contact", next(without)), text)


def _check_loads(file: AnyFile) -> None:
    """Check that there is a contact, and a load or a gap that can press it."""
    if not file.contact:
        key = ("load", 0) if file.load else ()
        text = "there is no [[contact]]: expected one that the load presses"
        raise PlacedError(key or ("contact",), text)
    if not file.load and all(table.gap == 0.0 for table in file.contact):
        text = "there is no [[load]], and no contact has a gap: nothing presses the contact"
        raise PlacedError(("load",), text)


def _check_pressed(file: LumpedFile) -> None:
    """Check that springs connect the mass of each load to a contact."""
    touching = {end for table in file.contact for end in table.between}
    for i, load in enumerate(file.load):
        if not _reached(load.on, file) & touching:
            text = f"no contact is pressed: neither '{load.on}' nor masses joined to it are in a"
            raise PlacedError(("load", i, "on"), f"{text} [[contact]]")


def _reached(mass: str, file: LumpedFile) -> set[str]:
    """The mass, and all masses that springs connect to it."""
    masses = {table.name for table in file.mass}
    reached, new = set[str](), {mass}
    while new:
        reached |= new
        ends = (set(table.between) for table in file.spring)
        new = set().union(*(e for e in ends if e & reached)) & masses - reached
    return reached


def check_used(file: AnyFile, parameters: Iterable[str]) -> None:
    """Check that expressions use all parameters of the file, and no other names."""
    parameters, used = tuple(parameters), set[str]()
    for keys, text in texts_of(file):
        try:
            names = expression(text).names
        except ExpressionError as error:
            raise PlacedError(keys, str(error)) from None
        for name in names:
            if name not in parameters:
                listing = f", expected one of {', '.join(parameters)}" if parameters else ""
                what = f"there is no parameter '{name}' under [parameters]{listing}"
                raise PlacedError(keys, what, name, parameters)
        used |= set(names)
    for name in parameters:
        if name not in used:
            text = "no number of the file uses it: expected its name in one, or no such parameter"
            raise PlacedError(("parameters", name), text)


def texts_of(file: AnyFile) -> Iterator[tuple[KeyPath, str]]:
    """Key paths and texts of all expressions in the file."""
    numbers = {
        "term": ("coefficient",),
        "mass": ("mass", "inertia", "spin"),
        "spring": ("stiffness", "cubic", "gap"),
        "damper": ("damping", "cubic"),
        "contact": (
            "stiffness",
            "area",
            "gap",
            "friction",
            "friction_factor",
            "speed_factor",
            "state",
            "tangential",
            "radius",
        ),
        "load": ("force", "area"),
    }
    directions = ("direction", "normal", "sliding", "across", "along", "spin_axis")
    for kind in LISTS:
        for i, table in enumerate(getattr(file, kind, ())):
            for key in numbers[kind]:
                if isinstance(text := getattr(table, key), str):
                    yield (kind, i, key), text
            for key, number in getattr(table, "friction_law", {}).items():
                if isinstance(number, str):
                    yield (kind, i, "friction_law", key), number
            for key in directions:
                parts = getattr(table, key, None)
                for k, part in enumerate(parts if isinstance(parts, tuple) else ()):
                    index, text = (k, part) if not isinstance(part, tuple) else part
                    if isinstance(text, str):
                        yield (kind, i, key, index), text
