"""State of the search of a design study: demands for damping, checks, the chosen design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from squealstudy.kinds.design.plan import Evaluation
from squealstudy.kinds.design.search import Steps
from squealstudy.kinds.design.study import DesignStudy
from squealstudy.kinds.design.targets import Realisation

Row = Mapping[str, Any]
Rows = Mapping[Evaluation, Row]
# outcomes: all checks passed, with checks of large motions or without; some check is open
MET, MET_LINEAR, UNDECIDED = "met", "met_linear", "undecided"
# the limit of designs was reached; no design meets the margin; no proof succeeded in ten rounds;
# there is nothing to change
STOPPED, NONE_FOUND, UNPROVEN, NO_VARIABLES = "stopped", "none_found", "unproven", "no_variables"
PROVEN = (MET, MET_LINEAR)
KICK_WINDOW = 0.2  # relative distance in frequency of modes that a demand applies to
MORE_DAMPING = (2.0, 1e-3)  # factor on the damping of modes that last in a run, and least increase
NEAR_ENOUGH = 0.05  # relative difference of damping ratios with which a run lasts and decays
JUST_ABOVE_FACTOR = 1 + 1e-6


class RowsPending(Exception):  # noqa: N818 - no error
    """Ends a pass of the search where design points that it needs are not solved yet."""


@dataclass(frozen=True)
class DampingDemand:
    """A demand for more damping than the margin at an operating point.

    Attributes
    ----------
    point : int
        Index of the operating point.
    damping_ratio : float
        The damping ratio demanded.
    frequency_hz : float
        Frequency of the modes that it applies to, and those near them; 0 for all modes.
    lasts, decays : float
        In a demand by runs in time: the largest damping ratio with which a vibration lasted, and
        the least demand that a design met whose runs all decay.
    """

    point: int
    damping_ratio: float
    frequency_hz: float = 0.0
    lasts: float = np.nan
    decays: float = np.inf

    def near(self, hz: np.ndarray | float) -> np.ndarray | bool:
        """Whether the demand applies to modes of these frequencies [Hz]."""
        close = np.abs(hz - self.frequency_hz) <= KICK_WINDOW * self.frequency_hz
        return close | (self.frequency_hz == 0.0)

    def increased(self, lasts: float) -> DampingDemand:
        """The demand after a run that lasts at a damping ratio: halfway to `decays`, or doubled."""
        decays = self.decays if lasts < self.decays else np.inf
        more = max(MORE_DAMPING[0] * lasts, lasts + MORE_DAMPING[1])
        more = (lasts + decays) / 2 if np.isfinite(decays) else more
        return replace(self, damping_ratio=more, lasts=lasts, decays=decays)

    def reduced(self) -> DampingDemand:
        """The demand after a proof that succeeded: halfway to `lasts`, until the two are near."""
        after_proof = replace(self, decays=self.damping_ratio)
        return (
            after_proof
            if after_proof.is_settled
            else replace(after_proof, damping_ratio=(after_proof.lasts + after_proof.decays) / 2)
        )

    @property
    def is_settled(self) -> bool:
        """Whether the bracket of the least demand is narrow, or none is needed."""
        interval = self.decays - self.lasts  # NaN for a demand that is not by runs
        return not interval > max(NEAR_ENOUGH * self.decays, MORE_DAMPING[1] / 2)

    @property
    def at_proven_level(self) -> DampingDemand:
        """The demand at which runs decayed, or else just above that at which one lasted."""
        if not np.isfinite(self.lasts):
            return self
        is_proven = np.isfinite(self.decays)
        return replace(
            self, damping_ratio=self.decays if is_proven else self.lasts * JUST_ABOVE_FACTOR
        )


@dataclass(frozen=True)
class Check:
    """One line of a proof.

    Attributes
    ----------
    round : int
    kind : str
        ``matrix``, ``refined``, ``full_order``, ``limit_cycles``, ``in_time`` or ``scatter``.
    design : ndarray (d,)
    evaluations : tuple of Evaluation
    passed : bool or None
        None where it cannot be told.
    value : float
        Least damping ratio; for limit cycles the largest missing damping ratio; for runs in time
        the share that decays; for scatter the share of samples that meets the margin.
    text : str
        The outcome in words.
    """

    round: int
    kind: str
    design: np.ndarray
    evaluations: tuple[Evaluation, ...]
    passed: bool | None
    value: float
    text: str


@dataclass
class State:
    """State of the search.

    Attributes
    ----------
    points : list of ndarray (n_operating,)
        Operating points: the matrix, then refined points.
    n_matrix : int
        Number of points of the matrix.
    active_points : list of int
        Indices of the operating points at which the search judges designs.
    demands : list of DampingDemand
    safety : float
        Standard deviations of the scatter that the search allows for.
    designs : dict of bytes -> ndarray (d,)
        Values of all variables of every design, in the order in which they were first needed.
    roles : dict of bytes -> (str, int)
        Role of each design when it was first needed, and the round.
    checks : list of Check
    outcome : str
        Empty while rows are pending.
    chosen : ndarray (d,) or None
        Values of the chosen design.
    realisation : Realisation or None
        Result of the search over targets alone, if the study has other variables too.
    failure : str
        Why no design was solved at all active points; empty where one was.
    """

    points: list[np.ndarray]
    n_matrix: int
    active_points: list[int]
    demands: list[DampingDemand] = field(default_factory=list)
    safety: float = 0.0
    designs: dict[bytes, np.ndarray] = field(default_factory=dict)
    roles: dict[bytes, tuple[str, int]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    outcome: str = ""
    chosen: np.ndarray | None = None
    round: int = 0
    realisation: Realisation | None = None
    failure: str = ""


@dataclass(frozen=True, eq=False)
class ModeDamping:
    """The modes of least damping of a design at one operating point.

    Attributes
    ----------
    zeta, hz : ndarray (m,)
        Damping ratios; frequencies, Hz.
    scatter : ndarray (m, k)
        Derivatives of the damping ratios by what scatters.
    slopes : ndarray (m, d)
        Derivatives of the damping ratios by the variables, in units of their ranges.
    """

    zeta: np.ndarray
    hz: np.ndarray
    scatter: np.ndarray
    slopes: np.ndarray


def mode_damping_of(row: Mapping[str, Any], study: DesignStudy, ranges: np.ndarray) -> ModeDamping:
    """Damping of the modes of a row; steady sliding that diverges counts as a mode of 0 Hz."""
    zeta, hz, scatter, slopes = [], [], [], []
    for mode in row["modes"]:
        slope_of = {s["parameter"]: s["d_damping_ratio"] for s in mode["slopes"]}
        by = np.nan_to_num(
            [slope_of.get(v.name, 0.0) for v in study.variables], posinf=0.0, neginf=0.0
        )
        zeta.append(mode["damping_ratio"])
        hz.append(mode["frequency_hz"])
        scatter.append([slope_of.get(u.name, 0.0) for u in study.uncertain])
        slopes.append(by * ranges)
    if row["frequency_hz"] == 0.0:
        zeta, hz = [*zeta, row["min_damping_ratio"]], [*hz, 0.0]
        scatter.append([0.0] * len(study.uncertain))
        slopes.append(np.zeros(len(ranges)))
    return ModeDamping(
        np.array(zeta),
        np.array(hz),
        np.nan_to_num(np.array(scatter, dtype=float)).reshape(len(zeta), len(study.uncertain)),
        np.array(slopes).reshape(len(zeta), len(ranges)),
    )


def modes_moved_out(
    design_row: Row, today: Sequence[Row], band_hz: tuple[float, float]
) -> list[Mapping[str, float]]:
    """Growing modes of a design outside the band in excess of today's design, nearest ones first.

    On either side of the band the number of growing modes is compared with the largest number in
    today's rows. A change that moves a mode out of the band has not silenced it.
    """
    moved_out: list[Mapping[str, float]] = []
    if not design_row["beside"]:
        return moved_out
    for side, edge in zip((-1.0, 1.0), band_hz, strict=True):
        growing, *others = (
            [m for m in row["beside"] if side * (m["frequency_hz"] - edge) > 0]
            for row in (design_row, *today)
        )
        growing.sort(key=lambda m: side * m["frequency_hz"])
        moved_out += growing[: max(len(growing) - max(map(len, others), default=0), 0)]
    return moved_out


@dataclass(frozen=True)
class SearchCache:
    """Results that a search which starts over with more rows need not compute again."""

    damping_of: dict[Evaluation, ModeDamping] = field(default_factory=dict)
    steps: Steps = field(default_factory=dict)
    deviations_at: dict[float, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
