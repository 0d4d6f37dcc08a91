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

ALONG = "direction: x, y, z, with a minus the other way, or components [x, y] or [x, y, z]; "
CALLED = "as errors and tables call it"
PLACE_TEXT = "point [x, y, z] where it acts, m; turns of its masses move it"


class MassTable(Table):
    """A body with its own coordinates."""

    name: Name = Field(description="of the mass; components of tables have it")
    mass: Number | None = Field(default=None, description="in kg, of its motion along x, y and z")
    inertia: Number | None = Field(default=None, description="in kg m2, of its turns rx, ry and rz")
    directions: NameTuple = Field(
        default=(), description="its coordinates, of x, y, z (m) and rx, ry, rz (rad)"
    )
    place: Position = Field(default=(0.0, 0.0, 0.0), description="of its centre of mass, m")
    spin: Number | None = Field(
        default=None,
        description="in kg m2 rad/s: polar inertia times speed of a body that turns about "
        "spin_axis, whose tilts gyroscopic terms couple",
    )
    spin_axis: Direction = Field(default="z", description="axis of the spin, with its sense")

    @property
    def axes(self) -> tuple[str, ...]:
        """The coordinates, as given or by default: x of a mass, rz of an inertia."""
        default_axes = (("x",) if self.mass is not None else ()) + (
            ("rz",) if self.inertia is not None else ()
        )
        return self.directions or default_axes

    @model_validator(mode="after")
    def _has_what_moves(self) -> MassTable:
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
        default=None, description="N/m3, or N m/rad3, of the third power; negative: it softens"
    )
    gap: Number | None = Field(
        default=None,
        description="in m, or rad, over which it does not act; of one side: negative, it is "
        "preloaded",
    )
    side: Literal["both", "tension", "compression"] = Field(
        default="both",
        description="where it acts: tension, where the first has moved along the direction away "
        "from the second; compression, against it, as a stop",
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
    cubic: Number | None = Field(
        default=None, description="N s3/m3, or N m s3/rad3, of the third power of its rate"
    )

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
    gap: Number = Field(default=0.0, description="opening without load, m; negative: preloaded")
    friction: Coefficient = Field(
        default=True,
        description="false: it has none; a number: its coefficient, in place of the parameter",
    )
    friction_factor: Number = Field(
        default=1.0, description="its friction coefficient over the parameter friction"
    )
    friction_law: dict[str, Number] = Field(
        default={},
        description="its values of parameters of the study's friction law, by what follows "
        "friction_law. in their names",
    )
    speed_factor: Number = Field(default=1.0, description="its sliding speed over sliding_speed")
    state: State | None = Field(
        default=None,
        description="of a bracket or pin, past which nothing slides steadily: stuck or sliding, "
        "or a parameter that is 1 or 0; in time it sticks and slips by itself",
    )
    tangential: Number | None = Field(
        default=None,
        description="in N/m, what it holds in its plane in complex modes while it is stuck",
    )
    radius: Number | None = Field(
        default=None, description="arm of its friction in torques, m; without any they are forces"
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
        description='a mass and what it touches: a mass, "belt" or "disc" that slide at '
        'sliding_speed, or "ground" without friction or with a state'
    )
    normal: Direction = Field(description=ALONG + "in which the first leaves the second")
    sliding: Direction | None = Field(
        default=None,
        description=ALONG + "in which the second slides past the first, and pulls it",
    )
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class LoadNumbers(Table):
    """A constant force, or one that is proportional to the brake pressure."""

    name: Name | None = Field(default=None, description=CALLED)
    force: Number | None = Field(default=None, description="N, or N m")
    area: Number | None = Field(
        default=None, description="in m2, instead of a force: the parameter 'pressure' acts on it"
    )


class LoadTable(LoadNumbers):
    """A force on a mass."""

    on: str = Field(description="the mass")
    direction: Direction = Field(description=ALONG + "rx, ry or rz of a moment")
    at: Position | None = Field(default=None, description=PLACE_TEXT)


class ParameterTable(Table):
    """A parameter that numbers of the file are made of, or one of the operating point."""

    default: NumberWithUnit = Field(description='number in SI units, or with its unit: "7 kN/mm"')
    unit: str | None = Field(default=None, description="of SI, or deg; empty for a pure number")
    description: str = Field(default="", description="what tables and screens say of it")
    minimum: float | None = Field(default=None, description="least value that it may have")
    maximum: float | None = Field(default=None, description="largest value that it may have")

    @model_validator(mode="before")
    @classmethod
    def _of_its_default(cls, written: Any) -> Any:
        return written if isinstance(written, dict | ParameterTable) else {"default": written}


class PartsFile(Table):
    """Tables that both files of masses and files of matrices have."""

    description: str = Field(default="", description="free text")
    parameters: dict[str, ParameterTable] = Field(
        default={}, description="what numbers of the file are made of; `NAME = 0.4` will do"
    )

    def name_of(self, kind: str, number: int) -> str:
        """Name of a mass, spring, damper, contact or load."""
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
