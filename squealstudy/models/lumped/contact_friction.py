"""Friction of a lumped model's contact points that have numbers of their own: their state too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from squealstudy.errors import ParameterError
from squealstudy.laws import FRICTION_CURVES
from squealstudy.laws.friction_law import DEFAULT_CURVE, FrictionCurveDefinition
from squealstudy.laws.own_friction import SLIDING, STUCK, STUCK_BY_SPRING
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.numbers import Values, bounded, side_by_side, value_of
from squealstudy.models.lumped.tables import LAW_PREFIX, ContactNumbers
from squealstudy.models.operating import FRICTION, FRICTION_OPTION

AS_THE_STUDY = np.nan  # where the study's number counts


def law_keys() -> dict[str, list[str]]:
    """What `friction_law` of a contact may name, and which friction laws have it."""
    keys: dict[str, list[str]] = {}
    for law in FRICTION_CURVES:
        for parameter in law.parameters:
            keys.setdefault(parameter.name.removeprefix(LAW_PREFIX), []).append(law.name)
    return keys


def curve_of(options: Mapping[str, str | int]) -> FrictionCurveDefinition:
    """The friction law that a study has chosen."""
    return FRICTION_CURVES[str(options.get(FRICTION_OPTION.name, DEFAULT_CURVE))]


def has_own_numbers(tables: Iterable[ContactNumbers]) -> bool:
    """Whether contacts have friction, a law or a state of their own."""
    return any(
        t.own_coefficient is not None or t.friction_law or t.state is not None for t in tables
    )


def own_row(
    table: ContactNumbers, keys: KeyPath, values: Values, curve: FrictionCurveDefinition
) -> np.ndarray:
    """The row (m or 1, k) of `laws.own_friction` of a contact.

    Raises
    ------
    PlacedError
        A number that it cannot have, of a law that the study has not chosen.
    """
    columns = [state_of(table, keys, values), np.asarray(AS_THE_STUDY)]
    if table.own_coefficient is not None:
        columns[1] = bounded(table.own_coefficient, values, (*keys, "friction"), "", zero=True)
        _check(FRICTION.name, columns[1], FRICTION.check, (*keys, "friction"))
    of_law = dict(_numbers_of_law(table, keys, values, curve))
    columns += [of_law.get(p.name, np.asarray(AS_THE_STUDY)) for p in curve.parameters]
    if of_law and curve.refuses is not None:
        study = [np.asarray(values.get(p.name, p.default), dtype=float) for p in curve.parameters]
        pairs = zip(curve.parameters, study, strict=True)
        rows = side_by_side([of_law.get(p.name, x) for p, x in pairs])
        for row in np.unique(rows, axis=0):
            if why := curve.refuses(tuple(row.tolist())):
                raise PlacedError((*keys, "friction_law"), why)
    return side_by_side(columns)


def state_of(table: ContactNumbers, keys: KeyPath, values: Values) -> np.ndarray:
    """SLIDING, STUCK or STUCK_BY_SPRING (m,) or (); PlacedError of another number."""
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
    """Stiffness [N/m] that a stuck contact has in its plane, (m,) or ()."""
    number = 0.0 if table.tangential is None else table.tangential
    return bounded(number, values, (*keys, "tangential"), "N/m", zero=True)


def _numbers_of_law(
    table: ContactNumbers, keys: KeyPath, values: Values, curve: FrictionCurveDefinition
) -> Iterator[tuple[str, np.ndarray]]:
    """Parameters of the study's law that the contact has its own values of."""
    parameters = {p.name.removeprefix(LAW_PREFIX): p for p in curve.parameters}
    for key, number in table.friction_law.items():
        place = (*keys, "friction_law", key)
        if key not in parameters:
            laws = " or ".join(law_keys()[key])
            text = f"it belongs to {FRICTION_OPTION.name} {laws}, and the study's is {curve.name}"
            raise PlacedError(place, text)
        numbers = value_of(number, values, place)
        _check(key, numbers, parameters[key].check, place)
        yield parameters[key].name, numbers


def _check(name: str, numbers: np.ndarray, check: Any, place: KeyPath) -> None:
    for number in np.unique([numbers.min(), numbers.max()]):
        try:
            check(float(number))
        except ParameterError as error:
            raise PlacedError(place, error.message.replace(f"'{name}' ", "")) from None
