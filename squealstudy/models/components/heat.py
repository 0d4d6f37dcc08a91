"""Changes of gaps by heat: components as held expand without contact (THEORY.md eq. (118)).

Temperatures above those of the mesh strain each element by alpha dT. The contact gets the normal
displacement of its points as all parts expand without contact, as a change of its initial gaps.
Steady sliding adds the displacements by contact forces; the sum is the equilibrium of hot parts.
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
SAME_PLACE = 1e-6  # distance of points that coincide, over the spacing of the file's points
BEYOND_SPACINGS = 2.0  # largest distance of a node from the file's points, over their spacing
FLAT = (
    1e-6  # smallest extent of the file's points over the largest, below which they are in a plane
)
# shift of the preconditioner K + s M, over the median of K_ii / M_ii: it holds free motions
SHIFT = 1e-9
RESIDUAL = 1e-11  # largest residual over the thermal forces
MAX_STEPS = 500  # steps of conjugate gradients
CACHE_SIZE = 8  # structures whose gaps a process caches
# strain of an isotropic expansion of 1, in the order 11 22 33 23 13 12
RIGHT_ANGLES = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


# -- temperatures ----------------------------------------------------------------------------------
def temperature_rise(brake: Brake, body: Body) -> np.ndarray:
    """Temperature rise (n,) [K] of the nodes of a hot component above its mesh, at a scale of 1.

    Raises
    ------
    PlacedError
        The file is no table of temperatures, or does not cover the component.
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
    """Temperature rise (n,) [K] at nodes (n, 3), interpolated from a file; ModelError about it."""
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
    """Interpolate values `warm` (m,) at points (m, 3) linearly to nodes (n, 3): (n,)."""
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
    """Nodal forces (3 n,) [N] by thermal expansion: the integral of B^T C alpha dT.

    Parameters
    ----------
    mesh : SolidMesh
    rise : ndarray (n,)
        Temperature rise of the nodes, K.
    expansion : mapping of material -> float
        Thermal expansion [1/K] of each material of the elements.

    Raises
    ------
    ModelError
        Elements without material, or with a negative Jacobian.
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
    """Thermal expansion [1/K] of each material of a hot component; PlacedError if missing."""
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
        Geometry of the assembly's model file.
    overrides : mapping of key -> float
        Numbers of the file that have other values in the assembly, in SI units.

    Raises
    ------
    PlacedError
        Temperatures are wrong, or a material does not say how it expands.
    ModelError
        The equations of the expansion are too nearly singular.
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
    sorted_overrides = sorted(((k, v) for k, v in overrides.items() if k[2:] != HEAT), key=str)
    key = (geometry.brake, tuple(sorted_overrides))
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
    """Name of each hot component, and gaps (nc,) [m] by it alone at a scale of 1."""
    numbers = Numbers(geometry.file, overrides)
    solve = Statics((assembly.K_el + assembly.K_springs(static=True)).tocsr(), assembly.M)
    for name, table in geometry.file.components.items():
        if table.heat is None:
            continue
        body = body_of(geometry.brake, name)  # as meshed, as its degrees of freedom turn with it
        mesh = changed_mesh(body, own_numbers(name, overrides))
        strains = _expansions(geometry.brake, name, mesh, numbers)
        forces = thermal_forces(mesh, temperature_rise(geometry.brake, body), strains)
        load = np.zeros(assembly.n_dof)
        load[assembly.slices[name]] = (body.expansion.E.T @ forces)[geometry.kept[name]]
        yield name, assembly.contact.N @ solve(load)


class Statics:
    """Solves K u = f, where K may have free motions and loads f do no work in them.

    Conjugate gradients are preconditioned by a factor of K + s M. They take a few steps, about one
    for each direction that is hardly held. Free motions in u are arbitrary: contact fixes them.
    """

    def __init__(self, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
        self._K = K
        ratio = float(np.median(K.diagonal() / M.diagonal()))
        factor = factorise((K + SHIFT * ratio * M).tocsr(), definite=True)
        self._inverse = LinearOperator(K.shape, matvec=factor.solve)

    def __call__(self, load: np.ndarray) -> np.ndarray:
        """The displacement (n,) under a load (n,); ModelError where the steps do not converge."""
        u, failed = cg(self._K, load, rtol=RESIDUAL, maxiter=MAX_STEPS, M=self._inverse)
        if failed:
            raise ModelError(
                "thermal expansion: the equations of the parts as they are held are too nearly "
                f"singular: {MAX_STEPS} steps leave more than {RESIDUAL:g} of the forces"
            )
        displacement: np.ndarray = u
        return displacement
