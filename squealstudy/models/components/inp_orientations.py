"""Material axes by points: ``*ORIENTATION`` in files of Abaqus and CalculiX."""

from __future__ import annotations

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.materials import Orientation


def read_orientation(card: Card, points: tuple[Line, list[str]] | None = None) -> Orientation:
    """The axes of an ``*ORIENTATION``; ModelError where it is wrong or not supported.

    `points`, a line and its words, replace the first line of the card.
    """
    card.check(("NAME", "SYSTEM", "DEFINITION"))
    system = card.parameters.get("SYSTEM", "RECTANGULAR").upper()
    if system not in ("RECTANGULAR", "CYLINDRICAL"):
        raise card.error(f"SYSTEM={system} is not supported; supported: RECTANGULAR, CYLINDRICAL")
    if card.parameters.get("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        raise card.error("only DEFINITION=COORDINATES is supported: write the points themselves")
    if not 1 <= len(card.data) <= 2:
        raise card.error(f"expected one or two lines of numbers, found {len(card.data)}")
    line, words = points or (card.data[0], card.data[0].words())
    if len(words) not in (6, 9):
        raise line.error(f"expected two or three points, found {len(words)} numbers")
    x = [line.real(word, "a coordinate") for word in words] + [0.0] * 3
    turn = (1, 0.0)
    if len(card.data) == 2:
        line = card.data[1]
        axis, *angle = line.words()
        if len(angle) > 1 or axis not in ("1", "2", "3"):
            raise line.error(
                f"expected an axis 1, 2 or 3 and an angle, found '{line.text.strip()}'"
            )
        turn = (int(axis), line.real(angle[0], "an angle") if angle else 0.0)
    try:
        return Orientation(
            "rectangular" if system == "RECTANGULAR" else "cylindrical",
            (x[0], x[1], x[2]),
            (x[3], x[4], x[5]),
            (x[6], x[7], x[8]),
            turn,
        )
    except ModelError as error:
        raise card.error(str(error)) from error
