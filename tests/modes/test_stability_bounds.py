"""Unstable for sure, or within an error: bounds in rankings, robust tables and on screens."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from made_results import made
from test_ranking import MU, STUDY, P, linear_study, modes_table, points_table
from test_robust import tables

from squealstudy import screen
from squealstudy.kinds.complex_modes import random_screen
from squealstudy.tables.mode_ranking import rank_modes
from squealstudy.tables.robustness import robust_table
from squealstudy.tables.stability import is_uncertain


def labelled(modes, error):
    """The modes with the column `stability` of an absolute error of the growth rate."""
    names = np.where(modes["unstable"], "unstable", "stable")
    uncertain = np.abs(modes["growth_rate"].to_numpy()) <= error
    return modes.assign(stability=np.where(uncertain, "uncertain", names))


def test_bounds_of_a_ranking_enclose_its_count():
    points, modes = linear_study(STUDY, MU, P)
    modes = labelled(modes, 2 * np.pi * 1000.0 * 0.0025)
    table = rank_modes(points, modes).set_index("track")
    zeta = modes["damping_ratio"].to_numpy()
    for track, row in table.iterrows():
        own, edge = modes["track"] == track, 0.0025 / track  # errors are in growth
        assert row["unstable_points_low"] == int((zeta[own] < -edge).sum())
        assert row["unstable_points_high"] == int((zeta[own] <= edge).sum())
        assert row["unstable_points_low"] < row["unstable_points"] < row["unstable_points_high"]


def test_without_the_column_and_where_all_is_certain_the_bounds_are_the_count():
    points, modes = linear_study(STUDY, MU, P)
    for table in (modes, labelled(modes, 0.0)):
        found = rank_modes(points, table)
        assert found["unstable_points_low"].equals(found["unstable_points"])
        assert found["unstable_points_high"].equals(found["unstable_points"])
    assert not is_uncertain(modes).any()


def test_uncertain_modes_without_a_track_and_overdamped_ones_have_their_groups():
    rows = [
        {"point": 0, "track": -1, "frequency_hz": 1000.0, "damping_ratio": -0.01},
        {"point": 1, "track": -1, "frequency_hz": 1040.0, "damping_ratio": -0.01},
        {"point": 2, "track": -1, "frequency_hz": 1020.0, "damping_ratio": 1e-6},
        {"point": 2, "track": -1, "frequency_hz": 3000.0, "damping_ratio": 1e-6},
        {"point": 0, "track": -1, "frequency_hz": 5.0, "damping_ratio": -1.0, "overdamped": True},
        {"point": 1, "track": -1, "frequency_hz": 1e-9, "damping_ratio": 1.0, "overdamped": True},
    ]
    points, modes = points_table({"friction": np.arange(3.0)}), modes_table(rows)
    table = rank_modes(points, labelled(modes, 0.1)).set_index("kind")
    bounds = ["unstable_points", "unstable_points_low", "unstable_points_high"]
    assert table.loc["untracked", bounds].tolist() == [2, 2, 3]
    assert table.loc["non-oscillating", bounds].tolist() == [1, 1, 2]


def test_bounds_of_a_probability():
    x = np.random.default_rng(0).uniform(size=(40, 3))
    growth = np.linspace(-20.0, 20.0, 40)
    points, modes = tables(x, growth)
    table = robust_table(points, labelled(modes, 5.0)).set_index("quantity")
    for name in ("any", "track"):
        row = table.loc[name]
        assert row["unstable_points"] == 20
        assert row["unstable_points_low"] == int((growth > 5.0).sum())
        assert row["unstable_points_high"] == int((growth >= -5.0).sum())
        assert row["probability"] == 0.5


@pytest.mark.parametrize("error", [0.0, 5.0])
def test_screens_say_what_is_not_certain(error, capsys):
    x = np.random.default_rng(0).uniform(size=(40, 3))
    points, modes = tables(x, np.linspace(-20.0, 20.0, 40))
    modes = labelled(modes, error)
    screen.show(*random_screen.probabilities(robust_table(points, modes)))
    onsets = pd.DataFrame(columns=["direction", "onset", "status", "track"])
    onsets = onsets.assign(point_before="", point_after="")
    for table in (modes, modes.assign(unstable=False)):
        results = made(points=points, modes=table, onsets=onsets)
        screen.show(*results.screen.ranking(results))
    text = " ".join(capsys.readouterr().out.split())
    if error:
        assert "50.0 (37.5 to 62.5)" in text
        assert text.count("at 10 solved design points the error of some mode") == 2
    else:
        assert "(37.5" not in text
        assert "error of some mode" not in text
        assert "in brackets" not in text
