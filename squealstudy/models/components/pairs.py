"""Contact points between two surfaces whose meshes do not match.

Points are on the slave and are projected on the master along the slave's normals. ``gauss`` takes
the Gauss points of the slave's facets, which is simple, but does not transfer a uniform pressure
exactly. ``clipped`` cuts a slave facet into segments, each opposite one master facet, and takes the
same means over them on both sides. It transfers a uniform pressure exactly between parallelograms
and triangles with straight edges, whatever their sizes, and nearly between other facets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.opposite import Opposite, gauss_points, near_facets, survey
from squealstudy.models.components.segment_points import Segments, segment_means
from squealstudy.models.fem.sampling import Surface

QUADRATURES = ("clipped", "gauss")
# share of a slave in reach from which all of it counts as in reach: chords cut curved edges short
FULL_REACH_SHARE = 1 - 1e-3


@dataclass(frozen=True)
class Pair:
    """Contact points of two surfaces.

    Attributes
    ----------
    slave, master : Surface
        The two sides: the same points and areas, opposite normals, their own shape functions.
    gap0 : ndarray (n,)
        Initial gap that the contact law sees, m.
    geometric_gap : ndarray (n,)
        Distance from the slave's surface to the master's along the slave's normal, m; negative
        where they overlap.
    in_reach : float
        Share of the slave's area with the master opposite and no further than `search`.
    covered : float
        Share of the slave's area with the master opposite at any distance. Where part of the slave
        is out of reach, this share is estimated at up to 2000 of its Gauss points.
    gap_range : tuple of float
        Least and greatest gap found, at any distance, m.
    """

    slave: Surface
    master: Surface
    gap0: np.ndarray
    geometric_gap: np.ndarray
    in_reach: float
    covered: float
    gap_range: tuple[float, float]

    @property
    def gap_mean(self) -> float:
        """Mean of the geometric gap over the area in reach, m."""
        return float(np.average(self.geometric_gap, weights=self.slave.area))

    @property
    def gap_spread(self) -> float:
        """Standard deviation of the geometric gap over the area in reach, m."""
        deviation = self.geometric_gap - self.gap_mean
        return float(np.sqrt(np.average(deviation**2, weights=self.slave.area)))


def pair(
    slave: Facets,
    master: Facets,
    *,
    search: float,
    quadrature: str = "clipped",
    initial_gap: float | str = "zero",
    points_per_side: int = 3,
    pieces: int = 4,
    degree: int = 8,
) -> Pair:
    """Contact points on `slave` and their projections on `master`.

    Parameters
    ----------
    slave, master : Facets
        Two surfaces whose normals oppose each other.
    search : float
        Greatest distance of points in contact, whether they are apart or overlap, m.
    quadrature : str
        ``clipped`` or ``gauss``.
    initial_gap : str or float
        ``zero``, ``geometric`` or a number [m].
    points_per_side : int
        n x n points on a quadrilateral; on a triangle 1, 3, 6 for n = 1, 2, 3, and n x n above.
        At most 3 for ``clipped``, 32 for ``gauss``.
    pieces : int
        For ``clipped``: number of chords that replace a curved edge, at least 1.
    degree : int
        For ``clipped``: degree of the quadrature on segments, 2 to 12. On quadratic facets that are
        parallelograms or triangles with straight edges, sums of forces are exact from degree 4,
        the shape functions of each point from degree 8.

    Returns
    -------
    Pair

    Raises
    ------
    ModelError
        Settings are out of range, nothing is in reach, normals point the same way, or master facets
        lie above each other.
    """
    _check(search, quadrature, initial_gap, points_per_side, pieces, degree)
    neighbours = near_facets(slave, master, search)
    if quadrature == "gauss":
        opposite = gauss_points(slave, master, neighbours, search, points_per_side)
    else:
        settings = Segments(points_per_side, pieces, degree, search)
        opposite = segment_means(slave, master, neighbours, settings)
    names = f"{slave.name} on {master.name}"
    if opposite.same_way > opposite.area.sum():  # both areas of the slave, m2
        raise ModelError(
            f"{names}: the normals of the two surfaces point the same way; facets are numbered so "
            "that normals point out of the body, or one surface is the far side of its body"
        )
    in_reach = min(1.0, opposite.area.sum() / slave.areas.sum())  # round-off may add a hair
    if in_reach >= FULL_REACH_SHARE:
        covered, gaps = in_reach, opposite.gap
    else:
        covered, gaps = survey(slave, master)
    if not len(opposite.area):
        raise ModelError(f"{names}: nothing lies within {search:.3g} m; {_where(covered, gaps)}")
    gaps = np.concatenate([gaps, opposite.gap])
    return Pair(
        slave=Surface(opposite.points, opposite.area, opposite.normal, opposite.slave),
        master=Surface(opposite.points, opposite.area, -opposite.normal, opposite.master),
        gap0=_initial(initial_gap, opposite),
        geometric_gap=opposite.gap,
        in_reach=float(in_reach),
        covered=float(max(covered, in_reach)),
        gap_range=(float(gaps.min()), float(gaps.max())),
    )


def _initial(initial_gap: float | str, opposite: Opposite) -> np.ndarray:
    """Initial gap (n,) [m]."""
    if initial_gap == "geometric":
        return opposite.gap.copy()
    return np.full(len(opposite.gap), 0.0 if initial_gap == "zero" else float(initial_gap))


def _where(covered: float, gaps: np.ndarray) -> str:
    """Words about the master's distance, for a message."""
    if not len(gaps):
        return "no normal of the slave meets the master: is a part placed wrongly?"
    return (
        f"{100 * covered:.3g} % of the slave has the master opposite, {gaps.min():.4g} to "
        f"{gaps.max():.4g} m away: is a part placed wrongly, or the unit of length another?"
    )


def _check(
    search: float,
    quadrature: str,
    initial_gap: float | str,
    points_per_side: int,
    pieces: int,
    degree: int,
) -> None:
    """Raise ModelError where a setting is out of range."""
    max_points = 3 if quadrature == "clipped" else 32
    if quadrature not in QUADRATURES:
        raise ModelError(f"quadrature '{quadrature}' is not known; there are clipped and gauss")
    if not 0 < search < np.inf:
        raise ModelError(f"search must be a distance above zero, got {search}")
    if isinstance(initial_gap, str):
        if initial_gap not in ("zero", "geometric"):
            raise ModelError(
                f"initial_gap '{initial_gap}' is not known; it is zero, geometric or a number"
            )
    elif not np.isfinite(initial_gap):
        raise ModelError(f"initial_gap must be finite, got {initial_gap}")
    if not 1 <= points_per_side <= max_points:
        raise ModelError(
            f"{quadrature} has 1 to {max_points} points a side of a facet, got {points_per_side}"
        )
    if pieces < 1 or not 2 <= degree <= 12:
        raise ModelError(f"clipping needs pieces >= 1 and degree 2 to 12, got {pieces}, {degree}")
