"""A block dragged by a plate against a bracket: a contact off the rotor, stuck or sliding."""

from __future__ import annotations

from pathlib import Path

from own_blocks import block, faces_on

from squealstudy.models.components.inp_writer import write_inp

MODEL = """\
description = "a block dragged against a bracket"
units = "t-mm-s"

[rotation]
point = [4.0, -100.0, 0.0]
axis = [0, 0, 1]
rotor = "plate"

[components.plate]
mesh = "plate.inp"

[components.slider]
mesh = "slider.inp"
translate = [1.5, 0.5, 2.0]

[components.bracket]
mesh = "bracket.inp"
translate = [0.0, 0.5, 2.0]

[[contact]]
name = "lining"
kind = "sliding"
slave = "slider.BOTTOM"
master = "plate.TOP"
search = 0.1

[[contact]]
name = "abutment"
slave = "slider.LEFT"
master = "bracket.RIGHT"
search = 0.1
friction = 0.3
state = "stuck"
sliding = [0, 0, 1]
tangential = 500.0

[[layer]]
name = "bed"
between = ["plate.BOTTOM", "ground"]
normal = 2000.0
tangential = 1000.0

[[layer]]
name = "bolts"
between = ["bracket.BOTTOM", "ground"]
normal = 3000.0
tangential = 2500.0

[[spring]]
name = "guides"
between = ["slider.ENDS", "ground"]
stiffness = [1e3, 1.5e4, 1e3]

[[load]]
pressure_on = "slider.TOP"
area = 10.0

[parameters]
mu_abutment = {path = "contact.abutment.friction"}
abutment_state = {path = "contact.abutment.state"}
shear = {path = "contact.abutment.tangential"}
"guides.x" = {path = "spring.guides.stiffness[1]"}
friction = {default = 0.4}
"""

OF_ABUTMENT = """friction = 0.3
state = "stuck"
sliding = [0, 0, 1]
tangential = 500.0
"""
OF_PARAMETERS = """mu_abutment = {path = "contact.abutment.friction"}
abutment_state = {path = "contact.abutment.state"}
shear = {path = "contact.abutment.tangential"}
"""


def write_pinned(folder: Path, *changes: tuple[str, str]) -> Path:
    """The files of the model in a folder; the model file's path."""
    folder.mkdir(parents=True, exist_ok=True)
    boxes = {
        "plate": ((2, 1, 1), (8.0, 3.0, 2.0), "STEEL"),
        "slider": ((2, 1, 1), (5.0, 2.0, 2.0), "LINING"),
        "bracket": ((1, 1, 1), (1.5, 2.0, 2.0), "STEEL"),
    }
    for name, (cells, lengths, material) in boxes.items():
        mesh = block(name, cells, lengths, material, "C3D8")
        mesh.surfaces["LEFT"] = faces_on(mesh, 0, 0.0)
        mesh.surfaces["RIGHT"] = faces_on(mesh, 0, lengths[0])
        write_inp(mesh, folder / f"{name}.inp")
    text = MODEL
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "pinned.toml"
    path.write_text(text, encoding="utf-8")
    return path
