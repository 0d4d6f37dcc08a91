import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_results import made

from squealstudy import screen
from squealstudy.errors import ResultsError
from squealstudy.kinds.complex_modes.onset_words import onset_cell, onset_in_words
from squealstudy.tables.mode_ranking import (
    COLUMNS,
    frequency_text,
    parameter_columns,
    rank_modes,
)
from squealstudy.tables.point_rows import largest_by_code, point_codes

SCALE = "caliper.modes[12-14].frequency_scale"


def points_table(designs, status=None, **others):
    """`designs` maps swept parameters to one value a point."""
    n = len(next(iter(designs.values())))
    status = ["ok"] * n if status is None else status
    head = {"point_id": [f"p{i}" for i in range(n)], "status": status, "message": "", "wall_s": 1.0}
    tail = {"n_modes": 2, "n_unstable": 1, "n_overdamped": 0, "working_point_residual": 1e-12}
    errors = {"open_share": 0.0, "reference_frequency_error": np.nan}
    return pd.DataFrame(
        head | designs | others | tail | errors | {"reference_damping_error": np.nan}
    )


def modes_table(rows):
    """One row for each (point, track, frequency, damping ratio, ...) given as dicts."""
    table = pd.DataFrame(rows)
    defaults = {"track_mac": 1.0, "track_ambiguous": False, "overdamped": False, "residual": 1e-14}
    defaults |= {"energy_disc": 0.5, "energy_pad": 0.3, "energy_interfaces": 0.2}
    for name, value in defaults.items():
        table[name] = table[name].fillna(value) if name in table else value
    table["growth_rate"] = -table["damping_ratio"] * 2 * np.pi * table["frequency_hz"]
    table["unstable"] = table["damping_ratio"] < 0
    return table.assign(mode=1, point_id="p" + table["point"].astype(str)).drop(columns="point")


def test_rows_of_modes_whatever_their_order():
    rng = np.random.default_rng(0)
    points = pd.DataFrame({"point_id": [f"p{i}" for i in range(50)]})
    code = rng.integers(0, 50, 300)
    modes = pd.DataFrame({"point_id": points["point_id"].to_numpy()[code]})
    assert np.array_equal(point_codes(points, modes), code)
    assert np.array_equal(point_codes(points, modes.astype(object)), code)
    assert len(point_codes(points, modes.iloc[:0])) == 0
    with pytest.raises(ResultsError, match="not in the points table"):
        point_codes(points.iloc[1:], pd.DataFrame({"point_id": ["p1", "p0"]}))


def test_the_largest_of_each_code_and_nan_of_none():
    found = largest_by_code(np.array([1.0, -3.0, -2.0]), np.array([2, 0, 0]), 4)
    assert np.array_equal(found, [-2.0, np.nan, 1.0, np.nan], equal_nan=True)


@pytest.mark.parametrize(
    ("values", "varies"),
    [([1.0, 1.0], False), ([1.0, 2.0], True), ([np.nan, np.nan], False), ([np.nan, 1.0], True),
     ([1.0, np.nan], True), (["a", "a"], False), (["a", "b"], True), ([], False)],
)  # fmt: skip
def test_parameters_that_vary(values, varies):
    n = len(values)
    table = points_table({"friction": values}) if n else points_table({"friction": [0.1]}).iloc[:0]
    assert ("friction" in parameter_columns(table, varied=True)) == varies


def grid(mu, p):
    mu, p = np.meshgrid(mu, p)
    return {"friction": mu.ravel(), "pressure": p.ravel()}


def linear_study(zeta, mu, p, status=None):
    """Track k has the damping ratio zeta[k](mu, p) and the frequency 1000 k."""
    designs = grid(mu, p)
    points = points_table(designs, status)
    rows = [
        {"point": i, "track": k, "frequency_hz": 1000.0 * k, "damping_ratio": f(m, q)}
        for i, (m, q) in enumerate(zip(*designs.values(), strict=True))
        for k, f in zeta.items()
        if points["status"][i] == "ok"
    ]
    return points, modes_table(rows)


MU, P = np.linspace(0.0, 0.7, 8), np.array([2e5, 8e5, 30e5])
STUDY = {1: lambda m, q: 0.01 - 0.02 * m, 2: lambda m, q: 0.004 - 0.02 * m + 1e-9 * q}
STABLE = {3: lambda m, q: 0.02}


def test_one_row_a_track_that_is_unstable_somewhere():
    points, modes = linear_study(STUDY | STABLE, MU, P)
    ranking = rank_modes(points, modes)
    assert list(ranking["track"]) == [2, 1]
    assert list(ranking.columns) == list(COLUMNS)
    first = ranking.iloc[0]
    assert first["unstable_points"] == 5 * 2 + 4  # mu >= .3, at 30 bar (threshold .35) mu >= .4
    assert first["unstable_share"] == pytest.approx(14 / 24)
    assert first["min_damping_ratio"] == pytest.approx(0.004 - 0.014 + 2e-4)
    assert first["max_growth_rate"] == pytest.approx(0.0098 * 2 * np.pi * 2000)
    assert first["at"] == "friction=0.7, pressure=200000"
    assert first["frequency_min_hz"] == first["frequency_hz"] == first["frequency_max_hz"] == 2000
    assert first["kind"] == "mode"
    assert np.isnan(first["threshold"])


@given(
    st.lists(st.floats(0, 1), min_size=3, max_size=12, unique=True),
    st.floats(0.05, 0.95),
    st.floats(0.001, 1.0),
    st.randoms(),
)
@settings(max_examples=20, deadline=None)
def test_thresholds_of_linear_damping_are_exact(values, part, slope, random):
    values = sorted(values)
    start = values[0] + part * (values[-1] - values[0])
    points, modes = linear_study({1: lambda m, q: slope * (start - m)}, values, [1.0])
    if not modes["unstable"].any():
        return
    order = random.sample(range(len(modes)), len(modes))
    row = rank_modes(points, modes.iloc[order], along="friction").iloc[0]
    expected = max(start, values[0])
    assert row["threshold"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert row["threshold_kind"] == "crossing"


def test_the_threshold_is_the_smallest_over_lines():
    points, modes = linear_study(STUDY, MU, P)
    ranking = rank_modes(points, modes, along="friction", by="threshold")
    assert list(ranking["track"]) == [2, 1]
    assert list(ranking["threshold"]) == pytest.approx([0.2 + 1e-2, 0.5])
    assert (ranking["threshold_kind"] == "crossing").all()


def test_the_smallest_of_several_crossings_counts():
    points, modes = linear_study({1: lambda m, q: 0.01 * np.cos(2 * np.pi * m)}, MU * 2, [1.0])
    row = rank_modes(points, modes, along="friction").iloc[0]
    assert row["threshold"] == pytest.approx(0.25, abs=0.01)


def test_unstable_from_the_first_value_on_is_below_the_range():
    zeta = {1: lambda m, q: -0.01, 2: lambda m, q: 0.01 - 0.03 * m}
    ranking = rank_modes(*linear_study(zeta, MU, P), along="friction", by="threshold")
    assert list(ranking["track"]) == [1, 2]
    assert list(ranking["threshold_kind"]) == ["below range", "crossing"]
    assert np.isnan(ranking["threshold"][0])


def test_tracks_on_one_line_are_kept_apart():
    zeta = {1: lambda m, q: 0.01 * np.cos(2 * np.pi * m), 2: lambda m, q: -0.01}
    ranking = rank_modes(*linear_study(zeta, MU / 0.7, [1.0]), along="friction", by="frequency")
    assert list(ranking["threshold_kind"]) == ["crossing", "below range"]


def test_the_range_is_that_of_the_points_that_count():
    points, modes = linear_study(STUDY, MU, P)
    ranking = rank_modes(points, modes, along="friction", where="friction > 0.35")
    assert dict(zip(ranking["track"], ranking["threshold_kind"], strict=True)) == {
        1: "crossing",
        2: "below range",
    }


def test_a_track_that_begins_unstable_gives_a_bound():
    points, modes = linear_study({1: lambda m, q: 0.01 - 0.03 * m}, MU, [1.0])
    later = modes[modes["point_id"] >= "p5"]
    row = rank_modes(points, later, along="friction").iloc[0]
    assert row["threshold"] == pytest.approx(0.5)
    assert row["threshold_kind"] == "first seen"


def onsets_table(**changed):
    row = {"track": 1, "onset": 0.4321, "direction": "in", "status": "refined"}
    return pd.DataFrame([row | {"point_before": "p4", "point_after": "p5"} | changed])


def test_a_refined_onset_replaces_the_interpolated_one():
    points, modes = linear_study({1: lambda m, q: 0.009 - 0.02 * m}, MU, [1.0])
    row = rank_modes(points, modes, "friction", onsets=onsets_table()).iloc[0]
    assert (row["threshold"], row["threshold_kind"]) == (0.4321, "refined")
    row = rank_modes(points, modes, "friction", onsets=onsets_table(status="failed")).iloc[0]
    assert row["threshold"] == pytest.approx(0.5)  # the unstable end: nothing is known between
    assert row["threshold_kind"] == "bracketed"
    for changed in ({"status": "interpolated"}, {"track": 2}, {"direction": "out"}):
        row = rank_modes(points, modes, "friction", onsets=onsets_table(**changed)).iloc[0]
        assert row["threshold"] == pytest.approx(0.45)
        assert row["threshold_kind"] == "crossing"


def test_a_refined_onset_counts_where_both_its_ends_do():
    points, modes = linear_study({1: lambda m, q: 0.009 - 0.02 * m}, MU, [1.0])
    where = "friction < 0.35 or friction > 0.55"  # the bracket is wider then
    row = rank_modes(points, modes, "friction", where=where, onsets=onsets_table()).iloc[0]
    assert row["threshold"] == pytest.approx(0.45)
    assert row["threshold_kind"] == "crossing"


def test_a_number_that_an_unstable_mode_takes_has_no_onset_there_but_a_mark():
    """On one line an unstable mode took the number between 0.2 and 0.4, on the other it crosses.

    It has not turned unstable at 0.4 or less; nor is it told without a mark that 0.51 is the first.
    """
    zeta = {1: lambda m, q: (0.3 if q == 1 else 0.5) - m}
    points, modes = linear_study(zeta, [0.2, 0.4, 0.6], [1, 2])
    ids = points.set_index(["friction", "pressure"])["point_id"]
    rows = [
        {"status": "renumbered", "onset": np.nan, "at": (0.2, 0.4, 1)},
        {"status": "refined", "onset": 0.51, "at": (0.4, 0.6, 2)},
    ]
    onsets = pd.DataFrame(
        {
            "track": 1,
            "onset": row["onset"],
            "direction": "in",
            "status": row["status"],
            "frequency_hz": 1000.0,
            "point_before": ids[row["at"][0], row["at"][2]],
            "point_after": ids[row["at"][1], row["at"][2]],
        }
        for row in rows
    )
    (row,) = rank_modes(points, modes, "friction", onsets=onsets).to_dict("records")
    assert (row["threshold"], row["threshold_kind"], row["taken_over"]) == (0.51, "refined", True)
    assert onset_cell(row, "") == "*0.51"
    told = " first at friction 0.51, save where an unstable mode takes its number"
    assert onset_in_words(row, "friction", "", None) == told
    for before, after in ((0.31, 0.51), (np.nan, 0.39)):  # an onset there; another before 0.4
        onsets["onset"] = before, after
        onsets.loc[0, "status"] = "renumbered" if np.isnan(before) else "refined"
        (row,) = rank_modes(points, modes, "friction", onsets=onsets).to_dict("records")
        first = np.nanmin([before, after])
        assert (row["threshold"], row["threshold_kind"]) == (first, "refined")
        assert not row["taken_over"]
        assert onset_cell(row, "") == f"{first}"


def test_failed_points_are_bridged_and_not_counted():
    status = ["ok", "ok", "ok", "ok", "working_point", "ok", "ok", "ok"]
    points, modes = linear_study({1: lambda m, q: 0.012 - 0.03 * m}, MU, [1.0], status)
    row = rank_modes(points, modes, along="friction").iloc[0]
    assert row["threshold"] == pytest.approx(0.4)
    assert row["unstable_share"] == pytest.approx(3 / 7)


def test_scattered_designs_have_a_first_unstable_value():
    rng = np.random.default_rng(0)
    points = points_table({"friction": rng.uniform(size=30), "pressure": rng.uniform(size=30)})
    rows = [
        {"point": i, "track": 1, "frequency_hz": 900.0, "damping_ratio": 0.5 - mu}
        for i, mu in enumerate(points["friction"])
    ]
    row = rank_modes(points, modes_table(rows), along="friction").iloc[0]
    unstable = points["friction"][points["friction"] > 0.5]
    assert row["threshold"] == unstable.min()
    assert row["threshold_kind"] == "first seen"
    assert row["unstable_points"] == len(unstable)


def test_components_by_mean_energy_share_over_unstable_points():
    points = points_table({"friction": [0.1, 0.2, 0.3]})
    base = {"track": 4, "frequency_hz": 1000.0}
    energies = [(-0.1, 0.9, 0.1), (-0.2, 0.2, 0.7), (0.1, 0.0, 1.0)]
    rows = [
        base
        | {"point": i, "damping_ratio": z, "energy_disc": d, "energy_pad": p}
        | {"energy_interfaces": 0.0}
        for i, (z, d, p) in enumerate(energies)
    ]
    row = rank_modes(points, modes_table(rows)).iloc[0]
    assert (row["main_component"], row["second_component"]) == ("disc", "pad")
    assert row["main_share"] == pytest.approx(0.55)
    assert row["second_share"] == pytest.approx(0.4)


def test_without_energies_there_is_no_component():
    points, modes = linear_study(STUDY, MU, P)
    energies = [c for c in modes.columns if c.startswith("energy_")]
    bare = rank_modes(points, modes.drop(columns=energies))
    assert list(bare["main_component"]) == ["", ""]
    assert bare["main_share"].isna().all()
    one = rank_modes(points, modes.drop(columns=energies[1:]))
    assert list(one["main_component"]) == ["disc", "disc"]
    assert list(one["second_component"]) == ["", ""]


def test_divergence_and_untracked_modes_are_rows_of_their_own():
    points = points_table({"friction": [0.1, 0.2, 0.3]})
    rows = [
        {"point": 2, "track": 1, "frequency_hz": 1000.0, "damping_ratio": -0.01},
        {"point": 0, "track": -1, "frequency_hz": 700.0, "damping_ratio": -0.02},
        {"point": 2, "track": -1, "frequency_hz": 750.0, "damping_ratio": -0.03},
        {"point": 2, "track": -1, "frequency_hz": 760.0, "damping_ratio": -0.01},
        {"point": 0, "track": 1, "frequency_hz": 40.0, "damping_ratio": -1.0, "overdamped": True},
        {"point": 1, "track": 5, "frequency_hz": 50.0, "damping_ratio": -1.0, "overdamped": True},
        {"point": 1, "track": 6, "frequency_hz": 60.0, "damping_ratio": -1.0, "overdamped": True},
        {"point": 1, "track": 7, "frequency_hz": 60.0, "damping_ratio": 1.0, "overdamped": True},
    ]
    modes = modes_table(rows)
    modes["overdamped"] = modes["overdamped"].astype(bool)
    ranking = rank_modes(points, modes, along="friction").set_index("track")
    assert set(ranking.index) == {1, -1, -2, -3}  # 700 Hz is another mode than 750 and 760 Hz
    kinds = ["non-oscillating", "untracked", "untracked"]
    assert list(ranking.loc[[-1, -2, -3], "kind"]) == kinds
    assert list(ranking.loc[[-1, -2, -3, 1], "unstable_points"]) == [2, 1, 1, 1]
    assert list(ranking.loc[[-1, -2], "threshold_kind"]) == ["below range"] * 2  # it was "<= 0.1"
    assert ranking.loc[[-1, -2], "threshold"].isna().all()
    assert ranking.loc[-3, ["threshold", "threshold_kind"]].tolist() == [0.3, "first seen"]
    assert np.isnan(ranking.loc[-1, "frequency_hz"])  # it does not oscillate
    assert (ranking["points"] == 3).all()


def test_a_line_of_modes_without_a_track_has_the_figures_of_one_of_them():
    """The mean of 100 and 298 Hz is no mode; the fastest growth is not of the least damping."""
    points = points_table({"friction": [0.1, 0.2]})
    rows = [
        {"point": 0, "frequency_hz": 100.0, "damping_ratio": -0.02, "energy_pad": 0.9},
        {"point": 1, "frequency_hz": 298.0, "damping_ratio": -0.01},
        {"point": 1, "frequency_hz": 305.0, "damping_ratio": -0.03, "energy_disc": 0.7},
    ]
    table = rank_modes(points, modes_table([row | {"track": -1} for row in rows]), by="growth")
    assert table["track"].tolist() == [-3, -2]
    assert table["frequency_hz"].tolist() == [305.0, 100.0]
    assert [frequency_text(row) for row in table.to_dict("records")] == ["298 to 305", "100"]
    assert table["min_damping_ratio"].tolist() == [-0.03, -0.02]
    growth = 2 * np.pi * np.array([305.0 * 0.03, 100.0 * 0.02])
    assert table["max_growth_rate"].to_numpy() == pytest.approx(growth)
    assert table["main_component"].tolist() == ["disc", "pad"]


def test_a_failed_start_of_the_range_is_not_below_it():
    status = ["working_point"] + 7 * ["ok"]
    points, modes = linear_study({1: lambda m, q: -0.01}, MU, [1.0], status)
    row = rank_modes(points, modes, along="friction").iloc[0]
    assert (row["threshold_kind"], row["threshold"]) == ("first seen", MU[1])


def test_a_random_design_has_no_beginning_of_a_range():
    points, modes = linear_study({1: lambda m, q: -0.01}, [0.13, 0.42, 0.61], [1.0])
    row = rank_modes(points, modes, along="friction", scattered=True).iloc[0]
    assert (row["threshold_kind"], row["threshold"]) == ("first seen", 0.13)


def test_far_neighbours_of_a_random_design_bound_the_onset():
    def flutter(m, q):  # 0.3 is the onset; straight between far points it would be 0.026
        return 0.001 if m < 0.3 else -0.02 - 0.1 * m

    lines = [0.01, 0.33], [0.02, 0.7], [0.2, 0.65]
    for on_line in lines:
        points, modes = linear_study({1: flutter}, on_line, [1.0])
        interpolated = rank_modes(points, modes, along="friction").iloc[0]["threshold"]
        assert interpolated < 0.3
        row = rank_modes(points, modes, along="friction", scattered=True).iloc[0]
        assert (row["threshold_kind"], row["threshold"]) == ("bracketed", on_line[1])


def test_an_ambiguous_label_anywhere_unstable_shows():
    points, modes = linear_study(STUDY, MU, P)
    modes.loc[
        (modes["track"] == 1) & modes["unstable"] & (modes["point_id"] == "p7"), "track_ambiguous"
    ] = True
    ranking = rank_modes(points, modes).set_index("track")
    assert ranking["ambiguous"].to_dict() == {1: True, 2: False}


def test_orders():
    zeta = {
        1: lambda m, q: 0.02 - 0.06 * m,
        2: lambda m, q: 0.001 - 0.01 * m,
        3: lambda m, q: 0.01 - 0.02 * m - (0.1 if m > 0.65 else 0.0),
    }
    points, modes = linear_study(zeta, MU, P)
    modes["energy_pad"] = modes["track"].map({1: 0.1, 2: 0.2, 3: 0.0})
    orders = {"share": [2, 1, 3], "growth": [3, 1, 2], "damping": [3, 1, 2]}
    orders |= {"threshold": [2, 1, 3], "frequency": [1, 2, 3], "energy_pad": [2, 1, 3]}
    for by, expected in orders.items():
        assert list(rank_modes(points, modes, "friction", by)["track"]) == expected, by
    assert list(rank_modes(points, modes, top=2)["track"]) == [2, 1]


def test_unknown_orders_and_parameters():
    points, modes = linear_study(STUDY, MU, P)
    with pytest.raises(ResultsError, match=r"'loudness', expected share, growth.*energy_disc"):
        rank_modes(points, modes, by="loudness")
    with pytest.raises(ResultsError, match=r"'mu' is no parameter.*friction, pressure"):
        rank_modes(points, modes, along="mu")
    with pytest.raises(ResultsError, match="needs the parameter"):
        rank_modes(points, modes, by="threshold")
    with pytest.raises(ResultsError, match="not in the points table"):
        rank_modes(points.iloc[1:], modes)


# -- what the screen says


NO_ONSETS = pd.DataFrame(columns=["track", "direction", "onset", "status"]).assign(
    point_before="", point_after=""
)


def screen_of(capsys, points, modes, where=None, along="friction"):
    swept = {"sweeps": [along] if along else []}
    results = made(points=points, modes=modes, onsets=NO_ONSETS, facts=swept)
    screen.show(*results.screen.ranking(results, where=where))
    return " ".join(capsys.readouterr().out.split())


def test_what_is_said_of_onsets_is_of_the_query_and_of_the_design(capsys):
    points, modes = linear_study(STUDY, MU, P)
    text = screen_of(capsys, points, modes, "friction > 0.55")
    assert "below range: unstable at the first value of a line within the query" in text
    facts = {"sweeps": ["friction"], "design": {"type": "sobol"}}
    apart = points.assign(pressure=np.arange(len(points), dtype=float))
    results = made(points=apart, modes=modes, onsets=NO_ONSETS, facts=facts)
    screen.show(*results.screen.ranking(results))
    text = " ".join(capsys.readouterr().out.split())
    assert "<= before an onset: the least value of a solved point at which the mode" in text
    assert "where it was found" not in text  # a track is found at smaller values, too


def test_the_legend_of_a_mode_whose_number_changes_is_true_of_its_other_number(capsys):
    """T1 begins at 0.31 and goes on as T2 from 0.6 on; T2 begins by itself on the other line."""
    zeta = {
        1: lambda m, q: 0.3 - m if q == 1 and m < 0.5 else 0.1,
        2: lambda m, q: 0.7 - m if q == 2 else (0.1 if m < 0.5 else -0.1),
    }
    points, modes = linear_study(zeta, [0.2, 0.4, 0.6, 0.8], [1, 2])
    ids = points.set_index(["friction", "pressure"])["point_id"]
    onsets = pd.DataFrame(
        {"track": number, "direction": way, "status": status, "onset": onset, "frequency_hz": 1e3}
        | {"pressure": q, "point_before": ids[low, q], "point_after": ids[round(low + 0.2, 1), q]}
        for number, way, status, onset, low, q in (
            (1, "in", "refined", 0.31, 0.2, 1),
            (1, "out", "renumbered", np.nan, 0.4, 1),
            (2, "in", "renumbered", np.nan, 0.4, 1),
            (2, "in", "refined", 0.71, 0.6, 2),
        )
    )
    doubtful = modes.assign(track_ambiguous=True)
    tables = {"points": points.assign(n_unstable_high=1), "modes": doubtful, "onsets": onsets}
    results = made(**tables, facts={"sweeps": ["friction"]})
    screen.show(*results.screen.ranking(results))
    text = " ".join(capsys.readouterr().out.split())
    assert " *0.71 " in text
    assert "<= " not in text
    assert "* before an onset: on some line this mode is unstable at less, too" in text
    assert text.endswith("stability does not depend on it")
    assert "energy in: mean of the mode's unstable points" in text
    results = made(**tables | {"onsets": onsets[onsets["track"] == 3]}, facts=results.manifest)
    screen.show(*results.screen.ranking(results))
    text = " ".join(capsys.readouterr().out.split())
    assert "* before" not in text
    assert text.endswith("stability and onsets do not depend on it")


def test_modes_that_are_not_listed_are_counted(capsys):
    points, modes = linear_study(STUDY, MU, P)
    results = made(points=points, modes=modes, onsets=NO_ONSETS, facts={"sweeps": ["friction"]})
    unstable = len(results.rank())
    assert unstable > 1
    screen.show(*results.screen.ranking(results, top=1))
    text = " ".join(capsys.readouterr().out.split())
    assert f"{unstable - 1} more in squealstudy rank {results.directory}" in text
    screen.show(*results.screen.ranking(results, top=unstable))
    assert "more in squealstudy rank" not in capsys.readouterr().out


def test_damping_of_an_unstable_mode_is_never_shown_as_none(capsys):
    points, modes = linear_study({1: lambda m, q: -8e-7}, MU, P)
    assert " -8e-05 " in screen_of(capsys, points, modes)


def test_an_empty_ranking_says_over_what_it_is(capsys):
    points, modes = linear_study(STABLE, MU, P)
    text = screen_of(capsys, points, modes)
    assert text == "No mode between 1 and 8000 Hz is unstable at any of the 24 solved points."
    points, modes = linear_study(STUDY, MU, P)
    text = screen_of(capsys, points, modes, "frequency_hz > 9000")
    assert text == (
        "Within the query no mode between 1 and 8000 Hz is unstable at any of the 24 solved points."
    )
    text = screen_of(
        capsys, points, modes, "frequency_hz > 9000 and friction > 0.65 and pressure < 6e5"
    )
    assert text.endswith("is unstable at the 1 solved point.")
    text = screen_of(capsys, points, modes, "friction > 9")
    assert text == "No design point is solved and within the query."
    results = made(points=points, modes=modes, onsets=NO_ONSETS, units={"pressure": "Pa"})
    text, *_ = results.screen.ranking(results, where="pressure > 1e9 and friction < 9")
    assert text == "No design point is solved and within the query, which has pressure in Pa."
    _, legend = results.screen.ranking(results, where="pressure > 0")  # though it shows bar
    told = " ".join(str(legend).split())
    assert "24 solved points within the query, which has pressure in Pa, at which" in told
    text, *_ = results.screen.ranking(results, where="frequency_hz > 9000 and pressure > 0")
    assert text.startswith("Within the query, which has pressure in Pa, no mode between")
    failed = points.assign(status="failed")
    text = screen_of(capsys, failed, modes.iloc[:0])
    counted = "24 design points are not ok and count neither way (24 failed)"
    assert text == f"No design point is solved. {counted}"


def test_onsets_that_are_not_refined_are_marked(capsys):
    zeta = {1: lambda m, q: 0.013 - 0.02 * m, 2: lambda m, q: min(0.0, 0.25 - m)}
    zeta[3] = lambda m, q: -0.01
    text = screen_of(capsys, *linear_study(zeta, MU, [1.0]))
    assert "~0.65" in text  # interpolated
    assert "<= 0.3" in text  # nothing is damped before
    assert "below range" in text
    for said in ("interpolated between two design points", "between a stable point and this"):
        assert said in text


# -- queries


def test_conditions_on_points_restrict_the_points_that_count():
    points, modes = linear_study(STUDY, MU, P)
    row = rank_modes(points, modes, where="friction > 0.35 and pressure < 1e6").iloc[0]
    assert row["unstable_points"] == 8
    assert row["unstable_share"] == 1.0


def test_conditions_on_modes_leave_shares_and_thresholds_alone():
    points, modes = linear_study(STUDY, MU, P)
    free = rank_modes(points, modes, along="friction")
    loud = rank_modes(points, modes, along="friction", where="damping_ratio < -0.003")
    assert loud["unstable_points"].sum() < free["unstable_points"].sum()
    assert (loud["unstable_points"] / loud["unstable_share"]).round(9).eq(24).all()
    assert np.allclose(loud["threshold"], free["threshold"])


def test_conditions_on_both_tables_are_told_apart():
    points, modes = linear_study(STUDY, MU, P)
    where = "friction > 0.35 and (frequency_hz < 1500 or frequency_hz > 9000)"
    ranking = rank_modes(points, modes, where=where)
    assert list(ranking["track"]) == [1]
    assert ranking["unstable_share"][0] == pytest.approx(6 / 12)
    either = rank_modes(points, modes, where="friction > 0.65 or frequency_hz < 1500")
    assert dict(zip(either["track"], either["unstable_points"], strict=True)) == {1: 6, 2: 3}
    where = "friction > 0.65 or frequency_hz < 1500 and pressure < 1e6"
    mixed = rank_modes(points, modes, where=where)
    assert dict(zip(mixed["track"], mixed["unstable_points"], strict=True)) == {1: 5, 2: 3}


def test_a_query_may_compare_columns_of_both_tables():
    points, modes = linear_study(STUDY, MU, P)
    ranking = rank_modes(points, modes, where="frequency_hz > pressure / 600")
    assert dict(zip(ranking["track"], ranking["unstable_points"], strict=True)) == {1: 2, 2: 10}


@pytest.mark.parametrize("name", [SCALE, "contact.lambda"])
@pytest.mark.parametrize("quote", ["", "`"])
def test_names_with_dots_and_brackets(name, quote):
    designs = {"friction": [0.1, 0.2, 0.1, 0.2], name: [0.5, 0.5, 1.5, 1.5]}
    points = points_table(designs)
    rows = [
        {"point": i, "track": 1, "frequency_hz": 800.0, "damping_ratio": -0.1 * f}
        for i, f in enumerate(designs["friction"])
    ]
    where = f"{quote}{name}{quote} > 1 and friction > 0.15"
    row = rank_modes(points, modes_table(rows), where=where).iloc[0]
    assert row["unstable_points"] == 1
    assert row["unstable_share"] == 1.0
    assert row["at"] == f"friction=0.2, {name}=1.5"


def test_words_within_quotes_join_nothing():
    points, modes = linear_study(STUDY, MU, P)
    assert len(rank_modes(points, modes, where="message != 'this and that' and friction >= 0")) == 2
    assert len(rank_modes(points, modes, where="status == 'ok' & track == 1")) == 1


BAD = {
    "loudness > 3": "unknown column 'loudness', expected point_id.*friction.*frequency_hz",
    "friction >": "cannot be used",
    "friction + 1": "no condition",
    "friction = 0.5": "cannot be used",
    "friction > 'high'": "numbers are in SI units",
    "": "cannot be used",
    "friction.high > 2": "unknown column 'friction.high'; did you mean 'friction'",
    "fricton > 0.2": "unknown column 'fricton'; did you mean 'friction'",
    "friction > 0.2 and grwth_rate > 1": "unknown column 'grwth_rate'; did you mean 'growth_rate'",
    "0.1 if unstable else 2": "cannot be used",
    "@table['friction'] > 0": "cannot be used",
    "`contact.nu` > 1": "unknown column",
    "(friction > 0.2": "cannot be used",
}


@pytest.mark.parametrize("where", BAD)
def test_bad_queries(where):
    with pytest.raises(ResultsError, match=BAD[where]):
        rank_modes(*linear_study(STUDY, MU, P), where=where)


# -- empty tables


def test_nothing_unstable_gives_an_empty_frame():
    points, modes = linear_study(STABLE, MU, P)
    for table in (modes, modes.iloc[:0]):
        ranking = rank_modes(points, table, along="friction", by="threshold")
        assert len(ranking) == 0
        assert list(ranking.columns) == list(COLUMNS)
        assert ranking["frequency_hz"].dtype == np.float64
        assert ranking["unstable_points"].dtype == np.int64


def test_all_points_failed():
    points, modes = linear_study(STUDY, MU, [1.0])
    assert len(rank_modes(points.assign(status="failed"), modes.iloc[:0])) == 0


def test_tables_are_left_as_they_are():
    points, modes = linear_study(STUDY, MU, P)
    copies = points.copy(), modes.copy()
    rank_modes(points, modes, along="friction", where="friction > 0.2 and track == 1")
    pd.testing.assert_frame_equal(points, copies[0])
    pd.testing.assert_frame_equal(modes, copies[1])


def test_parameters_stand_between_the_head_and_the_results():
    points = points_table({"friction": [0.1, 0.2], SCALE: [1.0, 1.0]})
    points = points.assign(valid=[True, False], invalid_reason=["", "friction"], mine=[1.0, 2.0])
    assert parameter_columns(points) == ["friction", SCALE]
    assert parameter_columns(points, varied=True) == ["friction"]


def test_a_design_of_one_point_is_described_by_all_its_parameters():
    points = points_table({"friction": [0.5], "pressure": [1.2e6]})
    rows = [{"point": 0, "track": 2, "frequency_hz": 1000.0, "damping_ratio": -0.01}]
    row = rank_modes(points, modes_table(rows), along="friction").iloc[0]
    assert row["at"] == "friction=0.5, pressure=1.2e+06"
    assert row["threshold_kind"] == "first seen"
