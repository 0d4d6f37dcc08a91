"""Design points in the hybrid representation (THEORY.md eq. (80)): the modal one's reference.

Forecast and start are those of the modal representation, mapped on the assembly modes that both
have; damping is the same on these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from squealstudy.engine.cache import (
    is_whole,
    load_value,
    prepared_model,
    prepared_path,
    save_value,
)
from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.kinds.transient.batch import BatchTask, sensed_modes
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import state_working_point
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.motion import Motion
from squealstudy.motion.reference_modes import ReferenceModes
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.cmt import component_modes
from squealstudy.reduction.hybrid import HybridModel, HybridSettings, hybrid_model
from squealstudy.study.design import DesignPoint

SAME_MODE = 0.99  # correlation of the contact observation of one mode in both representations


def hybrid_motions(
    task: BatchTask, chosen: Sequence[DesignPoint], points: Sequence[MotionPoint]
) -> list[Motion]:
    """Integrate design points one by one; final states are in hybrid coordinates.

    Raises
    ------
    ModelError
        Modes of the two representations that do not correspond.
    """
    reference, model = task.reference, _model(task)
    signs = common_modes(reference, model)
    m = len(signs)
    phi = np.hstack([model.phi[:, :m] * signs, model.phi[:, m:]])  # modes of the reference
    model = replace(model, phi=phi)
    sensed = sensed_modes(task.section, reference.system.omega2[:m], task.band_hz)
    made = [_hybrid_point(task, model, m, *one) for one in zip(chosen, points, strict=True)]
    return [simulate_hybrid(model, point, task.settings(), sensed) for point in made]


def _model(task: BatchTask) -> HybridModel:
    """The hybrid model of the batch's structure, from the cache or made now."""
    key = task.points[0].structure
    layers = task.section.layers
    content = [task.cutoff_hz, layers, task.component_modes, repr(task.operating)]
    name = content_hash([source_hash(), *content])
    path = prepared_path(key) / "hybrid" / name
    if not is_whole(path):
        settings = HybridSettings(task.cutoff_hz, task.cutoff_hz, layers)
        save_value(path, _build(task, settings))
    model: HybridModel = load_value(path)
    return model


def _build(task: BatchTask, settings: HybridSettings) -> HybridModel:
    first = task.points[0]
    prepared = prepared_model(first.structure)
    assembly = first.assembly()
    point = state_working_point(prepared, DesignState(task.operating))
    modes = component_modes(assembly, task.cutoff_hz) if task.component_modes else {}
    damped = {key: modes[key[0]] for key in task.component_modes}
    return hybrid_model(assembly, point, task.operating, settings, damped)


def common_modes(reference: ReferenceModes, model: HybridModel) -> np.ndarray:
    """Sign (m,) by which each hybrid mode is the reference's mode of the same number.

    Raises
    ------
    ModelError
        Where they are not the same modes.
    """
    m = min(len(model.omega), reference.n_exact)
    rows = zip((model.N, model.T, model.T_perp), _observation(reference), strict=True)
    seen = [(B @ model.phi[:, :m], other[:, :m]) for B, other in rows]
    own, other = (np.vstack(part) for part in zip(*seen, strict=True))
    sizes = np.linalg.norm(own, axis=0) * np.linalg.norm(other, axis=0)
    correlation = np.einsum("ij,ij->j", own, other) / np.maximum(sizes, 1e-300)
    first_odd = int(np.argmax(np.abs(correlation) < SAME_MODE))
    m = first_odd if np.abs(correlation[first_odd]) < SAME_MODE else m
    if m == 0:
        raise ModelError("the hybrid model does not have the modes of the modal representation")
    return np.sign(correlation[:m])


def _observation(reference: ReferenceModes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    system = reference.system
    return system.N, system.T1, system.T2


def _hybrid_point(
    task: BatchTask, model: HybridModel, m: int, chosen: DesignPoint, point: MotionPoint
) -> MotionPoint:
    """The design point in coordinates of the hybrid model, which has the first m modes too.

    With the damping of the modal representation.
    """
    state = chosen.state()
    if point.s is not None and point.s.any():
        raise ConvergenceError(
            "parameter", "the hybrid representation has no frequency_scale of component modes"
        )
    beta, shapes = state.stiffness_damping, model.phi[:, :m]
    zeta = state.assembly_damping_ratios(len(model.omega)) + 0.5 * beta * model.omega
    q0, v0 = (shapes @ x[:m] for x in point.start(task.reference.system.n))
    if task.start is not None:
        q, v = task.start.read()
        q0, v0 = q0 + q, v0 + v
    watching = point.growing.sensors[:, :m] @ model.sensors[:m]
    return replace(
        point,
        c=2.0 * zeta * model.omega,
        beta=beta + state.damping_ratio / (np.pi * model.damping_cutoff),
        q0=q0,
        v0=v0,
        growing=replace(point.growing, sensors=watching),
    )
