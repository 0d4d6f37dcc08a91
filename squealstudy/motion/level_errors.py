"""Doubts about the levels of a run that came to its end, and their errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from squealstudy.motion.integrator import KernelIntegrator
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.energies import energy_round_off
from squealstudy.motion.outcome.growth import LEFT_VECTOR, median_of
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.system import ModalSystem, MotionPoint, stick_number
from squealstudy.wording import ENERGY_RULE

N_BALANCE_BLOCKS = 10  # parts of a run; inside an impact the balance is off and comes back
# of the energy of the vibration, from nowhere in the last row: no impact does so
MAX_LAST_ROW_ENERGY_JUMP = 0.5
ENERGY_BALANCE_ROUND_OFF = 1e-9  # of the work of friction and of the energy that is stored
# stick number beyond which a stuck contact rings at the step: levels of a belt (.3 to
# 1.1 m/s, kicked by 4, steps of 5e-5 to 4e-4 s) err by .8 % at 26, 3 % at 52 and 12 % at 210
MAX_STICK_NUMBER = 30.0
MIN_STICK_SHARE = 0.5  # share of the contact area that sticks at a time
# Hoffmann's oscillator, friction 0.78 and 1 % damping, grows by 83, 11, 2.6 and 0.03 %
# too slowly at 9, 22, 45 and 450 steps a period
# steps a period of the fastest mode: never enough, always
TOO_FEW_STEPS_PER_PERIOD, ENOUGH_STEPS_PER_PERIOD = 12.0, 60.0
GROWTH_APART = 0.05  # of fitted and predicted growth of small motions
DAMPING_APART = 5e-4  # and as damping ratios
STORAGE_LIMIT = 1e-3  # relative change of contact forces: what a step's imbalance may be


def doubts(
    motion: Motion, system: ModalSystem, settings: MotionSettings, finding: Mapping[str, Any]
) -> dict[str, str]:
    """Rules that a run breaks, and what that may do to its levels.

    Parameters
    ----------
    motion : Motion
    system : ModalSystem
    settings : MotionSettings
        By which it was integrated.
    finding : mapping
        Columns of its row: stuck share of the contact, fitted and predicted growth.
    """
    limit, step = settings.integrator.drift_limit, settings.step
    sticks = finding.get("stick_share_max", 0.0)
    said = {
        "the step resolves stuck friction": _ringing(
            stick_number(system, motion.point, step) if sticks >= MIN_STICK_SHARE else 0.0,
            sticks,
            step,
        ),
        "the step resolves the fastest mode": _coarse(finding, step),
        ENERGY_RULE: _drifting(energy_drift(motion), step, limit),
        "the storage resolves contact pressures": _rounded(motion, system, settings),
    }
    return {rule: text for rule, text in said.items() if text}


def _ringing(number: float, sticks: float, step: float) -> str:
    """The trapezoidal rule does not damp the friction of stuck points at a long step."""
    if number <= MAX_STICK_NUMBER:
        return ""
    return (
        f"{100 * sticks:.0f} % of the contact sticks while h k_t |T|^2 / 2 is {number:.3g}: "
        "friction rings and levels may err by more than 1 %, which a step of "
        f"{step * MAX_STICK_NUMBER / number:.2g} s avoids"
    )


def _coarse(finding: Mapping[str, Any], step: float) -> str:
    """A step that is long beside a period shifts what couples modes, and so their growth."""
    hz, predicted = finding["predicted_frequency_hz"], finding["predicted_growth_rate"]
    steps = 1.0 / (step * hz) if hz > 0 else np.inf
    if not steps < ENOUGH_STEPS_PER_PERIOD:
        return ""
    difference_text, fitted = "", finding.get("growth_rate", np.nan)
    if finding.get("growth_method") == LEFT_VECTOR:
        unsure = finding["growth_rate_high"] - finding["growth_rate_low"]
        step_part = finding.get("growth_rate_step_error", np.nan)
        unsure -= 2 * abs(step_part) if np.isfinite(step_part) else 0.0
        allowed = max(GROWTH_APART * abs(predicted), DAMPING_APART * 2 * np.pi * hz) + unsure
        if abs(fitted - predicted) > allowed:
            difference_text = (
                f" and small motions grow by {fitted:.4g} instead of {predicted:.4g} 1/s"
            )
    if steps >= TOO_FEW_STEPS_PER_PERIOD and not difference_text:
        return ""
    return (
        f"a period of the mode at {hz:.4g} Hz has {steps:.2g} steps{difference_text}: growth "
        "and levels may be wrong, which a step of "
        f"{1 / (ENOUGH_STEPS_PER_PERIOD * hz):.2g} s would show"
    )


def _drifting(drift: float, step: float, limit: float) -> str:
    """Energy from nowhere, as methods of a fixed step make it in impacts at a long step."""
    if not drift > limit:
        return ""
    return (
        f"the energy balance is off by {100 * drift:.2g} % of the energy of the vibration: levels "
        f"may be wrong, which a step of {step / 2:.2g} s would show"
    )


def _rounded(motion: Motion, system: ModalSystem, settings: MotionSettings) -> str:
    """Contact forces that single-precision storage may have changed."""
    method, energy = settings.integrator, motion.modal_energy
    stored = isinstance(method, KernelIntegrator) and method.single_storage
    if not stored or not len(energy):
        return ""
    number = storage_number(system, motion.point, float(energy.max()))
    if number <= STORAGE_LIMIT:
        return ""
    return (
        f"storage in single precision may change contact pressures by {100 * number:.2g} %, which "
        'storage = "double" does not'
    )


def energy_drift(motion: Motion) -> float:
    """Largest imbalance of energy over a run, relative to the energy of its vibration.

    The balance at the end is one against the work of friction, which steady sliding does as well:
    energies from nowhere cancel by chance, and as much as the whole vibration may be a thousandth
    of that work. Here the imbalance is followed over the run: the medians of ten parts of the
    history are compared with the start, and the last row where it is most of the energy, a run
    that explodes at its end. The vibration's energy is its largest modal energy and what damping
    took from it, or gave. NaN for a history shorter than ten rows.
    """
    h = motion.history
    if len(h["time"]) < N_BALANCE_BLOCKS:
        return float("nan")
    work = h["work_load"] + h["work_belt"] - h["dissipated_friction"] - h["dissipated_damping"]
    imbalance = work - (h["stored"] - h["stored"][0])
    medians = [median_of(part) for part in np.array_split(imbalance, N_BALANCE_BLOCKS)]
    size = h["modal_energy"].max() + abs(h["dissipated_damping"][-1])
    size += ENERGY_BALANCE_ROUND_OFF * (
        abs(h["dissipated_friction"][-1]) + float(np.abs(h["stored"]).max())
    )
    if not size > 0.0 or motion.modal_energy.max() <= energy_round_off(motion):
        return 0.0
    last = abs(float(imbalance[-1])) / float(size)
    drift = max(abs(m) for m in medians) / float(size)
    return max(drift, last) if last > MAX_LAST_ROW_ENERGY_JUMP else drift


def storage_number(system: ModalSystem, design: MotionPoint, energy: float) -> float:
    """Largest relative change of a contact pressure by storage in single precision; a bound.

    The entries of N change by dN, known exactly, and a motion of energy E has no larger change of
    gap than |dN / omega| sqrt(2 E) (Cauchy and Schwarz). Modes without stiffness are left out:
    their displacement has no bound.

    Parameters
    ----------
    system : ModalSystem
    design : MotionPoint
    energy : float
        Largest modal energy of the motion, J.
    """
    elastic = system.omega2 > 0
    rounded = system.N.astype(np.float32).astype(float) - system.N
    share = rounded[:, elastic] / np.sqrt(system.omega2[elastic])
    change = np.linalg.norm(share, axis=1) * np.sqrt(2 * max(energy, 0.0))
    gap, _ = design.base(system)
    change = change[system.touching]
    pressure, _ = design.contact.evaluate(gap[system.touching])
    scale = np.array([design.contact.gap_scale(max(float(p), 0.0)) for p in pressure])
    closed = pressure > 0
    with np.errstate(over="ignore"):
        return float(np.expm1((change / scale)[closed]).max(initial=0.0))
