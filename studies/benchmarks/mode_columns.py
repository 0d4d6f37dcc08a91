"""Random studies of complex modes against numpy: in which state is which column false?

Run:  python studies/benchmarks/mode_columns.py [--seed 1] [--number 500] [--out mode_columns]

Each case (`mode_cases.py`) is a study file, run as a user runs it. Held against numpy: modes and
points (roots at each design point), onsets (zeros of the growth of roots that are followed in small
steps, by bisection), the ranking (shares of the same roots). Prints for each table how many numbers
were compared, how many are wrong, and how many of these are flagged: by an uncertain stability, an
ambiguous track, or an onset that is a bound. 500 cases take about 6 CPU-minutes.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from mode_cases import BAND_HZ, HZ, Family, random_family
from mode_tables import Told, map_numbers, table_numbers
from scipy.optimize import linear_sum_assignment

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.study.definition import parse_study

SUBSTEPS = 200  # a step of the design is followed in
ROUND_OFF = 1e-9  # of a modulus: what numpy's own roots may be wrong by
NEAR_ONSET = 1e-4  # of the range of x: to which onsets are refined
STABILITY_TOLERANCE = 1e-7  # of damping ratios, the default of [modes]
ON_AXIS = 1e-4  # damping ratio of a root that is turning
BEYOND = 1.5  # of the band's top: where a study looks for what grows too


def compared(family: Family) -> Iterator[Told]:
    """All numbers of a case."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        text = family.text(Path(folder))
        out = Path(folder) / "results"
        run_study(Plan(parse_study(text, Path(folder) / "case.toml")), out, jobs=1)
        results = Results.open(out)
        points, modes, onsets = results.points, results.modes, results.onsets
        ranking = results.rank()
        yield from table_numbers(family, results)
        if len(family.y) > 1:
            yield from map_numbers(family, text, Path(folder))
    if "y" not in points:
        points["y"] = 0.0
    yield from point_numbers(family, points, modes)
    paths = [followed(family, y) for y in sorted(family.y)]
    places = points.set_index("point_id")[["x", "y"]]
    yield from onset_numbers(family, onsets, modes.join(places, on="point_id"), paths)
    if len(family.y) == 1:
        yield from ranking_numbers(family, ranking, modes, paths[0])


def in_band(lam: np.ndarray, low: float = BAND_HZ[0], high: float = BAND_HZ[1]) -> np.ndarray:
    """Which roots have a modulus in a band [Hz]."""
    size = np.abs(lam) / HZ
    inside: np.ndarray = (size >= low) & (size <= high)
    return inside


def point_numbers(family: Family, points: pd.DataFrame, modes: pd.DataFrame) -> Iterator[Told]:
    """Roots, counts and what grows outside, at each design point."""
    by_point = dict(iter(modes.groupby("point_id")))
    for row in points.itertuples():
        at = f"x={row.x:g} y={row.y:g}"
        every = family.roots(row.x, row.y)
        lam = every[in_band(every)]
        own = by_point.get(row.point_id, modes.iloc[:0])
        yield Told("points", "n_modes", row.n_modes, len(lam), row.n_modes == len(lam), at=at)
        doubt = bool((own["stability"] == "uncertain").any())
        grows = int((-lam.real / np.abs(lam) < -1e-6).sum())
        near = bool((np.abs(lam.real / np.abs(lam)) < 1e-5).any())
        right = row.n_unstable == grows or near
        yield Told("points", "n_unstable", row.n_unstable, grows, right, doubt, at)
        beyond = every[in_band(every, BAND_HZ[1], BEYOND * BAND_HZ[1])]
        above = int((beyond.real > 1e-6 * np.abs(beyond)).sum())
        told = getattr(row, "n_unstable_above", np.nan)
        if not pd.isna(told):
            yield Told("points", "n_unstable_above", told, above, told == above, at=at)
        growth, frequency = own["growth_rate"].to_numpy(), own["frequency_hz"].to_numpy()
        error = own["error_estimate"].to_numpy()
        cost = np.hypot(growth[:, None] - lam.real, HZ * frequency[:, None] - np.abs(lam))
        for i, j in zip(*linear_sum_assignment(cost), strict=True):
            allowed = 2.0 * error[i] + ROUND_OFF * abs(lam[j])
            yield Told("modes", "root", growth[i], lam[j].real, cost[i, j] <= allowed, at=at)


def followed(family: Family, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Values of x (k,) in small steps and all oscillating roots there (k, m), each one a path.

    Rows of the design's own values are among them.
    """
    x = np.sort(family.x)
    steps = [np.linspace(a, b, SUBSTEPS + 1) for a, b in itertools.pairwise(x)]
    fine = np.unique(np.concatenate(steps))
    paths, before, slope = [], None, 0.0
    for value in fine:
        lam = family.roots(value, y)
        lam = np.concatenate([lam, np.full(2 * len(family.C) - len(lam), np.nan)])
        if before is None:
            before = lam
        else:
            expected = before + slope
            distance = np.abs(expected[:, None] - lam)
            worst = np.nanmax(distance, initial=1.0)
            _, order = linear_sum_assignment(np.nan_to_num(distance, nan=10.0 * worst))
            slope = np.nan_to_num(lam[order] - before)
            before = lam[order]
        paths.append(before)
    return fine, np.array(paths)


def crossings(
    family: Family, y: float, path: tuple[np.ndarray, np.ndarray]
) -> list[tuple[float, float]]:
    """Values of x at which a root of the band turns: (x, frequency [Hz]).

    Between two small steps the number of growing roots changes by one; which of two that merge is
    no matter. Two that turn within a step, in or out of each other's way, are not seen.
    """
    fine, _ = path
    counts = [growing(family, value, y) for value in fine]
    found = []
    for k in np.flatnonzero(np.diff(counts)):
        a, b = float(fine[k]), float(fine[k + 1])
        for _ in range(60):
            middle = (a + b) / 2
            a, b = (middle, b) if growing(family, middle, y) == counts[k] else (a, middle)
        lam = family.roots((a + b) / 2, y)
        lam = lam[lam.imag > 0]
        nearest = lam[np.argmin(np.abs(lam.real))] if len(lam) else 0.0
        if abs(nearest.real) < ON_AXIS * abs(nearest) and in_band(np.array([nearest]))[0]:
            found.append(((a + b) / 2, abs(nearest) / HZ))
    return found


def growing(family: Family, x: float, y: float) -> int:
    """Number of oscillating roots that grow by more than the study's tolerance."""
    lam = family.roots(x, y)
    return int(((lam.real > STABILITY_TOLERANCE * np.abs(lam)) & (lam.imag > 0)).sum())


def onset_numbers(
    family: Family,
    onsets: pd.DataFrame,
    modes: pd.DataFrame,
    paths: list[tuple[np.ndarray, np.ndarray]],
) -> Iterator[Told]:
    """Onsets that are told against crossings, and crossings against what is told."""
    ambiguous = set(modes.loc[modes["track_ambiguous"].astype(bool), "track"])
    unsure = (onsets["status"].isin(["first_seen", "bracketed", "broken"])).to_numpy(bool)
    for y, path in zip(sorted(family.y), paths, strict=True):
        true = crossings(family, y, path)
        own = onsets[np.isclose(onsets["y"], y)] if "y" in onsets else onsets
        span = np.ptp(family.x)
        for row in own.itertuples():
            flagged = row.track in ambiguous
            at = f"y={y:g} track {row.track} {row.status}"
            if row.status in ("refined", "cubic"):
                near = min((t[0] for t in true), key=lambda t: abs(t - row.onset), default=np.nan)
                error = abs(near - row.onset)
                right = bool(error <= 1.001 * row.error_estimate + 1e-12)
                yield Told("onsets", f"onset {row.status}", row.onset, near, right, flagged, at)
            elif row.status in ("first_seen", "bracketed"):
                yield from _upper_bound(family, y, row, true, flagged)
        found = own["onset"].to_numpy()
        x = np.sort(family.x)
        for exact, hz in true:
            k = int(np.searchsorted(x, exact)) - 1
            within = [t for t in true if x[k] <= t[0] <= x[k + 1]]
            if len(within) > 1:  # in and out between two points: no point can tell
                continue
            near = np.abs(found - exact).min(initial=np.inf)
            bounded = own[(own["bracket_low"] <= exact) & (own["bracket_high"] >= exact)]
            right = bool(near <= NEAR_ONSET * span) or bool(len(bounded))
            at = f"y={y:g} {hz:.1f} Hz between {x[k]:g} and {x[k + 1]:g}"
            seen = bool(unsure.any()) or bool(ambiguous)
            yield Told("onsets", "missing", np.nan, exact, right, seen, at)


def _upper_bound(
    family: Family, y: float, row: Any, true: list[tuple[float, float]], flagged: bool
) -> Iterator[Told]:
    """An onset told as "at most": its value, the mode that grows there, and that a root turned.

    `first_seen`: no mode of this track is before; a root of the band turned at or below the value,
    or grew from the first value on, or came into the band by its frequency. `bracketed`: none at
    the point before has damping; a root turned in the bracket, or at its lower end.
    """
    at = f"y={y:g} track {row.track} {row.status}"
    value = float(row.onset)
    right = value == row.bracket_high
    yield Told("onsets", f"{row.status} value", value, row.bracket_high, right, flagged, at)
    lam = family.roots(row.bracket_high, y)
    own = lam[np.argmin(np.abs(np.abs(lam) / HZ - row.frequency_hz))] if len(lam) else 0.0
    right = own.real > 0.0 and abs(abs(own) / HZ - row.frequency_hz) < 1e-6 * row.frequency_hz
    yield Told(
        "onsets", f"{row.status} mode", row.frequency_hz, abs(own) / HZ, bool(right), flagged, at
    )
    first = float(np.min(family.x))
    low = first if row.status == "first_seen" else float(row.bracket_low)
    slack = 1e-6 * float(np.ptp(family.x))
    turned = any(low - slack <= t[0] <= value + slack for t in true)
    before = family.roots(low, y)
    grew = bool((before.real > -1e-6 * np.abs(before)).any())  # without damping from there on
    before = family.roots(np.sort(family.x)[np.searchsorted(np.sort(family.x), value) - 1], y)
    entered = bool((~in_band(before) & (before.real > 0)).any())
    right = turned or grew or entered
    yield Told("onsets", row.status, value, np.nan, right, flagged, at)


def ranking_numbers(
    family: Family,
    ranking: pd.DataFrame,
    modes: pd.DataFrame,
    path: tuple[np.ndarray, np.ndarray],
) -> Iterator[Told]:
    """Shares of the points at which each mode is unstable, largest first, and largest growths."""
    fine, lam = path
    rows = np.searchsorted(fine, np.sort(family.x) - 1e-12)
    here = lam[rows]
    with np.errstate(invalid="ignore"):
        grows = (here.real > 1e-6 * np.abs(here)) & in_band(here) & (here.imag > 0)
    shares = grows.mean(axis=0)
    growth = np.where(grows, here.real, -np.inf).max(axis=0)[shares > 0]
    shares = shares[shares > 0]
    own = ranking[ranking["kind"] == "mode"] if len(ranking) else ranking
    ambiguous = set(modes.loc[modes["track_ambiguous"].astype(bool), "track"])
    flagged = bool(ambiguous & set(own["track"])) if len(own) else bool(ambiguous)
    told = np.sort(own["unstable_share"].to_numpy(float)) if len(own) else np.zeros(0)
    right = len(told) == len(shares) and bool(np.allclose(told, np.sort(shares)))
    yield Told("ranking", "unstable_share", told.sum(), shares.sum(), right, flagged, f"{told}")
    if len(own):
        fastest = float(own["max_growth_rate"].max())
        true = float(growth.max(initial=-np.inf))
        right = abs(fastest - true) <= 1e-6 * abs(true)
        yield Told("ranking", "max_growth_rate", fastest, true, right, flagged)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=500, help="of cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--out", type=Path, default=Path("mode_columns"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    begun, path = time.process_time(), options.out / f"numbers_{options.seed}.csv"
    path.unlink(missing_ok=True)
    for k in range(options.first, options.first + options.number):
        family = random_family(options.seed, k)
        try:
            told = list(compared(family))
        except Exception as error:
            told = [
                Told(
                    "study",
                    "study",
                    np.nan,
                    np.nan,
                    False,
                    at=f"{type(error).__name__}: {error}"[:200],
                )
            ]
        rows = pd.DataFrame({"case": k, "sort": family.sort, **asdict(t)} for t in told)
        rows.to_csv(path, mode="a", header=not path.exists(), index=False)
        for t in told:
            if not t.right:
                print(
                    f"{k} {family.sort}{' (flagged)' if t.flagged else ''}: {t.table}.{t.column} "
                    f"told {t.told:.9g}, true {t.truth:.9g} ({t.at})",
                    flush=True,
                )
    print(report(pd.read_csv(path)), f"{time.process_time() - begun:.0f} CPU-seconds", sep="\n")


def report(table: pd.DataFrame) -> str:
    """Numbers, wrong ones and flagged ones of each column; studies with either."""
    wrong = ~table["right"]
    table = table.assign(unflagged=wrong & ~table["flagged"], doubted=wrong & table["flagged"])
    shown = table.groupby(["table", "column"]).agg(
        numbers=("right", "size"), wrong=("unflagged", "sum"), flagged=("doubted", "sum")
    )
    cases = table.groupby("case")[["unflagged", "doubted"]].any()
    wrong_ones, doubted = cases["unflagged"], cases["doubted"] & ~cases["unflagged"]
    return (
        f"{shown.to_string()}\n{len(cases)} studies: {wrong_ones.sum()} with a wrong number that "
        f"nothing flags, {doubted.sum()} with flagged ones"
    )


if __name__ == "__main__":
    main()
