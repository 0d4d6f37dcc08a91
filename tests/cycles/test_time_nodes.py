"""Multipliers and levels of cycles that stick for a hundredth of a period are within their errors.

Series of 7 to 60 harmonics do not see what the contact does there, and agree with each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from event_reference import design, run

import squealstudy as sq
from squealstudy.cycles import time_nodes
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import floquet
from squealstudy.cycles.harmonics import series_at
from squealstudy.cycles.propagators import _states
from squealstudy.cycles.time_nodes import (
    _paths,
    cycle_at_nodes,
    has_corners,
    monodromy_at_nodes,
)
from squealstudy.cycles.trials import state_of

VALUES = {
    "sliding_speed": -0.127985,
    "friction": 1.0129,
    "friction_law.static_ratio": 1.3,
    "contact.regularisation_speed": 0.001013,
}
PERIODS, DEVIATION = 120, 1e-5  # until only the cycle is left; of its size


def judged_run(damping_ratio, osc, motion):
    """The judge's run that leads to its own cycle."""
    d = design("hoffmann", "unilateral", **VALUES, damping_ratio=damping_ratio)
    normal, tangential, _ = osc.B[0]
    q, v = state_of(motion)
    start = np.array([tangential @ q, normal @ q, tangential @ v, normal @ v])
    return run(d, PERIODS * 2.0 * np.pi / motion.omega, start=start, tolerance=1e-10)


def judged_sizes(damping_ratio, osc, motion):
    """Sizes of the multipliers of the judge's own cycle: deviations a period later."""
    record = judged_run(damping_ratio, osc, motion)
    d = record.design
    period, end = record.cycle().period, record.end
    size = np.ptp(record.rows[-1000:, :4], axis=0)

    def later(change):
        return run(d, period, start=end + change, sample=period / 64, tolerance=1e-11).end

    steps = DEVIATION * np.diag(size)
    columns = [(later(s) - later(-s)) / (2.0 * s.sum()) for s in steps]
    return np.sort(np.abs(np.linalg.eigvals(np.array(columns).T)))


@pytest.mark.parametrize("damping_ratio", [0.0243775, 0.0248048])
def test_multipliers_where_series_do_not_see_that_the_contact_sticks(damping_ratio):
    values = VALUES | {"damping_ratio": damping_ratio}
    system = sq.model("hoffmann", contact_law="unilateral", **values).at()
    few, more = (system.limit_cycles(h, reach=4.0) for h in (7, 16))
    (cycle,), (finer,) = ([c for _, c in f.cycles if c.attracts] for f in (few, more))
    osc = few.contact.oscillator
    told = floquet(osc, cycle.motion, finer.motion)
    sizes = judged_sizes(damping_ratio, osc, cycle.motion)
    assert sizes[-1] == pytest.approx(1.0, abs=1e-4)  # the trivial one
    assert abs(told.modulus - sizes[-2]) < told.error < 0.06
    assert has_corners(osc, cycle.motion)
    at_nodes = np.sort(np.abs(np.linalg.eigvals(monodromy_at_nodes(osc, cycle.motion))))
    assert at_nodes == pytest.approx(sizes, abs=2e-3)


def test_a_level_where_other_series_do_not_converge():
    """7 harmonics have 153.78 N and 5 have 153.74, the cycle has 155.03; 16 have none."""
    values = VALUES | {"damping_ratio": 0.0223756}
    found = sq.model("hoffmann", contact_law="unilateral", **values).at().limit_cycles(7, reach=4.0)
    (cycle,) = [c for _, c in found.cycles if c.attracts]
    rms = judged_run(0.0223756, found.contact.oscillator, cycle.motion).cycle().levels.rms
    assert 5e-3 < abs(cycle.levels["torque_rms"] / rms - 1.0) < cycle.level_error < 0.02


@pytest.mark.parametrize("count", [4, 40])  # fewer steps than the series has terms, and more
def test_states_within_steps_are_those_of_the_series(count):
    series = np.random.default_rng(3).normal(size=(15, 2))
    q, v = _states(PeriodicMotion(series, 5.0), count, 0.3)
    synthesis, slope = series_at(2.0 * np.pi * (np.arange(count) + 0.3) / count, 7)
    assert q == pytest.approx(synthesis @ series, abs=1e-12)
    assert v == pytest.approx(5.0 * slope @ series, abs=1e-11)


def test_paths_by_parts_are_those_step_by_step():
    steps = np.random.default_rng(4).normal(scale=0.5, size=(128, 4, 6))
    within, ahead = _paths(steps)
    path, every = np.eye(4, 6), []
    for step in steps:
        every.append(path)
        path = step[:, :4] @ path + np.pad(step[:, 4:], ((0, 0), (4, 0)))
    by_parts = within[..., :4] @ ahead[:-1, None]
    by_parts[..., 4:] += within[..., 4:]
    assert by_parts.reshape(128, 4, 6) == pytest.approx(np.array(every), rel=1e-9)
    assert ahead[-1] == pytest.approx(path, rel=1e-9)


def test_a_cycle_at_nodes_is_solved_once(monkeypatch):
    values = VALUES | {"damping_ratio": 0.0243775}
    found = sq.model("hoffmann", contact_law="unilateral", **values).at().limit_cycles(7, reach=4.0)
    (cycle,) = [c for _, c in found.cycles if c.attracts]
    states = cycle_at_nodes(found.contact.oscillator, cycle.motion)
    monkeypatch.setattr(time_nodes, "_newton_step", None)
    assert cycle_at_nodes(found.contact.oscillator, cycle.motion) is states
    with pytest.raises(TypeError):
        cycle_at_nodes(found.contact.oscillator, replace(cycle.motion))
