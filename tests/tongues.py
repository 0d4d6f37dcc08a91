"""Random families in two parameters whose modes lock in within narrow tongues, and brute force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from squealstudy.kinds.complex_modes.boundary import BoundaryGrid, refine
from squealstudy.kinds.complex_modes.passing_modes import Node, NodeModes, PassingModes
from squealstudy.tables.boundary_map import full_points

HZ = 2 * np.pi
TOLERANCE = 1e-7
Family = Callable[[float, float], tuple[np.ndarray, np.ndarray]]  # C and K, M = 1, over (0, 1)^2


def oscillators(rng: np.random.Generator) -> Family:
    """Two, coupled by friction (x) as Hulten's, one of which is tuned over 50 to 110 Hz (y)."""
    w1, zeta = HZ * rng.uniform(60, 90), 10 ** rng.uniform(-3.3, -2)
    most, shape, ratio = 10 ** rng.uniform(-2.5, -1), rng.uniform(0.5, 1.5), rng.uniform(0.3, 3)

    def matrices(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        mu, w2 = most * (0.1 + 0.9 * x), HZ * (50 + 60 * y)
        K = np.array([[w1**2, mu * w2**2 * shape], [-mu * w1**2, w2**2]])
        return np.diag([2 * zeta * w1, 2 * zeta * ratio * w2]), K

    return matrices


def coupled(rng: np.random.Generator) -> Family:
    """Three to five modes, one of them tuned (y); springs and forces of friction (x) couple all."""
    n = int(rng.integers(3, 6))
    w = HZ * np.sort(rng.uniform(50, 150, n))
    A, B = rng.normal(size=(2, n, n))
    springs, forces = rng.uniform(0, 0.004) * (A + A.T), rng.uniform(0.003, 0.03) * B
    zeta, tuned, span = 10 ** rng.uniform(-3.3, -2, n), int(rng.integers(n)), rng.uniform(0.3, 1)

    def matrices(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        own = w.copy()
        own[tuned] *= 1 + span * (y - 0.3)
        K = np.diag(own**2) + (springs + forces * (0.1 + 0.9 * x)) * np.outer(own, own)
        return np.diag(2 * zeta * own), K

    return matrices


def families(seed: int, count: int) -> list[Family]:
    """Both sorts in turn."""
    rng = np.random.default_rng(seed)
    return [(oscillators if k % 2 else coupled)(rng) for k in range(count)]


def grid_of(shape: tuple[int, ...], levels: int) -> BoundaryGrid:
    """The grid of a boundary design over (0, 1)^2."""
    fine = [(n - 1) * 2**levels + 1 for n in shape]
    axes = tuple(tuple(np.linspace(0.0, 1.0, n).tolist()) for n in fine)
    return BoundaryGrid(tuple("xy"), axes, levels)


def every_node(family: Family, grid: BoundaryGrid) -> np.ndarray:
    """Unstable modes of every node, by eigenvalues of the first-order form."""
    found = np.zeros(grid.shape, dtype=int)
    for i, x in enumerate(grid.axes[0]):
        C, K = (np.array(part) for part in zip(*(family(x, y) for y in grid.axes[1]), strict=True))
        n = K.shape[1]
        A = np.zeros((len(K), 2 * n, 2 * n))
        A[:, :n, n:], A[:, n:, :n], A[:, n:, n:] = np.eye(n), -K, -C
        lam = np.linalg.eigvals(A)
        growing = (lam.imag > 0) & (lam.real > TOLERANCE * np.abs(lam))
        found[i] = growing.sum(axis=1)
    return found


def solved_nodes(family: Family, grid: BoundaryGrid, passing: bool) -> dict[Node, NodeModes]:
    """All nodes that the refinement asks for, with or without the rule of passing modes."""
    known: dict[Node, NodeModes] = {}
    while True:
        rule = PassingModes(known.__getitem__, TOLERANCE) if passing else None
        roots = {node: modes.lam for node, modes in known.items()}
        fresh = [n for n in refine(grid, roots, TOLERANCE, rule) if n not in known]
        if not fresh:
            return known
        for node in fresh:
            C, K = family(*grid.values([node])[0])
            n = len(K)
            lam, z = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
            kept = np.flatnonzero(lam.imag > 0)
            kept = kept[np.argsort(np.abs(lam[kept]))]
            known[node] = NodeModes(lam[kept], z[:n, kept].T, z[:n, kept].T)


def wrong_nodes(known: dict[Node, NodeModes], grid: BoundaryGrid, truth: np.ndarray) -> int:
    """Nodes of the filled map with another number of unstable modes than is true."""
    points = pd.DataFrame(grid.values(list(known)), columns=list(grid.names))
    count = [int((m.lam.real > TOLERANCE * np.abs(m.lam)).sum()) for m in known.values()]
    points = points.assign(point_id=[f"p{i}" for i in range(len(known))], status="ok")
    table, _ = full_points(points, dict(zip(grid.names, grid.axes, strict=True)), grid.levels)
    by_id = dict(zip(points["point_id"], count, strict=True))
    filled = table["point_id"].map(by_id).to_numpy().reshape(grid.shape, order="F")
    return int((filled != truth).sum())
