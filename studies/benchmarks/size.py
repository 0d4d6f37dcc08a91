"""What a study costs as the mesh grows: a model of files to a ranked study, from a cold cache.

    python studies/benchmarks/size.py run [--sizes 15k 49k] [--jobs 2]
    python studies/benchmarks/size.py run --sizes 15k --frictions 2 --top 1500    to try it
    python studies/benchmarks/size.py chart

The generated brake is written as a model file (meshes in .inp) at growing densities: 15k, 29k, 49k,
116k and 500k degrees of freedom; 95k is 116k with the contact faces of 15k. Each is read, reduced,
solved at 29 frictions x 6 pressures, checked at full order, tracked, ranked and drawn by a process
of its own with its workers, whose cache is empty, kernels to compile included. Printed are for each
stage the seconds, the processor seconds and the largest memory of all its processes together
(resident; what they share counts for each), then the parts of the reduction and what a point takes.
Each stage that ends is written to results/size.json at once, so that an interrupted run keeps what
it measured; `chart` draws what is there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import one_thread  # noqa: F401

# isort: split

import numpy as np
import pandas as pd
import psutil

from squealstudy.models.catalogue.disc_brake import DISC_BRAKE
from squealstudy.models.catalogue.disc_brake.as_files import brake_meshes, brake_tables
from squealstudy.models.catalogue.disc_brake.solids import (
    COARSE,
    DENSITIES,
    FINE,
    GRADING_1,
    GRADING_2,
    GRADING_2_WIDE,
    MEDIUM,
    Density,
)
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.fem.grid import Interval
from squealstudy.study.toml_text import toml_text

ASKED, ASKED_AT = (2 * 720.0, 6144.0), 116_000  # CPU s (12 min of two cores) and MB; DOF
RECORD, CHART = Path("results/size.json"), Path("results/charts/size.png")
EVERY = 0.25  # s between looks: one takes some 10 ms
EXPORT, START, ALL, POINT = "files written", "start", "all, from files", "a point"
CHECK = "full-order check"
SAME_CONTACT = "95k"  # drawn apart: as 116k, with the contact faces of 15k
PRESSURES = 6
FRICTIONS, TOP = 29, 8000.0  # of the study; Hz
DRAWN = ("reduction", "design points", CHECK, "tracking", ALL, POINT)  # stages on the chart
STUDY = """
[study]
name = "size"
kind = "complex_modes"
[model]
file = "brake.toml"
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.7
num = {frictions}
[[sweep]]
parameter = "pressure"
values = [2e5, 4e5, 8e5, 12e5, 20e5, 30e5]
[modes]
band = [500.0, {top}]
"""


def _around(cells: int, ears: int) -> tuple[Interval, ...]:
    """Of a pad: its ears and the three parts between."""
    ear, part = Interval(ears), Interval(cells)
    return (ear, part, part, part, ear)


SIZES: dict[str, Density] = {
    "15k": COARSE,
    "29k": MEDIUM,
    "49k": replace(
        MEDIUM,
        around=48,
        disc_r=(Interval(), Interval(high=GRADING_1), Interval(), Interval(5, low=GRADING_1)),
        pad_r=(Interval(4),),
        pad_theta=_around(6, 1),
        pad_z=(Interval(3), Interval(1)),
        caliper_r=(Interval(3), Interval(1, high=GRADING_1), Interval(3)),
        caliper_z=(
            Interval(3, high=GRADING_2_WIDE),
            Interval(2, GRADING_2_WIDE, GRADING_2_WIDE),
            Interval(3),
        ),
    ),
    "116k": replace(
        FINE,
        around=63,
        disc_r=(Interval(), Interval(high=GRADING_2), Interval(2), Interval(6, low=GRADING_2)),
        pad_r=(Interval(6),),
        pad_theta=_around(8, 2),
    ),
    SAME_CONTACT: replace(
        FINE,
        around=63,
        disc_r=(Interval(), Interval(high=GRADING_2), Interval(2), Interval(6, low=GRADING_2)),
        pad_r=COARSE.pad_r,
        pad_theta=COARSE.pad_theta,
    ),
    "500k": replace(
        FINE, around=40, pad_r=(Interval(4),), pad_theta=_around(5, 1), split=(2, 2, 2)
    ),
}


def study_text(frictions: int = FRICTIONS, top: float = TOP) -> str:
    """The study of a brake whose model file lies beside it."""
    return STUDY.format(frictions=frictions, top=top)


def write_model(folder: Path, size: str, text: str) -> tuple[Path, int]:
    """The study of a brake of that size, with its model file and meshes; degrees of freedom."""
    options = {option.name: option.choices[0] for option in DISC_BRAKE.options} | {"mesh": size}
    values = DISC_BRAKE.defaults()
    files, dof = {}, 0
    with patch.dict(DENSITIES, {size: SIZES[size]}):
        meshes = brake_meshes(options, values)
    for name, mesh in meshes.items():
        files[name] = f"{name}.inp"
        write_inp(mesh, folder / files[name])
        dof += 3 * len(mesh.nodes)
    brake = toml_text(brake_tables(options, values, files))
    (folder / "brake.toml").write_text(brake, encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(text)
    return path, dof


class Watch:
    """Seconds, processor seconds and memory of a process with its children, by stage."""

    def __init__(self, process: psutil.Process) -> None:
        self.stage, self._process = START, process
        self.wall: dict[str, float] = defaultdict(float)
        self.cpu: dict[str, float] = defaultdict(float)
        self.peak: dict[str, float] = defaultdict(float)
        self._last, self._used, self.ended = time.perf_counter(), {}, False
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        while not self.ended:
            stage, memory = self.stage, 0.0
            with_children = [self._process]
            try:
                with_children += self._process.children(recursive=True)
            except psutil.Error:
                return
            for one in with_children:
                try:
                    times, own = one.cpu_times(), one.memory_info().rss / 2**20
                except psutil.Error:
                    continue
                used = times.user + times.system
                self.cpu[stage] += used - self._used.get(one.pid, 0.0)
                self._used[one.pid] = used
                memory += own
            self.peak[stage] = max(self.peak[stage], memory)
            now = time.perf_counter()
            self.wall[stage] += now - self._last
            self._last = now
            time.sleep(EVERY)

    def told(self) -> str:
        """The stage that is at work, in a line."""
        s = self.stage
        wall, cpu, peak = self.wall[s], self.cpu[s], self.peak[s]
        return f"{s}: {wall:.0f} s, {cpu:.0f} s of processors, {peak:.0f} MB"

    def rows(self) -> list[dict[str, object]]:
        """A row a stage."""
        return [
            {"stage": s, "wall_s": self.wall[s], "cpu_s": self.cpu[s], "peak_mb": self.peak[s]}
            for s in self.wall
        ]


def run_here(path: Path, directory: Path, jobs: int) -> None:
    """Run a study, rank and draw it; stages go to stdout, and last what the manifest tells."""
    from squealstudy.engine.runner import run_study
    from squealstudy.face import open_results
    from squealstudy.screen import as_text
    from squealstudy.study.definition import load_study

    told = [START]

    def tell(stage: str, *_: int) -> None:
        if stage != told[-1]:
            told.append(stage)
            print(f"stage {stage}", flush=True)

    study = load_study(path)
    manifest = run_study(study.kind.plan(study), directory, jobs, True, tell).manifest
    tell("ranking and pictures")
    found = open_results(directory)
    ranked = as_text(found.screen.findings(found))
    found.draw()
    references = [{k: r.get(k) for k in KEPT} for r in manifest["reference"]]
    facts = {"timings": manifest["timings"], "reference": references, "ranked": ranked}
    print(json.dumps(facts), flush=True)


KEPT = ("status", "frequency_error", "damping_error", "missed_modes", "wall_s")


def keep(record: Path, size: str, facts: dict[str, object]) -> None:
    """Put what is known of a size into the record; an interrupted run leaves what it had."""
    known = json.loads(record.read_text()) if record.exists() else {}
    known[size] = facts
    record.parent.mkdir(parents=True, exist_ok=True)
    record.write_text(json.dumps(known, indent=1) + "\n")


def measure(size: str, given: argparse.Namespace) -> None:
    """Measure all figures of a size, print and keep them."""
    jobs, record, files = given.jobs, given.record, given.keep
    text = study_text(given.frictions, given.top)
    with tempfile.TemporaryDirectory() as made:
        folder = (files or Path(made)) / size
        folder.mkdir(parents=True, exist_ok=True)
        started, used = time.perf_counter(), time.process_time()
        path, dof = write_model(folder, size, text)
        written = {
            "stage": EXPORT,
            "wall_s": time.perf_counter() - started,
            "cpu_s": time.process_time() - used,
            "peak_mb": psutil.Process().memory_info().rss / 2**20,
        }
        command = [sys.executable, __file__, "child", str(path), str(Path(made) / "results")]
        environment = {**os.environ, "SQUEALSTUDY_CACHE": str(Path(made) / "cache")}
        figures: dict[str, Any] = {"dof": dof, "jobs": jobs, "points": PRESSURES * given.frictions}
        figures["load_before"] = os.getloadavg()[0]
        started = time.perf_counter()
        with subprocess.Popen(
            [*command, str(jobs)], stdout=subprocess.PIPE, text=True, env=environment
        ) as child:
            watch = Watch(psutil.Process(child.pid))
            facts = {}
            assert child.stdout is not None
            for line in child.stdout:
                if line.startswith("stage "):
                    print(watch.told(), flush=True)
                    watch.stage = line[6:].strip()
                elif line.startswith("{"):
                    facts = json.loads(line)
                keep(record, size, {**figures, "finished": False, "rows": [written, *watch.rows()]})
            watch.ended = True
        if child.returncode:
            raise SystemExit(f"{size}: the study failed, exit code {child.returncode}")
        total = time.perf_counter() - started
    rows, times = watch.rows(), facts["timings"]
    whole = {
        "stage": ALL,
        "wall_s": total,
        "cpu_s": sum(watch.cpu.values()),
        "peak_mb": max(watch.peak.values()),
    }
    parts = [
        {"stage": f"  {name.removeprefix('structure_').removesuffix('_s')}", "wall_s": value}
        for name, value in times.items()
        if name.startswith("structure_")
    ]
    point = {"stage": POINT, "wall_s": times["points_worker_s"] / times["points_solved"]}
    rows = [written, *rows, whole, *parts, point]
    figures |= {"load_after": os.getloadavg()[0], "full_order": facts["reference"]}
    keep(record, size, {**figures, "finished": True, "rows": rows})
    print(f"\n{size}, {jobs} workers, load before {figures['load_before']:.1f}")
    print(pd.DataFrame(rows).to_string(index=False, float_format=lambda x: f"{x:.1f}", na_rep=""))
    for reference in facts["reference"]:
        print("full order:", reference)
    print(facts["ranked"], flush=True)


def draw(record: Path, path: Path) -> None:
    """Processor seconds and memory of the stages over degrees of freedom.

    Of a run that was interrupted, the stages that ended.
    """
    from squealstudy.colours import DARK
    from squealstudy.plots.style import COLOURS, finish, new_figure

    known = json.loads(record.read_text())
    table = pd.DataFrame(
        [
            {
                **row,
                "dof": size["dof"],
                "size": name,
                "points": size.get("points", PRESSURES * FRICTIONS),
            }
            for name, size in known.items()
            for row in size["rows"]
        ]
    )
    solved = table[table["stage"] == "design points"]
    point = solved.assign(stage=POINT, cpu_s=solved["cpu_s"] / solved["points"], peak_mb=np.nan)
    table = pd.concat([table[table["stage"] != POINT], point]).sort_values("dof")
    apart, table = table[table["size"] == SAME_CONTACT], table[table["size"] != SAME_CONTACT]
    figure = new_figure(10.0, 4.6)
    panels = figure.subplots(1, 2)
    titles = {"cpu_s": "processor time [s]", "peak_mb": "memory of all processes [MB]"}
    shown = [s for s in DRAWN if (table["stage"] == s).any()]
    for axes, (column, title), limit in zip(panels, titles.items(), ASKED, strict=True):
        for number, stage in enumerate(shown):
            own = table[(table["stage"] == stage) & table[column].notna()]
            look = {"color": DARK, "lw": 2.2} if stage == ALL else {"color": COLOURS[number]}
            axes.plot(own["dof"], own[column], "o-", label=stage, **look)
            other = apart[(apart["stage"] == stage) & apart[column].notna()]
            axes.plot(other["dof"], other[column], "x", ms=8, mew=2, **look)
        if len(apart):
            axes.plot([], [], "x", color=DARK, label=f"{SAME_CONTACT}: contact of 15k")
        axes.plot(ASKED_AT, limit, "v", color=DARK, ms=9, mfc="none", label="at most, as asked")
        axes.set(xscale="log", yscale="log")
        sizes = sorted(set(table["dof"]))
        axes.set_xticks(sizes, [f"{n:,}" for n in sizes])
        axes.set_xticks([], minor=True)
        finish(axes, "degrees of freedom", title)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, dpi=130)


def main() -> None:
    """Measure, print, keep; or draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    run = commands.add_parser("run")
    run.add_argument("--sizes", nargs="+", choices=list(SIZES), default=["15k", "49k"])
    run.add_argument("--jobs", type=int, default=2)
    run.add_argument("--frictions", type=int, default=FRICTIONS, help="design points a pressure")
    run.add_argument("--top", type=float, default=TOP, help="of the band, Hz")
    run.add_argument("--keep", type=Path, help="folder where the model files stay")
    chart = commands.add_parser("chart")
    chart.add_argument("png", type=Path, nargs="?", default=CHART)
    for one in (run, chart):
        one.add_argument("--record", type=Path, default=RECORD)
    child = commands.add_parser("child")
    child.add_argument("study", type=Path)
    child.add_argument("results", type=Path)
    child.add_argument("jobs", type=int)
    given = parser.parse_args()
    if given.command == "child":
        run_here(given.study, given.results, given.jobs)
        return
    if given.command == "chart":
        draw(given.record, given.png)
        return
    for size in given.sizes:
        measure(size, given)


if __name__ == "__main__":
    main()
