"""Which laws a parameter belongs to, and whether one of them is in use."""

from __future__ import annotations

from collections.abc import Mapping

from squealstudy.errors import ParameterError
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import CONTACT_OPTION, FRICTION_OPTION
from squealstudy.models.parameter_names import StudyParameter


def laws_with(name: str) -> dict[str, list[str]]:
    """Laws that have a parameter of that name, by the option of [model] that chooses them."""
    sorts = ((CONTACT_OPTION, CONTACT_LAWS), (FRICTION_OPTION, FRICTION_CURVES))
    by_option = {
        option.name: [law.name for law in laws if name in {p.name for p in law.parameters}]
        for option, laws in sorts
    }
    return {option: laws for option, laws in by_option.items() if laws}


def law_choices(laws: Mapping[str, list[str]]) -> str:
    """Text on laws, such as ``contact_law unilateral or power``."""
    return " or ".join(f"{option} {' or '.join(names)}" for option, names in laws.items())


def expect_acting(parameter: StudyParameter, design: ModelPoint) -> None:
    """Raise ParameterError where a parameter has no effect in a design point's model.

    It belongs to a law that the model does not use, or no contact follows it.
    """
    if parameter.name in design.model.idle:
        text = f"'{parameter.name}' does nothing here: {design.model.idle[parameter.name]}"
        raise ParameterError(parameter.name, text)
    owners = laws_with(parameter.name)
    chosen = {CONTACT_OPTION.name: design.law_kind, FRICTION_OPTION.name: design.curve_kind}
    acting = [option for option, laws in owners.items() if chosen[option] in laws]
    if parameter.structural or not owners or acting:
        return
    acting_choices = law_choices({option: [chosen[option]] for option in owners})
    raise ParameterError(
        parameter.name,
        f"'{parameter.name}' does nothing here: it belongs to {law_choices(owners)}, "
        f"and this is {acting_choices}",
    )
