"""Nearly dependent vectors made M-orthonormal: which directions are kept, and how exactly."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    RECOVERED,
    WRONG,
    CaseResult,
    Knob,
    StabilityCase,
    failed,
)
from squealstudy.reduction.orthonormal import MODE_TOLERANCE, complete_basis

N_ROWS, N_HELD, N_TRACES = 40, 5, 8
# relative singular value whose square, in the Gram matrix, is round-off
MIN_GRAM_SINGULAR_VALUE = float(np.sqrt(np.finfo(float).eps))
MAX_ORTHONORMALITY_ERROR = 1e-10  # largest entry of T^T M T - I of a basis that is right

KNOBS = (
    Knob("dependence", "smallest singular value over the largest", 1e-3, low=1e-14, high=1.0),
    Knob("tolerance", "smallest relative value that is kept", MODE_TOLERANCE, low=1e-14, high=0.5),
    Knob("held", "size of the part that the basis holds already", 1.0, low=1e-3, high=1e9),
)


class Component(NamedTuple):
    """Mass and stiffness (n, n), free modes phi (n, m) and other directions `rest` (n, t).

    Modes and directions are M-orthonormal.
    """

    M: sp.csr_matrix
    K: sp.csr_matrix
    phi: np.ndarray
    rest: np.ndarray


def measure(knobs: Mapping[str, float]) -> CaseResult:
    """`measured` is the number of lost directions, or the error of orthonormality over its limit.

    `error` is the largest part of a vector that the basis lacks, relative to the largest vector. Up
    to the tolerance it is allowed.
    """
    M, K, phi, rest = chain()
    rng = np.random.default_rng(2)
    mix = la.qr(rng.normal(size=(N_TRACES, N_TRACES)))[0]
    sizes = np.geomspace(1.0, knobs["dependence"], N_TRACES)
    inside = knobs["held"] * phi @ rng.normal(size=(N_HELD, N_TRACES))
    vectors = (rest * sizes) @ mix + inside
    largest = float(np.sqrt(np.linalg.eigvalsh(vectors.T @ (M @ vectors))[-1]))
    predicted = max(knobs["tolerance"], MIN_GRAM_SINGULAR_VALUE) * largest / knobs["dependence"]
    try:
        T, _ = complete_basis(M, K, phi, [(vectors, knobs["tolerance"])])
    except la.LinAlgError:
        return failed("singular", predicted=predicted, cost=N_TRACES)
    n_lost = N_HELD + N_TRACES - T.shape[1]
    off = float(np.abs(T.T @ (M @ T) - np.eye(T.shape[1])).max())
    missing = vectors - T @ (T.T @ (M @ vectors))
    error = float(np.sqrt(np.abs(np.einsum("ij,ij->j", missing, M @ missing)).max())) / largest
    wrong = (
        off > MAX_ORTHONORMALITY_ERROR or error > knobs["tolerance"] + np.finfo(float).eps * N_ROWS
    )
    outcome = WRONG if wrong else RECOVERED if n_lost else CONVERGED
    return CaseResult(
        outcome=outcome,
        predicted=predicted,
        measured=max(float(n_lost), off / MAX_ORTHONORMALITY_ERROR),
        error=error,
        cost=T.shape[1],
        by="truncation" if n_lost else "",
        flagged=n_lost > 0,
    )


@cache
def chain() -> Component:
    """Forty unequal masses in a chain of springs, free at both ends."""
    rng = np.random.default_rng(1)
    masses = rng.uniform(0.5, 2.0, N_ROWS)
    ends = np.zeros(N_ROWS)
    ends[[0, -1]] = 1.0
    M = sp.diags(masses, format="csr")
    K = 1e6 * sp.diags([2.0 - ends, -np.ones(N_ROWS - 1), -np.ones(N_ROWS - 1)], [0, 1, -1])
    _, modes = la.eigh(K.toarray(), np.diag(masses))
    mixed = modes[:, N_HELD:] @ la.qr(rng.normal(size=(N_ROWS - N_HELD, N_ROWS - N_HELD)))[0]
    return Component(M, K.tocsr(), modes[:, :N_HELD], mixed[:, :N_TRACES])


ORTHONORMALISATION = StabilityCase(
    name="orthonormalisation",
    title="near-dependent traces made M-orthonormal",
    boundary="smallest relative singular value = tolerance, 1.5e-8 at least",
    settings=KNOBS,
    measure=measure,
)
