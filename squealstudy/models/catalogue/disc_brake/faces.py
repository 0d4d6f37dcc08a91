"""Named faces of the brake's components, as filters of facet centres (r, theta, z)."""

from __future__ import annotations

import numpy as np

from squealstudy.models.catalogue.disc_brake.solids import BrakeMesher
from squealstudy.models.fem.sampling import FacetFilter

EDGE = 1e-6  # m or rad: a facet centre on a plane is found within this


def brake_faces(mesher: BrakeMesher) -> dict[str, dict[str, FacetFilter]]:
    """Filters by component and face name.

    disc: ``inner_face``, ``outer_face`` (friction), ``hub``; pads: ``lining``, ``back`` and
    ``ears``, the inner one also ``piston``; caliper: ``fingers`` and ``guides``.
    """
    z_in, z_out = mesher.plate_z
    thickness, r_pad = mesher.v("disc.thickness"), mesher.v("pad.outer_radius")
    hub_z = -mesher.v("disc.bell_height") - mesher.v("disc.top_thickness")
    hub_r, bridge_r = mesher.v("hub.radius"), mesher.v("caliper.bridge_inner_radius")
    bridge = mesher.angle("caliper.bridge_half_angle")
    ear = mesher.angle("pad.half_angle") + mesher.angle("pad.ear_angle")
    piston = mesher.angle("piston.half_angle")
    pads = {
        "inner_pad": {
            "lining": lambda r, t, z: _on(z, 0.0),
            "back": lambda r, t, z: _on(z, z_in),
            "ears": lambda r, t, z: _on(abs(t), ear),
            "piston": lambda r, t, z: _on(z, z_in) & (abs(t) < piston),
        },
        "outer_pad": {
            "lining": lambda r, t, z: _on(z, thickness),
            "back": lambda r, t, z: _on(z, z_out),
            "ears": lambda r, t, z: _on(abs(t), ear),
        },
    }
    disc: dict[str, FacetFilter] = {
        "inner_face": lambda r, t, z: _on(z, 0.0),
        "outer_face": lambda r, t, z: _on(z, thickness),
        "hub": lambda r, t, z: _on(z, hub_z) & (r < hub_r),
    }
    caliper: dict[str, FacetFilter] = {
        "fingers": lambda r, t, z: _on(z, z_out) & (r < r_pad),
        # the bridge's end faces, over the disc and the pads
        "guides": lambda r, t, z: _on(abs(t), bridge) & (r > bridge_r) & (z > z_in) & (z < z_out),
    }
    return {"disc": disc, **pads, "caliper": caliper}


def _on(x: np.ndarray, plane: float) -> np.ndarray:
    on: np.ndarray = abs(x - plane) < EDGE
    return on
