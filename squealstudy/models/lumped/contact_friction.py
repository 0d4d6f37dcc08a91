"""Friction coefficients, friction-law parameters and states of a lumped model's contact points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from squealstudy.laws.friction_law import FrictionCurveDefinition
from squealstudy.laws.own_friction import SLIDING, STUCK, STUCK_BY_SPRING
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.numbers import Values, bounded, side_by_side, value_of
from squealstudy.models.lumped.tables import ContactNumbers
from squealstudy.models.operating import FRICTION
from squealstudy.models.own_law import OF_CONTACT, check_number, check_row, law_parameter

AS_THE_STUDY = np.nan  # in place of a number that a contact does not state


def has_own_numbers(tables: Iterable[ContactNumbers]) -> bool:
    """Whether any contact states its own friction coefficient, friction-law values or state."""
    return any(
        t.own_coefficient is not None or t.friction_law or t.state is not None for t in tables
    )


def own_row(
    table: ContactNumbers, keys: KeyPath, values: Values, curve: FrictionCurveDefinition
) -> np.ndarray:
    """The row (m or 1, k) of a contact in the array that `laws.own_friction` describes.

    Raises
    ------
    PlacedError
        A number is not possible, or belongs to another friction law than the study's.
    """
    columns = [state_of(table, keys, values), np.asarray(AS_THE_STUDY)]
    if table.own_coefficient is not None:
        columns[1] = bounded(table.own_coefficient, values, (*keys, "friction"), "", zero=True)
        for end in np.unique([columns[1].min(), columns[1].max()]):
            check_number(FRICTION, FRICTION.name, end, (*keys, "friction"))
    of_law = dict(_numbers_of_law(table, keys, values, curve))
    columns += [of_law.get(p.name, np.asarray(AS_THE_STUDY)) for p in curve.parameters]
    if of_law and curve.refuses is not None:
        study = [np.asarray(values.get(p.name, p.default), dtype=float) for p in curve.parameters]
        pairs = zip(curve.parameters, study, strict=True)
        rows = side_by_side([of_law.get(p.name, x) for p, x in pairs])
        for row in np.unique(rows, axis=0):
            check_row(curve, row.tolist(), keys)
    return side_by_side(columns)


def state_of(table: ContactNumbers, keys: KeyPath, values: Values) -> np.ndarray:
    """SLIDING, STUCK or STUCK_BY_SPRING (m,) or (); PlacedError for a number but 0 and 1."""
    if table.state is None:
        return np.asarray(SLIDING)
    state = value_of(table.state, values, (*keys, "state"))
    wrong = np.flatnonzero((state != 0.0) & (state != 1.0))
    if len(wrong):
        got = f"{np.atleast_1d(state)[wrong[0]]:g}"
        text = f"expected 1 (stuck) or 0 (sliding), got {got}: a state has no derivative"
        raise PlacedError((*keys, "state"), text)
    stiffness = tangential_of(table, keys, values)
    stuck = np.where(stiffness > 0.0, STUCK_BY_SPRING, STUCK)
    return np.where(state == 1.0, stuck, SLIDING)


def tangential_of(table: ContactNumbers, keys: KeyPath, values: Values) -> np.ndarray:
    """Tangential stiffness [N/m] of a contact while it is stuck, (m,) or ()."""
    number = 0.0 if table.tangential is None else table.tangential
    return bounded(number, values, (*keys, "tangential"), "N/m", zero=True)


def _numbers_of_law(
    table: ContactNumbers, keys: KeyPath, values: Values, curve: FrictionCurveDefinition
) -> Iterator[tuple[str, np.ndarray]]:
    """Names and values of the friction-law parameters that a contact states."""
    for key, number in table.friction_law.items():
        path = (*keys, OF_CONTACT, key)
        parameter = law_parameter(key, curve, path)
        numbers = value_of(number, values, path)
        for end in np.unique([numbers.min(), numbers.max()]):
            check_number(parameter, key, end, path)
        yield parameter.name, numbers
