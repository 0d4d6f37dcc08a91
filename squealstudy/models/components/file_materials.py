"""Materials of a model file: how elements get them, and how parameters change them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.materials import Anisotropic, Elastic, Orthotropic
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import Numbers, ValuesError
from squealstudy.models.components.set_names import has_name
from squealstudy.models.fem.solid import Isotropic
from squealstudy.models.file_table import KeyPath, PlacedError

AXES = ("E", "nu", "G")
UNQUOTED_KEY = re.compile(r"[A-Za-z0-9_-]+")  # keys that need no quotes
N_MATERIAL_KEYS = 4  # of a key path: "components", component, "materials", material; then its key


def with_tables(mesh: SolidMesh, name: str, table: ComponentTable, numbers: Numbers) -> SolidMesh:
    """Give the elements of a mesh the materials that the model file states for the component.

    Raises
    ------
    PlacedError
        A material of the model file is wrong, or its element set does not exist. In a component
        without matrices, elements have no material, or numbers of it are in neither file.
    """
    for label, material in table.materials.items():
        keys: KeyPath = ("components", name, "materials", label)
        set_name = material.elements or label
        if label in _labels(mesh) and material.elements is None:  # the mesh's elements have it
            materials = {**mesh.materials, label: _elastic(numbers, keys, mesh, label)}
            unfinished = {k: m for k, m in mesh.unfinished.items() if k != label}
            mesh = replace(mesh, materials=materials, unfinished=unfinished)
        elif has_name(mesh.element_sets, set_name):
            mesh = mesh.with_material(label, _elastic(numbers, keys, mesh, label), set_name)
        elif material.elements is None and len(table.materials) == 1 and not _labels(mesh):
            # the only material belongs to all elements
            mesh = mesh.with_material(label, _elastic(numbers, keys, mesh, label))
        else:
            names = tuple(sorted({*mesh.element_sets, *_labels(mesh)}))
            listed = f"it has {', '.join(names)}" if names else "it has none"
            raise PlacedError(
                keys,
                f"{mesh.origin.name} has no element set '{set_name}'; {listed}",
                set_name,
                names,
            )
    if table.mesh is None:  # its matrices hold stiffness and mass: elements need no material
        return mesh
    without = np.flatnonzero(mesh.material == "")
    if len(without):
        has = "has" if len(without) == 1 else "have"
        raise PlacedError(
            ("components", name),
            f"{mesh.elements_named(without)} of {mesh.origin.name} {has} no material; give "
            f"[components.{name}.materials.NAME] with E, nu and rho",
        )
    lacking = [label for label in sorted(set(mesh.material)) if label in mesh.unfinished]
    if lacking:
        missing_numbers = "; ".join(mesh.unfinished[label].missing for label in lacking)
        where = " and ".join(f"[components.{name}.materials.{_quoted(m)}]" for m in lacking)
        raise PlacedError(("components", name), f"{missing_numbers}: state it in {where}")
    return mesh


def _labels(mesh: SolidMesh) -> set[str]:
    """Names of all materials, including those of which numbers are missing."""
    return {*mesh.materials, *mesh.unfinished}


def _quoted(label: str) -> str:
    """A key as a model file writes it: in quotes where it needs them."""
    return label if UNQUOTED_KEY.fullmatch(label) else f'"{label}"'


def _elastic(numbers: Numbers, keys: KeyPath, mesh: SolidMesh, label: str) -> Elastic:
    """The material at a key of the model file; the mesh's file gives what is missing there."""
    table = numbers.file.at(keys)
    complete, unfinished = mesh.materials.get(label), mesh.unfinished.get(label)
    moduli = unfinished.moduli if unfinished else complete
    with_density = unfinished or complete
    density = with_density.density if with_density else None
    if table.rho is not None:
        density = numbers.at(*keys, "rho")
    if density is None or (moduli is None and not table.has_all_moduli):
        lacking = ["rho"] * (density is None)
        if moduli is None:
            lacking = [k for k in ("E", "nu") if getattr(table, k) is None] + lacking
        verb = "is" if len(lacking) == 1 else "are"
        why = unfinished.missing if unfinished else f"{mesh.origin.name} has no material '{label}'"
        raise PlacedError(keys, f"{' and '.join(lacking)} {verb} missing; {why}")
    try:
        if not table.has_all_moduli:  # single moduli replace those of the mesh's file
            assert moduli is not None
            overrides: dict[KeyPath, float] = {}
            for key in AXES:
                written = getattr(table, key)
                if isinstance(written, tuple):
                    values = numbers.list_at(*keys, key)
                    overrides |= {(*keys, key, i): v for i, v in enumerate(values)}
                elif written is not None:
                    overrides[(*keys, key)] = numbers.at(*keys, key)
            return replace(changed_material(moduli, overrides, label), density=density)
        if isinstance(table.E, tuple):
            E, nu, G = (numbers.list_at(*keys, k) for k in AXES)
            return Orthotropic.from_engineering(E, nu, G, density)  # type: ignore[arg-type]
        return _isotropic(numbers.at(*keys, "E"), numbers.at(*keys, "nu"), density)
    except PlacedError:
        raise
    except ModelError as error:
        raise PlacedError(keys, str(error)) from error


def _isotropic(E: float, nu: float, rho: float) -> Isotropic:
    """The isotropic material; ModelError for numbers that no such material has."""
    if not (E > 0 and -1 < nu < 0.5 and rho > 0):
        raise ModelError(f"expected E > 0, -1 < nu < 0.5, density > 0; got {E:g}, {nu:g}, {rho:g}")
    return Isotropic(E, nu, rho)


def changed_material(material: Elastic, values: Mapping[KeyPath, float], name: str) -> Elastic:
    """A material with some numbers replaced.

    Parameters
    ----------
    material : Elastic
    values : dict of key path -> float
        In SI units. The paths end in rho, E or nu; those of moduli of an orthotropic material in
        E, nu or G and an index from 0.
    name : str
        Name of the material, for messages.

    Raises
    ------
    PlacedError
        The material has no such number.
    ValuesError
        No material can have these values.
    """
    if isinstance(material, Anisotropic):
        other = next((keys for keys in values if keys[N_MATERIAL_KEYS:] != ("rho",)), None)
        if other is not None:
            raise PlacedError(other, f"material {name} has 21 moduli: its rho alone can be changed")
        (density,) = values.values() or (material.density,)
        return replace(material, density=density)
    E, nu, G = ([*v] for v in engineering(material))
    density = material.density
    is_orthotropic = isinstance(material, Orthotropic)
    expected = "three of each, such as E[3]" if is_orthotropic else "one"
    for keys, number in values.items():
        key = keys[N_MATERIAL_KEYS:]
        if key == ("rho",):
            density = number
            continue
        target = {"E": E, "nu": nu, "G": G}[str(key[0])]
        has_index = len(key) > 1
        index = int(key[1]) if has_index else 0
        if has_index != is_orthotropic or index >= len(target):
            place_text = f"[{index + 1}]" if has_index else ""
            text = f"material {name} has {expected}, not {key[0]}{place_text}"
            raise PlacedError(keys, text)
        target[index] = number
    try:
        if isinstance(material, Isotropic):
            return _isotropic(E[0], nu[0], density)
        return Orthotropic.from_engineering(tuple(E), tuple(nu), tuple(G), density)  # type: ignore[arg-type]
    except ModelError as error:
        raise ValuesError(tuple(values), f"material {name}: {error}") from error


def engineering(
    material: Elastic,
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """(E,), (nu,) and () of an isotropic material; three each of E, nu and G of an orthotropic one.

    Their order is E1 E2 E3, nu12 nu13 nu23 and G12 G13 G23.
    """
    if isinstance(material, Isotropic):
        return (material.young_modulus,), (material.poisson_ratio,), ()
    S = np.linalg.inv(material.stiffness())  # compliance, order 11 22 33 23 13 12
    E = 1 / np.diag(S)[:3]
    nu = (-S[0, 1] * E[0], -S[0, 2] * E[0], -S[1, 2] * E[1])
    G = (1 / S[5, 5], 1 / S[4, 4], 1 / S[3, 3])
    return tuple(map(float, E)), tuple(map(float, nu)), tuple(map(float, G))
