"""Table of truth of the classes of time runs: each run against one ten times longer.

Run:  python studies/benchmarks/class_truth.py [--jobs 2] [--seed 5] [--share 1.0] [--length 1.0]

Rules were tuned on seeds 1, 2, 7 and on the belts of 8, looked at with 3, 5 and 10: others judge.
A share of the runs takes that share of the time: all 200 take about 13 CPU-minutes. `--length`
makes runs shorter, to try it: they then say little.

Random designs of the belt, of Hoffmann's oscillator and of the coarse brake in a small basis, on
both sides of onsets and folds, kicked a little and much, at damping ratios of 1e-5 to 1e-2. Each is
integrated for ten durations; the first of them is the run that is judged, the whole is the truth.
The durations hold 600 periods of the belt, 1,200 of Hoffmann's oscillator, some 500 of the brake.
`growing` is right where the whole lasts, that is, is no `stable` one. Runs whose whole is undecided
too have no truth and are told apart, as failed ones are. Prints a confusion table a family, what is
wrong and, last, the shares of all; writes class_truth.csv and .parquet to the current directory.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd

from squealstudy.engine.cache import NewGaps
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers, silent
from squealstudy.kinds.transient.batch import batch_task
from squealstudy.kinds.transient.starts import set_up
from squealstudy.kinds.transient.worker import integrate
from squealstudy.models.operating import (
    REGULARISATION_SHARE,
    REGULARISATION_SPEED,
)
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.energies import moving_energy
from squealstudy.motion.outcome.verdict import run_verdict
from squealstudy.motion.system import MotionPoint
from squealstudy.study.definition import parse_study
from squealstudy.study.design import DesignPoint
from squealstudy.wording import (
    FAILED,
    GROWING,
    LASTING,
    UNDECIDED,
)

LONGER = 10  # times, the run that is the truth
BATCH = 8
STUDY = """
[study]
name = "{name}"
kind = "transient"
[model]
{model}
{sweeps}
[design]
type = "zip"
[modes]
band = {band}
[transient]
duration = {duration}
step = {step}
perturbation = {kick}
save_every = 0
{more}
"""
SWEEP = """
[[sweep]]
parameter = "{name}"
values = {values}
"""


def _sliding(speed: np.ndarray) -> dict[str, np.ndarray]:
    """Each run regularises friction as a study of its own does, not as the slowest of all."""
    return {"sliding_speed": speed, REGULARISATION_SPEED.name: REGULARISATION_SHARE * speed}


@dataclass(frozen=True)
class Family:
    """Random designs of one model.

    Attributes
    ----------
    kicks : tuple of float
        m/s; as many runs of each.
    duration : float
        Of the runs that are judged, s.
    count : int
        Runs in all.
    """

    name: str
    model: str
    band: str
    kicks: tuple[float, ...]
    duration: float
    step: float
    count: int
    more: str = ""

    def designs(self, rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
        """Values (count,) of each parameter."""
        zeta = 10 ** rng.uniform(-5, -2, count)
        if self.name == "belt":  # stable above `onset`; folds lie up to twice as high
            onset = 0.5 * np.log(0.5 / zeta)
            near, slow = onset * rng.uniform(0.7, 2.2, count), rng.uniform(0.3, 2.0, count)
            speed = np.where(rng.random(count) < 0.75, near, slow)
            return {"damping_ratio": zeta, **_sliding(speed)}
        if self.name == "hoffmann":  # flutter above 0.75; falling friction makes it subcritical
            return {
                "damping_ratio": zeta,
                "friction": rng.uniform(0.5, 1.0, count),
                **_sliding(rng.uniform(0.05, 0.4, count)),
                "friction_law.static_ratio": np.where(rng.random(count) < 0.5, 1.0, 1.3),
            }
        return {
            "damping_ratio": 10 ** rng.uniform(-5, -2, count),
            "friction": rng.uniform(0.2, 0.6, count),
            "caliper.modes[7].frequency_scale": rng.uniform(1.0, 1.8, count),
        }


BELT = Family("belt", 'name = "belt"', "[10.0, 1000.0]", (1e-3, 0.3, 3.0, 8.0), 3.0, 1e-4, 80)
HOFFMANN = Family(
    "hoffmann", 'name = "hoffmann"', "[10.0, 1000.0]", (1e-3, 3e-2, 0.3, 2.0), 6.0, 1e-4, 80
)
BRAKE = Family(
    "brake",
    'name = "disc_brake"\nmesh = "coarse"\ncontact_points = 2\n[parameters]\n'
    "stiffness_damping = 1.5e-7",
    "[500.0, 8000.0]",
    (1e-2, 0.1, 0.5, 1.0),
    0.3,
    4e-6,
    40,
    "modes_below = 6e3\npod_vectors = 30\npod_step = 2e-6\npod_duration = 0.02",
)
FAMILIES = {f.name: f for f in (BELT, HOFFMANN, BRAKE)}


def plans(family: Family, seed: int, share: float = 1.0) -> list[Plan]:
    """One study a kick, each run `LONGER` times its duration."""
    rng = np.random.default_rng([seed, list(FAMILIES).index(family.name)])
    count = max(1, round(share * family.count / len(family.kicks)))
    return [_plan(family, kick, family.designs(rng, count)) for kick in family.kicks]


def _plan(family: Family, kick: float, designs: dict[str, np.ndarray]) -> Plan:
    sweeps = "".join(SWEEP.format(name=n, values=v.tolist()) for n, v in designs.items())
    text = STUDY.format(
        name=family.name,
        model=family.model,
        sweeps=sweeps,
        band=family.band,
        duration=LONGER * family.duration,
        step=family.step,
        kick=kick,
        more=family.more,
    )
    return Plan(parse_study(text, Path("class_truth.py")))


def long_runs(plan: Plan) -> Iterator[tuple[DesignPoint, Motion]]:
    """Task and motion of each point that has a steady sliding state."""
    build_structures(plan, Workers())
    plan.kind.prepare(plan, silent)
    tasks = plan.tasks
    for first in range(0, len(tasks), BATCH):
        part = tuple(tasks[first : first + BATCH])
        task = batch_task(plan, part)
        found = [(point, set_up(task, point, NewGaps())) for point in part]
        ready = [(point, made) for point, made in found if isinstance(made, MotionPoint)]
        chosen, points = [point for point, _ in ready], [made for _, made in ready]
        yield from zip(chosen, integrate(task, chosen, points), strict=True)


def shortened(run: Motion) -> Motion:
    """The first of `LONGER` equal parts of a run."""
    rows = (len(run.times) - 1) // LONGER + 1
    history = {name: values[:rows] for name, values in run.history.items()}
    parts = {n: getattr(run, n)[:rows] for n in ("displacement", "velocity")}
    return replace(run, history=history, time=float(history["time"][-1]), **parts)


def judged(family: Family, seed: int, share: float = 1.0) -> pd.DataFrame:
    """A row a run: its design, its class and that of the run `LONGER` times as long."""
    found = [_judged_part(family, seed, share, part) for part in range(len(family.kicks))]
    return pd.concat(found, ignore_index=True)


def _judged_part(family: Family, seed: int, share: float, part: int) -> pd.DataFrame:
    """Those of one kick."""
    plan, rows = plans(family, seed, share)[part], []
    swept = [s.parameter for s in plan.study.definition.sweep]
    for task, run in long_runs(plan):
        found, truth = (_verdict(one) for one in (shortened(run), run))
        values = task.values  # noqa: PD011 - of a DesignPoint
        design = {n: v for n, v in values.items() if n in swept}
        rows.append(
            {"family": family.name, "kick": family.kicks[part]}
            | design
            | {"class": found[0], "undecided_until": found[1], "truth": truth[0]}
            | {"right": is_right(found[0], truth[0]), "n_unstable": run.point.growing.n_unstable}
        )
    return pd.DataFrame(rows)


def _verdict(run: Motion) -> tuple[str, float]:
    if run.outcome != "ok":
        return FAILED, np.nan
    found = run_verdict(run, moving_energy(run))
    return found.name, found.until


def is_right(name: str, truth: str) -> bool:
    """Whether a class agrees with that of the longer run; `growing` says that vibration lasts."""
    return name == truth or (name == GROWING and truth in LASTING)


def report(table: pd.DataFrame) -> str:
    """Confusion table and counts of the runs of one family, or of all; these are the last line."""
    known = table[~table["truth"].isin([UNDECIDED, FAILED])]
    decided = known[known["class"] != UNDECIDED]
    wrong = decided[~decided["right"]]
    open_ = known[known["class"] == UNDECIDED]
    apart = table[table["truth"] == UNDECIDED]
    early = int((apart["class"] != UNDECIDED).sum())
    failed = int((table["truth"] == FAILED).sum())
    lines = [pd.crosstab(table["class"], table["truth"]).to_string()]
    if len(wrong):
        lines.append(f"wrong:\n{wrong.dropna(axis=1, how='all').to_string()}")
    if len(open_):
        lines.append(f"undecided:\n{open_.dropna(axis=1, how='all').to_string()}")
    lines.append(
        f"apart: {len(apart)} undecided when {LONGER} times longer ({early} of them decided "
        f"before), {failed} failed"
    )
    share = 100 * len(open_) / max(len(known), 1)
    lines.append(
        f"{len(table)} runs, {len(known)} with a truth: {len(wrong)} wrong of {len(decided)} "
        f"decided; {len(open_)} undecided ({share:.1f} %)"
    )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--share", type=float, default=1.0, help="of the runs")
    parser.add_argument("--families", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    parser.add_argument("--length", type=float, default=1.0, help="times that of the runs")
    options = parser.parse_args()
    chosen = [FAMILIES[name] for name in options.families]
    families = [replace(f, duration=options.length * f.duration) for f in chosen]
    with ProcessPoolExecutor(options.jobs) as pool:
        parts = [
            [
                pool.submit(_judged_part, f, options.seed, options.share, k)
                for k in range(len(f.kicks))
            ]
            for f in families
        ]
        tables = []
        for family, tasks in zip(families, parts, strict=True):
            tables.append(pd.concat([task.result() for task in tasks], ignore_index=True))
            print(f"\n{family.name}\n{report(tables[-1])}", flush=True)
    table = pd.concat(tables, ignore_index=True)
    table.to_csv("class_truth.csv", index=False)
    table.to_parquet("class_truth.parquet", index=False)
    print(f"\nall\n{report(table)}")


if __name__ == "__main__":
    main()
