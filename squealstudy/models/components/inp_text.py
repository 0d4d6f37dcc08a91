"""The cards of one component of an .inp file, and the report of cards that are passed over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_materials import MaterialText
from squealstudy.models.components.mesh import PassedOver


@dataclass
class Text:
    """Cards and settings of one component.

    Attributes
    ----------
    path : Path
        The file that the user named.
    part : list of Card
        Cards of the part and its instance, or of a file without parts.
    assembly : list of Card
        Cards of the assembly with sets and surfaces.
    instance : str
        Name of the instance in capitals; empty in a file without parts.
    materials : dict of str -> MaterialText
        Materials by their names in capitals.
    turn, shift : ndarray
        Placement of the instance: a point x is moved to turn x + shift.
    elements : dict of str -> str
        Formulation used here for each element type of the file, in capitals.
    temperature : float or None
        Temperature at which material constants are read.
    abaqus : bool
        Whether the file is read as one of Abaqus; else of CalculiX.
    non_solids : list of (Card, list of int)
        Cards of elements that are no solids, with the numbers of the elements.
    points : list of Card
        Those of these cards that are read: springs, masses and older couplings.
    points_alone : bool
        Whether the component needs no elements, and all its nodes are kept.
    passed_over : list of PassedOver
        Cards that are passed over, with the reasons.
    """

    path: Path
    part: Sequence[Card]
    assembly: Sequence[Card]
    instance: str
    materials: Mapping[str, MaterialText]
    turn: np.ndarray
    shift: np.ndarray
    elements: Mapping[str, str]
    temperature: float | None = None
    abaqus: bool = False
    non_solids: list[tuple[Card, list[int]]] = field(default_factory=list)
    points: list[Card] = field(default_factory=list)
    points_alone: bool = False
    passed_over: list[PassedOver] = field(default_factory=list)

    def note(self, card: Card, why: str) -> None:
        """Report a card that is passed over, in whole or in part."""
        self.passed_over.append(passed(card, why))


def unused(card: Card) -> PassedOver:
    """The report of a card's parameters that are passed over."""
    many = "s" if len(card.unused) > 1 else ""
    return passed(card, f"the parameter{many} {', '.join(card.unused)}, not used here")


def passed(card: Card, why: str) -> PassedOver:
    """The report of a card that is passed over, with the reason."""
    return PassedOver(card.shown, card.line.file.path, card.line.place + 1, why)
