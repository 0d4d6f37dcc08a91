"""What handing out work costs: processes of this machine against a cluster on the loopback device.

A study of a model of two degrees of freedom is run by each, with one worker and with two, in turn;
medians are shown. Of the time of its points, what no worker spent on a point is overhead; the last
column is that of tasks that do nothing. Scheduler and workers are processes of this machine, each
worker with its own cache.

    python studies/benchmarks/cluster.py --points 4000

With `--killed` a study is run on a cluster of two workers instead: its client is killed when half
of the points are done, the same command is given again, and its tables are held against those of
another run of the study, bit by bit but for the time of each point.

    python studies/benchmarks/million.py --points 1e6 --keep F
    python studies/benchmarks/cluster.py --killed F/points_1000000.toml --against F/results_1000000
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow.dataset as pads

import squealstudy as sq
from squealstudy.engine import model_kind
from squealstudy.engine.cluster import connected
from squealstudy.engine.workers import Workers

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from clusters import Loopback

STUDY = """
[study]
name = "points"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = {points}
[design]
limit = 10000000
[modes]
band = [1.0, 1000.0]
track = false
reference_points = 0
"""
DONE = re.compile(r"design points: .*?([\d,]+) of ([\d,]+) done")


@contextmanager
def cluster_of(workers: int) -> Iterator[Any]:
    """A client of a cluster on this machine."""
    with tempfile.TemporaryDirectory() as folder:
        made = Loopback(Path(folder))
        try:
            made.add(*"abcdefgh"[:workers])
            yield made.client
        finally:
            made.close()


def measured(points: int, jobs: int, client: Any = None) -> tuple[float, float]:
    """Seconds of the points of a run, and those that workers spent on them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "points.toml"
        path.write_text(STUDY.format(points=points))
        found = sq.run(path, Path(folder) / "out", jobs=jobs, client=client).manifest["timings"]
    return found["points_s"], found["points_worker_s"]


def per_task(number: int, tasks: int, client: Any = None) -> float:
    """Seconds of a task that does nothing."""
    with connected(client, print) if client else nullcontext() as place:
        workers = Workers(number, cluster=place)
        list(workers.each(abs, range(10)))  # they start
        began = time.perf_counter()
        list(workers.each(abs, range(tasks)))
        return (time.perf_counter() - began) / tasks


def killed_and_resumed(study: Path, against: Path | None) -> int:
    """Run a study on a cluster, kill its client halfway, go on; 1 where its tables differ."""
    with tempfile.TemporaryDirectory() as folder, cluster_of(2) as client:
        out = Path(folder) / "out"
        line = [sys.executable, "-m", "squealstudy", "run", str(study), "-o", str(out)]
        line += ["--no-pictures", "--scheduler", client.scheduler.address]
        began = time.perf_counter()
        with subprocess.Popen(line, stderr=subprocess.PIPE, text=True) as first:
            for told in first.stderr or ():
                found = DONE.search(told)
                if found and 2 * count(found[1]) >= count(found[2]):
                    first.kill()
        half = time.perf_counter() - began
        print(f"killed after {half:.0f} s: {told.strip()}", flush=True)
        if first.returncode != -signal.SIGKILL:
            print("it was not killed: too few points for a line of its progress in the middle")
            return 1
        began = time.perf_counter()
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        print(f"again, exit {done.returncode} after {time.perf_counter() - began:.0f} s:")
        print(*[line for line in done.stdout.splitlines() if "points  " in line], sep="\n")
        if done.returncode or against is None:
            return done.returncode
        return sum(different(out, against, name) for name in ("points", "modes"))


def count(text: str) -> int:
    """A number as progress writes it."""
    return int(text.replace(",", ""))


def different(one: Path, other: Path, name: str) -> bool:
    """Whether a table of two results differs in any column but the time of a point; told."""
    tables = [pads.dataset(path / f"{name}.parquet").to_table() for path in (one, other)]
    columns = [c for c in tables[0].column_names if c != "wall_s"]
    pairs = {c: [table[c].to_pandas() for table in tables] for c in columns}  # NaN is NaN there
    unlike = [c for c, (a, b) in pairs.items() if not a.equals(b)]
    print(
        f"{name}: {tables[0].num_rows} rows, {len(columns)} columns, different: {unlike or 'none'}"
    )
    return bool(unlike) or tables[0].column_names != tables[1].column_names


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=4000)
    parser.add_argument("--repeats", type=int, default=5, help="of which the medians are shown")
    parser.add_argument("--empty", type=int, default=2000, help="tasks that do nothing")
    parser.add_argument("--killed", type=Path, metavar="STUDY")
    parser.add_argument("--against", type=Path, metavar="RESULTS", help="of the same study")
    given = parser.parse_args()
    if given.killed:
        raise SystemExit(killed_and_resumed(given.killed, given.against))
    points = given.points
    with tempfile.TemporaryDirectory() as cache, ExitStack() as stack:
        stack.enter_context(
            patch.object(model_kind, "WORKER_START_WORTH_S", 0.0)
        )  # s: all points by workers
        stack.enter_context(patch.dict(os.environ, SQUEALSTUDY_CACHE=cache))
        places = {("processes", workers): None for workers in (1, 2)}
        places |= {("cluster", n): stack.enter_context(cluster_of(n)) for n in (1, 2)}
        found: dict[tuple[str, int], list[tuple[float, ...]]] = {place: [] for place in places}
        for (_, workers), client in places.items():
            measured(points, workers, client)  # they start, and have all in their caches
        for _ in range(given.repeats):  # in turn: the speed of a machine changes
            for (name, workers), client in places.items():
                spent = measured(points, workers, client)
                found[name, workers].append((*spent, per_task(workers, given.empty, client)))
    print(f"{'':10} workers  points s  at work s  overhead ms a point  ms an empty task")
    for (name, workers), each in found.items():
        spent_s, busy_s, empty_s = np.transpose(each)
        overhead = 1e3 * np.median(spent_s * workers - busy_s) / points
        print(
            f"{name:10} {workers:7} {np.median(spent_s):9.2f} {np.median(busy_s):10.2f} "
            f"{overhead:20.3f} {1e3 * np.median(empty_s):17.2f}"
        )
    for name in ("processes", "cluster"):
        alone, both = (np.array(found[name, n])[:, 0] for n in (1, 2))
        print(f"{name}: efficiency of two workers against one {50 * np.median(alone / both):.0f} %")


if __name__ == "__main__":
    main()
