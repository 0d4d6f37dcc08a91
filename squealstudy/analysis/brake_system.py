"""The reduced brake as a parametric system: its terms, and their weights at a design point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from squealstudy.analysis.linearise import component_frequencies
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState
from squealstudy.system.parametric import (
    DAMPING,
    MASS,
    STIFFNESS,
    ParametricSystem,
    Term,
    Weights,
)


def brake_system(model: ReducedModel, modal_damping: Sequence[np.ndarray] = ()) -> ParametricSystem:
    """Terms of a component-mode model (theory.md section 1), stiffness damping beside stiffness.

    Parameters
    ----------
    model : ReducedModel
    modal_damping : sequence of ndarray (n, n)
        Matrices of the assembly's modal damping; their weights follow those of `brake_weights`.
    """
    one, springs = None, model.K_springs
    terms = (
        Term(MASS),
        Term(STIFFNESS),  # elastic diagonal with the component changes
        Term(STIFFNESS, one, springs),
        Term(STIFFNESS, model.N, model.N),
        Term(STIFFNESS, model.T, model.N),
        Term(DAMPING),  # component dampers, beta times the elastic diagonal
        Term(DAMPING, one, springs),
        Term(DAMPING, model.N, model.N),
        Term(DAMPING, model.T_perp, model.T_perp),
        Term(DAMPING, model.T, model.T),
    )
    more = tuple(Term(DAMPING, one, A) for A in modal_damping)
    return ParametricSystem(model.n, terms + more)


def brake_weights(model: ReducedModel, point: WorkingPoint, state: DesignState) -> Weights:
    """Weights of `brake_system` at a working point, without those of modal damping."""
    omega = component_frequencies(model)
    k_el = np.array(model.k_el)
    for key, change in state.stiffness_changes(omega).items():
        k_el[model.mode_coordinate(*key)] += change
    operating, beta = state.operating, state.stiffness_damping
    dampers = beta * k_el
    for key, c in state.modal_dampers(omega).items():
        dampers[model.mode_coordinate(*key)] += c
    k_n = model.area * point.tangent
    normal = model.area * point.pressure * model.frictional
    mu, slope = operating.mu_steady, operating.friction_slope
    return (
        1.0,
        k_el,
        1.0,
        k_n,
        -mu * model.frictional * k_n,
        dampers,
        beta,
        beta * k_n if beta else 0.0,
        (mu / operating.sliding_speed) * normal,
        slope * normal if slope else 0.0,
    )


def symmetric_stiffness(model: ReducedModel, weights: Weights) -> np.ndarray:
    """Elastic, spring and contact stiffness (n, n), without friction."""
    K: np.ndarray = model.K_springs + model.N.T @ (weights[3][:, None] * model.N)
    K[np.diag_indices_from(K)] += weights[1]
    return K
