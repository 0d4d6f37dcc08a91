"""What `squealstudy run` prints below its findings: how sure they are, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from squealstudy.screen import Rows, facts, heading
from squealstudy.tables.validity import outside_validity
from squealstudy.wording import failure_counts, plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MAX_NAMED_PICTURES = 3  # most pictures of one plot whose file names are all printed


def blocks(results: Results, drawn: list[Path], verbose: bool = False) -> list[RenderableType]:
    """Blocks below the findings: how sure they are, what next, and if `verbose` what was done."""
    manifest, kind = results.manifest, results.screen
    rows_by_block = _by_block(results)
    files = [("tables", _files_text(results.directory, [f"{n}.parquet" for n in results.tables]))]
    if drawn:
        files.append(("pictures", _files_text(results.directory, _by_plot(drawn))))
    solved, total = results.solved or 0, manifest["n_points"]
    time = f"{manifest['timings']['total_s']:.1f} s{_run_of_time(solved, total)}"
    done = [("time", time), *rows_by_block[""]]
    shown: list[RenderableType] = [
        "",
        heading("How sure"),
        facts(
            [
                (f"{kind.row_word}s", _counts(results)),
                *[("validity", text) for text in outside(results)],
                *fidelity(manifest.get("fidelity")),
                *rows_by_block["sure"],
            ]
        ),
        "",
        heading("What next"),
        facts([*kind.next_steps(results), *files]),
    ]
    if rows_by_block["found"]:
        shown = ["", facts(rows_by_block["found"]), *shown]
    return [*shown, "", heading("What was done"), facts(done)] if verbose else shown


def _by_block(results: Results) -> dict[str, Rows]:
    """The facts of results by the block that shows them; "" has facts for `verbose` alone.

    A fact whose name is empty or begins with a blank belongs to the one before it.
    """
    kind, block = results.screen, ""
    rows: dict[str, Rows] = {"found": [], "sure": [], "": []}
    for name, text in kind.facts(results):
        if name and not name.startswith(" "):
            block = "found" if name in kind.found else "sure" if name in kind.sure else ""
        rows[block].append((name, text))
    return rows


def _counts(results: Results) -> str:
    """Text on how many design points were solved now, by earlier runs, or not."""
    manifest = results.manifest
    solved, total = results.solved or 0, manifest["n_points"]
    lost = manifest["n_failed"] + manifest.get("n_inaccurate", 0)
    if not solved:
        text = f"{total}: all were there already, nothing to do"
    elif solved < total:
        text = f"{total}: {solved} solved now, {total - solved} found in {results.directory}"
    else:
        text = f"{total}: {total - lost} solved" if lost else f"{total} solved"
    if lost:
        rows = results.table(results.tables[0])["status"]
        text += f", {lost} not ok ({failure_counts(rows)}; see message in {results.tables[0]})"
    return text


def _run_of_time(solved: int, total: int) -> str:
    """Text on the run that a time belongs to; empty if it solved everything."""
    if solved == total:
        return ""
    return ", without what earlier runs solved" if solved else " in the run that wrote the tables"


def _files_text(directory: Path, names: list[str]) -> str:
    return f"in {directory}: {', '.join(names)}"


def _by_plot(drawn: list[Path]) -> list[str]:
    """Names of pictures; many pictures of one plot become ``spectrogram_*.png (9)``."""
    from squealstudy.engine.pictures import plots  # with pandas: `check` needs none

    by_plot: dict[str, list[str]] = {}
    for path in drawn:
        fitting = [name for name in plots() if path.name.startswith(name)]
        by_plot.setdefault(max(fitting, key=len, default=path.stem), []).append(path.name)
    return [
        text
        for plot, names in by_plot.items()
        for text in (
            names if len(names) <= MAX_NAMED_PICTURES else [f"{plot}_*.png ({len(names)})"]
        )
    ]


def outside(results: Results, head: str = "") -> list[str]:
    """A line on design points outside the assumptions of the model; empty without such points."""
    if "points" not in results.tables:
        return []
    text = outside_validity(results.points, head)
    return [text] if text else []


def fidelity(fidelity_facts: Mapping[str, Any] | None) -> Rows:
    """Rows on the settings that [fidelity] chose, the next cheaper and dearer, and the audit."""
    if fidelity_facts is None:
        return []
    rows = [("fidelity", f"{_choice(fidelity_facts['chosen'])}: {fidelity_facts['reason']}")]
    rows += [(f"  next {name}", _choice(fidelity_facts[name])) for name in ("cheaper", "dearer")]
    audit = fidelity_facts.get("audit")
    if audit is not None and audit["error"] is not None:
        verdict = "passed" if audit["passed"] else "MISSED"
        points = plural(len(audit["points"]), "random point")
        text = (
            f"{verdict}: error {_error(audit['error'])} of {fidelity_facts['tolerance']:g} "
            "allowed, at "
        )
        rows.append(("  audit", f"{text}{points} against {audit['against']}"))
    return rows


def _error(relative: float) -> str:
    """Text of a relative error in two digits; "0" for zero."""
    return f"{relative:.1e}" if relative else "0"


def _choice(setting: Mapping[str, Any]) -> str:
    """Text of settings with their estimated error and time, or why they were not chosen."""
    seconds = setting["seconds"]
    if seconds is None:
        return (
            f"{setting['settings']}: {setting['reason']}"
            if setting["settings"]
            else str(setting["reason"])
        )
    time = f"{seconds:.3g} s" if seconds < 120 else f"{seconds / 60:.3g} min"
    return (
        f"{setting['settings']}; estimated error {_error(setting['estimated_error'])}, about {time}"
    )
