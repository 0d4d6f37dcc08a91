"""Searches the limit cycles of a design along the mode families of its complex modes.

A mode family consists of the periodic motions that continue a complex mode to larger amplitudes,
each with the damping that must be added to make it periodic. Where no damping need be added there
is a cycle.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import scipy.linalg as la

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.cycle import HARMONIC_COUNTS, Cycle, Search, cycle_near, same_cycle
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.growth import (
    DAMPED,
    FAR,
    ZERO,
    family_curve,
    found_again,
    holds_here,
    linear_motion,
    looked_again,
    without_noise,
)
from squealstudy.cycles.harmonics import with_harmonics
from squealstudy.cycles.oscillator import MAX_UNPROJECTED_COORDINATES
from squealstudy.cycles.projection import CURVE_BASIS_ERROR, SIZE_HELD, Projection
from squealstudy.cycles.verdicts import (
    GIVE_UP_DAMPING_RATIO,
    NOT_FOLLOWED,
    SEARCHED_ENDS,
    Family,
    Followed,
    alone,
    judged,
)
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.overflow import OVERFLOW
from squealstudy.wording import NO_CYCLE

N_LARGER_HARMONIC_COUNTS = 2  # a curve is checked with this many larger numbers of harmonics
CURVE_HARMONICS, PROJECTED_HARMONICS = 5, 3  # harmonics of curves: small models, projected ones
# modes of two designs are the same if their MAC is above the first number, and the MAC of either
# with any other mode is below the second
SAME_MODE_MIN_MAC, OTHER_MODE_MAX_MAC = 0.95, 0.8
START = 1e-3  # contact velocity over the sliding speed at which a curve begins
# largest relative difference of the added damping of a curve's first motion from the linear mode's
MAX_REL_START_CHANGE = 0.2
N_SMALLER_STARTS = 3  # smaller first motions, each a tenth, that are tried for a more linear one
EIGENVALUE_REL_ROUND_OFF = 1e-13  # round-off of every root of a dense matrix, over the largest one
LOST_ROOT = (
    "roots of the model lie too far apart: whether steady sliding diverges is less than the "
    "round-off of the largest"
)
DAMPING_ROUND_OFF = 1e-10  # damping ratio that round-off of harmonic balance can make
CURVE_STEPS = Steps(first=0.3, largest=0.5, count=200)
PROJECTED_STEPS = Steps(first=0.5, least=1e-4, largest=1.0, count=130)


def families(
    contact: ContactOscillator,
    band: tuple[float, float],
    mode_numbers: Sequence[int] | None,
    tolerance: float,
    search: Search,
    screen: float = np.inf,
    near: Followed | None = None,
) -> Followed:
    """Follow the family of each mode of a band, and judge by its cycles whether the mode squeals.

    Parameters
    ----------
    contact : ContactOscillator
    band : (low, high)
        Angular frequencies, rad/s.
    mode_numbers : sequence of int or None
        Numbers of modes, from 1 by frequency in the band; None for all.
    tolerance : float
        A mode is unstable where the real part of its root is more than this times its modulus.
    search : Search
    screen : float
        Rate of decay [1/s]: if `mode_numbers` is None, modes that decay faster are left out.
    near : Followed or None
        The families of a similar design, in the same coordinates. In a large model, its silent
        curves save following the curves of the same modes of this design. They are not used if
        fewer families grow in this design than in that one.

    Raises
    ------
    ConvergenceError
        Steady sliding that diverges without oscillation (``diverges``), or whose growth is within
        the round-off of the largest root (``overflow``); a mode number that the band does not have
        (``no_mode``).
    """
    lam, psi = contact.oscillator.steady_modes(band[1])
    unstable = lam.real > tolerance * np.abs(lam)
    real = lam.real[unstable & (lam.imag == 0)]
    if len(real) and real.max() <= EIGENVALUE_REL_ROUND_OFF * np.abs(lam).max():
        raise ConvergenceError(OVERFLOW, LOST_ROOT)
    if len(real):
        raise ConvergenceError("diverges", "steady sliding diverges without oscillation")
    any_unstable = bool(unstable.any()) or contact.point.growing.n_outside > 0
    inside = (lam.imag > 0) & (np.abs(lam) >= band[0]) & (np.abs(lam) <= band[1])
    band_rows = np.flatnonzero(inside)
    slow_numbers = 1 + np.flatnonzero(lam[band_rows].real > -screen)
    numbers = slow_numbers.tolist() if mode_numbers is None else list(mode_numbers)
    if max(numbers, default=0) > len(band_rows):
        count = len(band_rows)
        text = f"mode {max(numbers)} of {count} modes in the band: 'families' names them by number"
        raise ConvergenceError("no_mode", text)

    silent = _silent(near, contact, psi[:, band_rows], unstable[band_rows])
    followed_families: dict[int, Family] = {}
    modes = {n: (complex(lam[k]), psi[:, k]) for n, k in enumerate(band_rows, start=1)}
    for number in numbers:
        silent_family = silent.get(number)
        served = silent_family and _silent_nearby(contact, *modes[number], search, silent_family)
        followed_families[number] = served or _family(contact, *modes[number], search, tolerance)
    if near is not None and sum(f.grew for f in followed_families.values()) < near.n_growing:
        # a mode that grew in the other design may continue as one whose curve is silent there
        for number in [n for n, f in followed_families.items() if f.origin]:
            followed_families[number] = _family(contact, *modes[number], search, tolerance)
    judged_families = []
    for number, k in enumerate(band_rows, start=1):
        family = followed_families.get(number, Family(complex(lam[k]), (), 0, [], NOT_FOLLOWED))
        if number in followed_families or unstable[k]:
            judged_families.append((number, judged(family, bool(unstable[k]), any_unstable)))
    families_alone = [
        (number, alone(number, family, judged_families)) for number, family in judged_families
    ]
    outside = any_unstable and not unstable[band_rows].any()
    return Followed(
        families_alone, len(band_rows) - len(followed_families), outside, psi[:, band_rows]
    )


def _silent(
    near: Followed | None, contact: ContactOscillator, psi: np.ndarray, unstable: np.ndarray
) -> dict[int, Family]:
    """Families without cycles of the similar design `near`, by the numbers of this design's modes.

    `psi` (n, m) are the modes of this design, `unstable` (m,) tells which are unstable: they get
    none. Two modes are the same if their MAC is high, and low between either and any other mode.
    """
    if near is None or not near.modes.size or contact.oscillator.n <= MAX_UNPROJECTED_COORDINATES:
        return {}
    modes_here, modes_near = (x / la.norm(x, axis=0) for x in (psi, near.modes))
    mac = np.abs(modes_here.conj().T @ modes_near) ** 2
    silent = {}
    for number, family in near.families:
        k = int(np.argmax(mac[:, number - 1]))
        others = np.append(np.delete(mac[:, number - 1], k), np.delete(mac[k], number - 1))
        same = (
            mac[k, number - 1] > SAME_MODE_MIN_MAC and others.max(initial=0.0) < OTHER_MODE_MAX_MAC
        )
        if same and family.verdict == NO_CYCLE and not unstable[k]:
            silent[k + 1] = replace(family, origin=family.origin or near.name)
    return silent


def _silent_nearby(
    contact: ContactOscillator, lam: complex, phi: np.ndarray, search: Search, near: Family
) -> Family | None:
    """The family of a mode by the silent curve of a similar design, which saves following its own.

    The motions of the curve that are nearest to growing are balanced anew, at this design and with
    more harmonics. The added damping of the other motions may change as much as that of these: they
    stay silent if they lack far more (`looked_again`). None where this cannot be decided.
    """
    first = near.path[0].motion
    if near.end == FAR and near.reached < search.reach:
        return None
    if not holds_here(contact.oscillator, near.path):
        return None
    scale = np.sqrt(np.abs(np.diag(contact.oscillator.K)) + lam.imag**2)
    start = linear_motion(phi, lam, scale, la.norm(scale * first.Q[[1, first.harmonics + 1]]))
    change_of_damping = abs(start.parameter - first.parameter)
    look = looked_again(
        contact.oscillator, near.path, _larger_harmonic_counts(first.harmonics), change_of_damping
    )
    if look.open or not look.checked:
        return None
    shown = [CurveMotion(start, 0.0, 0.0), *sorted(look.motions, key=lambda p: p.motion.size)]
    return Family(
        lam,
        (),
        0,
        _curve_rows(contact, shown),
        near.end,
        look,
        path=near.path,
        origin=near.origin,
        furthest=near.reached,
    )


def _family(
    contact: ContactOscillator,
    lam: complex,
    phi: np.ndarray,
    search: Search,
    tolerance: float,
) -> Family:
    """Follow the family of one mode over amplitude, and solve the cycles at zeros of its curve."""
    speed = abs(contact.point.speed)
    unit = PeriodicMotion(np.vstack([0 * phi.real, phi.real, -phi.imag]), abs(lam.imag))
    velocity = contact.contact_velocity(unit)
    scale = np.sqrt(np.abs(np.diag(contact.oscillator.K)) + lam.imag**2)
    if velocity <= 0.0:
        return Family(lam, (), 0, [], "no_contact_motion")
    projection = Projection(contact.oscillator, phi, lam.imag)
    is_complete = projection.complete
    size = START * speed * float(np.linalg.norm(phi * scale)) / velocity
    harmonics = search.harmonics or (CURVE_HARMONICS if is_complete else PROJECTED_HARMONICS)
    noise = 2.0 * max(tolerance, DAMPING_ROUND_OFF) * abs(lam)
    start = linear_motion(phi, lam, scale, size)
    if is_complete:
        start = _small_enough(projection, start, harmonics, noise)

    def stop(motion: PeriodicMotion) -> str:
        if contact.contact_velocity(motion) > search.reach:
            return FAR
        missing = (min(start.parameter, 0.0) - motion.parameter) / (2.0 * start.omega)
        return DAMPED if not is_complete and missing > GIVE_UP_DAMPING_RATIO else ""

    try:
        curve, end = family_curve(
            projection,
            replace(start, Q=with_harmonics(start.Q, harmonics)),
            stop,
            CURVE_STEPS if is_complete else PROJECTED_STEPS,
        )
    except ConvergenceError as error:
        return Family(lam, (), 0, [], error.status, largest=start, noise=noise)
    curve = without_noise(curve, noise)
    cycles: list[Cycle] = []
    lost, look = _confirmed(contact, curve, search, cycles), None
    if (
        end in SEARCHED_ENDS
        and start.parameter <= 0.0
        and not cycles
        and abs(start.parameter) > noise
    ):
        look = looked_again(contact.oscillator, curve, _larger_harmonic_counts(harmonics))
        _confirmed(contact, chain(*look.pieces), search, cycles)
        if cycles or not (look.open or look.grows):  # more harmonics have decided about the zeros
            lost = 0
    shown = _curve_rows(contact, curve)
    fastest = max(range(len(curve)), key=lambda k: float(shown[k]["contact_velocity"]))
    furthest = curve[fastest].motion
    return Family(
        lam,
        tuple(cycles),
        lost,
        shown,
        end,
        look,
        largest=furthest,
        path=tuple(curve),
        noise=noise,
    )


def _small_enough(
    projection: Projection, start: PeriodicMotion, harmonics: int, noise: float
) -> PeriodicMotion:
    """The linear motion with which a curve begins, made smaller where contact is nonlinear.

    Under a light load, contact opens in motion that is slow compared with sliding. A curve that
    began with such motion would miss smaller cycles.
    """
    for smaller in 0.1 ** np.arange(1 + N_SMALLER_STARTS):
        tried = replace(start, Q=with_harmonics(smaller * start.Q, harmonics))
        with contextlib.suppress(ConvergenceError):
            motion, *_ = projection.improve(tried, CURVE_BASIS_ERROR, SIZE_HELD)
            change = abs(motion.parameter - start.parameter)
            if change <= max(MAX_REL_START_CHANGE * abs(start.parameter), noise):
                return replace(start, Q=smaller * start.Q)
    return start


def _larger_harmonic_counts(harmonics: int) -> list[int]:
    """Larger numbers of harmonics with which a curve is checked, ascending."""
    return [h for h in HARMONIC_COUNTS if h > harmonics][:N_LARGER_HARMONIC_COUNTS] or [
        harmonics + harmonics // 2
    ]


def _confirmed(
    contact: ContactOscillator, curve: Iterable[CurveMotion], search: Search, cycles: list[Cycle]
) -> int:
    """Add the cycles at zeros of a curve to `cycles`; return the number of zeros without one."""
    lost = 0
    for point in curve:
        if point.event == ZERO:
            nearby_cycles = _cycles_at(contact, point.motion, search)
            new = [c for c in nearby_cycles if not any(same_cycle(c, other) for other in cycles)]
            lost += not new
            cycles += new
    return lost


def _cycles_at(contact: ContactOscillator, zero: PeriodicMotion, search: Search) -> list[Cycle]:
    """The cycle at a zero of a curve; if more harmonics deny it, the cycles they have nearby."""
    osc, cycles = contact.oscillator, list[Cycle]()
    try:
        return [cycle_near(contact, Projection.on_harmonics_of(osc, zero), zero, search)]
    except ConvergenceError:
        pass
    try:
        more = search.harmonics or next(h for h in HARMONIC_COUNTS if h > zero.harmonics)
        for motion in found_again(osc, zero, more):
            cycles += [cycle_near(contact, Projection.on_harmonics_of(osc, motion), motion, search)]
    except ConvergenceError:
        pass
    return cycles


def _curve_rows(contact: ContactOscillator, curve: list[CurveMotion]) -> list[dict[str, Any]]:
    """One row for each motion of a curve, for the table of curves (`Family.curve`)."""
    return [
        {
            "contact_velocity": contact.contact_velocity(point.motion),
            "frequency_hz": point.motion.omega / (2 * np.pi),
            "added_damping": point.motion.parameter,
            "residual": point.residual,
            "basis_error": point.error,
            "event": point.event,
        }
        for point in curve
    ]
