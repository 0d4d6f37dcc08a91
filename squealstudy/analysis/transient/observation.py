"""The observation matrix as the Newmark kernels want it: aligned, padded, in tiles."""

from __future__ import annotations

import math

import numpy as np

from squealstudy.analysis.transient.system import ModalSystem
from squealstudy.kernels import tile

ALIGNMENT = 64  # bytes: a cache line, and the widest vector register


def padded(n: int) -> int:
    """Modes rounded up to whole vector registers."""
    return -(-n // tile.LANES) * tile.LANES


def aligned_zeros(*shape: int, dtype: type[np.floating] = np.float64) -> np.ndarray:
    """Zeros whose rows begin at cache lines where the last dimension fills whole ones."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = np.zeros(size + ALIGNMENT, dtype=np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    aligned: np.ndarray = raw[start : start + size].view(dtype).reshape(shape)
    return aligned


def observation(system: ModalSystem, single_storage: bool) -> np.ndarray:
    """B (nt, padded n, ROWS), tile by tile of contact points, mode by mode; made once a system."""
    dtype = np.float32 if single_storage else np.float64
    if dtype not in system.tiles:
        system.tiles[dtype] = _tiles(system, dtype)
    return system.tiles[dtype]


def _tiles(system: ModalSystem, dtype: type[np.floating]) -> np.ndarray:
    nc, P = len(system.area), tile.POINTS
    tiles = aligned_zeros(-(-nc // P), padded(system.n), tile.ROWS, dtype=dtype)
    for k, part in enumerate((system.N, system.T1, system.T2)):
        for t in range(len(tiles)):
            block = part[t * P : (t + 1) * P]
            tiles[t, : system.n, k * P : k * P + len(block)] = block.T
    return tiles
