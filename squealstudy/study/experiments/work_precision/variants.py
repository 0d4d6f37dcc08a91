"""The runs of a work-precision study: the reference, and every method at every knob value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import Study
from squealstudy.study.experiments.definition import PrecisionFile
from squealstudy.study.experiments.sections import (
    ONSET,
    OPTION,
    MethodSection,
    ReferenceSection,
    Scalar,
)
from squealstudy.study.keys import content_hash, source_hash
from squealstudy.study.names import onset_parameter
from squealstudy.study.plan import Plan
from squealstudy.study.sampling import design_points
from squealstudy.study.toml_lines import KeyPath

REFERENCE = "reference"


@dataclass(frozen=True)
class Variant:
    """The base study as one method solves it.

    Attributes
    ----------
    method : str
        Name of the line of the chart; of the reference its own.
    knob : str
        Dotted key, empty without one.
    value : str, number or None
        Of the knob.
    default, reference : bool
    plan : Plan
        The base study's design points, then those that are measured.
    measured : tuple of int
        Positions of the latter among all.
    lines : mapping of int -> tuple of int
        By number of a measured point, positions of the points of the line through it on which an
        onset is sought; one of several points that share a line, none where no onset is judged.
    integrator : str
        Empty for the study's own.
    options : mapping
        Of the integrator.
    keys : KeyPath
        The method's place in the file.
    """

    method: str
    knob: str
    value: Scalar | None
    default: bool
    reference: bool
    plan: Plan
    measured: tuple[int, ...]
    lines: Mapping[int, tuple[int, ...]]
    integrator: str
    options: Mapping[str, Any]
    keys: KeyPath

    @cached_property
    def identity(self) -> str:
        """Hash of all that decides what it finds, and of its name: each is run on its own."""
        wanted = [*self.measured, *(i for line in self.lines.values() for i in line)]
        ids = [self.plan.tasks[i].point_id for i in wanted]
        own = [self.reference, self.method, repr(self.value)]
        code = source_hash(("study/measure", "study/experiments/work_precision"))
        return content_hash([ids, self.integrator, sorted(self.options.items()), own, code])

    @property
    def label(self) -> str:
        """Name with the knob's value."""
        short = self.knob.rpartition(".")[2]
        return f"{self.method}, {short} {self.value}" if self.knob else self.method


def make_variants(experiment: PrecisionFile) -> list[Variant]:
    """The reference, then all methods in the order of the file; StudyFileError."""
    points = measured_points(experiment)
    lines = onset_lines(experiment, points)
    reference = experiment.definition.reference
    return [
        _variant(experiment, reference, None, points, lines, (REFERENCE,)),
        *(
            _variant(experiment, method, value, points, lines, ("method", i))
            for i, method in enumerate(experiment.definition.method)
            for value in method.values or (None,)
        ),
    ]


def _variant(
    experiment: PrecisionFile,
    line: MethodSection | ReferenceSection,
    value: Scalar | None,
    points: list[dict[str, float]],
    lines: Mapping[int, list[dict[str, float]]],
    keys: KeyPath,
) -> Variant:
    common = experiment.definition.work_precision.set
    knob = line.knob if isinstance(line, MethodSection) else ""
    changes: dict[str, Any] = {**common, **line.set}
    options: dict[str, Any] = dict(line.options)
    if knob.startswith(OPTION):
        options[knob.removeprefix(OPTION)] = value
    elif knob:
        changes[knob] = value
    try:
        study = experiment.base.variant(changes)
    except StudyFileError as error:
        place = (*keys, "knob") if knob and error.key == knob else (*keys, "set")
        raise experiment.error(place, f"{error.key or 'base'}: {error.message}") from None
    swept = design_points(study)
    measured = _placed(swept, points)
    placed = {n: _placed(swept, line) for n, line in lines.items()}
    return Variant(
        line.name,
        knob,
        value,
        isinstance(line, MethodSection) and line.default,
        isinstance(line, ReferenceSection),
        Plan(study, swept),
        measured,
        placed,
        line.integrator or "",
        options,
        keys,
    )


def _placed(swept: list[dict[str, float]], wanted: list[dict[str, float]]) -> tuple[int, ...]:
    """Positions of the wanted points among all, to which those that are missing are added."""
    position = {tuple(sorted(point.items())): i for i, point in reversed([*enumerate(swept)])}
    for point in wanted:
        name = tuple(sorted(point.items()))
        if name not in position:
            position[name] = len(swept)
            swept.append(point)
    return tuple(position[tuple(sorted(point.items()))] for point in wanted)


def onset_lines(
    experiment: PrecisionFile, points: list[dict[str, float]]
) -> dict[int, list[dict[str, float]]]:
    """Lines through the measured points along the onset's parameter, at its values in the study.

    Returns
    -------
    dict of int -> list of dict
        By number of a measured point, swept values of its line; of points that share a line by the
        first; none where no onset is judged.

    Raises
    ------
    StudyFileError
        Where the base study has no lines.
    """
    section, study = experiment.definition.work_precision, common_study(experiment)
    if ONSET not in section.quantities or study.definition.study.kind != "complex_modes":
        return {}
    along = onset_parameter([sweep.name for sweep in study.sweeps])
    values = next((s.values for s in study.sweeps if s.name == along), ())
    if study.definition.design.type != "grid" or len(values) < 2:
        raise experiment.error(
            ("work_precision", "quantities"),
            f"{ONSET} is found on lines of a grid: expected a base study of design grid that "
            "sweeps friction, or another parameter first, over two values or more",
        )
    first: dict[tuple[tuple[str, float], ...], int] = {}
    for n, point in enumerate(points):
        first.setdefault(tuple((k, v) for k, v in point.items() if k != along), n)
    return {n: [{**points[n], str(along): v} for v in values] for n in first.values()}


def common_study(experiment: PrecisionFile) -> Study:
    """The base study with what is changed for all methods; StudyFileError."""
    try:
        return experiment.base.variant(experiment.definition.work_precision.set)
    except StudyFileError as error:
        keys = ("work_precision", "set")
        raise experiment.error(keys, f"{error.key or 'base'}: {error.message}") from None


def measured_points(experiment: PrecisionFile) -> list[dict[str, float]]:
    """Swept values of the design points at which errors are measured."""
    section, study = experiment.definition.work_precision, common_study(experiment)
    own = design_points(study)
    if not section.points or not study.sweeps:
        return own
    rng = np.random.default_rng(section.seed)
    if study.definition.design.type == "zip":
        return [_between(own, study, rng) for _ in range(section.points)]
    return [_in_box(own, study, rng) for _ in range(section.points)]


def _in_box(
    own: list[dict[str, float]], study: Study, rng: np.random.Generator
) -> dict[str, float]:
    """A random point of the swept box; structures are among those there are."""
    point = {}
    for sweep in study.sweeps:
        u = float(rng.random())
        if sweep.parameter.structural:
            values = sorted({p[sweep.name] for p in own})
            point[sweep.name] = values[int(u * len(values))]
        else:
            point[sweep.name] = _mixed(sweep.low, sweep.high, u, sweep.scale == "log")
    return point


def _between(
    own: list[dict[str, float]], study: Study, rng: np.random.Generator
) -> dict[str, float]:
    """A random point between two neighbours of a design whose values stand side by side."""
    i, u = int(rng.integers(max(len(own) - 1, 1))), float(rng.random())
    ends = own[i], own[min(i + 1, len(own) - 1)]
    return {
        s.name: ends[0][s.name]
        if s.parameter.structural
        else _mixed(ends[0][s.name], ends[1][s.name], u, s.scale == "log")
        for s in study.sweeps
    }


def _mixed(low: float, high: float, u: float, log: bool) -> float:
    return float(low * (high / low) ** u) if log and low > 0 else float(low + u * (high - low))
