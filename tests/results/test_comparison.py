import io

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from transient_tables import growth_table, modes_table, points_table

from squealstudy import screen
from squealstudy.cli import app as cli
from squealstudy.cli.compare import TITLES, comparison, summary
from squealstudy.engine.manifest_file import read_manifest, write_manifest
from squealstudy.engine.results import Results
from squealstudy.errors import ResultsError
from squealstudy.kinds.complex_modes.tables import onsets_arrow
from squealstudy.tables.comparison import COLUMNS, _partners, compare
from squealstudy.tables.mode_ranking import FIRST_UNTRACKED_GROUP, OVERDAMPED_GROUP

CALIPER = "caliper.modes[8].damping_ratio"


def freq_points(friction=(0.3, 0.4, 0.5), pressure=(4e5, 12e5), status="ok"):
    mu, p = np.meshgrid(friction, pressure)
    ids = [f"f{i}" for i in range(mu.size)]
    head = {"point_id": ids, "status": status, "message": "", "wall_s": 1.0}
    return pd.DataFrame(head | {"friction": mu.ravel(), "pressure": p.ravel(), "n_modes": 3})


def freq_modes(points, rows=((7, 3255.0, 320.0), (9, 4940.0, 250.0), (3, 5240.0, -4.0))):
    table = pd.DataFrame(
        [
            {"point_id": point, "track": track, "frequency_hz": f, "growth_rate": sigma}
            for point in points["point_id"]
            for track, f, sigma in rows
        ]
    )
    return table.assign(unstable=table["growth_rate"] > 0, overdamped=False)


RUN = ("n_unstable", "torque_line_hz", "torque_rms")


def time_points(friction=(0.4, 0.5), kinds=("limit_cycle", "growing"), **others):
    own = {name: others.pop(name) for name in RUN if name in others}
    return points_table({"friction": list(friction), **others}, kinds, **own)


GROWTH = growth_table(
    [
        ("p0", 1, 3250.0, 321.0, 318.0, 0.6),
        ("p0", 2, 4952.0, 249.0, 248.0, 0.01),
        ("p1", 1, 3251.0, 330.0, 336.0, 0.7),
        ("p1", 2, 6100.0, 12.0, None, np.nan),
    ]
)


def compared(points=None, growth=GROWTH, freq=None, modes=None, shared=("friction",)):
    points = time_points() if points is None else points
    freq = freq_points() if freq is None else freq
    modes = freq_modes(freq) if modes is None else modes
    return compare(freq, modes, points, growth, ["friction", "pressure"], shared, {"pressure": 4e5})


def test_instabilities_of_both_studies_stand_side_by_side():
    table = compared()
    assert list(table.columns) == ["friction", "pressure", *COLUMNS]
    assert table["friction"].tolist() == [0.4, 0.4, 0.5, 0.5, 0.5]
    assert set(table["pressure"]) == {4e5}
    assert table["track"].tolist() == [7, 9, 7, 9, 0]
    first = table.iloc[0]
    assert (first["frequency_hz"], first["growth_rate"]) == (3255.0, 320.0)
    assert (first["predicted_frequency_hz"], first["predicted_growth_rate"]) == (3250.0, 321.0)
    assert (first["low"], first["fitted_growth_rate"], first["high"]) == (315.0, 318.0, 321.0)
    assert first["deviation"] == pytest.approx(318.0 / 320.0 - 1)
    assert table["kind"].tolist() == ["both", "both", "both", "frequency", "time"]
    assert table["expressed"].tolist() == [True, False, pd.NA, pd.NA, pd.NA]  # p1 still grows
    assert table["class"].tolist() == ["limit_cycle"] * 2 + ["growing"] * 3
    assert (first["freq_point_id"], first["time_point_id"]) == ("f1", "p0")
    assert first["torque_line_hz"] == 3175.0


def test_what_one_study_alone_predicts_has_nan_of_the_other():
    table = compared()
    freq_only, time_only = table.iloc[3], table.iloc[4]
    ours = ["predicted_frequency_hz", "predicted_growth_rate", "fitted_growth_rate", "deviation"]
    assert freq_only[[*ours, "low", "high", "level_share"]].isna().all()
    assert freq_only["expressed"] is pd.NA
    assert time_only[["frequency_hz", "growth_rate", "deviation"]].isna().all()
    assert time_only["predicted_frequency_hz"] == 6100.0
    assert time_only["expressed"] is pd.NA


def test_stable_modes_are_no_predictions_divergence_and_untracked_modes_are():
    freq = freq_points()
    modes = freq_modes(freq)
    modes.loc[modes["track"] == 9, "overdamped"] = True
    modes.loc[modes["track"] == 7, "track"] = -1
    table = compared(modes=modes)
    assert table["track"].tolist() == [
        FIRST_UNTRACKED_GROUP,
        OVERDAMPED_GROUP,
        0,
        FIRST_UNTRACKED_GROUP,
        OVERDAMPED_GROUP,
        0,
    ]
    assert table["kind"].tolist() == ["both", "frequency", "time", "both", "frequency", "time"]
    text = summary(table)
    assert "4 predicted instabilities, 1 expresses itself, 3 cannot be told" in text


VIBRATES = {"torque_line_hz": 77.0, "torque_rms": 5.0, "n_unstable": 0}


@pytest.mark.parametrize(
    ("kind", "found"),
    [(kind, True) for kind in ("limit_cycle", "irregular", "growing", "undecided")]
    + [(kind, False) for kind in ("stable", "failed")],
)
def test_what_vibrates_though_no_mode_is_predicted_has_a_row(kind, found):
    """A design that squeals only when kicked: complex modes say that it is stable."""
    points = time_points((0.4,), (kind,), **VIBRATES)
    freq = freq_points()
    table = compared(points, GROWTH.iloc[:0], freq, freq_modes(freq, ((3, 5240.0, -4.0),)))
    assert len(table) == found
    assert table.attrs["points"] == 1
    if found:
        row = table.iloc[0]
        assert (row["kind"], row["track"], row["class"]) == ("vibration", 0, kind)
        assert (row["torque_line_hz"], row["torque_rms"]) == (77.0, 5.0)
        assert row["expressed"] is pd.NA
        lasts = kind in ("limit_cycle", "irregular")
        told = "vibrate in time" if lasts else "grow or are undecided in time"
        assert f"1 design point: {told} with no mode predicted." in summary(table)


def test_a_vibration_that_no_predicted_instability_carries_has_a_row_beside_them():
    growth = GROWTH.assign(level_share=0.01, expressed=False)
    points = time_points(kinds=("limit_cycle", "stable"), n_unstable=2)
    table = compared(points, growth)
    assert table["kind"].tolist() == ["both", "both", "vibration", "both", "frequency", "time"]
    assert "1 design point: vibrate in time otherwise than predicted." in summary(table)
    followed = time_points(kinds=("limit_cycle", "stable"), n_unstable=[3, 1])
    assert compared(followed, growth)["kind"].tolist()[2] == "unfollowed"
    above = time_points(kinds=("limit_cycle", "stable"), n_unstable=2).assign(n_unstable_above=1)
    text = summary(compared(above, growth))
    assert "unstable modes are not followed" in text
    assert "otherwise than predicted" not in text


@pytest.mark.parametrize("kind", ["growing", "undecided", "failed"])
def test_a_run_that_has_not_come_to_its_level_does_not_tell_what_lives(kind):
    table = compared(time_points((0.4,), (kind,)), GROWTH.assign(expressed=True))
    assert table["expressed"].isna().all()


def test_a_stable_mode_of_the_time_study_is_no_prediction():
    """Undamped, its growth rate is 1e-12: round-off, not an instability."""
    growth = GROWTH.assign(growth_rate=1e-12, unstable=False)
    points = time_points(kinds=("limit_cycle", "stable"), n_unstable=0)
    kinds = compared(points, growth)["kind"].tolist()
    assert kinds == ["frequency", "frequency", "vibration", "frequency", "frequency"]


def test_points_join_within_round_off_only():
    points = time_points((0.4 * (1 + 1e-9), 0.5 * (1 + 1e-4)))
    assert set(compared(points)["time_point_id"]) == {"p0"}


def test_a_parameter_of_the_time_study_alone_must_be_where_the_frequency_study_ran():
    points = time_points((0.4, 0.4), **{CALIPER: [0.0, 0.05]})
    freq = freq_points()
    table = compare(
        freq,
        freq_modes(freq),
        points,
        GROWTH,
        ["friction", "pressure"],
        ["friction", CALIPER],
        {"pressure": 12e5, CALIPER: 0.0},
    )
    assert set(table["time_point_id"]) == {"p0"}
    assert set(table["freq_point_id"]) == {"f4"}
    assert set(table[CALIPER]) == {0.0}


def test_a_failed_point_in_time_leaves_its_predictions_open():
    points = time_points((0.4,), ("failed",))
    table = compared(points, GROWTH.iloc[:0])
    assert table["track"].tolist() == [7, 9]
    assert set(table["class"]) == {"failed"}
    assert table["expressed"].isna().all()
    later = compared(points)
    assert later["fitted_growth_rate"].tolist() == [318.0, 248.0]
    assert later["expressed"].isna().all()


def test_nothing_in_common_names_parameters_and_values_of_both_sides():
    with pytest.raises(ResultsError) as error:
        compared(time_points((0.11, 0.12)))
    text = str(error.value)
    assert "no design point in common" in text
    assert "friction = 0.3, 0.4, 0.5; pressure = 400000, 1.2e+06" in text
    assert "time study: friction = 0.11, 0.12" in text
    assert "pressure = 400000" in text.rpartition("only one")[2]


def test_points_that_failed_in_the_frequency_study():
    freq = freq_points(status="working_point")
    with pytest.raises(ResultsError, match="failed in the frequency"):
        compared(freq=freq, modes=freq_modes(freq).iloc[:0])
    some = freq_points()
    some.loc[2, "status"] = "working_point"  # 0.5 at 4e5 Pa
    table = compared(freq=some, modes=freq_modes(some.drop(index=2)))
    assert set(table["time_point_id"]) == {"p0"}
    assert "2 design points compared; 1 of them failed in the frequency study" in summary(table)


def test_without_any_instability_or_motion_the_table_is_empty_but_whole():
    freq, points = freq_points(), time_points(kinds=("stable", "failed"), n_unstable=0)
    table = compared(points, GROWTH.iloc[:0], modes=freq_modes(freq, ((3, 5240.0, -4.0),)))
    text = "2 design points compared; 1 of them failed in the time study; neither study predicts"
    assert summary(table).startswith(text)
    assert len(table) == 0
    assert table["expressed"].dtype == "boolean"


def test_neighbours_are_paired_once_closest_first():
    assert _partners(np.array([3250.0, 3260.0]), np.array([3261.0])).tolist() == [-1, 0]
    assert _partners(np.array([3250.0, 3260.0]), np.array([3255.0, 3262.0])).tolist() == [0, 1]
    assert _partners(np.array([3250.0]), np.array([3283.0])).tolist() == [-1]
    assert _partners(np.zeros(0), np.array([3250.0])).tolist() == []
    assert _partners(np.array([3250.0]), np.zeros(0)).tolist() == [-1]


@given(
    st.lists(st.floats(500, 8000), max_size=8),
    st.lists(st.floats(500, 8000), max_size=8),
)
def test_pairs_are_within_the_tolerance_and_no_mode_is_left_with_a_free_neighbour(wanted, others):
    wanted, others = np.array(wanted), np.array(others)
    partner = _partners(wanted, others)
    used = partner[partner >= 0]
    assert len(np.unique(used)) == len(used)
    assert (np.abs(others[used] / wanted[partner >= 0] - 1) <= 0.01).all()
    free = np.setdiff1d(np.arange(len(others)), used)
    for f in wanted[partner < 0]:
        assert (np.abs(others[free] / f - 1) > 0.01).all()


# -- the command


def write_results(directory, kind, points, modes, growth=None, model="disc_brake", **manifest):
    directory.mkdir()
    points.to_parquet(directory / "points.parquet")
    modes.to_parquet(directory / "modes.parquet")
    pq.write_table(onsets_arrow(None), directory / "onsets.parquet")
    if growth is not None:
        growth.to_parquet(directory / "growth.parquet")
    content = {
        "name": "n",
        "kind": kind,
        "model": model,
        "status": "finished",
        "sweeps": [],
    } | manifest
    write_manifest(directory, content)
    return directory


@pytest.fixture
def studies(tmp_path):
    freq = (
        freq_points(pressure=(12e5,)).rename(columns={"pressure": CALIPER}).assign(**{CALIPER: 0.0})
    )
    parameters = {"friction": "", CALIPER: ""}
    one = write_results(
        tmp_path / "freq",
        "complex_modes",
        freq,
        freq_modes(freq),
        parameters=list(parameters),
        units=parameters,
        nominal={"friction": 0.5, CALIPER: 0.0},
    )
    two = write_results(
        tmp_path / "time",
        "transient",
        time_points(),
        modes_table({"p0": {44: 0.6}}),
        GROWTH,
        parameters=["friction"],
        units={"friction": ""},
        nominal={"friction": 0.5},
    )
    return one, two


def test_the_command_prints_a_table_and_a_summary(studies, capsys):
    cli.compare(*studies)
    text = " ".join(capsys.readouterr().out.split())
    # the answer is first
    assert text.startswith(
        "2 design points compared; 4 predicted instabilities, 1 expresses itself"
    )
    assert "2 cannot be told" in text
    assert "1 more in the time study alone, 0 express themselves, 1 cannot be told" in text
    assert "315 to 321" in text
    assert "growing, 3175 Hz" in text
    assert CALIPER not in text


def test_the_screen_cuts_neither_figures_nor_names(capsys):
    """Runs that nothing predicts have long lines, which took the place of all other columns."""
    freq = freq_points()
    quiet = freq_modes(freq, ((3, 5240.0, -4.0),))
    table = compared(time_points((0.3, 0.4)), GROWTH.iloc[:0], freq, quiet)
    table.attrs |= {"parameters": ["friction"], "units": {"friction": "a unit"}}
    screen.show(*comparison(table))
    words = capsys.readouterr().out.split()
    assert not any("\N{HORIZONTAL ELLIPSIS}" in word for word in words)
    expected = {*" ".join(TITLES).split(), "limit_cycle,", "growing,", "followed", "0.3", "0.4"}
    assert expected <= set(words)


def test_the_order_of_the_directories_does_not_matter(studies, capsys):
    tables = []
    for pair in (studies, studies[::-1]):
        cli.compare(*pair, csv=True)
        tables.append(pd.read_csv(io.StringIO(capsys.readouterr().out)))
    pd.testing.assert_frame_equal(*tables)
    assert tables[0]["track"].tolist() == [7, 9, 7, 9, 0]
    assert list(tables[0].columns[:2]) == ["friction", CALIPER]


def test_two_studies_of_one_kind_are_refused(studies):
    with pytest.raises(ResultsError, match=r"is transient$"):
        cli.compare(studies[1], studies[1])


def test_columns_of_results_are_those_of_their_kind(studies, capsys):
    cli.columns(str(studies[0]), "points")
    of_results = capsys.readouterr().out
    cli.columns("complex_modes", "points")
    assert of_results == capsys.readouterr().out != ""


def test_a_growth_table_of_an_earlier_version_is_one_clear_error(studies):
    GROWTH.drop(columns="unstable").to_parquet(studies[1] / "growth.parquet")
    with pytest.raises(ResultsError, match="earlier version of squealstudy; run the study again"):
        cli.compare(*studies)


def test_two_models_are_refused(studies, tmp_path):
    write_manifest(studies[1], read_manifest(studies[1]) | {"model": "hoffmann"})
    with pytest.raises(ResultsError, match=r"of model 'disc_brake', .* of 'hoffmann'"):
        cli.compare(*studies)
    with pytest.raises(ResultsError, match="no such results directory"):
        cli.compare(studies[0], tmp_path / "nothing")


def test_damping_of_an_assembly_mode_stands_in_place_of_the_uniform_one(studies):
    name = "modes[44].damping_ratio"
    points = time_points(**{name: [0.005, 0.0]})
    points.to_parquet(studies[1] / "points.parquet")
    for directory, own in ((studies[0], {"damping_ratio": 0.005}), (studies[1], {name: 0.0})):
        manifest = read_manifest(directory)
        manifest["nominal"] |= own
        manifest["parameters"] += [name] if name in own else []
        write_manifest(directory, manifest)
    first, second = map(Results.open, studies)
    table = first.compare(second)
    assert set(table["time_point_id"]) == {"p0"}


def test_studies_of_other_tables_are_not_compared(studies):
    """Friction that follows pressure in one study has its default in the other."""
    text = '[parameters.friction.table]\npressure = ["2 bar", "30 bar"]\nfriction = [{}, 0.4]\n'
    for directory, least in zip(studies, (0.5, 0.6), strict=True):
        facts = {"tables": {"friction": ["pressure"]}, "study": text.format(least)}
        write_manifest(directory, read_manifest(directory) | facts)
    first, second = map(Results.open, studies)
    with pytest.raises(ResultsError, match="the table that friction follows, or one has none"):
        first.compare(second)
    write_manifest(studies[1], read_manifest(studies[1]) | {"study": text.format(0.5)})
    assert len(first.compare(Results.open(studies[1])))
    write_manifest(studies[1], read_manifest(studies[1]) | {"tables": {}})
    with pytest.raises(ResultsError, match="the table that friction follows"):
        first.compare(Results.open(studies[1]))


def test_groups_of_modes_without_a_track_have_no_number():
    modes = freq_modes(freq_points(), ((-1, 3255.0, 320.0), (-1, 4940.0, 250.0)))
    table = compared(modes=modes)
    table.attrs |= {"parameters": [], "units": {}}
    assert {row[0] for row in comparison(table)[2].rows} == {"untracked", "-"}
