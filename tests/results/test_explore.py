"""Pages to explore results: what they hold, to which error, and what they refuse."""

from __future__ import annotations

import os
from html import unescape

import numpy as np
import pandas as pd
import pytest
from explored import brake_map, content_of
from made_results import made
from study_runs import command, plan_of, solved
from study_texts import study_text

from squealstudy.colours import FILLS, RUN_FILLS
from squealstudy.engine.results import EXPLORED
from squealstudy.errors import ResultsError
from squealstudy.explore import complex_modes, page, runs, shapes
from squealstudy.explore.packed import (
    packed_exact,
    packed_numbers,
    packed_single,
    packed_whole,
    packed_words,
    unpacked,
)
from squealstudy.explore.points import NOT_OK, classes, study_head

HULTEN = study_text("flutter", "complex_modes", "hulten")
HULTEN += '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.2, 0.4, 0.5]\n'
HOSTILE = '</script><script>hacked=1</script><img src=x onerror="hacked=2">'
PNG = b"\x89PNG\r\n\x1a\n rest"


@pytest.fixture(scope="module")
def results():
    return brake_map()


@pytest.fixture(scope="module")
def content(results):
    return content_of(page.explore(results).html)


# -- columns ------------------------------------------------------------------------------------
@pytest.mark.parametrize("values", [[1.0, 2.0, 7.5], [3.0], [np.nan, -1e6, 4e-3], [np.nan], []])
def test_numbers_in_16_bits_are_within_their_error(values):
    packed = packed_numbers(np.array(values))
    again = unpacked(packed)
    np.testing.assert_array_equal(np.isnan(again), np.isnan(values))
    known = np.isfinite(again)
    difference = np.abs(again[known] - np.array(values)[known])
    spread = np.ptp(np.array(values)[known]) if known.any() else 0.0
    assert packed["error"] == pytest.approx(spread / 65534 / 2)
    assert (difference <= packed["error"] * (1 + 1e-9) + 1e-15 * spread).all()


def test_whole_numbers_words_and_exact_numbers_stay_what_they_are():
    assert unpacked(packed_whole(np.array([0, 7, 65534]))).tolist() == [0, 7, 65534]
    assert unpacked(packed_words(["b", "a"], ["a", "b"])).tolist() == [1, 0]
    assert unpacked(packed_exact(np.array([0.1, np.pi]))).tolist() == [0.1, np.pi]
    with pytest.raises(ValueError, match="16 bits"):
        packed_whole(np.array([65536]))


def test_numbers_in_32_bits_have_six_digits_each():
    values = np.array([-3e6, 1.2345678e-7, np.nan, 0.1, 0.0])
    np.testing.assert_allclose(unpacked(packed_single(values)), values, rtol=1e-7)


def test_a_page_has_six_digits_of_each_mode(results, content):
    own, modes = content["own"], results.modes
    assert unpacked(own["counts"]).tolist() == [6] * 35
    for name in ("frequency_hz", "growth_rate", "error_estimate"):
        np.testing.assert_allclose(unpacked(own[name]), modes[name], rtol=1e-7)
    for k, name in enumerate(own["energies"]):
        column = "energy_" + name.replace(" ", "_")
        assert np.abs(unpacked(own["shares"][k]) - modes[column]).max() < 1e-5
    unstable = unpacked(own["flags"]).astype(int) & complex_modes.UNSTABLE
    assert unstable.astype(bool).tolist() == modes["unstable"].tolist()
    assert unpacked(own["track"]).tolist() == modes["track"].tolist()


def test_slow_growth_stays_what_it_is_beside_a_root_that_decays_at_once():
    results = brake_map()
    results.modes.loc[0, ["growth_rate", "unstable", "stability"]] = (1e-9, True, "unstable")
    results.modes.loc[1, ["growth_rate", "overdamped"]] = (-1e6, True)
    content = content_of(page.explore(results).html)
    own, fastest = content["own"], content["measures"][0]
    assert int(unpacked(own["flags"])[0]) & complex_modes.UNSTABLE
    np.testing.assert_allclose(unpacked(own["growth_rate"])[:2], [1e-9, -1e6], rtol=1e-7)
    assert unpacked(fastest["values"])[0] == pytest.approx(1e-9, rel=1e-7)


def test_a_swept_parameter_of_one_value_is_on_the_page():
    """Else a study for a closer look would have the value of its [parameters]."""
    content = content_of(page.explore(brake_map(up=1)).html)
    assert [p["name"] for p in content["points"]["parameters"]] == ["friction", "pressure"]


def test_a_map_has_the_values_of_the_tables(results, content):
    first, second = content["points"]["parameters"]
    assert unpacked(first["values"]).tolist() == results.points["friction"].tolist()
    assert unpacked(second["values"]).tolist() == results.points["pressure"].tolist()
    assert (first["log"], second["log"]) == (False, True)
    assert (second["unit"], second["factor"]) == ("MPa", 1e-6)
    fastest, count, least, hertz = content["measures"]
    by_point = results.modes.groupby("point_id")
    growth = by_point["growth_rate"].max().to_numpy()
    np.testing.assert_allclose(unpacked(fastest["values"]), growth, rtol=1e-7)
    assert unpacked(count["values"]).tolist() == results.points["n_unstable"].tolist()
    damping = by_point["damping_ratio"].min().to_numpy()
    np.testing.assert_allclose(unpacked(least["values"]), damping, rtol=1e-7)
    place = by_point["growth_rate"].idxmax()
    there = results.modes.loc[place, "frequency_hz"].to_numpy()
    np.testing.assert_allclose(unpacked(hertz["values"]), there, rtol=1e-7)


def test_of_too_many_modes_those_that_grow_and_the_lightest_are_there(results, monkeypatch):
    monkeypatch.setattr(
        complex_modes, "MAX_BYTES", 60 * 24
    )  # 60 modes of 3 columns of 4 bytes and 6 of 2
    of_60 = content_of(page.explore(results).html)
    own = of_60["own"]
    modes = results.modes
    lightest = np.sort(modes["damping_ratio"])[59]
    assert own["lightest"] == pytest.approx(lightest)
    assert own["n"] == int(unpacked(own["counts"]).sum()) == 60
    assert own["n_all"] == len(modes)
    monkeypatch.setattr(complex_modes, "MAX_BYTES", 24)
    few = content_of(page.explore(results).html)
    assert few["own"]["n"] == modes["unstable"].sum() > 1
    assert any("those that grow" in text for text in few["notes"])
    fastest = modes.groupby("point_id", sort=False)["growth_rate"].max()  # of those not there, too
    for content in (few, of_60):
        (growth,) = [m for m in content["measures"] if m["name"] == "fastest growth"]
        np.testing.assert_allclose(unpacked(growth["values"]), fastest, rtol=1e-6)


def test_a_query_chooses_design_points_and_keeps_their_numbers(results):
    found = content_of(page.explore(results, "friction > 0.65").html)
    assert found["points"]["rows"] == list(range(30, 35))
    assert len(unpacked(found["own"]["mode"])) == 30
    assert found["notes"][0] == "5 of 35 design points are on this page."
    with pytest.raises(ResultsError, match="no design point fits"):
        page.explore(results, "friction > 5")
    with pytest.raises(ResultsError, match="fricton"):
        page.explore(results, "fricton > 0.5")


def test_too_many_design_points_are_refused_with_what_helps(results, monkeypatch):
    monkeypatch.setattr(page, "MOST_POINTS", 34)
    with pytest.raises(ResultsError, match=r"holds 34 .* are 35: choose some, such as --where"):
        page.explore(results)


def test_a_study_for_a_closer_look_is_the_study_without_its_sweeps(results):
    head = study_head(results)
    study = plan_of(head + '\n[[sweep]]\nparameter = "friction"\nvalues = [0.1]\n')
    assert study.study.definition.study.name == "map_closer"
    assert study.study.definition.model.name == "hulten"
    assert study_head(brake_map(study="no = [study")) == ""


@pytest.mark.parametrize("fills", [FILLS, RUN_FILLS])
def test_failed_points_have_a_marker_of_their_own(fills):
    words = list(fills)
    content = classes("class", words, ["ok"] * len(words), fills)
    assert content["words"][-1] == NOT_OK
    assert len(set(content["markers"])) == len(content["words"]) == len(fills) + 1


def test_growth_of_round_off_is_not_unstable_on_the_map():
    results = brake_map()
    rows = results.modes["point_id"] == "0" * 16
    results.modes.loc[rows, ["growth_rate", "unstable", "stability"]] = (1e-13, False, "stable")
    results.points.loc[0, "n_unstable"] = 0
    fastest = content_of(page.explore(results).html)["measures"][0]
    assert unpacked(fastest["unstable"]).tolist() == (results.points["n_unstable"] > 0).tolist()
    assert not unpacked(fastest["unstable"])[0]


# -- text from results --------------------------------------------------------------------------
def test_names_from_results_are_no_markup():
    text = f"[study]\nname = 'x'\nkind = 'complex_modes'\ndescription = '{HOSTILE}'\n"
    results = brake_map(second=HOSTILE, name=HOSTILE, model=HOSTILE, study=text)
    results.points.loc[3, ["status", "message"]] = ("failed", HOSTILE)
    html = page.explore(results).html
    assert "<script>hacked" not in html
    assert "<img" not in html.split('<script id="data"')[0].split("<script>")[0]
    found = content_of(html)
    assert found["points"]["parameters"][1]["name"] == HOSTILE
    assert found["points"]["notes"]["3"] == HOSTILE
    assert html.count("</script>") == 3


def test_placeholders_in_results_are_not_filled_in():
    assert "<h1>@@library@@</h1>" in page.explore(brake_map(name="@@library@@")).html


# -- shapes -------------------------------------------------------------------------------------
def test_shapes_that_are_stored_are_on_the_page(tmp_path, monkeypatch):
    results = brake_map()
    object.__setattr__(results, "directory", tmp_path)
    folder = tmp_path / "shapes"
    folder.mkdir()
    point = results.points["point_id"].iloc[4]
    (folder / f"T3_3144_hz_{point}.png").write_bytes(PNG)
    (folder / f"mode_2_{point}.png").write_bytes(b"<svg onload=hacked()>")
    data = '<script id="data" type="application/json">{"title": "t\\u003c"}</script>'
    (folder / f"T3_3144_hz_{point}.html").write_text(f"<script>hacked()</script>{data}")
    (folder / "T3_3144_hz_ffffffffffffffff.png").write_bytes(PNG)
    outside = tmp_path.parent / "outside.png"
    outside.write_bytes(PNG)
    os.symlink(outside, folder / f"T4_{point}.png")
    found, left = shapes.shapes_content(results, results.points)
    assert found.keys() == {"4 T3"}
    assert left == 0
    assert "hacked" not in found["4 T3"]["html"]
    assert '{"title":"t\\u003c"}' in found["4 T3"]["html"]
    monkeypatch.setattr(shapes, "MOST_BYTES", 3)
    assert shapes.shapes_content(results, results.points) == ({}, 3)


# -- other kinds --------------------------------------------------------------------------------
def test_histories_keep_their_extremes(monkeypatch):
    time = np.linspace(0.0, 1.0, 10_001)
    torque = np.sin(900 * time)
    torque[7777] = 9.0
    history = pd.DataFrame({"time": time, "torque": torque})
    whole = runs._extremes(history, 6000)
    assert (whole["rows_a_part"], len(unpacked(whole["time"]))) == (1, 10_001)
    told = runs._extremes(history, 100)
    drawn = unpacked(told["torque"])
    assert (told["rows_a_part"], len(drawn)) == (101, 200)
    assert drawn.max() == pytest.approx(9.0)
    assert drawn.min() == pytest.approx(torque.min(), abs=told["torque"]["error"])


@pytest.mark.parametrize(("every", "shows"), [(1, True), (8, True), (30, False), (57, False)])
def test_rows_that_do_not_show_the_motion_are_drawn_by_their_extremes(every, shows):
    """Of 20 steps a period: one of 57 rows would be heard as a sixth of its frequency."""
    time = 1e-3 * np.arange(60_001)
    torque = np.sin(2 * np.pi * 50.0 * time)
    rows = np.arange(0, len(time), every)
    low, high = (
        np.array([torque[0]] + [f(torque[k - every + 1 : k + 1]) for k in rows[1:]])
        for f in (np.min, np.max)
    )
    history = pd.DataFrame(
        {"time": time[rows], "torque": torque[rows], "torque_min": low, "torque_max": high}
    )
    told = runs._extremes(history, 40_000)
    assert told["shows_motion"] == shows
    drawn = unpacked(told["torque"])
    assert len(drawn) == len(rows) * (1 if shows else 2)
    assert np.ptp(drawn[:100]) == pytest.approx(2.0, abs=0.1)


def test_times_of_a_history_are_those_of_its_rows():
    """Rounded to 16 bits they were off by .3 of the distance of rows, which was heard as noise."""
    time = np.linspace(0.0, 1.0, 40_000)
    told = runs._extremes(pd.DataFrame({"time": time, "torque": np.sin(9e3 * time)}), 20_000)
    assert np.abs(unpacked(told["time"]) - time).max() < 0.01 * time[1]


@pytest.mark.parametrize("kind", ["design", "sensitivity", "work_precision", "method_stability"])
def test_kinds_without_a_page_get_one_sentence(kind):
    with pytest.raises(ResultsError) as caught:
        page.explore(made(kind))
    assert str(caught.value) == (
        f"made: results of kind {kind} have no page to explore, which is of complex modes, limit "
        "cycles, runs in time; squealstudy report shows them"
    )


def test_kinds_that_are_completed_in_an_editor_have_a_page():
    assert set(EXPLORED) == set(page.KINDS)
    assert "explore" in dir(brake_map())
    assert "explore" not in dir(made("sensitivity"))


# -- the command, and notebooks -----------------------------------------------------------------
def test_the_command_writes_the_page(tmp_path, capsys):
    solved(HULTEN, tmp_path / "r")
    target = tmp_path / "page.html"
    assert command("explore", str(tmp_path / "r"), "-o", str(target)) == 0
    assert capsys.readouterr().out.split() == [str(target)]
    assert content_of(target.read_text(encoding="utf-8"))["points"]["n"] == 4


def test_a_notebook_shows_the_page_that_is_saved(results, tmp_path):
    explored = results.explore("friction < 0.5")
    shown = explored._repr_html_()
    assert shown.startswith("<iframe")
    inside = unescape(shown.partition('srcdoc="')[2].removesuffix('"></iframe>'))
    assert inside == explored.save(tmp_path / "page.html").read_text(encoding="utf-8")


def refusal(capsys, *arguments):
    assert command("explore", *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def test_refusals_are_one_line_and_write_nothing(tmp_path, capsys, monkeypatch):
    solved(HULTEN, tmp_path / "r")
    results, target = str(tmp_path / "r"), tmp_path / "page.html"
    to = ("-o", str(target))
    assert "no manifest.json here" in refusal(capsys, str(tmp_path), *to)
    assert "no such results directory" in refusal(capsys, str(tmp_path / "none"), *to)
    monkeypatch.setattr(page, "find_spec", lambda name: None)
    told = refusal(capsys, results, *to)
    assert "needs Bokeh, which is missing: pip install 'squealstudy[explore]'" in told
    manifest = tmp_path / "r" / "manifest.json"
    (tmp_path / "r" / "points.parquet").unlink()
    assert "the run is not finished; run the study again" in refusal(capsys, results, *to)
    assert manifest.exists()
    assert not target.exists()
