"""Two boxes on each other whose meshes do not match, and reference nodes, as keyword files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from component_meshes import STEEL, box
from own_blocks import faces_on

from squealstudy.models.components.mesh import ElementBlock, SolidMesh

LOW, HIGH = (3.0, 2.0, 2.5), (3.0, 2.0, 2.0)


def stacked(formulation, low=(3, 2, 2), high=(2, 3, 1), gap=0.0, more=()):
    """A box with the surface LOWER on top, another on it with UPPER at its bottom; TOP, BOTTOM.

    Behind them nodes of no element at the places `more`, sets REF1, REF2, ...
    """
    a = box(formulation, low, LOW)
    b = box(formulation, high, HIGH)
    shift = np.array([0, 0, LOW[2] + gap])
    nodes = np.vstack([a.nodes, b.nodes + shift, *[np.array(x)[None] for x in more]])
    block = ElementBlock(
        formulation,
        np.vstack([a.blocks[0].nodes, b.blocks[0].nodes + len(a.nodes)]),
        np.arange(a.n_elements + b.n_elements) + 1,
    )

    def on_upper(faces):
        return faces + np.array([a.n_elements, 0])

    n = len(a.nodes) + len(b.nodes)
    mesh = SolidMesh(
        origin=Path("stacked.inp"),
        nodes=nodes,
        numbers=np.arange(len(nodes)) + 1,
        blocks=(block,),
        materials={"S": STEEL},
        material=np.full(len(block.labels), "S", dtype=object),
        surfaces={
            "LOWER": faces_on(a, 2, LOW[2]),
            "UPPER": on_upper(faces_on(b, 2, 0.0)),
            "TOP": on_upper(faces_on(b, 2, HIGH[2])),
            "BOTTOM": faces_on(a, 2, 0.0),
        },
    )
    sets = {f"REF{i + 1}": np.array([n + i]) for i in range(len(more))}
    return replace(mesh, node_sets={**sets, "UPPERS": np.unique(mesh.node_set("UPPER"))})
