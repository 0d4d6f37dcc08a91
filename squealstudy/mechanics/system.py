"""One design point of a model, or a batch of them: every step of the mechanics, when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.mechanics.basis import Basis, checked_band
from squealstudy.mechanics.defaults import MODE_TOLERANCE
from squealstudy.mechanics.linear import LinearSystem
from squealstudy.mechanics.modes import ComplexModes
from squealstudy.mechanics.pairs import PointPairs
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.solving import each, linearised, sliding
from squealstudy.mechanics.stacked_rows import messages, stacked, statuses
from squealstudy.mechanics.steady import SteadySliding
from squealstudy.mechanics.structures import Structures
from squealstudy.mechanics.unreduced import Unreduced
from squealstudy.mechanics.values import Values
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.judged_roots import worst_errors

INACCURATE = "inaccurate"


@dataclass(frozen=True, eq=False)
class System:
    """A model at one design point, or at a batch of m of them.

    What a single point gives has no leading axis, and a failure is an exception; in a batch it is
    the status of its row. ``system[i]`` is one design point of a batch, ``len`` their number.

    Attributes
    ----------
    values : Values
        Of all parameters.
    nominal : ModelPoint
        The model as it is, nothing varied: bases are made there.
    basis : Basis
        Band of the modes and basis of the reduction.
    chosen : bool
        The basis is one of the user's own; otherwise it is enriched where its error is beyond the
        tolerance of modes, and steps in time have the one of studies in time.
    family : MatrixFamily or None
        Of a family of matrices.

    Examples
    --------
    >>> import squealstudy as sq
    >>> system = sq.model("hulten").at(friction=[0.1, 0.5])
    >>> len(system), [int(point.modes().unstable.sum()) for point in system]
    (2, [0, 1])
    """

    values: Values
    nominal: ModelPoint
    basis: Basis
    chosen: bool = False
    family: MatrixFamily | None = None
    _known: dict[Any, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        count = "one design point" if self.single else f"{len(self)} design points"
        return f"<System: {count} of {self.values.definition.name!r}>"

    # -- design points ---------------------------------------------------------------------------
    @property
    def single(self) -> bool:
        """Whether it is one design point and no batch."""
        return self.values.length is None

    def __len__(self) -> int:
        if self.values.length is None:
            raise TypeError("one design point has no length: values that are arrays make a batch")
        return self.values.length

    def __getitem__(self, number: int) -> System:
        if not -len(self) <= number < len(self):
            raise IndexError(f"{number} of {len(self)} design points")
        return replace(self, values=self.values.at(number % len(self)), _known={})

    def __iter__(self) -> Iterator[System]:
        return (self[number] for number in range(len(self)))

    @property
    def point(self) -> ModelPoint:
        """The design point: its model, options, values, design state; ModelError of a batch."""
        self._expect_single("point")
        return self.values.point(0)

    def _expect_single(self, what: str) -> None:
        if not self.single:
            raise ModelError(f"{what} is of one design point: system[i].{what}")

    # -- structure -------------------------------------------------------------------------------
    @cached_property
    def assembly(self) -> Unreduced:
        """Unreduced sparse matrices, contact points and loads.

        Raises
        ------
        ModelError
            A batch; a family of matrices; a geometry that cannot be built.
        """
        self._expect_single("assembly")
        self._expect_contact()
        return Unreduced(self.point.assembly(), self.point.operating_point())

    def reduced(self, band: tuple[float, float] | None = None, **changes: Any) -> Reduction:
        """Component modes, contact space, basis and matrices of the structure.

        Parameters
        ----------
        band : (low, high) or None
            Hz; that of the system by default.
        **changes
            Fields of `Basis` that are to be others: ``component_cutoff_factor=2.0``.

        Raises
        ------
        ModelError
            Design points of several structures; a family of matrices.
        ConvergenceError
            No steady sliding at the nominal operating point.
        """
        basis = self._basis(band)
        structures = self._structures(replace(basis, **changes) if changes else basis)
        found = list(self.values.of_structures())
        if len(found) > 1:
            raise ModelError(f"{len(found)} structures: system[i].reduced() is that of a point")
        return structures.reduction(*found[0])

    def _basis(self, band: tuple[float, float] | None = None) -> Basis:
        return self.basis if band is None else replace(self.basis, band_hz=checked_band(band))

    def _structures(self, basis: Basis) -> Structures:
        key = Structures, basis.identity
        if key not in self._known:
            improved = not self.chosen
            self._known[key] = Structures(self.values, self.nominal, basis, improved)
        found: Structures = self._known[key]
        return found

    def _expect_contact(self) -> None:
        if self.family is not None:
            raise ModelError("a family of matrices has neither contact nor components")

    # -- steady sliding and the system about it ----------------------------------------------------
    @cached_property
    def steady(self) -> SteadySliding:
        """Steady sliding: gaps, pressures, forces (THEORY.md eq. (13)).

        Raises
        ------
        ConvergenceError
            One design point without it; in a batch this is its row's status.
        ModelError
            A family of matrices.
        """
        self._expect_contact()

        def solve(point: ModelPoint, reduction: Reduction) -> Any:
            found = sliding(point, reduction)
            return found, found.forces(reduction.space, point.operating_point())

        found = each(self._structures(self._basis()), solve, self.single)
        take = partial(stacked, found, single=self.single)
        status, message = self._told(found)
        return SteadySliding(
            gap=take(lambda x: x[0].gap),
            pressure=take(lambda x: x[0].contact_pressure),
            tangent=take(lambda x: x[0].tangent),
            force=take(lambda x: x[1]),
            residual=self._number(take(lambda x: x[0].residual), float),
            open_share=self._number(take(lambda x: x[0].open_share), float),
            iterations=self._number(take(lambda x: x[0].iterations), int),
            status=status,
            message=message,
        )

    @cached_property
    def linear(self) -> LinearSystem:
        """Mass, damping and stiffness of the system linearised about steady sliding.

        Raises
        ------
        ConvergenceError
            One design point without steady sliding, or a coefficient of a family without a value.
        SquealstudyError
            A batch of structures of different sizes.
        """
        if self.family is not None:
            return self._linear_family(self.family)
        found = each(self._structures(self._basis()), linearised, self.single)
        take = partial(stacked, found, single=self.single)
        C = take(lambda x: x[1].C)
        weights = tuple(None if isinstance(x, Exception) else x[1].weights for x in found)
        status, message = self._told(found)
        return LinearSystem(
            M=np.broadcast_to(np.eye(C.shape[-1]), C.shape),
            C=C,
            K=take(lambda x: x[1].K),
            K_sym=take(lambda x: x[1].K_sym),
            weights=weights[0] if self.single else weights,
            status=status,
            message=message,
        )

    def _linear_family(self, family: MatrixFamily) -> LinearSystem:
        from squealstudy.mechanics.family import matrices_of

        found = matrices_of(family, self.values, self.single)
        M, C, K = (stacked(found, lambda x, k=k: x[k], self.single) for k in range(3))  # type: ignore[misc]
        status, message = self._told(found)
        K_sym = 0.5 * (K + np.swapaxes(K, -1, -2))
        return LinearSystem(M, C, K, K_sym, None, status, message)

    # -- complex modes ---------------------------------------------------------------------------
    def modes(self, band: tuple[float, float] | None = None) -> ComplexModes:
        """Complex modes in a band, with left and right vectors, errors and energies.

        Parameters
        ----------
        band : (low, high) or None
            Hz; by default that of study files. Of a meshed model the basis is made for it.

        Raises
        ------
        ParameterError
            ``band`` where it is none.
        ConvergenceError
            One design point without steady sliding; in a batch this is its row's status.
        """
        basis = self._basis(band)
        if basis.band_hz not in self._known:
            self._known[basis.band_hz] = self._modes(basis)
        found: ComplexModes = self._known[basis.band_hz]
        return found

    def _modes(self, basis: Basis) -> ComplexModes:
        definition, single = self.values.definition, self.single
        if self.family is None:
            structures = self._structures(basis)
            found = each(structures, structures.pairs, single)
        else:
            from squealstudy.mechanics.family import pairs_of

            found = pairs_of(self.family, self.values, basis.band_hz, single)
        take = partial(stacked, found, single=single, ragged=True)
        status, message = self._judged(found)
        counts = np.array([0 if isinstance(x, Exception) else len(x.lam) for x in found])
        solved = next((x for x in found if not isinstance(x, Exception)), None)
        return ComplexModes(
            lam=take(lambda x: x.lam),
            right=take(lambda x: x.right),
            residual=take(lambda x: x.residual),
            error_rung=take(lambda x: x.error_rung),
            error_reduction=take(lambda x: x.error_reduction),
            energies=take(lambda x: x.energies),
            counts=int(counts[0]) if single else counts,
            status=status,
            message=message,
            parts=definition.energy_parts if self.family is None else (),
            method="" if solved is None else solved.method,
            varied=self.values.varied,
            systems=self._linear_systems(basis),
        )

    def _linear_systems(self, basis: Basis) -> Sequence[Callable[[], LinearSystem]]:
        """The linearised system of each design point in a basis, made when asked for."""
        return _Linear(replace(self, basis=basis, _known={}))

    def _judged(self, found: Sequence[PointPairs | Exception]) -> tuple[Any, Any]:
        """Status and message, those of inaccurate points among them."""
        status, message = statuses(found), messages(found)
        for number, one in enumerate(found):
            if isinstance(one, Exception) or not len(one.lam):
                continue
            point = np.zeros(len(one.lam), dtype=int)
            worst = float(worst_errors(one.lam, one.error_rung, point, 1)[0][0])
            if worst > MODE_TOLERANCE:
                status[number] = INACCURATE
                message[number] = f"a mode may be wrong by {worst:.1e} of its frequency"
        return (status[0], message[0]) if self.single else (status, message)

    def _told(self, found: Sequence[object]) -> tuple[Any, Any]:
        status, message = statuses(found), messages(found)
        return (status[0], message[0]) if self.single else (status, message)

    def _number(self, found: np.ndarray, kind: type) -> Any:
        return kind(found) if self.single else found


class _Linear(Sequence[Callable[[], LinearSystem]]):
    """Linearised systems of design points, each by a call."""

    def __init__(self, system: System) -> None:
        self._system = system

    def __len__(self) -> int:
        return self._system.values.count

    def __getitem__(self, number: Any) -> Any:
        own = self._system if self._system.single else self._system[number]
        return lambda: own.linear
