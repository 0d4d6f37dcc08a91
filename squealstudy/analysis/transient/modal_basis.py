"""Smaller modal systems: assembly modes up to a frequency, and POD vectors of a run beside them.

Truncation keeps growth rates and spoils the level of a limit cycle; POD vectors of a run repair
the level near that run (theory.md section 6). They live in the span of the truncated modes, so
the kept modes stay exact and uncoupled.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.transient.reference_modes import ReferenceModes
from squealstudy.errors import ParameterError

COUPLED = 1e-3  # of the largest damping: coupling below it is left out


def kept_modes(reference: ReferenceModes, below_hz: float) -> int:
    """Number of assembly modes up to a frequency; ParameterError where there is none."""
    count = int((reference.system.omega2 <= (2 * np.pi * below_hz) ** 2).sum())
    if count == 0:
        raise ParameterError("modes_below", f"no assembly mode lies below {below_hz:g} Hz")
    return count


def truncated(reference: ReferenceModes, below_hz: float) -> ReferenceModes:
    """The assembly modes up to `below_hz` alone.

    Raises
    ------
    ParameterError
        Where there is none.
    """
    return project(reference, np.eye(reference.system.n)[:, : kept_modes(reference, below_hz)])


def with_pod(
    reference: ReferenceModes, below_hz: float, snapshots: np.ndarray, count: int
) -> ReferenceModes:
    """The assembly modes up to `below_hz`, and POD vectors of what a run did beyond them.

    Parameters
    ----------
    reference : ReferenceModes
        All modes.
    below_hz : float
    snapshots : ndarray (rows, n)
        Modal displacements of a run.
    count : int
        POD vectors; fewer where the snapshots have no more.

    Notes
    -----
    Snapshots are weighted by the modes' frequencies, so that singular values are energies. The
    vectors are turned so that their stiffness is diagonal; their damping is that of the full
    model, so not diagonal, and enters by shapes.
    """
    n, k = reference.system.n, kept_modes(reference, below_hz)
    omega = np.sqrt(np.maximum(reference.system.omega2[k:], 0.0))
    weighted = snapshots[:, k:] * omega
    _, values, right = la.svd(weighted, full_matrices=False)
    rank = int((values > values[0] * np.finfo(float).eps * max(weighted.shape)).sum())
    vectors = right[: min(count, rank)].T / omega[:, None]
    V, _ = la.qr(vectors, mode="economic")
    _, turn = la.eigh(V.T @ (reference.system.omega2[k:, None] * V))
    basis = np.zeros((n, k + V.shape[1]))
    basis[np.arange(k), np.arange(k)] = 1.0
    basis[k:, k:] = V @ turn
    return project(reference, basis)


def project(reference: ReferenceModes, basis: np.ndarray) -> ReferenceModes:
    """The reference on orthonormal columns `basis` (n, r), assembly modes first among them.

    The stiffness must be diagonal on them.
    """
    system = reference.system
    exact = int((np.abs(basis).max(axis=0) == 1.0).cumprod().sum())
    K = basis.T @ (system.omega2[:, None] * basis)
    G = basis.T @ (reference.rates[:, None] * basis)
    coupling, turn = la.eigh(G - np.diag(np.diag(G)))
    kept = np.abs(coupling) > COUPLED * np.abs(G).max()
    rows = turn[:, kept].T
    smaller = replace(
        system,
        omega2=np.diag(K).copy(),
        N=system.N @ basis,
        T1=system.T1 @ basis,
        T2=system.T2 @ basis,
        shapes=np.vstack([system.shapes @ basis, rows]),
        sensors=system.sensors @ basis,
    )
    return replace(
        reference,
        system=smaller,
        phi=reference.phi @ basis,
        C=basis.T @ reference.C @ basis,
        K=basis.T @ reference.K @ basis,
        energies=reference.energies[:, :exact],
        n_exact=exact,
        rates=np.diag(G).copy(),
        coupling=coupling[kept],
    )
