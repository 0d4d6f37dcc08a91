"""Materials of Nastran bulk data: MAT1 (with MATT1 and TABLEM1 to 4), MAT9 and MAT11."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.bulk_cards import BulkCard
from squealstudy.models.components.bulk_names import MODEL_FILE
from squealstudy.models.components.materials import (
    Anisotropic,
    Elastic,
    Orthotropic,
    Unfinished,
)
from squealstudy.models.fem.solid import Isotropic

READ = ("MAT1", "MAT9", "MAT11")
TABLES = ("TABLEM1", "TABLEM2", "TABLEM3", "TABLEM4")
OVER_TEMPERATURE = ("MATT1", *TABLES)
UNREAD_TABLES = {"MAT9": "MATT9", "MAT11": "MATT11"}  # tables over temperature that are not read
# row of xx, yy, zz, xy, yz, zx in matrices of this program, whose order is 11 22 33 23 13 12
VOIGT_ROWS = (0, 1, 2, 5, 3, 4)
G_REL_TOLERANCE = 0.01  # relative difference of G from E / (2 (1 + nu)): files round their numbers
DAMPING_FIELD = {"MAT1": 7, "MAT9": 30, "MAT11": 15}  # GE
LAST = ("ENDT", "SKIP")  # words that end a table


class BulkMaterials:
    """Reader of the materials of a deck.

    Parameters
    ----------
    cards : callable
        Returns all cards of the given names.
    weight : float
        Factor on densities (WTMASS).
    temperature : float or None
        At which moduli are taken, in the scale of the deck. None takes those of the MAT1 itself.
    note : callable
        Called with cards, and why something on them is passed over.
    """

    def __init__(
        self,
        cards: Callable[..., Sequence[BulkCard]],
        weight: float,
        temperature: float | None,
        note: Callable[[list[BulkCard], str], None],
    ) -> None:
        self._all, self._weight, self._temperature, self._note = cards, weight, temperature, note
        self._cards = {card.whole(0, "a material number"): card for card in cards(*READ)}

    def read(self, section: BulkCard) -> tuple[str, Elastic | Unfinished]:
        """Name and material of a PSOLID; ModelError about a card that is wrong."""
        number = section.whole(1, "a material")
        name = f"MAT{number}"
        if number not in self._cards:
            return name, Unfinished(None, None, str(section.error(f"there is no MAT1 {number}", 1)))
        card = self._cards[number]
        if card.name == "MAT1":
            card = self._at_temperature(card, number)
            self._note_damping(self._cards[number])
            return name, _isotropic(card, self._weight)
        if section.at(2).strip("0"):
            raise section.error("CORDM: only the basic coordinate system is supported", 2)
        if self._temperature is not None and self._table_card(UNREAD_TABLES[card.name], number):
            raise card.error(f"{UNREAD_TABLES[card.name]} is not supported: state its moduli there")
        self._note_damping(card)
        moduli = _anisotropic if card.name == "MAT9" else _orthotropic
        return name, moduli(card, self._weight)

    def _note_damping(self, card: BulkCard) -> None:
        if card.at(DAMPING_FIELD[card.name]).strip("0."):
            self._note([card], "damping is " + MODEL_FILE)

    def _table_card(self, name: str, number: int) -> BulkCard | None:
        return next((c for c in self._all(name) if c.whole(0, "a material number") == number), None)

    def _at_temperature(self, card: BulkCard, number: int) -> BulkCard:
        """The MAT1 with the values of its MATT1 at the temperature."""
        tables = self._table_card("MATT1", number)
        if tables is None:
            return card
        if self._temperature is None:
            why = "moduli over temperature: without the key temperature those of the MAT1 are taken"
            self._note([tables], why)
            return card
        fields = [*card.fields, *[""] * 8]
        for field in (1, 2, 3, 4):
            table = tables.whole(field, "a table", 0)
            if table:
                fields[field] = repr(self._value(tables, field, table, card))
        return BulkCard(card.name, fields, [*card.lines, *card.lines[-1:] * 8])

    def _value(self, tables: BulkCard, field: int, number: int, card: BulkCard) -> float:
        """A property at the temperature; ModelError where it is outside the table."""
        same_number = [c for c in self._all(*TABLES) if c.whole(0, "a table number") == number]
        if len(same_number) != 1:
            raise tables.error(
                f"there {'is no' if not same_number else 'are two'} TABLEM {number}", field
            )
        (table,) = same_number
        T = float(self._temperature or 0.0)
        if table.name == "TABLEM1" and any(table.at(k).strip() for k in (1, 2)):
            axes = {table.at(1).upper(), table.at(2).upper()} - {"", "LINEAR"}
            if axes:
                raise table.error("axes that are not LINEAR are not supported", 1)
        factor = card.real(field, "a number", 0.0)
        if table.name in ("TABLEM2", "TABLEM3", "TABLEM4"):
            T -= table.real(1, "a temperature", 0.0)
        if table.name in ("TABLEM3", "TABLEM4"):
            T /= table.real(2, "a temperature above zero")
        if table.name == "TABLEM4":
            low, high = (table.real(k, "a temperature") for k in (3, 4))
            self._check(table, T, low, high)
            powers = self._numbers(table)
            return factor * float(np.polynomial.polynomial.polyval(T, powers))
        pairs = np.array(self._numbers(table))
        x, y = pairs[: len(pairs) // 2 * 2].reshape(-1, 2).T
        if len(pairs) % 2 or len(x) < 2 or (np.diff(x) <= 0).any():
            raise table.error("expected at least two pairs of ascending temperatures and values")
        self._check(table, T, x[0], x[-1])
        interpolated = float(np.interp(T, x, y))
        return interpolated if table.name == "TABLEM1" else factor * interpolated

    def _check(self, table: BulkCard, T: float, low: float, high: float) -> None:
        if not low <= T <= high:
            raise table.error(
                f"temperature = {self._temperature:g} is outside of the table, whose argument goes "
                f"from {low:g} to {high:g}"
            )

    @staticmethod
    def _numbers(table: BulkCard) -> list[float]:
        """Numbers of a table, from its second line up to ENDT or SKIP."""
        entries = []
        for field in range(8, len(table.fields)):
            if table.at(field).upper() in LAST:
                break
            if table.at(field):
                entries.append(table.real(field, "a number"))
        return entries


def _orthotropic(card: BulkCard, weight: float) -> Orthotropic | Unfinished:
    """Material of a MAT11: E1 E2 E3, nu12 nu13 nu23, G12 G13 G23; density times `weight`."""
    values = [card.real(k, "a modulus") for k in range(1, 10)]
    E, nu, G = (tuple(values[k : k + 3]) for k in (0, 3, 6))
    rho = card.real(10, "a density", 0.0)
    try:
        moduli = Orthotropic.from_engineering(E, nu, G, 1.0)  # type: ignore[arg-type]
    except (ModelError, ZeroDivisionError) as error:
        raise card.error(str(error)) from error
    if not rho > 0:
        return Unfinished(moduli, None, str(card.error("expected a density RHO above zero", 10)))
    return replace(moduli, density=weight * rho)


def _isotropic(card: BulkCard, weight: float) -> Isotropic | Unfinished:
    """Material of a MAT1: two of E, G and nu give the third; density times `weight`."""
    E, G, nu = (card.real(k, "a number", 0.0) if card.at(k) else None for k in (1, 2, 3))
    if E is None and G is not None and nu is not None:
        E = 2 * G * (1 + nu)
    elif nu is None and E is not None and G is not None:
        nu = E / (2 * G) - 1
    elif (
        not (E is None or nu is None or G is None)
        and abs(G - E / (2 * (1 + nu))) > G_REL_TOLERANCE * G
    ):
        raise card.error("E, G and NU contradict each other: give two of them")
    rho = card.real(4, "a density", 0.0)
    if E is None or nu is None or not (E > 0 and -1 < nu < 0.5):
        raise card.error("expected E > 0 and -1 < NU < 0.5, or G in place of one of them")
    if not rho > 0:
        missing = card.error("expected a density RHO above zero", 4)
        return Unfinished(Isotropic(E, nu, 1.0), None, str(missing))
    return Isotropic(E, nu, weight * rho)


def _anisotropic(card: BulkCard, weight: float) -> Anisotropic | Unfinished:
    """Material of a MAT9: 21 moduli in the order xx yy zz xy yz zx; density times `weight`."""
    C = np.zeros((6, 6))
    field = 1
    for i in range(6):
        for j in range(i, 6):
            row, column = VOIGT_ROWS[i], VOIGT_ROWS[j]
            C[row, column] = C[column, row] = card.real(field, "a modulus", 0.0)
            field += 1
    rho = card.real(22, "a density", 0.0)
    try:
        moduli = Anisotropic.of_stiffness(C, 1.0)
    except ModelError as error:
        raise card.error(str(error)) from error
    if not rho > 0:
        missing = card.error("expected a density RHO above zero", 22)
        return Unfinished(moduli, None, str(missing))
    return replace(moduli, density=weight * rho)
