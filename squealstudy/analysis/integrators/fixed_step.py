"""Runs of the integrators of fixed step, on the kernels' arrays of the product."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.analysis.integrators.options import Value
from squealstudy.analysis.transient.arrays import (
    kernel_settings,
    modal_arrays,
    saved_arrays,
    work_arrays,
)
from squealstudy.analysis.transient.observation import aligned_zeros, observation
from squealstudy.analysis.transient.propagators import propagators
from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.analysis.transient.simulate import result_of
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.errors import ModelError
from squealstudy.kernels import integrator_layout
from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.alpha_method import alpha_method
from squealstudy.kernels.central_difference import central_difference
from squealstudy.kernels.exponential_steps import exponential_steps
from squealstudy.kernels.integrator_layout import N_COEFFICIENT, Scheme


@dataclass(frozen=True)
class Arrays:
    """What a kernel of one design gets.

    Attributes
    ----------
    B : ndarray (nt, n, ROWS)
    modal, options, work, saved : newmark_layout tuples
    settings : TransientSettings
        Those that they were made for.
    n : int
        Modes without padding.
    """

    B: np.ndarray
    modal: layout.Modal
    options: layout.Settings
    work: layout.Work
    saved: layout.Saved
    settings: TransientSettings
    n: int

    @property
    def kernel(
        self,
    ) -> tuple[np.ndarray, layout.Modal, layout.Settings, layout.Work, layout.Saved]:
        """The first arguments of most kernels."""
        return self.B, self.modal, self.options, self.work, self.saved

    def result(self) -> TransientResult:
        """After the kernel came to its end."""
        return result_of(
            self.work, self.saved, self.settings, 0, (self.n, self.modal.sensors.shape[1])
        )


def check_state(system: ModalSystem, q0: np.ndarray, v0: np.ndarray) -> None:
    """ModelError for an initial state that does not fit or is not finite."""
    for initial in (q0, v0):
        if np.shape(initial) != (system.n,) or not np.isfinite(initial).all():
            raise ModelError(f"an initial state needs {system.n} finite values")


def arrays(
    system: ModalSystem,
    design: TransientDesign,
    settings: TransientSettings,
    q0: np.ndarray,
    v0: np.ndarray,
    options: Mapping[str, Value],
) -> Arrays:
    """The kernels' arrays; options with the names of settings replace these.

    Raises
    ------
    ModelError
        A design that does not fit the system.
    """
    settings = own_settings(settings, options)
    modal, _ = modal_arrays(system, [design], settings)
    B = observation(system, False)
    kept = kernel_settings(settings, False)
    work = work_arrays(modal, kept, B)
    work = work._replace(
        point=np.zeros((1, integrator_layout.N_POINT, work.point.shape[2])),
        real=np.concatenate([work.real, np.zeros((1, 1))], axis=1),
    )
    for row, trial, initial in (
        (layout.Q, layout.Q_TRIAL, q0),
        (layout.V, layout.V_TRIAL, v0),
    ):
        work.x[0, row, : system.n] = initial
        work.x[0, trial, : system.n] = initial
    saved = saved_arrays(modal, system.n, settings)
    return Arrays(B, modal, kept, work, saved, settings, system.n)


def own_settings(settings: TransientSettings, options: Mapping[str, Value]) -> TransientSettings:
    """Settings whose knobs of Newmark's method are those of `options`, or off."""
    tolerance = float(options.get("iteration_tolerance", 0.0)) or settings.tolerance
    ratio = tolerance / settings.tolerance
    return replace(
        settings,
        method="newmark",
        tolerance=tolerance,
        tolerance_t=settings.tolerance_t * ratio,
        max_halvings=int(options.get("max_halvings", 0)),
        aitken=bool(options.get("aitken", True)),
        contact_factor=1.0,
        contact_stiffness=None,
        mockup=str(options.get("mockup", "never")),
        prewarp=False,
        single_storage=False,
        extrapolate=bool(options.get("extrapolate", True)),
    )


def run_alpha(case: Arrays, scheme: Scheme) -> TransientResult:
    """HHT, generalised alpha and the discrete gradient."""
    modal = with_answers(case.modal, scheme, case.settings.step)
    alpha_method(case.B, modal, case.options, scheme, case.work, case.saved)
    return case.result()


def with_answers(modal: layout.Modal, scheme: Scheme, h: float) -> layout.Modal:
    """The same with the answers of q_f and v_f to the pull, and the points' compliance to it."""
    share = (1.0 - scheme.alpha_f) / (1.0 - scheme.alpha_m)
    steps = modal.steps.copy()
    for level, E in enumerate(steps[0]):
        part = h / 2**level
        b_q, b_v = share * scheme.beta * part * part, share * scheme.gamma * part
        D = 1.0 + b_v * modal.modes[0, layout.C] + b_q * modal.modes[0, layout.W2]
        E[layout.LAST_Q], E[layout.LAST_V] = b_q / D, b_v / D
    rows = modal.tangential
    compliance = np.ascontiguousarray((rows * steps[0, 0, layout.LAST_V]) @ rows.T)
    own = compliance.diagonal().reshape(-1, 2).max(axis=1)
    return modal._replace(steps=steps, compliance=compliance, own=own)


def hht(alpha: float) -> Scheme:
    """HHT-alpha: second order, unconditionally stable for free motion."""
    return Scheme(0.0, -alpha, 0.25 * (1.0 - alpha) ** 2, 0.5 - alpha, False)


def generalised(rho_inf: float, gradient: bool = False) -> Scheme:
    """Chung & Hulbert's optimal member of a spectral radius; 1 is the midpoint rule."""
    alpha_m = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0)
    alpha_f = rho_inf / (rho_inf + 1.0)
    gap = 1.0 - alpha_m + alpha_f
    return Scheme(alpha_m, alpha_f, 0.25 * gap * gap, gap - 0.5, gradient)


def run_central(case: Arrays, lagged: bool) -> TransientResult:
    """Central differences."""
    central_difference(case.B, case.modal, case.options, lagged, case.work, case.saved)
    return case.result()


def run_exponential(case: Arrays, parts: int) -> TransientResult:
    """Order 2 with parts = 0; else order 3 with a first step of so many parts."""
    w2, c = case.modal.modes[0, layout.W2], case.modal.modes[0, layout.C]
    h = case.settings.step
    E = aligned_zeros(2, N_COEFFICIENT, len(w2))
    E[0] = propagators(w2, c, h)
    if parts > 0:
        E[1] = propagators(w2, c, h / parts)
    exponential_steps(case.B, case.modal, case.options, E, parts, case.work, case.saved)
    return case.result()
