"""Study files, mutated: refused with file and key or line, or every value is used as it stands.

Most changes are made to lines, whose keys, values and tables are known; some to bytes. Changes that
say the same in other words must change nothing.
"""

from __future__ import annotations

import contextlib
import math
import random
import resource
import shutil
import signal
import subprocess
import sys
import tomllib
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fault_campaign.finding import Finding

import squealstudy as sq
from squealstudy.errors import SquealstudyError, StudyFileError

PART = "study files"
STUDIES = Path(__file__).parents[2]
PATIENCE_S, MEMORY = 40, 6 << 30  # of processor time, enough for a design of 1,000,000 points
EVERY = 500  # cases one is given to the real command as well
SEEDS = (
    *("first_brake", "hulten_flutter", "stability_boundary", "squeal_nominal", "squeal_damping"),
    *("belt_oscillator", "robust_brake", "sensitivity", "caliper_modes", "hoffmann_flutter"),
    *("fidelity/onset_scene", "fidelity/continuation_scene", "stability/explicit_limit"),
    *("stability/windows", "benchmarks/same_tables/hulten_work_precision"),
    *("benchmarks/same_tables/matrices_modes", "benchmarks/same_tables/brake_run_newmark"),
    *("kicked_squeal", "cycles_from_onset", "kicked_design"),
)
VALUES = (
    *("0", "-0.0", "-1", "1e308", "-1e308", "1e-320", "nan", "inf", "-inf", "true", "false", '""'),
    *("9223372036854775808", "1" + 400 * "0", "0x10", "1_000", "'text'", "[]", "[[]]", "{}", "3"),
    *("[1]", "[1, 2, 3]", "[2, 1]", "[nan, 1]", "1979-05-27", "07:32:00", "[true]", '"1.0"', "0.5"),
    *("['a', 'b']", "{a = 1}", "1e9", "1000000000", "2.0", '"\\u0000"', '"\\u202Eabc"', '"ä ö"'),
    *('"../../etc"', "1e400", "[" * 60 + "]" * 60, "{value = 1.0}", '"""a\nb"""', "12", "1e-3"),
)
CHARACTERS = ("\x00", "\u202e", "\ufeff", "ä", '"', "'", "[", "]", "=", ".", "#", "\n", "\r", "\\")


@dataclass(frozen=True)
class Line:
    """A line ``key = value`` of a file: its number, table and parts."""

    number: int
    table: str
    key: str
    value: str


@dataclass(frozen=True)
class Mutated:
    """A text, what was done, and what must be true of it where it is read.

    `refused`: it must not be read. `same`: it means what the whole file does.
    """

    text: bytes
    done: str
    refused: bool = False
    same: bool = False


def run(count: int, seed: int, work: Path) -> Iterator[Finding]:
    """Read `count` mutated files; a finding for each."""
    folder = work / "study_files"
    shutil.copytree(
        STUDIES, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.md", "*.py")
    )
    rng = random.Random(seed)
    texts = {name: (folder / f"{name}.toml").read_text() for name in SEEDS}
    meant = {name: _meaning(sq.read_study(folder / f"{name}.toml")) for name in SEEDS}
    for number in range(count):
        name = rng.choice(SEEDS)
        made = rng.choice(MUTATIONS)(texts[name], rng)
        path = (folder / name).with_name("case.toml")
        path.write_bytes(made.text)
        with _limited():
            verdict, text = _judged(path, made, meant[name])
        if verdict in ("ok", "message") and number % EVERY == 0:
            verdict, text = _by_command(path, verdict)
        if verdict not in ("ok", "message"):
            path.rename(path.with_name(f"case{number}.toml"))
        yield Finding(PART, number, f"{name}: {made.done}", verdict, text)


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """Within, this process has so much time and memory."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGVTALRM, _too_long)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, before[1]))
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.signal(signal.SIGVTALRM, handler)


def _judged(path: Path, made: Mutated, meant: Any) -> tuple[str, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            study = sq.read_study(path)
            meaning = _meaning(study)
            study.plan()
    except TimeoutError:
        return "hang", ""
    except SquealstudyError as error:
        return _message(path, made, error)
    except Exception as error:
        return "traceback", f"{error!r} {traceback.format_exc()[-300:]}"
    if made.refused:
        return "silent", "read as if it were right"
    if made.same and meaning != meant:
        return "silent", "read, but means something else"
    tables = tomllib.loads(made.text.decode("utf-8-sig"))
    unlike = _unlike(tables, study.resolved.definition.model_dump(by_alias=True), ())
    return ("silent", f"not used as it stands: {unlike}") if unlike else ("ok", "")


def _message(path: Path, made: Mutated, error: SquealstudyError) -> tuple[str, str]:
    said = str(error)
    if made.same:
        return "differs", said
    placed = not isinstance(error, StudyFileError) or error.line or error.key or _whole(said)
    if str(path) not in said or not placed:
        return "differs", f"without file, key or line: {said}"
    if len(said) > 4000 or "\x00" in said:
        return "differs", f"not to be read: {said!r}"
    return "message", said


def _whole(said: str) -> bool:
    """Whether a message is about a file as a whole."""
    return "not valid TOML" in said or "nested too deeply" in said


def _by_command(path: Path, verdict: str) -> tuple[str, str]:
    """The same by the command: 0 or 2, or 1 with a message, and no trace of Python."""
    command = [sys.executable, "-m", "squealstudy", "check", str(path)]
    with contextlib.suppress(subprocess.TimeoutExpired):
        done = subprocess.run(
            command, capture_output=True, timeout=300, check=False, cwd=path.parent
        )
        said = (done.stdout + done.stderr).decode(errors="replace")
        if "Traceback" in said or "internal error" in said:
            return "traceback" if "Traceback" in said else "internal error", said[-300:]
        fits = done.returncode == 2 if verdict == "message" else done.returncode in (0, 1, 2)
        return (
            (verdict, "by the command") if fits else ("differs", f"exits {done.returncode} {said}")
        )
    return "hang", "by the command"


def _too_long(*_: object) -> None:
    raise TimeoutError


def _meaning(study: Any) -> Any:
    """What a study has resolved to, without the text that it came from."""
    found = study.resolved
    rest = [getattr(found, name, None) for name in ("options", "values", "sweeps")]
    return repr((found.kind.name, found.definition, rest))


def _unlike(given: Any, used: Any, at: tuple[str, ...]) -> str:
    """The first place at which a file's table and what it was read as differ; empty for none."""
    if isinstance(given, Mapping) and isinstance(used, Mapping):
        for key, value in given.items():
            if key in used and (text := _unlike(value, used[key], (*at, key))):
                return text
            if key not in used and not _flattened(key, value, used):
                return ".".join((*at, key))
        return ""
    if isinstance(given, list) and isinstance(used, list | tuple):
        pairs = zip(given, used, strict=False)
        texts = (_unlike(a, b, (*at, str(i))) for i, (a, b) in enumerate(pairs))
        return ".".join(at) if len(given) != len(used) else next(filter(None, texts), "")
    return "" if _equal(given, used) else f"{'.'.join(at)}: {given!r} is {used!r}"


def _flattened(key: str, value: Any, used: Mapping[str, Any]) -> bool:
    """Whether a table of tables stands in `used` with dotted keys, as those of parameters do."""
    if not isinstance(value, Mapping):
        return key in used and _equal(value, used[key])
    return all(_flattened(f"{key}.{k}", v, used) for k, v in value.items())


def _equal(given: Any, used: Any) -> bool:
    if isinstance(given, bool) != isinstance(used, bool):
        return False
    if isinstance(given, int | float) and isinstance(used, int | float):
        return math.isfinite(used) and given == used
    if isinstance(used, str) and isinstance(given, int | float):
        return repr(given) == used  # coefficients
    if isinstance(given, str) and isinstance(used, float):
        return "budget" in given or any(given.endswith(unit) for unit in ("s", "min", "h"))
    return bool(given == used)


# -- mutations ----------------------------------------------------------------------------------


def _lines(text: str) -> list[Line]:
    """Its lines of one key and its whole value."""
    found, table = [], ""
    for number, line in enumerate(text.split("\n")):
        stripped = line.strip()
        if stripped.startswith("["):
            table = stripped.split("#")[0].strip().strip("[]").strip()
        elif "=" in stripped and not stripped.startswith("#"):
            key, _, value = stripped.partition("=")
            with contextlib.suppress(tomllib.TOMLDecodeError):
                tomllib.loads(f"a = {value}")
                found.append(Line(number, table, key.strip(), value.strip()))
    return found


def _replaced(text: str, number: int, *new: str) -> bytes:
    lines = text.split("\n")
    lines[number : number + 1] = new
    return "\n".join(lines).encode()


def _value(text: str, rng: random.Random) -> Mutated:
    line, value = rng.choice(_lines(text)), rng.choice(VALUES)
    done = f"[{line.table}] {line.key} = {value[:30]}"
    plain = value not in ("true", "false", "0.5", "2.0", "12", "3", "0", "1e-3")
    words = line.key in ("description", "extensions")
    never = not words and plain and value in ("nan", "inf", "-inf", "1e400", "[true]")
    return Mutated(_replaced(text, line.number, f"{line.key} = {value}"), done, refused=never)


def _misspelt(text: str, rng: random.Random) -> Mutated:
    line = rng.choice(_lines(text))
    at = rng.randrange(len(line.key))
    letter = rng.choice("abcdefghijklmnopqrstuvwxyz_-0ABC")
    key = rng.choice(
        (
            line.key[:at] + letter + line.key[at:],
            line.key[:at] + line.key[at + 1 :],
            line.key.upper(),
        )
    )
    known = {found.key for found in _lines(text)}
    refused = key not in known and key != "" and '"' not in key
    done = f"[{line.table}] {line.key} -> {key}"
    return Mutated(_replaced(text, line.number, f"{key} = {line.value}"), done, refused)


def _doubled(text: str, rng: random.Random) -> Mutated:
    line = rng.choice(_lines(text))
    own = f"{line.key} = {line.value}"
    done = f"[{line.table}] {line.key} twice"
    return Mutated(_replaced(text, line.number, own, own), done, refused=True)


def _missing(text: str, rng: random.Random) -> Mutated:
    line = rng.choice(_lines(text))
    return Mutated(_replaced(text, line.number), f"[{line.table}] {line.key} taken out")


def _moved(text: str, rng: random.Random) -> Mutated:
    """Into another table: what is read there must be used there."""
    line = rng.choice(_lines(text))
    lines = text.split("\n")
    del lines[line.number]
    heads = [i for i, one in enumerate(lines) if one.startswith("[")]
    at = rng.choice(heads)
    lines.insert(at + 1, f"{line.key} = {line.value}")
    done = f"[{line.table}] {line.key} moved to {lines[at]}"
    return Mutated("\n".join(lines).encode(), done)


def _table(text: str, rng: random.Random) -> Mutated:
    lines = text.split("\n")
    heads = [i for i, one in enumerate(lines) if one.startswith("[")]
    at = rng.choice(heads)
    head = lines[at].split("#")[0].strip()
    inner = head.strip("[]")
    new, refused = rng.choice(
        (
            (f"[{inner}x]", True),
            (f"[[{inner}]]" if not head.startswith("[[") else f"[{inner}]", False),
            (f"[{inner}.more]", False),
            (f"[{inner.upper()}]", True),
            (head + "\n" + head, not head.startswith("[[")),
            ("", False),
            (f"[{inner}", True),
            (f"[ {inner} ] # same", False),
        )
    )
    return Mutated(_replaced(text, at, new), f"{head} -> {new!r}", refused)


def _size(text: str, rng: random.Random) -> Mutated:
    """Many values, points and levels; empty and deep arrays."""
    many = ", ".join(f"{0.1 + 1e-6 * i:.7f}" for i in range(100_000))
    added = rng.choice(
        (
            f'[[sweep]]\nparameter = "friction"\nvalues = [{many}]\n',
            '[[sweep]]\nparameter = "friction"\nstart = 0.1\nstop = 0.2\nnum = 1000000000\n',
            '[[sweep]]\nparameter = "friction"\nstart = 0.1\nstop = 0.2\nnum = 200000\n',
            '[[sweep]]\nparameter = "friction"\nvalues = []\n',
            '[[sweep]]\nparameter = "friction"\nstart = 0.1\nstop = 0.2\nnum = 1\n',
            f"[deep]\na = {'[' * 3000}{']' * 3000}\n",
            f"[{'.'.join(['a'] * 3000)}]\nb = 1\n",
            "[[sweep]]\n" * 2000,
            f"# {'x' * 1_000_000}\n",
            f"[long]\n{'k' * 100_000} = 1\n",
            '[design]\ntype = "sobol"\nsamples = 1000000000\n',
            '[design]\ntype = "latin_hypercube"\nsamples = 200000\n',
        )
    )
    return Mutated(f"{text}\n{added}".encode(), f"with {added[:70]!r}")


def _bytes(text: str, rng: random.Random) -> Mutated:
    data, at = text.encode(), rng.randrange(len(text))
    what = rng.choice(("insert", "delete", "cut", "bad UTF-8", "UTF-16", "bit"))
    if what == "insert":
        new = rng.choice(CHARACTERS)
        return Mutated(data[:at] + new.encode() + data[at:], f"{new!r} at byte {at}")
    if what == "delete":
        return Mutated(data[:at] + data[at + 1 :], f"without byte {at}")
    if what == "cut":
        return Mutated(data[:at], f"cut at byte {at}")
    if what == "bad UTF-8":
        return Mutated(data[:at] + b"\xed\xa0\x80" + data[at:], f"a surrogate at byte {at}", True)
    if what == "UTF-16":
        return Mutated(text.encode("utf-16"), "as UTF-16", True)
    return Mutated(
        data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :], f"a bit of {at}"
    )


def _same(text: str, rng: random.Random) -> Mutated:
    """In other words the same."""
    words: dict[str, Callable[[str], bytes]] = {
        "CRLF": lambda one: one.replace("\n", "\r\n").encode(),
        "byte-order mark": lambda one: b"\xef\xbb\xbf" + one.encode(),
        "comments": lambda one: ("# first\n" + one + "\n# last ä\n").encode(),
        "blank lines": lambda one: one.replace("\n[", "\n\n\n[").encode(),
        "no last line end": lambda one: one.rstrip("\n").encode(),
    }
    line = rng.choice(_lines(text))
    if '"' not in line.key and "." not in line.key:
        quoted = _replaced(text, line.number, f'  "{line.key}"  =  {line.value}  # quoted')
        words[f"[{line.table}] {line.key} in quotes"] = lambda _: quoted
    done = rng.choice(list(words))
    return Mutated(words[done](text), done, same=True)


MUTATIONS = (
    *(_value, _value, _value, _value, _misspelt, _misspelt, _misspelt, _doubled, _missing, _moved),
    *(_moved, _table, _size, _bytes, _bytes, _same, _same),
)
