"""The laws of contact and friction at a point, for kernels: chosen by a design's row of laws.

The choice among all registered laws is a module that `law_text` writes beside the compiled kernels:
its folder is named by a hash of all sources of kernels and laws.
"""

from __future__ import annotations

import importlib.util
import math
import os
import sys
from types import ModuleType

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.kernels.jit import compiled_directory, fast_kernel, kernel
from squealstudy.kernels.law_set import CONTACT, CURVES, SLOPES, code_of
from squealstudy.kernels.law_text import friction_place, law_names, law_text
from squealstudy.kernels.newmark_layout import (
    CONSTANT,
    LAW_CONTACT,
    LAW_CURVE,
    LAW_FIRST,
    LAW_MU,
    LAW_REGULARISATION,
    LAW_SLOPE,
)
from squealstudy.laws import REGULARISATIONS, ContactLaw, FrictionLaw

FRICTION_PLACE = friction_place(CONTACT)
N_LAW = FRICTION_PLACE + 1 + max(len(curve.parameters) for curve in CURVES)


def _written() -> ModuleType:
    """The module of the choice, written where it is not there yet."""
    path = compiled_directory() / "law_choice.py"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        own = path.with_suffix(f".{os.getpid()}")
        own.write_text(law_text(CONTACT, CURVES, SLOPES), encoding="utf-8")
        own.replace(path)
    spec = importlib.util.spec_from_file_location("squealstudy_law_choice", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    vars(module).update(law_names(CONTACT, CURVES, SLOPES))
    vars(module).update(kernel=kernel, fast_kernel=fast_kernel, math_sqrt=math.sqrt)
    sys.modules[spec.name] = module  # where numba looks when it loads what was compiled
    spec.loader.exec_module(module)
    return module


_choice = _written()
contact_at = _choice.contact_at  # (law, g) -> p [Pa], -dp/dg [Pa/m]
potential = _choice.potential  # (law, g) -> stored energy per area [J/m2]
pressures = _choice.pressures  # (law, gap, x, p, first, last): p of points at gap + x
mean_pressures = _choice.mean_pressures  # (.., x, x0, p, ..): over a step that began at gap + x0
mu_at = _choice.mu_at  # (law, s, p) -> mu, dmu/ds [s/m], dmu/dp [1/Pa]
resistance = _choice.resistance  # (law, k_t, bound, s) -> traction over sliding speed
stick_slope = _choice.slope  # (law, k_t, bound, s) -> slope to solve a sticking point with
partials = _choice.partials  # (law, k_t, bound, s) -> traction, its derivatives by s and bound
frictions = _choice.frictions  # (law, area, factor, w1, w2, p, t1, t2, first, last): forces


def law_row(contact: ContactLaw, friction: FrictionLaw) -> np.ndarray:
    """Laws of a design point (N_LAW,).

    Raises
    ------
    ModelError
        A law that the kernels of this process do not know; friction that is not finite at rest.
    """
    curve = friction.curve
    row = np.zeros(N_LAW)
    row[LAW_CONTACT] = code_of(contact.definition, CONTACT)
    row[LAW_CURVE] = CONSTANT if curve.constant else code_of(curve.definition, CURVES)
    row[LAW_REGULARISATION] = code_of(REGULARISATIONS[friction.regularisation], SLOPES)
    row[LAW_SLOPE] = friction.k_t
    at_rest = curve.at_rest(friction.friction, np.zeros(1))
    row[LAW_MU] = max(friction.friction, float(np.max(at_rest)))
    if not np.isfinite(row[LAW_MU]):
        raise ModelError(f"friction law '{curve.kind}' is not finite at rest without pressure")
    row[LAW_FIRST : LAW_FIRST + len(contact.parameters)] = contact.parameters
    own = (friction.friction, *curve.parameters)
    row[FRICTION_PLACE : FRICTION_PLACE + len(own)] = own
    return row


@kernel
def friction_at(
    law: np.ndarray, factor: float, p: float, w1: float, w2: float
) -> tuple[float, float, bool]:
    """Traction (t1, t2) [Pa] of one point and whether it sticks; NaN in, NaN out.

    `factor` is that on the point's friction coefficient.
    """
    s = math.sqrt(w1 * w1 + w2 * w2)
    mu, _, _ = mu_at(law, s, p)
    bound = factor * mu * p
    f = resistance(law, law[LAW_SLOPE], bound, s)
    return -f * w1, -f * w2, law[LAW_SLOPE] * s < bound


@kernel
def friction_tangent(
    law: np.ndarray, factor: float, p: float, w1: float, w2: float
) -> tuple[float, float, float, float, float]:
    """Derivatives of the traction: dt1/dw1, dt1/dw2 = dt2/dw1, dt2/dw2 [Pa s/m], dt1/dp, dt2/dp."""
    k_t, s = law[LAW_SLOPE], math.sqrt(w1 * w1 + w2 * w2)
    mu, by_speed, by_pressure = mu_at(law, s, p)
    bound = factor * mu * p
    if bound <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if s == 0.0:
        return -k_t, 0.0, -k_t, 0.0, 0.0
    f, f_s, f_b = partials(law, k_t, bound, s)
    along = f_s + f_b * factor * by_speed * p
    f_p = f_b * factor * (mu + p * by_pressure)
    e1, e2 = w1 / s, w2 / s
    across = f / s
    d11 = -(along * e1 * e1 + across * e2 * e2)
    d22 = -(along * e2 * e2 + across * e1 * e1)
    return d11, -(along - across) * e1 * e2, d22, -f_p * e1, -f_p * e2
