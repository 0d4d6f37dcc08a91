"""A lumped model in numbers: masses, springs, dampers, contact and loads over its coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.laws import contact_law
from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.laws.spring import N_SPRING
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.numbers import (
    Along,
    Values,
    along,
    bounded,
    value_of,
)
from squealstudy.models.lumped.tables import (
    AXES,
    GROUND,
    MOVING,
    TRANSLATIONS,
    ContactTable,
    DamperTable,
    LoadTable,
    LumpedFile,
    SpringTable,
)
from squealstudy.models.minimal_parts import LEVER_ARM_M

PER_AREA = contact_law("bilateral").value(STIFFNESS.name)  # Pa/m: a stiffness is this times an area
# columns of springs that are not linear: their elongations are the gaps of points of 1 m2
OF_SPRINGS = {"area": 1.0, "gap": 0.0, "radius": 0.0, "frictional": 0.0, "speed_factor": 1.0}
RIGHT_ANGLE = 1e-9  # cosine of normal and sliding direction, at most


class Interface(NamedTuple):
    """A spring or damper: its name, elongation (m or 1, n), and N/m or N s/m (m or 1,)."""

    name: str
    row: np.ndarray
    size: np.ndarray


class Points(NamedTuple):
    """Contact points: N, T, T_perp (m or 1, c, n), the others (m or 1, c).

    The last are the springs that are not linear, with numbers `spring_points` (m or 1, ns, 4).
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


@dataclass(frozen=True)
class LumpedParts:
    """A lumped model at values of its parameters, numbers or arrays (m,).

    Attributes
    ----------
    masses : ndarray (m or 1, n)
        kg, or kg m2 of turns, of each coordinate.
    springs, dampers : list of Interface
    contact : Points
    load, constant_load : ndarray (m or 1, n)
        N/Pa, and N.
    """

    masses: np.ndarray
    springs: list[Interface]
    dampers: list[Interface]
    contact: Points
    load: np.ndarray
    constant_load: np.ndarray


class Coordinates:
    """Where the coordinates of each mass of a file are: masses in order, then their directions."""

    def __init__(self, file: LumpedFile) -> None:
        self.file = file
        self.tables = {table.name: table for table in file.mass}
        self.offsets = [0]
        self.places: dict[tuple[str, str], int] = {}
        for table in file.mass:
            for axis in table.axes:
                self.places[table.name, axis] = len(self.places)
            self.offsets.append(len(self.places))

    @property
    def names(self) -> list[tuple[str, str]]:
        """Mass and direction of each coordinate."""
        return list(self.places)

    def moved(self, mass: str, motion: Along, at: Sequence[float] | None) -> np.ndarray:
        """Motion (m or 1, n) of a point of a mass along a direction, or its turn about an axis."""
        motion_rows = np.zeros((len(motion.vector), len(self.places)))
        arm = np.zeros(3) if at is None else np.array(at) - self.tables[mass].place
        translations = np.zeros_like(motion.vector) if motion.turn else motion.vector
        turns = motion.vector if motion.turn else np.cross(arm, motion.vector)
        parts = np.concatenate([translations, turns], axis=1)
        for axis in self.tables[mass].axes:
            motion_rows[:, self.places[mass, axis]] = parts[:, AXES.index(axis)]
        return motion_rows

    def apart(self, ends: Sequence[str], motion: Along, at: Sequence[float] | None) -> np.ndarray:
        """Motion (m or 1, n) of the first of two ends over the second."""
        first = self.moved(ends[0], motion, at)
        return first - self.moved(ends[1], motion, at) if ends[1] in self.tables else first


def parts_of(file: LumpedFile, values: Values) -> LumpedParts:
    """The model at values of its parameters.

    Raises
    ------
    PlacedError
        A number that its place cannot have, a direction that is none or in which nothing moves.
    """
    space = Coordinates(file)
    load, constant = _loads(space, values)
    return LumpedParts(
        masses=_masses(space, values),
        springs=[
            _interface(space, "spring", i, table, values)
            for i, table in enumerate(file.spring)
            if table.linear
        ],
        dampers=[
            _interface(space, "damper", i, table, values) for i, table in enumerate(file.damper)
        ],
        contact=_contact(space, values),
        load=load,
        constant_load=constant,
    )


def _masses(space: Coordinates, values: Values) -> np.ndarray:
    columns = []
    for i, table in enumerate(space.file.mass):
        for axis in table.axes:
            key, unit = ("mass", "kg") if axis in TRANSLATIONS else ("inertia", "kg m2")
            columns.append(bounded(getattr(table, key), values, ("mass", i, key), unit))
    return _side_by_side(columns)


def _elongation(
    space: Coordinates, kind: str, i: int, table: SpringTable | DamperTable, values: Values
) -> np.ndarray:
    """Motion (m or 1, n) of the first end over the second."""
    motion = along(table.direction, values, (kind, i, "direction"), turns=True)
    row = space.apart(table.between, motion, table.at)
    _expect_motion(row, table.between, (kind, i, "direction"))
    return row


def _spring_numbers(i: int, table: SpringTable, values: Values) -> np.ndarray:
    """Stiffness, third power, gap and side (m or 1, 4) of a spring that is not linear."""
    keys = ("spring", i)
    side = {"both": 0.0, "tension": 1.0, "compression": -1.0}[table.side]
    gap = np.asarray(0.0)
    if table.gap is not None and side:
        gap = value_of(table.gap, values, (*keys, "gap"))
    elif table.gap is not None:
        gap = bounded(table.gap, values, (*keys, "gap"), "m", zero=True)
    cubic = value_of(0.0 if table.cubic is None else table.cubic, values, (*keys, "cubic"))
    stiffness = bounded(table.stiffness, values, (*keys, "stiffness"), "N/m", zero=True)
    return _side_by_side([stiffness, cubic, gap, np.asarray(side)])


def _interface(
    space: Coordinates, kind: str, i: int, table: SpringTable | DamperTable, values: Values
) -> Interface:
    keys = (kind, i)
    key = "stiffness" if isinstance(table, SpringTable) else "damping"
    number = table.stiffness if isinstance(table, SpringTable) else table.damping
    unit = "N/m" if key == "stiffness" else "N s/m"
    row = _elongation(space, kind, i, table, values)
    size = bounded(number, values, (*keys, key), unit, zero=True)
    return Interface(space.file.name_of(kind, i), row, np.atleast_1d(size))


def _contact(space: Coordinates, values: Values) -> Points:
    n = len(space.places)
    rows: dict[str, list[np.ndarray]] = {"N": [], "T": [], "T_perp": []}
    columns: dict[str, list[np.ndarray]] = {
        key: [] for key in ("area", "gap", "radius", "frictional", "speed_factor")
    }
    for i, table in enumerate(space.file.contact):
        keys: KeyPath = ("contact", i)
        normal = along(table.normal, values, (*keys, "normal"))
        opening = space.apart(table.between, normal, table.at)
        _expect_motion(opening, table.between, (*keys, "normal"))
        slid, across = _sliding(space, table, keys, normal, values)
        for name, row in zip(rows, (opening, slid, across), strict=True):
            rows[name].append(row)
        columns["area"].append(_area(table, keys, values))
        columns["gap"].append(value_of(table.gap, values, (*keys, "gap")))
        arm = np.asarray(LEVER_ARM_M)
        if table.radius is not None:
            arm = bounded(table.radius, values, (*keys, "radius"), "m")
        columns["radius"].append(arm)
        factor = bounded(table.friction_factor, values, (*keys, "friction_factor"), "", zero=True)
        columns["frictional"].append(factor if table.friction else np.asarray(0.0))
        columns["speed_factor"].append(
            bounded(table.speed_factor, values, (*keys, "speed_factor"), "")
        )
    numbers = []
    for i, spring in enumerate(space.file.spring):
        if spring.linear:
            continue
        rows["N"].append(_elongation(space, "spring", i, spring, values))
        for name in ("T", "T_perp"):
            rows[name].append(np.zeros((1, n)))
        for name, number in OF_SPRINGS.items():
            columns[name].append(np.asarray(number))
        numbers.append(_spring_numbers(i, spring, values))
    return Points(
        **{name: _stacked(parts, n) for name, parts in rows.items()},
        **{name: _side_by_side(parts) for name, parts in columns.items()},
        spring_points=_stacked(numbers, N_SPRING),
    )


def _area(table: ContactTable, keys: KeyPath, values: Values) -> np.ndarray:
    if table.area is not None:
        return bounded(table.area, values, (*keys, "area"), "m2")
    assert table.stiffness is not None
    area: np.ndarray = bounded(table.stiffness, values, (*keys, "stiffness"), "N/m") / PER_AREA
    return area


def _sliding(
    space: Coordinates, table: ContactTable, keys: KeyPath, normal: Along, values: Values
) -> tuple[np.ndarray, np.ndarray]:
    """Sliding of the second under the first, and across it (m or 1, n); zeros without friction."""
    if table.sliding is None:
        still = np.zeros((1, len(space.places)))
        return still, still
    sliding = along(table.sliding, values, (*keys, "sliding"))
    cosine = np.abs((normal.vector * sliding.vector).sum(axis=1))
    if (cosine > RIGHT_ANGLE).any():
        raise PlacedError((*keys, "sliding"), "expected a direction at right angles to its normal")
    slid = space.apart(table.between, sliding, table.at)
    _expect_motion(slid, table.between, (*keys, "sliding"))
    across = Along(np.cross(normal.vector, sliding.vector), turn=False)
    return -slid, -space.apart(table.between, across, table.at)


def _loads(space: Coordinates, values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Of a unit brake pressure, and constant (m or 1, n)."""
    loads = [np.zeros((1, len(space.places))), np.zeros((1, len(space.places)))]
    for i, table in enumerate(space.file.load):
        row = _load_row(space, table, ("load", i), values)
        if table.area is not None:
            size = bounded(table.area, values, ("load", i, "area"), "m2")
            loads[0] = loads[0] + np.atleast_1d(size)[:, None] * row
        else:
            assert table.force is not None
            size = value_of(table.force, values, ("load", i, "force"))
            loads[1] = loads[1] + np.atleast_1d(size)[:, None] * row
    return loads[0], loads[1]


def _load_row(space: Coordinates, table: LoadTable, keys: KeyPath, values: Values) -> np.ndarray:
    motion = along(table.direction, values, (*keys, "direction"), turns=True)
    row = space.moved(table.on, motion, table.at)
    _expect_motion(row, (table.on,), (*keys, "direction"))
    return row


def _expect_motion(row: np.ndarray, ends: Sequence[str], keys: KeyPath) -> None:
    """PlacedError where no coordinate of a mass has a part in a row."""
    if not np.abs(row).max(axis=1).min() > 0.0:
        whose = " nor ".join(f"'{e}'" for e in ends if e not in (GROUND, *MOVING))
        text = f"neither {whose} moves" if " nor " in whose else f"{whose} does not move"
        raise PlacedError(keys, f"{text} this way: expected one of its directions")


def _side_by_side(columns: list[np.ndarray]) -> np.ndarray:
    """Numbers or arrays (m,) side by side: (m or 1, k)."""
    if not columns:
        return np.zeros((1, 0))
    return np.stack([np.atleast_1d(c) for c in np.broadcast_arrays(*columns)], axis=-1)


def _stacked(rows: list[np.ndarray], n: int) -> np.ndarray:
    """Rows (m or 1, n) one below the other: (m or 1, k, n)."""
    if not rows:
        return np.zeros((1, 0, n))
    return np.stack(np.broadcast_arrays(*rows), axis=1)
