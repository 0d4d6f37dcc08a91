"""Hulten's model with two degrees of freedom: the smallest that flutters by mode coupling.

A mass rests on two bilateral contacts at right angles; each friction force acts along the other
contact's normal. With k_i = m w_i^2 the linearised stiffness is

    K = m [[w1^2, -mu w2^2], [mu w1^2, w2^2]],

which flutters for mu > ``|w1^2 - w2^2| / (2 w1 w2)``, with both frequencies merged at
w^2 = (w1^2 + w2^2) / 2.

Another contact law must be one for contact that stays closed. It acts over the areas that the two
contacts have with the default law, A_i = k_i / (5e11 Pa/m).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from squealstudy.laws.friction.exponential_fall import EXPONENTIAL_FALL
from squealstudy.laws.registry import at_points
from squealstudy.models.assembly import Assembly
from squealstudy.models.minimal_parts import bilateral_points, point_mass, stacked_mass
from squealstudy.models.operating import (
    ASSUMPTIONS,
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    friction_parameters,
    pulling_laws,
    pulling_parameters,
)
from squealstudy.models.parameter import (
    Assumption,
    Declared,
    ModelDefinition,
    ModelOption,
    structural,
)
from squealstudy.models.stacked_assembly import StackedAssembly

PARAMETERS: Declared = (
    FRICTION,
    SLIDING_SPEED,
    DAMPING,
    STIFFNESS_DAMPING,
    friction_parameters,
    pulling_parameters,
    *structural(
        (
            ("frequency_1", 100.0, "Hz", "of the mass on its first contact"),
            ("frequency_2", 75.0, "Hz", "of the mass on its second contact"),
            ("mass", 1.0, "kg", "the mass"),
            ("normal_force", 100.0, "N", "along both normals: presses both contacts for mu < 1"),
        )
    ),
)


def _friction(values: Mapping[str, Any]) -> Any:
    """Friction coefficient at the sliding speed, for the assumption that both contacts press."""
    speed, friction = np.abs(values["sliding_speed"]), values["friction"]
    curve, parameters = EXPONENTIAL_FALL, [values[p.name] for p in EXPONENTIAL_FALL.parameters]
    if curve.constant is not None and np.all(curve.constant(*parameters)):
        return friction
    return at_points(curve.mu, 3, speed, 0.0, friction, *parameters)[0]


BOTH_PRESS = Assumption(
    "both contacts press only for friction below 1", _friction, float(np.nextafter(1.0, 0.0))
)


N = np.eye(2)
T = np.array([[0.0, -1.0], [1.0, 0.0]])


def build(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, float],
) -> Assembly:
    """Assemble the mass and its two contacts. Returns an Assembly of 2 degrees of freedom.

    Both gaps open with the displacements q1 and q2. The first contact slides by -q2,
    the second by q1, as for a disc that turns through the corner between the two.
    """
    omega = 2 * np.pi * np.array([values["frequency_1"], values["frequency_2"]])
    return Assembly(
        (point_mass("mass", values["mass"]),),
        bilateral_points(N, T, values["mass"] * omega**2),
        (),
        np.zeros(2),
        np.full(2, -values["normal_force"]),
    )


def stack(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, Any],
) -> StackedAssembly:
    """`build` for values that are numbers or arrays (m,)."""
    mass, load = values["mass"], -values["normal_force"]
    omega = [2 * np.pi * values[f"frequency_{i}"] for i in (1, 2)]
    return stacked_mass(mass, N, T, [mass * w**2 for w in omega], [load, load])


HULTEN = ModelDefinition(
    name="hulten",
    description="mass on two bilateral contacts at right angles (Hulten): flutter in "
    "closed form; 2 DOF",
    options=(
        ModelOption(CONTACT_OPTION.name, pulling_laws, CONTACT_OPTION.description),
        FRICTION_OPTION,
    ),
    declared=PARAMETERS,
    components=("mass",),
    build=build,
    stack=stack,
    assumptions=(*ASSUMPTIONS, BOTH_PRESS),
    start={
        "sweep": {"parameter": "friction", "start": 0.1, "stop": 0.6, "num": 11},
        "modes": {"band": [10.0, 1000.0]},
        "transient": {"duration": 0.5, "step": 2e-5},
        "variable": [{"parameter": "damping_ratio", "bounds": [0.0, 0.4]}],
    },
)
