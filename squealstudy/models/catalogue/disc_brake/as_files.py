"""The generated brake as a model file: meshes of its solids with faces, and their interfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from squealstudy.models.catalogue.disc_brake.assemble import brake_faces
from squealstudy.models.catalogue.disc_brake.parameters import COMPONENTS, effective_radius
from squealstudy.models.catalogue.disc_brake.solid_meshes import mesh_of_grid
from squealstudy.models.catalogue.disc_brake.solids import DENSITIES, BrakeMesher
from squealstudy.models.components.faces import boundary
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.fem.sampling import FacetFilter

OPERATING = ("friction", "pressure", "sliding_speed", "damping_ratio", "stiffness_damping")
PADS = ("inner_pad", "outer_pad")


def brake_meshes(
    options: Mapping[str, str | int], values: Mapping[str, float]
) -> dict[str, SolidMesh]:
    """The four meshes of 20-node hexahedra in SI units, by component, with named surfaces."""
    mesher = BrakeMesher(values, DENSITIES[str(options["mesh"])])
    faces, meshes = brake_faces(mesher), {}
    for name in COMPONENTS:
        mesh = mesh_of_grid(name, mesher.component(name).grid, mesher.materials(name), "C3D20R")
        surfaces = {face: _faces_passing(mesh, keep) for face, keep in faces[name].items()}
        meshes[name] = replace(mesh, surfaces=surfaces)
    return meshes


def _faces_passing(mesh: SolidMesh, keep: FacetFilter) -> np.ndarray:
    """Faces (p, 2) of the boundary whose centre (mean of the corners) passes a filter."""
    faces = boundary(mesh)
    (block,) = mesh.blocks
    corners = [[i for i in f if block.kind.shape.is_corner(i)] for f in block.kind.shape.faces]
    nodes = block.nodes[faces[:, :1], np.array(corners)[faces[:, 1] - 1]]
    x, y, z = mesh.nodes[nodes].mean(axis=1).T
    passing: np.ndarray = faces[keep(np.hypot(x, y), np.arctan2(y, x), z)]
    return passing


def brake_tables(
    options: Mapping[str, str | int], values: Mapping[str, float], files: Mapping[str, str]
) -> dict[str, Any]:
    """Tables of the model file, in SI units; `files` are the files of the meshes, by component.

    Contact points are Gauss points, as in the generated brake, so that both brakes are the same.
    """
    v = values
    radius = effective_radius(options, values)
    turning = {"uniform": True} if radius is None else {"effective_radius": radius}
    ratio = v["layers.tangential_ratio"]

    def layer(name: str, surface: str, other_surface: str, **more: Any) -> dict[str, Any]:
        normal = v[f"{name}.stiffness"]
        contact_table = {"name": name, "between": [surface, other_surface], "quadrature": "gauss"}
        return contact_table | {"normal": normal, "tangential": ratio * normal} | more

    ears = [2 * v[f"abutment.{d}_stiffness"] for d in ("radial", "tangential", "axial")]
    guides = [v["guides.stiffness"]] * 2 + [v["guides.axial_stiffness"]]
    springs = [(f"{pad}_abutment", f"{pad}.EARS", ears) for pad in PADS]
    springs.append(("guides", "caliper.GUIDES", guides))
    return {
        "description": "the generated disc brake, as files",
        "units": "SI",
        "rotation": {"axis": [0.0, 0.0, 1.0], "rotor": "disc"} | turning,
        "components": {name: {"mesh": files[name]} for name in COMPONENTS},
        "contact": [
            {
                "name": f"{side}_contact",
                "kind": "sliding",
                "slave": f"{side}_pad.LINING",
                "master": f"disc.{side.upper()}",
                "quadrature": "gauss",
                "points": int(options["contact_points"]),
                "search": 1e-4,
                "friction_factor": v[f"{side}_pad.friction_factor"],
            }
            for side in ("inner", "outer")
        ],
        "layer": [
            layer("hub", "disc.HUB", "ground"),
            layer("fingers", "caliper.FINGERS", "outer_pad.BACK"),
            layer("piston", "inner_pad.PISTON", "caliper.BODY", in_static=False),
        ],
        "spring": [
            {"name": name, "between": [face, "ground"], "axes": "cylindrical", "stiffness": k}
            for name, face, k in springs
        ],
        "load": [
            {
                "pressure_on": "inner_pad.PISTON",
                "reaction_on": "caliper.BODY",
                "reaction": "opposite",
                "area": v["piston.area"],
            }
        ],
        "parameters": {
            **{
                f"{name}.young_modulus": {
                    "path": f"{name}.materials.iron.E",
                    "default": v[f"{name}.young_modulus"],
                }
                for name in ("disc", "caliper")
            },
            "pad.lining_young_modulus_z": {
                "path": [f"{pad}.materials.lining.E[3]" for pad in PADS],
                "default": v["pad.lining_stiffness_scale"] * v["pad.lining_young_modulus_z"],
            },
            **{
                f"{name}.stiffness": {"path": f"layer.{name}.normal"}
                for name in ("hub", "fingers", "piston")
            },
            **{name: {"default": v[name]} for name in OPERATING},
        },
    }
