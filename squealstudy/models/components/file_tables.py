"""The tables of a model file beside those of components: their keys, and what they may be."""

from __future__ import annotations

from math import inf, isfinite
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, Strict, WithJsonSchema, model_validator

from squealstudy.laws.own_friction import STATES
from squealstudy.models.file_table import Name, Table, Texts, Vector
from squealstudy.wording import shown

Pair = Annotated[tuple[str, str], Strict(False)]
CALLED = "as errors, tables and paths of parameters call it"
CUTS = "clipped: by the parts of facets that lie on each other; gauss: by the slave's facets alone"


class RotationTable(Table):
    """The axis about which the rotor turns, by the right hand."""

    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")
    axis: Vector = Field(description="direction of the axis; the rotor turns about it")
    rotor: str | None = Field(
        default=None, description="the component that turns; else the masters of sliding contacts"
    )
    angle: float = Field(
        default=0.0,
        description="by which what turns stands turned from its meshes, by the right hand, deg; "
        "contact is found there",
    )
    uniform: bool = Field(
        default=False,
        description="all points slide at sliding_speed; else the rotor turns, and sliding_speed is "
        "that at the effective radius",
    )
    effective_radius: float | None = Field(
        default=None, gt=0, description="else the mean radius of the sliding faces, by area"
    )


class GapTable(Table):
    """Measured gaps of a face."""

    file: str = Field(
        description="names x, y, gap (or z with two or three) and a line a place, in the unit and "
        "the coordinates of the slave's file"
    )


class FrictionTable(Table):
    """Friction factors of a face: of a file, or a random field of mean 1."""

    file: str | None = Field(
        default=None,
        description="names x, y, factor (or z with two or three) and a line a place, in the unit "
        "and the coordinates of the slave's file; no factor below 0, linear between places",
    )
    std: float | None = Field(
        default=None, gt=0, description="standard deviation of a normal random field of mean 1"
    )
    length: float | None = Field(
        default=None,
        gt=0,
        description="places at a distance d correlate by exp(-(d / length)^2)",
    )


def _gap(written: object) -> object:
    """The gap unchanged; one error in place of pydantic's two where it is none."""
    of_file = isinstance(written, GapTable) or (
        isinstance(written, dict)
        and written.keys() == {"file"}
        and isinstance(written["file"], str)
    )
    number = (
        isinstance(written, float | int) and not isinstance(written, bool) and isfinite(written)
    )
    if of_file or number or written in ("zero", "geometric"):
        return written
    raise ValueError(
        'expected "zero", "geometric", a number or { file = "film.csv" }, '
        f"got {shown(written)}{_keys(written)}"
    )


def _keys(written: object) -> str:
    """Keys of a table that `shown` does not list."""
    return f" of {', '.join(written) or 'nothing'}" if isinstance(written, dict) else ""


def _number_or_file(written: object) -> object:
    """The number or file unchanged; one error in place of pydantic's two where it is neither."""
    if isinstance(written, FrictionTable):
        return written
    if isinstance(written, dict) and written.keys() == {"std", "length"}:
        for key, size in written.items():
            if isinstance(size, bool) or not isinstance(size, float | int) or not 0 < size < inf:
                raise ValueError(f"expected a number above 0 for {key}, got {shown(size)}")
        return written
    if (
        isinstance(written, dict)
        and written.keys() == {"file"}
        and isinstance(written["file"], str)
    ):
        return written
    if isinstance(written, bool) or not isinstance(written, float | int) or not isfinite(written):
        raise ValueError(
            'expected a number, { file = "mu.csv" } or { std = 0.1, length = 20 }, '
            f"got {shown(written)}{_keys(written)}"
        )
    if written < 0:
        raise ValueError(f"expected at least 0, got {written:g}")
    return written


def _state(written: object) -> float:
    """The number of a state, with one sentence where it is none."""
    if isinstance(written, str) and written in STATES:
        return STATES[written]
    if not isinstance(written, bool) and written in STATES.values():
        return float(written)  # type: ignore[arg-type]
    raise ValueError(f"expected 'stuck' or 'sliding', got {shown(written)}")


Gap = Annotated[Literal["zero", "geometric"] | float | GapTable, BeforeValidator(_gap)]
Factor = Annotated[Annotated[float, Field(ge=0)] | FrictionTable, BeforeValidator(_number_or_file)]


State = Annotated[
    float, BeforeValidator(_state), WithJsonSchema({"enum": list(STATES), "type": "string"})
]


class ContactTable(Table):
    """Two faces in contact."""

    name: Name | None = Field(default=None, description=CALLED)
    kind: Literal["sliding", "stuck", "frictionless"] | None = Field(
        default=None, description="what it does in plane; needed unless it has a state"
    )
    slave: str = Field(description="COMPONENT.SET that has the contact points")
    master: str = Field(description="COMPONENT.SET opposite")
    quadrature: Literal["clipped", "gauss"] = Field(default="clipped", description=CUTS)
    points: int = Field(default=3, ge=1, le=32, description="contact points a side of a facet")
    search: float = Field(gt=0, description="greatest distance of the faces, to either side")
    initial_gap: Gap = Field(
        default="zero", description="at rest: none, that of the meshes, a number, or measured"
    )
    gap_scale: float | None = Field(
        default=None, description="factor on an initial gap that is measured or of the meshes"
    )
    tangential: float | None = Field(
        default=None,
        ge=0,
        description="stiffness per area that holds a stuck contact in plane; one with a state in "
        "complex modes alone",
    )
    state: State | None = Field(
        default=None,
        description="of a bracket or pin, past which nothing slides steadily: stuck, or sliding; "
        "of parameters 1 or 0; in time it sticks and slips by itself",
    )
    sliding: Vector | None = Field(
        default=None,
        description="direction in which the master slips past the slave, and pulls it, of a "
        "contact with a state; its part in the contact plane",
    )
    friction: float | None = Field(
        default=None,
        ge=0,
        le=5,
        description="friction coefficient of a sliding contact in place of the parameter "
        "friction, or of one with a state",
    )
    friction_law: dict[str, float] = Field(
        default={},
        description="values that a sliding contact has of parameters of the study's friction law, "
        "by what follows friction_law. in their names, in the file's units",
    )
    friction_factor: Factor | None = Field(
        default=None,
        description="friction coefficient of a sliding contact over the parameter friction, a "
        "number or over the face; else 1; what has 0 does not wear",
    )
    friction_spread: float | None = Field(
        default=None,
        ge=0,
        description="factor on what friction factors over a face deviate from their mean over it, "
        "by area",
    )
    friction_seed: int | None = Field(
        default=None,
        ge=0,
        description="which of the random fields of friction factors it is; "
        "contacts of one seed differ",
    )

    @model_validator(mode="after")
    def _held(self) -> ContactTable:
        plain = self.initial_gap == "zero" or isinstance(self.initial_gap, float)
        if plain and self.gap_scale is not None:
            raise ValueError("gap_scale: expected of a gap that is measured or geometric alone")
        self._has_kind_or_state()
        if self.kind != "sliding" and self.state is None and self.friction is not None:
            raise ValueError("friction: expected of a sliding contact or one with a state alone")
        if self.kind != "sliding" and self.friction_law:
            raise ValueError("friction_law: expected of a sliding contact alone")
        if self.friction is not None and self.friction_factor is not None:
            raise ValueError("friction_factor: a contact with its own friction has no such key")
        if self.kind != "sliding" and self.friction_factor is not None:
            raise ValueError("friction_factor: expected of a sliding contact alone")
        if self.friction_spread is not None and not isinstance(self.friction_factor, FrictionTable):
            raise ValueError("friction_spread: expected of a friction_factor over the face alone")
        factor = self.friction_factor
        is_random = isinstance(factor, FrictionTable) and factor.std is not None
        if is_random != (self.friction_seed is not None):
            raise ValueError("expected friction_seed of a random friction_factor, and of no other")
        if self.state is None and (self.kind == "stuck") != (self.tangential is not None):
            raise ValueError("expected tangential = STIFFNESS of a stuck contact, and of no other")
        return self

    def _has_kind_or_state(self) -> None:
        if self.state is None and self.kind is None:
            raise ValueError("the key 'kind' is missing: sliding, stuck or frictionless")
        if self.state is None and self.sliding is not None:
            raise ValueError("sliding: expected of a contact with a state alone")
        if self.state is None:
            return
        if self.kind is not None:
            raise ValueError("state: expected of a contact without the key 'kind' alone")
        if self.friction is None:
            raise ValueError("the key 'friction' is missing: coefficient of a contact with a state")
        if self.sliding is None or not any(self.sliding):
            text = (
                "the key 'sliding' is missing: " if self.sliding is None else "sliding: expected "
            )
            raise ValueError(f"{text}the direction in which the master slips past the slave")


class TieTable(Table):
    """Two faces that move as one, by a layer that is far stiffer than what is beside it."""

    name: Name = Field(description=CALLED)
    slave: str = Field(description="COMPONENT.SET")
    master: str = Field(description="COMPONENT.SET opposite")
    bedding: float | None = Field(
        default=None,
        gt=0,
        description="stiffness per area, in all directions; else 1000 times that of the elements "
        "beside it",
    )
    search: float | None = Field(
        default=None, gt=0, description="greatest distance; else half the size of a facet"
    )


class CouplingTable(Table):
    """A node that turns, of a superelement, and a face of another component that it holds."""

    name: Name = Field(description=CALLED)
    node: str = Field(description="COMPONENT.SET of one node with turns")
    face: str = Field(description="COMPONENT.SET that moves with it")
    kind: Literal["distributing", "rigid"] = Field(
        default="distributing",
        description="the node has the mean motion of the face; or every place of the face moves "
        "with the node",
    )
    bedding: float | None = Field(
        default=None,
        gt=0,
        description="stiffness per area; else 1000 times that of the elements beside the face",
    )


class LayerTable(Table):
    """An elastic layer between two faces, or between a face and ground; it has no mass."""

    name: Name = Field(description=CALLED)
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    normal: float = Field(
        ge=0,
        description="stiffness per area, consistent: integrated over the faces' shape functions",
    )
    tangential: float = Field(ge=0, description="the same, in plane")
    in_static: bool = Field(default=True, description="false: it is there in vibration only")
    quadrature: Literal["clipped", "gauss"] = Field(default="clipped", description=CUTS)
    search: float | None = Field(
        default=None, gt=0, description="greatest distance; else half the size of a facet"
    )


class SpringTable(Table):
    """Springs between a set and ground, spread over it, or between the means of two sets."""

    name: Name = Field(description=CALLED)
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    axes: Literal["cartesian", "cylindrical"] = Field(
        default="cartesian", description="x, y, z; or radial, around and along the axis of rotation"
    )
    stiffness: Vector = Field(description="in all, in the three directions")
    rotary: Vector | None = Field(
        default=None,
        description="against turns about the three directions: mean ones of sets, those of a "
        "superelement's node that turns",
    )
    in_static: bool = Field(default=True, description="false: it is there in vibration only")


class PointMassTable(Table):
    """A mass on a set of a component."""

    name: Name = Field(description=CALLED)
    on: str = Field(description="COMPONENT.SET that it moves with")
    mass: float = Field(
        ge=0,
        description="in all; spread over a face it is consistent (integrated over the shape "
        "functions), over other nodes lumped, the same at each",
    )
    at: Vector | None = Field(
        default=None, description="where it is, by the mean motion of the set; else spread over it"
    )
    inertia: Vector | None = Field(
        default=None,
        description="moments of inertia about global axes through it, at the mean turn of the set",
    )


class FixedTable(Table):
    """Degrees of freedom that are held."""

    set: str = Field(description="COMPONENT.SET")
    dofs: Annotated[tuple[Literal[1, 2, 3, 4, 5, 6], ...], Strict(False)] = Field(
        default=(1, 2, 3), description="directions; 4 to 6 are turns of a superelement's nodes"
    )


class LoadTable(Table):
    """The forces of a unit brake pressure."""

    name: Name | None = Field(default=None, description=CALLED)
    pressure_on: str = Field(description="COMPONENT.SET that the pressure pushes inwards")
    reaction_on: str | None = Field(default=None, description="COMPONENT.SET that is pushed back")
    reaction: Literal["spread", "opposite"] = Field(
        default="spread",
        description="over its face, or at the places opposite to those of the pressure",
    )
    area: float | None = Field(
        default=None, gt=0, description="hydraulic area; else that of the face under pressure"
    )


class StressTable(Table):
    """The steady sliding whose stresses count as stiffness."""

    pressure: float = Field(gt=0, description="brake pressure")
    friction: float = Field(ge=0, description="friction coefficient, the rotor turning forward")


class WearTable(Table):
    """Sliding that has worn the faces of sliding contacts."""

    pressure: float = Field(gt=0, description="brake pressure while they wore")
    friction: float = Field(ge=0, description="friction coefficient while they wore")
    distance: float = Field(ge=0, description="of sliding, at the place of sliding_speed")
    rate: float = Field(
        gt=0, description="depth over pressure and distance: Archard's coefficient over hardness"
    )


class ParameterTable(Table):
    """A number of the file, or of the operating point, that studies may vary."""

    path: str | Texts = Field(
        default=(), description="where it is, 'pad.materials.LINING.E[3]'; several for one value"
    )
    default: float | str | None = Field(
        default=None, description="a number, or one with its unit; else the file's value"
    )
    unit: str | None = Field(default=None, description="of a bare default; else the file's units")
    description: str = Field(default="", description="what tables and screens say of it")

    @property
    def paths(self) -> tuple[str, ...]:
        """All places that have its value."""
        return (self.path,) if isinstance(self.path, str) else self.path
