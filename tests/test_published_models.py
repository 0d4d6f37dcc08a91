"""Lumped models of others, with the numbers that they have published."""

from __future__ import annotations

import numpy as np
import pytest

import squealstudy as sq

# of bSTAB (Stender and Hoffmann, Nonlinear Dynamics 2021), case "friction": a block of 1 kg on a
# belt, in its own units; what holds it on the belt moves apart from it
BLOCK = """\
[[mass]]
name = "block"
mass = 1.0
directions = ["x", "y"]

[[spring]]
between = ["block", "ground"]
direction = "x"
stiffness = 1.0

[[damper]]
between = ["block", "ground"]
direction = "x"
damping = 0.1

[[damper]]
between = ["block", "ground"]
direction = "y"
damping = 40.0

[[contact]]
between = ["block", "belt"]
normal = "y"
sliding = "x"
stiffness = 1e4

[[load]]
on = "block"
direction = "-y"
force = 1.0

[parameters]
friction = 0.5
"friction_law.static_ratio" = 2.0
"friction_law.decay_speed" = 0.5
"""
# speed of the belt: share of 5,000 starts in [-2, 2] x [0, 2] that come to rest, and its standard
# error, of its MATLAB runs as the repository adrianwix/pyBasin has them (friction_case1 and 2)
SHARES = {
    1.25: (0.0800, 0.0038), 1.325: (0.1478, 0.0050), 1.4: (0.2130, 0.0058),
    1.475: (0.2776, 0.0063), 1.5: (0.3040, 0.0065), 1.55: (0.3544, 0.0068),
    1.625: (0.4202, 0.0070), 1.7: (0.4922, 0.0071), 1.775: (0.5678, 0.0070),
}  # fmt: skip
BAND = (0.01, 1.0)


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    path = tmp_path_factory.mktemp("published") / "block.toml"
    path.write_text(BLOCK)
    return sq.model(str(path))


def share_at_rest(cycle, speed):
    """Share of the starts that an unstable cycle encloses: those come to rest."""
    angle = np.linspace(0.0, 2 * np.pi, 4001)
    k = np.arange(1, cycle.motion.harmonics + 1)
    mean, cosines, sines = np.split(cycle.motion.Q[:, 0], [1, 1 + len(k)])
    series = np.exp(1j * np.outer(angle, k)) @ (cosines - 1j * sines)
    rate = np.exp(1j * np.outer(angle, k)) @ (1j * k * (cosines - 1j * sines))
    # a mode's sign is free: friction falls with speed, so that on average the belt pulls more
    sign = np.sign(mean[0])
    steady = 0.5 * (1.0 + np.exp(-speed / 0.5))
    x = np.clip(steady + sign * (mean[0] + series.real), -2.0, 2.0)
    v = np.clip(sign * cycle.motion.omega * rate.real, 0.0, 2.0)
    return abs(np.trapezoid(v, x)) / 8.0


@pytest.mark.parametrize("speed", SHARES)
def test_shares_of_starts_that_come_to_rest(speed, block):
    """By the unstable cycle, against bSTAB's runs."""
    cycles = [c for _, c in block.at(sliding_speed=speed).limit_cycles(band=BAND).cycles]
    inner = next(c for c in cycles if c.attracts is False)
    published, error = SHARES[speed]
    assert abs(share_at_rest(inner, speed) - published) < 2 * error


@pytest.mark.parametrize(
    ("speed", "kick", "lasts"),
    [
        (1.1, 0.05, True),
        (1.5, 1.1, False),
        (1.5, 1.4, True),
        (1.775, 1.9, True),
        (1.85, 2.0, False),
    ],
)
def test_where_stick_and_slip_last(speed, kick, lasts, block):
    """From any start at 1.1 (bSTAB: all of 5,000), from none at 1.85, from large ones between."""
    run = block.at(sliding_speed=speed).simulate(
        duration=800.0 if kick < 0.1 else 300.0, step=5e-3, perturbation=kick, band=BAND
    )
    assert run.summary()["class"][0] == ("limit_cycle" if lasts else "stable")
