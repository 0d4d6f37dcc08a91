"""Sets of a model file: outer faces of a mesh, chosen by their position and normal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from squealstudy.models.components.component_table import ComponentTable, SetTable
from squealstudy.models.components.dimensions import LENGTH, UNITS, extent_text
from squealstudy.models.components.faces import boundary
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.set_names import has_name
from squealstudy.models.file_table import KeyPath, PlacedError

# distance that nodes may be off a box, plane or cylinder, over the longest side of the mesh
PLACE_TOLERANCE_OVER_SIDE = 1e-3


def with_sets(mesh: SolidMesh, name: str, table: ComponentTable, units: str) -> SolidMesh:
    """Add the sets of a model file to a mesh, as surfaces.

    `mesh` is in SI units and in the coordinates of its file.

    Raises
    ------
    PlacedError
        The mesh has a set of the name already; a direction is zero; a set selects no face.
    """
    if not table.sets:
        return mesh
    faces, nodes, normal = _outer(mesh)
    surfaces = dict(mesh.surfaces)
    for label, set_table in table.sets.items():
        keys: KeyPath = ("components", name, "sets", label)
        if has_name(mesh.surfaces, label) or has_name(mesh.node_sets, label):
            raise PlacedError(keys, f"{mesh.origin.name} has a set '{label}' already")
        chosen = np.ones(len(faces), dtype=bool)
        size = LENGTH.factor(units)
        for what, fulfilled, off, unit in _conditions(set_table, mesh, nodes, normal, size, keys):
            if not (chosen & fulfilled).any():
                unit = unit or UNITS[units][0]
                raise PlacedError(
                    keys,
                    f"none of {chosen.sum()} outer faces of {mesh.origin.name} is {what}, the "
                    f"nearest is {off[chosen].min():.3g} {unit} off; in the mesh's file it lies "
                    f"{extent_text(mesh.nodes / size, UNITS[units][0])}",
                )
            chosen &= fulfilled
        if set_table.elements is not None:
            elements = mesh.find("element_sets", set_table.elements)
            chosen &= np.isin(faces[:, 0], elements)
            if not chosen.any():
                raise PlacedError(
                    keys, f"no such face is of the element set '{set_table.elements}'"
                )
        surfaces[label] = faces[chosen]
    return replace(mesh, surfaces=surfaces)


def _outer(mesh: SolidMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outer faces (p, 2), their nodes (p, 8), the last one repeated, and outward normals (p, 3)."""
    outer = boundary(mesh)
    faces, nodes, normals = [], [], []
    for block, start, end in zip(mesh.blocks, mesh.starts, mesh.starts[1:], strict=False):
        block_faces = outer[(outer[:, 0] >= start) & (outer[:, 0] < end)]
        shape = block.kind.shape
        for number, face in enumerate(shape.faces, 1):
            same_face = block_faces[block_faces[:, 1] == number]
            face_nodes = block.nodes[same_face[:, 0] - start][:, list(face)]
            corners = mesh.nodes[
                face_nodes[:, [i for i, f in enumerate(face) if shape.is_corner(f)]]
            ]
            cross = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
            if corners.shape[1] == 3:
                cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            faces.append(same_face)
            nodes.append(np.pad(face_nodes, ((0, 0), (0, 8 - face_nodes.shape[1])), mode="edge"))
            normals.append(cross / np.linalg.norm(cross, axis=1, keepdims=True))
    all_faces = np.vstack(faces)
    order = np.lexsort((all_faces[:, 1], all_faces[:, 0]))
    return all_faces[order], np.vstack(nodes)[order], np.vstack(normals)[order]


def _conditions(
    table: SetTable,
    mesh: SolidMesh,
    nodes: np.ndarray,
    normal: np.ndarray,
    size: float,
    keys: KeyPath,
) -> list[tuple[str, np.ndarray, np.ndarray, str]]:
    """The conditions of a set, one for each of its keys.

    Each is its name in messages, whether faces fulfil it (p,), how far they are off (p,), and the
    unit of that; an empty unit is the model file's unit of length.
    """
    x = mesh.nodes[nodes]
    tolerance = PLACE_TOLERANCE_OVER_SIDE * float(np.ptp(mesh.nodes, axis=0).max())
    if table.tolerance is not None:
        tolerance = size * table.tolerance
    conditions = []
    if table.box is not None:
        low, high = np.sort(size * np.array(table.box), axis=0)
        off = np.maximum(low - x, x - high).max(axis=(1, 2))
        conditions.append(("in the box", off <= tolerance, off / size, ""))
    if table.plane is not None:
        n = _unit(table.plane.normal, (*keys, "plane", "normal"))
        off = np.abs((x - size * np.array(table.plane.point)) @ n).max(axis=1)
        conditions.append(("in the plane", off <= tolerance, off / size, ""))
    if table.cylinder is not None:
        axis = _unit(table.cylinder.axis, (*keys, "cylinder", "axis"))
        from_axis = x - size * np.array(table.cylinder.point)
        r = np.linalg.norm(from_axis - (from_axis @ axis)[..., None] * axis, axis=-1)
        radius = table.cylinder.radius
        low_r, high_r = radius if isinstance(radius, tuple) else (radius, radius)
        off = np.maximum(size * low_r - r, r - size * high_r).max(axis=1)
        conditions.append(("at that radius", off <= tolerance, off / size, ""))
    if table.normal is not None:
        cosine = normal @ _unit(table.normal, (*keys, "normal"))
        turned = np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))
        conditions.append(
            ("turned there", cosine >= np.cos(np.deg2rad(table.angle)), turned, "deg")
        )
    return conditions


def _unit(vector: tuple[float, float, float], keys: KeyPath) -> np.ndarray:
    v = np.array(vector)
    if not np.linalg.norm(v) > 0:
        raise PlacedError(keys, "expected a direction, got zeros")
    unit: np.ndarray = v / np.linalg.norm(v)
    return unit
