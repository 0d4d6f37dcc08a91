"""Run a study with a [fidelity] section: choose settings, run, audit, and repeat if that fails.

The audit solves random points of the finished study once more, with better settings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.engine.manifest_file import write_manifest
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import RunReport, run_study
from squealstudy.engine.store import Store
from squealstudy.engine.workers import Progress
from squealstudy.fidelity.choice import Choice, Neighbour, UntriedSetting, kept_choice
from squealstudy.fidelity.frequency_search import exact_method, search_modes
from squealstudy.fidelity.ladders import BASIS, free_ladders
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.fidelity.time_search import ALL_MODES, QUIET, search_runs
from squealstudy.modes.rungs import rung_named
from squealstudy.study.definition import ResolvedStudy

if TYPE_CHECKING:
    from squealstudy.engine.cluster import Cluster

MOST_ROUNDS = 3  # runs with their audits
AUDIT_SEED = 5  # random seed of the points that are audited
FOLLOWING = ("transient.settle_tolerance",)  # keys whose values are shares of the tolerance


@dataclass(frozen=True)
class Resolved:
    """A study whose settings are chosen.

    Attributes
    ----------
    fidelity : FidelityStudy
    choice : Choice
    plan : Plan
        Plan of the study with the chosen settings.
    """

    fidelity: FidelityStudy
    choice: Choice
    plan: Plan

    @property
    def facts(self) -> dict[str, Any]:
        """The choice in plain values, for the manifest and the screens."""
        section = self.fidelity.section
        return {
            "tolerance": section.tolerance,
            "budget_s": section.budget,
            "reason": self.choice.reason,
            "chosen": _plain(self.choice.chosen),
            "cheaper": _plain(self.choice.cheaper),
            "dearer": _plain(self.choice.dearer),
        }


def _plain(neighbour: Neighbour) -> dict[str, Any]:
    """A neighbour of the chosen setting as plain values, for the manifest."""
    if isinstance(neighbour, UntriedSetting):
        reason = "not tried" if neighbour.text else "there is none"
        unknown = {"estimated_error": None, "seconds": None}
        return {"settings": neighbour.text or None, **unknown, "reason": reason}
    return {
        "settings": neighbour.text,
        "changes": dict(neighbour.changes),
        "estimated_error": neighbour.error,
        "seconds": neighbour.cost,
    }


def resolve(
    study: ResolvedStudy,
    jobs: int,
    report: Progress,
    tolerance: float | None = None,
    cluster: Cluster | None = None,
) -> Resolved:
    """Choose the settings of a study by pilot runs, or read those that an earlier call chose.

    Raises
    ------
    SquealstudyError
        Every pilot design point fails.
    """
    fidelity = FidelityStudy(study, jobs, report, asked=tolerance, cluster=cluster)
    search = search_runs if fidelity.in_time else search_modes
    choice = kept_choice(fidelity, lambda: search(fidelity))
    return Resolved(fidelity, choice, fidelity.variant(choice.chosen.changes, None))


def run_resolved(
    resolved: Resolved,
    directory: Path,
    yes: bool,
    report: Progress,
    warn: Callable[[str], None],
    fresh: bool = False,
) -> RunReport:
    """Run the study with its chosen settings and audit it; where that fails, choose more strictly.

    The manifest has the choice and the result of the audit. If the tolerance is still missed after
    the last round, the manifest and a warning say so.
    """
    fidelity = resolved.fidelity
    tolerance = fidelity.section.tolerance
    doubtful: set[int] = set()
    errors: list[float | None] = []
    for number in range(MOST_ROUNDS):
        done = run_study(
            resolved.plan,
            directory,
            fidelity.jobs,
            yes,
            report,
            warn,
            fresh and not number,
            fidelity.cluster,
        )
        changes = resolved.choice.chosen.changes
        points = sorted(doubtful | set(drawn_points(fidelity, number)))
        outcome = audit(fidelity, resolved.plan, directory, changes, points)
        errors.append(outcome.error)
        doubtful |= set(
            outcome.points
        )  # audited in all further rounds too, so that no draw hides an error
        passed = outcome.error is None or outcome.error <= tolerance
        audited = _audited(outcome, passed) | {"errors_of_rounds": errors}
        facts = resolved.facts | {"audit": audited, "rounds": number + 1}
        manifest = done.manifest | {"fidelity": facts}
        write_manifest(directory, manifest)
        if passed or number + 1 == MOST_ROUNDS:
            break
        half = 0.5 * resolved.fidelity.tolerance
        stricter = half * tolerance / max(outcome.error or tolerance, tolerance)
        again = resolve(fidelity.study, fidelity.jobs, report, stricter, fidelity.cluster)
        if _deciding(again.choice) == _deciding(resolved.choice):
            break
        warn(
            f"fidelity: the audit found an error of {outcome.error:.1e}, more than {tolerance:g}: "
            f"once more with {again.choice.chosen.text}"
        )
        resolved = again
    if not passed:
        warn(f"fidelity: the audit found an error of {outcome.error:.1e}, more than {tolerance:g}")
    return RunReport(done.directory, manifest, done.n_solved, done.n_reused)


def _deciding(choice: Choice) -> dict[str, Any]:
    """The chosen settings without those that are shares of the tolerance."""
    return {k: v for k, v in choice.chosen.changes.items() if k not in FOLLOWING}


def _audited(audit: Audit, passed: bool) -> dict[str, Any]:
    return {
        "error": audit.error,
        "points": list(audit.points),
        "against": audit.against,
        "passed": passed if audit.error is not None else None,
    }


@dataclass(frozen=True)
class Audit:
    """Errors that the audit of a finished study found, and at which points.

    Attributes
    ----------
    error : float or None
        Largest error; None where no point could be audited.
    points : tuple of int
        Numbers of the audited points among the study's design points.
    against : str
        Better settings of the audit, in words.
    """

    error: float | None
    points: tuple[int, ...]
    against: str


def drawn_points(fidelity: FidelityStudy, round_: int) -> tuple[int, ...]:
    """Numbers of random design points, different ones in each round."""
    count = min(fidelity.section.audit, len(fidelity.plan.tasks))
    rng = np.random.default_rng([AUDIT_SEED, round_])
    return tuple(int(i) for i in rng.permutation(len(fidelity.plan.tasks))[:count])


def audit(
    fidelity: FidelityStudy,
    plan: Plan,
    directory: Path,
    changes: Mapping[str, Any],
    points: Sequence[int],
) -> Audit:
    """Compare the study's own rows at some points with results of better settings.

    Complex modes are compared with exact solves, of a meshed brake at full order. Runs are compared
    with those of half the step, the next rungs of contact points and slope, and all modes. Points
    that failed are left out.
    """
    better, against = _better(fidelity, changes)
    own_findings = _own_findings(fidelity, plan, directory, points)
    usable = [i for i in points if own_findings[i]["status"] == "ok"]
    if not usable:
        return Audit(None, (), against)
    quiet = QUIET if fidelity.in_time else {}
    truth = fidelity.measure({**changes, **better, **quiet}, usable).findings
    pairs = [(i, truth[str(n)]) for n, i in enumerate(usable)]
    judged = [(i, true) for i, true in pairs if true["status"] == "ok"]
    if not judged:
        return Audit(None, (), against)
    error = max(fidelity.point_error(own_findings[i], true) for i, true in judged)
    return Audit(error, tuple(i for i, _ in judged), against)


def _own_findings(
    fidelity: FidelityStudy, plan: Plan, directory: Path, points: Sequence[int]
) -> dict[int, dict[str, Any]]:
    """Findings of the finished study at some of its points."""
    ids = {i: plan.tasks[i].point_id for i in points}
    schema = plan.kind.schema
    rows = Store(directory).rows(ids.values(), schema)
    read = fidelity.measuring.finding
    return {i: read(rows[name]) for i, name in ids.items()}


def _better(fidelity: FidelityStudy, changes: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Settings that are better than the chosen ones, as changes and in words."""
    if not fidelity.in_time:
        exact = exact_method(fidelity.study)
        words = "the full-order model" if rung_named(exact).unreduced else "exact solves"
        return {"modes.method": exact}, words
    better: dict[str, Any] = {}
    words_of = []
    for name, ladder in free_ladders(fidelity.study).items():
        keys = {key for rung in ladder for key in rung.changes}
        chosen_here = {k: changes[k] for k in keys if k in changes}
        if name == BASIS:
            better |= ALL_MODES if chosen_here else {}
            words_of += ["all modes"] if chosen_here else []
            continue
        position = [dict(r.changes) for r in ladder].index(chosen_here)
        if position + 1 < len(ladder):
            better |= ladder[position + 1].changes
            words_of.append(ladder[position + 1].label)
    if "transient.step" not in better:  # given by the file, or the last rung
        step = 0.5 * float(changes.get("transient.step", fidelity.study.section.step))
        better["transient.step"] = step
        words_of.append(f"step {step:.3g} s")
    return better, ", ".join(words_of)
