"""Structures of many design points as arrays, in the coordinates of free component modes.

Small models are solved in these coordinates, many at once: the mass is the identity and the elastic
stiffness is diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from squealstudy.laws.own_friction import NO_OWN_FRICTION
from squealstudy.laws.spring import NO_SPRINGS
from squealstudy.models.stacked_assembly import StackedAssembly


@dataclass(frozen=True, eq=False)
class StackedStructures:
    """m structures whose coordinates are all free modes of their components.

    Attributes
    ----------
    components : tuple of str
        Names of the components.
    offsets : ndarray (n_components + 1,)
        Index of the first coordinate of each component; the last entry is n.
    k_el : ndarray (m, n)
        Squares of the components' free angular frequencies, (rad/s)^2.
    springs, static_springs : ndarray (m, n, n)
        Stiffness of linear interfaces in vibration and in the static state, (rad/s)^2.
    C : ndarray (m, n, n) or None
        The components' own damping, rad/s; None where there is none.
    N, T, T_perp : ndarray (m, c, n)
    area, gap0, frictional, speed_factor : ndarray (m, c)
        Observation matrices and values of the c contact points, as in
        `models.assembly.ContactInterface`.
    load : ndarray (m, n, 2)
        Loads of a unit brake pressure [N/(Pa sqrt(kg))], and constant loads [N/sqrt(kg)].
    phi : ndarray (m, n, n)
        Displacements of the degrees of freedom for unit coordinates.
    sensors : ndarray (m, s, n)
        M^(1/2) u for the displacements u of unit coordinates. Shapes of structures with different
        masses are compared by these.
    spring_points : ndarray (m, ns, 5)
    own_friction : ndarray (m, c, k)
        As in `StackedAssembly`.
    """

    components: tuple[str, ...]
    offsets: np.ndarray
    k_el: np.ndarray
    springs: np.ndarray
    static_springs: np.ndarray
    C: np.ndarray | None
    N: np.ndarray
    T: np.ndarray
    T_perp: np.ndarray
    area: np.ndarray
    gap0: np.ndarray
    frictional: np.ndarray
    speed_factor: np.ndarray
    load: np.ndarray
    phi: np.ndarray
    sensors: np.ndarray
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS[None])
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION[None])

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return int(self.phi.shape[2])

    def coordinate(self, component: str, mode: int) -> int:
        """Index of the coordinate of a component's free mode, which is numbered from 1.

        KeyError where the component does not have that mode.
        """
        i = self.components.index(component) if component in self.components else -1
        if i < 0 or not 1 <= mode <= self.offsets[i + 1] - self.offsets[i]:
            raise KeyError((component, mode))
        return int(self.offsets[i]) + mode - 1

    @staticmethod
    def of(a: StackedAssembly) -> StackedStructures:
        """Structures of assemblies with finite matrices and positive definite masses."""
        m = max(len(a.M), len(a.K))
        phi = np.zeros((m, a.n, a.n))
        k_el = np.zeros((m, a.n))
        for i, j in zip(a.offsets, a.offsets[1:], strict=False):
            block = slice(int(i), int(j))
            k, block_modes = free_modes(a.M[:, block, block], a.K[:, block, block])
            k_el[:, block], phi[:, block, block] = k, block_modes
        phi_T = phi.swapaxes(1, 2)
        loads = np.stack(np.broadcast_arrays(a.load, a.constant_load), axis=2)
        return StackedStructures(
            components=a.components,
            offsets=a.offsets,
            k_el=k_el,
            springs=_symmetric(phi_T @ a.springs @ phi),
            static_springs=_symmetric(phi_T @ a.static_springs @ phi),
            C=None if a.C is None else phi_T @ a.C @ phi,
            N=a.N @ phi,
            T=a.T @ phi,
            T_perp=a.T_perp @ phi,
            area=a.area,
            gap0=a.gap0,
            frictional=a.frictional,
            speed_factor=a.speed_factor,
            load=phi_T @ loads,
            phi=phi,
            sensors=square_roots(a.M) @ phi,
            spring_points=a.spring_points,
            own_friction=a.own_friction,
        )


def free_modes(M: np.ndarray, K: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free modes of m bodies: squared angular frequencies (m, n), ascending, and shapes (m, n, n).

    The shapes have unit modal mass.
    """
    lower = np.linalg.cholesky(M)
    inverse = np.linalg.inv(lower)
    _, y = np.linalg.eigh(_symmetric(inverse @ K @ inverse.swapaxes(1, 2)))
    phi = inverse.swapaxes(1, 2) @ y
    return np.einsum("mij,mij->mj", phi, K @ phi), phi


def square_roots(M: np.ndarray) -> np.ndarray:
    """Symmetric square roots (m, n, n) of positive definite masses."""
    w, y = np.linalg.eigh(M)
    root: np.ndarray = (y * np.sqrt(w)[:, None, :]) @ y.swapaxes(1, 2)
    return root


def _symmetric(A: np.ndarray) -> np.ndarray:
    symmetric_part: np.ndarray = (A + A.swapaxes(1, 2)) / 2
    return symmetric_part
