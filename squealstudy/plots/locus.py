"""The way of a track through the complex plane, with those that it meets."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from squealstudy.plots.line import StudyLine
from squealstudy.plots.style import UNSTABLE, finish

NEAR = 0.03  # relative distance in frequency within which other tracks are shown
LEFT = 2.0  # of the fastest growth: how far the stable side reaches
LONGEST_NAME = 36  # characters that fit a title


def draw_locus(axes: Axes, line: StudyLine, track: int) -> None:
    """Growth rate against frequency of one track; arrows point to a rising parameter."""
    frequency, growth = line.frequency_hz[track], line.growth_rate[track]
    low, high = frequency.min() * (1 - NEAR), frequency.max() * (1 + NEAR)
    fastest = float(growth.max()) if growth.max() > 0 else float(growth.abs().max()) or 1.0
    within = ((line.frequency_hz > low) & (line.frequency_hz < high)).any()
    for other in [*within.index[within].drop(track), track]:
        x, y = line.growth_rate[other].to_numpy(), line.frequency_hz[other].to_numpy()
        _path(axes, x, y, line.colour(int(other)), 2.0 if other == track else 1.0)
    axes.set_xlim(-LEFT * fastest, 1.2 * fastest)
    axes.set_ylim(low, high)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.axvspan(0.0, 1.2 * fastest, color=UNSTABLE, alpha=0.08, linewidth=0, zorder=0)
    axes.axvline(0.0, color="0.2", linewidth=1.0, zorder=1)
    finish(axes, "Growth rate [1/s]", "Frequency [Hz]")
    name = line.shown.name if len(line.shown.name) <= LONGEST_NAME else "values"
    axes.set_title(f"T{track}, arrows: rising {name}", fontsize=9, loc="left")


def _path(axes: Axes, x: np.ndarray, y: np.ndarray, colour: str, width: float) -> None:
    """A curve from a hollow dot to an arrow head."""
    axes.plot(x, y, color=colour, linewidth=width, marker=".", markersize=3 * width, zorder=width)
    known = np.flatnonzero(np.isfinite(x))
    axes.plot(x[known[:1]], y[known[:1]], "o", color=colour, markerfacecolor="white", zorder=3)
    moved = np.flatnonzero(np.hypot(np.diff(x), np.diff(y)) > 0)
    if len(moved):
        k = moved[-1]
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "mutation_scale": 14}
        head = axes.annotate("", (x[k + 1], y[k + 1]), (x[k], y[k]), arrowprops=arrow)
        head.set_in_layout(False)
