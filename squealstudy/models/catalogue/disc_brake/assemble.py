"""Assembles the generated disc brake from its parameters: meshes, interfaces, load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from squealstudy.laws import ContactLaw
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.catalogue.disc_brake.heat import hot_gaps
from squealstudy.models.catalogue.disc_brake.parameters import (
    COMPONENTS,
    SETS,
    effective_radius,
    is_hot,
    mean_radius,
)
from squealstudy.models.catalogue.disc_brake.solids import DENSITIES, BrakeMesher
from squealstudy.models.component_slices import component_slices, expand_rows
from squealstudy.models.fem.sampling import (
    FacetFilter,
    Surface,
    corresponding_rows,
    facing_surface,
    sample_surface,
)
from squealstudy.models.fem.solid import Solid
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.turning import Rotors

AXIAL = np.array([0.0, 0.0, 1.0])
LAYER_POINTS = 3  # Gauss points a side of a facet in the linear layers


def _radial(points: np.ndarray) -> np.ndarray:
    e = points * np.array([1.0, 1.0, 0.0])
    return e / np.linalg.norm(e, axis=1, keepdims=True)


def _around(points: np.ndarray) -> np.ndarray:
    return np.cross(AXIAL, _radial(points))


class BrakeInterfaces:
    """Contact, springs and load of the brake, as rows over the whole brake."""

    def __init__(
        self, mesher: BrakeMesher, solids: Mapping[str, Solid], components: tuple[Component, ...]
    ) -> None:
        self._m, self._solids, self._faces = mesher, solids, brake_faces(mesher)
        self._spans, self._n_dof = component_slices(components)

    def _rows(self, *parts: tuple[str, sp.spmatrix]) -> sp.csr_matrix:
        return expand_rows(parts, self._spans, self._n_dof)

    def _face(self, component: str, face: str, side: int = LAYER_POINTS) -> Surface:
        """Gauss points of a named face."""
        return sample_surface(self._solids[component], self._faces[component][face], side)

    def _facing(
        self, component: str, face: str, other: str, side: int = LAYER_POINTS
    ) -> tuple[Surface, Surface]:
        """A named face of `component`, and the same points on `other`."""
        surface = self._face(component, face, side)
        return surface, facing_surface(self._solids[other], surface)

    # -- contact ---------------------------------------------------------------------------------
    def contact(
        self,
        law: ContactLaw,
        points_per_side: int,
        mean_radius: float | None,
        friction_factors: Mapping[str, float],
    ) -> ContactInterface:
        """Contact of both pad faces with the disc, which turns about +z.

        The imposed speed is that at `mean_radius` [m]; None: all points have this speed.
        `friction_factors` has the factor of each pad.
        """
        pads = ("inner_pad", "outer_pad")
        sides = [self._contact_side(pad, points_per_side) for pad in pads]
        numbers = [len(side.points) for side, _ in sides]
        points = np.vstack([side.points for side, _ in sides])
        N, T, T_perp = (
            sp.vstack(part).tocsr() for part in zip(*(r for _, r in sides), strict=True)
        )
        n, radius = len(points), np.hypot(points[:, 0], points[:, 1])
        return ContactInterface(
            N,
            T,
            T_perp,
            area=np.concatenate([side.area for side, _ in sides]),
            gap0=np.zeros(n),
            radius=radius,
            law=law,
            frictional=np.repeat([friction_factors[pad] for pad in pads], numbers),
            speed_factor=np.ones(n) if mean_radius is None else radius / mean_radius,
            points=points,
            pairs=tuple(
                pad for pad, (side, _) in zip(pads, sides, strict=True) for _ in side.points
            ),
        )

    def _contact_side(
        self, pad: str, points_per_side: int
    ) -> tuple[Surface, tuple[sp.csr_matrix, ...]]:
        """Contact points of one pad and their rows N, T and T_perp."""
        s_pad, s_disc = self._facing(pad, "LINING", "disc", points_per_side)
        opening = -s_pad.normal  # from the disc towards the pad
        normal = self._rows((pad, s_pad.observe(opening)), ("disc", -s_disc.observe(opening)))
        sliding = [
            self._rows(("disc", s_disc.observe(d)), (pad, -s_pad.observe(d)))
            for d in (_around(s_pad.points), _radial(s_pad.points))
        ]
        return s_pad, (normal, *sliding)

    # -- linear layers and springs ---------------------------------------------------------------
    def springs(self) -> tuple[SpringInterface, ...]:
        """Springs of hub, fingers, piston, abutments and guides."""
        v = self._m.v
        hub = self._face("disc", "HUB")
        fingers = self._facing("caliper", "FINGERS", "outer_pad")
        piston = self._facing("inner_pad", "PISTON", "caliper")
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

    def _layer(
        self,
        name: str,
        sides: tuple[tuple[str, Surface], ...],
        stiffness: float,
        in_static: bool = True,
    ) -> SpringInterface:
        """A layer of normal and tangential springs between two surfaces, or to ground.

        `stiffness` is the normal one per area [N/m3].
        """
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
        """Springs from the end faces of both ears to ground; parameters are those of one ear."""
        k = [2 * self._m.v(f"abutment.{d}_stiffness") for d in ("tangential", "radial", "axial")]
        return self._to_ground(f"{pad}_abutment", pad, self._face(pad, "EARS"), k)

    def _guides(self) -> SpringInterface:
        """Springs from the end faces of the caliper's bridge, between both plates, to ground."""
        k, k_axial = self._m.v("guides.stiffness"), self._m.v("guides.axial_stiffness")
        return self._to_ground(
            "guides", "caliper", self._face("caliper", "GUIDES"), [k, k, k_axial]
        )

    def _to_ground(
        self, name: str, component: str, surface: Surface, stiffness: list[float]
    ) -> SpringInterface:
        """Springs spread over a surface; total tangential, radial and axial stiffness [N/m]."""
        share = surface.area / surface.area.sum()
        directions = (_around(surface.points), _radial(surface.points), AXIAL)
        rows = [self._rows((component, surface.observe(d))) for d in directions]
        return SpringInterface(
            name, sp.vstack(rows).tocsr(), np.concatenate([k * share for k in stiffness])
        )

    # -- load ------------------------------------------------------------------------------------
    def brake_load(self) -> np.ndarray:
        """Forces (n_dof,) of a unit pressure [N/Pa], on the inner pad and the caliper."""
        pad, caliper = self._facing("inner_pad", "PISTON", "caliper")
        per_area = self._m.v("piston.area") * pad.area / pad.area.sum()
        rows = self._rows(("inner_pad", pad.observe(AXIAL)), ("caliper", -caliper.observe(AXIAL)))
        return np.asarray(rows.T @ per_area)


ON_PLANE_TOLERANCE_M_OR_RAD = 1e-6  # distance, m or rad, within which a facet centre is on a plane


def brake_faces(mesher: BrakeMesher) -> dict[str, dict[str, FacetFilter]]:
    """Filters by component and face (`parameters.SETS`)."""
    z_in, z_out = mesher.plate_z
    thickness, r_pad = mesher.v("disc.thickness"), mesher.v("pad.outer_radius")
    hub_z = -mesher.v("disc.bell_height") - mesher.v("disc.top_thickness")
    hub_r, bridge_r = mesher.v("hub.radius"), mesher.v("caliper.bridge_inner_radius")
    bridge = mesher.angle("caliper.bridge_half_angle")
    ear = mesher.angle("pad.half_angle") + mesher.angle("pad.ear_angle")
    piston = mesher.angle("piston.half_angle")
    # facets on top of the bridge are flat, and lie lower than its radius
    top_r = bridge_r + 0.75 * (mesher.v("caliper.outer_radius") - bridge_r)
    pads: dict[str, dict[str, FacetFilter]] = {
        "inner_pad": {
            "LINING": lambda r, t, z: _on(z, 0.0),
            "EARS": lambda r, t, z: _on(abs(t), ear),
            "PISTON": lambda r, t, z: _on(z, z_in) & (abs(t) < piston),
        },
        "outer_pad": {
            "LINING": lambda r, t, z: _on(z, thickness),
            "EARS": lambda r, t, z: _on(abs(t), ear),
            "BACK": lambda r, t, z: _on(z, z_out),
        },
    }
    disc: dict[str, FacetFilter] = {
        "HUB": lambda r, t, z: _on(z, hub_z) & (r < hub_r),
        "INNER": lambda r, t, z: _on(z, 0.0),
        "OUTER": lambda r, t, z: _on(z, thickness),
    }

    def between(z: np.ndarray) -> np.ndarray:  # over the disc and the pads
        return (z > z_in) & (z < z_out)

    caliper: dict[str, FacetFilter] = {
        "FINGERS": lambda r, t, z: _on(z, z_out) & (r < r_pad),
        # the bridge's end faces
        "GUIDES": lambda r, t, z: _on(abs(t), bridge) & (r > bridge_r) & between(z),
        "BODY": lambda r, t, z: _on(z, z_in),
        # its outer face, between its ends
        "BRIDGE": lambda r, t, z: (
            (r > top_r) & (abs(t) < bridge - ON_PLANE_TOLERANCE_M_OR_RAD) & between(z)
        ),
    }
    return {"disc": disc, **pads, "caliper": caliper}


def _on(x: np.ndarray, plane: float) -> np.ndarray:
    on: np.ndarray = abs(x - plane) < ON_PLANE_TOLERANCE_M_OR_RAD
    return on


@dataclass(frozen=True)
class _Face:
    """A named face, whose points are sampled when it is called."""

    mesher: BrakeMesher
    solid: Solid
    component: str
    face: str

    def __call__(self) -> Surface:
        keep = brake_faces(self.mesher)[self.component][self.face]
        return sample_surface(self.solid, keep, LAYER_POINTS)


def assemble(options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
    """Assemble the brake from a value of every option and parameter. Returns an Assembly."""
    mesher = BrakeMesher(values, DENSITIES[str(options["mesh"])])
    solids = {name: mesher.component(name) for name in COMPONENTS}
    rotors = Rotors(("disc",), radius=mean_radius(values))
    turning = {name: solids[name].gyroscopic(rotors, name) for name in rotors.names}
    components = tuple(
        Component(
            name=name,
            M=solids[name].M,
            K=solids[name].K,
            coordinates=solids[name].coordinates,
            correspondence=corresponding_rows(solids[name]),
            cells=solids[name].cells,
            turning=turning.get(name),
            sets={face: _Face(mesher, solids[name], name, face) for face in SETS[name]},
        )
        for name in COMPONENTS
    )
    interfaces = BrakeInterfaces(mesher, solids, components)
    law = ContactLaw.from_values(str(options["contact_law"]), values)
    load, radius = interfaces.brake_load(), effective_radius(options, values)
    points_a_side = int(options["contact_points"])
    factors = {pad: values[f"{pad}.friction_factor"] for pad in ("inner_pad", "outer_pad")}
    cold = Assembly(
        components,
        interfaces.contact(law, points_a_side, radius, factors),
        interfaces.springs(),
        load,
        np.zeros_like(load),
        rotors,
    )
    if not is_hot(values):
        return cold
    gap0 = hot_gaps(mesher, solids, cold)
    return replace(cold, contact=replace(cold.contact, gap0=gap0))
