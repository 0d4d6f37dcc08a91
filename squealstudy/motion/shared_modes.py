"""The reduced assembly in the modes of a reference working point, and smaller bases of them.

It is one model for the time and the frequency domain. A smaller modal system has the assembly modes
up to a frequency, and POD vectors of a run beside them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ParameterError
from squealstudy.models.operating import DesignState, ModeKey
from squealstudy.motion.assembly_damping import AssemblyDamping
from squealstudy.motion.system import ModalSystem
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.energies import reduced_energy_shares
from squealstudy.system.linearise import component_frequencies, linearise

# energy norm of the part of a unit-energy mode outside the retained modes that is worth a vector
MIN_NEW_DIRECTION = 1e-3


@dataclass(frozen=True)
class SharedModes:
    """Component-mode coordinates diagonalised at a reference working point.

    Attributes
    ----------
    system : ModalSystem
        The modal system for time integration; its state is the deviation from steady sliding at the
        reference.
    phi : ndarray (n, n)
        Modes in component-mode coordinates, M-orthonormal.
    C, K : ndarray (n, n)
        Linearised damping and stiffness of the same reference in modal coordinates, from which
        complex modes are computed.
    energies : ndarray (n_components + 1, n)
        Share of each component, then of the interfaces, in the elastic energy of each mode.
    n_exact : int
        Number of leading coordinates that are assembly modes: n unless the basis was reduced.
    damping : AssemblyDamping
        The damping of design points at their working points.
    component_modes : tuple of (component, mode)
        Component modes that design points may change, as rows of `system.shapes`.
    component_frequencies : mapping of (component, mode) -> float
        Free-free angular frequency of every component mode of the reduced assembly, rad/s.
    load : ndarray (n,)
        Modal load by a brake pressure of 1 Pa; empty where it is not known.
    """

    system: ModalSystem
    phi: np.ndarray
    C: np.ndarray
    K: np.ndarray
    energies: np.ndarray
    n_exact: int
    damping: AssemblyDamping
    component_modes: tuple[ModeKey, ...]
    component_frequencies: Mapping[ModeKey, float]
    load: np.ndarray = field(default_factory=lambda: np.zeros(0))


def shared_modes(
    model: ReducedModel,
    point: WorkingPoint,
    state: DesignState,
    component_modes: tuple[ModeKey, ...] = (),
) -> SharedModes:
    """Diagonalise the reduced assembly with the contact tangents of a working point.

    Parameters
    ----------
    model : ReducedModel
    point : WorkingPoint
        Working point of `state`.
    state : DesignState
        The reference design. Its friction and damping enter C and K only; design points have their
        own.
    component_modes : tuple of (component, mode)
        Component modes that design points damp or shift: rows of `system.shapes`, exact in these
        coordinates.
    """
    tangent = linearise(model, point, state, in_time=True)
    omega2, phi = la.eigh(tangent.K_sym)
    rows = [model.mode_coordinate(*key) for key in component_modes]
    system = ModalSystem(
        omega2=omega2,
        N=model.N @ phi,
        T1=model.T @ phi,
        T2=model.T_perp @ phi,
        area=model.area,
        frictional=model.frictional,
        radius=model.radius,
        gap=point.gap,
        k_ref=model.area * point.tangent,
        force=point.forces(model, state.operating),
        shapes=phi[rows],
        speed_factor=model.speed_factor,
        spring_points=model.spring_points,
        own_friction=model.own_friction,
    )
    damping = AssemblyDamping(
        omega2=omega2,
        N=system.N,
        k_ref=system.k_ref,
        shapes=system.shapes,
        own=None if model.C_el is None else phi.T @ model.C_el @ phi,
        damped_to=model.damped_to,
        n_exact=len(omega2),
        turning=None if model.turning is None else phi.T @ model.turning @ phi,
        unturned=model.unturned,
    )
    return SharedModes(
        system=system,
        phi=phi,
        C=phi.T @ tangent.C @ phi,
        K=phi.T @ tangent.K @ phi,
        energies=reduced_energy_shares(model, tangent.weights, phi),
        n_exact=len(omega2),
        damping=damping,
        component_modes=component_modes,
        component_frequencies=component_frequencies(model),
        load=model.load @ phi if len(model.load) else model.load,
    )


@dataclass(frozen=True)
class Training:
    """Motion with all modes, from which a truncated basis gets further vectors.

    Attributes
    ----------
    snapshots : ndarray (rows, n)
        Modal displacements of runs with all modes.
    modes : ndarray (n, m) complex
        Right vectors of the growing modes of their designs, in the same coordinates.
    """

    snapshots: np.ndarray
    modes: np.ndarray


def n_modes_below(reference: SharedModes, below_hz: float) -> int:
    """Number of assembly modes up to a frequency; ParameterError where there is none."""
    count = int((reference.system.omega2 <= (2 * np.pi * below_hz) ** 2).sum())
    if count == 0:
        raise ParameterError("modes_below", f"no assembly mode lies below {below_hz:g} Hz")
    return count


def truncated(reference: SharedModes, below_hz: float) -> SharedModes:
    """A modal system of the assembly modes up to `below_hz` alone.

    Raises
    ------
    ParameterError
        Where there is none.
    """
    return project(reference, np.eye(reference.system.n)[:, : n_modes_below(reference, below_hz)])


def with_pod(
    reference: SharedModes, below_hz: float, training: Training, count: int
) -> SharedModes:
    """The assembly modes up to `below_hz`, and vectors of training motion in the other modes.

    Parameters
    ----------
    reference : SharedModes
        All modes.
    below_hz : float
    training : Training
    count : int
        Number of vectors: those of growing modes, then POD vectors of the rest of the snapshots;
        fewer where the rank of training is less.

    Notes
    -----
    Displacements are weighted by the modes' frequencies, so that squares of singular values are
    energies. The vectors are turned so that their stiffness is diagonal. Their damping is that of
    the full model, projected (`AssemblyDamping.on`), and not diagonal.
    """
    n, k = reference.system.n, n_modes_below(reference, below_hz)
    omega = reference.system.frequencies[k:]
    growing = _growing(reference, training.modes, k)[:, :count]
    weighted = training.snapshots[:, k:] * omega
    beyond_growing = weighted - (weighted @ growing) @ growing.T
    _, values, right_vectors = la.svd(beyond_growing, full_matrices=False)
    round_off = la.norm(weighted, 2) * np.finfo(float).eps * max(weighted.shape)
    rank = int((values > round_off).sum())
    pod = right_vectors[: min(count - growing.shape[1], rank)].T
    V, _ = la.qr(np.hstack([growing, pod]) / omega[:, None], mode="economic")
    _, turn = la.eigh(V.T @ (reference.system.omega2[k:, None] * V))
    basis = np.zeros((n, k + V.shape[1]))
    basis[np.arange(k), np.arange(k)] = 1.0
    basis[k:, k:] = V @ turn
    return project(reference, basis)


def _growing(reference: SharedModes, modes: np.ndarray, k: int) -> np.ndarray:
    """Energy-orthonormal vectors (n - k, r): parts of unit-energy modes outside the first k.

    Modes of neighbouring designs are nearly alike: the vectors hold their common part once.
    """
    weighted = reference.system.frequencies[:, None] * modes
    weighted = weighted / np.linalg.norm(weighted, axis=0)
    beyond = np.hstack([weighted[k:].real, weighted[k:].imag])
    vectors, values, _ = np.linalg.svd(beyond, full_matrices=False)  # of no modes too
    directions: np.ndarray = vectors[:, values > MIN_NEW_DIRECTION]
    return directions


def project(reference: SharedModes, basis: np.ndarray) -> SharedModes:
    """The reference projected on orthonormal columns `basis` (n, r), assembly modes first.

    The projected stiffness has to be diagonal.
    """
    system = reference.system
    exact = int((np.abs(basis).max(axis=0) == 1.0).cumprod().sum())
    K = basis.T @ (system.omega2[:, None] * basis)
    smaller = replace(
        system,
        omega2=np.diag(K).copy(),
        N=system.N @ basis,
        T1=system.T1 @ basis,
        T2=system.T2 @ basis,
        shapes=system.shapes @ basis,
    )
    return replace(
        reference,
        system=smaller,
        phi=reference.phi @ basis,
        load=reference.load @ basis if len(reference.load) else reference.load,
        C=basis.T @ reference.C @ basis,
        K=basis.T @ reference.K @ basis,
        energies=reference.energies[:, :exact],
        n_exact=exact,
        damping=reference.damping.on(basis, exact),
    )
