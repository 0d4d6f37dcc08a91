"""What of a keyword file is refused: all of it in one message, with a line to paste."""

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
    """A card that is refused: its name for `pass_over`, empty where that cannot be, and why."""

    card: Card
    name: str
    text: str


def refuse(found: Sequence[Refused]) -> None:
    """ModelError about the line of the first, with all of them and the line to paste."""
    if not found:
        return
    counts: dict[str, int] = {}
    for one in found:
        counts[one.text] = counts.get(one.text, 0) + 1
    said = "; ".join(f"{text} ({n} times)" if n > 1 else text for text, n in counts.items())
    names = list(dict.fromkeys(one.name for one in found if one.name))
    if names:
        listed = ", ".join(f'"{name}"' for name in names)
        said += (
            "; where neither mass nor stiffness depend on "
            f"{'it' if len(names) == 1 else 'them'}: pass_over = [{listed}]"
        )
    raise found[0].card.error(said)


def sift_elements(text: Text, pass_over: Collection[str]) -> list[Refused]:
    """Elements of a component that cannot be read; those to be passed over are taken out."""
    refused: list[Refused] = []
    readable: list[Card] = []
    dropped: dict[str, list[Card]] = {}
    for card in text.part:
        written = card.value("TYPE").upper() if card.keyword == "ELEMENT" else ""
        if not written or written in text.elements:
            readable.append(card)
        elif written in POINTS and written not in pass_over:
            text.points.append(card)
            text.others.append((card, _labels(card)))
        elif (
            written in pass_over and written not in ELEMENTS
        ) or written in NON_STRUCTURAL_ELEMENTS:
            dropped.setdefault(written, []).append(card)
        else:
            solid = written in ELEMENTS
            why = f"element {written} is not supported: {_advice(text, written)}"
            refused.append(Refused(card, "" if solid else written, why))
    for written, cards in dropped.items():
        text.note(cards[0], NON_STRUCTURAL_ELEMENTS.get(written, f"{written}, as asked for"))
        for card in cards:
            text.others.append((card, _labels(card)))
    text.part = readable
    return refused


def _advice(text: Text, written: str) -> str:
    if written in ELEMENTS:
        return f"{ELEMENTS[written]}; or say by treat_as what it is to be"
    if written in NODES:
        return f"only solids are; where it marks faces alone, treat_as {written} = '{FACES}'"
    solids = [name for name, ours in text.elements.items() if ours != FACES]
    return f"supported: {', '.join(solids)}"


def _labels(card: Card) -> list[int]:
    """Numbers of elements that are passed over: a line after one that ends in a comma goes on."""
    labels = []
    goes_on = False
    for line in card.data:
        word = line.words()[0]
        if not goes_on and WHOLE_NUMBER.fullmatch(word):
            labels.append(int(word))
        goes_on = line.text.rstrip().endswith(",")
    return labels
