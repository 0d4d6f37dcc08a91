"""Values measured over a face of a contact, interpolated from a table of places to its points."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.number_table import numbers_of, read_lines

AXES = ("x", "y", "z")
GAP, FACTOR = "gap", "factor"  # names of columns
NOT_NEGATIVE = (FACTOR,)
BEYOND_SPACINGS = 2.0  # distances of neighbours that a contact point may lie off all places
STEEPEST = 0.5  # least distance of neighbours in the plane over their distance: up to 60 degrees
FLAT = 1e-3  # places are on a line if their breadth over length is smaller


class FaceMap:
    """Gaps or friction factors at places of a face, linear between them.

    Parameters
    ----------
    path : Path
        A text file: a line of names, `column` and two or three of `x`, `y`, `z`, then a line for
        each place; separated by commas, semicolons, tabs or blanks.
    size : float
        The file's unit of length [m].
    column : str
        GAP, in the unit of length, or FACTOR.

    Raises
    ------
    ModelError
        The file is malformed (with the line); it has fewer than three places, or all on one line;
        two places lie one above the other; a place has two values; a factor is below zero.
    """

    def __init__(self, path: Path, size: float, column: str = GAP) -> None:
        self.name = path.name
        axes, rows = _read(path, column)
        self.axes = [AXES.index(axis) for axis in axes]
        self.places = rows[:, :-1] * size
        self.values = rows[:, -1] * size if column == GAP else rows[:, -1]
        self._centre = self.places.mean(axis=0)
        _, extents, directions = np.linalg.svd(self.places - self._centre, full_matrices=False)
        if len(rows) < 3 or extents[1] <= FLAT * extents[0]:
            raise ModelError(
                f"{self.name}: expected three places or more that span a face, got "
                + ("places along one line" if len(rows) > 2 else f"{len(rows)}")
            )
        self._plane = directions[:2]
        self._expect_one_face()

    def _expect_one_face(self) -> None:
        """Raise ModelError where places lie above each other, as on two faces."""
        from scipy.spatial import cKDTree

        in_plane = (self.places - self._centre) @ self._plane.T
        distances, which = cKDTree(in_plane).query(in_plane, k=2)
        distance = np.linalg.norm(self.places - self.places[which[:, 1]], axis=1)
        above = np.flatnonzero(distances[:, 1] < STEEPEST * distance)
        if len(above):
            ends = above[0], which[above[0], 1]
            first, second = (", ".join(f"{v:g}" for v in self.places[k]) for k in ends)
            raise ModelError(
                f"{self.name}: the places {first} and {second} (m) lie one above the other: "
                "expected those of one face"
            )

    def at(self, points: np.ndarray) -> np.ndarray:
        """Values (n,) in SI units at points (n, 3) [m] of the face, in the file's coordinates.

        Outside the outermost places a point has the value of the nearest place.

        Raises
        ------
        ModelError
            A point is farther outside than twice the median distance of neighbouring places.
        """
        from scipy.interpolate import LinearNDInterpolator
        from scipy.spatial import cKDTree

        in_plane = (self.places - self._centre) @ self._plane.T
        points_in_plane = (points[:, self.axes] - self._centre) @ self._plane.T
        tree = cKDTree(in_plane)
        spacing = float(np.median(tree.query(in_plane, k=2)[0][:, 1]))
        values: np.ndarray = LinearNDInterpolator(in_plane, self.values)(points_in_plane)
        values = np.clip(values, self.values.min(), self.values.max())  # round-off of weights
        beyond = np.flatnonzero(np.isnan(values))
        if len(beyond):
            distance, nearest = tree.query(points_in_plane[beyond])
            if (distance > BEYOND_SPACINGS * spacing).any():
                n_far = int((distance > BEYOND_SPACINGS * spacing).sum())
                raise ModelError(
                    f"{self.name}: {100 * n_far / len(points):.3g} % of the contact points lie off "
                    f"its places, the farthest by {distance.max():.3g} m where those are "
                    f"{spacing:.3g} m apart. Expected places all over the face, in the "
                    "coordinates and the unit of its component's file"
                )
            values[beyond] = self.values[nearest]
        return values


def _read(path: Path, column: str) -> tuple[list[str], np.ndarray]:
    """Names of the coordinates, and rows (n, 3 or 4) of coordinates and value."""
    (line, words), line_numbers = read_lines(path, f"x, y, {column}")
    names = [name.lower() for name in words]
    axes = [axis for axis in AXES if axis in names]
    if column not in names or len(axes) < 2 or sorted(names) != sorted([*axes, column]):
        raise ModelError(
            f"{path.name}, line {line}: expected names x, y, {column}, got {', '.join(words)}"
        )
    order = [names.index(name) for name in (*axes, column)]
    values = np.array([numbers_of(path, k, cells, len(names)) for k, cells in line_numbers])
    if not len(values):
        raise ModelError(f"{path.name} has no places below its line of names")
    rows = values[:, order]
    if column in NOT_NEGATIVE and (rows[:, -1] < 0).any():
        below = int(np.argmax(rows[:, -1] < 0))
        raise ModelError(
            f"{path.name}, line {line_numbers[below][0]}: expected a {column} of at least 0, "
            f"got {rows[below, -1]:g}"
        )
    return axes, _once(path, rows, column)


def _once(path: Path, rows: np.ndarray, column: str) -> np.ndarray:
    """Rows without repetitions; ModelError where one place has two values."""
    rows = np.unique(rows, axis=0)
    points, counts = np.unique(rows[:, :-1], axis=0, return_counts=True)
    if (counts > 1).any():
        where = ", ".join(f"{v:g}" for v in points[np.argmax(counts)])
        raise ModelError(f"{path.name}: the place {where} has {counts.max()} {column}s")
    return rows
