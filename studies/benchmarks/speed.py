"""Time of the main jobs beside an earlier state of the project, in turns on one machine.

Run:  python studies/benchmarks/speed.py [--rows study reduction point ..] [--rounds 2]
      --quick          the coarse mesh, few points and a band to 2 kHz, to try it
      --then COMMIT    the earlier state (a git worktree of it is made and removed), or its folder

Each row is a process of its own with a cold cache, first of the earlier state, then of this one.
Both solve the same study file, with the damping of the generated brake written into it; each with
its own mesh. Printed are seconds of both, the least of the rounds, and their ratio: processor
seconds of one thread, but for the whole studies, where they are wall seconds with --jobs workers
and, as CPU s, processor seconds of all.

study       `squealstudy run` over friction and pressure, tables and pictures
reduction   its assembly and component-mode model
point       a dense design point: working point, roots, vectors, errors
contacts    the same with 4 x 4 contact points a facet, over 2 x 2
check       a design point at full order
tracks      tracks and onsets of the study, its points solved
cycle       a stable cycle of the coarse brake with five harmonics, and one near it
basis       sweep bases over 400 frictions to 1e-2, 1e-3 and 1e-4: looser must not be dearer
kernels     those of a study in time, compiled
squeal      100 ms as [fidelity] chooses to 1 %, a design of a batch of eight, without the choice
fidelity    complex modes below 3 kHz as [fidelity] chooses, with what that costs beside `by hand`:
            the same settings written into the file
nominal     `squealstudy run` of 100 ms of squeal (studies/squeal_nominal.toml)
map         20,000 points to 1e-4, with the largest memory of one process in MB beside
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

from other_state import ROOT, tree_of

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")  # processor time is that of one thread

THEN = "3c5c57c"
TOLERANCES = (1e-2, 1e-3, 1e-4)
CONTACT_POINTS, FEW_CONTACT_POINTS, MANY_CONTACT_POINTS = 3, 2, 4  # a side of each pad facet
HARMONICS = 5  # of cycles
STUDY = """
[study]
name = "{name}"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "{mesh}"
contact_points = {contact_points}

[parameters]
friction = 0.5
pressure = 12e5
sliding_speed = 0.5
damping_ratio = 0.005
stiffness_damping = 1.5e-7

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.7
num = {frictions}
{pressures}
[modes]
band = [500.0, {top}]
{more}
"""
PRESSURES = '[[sweep]]\nparameter = "pressure"\nvalues = [2e5, 4e5, 8e5, 12e5, 20e5, 30e5]\n'
FINE_PRESSURES = """[[sweep]]
parameter = "pressure"
start = 2e5
stop = 30e5
num = {}
scale = "log"
"""

IN_TIME = """
[study]
name = "{name}"
kind = "transient"

[model]
name = "disc_brake"
mesh = "{mesh}"
contact_points = 2

[parameters]
friction = 0.5
pressure = 12e5
sliding_speed = 0.5
damping_ratio = 0.005
stiffness_damping = 1.5e-7

[transient]
duration = {duration}
{more}
"""
NOMINAL = "step = 1e-6\nperturbation = 1e-3\nsave_every = 10\nsensors = [500.0, 8000.0]\n"
SQUEAL = """
perturbation = 2e-2
save_every = 0

[fidelity]
tolerance = 0.01

[[sweep]]
parameter = "friction"
start = 0.46
stop = 0.54
num = 8
"""
LOW_BAND = "track = false\nreference_points = 0\n\n[fidelity]\ntolerance = 1e-3\n"


def study_text(
    row: str, quick: bool, tolerance: float = 1e-4, contact_points: int = CONTACT_POINTS
) -> str:
    """The study of a row."""
    mesh, top = ("coarse", 2000.0) if quick else ("medium", 8000.0)
    if row in ("nominal", "squeal"):
        more, duration = (NOMINAL if row == "nominal" else SQUEAL), (0.02 if quick else 0.1)
        return IN_TIME.format(name=row, mesh=mesh, duration=duration, more=more)
    frictions, pressures, more = (8 if quick else 29), PRESSURES, ""
    if row == "fidelity":
        top, frictions, pressures, more = min(top, 3000.0), 400, "", LOW_BAND
    if row == "map":
        frictions = 40 if quick else 200
        pressures = FINE_PRESSURES.format(20 if quick else 100)
        more = "tolerance = 1e-4"
    if row == "tracks":
        more = "reference_points = 0"
    if row == "basis":
        frictions, pressures, more = 400, "", f'method = "windows"\ntolerance = {tolerance}'
    return STUDY.format(
        name=row,
        mesh=mesh,
        contact_points=contact_points,
        top=top,
        frictions=frictions,
        pressures=pressures,
        more=more,
    )


# -- in a process of its own ---------------------------------------------------------------------
def measure(row: str, quick: bool) -> dict[str, float]:
    """Processor seconds of a row, by the package that this process imports."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        return MEASURES[row](quick, Path(folder))


def _plan(row: str, quick: bool, folder: Path, **chosen: Any) -> Any:
    from squealstudy.engine.plan import Plan
    from squealstudy.study.definition import load_any

    path = folder / "study.toml"
    path.write_text(study_text(row, quick, **chosen))
    return Plan(load_any(path))


def _reduced(plan: Any) -> float:
    from squealstudy.engine.structures import build_structure, build_task

    started = time.process_time()
    _, failure = build_structure(build_task(plan, plan.tasks[0], 1))
    if failure:
        raise SystemExit(failure)
    return time.process_time() - started


def _reduction(quick: bool, folder: Path) -> dict[str, float]:
    return {"reduction": _reduced(_plan("study", quick, folder))}


def _point(quick: bool, folder: Path) -> dict[str, float]:
    return {"point": _point_seconds(_plan("study", quick, folder))}


def _point_seconds(plan: Any) -> float:
    from squealstudy.engine.cache import load_prepared
    from squealstudy.modes.point import solve_point

    _reduced(plan)
    prepared = load_prepared(plan.tasks[0].structure)
    states = [task.state() for task in plan.tasks[:: max(len(plan.tasks) // 8, 1)]]
    solve_point(prepared, states[0], plan.band_hz)  # what is loaded and mapped once
    started = time.process_time()
    for state in states:
        solve_point(prepared, state, plan.band_hz)
    return (time.process_time() - started) / len(states)


def _contacts(quick: bool, folder: Path) -> dict[str, float]:
    few, many = (
        _point_seconds(_plan("study", quick, folder, contact_points=count))
        for count in (FEW_CONTACT_POINTS, MANY_CONTACT_POINTS)
    )
    return {"few contacts": few, "many contacts": many, "many over few": many / few}


def _tracks(quick: bool, folder: Path) -> dict[str, float]:
    from squealstudy.engine.runner import run_study
    from squealstudy.kinds.complex_modes import tables

    follow, spent = tables.follow_modes, []

    def timed(*asked: Any) -> Any:
        started = time.process_time()
        found = follow(*asked)
        spent.append(time.process_time() - started)
        print(found.summary, file=sys.stderr)
        return found

    with patch.object(tables, "follow_modes", timed):
        run_study(_plan("tracks", quick, folder), folder / "results", 1)
    return {"tracks": sum(spent)}


def _cycle(quick: bool, _folder: Path) -> dict[str, float]:
    import cycle_cost

    scene = cycle_cost.scene("hoffmann" if quick else "coarse")
    cycle_cost.cold(scene, HARMONICS)  # kernels are compiled
    cycles, cold = cycle_cost.timed(lambda: cycle_cost.cold(scene, HARMONICS))
    loudest = max((c for c in cycles if c.attracts), key=lambda c: c.levels["torque_rms"])
    search = scene.search(HARMONICS)
    _, warm = cycle_cost.timed(lambda: cycle_cost.warm(scene.contacts[1], loudest, search))
    return {"cycle, cold": cold / len(cycles), "cycle, warm": warm}


def _check(quick: bool, folder: Path) -> dict[str, float]:
    from squealstudy.engine.cache import load_prepared
    from squealstudy.modes.full_order.modes import full_order_modes

    plan = _plan("study", quick, folder)
    _reduced(plan)
    prepared, design = load_prepared(plan.tasks[0].structure), plan.tasks[-1]
    started = time.process_time()
    state = design.state()
    assembly = design.assembly()
    cutoff = getattr(plan.settings, "damped_to", plan.settings.assembly_cutoff)
    full_order_modes(prepared, assembly, {}, state, plan.band_hz, cutoff)
    return {"check": time.process_time() - started}


def _basis(quick: bool, folder: Path) -> dict[str, float]:
    try:
        from squealstudy.kinds.complex_modes.problems import make_basis, swept_structures
    except ImportError:  # an earlier state
        from squealstudy.kinds.complex_modes.window_tasks import basis_tasks as swept_structures

        from squealstudy.kinds.complex_modes.problems import make_basis

    _reduced(_plan("basis", quick, folder))
    found = {}
    for tolerance in TOLERANCES:
        plan = _plan("basis", quick, folder, tolerance=tolerance)
        (structure,) = swept_structures(plan)
        started = time.process_time()
        rung = [plan.method.rung] if hasattr(plan.method, "rung") else []
        basis = make_basis(structure, *rung, lambda done, most: None)
        found[f"basis {tolerance:g}"] = time.process_time() - started
        print(f"{tolerance:g}: {len(basis.trained)} points, r {basis.V.shape[1]}", file=sys.stderr)
    return found


def _kernels(_quick: bool, _folder: Path) -> dict[str, float]:
    from squealstudy.motion.warmup import warm_kernels

    started = time.process_time()
    warm_kernels()
    return {"kernels": time.process_time() - started}


def _resolved(row: str, quick: bool, folder: Path) -> Any:
    from squealstudy.fidelity.run import resolve

    study = _plan(row, quick, folder).study
    found = resolve(study, 1, lambda *progress: None)
    print(found.choice.chosen.text, file=sys.stderr)
    return found


def _squeal(quick: bool, folder: Path) -> dict[str, float]:
    from squealstudy.engine.runner import run_study

    plan = _resolved("squeal", quick, folder).plan
    started = time.process_time()
    run_study(plan, folder / "results", 1)
    return {"squeal": (time.process_time() - started) / len(plan.tasks)}


def _fidelity(quick: bool, folder: Path) -> dict[str, float]:
    from squealstudy.engine.runner import run_study
    from squealstudy.fidelity.run import run_resolved

    _reduced(_plan("study", True, folder))  # imports, which the first of the two would pay for both
    started = time.process_time()
    found = _resolved("fidelity", quick, folder)
    chosen = time.process_time()
    run_resolved(found, folder / "chosen", True, lambda *progress: None, lambda text: None)
    whole = time.process_time() - started
    print(f"choice {chosen - started:.1f} s of {whole:.1f} s", file=sys.stderr)
    os.environ["SQUEALSTUDY_CACHE"] = str(folder / "empty")
    started = time.process_time()
    run_study(found.plan, folder / "by_hand", 1)
    by_hand = time.process_time() - started
    return {"fidelity": whole, "by hand": by_hand, "over by hand": whole / by_hand}


MEASURES: dict[str, Callable[[bool, Path], dict[str, float]]] = {
    "reduction": _reduction,
    "point": _point,
    "contacts": _contacts,
    "check": _check,
    "tracks": _tracks,
    "cycle": _cycle,
    "basis": _basis,
    "kernels": _kernels,
    "squeal": _squeal,
    "fidelity": _fidelity,
}
WHOLE = ("study", "nominal", "map")


# -- in turns ------------------------------------------------------------------------------------
def in_process(tree: Path, row: str, quick: bool, jobs: int) -> dict[str, float]:
    """One row of one state, with caches of its own."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {
            "PYTHONPATH": str(tree),
            "SQUEALSTUDY_CACHE": f"{folder}/cache",
            "NUMBA_CACHE_DIR": f"{folder}/kernels",
        }
        if row not in WHOLE:
            command = [sys.executable, __file__, "--measure", row, *(["--quick"] * quick)]
            done = subprocess.run(
                command, env=environment, cwd=folder, check=True, stdout=subprocess.PIPE
            )
            found: dict[str, float] = json.loads(done.stdout)
            return found
        study = Path(folder) / "study.toml"
        study.write_text(study_text(row, quick))
        code = "from squealstudy.cli.app import main; main()"
        command = [sys.executable, "-c", code, "run", str(study), "--jobs", str(jobs), "--yes"]
        started = time.perf_counter()
        run = subprocess.Popen(command, env=environment, cwd=folder, stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(run.pid, 0)  # of this run and its workers, not of earlier ones
        wall = time.perf_counter() - started
        if status:
            raise SystemExit(f"{row}: the study failed")
        seconds = {row: wall, f"{row} CPU s": used.ru_utime + used.ru_stime}
        return seconds | ({f"{row} MB": used.ru_maxrss / 1024} if row == "map" else {})


def compare(rows: list[str], quick: bool, rounds: int, jobs: int, then: Path) -> None:
    """Both states in turns; the table."""
    print(f"{'':<16}{'then':>10}{'now':>10}{'ratio':>8}")
    for row in rows:
        best: list[dict[str, float]] = [{}, {}]
        for _ in range(rounds):
            for least, tree in zip(best, (then, ROOT), strict=True):
                for key, value in in_process(tree, row, quick, jobs).items():
                    least[key] = min(value, least.get(key, value))
        for key, value in best[1].items():
            earlier = best[0][key]
            print(f"{key:<16}{earlier:>10.3g}{value:>10.3g}{value / earlier:>8.2f}", flush=True)


def main() -> None:
    """Measure one row, or compare two states."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", nargs="+", choices=[*WHOLE, *MEASURES])
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--then", default=THEN, help="commit, or a folder with the code")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--measure", choices=list(MEASURES), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        print(json.dumps(measure(arguments.measure, arguments.quick)))
        return
    rows = arguments.rows or ["study", *MEASURES, "nominal", "map"]
    with tree_of(arguments.then) as tree:
        compare(rows, arguments.quick, arguments.rounds, arguments.jobs, tree)


if __name__ == "__main__":
    main()
