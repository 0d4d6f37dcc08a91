"""Measures variants of a study's settings at pilot design points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.engine.chunk_rows import unforeseen
from squealstudy.engine.keys import content_hash
from squealstudy.engine.kind import as_kind
from squealstudy.engine.measurement import Measurement, MeasurementRequest, Measuring
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Progress, Workers
from squealstudy.errors import SquealstudyError
from squealstudy.mechanics.failures import FAILURES
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sections import FidelitySection
from squealstudy.tables.method_quality import (
    FoundError,
    Miscount,
)

if TYPE_CHECKING:
    from squealstudy.engine.cluster import Cluster

# quantities whose errors are compared with the tolerance
IN_FREQUENCY = ("frequency", "damping_ratio")
IN_TIME = ("growth_rate", "torque_rms", "torque_mean", "dominant_frequency")
MISCOUNT_ERROR = 1.0  # error of a setting that misses an instability, sees one too many, or fails
N_RESERVE_PILOTS = 4  # design points in reserve for pilots that fail


@dataclass(frozen=True)
class FidelityStudy:
    """A study with a [fidelity] section.

    Attributes
    ----------
    study : ResolvedStudy
    jobs : int
        Number of workers of the run that is prepared.
    report : callable
        Called with (stage, done, total).
    measured : dict
        Measurements so far, by a hash of settings and points.
    failed : set of int
        Design points that failed and could be no pilots.
    asked : float or None
        A stricter tolerance than the section's, after a failed audit.
    cluster : Cluster or None
        The cluster of these workers; None for processes of this machine.
    """

    study: ResolvedStudy
    jobs: int
    report: Progress
    measured: dict[str, Measurement] = field(default_factory=dict)
    failed: set[int] = field(default_factory=set)
    asked: float | None = None
    cluster: Cluster | None = None

    @property
    def tolerance(self) -> float:
        """The tolerance by which settings are chosen."""
        return self.section.tolerance if self.asked is None else self.asked

    @property
    def section(self) -> FidelitySection:
        """The [fidelity] section: tolerance, budget, pilots, audit."""
        section = self.study.definition.fidelity
        assert section is not None
        return section

    @cached_property
    def plan(self) -> Plan:
        """The plan of the study with the settings of its file."""
        return Plan(self.study, point_by_point=True)

    @property
    def in_time(self) -> bool:
        """Whether the study integrates in time (else it computes complex modes)."""
        return not self.study.kind.chooses_rung

    @property
    def measuring(self) -> Measuring:
        """How settings are timed and compared."""
        measuring = as_kind(self.study.kind).measuring()
        assert measuring is not None
        return measuring

    @property
    def _workers(self) -> Workers:
        return Workers(self.jobs, self.report, cluster=self.cluster)

    def variant(self, changes: Mapping[str, Any], swept: np.ndarray | None) -> Plan:
        """The study with other settings; `swept` replaces its design points."""
        return Plan(self.study.variant(changes), swept, point_by_point=True)

    def measure(self, changes: Mapping[str, Any], points: Sequence[int]) -> Measurement:
        """Measure settings at some of the study's design points; each measurement is made once.

        Only the structures of these points are built, unless the method needs those of all points.
        """
        name = content_hash([sorted(changes.items(), key=str), list(points)])
        if name not in self.measured:
            plan = self.variant(changes, self.plan.swept)
            together = not self.in_time and plan.method.rung.shares_work
            structures = None if together else {plan.tasks[i].structure for i in points}
            failures = build_structures(plan, self._workers, structures)
            self.measured[name] = self._measured(plan, points, failures)
            self.report("pilot runs", len(self.measured), len(self.measured) + 1)
        return self.measured[name]

    def _measured(
        self, plan: Plan, points: Sequence[int], failures: Mapping[str, str]
    ) -> Measurement:
        """Measurement of the points whose structure could be built; the others count as failed."""
        reasons = [failures.get(plan.tasks[i].structure, "") for i in points]
        built = [i for i, reason in zip(points, reasons, strict=True) if not reason]
        if not built:
            raise SquealstudyError(f"{self.study.source.path}: {reasons[0]}")
        try:
            measurement = self.measuring.measure(plan, built, MeasurementRequest())
        except SquealstudyError:
            raise
        except FAILURES as error:  # an unforeseen failure: the settings do not work
            raise SquealstudyError(
                f"{self.study.source.path}: settings cannot be tried: {unforeseen(error)[1]}"
            ) from error
        measured_findings = iter(measurement.findings.values())
        findings = {
            str(n): {"status": "structure", "message": reason}
            if reason
            else next(measured_findings)
            for n, reason in enumerate(reasons)
        }
        return replace(measurement, findings=findings)

    def pilots(self, changes: Mapping[str, Any], candidates: Sequence[int]) -> list[int]:
        """The first candidates at which settings work, as many as the section asks for.

        A candidate that fails is added to `failed`, and the next one takes its place; there are
        fewer pilots if no candidates are left.

        Raises
        ------
        SquealstudyError
            The settings fail at all candidates.
        """
        count = self.section.pilots
        chosen, waiting = list(candidates[:count]), list(candidates[count:])
        first = ""
        while chosen:
            try:
                findings = self.measure(changes, chosen).findings
            except SquealstudyError as error:  # none of their structures can be made
                findings = {str(p): {"status": "structure", "message": str(error)} for p in chosen}
            good = [
                p for p, f in zip(chosen, findings.values(), strict=True) if f["status"] == "ok"
            ]
            if len(good) == len(chosen):
                return chosen
            bad = next(f for f in findings.values() if f["status"] != "ok")
            first = first or f"{bad['status']}: {bad['message']}"
            self.failed.update(set(chosen) - set(good))
            missing = count - len(good)
            chosen, waiting = good + waiting[:missing], waiting[missing:]
        raise SquealstudyError(
            f"{self.study.source.path}: every pilot design point failed, the first with {first}; "
            "without [fidelity] the study runs as its settings say"
        )

    def error(self, measurement: Measurement, truth: Measurement) -> float:
        """Largest `point_error` of a measurement against a better one."""
        return max(self.point_error(f, truth.findings[p]) for p, f in measurement.findings.items())

    def point_error(self, finding: Mapping[str, Any], truth: Mapping[str, Any]) -> float:
        """`largest_error` at one design point; MISCOUNT_ERROR where either result has failed."""
        if finding["status"] != "ok" or truth["status"] != "ok":
            return MISCOUNT_ERROR
        judged = IN_TIME if self.in_time else IN_FREQUENCY
        errors, count = self.measuring.comparisons[0](finding, truth)
        return largest_error(errors, count, judged)


def largest_error(errors: Sequence[FoundError], count: Miscount, judged: Sequence[str]) -> float:
    """Largest error of `judged` quantities; at least MISCOUNT_ERROR where instabilities differ."""
    worst = MISCOUNT_ERROR if count.missed or count.spurious else 0.0
    return max([worst, *(error.error for error in errors if error.quantity in judged)])
