"""A model file of a ring that turns under one pad: of equal sectors, or with holes in some."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from component_meshes import LINING, STEEL, box
from own_blocks import faces_on

from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh import ElementBlock

SECTORS = 16
INNER, OUTER, THICK = 60.0, 100.0, 10.0  # mm

MODEL = """\
description = "a ring under a pad"
units = "t-mm-s"

[rotation]
axis = [0, 0, 1]

[components.disc]
mesh = "disc.inp"

[components.pad]
mesh = "pad.inp"

[[contact]]
kind = "sliding"
slave = "pad.BOTTOM"
master = "disc.TOP"
search = 0.5

[[layer]]
name = "hub"
between = ["disc.HUB", "ground"]
normal = 20.0
tangential = 8.0

[[spring]]
name = "guides"
between = ["pad.TOP", "ground"]
axes = "cylindrical"
stiffness = [2e4, 2e4, 1e2]

[[load]]
pressure_on = "pad.TOP"

[parameters]
rotor_angle = {path = "rotation.angle"}
pressure = {default = 1e6}
"""

STUDY = """\
[study]
name = "ring"
kind = "complex_modes"

[model]
file = "ring.toml"

[parameters]
friction = 0.5

[[sweep]]
parameter = "rotor_angle"
values = [0.0, 5.0, 10.0]

[modes]
band = [200.0, 5000.0]
reference_points = 0
"""


def ring(name, cells, radii, angles, heights, material, drop=()):
    """Bricks of a sector from angle to angle [deg], closed where that is a whole turn.

    Without the elements `drop`, (around, layer) each, of all radii but the innermost.
    """
    flat = box("C3D8I", cells, (1.0, 1.0, 1.0), origin=Path(name), materials={"M": material})
    share = flat.nodes
    r = radii[0] + share[:, 0] * (radii[1] - radii[0])
    phi = np.deg2rad(angles[0] + share[:, 1] * (angles[1] - angles[0]))
    z = heights[0] + share[:, 2] * (heights[1] - heights[0])
    nodes = np.column_stack([r * np.cos(phi), r * np.sin(phi), z])
    block, node = flat.blocks[0], np.arange(len(nodes))
    if angles[1] - angles[0] == 360.0:
        seam = np.flatnonzero(share[:, 1] == 1.0)
        first = {tuple(s): i for i, s in enumerate(np.round(share, 9))}
        node[seam] = [first[(s[0], 0.0, s[2])] for s in np.round(share[seam], 9)]
    middle = share[block.nodes].mean(axis=1) * cells
    gone = np.zeros(len(middle), dtype=bool)
    for around, layer in drop:
        gone |= (
            (np.floor(middle[:, 1]) == around)
            & (np.floor(middle[:, 2]) == layer)
            & (middle[:, 0] > 1.0)
        )
    elements = node[block.nodes[~gone]]
    used, numbered = np.unique(elements, return_inverse=True)
    mesh = replace(
        flat,
        nodes=nodes[used],
        numbers=np.arange(len(used)) + 1,
        blocks=(
            ElementBlock("C3D8I", numbered.reshape(elements.shape), np.arange(len(elements)) + 1),
        ),
        material=np.full(len(elements), "M", dtype=object),
        orientation=flat.orientation[~gone],
    )
    top, bottom = (faces_on(mesh, 2, h) for h in heights[::-1])
    return replace(mesh, surfaces={"TOP": top, "BOTTOM": bottom})


def write_ring(folder: Path, drop=(), *changes: tuple[str, str]) -> Path:
    """The files of the model; its path. The study is beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    disc = ring("disc", (2, SECTORS, 2), (INNER, OUTER), (0.0, 360.0), (0.0, THICK), STEEL, drop)
    inside = faces_within(disc, INNER)
    disc = replace(disc, surfaces={**disc.surfaces, "HUB": inside})
    pad = ring("pad", (2, 4, 1), (65.0, 95.0), (40.0, 95.0), (THICK, 18.0), LINING)
    write_inp(disc, folder / "disc.inp")
    write_inp(pad, folder / "pad.inp")
    text = MODEL
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "ring.toml").write_text(text, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder / "ring.toml"


def faces_within(mesh, radius):
    """Outer faces of a mesh at a radius."""
    at = replace(
        mesh,
        nodes=np.column_stack(
            [np.hypot(*mesh.nodes[:, :2].T), mesh.nodes[:, 2:], mesh.nodes[:, 2:]]
        ),
    )
    return faces_on(at, 0, radius)
