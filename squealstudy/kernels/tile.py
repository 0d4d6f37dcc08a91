"""Products of one tile of the observation matrix, with one design point or with eight at once.

A tile holds the rows of POINTS contact points mode by mode, (n, ROWS): N of all points, then T1,
then T2; n is a multiple of LANES. numba has no vector registers and LLVM does not find these
forms by itself, so `tile_code` writes them as LLVM instructions; below is what they mean, which
also runs where the compiler is switched off.

For one design the lanes of a register are the points of a tile, and a tile is read as one stream.
For eight they are the designs: each entry is read once and multiplied with all of them, at the
rate of the processor's multiply-adds (studies/benchmarks/transient_kernels.py).
"""

from __future__ import annotations

import numba
import numpy as np
from numba.extending import intrinsic

from squealstudy.kernels import tile_code
from squealstudy.kernels.tile_code import LANES, POINTS, ROWS

__all__ = ["LANES", "POINTS", "ROWS", "observe_eight", "observe_one", "spread_eight", "spread_one"]


def observe_one(tile: np.ndarray, q: np.ndarray, v: np.ndarray, y: np.ndarray) -> None:
    """Y (ROWS,) = [N q; T1 v; T2 v] of a tile (n, ROWS), f8 or f4; all others f8, q, v (n,)."""
    y[:POINTS] = tile[:, :POINTS].T @ q
    y[POINTS:] = tile[:, POINTS:].T @ v


def spread_one(tile: np.ndarray, r: np.ndarray, F: np.ndarray) -> None:
    """F (n,) += tile r with the forces r (ROWS,)."""
    F += tile @ r


def observe_eight(tile: np.ndarray, q: np.ndarray, v: np.ndarray, y: np.ndarray) -> None:
    """Y (LANES, ROWS) = [N q; T1 v; T2 v] of the designs in the lanes of q, v (n, LANES)."""
    y[:, :POINTS] = q.T @ tile[:, :POINTS]
    y[:, POINTS:] = v.T @ tile[:, POINTS:]


def spread_eight(tile: np.ndarray, r: np.ndarray, F: np.ndarray) -> None:
    """F (n, LANES) += tile r^T with the forces r (LANES, ROWS)."""
    F += tile @ r.T


if not numba.config.DISABLE_JIT:
    observe_one = intrinsic(tile_code.observe_one)
    spread_one = intrinsic(tile_code.spread_one)
    observe_eight = intrinsic(tile_code.observe_eight)
    spread_eight = intrinsic(tile_code.spread_eight)
