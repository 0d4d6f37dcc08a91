"""Facts and columns of results of others: a wrong type at any depth is one sentence."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_results import enter
from study_runs import command, plan_of
from study_texts import study_text, sweep_text

from squealstudy.engine.manifest_facts import check_facts
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.result_names import MANIFEST
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ResultsError
from squealstudy.files import sealed
from squealstudy.study.kinds import facts_of, kind_names

STUDY = study_text("lockin", "complex_modes", "hulten") + sweep_text("friction", 0.0, 0.6, 4)
WRONG: tuple[Any, ...] = (
    *(None, "", "x", -1, 1e308, float("nan"), 10**400, [], {}, [[]], True, [None]),
    *({"a": None}, "\x1b[31m<script>$x$", "gone"),
)
DRAWN = 20  # changed manifests


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    directory = tmp_path_factory.mktemp("whole") / "results"
    run_study(plan_of(STUDY), directory, 1)
    return directory


@pytest.fixture
def results(whole, tmp_path) -> Path:
    for path in (p for p in whole.rglob("*") if p.is_file()):
        target = tmp_path / "results" / path.relative_to(whole)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    return tmp_path / "results"


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield from [at] if at else []
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value[:3])
        for key, inner in items:
            yield from places(inner, (*at, key))


def change(content: dict[str, Any], at: tuple[Any, ...], value: Any) -> None:
    inner: Any = content
    for key in at[:-1]:
        inner = inner[key]
    if value == "gone":
        del inner[at[-1]]
    else:
        inner[at[-1]] = value


def show(directory: Path) -> None:
    """All that screens and reports say of results, without pictures."""
    found = Results.open(directory)
    repr(found)
    found.screen.verdict(found)
    found.screen.findings(found)
    found.screen.facts(found)
    found.rank()


def is_refused(directory: Path) -> bool:
    try:
        show(directory)
    except ResultsError:
        return True
    return False


def test_sealed_facts_of_any_type_are_shown_or_refused(results):
    """What passes is shown without an exception of another kind."""
    honest, rng = read_manifest(results) or {}, random.Random(47)
    refused = 0
    for _ in range(DRAWN):
        content = json.loads(json.dumps(honest))
        at = rng.choice(list(places(content)))
        change(content, at, rng.choice(WRONG))
        (results / MANIFEST).write_text(sealed(content))
        refused += is_refused(results)
    assert DRAWN / 4 < refused < DRAWN


NESTED = [
    (("method", "points", "dense"), -1),
    (("method", "tolerance"), "small"),
    (("errors", "largest_rung"), "none"),
    (("errors", "reduction_widened"), None),
    (("outside_band", "looked"), 1.5),
    (("outside_band", "reach_hz"), [1.0]),
    (("reference", 0), 3),
    (("reference", 0, "missed_modes"), None),
    (("band_hz",), [1.0]),
    (("band_hz", 1), float("inf")),
    (("tracking", "left"), 10**400),
    (("nominal", "friction"), float("nan")),
    (("design", "type"), None),
    (("timings", "total_s"), "long"),
    (("peak_memory_mb", "largest_worker"), float("nan")),
    (("parameters", 0), "nothing"),
]


@pytest.mark.parametrize(("at", "value"), NESTED)
def test_nested_facts_that_are_none_name_their_key(results, at, value, capsys):
    content = read_manifest(results) or {}
    change(content, at, value)
    (results / MANIFEST).write_text(sealed(content))
    assert command("report", str(results), "--output", str(results.parent / "page.html")) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "nothing" in message or f"key '{'.'.join(map(str, at[:2]))}" in message


def test_every_kind_says_what_its_facts_are():
    assert all(facts_of(name) for name in kind_names() if name in NAMES)


NAMES = (
    *("complex_modes", "transient", "limit_cycles", "sensitivity", "design"),
    *("work_precision", "method_stability"),
)


def test_a_boundary_grid_of_another_size_than_it_says_is_refused(results):
    content = (read_manifest(results) or {}) | {
        "boundary": {
            "axes": {"friction": [0.1, 0.2]},
            "levels": 1,
            "points_solved": 2,
            "full_grid_points": 10**7,
        }
    }
    with pytest.raises(ResultsError, match="another size"):
        check_facts(content, results / MANIFEST)


# -- columns -------------------------------------------------------------------------------------
def other_column(results: Path, table: str, column: str, values: pa.Array | None) -> None:
    """Another column in a table whose hash the journal has, as its sender can write it."""
    path = results / f"{table}.parquet"
    found = pq.read_table(path)
    place = found.column_names.index(column)
    held = values and values.type
    found = (
        found.remove_column(place)
        if values is None
        else found.set_column(place, pa.field(column, held), values[: len(found)])
    )
    pq.write_table(found, path)
    enter(results, path)


MANY = 1000
MISFITS = [
    ("points", "status", pa.array([1] * MANY)),
    ("points", "n_modes", pa.array([[1, 2]] * MANY)),
    ("points", "friction", pa.array(["=1+1"] * MANY)),
    ("points", "friction", None),
    ("modes", "unstable", pa.array(["yes"] * MANY)),
    ("modes", "track", pa.nulls(MANY)),
    ("modes", "growth_rate", pa.array([{"a": 1}] * MANY)),
    ("modes", "growth_rate", None),
]


def test_a_table_of_points_without_rows_is_none(results, capsys):
    path = results / "points.parquet"
    pq.write_table(pq.read_table(path)[:0], path)
    enter(results, path)
    assert command("rank", str(results)) in (1, 2)
    assert "it has no row" in capsys.readouterr().err


@pytest.mark.parametrize(("table", "column", "values"), MISFITS)
def test_columns_that_are_none_are_one_sentence(results, table, column, values, capsys):
    other_column(results, table, column, values)
    to = ["--output", str(results.parent / "page.html")]
    for arguments in (["rank"], ["report", *to], ["explore", *to]):
        assert command(arguments[0], str(results), *arguments[1:]) in (1, 2)
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert "internal error" not in message
        assert column in message
