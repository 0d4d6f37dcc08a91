"""One modal system in time by any of the integrators, with one kind of result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from squealstudy.analysis.integrators.adaptive import SOLVERS, run_adaptive
from squealstudy.analysis.integrators.catalogue import INTEGRATORS
from squealstudy.analysis.integrators.fixed_step import (
    Arrays,
    arrays,
    check_state,
    generalised,
    hht,
    run_alpha,
    run_central,
    run_exponential,
)
from squealstudy.analysis.integrators.options import Value
from squealstudy.analysis.transient.settings import (
    METHODS,
    TransientResult,
    TransientSettings,
)
from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.errors import ParameterError

__all__ = ["INTEGRATORS", "integrate"]

FIXED_STEP: Mapping[str, Callable[[Arrays, Mapping[str, Any]], TransientResult]] = {
    "hht_alpha": lambda case, x: run_alpha(case, hht(x["alpha"])),
    "generalised_alpha": lambda case, x: run_alpha(case, generalised(x["rho_inf"])),
    "discrete_gradient": lambda case, x: run_alpha(case, generalised(1.0, gradient=True)),
    "central_difference": lambda case, x: run_central(case, x["velocity"] == "lagged"),
    "exponential_2": lambda case, x: run_exponential(case, 0),
    "exponential_3": lambda case, x: run_exponential(case, int(x["start_parts"])),
}


def integrate(
    name: str,
    system: ModalSystem,
    design: TransientDesign,
    settings: TransientSettings,
    q0: np.ndarray,
    v0: np.ndarray,
    options: Mapping[str, Value],
) -> TransientResult:
    """Integrate one design point by an integrator of `INTEGRATORS`.

    Parameters
    ----------
    name : str
    system : ModalSystem
    design : TransientDesign
    settings : TransientSettings
        Duration, step, rows saved, tolerances and the limit of iterations; what else they hold
        is Newmark's own and comes from `options`. Adaptive solvers take the step only to name the
        times of the rows.
    q0, v0 : ndarray (n,)
        Initial deviation and velocity.
    options : mapping
        The method's own; what is left out has its default.

    Returns
    -------
    TransientResult
        A failed run has an outcome and reaches less far. `mean_iterations` counts evaluations of
        the contact forces a step (of the solver, for the adaptive ones), with those that methods
        of an inner point need for rows saved.

    Raises
    ------
    ParameterError
        An unknown integrator or option, or a value out of its range.
    ModelError
        A design that does not fit the system, or an initial state that is not finite.
    """
    if name not in INTEGRATORS:
        raise ParameterError("integrator", f"'{name}' is none of {', '.join(INTEGRATORS)}")
    values = INTEGRATORS[name].values(options)
    check_state(system, q0, v0)
    if name in METHODS:
        own = newmark_settings(name, settings, values)
        return simulate(system, [design], own, q0, v0)[0]
    case = arrays(system, design, settings, q0, v0, values)
    if name in SOLVERS:
        return run_adaptive(name, system, design, case, values)
    return FIXED_STEP[name](case, values)


def newmark_settings(
    name: str, settings: TransientSettings, values: Mapping[str, Any]
) -> TransientSettings:
    """Settings of the product's own methods with these options."""
    given = {"prewarp": False, **values}
    if "contact_stiffness" in given:
        given["contact_stiffness"] = given["contact_stiffness"] or None
    given["max_halvings"] = int(given["max_halvings"])
    return replace(settings, method=name, **given)
