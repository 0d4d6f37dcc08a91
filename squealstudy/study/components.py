"""The model of a study that names a model file: parameters, files, and how it is built."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from squealstudy.errors import ConvergenceError, ModelError, StudyFileError
from squealstudy.laws import ContactLaw, FrictionCurve, FrictionCurveDefinition
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import (
    Body,
    Brake,
    placement,
    read_files,
)
from squealstudy.models.components.contact_friction import check_friction
from squealstudy.models.components.definition import DESCRIPTION, NAME, FileDefinition
from squealstudy.models.components.dimensions import UNITS
from squealstudy.models.components.file_names import check_names
from squealstudy.models.components.model_file import (
    ROTOR_ANGLE,
    ModelFile,
    ValuesError,
)
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.operating import (
    ASSUMPTIONS,
    CONTACT_OPTION,
    FRICTION,
    FRICTION_OPTION,
    FRICTION_RANGE,
    PRESSURE,
    OperatingPoint,
)
from squealstudy.models.own_law import LAW_PREFIX, law_first, parameters_of
from squealstudy.models.parameter import ModelOption
from squealstudy.parameter import Parameter
from squealstudy.study.added_parts import AddedPart, with_parts
from squealstudy.study.file_parameters import file_parameters, file_places
from squealstudy.study.largest_friction import largest_friction
from squealstudy.study.source import SourceText, validate
from squealstudy.study.stresses import (
    law_defaults,
    stress_assumptions,
    stressed_point,
    with_stresses,
    with_worn_gaps,
)
from squealstudy.wording import did_you_mean, listed

if TYPE_CHECKING:
    import scipy.sparse as sp

    from squealstudy.models.components.component_facts import Inspection
    from squealstudy.models.components.geometry import Geometry
    from squealstudy.parameter import Parameter


def read_model(
    path: Path, parts: Sequence[AddedPart] = (), *, unfinished: bool = False
) -> FileDefinition:
    """The model of a model file with parts that a study adds; StudyFileError about any fault.

    A file that is `unfinished` may have no contact yet.
    """
    source = SourceText.read(path)
    file = validate(ModelFile, source, source.tables)
    if not file.contact and not unfinished:
        raise source.error(("contact",), "there is no [[contact]]: no faces in contact")
    try:
        check_names(file)
    except PlacedError as error:
        raise placed(error, source) from error
    digests = _digests(file, source)
    file, added = with_parts(file, parts)
    identities = (*digests, *(part.identity for part in parts))
    brake = Brake(path, file, hashlib.sha256("".join(identities).encode()).hexdigest())
    keys_of = file_places(file, source)
    declared = file_parameters(file, source, keys_of)
    stressed, laws = stressed_point(file), law_defaults(declared)
    defaults = {p.name: p.default for p in declared if isinstance(p, Parameter)}
    try:
        curve = check_friction(file, {keys for where in keys_of.values() for keys in where})
    except PlacedError as error:
        raise placed(error, source) from error
    build = _Build(source, brake, digests, keys_of, stressed, defaults, laws, added)
    largest = largest_friction(file, keys_of, build.factors_over)
    return FileDefinition(
        name=NAME,
        description=file.description or DESCRIPTION,
        options=(
            CONTACT_OPTION,
            ModelOption(
                FRICTION_OPTION.name, partial(law_first, curve.name), FRICTION_OPTION.description
            ),
        ),
        declared=declared,
        components=tuple(file.components),
        build=build,
        assumptions=(
            *(replace(a, group=largest) if a is FRICTION_RANGE else a for a in ASSUMPTIONS),
            *stress_assumptions(build.stressed),
        ),
        torque_unit="N m",
        idle=_idle(file, curve),
        own_of_law=frozenset(f"{LAW_PREFIX}{k}" for t in file.contact for k in t.friction_law),
        in_place=_InPlace(tuple(n for n, keys in keys_of.items() if ROTOR_ANGLE in keys)),
        effective_radius=build.effective_radius,
        path=str(path.resolve()),
        files=identities,
    )


def _idle(file: ModelFile, law: FrictionCurveDefinition) -> dict[str, str]:
    """Parameters of the operating point that no contact uses, and why."""
    sliding = [table for table in file.contact if table.kind == "sliding"]
    if not sliding:
        return {}
    why = "every sliding contact has its own"
    idle = {} if any(table.friction is None for table in sliding) else {FRICTION.name: why}
    for key, parameter in parameters_of(law).items():
        if all(key in table.friction_law for table in sliding):
            idle[parameter.name] = why
    return idle


@dataclass(frozen=True)
class _InPlace:
    """Tells which parameters leave nodes in place: all but those that turn the rotor."""

    turning: tuple[str, ...]

    def __call__(self, parameter: Parameter) -> bool:
        return parameter.name not in self.turning


def inspected(model: FileDefinition) -> tuple[Inspection, Geometry | None]:
    """Inspection of a model file, and its geometry; StudyFileError about any fault.

    Without contact or load only the components are inspected, as far as they can be used.
    """
    from squealstudy.models.components.geometry import geometry_at
    from squealstudy.models.components.inspection import inspect
    from squealstudy.models.components.part_inspection import inspect_parts

    build, values = build_of(model), model.defaults()
    if not build.brake.file.contact or not build.brake.file.load:
        with build.told(values):
            return inspect_parts(build.brake, build.given(values))
    assembly = build({option.name: option.choices[0] for option in model.options}, values)
    with build.told(values):
        inspection = inspect(build.brake, assembly, values[PRESSURE.name], build.given(values))
        return inspection, geometry_at(build.brake, build.given(values))


def free_motions(model: FileDefinition) -> list[str]:
    """Doubts about motions that nothing holds, at the default values of a model file.

    All meshes are read and assembled: a second or two for 50,000 degrees of freedom.

    Raises
    ------
    StudyFileError
        Where the file, or its meshes and sets, cannot be used.
    """
    from squealstudy.models.components.component_facts import Inspection
    from squealstudy.models.components.geometry import geometry_at
    from squealstudy.models.components.inspection import unheld

    build, values, inspection = build_of(model), model.defaults(), Inspection()
    options = {option.name: option.choices[0] for option in model.options}
    assembly = replace(build, stressed=None)(options, values)
    with build.told(values):
        unheld(inspection, geometry_at(build.brake, build.given(values)), assembly)
    return inspection.doubts


def inspected_part(
    path: Path, units: str, part: str | None, pass_over: Sequence[str]
) -> tuple[Inspection, Geometry | None]:
    """Inspection of a mesh alone; ModelError about any fault."""
    from squealstudy.models.components.part_inspection import inspect_parts, part_alone

    if units not in UNITS:
        raise ModelError(f"units '{units}': expected one of {', '.join(UNITS)}")
    return inspect_parts(part_alone(path, units, part, pass_over), {})


def build_of(model: FileDefinition) -> _Build:
    """The builder of a model file's model."""
    assert isinstance(model.build, _Build)
    return model.build


def free_component(
    model: FileDefinition, name: str
) -> tuple[Body, tuple[sp.csr_matrix, sp.csr_matrix], tuple[np.ndarray, np.ndarray]]:
    """A component of a model file at default values: body, its free K and M, turn and shift.

    Raises
    ------
    StudyFileError
        Where there is no such component, or it has a fault.
    """
    from squealstudy.models.components.attached import component_matrices
    from squealstudy.models.components.geometry import geometry_of

    build = build_of(model)
    tables = build.brake.file.components
    if name not in tables:
        text = f"there is no component '{name}'{did_you_mean(name, tuple(tables))}"
        raise build.source.error(("components",), text)
    values = model.defaults()
    with build.told(values):
        geometry = geometry_of(build.brake)
        matrices = component_matrices(geometry, name, build.given(values))
    body = geometry.bodies[name]
    where = placement(name, tables[name], build.brake.file.units)
    return body, matrices, where


@dataclass(frozen=True)
class _Build:
    """Builds the model (`ModelDefinition.build`); it is sent to worker processes.

    Attributes
    ----------
    source : SourceText
        The model file.
    brake : Brake
    digests : tuple of str
        Hashes of the model file and the files it reads, when the study was read.
    places : dict of str -> tuple of key
        Keys of the file's numbers that each parameter sets.
    stressed : OperatingPoint or None
        Operating point whose stresses stiffen the model; None: none do.
    defaults : dict of str -> float
        Default values of the file's parameters.
    law_values : dict of str -> float
        Defaults of the parameters of contact laws.
    added : dict of key -> AddedPart
        Parts that a study adds, by the keys of their tables in the file.
    """

    source: SourceText
    brake: Brake
    digests: tuple[str, ...]
    places: Mapping[str, tuple[KeyPath, ...]]
    stressed: OperatingPoint | None
    defaults: Mapping[str, float]
    law_values: Mapping[str, float]
    added: Mapping[KeyPath, AddedPart] = field(default_factory=dict)

    def given(self, values: Mapping[str, float]) -> dict[KeyPath, float]:
        """Numbers (SI) that these values of parameters set in the file, by key."""
        return {keys: values[name] for name, where in self.places.items() for keys in where}

    def effective_radius(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, float],
    ) -> float | None:
        """Radius [m] at which points slide at ``sliding_speed``; None where all slide at it."""
        from squealstudy.models.components.geometry import geometry_of

        with self.told(values):
            return geometry_of(self.brake).effective_radius

    def factors_over(self, number: int, seed: int) -> tuple[float, float]:
        """Mean and largest friction factor over a contact's face."""
        from squealstudy.models.components.friction_factors import mean_and_largest
        from squealstudy.models.components.geometry import geometry_of

        with self.told(self.defaults):
            return mean_and_largest(geometry_of(self.brake), number, seed)

    def __call__(self, options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
        """The assembly at options and values.

        Raises
        ------
        StudyFileError
            About a fault of the model file, with line and key.
        ModelError
            Where no material can have the values, or a file has changed meanwhile.
        """
        from squealstudy.models.components.build import build_assembly  # scikit-fem is slow to load

        if _digests(self.brake.file, self.source) != self.digests:
            raise ModelError(f"{self.source.path}, or a file that it reads, has changed meanwhile")
        in_file = self.given(values)
        law = ContactLaw.from_values(str(options[CONTACT_OPTION.name]), values)
        with self.told(values):
            curve = FrictionCurve.from_values(str(options[FRICTION_OPTION.name]), values)
            assembly = build_assembly(self.brake, law, in_file, curve)
        with self.told(values), self._slides(values, "wear", "that wears the faces"):
            assembly = with_worn_gaps(assembly, self.brake.file, self._law(options), in_file)
        if self.stressed is None:
            return assembly
        operating = replace(self.stressed, law=self._law(options))
        with self._slides(values, "stress_stiffening", "to take stresses from"):
            return with_stresses(assembly, self.brake, operating, in_file)

    @contextmanager
    def _slides(self, values: Mapping[str, float], table: str, why: str) -> Iterator[None]:
        """A context that explains errors of steady sliding needed for a table of the file.

        Raises
        ------
        StudyFileError
            About the table, where all parameters have their defaults.
        ModelError
            About the other values, where some differ: other design points may be fine.
        """
        try:
            yield
        except ConvergenceError as error:
            text = f"there is no steady sliding {why}: {error}"
            changed = [name for name in self.places if values[name] != self.defaults[name]]
            if not changed:
                raise self.source.error((table,), text) from error
            values_text = listed([f"{name} = {values[name]:g}" for name in changed])
            raise ModelError(f"{self.source.path}: {values_text} (SI): {text}") from error

    @contextmanager
    def told(self, values: Mapping[str, float]) -> Iterator[None]:
        """A context that adds file, line and key to errors; `values` are those of parameters.

        Raises
        ------
        StudyFileError
            About a key of the file, or of the study for a part it adds; about the parameter where
            the number is not in the file, or is an impossible default.
        ModelError
            About other impossible values, with the names of their parameters.
        """
        try:
            yield
        except PlacedError as error:
            if part := self.added.get(error.keys[:2]):
                raise part.error(error.message + did_you_mean(error.word, error.known)) from error
            owners = self._owners((error.keys,)) if self.brake.file.at(error.keys) is None else []
            if owners:
                error.keys = ("parameters", owners[0], "path")
            raise placed(error, self.source) from error
        except ValuesError as error:
            owners = self._owners(error.keys)
            what = f"{listed([f'{n} = {values[n]:g}' for n in owners])} (SI): {error.message}"
            if all(values[name] == self.defaults[name] for name in owners):
                raise self.source.error(("parameters", owners[0], "default"), what) from error
            raise ModelError(f"{self.source.path}: {what}") from error

    def _owners(self, keys: Sequence[KeyPath]) -> list[str]:
        """Names of the parameters that set a number at one of these keys."""
        return [name for name, where in self.places.items() if set(where) & set(keys)]

    def _law(self, options: Mapping[str, str | int]) -> ContactLaw:
        """The contact law for stresses and wear: its parameters at defaults, even if swept."""
        return ContactLaw.from_values(str(options[CONTACT_OPTION.name]), self.law_values)


def placed(error: PlacedError, source: SourceText) -> StudyFileError:
    """The error with file, line and key, and a similar name that may be meant."""
    return source.error(error.keys, error.message + did_you_mean(error.word, error.known))


def _digests(file: ModelFile, source: SourceText) -> tuple[str, ...]:
    """Hashes of a model file and of all that it reads; StudyFileError where one is absent."""
    digests = [hashlib.sha256(source.text.encode()).hexdigest()]
    for keys, path in read_files(file, source.path):
        if not path.is_file():
            folder = path.parent
            what = f"no file {path.name} in {folder}" if folder.is_dir() else f"no folder {folder}"
            raise source.error(keys, f"there is {what}")
        digests.append(_digest(path))
    return tuple(digests)


_file_hashes: dict[
    Path, tuple[tuple[int, int], str]
] = {}  # size and time of files, and their hashes


def _digest(path: Path) -> str:
    stat = path.stat()
    size_and_mtime = (stat.st_size, stat.st_mtime_ns)
    if path not in _file_hashes or _file_hashes[path][0] != size_and_mtime:
        with path.open("rb") as handle:
            _file_hashes[path] = size_and_mtime, hashlib.file_digest(handle, "sha256").hexdigest()
    return _file_hashes[path][1]
