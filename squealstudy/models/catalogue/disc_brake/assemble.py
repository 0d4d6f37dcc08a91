"""The generated disc brake from its parameters: meshes, interfaces, load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from squealstudy.laws import law_from_values
from squealstudy.models.assembly import Assembly
from squealstudy.models.catalogue.disc_brake.density import DENSITIES
from squealstudy.models.catalogue.disc_brake.faces import brake_faces
from squealstudy.models.catalogue.disc_brake.interfaces import BrakeInterfaces
from squealstudy.models.catalogue.disc_brake.parameters import COMPONENTS
from squealstudy.models.catalogue.disc_brake.solids import BrakeMesher
from squealstudy.models.component import Component
from squealstudy.models.fem.correspondence import corresponding_rows
from squealstudy.models.fem.sampling import surface_nodes


def assemble(options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
    """Assemble the brake from a value of every option and parameter. Returns an Assembly."""
    mesher = BrakeMesher(values, DENSITIES[str(options["mesh"])])
    solids = {name: mesher.component(name) for name in COMPONENTS}
    faces = brake_faces(mesher)
    components = tuple(
        Component(
            name,
            solids[name].M,
            solids[name].K,
            solids[name].coordinates,
            {face: surface_nodes(solids[name], keep) for face, keep in faces[name].items()},
            corresponding_rows(solids[name]),
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
