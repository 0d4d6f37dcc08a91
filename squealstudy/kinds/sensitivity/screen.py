"""Screens of sensitivity studies: the parameters that move a mode, strongest first."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.engine.kind_screen import N_RANKING_ROWS, KindScreen
from squealstudy.errors import ResultsError
from squealstudy.kinds.sensitivity.section import UNSTABLE
from squealstudy.screen import Rows, command_text, grid, notes
from squealstudy.tables.sensitivity_ranking import (
    mode_sensitivities,
    parameter_text,
    rank_sensitivities,
    step_text,
)
from squealstudy.wording import any_of, in_digits, listed, plural, setting

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MOST_NAMED = 2  # most parameters that are named as lowering growth, and as raising it
NUMBERS = ("step", "growth 1/s", "reanalysis", "off", "Hz", "damping %")


class SensitivityScreen(KindScreen):
    """Derivatives of one mode, each with the effect of a finite change."""

    tables = ("points", "sensitivities")
    sure = ("without", "error")

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """Raise ResultsError: such a study ranks parameters, not modes."""
        raise ResultsError(
            f"{results.directory}: a sensitivity study has no ranking of modes; 'squealstudy "
            "sensitivity' ranks its parameters"
        )

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The sensitivities of the mode with the largest growth."""
        return sensitivities(results)

    def next_steps(self, results: ResultTables) -> Rows:
        """The command that shows the sensitivities of another mode, if there is one."""
        table = results.sensitivities
        if not len(table):
            return []
        hz = [
            in_digits(f)
            for f in sorted(table.drop_duplicates(["point_id", "mode"])["frequency_hz"])
        ]
        modes = list(dict.fromkeys(hz))
        text = f"{command_text('sensitivity', results.directory, '--mode')} HZ"
        return [("of another mode", f"{text}: {listed(modes)}")] if len(modes) > 1 else []

    def facts(self, results: ResultTables) -> Rows:
        """How far derivatives and reanalysis agree, where no coalescence is near."""
        table = results.sensitivities
        isolated = table[~table["near_coalescence"].to_numpy(bool)]
        off = isolated["disagreement"].dropna()
        text = f"{len(table) - len(isolated)} of {len(table)} sensitivities near coalescence"
        if len(off):
            text = (
                f"change of the root to first order within {100 * off.median():.2g} % of the "
                f"reanalysis (median; 95 % of them within {100 * off.quantile(0.95):.2g} %); {text}"
            )
        without = int((results.points["n_modes"] == 0).sum())
        points = plural(without, "solved point")
        rows = [("without", f"{points}: no mode that is asked for, so no row")] if without else []
        return [*rows, ("error", text)]


def sensitivities(
    results: ResultTables, frequency_hz: float | None = None, top: int | None = N_RANKING_ROWS
) -> list[RenderableType]:
    """The sensitivities of one mode, largest first; ResultsError where there is no such mode."""
    every = results.sensitivities
    if not len(every):
        return [f"{_why_no_mode(results)}: there are no sensitivities."]
    mode = mode_sensitivities(every, frequency_hz)
    shown = rank_sensitivities(mode, top)
    has_coalescence = bool(shown["near_coalescence"].any())
    legend = notes(
        f"first {len(shown)} of {len(mode)} parameters; growth, Hz, damping: change at the step, "
        "first order; reanalysis: of the growth rate",
        "off: change of the growth rate, first order against reanalysis; they differ by the "
        "curvature over the step: a smaller step has less",
        "! near coalescence: the derivative does not hold over the step, or means nothing"
        if has_coalescence
        else "",
    )
    every_row = rank_sensitivities(mode).to_dict("records")  # by steps others may do more
    rows = (_cells(row) for row in shown.to_dict("records"))
    table = grid("text:parameter", *NUMBERS, "word:", rows=rows)
    return [_headline(results, shown.iloc[0]), _strongest_in_words(every_row), "", table, legend]


def _strongest_in_words(rows: list[dict[Hashable, Any]]) -> str:
    """Sentence on the parameters that lower and raise growth most, by reanalysis if possible."""
    changes = [
        (float(finite if np.isfinite(finite) else row["predicted_growth_change"]), row)
        for row in rows
        for finite in [row["finite_growth_change"]]
    ]
    texts = []
    for sign, verb in ((-1.0, "falls"), (1.0, "rises")):
        with_sign = [pair for pair in changes if sign * pair[0] > 0.0]
        with_sign.sort(key=lambda pair: -abs(pair[0]))
        named = [
            f"{parameter_text(row)} {step_text(row)} ({change:+.3g} 1/s)"
            for change, row in with_sign[:MOST_NAMED]
        ]
        texts += [f"{verb} most with {' and '.join(named)}"] if named else []
    return f"Its growth {'; it '.join(texts)}." if texts else ""


def _why_no_mode(results: ResultTables) -> str:
    """Why no design point has a chosen mode, in words; real roots do not count as modes."""
    solved = int((results.points["status"] == "ok").sum())
    if not solved:
        return "No design point is solved"
    choice = results.manifest.get("sensitivity", {}).get("modes", UNSTABLE)
    which = (
        "that oscillates in the band is unstable"
        if choice == UNSTABLE
        else "oscillates in the band"
    )
    return f"No mode {which} at {any_of(solved, 'solved point')}"


def _headline(results: ResultTables, first: pd.Series) -> str:
    """The mode of the table in words, and its design point."""
    points = results.points
    point = points[points["point_id"] == first["point_id"]].iloc[0]
    where = ", ".join(
        setting(name, point[name], results.units.get(name, ""), points[name].abs().max())
        for name in results.parameters
    )
    every = results.sensitivities
    at_point = every[(every["point_id"] == first["point_id"]).to_numpy(bool)]
    modes = at_point.drop_duplicates("mode")
    fastest = first["growth_rate"] == modes["growth_rate"].max()
    which = f", which grows fastest of {len(modes)}" if fastest and len(modes) > 1 else ""
    text = f"Mode at {in_digits(first['frequency_hz'], 1)} Hz{which}: growth rate "
    text += f"{in_digits(first['growth_rate'], 2)} 1/s, "
    text += f"damping {100 * first['damping_ratio']:.3f} %, eigenvalue condition "
    text += f"{first['condition']:.2f}, most energy in {first['main_component']}"
    return f"{text}\n{where}" if where else text


def _cells(row: dict[Hashable, Any]) -> list[str]:
    """Cells of a row: predicted changes of a mode beside those of the changed model."""
    predicted, finite = row["predicted_growth_change"], row["finite_growth_change"]
    off = abs(predicted - finite) / abs(finite) if finite else np.nan
    return [
        parameter_text(row),
        step_text(row),
        f"{predicted:+.4g}",
        f"{finite:+.4g}" if np.isfinite(finite) else "no solution",
        f"{100 * off:.1f} %" if np.isfinite(off) else "-",
        f"{row['predicted_frequency_change']:+.3g}",
        f"{100 * row['predicted_damping_change']:+.3g}",
        "!" if row["near_coalescence"] else "",
    ]


SCREEN = SensitivityScreen()
