"""What the minimal models share: a point mass and bilateral contact points of given stiffness."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.laws import contact_law
from squealstudy.laws.contact.unilateral import STIFFNESS
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface

ARM = 1.0  # m: the torque of a minimal model is its friction force
LAW = contact_law("bilateral")  # the areas of the points carry their stiffness


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
        Contact stiffness k_n = A dp/d(-g) of each point, N/m. It makes the area
        A = stiffness / 5e11 m2, that ``contact.kt`` is given for.
    """
    n = len(stiffness)
    return ContactInterface(
        N=sp.csr_matrix(N),
        T=sp.csr_matrix(T),
        T_perp=sp.csr_matrix(N.shape),
        area=stiffness / LAW.value(STIFFNESS.name),
        gap0=np.zeros(n),
        radius=np.full(n, ARM),
        law=LAW,
        frictional=np.ones(n),
    )


def mass_on_belt(values: Mapping[str, float], springs: SpringInterface) -> Assembly:
    """A mass pressed on a belt: q1 is along the belt, against its motion, q2 away from it.

    Parameters
    ----------
    values : mapping of str -> float
        ``mass`` [kg], ``contact_stiffness`` [N/m] and ``normal_force`` [N] among them.
    springs : SpringInterface
        That hold it.
    """
    return Assembly(
        components=(point_mass("mass", values["mass"]),),
        contact=bilateral_points(
            N=np.array([[0.0, 1.0]]),
            T=np.array([[1.0, 0.0]]),
            stiffness=np.array([values["contact_stiffness"]]),
        ),
        springs=(springs,),
        load=np.zeros(2),
        constant_load=np.array([0.0, -values["normal_force"]]),
    )
