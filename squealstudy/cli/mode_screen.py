"""What commands print of complex modes: ranking, points outside validity."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any, NamedTuple

import pandas as pd
from rich.table import Table

from squealstudy.analysis.tables.crossings import BELOW_RANGE, BRACKETED, CROSSING, FIRST_SEEN
from squealstudy.analysis.tables.digits import in_digits
from squealstudy.analysis.tables.mode_ranking import UNTRACKED, frequency_text, group_kind
from squealstudy.analysis.tables.validity import validity_counts
from squealstudy.cli.screen import NARROW, broken_rules, console
from squealstudy.study.results import Results

ONSETS = {
    CROSSING: "~ before an onset: interpolated between two design points, not refined",
    FIRST_SEEN: "<= before an onset: the mode is already unstable at the least value where its "
    "track was found",
    BRACKETED: "<= before an onset: between an undamped point and this one, not refined",
    BELOW_RANGE: "below range: unstable at the first value of a line",
}
SIDES = (("unstable_", "_low"), ("unstable_", "_high"), ("", ""))
WIDE = 30  # least width of the column of energies


class Scope(NamedTuple):
    """What a ranking is over.

    Attributes
    ----------
    counted, failed : int
        Design points that count, of a boundary design nodes of its map; design points that failed.
    mapped, queried : bool
        They are nodes of a map; a query chose them.
    uncertain : int
        Design points that count at which the error of a mode exceeds its growth or decay.
    """

    counted: int
    failed: int
    mapped: bool
    queried: bool
    uncertain: int = 0

    @classmethod
    def of(cls, results: Results, where: str | None = None) -> Scope:
        """That of the ranking of results by a query."""
        failed = int((results.points["status"] != "ok").sum())
        mapped = results.boundary is not None
        return cls(
            results.counted_points(where),
            failed,
            mapped,
            where is not None,
            results.uncertain_points(where),
        )

    @property
    def text(self) -> str:
        """What counts, in words."""
        return f"the {self.counted} {'nodes of the map' if self.mapped else 'solved points'}"

    @property
    def doubt(self) -> str:
        """Where stability is not certain, in words; empty where it is everywhere."""
        if not self.uncertain:
            return ""
        return (
            f"at {self.uncertain} solved design point(s) the error of some mode exceeds its growth "
            "or decay: stable or unstable is not certain there (stability in modes; n_unstable_low "
            "and n_unstable_high in points)"
        )

    @property
    def left_out(self) -> str:
        """What does not, in words; empty where no point failed."""
        return f"{self.failed} design point(s) failed and count neither way" if self.failed else ""


def ranking(table: pd.DataFrame, along: str | None, unit: str, scope: Scope) -> None:
    """Print the ranking of unstable modes."""
    if not len(table):
        console.print(_nothing(scope))
        for text in filter(None, (scope.doubt, scope.left_out)):
            console.print(text, style="dim")
        return
    titles = ["mode", "Hz", "unstable", "growth 1/s", "damping %", *(["onset"] if along else [])]
    grid = Table(box=None, pad_edge=False, header_style="bold")
    for title in titles:
        grid.add_column(title, justify="right", no_wrap=True, min_width=NARROW)
    energies = bool(table["main_component"].any())  # a family of matrices has none
    if energies:
        grid.add_column("energy in", no_wrap=True, min_width=WIDE)
    grid.add_column("worst at", overflow="fold")
    for row in table.to_dict("records"):
        grid.add_row(
            _label(row),
            frequency_text(row),
            f"{100 * row['unstable_share']:.1f}{_bounds(row)} %",
            in_digits(row["max_growth_rate"], 1),
            f"{100 * row['min_damping_ratio']:.3f}",
            *([_threshold(row)] if along else []),
            *([_energy(row)] if energies else []),
            ", ".join(value for _, value in _settings(row)),
        )
    console.print(grid)
    _legend(table, along, unit, scope)


def _nothing(scope: Scope) -> str:
    """Why a ranking has no row."""
    if not scope.counted:
        return f"No design point is {'solved and within the query' if scope.queried else 'solved'}."
    none = "Within the query no mode" if scope.queried else "No mode"
    return f"{none} is unstable at any of {scope.text}."


def _legend(table: pd.DataFrame, along: str | None, unit: str, scope: Scope) -> None:
    """What the columns of the ranking mean."""
    query = " within the query" if scope.queried else ""
    texts = [f"unstable: share of {scope.text}{query} at which the mode was found unstable"]
    if (table["unstable_points_low"] < table["unstable_points_high"]).any():
        texts += ["in brackets: from points where it is so whatever its error, to where it may be"]
    texts += [text for text in (scope.doubt, scope.left_out) if text]
    texts += ["growth, damping: fastest and least of all points; worst at: where growth is fastest"]
    names = ", ".join(name for name, _ in _settings(table.iloc[0].to_dict()))
    texts += [f"worst at: {names}"] if names else []
    if along:
        name = f"{along} [{unit}]" if unit else along
        texts.append(f"onset: least {name} at which the mode turns unstable, of all lines")
        texts += [text for kind, text in ONSETS.items() if (table["threshold_kind"] == kind).any()]
    if (table["kind"] == group_kind(UNTRACKED)).any():
        texts.append(
            "untracked: all modes in this range of frequency, maybe different ones; growth and "
            "damping of the fastest"
        )
    if table["ambiguous"].any():
        texts.append("~ before a mode: tracking was ambiguous somewhere on its lines")
    for text in texts:
        console.print(text, style="dim")


def outside_validity(points: pd.DataFrame, head: str = "") -> None:
    """Print how many design points break an assumption of the model or the method, and which."""
    outside, solved, rules = validity_counts(points)
    if outside:
        text = f"{head}{outside} of {solved} solved design points are outside validity"
        console.print(f"{text}: {broken_rules(rules)}")


def _bounds(row: dict[Hashable, Any]) -> str:
    """Bounds of a share by the errors of the modes, where they differ."""
    low, high, n = (row[f"{name}points{side}"] for name, side in SIDES)
    return f" ({100 * low / n:.1f} to {100 * high / n:.1f})" if low < high else ""


def _energy(row: dict[Hashable, Any]) -> str:
    shares = ((row[f"{place}_component"], row[f"{place}_share"]) for place in ("main", "second"))
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares if name)


def _settings(row: dict[Hashable, Any]) -> list[tuple[str, str]]:
    """Names and values of the worst point, from its text in the ranking."""
    parts = [part.rpartition("=") for part in str(row["at"]).split(", ") if "=" in part]
    return [(name, value) for name, _, value in parts]


def _label(row: dict[Hashable, Any]) -> str:
    name = str(row["track"]) if row["kind"] == "mode" else str(row["kind"])
    return f"~{name}" if row["ambiguous"] else name


def _threshold(row: dict[Hashable, Any]) -> str:
    value, kind = row["threshold"], row["threshold_kind"]
    if kind == BELOW_RANGE:
        return BELOW_RANGE
    if not isinstance(value, float) or value != value:
        return "-"
    bound = {CROSSING: "~", FIRST_SEEN: "<= ", BRACKETED: "<= "}.get(kind, "")
    return f"{bound}{round(value, 9):.4g}"
