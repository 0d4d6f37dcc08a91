"""What is shown of complex modes: the ranking of unstable ones, and errors."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.console import RenderableType

from squealstudy.engine.kind import KindScreen
from squealstudy.engine.table_rows import ranked_modes
from squealstudy.kinds.complex_modes.outside_text import grows_outside, outside_text
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.root_pairs import LIGHT_DAMPING
from squealstudy.screen import Rows, grid, notes
from squealstudy.study.sweeps import RANDOM_DESIGNS
from squealstudy.tables.mode_ranking import (
    UNTRACKED,
    counted_points,
    frequency_text,
    group_kind,
    query,
    rank_modes,
    selection,
    settings_of,
)
from squealstudy.tables.point_rows import ROW, point_codes
from squealstudy.tables.stability import (
    BELOW_RANGE,
    BRACKETED,
    BROKEN,
    CROSSING,
    FIRST_SEEN,
    INEXACT,
    is_uncertain,
    uncertain_points,
)
from squealstudy.wording import failure_counts, in_digits, named_tracks, percent, plural

if TYPE_CHECKING:
    from squealstudy.engine.results import Results


ONSETS = {
    CROSSING: "~ before an onset: interpolated between two design points, or put at a point that "
    "grows by less than its error; not refined",
    FIRST_SEEN: "<= before an onset: the mode is already unstable at the least value where its "
    "track was found",
    BROKEN: "<= before an onset: on some line the mode's track begins unstable beside one that "
    "ends, of the same mode perhaps",
    BRACKETED: "<= before an onset: between a stable point and this one, not refined",
    BELOW_RANGE: "below range: unstable at the first value of a line",
}
EXACT = 1e-9  # relative error of a method below which nothing is left to check
SEEN = 0.1  # of the largest estimate: points that err by less say little about the method
SIDES = (("unstable_", "_low"), ("unstable_", "_high"), ("", ""))
OTHER_MESH = "; the error of the mesh is not in it"
OF_MESH = "; the error of the mesh is not in it, `squealstudy check --mesh-error` tells it"

Row = dict[Hashable, Any]


class ComplexModesScreen(KindScreen):
    """Unstable modes: how widely, how strongly, from where on, in which component."""

    tables = ("points", "modes", "onsets")

    def rank(self, results: Results, by: str, top: int | None, where: str | None) -> pd.DataFrame:
        """Unstable tracked modes, `tables.mode_ranking.rank_modes`.

        Of a boundary design all nodes of its grid count; only solved points tell the worst design
        and the onset.
        """
        table = rank_modes(
            *results.ranked(where),
            results.along,
            by,
            top,
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
        known = table["track"].isin(solved.index)
        for name in ("at", "threshold", "threshold_kind"):
            table[name] = table["track"].map(solved[name]).where(known, table[name])
        return table

    def listed(
        self, results: Results, table: pd.DataFrame, where: str | None
    ) -> list[RenderableType]:
        """The ranking of unstable modes, what its columns mean, and what is uncertain."""
        if not len(table):
            return [_nothing(results, where), notes(_doubt(results, where), _left_out(results))]
        energies = bool(table["main_component"].any())  # a family of matrices has none
        shown = grid(
            *("mode", "Hz", "unstable", "growth 1/s", "damping %"),
            *(["onset"] if results.along else []),
            *(["word:energy in"] if energies else []),
            "text:worst at",
            rows=(
                _cells(row, results.along, energies, results.units)
                for row in table.to_dict("records")
            ),
        )
        return [shown, notes(*_legend(table, results, where))]

    def findings(self, results: Results) -> list[RenderableType]:
        """The ranking, or that there is no mode at all."""
        if any(len(batch) for batch in results.batches("modes", ["mode"])):
            return self.ranking(results)
        low, high = results.fact("band_hz")
        lost = _left_out(results)
        if not (results.points["status"] == "ok").any():
            return [_nothing(results, None), notes(lost)]
        where = "solved design point" if lost else "design point"
        return [f"No mode lies between {low:g} and {high:g} Hz at any {where}.", notes(lost)]

    def verdict(self, results: Results) -> str:
        """How many modes are unstable, the most widespread, and the one that grows fastest."""
        if not any(len(batch) for batch in results.batches("modes", ["mode"])):
            return super().verdict(results) + grows_outside(results.manifest, results.units)
        doubt = _doubt(results, None)
        but = f" But {doubt}." if doubt else ""
        but += grows_outside(results.manifest, results.units)
        table = self.rank(results, "share", None, None)
        if not len(table):
            return _nothing(results, None) + but
        named = int((table["kind"] == group_kind(1)).sum())
        others = len(table) - named
        text = plural(named, "mode") if named else ""
        text += " and " if named and others else ""
        text += plural(others, "group of modes", "groups of modes") if others else ""
        wide = table.iloc[0]
        fast = table.iloc[int(table["max_growth_rate"].to_numpy().argmax())]
        text += f" {'is' if named + others == 1 else 'are'} unstable. Most widespread: "
        text += f"{_told(wide)}, at {in_digits(100 * wide['unstable_share'])} % of "
        text += f"{_counted(results, None)}. Fastest: {_told(fast)}, by "
        text += f"{in_digits(fast['max_growth_rate'], 1)} 1/s"
        where = ", ".join(map(" ".join, settings_of(fast["at"], results.units).items()))
        return f"{text}{f' at {where}' if where else ''}.{but}"

    def facts(self, results: Results) -> Rows:
        """Which rungs served the points, what an audit of them found, estimates and errors."""
        manifest = results.manifest
        error = _full_order_error(manifest) + _unseen(results)
        outside = outside_text(manifest, results.units)
        return [
            *([("outside band", outside)] if outside else []),
            *_method(manifest),
            *_unrefined(manifest),
            ("error", error),
        ]


def _told(row: pd.Series) -> str:
    """A line of the ranking in words."""
    values = row.to_dict()
    hz = frequency_text(values)
    return f"{values['kind']} at {hz} Hz" if hz else str(values["kind"])


def _unrefined(manifest: Mapping[str, Any]) -> Rows:
    """What refinement left, for its budget was spent; nothing where it left nothing."""
    steps, onsets = (manifest.get(of, {}).get("left", 0) for of in ("tracking", "onsets"))
    told = [
        f"{plural(steps, 'step')} of tracks, ambiguous in modes" if steps else "",
        f"{plural(onsets, 'onset')}, interpolated or bracketed in onsets" if onsets else "",
    ]
    text = " and ".join(part for part in told if part)
    return [("not refined", f"{text}: see refine_points of [modes]")] if text else []


def _nothing(results: Results, where: str | None) -> str:
    """Why a ranking has no row."""
    if not _counted_points(results, where):
        return f"No design point is {'solved and within the query' if where else 'solved'}."
    none = "Within the query no mode" if where else "No mode"
    if not where:  # what lies outside the band may well be unstable
        none += " between {:g} and {:g} Hz".format(*results.fact("band_hz"))
    if results.boundary is None:
        return f"{none} is unstable at any of {_counted(results, where)}."
    solved = int(counted_points(results.points, results.columns("modes"), where).sum())
    nodes = _counted_points(results, where)
    return (
        f"{none} is unstable at any of the {plural(solved, 'point')} that were solved, of "
        f"{plural(nodes, 'node')} of the map."
    )


def _counted_points(results: Results, where: str | None) -> int:
    """Number of design points, or nodes of a boundary map, that a ranking is over."""
    return int(counted_points(results.nodes[0], results.columns("modes"), where).sum())


def _counted(results: Results, where: str | None) -> str:
    """What a ranking is over, in words."""
    count = _counted_points(results, where)
    if results.boundary is not None:
        solved = results.boundary["points_solved"]
        return f"the {plural(count, 'node')} of the map ({solved} solved)"
    return f"the {plural(count, 'solved point')}"


def _doubt(results: Results, where: str | None) -> str:
    """Where stability is not certain, in words; empty where it is everywhere."""
    known = results.columns("modes")
    asked = set().union(*(c.columns for c in query(where, results.points.columns, known)))
    columns = [ROW, *(c for c in known if c in asked or c == "stability")]
    modes = results.rows("modes", columns, is_uncertain)
    code = point_codes(results.points, modes)
    held, wanted = selection(results.points, modes, code, where)
    uncertain = uncertain_points(modes, code, held[code] & wanted)
    if not uncertain:
        return ""
    return (
        f"at {plural(uncertain, 'solved design point')} the error of some mode exceeds its growth "
        "or decay: stable or unstable is not certain there (stability in modes; n_unstable_low "
        "and n_unstable_high in points)"
    )


def _left_out(results: Results) -> str:
    """What does not count, in words; empty where every point is ok."""
    lost = int((results.points["status"] != "ok").sum())
    verb = "is not ok and counts" if lost == 1 else "are not ok and count"
    counts = failure_counts(results.points["status"])
    return f"{plural(lost, 'design point')} {verb} neither way ({counts})" if lost else ""


def _legend(table: pd.DataFrame, results: Results, where: str | None) -> list[str]:
    """What the columns of the ranking mean."""
    query = " within the query" if where else ""
    counted = _counted(results, where)
    found = "the mode was found unstable"
    if results.boundary is not None:
        found += "; a node that was not solved is as the nearest corner of its cell"
    texts = [f"unstable: share of {counted}{query} at which {found}"]
    if (table["unstable_points_low"] < table["unstable_points_high"]).any():
        texts += ["in brackets: from points where it is so whatever its error, to where it may be"]
    texts += [_doubt(results, where), _left_out(results)]
    texts += ["growth, damping: fastest and least of all points; worst at: where growth is fastest"]
    names = ", ".join(settings_of(table["at"].iloc[0], {}))
    texts += [f"worst at: {names}"] if names else []
    if along := results.along:
        unit = results.units.get(along, "")
        name = f"{along} [{unit}]" if unit else along
        texts.append(f"onset: least {name} at which the mode turns unstable, of all lines")
        texts += [text for kind, text in ONSETS.items() if (table["threshold_kind"] == kind).any()]
        if (table["threshold"].isna() & (table["threshold_kind"] != BELOW_RANGE)).any():
            texts.append(
                "- for an onset: none is known; the mode is untracked, or an unstable mode only "
                "changed its number there"
            )
    if (table["kind"] == group_kind(UNTRACKED)).any():
        texts.append(
            "untracked: all modes in this range of frequency, maybe different ones; growth and "
            "damping of the fastest"
        )
    if table["ambiguous"].any():
        texts.append("~ before a mode: tracking was ambiguous somewhere on its lines")
    return [*texts, *named_tracks(table["track"], results.track_names)]


def _cells(row: Row, along: str | None, energies: bool, units: Mapping[str, str]) -> list[str]:
    name = str(row["track"]) if row["kind"] == "mode" else str(row["kind"])
    low, high, n = (row[f"{of}points{side}"] for of, side in SIDES)
    bounds = f" ({percent(low / n, high / n)})" if low < high else ""
    shares = ((row[f"{place}_component"], row[f"{place}_share"]) for place in ("main", "second"))
    energy = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares if name)
    return [
        f"~{name}" if row["ambiguous"] else name,
        frequency_text(row),
        f"{100 * row['unstable_share']:.1f}{bounds} %",
        in_digits(row["max_growth_rate"], 1),
        f"{100 * row['min_damping_ratio']:.3f}",
        *([_threshold(row)] if along else []),
        *([energy] if energies else []),
        ", ".join(settings_of(row["at"], units).values()),
    ]


def _threshold(row: Row) -> str:
    value, kind = row["threshold"], row["threshold_kind"]
    if kind == BELOW_RANGE:
        return BELOW_RANGE
    if not isinstance(value, float) or value != value:
        return "-"
    return f"{INEXACT.get(kind, '')}{round(value, 9):.4g}"


def _method(manifest: Mapping[str, Any]) -> Rows:
    """Which rungs served the points, and what an audit of them found."""
    method = manifest.get("method")
    if not method:
        return []
    served = ", ".join(f"{rung} {count}" for rung, count in method["points"].items())
    rows = [("method", f"{method['chosen']} ({method['reason']}); points by rung: {served}")]
    if left := method.get("left_over"):
        points = plural(left["points"], "point")
        rows.append(("left over", f"{points}, solved exactly; the first was {left['first']}"))
    audit = manifest.get("audit")
    if audit and audit["modes"]:
        text = (
            f"{audit['modes']} modes of {audit['points']} points at full order: largest error "
            f"{audit['largest_true_error']:.1e}, largest estimate {audit['largest_estimate']:.1e}, "
            f"{audit['missed_modes']} missed"
        )
        rows.append(("audit", text))
    return [*rows, *_estimates(manifest)]


def _estimates(manifest: Mapping[str, Any]) -> Rows:
    """Largest estimated errors, of the rung and of the reduction; the mesh's is in neither."""
    errors = manifest.get("errors")
    if not errors or errors["largest_rung"] is None:
        return []
    largest = errors["largest_rung"]
    text = f"method {largest:.1e}, " if largest < 1.0 else "method above the root itself, "
    if unknown := errors.get("unknown_rung"):
        text += f"of {plural(unknown, 'mode')} not known, "
    if not errors["reduced"]:
        return [("estimates", f"{text}no reduction: relative, of light and of growing modes")]
    reduction, tolerance = errors["largest_reduction"], manifest["method"]["tolerance"]
    if reduction is None:
        return [("estimates", f"{text}reduction not known: no sample point has modes")]
    points = plural(errors["reduction_sample_points"], "sample point")
    text += f"reduction {reduction:.1e}, from a finer model at {points}"
    if errors["reduction_widened"] > 1:
        text += f", {errors['reduction_widened']:.2g} times that for what full order showed"
    if manifest.get("basis_enriched"):
        text += "; the basis was enriched"
        if reduction > tolerance:
            text += f", which is not enough for {tolerance:g}: a smaller [reduction] tolerance is"
    return [("estimates", f"{text}: relative, of light and of growing modes, without the mesh's")]


def _full_order_error(manifest: Mapping[str, Any]) -> str:
    """One line on the error against the full-order model."""
    asked = manifest.get("reference", [])
    checks = [c for c in asked if c.get("status") == "ok"]
    other = "a second factorisation" if manifest["model"] == MATRICES else "the full-order model"
    meshed = manifest["model"] == OF_FILE or "mesh" in manifest.get("options", {})
    other += " of the same mesh" if meshed else ""
    if not asked:
        failed = ", or those points failed" if manifest.get("n_failed") else ""
        return f"not checked against {other} ([modes] reference_points = 0{failed})"
    if not checks:
        return f"not known, {other} failed at {plural(len(asked), 'point')}: {asked[0]['message']}"
    points = plural(len(checks), "point")
    if not any(c["full_order_modes"] for c in checks):
        return f"{other} has no mode in the band either, at {points}"
    compared = [c for c in checks if "frequency_error" in c]
    if not compared:
        return f"not known: {other} has no mode of damping < 5 % to compare with, at {points}"
    points = plural(len(compared), "point")
    of_mesh = OF_MESH if "mesh" in manifest.get("options", {}) else OTHER_MESH if meshed else ""
    frequency = max(c["frequency_error"] for c in compared)
    damping = max(c["damping_error"] for c in compared)
    missed = sum(c["missed_modes"] for c in compared)
    return (
        f"frequency {frequency:.1e} relative, damping ratio {damping:.1e}, {missed} modes missed: "
        f"modes of damping < 5 % against {other} at {points}{of_mesh}"
    )


def _unseen(results: Results) -> str:
    """That checked points are such where the method hardly errs, as nodes of an interpolation."""
    checked = [c["point_id"] for c in results.manifest.get("reference", []) if "roots" in c]
    if not checked or "error_rung" not in results.columns("modes"):
        return ""
    there = anywhere = -np.inf
    columns = ["point_id", "error_rung", "frequency_hz", "damping_ratio"]
    for modes in results.batches("modes", columns):
        light = modes["damping_ratio"].abs() < LIGHT_DAMPING
        estimate = (modes["error_rung"] / (2 * np.pi * modes["frequency_hz"])).where(light)
        anywhere = np.fmax(anywhere, estimate.max())
        there = np.fmax(there, estimate[modes["point_id"].isin(checked)].max())
    if not (np.isfinite(there) and anywhere > EXACT and there < SEEN * anywhere):
        return ""  # or the method has no light mode at these points
    return (
        f"; the method hardly errs there, by {there:.0e} in its own estimate, which is "
        f"{anywhere:.1e} elsewhere: audit checks points drawn at random"
    )


SCREEN = ComplexModesScreen()
