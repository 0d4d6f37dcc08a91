"""A minimal model from outside the package: a mass on a spring, rubbed by a belt.

q1 lies along the belt, q2 away from it. Without damping the mode along the belt is at
sqrt(stiffness / (mass + added_mass)) rad/s, whatever presses the mass on the belt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue import register_model
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.minimal_parts import bilateral_points, point_mass
from squealstudy.models.operating import (
    ASSUMPTIONS,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    SLIDING_SPEED,
    friction_parameters,
)
from squealstudy.models.parameter import ModelDefinition, structural


def build(options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
    """Mass, spring and one contact point: 2 degrees of freedom."""
    along, away = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    spring = SpringInterface("spring", sp.csr_matrix(along), np.array([values["stiffness"]]))
    contact = bilateral_points(away, along, np.array([values["contact_stiffness"]]))
    return Assembly(
        components=(point_mass("mass", values["mass"] + values["added_mass"]),),
        contact=contact,
        springs=(spring,),
        load=np.zeros(2),
        constant_load=np.array([0.0, -values["normal_force"]]),
    )


register_model(
    ModelDefinition(
        name="rubbed_mass",
        description="a mass on a spring, rubbed by a belt; 2 DOF",
        options=(FRICTION_OPTION,),
        declared=(
            replace(FRICTION, default=0.3),
            replace(SLIDING_SPEED, default=1.0),
            DAMPING,
            friction_parameters,
            *structural(
                (
                    ("mass", 2.0, "kg", "the mass"),
                    ("added_mass", 1.0, "kg", "what is glued to it"),
                    ("stiffness", 1e6, "N/m", "spring along the belt"),
                    ("normal_force", 100.0, "N", "presses the mass on the belt"),
                    ("contact_stiffness", 1e8, "N/m", "normal to the belt"),
                )
            ),
        ),
        components=("mass",),
        build=build,
        assumptions=ASSUMPTIONS,
    )
)
