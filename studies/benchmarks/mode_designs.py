"""Tables and verdicts of design studies of Hulten's model against brute force.

Run:  python studies/benchmarks/mode_designs.py [--seed 1] [--number 40]

Each case is a study file of two variables without limit cycles or runs in time. Held against
numpy: each solved point (unstable modes, least damping ratio), each design (cost, share, margin,
whether it meets the goal), the chosen design on a fine grid of frictions, its cost against the
least of a grid of designs, and that nothing is found only where no design of that grid meets the
goal with room to spare. A grid knows the least cost to a step of it alone.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from mode_tables import Told
from small_models import SmallModel, random_model

from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.face import read_study

GRID = 61  # designs of a variable
FINE = 41  # frictions between the least and the largest
CLOSE = 1e-9  # of damping ratios
DEARER = 0.05  # of the least cost: what the page of designs states
TEXT = """\
[study]
name = "designs"
kind = "design"
[model]
name = "hulten"
{parameters}
[[sweep]]
parameter = "friction"
values = [{frictions}]
{variables}
[modes]
band = [1.0, 1000.0]
[goal]
margin = {{damping_ratio = {margin}}}
cycles = 0
in_time = 0
"""


@dataclass(frozen=True, eq=False)
class DesignCase:
    """A study: the model, what may change (name, low, high, cost), where, and the margin."""

    model: SmallModel
    variables: tuple[tuple[str, float, float, float], ...]
    frictions: np.ndarray
    margin: float

    def text(self) -> str:
        """The study file."""
        units = {"frequency_1": " Hz", "frequency_2": " Hz"}
        variables = ""
        for name, low, high, cost in self.variables:
            ends = [f"{x!r}{units[name]}" for x in (low, high)] if name in units else [low, high]
            shown = ", ".join(f'"{x}"' if isinstance(x, str) else repr(x) for x in ends)
            variables += f'[[variable]]\nparameter = "{name}"\nbounds = [{shown}]\ncost = {cost}\n'
        values = {k: v for k, v in self.model.given.items() if k != "friction"}
        return TEXT.format(
            parameters=SmallModel("hulten", values).parameters(),
            frictions=", ".join(repr(float(mu)) for mu in self.frictions),
            variables=variables,
            margin=self.margin,
        )

    def damping(self, design: dict[str, float], mu: float) -> float:
        """Least damping ratio of the modes of a design (values of the variables)."""
        lam = self.model.roots(**design, friction=mu)
        return float((-lam.real / np.abs(lam)).min())

    def cost(self, design: dict[str, float]) -> float:
        """Of all changes."""
        return sum(
            c * abs(design[n] - self.model.given[n]) / (high - low)
            for n, low, high, c in self.variables
        )

    def least_cost(self, room: float) -> float:
        """Least cost on the grid of what exceeds the margin by `room` everywhere; inf for none."""
        axes = [
            self.model.given[n] + np.unique(np.append(np.linspace(low, high, GRID), 0.0))
            for n, low, high, _ in self.variables
        ]
        names = [v[0] for v in self.variables]
        designs = [dict(zip(names, (a, b), strict=True)) for a in axes[0] for b in axes[1]]
        fine = np.linspace(self.frictions.min(), self.frictions.max(), 9)
        for design in sorted(designs, key=self.cost):
            if all(self.damping(design, mu) >= self.margin + room for mu in fine[::-1]):
                return self.cost(design)
        return np.inf


def random_design(seed: int, number: int) -> DesignCase:
    """Case `number` of a seed."""
    rng = np.random.default_rng([seed, number])
    model = random_model(rng, "hulten")
    first = ("frequency_1", -float(rng.uniform(1, 12)), float(rng.uniform(1, 12)))
    other = (
        ("damping_ratio", 0.0, float(rng.uniform(0.005, 0.12)))
        if number % 2
        else ("frequency_2", -float(rng.uniform(1, 12)), float(rng.uniform(0, 12)))
    )
    costs = rng.uniform(0.5, 2.0, 2).tolist()
    frictions = np.sort(rng.uniform(0.05, 0.6, int(rng.integers(2, 5))))
    margin = float(rng.uniform(5e-4, 3e-3))
    return DesignCase(model, ((*first, costs[0]), (*other, costs[1])), frictions, margin)


def design_numbers(case: DesignCase, folder: Path) -> Iterator[Told]:
    """All numbers of the tables of a study of design, and its verdict."""
    path = folder / "designs.toml"
    path.write_text(case.text())
    run_study(read_study(path).plan(), folder / "designs", jobs=1)
    results = Results.open(folder / "designs")
    points, designs = results.points, results.table("designs")
    verdict = results.manifest["design_study"]
    names = [v[0] for v in case.variables]
    at = {}
    for row in points.to_dict("records"):
        here = {n: row[n] for n in names}
        least = case.damping(here, row["friction"])
        at[row["point_id"]] = least
        told = row["min_damping_ratio"]
        yield Told("design points", "min_damping_ratio", told, least, abs(told - least) < CLOSE)
        lam = case.model.roots(**here, friction=row["friction"])
        grows = int((lam.real > 1e-7 * np.abs(lam)).sum())
        close = abs(least) < 1e-6
        right = row["n_unstable"] == grows or close
        yield Told("design points", "n_unstable", row["n_unstable"], grows, right)
    for row in designs.to_dict("records"):
        yield from _design_row(case, row, points, at)
    yield from _verdict(case, designs, verdict)


def _design_row(
    case: DesignCase, row: dict, points: pd.DataFrame, at: dict[str, float]
) -> Iterator[Told]:
    design = {v[0]: row[v[0]] for v in case.variables}
    where = f"design {row['design']} {row['origin']}"
    cost = case.cost(design)
    yield Told("designs", "cost", row["cost"], cost, abs(row["cost"] - cost) < 1e-9, at=where)
    every = [case.damping(design, mu) for mu in case.frictions]
    own = points[points["design"] == row["design"]].drop_duplicates("friction")
    known = [at[i] for i in own["point_id"]]  # once for roots and for modes
    least = min(known, default=np.nan)
    right = bool(abs(row["min_damping_ratio"] - least) < CLOSE)
    told = row["min_damping_ratio"]
    yield Told("designs", "min_damping_ratio", told, least, right, at=where)
    right = abs(row["margin"] - (least - case.margin)) < CLOSE
    yield Told("designs", "margin", row["margin"], least - case.margin, right, at=where)
    told = row["n_unstable"]
    grows = sum(z < -1e-7 for z in known)
    yield Told("designs", "n_unstable", told, grows, told == grows, at=where)
    share = float(np.mean([z < -1e-7 for z in every]))
    told = row["unstable_share"]
    right = pd.isna(told) or abs(told - share) < 1e-9
    yield Told("designs", "unstable_share", told, share, bool(right), at=where)
    meets = min(every) >= case.margin
    if row["meets_margin"] is True:
        right = meets or min(every) > case.margin - CLOSE
        yield Told("designs", "meets_margin", 1.0, float(meets), right, at=where)


def _verdict(case: DesignCase, designs: pd.DataFrame, verdict: dict) -> Iterator[Told]:
    """The chosen design, or that there is none."""
    least, outcome = case.least_cost(0.0), verdict["outcome"]
    if outcome in ("met", "met_linear"):
        chosen = designs[designs["chosen"].astype(bool)].iloc[0]
        design = {v[0]: float(chosen[v[0]]) for v in case.variables}
        fine = np.linspace(case.frictions.min(), case.frictions.max(), FINE)
        worst = min(case.damping(design, mu) for mu in fine)
        right = worst >= case.margin - CLOSE
        yield Told("verdict", "margin between points", worst, case.margin, right, at=outcome)
        cheap = chosen["cost"] <= (1.0 + DEARER) * least + 1e-9
        yield Told("verdict", "cost", chosen["cost"], least, bool(cheap), at=outcome)
    else:
        roomy = case.least_cost(1e-4)
        right = not np.isfinite(roomy)
        yield Told("verdict", outcome, np.nan, roomy, right, outcome != "none_found", outcome)


def random_numbers(seed: int, number: int) -> Iterator[Told]:
    """All numbers of case `number` of a seed."""
    with tempfile.TemporaryDirectory() as folder:
        yield from design_numbers(random_design(seed, number), Path(folder))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=40, help="of cases")
    options = parser.parse_args()
    rows = []
    for k in range(options.number):
        for t in random_numbers(options.seed, k):
            rows.append({"case": k, **vars(t)})
            if not t.right:
                word = " (flagged)" if t.flagged else ""
                print(
                    f"{k} {t.table}.{t.column} told {t.told:.9g}, true {t.truth:.9g} "
                    f"({t.at}){word}",
                    flush=True,
                )
    table = pd.DataFrame(rows)
    wrong = ~table["right"].astype(bool)
    table = table.assign(wrong=wrong & ~table["flagged"], doubted=wrong & table["flagged"])
    print(table.groupby(["table", "column"])[["right", "wrong", "doubted"]].sum().to_string())


if __name__ == "__main__":
    main()
