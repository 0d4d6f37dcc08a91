"""Elastic energy of a mode shape, shared among components and interfaces."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.linearise import ReducedSystem
from squealstudy.reduction.cmt import ReducedModel


def energy_shares(model: ReducedModel, system: ReducedSystem, psi: np.ndarray) -> np.ndarray:
    """Share of each component, then of the interfaces, in psi^H K_sym psi.

    Parameters
    ----------
    psi : ndarray (n, m) complex
        Mode shapes in reduced coordinates.

    Returns
    -------
    ndarray (n_components + 1, m)
        Columns sum to one; friction does no elastic work and is left out.
    """
    by_coordinate = system.k_el[:, None] * np.abs(psi) ** 2
    parts = np.add.reduceat(by_coordinate, model.offsets[:-1], axis=0)
    total = np.einsum("im,im->m", psi.conj(), system.K_sym @ psi).real
    total = np.maximum(total, 1e-300)
    shares = np.vstack([parts, total - parts.sum(axis=0)]) / total
    return shares
