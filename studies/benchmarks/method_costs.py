"""What methods of complex modes cost, in exact solves: figures of the rungs' files.

Run:  python studies/benchmarks/method_costs.py [--mesh medium] [--jobs 2] [--varied 1 2 3]
      --points N  in place of as many as MIN_POINTS_FOR_WINDOWS says
      --quick     the coarse mesh and a fifth of the points
      --top 8000  of the band, in Hz

For one to three parameters (friction, pressure, sliding speed): processor seconds of an exact
point, of a sweep basis (BASIS_SOLVES is its ratio to the point), and of a point in windows with its
patches (POINTS_OF_EXACT_COST, COST_EXPONENT); and the number of points from which on a study by
windows ends sooner (MIN_POINTS_FOR_WINDOWS), with its basis made by one process and points solved
by --jobs. Over two parameters the other methods follow. Points are those of a Sobol design.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import one_thread  # noqa: F401

# isort: split


from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.engine.workers import Workers
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.problems import (
    make_basis,
    problem_of,
    swept_structures,
)
from squealstudy.kinds.complex_modes.solve_tasks import solve_tasks
from squealstudy.modes.rungs import all_rungs
from squealstudy.modes.rungs.windows import MIN_POINTS_FOR_WINDOWS, RUNG
from squealstudy.study.definition import load_any

STUDY = """
[study]
name = "costs"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "{mesh}"

[design]
type = "sobol"
samples = {samples}

[modes]
band = [500.0, {top}]
method = "{method}"
"""
SWEEPS = ("friction", 0.0, 0.7), ("pressure", 2e5, 30e5), ("sliding_speed", 0.1, 3.0)
SWEEP = '\n[[sweep]]\nparameter = "{}"\nstart = {}\nstop = {}\n'
EXACT_POINTS = 12
OTHER_POINTS = 60  # of methods whose cost does not depend on their number


class Scene(NamedTuple):
    """What all studies have in common: where they lie, the mesh, and the top of the band in Hz."""

    folder: Path
    mesh: str
    top: float

    def plan(self, varied: int, samples: int, method: str) -> Plan:
        """A study of random points over the first parameters."""
        path = self.folder / "study.toml"
        text = STUDY.format(mesh=self.mesh, top=self.top, samples=samples, method=method)
        path.write_text(text + "".join(SWEEP.format(*sweep) for sweep in SWEEPS[:varied]))
        return Plan(load_any(path))


def seconds(work: Callable[[], object]) -> float:
    """Processor seconds of this process."""
    started = time.process_time()
    work()
    return time.process_time() - started


def solving_seconds(plan: Plan, points: DesignPoints) -> float:
    """Of a point; what is loaded once is not in it."""
    tasks = [replace(t, keep_gaps=False) for t in solve_tasks(plan, points, Workers())]
    return seconds(lambda: [ComplexModes().solve(task) for task in tasks]) / len(points)


def exact_seconds(scene: Scene, varied: int, samples: int) -> float:
    """Of a point by the exact method."""
    plan = scene.plan(varied, samples, "dense")
    solving_seconds(plan, plan.tasks[:1])
    return solving_seconds(plan, plan.tasks[1 : EXACT_POINTS + 1])


def served_seconds(plan: Plan, most: int | None = None) -> tuple[float, float]:
    """Of the basis, if the method has one and it is not there yet, and of one of `most` points."""
    (structure,), rung = swept_structures(plan), plan.method.rung
    basis = 0.0
    if rung.over_a_basis:
        basis = seconds(lambda: make_basis(structure, rung, lambda done, most: None))
        _ = problem_of(structure, rung).basis_reader
    return basis, solving_seconds(plan, plan.tasks[:most])


def main() -> None:
    """Print a line a number of parameters, and one each of the other methods."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--mesh", default="medium")
    parser.add_argument("--top", type=float, default=8000.0, help="Hz")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--varied", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--points", type=int)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    mesh = "coarse" if arguments.quick else arguments.mesh
    others = [r.name for r in all_rungs() if not r.exact and r is not RUNG]
    with tempfile.TemporaryDirectory() as name:
        scene = Scene(Path(name), mesh, arguments.top)
        print(
            f"{'varied':<14}{'points':>7}{'exact s':>9}{'basis':>7}{'served':>8}{'pays from':>11}"
        )
        for varied in arguments.varied:
            asked = arguments.points or MIN_POINTS_FOR_WINDOWS[varied]
            samples = asked // (5 if arguments.quick else 1)
            plan = scene.plan(varied, samples, RUNG.name)
            if reason := build_structure(build_task(plan, plan.tasks[0], 1))[1]:
                raise SystemExit(reason)
            exact = exact_seconds(scene, varied, samples)
            basis, point = served_seconds(plan)
            pays = arguments.jobs * basis / (exact - point) if exact > point else float("inf")
            line = (
                f"{varied:<14}{samples:>7}{exact:>9.3f}{basis / exact:>7.0f}{point / exact:>8.2f}"
            )
            print(f"{line}{pays:>11.0f}", flush=True)
            for method in others if varied == 2 else ():
                other = scene.plan(varied, samples, method)
                _, point = served_seconds(other, OTHER_POINTS)
                print(f"{method:<14}{OTHER_POINTS:>7}{'':>16}{point / exact:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
