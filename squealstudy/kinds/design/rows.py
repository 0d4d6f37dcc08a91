"""Evaluates a design at one operating point: its least damped modes, and effects of variables."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa

from squealstudy.cycles.trials import DECAYS, LASTS, OPEN
from squealstudy.engine.cache import NewGaps, known_gap, prepared_model
from squealstudy.engine.reduced import BuiltOnBasis
from squealstudy.engine.rows import (
    HEAD,
    REAL,
    TEXT,
    WHOLE_NUMBER,
    WORKING_POINT_FIELDS,
    failed_row,
    head,
    structs,
    working_point_cells,
)
from squealstudy.errors import ParameterError
from squealstudy.kinds.complex_modes.full_order_check import (
    FullOrderTask,
    check_reference,
    reference_roots,
)
from squealstudy.kinds.design.in_time import ELSEWHERE, TODAY, TURN, runs_in_time
from squealstudy.kinds.design.plan import CYCLES, FULL, IN_TIME, MODES
from squealstudy.kinds.limit_cycles.designs import CyclesRequest
from squealstudy.kinds.limit_cycles.kind import cycles_row
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    design_structure,
    state_parameters,
    structural_names,
)
from squealstudy.modes.point import band_modes, linearised_point
from squealstudy.modes.sensitivity.mode_family import known_mode
from squealstudy.modes.sensitivity.mode_sensitivities import figure_slopes, figures
from squealstudy.modes.sensitivity.reduced import ChosenModes, point_sensitivities
from squealstudy.modes.sensitivity.structural import structural_sensitivities
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.root_pairs import angular_band
from squealstudy.study.design import DesignPoint
from squealstudy.system.coupled_pair import coupled_pair
from squealstudy.system.energies import reduced_energy_shares
from squealstudy.system.linearise import LinearisedModel, component_frequencies

SLOPE_FIELDS = (
    ("parameter", TEXT),
    ("d_damping_ratio", REAL),
    ("d_growth_rate", REAL),
    ("d_frequency_hz", REAL),
)
MODE_FIELDS = (
    ("mode", WHOLE_NUMBER),
    ("frequency_hz", REAL),
    ("growth_rate", REAL),
    ("damping_ratio", REAL),
    ("damping_error", REAL),
    ("main_component", TEXT),
    ("main_share", REAL),
    ("pair_first_hz", REAL),
    ("pair_second_hz", REAL),
    ("pair_share", REAL),
    ("damping_without_friction", REAL),
)
BESIDE_FIELDS = (("frequency_hz", REAL), ("damping_ratio", REAL))
SUMMARY_FIELDS = (
    ("n_modes", WHOLE_NUMBER),
    ("n_unstable", WHOLE_NUMBER),
    ("max_growth_rate", REAL),
    ("min_damping_ratio", REAL),
    ("frequency_hz", REAL),
    ("main_component", TEXT),
    ("verdict", TEXT),
    ("reason", TEXT),
    ("missing_damping", REAL),
)
SCHEMA = pa.schema(
    [pa.field(n, t, nullable=t == WHOLE_NUMBER) for n, t in (*HEAD, *SUMMARY_FIELDS)]
    + [pa.field(n, t, nullable=False) for n, t in WORKING_POINT_FIELDS]
    + [
        pa.field(
            "modes",
            pa.list_(
                pa.struct(
                    [pa.field(n, t) for n, t in MODE_FIELDS]
                    + [pa.field("slopes", structs(SLOPE_FIELDS))]
                )
            ),
        ),
        pa.field("beside", structs(BESIDE_FIELDS)),
    ]
)
# modes with damping ratios up to this much above the margin have sensitivities
SENSITIVITY_DAMPING_WINDOW = 0.02
LEAST_MODES, MOST_MODES = 2, 8  # fewest and most modes with sensitivities
# factor on the ends of the band, within which modes may have been moved out of the band
BAND_WIDENING = 1.25
# "damping ratio" of steady sliding that diverges without oscillation
DIVERGENCE_DAMPING_RATIO = -1.0


@dataclass(frozen=True)
class DesignRequest:
    """Settings of the analyses, the same for every design point.

    Attributes
    ----------
    parameters : tuple of RequestedParameter
        Variables, scattered parameters, and the uniform damping ratio.
    margin : float
        Damping ratio near which modes have sensitivities.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    band_hz : (low, high)
    settings : ReductionSettings
    cycles : CyclesRequest
    structural_ranges : mapping of str -> float
        Ranges of the structural variables.
    today : mapping of str -> float
        Today's values of the variables.
    structures : mapping of tuple of float -> str
        Keys of today's structures by their values, where a variable is of the structure.
    operation : mapping of str -> float
        Values in [parameters] of swept parameters that do not change the structure.
    basis : str
        Key of the basis that structures share; empty without one. With it derivatives by structural
        variables are those of the assembly on that basis.
    """

    parameters: tuple[RequestedParameter, ...]
    margin: float
    tolerance: float
    band_hz: tuple[float, float]
    settings: ReductionSettings
    cycles: CyclesRequest
    structural_ranges: Mapping[str, float]
    today: Mapping[str, float]
    structures: Mapping[tuple[float, ...], str]
    operation: Mapping[str, float]
    basis: str


def design_row(
    point: DesignPoint, analysis: str, request: DesignRequest, gaps: NewGaps
) -> dict[str, Any]:
    """Row of a design point, for one of the analyses; a failed row where it cannot be solved."""
    started = time.perf_counter()
    try:
        if analysis == CYCLES:
            return _of_cycles(point, request, gaps)
        if analysis == IN_TIME:
            cells = _in_time(point, request, gaps)
        else:
            cells = (
                _full(point, request)
                if analysis == FULL
                else _modes(point, analysis, request, gaps)
            )
    except ParameterError as error:
        why = f"{error.key}: {error.message}"
        return failed_row(SCHEMA, point.point_id, "parameter", why)
    except FAILURES as error:
        wall_s = time.perf_counter() - started
        return failed_row(SCHEMA, point.point_id, *reason(error), wall_s)
    return {**head(point.point_id, time.perf_counter() - started), **cells}


def _summary(lam: np.ndarray, tolerance: float) -> dict[str, Any]:
    """Cells of a point from all roots (m,) of its band, rad/s, with those of its worst mode."""
    nothing = {"main_component": "", "verdict": "", "reason": "", "missing_damping": np.nan}
    if not len(lam):
        empty = dict.fromkeys(("max_growth_rate", "min_damping_ratio", "frequency_hz"), np.nan)
        return {"n_modes": 0, "n_unstable": 0, **empty, **nothing}
    growth, hz, zeta = figures(lam)
    worst = int(np.argmin(zeta))
    return {
        "n_modes": int((lam.imag > 0).sum()),
        "n_unstable": int((zeta < -tolerance).sum()),
        "max_growth_rate": float(growth.max()),
        "min_damping_ratio": float(zeta[worst]),
        "frequency_hz": float(hz[worst]) if lam[worst].imag else 0.0,
        **nothing,
    }


def _growing_outside_band(lam: np.ndarray, limit: float) -> list[dict[str, float]]:
    """Modes among roots (m,) outside the band whose damping ratio is below a limit."""
    _, hz, zeta = figures(lam)
    low = np.flatnonzero(zeta < limit)
    return [{"frequency_hz": float(hz[k]), "damping_ratio": float(zeta[k])} for k in low]


def _judged(lam: np.ndarray) -> np.ndarray:
    """Mask (m,) of roots that count: those that oscillate, and real ones that grow."""
    return (lam.imag > 0) | (lam.real > 0)


def _modes(
    point: DesignPoint, analysis: str, request: DesignRequest, gaps: NewGaps
) -> dict[str, Any]:
    prepared, state = prepared_model(point.structure), point.state()
    cached_gap = known_gap(point.structure, point)
    steady, system = linearised_point(prepared, state, cached_gap)
    if cached_gap is None:
        gaps.add(point.structure, point, steady.gap)
    low, high = angular_band(request.band_hz)
    wider = low / (BAND_WIDENING if request.band_hz[0] else 1.0), high * BAND_WIDENING
    lam, psi, error, _ = band_modes(system, steady, (wider[0] / TURN, wider[1] / TURN))
    inside = (np.abs(lam) >= low) & (np.abs(lam) <= high)
    limit = min(request.margin, -request.tolerance)
    beside = _growing_outside_band(lam[~inside & _judged(lam)], limit)
    in_band = inside & _judged(lam)
    lam, psi, error = lam[in_band], psi[:, in_band], error[in_band]
    cells = {**_summary(lam, request.tolerance), **working_point_cells(steady), "modes": []}
    cells["beside"] = beside
    order = np.argsort(figures(lam)[2], kind="stable")
    oscillating = [int(k) for k in order if lam[k].imag > 0]
    if not oscillating:
        return cells
    energies = reduced_energy_shares(prepared.model, system.weights, psi)
    names = [*point.model.components, "interfaces"]
    cells["main_component"] = names[int(np.argmax(energies[:, oscillating[0]]))]
    zeta = figures(lam)[2]
    near = [
        k
        for index, k in enumerate(oscillating[:MOST_MODES])
        if index < LEAST_MODES or zeta[k] < request.margin + SENSITIVITY_DAMPING_WINDOW
    ]
    real = _RealModes.of(system)
    for k in near:
        mode_cells: dict[str, Any] = {"mode": k + 1, **_figures(lam[k])}
        mode_cells["damping_error"] = float(error[k] / np.abs(lam[k]))
        mode_cells["main_component"] = names[int(np.argmax(energies[:, k]))]
        mode_cells["main_share"] = float(energies[:, k].max())
        cells["modes"].append({**mode_cells, **real.pair(psi[:, k]), "slopes": []})
    if analysis == MODES:
        families = tuple(known_mode(system.pencil, complex(lam[k]), psi[:, k]) for k in near)
        chosen = ChosenModes(prepared, state, steady, system, families)
        for mode_cells, slopes in zip(cells["modes"], _slopes(point, chosen, request), strict=True):
            mode_cells["slopes"] = slopes
    return cells


def _figures(root: complex) -> dict[str, float]:
    values = (float(column[0]) for column in figures(np.array([root])))
    return dict(zip(("growth_rate", "frequency_hz", "damping_ratio"), values, strict=True))


@dataclass(frozen=True)
class _RealModes:
    """Real modes of steady sliding without the coupling by friction, but with its damping.

    Attributes
    ----------
    hz, zeta : ndarray (n,)
        Frequencies, and damping ratios phi^T C phi / (2 omega).
    phi : ndarray (n, n)
        Modes in columns.
    """

    hz: np.ndarray
    zeta: np.ndarray
    phi: np.ndarray

    @classmethod
    def of(cls, system: LinearisedModel) -> _RealModes:
        w2, phi = system.real_modes
        omega = np.sqrt(np.maximum(w2, 0.0))
        damping = np.einsum("ij,ij->j", phi, system.C @ phi)
        zeta = damping / np.maximum(2.0 * omega, np.finfo(float).tiny)
        return cls(omega / (2 * np.pi), zeta, phi)

    def pair(self, x: np.ndarray) -> dict[str, float]:
        """Cells on the two real modes that have the largest shares in a complex mode x (n,)."""
        pair, share, _ = coupled_pair(self.phi, x)
        first, second = sorted(float(self.hz[k]) for k in pair)
        return {
            "pair_first_hz": first,
            "pair_second_hz": second,
            "pair_share": float(share[: len(set(pair))].sum()),
            "damping_without_friction": float(self.zeta[pair].min()),
        }


def uncoupled_modes(
    point: DesignPoint, band_hz: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and damping ratios of a band without the coupling by friction.

    Raises
    ------
    ConvergenceError
        Where there is no working point.
    """
    _, system = linearised_point(prepared_model(point.structure), point.state())
    real = _RealModes.of(system)
    inside = (real.hz >= band_hz[0]) & (real.hz <= band_hz[1])
    return real.hz[inside], real.zeta[inside]


def _slopes(
    point: DesignPoint, chosen: ChosenModes, request: DesignRequest
) -> list[list[dict[str, Any]]]:
    """Slope rows of each chosen mode: derivatives by every parameter."""
    requested, top = request.parameters, request.band_hz[1]
    parameters = state_parameters(requested, component_frequencies(chosen.prepared.model))
    modes = point_sensitivities(chosen, parameters, 1e-3, top, reanalysis=False)
    names = structural_names(requested)
    builder = design_structure(point, request.settings, request.structural_ranges)
    if request.basis:
        structural = tuple(p.name for p in point.model.parameters if p.structural)
        build = BuiltOnBasis(builder.build, request.basis, structural)
        builder = replace(builder, build=build)
    more: Sequence[Any] = structural_sensitivities(chosen, builder, names, 1e-3, reanalysis=False)
    slope_rows = []
    for mode, of_parts in zip(modes, more, strict=True):
        rows = []
        for s in (*mode.sensitivities, *of_parts):
            slopes = figure_slopes(np.array([mode.lam]), np.array([s.derivative]))
            growth, hz, zeta = (float(d[0]) for d in slopes)
            cells = (s.step.name, zeta, growth, hz)
            rows.append(dict(zip((n for n, _ in SLOPE_FIELDS), cells, strict=True)))
        slope_rows.append(rows)
    return slope_rows


def _full(point: DesignPoint, request: DesignRequest) -> dict[str, Any]:
    """Cells of a point from the roots of the unreduced model."""
    nothing = np.zeros(0, dtype=complex)
    task = FullOrderTask(point, nothing, request.settings, request.band_hz)
    reference = check_reference(task)
    if reference["status"] != "ok":
        raise ValueError(reference["message"])
    lam, _ = reference_roots(reference)
    summary = _summary(lam[_judged(lam)], request.tolerance)
    return {**summary, **working_point_cells(None), "modes": [], "beside": []}


def _in_time(point: DesignPoint, request: DesignRequest, gaps: NewGaps) -> dict[str, Any]:
    """Cells on whether all runs of a design decay.

    ``n_modes`` is the number of runs, ``n_unstable`` the number of those that do not decay.
    """
    today: dict[str, DesignPoint] = {}
    values = {**point.values, **request.today}
    for name, todays_values in ((TODAY, values), (ELSEWHERE, {**values, **request.operation})):
        was = point.with_values(todays_values)
        if was.values == point.values or any(was.values == k.values for k in today.values()):
            continue
        key = was.structure or request.structures.get(tuple(was.structural_values().values()), "")
        if key:
            today[name] = replace(was, structure=key)
    steady, runs = runs_in_time(point, today, request.cycles, gaps)
    lasting = [run for run in runs if run.outcome == LASTS]
    others = sum(run.outcome != DECAYS for run in runs)
    return {
        **_summary(np.zeros(0, dtype=complex), request.tolerance),
        **working_point_cells(steady),
        "n_modes": len(runs),
        "n_unstable": others,
        "frequency_hz": lasting[0].mode_hz if lasting else np.nan,
        "verdict": LASTS if lasting else OPEN if others else DECAYS,
        "reason": "; ".join(run.text for run in runs),
        "modes": [],
        "beside": [],
    }


def _of_cycles(point: DesignPoint, request: DesignRequest, gaps: NewGaps) -> dict[str, Any]:
    """Row with the verdict on limit cycles and the largest damping ratio that is missing."""
    row, *_ = cycles_row(point, request.cycles, gaps)
    if row["status"] != "ok":
        return failed_row(SCHEMA, point.point_id, row["status"], row["message"], row["wall_s"])
    lacking = [(b["added_damping"] / (4 * np.pi * b["frequency_hz"]), b) for b in row["curves"]]
    nowhere: tuple[float, dict[str, Any]] = (np.nan, {})
    most_lacking, worst_point = max(lacking, key=lambda item: item[0], default=nowhere)
    return {
        **head(point.point_id, row["wall_s"]),
        **_summary(np.zeros(0, dtype=complex), request.tolerance),
        **{name: row[name] for name, _ in WORKING_POINT_FIELDS},
        "n_modes": row["n_families"],
        "n_unstable": row["n_unstable"],
        "max_growth_rate": row["max_growth_rate"],
        "frequency_hz": worst_point.get("frequency_hz", np.nan),
        "verdict": row["verdict"],
        "reason": row["reason"],
        "missing_damping": most_lacking,
        "modes": [],
        "beside": [],
    }
