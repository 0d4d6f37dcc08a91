"""Sensitivities to materials, springs and loads: full-order vectors, the working point moving.

A structural parameter changes the assembled matrices, so its derivative is projected on right and
left vectors of the unreduced assembly; each chosen mode is found there beside its reduced root.
The finite change is that of the assembly built anew, with its own working point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.analysis.sensitivity.assembly_change import Build, assembly_change, check_same_mesh
from squealstudy.analysis.sensitivity.finite_change import FiniteChange, followed_root
from squealstudy.analysis.sensitivity.full_order_point import (
    FullOrderPoint,
    solved_full_order_point,
)
from squealstudy.analysis.sensitivity.mode_family import ModeFamily, mode_family
from squealstudy.analysis.sensitivity.mode_sensitivities import (
    Sensitivity,
    Step,
    slope_and_validity,
)
from squealstudy.analysis.sensitivity.reduced import DesignPoint
from squealstudy.analysis.sensitivity.reduced_gradient import StateDerivatives
from squealstudy.analysis.sensitivity.structural_gradient import StaticResponse, StructuralGradient
from squealstudy.errors import SquealstudyError


@dataclass(frozen=True)
class Structure:
    """How the assembly of a design point is built, and what its bases keep.

    Attributes
    ----------
    build : callable
        (values of all the model's parameters) -> Assembly.
    values : mapping of name -> float
        At the design point.
    component_cutoff_hz, damped_to_hz : float
        Component modes that the design may change; assembly modes that carry modal damping.
    """

    build: Build
    values: Mapping[str, float]
    component_cutoff_hz: float
    damped_to_hz: float


def check_structural(structure: Structure, names: Sequence[str]) -> None:
    """Raise ParameterError for the first parameter that moves the mesh."""
    base = structure.build(structure.values)
    for name in names:
        step = 1e-4 * (abs(structure.values[name]) or 1.0)
        check_same_mesh(
            name, base, structure.build({**structure.values, name: structure.values[name] + step})
        )


def structural_sensitivities(
    design: DesignPoint, structure: Structure, names: Sequence[str], change: float
) -> list[list[Sensitivity]]:
    """Sensitivities of every chosen mode of a design point, one list a mode.

    Parameters
    ----------
    names : sequence of str
        Structural parameters that leave the mesh as it is.
    change : float
        Finite change, relative to the value (absolute where that is zero).

    Raises
    ------
    ParameterError
        A parameter that moves the mesh.
    ConvergenceError
        Where ARPACK does not converge.
    """
    found: list[list[Sensitivity]] = [[] for _ in design.families]
    if not design.families or not names:
        return found
    cutoffs = structure.component_cutoff_hz, structure.damped_to_hz
    assembly = structure.build(structure.values)
    full = FullOrderPoint.at(assembly, design.state, design.point, *cutoffs)
    families = [mode_family(full.pencil, complex(f.lam[0])) for f in design.families]
    gradients = [StructuralGradient(full, family) for family in families]
    k_c = design.prepared.space.k_c
    motion = StateDerivatives(design.prepared, design.state, design.point).motion
    response = StaticResponse(full, motion, k_c)
    for name in names:
        step = structural_step(name, structure.values[name], change)
        by = assembly_change(structure.build, structure.values, name, design.state, cutoffs[0])
        contact = response.change(by)
        finite, reason = _reanalysis(design, structure, full, families, step)
        for number, (family, gradient) in enumerate(zip(families, gradients, strict=True)):
            products = gradient.products(by, contact)
            slope = slope_and_validity(family, products, step.size)
            found[number].append(Sensitivity(step, *slope, finite[number], reason))
    return found


def structural_step(name: str, value: float, change: float) -> Step:
    """The finite change of a structural parameter."""
    reference = abs(value) or 1.0
    return Step(name, value, reference, change * reference)


def _reanalysis(
    design: DesignPoint,
    structure: Structure,
    full: FullOrderPoint,
    families: Sequence[ModeFamily],
    step: Step,
) -> tuple[list[FiniteChange | None], str]:
    """The same modes in the assembly built with the changed value, or why there are none."""
    try:
        assembly = structure.build({**structure.values, step.name: step.value + step.size})
        changed = solved_full_order_point(
            assembly,
            design.state,
            design.prepared.space.k_c,
            np.asarray(design.point.gap),
            structure.component_cutoff_hz,
            structure.damped_to_hz,
        )
        return [followed_root(full.pencil, f, changed.pencil) for f in families], ""
    except SquealstudyError as error:
        return [None] * len(families), str(error)
