"""Screens of transient studies: one line for each design point, and the energies of modes."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.errors import ResultsError
from squealstudy.kinds.transient.answer import MOST_COLUMNS, level_error, vibrations_in_words
from squealstudy.kinds.transient.window_screen import in_words, windows
from squealstudy.screen import Rows, command_text, facts, grid, held_together, notes
from squealstudy.tables.energy_ranking import rank_energy, tells_parts, worst_point
from squealstudy.tables.mode_ranking import settings_of
from squealstudy.wording import (
    CHANGING,
    CLASS_LETTERS,
    ENERGY_RULE,
    FAILED,
    TORQUE,
    UNDECIDED,
    error_percent,
    figure,
    in_column,
    in_digits,
    moment,
    motion_frequency,
    plural,
    real_mode_number,
    small_percent,
    sufficient_step,
    with_unit,
)

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MAX_POINTS_WITHOUT_MAP = 8  # most design points that are shown without a map of letters
MOST_LONGER = 20  # largest duration that is advised, over the duration of the run
CHANCE_THAT_TELLS_NOTHING = 1.0  # an error with more relative scatter counts as unknown
MOST_POINTS = 24  # design points listed; all of them are in the tables
PILOT_WORDS = {"torque_rms": "RMS level", "growth_rate": "growth"}
LEAST_PLAIN_LEVEL = 1e-3  # N m or N; smaller levels, of runs that decay, are written as 1.2e-05
FEW_PERIODS = "fewer than five periods grow or decay exponentially"
NOTHING_MOVES = "nothing moves"
WITHOUT_GROWTH = {  # why no growth was fitted, by `growth_method`
    "too_short": FEW_PERIODS,
    "not_exponential": FEW_PERIODS,
    "not_linear": "small motion has another frequency than the mode",
}
N_FINDING_COLUMNS = 9  # columns of `_findings`


class TransientScreen(KindScreen):
    """Outcome of every design point in time, and the real modes that have the energy."""

    tables = ("points", "modes", "growth", "windows")
    added_tables = ("windows",)
    sure = ("friction", "error")

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """The modes that carry the energy (`tables.energy_ranking.rank_energy`).

        ResultsError where `by` is not "share".
        """
        if by != "share":
            raise ResultsError(
                f"{results.directory}: modes of a transient study are ranked by energy share, "
                f"not by '{by}'"
            )
        return rank_energy(results.points, results.modes, top, where)

    def listed(
        self, results: ResultTables, table: pd.DataFrame, where: str | None
    ) -> list[RenderableType]:
        """Table of the real modes that carry the energy."""
        undecided = table.attrs["undecided"]
        left_out = f"; {plural(undecided, 'undecided run')} left out" if undecided else ""
        changing = (results.points["class"] == CHANGING).to_numpy(bool)
        if not len(table) and changing.any():
            runs = "run's" if changing.sum() == 1 else "runs'"
            return [
                f"No mode is ranked of {plural(int(changing.sum()), 'changing run')}: the {runs} "
                f"speed or pressure changes, and nothing lasts{left_out}."
            ]
        if not len(table):
            failed = (results.points["class"] == FAILED).any()
            keeps_text = "is known to keep" if undecided or failed else "keeps"
            what = "Nothing within the query" if where else "No design point"
            return [f"{what} {keeps_text} vibrating{left_out}."]
        varied, energies = any(table["worst"]), tells_parts(table)
        shown = grid(
            *("mode", "Hz", "energy %", "most %", "leads at"),
            *(["word:energy in"] if energies else []),
            *(["text:loudest at"] if varied else []),
            rows=(_energy(row, varied, energies, results) for row in table.to_dict("records")),
        )
        legend = notes(
            "mode: R1 is the lowest real mode at the nominal working point, or at less friction if "
            "there is none (complex modes have other numbers)",
            "energy: its share of the mechanical energy in runs that keep vibrating, their mean; "
            f"most: the largest share; leads at: in how many runs no mode has more{left_out}",
            "loudest at: where share times RMS is largest; points are counted from 0" * varied,
        )
        return [shown, legend]

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The verdict, a map of letters, the outcome of each design point, and the ranking."""
        unit = results.units.get(TORQUE, "N m")
        parts = points(results.points, results.parameters, results.units, unit)
        if (results.points["class"] == CHANGING).any():
            failed = results.points[(results.points["status"] != "ok").to_numpy()]
            lost = points(failed, results.parameters, results.units, unit) if len(failed) else []
            parts = [*windows(results, unit), *(["", *lost] if lost else [])]
        words = results.points["class"].tolist()
        letters = (
            self.mapped(results, words, CLASS_LETTERS)
            if len(words) > MAX_POINTS_WITHOUT_MAP
            else []
        )
        if letters:
            parts = [*letters, "", *parts]
        if not (results.points["class"] == CHANGING).any():  # in such runs no vibration lasts
            parts += ["", *self.ranking(results)]
        return [self.verdict(results), "", *parts]

    def verdict(self, results: ResultTables) -> str:
        """How many runs are of each class; level, frequency and sticking of those that last."""
        table, unit = results.points, results.units.get(TORQUE, "N m")
        text = f"{plural(len(table), 'run')}: {self.counted(results, table['class'].tolist())}."
        if (table["class"] == CHANGING).any():
            single_text = "1 run, whose speed or pressure changes." if len(table) == 1 else text
            text = single_text + in_words(results, unit)
        return text + vibrations_in_words(results, unit)

    def next_steps(self, results: ResultTables) -> Rows:
        """A shorter step or longer runs where these would decide; the page; a comparison."""
        untils = _worth_waiting(results.points)
        longer = f"a duration of {_seconds(max(untils))} in [transient]" if untils else ""
        to_the_end = results.manifest.get("simulated_time") is None
        if 0 < len(untils) < len(results.points) and to_the_end:
            longer += ', and stop = "settled", which ends the other runs early'
        steps = _sufficient_steps(results.points)
        shorter = (
            f"step = {np.nanmin(steps):.2g} in [transient]" if np.isfinite(steps).any() else ""
        )
        forecasts = f"{command_text('compare', results.directory)} RESULTS_OF_COMPLEX_MODES"
        one_speed = not (results.points["class"] == CHANGING).any()
        return [
            *([("shorten the step", shorter)] if shorter else []),
            *([("decide runs", longer)] if longer else []),
            ("click through", command_text("explore", results.directory)),
            *([("with forecasts", forecasts)] if one_speed else []),
        ]

    def facts(self, results: ResultTables) -> Rows:
        """Time saved by runs that ended early, slope of friction and its error, energy balance."""
        solved = results.points[(results.points["status"] == "ok").to_numpy()]
        balance = solved["energy_balance"].abs().max()
        worst = error_percent(balance)
        text = f"energies balance to {worst} of the work of friction in the worst run"
        text = text if np.isfinite(balance) else "energy balance not known: no run reached its end"
        reasons = solved["invalid_reason"] if "invalid_reason" in solved else pd.Series("", [])
        if drifting := int(reasons.str.contains(ENERGY_RULE, regex=False).sum()):
            where = "the run" if len(solved) == 1 else f"{drifting} of {plural(len(solved), 'run')}"
            text = f"energies do not balance in {where}: the step is too long"
        manifest = results.manifest
        slope = regularisation(manifest.get("regularisation"))
        return [*_ended_early(manifest.get("simulated_time")), *slope, ("error", text)]


def points(
    table: pd.DataFrame, parameters: Sequence[str], units: Mapping[str, str], unit: str
) -> list[RenderableType]:
    """Table of each design point's outcome; `unit` is "N m" for torques, "N" for forces."""
    what = "torque" if unit == "N m" else "force"
    varied = [p for p in parameters if len(set(table[p])) > 1]
    shown_parameters = varied if len(varied) <= MOST_COLUMNS else []
    headings = [f"value:{with_unit(p, units)}" for p in shown_parameters] or (
        ["point"] if varied else []
    )
    listed = table.head(MOST_POINTS)
    transfers = bool(listed["transfer_to"].any())
    columns = ["growth 1/s", "forecast", f"{what} {unit}", "RMS", "+- %", "Hz", "most energy"]

    def cells(number: int, row: dict[Hashable, Any]) -> list[str]:
        design_cells = [in_column(row[p], units.get(p, "")) for p in shown_parameters] or (
            [str(number)] if varied else []
        )
        return [*design_cells, *_findings(row)[: N_FINDING_COLUMNS - (not transfers)]]

    shown = grid(
        *headings,
        "word:class",
        *(f"value:{title}" for title in columns),
        *(["text:transfer"] if transfers else []),
        rows=(cells(k, row) for k, row in enumerate(listed.to_dict("records"))),
    )
    legend = notes(
        f"{more} more in the points table" if (more := len(table) - len(listed)) else "",
        f"growth: fitted to the run ({_growth_marks(listed)}); forecast: of the complex mode",
        f"{what}{'' if what == 'torque' else ' of friction'}: its mean; RMS: of its fluctuation, "
        "+-: its error; Hz: of the motion (x2: loudest at twice that; ~: loudest line, where no "
        "period is known)",
        "most energy: the mode that has most, and its share; all over the end of the run",
        "transfer: which mode hands the lead to which, and when" * transfers,
    )
    parts: list[RenderableType] = [shown, legend]
    if varied and not shown_parameters:
        parts += ["", _changes(listed, varied)]
    return [*parts, *_undecided(table)]


def _growth_marks(table: pd.DataFrame) -> str:
    """Meaning of the marks of growth: of a dash the reasons of the runs that have one."""
    unfitted = table[(table["growth_rate"].isna() & (table["class"] != FAILED)).to_numpy(bool)]
    methods = unfitted.get("growth_method", ["too_short"] * len(unfitted))  # older results
    whys = dict.fromkeys(WITHOUT_GROWTH.get(m, NOTHING_MOVES) for m in methods)
    return f"~: with wide bounds{'; -: ' * bool(whys)}{' or '.join(whys)}"


def _frequency(row: Mapping[Hashable, Any] | pd.Series) -> str:
    return motion_frequency(row.get("frequency_hz", np.nan), row["torque_line_hz"])


def _undecided(table: pd.DataFrame) -> list[RenderableType]:
    """Texts on runs with too long a step, and on runs too short to decide, with the time needed."""
    undecided = table[(table["class"] == UNDECIDED).to_numpy()]
    coarse = np.isfinite(_sufficient_steps(undecided)).sum()
    n_short = len(undecided) - coarse
    texts: list[RenderableType] = []
    if coarse:
        runs = "run" if len(table) == 1 else "runs"
        verb = "is" if coarse == 1 else "are"
        texts.append(f"undecided: {coarse} of {len(table)} {runs} {verb} made with too long a step")
    if not n_short:
        return texts
    untils = _worth_waiting(table)
    is_single = n_short == 1
    runs = "run is" if n_short == len(table) == 1 else "runs are" if not is_single else "runs is"
    comes = "it comes" if is_single else "they come"
    text = f"undecided: {n_short} of {len(table)} {runs} too short to tell what {comes} to"
    if untils:
        text += f"; a duration of about {_seconds(max(untils))} would decide "
        every = "it" if is_single else "them"
        text += every if len(untils) == n_short else f"{len(untils)} of them"
    if n_left := n_short - len(untils):
        which = f"{n_left} of them" if untils else "it" if is_single else "them"
        text += f"; no duration up to {MOST_LONGER} times as long is known to decide {which}"
    return [*texts, text]


def _sufficient_steps(table: pd.DataFrame) -> np.ndarray:
    """Step [s] short enough for each run (n,); NaN where its own step was short enough."""
    reasons = table["invalid_reason"] if "invalid_reason" in table else pd.Series("", table.index)
    return np.array([sufficient_step(str(reason)) for reason in reasons], dtype=float)


def _worth_waiting(table: pd.DataFrame) -> list[float]:
    """Durations [s] that would decide undecided runs, up to MOST_LONGER times their own.

    Runs with too long a step are left out: longer ones would tell nothing either.
    """
    undecided = table[(table["class"] == UNDECIDED).to_numpy() & np.isnan(_sufficient_steps(table))]
    until = undecided["undecided_until"]
    return until[(until <= MOST_LONGER * undecided["time_reached"]).to_numpy()].tolist()


def _seconds(value: float) -> str:
    return f"{float(f'{value:.2g}'):g} s"


def _changes(table: pd.DataFrame, varied: Sequence[str]) -> RenderableType:
    """A line for each point: which parameters differ from the first point's."""
    first = table.iloc[0]
    rows = []
    for number, row in enumerate(table.to_dict("records")):
        changed = [f"{p} = {row[p]:.4g}" for p in varied if row[p] != first[p]]
        rows.append((f"point {number}", ", ".join(changed) or "first"))
    return facts(rows)


def _findings(row: dict[Hashable, Any]) -> list[str]:
    if row["class"] == FAILED:
        why = row["status"] if row["status"] != "ok" else "its energy is not finite"
        return [f"failed: {why}", *[""] * (N_FINDING_COLUMNS - 1)]
    transfer = ""
    if row["transfer_to"]:
        transfer = (
            f"{row['transfer_from']} > {row['transfer_to']} at {moment(row['transfer_time'])}"
        )
    rate = row["growth_rate"]
    wide = row["growth_rate_high"] - row["growth_rate_low"] > 0.2 * abs(rate)  # bounds 10 % away
    return [
        str(row["class"]).replace("_", " "),
        f"{'~' if wide else ''}{figure(rate)}",
        figure(row["predicted_growth_rate"]),
        figure(row["torque_mean"]),
        figure(row["torque_rms"], ".4g" if row["torque_rms"] >= LEAST_PLAIN_LEVEL else ".1e"),
        small_percent(_relative_error(row)),
        _frequency(row),
        _leader(row),
        transfer,
    ]


def _relative_error(row: Mapping[Hashable, Any]) -> float:
    """Relative error of the RMS level of a run; NaN where it is not known."""
    error = level_error(row)
    return error / row["torque_rms"] if row["torque_rms"] else float("nan")


def _leader(row: Mapping[Hashable, Any]) -> str:
    """The mode with most energy, and its share."""
    if not row["dominant_mode"]:
        return "-"
    share = figure(100 * row["dominant_share"], ".0f")
    return f"{real_mode_number(row['dominant_mode'])} {share} %"


def _energy(
    row: dict[Hashable, Any], varied: bool, energies: bool, results: ResultTables
) -> list[str]:
    where = held_together(map(" ".join, settings_of(row["worst"], results.units).items()))
    if str(row["worst"]).count("=") > MOST_COLUMNS:
        where = f"point {worst_point(row['worst'], results.points)}"
    return [
        real_mode_number(row["mode"]),
        in_digits(row["frequency_hz"]),
        f"{100 * row['energy_share']:.1f}",
        f"{100 * row['energy_share_max']:.1f}",
        str(row["dominant_points"]),
        *([str(row["main_component"])] if energies else []),
        *([where] if varied else []),
    ]


def _ended_early(saved: Mapping[str, Any] | None) -> Rows:
    """Row on the simulated time that early ends have saved; none where runs may not end early."""
    if saved is None:
        return []
    share = 100 * saved["saved_s"] / saved["asked_s"] if saved["asked_s"] else 0.0
    text = (
        f"{saved['saved_s']:.3g} of {saved['asked_s']:.3g} s not simulated ({share:.0f} %): "
        f"{saved['settled']} runs had settled, {saved['decayed']} had decayed"
    )
    return [("ended early", text)]


def regularisation(regularisation_facts: Mapping[str, Any] | None) -> Rows:
    """Rows on the speed from which slopes of friction follow, and its error; none if given."""
    if regularisation_facts is None:
        return []
    low, high = regularisation_facts["speed"], regularisation_facts["speed_highest"]
    speed = f"{low:.3g} m/s" if low == high else f"{low:.3g} to {high:.3g} m/s"
    text = f"a contact point counts as sticking below {speed}"
    if regularisation_facts["automatic"]:
        text += (
            f": {100 * regularisation_facts['share']:g} % of the slowest sliding speed of the "
            f"study, {regularisation_facts['slowest_sliding_speed']:.4g} m/s (a slower design "
            "point changes all results)"
        )
    rows = [("friction", text)]
    pilot = regularisation_facts.get("pilot")
    return rows if pilot is None else [*rows, ("  its error", _pilot(pilot))]


def _pilot(pilot: Mapping[str, Any]) -> str:
    """Result of the run at twice the slope of friction, in words."""
    errors_of = pilot.get("errors", {})
    errors = ", ".join(
        f"{word} {_error_share_text(errors_of[name])}"
        for name, word in PILOT_WORDS.items()
        if name in errors_of
    )
    if pilot["status"] in ("failed", "skipped"):
        return f"not known: {pilot['message']}"
    errors = errors or "not known, for lack of a level or growth to compare"
    text = f"{errors}, by one run at half that speed"
    return text if pilot["status"] == "ok" else f"{text}; undecided: {pilot['message']}"


def _error_share_text(error: Mapping[str, float]) -> str:
    """An error in percent; where the scatter of its runs is larger, that as its bound."""
    if error["error"] == 0.0:
        return "0 % (both runs are the same)"
    if error["error"] < error["chance"]:
        if error["chance"] >= CHANCE_THAT_TELLS_NOTHING:
            return "not known (its runs scatter too much)"
        return f"below {in_digits(100 * error['chance'], 1)} % (its runs tell no less)"
    return f"{in_digits(100 * error['error'], 1)} %"


SCREEN = TransientScreen()
