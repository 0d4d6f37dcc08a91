"""Sets of nodes and elements in files of Abaqus and CalculiX, evaluated when needed."""

from __future__ import annotations

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_lines import WHOLE_NUMBER, Line

NO_LABELS = np.zeros(0, dtype=np.int64)


class Sets:
    """The node sets, or the element sets, of a part or of an assembly.

    Parameters
    ----------
    kind : str
        node or element.
    part : Sets or None
        For an assembly: the sets of the part of the chosen instance.
    instance : str
        For an assembly: the name of that instance, in capitals.
    """

    def __init__(self, kind: str, part: Sets | None = None, instance: str = "") -> None:
        self.kind, self.part, self.instance = kind, part, instance
        self.shown: dict[str, str] = {}  # names as first written, by capitals
        self._entries: dict[str, list[Card | np.ndarray]] = {}
        self.all_labels = NO_LABELS  # of the nodes or elements that exist, ascending
        self._absent: dict[int, tuple[Card, int]] = {}

    @property
    def absent(self) -> list[tuple[Card, int]]:
        """Cards with GENERATE whose ranges have labels that do not exist, and how many."""
        return list(self._absent.values())

    def add(self, name: str, entry: Card | np.ndarray) -> None:
        """Add the members of a card, or labels, to a set."""
        self.shown.setdefault(name.upper(), name)
        self._entries.setdefault(name.upper(), []).append(entry)

    def labels(self, name: str, line: Line, above: tuple[str, ...] = ()) -> np.ndarray:
        """Labels of a set, ascending; for an assembly those that belong to the instance.

        Raises
        ------
        ModelError
            There is no such set, or it contains itself (at `line`, which names it); it has labels
            that do not exist (at its own line).
        """
        key = name.upper()
        if key in above:
            raise line.error(f"the {self.kind} set '{name}' contains itself")
        if key in self._entries:
            parts = [self._members(e, (*above, key)) for e in self._entries[key]]
            return np.unique(np.concatenate([NO_LABELS, *parts]))
        owner, dot, inner = name.partition(".")
        if self.part is not None and dot:
            return self.part.labels(inner, line) if owner.upper() == self.instance else NO_LABELS
        names = ", ".join(self.shown.values()) or "none"
        raise line.error(f"there is no {self.kind} set '{name}'; there is {names}")

    def _members(self, entry: Card | np.ndarray, above: tuple[str, ...]) -> np.ndarray:
        """Numbers in a set, those of sets within it included."""
        if isinstance(entry, np.ndarray):
            return entry
        instance = entry.parameters.get("INSTANCE")
        if self.part is not None and instance is not None:
            if instance.upper() != self.instance:
                return NO_LABELS
            return self.part._members(entry, ())
        if "GENERATE" in entry.parameters:
            return self._generated(entry) if self.part is None else NO_LABELS
        labels_of_sets, numbers = [], []
        for line in entry.data:
            for word in line.words():
                if WHOLE_NUMBER.fullmatch(word):
                    numbers.append(int(word))
                    self.check(line, numbers[-1])
                else:
                    labels_of_sets.append(self._named(line, word, above))
        written_labels = np.array(numbers, dtype=np.int64) if self.part is None else NO_LABELS
        return np.concatenate([written_labels, *labels_of_sets])

    def _named(self, line: Line, word: str, above: tuple[str, ...]) -> np.ndarray:
        """Labels of a word in a set: another set, or instance.label."""
        owner, _, label = word.partition(".")
        if self.part is not None and WHOLE_NUMBER.fullmatch(label):
            if owner.upper() != self.instance:
                return NO_LABELS
            self.part.check(line, int(label))
            return np.array([int(label)], dtype=np.int64)
        return self.labels(word, line, above)

    def _generated(self, card: Card) -> np.ndarray:
        """Numbers in a set of ranges (GENERATE)."""
        ranges, missing = [], 0
        for line in card.data:
            words = line.words()
            if len(words) not in (2, 3):
                raise line.error(f"expected first, last and step, found '{line.text.strip()}'")
            first, last, *step = (line.whole(w, f"a {self.kind} number") for w in words)
            by = step[0] if step else 1
            if by == 0 or (last - first) * by < 0:
                raise line.error(f"from {first} to {last} in steps of {by} there is nothing")
            inside = self.all_labels[
                (self.all_labels >= min(first, last)) & (self.all_labels <= max(first, last))
            ]
            inside = inside[(inside - first) % abs(by) == 0]
            missing += (last - first) // by + 1 - len(inside)
            ranges.append(inside)
        if missing:
            self._absent[id(card)] = (card, missing)
        return np.concatenate([NO_LABELS, *ranges])

    def check(self, line: Line, label: int) -> None:
        """Raise ModelError about the line where a part has no such label."""
        index = np.searchsorted(self.all_labels, label)
        if self.part is None and (index == len(self.all_labels) or self.all_labels[index] != label):
            raise line.error(f"there is no {self.kind} {label}")
