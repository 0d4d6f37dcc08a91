"""The generalised-alpha family: methods with numerical damping, and one that conserves energy."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

from pydantic import Field

from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.alpha_method import alpha_method
from squealstudy.kernels.newmark_layout import Scheme
from squealstudy.laboratory.integrators.fixed_step import Iterated
from squealstudy.motion.arrays import point_compliance
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import KernelRun
from squealstudy.motion.system import ModalSystem, MotionPoint


class AlphaMethod(Iterated):
    """A method of the generalised-alpha family."""

    order = 2

    @abstractmethod
    def scheme(self) -> Scheme:
        """The coefficients of the step, by the options of this method."""

    def advance(self, case: KernelRun) -> None:
        """Integrate design 0 of the case to its end or failure."""
        modal = with_answers(case.modal, self.scheme(), case.settings.step)
        alpha_method(case.B, modal, case.options, self.scheme(), case.work, case.saved)


class HhtAlpha(AlphaMethod):
    """HHT-alpha: second order, unconditionally stable for free motion."""

    name = "hht_alpha"
    label = "HHT-alpha"
    description = "Hilber, Hughes & Taylor 1977, fixed Jacobian"

    alpha: float = Field(
        default=-0.1, ge=-1 / 3, le=0, description="0 is Newmark; lower damps more"
    )

    def scheme(self) -> Scheme:
        """The coefficients that follow from `alpha`."""
        beta = 0.25 * (1.0 - self.alpha) ** 2
        return Scheme(0.0, -self.alpha, beta, 0.5 - self.alpha, gradient=False)


class GeneralisedAlpha(AlphaMethod):
    """Chung & Hulbert's optimal method for a given spectral radius."""

    name = "generalised_alpha"
    label = "generalised alpha"
    description = "Chung & Hulbert 1993, fixed Jacobian"

    rho_inf: float = Field(default=0.8, ge=0, le=1, description="spectral radius at high frequency")

    def scheme(self) -> Scheme:
        """The coefficients that follow from `rho_inf`."""
        return generalised(self.rho_inf, gradient=False)


class DiscreteGradient(AlphaMethod):
    """The midpoint rule with forces that conserve the energy of impacts."""

    name = "discrete_gradient"
    label = "discrete gradient"
    description = "midpoint rule, contact forces as difference quotients of their potential"

    iteration_tolerance: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="force balance, relative; 0: the run's own tolerances",
    )

    def scheme(self) -> Scheme:
        """The coefficients of the midpoint rule."""
        return generalised(1.0, gradient=True)

    def run(self, system: ModalSystem, design: MotionPoint, settings: MotionSettings) -> Motion:
        """Integrate a design point at the method's own tolerance; a failure is an outcome."""
        tolerance = self.iteration_tolerance or settings.tolerance
        return super().run(system, design, replace(settings, tolerance=tolerance))


def generalised(rho_inf: float, gradient: bool) -> Scheme:
    """Chung & Hulbert's optimal method for a spectral radius; that of 1 is the midpoint rule."""
    alpha_m = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0)
    alpha_f = rho_inf / (rho_inf + 1.0)
    gap = 1.0 - alpha_m + alpha_f
    return Scheme(alpha_m, alpha_f, 0.25 * gap * gap, gap - 0.5, gradient)


def with_answers(modal: layout.ModalArrays, scheme: Scheme, h: float) -> layout.ModalArrays:
    """Arrays with what a unit pull adds to q_f and v_f, and the contact points' compliance."""
    share = (1.0 - scheme.alpha_f) / (1.0 - scheme.alpha_m)
    steps = modal.steps.copy()
    for level, E in enumerate(steps[0]):
        part = h / 2**level
        b_q, b_v = share * scheme.beta * part * part, share * scheme.gamma * part
        D = 1.0 + b_v * modal.modes[0, layout.C] + b_q * modal.modes[0, layout.W2]
        E[layout.LAST_Q], E[layout.LAST_V] = b_q / D, b_v / D
    compliance, self_compliance = point_compliance(modal.tangential, steps[0, 0, layout.LAST_V])
    return modal._replace(steps=steps, compliance=compliance, self_compliance=self_compliance)
