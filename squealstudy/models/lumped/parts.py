"""The parts of a lumped model at values of its parameters: structure, springs, contact, loads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.laws import contact_law
from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.own_friction import NO_OWN_FRICTION, SLIDING, STATE
from squealstudy.laws.spring import N_SPRING
from squealstudy.models.file_table import KeyPath
from squealstudy.models.lumped.contact_friction import (
    has_own_numbers,
    own_row,
    state_of,
    tangential_of,
)
from squealstudy.models.lumped.numbers import Values, bounded, side_by_side, value_of
from squealstudy.models.lumped.space import Space, Structure
from squealstudy.models.lumped.tables import ContactNumbers, SpringNumbers
from squealstudy.models.minimal_parts import LEVER_ARM_M

# Pa/m: the stiffness of a contact point is this times its area
PER_AREA = contact_law("bilateral").value(STIFFNESS.name)
# columns of springs that are not linear, which are points of 1 m2 with their elongations as gaps
OF_SPRINGS = {"area": 1.0, "gap": 0.0, "radius": 0.0, "frictional": 0.0, "speed_factor": 1.0}


class Interface(NamedTuple):
    """A spring or damper.

    Attributes
    ----------
    name : str
    row : ndarray (m or 1, n)
        Its elongation by the coordinates.
    size : ndarray (m or 1,)
        Stiffness [N/m] or damping [N s/m].
    """

    name: str
    row: np.ndarray
    size: np.ndarray


class Points(NamedTuple):
    """Contact points; the last ns of them are springs and dampers that are not linear.

    Attributes
    ----------
    N, T, T_perp : ndarray (m or 1, c, n)
    area, gap, radius, frictional, speed_factor : ndarray (m or 1, c)
        As in `ContactInterface`: m2, m, m and two factors.
    spring_points : ndarray (m or 1, ns, 5)
        Numbers of the last ns points, as in `ContactInterface`.
    own_friction : ndarray (m or 1, c, k)
        As `laws.own_friction` describes.
    """

    N: np.ndarray
    T: np.ndarray
    T_perp: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    radius: np.ndarray
    frictional: np.ndarray
    speed_factor: np.ndarray
    spring_points: np.ndarray
    own_friction: np.ndarray


@dataclass(frozen=True)
class LumpedParts:
    """A lumped model at values of its parameters, numbers or arrays (m,).

    Attributes
    ----------
    structure : Structure
    springs, dampers : list of Interface
    contact : Points
    load, constant_load : ndarray (m or 1, n)
        Forces of a unit brake pressure [N/Pa], and constant forces [N].
    stuck_springs : list of Interface
        Tangential springs of contacts with a state, which act in vibration alone; their stiffness
        is 0 while the contact slides.
    """

    structure: Structure
    springs: list[Interface]
    dampers: list[Interface]
    contact: Points
    load: np.ndarray
    constant_load: np.ndarray
    stuck_springs: list[Interface]


def parts_of(space: Space, values: Values, curve: FrictionCurveDefinition) -> LumpedParts:
    """The parts at values of the parameters, with the friction law of the study.

    Raises
    ------
    PlacedError
        A number is not possible; a direction is none, or nothing moves along it.
    """
    file = space.file
    load, constant = _loads(space, values)
    return LumpedParts(
        structure=space.structure(values),
        springs=[
            _interface(space, "spring", "stiffness", i, values)
            for i, table in enumerate(file.spring)
            if table.linear
        ],
        dampers=[
            _interface(space, "damper", "damping", i, values) for i in range(len(file.damper))
        ],
        contact=_contact(space, values, curve),
        load=load,
        constant_load=constant,
        stuck_springs=_stuck_springs(space, values),
    )


def _spring_numbers(i: int, table: SpringNumbers, values: Values) -> np.ndarray:
    """Stiffness, cubic term, gap, side and 0 (m or 1, 5) of a spring that is not linear."""
    keys = ("spring", i)
    side = {"both": 0.0, "tension": 1.0, "compression": -1.0}[table.side]
    gap = np.asarray(0.0)
    if table.gap is not None and side:
        gap = value_of(table.gap, values, (*keys, "gap"))
    elif table.gap is not None:
        gap = bounded(table.gap, values, (*keys, "gap"), "m", zero=True)
    cubic = value_of(0.0 if table.cubic is None else table.cubic, values, (*keys, "cubic"))
    stiffness = bounded(table.stiffness, values, (*keys, "stiffness"), "N/m", zero=True)
    return side_by_side([stiffness, cubic, gap, np.asarray(side), np.asarray(0.0)])


def _interface(space: Space, kind: str, key: str, i: int, values: Values) -> Interface:
    unit = "N/m" if key == "stiffness" else "N s/m"
    number = getattr(getattr(space.file, kind)[i], key)
    row = space.elongation(kind, i, values)
    size = bounded(number, values, (kind, i, key), unit, zero=True)
    return Interface(space.file.name_of(kind, i), row, np.atleast_1d(size))


def _stuck_springs(space: Space, values: Values) -> list[Interface]:
    """Tangential springs of contacts with a state, along the sliding direction and across it."""
    springs = []
    for i, table in enumerate(space.file.contact):
        if table.state is None:
            continue
        keys: KeyPath = ("contact", i)
        stuck = state_of(table, keys, values) != SLIDING
        size = np.atleast_1d(np.where(stuck, tangential_of(table, keys, values), 0.0))
        name = space.file.name_of("contact", i)
        springs += [Interface(name, row, size) for row in space.contact_rows(i, values)[1:]]
    return springs


def _contact(space: Space, values: Values, curve: FrictionCurveDefinition) -> Points:
    """Contact points, and nonlinear springs and dampers, which are points as well."""
    rows: dict[str, list[np.ndarray]] = {"N": [], "T": [], "T_perp": []}
    columns: dict[str, list[np.ndarray]] = {
        key: [] for key in ("area", "gap", "radius", "frictional", "speed_factor")
    }
    for i, table in enumerate(space.file.contact):
        keys: KeyPath = ("contact", i)
        for name, row in zip(rows, space.contact_rows(i, values), strict=True):
            rows[name].append(row)
        columns["area"].append(_area(table, keys, values))
        columns["gap"].append(value_of(table.gap, values, (*keys, "gap")))
        arm = np.asarray(LEVER_ARM_M)
        if table.radius is not None:
            arm = bounded(table.radius, values, (*keys, "radius"), "m")
        columns["radius"].append(arm if table.state is None else np.asarray(0.0))
        factor = bounded(table.friction_factor, values, (*keys, "friction_factor"), "", zero=True)
        columns["frictional"].append(factor if table.rubs else np.asarray(0.0))
        speed = bounded(table.speed_factor, values, (*keys, "speed_factor"), "")
        columns["speed_factor"].append(speed if table.state is None else np.asarray(0.0))
    own_rows: list[np.ndarray] = []
    if has_own_numbers(space.file.contact):
        own_rows = [
            own_row(t, ("contact", i), values, curve) for i, t in enumerate(space.file.contact)
        ]
    numbers = []
    for i, spring in enumerate(space.file.spring):
        if spring.linear:
            continue
        rows["N"].append(space.elongation("spring", i, values))
        for name in ("T", "T_perp"):
            rows[name].append(np.zeros((1, space.n)))
        for name, number in OF_SPRINGS.items():
            columns[name].append(np.asarray(number))
        numbers.append(_spring_numbers(i, spring, values))
    for i, damper in enumerate(space.file.damper):
        if damper.cubic is None:
            continue
        stretched = space.elongation("damper", i, values)
        for name, row in zip(rows, (stretched, stretched, 0.0 * stretched), strict=True):
            rows[name].append(row)
        for name, number in OF_SPRINGS.items():
            columns[name].append(np.asarray(number))
        cubic = bounded(damper.cubic, values, ("damper", i, "cubic"), "N s3/m3", zero=True)
        numbers.append(side_by_side([*[np.asarray(0.0)] * (N_SPRING - 1), cubic]))
    return Points(
        **{name: _stacked(parts, space.n) for name, parts in rows.items()},
        **{name: side_by_side(parts) for name, parts in columns.items()},
        spring_points=_stacked(numbers, N_SPRING),
        own_friction=_own_friction(own_rows, len(numbers)),
    )


def _own_friction(rows: list[np.ndarray], n_springs: int) -> np.ndarray:
    """The array `own_friction` (m or 1, c, k) of contacts and springs; no columns without rows."""
    if not rows:
        return NO_OWN_FRICTION[None]
    of_spring = np.full_like(rows[0][:1], np.nan)
    of_spring[:, STATE] = SLIDING
    return _stacked([*rows, *[of_spring] * n_springs], rows[0].shape[1])


def _area(table: ContactNumbers, keys: KeyPath, values: Values) -> np.ndarray:
    if table.area is not None:
        return bounded(table.area, values, (*keys, "area"), "m2")
    assert table.stiffness is not None
    area: np.ndarray = bounded(table.stiffness, values, (*keys, "stiffness"), "N/m") / PER_AREA
    return area


def _loads(space: Space, values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Loads of a unit brake pressure [N/Pa], and constant loads [N], both (m or 1, n).

    0.1 + 0.2 - 0.3 N is no load: a sum within the round-off of its terms has no sign.
    """
    sums = [np.zeros((1, space.n)), np.zeros((1, space.n))]
    sizes = [np.zeros((1, space.n)), np.zeros((1, space.n))]
    for i, table in enumerate(space.file.load):
        row = space.load_row(i, values)
        if table.area is not None:
            kind, number = 0, bounded(table.area, values, ("load", i, "area"), "m2")
        else:
            assert table.force is not None
            kind, number = 1, value_of(table.force, values, ("load", i, "force"))
        term = np.atleast_1d(number)[:, None] * row
        sums[kind], sizes[kind] = sums[kind] + term, sizes[kind] + np.abs(term)
    round_off = np.finfo(float).eps * len(space.file.load)
    of_pressure, constant = (
        np.where(np.abs(x) <= round_off * size, 0.0, x) for x, size in zip(sums, sizes, strict=True)
    )
    return of_pressure, constant


def _stacked(rows: list[np.ndarray], n: int) -> np.ndarray:
    """Rows (m or 1, n) one below the other: (m or 1, k, n)."""
    if not rows:
        return np.zeros((1, 0, n))
    return np.stack(np.broadcast_arrays(*rows), axis=1)
