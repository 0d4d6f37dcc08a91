"""Complex modes on a page: the unstable ones, and the least damped of the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from squealstudy.explore.packed import MISSING, packed_numbers, packed_single, packed_whole
from squealstudy.explore.points import Content, measure
from squealstudy.tables.point_rows import ROW
from squealstudy.tables.stability import is_uncertain
from squealstudy.wording import name_where_fastest

if TYPE_CHECKING:
    from squealstudy.engine.results import Results

MAX_BYTES = 15_000_000  # bytes of the columns of modes, before base64 makes four bytes of three
# columns that are packed as numbers of 32 bits, and as whole numbers of 16 bits
NUMBERS = ("frequency_hz", "growth_rate", "error_estimate")
INTEGERS = ("mode", "track", "flags")
UNSTABLE, UNCERTAIN, OVERDAMPED, AMBIGUOUS = 1, 2, 4, 8  # bits of flags
ENERGY = "energy_"


def modes_content(results: Results, points: pd.DataFrame) -> tuple[Content, list[Content]]:
    """Content of a page: modes of some design points, and quantities of points for its map.

    If there are more modes than a page can hold, it has the unstable and the least damped ones.
    ``lightest`` is then the damping ratio up to which all modes are on the page, else None.
    """
    names = results.columns("modes")
    energies = [name for name in names if name.startswith(ENERGY)]
    bytes_per_mode = 4 * len(NUMBERS) + 2 * (len(INTEGERS) + len(energies))
    position = np.full(len(results.points), -1)
    position[points.index] = np.arange(len(points))
    all_modes = results.rows("modes", [ROW, "damping_ratio", "growth_rate", "frequency_hz"])
    is_shown = position[all_modes[ROW].to_numpy()] >= 0
    mode_rows = np.flatnonzero(is_shown)
    mapped = all_modes.iloc[mode_rows]
    mapped = mapped.assign(**{ROW: position[mapped[ROW].to_numpy()]})
    max_modes, max_damping_ratio = MAX_BYTES // bytes_per_mode, np.inf
    if len(mode_rows) > max_modes:
        damping = all_modes["damping_ratio"].to_numpy()[mode_rows]
        lightest = np.argpartition(damping, max_modes - 1)[:max_modes]
        max_damping_ratio = float(damping[lightest].max())
        is_shown[:] = False
        is_shown[mode_rows[lightest]] = True

    def shown(batch: pd.DataFrame) -> np.ndarray:
        on_page = position[batch[ROW].to_numpy()] >= 0
        rows: np.ndarray = is_shown[batch.index] | (on_page & batch["unstable"].to_numpy(bool))
        return rows

    labels = ("mode", "track", "track_ambiguous", "unstable", "stability", "overdamped")
    columns = [ROW, "damping_ratio", *NUMBERS, *labels, *energies]
    modes = results.rows("modes", columns, shown)
    modes[ROW] = position[modes[ROW].to_numpy()]
    modes = modes.sort_values([ROW, "frequency_hz"], kind="stable")
    content: Content = {
        "counts": packed_whole(np.bincount(modes[ROW], minlength=len(points))),
        "n": len(modes),
        "n_all": len(mode_rows),
        "lightest": None if np.isinf(max_damping_ratio) else max_damping_ratio,
        "energies": [name.removeprefix(ENERGY).replace("_", " ") for name in energies],
        "names": {str(t): name_where_fastest(n) for t, n in results.track_names.items()},
        "mode": packed_whole(modes["mode"].to_numpy()),
        "track": packed_whole(_tracks(modes)),
        "flags": packed_whole(_flags(modes)),
        "shares": [packed_numbers(modes[name].to_numpy()) for name in energies],
    }
    content |= {name: packed_single(modes[name].to_numpy()) for name in NUMBERS if name in modes}
    return content, _measures(points, mapped)


def _tracks(modes: pd.DataFrame) -> np.ndarray:
    """Track of each mode (n,); MISSING for no track, or a number too large for 16 bits."""
    track = modes["track"].to_numpy()
    tracks: np.ndarray = np.where((track > 0) & (track < MISSING), track, MISSING)
    return tracks


def _flags(modes: pd.DataFrame) -> np.ndarray:
    """Flags of each mode (n,), as bits of a whole number."""
    flag_columns = {UNSTABLE: modes["unstable"], UNCERTAIN: is_uncertain(modes)}
    flag_columns |= {OVERDAMPED: modes["overdamped"], AMBIGUOUS: modes["track_ambiguous"]}
    flags = np.zeros(len(modes), dtype=int)
    for bit, flag in flag_columns.items():
        flags += bit * np.asarray(flag, dtype=bool)
    return flags


def _measures(points: pd.DataFrame, modes: pd.DataFrame) -> list[Content]:
    """Quantities of design points that a map can show, from all their modes."""
    fastest = modes.loc[modes.groupby(ROW)["growth_rate"].idxmax()].set_index(ROW)
    by_point = fastest.reindex(np.arange(len(points)))
    least_damping = modes.groupby(ROW)["damping_ratio"].min().reindex(np.arange(len(points)))
    n = points["n_unstable"]
    hertz, growth = (by_point[c].to_numpy() for c in ("frequency_hz", "growth_rate"))
    return [
        measure("fastest growth", "1/s", growth, n),
        measure("unstable modes", "", n.to_numpy(dtype=float, na_value=np.nan), n),
        measure("least damping ratio", "", least_damping.to_numpy(), n),
        measure("frequency of the fastest", "Hz", hertz),
    ]
