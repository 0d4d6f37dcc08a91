"""Masses and springs that a study adds to a model's sets, as parameters that are 0 by default.

For a model file they become further tables of the file. In a generated brake they are added to the
assembled matrices.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.assembly import Assembly
from squealstudy.models.component_slices import expand_rows
from squealstudy.models.components.attached import directions_at, mass_on, springs_on
from squealstudy.models.components.contact_rows import Rotation
from squealstudy.models.components.file_matrices import symmetric
from squealstudy.models.components.file_tables import ParameterTable, PointMassTable, SpringTable
from squealstudy.models.components.model_file import GROUND, ModelFile
from squealstudy.models.fem.sampling import Surface
from squealstudy.models.file_table import KeyPath
from squealstudy.models.parameter import ModelDefinition
from squealstudy.parameter import Parameter
from squealstudy.study.design_sections import ADDED_MASS
from squealstudy.study.source import SourceText
from squealstudy.wording import did_you_mean


@dataclass(frozen=True)
class AddedPart:
    """A mass or springs on named sets, and the parameter that is their size.

    Attributes
    ----------
    name : str
        Name of the parameter, whose value is in kg or N/m.
    table : PointMassTable or SpringTable
        The table that the model file would have for it, with size 0.
    keys : tuple of str
        Keys of the table that have the parameter's value: ``mass``, ``stiffness[1]``.
    source : SourceText
        The study file.
    place : tuple of key
        Keys at which the study file has it.
    by_name : bool
        Whether the study gives only the parameter's name. Then a parameter of the model with that
        name is meant, and nothing is added.
    """

    name: str
    table: PointMassTable | SpringTable
    keys: tuple[str, ...]
    source: SourceText
    place: KeyPath
    by_name: bool = False

    @property
    def kind(self) -> str:
        """Name of the model file's tables of this kind."""
        return "spring" if isinstance(self.table, SpringTable) else "point_mass"

    @property
    def sets(self) -> tuple[str, ...]:
        """The sets that it is on, as COMPONENT.SET; ground is left out."""
        if isinstance(self.table, SpringTable):
            return tuple(name for name in self.table.between if name.casefold() != GROUND)
        return (self.table.on,)

    @property
    def identity(self) -> str:
        """Hash of all that decides what the part adds."""
        text = repr((self.name, self.kind, self.keys, self.table.model_dump_json()))
        return hashlib.sha256(text.encode()).hexdigest()

    def error(self, message: str) -> StudyFileError:
        """The error to raise about it."""
        return self.source.error(self.place, message)


def named_mass(name: str, source: SourceText, keys: KeyPath) -> AddedPart:
    """The mass, spread over a set, of a parameter such as ``added_mass.caliper.BRIDGE``."""
    table = PointMassTable(name="added", on=name.removeprefix(ADDED_MASS), mass=0.0)
    return AddedPart(name, table, ("mass",), source, keys, by_name=True)


def with_parts(
    file: ModelFile, parts: Sequence[AddedPart]
) -> tuple[ModelFile, dict[KeyPath, AddedPart]]:
    """The file with the tables of some parts added, and the parts by keys of their tables.

    Raises
    ------
    StudyFileError
        Where the file has a parameter with the name of a part already.
    """
    tables = {kind: list(getattr(file, kind)) for kind in ("point_mass", "spring")}
    parameters = dict(file.parameters)
    part_of_keys: dict[KeyPath, AddedPart] = {}
    taken = {t.name for kind in (*tables, "layer", "tie", "coupling") for t in getattr(file, kind)}
    for number, part in enumerate(parts, start=1):
        if part.name in parameters and part.by_name:
            continue
        if part.name in parameters:
            raise part.error(f"there is a parameter '{part.name}' already")
        name = f"added_{number}"
        while name in taken:
            name += "_"
        taken.add(name)
        tables[part.kind].append(part.table.model_copy(update={"name": name}))
        part_of_keys[part.kind, len(tables[part.kind]) - 1] = part
        paths = tuple(f"{part.kind}.{name}.{key}" for key in part.keys)
        parameters[part.name] = ParameterTable(path=paths, default=0.0)
    all_tables = {kind: tuple(rows) for kind, rows in tables.items()}
    return file.model_copy(update={**all_tables, "parameters": parameters}), part_of_keys


def with_added(model: ModelDefinition, parts: Sequence[AddedPart]) -> ModelDefinition:
    """A generated model with parts on its sets; lengths of parts are in m.

    Raises
    ------
    StudyFileError
        Where the model has no such set, or has a part's parameter already, or a spring does not
        join two different sets, or a set and ground.
    """
    names, declared = {p.name for p in model.parameters}, list(model.declared)
    parts = [part for part in parts if not (part.by_name and part.name in names)]
    for part in parts:
        if not model.sets:
            text = f"model '{model.name}' has no named sets: disc_brake and model files have"
            raise part.error(text)
        for name in part.sets:
            if name not in model.sets:
                listed = ", ".join(model.sets)
                hint = did_you_mean(name, model.sets) or f"; it has {listed}"
                raise part.error(f"model '{model.name}' has no set '{name}'{hint}")
        if not part.sets or len(set(part.sets)) < len(part.sets):
            raise part.error("expected two sets, or one and ground")
        if part.name in names:
            raise part.error(f"there is a parameter '{part.name}' already")
        names.add(part.name)
        unit = "N/m" if isinstance(part.table, SpringTable) else "kg"
        what = f"added on {' and '.join(part.sets)}"
        declared.append(Parameter(part.name, 0.0, unit, what, minimum=0.0, structural=True))
    return replace(
        model,
        declared=tuple(declared),
        build=partial(_built, model.build, tuple(parts)),
        added=tuple(part.identity for part in parts),
    )


def _built(
    build: Callable[[Mapping[str, str | int], Mapping[str, float]], Assembly],
    parts: tuple[AddedPart, ...],
    options: Mapping[str, str | int],
    values: Mapping[str, float],
) -> Assembly:
    """The assembly with the parts; StudyFileError about a part that is impossible at any size."""
    assembly = build(options, values)
    for number, part in enumerate(parts, start=1):
        try:
            assembly = _with_part(assembly, part, f"added_{number}", values[part.name])
        except ModelError as error:
            raise part.error(str(error)) from error
    return assembly


def _with_part(assembly: Assembly, part: AddedPart, name: str, size: float) -> Assembly:
    """The assembly with a part of this size [kg or N/m]."""
    components = {c.name: c for c in assembly.components}

    def points(reference: str) -> tuple[str, Surface]:
        owner, _, face = reference.partition(".")
        return owner, components[owner].sets[face]()

    sets = [points(reference) for reference in part.sets]
    if not isinstance(part.table, SpringTable):
        ((owner, surface),) = sets
        position = None if part.table.at is None else np.array(part.table.at)
        M = symmetric(components[owner].M + mass_on(surface, size, position))
        components[owner] = replace(components[owner], M=M)
        return replace(assembly, components=tuple(components.values()))
    stiffness = [size if f"stiffness[{k}]" in part.keys else 0.0 for k in (1, 2, 3)]
    rotation = Rotation(np.zeros(3), np.array([0.0, 0.0, 1.0]))  # generated brakes turn about +z
    spring = springs_on(
        name,
        sets[0],
        sets[1] if len(sets) > 1 else None,
        stiffness,
        partial(directions_at, axes=part.table.axes, rotation=rotation),
        lambda *parts: expand_rows(parts, assembly.slices, assembly.n_dof),
    )
    return replace(assembly, springs=(*assembly.springs, spring))
