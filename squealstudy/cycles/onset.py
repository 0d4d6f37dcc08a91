"""The criticality of an onset: small stable cycles beyond it, or unstable ones before it."""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.growth import linear_motion
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.projection import CYCLE_BASIS_ERROR, SIZE_HELD, Projection
from squealstudy.errors import ConvergenceError

SUPERCRITICAL, SUBCRITICAL = "supercritical", "subcritical"
HARMONICS = 3
VELOCITIES = (0.01, 0.02, 0.04)  # contact velocities over the sliding speed
SMALLER = (1.0, 0.1, 0.01)  # factors on these: smaller ones are tried where the signs disagree
MIN_REL_DAMPING_CHANGE = 1e-9  # least change of added damping over omega that is not round-off


def criticality(contact: ContactOscillator, lam: complex, phi: np.ndarray) -> str:
    """How cycles begin where a mode is neutral, by the sign of d xi/d(a^2) at a -> 0.

    ``subcritical`` where the added damping rises with the size of small motions, ``supercritical``
    where it falls. Empty where the sizes tried do not agree or nothing changes, as with forces that
    are linear about steady sliding.

    Parameters
    ----------
    contact : ContactOscillator
        The design at the onset.
    lam : complex
        Its neutral root, rad/s.
    phi : ndarray (n,) complex
        Right vector of that root.
    """
    projection = Projection(contact.oscillator, phi, lam.imag)
    for smaller in SMALLER:
        xi = [_added(contact, projection, lam, phi, smaller * v) for v in VELOCITIES]
        changes = np.diff(xi)
        if (changes > MIN_REL_DAMPING_CHANGE * lam.imag).all():
            return SUBCRITICAL
        if (changes < -MIN_REL_DAMPING_CHANGE * lam.imag).all():
            return SUPERCRITICAL
    return ""


def _added(
    contact: ContactOscillator, projection: Projection, lam: complex, phi: np.ndarray, share: float
) -> float:
    """Added damping [1/s] of the motion with a contact velocity of `share` times the sliding speed.

    NaN where no such motion is found.
    """
    velocity = contact.contact_velocity(linear_motion(phi, lam, projection.weight, 1.0))
    size = share * abs(contact.point.speed) / velocity
    motion = linear_motion(phi, lam, projection.weight, size)
    motion = PeriodicMotion(with_harmonics(motion.Q, HARMONICS), motion.omega, motion.parameter)
    try:
        motion, _, _ = projection.improve(motion, CYCLE_BASIS_ERROR, SIZE_HELD)
    except ConvergenceError:
        return np.nan
    return motion.parameter + projection.correction(motion).parameter
