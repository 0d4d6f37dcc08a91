"""Unstable modes of one study of complex modes beside those of another, after a change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from squealstudy.root_pairs import partners
from squealstudy.tables.mode_ranking import (
    OVERDAMPED_GROUP,
    group_kind,
    rank_modes,
    unstable_groups,
)
from squealstudy.tables.point_rows import point_codes
from squealstudy.tables.stability import BELOW_RANGE, INTO, uncertain_points
from squealstudy.wording import track_number

REL_TOLERANCE = 0.05  # between frequencies of one mode before and after: a choice, told on screens
SAME_ONSET_REL_DISTANCE = 1e-9  # between an onset in a ranking and in the table of onsets
SIDES = ("before", "after")
COLUMNS = {  # of each side, with their types
    "mode_{}": "str",
    "frequency_{}_hz": "f8",
    "onset_{}": "f8",
    "onset_kind_{}": "str",
    "onset_error_{}": "f8",
    "growth_rate_{}": "f8",
    "growth_rate_error_{}": "f8",
    "unstable_points_{}": "int64",
}
EMPTY: dict[str, object] = {"str": "", "int64": 0}  # cells of a side that has no such mode
COMPONENTS = ["main_component", "second_component"]


class UnstableModes(NamedTuple):
    """The unstable modes of one study at points and on lines that another has, too.

    Attributes
    ----------
    table : DataFrame
        COLUMNS without the side, and the COMPONENTS of most energy; one row for each mode.
    roots : ndarray (n_modes, n) complex
        Root of each mode at the common points, rad/s; NaN where it is not known.
    unstable, uncertain : int
        Numbers of common points at which a mode is unstable, and at which stability is uncertain.
    failed : int
        Number of points on the lines that failed.
    """

    table: pd.DataFrame
    roots: np.ndarray
    unstable: int
    uncertain: int
    failed: int


def unstable_modes(
    points: pd.DataFrame,
    modes: pd.DataFrame,
    onsets: pd.DataFrame,
    along: str | None,
    lines: np.ndarray,
    common: np.ndarray,
) -> UnstableModes:
    """Unstable modes of a study at some of its points, and their onsets along its lines.

    Tracks of one mode, whose number changes, share a row.

    Parameters
    ----------
    points, modes, onsets : DataFrame
        Tables of the study.
    along : str or None
        Parameter of the onsets; None without them.
    lines : ndarray (n_points,) of bool
        Points on lines of both studies, for onsets.
    common : ndarray (n,) of int
        Solved points of both studies, for growth, in one order for both.
    """
    code = point_codes(points, modes)
    is_common = np.isin(np.arange(len(points)), common)
    at_lines, at_common = (
        rank_modes(points[rows_of], modes[rows_of[code]], along, "growth", onsets=onsets)
        for rows_of in (lines, is_common)
    )
    with_onset = at_common[at_common["track"].isin(at_lines["track"])].set_index("track")
    rows = [
        _mode_row(tracks, with_onset.reindex(tracks["track"]).dropna(subset="max_growth_rate"))
        for tracks in _by_mode(at_lines)
    ]
    names = [name.replace("_{}", "") for name in COLUMNS]
    table = pd.DataFrame(rows, columns=[*names, "tracks", *COMPONENTS])
    shown = modes[is_common[code]]
    row_of_point = np.full(len(points), -1)
    row_of_point[common] = np.arange(len(common))
    group = np.where(shown["track"] > 0, shown["track"], unstable_groups(shown))
    of_modes = [np.isin(group, row["tracks"]) for row in rows]
    rows_of_modes = row_of_point[code[is_common[code]]]
    roots = [_roots(shown[rows_of], rows_of_modes[rows_of], len(common)) for rows_of in of_modes]
    table["growth_rate_error"] = [
        shown.loc[(shown["growth_rate"] == row["growth_rate"]).to_numpy(), "error_estimate"].max()
        for row in rows
    ]
    table["onset_error"] = [_onset_error(row["tracks"], row["onset"], onsets) for row in rows]
    return UnstableModes(
        table=table,
        roots=np.reshape(roots, (len(rows), len(common))),
        unstable=int((points["n_unstable"][is_common] > 0).sum()),
        uncertain=uncertain_points(modes, code, is_common[code]),
        failed=int((points["status"][lines] != "ok").sum()),
    )


def paired(before: UnstableModes, after: UnstableModes) -> pd.DataFrame:
    """One row for each mode that is unstable before or after, the fastest first.

    Modes are paired if their frequencies agree within REL_TOLERANCE, in the mean over the common
    points at which both grow (or one, if both never do at one point), and if they have a component
    of most energy in common.

    Returns
    -------
    DataFrame
        COLUMNS of both SIDES. On a side without a partner texts are empty, numbers NaN and
        `unstable_points` 0. A mode without partner before and one after may be the same mode, whose
        frequency changes by more. `mode` has the track numbers, or the name of a group of modes
        without tracks; `onset` is the least value at which the mode turns unstable on lines that
        both studies have (`onset_kind`: `threshold_kind` of `rank_modes`), its error NaN where it
        is not known.
    """
    table_before, table_after = before.table, after.table
    distance = _distances(before.roots, after.roots)
    overdamped = [
        t["mode"].eq(group_kind(OVERDAMPED_GROUP)).to_numpy(bool)
        for t in (table_before, table_after)
    ]
    distance[np.ix_(*overdamped)] = 0.0
    for row, one_has in enumerate(table_before[COMPONENTS].to_numpy()):
        for column, two_has in enumerate(table_after[COMPONENTS].to_numpy()):
            if any(one_has) and any(two_has) and not set(filter(None, one_has)) & set(two_has):
                distance[row, column] = np.inf
    partner = partners(distance, REL_TOLERANCE)
    without_partner = np.setdiff1d(np.arange(len(table_after)), partner)
    rows = (
        [*range(len(table_before)), *[-1] * len(without_partner)],
        [*partner.tolist(), *without_partner.tolist()],
    )
    table = pd.DataFrame(index=range(len(rows[0])))
    for name, kind in COLUMNS.items():
        for side, side_table, rows_of_side in zip(
            SIDES, (table_before, table_after), rows, strict=True
        ):
            values = (
                side_table[name.replace("_{}", "")].reindex(rows_of_side).reset_index(drop=True)
            )
            if kind in EMPTY:
                values = values.where(values.notna(), EMPTY[kind])
            table[name.format(side)] = values
    table = table.astype({n.format(s): k for n, k in COLUMNS.items() for s in SIDES})
    fastest = table[[f"growth_rate_{side}" for side in SIDES]].max(axis=1).fillna(-np.inf)
    return table.iloc[np.argsort(-fastest.to_numpy(), kind="stable")].reset_index(drop=True)


def _roots(rows: pd.DataFrame, row_of_point: np.ndarray, count: int) -> np.ndarray:
    """Roots (count,) of a mode at common points, rad/s; of several rows at one the fastest."""
    order = np.argsort(rows["growth_rate"].to_numpy(float), kind="stable")
    size = 2.0 * np.pi * rows["frequency_hz"].to_numpy(float)
    real = rows["growth_rate"].to_numpy(float)
    roots = np.full(count, np.nan, dtype=complex)
    roots[row_of_point[order]] = (real + 1j * np.sqrt(np.maximum(size**2 - real**2, 0.0)))[order]
    return roots


def _distances(roots: np.ndarray, other_roots: np.ndarray) -> np.ndarray:
    """Relative distance (n, m) of frequencies, of roots (n, k) and others (m, k), over k points.

    It is the mean over the points at which both grow, or, without any, at which one does: before
    two modes lock in either may be the one that will grow. Infinite where there is no such point.
    """
    roots, other_roots = roots[:, None], other_roots[None]
    each = np.abs(np.abs(other_roots) / np.abs(roots) - 1.0)
    both, either = (
        np.isfinite(each) & counted
        for counted in (
            (roots.real > 0) & (other_roots.real > 0),
            (roots.real > 0) | (other_roots.real > 0),
        )
    )
    is_compared = np.where(both.any(axis=-1, keepdims=True), both, either)
    count = is_compared.sum(axis=-1)
    mean = np.where(is_compared, each, 0.0).sum(axis=-1) / np.maximum(count, 1)
    return np.where(count > 0, mean, np.inf)


def first_of(table: pd.DataFrame, side: str) -> pd.Series | None:
    """The row of `paired` whose mode turns unstable first on a side; None where none is known."""
    below = table[(table[f"onset_kind_{side}"] == BELOW_RANGE).to_numpy(bool)]
    if len(below):
        return below.iloc[0]
    table = table[table[f"onset_{side}"].notna().to_numpy(bool)]
    onset = table[f"onset_{side}"]
    return table.iloc[int(onset.to_numpy().argmin())] if len(onset) else None


def _by_mode(ranking: pd.DataFrame) -> list[pd.DataFrame]:
    """Rows of a ranking by mode: tracks of one mode, whose number changes, together."""
    is_one = (ranking["track"] > 0) & (ranking["family_modes"] == 1)
    number = ranking["family"].where(is_one, ranking["track"])
    return [rows for _, rows in ranking.groupby(number.to_numpy(), sort=False)]


def _mode_row(tracks: pd.DataFrame, at_common: pd.DataFrame) -> dict[str, Any]:
    """Row of a mode from its tracks in rankings by growth, over lines and over common points."""
    fastest = (at_common if len(at_common) else tracks).iloc[0]
    below = tracks[(tracks["threshold_kind"] == BELOW_RANGE).to_numpy(bool)]
    first = below if len(below) else tracks.sort_values("threshold", kind="stable")
    together = "family_points" if len(tracks) > 1 else "unstable_points"
    numbers = sorted(tracks["track"].tolist())
    names = [track_number(track) if track > 0 else group_kind(track) for track in numbers]
    return {
        "mode": ", ".join(names),
        "frequency_hz": float(fastest["frequency_hz"]),
        "onset": float(first["threshold"].iloc[0]),
        "onset_kind": str(first["threshold_kind"].iloc[0]),
        "growth_rate": float(fastest["max_growth_rate"]) if len(at_common) else np.nan,
        "unstable_points": int(at_common[together].max()) if len(at_common) else 0,
        "tracks": numbers,
        **{name: str(fastest[name]) for name in COMPONENTS},
    }


def _onset_error(tracks: Sequence[int], onset: float, onsets: pd.DataFrame) -> float:
    """Error of the onset of a mode, in the parameter's unit; NaN where the table has none."""
    into = onsets[(onsets["track"].isin(tracks) & (onsets["direction"] == INTO)).to_numpy(bool)]
    same = np.isclose(into["onset"], onset, rtol=SAME_ONSET_REL_DISTANCE, atol=0.0)
    return float(into["error_estimate"][same].max())
