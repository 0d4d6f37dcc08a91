"""Files of matrices, mutated: a message, or the matrix that a second, slow reader finds in them."""

from __future__ import annotations

import bz2
import functools
import gzip
import io
import random
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp
from fault_campaign.copies import Judged, in_a_copy
from fault_campaign.finding import Finding
from fault_campaign.second_readers import SECOND_READERS

from squealstudy.errors import ModelError
from squealstudy.models.matrices.files import read_matrix

PART = "matrix files"
PATIENCE_S, MEMORY = 20, 3 << 30
VARIABLE = "A"
WORDS = (
    *("0", "-1", "-0.0", "1e400", "1e-400", "nan", "inf", "-Infinity", "1,5", "1.5D2", "2.5d-3"),
    *("0x10", "1_000", "1.5abc", "", "7", "1000000000000", "99999999999999999999", "4294967297"),
    *("+1", "1.0", "1e0", "１", "true", "None", "1;2", "%", "symmetric", "general", "pattern"),
    *("skew-symmetric", "hermitian", "complex", "integer", "array", "coordinate", "\x00"),
    *("RSA", "RUA", "PUA", "CUA", "(8I4)", "(2E12.3)", "(1P,3E25.16)"),
)
NUMBERS = (0, 1, 2, 5, 6, 9, 14, 15, 17, 10**6, 2**31 - 1, 2**31, 2**32 - 1)  # put into bytes


@dataclass(frozen=True)
class Seed:
    """A whole file: its ending, its bytes, whether it is text, what it is read with."""

    ending: str
    data: bytes
    text: bool
    variable: str | None = None


def run(count: int, seed: int, work: Path) -> Iterator[Finding]:
    """Read `count` mutated files, each in a copy of this process; a finding for each."""
    folder = work / "matrix_files"
    folder.mkdir(parents=True, exist_ok=True)
    rng, made = random.Random(seed), seeds()
    for number in range(count):
        yield _case(rng.choice(made), number, rng, folder)


def _case(made: Seed, number: int, rng: random.Random, folder: Path) -> Finding:
    harmless = made.text and rng.random() < 0.1
    mutate = _harmless if harmless else _text if made.text else _binary
    data, what = mutate(made, rng)
    path = folder / f"case{number}{made.ending}"
    path.write_bytes(data)
    judge = functools.partial(_judged, path, made, harmless)
    verdict, text = in_a_copy(judge, PATIENCE_S, MEMORY)
    if verdict in ("ok", "message"):
        path.unlink()
    return Finding(PART, number, f"{path.name} {what}", verdict, text)


def _judged(path: Path, made: Seed, harmless: bool) -> Judged:
    try:
        found = read_matrix(path, made.variable)
    except ModelError as error:
        verdict = "differs" if harmless else "message" if path.name in str(error) else "traceback"
        return verdict, str(error)
    if not found.has_canonical_format or (found.data.size and not np.isfinite(found.data).all()):
        return "silent", "duplicate or non-finite entries were read"
    # the second reader may end the process on what this one has read without harm
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = SECOND_READERS[made.ending.rpartition(".")[2]](path, made.variable)
    if expected is None:
        return "silent", f"read as {found.shape}, though damaged"
    dense = expected.toarray() if sp.issparse(expected) else np.asarray(expected)
    if dense.shape != found.shape or not np.array_equal(found.toarray(), dense.astype(float)):
        return "silent", "another matrix was read than is in the file"
    return "ok", ""


# -- whole files --------------------------------------------------------------------------------


@functools.cache
def seeds() -> tuple[Seed, ...]:
    """A file of every format, layout and symmetry."""
    A = sp.random(7, 7, 0.4, random_state=1, data_rvs=np.random.default_rng(1).standard_normal)
    A = A.tocsc()
    S, Z = (A + A.T).tocsc(), (A - A.T).tocsc()
    made = []
    for matrix, symmetry in ((A, "general"), (S, "symmetric"), (Z, "skew-symmetric")):
        layouts = (matrix, matrix.toarray(), (10 * matrix).astype(int))
        made += [_market(one, symmetry) for one in layouts]
    made += [
        Seed(".mtx.gz", gzip.compress(made[0].data), False),
        Seed(".mtx.bz2", bz2.compress(made[0].data), False),
    ]
    for kind, matrix in (("RUA", A), ("RSA", sp.tril(S).tocsc()), ("RZA", sp.tril(Z, -1).tocsc())):
        text = io.StringIO()
        scipy.io.hb_write(text, matrix)
        made.append(Seed(".rua", text.getvalue().replace("RUA", kind).encode(), True))
    kept = {VARIABLE: A, "B": A.toarray(), "note": "text", "list": np.array([A, 1], dtype=object)}
    for content in (kept, {VARIABLE: A.toarray()}, {VARIABLE: (A != 0).astype(bool)}):
        for packed in (False, True):
            made.append(Seed(".mat", _saved(content, do_compression=packed), False, VARIABLE))
    numbers = {VARIABLE: A.toarray(), "B": A}
    made.append(Seed(".mat", _saved(numbers, format="4"), False, VARIABLE))
    for matrix in (A, A.tocsr(), A.tocoo(), sp.bsr_matrix(A), sp.dia_matrix(A)):
        buffer = io.BytesIO()
        sp.save_npz(buffer, matrix)
        made.append(Seed(".npz", buffer.getvalue(), False))
    buffer = io.BytesIO()
    np.savez(buffer, A=A.toarray(), B=np.arange(3))
    return (*made, Seed(".npz", buffer.getvalue(), False, VARIABLE))


def _market(matrix: sp.csc_matrix | np.ndarray, symmetry: str) -> Seed:
    buffer = io.BytesIO()
    scipy.io.mmwrite(buffer, matrix, symmetry=symmetry, comment=" made for a test")
    return Seed(".mtx", buffer.getvalue(), True)


def _saved(content: dict[str, object], **options: object) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, content, **options)
    return buffer.getvalue()


# -- mutations ----------------------------------------------------------------------------------


def _harmless(made: Seed, rng: random.Random) -> tuple[bytes, str]:
    """What must not matter: ends of lines, a byte-order mark, Fortran's exponents, blank ends."""
    changes: dict[str, Callable[[bytes], bytes]] = {
        "with CRLF": lambda data: data.replace(b"\n", b"\r\n"),
        "with a byte-order mark": lambda data: b"\xef\xbb\xbf" + data,
        "with blank lines at the end": lambda data: data + b"\n  \n\n",
        "without its last line end": lambda data: data.rstrip(b"\n"),
        "as it was": lambda data: data,
    }
    if made.ending == ".rua":
        del changes["with a byte-order mark"]
    what = rng.choice(list(changes))
    return changes[what](made.data), what


def _text(made: Seed, rng: random.Random) -> tuple[bytes, str]:
    """One or a few changes of words, characters or lines."""
    text, done = made.data.decode(), []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        lines = text.split("\n")
        at = rng.randrange(max(len(lines) - 1, 1))
        what = rng.choice(("word", "word", "word", "character", "delete", "twice", "swap", "cut"))
        words = lines[at].split(" ")
        if what == "word":
            word = rng.choice(WORDS)
            words[rng.randrange(len(words))] = word
            lines[at] = " ".join(words)
            what = f"word '{word}'"
        elif what == "character":
            place = rng.randrange(len(lines[at]) + 1)
            cut = rng.choice((0, 1))
            new = rng.choice(("", " ", "-", ".", "9", "e", "x", "\t", "\r", "ä", "\x00", "%"))
            lines[at] = lines[at][:place] + new + lines[at][place + cut :]
        elif what == "delete":
            del lines[at]
        elif what == "twice":
            lines.insert(at, lines[at])
        elif what == "swap":
            other = rng.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        else:
            lines[at:] = [lines[at][: rng.randrange(len(lines[at]) + 1)]]
        text = "\n".join(lines)
        done.append(f"{what} on line {at + 1}")
    return text.encode(), ", ".join(done)


def _binary(made: Seed, rng: random.Random) -> tuple[bytes, str]:
    """Bytes changed, in the file or in what it has compressed."""
    if made.ending == ".npz" and rng.random() < 0.7:
        return _arrays(made, rng)
    if made.ending == ".mat" and rng.random() < 0.7:
        return _inside(made.data, rng)
    return _bytes(made.data, rng), "bytes"


def _bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        at = rng.randrange(max(len(changed), 1))
        what = rng.choice(("bit", "byte", "number", "cut", "insert"))
        if what == "bit" and changed:
            changed[at] ^= 1 << rng.randrange(8)
        elif what == "byte" and changed:
            changed[at] = rng.choice((0, 255, 127, 128, 1, 5, 14))
        elif what == "number":
            at -= at % 4
            changed[at : at + 4] = struct.pack("<I", rng.choice(NUMBERS))
        elif what == "cut":
            del changed[at : at + rng.choice((1, 4, 8, len(changed)))]
        else:
            changed[at:at] = rng.randbytes(rng.choice((1, 4, 8)))
    return bytes(changed)


def _inside(data: bytes, rng: random.Random) -> tuple[bytes, str]:
    """Bytes within a compressed variable of a MATLAB file, or of the file where none is."""
    parts, at = [data[:128]], 128
    while at + 8 <= len(data):
        kind, size = struct.unpack("<II", data[at : at + 8])
        if kind != 15:
            return _bytes(data, rng), "bytes"
        content = zlib.compress(_bytes(zlib.decompress(data[at + 8 : at + 8 + size]), rng))
        parts.append(struct.pack("<II", 15, len(content)) + content)
        at += 8 + size
    return b"".join(parts), "bytes of what is compressed"


def _arrays(made: Seed, rng: random.Random) -> tuple[bytes, str]:
    """The arrays of an archive, whole in themselves but wrong."""
    with np.load(io.BytesIO(made.data)) as content:
        arrays = dict(content)
    name = rng.choice(list(arrays))
    array = arrays[name]
    what = rng.choice(("number", "number", "type", "shape", "missing", "object", "extra"))
    if what == "number" and array.dtype.kind in "iuf" and array.size:
        new = rng.choice((-1, 0, 3, 7, 8, 10**6, 2**31 - 1, 10**12, np.nan, np.inf))
        wide = np.int64 if array.dtype.kind in "iu" and np.isfinite(new) else np.float64
        array = array.astype(wide)
        array.flat[rng.randrange(array.size)] = new
        what = f"{new} in"
    elif what == "type":
        kind = rng.choice(("f4", "i8", "u1", "c16", "U8", "?"))
        if array.dtype.kind in "iufb":
            array = array.astype(kind)
        what = f"type {kind} of"
    elif what == "shape":
        array = rng.choice((array[:-1], array[None], array[:0])) if array.ndim else array[None]
    elif what == "object":
        array = np.array([array, None], dtype=object)
    elif what == "extra":
        arrays["more"] = np.arange(3)
    arrays[name] = array
    if what == "missing":
        del arrays[name]
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue(), f"{what} '{name}'"
