"""Growth over friction, a line a design: largest growth of each point, and first onsets."""

import numpy as np
import pytest
from made_results import drawn
from study_runs import solved
from study_texts import study_text

from squealstudy.engine.pictures import pictures
from squealstudy.errors import ResultsError
from squealstudy.plots.designs import _ends

ONSET = 7 / 24  # of two modes of 100 and 75 Hz in closed form: (1 - (75 / 100)^2) / 1.5


def results_of(folder, seconds, frictions=(0.2, 0.25, 0.3, 0.4)):
    text = study_text("designs", "complex_modes", "hulten") + (
        f'[[sweep]]\nparameter = "friction"\nvalues = {list(frictions)}\n'
        f'[[sweep]]\nparameter = "frequency_2"\nvalues = {seconds}\n'
        "[modes]\nband = [10.0, 1000.0]\n"
    )
    return solved(text, folder)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    return results_of(tmp_path_factory.mktemp("two") / "r", [75.0, 60.0])


def test_lines_have_the_largest_growth_of_their_points_and_pass_their_onset(two):
    figure = two.plot.designs()
    lines = [line for line in figure.axes[0].lines if line.get_linestyle() in ("-", "--")][:2]
    labels = [line.get_label() for line in lines]
    assert labels == ["frequency_2 = 75 Hz: from 0.2917", "frequency_2 = 60 Hz"]
    growth = two.modes.groupby("point_id")["growth_rate"].max()
    for line, second in zip(lines, (75.0, 60.0), strict=True):
        of_design = two.points[two.points["frequency_2"] == second].set_index("friction")
        expected = growth[of_design["point_id"]].to_numpy()
        x, y = line.get_data()
        at_points = np.isin(x, of_design.index)
        assert np.allclose(y[at_points], expected)
    x, y = lines[0].get_data()
    assert x[y == 0.0] == pytest.approx([ONSET], abs=1e-4)
    title = "largest growth rate over friction, a line for each design"
    assert f"{title}; bars: where it turns unstable or stable, refined" in drawn(figure)
    assert [name for name, _, _ in pictures(two)].count("designs") == 1
    late = two.points["friction"] > ONSET
    points = two.points[late].reset_index(drop=True)
    modes = two.modes[two.modes["point_id"].isin(points["point_id"])].reset_index(drop=True)
    part = two.with_tables(points=points, modes=modes, onsets=two.table("onsets")[:0])
    labels = [str(line.get_label()) for line in part.plot.designs().axes[0].lines]
    assert "frequency_2 = 75 Hz: unstable at the first value" in labels
    assert "frequency_2 = 60 Hz" in labels


def test_a_line_ends_its_growth_where_the_last_mode_turns_stable():
    """It went straight from 112 1/s at 12 bar to a stable point at 20 bar, stable from 16.2 on."""
    x, y = np.array([2.0, 7.0, 12.0, 20.0, 30.0]), np.array([130.0, 142.0, 112.0, -20.0, -20.0])
    assert _ends(x, y, np.array([13.5, 16.2, 25.0])) == [16.2]
    assert _ends(x, y, np.array([25.0])) == []
    assert _ends(x, abs(y), np.array([13.5, 16.2])) == []


def test_of_designs_without_onset_no_bars_are_told(two, tmp_path):
    calm = results_of(tmp_path / "r", [50.0, 60.0], [0.1, 0.2])
    assert "largest growth rate over friction, a line for each design" in drawn(calm.plot.designs())


def test_points_without_a_mode_in_the_band_are_not_crossed_out_as_failed(two, tmp_path):
    text = study_text("narrow", "complex_modes", "hulten") + (
        '[[sweep]]\nparameter = "friction"\nvalues = [0.2, 0.3, 0.4]\n'
        '[[sweep]]\nparameter = "frequency_2"\nvalues = [75.0, 200.0]\n'
        "[modes]\nband = [150.0, 1000.0]\n"
    )
    narrow = solved(text, tmp_path / "r")
    assert set(narrow.points["status"]) == {"ok"}
    assert set(narrow.modes["point_id"]) < set(narrow.points["point_id"])
    crosses = [line for line in narrow.plot.designs().axes[0].lines if line.get_marker() == "x"]
    assert crosses == []
    empty = narrow.with_tables(modes=narrow.modes.iloc[:0])
    assert drawn(empty.plot.designs()) == ["no mode in the band"]


def test_many_designs_are_refused_and_not_drawn(tmp_path):
    many = results_of(tmp_path / "r", [60.0 + k for k in range(9)], [0.2])
    assert "designs" not in [name for name, _, _ in pictures(many)]
    with pytest.raises(ResultsError, match="9 designs, of which 8"):
        many.plot.designs()


def test_a_map_of_a_random_design_has_all_its_points(tmp_path):
    """Three points of Sobol indices differ in two parameters: a map was of these alone."""
    text = study_text("scatter", "complex_modes", "hulten") + "".join(
        f'[[sweep]]\nparameter = "{name}"\ndistribution = "uniform"\nstart = {low}\nstop = {high}\n'
        for name, low, high in (
            ("friction", 0.2, 0.6),
            ("frequency_1", 95.0, 105.0),
            ("frequency_2", 70.0, 80.0),
        )
    )
    text += '[design]\ntype = "sobol_indices"\nsamples = 8\n[modes]\nband = [10.0, 1000.0]\n'
    results = solved(text, tmp_path / "r")
    told = " ".join(drawn(results.plot.stability_map()))
    assert "of 40 points" in told
    assert "slices" not in told
