"""Running a study with a [fidelity] section: choose, run, audit, again where the audit fails."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import RunReport, run_study
from squealstudy.engine.store import write_manifest
from squealstudy.engine.workers import Progress
from squealstudy.fidelity.audit import Audit, audit, drawn_points
from squealstudy.fidelity.choice import Choice, Neighbour, Untried, kept_choice
from squealstudy.fidelity.frequency_search import search_modes
from squealstudy.fidelity.scene import Scene
from squealstudy.fidelity.time_search import search_runs
from squealstudy.study.definition import Study

MOST_ROUNDS = 3
FOLLOWING = ("transient.settle_tolerance",)


@dataclass(frozen=True)
class Resolved:
    """A study whose settings are chosen.

    Attributes
    ----------
    scene : Scene
    choice : Choice
    plan : Plan
        With the chosen settings.
    """

    scene: Scene
    choice: Choice
    plan: Plan

    @property
    def facts(self) -> dict[str, Any]:
        """For the manifest and the screens."""
        section = self.scene.section
        return {
            "tolerance": section.tolerance,
            "budget_s": section.budget,
            "reason": self.choice.reason,
            "chosen": _plain(self.choice.chosen),
            "cheaper": _plain(self.choice.cheaper),
            "dearer": _plain(self.choice.dearer),
        }


def _plain(one: Neighbour) -> dict[str, Any]:
    if isinstance(one, Untried):
        reason = "not tried" if one.text else "there is none"
        unknown = {"estimated_error": None, "seconds": None}
        return {"settings": one.text or None, **unknown, "reason": reason}
    return {
        "settings": one.text,
        "changes": dict(one.changes),
        "estimated_error": one.error,
        "seconds": one.cost,
    }


def resolve(study: Study, jobs: int, report: Progress, tolerance: float | None = None) -> Resolved:
    """Choose the settings of a study, by pilot runs or as an earlier call chose them.

    Raises
    ------
    SquealstudyError
        Where every pilot design point fails.
    """
    scene = Scene(study, jobs, report, asked=tolerance)
    search = search_runs if scene.in_time else search_modes
    choice = kept_choice(scene, lambda: search(scene))
    return Resolved(scene, choice, scene.variant(choice.chosen.changes, None))


def run_resolved(
    resolved: Resolved,
    directory: Path,
    yes: bool,
    report: Progress,
    warn: Callable[[str], None],
) -> RunReport:
    """Run the study with its chosen settings and audit it, more strictly where that fails.

    The manifest says what was chosen and what the audit found; a tolerance that is missed after
    the last round is said there and in a warning.
    """
    scene = resolved.scene
    asked = scene.section.tolerance
    doubtful: set[int] = set()
    errors: list[float | None] = []
    for number in range(MOST_ROUNDS):
        done = run_study(resolved.plan, directory, scene.jobs, yes, report, warn)
        changes = resolved.choice.chosen.changes
        points = sorted(doubtful | set(drawn_points(scene, number)))
        found = audit(scene, resolved.plan, directory, changes, points)
        errors.append(found.error)
        doubtful |= set(found.points)  # once audited, always: another draw must not hide an error
        passed = found.error is None or found.error <= asked
        audited = _audited(found, passed) | {"errors_of_rounds": errors}
        facts = resolved.facts | {"audit": audited, "rounds": number + 1}
        manifest = done.manifest | {"fidelity": facts}
        write_manifest(directory, manifest)
        if passed or number + 1 == MOST_ROUNDS:
            break
        stricter = 0.5 * resolved.scene.tolerance * asked / max(found.error or asked, asked)
        again = resolve(scene.study, scene.jobs, report, stricter)
        if _deciding(again.choice) == _deciding(resolved.choice):
            break
        warn(
            f"fidelity: the audit found an error of {found.error:.1e}, more than {asked:g}: once "
            f"more with {again.choice.chosen.text}"
        )
        resolved = again
    if not passed:
        warn(f"fidelity: the audit found an error of {found.error:.1e}, more than {asked:g}")
    return RunReport(done.directory, manifest, done.n_solved, done.n_reused)


def _deciding(choice: Choice) -> dict[str, Any]:
    """Settings without the tolerances that follow the one asked for."""
    return {k: v for k, v in choice.chosen.changes.items() if k not in FOLLOWING}


def _audited(found: Audit, passed: bool) -> dict[str, Any]:
    return {
        "error": found.error,
        "points": list(found.points),
        "against": found.against,
        "passed": passed if found.error is not None else None,
    }
