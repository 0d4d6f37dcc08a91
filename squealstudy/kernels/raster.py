"""Triangles drawn into pictures with a depth buffer."""

from __future__ import annotations

import numpy as np

from squealstudy.kernels.jit import kernel

FAR = np.inf  # depth of a pixel on which nothing is drawn


@kernel
def draw_triangles(
    corners: np.ndarray,
    values: np.ndarray,
    lights: np.ndarray,
    lines: np.ndarray,
    width: float,
    depth: np.ndarray,
    value: np.ndarray,
    light: np.ndarray,
) -> None:
    """Draw triangles over what the picture holds; the nearer one stays.

    Parameters
    ----------
    corners : ndarray (n, 3, 3)
        Column, row [pixels] and depth of each corner: small is near.
    values, lights : ndarray (n, 3)
        To be interpolated between the corners.
    lines : ndarray (n, 3) of bool
        Which edges are drawn, that between corners 1 and 2 first, then 2 and 0, 0 and 1.
    width : float
        Of the lines on each side, pixels.
    depth, value, light : ndarray (rows, columns)
        The picture, changed in place. On lines the light is negative.
    """
    rows, columns = depth.shape
    for t in range(len(corners)):
        x0, y0, z0 = corners[t, 0]
        x1, y1, z1 = corners[t, 1]
        x2, y2, z2 = corners[t, 2]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if not abs(area) > 1e-12:  # seen from its edge, or not finite
            continue
        e0 = np.hypot(x2 - x1, y2 - y1)
        e1 = np.hypot(x0 - x2, y0 - y2)
        e2 = np.hypot(x1 - x0, y1 - y0)
        first = max(0, int(np.ceil(min(y0, y1, y2) - 0.5)))
        last = min(rows - 1, int(np.floor(max(y0, y1, y2) - 0.5)))
        left = max(0, int(np.ceil(min(x0, x1, x2) - 0.5)))
        right = min(columns - 1, int(np.floor(max(x0, x1, x2) - 0.5)))
        for i in range(first, last + 1):
            y = i + 0.5
            for j in range(left, right + 1):
                x = j + 0.5
                b0 = ((x1 - x) * (y2 - y) - (x2 - x) * (y1 - y)) / area
                b1 = ((x2 - x) * (y0 - y) - (x0 - x) * (y2 - y)) / area
                b2 = 1.0 - b0 - b1
                if b0 < 0.0 or b1 < 0.0 or b2 < 0.0:
                    continue
                z = b0 * z0 + b1 * z1 + b2 * z2
                if not z < depth[i, j]:
                    continue
                depth[i, j] = z
                value[i, j] = b0 * values[t, 0] + b1 * values[t, 1] + b2 * values[t, 2]
                shade = b0 * lights[t, 0] + b1 * lights[t, 1] + b2 * lights[t, 2]
                size = abs(area)
                near = (
                    (lines[t, 0] and b0 * size < width * e0)
                    or (lines[t, 1] and b1 * size < width * e1)
                    or (lines[t, 2] and b2 * size < width * e2)
                )
                light[i, j] = -shade if near else shade


@kernel
def corner_normals(
    triangles: np.ndarray, normals: np.ndarray, starts: np.ndarray, users: np.ndarray, least: float
) -> np.ndarray:
    """Normals (n, 3, 3) at the corners of triangles: smooth, but not over sharp edges.

    Parameters
    ----------
    triangles : ndarray (n, 3) of int
        Nodes.
    normals : ndarray (n, 3)
        Of the triangles, as long as their areas.
    starts : ndarray (n_nodes + 1,) of int
    users : ndarray of int
        Triangles that have a node, those of node i at users[starts[i]:starts[i + 1]].
    least : float
        Cosine of the largest angle between normals that are averaged.
    """
    found = np.zeros((len(triangles), 3, 3))
    for t in range(len(triangles)):
        own = normals[t]
        size = np.sqrt(own @ own)
        for k in range(3):
            node = triangles[t, k]
            total = np.zeros(3)
            for u in users[starts[node] : starts[node + 1]]:
                other = normals[u]
                if own @ other >= least * size * np.sqrt(other @ other):
                    total += other
            length = np.sqrt(total @ total)
            if length > 0.0:
                found[t, k] = total / length
    return found
