"""Effect of the gyroscopic terms of a turning disc on the modes of a design point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from squealstudy.models.operating import DesignState
from squealstudy.modes.point import solve_point
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.root_pairs import LIGHT_DAMPING, MAX_PAIR_REL_DISTANCE, least_assignment

BAND_WIDENING = 0.02  # relative widening of the band, which gives modes at its ends partners


@dataclass(frozen=True)
class TurningEffect:
    """Changes of modes that grow or have little damping by gyroscopic terms.

    Attributes
    ----------
    growth : float
        Largest change of a growth rate, 1/s.
    frequency : float
        Largest relative change of a frequency.
    decided : int
        Number of modes that grow with gyroscopic terms and not without them, or the reverse.
    decided_growth : float
        Largest change of the growth rate of one of these, 1/s.
    """

    growth: float
    frequency: float
    decided: int
    decided_growth: float


def turning_effect(
    prepared: PreparedModel,
    state: DesignState,
    lam: np.ndarray,
    band_hz: tuple[float, float],
    neutral: float,
) -> TurningEffect | None:
    """Compare the modes of a design state with and without gyroscopic terms.

    The other modes are computed anew. First order would not be enough: a skew matrix acts on a real
    mode only by its coupling with other modes.

    Parameters
    ----------
    prepared : PreparedModel
    state : DesignState
        The design; it may have gyroscopic terms or not.
    lam : ndarray (m,) complex
        Its roots in the band, rad/s.
    band_hz : (low, high)
    neutral : float
        Magnitude of the damping ratio up to which a mode neither grows nor decays.

    Returns
    -------
    TurningEffect or None
        None for a structure without such terms.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    if prepared.model.turning is None:
        return None
    factor = 0.0 if state.operating.gyroscopic else 1.0
    other = replace(state, operating=replace(state.operating, gyroscopic=factor))
    low, high = band_hz
    wider = (low * (1.0 - BAND_WIDENING), high * (1.0 + BAND_WIDENING))
    roots, partners = lam[lam.imag > 0], solve_point(prepared, other, wider).lam
    partners = partners[partners.imag > 0]
    distance = np.abs(partners - roots[:, None]) / np.abs(roots)[:, None]
    rows, columns = least_assignment(distance)
    a, b = roots[rows], partners[columns]
    paired = (a.real > -LIGHT_DAMPING * np.abs(a)) & (
        distance[rows, columns] < MAX_PAIR_REL_DISTANCE
    )
    a, b = a[paired], b[paired]
    change = np.abs(b.real - a.real)
    grow = [x.real > neutral * np.abs(x) for x in (a, b)]
    decided = grow[0] != grow[1]
    return TurningEffect(
        growth=float(change.max(initial=0.0)),
        frequency=float(np.abs(np.abs(b) / np.abs(a) - 1.0).max(initial=0.0)),
        decided=int(decided.sum()),
        decided_growth=float(change[decided].max(initial=0.0)),
    )
