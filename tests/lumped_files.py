"""Files of lumped models that tests share: the minimal models of the catalogue, written so."""

from __future__ import annotations

from pathlib import Path

HULTEN = """\
[[mass]]
name = "mass"
mass = "m"
directions = ["x", "y"]

[[contact]]
between = ["mass", "disc"]
normal = "x"
sliding = "y"
stiffness = "m * (2*pi*frequency_1)**2"

[[contact]]
between = ["mass", "disc"]
normal = "y"
sliding = "-x"
stiffness = "m * (2*pi*frequency_2)**2"

[[load]]
on = "mass"
direction = "-x"
force = "normal_force"

[[load]]
on = "mass"
direction = "-y"
force = "normal_force"

[parameters]
m = { default = 1.0, unit = "kg" }
frequency_1 = { default = 100.0, unit = "Hz" }
frequency_2 = { default = 75.0, unit = "Hz" }
normal_force = { default = 100.0, unit = "N" }
"""

HOFFMANN = """\
[[mass]]
name = "mass"
mass = "m"
directions = ["x", "y"]

[[spring]]
between = ["mass", "ground"]
direction = ["cos(alpha1*pi/180)", "sin(alpha1*pi/180)"]
stiffness = "k1"

[[spring]]
between = ["mass", "ground"]
direction = ["cos(alpha2*pi/180)", "sin(alpha2*pi/180)"]
stiffness = "k2"

[[contact]]
between = ["mass", "belt"]
normal = "y"
sliding = "-x"
stiffness = "contact_stiffness"

[[load]]
on = "mass"
direction = "-y"
force = "normal_force"

[parameters]
m = { default = 1.0, unit = "kg" }
k1 = { default = 178632.7949540818, unit = "N/m" }
k2 = { default = 2488033.871712585, unit = "N/m" }
contact_stiffness = { default = 1333333.3333333333, unit = "N/m" }
alpha1 = { default = 150.0, unit = "deg" }
alpha2 = { default = 30.0, unit = "deg" }
normal_force = { default = 100.0, unit = "N" }
"""

BELT = """\
[[mass]]
name = "mass"
mass = "m"
directions = ["x", "y"]

[[spring]]
between = ["mass", "ground"]
direction = "x"
stiffness = "stiffness"

[[contact]]
between = ["mass", "belt"]
normal = "y"
sliding = "-x"
stiffness = "contact_stiffness"

[[load]]
on = "mass"
direction = "-y"
force = "normal_force"

[parameters]
friction = 0.5
sliding_speed = 1.0
damping_ratio = 0.05
"friction_law.static_ratio" = 2.0
"friction_law.decay_speed" = 0.5
m = { default = 1.0, unit = "kg" }
stiffness = { default = 394784.1760435743, unit = "N/m" }
normal_force = { default = 628.3185307179587, unit = "N" }
contact_stiffness = { default = 1e8, unit = "N/m" }
"""

MINIMAL = {"hulten": HULTEN, "hoffmann": HOFFMANN, "belt": BELT}

# two pads that feed each other: values of `test_run_classes.py` are of runs that do so for long
TWO_PADS = """\
[[mass]]
name = "a"
mass = "mass_a"
directions = ["x", "y"]

[[mass]]
name = "b"
mass = 1.0
directions = ["x", "y"]

[[spring]]
between = ["a", "b"]
direction = [1, 0.4]
stiffness = "k_ab"

[[spring]]
between = ["a", "ground"]
direction = [1, -0.7]
stiffness = 2e6

[[spring]]
between = ["b", "ground"]
direction = "x"
stiffness = 8e5

[[damper]]
between = ["a", "ground"]
direction = "x"
damping = 20

[[damper]]
between = ["a", "ground"]
direction = "y"
damping = 20

[[damper]]
between = ["b", "ground"]
direction = "x"
damping = 12

[[damper]]
between = ["b", "ground"]
direction = "y"
damping = 12

[[contact]]
between = ["a", "disc"]
normal = "y"
sliding = "-x"
stiffness = 2e6

[[contact]]
between = ["b", "disc"]
normal = "y"
sliding = "-x"
stiffness = 1.2e6
friction_factor = "factor_b"

[[load]]
on = "a"
direction = "-y"
force = 500

[[load]]
on = "b"
direction = "-y"
force = 300

[parameters]
"friction_law.static_ratio" = 1.4
"friction_law.decay_speed" = 0.2
damping_ratio = 0.0
mass_a = { default = 2.0, unit = "kg" }
k_ab = { default = 2e6, unit = "N/m" }
factor_b = { default = 1.0, unit = "" }
"""


def write_minimal(folder: Path, name: str) -> Path:
    """The file of a minimal model, as a lumped one."""
    path = folder / f"{name}.toml"
    path.write_text(MINIMAL[name])
    return path
