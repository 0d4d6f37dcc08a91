"""The laws that a study chooses: whose parameters act, and whether those from outside are sound."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from typing import TYPE_CHECKING

from squealstudy.errors import ModelError, ParameterError
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES
from squealstudy.laws.consistency import NotComputedError
from squealstudy.laws.friction_law import PRESSURES, SPEEDS
from squealstudy.models.operating import CONTACT_OPTION, FRICTION_OPTION, OperatingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.study.parameters import StudyParameter
from squealstudy.study.toml_text import KeyPath

if TYPE_CHECKING:
    from squealstudy.study.definition import ResolvedStudy


def laws_with(name: str) -> dict[str, list[str]]:
    """Laws that have a parameter of that name, by the option of [model] that chooses them."""
    sorts = ((CONTACT_OPTION, CONTACT_LAWS), (FRICTION_OPTION, FRICTION_CURVES))
    found = {
        option.name: [law.name for law in laws if name in {p.name for p in law.parameters}]
        for option, laws in sorts
    }
    return {option: laws for option, laws in found.items() if laws}


def law_choices(laws: Mapping[str, list[str]]) -> str:
    """Laws in words: ``contact_law unilateral or power``."""
    return " or ".join(f"{option} {' or '.join(names)}" for option, names in laws.items())


def expect_acting(parameter: StudyParameter, design: DesignPoint) -> None:
    """ParameterError for a parameter of laws that a design point's model does not choose."""
    owners = laws_with(parameter.name)
    chosen = {CONTACT_OPTION.name: design.law_kind, FRICTION_OPTION.name: design.curve_kind}
    acting = [option for option, laws in owners.items() if chosen[option] in laws]
    if parameter.structural or not owners or acting:
        return
    here = law_choices({option: [chosen[option]] for option in owners})
    raise ParameterError(
        parameter.name,
        f"'{parameter.name}' does nothing here: it belongs to {law_choices(owners)}, "
        f"and this is {here}",
    )


def check_outside_laws(study: ResolvedStudy) -> None:
    """Try laws from outside the package at the study's nominal values and the ends of its sweeps.

    Raises
    ------
    StudyFileError
        About the law, or the sweep at whose end functions of the law contradict each other.
    """
    design = DesignPoint(study.model, study.options, study.values)
    if not design.has_working_point:
        return
    nominal = design.operating_point()
    for option, law, tried in (
        (CONTACT_OPTION.name, nominal.law, _try_contact),
        (FRICTION_OPTION.name, nominal.curve, _try_friction),
    ):
        if law.definition.in_package:
            continue
        places: list[tuple[KeyPath, Mapping[str, float]]] = [(("model", option), {})]
        for number, sweep in enumerate(study.sweeps):
            places += [(("sweep", number), {sweep.name: end}) for end in (sweep.low, sweep.high)]
        for keys, moved in places:
            try:
                tried(design.with_values({**study.values, **moved}).operating_point())
            except ModelError as error:
                where = "".join(f", with {name} = {value:g}" for name, value in moved.items())
                raise study.error(keys, f"{error}{where}") from None


# What cannot be computed at these pressures is left to the working points, which may have others.
def _try_contact(operating: OperatingPoint) -> None:
    law = operating.law
    for p in PRESSURES:
        with suppress(NotComputedError):
            law.expect_consistent([law.searched_gap(p)])


def _try_friction(operating: OperatingPoint) -> None:
    for s, p in product((*SPEEDS, abs(operating.sliding_speed)), PRESSURES):
        with suppress(NotComputedError):
            operating.curve.expect_consistent(operating.friction, s, [p])
