"""Gaps that heat opens: free expansion of components as they are held (THEORY.md eq. (118)).

Temperatures above those of the mesh strain each element by alpha dT. What the contact sees of it is
the normal displacement of its points when everything expands without contact: the steady contact
then adds what contact forces move, so the sum is the equilibrium of hot parts that touch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg

from squealstudy.errors import ModelError
from squealstudy.linalg.factor import factorise
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import (
    Body,
    Brake,
    body_of,
    changed_mesh,
    own_numbers,
    placement,
)
from squealstudy.models.components.component_table import HeatTable
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.formulations import integration
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_matrices import (
    chunks,
    material_of,
    parts_of,
    strain_rows,
    used_materials,
)
from squealstudy.models.components.model_file import HEAT, THERMAL, Numbers
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.number_table import read_columns

COLUMNS = ("x", "y", "z", "temperature")
SAME_PLACE = 1e-6  # distance over that of neighbours at which points coincide
BEYOND_SPACINGS = 2.0  # distances of neighbours by which a node may miss the outermost places
FLAT = 1e-6  # extent of places across a plane over that along it, below which they span no body
SHIFT = 1e-9  # of stiffness over mass of single coordinates: what the preconditioner holds all by
RESIDUAL = 1e-11  # residual over the thermal forces
MAX_STEPS = 500
CACHE_SIZE = 8  # structures whose gaps a process keeps
RIGHT_ANGLES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # strains of expansion, 11 22 33 23 13 12


# -- temperatures ----------------------------------------------------------------------------------
def temperature_rise(brake: Brake, body: Body) -> np.ndarray:
    """Kelvins (n,) of all nodes of a hot component above its mesh, at a scale of 1.

    Raises
    ------
    PlacedError
        A file that is no such table, or that is not all over the component.
    """
    table = brake.file.components[body.name]
    heat, size = table.heat, LENGTH.factor(brake.file.units)
    assert heat is not None
    turn, shift = placement(body.name, table, brake.file.units)
    # in the axes and the unit of the component's file
    positions = (body.nodes - shift) @ turn / size
    if heat.file is None:
        rise: np.ndarray = heat.rise + (positions - np.array(heat.point)) @ np.array(heat.gradient)
        return rise
    try:
        return _from_file(brake.located(heat.file), heat, positions)
    except ModelError as error:
        raise PlacedError(("components", body.name, "heat", "file"), str(error)) from error


def _from_file(path: Path, heat: HeatTable, nodes: np.ndarray) -> np.ndarray:
    """Kelvins at nodes (n, 3), linear between places of the file; ModelError as `read_columns`."""
    rows = np.unique(np.array(read_columns(path, COLUMNS)[1]).reshape(-1, 4), axis=0)
    points, warm = rows[:, :3], rows[:, 3] - heat.reference
    twice = np.flatnonzero((np.diff(points, axis=0) == 0).all(axis=1))
    if len(twice):
        where = ", ".join(f"{v:g}" for v in points[twice[0]])
        raise ModelError(f"{path.name}: the place {where} has two temperatures")
    if len(rows) < 4:
        text = f"{path.name}: expected places all over the component, got {len(rows)}"
        raise ModelError(text)
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if extents[2] <= FLAT * extents[0]:
        raise ModelError(f"{path.name}: expected places all over the component, not in one plane")
    return _between(path.name, points, warm, nodes)


def _between(name: str, points: np.ndarray, warm: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Values (n,) at nodes (n, 3) of values (m,) at places (m, 3), linear between these."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    spacing = float(np.median(tree.query(points, k=2)[0][:, 1]))
    distance, nearest = tree.query(nodes)
    values: np.ndarray = warm[nearest]
    elsewhere = np.flatnonzero(distance > SAME_PLACE * spacing)
    if not len(elsewhere):
        return values
    linear = LinearNDInterpolator(points, warm)(nodes[elsewhere])
    outside = np.isnan(linear)
    too_far = outside & (distance[elsewhere] > BEYOND_SPACINGS * spacing)
    if too_far.any():
        raise ModelError(
            f"{name}: {100 * too_far.sum() / len(nodes):.3g} % of the component's nodes lie off "
            f"its places, the farthest by {distance[elsewhere][too_far].max():.3g} where those are "
            f"{spacing:.3g} apart: expected places all over the component, in the coordinates "
            "and the unit of its file"
        )
    values[elsewhere[~outside]] = linear[~outside]
    return values


# -- forces ----------------------------------------------------------------------------------------
def thermal_forces(mesh: SolidMesh, rise: np.ndarray, expansion: Mapping[str, float]) -> np.ndarray:
    """Forces (3 n,) [N] of held nodes that expand: the integral of B^T C alpha dT.

    Parameters
    ----------
    mesh : SolidMesh
    rise : ndarray (n,)
        Of its nodes, K.
    expansion : mapping of material -> float
        1/K, of all materials of elements.

    Raises
    ------
    ModelError
        Elements without material; a negative Jacobian.
    """
    forces = np.zeros((len(mesh.nodes), 3))
    parts = [p for name in used_materials(mesh) for p in parts_of(mesh, name)]
    for part, rows, X in chunks(mesh, parts):
        kind, k = part.block.kind, X.shape[1]
        C = material_of(mesh, part.material).stiffness()
        nodes = part.block.nodes[rows]
        N, _ = kind.shape.functions(integration(kind.stiffness).points)
        B, weight = strain_rows(mesh, part, rows, X)
        strain = expansion[part.material] * (rise[nodes] @ N.T)  # (e, q)
        pushed = np.einsum("eqim,i,eq->em", B, C @ RIGHT_ANGLES, weight * strain, optimize=True)
        if kind.condensed:
            K = np.einsum("eqim,ij,eqjl,eq->eml", B, C, B, weight, optimize=True)
            m = 3 * k
            inner = np.linalg.solve(K[:, m:, m:], pushed[:, m:, None])
            pushed = pushed[:, :m] - np.matmul(K[:, :m, m:], inner)[..., 0]
        np.add.at(forces, nodes, pushed.reshape(len(rows), k, 3))
    return forces.ravel()


def _expansions(brake: Brake, name: str, mesh: SolidMesh, numbers: Numbers) -> dict[str, float]:
    """Thermal expansions of the materials of a hot component, 1/K; PlacedError if missing."""
    strains = {}
    for label in used_materials(mesh):
        keys: KeyPath = ("components", name, "materials", label, THERMAL)
        if brake.file.at(keys) is None and keys not in numbers.given:
            raise PlacedError(
                ("components", name, "heat"),
                f"it is hot, and its material {label} does not say how it expands: expected "
                f"{THERMAL} = STRAIN A KELVIN in [components.{name}.materials.{label}]",
            )
        strains[label] = numbers.at(*keys)
    return strains


# -- gaps ------------------------------------------------------------------------------------------
def hot_gaps(
    assembly: Assembly, geometry: Geometry, overrides: Mapping[KeyPath, float]
) -> np.ndarray:
    """Change by heat of the gaps (nc,) of an assembly of a model file, m; zeros without heat.

    Parameters
    ----------
    assembly : Assembly
    geometry : Geometry
        Of its model file.
    overrides : mapping of key -> float
        Numbers of the file that have other values in the assembly, SI.

    Raises
    ------
    PlacedError
        What is wrong with temperatures, or a material that does not say how it expands.
    ModelError
        Where the expansion cannot be solved for.
    """
    numbers = Numbers(geometry.file, overrides)
    gaps = np.zeros(assembly.contact.n_points)
    scales = {
        name: numbers.at("components", name, *HEAT)
        for name, table in geometry.file.components.items()
        if table.heat is not None
    }
    if not any(scales.values()):
        return gaps
    of_numbers = sorted(((k, v) for k, v in overrides.items() if k[2:] != HEAT), key=str)
    key = (geometry.brake, tuple(of_numbers))
    if key not in _opened:
        while len(_opened) >= CACHE_SIZE:
            _opened.pop(next(iter(_opened)))
        _opened[key] = dict(_opened_by(assembly, geometry, overrides))
    for name, scale in scales.items():
        gaps += scale * _opened[key][name]
    return gaps


_opened: dict[tuple[Any, ...], dict[str, np.ndarray]] = {}


def _opened_by(
    assembly: Assembly, geometry: Geometry, overrides: Mapping[KeyPath, float]
) -> Iterator[tuple[str, np.ndarray]]:
    """Hot components, and gaps (nc,) by each at a scale of 1 and with the others cold."""
    numbers = Numbers(geometry.file, overrides)
    solve = Statics((assembly.K_el + assembly.K_springs(static=True)).tocsr(), assembly.M)
    for name, table in geometry.file.components.items():
        if table.heat is None:
            continue
        body = body_of(geometry.brake, name)  # as meshed: its freedoms turn with it
        mesh = changed_mesh(body, own_numbers(name, overrides))
        strains = _expansions(geometry.brake, name, mesh, numbers)
        forces = thermal_forces(mesh, temperature_rise(geometry.brake, body), strains)
        load = np.zeros(assembly.n_dof)
        load[assembly.slices[name]] = (body.expansion.E.T @ forces)[geometry.kept[name]]
        yield name, assembly.contact.N @ solve(load)


class Statics:
    """Solves K u = f of loads that are in balance where motions of K are free.

    By conjugate gradients with the factor of K + s M: a few steps, one a direction that is hardly
    held. Free motions in u are of no size in particular: contact decides on them.
    """

    def __init__(self, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
        self._K = K
        ratio = float(np.median(K.diagonal() / M.diagonal()))
        factor = factorise((K + SHIFT * ratio * M).tocsr(), definite=True)
        self._inverse = LinearOperator(K.shape, matvec=factor.solve)

    def __call__(self, load: np.ndarray) -> np.ndarray:
        """The displacement (n,); ModelError where none is found."""
        u, failed = cg(self._K, load, rtol=RESIDUAL, maxiter=MAX_STEPS, M=self._inverse)
        if failed:
            raise ModelError(
                "thermal expansion: the equations of the parts as they are held are too nearly "
                f"singular: {MAX_STEPS} steps leave more than {RESIDUAL:g} of the forces"
            )
        displacement: np.ndarray = u
        return displacement
