"""Complex modes of a batch of small models from values of parameters as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from squealstudy.errors import ConvergenceError, ModelError, ParameterError, SquealstudyError
from squealstudy.laws.own_friction import NOT_LINEAR, is_linear
from squealstudy.linalg.overflow import LEAST_MASS, LIMITS, OVERFLOW
from squealstudy.models.assembly import Assembly
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.parameter import ModelDefinition
from squealstudy.models.parameter_names import FREQUENCY_SCALE
from squealstudy.models.stacked_assembly import StackedAssembly
from squealstudy.reduction.free_motions import FREE_MOTION
from squealstudy.reduction.working_point import (
    CONTACT_AT_CORNER,
    PRESSES_OPEN,
    SPRING_AT_CORNER,
    expect_consistent_laws,
    no_sliding_text,
    working_point_result,
)
from squealstudy.root_pairs import angular_band
from squealstudy.stacked.linear import StackedDamping, StackedLinear, computable, linearised
from squealstudy.stacked.operating import StackedOperating
from squealstudy.stacked.roots import StackedRoots, stacked_roots
from squealstudy.stacked.sliding import (
    BEYOND_LAW,
    CONTACT_TOUCHES,
    SINGULAR,
    SOLVED,
    SPRING_TOUCHES,
    StackedSliding,
    steady_sliding,
)
from squealstudy.stacked.structures import StackedStructures

# messages of states of StackedSliding
REFUSED = {
    SPRING_TOUCHES: SPRING_AT_CORNER,
    CONTACT_TOUCHES: CONTACT_AT_CORNER,
    BEYOND_LAW: PRESSES_OPEN,
}
MOST_COORDINATES = 40  # most coordinates of a model for which stacking saves time
POINTS_PER_BLOCK = 4096  # design points that are solved at once
Columns = Mapping[str, np.ndarray | float]


@dataclass(frozen=True, eq=False)
class StackedSystem:
    """m design points of a small model about steady sliding.

    Attributes
    ----------
    structures : StackedStructures
    operating : StackedOperating
    sliding : StackedSliding
    damping : StackedDamping
    linear : StackedLinear
    failures : mapping of int -> (status, message)
        Design points without such a system; the entries of their rows have no meaning.
    """

    structures: StackedStructures
    operating: StackedOperating
    sliding: StackedSliding
    damping: StackedDamping
    linear: StackedLinear
    failures: Mapping[int, tuple[str, str]]

    def roots(self, band_hz: tuple[float, float]) -> StackedRoots:
        """Complex modes in a band [Hz]; none at points that failed."""
        linear, solved = self.linear, np.ones(len(self.linear.K), dtype=bool)
        solved[list(self.failures)] = False
        n = linear.K.shape[1]
        K = np.where(solved[:, None, None], linear.K, np.eye(n))
        C = np.where(solved[:, None, None], linear.C, 0.0)
        all_roots = stacked_roots(C, K, angular_band(band_hz))
        root_shift = 0.5 * self.sliding.tangent_error[:, None] * np.abs(all_roots.lam)
        return StackedRoots(
            count=np.where(solved, all_roots.count, 0),
            lam=all_roots.lam,
            psi=all_roots.psi,
            error=all_roots.error + np.where(solved[:, None], root_shift, 0.0),
            residual=all_roots.residual,
        )

    def energies(self, psi: np.ndarray) -> np.ndarray:
        """Shares (m, components + 1, k) of elastic energy, of shapes psi (m, n, k)."""
        s, size = self.structures, psi.real**2 + psi.imag**2
        by_coordinate = self.linear.elastic[:, :, None] * size
        components = np.add.reduceat(by_coordinate, s.offsets[:-1], axis=1)
        springs = np.einsum("mik,mik->mk", psi.conj(), s.springs @ psi).real
        opened = s.N @ psi
        contact = self.linear.normal[:, None, :] @ (opened.real**2 + opened.imag**2)
        interfaces = springs + contact[:, 0]
        total = components.sum(axis=1) + interfaces
        parts = np.concatenate([components, interfaces[:, None, :]], axis=1)
        shares: np.ndarray = parts / np.where(total, total, 1.0)[:, None, :]
        return shares + 0.0

    def shapes(self, psi: np.ndarray) -> np.ndarray:
        """Unit vectors (m, k, s) complex64 of shapes psi (m, n, k) at the structures' sensors."""
        sensor_motion = (self.structures.sensors @ psi).swapaxes(1, 2)
        size = np.maximum(np.linalg.norm(sensor_motion, axis=2, keepdims=True), 1e-300)
        unit: np.ndarray = (sensor_motion / size).astype(np.complex64)
        return unit


def stacked_assembly(
    model: ModelDefinition, options: Mapping[str, str | int], columns: Columns, count: int
) -> tuple[StackedAssembly, Mapping[int, tuple[str, str]]]:
    """Assemblies of `count` design points, with one row if all share it, and failures by point.

    Parameters
    ----------
    model : ModelDefinition
    options : mapping of str -> str or int
    columns : mapping of parameter -> number or ndarray (count,)
        Values of every parameter.
    count : int
        Number of design points.

    Raises
    ------
    SquealstudyError
        No point has an assembly; the message is that of the first one.
    """
    names = [p.name for p in model.parameters if p.structural]
    varied = [name for name in names if np.ndim(columns[name])]
    if model.stack is not None:
        model_columns = {p.name: columns[p.name] for p in model.parameters}
        with np.errstate(all="ignore"):  # points that overflow fail one by one
            return _checked(model.stack(options, model_columns), count)
    values = np.column_stack([columns[name] for name in varied]) if varied else np.zeros((1, 0))
    distinct, index_of_row = np.unique(values, axis=0, return_inverse=True)
    common = {p.name: _first(columns[p.name]) for p in model.parameters}
    built: list[Assembly | None] = []
    reasons: dict[int, tuple[str, str]] = {}
    for i, row in enumerate(distinct):
        try:
            built.append(
                model.build(options, common | dict(zip(varied, row.tolist(), strict=True)))
            )
        except SquealstudyError as error:
            reasons[i] = ("structure", str(error))
            built.append(None)
    assemblies = [a for a in built if a is not None]
    if not assemblies:
        raise SquealstudyError(next(iter(reasons.values()))[1])
    stack = StackedAssembly.of([a if a is not None else assemblies[0] for a in built])
    if not varied:
        return stack, {}
    index_of_row = index_of_row.reshape(-1)
    failures = {
        int(i): reasons[int(index_of_row[i])]
        for i in np.flatnonzero(np.isin(index_of_row, list(reasons)))
    }
    return stack.at(index_of_row), failures


def stacked_system(
    model: ModelDefinition, options: Mapping[str, str | int], columns: Columns, count: int
) -> StackedSystem:
    """A batch of design points of a small model, from values to linearised matrices.

    Arguments are those of `stacked_assembly`; columns include damping ratios and factors of modes.

    Raises
    ------
    SquealstudyError
        No point has an assembly, or a parameter is of a mode that the model does not have.
    """
    assembly, failures = stacked_assembly(model, options, columns, count)
    point = ModelPoint(model, options, {name: _first(column) for name, column in columns.items()})
    structures = structures_of(assembly)
    operating = StackedOperating.of(point.law_kind, point.curve_kind, columns, count)
    damping = _damping(point, structures, columns, count)
    return system_about_sliding(structures, operating, damping, failures)


def structures_of(assembly: StackedAssembly) -> StackedStructures:
    """Structures in component-mode coordinates; entries that overflow are not finite."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        return StackedStructures.of(assembly)


def system_about_sliding(
    structures: StackedStructures,
    operating: StackedOperating,
    damping: StackedDamping,
    failures: Mapping[int, tuple[str, str]],
) -> StackedSystem:
    """Design points linearised about steady sliding.

    `failures` are those of earlier steps, by the number of the point.
    """
    failures, count = dict(failures), len(operating.friction)
    elastic = np.broadcast_to(structures.k_el * damping.scale**2, (count, structures.n))
    sliding = steady_sliding(structures, elastic, operating)
    pressed = bool(structures.load[..., 0].any())
    not_linear = ~np.broadcast_to(is_linear(structures.own_friction), count)
    failures |= {int(i): ("failed", NOT_LINEAR) for i in np.flatnonzero(not_linear)}
    for i in np.flatnonzero(sliding.state != SOLVED):
        failures.setdefault(int(i), _reason(int(sliding.state[i]), operating, int(i), pressed))
    linear = linearised(structures, sliding, operating, damping)
    for i in np.flatnonzero(~linear.finite):
        text = f"a matrix of the linearised system has entries too large: {LIMITS}"
        failures.setdefault(int(i), (OVERFLOW, text))
    if not (operating.law.in_package and operating.curve.in_package):
        failures |= _contradictions(structures, sliding, operating, failures)
    return StackedSystem(structures, operating, sliding, damping, linear, failures)


def natural_frequencies(
    model: ModelDefinition, options: Mapping[str, str | int], columns: Columns, count: int
) -> np.ndarray:
    """Frequencies (m, n) [Hz] of all real modes about steady sliding, ascending; NaN at failures.

    Arguments are those of `stacked_system`.
    """
    try:
        system = stacked_system(model, options, columns, count)
    except (SquealstudyError, np.linalg.LinAlgError):
        if count == 1:
            return np.full((1, 1), np.nan)
        single_points = (
            {name: v if np.ndim(v) == 0 else np.ravel(v)[[i]] for name, v in columns.items()}
            for i in range(count)
        )
        rows_hz = [natural_frequencies(model, options, values, 1)[0] for values in single_points]
        width = max(map(len, rows_hz))
        return np.array([np.resize(hz, width) for hz in rows_hz])
    K = np.where(system.linear.finite[:, None, None], system.linear.K_sym, 0.0)
    hz = np.sqrt(np.maximum(np.linalg.eigvalsh(K), 0.0)) / (2 * np.pi)
    hz[list(system.failures)] = np.nan
    return hz


def _checked(
    stack: StackedAssembly, count: int
) -> tuple[StackedAssembly, Mapping[int, tuple[str, str]]]:
    """The stack, and failures of points whose entries are too large or masses too small.

    The rows of these points are replaced by those of a valid one.

    Raises
    ------
    SquealstudyError
        No point has a valid assembly.
    """
    good = np.ones(count, dtype=bool)
    for name, array in stack.arrays.items():
        good &= computable(np.nan_to_num(array) if name == "own_friction" else array)
    good &= (np.einsum("mii->mi", stack.M) >= LEAST_MASS).all(axis=1)
    if good.all():
        return stack, {}
    text = f"a mass, stiffness or load is too large, or a mass too small: {LIMITS}"
    if not good.any():
        raise ConvergenceError(OVERFLOW, text)
    rows = np.where(good, np.arange(count), int(np.argmax(good)))
    return stack.at(rows), {int(i): (OVERFLOW, text) for i in np.flatnonzero(~good)}


def _first(value: np.ndarray | float) -> float:
    return float(value if np.ndim(value) == 0 else np.asarray(value)[0])


def _column(value: np.ndarray | float, count: int) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=float), count)


def _damping(
    point: ModelPoint, structures: StackedStructures, columns: Columns, count: int
) -> StackedDamping:
    """Damping and changes of component modes; ParameterError for a mode that does not exist."""
    n = structures.n
    uniform = _column(columns.get("damping_ratio", 0.0), count)
    ratio = np.repeat(uniform[:, None], n, axis=1)
    for parameter in point.assembly_parameters():
        for mode in parameter.modes:
            if not 1 <= mode <= n:
                raise ParameterError(parameter.name, f"the assembly has modes 1 to {n} here")
            ratio[:, mode - 1] = _column(columns[parameter.name], count)
    scale, damping_ratio = np.ones((1, n)), np.zeros((1, n))
    changed, named = point.mode_parameters(), set[int]()
    if changed:
        scale, damping_ratio = np.ones((count, n)), np.zeros((count, n))
    for parameter in changed:
        target = scale if parameter.quantity == FREQUENCY_SCALE else damping_ratio
        for mode in parameter.modes:
            try:
                coordinate = structures.coordinate(parameter.component, mode)
            except KeyError:
                text = f"component '{parameter.component}' has no mode {mode} here"
                raise ParameterError(parameter.name, text) from None
            target[:, coordinate] = _column(columns[parameter.name], count)
            named.add(coordinate)
    return StackedDamping(
        damping_ratio=ratio,
        stiffness_damping=_column(columns.get("stiffness_damping", 0.0), count),
        scale=scale,
        component_ratio=damping_ratio,
        uniform_ratio=uniform,
        named_modes=tuple({m - 1 for p in point.assembly_parameters() for m in p.modes}),
        named_coordinates=tuple(sorted(named)),
    )


def _reason(state: int, operating: StackedOperating, row: int, pressed: bool) -> tuple[str, str]:
    """Status and message of a point without steady sliding, or whose laws refuse their values.

    `pressed` is whether loads follow the brake pressure.
    """
    try:
        operating.point_at(row)
    except ModelError as error:
        return "failed", str(error)
    if state == SINGULAR:
        return "singular", FREE_MOTION
    if (text := REFUSED.get(state)) is not None:
        return "working_point", text
    pressure = operating.pressure[row] if pressed else None
    return "working_point", no_sliding_text(operating.friction[row], pressure)


def _contradictions(
    structures: StackedStructures,
    sliding: StackedSliding,
    operating: StackedOperating,
    failures: Mapping[int, tuple[str, str]],
) -> dict[int, tuple[str, str]]:
    """Failures of points at which a law from outside the package contradicts itself."""
    contradictions: dict[int, tuple[str, str]] = {}
    for i in range(len(sliding.gap)):
        if i in failures:
            continue
        arrays = {
            name: array[0 if len(array) == 1 else i]
            for name in ("area", "frictional", "speed_factor", "own_friction")
            for array in [getattr(structures, name)]
        }
        gap, p, kappa = sliding.gap[i], sliding.pressure[i], sliding.tangent[i]
        springs = structures.spring_points
        springs = springs[0 if len(springs) == 1 else i]
        no_imbalance = np.zeros_like(gap)
        state = working_point_result(
            arrays["area"], gap, p, kappa, 0, 0.0, no_imbalance, springs=springs
        )
        try:
            expect_consistent_laws(SimpleNamespace(**arrays), operating.point_at(i), state)
        except ConvergenceError as error:
            contradictions[i] = (error.status, str(error))
    return contradictions
