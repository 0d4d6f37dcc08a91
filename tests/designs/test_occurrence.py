"""Occurrence of squeal in bins, against counts by hand and against the tables of studies."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from made_results import made
from study_runs import solved
from study_texts import study_text

from squealstudy.errors import ResultsError
from squealstudy.tables.occurrence import occurrence

POINTS = pd.DataFrame({"point_id": list("abcd"), "status": ["ok", "ok", "ok", "failed"]})
SQUEALS = pd.DataFrame(
    [
        ("a", 1500.0, 10.0),
        ("a", 1600.0, 12.0),  # of one bin with the first: counts once
        ("a", 2500.0, 10.0),
        ("b", 2000.0, 20.0),  # on edges: of the bins above them
        ("c", 9000.0, 10.0),  # of no bin
        ("d", 1500.0, 10.0),  # of a point that counts not
    ],
    columns=["point_id", "frequency_hz", "growth_rate"],
)


def binned(**more):
    table = occurrence(POINTS, SQUEALS, "growth_rate", [1e3, 2e3, 3e3], [0.0, 20.0, 40.0], **more)
    return table, table.set_index(["frequency_low_hz", "level_low"])


def test_points_count_once_in_each_bin():
    table, by = binned()
    assert by["n_points"].to_dict() == {
        (1e3, 0.0): 1,
        (1e3, 20.0): 0,
        (2e3, 0.0): 1,
        (2e3, 20.0): 1,
    }
    assert by["share"].tolist() == pytest.approx([1 / 3, 0.0, 1 / 3, 1 / 3])
    assert table.attrs == {"n_unsolved": 1, "n_outside": 1}


def test_shares_are_by_weight():
    _, by = binned(weights=[6.0, 3.0, 1.0, 100.0])
    assert by.loc[(1e3, 0.0), "share"] == pytest.approx(0.6)
    assert by.loc[(2e3, 20.0), "share"] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bins_hz": [1e3, 1e3]}, "bins_hz: expected two or more edges that ascend"),
        ({"bins": [1.0]}, "bins: expected two or more"),
        ({"weights": [1.0]}, "a weight of at least 0 for each of 4 points"),
        ({"weights": [0.0, 0.0, 0.0, 1.0]}, "no design point that counts is solved"),
    ],
)
def test_what_cannot_be_counted(changes, told):
    given = {"bins_hz": [1e3, 2e3], "bins": [0.0, 1.0], "weights": None, **changes}
    with pytest.raises(ResultsError, match=told):
        occurrence(POINTS, SQUEALS, "growth_rate", **given)


def test_runs_that_are_not_known_to_last_are_counted_apart():
    points = pd.DataFrame(
        {
            "point_id": list("abcd"),
            "status": "ok",
            "class": ["limit_cycle", "growing", "undecided", "decaying"],
            "torque_rms": [2.0, 1.0, np.nan, 0.0],
            "torque_line_hz": [1500.0, 1500.0, np.nan, np.nan],
        }
    )
    table = made(kind="transient", points=points).occurrence([1e3, 2e3], [0.0, 10.0])
    assert table["n_points"].tolist() == [1]
    assert table.attrs["n_undecided"] == 2


def test_of_a_study_it_is_what_the_modes_say(tmp_path):
    text = study_text("flutter", "complex_modes", "hulten")
    text += '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.2, 0.4, 0.5]\n'
    results = solved(text, tmp_path / "r")
    unstable = results.modes[results.modes["unstable"]]
    edge = float(unstable["growth_rate"].mean())
    table = results.occurrence([50.0, 150.0], [0.0, edge, 1e3])
    assert table["n_points"].tolist() == [1, 1]
    assert table["share"].sum() == pytest.approx(unstable["point_id"].nunique() / 4)
    assert table.attrs["n_outside"] == 0
    tables = {name: results.table(name) for name in results.tables}
    real = results.modes.assign(overdamped=True)  # steady sliding diverges: no vibration
    silent = results.with_tables(**tables | {"modes": real}).occurrence([50.0, 150.0], [0.0, 1e3])
    assert silent["n_points"].tolist() == [0]
    assert silent.attrs["n_outside"] == 0
