"""Screen of a design study: the verdict, squeal and its causes, the change, its proof."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.engine.kind_screen import N_RANKING_ROWS, KindScreen
from squealstudy.errors import ResultsError
from squealstudy.models.operating import DAMPING
from squealstudy.screen import Rows, grid, notes
from squealstudy.wording import error_percent, figure, in_digits, plural

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

# more frequencies are grouped by rounded logarithms, since all pairs of them are stored
MAX_EXACT_GROUPING, LOG_FREQUENCY_ROUNDING = 2000, 1e-3
SAME_MODE = 0.05  # largest relative difference of frequencies of the same mode
PER_RANGE, CHANGE_SEPARATOR = 3, "; "  # most variables that are named, and the text between them
SMALLEST_POSITIVE = 1e-300
CHECK_WORDS = {"matrix": "operating points", "refined": "points between", "in_time": "runs in time"}


class DesignScreen(KindScreen):
    """Screen that begins with the verdict."""

    tables = ("points", "designs", "margins", "slopes", "proof", "variants")
    sure = ("one basis", "error")

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """The modes of today's design, those that squeal most first; there is no other order."""
        if where is not None:
            raise ResultsError(f"{results.directory}: a design study has no part to rank")
        return squealing_modes(results).head(top if top is not None else len(results.points))

    def listed(
        self, results: ResultTables, table: pd.DataFrame, where: str | None
    ) -> list[RenderableType]:
        """The modes of today's design."""
        return _modes(table)

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """Verdict, modes of today's design, designs that meet the margin, checks."""
        facts = results.fact("design_study")
        modes = squealing_modes(results)
        findings: list[RenderableType] = [facts["verdict"]]
        if len(variants := results.table("variants")):
            findings = [facts["choice"], "", f"As in the file: {facts['verdict']}", ""]
            findings += _variants(variants)
        findings += ["", *_modes(modes.head(N_RANKING_ROWS))] if len(modes) else []
        return [*findings, *_checks(results)]

    def next_steps(self, results: ResultTables) -> Rows:
        """Checks of the proof that were not asked for, with the key that asks for them."""
        checks = set(results.table("proof")["check"])
        rows = []
        if "in_time" in checks and "limit_cycles" not in checks:  # such a model is small enough
            rows.append(("limit cycles", "cycles = 4 in [goal] looks for them at 4 points"))
        if checks and "full_order" not in checks and results.fact("design_study")["n_reductions"]:
            rows.append(
                ("full order", "full_order = 2 in [goal] solves 2 points without reduction")
            )
        return rows

    def facts(self, results: ResultTables) -> Rows:
        """How many designs were evaluated, and the errors of the modes."""
        facts, margins = results.fact("design_study"), results.table("margins")
        error = margins["damping_error"].max()
        text = plural(facts["n_designs"], "design")
        text += f" in {plural(facts['rounds'], 'round')}" if facts["rounds"] else ""
        if facts["n_reductions"]:
            text += f", {plural(facts['n_structures'], 'structure')}"
            text += f" by {plural(facts['n_reductions'], 'reduction')}"
        rows = [("search", text)]
        if (shared := results.manifest.get("shared_basis", {})).get("used"):
            error_text = error_percent(shared["error"])
            text = f"made for {shared['range']}; eigenvalues to {error_text} where it was tested"
            rows.append(("one basis", text))
        if error == error:
            text = f"the solver errs by {error_percent(error)} of critical damping"
            text = text if error < 1.0 else "damping of some modes is not known: the solver's error"
            rows.append(("error", text + _of_reduction(results)))
        return rows


def _of_reduction(results: ResultTables) -> str:
    """Text on the difference of least damping ratios between the reduced model and full order."""
    if not results.fact("design_study")["n_reductions"]:
        return ""
    points, by = results.points, [*results.parameters, "design"]
    solved = points[(points["status"] == "ok").to_numpy(bool)]
    full, reduced = (
        solved[solved["analysis"].isin(analyses)][[*by, "min_damping_ratio"]].dropna()
        for analyses in (["full_order"], ["modes", "roots"])
    )
    both = full.merge(reduced.drop_duplicates(by), on=by, suffixes=("", "_reduced"))
    if not len(both):
        return "; the reduced model was not held against full order"
    largest_difference = (both["min_damping_ratio"] - both["min_damping_ratio_reduced"]).abs().max()
    where = plural(len(both), "point")
    return f"; the reduction by {error_percent(largest_difference)}, against full order at {where}"


def today_rows(results: ResultTables) -> pd.DataFrame:
    """Points of today's design over the matrix of operation."""
    facts, points = results.fact("design_study"), results.points
    is_today = (points["design"] == facts["today"]) & (points["analysis"] == "modes")
    return points[is_today.to_numpy(bool)].iloc[: facts["n_operating_points"]]


def squealing_modes(results: ResultTables) -> pd.DataFrame:
    """Modes of today's design below the margin, over the matrix of operation.

    Modes of one component count as one where no two of them are more than 5 % apart in frequency
    (complete linkage, the nearest joined first).

    Returns
    -------
    DataFrame
        ``name``, ``frequency_low_hz``, ``frequency_high_hz``, ``n_points`` below the margin,
        ``n_unstable``, ``share`` of the operation that was solved, by occurrence,
        ``min_damping_ratio``, ``max_growth_rate``, ``point_id`` of the least damping, the pair of
        real modes with the largest shares in the mode and that share, ``damping_without_friction``,
        ``changes``: the first-order effects of the variables on the damping ratio there over their
        whole ranges, the three largest; ``growth_by_damping``, 1/s: slope there by the uniform
        damping ratio, which destabilises if it is above zero.
    """
    facts = results.fact("design_study")
    today = today_rows(results)
    margins = results.table("margins")
    mode_margins = margins[margins["point_id"].isin(today["point_id"])]
    mode_margins = mode_margins[(mode_margins["damping_ratio"] < facts["margin"]).to_numpy(bool)]
    if not len(mode_margins):
        return pd.DataFrame(columns=list(COLUMNS))
    solved = today.set_index("point_id")["occurrence"]
    solved = solved[(today["status"] == "ok").to_numpy(bool)]
    slopes = results.table("slopes")
    parts = (part for _, part in mode_margins.groupby("main_component"))
    rows = [
        _mode(group, solved, slopes, facts)
        for part in parts
        for _, group in part.groupby(same_modes(part["frequency_hz"].to_numpy(float)))
    ]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    order = ["n_unstable", "n_points", "max_growth_rate"]
    ordered: pd.DataFrame = table.sort_values(order, ascending=False, kind="stable")
    return ordered.reset_index(drop=True)


def same_modes(hz: np.ndarray) -> np.ndarray:
    """Number (n,) of each frequency's group; no two of a group are more than 5 % apart."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(hz) < 2:
        return np.ones(len(hz), dtype=int)
    values, max_gap = np.log(hz), np.log1p(SAME_MODE)
    if len(hz) <= MAX_EXACT_GROUPING:
        group_numbers: np.ndarray = fcluster(
            linkage(values[:, None], "complete"), max_gap, "distance"
        )
        return group_numbers
    rounded, group = np.unique(np.round(values / LOG_FREQUENCY_ROUNDING), return_inverse=True)
    if len(rounded) < 2:
        return np.ones(len(hz), dtype=int)
    tree = linkage(LOG_FREQUENCY_ROUNDING * rounded[:, None], "complete")
    of_rounded: np.ndarray = fcluster(tree, max_gap - LOG_FREQUENCY_ROUNDING, "distance")[group]
    return of_rounded


COLUMNS = (
    "name",
    "frequency_low_hz",
    "frequency_high_hz",
    "n_points",
    "n_unstable",
    "share",
    "min_damping_ratio",
    "max_growth_rate",
    "point_id",
    "mode",
    "pair_first_hz",
    "pair_second_hz",
    "pair_share",
    "damping_without_friction",
    "changes",
    "growth_by_damping",
)


def _mode(
    group: pd.DataFrame, solved: pd.Series, slopes: pd.DataFrame, facts: dict[str, Any]
) -> dict[str, Any]:
    """Row of one mode over operating points: range, growth, and most effective variables."""
    worst = group.iloc[int(group["damping_ratio"].to_numpy(float).argmin())]
    unstable = group.loc[(group["growth_rate"] > 0).to_numpy(bool), "point_id"].unique()
    mode_slopes = slopes[
        (slopes["point_id"] == worst["point_id"]) & (slopes["mode"] == worst["mode"])
    ]
    by = dict(zip(mode_slopes["parameter"], mode_slopes["d_damping_ratio"], strict=True))
    growth = dict(zip(mode_slopes["parameter"], mode_slopes["d_growth_rate"], strict=True))
    ranges = facts["ranges"]
    effects = [(abs(by[n] * r), n, by[n] * r) for n, r in ranges.items() if n in by]
    effects.sort(reverse=True)
    low, high = group["frequency_hz"].min(), group["frequency_hz"].max()
    return {
        "name": f"{worst['main_component']} {(low + high) / 2:.4g} Hz",
        "frequency_low_hz": low,
        "frequency_high_hz": high,
        "n_points": group["point_id"].nunique(),
        "n_unstable": len(unstable),
        "share": float(solved[unstable].sum() / max(solved.sum(), SMALLEST_POSITIVE)),
        "max_growth_rate": group["growth_rate"].max(),
        **{name: worst[name] for name in ("point_id", "mode", "pair_first_hz", "pair_second_hz")},
        "min_damping_ratio": worst["damping_ratio"],
        "pair_share": worst["pair_share"],
        "damping_without_friction": worst["damping_without_friction"],
        "changes": CHANGE_SEPARATOR.join(
            f"{n} {effect:+.3g}" for _, n, effect in effects[:PER_RANGE]
        ),
        "growth_by_damping": growth.get(DAMPING.name, np.nan),
    }


def _by_damping(table: pd.DataFrame) -> str:
    """Whether more damping of the whole brake destabilises; empty where that is not known."""
    with_slope = table[table["growth_by_damping"].notna().to_numpy(bool)]
    if not len(with_slope):
        return ""
    raised = with_slope.loc[(with_slope["growth_by_damping"] > 0).to_numpy(bool), "name"].tolist()
    of = "" if len(with_slope) == len(table) else f" of the {len(with_slope)} whose slope is known"
    names = ", ".join(raised) if raised else f"no mode{of}"
    text = f"a larger damping_ratio would raise the growth of {names}"
    return f"{text} (slope at each one's worst point)"


def _modes(table: pd.DataFrame) -> list[RenderableType]:
    """Table on screen of today's unstable or least damped modes."""
    titles = ("Hz", "points", "unstable %", "growth 1/s", "damping %", "pair Hz")
    rows = table.to_dict("records")
    shown = grid(
        "text:mode",
        *(f"value:{t}" for t in titles),
        rows=(
            [
                str(r["name"]),
                _span(r["frequency_low_hz"], r["frequency_high_hz"]),
                str(r["n_points"]),
                f"{100 * r['share']:.3g}",
                figure(r["max_growth_rate"]),
                f"{100 * r['min_damping_ratio']:.3g}",
                f"{in_digits(r['pair_first_hz'], 1)}, {in_digits(r['pair_second_hz'], 1)}",
            ]
            for r in rows
        ),
    )
    effects = [
        [str(r["name"]), *_in_percent(change)]
        for r in rows
        for change in str(r["changes"]).split(CHANGE_SEPARATOR)
        if change
    ]
    slopes = grid("text:mode", "text:variable", "value:damping %", rows=effects)
    legend = notes(
        "modes of today's design with less damping than the margin; those of one component within "
        "5 % in frequency count as one",
        "points: operating points at which it has less; unstable: share of operation in which it "
        "grows; pair: the two modes without friction that it is made of",
        _by_damping(table),
    )
    more = notes(
        "damping %: what moving a variable over its whole range adds to it at the mode's worst "
        "point, by its slope there: near a lock-in the true effect differs; the largest of each"
    )
    return [shown, legend, "", slopes, more] if effects else [shown, legend]


def _in_percent(change: str) -> tuple[str, str]:
    """A variable, and its effect on the damping ratio in percent of critical damping."""
    variable, effect = change.rsplit(" ", 1)
    return variable, f"{100 * float(effect):+.3g}"


def _variants(table: pd.DataFrame) -> list[RenderableType]:
    """Table on screen of the alternatives of a design study."""
    titles = ("unstable", "damping %", "cost", "damping % then", "Hz")
    own_models = len(set(table["model"])) > 1
    shown = grid(
        "text:variant",
        *(["text:model"] if own_models else []),
        "word:outcome",
        *(f"value:{t}" for t in titles),
        "text:change",
        rows=(
            [
                str(r["variant"]),
                *([str(r["model"])] if own_models else []),
                str(r["outcome"]).replace("_", " "),
                _share_text(r["n_unstable"], r["n_operating_points"]),
                _number(100 * r["today_damping_ratio"], ".3g"),
                _number(r["cost"], ".4g"),
                _number(100 * r["min_damping_ratio"], ".3g"),
                _number(r["frequency_hz"], ".5g"),
                str(r["change"]) or "none",
            ]
            for r in table.to_dict("records")
        ),
    )
    legend = notes(
        "unstable, damping: operating points with an unstable mode and least damping ratio, before "
        "any change; cost, damping then, Hz: with the change, that of the variant included; each "
        "has results of its own in variants/NAME"
    )
    return [shown, legend]


def _share_text(part: Any, whole: Any) -> str:
    return "" if pd.isna(whole) else f"{int(part)} of {int(whole)}"


def _number(value: float, form: str) -> str:
    return "" if pd.isna(value) else f"{value:{form}}"


def _span(low: float, high: float) -> str:
    text = in_digits(low, 1)
    return text if high - low < 0.05 else f"{text} to {in_digits(high, 1)}"


def _checks(results: ResultTables) -> list[RenderableType]:
    """Table on screen of the checks that designs had to pass."""
    proof, designs = results.table("proof"), results.table("designs")
    if not len(proof):
        return []
    cost_of = dict(zip(designs["design"], designs["cost"], strict=True))
    shown = grid(
        "value:round",
        "value:design",
        "value:cost",
        "text:check",
        "word:",
        "text:found",
        rows=(
            [
                str(r["round"]),
                str(r["design"]),
                _number(cost_of.get(r["design"], np.nan), ".4g"),
                CHECK_WORDS.get(str(r["check"]), str(r["check"]).replace("_", " ")),
                "undecided" if pd.isna(r["passed"]) else ("passed" if r["passed"] else "FAILED"),
                str(r["text"]),
            ]
            for r in proof.to_dict("records")
        ),
    )
    passes = proof.groupby("round")["passed"].apply(lambda column: column.eq(True).all())
    went_on = notes(
        "design: its number in the designs table; after a round in which all checks passed, a "
        "cheaper design is tried"
    )
    return ["", shown, *([went_on] if passes.iloc[:-1].any() else [])]


SCREEN = DesignScreen()
