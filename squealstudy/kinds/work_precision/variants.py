"""The runs of a work-precision study: the reference, and every method at every knob value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from squealstudy.engine.keys import content_hash, source_hash
from squealstudy.engine.kind import as_kind
from squealstudy.engine.plan import Plan
from squealstudy.errors import ParameterError, StudyFileError
from squealstudy.kinds.methods import MethodsFile
from squealstudy.kinds.work_precision.section import (
    ONSET,
    OPTION,
    MethodSection,
    ReferenceSection,
    Scalar,
    WorkPrecisionDefinition,
)
from squealstudy.motion.integrator import integrator
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.kinds import kind_named, kind_names
from squealstudy.study.parameters import onset_parameter
from squealstudy.study.sampling import design_points
from squealstudy.study.toml_text import KeyPath

REFERENCE = "reference"
SweptValues = tuple[float, ...]  # swept values of a design point, in the order of the sweeps


@dataclass(frozen=True)
class PrecisionFile(MethodsFile[WorkPrecisionDefinition]):
    """The file of a work-precision study, with its base study."""

    base: ResolvedStudy


@dataclass(frozen=True)
class Variant:
    """The base study as one method solves it.

    Attributes
    ----------
    method : str
        Name of the method, or of the reference.
    knob : str
        Dotted key of the knob; empty without one.
    value : str, number or None
        Value of the knob.
    default, reference : bool
        Whether this is the default method, and the reference.
    plan : Plan
        Plan of the base study's design points, then the measured ones that are not among them.
    measured : tuple of int
        Positions of the measured points among all.
    lines : mapping of int -> tuple of int
        By number of a measured point, positions of the points of the line through it on which an
        onset is sought. Of points that share a line only the first is a key; empty where no onset
        is judged.
    integrator : str
        Name of the integrator; empty for the study's own.
    options : mapping
        Options of the integrator.
    keys : KeyPath
        Keys of the method in the file.
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
        """Hash of all that its results depend on, and of its name: each variant has own runs."""
        rows = [*self.measured, *(i for line in self.lines.values() for i in line)]
        ids = [self.plan.tasks[i].point_id for i in rows]
        method_facts = [self.reference, self.method, repr(self.value)]
        code = source_hash(("kinds",))
        return content_hash(
            [ids, self.integrator, sorted(self.options.items()), method_facts, code]
        )

    @property
    def label(self) -> str:
        """Name of the method with the knob's value."""
        short = self.knob.rpartition(".")[2]
        shown = f"{self.value:.12g}" if isinstance(self.value, float) else self.value
        return f"{self.method}, {short} {shown}" if self.knob else self.method


def make_variants(study_file: PrecisionFile) -> list[Variant]:
    """The reference, then all methods in the order of the file; StudyFileError for bad keys."""
    points = measured_points(study_file)
    lines = onset_lines(study_file, points)
    reference = study_file.definition.reference
    return [
        _variant(study_file, reference, None, points, lines, (REFERENCE,)),
        *(
            _variant(study_file, method, setting, points, lines, ("method", i))
            for i, method in enumerate(study_file.definition.method)
            for setting in method.values or (None,)
        ),
    ]


def _variant(
    study_file: PrecisionFile,
    line: MethodSection | ReferenceSection,
    value: Scalar | None,
    points: Sequence[SweptValues],
    lines: Mapping[int, Sequence[SweptValues]],
    keys: KeyPath,
) -> Variant:
    """A method at one value of its knob, with the plan of its points."""
    common = study_file.definition.work_precision.set
    knob = line.knob if isinstance(line, MethodSection) else ""
    changes: dict[str, Any] = {**common, **line.set}
    options: dict[str, Any] = dict(line.options)
    if knob.startswith(OPTION):
        options[knob.removeprefix(OPTION)] = value
    elif knob:
        changes[knob] = value
    try:
        study = study_file.base.variant(changes)
    except StudyFileError as error:
        error_keys = (*keys, "knob") if knob and error.key == knob else (*keys, "set")
        raise study_file.error(error_keys, f"{error.key or 'base'}: {error.message}") from None
    swept = _swept_values(study)
    measured = _placed(swept, points)
    placed = {n: _placed(swept, line) for n, line in lines.items()}
    return Variant(
        method=line.name,
        knob=knob,
        value=value,
        default=isinstance(line, MethodSection) and line.default,
        reference=isinstance(line, ReferenceSection),
        plan=Plan(
            study,
            np.array(swept).reshape(len(swept), len(study.sweeps)),
            point_by_point=True,
        ),
        measured=measured,
        lines=placed,
        integrator=line.integrator or "",
        options=options,
        keys=keys,
    )


def _swept_values(study: ResolvedStudy) -> list[SweptValues]:
    """Swept values of a study's own design points."""
    return [tuple(row) for row in design_points(study).tolist()]


def _placed(swept: list[SweptValues], points: Sequence[SweptValues]) -> tuple[int, ...]:
    """Positions of points among the `swept` ones; those that are missing are appended to these."""
    position = {point: i for i, point in reversed([*enumerate(swept)])}
    for point in points:
        if point not in position:
            position[point] = len(swept)
            swept.append(point)
    return tuple(position[point] for point in points)


def onset_lines(
    study_file: PrecisionFile, points: Sequence[SweptValues]
) -> dict[int, list[SweptValues]]:
    """Lines through the measured points along the onset's parameter, at its values in the study.

    Returns
    -------
    dict of int -> list of SweptValues
        By number of a measured point, swept values of the points of its line. Of points that share
        a line only the first is a key; empty where no onset is judged.

    Raises
    ------
    StudyFileError
        Where the base study is no grid over the parameter of the onset.
    """
    section, study = study_file.definition.work_precision, common_study(study_file)
    if ONSET not in section.quantities or study.kind.name != "complex_modes":
        return {}
    along = onset_parameter([sweep.name for sweep in study.sweeps])
    values = next((s.values for s in study.sweeps if s.name == along), ())
    if study.definition.design.type != "grid" or len(values) < 2:
        raise study_file.error(
            ("work_precision", "quantities"),
            f"{ONSET} is found on lines of a grid: expected a base study of design grid that "
            "sweeps friction, or another parameter first, over two values or more",
        )
    index = [sweep.name for sweep in study.sweeps].index(str(along))
    first: dict[SweptValues, int] = {}
    for n, point in enumerate(points):
        first.setdefault(_with(point, index, 0.0), n)
    return {n: [_with(points[n], index, v) for v in values] for n in first.values()}


def _with(point: SweptValues, index: int, value: float) -> SweptValues:
    """Swept values, of which that of the sweep `index` is replaced."""
    return (*point[:index], value, *point[index + 1 :])


def common_study(study_file: PrecisionFile) -> ResolvedStudy:
    """The base study with the changes for all methods; StudyFileError where one is refused."""
    try:
        return study_file.base.variant(study_file.definition.work_precision.set)
    except StudyFileError as error:
        keys = ("work_precision", "set")
        raise study_file.error(keys, f"{error.key or 'base'}: {error.message}") from None


def measured_points(study_file: PrecisionFile) -> list[SweptValues]:
    """Swept values of the design points at which errors are measured."""
    section, study = study_file.definition.work_precision, common_study(study_file)
    study_points = _swept_values(study)
    if not section.points or not study.sweeps:
        return study_points
    rng = np.random.default_rng(section.seed)
    if study.definition.design.type == "zip":
        return [_between(study_points, study, rng) for _ in range(section.points)]
    return [_in_box(study_points, study, rng) for _ in range(section.points)]


def _in_box(
    swept_points: Sequence[SweptValues], study: ResolvedStudy, rng: np.random.Generator
) -> SweptValues:
    """A random point of the swept box; structural parameters take values of the study."""
    point = []
    for k, sweep in enumerate(study.sweeps):
        u = float(rng.random())
        if sweep.parameter.structural:
            values = sorted({p[k] for p in swept_points})
            point.append(values[int(u * len(values))])
        else:
            point.append(_mixed(sweep.low, sweep.high, u, sweep.scale == "log"))
    return tuple(point)


def _between(
    swept_points: Sequence[SweptValues], study: ResolvedStudy, rng: np.random.Generator
) -> SweptValues:
    """A random point between two successive points of a zip design."""
    i, u = int(rng.integers(max(len(swept_points) - 1, 1))), float(rng.random())
    ends = swept_points[i], swept_points[min(i + 1, len(swept_points) - 1)]
    return tuple(
        a if s.parameter.structural else _mixed(a, b, u, s.scale == "log")
        for s, a, b in zip(study.sweeps, *ends, strict=True)
    )


def _mixed(low: float, high: float, u: float, log: bool) -> float:
    return float(low * (high / low) ** u) if log and low > 0 else float(low + u * (high - low))


def check_file(study_file: PrecisionFile, variants: Sequence[Variant]) -> None:
    """Raise StudyFileError for errors that need more than the sections to be seen."""
    definition, base_kind = study_file.definition, study_file.base.kind
    measuring = as_kind(base_kind).measuring()
    if measuring is None:
        study_kinds = (as_kind(kind_named(name)) for name in kind_names())
        kinds = [kind.name for kind in study_kinds if kind.measuring() is not None]
        raise study_file.error(
            ("work_precision", "base"),
            f"expected a study of kind {' or '.join(kinds)}, got {base_kind.name}",
        )
    if not definition.method:
        raise study_file.error(("method",), "expected at least one [[method]]")
    names = [method.name for method in definition.method]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise study_file.error(("method", i, "name"), f"two methods are called '{name}'")
    for name in definition.work_precision.quantities or measuring.judged:
        if name not in measuring.quantities:
            raise study_file.error(
                ("work_precision", "quantities"),
                f"'{name}' is no quantity of a {base_kind.name} study, expected some of "
                + ", ".join(measuring.quantities),
            )
    for variant in variants:
        if variant.plan.kind is not base_kind:
            raise study_file.error((*variant.keys, "set"), "the kind must stay")
        _ = variant.plan.method  # of complex modes: one that cannot serve the study says so
        if variant.integrator:
            _check_integrator(study_file, variant)


def _check_integrator(study_file: PrecisionFile, variant: Variant) -> None:
    """Raise StudyFileError where the study cannot use the integrator."""
    kind, section = study_file.base.kind, variant.plan.study.section
    if kind.name != "transient":
        raise study_file.error(
            (*variant.keys, "integrator"), f"a {kind.name} study integrates nothing"
        )
    if section.stop != "end" or section.representation != "modal":
        raise study_file.error(
            (*variant.keys, "integrator"),
            'integrators run to the end, in modal coordinates: set transient.stop = "end" and '
            'transient.representation = "modal" for all methods',
        )
    try:
        integrator(variant.integrator, variant.options)
    except ParameterError as error:
        is_option = error.key != "integrator"
        key = "options" if is_option else "integrator"
        raise study_file.error(
            (*variant.keys, key), f"{error.key}: {error.message}" if is_option else error.message
        ) from None
