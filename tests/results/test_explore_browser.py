"""Pages to explore results, pointed at and clicked in a browser."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from browsed import Opened, browsed, chromium
from explored import brake_map
from study_runs import solved

import squealstudy as sq
from squealstudy.colours import GREY
from squealstudy.explore import runs
from squealstudy.explore.page import explore

pytestmark = browsed
WIDTHS = (400, 768, 1280, 1920)
STATES = """[study]
name = "two"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
values = [0.1, 0.2, 0.3, 0.4, 0.5]
[[sweep]]
parameter = "damping_ratio"
values = [0.0, 0.01, 0.02]
"""
RUNS = """[study]
name = "runs"
kind = "transient"
[model]
name = "hoffmann"
contact_law = "unilateral"
[parameters]
damping_ratio = 0.001
sliding_speed = 0.1
[[sweep]]
parameter = "friction"
values = [0.7, 0.9]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.1
step = 2e-5
perturbation = 1e-4
save_every = 1
"""
RECORDER = """window.AudioContext = class {
  createBuffer(channels, length, rate) {
    window.played = new Float32Array(length);
    return {getChannelData: () => window.played};
  }
  createBufferSource() { return {connect: () => null, start: () => null}; }
  close() {}
}"""
CYCLES = """[study]
name = "cycles"
kind = "limit_cycles"
[model]
name = "hoffmann"
contact_law = "cubic"
[parameters]
k1 = 1.31e6
k2 = 1.356e6
contact_stiffness = 2.6e6
"contact.cubic_stiffness" = -5.4e17
normal_force = 1000.0
sliding_speed = 10.0
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.5, 0.9]
[modes]
band = [100.0, 1000.0]
[limit_cycles]
families = [1]
reach = 0.5
"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def opened(browser, tmp_path):
    pages = []

    def open_page(results, width=1280, where=None):
        path = explore(results, where).save(tmp_path / "page.html")
        pages.append(Opened(browser, path, width))
        return pages[-1]

    yield open_page
    for page in pages:
        page.tab.close()
        assert page.said == []  # no message on the console, no error, no request


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Results in a directory, over friction and damping, which `modes` has a column for, too."""
    folder = tmp_path_factory.mktemp("two")
    return solved(STATES, folder / "r")


def test_pointing_and_clicking_a_map_shows_what_is_behind(opened):
    results = brake_map()
    page = opened(results)
    row = 3 * 5 + 2
    page.tab.mouse.move(*page.place("map", row))
    tip = page.text("tip").splitlines()
    assert tip[:3] == [f"design point {row}", "friction 0.4", "pressure 0.774597 MPa"]
    fastest = results.modes.loc[results.modes["point_id"] == f"{row:016x}", "growth_rate"].max()
    assert float(tip[3].split()[2]) == pytest.approx(fastest, rel=1e-3)
    page.tab.mouse.click(*page.place("map", row))
    assert page.text("facts").startswith(f"Design point {row}: friction 0.4, pressure 0.774597 MPa")
    own = results.modes[results.modes["point_id"] == f"{row:016x}"]
    table = page.tab.locator("#modes tr")
    assert table.count() == len(own) == 6
    shown = [float(table.nth(k).locator("td").nth(2).inner_text()) for k in range(6)]
    assert shown == sorted(shown, reverse=True)
    assert np.allclose(sorted(shown), sorted(own["growth_rate"]), atol=0.1)


def test_a_mode_is_chosen_in_the_diagram_or_in_the_table(opened):
    results = brake_map()
    page = opened(results)
    first = page.text("mode-title")
    page.tab.mouse.move(*page.place("diagram", 1))
    tip = page.text("tip").splitlines()
    page.tab.mouse.click(*page.place("diagram", 1))
    assert page.text("mode-title") == f"{tip[0]}, {tip[1]}" != first
    shares = page.text("energies").split("\n")
    assert sum(float(text.split()[0]) for text in shares[1::2]) == pytest.approx(100, abs=1)
    button = page.tab.locator("#modes button").nth(3)
    button.click()
    assert page.text("mode-title").startswith(page.tab.locator("#modes button").nth(3).inner_text())
    page.tab.get_by_role("button", name="frequency Hz").click()
    hertz = [float(c) for c in page.tab.locator("#modes td:nth-child(2)").all_inner_texts()]
    assert hertz == sorted(hertz)
    assert "squealstudy shape made --point" in page.text("shape")


def test_keys_and_the_slider_reach_what_the_mouse_does(opened):
    page = opened(brake_map())
    page.tab.locator("#map").focus()
    before = page.tab.locator("#row").input_value()
    page.tab.keyboard.press("ArrowLeft")
    after = page.tab.locator("#row").input_value()
    assert int(after) == int(before) - 5  # the next smaller friction
    page.tab.keyboard.press("ArrowDown")
    down = page.tab.locator("#row").input_value()
    page.tab.keyboard.press("ArrowUp")
    assert {down, page.tab.locator("#row").input_value()} != {down}
    page.tab.locator("#row").fill("7")
    page.tab.keyboard.press("Tab")
    assert page.text("facts").startswith("Design point 7: friction 0.2")
    page.tab.locator("#place").focus()
    page.tab.keyboard.press("ArrowRight")
    assert page.text("facts").startswith("Design point 12: friction 0.3")
    assert page.text("place-text") == "0.3"
    page.tab.locator("#modes button").first.focus()
    page.tab.keyboard.press("Enter")
    assert page.text("mode-title").startswith(page.tab.locator("#modes button").first.inner_text())


def test_a_selection_goes_on_in_pandas_and_in_a_study(opened, two, tmp_path):
    page = opened(two)
    low, high = page.place("map", 2), page.place("map", 5 + 3)  # (.3, 0) and (.4, .01)
    page.drag((low[0] - 12, low[1] + 12), (high[0] + 12, high[1] - 12))
    assert page.text("selected") == "4 of 15 design points are selected."
    line = page.text("pandas").splitlines()[-1]
    assert line == 'modes.query("0.3 <= friction <= 0.4 and 0 <= damping_ratio_of_point <= 0.01")'
    page.tab.locator("#band-low").fill("50")
    page.tab.keyboard.press("Tab")
    page.tab.locator("#band-high").fill("95")
    page.tab.keyboard.press("Tab")
    *before, last = page.text("pandas").splitlines()
    names = {}
    exec("\n".join([*before, f"found = {last}"]), names)
    found = names["found"]
    modes = two.modes.merge(two.points, on="point_id", suffixes=("", "_of_point"))
    wanted = modes[modes["friction"].between(0.3, 0.4) & (modes["damping_ratio_of_point"] <= 0.01)]
    wanted = wanted[wanted["frequency_hz"].between(50, 95)]
    assert 0 < len(found) == len(wanted)
    pd.testing.assert_frame_equal(found, wanted[list(found)], check_dtype=False)
    path = tmp_path / "closer.toml"
    path.write_text(page.text("study"))
    plan = sq.read_study(path).plan()
    for sweep, ends in zip(plan.study.sweeps, ((0.3, 0.4), (0.0, 0.01)), strict=True):
        assert list(sweep.halved(0)) == pytest.approx(np.linspace(*ends, 9))
    page.tab.get_by_role("button", name="select all").click()
    assert "point_id ==" in page.text("pandas")
    path.write_text(page.text("study"))
    assert len(sq.read_study(path).plan().study.sweeps[0].halved(0)) == 9
    with page.tab.expect_download() as download:
        page.tab.locator("#save-study").click()
    assert download.value.suggested_filename == "closer.toml"


def test_what_is_taken_of_a_part_is_of_that_part(opened, two, tmp_path):
    page = opened(two, where="damping_ratio == 0.01")
    page.tab.get_by_label("friction from").fill("0.3")
    page.tab.keyboard.press("Tab")
    assert page.text("selected") == "3 of 5 design points are selected."
    *before, last = page.text("pandas").splitlines()
    names = {}
    exec("\n".join([*before, f"found = {last}"]), names)
    assert names["found"]["point_id"].nunique() == 3
    path = tmp_path / "closer.toml"
    path.write_text(page.text("study"))
    damping = sq.read_study(path).plan().study.sweeps[1]
    assert (damping.name, list(damping.values)) == ("damping_ratio", [0.01])


def test_a_band_that_is_brushed_is_what_the_map_shows(opened):
    results = brake_map()
    page = opened(results)
    first, second = page.place("diagram", 0), page.place("diagram", 2)
    page.drag((first[0] - 8, first[1]), ((second[0] + first[0]) / 2, first[1] + 30))
    low = float(page.tab.locator("#band-low").input_value())
    high = float(page.tab.locator("#band-high").input_value())
    assert 500 <= low < high < 8000
    assert page.tab.locator("#colour option:checked").inner_text() == "fastest growth in the band"
    modes = results.modes[results.modes["frequency_hz"].between(low, high)]
    page.tab.mouse.move(*page.place("map", 0))
    told = page.text("tip").splitlines()[-1]
    fastest = modes.loc[modes["point_id"] == "0" * 16, "growth_rate"].max()
    assert told.startswith("fastest growth in the band: ")
    assert float(told.split()[-2]) == pytest.approx(fastest, rel=1e-2)
    for name, value in (("high", "90001"), ("low", "90000")):
        page.tab.locator(f"#band-{name}").fill(value)
        page.tab.keyboard.press("Tab")
    none = "This design point has no mode in the chosen band on this page."
    assert page.text("mode-facts") == none
    page.tab.get_by_role("button", name="whole band").click()
    assert page.tab.locator("#colour option:checked").inner_text() == "fastest growth"


def test_parameters_that_the_map_does_not_show_are_chosen_above_it(opened, tmp_path):
    text = STATES + '[[sweep]]\nparameter = "frequency_2"\nvalues = [75.0, 80.0]\n'
    page = opened(solved(text, tmp_path / "three"))
    shown = "Bokeh.documents[0].get_model_by_name('points').data.x.length"
    assert page.tab.evaluate(shown) == 15
    page.tab.get_by_label("frequency_2", exact=True).select_option("all")
    assert page.tab.evaluate(shown) == 30
    page.tab.locator("#up").select_option("frequency_2")
    assert page.tab.evaluate(shown) == 10


def test_a_history_is_enlarged(opened, tmp_path):
    results = solved(RUNS, tmp_path / "runs")
    page = opened(results)
    assert page.text("facts").startswith("Design point 1: friction 0.9. class: ")
    assert "5001 rows are kept." in page.text("history-note")
    assert page.tab.locator("#sound").is_visible()
    start, end = page.place("history", 1000), page.place("history", 2000)
    page.drag((start[0], start[1]), (end[0], start[1] + 5))
    low, high = (float(page.tab.locator(f"#{name}").input_value()) for name in ("from", "to"))
    assert low == pytest.approx(0.02, abs=1e-3)
    assert high == pytest.approx(0.04, abs=1e-3)
    page.tab.get_by_role("button", name="whole run").click()
    assert float(page.tab.locator("#to").input_value()) == pytest.approx(0.1, abs=1e-4)
    page.tab.locator("#before").click()
    assert page.text("facts").startswith("Design point 0: friction 0.7.")
    assert page.text("pandas").endswith(
        f"points.query(\"point_id == '{results.points.point_id[0]}'\")"
    )


def test_why_a_run_has_no_history_on_the_page_is_told(opened, tmp_path, monkeypatch):
    results = solved(RUNS, tmp_path / "runs")
    monkeypatch.setattr(runs, "MOST_ROWS", 2 * runs.LEAST_BINS)  # room for one history
    page = opened(results)
    page.tab.mouse.click(*page.place("map", 1))
    assert page.text("history-note").startswith("The history of this run is not on this page")
    text = RUNS.replace("save_every = 1", "save_every = 0")
    page = opened(solved(text, tmp_path / "none"))
    assert "save_every above 0 keeps them" in page.text("history-note")


def test_a_run_is_heard(opened, tmp_path):
    """Samples of what is shown are the run's own, and what is played is said."""
    results = solved(RUNS, tmp_path / "runs")
    page = opened(results)
    history = results.history(1)
    assert page.text("sound-note").startswith("Plays ")  # before it does
    page.tab.locator("#sound").click()  # the browser's own audio
    assert "from 0 to 0.1 s, as fast as the run." in page.text("sound-note")
    page.tab.evaluate(f"() => {{ {RECORDER} }}")
    for name, value in (("from", "0.02"), ("to", "0.04")):
        page.tab.locator(f"#{name}").fill(value)
        page.tab.keyboard.press("Tab")
    page.tab.locator("#slower").select_option("10")
    page.tab.locator("#sound").click()
    sound = np.array(page.tab.evaluate("Array.from(window.played)"))
    assert len(sound) == pytest.approx(0.02 * 10 * 48000, abs=1)
    time = 0.02 + np.arange(len(sound)) / 480_000
    torque = np.interp(time, history["time"], history["torque"])
    wanted = torque - torque.mean()
    assert np.abs(sound).max() == pytest.approx(1.0)
    assert np.allclose(sound, wanted / np.abs(wanted).max(), atol=1e-2)  # times of 16 bits
    note = page.text("sound-note")
    assert "from 0.02 to 0.04 s, slower by 10: 1000 Hz sound as 100 Hz." in note
    assert "it does not tell how loud the brake is" in note


def test_verdicts_and_levels_of_cycles(opened, tmp_path):
    results = solved(CYCLES, tmp_path / "cycles")
    page = opened(results)
    assert page.text("legend").split("\n")[0] == "verdict:"
    for row in (0, 1):
        page.tab.mouse.click(*page.place("map", row))
        verdict = results.points["verdict"].iloc[row].replace("_", " ")
        assert f"verdict: {verdict}" in page.text("facts")
        assert verdict in page.text("modes")
    data = "Bokeh.documents.at(-1).get_model_by_name('points').data"
    stable = results.cycles[results.cycles["torque_rms"].notna()]
    assert page.tab.evaluate(f"{data}.x.length") == len(stable)
    page.tab.mouse.move(*page.place("line", 0))
    assert "cycle" in page.text("tip")


def test_levels_of_runs_and_designs_without_a_level_are_shown(opened, tmp_path):
    """Of the first design a run alone tells the level, of the second nothing does."""
    results = solved(CYCLES, tmp_path / "cycles")
    first, second = results.points["point_id"]
    verdicts, points = results.table("verdicts").copy(), results.points.copy()
    one = verdicts.index[verdicts["point_id"] == first][0]
    verdicts.loc[one, ["run_status", "torque_rms", "cycle_frequency_hz"]] = ("lasts", 77.0, 210.0)
    points.loc[0, "torque_rms"], points.loc[1, "torque_rms"] = 77.0, np.nan
    points.loc[1, "verdict"] = "undecided"
    none = results.cycles.iloc[:0]
    changed = results.with_tables(points=points, verdicts=verdicts, cycles=none)
    page = opened(changed)
    data = "Bokeh.documents.find(d => d.get_model_by_name('{0}')).get_model_by_name('points').data"
    line, shown = (page.tab.evaluate(data.format(name)) for name in ("line", "map"))
    assert list(line["y"]) == pytest.approx([77.0], rel=1e-3)
    assert list(line["marker"]) == ["x"]
    page.tab.mouse.move(*page.place("line", 0))
    assert "motion of a run in time" in page.text("tip")
    assert np.isfinite(shown["y"]).all()
    assert shown["y"][1] < shown["y"][0]
    assert shown["marker"][1] == "inverted_triangle"
    assert "no RMS of friction force known: at the lower edge" in page.text("legend")
    page.tab.mouse.click(*page.place("map", 1))
    assert "verdict: undecided" in page.text("facts")
    assert second in page.text("pandas")


def test_a_branch_of_unknown_stability_is_not_drawn_as_unstable(opened, tmp_path):
    results = solved(CYCLES, tmp_path / "cycles")
    stable = pd.array([True, False, None], dtype="boolean")
    branches = pd.DataFrame({"stable": stable}).reindex(columns=list(results.table("branches")))
    branches = branches.assign(point_id=results.points["point_id"][0], cycle_id="1", mode=1)
    branches = branches.assign(along="friction", value=[0.5, 0.6, 0.7], torque_rms=[9.0, 8.0, 7.0])
    page = opened(results.with_tables(branches=branches))
    found = "Bokeh.documents.find(d => d.get_model_by_name('line')).get_model_by_name('lines').data"
    first, second, third = page.tab.evaluate(f"{found}.colour")
    assert len({first, second, third}) == 3
    assert third == GREY


def test_of_a_failed_point_no_modes_are_counted(opened, tmp_path):
    """Nor is anything unstable or not at one whose band has no modes."""
    text = STATES.split("[[sweep]]")[0].replace("hulten", "hoffmann")
    text += """contact_law = "unilateral"
[parameters]
sliding_speed = -0.5
[[sweep]]
parameter = "friction"
values = [0.3, 0.8, 5.0]
[modes]
band = [130.0, 200.0]
"""
    page = opened(solved(text, tmp_path / "r"))
    told = []
    for row in range(3):
        page.tab.mouse.click(*page.place("map", row))
        told.append(page.text("facts"))
    assert "0 of 1 modes here are unstable" in told[0]
    assert told[1].endswith("No mode here.")
    assert "Status: working_point" in told[2]
    assert "unstable" not in told[1] + told[2]


def test_names_of_others_stay_text(opened):
    name = "</script><img src=x onerror=\"window.hacked=1\">$$x$$ `a`'b'"
    results = brake_map(second=name, name=name)
    results.points.loc[0, ["status", "message"]] = ("failed", name)
    page = opened(results)
    page.tab.mouse.move(*page.place("map", 0))
    assert name in page.text("tip")
    page.tab.mouse.click(*page.place("map", 0))
    page.tab.get_by_label(f"{name} from").fill("1")
    page.tab.keyboard.press("Tab")
    assert page.text("pandas").splitlines()[-1].startswith('modes.query("point_id in [')
    assert page.tab.evaluate("window.hacked") is None
    assert page.tab.locator("img").count() == 0


@pytest.mark.parametrize(
    "width",  # by default the narrowest and the widest
    [pytest.param(w, marks=[pytest.mark.full_size] * (w in WIDTHS[1:-1])) for w in WIDTHS],
)
def test_a_page_fits_its_window(opened, two, width):
    page = opened(two, width)
    assert page.tab.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.tab.locator("#map canvas").first.bounding_box()["width"] > 0.4 * min(width, 900)
    page.tab.emulate_media(media="print")
    assert not page.tab.locator("#copy-line").is_visible()
    assert page.tab.locator("#modes button").first.is_visible()


@pytest.mark.full_size
def test_20000_design_points_open_and_answer_at_once(browser, tmp_path):
    results = brake_map(across=200, up=100, n_modes=48)
    path = explore(results).save(tmp_path / "page.html")
    assert path.stat().st_size <= 25_000_000
    tab = browser.new_page(viewport={"width": 1400, "height": 900})
    asked = tab.context.new_cdp_session(tab)
    asked.send("Performance.enable", {"timeDomain": "threadTicks"})

    def seconds(name):
        """Of its thread, whatever else the machine does."""
        metrics = asked.send("Performance.getMetrics")["metrics"]
        return next(m["value"] for m in metrics if m["name"] == name)

    tab.goto(path.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=60_000)
    assert seconds("TaskDuration") <= 2.0
    for name in ("map", "diagram", "line"):
        tab.locator(f"#{name}").scroll_into_view_if_needed()
        tab.wait_for_timeout(300)
        box, before = tab.locator(f"#{name}").bounding_box(), seconds("ScriptDuration")
        for k in range(100):
            tab.mouse.move(box["x"] + 80 + 4 * k, box["y"] + 60 + 2 * k)
        tab.wait_for_timeout(300)
        assert (seconds("ScriptDuration") - before) / 100 <= 0.016, name
    tab.close()
