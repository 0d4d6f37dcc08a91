"""``*CYCLIC SYMMETRY MODEL`` of CalculiX: a sector becomes the whole body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.sectors import MAX_SECTORS, Repetition, repeated

KEYWORD = "CYCLICSYMMETRYMODEL"
CARD_PARAMETERS = ("N", "NGRAPH", "TIE", "ELSET", "CHECK", "CONTACT")


@dataclass(frozen=True)
class SectorCard:
    """A ``*CYCLIC SYMMETRY MODEL``: how a sector repeats, and its elements' labels (None: all)."""

    card: Card
    how: Repetition
    labels: np.ndarray | None


def read_sectors(
    cards: Sequence[Card], labels_of: Callable[[str, Card], np.ndarray]
) -> list[SectorCard]:
    """Read the cards; ModelError about a line that is wrong.

    `labels_of` returns the labels of an element set.
    """
    sector_cards = []
    for card in cards:
        if card.keyword != KEYWORD:
            continue
        card.check(CARD_PARAMETERS)
        number = card.line.real(card.value("N"), "the number of sectors")
        if not (number.is_integer() and 2 <= number <= MAX_SECTORS):
            raise card.error(f"N={number:g} sectors are no whole body: expected 2 to {MAX_SECTORS}")
        first = replace(card, data=card.data[:1])  # CalculiX reads no further
        x = np.array(
            [coordinate for _, coordinate in first.numbers("two points of the axis", 6, 6)]
        )
        if not np.linalg.norm(x[3:] - x[:3]) > 0:
            raise card.data[0].error("the two points of the axis are one")
        name = card.parameters.get("ELSET")
        labels = None if name is None else labels_of(name, card)
        sector_cards.append(SectorCard(card, Repetition(x[:3], x[3:] - x[:3], int(number)), labels))
    return sector_cards


def whole_body(mesh: SolidMesh, sectors: Sequence[SectorCard]) -> SolidMesh:
    """The whole body, where a card says that a mesh is a sector; else the mesh itself.

    ModelError where cards have different numbers of sectors.
    """
    of_mesh = [s for s in sectors if s.labels is None or np.isin(mesh.labels, s.labels).any()]
    if not of_mesh:
        return mesh
    first, *others = of_mesh
    for other in others:
        if other.how.count != first.how.count:
            raise other.card.error(
                f"sectors of 1/{first.how.count} and 1/{other.how.count} of a body: read each as "
                "a component, part = ELEMENT SET"
            )
    return repeated(mesh, first.how)
