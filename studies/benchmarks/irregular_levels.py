"""How often the 95 % bounds of an irregular cycle's level cover the mean of many runs.

Run:  python studies/benchmarks/irregular_levels.py --runs 40 --duration 0.4

The brake of studies/irregular_cycle.toml at pressures that differ by 1e-6 in all: a chaotic motion
tells them apart within milliseconds, and their levels are draws from one distribution. Bounds of
one run are those of its windows; of `--starts` runs, drawn at random, those of `pooled_interval`,
as work-precision studies with as many starts have them.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd

import squealstudy
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.motion.outcome.intervals import pooled_interval
from squealstudy.study.definition import parse_study

FILE = Path(__file__).parents[1] / "irregular_cycle.toml"
DRAWS = 4000
SWEEP = """
[[sweep]]
parameter = "pressure"
start = 4e5
stop = 4.000004e5
num = {runs}
"""


def levels(runs: int, duration: float) -> pd.DataFrame:
    """Points table of the runs."""
    text = re.sub(r"duration = \S+", f"duration = {duration}", FILE.read_text())
    plan = Plan(parse_study(text + SWEEP.format(runs=runs), FILE))
    with tempfile.TemporaryDirectory() as place:
        run_study(plan, Path(place), 1)
        return squealstudy.open_results(place).points


def report(points: pd.DataFrame, name: str, starts: int) -> None:
    """Coverage and mean half-width of a level, for one run and for pooled ones."""
    found = points[[name, f"{name}_low", f"{name}_high"]].to_numpy()
    mean, deviation = found[:, 0].mean(), found[:, 0].std(ddof=1)
    rng = np.random.default_rng(0)
    draws = [rng.choice(len(found), starts, replace=False) for _ in range(DRAWS)]
    pooled = np.array([pooled_interval(*found[draw].T) for draw in draws])
    print(f"{name}: mean {mean:.4g}, standard deviation of runs {100 * deviation / mean:.2f} %")
    for text, rows in (("one run", found), (f"{starts} runs", pooled)):
        covered = ((rows[:, 1] <= mean) & (rows[:, 2] >= mean)).mean()
        half = (rows[:, 2] - rows[:, 1]).mean() / 2 / mean
        print(f"  {text}: covers in {100 * covered:.1f} %, half-width {100 * half:.2f} %")


def main() -> None:
    """Print coverage of both levels."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--duration", type=float, default=0.4, help="of each run, s")
    parser.add_argument("--starts", type=int, default=4)
    arguments = parser.parse_args()
    points = levels(arguments.runs, arguments.duration)
    print(f"{len(points)} runs, classes {points['class'].value_counts().to_dict()}")
    for name in ("torque_rms", "torque_mean"):
        report(points, name, arguments.starts)


if __name__ == "__main__":
    main()
