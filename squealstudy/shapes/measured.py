"""Mode shapes measured on a part, from universal files (UFF)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.faults import named

NODES = (15, 2411)  # datasets of coordinates
UNITS, SHAPE, FUNCTION = 164, 55, 58
NORMAL, COMPLEX, COMPLEX_VELOCITY = 2, 3, 7  # analysis types of dataset 55 that are modes


@dataclass(frozen=True)
class Measured:
    """Modes measured on a part, in the order of the file.

    Attributes
    ----------
    numbers : ndarray (n,) of int
        Of the points.
    points : ndarray (n, 3)
        m.
    frequency_hz : ndarray (m,)
    damping_ratio : ndarray (m,)
        NaN where the file has none.
    shapes : ndarray (m, n, 3) complex
        Of the points; 0 where nothing was measured.
    left_out : int
        Datasets with functions or shapes that are no modes.
    """

    numbers: np.ndarray
    points: np.ndarray
    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    shapes: np.ndarray
    left_out: int

    @property
    def seen(self) -> np.ndarray:
        """Directions of points (n, 3) in which any mode moves: the others were not measured."""
        moving: np.ndarray = np.abs(self.shapes).max(axis=0) > 0
        return moving


def read_measured(path: Path, unit: float = 1.0) -> Measured:
    """Modes of a universal file: nodes (15 or 2411) and normal or complex modes (55).

    Parameters
    ----------
    path : Path
    unit : float
        Length of its coordinates in m, where it has no dataset 164 that tells.

    Raises
    ------
    ModelError
        A file that cannot be read, without nodes or modes, with modes at nodes that have no place,
        or with local axes of displacement.
    """
    sets = _sets(path)
    of_kind = {kind: [s for s in sets if s["type"] == kind] for kind in {s["type"] for s in sets}}
    if UNITS in of_kind:
        unit = 1.0 / float(of_kind[UNITS][0]["length"])
    places = _places(path, [s for kind in NODES for s in of_kind.get(kind, [])])
    shapes = of_kind.get(SHAPE, [])
    modes = [s for s in shapes if s["analysis_type"] in (NORMAL, COMPLEX, COMPLEX_VELOCITY)]
    functions = len(of_kind.get(FUNCTION, []))
    if not modes:
        there = f"it has {functions} functions (dataset 58): " if functions else ""
        raise ModelError(
            f"{path}: {there}expected mode shapes, dataset 55 of normal or complex modes"
        )
    used = sorted({int(n) for s in modes for n in s["node_nums"]})
    if missing := [n for n in used if n not in places]:
        raise ModelError(f"{path}: node {missing[0]} has a shape, but no coordinates")
    row = {n: i for i, n in enumerate(used)}
    found = np.zeros((len(modes), len(used), 3), dtype=complex)
    for k, mode in enumerate(modes):
        at = [row[int(n)] for n in mode["node_nums"]]
        found[k, at] = np.column_stack([mode[name] for name in ("r1", "r2", "r3")])
    if still := [k for k in range(len(modes)) if not np.abs(found[k]).max() > 0]:
        raise ModelError(f"{path}: mode shape {still[0] + 1} of the file is zero everywhere")
    hz, zeta = np.array([_root(mode) for mode in modes]).T
    points = unit * np.array([places[n] for n in used])
    return Measured(np.array(used), points, hz, zeta, found, functions + len(shapes) - len(modes))


def _sets(path: Path) -> list[Mapping[str, Any]]:
    import pyuff

    with named(path):
        if not path.is_file():
            raise ModelError(f"{path}: there is no such file")
        path.read_bytes()  # what cannot be read says so itself
    try:
        file = pyuff.UFF(str(path))
        wanted = (*NODES, UNITS, SHAPE)
        sets = [
            file.read_sets(i) if kind in wanted else {"type": int(kind)}
            for i, kind in enumerate(file.get_set_types())
        ]
    except Exception as error:  # pyuff raises nothing narrower
        raise ModelError(f"{path}: no universal file that pyuff reads: {error}") from error
    return sets


def _places(path: Path, sets: Iterable[Mapping[str, Any]]) -> dict[int, tuple[float, float, float]]:
    found: dict[int, tuple[float, float, float]] = {}
    axes: set[float] = set()
    for s in sets:
        axes |= set(s["disp_cs"])
        rows = zip(s["node_nums"], s["x"], s["y"], s["z"], strict=True)
        found |= {int(n): (float(x), float(y), float(z)) for n, x, y, z in rows}
    if not found:
        raise ModelError(f"{path}: it has no nodes: expected dataset 15 or 2411")
    if len(axes) > 1:
        raise ModelError(
            f"{path}: nodes have several axes of displacement ({len(axes)}): expected global ones"
        )
    return found


def _root(mode: Mapping[str, Any]) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of a mode."""
    if mode["analysis_type"] == NORMAL:
        zeta = float(mode.get("modal_damp_vis") or 0.0)
        return float(mode["freq"]), zeta if zeta > 0 else np.nan
    lam = complex(mode["eig"])
    size = abs(lam)
    return size / (2 * np.pi), -lam.real / size if size > 0 else np.nan
