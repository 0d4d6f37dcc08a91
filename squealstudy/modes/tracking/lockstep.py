"""Refines the onsets of many modes together, so that small models are solved in batches.

The method is that of `onsets.refine_onset`, in all brackets at once. Every iteration of
Chandrupatla's method (1997) solves one design point for each bracket, all in one batch. Brackets
with a difficulty are left to `onsets.refine_onset`: those whose mode is lost, whose ends are of two
modes, or in which the damping ratio jumps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.modes.tracking.onsets import (
    MAX_REL_ROOT_CHANGE,
    MIN_JUMP,
    MIN_VALUE_BESIDE_JUMP,
    MOST_ITERATIONS,
    exchanged,
)
from squealstudy.modes.tracking.pairing import pair_many


class ManyModes(NamedTuple):
    """Oscillating modes of n design points with m modes each.

    Attributes
    ----------
    lam : ndarray (n, m) complex
        Roots, rad/s.
    shapes : ndarray (n, m, k) complex
        Shapes.
    """

    lam: np.ndarray
    shapes: np.ndarray

    def at(self, rows: np.ndarray) -> ManyModes:
        """The modes at the points with these indices."""
        return ManyModes(self.lam[rows], self.shapes[rows])


# (indices (r,) of brackets, values (r,) of the parameter in them) -> modes, and a mask (r,) of the
# values that have modes, as many as all others
SolveMany = Callable[[np.ndarray, np.ndarray], tuple[ManyModes, np.ndarray]]


@dataclass
class _Side:
    """One side of all brackets.

    Attributes
    ----------
    x : ndarray (n,)
        Value of the parameter.
    f : ndarray (n,)
        Damping ratio of the followed mode plus the tolerance; zero at the onset.
    modes : ManyModes
        All modes there.
    place : ndarray (n,) of int
        Index of the followed mode.
    """

    x: np.ndarray
    f: np.ndarray
    modes: ManyModes
    place: np.ndarray

    def take(self, rows: np.ndarray, other: _Side, rows_of_other: np.ndarray) -> None:
        """Copy `rows_of_other` of another side into `rows` of this one."""
        self.x[rows], self.f[rows], self.place[rows] = (
            other.x[rows_of_other],
            other.f[rows_of_other],
            other.place[rows_of_other],
        )
        self.modes.lam[rows], self.modes.shapes[rows] = (
            other.modes.lam[rows_of_other],
            other.modes.shapes[rows_of_other],
        )


class ManyOnsets(NamedTuple):
    """Refined onsets of n brackets.

    Attributes
    ----------
    value, frequency_hz : ndarray (n,)
        Value of the parameter, and frequency of the mode there; NaN where there is no answer, and
        `onsets.refine_onset` has to find it.
    evaluations : ndarray (n,) of int
        Number of design points that were solved, also of brackets without an answer.
    """

    value: np.ndarray
    frequency_hz: np.ndarray
    evaluations: np.ndarray


def refine_onsets_together(
    x: tuple[np.ndarray, np.ndarray],
    modes: tuple[ManyModes, ManyModes],
    mode_numbers: tuple[np.ndarray, np.ndarray],
    solve: SolveMany,
    tolerance: float,
    precision: float,
) -> ManyOnsets:
    """Values at which the damping ratios of modes pass -tolerance, each between two design points.

    Parameters
    ----------
    x : (low, high), each ndarray (n,)
        Values of the parameter at both ends.
    modes : (low, high)
        Modes at both ends; all points have the same number.
    mode_numbers : (low, high), each ndarray (n,) of int
        Index of the followed mode at both ends.
    solve : callable
        Solves one point in each of some brackets (`SolveMany`).
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    precision : float
        Absolute error of the value.
    """
    n = len(x[0])
    ends = [
        _Side(
            np.array(at, dtype=float),
            _excess(m.lam[np.arange(n), mode_number], tolerance),
            ManyModes(m.lam.astype(complex), m.shapes.astype(np.complex64)),
            np.array(mode_number),
        )
        for at, m, mode_number in zip(x, modes, mode_numbers, strict=True)
    ]
    a, b = ends[1], ends[0]
    third_x, third_f = a.x.copy(), a.f.copy()
    scale = np.maximum(np.abs(a.f), np.abs(b.f))
    share = np.full(n, 0.5)
    evaluations = np.zeros(n, dtype=int)
    good = (np.sign(a.f) * np.sign(b.f) <= 0) & np.isfinite(a.f) & np.isfinite(b.f)
    active = np.flatnonzero(good & (np.abs(b.x - a.x) > precision))
    for _ in range(MOST_ITERATIONS):
        if not len(active):
            break
        at = a.x[active] + share[active] * (b.x[active] - a.x[active])
        solved_modes, solved = solve(active, at)
        evaluations[active] += 1
        mode_number = np.where(solved, _followed(a, b, active, solved_modes), -1)
        lost = mode_number < 0
        good[active[lost]] = False
        still_followed = np.flatnonzero(~lost)
        active, at, mode_number, solved_modes = (
            active[still_followed],
            at[still_followed],
            mode_number[still_followed],
            solved_modes.at(still_followed),
        )
        f = _excess(solved_modes.lam[np.arange(len(still_followed)), mode_number], tolerance)
        new = _Side(at, f, solved_modes, mode_number)
        scale[active] = np.maximum(scale[active], np.abs(f))
        same = np.sign(f) == np.sign(a.f[active])
        third_x[active] = np.where(same, a.x[active], b.x[active])
        third_f[active] = np.where(same, a.f[active], b.f[active])
        turned = active[~same]
        b.take(turned, a, turned)
        a.take(active, new, np.arange(len(active)))
        width = np.abs(b.x[active] - a.x[active])
        limit = 0.5 * precision / np.maximum(width, 1e-300)
        share[active] = np.clip(
            _step(a, b, third_x, third_f, active),
            np.minimum(limit, 0.5),
            1 - np.minimum(limit, 0.5),
        )
        nearest = np.minimum(np.abs(a.f[active]), np.abs(b.f[active]))
        active = active[(width > precision) & (nearest > 0)]
    good[active] = False  # not converged
    residual = np.minimum(np.abs(a.f), np.abs(b.f))
    step = np.abs(a.f - b.f)
    good &= ~(
        (residual > MIN_VALUE_BESIDE_JUMP * step)
        & (MIN_VALUE_BESIDE_JUMP * step > MIN_VALUE_BESIDE_JUMP * MIN_JUMP * scale)
    )
    first = np.abs(a.f) <= np.abs(b.f)
    onset = np.where(first, a.x, b.x)
    rows = np.arange(n)
    at_a, at_b = a.modes.lam[rows, a.place], b.modes.lam[rows, b.place]
    good &= np.abs(at_a - at_b) <= MAX_REL_ROOT_CHANGE * np.minimum(np.abs(at_a), np.abs(at_b))
    good &= ~exchanged(a.modes.lam, b.modes.lam, a.place, b.place)
    lam = np.where(first, at_a, at_b)
    return ManyOnsets(
        value=np.where(good, onset, np.nan),
        frequency_hz=np.where(good, np.abs(lam) / (2 * np.pi), np.nan),
        evaluations=evaluations,
    )


def _excess(lam: np.ndarray, tolerance: float) -> np.ndarray:
    """Damping ratio of roots plus the stability tolerance: negative where they are unstable."""
    excess: np.ndarray = -lam.real / np.maximum(np.abs(lam), 1e-300) + tolerance
    return excess


def _followed(a: _Side, b: _Side, rows: np.ndarray, modes_between: ManyModes) -> np.ndarray:
    """Index (r,) of each bracket's mode among the modes between its ends; -1 where it is lost.

    The mode is paired from both ends. Where the two pairings disagree, that of more trust counts.
    """
    best, partner = np.full(len(rows), -np.inf), np.full(len(rows), -1)
    each = np.arange(len(rows))
    for end in (a, b):
        end_modes = end.modes.at(rows)
        pairs = pair_many(
            end_modes.lam, end_modes.shapes, modes_between.lam, modes_between.shapes, end_modes.lam
        )
        end_partner, trust = (
            pairs.partner[each, end.place[rows]],
            pairs.trust[each, end.place[rows]],
        )
        better = (end_partner >= 0) & (trust > best)
        partner, best = np.where(better, end_partner, partner), np.where(better, trust, best)
    return partner


def _step(
    a: _Side, b: _Side, third_x: np.ndarray, third_f: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Next point as a share (r,) of the way from a to b: inverse quadratic if safe, else 0.5."""
    x1, x2, x3 = a.x[rows], b.x[rows], third_x[rows]
    f1, f2, f3 = a.f[rows], b.f[rows], third_f[rows]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        quadratic = f1 / (f2 - f1) * f3 / (f2 - f3)
        quadratic += (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        safe = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi) & np.isfinite(quadratic)
    return np.where(safe, quadratic, 0.5)
