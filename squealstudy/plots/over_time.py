"""Common parts of pictures over time: long signals, labels at line ends, design points' runs."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from squealstudy.colours import COLOURS
from squealstudy.engine.pictures import Choices
from squealstudy.plots.style import finish, quantity, whole_figure
from squealstudy.plots.tables import describe
from squealstudy.tables.energy_ranking import transient_parameters
from squealstudy.wording import TORQUE

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

PALETTE = [c for c in COLOURS if c != "#000000"]  # colours of modes; black is for their sum
MOST_HISTORIES = 16  # design points whose histories are drawn; `results.plot` draws any other
N_TIME_BINS = 1500  # parts of a long signal, about as many as an axis has pixels
MS_PER_S = 1e3
LEAST_SLOW_S = 10.0  # runs that end later [s] are shown in seconds
MOST_NAMED = 2  # largest number of varied parameters that are all named in a title
# size of labels at line ends, and their distance from the axes, points
LABEL_FONT_POINTS, LABEL_GAP_POINTS = 8.5, 6.0
TITLE_LINE_CHARACTERS = 100  # characters of a line of a title


@dataclass(frozen=True)
class EndLabel:
    """A text to the right of the axes, at a height in data coordinates."""

    y: float
    text: str
    colour: str = "black"


def histories(results: Results) -> Iterator[tuple[str, Choices]]:
    """A picture for each of the first design points that kept a history.

    It is named by the values of its parameters; by its row if many or no parameters vary, or if
    another picture has the same name.
    """
    has_history = results.points["point_id"].isin(results.store.kept_histories()).to_numpy()
    rows = np.flatnonzero(has_history)[:MOST_HISTORIES].tolist()
    names = [_values_in_name(results, row) for row in rows]
    for row, name in zip(rows, names, strict=True):
        is_unique = name and names.count(name) == 1
        yield name if is_unique else f"_point_{row}", {"point": row}


def _values_in_name(results: Results, row: int) -> str:
    """Values of the varied parameters for the name of a file, ``_pressure_12_bar``."""
    points, text = results.points, ""
    varied = transient_parameters(points, varied=True)
    for name in varied if len(varied) <= MOST_NAMED else ():
        axis = quantity(name, points[name], results.units)
        unit = "" if axis.factor == 1.0 else f"_{axis.unit.replace('/', '_per_')}"
        number = f"{axis.factor * float(points[name].iloc[row]):.4g}"
        text += f"_{results.file_word(name)}_{number}{unit}"
    return text


@dataclass(frozen=True)
class Run:
    """The run of a design point, for pictures over time.

    Attributes
    ----------
    row : Series
        The design point's row of the points table.
    title : str
        The values of its parameters, in words.
    history : DataFrame
        A row for each kept step; empty where none was kept.
    growth, modes : DataFrame
        Rows of these tables that belong to it.
    units : mapping of column -> unit
        Units of columns and parameters.
    """

    row: pd.Series
    title: str
    history: pd.DataFrame
    growth: pd.DataFrame
    modes: pd.DataFrame
    units: Mapping[str, str]

    def column(self, name: str) -> np.ndarray:
        """A column (n,) of the history; NaN if it has no such column."""
        if name not in self.history:
            return np.full(len(self.history), np.nan)
        values: np.ndarray = self.history[name].to_numpy(dtype=float)
        return values

    def number(self, name: str) -> float:
        """A number in the row of the points table; NaN where there is none."""
        cell = self.row.get(name, np.nan)
        return np.nan if pd.isna(cell) else float(cell)

    @property
    def changes(self) -> bool:
        """Whether speed or pressure change during the run."""
        return "sliding_speed" in self.history

    @property
    def milliseconds(self) -> np.ndarray:
        """Times of the history (n,), ms."""
        return MS_PER_S * self.column("time")

    @property
    def is_slow(self) -> bool:
        """Whether the run is so long that its times are shown in seconds."""
        return bool(self.column("time")[-1] >= LEAST_SLOW_S)

    def moment(self, seconds: float) -> str:
        """A time of the run in its unit: ``29.7 ms``, of a slow run ``16.2 s``."""
        return f"{seconds:.3g} s" if self.is_slow else f"{MS_PER_S * seconds:.3g} ms"

    @property
    def limits(self) -> tuple[float, float]:
        """First and last time of the history, ms; one millisecond apart if they are the same."""
        first, last = (float(t) for t in self.milliseconds[[0, -1]])
        return first, last if last > first else first + 1.0


def finish_time(axes: Axes, run: Run, y: str) -> None:
    """Labels of axes over time in milliseconds, which are told in seconds of a slow run."""
    finish(axes, "Time [s]" if run.is_slow else "Time [ms]", y)
    if run.is_slow:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{t / MS_PER_S:g}"))


def run_of(results: Results, point: str | int) -> Run:
    """The run of a design point; `point` is its id or row, as ``Results.history`` takes it."""
    history, row = results.history(point), results.points.iloc[results.row_of(point)]
    growth, modes = (
        table[(table["point_id"] == row["point_id"]).to_numpy()]
        for table in (results.growth, results.modes)
    )
    return Run(
        row=row,
        title=design_text(results.points, row, results.units),
        history=history,
        growth=growth,
        modes=modes,
        units=results.units,
    )


def friction_label(units: Mapping[str, str]) -> tuple[str, str]:
    """What the columns ``torque_*`` are, a torque or a friction force, and their unit."""
    unit = units.get(TORQUE, "N m")
    return ("torque" if unit == "N m" else "friction force"), unit


def end_labels(axes: Axes, labels: Sequence[EndLabel]) -> None:
    """Write labels to the right of the axes, as near to their heights as possible without overlap.

    A thin line leads from each height to its label. Everything else must have been drawn before,
    and limits and scales must be final.
    """
    if not labels:
        return
    figure = whole_figure(axes)
    figure.draw_without_rendering()
    scale = figure.dpi / 72
    frame = axes.get_window_extent()
    heights = axes.transData.transform([(axes.get_xlim()[1], label.y) for label in labels])[:, 1]
    clipped = np.clip(heights, frame.y0, frame.y1)
    placed = spread(clipped, 1.35 * LABEL_FONT_POINTS * scale, frame.y0, frame.y1)
    for label, height, label_height in zip(labels, clipped, placed, strict=True):
        end = (1.0, float((height - frame.y0) / frame.height))
        text = (1.0, float((label_height - frame.y0) / frame.height))
        axes.annotate(
            "",
            end,
            (LABEL_GAP_POINTS, (label_height - height) / scale),
            xycoords="axes fraction",
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "color": label.colour, "linewidth": 0.7}
            | {"shrinkA": 0, "shrinkB": 0},
            annotation_clip=False,
        )
        axes.annotate(
            label.text,
            text,
            (LABEL_GAP_POINTS + 2.0, 0.0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            fontsize=LABEL_FONT_POINTS,
            color=label.colour,
            annotation_clip=False,
        )


def spread(positions: np.ndarray, min_distance: float, low: float, high: float) -> np.ndarray:
    """Positions (n,) that are at least `min_distance` apart, and between the limits.

    The distance is smaller if they would not fit. Their order is kept, and the sum of the squares
    of all shifts is least: blocks that would overlap are merged about their mean (pool adjacent
    violators).
    """
    order = np.argsort(positions, kind="stable")
    min_distance = min(min_distance, (high - low) / max(len(positions) - 1, 1))
    blocks: list[tuple[float, int]] = []  # mean position without offsets, number of positions
    for k, height in enumerate(positions[order]):
        blocks.append((float(height) - k * min_distance, 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (b, m), (a, n) = blocks.pop(), blocks.pop()
            blocks.append(((a * n + b * m) / (n + m), n + m))
    base = np.concatenate([np.full(n, mean) for mean, n in blocks])
    base = np.clip(base, low, high - (len(positions) - 1) * min_distance)
    placed = np.empty(len(positions))
    placed[order] = base + min_distance * np.arange(len(positions))
    return placed


def outline(x: np.ndarray, y: np.ndarray, bins: int = N_TIME_BINS) -> tuple[np.ndarray, np.ndarray]:
    """A signal (n,); a long one by its smallest and largest value in each of `bins` parts."""
    if len(x) <= 4 * bins:
        return x, y
    starts = np.linspace(0, len(x), bins, endpoint=False).astype(int)
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    return np.repeat(x[starts], 2), np.column_stack([low, high]).ravel()


def binned(x: np.ndarray, y: np.ndarray, bins: int) -> tuple[np.ndarray, np.ndarray]:
    """Means (m,) of abscissa and signal (n,) over at most `bins` parts."""
    starts = np.unique(np.linspace(0, len(x), min(bins, len(x)), endpoint=False).astype(int))
    counts = np.diff(np.append(starts, len(x)))
    return np.add.reduceat(x, starts) / counts, np.add.reduceat(y, starts) / counts


def design_text(points: pd.DataFrame, row: pd.Series, units: Mapping[str, str]) -> str:
    """Parameters of a design point with their units, in lines that fit over a picture.

    These are the varied parameters; of more than MOST_NAMED only those that differ from the first
    point's; all parameters if none is varied.
    """
    names = transient_parameters(points, varied=True)
    if len(names) > MOST_NAMED:
        names = [n for n in names if row[n] != points[n].iloc[0]]
        if not names:
            return "first design point"
    text = describe(row, points, names or transient_parameters(points), units)
    return textwrap.fill(text, TITLE_LINE_CHARACTERS)
