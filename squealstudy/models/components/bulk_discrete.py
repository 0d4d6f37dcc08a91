"""Springs, masses and equations of bulk data of Nastran: CELAS1, CELAS2, CONM2, MPC."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from squealstudy.models.components.bulk_cards import BulkCard
from squealstudy.models.components.constraints import Relation, relation
from squealstudy.models.components.discrete import Discrete, point_mass, spring
from squealstudy.models.components.inp_lines import Line

READ = ("CELAS1", "CELAS2", "PELAS", "CONM2", "MPC", "MPCADD")
SELECTED = re.compile(r"\s*MPC\s*=\s*(\d+)", re.I)


class BulkDiscrete:
    """Reads them.

    Parameters
    ----------
    cards : callable
        All cards of some names.
    place : callable
        Of a node number, with the card that has it.
    turned : set of int
        Numbers of nodes whose displacements have a coordinate system of their own (CD of GRID).
    """

    def __init__(
        self,
        cards: Callable[..., Sequence[BulkCard]],
        place: Callable[[BulkCard, int], int],
        turned: set[int],
    ) -> None:
        self._all, self._place, self._turned = cards, place, turned

    def _end(self, card: BulkCard, at: int) -> tuple[int, np.ndarray] | None:
        """Node and direction of two fields; None where they are empty: the ground."""
        number = card.whole(at, "a node", 0)
        if number == 0:
            return None
        axis = card.whole(at + 1, "a direction", 0)
        if axis not in (1, 2, 3):
            raise card.error(f"expected a direction 1 to 3 of node {number}, found {axis}", at + 1)
        if number in self._turned:
            text = f"node {number} has a system of displacements (CD), which is not supported"
            raise card.error(text, at)
        return self._place(card, number), np.eye(3)[axis - 1]

    def springs_and_masses(self, weight: float) -> Iterator[Discrete]:
        """Those of the deck, masses times `weight`; ModelError about what is wrong."""
        stiffness: dict[int, tuple[BulkCard, int]] = {}
        for card in self._all("PELAS"):
            for at in (0, 4):  # two properties a card
                if card.at(at):
                    stiffness[card.whole(at, "a property")] = (card, at + 1)
        for card in self._all("CELAS1", "CELAS2"):
            number = card.whole(0, "an element number")
            if card.name == "CELAS2":
                k = card.real(1, "a stiffness")
            else:
                own = card.whole(1, "a property", number)
                if own not in stiffness:
                    raise card.error(f"there is no PELAS {own}", 1)
                of, at = stiffness[own]
                k = of.real(at, "a stiffness")
            ends = [self._end(card, 2), self._end(card, 4)]
            signed = [
                (end[0], sign * end[1])
                for end, sign in zip(ends, (1.0, -1.0), strict=True)
                if end is not None
            ]
            if signed:
                yield spring(f"{card.name} {number}", signed, k)
        for card in self._all("CONM2"):
            number = card.whole(0, "an element number")
            mass = card.real(3, "a mass", 0.0)
            if any(card.real(k, "an offset", 0.0) for k in (4, 5, 6)):
                raise card.error(
                    "a mass with an offset is not supported: state a [[point_mass]] with at = "
                    "[x, y, z] in the model file, and name CONM2 in pass_over",
                    4,
                )
            node = self._place(card, card.whole(1, "a node"))
            if mass:
                yield point_mass(f"CONM2 {number}", node, weight * mass)

    def equations(self, above: Sequence[Line], bare: np.ndarray) -> Iterator[Relation]:
        """MPC cards that the case control selects, or all where there is none."""
        chosen = {int(found[1]) for line in above if (found := SELECTED.match(line.text))}
        for card in self._all("MPCADD"):
            if card.whole(0, "a set") in chosen:
                chosen |= set(card.listed(1, "a set"))
        for card in self._all("MPC"):
            number = card.whole(0, "a set")
            if above and number not in chosen:
                continue
            ends, factors = [], []
            for at in range(1, len(card.fields)):
                if at % 8 in (1, 4) and card.at(at):
                    end = self._end(card, at)
                    if end is not None:
                        ends.append(end)
                        factors.append(card.real(at + 2, "a factor"))
            if not ends or not factors[0]:
                raise card.error("expected a node, a direction and a factor that is not zero")
            nodes = np.array([node for node, _ in ends])
            if bare[nodes].all():
                continue
            vectors = np.array([a * axis for a, (_, axis) in zip(factors, ends, strict=True)])
            yield relation(f"MPC {number} (line {card.lines[0].place + 1})", nodes, vectors)
