"""The error of a mesh: modes of a study's nominal point on its mesh and on the next finer one."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.engine.cache import load_prepared
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.errors import SquealstudyError
from squealstudy.modes.full_order.pairs import LIGHT
from squealstudy.modes.point import PointModes, solve_point
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.study.design import DesignPoint

MESH_OPTION = "mesh"
FINER = {"coarse": "medium", "medium": "fine"}


@dataclass(frozen=True)
class MeshError:
    """Differences between two meshes over the light modes of the finer one.

    Attributes
    ----------
    meshes : tuple of str
        The study's mesh and the next finer one.
    frequency : ndarray (m,)
        Of the modes with a partner: |change| of the frequency, relative.
    damping : ndarray (m,)
        |change| of their damping ratios, absolute.
    unpaired : int
        Light modes of the finer mesh without a partner.
    unstable : tuple of int
        Unstable modes on each mesh, those of static divergence among them.
    seconds : tuple of float
        Of each mesh: to build and reduce it, unless the cache holds it, and to solve the point.
    """

    meshes: tuple[str, str]
    frequency: np.ndarray
    damping: np.ndarray
    unpaired: int
    unstable: tuple[int, int]
    seconds: tuple[float, float]


def mesh_error(plan: Plan, threads: int) -> MeshError:
    """Solve the nominal point of a study on its mesh and on the next finer one, densely.

    Raises
    ------
    SquealstudyError
        No finer mesh; a reduction or the nominal point fails.
    """
    mesh = str(plan.study.options.get(MESH_OPTION, ""))
    if mesh not in FINER:
        what = f"there is no finer mesh than '{mesh}'" if mesh else "this model has no mesh"
        raise SquealstudyError(f"the error of the mesh cannot be told: {what}")
    options = {**plan.study.options, MESH_OPTION: FINER[mesh]}
    finer_plan = Plan(replace(plan.study, options=options), plan.swept)
    own, own_shapes, own_s = _nominal_modes(plan, threads)
    finer, finer_shapes, finer_s = _nominal_modes(finer_plan, threads)
    partner = pair_modes(finer.lam, finer_shapes, own.lam, own_shapes).partner
    light = (np.abs(finer.lam.real) < LIGHT * np.abs(finer.lam)) & ~finer.overdamped
    paired = light & (partner >= 0)
    a, b = own.lam[partner[paired]], finer.lam[paired]
    tolerance = plan.study.definition.modes.stability_tolerance
    return MeshError(
        (mesh, FINER[mesh]),
        np.abs(np.abs(a) / np.abs(b) - 1.0),
        np.abs(_damping(a) - _damping(b)),
        int((light & (partner < 0)).sum()),
        (_unstable(own, tolerance), _unstable(finer, tolerance)),
        (own_s, finer_s),
    )


def _nominal_modes(plan: Plan, threads: int) -> tuple[PointModes, np.ndarray, float]:
    """Modes of the nominal point, their shapes at corresponding places, and the time taken."""
    started = time.perf_counter()
    design = DesignPoint(plan.study.model, plan.study.options, plan.nominal_values)
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
