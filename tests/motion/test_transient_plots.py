import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_results import drawn, made
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from transient_tables import growth_table, history_table, modes_table, points_table

from squealstudy.errors import ResultsError
from squealstudy.kinds.transient import screen
from squealstudy.plots.growth_comparison import growth_pairs
from squealstudy.plots.levels import bar_places, design_names, stacked_shares, sweep_line
from squealstudy.plots.modal_energies import leading_modes
from squealstudy.plots.over_time import (
    EndLabel,
    binned,
    design_text,
    end_labels,
    outline,
    run_of,
    spread,
)
from squealstudy.plots.spectrogram import short_time_levels
from squealstudy.plots.torque_history import phases

UNITS = {"friction": "", "pressure": "Pa"}
KINDS = ["stable", "limit_cycle", "irregular", "failed", "limit_cycle", "growing"]
MU = [0.2, 0.3, 0.35, 0.4, 0.45, 0.5]
RMS = [0.01, 20.0, 38.0, np.nan, 60.0, 30.0]


def sweep(kinds=KINDS, **columns):
    points = points_table({"friction": MU, "pressure": 12e5}, kinds, torque_rms=RMS, **columns)
    late = {44: 0.2, 45: 0.1, 51: 0.6}
    modes = modes_table(
        {"p0": {44: 1.0}, "p1": {44: 0.8, 45: 0.1}, "p2": {44: 0.6, 51: 0.3}}
        | {"p4": late, "p5": late}
    )
    return points, modes


def one_point(**columns):
    return points_table({"friction": [0.5], "pressure": 12e5}, ["limit_cycle"], **columns)


GROWTH = growth_table(
    [
        ("p0", 1, 3250.0, 300.0, 303.0, 0.7),
        ("p0", 2, 4952.0, 249.0, 230.0, 0.01),
        ("p1", 1, 5238.0, 2.0, 12.0, 0.0),
        ("p1", 2, 6000.0, 8.0, None, np.nan),
    ]
)


def of_one_point(history, row, growth, units=None, band=(1.0, 8000.0), modes=None):
    """Results in which the design point of a row is the second, and friction is varied."""
    own = pd.DataFrame([row])
    points = pd.concat([own.assign(friction=0.1, point_id="other"), own], ignore_index=True)
    modes = modes_table({}) if modes is None else modes
    tables = {"points": points, "modes": modes, "growth": growth}
    return made("transient", units=units, history=history, facts={"band_hz": band}, **tables)


def run_in_time(history, row, growth=GROWTH, modes=None):
    return run_of(of_one_point(history, row, growth, modes=modes), 1)


def torque_history(history, row, growth=GROWTH.iloc[:0], units=None):
    return of_one_point(history, row, growth, units).plot.torque_history(point=1)


def modal_energies(history, modes, row=None):
    row = one_point().iloc[0] if row is None else row
    results = of_one_point(history, row, GROWTH, modes=modes)
    return results.plot.modal_energies(point=1)


def spectrogram(history, growth=GROWTH.iloc[:0], row=None, top=8000.0, units=None):
    row = one_point().iloc[0] if row is None else row
    return of_one_point(history, row, growth, units, (1.0, top)).plot.spectrogram(point=1)


def growth_comparison(growth, points):
    results = made("transient", points=points, modes=modes_table({}), growth=growth)
    return results.plot.growth_comparison()


def levels(points, modes, along=None, fixed=None, units=None):
    results = made("transient", units=units, points=points, modes=modes, growth=GROWTH)
    return results.plot.levels(along=along, fixed=fixed)


def said(figure):
    """The one text of a figure that has nothing to show."""
    assert not figure.axes[0].axison
    return drawn(figure)[-1]


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


# -- what pictures over time share


@given(st.lists(st.floats(0, 100), min_size=1, max_size=12), st.floats(0.1, 20))
def test_spread_places_keep_order_and_distance(wanted, apart):
    wanted = np.array(wanted)
    placed = spread(wanted, apart, 0.0, 100.0)
    fits = min(apart, 100.0 / max(len(wanted) - 1, 1))
    assert (np.diff(np.sort(placed)) >= fits - 1e-9).all()
    assert placed.min() >= -1e-9
    assert placed.max() <= 100.0 + 1e-9
    order = np.argsort(wanted, kind="stable")
    assert (np.diff(placed[order]) > 0).all()


def test_places_that_are_far_apart_stay():
    assert spread(np.array([50.0, 10.0, 90.0]), 5.0, 0.0, 100.0).tolist() == [50.0, 10.0, 90.0]
    assert spread(np.array([50.0, 50.0]), 10.0, 0.0, 100.0).tolist() == [45.0, 55.0]
    assert spread(np.array([0.0, 0.0]), 10.0, 0.0, 100.0).tolist() == [0.0, 10.0]


def test_an_outline_keeps_every_peak():
    x = np.linspace(0, 1, 100_000)
    y = np.sin(40 * x)
    y[31_234], y[77_777] = 9.0, -9.0
    short, peaks = outline(x, y, 500)
    assert len(short) == len(peaks) == 1000
    assert (peaks.max(), peaks.min()) == (9.0, -9.0)
    assert outline(x[:100], y[:100])[1] is not None
    assert len(outline(x[:100], y[:100])[0]) == 100


def test_means_over_parts_keep_the_mean():
    x = np.arange(1000.0)
    t, y = binned(x, x**2, 10)
    assert len(t) == 10
    assert y.mean() == pytest.approx((x**2).mean())
    assert len(binned(x[:3], x[:3], 10)[0]) == 3


def overlapping(figure):
    """Pairs of annotations whose texts lie on each other."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    notes = [n for n in figure.findobj(Annotation) if n.get_text()]
    boxes = [Text.get_window_extent(note, renderer) for note in notes]
    return [(a, b) for k, a in enumerate(boxes) for b in boxes[:k] if a.overlaps(b)]


def test_labels_at_line_ends_do_not_overlap():
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.set_ylim(0, 1)
    end_labels(axes, [EndLabel(0.5 + 1e-3 * k, f"mode {k}") for k in range(9)])
    end_labels(axes, [])
    drawn(figure)
    assert overlapping(figure) == []


def test_a_design_is_described_with_units():
    points, _ = sweep()
    assert design_text(points, points.iloc[1], UNITS) == "friction = 0.3"
    assert (
        design_text(one_point(), one_point().iloc[0], UNITS) == "friction = 0.5, pressure = 1.2 MPa"
    )


# -- torque


def test_torque_history_shows_phases_levels_and_growth():
    row = one_point(settled_time=0.045).iloc[0]
    figure = torque_history(history_table(), row, GROWTH)
    assert len(figure.axes) == 6
    labels = [axes.get_ylabel() for axes in figure.axes[::2]]
    assert labels == ["Braking torque [N m]", "Contact area [%]", "Normal force [kN]"]
    assert [axes.get_xlabel() for axes in figure.axes[4:]] == ["Time [ms]"] * 2
    texts = drawn(figure)
    legend = figure.legends[0].get_texts()
    assert [t.get_text() for t in legend] == [
        "mean torque 348 N m",
        "steady sliding 360 N m",
        "exponential growth, 5 to 15 ms",
        "saturation, to 45 ms",
        "settled from 45 ms",
        "stick",
        "slip",
        "open",
    ]
    assert any(
        "growth rate predicted 300 1/s (complex mode at 3250 Hz), fitted 303 1/s (297 to 309)" in t
        for t in texts
    )
    assert any(t.startswith("friction = 0.5\nlimit cycle") for t in texts)


def test_a_stop_is_told_by_its_speeds_and_small_forces_in_newton():
    history = history_table()
    history = history.assign(
        sliding_speed=np.linspace(0.3, 0.0, len(history)), normal_force=10.0 + 0.0 * history["time"]
    )
    row = points_table({"friction": [0.5]}, ["changing"]).iloc[0]
    figure = torque_history(history, row)
    assert any("\nchanging: sliding speed from 0.3 to 0 m/s" in text for text in drawn(figure))
    assert "Normal force [N]" in drawn(figure)


def test_the_zoom_has_the_last_ten_periods():
    figure = torque_history(history_table(), one_point().iloc[0])
    low, high = figure.axes[5].get_xlim()
    assert high == pytest.approx(100.0)
    assert high - low == pytest.approx(1e3 * 10 / 3175.0, rel=0.05)
    assert "last 10 periods of 3175 Hz; RMS 60 N m" in drawn(figure)
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()


def test_phases_end_where_the_run_does():
    history = history_table()
    row = one_point().iloc[0].copy()
    row["settled"] = False
    kinds = [(p.kind, p.name, p.stop) for p in phases(run_in_time(history, row))]
    assert kinds[0][:2] == ("growth", "exponential growth, 5 to 15 ms")
    assert kinds[1] == ("saturation", "not settled", pytest.approx(0.1))
    row["class"] = "growing"
    assert [p.kind for p in phases(run_in_time(history, row))] == ["growth"]
    row["class"], row["settled"], row["settled_time"] = "limit_cycle", True, 0.0
    assert [p.kind for p in phases(run_in_time(history, row))] == ["growth", "limit cycle"]
    without_fit = run_in_time(history, row, GROWTH.iloc[:0])
    assert [p.kind for p in phases(without_fit)] == ["limit cycle"]
    row["growth_rate"] = -5.0
    assert phases(run_in_time(history, row))[0].name.startswith("exponential decay")


def test_times_of_a_slow_run_are_in_seconds_and_it_is_not_settled_within_a_period():
    """Ticks of a run of 360 s were '240000260000', and it was 'settled from 5 ms'."""
    history, row = history_table(), one_point().iloc[0].copy()
    slow = history.assign(time=3600.0 * history["time"])
    row["settled_time"], row["frequency_hz"] = 5.0, 0.1
    told = drawn(torque_history(slow, row))
    assert told.count("Time [s]") == 2
    assert "settled from its start" in told
    row["frequency_hz"] = 1.0
    assert "settled from 5 s" in drawn(torque_history(slow, row))


def test_the_history_of_a_failed_point_says_why():
    row = points_table({"friction": [0.5]}, ["failed"]).iloc[0]
    texts = drawn(torque_history(history_table(200, 0.01), row, GROWTH))
    assert "friction = 0.5\nfailed; not_converged: t = 0.0123 s" in texts
    none = torque_history(history_table().iloc[:0], row)
    assert said(none) == "no history of this design point; not_converged: t = 0.0123 s"


@pytest.mark.parametrize("n", [0, 1])
def test_no_history_is_said(n):
    history, modes = history_table().iloc[:n], sweep()[1]
    row = one_point().iloc[0]
    assert said(torque_history(history, row)) == "no history of this design point"
    assert said(modal_energies(history, modes)) == "no modal energies of this design point"
    assert said(spectrogram(history)) == "no history of this design point to take spectra of"


# -- modal energies


def test_modal_energies_name_the_leading_modes():
    modes = modes_table({"p0": {44: 0.05, 45: 0.1, 51: 0.8}})
    row = one_point(transfer_from=44, transfer_to=51, transfer_time=0.07).iloc[0]
    figure = modal_energies(history_table(), modes, row)
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time [ms]", "Mechanical energy [J]")
    texts = drawn(figure)
    assert {"R51  4950 Hz, disc, 80 %", "R44  3180 Hz, caliper, 5 %"} <= set(texts)
    assert {"all modes", "outside the sensed modes"} <= set(texts)
    assert any("R51 takes over from R44 at 70 ms (dashed)" in text for text in texts)
    assert any(np.allclose(line.get_xdata(), 70.0) for line in axes.get_lines())
    assert overlapping(figure) == []
    low, high = axes.get_ylim()
    assert high == pytest.approx(0.04, rel=0.01)
    assert low >= 0.99 * 0.04e-8 / 2


def two_cells():
    return Figure(figsize=(20, 7)).subplots(1, 2)


@pytest.mark.parametrize("name", ["torque_history", "modal_energies", "spectrogram"])
def test_a_picture_takes_the_place_of_axes(name):
    left, right = two_cells()
    whole = left.figure
    results = of_one_point(history_table(), one_point().iloc[0], GROWTH)
    assert getattr(results.plot, name)(point=1, ax=right) is whole
    texts = [
        text for text in drawn(getattr(results.plot, name)(point=1)) if "e" in text
    ]  # no ticks
    assert texts
    assert set(texts) <= {*drawn(whole)}
    others = [axes for axes in whole.findobj(type(left)) if axes is not left]
    assert len(others) >= 1
    assert right not in others
    assert min(axes.bbox.x0 for axes in others) >= left.bbox.x1
    assert whole.get_layout_engine() is not None  # legends have room


def test_a_picture_takes_the_place_of_axes_of_a_grid_alone():
    results = of_one_point(history_table(), one_point().iloc[0], GROWTH)
    with pytest.raises(ResultsError, match="expected axes of a grid"):
        results.plot.torque_history(point=1, ax=Figure().add_axes((0.1, 0.1, 0.5, 0.5)))


def test_nothing_to_see_stands_in_the_axes():
    left, right = two_cells()
    points, modes = sweep(["failed"] * 6)
    results = made("transient", points=points, modes=modes, growth=GROWTH)
    assert results.plot.levels(ax=right) is left.figure
    assert "all failed" in right.texts[0].get_text()


def test_modes_of_the_transfer_are_named_whatever_their_share():
    history = pd.DataFrame({"time": [0.0, 1.0], "energy": 1.0, "energy_outside": 0.0})
    shares = dict(zip(range(1, 11), np.linspace(0.01, 0.1, 10), strict=True))
    for mode, share in shares.items():
        history[f"energy_mode_{mode}"] = share
    modes = pd.DataFrame({"mode": list(shares), "energy_share": list(shares.values())})
    modes = modes.assign(point_id="p0", frequency_hz=1e3, first_share=0.0)
    row = one_point().iloc[0]
    moved = one_point(transfer_from=1, transfer_to=2).iloc[0]
    for own, kept, expected in (
        (row, modes, [10, 9, 8, 7, 6, 5]),
        (moved, modes, [10, 9, 8, 7, 2, 1]),
        (row, modes.iloc[:0], [10, 9, 8, 7, 6, 5]),
    ):
        run = run_in_time(history, own, modes=kept)
        assert leading_modes(run, list(shares)) == expected
    texts = drawn(modal_energies(history, modes))
    assert any("grey: 4 other modes" in text for text in texts)


def test_energies_that_vanish_leave_the_logarithmic_axis():
    history = history_table()
    history[["energy_mode_45", "energy_outside"]] = 0.0
    texts = drawn(modal_energies(history, modes_table({})))
    assert "R44" in texts
    assert "R45" not in texts
    assert "outside the sensed modes" not in texts
    silent = history.assign(**{c: 0.0 for c in history if c.startswith("energy")})
    drawn(modal_energies(silent, modes_table({})))


# -- spectrogram


def test_the_spectrum_peaks_at_the_frequency_of_the_torque():
    t = np.arange(0.0, 0.1, 2e-5)
    centres, frequency, level = short_time_levels(t, 348 + 60 * np.sin(2 * np.pi * 3175.0 * t))
    assert level.shape == (len(frequency), len(centres))
    assert level.max() == pytest.approx(0.0)
    peaks = frequency[np.argmax(level, axis=0)]
    assert np.abs(peaks - 3175.0).max() <= frequency[1] / 2 + 1e-9
    assert centres[0] > t[0]
    assert centres[-1] < t[-1]
    assert level[frequency > 6000].max() < -60.0


def test_means_between_rows_damp_what_folds_back():
    """A line at 2,400 Hz in rows of 2,500 a second would stand at 100 Hz, as loud as it is."""
    step, every = 2e-5, 20
    t = step * np.arange(1, 40001)
    signal = 100 + np.sin(2 * np.pi * 300.0 * t) + 0.1 * np.sin(2 * np.pi * 2400.0 * t)
    times, rows, means = (
        t[every - 1 :: every],
        signal[every - 1 :: every],
        signal.reshape(-1, every).mean(axis=1),
    )
    levels = {}
    for name, values in {"rows": rows, "means": means}.items():
        _, frequency, level = short_time_levels(times, values, name == "means")
        at = np.abs(frequency - 100.0).argmin()
        levels[name] = level[at].max()
        peak = np.abs(frequency - 300.0).argmin()
        assert level[peak].max() == pytest.approx(0.0, abs=0.1)
    assert levels["rows"] == pytest.approx(-20.0, abs=0.5)
    assert levels["means"] < -45.0


def test_the_spectrogram_marks_predictions_up_to_the_band_top():
    growth = GROWTH.assign(point_id="p0")
    figure = spectrogram(history_table(), growth, top=5500.0)
    axes = next(a for a in figure.axes if a.get_xlabel())
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Time [ms]", "Frequency [Hz]")
    assert axes.get_ylim() == (0.0, 5500.0)
    assert isinstance(axes.collections[0], QuadMesh)
    texts = drawn(figure)
    assert {"3250 Hz, +300 1/s, 70 %", "4952 Hz, +249 1/s, 1 %", "5238 Hz, +2 1/s, 0 %"} <= set(
        texts
    )
    assert not any(text.startswith("6000 Hz,") for text in texts)
    assert "Torque [dB of its maximum]" in texts
    reach = "rows kept reach 19995 Hz, what is faster folds back below it"
    assert axes.get_title(loc="left") == f"friction = 0.5\ndominant 3175 Hz; {reach}"
    assert overlapping(figure) == []


def test_a_band_beyond_the_samples_is_said_and_uneven_samples_are_resampled():
    history = history_table(1001)
    figure = spectrogram(history)
    title = next(a for a in figure.axes if a.get_xlabel()).get_title(loc="left")
    assert "; rows kept reach 5" in title
    uneven = history_table().drop(index=range(100, 130))
    drawn(spectrogram(uneven, GROWTH.iloc[:0]))
    assert said(spectrogram(history.assign(torque=348.0))) == "the torque does not vary"


# -- growth


def test_growth_comparison_has_both_panels():
    points = points_table({"friction": MU[:3]}, ["limit_cycle"] * 2 + ["stable"])
    calm = GROWTH.iloc[:1].assign(point_id="p2", growth_rate=-20.0, unstable=False, expressed=None)
    calm = calm.assign(fitted_growth_rate=-20.2, fitted_low=-20.6, fitted_high=-19.8)
    growth = pd.concat([GROWTH, calm], ignore_index=True)
    table = growth_pairs(growth, points)
    assert table["predicted"].tolist() == [300.0, 249.0, 2.0, -20.0]
    assert table["deviation"].tolist() == pytest.approx([1.0, 100 * (230 / 249 - 1), 500.0, 1.0])
    assert table["kind"].tolist()[-1] == "stable mode"
    figure = growth_comparison(growth, points)
    upper, lower = figure.axes
    assert upper.get_ylabel() == "Fitted growth rate [1/s]"
    assert (lower.get_xlabel(), lower.get_ylabel()) == (
        "Predicted growth rate [1/s]",
        "Deviation [%]",
    )
    assert len(upper.containers) == 3
    assert len(lower.containers) == 3
    diagonal = lines(upper)["equal"]
    assert np.array_equal(diagonal.get_xdata(), diagonal.get_ydata())
    assert 7.6 < lower.get_ylim()[1] < 100.0
    carets = [
        line for line in lower.get_lines() if line.get_marker() == "^" and not line.get_clip_on()
    ]
    assert [line.get_xdata()[0] for line in carets] == [2.0]
    texts = drawn(figure)
    assert any(t.startswith("4 fitted growth rates, deviation") for t in texts)
    assert any(t.endswith("1 predicted without a fit") for t in texts)
    names = [t.get_text() for t in figure.legends[0].get_texts()]
    assert set(names) == {"equal", "expressed in the vibration (1)", "not expressed (2)"} | {
        "stable mode (1)"
    }


def test_the_title_of_the_growth_comparison_fits_the_picture():
    more = growth_table([("p1", 3, 6100.0, 1e-3, 1.1e-3, 0.0), ("p1", 4, 6200.0, 8.0, None, 0.0)])
    growth = pd.concat([GROWTH, more], ignore_index=True)
    figure = growth_comparison(growth, points_table({"friction": MU[:2]}, ["limit_cycle"] * 2))
    drawn(figure)
    (title,) = [text for text in figure.findobj(Text) if "fitted growth rates" in text.get_text()]
    assert "nearly neutral" in title.get_text()
    assert "2 predicted without a fit" in title.get_text()
    box = title.get_window_extent()
    assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1


def test_every_fitted_rate_of_growth_is_counted_once():
    """The least stable mode of a stable point is in the growth table: it was drawn twice."""
    points = points_table({"friction": MU[:2]}, ["stable", "growing"], n_unstable=[0, 1])
    growth = growth_table(
        [("p0", 1, 3250.0, -20.0, -20.1, np.nan), ("p1", 1, 3250.0, 50.0, 50.5, np.nan)]
    )
    table = growth_pairs(growth, points)
    assert table["kind"].tolist() == ["stable mode", "not told yet"]
    texts = drawn(growth_comparison(growth, points))
    assert any(t.startswith("2 fitted growth rates, deviation") for t in texts)
    assert not any("without a fit" in t for t in texts)


@pytest.mark.parametrize("bound", [3.0, 1e9, np.nan])
def test_neither_neutral_modes_nor_wide_bounds_blank_the_comparison(bound):
    """A prediction of 1e-13 1/s deviates by 1e12 %; bounds of 1e9 1/s made the scale."""
    growth = growth_table([("p0", 1, 100.0, 80.0, 81.0, 0.5), ("p1", 1, 100.0, 0.0, -1e-3, 0.5)])
    growth["fitted_low"] = growth["fitted_growth_rate"] - bound
    growth["fitted_high"] = growth["fitted_growth_rate"] + bound
    figure = growth_comparison(growth, points_table({"friction": MU[:2]}, ["limit_cycle"] * 2))
    upper, lower = figure.axes
    assert sorted(c.lines[0].get_xdata()[0] for c in upper.containers) == [0.0, 80.0]
    assert 1.25 < lower.get_ylim()[1] < 10.0
    assert any(
        "deviation 1.2 % (median), 1.2 % (largest)\n1 of these nearly neutral" in t
        for t in drawn(figure)
    )


def test_error_bars_are_the_bounds():
    figure = growth_comparison(GROWTH.iloc[:1], one_point())
    bars = figure.axes[0].containers[0].lines[2][0].get_segments()
    assert np.allclose(bars, [[[300.0, 300.0], [300.0, 306.0]]])


def test_growth_of_a_run_that_failed_later_is_marked():
    points = points_table({"friction": [0.5]}, ["failed"])
    assert growth_pairs(GROWTH.iloc[:1], points)["kind"].tolist() == ["point failed later"]


def test_growth_without_any_fit():
    points, _ = sweep(["failed"] * 6)
    none = growth_comparison(GROWTH.iloc[:0], points)
    text = "no growth rate was fitted\n0 unstable modes predicted\n6 of 6 points failed"
    assert said(none) == text
    unfitted = GROWTH.assign(fitted_growth_rate=np.nan)
    text = f"no growth rate was fitted\n{len(GROWTH)} unstable modes predicted\nruns: 1 limit cycle"
    text += "\nfits: 1 too short"
    assert said(growth_comparison(unfitted, one_point())) == text
    empty = growth_comparison(GROWTH.iloc[:0], one_point().iloc[:0])
    assert said(empty) == "no growth rate was fitted\nno design points"


# -- levels over a parameter


def test_levels_are_marked_by_class():
    figure = levels(*sweep(), "friction", units=UNITS)
    rms, means, frequencies, shares = figure.axes
    assert rms.get_ylabel() == "Torque RMS [N m]"
    assert means.get_ylabel() == "Torque [N m]"
    assert frequencies.get_ylabel() == "Frequency [Hz]"
    assert (shares.get_xlabel(), shares.get_ylabel()) == ("friction", "Energy share [%]")
    names = [t.get_text() for t in rms.get_legend().get_texts()]
    assert names == ["limit cycle", "irregular", "growing (not saturated)", "stable"]
    counts = [len(bars.lines[0].get_xdata()) for bars in rms.containers]
    assert counts == [2, 1, 1, 1]
    markers = [bars.lines[0].get_marker() for bars in rms.containers]
    assert markers == ["o", "D", "^", "o"]
    for axes in figure.axes[:3]:
        crosses = [c for c in axes.get_lines() if c.get_marker() == "x"]
        assert [list(c.get_xdata()) for c in crosses] == [[0.4]]
    assert "1 point failed (x): not_converged" in drawn(figure)


def test_what_a_failed_run_had_is_no_level():
    points, modes = sweep()
    points.loc[3, ["torque_rms", "torque_mean", "torque_static"]] = 500.0
    figure = levels(points, modes, "friction")
    for axes in figure.axes[:2]:
        assert axes.get_ylim()[1] < 450.0


def test_energy_shares_are_stacked_where_a_vibration_lasts():
    points, modes = sweep()
    lasting = points[points["class"].isin(["limit_cycle", "irregular", "growing"])]
    table = stacked_shares(lasting, modes)
    assert list(table.columns[:3]) == ["R44  3180 Hz", "R51  4950 Hz", "R45  3260 Hz"]
    assert table["R51  4950 Hz"].tolist() == pytest.approx([0.0, 0.3, 0.6, 0.6])
    assert table["outside the sensed modes"].tolist() == pytest.approx([0.05] * 4)
    figure = levels(points, modes, "friction")
    stacks = [[bar.get_height() for bar in bars] for bars in figure.axes[3].containers]
    assert len(stacks) == 4  # of other modes nothing is seen
    assert np.allclose(stacks[0], [80, 60, 20, 20])
    names = [t.get_text() for t in figure.legends[0].get_texts()]
    assert names[:2] == ["R44  3180 Hz", "R51  4950 Hz"]


def test_bars_are_about_their_points_and_equally_wide():
    x = np.array([0.0, 0.02, 0.05, 0.1])
    left, width = bar_places(x, False)
    assert np.allclose(left + width / 2, x)
    assert np.allclose(width, 0.8 * 0.02)
    left, width = bar_places(np.array([1.0, 10.0, 1000.0]), True)
    assert np.allclose((left + width) / left, 10**0.8)
    assert np.allclose(bar_places(np.array([0.5]), False), [[0.1], [0.8]])


def test_the_line_with_most_vibration_is_taken():
    points = points_table(
        {"friction": [0.3, 0.5, 0.3, 0.5], "pressure": [4e5, 4e5, 12e5, 12e5]},
        ["stable", "stable", "stable", "limit_cycle"],
    )
    modes = modes_table({"p3": {44: 0.9}})
    figure = levels(points, modes, "friction", units=UNITS)
    assert "pressure = 1.2 MPa" in drawn(figure)
    fixed = levels(points, modes, "friction", {"pressure": 4e5}, UNITS)
    assert "pressure = 0.4 MPa" in drawn(fixed)
    assert "no vibration lasts" in drawn(fixed)
    assert sweep_line(points.iloc[::-1], "friction")["friction"].tolist() == [0.3, 0.5]


def test_a_geometric_parameter_is_on_a_log_axis():
    points = points_table({"pressure": np.geomspace(2e5, 40e5, 6), "friction": 0.5}, KINDS)
    figure = levels(points, sweep()[1], "pressure", units=UNITS)
    assert [axes.get_xscale() for axes in figure.axes] == ["log"] * 4
    assert figure.axes[3].get_xlabel() == "pressure [MPa]"


def test_all_points_in_their_order_named_by_what_they_change():
    name = "caliper.modes[8].damping_ratio"
    points = points_table(
        {"friction": [0.5] * 4, name: [0.0, 0.02, 0.0, 0.05], "pressure": [4e5, 4e5, 8e5, 8e5]},
        ["limit_cycle", "stable", "irregular", "failed"],
    )
    assert design_names(points, UNITS) == [
        "first",
        f"{name} = 0.02",
        "pressure = 800 kPa",
        f"{name} = 0.05\npressure = 800 kPa",
    ]
    figure = levels(points, modes_table({"p0": {44: 0.9}, "p2": {51: 0.9}}), units=UNITS)
    drawn(figure)
    assert [t.get_text() for t in figure.axes[3].get_xticklabels()] == design_names(points, UNITS)
    assert figure.axes[3].get_xlabel() == ""


@pytest.mark.parametrize("along", ["friction", None])
def test_levels_of_one_point_of_failed_ones_and_of_none(along):
    points, modes = sweep()
    figure = levels(points.iloc[1:2], modes, along, units=UNITS)
    drawn(figure)
    assert len(figure.axes) == 4
    failed = sweep(["failed"] * 6)
    assert said(levels(*failed, along)) == "6 points, all failed: not_converged"
    assert said(levels(points.iloc[:0], modes, along)) == "no design points"
    calm = points.assign(**{"class": points["class"].where(points["status"] != "ok", "stable")})
    assert "no vibration lasts" in drawn(levels(calm, modes.iloc[:0], along))


def test_levels_refuse_what_is_not_there():
    points, modes = sweep()
    with pytest.raises(ResultsError, match=r"'pressure' is not varied.*friction"):
        levels(points, modes, "pressure")
    with pytest.raises(ResultsError, match="no design point has pressure = 1"):
        levels(points, modes, "friction", {"pressure": 1.0})
    with pytest.raises(ResultsError, match="'mu' is no parameter"):
        levels(points, modes, "friction", {"mu": 1.0})
    with pytest.raises(ResultsError, match="needs a column 'class' in the table 'points'"):
        levels(points.drop(columns="class"), modes, "friction")


def test_pictures_leave_their_tables_unchanged():
    points, modes = sweep()
    history, growth = history_table(), GROWTH.copy()
    before = [table.copy() for table in (points, modes, history, growth)]
    torque_history(history, points.iloc[1], growth)
    modal_energies(history, modes, points.iloc[1])
    spectrogram(history, growth, points.iloc[1])
    growth_comparison(growth, points)
    levels(points, modes, "friction")
    for table, old in zip((points, modes, history, growth), before, strict=True):
        pd.testing.assert_frame_equal(table, old)


def test_a_belt_has_a_friction_force_and_no_torque():
    units = {**UNITS, "torque": "N"}
    row, history = one_point().iloc[0], history_table()
    figures = {
        "history": torque_history(history, row, GROWTH, units=units),
        "levels": levels(*sweep(), "friction", units=units),
        "spectrogram": spectrogram(history, GROWTH.iloc[:0], units=units),
    }
    for name, figure in figures.items():
        texts = drawn(figure)
        assert any("riction force" in text for text in texts), name
        assert not any("N m" in text or "orque" in text for text in texts), name


def test_levels_of_runs_too_short_to_judge():
    points, modes = sweep()
    told = [n for n in points if n.startswith(("torque", "dominant", "growth"))]
    short = points.assign(**{"class": "undecided", "status": "ok"}, **dict.fromkeys(told, np.nan))
    short["dominant_mode"] = short["transfer_to"] = None
    assert "as the first" not in drawn(levels(short, modes.iloc[:0], "friction"))
    row = {**short.iloc[0].to_dict()}
    assert screen._findings(row)[0] == "undecided"
    assert set(screen._findings(row)[3:]) <= {"-", ""}
