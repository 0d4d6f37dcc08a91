"""Coordinate systems of Nastran: rectangular, cylindrical and spherical, by three points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.models.components.bulk_cards import BulkCard

FLAT = 1e-10  # sine between the axis and the third point, below which they are on a line


class Systems:
    """CORD2R, CORD2C and CORD2S cards by number."""

    def __init__(self, cards: Sequence[BulkCard]) -> None:
        self._cards: dict[int, BulkCard] = {}
        for card in cards:
            number = card.whole(0, "a number of the system")
            if number in self._cards:
                raise card.error(f"there is a coordinate system {number} already")
            self._cards[number] = card
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def in_basic(self, card: BulkCard, place: int, x: np.ndarray) -> np.ndarray:
        """Basic coordinates (3,) of x (3,) in the system that a field of a card names.

        Raises ModelError where there is none, or where systems refer to each other.
        """
        return self._basic(card, place, x, ())

    def _basic(
        self, card: BulkCard, place: int, x: np.ndarray, above: tuple[int, ...]
    ) -> np.ndarray:
        number = card.whole(place, "a coordinate system", 0)
        if number == 0:
            return x
        if number not in self._cards:
            raise card.error(f"there is no coordinate system {number} (CORD2R, C or S)", place)
        if number in above:
            raise card.error(f"the coordinate system {number} refers to itself", place)
        own = self._cards[number]
        if number not in self._known:
            self._known[number] = self._axes(own, (*above, number))
        origin, axes = self._known[number]
        if own.name == "CORD2R":
            local = x
        elif own.name == "CORD2C":
            r, angle = x[0], np.deg2rad(x[1])
            local = np.array([r * np.cos(angle), r * np.sin(angle), x[2]])
        else:
            r, polar, angle = x[0], np.deg2rad(x[1]), np.deg2rad(x[2])
            flat = r * np.sin(polar)
            local = np.array([flat * np.cos(angle), flat * np.sin(angle), r * np.cos(polar)])
        return origin + local @ axes

    def _axes(self, own: BulkCard, above: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Origin, and the axes as rows, of points A (origin), B (on z) and C (in the xz plane)."""
        given = np.array([own.real(k, "a coordinate", 0.0) for k in range(2, 11)]).reshape(3, 3)
        a, b, c = (self._basic(own, 1, x, above) for x in given)
        size = np.linalg.norm(b - a) * np.linalg.norm(c - a)
        if not np.linalg.norm(np.cross(b - a, c - a)) > FLAT * size:
            raise own.error("its three points lie on one line")
        z = (b - a) / np.linalg.norm(b - a)
        y = np.cross(z, c - a)
        y /= np.linalg.norm(y)
        return a, np.stack([np.cross(y, z), y, z])
