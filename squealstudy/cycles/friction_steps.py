"""Time steps of runs that are short enough for the fall of friction where slip begins.

A contact point that breaks loose is driven by the force that friction loses. It may slide through
the speeds over which friction falls within a small part of its modes' periods. Steps that are made
for these periods jump over the fall, and miss the cycle.
"""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES

STEPS_PER_FALL = 5  # steps in the time in which friction falls
# sliding speeds at which the friction curve is evaluated, over the imposed speed
SPEEDS = np.geomspace(1e-6, 1.0, 61)
# a corner at zero sliding changes the fall of friction if it is wider than this share of the speed
# in which friction falls
MAX_CORNER_SHARE = 0.01


def longest_step(contact: ContactOscillator) -> float:
    """Longest step [s] for the fall of friction; infinite where friction does not fall.

    It is infinite for models of many coordinates, too: a point of a mesh has little of the force,
    and is moved by modes far above those of a study.
    """
    fall, speed = _falls(contact)
    has_fall = fall > 0.0
    if not has_fall.any():
        return np.inf
    system = contact.system
    force = np.abs(contact.point.base(system)[1][:, 0])
    acceleration = fall * force * (system.T1**2).sum(axis=1)  # m/s2
    moves = has_fall & (acceleration > 0.0)
    return float((speed[moves] / acceleration[moves]).min(initial=np.inf)) / STEPS_PER_FALL


def rounds_off(contact: ContactOscillator) -> bool:
    """Whether the rounded corner of friction at zero sliding is wide enough to change its fall."""
    fall, speed = _falls(contact)
    friction, system = contact.point.friction, contact.system
    pressure = np.abs(contact.point.base(system)[1][:, 0]) / system.area
    max_stick_speed = friction.friction * pressure / friction.k_t  # m/s, below which a point sticks
    return bool(((fall > 0.0) & (max_stick_speed > MAX_CORNER_SHARE * speed)).any())


def _falls(contact: ContactOscillator) -> tuple[np.ndarray, np.ndarray]:
    """Fall (nc,) of the friction coefficient up to the imposed speed, and the speed [m/s] it takes.

    The speed is the fall over the steepest slope. Both are zeros for models of many coordinates.
    """
    system, point = contact.system, contact.point
    none = np.zeros(len(system.area))
    curve, imposed = point.friction.curve, abs(point.speed)
    if system.n > MAX_UNPROJECTED_COORDINATES or curve.constant or imposed == 0.0:
        return none, none
    pressure = np.abs(point.base(system)[1][:, 0]) / system.area
    friction_at = [curve.at(point.friction.friction, none + s * imposed, pressure) for s in SPEEDS]
    mu, slope = (np.array([none + f[k] for f in friction_at]) for k in (0, 1))
    steepest = np.maximum(-slope.min(axis=0), 0.0)
    fall = np.where(steepest > 0.0, np.ptp(mu, axis=0), 0.0)
    return fall, np.divide(fall, steepest, out=none, where=steepest > 0.0)
