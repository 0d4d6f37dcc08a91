"""Compares modes measured on a component with computed ones, to judge its mesh and material.

Measured shapes are read from universal files (UFF).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from squealstudy.errors import ModelError
from squealstudy.faults import named
from squealstudy.files import OF_LINES, UnusableFileError, read_whole
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.components.free_modes import rigid_count
from squealstudy.shapes.names import SAME_NAME_REL_DISTANCE
from squealstudy.shapes.spans import span

# numbers of the datasets of a universal file
NODES = (15, 2411)  # coordinates
SYSTEMS, SYSTEMS_BY_POINTS = 2420, 18  # coordinate systems
UNITS, SHAPE, FUNCTION = 164, 55, 58
NORMAL, COMPLEX, COMPLEX_VELOCITY = 2, 3, 7  # analysis types of dataset 55 that are modes
# characteristics of dataset 55 that are motions: unknown, three translations, these with turns
CHARACTERISTICS, VALUES_PER_NODE = (0, 2, 3), (3, 6)
# its kinds of data of which a mode has the same shape: unknown, general, displacement, velocity,
# acceleration
MOTIONS = (0, 1, 8, 11, 12)
MAX_TURN = 1e-4  # entries of a turn below which axes are global: points have six digits


@dataclass(frozen=True)
class Measured:
    """Modes measured on a component, in the order of the file.

    Attributes
    ----------
    numbers : ndarray (n,) of int
        Numbers of the measured points in the file.
    points : ndarray (n, 3)
        Coordinates of the points, m.
    frequency_hz : ndarray (m,)
        Frequency of each mode, Hz.
    damping_ratio, hysteretic : ndarray (m,)
        Viscous damping ratio, and of normal modes the hysteretic damping ratio; NaN where the file
        has none.
    shapes : ndarray (m, n, 3) complex
        Displacements of the points; 0 where nothing was measured.
    left_out : int
        Number of datasets with functions, or with shapes that are no modes.
    """

    numbers: np.ndarray
    points: np.ndarray
    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    hysteretic: np.ndarray
    shapes: np.ndarray
    left_out: int

    @property
    def measured_directions(self) -> np.ndarray:
        """Which directions of the points are measured (n, 3): those in which some mode moves."""
        moving: np.ndarray = np.abs(self.shapes).max(axis=0) > 0
        return moving


def read_measured(path: Path, unit: float = 1.0) -> Measured:
    """Read measured modes from nodes (dataset 15 or 2411) and mode shapes (55) of a universal file.

    Parameters
    ----------
    path : Path
        The universal file.
    unit : float
        Length unit of the coordinates, m; used if the file has no dataset 164 (units).

    Raises
    ------
    ModelError
        Where the file cannot be read, has no nodes or no modes, a mode that is zero everywhere,
        modes at different nodes or at nodes without coordinates, or axes of displacement that are
        not global.
    """
    sets = _sets(path)
    of_kind = {kind: [s for s in sets if s["type"] == kind] for kind in {s["type"] for s in sets}}
    if UNITS in of_kind:
        unit = 1.0 / float(of_kind[UNITS][0]["length"])
    nodes = [s for kind in NODES for s in of_kind.get(kind, [])]
    coordinates_of = _node_places(path, nodes, _turned_systems(of_kind))
    shapes = of_kind.get(SHAPE, [])
    modes = [s for s in shapes if _is_mode_shape(s)]
    functions = len(of_kind.get(FUNCTION, []))
    if not modes:
        functions_text = f"it has {functions} functions (dataset 58): " if functions else ""
        raise ModelError(
            f"{path}: {functions_text}expected mode shapes, dataset 55 of normal or complex modes"
        )
    used = sorted({int(n) for s in modes for n in s["node_nums"]})
    if missing := [n for n in used if n not in coordinates_of]:
        raise ModelError(f"{path}: node {missing[0]} has a shape, but no coordinates")
    for number, mode in enumerate(modes, start=1):
        _expect_each_once(path, number, [int(n) for n in mode["node_nums"]], used)
    row_of_node = {n: i for i, n in enumerate(used)}
    mode_shapes = np.zeros((len(modes), len(used), 3), dtype=complex)
    for k, mode in enumerate(modes):
        rows = [row_of_node[int(n)] for n in mode["node_nums"]]
        mode_shapes[k, rows] = np.column_stack([mode[name] for name in ("r1", "r2", "r3")])
    if zero_shapes := [k for k in range(len(modes)) if not np.abs(mode_shapes[k]).max() > 0]:
        raise ModelError(f"{path}: mode shape {zero_shapes[0] + 1} of the file is zero everywhere")
    hz, zeta, hysteretic = np.array([_root(mode) for mode in modes]).T
    points = unit * np.array([coordinates_of[n] for n in used])
    left_out = functions + len(shapes) - len(modes)
    return Measured(np.array(used), points, hz, zeta, hysteretic, mode_shapes, left_out)


def _sets(path: Path) -> list[Mapping[str, Any]]:
    """Datasets of a universal file; of types that are not used here the type alone."""
    import pyuff

    with named(path):
        if not path.is_file():
            raise ModelError(f"{path}: there is no such file")
        try:
            read_whole(path, OF_LINES)  # raises where it cannot be read
        except UnusableFileError as error:
            raise ModelError(f"{path} cannot be read: {error}") from None
    try:
        file = pyuff.UFF(str(path))
        types_read = (*NODES, UNITS, SHAPE, SYSTEMS, SYSTEMS_BY_POINTS)
        sets = [
            file.read_sets(i) if kind in types_read else {"type": int(kind)}
            for i, kind in enumerate(file.get_set_types())
        ]
    except Exception as error:  # pyuff raises nothing narrower
        raise ModelError(f"{path}: no universal file that pyuff reads: {error}") from error
    return sets


def _is_mode_shape(s: Mapping[str, Any]) -> bool:
    """Whether a dataset 55 has motions of a mode, not its strains, forces or energies."""
    return (
        s["analysis_type"] in (NORMAL, COMPLEX, COMPLEX_VELOCITY)
        and s["data_ch"] in CHARACTERISTICS
        and s["spec_data_type"] in MOTIONS
        and s["n_data_per_node"] in VALUES_PER_NODE
    )


def _expect_each_once(path: Path, number: int, nodes: Sequence[int], used: Sequence[int]) -> None:
    """Raise ModelError unless a mode shape has each node that is used, and each once."""
    if absent := sorted(set(used) - set(nodes)):
        raise ModelError(
            f"{path}: mode shape {number} has no value at node {absent[0]}, where others have one: "
            "expected all modes at the same nodes"
        )
    if len(set(nodes)) < len(nodes):
        twice = next(n for k, n in enumerate(nodes) if n in nodes[:k])
        raise ModelError(f"{path}: mode shape {number} has node {twice} twice")


def _turned_systems(sets_of_kind: Mapping[int, Sequence[Mapping[str, Any]]]) -> set[int]:
    """Numbers of the coordinate systems whose axes are not the global ones."""
    numbers: set[int] = set()
    for s in sets_of_kind.get(SYSTEMS, ()):
        for label, kind, rows in zip(
            s["CS_sys_labels"], s["CS_types"], s["CS_matrices"], strict=True
        ):
            if kind != 0 or np.abs(rows[:3] - np.eye(3)).max() > MAX_TURN:
                numbers.add(int(label))
    for s in sets_of_kind.get(SYSTEMS_BY_POINTS, ()):
        x, xz = s["x_point"] - s["ref_o"], s["xz_point"] - s["ref_o"]
        for label, kind, to_x, to_xz in zip(s["cs_num"], s["cs_type"], x, xz, strict=True):
            is_global = np.abs(to_x[1:]).max() <= MAX_TURN * to_x[0]
            is_global &= abs(to_xz[1]) <= MAX_TURN * to_xz[2]
            if kind != 0 or not is_global or not to_x[0] > 0 or not to_xz[2] > 0:
                numbers.add(int(label))
    return numbers


def _node_places(
    path: Path, sets: Iterable[Mapping[str, Any]], turned_systems: set[int]
) -> dict[int, tuple[float, float, float]]:
    """Coordinates of each node by its number, in the unit of the file."""
    place_of: dict[int, tuple[float, float, float]] = {}
    axes: set[float] = set()
    for s in sets:
        axes |= set(s["disp_cs"])
        rows = zip(s["node_nums"], s["x"], s["y"], s["z"], strict=True)
        place_of |= {int(n): (float(x), float(y), float(z)) for n, x, y, z in rows}
    if not place_of:
        raise ModelError(f"{path}: it has no nodes: expected dataset 15 or 2411")
    if len(axes) > 1:
        raise ModelError(
            f"{path}: nodes have several axes of displacement ({len(axes)}): expected global ones"
        )
    if turned := turned_systems.intersection(map(int, axes)):
        raise ModelError(
            f"{path}: displacements are in the coordinate system {min(turned)}, whose axes are not "
            "the global ones"
        )
    return place_of


def _root(mode: Mapping[str, Any]) -> tuple[float, float, float]:
    """Frequency [Hz], viscous damping ratio and hysteretic damping of a mode; NaN if not given."""
    if mode["analysis_type"] == NORMAL:
        ratios = (float(mode.get(f"modal_damp_{kind}") or 0.0) for kind in ("vis", "his"))
        zeta, hysteretic = (ratio if ratio > 0 else np.nan for ratio in ratios)
        return float(mode["freq"]), zeta, hysteretic
    lam = complex(mode["eig"])
    size = abs(lam)
    return size / (2 * np.pi), -lam.real / size if size > 0 else np.nan, np.nan


BAND_FACTOR = 1.3  # top frequency of computed modes over the highest measured one
MIN_PAIR_MAC = 0.5  # least MAC of a pair
MIN_MEASURED_DOF = 6  # least number of measured degrees of freedom near nodes
# extent of the used points over the tolerance; a smaller one hints at a wrong unit of length
MIN_EXTENT_OVER_TOLERANCE = 10
# MAC of two computed modes at the measured points above which these points do not tell them apart
MAX_INDISTINCT_MAC = 0.5


@dataclass(frozen=True)
class Correlation:
    """How well computed modes of a component agree with measured ones.

    Attributes
    ----------
    n_rigid : int
        Number of rigid modes of the component: six if it is free.
    distance : ndarray (n,)
        Distance of each measured point from the nearest node, m.
    used : ndarray (n,) of bool
        Whether the point is within the tolerance.
    in_assembly : bool
        Whether the measured coordinates are those of the assembly; else they are those of the mesh
        file.
    groups : tuple of tuple of int
        Numbers of the computed elastic modes, counted from 1 with rigid modes first. Modes of equal
        frequency are a group, as round-off decides on their order.
    frequency_hz : ndarray (g,)
        Mean frequency of each group, Hz.
    mac : ndarray (m, g)
        Share (0 to 1) of each measured shape that a combination of the group's modes describes; for
        a group of one mode this is the MAC; 0 for modes at rest at the measured points.
    pairs : tuple of (int, int)
        Indices of measured mode and group, ascending in the measured mode.
    alike : tuple of (int, int, float)
        Pairs of groups whose shapes look alike at the measured points, with their MAC.
    """

    n_rigid: int
    distance: np.ndarray
    used: np.ndarray
    in_assembly: bool
    groups: tuple[tuple[int, ...], ...]
    frequency_hz: np.ndarray
    mac: np.ndarray
    pairs: tuple[tuple[int, int], ...]
    alike: tuple[tuple[int, int, float], ...]


def correlated(
    measured: Measured,
    K: sp.csr_matrix,
    M: sp.csr_matrix,
    nodes: np.ndarray,
    E: sp.csr_matrix,
    placement: tuple[np.ndarray, np.ndarray],
    tolerance: float,
) -> Correlation:
    """Compare measured modes of a free component with its elastic modes.

    Each measured point is compared at the nearest node. The component is placed as in the assembly
    or as in its mesh file: the placement is used that brings more points near a node. Directions in
    which no mode moves count as not measured. Modes are paired so that the sum of MAC is largest;
    pairs below MIN_PAIR_MAC are dropped.

    Parameters
    ----------
    measured : Measured
        The measured modes.
    K, M : csr_matrix (k, k)
        Stiffness and mass of the free component.
    nodes : ndarray (n, 3)
        Coordinates of the nodes in the assembly, m.
    E : csr_matrix (3 n, k)
        Displacements of the nodes from the degrees of freedom, in the assembly's axes. Nodes that
        no degree of freedom moves are left out.
    placement : ndarray (3, 3), ndarray (3,)
        Rotation and shift [m] from the mesh file to the assembly: a point x of the file lies at
        rotation x + shift.
    tolerance : float
        Largest distance of a measured point from its node, m.

    Raises
    ------
    ModelError
        Where fewer than MIN_MEASURED_DOF measured degrees of freedom have a node, the points with
        a node lie too close together, or no elastic mode is below BAND_FACTOR times the top
        measured frequency.
    """
    turn, shift = placement
    free_nodes = np.flatnonzero((np.diff(E.indptr) > 0).reshape(-1, 3).all(axis=1))
    tree = cKDTree(nodes[free_nodes])
    placements = (measured.points, measured.points @ turn.T + shift)
    nearest_by_placement = [tree.query(points) for points in placements]
    counts = [int((distance <= tolerance).sum()) for distance, _ in nearest_by_placement]
    in_assembly = counts[0] >= counts[1]
    distance, nearest = nearest_by_placement[0 if in_assembly else 1]
    used = distance <= tolerance
    axes = np.eye(3) if in_assembly else turn
    rows = _rows(measured, used, free_nodes[nearest], axes, 3 * len(nodes)) @ E
    if (
        rows.shape[0] < MIN_MEASURED_DOF
        or np.ptp(measured.points[used], axis=0).max() < MIN_EXTENT_OVER_TOLERANCE * tolerance
    ):
        extent, part_extent = (np.ptp(x, axis=0).max() for x in (measured.points, nodes))
        raise ModelError(
            f"{used.sum()} of {len(used)} measured points lie within {1e3 * tolerance:.3g} mm of a "
            f"node, {rows.shape[0]} measured freedoms: expected at least {MIN_MEASURED_DOF}, over "
            f"at least {MIN_EXTENT_OVER_TOLERANCE} times that distance. The points span "
            f"{1e3 * extent:.4g} mm, the part {1e3 * part_extent:.4g} mm; the nearest is "
            f"{1e3 * distance.min():.3g} mm away"
        )
    omega, phi = real_modes(M, K, BAND_FACTOR * float(measured.frequency_hz.max()))
    first = rigid_count(K, M, omega)
    hz = omega[first:] / (2 * np.pi)
    if not len(hz):
        raise ModelError(
            f"the part has no elastic mode up to {BAND_FACTOR:g} times the highest measured "
            f"frequency, {measured.frequency_hz.max():.4g} Hz"
        )
    mode_groups = _groups(hz)
    elastic = phi[:, first:]
    computed = rows @ elastic / np.abs(E @ elastic).max(axis=0)
    u = np.array([shape[used][measured.measured_directions[used]] for shape in measured.shapes])
    spans = [span(computed[:, group]) for group in mode_groups]
    size = np.maximum((np.abs(u) ** 2).sum(axis=1), 1e-300)
    mac = np.column_stack([(np.abs(u @ Q) ** 2).sum(axis=1) / size for Q in spans])
    alike = [
        (i, j, float(mac_of_pair))
        for i in range(len(spans))
        for j in range(i)
        if spans[i].size
        and spans[j].size
        and (mac_of_pair := np.linalg.norm(spans[i].T @ spans[j], 2) ** 2) > MAX_INDISTINCT_MAC
    ]
    return Correlation(
        n_rigid=first,
        distance=distance,
        used=used,
        in_assembly=in_assembly,
        groups=tuple(tuple(first + 1 + k for k in group) for group in mode_groups),
        frequency_hz=np.array([hz[group].mean() for group in mode_groups]),
        mac=mac,
        pairs=_pairs(mac, [len(group) for group in mode_groups]),
        alike=tuple(alike),
    )


def _rows(
    measured: Measured, used: np.ndarray, nearest: np.ndarray, turn: np.ndarray, n: int
) -> sp.csr_matrix:
    """Rows (r, n) that give the motion of the nearest nodes in the measured directions."""
    points, axes = np.nonzero(measured.measured_directions & used[:, None])
    columns = 3 * nearest[points][:, None] + np.arange(3)
    # the mesh's own axis e_i is column i of the turn, in the axes of the assembly
    values = turn.T[axes]
    point_index = np.repeat(np.arange(len(points)), 3)
    return sp.csr_matrix((values.ravel(), (point_index, columns.ravel())), shape=(len(points), n))


def _groups(hz: np.ndarray) -> list[list[int]]:
    """Groups of modes whose frequencies are equal but for round-off, in ascending order."""
    groups: list[list[int]] = []
    for k, f in enumerate(hz):
        if groups and f - hz[groups[-1][-1]] < SAME_NAME_REL_DISTANCE * f:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def _pairs(mac: np.ndarray, sizes: Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Pairs with the largest sum of MAC; a group may have as many partners as modes."""
    columns = np.repeat(np.arange(len(sizes)), sizes)
    rows, columns_of_pairs = linear_sum_assignment(mac[:, columns], maximize=True)
    pairs = zip(rows.tolist(), columns[columns_of_pairs].tolist(), strict=True)
    return tuple((i, j) for i, j in pairs if mac[i, j] >= MIN_PAIR_MAC)
