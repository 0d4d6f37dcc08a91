"""Screen of work-precision studies: measurements, and the cheapest within tolerances."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.screen import grid, notes
from squealstudy.tables.method_quality import at_tolerances
from squealstudy.wording import figure

if TYPE_CHECKING:
    import pandas as pd

    from squealstudy.engine.result_tables import ResultTables

SHORT = {
    "frequency": "df/f",
    "damping_ratio": "d zeta",
    "unstable_frequency": "unst. df/f",
    "unstable_damping_ratio": "unst. d zeta",
    "growth_rate": "growth",
    "onset": "onset",
    "torque_mean": "mean",
    "torque_rms": "RMS",
    "dominant_frequency": "line",
    "energy_share": "shares",
}
SHOWN_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


class WorkPrecisionScreen(KindScreen):
    """Error against cost of methods."""

    tables = ("measurements", "errors")
    row_word = "measurement"
    unfinished = False

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The cheapest within each tolerance, then every measurement."""
        return [self.verdict(results), "", _fronts(results), "", *_measurements(results)]

    def verdict(self, results: ResultTables) -> str:
        """Cheapest measurement within the middle one of the tolerances that are met."""
        met = _front(results)
        if not len(met):
            return "No method meets a tolerance of 1e-01."
        row = met.iloc[len(met) // 2]
        text = f"With all errors within {row['tolerance']:.0e} '{row['cheapest']}' costs least, "
        text += f"{row['cost']:.3g} s"
        if row["default"] == row["cheapest"]:
            text += ", which is the default"
        elif row["default"]:
            text += f"; the default, '{row['default']}', {row['ratio']:.2f} times that"
        return f"{text}."


def _measurements(results: ResultTables) -> list[RenderableType]:
    quantities = results.fact("quantities")
    lines = ["onset_seconds"] if "onset" in quantities else []

    def cells(row: dict[Hashable, Any]) -> list[str]:
        bad = [f"{row[k]} {k}" for k in ("missed", "spurious") if row[k]]
        return [
            row["label"] + (" (reference)" if row["reference"] else ""),
            f"{row['seconds_median']:.3g}",
            *(f"{row[name]:.3g}" for name in lines),
            f"{row['setup_seconds']:.3g}",
            f"{row['memory_mb']:.0f}",
            figure(row["iterations"], ".2f"),
            *(_error(row[f"error_{q}"], row[f"within_{q}"]) for q in quantities),
            ", ".join([row["status"], *bad]),
        ]

    titles = ["s a point", *("s an onset" for _ in lines), "set-up s", "MB", "passes"]
    titles += [SHORT[q] for q in quantities]
    table = results.measurements
    shown = grid(
        "text:method",
        *(f"value:{title}" for title in titles),
        "text:status",
        rows=(cells(row) for row in table.to_dict("records")),
    )
    within = table[[f"within_{q}" for q in quantities]].to_numpy(bool).any()
    legend = notes(
        "*: no more than the 95 % bounds of both explain" if within else "",
        f"errors against {results.fact('reference')}, the largest of all measured points; cost "
        f"in the chart: seconds a point and 1/{results.fact('over')} of the set-up",
    )
    return [shown, legend]


def _error(value: float, within: bool) -> str:
    return f"{figure(value, '.1e')}{'*' if within and value > 0 else ' '}"


def _front(results: ResultTables) -> pd.DataFrame:
    """The tolerances that some method meets in all quantities."""
    table = at_tolerances(results.measurements, results.fact("quantities"), SHOWN_TOLERANCES)
    return table[
        ((table["quantity"] == table["quantity"].iloc[-1]) & (table["cheapest"] != "")).to_numpy()
    ]


def _fronts(results: ResultTables) -> RenderableType:
    """The cheapest measurement within each tolerance, and how far the default is from it."""
    table = _front(results)
    return grid(
        *("all within", "text:cheapest", "cost s", "text:default", "cost s", "ratio"),
        rows=(
            [
                f"{row['tolerance']:.0e}",
                str(row["cheapest"]),
                f"{row['cost']:.3g}",
                str(row["default"] or "-"),
                figure(row["default_cost"], ".3g"),
                figure(row["ratio"], ".2f"),
            ]
            for row in table.to_dict("records")
        ),
    )


SCREEN = WorkPrecisionScreen()
