"""Gyroscopic terms of a disc whose speed changes during a run: they follow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from study_runs import solved
from test_turning_disc import BAND, ON

import squealstudy as sq
from squealstudy.kinds.transient.schedules import ParameterSchedule, Schedules
from squealstudy.mechanics.motions import set_up
from squealstudy.motion.point import perturbed
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate


@pytest.fixture
def small_brake(tiny_brake, assembled_once):
    return sq.model("disc_brake", mesh="coarse", contact_points=2)


def test_gyroscopic_terms_follow_the_speed_over_time(small_brake):
    """A linear brake that stops, by Runge and Kutta's method of order 4 on its coordinates."""
    still = small_brake.with_(
        friction=0.0, damping_ratio=0.0, stiffness_damping=0.0, contact_law="bilateral", **ON
    )
    system = still.at(sliding_speed=5.0)
    ((reference, start, _, _),) = set_up(system._in_time(BAND), "regularised", single=True)
    pushed = perturbed(reference.system, start, 0.01, modes=range(8, 20))
    G = reference.damping.turning_at(system.point.state())
    assert pytest.approx(start.damping_between, abs=1e-9 * np.abs(G).max()) == G
    end, h = 1e-3, 5e-7
    stop = Schedules(ParameterSchedule(((0.0, 1.0), (end, -1.0)), True), None)
    schedule = stop.of({"sliding_speed": 5.0, "pressure": 1.2e6}, reference.load, G)
    settings = MotionSettings(end, h, 10)
    at_one_speed, changing = (
        simulate(reference.system, [point], settings)[0]
        for point in (pushed, replace(pushed, schedule=schedule))
    )

    def rates(time, state):
        q, v = state
        return np.array([v, -reference.system.omega2 * q - (1.0 - 2.0 * time / end) * (G @ v)])

    state = np.array([pushed.q0, pushed.v0])
    for time in h * np.arange(round(end / h)):
        a = rates(time, state)
        b = rates(time + h / 2, state + h / 2 * a)
        c = rates(time + h / 2, state + h / 2 * b)
        state = state + h / 6 * (a + 2 * b + 2 * c + rates(time + h, state + h * c))

    def apart(run):
        return np.linalg.norm(run.v - state[1]) / np.linalg.norm(state[1])

    assert apart(changing) < 2e-3
    assert apart(at_one_speed) > 20 * apart(changing)


STOP = """
[study]
name = "stop"
kind = "transient"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[parameters]
sliding_speed = 5.0
[[sweep]]
parameter = "gyroscopic_factor"
values = [0.0, 1.0]
[modes]
band = [500.0, 4000.0]
[transient]
duration = 2e-4
step = 2e-6
sliding_speed = { points = [[0.0, 1.0], [2e-4, 0.5]], relative = true }
"""


def test_a_study_of_a_stop_has_them(small_brake, tmp_path, monkeypatch):
    """Those of the design point's own speed are handed to its schedule; none where none turn."""
    handed = {}
    of = Schedules.of

    def noted(self, values, load, turning=None):
        handed[values["gyroscopic_factor"]] = turning
        return of(self, values, load, turning)

    monkeypatch.setattr(Schedules, "of", noted)
    points = solved(STOP, tmp_path / "stop").points
    assert (points["status"] == "ok").all()
    assert handed[0.0] is None
    assert np.abs(handed[1.0] + handed[1.0].T).max() < 1e-6 * np.abs(handed[1.0]).max()
