"""Sensitivities of complex modes to parameters, each checked by solving a changed model.

With right and left vectors x and y of (lambda^2 M + lambda C + K) x = 0,

    d lambda/d theta = -y^H (lambda^2 dM + lambda dC + dK) x / (y^H (2 lambda M + C) x).

The working point moves with the parameter, and the matrices with it: dM, dC, dK are total
derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.models.operating import DAMPING, DesignState, ModeKey
from squealstudy.modes.point import linearised_point
from squealstudy.modes.sensitivity.mode_family import (
    ModeNeighbourhood,
    biorthogonality,
    mode_family,
)
from squealstudy.modes.sensitivity.mode_gradient import ModeGradient, RealModes
from squealstudy.modes.sensitivity.mode_sensitivities import (
    ModeSensitivities,
    Sensitivity,
    Step,
    followed_roots,
    slope_and_validity,
)
from squealstudy.modes.sensitivity.state_derivatives import StateDerivatives, StateParameter
from squealstudy.reduction.prepared import PreparedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.root_pairs import angular_band
from squealstudy.system.energies import reduced_energy_shares
from squealstudy.system.linearise import LinearisedModel, component_frequencies


@dataclass(frozen=True)
class ChosenModes:
    """Chosen complex modes of a reduced design point, from which all sensitivities are computed."""

    prepared: PreparedModel
    state: DesignState
    point: WorkingPoint
    system: LinearisedModel
    families: tuple[ModeNeighbourhood, ...]


def solve_families(
    prepared: PreparedModel,
    state: DesignState,
    band_hz: tuple[float, float],
    choice: ModeChoice,
    gap: np.ndarray | None = None,
) -> ChosenModes:
    """Working point, chosen complex modes, their left vectors and neighbours.

    Parameters
    ----------
    gap : ndarray (nc,) or None
        Known gaps of the working point.

    Raises
    ------
    ConvergenceError
        There is no working point, or ARPACK does not converge.
    """
    point, system = linearised_point(prepared, state, gap)
    lam, _ = dense_roots(system.C, system.K, angular_band(band_hz))
    families = tuple(mode_family(system.pencil, root) for root in chosen_roots(lam, choice))
    return ChosenModes(
        prepared=prepared, state=state, point=point, system=system, families=families
    )


def point_sensitivities(
    design: ChosenModes,
    parameters: Sequence[StateParameter],
    change: float,
    top_hz: float,
    reanalysis: bool = True,
) -> tuple[ModeSensitivities, ...]:
    """Sensitivities of the chosen modes of a design point to parameters of its state.

    Parameters
    ----------
    change : float
        Finite change, relative to each parameter's reference.
    top_hz : float
        Top of the band, Hz: it gives the reference of stiffness damping that is zero.
    reanalysis : bool
        Whether the model is also solved with the finite change, to check each derivative.
    """
    omega = component_frequencies(design.prepared.model)
    steps = [parameter_step(p, design.state, omega, change, top_hz) for p in parameters]
    sensitivities: list[list[Sensitivity]] = [[] for _ in design.families]
    derivatives = StateDerivatives(design.prepared, design.state, design.point)
    gradients = _gradients(design, derivatives, parameters)
    for parameter, step in zip(parameters, steps, strict=True):

        def changed(
            parameter: StateParameter = parameter, value: float = step.value + step.size
        ) -> QuadraticPencil:
            changed_state = parameter.moved(design.state, value)
            return linearised_point(design.prepared, changed_state, design.point.gap)[1].pencil

        finite, reason = followed_roots(
            design.system.pencil, design.families, changed if reanalysis else None
        )
        by = derivatives.by(parameter)
        for number, (family, gradient) in enumerate(zip(design.families, gradients, strict=True)):
            products = gradient.products(*by)
            sensitivities[number].append(
                Sensitivity(
                    step,
                    *slope_and_validity(family, products, step.size),
                    finite[number],
                    reason,
                )
            )
    return tuple(
        ModeSensitivities(family, *facts, tuple(of_mode))
        for family, facts, of_mode in zip(
            design.families, _mode_facts(design), sensitivities, strict=True
        )
    )


def parameter_step(
    parameter: StateParameter,
    state: DesignState,
    omega: Mapping[ModeKey, float],
    change: float,
    top_hz: float,
) -> Step:
    """The finite change of a parameter: upwards, or downwards where upwards leaves its range."""
    parameter_value = parameter.value(state)
    reference = parameter.reference(parameter_value, top_hz)
    size = change * reference
    return Step(
        name=parameter.name,
        value=parameter_value,
        reference=reference,
        size=size if parameter_value + size <= parameter.maximum else -size,
        component_hz=parameter.component_hz(state, omega),
    )


def _gradients(
    design: ChosenModes, derivatives: StateDerivatives, parameters: Sequence[StateParameter]
) -> list[ModeGradient]:
    """Gradients of the chosen modes; with real modes where modal damping may change."""
    needs_damping = any(p.name == DAMPING.name or (p.modes and not p.component) for p in parameters)
    zeta, real = design.state.assembly_damping_ratios(design.prepared.model.n), None
    if design.families and (needs_damping or zeta.any()):
        w2, phi = design.system.real_modes
        real = RealModes(w2, phi, momenta=phi, zeta=zeta, N=derivatives.structure.N)
    return [ModeGradient(family, derivatives.structure, real) for family in design.families]


def _mode_facts(design: ChosenModes) -> list[tuple[float, np.ndarray]]:
    """Facts of each chosen mode: its largest biorthogonality product, and its energy shares."""
    if not design.families:
        return []
    products = biorthogonality(design.system.pencil, design.families)
    np.fill_diagonal(products, 0.0)
    X = np.hstack([family.X[:, :1] for family in design.families])
    energies = reduced_energy_shares(design.prepared.model, design.system.weights, X)
    return list(zip(products.max(axis=1).tolist(), energies.T, strict=True))


@dataclass(frozen=True)
class ModeChoice:
    """All unstable modes, a number of modes by growth, or those nearest given frequencies.

    Attributes
    ----------
    count : int or None
        The modes of largest growth rate; None for all unstable ones.
    frequencies_hz : tuple of float
        If there are any, the modes whose |lambda| / 2 pi are nearest to these are chosen.
    stability_tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """

    count: int | None = None
    frequencies_hz: tuple[float, ...] = ()
    stability_tolerance: float = 0.0


def chosen_roots(lam: np.ndarray, choice: ModeChoice) -> list[complex]:
    """The chosen roots of a band, largest growth first; real roots are never chosen."""
    modes = lam[lam.imag > 0]
    if choice.frequencies_hz and len(modes):
        distance = np.abs(np.abs(modes)[:, None] / (2 * np.pi) - np.array(choice.frequencies_hz))
        modes = modes[np.unique(distance.argmin(axis=0))]
    elif choice.count is None:
        modes = modes[modes.real / np.abs(modes) > choice.stability_tolerance]
    by_growth = modes[np.argsort(-modes.real, kind="stable")]
    return [complex(root) for root in by_growth[: choice.count]]
