"""Material axes of single elements: ``*DISTRIBUTION`` in files of Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import REAL, Line
from squealstudy.models.components.inp_orientations import read_orientation
from squealstudy.models.components.materials import Orientation

KEYWORD = "DISTRIBUTION"
CARD_PARAMETERS = ("NAME", "LOCATION", "TABLE")
ElementsOf = Callable[[Line, str], np.ndarray]  # indices of the elements of a label or a set


def orientations_of(
    card: Card, cards: Sequence[Card], elements: np.ndarray, elements_of: ElementsOf
) -> Iterator[tuple[np.ndarray, Orientation]]:
    """Groups of a section's elements (m,), each with the axes that an ``*ORIENTATION`` gives it.

    Raises
    ------
    ModelError
        A line is wrong; the distribution does not give axes to all of `elements`.
    """
    name = card.data[0].words()[0] if card.data else ""
    if not card.data or REAL.fullmatch(name):
        yield elements, read_orientation(card)
        return
    distributions = [
        c for c in cards if c.keyword == KEYWORD and c.value("NAME").upper() == name.upper()
    ]
    if len(distributions) != 1:
        raise card.data[0].error(
            f"there are {len(distributions)} distributions '{name}': expected one"
        )
    yield from _rows(card, distributions[0], elements, elements_of)


def unused_distributions(cards: Sequence[Card]) -> Iterator[Card]:
    """Distributions that no orientation names."""
    used = {
        card.data[0].words()[0].upper()
        for card in cards
        if card.keyword == "ORIENTATION" and card.data
    }
    for card in cards:
        if card.keyword == KEYWORD and card.value("NAME").upper() not in used:
            yield card


def _rows(
    card: Card, table: Card, elements: np.ndarray, elements_of: ElementsOf
) -> Iterator[tuple[np.ndarray, Orientation]]:
    """Elements and axes of each line of a *DISTRIBUTION of orientations."""
    table.check(CARD_PARAMETERS)
    if table.parameters.get("LOCATION", "ELEMENT").upper() != "ELEMENT":
        raise table.error("expected LOCATION=ELEMENT of a distribution of orientations")
    row_of = np.full(len(elements), -1)
    for number, line in enumerate(table.data):
        label, *numbers = line.words()
        if len(numbers) != 6:
            raise line.error(f"expected an element or a set and two points, found {line.text}")
        is_labelled = np.isin(elements, elements_of(line, label)) if label else row_of < 0
        row_of[is_labelled] = number
    if (row_of < 0).any():
        raise table.error(f"it has no axes for {(row_of < 0).sum()} elements of its section")
    for number in np.unique(row_of):
        line = table.data[number]
        axes = read_orientation(card, (line, line.words()[1:]))
        yield elements[row_of == number], axes
