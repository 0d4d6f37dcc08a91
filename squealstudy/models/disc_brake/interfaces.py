"""Interfaces of the disc brake: contact, layers of springs, springs to ground, brake load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.models.assembly import component_slices, expand_rows
from squealstudy.models.component import Component
from squealstudy.models.disc_brake.solids import BrakeMesher
from squealstudy.models.fem.sampling import FacetFilter, facing_surface, sample_surface
from squealstudy.models.fem.solid import Solid
from squealstudy.models.interface import ContactInterface, SpringInterface
from squealstudy.models.law import ContactLaw
from squealstudy.models.surface import Surface

AXIAL = np.array([0.0, 0.0, 1.0])
EDGE = 1e-6  # m or rad: a facet centre on a plane is found within this
LAYER_POINTS = 3  # Gauss points a side of a facet in the linear layers


def _radial(points: np.ndarray) -> np.ndarray:
    e = points * np.array([1.0, 1.0, 0.0])
    return e / np.linalg.norm(e, axis=1, keepdims=True)


def _around(points: np.ndarray) -> np.ndarray:
    return np.cross(AXIAL, _radial(points))


class BrakeInterfaces:
    """Observation rows over the whole brake, made from its four solids."""

    def __init__(
        self, mesher: BrakeMesher, solids: Mapping[str, Solid], components: tuple[Component, ...]
    ) -> None:
        self._m, self._solids = mesher, solids
        self._spans, self._n_dof = component_slices(components)

    def _rows(self, *parts: tuple[str, sp.spmatrix]) -> sp.csr_matrix:
        return expand_rows(parts, self._spans, self._n_dof)

    def _facing(
        self, one: str, other: str, keep: FacetFilter, side: int
    ) -> tuple[Surface, Surface]:
        """The surface of `one` that passes `keep`, and the same points on `other`."""
        surface = sample_surface(self._solids[one], keep, side)
        return surface, facing_surface(self._solids[other], surface)

    # -- contact ---------------------------------------------------------------------------------
    def contact(self, law: ContactLaw, points_per_side: int) -> ContactInterface:
        """Both pad faces against the disc; the disc turns about +z."""
        z_faces = {"inner_pad": 0.0, "outer_pad": self._m.v("disc.thickness")}
        sides = [self._contact_side(pad, z, points_per_side) for pad, z in z_faces.items()]
        points = np.vstack([side.points for side, _ in sides])
        N, T, T_perp = (
            sp.vstack(part).tocsr() for part in zip(*(r for _, r in sides), strict=True)
        )
        n = len(points)
        return ContactInterface(
            N,
            T,
            T_perp,
            area=np.concatenate([side.area for side, _ in sides]),
            gap0=np.zeros(n),
            radius=np.hypot(points[:, 0], points[:, 1]),
            law=law,
            frictional=np.ones(n),
        )

    def _contact_side(
        self, pad: str, z_face: float, points_per_side: int
    ) -> tuple[Surface, tuple[sp.csr_matrix, ...]]:
        """Contact points of one pad and their rows N, T and T_perp."""
        s_pad, s_disc = self._facing(
            pad, "disc", lambda r, t, z: abs(z - z_face) < EDGE, points_per_side
        )
        opening = -s_pad.normal  # from the disc towards the pad
        normal = self._rows((pad, s_pad.observe(opening)), ("disc", -s_disc.observe(opening)))
        sliding = [
            self._rows(("disc", s_disc.observe(d)), (pad, -s_pad.observe(d)))
            for d in (_around(s_pad.points), _radial(s_pad.points))
        ]
        return s_pad, (normal, *sliding)

    # -- linear layers and springs ---------------------------------------------------------------
    def springs(self) -> tuple[SpringInterface, ...]:
        """Hub, fingers, piston, abutments and guides."""
        v = self._m.v
        _, z_out = self._m.plate_z
        r_pad = v("pad.outer_radius")
        hub = sample_surface(self._solids["disc"], self._at_hub, LAYER_POINTS)
        fingers = self._facing(
            "caliper",
            "outer_pad",
            lambda r, t, z: (abs(z - z_out) < EDGE) & (r < r_pad),
            LAYER_POINTS,
        )
        piston = self._facing("inner_pad", "caliper", self._at_piston, LAYER_POINTS)
        return (
            self._layer("hub", (("disc", hub),), v("hub.stiffness")),
            self._layer(
                "fingers",
                tuple(zip(("caliper", "outer_pad"), fingers, strict=True)),
                v("fingers.stiffness"),
            ),
            self._layer(
                "piston",
                tuple(zip(("inner_pad", "caliper"), piston, strict=True)),
                v("piston.stiffness"),
                in_static=False,
            ),
            *(self._abutment(pad) for pad in ("inner_pad", "outer_pad")),
            self._guides(),
        )

    def _at_hub(self, r: np.ndarray, t: np.ndarray, z: np.ndarray) -> np.ndarray:
        bottom = -self._m.v("disc.bell_height") - self._m.v("disc.top_thickness")
        return (abs(z - bottom) < EDGE) & (r < self._m.v("hub.radius"))

    def _at_piston(self, r: np.ndarray, t: np.ndarray, z: np.ndarray) -> np.ndarray:
        return (abs(z - self._m.plate_z[0]) < EDGE) & (abs(t) < self._m.angle("piston.half_angle"))

    def _layer(
        self,
        name: str,
        sides: tuple[tuple[str, Surface], ...],
        stiffness: float,
        in_static: bool = True,
    ) -> SpringInterface:
        """Normal and tangential springs per area between two surfaces, or to ground."""
        ratio = self._m.v("layers.tangential_ratio")
        points, area = sides[0][1].points, sides[0][1].area
        signs = (1.0, -1.0)
        rows, k = [], []
        for direction, factor in ((AXIAL, 1.0), (_around(points), ratio), (_radial(points), ratio)):
            parts = [
                (c, sign * s.observe(direction)) for (c, s), sign in zip(sides, signs, strict=False)
            ]
            rows.append(self._rows(*parts))
            k.append(factor * stiffness * area)
        return SpringInterface(name, sp.vstack(rows).tocsr(), np.concatenate(k), in_static)

    def _abutment(self, pad: str) -> SpringInterface:
        """The two end faces of the back plate's ears to ground; stiffness is that of one ear."""
        v = self._m.v
        end = self._m.angle("pad.half_angle") + self._m.angle("pad.ear_angle")
        surface = sample_surface(
            self._solids[pad], lambda r, t, z: abs(abs(t) - end) < EDGE, LAYER_POINTS
        )
        return self._to_ground(
            f"{pad}_abutment",
            pad,
            surface,
            [2 * v(f"abutment.{d}_stiffness") for d in ("tangential", "radial", "axial")],
        )

    def _guides(self) -> SpringInterface:
        """The end faces of the caliper's bridge, over the disc and the pads, to ground."""
        end = self._m.angle("caliper.bridge_half_angle")
        z_in, z_out = self._m.plate_z
        surface = sample_surface(
            self._solids["caliper"],
            lambda r, t, z: (
                (abs(abs(t) - end) < EDGE)
                & (r > self._m.v("caliper.bridge_inner_radius"))
                & (z > z_in)
                & (z < z_out)
            ),
            LAYER_POINTS,
        )
        k, k_axial = self._m.v("guides.stiffness"), self._m.v("guides.axial_stiffness")
        return self._to_ground("guides", "caliper", surface, [k, k, k_axial])

    def _to_ground(
        self, name: str, component: str, surface: Surface, stiffness: list[float]
    ) -> SpringInterface:
        """Springs spread over a surface: around, radial and axial, in all [N/m]."""
        share = surface.area / surface.area.sum()
        directions = (_around(surface.points), _radial(surface.points), AXIAL)
        rows = [self._rows((component, surface.observe(d))) for d in directions]
        return SpringInterface(
            name, sp.vstack(rows).tocsr(), np.concatenate([k * share for k in stiffness])
        )

    # -- load ------------------------------------------------------------------------------------
    def brake_load(self) -> np.ndarray:
        """Forces of a unit pressure: the piston pushes the inner pad, the fluid the caliper."""
        pad, caliper = self._facing("inner_pad", "caliper", self._at_piston, LAYER_POINTS)
        per_area = self._m.v("piston.area") * pad.area / pad.area.sum()
        rows = self._rows(("inner_pad", pad.observe(AXIAL)), ("caliper", -caliper.observe(AXIAL)))
        return np.asarray(rows.T @ per_area)
