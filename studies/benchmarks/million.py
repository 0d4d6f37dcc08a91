"""What a study of many design points costs beside its solving, and how that grows.

    python studies/benchmarks/million.py [--points 1e4 1e5 1e6] [--jobs 2] [--modes] [--png FILE]

For each number of points a grid of Hulten's model (two degrees of freedom, friction and sliding
speed) is checked, run, and run again when it is finished, as the command does it and each in a
process of its own: seconds and peak memory of `check`; seconds until the first point is solved;
processor time of the parent a point until the last one is solved (planning, ids, storing; all
points go to workers), and that before the first point apart from it (reduction, basis); peak memory
of parent and largest worker until then; seconds and memory of what comes after it, tables with
tracking, ranking and pictures; seconds and memory of the command that finds all done. Processor
time stands beside seconds, for machines that are not idle. With `--batched` all points of a task
are solved at once (million_kind.py), to save time: solving is no part of these figures. With
`--brake` it is the coarse brake by windows over friction and pressure, from the cache that there
is. With `--modes` it is complex modes themselves: a grid of friction and of a parameter of the
structure, tracks and onsets refined. Their rows stand apart from those of the program: processor
time of the workers, and what tracks and onsets take. `--design` takes another design than a grid:
of sobol_indices the points are all of its groups, of a boundary design those of its full grid.
`--keep` keeps the results; `--png` draws the growth, also of figures that `--json` kept.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import one_thread  # noqa: F401

# isort: split

import psutil

STUDY = """
[study]
name = "million"
kind = "{kind}"
{extensions}
[model]
name = "hulten"
[parameters]
damping_ratio = 0.001
[design]
limit = 1_000_000_000
{design}
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.9
{friction}
[[sweep]]
parameter = "sliding_speed"
start = 0.1
stop = 2.0
{speed}
[modes]
band = [1.0, 1000.0]
reference_points = 0
refine_tracking = false
refine_onsets = false
"""
ROUGH = "refine_tracking = false\nrefine_onsets = false\n"
MODES = STUDY.replace(ROUGH, "").replace("damping_ratio = 0.001", "damping_ratio = 0.01")
MODES = MODES.replace("sliding_speed", "frequency_2").replace(
    "0.1\nstop = 2.0", "60.0\nstop = 110.0"
)
BRAKE = """
[study]
name = "many_points"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
[parameters]
sliding_speed = 0.5
[design]
limit = 1_000_000_000
{design}
[[sweep]]
parameter = "friction"
start = 0.1
stop = 0.6
{friction}
[[sweep]]
parameter = "pressure"
start = 5e5
stop = 3e6
{speed}
[modes]
band = [500.0, 6000.0]
method = "windows"
reference_points = 0
refine_tracking = false
refine_onsets = false
"""
OF_MODES = {  # the same of complex modes themselves
    "solving_cpu_s": ("workers, their start too, CPU s", None),
    "points_s": ("until the last point, s", None),
    "tables_s": ("tracks, onsets and tables, s", None),
    "tables_cpu_s": ("the same in the parent, CPU s", None),
    "whole_s": ("all, s", None),
    "whole_mb": ("parent and workers at most, MB", None),
}
FIGURES = {  # name of a figure -> its title and the limit that is asked for at a million points
    "check_s": ("check, s", 3.0),
    "check_cpu_s": ("check, CPU s", 3.0),
    "check_mb": ("check, MB", 400.0),
    "first_point_s": ("to the first point, s", 10.0),
    "first_point_cpu_s": ("to the first point, CPU s", None),
    "solved": ("points solved", None),
    "parent_ms": ("planning, ids, storing, CPU-ms a point", 0.3),
    "later_ms": ("of these after the first point, CPU-ms", None),
    "points_mb": ("parent until the last point, MB", 1500.0),
    "worker_mb": ("largest worker, MB", None),
    "tables_s": ("tables with tracking, s", None),
    "tables_mb": ("parent meanwhile, MB", 1500.0),
    "screen_s": ("ranking and findings, s", None),
    "screen_mb": ("parent meanwhile, MB", 1500.0),
    "pictures_s": ("pictures, s", None),
    "pictures_mb": ("parent meanwhile, MB", 1500.0),
    "after_s": ("all after the last point, s", 60.0),
    "after_cpu_s": ("all after the last point, CPU s", 60.0),
    "peak_mb": ("the command at any moment, MB", 1500.0),
    "resume_s": ("run again when finished, s", 10.0),
    "resume_cpu_s": ("run again when finished, CPU s", 10.0),
    "resume_mb": ("run again, MB", 1500.0),
}
DRAWN = (  # seconds, MB -> names in the chart
    {
        "check_s": "check",
        "first_point_s": "to the first point",
        "tables_s": "tables with tracking",
        "screen_s": "ranking and findings",
        "pictures_s": "pictures",
        "after_s": "these three and the rest after the last point",
        "resume_s": "run again when finished",
    },
    {
        "check_mb": "check",
        "points_mb": "run until the last point",
        "worker_mb": "largest worker",
        "peak_mb": "run at any moment",
        "resume_mb": "run again when finished",
    },
)
BATCHED, BY_WINDOWS, THEMSELVES = "batched", "brake", "modes"
TEXTS = {BY_WINDOWS: BRAKE, THEMSELVES: MODES}
DESIGNS = ("grid", "sobol", "sobol_indices", "boundary")
HALVINGS = 6  # of each step of the grid that a boundary design begins with
EVERY = 0.05  # s between looks at memory


def study_file(folder: Path, points: int, kind_of: str, design: str = "grid") -> Path:
    """A study of so many points, those of grids as square as their divisors allow."""
    friction = next(n for n in range(int(points**0.5), 0, -1) if points % n == 0)
    steps = (friction, points // friction)
    kind = Path(__file__).with_name("million_kind.py")
    batched = kind_of == BATCHED
    text = f'type = "{design}"'
    ranges = [f"num = {n}" for n in steps]
    if design == "boundary":
        text += f"\nlevels = {HALVINGS}"
        ranges = [f"num = {(n - 1) // 2**HALVINGS + 1}" for n in steps]
    elif design != "grid":
        groups = 4 if design == "sobol_indices" else 1
        text += f"\nsamples = {2 ** round(math.log2(points / groups)) if groups > 1 else points}"
        ranges = ['distribution = "uniform"'] * 2
    text = TEXTS.get(kind_of, STUDY).format(
        kind="batched_modes" if batched else "complex_modes",
        extensions=f'extensions = ["{kind}"]' if batched else "",
        design=text,
        friction=ranges[0],
        speed=ranges[1],
    )
    path = folder / f"points_{points}.toml"
    path.write_text(text)
    return path


class Watch:
    """Progress of a run: when the first and the last point were there, and memory by phase."""

    def __init__(self) -> None:
        self.started, self.first_s, self.begun = time.perf_counter(), 0.0, -1
        self.phase, self.cpu_s, self.first_cpu_s = "points", 0.0, 0.0
        self.solving_cpu_s, self.tables_cpu_s = 0.0, 0.0
        self.ends: dict[str, float] = {}
        self.peaks = {"workers": 0.0, "whole": 0.0}
        self.process = psutil.Process()
        threading.Thread(target=self._look, daemon=True).start()

    def __call__(self, stage: str, done: int, total: int, failed: int = 0) -> None:
        """What a run tells of its stages."""
        if stage == "design points":
            self.phase = "points"  # again, where a boundary design has found more of them
            self.begun = done if self.begun < 0 else self.begun
            if done > self.begun and not self.first_s:
                self.first_s = time.perf_counter() - self.started
                self.first_cpu_s = time.process_time()
            if done == total:
                self.cpu_s, self.solving_cpu_s = time.process_time(), self.workers_cpu_s()
                self.next("tables")

    def next(self, phase: str) -> None:
        """The phase so far has ended."""
        self.ends[self.phase] = time.perf_counter() - self.started
        self.phase = phase

    def workers_cpu_s(self) -> float:
        """Processor time of the workers so far."""
        spent = 0.0
        for worker in self.process.children():
            with contextlib.suppress(psutil.Error):
                spent += sum(worker.cpu_times()[:2])
        return spent

    def seconds(self, phase: str) -> float:
        """Of a phase."""
        names = list(self.ends)
        before = names[names.index(phase) - 1] if names[0] != phase else ""
        return self.ends[phase] - self.ends.get(before, 0.0)

    def _look(self) -> None:
        while True:
            own = whole = self.process.memory_info().rss / 2**20
            self.peaks[self.phase] = max(self.peaks.get(self.phase, 0.0), own)
            for worker in self.process.children():
                with contextlib.suppress(psutil.Error):
                    used = worker.memory_info().rss / 2**20
                    self.peaks["workers"] = max(self.peaks["workers"], used)
                    whole += used
            self.peaks["whole"] = max(self.peaks["whole"], whole)
            time.sleep(EVERY)


def run_here(path: Path, directory: Path, jobs: int) -> dict[str, float]:
    """What `squealstudy run` does, in this process; its figures."""
    from squealstudy import face, screen
    from squealstudy.cli.run import blocks
    from squealstudy.engine.model_kind import ModelKind

    watch = Watch()
    ModelKind.seconds_without_workers = lambda self, plan: 0.0  # type: ignore[method-assign]
    face.progress = lambda: contextlib.nullcontext(watch)
    results = face.run(path, directory, jobs, True, screen.warning)
    watch.tables_cpu_s = time.process_time() - watch.cpu_s
    watch.next("screen")
    screen.show(*results.screen.findings(results))
    watch.next("pictures")
    screen.show(*blocks(results, results.drawn or results.draw()))
    watch.next("end")
    whole, points = watch.ends["pictures"], results.manifest["n_points"]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    found: dict[str, float] = {}
    for phase in list(watch.ends)[1:]:  # a finished run makes no tables
        found |= {f"{phase}_s": watch.seconds(phase), f"{phase}_mb": watch.peaks.get(phase, 0.0)}
    if not results.solved:
        return found | {"resume_s": whole, "resume_cpu_s": time.process_time(), "resume_mb": peak}
    return found | {
        "first_point_s": watch.first_s,
        "points_s": watch.ends["points"],
        "first_point_cpu_s": watch.first_cpu_s,
        "solved": points,
        "solving_cpu_s": watch.solving_cpu_s,
        "tables_cpu_s": watch.tables_cpu_s,
        "whole_s": whole,
        "whole_mb": watch.peaks["whole"],
        "parent_ms": 1e3 * watch.cpu_s / points,
        "later_ms": 1e3 * (watch.cpu_s - watch.first_cpu_s) / points,
        "points_mb": watch.peaks["points"],
        "worker_mb": watch.peaks["workers"],
        "after_s": whole - watch.ends["points"],
        "after_cpu_s": time.process_time() - watch.cpu_s,
        "peak_mb": peak,
    }


def in_child(*arguments: str) -> dict[str, float]:
    """Figures that this script finds in a process of its own."""
    command = [sys.executable, __file__, *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def check_here(path: Path, directory: Path) -> dict[str, float]:
    """Figures of `squealstudy check`."""
    started = time.perf_counter()
    command = [sys.executable, "-m", "squealstudy", "check", str(path), "-o", str(directory)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "check_s": time.perf_counter() - started,
        "check_cpu_s": used.ru_utime + used.ru_stime,
        "check_mb": used.ru_maxrss / 1024,
    }


def measure(folder: Path, study: Path, points: int, jobs: int) -> dict[str, float]:
    """All figures of a study."""
    place = [str(study), str(folder / f"results_{points}"), str(jobs)]
    found = in_child("--child", "check", *place)
    run = in_child("--child", "run", *place)
    return found | in_child("--child", "run", *place) | run


def print_table(found: dict[int, dict[str, float]]) -> None:
    """A row a figure, a column a number of points; rows of complex modes apart from the others."""
    for title, figures in (("the program", FIGURES), ("complex modes", OF_MODES)):
        print(f"{title:42s}" + "".join(f"{n:>12,}" for n in found) + f"{'asked':>10s}")
        for name, (text, limit) in figures.items():
            cells = "".join(f"{of.get(name, float('nan')):12.4g}" for of in found.values())
            print(f"{text:42s}{cells}" + (f"{limit:10g}" if limit else ""))


def draw(found: dict[int, dict[str, float]], path: Path) -> None:
    """Seconds and memory over the number of points."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for axis, drawn in zip(axes, DRAWN, strict=True):
        for name, title in drawn.items():
            values = [figures.get(name, float("nan")) for figures in found.values()]
            (line,) = axis.plot(list(found), values, "o-", label=title)
            if limit := FIGURES[name][1]:
                axis.plot(max(1e6, *found), limit, "_", ms=18, mew=3, color=line.get_color())
        axis.set(xscale="log", yscale="log", xlabel="design points")
        axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.14), ncols=2)
    axes[0].set_ylabel("s")
    axes[1].set_ylabel("MB")
    figure.suptitle("Costs of a study beside its solving; bars: the limit at 1,000,000, by colour")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=float, nargs="*", default=[1e4, 1e5, 1e6])
    parser.add_argument("--jobs", type=int, default=2)
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--batched", dest="kind_of", action="store_const", const=BATCHED, default="")
    kinds.add_argument("--brake", dest="kind_of", action="store_const", const=BY_WINDOWS)
    kinds.add_argument("--modes", dest="kind_of", action="store_const", const=THEMSELVES)
    parser.add_argument("--design", choices=DESIGNS, default=DESIGNS[0])
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="of studies and results")
    parser.add_argument("--json", type=Path, help="figures, which join those that are there")
    parser.add_argument("--png", type=Path)
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        what, path, directory, jobs = given.child
        place = Path(path), Path(directory)
        done: dict[str, Any] = (
            check_here(*place) if what == "check" else run_here(*place, int(jobs))
        )
        print(json.dumps(done))
        return
    found: dict[int, dict[str, float]] = {}
    if given.json and given.json.is_file():
        found = {int(n): of for n, of in json.loads(given.json.read_text()).items()}
    with contextlib.ExitStack() as stack:
        made = given.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        made.mkdir(parents=True, exist_ok=True)
        for points in sorted(int(n) for n in given.points):
            study = study_file(made, points, given.kind_of, given.design)
            found[points] = measure(made, study, points, given.jobs)
            print(f"{points:,} points: {found[points]}", flush=True)
            if given.json:
                given.json.write_text(json.dumps(found, indent=1) + "\n")
    found = dict(sorted(found.items()))
    print_table(found)
    if given.png:
        draw(found, given.png)


if __name__ == "__main__":
    main()
