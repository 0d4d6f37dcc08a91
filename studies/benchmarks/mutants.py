"""Whether the tests notice a wrong line: small changes of the numerical core, one at a time.

    python studies/benchmarks/mutants.py [--number 300] [--seed 1] [--keep FOLDER] [--only 17 23 ..]
    python studies/benchmarks/mutants.py --number 2 --folders laws --tests friction_law    to try it

Of all changes that `mutations.py` makes in FOLDERS, a sample is drawn: of another state of the code
it is another one. Each is written into a copy of the project and the tests that run its line are
run, the quickest first, until one fails (killed), none does (survived) or the time is up. Some
survivors change nothing and must be read: ties of floats, checks of lengths that are equal.

Which tests run a line, and how long they take, is measured first with coverage.py, which must be
installed; `--keep` keeps that for the next time. Kernels are run as plain Python; tests that then
take more than SLOW seconds (of a processor) are left out; what worker processes do is not seen. A
line that no test runs is left to the tests of its file, and is `uncovered` where they pass.
"""

from __future__ import annotations

import argparse
import importlib
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mutations import Mutant, mutants_of
from tests_of_lines import OPTIONS, SLOW, Made, merged, record

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("reduction", "laws", "system", "modes/rungs", "modes/reanalysis")
# files of tests that reach FOLDERS and are not mostly time integration
TESTS = (
    *("parametric", "friction_law", "rungs", "patches", "windows", "sweep_basis", "models"),
    *("family_reanalysis", "reanalysis_study", "sensitivity", "matrices", "kernels", "fronts"),
    *("reduction", "reduction_errors", "working_point", "working_point_field", "complex_shares"),
    *("hybrid", "slope_of_friction", "exponential_method", "dense_qep", "units", "modal_energies"),
    *("wear", "lumped_springs", "friction_map", "friction_table", "stribeck", "shared_basis"),
    *("free_motions", "stress_stiffness", "coupled_pair", "friction_by_contact", "row_blocks"),
    *("stacked", "stacked_sensitivity", "followed_root", "family_roots", "contact_factor"),
    *("contact_law", "friction_curve", "rung"),
)
MOST_SECONDS = 300  # of a file of tests
LOADED_ONCE = (
    *("numba", "pandas", "pyarrow.parquet", "scipy.optimize", "scipy.sparse.linalg", "scipy.io"),
    *("scipy.stats", "pydantic", "matplotlib.pyplot", "skfem", "psutil", "typer", "rich.console"),
    *("hypothesis", "xdist", "threadpoolctl"),
)
COPIED = ("squealstudy", "tests", "studies", "pyproject.toml", "README.md", "CHANGELOG.md")


def main() -> None:
    """Measure coverage, draw the sample, run it and print what became of it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--number", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=60.0, help="of tests, for each mutant")
    parser.add_argument("--keep", type=Path, help="folder that keeps which tests run which line")
    parser.add_argument("--folders", nargs="+", default=FOLDERS, help="of the package, to change")
    parser.add_argument("--tests", nargs="+", default=TESTS, help="files test_NAME.py of tests")
    parser.add_argument("--only", type=int, nargs="+", help="of the sample, by number")
    arguments = parser.parse_args()
    os.environ |= {"NUMBA_DISABLE_JIT": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    os.environ.pop("SQUEALSTUDY_CACHE", None)  # a reduction that is kept would hide its mutants
    for name in LOADED_ONCE:
        importlib.import_module(name)

    files = [p for f in arguments.folders for p in sorted((ROOT / "squealstudy" / f).rglob("*.py"))]
    everything = [mutant for path in files for mutant in mutants_of(path, ROOT)]
    sample = random.Random(arguments.seed).sample(everything, arguments.number)
    print(f"{len(everything)} mutants in {len(files)} files, {len(sample)} drawn", flush=True)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        slots = [_copy(Path(folder) / f"slot{k}") for k in range(arguments.jobs)]
        kept = arguments.keep or Path(folder)
        recorded = _recorded(slots, kept, arguments.folders, arguments.tests)
        covered = Covered(recorded, arguments.seconds)
        print(covered.summary, flush=True)
        numbers = arguments.only or range(len(sample))
        for number, verdict, test in _verdicts(slots, sample, numbers, covered):
            mutant = sample[number]
            counts[verdict] += 1
            print(f"{number:>4} {verdict:<10}{mutant.place:<48} {mutant.text}  {test}", flush=True)
    noticed = (counts["killed"] + counts["timed out"]) / counts.total()
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.most_common()))
    print(f"{noticed:.1%} of {counts.total()} noticed")


def _copy(slot: Path) -> Path:
    """A copy of what tests read. A folder for each process, so that two mutants never meet."""
    slot.mkdir(parents=True)
    for path in (ROOT / name for name in COPIED):
        if path.is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "results")
            shutil.copytree(path, slot / path.name, ignore=ignored)
        else:
            shutil.copy(path, slot)
    return slot


# -- processes -----------------------------------------------------------------------------------
def _forked(
    slots: list[Path],
    jobs: Iterable[Any],
    start: Callable[[Path, Any], int],
    limit: Callable[[Any], float],
):
    """Of every job, itself, its slot and the exit status; as many at a time as there are slots.

    Forked, since importing what a test needs takes longer than most tests.
    """
    free, running = list(slots), {}
    for job in [*jobs, None]:
        while running and (job is None or not free):
            pid, status = os.wait()
            with suppress(ProcessLookupError):
                os.killpg(pid, signal.SIGKILL)  # what it may have left
            slot, done = running.pop(pid)
            yield done, slot, os.waitstatus_to_exitcode(status)
            free.append(slot)
        if job is not None:
            slot, seconds = free.pop(), int(limit(job))
            if (pid := os.fork()) == 0:
                os.setsid()
                resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
                signal.alarm(10 * seconds)
                _enter(slot)
                status = start(slot, job)
                sys.stdout.flush()
                os._exit(status)
            running[pid] = slot, job


def _enter(slot: Path) -> None:
    os.chdir(slot)
    os.environ |= {"PYTHONPATH": str(slot), "NUMBA_CACHE_DIR": str(slot / "kernels")}
    sys.path[:] = [
        str(slot),
        *(p for p in sys.path if Path(p) not in (ROOT, Path(__file__).parent)),
    ]
    log = os.open(slot / "log.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)


# -- tests ---------------------------------------------------------------------------------------
def _recorded(slots: list[Path], kept: Path, changed: Sequence[str], tests: Sequence[str]) -> Path:
    """The folder with what `record` finds of the tests, which is filled where it is not yet."""
    kept = kept.resolve()
    kept.mkdir(exist_ok=True)

    def start(slot: Path, path: Path) -> int:
        folders = [slot / "squealstudy" / folder for folder in changed]
        record(folders, slot, path, into(path))
        return 0

    def into(path: Path) -> Path:
        return kept / f"{'_'.join(path.with_suffix('').parts)}.json"

    files = {path.stem: path.relative_to(ROOT) for path in (ROOT / "tests").rglob("test_*.py")}
    paths = [files[f"test_{name}"] for name in tests]
    missing = [path for path in paths if not into(path).exists()]
    for path, _, status in _forked(slots, missing, start, lambda _: MOST_SECONDS):
        if status:
            print(f"{path} is left out, it ended with {status}", flush=True)
    return kept


class Chosen(NamedTuple):
    """Tests for a mutant, quickest first, with their seconds; `runs`: its very line is run."""

    tests: list[str]
    seconds: float
    runs: bool
    made: list[str]  # names of fixtures that the mutant cannot change


class Covered:
    """Which tests run which line, and the seconds of each."""

    def __init__(self, kept: Path, limit: float) -> None:
        found = merged(sorted(kept.glob("*.json")))
        self.kept, self.limit, self.lines = kept, limit, found["lines"]
        self.own, self.shared, self.needs = found["seconds"], found["shared"], found["needs"]
        self.summary = (
            f"{len(self.own)} tests, {len(found['left_out'])} left out that fail as plain Python "
            f"or take more than {SLOW:.0f} s"
        )

    def tests(self, mutant: Mutant) -> Chosen:
        """Of those that run the mutant, the quickest that the limit has room for, one at least."""
        lines = self.lines.get(mutant.file, {})
        contexts = set(lines.get(str(mutant.line)) or lines.get(str(mutant.statement)) or [])
        runs = bool(contexts)
        if not mutant.called or not contexts - {""}:  # "" is what an import runs
            contexts = {context for line in lines.values() for context in line}
        fixtures = {path.stem: f"fixture tests::{path.stem}" for path in self.kept.glob("*.pickle")}
        fixtures = {name: f for name, f in fixtures.items() if f not in contexts}
        shared = self.shared | dict.fromkeys(fixtures.values(), 0.0)
        price = {
            test: seconds + sum(shared[fixture] for fixture in self.needs[test])
            for test, seconds in self.own.items()
            if test in contexts or contexts & set(self.needs[test])
        }
        chosen, total, ready = [], 0.0, set()
        for test in sorted(price, key=lambda test: self._place(test, price)):
            more = self.own[test] + sum(shared[f] for f in {*self.needs[test]} - ready)
            if total + more <= self.limit or not chosen:
                chosen.append(test)
                ready |= set(self.needs[test])
                total += more
        return Chosen(chosen, total, runs, list(fixtures))

    def _place(self, test: str, price: dict[str, float]) -> tuple[Any, ...]:
        """Files whose tests share something come last and in one piece, or it is made again."""
        file = test.split("::")[0]
        if not any(fixture.startswith(f"fixture {file}") for fixture in self.needs[test]):
            return 0, price[test]
        least = min(price[other] for other in price if other.startswith(f"{file}::"))
        return 1, least, file, price[test]


def _verdicts(
    slots: list[Path], sample: list[Mutant], numbers: Iterable[int], covered: Covered
) -> Iterator[tuple[int, str, str]]:
    """Of each mutant by its number, what became of it, and the test that failed."""
    chosen = {number: covered.tests(sample[number]) for number in numbers}

    def start(slot: Path, number: int) -> int:
        file = slot / sample[number].file
        file.write_bytes(sample[number].applied(file.read_bytes()))
        os.utime(file, (number, number))  # what was compiled of another state is not taken
        tests, made = chosen[number].tests, Made(covered.kept, chosen[number].made)
        return int(pytest.main([*OPTIONS, "-x", *tests], plugins=[made])) if tests else 0

    limits = {number: 3 * tests.seconds + 30 for number, tests in chosen.items()}
    for number, slot, status in _forked(slots, chosen, start, limits.__getitem__):
        shutil.copy(ROOT / sample[number].file, slot / sample[number].file)
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", (slot / "log.txt").read_text(), re.M)
        if status == 0:
            yield number, "survived" if chosen[number].runs else "uncovered", ""
        elif status in (-signal.SIGXCPU, -signal.SIGKILL, -signal.SIGALRM):
            yield number, "timed out", ""
        else:
            yield number, "killed", failed[1] if failed else f"status {status}"


if __name__ == "__main__":
    main()
