"""Design points of a model: their values, structures and bases."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

from squealstudy.errors import ModelError
from squealstudy.mechanics.basis import Basis, checked_band
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.structures import Structures
from squealstudy.mechanics.unreduced import Unreduced
from squealstudy.mechanics.values import Values
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint


@dataclass(frozen=True, eq=False)
class Design:
    """A model at one design point, or at a batch of m of them (`system.System`).

    Attributes
    ----------
    values : Values
        Values of all parameters.
    nominal : ModelPoint
        The model with none of its parameters varied: bases are made at this point.
    basis : Basis
        Band of the modes and basis of the reduction.
    chosen : bool
        Whether the user has chosen the basis. Otherwise the basis is enriched where its error
        exceeds the tolerance of modes, and runs in time and limit cycles use that of their studies.
    family : MatrixFamily or None
        The matrices, where the model is a family of matrices.
    """

    values: Values
    nominal: ModelPoint
    basis: Basis
    chosen: bool = False
    family: MatrixFamily | None = None
    _known: dict[Any, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        count = "one design point" if self.single else f"{len(self)} design points"
        return f"<{type(self).__name__}: {count} of {self.values.definition.name!r}>"

    # -- design points ---------------------------------------------------------------------------
    @property
    def single(self) -> bool:
        """Whether this is one design point and no batch."""
        return self.values.length is None

    def __len__(self) -> int:
        if self.values.length is None:
            raise TypeError("one design point has no length: values that are arrays make a batch")
        return self.values.length

    def __getitem__(self, number: int) -> Self:
        if not -len(self) <= number < len(self):
            raise IndexError(f"{number} of {len(self)} design points")
        return replace(self, values=self.values.at(number % len(self)), _known={})

    def __iter__(self) -> Iterator[Self]:
        return (self[number] for number in range(len(self)))

    @property
    def point(self) -> ModelPoint:
        """The design point: its model, options, values, design state; ModelError for a batch."""
        self._expect_single("point")
        return self.values.point(0)

    def _expect_single(self, attribute: str) -> None:
        if not self.single:
            raise ModelError(f"{attribute} is of one design point: system[i].{attribute}")

    # -- structure -------------------------------------------------------------------------------
    @cached_property
    def assembly(self) -> Unreduced:
        """Unreduced sparse matrices, contact points and loads.

        Raises
        ------
        ModelError
            For a batch or a family of matrices, or where the geometry cannot be built.
        """
        self._expect_single("assembly")
        self._expect_contact()
        return Unreduced(self.point.assembly(), self.point.operating_point())

    def reduced(self, band: tuple[float, float] | None = None, **changes: Any) -> Reduction:
        """Component modes, contact space, basis and matrices of the structure.

        Parameters
        ----------
        band : (low, high) or None
            Lowest and highest frequency of the band, Hz; None: that of the system.
        **changes
            Fields of `Basis` with other values, such as ``component_cutoff_factor=2.0``.

        Raises
        ------
        ModelError
            Where design points have several structures, or for a family of matrices.
        ConvergenceError
            Where there is no steady sliding, neither at the nominal operating point nor at design
            points (`Structures.reduction`).
        """
        basis = self._basis(band)
        structures = self._structures(replace(basis, **changes) if changes else basis)
        own_structures = list(self.values.of_structures())
        if len(own_structures) > 1:
            raise ModelError(
                f"{len(own_structures)} structures: system[i].reduced() is that of a point"
            )
        return structures.reduction(*own_structures[0])

    def _basis(self, band: tuple[float, float] | None = None) -> Basis:
        return self.basis if band is None else replace(self.basis, band_hz=checked_band(band))

    def _structures(self, basis: Basis) -> Structures:
        key = Structures, basis.identity
        if key not in self._known:
            improved = not self.chosen
            self._known[key] = Structures(self.values, self.nominal, basis, improved)
        structures: Structures = self._known[key]
        return structures

    def _expect_contact(self) -> None:
        if self.family is not None:
            raise ModelError("a family of matrices has neither contact nor components")
