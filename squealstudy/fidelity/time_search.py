"""Choice of basis, contact points, slope and step of a transient study, by trials at pilots."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from squealstudy.engine.measurement import Measurement
from squealstudy.engine.plan import Plan
from squealstudy.fidelity.choice import Choice, TriedSetting, choose, pays
from squealstudy.fidelity.ladders import (
    BASIS,
    CONTACT,
    SLOPE,
    STEP,
    TRIAL_STEP,
    Ladder,
    free_ladders,
    training_step,
)
from squealstudy.fidelity.pilots import N_RESERVE_PILOTS, FidelityStudy
from squealstudy.kinds.transient.slope_pilot import FIRST_ORDER_FACTOR
from squealstudy.study.definition import given_keys

SETTING_TOLERANCE_SHARE = 0.4  # share of the tolerance that one ladder may take
RICHARDSON_FACTOR = 4.0 / 3.0  # error of a step from the difference to half of it, order 2
# relative half-width of a level's interval at which runs end: at most, and over the tolerance
SETTLED_LEVEL_HALF_WIDTH, SETTLED_SHARE = 0.01, 0.2
# settings of a run without a reduced basis
ALL_MODES = {
    "transient.modes_below": None,
    "transient.pod_vectors": 0,
    "transient.pod_step": None,
}
QUIET = {"transient.save_every": 0}  # pilots store no histories


def search_runs(fidelity: FidelityStudy) -> Choice:
    """The cheapest step, basis and contact points whose errors together meet the tolerance."""
    search = RunSearch(fidelity)
    for name, attempt in (
        (BASIS, search.try_bases),
        (CONTACT, search.try_contact_points),
        (SLOPE, search.try_slopes),
        (STEP, search.try_steps),
    ):
        if name in search.ladders:
            attempt(search.ladders[name])
    section = fidelity.section
    cost, fixed = search.study_seconds()
    given_error = search.given_error()
    chosen = choose(search.tried, given_error, cost, fidelity.tolerance, section.budget, fixed)
    for name, settings in search.tried.items():
        chosen = chosen.with_untried(search.ladders[name], [t.label for t in settings])
    return chosen.with_changes(search.always).with_failures(fidelity.failed)


class RunSearch:
    """Settings tried at the pilots of a study, ladder by ladder, each from the cheapest rung up.

    A ladder is tried with the rungs chosen of the others so far. Errors of ladders add up.
    """

    def __init__(self, fidelity: FidelityStudy) -> None:
        self.fidelity = fidelity
        self.ladders = free_ladders(fidelity.study)
        self.share = SETTING_TOLERANCE_SHARE * fidelity.tolerance
        self.tried: dict[str, list[TriedSetting]] = {}
        self.kept: dict[str, TriedSetting] = {}
        self.always = _settled(fidelity)
        if fidelity.study.section.pod_vectors:
            self.always |= training_step(fidelity.study)
        self.now: dict[str, Any] = dict(QUIET) | dict(self.always)
        if STEP in self.ladders:
            rungs = self.ladders[STEP]
            self.now |= rungs[min(TRIAL_STEP, len(rungs) - 1)].changes
        for name in (CONTACT, SLOPE):
            if name in self.ladders:
                self.now |= self.ladders[name][0].changes
        candidates = interior_pilots(fidelity.plan, fidelity.section.pilots + N_RESERVE_PILOTS)
        self.points = fidelity.pilots(self.now, candidates)

    def measure(self, changes: Mapping[str, Any]) -> Measurement:
        """Measure the pilots with `changes` to the present settings."""
        return self.fidelity.measure({**self.now, **changes}, self.points)

    def try_bases(self, ladder: Ladder) -> None:
        """Try smaller bases against all modes, until one is within its share of the tolerance."""
        *smaller_bases, full_basis = ladder
        truth = self.measure({})
        settings = []
        for rung in smaller_bases:
            measurement = self.measure(rung.changes)
            error = self.fidelity.error(measurement, truth)
            settings.append(TriedSetting(rung.label, rung.changes, error, measurement.seconds))
            if error <= self.share:
                break
        settings.append(TriedSetting(full_basis.label, full_basis.changes, 0.0, truth.seconds))
        self._keep(BASIS, settings)

    def try_contact_points(self, ladder: Ladder) -> None:
        """Try more and more contact points; the error of a rung is the change to the next."""
        self._keep(CONTACT, self._refined(ladder, 1.0))

    def try_slopes(self, ladder: Ladder) -> None:
        """Try stiffer friction until the change to twice the slope is within its share.

        Where the step is too long for the slope, sticking points ring; the change includes that.
        """
        self._keep(SLOPE, self._refined(ladder, FIRST_ORDER_FACTOR))

    def try_steps(self, ladder: Ladder) -> None:
        """Halve the step until the extrapolated change to the next is within its share.

        It begins with twice the step of the trials; longer ones are tried where that pays.
        """
        position = max(0, min(TRIAL_STEP, len(ladder) - 1) - 1)
        settings = self._refined(ladder[position:], RICHARDSON_FACTOR)
        while (
            position > 0
            and settings[0].error <= self.share
            and self._pays(ladder[position].changes)
        ):
            position -= 1
            longer, shorter = (self.measure(ladder[k].changes) for k in (position, position + 1))
            error = RICHARDSON_FACTOR * self.fidelity.error(longer, shorter)
            settings.insert(
                0,
                TriedSetting(
                    ladder[position].label, ladder[position].changes, error, longer.seconds
                ),
            )
        self._keep(STEP, settings)

    def _pays(self, changes: Mapping[str, Any]) -> bool:
        """Whether a trial of twice the step may save the study enough for its own cost."""
        measurement = self.measure(changes)
        study = measurement.seconds * len(self.fidelity.plan.tasks) / self.fidelity.jobs
        trial = measurement.seconds * len(self.points) + measurement.setup_seconds
        return pays(study, trial)

    def _refined(self, ladder: Ladder, factor: float) -> list[TriedSetting]:
        """Rungs up to the first whose change to the next is within its share, and that next one.

        The error of the last rung tried is estimated as a quarter of that of the rung before it.
        """
        settings: list[TriedSetting] = []
        coarse = self.measure(ladder[0].changes)
        for rung, finer in pairwise(ladder):
            fine = self.measure(finer.changes)
            error = factor * self.fidelity.error(coarse, fine)
            settings.append(TriedSetting(rung.label, rung.changes, error, coarse.seconds))
            coarse = fine
            if error <= self.share:
                break
        return [*settings, TriedSetting(finer.label, finer.changes, error / 4, coarse.seconds)]

    def _keep(self, name: str, tried_settings: list[TriedSetting]) -> None:
        """Continue with the cheapest rung of a ladder within its share, else with the best."""
        # costs are not finite where no pilot ran
        tried_settings = [t for t in tried_settings if np.isfinite(t.cost)]
        self.tried[name] = tried_settings
        good = [t for t in tried_settings if t.error <= self.share]
        best = (
            min(good, key=lambda t: t.cost) if good else min(tried_settings, key=lambda t: t.error)
        )
        self.kept[name] = best
        self.now |= best.changes

    def given_error(self) -> float:
        """Error of given settings: a step against half of it, a basis against all modes.

        The error of levels where runs end early is added. Contact points and mesh of the file are
        taken as the model itself, without an error.
        """
        section, error = self.fidelity.study.section, self.settled_error()
        if STEP not in self.ladders:
            half = self.measure({"transient.step": 0.5 * section.step})
            error += RICHARDSON_FACTOR * self.fidelity.error(self.measure({}), half)
        if BASIS not in self.ladders and section.modes_below is not None:
            error += self.fidelity.error(self.measure({}), self.measure(ALL_MODES))
        return error

    def settled_error(self) -> float:
        """Relative error of levels where runs end once settled; 0 where they do not end early."""
        section = self.fidelity.study.section
        if self.always.get("transient.stop", section.stop) != "settled":
            return 0.0
        return float(self.always.get("transient.settle_tolerance", section.settle_tolerance))

    def study_seconds(self) -> tuple[float, float]:
        """Seconds of all points with the first rung of each ladder, and seconds they share."""
        measurement = self.measure({})
        cost = measurement.seconds * len(self.fidelity.plan.tasks) / self.fidelity.jobs
        for name, best in self.kept.items():
            cost *= self.tried[name][0].cost / best.cost if best.cost > 0 else 1.0
        return cost, measurement.reduction_seconds + measurement.setup_seconds


def interior_pilots(plan: Plan, count: int) -> list[int]:
    """Numbers of the design points nearest to places inside the swept box, at no training runs.

    The first is in the upper half of the box, where more modes squeal.
    """
    X = plan.coordinates
    if not X.shape[1]:
        return list(range(min(count, len(X))))
    span = np.ptp(X, axis=0)
    X = (X - X.min(axis=0)) / np.where(span > 0, span, 1.0)
    chosen: list[int] = []
    for share in (0.75, 0.4, 0.9, 0.55, 0.65, 0.25, 0.85, 0.5):
        order = np.argsort(np.abs(X - share).max(axis=1), kind="stable")
        chosen += [int(i) for i in order if i not in chosen][:1]
    chosen += [i for i in range(len(X)) if i not in chosen]
    return chosen[:count]


def _settled(fidelity: FidelityStudy) -> dict[str, Any]:
    """Settings by which modal runs end once settled, where the file does not say when they end."""
    modal = fidelity.study.section.representation == "modal"
    if not modal or "transient.stop" in given_keys(fidelity.study):
        return {}
    certain = (
        {}
        if "transient.settle_tolerance" in given_keys(fidelity.study)
        else {
            "transient.settle_tolerance": min(
                SETTLED_LEVEL_HALF_WIDTH, SETTLED_SHARE * fidelity.tolerance
            )
        }
    )
    return {"transient.stop": "settled", **certain}
