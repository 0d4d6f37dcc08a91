"""A lumped model to start from: its file, and the first values in new studies of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from squealstudy.models.lumped.definition import LumpedDefinition
from squealstudy.study.lumped import lumped_of
from squealstudy.study.source import SourceText

SUFFIX = "_model"  # the model file has the name of its study with this suffix
# values with which new studies of this model begin
START = {
    "sweep": {"parameter": "sliding_speed", "start": 0.2, "stop": 0.5, "num": 7},
    "modes": {"band": [10.0, 5000.0]},
    "transient": {"duration": 0.3, "step": 5e-6, "perturbation": 0.01},
    "variable": [{"parameter": "damping_ratio", "bounds": [0.0, 0.1]}],
}
TEXT = """\
# A lumped model: masses, springs, dampers, contact points and loads over the directions x, y and z
# and the turns rx, ry and rz. Numbers are in SI units, or expressions of [parameters].
description = "a pad on a caliper, pressed on a disc"

[[mass]]
name = "pad"
mass = "pad_mass"                # kg; a turn needs inertia, kg m2
directions = ["x", "y"]          # its coordinates

[[mass]]
name = "caliper"
mass = "caliper_mass"
directions = ["x"]

[[spring]]
name = "backing"
between = ["pad", "caliper"]     # two masses, or a mass and "ground"
direction = "x"                  # or components: [1, 0.5]
stiffness = "pad_stiffness"      # N/m

[[spring]]
name = "mount"
between = ["caliper", "ground"]
direction = "x"
stiffness = "caliper_stiffness"

[[damper]]
name = "bush"
between = ["caliper", "ground"]
direction = "x"
damping = "bush_damping"         # N s/m

[[contact]]
name = "lining"
between = ["pad", "disc"]        # "disc" or "belt" slides at sliding_speed; or a second mass
normal = "y"                     # in which the pad leaves the disc
sliding = "-x"                   # in which the disc slides past the pad, and pulls it
stiffness = 1e8                  # N/m

[[load]]
name = "piston"
on = "pad"
direction = "-y"
force = "normal_force"           # N; or area, m2, on which the parameter pressure acts

[parameters]
# of the operating point: other defaults
friction = 0.4
sliding_speed = 0.2
damping_ratio = 0.01
"friction_law.static_ratio" = 1.5
"friction_law.decay_speed" = 0.1
# of this model
pad_mass = { default = 1.0, unit = "kg", description = "the pad" }
caliper_mass = { default = 6.0, unit = "kg", description = "the caliper" }
pad_stiffness = { default = "7 kN/mm", unit = "N/m", description = "pad against the caliper" }
caliper_stiffness = { default = "1.5 kN/mm", unit = "N/m", description = "caliper on its mount" }
bush_damping = { default = 20.0, unit = "N s/m", description = "caliper on its mount" }
normal_force = { default = 1500.0, unit = "N", description = "presses the pad on the disc" }
"""


def file_beside(study: Path) -> Path:
    """Path of the model file of a new study."""
    return study.with_name(f"{study.stem}{SUFFIX}.toml")


def lumped_start(study: Path) -> LumpedDefinition:
    """The model of `file_beside`, which need not exist yet."""
    definition = lumped_of(SourceText(file_beside(study), TEXT))
    return replace(definition, start=START)
