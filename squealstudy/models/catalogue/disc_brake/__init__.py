"""The generated disc brake: disc with bell, two pads and a floating caliper."""

from __future__ import annotations

from collections.abc import Mapping

from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue.disc_brake.parameters import (
    BRAKE_ASSUMPTIONS,
    COMPONENTS,
    OPTIONS,
    PARAMETERS,
    SETS,
    UNDAMPED,
    effective_radius,
    in_place,
    vanishing,
)
from squealstudy.models.parameter import ModelChange, ModelDefinition


def build(options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
    """Assemble the brake from a value of every option and parameter. Returns an Assembly."""
    from squealstudy.models.catalogue.disc_brake.assemble import (
        assemble,  # the mesher is slow to import
    )

    return assemble(options, values)


SYMMETRIC = (
    "its disc is symmetric about its axis, so that no angle changes anything; discs with holes, "
    'vanes or masses have one in a model file, path = "rotation.angle"'
)
DISC_BRAKE = ModelDefinition(
    name="disc_brake",
    description="finite-element disc brake: disc with bell, two pads, floating "
    "caliper; about 29,000 DOF",
    options=OPTIONS,
    declared=PARAMETERS,
    components=COMPONENTS,
    build=build,
    assumptions=BRAKE_ASSUMPTIONS,
    vanishing=vanishing,
    torque_unit="N m",
    effective_radius=effective_radius,
    in_place=in_place,
    sets=tuple(f"{name}.{face}" for name, faces in SETS.items() for face in faces),
    changes=(
        ModelChange(
            "0.2.0",
            "the mesh is finer at corners, and damping_ratio is 0.005 and stiffness_damping "
            "1.5e-7 s where a study does not set them (before: 0)",
            UNDAMPED,
        ),
    ),
    absent={"rotor_angle": SYMMETRIC, "rotation.angle": SYMMETRIC},
    start={  # settings with which a study takes minutes
        "model": {"mesh": "coarse", "contact_points": 2},
        "sweep": {"parameter": "friction", "start": 0.1, "stop": 0.7, "num": 7},
        "limit_cycles": {"families": "screened"},
        "goal": {"starts": 4, "in_time": 0, "full_order": 1},
    },
)
