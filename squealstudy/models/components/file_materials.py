"""Materials of a model file: given to elements, and with values of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.file_tables import ComponentTable
from squealstudy.models.components.materials import Elastic, Orthotropic
from squealstudy.models.components.mesh import SolidMesh, has_name
from squealstudy.models.components.model_file import (
    KeyPath,
    Numbers,
    PlacedError,
    ValuesError,
)
from squealstudy.models.fem.solid import Isotropic

AXES = ("E", "nu", "G")


def with_tables(mesh: SolidMesh, name: str, table: ComponentTable, numbers: Numbers) -> SolidMesh:
    """The mesh with the materials of the model file given to its elements."""
    for label, material in table.materials.items():
        keys: KeyPath = ("components", name, "materials", label)
        elastic = _elastic(numbers, keys)
        word = material.elements or label
        if label in mesh.materials and material.elements is None:
            mesh = replace(mesh, materials={**mesh.materials, label: elastic})
        elif has_name(mesh.element_sets, word):
            mesh = mesh.with_material(label, elastic, word)
        elif material.elements is None and len(table.materials) == 1 and not mesh.materials:
            mesh = mesh.with_material(label, elastic)
        else:
            known = tuple(sorted({*mesh.element_sets, *mesh.materials}))
            listed = f"it has {', '.join(known)}" if known else "it has none"
            raise PlacedError(
                keys, f"{mesh.origin.name} has no element set '{word}'; {listed}", word, known
            )
    bare = np.flatnonzero(mesh.material == "")
    if len(bare) and table.mesh is not None:
        has = "has" if len(bare) == 1 else "have"
        raise PlacedError(
            ("components", name),
            f"{mesh.elements_named(bare)} of {mesh.origin.name} {has} no material; give "
            f"[components.{name}.materials.NAME] with E, nu and rho",
        )
    return mesh


def _elastic(numbers: Numbers, keys: KeyPath) -> Elastic:
    """The material at a key of the file, as it stands there."""
    table = numbers.file.at(keys)
    try:
        if isinstance(table.E, tuple):
            E, nu, G = (numbers.list_at(*keys, k) for k in AXES)
            return Orthotropic.from_engineering(E, nu, G, numbers.at(*keys, "rho"))  # type: ignore[arg-type]
        return _isotropic(*(numbers.at(*keys, k) for k in ("E", "nu", "rho")))
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error


def _isotropic(E: float, nu: float, rho: float) -> Isotropic:
    if not (E > 0 and -1 < nu < 0.5 and rho > 0):
        raise ModelError(f"expected E > 0, -1 < nu < 0.5, density > 0; got {E:g}, {nu:g}, {rho:g}")
    return Isotropic(E, nu, rho)


def changed_material(material: Elastic, values: Mapping[KeyPath, float], name: str) -> Elastic:
    """A material with other values, SI, by keys of the file that end in E or E, 2.

    Raises
    ------
    PlacedError
        A number that such a material has not.
    ValuesError
        Values that no material can have.
    """
    E, nu, G = ([*v] for v in engineering(material))
    density = material.density
    wrong = "one" if isinstance(material, Isotropic) else "three of each, such as E[3]"
    for keys, value in values.items():
        key = keys[4:]
        if key == ("rho",):
            density = value
            continue
        target = {"E": E, "nu": nu, "G": G}[str(key[0])]
        place = int(key[1]) if len(key) > 1 else 0
        if (len(key) > 1) != isinstance(material, Orthotropic) or place >= len(target):
            text = f"material {name} has {wrong}, not {key[0]}{_shown(key)}"
            raise PlacedError(keys, text)
        target[place] = value
    try:
        if isinstance(material, Isotropic):
            return _isotropic(E[0], nu[0], density)
        return Orthotropic.from_engineering(tuple(E), tuple(nu), tuple(G), density)  # type: ignore[arg-type]
    except ModelError as error:
        raise ValuesError(tuple(values), f"material {name}: {error}") from error


def _shown(key: tuple[str | int, ...]) -> str:
    return f"[{int(key[1]) + 1}]" if len(key) > 1 else ""


def engineering(
    material: Elastic,
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """E, nu and G of a material: E1 E2 E3, nu12 nu13 nu23 and G12 G13 G23 of an orthotropic one."""
    if isinstance(material, Isotropic):
        return (material.young_modulus,), (material.poisson_ratio,), ()
    S = np.linalg.inv(material.stiffness())
    E = 1 / np.diag(S)[:3]
    nu = (-S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1])
    G = (1 / S[5, 5], 1 / S[4, 4], 1 / S[3, 3])
    return tuple(map(float, E)), tuple(map(float, nu)), tuple(map(float, G))
