"""A model file of two small blocks whose meshes do not match: a slider pressed on a plate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from component_meshes import LINING, STEEL, box

from squealstudy.models.components.faces import boundary
from squealstudy.models.components.inp_writer import write_inp

MODEL = """\
description = "two blocks"
units = "t-mm-s"

[rotation]
point = [4.0, -100.0, 0.0]
axis = [0, 0, 1]

[components.plate]
mesh = "plate.inp"

[components.slider]
mesh = "slider.inp"
translate = [1.5, 0.5, 2.0]

[[contact]]
kind = "sliding"
slave = "slider.BOTTOM"
master = "plate.TOP"
search = 0.1

[[layer]]
name = "bed"
between = ["plate.BOTTOM", "ground"]
normal = 2000.0
tangential = 1000.0

[[spring]]
name = "guides"
between = ["slider.ENDS", "ground"]
stiffness = [2e4, 1.5e4, 1e3]

[[load]]
pressure_on = "slider.TOP"
area = 10.0

[parameters]
"lining.E3" = {path = "slider.materials.LINING.E[3]", default = 2e3, unit = "MPa"}
"bed.normal" = {path = "layer.bed.normal"}
"guides.x" = {path = "spring.guides.stiffness[1]"}
friction = {default = 0.4}
"""

STUDY = """\
[study]
name = "blocks"
kind = "complex_modes"

[model]
file = "blocks.toml"

[[sweep]]
parameter = "friction"
values = [0.3, 0.6]

[modes]
band = [500.0, 60000.0]
reference_points = 1
"""


def faces_on(mesh, axis, place):
    """Faces of the boundary whose nodes lie on a plane."""
    found = []
    for element, face in boundary(mesh):
        b = np.searchsorted(mesh.starts, element, side="right") - 1
        block = mesh.blocks[b]
        nodes = block.nodes[element - mesh.starts[b]][list(block.kind.shape.faces[face - 1])]
        if np.abs(mesh.nodes[nodes, axis] - place).max() < 1e-9:
            found.append((element, face))
    return np.array(found)


def block(name, cells, lengths, material, formulation="C3D20"):
    """A box with the surfaces TOP, BOTTOM and ENDS, and the node set CORNER."""
    kind = {"LINING": LINING, "STEEL": STEEL}[material]
    mesh = box(formulation, cells, lengths, origin=Path(name), materials={material: kind})
    mesh = replace(mesh, material=np.full(mesh.n_elements, material, dtype=object))
    surfaces = {
        "TOP": faces_on(mesh, 2, lengths[2]),
        "BOTTOM": faces_on(mesh, 2, 0.0),
        "ENDS": np.vstack([faces_on(mesh, 0, 0.0), faces_on(mesh, 0, lengths[0])]),
    }
    corner = np.flatnonzero((np.abs(mesh.nodes) < 1e-9).all(axis=1))
    return replace(mesh, surfaces=surfaces, node_sets={"CORNER": corner})


def write_blocks(folder: Path, *changes: tuple[str, str], study: str = STUDY) -> Path:
    """The files of the model and of a study in a folder; the study's path."""
    folder.mkdir(parents=True, exist_ok=True)
    write_inp(block("plate", (4, 2, 1), (8.0, 3.0, 2.0), "STEEL"), folder / "plate.inp")
    write_inp(block("slider", (3, 1, 2), (5.0, 2.0, 2.0), "LINING"), folder / "slider.inp")
    text = MODEL
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "blocks.toml").write_text(text, encoding="utf-8")
    (folder / "study.toml").write_text(study, encoding="utf-8")
    return folder / "study.toml"
