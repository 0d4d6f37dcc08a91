import inspect
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_results import drawn, made
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection, PolyCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from scipy.spatial import cKDTree
from study_runs import solved
from study_texts import study_text

from squealstudy.engine.pictures import plots, save_figure
from squealstudy.errors import ResultsError
from squealstudy.plots import plane
from squealstudy.plots import stability_diagram as diagram
from squealstudy.plots import stability_map as maps
from squealstudy.plots.plane import study_plane
from squealstudy.plots.ranking_bars import mean_energies
from squealstudy.plots.stability_diagram import Label, place_labels
from squealstudy.plots.style import (
    Quantity,
    damping_limits,
    is_geometric,
    legend_below,
    new_figure,
    quantity,
    set_ticks,
    shade_unstable,
)
from squealstudy.plots.tables import turns_in_words

ENDS = ("point_before", "point_after")
ONSETS = pd.DataFrame(columns=["track", "direction", "onset", "status", *ENDS])
UNITS = {"friction": "", "pressure": "Pa", "sliding_speed": "m/s"}
MU, P = np.linspace(0.0, 0.7, 8), np.array([2e5, 4e5, 8e5, 12e5, 20e5, 30e5])


def results_of(points, modes, units=None, **facts):
    return made(units=units, points=points, modes=modes, onsets=ONSETS, facts=facts)


def stability_diagram(points, modes, point_id=None, colour_by=None, units=None):
    return results_of(points, modes, units).plot.stability_diagram(
        point_id=point_id, colour_by=colour_by
    )


def evolution(points, modes, along, fixed=None, units=None, show="damping_ratio"):
    results = results_of(points, modes, units)
    return results.plot.evolution(along=along, fixed=fixed, show=show)


def stability_map(points, modes, x, y, fixed=None, units=None, measure="count", solved=None):
    results = results_of(points, modes, units)
    if solved is not None:  # a boundary design
        vars(results)["nodes"] = (points, solved)
    return results.plot.stability_map(x=x, y=y, fixed=fixed, measure=measure)


def ranking(points, modes, top=12, **facts):
    return results_of(points, modes, **facts).plot.ranking(top=top)


def points_table(friction, pressure, failed=(), **others):
    n = len(friction)
    status = ["working_point" if i in failed else "ok" for i in range(n)]
    head = {"point_id": [f"p{i}" for i in range(n)], "status": status, "message": "", "wall_s": 1.0}
    swept = {"friction": friction, "pressure": pressure, "sliding_speed": 0.5}
    nan = {"reference_frequency_error": np.nan, "reference_damping_error": np.nan}
    return pd.DataFrame(head | swept | others | {"n_modes": 6} | nan)


def modes_table(points):
    """Four tracks: 1 locks in with 2 at mu = 0.4, 3 is stable, 4 heavily damped."""
    rows = []
    for point in points[points["status"] == "ok"].to_dict("records"):
        mu, p = point["friction"], point["pressure"] / 1e6
        zeta = {1: 0.008 - 0.02 * mu, 2: 0.002 + 0.03 * mu, 3: 0.004 + 1e-3 * p, 4: 0.2}
        for track, z in zeta.items():
            frequency = {1: 3000 + 60 * mu, 2: 3100 - 60 * mu, 3: 5000 + 80 * p, 4: 900}[track]
            rows.append(
                {"point_id": point["point_id"], "mode": track, "track": track, "track_mac": 0.99}
                | {"frequency_hz": float(frequency), "damping_ratio": z, "residual": 1e-14}
                | {"energy_disc": 0.5, "energy_pad": 0.2 + 0.1 * mu}
            )
    modes = pd.DataFrame(rows)
    modes["growth_rate"] = -modes["damping_ratio"] * 2 * np.pi * modes["frequency_hz"]
    modes["unstable"] = modes["damping_ratio"] < 0
    modes["overdamped"] = False
    modes["track_ambiguous"] = False
    modes["energy_interfaces"] = 1.0 - modes["energy_disc"] - modes["energy_pad"]
    return modes


def grid(failed=()):
    mu, p = np.meshgrid(MU, P)
    points = points_table(mu.ravel(), p.ravel(), failed)
    return points, modes_table(points)


def one_line(failed=()):
    points = points_table(MU, np.full(len(MU), 12e5), failed)
    return points, modes_table(points)


def stable(tables):
    points, modes = tables
    return points, modes.assign(
        damping_ratio=modes["damping_ratio"].abs() + 1e-3,
        growth_rate=-1.0 - modes["growth_rate"].abs(),
        unstable=False,
    )


def dots(axes):
    """Points of each scatter."""
    return [len(c.get_offsets()) for c in axes.collections if isinstance(c, PathCollection)]


# -- what all pictures share


def test_very_many_dots_leave_none_out_that_could_be_seen():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 400_000))
    chosen = np.flatnonzero(x + y > -1)
    kept = diagram._last_of_each_cell(x, y, chosen)
    assert len(kept) < len(chosen) / 2
    assert np.isin(kept, chosen).all()
    width, height = np.ptp(x[chosen]) / (450 - 1), np.ptp(y[chosen]) / (300 - 1)
    scaled = np.column_stack([x / width, y / height])
    assert cKDTree(scaled[kept]).query(scaled[chosen])[0].max() <= 2**0.5
    assert (kept[-1], len(diagram._last_of_each_cell(x, y, chosen[:1000]))) == (chosen[-1], 1000)


@pytest.mark.parametrize(
    ("name", "values", "label", "text"),
    [
        ("pressure", [2e5, 30e5], "pressure [MPa]", "pressure = 1.2 MPa"),
        ("friction", [0.0, 0.7], "friction", "friction = 1.2e+06"),
        ("sliding_speed", [0.1, 3e6], "sliding_speed [m/s]", "sliding_speed = 1.2e+06 m/s"),
        ("contact.lambda", [5e4, 5e6], "contact.lambda", "contact.lambda = 1.2e+06"),
    ],
)
def test_parameters_are_shown_with_units(name, values, label, text):
    shown = quantity(name, pd.Series(values), UNITS)
    assert shown.label == label
    assert shown.text(1.2e6) == text


def test_scaled_values_and_ticks():
    shown = quantity("pressure", pd.Series(P), UNITS)
    assert np.allclose(shown.scaled(pd.Series(P)), P / 1e6)
    assert shown.ticks(pd.Series(P)) == pytest.approx([0.2, 0.4, 0.8, 1.2, 2.0, 3.0])
    assert shown.ticks(pd.Series(np.linspace(1, 2, 40))) is None


@pytest.mark.parametrize(
    ("values", "log"),
    [
        (P, True),
        (np.geomspace(1e4, 1e6, 5), True),
        (MU, False),
        (np.linspace(2e5, 30e5, 6), False),
        ([0.0, 1.0, 10.0, 100.0], False),
        ([1.0, 10.0], False),
        ([1.0, 1.1, 1.21, 1.331], False),
    ],
)
def test_geometric_spacing_is_recognised(values, log):
    assert is_geometric(np.asarray(values)) == log


def over(log):
    """A quantity on an axis."""
    return Quantity("x", "", 1.0, log)


@given(st.lists(st.floats(1e-3, 1e6), min_size=1, max_size=20, unique=True), st.booleans())
@settings(max_examples=50, deadline=None)
def test_every_value_lies_in_its_cell(values, log):
    values = np.array(sorted(values))
    edges = over(log).edges(values)
    assert len(edges) == len(values) + 1
    assert (np.diff(edges) >= 0).all()
    tolerance = 1e-12 * np.abs(edges).max()
    assert (edges[:-1] <= values + tolerance).all()
    assert (values <= edges[1:] + tolerance).all()


def test_cell_edges_are_midway():
    assert np.allclose(over(False).edges(np.array([1.0, 2.0, 4.0])), [0.5, 1.5, 3.0, 5.0])
    halves = over(True).edges(np.array([1.0, 2.0, 4.0]))
    assert np.allclose(halves, 2.0 ** np.array([-0.5, 0.5, 1.5, 2.5]))


def test_damping_limits_show_instability_and_leave_out_heavy_damping():
    low, high = damping_limits(np.array([-1.0, 0.5, 80.0, np.nan]))
    assert low < -1.0
    assert 0.5 < high < 10
    assert damping_limits(np.array([])) == pytest.approx((-0.05, 0.5))
    assert damping_limits(np.array([-100.0, 32.0]))[1] == pytest.approx(35.2)  # it was 170


def test_labels_keep_off_each_other():
    figure = Figure(figsize=(6, 4))
    axes = figure.add_subplot()
    axes.set_xlim(0, 10)
    axes.set_ylim(0, 10)
    labels = [Label(5 + 0.01 * k, 5.0, f"T{k}  3250 Hz") for k in range(8)]
    labels += [Label(9.99, 9.99, "corner 8000 Hz"), Label(0.0, 0.0, "corner 500 Hz")]
    place_labels(figure, axes, labels, np.zeros((0, 2)))
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    notes = [text for text in axes.texts if isinstance(text, Annotation)]
    texts = [Text.get_window_extent(note, renderer) for note in notes]  # without leader lines
    assert len(texts) == 10
    frame = axes.get_window_extent()
    for k, one in enumerate(texts):
        assert not any(one.overlaps(other) for other in texts[:k])
        assert frame.x0 - 1 <= one.x0
        assert one.x1 <= frame.x1 + 1
        assert frame.y0 - 1 <= one.y0
        assert one.y1 <= frame.y1 + 1


# -- stability diagram


def test_diagram_of_one_point():
    points, modes = grid()
    point = points[(points["friction"] > 0.69) & (points["pressure"] == 12e5)].iloc[0]
    figure = stability_diagram(points, modes, point["point_id"], units=UNITS)
    axes = figure.axes[0]
    assert dots(axes) == [3, 1]
    unstable = axes.collections[1].get_offsets()
    assert np.allclose(unstable, [[3042.0, -0.6]])
    texts = drawn(figure)
    assert "T1  3042 Hz" in texts
    title = axes.get_title(loc="left")
    assert title.startswith(
        "friction = 0.7, pressure = 1.2 MPa\n1 of 4 modes unstable; 1 mark above"
    )
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Frequency [Hz]", "Damping ratio [%]")
    assert axes.get_ylim()[0] < -0.6


def test_diagram_of_all_points():
    points, modes = grid(failed=(3,))
    figure = stability_diagram(points, modes, colour_by="pressure", units=UNITS)
    assert sum(dots(figure.axes[0])) == len(modes) == 4 * 47
    assert dots(figure.axes[0])[1] == modes["unstable"].sum()
    colours = figure.axes[0].collections[1].get_array()
    assert set(np.round(colours, 6)) == set(np.round(P / 1e6, 6))
    texts = drawn(figure)
    assert figure.axes[1].get_ylabel() == "pressure [MPa]"
    assert "T1  3042 Hz" in texts
    assert not any(text.startswith(("T2", "T3", "T4")) for text in texts)
    assert "1 unstable track" in figure.axes[0].get_title(loc="left")
    assert "1 point failed" in figure.axes[0].get_title(loc="left")


def test_diagram_is_coloured_by_the_first_varied_parameter():
    figure = stability_diagram(*grid(), units=UNITS)
    assert figure.axes[1].get_ylabel() == "friction"


def test_overdamped_roots_are_counted_not_drawn():
    points, modes = one_line()
    extra = (
        modes[modes["point_id"] == "p7"]
        .iloc[:2]
        .assign(overdamped=True, damping_ratio=[-1.0, 1.0], unstable=[True, False], track=[8, 9])
    )
    figure = stability_diagram(points, pd.concat([modes, extra], ignore_index=True), "p7")
    assert sum(dots(figure.axes[0])) == 4
    title = figure.axes[0].get_title(loc="left")
    assert "2 overdamped roots not shown; 1 of them unstable" in title
    assert figure.axes[0].get_ylim()[0] > -5


def test_modes_without_tracks_are_drawn_and_named():
    points, modes = one_line()
    modes["track"] = -1
    assert "3042 Hz" in drawn(stability_diagram(points, modes, "p7"))
    title = stability_diagram(points, modes).axes[0].get_title(loc="left")
    assert f"{modes['unstable'].sum()} unstable modes without track" in title


def test_diagram_with_nothing_unstable_or_no_modes_at_all():
    points, modes = stable(grid())
    figure = stability_diagram(points, modes)
    assert dots(figure.axes[0]) == [len(modes), 0]
    assert "no unstable mode" in figure.axes[0].get_title(loc="left")
    empty = stability_diagram(points.assign(status="failed"), modes.iloc[:0])
    assert "no modes" in drawn(empty)


def test_diagram_of_a_single_point_study():
    points, modes = one_line()
    figure = stability_diagram(points.iloc[7:], modes[modes["point_id"] == "p7"], units=UNITS)
    assert dots(figure.axes[0]) == [3, 1]
    assert "pressure = 1.2 MPa" in figure.axes[0].get_title(loc="left")


def test_diagram_refuses_what_is_not_there():
    points, modes = grid()
    with pytest.raises(ResultsError, match="no design point 'q1'"):
        stability_diagram(points, modes, "q1")
    with pytest.raises(ResultsError, match="'mu' is no parameter"):
        stability_diagram(points, modes, colour_by="mu")


# -- evolution


def test_evolution_draws_every_track_on_the_line():
    points, modes = grid()
    figure = evolution(points, modes, "friction", {"pressure": 12e5}, UNITS)
    upper, lower = figure.axes[:2]
    line = modes[modes["point_id"].isin(points["point_id"][points["pressure"] == 12e5])]
    for axes, column, factor in ((upper, "frequency_hz", 1.0), (lower, "damping_ratio", 100.0)):
        curves = {
            tuple(np.round(np.asarray(c.get_ydata(), float), 9))
            for c in axes.get_lines()
            if len(c.get_xdata()) == len(MU)
        }
        expected = {
            tuple(np.round(factor * rows[column].to_numpy(), 9))
            for _, rows in line.groupby("track")
        }
        assert expected <= curves
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("Frequency [Hz]", "Damping ratio [%]")
    assert lower.get_xlabel() == "friction"
    texts = drawn(figure)
    assert "T1  3042 Hz" in texts
    assert "pressure = 1.2 MPa; 1 unstable track" in texts


def test_evolution_is_led_through_refined_onsets(tmp_path):
    """Between .25 and .35 a straight line would cross zero far from the onset of hulten."""
    text = study_text("onset", "complex_modes", "hulten") + (
        '[[sweep]]\nparameter = "friction"\nvalues = [0.1, 0.25, 0.35, 0.4]\n'
        "[modes]\nband = [10.0, 1000.0]\n"
    )
    results = solved(text, tmp_path / "r")
    figure = results.plot.evolution()
    (onset,) = results.onsets["onset"]
    frequency, damping = figure.axes[:2]
    (curve,) = (x for x in damping.lines if x.get_marker() == "o" and len(x.get_xdata()) == 5)
    x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    assert x.tolist() == sorted([0.1, 0.25, 0.35, 0.4, onset])
    assert y[x.tolist().index(onset)] == 0.0
    assert curve.get_markevery() == [0, 1, 3, 4]  # design points alone
    for axes, value in ((frequency, results.onsets["frequency_hz"][0]), (damping, 0.0)):
        (bar,) = (x for x in axes.lines if x.get_marker() == "|")
        assert (bar.get_xdata()[0], bar.get_ydata()[0]) == (onset, value)
    assert "onset, refined" in drawn(figure)
    assert f"1 unstable track: T1 from friction {onset:.3g}" in drawn(figure)


@pytest.mark.parametrize(
    ("directions", "label"),
    [
        (["out"], "stable again, refined"),
        (["in", "out"], "onset or stable again, refined"),
    ],
)
def test_bars_where_a_mode_turns_stable_are_no_onsets(directions, label):
    assert turns_in_words(pd.DataFrame({"direction": directions})) == label


@pytest.mark.parametrize(("falling", "align"), [(True, "right"), (False, "left")])
def test_the_word_unstable_stands_where_no_curve_is(falling, align):
    """A mode that was most unstable at the least damping covered it."""
    axes = Figure().add_subplot()
    x = np.linspace(0.0, 1.0, 5)
    axes.plot(x, -1.4 * (1.0 - x if falling else x))
    axes.set_ylim(-1.6, 1.0)
    shade_unstable(axes)
    assert axes.texts[0].get_ha() == align


def test_a_long_title_of_an_evolution_is_whole():
    """Of first_brake it was cut at both ends: two names of a caliper mode, and three onsets."""
    points, modes = grid()
    name = (
        "caliper.modes[12-14].frequency_scale_of_each_mode_and_of_those_that_follow_it_in_the_file"
    )
    figure = evolution(points.rename(columns={"pressure": name}), modes, "friction")
    drawn(figure)
    assert "\n" in figure.get_suptitle()
    assert figure._suptitle.get_window_extent().x1 <= figure.bbox.x1


def test_real_roots_that_grow_are_told_where_modes_are_drawn():
    """Of a bicycle below walking speed the picture said '1 unstable track' and no more."""
    points, modes = one_line()
    modes = modes.assign(overdamped=False)
    first = modes["point_id"] == points["point_id"].iloc[0]
    row = modes[first].iloc[:1].assign(overdamped=True, unstable=True, growth_rate=3.0, track=-1)
    told = drawn(evolution(points, pd.concat([modes, row], ignore_index=True), "friction"))
    assert any("; real roots grow at 1 point, not drawn" in text for text in told)
    assert not any("real roots" in t for t in drawn(evolution(points, modes, "friction")))


def test_a_title_above_a_locus_is_as_wide_as_the_locus(tmp_path):
    """It ended at 'open circle': the name of the parameter was too long for the line."""
    points, modes = grid()
    name = "caliper.modes[7].damping_ratio"
    figure = evolution(points.rename(columns={"friction": name}), modes, name)
    heads = [text for text in drawn(figure) if "from least" in text]
    assert heads
    assert all(len(line) <= 56 for text in heads for line in text.split("\n"))


def test_evolution_takes_the_line_of_most_unstable_modes():
    points, modes = grid()
    worse = points["point_id"][points["pressure"] == 4e5]
    modes.loc[modes["point_id"].isin(worse) & (modes["track"] == 3), "unstable"] = True
    figure = evolution(points, modes, "friction", units=UNITS)
    assert any(text.startswith("pressure = 0.4 MPa") for text in drawn(figure))


def test_evolution_over_a_geometric_parameter_is_on_a_log_axis():
    points, modes = grid()
    figure = evolution(points, modes, "pressure", {"friction": 0.7}, UNITS, "growth_rate")
    lower = figure.axes[1]
    assert lower.get_xscale() == "log"
    assert lower.get_xlabel() == "pressure [MPa]"
    assert lower.get_ylabel() == "Growth rate [1/s]"
    drawn(figure)
    ticks = [t.get_text() for t in lower.get_xticklabels()]
    assert ticks == ["0.2", "0.4", "0.8", "1.2", "2", "3"]


def test_the_root_locus_shows_the_track_and_its_neighbour():
    points, modes = one_line()
    locus = evolution(points, modes, "friction").axes[2]
    curves = [np.asarray(line.get_ydata(), float) for line in locus.get_lines()]
    for track in (1, 2):
        expected = modes.loc[modes["track"] == track, "frequency_hz"].to_numpy()
        assert any(len(c) == len(expected) and np.allclose(c, expected) for c in curves)
    assert locus.get_xlabel() == "Growth rate [1/s]"
    assert "from least friction (open circle) to most (arrow)" in locus.get_title(loc="left")
    arrows = [text.arrow_patch for text in locus.texts if text.arrow_patch is not None]
    assert arrows
    assert all(arrow.get_clip_box() is not None for arrow in arrows)  # of modes from far away


def test_curves_are_broken_at_failed_points():
    figure = evolution(*one_line(failed=(2, 5)), "friction")
    lower = figure.axes[1]
    broken = [
        np.flatnonzero(np.isnan(np.asarray(c.get_ydata(), float))).tolist()
        for c in lower.get_lines()
        if len(c.get_xdata()) == len(MU)
    ]
    assert broken == [[2, 5]] * 4
    crosses = [c for c in lower.get_lines() if c.get_marker() == "x" and not c.get_clip_on()]
    assert np.allclose(crosses[0].get_xdata(), MU[[2, 5]])
    assert any("2 points failed (x)" in text for text in drawn(figure))


def test_curves_run_along_the_parameter_whatever_the_order_of_rows():
    points, modes = one_line()
    shuffled = points.sample(frac=1, random_state=1), modes.sample(frac=1, random_state=2)
    one, other = evolution(points, modes, "friction"), evolution(*shuffled, "friction")
    for a, b in zip(one.axes, other.axes, strict=True):
        for line, same in zip(a.get_lines(), b.get_lines(), strict=True):
            assert np.array_equal(line.get_xydata(), same.get_xydata(), equal_nan=True)


@pytest.mark.parametrize("failed", [(), (2,)])
def test_the_axes_fill_the_figure_however_often_it_is_drawn(failed):
    figure = evolution(*one_line(failed), "friction")
    drawn(figure)
    before = [axes.get_window_extent().bounds for axes in figure.axes]
    drawn(figure)
    after = [axes.get_window_extent().bounds for axes in figure.axes]
    assert np.allclose(before, after, atol=2.0)
    assert sum(bounds[3] for bounds in after[:2]) > 0.7 * figure.bbox.height


def test_ambiguous_labels_are_ringed():
    points, modes = one_line()
    modes.loc[(modes["track"] == 1) & (modes["point_id"] == "p4"), "track_ambiguous"] = True
    figure = evolution(points, modes, "friction")
    rings = [c for c in figure.axes[0].get_lines() if c.get_markersize() == 9]
    assert [list(c.get_xdata()) for c in rings] == [[MU[4]]]
    assert "not sure which mode" in drawn(figure)
    assert "not sure which mode" not in drawn(evolution(*one_line(), "friction"))


def test_many_unstable_tracks_share_a_colour():
    points, modes = one_line()
    many = pd.concat(
        [
            modes[modes["track"] == 1].assign(track=10 + k, frequency_hz=1000.0 + 100 * k)
            for k in range(11)
        ],
        ignore_index=True,
    )
    texts = drawn(evolution(points, many, "friction"))
    assert sum(text.startswith("T1") and text.endswith("Hz") for text in texts) == 8
    assert "other unstable tracks" in texts


@pytest.mark.parametrize("show", ["damping_ratio", "growth_rate"])
def test_evolution_without_instability_or_modes(show):
    points, modes = stable(one_line())
    figure = evolution(points, modes, "friction", show=show)
    assert len(figure.axes) == 2
    assert any("no unstable mode" in text for text in drawn(figure))
    low, high = figure.axes[1].get_ylim()
    assert low < 0 < high
    figure = evolution(points.assign(status="failed"), modes.iloc[:0], "friction", show=show)
    assert any("8 points failed" in text for text in drawn(figure))


def test_untracked_modes_are_dots():
    points, modes = one_line()
    figure = evolution(points, modes.assign(track=-1), "friction")
    lines = figure.axes[1].get_lines()
    crosses = [c for c in lines if c.get_marker() == "x" and c.get_clip_on()]
    assert len(crosses[0].get_xdata()) == modes["unstable"].sum() == 3
    assert "0 unstable tracks; 3 unstable modes without track (x)" in drawn(figure)


def test_evolution_refuses_what_is_not_there():
    points, modes = grid()
    with pytest.raises(ResultsError, match=r"'presure' is not varied.*did you mean 'pressure'"):
        evolution(points, modes, "presure")
    with pytest.raises(ResultsError, match=r"'sliding_speed' is not varied.*friction, pressure"):
        evolution(points, modes, "sliding_speed")
    with pytest.raises(ResultsError, match="no design point has pressure = 1"):
        evolution(points, modes, "friction", {"pressure": 1.0})
    with pytest.raises(ResultsError, match="'mu' is no parameter"):
        evolution(points, modes, "friction", {"mu": 1.0})
    with pytest.raises(ResultsError, match="expected damping_ratio or growth_rate"):
        evolution(points, modes, "friction", show="volume")


# -- stability map


def mesh(axes, kind=QuadMesh):
    return next(c for c in axes.collections if isinstance(c, kind))


def test_map_counts_unstable_modes_in_cells():
    points, modes = grid(failed=(9,))
    figure = stability_map(points, modes, "friction", "pressure", units=UNITS)
    axes = figure.axes[0]
    counts = np.ma.filled(mesh(axes).get_array().reshape(len(P), len(MU)).astype(float), np.nan)
    expected = np.tile((0.008 - 0.02 * MU < 0).astype(float), (len(P), 1))
    expected[1, 1] = np.nan
    assert np.array_equal(counts, expected, equal_nan=True)
    corners = mesh(axes).get_coordinates()
    assert np.allclose(corners[0, :, 0], over(False).edges(MU))
    assert np.allclose(corners[:, 0, 1], over(True).edges(P / 1e6))
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "log")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("friction", "pressure [MPa]")
    texts = drawn(figure)
    assert any("1 point failed (hatched)" in text for text in texts)
    assert figure.axes[1].get_ylabel() == "Unstable modes"


def boundary(axes):
    """Vertices of the boundary of stability."""
    return axes.lines[-1].get_xydata()


def test_the_boundary_lies_at_zero_damping():
    figure = stability_map(*grid(), "friction", "pressure", units=UNITS)
    assert np.allclose(boundary(figure.axes[0])[:, 0], 0.4)
    assert any("between design points, not refined" in text for text in drawn(figure))


def test_a_change_of_track_is_no_boundary():
    points, modes = grid()
    renamed = modes["point_id"].isin(points["point_id"][points["pressure"] > 1e6])
    modes.loc[renamed & (modes["track"] == 1), "track"] = 5
    figure = stability_map(points, modes, "friction", "pressure", units=UNITS)
    ticks, line = figure.axes[0].lines
    assert np.allclose(ticks.get_xdata(), 0.4)
    assert np.allclose(line.get_xdata(), 0.4)


def test_no_boundary_is_drawn_from_one_state_of_a_contact_to_another():
    points, modes = grid()
    points = points[points["pressure"].isin(points["pressure"].unique()[:2])].copy()
    modes = modes[modes["point_id"].isin(points["point_id"])]
    points["pressure"] = (points["pressure"] > points["pressure"].min()).astype(float)
    figure = stability_map(points, modes, "friction", "pressure")  # as a state: 0 or 1
    assert not figure.axes[0].lines
    assert not any("boundary" in text for text in drawn(figure))
    points["pressure"] += 1.0
    assert stability_map(points, modes, "friction", "pressure").axes[0].lines


def test_without_damping_an_unrefined_boundary_is_in_the_middle():
    """Linear interpolation would put it at the last stable points."""
    points, modes = grid()
    modes["damping_ratio"] = modes["damping_ratio"].clip(upper=0.0)
    line = boundary(stability_map(points, modes, "friction", "pressure").axes[0])
    assert np.allclose(line[:, 0], 0.45)


def test_the_boundary_of_an_island_is_closed_around_it():
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 9), np.linspace(1, 2, 9)))
    points = points_table(x, y)
    modes = modes_table(points)[lambda m: m["track"] == 1].copy()
    modes["damping_ratio"] = 0.1 * ((x - 0.5) ** 2 + (y - 1.5) ** 2 - 0.09)
    modes["unstable"] = modes["damping_ratio"] < 0
    line = boundary(stability_map(points, modes, "friction", "pressure").axes[0])
    assert np.allclose(line[0], line[-1])
    assert np.allclose(np.hypot(line[:, 0] - 0.5, line[:, 1] - 1.5), 0.3, atol=0.01)
    step = np.diff(line, axis=0)
    inwards = [0.5, 1.5] - line[:-1]
    assert (step[:, 0] * inwards[:, 1] - step[:, 1] * inwards[:, 0] < 0).all()  # on the right


def test_rounding_at_zero_friction_draws_no_boundary():
    points, modes = grid()
    zero = modes["point_id"].isin(points["point_id"][points["friction"] == 0.0])
    flips = np.where(np.arange(zero.sum()) % 8 < 4, 1e-17, -1e-17)
    modes.loc[zero, "damping_ratio"] = flips
    modes.loc[zero, "unstable"] = False
    line = boundary(stability_map(points, modes, "friction", "pressure").axes[0])
    assert line[:, 0].min() > 0.3


def test_map_of_growth():
    points, modes = grid()
    figure = stability_map(points, modes, "pressure", "friction", measure="growth", units=UNITS)
    values = mesh(figure.axes[0]).get_array().reshape(len(MU), len(P))
    fastest = modes.groupby("point_id")["growth_rate"].max()
    expected = points.assign(g=points["point_id"].map(fastest)).pivot_table(
        index="friction", columns="pressure", values="g"
    )
    assert np.allclose(values, expected.to_numpy())
    assert figure.axes[1].get_ylabel() == "Largest growth rate [1/s]"
    drawn(figure)


@pytest.mark.parametrize("measure", ["count", "growth"])
def test_growth_without_oscillation_is_unstable_on_the_map(measure):
    points, modes = grid()
    modes = modes[modes["track"] == 3]
    real = modes.assign(overdamped=True, track=-1, growth_rate=50.0, damping_ratio=-1.0)
    beyond = points["point_id"][points["friction"] > 0.45]
    real = real[real["point_id"].isin(beyond)].assign(unstable=True)
    modes = pd.concat([modes, real], ignore_index=True)
    axes = stability_map(points, modes, "friction", "pressure", measure=measure).axes[0]
    assert np.allclose(boundary(axes)[:, 0], 0.45)  # a real root is not interpolated
    values = mesh(axes).get_array().reshape(len(P), len(MU))
    assert np.allclose(values[:, 5:], 1.0 if measure == "count" else 50.0)
    assert (values[:, :5] <= 0).all()


def test_where_all_is_unstable_there_is_no_boundary():
    points, modes = grid()
    modes.loc[modes["track"] == 3, ["damping_ratio", "unstable", "growth_rate"]] = [-0.1, True, 9e3]
    assert not stability_map(points, modes, "friction", "pressure").axes[0].lines


def test_map_of_scattered_points():
    rng = np.random.default_rng(0)
    points = points_table(rng.uniform(0, 0.7, 60), rng.uniform(2e5, 30e5, 60), failed=(5,))
    modes = modes_table(points)
    modes = modes[modes["track"] == 1]  # of one mode whose damping is linear
    figure = stability_map(points, modes, "friction", "pressure", units=UNITS)
    axes = figure.axes[0]
    assert dots(axes) == [59]
    assert len(mesh(axes, PolyCollection).get_array()) > 59  # more triangles than points
    assert np.allclose(boundary(axes)[:, 0], 0.4)
    assert any("1 point failed (x)" in text for text in drawn(figure))


@pytest.mark.parametrize("scattered", [False, True])
def test_of_points_that_cannot_be_told_apart_the_largest_is_seen(monkeypatch, scattered):
    monkeypatch.setattr(plane, "MOST_CELLS", (3, 2))
    monkeypatch.setattr(plane, "N_CELLS", (3, 2))
    monkeypatch.setattr(maps, "MOST_DOTS", 20)
    mu, p = (a.ravel() for a in np.meshgrid(np.linspace(0, 0.7, 8), np.linspace(2e5, 30e5, 5)))
    if scattered:  # each in the same cell as on the grid, no two of one value
        mu, p = mu + 1e-3 * np.linspace(-1, 1, 40), p + np.linspace(-1, 1, 40)
    points = points_table(mu, p, failed=(7,))
    modes = modes_table(points)
    growth = np.full(40, np.nan)
    found = modes.groupby("point_id")["growth_rate"].max()
    growth[:] = points["point_id"].map(found).where(points["status"] == "ok")
    figure = stability_map(points, modes, "friction", "pressure", measure="growth", units=UNITS)
    cells = mesh(figure.axes[0]).get_array()
    assert cells.shape == (2, 3)
    assert cells.max() == np.nanmax(growth)
    shown = np.unique(cells.compressed())
    assert np.isin(shown, growth).all()
    if not scattered:
        table = growth.reshape(5, 8)
        blocks = [[np.nanmax(table[r, c : c + 3]) for c in (0, 3, 6)] for r in ([0, 1, 2], [3, 4])]
        assert np.array_equal(cells, blocks)
        edges = mesh(figure.axes[0]).get_coordinates()
        assert np.allclose(edges[0, [0, -1], 0], [-0.05, 0.75])
    what = "its points" if scattered else "3 x 3 points"
    assert any(f"a cell: the largest of {what}" in text for text in drawn(figure))


def test_the_boundary_between_very_many_points_is_that_of_all_their_triangles(monkeypatch):
    rng = np.random.default_rng(1)
    mu, p = rng.uniform(0.0, 0.7, 6000), 1e6 * rng.lognormal(0.0, 0.6, 6000)
    points = points_table(mu, p, failed=range(0, 6000, 17))
    modes = modes_table(points)
    at = points.set_index("point_id").loc[modes["point_id"]]
    modes["unstable"] = (np.sin(9 * at["friction"]) > 0.2 * at["pressure"] / 1e6).to_numpy()
    found = []
    for most in (500, 10_000):
        monkeypatch.setattr(plane, "MOST_DOTS", most)
        of = study_plane(results_of(points, modes, UNITS), ("friction", "pressure"))
        found.append({tuple(sorted(corners)) for corners in of.polygons()})
        assert (of.near_changes.sum() < 0.7 * of.solved.sum()) == (most == 500)
    assert len(found[0]) > 100
    assert found[0] == found[1]


def test_scattered_points_in_three_parameters_are_dots_only():
    rng = np.random.default_rng(0)
    a, b, c = rng.uniform(0.1, 1, (3, 40))
    points = points_table(a, b, **{"contact.lambda": c})
    figure = stability_map(points, modes_table(points), "friction", "pressure")
    axes = figure.axes[0]
    assert dots(axes) == [40]
    assert not any(isinstance(k, PolyCollection) for k in axes.collections)
    assert "also varied: contact.lambda; unstable at " in " ".join(drawn(figure))


def test_flat_triangles_along_the_edge_join_no_points():
    rng = np.random.default_rng(3)
    mu, p = rng.uniform(0.0, 1.0, (2, 400))
    mu, p = np.append(mu, [0.1, 0.9]), np.append(p, [-1e-4, -1e-4])  # an edge of one long triangle
    points = points_table(mu, 1e6 * (1 + p))
    figure = stability_map(points, modes_table(points), "friction", "pressure")
    (drawn_mesh,) = (c for c in figure.axes[0].collections if isinstance(c, PolyCollection))
    sides = [np.ptp(path.vertices[:, 0]) for path in drawn_mesh.get_paths()]
    assert len(sides) > 700
    assert max(sides) < 0.5


def test_points_on_a_line_span_no_triangles():
    mu = np.linspace(0, 0.7, 6)
    points = points_table(mu, 1e6 * (1 + mu))
    figure = stability_map(points, modes_table(points), "friction", "pressure")
    assert dots(figure.axes[0]) == [6]
    drawn(figure)


def test_the_legend_of_a_boundary_lies_within_its_picture():
    figure = new_figure()
    line = np.array([[0.0, 0.0], [1.0, 1.0]])
    found = maps.Boundary([line], line, crossings=115, refined=103)
    name = "caliper.modes[12-14].frequency_scale"
    legend_below(figure, maps._boundary(figure.add_subplot(), found, name, cells=True), 1)
    drawn(figure)
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1
    told = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    assert f"refined along {name} at 103 of 115" in told.replace("\n", " ")


def test_the_plane_of_most_unstable_modes_is_shown():
    mu, p = (np.tile(values.ravel(), 2) for values in np.meshgrid(MU, P))
    points = points_table(mu, p, speed=np.repeat([1.0, 2.0], len(mu) // 2))
    modes = modes_table(points)
    worse = modes["point_id"].isin(points["point_id"][points["speed"] == 2.0])
    modes.loc[worse & (modes["track"] == 3), "unstable"] = True
    figure = stability_map(points, modes, "friction", "pressure")
    title = figure.axes[0].get_title(loc="left")
    most = "speed = 2, of 2 slices the one with most unstable modes"
    assert title == f"{most}; unstable at 48 of 48 points"
    alike = modes.assign(unstable=modes["track"] == 1)
    title = stability_map(points, alike, "friction", "pressure").axes[0].get_title(loc="left")
    assert title.startswith("speed = 1, of 2 slices one of the 2 with most unstable modes;")
    long = points.rename(columns={"speed": "caliper.modes[12-14].frequency_scale"})
    solved = np.ones(len(points), dtype=bool)
    figure = stability_map(long, alike, "friction", "pressure", solved=solved)
    drawn(figure)
    assert "nodes solved (dots)" in figure.axes[0].get_title(loc="left")
    assert figure.axes[0]._left_title.get_window_extent().x1 <= figure.bbox.x1
    calm = stability_map(points, modes.assign(unstable=False), "friction", "pressure")
    assert "one of 2 slices, none with an unstable mode" in calm.axes[0].get_title(loc="left")
    plane = study_plane(results_of(points, modes), ("friction", "pressure"), {"speed": 1.0})
    assert plane.gridded
    assert plane.value.max() == 1.0


@pytest.mark.parametrize("measure", ["count", "growth"])
def test_map_without_instability_or_modes(measure):
    points, modes = stable(grid())
    figure = stability_map(points, modes, "friction", "pressure", measure=measure)
    assert any("no unstable mode" in text for text in drawn(figure))
    failed = points.assign(status="failed")
    figure = stability_map(failed, modes.iloc[:0], "friction", "pressure", measure=measure)
    title = figure.axes[0].get_title(loc="left")
    assert "no design point is solved" in title
    assert "no unstable mode" not in title
    some = points.assign(status=["failed"] + ["ok"] * (len(points) - 1))
    figure = stability_map(some, modes, "friction", "pressure", measure=measure)
    assert "no unstable mode where it is solved" in figure.axes[0].get_title(loc="left")


def test_map_refuses_what_is_not_there():
    points, modes = grid()
    with pytest.raises(ResultsError, match=r"'pressure' is not varied.*friction"):
        stability_map(*one_line(), "friction", "pressure")
    with pytest.raises(ResultsError, match="'friction' twice"):
        stability_map(points, modes, "friction", "friction")
    with pytest.raises(ResultsError, match="expected count or growth"):
        stability_map(points, modes, "friction", "pressure", measure="volume")


# -- ranking


def test_bars_of_the_ranking():
    points, modes = grid()
    modes.loc[modes["track"] == 3, "unstable"] = (
        points.set_index("point_id")
        .loc[modes.loc[modes["track"] == 3, "point_id"], "pressure"]
        .to_numpy()
        > 2.5e6
    )
    figure = ranking(points, modes, sweeps=["friction"])
    left, right = figure.axes
    assert [bar.get_width() for bar in left.patches] == pytest.approx([37.5, 100 / 6])
    assert [t.get_text() for t in left.get_yticklabels()] == ["T1  3042 Hz", "T3  5240 Hz"]
    widths = np.array([bar.get_width() for bar in right.patches]).reshape(3, 2)
    assert np.allclose(widths.sum(axis=0), 100.0)
    assert np.allclose(widths[0], 50.0)
    texts = drawn(figure)
    assert {"disc", "pad", "interfaces"} <= set(texts)
    assert any(text.endswith("from ~0.4") for text in texts)
    assert "the friction from which on unstable" in left.get_title(loc="left")


def test_mean_energies_are_over_unstable_points_only():
    _, modes = one_line()
    modes.loc[~modes["unstable"], "energy_pad"] = 0.0
    energies = mean_energies(modes, [1])
    assert energies.loc[1, "pad"] == pytest.approx(0.2 + 0.1 * MU[MU > 0.4].mean())
    assert list(energies.columns) == ["disc", "pad", "interfaces"]


def test_bars_of_divergence_untracked_and_nan_energies():
    points, modes = one_line()
    modes.loc[modes["track"] == 1, "track"] = -1
    modes.loc[modes["track"] == 2, ["overdamped", "unstable"]] = True
    energies = ["energy_disc", "energy_pad", "energy_interfaces"]
    modes[energies] = np.nan
    figure = ranking(points, modes)
    names = {t.get_text().split("   ")[0] for t in figure.axes[0].get_yticklabels()}
    assert names == {"non-oscillating", "untracked"}
    drawn(figure)
    bare = modes.drop(columns=energies)
    drawn(ranking(points, bare))


def test_only_the_top_of_a_long_ranking_is_shown():
    points, modes = one_line()
    many = pd.concat(
        [modes[modes["track"] == 1].assign(track=k) for k in range(1, 30)], ignore_index=True
    )
    figure = ranking(points, many, top=5)
    assert len(figure.axes[0].patches) == 5
    assert "first 5 of 29 rows" in figure.axes[0].get_title(loc="left")


def test_an_empty_ranking():
    points, modes = stable(one_line())
    assert "no unstable mode" in drawn(ranking(points, modes))
    failed = points.assign(status="failed")
    assert "no design point is solved" in drawn(ranking(failed, modes.iloc[:0]))


# -- files


def test_figures_are_saved_whole(tmp_path):
    path = tmp_path / "new" / "map.png"
    save_figure(stability_map(*grid(), "friction", "pressure"), path)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert [p.name for p in path.parent.iterdir()] == ["map.png"]


def test_a_picture_that_fails_leaves_the_old_one(tmp_path, monkeypatch):
    def broken(canvas, target):
        target.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(FigureCanvasAgg, "print_png", broken)
    path = tmp_path / "map.png"
    path.write_bytes(b"old")
    with pytest.raises(OSError, match="disk full"):
        save_figure(Figure(), path)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["map.png"]


def test_pictures_leave_pyplot_alone():
    code = (
        "import sys; from squealstudy.engine.pictures import plots; "
        "print(len(plots()), 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(plots())), "False"]
    assert len(plots()) > 10


@pytest.mark.parametrize("reach", [5.5, 15.0, 80.0])
def test_a_logarithmic_axis_of_less_than_two_decades_has_labels_enough(reach):
    values = pd.Series(2e5 * reach ** np.linspace(0, 1, 40))
    shown = quantity("pressure", values, {"pressure": "Pa"})
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set_xscale("log")
    x = shown.scaled(values)
    axes.plot(x, x)
    set_ticks(axes.xaxis, shown, values)
    FigureCanvasAgg(figure).draw()
    low, high = axes.get_xlim()
    labels = [t for t in axes.get_xticklabels() if low <= t.get_position()[0] <= high]
    assert shown.log
    assert len([t for t in labels if t.get_text()]) >= 3


def test_a_file_of_a_picture_names_its_study(tmp_path, monkeypatch):
    saved = {}
    monkeypatch.setattr(
        "squealstudy.engine.pictures.save_figure", lambda figure, path: saved.update({path: figure})
    )
    sweep = '[[sweep]]\nparameter = "friction"\nvalues = [0.2, 0.5]\n'
    results = solved(study_text("named_study", "complex_modes", "hulten") + sweep, tmp_path / "r")
    results.draw()
    assert saved
    for figure in saved.values():
        assert "study named_study" in [text.get_text() for text in figure.texts]


def test_every_picture_can_stand_in_a_users_figure():
    for name, plot in plots().items():
        if plot.draw.__module__.startswith("squealstudy."):
            parameter = inspect.signature(plot.draw).parameters["ax"]
            assert parameter.default is None, name
