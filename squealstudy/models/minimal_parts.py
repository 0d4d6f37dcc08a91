"""Parts that minimal models share: a point mass, and contact points of given stiffness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from squealstudy.laws import contact_law
from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.stacked_assembly import StackedAssembly

LEVER_ARM_M = 1.0  # m: the torque of a minimal model is its friction force
ON_BELT = np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])  # N and T of `mass_on_belt`
LAW = contact_law("bilateral")  # stiffness per area is constant: areas set the points' stiffness


def point_mass(name: str, mass: float) -> Component:
    """A mass [kg] free to move in a plane: M = m I (2 x 2), no elasticity, two rigid modes."""
    return Component(name, sp.csr_matrix(mass * np.eye(2)), sp.csr_matrix((2, 2)))


def bilateral_points(N: np.ndarray, T: np.ndarray, stiffness: np.ndarray) -> ContactInterface:
    """Contact points that stay closed, with friction along T and none across it.

    Parameters
    ----------
    N, T : ndarray (nc, n_dof)
        Gap (positive when open) and sliding displacement from the degrees of freedom.
    stiffness : ndarray (nc,)
        Contact stiffness k_n = A dp/d(-g) of each point, N/m. The area A = stiffness / 5e11 m2
        follows from it; the tangential stiffness ``contact.kt`` is per this area.
    """
    n = len(stiffness)
    return ContactInterface(
        N=sp.csr_matrix(N),
        T=sp.csr_matrix(T),
        T_perp=sp.csr_matrix(N.shape),
        area=stiffness / LAW.value(STIFFNESS.name),
        gap0=np.zeros(n),
        radius=np.full(n, LEVER_ARM_M),
        law=LAW,
        frictional=np.ones(n),
    )


def mass_on_belt(values: Mapping[str, float], springs: SpringInterface) -> Assembly:
    """A mass pressed on a belt: q1 is along the belt, against its motion, q2 away from it.

    Parameters
    ----------
    values : mapping of str -> float
        Must contain ``mass`` [kg], ``contact_stiffness`` [N/m] and ``normal_force`` [N].
    springs : SpringInterface
        Springs that hold the mass.
    """
    return Assembly(
        components=(point_mass("mass", values["mass"]),),
        contact=bilateral_points(
            *ON_BELT,
            stiffness=np.array([values["contact_stiffness"]]),
        ),
        springs=(springs,),
        load=np.zeros(2),
        constant_load=np.array([0.0, -values["normal_force"]]),
    )


def stacked_mass(
    mass: Any,
    N: np.ndarray,
    T: np.ndarray,
    stiffness: list[Any],
    force: list[Any],
    springs: list[list[Any]] | None = None,
) -> StackedAssembly:
    """A point mass on bilateral contact points, for m structures at once.

    Parameters
    ----------
    mass : float or ndarray (m,)
        Mass, kg.
    N, T : ndarray (nc, 2)
        As in `bilateral_points`.
    stiffness : list of (float or ndarray (m,))
        Contact stiffness of each point, N/m.
    force : list of (float or ndarray (m,))
        Constant force along each coordinate, N.
    springs : list of lists of (float or ndarray (m,)) or None
        Stiffness (2 x 2) of linear springs, N/m.
    """
    zeros = np.zeros((1, 2, 2))
    area = _as_columns(stiffness) / LAW.value(STIFFNESS.name)
    spring_rates = (
        zeros
        if springs is None
        else np.stack(np.broadcast_arrays(*map(_as_columns, springs)), axis=1)
    )
    nc = len(N)
    return StackedAssembly(
        components=("mass",),
        offsets=np.array([0, 2]),
        M=np.atleast_1d(np.asarray(mass, dtype=float))[:, None, None] * np.eye(2),
        K=zeros,
        springs=spring_rates,
        static_springs=spring_rates,
        C=None,
        N=N[None].astype(float),
        T=T[None].astype(float),
        T_perp=np.zeros((1, nc, 2)),
        area=area,
        gap0=np.zeros((1, nc)),
        frictional=np.ones((1, nc)),
        speed_factor=np.ones((1, nc)),
        load=np.zeros((1, 2)),
        constant_load=_as_columns(force),
    )


def _as_columns(columns: list[Any]) -> np.ndarray:
    """Stack k numbers or arrays (m,) as columns: (m or 1, k)."""
    arrays = [np.atleast_1d(np.asarray(column, dtype=float)) for column in columns]
    return np.stack(np.broadcast_arrays(*arrays), axis=1)
