"""Checks of the modes that a rung from outside the package yields, before they are used."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from squealstudy.errors import ConvergenceError
from squealstudy.modes.point import EIGENVALUE_REL_ROUND_OFF, PointModes
from squealstudy.modes.problem import Point, Problem
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.root_pairs import by_modulus

PointAnswer = tuple[int, PointModes | ConvergenceError]
REAL, COMPLEX = "f", "fc"  # kinds of dtypes


def checked(
    item: Any, name: str, problem: Problem, points: Sequence[Point], answered: Collection[int]
) -> PointAnswer:
    """Check an item that the rung `name` yields; its modes in order and under the rung's name.

    Raises
    ------
    TypeError
        An item of another type, an index of no point, or a point in `answered`, which has been
        yielded already.
    ValueError
        Modes with numbers that no mode of the point can have: these would be written in tables.
    """
    if not isinstance(item, tuple) or len(item) != 2:
        raise TypeError(f"expected to yield an index and modes, got {type(item).__name__}")
    index, outcome = item
    if not isinstance(index, int | np.integer) or not 0 <= index < len(points):
        raise TypeError(f"expected an index from 0 to {len(points) - 1}, yielded {index!r}")
    if index in answered:
        raise TypeError(f"yielded point {index} twice")
    if isinstance(outcome, ConvergenceError):
        return int(index), outcome
    if not isinstance(outcome, PointModes):
        raise TypeError(
            f"expected PointModes or a ConvergenceError of point {index}, "
            f"yielded {type(outcome).__name__}"
        )
    if wrong := _fault(outcome, problem):
        raise ValueError(f"point {index}{_values_text(problem, points[int(index)])}: {wrong}")
    return int(index), _ordered(outcome, name)


def _fault(modes: PointModes, problem: Problem) -> str:
    """What is wrong with the modes, and what was expected; '' where nothing is."""
    m = np.size(modes.lam)
    model, width = problem.prepared.model, problem.prepared.shape_rows.shape[0]
    components = len(model.offsets) if isinstance(model, ReducedModel) else 0
    expected = {
        "lam": ((m,), COMPLEX),
        "residual": ((m,), REAL),
        "error_rung": ((m,), REAL),
        "energies": ((components, m), REAL),
        "shapes": ((m, width), COMPLEX),
    }
    for name, (shape, kinds) in expected.items():
        array = getattr(modes, name)
        if not isinstance(array, np.ndarray) or array.dtype.kind not in kinds:
            what = "real" if kinds == REAL else "complex"
            got = f"of {array.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
            return f"{name} is {got}, expected a {what} array"
        if array.shape != shape:
            return (
                f"{name} is of shape {array.shape}, lam of {np.shape(modes.lam)}: expected {shape}"
            )
        if name in ("lam", "energies", "shapes") and not np.isfinite(array).all():
            return f"{name} is not finite"
        if name in ("residual", "error_rung") and (array < 0).any():
            return f"{name} is {array.min():.3g}, expected >= 0, or NaN where it is not known"
    if (modes.lam.imag < 0).any():
        return "a root has Im lambda < 0, expected one of each conjugate pair, Im lambda >= 0"
    if components and not isinstance(modes.working_point, WorkingPoint):
        return "working_point is missing, expected that of the point"
    return _outside(modes, problem.swept.band)


def _outside(modes: PointModes, band: tuple[float, float]) -> str:
    """Message about roots that a rung yields outside the band; empty without such roots."""
    size = np.abs(modes.lam)
    slack = np.nan_to_num(modes.error_rung, posinf=np.inf) + EIGENVALUE_REL_ROUND_OFF * size
    outside = size[(size + slack < band[0]) | (size - slack > band[1])]
    if not len(outside):
        return ""
    low, high = (bound / (2 * np.pi) for bound in band)
    return (
        f"a root at {outside[0] / (2 * np.pi):.6g} Hz is outside the band by more than its "
        f"error_rung: expected roots from {low:g} to {high:g} Hz alone"
    )


def _values_text(problem: Problem, point: Point) -> str:
    """Values of a point in the parameters that vary, in words."""
    ends = np.ones(problem.swept.dimension)
    low, high = (problem.point_at(theta).values for theta in (-ends, ends))
    named = [f"{name} = {x:g}" for name, x in point.values.items() if low[name] != high[name]]
    return f" ({', '.join(named)})" if named else ""


def _ordered(modes: PointModes, name: str) -> PointModes:
    """Modes under the name of their rung, oscillating ones first, ascending in modulus."""
    order = by_modulus(modes.lam, modes.overdamped)
    return replace(
        modes,
        lam=modes.lam[order],
        residual=modes.residual[order],
        energies=modes.energies[:, order],
        shapes=modes.shapes[order],
        error_rung=modes.error_rung[order],
        method=name,
    )
