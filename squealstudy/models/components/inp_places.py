"""Nodes that words of a keyword file name: numbers, sets, and those of an instance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from squealstudy.models.components.inp_lines import WHOLE_NUMBER, Line
from squealstudy.models.components.inp_sets import Sets


class NodePlaces:
    """Indices in the mesh of the nodes that words name, in a part or in the assembly.

    Parameters
    ----------
    sets : Sets
        Node sets.
    places : callable
        Returns indices in the mesh from node numbers.
    """

    def __init__(self, sets: Sets, places: Callable[[np.ndarray], np.ndarray]) -> None:
        self._sets, self._places = sets, places

    def of(self, line: Line, word: str) -> np.ndarray:
        """Indices of a node by number or instance.number, or of a set.

        Empty where they belong to other instances. ModelError where there is no such node or set.
        """
        sets, (owner, _, label) = self._sets, word.rpartition(".")
        if not WHOLE_NUMBER.fullmatch(label):
            return self._places(sets.labels(word, line))
        if sets.part is None and not owner:
            sets.check(line, int(label))
            return self._places(np.array([int(label)]))
        if sets.part is not None and owner.upper() == sets.instance:
            sets.part.check(line, int(label))
            return self._places(np.array([int(label)]))
        return np.zeros(0, dtype=np.int64)
