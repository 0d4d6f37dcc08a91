"""The cards of one component, and the report of those that are passed over."""

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
        The file asked for.
    part : list of Card
        Of the part and its instance, or of a file without parts.
    assembly : list of Card
        Sets and surfaces of the assembly.
    instance : str
        In capitals; empty without parts.
    materials : dict of str -> MaterialText
        By their names in capitals.
    turn, shift : ndarray
        Placement of the instance: x goes to turn x + shift.
    elements : dict of str -> str
        Types of elements of the file, in capitals, and their formulation here.
    temperature : float or None
        At which materials are taken.
    abaqus : bool
        Whether Abaqus is meant, and not CalculiX.
    non_solids : list of (Card, list of int)
        Elements that are no solids, and their numbers.
    points : list of Card
        Of these the springs, masses and older couplings, whose keywords are read.
    points_alone : bool
        The component needs no elements, and all its nodes are kept.
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
    """The report of parameters of a card that are passed over."""
    many = "s" if len(card.unused) > 1 else ""
    return passed(card, f"the parameter{many} {', '.join(card.unused)}, not used here")


def passed(card: Card, why: str) -> PassedOver:
    """A card for the report of what is passed over."""
    return PassedOver(card.shown, card.line.file.path, card.line.place + 1, why)
