"""The generated disc brake: disc with bell, two pads and a floating caliper."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from squealstudy.models.assembly import Assembly
from squealstudy.models.component import Component
from squealstudy.models.disc_brake.faces import brake_faces
from squealstudy.models.disc_brake.interfaces import BrakeInterfaces
from squealstudy.models.disc_brake.parameters import OPTIONS, PARAMETERS
from squealstudy.models.disc_brake.solids import COMPONENTS, MEDIUM_SIZES, MESH_FACTOR, BrakeMesher
from squealstudy.models.fem.sampling import surface_nodes
from squealstudy.models.operating import law_from_values
from squealstudy.models.parameter import ModelDefinition


def build(options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
    """Assemble the brake from a value of every option and parameter. Returns an Assembly."""
    mesher = BrakeMesher(values, MEDIUM_SIZES * MESH_FACTOR[str(options["mesh"])])
    solids = {
        "disc": mesher.disc(),
        "inner_pad": mesher.pad(-1),
        "outer_pad": mesher.pad(+1),
        "caliper": mesher.caliper(),
    }
    faces = brake_faces(mesher)
    components = tuple(
        Component(
            name,
            solids[name].M,
            solids[name].K,
            solids[name].coordinates,
            {face: surface_nodes(solids[name], keep) for face, keep in faces[name].items()},
        )
        for name in COMPONENTS
    )
    interfaces = BrakeInterfaces(mesher, solids, components)
    law = law_from_values(str(options["contact_law"]), values)
    load = interfaces.brake_load()
    return Assembly(
        components,
        interfaces.contact(law, int(options["contact_points"])),
        interfaces.springs(),
        load,
        np.zeros_like(load),
    )


DISC_BRAKE = ModelDefinition(
    "disc_brake",
    "finite-element disc brake: disc with bell, two pads, floating caliper; about 25,000 DOF",
    OPTIONS,
    PARAMETERS,
    COMPONENTS,
    build,
    torque_unit="N m",
)
