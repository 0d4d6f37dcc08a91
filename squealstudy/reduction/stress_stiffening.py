"""Stress stiffness of an assembly in steady sliding (THEORY.md eq. (114))."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.linalg.factor import factorise
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.linear_interfaces import StressStiffness
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.prepared import mean_contact_stiffness
from squealstudy.reduction.working_point import WorkingPoint, working_point


def stress_stiffness_of(
    assembly: Assembly, operating: OperatingPoint, meshes: Mapping[str, SolidMesh]
) -> StressStiffness:
    """Stress stiffness of an assembly at the working point of an operating point.

    Parameters
    ----------
    assembly : Assembly
    operating : OperatingPoint
    meshes : mapping of component -> SolidMesh
        Meshes of the components whose stresses count.

    Raises
    ------
    ConvergenceError
        There is no steady sliding at the operating point, or some motion is free.
    """
    nothing = np.zeros((assembly.n_dof, 0))
    space = contact_space(assembly, mean_contact_stiffness(assembly, operating), nothing)
    point = working_point(space, operating)
    return stress_term(assembly, meshes, sliding_displacement(assembly, space, point, operating))


def sliding_displacement(
    assembly: Assembly, space: ContactSpace, point: WorkingPoint, operating: OperatingPoint
) -> np.ndarray:
    """Displacement (n_dof,) [m] of steady sliding from the unloaded assembly.

    Parameters
    ----------
    assembly : Assembly
    space : ContactSpace
        Contact space of the assembly.
    point : WorkingPoint
        Working point at `operating`.
    operating : OperatingPoint
    """
    c = assembly.contact
    k_c = space.k_c * c.area
    K0 = assembly.K_el + assembly.K_springs(static=True) + c.N.T @ sp.diags(k_c) @ c.N
    normal, drag, _ = point.forces(c, operating).T
    load = operating.brake_pressure * assembly.load + assembly.constant_load
    load = load + c.N.T @ (normal + k_c * (point.gap - c.gap0)) + c.T.T @ drag
    return factorise(K0.tocsr(), definite=True).solve(load)


def stress_term(
    assembly: Assembly, meshes: Mapping[str, SolidMesh], u: np.ndarray
) -> StressStiffness:
    """Stiffness by the stresses of a displacement u (n_dof,) [m] in the meshed components."""
    # imported here: it needs scikit-fem, which is slow to load
    from squealstudy.models.components.stress_stiffness import stress_stiffness

    displacements, blocks = assembly.at_nodes(u), []
    for component in assembly.components:
        n = component.n_dof
        if component.name in meshes:
            node_motion = displacements[assembly.node_slices[component.name]]
            K = stress_stiffness(meshes[component.name], node_motion)
            blocks.append(component.restricted(K))
        else:
            blocks.append(sp.csr_matrix((n, n)))
    return StressStiffness(sp.block_diag(blocks, format="csr"))
