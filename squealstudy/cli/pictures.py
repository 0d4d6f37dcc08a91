"""`squealstudy plot`: which pictures a study gets, and where they go."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from squealstudy.analysis.ranking import parameter_columns
from squealstudy.cli import screen
from squealstudy.cli.transient_pictures import NOT_IN_NAMES, nominal_others, transient_figures
from squealstudy.errors import ResultsError
from squealstudy.plots.evolution import evolution
from squealstudy.plots.files import save_figure
from squealstudy.plots.ranking_bars import ranking_bars
from squealstudy.plots.stability_diagram import stability_diagram
from squealstudy.plots.stability_map import stability_map
from squealstudy.study.results import Results


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
    transient = results.kind == "transient"
    pairs = transient_figures(results, along) if transient else _figures(results, along).items()
    for name, figure in pairs:
        path = directory / f"{name}.png"
        save_figure(figure, path)
        drawn.append(path)
    return drawn


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
        for measure in ("count", "growth"):
            figures[f"stability_map_{measure}"] = stability_map(
                points, modes, varied[0], varied[1], units=units, measure=measure
            )
    return figures


def _together(results: Results, varied: list[str], units: Mapping[str, str]) -> Figure:
    """Evolution along the diagonal of two parameters that share their values."""
    first, second = varied
    points: pd.DataFrame = results.points
    points = points[points[first] == points[second]]
    modes = results.modes[results.modes["point_id"].isin(points["point_id"])]
    name = f"{first} = {second}"
    points = points.drop(columns=second).rename(columns={first: name})
    return evolution(points, modes, name, units={**units, name: units[first]})
