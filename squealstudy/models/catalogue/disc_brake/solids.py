"""The four meshed solids of the disc brake, and the densities of their meshes.

A density states the numbers of cells between geometric breaks of the solids. These do not depend on
parameter values, so that a sweep of a length or an angle keeps its mesh. Errors of these densities:
`studies/benchmarks/mesh_convergence.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.models.catalogue.disc_brake.parameters import (
    MIN_BREAK_DISTANCE_M_OR_RAD,
    vanishing,
)
from squealstudy.models.fem.grid import GridBlock, Interval, cylindrical_mesh, graded_lines
from squealstudy.models.fem.solid import (
    REDUCED_INTEGRATION_ORDER,
    Isotropic,
    Material,
    Solid,
    TransverselyIsotropic,
    assemble_solid,
)

# Thin parts, which bend, have two cells through their thickness. Graded layers lie on the longer
# side of a re-entrant corner. Refining one part alone misleads, since errors of parts cancel.
GRADING_1 = (0.15,)
GRADING_2 = (0.04, 0.15)
GRADING_2_WIDE = (0.06, 0.25)
GRADING_3 = (0.02, 0.07, 0.25)


@dataclass(frozen=True)
class Density:
    """Intervals between breaks, as `BrakeMesher` lists the breaks of each direction.

    Attributes
    ----------
    around : int
        Number of cells of the disc in the circumference.
    disc_r, disc_z, pad_r, pad_theta, pad_z, caliper_r, caliper_z : tuple of Interval
    caliper_middle, caliper_angles : Interval
        From the plane of symmetry to a finger; beyond it, between neighbouring angles of body,
        fingers and bridge. The outermost has no graded layer at its free end.
    split : tuple of int
        Numbers of parts into which every cell is divided in r, theta and z.
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
    disc_r=(Interval(), Interval(high=GRADING_1), Interval(), Interval(3, low=GRADING_1)),
    disc_z=(Interval(2), Interval(1, GRADING_1, GRADING_1), Interval(2)),  # top, bell, band
    pad_r=(Interval(3),),
    pad_theta=(Interval(1), Interval(4), Interval(4), Interval(4), Interval(1)),
    pad_z=(Interval(2), Interval(1)),  # lining, plate
    caliper_r=(Interval(2), Interval(1, high=GRADING_1), Interval(2)),  # pads, clearance, bridge
    caliper_z=(
        Interval(2, high=GRADING_2_WIDE),
        Interval(2, GRADING_2_WIDE, GRADING_2_WIDE),
        Interval(2),
    ),
    caliper_middle=Interval(1, high=GRADING_1),
    caliper_angles=Interval(1, GRADING_1, GRADING_1),
)
COARSE = replace(
    MEDIUM,
    around=24,
    pad_r=(Interval(2),),
    pad_theta=(Interval(1), Interval(3), Interval(3), Interval(3), Interval(1)),
    caliper_r=(Interval(1), Interval(1, high=GRADING_1), Interval(2)),
    caliper_z=(Interval(1, high=GRADING_1), Interval(1, GRADING_1, GRADING_1), Interval(2)),
    caliper_middle=Interval(1),
    caliper_angles=Interval(1),
)
FINE = replace(
    MEDIUM,
    around=48,
    disc_r=(Interval(), Interval(high=GRADING_2), Interval(2), Interval(5, low=GRADING_2)),
    disc_z=(Interval(3), Interval(2, GRADING_2, GRADING_2), Interval(3)),
    pad_r=(Interval(5),),
    pad_theta=(Interval(2), Interval(6), Interval(6), Interval(6), Interval(2)),
    pad_z=(Interval(3), Interval(2)),
    caliper_r=(Interval(3), Interval(1, high=GRADING_3), Interval(3)),
    caliper_z=(Interval(3, high=GRADING_3), Interval(3, GRADING_3, GRADING_3), Interval(3)),
    caliper_middle=Interval(1, high=GRADING_2_WIDE),
    caliper_angles=Interval(2, GRADING_1, GRADING_1),
)
DENSITIES = {"coarse": COARSE, "medium": MEDIUM, "fine": FINE}


FULL_TURN = (0.0, 2 * np.pi)


@dataclass(frozen=True)
class BrakeMesher:
    """Builder of the four solids.

    Attributes
    ----------
    values : mapping of str -> float
        Values of the parameters, in SI units, angles in degrees.
    density : Density
    stiffness_order : int
        Order of integration, as in `assemble_solid`.

    Raises
    ------
    ParameterError
        A part of the brake vanishes.
    """

    values: Mapping[str, float]
    density: Density
    stiffness_order: int = REDUCED_INTEGRATION_ORDER

    def __post_init__(self) -> None:
        if pair := vanishing(self.values):
            smaller, larger = pair
            raise ParameterError(
                larger, f"{self.v(larger):g} must be larger than {smaller}, {self.v(smaller):g}"
            )

    def v(self, name: str) -> float:
        """Value of a parameter."""
        return self.values[name]

    def angle(self, name: str) -> float:
        """Value of an angle, rad."""
        return np.deg2rad(self.values[name])

    def materials(self, component: str) -> dict[str, Material]:
        """Materials of a component by the names in its blocks."""
        if component in ("disc", "caliper"):
            return {"iron": self._isotropic(component + ".")}
        scale = self.v("pad.lining_stiffness_scale")
        return {
            "plate": self._isotropic("pad.plate_"),
            "lining": TransverselyIsotropic(
                scale * self.v("pad.lining_young_modulus"),
                scale * self.v("pad.lining_young_modulus_z"),
                scale * self.v("pad.lining_shear_modulus_z"),
                self.v("pad.lining_poisson_ratio"),
                self.v("pad.lining_poisson_ratio_z"),
                self.v("pad.lining_density"),
            ),
        }

    def _isotropic(self, prefix: str) -> Isotropic:
        """Material from the parameters whose names begin with `prefix`."""
        return Isotropic(
            *(self.v(prefix + p) for p in ("young_modulus", "poisson_ratio", "density"))
        )

    def component(self, name: str) -> Solid:
        """The solid of a component: disc, inner_pad, outer_pad or caliper."""
        if name.endswith("pad"):
            return self.pad(1 if name == "outer_pad" else -1)
        return self.disc() if name == "disc" else self.caliper()

    def _solid(
        self,
        component: str,
        lines: tuple[np.ndarray, np.ndarray, np.ndarray],
        blocks: list[GridBlock],
    ) -> Solid:
        """The union of blocks, assembled on lines in r [m], theta [rad] and z [m]."""
        grid = cylindrical_mesh(*lines, blocks)
        return assemble_solid(grid, self.materials(component), self.stiffness_order)

    def disc(self) -> Solid:
        """Band at 0 <= z <= thickness, bell and top below it."""
        v, split = self.v, self.density.split
        band, bell, top = v("disc.thickness"), v("disc.bell_height"), v("disc.top_thickness")
        bi, bo = v("disc.bell_inner_radius"), v("disc.bell_outer_radius")
        ri, ro, hub = v("disc.inner_radius"), v("disc.outer_radius"), v("hub.radius")
        lines = (
            graded_lines([ri, hub, bi, bo, ro], self.density.disc_r, split[0]),
            np.linspace(*FULL_TURN, self.density.around * split[1] + 1),
            graded_lines([-bell - top, -bell, 0.0, band], self.density.disc_z, split[2]),
        )
        blocks = [
            GridBlock((bi, ro), FULL_TURN, (0.0, band), "iron"),
            GridBlock((bi, bo), FULL_TURN, (-bell, 0.0), "iron"),
            GridBlock((ri, bo), FULL_TURN, (-bell - top, -bell), "iron"),
        ]
        return self._solid("disc", lines, blocks)

    def pad(self, side: int) -> Solid:
        """Outer pad (side +1, above the disc) or inner pad (-1, below it)."""
        v, split = self.v, self.density.split
        lining, plate = v("pad.lining_thickness"), v("pad.plate_thickness")
        half, ear = self.angle("pad.half_angle"), self.angle("pad.ear_angle")
        piston = self.angle("piston.half_angle")
        z_face = v("disc.thickness") if side > 0 else 0.0
        r_span = (v("pad.inner_radius"), v("pad.outer_radius"))
        z_plate = np.sort(z_face + side * np.array([lining, lining + plate]))
        blocks = [
            GridBlock(r_span, (-half, half), (-np.inf, np.inf), "lining"),
            GridBlock(r_span, (-half - ear, half + ear), (z_plate[0], z_plate[1]), "plate"),
        ]
        theta = [-half - ear, -half, -piston, piston, half, half + ear]
        z = graded_lines([0.0, lining, lining + plate], self.density.pad_z, split[2])
        lines = (
            graded_lines(r_span, self.density.pad_r, split[0]),
            graded_lines(theta, self.density.pad_theta, split[1]),
            np.sort(z_face + side * z),
        )
        return self._solid("pad", lines, blocks)

    @property
    def plate_z(self) -> tuple[float, float]:
        """Height of the inner and of the outer back plate's free face, m."""
        pad = self.v("pad.lining_thickness") + self.v("pad.plate_thickness")
        return -pad, self.v("disc.thickness") + pad

    def caliper(self) -> Solid:
        """Body behind the inner pad, bridge over the disc, two fingers behind the outer pad."""
        v, angle, split = self.v, self.angle, self.density.split
        z_in, z_out = self.plate_z
        z_low, z_high = z_in - v("caliper.body_thickness"), z_out + v("caliper.finger_thickness")
        ri, rb, ro = (v(f"caliper.{n}_radius") for n in ("inner", "bridge_inner", "outer"))
        bridge, body = angle("caliper.bridge_half_angle"), angle("caliper.body_half_angle")
        near, far = angle("caliper.finger_inner_angle"), angle("caliper.finger_outer_angle")
        lines = (
            graded_lines([ri, v("pad.outer_radius"), rb, ro], self.density.caliper_r, split[0]),
            self._caliper_theta(near, [body, far, bridge]),
            graded_lines([z_low, z_in, z_out, z_high], self.density.caliper_z, split[2]),
        )
        blocks = [
            GridBlock((rb, ro), (-bridge, bridge), (z_low, z_high), "iron"),
            GridBlock((ri, ro), (-body, body), (z_low, z_in), "iron"),
            GridBlock((ri, ro), (near, far), (z_out, z_high), "iron"),
            GridBlock((ri, ro), (-far, -near), (z_out, z_high), "iron"),
        ]
        return self._solid("caliper", lines, blocks)

    def _caliper_theta(self, near: float, angles: list[float]) -> np.ndarray:
        """Lines on both sides of the plane of symmetry, through `near` and `angles` [rad].

        Angles may coincide, as those of fingers and bridge do by default. The number of cells
        changes where a sweep makes angles meet or part.
        """
        beyond = [near, *sorted(angles)]
        distinct = [
            beyond[0],
            *(b for a, b in pairwise(beyond) if b - a > MIN_BREAK_DISTANCE_M_OR_RAD),
        ]
        between = [self.density.caliper_angles] * (len(distinct) - 1)
        between[-1] = replace(between[-1], high=())
        half = graded_lines(
            [0.0, *distinct], [self.density.caliper_middle, *between], self.density.split[1]
        )
        return np.concatenate([-half[:0:-1], half])
