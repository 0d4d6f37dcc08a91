"""Derivatives of complex modes by parameters, with finite changes beside them, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.linalg.overflow import MAX_SQUARABLE_ENTRY
from squealstudy.mechanics.basis import Basis
from squealstudy.mechanics.batch import is_small_batch
from squealstudy.mechanics.defaults import STABILITY_TOLERANCE
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.sensitivity_batch import Request, batch_sensitivities
from squealstudy.mechanics.sensitivity_parameters import (
    default_names,
    design_structure,
    requested,
    state_parameters,
    structural_names,
)
from squealstudy.mechanics.solving import each
from squealstudy.mechanics.structures import Structures
from squealstudy.mechanics.values import Values
from squealstudy.models.model_point import ModelPoint
from squealstudy.modes.sensitivity.mode_sensitivities import (
    ModeSensitivities,
    figure_slopes,
    with_more,
)
from squealstudy.modes.sensitivity.reduced import ModeChoice, point_sensitivities, solve_families
from squealstudy.modes.sensitivity.structural import check_structural, structural_sensitivities
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.stacked.sensitivities import StackedSensitivities
from squealstudy.system.linearise import component_frequencies

if TYPE_CHECKING:
    import pandas as pd

UNSTABLE = "unstable"


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """d lam / dp of chosen modes of a design point by parameters (THEORY.md eq. (57)).

    Attributes
    ----------
    lam : ndarray (k,) complex
        Roots of the k modes, rad/s, by falling growth rate.
    names : tuple of str
        Names of the p parameters; component modes asked for with [*] are listed one by one.
    derivative : ndarray (k, p) complex
        Total derivative, 1/s per unit of the parameter: the working point moves with it.
    change : ndarray (k, p)
        Finite change of each parameter, in the parameter's unit.
    finite : ndarray (k, p) complex
        Change of the root by that change, from solving again, 1/s; NaN where that gives no root.
    match : ndarray (k, p)
        Share in which the mode of that root is still this mode: 1 is the mode itself.
    validity : ndarray (k, p)
        Change, in the parameter's unit, at which the second-order term reaches a quarter of the
        first-order one; near a square-root coalescence the distance to it.
    condition : ndarray (k,)
        Condition number of each root, without unit; from 100 on its derivatives mean nothing.
    near_coalescence : ndarray (k, p) of bool
        Whether the derivative means nothing: `condition` from 100 on, `validity` below `change`.
    status, message : str
        ``ok``, or in a batch why there are no derivatives.

    Examples
    --------
    >>> import squealstudy as sq
    >>> found = sq.model("hulten").at(friction=0.5).sensitivities("friction")
    >>> found.names, found.derivative.shape, bool(abs(found.derivative * found.change
    ...     - found.finite).max() < 0.02 * abs(found.finite).max())
    (('friction',), (1, 1), True)
    """

    lam: np.ndarray
    names: tuple[str, ...]
    derivative: np.ndarray
    change: np.ndarray
    finite: np.ndarray
    match: np.ndarray
    validity: np.ndarray
    condition: np.ndarray
    near_coalescence: np.ndarray
    status: str = "ok"
    message: str = ""

    @classmethod
    def _of_modes(cls, modes: Sequence[ModeSensitivities]) -> Sensitivities:
        """The arrays of given modes."""
        names = tuple(s.step.name for s in modes[0].sensitivities) if modes else ()
        shape = (len(modes), len(names))

        def table(take: Any, kind: type = float) -> np.ndarray:
            rows = [[take(mode, s) for s in mode.sensitivities] for mode in modes]
            return np.array(rows, dtype=kind).reshape(shape)

        return cls(
            lam=np.array([mode.lam for mode in modes], dtype=complex),
            names=names,
            derivative=table(lambda _, s: s.derivative, complex),
            change=table(lambda _, s: s.step.size),
            finite=table(lambda _, s: np.nan if s.finite is None else s.finite.change, complex),
            match=table(lambda _, s: np.nan if s.finite is None else s.finite.match),
            validity=table(lambda _, s: s.validity),
            condition=np.array([mode.family.condition for mode in modes]),
            near_coalescence=table(lambda mode, s: mode.near_coalescence(s), bool),
        )

    @classmethod
    def _of_batch(cls, sensitivities: StackedSensitivities, row: int) -> Sensitivities:
        """The arrays of one design point of a batch that is solved at once."""
        start, end = np.searchsorted(sensitivities.owner, [row, row + 1])
        names = sensitivities.names if end > start else ()
        block = slice(start, end), slice(0, len(names))
        status, message = sensitivities.system.failures.get(row, ("ok", ""))
        return cls(
            lam=sensitivities.lam[block[0]],
            names=names,
            derivative=sensitivities.derivative[block],
            change=sensitivities.change[block],
            finite=sensitivities.finite[block],
            match=sensitivities.match[block],
            validity=sensitivities.validity[block],
            condition=sensitivities.condition[block[0]],
            near_coalescence=sensitivities.near_coalescence[block],
            status=status,
            message=message,
        )

    @property
    def d_growth_rate(self) -> np.ndarray:
        """Derivative (k, p) of the growth rate, 1/s per unit."""
        return self._figures(0)

    @property
    def d_frequency_hz(self) -> np.ndarray:
        """Derivative (k, p) of the frequency abs(lam) / 2 pi, Hz per unit."""
        return self._figures(1)

    @property
    def d_damping_ratio(self) -> np.ndarray:
        """Derivative (k, p) of the damping ratio, 1 per unit."""
        return self._figures(2)

    def _figures(self, number: int) -> np.ndarray:
        slopes: np.ndarray = figure_slopes(self.lam[:, None], self.derivative)[number]
        return slopes

    def to_pandas(self) -> pd.DataFrame:
        """A row for each mode and parameter: ``mode`` from 1, root, derivatives, finite change."""
        import pandas as pd

        k, p = self.derivative.shape
        return pd.DataFrame(
            {
                "mode": np.repeat(np.arange(1, k + 1), p),
                "frequency_hz": np.repeat(np.abs(self.lam) / (2 * np.pi), p),
                "growth_rate": np.repeat(self.lam.real, p),
                "parameter": list(self.names) * k,
                "d_growth_rate": self.d_growth_rate.ravel(),
                "d_frequency_hz": self.d_frequency_hz.ravel(),
                "d_damping_ratio": self.d_damping_ratio.ravel(),
                "change": self.change.ravel(),
                "predicted_growth_change": (self.derivative * self.change).real.ravel(),
                "finite_growth_change": self.finite.real.ravel(),
                "match": self.match.ravel(),
                "validity_range": self.validity.ravel(),
                "near_coalescence": self.near_coalescence.ravel(),
            }
        )


def mode_choice(modes: str | int | Sequence[float]) -> ModeChoice:
    """Read a choice of modes.

    Parameters
    ----------
    modes : str, int or sequence of float
        ``"unstable"``; how many modes, by falling growth rate; or frequencies [Hz], for the modes
        nearest to them.

    Raises
    ------
    ParameterError
        Where it is none of these.
    """
    if isinstance(modes, str):
        if modes == UNSTABLE:
            return ModeChoice(stability_tolerance=STABILITY_TOLERANCE)
    elif isinstance(modes, int | np.integer):
        if modes >= 1 and not isinstance(modes, bool):
            return ModeChoice(count=int(modes), stability_tolerance=STABILITY_TOLERANCE)
    else:
        hz = tuple(float(f) for f in modes)
        if hz and min(hz) > 0:
            return ModeChoice(frequencies_hz=hz, stability_tolerance=STABILITY_TOLERANCE)
    text = f'expected "{UNSTABLE}", a number of modes, or frequencies in Hz, got {modes!r}'
    raise ParameterError("modes", text)


def point_derivatives(
    point: ModelPoint,
    reduction: Reduction,
    basis: Basis,
    names: Sequence[str],
    choice: ModeChoice,
    change: float,
) -> Sensitivities:
    """Sensitivities of a design point by the parameters `names`; no names: `default_names`.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding, or modes are not found.
    ParameterError
        Where a name is unknown, or has no derivative here.
    """
    requested_parameters = [requested(name, point) for name in names or default_names(point)]
    prepared = reduction.prepared
    solved = solve_families(prepared, point.state(), basis.band_hz, choice)
    parameters = state_parameters(requested_parameters, component_frequencies(prepared.model))
    mode_list: Sequence[ModeSensitivities] = point_sensitivities(
        solved, parameters, change, basis.band_hz[1]
    )
    if structural := structural_names(requested_parameters):
        builder = design_structure(point, reduction.settings)
        check_structural(builder, structural)
        more = structural_sensitivities(solved, builder, structural, change)
        mode_list = [with_more(m, s) for m, s in zip(mode_list, more, strict=True)]
    return Sensitivities._of_modes(mode_list)


def all_sensitivities(
    structures: Structures, names: Sequence[str], choice: ModeChoice, change: float, single: bool
) -> tuple[Sensitivities, ...]:
    """Sensitivities of all design points of structures; a batch of a small model is solved at once.

    Raises
    ------
    One of FAILURES
        Where a `single` point fails.
    """
    values, basis = structures.values, structures.basis  # noqa: PD011 - no frame
    find = partial(point_derivatives, basis=basis, names=names, choice=choice, change=change)
    if not is_small_batch(values):
        return tuple(map(_or_raise, each(structures, find, single)))
    batch = _at_once(values, names, choice, change, basis.band_hz)
    for number in [i for i, point_batch in enumerate(batch) if point_batch is None]:
        alone = Structures(values.at(number), structures.nominal, basis, structures.improved)
        batch[number] = _or_raise(each(alone, find, single=False)[0])
    return tuple(point_batch for point_batch in batch if point_batch is not None)


def _or_raise(sensitivities: Sensitivities | Exception) -> Sensitivities:
    if not isinstance(sensitivities, Exception):
        return sensitivities
    status, message = reason(sensitivities)
    return replace(Sensitivities._of_modes(()), status=status, message=message)


def _at_once(
    values: Values,
    names: Sequence[str],
    choice: ModeChoice,
    change: float,
    band_hz: tuple[float, float],
) -> list[Sensitivities | None]:
    """Sensitivities of a batch of a small model; None for each point to be solved by itself."""
    first, none = values.point(0), list[Sensitivities | None]([None]) * values.count
    try:
        requested_parameters = [requested(name, first) for name in names or default_names(first)]
        if any(
            np.abs(x).max() > MAX_SQUARABLE_ENTRY for k, x in values.varied.items() if k in names
        ):
            return none
        if structural := structural_names(requested_parameters):
            settings = ReductionSettings(np.inf, np.inf, 0.0)
            check_structural(design_structure(first, settings), structural)
        of_points, batch_request = (
            list(none),
            Request(requested_parameters, choice, change, band_hz),
        )
        columns, count = values.columns, values.count
        parts = batch_sensitivities(
            values.definition, values.options, columns, count, batch_request
        )
        for rows, batch_part in parts:
            for row, number in enumerate(rows.tolist()):
                of_points[number] = (
                    None if batch_part.left[row] else Sensitivities._of_batch(batch_part, row)
                )
    except FAILURES:  # which points solved by themselves report
        return none
    return of_points
