"""What `squealstudy inspect` prints of a model file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from squealstudy.faults import named
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.components.facets import boundary, facet_groups, facets
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.inspection import Inspection
from squealstudy.screen import Rows
from squealstudy.shapes.assembled import Body, draw_assembly, eight


def shown(model: FileDefinition, found: Inspection) -> tuple[Rows, Rows]:
    """Facts, and the parameters that the file declares."""
    rows = [
        (p.name, f"{p.default:g} {p.unit}".rstrip() + f"  {p.description}")
        for p in model.parameters
        if p.structural
    ]
    return [("model", model.description), *found.facts], rows


def draw(geometry: Geometry, path: Path) -> None:
    """Draw the assembly, contact faces coloured."""
    faces: dict[str, list[str]] = {}
    for contact in geometry.file.contact:
        for reference in (contact.slave, contact.master):
            name, _, label = reference.partition(".")
            faces.setdefault(name, []).append(label)
    bodies = {}
    for name, body in geometry.bodies.items():
        groups = facet_groups(body.mesh, boundary(body.mesh))
        bodies[name] = Body(
            nodes=body.nodes,
            facets=np.vstack([eight(g.nodes) for g in groups]),
            faces={
                f"{name}.{label}": [g.nodes for g in facets(body.mesh, label)]
                for label in dict.fromkeys(faces.get(name, ()))
            },
        )
    axis = np.array([0.0, 0.0, 1.0])
    if geometry.rotation is not None:
        axis = geometry.rotation.direction
    with named(path):
        draw_assembly(bodies, axis).savefig(path, dpi=120)
