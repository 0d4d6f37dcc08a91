"""A model file: its tables, paths of parameters into it, and its numbers.

Numbers are in the units that the file states. `Numbers` returns them in SI units, with the values
of parameters in place of those that they point to.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, Strict

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.dimensions import (
    ANGLE,
    AREA,
    BEDDING,
    COMPLIANCE,
    DENSITY,
    EXPANSION,
    INERTIA,
    LENGTH,
    MASS,
    NUMBER,
    RATE,
    STIFFNESS,
    STRESS,
    TIME,
    TORSION,
    Dimension,
    dimension_of_unit,
)
from squealstudy.models.components.file_tables import (
    ContactTable,
    CouplingTable,
    FixedTable,
    LayerTable,
    LoadTable,
    ParameterTable,
    PointMassTable,
    RotationTable,
    SpringTable,
    StressTable,
    TieTable,
    WearTable,
)
from squealstudy.models.file_table import KeyPath, Name, Table
from squealstudy.models.own_law import OF_CONTACT, law_parameter_named

GROUND = "ground"
FIRST_LOAD = "brake"  # its name where the file gives none
STEP = re.compile(r"(?P<name>[^\[\]]+)(?:\[(?P<number>[1-9][0-9]*)\])?")
LISTS = (
    "contact",
    "tie",
    "coupling",
    "layer",
    "spring",
    "point_mass",
    "load",
)  # [[...]] with names

TEMPERATURE = "temperature"  # key of a component: temperature at which its materials are taken

DIMENSIONS = {  # by key of the file
    "E": STRESS,
    "G": STRESS,
    "nu": NUMBER,
    "rho": DENSITY,
    "normal": BEDDING,
    "tangential": BEDDING,
    "bedding": BEDDING,
    "stiffness": STIFFNESS,
    "rotary": TORSION,
    "mass": MASS,
    "inertia": INERTIA,
    "area": AREA,
    "search": LENGTH,
    "initial_gap": LENGTH,
    "friction": NUMBER,
    "friction_factor": NUMBER,
    "friction_spread": NUMBER,
    "friction_seed": NUMBER,
    "state": NUMBER,
    "gap_scale": NUMBER,
    "distance": LENGTH,
    "rate": COMPLIANCE,
    "effective_radius": LENGTH,
    "angle": ANGLE,
    "translate": LENGTH,
    "mass_damping": RATE,
    "stiffness_damping": TIME,
    "material_damping": TIME,
    "thermal_expansion": EXPANSION,
    "scale": NUMBER,
    TEMPERATURE: NUMBER,  # in the scale of the deck
}
POSITIVE = ("E", "G", "rho", "area", "bedding", "rate")
NOT_NEGATIVE = (
    *("normal", "tangential", "stiffness", "rotary", "mass", "inertia"),
    *("mass_damping", "stiffness_damping", "material_damping", "distance"),
    *("friction", "friction_factor", "friction_spread", "friction_seed", "state"),
)
VARIED = {  # keys that parameters may point to
    "contact": (
        *("tangential", "initial_gap", "gap_scale"),
        *("friction", "friction_factor", "friction_spread", "friction_seed", "state"),
    ),
    "tie": ("bedding",),
    "coupling": ("bedding",),
    "layer": ("normal", "tangential"),
    "spring": ("stiffness", "rotary"),
    "point_mass": ("mass", "inertia"),
    "load": ("area",),
}
WEAR = "wear"
ROTOR_ANGLE: KeyPath = ("rotation", "angle")
WORN = ("distance", "rate")  # keys of [wear] that parameters may point to
HEAT = ("heat", "scale")  # path in a component that parameters may point to
THERMAL = "thermal_expansion"
MATERIAL = ("E", "nu", "G", "rho", THERMAL)
DAMPING = ("mass_damping", "stiffness_damping")  # of a component
BY_MATERIAL = "material_damping"


class ValuesError(ModelError):
    """Values of parameters that are impossible.

    Attributes
    ----------
    keys : tuple of key paths
        The numbers of the model file that have these values.
    message : str
    """

    def __init__(self, keys: tuple[KeyPath, ...], message: str) -> None:
        self.keys, self.message = keys, message
        super().__init__(message)


class ModelFile(Table):
    """A whole model file."""

    description: str = Field(default="", description="free text")
    units: Literal["SI", "t-mm-s", "mm-kg-ms"] = Field(
        description="SI, t-mm-s or mm-kg-ms, of all numbers of its files"
    )
    rotation: RotationTable | None = Field(default=None, description="of the rotor")
    components: dict[Name, ComponentTable] = Field(min_length=1, description="by name")
    contact: Annotated[tuple[ContactTable, ...], Strict(False)] = Field(
        default=(), description="faces in contact"
    )
    tie: Annotated[tuple[TieTable, ...], Strict(False)] = Field(
        default=(), description="faces of two components that move as one"
    )
    coupling: Annotated[tuple[CouplingTable, ...], Strict(False)] = Field(
        default=(), description="nodes that turn, of superelements, on faces of other components"
    )
    layer: Annotated[tuple[LayerTable, ...], Strict(False)] = Field(
        default=(), description="elastic layers between faces"
    )
    spring: Annotated[tuple[SpringTable, ...], Strict(False)] = Field(
        default=(), description="springs between sets, or to ground"
    )
    point_mass: Annotated[tuple[PointMassTable, ...], Strict(False)] = Field(
        default=(), description="masses on sets"
    )
    fixed: Annotated[tuple[FixedTable, ...], Strict(False)] = Field(
        default=(), description="what is held"
    )
    load: Annotated[tuple[LoadTable, ...], Strict(False)] = Field(
        default=(), description="forces of a unit brake pressure; at least one"
    )
    stress_stiffening: StressTable | None = Field(
        default=None,
        description="its stresses stiffen what vibrates; else none do",
    )
    wear: WearTable | None = Field(default=None, description="of the faces; else they are new")
    parameters: dict[str, ParameterTable] = Field(
        default={}, description="numbers that studies may vary, by name"
    )

    def at(self, keys: KeyPath) -> Any:
        """The value or table at a key path; None where the file has none."""
        entry: Any = self
        for key in keys:
            if isinstance(entry, BaseModel):
                entry = getattr(entry, str(key), None)
            elif isinstance(entry, dict):
                entry = entry.get(key)
            else:
                entry = entry[key] if isinstance(entry, tuple) and isinstance(key, int) else None
        return entry

    def name_of(self, kind: str, number: int) -> str:
        """Name of a contact, tie, coupling, layer, spring, mass or load."""
        table = self.at((kind, number))
        if kind == "load" and not number:
            return table.name or FIRST_LOAD
        return table.name or f"{kind}_{number + 1}"

    def sides(self, number: int) -> tuple[str, str]:
        """Components of the slave and of the master of a contact."""
        table = self.contact[number]
        return table.slave.partition(".")[0], table.master.partition(".")[0]

    @property
    def rotor(self) -> str | None:
        """The component that turns, if the file names it; else None."""
        return None if self.rotation is None else self.rotation.rotor

    @property
    def turning(self) -> tuple[str, ...]:
        """Components that turn: the one that the file names, else masters of sliding contacts."""
        if self.rotation is None:
            return ()
        if self.rotor is not None:
            return (self.rotor,)
        sliding = (i for i, table in enumerate(self.contact) if table.kind == "sliding")
        return tuple(dict.fromkeys(self.sides(i)[1] for i in sliding))

    def located(self, path: str) -> KeyPath:
        """The key path of a number that a parameter points to, "pad.materials.LINING.E[3]".

        Raises
        ------
        ModelError
            There is no such number, or parameters cannot point to it.
        """
        steps = [STEP.fullmatch(part) for part in path.removeprefix("components.").split(".")]
        if any(step is None or (step["number"] and step is not steps[-1]) for step in steps):
            raise ModelError(f"'{path}': expected names with dots between, E[3] at the end")
        names = [step["name"] for step in steps if step]
        last = steps[-1]
        index: KeyPath = (int(last["number"]) - 1,) if last and last["number"] else ()
        if names[0] in self.components:
            single = (*DAMPING, TEMPERATURE)
            if tuple(names[1:]) == HEAT and self.components[names[0]].heat is not None:
                return ("components", *names)
            if names[1:] in ([d] for d in single) or names[1:-1] == [BY_MATERIAL]:
                return self._checked(path, ("components", *names), index)
            if len(names) != 4 or names[1] != "materials" or names[3] not in MATERIAL:
                raise ModelError(
                    f"'{path}': expected {names[0]}.materials.NAME with {', '.join(MATERIAL)}, or "
                    f"{names[0]} with {', '.join(single)}, {'.'.join(HEAT)} or "
                    f"{BY_MATERIAL}.NAME"
                )
            return self._checked(path, ("components", *names), index)
        if names[0] == WEAR:
            if len(names) != 2 or names[1] not in WORN or self.wear is None:
                expected = " or ".join(f"{WEAR}.{key}" for key in WORN)
                absent = "" if self.wear else ", and a table [wear]"
                raise ModelError(f"'{path}': expected {expected}{absent}")
            return (WEAR, names[1])
        if names[0] == ROTOR_ANGLE[0]:
            if tuple(names) != ROTOR_ANGLE or not self.turning:
                absent = "" if self.turning else ", and a table [rotation] of what turns"
                raise ModelError(f"'{path}': expected {'.'.join(map(str, ROTOR_ANGLE))}{absent}")
            return ROTOR_ANGLE
        if names[0] not in LISTS:
            beginnings = ", ".join((*self.components, *LISTS, WEAR, str(ROTOR_ANGLE[0])))
            raise ModelError(f"'{path}': expected to begin with one of {beginnings}")
        table_names = [self.name_of(names[0], i) for i in range(len(self.at((names[0],))))]
        if (
            names[0] == "contact"
            and names[1:2]
            and names[1] in table_names
            and names[2:3] == [OF_CONTACT]
        ):
            return self._of_law(path, table_names.index(names[1]), names[3:])
        if len(names) != 3 or names[1] not in table_names or names[2] not in VARIED[names[0]]:
            keys = " or ".join(VARIED[names[0]])
            listed = ", ".join(table_names) or "none"
            raise ModelError(
                f"'{path}': expected {names[0]}.NAME.{keys}, where NAME is one of {listed}"
            )
        return self._checked(path, (names[0], table_names.index(names[1]), names[2]), index)

    def _of_law(self, path: str, number: int, rest: list[str]) -> KeyPath:
        """The key path of a friction-law parameter of a contact."""
        written = self.contact[number].friction_law
        if len(rest) != 1 or rest[0] not in written:
            text = f"contact.{self.name_of('contact', number)}.{OF_CONTACT}"
            listed = ", ".join(written) or "none"
            raise ModelError(f"'{path}': expected {text}.KEY, where KEY is one of {listed}")
        return ("contact", number, OF_CONTACT, rest[0])

    def _checked(self, path: str, keys: KeyPath, index: KeyPath) -> KeyPath:
        """The key path with its index; ModelError where it is no number, or the index is wrong."""
        written = self.at(keys)
        if written is None and keys[2] == "materials":  # a material of the mesh's file
            return (*keys, *index)
        if isinstance(written, str | BaseModel) or written is None:
            raise ModelError(f"'{path}' is no number in the file")
        if isinstance(written, tuple) != bool(index) or (index and int(index[0]) >= len(written)):
            what = f"a list of {len(written)}" if isinstance(written, tuple) else "one number"
            raise ModelError(f"'{path}': it is {what}; lists count from 1")
        return (*keys, *index)


def dimension_of(keys: KeyPath) -> Dimension:
    """Dimension of the number at a key path."""
    if OF_CONTACT in keys:
        return dimension_of_unit(law_parameter_named(str(keys[-1])).unit)
    return DIMENSIONS[kind_of(keys)]


def kind_of(keys: KeyPath) -> str:
    """The key in a path that says what its number is, such as "E" for a modulus."""
    if BY_MATERIAL in keys:
        return BY_MATERIAL
    return next(k for k in reversed(keys) if isinstance(k, str))


@dataclass(frozen=True)
class Numbers:
    """Numbers of a model file in SI units.

    Attributes
    ----------
    file : ModelFile
    given : mapping of key path -> float
        Values in SI units that replace numbers of the file.
    """

    file: ModelFile
    given: Mapping[KeyPath, float]

    def at(self, *keys: str | int) -> float:
        """The number at a key of the file, or the value that a parameter gives it, in SI units."""
        if keys in self.given:
            return self.given[keys]
        return float(self.file.at(keys)) * dimension_of(keys).factor(self.file.units)

    def list_at(self, *keys: str | int) -> tuple[float, ...]:
        """All numbers of a list in the file, as `at`."""
        return tuple(self.at(*keys, i) for i in range(len(self.file.at(keys))))
