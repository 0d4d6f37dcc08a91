"""Resolves doubtful pairings of modes by solving design points in between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.modes.tracking.labels import EXTRAPOLATED_SHARE
from squealstudy.modes.tracking.pairing import (
    HALVING_TRUST,
    PASSING_TRUST,
    Band,
    Pairing,
    pair_macs,
    pair_modes,
)

DEPTH = 4  # most halvings of a step


class Modes(NamedTuple):
    """Oscillating modes of a design point: roots (m,) [rad/s] and shapes (m, k)."""

    lam: np.ndarray
    shapes: np.ndarray


# coordinates (p,) of a design point -> its modes; raises SquealstudyError where there are none
Solve = Callable[[np.ndarray], Modes]


@dataclass
class StepRefinement:
    """Bisects the step between two design points while its pairings are in doubt.

    Parameters
    ----------
    solve : callable
        Returns the modes at the coordinates (p,) of an intermediate design point.
    depth : int
        Most times that a step is halved.
    band : (low, high) or None
        Band of the modes that `solve` returns, rad/s.

    Attributes
    ----------
    points : int
        Number of intermediate points so far, failed ones included.
    """

    solve: Solve
    depth: int = DEPTH
    band: Band | None = None
    points: int = 0

    def pair(
        self,
        a: Modes,
        b: Modes,
        x_a: np.ndarray,
        x_b: np.ndarray,
        expected: np.ndarray | None = None,
    ) -> Pairing:
        """Pairing of the modes of two design points at coordinates x_a, x_b (p,).

        Modes whose pairing is in doubt get the partner to which the smaller steps lead. They are
        ambiguous only where a smaller step still is: at a coalescence, or where two modes pass each
        other in the smallest step and change their shapes.

        Parameters
        ----------
        expected : ndarray (ma,) complex or None
            The roots of a as expected at b, rad/s (`pair_modes`).
        """
        all_modes = np.ones(len(a.lam), dtype=bool)
        return self._pair(a, b, x_a, x_b, all_modes, expected, self.depth)

    def _pair(
        self,
        a: Modes,
        b: Modes,
        x_a: np.ndarray,
        x_b: np.ndarray,
        modes_to_pair: np.ndarray,
        expected: np.ndarray | None,
        depth: int,
    ) -> Pairing:
        """Pair two sets of modes, in halves of the step where a pair is in doubt."""
        direct = pair_modes(a.lam, a.shapes, b.lam, b.shapes, expected, self.band)
        doubtful = modes_to_pair & (direct.trust <= HALVING_TRUST)
        if not depth:
            return unresolved(direct, modes_to_pair)
        if not doubtful.any():
            return direct
        middle = (x_a + x_b) / 2
        try:
            mid = self.solve(middle)
        except SquealstudyError:
            return unresolved(direct, modes_to_pair)
        finally:
            self.points += 1
        halfway = None if expected is None else (a.lam + expected) / 2
        first = self._pair(a, mid, x_a, middle, doubtful, halfway, depth - 1)
        carried = np.zeros(len(mid.lam), dtype=bool)
        carried[first.partner[doubtful & (first.partner >= 0)]] = True
        onward = _onward(a.lam, mid.lam, first.partner)
        second = self._pair(mid, b, middle, x_b, carried, onward, depth - 1)
        return _composed(a, b, direct, first, second, doubtful)


def unresolved(pairing: Pairing, modes_to_pair: np.ndarray | None = None) -> Pairing:
    """A pairing that is not refined further, with its doubtful pairs marked as ambiguous.

    Modes whose frequencies pass each other in one step may have veered.

    Parameters
    ----------
    pairing : Pairing
    modes_to_pair : ndarray (ma,) of bool or None
        Modes whose pairs count; None for all.
    """
    doubtful = (pairing.trust <= PASSING_TRUST) & (pairing.partner >= 0)
    doubtful &= True if modes_to_pair is None else modes_to_pair
    return pairing._replace(ambiguous=pairing.ambiguous | doubtful)


def _onward(lam_a: np.ndarray, lam_m: np.ndarray, partner: np.ndarray) -> np.ndarray:
    """The roots of the middle point as expected at the end of the step."""
    expected = lam_m.astype(complex)
    i = np.flatnonzero(partner >= 0)
    expected[partner[i]] += EXTRAPOLATED_SHARE * (lam_m[partner[i]] - lam_a[i])
    return expected


def _composed(
    a: Modes, b: Modes, direct: Pairing, first: Pairing, second: Pairing, doubtful: np.ndarray
) -> Pairing:
    """Pairing through the middle point; where that has no partner the direct one, if it is free."""
    via, trust = np.full(len(a.lam), -1), first.trust.copy()
    i = np.flatnonzero(first.partner >= 0)
    via[i] = second.partner[first.partner[i]]
    trust[i] = np.minimum(trust[i], second.trust[first.partner[i]])
    ambiguous = first.ambiguous.copy()
    ambiguous[i] |= second.ambiguous[first.partner[i]]
    sure = ~doubtful & (via == direct.partner)
    ambiguous[sure], trust[sure] = False, np.maximum(trust[sure], direct.trust[sure])
    partner = via.copy()
    taken = set(via[via >= 0].tolist())
    for j in np.flatnonzero(via < 0):
        if direct.partner[j] >= 0 and direct.partner[j] not in taken:
            partner[j] = direct.partner[j]
            trust[j], ambiguous[j] = direct.trust[j], direct.ambiguous[j]
    ambiguous &= partner >= 0
    return Pairing(partner, pair_macs(a.shapes, b.shapes, partner), ambiguous, trust)
