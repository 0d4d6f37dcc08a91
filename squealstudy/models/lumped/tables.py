"""The tables of the file of a lumped model: their keys and allowed values."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from squealstudy.models.file_table import Name, Table
from squealstudy.models.lumped.number_types import (
    Coefficient,
    Direction,
    Number,
    NumberWithUnit,
    Position,
    State,
)

GROUND = "ground"  # an end that does not move
MOVING = ("belt", "disc")  # ends that slide at the imposed speed, and do not vibrate
TRANSLATIONS, TURNS = ("x", "y", "z"), ("rx", "ry", "rz")
AXES = (*TRANSLATIONS, *TURNS)

Ends = Annotated[tuple[str, str], Strict(False)]
NameTuple = Annotated[tuple[str, ...], Strict(False)]

ALONG = "direction: x, y, z, with a minus the opposite, or components [x, y] or [x, y, z]; "
CALLED = "name in errors and tables"
PLACE_TEXT = "point [x, y, z] where it acts, m, which rotations of its masses move"


class MassTable(Table):
    """A body with its own coordinates."""

    name: Name = Field(description="name of the mass, also as component in tables")
    mass: Number | None = Field(default=None, description="mass for motions along x, y and z, kg")
    inertia: Number | None = Field(
        default=None, description="moment of inertia for rotations rx, ry and rz, kg m2"
    )
    directions: NameTuple = Field(
        default=(), description="its coordinates: some of x, y, z (m) and rx, ry, rz (rad)"
    )
    place: Position = Field(default=(0.0, 0.0, 0.0), description="centre of mass, m")
    spin: Number | None = Field(
        default=None,
        description="angular momentum of a body that rotates about spin_axis, kg m2 rad/s (polar "
        "inertia times speed): gyroscopic terms couple its tilts",
    )
    spin_axis: Direction = Field(default="z", description="axis and sense of the spin")

    @property
    def axes(self) -> tuple[str, ...]:
        """The coordinates, by default x for a mass and rz for an inertia."""
        default_axes = (("x",) if self.mass is not None else ()) + (
            ("rz",) if self.inertia is not None else ()
        )
        return self.directions or default_axes

    @model_validator(mode="after")
    def _has_what_moves(self) -> MassTable:
        """Raise ValueError unless directions and mass or inertia fit together."""
        for axis in self.directions:
            if axis not in AXES:
                raise ValueError(f"directions: expected of {', '.join(AXES)}, got '{axis}'")
        if len(set(self.directions)) < len(self.directions):
            raise ValueError(f"directions: one is there twice in {list(self.directions)}")
        for key, amount, axes in (
            ("mass", self.mass, TRANSLATIONS),
            ("inertia", self.inertia, TURNS),
        ):
            needed = [axis for axis in self.axes if axis in axes]
            if needed and amount is None:
                raise ValueError(f"the key '{key}' is missing: it moves along {needed[0]}")
            if not needed and amount is not None and self.directions:
                raise ValueError(f"{key}: expected one of {', '.join(axes)} among its directions")
        if not self.axes:
            raise ValueError("the key 'mass' is missing: kg (or 'inertia', kg m2)")
        return self


class SpringNumbers(Table):
    """Numbers of a spring: linear, or with a cubic term, a gap or one side only."""

    name: Name | None = Field(default=None, description=CALLED)
    stiffness: Number = Field(description="N/m, or N m/rad")
    cubic: Number | None = Field(
        default=None, description="cubic stiffness, N/m3 or N m/rad3; negative: it softens"
    )
    gap: Number | None = Field(
        default=None,
        description="play in which it does not act, m or rad; negative for a preloaded spring of "
        "one side",
    )
    side: Literal["both", "tension", "compression"] = Field(
        default="both",
        description="when it acts: tension, if the first end has moved along the direction away "
        "from the second; compression, if against it, as a stop",
    )

    @property
    def linear(self) -> bool:
        """Whether it has neither a cubic term nor a gap, and acts on both sides."""
        return self.cubic is None and self.gap is None and self.side == "both"


class SpringTable(SpringNumbers):
    """A spring between masses, or to the ground."""

    between: Ends = Field(description='two masses, or a mass and "ground"')
    direction: Direction = Field(description=ALONG + "rx, ry or rz of one against turning")
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class DamperNumbers(Table):
    """Numbers of a damper: linear, or with a cubic term."""

    name: Name | None = Field(default=None, description=CALLED)
    damping: Number = Field(description="N s/m, or N m s/rad")
    cubic: Number | None = Field(default=None, description="cubic damping, N s3/m3 or N m s3/rad3")

    @property
    def linear(self) -> bool:
        """Whether it has no cubic term."""
        return self.cubic is None


class DamperTable(DamperNumbers):
    """A damper between masses, or to the ground."""

    between: Ends = Field(description='two masses, or a mass and "ground"')
    direction: Direction = Field(description=ALONG + "rx, ry or rz of one against turning")
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class ContactNumbers(Table):
    """Numbers of a contact point; law and friction are the study's, except where it has its own."""

    name: Name | None = Field(default=None, description=CALLED)
    stiffness: Number | None = Field(
        default=None, description="N/m at 5e11 Pa/m, the default of contact.stiffness"
    )
    area: Number | None = Field(default=None, description="in m2, instead of a stiffness")
    gap: Number = Field(default=0.0, description="gap without load, m; negative: preloaded")
    friction: Coefficient = Field(
        default=True,
        description="false: no friction; a number: its coefficient, in place of the parameter",
    )
    friction_factor: Number = Field(default=1.0, description="factor on the parameter friction")
    friction_law: dict[str, Number] = Field(
        default={},
        description="its values of parameters of the study's friction law; keys are their names "
        "without friction_law.",
    )
    speed_factor: Number = Field(default=1.0, description="factor on sliding_speed")
    state: State | None = Field(
        default=None,
        description="for a contact without steady sliding, as of a bracket or pin: stuck or "
        "sliding, or a parameter that is 1 or 0; in time it sticks and slips by itself",
    )
    tangential: Number | None = Field(
        default=None,
        description="tangential stiffness in complex modes while it is stuck, N/m",
    )
    radius: Number | None = Field(
        default=None,
        description="lever arm of its friction in torques, m; without any they are forces",
    )

    @property
    def rubs(self) -> bool:
        """Whether it has friction, of the study's coefficient or its own."""
        return self.friction is not False

    @property
    def own_coefficient(self) -> Number | None:
        """The contact's own friction coefficient; None where it has the study's, or none."""
        return None if isinstance(self.friction, bool) else self.friction


class ContactTable(ContactNumbers):
    """A contact point of a mass."""

    between: Ends = Field(
        description='a mass and the part that it touches: a mass; "belt" or "disc", which slide at '
        'sliding_speed; or "ground", without friction or with a state'
    )
    normal: Direction = Field(description=ALONG + "the first leaves the second this way")
    sliding: Direction | None = Field(
        default=None,
        description=ALONG + "the second slides past the first this way, and pulls it",
    )
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class LoadNumbers(Table):
    """A constant force, or one that is proportional to the brake pressure."""

    name: Name | None = Field(default=None, description=CALLED)
    force: Number | None = Field(default=None, description="N, or N m")
    area: Number | None = Field(
        default=None, description="area on which the parameter 'pressure' acts, m2; else a force"
    )


class LoadTable(LoadNumbers):
    """A force on a mass."""

    on: str = Field(description="the mass")
    direction: Direction = Field(description=ALONG + "rx, ry or rz of a moment")
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class ParameterTable(Table):
    """A parameter that expressions of the file use, or one of the operating point."""

    default: NumberWithUnit = Field(description='number in SI units, or with its unit: "7 kN/mm"')
    unit: str | None = Field(
        default=None, description="unit of SI, or deg; empty for a pure number"
    )
    description: str = Field(default="", description="text in tables and on screens")
    minimum: float | None = Field(default=None, description="smallest allowed value")
    maximum: float | None = Field(default=None, description="largest allowed value")

    @model_validator(mode="before")
    @classmethod
    def _of_its_default(cls, written: Any) -> Any:
        return written if isinstance(written, dict | ParameterTable) else {"default": written}


class PartsFile(Table):
    """Tables that both files of masses and files of matrices have."""

    description: str = Field(default="", description="free text")
    parameters: dict[str, ParameterTable] = Field(
        default={}, description="parameters of expressions in the file; `NAME = 0.4` is enough"
    )

    def name_of(self, kind: str, number: int) -> str:
        """Name of a term, mass, spring, damper, contact or load."""
        return getattr(self, kind)[number].name or f"{kind}_{number + 1}"


class LumpedFile(PartsFile):
    """A whole file of a lumped model of masses."""

    mass: Annotated[tuple[MassTable, ...], Strict(False)] = Field(
        min_length=1, description="bodies with coordinates of their own"
    )
    spring: Annotated[tuple[SpringTable, ...], Strict(False)] = Field(
        default=(), description="between masses, or to the ground"
    )
    damper: Annotated[tuple[DamperTable, ...], Strict(False)] = Field(
        default=(), description="between masses, or to the ground"
    )
    contact: Annotated[tuple[ContactTable, ...], Strict(False)] = Field(
        default=(), description="contact points"
    )
    load: Annotated[tuple[LoadTable, ...], Strict(False)] = Field(
        default=(), description="forces on masses"
    )
