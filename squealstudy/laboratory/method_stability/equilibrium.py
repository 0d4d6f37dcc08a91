"""Case that maps where Newton's method finds steady sliding of a contact that friction presses on.

A mass on two coupled springs, x along the sliding and y away from the contact; friction mu A p
pulls at x, and through the coupling at y. With k the stiffness of y where x is free

    k y = F + (1 - mu / mu_c) A p(y),    p = p0 exp(-lambda y),    mu_c = k_xx / |k_xy|,

where F is the load, negative if it presses. Up to mu_c there is one equilibrium, with or without
tension. Beyond mu_c friction pulls the mass into the contact, and there is an equilibrium while

    (mu / mu_c - 1) lambda A p0 / k <= exp(lambda F / k - 1).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq

from squealstudy.errors import ConvergenceError
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    SLOW,
    WRONG,
    CaseResult,
    Knob,
    StabilityCase,
    failed,
)
from squealstudy.laws import contact_law
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.assembly import Assembly, ContactInterface
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.minimal_parts import point_mass
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.working_point import MAX_ITERATIONS, working_point

K_XX, K_XY, K_YY = 1e7, -8e6, 1.64e7  # N/m: mu_c = 1.25, k = 1e7
CONDENSED_STIFFNESS = K_YY - K_XY**2 / K_XX
CRITICAL = K_XX / abs(K_XY)
AREA_M2, P_0 = 1e-3, 1e5  # m2, Pa
SLOW_FROM = 30  # a solution with more Newton iterations is slow
DIVERGES = "real positive root"
MAX_GAP_ERROR = 1e-6  # largest error of a gap that is right, in 1/lambda

KNOBS = (
    Knob("friction", "friction coefficient", 0.5, low=0.0, high=5.0),
    Knob("pressure", "of the load on the area of the contact", 1e6, low=0.0, high=1e9, unit="Pa"),
    Knob("tension", "constant pull away from the contact", 0.0, low=0.0, high=1e6, unit="N"),
    Knob("lambda", "exponent of the contact law", 5e5, low=1e2, high=1e9, unit="1/m"),
    Knob(
        "start",
        "gap of the first guess minus that under a uniform pressure, in 1/lambda",
        0.0,
        low=-500.0,
        high=500.0,
    ),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """Search the working point at one setting of the knobs.

    `measured` is the number of Newton iterations over the allowed number, `error` the distance to
    the gap of the closed form, in 1/lambda. Beyond mu_c there is a second equilibrium, pressed and
    unstable: a real positive root of its linearisation shows that it is the wrong one.
    """
    lam, load = knobs["lambda"], knobs["tension"] - knobs["pressure"] * AREA_M2
    predicted = knobs["friction"] / largest_friction(lam, load)
    law = contact_law("exponential", p0=P_0, lam=lam)
    point = OperatingPoint(knobs["friction"], knobs["pressure"], 1.0, law)
    space = one_point(knobs["tension"])
    uniform = law.gap_at(max(knobs["pressure"], 1.0))
    start = np.array([uniform + knobs["start"] / lam])
    try:
        with np.errstate(all="ignore"):
            steady = working_point(space, point, start)
    except ConvergenceError as reason:
        return failed(reason.status, predicted=predicted, measured=np.inf, cost=MAX_ITERATIONS)
    exact = equilibrium_gap(lam, load, knobs["friction"])
    error = lam * abs(float(steady.gap[0]) - exact) if np.isfinite(exact) else np.inf
    slow = steady.iterations > SLOW_FROM
    outcome = WRONG if not error < MAX_GAP_ERROR else SLOW if slow else CONVERGED
    diverges = outcome == WRONG and diverges_at(float(steady.tangent[0]), knobs["friction"])
    return CaseResult(
        outcome=outcome,
        predicted=predicted,
        measured=steady.iterations / MAX_ITERATIONS,
        error=error,
        cost=steady.iterations,
        by=DIVERGES if diverges else "",
        flagged=diverges,
    )


def one_point(tension: float) -> ContactSpace:
    """The mass on its springs, condensed to its contact point."""
    K = np.array([[K_XX, K_XY], [K_XY, K_YY]])
    values, vectors = np.linalg.eigh(K)
    springs = SpringInterface("springs", sp.csr_matrix(vectors.T), values)
    contact = ContactInterface(
        N=sp.csr_matrix([[0.0, 1.0]]),
        T=sp.csr_matrix([[1.0, 0.0]]),
        T_perp=sp.csr_matrix((1, 2)),
        area=np.array([AREA_M2]),
        gap0=np.zeros(1),
        radius=np.ones(1),
        law=contact_law(),
        frictional=np.ones(1),
    )
    loads = np.array([0.0, -AREA_M2]), np.array([0.0, tension])
    assembly = Assembly((point_mass("mass", 1.0),), contact, (springs,), *loads)
    return contact_space(assembly, CONDENSED_STIFFNESS / AREA_M2, np.zeros((2, 0)))


def diverges_at(tangent: float, friction: float) -> bool:
    """Whether steady sliding diverges at a contact tangent [Pa/m]: a real positive root."""
    k_n = AREA_M2 * tangent
    K = np.array([[K_XX, K_XY - friction * k_n], [K_XY, K_YY + k_n]])
    lam, _ = dense_roots(np.zeros((2, 2)), K, (0.0, np.inf))
    return bool(((lam.real > 0) & (lam.imag == 0)).any())


def largest_friction(lam: float, load: float) -> float:
    """Largest friction coefficient at which there is an equilibrium under a load F [N]."""
    exponent = min(lam * load / CONDENSED_STIFFNESS - 1.0, 700.0)
    return float(CRITICAL * (1.0 + CONDENSED_STIFFNESS / (lam * AREA_M2 * P_0) * np.exp(exponent)))


def equilibrium_gap(lam: float, load: float, friction: float) -> float:
    """The gap [m] of the stable equilibrium; NaN where there is none."""
    net_share = 1.0 - friction / CRITICAL
    free = lam * load / CONDENSED_STIFFNESS  # gaps in 1/lambda from here on
    push = net_share * lam * AREA_M2 * P_0 / CONDENSED_STIFFNESS
    if push == 0.0:
        return free / lam
    if push > 0.0:  # z - free = push exp(-z), in logarithms: no overflow

        def excess(s: float) -> float:
            return s + free + np.exp(s) - np.log(push)

        top = np.log(push) - free
        s = brentq(excess, min(top, 0.0) - 1.0, np.log(max(top, 0.0) + 1.0) + 1.0, xtol=1e-13)
        return float((free + np.exp(s)) / lam)
    fold = np.log(-push)  # the two equilibria are on either side of it
    if fold > free - 1.0:
        return float("nan")
    return float(brentq(lambda z: z - free - push * np.exp(-z), fold, free, xtol=1e-13) / lam)


WORKING_POINT = StabilityCase(
    name="working_point",
    title="steady sliding of one contact point that friction presses on",
    boundary="largest friction at which the closed form has an equilibrium",
    settings=KNOBS,
    measure=measure,
)
