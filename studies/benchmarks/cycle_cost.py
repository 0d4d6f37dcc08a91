"""What the level of a limit cycle costs, by balance and in time, and what it errs by.

Run:  python studies/benchmarks/cycle_cost.py [--scenes hoffmann belt coarse medium] [--png FILE]
      --harmonics 3 5 --steps 50 100    in place of those of the scene; steps a period

Of each scene one design has its mode's growth followed and its cycles found (`cold`, a cycle's
share of both), and four designs within 1 % of its friction begin with its loudest stable cycle:
balanced with two numbers of harmonics that tell the error (`warm`), with multipliers and without,
and run in time as one batch until levels have settled to 1 %. The reference is such a batch with
half the smallest step, settled to .01 %. CPU-s are of one thread, a design, without compilation;
errors are medians of the four designs. A line a setting is printed; one that fails is a line too.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import one_thread  # noqa: F401

# isort: split

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from cycle_truth import BRAKE, RANGES

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.cycle import Cycle, Search, cycle_near
from squealstudy.cycles.families import families
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.projection import Projection
from squealstudy.cycles.trials import state_of
from squealstudy.engine.cache import NewGaps, is_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.limit_cycles.designs import request
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.motion import Motion
from squealstudy.motion.outcome.settling import known_outcome
from squealstudy.motion.outcome.summary import summarise
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import Watch, simulate
from squealstudy.study.definition import parse_study

AWAY = np.array([-0.01, -0.005, 0.005, 0.01])
HARMONICS = {"hoffmann": (3, 5, 7, 11, 17), "belt": (5, 11, 25, 39, 59)}
OF_BRAKES = (3, 5, 7, 11)
STEPS, FINER = (50, 100, 200), 2  # a period; of the reference, times the finest
LONGEST, LOOKS = 1000, 50  # periods of a run, looks at it
ROWS = 200  # saved a period
SETTLED, REFERENCE = 1e-2, 1e-4  # to which levels settle
HOFFMANN = """
[model]
name = "hoffmann"
contact_law = "cubic"
[parameters]
k1 = 1.31e6
k2 = 1.356e6
contact_stiffness = 2.6e6
"contact.cubic_stiffness" = -5.4e17
normal_force = 1000.0
sliding_speed = 10.0
damping_ratio = 0.01
"""
BELT = """
[model]
name = "belt"
[parameters]
"contact.regularisation_speed" = 0.4
sliding_speed = 1.0
"""
# model, swept parameter and its value, mode, band
SMALL = {
    "hoffmann": (HOFFMANN, "friction", 0.6, 1, (100.0, 1000.0)),
    "belt": (BELT, "sliding_speed", 1.0, 1, (10.0, 1000.0)),
}
DESIGN, MODES = 20, {"coarse": 23, "medium": 23}


@dataclass(frozen=True)
class Scene:
    """A design and those near it.

    Attributes
    ----------
    name : str
    contacts : list of ContactOscillator
        The design itself first.
    band : (low, high)
        rad/s.
    mode : int
    """

    name: str
    contacts: list[ContactOscillator]
    band: tuple[float, float]
    mode: int

    def search(self, harmonics: int | None) -> Search:
        """What is looked for, with a number of harmonics."""
        return Search(harmonics, 1e-2, 2.0 * abs(self.contacts[0].point.speed), self.band[1])


def scene(name: str) -> Scene:
    """A scene by its name; brakes are a design of the truth set."""
    if name in SMALL:
        model, swept, value, mode, band = SMALL[name]
    else:
        truth = pd.read_csv(Path(__file__).with_name("cycle_truth.csv")).set_index("design")
        design = truth.loc[DESIGN, list(RANGES)].astype(float).to_dict()
        swept, mode, band = "friction", MODES[name], (500.0, 8e3)
        value = design.pop(swept)
        model = BRAKE.format(mesh=name).partition("friction = ")[0]
        model += "".join(f'"{key}" = {number}\n' for key, number in design.items())
    values = [value, *(value * (1.0 + AWAY)).tolist()]
    text = f'[study]\nname = "cost"\nkind = "limit_cycles"\n{model}'
    text += f'[[sweep]]\nparameter = "{swept}"\nvalues = {values}\n'
    text += f"[modes]\nband = {list(band)}\n[limit_cycles]\nfamilies = [{mode}]\n"
    plan = Plan(parse_study(text, Path("cost.toml")))
    for key, point in plan.structures.items():
        if not is_prepared(key):
            build_structure(build_task(plan, point, 1))
    asked = request(plan)
    contacts = [asked.contact(point, NewGaps())[1] for point in plan.tasks]
    return Scene(name, contacts, asked.band, mode)


def timed(work: Callable[[], object]) -> tuple[object, float]:
    """What it gives, and CPU-s; ConvergenceError among what it gives."""
    began = time.process_time()
    try:
        found = work()
    except ConvergenceError as error:
        found = error
    return found, time.process_time() - began


def cold(own: Scene, harmonics: int | None) -> list[Cycle]:
    """Cycles of the scene's mode family at the design itself."""
    found = families(own.contacts[0], own.band, [own.mode], 1e-9, own.search(harmonics))
    return [c for _, family in found.families for c in family.cycles]


def warm(contact: ContactOscillator, start: Cycle, search: Search) -> Cycle:
    """The cycle of a design near one of another design."""
    projection = Projection.on_harmonics_of(contact.oscillator, start.motion)
    return cycle_near(contact, projection, start.motion, search)


def unjudged(*_: object) -> Floquet:
    """In place of multipliers."""
    return Floquet(np.ones(1, complex), np.ones((1, 1), complex), np.ones(1), 1.0)


def in_time(own: Scene, start: Cycle, steps: int, tolerance: float) -> tuple[np.ndarray, float]:
    """Levels of the designs near in one batch, NaN where no level lasts; CPU-s a design."""
    period = 2 * np.pi / start.motion.omega
    every = max(1, steps // ROWS)
    settings = MotionSettings(
        LONGEST * period, period / steps, every, integrator=ExactFreeMotion(), tolerance=1e-6
    )
    q, v = state_of(start.motion)
    contacts = own.contacts[1:]
    points = [replace(contact.point, q0=q, v0=v) for contact in contacts]
    omega = own.contacts[0].system.frequencies
    sensed = np.flatnonzero((omega >= own.band[0]) & (omega <= own.band[1])) + 1
    system = replace(own.contacts[0].system, sensed=sensed)

    def judge(_: int, motion: Motion) -> str:
        return known_outcome(motion, settings.duration, tolerance)

    watch = Watch([settings.n_steps // LOOKS] * len(points), judge)
    began = time.process_time()
    motions = simulate(system, points, settings, watch)
    levels = [
        summarise(m).point.get("torque_rms", np.nan) if m.outcome == "ok" else np.nan
        for m in motions
    ]
    return np.array(levels, float), (time.process_time() - began) / len(points)


def measured(
    own: Scene, ladder: Sequence[int], steps_a_period: Sequence[int]
) -> Iterator[dict[str, object]]:
    """A row a setting."""
    cold(own, ladder[0])  # kernels are compiled
    known = [c for c in cold(own, None) if c.attracts]
    start = max(known, key=lambda c: c.levels["torque_rms"])
    in_time(own, start, steps_a_period[0], 0.1)
    reference, seconds = in_time(own, start, FINER * steps_a_period[-1], REFERENCE)
    yield {"method": "reference in time", "setting": FINER * steps_a_period[-1], "cpu_s": seconds}
    for steps in steps_a_period:
        levels, seconds = in_time(own, start, steps, SETTLED)
        yield _row("in time, steps a period", steps, seconds, levels, reference)
    for harmonics in (*ladder, None):
        search, setting = own.search(harmonics), harmonics or "auto"
        found, seconds = timed(partial(cold, own, harmonics))
        cycles = found if isinstance(found, list) else []
        share = seconds / max(len(cycles), 1)
        yield {"method": "cold", "setting": setting, "cpu_s": share, "n_found": len(cycles)}
        for name, judged in (("warm", Projection.stability), ("warm, level alone", unjudged)):
            with patch.object(Projection, "stability", judged):
                pairs = [timed(partial(warm, c, start, search)) for c in own.contacts[1:]]
            cycles = [c for c, _ in pairs]
            levels = np.array(
                [c.levels["torque_rms"] if isinstance(c, Cycle) else np.nan for c in cycles]
            )
            told = [c.level_error for c in cycles if isinstance(c, Cycle)]
            seconds = float(np.median([s for _, s in pairs]))
            row = _row(name, setting, seconds, levels, reference)
            yield row | {"estimate": float(np.median(told)) if told else np.nan}


def _row(
    method: str, setting: object, seconds: float, levels: np.ndarray, reference: np.ndarray
) -> dict[str, object]:
    error = np.abs(levels / reference - 1.0)
    kept = np.isfinite(error)
    return {
        "method": method,
        "setting": setting,
        "cpu_s": seconds,
        "level_error": float(np.median(error[kept])) if kept.any() else np.nan,
        "n_found": int(kept.sum()),
    }


def drawn(rows: pd.DataFrame, path: Path) -> None:
    """Errors over CPU-s, a panel a scene."""
    names = list(dict.fromkeys(rows["scene"]))
    figure, panels = plt.subplots(1, len(names), figsize=(4.2 * len(names), 4.0), squeeze=False)
    marks = {
        "in time, steps a period": ("s-", "run in time: steps a period"),
        "warm": ("o-", "balance: harmonics"),
        "warm, level alone": ("o:", "the same without multipliers"),
    }
    for axes, name in zip(panels[0], names, strict=True):
        own = rows[(rows["scene"] == name) & rows["level_error"].notna()]
        for method, (mark, label) in marks.items():
            part = own[own["method"] == method]
            part = part[part["setting"] != "auto"]
            line = axes.plot(part["cpu_s"], 100 * part["level_error"], mark, label=label)[0]
            for _, row in part.iterrows():
                short = "" if row["n_found"] == len(AWAY) else f" ({row['n_found']} of {len(AWAY)})"
                axes.annotate(
                    f"{row['setting']}{short}",
                    (row["cpu_s"], 100 * row["level_error"]),
                    textcoords="offset points",
                    xytext=(4, 4),
                    fontsize=7,
                    color=line.get_color(),
                )
        axes.set(xscale="log", yscale="log", title=name, xlabel="CPU-s a design")
        axes.axhline(1.0, color="0.7", lw=0.8)
    panels[0][0].set_ylabel("error of the level [%]")
    panels[0][0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print a line a setting; draw them."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    names = [*SMALL, *MODES]
    parser.add_argument("--scenes", nargs="*", choices=names, default=names)
    parser.add_argument("--harmonics", type=int, nargs="+")
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="a period")
    parser.add_argument("--png", type=Path)
    arguments = parser.parse_args()
    rows = []
    for name in arguments.scenes:
        ladder = arguments.harmonics or HARMONICS.get(name, OF_BRAKES)
        for row in measured(scene(name), ladder, arguments.steps):
            rows.append({"scene": name, **row})
            print(
                " ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in rows[-1].values()),
                flush=True,
            )
    if arguments.png:
        drawn(pd.DataFrame(rows), arguments.png)


if __name__ == "__main__":
    main()
