"""A design in time at one operating point: from today's vibrations, and kicked.

Complex modes cannot tell that a design which decays from small motions lasts from large ones, and
what is found of limit cycles may leave out a cycle apart. Each start here is a run: it decays, or
it does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.growth import linear_modes
from squealstudy.cycles.trials import Ended, ended, run_on
from squealstudy.engine.cache import NewGaps, prepared_model
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import CyclesRequest
from squealstudy.motion.motion import Motion
from squealstudy.motion.point import contact_speed, perturbed
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.wording import FAILED, STABLE

LEAD = 0.02  # of the sliding speed: where the run of today's design begins
SIZES = (1.0, 0.25)  # of kicks, of the reach of [limit_cycles]
KICKED = 4  # modes
TODAY = "today's vibration"
ELSEWHERE = f"{TODAY} of [parameters]"
TURN = 2 * np.pi


def runs_in_time(
    point: DesignPoint, today: Mapping[str, DesignPoint], asked: CyclesRequest, gaps: NewGaps
) -> tuple[WorkingPoint, list[Ended]]:
    """A design at an operating point, from every start.

    Kicks are along the complex modes of least damping, and along those near the ones that grow in
    today's design, in the phase of largest velocity.

    Parameters
    ----------
    point : DesignPoint
    today : mapping of str -> DesignPoint
        Today's design there and elsewhere, by what its vibration is called. That of another
        structure is brought over (`carried`).

    Raises
    ------
    ConvergenceError
        No steady sliding, a mode above the band that grows, or a model too large; ParameterError
        for a value that cannot be used.
    """
    steady, contact = asked.contact(point, gaps)
    growing = contact.point.growing
    if growing.n_above:  # every run comes to it, whatever is asked about
        text = f"a mode above the band grows by itself in time, at {growing.frequency_above:.4g} Hz"
        raise ConvergenceError("unstable_above_band", text)
    names, starts, near = [], [], []
    for name, design in today.items():
        _, was = asked.contact(design, gaps)
        near += (np.abs(was.point.growing.lam[: was.point.growing.n_unstable]) / TURN).tolist()
        motion = _today(was, asked)
        if motion is None:
            continue
        q, v, other = motion.q, motion.v, design.structure != point.structure
        if other:
            q, v = carried(np.column_stack([q, v]), design.structure, point.structure, asked).T
            kept = float(v @ v / (motion.v @ motion.v))
            name += f", brought to this structure with {100 * kept:.0f} % of its kinetic energy"
        names.append(name)
        starts.append(replace(contact.point, q0=q, v0=v, continued=not other))
    for name, start in _kicks(contact, near, asked):
        names.append(name)
        starts.append(start)
    motions = run_on(contact, starts, asked.band)
    # a start whose displacement presses more than can be integrated: its velocity alone
    closed = [k for k, m in enumerate(motions) if m.outcome != "ok" and not starts[k].continued]
    pushed = [replace(starts[k], q0=np.zeros_like(starts[k].v0)) for k in closed]
    for k, motion in zip(
        closed, run_on(contact, pushed, asked.band) if closed else [], strict=True
    ):
        names[k], motions[k] = f"{names[k]}, by its velocity alone", motion
    return steady, [ended(*one) for one in zip(names, motions, strict=True)]


def carried(x: np.ndarray, old: str, new: str, asked: CyclesRequest) -> np.ndarray:
    """Vibrations of one structure as those of another: nearest at the places that correspond.

    Parameters
    ----------
    x : ndarray (n, k)
        Modal coordinates of the old structure.
    old, new : str
        Keys of the prepared models.

    Returns
    -------
    ndarray (n', k)
        Modal coordinates of the new one, by least squares over `PreparedModel.sensor_shapes`.
    """
    phi, known = asked.reference(old).phi, prepared_model(old)
    seen = known.sensor_shapes @ (known.shape_rows @ (phi @ x))
    phi, known = asked.reference(new).phi, prepared_model(new)
    found, *_ = la.lstsq(known.sensor_shapes, seen)
    coordinates: np.ndarray = phi.T @ (known.shape_basis @ found)
    return coordinates


def _today(was: ContactOscillator, asked: CyclesRequest) -> Motion | None:
    """Today's design where a small start has led it; None where that decays or fails."""
    if not was.point.growing.n_unstable:
        return None
    start = perturbed(was.system, was.point, LEAD * abs(was.point.speed))
    (motion,) = run_on(was, [start], asked.band)
    return None if ended("", motion).found in (STABLE, FAILED) else motion


def _kicks(
    contact: ContactOscillator, near: Sequence[float], asked: CyclesRequest
) -> Iterator[tuple[str, MotionPoint]]:
    low, high = asked.band
    lam, psi = linear_modes(contact, high)
    inside = np.flatnonzero((np.abs(lam) >= low) & (np.abs(lam) <= high) & (lam.imag > 0))
    if not len(inside):
        return
    zeta, hz = -lam.real / np.abs(lam), np.abs(lam) / TURN
    wanted = [int(inside[np.argmin(np.abs(hz[inside] - f))]) for f in near]
    wanted += [int(k) for k in inside[np.argsort(zeta[inside], kind="stable")]]
    largest = asked.section.reach * abs(contact.point.speed)
    for k in list(dict.fromkeys(wanted))[:KICKED]:
        # the phase at which the velocity is largest: the displacement is then small
        x = psi[:, k] * np.exp(-0.5j * np.angle(np.sum((lam[k] * psi[:, k]) ** 2)))
        q, v = x.real, (lam[k] * x).real
        for share in SIZES:
            factor = share * largest / contact_speed(contact.system, v)
            name = f"kick of {share * largest:.3g} m/s along the mode at {hz[k]:.4g} Hz"
            yield name, replace(contact.point, q0=factor * q, v0=factor * v)
