"""Spectrum of the braking torque over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.over_time import (
    MS_PER_S,
    EndLabel,
    Run,
    end_labels,
    finish_time,
    friction_label,
    histories,
    run_of,
)
from squealstudy.plots.style import empty_figure, figure_at, head, joined, signed, whole_figure
from squealstudy.wording import in_digits

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

# length of a run over that of a Hann window, which resolves lines about 2 / its length apart
WINDOWS_PER_RUN = 12.5
FEWEST_SAMPLES = 32  # least number of kept rows of a run
MAX_FRAMES = 400  # number of windows, at most about this
ZERO_PADDING_FACTOR = 4  # padding makes the frequency axis finer, not the resolution
SHOWN_RANGE_DB = 60.0  # range that is shown below the maximum, dB
PA_PER_BAR = 1e5
UNEVEN_STEP_RATIO = 1e-3  # a history whose steps have a larger relative spread is resampled


@register_plot(histories, points=("class",), growth=("level_share",))
def spectrogram(results: Results, point: str | int = 0, ax: Axes | None = None) -> Figure:
    """Short-time amplitude of the torque in dB of its maximum, up to the top of the band.

    Where a history has the torque's means between rows, these are used. Content above half the rate
    of rows folds onto lower frequencies; means damp it before.

    Predicted instabilities are marked at the right edge. Where speed or pressure change, these are
    drawn beneath instead.

    Parameters
    ----------
    results : Results
        Of a transient study.
    point : str or int
        ``point_id`` of a design point, or its row of `points`, counted from 0.
    ax : matplotlib.axes.Axes or None
        Axes of a grid that the picture takes the place of; None: a new figure.

    Raises
    ------
    ResultsError
        Where there is no such point, or no history of it was kept.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("hoffmann_flutter")[0])
    >>> results = sq.run(study.with_({"transient.duration": 0.5}, friction=[0.8]))
    >>> results.plot.spectrogram(point=0).savefig("spectrogram.png")
    """
    run = run_of(results, point)
    band_top = float(results.fact("band_hz")[1])
    what, _ = friction_label(results.units)
    if len(run.history) < FEWEST_SAMPLES:
        return empty_figure("no history of this design point to take spectra of", ax)
    means = run.column("torque_mean")
    averaged = bool(np.isfinite(means[1:]).all()) and len(means) > 1
    time, torque = _even(run.column("time"), means if averaged else run.column("torque"))
    centres, frequency, level = short_time_levels(time, torque, averaged)
    if not np.isfinite(level).any():
        return empty_figure(f"the {what} does not vary", ax)
    figure = figure_at(ax, 10.0, 6.8 if run.changes else 5.6)
    if run.changes:
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.2, 1.0])
    else:
        axes = figure.add_subplot()
    nyquist = float(frequency[-1])
    top = min(band_top, nyquist)
    shown = frequency <= top * (1 + 1e-9)
    drawn = axes.pcolormesh(
        MS_PER_S * centres,
        frequency[shown],
        level[shown],
        cmap="viridis",
        vmin=-SHOWN_RANGE_DB,
        vmax=0.0,
        shading="gouraud",
        rasterized=True,
    )
    figure.colorbar(
        drawn, ax=axes, label=f"{what.capitalize()} [dB of its maximum]", location="left", pad=0.02
    )
    finish_time(axes, run, "Frequency [Hz]")
    if run.changes:
        axes.set_xlabel("")
    axes.grid(False)
    axes.set_ylim(0.0, top)
    f = run.number("torque_line_hz")
    dominant = f"dominant {in_digits(f)} Hz" if f > 0 else ""
    folds = "is damped and folds back" if averaged else "folds back"
    reached = f"rows kept reach {in_digits(nyquist)} Hz, what is faster {folds} below it"
    head(axes, run.title, joined(dominant, reached))
    if run.changes:
        _imposed(below, run)
    else:
        _predictions(axes, run.growth, top)
    return whole_figure(figure)


def _imposed(axes: Axes, run: Run) -> None:
    """Draw speed over time, and the pressure where it changes."""
    axes.plot(run.milliseconds, run.column("sliding_speed"), color=DARK)
    axes.set_xlim(*run.limits)
    axes.axhline(0.0, color=DARK, linewidth=0.6)
    finish_time(axes, run, "Sliding speed [m/s]")
    if "pressure" in run.history:
        right = axes.twinx()
        right.plot(run.milliseconds, run.column("pressure") / PA_PER_BAR, color=COLOURS[0])
        right.set_ylabel("Pressure [bar]", color=COLOURS[0])


def short_time_levels(
    time: np.ndarray, signal: np.ndarray, averaged: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (m,) of Hann windows [s], frequencies (f,) [Hz] and levels (f, m) [dB of the max].

    The mean of each window is subtracted. Amplitudes of a signal of means over its steps
    (`averaged`) are divided by sinc(f step), the factor that averaging has on them. Levels are at
    least -2 SHOWN_RANGE_DB; all are NaN if the signal does not vary.
    """
    step = (time[-1] - time[0]) / (len(time) - 1)
    length = max(round(len(time) / WINDOWS_PER_RUN), FEWEST_SAMPLES // 4)
    hop = max(length // 8, (len(time) - length) // MAX_FRAMES, 1)
    frames = np.lib.stride_tricks.sliding_window_view(signal, length)[::hop]
    frames = (frames - frames.mean(axis=1, keepdims=True)) * np.hanning(length)
    amplitude = np.abs(np.fft.rfft(frames, ZERO_PADDING_FACTOR * length, axis=1)).T
    frequencies = np.fft.rfftfreq(ZERO_PADDING_FACTOR * length, step)
    if averaged:
        amplitude /= np.sinc(frequencies * step)[:, None]
    largest = float(amplitude.max())
    floor = 1e-12 * float(np.abs(signal).max()) * length
    if not largest > floor:
        level = np.full(amplitude.shape, np.nan)
    else:
        level = 20 * np.log10(np.maximum(amplitude / largest, 10 ** (-2 * SHOWN_RANGE_DB / 20)))
    centres = time[0] + step * (hop * np.arange(len(frames)) + (length - 1) / 2)
    return centres, frequencies, level


def _even(time: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Finite samples at equal steps; they are interpolated if their own steps are not equal."""
    finite = np.isfinite(time) & np.isfinite(signal)
    time, signal = time[finite], signal[finite]
    steps = np.diff(time)
    if np.ptp(steps) <= UNEVEN_STEP_RATIO * np.median(steps):
        return time, signal
    even = np.linspace(time[0], time[-1], len(time))
    return even, np.interp(even, time, signal)


def _predictions(axes: Axes, growth: pd.DataFrame, top: float) -> None:
    """Write predicted instabilities at the right edge, with growth and share of energy."""
    unstable = growth["unstable"].to_numpy(bool)
    in_view = growth[unstable & (growth["frequency_hz"] <= top).to_numpy()]
    labels = []
    for row in in_view.to_dict("records"):
        colour = DARK if pd.isna(row["expressed"]) or not row["expressed"] else COLOURS[0]
        text = f"{in_digits(row['frequency_hz'])} Hz, {signed(row['growth_rate'])} 1/s"
        share = row["level_share"]
        text += f", {100 * share:.0f} %" if np.isfinite(share) else ""
        labels.append(EndLabel(float(row["frequency_hz"]), text, colour))
    if not labels:
        return
    axes.text(
        1.02,
        -0.02,
        "predicted unstable\n(share of energy)",
        transform=axes.transAxes,
        fontsize=8,
        color=DARK,
        va="top",
    )
    end_labels(axes, labels)
