"""The tables of a model file besides those of components: their keys and allowed values."""

from __future__ import annotations

from math import inf, isfinite
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, Strict, WithJsonSchema, model_validator

from squealstudy.laws.own_friction import STATES
from squealstudy.models.file_table import Name, Table, Texts, Vector
from squealstudy.wording import shown

Pair = Annotated[tuple[str, str], Strict(False)]
CALLED = "name in errors, tables and paths of parameters"
CUTS = "clipped: points in overlaps of slave and master facets; gauss: in the slave's facets"


class RotationTable(Table):
    """The axis about which the rotor turns, by the right-hand rule."""

    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")
    axis: Vector = Field(description="direction of the axis; the rotor turns about it")
    rotor: str | None = Field(
        default=None, description="the component that turns; else the masters of sliding contacts"
    )
    angle: float = Field(
        default=0.0,
        description="angle by which the rotor is turned from its mesh, by the right-hand rule, "
        "deg; contact is searched in this position",
    )
    uniform: bool = Field(
        default=False,
        description="true: all points slide at sliding_speed; false: the rotor turns, and points "
        "at the effective radius slide at sliding_speed",
    )
    effective_radius: float | None = Field(
        default=None,
        gt=0,
        description="radius of sliding_speed; default: mean radius of the sliding faces, by area",
    )


class GapTable(Table):
    """Measured gaps of a face."""

    file: str = Field(
        description="file with a line of names, x, y, gap (or with z), and a line for each place, "
        "in the unit and the coordinates of the slave's file"
    )


class FrictionTable(Table):
    """Friction factors over a face: from a file, or a random field of mean 1."""

    file: str | None = Field(
        default=None,
        description="file with a line of names, x, y, factor (or with z), and a line for each "
        "place, in the unit and the coordinates of the slave's file; factors are at least 0, and "
        "linear between places",
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
    """The gap unchanged; one error, in place of pydantic's two, where it is not valid."""
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
    """The friction factor unchanged; one error, in place of pydantic's two, where not valid."""
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
    """The number of a state; one error where it is not valid."""
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
        default=None, description="behaviour in its plane; needed unless it has a state"
    )
    slave: str = Field(description="COMPONENT.SET that has the contact points")
    master: str = Field(description="COMPONENT.SET opposite")
    quadrature: Literal["clipped", "gauss"] = Field(default="clipped", description=CUTS)
    points: int = Field(default=3, ge=1, le=32, description="contact points along a facet's side")
    search: float = Field(
        gt=0, description="largest distance of the faces at which points are found, to either side"
    )
    initial_gap: Gap = Field(
        default="zero",
        description='gap at rest: "zero", "geometric" (that of the meshes), a number, or a file',
    )
    gap_scale: float | None = Field(
        default=None, description="factor on an initial gap from a file or of the meshes"
    )
    tangential: float | None = Field(
        default=None,
        ge=0,
        description="tangential stiffness per area of a stuck contact; for a contact with a state "
        "in complex modes only",
    )
    state: State | None = Field(
        default=None,
        description="for a contact without steady sliding, as of a bracket or pin: stuck or "
        "sliding (as a parameter 1 or 0); in time it sticks and slips by itself",
    )
    sliding: Vector | None = Field(
        default=None,
        description="for a contact with a state: direction in which the master slips past the "
        "slave and pulls it; its component in the contact plane counts",
    )
    friction: float | None = Field(
        default=None,
        ge=0,
        le=5,
        description="friction coefficient of a sliding contact in place of the parameter "
        "friction; needed for a contact with a state",
    )
    friction_law: dict[str, float] = Field(
        default={},
        description="values of parameters of the study's friction law for a sliding contact, in "
        "the file's units; keys are their names without friction_law.",
    )
    friction_factor: Factor | None = Field(
        default=None,
        description="factor of a sliding contact on the parameter friction: a number, or values "
        "over the face; default 1; points with 0 do not wear",
    )
    friction_spread: float | None = Field(
        default=None,
        ge=0,
        description="factor on the deviation of friction factors over a face from their mean",
    )
    friction_seed: int | None = Field(
        default=None,
        ge=0,
        description="seed of the random field of friction factors; contacts with the same seed "
        "have different fields",
    )

    @model_validator(mode="after")
    def _held(self) -> ContactTable:
        plain = self.initial_gap == "zero" or isinstance(self.initial_gap, float)
        if plain and self.gap_scale is not None:
            raise ValueError("gap_scale: expected only with a measured or geometric gap")
        self._has_kind_or_state()
        if self.kind != "sliding" and self.state is None and self.friction is not None:
            raise ValueError("friction: expected only of a sliding contact or one with a state")
        if self.kind != "sliding" and self.friction_law:
            raise ValueError("friction_law: expected only of a sliding contact")
        if self.friction is not None and self.friction_factor is not None:
            raise ValueError("friction_factor: a contact with its own friction has no such key")
        if self.kind != "sliding" and self.friction_factor is not None:
            raise ValueError("friction_factor: expected only of a sliding contact")
        if self.friction_spread is not None and not isinstance(self.friction_factor, FrictionTable):
            raise ValueError("friction_spread: expected only with a friction_factor over the face")
        factor = self.friction_factor
        is_random = isinstance(factor, FrictionTable) and factor.std is not None
        if is_random != (self.friction_seed is not None):
            raise ValueError("expected friction_seed with a random friction_factor, and no other")
        if self.state is None and (self.kind == "stuck") != (self.tangential is not None):
            raise ValueError("expected tangential = STIFFNESS of a stuck contact, and of no other")
        return self

    def _has_kind_or_state(self) -> None:
        if self.state is None and self.kind is None:
            raise ValueError("the key 'kind' is missing: sliding, stuck or frictionless")
        if self.state is None and self.sliding is not None:
            raise ValueError("sliding: expected only of a contact with a state")
        if self.state is None:
            return
        if self.kind is not None:
            raise ValueError("state: expected only of a contact without the key 'kind'")
        if self.friction is None:
            raise ValueError("the key 'friction' is missing: coefficient of a contact with a state")
        if self.sliding is None or not any(self.sliding):
            text = (
                "the key 'sliding' is missing: " if self.sliding is None else "sliding: expected "
            )
            raise ValueError(f"{text}the direction in which the master slips past the slave")


class TieTable(Table):
    """Two faces that move as one, by a layer far stiffer than the elements beside it."""

    name: Name = Field(description=CALLED)
    slave: str = Field(description="COMPONENT.SET")
    master: str = Field(description="COMPONENT.SET opposite")
    bedding: float | None = Field(
        default=None,
        gt=0,
        description="stiffness per area, in all directions; default: 1000 times that of the "
        "elements beside it",
    )
    search: float | None = Field(
        default=None, gt=0, description="largest distance; default: half the size of a facet"
    )


class CouplingTable(Table):
    """A node with rotations, of a superelement, that holds a face of another component."""

    name: Name = Field(description=CALLED)
    node: str = Field(description="COMPONENT.SET of one node with rotations")
    face: str = Field(description="COMPONENT.SET that moves with it")
    kind: Literal["distributing", "rigid"] = Field(
        default="distributing",
        description="distributing: the node has the mean motion of the face; rigid: every point of "
        "the face moves with the node",
    )
    bedding: float | None = Field(
        default=None,
        gt=0,
        description="stiffness per area; default: 1000 times that of the elements beside the face",
    )


class LayerTable(Table):
    """An elastic layer between two faces, or between a face and ground; it has no mass."""

    name: Name = Field(description=CALLED)
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    normal: float = Field(
        ge=0,
        description="stiffness per area, consistent: integrated over the faces' shape functions",
    )
    tangential: float = Field(ge=0, description="the same in the plane of the faces")
    in_static: bool = Field(default=True, description="false: it acts in vibration only")
    quadrature: Literal["clipped", "gauss"] = Field(default="clipped", description=CUTS)
    search: float | None = Field(
        default=None, gt=0, description="largest distance; default: half the size of a facet"
    )


class SpringTable(Table):
    """Springs between a set and ground, spread over it, or between the means of two sets."""

    name: Name = Field(description=CALLED)
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    axes: Literal["cartesian", "cylindrical"] = Field(
        default="cartesian",
        description="directions: x, y, z; or radial, tangential and axial about the axis of "
        "rotation",
    )
    stiffness: Vector = Field(description="total stiffness in each of the three directions")
    rotary: Vector | None = Field(
        default=None,
        description="stiffness against rotation about the three directions: the mean rotation of a "
        "set, or that of a superelement's node with rotations",
    )
    in_static: bool = Field(default=True, description="false: it acts in vibration only")


class PointMassTable(Table):
    """A mass on a set of a component."""

    name: Name = Field(description=CALLED)
    on: str = Field(description="COMPONENT.SET that it moves with")
    mass: float = Field(
        ge=0,
        description="total mass; over a face it is consistent (integrated over the shape "
        "functions), over other nodes lumped, equal at each",
    )
    at: Vector | None = Field(
        default=None,
        description="position of the mass, which follows the mean motion of the set; default: the "
        "mass is spread over the set",
    )
    inertia: Vector | None = Field(
        default=None,
        description="moments of inertia about global axes through the mass, which follow the mean "
        "rotation of the set",
    )


class FixedTable(Table):
    """Degrees of freedom that are fixed."""

    set: str = Field(description="COMPONENT.SET")
    dofs: Annotated[tuple[Literal[1, 2, 3, 4, 5, 6], ...], Strict(False)] = Field(
        default=(1, 2, 3), description="directions; 4 to 6 are rotations of a superelement's nodes"
    )


class LoadTable(Table):
    """The forces of a unit brake pressure."""

    name: Name | None = Field(default=None, description=CALLED)
    pressure_on: str = Field(description="COMPONENT.SET that the pressure pushes inwards")
    reaction_on: str | None = Field(default=None, description="COMPONENT.SET that is pushed back")
    reaction: Literal["spread", "opposite"] = Field(
        default="spread",
        description="spread over its face, or at points opposite to those of the pressure",
    )
    area: float | None = Field(
        default=None, gt=0, description="hydraulic area; default: that of the face under pressure"
    )


class StressTable(Table):
    """The steady sliding whose stresses stiffen the components."""

    pressure: float = Field(gt=0, description="brake pressure")
    friction: float = Field(ge=0, description="friction coefficient; the rotor turns forward")


class WearTable(Table):
    """The sliding that has worn the faces of sliding contacts."""

    pressure: float = Field(gt=0, description="brake pressure during wear")
    friction: float = Field(ge=0, description="friction coefficient during wear")
    distance: float = Field(ge=0, description="distance of sliding at the radius of sliding_speed")
    rate: float = Field(
        gt=0, description="depth over pressure and distance: Archard's coefficient over hardness"
    )


class ParameterTable(Table):
    """A number of the file, or of the operating point, that studies may vary."""

    path: str | Texts = Field(
        default=(),
        description="path of its number, 'pad.materials.LINING.E[3]'; several have the same value",
    )
    default: float | str | None = Field(
        default=None, description="a number, or one with its unit; default: the file's value"
    )
    unit: str | None = Field(
        default=None, description="unit of a bare default; default: the file's units"
    )
    description: str = Field(default="", description="text in tables and on screens")

    @property
    def paths(self) -> tuple[str, ...]:
        """Paths of all numbers that have its value."""
        return (self.path,) if isinstance(self.path, str) else self.path
