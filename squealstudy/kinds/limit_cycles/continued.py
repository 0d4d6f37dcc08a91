"""Cycles continued from solved designs: branches along a parameter, steps to neighbours."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np

from squealstudy.cycles.branch import CLOSED, HOPF, RANGE, SHRUNK, BranchPoint, branch, cycles_along
from squealstudy.cycles.branch_levels import level_on_branch
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.curve import between
from squealstudy.cycles.cycle import Cycle, cycle_near
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.folds import FOLD
from squealstudy.cycles.growth import FAR
from squealstudy.cycles.projection import Projection
from squealstudy.engine.cache import NewGaps
from squealstudy.engine.design_points import DesignPoints
from squealstudy.errors import SquealstudyError
from squealstudy.kinds.limit_cycles.designs import CyclesRequest, DesignLine
from squealstudy.kinds.limit_cycles.onset import has_shrunk, onset_error, onset_near
from squealstudy.mechanics.failures import FAILURES
from squealstudy.study.design import DesignPoint

TURNED = "turned"  # reason of a failed step to a neighbour: the branch folds before it arrives
MAX_RETRACED_SHARE = 0.2  # a branch has turned if it goes back by more than this share of the step
# relative differences of frequency and contact velocity up to which a branch passes a cycle
MAX_FREQUENCY_CHANGE, MAX_LEVEL_CHANGE = 1e-3, 0.05
ZERO_AT_HOPF = "torque_rms", "contact_velocity", "open_share_max"  # levels of rows
SAME_FOLD_SHARE = 1e-4  # folds are the same if they lie closer, over the range


@dataclass(frozen=True, eq=False)
class Start:
    """A cycle from which a branch is continued.

    Attributes
    ----------
    cycle_id : str
    mode : int
    value : float
        Value of the parameter along which it is continued.
    Q : ndarray (2 H + 1, n)
        Fourier series in the coordinates of the line, the modes that its designs share.
    omega : float
        Angular frequency, rad/s.
    """

    cycle_id: str
    mode: int
    value: float
    Q: np.ndarray
    omega: float

    @property
    def point_id(self) -> str:
        """Id of its design point."""
        return self.cycle_id.partition("-")[0]

    @property
    def motion(self) -> PeriodicMotion:
        """The cycle as a motion whose `parameter` is `value`."""
        return PeriodicMotion(self.Q, self.omega, self.value)


@dataclass(frozen=True)
class LineTask:
    """Branches along a parameter through the cycles of design points of one line.

    Attributes
    ----------
    request : CyclesRequest
    points : DesignPoints
        Design points of the line, ascending in the parameter.
    along : str
        Name of the parameter.
    starts : tuple of Start
        The cycles, in the order in which they are tried.
    """

    request: CyclesRequest
    points: DesignPoints
    along: str
    starts: tuple[Start, ...]


@dataclass(frozen=True, eq=False)
class StepTask:
    """A cycle of a design continued to a neighbour."""

    request: CyclesRequest
    points: DesignPoints  # the cycle's design point and its neighbour
    start: Start


@dataclass(frozen=True, eq=False)
class Continued:
    """A cycle of a design point that was reached from a cycle of another one.

    Attributes
    ----------
    point_id : str
        Id of the design point that was reached.
    origin : Start
        The cycle from which it was reached.
    cycle : Cycle or None
        None where the balance at the design itself did not converge.
    """

    point_id: str
    origin: Start
    cycle: Cycle | None


@dataclass(frozen=True, eq=False)
class Mark:
    """A fold or a Hopf point of a branch.

    Attributes
    ----------
    point_id : str
        Id of the design point at which the branch was begun.
    event : str
        F or H.
    motion : PeriodicMotion
        Its `parameter` is the parameter's value; at a Hopf point its amplitude is zero.
    """

    point_id: str
    event: str
    motion: PeriodicMotion


@dataclass
class ContinuedBranches:
    """Results of a continuation.

    Attributes
    ----------
    branches : list of dict
        Rows of the table of branches.
    cycles : list of Continued
    lost : list of str
        Starts from which no branch could be followed, with the reasons.
    marks : list of Mark
        Folds and Hopf points of the branches.
    """

    branches: list[dict[str, Any]] = field(default_factory=list)
    cycles: list[Continued] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)


def step_to_neighbour(task: StepTask) -> ContinuedBranches:
    """Continue a cycle to a neighbouring design; its cycle there, or why there is none."""
    continuation, points, gaps = ContinuedBranches(), task.points, NewGaps()
    line, furthest = DesignLine(task.request, points[0], points[1]), 0.0

    def stop(motion: PeriodicMotion) -> str:
        nonlocal furthest
        furthest = max(furthest, motion.parameter)
        if motion.parameter < furthest - MAX_RETRACED_SHARE:
            return TURNED
        return ended(line, motion, task.start.motion)

    try:
        _, curve, end = cycles_along(line.oscillator, task.start.motion, line.bounds, 1.0, stop)
        last = curve[-1].motion
        if end == RANGE and last.parameter > 0.5:
            _, contact = task.request.contact(points[1], gaps)
            cycle = _cycle_at(contact, last, task.request)
            continuation.cycles.append(Continued(points[1].point_id, task.start, cycle))
        else:
            continuation.lost.append(f"{task.start.cycle_id}: {end}")
    except FAILURES as error:
        continuation.lost.append(f"{task.start.cycle_id}: {error}")
    gaps.save()
    return continuation


def follow_line(task: LineTask) -> ContinuedBranches:
    """Follow branches through all cycles of a line, each once; their cycles at its designs."""
    values = task.points.column(task.along)
    bounds = float(values[0]), float(values[-1])
    line = DesignLine(task.request, task.points[0], task.points[-1], bounds)
    continuation, branches = ContinuedBranches(), []  # type: ContinuedBranches, list[Branch]
    for start in task.starts:
        level = line.contact(start.value).contact_velocity(start.motion)
        if any(b.passes(line, start.value, start.omega, level) for b in branches):
            continue
        try:
            new_branch = _branch(line, start)
        except FAILURES as error:
            continuation.lost.append(f"{start.cycle_id}: {error}")
            continue
        if any(new_branch.same_as(other, line) for other in branches):
            continue
        branches.append(new_branch)
        continuation.branches += new_branch.rows(line, task.along)
        continuation.marks += new_branch.marks
    for point in task.points:
        continuation.cycles += _cycles_of(task, line, branches, point)
    return continuation


@dataclass(frozen=True, eq=False)
class Branch:
    """A branch from one end to the other.

    Attributes
    ----------
    start : Start
    points : list of BranchPoint
    ends : (str, str)
        Why it ends, at its first and its last point.
    onsets : mapping of int -> (value, frequency [Hz], criticality)
        Hopf points by their index in `points`, located as onsets of complex modes (`onset_near`).
    """

    start: Start
    points: list[BranchPoint]
    ends: tuple[str, str]
    onsets: dict[int, tuple[float, float, str]]

    @property
    def marks(self) -> list[Mark]:
        """The branch's folds and Hopf points."""
        folds = [p.motion for p in self.points if p.event == FOLD]
        hopf_points = [
            PeriodicMotion(np.zeros((3, 1)), 2.0 * np.pi * hz, onset)
            for onset, hz, _ in self.onsets.values()
        ]
        events = [(FOLD, m) for m in folds] + [(HOPF, m) for m in hopf_points]
        return [Mark(self.start.point_id, event, motion) for event, motion in events]

    def crossings(self, value: float) -> list[PeriodicMotion]:
        """Motions at a value of the parameter, each interpolated between two points."""
        crossings = []
        for before, after in pairwise(self.points):
            a, b = before.motion, after.motion
            start, end = a.parameter, b.parameter
            if start != end and (value - start) * (value - end) <= 0.0 and value != end:
                crossings.append(between(a, b, (value - start) / (end - start)))
        last = self.points[-1].motion
        return [*crossings, last] if value == last.parameter else crossings

    def passes(self, line: DesignLine, value: float, omega: float, level: float) -> bool:
        """Whether the branch passes a cycle of this frequency [rad/s] and contact velocity."""
        contact = line.contact(value)
        return any(
            abs(m.omega / omega - 1.0) < MAX_FREQUENCY_CHANGE
            and abs(contact.contact_velocity(m) / level - 1.0) < MAX_LEVEL_CHANGE
            for m in self.crossings(value)
        )

    def same_as(self, other: Branch, line: DesignLine) -> bool:
        """Whether two branches have a fold in common."""
        width = SAME_FOLD_SHARE * abs(line.bounds[1] - line.bounds[0])
        folds, others = (
            [(p.motion.parameter, p.motion.omega) for p in b.points if p.event == FOLD]
            for b in (self, other)
        )
        return any(
            abs(a - b) < width and abs(omega / w - 1.0) < MAX_FREQUENCY_CHANGE
            for (a, omega), (b, w) in product(folds, others)
        )

    def rows(self, line: DesignLine, along: str) -> list[dict[str, Any]]:
        """Rows of the table of branches."""
        rows = [self._row(line, along, k, p) for k, p in enumerate(self.points)]
        rows[0]["branch_end"], rows[-1]["branch_end"] = self.ends
        return rows

    def _row(self, line: DesignLine, along: str, k: int, point: BranchPoint) -> dict[str, Any]:
        contact = line.contact(point.motion.parameter)
        point, levels, error = level_on_branch(contact, point, line.request.search(contact))
        motion, multipliers = point.motion, point.multipliers
        row = {
            "point_id": self.start.point_id,
            "mode": self.start.mode,
            "cycle_id": self.start.cycle_id,
            "n_step": k,
            "along": along,
            "value": motion.parameter,
            "value_error": point.apart,
            "event": point.event,
            **dict.fromkeys(("criticality", "branch_end"), ""),
            "frequency_hz": motion.omega / (2 * np.pi),
            **{name: levels[name] for name in ZERO_AT_HOPF},
            "level_error": error,
            "stable": multipliers.stable,
            "n_unstable": multipliers.n_unstable,
            "multiplier": multipliers.modulus,
            "multiplier_error": multipliers.error,
            "n_harmonics": motion.harmonics,
            "harmonic_tail": motion.tail,
            "basis_error": point.error,
            "balance_residual": point.residual,
        }
        if k in self.onsets:  # the cycle is steady sliding there
            onset, hz, criticality = self.onsets[k]
            row |= {"value": onset, "frequency_hz": hz, "criticality": criticality}
            row["value_error"] = onset_error(line, onset, hz)
            row |= dict.fromkeys(ZERO_AT_HOPF, 0.0)
        return row


def ended(line: DesignLine, motion: PeriodicMotion, start: PeriodicMotion | None = None) -> str:
    """Why a branch from a start ends at a cycle that has shrunk or grown to a limit, or nothing."""
    if has_shrunk(line, motion, start):
        return SHRUNK
    contact, reach = line.contact(motion.parameter), line.request.section.reach
    return FAR if contact.contact_velocity(motion) > reach * abs(contact.point.speed) else ""


def _branch(line: DesignLine, start: Start) -> Branch:
    """Follow the branch through a cycle both ways."""
    parts: list[list[BranchPoint]] = []
    ends: list[str] = []
    for direction in (-1.0, 1.0):
        if start.value == line.bounds[0 if direction < 0 else 1]:
            parts.append([])
            ends.append(RANGE)
            continue
        points, end = branch(
            line.oscillator,
            start.motion,
            line.bounds,
            direction,
            partial(ended, line, start=start.motion),
            highest=line.request.band[1],
        )
        if end == CLOSED:
            return Branch(start, points, (CLOSED, CLOSED), {})
        parts.append(points)
        ends.append(end)
    points = [*parts[0][:0:-1], *(parts[1] or parts[0][:1])]
    onsets = {}
    for k, point in enumerate(points):
        if point.event == HOPF:
            neighbour = points[1] if k == 0 else points[k - 1]
            with contextlib.suppress(SquealstudyError):  # the point keeps the values of the curve
                half = abs(point.motion.parameter - neighbour.motion.parameter)
                onsets[k] = onset_near(line, point.motion, half)
    return Branch(start, points, (ends[0], ends[1]), onsets)


def _cycle_at(
    contact: ContactOscillator, motion: PeriodicMotion, request: CyclesRequest
) -> Cycle | None:
    """The cycle of a design near a continued motion; None where no cycle is confirmed there."""
    projection = Projection.on_harmonics_of(contact.oscillator, motion)
    try:
        return cycle_near(contact, projection, motion, request.search(contact))
    except FAILURES:
        return None


def _cycles_of(
    task: LineTask, line: DesignLine, branches: Sequence[Branch], point: DesignPoint
) -> list[Continued]:
    """Cycles of branches at a design that are not among the design's own cycles."""
    parameter_value = float(point.values[task.along])
    contact = line.contact(parameter_value)
    known_cycles = [
        (s.omega, contact.contact_velocity(s.motion))
        for s in task.starts
        if s.point_id == point.point_id
    ]
    new_cycles: list[Continued] = []
    for known_branch in branches:
        for motion in known_branch.crossings(parameter_value):
            level = contact.contact_velocity(motion)
            is_known = any(
                abs(motion.omega / w - 1.0) < MAX_FREQUENCY_CHANGE
                and abs(level / v - 1.0) < MAX_LEVEL_CHANGE
                for w, v in known_cycles
            )
            if is_known:
                continue
            cycle = _cycle_at(contact, motion, task.request)
            new_cycles.append(Continued(point.point_id, known_branch.start, cycle))
            if cycle is not None:
                known_cycles.append((cycle.motion.omega, cycle.levels["contact_velocity"]))
    return new_cycles
