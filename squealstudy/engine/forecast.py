"""Forecasts for `check` the cost of a study and the error of its mesh, before it runs.

The cost follows from a few timed design points; the error from the nominal point, solved on the
mesh of the study and on the next finer one.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.engine.cache import is_prepared, load_any, load_prepared
from squealstudy.engine.forecast_by_size import SizeForecast, forecast_by_size
from squealstudy.engine.model_kind import ModelKind, as_model_kind
from squealstudy.engine.plan import Plan, has_mesh
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.machine.resources import peak_memory_mb
from squealstudy.mechanics.failures import FAILURES, reason
from squealstudy.models.components.definition import FileDefinition
from squealstudy.modes.point import PointModes, solve_point
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.root_pairs import LIGHT_DAMPING
from squealstudy.study.design import DesignPoint

# most points that are timed, and seconds after which no further point is timed
TIMED_POINTS, MOST_TIMING = 3, 20.0
UNRELIABLE_TIMING_S = 1.0  # s: up to so much of the first call may be spent on imports
RUN_OVERHEAD_S = (0.5, 5.0)  # s, least and most, of a run beside its points: workers, tables


@dataclass(frozen=True)
class Estimate:
    """Expected cost of the design points.

    Attributes
    ----------
    n_missing_structures : int
        Number of reductions to be made first.
    structure_s : float or None
        Seconds of one reduction, as an earlier one for this study took; None where there is none.
        0 where points are solved as a batch.
    point_s : float or None
        Seconds of one design point on one core; None where it cannot be timed yet.
    memory_mb : float or None
        Peak memory of this process after the timed points; each worker needs about as much.
    n_coordinates : int or None
        Degrees of freedom of the reduced model.
    by_size : SizeForecast or None
        Forecast in place of these figures where no structure of the study is in the cache.
    reason : str
        Why a figure is missing.
    """

    n_missing_structures: int
    structure_s: float | None = None
    point_s: float | None = None
    memory_mb: float | None = None
    n_coordinates: int | None = None
    by_size: SizeForecast | None = None
    reason: str = ""


def run_seconds(
    plan: Plan, cost: Estimate, missing: int, jobs: int, max_points: int | None = None
) -> tuple[float, float]:
    """Shortest and longest time [s] that the rest of a study takes, without its pictures.

    It follows from the time of the timed points and from what the kind of study says that others
    cost in comparison (`Solves`).

    Parameters
    ----------
    plan : Plan
    cost : Estimate
        Estimate with a known `point_s`.
    missing : int
        Number of design points that are not solved yet, at least one.
    jobs : int
        Number of workers.
    max_points : int or None
        Largest number of design points left where a design grows; None: it does not grow.
    """
    assert cost.point_s is not None
    solves = as_model_kind(plan.kind).solves(plan)
    build = cost.n_missing_structures * (cost.structure_s or 0.0)
    build /= 1 if cost.n_missing_structures == 1 else min(jobs, max(cost.n_missing_structures, 1))
    build += solves.checks * cost.point_s / jobs
    point_s, first = solves.point * cost.point_s, solves.shared * cost.point_s
    points = [n * point_s / min(jobs, n) + first for n in (missing, max_points or missing)]
    shortest, longest = solves.least * points[0], solves.longest * points[1]
    return build + shortest + RUN_OVERHEAD_S[0], build + longest + RUN_OVERHEAD_S[1]


def _timed(kind: ModelKind, plan: Plan, tasks: Sequence[DesignPoint]) -> tuple[list[float], str]:
    """Seconds of each of a few design points; where none can be timed, the reason.

    If the first takes less than UNRELIABLE_TIMING_S it is timed once more.
    """
    seconds: list[float] = []
    why: list[str] = []

    def time_point(task: DesignPoint) -> float | None:
        try:
            return kind.time_point(plan, task)
        except StudyFileError:
            raise
        except FAILURES as error:  # a run would report it in the point's row
            why.append(reason(error)[1])
            return None

    for number, task in enumerate(tasks):
        spent = time_point(task)
        if spent and not number and spent < UNRELIABLE_TIMING_S:
            spent = min(spent, time_point(task) or spent)
        seconds += [spent] if spent else []
        if sum(seconds) > MOST_TIMING:
            break
    if seconds:
        return seconds, ""
    return [], f"no timed design point can be solved{': ' if why else ''}{''.join(why[:1])}"


def estimate(plan: Plan) -> Estimate:
    """Time a few design points whose structures are in the cache, spread over the design.

    A study that is solved as a batch has its first point timed.
    """
    kind = as_model_kind(plan.kind)
    if plan.stacked:
        seconds, why = _timed(kind, plan, [plan.tasks[0]])
        return Estimate(
            0,
            structure_s=0.0,
            point_s=seconds[0] if seconds else None,
            memory_mb=peak_memory_mb(),
            n_coordinates=plan.first.assembly().n_dof,
            reason=why,
        )
    ready = [key for key in plan.structures if is_prepared(key)]
    missing = len(plan.structures) - len(ready)
    if not ready:
        return Estimate(
            missing,
            by_size=forecast_by_size(plan),
            reason="no reduced model of this study is in the cache yet; --build makes the first "
            "one and times it",
        )
    usable = np.isin(plan.tasks.structures, ready)[plan.tasks.structure_index]
    rows = np.flatnonzero(usable)
    step = max(1, (len(rows) - 1) // max(1, TIMED_POINTS - 1))
    seconds, why = _timed(kind, plan, [plan.tasks[int(i)] for i in rows[::step][:TIMED_POINTS]])
    prepared = load_any(ready[0])
    return Estimate(
        n_missing_structures=missing,
        structure_s=float(sum(prepared.timings.values())),
        point_s=sum(seconds) / len(seconds) if seconds else None,
        memory_mb=peak_memory_mb(),
        n_coordinates=prepared.model.n,
        reason=why,
    )


MESH_OPTION = "mesh"
FINER_MESH = {"coarse": "medium", "medium": "fine"}


@dataclass(frozen=True)
class MeshError:
    """Differences between two meshes over the light modes of the finer one.

    Attributes
    ----------
    meshes : tuple of str
        The study's mesh and the next finer one.
    frequency : ndarray (m,)
        |Change| of |lam| relative to the finer mesh, for each of the m modes with a partner.
    damping : ndarray (m,)
        |Change| of their damping ratios, absolute.
    unpaired : int
        Number of light modes of the finer mesh without a partner.
    unstable : tuple of int
        Number of unstable modes on each mesh, those that do not oscillate included.
    seconds : tuple of float
        Time on each mesh to build and reduce it, unless the cache holds it, and solve the point.
    """

    meshes: tuple[str, str]
    frequency: np.ndarray
    damping: np.ndarray
    unpaired: int
    unstable: tuple[int, int]
    seconds: tuple[float, float]


def mesh_error(plan: Plan, threads: int) -> MeshError:
    """Solve the nominal point of a study densely on its mesh and on the next finer one.

    Raises
    ------
    SquealstudyError
        Where there is no finer mesh, or a reduction or the nominal point fails.
    """
    mesh = str(plan.study.options.get(MESH_OPTION, ""))
    if mesh not in FINER_MESH:
        what = f"there is no finer mesh than '{mesh}'" if mesh else "this model has no mesh"
        if isinstance(plan.study.model, FileDefinition) and has_mesh(plan.study):
            what = "its meshes are files; a finer one is another model file"
        raise SquealstudyError(f"the error of the mesh cannot be told: {what}")
    options = {**plan.study.options, MESH_OPTION: FINER_MESH[mesh]}
    finer_plan = Plan(replace(plan.study, options=options), plan.swept)
    this_mesh, own_shapes, own_s = _nominal_modes(plan, threads)
    finer, finer_shapes, finer_s = _nominal_modes(finer_plan, threads)
    partner = pair_modes(finer.lam, finer_shapes, this_mesh.lam, own_shapes).partner
    light = (np.abs(finer.lam.real) < LIGHT_DAMPING * np.abs(finer.lam)) & ~finer.overdamped
    paired = light & (partner >= 0)
    a, b = this_mesh.lam[partner[paired]], finer.lam[paired]
    tolerance = plan.study.definition.modes.stability_tolerance
    return MeshError(
        (mesh, FINER_MESH[mesh]),
        np.abs(np.abs(a) / np.abs(b) - 1.0),
        np.abs(_damping(a) - _damping(b)),
        int((light & (partner < 0)).sum()),
        (_unstable(this_mesh, tolerance), _unstable(finer, tolerance)),
        (own_s, finer_s),
    )


def _nominal_modes(plan: Plan, threads: int) -> tuple[PointModes, np.ndarray, float]:
    """Modes of the nominal point, their shapes at places that both meshes have, and seconds."""
    started = time.perf_counter()
    design = plan.design(plan.nominal_values)
    design = replace(design, structure=plan.structure_key(design))
    key, reason = build_structure(build_task(plan, design, threads))
    if reason:
        raise SquealstudyError(f"mesh '{plan.study.options[MESH_OPTION]}': {reason}")
    prepared = load_prepared(key)
    modes = solve_point(prepared, design.state(), plan.band_hz)
    shapes = modes.shapes @ np.asarray(prepared.sensor_shapes).T
    return modes, shapes, time.perf_counter() - started


def _damping(lam: np.ndarray) -> np.ndarray:
    zeta: np.ndarray = -lam.real / np.abs(lam)
    return zeta


def _unstable(modes: PointModes, tolerance: float) -> int:
    return int((_damping(modes.lam) < -tolerance).sum())
