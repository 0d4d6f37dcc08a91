"""Coordinates of matrices from files, and motions along them."""

from __future__ import annotations

import numpy as np

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.matrix_tables import MatrixFile, Motion
from squealstudy.models.lumped.numbers import Values, names_in, value_of
from squealstudy.models.lumped.space import Structure
from squealstudy.models.lumped.term_matrices import TermMatrices

COMPONENT = "structure"  # component name of the matrices in columns of tables
# eigenvalues of matrices with a diagonal of ones: below them K is negative, not round-off, and M
# cannot be divided by
LEAST_ROOT, LEAST_MASS_ROOT = -1e-10, 1e-12
MOST_NAMED = 12  # coordinates that a message lists


class MatrixSpace:
    """Coordinates of matrices from files: by number from 1, by name, or by node and direction.

    Attributes
    ----------
    file : MatrixFile
    names : tuple of str
        Names of the coordinates in the order of the rows.

    Raises
    ------
    PlacedError
        There are more or fewer names than coordinates, or a name is there twice.
    """

    def __init__(self, file: MatrixFile, terms: TermMatrices) -> None:
        self.file = file
        self._matrices = terms.matrices
        self.names = self._names(terms.labels)
        self.numbers = {name: i for i, name in enumerate(self.names)}
        self.numbers |= {str(i + 1): i for i in range(self.n)}
        self._constant: dict[str, np.ndarray] = {}

    def _names(self, labels: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the coordinates: of the file, of its matrices, or their numbers."""
        names = self.file.coordinates
        if not names:
            return labels or tuple(str(i + 1) for i in range(self.n))
        if len(names) != self.n:
            text = f"expected {self.n} names, of all rows of the matrices, got {len(names)}"
            raise PlacedError(("coordinates",), text)
        for i, name in enumerate(names):
            if names.index(name) < i:
                text = f"'{name}' is the name of row {names.index(name) + 1} already"
                raise PlacedError(("coordinates", i), f"{text}: expected another")
            if not name.strip() or name.startswith("-") or name.isdigit():
                text = f"expected a name that is no number and has no minus, got '{name}'"
                raise PlacedError(("coordinates", i), text)
        return names

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self._matrices[0])

    def structure(self, values: Values) -> Structure:
        """The matrices at values of parameters.

        Raises
        ------
        PlacedError
            A coefficient has no value, M is not positive definite, or K has a negative eigenvalue.
        """
        letters = {term.matrix for term in self.file.term}
        return Structure(
            (COMPONENT,),
            [0, self.n],
            M=self._sum("M", values),
            K=self._sum("K", values),
            C=self._sum("C", values) if "C" in letters else None,
            G=self._sum("G", values) if "G" in letters else None,
        )

    def _sum(self, letter: str, values: Values) -> np.ndarray:
        """Sum (m or 1, n, n) of the terms of M, K, C or G, checked."""
        if letter in self._constant:
            return self._constant[letter]
        numbers = [i for i, term in enumerate(self.file.term) if term.matrix == letter]
        coefficients = (self.file.term[i].coefficient for i in numbers)
        names = tuple(dict.fromkeys(n for c in coefficients for n in names_in(c)))
        total = np.zeros((1, self.n, self.n))
        for i in numbers:
            keys: KeyPath = ("term", i, "coefficient")
            weight = np.atleast_1d(value_of(self.file.term[i].coefficient, values, keys))
            total = total + weight[:, None, None] * self._matrices[i]
        if letter in "MK" and (fault := _fault(letter, total)):
            k, text, expected = fault
            value_texts = (
                f"{n} = {np.ravel(values[n])[min(k, np.size(values[n]) - 1)]:g}" for n in names
            )
            at_values = f" at {', '.join(value_texts)}" if names else ""
            raise PlacedError(("term", numbers[0]), f"{text}{at_values}: expected {expected}")
        if not names:
            self._constant[letter] = total
        return total

    def elongation(self, kind: str, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n) of the motion that a spring or damper resists."""
        return self._row(getattr(self.file, kind)[i].along, values, (kind, i, "along"))

    def contact_rows(self, i: int, values: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """N, T and T_perp (m or 1, n) of a contact; zeros without friction."""
        table, keys = self.file.contact[i], ("contact", i)
        still = np.zeros((1, self.n))
        opening = self._row(table.normal, values, (*keys, "normal"))
        if table.sliding is None:
            return opening, still, still
        slid = self._row(table.sliding, values, (*keys, "sliding"))
        across = still
        if table.across is not None:
            across = self._row(table.across, values, (*keys, "across"))
        for key, row, others in (
            ("sliding", slid, (opening,)),
            ("across", across, (opening, slid)),
        ):
            if any(_parallel(row, other) for other in others):
                text = "expected another motion than that of its normal"
                raise PlacedError((*keys, key), text + (" and sliding" if key == "across" else ""))
        return opening, -slid, -across

    def load_row(self, i: int, values: Values) -> np.ndarray:
        """Row (m or 1, n) of the motion along which a load does work."""
        return self._row(self.file.load[i].along, values, ("load", i, "along"))

    def _row(self, motion: Motion, values: Values, keys: KeyPath) -> np.ndarray:
        """Row (m, n) that observes a motion, a sum of coordinates times factors."""
        columns = []
        for name, factor in motion:
            column = np.zeros(self.n)
            column[self.place(name, keys)] = 1.0
            columns.append(np.atleast_1d(value_of(factor, values, keys))[:, None] * column)
        row: np.ndarray = sum(columns[1:], columns[0])
        if not np.abs(row).max(axis=1).min() > 0.0:
            raise PlacedError(keys, "expected a motion, got factors that are all zero")
        return row

    def place(self, name: str, keys: KeyPath) -> int:
        """Number from 0 of a coordinate; PlacedError where there is none of that name."""
        if name not in self.numbers:
            text = f"there is no coordinate '{name}', expected a number from 1 to {self.n}"
            names = self.names if not self.names[0].isdigit() else ()
            if names:
                listed = ", ".join(names[:MOST_NAMED])
                text += f", or one of {listed}" + (", ..." if len(names) > MOST_NAMED else "")
            raise PlacedError(keys, text, name, names)
        return self.numbers[name]


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether motions (m or 1, n) are the same anywhere, but for a factor."""
    products = (a * b).sum(axis=1) ** 2
    squares = (a * a).sum(axis=1) * (b * b).sum(axis=1)
    return bool(((squares > 0.0) & (products >= squares * (1.0 - 1e-12))).any())


def _fault(letter: str, A: np.ndarray) -> tuple[int, str, str] | None:
    """Where M (m or 1, n, n) is not positive definite, or K negative, and what was expected."""
    diagonal = np.diagonal(A, axis1=1, axis2=2)
    faults = np.argwhere(diagonal <= 0.0)
    if letter == "M" and len(faults):
        k, row = faults[0]
        text = f"M has {diagonal[k, row]:g} on its diagonal in row {row + 1}"
        return int(k), text, "a mass above 0 of every coordinate"
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    smallest_eigenvalues = np.linalg.eigvalsh(scale[:, :, None] * A * scale[:, None, :])[:, 0]
    if letter == "M" and not (smallest_eigenvalues > LEAST_MASS_ROOT).all():
        return (
            int(smallest_eigenvalues.argmin()),
            "M is not positive definite",
            "energy of every motion above 0",
        )
    if letter == "K" and not (smallest_eigenvalues >= LEAST_ROOT).all():
        text = "K has a negative eigenvalue"
        return (
            int(smallest_eigenvalues.argmin()),
            text,
            "a stiffness whose energy is nowhere negative",
        )
    return None
