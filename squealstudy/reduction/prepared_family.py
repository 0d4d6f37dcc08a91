"""A family of matrices made ready for design points: a basis to compare mode shapes in."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from squealstudy.linalg.band_roots import FIRST_ROOTS, roots_in_band
from squealstudy.models.matrices.family import MatrixFamily

BAND_FACTOR = 1.1  # shapes a little beyond the band: modes that a sweep moves into it
SHAPE_TOLERANCE = 1e-2  # relative singular value of nominal shapes that are kept apart
MARGIN = 1.08  # of the number of roots asked for first


@dataclass(frozen=True)
class PreparedFamily:
    """A family and what its design points share.

    Attributes
    ----------
    model : MatrixFamily
    scale : ndarray (n,)
        Square root of the nominal mass matrix' diagonal: it puts displacements and rotations in
        one unit.
    shape_basis : ndarray (n, k)
        Orthonormal columns that span the real and imaginary parts of the scaled mode shapes at the
        nominal point; shapes of all points are compared by their coordinates on it.
    n_roots : int
        Roots to ask for first at a design point, conjugates counted.
    timings : mapping of stage -> seconds
    """

    model: MatrixFamily
    scale: np.ndarray
    shape_basis: np.ndarray
    n_roots: int
    timings: Mapping[str, float] = field(default_factory=dict)

    def shapes(self, psi: np.ndarray) -> np.ndarray:
        """Unit coordinates (m, k) complex64 of mode shapes (n, m) on the shape basis."""
        seen = (self.shape_basis.T @ (self.scale[:, None] * psi)).T
        seen /= np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-300)
        return seen.astype(np.complex64)


def prepare_family(
    family: MatrixFamily, nominal: Mapping[str, float], band: tuple[float, float]
) -> PreparedFamily:
    """Solve the nominal point and take its shapes as the basis.

    Parameters
    ----------
    family : MatrixFamily
    nominal : mapping of parameter -> value
    band : (low, high)
        rad/s.

    Raises
    ------
    ModelError
        A coefficient that has no value there.
    ConvergenceError
        No roots, or none with a small residual.
    """
    started = time.perf_counter()
    M, C, K = family.matrices(nominal)
    roots = roots_in_band(M, C, K, (band[0], BAND_FACTOR * band[1]))
    scale = _scale(M.diagonal())
    beyond = roots.lam[np.abs(roots.lam) > band[1]]
    inside = roots.n_below - len(beyond) - int((beyond.imag > 0).sum())
    first = min(max(int(MARGIN * inside), FIRST_ROOTS), 2 * family.n)
    basis = shape_basis(scale[:, None] * roots.psi)
    return PreparedFamily(
        model=family,
        scale=scale,
        shape_basis=basis,
        n_roots=first,
        timings={"nominal_s": time.perf_counter() - started},
    )


def shape_basis(psi: np.ndarray) -> np.ndarray:
    """Orthonormal columns (n, k) that span the real and imaginary parts of shapes (n, m).

    Without shapes, the first coordinate stands for all.
    """
    if not psi.shape[1]:
        return np.eye(len(psi), 1)
    unit = psi / np.maximum(np.linalg.norm(psi, axis=0), 1e-300)
    U, s, _ = np.linalg.svd(np.hstack([unit.real, unit.imag]), full_matrices=False)
    basis: np.ndarray = U[:, s > SHAPE_TOLERANCE * s[0]]
    return basis


def _scale(diagonal: np.ndarray) -> np.ndarray:
    """Square root of the moduli, 1 for all where the diagonal vanishes."""
    size: np.ndarray = np.sqrt(np.abs(diagonal))
    return size if size.any() else np.ones(len(diagonal))
