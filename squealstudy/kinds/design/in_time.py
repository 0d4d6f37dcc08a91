"""Runs a design in time at one operating point: from today's vibrations, and from kicks.

A design whose small motions decay may vibrate from large ones. Complex modes cannot show that, and
a search for limit cycles may miss a cycle apart from its curves. So runs are made from several
starts: each decays, or it does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.trials import Ended, ended, run_on
from squealstudy.engine.cache import NewGaps, prepared_model
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import CyclesRequest
from squealstudy.motion.motion import Motion
from squealstudy.motion.point import contact_speed, perturbed
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.study.design import DesignPoint

START_VELOCITY_RATIO = 0.02  # start velocity over the sliding speed in the run of today's design
KICK_SCALES = (1.0, 0.25)  # sizes of kicks over the key `reach` of [limit_cycles]
MAX_KICKED_MODES = 4  # most modes along which there are kicks
RUN_CACHE_SIZE = 64  # vibrations of today's designs that are stored
TODAY = "today's vibration"
ELSEWHERE = f"{TODAY} of [parameters]"
TURN = 2 * np.pi


def runs_in_time(
    point: DesignPoint, today: Mapping[str, DesignPoint], request: CyclesRequest, gaps: NewGaps
) -> tuple[WorkingPoint, list[Ended]]:
    """Working point of a design at an operating point, and the outcomes of its runs.

    Kicks are along the modes nearest to those that grow or last in today's design, and along the
    modes of least damping, in the phase of largest velocity.

    Parameters
    ----------
    point : DesignPoint
    today : mapping of str -> DesignPoint
        Today's design at this and another operating point, by the name of its vibration. A
        vibration of another structure is transferred (`carried`).
    request : CyclesRequest
    gaps : NewGaps

    Raises
    ------
    ConvergenceError
        No steady sliding, a mode outside the band that grows, or a model too large.
    ParameterError
        A value that cannot be used.
    """
    steady, contact = request.contact(point, gaps)
    growing = contact.point.growing
    if growing.n_outside:  # every run would come to its vibration
        hz = growing.frequency_outside
        where = "above" if hz > request.band[1] / TURN else "below"
        text = f"a mode {where} the band grows by itself in time, at {hz:.4g} Hz"
        raise ConvergenceError("unstable_above_band", text)
    starts: list[tuple[str, MotionPoint]] = []
    lasting_hz: list[float] = []
    for name, design in today.items():
        vibrating = vibrations(_Today.of(design), request)
        lasting_hz += vibrating.near
        for how, q, v in vibrating.lasting:
            words, other = f"{name}{how}", design.structure != point.structure
            if other:
                norm_squared = v @ v
                q, v = carried(
                    np.column_stack([q, v]), design.structure, point.structure, request
                ).T
                share = 100 * float(v @ v / norm_squared)
                words += f", brought to this structure with {share:.0f} % of its kinetic energy"
            starts.append((words, replace(contact.point, q0=q, v0=v, continued=not other)))
    starts += _kicks(contact, lasting_hz, request)
    return steady, [ended for ended, _ in _runs(contact, starts, request)]


def _runs(
    contact: ContactOscillator, starts: Sequence[tuple[str, MotionPoint]], request: CyclesRequest
) -> list[tuple[Ended, Motion]]:
    """Outcomes and motions of runs from named starts."""
    names = [name for name, _ in starts]
    motions = run_on(contact, [start for _, start in starts], request.band)
    # where a start's displacement presses more than can be integrated, its velocity alone is used
    closed = [k for k, m in enumerate(motions) if m.outcome != "ok" and not starts[k][1].continued]
    pushed = [replace(starts[k][1], q0=np.zeros(contact.system.n)) for k in closed]
    for k, motion in zip(
        closed, run_on(contact, pushed, request.band) if closed else [], strict=True
    ):
        names[k], motions[k] = f"{names[k]}, by its velocity alone", motion
    return [(ended(name, motion), motion) for name, motion in zip(names, motions, strict=True)]


def carried(x: np.ndarray, old: str, new: str, request: CyclesRequest) -> np.ndarray:
    """Transfer vibrations of one structure to another: nearest at the places that correspond.

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
    phi, prepared = request.shared_modes(old).phi, prepared_model(old)
    sensor_motion = prepared.sensor_shapes @ (prepared.shape_rows @ (phi @ x))
    phi, prepared = request.shared_modes(new).phi, prepared_model(new)
    coefficients, *_ = la.lstsq(prepared.sensor_shapes, sensor_motion)
    coordinates: np.ndarray = phi.T @ (prepared.shape_basis @ coefficients)
    return coordinates


@dataclass(frozen=True)
class _Today:
    """Today's design, compared by all that its vibrations depend on."""

    point: DesignPoint = field(compare=False)
    identity: tuple[object, ...]

    @classmethod
    def of(cls, point: DesignPoint) -> _Today:
        described = (point.values, point.options)
        return cls(
            point,
            (point.structure, *(tuple(sorted(description.items())) for description in described)),
        )


class _Vibrations(NamedTuple):
    near: list[float]  # frequencies [Hz] of modes that grow or last
    lasting: list[tuple[str, np.ndarray, np.ndarray]]  # how each began, in words; q and q' (n,)


@lru_cache(maxsize=RUN_CACHE_SIZE)  # runs of many candidates begin with them
def vibrations(today: _Today, request: CyclesRequest) -> _Vibrations:
    """Vibrations of today's design after a small start, or after kicks if no mode grows.

    A kick that starts squeal in one design may not do so in a design of a little more damping that
    still has the cycle: only a run from the cycle itself shows whether it has.
    """
    _, was = request.contact(today.point, NewGaps())
    growing = was.point.growing
    unstable_hz = (np.abs(growing.lam[: growing.n_unstable]) / TURN).tolist()
    starts = [(f" after a {name}", start) for name, start in _kicks(was, (), request)]
    if growing.n_unstable:
        starts = [
            ("", perturbed(was.system, was.point, START_VELOCITY_RATIO * abs(was.point.speed)))
        ]
    lasting_runs = [run for run in _runs(was, starts, request) if run[0].goes_on]
    by_mode = {f"{ended.mode_hz:.3g}": (ended, motion) for ended, motion in reversed(lasting_runs)}
    unstable_hz += [ended.mode_hz for ended, _ in by_mode.values() if np.isfinite(ended.mode_hz)]
    return _Vibrations(unstable_hz, [(ended.start, m.q, m.v) for ended, m in by_mode.values()])


def _kicks(
    contact: ContactOscillator, unstable_hz: Sequence[float], request: CyclesRequest
) -> Iterator[tuple[str, MotionPoint]]:
    """Starts of runs by kicks along modes: unstable ones first, then least damped ones."""
    low, high = request.band
    lam, psi = contact.oscillator.steady_modes(high)
    inside = np.flatnonzero((np.abs(lam) >= low) & (np.abs(lam) <= high) & (lam.imag > 0))
    if not len(inside):
        return
    zeta, hz = -lam.real / np.abs(lam), np.abs(lam) / TURN
    mode_rows = [int(inside[np.argmin(np.abs(hz[inside] - f))]) for f in unstable_hz]
    mode_rows += [int(k) for k in inside[np.argsort(zeta[inside], kind="stable")]]
    largest = request.section.reach * abs(contact.point.speed)
    for k in list(dict.fromkeys(mode_rows))[:MAX_KICKED_MODES]:
        # at this phase the velocity is largest, and the displacement small
        x = psi[:, k] * np.exp(-0.5j * np.angle(np.sum((lam[k] * psi[:, k]) ** 2)))
        q, v = x.real, (lam[k] * x).real
        for share in KICK_SCALES:
            factor = share * largest / contact_speed(contact.system, v)
            name = f"kick of {share * largest:.3g} m/s along the mode at {hz[k]:.4g} Hz"
            yield name, replace(contact.point, q0=factor * q, v0=factor * v)
