"""The model of a study that names a model file: its parameters, its files, how it is built."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from squealstudy.errors import ConvergenceError, ModelError, ParameterError, StudyFileError
from squealstudy.laws import ContactLaw
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import (
    Body,
    Brake,
    placement,
    read_files,
)
from squealstudy.models.components.definition import DESCRIPTION, NAME, FileDefinition
from squealstudy.models.components.file_tables import ParameterTable
from squealstudy.models.components.model_file import (
    NOT_NEGATIVE,
    POSITIVE,
    KeyPath,
    ModelFile,
    Numbers,
    PlacedError,
    dimension_of,
    kind_of,
)
from squealstudy.models.operating import (
    ASSUMPTIONS,
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    OperatingPoint,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.parameter import Declared
from squealstudy.parameter import Parameter
from squealstudy.study.family import TAKEN
from squealstudy.study.parameters import did_you_mean
from squealstudy.study.sections import StudyDefinition
from squealstudy.study.source import SourceText, validate
from squealstudy.study.stresses import (
    law_defaults,
    stress_assumptions,
    stressed_point,
    with_stresses,
)
from squealstudy.study.units import Unit, in_unit_of

if TYPE_CHECKING:
    import numpy as np
    import scipy.sparse as sp

    from squealstudy.models.components.geometry import Geometry
    from squealstudy.models.components.inspection import Inspection

OPERATING = (FRICTION, PRESSURE, SLIDING_SPEED, DAMPING, STIFFNESS_DAMPING)


def model_of_file(definition: StudyDefinition, source: SourceText) -> FileDefinition:
    """The model of a study's ``[model] file``.

    Raises
    ------
    StudyFileError
        With line and key: of the study where there is no such file, of the model file for all that
        is wrong there.
    """
    given = definition.model.file
    if given is None:
        raise source.error(
            ("model", "name"), f"model '{NAME}' is what a file describes: expected file = \"...\""
        )
    path = source.path.parent / given
    if not path.is_file():
        raise source.error(("model", "file"), f"there is no file {path}")
    for name in definition.model.family_keys:
        raise source.error(("model", name), f"unknown key of a model of a file: '{name}'")
    return read_model(path)


def read_model(path: Path) -> FileDefinition:
    """The model of a model file; StudyFileError about what is wrong with it."""
    source = SourceText.read(path)
    file = validate(ModelFile, source, source.tables)
    digests = _digests(file, source)
    brake = Brake(path, file, hashlib.sha256("".join(digests).encode()).hexdigest())
    places = _places(file, source)
    declared = _declared(file, source, places)
    build = _Build(source, brake, digests, places, stressed_point(file), law_defaults(declared))
    return FileDefinition(
        name=NAME,
        description=file.description or DESCRIPTION,
        options=(CONTACT_OPTION, FRICTION_OPTION),
        declared=declared,
        components=tuple(file.components),
        build=build,
        assumptions=(*ASSUMPTIONS, *stress_assumptions(build.stressed)),
        torque_unit="N m",
        effective_radius=build.effective_radius,
        path=str(path.resolve()),
        files=digests,
    )


def inspected(model: FileDefinition) -> tuple[Inspection, Geometry]:
    """What a model file was understood as, and its geometry; StudyFileError about what is wrong."""
    from squealstudy.models.components.geometry import geometry_of
    from squealstudy.models.components.inspection import inspect

    build, values = build_of(model), model.defaults()
    assembly = build({option.name: option.choices[0] for option in model.options}, values)
    try:
        found = inspect(build.brake, assembly, values[PRESSURE.name])
        return found, geometry_of(build.brake)
    except PlacedError as error:
        raise placed(error, build.source) from error


def build_of(model: FileDefinition) -> _Build:
    """How a model is built, with the file that was read."""
    assert isinstance(model.build, _Build)
    return model.build


def free_component(
    model: FileDefinition, name: str
) -> tuple[Body, tuple[sp.csr_matrix, sp.csr_matrix], tuple[np.ndarray, np.ndarray]]:
    """A component of a model file at its defaults: body, its free K and M, turn and shift.

    Raises
    ------
    StudyFileError
        There is no such component, or what is wrong with it.
    """
    from squealstudy.models.components.geometry import geometry_of
    from squealstudy.models.components.point_masses import component_matrices

    build = build_of(model)
    tables = build.brake.file.components
    if name not in tables:
        text = f"there is no component '{name}'{did_you_mean(name, tuple(tables))}"
        raise build.source.error(("components",), text)
    values = model.defaults()
    given = {keys: values[n] for n, all_keys in build.places.items() for keys in all_keys}
    try:
        geometry = geometry_of(build.brake)
        matrices = component_matrices(geometry, name, given)
    except PlacedError as error:
        raise placed(error, build.source) from error
    body = geometry.bodies[name]
    where = placement(name, tables[name], build.brake.file.units)
    return body, matrices, where


@dataclass(frozen=True)
class _Build:
    """Builds the model: what `ModelDefinition.build` is; goes to worker processes.

    Attributes
    ----------
    source : SourceText
        The model file.
    brake : Brake
    digests : tuple of str
        Hashes of it and of its files as they were when the study was read.
    places : dict of str -> tuple of key
        Where each parameter of the file stands.
    stressed : OperatingPoint or None
        Whose stresses stiffen what vibrates; None where none do.
    law_values : dict of str -> float
        Defaults of the parameters of contact laws.
    """

    source: SourceText
    brake: Brake
    digests: tuple[str, ...]
    places: Mapping[str, tuple[KeyPath, ...]]
    stressed: OperatingPoint | None
    law_values: Mapping[str, float]

    def effective_radius(
        self,
        options: Mapping[str, str | int],
        values: Mapping[str, float],
    ) -> float | None:
        """Radius [m] that ``sliding_speed`` is of; None where all points slide at one speed."""
        from squealstudy.models.components.geometry import geometry_of

        try:
            return geometry_of(self.brake).effective_radius
        except PlacedError as error:
            raise placed(error, self.source) from error

    def __call__(self, options: Mapping[str, str | int], values: Mapping[str, float]) -> Assembly:
        """The assembly of options and values.

        Raises
        ------
        StudyFileError
            With line and key of the model file.
        ModelError
            Values that no material can have; a file that has changed meanwhile.
        """
        from squealstudy.models.components.build import build_assembly  # scikit-fem is slow to load

        if _digests(self.brake.file, self.source) != self.digests:
            raise ModelError(f"{self.source.path}, or a file that it reads, has changed meanwhile")
        given = {keys: values[name] for name, all_keys in self.places.items() for keys in all_keys}
        law = ContactLaw.from_values(str(options[CONTACT_OPTION.name]), values)
        try:
            found = build_assembly(self.brake, law, given)
        except PlacedError as error:
            raise placed(error, self.source) from error
        if self.stressed is None:
            return found
        return self._stiffened(found, replace(self.stressed, law=self._law(options)), given)

    def _law(self, options: Mapping[str, str | int]) -> ContactLaw:
        """The contact law under which stresses are found: its defaults, whatever is swept."""
        return ContactLaw.from_values(str(options[CONTACT_OPTION.name]), self.law_values)

    def _stiffened(
        self, found: Assembly, operating: OperatingPoint, given: Mapping[KeyPath, float]
    ) -> Assembly:
        """The assembly with the stiffness of its stresses."""
        try:
            return with_stresses(found, self.brake, operating, given)
        except ConvergenceError as error:
            text = f"there is no steady sliding to take stresses from: {error}"
            raise self.source.error(("stress_stiffening",), text) from error


def placed(error: PlacedError, source: SourceText) -> StudyFileError:
    """The error with file, line and key, and what may have been meant."""
    return source.error(error.keys, error.message + did_you_mean(error.word, error.known))


def _digests(file: ModelFile, source: SourceText) -> tuple[str, ...]:
    """Hashes of a model file and of all that it reads; StudyFileError where one is absent."""
    found = [hashlib.sha256(source.text.encode()).hexdigest()]
    for keys, path in read_files(file, source.path):
        if not path.is_file():
            folder = path.parent
            what = f"no file {path.name} in {folder}" if folder.is_dir() else f"no folder {folder}"
            raise source.error(keys, f"there is {what}")
        found.append(_digest(path))
    return tuple(found)


_known: dict[Path, tuple[tuple[int, int], str]] = {}  # size and time of files, and their hashes


def _digest(path: Path) -> str:
    stat = path.stat()
    seen = (stat.st_size, stat.st_mtime_ns)
    if path not in _known or _known[path][0] != seen:
        with path.open("rb") as handle:
            _known[path] = seen, hashlib.file_digest(handle, "sha256").hexdigest()
    return _known[path][1]


# -- parameters ----------------------------------------------------------------------------------
def _places(file: ModelFile, source: SourceText) -> dict[str, tuple[KeyPath, ...]]:
    """Where each parameter stands that points into the file."""
    found: dict[str, tuple[KeyPath, ...]] = {}
    owner: dict[KeyPath, str] = {}
    for name, table in file.parameters.items():
        places = []
        for path in table.paths:
            try:
                keys = file.located(path)
            except ModelError as error:
                raise source.error(("parameters", name, "path"), str(error)) from None
            if owner.setdefault(keys, name) != name:
                text = f"'{path}' is the parameter '{owner[keys]}' already"
                raise source.error(("parameters", name, "path"), text)
            places.append(keys)
        if places:
            found[name] = tuple(places)
    return found


def _declared(
    file: ModelFile, source: SourceText, places: Mapping[str, tuple[KeyPath, ...]]
) -> Declared:
    """Parameters of the operating point, with the file's defaults, and those of the file."""
    operating = {p.name: p for p in (*OPERATING, *friction_parameters(), *contact_parameters())}
    own = []
    for name, table in file.parameters.items():
        keys = ("parameters", name)
        if name in operating:
            operating[name] = _changed(operating[name], table, source, keys)
        elif name in TAKEN or "[" in name:
            raise source.error(keys, f"'{name}' has another meaning in tables: choose another name")
        elif name not in places:
            hint = did_you_mean(name, operating) or "; or one of the operating point"
            raise source.error(keys, f'expected path = "..." of the number that it is{hint}')
        else:
            own.append(_parameter(name, table, file, source, places[name]))
    first = [operating[p.name] for p in OPERATING]
    changed = [operating[name] for name in file.parameters if name in operating]
    return (*first, *changed, friction_parameters, contact_parameters, *own)


def _changed(
    parameter: Parameter, table: ParameterTable, source: SourceText, keys: KeyPath
) -> Parameter:
    """A parameter of the operating point with another default, SI units."""
    if table.paths:
        raise source.error(keys, "it belongs to the operating point: expected no path")
    if table.default is None:
        raise source.error(keys, "expected default = NUMBER")
    factor = 1.0 if table.unit is None else _size(table.unit, parameter.unit, source, keys)
    default = _default(table, factor, parameter.unit, source, keys)
    try:
        return replace(parameter, default=parameter.check(default))
    except ParameterError as error:
        raise source.error((*keys, "default"), error.message) from None


def _size(unit: str, own: str, source: SourceText, keys: KeyPath) -> float:
    """Size of a unit in that of a parameter, `own`; StudyFileError for one of something else."""
    if unit == own:  # some are known to no table of units, such as Pa/m^n
        return 1.0
    with contextlib.suppress(KeyError):
        given, wanted = Unit.named(unit), Unit.named(own or "1")
        if given.powers == wanted.powers:
            return float(given.size / wanted.size)
    expected = f"a unit like '{own}'" if own else "no unit"
    raise source.error((*keys, "unit"), f"expected {expected}, got '{unit}'")


def _default(
    table: ParameterTable, factor: float, own: str, source: SourceText, keys: KeyPath
) -> float:
    """The default in a parameter's own unit, of a bare number by the factor of its unit."""
    if not isinstance(table.default, str):
        assert table.default is not None
        return factor * table.default
    if table.unit is not None:
        raise source.error((*keys, "unit"), f"the default has its own unit: '{table.default}'")
    try:
        return in_unit_of(table.default, own)
    except ValueError as error:
        raise source.error((*keys, "default"), f"{keys[-1]} {error}") from None


def _parameter(
    name: str,
    table: ParameterTable,
    file: ModelFile,
    source: SourceText,
    places: tuple[KeyPath, ...],
) -> Parameter:
    """A parameter that stands in the file, SI units."""
    keys = ("parameters", name)
    dimension = dimension_of(places[0])
    for path, other in zip(table.paths[1:], places[1:], strict=True):
        if dimension_of(other) != dimension:
            message = f"'{path}' has another unit than '{table.paths[0]}'"
            raise source.error((*keys, "path"), message)
    factor = dimension.factor(file.units)
    if table.unit is not None:
        factor = _size(table.unit, dimension.unit, source, keys)
    if table.default is not None:
        default = _default(table, factor, dimension.unit, source, keys)
    elif file.at(places[0]) is None or isinstance(file.at(places[0]), str):
        raise source.error(keys, "expected default = NUMBER: it is not in this file, but in a mesh")
    else:
        default = Numbers(file, {}).at(*places[0])
    kind = kind_of(places[0])
    what = table.description or " and ".join(table.paths)
    ratio = kind == "nu" and not isinstance(places[0][-1], int)
    parameter = Parameter(
        name,
        default,
        dimension.unit,
        what,
        positive=kind in POSITIVE,
        minimum=0.0 if kind in NOT_NEGATIVE else -float("inf"),
        above=-1.0 if ratio else -float("inf"),
        below=0.5 if ratio else float("inf"),
        structural=True,
    )
    try:
        parameter.check(default)
    except Exception as error:
        raise source.error((*keys, "default"), getattr(error, "message", str(error))) from None
    return parameter
