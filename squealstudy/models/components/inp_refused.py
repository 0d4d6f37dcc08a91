"""Refused cards of a keyword file: one message about all, with a line for the model file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_discrete import POINTS
from squealstudy.models.components.inp_keywords import ELEMENTS, NON_STRUCTURAL_ELEMENTS
from squealstudy.models.components.inp_lines import WHOLE_NUMBER
from squealstudy.models.components.inp_text import Text
from squealstudy.models.components.marked_faces import FACES, NODES


class Refused(NamedTuple):
    """A refused card, its name for `pass_over` (empty where that is not possible), and why."""

    card: Card
    name: str
    text: str


def refuse(cards: Sequence[Refused]) -> None:
    """Raise ModelError about all refused cards, at the line of the first; does nothing without."""
    if not cards:
        return
    counts: dict[str, int] = {}
    for refused in cards:
        counts[refused.text] = counts.get(refused.text, 0) + 1
    message = "; ".join(f"{text} ({n} times)" if n > 1 else text for text, n in counts.items())
    names = list(dict.fromkeys(refused.name for refused in cards if refused.name))
    if names:
        listed = ", ".join(f'"{name}"' for name in names)
        message += (
            "; where neither mass nor stiffness depend on "
            f"{'it' if len(names) == 1 else 'them'}: pass_over = [{listed}]"
        )
    raise cards[0].card.error(message)


def sift_elements(text: Text, pass_over: Collection[str]) -> list[Refused]:
    """Sort out elements that are no solids of known formulation; returns those to refuse.

    Elements at points are moved to `text.points`. Elements to pass over are removed and noted.
    """
    refused: list[Refused] = []
    readable: list[Card] = []
    dropped: dict[str, list[Card]] = {}
    for card in text.part:
        element_type = card.value("TYPE").upper() if card.keyword == "ELEMENT" else ""
        if not element_type or element_type in text.elements:
            readable.append(card)
        elif element_type in POINTS and element_type not in pass_over:
            text.points.append(card)
            text.non_solids.append((card, _labels(card)))
        elif (
            element_type in pass_over and element_type not in ELEMENTS
        ) or element_type in NON_STRUCTURAL_ELEMENTS:
            dropped.setdefault(element_type, []).append(card)
        else:
            solid = element_type in ELEMENTS
            why = f"element {element_type} is not supported: {_advice(text, element_type)}"
            refused.append(Refused(card, "" if solid else element_type, why))
    for element_type, cards in dropped.items():
        text.note(
            cards[0], NON_STRUCTURAL_ELEMENTS.get(element_type, f"{element_type}, as asked for")
        )
        for card in cards:
            text.non_solids.append((card, _labels(card)))
    text.part = readable
    return refused


def _advice(text: Text, element_type: str) -> str:
    if element_type in ELEMENTS:
        return f"{ELEMENTS[element_type]}; or choose a formulation by treat_as"
    if element_type in NODES:
        return f"only solids are; where it marks faces alone, treat_as {element_type} = '{FACES}'"
    solids = [name for name, formulation in text.elements.items() if formulation != FACES]
    return f"supported: {', '.join(solids)}"


def _labels(card: Card) -> list[int]:
    """Labels of the elements of a card; a line that ends in a comma is continued."""
    labels = []
    continues = False
    for line in card.data:
        word = line.words()[0]
        if not continues and WHOLE_NUMBER.fullmatch(word):
            labels.append(int(word))
        continues = line.text.rstrip().endswith(",")
    return labels
