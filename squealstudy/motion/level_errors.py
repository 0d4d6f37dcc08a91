"""Checks that warn where the levels of a run in time may be wrong, although it reached its end."""

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

# number of parts of a run whose median imbalance is taken: an impact disturbs the energy balance
# only for a moment
N_BALANCE_BLOCKS = 10
# an imbalance in the last row above this share of the energy of the vibration is not that of an
# impact
MAX_LAST_ROW_ENERGY_JUMP = 0.5
ENERGY_BALANCE_ROUND_OFF = 1e-9  # over the work of friction and the stored energy
# stick number beyond which a stuck contact rings at the step: levels of a belt (.3 to
# 1.1 m/s, kicked by 4, steps of 5e-5 to 4e-4 s) err by .8 % at 26, 3 % at 52 and 12 % at 210
MAX_STICK_NUMBER = 30.0
MIN_STICK_SHARE = 0.5  # the stick number is checked if this share of the area sticks at once
# numbers of steps in a period of the fastest mode: fewer than the first are too few in all cases,
# more than the second are enough in all cases.
# Hoffmann's oscillator, friction 0.78 and 1 % damping, grows by 83, 11, 2.6 and 0.03 % too slowly
# at 9, 22, 45 and 450 steps
TOO_FEW_STEPS_PER_PERIOD, ENOUGH_STEPS_PER_PERIOD = 12.0, 60.0
# accepted differences of fitted and predicted growth: relative, and as a damping ratio
MAX_REL_GROWTH_DIFFERENCE, MAX_DAMPING_DIFFERENCE = 0.05, 5e-4
# accepted relative change of contact forces by storage; the iteration of a step leaves as much
MAX_STORAGE_CHANGE = 1e-3


def doubts(
    motion: Motion, system: ModalSystem, settings: MotionSettings, finding: Mapping[str, Any]
) -> dict[str, str]:
    """Rules of validity that a run breaks, each with a text on how its levels may be wrong.

    Parameters
    ----------
    motion : Motion
        The run.
    system : ModalSystem
        Model of the run.
    settings : MotionSettings
        Settings of the run.
    finding : mapping
        Columns of its row: stuck share of the contact, fitted and predicted growth.
    """
    limit, step = settings.integrator.drift_limit, settings.step
    sticks = finding.get("stick_share_max", 0.0)
    texts = {
        "the step resolves stuck friction": _ringing(
            stick_number(system, motion.point, step) if sticks >= MIN_STICK_SHARE else 0.0,
            sticks,
            step,
        ),
        "the step resolves the fastest mode": _coarse(finding, step),
        ENERGY_RULE: _drifting(energy_drift(motion), step, limit),
        "the storage resolves contact pressures": _rounded(motion, system, settings),
    }
    return {rule: text for rule, text in texts.items() if text}


def _ringing(number: float, sticks: float, step: float) -> str:
    """Text on friction of stuck points that rings, which the trapezoidal rule does not damp."""
    if number <= MAX_STICK_NUMBER:
        return ""
    return (
        f"{100 * sticks:.0f} % of the contact sticks while h k_t |T|^2 / 2 is {number:.3g}: "
        "friction rings and levels may err by more than 1 %, which a step of "
        f"{step * MAX_STICK_NUMBER / number:.2g} s avoids"
    )


def _coarse(finding: Mapping[str, Any], step: float) -> str:
    """Text on a step that is long beside a period, which changes the growth of coupled modes."""
    hz, predicted = finding["predicted_frequency_hz"], finding["predicted_growth_rate"]
    steps = 1.0 / (step * hz) if hz > 0 else np.inf
    if not steps < ENOUGH_STEPS_PER_PERIOD:
        return ""
    difference_text, fitted = "", finding.get("growth_rate", np.nan)
    if finding.get("growth_method") == LEFT_VECTOR:
        unsure = finding["growth_rate_high"] - finding["growth_rate_low"]
        step_part = finding.get("growth_rate_step_error", np.nan)
        unsure -= 2 * abs(step_part) if np.isfinite(step_part) else 0.0
        allowed = (
            max(MAX_REL_GROWTH_DIFFERENCE * abs(predicted), MAX_DAMPING_DIFFERENCE * 2 * np.pi * hz)
            + unsure
        )
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
    """Text on an imbalance of energy, as methods of a fixed step have in impacts."""
    if not drift > limit:
        return ""
    return (
        f"the energy balance is off by {100 * drift:.2g} % of the energy of the vibration: levels "
        f"may be wrong, which a step of {step / 2:.2g} s would show"
    )


def _rounded(motion: Motion, system: ModalSystem, settings: MotionSettings) -> str:
    """Text on contact forces that storage in single precision may have changed."""
    method, energy = settings.integrator, motion.modal_energy
    stored = isinstance(method, KernelIntegrator) and method.single_storage
    if not stored or not len(energy):
        return ""
    number = storage_number(system, motion.point, float(energy.max()))
    if number <= MAX_STORAGE_CHANGE:
        return ""
    return (
        f"storage in single precision may change contact pressures by {100 * number:.2g} %, which "
        'storage = "double" does not'
    )


def energy_drift(motion: Motion) -> float:
    """Largest imbalance of energy over a run, relative to the energy of its vibration.

    The balance at the end of a run does not show whether levels are right. Imbalances may have
    cancelled, and that balance is relative to the work of friction. Steady sliding does most of the
    work; the energy of the vibration may be a thousandth of it. So the imbalance is followed over
    the run. The result is the largest of the
    medians of ten parts of the history. The last row counts, too, where its imbalance is most of
    the energy, as in a run that explodes at its end. The vibration's energy is its largest modal
    energy plus the energy that damping took or gave. NaN for a history shorter than ten rows.
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
    """Bound of the relative change of contact pressures by storage in single precision.

    Rounding changes the entries of N by a known dN. In a motion of energy E a gap then changes by
    at most |dN / omega| sqrt(2 E) (Cauchy and Schwarz). Modes without stiffness are left out: their
    displacement has no bound.

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
