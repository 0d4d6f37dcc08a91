"""Screens of work-precision studies: measurements, and the cheapest within tolerances."""

from __future__ import annotations

from collections.abc import Callable, Container, Hashable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.screen import grid, notes
from squealstudy.tables.method_quality import at_tolerances, usable
from squealstudy.wording import all_of, figure, listed, plural

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
WORDS = {
    "frequency": "frequency",
    "damping_ratio": "damping ratio",
    "unstable_frequency": "frequency of unstable modes",
    "unstable_damping_ratio": "damping ratio of unstable modes",
    "growth_rate": "growth",
    "onset": "onset",
    "torque_mean": "mean",
    "torque_rms": "RMS",
    "dominant_frequency": "loudest line",
    "energy_share": "energy shares",
}
MOST_NAMED = 3  # methods that are as cheap
MOST_ROWS = 24  # measurements listed; where there are more, one of each method is
SHOWN_TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


class WorkPrecisionScreen(KindScreen):
    """Error against cost of methods."""

    tables = ("measurements", "errors")
    row_word = "measurement"
    unfinished = False

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The cheapest within each tolerance, then all measurements or one of each method."""
        return [self.verdict(results), "", _fronts(results), "", *_measurements(results)]

    def verdict(self, results: ResultTables) -> str:
        """Cheapest measurement within the tolerance of the study, and how sure its errors are."""
        quantities, tolerance = results.fact("quantities"), results.fact("tolerance")
        measured = results.measurements
        row = at_tolerances(measured, quantities, (tolerance,)).iloc[-1]
        others = usable(measured) & ~measured["reference"].to_numpy(bool)
        judged = [q for q in quantities if measured.loc[others, f"error_{q}"].notna().any()]
        judged_by = all_of([WORDS[q] for q in judged or quantities])
        measurements = f"{plural(int(others.sum()), 'measurement')} against "
        measurements += f"'{results.fact('reference')}'"
        if not others.any():
            why = "in each a point failed, or an unstable mode is missed or spurious"
            return f"No measurement counts: {why}."
        if not judged:
            return f"No error in {judged_by} is known of {measurements}."
        if not row["cheapest"]:
            exact = _most_exact(measured, quantities)
            return f"None of {measurements} is within {tolerance:g} in {judged_by}{exact}."
        text = (
            f"Of {measurements} the cheapest within {tolerance:g} in {judged_by} is "
            f"'{row['cheapest']}': {row['cost']:.3g} s "
            f"{'an onset' if 'onset' in quantities else 'a design point'}"
        )
        chosen = measured[(measured["label"] == row["cheapest"]).to_numpy(bool)].iloc[0]
        text += f", {chosen['n_coordinates']} coordinates" if _sizes_differ(measured) else ""
        if row["default"] == row["cheapest"]:
            text += ", by the default method"
        elif row["default"]:
            text += f"; the default method takes {row['ratio']:.2f} times that ('{row['default']}')"
        elif measured["default"].any():
            text += "; no setting of the default method is within it"
        text += f". The largest error of the cheapest is {_number(row['error'])}"
        high = max(float(chosen[f"high_{q}"]) for q in quantities if f"high_{q}" in measured)
        if high > max(row["error"], tolerance):
            text += f", but the bounds (95 %) of both results allow up to {high:.1e}"
        text = f"{text}.{_dearer_outside(measured, quantities, tolerance, chosen)}"
        return text + _as_cheap(measured, quantities, tolerance, chosen)


def _sizes_differ(measurements: pd.DataFrame) -> bool:
    return len(set(measurements["n_coordinates"])) > 1


def _dearer_outside(
    measurements: pd.DataFrame, quantities: Sequence[str], tolerance: float, chosen: pd.Series
) -> str:
    """A sentence on dearer settings of the cheapest method that are not within; empty for none.

    Where more of the same method is worse, the cheapest may be within it by chance.
    """
    dearer = (measurements["method"] == chosen["method"]) & (measurements["cost"] > chosen["cost"])
    outside = dearer & ~(_largest_errors(measurements, quantities) <= tolerance)
    labels = [f"'{label}'" for label in measurements.loc[outside.to_numpy(bool), "label"]]
    if not labels:
        return ""
    verbs = ("costs", "is") if len(labels) == 1 else ("cost", "are")
    names = listed(labels, MOST_NAMED)
    return f" Of the same method {names} {verbs[0]} more and {verbs[1]} not within it."


def _as_cheap(
    measurements: pd.DataFrame, quantities: Sequence[str], tolerance: float, chosen: pd.Series
) -> str:
    """A sentence on other methods whose times are not told apart from the cheapest one's.

    Their times of several rounds overlap. Empty for none, and for onsets, which have one time.
    """
    if "onset" in quantities:
        return ""
    others = (measurements["method"] != chosen["method"]) & ~measurements["reference"]
    others &= _largest_errors(measurements, quantities) <= tolerance
    rows = measurements[others.to_numpy(bool)]
    least = rows["cost"] - rows["seconds_median"] + rows["seconds_min"]
    most = chosen["cost"] - chosen["seconds_median"] + chosen["seconds_max"]
    rows = rows[(least <= most).to_numpy(bool)].sort_values("cost", kind="stable")
    labels = [f"'{label}'" for label in rows.drop_duplicates("method")["label"]]
    if not labels:
        return ""
    return f" As cheap within the scatter of times: {listed(labels, MOST_NAMED)}."


def _largest_errors(measurements: pd.DataFrame, quantities: Sequence[str]) -> np.ndarray:
    """Largest error (n,) of each measurement; infinite where it does not count."""
    names = [f"error_{q}" for q in quantities]
    errors = measurements[[n for n in names if measurements[n].notna().any()]].to_numpy(float)
    largest = errors.max(axis=1, initial=0.0)
    return np.where(usable(measurements) & np.isfinite(largest), largest, np.inf)


def _most_exact(measurements: pd.DataFrame, quantities: Sequence[str]) -> str:
    """The measurement with the least error, in words; empty where none counts."""
    candidates = measurements[~measurements["reference"].to_numpy(bool)]
    errors = _largest_errors(candidates, quantities)
    if not np.isfinite(errors).any():
        return ""
    least = int(errors.argmin())
    return f"; the most exact is '{candidates['label'].iloc[least]}', with {errors[least]:.1e}"


def _one_of_each_method(results: ResultTables) -> pd.DataFrame:
    """All measurements; if they are many, the reference and one of each method.

    That is the cheapest within the tolerance of the study, or the most exact if none is within it.
    """
    table = results.measurements
    if len(table) <= MOST_ROWS:
        return table
    errors = _largest_errors(table, results.fact("quantities"))
    order = np.where(errors <= results.fact("tolerance"), 0.0, errors)
    ranked = table.assign(_error=order).sort_values(["_error", "cost"], kind="stable")
    first_of_method = ranked[~ranked["reference"].to_numpy(bool)].drop_duplicates("method")
    rows = table["reference"].to_numpy(bool) | table.index.isin(first_of_method.index)
    return table[rows]


def _measurements(results: ResultTables) -> list[RenderableType]:
    """Table on screen of the best measurement of each method."""
    without, table = _without(results), _one_of_each_method(results)
    columns = _columns(results, without)
    rows = table.to_dict("records")
    status = [", ".join([r["status"], *_miscounts(r)]) for r in rows]
    is_told = set(status) != {"ok"}
    before = [None, *(r["method"] for r in rows[:-1])]
    names = [
        f"... {r['label'].removeprefix(r['method'] + ', ')}"
        if r["method"] == method
        else r["label"] + (" (reference)" if r["reference"] else "")
        for r, method in zip(rows, before, strict=True)
    ]
    shown = grid(
        "text:method",
        *(f"value:{title}" for title, _ in columns),
        *["text:status"] * is_told,
        rows=(
            [name, *(text(row) for _, text in columns), *[word] * is_told]
            for name, row, word in zip(names, rows, status, strict=True)
        ),
    )
    return [shown, _legend(results, table, [title for title, _ in columns], bool(without))]


Row = dict[Hashable, Any]


def _miscounts(row: Row) -> list[str]:
    return [f"{row[k]} {k}" for k in ("missed", "spurious") if row[k]]


def _columns(
    results: ResultTables, without: Container[tuple[str, str]]
) -> list[tuple[str, Callable[[Row], str]]]:
    """Titles of the columns with numbers, each with the text of a measurement."""
    quantities, table = results.fact("quantities"), results.measurements

    def error(quantity: str, row: Row) -> str:
        if (row["label"], quantity) in without:
            return "none "
        return _error(row[f"error_{quantity}"], row[f"within_{quantity}"])

    has_size, is_of_onsets = _sizes_differ(table), "onset" in quantities
    has_setup = bool((table["setup_seconds"] > 0).any())
    cost, spent = ("cost_onset", "onset_seconds") if is_of_onsets else ("cost", "seconds_median")
    has_shares = bool((table[cost] > 1.005 * table[spent]).any())
    has_passes = bool(table["iterations"].notna().any())
    columns: list[tuple[bool, str, Callable[[Row], str]]] = [
        (has_size, "size", lambda r: str(r["n_coordinates"])),
        (True, "s a point", lambda r: f"{r['seconds_median']:.3g}"),
        (is_of_onsets, "s an onset", lambda r: f"{r['onset_seconds']:.3g}"),
        (has_setup, "set-up s", lambda r: f"{r['setup_seconds']:.3g}"),
        (has_shares, "cost s", lambda r: f"{r[cost]:.3g}"),
        (has_passes, "passes", lambda r: figure(r["iterations"], ".2f")),
        *((True, SHORT[q], partial(error, q)) for q in quantities),
    ]
    return [(title, text) for is_shown, title, text in columns if is_shown]


def _legend(
    results: ResultTables, table: pd.DataFrame, titles: Sequence[str], is_without: bool
) -> RenderableType:
    """What the titles and marks of the table mean."""
    quantities, n_points = results.fact("quantities"), results.table("errors")["point"].nunique()
    left_out = len(results.measurements) - len(table)
    within = table[[f"within_{q}" for q in quantities]].to_numpy(bool).any()
    abbreviations = [f"{SHORT[q]}: {WORDS[q]}" for q in quantities if SHORT[q] != WORDS[q]]
    if "passes" in titles:
        abbreviations.append("passes: evaluations of contact forces a step")
    return notes(
        "...: the method of the line above; " * bool(table["method"].duplicated().any())
        + "size: coordinates of the model; " * ("size" in titles)
        + "s a point: of the processor, for a design point"
        + "; set-up s: for what points share" * ("set-up s" in titles),
        "; ".join(abbreviations),
        "*: no more than the 95 % bounds of both explain" if within else "",
        "none: at some point the reference has such a value, or mode, and the method has not"
        if is_without
        else "",
        f"errors against {results.fact('reference')}, the largest of "
        f"{plural(n_points, 'measured point')}{_at_fewer(results, n_points)}"
        f"{_cost_in_words(results)}",
        f"of each method the cheapest within {results.fact('tolerance'):g}, or the most exact; "
        f"{left_out} more in the measurements table"
        if left_out
        else "",
    )


def _without(results: ResultTables) -> set[tuple[str, str]]:
    """Labels and quantities of measurements without a value that the reference has."""
    errors = results.table("errors")
    lost = errors[(errors["value"].isna() & errors["truth"].notna()).to_numpy(bool)]
    return set(zip(lost["label"], lost["quantity"], strict=True))


def _at_fewer(results: ResultTables, n_points: int) -> str:
    """Text on quantities that the reference has at some of the points; empty for none."""
    errors = results.table("errors")
    with_value = errors.groupby("quantity")["point"].nunique().to_dict()
    counts = ((WORDS[q], with_value.get(q, 0)) for q in results.fact("quantities"))
    texts = [f"{word} at {n} of them" for word, n in counts if n < n_points]
    return f" ({', '.join(texts)})" if texts else ""


def _cost_in_words(results: ResultTables) -> str:
    """What the cost of a measurement consists of; empty where it is the time of a point alone."""
    table, over = results.measurements, results.fact("over")
    rest = table["cost"] - table["seconds_median"] - table["setup_seconds"] / max(over, 1)
    has_reduction = (rest > 1e-6 * table["cost"]).any()
    if not (has_reduction or (table["setup_seconds"] > 0).any()):
        return ""
    shared = f"1/{over} of the set-up{' and the reduction' * bool(has_reduction)}"
    if "onset" in results.fact("quantities"):
        return f"; cost: seconds an onset, and for each point of its line {shared}"
    return f"; cost: seconds a point and {shared}"


def _error(value: float, within: bool) -> str:
    return f"{_number(value)}{'*' if within and value > 0 else ' '}"


def _number(value: float) -> str:
    """An error in two digits; zero as "0"."""
    return figure(value, ".1e") if value else "0"


def _front(results: ResultTables) -> pd.DataFrame:
    """Rows of the tolerances that some method meets in all quantities."""
    table = at_tolerances(results.measurements, results.fact("quantities"), SHOWN_TOLERANCES)
    return table[
        ((table["quantity"] == table["quantity"].iloc[-1]) & (table["cheapest"] != "")).to_numpy()
    ]


def _fronts(results: ResultTables) -> RenderableType:
    """Table of the cheapest measurement within each tolerance, beside the default method's."""
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
