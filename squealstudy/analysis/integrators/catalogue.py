"""The integrators that can be charted, with their options."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from squealstudy.analysis.integrators.options import IntegratorEntry, Option

AITKEN = Option(True, "relax the contact iteration after Aitken")
EXTRAPOLATE = Option(True, "predict the contact forces from two steps, else from one")
HALVINGS = Option(4, "times that a step which does not converge is halved", 0, 20)
MOCKUP = Option("auto", "solve for points that stick within the iteration", words=("auto", "never"))
ITERATION = {
    "aitken": AITKEN,
    "extrapolate": EXTRAPOLATE,
    "max_halvings": HALVINGS,
    "mockup": MOCKUP,
}
NEWTON = {
    "prewarp": Option(False, "frequencies and dampings that cancel the period error"),
    "extrapolate": EXTRAPOLATE,
    "max_halvings": HALVINGS,
    "single_storage": Option(False, "observation matrix in single precision"),
}
NEWMARK = {
    **NEWTON,
    "aitken": AITKEN,
    "contact_factor": Option(1.0, "factor on the contact stiffness of the Jacobian", 0.0),
    "contact_stiffness": Option(
        0.0, "uniform contact stiffness of the Jacobian, Pa/m; 0 for the static tangents", 0.0
    ),
    "mockup": Option(
        "auto", "tangential damping in the Jacobian", words=("auto", "always", "never")
    ),
}
EXPLICIT_VELOCITY = Option(
    "extrapolated",
    "velocity that friction sees: that of half a step before (order 1), or extrapolated (order 2)",
    words=("extrapolated", "lagged"),
)
ADAPTIVE = {
    "rtol": Option(1e-6, "relative tolerance", 1e-14, 1.0),
    "atol": Option(
        0.0, "absolute tolerance over the scale of each coordinate; 0: rtol / 1000", 0.0, 1.0
    ),
    "max_evaluations": Option(0, "of the right-hand side before giving up; 0: any", 0),
}

INTEGRATORS: Mapping[str, IntegratorEntry] = MappingProxyType(
    {
        "newmark": IntegratorEntry("Newmark", "average acceleration, fixed Jacobian", NEWMARK),
        "newmark_newton": IntegratorEntry(
            "Newmark, Newton", "average acceleration, a fresh Jacobian an iteration", NEWTON
        ),
        "exponential": IntegratorEntry(
            "exponential",
            "resolved free modes exact, contact by the trapezoidal rule, iterated as Newmark's",
            {
                "exact_limit": Option(
                    2.0, "omega h beyond which a mode moves by average acceleration", 0.0
                ),
                **{name: option for name, option in NEWMARK.items() if name != "prewarp"},
            },
        ),
        "hht_alpha": IntegratorEntry(
            "HHT-alpha",
            "Hilber, Hughes & Taylor 1977, fixed Jacobian",
            {"alpha": Option(-0.1, "0 is Newmark; lower damps more", -1 / 3, 0.0), **ITERATION},
        ),
        "generalised_alpha": IntegratorEntry(
            "generalised alpha",
            "Chung & Hulbert 1993, fixed Jacobian",
            {"rho_inf": Option(0.8, "spectral radius at high frequency", 0.0, 1.0), **ITERATION},
        ),
        "discrete_gradient": IntegratorEntry(
            "discrete gradient",
            "midpoint rule, contact forces as difference quotients of their potential",
            {
                "iteration_tolerance": Option(
                    0.0, "force balance, relative; 0: the run's own tolerances", 0.0, 0.1
                ),
                **ITERATION,
            },
        ),
        "central_difference": IntegratorEntry(
            "central difference",
            "explicit, velocities at half steps",
            {"velocity": EXPLICIT_VELOCITY},
        ),
        "exponential_2": IntegratorEntry(
            "exponential, order 2", "free modes exact, contact by PEC of order 2", {}
        ),
        "exponential_3": IntegratorEntry(
            "exponential, order 3",
            "free modes exact, contact by PEC of order 3",
            {"start_parts": Option(16, "parts of the first step, of order 2", 1, 1000)},
        ),
        "dop853": IntegratorEntry(
            "DOP853", "explicit Runge-Kutta of order 8, adaptive (Hairer)", ADAPTIVE
        ),
        "radau": IntegratorEntry("Radau", "implicit Runge-Kutta of order 5, adaptive", ADAPTIVE),
        "bdf": IntegratorEntry("BDF", "backward differences of orders 1 to 5, adaptive", ADAPTIVE),
        "lsoda": IntegratorEntry(
            "LSODA", "Adams and BDF with automatic switching, adaptive (Petzold)", ADAPTIVE
        ),
    }
)
