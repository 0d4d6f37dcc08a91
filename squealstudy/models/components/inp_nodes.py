"""Nodes of a part: ``*NODE``, and of Abaqus ``*SYSTEM``, ``*NGEN`` and ``*NFILL``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.inp_sets import Sets

NODE = ("NSET", "INPUT", "SYSTEM")
NGEN = ("NSET", "LINE", "SYSTEM")
NFILL = ("NSET", "BIAS", "TWOSTEP", "SINGULAR")
KEYWORDS = ("NODE", "SYSTEM", "NGEN", "NFILL")
MAX_GENERATED = 20_000_000  # nodes, or elements, that a deck generates
FLAT = 1e-10  # two directions are the same if the sine of their angle is smaller


class Nodes:
    """The nodes of a part.

    Attributes
    ----------
    numbers : ndarray (n,) of int
        Ascending.
    places : ndarray (n, 3)
        Their coordinates, in the unit of the file.
    """

    def __init__(self, cards: Sequence[Card], sets: Sets) -> None:
        """Read the cards, and add node sets that they name to `sets`.

        ModelError about a line that is wrong.
        """
        self._sets = sets
        self._numbers: list[int] = []
        self._places: list[list[float]] = []
        self._lines: list[Line] = []
        self._local: tuple[np.ndarray, np.ndarray] | None = None  # origin, axes as rows
        self._named: list[tuple[str, np.ndarray]] = []
        self._at: dict[int, int] | None = None  # by number, once nodes are generated
        before: list[Card] = []
        for card in cards:
            if card.keyword == "NODE":
                self._read(card)
            elif card.keyword == "SYSTEM":
                self._local = _system(card)
            elif card.keyword == "NGEN":
                self._between(card)
            elif card.keyword == "NFILL":
                self._fill(card, before)
            elif card.keyword == "NSET" and "ELSET" not in card.parameters:
                before.append(card)
        if not self._numbers:
            raise cards[0].error("there are no nodes")
        labels, X = np.array(self._numbers, dtype=np.int64), np.array(self._places)
        order = np.argsort(labels, kind="stable")
        labels, X = labels[order], X[order]
        again = np.flatnonzero(labels[1:] == labels[:-1])
        for k in again:
            if (X[k] != X[k + 1]).any():
                line = self._lines[order[k + 1]]
                raise line.error(f"node {labels[k]} is there twice, at different places")
        keep = np.append(True, labels[1:] != labels[:-1])
        self.numbers, self.places = labels[keep], X[keep]

    def _read(self, card: Card) -> None:
        """Read a *NODE card, in its own coordinates and the *SYSTEM in force."""
        card.check(NODE)
        first = len(self._numbers)
        system = card.parameters.get("SYSTEM", "R").upper()
        if system not in ("R", "C", "S"):
            raise card.error(f"SYSTEM={system} is not supported: expected R, C or S")
        for line in card.data:
            number, *x = line.words()
            if len(x) > 3:
                raise line.error(f"expected a node and three coordinates, found {len(x) + 1} words")
            position = [line.real(c, "a coordinate") if c else 0.0 for c in x]
            position = cartesian(system, position + [0.0] * (3 - len(x)))
            if self._local is not None:
                origin, axes = self._local
                position = (origin + np.array(position) @ axes).tolist()
            self._add(line.whole(number, "a node number"), position, line)
        if name := card.parameters.get("NSET"):
            self._name(name, self._numbers[first:])

    def _add(self, number: int, position: list[float], line: Line) -> None:
        if self._at is not None:
            self._at[number] = len(self._numbers)
        self._numbers.append(number)
        self._places.append(position)
        self._lines.append(line)

    def _name(self, name: str, numbers: Sequence[int]) -> None:
        self._named.append((name, np.array(numbers, dtype=np.int64)))
        self._sets.add(*self._named[-1])

    def _place(self, line: Line, number: int) -> np.ndarray:
        """Position of a node that has been read."""
        if self._at is None:
            self._at = {n: k for k, n in enumerate(self._numbers)}
        if number not in self._at:
            raise line.error(f"there is no node {number} yet")
        return np.array(self._places[self._at[number]])

    # -- *NGEN -----------------------------------------------------------------------------------
    def _between(self, card: Card) -> None:
        """Add nodes at equal steps between two, on a line, a circular arc or a parabola."""
        card.check(NGEN)
        kind = card.parameters.get("LINE", "").upper()
        if kind not in ("", "C", "P"):
            raise card.error(f"LINE={kind} is not supported: expected C or P")
        members: list[int] = []
        for line in card.data:
            words = [*line.words(), *[""] * 10]
            first, last = (line.whole(w, "a node number") for w in words[:2])
            step = line.whole(words[2], "a step of numbers") if words[2] else 1
            numbers = _numbers(line, first, last, step)
            a, b = (self._place(line, n) for n in (first, last))
            share = np.arange(1, len(numbers) - 1) / (len(numbers) - 1)
            if kind:
                extra = self._extra(card, line, words)
                normal = [line.real(w, "a direction") if w else 0.0 for w in words[7:10]]
                if kind == "C":
                    X = _arc(line, a, b, extra, np.array(normal), share)
                else:
                    t = share[:, None]
                    X = a * (1 - t) * (1 - 2 * t) + 4 * extra * t * (1 - t) + b * t * (2 * t - 1)
            else:
                X = a + share[:, None] * (b - a)
            for number, position in zip(numbers[1:-1], X, strict=True):
                self._add(number, position.tolist(), line)
            members += numbers
        if name := card.parameters.get("NSET"):
            self._name(name, members)

    def _extra(self, card: Card, line: Line, words: list[str]) -> np.ndarray:
        """The centre of an arc or the middle of a parabola: a node, or coordinates."""
        if words[3]:
            return self._place(line, line.whole(words[3], "a node number"))
        if self._local is not None:
            raise line.error("a point by coordinates within *SYSTEM is not supported: name a node")
        system = card.parameters.get("SYSTEM", "RC").upper()
        if system not in ("RC", "C", "S"):
            raise card.error(f"SYSTEM={system} is not supported: expected RC, C or S")
        x = [line.real(w, "a coordinate") if w else 0.0 for w in words[4:7]]
        return np.array(cartesian("R" if system == "RC" else system, x))

    # -- *NFILL ----------------------------------------------------------------------------------
    def _fill(self, card: Card, before: Sequence[Card]) -> None:
        """Add nodes at equal steps between each node of a set and its partner in another set."""
        card.check(NFILL)
        for name in ("BIAS", "SINGULAR", "TWOSTEP"):
            if card.parameters.get(name, "1").strip() not in ("1", "1.", "1.0"):
                raise card.error(f"*NFILL, {name} is not supported: expected equal steps")
        node_sets = Sets("node")
        node_sets.all_labels = np.unique(np.array(self._numbers, dtype=np.int64))
        for sets_card in before:
            node_sets.add(sets_card.value("NSET"), sets_card)
        for name, labels in self._named:
            node_sets.add(name, labels)
        members: list[int] = []
        for line in card.data:
            words = line.words()
            if len(words) not in (3, 4):
                raise line.error("expected two node sets, a number of intervals, a step of numbers")
            first_set, second_set = (node_sets.labels(w, line) for w in words[:2])
            if len(first_set) != len(second_set) or not len(first_set):
                raise line.error(
                    f"expected sets with as many nodes, found {len(first_set)} and "
                    f"{len(second_set)}"
                )
            count = line.whole(words[2], "a number of intervals")
            step = line.whole(words[3], "a step of numbers") if len(words) > 3 else 1
            if not 1 <= count * len(first_set) <= MAX_GENERATED:
                raise line.error(
                    f"expected 1 to {MAX_GENERATED // len(first_set)} intervals, found {count}"
                )
            members += [*first_set.tolist(), *second_set.tolist()]
            for first, last in zip(first_set.tolist(), second_set.tolist(), strict=True):
                a, b = self._place(line, first), self._place(line, last)
                for k in range(1, count):
                    self._add(first + k * step, (a + k / count * (b - a)).tolist(), line)
                    members.append(first + k * step)
        if named := card.parameters.get("NSET"):
            self._name(named, members)


def _numbers(line: Line, first: int, last: int, step: int) -> list[int]:
    if step == 0 or (last - first) % step or (last - first) * step <= 0:
        raise line.error(f"from {first} to {last} there are no steps of {step}")
    if (last - first) // step > MAX_GENERATED:
        raise line.error(f"expected at most {MAX_GENERATED} generated nodes")
    return list(range(first, last + (1 if step > 0 else -1), step))


def _arc(
    line: Line,
    a: np.ndarray,
    b: np.ndarray,
    centre: np.ndarray,
    normal: np.ndarray,
    share: np.ndarray,
) -> np.ndarray:
    """Points (n, 3) at shares of the arc from a to b, which is the short one without a normal."""
    from scipy.spatial.transform import Rotation  # heavy: only arcs need it

    u, v = a - centre, b - centre
    size = np.linalg.norm(u) * np.linalg.norm(v)
    across = np.cross(u, v)
    flat = not np.linalg.norm(across) > FLAT * size
    if not size > 0 or (flat and not normal.any()):
        raise line.error("expected ends off the centre, and for 180 degrees or more a normal")
    axis = normal if normal.any() else across
    axis = axis / np.linalg.norm(axis)
    angle = np.arctan2(across @ axis, u @ v) % (2 * np.pi)
    turned = Rotation.from_rotvec(np.outer(share * angle, axis)).apply(u)
    return np.asarray(centre + turned)


def _system(card: Card) -> tuple[np.ndarray, np.ndarray] | None:
    """Origin and axes (rows) of ``*SYSTEM``; None where coordinates are global again."""
    if not card.data:
        return None
    card.check(())
    rows = [
        [line.real(w, "a coordinate") if w else 0.0 for w in line.words()] for line in card.data
    ]
    if len(rows) > 2 or len(rows[0]) not in (3, 6) or (len(rows) == 2 and len(rows[1]) != 3):
        raise card.data[0].error(
            "expected an origin, a point on axis 1, and on the next line a point in plane 1-2"
        )
    origin = np.array(rows[0][:3])
    if len(rows[0]) == 3:
        return origin, np.eye(3)
    x = np.array(rows[0][3:]) - origin
    y = np.array(rows[1]) - origin if len(rows) == 2 else np.cross([0.0, 0.0, 1.0], x)
    if len(rows) == 1:
        x[2] = 0.0  # axis 3 stays
    z = np.cross(x, y)
    if not np.linalg.norm(z) > FLAT * np.linalg.norm(x) * np.linalg.norm(y):
        raise card.data[0].error("the points of the system lie on one line")
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return origin, np.array([x, np.cross(z, x), z])


def cartesian(system: str, x: list[float]) -> list[float]:
    """Cartesian coordinates from those in a system R, C (r, angle, z) or S (r, angle, elevation).

    Angles are in degrees.
    """
    if system == "R":
        return x
    angle = np.deg2rad(x[1])
    if system == "C":
        return [float(x[0] * np.cos(angle)), float(x[0] * np.sin(angle)), x[2]]
    above = np.deg2rad(x[2])
    flat = x[0] * np.cos(above)
    return [
        float(flat * np.cos(angle)),
        float(flat * np.sin(angle)),
        float(x[0] * np.sin(above)),
    ]
