"""Results directories as malice would make them: read by every command, run again, and left alone.

A directory is that of a real small study of some kind, and then changed in one to three places by
somebody who knows how journal and manifest are sealed, so that seals and hashes fit. Each command
must come to a sentence or to a right result: nothing outside is read, written or removed, no code
runs, nothing hangs, and no error is an internal one.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import random
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from fault_campaign.copies import Judged, in_a_copy
from fault_campaign.finding import Finding
from same_tables import copy_studies

import squealstudy as sq
from squealstudy.engine.journal import JOURNAL
from squealstudy.errors import SquealstudyError
from squealstudy.files import sealed

PART = "hostile"
SCENES = (
    *("hulten_modes", "hulten_boundary", "hulten_sensitivity", "hulten_work_precision"),
    *("matrices_modes", "stability_impact_energy", "belt_newmark", "hoffmann_cycles"),
)
PATIENCE_S, MEMORY = 120, 4 << 30
SECRET, CODE = "not yours", "import pathlib\npathlib.Path({mark!r}).write_text('executed')\n"
NAMES = (
    *("../outside/a", "{outside}/a", "chunks/../../outside/a", "link/a", "/dev/zero", "", "."),
    *("C:\\a.parquet", "points.parquet\n", "\x1b[2J.parquet", "chunks/\u202eabc.parquet"),
    *("x" * 5000, "<script>alert(1)</script>", "=cmd|' /C calc'!A0", "chunks", "manifest.json"),
)
VALUES: tuple[Any, ...] = (
    *(None, "", "x", -1, 0, 1e308, -1e308, float("nan"), float("inf"), 10**400, [], {}, [[]]),
    *(True, [None], {"a": None}, "../x", "\x1b[31m<script>$x$", "=1+1", [1, 2], "gone", "\ud800"),
)
COLUMNS: dict[str, Callable[[int], pa.Array]] = {
    "nulls": pa.nulls,
    "formulas": lambda n: pa.array(["=\x1b[2J<b>$^$"] * n),
    "no numbers": lambda n: pa.array([float("nan")] * n),
    "infinities": lambda n: pa.array([float("inf")] * n),
    "1e308": lambda n: pa.array([1e308] * n),
    "zeros": lambda n: pa.array([0] * n),
    "-7": lambda n: pa.array([-7] * n),
    "2^62": lambda n: pa.array([2**62] * n),
    "flags": lambda n: pa.array([True] * n),
    "lists": lambda n: pa.array([[1, 2]] * n, pa.list_(pa.int64())),
    "records": lambda n: pa.array([{"a": 1}] * n),
    "bytes": lambda n: pa.array([b"\xff\xfe"] * n),
}
TEXTS = ("", "x", "ok", "failed", "\x1b[31m", "=1+1", "0" * 16, "f" * 16)
NUMBERS = (float("nan"), float("inf"), -1e308, 1e308, -1.0, 0.0, 1e-300)
WHOLES = (-1, 0, 7, 2**31, -(2**63), 2**62)
Change = Callable[[Path, random.Random], str]


def run(
    count: int,
    seed: int,
    work: Path,
    names: tuple[str, ...] = SCENES,
    pictures: bool = True,
    first: int = 0,
) -> Iterator[Finding]:
    """Make `count` hostile directories, and read each in a copy of this process."""
    folder = work / PART
    whole = _whole(folder, names)
    for number in range(first, first + count):
        rng = random.Random(f"{seed} {number}")
        name = rng.choice(names)
        case = folder / f"case{number}"
        shutil.copytree(whole[name], case / "results", symlinks=True)
        (case / "outside").mkdir()
        for file in ("a", "b", "0123456789abcdef.parquet", "thesis.png"):
            (case / "outside" / file).write_text(SECRET)
        done = "; ".join(
            _changed(rng.choice(CHANGES), case / "results", rng)
            for _ in range(rng.choice((1, 1, 2, 3)))
        )
        study = folder / f"{name}.toml"
        judge = _judge(case, study, pictures, folder / "cache")
        verdict, text = in_a_copy(judge, PATIENCE_S, MEMORY)
        if verdict in ("ok", "message") and (touched := _touched(case)):
            verdict, text = "silent", touched
        if verdict in ("ok", "message"):
            shutil.rmtree(case, ignore_errors=True)
        yield Finding(PART, number, f"{name}: {done}", verdict, text)


def _whole(folder: Path, names: tuple[str, ...]) -> dict[str, Path]:
    """Honest results of each scene."""
    folder.mkdir(parents=True, exist_ok=True)
    copy_studies(folder)
    os.environ["SQUEALSTUDY_CACHE"] = str(folder / "cache")
    found = {}
    for name in names:
        found[name] = folder / "whole" / name
        sq.run(folder / f"{name}.toml", found[name], jobs=1, yes=True)
    return found


# -- what commands make of it --------------------------------------------------------------------
def _judge(case: Path, study: Path, pictures: bool, cache: Path) -> Callable[[], Judged]:
    def judged() -> Judged:
        os.environ["SQUEALSTUDY_CACHE"] = str(cache)
        os.chdir(case)
        said = []
        for command in _commands(case, pictures):
            verdict, text = _said(command)
            if verdict not in ("ok", "message"):
                return verdict, f"{' '.join(command[:1])}: {text}"
            said.append(text)
        verdict, text = _again(study, case / "results")
        return verdict, "; ".join([*filter(None, said), text])

    return judged


def _commands(case: Path, pictures: bool) -> list[list[str]]:
    results = str(case / "results")
    found = [["check", results], ["rank", results], ["rank", results, "--csv"], ["robust", results]]
    if pictures:
        found += [["report", results, "--no-shapes", "--output", str(case / "page.html")]]
    return [*found, ["shape", results], ["compare", results, results]]


def _said(command: list[str]) -> Judged:
    """Run a command of this process: what it said, judged."""
    from squealstudy import screen
    from squealstudy.cli import app

    out = io.StringIO()
    screen.console.file = screen.messages.file = out
    with redirect_stdout(out), redirect_stderr(out), app.warnings_told():
        code = app._outcome(command)
    text = out.getvalue()
    if "internal error" in text or "Traceback" in text:
        return "internal error", text[-300:]
    if "\x1b" in text or "\u202e" in text:
        return "silent", f"steers a terminal: {text[-200:]!r}"
    if code and not text.strip():
        return "silent", f"exit {code} without a word"
    return ("message" if code else "ok"), text.strip().splitlines()[-1][:200] if code else ""


def _again(study: Path, results: Path) -> Judged:
    """The receiver runs the study there: tables of an undisturbed run, or a sentence."""
    try:
        sq.run(study, results, jobs=1, yes=True, warn=lambda text: None)
    except SquealstudyError as error:
        return "message", f"run: {error}"
    return "ok", ""


def _touched(case: Path) -> str:
    """What of the files outside is not as it was, or was executed; empty where all is well."""
    outside = {p.name: p for p in (case / "outside").iterdir()}
    if {p.read_text() for p in outside.values()} != {SECRET} or len(outside) != 4:
        return f"files outside: {sorted(outside)}"
    if (case / "executed").exists():
        return "code was executed"
    page = case / "page.html"
    if page.exists() and "<script>alert" in page.read_text(errors="replace"):
        return "a script in the report"
    return ""


def _changed(change: Change, results: Path, rng: random.Random) -> str:
    try:
        return change(results, rng)
    except OSError as error:  # what an earlier change has made cannot be opened by this one
        return f"none: {error.strerror}"


# -- changes -------------------------------------------------------------------------------------
def enter(results: Path, name: str) -> None:
    """A line of the journal for a file, as the one who changed it can write it."""
    content = (results / name).read_bytes()
    line = {"files": {name: [len(content), hashlib.sha256(content).hexdigest()]}}
    with (results / JOURNAL).open("a") as journal:
        journal.write(json.dumps(line) + "\n")


def _names(results: Path, rng: random.Random) -> str:
    """Lines of the journal with names that no run writes."""
    outside = results.parent / "outside"
    name = rng.choice(NAMES).replace("{outside}", str(outside))
    if name.startswith("link/") and not (results / "link").exists():
        (results / "link").symlink_to(outside)
    key = rng.choice(("files", "gone"))
    said: Any = {name: [len(SECRET), "00"]} if key == "files" else [name]
    with (results / JOURNAL).open("a") as journal:
        journal.write(json.dumps({key: said}) + "\n")
    return f"journal {key} {name[:40]!r}"


def _journal(results: Path, rng: random.Random) -> str:
    """Bytes and shapes that no journal has."""
    what = {
        "deep": b'{"files": ' + b"[" * 100_000 + b"]" * 100_000 + b"}\n",
        "huge number": b'{"files": {"points.parquet": [1' + b"0" * 5000 + b', "00"]}}\n',
        "twice": b'{"files": {}, "files": {"../outside/a": [1, "0"]}}\n',
        "no UTF-8": b'{"gone": ["\xff\xfe"]}\n',
        "owner": b'{"owner": ["\\u001b[2J", "x", "y"]}\n',
        "no object": b"[1, 2]\nnull\n7\n",
        "long": b"x" * 5_000_000 + b"\n",
    }
    name = rng.choice(list(what))
    with (results / JOURNAL).open("ab") as journal:
        journal.write(what[name])
    return f"journal {name}"


def _links(results: Path, rng: random.Random) -> str:
    """Links, pipes and devices in the place of files and folders."""
    places = [p for p in results.rglob("*") if not p.is_symlink()]
    place = rng.choice([*places, results / ".lock", results / "damaged"])
    targets = [results.parent / "outside", results.parent / "outside" / "a"]
    target = rng.choice([*targets, Path("/dev/zero"), Path("/dev/stdin"), place])
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    else:
        place.unlink(missing_ok=True)
    if rng.random() < 0.15 and place.parent.is_dir():
        os.mkfifo(place)
        return f"a pipe for {place.name}"
    place.symlink_to(target)
    return f"{place.name} -> {target}"


def _places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if at:
        yield at
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value[:3]):
            yield from _places(inner, (*at, key))


def _facts(results: Path, rng: random.Random) -> str:
    """A fact of the manifest of another type or value, sealed again."""
    path = results / "manifest.json"
    if not path.is_file() or path.is_symlink():
        return "no manifest"
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError):  # an earlier change
        return "no manifest"
    if not isinstance(content, dict):
        return "no manifest"
    content.pop("sha256", None)
    at, value = rng.choice(list(_places(content))), rng.choice(VALUES)
    inner = content
    for key in at[:-1]:
        inner = inner[key]
    if value == "gone":
        del inner[at[-1]]
    else:
        inner[at[-1]] = value
    path.write_text(sealed(content))
    return f"{'.'.join(map(str, at))} = {str(value)[:30]!r}"


def _manifest(results: Path, rng: random.Random) -> str:
    """Text that no manifest has."""
    path = results / "manifest.json"
    path.unlink(missing_ok=True)
    what = {
        "deep": b"[" * 200_000,
        "deep object": b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
        "number": b'{"n_points": 1' + b"0" * 6000 + b"}",
        "no UTF-8": b"\xff\xfe\x00{",
        "NaN": b"NaN",
        "empty": b"",
        "twice": b'{"name": "a", "name": "b", "kind": "complex_modes", "model": "hulten"}',
        "surrogate": b'{"name": "\\ud800", "kind": "complex_modes", "model": "hulten"}',
    }
    name = rng.choice(list(what))
    path.write_bytes(what[name])
    return f"manifest {name}"


def _column(results: Path, rng: random.Random) -> str:
    """A column of another type or without sense, in a table whose hash fits."""
    tables = [p for p in sorted(results.rglob("*.parquet")) if p.is_file() and not p.is_symlink()]
    if not tables:
        return "no table"
    path = rng.choice(tables)
    try:
        table = pq.read_table(path)
    except (OSError, ValueError):
        return "no table"
    column = rng.choice(table.column_names)
    place, n = table.column_names.index(column), table.num_rows
    what = rng.choice((*COLUMNS, "gone", "no rows", "rows twice", "renamed", "reversed"))
    if what in COLUMNS:
        table = table.set_column(place, column, COLUMNS[what](n))
    elif what == "gone":
        table = table.remove_column(place)
    elif what == "no rows":
        table = table.slice(0, 0)
    elif what == "rows twice":
        table = pa.concat_tables([table, table])
    elif what == "renamed":
        names = ["\x1b[2J" if c == column else c for c in table.column_names]
        table = table.rename_columns(names)
    elif n:
        table = table.take(pa.array(range(n - 1, -1, -1)))
    pq.write_table(table, path)
    enter(results, path.relative_to(results).as_posix())
    return f"{path.name[:20]} {column}: {what}"


def _rows(results: Path, rng: random.Random) -> str:
    """Values of a few rows forged, with the types that they have: most of them in chunk files."""
    tables = [p for p in sorted(results.rglob("*.parquet")) if p.is_file() and not p.is_symlink()]
    chunks = [p for p in tables if p.parent.name == "chunks"]
    if not tables:
        return "no table"
    path = rng.choice(chunks if chunks and rng.random() < 0.7 else tables)
    try:
        table = pq.read_table(path)
    except (OSError, ValueError):
        return "no table"
    column, values = rng.choice(table.column_names), {str: TEXTS, float: NUMBERS, int: WHOLES}
    cells = table[column].to_pylist()
    kind = table.schema.field(column).type
    what = "null"
    for row in rng.sample(range(len(cells)), min(len(cells), rng.choice((1, 2, 100)))):
        old = cells[row]
        if isinstance(old, list):
            inner = type(old[0]) if old else float
            new = rng.choice((None, [], old[:-1], old * 2, [rng.choice(values.get(inner, [None]))]))
        else:
            new = rng.choice((None, *values.get(type(old), (None,)), cells[0]))
        cells[row], what = new, str(new)[:20]
    try:
        forged = pa.array(cells, kind)
        place = table.column_names.index(column)
        table = table.set_column(place, table.schema.field(column), forged)
        pq.write_table(table, path.with_suffix(".new"))
    except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
        path.with_suffix(".new").unlink(missing_ok=True)
        return "no such value"
    path.with_suffix(".new").replace(path)
    enter(results, path.relative_to(results).as_posix())
    return f"{path.parent.name}/{path.name[:12]} {column}: {what}"


def _bomb(results: Path, rng: random.Random) -> str:
    """Much in little: columns and arrays that are small on disk alone."""
    if rng.random() < 0.6:
        rows = 200_000_000
        table = pa.table({"point_id": pa.array([""], pa.string()).take(pa.array([0] * 1000))})
        path = results / "points.parquet"
        path.unlink(missing_ok=True)
        with pq.ParquetWriter(path, table.schema, compression="zstd") as writer:
            big = pa.table({"point_id": pa.nulls(20_000_000, pa.string())})
            for _ in range(rows // len(big)):
                writer.write_table(big, row_group_size=len(big))
        enter(results, path.name)
        return "a table of 2e8 rows"
    folder = results / "states"
    if folder.is_symlink():
        return "no states"
    folder.mkdir(exist_ok=True)
    path = folder / "0123456789abcdef.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (10**13,)}
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", header.getvalue() + bytes(10**7))
    enter(results, f"states/{path.name}")
    return "a state of 1e13 numbers"


def _code(results: Path, rng: random.Random) -> str:
    """Code that the manifest names, and that stands in the directory, with fitting hashes."""
    path = results / "manifest.json"
    text = CODE.format(mark=str(results.parent / "executed"))
    for name in ("my_law.py", "numpy.py", "multiprocessing.py", "sitecustomize.py"):
        (results / name).write_text(text)
        (results.parent / name).write_text(text)
    if not path.is_file() or path.is_symlink():
        return "code beside"
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError):  # an earlier change
        return "code beside"
    if not isinstance(content, dict):
        return "code beside"
    content.pop("sha256", None)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    name = rng.choice(("my_law.py", str(results / "my_law.py"), "../my_law.py"))
    content["extensions"] = [{"name": name, "hash": digest, "sources": {name: text}}]
    study = str(content.get("study", ""))
    content["study"] = study.replace("[study]", f"[study]\nextensions = [{json.dumps(name)}]", 1)
    path.write_text(sealed(content))
    return f"code {name[-12:]}"


def _others(results: Path, rng: random.Random) -> str:
    """References, names and histories of another type."""
    what = rng.choice(("references", "names", "histories"))
    if what == "names":
        content = {"modes": [], "tracks": rng.choice((None, [], {"x": 1}, {"1": "a"}))}
        (results / "names.json").unlink(missing_ok=True)
        (results / "names.json").write_text(sealed(content))
        return "names"
    folder = results / what
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        return f"no {what}"
    folder.mkdir(exist_ok=True)
    found = sorted(p for p in folder.iterdir() if p.is_file() and not p.is_symlink())
    ending = "json" if what == "references" else "parquet"
    path = rng.choice(found) if found else folder / f"0123456789abcdef.{ending}"
    text = rng.choice(
        (b"[" * 50_000, b"3", b'{"point_id": 1}', b"{}", b'{"point_id": "a"}', b"\xff")
    )
    path.write_bytes(text)
    enter(results, f"{what}/{path.name}")
    return f"{what} {text[:20]!r}"


CHANGES: tuple[Change, ...] = (
    *(_names, _journal, _links, _links, _facts, _facts, _facts, _manifest),
    *(_rows, _rows, _rows),
    *(_column, _column, _column, _bomb, _code, _others),
)
