"""Rigid elements of bulk data of Nastran: RBE2, RBE3, RBAR, RROD."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from squealstudy.models.components.bulk_cards import BulkCard
from squealstudy.models.components.constraints import Constraint, Coupling, Relation, relation

READ = ("RBE2", "RBE3", "RBAR", "RROD")
EVERY = "123456"
Bar = tuple[BulkCard, int, int]  # its card, its independent node and its dependent node


class BulkCouplings:
    """Reader of the rigid elements of a deck.

    Parameters
    ----------
    cards : callable
        Returns all cards of the given names.
    places : callable
        Returns the indices of nodes, from a card and node numbers on it.
    nodes : ndarray (n, 3)
        Coordinates, in the unit of the deck.
    """

    def __init__(
        self,
        cards: Callable[..., Sequence[BulkCard]],
        places: Callable[[BulkCard, list[int]], np.ndarray],
        nodes: np.ndarray,
    ) -> None:
        self._all, self._places, self._nodes = cards, places, nodes

    def read(self) -> Iterator[Constraint]:
        """Couplings and relations of the deck; ModelError about a card that is wrong."""
        bars = self._bar_ends()
        for card in self._all("RBE2"):
            name = f"RBE2 {card.whole(0, 'an element number')}"
            digits = set(card.at(2))
            if not set("123") <= digits:
                raise card.error("expected the components 123, or 123456", 2)
            nodes = card.listed(3, "a node")
            turning = set("456") <= digits
            reference = card.whole(1, "a node")
            joined = [bar for bar in bars if bar[1] == reference]  # bars from its reference node
            bars = [bar for bar in bars if bar[1] != reference]
            nodes += [bar[2] for bar in joined]
            yield self._coupling(card, name, reference, nodes, turning)
        for card in self._all("RBE3"):
            name = f"RBE3 {card.whole(0, 'an element number')}"
            words = [w.upper() for w in card.fields[6:] if w]
            if card.at(5) != "123" or any("." in w or w == "UM" for w in words):
                raise card.error("expected one weight, for components 123 of all its nodes")
            (node_index,) = self._places(card, [card.whole(2, "a node")])
            others = self._others(card, card.listed(6, "a node"), int(node_index))
            yield Coupling(name, "distributing", int(node_index), others)
        yield from self._bars(bars)
        for card in self._all("RROD"):
            name = f"RROD {card.whole(0, 'an element number')}"
            yield self._distance(card, name, *(card.whole(k, "a node") for k in (1, 2)))

    def _others(self, card: BulkCard, nodes: list[int], reference: int) -> np.ndarray:
        others = np.setdiff1d(self._places(card, nodes), reference)
        if not len(others):
            raise card.error("expected a node other than the reference node")
        return others

    def _coupling(
        self, card: BulkCard, name: str, reference: int, nodes: list[int], turning: bool
    ) -> Coupling:
        (reference_index,) = self._places(card, [reference])
        others = self._others(card, nodes, int(reference_index))
        return Coupling(name, "rigid", int(reference_index), others, turning=turning)

    def _distance(self, card: BulkCard, name: str, node: int, other_node: int) -> Relation:
        """The relation by which two nodes keep their distance."""
        pair = self._places(card, [node, other_node])
        along = self._nodes[pair[1]] - self._nodes[pair[0]]
        if not np.linalg.norm(along) > 0:
            raise card.error("its two nodes have the same coordinates")
        along = along / np.linalg.norm(along)
        return relation(name, pair[::-1], np.array([along, -along]))

    def _bar_ends(self) -> list[Bar]:
        """All bars, each with its independent node and its dependent node."""
        bars: list[Bar] = []
        for card in self._all("RBAR"):
            ends = [card.whole(k, "a node") for k in (1, 2)]
            independent = [card.at(k) for k in (3, 4)]
            if sorted(independent) != ["", EVERY]:
                raise card.error("expected CNA or CNB = 123456, and the other one empty", 3)
            if independent[1]:
                ends.reverse()
            bars.append((card, ends[0], ends[1]))
        return bars

    def _bars(self, bars: list[Bar]) -> Iterator[Constraint]:
        """Bars with common nodes are one rigid body. A single bar keeps the distance of its nodes.

        Nodes of solids have no rotations, so a single bar turns freely about both ends.
        """
        coupled = {card.whole(1, "a node") for card in self._all("RBE2")} | {
            n for card in self._all("RBE2") for n in card.listed(3, "a node")
        }
        groups: list[list[Bar]] = []
        for bar in bars:
            joined = [g for g in groups if any({*bar[1:]} & {*other[1:]} for other in g)]
            groups = [g for g in groups if g not in joined]
            groups.append([bar, *(joined_bar for g in joined for joined_bar in g)])
        for group in groups:
            group.sort(key=lambda bar: bars.index(bar))
            card, first, second = group[0]
            names = [f"RBAR {c.whole(0, 'an element number')}" for c, *_ in group]
            nodes = {n for _, *ends in group for n in ends}
            if nodes & coupled:
                raise card.error(
                    "a bar at the nodes of an RBE2 is not supported: write one RBE2 of all nodes"
                )
            if len(group) == 1:
                yield self._distance(card, names[0], first, second)
                continue
            dependent = [b for _, _, b in group]
            roots = nodes - set(dependent)
            if len(roots) != 1 or len(set(dependent)) < len(dependent):
                raise card.error(
                    f"{', '.join(names)} are one rigid body: expected one node of it that no bar "
                    "moves, and no node that two move"
                )
            yield self._coupling(card, ", ".join(names), roots.pop(), sorted(set(dependent)), True)
