"""Which pictures a transient study gets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from matplotlib.figure import Figure

from squealstudy.analysis.tables.energy_ranking import transient_parameters
from squealstudy.plots.growth_comparison import growth_comparison
from squealstudy.plots.level_sweep import level_sweep, sweep_line
from squealstudy.plots.modal_energies import modal_energies
from squealstudy.plots.over_time import design_text
from squealstudy.plots.spectrogram import spectrogram
from squealstudy.plots.torque_history import torque_history
from squealstudy.study.results import Results
from squealstudy.study.transient.histories import kept_histories

NOT_IN_NAMES = str.maketrans(dict.fromkeys(".[],- ", "_"))
MOST_HISTORIES = 16  # design points whose histories are drawn; `plots` draws any other


def transient_figures(results: Results, along: str | None) -> Iterator[tuple[str, Figure]]:
    """Names and figures, made one by one: growth, levels over what varies, histories."""
    points, modes, growth = results.points, results.modes, results.growth
    units, varied = results.manifest["units"], transient_parameters(points, varied=True)
    yield "growth_comparison", growth_comparison(growth, points)
    if len(points) > 1 and len(varied) > 1:
        yield "levels", level_sweep(points, modes, units=units)
    for name in [along] if along else varied:
        fixed = nominal_others(results, name, varied)
        if len(sweep_line(points, name, fixed)) > 1:
            figure = level_sweep(points, modes, name, fixed, units)
            yield f"levels_{name.translate(NOT_IN_NAMES)}", figure
    yield from _over_time(results)


def _over_time(results: Results) -> Iterator[tuple[str, Figure]]:
    """Torque, energies and spectrogram of the first design points that kept a history."""
    units, top = results.manifest["units"], results.manifest["band_hz"][1]
    kept = kept_histories(results.directory)
    points, modes, growth = results.points, results.modes, results.growth
    shown = points[points["point_id"].isin(kept)].head(MOST_HISTORIES)
    numbers = np.flatnonzero(points["point_id"].isin(shown["point_id"])) + 1
    for number, (_, row) in zip(numbers, shown.iterrows(), strict=True):
        history, title = results.history(row["point_id"]), design_text(points, row, units)
        yield f"torque_history_{number}", torque_history(history, row, growth, title, units)
        yield f"modal_energies_{number}", modal_energies(history, modes, row, title)
        yield f"spectrogram_{number}", spectrogram(history, growth, row, top, title, units)


def nominal_others(results: Results, along: str, varied: list[str]) -> Mapping[str, float]:
    """The other swept parameters at their nominal values, where the design has them."""
    nominal = results.manifest["nominal"]
    fixed: dict[str, float] = {}
    chosen = results.points
    for name in varied:
        if name == along:
            continue
        there = chosen[np.isclose(chosen[name], nominal[name], rtol=1e-6, atol=0.0)]
        if len(there):
            fixed[name], chosen = nominal[name], there
    return fixed
