"""Dampers of third power of lumped models: judged in time, in limit cycles and in the roots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import squealstudy as sq
from squealstudy.cli import model_commands
from squealstudy.errors import StudyFileError
from squealstudy.study.lumped import read_lumped

# x'' + x' (x'^2 / 3 - 1) + x = 0 (Rayleigh), beside a contact that presses and does nothing else:
# its velocity is van der Pol's oscillator with mu = 1; friction is 0
RAYLEIGH = """\
coordinates = ["x", "y"]

[[term]]
matrix = "M"
file = "one.mtx"

[[term]]
matrix = "K"
file = "one.mtx"

[[term]]
matrix = "C"
file = "fed.mtx"

[[damper]]
along = "x"
damping = 0.0
cubic = "1/3"

[[contact]]
normal = "y"
sliding = "x"
stiffness = 1.0

[[load]]
along = "-y"
force = 1.0

[parameters]
friction = 0.0
sliding_speed = 5.0
"""
MATRIX = "%%MatrixMarket matrix array real general\n2 2\n"
ONE, FED = MATRIX + "1\n0\n0\n1\n", MATRIX + "-1\n0\n0\n1\n"
PERIOD, PEAK = 6.66328686, 2.00861986  # of van der Pol's oscillator (published)
BLOCK = """\
[[mass]]
name = "block"
mass = 1.0
directions = ["x", "y"]

[[spring]]
between = ["block", "ground"]
direction = "x"
stiffness = 4e4

[[damper]]
name = "linear"
between = ["block", "ground"]
direction = "x"
damping = 4.0

[[damper]]
name = "third"
between = ["block", "ground"]
direction = "x"
damping = 1.0
cubic = "c"

[[damper]]
between = ["block", "ground"]
direction = "y"
damping = 40.0

[[contact]]
between = ["block", "belt"]
normal = "y"
sliding = "-x"
stiffness = 1e7

[[load]]
on = "block"
direction = "-y"
force = 100.0

[parameters]
friction = 0.4
sliding_speed = 0.8
"friction_law.static_ratio" = 2.0
"friction_law.decay_speed" = 0.5
c = { default = 300.0, unit = "N s3/m3" }
"""
BAND = (1.0, 1000.0)


def model_of(folder, text, **values):
    (folder / "one.mtx").write_text(ONE)
    (folder / "fed.mtx").write_text(FED)
    (folder / "model.toml").write_text(text)
    return sq.model(str(folder / "model.toml"), **values)


def test_rayleigh_in_time_and_as_a_cycle(tmp_path):
    """Period and largest velocity are the published ones of van der Pol's oscillator."""
    system = model_of(tmp_path, RAYLEIGH).at()
    run = system.simulate(
        duration=120.0, step=5e-3, perturbation=0.1, band=(0.01, 1.0), save_every=1
    )
    found = run.summary().iloc[0]
    assert found["class"] == "limit_cycle"
    assert 1.0 / found["frequency_hz"] == pytest.approx(PERIOD, rel=1e-5)
    assert run.motions[0].sensed_v[-3000:].max() == pytest.approx(PEAK, rel=1e-4)
    (cycle,) = system.limit_cycles(band=(0.01, 1.0)).to_pandas().itertuples()
    assert bool(cycle.stable)
    assert 1.0 / cycle.frequency_hz == pytest.approx(PERIOD, rel=1e-6)


def judged(c, speed, duration=3.0):
    """RMS of the friction force and frequency of sliding without sticking: own equations."""
    drag = lambda v: 40.0 * (1.0 + np.exp(-(speed + v) / 0.5))  # noqa: E731
    y = solve_ivp(
        lambda t, y: [y[1], -4e4 * y[0] - 5.0 * y[1] - c * y[1] ** 3 - drag(y[1])],
        (0.0, duration), [-drag(0.0) / 4e4, 0.1], "DOP853",
        np.arange(0.8 * duration, duration, 1e-5), rtol=1e-10, atol=1e-13, max_step=1e-3,
    ).y  # fmt: skip
    assert np.abs(y[1]).max() < speed  # it never sticks
    force, x = drag(y[1]), y[0] - y[0].mean()
    up = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossed = up - x[up] / (x[up + 1] - x[up])
    whole = slice(up[0], up[-1])
    return force[whole].std(), (len(up) - 1) / (crossed[-1] - crossed[0]) * 1e5


def test_falling_friction_that_a_third_power_bounds(tmp_path):
    """By a run and by harmonic balance, against own equations."""
    rms, hz = judged(300.0, 0.8)
    system = model_of(tmp_path, BLOCK).at()
    run = system.simulate(duration=2.0, step=5e-5, perturbation=0.1, band=BAND).summary().iloc[0]
    assert run["class"] == "limit_cycle"
    assert run["torque_rms"] == pytest.approx(rms, rel=1e-4)
    assert run["frequency_hz"] == pytest.approx(hz, rel=1e-5)
    assert run["energy_balance"] < 1e-5
    cycles = system.limit_cycles(band=BAND).to_pandas()
    (cycle,) = cycles.itertuples()
    assert bool(cycle.stable)
    assert cycle.torque_rms == pytest.approx(rms, rel=1e-5)
    assert cycle.frequency_hz == pytest.approx(hz, rel=1e-5)
    assert abs(cycle.power_imbalance) < 1e-6


def test_roots_do_not_know_it(tmp_path):
    """The linearisation is at rest relative to the belt; alone and in a batch."""
    model = model_of(tmp_path, BLOCK)
    batch = model.at(c=np.array([0.0, 300.0, 1e6])).modes(BAND).lam
    assert batch == pytest.approx(np.broadcast_to(batch[0], batch.shape), rel=1e-13)
    assert model.at().modes(BAND).lam == pytest.approx(batch[0], rel=1e-12)
    assert model.at().sensitivities("c", modes=1, band=BAND).derivative[0, 0] == 0.0


def test_screens_and_bad_input(tmp_path, capsys):
    model_of(tmp_path, BLOCK)
    model_commands.inspect(tmp_path / "model.toml")
    shown = " ".join(capsys.readouterr().out.split())
    assert "damper linear block - ground x 4 N s/m damper" in shown
    assert "damper third block - ground x 1 N s/m, 300 N s3/m3 damper" in shown
    (tmp_path / "model.toml").write_text(BLOCK.replace('cubic = "c"', 'cubic = "-c"'))
    with pytest.raises(StudyFileError, match=r"damper\[2\]\.cubic.: expected at least 0 N s3/m3"):
        read_lumped(tmp_path / "model.toml")
    (tmp_path / "model.toml").write_text(BLOCK.replace('cubic = "c"', "gap = 1e-3"))
    with pytest.raises(StudyFileError, match=r"damper\[2\]\.gap"):
        read_lumped(tmp_path / "model.toml")
