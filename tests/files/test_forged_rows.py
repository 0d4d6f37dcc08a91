"""Chunk files whose rows somebody forged with the types that they have: solved again, or told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_results import enter
from study_runs import plan_of
from study_texts import study_text, sweep_text

from squealstudy.cli.foreign import on_results
from squealstudy.engine.result_names import CHUNKS, MANIFEST
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ContradictionError, SquealstudyError

STUDY = study_text("lockin", "complex_modes", "hulten") + sweep_text("friction", 0.0, 0.6, 4)
FORGED = {
    "im, shorter": ("im", lambda old: old[:-1]),
    "re, none": ("re", lambda old: []),
    "overdamped, longer": ("overdamped", lambda old: old * 2),
    "error_rung, null": ("error_rung", lambda old: None),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    directory = tmp_path_factory.mktemp("whole") / "results"
    run_study(plan_of(STUDY), directory, 1)
    return directory


def forge(directory: Path, whole: Path, column: str, change) -> None:
    """An unfinished run: chunks alone, one value changed."""
    for path in (p for p in whole.rglob("*") if p.is_file() and p.name != MANIFEST):
        (directory / path.relative_to(whole)).parent.mkdir(parents=True, exist_ok=True)
        (directory / path.relative_to(whole)).write_bytes(path.read_bytes())
    for path in sorted((directory / CHUNKS).iterdir()):
        table = pq.read_table(path)
        cells = table[column].to_pylist()
        cells[0] = change(cells[0])
        place, field = table.column_names.index(column), table.schema.field(column)
        field = field.with_nullable(True) if cells[0] is None else field
        pq.write_table(table.set_column(place, field, pa.array(cells, field.type)), path)
        enter(directory, path)


@pytest.mark.parametrize("name", FORGED)
def test_rows_of_lists_that_do_not_fit_are_solved_again(name, whole, tmp_path):
    forge(tmp_path / "r", whole, *FORGED[name])
    report = run_study(plan_of(STUDY), tmp_path / "r", 1)
    assert report.n_solved == 4
    true, found = Results.open(whole).modes, Results.open(tmp_path / "r").modes
    np.testing.assert_array_equal(true["growth_rate"], found["growth_rate"])


def test_rows_that_swap_their_lengths_are_one_sentence(whole, tmp_path):
    directory = tmp_path / "r"
    forge(directory, whole, "im", lambda old: old)
    (path,) = sorted((directory / CHUNKS).iterdir())
    table = pq.read_table(path)
    cells = table["im"].to_pylist()
    cells[0], cells[1] = cells[0] + cells[1][-1:], cells[1][:-1]
    forged = pa.array(cells, table.schema.field("im").type)
    place = table.column_names.index("im")
    pq.write_table(table.set_column(place, table.schema.field("im"), forged), path)
    enter(directory, path)
    with pytest.raises(SquealstudyError, match="differ in length"):
        run_study(plan_of(STUDY), directory, 1)


def test_what_nobody_foresaw_of_files_that_were_there_is_one_sentence(whole, tmp_path, monkeypatch):
    forge(tmp_path / "r", whole, "message", lambda old: "x")

    def broken(*arguments, **options):
        return ()[3]  # IndexError

    monkeypatch.setattr("squealstudy.engine.runner._finish", broken)
    with pytest.raises(SquealstudyError, match=r"does not fit together.*--fresh makes all anew"):
        run_study(plan_of(STUDY), tmp_path / "r", 1)
    with pytest.raises(IndexError):  # a mistake of ours alone
        run_study(plan_of(STUDY), tmp_path / "new", 1)


def test_a_finished_study_whose_table_has_no_rows_is_finished_again(whole, tmp_path):
    forge(tmp_path / "r", whole, "message", lambda old: "")
    run_study(plan_of(STUDY), tmp_path / "r", 1)
    path = tmp_path / "r" / "points.parquet"
    pq.write_table(pq.read_table(path)[:0], path)
    enter(tmp_path / "r", path)
    run_study(plan_of(STUDY), tmp_path / "r", 1)
    assert len(Results.open(tmp_path / "r").points) == 4


def test_a_contradiction_names_all_results_of_a_command():
    @on_results
    def compare(frequency, other):
        raise KeyError(f"{frequency} {other}")

    with pytest.raises(ContradictionError, match=r"^first, second: what the files say"):
        compare("first", other="second")
