"""`squealstudy plot`: which pictures a study gets, and where they go."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from squealstudy.analysis.tables.mode_ranking import parameter_columns
from squealstudy.cli import screen
from squealstudy.cli.experiment_screen import experiment_figures
from squealstudy.cli.sensitivity_screen import sensitivity_figures
from squealstudy.cli.transient_pictures import NOT_IN_NAMES, nominal_others, transient_figures
from squealstudy.errors import ResultsError
from squealstudy.plots.evolution import evolution
from squealstudy.plots.files import save_figure
from squealstudy.plots.ranking_bars import ranking_bars
from squealstudy.plots.robust_bars import robust_bars
from squealstudy.plots.stability_diagram import stability_diagram
from squealstudy.plots.stability_map import stability_map
from squealstudy.study.design_rules import RANDOM_DESIGNS
from squealstudy.study.kinds import is_of_methods
from squealstudy.study.results import SOBOL_INDICES, Results


def plot_command(path: Path, output: Path | None, along: str | None) -> None:
    """Draw the pictures of a results directory and print their paths."""
    results = Results.open(path)
    if along is not None and along not in results.swept:
        raise ResultsError(f"'{along}' is not swept in {path}, expected {_listed(results.swept)}")
    for picture in draw_pictures(results, output or path, along):
        screen.console.print(str(picture))


def _listed(names: list[str]) -> str:
    return ", ".join(names) or "nothing"


def draw_pictures(results: Results, directory: Path, along: str | None = None) -> list[Path]:
    """Draw and save every picture that the study's design allows; their paths."""
    drawn = []
    for name, figure in _named_figures(results, along):
        path = directory / f"{name}.png"
        save_figure(figure, path)
        drawn.append(path)
    return drawn


def _named_figures(results: Results, along: str | None) -> Iterable[tuple[str, Figure]]:
    if is_of_methods(results.kind):
        return experiment_figures(results)
    if results.kind == "transient":
        return transient_figures(results, along)
    if results.kind == "sensitivity":
        return sensitivity_figures(results)
    return _figures(results, along).items()


def _figures(results: Results, along: str | None) -> dict[str, Figure]:
    points, modes, units = results.points, results.modes, results.manifest["units"]
    varied = parameter_columns(points, varied=True)
    figures = {"stability_diagram": stability_diagram(points, modes, units=units)}
    figures["ranking"] = ranking_bars(results.rank(), modes, along=results.along)
    if modes["unstable"].any() and len(points) > 1:
        worst = str(modes["point_id"].iloc[int(modes["growth_rate"].to_numpy().argmax())])
        figures["stability_diagram_worst"] = stability_diagram(points, modes, worst, units=units)
    lines = [along] if along else varied if results.manifest["grid_shape"] else []
    for parameter in lines:
        name = f"evolution_{parameter.translate(NOT_IN_NAMES)}"
        fixed = nominal_others(results, parameter, varied)
        figures[name] = evolution(points, modes, parameter, fixed, units)
    if len(varied) == 2 and set(points[varied[0]]) == set(points[varied[1]]):
        figures["evolution_together"] = _together(results, varied, units)
    if len(varied) >= 2:
        nodes, solved = results.full_points() if results.boundary else (points, None)
        for measure in ("count", "growth"):
            figures[f"stability_map_{measure}"] = stability_map(
                nodes,
                modes,
                varied[0],
                varied[1],
                units=units,
                measure=measure,
                onsets=results.onsets,
                along=results.along,
                solved=solved,
            )
    if results.design in RANDOM_DESIGNS and (points["status"] == "ok").any():
        figures["robust"] = _robust(results)
    return figures


def _robust(results: Results) -> Figure:
    """Probabilities, and the Sobol indices where the design has them and enough points solved."""
    indices = None
    if results.design == SOBOL_INDICES:
        with contextlib.suppress(ResultsError):  # `squealstudy robust` says why
            indices = results.sobol_indices()
    return robust_bars(results.robust(), indices)


def _together(results: Results, varied: list[str], units: Mapping[str, str]) -> Figure:
    """Evolution along the diagonal of two parameters that share their values."""
    first, second = varied
    points: pd.DataFrame = results.points
    points = points[points[first] == points[second]]
    modes = results.modes[results.modes["point_id"].isin(points["point_id"])]
    name = f"{first} = {second}"
    points = points.drop(columns=second).rename(columns={first: name})
    return evolution(points, modes, name, units={**units, name: units[first]})
