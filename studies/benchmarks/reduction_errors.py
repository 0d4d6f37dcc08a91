"""Estimated errors of complex modes held against full-order solutions of the same mesh.

Run:  python studies/benchmarks/reduction_errors.py [--cases light,law] [--rungs dense,sweep_basis]
      [--mesh coarse] [--top 2500] [--points 16] [--checked 4] [--jobs 1]

Each case is a study of scattered design points of another geometry, pressure, contact law or
damping. Some points, chosen at random, are solved at full order. Of modes with |zeta| < 5 % it is
told how many true errors lie within twice `error_estimate`, by how much the estimate exceeds them
(median, and what 90 % of the modes stay below), and the rank correlation of both. Errors below 100
times the round-off of the full-order root do not count. What full-order solutions add to the
estimates of a study (`reduction_widened`) is taken out: they are the judges here. Unstable modes
are missed where the study calls the mode stable, spurious where the full-order one is stable;
uncertain ones count as neither.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import MODES, Store
from squealstudy.kinds.complex_modes.full_order_check import (
    reference_roots,
)
from squealstudy.root_pairs import paired_with_full_order
from squealstudy.study.definition import load_study

NEUTRAL = 1e-7  # stability_tolerance of the studies
CASES = {
    "nominal": ({}, {"friction": (0.0, 0.7), "pressure": (2e5, 30e5)}),
    "slow": ({}, {"friction": (0.0, 0.7), "sliding_speed": (0.05, 3.0)}),
    "law": ({"pressure": 5e5}, {"friction": (0.1, 0.6), "contact.lambda": (1e5, 2e6)}),
    "damped": (
        {"damping_ratio": 0.005, "stiffness_damping": 1.5e-7, "disc.thickness": 0.009},
        {"friction": (0.1, 0.8), "pressure": (1e5, 20e5)},
    ),
    "modes": (
        {"friction": 0.6, "pad.half_angle": 26.0},
        {"caliper.modes[7-9].frequency_scale": (0.6, 1.5), "pressure": (4e5, 16e5)},
    ),
    "soft": (
        {"disc.young_modulus": 80e9, "pad.lining_young_modulus_z": 1e9, "sliding_speed": 0.2},
        {"friction": (0.2, 0.9), "pressure": (3e5, 40e5)},
    ),
}
TEXT = """[study]
name = "{name}"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "{mesh}"
[parameters]
{parameters}
{sweeps}
[design]
type = "latin_hypercube"
samples = {points}
seed = 5
[reduction]
tolerance = {tolerance}
[modes]
band = [500.0, {top}]
track = false
reference_points = 0
audit = {audit}
method = "{rung}"
"""


class Judged(NamedTuple):
    """Relative true errors and estimates of modes, and labels that are wrong."""

    true: np.ndarray
    estimate: np.ndarray
    missed: int
    spurious: int
    unstable: int
    uncertain: int


def study_text(case: str, rung: str, audit: float, given: argparse.Namespace) -> str:
    """The study file of a case."""
    parameters, sweeps = CASES[case]
    lines = "\n".join(f'"{k}" = {v}' for k, v in parameters.items())
    tables = "\n".join(
        f'[[sweep]]\nparameter = "{k}"\nstart = {a}\nstop = {b}' for k, (a, b) in sweeps.items()
    )
    return TEXT.format(
        name=f"{case}_{rung}",
        mesh=given.mesh,
        parameters=lines,
        sweeps=tables,
        points=given.points,
        top=given.top,
        audit=audit,
        rung=rung,
        tolerance=given.tolerance,
    )


def solved(text: str, directory: Path, jobs: int) -> tuple[Plan, pd.DataFrame, dict]:
    """Run a study: its plan, modes and manifest."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "study.toml"
    path.write_text(text)
    report = run_study(Plan(load_study(path)), directory / "results", jobs)
    modes = pd.read_parquet(directory / "results" / MODES)
    plan = Plan(load_study(path), enriched=report.manifest["basis_enriched"])
    return plan, modes, report.manifest


def judge(modes: pd.DataFrame, checks: dict[str, dict], widened: float) -> Judged:
    """Hold the modes of checked points, by point id, against full order."""
    true, estimate, counts = [], [], np.zeros(4, dtype=int)
    for point_id, check in checks.items():
        own = modes[modes["point_id"] == point_id]
        size, growth = 2 * np.pi * own["frequency_hz"].to_numpy(), own["growth_rate"].to_numpy()
        lam = growth + 1j * np.sqrt(np.maximum(size**2 - growth**2, 0.0))
        pairs = paired_with_full_order(lam, *reference_roots(check))
        error = (own["error_rung"] + own["error_reduction"] / widened).to_numpy()[pairs.row]
        size = np.abs(pairs.full)
        true.append((pairs.error / size)[pairs.resolved])
        estimate.append((error / size)[pairs.resolved])
        grows = pairs.full.real > NEUTRAL * size
        label = own["stability"].to_numpy()[pairs.row]
        counts += [
            int((grows & (label == "stable")).sum()) + pairs.missed,
            int((~grows & (label == "unstable")).sum()),
            int(grows.sum()),
            int((label == "uncertain").sum()),
        ]
    return Judged(np.concatenate(true), np.concatenate(estimate), *(int(c) for c in counts))


def row(name: str, rung: str, found: Judged) -> str:
    """One line of the table."""
    true, estimate = found.true, found.estimate
    over = estimate / true
    rank = spearmanr(true, estimate)[0]
    return (
        f"{name:10s}{rung:12s}{len(true):6d}{np.median(true):10.1e}{true.max():9.1e}"
        f"{np.mean(true <= 2 * estimate):9.1%}{np.median(over):8.1f}{np.quantile(over, 0.9):8.1f}"
        f"{rank:7.2f}{found.missed:8d}{found.spurious:9d}{found.unstable:9d}{found.uncertain:10d}"
    )


def main() -> None:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--rungs", default="dense,sweep_basis,windows")
    parser.add_argument("--mesh", default="coarse")
    parser.add_argument("--top", type=float, default=2500.0, help="Hz")
    parser.add_argument("--points", type=int, default=16)
    parser.add_argument("--checked", type=int, default=4)
    parser.add_argument("--tolerance", type=float, default=3e-5, help="of the basis")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--directory", type=Path, help="to keep the results; resumed if there")
    given = parser.parse_args()
    print(
        f"{'case':10s}{'rung':12s}{'modes':>6s}{'median':>10s}{'largest':>9s}{'within 2':>9s}"
        f"{'over':>8s}{'90 %':>8s}{'rank':>7s}{'missed':>8s}{'spurious':>9s}{'unstable':>9s}"
        f"{'uncertain':>10s}"
    )
    kept = given.directory or Path(tempfile.mkdtemp(prefix="reduction-errors-"))
    for case in given.cases.split(","):
        checks: list[tuple[int, dict]] = []
        for rung in dict.fromkeys(["dense", *given.rungs.split(",")]):
            started = time.process_time()
            audit = given.checked / given.points if rung == "dense" else 0.0
            place = kept / case / rung
            plan, modes, manifest = solved(study_text(case, rung, audit, given), place, given.jobs)
            ids = [task.point_id for task in plan.tasks]
            if rung == "dense":
                found = Store(place / "results").references()
                checks = [(ids.index(i), c) for i, c in found.items() if "roots" in c]
            own = {ids[i]: check for i, check in checks}
            errors = manifest["errors"]
            line = row(case, rung, judge(modes, own, errors["reduction_widened"]))
            print(
                f"{line}  widened {errors['reduction_widened']:.2g}, enriched "
                f"{manifest['basis_enriched']}, {time.process_time() - started:.0f} CPU s",
                flush=True,
            )
            facts = {k: round(v, 1) for k, v in manifest["timings"].items()}
            (place / "timings.json").write_text(json.dumps(facts))


if __name__ == "__main__":
    main()
