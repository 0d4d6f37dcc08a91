"""Oscillators of harmonic balance for tests: forces f(x, x'), and minimal models."""

from __future__ import annotations

import numpy as np

from squealstudy.cycles.branch import SHRUNK
from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.continuation import Steps, follow, newton
from squealstudy.cycles.equations import CycleEquations
from squealstudy.cycles.growth import (
    FAR,
    MAX_HARMONICS_OVER_FIRST,
    OTHER_RESONANCE,
    ZERO,
    linear_motion,
)
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.catalogue import MODELS
from squealstudy.modes.point import linearised_point
from squealstudy.motion.point import friction_law, motion_point
from squealstudy.motion.shared_modes import shared_modes
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import prepare
from squealstudy.study.design import DesignPoint

BAND = (0.0, 1e5)  # Hz
SATURATION = 1e-3  # m/s
EVERYTHING = ReductionSettings(1e6, 1e6, 0.0)


# -- forces of one coordinate ---------------------------------------------------------------------
def scalar_oscillator(force, *parameters):
    """x'' + x = f(x, x'); `force` gives f, its slope by x, its slope by x'."""

    def forces(y, w):
        parts = force(y[..., 0], w[..., 0], *parameters)
        f, by_y, by_w = np.broadcast_arrays(*parts)
        return LocalForces(f[..., None], by_y[..., None, None], by_w[..., None, None])

    return Oscillator(np.zeros((1, 1)), np.eye(1), np.ones((1, 1, 1)), forces)


def quintic(x, v, nu):
    """x'' + (nu - x^2 + x^4) x' + x = 0."""
    c = nu - x**2 + x**4
    return -c * v, (2 * x - 4 * x**3) * v, -c


def van_der_pol(x, v, mu):
    return mu * (1 - x**2) * v, -2 * mu * x * v, mu * (1 - x**2)


def pulled(x, v, mu):
    """x'' - mu (1 - x^2) x' + x + .2 x^2 = 0: with even harmonics and a mean."""
    f, by_x, by_v = van_der_pol(x, v, mu)
    return f - 0.2 * x**2, by_x - 0.4 * x, by_v


def shrunk(osc, least):
    """Ends branches where the first harmonic is as small as that (`CycleEquations.pack`)."""

    def stop(motion):
        equations = CycleEquations(osc, motion.harmonics, motion.omega)
        return SHRUNK if equations.pack(motion)[-2] < np.log(least) else ""

    return stop


# -- minimal models -------------------------------------------------------------------------------
BISTABLE = {  # Hoffmann: below friction .797 a stable cycle beside stable steady sliding
    "k1": 1.31e6,
    "k2": 1.356e6,
    "contact_stiffness": 2.6e6,
    "normal_force": 1000.0,
    "sliding_speed": 10.0,
    "damping_ratio": 0.01,
    "contact.cubic_stiffness": -5.4e17,
    "friction": 0.6,
}
HARDENING = {  # Hulten: a cycle beside stable steady sliding
    "frequency_2": 74.0,
    "sliding_speed": 5.0,
    "damping_ratio": 0.006,
    "contact.cubic_stiffness": 4.6e17,
    "friction": 0.3,
}


def design(name, law, values):
    """A design point of a minimal model."""
    model = MODELS[name]
    options = {o.name: o.choices[0] for o in model.options}
    if law:
        options["contact_law"] = law
    return DesignPoint(model, options, model.defaults() | values)


class Designs:
    """Design points of one structure on the modes of the first, as a study has them."""

    def __init__(self, name, values, law="cubic", kind="regularised", saturation=SATURATION):
        self.nominal = design(name, law, values)
        self.kind, self.saturation = kind, saturation
        state = self.nominal.state()
        self.prepared = prepare(self.nominal.assembly(), state.operating, EVERYTHING)
        steady, _ = linearised_point(self.prepared, state)
        self.reference = shared_modes(self.prepared.model, steady, state)

    def at(self, **values):
        """The design point of other values, for harmonic balance."""
        point = self.nominal.with_values({**self.nominal.values, **values})
        state = point.state()
        steady, _ = linearised_point(self.prepared, state)
        slope = point.values["contact.kt"]
        friction = friction_law(
            self.reference.system, state, steady, slope, self.saturation, self.kind
        )
        made = motion_point(self.reference, steady, state, friction, BAND, 1e-9)
        return ContactOscillator(self.reference.system, made)


def linear_modes(osc):
    """Oscillating roots (m,), fastest growth first, and right vectors (n, m) of small motions."""
    zero = np.zeros((1, osc.n))
    C, K = osc.tangent(zero, zero)
    lam, psi = dense_roots(C[0], K[0], (0.0, np.inf))
    order = [k for k in np.argsort(-lam.real) if lam[k].imag > 0]
    return lam[order], psi[:, order]


# -- curves and cycles of small models ------------------------------------------------------------
def growth_curve(osc, lam, phi, size, harmonics, stop, steps=None):
    """Equations and curve of the added damping from a complex mode on; its zeros (C) are cycles."""
    equations = CycleEquations(osc, harmonics, abs(lam.imag))
    u = equations.pack(linear_motion(phi, lam, equations.scale[: osc.n], size))
    equations.accepted(u)
    along = np.zeros(len(u))
    along[-2] = 1.0
    tests = {ZERO: lambda u, _: float(u[-1])}

    def ended(u):
        if np.linalg.norm(u[osc.n : -3]) > MAX_HARMONICS_OVER_FIRST:
            return OTHER_RESONANCE
        return FAR if stop(equations.motion(u)) else ""

    return equations, follow(equations, u, along, steps or Steps(), tests, ended, watched=-1)


def refined(equations, motion):
    """The cycle near a motion at its own mu, and the residual."""
    u = equations.pack(motion)
    equations.accepted(u)
    normal = np.zeros(len(u))
    normal[-1] = 1.0
    u, residual, *_ = newton(equations, u, normal, float(u[-1]))
    return equations.motion(u), residual
