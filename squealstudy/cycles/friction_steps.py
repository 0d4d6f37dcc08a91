"""Steps of runs in time that meet the fall of friction where slip begins.

A point that breaks loose is driven by what friction falls by. Where that takes it through the fall
within a part of a period of its modes, steps of such periods jump over it, and the cycle with it.
"""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES

STEPS_PER_FALL = 5  # steps in the time in which friction falls
# sliding speeds over the imposed one, at which the curve is evaluated
SPEEDS = np.geomspace(1e-6, 1.0, 61)
# of the speed over which friction falls: a corner so wide takes from the fall
MAX_CORNER_SHARE = 0.01


def longest_step(contact: ContactOscillator) -> float:
    """Step [s] that meets the fall of friction; infinite where it does not fall.

    Of models of few coordinates: a point of a mesh has little of the force, and modes that no
    study is about.
    """
    fall, speed = _falls(contact)
    falls = fall > 0.0
    if not falls.any():
        return np.inf
    system = contact.system
    force = np.abs(contact.point.base(system)[1][:, 0])
    acceleration = fall * force * (system.T1**2).sum(axis=1)  # m/s2
    moves = falls & (acceleration > 0.0)
    return float((speed[moves] / acceleration[moves]).min(initial=np.inf)) / STEPS_PER_FALL


def rounds_off(contact: ContactOscillator) -> bool:
    """Whether the corner of friction at zero sliding is so wide that it takes from its fall."""
    fall, speed = _falls(contact)
    friction, system = contact.point.friction, contact.system
    pressure = np.abs(contact.point.base(system)[1][:, 0]) / system.area
    sticks = friction.friction * pressure / friction.k_t  # m/s, below which a point sticks
    return bool(((fall > 0.0) & (sticks > MAX_CORNER_SHARE * speed)).any())


def _falls(contact: ContactOscillator) -> tuple[np.ndarray, np.ndarray]:
    """Fall of friction of each point up to the imposed speed, and over which speed [m/s].

    Zeros for models of many coordinates.
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
