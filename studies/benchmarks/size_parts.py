"""Parts of a study that grow with the mesh, each alone: steady sliding, checks, many points.

    python studies/benchmarks/size_parts.py points [--sizes 15k 49k]
    python studies/benchmarks/size_parts.py checks [--sizes 15k 49k]
    python studies/benchmarks/size_parts.py windows [--sizes 15k 49k]

Of the studies of `size.py`, `--top` being that of their band in Hz. `points` solves steady sliding
at every 13th design point: its processor seconds, and the factors it made. `checks` solves the
first and the last one at full order about a uniform contact pressure, by the one factor that large
models share. `windows` solves 2,000 and then 10,000 points (`--frictions` times 10 and 50) of a
part of the range by that method, each with its modes and errors: the difference is what a point
costs, the rest was spent once. No checks at full order.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import one_thread  # noqa: F401

# isort: split

import numpy as np
from size import SIZES, TOP, study_text, write_model

import squealstudy
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.machine.resources import peak_memory_mb
from squealstudy.models.assembly import Assembly
from squealstudy.modes.full_order.contact_factor import HeldStiffness
from squealstudy.modes.full_order.modes import full_order_roots, full_order_system
from squealstudy.reduction import working_point as solver
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.root_pairs import angular_band
from squealstudy.study.definition import load_study

NARROW = (  # many points of a part of the range: patches serve many points each
    ("start = 0.0\nstop = 0.7", "start = 0.3\nstop = 0.5"),
    ("values = [2e5, 4e5, 8e5, 12e5, 20e5, 30e5]", "start = 8e5\nstop = 16e5\nnum = 10"),
)


def built(size: str, top: float) -> tuple[Plan, Assembly]:
    """The plan of the study of a size, and its assembly."""
    with tempfile.TemporaryDirectory() as folder:
        study = load_study(write_model(Path(folder), size, study_text(top=top))[0])
        plan = study.kind.plan(study)
        return plan, plan.tasks[0].assembly()


def checks(size: str, given: argparse.Namespace) -> None:
    """Processor seconds and memory of full-order checks about a uniform contact pressure."""
    plan, assembly = built(size, given.top)
    area, n, started = assembly.contact.area, assembly.n_dof, time.process_time()
    k_c = mean_contact_stiffness(assembly, plan.nominal)
    held = HeldStiffness.of(assembly, k_c)
    print(f"{size}, {n} DOF: shared factor and compliances {time.process_time() - started:.0f} s")
    for state in (plan.tasks[0].state(), plan.tasks[len(plan.tasks) - 1].state()):
        law, started = state.operating.law, time.process_time()
        load = np.abs(state.operating.brake_pressure * assembly.load + assembly.constant_load)
        gap = np.full(len(area), law.gap_at(load.sum() / area.sum()))
        contact = (gap, *law.evaluate(gap), 0, 0.0, np.zeros(len(area)))
        point = solver.working_point_result(area, *contact)
        system = full_order_system(assembly, {}, point, state, plan.settings.damped_to, held)
        modes_s, started = time.process_time() - started, time.process_time()
        found = full_order_roots(system, angular_band(plan.band_hz))
        roots_s, error = time.process_time() - started, (found.error / np.abs(found.lam)).max()
        print(f"  {len(system.omega)} real modes {modes_s:.0f} s; ", end="")
        print(f"{len(found.lam)} complex ones {roots_s:.0f} s, error {error:.0e}; ", end="")
        print(f"{peak_memory_mb():.0f} MB at most so far", flush=True)


def sliding(size: str, given: argparse.Namespace) -> None:
    """Processor seconds of steady sliding at every 13th design point."""
    made: list[float] = []

    class Counted(solver.GapJacobian):
        def __init__(self, *given: object) -> None:
            started = time.process_time()
            super().__init__(*given)  # type: ignore[arg-type]
            made.append(time.process_time() - started)

    plan, assembly = built(size, given.top)
    states = [plan.tasks[i].state().operating for i in range(0, len(plan.tasks), 13)]
    nominal = replace(states[0], friction=0.35, brake_pressure=12e5)
    started = time.process_time()
    stiffness = mean_contact_stiffness(assembly, nominal)
    space = contact_space(assembly, stiffness, np.zeros((assembly.n_dof, 0)))
    print(f"{size}: {len(space.area)} contact points, {len(space.C_NN)} independent rows; ", end="")
    print(f"compliances in {time.process_time() - started:.1f} s of a processor")
    start = solver.working_point(space, nominal).gap
    started = time.process_time()
    with patch.object(solver, "GapJacobian", Counted):
        for state in states:
            solver.working_point(space, state, start)
    each, n = (time.process_time() - started) / len(states), len(states)
    print(f"a point {each:.3f} s, {len(made) / n:.1f} factors of {np.mean(made):.3f} s each")


def windows(size: str, given: argparse.Namespace) -> None:
    """Processor seconds of many points by windows, and what was spent before the first."""
    with tempfile.TemporaryDirectory() as name:
        folder, spent = Path(name), []
        path, dof = write_model(folder, size, study_text(top=given.top))
        for number in (1, 5):  # the first also fills the cache
            text = study_text(given.frictions * number, given.top)
            for given, narrow in NARROW:
                text = text.replace(given, narrow)
            path.write_text(text + 'method = "windows"\nreference_points = 0\n')
            times: dict[str, float] = {}

            def tell(stage: str, *_: int, own: dict[str, float] = times) -> None:
                own.setdefault(stage, time.process_time())

            study = load_study(path)
            run_study(study.kind.plan(study), folder / f"results_{number}", 1, True, tell)
            found = squealstudy.open_results(folder / f"results_{number}")
            spent.append((times["tables"] - times["design points"], len(found.points)))
            seconds, points = spent[-1]
            print(f"{size}, {dof} DOF: {points} points {seconds:.1f} s of a processor", flush=True)
            print(f"  {found.points['method'].value_counts().to_dict()}", flush=True)
        (first_s, first), (last_s, last) = spent
        each = (last_s - first_s) / (last - first)
        print(
            f"{size}: a point {1e3 * each:.2f} ms, before the first {first_s - first * each:.0f} s"
        )


def main() -> None:
    """Measure and print."""
    apart = {"points": sliding, "checks": checks, "windows": windows}
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("part", choices=list(apart))
    parser.add_argument("--sizes", nargs="+", choices=list(SIZES), default=["15k", "49k"])
    parser.add_argument("--top", type=float, default=TOP, help="of the band, Hz")
    parser.add_argument("--frictions", type=int, default=200, help="of the fewer points by windows")
    given = parser.parse_args()
    for size in given.sizes:
        apart[given.part](size, given)


if __name__ == "__main__":
    main()
