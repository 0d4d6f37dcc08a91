"""Small studies of every kind, run by the command, disturbed or not, and their tables compared."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import psutil
from same_tables import ROOT, STUDIES, copy_studies, study_differences

HERE = Path(__file__).parent
RUN = "from squealstudy.__main__ import main; main()"
MARK, RECORD, FAULT = "FAULT_MARK", "FAULT_RECORD", "FAULT_AT"  # read by hook/sitecustomize.py
PATIENCE_S = 600.0  # after which a run is said to hang
GONE_S = 2.0  # a run's processes must have ended by then
# a study of each kind; several that go to worker processes, in one or more rounds
SCENES = (
    *("hulten_modes", "hulten_latin_windows", "hulten_boundary", "hulten_sensitivity"),
    *("hulten_fidelity", "hulten_work_precision", "matrices_modes", "stability_impact_energy"),
    *("belt_newmark", "brake_run", "brake_geometry", "own_blocks", "hoffmann_cycles"),
    "hoffmann_design",
)
ON_TWO_CORES = ("--jobs", "2")  # where the points are solved
# what no user should ever read
UNWANTED = ("Traceback", "Exception ignored", "resource_tracker", "Process SpawnProcess")
# an interrupt before the first line of squealstudy has run: Python's own word
BEFORE_ALL = """\
Traceback (most recent call last):
  File "<string>", line 1, in <module>
KeyboardInterrupt
"""
IDS = re.compile(
    r"[^/ ]+(?=\.npy)|(?<=\.)\w+-\d+-[0-9a-f]{8}(?=\.tmp)|[0-9a-f]{8,}"
    r"|(?<=\.)[a-z0-9_]{8}(?=\.tmp|/|$)|_?[0-9]+(?=[._])"
)  # host and process in temporary names, hashes, random parts, numbers


@dataclass(frozen=True)
class Ended:
    """A process of the command that has ended: exit code, what it said, seconds it took."""

    code: int
    said: str
    seconds: float

    @property
    def unwanted(self) -> str:
        """The verdict on what was said; empty where it is fit to be read."""
        if self.said == BEFORE_ALL:
            return ""
        if "internal error" in self.said:
            return "internal error"
        return "traceback" if any(word in self.said for word in UNWANTED) else ""


@dataclass
class Scene:
    """A study with the tables of an undisturbed run, and a cache that holds its models.

    Attributes
    ----------
    name : str
    folder : Path
        Holds the study files, ``reference`` (results) and ``cache``.
    seconds : float
        What the undisturbed run took, its cache filled.
    writes : dict of str -> int
        Files that a run writes, by their kind, and how often.
    place : tuple of str
        Options of the command: workers here, or those behind a scheduler.
    workers : callable or None
        Process numbers of workers that are not the run's own.
    """

    name: str
    folder: Path
    place: tuple[str, ...] = ON_TWO_CORES
    workers: Callable[[], list[int]] | None = None
    seconds: float = 0.0
    writes: dict[str, int] = field(default_factory=dict)
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)

    @property
    def reference(self) -> Path:
        """Results of the undisturbed run."""
        return self.folder / f"reference_{self.name}"

    @property
    def cache(self) -> Path:
        """Cache that holds its models."""
        return self.folder / "cache"

    @property
    def kernels(self) -> Path:
        """Cache of compiled kernels, of all scenes of the folder."""
        return self.folder / "kernels"

    def make(self) -> Scene:
        """Run the study twice: to fill the cache, and to see what a run takes and writes."""
        for fresh in (True, False):
            shutil.rmtree(self.reference, ignore_errors=True)
            log = self.folder / f"{self.name}.writes"
            log.unlink(missing_ok=True)
            ended = self.run(self.reference, self.cache, {RECORD: str(log)})
            if ended.code:
                raise RuntimeError(f"{self.name} fails undisturbed:\n{ended.said}")
            self.seconds = ended.seconds
            for line in log.read_text().splitlines() if log.exists() else ():
                kind = kind_of(line)
                self.writes[kind] = self.writes.get(kind, 0) + fresh
        self.tables = tables_of(self.reference)
        return self

    def start(
        self, results: Path, cache: Path, more: Mapping[str, str], mark: str = ""
    ) -> subprocess.Popen[str]:
        """The command; its processes carry `mark` in their environment."""
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join((str(HERE / "hook"), str(ROOT))),
            "SQUEALSTUDY_CACHE": str(cache),
            "NUMBA_CACHE_DIR": str(self.kernels),
            "OMP_NUM_THREADS": "1",
            MARK: mark,
            **more,
        }
        command = [sys.executable, "-c", RUN, "run", f"{self.name}.toml", "--no-pictures"]
        command += [*self.place, "--yes", "--output", str(results)]
        said = (self.folder / f"{results.name}.said").open("w")
        with said:
            return subprocess.Popen(
                command,
                cwd=self.folder,
                env=environment,
                stdout=said,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
                preexec_fn=_heed_interrupts,
            )

    def run(self, results: Path, cache: Path, more: Mapping[str, str] | None = None) -> Ended:
        """Run the command to its end."""
        began = time.monotonic()
        return self.ended(self.start(results, cache, more or {}), results, began)

    def ended(self, process: subprocess.Popen[str], results: Path, began: float) -> Ended:
        """Wait for the end of the command; code -999 where it hangs."""
        try:
            code = process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = -999
        said = (self.folder / f"{results.name}.said").read_text(errors="replace")
        return Ended(code, said, time.monotonic() - began)

    def differences(self, results: Path) -> list[str]:
        """What differs between the tables of some results and of the undisturbed run."""
        return list(study_differences(self.tables, tables_of(results)))


def _heed_interrupts() -> None:
    """Undo what a shell does to commands that it runs in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def scenes(
    names: tuple[str, ...],
    folder: Path,
    place: tuple[str, ...] = ON_TWO_CORES,
    workers: Callable[[], list[int]] | None = None,
) -> Iterator[Scene]:
    """The scenes of these names, made ready in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    copy_studies(folder)
    for name in names:
        if not (STUDIES / f"{name}.toml").is_file():
            raise RuntimeError(f"{name}: no study of {STUDIES}")
        yield Scene(name, folder, place, workers).make()


def tables_of(results: Path) -> dict[str, pd.DataFrame]:
    """Tables of a results directory by their names."""
    return {path.stem: pd.read_parquet(path) for path in sorted(results.glob("*.parquet"))}


def kind_of(line: str) -> str:
    """An event and its path without what names one of many: ``rename chunks/*.parquet``."""
    return IDS.sub("*", line)


def leftovers(*folders: Path) -> list[Path]:
    """Temporary files and folders: hidden ones, but for locks."""
    found = [p for folder in folders for p in folder.rglob(".*") if ".lock" not in p.name]
    return [*found, *(p for folder in folders for p in folder.rglob("*.tmp"))]


def alive(mark: str) -> list[psutil.Process]:
    """Processes that carry a mark in their environment."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get(MARK) == mark and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (psutil.Error, OSError):
            continue
    return found


def still_alive(mark: str) -> list[str]:
    """What of a run is there after the time in which it must end; it is ended then."""
    deadline = time.monotonic() + GONE_S
    while (there := alive(mark)) and time.monotonic() < deadline:
        time.sleep(0.05)
    texts = []
    for process in there:
        try:
            texts.append(" ".join(process.cmdline())[:120])
            process.kill()
        except psutil.Error:
            continue
    return texts
