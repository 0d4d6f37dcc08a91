"""Files of results and of the cache with a bit flipped or an end cut off, read and run again."""

from __future__ import annotations

import hashlib
import importlib
import os
import random
import re
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
from fault_campaign.copies import in_a_copy
from fault_campaign.finding import Finding
from fault_campaign.scenes import FAULT, IDS, Scene, leftovers, scenes, tables_of
from same_tables import MEASURED, fits

from squealstudy.engine.journal import JOURNAL

PART = "damage"
SCENES = (
    *("hulten_modes", "hulten_boundary", "hulten_sensitivity", "matrices_modes"),
    *("hulten_work_precision", "belt_newmark", "brake_geometry", "own_blocks"),
    *("hoffmann_cycles", "stability_impact_energy", "hulten_fidelity"),
)
STATES = ("complete", "unfinished", "cache")  # of the last only the cache is there
PATIENCE_S = 300


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Damage `count` files, one at a time; a finding for each."""
    rng, made = random.Random(seed), list(scenes(names, work / PART))
    _import_all()
    unfinished = {scene.name: _unfinished(scene) for scene in made}
    for number in range(count):
        (scene,) = rng.choices(made, [scene.seconds**-0.5 for scene in made])
        yield _case(scene, unfinished[scene.name], rng.choice(STATES), rng, number)


def _import_all() -> None:
    """What a run imports: each case is a copy of this process."""
    for name in ("squealstudy.face", "squealstudy.engine.runner", "squealstudy.engine.results"):
        importlib.import_module(name)


def _case(scene: Scene, unfinished: Path, state: str, rng: random.Random, number: int) -> Finding:
    folder = scene.folder / f"case{number}"
    results, cache = folder / "results", folder / "cache"
    shutil.copytree(scene.cache, cache)
    if state == "cache" and not any(path.is_file() for path in cache.rglob("*")):
        state = "complete"  # small models keep nothing there
    if state != "cache":
        shutil.copytree(unfinished if state == "unfinished" else scene.reference, results)
    file = _chosen(cache if state == "cache" else results, rng)
    done = f"{scene.name}, {state}: {file.relative_to(folder)} {_damage(file, rng)}"
    verdict, text = in_a_copy(
        lambda: _judged(scene, state, results, cache, file), PATIENCE_S, resource.RLIM_INFINITY
    )
    shutil.rmtree(folder)
    return Finding(PART, number, done, verdict, text)


def _unfinished(scene: Scene) -> Path:
    """Results of a run that is killed when it writes its first table."""
    results = scene.folder / f"results_{scene.name}"
    kind = next(kind for kind in scene.writes if re.fullmatch(r"rename \w+\.parquet", kind))
    more = {FAULT: f"SIGKILL parent 1 {kind}", "FAULT_IDS": IDS.pattern}
    if scene.run(results, scene.cache, more).code == 0:
        raise RuntimeError(f"{scene.name}: no kill at '{kind}'")
    return results


def _chosen(folder: Path, rng: random.Random) -> Path:
    """A file of a kind drawn first: there are many chunks and one manifest."""
    kinds: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.stat().st_size and ".lock" not in path.name:
            kinds.setdefault(IDS.sub("*", str(path.relative_to(folder))), []).append(path)
    return rng.choice(kinds[rng.choice(sorted(kinds))])


def _damage(file: Path, rng: random.Random) -> str:
    """Damage a file; what was done to it."""
    content = bytearray(file.read_bytes())
    what = rng.choice(("flip", "flip", "flip", "cut", "empty", "zeros", "gone"))
    place = rng.randrange(len(content))
    if what == "flip":
        bit = rng.randrange(8)
        content[place] ^= 1 << bit
        text = f"bit {bit} of byte {place} flipped"
    elif what == "cut":
        del content[place:]
        text = f"cut to {place} bytes"
    elif what == "zeros":
        end = min(len(content), place + 64)
        content[place:end] = bytes(end - place)
        text = f"bytes {place} to {end} zero"
    else:
        content.clear()
        text = "emptied" if what == "empty" else "removed"
    file.write_bytes(bytes(content))
    if what == "gone":
        file.unlink()
    return text


def _judged(scene: Scene, state: str, results: Path, cache: Path, file: Path) -> tuple[str, str]:
    """Read the results as a user would, run the study again, look at all that is there."""
    import squealstudy as sq
    from squealstudy.errors import SquealstudyError

    os.environ["SQUEALSTUDY_CACHE"] = str(cache)
    os.environ["NUMBA_CACHE_DIR"] = str(scene.kernels)
    os.chdir(scene.folder)
    damaged = _digest(file)
    if state == "complete" and (text := _read_wrongly(scene, results, sq)):
        return "silent", f"read by open_results: {text}"
    said: list[str] = []
    try:
        sq.run(f"{scene.name}.toml", results, jobs=1, yes=True, warn=said.append)
    except SquealstudyError as error:
        named = file.name in str(error) or str(results) in str(error)
        return ("message" if named else "differs"), f"refused: {error}"
    if different := scene.differences(results):
        return "silent", f"after the run: {'; '.join(different)}"
    if left := leftovers(results, cache):
        return "leftover", ", ".join(map(str, left))
    if state != "cache" and damaged and _digest(file) == damaged and not _told(results, file):
        return "silent", f"still damaged, and not told: {said}"
    return "equal", "; ".join(said)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def _read_wrongly(scene: Scene, results: Path, sq: Any) -> str:
    """What differs from the undisturbed tables where reading says nothing of the damage."""
    from squealstudy.errors import SquealstudyError

    try:
        found = sq.open_results(results)
        tables = {name: found.table(name) for name in found.tables}
    except SquealstudyError:
        return ""
    for name, table in tables.items():
        true = tables_of(scene.reference)[name]
        columns = [c for c in true if not fits(c, MEASURED)]
        if not _same(true[columns], table.reindex(columns=columns)):
            return name
    return ""


def _same(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    return a.astype(str).equals(b.astype(str))


def _told(results: Path, file: Path) -> bool:
    """Whether the check of a results directory names a file.

    A line lost from a journal may leave all that counts whole: it is told all the same.
    """
    command = [sys.executable, "-m", "squealstudy", "check", str(results)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    code = 0 if file.name == JOURNAL else 1
    return done.returncode >= code and file.name in done.stdout + done.stderr
