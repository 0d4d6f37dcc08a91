"""Harmonics of a limit cycle's friction torque."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from squealstudy.colours import COLOURS, GREY
from squealstudy.engine.pictures import Choices, register_plot
from squealstudy.errors import ResultsError
from squealstudy.plots.over_time import friction_label
from squealstudy.plots.style import finish, legend_of, one_panel
from squealstudy.plots.tables import describe
from squealstudy.tables.mode_ranking import parameter_columns

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

DISTINCT_RATIO = 1.02  # a level above the cycle's by this ratio is that of another motion
MIN_SHOWN_HARMONIC_RATIO = 1e-5  # smallest harmonic that is drawn, over the largest


def _loudest(results: Results) -> Iterator[tuple[str, Choices]]:
    """The loudest stable cycle of the study, or the loudest of all if none is stable."""
    cycles = results.table("cycles")
    stable = cycles[cycles["stable"].fillna(False).to_numpy(bool)]
    among = stable if len(stable) else cycles
    if len(among):
        loudest = int(np.nanargmax(among["torque_rms"].to_numpy(float)))
        yield "", {"cycle": among["cycle_id"].iloc[loudest]}


@register_plot(_loudest, cycles=("torque_harmonics",))
def cycle_spectrum(results: Results, cycle: str, ax: Axes | None = None) -> Figure:
    """Amplitudes of the harmonics of the torque of one limit cycle.

    Parameters
    ----------
    results : Results
        Of a study of limit cycles.
    cycle : str
        Its cycle_id.
    ax : matplotlib.axes.Axes or None
        Axes to draw in; by default those of a new figure.

    Raises
    ------
    ResultsError
        For an unknown cycle.

    Examples
    --------
    >>> import squealstudy as sq
    >>> study = sq.read_study(sq.write_example("cycles_from_onset")[0])
    >>> results = sq.run(study.with_(friction=[0.298, 0.305]))
    >>> cycle = results.table("cycles")["cycle_id"][0]
    >>> results.plot.cycle_spectrum(cycle).savefig("spectrum.png")
    """
    cycles, points = results.table("cycles"), results.points
    chosen = cycles[(cycles["cycle_id"] == cycle).to_numpy(bool)]
    if not len(chosen):
        raise ResultsError(f"no cycle '{cycle}'")
    cycle_row = chosen.iloc[0]
    level = np.asarray(cycle_row["torque_harmonics"], dtype=float)
    order = np.arange(1, len(level) + 1)
    hz = float(cycle_row["frequency_hz"])
    what, unit = friction_label(results.units)
    figure, axes = one_panel(ax, 8.0, 4.4)
    axes.bar(order, level, width=0.7, color=COLOURS[1])
    axes.set_yscale("log")
    axes.set_ylim(MIN_SHOWN_HARMONIC_RATIO * level.max(), 2.0 * level.max())
    error = float(cycle_row["level_error"]) * level.max()
    if error > MIN_SHOWN_HARMONIC_RATIO * level.max():
        label = "estimated error of the level"
        line = axes.axhline(error, color=GREY, linestyle="--", linewidth=1.2, label=label)
        legend_of(figure, ax, [line])
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0.4, len(level) + 0.6)
    finish(axes, f"Harmonic of {hz:.1f} Hz", f"{what.capitalize()} [{unit}]")
    design = points[(points["point_id"] == cycle_row["point_id"]).to_numpy(bool)].iloc[0]
    design_text = describe(design, points, parameter_columns(points, varied=True), results.units)
    how = {True: "stable", False: "unstable"}.get(cycle_row["stable"], "stability not known")
    title = f"{design_text}: {how} cycle" if design_text else f"{how.capitalize()} cycle"
    title = f"{title}, RMS {cycle_row['torque_rms']:.4g} {unit}"
    if design.get("torque_rms", np.nan) > DISTINCT_RATIO * cycle_row["torque_rms"]:
        title += f"; louder motion lasts there, {design['torque_rms']:.4g} {unit}"
    axes.set_title(title, fontsize=10)
    return figure
