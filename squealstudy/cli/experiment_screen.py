"""What `squealstudy run` prints of an experiment, and its pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table

from squealstudy.analysis.tables.fronts import at_tolerances
from squealstudy.cli.screen import console
from squealstudy.cli.screen import facts as screen_facts
from squealstudy.plots.method_stability import method_stability_map
from squealstudy.plots.work_precision import work_precision
from squealstudy.study.results import Results

SHORT = {
    "frequency": "df/f",
    "damping_ratio": "d zeta",
    "unstable_frequency": "unst. df/f",
    "unstable_damping_ratio": "unst. d zeta",
    "growth_rate": "growth",
    "onset": "onset",
    "onset_seconds": "s an onset",
    "torque_mean": "mean",
    "torque_rms": "RMS",
    "dominant_frequency": "line",
    "energy_share": "shares",
}
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def show_experiment(results: Results) -> None:
    """Measurements and fronts, or what became of a map's cells."""
    if results.kind == "method_stability":
        _cells(results)
        return
    _measurements(results)
    console.print()
    _fronts(results)


def experiment_figures(results: Results) -> Iterator[tuple[str, Figure]]:
    """Name and figure of every picture."""
    facts = results.manifest
    if results.kind == "method_stability":
        yield "method_stability", _map(results)
        return
    yield (
        "work_precision",
        work_precision(results.measurements, facts["quantities"], facts["tolerance"], facts),
    )


def _map(results: Results) -> Figure:
    facts = results.manifest
    first, second = facts["knobs"]
    return method_stability_map(
        results.cells,
        first,
        second,
        facts["units"],
        facts["title"],
        facts["boundary"],
        facts["words"],
    )


def _cells(results: Results) -> None:
    """Outcomes, how many cells are as predicted, and the cells that nothing warns of."""
    facts = results.manifest
    judged, share = facts["judged"], facts["agreement"]
    agreed = "-" if share is None else f"{100 * share:.2f} % of {judged}"
    loud = facts["unflagged_wrong"]
    screen_facts(
        [
            ("case", facts["title"]),
            ("boundary", facts["boundary"]),
            ("outcomes", ", ".join(f"{k} {n}" for k, n in facts["counts"].items())),
            ("as predicted", f"{agreed} cells that are 2 % or more away from the boundary"),
            ("wrong, unflagged", str(loud) if loud else "none"),
        ]
    )


def _measurements(results: Results) -> None:
    quantities = results.manifest["quantities"]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    grid.add_column("method", overflow="fold", min_width=24)
    lines = ["onset_seconds"] if "onset" in quantities else []
    for title in ("s a point", *lines, "set-up s", "MB", "passes", *quantities, "status"):
        grid.add_column(SHORT.get(title, title), justify="right", overflow="fold")
    for row in results.measurements.to_dict("records"):
        bad = [f"{row[k]} {k}" for k in ("missed", "spurious") if row[k]]
        grid.add_row(
            row["label"] + (" (reference)" if row["reference"] else ""),
            f"{row['seconds_median']:.3g}",
            *(f"{row[name]:.3g}" for name in lines),
            f"{row['setup_seconds']:.3g}",
            f"{row['memory_mb']:.0f}",
            "-" if np.isnan(row["iterations"]) else f"{row['iterations']:.2f}",
            *(_error(row[f"error_{q}"], row[f"within_{q}"]) for q in quantities),
            ", ".join([row["status"], *bad]),
        )
    console.print(grid)
    if results.measurements[[f"within_{q}" for q in quantities]].to_numpy(bool).any():
        console.print("*: no more than the 95 % bounds of both explain", style="dim")
    over = results.manifest["over"]
    console.print(
        f"errors against {results.manifest['reference']}, the largest of all measured points; cost "
        f"in the chart: seconds a point and 1/{over} of the set-up",
        style="dim",
    )


def _error(value: float, within: bool) -> str:
    return "-" if np.isnan(value) else f"{value:.1e}{'*' if within and value > 0 else ' '}"


def _fronts(results: Results) -> None:
    """The cheapest measurement within each tolerance, and how far the default is from it."""
    table = at_tolerances(results.measurements, results.manifest["quantities"], TOLERANCES)
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("all within", "cheapest", "cost s", "default", "cost s", "ratio"):
        grid.add_column(title, justify="left" if title in ("cheapest", "default") else "right")
    name = str(table["quantity"].iloc[-1])
    for row in table[table["quantity"] == name].to_dict("records"):
        if not row["cheapest"]:
            continue
        ratio = "-" if np.isnan(row["ratio"]) else f"{row['ratio']:.2f}"
        own = "-" if np.isnan(row["default_cost"]) else f"{row['default_cost']:.3g}"
        grid.add_row(
            f"{row['tolerance']:.0e}",
            row["cheapest"],
            f"{row['cost']:.3g}",
            row["default"] or "-",
            own,
            ratio,
        )
    console.print(grid)
