"""Sections of a design study beside a matrix of operation: variables, scatter, the goal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict, model_validator

from squealstudy.kinds.limit_cycles.section import LimitCyclesDefinition
from squealstudy.models.units import in_unit_of
from squealstudy.study.design_sections import QUANTITY, SweepSection
from squealstudy.study.section import FloatList, Section, flatten
from squealstudy.study.source import SourceText

if TYPE_CHECKING:  # it imports models
    from squealstudy.study.added_parts import AddedPart

MOST_COST = 1e100  # sums of weighted costs are still finite


def _bounds(ends: tuple[float, ...]) -> tuple[float, ...]:
    """Bounds of a variable as changes from today's value; ValueError for others."""
    if len(ends) != 2:
        raise ValueError(f"expected two changes from today's value [low, high], got {len(ends)}")
    if not ends[0] <= 0.0 <= ends[1] or ends[0] == ends[1]:
        raise ValueError(
            "expected changes from today's value, low <= 0 <= high and not both 0, got "
            f"[{ends[0]:g}, {ends[1]:g}]"
        )
    return ends


def _in(unit: str) -> BeforeValidator:
    """Validator that takes a number, or converts a text with a unit like `unit` to a number."""

    def number(value: object) -> object:
        return in_unit_of(value, unit) if isinstance(value, str) else value

    return BeforeValidator(number)


def _sets_name(names: tuple[str, ...]) -> str:
    return ".".join(names).replace("[", "_").replace("]", "_")


class AddedMassSection(Section):
    """A mass that may be added on a named set of a component."""

    on: str = Field(description="COMPONENT.SET that it moves with")
    max: Annotated[float, _in("kg")] = Field(
        gt=0,
        description='largest one in all, kg or a text like "80 g"',
        json_schema_extra={"type": list(QUANTITY)},
    )
    at: Annotated[tuple[float, float, float], Strict(False)] | None = Field(
        default=None,
        description="where it is, in the model file's units or m, by the mean motion of the set; "
        "else spread over it",
    )

    @property
    def parameter(self) -> str:
        """Name of the parameter that the mass becomes."""
        return f"added_mass.{_sets_name((self.on,))}"

    def part(self, source: SourceText, number: int) -> AddedPart:
        """The added part, by the number of the variable."""
        from squealstudy.models.components.file_tables import PointMassTable
        from squealstudy.study.added_parts import AddedPart

        table = PointMassTable(name="added", on=self.on, mass=0.0, at=self.at)
        keys = ("variable", number, "added_mass")
        return AddedPart(self.parameter, table, ("mass",), source, keys)


class StiffenerSection(Section):
    """Springs that may be added on a named set, to ground or between the means of two sets."""

    between: Annotated[tuple[str, str], Strict(False)] = Field(
        description='two of COMPONENT.SET, or one and "ground"'
    )
    max: Annotated[float, _in("N/m")] = Field(
        gt=0,
        description='largest stiffness in all, in each direction, N/m or a text like "5 kN/mm"',
        json_schema_extra={"type": list(QUANTITY)},
    )
    axes: Literal["cartesian", "cylindrical"] = Field(
        default="cartesian", description="x, y, z; or radial, around and along the axis of rotation"
    )
    directions: Annotated[tuple[Literal[1, 2, 3], ...], Strict(False)] = Field(
        default=(1, 2, 3), min_length=1, description="those of the axes that it is stiff in"
    )

    @property
    def parameter(self) -> str:
        """Name of the parameter that the stiffness becomes."""
        return f"stiffener.{_sets_name(self.between)}"

    def part(self, source: SourceText, number: int) -> AddedPart:
        """The added part, by the number of the variable."""
        from squealstudy.models.components.file_tables import SpringTable
        from squealstudy.study.added_parts import AddedPart

        none = (0.0, 0.0, 0.0)
        table = SpringTable(name="added", between=self.between, axes=self.axes, stiffness=none)
        keys = tuple(f"stiffness[{k}]" for k in dict.fromkeys(self.directions))
        return AddedPart(self.parameter, table, keys, source, ("variable", number, "stiffener"))


class VariableSection(Section):
    """A variable, its range and its cost: a parameter, or a part that is added."""

    parameter: str | None = Field(
        default=None,
        description="a parameter of the model, or <component>.modes[12-14].frequency_scale, "
        "<component>.modes[3,7].damping_ratio",
    )
    added_mass: AddedMassSection | None = Field(
        default=None,
        description="instead of a parameter a mass that is added, on a named set",
    )
    stiffener: StiffenerSection | None = Field(
        default=None,
        description="instead of a parameter springs that are added, on named sets",
    )
    bounds: Annotated[tuple[float, ...], Strict(False), AfterValidator(_bounds)] | None = Field(
        default=None,
        description="of a parameter: changes from the value in [parameters] that are allowed, "
        '["-3 mm", "+2 mm"]: both ends as differences, in the unit of the parameter',
        json_schema_extra={"minItems": 2, "maxItems": 2, "items": {"type": list(QUANTITY)}},
    )
    cost: float = Field(
        default=1.0,
        gt=0,
        le=MOST_COST,
        description="of a change over the whole range between the bounds, either way; costs of all "
        "variables add",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> VariableSection:
        """Raise ValueError unless the variable is of one kind, with bounds if a parameter."""
        kinds = ("parameter", "added_mass", "stiffener")
        named_kinds = [k for k in kinds if getattr(self, k) is not None]
        if len(named_kinds) != 1:
            got = " and ".join(named_kinds) or "none"
            raise ValueError(f"expected one of parameter, added_mass and stiffener, got {got}")
        if (self.bounds is None) == (named_kinds == ["parameter"]):
            raise ValueError("expected bounds of a parameter, and of nothing else")
        return self

    @property
    def added(self) -> AddedMassSection | StiffenerSection | None:
        """The part that it adds; None if it is a parameter."""
        return self.added_mass or self.stiffener

    @property
    def key(self) -> str:
        """The key of the section that is given: parameter, added_mass or stiffener."""
        return "parameter" if self.parameter else "added_mass" if self.added_mass else "stiffener"

    @property
    def name(self) -> str:
        """Name of its parameter."""
        return self.parameter or (self.added.parameter if self.added else "")

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest change from today's value."""
        if self.added is not None:
            return 0.0, self.added.max
        assert self.bounds is not None
        return self.bounds[0], self.bounds[1]


def _once(variants: tuple[VariantSection, ...]) -> tuple[VariantSection, ...]:
    names = [v.name.casefold() for v in variants]  # folders of some systems know one case
    for variant, name in zip(variants, names, strict=True):
        if names.count(name) > 1:
            raise ValueError(f"expected a name for each variant, '{variant.name}' is given twice")
    return variants


class VariantSection(Section):
    """A whole alternative: today's design is another one, with the same variables."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]+$",
        max_length=100,
        description="of the folder of its results, too: letters, digits, _ and -",
    )
    cost: float = Field(
        default=0.0,
        ge=0,
        le=MOST_COST,
        description="of choosing it; costs of its changes are added",
    )
    description: str = Field(default="", description="free text, copied to its results")
    model: dict[str, Any] = Field(
        default={},
        description="keys of [model] that differ; another name or file stands for the whole table",
    )
    parameters: dict[str, Any] = Field(
        default={},
        description="keys of [parameters] that differ, tables that they follow too",
        json_schema_extra={"additionalProperties": {"type": ["number", "string", "object"]}},
    )


class MarginSection(Section):
    """Margin from which on a mode counts as silent."""

    damping_ratio: float = Field(
        default=0.0,
        ge=-1,
        lt=1,
        description="least damping ratio of every mode of the band at every operating point",
    )
    probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="with which the scatter of [[uncertain]] leaves that margin",
    )


class GoalSection(Section):
    """The [goal] of a design study, and how much is spent on it."""

    margin: MarginSection = Field(default=MarginSection(), description="what counts as silent")
    occurrence: Annotated[dict[str, FloatList], BeforeValidator(flatten)] = Field(
        default={},
        description="how often the values of a sweep occur, in their order and on any scale, "
        "{friction = [1, 4, 2]}: operating points count by the product in shares of squeal; by "
        "default all alike",
        json_schema_extra={"additionalProperties": {"type": ["array", "object"]}},
    )
    starts: int = Field(
        default=8,
        ge=1,
        le=64,
        description="designs from which the search starts, today's one first",
    )
    scan: int | None = Field(
        default=None,
        ge=0,
        le=4096,
        description="designs over the whole box beside its corners, of which the other starts "
        "are the best; by default 16 a variable, none where a variable costs a reduction; 0 leaves "
        "out the corners too",
    )
    designs: int = Field(
        default=400, ge=1, le=10_000, description="designs evaluated at most, the scan apart"
    )
    cycles: int | None = Field(
        default=None,
        ge=0,
        le=1000,
        description="operating points of least margin at which limit cycles of the chosen design "
        "are looked for; by default 4, none of a brake, where each takes minutes",
    )
    in_time: int = Field(
        default=4,
        ge=0,
        le=1000,
        description="operating points at which the chosen design runs in time, from today's "
        "vibration and from kicks: those of its least margin, and those of today's; of a brake "
        "each takes minutes, at every design that the checks before let pass",
    )
    full_order: int = Field(
        default=2,
        ge=0,
        le=1000,
        description="operating points of least margin at which it is solved at full order",
    )
    samples: int | None = Field(
        default=None,
        ge=1,
        le=100_000,
        description="of the scatter; by default as many as show the probability at 95 % confidence "
        "where none misses the margin",
    )
    sampled: int = Field(
        default=4, ge=1, le=1000, description="operating points of least margin that are sampled"
    )
    seed: int = Field(default=0, ge=0, description="of the scan and of the samples")


class DesignStudyDefinition(LimitCyclesDefinition):
    """A whole file of a design study; [limit_cycles] is of the proof."""

    goal: GoalSection = Field(
        default=GoalSection(), description="what counts as silent (kind = 'design' only)"
    )
    variable: Annotated[tuple[VariableSection, ...], Strict(False)] = Field(
        default=(), description="what may change (kind = 'design' only)"
    )
    uncertain: Annotated[tuple[SweepSection, ...], Strict(False)] = Field(
        default=(),
        description="what scatters about the values in [parameters] (kind = 'design' only)",
    )
    variant: Annotated[tuple[VariantSection, ...], Strict(False), AfterValidator(_once)] = Field(
        default=(),
        description="whole alternatives, each searched and proven beside the file's own design "
        "(kind = 'design' only)",
    )

    def added_parts(self, source: SourceText) -> tuple[AddedPart, ...]:
        """The masses and springs among the variables, and masses that are named elsewhere."""
        of_variables = tuple(
            v.added.part(source, i) for i, v in enumerate(self.variable) if v.added
        )
        names = {part.name for part in of_variables}
        return (*of_variables, *(p for p in super().added_parts(source) if p.name not in names))


DEFINITION = DesignStudyDefinition
