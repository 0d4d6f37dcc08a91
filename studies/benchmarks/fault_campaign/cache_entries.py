"""Entries of a cache that somebody changed who knows how they are sealed: made again, or harmless.

Whoever shares a cache is trusted with numbers, not with code or with memory: an entry of other
numbers may give other tables; one of other shapes, types, classes or names gives none.
"""

from __future__ import annotations

import functools
import hashlib
import io
import json
import os
import random
import resource
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from fault_campaign.copies import Judged, in_a_copy
from fault_campaign.finding import Finding
from fault_campaign.scenes import leftovers, tables_of
from same_tables import copy_studies, study_differences

from squealstudy.files import file_hash, sealed

PART = "cache entries"
SCENES = ("matrices_modes", "belt_newmark", "own_blocks", "brake_geometry")
PATIENCE_S = 300
META = "meta.json"
VALUES: tuple[Any, ...] = (
    *(None, "", "x", -1, 0, 1e308, float("nan"), 10**400, [], {}, [[]], True, "../x", [1, 2]),
    *({"class": "os.system", "fields": {}}, {"array": "../x"}, {"csr": [], "shape": [1, 1]}),
)
Change = Callable[[np.ndarray, random.Random], np.ndarray]
ARRAYS: dict[str, Change] = {
    "shorter": lambda a, rng: a[:-1],
    "longer": lambda a, rng: np.concatenate([a, a]),
    "empty": lambda a, rng: a[:0],
    "another axis": lambda a, rng: a[None],
    "no axis": lambda a, rng: a.ravel()[:1].reshape(()),
    "texts": lambda a, rng: a.astype(str),
    "complex": lambda a, rng: a.astype(complex),
    "flags": lambda a, rng: a.astype(bool),
    "no numbers": lambda a, rng: np.full(a.shape, np.nan),
    "1e308": lambda a, rng: np.full(a.shape, 1e308),
    "-7": lambda a, rng: np.full(a.shape, -7, a.dtype if a.dtype.kind in "if" else int),
    "2^40": lambda a, rng: np.full(a.shape, 2**40),
    "zeros": lambda a, rng: np.zeros_like(a),
    "turned": lambda a, rng: np.asfortranarray(a.T),
}


def run(count: int, seed: int, work: Path, names: tuple[str, ...] = SCENES) -> Iterator[Finding]:
    """Change `count` entries and run the study that reads them; a finding for each."""
    folder = work / "cache_entries"
    folder.mkdir(parents=True, exist_ok=True)
    copy_studies(folder)
    for name in names:  # in a copy: what a process has read of a cache it keeps
        verdict, text = in_a_copy(
            functools.partial(_run, folder, name, folder / "whole" / name, folder / "cache"),
            PATIENCE_S,
            resource.RLIM_INFINITY,
        )
        if verdict != "ok":
            raise RuntimeError(f"{name} fails undisturbed: {text}")
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        name, case = rng.choice(names), folder / f"case{number}"
        shutil.copytree(folder / "cache", case / "cache")
        done, trusted = _changed(case / "cache", rng)
        judge = functools.partial(_judged, folder, name, case, trusted)
        verdict, text = in_a_copy(judge, PATIENCE_S, resource.RLIM_INFINITY)
        if verdict in ("ok", "equal", "message"):
            shutil.rmtree(case)
        yield Finding(PART, number, f"{name}: {done}", verdict, text)


def _run(folder: Path, name: str, results: Path, cache: Path) -> Judged:
    import squealstudy as sq
    from squealstudy.errors import SquealstudyError

    os.environ["SQUEALSTUDY_CACHE"] = str(cache)
    os.chdir(folder)
    try:
        sq.run(f"{name}.toml", results, jobs=1, yes=True, warn=lambda text: None)
    except SquealstudyError as error:
        return "message", str(error)
    return "ok", ""


def _judged(folder: Path, name: str, case: Path, trusted: bool) -> Judged:
    """Tables of the undisturbed run, or what changed numbers give: never an unforeseen error."""
    verdict, text = _run(folder, name, case / "results", case / "cache")
    if verdict != "ok":
        return ("message" if trusted else "differs"), text
    tables = tables_of(case / "results")
    if left := leftovers(case / "results", case / "cache"):
        return "leftover", ", ".join(map(str, left))
    different = list(study_differences(tables_of(folder / "whole" / name), tables))
    if different and not trusted:
        return "silent", "; ".join(different)
    return ("ok", "") if different else ("equal", "")


# -- changes -------------------------------------------------------------------------------------
def _changed(cache: Path, rng: random.Random) -> tuple[str, bool]:
    """Change an entry; what was done, and whether it is one whose numbers are trusted."""
    entries = sorted(path.parent for path in cache.rglob(META))
    gaps = sorted(cache.rglob("working_points/*.npz"))
    if gaps and rng.random() < 0.2:
        return _working_points(rng.choice(gaps), rng), True
    entry = rng.choice(entries)
    what = rng.choice((_bytes, _array, _array, _array, _fact, _fact, _link))
    return what(entry, rng)


def _bytes(entry: Path, rng: random.Random) -> tuple[str, bool]:
    """As a disk would: no seal fits."""
    file = rng.choice(sorted(p for p in entry.iterdir() if p.is_file()))
    content = bytearray(file.read_bytes())
    place = rng.randrange(len(content))
    if rng.random() < 0.5:
        del content[place:]
    else:
        content[place] ^= 1 << rng.randrange(8)
    file.write_bytes(bytes(content))
    return f"{file.name} changed at byte {place}", False


def _array(entry: Path, rng: random.Random) -> tuple[str, bool]:
    """Another array, with a fitting hash."""
    arrays = sorted(entry.glob("*.npy"))
    if not arrays:  # an entry of facts alone
        return _fact(entry, rng)
    file = rng.choice(arrays)
    what, array = rng.choice(list(ARRAYS)), np.load(file)
    if not array.ndim:
        array = array[None]
    np.save(file, ARRAYS[what](array, rng))
    _seal(entry, lambda content: content["files"].update({file.name: file_hash(file)}))
    return f"{file.name}: {what}", True


def _places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield from [at] if at else []
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value[:3]):
            yield from _places(inner, (*at, key))


def _fact(entry: Path, rng: random.Random) -> tuple[str, bool]:
    """Another value of what stands beside the arrays."""
    done = ""

    def change(content: dict[str, Any]) -> None:
        nonlocal done
        at, value = rng.choice(list(_places(content))), rng.choice(VALUES)
        inner: Any = content
        for key in at[:-1]:
            inner = inner[key]
        inner[at[-1]] = value
        done = f"{'.'.join(map(str, at))} = {str(value)[:30]}"

    _seal(entry, change)
    return done, True


def _link(entry: Path, rng: random.Random) -> tuple[str, bool]:
    """A link or a device in the place of a file."""
    file = rng.choice(sorted(p for p in entry.iterdir() if p.is_file()))
    file.unlink()
    target = rng.choice(("/dev/zero", "/etc/passwd", file.name))
    file.symlink_to(target)
    return f"{file.name} -> {target}", False


def _seal(entry: Path, change: Callable[[dict[str, Any]], None]) -> None:
    content = json.loads((entry / META).read_bytes())
    content.pop("sha256", None)
    change(content)
    (entry / META).write_text(sealed(content))


def _working_points(file: Path, rng: random.Random) -> str:
    """Working points of other shapes, named by their hash as the cache names them."""
    with np.load(file) as data:
        keys, gaps = data["keys"], data["gaps"]
    what = rng.choice(list(ARRAYS))
    made = io.BytesIO()
    np.savez(made, keys=keys, gaps=ARRAYS[what](gaps, rng))
    file.unlink()
    name = hashlib.sha256(made.getvalue()).hexdigest()
    file.with_name(f"{name}.npz").write_bytes(made.getvalue())
    return f"working points: {what}"
