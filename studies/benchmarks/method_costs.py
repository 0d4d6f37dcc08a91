"""What methods of complex modes cost, in exact solves: figures of squealstudy/study/method.py.

Run:  python studies/benchmarks/method_costs.py [--mesh medium] [--jobs 2] [--varied 1 2 3]
      --points N  in place of as many as PAYS_FROM says
      --quick     the coarse mesh and a fifth of the points

For one to three parameters (friction, pressure, sliding speed): processor seconds of an exact
point, of a sweep basis (BASIS_SOLVES is its ratio to the point), and of a point in windows with its
patches (ALONE, FALLS); and the number of points from which on a study by windows is over sooner
(PAYS_FROM), with its basis made by one process and points solved by --jobs. Over two parameters the
other methods follow. Points are those of a Sobol design.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # processor time is that of one thread

from squealstudy.study.complex_modes.bases import make_basis, served  # noqa: E402
from squealstudy.study.complex_modes.window_tasks import basis_tasks, window_tasks  # noqa: E402
from squealstudy.study.complex_modes.window_worker import solve_box  # noqa: E402
from squealstudy.study.complex_modes.worker import ChunkTask, solve_chunk  # noqa: E402
from squealstudy.study.experiments.definition import load_any  # noqa: E402
from squealstudy.study.method import (  # noqa: E402
    OVER_A_BASIS,
    PAYS_FROM,
    PERTURBATION,
    SWEEP_BASIS,
    TWO_STEP,
    WINDOWS,
)
from squealstudy.study.plan import Plan  # noqa: E402
from squealstudy.study.structures import build_structure, build_task  # noqa: E402

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
band = [500.0, 8000.0]
method = "{method}"
"""
SWEEPS = ("friction", 0.0, 0.7), ("pressure", 2e5, 30e5), ("sliding_speed", 0.1, 3.0)
SWEEP = '\n[[sweep]]\nparameter = "{}"\nstart = {}\nstop = {}\n'
EXACT_POINTS = 12
OTHER_POINTS = 60  # of methods whose cost does not depend on their number


def plan_of(folder: Path, mesh: str, varied: int, samples: int, method: str) -> Plan:
    """A study of random points over the first parameters."""
    path = folder / "study.toml"
    text = STUDY.format(mesh=mesh, samples=samples, method=method)
    path.write_text(text + "".join(SWEEP.format(*sweep) for sweep in SWEEPS[:varied]))
    return Plan(load_any(path))


def seconds(work: Callable[[], object]) -> float:
    """Processor seconds of this process."""
    started = time.process_time()
    work()
    return time.process_time() - started


def exact_seconds(plan: Plan) -> float:
    """Of a point by the exact method; what is loaded once is not in it."""
    first, *others = (plan.tasks[i] for i in range(EXACT_POINTS + 1))
    chunk = ChunkTask(plan.band_hz, (first,), False)
    solve_chunk(chunk)
    rest = ChunkTask(plan.band_hz, tuple(others), False)
    return seconds(lambda: solve_chunk(rest)) / len(others)


def served_seconds(plan: Plan, most: int | None = None) -> tuple[float, float]:
    """Of the basis, if the method has one and it is not there yet, and of one of `most` points."""
    (task,) = basis_tasks(plan)
    over_a_basis = plan.method.name in OVER_A_BASIS
    basis = seconds(lambda: make_basis(task, lambda done, most: None)) if over_a_basis else 0.0
    served(task, over_a_basis)
    points = plan.tasks[:most]
    boxes = window_tasks(plan, points)
    spent = seconds(lambda: [solve_box(box) for box in boxes])
    return basis, spent / len(points)


def main() -> None:
    """Print a line a number of parameters, and one each of the other methods."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--mesh", default="medium")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--varied", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--points", type=int)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    mesh = "coarse" if arguments.quick else arguments.mesh
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(
            f"{'varied':<14}{'points':>7}{'exact s':>9}{'basis':>7}{'served':>8}{'pays from':>11}"
        )
        for varied in arguments.varied:
            asked = arguments.points or PAYS_FROM[varied]
            samples = asked // (5 if arguments.quick else 1)
            plan = plan_of(folder, mesh, varied, samples, WINDOWS)
            if reason := build_structure(build_task(plan, plan.structures[0], 1))[1]:
                raise SystemExit(reason)
            exact = exact_seconds(plan)
            basis, point = served_seconds(plan)
            pays = arguments.jobs * basis / (exact - point) if exact > point else float("inf")
            line = (
                f"{varied:<14}{samples:>7}{exact:>9.3f}{basis / exact:>7.0f}{point / exact:>8.2f}"
            )
            print(f"{line}{pays:>11.0f}", flush=True)
            for method in (SWEEP_BASIS, TWO_STEP, PERTURBATION) if varied == 2 else ():
                other = plan_of(folder, mesh, varied, samples, method)
                _, point = served_seconds(other, OTHER_POINTS)
                print(f"{method:<14}{OTHER_POINTS:>7}{'':>16}{point / exact:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
