"""Labels of two modes across a veering: by shapes over one step, then refined.

Frequencies of two oscillators with squared frequencies w^2 (1 +- s x) and a coupling c w^2 never
cross: the lower mode stays the lower. Their shapes turn within a width 2 c / s of x. Over a longer
step shapes alone exchange the labels. A veering may be so narrow that a mode keeps its shape
(`MIN_FOLLOWED_MAC`) when it takes the other's place. From both ends that is a crossing, and either
labelling is right.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    RECOVERED,
    WRONG,
    CaseResult,
    Knob,
    StabilityCase,
)
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.modes.tracking.pairing import Pairing, mac, pair_modes
from squealstudy.modes.tracking.refinement import Modes, StepRefinement

OMEGA = 2 * np.pi * 1000.0
# MAC above which a mode keeps its shape; refinement asks for 0.99 in a sub-step, ends may show less
MIN_FOLLOWED_MAC = 0.95
SLOPE = 0.1  # s, relative change of w^2 over x = 1

KNOBS = (
    Knob("step", "change of the parameter x", 0.1, low=1e-6, high=1.0),
    Knob("width", "change of x over which the shapes turn", 0.1, low=1e-9, high=1.0),
    Knob("middle", "x at the middle of the step, in steps", 0.0, low=-1.0, high=1.0),
    Knob("damping_ratio", "of both modes", 0.01, low=0.0, high=0.3),
)


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the best alternative over the direct pairing: 1 where it is as good.

    `error` is the share of modes with the other's label, and `cost` the number of points solved in
    between.
    """
    predicted = knobs["step"] / knobs["width"]
    ends = [np.array([knobs["step"] * (knobs["middle"] + x)]) for x in (-0.5, 0.5)]
    a, b = (veering(x, knobs) for x in ends)
    direct = pair_modes(a.lam, a.shapes, b.lam, b.shapes)
    refinement = StepRefinement(lambda x: veering(x, knobs))
    refined = refinement.pair(a, b, *ends)
    measured = 1.0 / float(np.maximum(direct.trust.min(), 1e-300))
    error = exchanged(refined, a, b)
    flagged = bool(refined.ambiguous.any())
    outcome = WRONG if error else RECOVERED if exchanged(direct, a, b) else CONVERGED
    by = "refinement" if outcome == RECOVERED else "ambiguous" if flagged else ""
    return CaseResult(
        outcome=outcome,
        predicted=predicted,
        measured=measured,
        error=error,
        cost=refinement.points,
        by=by,
        flagged=flagged,
    )


def veering(x: np.ndarray, knobs: Mapping[str, float]) -> Modes:
    """Roots and shapes of both modes at x (1,), ascending in frequency."""
    tilt, coupling = SLOPE * float(x[0]), SLOPE * knobs["width"] / 2
    K = OMEGA**2 * np.array([[1.0 + tilt, coupling], [coupling, 1.0 - tilt]])
    C = 2 * knobs["damping_ratio"] * OMEGA * np.eye(2)
    lam, psi = dense_roots(C, K, (0.0, np.inf))
    return Modes(lam, psi.T)


def exchanged(pairing: Pairing, a: Modes, b: Modes) -> float:
    """Share of the modes that got the other's label, unless their shapes clearly say so."""
    macs = mac(a.shapes, b.shapes)
    wrong = [
        partner != i and not (partner >= 0 and macs[i, partner] > MIN_FOLLOWED_MAC)
        for i, partner in enumerate(pairing.partner)
    ]
    return float(np.mean(wrong))


TRACKING = StabilityCase(
    name="tracking",
    title="labels of two modes across a veering",
    boundary="step = width of the veering",
    settings=KNOBS,
    measure=measure,
)
