"""Cycles that are small from the start, or small where no mode is neutral, end at no Hopf point."""

from __future__ import annotations

import pytest
from study_runs import plan_of, solved

PADS = """\
[[mass]]
name = "pad"
mass = 0.8537
directions = ["x", "y"]
[[mass]]
name = "rotor"
mass = 2.2873
directions = ["y"]
[[spring]]
between = ["pad", "ground"]
direction = [0.92753, 0.37375]
stiffness = 5.5556e6
[[damper]]
between = ["pad", "ground"]
direction = [0.92753, 0.37375]
damping = 9.6097
[[spring]]
between = ["pad", "ground"]
direction = [-0.88974, 0.45646]
stiffness = 3.9587e6
cubic = 1e15
[[damper]]
between = ["pad", "ground"]
direction = [-0.88974, 0.45646]
damping = 5.3869
[[spring]]
between = ["rotor", "ground"]
direction = "y"
stiffness = 5.8647e6
cubic = 1e14
[[damper]]
between = ["rotor", "ground"]
direction = "y"
damping = 5.3013
[[contact]]
between = ["pad", "rotor"]
normal = "y"
sliding = "-x"
stiffness = 6.6036e6
[[load]]
on = "pad"
direction = "-y"
force = 1062.2
[[load]]
on = "rotor"
direction = "y"
force = 1062.2
[parameters]
friction = 0.3
damping_ratio = 0.0
sliding_speed = 30.0
"""
STUDY = """\
[study]
name = "small"
kind = "limit_cycles"
[model]
file = "pads.toml"
contact_law = "unilateral"
[[sweep]]
parameter = "friction"
values = {values}
[modes]
band = [10.0, 3000.0]
[limit_cycles]
follow = "friction"
neighbours = false
undecided_in_time = false
families = {families}
"""
HOPF = 0.4357  # of the roots of the linearised equation, the only one: mode 3


@pytest.mark.parametrize(
    ("values", "families", "n_hopf"), [([0.391, 0.47], [1], 0), ([0.43, 0.436, 0.445], [3], 1)]
)
def test_branches_end_at_onsets_alone(values, families, n_hopf, tmp_path):
    """Mode 1 is at half of the frequency of mode 3: its small cycles stay .03 % of the speed."""
    (tmp_path / "pads.toml").write_text(PADS, encoding="utf-8")
    text = STUDY.format(values=values, families=families)
    branches = solved(plan_of(text, tmp_path / "small.toml"), tmp_path / "done").table("branches")
    assert len(branches)
    onsets = branches[(branches["event"] == "H").to_numpy(bool)]
    assert onsets["value"].tolist() == pytest.approx(n_hopf * [HOPF], abs=2e-4)
    assert branches["branch_end"].tolist().count("hopf") == n_hopf
