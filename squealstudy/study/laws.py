"""Checks of the laws of a study: laws from outside the package, and values that may not fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from itertools import product

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.laws.consistency import NotComputedError
from squealstudy.laws.friction_law import TEST_PRESSURES, TEST_SPEEDS
from squealstudy.models.operating import CONTACT_OPTION, FRICTION_OPTION, OperatingPoint
from squealstudy.study.design import DesignPoint
from squealstudy.study.sweeps import Sweep
from squealstudy.study.toml_text import KeyPath


def check_laws(
    design: DesignPoint,
    sweeps: Iterable[Sweep],
    error_at: Callable[[KeyPath, str], StudyFileError],
) -> None:
    """Try the laws of a study at its nominal values and at the ends of its sweeps.

    These are laws from outside the package, and laws of the package whose values may contradict
    each other, such as tables.

    Parameters
    ----------
    design : DesignPoint
        The nominal values.
    sweeps : iterable of Sweep
    error_at : callable
        Takes the key path of a place in the study file, and a message; returns the error to raise.

    Raises
    ------
    StudyFileError
        Values of a law, or its functions, contradict each other; about the law or the sweep.
    """
    if not design.has_working_point:
        return
    try:
        nominal, numbered = design.operating_point(), list(enumerate(sweeps))
    except ModelError as error:  # values of a law that do not fit each other
        raise error_at(("parameters",), str(error)) from None
    for option, law, try_law in (
        (CONTACT_OPTION.name, nominal.law, _try_contact),
        (FRICTION_OPTION.name, nominal.curve, _try_friction),
    ):
        if law.definition.in_package and law.definition.refuses is None:
            continue
        cases: list[tuple[KeyPath, Mapping[str, float]]] = [(("model", option), {})]
        for number, sweep in numbered:
            cases += [(("sweep", number), {sweep.name: end}) for end in (sweep.low, sweep.high)]
        for keys, changes in cases:
            try:
                try_law(design.with_values({**design.values, **changes}).operating_point())
            except ModelError as error:
                where = "".join(f", with {name} = {end:g}" for name, end in changes.items())
                raise error_at(keys, f"{error}{where}") from None


# A law may have no value at a test pressure: working points may be at other pressures.
def _try_contact(operating: OperatingPoint) -> None:
    law = operating.law
    for p in TEST_PRESSURES:
        with suppress(NotComputedError):
            law.expect_consistent([law.searched_gap(p)])


def _try_friction(operating: OperatingPoint) -> None:
    if operating.curve.definition.in_package:  # tests cover it, and `operating_point` checks values
        return
    for s, p in product((*TEST_SPEEDS, abs(operating.sliding_speed)), TEST_PRESSURES):
        with suppress(NotComputedError):
            operating.curve.expect_consistent(operating.friction, s, [p])
