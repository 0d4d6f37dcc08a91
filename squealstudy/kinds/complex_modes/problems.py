"""The structures of a study as problems for rungs; a worker keeps the last ones.

`ParameterBox` maps their design points to coordinates theta in [-1, 1]^d, of which modes are smooth
functions.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from squealstudy.engine.cache import (
    is_whole,
    known_gap,
    load_value,
    prepared_any,
    prepared_path,
    save_value,
)
from squealstudy.engine.design_points import DesignPoints
from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.plan import Plan
from squealstudy.errors import ConvergenceError
from squealstudy.files import OF_JSON, read_whole, sealed, unsealed, write_text
from squealstudy.kinds.complex_modes.full_order_check import solve_unreduced
from squealstudy.models.operating import DesignState
from squealstudy.models.parameter_names import FREQUENCY_SCALE
from squealstudy.modes.full_order.modes import solve_family_point
from squealstudy.modes.point import PointModes, solve_point
from squealstudy.modes.problem import Problem
from squealstudy.modes.reanalysis.brake_problem import BrakeProblem
from squealstudy.modes.reanalysis.family_problem import FamilyProblem
from squealstudy.modes.reanalysis.sweep_basis import Report, SweepBasis, build_sweep_basis
from squealstudy.modes.rung import Rung
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import PreparedFamily, PreparedModel
from squealstudy.study.design import DesignPoint

MAX_PROBLEMS = 2  # most problems that a process stores, each with its basis
BASIS_TOLERANCE_SHARE = 1 / 3  # share of the study's tolerance that the basis may err by
INTERPOLATION_SHARE = 0.1  # largest error of interpolated modal damping, over the tolerance
# a looser tolerance drops more vectors at each training point, and then needs more of these points:
# at 1e-2 training takes four times as long as at 1e-4, and ends with as many vectors
MAX_BASIS_TOLERANCE = 1e-4


@dataclass(frozen=True)
class SweptStructure:
    """A structure of a study with the box of all its design points.

    Attributes
    ----------
    key : str
        Key of the prepared model in the cache.
    chart : ParameterBox
        Box of all its design points, with coordinates.
    band_hz : (low, high)
        Frequency band of the study, Hz.
    tolerance : float
        Relative error that the study allows for its modes.
    settings : ReductionSettings
        Settings of the reduction.
    """

    key: str
    chart: ParameterBox
    band_hz: tuple[float, float]
    tolerance: float
    settings: ReductionSettings

    @cached_property
    def path(self) -> Path:
        """Folder of the sweep basis in the cache."""
        chart, law = self.chart.identity(), self.chart.design.law_identity
        code = [source_hash(), source_hash(("kinds/complex_modes",))]
        content = [code, chart, law, self.band_hz, self.tolerance]
        return prepared_path(self.key) / "sweep_bases" / content_hash(content)

    @property
    def has_basis(self) -> bool:
        """Whether the cache holds the sweep basis."""
        return is_whole(self.path)

    def basis(self) -> SweepBasis:
        """The sweep basis, from the cache."""
        basis: SweepBasis = load_value(self.path)
        return basis

    @property
    def _refusal(self) -> Path:
        return self.path.with_suffix(".reason")

    @property
    def refusal(self) -> str:
        """Why an earlier run could not make a basis over this box; empty where none failed."""
        with contextlib.suppress(OSError, ValueError):  # not there, or damaged
            return str(unsealed(read_whole(self._refusal, OF_JSON))["reason"])
        return ""

    def refuse(self, reason: str) -> None:
        """Write down why no basis can be made, for later runs."""
        write_text(self._refusal, sealed({"reason": reason}))


def swept_structures(plan: Plan) -> list[SweptStructure]:
    """The structures of a plan in the order of their first use, each with the box of its points."""
    names = [s.name for s in plan.study.sweeps if not s.parameter.structural]
    return [
        SweptStructure(
            key=key,
            chart=chart_of(plan.tasks.at(rows), names),
            band_hz=plan.band_hz,
            tolerance=plan.method.tolerance,
            settings=plan.settings,
        )
        for key, rows in plan.tasks.of_structures()
    ]


def problem_of(structure: SweptStructure, rung: Rung) -> Problem:
    """The problem of a structure as a rung needs it, kept for the next call in this process."""
    key = f"{structure.path} {rung.over_a_basis}"
    if key not in _problems_by_key:
        while len(_problems_by_key) >= MAX_PROBLEMS:
            _problems_by_key.pop(next(iter(_problems_by_key)))
        prepared = prepared_any(structure.key)
        if isinstance(prepared, PreparedFamily):
            _problems_by_key[key] = _family_problem(structure, prepared)
        else:
            _problems_by_key[key] = _brake_problem(structure, prepared, not rung.over_a_basis)
    return _problems_by_key[key]


_problems_by_key: dict[str, Problem] = {}


def _family_problem(structure: SweptStructure, prepared: PreparedFamily) -> Problem:
    """The problem of a family of matrices, for rungs."""
    chart, band_hz = structure.chart, structure.band_hz

    def values_at(theta: np.ndarray) -> dict[str, float]:
        return chart.design_at(theta).plain_values()

    def solve(design: DesignPoint) -> PointModes:
        return solve_family_point(prepared, design.plain_values(), band_hz)

    return Problem(
        prepared=prepared,
        swept=FamilyProblem(
            family=prepared.model,
            dimension=chart.dimension,
            values_at=values_at,
            band_hz=band_hz,
            first=prepared.n_roots,
        ),
        chart=chart,
        tolerance=structure.tolerance,
        exact=solve,
        full_order=solve,
        load_basis=structure.basis,
    )


def _brake_problem(
    structure: SweptStructure, prepared: PreparedModel, exact_damping: bool
) -> Problem:
    """The problem of a reduced brake, for rungs."""
    chart, band_hz = structure.chart, structure.band_hz

    def state_at(theta: np.ndarray) -> DesignState:
        return chart.design_at(theta).state()

    def solve(design: DesignPoint) -> PointModes:
        return solve_point(prepared, design.state(), band_hz, known_gap(structure.key, design))

    return Problem(
        prepared=prepared,
        swept=BrakeProblem(
            prepared=prepared,
            dimension=chart.dimension,
            state_at=state_at,
            band_hz=band_hz,
            exact_damping=exact_damping,
        ),
        chart=chart,
        tolerance=structure.tolerance,
        exact=solve,
        full_order=lambda design: solve_unreduced(prepared, design, structure.settings, band_hz),
        load_basis=structure.basis,
    )


def make_basis(structure: SweptStructure, rung: Rung, report: Report) -> SweepBasis:
    """The sweep basis of a structure from the cache, or made and written there.

    Raises
    ------
    ConvergenceError
        Where none can be made, or where the error of interpolated modal damping is too large.
    """
    if structure.has_basis:
        return structure.basis()
    problem = problem_of(structure, rung).swept
    interpolation_error = problem.interpolation_error()
    if interpolation_error > INTERPOLATION_SHARE * structure.tolerance:
        raise ConvergenceError(
            "not_converged",
            f"interpolated modal damping errs by {interpolation_error:.0e} in damping ratio",
        )
    basis = build_sweep_basis(
        problem,
        BASIS_TOLERANCE_SHARE * min(structure.tolerance, MAX_BASIS_TOLERANCE),
        report=report,
    )
    basis = replace(basis, interpolated=interpolation_error)
    save_value(structure.path, basis)
    return basis


Scaling = tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]
# from a parameter to a coordinate on which the matrices depend linearly, or nearly so, and back:
# friction damping is proportional to 1/speed, modal stiffness to a frequency squared, contact
# stiffness to a power of pressure
SCALINGS: dict[str, Scaling] = {
    "linear": (lambda x: x, lambda t: t),
    "log": (np.log, np.exp),
    "reciprocal": (np.reciprocal, np.reciprocal),
    "square": (np.square, np.sqrt),
}
LOGARITHMIC = ("pressure", "contact.lambda", "contact.p0", "contact.stiffness")


def scaling_of(name: str, smallest: float) -> str:
    """Name of the scaling by which a parameter becomes a coordinate."""
    if name == "sliding_speed":
        return "reciprocal"
    if name.endswith(f".{FREQUENCY_SCALE}"):
        return "square"
    return "log" if name in LOGARITHMIC and smallest > 0 else "linear"


@dataclass(frozen=True)
class ParameterBox:
    """The box of parameters that holds a study's design points of one structure.

    Attributes
    ----------
    design : DesignPoint
        One of the design points, for the values that do not vary.
    names, scalings : tuple of str
        Parameters that vary, and the name of the scaling of each (`SCALINGS`).
    low, high : tuple of float
        Least and largest value of each scaled parameter.
    """

    design: DesignPoint
    names: tuple[str, ...]
    scalings: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @property
    def dimension(self) -> int:
        """Number of parameters that vary."""
        return len(self.names)

    def theta(self, values: np.ndarray) -> np.ndarray:
        """Coordinates (n, d), within [-1, 1], of design points with values (n, d) of `names`."""
        if not self.names:
            return np.zeros((len(values), 0))
        low, high = np.array(self.low), np.array(self.high)
        columns = zip(self.scalings, values.T, strict=True)
        scaled = np.column_stack([SCALINGS[scaling][0](x) for scaling, x in columns])
        inside: np.ndarray = np.clip(2.0 * (scaled - low) / (high - low) - 1.0, -1.0, 1.0)
        return inside

    def design_at(self, theta: np.ndarray) -> DesignPoint:
        """The design point at coordinates theta (d,)."""
        values = dict(self.design.values)
        for j, (name, scaling) in enumerate(zip(self.names, self.scalings, strict=True)):
            coordinate = self.low[j] + (theta[j] + 1.0) / 2.0 * (self.high[j] - self.low[j])
            values[name] = float(SCALINGS[scaling][1](np.array(coordinate)))
        return self.design.with_values(values)

    def identity(self) -> list[object]:
        """What tells this box from others, to be hashed: all values, varied ones by their range."""
        fixed = {k: v for k, v in self.design.values.items() if k not in self.names}
        return [sorted(fixed.items()), self.names, self.scalings, self.low, self.high]


def chart_of(points: DesignPoints, names: Sequence[str]) -> ParameterBox:
    """The box of points of one structure, over those of the `names` that vary among them."""
    varied = [n for n in names if np.ptp(points.column(n)) > 0]
    scalings = [scaling_of(n, float(points.column(n).min())) for n in varied]
    low, high = [], []
    for name, scaling in zip(varied, scalings, strict=True):
        with np.errstate(over="ignore"):  # a design point with such a value fails when it is solved
            x = SCALINGS[scaling][0](points.column(name))
        low.append(float(x.min()))
        high.append(float(x.max()))
    return ParameterBox(
        design=points[0],
        names=tuple(varied),
        scalings=tuple(scalings),
        low=tuple(low),
        high=tuple(high),
    )
