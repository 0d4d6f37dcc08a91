"""Boxes of every element, for tests of components."""

from __future__ import annotations

from itertools import permutations, product
from pathlib import Path

import numpy as np

from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.materials import Orthotropic
from squealstudy.models.components.mesh import ElementBlock, SolidMesh
from squealstudy.models.fem.solid import Isotropic

STEEL = Isotropic(2.1e5, 0.3, 7.8e-9)  # t, mm, s
LINING = Orthotropic.from_engineering(
    (9e3, 7e3, 2e3), (0.2, 0.1, 0.15), (1.5e3, 1.2e3, 3e3), 2.5e-9
)


def corners_of_cells(shape_name, cells):
    """Corners (n, k) of elements that fill a grid of cells, whose nodes count z fastest."""
    at = {c: i for i, c in enumerate(product(*(range(n + 1) for n in cells)))}
    cube = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    if shape_name.startswith("hex"):
        parts = [cube]
    elif shape_name.startswith("wedge"):
        parts = [[cube[i] for i in p] for p in ((0, 1, 3, 4, 5, 7), (1, 2, 3, 5, 6, 7))]
    elif shape_name.startswith("pyramid"):  # with the middle of the cell, behind all corners
        bases = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
        return np.array(
            [
                [*(at[tuple(np.add(cell, cube[i]))] for i in base), len(at) + number]
                for number, cell in enumerate(product(*map(range, cells)))
                for base in bases
            ]
        )
    else:  # six tetrahedra along one diagonal (Kuhn)
        parts = []
        for order in permutations(np.eye(3, dtype=int)):
            path = np.cumsum([(0, 0, 0), *order], axis=0)
            turned = np.linalg.det(path[1:] - path[0]) < 0
            parts.append([tuple(path[i]) for i in ((0, 2, 1, 3) if turned else range(4))])
    found = [
        [at[tuple(np.add(cell, c))] for c in part]
        for cell in product(*map(range, cells))
        for part in parts
    ]
    return np.array(found)


def box(formulation, cells=(2, 2, 2), lengths=(3.0, 2.0, 2.5), uneven=0.0, seed=0, **more):
    """A box from the origin; `uneven` moves inner nodes by shares of a cell, edges stay straight.

    One material, S, steel where `more` says nothing else.
    """
    shape = FORMULATIONS[formulation].shape
    lines = [np.linspace(0, length, n + 1) for length, n in zip(lengths, cells, strict=True)]
    nodes = np.array(list(product(*lines)))
    inner = ((nodes > 0) & (nodes < lengths)).astype(float)  # nodes stay on their face
    size = np.divide(lengths, cells)
    nodes += uneven * size * inner * np.random.default_rng(seed).uniform(-1, 1, nodes.shape)
    elements = corners_of_cells(shape.name, cells)
    if shape.name.startswith("pyramid"):
        cubes = corners_of_cells("hex8", cells)
        nodes = np.vstack([nodes, nodes[cubes].mean(axis=1)])
    if len(shape.places) > elements.shape[1]:
        nodes, elements = with_middles(shape, nodes, elements)
    labels = np.arange(len(elements)) + 101
    return SolidMesh(
        nodes=nodes,
        numbers=np.arange(len(nodes)) + 11,
        blocks=(ElementBlock(formulation, elements, labels),),
        **{
            "origin": Path("box.inp"),
            "materials": {"S": STEEL},
            "material": np.full(len(elements), "S", dtype=object),
            **more,
        },
    )


def with_middles(shape, nodes, corners):
    """Nodes and elements with a node at the middle of each edge."""
    n = corners.shape[1]
    ends = []
    for place in shape.places[n:]:
        halves = [
            (i, j)
            for i in range(n)
            for j in range(i)
            if (shape.places[i] + shape.places[j] == 2 * place).all()
            and np.abs(shape.places[i] - shape.places[j]).max() == 1
        ]
        ends.append(next(pair for pair in halves if tuple(sorted(pair)) in shape.edges))
    ends = np.array(ends)
    pairs = np.sort(corners[:, ends], axis=2)
    unique, number = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middles = nodes[unique].mean(axis=1)
    elements = np.hstack([corners, len(nodes) + number.reshape(len(corners), -1)])
    return np.vstack([nodes, middles]), elements


def rigid_shapes(x):
    """Three translations and three rotations (3 n, 6) of nodes x (n, 3)."""
    R = np.zeros((len(x), 3, 6))
    R[:, :, :3] = np.eye(3)
    for axis in range(3):
        R[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    return R.reshape(-1, 6)
