"""Choice of the reduction of a complex-mode study, by trials at pilots against a better model.

The better model is the finer one of a component-mode reduction, or the full-order one. The audit of
the finished study (fidelity/run.py) always uses exact solves, of a meshed brake at full order.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from squealstudy.engine.checked_points import reference_choice
from squealstudy.engine.measurement import Measurement
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.errors import SquealstudyError
from squealstudy.fidelity.choice import Choice, TriedSetting, choose, pays
from squealstudy.fidelity.ladders import FIRST_CANDIDATE, REDUCTION, Setting, free_ladders
from squealstudy.fidelity.pilots import MISCOUNT_ERROR, N_RESERVE_PILOTS, FidelityStudy
from squealstudy.kinds.complex_modes.kind import point_share
from squealstudy.kinds.complex_modes.measuring import finer_finding
from squealstudy.mechanics.failures import FAILURES
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.modes.full_order.finer_model import FINER_MODEL_SAFETY_FACTOR
from squealstudy.modes.rung import Scope
from squealstudy.modes.rungs import all_rungs, exact_rung, full_order_rung, rung_named
from squealstudy.study.definition import ResolvedStudy, given_keys

# parts of the tolerance that the error of reanalysis and that of the reduction may take
REANALYSIS_TOLERANCE_SHARE, REDUCTION_TOLERANCE_SHARE = 0.2, 0.6
SMALL_MODEL_SHARE = 0.5  # number of points from which windows pay, over that on a meshed model


def search_modes(fidelity: FidelityStudy) -> Choice:
    """Choose the cheapest reduction within its share of the tolerance, and the method's tolerance.

    A smaller reduction is tried where it may save more at the points than it takes to make.
    """
    search = ModeSearch(fidelity)
    ladder = free_ladders(fidelity.study).get(REDUCTION)
    if ladder is None:
        label = "reduction as the file says" if has_mesh(fidelity.study) else search.method.name
        tried = {"": [search.attempt(Setting(label, {})), *search.small_windows()]}
    else:
        search.climb(ladder)
        tried = {REDUCTION: [search.tried[n] for n in sorted(search.tried)]}
    first = next(iter(tried.values()))[0]
    section = fidelity.section
    chosen = choose(tried, search.method_error, first.cost, fidelity.tolerance, section.budget)
    rungs = ladder if ladder is not None else search.small_rungs
    if rungs:
        labels = [t.label for settings in tried.values() for t in settings]
        chosen = chosen.with_untried(rungs, labels)
    return chosen.with_changes(search.common).with_failures(fidelity.failed)


class ModeSearch:
    """Reductions tried at the pilots of a study, by the number of their rung."""

    def __init__(self, fidelity: FidelityStudy) -> None:
        self.fidelity = fidelity
        self.common = _method_changes(fidelity)
        self.points: list[int] = []  # the pilots, chosen by the first attempt
        self.tried: dict[int, TriedSetting] = {}
        self.making = 0.0  # seconds of the last reduction
        self.exact = exact_method(fidelity.study)
        self.truth: dict[str, Any] = {}  # settings that errors are measured against
        self.method = fidelity.variant(self.common, fidelity.plan.swept).method

    @property
    def method_error(self) -> float:
        """Relative error that reanalysis may add to that of the reduction."""
        if not self.method.rung.over_a_basis:
            return 0.0
        explicit = float(self.fidelity.study.definition.modes.tolerance)
        return REANALYSIS_TOLERANCE_SHARE * self.fidelity.tolerance if self.common else explicit

    def attempt(self, rung: Setting) -> TriedSetting:
        """Solve the pilots without reanalysis; the error is against a better model (`_truth`)."""
        fidelity, changes = self.fidelity, {**self.common, **rung.changes}
        method = self.method.name
        if self.method.rung.over_a_basis:  # the error of reanalysis has its own share
            method = self.method.exact
        solved = {**changes, "modes.method": method}
        if not self.points:
            candidates = reference_choice(fidelity.plan, fidelity.section.pilots + N_RESERVE_PILOTS)
            self.points = fidelity.pilots(solved, candidates)
            # this reduction is made already, and its working points are those of any other
            self.truth = {**changes, "modes.method": self.exact}
        measurement = fidelity.measure(solved, self.points)
        self.making = measurement.reduction_seconds
        error = 0.0 if method == self.exact else self._error(measurement, solved)
        return TriedSetting(rung.label, rung.changes, error, self.study_seconds(measurement))

    @property
    def small_rungs(self) -> tuple[Setting, ...]:
        """Methods of a minimal model, cheapest first, where the file leaves the choice open.

        They are those that share work between points, and the exact one.
        """
        free = "modes.method" not in given_keys(self.fidelity.study)
        if not free or self.method.name != self.exact or self.method.rung.unreduced:
            return ()
        together = [r.name for r in all_rungs() if r.shares_work and r.keeps_tolerance]
        return (
            *(Setting(name, {"modes.method": name}) for name in together),
            Setting(self.exact, {}),
        )

    def small_windows(self) -> list[TriedSetting]:
        """Trials of `small_rungs` on a sweep of a minimal model with enough points for them.

        The trial solves the whole study, which takes a moment for a few degrees of freedom.
        """
        fidelity, points = self.fidelity, len(self.fidelity.plan.tasks)
        sweeps = fidelity.study.sweeps
        if any(s.parameter.structural for s in sweeps):
            return []
        scope = Scope(reduced=True, varied=len(sweeps), points=int(points / SMALL_MODEL_SHARE))
        settings = []
        for rung in self.small_rungs[:-1]:
            if not rung_named(rung.label).offer(scope).pays:
                continue
            try:
                measurement = fidelity.measure({**self.common, **rung.changes}, self.points)
            except FAILURES:  # no basis over this box, or damping without a form in this method
                continue
            exact = fidelity.measure({**self.common, "modes.method": self.exact}, self.points)
            error = REANALYSIS_TOLERANCE_SHARE * fidelity.tolerance + fidelity.error(
                measurement, exact
            )
            seconds = measurement.reduction_seconds + measurement.setup_seconds
            cost = seconds + measurement.seconds * points / fidelity.jobs
            settings.append(TriedSetting(rung.label, rung.changes, error, cost))
        return settings

    def _error(self, measurement: Measurement, changes: Mapping[str, Any]) -> float:
        """Largest error at the pilots, compared until one exceeds the whole tolerance.

        The reduction is then refused whatever the errors at the others are.
        """
        worst, failure = None, ""
        plan = self.fidelity.variant(changes, self.fidelity.plan.swept)
        for finding, point in zip(measurement.findings.values(), self.points, strict=True):
            truth, safety = self._truth(finding, plan, point)
            if truth["status"] != "ok":
                failure = truth["message"]
                self.fidelity.failed.add(point)
                continue
            error = min(MISCOUNT_ERROR, safety * self.fidelity.point_error(finding, truth))
            worst = max(worst or 0.0, error)
            if worst > self.fidelity.tolerance:
                break
        if worst is None:
            path = self.fidelity.study.source.path
            raise SquealstudyError(f"{path}: no pilot has a better model to be held to: {failure}")
        return worst

    def _truth(
        self, finding: Mapping[str, Any], plan: Plan, point: int
    ) -> tuple[Mapping[str, Any], float]:
        """Reference result of a pilot, and the safety factor on the distance to it.

        It is that of the finer model where there is one, else that of the exact method.
        """
        finer = finer_finding(plan, point) if finding["status"] == "ok" else None
        if finer is not None:
            return finer, FINER_MODEL_SAFETY_FACTOR
        return self.fidelity.measure(self.truth, [point]).findings["0"], 1.0

    @property
    def share(self) -> float:
        """Share of the tolerance that the reduction may take."""
        return REDUCTION_TOLERANCE_SHARE * self.fidelity.tolerance

    def climb(self, rungs: tuple[Setting, ...]) -> None:
        """Try rungs from FIRST_CANDIDATE up to one within its share, or down while that pays."""
        number = FIRST_CANDIDATE
        self.tried[number] = self.attempt(rungs[number])
        while self.tried[number].error > self.share and number + 1 < len(rungs):
            number += 1
            self.tried[number] = self.attempt(rungs[number])
        while number <= FIRST_CANDIDATE and number > 0 and self._pays(number):
            number -= 1
            self.tried[number] = self.attempt(rungs[number])
            if self.tried[number].error > self.share:
                return

    def _pays(self, number: int) -> bool:
        return pays(self.tried[number].cost - self.making, self.making)

    def study_seconds(self, measurement: Measurement) -> float:
        """Estimated seconds of the whole study, from exact solves at the pilots."""
        solves = float(len(self.fidelity.plan.tasks))
        rung = self.method.rung
        if rung.over_a_basis:
            share = point_share(self.fidelity.plan, rung) or 1.0
            solves = rung.setup_solves * self.fidelity.jobs + share * solves
        return measurement.reduction_seconds + measurement.seconds * solves / self.fidelity.jobs


def exact_method(study: ResolvedStudy) -> str:
    """Name of the exact method: full order, or the modes of a model without a reduction."""
    small = not has_mesh(study) and not isinstance(study.model, FamilyDefinition)
    return (exact_rung(reduced=True) if small else full_order_rung()).name


def _method_changes(fidelity: FidelityStudy) -> Mapping[str, Any]:
    """The tolerance of reanalysis as a share of the study's; nothing where the file gives one."""
    if "modes.tolerance" in given_keys(fidelity.study):
        return {}
    return {"modes.tolerance": min(REANALYSIS_TOLERANCE_SHARE * fidelity.tolerance, 0.1)}
