"""What a model file may say: components from meshes and matrices, and what is between them.

Numbers are in the units that the file states; `Numbers` gives them in SI, with other values of
those that parameters point to.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Strict, model_validator

from squealstudy.errors import ModelError
from squealstudy.models.components.dimensions import (
    AREA,
    BEDDING,
    DENSITY,
    LENGTH,
    MASS,
    NUMBER,
    STIFFNESS,
    STRESS,
    Dimension,
)
from squealstudy.models.components.formulations import MassRule

KeyPath = tuple[str | int, ...]  # keys of the file, and 0-based positions in lists
GROUND = "ground"
STEP = re.compile(r"(?P<name>[^\[\]]+)(?:\[(?P<number>[1-9][0-9]*)\])?")
LISTS = ("contact", "layer", "spring", "point_mass", "load")  # tables [[...]] that have a name

DIMENSIONS = {  # of the keys of the file
    "E": STRESS,
    "G": STRESS,
    "nu": NUMBER,
    "rho": DENSITY,
    "normal": BEDDING,
    "tangential": BEDDING,
    "stiffness": STIFFNESS,
    "mass": MASS,
    "area": AREA,
    "search": LENGTH,
    "initial_gap": LENGTH,
    "effective_radius": LENGTH,
    "translate": LENGTH,
}
POSITIVE = ("E", "G", "rho", "area")
VARIED = {  # keys that parameters may point to
    "contact": ("tangential", "initial_gap"),
    "layer": ("normal", "tangential"),
    "spring": ("stiffness",),
    "point_mass": ("mass",),
    "load": ("area",),
}
MATERIAL = ("E", "nu", "G", "rho")


class PlacedError(ModelError):
    """What is wrong at a key of the model file.

    `word` is the one at fault and `known` are those that there are, for a proposal.
    """

    def __init__(
        self, keys: KeyPath, message: str, word: str = "", known: tuple[str, ...] = ()
    ) -> None:
        self.keys, self.message, self.word, self.known = keys, message, word, known
        super().__init__(message)


class Table(BaseModel):
    """A table of the file: unknown keys are errors, and nothing is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Vector = Annotated[tuple[float, float, float], Strict(False)]
Texts = Annotated[tuple[str, ...], Strict(False)]
Pair = Annotated[tuple[str, str], Strict(False)]
Moduli = float | Vector
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


class RotationTable(Table):
    """The axis about which the rotor turns, by the right hand."""

    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")
    axis: Vector = Field(description="direction of the axis; the rotor turns about it")
    rotor: str | None = Field(
        default=None, description="the component that turns; else the masters of sliding contacts"
    )
    uniform: bool = Field(
        default=False,
        description="all points slide at sliding_speed; else the rotor turns, and sliding_speed is "
        "that at the effective radius",
    )
    effective_radius: float | None = Field(
        default=None, gt=0, description="else the mean radius of the sliding faces, by area"
    )


class TurnTable(Table):
    """A turn of a component, by the right hand."""

    axis: Vector = Field(description="direction of the axis")
    angle: float = Field(description="deg")
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the axis")


class MaterialTable(Table):
    """A material: isotropic, or orthotropic with three of each modulus."""

    E: Moduli = Field(description="Young's modulus, or [E1, E2, E3]")
    nu: Moduli = Field(description="Poisson's ratio, or [nu12, nu13, nu23]")
    G: Vector | None = Field(default=None, description="[G12, G13, G23] of an orthotropic one")
    rho: float = Field(gt=0, description="density")
    elements: str | None = Field(
        default=None,
        description="element set that has it; else the elements that have a material of this name "
        "in the mesh, or the element set of this name, or all",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> MaterialTable:
        three = [isinstance(v, tuple) for v in (self.E, self.nu, self.G)]
        if len(set(three)) > 1:
            raise ValueError(
                "expected E, nu and no G (isotropic), or three numbers each of E, nu and G"
            )
        return self


class MatrixTable(Table):
    """One of several matrices of a file."""

    file: str = Field(description="file of the matrix")
    name: str = Field(description="which: a variable, or the name of a DMIG matrix")


class ComponentTable(Table):
    """A component: a mesh with materials, or matrices with a mesh that names their nodes."""

    mesh: str | None = Field(default=None, description="file .inp or .msh")
    part: str | None = Field(default=None, description="instance or element set of the mesh's file")
    dialect: Literal["abaqus", "calculix"] | None = Field(
        default=None, description="whose C3D8 an .inp means"
    )
    treat_as: dict[str, str] = Field(default={}, description="elements to be read as others")
    pass_over: Texts = Field(default=(), description="keywords of an .inp to pass over")
    mass: MassRule = Field(default="full", description="integration of the mass")
    materials: dict[str, MaterialTable] = Field(default={}, description="by name")
    K: str | MatrixTable | None = Field(default=None, description="file of the stiffness matrix")
    M: str | MatrixTable | None = Field(default=None, description="file of the mass matrix")
    dof: str | None = Field(
        default=None,
        description="file with 'node.direction' of each row of the matrices, or .mapping of ANSYS",
    )
    nodes: str | None = Field(
        default=None, description="mesh with coordinates and faces of the matrices' nodes"
    )
    translate: Vector = Field(default=(0.0, 0.0, 0.0), description="shift, after the turn")
    rotate: TurnTable | None = Field(default=None, description="turn")

    @model_validator(mode="after")
    def _one_source(self) -> ComponentTable:
        matrices = [k for k in ("K", "M", "dof", "nodes") if getattr(self, k) is not None]
        if self.mesh is not None and matrices:
            raise ValueError(f"expected mesh, or K, M and nodes; got mesh and {matrices[0]}")
        if self.mesh is None and not {"K", "M", "nodes"} <= set(matrices):
            raise ValueError("expected mesh = FILE, or K, M and nodes (a mesh with coordinates)")
        if self.mesh is None and self.materials:
            raise ValueError("expected no materials: the matrices hold them")
        return self

    def file_of(self, key: str) -> str | None:
        """The file that a key names."""
        given = getattr(self, key)
        return given.file if isinstance(given, MatrixTable) else given

    def name_of(self, key: str) -> str | None:
        """Which matrix of its file."""
        given = getattr(self, key)
        return given.name if isinstance(given, MatrixTable) else None


class ContactTable(Table):
    """Two faces in contact."""

    name: Name | None = None
    kind: Literal["sliding", "stuck", "frictionless"] = Field(description="what it does in plane")
    slave: str = Field(description="COMPONENT.SET that has the contact points")
    master: str = Field(description="COMPONENT.SET opposite")
    quadrature: Literal["clipped", "gauss"] = "clipped"
    points: int = Field(default=3, ge=1, le=32, description="contact points a side of a facet")
    search: float = Field(gt=0, description="greatest distance of the faces, to either side")
    initial_gap: Literal["zero", "geometric"] | float = "zero"
    tangential: float | None = Field(
        default=None, ge=0, description="stiffness per area that holds a stuck contact in plane"
    )

    @model_validator(mode="after")
    def _held(self) -> ContactTable:
        if (self.kind == "stuck") != (self.tangential is not None):
            raise ValueError("expected tangential = STIFFNESS of a stuck contact, and of no other")
        return self


class LayerTable(Table):
    """An elastic layer between two faces, or between a face and ground."""

    name: Name
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    normal: float = Field(ge=0, description="stiffness per area")
    tangential: float = Field(ge=0, description="stiffness per area, in plane")
    in_static: bool = Field(default=True, description="false: it is there in vibration only")
    quadrature: Literal["clipped", "gauss"] = "clipped"
    search: float | None = Field(
        default=None, gt=0, description="greatest distance; else half the size of a facet"
    )


class SpringTable(Table):
    """Springs between a set and ground, spread over it, or between the means of two sets."""

    name: Name
    between: Pair = Field(description='two of COMPONENT.SET, or one and "ground"')
    axes: Literal["cartesian", "cylindrical"] = Field(
        default="cartesian", description="x, y, z; or radial, around and along the axis of rotation"
    )
    stiffness: Vector = Field(description="in all, in the three directions")
    in_static: bool = Field(default=True, description="false: it is there in vibration only")


class PointMassTable(Table):
    """A mass on a set of a component."""

    name: Name
    on: str = Field(description="COMPONENT.SET that it moves with")
    mass: float = Field(ge=0, description="in all")
    at: Vector | None = Field(
        default=None, description="where it is, by the mean motion of the set; else spread over it"
    )


class FixedTable(Table):
    """Degrees of freedom that are held."""

    set: str = Field(description="COMPONENT.SET")
    dofs: Annotated[tuple[Literal[1, 2, 3], ...], Strict(False)] = (1, 2, 3)


class LoadTable(Table):
    """The forces of a unit brake pressure."""

    name: Name = "brake"
    pressure_on: str = Field(description="COMPONENT.SET that the pressure pushes inwards")
    reaction_on: str | None = Field(default=None, description="COMPONENT.SET that is pushed back")
    reaction: Literal["spread", "opposite"] = Field(
        default="spread",
        description="over its face, or at the places opposite to those of the pressure",
    )
    area: float = Field(gt=0, description="hydraulic area")


class StressTable(Table):
    """The steady sliding whose stresses count as stiffness."""

    pressure: float = Field(gt=0, description="brake pressure")
    friction: float = Field(ge=0, description="friction coefficient, the rotor turning forward")


class ParameterTable(Table):
    """A number of the file, or of the operating point, that studies may vary."""

    path: str | Texts = Field(
        default=(), description="where it is, 'pad.materials.LINING.E[3]'; several for one value"
    )
    default: float | str | None = Field(
        default=None, description="a number, or one with its unit; else the file's value"
    )
    unit: str | None = Field(default=None, description="of a bare default; else the file's units")
    description: str = ""

    @property
    def paths(self) -> tuple[str, ...]:
        """All places that have its value."""
        return (self.path,) if isinstance(self.path, str) else self.path


class ModelFile(Table):
    """A whole model file."""

    description: str = ""
    units: Literal["SI", "t-mm-s", "mm-kg-ms"] = Field(description="of all numbers of its files")
    rotation: RotationTable | None = Field(default=None, description="of the rotor")
    components: dict[Name, ComponentTable] = Field(min_length=1, description="by name")
    contact: Annotated[tuple[ContactTable, ...], Strict(False)] = Field(
        min_length=1, description="faces in contact"
    )
    layer: Annotated[tuple[LayerTable, ...], Strict(False)] = ()
    spring: Annotated[tuple[SpringTable, ...], Strict(False)] = ()
    point_mass: Annotated[tuple[PointMassTable, ...], Strict(False)] = ()
    fixed: Annotated[tuple[FixedTable, ...], Strict(False)] = ()
    load: Annotated[tuple[LoadTable, ...], Strict(False)] = ()
    stress_stiffening: StressTable | None = Field(
        default=None,
        description="its stresses stiffen what vibrates; else none do",
    )
    parameters: dict[str, ParameterTable] = {}

    def at(self, keys: KeyPath) -> Any:
        """The value at a key of the file; None where it is not written there."""
        found: Any = self
        for key in keys:
            if isinstance(found, BaseModel):
                found = getattr(found, str(key), None)
            elif isinstance(found, dict):
                found = found.get(key)
            else:
                found = found[key] if isinstance(found, tuple) and isinstance(key, int) else None
        return found

    def name_of(self, kind: str, number: int) -> str:
        """Name of a contact, layer, spring or load."""
        table = self.at((kind, number))
        return table.name or f"{kind}_{number + 1}"

    def located(self, path: str) -> KeyPath:
        """The key that a path of a parameter means.

        Raises
        ------
        ModelError
            No such path, or one to a number that cannot vary.
        """
        steps = [STEP.fullmatch(part) for part in path.removeprefix("components.").split(".")]
        if any(step is None or (step["number"] and step is not steps[-1]) for step in steps):
            raise ModelError(f"'{path}': expected names with dots between, E[3] at the end")
        names = [step["name"] for step in steps if step]
        last = steps[-1]
        index: KeyPath = (int(last["number"]) - 1,) if last and last["number"] else ()
        if names[0] in self.components:
            if len(names) != 4 or names[1] != "materials" or names[3] not in MATERIAL:
                raise ModelError(
                    f"'{path}': expected {names[0]}.materials.NAME with {', '.join(MATERIAL)}"
                )
            return self._checked(path, ("components", *names), index)
        if names[0] not in LISTS:
            known = ", ".join((*self.components, *LISTS))
            raise ModelError(f"'{path}': expected to begin with one of {known}")
        there = [self.name_of(names[0], i) for i in range(len(self.at((names[0],))))]
        if len(names) != 3 or names[1] not in there or names[2] not in VARIED[names[0]]:
            keys = " or ".join(VARIED[names[0]])
            listed = ", ".join(there) or "none"
            raise ModelError(
                f"'{path}': expected {names[0]}.NAME.{keys}, where NAME is one of {listed}"
            )
        return self._checked(path, (names[0], there.index(names[1]), names[2]), index)

    def _checked(self, path: str, keys: KeyPath, index: KeyPath) -> KeyPath:
        """The key with its index, where that fits to what is written there."""
        value = self.at(keys)
        if value is None and keys[0] == "components":  # a material of the mesh's file
            return (*keys, *index)
        if isinstance(value, str) or value is None:
            raise ModelError(f"'{path}' is no number in the file")
        if isinstance(value, tuple) != bool(index) or (index and int(index[0]) >= len(value)):
            what = f"a list of {len(value)}" if isinstance(value, tuple) else "one number"
            raise ModelError(f"'{path}': it is {what}; lists count from 1")
        return (*keys, *index)


def dimension_of(keys: KeyPath) -> Dimension:
    """Of the number at a key."""
    return DIMENSIONS[next(k for k in reversed(keys) if isinstance(k, str))]


@dataclass(frozen=True)
class Numbers:
    """Numbers of a file in SI; those in `given`, by key, have other values."""

    file: ModelFile
    given: Mapping[KeyPath, float]

    def at(self, *keys: str | int) -> float:
        """A number, SI units."""
        if keys in self.given:
            return self.given[keys]
        return float(self.file.at(keys)) * dimension_of(keys).factor(self.file.units)

    def list_at(self, *keys: str | int) -> tuple[float, ...]:
        """All numbers of a list."""
        return tuple(self.at(*keys, i) for i in range(len(self.file.at(keys))))
