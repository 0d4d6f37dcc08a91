"""The answer of a grid along friction: first onsets, a row a design, against the closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matrix_families import write_family
from reference import MU_C
from study_runs import solved
from study_texts import study_text

from squealstudy.kinds.complex_modes.answer import (
    _many_in_words,
    _over_the_map,
    answer,
    contact_rows,
    how_many,
)
from squealstudy.kinds.complex_modes.design_lines import (
    ALIKE_ONSETS,
    MOST_DESIGNS,
    DesignLine,
    design_lines,
    extremes_in_words,
    onsets_in_words,
)
from squealstudy.kinds.complex_modes.design_table import _onsets_by_mode
from squealstudy.kinds.complex_modes.onset_table import first_onsets, last_ends, onset_table
from squealstudy.kinds.complex_modes.onset_words import (
    alike_together,
    last_at,
    onset_and_end,
    other_frequency,
    rows_with_ends,
)
from squealstudy.screen import as_text
from squealstudy.tables.mode_ranking import OVERDAMPED_GROUP, group_kind


def results_of(folder, frictions, seconds, more="", tables=""):
    text = study_text("designs", "complex_modes", "hulten") + (
        f'{tables}[[sweep]]\nparameter = "friction"\nvalues = {frictions}\n'
        f'[[sweep]]\nparameter = "frequency_2"\nvalues = {seconds}\n'
        f"[modes]\nband = [10.0, 1000.0]\n{more}"
    )
    return solved(text, folder)


def onset_of(results, second):
    """Of one design, from the table of onsets."""
    table = results.onsets
    own = table[np.isclose(table["frequency_2"], second) & (table["direction"] == "in")]
    return own["onset"].min()


def test_each_design_has_its_first_onset_and_its_fastest_growth(tmp_path):
    results = results_of(tmp_path / "r", [0.1, 0.2, 0.3, 0.4], [75.0, 80.0, 60.0])
    lines = design_lines(results)
    assert [line.design for line in lines] == [{"frequency_2": f} for f in (75.0, 80.0, 60.0)]
    assert lines[0].onset == pytest.approx(MU_C, abs=1e-4)
    for line in lines[:2]:
        second = line.design["frequency_2"]
        own = results.modes.merge(results.points).query(f"frequency_2 == {second}")
        assert line.onset == onset_of(results, second)
        assert line.fastest["max_growth_rate"] == own["growth_rate"].max()
        assert (line.unstable, line.solved) == (own.groupby("point_id")["unstable"].any().sum(), 4)
    assert (lines[2].unstable, lines[2].first, lines[2].fastest) == (0, None, None)
    text = as_text(results.screen.findings(results))
    told = " ".join(text.split())
    assert told.startswith("Unstable between 10 and 1000 Hz: with frequency_2 75 Hz T")
    for line, end in zip(
        lines[:2], ("(88 Hz there); with frequency_2 80 Hz T", "(91 Hz there); "), strict=True
    ):
        assert f"first at friction {line.onset:.4g} {end}" in told
    assert "with frequency_2 60 Hz nothing. The first onset is earliest" in told
    more = results_of(tmp_path / "more", [0.2, 0.4], [75.0, 80.0, 60.0, 70.0])
    told = as_text(more.screen.findings(more))
    assert told.startswith("Over all 4 designs 1 mode is unstable between 10 and 1000 Hz: T")
    assert "none up to 0.4" in text
    assert "design: frequency_2; as it is: 75 Hz" in text


@pytest.mark.parametrize("n_designs", [2, MOST_DESIGNS + 1])
def test_where_nothing_is_unstable_that_is_said_before_the_designs(tmp_path, n_designs):
    """And no blank line follows."""
    seconds = [40.0 + second for second in range(n_designs)]
    results = results_of(tmp_path / "r", [0.1, 0.2], seconds)
    text = as_text(results.screen.findings(results))
    none = (
        f"No mode between 10 and 1000 Hz is unstable at any of the {2 * n_designs} solved points."
    )
    first, *tables = text.rstrip("\n").split("\n\n")
    assert " ".join(first.split()) == none
    assert len(tables) == 1
    assert tables[0].count("none up to 0.2") == n_designs
    assert not text.endswith("\n\n")
    assert results.screen.verdict(results) == none
    points = results.points.copy()
    points.loc[0, "status"] = "working_point"
    text = as_text(results.screen.findings(results.with_tables(points=points)))
    assert text.startswith("No mode between")
    assert "counts neither way" in text.split("\n\n")[0]


def test_what_follows_the_parameter_of_a_design_is_named(tmp_path):
    """A row of designs is none of one value alone where a table moves another along."""
    table = "[parameters.stiffness_damping.table]\n"
    table += "frequency_2 = [70.0, 90.0]\nvalue = [1e-5, 2e-5]\n"
    results = results_of(tmp_path / "r", [0.2, 0.4], [75.0, 80.0], tables=table)
    text = " ".join(as_text(results.screen.findings(results)).split())
    assert "design: frequency_2, which stiffness_damping follows; as it is: 75 Hz" in text


def test_a_design_that_is_unstable_from_the_first_value_says_so(tmp_path):
    results = results_of(tmp_path / "r", [0.32, 0.4], [75.0, 60.0])
    assert [line.kind for line in design_lines(results)] == ["below range", ""]
    text = " ".join(as_text(results.screen.findings(results)).split())
    assert "already at the least friction (89 Hz there); with frequency_2 60 Hz nothing." in text
    assert results.screen.verdict(results).count("already at the least friction") == 1


def test_a_failed_point_is_no_stable_one(tmp_path):
    results = results_of(tmp_path / "r", [0.1, 0.4], [75.0, 60.0])
    points = results.points.copy()
    points.loc[points["friction"] == 0.1, "status"] = "working_point"
    failed = results.with_tables(points=points)
    lines = design_lines(failed)
    assert [(line.unstable, line.solved) for line in lines] == [(1, 1), (0, 1)]
    text = as_text(failed.screen.findings(failed))
    assert "none known" in text
    assert "none up to" not in text


def test_every_mode_that_is_counted_is_named(tmp_path):
    """Of two that are followed as one family and grow side by side both."""
    results = results_of(tmp_path / "r", [0.32, 0.4], [75.0])
    table = results.rank()
    second = table.assign(track=9, frequency_hz=300.0, max_growth_rate=1.0)
    both = pd.concat([table, second]).assign(family_modes=2)
    assert "T9 at 300 Hz" in onsets_in_words(results, both)
    assert "T9" not in onsets_in_words(results, both.assign(family_modes=1))


def test_the_onset_of_a_mode_is_seen_where_another_is_first():
    """An added mass moves the second mode from .288 to .297; the first stays."""

    def line(*modes):
        names = ("track", "frequency_hz", "threshold", "max_growth_rate")
        rows = [dict(zip(names, m, strict=True)) | {"kind": "mode"} for m in modes]
        rows = [
            m | {f"frequency_{end}_hz": m["frequency_hz"] for end in ("min", "max")} for m in rows
        ]
        found = {
            m["track"]: m | {"threshold_kind": kind, "taken_over": False}
            for m, kind in zip(rows, KINDS, strict=False)
        }
        return DesignLine({}, 1, 1, True, 0.2, "", rows[0], rows[0], found)

    KINDS = ("bracketed", "refined", "below range", "refined")
    today = line((23, 3144.0, 0.25, 90.0), (33, 4972.0, 0.288, 400.0))
    heavier = line((23, 3144.0, 0.25, 95.0), (33, 4905.0, 0.297, 380.0), (7, 700.0, np.nan, 50.0))
    text = as_text(_onsets_by_mode(["0 g", "100 g"], [today, heavier]))
    title, *rows = [line.split() for line in text.splitlines()[:3]]
    assert " ".join(title) == "onset of T33 4972 Hz T23 3144 Hz T7 700 Hz"
    assert rows[0] == ["0", "g", "0.288", "<=", "0.25", "-"]
    assert rows[1] == ["100", "g", "0.297", "<=", "0.25", "below", "range"]
    assert max(map(len, text.splitlines())) <= 80
    both = as_text(_onsets_by_mode(["0 g", "100 g"], [today, heavier], {23: [23, 33]}))
    title, *rows = [" ".join(line.split()) for line in both.splitlines()[:3]]
    assert title == "onset of T23, T33 4972 Hz T7 700 Hz"  # tracks that are one mode, one column
    assert rows == ["0 g <= 0.25 -", "100 g <= 0.25 below range"]
    assert "-: at this design" in text
    assert "-: at" not in as_text(_onsets_by_mode(["0 g"], [today]))  # no dash, no word of it
    KINDS = ("refined",) * 6
    always = [(k, 1000.0 * k, 0.3, 100.0 * k) for k in range(2, 7)]
    lines = [line(*always, (1, 500.0, 0.6, 5.0)), line(*always)]  # the slowest is silenced
    title, *_ = as_text(_onsets_by_mode(["0 g", "100 g"], lines)).splitlines()
    assert [word for word in title.split() if word.startswith("T")] == ["T6", "T5", "T4", "T1"]
    KINDS = ("below range",) * 4  # where no onset tells designs apart, growth does
    lines = [line((2, 3000.0, np.nan, 272.3), (3, 5000.0, np.nan, 45.2)), line(always[0])]
    title, *rows = as_text(_onsets_by_mode(["0", "0.5"], lines)).splitlines()
    assert " ".join(title.split()) == "growth 1/s of T2 3000 Hz T3 5000 Hz"
    assert [row.split() for row in rows[:2]] == [["0", "272.3", "45.2"], ["0.5", "200.0", "-"]]
    assert rows[2] == "-: at this design no mode of this number grows"
    one = line((23, 3144.0, 0.25, 90.0))
    assert _onsets_by_mode(["0 g", "100 g"], [one, one]) == []  # the row of a design has it


@pytest.mark.parametrize(
    ("kind", "threshold", "begins"),
    [
        ("refined", 0.2854, "first at friction 0.2854, T1"),
        ("bracketed", 0.2, "first at friction 0.2 or less, T1"),
        ("below range", np.nan, "already at the least friction, T1"),
        ("", np.nan, "first at friction 0.41, T1"),
    ],
)
def test_a_boundary_map_says_how_its_first_onset_is_known(kind, threshold, begins):
    table = pd.DataFrame(
        {
            "track": [1, 2],
            "kind": "mode",
            "frequency_hz": [3155.0, 3057.0],
            "frequency_min_hz": [3155.0, 3057.0],
            "frequency_max_hz": [3155.0, 3057.0],
            "threshold": [threshold, 0.41],
            "threshold_kind": [kind, "refined"],
            "family_points": [160, 70],
            "taken_over": False,
            "points": 625,
            "max_growth_rate": [424.4, 464.6],
        }
    )
    text = _over_the_map(SimpleNamespace(along="friction", units={}), table)
    assert text.startswith(f"{begins} at 3155 Hz most widespread (26 % of the nodes)")


def test_one_design_has_no_table(tmp_path):
    one = results_of(tmp_path / "one", [0.2, 0.4], [75.0])
    assert design_lines(one) == []
    assert "first at friction 0.2917 (88 Hz there)." in as_text(one.screen.findings(one))


def test_the_designs_that_turn_unstable_first_and_last_are_named(tmp_path):
    """One that never does within the range is the last; what is as near as an error is told apart
    no more."""
    results = results_of(tmp_path / "r", [0.1, 0.2, 0.3, 0.4], [75.0, 80.0, 60.0])
    lines = design_lines(results)
    assert extremes_in_words(results, lines) == (
        f" The first onset is earliest with frequency_2 80 Hz (friction {lines[1].onset:.4g}) and "
        "latest with frequency_2 60 Hz (none up to 0.4)."
    )
    assert extremes_in_words(results, lines[:2]).endswith(
        f"latest with frequency_2 75 Hz (friction {lines[0].onset:.4g})."
    )
    near = lines[0]._replace(onset=lines[1].onset * (1 + 0.5 * ALIKE_ONSETS))
    assert extremes_in_words(results, [lines[1], near]) == ""
    assert "earliest with 2 of the designs (" in extremes_in_words(results, [*lines, near])
    below = lines[1]._replace(onset=np.nan, kind="below range")
    assert "earliest with frequency_2 80 Hz (below range)" in extremes_in_words(
        results, [below, lines[2]]
    )
    for doubtful in (
        lines[0]._replace(kind="bracketed"),
        lines[2]._replace(sure=False),
        lines[2]._replace(unstable=1),
    ):
        assert extremes_in_words(results, [lines[1], doubtful]) == ""
    bound = lines[0]._replace(onset=0.35, kind="bracketed")  # its true onset may be the earliest
    assert extremes_in_words(results, [lines[1], bound, lines[2]]) == ""


def test_a_mode_that_is_unstable_from_the_first_value_says_until_where(tmp_path):
    """Friction that falls less at higher speeds: the closed form of the onset is the end."""
    row = {"track": 1, "threshold": np.nan, "frequency_hz": 18.0}
    onsets = pd.DataFrame({"track": [1, 1], "onset": [np.nan, 0.1906], "direction": ["in", "out"]})
    onsets = onsets.assign(status=["below_range", "refined"])
    assert last_at(row, onsets, "m/s") == ", no longer from 0.1906 m/s on"
    between = onsets.assign(status=["below_range", "interpolated"])
    assert last_at(row, between, "m/s") == ", no longer from about 0.1906 m/s on"
    at_an_end = onsets.assign(status=["below_range", "bracketed"])  # it is unstable there
    assert last_at(row, at_an_end, "m/s") == ""
    again = pd.DataFrame({"track": [1] * 3, "onset": [np.nan, 0.2, 0.3], "status": "refined"})
    assert last_at(row, again.assign(direction=["in", "out", "in"]), "") == ""


def test_of_many_designs_the_onset_of_a_mode_has_its_end_beside_it():
    """With one of two designs mode 1 stops at .6975; else none does."""
    onsets = pd.DataFrame(
        {
            "track": [1, 1, 1, 2, 2],
            "scale": [0.8, 0.8, 1.0, 0.8, 1.0],
            "onset": [0.3409, 0.6975, 0.2901, 0.2548, 0.2876],
            "direction": ["in", "out", "in", "in", "in"],
            "status": "refined",
        }
    )
    lines = []
    for scale, (first, second) in {0.8: (0.3409, 0.2548), 1.0: (0.2901, 0.2876)}.items():
        table = pd.DataFrame({"track": [1, 2, -1], "threshold": [first, second, 0.1]})
        table = table.assign(threshold_kind="refined", kind="mode", max_growth_rate=[9.0, 8.0, 7.0])
        table = table.assign(frequency_hz=3e3, frequency_min_hz=3e3, frequency_max_hz=3e3)
        rows = rows_with_ends(table, onsets, {"scale": scale}, "")
        assert list(rows) == [1, 2]
        lines.append(DesignLine({}, 1, 1, True, 0.2, "", rows[1], rows[1], rows))
    told = as_text(_onsets_by_mode(["0.8", "1"], lines)).splitlines()
    assert [" ".join(line.split()) for line in told[1:3]] == [
        "0.8 0.3409 to 0.6975 0.2548",
        "1 0.2901 0.2876",
    ]
    assert told[3] == "to: where the mode is stable again"
    assert onset_and_end({"threshold_kind": "below range", "threshold": 0, "end": "2"}, "") == (
        "below range to 2"
    )
    assert onset_and_end(None, "") == "-"


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    seconds = [60.0, *np.linspace(75.0, 95.0, MOST_DESIGNS).tolist()]
    return results_of(tmp_path_factory.mktemp("many") / "r", [0.1, 0.2, 0.4], seconds)


def test_many_designs_have_their_first_onsets_in_a_table(many):
    assert design_lines(many) == []
    onsets = first_onsets(many, "friction")["onset"]
    for second, onset in onsets.items():
        unstable = many.points.query(f"frequency_2 == {second} and n_unstable > 0")["friction"]
        if not len(unstable):
            assert onset == np.inf
        elif unstable.min() == 0.1:
            assert onset == -np.inf
        else:
            assert onset == onset_of(many, second)
    assert np.isinf(onsets).any()
    assert np.isfinite(onsets).any()
    lines = as_text(onset_table(many)).splitlines()
    assert lines[0].split() == ["frequency_2", "Hz", "first", "onset", "friction"]
    for line, (second, onset) in zip(lines[1:], onsets.items(), strict=False):
        value, *told = line.split()
        assert value == f"{second:.4g}"
        ends = {-np.inf: "below range", np.inf: "none up to 0.4"}
        assert " ".join(told) == ends.get(onset, f"{onset:.4g}")
    assert "least friction at which a mode turns unstable" in lines[len(onsets) + 1]
    assert lines[1:3] == as_text(many.screen.findings(many)).splitlines()[3:5]


def test_a_point_that_failed_or_is_uncertain_leaves_its_design_without_an_answer(many):
    stable = many.points["frequency_2"] == 60.0
    for change in ({"status": "failed"}, {"n_unstable_high": 1}):
        points = many.points.copy()
        points.loc[stable & (points["friction"] == 0.2), list(change)] = list(change.values())
        onsets = first_onsets(many.with_tables(points=points), "friction")["onset"]
        assert np.isnan(onsets[60.0])


def test_a_point_that_grows_below_all_onsets_is_a_bound_and_what_is_not_refined_is_marked(many):
    """As real roots do, which have no track and no onset."""
    known = first_onsets(many, "friction")
    second = known.index[np.isfinite(known["onset"])][0]
    assert (known["mark"] == "").all()
    points = many.points.copy()
    points.loc[(points["frequency_2"] == second) & (points["friction"] == 0.2), "n_unstable"] = 1
    later = many.onsets.copy()
    later.loc[np.isclose(later["frequency_2"], second), "onset"] = 0.3
    first = first_onsets(many.with_tables(points=points, onsets=later), "friction")
    assert first.loc[second].tolist() == [0.2, "<= "]
    assert "<= 0.2" in as_text(onset_table(many.with_tables(points=points, onsets=later)))
    rough = many.onsets.assign(status="interpolated")
    assert first_onsets(many.with_tables(onsets=rough), "friction").loc[second, "mark"] == "~"
    for status in ("bracketed", "first_seen"):  # put at the unstable point, as design_table says
        bounds = many.with_tables(onsets=many.onsets.assign(status=status))
        assert first_onsets(bounds, "friction").loc[second, "mark"] == "<= "
        shown = as_text(onset_table(bounds))
        assert "~" not in shown
        assert "<=: the least friction of a solved point" in shown


def test_of_several_parameters_that_of_most_values_runs_down(tmp_path):
    more = '[[sweep]]\nparameter = "damping_ratio"\nvalues = [0.0, 0.01]\n'
    results = results_of(tmp_path / "r", [0.1, 0.4], np.linspace(74, 80, 7).tolist(), tables=more)
    lines = as_text(onset_table(results)).splitlines()
    assert lines[0].split() == ["frequency_2", "Hz", "damping_ratio", "0", "damping_ratio", "0.01"]
    table = first_onsets(results, "friction")["onset"].unstack("damping_ratio")  # noqa: PD010 - of a grid
    assert [line.split()[1:] for line in lines[1:8]] == [
        [f"{onset:.4g}" for onset in row] for row in table.to_numpy()
    ]


def test_a_mode_has_the_frequency_of_its_onset_where_it_grows_at_another():
    """Between onset and fastest growth it may move far: no sentence places the one at the other."""
    onsets = pd.DataFrame(
        {"track": [1, 1, 2], "onset": [0.5, 0.4, 0.4], "frequency_hz": [120.0, 116.4, 300.0]}
    )
    row = {"track": 1, "threshold": 0.4, "threshold_kind": "refined", "frequency_hz": 75.2}
    assert other_frequency(row, onsets) == " (116 Hz there)"
    assert other_frequency(row | {"frequency_hz": 115.8}, onsets) == " (116 Hz there)"  # 0.52 %
    assert other_frequency(row | {"frequency_hz": 116.0}, onsets) == ""
    assert other_frequency(row | {"threshold": 0.45}, onsets) == ""  # interpolated: not refined
    assert other_frequency(row | {"threshold": np.nan}, onsets) == ""
    assert other_frequency(row, None) == ""
    below = row | {"threshold": np.nan, "threshold_kind": "below range"}
    onsets = onsets.assign(status=["refined", "below_range", "below_range"])
    assert other_frequency(below, onsets) == " (116 Hz there)"
    several = onsets.assign(status="below_range")  # at the least value of more than one design
    assert other_frequency(below, several) == " (116 to 120 Hz there)"
    assert other_frequency(below | {"track": 2, "frequency_hz": 301.0}, onsets) == ""


def test_where_all_is_unstable_the_answer_is_how_fast_it_grows(tmp_path):
    results = results_of(tmp_path / "r", [0.4, 0.5], [75.0, 80.0])
    growth = results.modes.groupby("point_id")["growth_rate"].max()
    points = results.points.set_index("point_id").join(growth)
    least, most = (points.loc[points["growth_rate"].agg(f"idx{end}")] for end in ("min", "max"))
    told = [
        f"{row['growth_rate']:.1f} 1/s at friction {row['friction']:g}, "
        f"frequency_2 {row['frequency_2']:g} Hz"
        for row in (least, most)
    ]
    text = " ".join(as_text(results.screen.findings(results)).split())
    assert f"Some mode grows at every point, the fastest by {told[0]} to {told[1]}." in text
    lines = design_lines(results)
    assert answer(results, results.rank()[:0], lines) == []
    stable = [lines[0]._replace(unstable=1), lines[1]]
    assert "Some mode grows at every point" not in answer(results, results.rank(), stable)[0]


def test_of_many_designs_it_is_told_up_to_where_one_is_unstable_from_the_least_value_on(many):
    """Of abutment "below range" alone, where a pad flutters below a friction of 0.19 only."""
    seconds = sorted(many.points["frequency_2"].unique())
    points = many.points.assign(n_unstable=0, n_unstable_high=0)
    points.loc[points["friction"] == 0.1, ["n_unstable", "n_unstable_high"]] = 1
    end = {"direction": "out", "status": "refined", "onset": 0.15, "frequency_2": seconds[3]}
    begin = {"direction": "in", "status": "below_range", "onset": np.nan}
    rows = [end, end | {"onset": 0.12}, begin | {"frequency_2": seconds[3]}]
    rows += [{**end, "frequency_2": seconds[4], "onset": 0.3}]  # not where it turns quiet
    onsets = pd.DataFrame(rows).reindex(columns=many.onsets.columns)
    changed = many.with_tables(points=points, onsets=onsets)
    ends = last_ends(changed, "friction")
    assert tuple(ends.loc[seconds[3]]) == (0.15, "")
    assert ends["end"].notna().sum() == 1
    broken = {**end, "status": "broken", "onset": np.nan, "bracket_high": 0.1}
    for bracket_high, told in ((0.1, (0.15, "")), (points["friction"].unique()[1], (None, "<= "))):
        more = pd.DataFrame([*rows, broken | {"bracket_high": bracket_high}])
        more = more.reindex(columns=many.onsets.columns)
        also = last_ends(changed.with_tables(onsets=more), "friction").loc[seconds[3]]
        assert tuple(also) == (told[0] or bracket_high, told[1])
    points.loc[points["frequency_2"] == seconds[0], ["n_unstable", "n_unstable_high"]] = 0
    lines = as_text(onset_table(changed.with_tables(points=points))).splitlines()
    assert lines[4].split()[1:] == ["to", "0.15"]
    assert lines[-1] == "to: unstable from the least friction up to there, and at no larger one"
    points.loc[
        (points["frequency_2"] == seconds[3]) & (points["friction"] == 0.4), "n_unstable"
    ] = 1
    assert last_ends(changed.with_tables(points=points), "friction")["end"].isna().all()


def test_many_designs_that_are_unstable_at_the_least_value_are_a_sentence_not_a_table(many):
    """A table of 21 times 'below range', and no word on the 60 of 441 points that are stable."""
    points = many.points.assign(n_unstable=0, n_unstable_high=0)
    names = ["frequency_2"]
    first = points["friction"] == points["friction"].min()
    points.loc[first, ["n_unstable", "n_unstable_high"]] = 1
    all_below = many.with_tables(points=points)
    assert onset_table(all_below) == []
    told = _many_in_words(all_below)
    n, quiet = points[names[0]].nunique(), int((~first).sum())
    assert told == (
        f" At the least friction some mode is unstable at each of the {n} values of frequency_2. "
        f"No mode is unstable at {quiet} of {len(points)} solved points."
    )
    always = many.with_tables(points=points.assign(n_unstable=1, n_unstable_high=1))
    assert _many_in_words(always).endswith(" Some mode is unstable at every solved point.")
    assert _many_in_words(many) == ""


def test_modes_that_are_all_unstable_from_the_first_value_say_so_once(tmp_path):
    results = results_of(tmp_path / "r", [0.4, 0.5], [75.0])
    row = results.rank().iloc[0].to_dict()
    rows = [row | {"track": 6 + n, "frequency_hz": 90.0 * n, "family": n} for n in (1, 2)]
    table = pd.DataFrame(rows).assign(family_modes=1)
    said = onsets_in_words(results, table)
    assert said == "T7 at 90 Hz, T8 at 180 Hz, both already at the least friction"
    texts = ["T1 at 90 Hz already at the least v", "T2 at 9 Hz first at v 0.3"]
    assert alike_together(texts, "v") == texts
    more = ["T3 at 95 Hz already at the least v (99 Hz there)", texts[0], *texts]
    told = "T3 at 95 Hz, T1 at 90 Hz, T1 at 90 Hz, all already at the least v (there T3 at 99 Hz)"
    assert alike_together(more, "v") == [told, texts[1]]
    assert alike_together([texts[0]] * 3, "v")[0].endswith("90 Hz, all already at the least v")


def test_what_designs_change_of_the_contact_is_told_at_the_same_friction(tmp_path):
    results = results_of(tmp_path / "r", [0.2, 0.4], [75.0, 80.0])
    lines = design_lines(results)
    assert contact_rows(results, lines) == []  # where nothing opens
    opened = pd.DataFrame(
        {
            "friction": [0.2, 0.4, 0.2, 0.4],
            "frequency_2": [75.0, 75.0, 80.0, 80.0],
            "open_share": [0.02, 0.10, 0.03, 0.16],
            "contact_pressure_max": [1e5, 4e5, 1.1e5, 4.2e5],
            "status": "ok",
        }
    )
    ((name, text),) = contact_rows(SimpleNamespace(points=opened, along="friction"), lines)
    assert name == "contact"
    assert text == (
        "2.0 to 16.0 % of its area is open in steady sliding; between designs at the same friction "
        "that differs by up to 6.0 % of the area, and the largest pressure by up to 10.0 %"
    )
    # designs of other loads: friction_pressure said that the pressure differs by 1466.6 %
    loads = [line._replace(design={"pressure": 2e5 * (k + 1)}) for k, line in enumerate(lines)]
    ((_, text),) = contact_rows(SimpleNamespace(points=opened, along="friction"), loads)
    assert text.endswith("that differs by up to 6.0 % of the area")
    lifted = opened.assign(contact_pressure_max=[0.0, 0.0, 1.1e5, 4.2e5])  # was: by up to inf %
    ((_, text),) = contact_rows(SimpleNamespace(points=lifted, along="friction"), lines)
    assert text.endswith("of the area, and the largest pressure from none to some")
    alike = opened.assign(open_share=0.1, contact_pressure_max=[1e5, 4e5] * 2)
    assert contact_rows(SimpleNamespace(points=alike, along="friction"), lines) == []
    assert contact_rows(SimpleNamespace(points=opened, along="friction"), []) == []


def test_where_a_mode_diverges_is_in_the_answer(tmp_path):
    """x'' + 200 x' + 1e4 (1 - 2 p) x = 0 diverges beyond p = 1/2; beside it y grows beyond 3/4."""
    terms = {
        "M": ("M", np.eye(2)),
        "K": ("K", np.diag([1e4, 1e6])),
        "soft": ("K", np.diag([-2e4, 0.0])),
        "C": ("C", np.diag([200.0, 30.0])),
        "fed": ("C", np.diag([0.0, -40.0])),
    }
    family = write_family(tmp_path, terms, {"soft": "p", "fed": "p"})
    text = study_text("soft", "complex_modes", "matrices") + f'folder = "{tmp_path}"\n{family}'
    text += '[parameters]\np = 0.0\n[[sweep]]\nparameter = "p"\nstart = 0.0\nstop = 1.0\nnum = 11\n'
    results = solved(f"{text}[modes]\nreference_points = 0\n", tmp_path / "r")
    told = " ".join(as_text(results.screen.findings(results)).split())
    assert "Hz first at p 0.75; without oscillation first at p between 0.5 and 0.6." in told


def test_more_modes_than_a_point_has_are_called_tracks(tmp_path):
    """Two coordinates, with tracks of designs so far apart that nothing joins them."""
    text = study_text("pulled", "complex_modes", "hulten")
    text += "[parameters]\ndamping_ratio = 0.004\nsliding_speed = 0.4\n"
    text += '"friction_law.static_ratio" = 1.6\n"friction_law.decay_speed" = 0.3\n'
    text += '[[sweep]]\nparameter = "friction"\nstart = 0.02\nstop = 0.9\nnum = 9\n'
    text += '[[sweep]]\nparameter = "frequency_2"\nvalues = [40.0, 75.0, 90.0, 115.0]\n'
    results = solved(text + "[modes]\nreference_points = 0\n", tmp_path / "r")
    table = results.rank("share", None, None)
    named = table.drop_duplicates("family")["family_modes"].sum()
    assert named > results.points["n_modes"].max() == 2
    told = " ".join(as_text(results.screen.findings(results)).split())
    assert f"{named} tracks of modes, at most 2 at one point, are unstable between 1 and" in told


def test_modes_that_are_not_followed_have_an_answer_above_their_table(tmp_path):
    results = results_of(tmp_path / "r", [0.2, 0.4], [75.0], more="track = false\n")
    answer, table = as_text(results.screen.findings(results)).split("\n\n")[:2]
    assert answer.startswith("1 group of modes is unstable between 10 and 1000 Hz. Most")
    assert "50 % of the 2 solved points" in " ".join(answer.split())
    assert table.split()[0] == "mode"


def test_real_roots_that_grow_are_no_group_of_modes(tmp_path):
    """Of a bicycle it was "1 mode and 1 group of modes are unstable"."""
    results = results_of(tmp_path / "r", [0.2, 0.4], [75.0])
    table = results.rank("share", None, None)
    kind = {"kind": group_kind(OVERDAMPED_GROUP), "track": OVERDAMPED_GROUP, "family": 0}
    real = table.iloc[:1].assign(**kind)
    assert how_many(results, real, "").startswith("real roots are unstable between 10 and 1000 Hz")
    both = how_many(results, pd.concat([table, real], ignore_index=True), "")
    assert both.startswith("1 mode and real roots are unstable between 10 and 1000 Hz")
    assert how_many(results, table, "").startswith("1 mode is unstable between")
