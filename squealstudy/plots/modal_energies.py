"""Energy of the assembly's real modes over time (Vermot des Roches et al. 2010, fig. 15, 16)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from squealstudy.colours import DARK, GREY
from squealstudy.engine.pictures import register_plot
from squealstudy.plots.over_time import (
    MS_PER_S,
    PALETTE,
    EndLabel,
    Run,
    binned,
    end_labels,
    finish_time,
    histories,
    outline,
    run_of,
)
from squealstudy.plots.style import empty_figure, figure_at, joined, whole_figure
from squealstudy.tables.energy_ranking import component_columns
from squealstudy.wording import in_digits, plural, real_mode_number

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MODE_COLUMN = re.compile(r"energy_mode_(\d+)")
MAX_COLOURED_MODES = 6  # modes in colour
N_TIME_BINS = 250  # means over time of an oscillating energy; a band shows its extremes
SHOWN_DECADES = 8  # decades that are shown below the largest energy


@register_plot(histories, points=("class",), modes=("energy_share",))
def modal_energies(results: Results, point: str | int = 0, ax: Axes | None = None) -> Figure:
    """Energy of the sensed modes over time on a logarithmic axis; the leading ones are named.

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
    >>> results.plot.modal_energies(point=0).savefig("energies.png")
    """
    run = run_of(results, point)
    mode_numbers = [int(m[1]) for m in map(MODE_COLUMN.fullmatch, map(str, run.history)) if m]
    if len(run.history) < 2 or not mode_numbers:
        return empty_figure("no modal energies of this design point", ax)
    figure = figure_at(ax, 10.5, 5.8)
    axes = figure.add_subplot()
    axes.set_yscale("log")
    leading = leading_modes(run, mode_numbers)
    for mode in (m for m in mode_numbers if m not in leading):
        axes.plot(
            *_curve(run.milliseconds, run.column(f"energy_mode_{mode}")), color=GREY, linewidth=0.6
        )
    labels = [
        _draw(axes, run, f"energy_mode_{mode}", colour, _name(run.modes, mode))
        for mode, colour in zip(leading, PALETTE, strict=False)
    ]
    labels.append(_draw(axes, run, "energy", "#000000", "all modes", "--"))
    labels.append(_draw(axes, run, "energy_outside", DARK, "outside the sensed modes", ":"))
    finish_time(axes, run, "Mechanical energy [J]")
    axes.set_xlim(*run.limits)
    axes.set_ylim(*_limits(axes, run.column("energy")))
    _mark_transfer(axes, run)
    texts = (
        joined(run.title, _transfer_text(run)),
        _note(run.modes, len(mode_numbers) - len(leading)),
    )
    figure.suptitle(joined(*texts, by="\n"), fontsize=9.5)
    end_labels(axes, [label for label in labels if label is not None])
    return whole_figure(figure)


def leading_modes(run: Run, mode_numbers: list[int]) -> list[int]:
    """Modes to name: those of a transfer, then those of the largest first or last energy share."""
    score = pd.Series(0.0, index=mode_numbers)
    if len(run.modes):
        shares = run.modes.set_index("mode")[["energy_share", "first_share"]].max(axis=1)
        score = shares.reindex(mode_numbers).fillna(0.0)
    if not score.to_numpy().any():
        score = pd.Series(
            [np.nanmax(run.column(f"energy_mode_{m}")) for m in mode_numbers], mode_numbers
        )
    transfer = [run.number(name) for name in ("transfer_from", "transfer_to")]
    involved = {int(mode) for mode in transfer if mode > 0}
    order = sorted(mode_numbers, key=lambda m: (m not in involved, -score[m], m))
    return sorted(order[:MAX_COLOURED_MODES], key=lambda m: (-score[m], m))


def _draw(
    axes: Axes, run: Run, name: str, colour: str, text: str, style: str = "-"
) -> EndLabel | None:
    """Draw mean energy as a line over a band of its extremes; its label, None if unknown."""
    time, energy = run.milliseconds, run.column(name)
    positive = np.where(energy > 0, energy, np.nan)
    if not np.isfinite(positive).any():
        return None
    if style == "-":
        axes.plot(*outline(time, positive, N_TIME_BINS), color=colour, alpha=0.22, linewidth=0.6)
    x, y = _curve(time, energy)
    axes.plot(x, y, color=colour, linewidth=1.6, linestyle=style, zorder=3)
    last = y[np.isfinite(y)]
    return EndLabel(float(last[-1]), text, colour) if len(last) else None


def _curve(time: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over parts of the time; NaN where not positive, as the axis is logarithmic."""
    x, y = binned(time, energy, N_TIME_BINS)
    return x, np.where(y > 0, y, np.nan)


def _limits(axes: Axes, energy: np.ndarray) -> tuple[float, float]:
    """Limits from the smallest energy that is named, within SHOWN_DECADES, to the largest."""
    curves = [np.asarray(line.get_ydata(), float) for line in axes.get_lines() if line.zorder == 3]
    values = np.concatenate([*curves, energy])
    values = values[np.isfinite(values) & (values > 0)]
    if not len(values):
        return 1e-12, 1.0
    high = float(values.max())
    return max(float(values.min()) / 2, high * 10.0**-SHOWN_DECADES), 2 * high


def _name(modes: pd.DataFrame, mode: int) -> str:
    """Number, frequency, main component and last energy share of a mode, in words."""
    row = modes[(modes["mode"] == mode).to_numpy()] if len(modes) else modes
    if not len(row):
        return real_mode_number(mode)
    component, share = main_components(row).iloc[0], row["energy_share"].iloc[0]
    parts = [f"{real_mode_number(mode)}  {in_digits(row['frequency_hz'].iloc[0])} Hz", component]
    parts += [f"{100 * share:.0f} %"] if np.isfinite(share) else []
    return ", ".join(part for part in parts if part)


def _note(modes: pd.DataFrame, n_others: int) -> str:
    """Text on the meaning of lines and numbers."""
    parts = ["lines: means, bands: extremes"]
    parts += (
        [f"grey: {plural(n_others, 'other mode')} that held 1 % at some time"] if n_others else []
    )
    parts += ["percent: share over the last window"] if len(modes) else []
    return "; ".join(parts)


def _mark_transfer(axes: Axes, run: Run) -> None:
    if run.number("transfer_to") > 0 and np.isfinite(time := run.number("transfer_time")):
        style: dict[str, Any] = {"color": "0.3", "linewidth": 1.0, "linestyle": (0, (4, 3))}
        axes.axvline(MS_PER_S * time, **style)


def _transfer_text(run: Run) -> str:
    """Text on the real mode that takes over the energy from another; empty without one."""
    before, after = (run.number(f"transfer_{n}") for n in ("from", "to"))
    if not after > 0:
        return ""
    time = run.number("transfer_time")
    when = f" at {run.moment(time)} (dashed)" if np.isfinite(time) else ""
    new, old = (real_mode_number(int(mode)) for mode in (after, before))
    return f"{new} takes over from {old}{when}"


def main_components(modes: pd.DataFrame) -> pd.Series:
    """The component with most elastic energy in each row of a modes table; "" where unknown."""
    names = component_columns(modes)
    has_energy = modes[names].notna().any(axis=1)
    if not has_energy.any():
        return pd.Series("", index=modes.index)
    titles = np.array([name.removeprefix("energy_") for name in names])
    main = titles[modes[names].fillna(-1.0).to_numpy(dtype=float).argmax(axis=1)]
    return pd.Series(np.where(has_energy, main, ""), index=modes.index)
