"""The parameters of a sensitivity study: names from its file, checked."""

from __future__ import annotations

from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.sensitivity.section import UNSTABLE, SensitivitySection
from squealstudy.mechanics.sensitivity_parameters import (
    RequestedParameter,
    default_names,
    requested,
)
from squealstudy.modes.sensitivity.reduced import ModeChoice
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint


def asked_parameters(study: ResolvedStudy, design: DesignPoint) -> tuple[RequestedParameter, ...]:
    """The parameters of the [sensitivity] section, or the default ones.

    Raises
    ------
    StudyFileError
        A name that the model does not know, or that has no derivative here.
    """
    if not study.model.components:
        raise study.error(
            ("study", "kind"),
            f"model '{study.model.name}' has no components and no contact: there are no "
            "sensitivities of it",
        )
    section = study.section
    if not section.parameters:
        return tuple(requested(name, design) for name in default_names(design))
    parameters = []
    for number, name in enumerate(section.parameters):
        try:
            parameters.append(requested(name, design))
        except ParameterError as error:
            raise study.error(("sensitivity", "parameters", number), error.message) from None
    return tuple(parameters)


def mode_choice(section: SensitivitySection, stability_tolerance: float) -> ModeChoice:
    """Which modes the section asks for."""
    if section.modes == UNSTABLE:
        return ModeChoice(stability_tolerance=stability_tolerance)
    if isinstance(section.modes, int):
        return ModeChoice(count=section.modes, stability_tolerance=stability_tolerance)
    frequencies = tuple(float(f) for f in section.modes)
    return ModeChoice(frequencies_hz=frequencies, stability_tolerance=stability_tolerance)


def error_at_name(study: ResolvedStudy, error: ParameterError) -> StudyFileError:
    """The error of a parameter as one of the study file, at its name if that is in the file."""
    names = study.section.parameters
    if error.key in names:
        return study.error(("sensitivity", "parameters", names.index(error.key)), error.message)
    return study.error(("sensitivity",), f"{error.key}: {error.message}")
