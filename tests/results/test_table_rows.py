"""Large tables read batch by batch: rankings, statistics and pictures are those of whole tables."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from study_runs import solved

from squealstudy.engine.results import Results
from squealstudy.engine.table_rows import ranked_modes
from squealstudy.errors import ResultsError
from squealstudy.screen import as_text
from squealstudy.tables import point_rows
from squealstudy.tables.mode_ranking import rank_modes
from squealstudy.tables.point_rows import ROW, point_codes

GRID = """
[study]
name = "grid"
kind = "complex_modes"
[model]
name = "hulten"
[parameters]
damping_ratio = 0.02
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 8
[[sweep]]
parameter = "sliding_speed"
start = 0.5
stop = 2.0
num = 4
[modes]
band = [1.0, 92.0]
reference_points = 1
refine_tracking = false
"""
QUERIES = (
    None,
    "friction > 0.3",
    "frequency_hz < 91 and sliding_speed > 1",
    "frequency_hz / 100 > friction",
    "stability == 'unstable' and mode == 1",
    "error_rung < 1 or friction > 0.5",
    "status == 'none'",
    "growth_rate > 1e9",
)


@pytest.fixture(
    scope="module",
    params=["grid", pytest.param("latin_hypercube", marks=pytest.mark.full_size), "boundary"],
)
def study(request, tmp_path_factory):
    """Results of designs of each sort; of some points no mode lies in the band."""
    text = GRID
    if request.param == "latin_hypercube":
        text = GRID.replace("num = 8\n", "").replace("num = 4\n", "")
        text += '[design]\ntype = "latin_hypercube"\nsamples = 24\n'
    elif request.param == "boundary":
        text = GRID.replace("num = 8", "num = 4") + '[design]\ntype = "boundary"\nlevels = 1\n'
    return solved(text, tmp_path_factory.mktemp("rows") / "r").directory


@pytest.fixture
def small(monkeypatch):
    """Batches of seven rows."""
    monkeypatch.setattr(point_rows, "ROWS_PER_BATCH", 7)


@pytest.fixture
def results(study, small):
    return Results.open(study)


def test_rows_and_columns_are_those_of_the_table(results):
    whole = pd.read_parquet(results.directory / "modes.parquet")
    assert results.columns("modes") == list(whole)
    assert (whole.groupby("point_id").size() == 1).any()
    code = point_codes(results.points, whole)
    assert np.array_equal(results.point_rows, code)
    names = ["growth_rate", "point_id", "unstable", "no such column", ROW]
    found = results.rows("modes", names, lambda part: part["growth_rate"].to_numpy() > 0)
    expected = whole.assign(**{ROW: code.astype(np.int32)})[[*names[:3], ROW]]
    pd.testing.assert_frame_equal(found, expected[whole["growth_rate"] > 0])
    assert not len(results.rows("modes", names, lambda part: np.zeros(len(part), bool)))
    assert "modes" not in results._loaded


def test_modes_in_any_order_belong_to_their_points(results):
    order = np.random.default_rng(1).permutation(len(results.modes))
    other = results.with_tables(modes=results.modes.iloc[order])
    assert np.array_equal(other.point_rows, results.point_rows[order])
    with pytest.raises(ResultsError, match="not in the points table"):
        results.with_tables(points=results.points.iloc[1:]).point_rows  # noqa: B018


@pytest.mark.parametrize("where", QUERIES)
def test_a_ranking_is_that_of_all_rows(results, where):
    if results.boundary is not None:
        whole = results.with_tables(modes=results.modes)
        pd.testing.assert_frame_equal(results.rank(where=where), whole.rank(where=where))
        return
    scattered = results.design != "grid"
    modes = pd.read_parquet(results.directory / "modes.parquet")
    for by in ("share", "growth"):
        found = results.rank(by, where=where)
        tables = results.points, modes, results.along, by, None, where, results.onsets, scattered
        pd.testing.assert_frame_equal(found, rank_modes(*tables), check_flags=False)
    assert "modes" not in results._loaded


def test_a_query_that_cannot_be_used_names_all_columns(results):
    with pytest.raises(ResultsError, match=r"unknown column.*residual"):
        results.rank(where="loudness > 1")


def test_only_rows_that_may_count_are_held(results):
    held = ranked_modes(results)
    assert len(held) < len(pd.read_parquet(results.directory / "modes.parquet"))


def test_what_a_run_prints_and_draws_holds_no_table_of_modes(results, tmp_path):
    drawn = results.draw(tmp_path)
    shown = results.screen.findings(results), results.screen.facts(results)
    assert drawn
    assert all(shown)
    if results.design == "latin_hypercube":
        assert len(results.robust())
    assert "modes" not in results._loaded


def test_a_ranking_made_again_is_the_same_whatever_was_done_to_the_first(results):
    first = results.rank()
    expected = first.copy()
    first["max_growth_rate"] = 0.0
    pd.testing.assert_frame_equal(results.rank(), expected)
    fastest = expected["max_growth_rate"].idxmax()
    assert results.rank(by="growth")["track"].iloc[0] == expected["track"][fastest]
    assert len(results.rank(where="friction < 0.0")) == len(results.rank(top=0)) == 0


def test_the_error_of_refined_onsets_is_told_beside_them(results):
    onsets = results.onsets
    refined = onsets["status"].isin(["refined", "cubic"]) & onsets["track"].isin(
        results.rank()["track"]
    )
    error = onsets["error_estimate"][refined].max()
    printed = " ".join(as_text(results.screen.ranking(results)).split())
    told = re.search(r"refined ones to (\S+), the model's errors apart", printed)
    assert (told is None) == np.isnan(error)
    if told:
        assert float(told[1]) == pytest.approx(error, rel=0.05)
        unknown = results.with_tables(onsets=onsets.assign(error_estimate=np.nan))
        assert "refined ones" not in as_text(unknown.screen.ranking(unknown))
