"""Lines of a text file that have whole numbers and then one value, read at once."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence

import numpy as np

from squealstudy.models.matrices.text import NUMBER, TextFile, shortened

FORTRAN = str.maketrans("dD", "eE")  # its double exponents
COMMAS = str.maketrans("dD,", "eE ")
WHOLE = r"[+-]?\d+"


def read_table(
    text: TextFile,
    places: Sequence[int],
    before: Sequence[str],
    *,
    whole: bool = False,
    commas: bool = False,
) -> np.ndarray:
    """The numbers of the lines at `places`: an array of fields, the last of them ``value``.

    Parameters
    ----------
    text : TextFile
    places : sequence of int
        Lines, from 0.
    before : sequence of str
        Names of the whole numbers before the value.
    whole : bool
        Whether the value is a whole number too.
    commas : bool
        Whether commas may stand between the numbers.

    Raises
    ------
    ModelError
        About the first line that has something else.
    """
    fields = [*((name, np.int64) for name in before), ("value", np.int64 if whole else np.float64)]
    if not places:
        return np.zeros(0, fields)
    words = [*(WHOLE for _ in before), WHOLE if whole else NUMBER]
    pattern = re.compile((r"(?:\s*,\s*|\s+)" if commas else r"\s+").join(words), re.ASCII)
    wanted = " and ".join([*before, "an integer" if whole else "a value"])

    def check() -> None:
        for i in places:
            if not pattern.fullmatch(text.lines[i].strip()):
                raise text.error(i, f"expected {wanted}, found '{shortened(text.lines[i])}'")

    if commas:
        check()  # NumPy would not see two of them side by side
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # such as an integer read by way of a float
            lines = (text.lines[i].translate(COMMAS if commas else FORTRAN) for i in places)
            found = np.loadtxt(lines, np.dtype(fields), comments=None, ndmin=1)
    except (ValueError, DeprecationWarning, OverflowError):
        check()
        raise
    finite = np.isfinite(found["value"])
    if not finite.all():
        i = places[int((~finite).argmax())]
        raise text.error(i, f"expected a finite value, found '{shortened(text.lines[i])}'")
    return found
