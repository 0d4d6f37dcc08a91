"""Thresholds of limit cycles and kicks against runs in time; what is no threshold, and no cycle."""

from __future__ import annotations

from dataclasses import replace

import cycle_models as models
import numpy as np
import pytest

from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import (
    IF_KICKED,
    NO_CYCLE,
    Cycle,
    Family,
    Followed,
    Search,
    _judged,
    families,
)
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.growth import STILL, linear_modes
from squealstudy.cycles.harmonics import series_at
from squealstudy.cycles.kicked import (
    DECAYS,
    GROWS,
    PHASES,
    Trials,
    kick_along_mode,
    kicks,
    state_of,
)

SEED = 11
DRAWN = {  # values, contact law, ranges of what is drawn, saturation [m/s], kind of friction
    "hoffmann": (
        models.BISTABLE,
        "cubic",
        {
            "friction": (0.15, 0.75),
            "damping_ratio": (0.005, 0.015),
            "contact.cubic_stiffness": (-8e17, -3e17),
        },
        1e-3,
        "regularised",
    ),
    "belt": (
        {"sliding_speed": 1.3},
        None,
        {
            "sliding_speed": (1.16, 1.5),
            "damping_ratio": (0.04, 0.06),
            "friction_law.static_ratio": (1.8, 2.4),
        },
        0.2,
        "smooth",
    ),
}


def with_thresholds(name, count):
    """The first designs drawn that have a threshold, their contact closed: contact, family."""
    values, law, ranges, saturation, kind = DRAWN[name]
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(10 * count):
        drawn = {key: float(rng.uniform(*ends)) for key, ends in ranges.items()}
        contact = models.Designs(name, values | drawn, law, kind, saturation).at()
        search = Search(None, 1e-2, 1.2 * abs(contact.point.speed))
        own = families(contact, (1.0, 1e6), [1], 1e-9, search)
        found += [
            (contact, family)
            for _, family in own.families
            if family.threshold is not None
            and family.loudest.levels["open_share_max"] == 0.0  # else outside the law's validity
        ]
        if len(found) == count:
            return found
    raise AssertionError(f"{len(found)} of {count} designs have a threshold")


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("count", [1, pytest.param(10, marks=pytest.mark.full_size)])
def test_below_a_threshold_motions_decay_and_above_it_they_grow(name, count):
    """Ten designs each with `pytest -m full_size`."""
    for contact, family in with_thresholds(name, count):
        assert family.verdict == IF_KICKED
        assert "no threshold" not in family.reason
        trials = Trials(contact, family.loudest.motion, family.threshold.motion, 4000)
        starts = [state_of(family.threshold.motion, factor) for factor in (0.9, 1.1)]
        assert trials.outcomes(starts) == [DECAYS, GROWS]


def cycle(multipliers, errors, status="ok"):
    found = Floquet(np.array([*multipliers, 1.0]), np.eye(2), np.array([*errors, 1e-6]), 1.0)
    levels = {"contact_velocity": 1.0, "torque_rms": 1.0}
    return Cycle(None, found, levels, np.zeros(0), 0.0, 0.0, 0.0, 2, 0.0, status)


@pytest.mark.parametrize(
    ("below", "told"),
    [
        ([], "not one cycle between them"),
        ([cycle([1.2, 0.5], [1e-3, 1e-3])] * 2, "not one cycle between them"),
        ([cycle([1.2, 0.5], [1e-3, 1e-3], "inaccurate")], "inaccurate"),
        ([cycle([1.2, 1.1], [1e-3, 1e-3])], "not just one unstable direction"),
        ([cycle([1.2, 0.99], [1e-3, 2e-2])], "not just one unstable direction"),
        ([cycle([1.2, 0.5], [1e-3, 1e-3])], ""),
    ],
)
def test_a_threshold_is_one_saddle(below, told):
    """Of a multiplier within its error of the circle nobody knows on which side it is."""
    stable = cycle([0.5, 0.4], [1e-3, 1e-3])
    family = Family(-1 + 10j, (*below, stable), 0, [], "far")
    found = _judged(family, False, False, Search(None, 1e-2, 1.0))
    assert found.verdict == IF_KICKED
    assert (found.threshold is None) == bool(told)
    assert told in found.reason
    lost = _judged(replace(family, lost=1), False, False, Search(None, 1e-2, 1.0))
    assert lost.threshold is None
    unstable = _judged(family, False, True, Search(None, 1e-2, 1.0))
    assert unstable.threshold is None
    assert "another mode is unstable" in unstable.reason


def test_where_none_was_found_the_reason_says_what_was_searched():
    found = _judged(Family(-1 + 10j, (), 0, [], "far"), False, False, Search(None, 1e-2, 1.5))
    assert found.verdict == NO_CYCLE
    assert "none on this mode's curve up to 1.5 m/s" in found.reason
    assert "a cycle apart from it is not excluded" in found.reason


def test_motions_that_come_to_a_standstill_are_no_cycles():
    """Hulten's model on springs so soft that it has other equilibria: the curve slows down."""
    values = models.HARDENING | {"contact.cubic_stiffness": -4.6e17}
    contact = models.Designs("hulten", values).at(friction=0.2)
    found = families(contact, (1.0, 1e6), [1], 1e-9, Search(5, 1e-2, 15.0))
    ((_, family),) = found.families
    assert family.end == STILL
    speed = contact.point.speed
    assert all(c.levels["contact_velocity"] > 1e-3 * speed for c in family.cycles)
    assert all(c.motion.omega > 0.1 * abs(family.lam) for c in family.cycles)


# -- kicks ----------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def belt():
    ((contact, family),) = with_thresholds("belt", 1)
    return contact, family


def crossings(contact, motion, lam, phi):
    """Sizes at which rays of a mode's states, one a phase, cross a cycle of the belt, in a plane.

    What is beyond it grows: the belt's mass moves along the belt alone.
    """
    theta = 2 * np.pi * np.arange(4096) / 4096
    synthesis, slope = series_at(theta, motion.harmonics)
    along = contact.system.T1[0]
    w = abs(lam)
    orbit = w * (synthesis @ motion.Q @ along) + 1j * motion.omega * (slope @ motion.Q @ along)
    x = (along @ phi) * np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
    rays = w * x.real + 1j * (lam * x).real
    radii = np.interp(np.angle(rays), *_sorted(np.angle(orbit), np.abs(orbit)), period=2 * np.pi)
    return radii / np.abs(rays)


def _sorted(angles, radii):
    order = np.argsort(angles)
    return angles[order], radii[order]


def test_the_least_kick_is_where_the_mode_crosses_the_unstable_cycle(belt):
    contact, family = belt
    lam, psi = linear_modes(contact)
    k = int(np.argmin(np.abs(lam - family.lam)))
    unit = PeriodicMotion(
        np.vstack([0 * psi[:, k].real, psi[:, k].real, -psi[:, k].imag]), lam[k].imag
    )
    phi = psi[:, k] / contact.contact_velocity(unit)
    exact = crossings(contact, family.threshold.motion, complex(lam[k]), phi)
    found = Followed([(1, family)], 0, False)
    (kick,) = kicks(contact, found, 10.0).values()
    assert kick.status == "ok"
    assert exact.min() <= kick.velocity <= 1.02 * exact.min() + 1e-3
    assert exact[round(kick.phase * PHASES / (2 * np.pi))] <= kick.velocity
    assert kick.error < 0.02
    assert 0.5 < kick.energy / family.threshold.levels["energy"] < 2.0
    # nothing is said of a design of which a mode is unstable
    assert kicks(contact, found._replace(unstable_outside=True), 10.0) == {}


def test_kicks_that_lead_nowhere_say_so(belt):
    contact, family = belt
    lam, psi = linear_modes(contact)
    mode = complex(lam[0]), psi[:, 0]
    stable, unstable = family.loudest.motion, family.threshold.motion
    least = contact.contact_velocity(unstable)
    assert kick_along_mode(Trials(contact, stable, unstable), *mode, 0.3 * least).status == "none"
    brief = kick_along_mode(Trials(contact, stable, unstable, 20), *mode, 0.9 * least)
    assert brief.status == "undecided"
    assert np.isnan([brief.velocity, brief.phase, brief.energy, brief.error]).all()
