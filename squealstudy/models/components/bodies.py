"""Read the components of a model file: meshes in SI units, placed, and matrices on their nodes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.body_matrices import freedom_matrices
from squealstudy.models.components.bulk_cards import included
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.dimensions import (
    DENSITY,
    LENGTH,
    MASS,
    STIFFNESS,
    STRESS,
)
from squealstudy.models.components.expansion import Expansion, expanded
from squealstudy.models.components.file_materials import changed_material, with_tables
from squealstudy.models.components.file_matrices import Matrices, placed_matrices, symmetric
from squealstudy.models.components.file_sets import with_sets
from squealstudy.models.components.file_tables import FrictionTable, GapTable
from squealstudy.models.components.materials import Elastic, Orientation, Orthotropic
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_files import NASTRAN, read_mesh
from squealstudy.models.components.model_file import (
    TEMPERATURE,
    THERMAL,
    ModelFile,
    Numbers,
    ValuesError,
)
from squealstudy.models.fem.solid import Isotropic
from squealstudy.models.file_table import KeyPath, PlacedError

INCLUDED = re.compile(r"^\s*\*[^,]*,.*?\bINPUT\s*=\s*\"?([^,\"\n]+?)\"?\s*(?:,|$)", re.I | re.M)
# characters of a file that are searched for files that it includes
MAX_SCANNED_CHARACTERS = 100_000_000


@dataclass(frozen=True, eq=False)
class Brake:
    """A model file that was read, with its path, to which other paths are relative.

    Attributes
    ----------
    path : Path
        The model file.
    file : ModelFile
    identity : str
        Hash of the model file and of all files that it reads; equal for equal brakes.
    """

    path: Path
    file: ModelFile
    identity: str

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Brake) and other.identity == self.identity

    def __hash__(self) -> int:
        return hash(self.identity)

    def located(self, name: str) -> Path:
        """Path of a file that the model file names."""
        return self.path.parent / name


@dataclass(frozen=True, eq=False)
class Body:
    """A component that was read and placed, in SI units.

    Attributes
    ----------
    name : str
    mesh : SolidMesh
        Nodes and faces, and, unless there are matrices, elements with materials.
    matrices : (K, M, C or None) or None
        Matrices of files over the degrees of freedom; None where they follow from the mesh.
    expansion : Expansion
        Maps the degrees of freedom to displacements of the nodes.
    at_temperature : callable or None
        Returns the materials by name, in SI units, at a temperature of the deck.
    """

    name: str
    mesh: SolidMesh
    matrices: Matrices | None
    expansion: Expansion
    at_temperature: Callable[[float], Mapping[str, Elastic]] | None = None

    @property
    def nodes(self) -> np.ndarray:
        """Coordinates (n, 3) of the nodes, m."""
        return self.mesh.nodes


def read_files(file: ModelFile, path: Path) -> Iterator[tuple[KeyPath, Path]]:
    """All files that a model file reads, also included ones, each with the keys that name it."""
    for name, table in file.components.items():
        for key in ("mesh", "nodes", "K", "M", "C", "dof", "recovery", "measured"):
            file_name = table.file_of(key)
            if file_name is not None:
                file_path = path.parent / file_name
                for read_path in (file_path, *_included(file_path, file_path.parent, ())):
                    yield ("components", name, key), read_path
        if table.heat is not None and table.heat.file is not None:
            yield ("components", name, "heat", "file"), path.parent / table.heat.file
    for i, contact in enumerate(file.contact):
        if isinstance(contact.initial_gap, GapTable):
            yield ("contact", i, "initial_gap", "file"), path.parent / contact.initial_gap.file
        factor = contact.friction_factor
        if isinstance(factor, FrictionTable) and factor.file is not None:
            yield ("contact", i, "friction_factor", "file"), path.parent / factor.file


def _included(path: Path, folder: Path, above: tuple[Path, ...]) -> Iterator[Path]:
    """Files that an .inp or a .bdf includes, to any depth; its reader reports errors."""
    if path.suffix.lower() in NASTRAN and path.is_file():
        yield from included(path)
    if path.suffix.lower() != ".inp" or not path.is_file() or path in above:
        return
    with path.open(encoding="utf-8", errors="replace") as handle:
        text = handle.read(MAX_SCANNED_CHARACTERS)
    for name in INCLUDED.findall(text):
        included_path = folder / name.strip()
        if included_path.is_file():
            yield included_path
            yield from _included(included_path, folder, (*above, path))


@lru_cache(maxsize=64)
def body_of(brake: Brake, name: str) -> Body:
    """Read a component; the process caches it.

    Raises
    ------
    PlacedError
        A file cannot be used, or the placement is wrong; the error has its key.
    """
    table = brake.file.components[name]
    key = "mesh" if table.mesh is not None else "nodes"
    keys: KeyPath = ("components", name, key)
    try:
        mesh = read_mesh(brake.located(str(getattr(table, key))), table)
    except PlacedError:
        raise
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error
    mesh = with_sets(_in_si(mesh, brake.file.units), name, table, brake.file.units)
    mesh = with_tables(mesh, name, table, Numbers(brake.file, {}))
    turn, shift = placement(name, table, brake.file.units)
    if table.mesh is None:
        if mesh.constraints:
            raise PlacedError(
                keys,
                f"{mesh.constraints[0].name}: ties and couplings belong to the matrices, which "
                "hold them already: name their keywords in pass_over",
            )
        mesh, matrices, expansion = placed_matrices(
            brake.path.parent, brake.file.units, name, table, mesh, turn
        )
        return Body(name, _placed_mesh(mesh, turn, shift), matrices, expansion)
    try:
        placed, expansion = expanded(_placed_mesh(mesh, turn, shift))
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error
    return Body(name, placed, None, expansion, partial(_materials_at, brake, name))


@lru_cache(maxsize=64)
def _materials_at(brake: Brake, name: str, temperature: float) -> Mapping[str, Elastic]:
    """Materials of a component at another temperature of its deck.

    Raises
    ------
    ValuesError
        The deck states no materials at this temperature.
    """
    table = brake.file.components[name]
    at_temperature = table.model_copy(update={TEMPERATURE: temperature})
    try:
        mesh = _in_si(read_mesh(brake.located(str(table.mesh)), at_temperature), brake.file.units)
        return with_tables(mesh, name, table, Numbers(brake.file, {})).materials
    except ModelError as error:
        raise ValuesError((("components", name, TEMPERATURE),), str(error)) from error


def placement(name: str, table: ComponentTable, units: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and shift (3,) [m] of a component: points x are moved to turn x + shift."""
    size = LENGTH.factor(units)
    shift = np.array(table.translate) * size
    if table.rotate is None:
        return np.eye(3), shift
    axis = np.array(table.rotate.axis)
    if not np.linalg.norm(axis) > 0:
        raise PlacedError(("components", name, "rotate", "axis"), "expected a direction, got zeros")
    turn = turn_about(axis, table.rotate.angle)
    point = np.array(table.rotate.point) * size
    return turn, shift + point - turn @ point


def turn_about(axis: np.ndarray, degrees: float) -> np.ndarray:
    """Matrix (3, 3) of a rotation about a direction (3,), by the right-hand rule."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    turn[np.abs(turn) < 1e-15] = 0.0  # exact zeros of quarter turns
    return turn


def turned_body(body: Body, turn: np.ndarray, shift: np.ndarray) -> Body:
    """A body whose points x are moved to turn x + shift, with the same degrees of freedom.

    As these turn with the body, its matrices are unchanged.
    """
    mesh = _placed_mesh(body.mesh, turn, shift)
    return replace(body, mesh=mesh, expansion=body.expansion.turned(turn))


def _in_si(mesh: SolidMesh, units: str) -> SolidMesh:
    """A mesh in SI units, from one in units of its file."""
    size, stress, density = (d.factor(units) for d in (LENGTH, STRESS, DENSITY))
    unfinished = {
        name: replace(
            m,
            moduli=None if m.moduli is None else _scaled(m.moduli, stress, 1.0),
            density=None if m.density is None else density * m.density,
        )
        for name, m in mesh.unfinished.items()
    }
    grown = size * np.eye(3)
    orientations = {n: o.moved(grown, np.zeros(3)) for n, o in mesh.orientations.items()}
    return replace(
        mesh,
        nodes=size * mesh.nodes,
        materials={name: _scaled(m, stress, density) for name, m in mesh.materials.items()},
        unfinished=unfinished,
        added_density=density * mesh.added_density,
        orientations=orientations,
        constraints=tuple(c.scaled(size) for c in mesh.constraints),
        discrete=tuple(
            d.scaled(STIFFNESS.factor(units), MASS.factor(units), size) for d in mesh.discrete
        ),
    )


def _scaled(material: Elastic, stress: float, density: float) -> Elastic:
    """The material with moduli and density times these factors."""
    rho = density * material.density
    if isinstance(material, Isotropic):
        return replace(material, young_modulus=stress * material.young_modulus, density=rho)
    return replace(material, entries=tuple(stress * e for e in material.entries), density=rho)


def _placed_mesh(mesh: SolidMesh, turn: np.ndarray, shift: np.ndarray) -> SolidMesh:
    """The placed mesh; material axes turn with it, also those of elements without orientation."""
    orientations = {name: o.moved(turn, shift) for name, o in mesh.orientations.items()}
    orientation = mesh.orientation
    if not np.array_equal(turn, np.eye(3)) and any(
        isinstance(m, Orthotropic) for m in mesh.materials.values()
    ):
        as_written = Orientation("rectangular", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        orientations["PLACED"] = as_written.moved(turn, np.zeros(3))
        orientation = np.where(orientation == "", "PLACED", orientation).astype(object)
    return replace(
        mesh,
        nodes=mesh.nodes @ turn.T + shift,
        orientations=orientations,
        orientation=orientation,
        discrete=tuple(d.moved(turn) for d in mesh.discrete),
        constraints=tuple(c.moved(turn, shift) for c in mesh.constraints),
    )


def body_matrices(
    brake: Brake, name: str, overrides: Mapping[KeyPath, float]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K and M over a component's degrees of freedom, with other values of its materials.

    `overrides` are in SI units, by keys of the file.

    Raises
    ------
    ModelError
        No material can have these values.
    """
    return _body_matrices(brake, name, own_numbers(name, overrides))


def own_numbers(name: str, overrides: Mapping[KeyPath, float]) -> tuple[tuple[KeyPath, float], ...]:
    """Values of `overrides` within one component, as pairs of keys and values, SI units."""
    return tuple((k, v) for k, v in overrides.items() if k[:2] == ("components", name))


@lru_cache(maxsize=16)
def _body_matrices(
    brake: Brake, name: str, overrides: tuple[tuple[KeyPath, float], ...]
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness and mass of a body, from its file of matrices or from its mesh."""
    body = body_of(brake, name)
    if body.matrices is not None:
        return body.matrices[:2]
    mesh = changed_mesh(body, overrides)
    try:
        rule = brake.file.components[name].mass or ("lumped" if mesh.lumped else "full")
        K, M = freedom_matrices(mesh, body.expansion, rule)
    except ModelError as error:
        raise PlacedError(("components", name), str(error)) from error
    return symmetric(K), symmetric(M)


def changed_mesh(body: Body, overrides: tuple[tuple[KeyPath, float], ...]) -> SolidMesh:
    """The mesh with other values of its materials, in SI units.

    Raises
    ------
    PlacedError
        The mesh does not have such a material, or the material no such number.
    ValuesError
        No material can have these values.
    """
    materials = dict(body.mesh.materials)
    temperature = dict(overrides).get(("components", body.name, TEMPERATURE))
    if temperature is not None and body.at_temperature is not None:
        materials |= body.at_temperature(temperature)
    overrides = tuple((k, v) for k, v in overrides if k[2] == "materials" and k[4] != THERMAL)
    for label in dict.fromkeys(str(k[3]) for k, _ in overrides):
        values = {k: v for k, v in overrides if k[3] == label}
        if label not in materials:
            names = tuple(materials)
            text = f"component {body.name} has no material '{label}'; it has {', '.join(names)}"
            raise PlacedError(next(iter(values)), text, label, names)
        materials[label] = changed_material(materials[label], values, label)
    return replace(body.mesh, materials=materials)


def held_turns(of_turns: list[np.ndarray], of: Body, keys: KeyPath) -> np.ndarray:
    """Whether each degree of freedom (n,) is a rotation to be held; PlacedError without such."""
    turn_rows = np.concatenate([np.zeros(0, dtype=np.int64), *of_turns])
    lacking = turn_rows[~of.expansion.turning[turn_rows // 3]]
    if len(lacking):
        named = of.mesh.nodes_named(np.unique(lacking // 3))
        raise PlacedError(keys, f"{named}: no turns are freedoms there: expected 1 to 3")
    rows = of.expansion.turns[turn_rows]
    is_fixed = np.zeros(rows.shape[1], dtype=bool)
    is_fixed[rows.indices[of.expansion.places[rows.indices] < 0]] = True
    return is_fixed
