"""Branches and borders of limit cycles in words."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from squealstudy.cycles.branch import CLOSED, RANGE, SHRUNK
from squealstudy.cycles.growth import FAR
from squealstudy.screen import Rows
from squealstudy.wording import amount, error_percent, plural, setting

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables

MOST_BRANCHES, MOST_EVENTS = 6, 6  # branches listed, and events told of each
SHOWN_REL_ERROR = 1e-3  # larger relative errors of the value at an event are shown
EVENTS = {"F": "folds", "H": "Hopf points"}
EVENT_WORDS = {
    "H": "Hopf point",
    "F": "fold",
    "NS": "torus bifurcation",
    "PD": "period doubling",
    "BP": "branch point",
}
BRANCH_ENDS = {
    SHRUNK: "where the cycle shrinks to steady sliding",
    RANGE: "at the end of the sweep",
    FAR: "beyond 'reach'",
}


def branch_rows(results: ResultTables) -> Rows:
    """A row for each branch: its events with their parameter values, how it ends, and its error."""
    branches, units, rows = results.table("branches"), results.units, []
    points = results.points.set_index("point_id")
    varied = [p for p in results.parameters if len(set(points[p])) > 1]
    for _, branch in branches.groupby("cycle_id", sort=False):
        along = str(branch["along"].iloc[0])
        line = points.loc[branch["point_id"].iloc[0]]
        others = [setting(p, line[p], units.get(p, "")) for p in varied if p != along]
        fixed_text = f" at {', '.join(others)}" if others else ""
        events = branch[(branch["event"] != "").to_numpy(bool)]
        event_texts = [
            f"{EVENT_WORDS.get(e['event'], e['event'])} at "
            + amount(e["value"], units.get(along, ""))
            + _uncertainty(e, units.get(along, ""))
            + (f" ({e['criticality']})" if e["criticality"] else "")
            for e in events.head(MOST_EVENTS).to_dict("records")
        ]
        more = len(events) - len(event_texts)
        text = ", ".join(event_texts) or "no event"
        ends = [str(v) for v in branch["branch_end"] if v]
        words = [BRANCH_ENDS.get(end, end.replace("_", " ")) for end in dict.fromkeys(ends)]
        ended = "comes back to its start" if CLOSED in ends else f"ends {' and '.join(words)}"
        rows.append(
            (
                "branch",
                f"along {along}{fixed_text}: {text}"
                + (f", {more} more" if more > 0 else "")
                + f"; {ended}{_levels_error(branch)}",
            )
        )
    if (n_more := len(rows) - MOST_BRANCHES) > 0:
        rows[MOST_BRANCHES:] = [("", f"{n_more} more in the branches table")]
    return rows


def _levels_error(branch: pd.DataFrame) -> str:
    """Largest error of a level on a branch, in words; rows of events are left out."""
    if "level_error" not in branch:  # results of older versions
        return "; error of its levels not known"
    errors = branch.loc[(branch["event"] == "").to_numpy(bool), "level_error"]
    if errors.isna().all():
        return "; error of its levels not known"
    unknown_count = int(errors.isna().sum())
    but = f", not known at {unknown_count} of {plural(len(errors), 'point')}" * bool(unknown_count)
    most = error_percent(errors.max())
    return f"; its levels err by {'' if most.startswith('less') else 'up to '}{most}{but}"


def _uncertainty(event: Mapping[Hashable, Any], unit: str) -> str:
    """Error of an event's value in words; empty where it is smaller than the digits shown."""
    error = event.get("value_error", 0.0)  # results of older versions have none
    if error != error:
        return " (error not known)"
    shown = error > SHOWN_REL_ERROR * abs(event["value"])
    return f" (+- {amount(error, unit, digits=2)})" if shown else ""


def border_rows(borders: pd.DataFrame) -> Rows:
    """Row on the number of borders, and how much they differ from the branches that they meet."""
    if not len(borders):
        return []
    first = borders.drop_duplicates("border_id")
    counts = {name: int((first["event"] == event).sum()) for event, name in EVENTS.items()}
    counted_curves = (plural(n, f"curve of {k}", f"curves of {k}") for k, n in counts.items() if n)
    text = " and ".join(counted_curves)
    over = f"{text} over {first['along'].iloc[0]} and {first['over'].iloc[0]}"
    largest_difference = borders["line_difference"].abs().max()
    return [
        (
            "borders",
            over
            + f"; where they meet branches they differ by {largest_difference:.1g} at most"
            * bool(largest_difference == largest_difference),
        )
    ]
