"""Verdicts and levels of limit cycles against the truth set, which is of runs in time alone.

Run:  python studies/benchmarks/cycle_verdicts.py [--designs 3 5 20] [--modes 2] [--in-time]
      python studies/benchmarks/cycle_verdicts.py --mesh medium
      python studies/benchmarks/cycle_verdicts.py --thresholds --designs 20 79
      python studies/benchmarks/cycle_verdicts.py --nearby 0.05
      python studies/benchmarks/cycle_verdicts.py --modes 99 --window 500 8000 --designs 3 20

Of each design of `cycle_truth.csv` (`cycle_truth_medium.csv`) the modes of the band that grow
fastest or decay slowest between 2.9 and 5.3 kHz, where this brake squeals (`--window`), are
followed as by a study of limit cycles. A design has the verdict of these families alone, those
undecided after a run in time, and the level of the loudest stable cycle or run that lasts. A line a
family is printed as it is found. With `--thresholds` runs begin at .9 and 1.1 of the unstable cycle
of every family that has a threshold. With `--nearby` a design away by that share of the range of
every parameter is followed first, and its silent curves serve the design itself; the seconds are
those of the design itself. With `--in-time` those without an unstable mode are run in time as the
proof of a design study runs them instead, today's design being that of the same friction and
pressure, and that of the nominal ones.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from cycle_truth import BRAKE, NOMINAL, RANGES, swept

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.families import families
from squealstudy.cycles.kicked import decided_in_time
from squealstudy.cycles.trials import DECAYS, LASTS, Trials, state_of
from squealstudy.cycles.verdicts import Family, Followed
from squealstudy.engine.cache import NewGaps, is_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.kinds.design.in_time import ELSEWHERE, TODAY, runs_in_time
from squealstudy.kinds.limit_cycles.designs import CyclesRequest, request
from squealstudy.root_pairs import angular_band
from squealstudy.study.definition import parse_study
from squealstudy.study.design import DesignPoint
from squealstudy.wording import SQUEALS, VERDICTS

WINDOW = (2.9e3, 5.3e3)  # Hz
BESIDE = 0.9, 1.1  # times the motion of an unstable cycle
PERIODS = 4000  # of such a run, the longest
TRUTH = {
    "coarse": Path(__file__).with_name("cycle_truth.csv"),
    "medium": Path(__file__).with_name("cycle_truth_medium.csv"),
}


def designs(truth: pd.DataFrame, mesh: str) -> Iterator[tuple[CyclesRequest, DesignPoint]]:
    """The designs, and what is asked of each, in the basis of the runs in time."""
    text = '[study]\nname = "verdicts"\nkind = "limit_cycles"\n'
    text += BRAKE.format(mesh=mesh) + swept(truth[[*RANGES]])
    plan = Plan(parse_study(text, Path("verdicts.toml")))
    for key, point in plan.structures.items():
        if not is_prepared(key):
            build_structure(build_task(plan, point, 1))
    asked = request(plan)
    yield from ((asked, point) for point in list(plan.tasks)[: len(truth)])


def nearby(
    design: DesignPoint, asked: CyclesRequest, away: float, number: int
) -> ContactOscillator:
    """A design that is away from one by a share of all ranges, to a side drawn for each."""
    side = np.random.default_rng(number).choice([-1.0, 1.0], len(RANGES))
    moved = {}
    for (name, (low, high)), sign in zip(RANGES.items(), side, strict=True):
        step, value = sign * away * (high - low), design.values[name]  # noqa: PD011 - no pandas
        moved[name] = value + step if low <= value + step <= high else value - step
    values = {**design.values, **moved}  # noqa: PD011
    return asked.contact(design.with_values(values), NewGaps())[1]


def run_in_time(truth: pd.DataFrame, mesh: str) -> None:
    """A line a design: its truth, whether all runs decay, what each came to, seconds."""
    scales = {name: 1.0 for name in RANGES if name.endswith("frequency_scale")}
    silent = truth[truth["truth"] != "squeals"]
    for (number, design), (asked, point) in zip(
        silent.iterrows(), designs(silent, mesh), strict=True
    ):
        began = time.process_time()
        today = point.with_values({**point.values, **scales})  # noqa: PD011 - no pandas
        starts = {TODAY: today, ELSEWHERE: today.with_values({**today.values, **NOMINAL})}  # noqa: PD011
        _, runs = runs_in_time(point, starts, asked, NewGaps())
        decayed = sum(run.outcome == DECAYS for run in runs)
        print(
            f"{number}: {design['truth']} | {decayed} of {len(runs)} decay; "
            f"{'; '.join(run.text for run in runs)}; {time.process_time() - began:.1f} CPU-s",
            flush=True,
        )


def tried(contact: ContactOscillator, family: Family) -> str:
    """What runs from beside a threshold come to."""
    assert family.threshold is not None
    assert family.loudest is not None
    unstable, stable = family.threshold, family.loudest
    trials = Trials(contact, stable.motion, unstable.motion, PERIODS)
    ends = trials.outcomes([state_of(unstable.motion, factor) for factor in BESIDE])
    told = (f"{factor:g} of it {end}" for factor, end in zip(BESIDE, ends, strict=True))
    return (
        f"{unstable.levels['energy']:.3g} J, {unstable.levels['contact_velocity']:.3g} m/s "
        f"+- {100 * unstable.velocity_error:.2g} %; {', '.join(told)}"
    )


def main() -> None:
    """A line a family: the design's truth, the verdict, levels and frequencies, seconds."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--mesh", choices=list(TRUTH), default="coarse")
    parser.add_argument("--designs", type=int, nargs="*", help="numbers of the truth set")
    parser.add_argument("--modes", type=int, default=6, help="families of a design")
    parser.add_argument("--window", type=float, nargs=2, default=WINDOW, help="Hz, of the modes")
    parser.add_argument("--thresholds", action="store_true", help="tried in time")
    parser.add_argument("--nearby", type=float, help="share of all ranges")
    parser.add_argument("--in-time", action="store_true", help="runs in place of families")
    arguments = parser.parse_args()
    mesh = arguments.mesh
    truth = pd.read_csv(TRUTH[mesh]).set_index("design")
    truth = truth.loc[arguments.designs] if arguments.designs else truth
    if arguments.in_time:
        run_in_time(truth, mesh)
        return
    band = angular_band((500.0, 8e3))
    for (number, design), (asked, point) in zip(
        truth.iterrows(), designs(truth, mesh), strict=True
    ):
        _, contact = asked.contact(point, NewGaps())
        lam, _ = contact.oscillator.steady_modes(band[1])
        lam = lam[(lam.imag > 0) & (np.abs(lam) >= band[0]) & (np.abs(lam) <= band[1])]
        hz = lam.imag / (2 * np.pi)
        window = np.flatnonzero((hz > arguments.window[0]) & (hz < arguments.window[1]))
        chosen = sorted((window[np.argsort(-lam[window].real)][: arguments.modes] + 1).tolist())
        speed = abs(contact.point.speed)
        search, near = Search(None, 1e-2, 2.0 * speed, band[1]), None
        if arguments.nearby:
            other = nearby(point, asked, arguments.nearby, number)
            near = families(other, band, chosen, 1e-9, search)._replace(name="another")
        began = time.process_time()
        found = families(contact, band, chosen, 1e-9, search, near=near).families
        seconds = time.process_time() - began
        followed = [(mode, family) for mode, family in found if mode in chosen]
        for k, family in followed:
            print(
                f"{number}: {design['truth']}, {design['torque_rms']:.4g} N m, "
                f"{design['torque_line_hz']:.1f} Hz | mode {k}, {hz[k - 1]:.0f} Hz, "
                f"{lam[k - 1].real:.0f} 1/s: {family.verdict} ({family.reason}); "
                f"{len(family.curve)} points, {family.end}"
            )
            for cycle in family.cycles:
                multipliers = cycle.multipliers
                print(
                    f"   {cycle.levels['torque_rms']:.4g} N m +- {100 * cycle.level_error:.2g} % "
                    f"{cycle.motion.omega / 2 / np.pi:.2f} Hz, H {cycle.motion.harmonics}, "
                    f"{cycle.n_vectors} vectors, {cycle.status}, stable {multipliers.stable} "
                    f"{multipliers.instability} {multipliers.growth_rate:.1f} 1/s "
                    f"+- {multipliers.error / multipliers.period:.1f}",
                    flush=True,
                )
            if arguments.thresholds and family.threshold is not None:
                print(f"   threshold: {tried(contact, family)}", flush=True)
        began, unstable = time.process_time(), contact.point.growing.n_unstable > 0
        told = any(family.verdict == SQUEALS for _, family in followed)
        whole = Followed(followed, 0, unstable and not told)
        decided = decided_in_time(contact, whole, band, 2.0 * speed).families
        for k, family in decided:
            if family.run is not None:
                print(f"   mode {k}: {family.reason}; {family.run.torque_rms:.4g} N m")
        levels = [f.loudest.levels["torque_rms"] for _, f in decided if f.loudest]
        levels += [f.run.torque_rms for _, f in decided if f.run and f.run.outcome == LASTS]
        verdicts = [SQUEALS] * unstable + [f.verdict for _, f in decided]
        verdict = min(verdicts, key=VERDICTS.index)
        spent = time.process_time() - began
        loudest = max(levels, default=np.nan)
        print(
            f"{number}: {design['truth']}, {design['torque_rms']:.4g} N m | {verdict}, "
            f"{loudest:.4g} N m, families {seconds:.1f}, runs {spent:.1f} CPU-s",
            flush=True,
        )


if __name__ == "__main__":
    main()
