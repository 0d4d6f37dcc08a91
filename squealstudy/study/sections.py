"""The sections of a study file as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    model_validator,
)

from squealstudy.study.source import shown

Scale = Literal["linear", "log"]

MOST_LEVELS = 1_000_000
LARGEST_SEED = 2**32 - 1
BANDS = {"disc_brake": (500.0, 8000.0)}  # Hz; of other models the field's default


def _flatten(tables: object) -> object:
    """Dotted keys of [parameters] as they were written, whether quoted or not."""
    if not isinstance(tables, dict):
        return tables
    flat: dict[str, object] = {}
    pending = [(str(k), v) for k, v in reversed(tables.items())]
    while pending:
        name, value = pending.pop()
        if isinstance(value, dict):
            pending.extend((f"{name}.{k}", v) for k, v in reversed(value.items()))
        elif name in flat:
            raise ValueError(f"'{name}' is given twice")
        else:
            flat[name] = value
    return flat


def _two(band: object) -> object:
    if not isinstance(band, list | tuple) or len(band) != 2:
        found = f"{len(band)} values" if isinstance(band, list) else shown(band)
        raise ValueError(f"expected two frequencies [low, high] in Hz, got {found}")
    return band


def _ascending(band: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= band[0] < band[1]:
        raise ValueError(
            f"expected [low, high] with 0 <= low < high, got [{band[0]:g}, {band[1]:g}]"
        )
    return band


FloatList = Annotated[tuple[float, ...], Strict(False)]
Band = Annotated[
    tuple[float, float], Strict(False), BeforeValidator(_two), AfterValidator(_ascending)
]
NumberTable = Annotated[dict[str, float], BeforeValidator(_flatten)]


class Section(BaseModel):
    """A table of the file: unknown keys are errors, and nothing is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class StudySection(Section):
    """What the study is."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]+$",
        max_length=100,
        description="name of the study and of its results directory: letters, digits, _ and -",
    )
    kind: Literal["complex_modes"] = Field(description="what is computed at each design point")
    description: str = Field(default="", description="free text, copied to the results")


class ModelSection(Section):
    """The model, and its own options beside its name."""

    model_config = ConfigDict(extra="allow")  # which options there are is the catalogue's to say

    name: str = Field(description="model of the catalogue; 'squealstudy models' lists them")

    @property
    def options(self) -> dict[str, Any]:
        """The other keys as given, unchecked."""
        return dict(self.model_extra or {})


class SweepSection(Section):
    """One parameter that varies: a list of values, or a range."""

    parameter: str = Field(
        description="a parameter of the model, or <component>.modes[12-14].frequency_scale, "
        "<component>.modes[3,7].damping_ratio"
    )
    values: FloatList | None = Field(
        default=None,
        description="the values, SI units; grid and zip only",
        json_schema_extra={"minItems": 1},
    )
    start: float | None = Field(default=None, description="first value of a range, SI units")
    stop: float | None = Field(default=None, description="last value of a range, SI units")
    num: int | None = Field(
        default=None,
        ge=1,
        le=MOST_LEVELS,
        description="number of values from start to stop, both in",
    )
    scale: Scale = Field(default="linear", description="spacing of the values from start to stop")


class DesignSection(Section):
    """How the sweeps are put together to design points."""

    type: Literal["grid", "zip", "sobol", "latin_hypercube"] = Field(
        default="grid",
        description="all combinations, values side by side, or points that fill the ranges",
    )
    samples: int | None = Field(
        default=None,
        ge=1,
        le=MOST_LEVELS,
        description="number of points (sobol and latin_hypercube)",
    )
    seed: int = Field(
        default=0,
        ge=0,
        le=LARGEST_SEED,
        description="of the random numbers (sobol and latin_hypercube)",
    )
    limit: int = Field(
        default=20_000, ge=1, le=10**9, description="more points than this need the option --yes"
    )


class ModesSection(Section):
    """Which complex modes are computed and how they are judged."""

    band: Band = Field(
        default=(1.0, 16000.0),
        description="lowest and highest frequency [Hz]; [500, 8000] for the disc brake; "
        "below 1 Hz nothing is listed (rigid-body noise)",
    )
    stability_tolerance: float = Field(
        default=1e-7,
        ge=0,
        le=1,
        description="a mode is unstable where its damping ratio is below minus this",
    )
    track: bool = Field(
        default=True, description="follow modes along the lines of a grid by their shapes"
    )
    reference_points: int = Field(
        default=2,
        ge=0,
        le=MOST_LEVELS,
        description="design points also solved by the full-order model",
    )


class ReductionSection(Section):
    """What the component-mode basis keeps."""

    component_cutoff_factor: float = Field(
        default=1.5,
        ge=1,
        le=100,
        description="component modes up to this times the top of the band",
    )
    assembly_cutoff_factor: float = Field(
        default=1.5, ge=1, le=100, description="assembly modes up to this times the top of the band"
    )
    tolerance: float = Field(
        default=3e-5,
        gt=0,
        le=0.1,
        description="enrichment shapes with relative singular values below this are left out",
    )
    enrichment: bool = Field(
        default=True, description="add static responses to the friction forces"
    )


class StudyDefinition(Section):
    """A whole study file."""

    study: StudySection = Field(description="name and kind of the study")
    model: ModelSection = Field(description="name of the model, and its options")
    parameters: NumberTable = Field(
        default_factory=dict,
        description="values that differ from the model's defaults, SI units",
        json_schema_extra={"additionalProperties": {"type": ["number", "object"]}},
    )
    sweep: Annotated[tuple[SweepSection, ...], Strict(False)] = Field(
        default=(), description="what varies; the first sweep varies fastest in a grid"
    )
    design: DesignSection = Field(default=DesignSection(), description="how sweeps are combined")
    modes: ModesSection = Field(default=ModesSection(), description="which modes are computed")
    reduction: ReductionSection = Field(
        default=ReductionSection(), description="basis of the reduction"
    )

    @model_validator(mode="before")
    @classmethod
    def _default_band(cls, data: Any) -> Any:
        """The band of the model, where the file gives none."""
        model = data.get("model") if isinstance(data, dict) else None
        modes = data.get("modes", {}) if isinstance(data, dict) else None
        name = model.get("name") if isinstance(model, dict) else None
        if isinstance(name, str) and name in BANDS and isinstance(modes, dict):
            return {**data, "modes": {"band": BANDS[name], **modes}}
        return data
