"""Results as one page of HTML that needs no other file, to hand on or to print.

It shows what screens, tables, pictures and the manifest have. Only a shape is computed for it.
"""

from __future__ import annotations

import tomllib
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.table import Table
from rich.text import Text

from squealstudy.engine.manifest import FINISHED_AT, SIDE_STUDIES
from squealstudy.engine.mode_shapes import plan_of
from squealstudy.engine.plan import has_mesh
from squealstudy.engine.report_pictures import figure_of, report_pictures
from squealstudy.engine.report_squeals import squeal_text
from squealstudy.errors import SquealstudyError
from squealstudy.files import write_text
from squealstudy.models.matrices.files import READERS
from squealstudy.screen import as_text
from squealstudy.shapes.page import page as shape_page
from squealstudy.shapes.picture import draw, sources, title
from squealstudy.shown_units import as_written
from squealstudy.study.units import TEMPERATURE
from squealstudy.tables.validity import outside_validity, said_first
from squealstudy.wording import duration, failure_counts, plural

if TYPE_CHECKING:
    from rich.console import RenderableType

    from squealstudy.engine.results import Results

TEMPLATE = Path(__file__).with_name("report.html")
MOST_ROWS = 200  # most rows of a table that are shown; the others are in its file
MOST_BYTES = 9_000_000  # most bytes of all pictures and shapes of a page
TABLE_DIGITS = 6  # significant digits of numbers in tables
SHAPE_DPI = 75  # dots per inch of the picture of a shape
# endings of files that a study can name
READ = (".toml", ".py", ".csv", *(ending for endings in READERS for ending in endings))


def write_report(results: Sequence[Results], path: Path, shapes: bool = True) -> None:
    """Write the page of one or more results; OSError where it cannot be written."""
    write_text(path, report(results, shapes))


def report(results: Sequence[Results], shapes: bool = True) -> str:
    """The page: for each study its verdict first, then the grounds for it.

    Parameters
    ----------
    results : sequence of Results
        Results whose tables and pictures are shown; pictures beyond MOST_BYTES are only named. Each
        is followed by results of the studies that were run with it.
    shapes : bool
        Whether the fastest growing mode, or the end of the loudest run, of a model with a mesh is
        shown in motion, for which the design point is solved again.
    """
    results = [*_with_beside(results)]
    bytes_left = MOST_BYTES
    parts = [_overview(results)] if len(results) > 1 else []
    for number, results_of_study in enumerate(results, start=1):
        shown = _shape(results_of_study) if shapes else []
        bytes_left -= sum(map(len, shown))
        drawn, spent = report_pictures(results_of_study, bytes_left)
        bytes_left -= spent
        parts += [
            f'<section id="r{number}">',
            *_head(results_of_study, results),
            *drawn[:1],  # the picture of the question
            *_findings(results_of_study),
            *shown,
            *(["<h2>Pictures</h2>", *drawn[1:]] if drawn[1:] else []),
            *_tables(results_of_study),
            *_errors(results_of_study),
            *_provenance(results_of_study),
            "</section>",
        ]
    heading = ", ".join(str(results_of_study.manifest["name"]) for results_of_study in results)
    page = TEMPLATE.read_text(encoding="utf-8").replace("{{title}}", escape(heading))
    return page.replace("{{body}}", "\n".join(parts))


def _with_beside(results: Sequence[Results]) -> Iterator[Results]:
    """The results, each followed by those of the studies that were run with it."""
    for study_results in results:
        yield study_results
        for folder, reason in study_results.manifest.get(SIDE_STUDIES, {}).items():
            if not reason:
                yield type(study_results).open(study_results.directory / folder)


def _overview(results: Sequence[Results]) -> str:
    """HTML of the table of all results of a report."""
    rows = [
        [
            f'<a href="#r{n}">{escape(str(study_results.manifest["name"]))}</a>',
            *map(escape, _whose(study_results)),
        ]
        for n, study_results in enumerate(results, start=1)
    ]
    return "<h1>Overview</h1>" + _html_table(["study", "kind", "model", "verdict"], rows)


def _whose(results: Results) -> tuple[str, str, str]:
    texts = (_said_first(results), results.screen.verdict(results), _lost(results))
    verdict_text = " ".join(filter(None, texts))
    return str(results.kind), str(results.manifest["model"]), verdict_text


def _said_first(results: Results) -> str:
    """Sentences on doubts about the answers of a study."""
    return said_first(results.points) if "points" in results.tables else ""


def _lost(results: Results) -> str:
    """Sentence on how many design points of a study are not ok; empty where all are."""
    status = results.points["status"] if "points" in results.tables else pd.Series(dtype=str)
    lost = int((status != "ok").sum())
    if not lost:
        return ""
    verb = "is" if lost == 1 else "are"
    return f"{lost} of {plural(len(status), 'point')} {verb} not ok ({failure_counts(status)})."


def _head(results: Results, all_of_them: Sequence[Results]) -> Iterator[str]:
    """HTML of the title, question and verdict of one study."""
    kind, model, verdict_text = _whose(results)
    yield f"<h1>{escape(str(results.manifest['name']))}</h1>"
    yield f'<p class="question">{escape(_description(results))}</p>'
    yield f'<p class="verdict">{escape(verdict_text)}</p>'
    if squeal := squeal_text(results, all_of_them):
        yield f'<p class="squeal">{escape(squeal)}</p>'
    yield f'<p class="note">{escape(kind.replace("_", " "))} of {escape(model)}</p>'


def _description(results: Results) -> str:
    study = _study_tables(results).get("study")
    return str(study.get("description", "")) if isinstance(study, dict) else ""


def _study_tables(results: Results) -> dict[str, Any]:
    """Tables of the study file stored in results; {} where its text is no such file."""
    try:
        return tomllib.loads(str(results.manifest.get("study", "")))
    except (ValueError, RecursionError):
        return {}


def _findings(results: Results) -> Iterator[str]:
    """HTML of what the screen of the kind tells beyond the verdict."""
    verdict_text = results.screen.verdict(results)
    parts = [
        text
        for part in results.screen.findings(results)
        if part != verdict_text and (text := _html(part))
    ]
    if parts:
        yield from ("<h2>Findings</h2>", *parts)


def _html(part: RenderableType) -> str:
    """A part of a screen as HTML."""
    if isinstance(part, Table):
        titles = [str(column.header) for column in part.columns]
        cells = [[_plain(cell) for cell in column.cells] for column in part.columns]
        rows = [list(map(escape, row)) for row in zip(*cells, strict=True)]
        return _html_table(titles, rows)
    if isinstance(part, Text):
        return f'<p class="note">{escape(part.plain)}</p>' if part.plain else ""
    if isinstance(part, str):
        return f"<p>{escape(part)}</p>" if part else ""
    return f"<pre>{escape(as_text([part]))}</pre>"


def _plain(cell: Any) -> str:
    return cell.plain if isinstance(cell, Text) else str(cell)


def _html_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table that readers can sort; `rows` are cells of HTML."""
    sort = '<th scope="col"><button type="button">{}</button></th>'
    head = "".join(sort.format(escape(title)) for title in titles)
    body = "\n".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    inside = f"<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody>"
    return f'<div class="wide" tabindex="0"><table>{inside}</table></div>'


def _shape(results: Results) -> list[str]:
    """Parts of the page on the shape of the fastest growing mode, or the end of the loudest run.

    They say why it grows, too. Empty for kinds of study and models that have no shapes.
    """
    if not (
        results.kind == "transient"
        or ("modes" in results.tables and results.kind == "complex_modes")
    ):
        return []
    try:
        if not has_mesh(plan_of(results).study):
            return []
        shape = results.end_motion().shape if results.kind == "transient" else results.shape()
        moving, picture = shape_page([shape]), draw(shape)
    except (SquealstudyError, OSError) as error:
        return [f'<p class="note">No shape: {escape(str(error))}</p>']
    image = BytesIO()
    picture.savefig(image, format="png", dpi=SHAPE_DPI)
    named, *values = title(shape)
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in (" ".join(values), *sources(shape)))
    return [
        f"<h2>Shape: {escape(named)}</h2>{paragraphs}",
        f'<iframe class="moving" title="{escape(named)}" srcdoc="{escape(moving)}"></iframe>',
        figure_of(
            b64encode(image.getvalue()).decode(),
            f"its amplitude and energy ({named})",
            f"Deformed shape by amplitude, density of strain energy: {named}. {' '.join(values)}",
        ),
    ]


def _tables(results: Results) -> Iterator[str]:
    """HTML of the first rows of each table."""
    yield "<h2>Tables</h2>"
    for name in results.tables:
        table = results.table(name)
        if not len(table):
            continue
        shown = table.head(MOST_ROWS)
        more = f", the first {MOST_ROWS}: only they are sorted" if len(table) > MOST_ROWS else ""
        count = f"{plural(len(table), 'row')}{more}"
        yield f"<details><summary>{escape(name)} ({count}, {escape(name)}.parquet)</summary>"
        units = table.attrs.get("units", {})
        factors = [as_written(units.get(str(c), ""))[1] for c in shown.columns]
        cells = [
            [escape(_cell(v if f == 1.0 else v * f)) for v, f in zip(row, factors, strict=True)]
            for row in shown.itertuples(index=False)
        ]
        yield _html_table([_titled(str(c), units) for c in shown.columns], cells)
        yield "</details>"


def _titled(name: str, units: Mapping[str, str]) -> str:
    unit, _ = as_written(units.get(name, ""))
    return f"{name} [{unit}]" if unit else name


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.{TABLE_DIGITS}g}"
    if isinstance(value, np.ndarray | list):
        return ", ".join(_cell(v) for v in value)
    return "" if pd.isna(value) else str(value)


def _errors(results: Results) -> Iterator[str]:
    """HTML of errors, validity and failed points."""
    rows = list(results.screen.facts(results))
    rows += [("tables", text) for text in tables_text(results.manifest)]
    if "points" in results.tables and (text := outside_validity(results.points, "")):
        rows.append(("validity", text))
    if lost := _lost(results):
        failed = results.points[(results.points["status"] != "ok").to_numpy(bool)].iloc[0]
        said = failed.get("message", "")
        rows.append(("failed", f"{lost}{f' The first: {said}' if said else ''}"))
    if rows:
        yield "<h2>Errors and validity</h2>"
        yield _pairs(rows)


def tables_text(manifest: Mapping[str, Any]) -> Iterator[str]:
    """Yield texts on quantities that act through tables of parameters."""
    tables = manifest.get("tables", {})
    for over in dict.fromkeys(name for follows in tables.values() for name in follows):
        names = [name for name, follows in tables.items() if over in follows]
        alone = " alone: it changes nothing else" if over == TEMPERATURE else ""
        yield f"{over} acts through tables of {' and '.join(names)}{alone}"


def _in_folder(tables: dict[str, Any]) -> dict[str, Any]:
    """Tables of a study whose matrices are named with the folder that they are read from."""
    model = tables.get("model")
    if not isinstance(model, dict) or "folder" not in model:
        return tables
    terms = [
        {**term, "file": (Path(str(model["folder"])) / str(term["file"])).as_posix()}
        for term in model.get("term", [])
    ]
    return {**tables, "model": {**model, "term": terms}}


def named_files(tables: Any) -> list[str]:
    """Files that a study's tables name, each once: by the suffixes that a study can read."""
    if isinstance(tables, str):
        return [tables] if tables.lower().endswith(READ) else []
    if not isinstance(tables, Mapping | list):
        return []
    members = tables.values() if isinstance(tables, Mapping) else tables
    return list(dict.fromkeys(name for file_name in members for name in named_files(file_name)))


def _pairs(rows: Iterable[tuple[str, str]]) -> str:
    lines = (f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows)
    return f'<table class="pairs">{"".join(lines)}</table>'


def _provenance(results: Results) -> Iterator[str]:
    """HTML of where, when and by which versions the results were made."""
    m = results.manifest
    versions = ", ".join(f"{name} {text}" for name, text in m.get("versions", {}).items())
    machine = ", ".join(f"{k} {v}" for k, v in m.get("machine", {}).items())
    seconds = m.get("timings", {}).get("total_s")
    rows = [
        ("results", f"{results.directory}, {m.get('status', '')}"),
        ("date", str(m.get(FINISHED_AT) or "not known: results of an earlier version")),
        ("study hash", str(m.get("study_hash", ""))),
        ("points", str(results.n_points)),
        *(("model file", str(t)) for t in (m.get("model_file") or {}).get("prepared", ())),
        ("versions", f"{versions}, Python {m.get('python', '')}"),
        ("machine", machine),
        ("time", duration(seconds) if seconds is not None else "not known"),
    ]
    yield "<h2>Provenance</h2>"
    yield _pairs(rows)
    if text := m.get("study"):
        name = escape(str(m["name"]))
        yield "<h2>To reproduce</h2>"
        yield f"<p>Save what follows as {name}.toml, then <code>squealstudy run {name}.toml</code>"
        yield f" and <code>squealstudy report results/{name}</code>.</p>"
        if files := named_files(_in_folder(_study_tables(results))):
            yield "<p>It reads files by paths from the folder it is saved in, which this page does"
            yield f" not hold: {escape(', '.join(files))}.</p>"
        yield f"<pre>{escape(str(text))}</pre>"
