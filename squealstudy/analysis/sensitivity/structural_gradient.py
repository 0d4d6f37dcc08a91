"""Products y^H Q_theta x of full-order modes under a change of material, springs or loads."""

from __future__ import annotations

import numpy as np

from squealstudy.analysis.sensitivity.assembly_change import AssemblyChange
from squealstudy.analysis.sensitivity.contact_change import ContactChange, ContactWeights
from squealstudy.analysis.sensitivity.contact_gradient import ContactGradient, Products
from squealstudy.analysis.sensitivity.damping_gradient import DampingGradient
from squealstudy.analysis.sensitivity.full_order_point import FullOrderPoint
from squealstudy.analysis.sensitivity.mode_family import ModeFamily
from squealstudy.analysis.sensitivity.working_point_motion import WorkingPointMotion


class StaticResponse:
    """How the contact of a full-order design point follows a change of its assembly.

    Parameters
    ----------
    full : FullOrderPoint
    motion : WorkingPointMotion
        Of the same working point, in the compliances of its structure.
    k_c : float
        Contact stiffness per area of the static factor, Pa/m.
    """

    def __init__(self, full: FullOrderPoint, motion: WorkingPointMotion, k_c: float) -> None:
        c, operating, w = full.assembly.contact, full.state.operating, full.point
        self._full, self._motion = full, motion
        self._factor = full.static_factor(k_c)
        self._mu = operating.mu_steady * c.frictional
        self._weights = ContactWeights(operating, w, c.area, c.frictional)
        load = operating.pressure * full.assembly.load + full.assembly.constant_load
        normal = c.area * (w.pressure + k_c * (w.gap - c.gap0))
        sliding = c.area * self._mu * w.pressure
        self._displacement = self._factor.solve(load + c.N.T @ normal - c.T.T @ sliding)

    def change(self, by: AssemblyChange) -> ContactChange:
        """Total derivative of the contact weights: the working point moves."""
        c, w = self._full.assembly.contact, self._full.point
        u, force = self._displacement, by.area * w.pressure
        unbalanced = by.static_stiffness @ u + by.mode_stiffness @ u
        unbalanced -= self._full.state.operating.pressure * by.load + by.constant_load
        unbalanced -= c.N.T @ force - c.T.T @ (self._mu * force)
        gap = self._motion.solve(c.N @ self._factor.solve(unbalanced))
        return self._weights.change(gap, area=by.area)


class StructuralGradient:
    """Products of one family of full-order modes."""

    def __init__(self, full: FullOrderPoint, family: ModeFamily) -> None:
        c, state = full.assembly.contact, full.state
        self._family, self._beta = family, state.stiffness_damping
        self._contact = ContactGradient(family, c.N, c.T, c.T_perp, self._beta)
        self._phi = full.system.phi
        self._damping = None
        if len(full.system.omega):
            zeta = state.assembly_damping_ratios(len(full.system.omega))
            seen = full.assembly.M @ self._phi
            left, right = seen.T @ family.Y[:, 0].conj(), seen.T @ family.X[:, 0]
            self._damping = DampingGradient(
                full.system.omega, zeta, complex(family.lam[0]), left, right
            )
            self._seen = c.N @ self._phi

    def products(self, by: AssemblyChange, contact: ContactChange) -> Products:
        """Of the first mode with its family; modal damping changes its own product only."""
        lam, X, Y = self._family.lam, self._family.X, self._family.Y
        right = Y[:, 0].conj() @ self._changed(by, X, lam)
        left = Y.conj().T @ self._changed(by, X[:, :1], lam[:1])[:, 0]
        total = Products(right, left) + self._contact.products(contact)
        own = self._own_damping(by, contact)
        total.right[0] += own
        total.left[0] += own
        return total

    def _changed(self, by: AssemblyChange, X: np.ndarray, lam: np.ndarray) -> np.ndarray:
        """Q_theta(lambda_j) x_j without contact and modal damping, (n, k)."""
        stiffness = by.stiffness @ X + by.mode_stiffness @ X
        product: np.ndarray = (1.0 + self._beta * lam) * stiffness
        product = product + lam**2 * (by.mass @ X) + lam * (by.mode_damping @ X)
        return product

    def _own_damping(self, by: AssemblyChange, contact: ContactChange) -> complex:
        if self._damping is None:
            return 0j
        phi = self._phi
        dK = phi.T @ (by.stiffness @ phi + by.mode_stiffness @ phi)
        own = self._damping.by_stiffness(dK) + self._damping.by_mass(phi.T @ (by.mass @ phi))
        return own + complex(self._damping.by_rows(self._seen) @ contact.normal)
