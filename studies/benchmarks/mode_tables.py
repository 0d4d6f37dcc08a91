"""What tables of complex modes say of many points, against numpy: queries, weights, maps.

Held against the roots of each design point by numpy (`mode_columns.py`): the ranking within a
query, the least value from which on any mode is unstable, shares in bins with weights, the
probability of instability, and the nodes of a boundary design over the same ranges.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from mode_cases import BAND_HZ, HZ, Family

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.study.definition import parse_study
from squealstudy.tables.robustness import robust_table

GROWS = 1e-6  # damping ratio of a root that grows for certain
CLOSE = 1e-5  # damping ratio of a root of which neither can be said
LEVELS = 2  # of a boundary design: each cell is halved so often
BINS_HZ = (1.0, 100.0, 200.0, 400.0)
BINS = (1e-3, 10.0, 1e9)  # of growth, 1/s


@dataclass(frozen=True)
class Told:
    """A number of a table, the truth, whether it is right, and whether the table doubts it."""

    table: str
    column: str
    told: float
    truth: float
    right: bool
    flagged: bool = False
    at: str = ""


def growing_roots(family: Family, x: float, y: float) -> tuple[np.ndarray, bool]:
    """Growing oscillating or real roots of the band, and whether one is too close to tell."""
    lam = family.roots(x, y)
    size = np.abs(lam)
    lam = lam[(size >= BAND_HZ[0] * HZ) & (size <= BAND_HZ[1] * HZ)]
    zeta = -lam.real / np.abs(lam)
    return lam[zeta < -GROWS], bool((np.abs(zeta) < CLOSE).any())


def table_numbers(family: Family, results: Results) -> Iterator[Told]:
    """Numbers of rankings, bins and probabilities of a study that is solved."""
    points, modes = results.points, results.modes
    y = points["y"] if "y" in points else pd.Series(0.0, points.index)
    found = [growing_roots(family, a, b) for a, b in zip(points["x"], y, strict=True)]
    grows = np.array([len(lam) > 0 for lam, _ in found])
    close = any(near for _, near in found)
    uncertain = bool((modes["stability"] == "uncertain").any()) or close
    yield from _ranking(results, found, grows, uncertain)
    weights = 1.0 + np.arange(len(points)) % 3
    table = results.occurrence(BINS_HZ, BINS, weights=weights)
    for row in table.itertuples():
        inside = [
            any(
                row.frequency_low_hz <= abs(v) / HZ < row.frequency_high_hz
                and row.level_low <= v.real < row.level_high
                for v in lam
                if v.imag > 0
            )
            for lam, _ in found
        ]
        share = float(weights[inside].sum() / weights.sum())
        at = f"{row.frequency_low_hz:g} Hz {row.level_low:g}"
        right = abs(row.share - share) < 1e-9
        yield Told("occurrence", "share", row.share, share, right, uncertain, at)
    robust = robust_table(points, modes).iloc[0]
    truth = float(grows.mean())
    right = abs(robust["probability"] - truth) < 1e-9
    yield Told("robust", "probability", robust["probability"], truth, right, uncertain)


def _ranking(
    results: Results, found: list[tuple[np.ndarray, bool]], grows: np.ndarray, uncertain: bool
) -> Iterator[Told]:
    """The ranking within a query: points that count, fastest growth, share of any mode."""
    points = results.points
    middle = float(points["x"].median())
    held = (points["x"] > middle).to_numpy()
    ranking = results.rank(by="growth", where=f"x > {middle!r}")
    largest = max(
        (lam.real.max() for (lam, _), h in zip(found, held, strict=True) if h and len(lam)),
        default=-np.inf,
    )
    told = float(ranking["max_growth_rate"].max()) if len(ranking) else -np.inf
    right = bool(abs(told - largest) <= 1e-6 * abs(largest)) or told == largest
    yield Told("ranking where", "max_growth_rate", told, largest, right, uncertain)
    if len(ranking):
        row = ranking.iloc[0]
        own = results.modes[np.isclose(results.modes["growth_rate"], told, rtol=1e-12)]
        right = row["kind"] != "mode" or bool((own["frequency_hz"] == row["frequency_hz"]).any())
        yield Told("ranking where", "frequency_hz", row["frequency_hz"], np.nan, right)
        right = int(row["points"]) == int(held.sum())
        yield Told("ranking where", "points", row["points"], held.sum(), right)
        most = float(ranking["unstable_share"].max())
        truth = float(grows[held].mean())
        yield Told("ranking where", "unstable_share", most, truth, most <= truth + 1e-9, uncertain)
    whole = results.rank(by="growth")
    tracked = whole[whole["kind"] == "mode"].drop_duplicates("family")
    together = tracked["family_points"] / tracked["points"]
    right = bool((together <= grows.mean() + 1e-9).all())
    yield Told("ranking", "family_points", together.max(), grows.mean(), right, uncertain)


def map_numbers(family: Family, text: str, folder: Path) -> Iterator[Told]:
    """Nodes of a boundary design over the ranges of a family with two parameters."""
    x, y = np.sort(family.x), np.sort(family.y)
    head = text.split("[[sweep]]")[0]
    sweeps = "".join(
        f'[[sweep]]\nparameter = "{n}"\nnum = {k}\n'
        f"start = {float(v[0])!r}\nstop = {float(v[-1])!r}\n"
        for n, v, k in (("x", x, 6), ("y", y, 3))
    )
    design = f'[design]\ntype = "boundary"\nlevels = {LEVELS}\n'
    rest = "[modes]" + text.split("[modes]")[1]
    path = folder / "map.toml"
    run_study(Plan(parse_study(head + sweeps + design + rest, path)), folder / "map", jobs=1)
    nodes = Results.open(folder / "map").nodes[0]
    wrong = 0
    for row in nodes.itertuples():
        lam, near = growing_roots(family, row.x, row.y)
        wrong += not near and (row.n_unstable > 0) != (len(lam) > 0)
    yield Told("map", "nodes", wrong, 0.0, wrong == 0, at=f"of {len(nodes)}")
