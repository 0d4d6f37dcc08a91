"""Common parts of all pictures: colours, axes with units, limits, legends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from squealstudy.colours import COLOURS
from squealstudy.engine.pictures import NOTHING_TO_SEE
from squealstudy.errors import ResultsError
from squealstudy.shown_units import prefixed
from squealstudy.wording import in_digits, name_where_fastest, track_number

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
UNSTABLE = COLOURS[0]
TWO_DECADES = 100.0  # below this ratio of largest to least value powers of ten are too few ticks
# relative spread of steps of logarithms, over that of steps, below which an axis is logarithmic
MAX_LOG_STEP_SPREAD_RATIO = 0.6


@dataclass(frozen=True)
class Quantity:
    """How a parameter is shown: values times `factor`, in `unit`, with logarithms if `log`."""

    name: str
    unit: str
    factor: float
    log: bool

    @property
    def label(self) -> str:
        """Text of an axis: name and unit of the quantity."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def scaled(self, values: pd.Series) -> np.ndarray:
        """Values as drawn, (n,) float."""
        shown: np.ndarray = values.to_numpy(dtype=float) * self.factor
        return shown

    def even(self, drawn: np.ndarray) -> np.ndarray:
        """Positions of drawn values on the axis: their logarithms on a logarithmic one."""
        positions: np.ndarray = np.log(drawn) if self.log else np.asarray(drawn, dtype=float)
        return positions

    def uneven(self, positions: np.ndarray) -> np.ndarray:
        """Drawn values at positions on the axis: the inverse of `even`."""
        return np.exp(positions) if self.log else positions

    def edges(self, drawn: np.ndarray) -> np.ndarray:
        """Edges (n + 1,) of cells about ascending drawn values (n,), midway on the axis."""
        positions = self.even(drawn)
        if len(positions) == 1:
            return self.uneven(positions + np.array([-0.5, 0.5]))
        middle = (positions[1:] + positions[:-1]) / 2
        ends = 2 * positions[0] - middle[0], 2 * positions[-1] - middle[-1]
        return self.uneven(np.concatenate([ends[:1], middle, ends[1:]]))

    def text(self, value: float) -> str:
        """One value with its name and unit."""
        return f"{self.name} = {value * self.factor:.4g} {self.unit}".rstrip()

    def ticks(self, values: pd.Series) -> list[float] | None:
        """The values as drawn if they are few and far enough apart, else None."""
        x = np.unique(self.scaled(values.dropna()))
        positions = self.even(x)
        crowded = len(x) > 1 and np.diff(positions).min() < 0.03 * np.ptp(positions)
        return None if len(x) > 12 or crowded or not len(x) else [float(v) for v in x]

    def norm(self, values: pd.Series) -> Normalize:
        """Colour scale over these values."""
        low, high = (float(limit) * self.factor for limit in (values.min(), values.max()))
        if low == high:
            low, high = low - 0.5, high + 0.5
        return LogNorm(low, high) if self.log else Normalize(low, high)


def quantity(name: str, values: pd.Series, units: Mapping[str, str]) -> Quantity:
    """How to show a parameter of these values; `units` maps names to SI units."""
    unit = units.get(name, "")
    x = np.unique(values.dropna().to_numpy(dtype=float))
    size = float(np.abs(x).max(initial=0.0))
    shown, factor = prefixed(unit, size)
    return Quantity(name, shown, factor, is_geometric(x))


def is_geometric(x: np.ndarray) -> bool:
    """Whether ascending values are spaced by factors, the last being 5 times the first or more."""
    if len(x) < 3 or x[0] <= 0 or x[-1] < 5 * x[0]:
        return False
    steps, factors = np.diff(x), np.diff(np.log(x))
    return bool(
        np.std(factors) / np.mean(factors)
        < MAX_LOG_STEP_SPREAD_RATIO * np.std(steps) / np.mean(steps)
    )


def set_scales(axes: Axes, across: Quantity, up: Quantity | None = None) -> None:
    """Set logarithmic axes where values are spaced so; to be called before anything is drawn."""
    if across.log:
        axes.set_xscale("log")
    if up is not None and up.log:
        axes.set_yscale("log")


def set_ticks(axis: Axis, shown: Quantity, values: pd.Series) -> None:
    """Tick a parameter's axis at its values where they are few, in plain numbers."""
    ticks = shown.ticks(values)
    if ticks is not None:
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_minor_locator(NullLocator())
    if shown.log:
        if ticks is None and values.min() > 0 and values.max() < TWO_DECADES * values.min():
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
        axis.set_minor_formatter(NullFormatter())


def new_figure(width: float = 9.0, height: float = 5.5) -> Figure:
    """An empty figure whose parts make room for each other; width and height in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def figure_at(ax: Axes | None, width: float, height: float) -> FigureBase:
    """A new figure, or a part of the user's figure in the place of `ax`, which is removed.

    Raises
    ------
    ResultsError
        For axes that are in no grid.
    """
    if ax is None:
        return new_figure(width, height)
    cell = ax.get_subplotspec()
    if cell is None:
        raise ResultsError("ax: expected axes of a grid, as plt.subplots() gives them")
    if whole_figure(ax).get_layout_engine() is None:  # legends beneath axes need one
        whole_figure(ax).set_layout_engine("constrained")
    part: FigureBase = ax.figure.add_subfigure(cell)
    ax.remove()
    return part


def whole_figure(part: FigureBase | Axes) -> Figure:
    """The figure that a part of one, or axes, is in."""
    figure: Figure = part.figure.figure
    return figure


def one_panel(ax: Axes | None, width: float = 9.0, height: float = 5.5) -> tuple[Figure, Axes]:
    """A figure and axes to draw in: those of the user if given, else new ones."""
    if ax is not None:
        return whole_figure(ax), ax
    figure = new_figure(width, height)
    return figure, figure.add_subplot()


def empty_figure(message: str, ax: Axes | None = None) -> Figure:
    """A figure with a message on why there is nothing to see."""
    figure, axes = one_panel(ax, 7.0, 2.5)
    if ax is None:
        figure.set_label(NOTHING_TO_SEE)
    axes.set_axis_off()
    axes.text(0.5, 0.5, message, ha="center", va="center", fontsize=12, color="0.3")
    return figure


def finish(axes: Axes, x: str, y: str) -> None:
    """Set labels and a light grid."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True, color="0.9", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def head(axes: Axes, *lines: str) -> None:
    """Write lines above the axes; empty ones are left out."""
    axes.set_title("\n".join(line for line in lines if line), fontsize=9, loc="left")


def legend_below(
    figure: FigureBase, handles: Sequence[Artist], ncols: int = 4, place: str = "center"
) -> None:
    """Draw a legend beneath all axes; none without handles."""
    if handles:
        style: dict[str, Any] = {"ncols": ncols, "fontsize": 9, "frameon": False}
        figure.legend(handles=handles, loc=f"outside lower {place}", **style)


def legend_of(figure: Figure, ax: Axes | None, handles: Sequence[Artist], ncols: int = 4) -> None:
    """Draw a legend beneath the axes of a new figure, or within axes of the user."""
    if ax is None:
        legend_below(figure, handles, ncols)
    elif handles:
        ax.legend(handles=handles, fontsize=8, frameon=False)


def signed(value: float) -> str:
    """A number of either sign in three digits, all before its point: ``+0.123``, ``+1381``."""
    return f"{value:+.0f}" if abs(value) >= 999.5 else f"{value:+.3g}"


def labelled(axes: Axes) -> list[Artist]:
    """Artists in the axes that have a label, for a legend."""
    return list(axes.get_legend_handles_labels()[0])


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Write names of horizontal bars, the first on top, without a grid between them."""
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(False, axis="y")


def error_reach(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Lengths (2, n) of error bars from values (n,) to their bounds; zero if not known."""
    lengths: np.ndarray = np.maximum(np.nan_to_num([value - low, high - value]), 0.0)
    return lengths


def cross_out(axes: Axes, x: np.ndarray) -> None:
    """Draw crosses at the foot of the axes at values x where design points failed."""
    if len(x):  # an unclipped curve without points would spoil the layout
        text_options: dict[str, Any] = {"clip_on": False, "transform": axes.get_xaxis_transform()}
        axes.plot(x, np.zeros(len(x)), "x", color="0.2", **text_options)


def joined(*parts: str, by: str = "; ") -> str:
    """Join the parts that are not empty."""
    return by.join(part for part in parts if part)


def shade_unstable(axes: Axes, above: bool = False) -> None:
    """Shade the unstable area: below zero damping or, with `above`, above zero growth."""
    low, high = axes.get_ylim()
    edge, place, align = (high, 0.985, "top") if above else (low, 0.015, "bottom")
    axes.axhline(0.0, color="0.2", linewidth=1.0, zorder=1)
    axes.axhspan(edge, 0.0, color=UNSTABLE, alpha=0.08, linewidth=0, zorder=0)
    text: dict[str, Any] = {
        "color": UNSTABLE,
        "fontsize": 9,
        "va": align,
        "transform": axes.transAxes,
    }
    across, ha = _emptiest(axes, place - 0.03 if above else place + 0.03)
    axes.text(across, place, "unstable", ha=ha, **text)


def _emptiest(axes: Axes, height: float) -> tuple[float, str]:
    """Position across the axes at which a short text covers fewest curves, and its alignment.

    `height` is that of the text's middle, as a share of the axes' height.
    """
    pieces = [np.empty((0, 2))]
    for line in axes.lines:
        on_axes = (line.get_transform() - axes.transAxes).transform(line.get_xydata())
        share = np.linspace(0.0, 1.0, 40)[:, None, None]
        pieces.append(((1.0 - share) * on_axes[:-1] + share * on_axes[1:]).reshape(-1, 2))
        pieces.append(on_axes)
    x, y = np.concatenate(pieces).T
    level = abs(y - height) < 0.06
    choices = ((0.006, "left", 0.06), (0.994, "right", 0.94), (0.5, "center", 0.5))
    covered = [int((level & (abs(x - middle) < 0.07)).sum()) for _, _, middle in choices]
    across, ha, _ = choices[int(np.argmin(covered))]
    return across, ha


def damping_limits(zeta_percent: np.ndarray) -> tuple[float, float]:
    """Limits [%] that show instabilities and light damping; heavily damped modes are beyond."""
    zeta = zeta_percent[np.isfinite(zeta_percent)]
    low = min(float(zeta.min(initial=0.0)) * 1.15, 0.0)
    most = float(zeta.max(initial=0.0)) * 1.1
    high = max(min(-1.5 * low, most), min(most, 3.0), 0.5)  # no emptier than the modes are
    return min(low, -0.1 * high), high


def growth_limits(growth: np.ndarray) -> tuple[float, float]:
    """Limits [1/s] that show instabilities, and about as much of the stable side."""
    finite = np.append(growth[np.isfinite(growth)], 0.0)
    fastest = float(finite.max())
    if fastest > 0:
        return -1.5 * fastest, 1.15 * fastest
    low = min(1.1 * float(finite.min()), -1.0)
    return low, -0.1 * low


def track_name(
    track: int,
    frequency_hz: float,
    names: Mapping[int, tuple[str, bool]] | None = None,
    width: int | None = None,
) -> str:
    """A track in a legend or label, by its name if it has one (`Results.track_names`).

    The text has lines of at most `width` characters.
    """
    hertz = f"{in_digits(frequency_hz)} Hz"
    if track <= 0:
        return hertz
    if not names or track not in names:
        return f"{track_number(track)}  {hertz}"
    text = f"{name_where_fastest(names[track])}, {hertz} ({track_number(track)})"
    return text if width is None else "\n".join(wrap(text, width))
