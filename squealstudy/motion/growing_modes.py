"""Unstable complex modes, and sensors that follow them in a run in time.

There are two groups of sensors. The projection on the left vector of a mode sees that mode alone,
and shows how it grows. The projection on the plane of its motion shows its share of the energy.

A motion along a complex mode, 2 Re(a x exp(lambda t)), has its states (q, q') in the plane that the
real and imaginary parts of (x, lambda x) span. The energy |q'|^2 / 2 + |Omega q|^2 / 2 makes these
states a Euclidean space: the energy of a state's orthogonal projection on a plane lies between zero
and the energy of the state. Planes of different modes are not orthogonal to each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la

from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.linalg.root_error import RIGID_BELOW
from squealstudy.root_pairs import angular_band

MAX_FOLLOWED_MODES = 6  # complex modes followed in a run, fastest growth first
INVERSE_ITERATIONS = 3
DEGENERATE_AXIS_RATIO = 1e-9  # a plane is a line if its second axis is shorter, over the first


@dataclass(frozen=True)
class GrowingModes:
    """Complex modes of one design point, fastest growth first; empty where runs are not watched.

    Attributes
    ----------
    lam : ndarray (m,) complex
        Roots, rad/s. If no mode of the band is unstable, the least stable one; of several neutral
        modes that of the lowest frequency.
    right, left : ndarray (n, m) complex
        Vectors of unit norm with Q(lam) right = 0 and left^H Q(lam) = 0.
    n_unstable : int
        Number of unstable modes in the band, those beyond `MAX_FOLLOWED_MODES` counted too.
    n_above, n_below : int
        Numbers of unstable modes above and below the band.
    growth_outside, frequency_outside : float
        Growth rate [1/s] and frequency [Hz] of the fastest mode outside the band; 0 without one.
    sensors : ndarray (8 m, n)
        Rows whose products with q and q' are saved: four `growth_sensors` of each mode, then four
        `mode_planes` of each mode.
    energy : ndarray (m,)
        Mean mechanical energy of a motion along each mode at unit projection, J.
    overlap : ndarray (2 m, 2 m)
        Scalar products of the axes of the planes, which are not orthogonal to each other.
    integrated : ndarray (2, m) complex
        Roots [rad/s] of these modes as integrated with the step of a run: first with each step
        solved to balance, then with forces evaluated once in a step. (2, 0) if not known.
    """

    lam: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=complex))
    right: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=complex))
    left: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=complex))
    n_unstable: int = 0
    n_above: int = 0
    n_below: int = 0
    growth_outside: float = 0.0
    frequency_outside: float = 0.0
    sensors: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    energy: np.ndarray = field(default_factory=lambda: np.zeros(0))
    overlap: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    integrated: np.ndarray = field(default_factory=lambda: np.zeros((2, 0), dtype=complex))

    @property
    def n_outside(self) -> int:
        """Number of unstable modes outside the band, which are not followed."""
        return self.n_above + self.n_below

    @property
    def n_followed(self) -> int:
        """Number of unstable modes in `lam`, where they come first."""
        return min(self.n_unstable, len(self.lam))


def growing_modes(
    C: np.ndarray,
    K: np.ndarray,
    omega2: np.ndarray,
    band_hz: tuple[float, float],
    tolerance: float,
) -> GrowingModes:
    """Unstable modes of lambda^2 I + lambda C + K in a band, their sensors, and counts outside.

    Parameters
    ----------
    C, K : ndarray (n, n)
        Damping [1/s] and stiffness [1/s2]; the mass is the identity.
    omega2 : ndarray (n,)
        Diagonal stiffness of the energy, (rad/s)^2; the mass is the identity.
    band_hz : (low, high)
        Band, Hz.
    tolerance : float
        A mode is unstable where its damping ratio is below minus this.
    """
    low, high = angular_band(band_hz)
    lam, psi = dense_roots(C, K, (min(RIGID_BELOW * high, low), np.inf))
    oscillating = lam.imag > 0
    lam, psi = lam[oscillating], psi[:, oscillating]
    unstable = lam.real > tolerance * np.abs(lam)
    inside = (np.abs(lam) >= low) & (np.abs(lam) <= high)
    neutral = np.abs(lam.real) <= tolerance * np.abs(lam)  # round-off would decide on their order
    order = np.argsort(np.where(neutral, 0.0, -lam.real), kind="stable")
    chosen = order[inside[order]][:MAX_FOLLOWED_MODES]
    n_unstable = int((unstable & inside).sum())
    chosen = chosen[: max(n_unstable, 1)]
    outside = lam[unstable & ~inside]
    worst = outside[np.argmax(outside.real)] if len(outside) else 0j
    lam, right, left_modes = lam[chosen], psi[:, chosen], left_vectors(C, K, lam[chosen])
    sensors = [growth_sensors(C, root, y) for root, y in zip(lam, left_modes.T, strict=True)]
    planes, overlap = mode_planes(omega2, lam, right)
    n = len(K)
    return GrowingModes(
        lam=lam,
        right=right,
        left=left_modes,
        n_unstable=n_unstable,
        n_above=int((np.abs(outside) > high).sum()),
        n_below=int((np.abs(outside) < low).sum()),
        growth_outside=float(worst.real),
        frequency_outside=float(abs(worst) / (2 * np.pi)),
        sensors=np.concatenate([np.array(sensors).reshape(-1, n), planes.reshape(-1, n)]),
        energy=_energies(C, omega2, lam, right, left_modes),
        overlap=overlap,
    )


def left_vectors(C: np.ndarray, K: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Left vectors (n, m) of known simple roots, by inverse iteration; their norm is 1."""
    n = len(K)
    vectors = np.empty((n, len(lam)), dtype=complex)
    for k, root in enumerate(lam):
        Q = root**2 * np.eye(n) + root * C + K
        shift = 1e-14 * np.abs(Q).max()  # at an exact root the matrix would be singular
        factor = la.lu_factor(Q.conj().T + shift * np.eye(n), overwrite_a=True)
        y = np.ones(n, dtype=complex)
        for _ in range(INVERSE_ITERATIONS):
            y = la.lu_solve(factor, y / np.linalg.norm(y))
        vectors[:, k] = y / np.linalg.norm(y)
    return vectors


def growth_sensors(C: np.ndarray, lam: complex, left_vector: np.ndarray) -> np.ndarray:
    """Sensor rows that see one complex mode alone.

    The projection xi(t) = y^H ((lambda + C) q + q') on the left vector y (M = I) of a linear
    system obeys xi' = lambda xi, whatever else is in the motion.

    Parameters
    ----------
    C : ndarray (n, n)
    lam : complex
        Root, rad/s.
    left_vector : ndarray (n,) complex
        Left vector y: y^H (lambda^2 + lambda C + K) = 0.

    Returns
    -------
    ndarray (4, n)
        Real and imaginary part of y^H, for velocities, then of y^H (lambda + C), for displacements.
        `projection` adds their products.
    """
    y = left_vector.conj()
    z = lam * y + y @ C
    return np.stack([y.real, y.imag, z.real, z.imag])


def projection(displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Complex amplitude (rows,) from the histories (rows, 4) of `growth_sensors`."""
    xi: np.ndarray = (
        velocity[:, 0] + 1j * velocity[:, 1] + displacement[:, 2] + 1j * displacement[:, 3]
    )
    return xi


def mode_planes(
    omega2: np.ndarray, lam: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sensor rows of the planes of complex modes, and the scalar products of their axes.

    Parameters
    ----------
    omega2 : ndarray (n,)
        Diagonal stiffness of the energy, (rad/s)^2; the mass is the identity.
    lam : ndarray (m,) complex
        Roots, rad/s.
    right : ndarray (n, m) complex
        Right vectors.

    Returns
    -------
    rows : ndarray (m, 4, n)
        For each plane two rows for velocities, then two for displacements. `coordinates` adds up
        their products.
    overlap : ndarray (2 m, 2 m)
        Scalar products of all axes; zeros for the missing second axis of a line.
    """
    omega = np.sqrt(np.maximum(omega2, 0.0))
    axes = [_axes(omega, root, x) for root, x in zip(lam, right.T, strict=True)]
    n = len(omega)
    rows = [np.vstack([u[n:].T, (omega[:, None] * u[:n]).T]) for u in axes]
    all_axes = np.hstack([np.zeros((2 * n, 0)), *axes])
    return np.array(rows).reshape(len(axes), 4, n), all_axes.T @ all_axes


def _axes(omega: np.ndarray, lam: complex, x: np.ndarray) -> np.ndarray:
    """Orthonormal axes (2 n, 2) of one plane in the coordinates (Omega q, q')."""
    state = np.concatenate([omega * x, lam * x])
    u, s, _ = np.linalg.svd(np.column_stack([state.real, state.imag]), full_matrices=False)
    axes: np.ndarray = u * (s > DEGENERATE_AXIS_RATIO * s[0])
    return axes


def coordinates(displacement: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Coordinates (rows, 2) on a plane from the histories (rows, 4) of its `mode_planes` rows.

    Half the sum of their squares is the energy of the projection, J.
    """
    on_plane: np.ndarray = velocity[:, :2] + displacement[:, 2:]
    return on_plane


def _energies(
    C: np.ndarray,
    omega2: np.ndarray,
    lam: np.ndarray,
    right_vectors: np.ndarray,
    left_vectors: np.ndarray,
) -> np.ndarray:
    """Mean energy of the motion 2 Re(a x exp(lambda t)) whose projection on y has modulus 1."""
    product = np.einsum(
        "ij,ij->j", left_vectors.conj(), 2 * lam * right_vectors + C @ right_vectors
    )
    size = np.abs(right_vectors) ** 2
    energy = np.abs(lam) ** 2 * size.sum(axis=0) + omega2 @ size
    scaled: np.ndarray = energy / np.maximum(np.abs(product) ** 2, 1e-300)
    return scaled
