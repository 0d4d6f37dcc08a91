"""What the choice of [fidelity] costs beside settings picked by hand, and how far each is off.

Run:  python studies/benchmarks/fidelity_costs.py studies/fidelity/low_band_scene.toml
[--points 2] [--rounds 2] [--only windows]

Chooses settings as a run does, in an empty cache; then measures in alternation, each round in an
empty cache of its own: that choice, the study without [fidelity], the rungs that fidelity knows
and settings that a user may pick (`fidelity_hand_picks.py`). Seconds are processor time of the
whole study on one core, from the fastest round: reductions, bases or training, and the design
points, of which `--points` are run (with windows all) and scaled to the study's number. Errors are
against the most accurate setting, at the points that an audit draws: complex modes at full order,
runs with all modes at the smallest step to the end; it is timed once and scaled. `--only` measures
some of the hand-picked settings; `--hybrid` holds runs against the hybrid model at one point.
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from fidelity_clock import Clock
from fidelity_hand_picks import hand_picks, most_accurate

from squealstudy.engine.cache import load_any
from squealstudy.engine.measurement import Measurement
from squealstudy.errors import SquealstudyError
from squealstudy.fidelity.choice import Choice
from squealstudy.fidelity.frequency_search import search_modes
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.fidelity.run import drawn_points
from squealstudy.fidelity.time_search import QUIET, search_runs
from squealstudy.paths import ENVIRONMENT
from squealstudy.study.definition import load_study

CHOICE, DEFAULT = "fidelity's choice", "without [fidelity]"


@dataclass
class Setting:
    """One way to run the study.

    Attributes
    ----------
    changes : mapping
        Of the file, dotted key -> value.
    seconds : list of float
        Of the whole study, a round each.
    """

    changes: Mapping[str, Any]
    seconds: list[float] = field(default_factory=list)
    error: float = np.nan
    n_coordinates: int = 0
    failure: str = ""

    @property
    def cost(self) -> float:
        """Seconds of the study, fastest round."""
        return min(self.seconds, default=np.inf)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fidelity", type=Path)
    parser.add_argument("--points", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--only", default="", help="hand-picked settings, a regular expression")
    parser.add_argument("--hybrid", action="store_true", help="the hybrid model too, at one point")
    options = parser.parse_args()
    with empty_cache():
        choice = chosen(fidelity_of(options))
    settings = {CHOICE: Setting(choice.chosen.changes), DEFAULT: Setting({})}
    picks = hand_picks(fidelity_of(options), choice.chosen.changes)
    settings |= {k: Setting(changes) for k, changes in picks.items() if re.search(options.only, k)}
    truth, points, truth_cost = reference(options, choice)
    for number in range(options.rounds):
        clock = Clock()
        with empty_cache():
            for label, setting in settings.items():
                measure(fidelity_of(options), setting, truth, points, clock)
                print(f"round {number + 1}: {label}", flush=True)
    tell(settings, fidelity_of(options).tolerance, truth_cost)
    if options.hybrid:
        tell_hybrid(options, choice, truth, points)


@contextmanager
def empty_cache() -> Iterator[None]:
    """A cache of its own, so that reductions and bases are made and timed."""
    before = os.environ.get(ENVIRONMENT)
    with tempfile.TemporaryDirectory() as directory:
        os.environ[ENVIRONMENT] = directory
        yield
    os.environ.pop(ENVIRONMENT)
    if before is not None:
        os.environ[ENVIRONMENT] = before


def fidelity_of(options: argparse.Namespace) -> FidelityStudy:
    study = load_study(options.fidelity)
    section = study.definition.fidelity.model_copy(update={"audit": options.points})
    definition = study.definition.model_copy(update={"fidelity": section})
    return FidelityStudy(replace(study, definition=definition), 1, lambda *progress: None)


def chosen(fidelity: FidelityStudy) -> Choice:
    """The choice, and what making it took beside what the run uses again."""
    started, began = time.process_time(), time.perf_counter()
    choice = search_runs(fidelity) if fidelity.in_time else search_modes(fidelity)
    spent, waited = time.process_time() - started, time.perf_counter() - began
    one = choice.chosen
    print(
        f"{fidelity.study.source.path.stem}: tolerance {fidelity.tolerance:g}, chosen: {one.text}"
    )
    print(f"estimated error {one.error:.1e}, {one.cost:.1f} s; {choice.reason}")
    plan = fidelity.variant(one.changes, None)
    kept = sum(sum(load_any(key).timings.values()) for key in plan.structures)
    print(
        f"choosing took {spent:.1f} s of the processor, {waited:.1f} s by the clock; of it the run "
        f"of {len(plan.tasks)} points uses again the reduction ({kept:.1f} s by the clock)\n",
        flush=True,
    )
    return choice


def reference(
    options: argparse.Namespace, choice: Choice
) -> tuple[Measurement, tuple[int, ...], float]:
    """The most accurate setting at the points, and its seconds for the whole study."""
    fidelity = fidelity_of(options)
    points = drawn_points(fidelity, 0)
    changes = most_accurate(fidelity, choice.chosen.changes)
    with empty_cache():
        made = fidelity.measure(changes, points)
        plan = fidelity.variant(changes, None)
    bad = [found for found in made.findings.values() if found["status"] != "ok"]
    if bad:
        raise SystemExit(f"the most accurate setting fails at a point: {bad[0]['message']}")
    return made, points, made.reduction_seconds + made.seconds * len(plan.tasks)


def measure(
    fidelity: FidelityStudy,
    setting: Setting,
    truth: Measurement,
    points: tuple[int, ...],
    clock: Clock,
) -> None:
    try:
        clock.shared(fidelity.variant(setting.changes, None))
        made = fidelity.measure(setting.changes, points)
    except SquealstudyError as error:
        setting.failure = str(error)
        return
    setting.seconds.append(clock.study_seconds(fidelity, setting.changes, made))
    setting.error = fidelity.error(made, truth)
    setting.n_coordinates = made.n_coordinates


def tell(settings: Mapping[str, Setting], tolerance: float, truth_cost: float) -> None:
    """The table, cheapest first, and the ratios of the choice."""
    print(f"\n{'s of the study':>14}  {'slowest':>8}  {'error':>8}  {'DOF':>5}  setting")
    for label, one in sorted(settings.items(), key=lambda item: item[1].cost):
        if one.failure:
            print(f"{'fails':>14}  {label}: {one.failure}")
            continue
        met = "" if one.error <= tolerance else "  (misses)"
        print(
            f"{one.cost:14.2f}  {max(one.seconds):8.2f}  {one.error:8.1e}  {one.n_coordinates:5d}"
            f"  {label}{met}"
        )
    print(f"{truth_cost:14.2f}  {'':8}  {0.0:8.1e}  {'':5}  most accurate, timed once and scaled")
    choice = settings[CHOICE]
    good = {k: s for k, s in settings.items() if k != CHOICE and s.error <= tolerance}
    if good:
        best = min(good, key=lambda label: good[label].cost)
        print(
            f"\ncost of the choice / cheapest other that meets {tolerance:g}: "
            f"{choice.cost / good[best].cost:.2f}  ({best})"
        )
    print(f"cost of the choice / most accurate: {choice.cost / truth_cost:.4f}")


def tell_hybrid(
    options: argparse.Namespace, choice: Choice, truth: Measurement, points: tuple[int, ...]
) -> None:
    """What the hybrid model takes, at the first point, and how far the others are from it."""
    fidelity, own = fidelity_of(options), dict(choice.chosen.changes)
    kept = {k: v for k, v in own.items() if k.startswith("model.") or k == "transient.step"}
    changes = {**QUIET, **kept, "transient.representation": "hybrid"}
    with empty_cache():
        made, found = fidelity.measure(changes, points[:1]), fidelity.measure(own, points[:1])
    seconds = made.reduction_seconds + made.seconds * len(fidelity.plan.tasks)
    off, least = (fidelity.point_error(m.findings["0"], made.findings["0"]) for m in (found, truth))
    print(
        f"hybrid at the chosen step, one point scaled: {seconds:.0f} s of the study; from it "
        f"differ the choice by {off:.1e}, the most accurate setting by {least:.1e}"
    )


if __name__ == "__main__":
    main()
