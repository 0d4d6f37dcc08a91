"""The laws of contact and friction at a point, for kernels: chosen by a design's row of laws.

The choice among the package's laws is a module that `law_text` writes beside the compiled kernels:
its folder is named by a hash of all sources of kernels and laws.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import zip_longest

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.kernels.addresses import CALLS
from squealstudy.kernels.jit import compiled_directory, fast_kernel, kernel
from squealstudy.kernels.law_set import CONTACT, CURVES, SLOPES, code_of
from squealstudy.kernels.law_text import (
    contact_text,
    curve_text,
    friction_text,
    law_module,
    law_names,
    slope_text,
)
from squealstudy.kernels.newmark_layout import (
    CONSTANT,
    LAW_CONTACT,
    LAW_CURVE,
    LAW_FIRST,
    LAW_MU,
    LAW_REGULARISATION,
    LAW_SLOPE,
    OUTSIDE,
)
from squealstudy.kernels.outside import contact_addresses, friction_addresses
from squealstudy.laws import REGULARISATIONS, ContactLaw, FrictionLaw

FRICTION_PLACE = LAW_FIRST + max(len(law.parameters) for law in CONTACT.values())
N_LAW = FRICTION_PLACE + 1 + max(len(curve.parameters) for curve in CURVES.values())

_COEFFICIENTS = {CONSTANT: None, **CURVES}
_choice = law_module(
    compiled_directory() / "law_choice.py",
    [
        *contact_text(CONTACT, LAW_FIRST, True),
        *curve_text(_COEFFICIENTS, FRICTION_PLACE, True),
        *slope_text(SLOPES, True),
        *friction_text(_COEFFICIENTS, SLOPES, FRICTION_PLACE, True),
    ],
    {
        **law_names(CONTACT, CURVES, SLOPES),
        **CALLS,
        "kernel": kernel,
        "fast_kernel": fast_kernel,
    },
)
contact_at = _choice.contact_at  # (law, g) -> p [Pa], -dp/dg [Pa/m]
potential = _choice.potential  # (law, g) -> stored energy per area [J/m2]
pressures = _choice.pressures  # (law, gap, x, p, first, last): p of points at gap + x
mean_pressures = _choice.mean_pressures  # (.., x, x0, p, ..): over a step that began at gap + x0
mu_at = _choice.mu_at  # (law, s, p) -> mu, dmu/ds [s/m], dmu/dp [1/Pa]
package_mu_at = _choice.package_mu_at  # the same of the package's laws, for loops over points
resistance = _choice.resistance  # (law, k_t, bound, s) -> traction over sliding speed
stick_slope = _choice.slope  # (law, k_t, bound, s) -> slope to solve a sticking point with
partials = _choice.partials  # (law, k_t, bound, s) -> traction, its derivatives by s and bound
frictions = _choice.frictions  # (law, area, factor, w1, w2, p, t1, t2, first, last): forces


def law_row(contact: ContactLaw, friction: FrictionLaw) -> np.ndarray:
    """Laws of a design point, (N_LAW,) and the parameters of laws from outside.

    Raises
    ------
    ModelError
        Friction that is not finite at rest.
    """
    curve, slope = friction.curve, REGULARISATIONS[friction.regularisation]
    row = np.zeros(N_LAW)
    row[LAW_CONTACT] = code_of(contact.definition, CONTACT)
    row[LAW_CURVE] = CONSTANT if curve.constant else code_of(curve.definition, CURVES)
    row[LAW_REGULARISATION] = code_of(slope, SLOPES)
    row[LAW_SLOPE] = friction.k_t
    at_rest = curve.at_rest(friction.friction, np.zeros(1))
    row[LAW_MU] = max(friction.friction, float(np.max(at_rest)))
    if not np.isfinite(row[LAW_MU]):
        raise ModelError(f"friction law '{curve.kind}' is not finite at rest without pressure")
    outside = row[[LAW_CONTACT, LAW_CURVE, LAW_REGULARISATION]] == OUTSIDE
    row, first = _with_values(row, contact.parameters, LAW_FIRST, outside[0])
    if outside[0]:
        _put(row, contact_addresses(contact.definition, first))
    own = (friction.friction, *curve.parameters)
    row, first = _with_values(row, own, FRICTION_PLACE, outside[1])
    if outside[1:].any():
        curves = {int(row[LAW_CURVE]): None if curve.constant else curve.definition}
        _put(row, friction_addresses(curves, {int(row[LAW_REGULARISATION]): slope}, first))
    return row


def _with_values(
    row: np.ndarray, values: tuple[float, ...], place: int, outside: bool
) -> tuple[np.ndarray, int]:
    """A row with the values of a law, and where: at their place, or behind all."""
    if outside:
        return np.concatenate([row, values]), len(row)
    row[place : place + len(values)] = values
    return row, place


def _put(row: np.ndarray, found: dict[int, float]) -> None:
    for place, address in found.items():
        row[place] = address


def law_rows(laws: Iterable[tuple[ContactLaw, FrictionLaw]]) -> np.ndarray:
    """Those of design points, with zeros behind the shorter ones."""
    return side_by_side(law_row(contact, friction) for contact, friction in laws)


def side_by_side(rows: Iterable[np.ndarray]) -> np.ndarray:
    """Rows of laws as one array, with zeros behind the shorter ones."""
    full: np.ndarray = np.array([*zip_longest(*rows, fillvalue=0.0)]).T
    return np.ascontiguousarray(full)


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
