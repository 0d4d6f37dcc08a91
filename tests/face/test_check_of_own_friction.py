"""What `check` says of lumped models whose contacts have friction of their own."""

from __future__ import annotations

import pytest
from study_runs import command

STUDY = """\
[study]
name = "block"
kind = "transient"
[model]
file = "block.toml"
[parameters]
friction = 0.3
[[sweep]]
parameter = "sliding_speed"
values = [0.1, 0.2]
[transient]
duration = 0.01
step = 1e-5
[modes]
band = [1.0, 20000.0]
"""
BLOCK = """\
[[mass]]
name = "block"
mass = 2.0
directions = ["x", "y"]
[[spring]]
between = ["block", "ground"]
direction = "x"
stiffness = 3e5
[[contact]]
between = ["block", "belt"]
normal = "y"
sliding = "x"
stiffness = 1e6
OWN
[[load]]
on = "block"
direction = "-y"
force = 100
"""
PIN = """\
[[contact]]
between = ["block", "ground"]
normal = "x"
sliding = "y"
stiffness = 1e6
friction = 0.2
state = "sliding"
"""


def checked(folder, capsys, block: str) -> str:
    """The screen of `check`, in one line."""
    (folder / "block.toml").write_text(block)
    (folder / "study.toml").write_text(STUDY)
    assert command("check", str(folder / "study.toml")) == 0
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("own", "is_same"), [("", True), ("friction_law = { static_ratio = 1.5 }", False)]
)
def test_friction_of_an_own_law_is_not_called_the_same(tmp_path, capsys, own, is_same):
    screen = checked(tmp_path, capsys, BLOCK.replace("OWN", own))
    assert "friction_law = exponential_fall" in screen
    assert ("friction is the same at all speeds" in screen) == is_same


def test_a_state_that_no_run_can_have_is_told_before_it(tmp_path, capsys):
    screen = checked(tmp_path, capsys, BLOCK.replace("OWN", "") + PIN)
    said = "no timed design point can be solved: in time a contact with a state sticks and slips"
    assert said in screen
