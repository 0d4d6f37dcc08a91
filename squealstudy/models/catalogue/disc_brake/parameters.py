"""Parameters of the disc brake; with the defaults it squeals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from squealstudy.models.operating import (
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    FRICTION_RANGE,
    GYROSCOPIC,
    LIGHTLY_DAMPED,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.parameter import Assumption, Declared, ModelOption, structural
from squealstudy.parameter import Parameter

COMPONENTS = ("disc", "inner_pad", "outer_pad", "caliper")
SETS = {  # named faces of each component, also in the exported brake
    "disc": ("HUB", "INNER", "OUTER"),
    "inner_pad": ("LINING", "EARS", "PISTON"),
    "outer_pad": ("LINING", "EARS", "BACK"),
    "caliper": ("FINGERS", "GUIDES", "BODY", "BRIDGE"),
}
KINEMATICS, UNIFORM, ROTATION = "kinematics", "uniform", "rotation"
OPTIONS = (
    ModelOption(
        "mesh",
        ("medium", "coarse", "fine"),
        "cells: about 29,000, 15,000 or 91,000 DOF",
    ),
    ModelOption("contact_points", (3, 2, 4), "contact points along each side of a pad facet"),
    ModelOption(
        KINEMATICS,
        (UNIFORM, ROTATION),
        "rotation: the disc turns, a contact point at radius r slides at sliding_speed r over the "
        "mean radius of the pads' faces",
    ),
    CONTACT_OPTION,
    FRICTION_OPTION,
)


def in_place(parameter: Parameter) -> bool:
    """Whether a parameter does not move nodes and contact points: all but lengths and angles."""
    return parameter.unit not in ("m", "deg")


def effective_radius(options: Mapping[str, str | int], values: Mapping[str, float]) -> float | None:
    """Radius [m] at which points slide at `sliding_speed`: the mean of the pads' faces.

    None where all points slide at this speed.
    """
    return None if options[KINEMATICS] == UNIFORM else mean_radius(values)


def mean_radius(values: Mapping[str, float]) -> float:
    """Mean radius [m] of the pads' faces, by area; the disc turns at `sliding_speed` over it."""
    inner, outer = values["pad.inner_radius"], values["pad.outer_radius"]
    return 2.0 / 3.0 * (outer**3 - inner**3) / (outer**2 - inner**2)


# least distance of breaks of a mesh, m or rad, between which there are cells
MIN_BREAK_DISTANCE_M_OR_RAD = 1e-6
# Each must be smaller than the next one, else a part of the brake vanishes.
ASCENDING = (
    ("disc.inner_radius", "hub.radius", "disc.bell_inner_radius", "disc.bell_outer_radius"),
    ("disc.bell_outer_radius", "disc.outer_radius"),
    ("pad.inner_radius", "pad.outer_radius"),
    ("piston.half_angle", "pad.half_angle"),
    ("caliper.inner_radius", "pad.outer_radius", "caliper.bridge_inner_radius"),
    ("caliper.bridge_inner_radius", "caliper.outer_radius"),
    ("caliper.finger_inner_angle", "caliper.finger_outer_angle"),
    ("caliper.finger_inner_angle", "caliper.body_half_angle"),
    ("caliper.finger_inner_angle", "caliper.bridge_half_angle"),
)
HALF_TURN = 180.0  # deg
LARGEST_STRAIN = 0.02  # elasticity is linear up to this strain


def vanishing(values: Mapping[str, float]) -> tuple[str, str] | None:
    """The first pair of ASCENDING whose distance is too small; None without one."""
    for names in ASCENDING:
        for pair in pairwise(names):
            gap = values[pair[1]] - values[pair[0]]
            if (
                np.deg2rad(gap) if pair[0].endswith("angle") else gap
            ) <= MIN_BREAK_DISTANCE_M_OR_RAD:
                return pair
    return None


def _bounded(parameter: Parameter) -> Parameter:
    """The parameter with the bounds of Poisson's ratios or angles."""
    if parameter.name == "pad.lining_poisson_ratio":  # the lining is isotropic in its plane only
        return replace(parameter, positive=False, above=-1.0, below=1.0)
    if parameter.name == "pad.lining_poisson_ratio_z":  # bounds depend on moduli, see fem.solid
        return replace(parameter, positive=False)
    if parameter.name.endswith("poisson_ratio"):
        return replace(parameter, positive=False, above=-1.0, below=0.5)
    return replace(parameter, below=HALF_TURN) if parameter.unit == "deg" else parameter


def _lining_strain(values: Mapping[str, Any]) -> Any:
    """Mean strain of the lining under the brake force."""
    inner, outer = values["pad.inner_radius"], values["pad.outer_radius"]
    area = np.deg2rad(values["pad.half_angle"]) * (outer**2 - inner**2)
    force = values["pressure"] * values["piston.area"]
    modulus = values["pad.lining_stiffness_scale"] * values["pad.lining_young_modulus_z"]
    return abs(force / (area * modulus))


def _largest_friction(values: Mapping[str, Any]) -> Any:
    """Static friction coefficient of the pad where it is larger."""
    pads = values["inner_pad.friction_factor"], values["outer_pad.friction_factor"]
    return FRICTION_RANGE.group(values) * np.maximum(*pads)


SMALL_STRAINS = Assumption(
    f"strains of the lining are small, at most {LARGEST_STRAIN:g}", _lining_strain, LARGEST_STRAIN
)
BRAKE_ASSUMPTIONS = (
    replace(FRICTION_RANGE, group=_largest_friction),
    LIGHTLY_DAMPED,
    SMALL_STRAINS,
)

STRUCTURE = structural(
    (
        ("disc.young_modulus", 120e9, "Pa", "disc"),
        ("disc.poisson_ratio", 0.26, "", "disc"),
        ("disc.density", 7200.0, "kg/m3", "disc"),
        ("disc.thickness", 0.012, "m", "friction band"),
        ("disc.outer_radius", 0.140, "m", "friction band"),
        ("disc.bell_outer_radius", 0.072, "m", "bell"),
        ("disc.bell_inner_radius", 0.066, "m", "bell and inner edge of the friction band"),
        ("disc.bell_height", 0.028, "m", "bell, between band and top"),
        ("disc.top_thickness", 0.006, "m", "top of the bell"),
        ("disc.inner_radius", 0.034, "m", "bore of the top"),
        ("hub.radius", 0.050, "m", "the top is held to the hub inside this radius"),
        ("hub.stiffness", 1e12, "N/m3", "disc to hub, normal, per area"),
        ("pad.inner_radius", 0.090, "m", "both pads"),
        ("pad.outer_radius", 0.140, "m", "both pads"),
        ("pad.half_angle", 30.0, "deg", "lining, each side of the middle"),
        ("pad.ear_angle", 5.0, "deg", "ear of the back plate beyond the lining, each side"),
        ("pad.lining_thickness", 0.010, "m", "both pads"),
        ("pad.plate_thickness", 0.005, "m", "both pads"),
        ("pad.lining_young_modulus", 6e9, "Pa", "lining, in its plane"),
        ("pad.lining_young_modulus_z", 2e9, "Pa", "lining, through its thickness"),
        ("pad.lining_shear_modulus_z", 1.5e9, "Pa", "lining, through its thickness"),
        ("pad.lining_stiffness_scale", 1.0, "", "factor on all three moduli of the lining"),
        ("pad.lining_poisson_ratio", 0.15, "", "lining, in its plane"),
        ("pad.lining_poisson_ratio_z", 0.2, "", "lining, through its thickness"),
        ("pad.lining_density", 2500.0, "kg/m3", "lining"),
        ("pad.plate_young_modulus", 210e9, "Pa", "back plate"),
        ("pad.plate_poisson_ratio", 0.3, "", "back plate"),
        ("pad.plate_density", 7800.0, "kg/m3", "back plate"),
        ("caliper.young_modulus", 170e9, "Pa", "caliper"),
        ("caliper.poisson_ratio", 0.28, "", "caliper"),
        ("caliper.density", 7100.0, "kg/m3", "caliper"),
        ("caliper.inner_radius", 0.090, "m", "body and fingers"),
        ("caliper.bridge_inner_radius", 0.146, "m", "bridge"),
        ("caliper.outer_radius", 0.164, "m", "bridge, body and fingers"),
        ("caliper.bridge_half_angle", 25.0, "deg", "bridge"),
        ("caliper.body_thickness", 0.040, "m", "body"),
        ("caliper.body_half_angle", 20.0, "deg", "body"),
        ("caliper.finger_thickness", 0.016, "m", "fingers"),
        ("caliper.finger_inner_angle", 5.0, "deg", "fingers, side next to the middle"),
        ("caliper.finger_outer_angle", 25.0, "deg", "fingers, outer side"),
        ("piston.area", 25e-4, "m2", "hydraulic area"),
        ("piston.half_angle", 10.0, "deg", "patch of the piston on the inner back plate"),
        ("piston.stiffness", 2e11, "N/m3", "piston, normal, per area; in vibration only"),
        ("fingers.stiffness", 5e11, "N/m3", "fingers to outer back plate, normal, per area"),
        ("layers.tangential_ratio", 0.3, "", "tangential over normal stiffness of the layers"),
        ("abutment.tangential_stiffness", 2e7, "N/m", "each pad ear to ground, around"),
        ("abutment.radial_stiffness", 2e7, "N/m", "each pad ear to ground, radial"),
        ("abutment.axial_stiffness", 1e5, "N/m", "each pad ear to ground, axial"),
        ("inner_pad.friction_factor", 1.0, "", "its friction coefficient over friction"),
        ("outer_pad.friction_factor", 1.0, "", "its friction coefficient over friction"),
        ("guides.stiffness", 1e7, "N/m", "caliper guides to ground, both together, in plane"),
        (
            "guides.axial_stiffness",
            1e5,
            "N/m",
            "caliper guides to ground, both together, axial",
        ),
    )
)

# temperatures, linear through the thickness, which change gaps; by default nothing is hot
HEAT = tuple(
    Parameter(f"{part}.temperature_{kind}", 0.0, "K", text, structural=True, difference=True)
    for part, kind, text in (
        ("disc", "rise", "all of the disc"),
        ("disc", "difference", "disc, outer face of the band above inner; bell as inner"),
        ("pad", "difference", "both pads, rubbing face above the plate's back"),
    )
)
EXPANSION = structural(
    (
        ("disc.thermal_expansion", 1.1e-5, "1/K", "disc"),
        ("pad.thermal_expansion", 1.2e-5, "1/K", "lining and back plate"),
    )
)


def is_hot(values: Mapping[str, float]) -> bool:
    """Whether any part has another temperature than that of its mesh."""
    return any(values[p.name] for p in HEAT)


# defaults of the first version; those of today give a damping ratio of 0.7 % at 4 kHz
UNDAMPED = {DAMPING.name: 0.0, STIFFNESS_DAMPING.name: 0.0}
PARAMETERS: Declared = (
    FRICTION,
    PRESSURE,
    SLIDING_SPEED,
    replace(DAMPING, default=0.005),
    replace(STIFFNESS_DAMPING, default=1.5e-7),  # s
    GYROSCOPIC,
    friction_parameters,
    contact_parameters,
    *(_bounded(p) for p in STRUCTURE),
    *HEAT,
    *EXPANSION,
)
