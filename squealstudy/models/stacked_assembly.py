"""Assemblies of the same shape side by side: dense arrays with one row for each structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.laws.own_friction import NO_OWN_FRICTION
from squealstudy.laws.spring import NO_SPRINGS
from squealstudy.models.assembly import Assembly


@dataclass(frozen=True, eq=False)
class StackedAssembly:
    """Assemblies of m structures with the same components and contact points.

    An array with a single row stands for m equal rows.

    Attributes
    ----------
    components : tuple of str
    offsets : ndarray (n_components + 1,)
        Number of each component's first degree of freedom, then n.
    M, K : ndarray (m, n, n)
        Mass [kg] and elastic stiffness [N/m] of the components, block diagonal.
    springs, static_springs : ndarray (m, n, n)
        Stiffness of linear interfaces in vibration and in the static state, N/m.
    C : ndarray (m, n, n) or None
        Damping and gyroscopic terms of components and dampers, N s/m; None where there are none.
    N, T, T_perp : ndarray (m, c, n)
    area, gap0, frictional, speed_factor : ndarray (m, c)
        As in `ContactInterface`.
    load, constant_load : ndarray (m, n)
        Loads of a unit brake pressure [N/Pa], and constant loads [N].
    spring_points : ndarray (m, ns, 5)
        Numbers of the last contact points, which are springs (`ContactInterface.spring_points`).
    own_friction : ndarray (m, c, k)
        As in `ContactInterface`.
    """

    components: tuple[str, ...]
    offsets: np.ndarray
    M: np.ndarray
    K: np.ndarray
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
    constant_load: np.ndarray
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS[None])
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION[None])

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(self.M.shape[2])

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays with a row for each structure, by name."""
        named = {f.name: getattr(self, f.name) for f in fields(self)}
        return {
            name: array
            for name, array in named.items()
            if isinstance(array, np.ndarray) and name != "offsets"
        }

    def at(self, rows: np.ndarray) -> StackedAssembly:
        """The structures of these rows, which may be repeated."""
        selected: dict[str, Any] = {name: _rows(array, rows) for name, array in self.arrays.items()}
        return replace(self, **selected)

    @staticmethod
    def of(assemblies: Sequence[Assembly]) -> StackedAssembly:
        """Assemblies side by side.

        Raises
        ------
        ValueError
            They differ in components, or in numbers of degrees of freedom or contact points.
        """
        first = assemblies[0]
        if any(a.component_names != first.component_names for a in assemblies):
            raise ValueError("assemblies of other components cannot be stacked")
        columns = [_columns(a) for a in assemblies]
        C = [None if a.C_el is None else a.C_el.toarray() for a in assemblies]
        damped = any(c is not None for c in C)
        zero = np.zeros((first.n_dof, first.n_dof))
        ends = np.cumsum([0, *(c.n_dof for c in first.components)])
        return StackedAssembly(
            components=first.component_names,
            offsets=ends,
            C=np.stack([zero if c is None else c for c in C]) if damped else None,
            **{
                name: np.stack([arrays_of_one[name] for arrays_of_one in columns])
                for name in columns[0]
            },
        )


def _columns(a: Assembly) -> dict[str, np.ndarray]:
    """Matrices and values of an assembly that a stack of assemblies holds."""
    contact = a.contact
    matrices: Mapping[str, sp.spmatrix] = {
        "M": a.M,
        "K": a.K_el,
        "springs": a.K_springs(),
        "static_springs": a.K_springs(static=True),
        "N": contact.N,
        "T": contact.T,
        "T_perp": contact.T_perp,
    }
    return {name: np.asarray(A.toarray(), dtype=float) for name, A in matrices.items()} | {
        "area": contact.area,
        "gap0": contact.gap0,
        "frictional": contact.frictional,
        "speed_factor": contact.speed_factor,
        "load": a.load,
        "constant_load": a.constant_load,
        "spring_points": contact.spring_points,
        "own_friction": contact.own_friction,
    }


def _rows(value: np.ndarray, rows: np.ndarray) -> np.ndarray:
    return value if len(value) == 1 else value[rows]
