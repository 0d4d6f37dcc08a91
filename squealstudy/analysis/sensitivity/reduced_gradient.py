"""Derivatives of a root of the reduced model by the parameters of a design state."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la

from squealstudy.analysis.sensitivity.contact_change import ContactChange, ContactWeights
from squealstudy.analysis.sensitivity.contact_gradient import ContactGradient, Products
from squealstudy.analysis.sensitivity.damping_gradient import DampingGradient
from squealstudy.analysis.sensitivity.law_change import (
    FRICTION_PARAMETERS,
    friction_change,
    law_change,
)
from squealstudy.analysis.sensitivity.mode_family import ModeFamily
from squealstudy.analysis.sensitivity.state_parameter import (
    DAMPING,
    FREQUENCY,
    PRESSURE,
    STIFFNESS_DAMPING,
    StateParameter,
)
from squealstudy.analysis.sensitivity.working_point_motion import WorkingPointMotion
from squealstudy.reduction.prepared import PreparedModel, shape_column
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.design_state import DesignState
from squealstudy.system.linearise import LinearisedModel, component_frequencies


@dataclass(frozen=True)
class SystemChange:
    """Derivative of the reduced system by one parameter.

    Attributes
    ----------
    contact : ContactChange or None
        Total: with the motion of the working point.
    stiffness, damping : mapping of coordinate -> float
        Diagonal entries of K_el and C.
    ratios : ndarray (n,) or None
        Damping ratios of the assembly's real modes.
    beta : float
        Rayleigh's beta.
    """

    contact: ContactChange | None = None
    stiffness: dict[int, float] = field(default_factory=dict)
    damping: dict[int, float] = field(default_factory=dict)
    ratios: np.ndarray | None = None
    beta: float = 0.0


class StateDerivatives:
    """What the reduced system of one design point does under each of its parameters."""

    def __init__(self, prepared: PreparedModel, state: DesignState, point: WorkingPoint) -> None:
        self._model, self._state = prepared.model, state
        model = prepared.model
        self._omega = component_frequencies(model)
        changes = state.stiffness_changes(self._omega)
        columns = {shape_column(model, *key): dk for key, dk in changes.items()}
        self.motion = WorkingPointMotion(prepared.space, columns, state.operating, point)
        self.weights = ContactWeights(state.operating, point, model.area, model.frictional)

    def by(self, parameter: StateParameter) -> SystemChange:
        """Derivative by one parameter, the working point's motion included."""
        if parameter.modes:
            return self._by_modes(parameter)
        operating, name = self._state.operating, parameter.name
        if name == DAMPING:
            ratios = np.ones(self._model.n)
            ratios[[mode - 1 for mode in self._state.assembly_damping]] = 0.0
            return SystemChange(ratios=ratios)
        if name == STIFFNESS_DAMPING:
            return SystemChange(beta=1.0)
        if name == PRESSURE:
            return SystemChange(self.weights.change(self.motion.by_pressure()))
        if name in FRICTION_PARAMETERS:
            friction = friction_change(operating, name)
            gap = self.motion.by_friction(friction)
            return SystemChange(self.weights.change(gap, friction=friction))
        law = law_change(operating.law, name, self.motion.point.gap)
        return SystemChange(self.weights.change(self.motion.by_law(law[0]), law=law))

    def _by_modes(self, parameter: StateParameter) -> SystemChange:
        if not parameter.component:
            ratios = np.zeros(self._model.n)
            ratios[[mode - 1 for mode in parameter.modes]] = 1.0
            return SystemChange(ratios=ratios)
        keys = [(parameter.component, mode) for mode in parameter.modes]
        at = [self._model.mode_coordinate(*key) for key in keys]
        scales = [self._state.frequency_scale.get(key, 1.0) for key in keys]
        if parameter.quantity != FREQUENCY:
            values = [2.0 * s * self._omega[key] for s, key in zip(scales, keys, strict=True)]
            return SystemChange(damping=dict(zip(at, values, strict=True)))
        stiffness = [2.0 * s * self._omega[key] ** 2 for s, key in zip(scales, keys, strict=True)]
        damping = [2.0 * self._state.mode_damping.get(k, 0.0) * self._omega[k] for k in keys]
        gap = np.zeros(len(self._model.area))
        for key, dk in zip(keys, stiffness, strict=True):
            gap += dk * self.motion.by_mode_stiffness(shape_column(self._model, *key))
        return SystemChange(
            self.weights.change(gap),
            dict(zip(at, stiffness, strict=True)),
            dict(zip(at, damping, strict=True)),
        )


@dataclass(frozen=True)
class RealModes:
    """Real modes (omega, phi) of K_sym that modal damping is put on, and N phi."""

    omega: np.ndarray
    phi: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(cls, system: LinearisedModel, N: np.ndarray) -> RealModes:
        """All real modes of a reduced system; N (nc, n)."""
        w2, phi = la.eigh(system.K_sym)
        return cls(np.sqrt(np.maximum(w2, 0.0)), phi, N @ phi)


class ReducedGradient:
    """Products y^H Q_theta x of one family of modes of a reduced system.

    Parameters
    ----------
    family : ModeFamily
    real : RealModes or None
        Needed where modal damping is in force or a damping ratio of the assembly is asked for.
    """

    def __init__(
        self,
        prepared: PreparedModel,
        state: DesignState,
        system: LinearisedModel,
        family: ModeFamily,
        real: RealModes | None,
    ) -> None:
        model = prepared.model
        self._family, self._beta, self._K_sym = family, state.stiffness_damping, system.K_sym
        self._contact = ContactGradient(family, model.N, model.T, model.T_perp, self._beta)
        self._real, self._damping = real, None
        if real is None:
            return
        self._left, self._right = real.phi.T @ family.Y.conj(), real.phi.T @ family.X
        zeta = state.assembly_damping_ratios(model.n)
        if zeta.any():
            lam, ends = complex(family.lam[0]), (self._left[:, 0], self._right[:, 0])
            self._damping = DampingGradient(real.omega, zeta, lam, *ends)
            self._by_normal = self._damping.by_rows(real.seen)

    def products(self, change: SystemChange) -> Products:
        """Of the first mode with its family.

        The change of modal damping with the stiffness enters the first mode's own product only;
        between different modes it is of second order beside the stiffness itself.
        """
        lam, X, Y = self._family.lam, self._family.X, self._family.Y.conj()
        total = Products(np.zeros(len(lam), dtype=complex), np.zeros(len(lam), dtype=complex))
        for at, dk in change.stiffness.items():
            total += _diagonal(dk * (1.0 + self._beta * lam), X[at], Y[at])
        for at, dc in change.damping.items():
            total += _diagonal(dc * lam, X[at], Y[at])
        if change.contact is not None:
            total += self._contact.products(change.contact)
        if change.beta:
            K_x, K_y = self._K_sym @ X, self._K_sym @ Y
            total += Products(
                change.beta * lam * (Y[:, 0] @ K_x), change.beta * lam[0] * (X[:, 0] @ K_y)
            )
        if change.ratios is not None and self._real is not None:
            dampers = 2.0 * self._real.omega * change.ratios
            total += Products(
                lam * ((self._left[:, 0] * dampers) @ self._right),
                lam[0] * ((self._right[:, 0] * dampers) @ self._left),
            )
        own = self._own_damping(change)
        total.right[0] += own
        total.left[0] += own
        return total

    def _own_damping(self, change: SystemChange) -> complex:
        """The first mode's product by modal damping that follows the stiffness."""
        own = 0j
        if self._damping is None or self._real is None:
            return own
        if change.contact is not None:
            own += complex(self._by_normal @ change.contact.normal)
        if change.stiffness:
            rows = self._real.phi[list(change.stiffness)]
            own += complex(self._damping.by_rows(rows) @ np.array([*change.stiffness.values()]))
        return own


def _diagonal(weight: np.ndarray, x: np.ndarray, y: np.ndarray) -> Products:
    """Products by one diagonal entry; weight (k,) at each root, x and conj(y) (k,) there."""
    return Products(weight * y[0] * x, weight[0] * y * x[0])
