"""Mass on a belt, held by a spring: stick-slip from friction that falls with sliding speed.

    m x'' + 2 xi w m x' + w^2 m x = -F mu(v + x'),      w^2 = k/m,
    mu(s) = mu_d + (mu_s - mu_d) exp(-s / v_mu),

x is against the motion of the belt, v the belt's speed. In tau = w t and y = x k/F (speeds in units
of F / sqrt(k m)) this is y'' + 2 xi y' + y = -mu. Linearised at steady sliding the damping is
2 xi w m + F mu'(v): steady sliding is stable where

    v > v_mu ln(mu_d (mu_s/mu_d - 1) F / (2 xi sqrt(k m) v_mu)).

The defaults put the mode at 100 Hz with F = sqrt(k m) x 1 m/s: speeds in m/s are the
dimensionless ones, and the boundary is v = ln(10)/2 = 1.151293 m/s.

The slope of the friction force at zero sliding is contact.kt x contact_stiffness / 5e11 [N s/m].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.laws.friction.exponential_fall import DECAY_SPEED, STATIC_RATIO
from squealstudy.models.assembly import Assembly
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.minimal_parts import ON_BELT, mass_on_belt, stacked_mass
from squealstudy.models.operating import (
    ASSUMPTIONS,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    friction_parameters,
)
from squealstudy.models.parameter import Declared, ModelDefinition, structural
from squealstudy.models.stacked_assembly import StackedAssembly

PARAMETERS: Declared = (
    replace(FRICTION, default=0.5),
    replace(SLIDING_SPEED, default=1.0, description="speed of the belt"),
    replace(DAMPING, default=0.05),
    STIFFNESS_DAMPING,
    replace(STATIC_RATIO, default=2.0),
    replace(DECAY_SPEED, default=0.5),
    friction_parameters,
    *structural(
        (
            ("mass", 1.0, "kg", "the mass"),
            ("stiffness", float((200 * np.pi) ** 2), "N/m", "spring along the belt"),
            ("normal_force", float(200 * np.pi), "N", "presses the mass on the belt"),
            ("contact_stiffness", 1e8, "N/m", "normal to the belt; no motion along it sees it"),
        )
    ),
)


def build(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, float],
) -> Assembly:
    """Assemble mass, spring and contact. Returns an Assembly of 2 degrees of freedom.

    q1 is along the belt, against its motion; q2 is away from it.
    """
    along = sp.csr_matrix(np.array([[1.0, 0.0]]))
    return mass_on_belt(values, SpringInterface("spring", along, np.array([values["stiffness"]])))


def stack(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, Any],
) -> StackedAssembly:
    """`build` for values that are numbers or arrays (m,)."""
    return stacked_mass(
        values["mass"],
        *ON_BELT,
        [values["contact_stiffness"]],
        [0.0, -values["normal_force"]],
        [[values["stiffness"], 0.0], [0.0, 0.0]],
    )


BELT = ModelDefinition(
    name="belt",
    description="mass on a belt with falling friction: stick-slip, stable above 1.151 m/s; 2 DOF",
    options=(FRICTION_OPTION,),
    declared=PARAMETERS,
    components=("mass",),
    build=build,
    stack=stack,
    assumptions=ASSUMPTIONS,
    start={
        "sweep": {"parameter": "sliding_speed", "start": 0.8, "stop": 1.4, "num": 7},
        "modes": {"band": [10.0, 1000.0]},
        "transient": {"duration": 2.0, "step": 2e-5},
        "variable": [{"parameter": "damping_ratio", "bounds": [0.0, 0.2]}],
    },
)
