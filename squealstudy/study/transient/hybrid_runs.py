"""Design points in the hybrid representation (THEORY.md eq. (80)): the modal one's reference.

Forecast and start are those of the modal representation, mapped on the assembly modes that both
have; damping is the same on these.
"""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from squealstudy.analysis.hybrid.run import simulate_hybrid
from squealstudy.analysis.hybrid.system import HybridDesign
from squealstudy.analysis.point import state_working_point
from squealstudy.analysis.runs.modal_run import ModalRun
from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.errors import ConvergenceError, ModelError
from squealstudy.reduction.cmt import component_modes
from squealstudy.reduction.hybrid import HybridModel, HybridSettings, hybrid_model
from squealstudy.study.cache import prepared_path
from squealstudy.study.files import write_atomic
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.study.transient.batch import BatchTask, sampling, sensed_modes, settings_of
from squealstudy.study.transient.modal_runs import Finished
from squealstudy.study.transient.ready import Ready
from squealstudy.study.working_points import prepared_model
from squealstudy.system.design_state import DesignState
from squealstudy.system.linearise import component_frequencies

SAME_MODE = 0.99  # correlation of the contact observation of one mode in both representations


def hybrid_runs(
    task: BatchTask, reference: ReferenceModes, ready: Sequence[Ready]
) -> list[Finished]:
    """Integrate design points one by one; final states are in hybrid coordinates.

    Raises
    ------
    ModelError
        Modes of the two representations that do not correspond.
    """
    model = _model(task)
    signs = common_modes(reference, model)
    return [_run(task, reference, model, signs, one) for one in ready]


def _model(task: BatchTask) -> HybridModel:
    """The hybrid model of the batch's structure, from the cache or made now."""
    key = task.points[0].prepared_key
    layers = task.section.layers
    content = [task.cutoff_hz, layers, task.component_modes, repr(task.operating)]
    name = content_hash([source_hash(), *content])
    path = prepared_path(key) / "hybrid" / f"{name}.pickle"
    if path.is_file():
        with path.open("rb") as handle:
            known: HybridModel = pickle.load(handle)
            return known
    made = _build(task, HybridSettings(task.cutoff_hz, task.cutoff_hz, layers))
    write_atomic(path, lambda temporary: _dump(made, temporary))
    return made


def _dump(model: HybridModel, path: Path) -> None:
    with path.open("wb") as handle:
        pickle.dump(model, handle)


def _build(task: BatchTask, settings: HybridSettings) -> HybridModel:
    first = task.points[0]
    design, prepared = first.design, prepared_model(first.prepared_key)
    assembly = design.model.build(dict(task.options), design.plain_values())
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


def _design(task: BatchTask, model: HybridModel, one: Ready) -> HybridDesign:
    """The design point with the damping of the modal representation."""
    state, modal = one.task.design.state(), one.point.design
    if any(scale != 1.0 for scale in state.frequency_scale.values()):
        raise ConvergenceError(
            "parameter", "the hybrid representation has no frequency_scale of component modes"
        )
    omega = component_frequencies(prepared_model(one.task.prepared_key).model)
    dampers = state.modal_dampers(omega)
    beta = state.stiffness_damping
    zeta = state.assembly_damping_ratios(len(model.omega)) + 0.5 * beta * model.omega
    return HybridDesign(
        modal.contact,
        modal.friction,
        modal.speed,
        zeta,
        beta + state.damping_ratio / (np.pi * model.damping_cutoff),
        np.array([dampers.get(key, 0.0) for key in task.component_modes]),
        modal.gap,
        modal.force,
    )


def _run(
    task: BatchTask, reference: ReferenceModes, model: HybridModel, signs: np.ndarray, one: Ready
) -> Finished:
    m = len(signs)
    amplitudes = signs[:, None] * model.sensors[:m]
    modes = sensed_modes(task.section, reference.system.omega2[:m], task.band_hz)
    growth = one.point.sensor_rows[:, :m]
    q0, v0 = (model.phi[:, :m] @ (signs * x[:m]) for x in (one.q0, one.v0))
    if task.start is not None:
        q, v = task.start.read()
        q0, v0 = q0 + q, v0 + v
    settings = settings_of(task.section, sampling(task.section, task.band_hz))
    sensors = np.vstack([amplitudes[modes - 1], growth @ amplitudes])
    result = simulate_hybrid(model, _design(task, model, one), settings, q0, v0, sensors)
    k = len(modes)
    run = ModalRun(
        result,
        one.point,
        modes,
        np.sqrt(np.maximum(reference.system.omega2[modes - 1], 0.0)),
        result.displacement[:, :k],
        result.velocity[:, :k],
        result.displacement[:, k:],
        result.velocity[:, k:],
        task.start is not None,
    )
    return Finished(run, result.q, result.v, model.n)
