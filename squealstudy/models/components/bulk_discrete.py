"""Springs, masses and equations of bulk data: CELAS1, CELAS2, CBUSH, CONM2, MPC."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.bulk_cards import BulkCard, Systems
from squealstudy.models.components.constraints import Relation, relation
from squealstudy.models.components.discrete import Discrete, point_mass, rigid_mass, spring
from squealstudy.models.components.inp_lines import Line

READ = ("CELAS1", "CELAS2", "PELAS", "CBUSH", "PBUSH", "CONM2", "MPC", "MPCADD")
SELECTED = re.compile(r"\s*MPC\s*=\s*(\d+)", re.I)


class BulkDiscrete:
    """Reads springs, masses and equations of a deck.

    Parameters
    ----------
    cards : callable
        Returns all cards of given names.
    place : callable
        Returns the place of a node from a card and the node's number.
    turned : set of int
        Numbers of nodes whose displacements have a coordinate system of their own (CD of GRID).
    nodes : ndarray (n, 3)
    turning : collection of int
        Places of reference nodes, which turn.
    systems : Systems
    """

    def __init__(
        self,
        cards: Callable[..., Sequence[BulkCard]],
        place: Callable[[BulkCard, int], int],
        turned: set[int],
        nodes: np.ndarray,
        turning: Collection[int],
        systems: Systems,
    ) -> None:
        self._all, self._place, self._turned = cards, place, turned
        self._nodes, self._turning, self._systems = nodes, turning, systems

    def _end(self, card: BulkCard, field: int, turns: bool = True) -> tuple[int, np.ndarray] | None:
        """Node and direction (6,) of two fields; None where they are empty: the ground."""
        number = card.whole(field, "a node", 0)
        if number == 0:
            return None
        axis = card.whole(field + 1, "a direction", 0)
        max_axis = 6 if turns else 3
        if axis not in range(1, max_axis + 1):
            text = f"expected a direction 1 to {max_axis} of node {number}, found {axis}"
            raise card.error(text, field + 1)
        node = self._node(card, number, field)
        if axis > 3 and node not in self._turning:
            text = f"node {number} does not turn: expected a direction 1 to 3, found {axis}"
            raise card.error(text, field + 1)
        return node, np.eye(6)[axis - 1]

    def _node(self, card: BulkCard, number: int, field: int) -> int:
        if number in self._turned:
            text = f"node {number} has a system of displacements (CD), which is not supported"
            raise card.error(text, field)
        return self._place(card, number)

    def springs_and_masses(self, weight: float) -> Iterator[Discrete]:
        """Springs and masses of the deck, masses times `weight`; ModelError about what is wrong."""
        stiffness: dict[int, tuple[BulkCard, int]] = {}
        for card in self._all("PELAS"):
            for field in (0, 4):  # two properties a card
                if card.at(field):
                    stiffness[card.whole(field, "a property")] = (card, field + 1)
        for card in self._all("CELAS1", "CELAS2"):
            number = card.whole(0, "an element number")
            if card.name == "CELAS2":
                k = card.real(1, "a stiffness")
            else:
                property_number = card.whole(1, "a property", number)
                if property_number not in stiffness:
                    raise card.error(f"there is no PELAS {property_number}", 1)
                property_card, field = stiffness[property_number]
                k = property_card.real(field, "a stiffness")
            ends = [self._end(card, 2), self._end(card, 4)]
            signed = [
                (end[0], sign * end[1])
                for end, sign in zip(ends, (1.0, -1.0), strict=True)
                if end is not None
            ]
            if not any(direction[3:].any() for _, direction in signed):
                signed = [(node, direction[:3]) for node, direction in signed]
            if signed:
                yield spring(f"{card.name} {number}", signed, k)
        yield from self._bushes()
        for card in self._all("CONM2"):
            number = card.whole(0, "an element number")
            mass = card.real(3, "a mass", 0.0)
            node = self._place(card, card.whole(1, "a node"))
            yield from self._mass(card, f"CONM2 {number}", node, weight * mass, weight)

    def _mass(
        self, card: BulkCard, name: str, node: int, mass: float, weight: float
    ) -> Iterator[Discrete]:
        """A mass at a node, or off a node that turns; rotary inertia counts at such nodes only."""
        x = np.array([card.real(k, "an offset", 0.0) for k in (4, 5, 6)])
        values = [card.real(k, "a moment of inertia", 0.0) for k in range(8, 14)]
        if node not in self._turning:
            if x.any():
                raise card.error(
                    "a mass with an offset at a node that does not turn: state a [[point_mass]] "
                    "with at = [x, y, z] in the model file, and name CONM2 in pass_over",
                    4,
                )
            if mass:
                yield point_mass(name, node, mass)
            return
        if card.at(2).strip("0") and (x.any() or any(values)):
            raise card.error("CID: an offset or inertia in axes of its own is not supported", 2)
        I11, I21, I22, I31, I32, I33 = values
        inertia = weight * np.array([[I11, -I21, -I31], [-I21, I22, -I32], [-I31, -I32, I33]])
        if mass or inertia.any():
            try:
                yield rigid_mass(name, node, mass, x, inertia)
            except ModelError as error:
                raise card.error(str(error), 8) from error

    # -- bushes ----------------------------------------------------------------------------------
    def _bushes(self) -> Iterator[Discrete]:
        """CBUSH: three springs between two nodes, or to ground, and three against their turns."""
        stiffness = {card.whole(0, "a property"): card for card in self._all("PBUSH")}
        for card in self._all("CBUSH"):
            number = card.whole(0, "an element number")
            property_number = card.whole(1, "a property", number)
            if property_number not in stiffness:
                raise card.error(f"there is no PBUSH {property_number}", 1)
            k = self._bush_stiffness(stiffness[property_number])
            numbers = [card.whole(field, "a node", 0) for field in (2, 3)]
            nodes = [self._node(card, n, field) for field, n in enumerate(numbers, 2) if n]
            if not nodes:
                raise card.error("expected a node", 2)
            axes = self._bush_axes(card, nodes, k)
            turning = [node in self._turning for node in nodes]
            if k[3:].any() and not all(turning):
                raise card.error(
                    "its stiffness against turns is at a node that does not turn: expected "
                    "reference nodes of RBE2, or K4 to K6 of zero",
                    2,
                )
            arms = self._bush_arms(card, nodes)
            for direction in range(6):
                if not k[direction]:
                    continue
                axis, ends = axes[direction % 3], []
                for node, arm, sign in zip(nodes, arms, (-1.0, 1.0), strict=False):
                    along = np.append(np.zeros(3), axis)
                    if direction < 3:
                        lever = np.cross(arm, axis) if node in self._turning else np.zeros(3)
                        along = np.append(axis, lever)
                    ends.append((node, sign * along))
                if not any(along[3:].any() for _, along in ends):
                    ends = [(node, along[:3]) for node, along in ends]
                yield spring(f"CBUSH {number}", ends, k[direction])

    def _bush_arms(self, card: BulkCard, nodes: list[int]) -> np.ndarray:
        """Vectors from each node to the bush, which is at S of the way, half of it by default."""
        if card.at(9) not in ("", "-1"):
            raise card.error("OCID: a place off the line of its nodes is not supported", 9)
        share = card.real(8, "a share of the way", 0.5)
        x = self._nodes[nodes]
        return (1 - share) * x[0] + share * x[-1] - x

    @staticmethod
    def _bush_stiffness(card: BulkCard) -> np.ndarray:
        """K1 to K6 of a PBUSH, whose lines begin with K, B, GE or RCV."""
        k = np.zeros(6)
        for field in range(1, len(card.fields), 8):
            if card.at(field).upper() == "K":
                k = np.array([card.real(field + i, "a stiffness", 0.0) for i in range(1, 7)])
                if (k < 0).any():
                    raise card.error("expected stiffnesses of zero or above", field)
        return k

    def _bush_axes(self, card: BulkCard, nodes: list[int], k: np.ndarray) -> np.ndarray:
        """Axes of a bush as rows (3, 3): of CID, or of the line of its nodes and G0 or X1 to X3."""
        if card.at(7):
            return self._systems.axes_at(card, 7, self._nodes[nodes[0]])
        is_isotropic = (k[:3] == k[0]).all() and (k[3:] == k[3]).all()
        if is_isotropic:
            return np.eye(3)
        x = self._nodes[nodes[-1]] - self._nodes[nodes[0]]
        if not np.linalg.norm(x) > 0:
            raise card.error("expected CID of a bush whose nodes lie at one place", 7)
        x = x / np.linalg.norm(x)
        direction_fields = [card.at(field) for field in (4, 5, 6)]
        if not any(direction_fields):
            if k[[1, 2, 4, 5]].any():
                raise card.error("expected G0 or X1, X2, X3, or CID", 4)
            return np.array([x, x, x])
        if direction_fields[0] and not any(direction_fields[1:]) and "." not in direction_fields[0]:
            v = self._nodes[self._place(card, card.whole(4, "a node"))] - self._nodes[nodes[0]]
        else:
            v = np.array([card.real(field, "a coordinate", 0.0) for field in (4, 5, 6)])
        z = np.cross(x, v)
        if not np.linalg.norm(z) > 0:
            raise card.error("its orientation lies along the bush", 4)
        z = z / np.linalg.norm(z)
        return np.array([x, np.cross(z, x), z])

    def equations(self, above: Sequence[Line], bare: np.ndarray) -> Iterator[Relation]:
        """MPC cards that the case control selects, or all where there is none."""
        chosen = {int(match[1]) for line in above if (match := SELECTED.match(line.text))}
        for card in self._all("MPCADD"):
            if card.whole(0, "a set") in chosen:
                chosen |= set(card.listed(1, "a set"))
        for card in self._all("MPC"):
            number = card.whole(0, "a set")
            if above and number not in chosen:
                continue
            ends, factors = [], []
            for field in range(1, len(card.fields)):
                if field % 8 in (1, 4) and card.at(field):
                    end = self._end(card, field, turns=False)
                    if end is not None:
                        ends.append((end[0], end[1][:3]))
                        factors.append(card.real(field + 2, "a factor"))
            if not ends or not factors[0]:
                raise card.error("expected a node, a direction and a factor that is not zero")
            nodes = np.array([node for node, _ in ends])
            if bare[nodes].all():
                continue
            vectors = np.array([a * axis for a, (_, axis) in zip(factors, ends, strict=True)])
            yield relation(f"MPC {number} (line {card.lines[0].place + 1})", nodes, vectors)
