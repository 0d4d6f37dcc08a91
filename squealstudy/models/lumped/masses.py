"""Coordinates of point masses and inertias, and motions of their points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.numbers import Along, Values, along, bounded, side_by_side, value_of
from squealstudy.models.lumped.space import Structure
from squealstudy.models.lumped.tables import AXES, GROUND, MOVING, TRANSLATIONS, TURNS, LumpedFile

RIGHT_ANGLE = 1e-9  # largest cosine between normal and sliding direction


class MassSpace:
    """Coordinates of a model of masses: mass by mass, direction by direction."""

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

    def moved(self, mass: str, motion: Along, point: Sequence[float] | None) -> np.ndarray:
        """Rows (m or 1, n): motion of a point of a mass along a vector, or rotation about it."""
        motion_rows = np.zeros((len(motion.vector), len(self.places)))
        arm = np.zeros(3) if point is None else np.array(point) - self.tables[mass].place
        translations = np.zeros_like(motion.vector) if motion.turn else motion.vector
        turns = motion.vector if motion.turn else np.cross(arm, motion.vector)
        parts = np.concatenate([translations, turns], axis=1)
        for axis in self.tables[mass].axes:
            motion_rows[:, self.places[mass, axis]] = parts[:, AXES.index(axis)]
        return motion_rows

    def apart(
        self, ends: Sequence[str], motion: Along, point: Sequence[float] | None
    ) -> np.ndarray:
        """Rows (m or 1, n): motion of the first of two ends relative to the second."""
        first = self.moved(ends[0], motion, point)
        return first - self.moved(ends[1], motion, point) if ends[1] in self.tables else first

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.places)

    def structure(self, values: Values) -> Structure:
        """Mass and gyroscopic matrices, with a component for each mass.

        PlacedError where a mass or inertia is not above zero.
        """
        columns = []
        for i, table in enumerate(self.file.mass):
            for axis in table.axes:
                key, unit = ("mass", "kg") if axis in TRANSLATIONS else ("inertia", "kg m2")
                columns.append(bounded(getattr(table, key), values, ("mass", i, key), unit))
        return Structure(
            tuple(table.name for table in self.file.mass),
            self.offsets,
            M=side_by_side(columns)[:, :, None] * np.eye(self.n),
            K=np.zeros((1, self.n, self.n)),
            G=self._gyroscopic(values),
        )

    def _gyroscopic(self, values: Values) -> np.ndarray | None:
        """Gyroscopic matrix (m or 1, n, n) of spins [N m s]; None without any.

        An angular momentum s along e changes at a rate s w x e where its body tilts at a rate w.
        """
        spinning = [i for i, table in enumerate(self.file.mass) if table.spin is not None]
        if not spinning:
            return None
        total = np.zeros((1, self.n, self.n))
        for i in spinning:
            table, keys = self.file.mass[i], ("mass", i)
            assert table.spin is not None
            momentum = np.atleast_1d(value_of(table.spin, values, (*keys, "spin")))
            axis = along(table.spin_axis, values, (*keys, "spin_axis")).vector
            turns = [axis_name for axis_name in table.axes if axis_name in TURNS]
            matrix = np.zeros((1, self.n, self.n))
            for column in turns:
                tilt = np.eye(3)[TURNS.index(column)]
                change = momentum[:, None] * np.cross(tilt, axis)
                for row in turns:
                    entry = np.zeros((1, self.n, self.n))
                    entry[0, self.places[table.name, row], self.places[table.name, column]] = 1.0
                    matrix = matrix + change[:, TURNS.index(row), None, None] * entry
            if not turns or (not np.abs(matrix).max() > 0.0 and momentum.any()):
                text = "expected two rotations across spin_axis among directions, rx and ry for z"
                raise PlacedError((*keys, "spin"), text)
            total = total + matrix
        return total

    def elongation(self, kind: str, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n): motion of the first end of a spring or damper relative to the other."""
        table, keys = getattr(self.file, kind)[i], (kind, i, "direction")
        row = self.apart(table.between, along(table.direction, values, keys, turns=True), table.at)
        _expect_motion(row, table.between, keys)
        return row

    def contact_rows(self, i: int, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and T_perp, each (m or 1, n), of a contact; T and T_perp are 0 without friction."""
        table, keys = self.file.contact[i], ("contact", i)
        normal = along(table.normal, values, (*keys, "normal"))
        opening = self.apart(table.between, normal, table.at)
        _expect_motion(opening, table.between, (*keys, "normal"))
        if table.sliding is None:
            still = np.zeros((1, self.n))
            return opening, still, still
        sliding = along(table.sliding, values, (*keys, "sliding"))
        cosine = np.abs((normal.vector * sliding.vector).sum(axis=1))
        if (cosine > RIGHT_ANGLE).any():
            text = "expected a direction at right angles to its normal"
            raise PlacedError((*keys, "sliding"), text)
        slid = self.apart(table.between, sliding, table.at)
        _expect_motion(slid, table.between, (*keys, "sliding"))
        across = Along(np.cross(normal.vector, sliding.vector), turn=False)
        return opening, -slid, -self.apart(table.between, across, table.at)

    def load_row(self, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n): the motion along which a load does work."""
        table, keys = self.file.load[i], ("load", i, "direction")
        row = self.moved(table.on, along(table.direction, values, keys, turns=True), table.at)
        _expect_motion(row, (table.on,), keys)
        return row


def _expect_motion(row: np.ndarray, ends: Sequence[str], keys: KeyPath) -> None:
    """Raise PlacedError where a row is zero: no mass can move this way."""
    if not np.abs(row).max(axis=1).min() > 0.0:
        whose = " nor ".join(f"'{e}'" for e in ends if e not in (GROUND, *MOVING))
        text = f"neither {whose} moves" if " nor " in whose else f"{whose} does not move"
        raise PlacedError(keys, f"{text} this way: expected one of its directions")
