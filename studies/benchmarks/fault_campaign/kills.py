"""Runs that are killed, at random moments and at writes of each kind of file, and run again."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fault_campaign.finding import Finding
from fault_campaign.scenes import (
    FAULT,
    IDS,
    SCENES,
    Ended,
    Scene,
    alive,
    leftovers,
    scenes,
    still_alive,
)
from same_tables import ROOT

PART = "kills"
IN_A_ROW = (1, 1, 2, 3)  # kills before a run is left in peace
AT_WRITES = 0.5  # of the kills; the others come at random moments
ON_CLUSTER = ("brake_geometry",)  # studies whose client is killed, or a worker of the cluster
COLD = 0.3  # of the cases begin with an empty cache
SIGNALS = {
    "SIGKILL parent": (signal.SIGKILL, "parent"),
    "SIGTERM parent": (signal.SIGTERM, "parent"),
    "SIGINT parent": (signal.SIGINT, "parent"),
    "SIGKILL group": (signal.SIGKILL, "group"),
    "SIGTERM group": (signal.SIGTERM, "group"),
    "SIGINT group": (signal.SIGINT, "group"),
    "SIGKILL worker": (signal.SIGKILL, "worker"),
}


@dataclass(frozen=True)
class Kill:
    """A signal to whom, at a share of the time that a run takes, or at a write of some kind."""

    what: str
    share: float
    write: str = ""
    number: int = 1

    def __str__(self) -> str:
        """In words."""
        if self.write:
            return f"{self.what} at '{self.write}' {self.number}"
        return f"{self.what} after {self.share:.0%} of the time"


def run(
    count: int,
    seed: int,
    work: Path,
    names: tuple[str, ...] = SCENES,
    on_cluster: tuple[str, ...] = ON_CLUSTER,
) -> Iterator[Finding]:
    """Kill `count` runs, some of them clients of a cluster; a finding for each."""
    rng, made = random.Random(seed), list(scenes(names, work / PART))
    number = 0
    with contextlib.ExitStack() as stack:
        if on_cluster:
            made += stack.enter_context(_clients(on_cluster, work / f"{PART}_cluster", made))
        while number < count:
            (scene,) = rng.choices(made, [1 / scene.seconds for scene in made])
            kills = [_drawn(scene, rng) for _ in range(min(rng.choice(IN_A_ROW), count - number))]
            cold = rng.random() < COLD or any("models" in kill.write for kill in kills)
            for finding in _case(scene, kills, cold, number):
                yield finding
                number += 1


@contextlib.contextmanager
def _clients(names: tuple[str, ...], folder: Path, here: list[Scene]) -> Iterator[list[Scene]]:
    """Scenes whose points are solved by a scheduler's workers; the tables are those made here."""
    sys.path.insert(0, str(ROOT / "tests"))
    from clusters import Loopback

    folder.mkdir(parents=True, exist_ok=True)
    cluster = Loopback(folder, idle="12h")
    try:
        cluster.add("a", "b", nanny=True)
        place = ("--scheduler", cluster.address)
        made = list(scenes(names, folder, place, cluster.workers))
        for scene in made:
            local = next((one for one in here if one.name == scene.name), scene)
            if different := local.differences(scene.reference):
                raise RuntimeError(f"{scene.name} on a cluster: {'; '.join(different)}")
        yield made
    finally:
        cluster.close()


def _drawn(scene: Scene, rng: random.Random) -> Kill:
    what = rng.choice(list(SIGNALS))
    if scene.writes and rng.random() < AT_WRITES and not what.endswith("worker"):
        kind = rng.choice(sorted(scene.writes))
        number = rng.randint(1, max(1, scene.writes[kind]))
        return Kill(what, 0.0, kind, number)
    return Kill(what, rng.random())


def _case(scene: Scene, kills: list[Kill], cold: bool, number: int) -> Iterator[Finding]:
    """Kills one after the other in one results directory, then a run to the end."""
    results, cache = scene.folder / f"results{number}", scene.folder / f"cache{number}"
    if cold:
        cache.mkdir()
    else:
        shutil.copytree(scene.cache, cache)
    found = []
    for kill in kills:
        ended, there = _killed(scene, kill, results, cache)
        late = ", came too late" if ended.code == 0 else ""
        at = " on a cluster" if scene.workers else ""
        done = f"{scene.name}{at}, {kill}, {'empty' if cold else 'filled'} cache{late}"
        found.append([done, *_verdict(ended, there)])
    last = scene.run(results, cache)
    text, verdict = "", "equal"
    if last.code:
        verdict, text = last.unwanted or "crash", last.said
    elif last.unwanted:
        verdict, text = last.unwanted, last.said
    elif different := scene.differences(results):
        verdict, text = "differs", "; ".join(different)
    elif left := leftovers(results, cache):
        verdict, text = "leftover", ", ".join(map(str, left))
    for k, (done, bad, said) in enumerate(found):
        if bad or k + 1 < len(found):
            yield Finding(PART, number + k, done, bad or "equal", said)
        else:
            yield Finding(PART, number + k, done, verdict, f"the run after it: {text}")
    if verdict == "equal":
        shutil.rmtree(results, ignore_errors=True)
    shutil.rmtree(cache, ignore_errors=True)


def _verdict(ended: Ended, there: list[str]) -> tuple[str, str]:
    """What was wrong with a killed run, and its proof; empty where nothing was."""
    if there:
        return "alive", "; ".join(there)
    if ended.code == -999:
        return "hang", ended.said
    return ended.unwanted, f"exit {ended.code}: {ended.said}"


def _killed(scene: Scene, kill: Kill, results: Path, cache: Path) -> tuple[Ended, list[str]]:
    """Start a run, send the signal; what it said, and what was alive afterwards."""
    mark, (number, who) = uuid.uuid4().hex, SIGNALS[kill.what]
    more = {}
    if kill.write:
        more = {
            FAULT: f"{signal.Signals(number).name} {who} {kill.number} {kill.write}",
            "FAULT_IDS": IDS.pattern,
        }
    began = time.monotonic()
    process = scene.start(results, cache, more, mark)
    if not kill.write:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(kill.share * scene.seconds)
        with contextlib.suppress(ProcessLookupError):
            _send(process, number, who, _workers(scene, process, mark))
    ended = scene.ended(process, results, began)
    return ended, still_alive(mark)


def _workers(scene: Scene, process: subprocess.Popen[str], mark: str) -> list[int]:
    """Process numbers of those who solve a run's points, as far as they have begun."""
    if scene.workers:
        return scene.workers()
    return [p.pid for p in alive(mark) if p.pid != process.pid]


def _send(process: subprocess.Popen[str], number: int, who: str, workers: list[int]) -> None:
    if process.poll() is not None:
        return
    if who == "group":
        os.killpg(process.pid, number)
    elif who == "parent":
        os.kill(process.pid, number)
    elif workers:
        os.kill(workers[-1], number)
