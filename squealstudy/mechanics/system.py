"""One design point of a model, or a batch of them: every step of the mechanics, when asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import itemgetter
from typing import Any

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.mechanics.basis import Basis, checked_band
from squealstudy.mechanics.batch import batch_modes, is_point_mass_batch
from squealstudy.mechanics.defaults import (
    CYCLE_REACH,
    CYCLE_TOLERANCE,
    FINITE_CHANGE,
    MAX_CYCLE_REACH,
    MAX_CYCLE_TOLERANCE,
    MAX_FINITE_CHANGE,
    MAX_HARMONICS,
    MODE_TOLERANCE,
)
from squealstudy.mechanics.design import Design
from squealstudy.mechanics.limit_cycles import LimitCycles, limit_cycles
from squealstudy.mechanics.linear import LinearSystem
from squealstudy.mechanics.modes import ComplexModes, warn_of_empty_band
from squealstudy.mechanics.motions import Runs, simulated
from squealstudy.mechanics.pairs import PointPairs
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.sensitivities import (
    UNSTABLE,
    Sensitivities,
    all_sensitivities,
    mode_choice,
)
from squealstudy.mechanics.sensitivity_parameters import requested
from squealstudy.mechanics.solving import each, linearised, sliding
from squealstudy.mechanics.stacked_rows import may_be_wrong, messages, stacked, statuses
from squealstudy.mechanics.steady import SteadySliding
from squealstudy.mechanics.structures import Structures
from squealstudy.mechanics.values import checked_count, checked_number
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.judged_roots import worst_errors
from squealstudy.modes.point import DENSE
from squealstudy.motion.integrator import Integrator

INACCURATE = "inaccurate"
REGULARISED = "regularised"  # friction below its bound: straight


@dataclass(frozen=True, eq=False, repr=False)
class System(Design):
    """A model at one design point, or at a batch of m of them.

    Arrays of a single point have no leading axis. A single point that fails raises its error; in a
    batch the error becomes the status of the point's row. ``system[i]`` is one design point of a
    batch, ``len`` their number. The fields are those of `design.Design`.

    Examples
    --------
    >>> import squealstudy as sq
    >>> system = sq.model("hulten").at(friction=[0.1, 0.5])
    >>> len(system), [int(point.modes().unstable.sum()) for point in system]
    (2, [0, 1])
    >>> point = sq.model("hulten", damping_ratio=0.01).at(friction=0.5)
    >>> point.sensitivities("friction").d_growth_rate.round(1).tolist()  # 1/s per unit of friction
    [[311.3]]
    >>> point.reduced().n, point.simulate(0.05, step=1e-5).summary()["class"][0]
    (2, 'growing')
    >>> [family.verdict for number, family in point.limit_cycles().families]
    ['squeals', 'no_cycle_found']
    """

    # -- steady sliding and the system about it ----------------------------------------------------
    @cached_property
    def steady(self) -> SteadySliding:
        """Steady sliding: gaps, pressures, forces (THEORY.md eq. (13)).

        Raises
        ------
        ConvergenceError
            Where one design point has none; in a batch this is its row's status.
        ModelError
            For a family of matrices.
        """
        self._expect_contact()

        def solve(point: ModelPoint, reduction: Reduction) -> Any:
            steady = sliding(point, reduction)
            return steady, steady.forces(reduction.space, point.operating_point())

        results = each(self._structures(self._basis()), solve, self.single)
        take = partial(stacked, results, single=self.single)
        status, message = self._told(results)
        return SteadySliding(
            gap=take(lambda x: x[0].gap, nothing_of=(0,)),
            pressure=take(lambda x: x[0].contact_pressure, nothing_of=(0,)),
            tangent=take(lambda x: x[0].tangent, nothing_of=(0,)),
            force=take(lambda x: x[1], nothing_of=(0, 3)),
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
            Where one design point has no steady sliding, or a family's coefficient no value.
        SquealstudyError
            For a batch of structures of different sizes.
        """
        if self.family is not None:
            return self._linear_family(self.family)
        results = each(self._structures(self._basis()), linearised, self.single)
        take = partial(stacked, results, single=self.single)
        C = take(lambda x: x[1].C, nothing_of=(0, 0))
        weights = tuple(None if isinstance(x, Exception) else x[1].weights for x in results)
        status, message = self._told(results)
        return LinearSystem(
            M=np.broadcast_to(np.eye(C.shape[-1]), C.shape),
            C=C,
            K=take(lambda x: x[1].K, nothing_of=(0, 0)),
            K_sym=take(lambda x: x[1].K_sym, nothing_of=(0, 0)),
            weights=weights[0] if self.single else weights,
            status=status,
            message=message,
        )

    def _linear_family(self, family: MatrixFamily) -> LinearSystem:
        from squealstudy.mechanics.family import matrices_of

        results = matrices_of(family, self.values, self.single)
        take = partial(stacked, results, single=self.single, nothing_of=(0, 0))
        M, C, K = (take(itemgetter(k)) for k in range(3))
        status, message = self._told(results)
        K_sym = 0.5 * (K + np.swapaxes(K, -1, -2))
        return LinearSystem(M, C, K, K_sym, None, status, message)

    # -- complex modes ---------------------------------------------------------------------------
    def modes(self, band: tuple[float, float] | None = None) -> ComplexModes:
        """Complex modes in a band, with left and right vectors, errors and energies.

        Parameters
        ----------
        band : (low, high) or None
            Hz; None: all modes of own matrices (up to 100 coordinates, M regular); of others that
            of `basis`, with a UserWarning where it is the default and a point has no mode there.
            The basis of a meshed model is made for this band. A band from 0 Hz begins at 1e-5 of
            its top: slower motion is that of a free body.

        Raises
        ------
        ParameterError
            Where ``band`` is no band.
        ConvergenceError
            Where one design point has no steady sliding; in a batch this is its row's status.
        """
        basis = self._basis(band)
        key = (basis.band_hz, by_default := band is None and not self.chosen)
        if key not in self._known:
            self._known[key] = self._modes(basis, by_default)
            if by_default:
                warn_of_empty_band(self._known[key], basis.band_hz)
        complex_modes: ComplexModes = self._known[key]
        return complex_modes

    def _modes(self, basis: Basis, by_default: bool) -> ComplexModes:
        definition, single = self.values.definition, self.single
        if is_point_mass_batch(self.values):
            return self._batch(basis)
        if self.family is None:
            structures = self._structures(basis)
            results = each(structures, structures.pairs, single)
        else:
            from squealstudy.mechanics.family import pairs_of

            results = pairs_of(self.family, self.values, basis.band_hz, single, by_default)
        take = partial(stacked, results, single=single, ragged=True)
        status, message = self._judged(results)
        counts = np.array([0 if isinstance(x, Exception) else len(x.lam) for x in results])
        solved = next((x for x in results if not isinstance(x, Exception)), None)
        return ComplexModes(
            lam=take(lambda x: x.lam, nothing_of=(0,)),
            right=take(lambda x: x.right, nothing_of=(0, 0)),
            residual=take(lambda x: x.residual, nothing_of=(0,)),
            error_rung=take(lambda x: x.error_rung, nothing_of=(0,)),
            error_reduction=take(lambda x: x.error_reduction, nothing_of=(0,)),
            energies=take(lambda x: x.energies, nothing_of=(len(definition.energy_parts), 0)),
            counts=int(counts[0]) if single else counts,
            status=status,
            message=message,
            parts=definition.energy_parts if self.family is None else (),
            method="" if solved is None else solved.method,
            varied=self.values.varied,
            linear_of=self._linear_of(basis),
        )

    def _batch(self, basis: Basis) -> ComplexModes:
        """Modes of a batch of point masses, all solved at once."""
        batch, definition = batch_modes(self.values, basis.band_hz), self.values.definition
        is_root = ~np.isnan(batch.lam.real)
        status, message = batch.status.copy(), batch.message.copy()
        point = np.nonzero(is_root)[0]
        worst, _ = worst_errors(batch.lam[is_root], batch.error[is_root], point, len(status))
        for number in np.flatnonzero(worst > MODE_TOLERANCE):
            status[number], message[number] = INACCURATE, may_be_wrong(worst[number])
        return ComplexModes(
            lam=batch.lam,
            right=batch.right,
            residual=batch.residual,
            error_rung=batch.error,
            error_reduction=np.where(is_root, 0.0, np.nan),
            energies=batch.energies,
            counts=batch.counts,
            status=status,
            message=message,
            parts=definition.energy_parts,
            method=DENSE if is_root.any() else "",
            varied=self.values.varied,
            linear_of=self._linear_of(basis),
        )

    def sensitivities(
        self,
        *names: str,
        modes: str | int | Sequence[float] = UNSTABLE,
        change: float = FINITE_CHANGE,
        band: tuple[float, float] | None = None,
    ) -> Sensitivities | tuple[Sensitivities, ...]:
        """Derivatives of modes by parameters, each beside a finite change.

        Parameters
        ----------
        *names : str
            Parameters, ``disc.modes[7].frequency_scale``, ``disc.modes[*].damping_ratio``. No
            names: friction, pressure, contact.lambda, sliding speed and all component modes.
        modes : str, int or sequence of float
            ``"unstable"``; how many modes, by falling growth rate; or frequencies [Hz], for the
            modes nearest to them.
        change : float
            Finite change of each parameter, relative to its value; absolute for damping ratios.
        band : (low, high) or None
            Band of the modes, Hz; None: that of `basis`.

        Returns
        -------
        Sensitivities, or for a batch a tuple of them: one for each design point.

        Raises
        ------
        ParameterError
            Where a name is unknown or has no derivative, or ``modes`` is no such choice.
        ConvergenceError
            Where one design point has no steady sliding.
        """
        self._expect_contact()
        basis, choice = self._basis(band), mode_choice(modes)
        change = checked_number("change", change, upper=MAX_FINITE_CHANGE, positive=True)
        for name in names:
            if not isinstance(name, str):
                raise ParameterError("names", f"expected names of parameters, got {name!r}")
            requested(name, self.nominal)
        structures = self._structures(basis)
        results = all_sensitivities(structures, names, choice, change, self.single)
        return results[0] if self.single else results

    # -- in time ---------------------------------------------------------------------------------
    def simulate(
        self,
        duration: float,
        step: float = 1e-6,
        save_every: int = 10,
        method: str | Integrator | None = None,
        perturbation: float = 1e-3,
        regularisation: str = REGULARISED,
        band: tuple[float, float] | None = None,
    ) -> Runs:
        """Run in time from steady sliding, pushed along its unstable modes.

        Friction saturates at 0.2 % of the slowest sliding speed of the batch where no
        ``contact.regularisation_speed`` or ``contact.kt`` is given.

        Parameters
        ----------
        duration, step : float
            Simulated time and time step, s.
        save_every : int
            Steps between rows of histories, 0 for no history; summaries use closer rows.
        method : str, Integrator or None
            An integrator or its name; None: ``exponential``.
        perturbation : float
            Largest velocity at a contact point at the start, m/s.
        regularisation : str
            ``regularised`` or ``smooth``.
        band : (low, high) or None
            Band of the modes that are followed, Hz; None: that of the basis in time.

        Raises
        ------
        ParameterError
            Where settings cannot be used.
        ConvergenceError
            Where one design point has no steady sliding; in a batch this is its row's status.
        """
        self._expect_contact()
        return simulated(
            self._in_time(band),
            checked_number("duration", duration, positive=True),
            checked_number("step", step, positive=True),
            checked_count("save_every", save_every, 0),
            method,
            checked_number("perturbation", perturbation),
            regularisation,
            self.single,
        )

    def limit_cycles(
        self,
        harmonics: int | None = None,
        tolerance: float = CYCLE_TOLERANCE,
        reach: float = CYCLE_REACH,
        regularisation: str = REGULARISED,
        band: tuple[float, float] | None = None,
    ) -> LimitCycles | tuple[LimitCycles, ...]:
        """Limit cycles of all mode families of a band, by harmonic balance.

        Parameters
        ----------
        harmonics : int or None
            Highest harmonic; None: as many as the tolerance of levels needs.
        tolerance : float
            Relative tolerance of the cycles' levels.
        reach : float
            Contact velocity up to which growth is followed, in sliding speeds.
        regularisation : str
            ``regularised`` or ``smooth``.
        band : (low, high) or None
            Band of the modes, Hz; None: that of the basis in time.

        Returns
        -------
        LimitCycles, or for a batch a tuple of them: one for each design point.

        Raises
        ------
        ParameterError
            Where arguments cannot be used.
        ConvergenceError
            Where one design point has no steady sliding, or diverges without oscillation.
        """
        self._expect_contact()
        if harmonics is not None:
            harmonics = checked_count("harmonics", harmonics, 1, MAX_HARMONICS)
        tolerance = checked_number("tolerance", tolerance, upper=MAX_CYCLE_TOLERANCE, positive=True)
        reach = checked_number("reach", reach, upper=MAX_CYCLE_REACH, positive=True)
        structures = self._in_time(band)
        results = limit_cycles(structures, harmonics, tolerance, reach, regularisation, self.single)
        return results[0] if self.single else tuple(results)

    def _in_time(self, band: tuple[float, float] | None) -> Structures:
        """The structures in the basis of studies in time, unless the user has chosen a basis."""
        basis = self.basis if self.chosen else Basis.in_time(self.values.definition)
        if band is not None:
            basis = replace(basis, band_hz=checked_band(band))
        return self._structures(basis)

    def _linear_of(self, basis: Basis) -> Callable[[int], LinearSystem]:
        """Function that gives the linearised system of a design point in a basis."""
        with_basis = replace(self, basis=basis, _known={})
        return lambda number: (with_basis if with_basis.single else with_basis[number]).linear

    def _judged(self, findings: Sequence[PointPairs | Exception]) -> tuple[Any, Any]:
        """Status and message, ``inaccurate`` where a root may be wrong by too much."""
        status, message = statuses(findings), messages(findings)
        for number, finding in enumerate(findings):
            if isinstance(finding, Exception) or not len(finding.lam):
                continue
            point = np.zeros(len(finding.lam), dtype=int)
            worst = float(worst_errors(finding.lam, finding.error_rung, point, 1)[0][0])
            if worst > MODE_TOLERANCE:
                status[number] = INACCURATE
                message[number] = may_be_wrong(worst)
        return (status[0], message[0]) if self.single else (status, message)

    def _told(self, findings: Sequence[object]) -> tuple[Any, Any]:
        status, message = statuses(findings), messages(findings)
        return (status[0], message[0]) if self.single else (status, message)

    def _number(self, numbers: np.ndarray, kind: type) -> Any:
        return kind(numbers) if self.single else numbers
