"""The unreduced model of a structure, and the full-order check of design points by it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.engine.cache import Prepared, load_any
from squealstudy.errors import ConvergenceError
from squealstudy.kinds.complex_modes.prepared_point import prepared_of
from squealstudy.machine.resources import give_back_memory
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.models.assembly import Assembly
from squealstudy.modes.full_order.contact_factor import HeldStiffness
from squealstudy.modes.full_order.modes import full_order_modes, solve_family_point
from squealstudy.modes.point import PointModes
from squealstudy.reduction.cmt import ComponentModes, ReductionSettings, component_modes
from squealstudy.reduction.prepared import PreparedFamily, mean_contact_stiffness
from squealstudy.root_pairs import FullOrderPairs, paired_with_full_order
from squealstudy.study.design import DesignPoint

# degrees of freedom of all checks at work at once: a check with 48,588 takes 2.1 GB
SIDE_BY_SIDE = 110_000
UNTOLD = 1e-11  # relative error of the roots of a check that stores no errors


@dataclass(frozen=True, eq=False)
class FullOrderTask:
    """A design point to solve at full order, whose study has the roots `lam` (m,) [rad/s].

    If it is `stacked` its prepared model is made by the task. A mode neither grows nor decays if
    its damping ratio is between -`neutral` and `neutral`.
    """

    point: DesignPoint
    lam: np.ndarray
    settings: ReductionSettings
    band_hz: tuple[float, float]
    stacked: bool = False
    neutral: float = 0.0


def at_once(tasks: Sequence[FullOrderTask]) -> int:
    """How many checks the memory allows at once."""
    largest = 1
    for structure in {task.point.structure for task in tasks if not task.stacked}:
        prepared = load_any(structure)
        n_dof = prepared.model.n if isinstance(prepared, PreparedFamily) else prepared.n_dof
        largest = max(largest, n_dof)
    return max(1, SIDE_BY_SIDE // largest)


def check_reference(task: FullOrderTask) -> dict[str, Any]:
    """Solve one point at full order; the facts of its check: errors, or why there are none."""
    started = time.perf_counter()
    check: dict[str, Any] = {"point_id": task.point.point_id}
    try:
        prepared = prepared_of(task.point) if task.stacked else load_any(task.point.structure)
        full = solve_unreduced(prepared, task.point, task.settings, task.band_hz, check=True)
        pairs = paired_with_full_order(task.lam, full.lam, full.error_rung, task.band_hz)
        check |= {
            "status": "ok",
            **({} if np.isnan(pairs.frequency_error) else _errors(pairs)),
            "missed_modes": pairs.missed,
            "full_order_modes": len(full.lam),
            "full_order_residual": float(full.residual.max(initial=0.0)),
            "roots": [[float(x.real), float(x.imag)] for x in full.lam],
            "root_errors": full.error_rung.tolist(),
        }
    except FAILURES as error:
        check |= {"status": "failed", "message": reason(error)[1]}
    finally:
        give_back_memory()  # the factor, which is larger than all that remains
    check["wall_s"] = time.perf_counter() - started
    return check


def _errors(pairs: FullOrderPairs) -> dict[str, float]:
    return {"frequency_error": pairs.frequency_error, "damping_error": pairs.damping_error}


def reference_roots(reference: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Roots (n,) of a full-order check and their errors, rad/s."""
    full = np.array(reference["roots"], dtype=float).reshape(-1, 2) @ np.array([1.0, 1.0j])
    return full, np.array(reference.get("root_errors", UNTOLD * np.abs(full)), dtype=float)


# by structure, and whether it was built with component modes: assembly, and these modes
_built: dict[tuple[str, bool], tuple[Assembly, Mapping[str, ComponentModes]]] = {}
# by structure: factorised stiffness of a large model, None where that is not definite
_stiffness_by_structure: dict[str, HeldStiffness | None] = {}


def forget() -> None:
    """Free the unreduced model and the factor that this process holds."""
    _built.clear()
    _stiffness_by_structure.clear()
    give_back_memory()


def solve_unreduced(
    prepared: Prepared,
    design: DesignPoint,
    settings: ReductionSettings,
    band_hz: tuple[float, float],
    check: bool = False,
) -> PointModes:
    """Complex modes of a design point at full order.

    Parameters
    ----------
    prepared : PreparedModel or PreparedFamily
        Prepared model of the point's structure.
    design : DesignPoint
    settings : ReductionSettings
        Settings of the reduction, which decide the real modes that have modal damping.
    band_hz : (low, high)
        Band of the modes, Hz.
    check : bool
        Whether the modes check others. A family's modes are of full order anyway, so the check
        solves them with another factorisation.

    Raises
    ------
    ConvergenceError
        Where there is no steady sliding, or modes are not found.
    """
    if isinstance(prepared, PreparedFamily):
        return solve_family_point(prepared, design.plain_values(), band_hz, check)
    assembly, modes = unreduced_assembly(design, settings)
    state, cutoff = design.state(), settings.damped_to
    stiffness_kept = None
    if HeldStiffness.pays(assembly):
        if design.structure not in _stiffness_by_structure:
            _stiffness_by_structure.clear()
            stiffness = mean_contact_stiffness(assembly, state.operating)
            with contextlib.suppress(ConvergenceError):  # the weight of stresses may be negative
                stiffness_kept = HeldStiffness.of(assembly, stiffness)
            _stiffness_by_structure[design.structure] = stiffness_kept
        stiffness_kept = _stiffness_by_structure[design.structure]
    return full_order_modes(prepared, assembly, modes, state, band_hz, cutoff, stiffness_kept)


def unreduced_assembly(
    design: DesignPoint, settings: ReductionSettings
) -> tuple[Assembly, Mapping[str, ComponentModes]]:
    """The unreduced model, and modes by component where the study changes component modes."""
    changed = bool(design.mode_parameters())
    key = design.structure, changed
    if key not in _built:
        _built.clear()  # one structure at a time: an assembly is large
        assembly = design.assembly()
        cutoff = settings.component_cutoff
        _built[key] = (assembly, component_modes(assembly, cutoff) if changed else {})
    return _built[key]
