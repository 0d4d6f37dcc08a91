"""Masses and springs that a study adds to a model file, as parameters that are 0 by default."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from squealstudy.errors import StudyFileError
from squealstudy.models.components.file_tables import (
    ParameterTable,
    PointMassTable,
    SpringTable,
)
from squealstudy.models.components.model_file import KeyPath, ModelFile
from squealstudy.study.source import SourceText


@dataclass(frozen=True)
class AddedPart:
    """A mass or springs on named sets, and the parameter that is their size.

    Attributes
    ----------
    name : str
        Of the parameter: kg, or N/m.
    table : PointMassTable or SpringTable
        As it would stand in the model file, of size 0.
    keys : tuple of str
        What of the table has the parameter's value: ``mass``, ``stiffness[1]``.
    source : SourceText
        The study file, and
    place : tuple of key
        where it stands there.
    """

    name: str
    table: PointMassTable | SpringTable
    keys: tuple[str, ...]
    source: SourceText
    place: KeyPath

    @property
    def kind(self) -> str:
        """The tables of a model file that it is one of."""
        return "spring" if isinstance(self.table, SpringTable) else "point_mass"

    @property
    def identity(self) -> str:
        """Hash of all that decides what is added."""
        text = repr((self.name, self.kind, self.keys, self.table.model_dump_json()))
        return hashlib.sha256(text.encode()).hexdigest()

    def error(self, message: str) -> StudyFileError:
        """The error to raise about it."""
        return self.source.error(self.place, message)


def with_parts(
    file: ModelFile, parts: Sequence[AddedPart]
) -> tuple[ModelFile, dict[KeyPath, AddedPart]]:
    """The tables of a file with those of some parts, and the place of each part among them.

    Raises
    ------
    StudyFileError
        A part whose parameter there is already.
    """
    tables = {kind: list(getattr(file, kind)) for kind in ("point_mass", "spring")}
    parameters = dict(file.parameters)
    places: dict[KeyPath, AddedPart] = {}
    taken = {t.name for kind in (*tables, "layer", "tie") for t in getattr(file, kind)}
    for number, part in enumerate(parts, start=1):
        if part.name in parameters:
            raise part.error(f"there is a parameter '{part.name}' already")
        name = f"added_{number}"
        while name in taken:
            name += "_"
        taken.add(name)
        tables[part.kind].append(part.table.model_copy(update={"name": name}))
        places[part.kind, len(tables[part.kind]) - 1] = part
        paths = tuple(f"{part.kind}.{name}.{key}" for key in part.keys)
        parameters[part.name] = ParameterTable(path=paths, default=0.0)
    own = {kind: tuple(found) for kind, found in tables.items()}
    return file.model_copy(update={**own, "parameters": parameters}), places
