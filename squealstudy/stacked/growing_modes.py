"""The complex modes by which the growth of a batch of runs is measured, from stacked LAPACK calls.

`motion.growing_modes` computes the same for one design point of a model of any size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.root_error import RIGID_BELOW
from squealstudy.motion.growing_modes import (
    DEGENERATE_AXIS_RATIO,
    INVERSE_ITERATIONS,
    MAX_FOLLOWED_MODES,
    GrowingModes,
)
from squealstudy.root_pairs import angular_band
from squealstudy.stacked.roots import companion_pairs

# shift of inverse iteration over the largest entry, as the matrix is singular at an exact root
SHIFT_ROUND_OFF_RATIO = 1e-14


def stacked_growing_modes(
    C: np.ndarray,
    K: np.ndarray,
    omega2: np.ndarray,
    band_hz: tuple[float, float],
    tolerance: float,
) -> list[GrowingModes]:
    """`growing_modes` of each of m design points.

    Parameters
    ----------
    C, K : ndarray (m, n, n)
        Damping [rad/s] and stiffness [(rad/s)^2]; the mass is the identity.
    omega2 : ndarray (n,)
        Diagonal stiffness by which elastic energy is measured, (rad/s)^2.
    band_hz : (low, high)
        Frequencies, Hz.
    tolerance : float
        A mode is unstable where the real part of its root is more than this times its modulus.

    Raises
    ------
    LinAlgError
        A matrix is not finite, or its left vectors are not found.
    """
    low, high = angular_band(band_hz)
    lam, psi = companion_pairs(C, K)
    size = np.abs(lam)
    oscillating = (lam.imag > 0) & (size >= min(RIGID_BELOW * high, low))
    unstable = oscillating & (lam.real > tolerance * size)
    inside = oscillating & (size >= low) & (size <= high)
    neutral = np.abs(lam.real) <= tolerance * size  # their order would be a matter of round-off
    by_size = np.argsort(size, axis=1, kind="stable")
    growth = np.where(inside, np.where(neutral, 0.0, -lam.real), np.inf)
    growth = np.take_along_axis(growth, by_size, 1)
    order = np.take_along_axis(by_size, np.argsort(growth, axis=1, kind="stable"), 1)
    n_unstable = (unstable & inside).sum(axis=1)
    n_followed = np.minimum(np.maximum(n_unstable, 1), MAX_FOLLOWED_MODES)
    count = np.minimum(inside.sum(axis=1), n_followed)
    owner, rank = np.nonzero(np.arange(lam.shape[1]) < count[:, None])
    mode_index = order[owner, rank]
    roots = lam[owner, mode_index]
    right = psi[owner, :, mode_index]
    right = right / np.linalg.norm(right, axis=1)[:, None]
    left_modes = _left_vectors(C[owner], K[owner], roots)
    observed = _ObservedModes.made(C[owner], omega2, roots, right, left_modes)
    ends = np.cumsum(count)
    outside = unstable & ~inside
    fastest = np.argmax(np.where(outside, lam.real, -np.inf), axis=1)
    worst = np.where(outside.any(axis=1), lam[np.arange(len(lam)), fastest], 0.0)
    above, below = (outside & (size > high)).sum(axis=1), (outside & (size < low)).sum(axis=1)
    return [
        GrowingModes(
            n_unstable=int(n_unstable[i]),
            n_above=int(above[i]),
            n_below=int(below[i]),
            growth_outside=float(worst[i].real),
            frequency_outside=float(abs(worst[i]) / (2 * np.pi)),
            **observed.of(slice(int(ends[i] - count[i]), int(ends[i]))),
        )
        for i in range(len(lam))
    ]


def _left_vectors(C: np.ndarray, K: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Left vectors (N, n) of a simple root of each C, K (N, n, n), by inverse iteration."""
    n = K.shape[1]
    Q = (lam**2)[:, None, None] * np.eye(n) + lam[:, None, None] * C + K
    shift = SHIFT_ROUND_OFF_RATIO * np.abs(Q).max(axis=(1, 2))
    inverse = np.linalg.inv(Q.conj().swapaxes(1, 2) + shift[:, None, None] * np.eye(n))
    y = np.ones((len(lam), n, 1), dtype=complex)
    for _ in range(INVERSE_ITERATIONS):
        y = inverse @ y
        y = y / np.linalg.norm(y, axis=1, keepdims=True)
    return y[..., 0]


@dataclass(frozen=True, eq=False)
class _ObservedModes:
    """Growing modes of all design points, one after the other, with sensor rows for runs.

    Attributes
    ----------
    lam : ndarray (N,) complex
        Roots, rad/s.
    right, left : ndarray (N, n) complex
        Right and left vectors.
    seen, planes : ndarray (N, 4, n)
        Sensor rows of `motion.growing_modes.growth_sensors` and of `mode_planes`.
    axes : ndarray (N, 2 n, 2)
        Two axes of each mode's plane in the coordinates (Omega q, q').
    energy : ndarray (N,)
        As in `GrowingModes`.
    """

    lam: np.ndarray
    right: np.ndarray
    left: np.ndarray
    seen: np.ndarray
    planes: np.ndarray
    axes: np.ndarray
    energy: np.ndarray

    @staticmethod
    def made(
        C: np.ndarray,
        omega2: np.ndarray,
        lam: np.ndarray,
        right_vectors: np.ndarray,
        left_vectors: np.ndarray,
    ) -> _ObservedModes:
        """The modes with their sensor rows, from the damping C (N, n, n) of each design point."""
        n = len(omega2)
        y, root = left_vectors.conj(), lam[:, None]
        z = root * y + np.einsum("Ni,Nij->Nj", y, C)
        omega = np.sqrt(np.maximum(omega2, 0.0))
        state = np.concatenate([omega * right_vectors, root * right_vectors], axis=1)
        u, s, _ = np.linalg.svd(np.stack([state.real, state.imag], axis=2), full_matrices=False)
        axes = u * (s > DEGENERATE_AXIS_RATIO * s[:, :1])[:, None, :]
        product = np.einsum(
            "Ni,Ni->N", y, 2 * root * right_vectors + np.einsum("Nij,Nj->Ni", C, right_vectors)
        )
        size = np.abs(right_vectors) ** 2
        energy = np.abs(lam) ** 2 * size.sum(axis=1) + (size * omega2).sum(axis=1)
        return _ObservedModes(
            lam=lam,
            right=right_vectors,
            left=left_vectors,
            seen=np.stack([y.real, y.imag, z.real, z.imag], axis=1),
            planes=np.concatenate(
                [axes[:, n:].swapaxes(1, 2), (omega[:, None] * axes[:, :n]).swapaxes(1, 2)], axis=1
            ),
            axes=axes,
            energy=energy / np.maximum(np.abs(product) ** 2, 1e-300),
        )

    def of(self, modes: slice) -> dict[str, np.ndarray]:
        """Attributes of `GrowingModes` for the modes of one design point."""
        n = self.right.shape[1]
        all_axes = self.axes[modes].swapaxes(0, 1).reshape(2 * n, -1)
        parts = (self.seen[modes], self.planes[modes])
        return {
            "lam": self.lam[modes],
            "right": self.right[modes].T,
            "left": self.left[modes].T,
            "sensors": np.concatenate([part.reshape(-1, n) for part in parts]),
            "energy": self.energy[modes],
            "overlap": all_axes.T @ all_axes,
        }
