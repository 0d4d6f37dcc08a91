"""Slow stick-slip: a class of its own, a start of its own, and what rounds it away."""

from pathlib import Path

import numpy as np
import pytest
from stick_slip_cycle import stick_slip
from study_runs import plan_of, solved
from study_texts import study_text

from squealstudy.kinds.transient.preparation import warnings
from squealstudy.motion.outcome.energies import transfer

GROAN = (
    study_text("groan", "transient", "belt")
    + """[parameters]
mass = 10.0
stiffness = 4000.0
normal_force = 98.1
friction = 0.2
"friction_law.static_ratio" = 1.5
"friction_law.decay_speed" = {decay}
sliding_speed = 0.01
damping_ratio = {zeta}
[modes]
band = [0.1, 100.0]
[transient]
duration = {duration}
step = 5e-5
save_every = 4
slope_pilot = "never"
{more}
"""
)


@pytest.fixture(scope="module")
def groan(tmp_path_factory: pytest.TempPathFactory):
    text = GROAN.format(decay=1e-3, zeta=0.0, duration=10.0, more='start = "stuck"')
    return solved(text, tmp_path_factory.mktemp("groan") / "r")


def test_slow_stick_slip_lasts_whatever_linear_growth_says(groan) -> None:
    row = groan.points.iloc[0]
    true = stick_slip(10.0, 4000.0, 98.1, 0.2, 1.5, 1e-3, 0.01, 0.0)
    assert row["class"] == "limit_cycle"
    assert row["torque_rms"] == pytest.approx(true.rms, rel=0.03)  # friction is rounded off, 2 %
    assert row["frequency_hz"] == pytest.approx(true.frequency_hz, rel=0.02)


def test_a_stuck_start_slides_nowhere(groan) -> None:
    history = groan.history(0)
    assert history["stick"].iloc[0] == 1.0
    sticks = (history["stick"] < 1).to_numpy()
    first_slip = history["time"].iloc[int(np.argmax(sticks))]
    # the belt carries the mass until its spring asks for what static friction has beyond dynamic
    carried = 98.1 * 0.2 * 0.5 / 4000.0 / 0.01
    assert first_slip == pytest.approx(carried, rel=0.05)


def test_a_few_periods_are_undecided_for_their_number(tmp_path: Path) -> None:
    text = GROAN.format(decay=1e-3, zeta=0.0, duration=3.0, more="perturbation = 0.02")
    row = solved(text, tmp_path / "r").points.iloc[0]
    assert row["class"] == "undecided"
    assert np.isinf(row["undecided_until"]) or row["undecided_until"] < 15.0


@pytest.mark.parametrize(("decay", "told"), [(1e-5, True), (1e-3, False)])
def test_excess_of_static_friction_that_is_rounded_away_is_said(decay: float, told: bool) -> None:
    plan = plan_of(GROAN.format(decay=decay, zeta=0.01, duration=3.0, more=""))
    said = [text for text in warnings(plan) if "rounded away" in text]
    assert len(said) == told
    if told:
        assert "2e-06 or less" in said[0]


def test_nothing_takes_over_where_all_start_together() -> None:
    """The second mode has nine tenths of the first's energy from the start, and more at the end."""
    time = np.linspace(0.0, 1.0, 1000)
    energies = np.column_stack([1.0 - 0.5 * time, np.full(1000, 0.9)])
    first, last, when = transfer(time, energies, np.array([25, 27]))
    assert (first, last) == (0, 0)
    assert np.isnan(when)
    energies[:, 1] = np.where(time < 0.5, 0.1, 0.9)
    assert transfer(time, energies, np.array([25, 27]))[:2] == (25, 27)
