"""Hoffmann's mass on a belt (Hoffmann, Fischer, Allgaier, Gaul 2002): mode coupling by springs.

The mass hangs on two inclined springs and rests on the belt through a contact spring k3:

    K = [[k11, k12 - mu k3], [k12, k22]],
    k11 = sum k_i cos^2 a_i, k12 = sum k_i sin a_i cos a_i, k22 = sum k_i sin^2 a_i + k3,

which flutters where (k11 - k22)^2 + 4 k12 (k12 - mu k3) < 0: above mu = 0.75 with the defaults.

Another contact law acts over the area A = k3 / 5e11 m2 per Pa/m: k3 is then A times its tangent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.minimal_parts import ON_BELT, mass_on_belt, stacked_mass
from squealstudy.models.operating import (
    ASSUMPTIONS,
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    contact_laws,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.parameter import Declared, ModelDefinition, ModelOption, structural
from squealstudy.models.stacked_assembly import StackedAssembly
from squealstudy.parameter import Parameter

STIFFNESS = structural(
    (
        ("k1", 2 / 3 * (2 - np.sqrt(3.0)) * 1e6, "N/m", "first inclined spring"),
        ("k2", 2 / 3 * (2 + np.sqrt(3.0)) * 1e6, "N/m", "second inclined spring"),
        ("contact_stiffness", 4 / 3 * 1e6, "N/m", "contact spring k3 between mass and belt"),
        ("mass", 1.0, "kg", "the mass"),
        ("normal_force", 100.0, "N", "presses the mass on the belt"),
    )
)
ANGLES = (
    Parameter("alpha1", 150.0, "deg", "inclination of the first spring to the belt"),
    Parameter("alpha2", 30.0, "deg", "inclination of the second spring to the belt"),
)
PARAMETERS: Declared = (
    FRICTION,
    SLIDING_SPEED,
    DAMPING,
    STIFFNESS_DAMPING,
    friction_parameters,
    contact_parameters,
    *STIFFNESS,
    *(replace(a, minimum=-360.0, maximum=360.0, structural=True) for a in ANGLES),
)


def bilateral_first() -> tuple[str, ...]:
    """Names of all contact laws; the first is that of the model's closed form."""
    return "bilateral", *(name for name in contact_laws() if name != "bilateral")


def build(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, float],
) -> Assembly:
    """Assemble mass, springs and contact. Returns an Assembly of 2 degrees of freedom.

    q1 is along the belt, against its motion; q2 is away from it.
    """
    angles = np.deg2rad([values["alpha1"], values["alpha2"]])
    springs = SpringInterface(
        "springs",
        sp.csr_matrix(np.column_stack([np.cos(angles), np.sin(angles)])),
        np.array([values["k1"], values["k2"]]),
    )
    return mass_on_belt(values, springs)


def stack(
    options: Mapping[str, str | int],  # noqa: ARG001 - the signature of every model
    values: Mapping[str, Any],
) -> StackedAssembly:
    """`build` for values that are numbers or arrays (m,)."""
    k = [values["k1"], values["k2"]]
    angles = [np.deg2rad(values["alpha1"]), np.deg2rad(values["alpha2"])]
    along, away = [np.cos(a) for a in angles], [np.sin(a) for a in angles]
    across = sum(k[i] * along[i] * away[i] for i in (0, 1))
    springs = [
        [sum(k[i] * along[i] ** 2 for i in (0, 1)), across],
        [across, sum(k[i] * away[i] ** 2 for i in (0, 1))],
    ]
    load = [0.0, -values["normal_force"]]
    return stacked_mass(values["mass"], *ON_BELT, [values["contact_stiffness"]], load, springs)


HOFFMANN = ModelDefinition(
    name="hoffmann",
    description="mass on two inclined springs and a belt (Hoffmann et al. 2002): "
    "flutter above mu 0.75; 2 DOF",
    options=(
        ModelOption(CONTACT_OPTION.name, bilateral_first, CONTACT_OPTION.description),
        FRICTION_OPTION,
    ),
    declared=PARAMETERS,
    components=("mass",),
    build=build,
    stack=stack,
    assumptions=ASSUMPTIONS,
    start={
        "sweep": {"parameter": "friction", "start": 0.5, "stop": 0.9, "num": 9},
        "modes": {"band": [10.0, 1000.0]},
        "transient": {"duration": 1.0, "step": 2e-5},
        "variable": [{"parameter": "damping_ratio", "bounds": [0.0, 0.2]}],
    },
)
