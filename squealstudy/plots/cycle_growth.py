"""Growth of a design's modes over amplitude: where it is zero there is a limit cycle."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import COLOURS, DARK, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.style import (
    empty_figure,
    finish,
    growth_limits,
    labelled,
    legend_of,
    one_panel,
)
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

SAME_CYCLE = 0.05  # relative change of a cycle's contact velocity that more harmonics may make
MAX_COLOURED_FAMILIES = 8  # families with a colour and a name, those of the fastest growth


CYCLES = {True: "stable cycle", False: "unstable cycle", None: "cycle, stability not known"}


def _most_telling(results: Results) -> Iterator[tuple[str, Choices]]:
    """The design that needs the least kick to squeal, else the first that has a cycle."""
    points = results.points
    kicked = points[points["threshold_velocity"].notna().to_numpy(bool)]
    if len(kicked):
        weakest = int(np.argmin(kicked["threshold_velocity"].to_numpy(float)))
        yield "", {"point": kicked["point_id"].iloc[weakest]}
    elif (some := points[(points["n_cycles"].fillna(0) > 0).to_numpy(bool)]).size:
        yield "", {"point": some["point_id"].iloc[0]}


def _stable(cycles: pd.DataFrame, point: str, mode: int, x: np.ndarray) -> list[bool | None]:
    """Whether a mode's cycles at contact velocities x (n,) [m/s] are stable; None if unknown."""
    chosen = cycles[((cycles["point_id"] == point) & (cycles["mode"] == mode)).to_numpy(bool)]
    velocity, stable = chosen["contact_velocity"].to_numpy(float), chosen["stable"].to_list()
    nearest = [int(np.argmin(np.abs(velocity - v))) if len(velocity) else -1 for v in x]
    return [
        None
        if k < 0 or abs(velocity[k] / v - 1.0) > SAME_CYCLE or pd.isna(stable[k])
        else bool(stable[k])
        for k, v in zip(nearest, x, strict=True)
    ]


@register_plot(_most_telling, points=("verdict",), curves=("added_damping",), cycles=("stable",))
def cycle_growth(results: Results, point: str, ax: Axes | None = None) -> Figure:
    """Growth rate over contact velocity of the mode families of one design.

    Parameters
    ----------
    results : Results
        Of a study of limit cycles.
    point : str
        The design's point_id, or its beginning.
    ax : matplotlib.axes.Axes or None
        Axes to draw in; by default those of a new figure.

    Raises
    ------
    ResultsError
        Where no design point, or more than one, has such a point_id.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("cycles_from_onset")[0])
    >>> results = sq.run(study.with_(friction=[0.298, 0.305]))
    >>> results.plot.cycle_growth(results.points["point_id"][0]).savefig("growth.png")
    """
    points = results.points
    chosen = points[points["point_id"].str.startswith(point).to_numpy(bool)]
    if len(chosen) != 1:
        raise ResultsError(f"'{point}' is the beginning of {len(chosen)} design points, not of one")
    design = chosen.iloc[0]
    curves = results.table("curves")
    curves = curves[(curves["point_id"] == design["point_id"]).to_numpy(bool)]
    if not len(curves):
        return empty_figure("no curve of this design was followed", ax)
    rate = 0.5 * curves["added_damping"].to_numpy(float)
    fastest = curves.assign(rate=rate).groupby("mode")["rate"].max().sort_values(ascending=False)
    figure, axes = one_panel(ax, 8.5, 5.4)
    for rank, mode in enumerate(fastest.index):
        of_mode = (curves["mode"] == mode).to_numpy(bool)
        x, y = curves["contact_velocity"].to_numpy(float)[of_mode], rate[of_mode]
        hz = float(curves["frequency_hz"].to_numpy(float)[of_mode][0])
        named = rank < MAX_COLOURED_FAMILIES
        style: dict[str, Any] = {"color": GREY}
        if named:
            style = {"color": COLOURS[rank], "label": f"mode {mode}, {hz:.0f} Hz"}
        axes.plot(x, y, linewidth=1.5, **style)
        zero = (curves["event"].to_numpy(str) == "C")[of_mode]
        stable = _stable(results.table("cycles"), design["point_id"], mode, x[zero])
        for is_stable, label in CYCLES.items():
            is_drawn = np.array([s is is_stable for s in stable], dtype=bool)
            if is_drawn.any():
                face = DARK if is_stable else "white"
                dots: dict[str, Any] = {"color": DARK, "markersize": 6, "markerfacecolor": face}
                if label not in axes.get_legend_handles_labels()[1]:
                    dots["label"] = label
                axes.plot(x[zero][is_drawn], y[zero][is_drawn], "o", **dots)
    axes.axhline(0.0, color="0.2", linewidth=1.0, zorder=1)
    low, high = growth_limits(rate)
    axes.set_ylim(max(low, float(np.nanmin(rate)) - 0.05 * (high - low)), high)
    shown_x = curves["contact_velocity"].to_numpy(float)[rate >= low]
    axes.set_xlim(0.0, 1.05 * float(np.nanmax(shown_x)) if len(shown_x) else None)
    finish(axes, "Largest contact velocity [m/s]", "Growth at this amplitude [1/s]")
    others = len(fastest) - MAX_COLOURED_FAMILIES
    legend_of(figure, ax, labelled(axes))
    verdict = str(design["verdict"]).replace("_", " ")
    names = parameter_columns(points, varied=True)
    design_text = describe(design, points, names, results.units)
    title = f"{design_text}: {verdict}" if design_text else verdict
    axes.set_title(title + (f"; grey: {others} others" if others > 0 else ""), fontsize=10)
    return figure
