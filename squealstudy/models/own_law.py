"""Parameters of a friction law whose values contacts of a model file set for themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from squealstudy.errors import ParameterError
from squealstudy.laws import FRICTION_CURVES
from squealstudy.laws.friction_law import DEFAULT_CURVE, FrictionCurveDefinition
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.operating import FRICTION_OPTION, friction_laws
from squealstudy.parameter import Parameter

LAW_PREFIX = "friction_law."  # begins the names of friction-law parameters in studies
OF_CONTACT = "friction_law"  # the key with values of a contact's own


def law_keys() -> dict[str, list[str]]:
    """Keys that `friction_law` of a contact may have, each with the laws that have it."""
    keys: dict[str, list[str]] = {}
    for law in FRICTION_CURVES:
        for key in parameters_of(law):
            keys.setdefault(key, []).append(law.name)
    return keys


def parameters_of(curve: FrictionCurveDefinition) -> dict[str, Parameter]:
    """Parameters of a friction law by their keys in `friction_law` of a contact."""
    return {p.name.removeprefix(LAW_PREFIX): p for p in curve.parameters}


def law_parameter_named(key: str) -> Parameter:
    """The parameter with this key in `friction_law` of a contact; KeyError where no law has it."""
    return {k: p for law in FRICTION_CURVES for k, p in parameters_of(law).items()}[key]


def check_law_keys(names: Sequence[str], keys: KeyPath) -> None:
    """PlacedError where `friction_law` of the contact at `keys` has a key that no law has."""
    of_laws = tuple(law_keys())
    for name in names:
        if name not in of_laws:
            text = f"no friction law has '{name}', expected one of {', '.join(of_laws)}"
            raise PlacedError((*keys, OF_CONTACT, name), text, name, of_laws)


def curve_of(options: Mapping[str, str | int]) -> FrictionCurveDefinition:
    """The friction law that a study has chosen."""
    return FRICTION_CURVES[str(options.get(FRICTION_OPTION.name, DEFAULT_CURVE))]


def law_parameter(key: str, curve: FrictionCurveDefinition, keys: KeyPath) -> Parameter:
    """The parameter `key` of the study's law; PlacedError where it belongs to another law."""
    parameters = parameters_of(curve)
    if key not in parameters:
        laws = " or ".join(law_keys()[key])
        text = f"it belongs to {FRICTION_OPTION.name} {laws}, and the study's is {curve.name}"
        raise PlacedError(keys, text)
    return parameters[key]


def check_number(parameter: Parameter, key: str, number: float, keys: KeyPath) -> None:
    """PlacedError where a parameter, written as `key`, cannot be a number."""
    try:
        parameter.check(float(number))
    except ParameterError as error:
        raise PlacedError(keys, error.message.replace(f"'{key}' ", "")) from None


def check_row(curve: FrictionCurveDefinition, row: Sequence[float], keys: KeyPath) -> None:
    """PlacedError where a law cannot have the parameters that the contact at `keys` gives it."""
    if curve.refuses is not None and (why := curve.refuses(tuple(row))):
        raise PlacedError((*keys, OF_CONTACT), why)


def law_of_contacts(
    names: Sequence[str], numbers: Sequence[tuple[int, str]]
) -> FrictionCurveDefinition:
    """The first friction law that has all parameters for which contacts have values of their own.

    It is the default law of such a model.

    Parameters
    ----------
    names : sequence of str
        Names of the contacts.
    numbers : sequence of (number of the contact, key)
        The contact and the parameter of each such value.

    Raises
    ------
    PlacedError
        No law has all these parameters.
    """
    for law in friction_laws():
        if all(key in parameters_of(FRICTION_CURVES[law]) for _, key in numbers):
            return FRICTION_CURVES[law]
    laws = law_keys()
    pairs = combinations(numbers, 2)
    incompatible_pairs = (
        pair for pair in pairs if not set(laws[pair[0][1]]) & set(laws[pair[1][1]])
    )
    (i, first), (j, other) = next(incompatible_pairs, (numbers[0], numbers[-1]))
    text = f"expected numbers of one friction law: '{first}' of {names[i]} is of "
    text += f"{' or '.join(laws[first])}, and '{other}' of {' or '.join(laws[other])}"
    raise PlacedError(("contact", j, OF_CONTACT, other), text)


def law_first(name: str) -> tuple[str, ...]:
    """Names of all friction laws, `name` first, as the default."""
    return name, *(law for law in friction_laws() if law != name)
