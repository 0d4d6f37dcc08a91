"""Screens of complex-mode studies: the ranking of unstable modes, and errors."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.engine.kind_screen import KindScreen
from squealstudy.engine.table_rows import ranked_modes
from squealstudy.kinds.complex_modes.answer import answer, contact_rows, row_text, what_is_unstable
from squealstudy.kinds.complex_modes.design_lines import design_lines
from squealstudy.kinds.complex_modes.design_table import design_table
from squealstudy.kinds.complex_modes.error_text import (
    full_order_error_text,
    method_rows,
    turning_rows,
    undamped_rows,
    unseen_text,
)
from squealstudy.kinds.complex_modes.onset_table import onset_table
from squealstudy.kinds.complex_modes.onset_words import TAKEN_OVER_NOTE, onset_cell
from squealstudy.kinds.complex_modes.outside_text import grows_outside, outside_text
from squealstudy.kinds.complex_modes.random_screen import DOUBTFUL_NUMBER, families_in_words
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.screen import Rows, command_text, grid, held_together, notes
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.energy_ranking import tells_parts
from squealstudy.tables.mode_ranking import (
    FIRST_UNTRACKED_GROUP,
    frequency_text,
    group_kind,
    rank_modes,
    settings_of,
)
from squealstudy.tables.point_rows import ROW, point_codes
from squealstudy.tables.ranking_query import counted_points, query, selection, within_query
from squealstudy.tables.stability import (
    BELOW_RANGE,
    BRACKETED,
    BROKEN,
    CROSSING,
    FIRST_SEEN,
    REFINED_ONSETS,
    is_uncertain,
    uncertain_points,
)
from squealstudy.tables.worst_points import ANY
from squealstudy.wording import (
    amount,
    any_of,
    band_text,
    failure_counts,
    in_digits,
    knots_text,
    named_tracks,
    plural,
    track_number,
)

if TYPE_CHECKING:
    from squealstudy.engine.result_tables import ResultTables


ONSETS = {
    CROSSING: "~ before an onset: interpolated between two design points, or put at a point that "
    "grows by less than its error; not refined",
    FIRST_SEEN: "<= before an onset: on some line the mode is unstable at the least value where it "
    "was found",
    BROKEN: "<= before an onset: on some line the track begins unstable beside one that ends; "
    "both may be one mode",
    BRACKETED: "<= before an onset: between a stable point and this one, not refined",
    BELOW_RANGE: "below range: unstable at the first value of a line",
}
FIRST_SEEN_NOTE = (
    "<= before an onset: the least value of a solved point at which the mode is unstable"
)
LEAST_ENERGY_SHARE = 0.005  # components with less energy are not named: it rounds to 0 %
SIDES = (("unstable_", "_low"), ("unstable_", "_high"), ("", ""))

Row = dict[Hashable, Any]


class ComplexModesScreen(KindScreen):
    """Unstable modes: at how many points, how fast they grow, from where on, in which component."""

    tables = ("points", "modes", "onsets")
    found = ("contact",)
    sure = (
        *("outside band", "knots", "left over", "audit", "estimates", "not refined", "error"),
        *("gyroscopic", "undamped"),
    )

    def rank(
        self, results: ResultTables, by: str, top: int | None, where: str | None
    ) -> pd.DataFrame:
        """Ranking of unstable modes (`tables.mode_ranking.rank_modes`), made once and then copied.

        All nodes of the grid of a boundary design count, but only solved points decide on the worst
        design, the largest growth and the onset.
        """
        if (by, where) not in results.rankings:
            results.rankings[by, where] = self._ranking(results, by, where)
        return results.rankings[by, where].iloc[:top].copy()

    @staticmethod
    def _ranking(results: ResultTables, by: str, where: str | None) -> pd.DataFrame:
        """The ranking of a study; on a boundary map, growth and onset are of solved points."""
        table = rank_modes(
            *results.ranked(where),
            results.along,
            by,
            None,
            where,
            results.onsets,
            results.design in RANDOM_DESIGNS,
        )
        if results.boundary is None:
            return table
        solved = rank_modes(
            results.points,
            ranked_modes(results, where),
            results.along,
            "growth",
            None,
            where,
            results.onsets,
        ).set_index("track")
        is_solved = table["track"].isin(solved.index)
        onset = ("threshold", "threshold_kind", "taken_over")
        for name in ("at", "frequency_hz", "max_growth_rate", *onset):
            of_solved = table["track"].map(solved[name]).where(is_solved, table[name])
            table[name] = of_solved.astype(table[name].dtype)
        return table

    def listed(
        self, results: ResultTables, table: pd.DataFrame, where: str | None
    ) -> list[RenderableType]:
        """The ranking of unstable modes, what its columns mean, and what is uncertain."""
        if not len(table):
            beyond = "" if where else grows_outside(results.manifest, results.units)
            none = f"{_no_mode(results, where)}{beyond}"
            doubts = [text for text in (_doubt(results, where), _left_out(results)) if text]
            return [none, notes(*doubts)] if doubts else [none]
        energies = tells_parts(table)
        shown = grid(
            *("mode", "Hz", "unstable", "growth 1/s", "damping %"),
            *(["onset"] if results.along else []),
            *(["text:energy in"] if energies else []),
            "text:worst at",
            rows=(
                _cells(row, results.along, energies, results.units)
                for row in table.to_dict("records")
            ),
        )
        return [shown, notes(*_legend(table, results, where))]

    def findings(self, results: ResultTables) -> list[RenderableType]:
        """The ranking, or that there is no mode at all."""
        if any(len(batch) for batch in results.batches("modes", ["mode"])):
            lines = design_lines(results)
            table = self.rank(results, "share", None, None)
            designs = design_table(results, lines, table) if lines else onset_table(results)
            first = answer(results, table, lines)
            if not first and (table["kind"] != group_kind(1)).all() and len(table):
                first = [self.verdict(results), ""]  # modes without numbers have no onsets
            parts = [designs, self.ranking(results)]
            parts = parts if len(table) else parts[::-1]  # a verdict before its table
            return [*first, *parts[0], *([""] if all(parts) else []), *parts[1]]
        lost = _left_out(results)
        left_out = [notes(lost)] if lost else []
        if not (results.points["status"] == "ok").any():
            return [_no_mode(results, None), *left_out]
        where = "solved design point" if lost else "design point"
        return [f"No mode lies {band_text(results.fact('band_hz'))} at any {where}.", *left_out]

    def verdict(self, results: ResultTables) -> str:
        """How many modes are unstable, the most widespread, and the one that grows fastest."""
        if not any(len(batch) for batch in results.batches("modes", ["mode"])):
            return super().verdict(results) + grows_outside(results.manifest, results.units)
        doubt = _doubt(results, None).partition(" (")[0]
        but = (f" But {doubt}." if doubt else "") + grows_outside(results.manifest, results.units)
        table = self.rank(results, "share", None, None)
        if not len(table):
            return _no_mode(results, None) + but
        wide = table.iloc[int(table["family_points"].to_numpy().argmax())]
        fast = table.iloc[int(table["max_growth_rate"].to_numpy().argmax())]
        text = what_is_unstable(results, table, design_lines(results))
        text += "".join(f"; {family}" for family in families_in_words(table)) + ". "
        share = in_digits(100 * wide["family_points"] / wide["points"])
        text += f"Most widespread: {row_text(wide)}, at {share} % of {_counted(results, None)}. "
        text += f"Fastest: {row_text(fast)}, by {in_digits(fast['max_growth_rate'], 1)} 1/s"
        at = settings_of(fast["at"], results.units).items()
        where = ", ".join(f"{name} {text}" for name, text in at if text != ANY)
        return f"{text}{f' at {where}' if where else ''}.{but}"

    def next_steps(self, results: ResultTables) -> Rows:
        """How to see why modes grow, or where else to look if none does."""
        explored = ("click through", command_text("explore", results.directory))
        more = results.manifest["model"] != MATRICES  # these have complex modes alone
        if len(self.rank(results, "share", 1, None)):
            why = [("why unstable", command_text("rank", results.directory, "--why"))] * more
            least = [("least change", 'kind = "design" searches the least that silences it')] * more
            shares = [("probability", command_text("robust", results.directory))]
            shares *= results.design in RANDOM_DESIGNS
            return [*shares, *why, explored, *least]
        kicked = 'kind = "limit_cycles" looks for vibration beside stable sliding'
        elsewhere = "a wider band of [modes], or other values in [[sweep]]"
        return [explored, ("squeal elsewhere", elsewhere), *[("squeal if kicked", kicked)] * more]

    def facts(self, results: ResultTables) -> Rows:
        """Which rungs served the points, what an audit of them found, estimates and errors."""
        manifest = results.manifest
        error = full_order_error_text(manifest) + unseen_text(results)
        outside = outside_text(manifest, results.units)
        knots = knots_text(manifest.get("knots_between", {}), results.units)
        return [
            *contact_rows(results, design_lines(results)),
            *([("outside band", outside)] if outside else []),
            *([("knots", knots)] if knots else []),
            *method_rows(manifest),
            *_unrefined(manifest),
            ("error", error),
            *turning_rows(manifest),
            *undamped_rows(results),
        ]


def _unrefined(manifest: Mapping[str, Any]) -> Rows:
    """Row on what was left unrefined when the budget was spent; none where nothing was."""
    steps, onsets = (manifest.get(of, {}).get("left", 0) for of in ("tracking", "onsets"))
    parts = [
        f"{plural(steps, 'step')} in which a mode's number may have jumped" if steps else "",
        f"{plural(onsets, 'onset')} known between two points only" if onsets else "",
    ]
    text = " and ".join(part for part in parts if part)
    return (
        [("not refined", f"{text}: a larger refine_points in [modes] settles them")] if text else []
    )


def _within_query(results: ResultTables, where: str | None) -> str:
    return within_query(where, results.points.columns, results.columns("modes"), results.units)


def _no_mode(results: ResultTables, where: str | None) -> str:
    """A sentence on why a ranking has no row."""
    if not _counted_points(results, where):
        if not where:
            return "No design point is solved."
        return f"No design point is solved and{_within_query(results, where).rstrip(',')}."
    none = f"W{_within_query(results, where)[2:]} no mode" if where else "No mode"
    none += f" {band_text(results.fact('band_hz'))}"  # modes outside it may well be unstable
    if results.boundary is None:
        count = _counted_points(results, where)
        return f"{none} is unstable at {any_of(count, 'solved point')}."
    solved = int(counted_points(results.points, results.columns("modes"), where).sum())
    nodes = _counted_points(results, where)
    were = "was" if solved == 1 else "were"
    return (
        f"{none} is unstable at {any_of(solved, 'point')} that {were} solved, of "
        f"{plural(nodes, 'node')} of the map."
    )


def _counted_points(results: ResultTables, where: str | None) -> int:
    """Number of solved design points, or nodes of a boundary map, that a ranking counts."""
    return int(counted_points(results.nodes[0], results.columns("modes"), where).sum())


def _counted(results: ResultTables, where: str | None) -> str:
    """The points that a ranking counts, in words."""
    count = _counted_points(results, where)
    if results.boundary is not None:
        solved = int((results.points["status"] == "ok").sum())
        return f"the {plural(count, 'node')} of the map ({solved} solved)"
    return f"the {plural(count, 'solved point')}"


def _doubt(results: ResultTables, where: str | None) -> str:
    """At how many points stability is not certain, in words; empty where it is certain at all."""
    names = results.columns("modes")
    in_query = set().union(*(c.columns for c in query(where, results.points.columns, names)))
    columns = [ROW, *(c for c in names if c in in_query or c == "stability")]
    modes = results.rows("modes", columns, is_uncertain)
    code = point_codes(results.points, modes)
    points_selected, modes_selected = selection(results.points, modes, code, where)
    uncertain = uncertain_points(modes, code, points_selected[code] & modes_selected)
    if not uncertain:
        return ""
    return (
        f"at {plural(uncertain, 'solved design point')} the error of some mode exceeds its growth "
        "or decay: stable or unstable is not certain there (stability in modes; n_unstable_low "
        "and n_unstable_high in points)"
    )


def _left_out(results: ResultTables) -> str:
    """Points that do not count, in words; empty where every point is ok."""
    lost = int((results.points["status"] != "ok").sum())
    verb = "is not ok and counts" if lost == 1 else "are not ok and count"
    counts = failure_counts(results.points["status"])
    return f"{plural(lost, 'design point')} {verb} neither way ({counts})" if lost else ""


def _legend(table: pd.DataFrame, results: ResultTables, where: str | None) -> list[str]:
    """Texts on the columns of the ranking, and on what is left out."""
    query = " within the query" if where else ""
    counted = f"{_counted(results, where)}{_within_query(results, where)}"
    unstable_text = "the mode was found unstable"
    if results.boundary is not None:
        unstable_text += "; a node that was not solved is as the nearest corner of its cell"
    texts = [f"unstable: share of {counted} at which {unstable_text}"]
    if (table["unstable_points_low"] < table["unstable_points_high"]).any():
        texts += ["in brackets: from points where it is so whatever its error, to where it may be"]
    texts += [_doubt(results, where), _left_out(results)]
    texts += ["growth, Hz, worst at: where growth is fastest; damping: least of all points"]
    texts[-1] += "; energy in: mean of the mode's unstable points" * tells_parts(table)
    names = ", ".join(settings_of(table["at"].iloc[0], {}))
    any_text = f"; {ANY}: alike at all its values" * any(f"={ANY}" in at for at in table["at"])
    texts += [f"worst at: {names}{any_text}"] if names else []
    if along := results.along:
        texts.append(
            f"onset: least {along} at which the mode turns unstable{_onset_error(table, results)}"
        )
        texts += _onset_kinds(set(table["threshold_kind"]), results, query)
        if table["taken_over"].any():
            texts.append(TAKEN_OVER_NOTE)
        if (table["threshold"].isna() & (table["threshold_kind"] != BELOW_RANGE)).any():
            texts.append(
                "- for an onset: none is known; the mode is untracked, or an unstable mode only "
                "changed its number there"
            )
    if (table["kind"] == group_kind(FIRST_UNTRACKED_GROUP)).any():
        texts.append(
            "untracked: all modes in this range of frequency, maybe different ones; growth and "
            "damping of the fastest"
        )
    texts += families_in_words(table)
    if table["ambiguous"].any():
        swapped = table["ambiguous"] & table["family"].duplicated(keep=False)
        also = " does" if swapped.any() else " and onsets do"  # a number's onsets are by label
        texts.append(f"{DOUBTFUL_NUMBER}; stability{also} not depend on it")
    return [*texts, *named_tracks(table["track"], results.track_names)]


def _onset_error(table: pd.DataFrame, results: ResultTables) -> str:
    """The largest error of a ranking's refined onsets, in words; empty where none is known."""
    onsets = results.onsets if "onsets" in results.tables else pd.DataFrame()
    if "error_estimate" not in onsets:
        return ""
    refined = onsets["status"].isin(REFINED_ONSETS) & onsets["track"].isin(table["track"])
    error = float(onsets["error_estimate"][refined.to_numpy(bool)].max())
    if not np.isfinite(error):
        return ""
    unit = results.units.get(results.along or "", "")
    rounded = amount(float(np.format_float_scientific(error, 1)), unit)
    return f"; refined ones to {rounded}, the model's errors apart"


def _onset_kinds(kinds: set[str], results: ResultTables, query: str) -> list[str]:
    """Texts on the marks before an onset, and on words in its place."""
    drawn = results.design in RANDOM_DESIGNS
    texts = ONSETS | ({FIRST_SEEN: FIRST_SEEN_NOTE, BRACKETED: FIRST_SEEN_NOTE} if drawn else {})
    texts[BELOW_RANGE] += query
    return list(dict.fromkeys(text for kind, text in texts.items() if kind in kinds))


def _cells(row: Row, along: str | None, energies: bool, units: Mapping[str, str]) -> list[str]:
    """Cells of a row of the ranking on screen."""
    name = track_number(row["track"]) if row["kind"] == "mode" else str(row["kind"])
    low, high, n = (row[f"{of}points{side}"] for of, side in SIDES)
    share = f"{100 * row['unstable_share']:.1f} %"
    if low < high:
        middle, least, most = (
            f"{100 * x:.{1 if x < 0.1 else 0}f}" for x in (row["unstable_share"], low / n, high / n)
        )
        share = f"{middle} ({least}-{most}) %"
    shares = ((row[f"{prefix}_component"], row[f"{prefix}_share"]) for prefix in ("main", "second"))
    energy = ", ".join(
        f"{name} {held_together([f'{100 * share:.0f} %'])}"
        for name, share in shares
        if name and share >= LEAST_ENERGY_SHARE
    )
    return [
        f"~{name}" if row["ambiguous"] else name,
        frequency_text(row),
        share,
        in_digits(row["max_growth_rate"], 1),
        f"{100 * row['min_damping_ratio']:.3g}",
        *([onset_cell(row, units.get(along, ""))] if along else []),
        *([energy] if energies else []),
        held_together(settings_of(row["at"], units).values()),
    ]


SCREEN = ComplexModesScreen()
