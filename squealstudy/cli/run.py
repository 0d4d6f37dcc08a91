"""What `squealstudy run` prints: findings, then what was done and where everything is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy.screen import Rows
from squealstudy.tables.validity import outside_validity
from squealstudy.wording import failure_counts, plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


def summary(results: Results, drawn: list[Path]) -> Rows:
    """What a run did, how accurate it is, and where tables and pictures are."""
    manifest, directory = results.manifest, results.directory
    solved, total = results.solved or 0, manifest["n_points"]
    failed = ""
    if lost := manifest["n_failed"] + manifest.get("n_inaccurate", 0):
        rows = results.table(results.tables[0])["status"]
        failed = f", {lost} not ok ({failure_counts(rows)}; see message in {results.tables[0]})"
    counts = f"{total}: {solved} solved now, {total - solved} found in {directory}{failed}"
    return [
        (f"{results.screen.row_word}s", counts),
        *(
            []
            if solved
            else [("nothing to do", f"all {results.screen.row_word}s were there already")]
        ),
        ("time", f"{manifest['timings']['total_s']:.1f} s{_of_run(solved, total)}"),
        *fidelity(manifest.get("fidelity")),
        *results.screen.facts(results),
        ("tables", _files_text(directory, [f"{name}.parquet" for name in results.tables])),
        *([("pictures", _files_text(directory, [path.name for path in drawn]))] if drawn else []),
    ]


def _of_run(solved: int, total: int) -> str:
    """Which run a time is of, where it did not solve everything."""
    if solved == total:
        return ""
    return ", without what earlier runs solved" if solved else " in the run that wrote the tables"


def _files_text(directory: Path, names: list[str]) -> str:
    return f"in {directory}: {', '.join(names)}"


def outside(results: Results, head: str = "") -> list[str]:
    """A line on design points outside validity, where there are any."""
    if "points" not in results.tables:
        return []
    text = outside_validity(results.points, head)
    return [text] if text else []


def fidelity(found: Mapping[str, Any] | None) -> Rows:
    """The settings that [fidelity] chose, their neighbours and the audit; nothing without one."""
    if found is None:
        return []
    rows = [("fidelity", f"{_choice(found['chosen'])}: {found['reason']}")]
    rows += [(f"  next {name}", _choice(found[name])) for name in ("cheaper", "dearer")]
    audit = found.get("audit")
    if audit is not None and audit["error"] is not None:
        verdict = "passed" if audit["passed"] else "MISSED"
        points = plural(len(audit["points"]), "random point")
        text = f"{verdict}: error {audit['error']:.1e} of {found['tolerance']:g} allowed, at "
        rows.append(("  audit", f"{text}{points} against {audit['against']}"))
    return rows


def _choice(one: Mapping[str, Any]) -> str:
    seconds = one["seconds"]
    if seconds is None:
        return f"{one['settings']}: {one['reason']}" if one["settings"] else str(one["reason"])
    time = f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.3g} min"
    return f"{one['settings']}; estimated error {one['estimated_error']:.1e}, about {time}"
