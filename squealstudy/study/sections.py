"""The sections of a study file as pydantic models."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, Strict, model_validator

from squealstudy.mechanics.defaults import (
    ASSEMBLY_CUTOFF_FACTOR,
    BANDS,
    BASIS_TOLERANCE,
    COMPONENT_CUTOFF_FACTOR,
    DEFAULT_BAND,
    LUMPED,
    MODE_TOLERANCE,
    OF_FILE,
    STABILITY_TOLERANCE,
)
from squealstudy.modes.rungs import AUTO, rung_names
from squealstudy.study.design_sections import ADDED_MASS, MOST_LEVELS, DesignSection, SweepSection
from squealstudy.study.section import Band, NamedSection, NumberTable, Section
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import KeyPath
from squealstudy.wording import did_you_mean, shown

if TYPE_CHECKING:  # it imports models
    from squealstudy.study.added_parts import AddedPart

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
DURATION = re.compile(r"\s*([0-9.]+)\s*(s|min|h)\s*")


def _seconds(value: object) -> object:
    """A time such as "5 min" in seconds; anything that is no text unchanged."""
    if not isinstance(value, str):
        return value
    match = DURATION.fullmatch(value)
    if match is None or match[1].count(".") > 1 or match[1] == ".":
        raise ValueError(f"expected a time like '90 s', '5 min' or '2 h', got '{value}'")
    return float(match[1]) * SECONDS[match[2]]


class FidelitySection(Section):
    """How accurate results must be: the engine chooses the settings that the file leaves out."""

    tolerance: float = Field(
        gt=0,
        le=0.5,
        description="largest error: for complex modes relative in frequency and absolute in the "
        "damping ratio of lightly damped modes; in time relative in growth rate, level, mean "
        "torque and line",
    )
    budget: Annotated[float, BeforeValidator(_seconds)] | None = Field(
        default=None,
        gt=0,
        description="longest time of the run, '90 s', '5 min' or '2 h': where the tolerance needs "
        "longer, the settings of least error within this time are taken",
    )
    pilots: int = Field(
        default=2, ge=1, le=16, description="design points on which settings are tried"
    )
    audit: int = Field(
        default=2,
        ge=0,
        le=1000,
        description="number of random design points that are solved again with better settings at "
        "the end; where these miss the tolerance, the study is run again with better settings",
    )


def _as_text(value: Any) -> str:
    """A coefficient, an expression or a number, as the text of an expression."""
    if isinstance(value, str):
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value):
        raise ValueError(f"expected a number or an expression in quotes, got {shown(value)}")
    return repr(value)


Coefficient = Annotated[str, BeforeValidator(_as_text)]


class TermSection(Section):
    """One summand of the mass, damping or stiffness: a matrix times its coefficient."""

    matrix: Literal["M", "C", "K"] = Field(description="mass, damping or stiffness")
    file: str = Field(
        min_length=1,
        description="Matrix Market, MATLAB, Harwell-Boeing, Nastran (DMIG, OP4, OP2) or SciPy npz "
        "file, relative to the model's folder or absolute",
    )
    variable: str | None = Field(
        default=None, description="which matrix, where the file holds several"
    )
    coefficient: Coefficient = Field(
        default="1.0",
        description="number, or expression of parameters: + - * / ** brackets pi e sin cos tan "
        "asin acos atan sqrt exp log log10 abs min max",
        json_schema_extra={"type": ["string", "number"]},
    )


class StudySection(NamedSection):
    """The [study] section: name, kind, description."""

    kind: str = Field(
        description="what is computed: complex modes, motion in time, limit cycles, sensitivities "
        "of complex modes, or a design without squeal"
    )
    extensions: Annotated[tuple[str, ...], Strict(False)] = Field(
        default=(),
        description="Python files that are executed first, relative to the study file, with laws "
        "and so on that are not in the package; results depend on their content",
    )


class ModelSection(Section):
    """The model, and its options besides its name."""

    model_config = ConfigDict(extra="allow")  # the model itself checks its options

    name: str = Field(description="model of the catalogue; 'squealstudy models' lists them")
    file: str | None = Field(
        default=None,
        min_length=1,
        description="model file of your own brake, relative to the study file, in place of a name",
    )
    term: Annotated[tuple[TermSection, ...], Strict(False)] = Field(
        default=(), description="summands of the mass, damping and stiffness (matrices only)"
    )
    folder: str | None = Field(
        default=None,
        description="where the files of the terms are, relative to the study file or absolute; "
        "$SQUEALSTUDY_DATA replaces it (matrices only)",
    )

    @model_validator(mode="before")
    @classmethod
    def _named_by_its_file(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "file" not in data:
            return data
        name = data.get("name", OF_FILE)
        if name not in (OF_FILE, LUMPED):
            raise ValueError("expected the name of a model of the catalogue, or a file; not both")
        return {**data, "name": name}

    @property
    def options(self) -> dict[str, Any]:
        """Options in [model], unchecked."""
        return dict(self.model_extra or {})

    @property
    def family_keys(self) -> tuple[str, ...]:
        """Given keys that only a family of matrices has."""
        return tuple(key for key in ("term", "folder") if key in self.model_fields_set)


def _rung(name: str) -> str:
    """The name of a rung, or AUTO; ValueError for others."""
    names = (AUTO, *rung_names())
    if name not in names:
        listed = ", ".join(shown(rung_name) for rung_name in names)
        raise ValueError(f"expected one of {listed}, got {shown(name)}{did_you_mean(name, names)}")
    return name


class ModesSection(Section):
    """Which complex modes are computed, and how stability is judged."""

    band: Band = Field(
        default=DEFAULT_BAND,
        description="lowest and highest frequency [Hz]; [500, 8000] for the disc brake; a band "
        "from 0 begins at 1e-5 of its top, and leaves out rigid-body motion, whose frequency "
        "cannot be told from zero",
    )
    stability_tolerance: float = Field(
        default=STABILITY_TOLERANCE,
        ge=0,
        le=1,
        description="a mode is unstable where its damping ratio is below minus this and its growth "
        "rate above error_rung; errors below it leave no mode uncertain",
    )
    method: Annotated[str, AfterValidator(_rung)] = Field(
        default=AUTO,
        description="how design points are solved, a rung of squealstudy/modes/rungs; auto: "
        "exactly, or by a rung that keeps the tolerance if that takes less time in all",
        json_schema_extra={"enum": [AUTO, *rung_names()]},
    )
    tolerance: float = Field(
        default=MODE_TOLERANCE,
        gt=0,
        le=0.1,
        description="largest estimated error of lightly damped and of growing modes, relative in "
        "frequency and absolute in damping ratio. Where error_rung exceeds it a point is solved "
        "exactly; where that does too (stiff springs beside soft ones) its status is inaccurate. "
        "Where error_reduction exceeds it the basis is enriched, once for the study",
    )
    audit: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="share of the design points, chosen at random, that are also solved at full "
        "order, which gives true errors",
    )
    track: bool = Field(
        default=True, description="follow modes along the lines of a grid by their shapes"
    )
    refine_tracking: bool = Field(
        default=True,
        description="solve points in between where it is doubtful which mode continues which",
    )
    refine_onsets: bool = Field(
        default=True,
        description="find the values at which modes become unstable by root finding, to 1e-4",
    )
    refine_points: int | None = Field(
        default=None,
        ge=0,
        description="approximate number of design points that both may solve between those of the "
        "study. Default: 500 for tracks (3,000 for a model of few coordinates) and 1,000 for "
        "onsets; for onsets that bound stability a fifth of the design points or 20,000",
    )
    reference_points: int = Field(
        default=2,
        ge=0,
        le=MOST_LEVELS,
        description="number of design points that are also solved by the full-order model",
    )


class ReductionSection(Section):
    """The [reduction] section: what a component-mode basis keeps."""

    component_cutoff_factor: float = Field(
        default=COMPONENT_CUTOFF_FACTOR,
        ge=1,
        le=100,
        description="component modes up to this times the top of the band",
    )
    assembly_cutoff_factor: float = Field(
        default=ASSEMBLY_CUTOFF_FACTOR,
        ge=1,
        le=100,
        description="assembly modes up to this times the top of the band; 1.5 in transient studies",
    )
    tolerance: float = Field(
        default=BASIS_TOLERANCE,
        gt=0,
        le=0.1,
        description="enrichment shapes with relative singular values below this are left out; "
        "1e-3 in transient studies",
    )
    enrichment: bool = Field(
        default=True, description="add static responses to the friction forces"
    )
    residual_responses: bool = Field(
        default=True,
        description="where enrichment is true, also add static responses to the residuals of "
        "reduced modes in the unreduced equations at strong friction; false in transient studies",
    )
    friction_training: bool = Field(
        default=False,
        description="add static responses to the change of contact stiffness at the ends of a "
        "swept friction, as is done for pressure. Errors far from the nominal friction are "
        "smaller; the basis is larger, and there is a reduction for each range",
    )
    shared_basis: bool = Field(
        default=True,
        description="where eight or more structures of a model file are swept, make one basis "
        "over the range of their materials and springs instead of a reduction for each value",
    )


class StudyDefinition(Section):
    """A whole study file, without the table of its kind.

    `other_defaults` has defaults of a kind of study, by table and key, that differ from those here.
    """

    other_defaults: ClassVar[Mapping[str, Mapping[str, Any]]] = {}

    study: StudySection = Field(description="name and kind of the study")
    model: ModelSection = Field(description="name of the model, and its options")
    parameters: NumberTable = Field(
        default_factory=dict,
        description="values that differ from the model's defaults: SI units, or texts with a unit; "
        "a bare temperature is in K, results have it in degC",
        json_schema_extra={"additionalProperties": {"type": ["number", "string", "object"]}},
    )
    sweep: Annotated[tuple[SweepSection, ...], Strict(False)] = Field(
        default=(), description="what varies; the first sweep varies fastest in a grid"
    )
    design: DesignSection = Field(default=DesignSection(), description="how sweeps are combined")
    modes: ModesSection = Field(default=ModesSection(), description="which modes are computed")
    reduction: ReductionSection = Field(
        default=ReductionSection(), description="basis of the reduction"
    )
    fidelity: FidelitySection | None = Field(
        default=None,
        description="how accurate results must be: settings that are left out are chosen for it "
        "(complex_modes and transient)",
    )

    def added_parts(self, source: SourceText) -> tuple[AddedPart, ...]:
        """Masses that the study adds to its model, by the parameters that it names."""
        named: dict[str, KeyPath] = {name: ("parameters", name) for name in self.parameters}
        named |= {s.parameter: ("sweep", i, "parameter") for i, s in enumerate(self.sweep)}
        masses = {name: place for name, place in named.items() if name.startswith(ADDED_MASS)}
        if not masses:
            return ()
        from squealstudy.study.added_parts import named_mass

        return tuple(named_mass(name, source, place) for name, place in masses.items())

    @model_validator(mode="before")
    @classmethod
    def _defaults_of_model_and_kind(cls, data: Any) -> Any:
        """The band of the model and the basis of the kind, where the file gives none."""
        if not isinstance(data, dict):
            return data
        name = _inside(data, "model", "name")
        if name is None and _inside(data, "model", "file"):
            name = OF_FILE
        defaults: dict[str, Any] = {k: dict(v) for k, v in cls.other_defaults.items()}
        if isinstance(name, str) and name in BANDS:
            defaults["modes"] = {"band": BANDS[name]}
        usable = {k: v for k, v in defaults.items() if isinstance(data.get(k, {}), dict)}
        return {**data, **{k: {**v, **data.get(k, {})} for k, v in usable.items()}}


def _inside(data: dict[str, Any], section: str, key: str) -> object:
    table = data.get(section)
    return table.get(key) if isinstance(table, dict) else None
