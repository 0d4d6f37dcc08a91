"""Workers of a cluster that have none of a study's files: the same tables, or a sentence.

Each worker has a mount namespace in which the folder of the study is empty. Needs root.
"""

from __future__ import annotations

import random
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from fault_campaign.finding import Finding
from fault_campaign.scenes import Scene, leftovers, scenes
from same_tables import ROOT

PART = "far workers"
SCENES = ("own_blocks", "matrices_modes", "brake_geometry", "hoffmann_cycles")
HIDE = """\
import ctypes, os, subprocess
if ctypes.CDLL(None, use_errno=True).unshare(0x00020000):
    raise OSError(ctypes.get_errno(), "no namespace of mounts")
subprocess.run(["mount", "--make-rprivate", "/"], check=True)
subprocess.run(["mount", "-t", "tmpfs", "none", {folder!r}], check=True)
assert not os.listdir({folder!r})
"""


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Run `count` studies on such workers, with an empty cache here or a filled one."""
    sys.path.insert(0, str(ROOT / "tests"))
    from clusters import Loopback

    here = work / "far_workers"
    made = list(scenes(names, here / "studies"))
    cluster = Loopback(here, idle="12h")
    try:
        cluster.add("a", "b", before=HIDE.format(folder=str(here / "studies")))
        for number in range(count):
            rng = random.Random(f"{seed} {number}")
            scene, cold = made[number % len(made)], rng.random() < 0.7
            verdict, text = _tried(scene, cluster.address, cold, number)
            done = f"{scene.name}, {'empty' if cold else 'filled'} cache here"
            yield Finding(PART, number, done, verdict, text)
    finally:
        cluster.close()


def _tried(scene: Scene, address: str, cold: bool, number: int) -> tuple[str, str]:
    far = Scene(scene.name, scene.folder, ("--scheduler", address), tables=scene.tables)
    results, cache = scene.folder / f"results{number}", scene.folder / f"cache{number}"
    if cold:
        cache.mkdir()
    else:
        shutil.copytree(scene.cache, cache)
    ended = far.run(results, cache)
    if ended.unwanted:
        return ended.unwanted, ended.said
    if ended.code:
        sentences = [line for line in ended.said.splitlines() if line.startswith("squealstudy:")]
        return ("message" if len(sentences) == 1 else "silent"), ended.said
    if different := far.differences(results):
        return "differs", "; ".join(different)
    if left := leftovers(results, cache):
        return "leftover", ", ".join(map(str, left))
    return "equal", ""
