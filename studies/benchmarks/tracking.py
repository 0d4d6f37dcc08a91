"""Wrong labels of modes followed over friction in coarse steps, against steps of 0.002.

Run:  python studies/benchmarks/tracking.py --mesh medium --steps 0.02 0.05 0.1 --pressure 12e5

All studies are solved exactly (dense), to a friction of 0.7. A mode of a coarse study is the mode
of the reference at the same friction whose root is nearest; its label is wrong where the reference
has another track there than at the point before. Changes at pairs that were flagged as ambiguous
are counted apart. `--no-refinement` leaves the steps as they are, `--fine` are those of the
reference, `--top` is that of the band in Hz.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd

import squealstudy
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.study.definition import parse_study

TOP = 0.7
STUDY = """
[study]
name = "tracking"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "{mesh}"
[parameters]
pressure = {pressure}
[[sweep]]
parameter = "friction"
start = 0.0
stop = {top}
num = {num}
[modes]
band = [500.0, {band_top}]
method = "dense"
reference_points = 0
refine_onsets = false
refine_tracking = {refine}
"""


def followed(arguments: argparse.Namespace, step: float, refine: bool) -> tuple[pd.DataFrame, dict]:
    """Modes of a study in steps with their friction, and how they were tracked."""
    text = STUDY.format(
        mesh=arguments.mesh,
        pressure=arguments.pressure,
        top=TOP,
        band_top=arguments.top,
        num=round(TOP / step) + 1,
        refine=str(refine).lower(),
    )
    with tempfile.TemporaryDirectory() as folder:
        plan = Plan(parse_study(text, Path("tracking.toml")))
        run_study(plan, Path(folder), jobs=arguments.jobs)
        results = squealstudy.open_results(folder)
        friction = results.points[["point_id", "friction"]]
        modes = results.modes.query("track > 0").merge(friction, on="point_id")
        facts = results.manifest["tracking"]
    modes["root"] = modes["growth_rate"] + 2j * np.pi * modes["frequency_hz"]
    return modes.sort_values("friction"), facts


def wrong_labels(modes: pd.DataFrame, reference: pd.DataFrame) -> tuple[int, int]:
    """Modes of a coarse study with another track of the reference than before, and flagged ones."""
    by_friction = {round(mu, 9): part for mu, part in reference.groupby("friction")}
    wrong = flagged = 0
    for _, track in modes.groupby("track"):
        before = None
        for mode in track.itertuples():
            there = by_friction[round(mode.friction, 9)]
            nearest = np.abs(there["root"].to_numpy() - mode.root).argmin()
            label = int(there["track"].to_numpy()[nearest])
            if before is not None and label != before:
                wrong += not mode.track_ambiguous
                flagged += bool(mode.track_ambiguous)
            before = label
    return wrong, flagged


def main() -> None:
    """Follow, compare, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", default="coarse")
    parser.add_argument("--pressure", type=float, default=12e5, help="Pa")
    parser.add_argument("--steps", type=float, nargs="+", default=[0.02, 0.05, 0.1])
    parser.add_argument("--fine", type=float, default=0.002)
    parser.add_argument("--top", type=float, default=8000.0, help="Hz")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--no-refinement", action="store_true")
    arguments = parser.parse_args()
    started = time.perf_counter()
    reference, facts = followed(arguments, arguments.fine, True)
    print(
        f"{arguments.mesh} brake, {arguments.pressure:g} Pa, steps of {arguments.fine:g}: "
        f"{len(reference)} modes in {reference['track'].nunique()} tracks, {facts}, "
        f"{time.perf_counter() - started:.0f} s",
        flush=True,
    )
    for step in arguments.steps:
        modes, facts = followed(arguments, step, not arguments.no_refinement)
        wrong, flagged = wrong_labels(modes, reference)
        print(
            f"step {step:g}: {len(modes)} modes, {wrong} wrong labels, {flagged} more among the "
            f"flagged; {facts}",
            flush=True,
        )


if __name__ == "__main__":
    main()
