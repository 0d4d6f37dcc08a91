"""Mesh densities of the disc brake: the cells between the geometric breaks of its solids.

The cells of a density do not follow the values of the parameters, so that a sweep of a length or
an angle keeps its mesh. Errors of these densities: `studies/benchmarks/mesh_convergence.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from squealstudy.models.fem.grid import Interval

# Thin parts, which bend, have two cells through their thickness; graded layers lie on the longer
# side of a re-entrant corner. With cells of one part alone refined, errors cancel and mislead.
ONE = (0.15,)
TWO = (0.04, 0.15)
WIDE = (0.06, 0.25)
THREE = (0.02, 0.07, 0.25)


@dataclass(frozen=True)
class Density:
    """Intervals between breaks, as `solids.py` lists the breaks of each direction.

    Attributes
    ----------
    around : int
        Cells of the disc in the circumference.
    disc_r, disc_z, pad_r, pad_theta, pad_z, caliper_r, caliper_z : tuple of Interval
    caliper_middle, caliper_angles : Interval
        Between the fingers, from the plane of symmetry; beyond, between neighbouring angles of
        the body, the fingers and the bridge. The outermost has no layer at its free end.
    split : tuple of int
        Parts into which every cell is divided in r, theta and z.
    """

    around: int
    disc_r: tuple[Interval, ...]
    disc_z: tuple[Interval, ...]
    pad_r: tuple[Interval, ...]
    pad_theta: tuple[Interval, ...]
    pad_z: tuple[Interval, ...]
    caliper_r: tuple[Interval, ...]
    caliper_z: tuple[Interval, ...]
    caliper_middle: Interval
    caliper_angles: Interval
    split: tuple[int, int, int] = (1, 1, 1)


MEDIUM = Density(
    around=36,
    # bore, hub, bell, band
    disc_r=(Interval(), Interval(high=ONE), Interval(), Interval(3, low=ONE)),
    disc_z=(Interval(2), Interval(1, ONE, ONE), Interval(2)),  # top, bell, band
    pad_r=(Interval(3),),
    pad_theta=(Interval(1), Interval(4), Interval(4), Interval(4), Interval(1)),
    pad_z=(Interval(2), Interval(1)),  # lining, plate
    caliper_r=(Interval(2), Interval(1, high=ONE), Interval(2)),  # pads, clearance, bridge
    caliper_z=(Interval(2, high=WIDE), Interval(2, WIDE, WIDE), Interval(2)),
    caliper_middle=Interval(1, high=ONE),
    caliper_angles=Interval(1, ONE, ONE),
)
COARSE = replace(
    MEDIUM,
    around=24,
    pad_r=(Interval(2),),
    pad_theta=(Interval(1), Interval(3), Interval(3), Interval(3), Interval(1)),
    caliper_r=(Interval(1), Interval(1, high=ONE), Interval(2)),
    caliper_z=(Interval(1, high=ONE), Interval(1, ONE, ONE), Interval(2)),
    caliper_middle=Interval(1),
    caliper_angles=Interval(1),
)
FINE = replace(
    MEDIUM,
    around=48,
    disc_r=(Interval(), Interval(high=TWO), Interval(2), Interval(5, low=TWO)),
    disc_z=(Interval(3), Interval(2, TWO, TWO), Interval(3)),
    pad_r=(Interval(5),),
    pad_theta=(Interval(2), Interval(6), Interval(6), Interval(6), Interval(2)),
    pad_z=(Interval(3), Interval(2)),
    caliper_r=(Interval(3), Interval(1, high=THREE), Interval(3)),
    caliper_z=(Interval(3, high=THREE), Interval(3, THREE, THREE), Interval(3)),
    caliper_middle=Interval(1, high=WIDE),
    caliper_angles=Interval(2, ONE, ONE),
)
DENSITIES = {"coarse": COARSE, "medium": MEDIUM, "fine": FINE}
