"""The cheapest combination of tried settings that meets a tolerance, stored for the next run."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import TypeAdapter

from squealstudy.engine.keys import NUMERIC_PACKAGES, content_hash, source_hash
from squealstudy.fidelity.ladders import Setting
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.files import OF_JSON, read_whole, sealed, unsealed, write_text
from squealstudy.paths import cache_directory

CODE = (*NUMERIC_PACKAGES, "study", "engine", "kinds", "fidelity")
MIN_GAIN_OVER_COST = 2.0  # largest possible saving by a trial over its cost, from which it is made
NEXT_RUNG_MAX_SAVING = (
    0.5  # largest possible saving by the next cheaper rung, over the points' cost
)


class TriedSetting(NamedTuple):
    """A rung with its error and cost, as measured at the pilots.

    Attributes
    ----------
    label : str
    changes : mapping
        Dotted key -> value.
    error : float
        Estimated error that the rung adds, relative.
    cost : float
        Seconds of a point or of the whole study, with the other ladders' rungs at the time; ratios
        within a ladder count.
    """

    label: str
    changes: Mapping[str, Any]
    error: float
    cost: float


@dataclass(frozen=True)
class Combination:
    """One rung of every ladder, with their added errors and the seconds of the whole study."""

    labels: tuple[str, ...]
    changes: Mapping[str, Any]
    error: float
    cost: float

    @property
    def text(self) -> str:
        """The combination in words, for screens and the manifest."""
        return ", ".join(self.labels) or "no setting is free to choose"


@dataclass(frozen=True)
class UntriedSetting:
    """A neighbour of the chosen setting whose error and cost are not known.

    Attributes
    ----------
    text : str
        Label of the setting; empty where there is no other setting.
    """

    text: str = ""


Neighbour = Combination | UntriedSetting


@dataclass(frozen=True)
class Choice:
    """The chosen settings, and their neighbours on the front of error against cost.

    Attributes
    ----------
    chosen : Combination
    cheaper, dearer : Combination or UntriedSetting
    reason : str
        Reason of the choice: the tolerance is met, or what prevents it.
    """

    chosen: Combination
    cheaper: Neighbour
    dearer: Neighbour
    reason: str

    def with_changes(self, always: Mapping[str, Any]) -> Choice:
        """The choice with settings added that all combinations share."""
        return replace(self, chosen=replace(self.chosen, changes={**always, **self.chosen.changes}))

    def with_untried(self, ladder: Sequence[Setting], tried: Collection[str]) -> Choice:
        """The choice with untried rungs of a ladder in place of missing neighbours."""
        labels = [rung.label for rung in ladder]
        positions = [labels.index(label) for label in tried]
        below, above = min(positions) - 1, max(positions) + 1
        cheaper, dearer = self.cheaper, self.dearer
        if cheaper == UntriedSetting() and below >= 0:
            cheaper = UntriedSetting(labels[below])
        if dearer == UntriedSetting() and above < len(labels):
            dearer = UntriedSetting(labels[above])
        return replace(self, cheaper=cheaper, dearer=dearer)

    def with_failures(self, failed: Collection[int]) -> Choice:
        """The choice with a reason that also says how many design points could be no pilots."""
        if not failed:
            return self
        words = "a design point" if len(failed) == 1 else f"{len(failed)} design points"
        return replace(self, reason=f"{self.reason}; {words} failed and could be no pilot")


def choose(
    tried: Mapping[str, Sequence[TriedSetting]],
    base_error: float,
    base_cost: float,
    tolerance: float,
    budget: float | None,
    fixed: float = 0.0,
) -> Choice:
    """Choose the cheapest combination of rungs that meets the tolerance within the budget.

    Errors of rungs add up, and costs multiply. If no combination does, the most accurate within the
    budget is chosen, or the cheapest one.

    Parameters
    ----------
    tried : mapping of ladder -> rungs tried
        The costs in a ladder count relative to that of its first rung.
    base_error, base_cost : float
        Error that all combinations have in addition; seconds of the study with the first rungs.
    tolerance : float
    budget : float or None
        Seconds.
    fixed : float
        Seconds that no rung changes, in addition to `base_cost`.
    """
    front = _front(_combinations(tried, base_error, base_cost, fixed))
    affordable = [c for c in front if budget is None or c.cost <= budget]
    within_tolerance = [c for c in affordable if c.error <= tolerance]
    if within_tolerance:
        chosen, reason = min(within_tolerance, key=lambda c: c.cost), "meets the tolerance"
    elif affordable:
        chosen = min(affordable, key=lambda c: c.error)
        if any(c.error <= tolerance for c in front):
            reason = f"the budget buys an error of {chosen.error:.1e}, not {tolerance:g}"
        else:
            reason = f"no setting tried meets the tolerance of {tolerance:g}: this errs least"
            reason += "" if budget is None else " within the budget"
    else:
        chosen = min(front, key=lambda c: c.cost)
        reason = f"the budget of {budget:g} s buys not even the cheapest setting"
    position = front.index(chosen)
    cheaper = front[position - 1] if position > 0 else UntriedSetting()
    dearer = front[position + 1] if position + 1 < len(front) else UntriedSetting()
    return Choice(chosen, cheaper, dearer, reason)


def pays(points: float, trial: float) -> bool:
    """Whether a cheaper setting is worth a trial.

    Parameters
    ----------
    points : float
        Seconds of the study's points with the present setting, of which it may save a share.
    trial : float
        Seconds that the trial takes.
    """
    return NEXT_RUNG_MAX_SAVING * points > MIN_GAIN_OVER_COST * trial


def _combinations(
    tried: Mapping[str, Sequence[TriedSetting]], base_error: float, base_cost: float, fixed: float
) -> list[Combination]:
    """All combinations of the tried settings, with the sum of their errors and their cost."""
    combinations = []
    for rungs in itertools.product(*tried.values()):
        cost = base_cost
        for rung, ladder in zip(rungs, tried.values(), strict=True):
            cost *= rung.cost / ladder[0].cost if ladder[0].cost > 0 else 1.0
        changes: dict[str, Any] = {}
        for rung in rungs:
            changes |= rung.changes
        error = base_error + sum(rung.error for rung in rungs)
        labels = tuple(r.label for r in rungs if r.label)
        combinations.append(Combination(labels, changes, error, fixed + cost))
    return combinations


def _front(combinations: Sequence[Combination]) -> list[Combination]:
    """Combinations that no other one beats in both error and cost, the cheapest first."""
    front: list[Combination] = []
    for candidate in sorted(combinations, key=lambda c: (c.cost, c.error)):
        if not front or candidate.error < front[-1].error:
            front.append(candidate)
    return front


_CHOICE = TypeAdapter(Choice)


def kept_choice(fidelity: FidelityStudy, make: Callable[[], Choice]) -> Choice:
    """The choice of a study, read if an earlier run stored it, else made and stored."""
    path = _path(fidelity)
    if path.is_file():
        with contextlib.suppress(ValueError):  # damaged: the choice is made again
            return _CHOICE.validate_python(unsealed(read_whole(path, OF_JSON)))
    choice = make()
    write_text(path, sealed(_CHOICE.dump_python(choice, mode="json")))
    return choice


def _path(fidelity: FidelityStudy) -> Path:
    """File of the cache that stores the choice for a study."""
    ids = [
        task.point_id for task in fidelity.plan.tasks
    ]  # ids depend on files and start states too
    content = [
        source_hash(CODE),
        fidelity.study.source.tables,
        ids,
        fidelity.tolerance,
        fidelity.jobs,
    ]
    return cache_directory() / "fidelity" / f"{content_hash(content)}.json"
