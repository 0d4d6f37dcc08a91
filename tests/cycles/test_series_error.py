"""Numbers of limit cycles are within their own bounds of the independent judge's.

Each design was outside: rungs that agree by chance, samples that miss a kink of friction, peaks of
torque where all rungs overshoot.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cycle_models as models
import numpy as np
import pytest
from event_reference import design

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "studies" / "benchmarks"))

from column_cases import Case
from column_truth import compared

import squealstudy as sq
from squealstudy.cycles.cycle import (
    MAX_CHANGE_RATIO,
    SERIES_SAFETY_FACTOR,
    CycleLevels,
    errors_by_changes,
)
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import Floquet, _difference, _size_change

BOUNDED = {"torque_rms", "contact_velocity", "frequency_hz", "torque_peak"}
WIDEST = 60.0  # bounds over true errors
LAW = "friction_law."
CORNER = "contact.regularisation_speed"
DESIGNS = {
    "friction of a contact that pulls": design(
        "hulten",
        **{
            "damping_ratio": 0.00872858,
            "sliding_speed": 2.93444,
            "friction": 0.304091,
            CORNER: 0.02469,
        },
    ),
    "slow harmonics": design(
        "hoffmann",
        **{
            "damping_ratio": 0.00360769,
            "sliding_speed": -2.17108,
            LAW + "static_ratio": 1.3,
            "friction": 0.72426,
            CORNER: 0.1105,
        },
    ),
    "a contact that opens": design(
        "hoffmann",
        "power",
        **{
            "damping_ratio": 0.025642,
            "sliding_speed": 0.144039,
            LAW + "static_ratio": 1.3,
            "friction": 0.777333,
            "contact.exponent": 1.0,
            "contact.stiffness": 293766000000.0,
            CORNER: 0.003118,
        },
    ),
    "sliding that turns for a moment": design(
        "belt",
        smooth=True,
        **{
            "damping_ratio": 0.00318012,
            "sliding_speed": 1.48927,
            "friction": 0.259724,
            LAW + "static_ratio": 2.08303,
            LAW + "decay_speed": 0.597436,
            CORNER: 0.002569,
        },
    ),
}


LONG = ("friction of a contact that pulls", "sliding that turns for a moment", "slow harmonics")


@pytest.mark.parametrize(
    "name",
    [pytest.param(d, marks=[pytest.mark.full_size] * (d in LONG)) for d in DESIGNS],
)
def test_numbers_are_within_their_bounds_of_the_judges(name):
    d = DESIGNS[name]
    law = "smooth" if d.smooth else "regularised"
    case = Case("limit_cycles", 0, d, {"reach": 4.0, "friction": law, "kick_along_mode": False})
    told = {t.column: t for t in compared(case) if t.table == "cycles" and t.bounded}
    assert set(told) >= BOUNDED
    for column in BOUNDED:
        t = told[column]
        assert t.inside, t
        # errors below those of the judge tell nothing of the width
        assert t.width < WIDEST or abs(t.told / t.truth - 1) < 1e-5, t


def test_rungs_that_agree_by_chance_have_the_error_of_the_change_before():
    def found(rms):
        levels = {"torque_rms": rms, "contact_velocity": 1.0, "torque_peak": 3.0}
        return CycleLevels(PeriodicMotion(np.zeros((3, 1)), 10.0), levels)

    by_chance = errors_by_changes([found(x) for x in (1.3, 1.1, 1.0, 1.0)])
    assert by_chance.level == pytest.approx(SERIES_SAFETY_FACTOR * 0.1 / MAX_CHANGE_RATIO)
    falling = errors_by_changes([found(x) for x in (1.3, 1.0, 1.1, 1.0)])
    assert falling.level == pytest.approx(SERIES_SAFETY_FACTOR * 0.1)
    assert errors_by_changes([found(1.1), found(1.0)]).level == pytest.approx(
        SERIES_SAFETY_FACTOR * 0.1
    )
    assert (by_chance.velocity, by_chance.peak, by_chance.frequency) == (0.0, 0.0, 0.0)


def shifted(motion, phase):
    """A motion that begins at another phase."""
    H = motion.harmonics
    cosine, sine = motion.Q[1 : H + 1], motion.Q[H + 1 :]
    angle = phase * np.arange(1, H + 1)[:, None]
    turned = cosine * np.cos(angle) + sine * np.sin(angle)
    beside = sine * np.cos(angle) - cosine * np.sin(angle)
    return replace(motion, Q=np.vstack([motion.Q[:1], turned, beside]))


def test_what_a_peak_between_samples_may_rise_is_known_of_any_motion():
    """Of 5 harmonics; at some phases half a sample lies beside the peak."""
    contact = models.Designs("hoffmann", models.BISTABLE).at(friction=0.5)
    Q = np.random.default_rng(5).normal(size=(11, 2)) * 1e-7
    motion = PeriodicMotion(Q, 2e3)
    largest = contact.levels(motion, 200 * 512)["contact_velocity"]
    missed, between = [], []
    for phase in np.linspace(0.0, 2.0 * np.pi / 512, 8, endpoint=False):
        turned = shifted(motion, phase)
        missed.append(largest - contact.levels(turned)["contact_velocity"])
        between.append(contact.velocity_between_samples(turned))
    assert -1e-9 * largest < min(missed)
    assert max(missed) < min(between) < 20 * max(missed)


@pytest.mark.full_size  # by default of any motion: above
def test_a_peak_of_velocity_between_samples_is_within_its_error():
    """The phase is free, and with it where samples fall: at some, half of one beside the peak."""
    laws = {"contact_law": "cubic", "contact.cubic_stiffness": 5e17}
    system = sq.model("hulten", friction=0.31, damping_ratio=0.01, **laws).at()
    found = system.limit_cycles(60)  # the error of the series is far less
    (_, cycle), contact = found.cycles[0], found.contact
    motion = cycle.motion
    largest = contact.levels(motion, 200 * 512)["contact_velocity"]
    for phase in np.linspace(0.0, 2.0 * np.pi / 512, 8, endpoint=False):
        told = contact.levels(shifted(motion, phase))["contact_velocity"]
        missed = 1.0 - told / largest
        between = contact.velocity_between_samples(motion) / told
        assert -1e-9 < missed < between < cycle.velocity_error
        assert between < 1e-4


def test_a_multiplier_that_decides_has_an_error_however_small_it_is():
    """A pad on stops: .457 +- .009 by 7 harmonics, its multiplier being .388."""

    def multipliers(*sizes):
        values = np.array([*sizes, 1.0], complex)
        return Floquet(values, np.eye(len(values)), np.zeros(len(values)), 0.01)

    few, more = multipliers(0.457, 0.02), multipliers(0.388, 0.1)
    assert _size_change(few, more) == pytest.approx(0.069)
    assert _difference(few.multipliers, more.multipliers) == pytest.approx(0.069)
    assert _size_change(multipliers(0.9, 0.6, 0.3), multipliers(0.88, 0.55, 0.1)) == pytest.approx(
        0.05
    )
    assert _size_change(multipliers(), multipliers()) == 0.0
