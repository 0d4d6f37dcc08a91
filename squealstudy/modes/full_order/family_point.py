"""One design point of a family of matrices, solved at full order."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.band_roots import pair_residuals, roots_in_band
from squealstudy.models.matrices.expression import ExpressionError
from squealstudy.models.matrices.family import MatrixFamily
from squealstudy.modes.full_order.modes import FULL
from squealstudy.modes.point import PointModes, angular_band
from squealstudy.reduction.prepared_family import PreparedFamily
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.system.parametric import ParametricSystem, Term

CHECK_SHIFT = 0.013  # of the band's top: about which the check factorises, off the solution's own
UNDEFINED = "undefined"  # status of a point where a coefficient has no value
_NOTHING = np.zeros(0)
NO_WORKING_POINT = WorkingPoint(_NOTHING, _NOTHING, _NOTHING, 0, np.nan, np.nan)


def family_system(family: MatrixFamily) -> ParametricSystem:
    """The family as a parametric system; its weights are `MatrixFamily.weights`."""
    return ParametricSystem(
        family.n, tuple(Term(term.order, None, term.matrix) for term in family.terms)
    )


def solve_family_point(
    prepared: PreparedFamily,
    values: Mapping[str, float],
    band_hz: tuple[float, float],
    check: bool = False,
) -> PointModes:
    """Complex modes with |lambda|/2 pi in `band_hz` at parameter values.

    They have no energies (the array has no rows) and no working point (its figures are NaN);
    the residual of a pair is its normwise backward error. With `check` the same modes are found by
    another factorisation, about a positive real shift: what Arnoldi's method missed or spoiled in
    one space differs in the other.

    Raises
    ------
    ConvergenceError
        ``undefined`` where a coefficient has no value; where no roots are found.
    """
    M, C, K = _matrices(prepared.model, values)
    band = angular_band(band_hz)
    shift = CHECK_SHIFT * band[1] if check else 0.0
    roots = roots_in_band(M, C, K, band, prepared.n_roots, shift)
    order = np.argsort(roots.lam.imag == 0, kind="stable")
    lam, psi = roots.lam[order], roots.psi[:, order]
    return PointModes(
        lam=lam,
        overdamped=lam.imag == 0,
        residual=pair_residuals(M, C, K, lam, psi),
        energies=np.zeros((0, len(lam))),
        shapes=prepared.shapes(psi),
        working_point=NO_WORKING_POINT,
        error_rung=roots.error[order],
        method=FULL,
    )


def _matrices(
    family: MatrixFamily, values: Mapping[str, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
    try:
        return family.matrices(values)
    except ExpressionError as error:
        raise ConvergenceError(UNDEFINED, str(error)) from error
