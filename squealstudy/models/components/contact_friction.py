"""Friction coefficients, friction-law parameters and states of single contacts of a model file."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from squealstudy.laws import FrictionCurve, FrictionCurveDefinition
from squealstudy.laws.own_friction import (
    COEFFICIENT,
    NO_OWN_FRICTION,
    SLIDING,
    STATE,
    STUCK,
    STUCK_BY_SPRING,
)
from squealstudy.models.components.file_tables import ContactTable
from squealstudy.models.components.model_file import ModelFile, Numbers, ValuesError
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.own_law import (
    OF_CONTACT,
    check_law_keys,
    check_number,
    check_row,
    law_of_contacts,
    law_parameter,
)


def check_friction(file: ModelFile, varied: Collection[KeyPath]) -> FrictionCurveDefinition:
    """Check the friction keys of contacts against the rest of the file.

    Parameters
    ----------
    file : ModelFile
    varied : collection of key paths
        Numbers of the file that parameters of studies vary.

    Returns
    -------
    FrictionCurveDefinition
        The first friction law with all parameters for which contacts state values.

    Raises
    ------
    PlacedError
        No friction law has such parameters, or their values contradict each other; a contact of a
        turning component has a state; a contact that always slides has a tangential stiffness.
    """
    for i, table in enumerate(file.contact):
        keys: KeyPath = ("contact", i)
        check_law_keys(tuple(table.friction_law), keys)
        if table.state is None:
            continue
        turning = [name for name in file.sides(i) if name in file.turning]
        if turning:
            text = f"{turning[0]} turns, and what touches it slides at sliding_speed: expected "
            raise PlacedError((*keys, "state"), text + 'no such key, and kind = "sliding"')
        slides = table.state == SLIDING and (*keys, "state") not in varied
        if slides and table.tangential is not None:
            text = "it holds a contact that is stuck, and this one slides: expected no such key, "
            raise PlacedError((*keys, "tangential"), text + "or a parameter that varies its state")
    named = [(i, key) for i, table in enumerate(file.contact) for key in table.friction_law]
    law = law_of_contacts([file.name_of("contact", i) for i in range(len(file.contact))], named)
    for i in dict.fromkeys(i for i, _ in named):
        law_row(Numbers(file, {}), i, FrictionCurve.from_values(law.name, {}))
    return law


def state_of(numbers: Numbers, number: int) -> float:
    """SLIDING, STUCK or STUCK_BY_SPRING of a contact; ValuesError for other numbers."""
    keys: KeyPath = ("contact", number, "state")
    state = numbers.at(*keys)
    if state not in (0.0, 1.0):
        text = f"expected 1 (stuck) or 0 (sliding), got {state:g}: a state has no derivative"
        raise ValuesError((keys,), text)
    if state == 0.0:
        return SLIDING
    return STUCK_BY_SPRING if tangential_of(numbers, number) > 0.0 else STUCK


def tangential_of(numbers: Numbers, number: int) -> float:
    """Tangential stiffness per area [N/m3] of a contact while it is stuck; 0 where not given."""
    keys: KeyPath = ("contact", number, "tangential")
    written = numbers.file.contact[number].tangential
    return 0.0 if written is None else numbers.at(*keys)


def own_friction(numbers: Numbers, begins: np.ndarray, curve: FrictionCurve) -> np.ndarray:
    """Friction of single contacts as rows over all contact points (`laws.own_friction`).

    Parameters
    ----------
    numbers : Numbers
    begins : ndarray (n_contacts + 1,) of int
        Index of the first point of each contact; the last entry is the number of points.
    curve : FrictionCurve
        The friction law of the study.

    Raises
    ------
    PlacedError
        A contact gives values of another friction law than the study's, or values that the law
        cannot have.
    ValuesError
        The same, where a parameter of the study gives the value; a state other than 0 or 1.
    """
    tables = numbers.file.contact
    if not any(map(has_own, tables)):
        return NO_OWN_FRICTION
    has_law = any(table.friction_law for table in tables)
    columns = COEFFICIENT + 1 + has_law * len(curve.names)
    rows = np.full((begins[-1], columns), np.nan)
    rows[:, STATE] = SLIDING
    for i, table in enumerate(tables):
        points = slice(begins[i], begins[i + 1])
        if table.friction is not None:
            rows[points, COEFFICIENT] = numbers.at("contact", i, "friction")
        if table.state is not None:
            rows[points, STATE] = state_of(numbers, i)
        if table.friction_law:
            rows[points, COEFFICIENT + 1 :] = law_row(numbers, i, curve)
    return rows


def has_own(table: ContactTable) -> bool:
    """Whether a contact has its own friction coefficient or friction-law parameters.

    A contact with a state always has a coefficient.
    """
    return table.friction is not None or bool(table.friction_law)


def law_row(numbers: Numbers, number: int, curve: FrictionCurve) -> list[float]:
    """A contact's values of the friction law's parameters; NaN where it gives none.

    Raises
    ------
    PlacedError, ValuesError
        As in `own_friction`.
    """
    keys: KeyPath = ("contact", number)
    row = dict.fromkeys(curve.names, np.nan)
    law = curve.definition
    for key in numbers.file.contact[number].friction_law:
        path = (*keys, OF_CONTACT, key)
        parameter = law_parameter(key, law, path)
        row[parameter.name] = numbers.at(*path)
        check_number(parameter, key, row[parameter.name], path)
    of_contact = list(row.values())
    try:
        all_values = np.where(np.isnan(of_contact), curve.parameters, of_contact)
        check_row(law, all_values.tolist(), keys)
    except PlacedError as error:
        varied = tuple(path for path in numbers.given if path[:3] == error.keys)
        if not varied:
            raise
        raise ValuesError(varied, error.message) from error
    return of_contact
