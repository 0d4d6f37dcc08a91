"""Whether fitted growth rates have the true one within their bounds: random runs.

Run:  python studies/benchmarks/growth_coverage.py [--seed 1] [--share 1.0] [--brake]

300 runs of small models (Hoffmann's and Hulten's oscillators, the belt, all contact laws), kicked
by 1e-7 to 1e-2 m/s at 25 to 400 steps a period, and 40 of the coarse brake (--brake). The truth is
the growth rate of the complex mode. A fit is right where that lies within its 95 % bounds, or
outside by no more than 1e-4 of it. Prints a line a family; writes growth_coverage.csv to the
current directory. Small models take one CPU-minute.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd

from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers, silent
from squealstudy.kinds.transient.batch import batch_task
from squealstudy.kinds.transient.worker import solve_batch
from squealstudy.study.definition import parse_study

SMALL, BRAKE = 300, 40  # runs
CLOSE = 1e-4  # relative: agreement beside which bounds do not matter
STUDY = """
[study]
name = "coverage"
kind = "transient"
[model]
name = "{model}"
{options}
[parameters]
{values}
[modes]
band = {band}
[transient]
duration = {duration!r}
step = {step!r}
perturbation = {kick!r}
save_every = 0
{more}
"""
COLUMNS = (
    *("status", "class", "growth_method", "predicted_frequency_hz", "predicted_growth_rate"),
    *("growth_rate", "growth_rate_low", "growth_rate_high", "growth_rate_step_error"),
)


def small_studies(rng: np.random.Generator, count: int) -> Iterator[tuple[str, str]]:
    """Family and text of random studies of one run of a small model each."""
    for number in range(count):
        name = ("hoffmann", "hulten", "belt")[number % 3]
        zeta, options = 10 ** rng.uniform(-5, -1.3), ""
        values = {"damping_ratio": zeta}
        if name == "belt":
            values["sliding_speed"] = 0.5 * np.log(0.5 / zeta) * rng.uniform(0.4, 2.0)
            hz = 100.0
        elif name == "hoffmann":
            laws = ("bilateral", "exponential", "unilateral", "cubic", "power")
            options = f'contact_law = "{rng.choice(laws)}"'
            values["friction"] = rng.uniform(0.4, 1.1)
            values["sliding_speed"] = rng.uniform(0.05, 1.0)
            values["friction_law.static_ratio"] = rng.choice([1.0, 1.0, 1.2])
            hz = 220.0
        else:
            values["friction"] = rng.uniform(0.1, 0.6)
            values["sliding_speed"] = rng.uniform(0.05, 1.0)
            values["friction_law.static_ratio"] = rng.choice([1.0, 1.0, 1.2])
            hz = 90.0
        text = "\n".join(f'"{k}" = {float(v)!r}' for k, v in values.items())
        yield (
            name,
            STUDY.format(
                model=name,
                options=options,
                values=text,
                band=[1.0, 2000.0],
                duration=float(rng.uniform(20, 400) / hz),
                step=float(1 / hz / 10 ** rng.uniform(1.4, 2.6)),
                kick=float(10 ** rng.uniform(-7, -2)),
                more="",
            ),
        )


def brake_studies(rng: np.random.Generator, count: int) -> Iterator[tuple[str, str]]:
    """The same of the coarse brake, in a small basis."""
    for _ in range(count):
        values = {
            "damping_ratio": 10 ** rng.uniform(-4, -2),
            "stiffness_damping": 1.5e-7,
            "friction": rng.uniform(0.3, 0.65),
            "pressure": rng.uniform(4e5, 3e6),
        }
        text = "\n".join(f'"{k}" = {float(v)!r}' for k, v in values.items())
        yield (
            "brake",
            STUDY.format(
                model="disc_brake",
                options='mesh = "coarse"\ncontact_points = 2',
                values=text,
                band=[500.0, 8000.0],
                duration=float(rng.uniform(0.02, 0.08)),
                step=float(10 ** rng.uniform(-5.7, -5.2)),
                kick=float(10 ** rng.uniform(-5, -2)),
                more="modes_below = 1e4",
            ),
        )


def solved(text: str) -> dict[str, object]:
    """The row of a study of one design point, nothing written."""
    plan = Plan(parse_study(text, Path("growth_coverage.py")))
    build_structures(plan, Workers())
    plan.kind.prepare(plan, silent)
    (row,) = solve_batch(batch_task(plan, (plan.tasks[0],))).rows
    return {name: row[name] for name in COLUMNS}


def coverage(seed: int, share: float = 1.0, *, brake: bool = False) -> pd.DataFrame:
    """A row a run: what was told, and whether it is right."""
    rng = np.random.default_rng([seed, int(brake)])
    make, count = (brake_studies, BRAKE) if brake else (small_studies, SMALL)
    texts = make(rng, max(1, round(share * count)))
    found = pd.DataFrame([{"family": name, "text": text} | solved(text) for name, text in texts])
    return judged(found)


def judged(found: pd.DataFrame) -> pd.DataFrame:
    """With `told`, `inside`, `right` and the `width` of the bounds, relative to the growth."""
    true, rate = found["predicted_growth_rate"], found["growth_rate"]
    low, high = found["growth_rate_low"], found["growth_rate_high"]
    inside = (low <= true) & (true <= high)
    close = np.maximum(low - true, true - high) <= CLOSE * true.abs()
    width = (found["growth_rate_high"] - found["growth_rate_low"]) / true.abs()
    return found.assign(told=rate.notna(), inside=inside, right=close, width=width)


def summary(found: pd.DataFrame) -> str:
    """Runs, how many have a rate, in how many it is right, median width of the bounds."""
    told = found[found["told"].to_numpy()]
    if not len(told):
        return f"{len(found)} runs, no rate"
    off = (told["growth_rate"] / told["predicted_growth_rate"] - 1).abs()
    return (
        f"{len(found)} runs, {len(told)} with a rate: right {100 * told['right'].mean():.1f} %, "
        f"inside the bounds {100 * told['inside'].mean():.1f} %, median width "
        f"{100 * told['width'].median():.2g} %, largest error {100 * off.max():.2g} %"
    )


def main() -> None:
    """Print the figures of all families."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--brake", action="store_true", help="the brake alone")
    given = parser.parse_args()
    found = coverage(given.seed, given.share, brake=given.brake)
    for name, own in found.groupby("family"):
        print(f"{name}: {summary(own)}")
    print(f"all: {summary(found)}")
    found.drop(columns="text").to_csv("growth_coverage.csv", index=False)


if __name__ == "__main__":
    main()
