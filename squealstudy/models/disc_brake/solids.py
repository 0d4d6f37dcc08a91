"""The four meshed solids of the disc brake."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.models.fem.grid import Block, cylindrical_mesh, grid_lines
from squealstudy.models.fem.material import Isotropic, Material, TransverselyIsotropic
from squealstudy.models.fem.solid import Solid, assemble_solid

# element sizes of the medium mesh: radial [m], around [deg], axial [m], axial in the lining [m]
MEDIUM_SIZES = np.array([0.018, 5.0, 0.016, 0.005])
MESH_FACTOR = {"coarse": 1.5, "medium": 1.0, "fine": 2.0 / 3.0}
FULL_TURN = (0.0, 2 * np.pi)


@dataclass(frozen=True)
class BrakeMesher:
    """Parameter values (SI, angles in degrees) and element sizes; builds the four solids."""

    values: Mapping[str, float]
    sizes: np.ndarray

    def v(self, name: str) -> float:
        """Value of a parameter."""
        return self.values[name]

    def angle(self, name: str) -> float:
        """Value of an angle, rad."""
        return np.deg2rad(self.values[name])

    def isotropic(self, prefix: str) -> Isotropic:
        """Material of the parameters that begin with `prefix`."""
        return Isotropic(
            *(self.v(prefix + p) for p in ("young_modulus", "poisson_ratio", "density"))
        )

    def around(self, breaks: list[float]) -> np.ndarray:
        """Theta lines through the breaks [rad] and their mirror images."""
        return grid_lines([*breaks, *(-b for b in breaks)], np.deg2rad(self.sizes[1]))

    def disc(self) -> Solid:
        """Band at 0 <= z <= thickness, bell and top below it."""
        v = self.v
        band, bell, top = v("disc.thickness"), v("disc.bell_height"), v("disc.top_thickness")
        bi, bo = v("disc.bell_inner_radius"), v("disc.bell_outer_radius")
        ri, ro, hub = v("disc.inner_radius"), v("disc.outer_radius"), v("hub.radius")
        r = grid_lines([ri, hub, bi, bo, v("pad.inner_radius"), ro], self.sizes[0])
        z = grid_lines([-bell - top, -bell, 0.0, band], self.sizes[2])
        theta = np.linspace(*FULL_TURN, round(360 / self.sizes[1]) + 1)
        blocks = [
            Block((bi, ro), FULL_TURN, (0.0, band), "iron"),
            Block((bi, bo), FULL_TURN, (-bell, 0.0), "iron"),
            Block((ri, bo), FULL_TURN, (-bell - top, -bell), "iron"),
        ]
        return assemble_solid(
            cylindrical_mesh(r, theta, z, blocks), {"iron": self.isotropic("disc.")}
        )

    def pad(self, side: int) -> Solid:
        """Outer pad (side +1, above the disc) or inner pad (-1, below it)."""
        v = self.v
        lining, plate = v("pad.lining_thickness"), v("pad.plate_thickness")
        half, ear = self.angle("pad.half_angle"), self.angle("pad.ear_angle")
        z_face = v("disc.thickness") if side > 0 else 0.0
        z = np.concatenate(
            [
                grid_lines([0.0, lining], self.sizes[3]),
                lining + grid_lines([0.0, plate], self.sizes[3])[1:],
            ]
        )
        z = np.sort(z_face + side * z)
        r_span = (v("pad.inner_radius"), v("pad.outer_radius"))
        z_plate = np.sort(z_face + side * np.array([lining, lining + plate]))
        blocks = [
            Block(r_span, (-half, half), (-np.inf, np.inf), "lining"),
            Block(r_span, (-half - ear, half + ear), (z_plate[0], z_plate[1]), "plate"),
        ]
        theta = self.around([half, half + ear, self.angle("piston.half_angle")])
        grid = cylindrical_mesh(grid_lines(r_span, self.sizes[0]), theta, z, blocks)
        materials: dict[str, Material] = {
            "plate": self.isotropic("pad.plate_"),
            "lining": TransverselyIsotropic(
                v("pad.lining_young_modulus"),
                v("pad.lining_young_modulus_z"),
                v("pad.lining_shear_modulus_z"),
                v("pad.lining_poisson_ratio"),
                v("pad.lining_poisson_ratio_z"),
                v("pad.lining_density"),
            ),
        }
        return assemble_solid(grid, materials)

    @property
    def plate_z(self) -> tuple[float, float]:
        """Height of the inner and of the outer back plate's free face, m."""
        pad = self.v("pad.lining_thickness") + self.v("pad.plate_thickness")
        return -pad, self.v("disc.thickness") + pad

    def caliper(self) -> Solid:
        """Body behind the inner pad, bridge over the disc, two fingers behind the outer pad."""
        v, angle = self.v, self.angle
        z_in, z_out = self.plate_z
        z_low, z_high = z_in - v("caliper.body_thickness"), z_out + v("caliper.finger_thickness")
        ri, rb, ro = (v(f"caliper.{n}_radius") for n in ("inner", "bridge_inner", "outer"))
        bridge, body = angle("caliper.bridge_half_angle"), angle("caliper.body_half_angle")
        near, far = angle("caliper.finger_inner_angle"), angle("caliper.finger_outer_angle")
        r = grid_lines([ri, v("pad.outer_radius"), rb, ro], self.sizes[0])
        theta = self.around([bridge, body, near, far, angle("piston.half_angle")])
        z = grid_lines([z_low, z_in, z_out, z_high], self.sizes[2])
        blocks = [
            Block((rb, ro), (-bridge, bridge), (z_low, z_high), "iron"),
            Block((ri, ro), (-body, body), (z_low, z_in), "iron"),
            Block((ri, ro), (near, far), (z_out, z_high), "iron"),
            Block((ri, ro), (-far, -near), (z_out, z_high), "iron"),
        ]
        return assemble_solid(
            cylindrical_mesh(r, theta, z, blocks), {"iron": self.isotropic("caliper.")}
        )
