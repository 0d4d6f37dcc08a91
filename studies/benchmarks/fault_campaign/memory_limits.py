"""Runs with little memory: a sentence, or the kernel's kill and a right run after it.

By a memory control group where this user may make one, else by a limit of the address space; each
finding says which.
"""

from __future__ import annotations

import os
import random
import resource
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from fault_campaign.finding import Finding
from fault_campaign.scenes import RUN, UNWANTED, Scene, leftovers, scenes

PART = "memory limits"
SCENES = ("hulten_modes", "belt_newmark", "own_blocks", "brake_geometry")
GROUPS = Path("/sys/fs/cgroup")
LEAST_MB, MOST_MB = 60, 700  # where runs of these studies begin, and have all they need
KILLED = (-9, 137)  # by the kernel: no process can say a word then
PATIENCE_S = 300


class Group:
    """A memory control group of its own."""

    def __init__(self, megabytes: int) -> None:
        v1 = GROUPS / "memory"
        self.path = (v1 if v1.is_dir() else GROUPS) / f"faults{os.getpid()}"
        self.path.mkdir()
        name = "memory.limit_in_bytes" if v1.is_dir() else "memory.max"
        (self.path / name).write_text(str(megabytes << 20))

    def close(self) -> None:
        """Remove it; its processes have ended."""
        self.path.rmdir()


def usable() -> bool:
    """Whether groups can be made here."""
    try:
        Group(64).close()
    except OSError:
        return False
    return True


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Run `count` studies with a limit, then without; a finding for each."""
    groups = usable()
    made = list(scenes(names, work / "memory_limits"))
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        scene = rng.choice(made)
        megabytes = round(LEAST_MB * (MOST_MB / LEAST_MB) ** rng.random())
        if not groups:
            megabytes *= 3  # of addresses a process takes more than of memory
        results = scene.folder / f"results{number}"
        verdict, text = _tried(scene, results, megabytes, groups)
        way = "control group" if groups else "address space"
        yield Finding(PART, number, f"{scene.name}, {megabytes} MB ({way})", verdict, text)


def _tried(scene: Scene, results: Path, megabytes: int, groups: bool) -> tuple[str, str]:
    code, said = _limited(scene, results, megabytes, groups)
    if code == -999:
        return "hang", said
    if "internal error" in said:
        return "internal error", said
    if any(word in said for word in UNWANTED):
        return "traceback", said
    sentences = [line for line in said.splitlines() if line.startswith("squealstudy:")]
    if code and code not in KILLED and len(sentences) != 1:
        return "silent", f"exit {code}: {said}"
    after = scene.run(results, scene.cache)
    if after.code or after.unwanted:
        return "crash", f"the run after it: {after.said}"
    if different := scene.differences(results):
        return "differs", "; ".join(different)
    if left := leftovers(results):
        return "leftover", ", ".join(map(str, left))
    return ("message" if code and code not in KILLED else "equal"), f"exit {code}: {said[-200:]}"


def _limited(scene: Scene, results: Path, megabytes: int, groups: bool) -> tuple[int, str]:
    """Exit code and words of the command under the limit, its processes in one group."""
    command = [sys.executable, "-c", RUN, "run", f"{scene.name}.toml", "--no-pictures", "--yes"]
    line = shlex.join([*command, "--jobs", "2", "--output", str(results)])
    environment = os.environ | {
        "SQUEALSTUDY_CACHE": str(scene.cache),
        "NUMBA_CACHE_DIR": str(scene.kernels),
        "OMP_NUM_THREADS": "1",
    }
    group = Group(megabytes) if groups else None

    def limit() -> None:
        if group is not None:
            (group.path / "cgroup.procs").write_text(str(os.getpid()))
        else:
            resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20,) * 2)

    try:
        done = subprocess.run(
            ["sh", "-c", f"exec {line}"],
            cwd=scene.folder,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE_S,
            check=False,
            preexec_fn=limit,
        )
    except subprocess.TimeoutExpired:
        return -999, "it does not end"
    finally:
        if group is not None:
            _emptied(group)
    return done.returncode, done.stdout[-500:] + done.stderr


def _emptied(group: Group) -> None:
    """Wait for the group's last processes, then remove it."""
    import time

    for _ in range(100):
        try:
            group.close()
        except OSError:
            time.sleep(0.1)
        else:
            return
    raise RuntimeError(f"processes are left in {group.path}")
