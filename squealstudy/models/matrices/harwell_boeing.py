"""Harwell-Boeing and Rutherford-Boeing files (Duff, Grimes, Lewis 1992), every number checked.

Numbers are separated by blanks, or in fields of the widths that the header gives.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.matrices.entries import Symmetry, check_size, matrix_of_entries
from squealstudy.models.matrices.text import NUMBER, TextFile, shortened

COUNTS_LINE, TYPE_LINE, FORMAT_LINE = 1, 2, 3  # lines of the header, from 0
FORMAT = re.compile(
    r"\s*(?:(?P<scale>[+-]?\d+)P\s*,?\s*)?(?P<repeat>\d{0,4})(?P<letter>[IEDFG])(?P<width>\d{1,3})"
    r"(?:\.\d+)?(?:E\d+)?\s*",
    re.IGNORECASE | re.ASCII,
)
SYMMETRIES: dict[str, Symmetry] = {"s": "symmetric", "z": "skew-symmetric", "u": "general"}
WHOLE_NUMBER = re.compile(r"\s*[+-]?\d+\s*", re.ASCII)
REAL = re.compile(rf"\s*(?=\S*\.){NUMBER}\s*", re.ASCII)  # with a point, else the format decides
BARE_EXPONENT = re.compile(r"(?<=[\d.])(?=[+-])")  # 1.5-103: Fortran leaves out the letter


@dataclass(frozen=True)
class FortranFormat:
    """A format of the header.

    Attributes
    ----------
    repeat, width : int
        Number of fields on each line, and characters of a field.
    whole : bool
        Whether numbers are whole.
    scaled : bool
        Whether the format has a scale factor (P).
    """

    repeat: int
    width: int
    whole: bool
    scaled: bool

    @classmethod
    def read(cls, text: TextFile, description: str) -> FortranFormat:
        """The format of a text like ``10I8`` or ``1P,3D25.16``; ModelError where it is none."""
        match = FORMAT.fullmatch(description)
        repeat, width = (int(match[k] or 1) if match else 0 for k in ("repeat", "width"))
        if match is None or not repeat or not width:
            what = f"expected a format like 10I8, 3E25.16, found '{shortened(description)}'"
            raise text.error(FORMAT_LINE, what)
        scaled = int(match["scale"] or 0) != 0
        return cls(repeat, width, match["letter"].upper() == "I", scaled)


@dataclass(frozen=True)
class CardBlock:
    """Numbers of a file, with the first line that they are on."""

    text: TextFile
    first: int
    format: FortranFormat
    numbers: np.ndarray

    def error(self, k: int, message: str) -> ModelError:
        """The error to raise about the k-th number, from 0."""
        return self.text.error(self.first + k // self.format.repeat, message)


def read_harwell_boeing(path: Path) -> sp.csr_matrix:
    """Read a real assembled matrix (n, n), with both triangles.

    Raises
    ------
    ModelError
        A line is malformed; the matrix is a pattern without values, complex, Hermitian or not
        assembled.
    ValueError
        The matrix is not square.
    """
    text = TextFile.read(path)
    symmetry = _symmetry(text)
    rows, columns, entries = _counts(text, TYPE_LINE, 3, "rows, columns and entries")
    check_size(rows, columns)
    lines = _counts(text, COUNTS_LINE, 4, "numbers of lines")[1:]
    formats = re.findall(r"\(([^()]*)\)", text.line(FORMAT_LINE))
    if len(formats) < 3:
        excerpt = shortened(text.line(FORMAT_LINE))
        raise text.error(FORMAT_LINE, f"expected three formats in brackets, found '{excerpt}'")
    first = FORMAT_LINE + 1 + _has_right_sides(text)
    blocks: list[CardBlock] = []
    for count, taken, description in zip(
        (columns + 1, entries, entries), lines, formats[:3], strict=True
    ):
        form = FortranFormat.read(text, description)
        if taken != -(-count // form.repeat):
            what = f"{taken} lines of ({description}) cannot hold {count} numbers"
            raise text.error(COUNTS_LINE, what)
        blocks.append(_card_block(text, first, count, form, integers=len(blocks) < 2))
        first += taken
    _check_end(text, first)
    pointers, indices, values = blocks
    return matrix_of_entries(
        indices.numbers,
        _columns(pointers, entries),
        values.numbers.astype(float),
        rows,
        symmetry,
        indices.error,
    )


def _symmetry(text: TextFile) -> Symmetry:
    """The symmetry that the head of a file states; ModelError for unsupported types."""
    kind = text.line(TYPE_LINE)[:3].lower()
    if len(kind) != 3 or kind[0] not in "rip" or kind[1] not in SYMMETRIES or kind[2] != "a":
        expected = "a real assembled matrix (RSA, RUA, RZA)"
        raise text.error(TYPE_LINE, f"expected {expected}, found type '{kind}'")
    if kind[0] == "p":
        raise text.error(TYPE_LINE, "a pattern without values")
    return SYMMETRIES[kind[1]]


def _counts(text: TextFile, line: int, count: int, expected: str) -> list[int]:
    """The first `count` whole numbers of a line of the header."""
    words = text.line(line)[3 if line == TYPE_LINE else 0 :].split()
    return text.counts(line, words[:count] if len(words) >= count else [""], expected)


def _has_right_sides(text: TextFile) -> bool:
    """Whether the header has a fifth line, about right-hand sides, which are not read."""
    words = text.line(COUNTS_LINE).split()
    return len(words) > 4 and words[4] != "0"


def _check_end(text: TextFile, end: int) -> None:
    """Raise ModelError where anything but right-hand sides follows the matrix."""
    if _has_right_sides(text):
        return
    for line_number in range(end, len(text.lines)):
        if text.lines[line_number].strip():
            raise text.error(
                line_number, f"expected the end, found '{shortened(text.lines[line_number])}'"
            )


def _card_block(
    text: TextFile, first: int, count: int, form: FortranFormat, integers: bool
) -> CardBlock:
    """Read `count` numbers from the line `first` on."""
    fields: list[str] = []
    pattern = WHOLE_NUMBER if form.whole else REAL
    expected = "a whole number" if form.whole else "a number with a decimal point"
    if integers and not form.whole:
        raise text.error(FORMAT_LINE, "expected formats of whole numbers (I) for the places")
    for line_number in range(first, first + -(-count // form.repeat)):
        n_fields = min(form.repeat, count - len(fields))
        for k, field in enumerate(_fields(text, line_number, n_fields, form), start=1):
            if not pattern.fullmatch(field) or (form.scaled and "E" not in field):
                excerpt = shortened(field)
                raise text.error(
                    line_number, f"expected {expected} in field {k}, found '{excerpt}'"
                )
            fields.append(field)
    return CardBlock(text, first, form, _numbers(text, first, fields, form))


def _fields(text: TextFile, line_number: int, count: int, form: FortranFormat) -> list[str]:
    """The texts of `count` numbers on a line."""
    line = text.line(line_number).upper()
    fields = line.split()
    if len(fields) != count:  # SciPy's writer ignores widths, others leave no blanks
        fields = [line[k * form.width : (k + 1) * form.width] for k in range(count)]
        if rest := line[count * form.width :].strip():
            message = f"expected {count} numbers, found '{shortened(rest)}' behind them"
            raise text.error(line_number, message)
    if form.whole:
        return fields
    return [BARE_EXPONENT.sub("E", field.replace("D", "E")) for field in fields]


def _numbers(text: TextFile, first: int, fields: list[str], form: FortranFormat) -> np.ndarray:
    """Fields of a file as numbers, whole ones in 64 bits."""
    if not form.whole:
        return np.array([float(field) for field in fields])
    numbers = [int(field) for field in fields]
    large = next((k for k, number in enumerate(numbers) if abs(number) >= 2**63), None)
    if large is not None:
        raise text.error(first + large // form.repeat, "a number too large")
    return np.array(numbers, dtype=np.int64)


def _columns(pointers: CardBlock, entries: int) -> np.ndarray:
    """The column, from 1, of each entry; ModelError where pointers do not ascend to entries + 1."""
    starts = pointers.numbers
    fits = np.append(starts[0] == 1, starts[1:] >= starts[:-1])
    fits[-1] &= starts[-1] == entries + 1
    if not fits.all():
        k = int(fits.argmin())
        what = f"pointers that ascend from 1 to {entries + 1}, found {starts[k]}"
        raise pointers.error(k, f"expected {what} for column {k + 1}")
    return np.repeat(np.arange(1, len(starts)), np.diff(starts))
