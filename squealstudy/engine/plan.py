"""Plan of a study: its design points, their identities and the structures they need."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from squealstudy.engine.design_points import DesignPoints, DesignValues, PlannedNames
from squealstudy.engine.keys import NUMERIC_PACKAGES, content_hash, source_hash
from squealstudy.engine.method import RungChoice, choose_method
from squealstudy.engine.shared_range import SharedRange, shared_range
from squealstudy.errors import StudyFileError
from squealstudy.extensions import in_models
from squealstudy.mechanics.basis import reduction_settings
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.operating import (
    CONTACT_OPTION,
    FRICTION_OPTION,
    ModeKey,
    OperatingPoint,
    contact_parameters,
)
from squealstudy.models.parameter_names import FREQUENCY_SCALE
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.design import DesignPoint
from squealstudy.study.family import file_digests
from squealstudy.study.kind_protocols import ModelStudyKind
from squealstudy.study.sampling import design_points, grid_shape
from squealstudy.study.toml_text import KeyPath

LAW_OPTIONS = (CONTACT_OPTION.name, FRICTION_OPTION.name)  # they change no structure
# source folders and files that a reduction depends on
STRUCTURE_SOURCES = ("laws", "parameter.py", "linalg", "models", "reduction")
# further ones that its finer model depends on
FINER_SOURCES = ("system", "modes/full_order")
TABLE_SOURCES = (*NUMERIC_PACKAGES, "study", "tables", "engine", "kinds")


class Plan:
    """A study resolved into design points; cheap, nothing is assembled.

    Parameters
    ----------
    study : ResolvedStudy
        A loaded study file.
    swept : ndarray (n_points, n_sweeps) or None
        Swept values of every design point of a design that has grown by its results
        (kinds/complex_modes/boundary.py); None: those that the study begins with.
    enriched : bool
        Whether bases are enriched once more, because without that they are too coarse for the
        tolerance.
    point_by_point : bool
        Whether small models, too, are prepared and solved one by one, to compare methods.
    """

    def __init__(
        self,
        study: ResolvedStudy,
        swept: np.ndarray | None = None,
        enriched: bool = False,
        point_by_point: bool = False,
    ) -> None:
        self.study, self.enriched, self.point_by_point = study, enriched, point_by_point
        self._resolved = study.kind.resolver(study)
        self.swept = design_points(study) if swept is None else swept
        columns = {s.name: self.swept[:, k] for k, s in enumerate(study.sweeps)}
        self._given = DesignValues.of(
            study.model,
            study.options,
            self._resolved(study.model.followed({**study.values, **columns})),
            len(self.swept),
        )

    @cached_property
    def stacked(self) -> bool:
        """Whether the kind solves all points of this plan as one batch, without prepared models."""
        return not self.point_by_point and self.kind.stacks(self)

    @cached_property
    def _values(self) -> DesignValues:
        return replace(self._given, one_structure=True) if self.stacked else self._given

    def design(self, values: Mapping[str, float]) -> DesignPoint:
        """The design point with these values of all parameters, with neither id nor structure."""
        return DesignPoint(self.study.model, self.study.options, values)

    @property
    def whole(self) -> Plan:
        """The plan that these points are a part of, whose method, boxes and bases serve them."""
        return self

    @property
    def kind(self) -> ModelStudyKind:
        """The kind of the study."""
        return self.study.kind

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model, by which the study's results directory is recognised."""
        return self.study.name, self.kind.name, self.study.model.name

    @cached_property
    def identity(self) -> list[Any]:
        """All that a row of this kind depends on beside its point's structure and parameters."""
        return self.kind.identity(self)

    @property
    def band_hz(self) -> tuple[float, float]:
        """Band of the modes, Hz."""
        low, high = self.study.definition.modes.band
        return float(low), float(high)

    @cached_property
    def settings(self) -> ReductionSettings:
        """Basis of the component-mode reduction, from the band and the [reduction] section."""
        section = self.study.definition.reduction
        return reduction_settings(
            has_mesh(self.study),
            self.band_hz[1],
            section.component_cutoff_factor,
            section.assembly_cutoff_factor,
            section.tolerance,
            section.enrichment,
        )

    @cached_property
    def nominal(self) -> OperatingPoint:
        """Operating point of the study's [parameters], at which the basis is made."""
        return self.design(self.study.values).operating_point()

    @cached_property
    def training(self) -> tuple[OperatingPoint, ...]:
        """Operating points at the ends of swept pressure and contact-law ranges, the rest nominal.

        Ends of the friction range are added only if the study asks for it, so that otherwise
        another friction range reuses the reduction. Without enrichment there are no such points.
        """
        if not has_mesh(self.study) or not self.study.definition.reduction.enrichment:
            return ()
        points = []
        trained = {"pressure", *(p.name for p in contact_parameters())}
        if self.study.definition.reduction.friction_training:
            trained.add("friction")
        trained |= {name for t in self.study.model.tables if t.name in trained for name in t.over}
        nominal = self.design(self.study.values)
        for sweep in self.study.sweeps:
            name = sweep.name
            if name in trained:
                for end in sorted(set(self.ends(name))):
                    design = nominal.with_values({**self.study.values, name: end})
                    points.append(design.operating_point())
        return tuple(points)

    def ends(self, name: str) -> tuple[float, float]:
        """Least and largest value of a parameter over the design points."""
        column = self.tasks.column(name)
        return float(column.min()), float(column.max())

    @cached_property
    def judged_to_hz(self) -> float | None:
        """Highest frequency [Hz] at which reduced roots are compared with a finer model's.

        None for models without a mesh, whose bases are complete, and where the kind of study does
        not tell the error of the reduction in this way and residual responses are not asked for.
        """
        is_asked = self.kind.tells_reduction or self.study.definition.reduction.residual_responses
        return self.band_hz[1] if is_asked and has_mesh(self.study) else None

    @cached_property
    def trained_scales(self) -> tuple[dict[ModeKey, float], ...]:
        """Factors on component frequencies at which residual loads are taken."""
        return () if self.judged_to_hz is None else self._extreme_scales()

    def _extreme_scales(self) -> tuple[dict[ModeKey, float], ...]:
        """Factors on component frequencies: all at their least, all at their largest.

        A set of factors that are all 1 is left out, as is the second of two equal sets.
        """
        swept = [p for p in self.first.mode_parameters() if p.quantity == FREQUENCY_SCALE]
        extremes: list[dict[ModeKey, float]] = []
        for end in (0, 1):
            ends = {p: self.ends(p.name)[end] for p in swept}
            scale = {(p.component, mode): ends[p] for p in swept for mode in p.modes}
            if any(factor != 1.0 for factor in scale.values()) and scale not in extremes:
                extremes.append(scale)
        return tuple(extremes)

    @property
    def enriching(self) -> int:
        """How often directions of finer models join the basis (full_order/finer_model.py)."""
        section = self.study.definition.reduction
        once = section.enrichment and section.residual_responses and self.judged_to_hz is not None
        return int(once) + int(self.enriched)

    @cached_property
    def shared_range(self) -> SharedRange | None:
        """The range over which structures have one basis; None where each has its own."""
        return shared_range(self.study, int(self._values.structure_index.max(initial=-1)) + 1)

    def structure_key(self, design: DesignPoint, enriched: bool | None = None) -> str:
        """Content hash of a design's prepared model; StudyFileError where a file is missing."""
        if isinstance(self.study.model, FamilyDefinition):
            return self.family_key
        values = design.structural_values()
        shared = self.shared_range
        if shared is None or not shared.holds(values):
            return content_hash(self._structure(values, enriched))
        return content_hash({**self._structure(values, enriched), "shared": shared.identity})

    def shared_key(self, design: DesignPoint) -> str:
        """Content hash of the basis for the range that a design's structure is in."""
        assert self.shared_range is not None
        fixed = design.structural_values()
        for name in self.shared_range.names:
            del fixed[name]
        basis = {"basis": self.shared_range.identity, "band": list(self.band_hz)}
        return content_hash([self._structure(fixed, None), basis])

    def _structure(self, values: Mapping[str, float], enriched: bool | None) -> dict[str, Any]:
        """All that decides the reduction of a structure with these structural values."""
        enriched = self.enriched if enriched is None else enriched
        s, joined = self.settings, self.enriching - int(self.enriched) + int(enriched)
        scales = [sorted([*k, v.hex()] for k, v in x.items()) for x in self.trained_scales]
        model = self.study.model
        files = {"files": model.files} if isinstance(model, FileDefinition) else {}
        added = {"added": model.added} if model.added else {}
        return {
            **files,
            **added,
            "source": [source_hash(STRUCTURE_SOURCES), *in_models(self.study.extensions)],
            "model": self.study.model.name,
            "options": {k: v for k, v in self.study.options.items() if k not in LAW_OPTIONS},
            "structure": {k: float(v).hex() for k, v in values.items()},
            "trained at": [
                [*p.sliding_friction, p.brake_pressure, p.law.kind, *p.law.parameters]
                for p in (self.nominal, *self.training)
            ],
            "basis": [s.component_cutoff, s.assembly_cutoff, s.load_cutoff, s.tolerance],
            "finer": [source_hash(FINER_SOURCES), self.judged_to_hz, joined, scales],
        }

    @cached_property
    def family_key(self) -> str:
        """Content hash of a family's one prepared model: of the files, not of where they are."""
        model = self.study.model
        assert isinstance(model, FamilyDefinition)
        digests = file_digests(model, self.study.source)
        terms = [
            [term.matrix, digest, term.variable, term.coefficient]
            for term, digest in zip(model.sources, digests, strict=True)
        ]
        return content_hash(
            {
                "source": source_hash(),
                "terms": terms,
                "nominal": sorted((k, v.hex()) for k, v in model.defaults().items()),
                "band": list(self.band_hz),
            }
        )

    @cached_property
    def method(self) -> RungChoice:
        """The method that solves design points; StudyFileError where it cannot serve this study."""
        return choose_method(self.study, self.swept)

    @cached_property
    def tasks(self) -> DesignPoints:
        """Design points with identity and structure, in the order of the design."""
        key_of = self._stacked_key if self.stacked else self.structure_key
        return DesignPoints(self._values, PlannedNames(self._values, key_of, self._model_hash))

    def _stacked_key(self, design: DesignPoint) -> str:
        """A key that stands for all structures of a batch; no prepared model has it."""
        fixed = dict.fromkeys(design.structural_values(), 0.0)
        return content_hash(["stacked", self._structure(fixed, None), self.study.model.added])

    @property
    def first(self) -> DesignPoint:
        """The first design point, with neither id nor structure: these may depend on what it has.

        Model, options and names of the parameters are those of all design points.
        """
        return DesignPoint(self.study.model, self.study.options, self._given.values_of(0))

    def _model_hash(self, structure_key: str) -> str:
        """Content hash of all that decides the results of a design point beside its values."""
        return content_hash(
            [
                structure_key,
                source_hash(),
                *self.study.extensions,
                list(self.band_hz),
                self.first.law_identity,
                *self.identity,
                *self.method.identity,
            ]
        )

    @cached_property
    def structures(self) -> dict[str, DesignPoint]:
        """First design point of each structure, by the key of the prepared model, in order."""
        return {key: self.tasks[int(rows[0])] for key, rows in self.tasks.of_structures()}

    @cached_property
    def study_hash(self) -> str:
        """Hash of all that decides the tables."""
        return content_hash(
            [
                source_hash(TABLE_SOURCES),
                hashlib.sha256(self.tasks.ids.tobytes()).hexdigest(),
                list(self.study.shown_parameters),
                self.study.definition.model_dump(mode="json"),
                *([t.name, t.over, t.at, t.values] for t in self.study.model.tables),
                *self.identity,
                *self.kind.table_identity(self),
            ]
        )

    @cached_property
    def nominal_values(self) -> dict[str, float]:
        """Values of all parameters where nothing is swept."""
        neutral = {s.name: s.parameter.default for s in self.study.sweeps}
        uniform = self.study.values.get("damping_ratio", 0.0)
        modal = {p.name: uniform for p in self.first.assembly_parameters()}
        resolved = self._resolved({**neutral, **modal, **self.study.values})
        return {name: float(number) for name, number in resolved.items()}

    @cached_property
    def coordinates(self) -> np.ndarray:
        """Swept values as coordinates (n_points, n_sweeps); log where swept in log."""
        logs = [
            sweep.scale == "log" and bool((self.swept[:, k] > 0).all())
            for k, sweep in enumerate(self.study.sweeps)
        ]
        if not any(logs):
            return self.swept
        coordinates = self.swept.copy(order="F")
        coordinates[:, logs] = np.log(coordinates[:, logs])
        return coordinates

    @property
    def grid_shape(self) -> tuple[int, ...] | None:
        """Points along each sweep, first fastest, or None where the design is no grid."""
        return grid_shape(self.study)

    def check_modes(self, counts: Mapping[str, int]) -> None:
        """Raise StudyFileError where a component mode in use is not in the basis.

        `counts` has the number of free-free modes kept of each component in use.
        """
        for parameter in self.first.mode_parameters():
            count = counts[parameter.component]
            highest = max(parameter.modes)
            if highest > count:
                cutoff = f" up to {self.settings.component_cutoff:g} Hz in this basis"
                more = "; a higher [reduction] component_cutoff_factor holds more"
                meshed = has_mesh(self.study)
                raise self.error(
                    parameter.name,
                    f"{parameter.component} has modes 1 to {count}{cutoff if meshed else ''}, "
                    f"got mode {highest}{more if meshed else ''}",
                )

    def check_assembly_modes(self, count: int) -> None:
        """Raise StudyFileError where a real mode of the assembly in use is beyond the `count`."""
        for parameter in self.first.assembly_parameters():
            if max(parameter.modes) > count:
                raise self.error(
                    parameter.name,
                    f"the assembly has modes 1 to {count} in this basis, got mode "
                    f"{max(parameter.modes)}",
                )

    def error(self, parameter: str, message: str) -> StudyFileError:
        """A StudyFileError at the place where the study names a parameter."""
        keys: KeyPath = ("parameters", parameter)
        for number, sweep in enumerate(self.study.sweeps):
            if sweep.name == parameter:
                keys = ("sweep", number, "parameter")
        return self.study.error(keys, message)


def has_mesh(study: ResolvedStudy) -> bool:
    """Whether the model is a finite-element one, to be reduced."""
    return study.model.meshed
