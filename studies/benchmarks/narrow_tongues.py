"""Wrong nodes of random maps with narrow tongues, and what they cost.

Run:  python studies/benchmarks/narrow_tongues.py --seed 2026 --maps 30

Families of `tests/tongues.py`: two oscillators as Hulten's, or three to five coupled modes, over
friction and a tuned frequency, on grids of 65 x 49 nodes (5 x 4, 4 levels). Truth: eigenvalues at
every node. `dampings` halves cells by the damping at their nodes alone; `both` by modes that pass
each other, too, as boundary designs do; `least` halves the cells in which the truth changes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from tongues import every_node, families, grid_of, solved_nodes, wrong_nodes

from squealstudy.kinds.complex_modes.boundary import BoundaryGrid


def least_points(grid: BoundaryGrid, truth: np.ndarray) -> int:
    """Nodes of the cells in which the truth is not the same at all nodes, halved to the end."""
    cells, nodes = grid.coarse_cells(), set(grid.coarse_nodes())
    while cells:
        cell = cells.pop()
        box = truth[tuple(slice(c, c + cell.stride + 1) for c in cell.corner)]
        if cell.stride > 1 and box.min() != box.max():
            nodes |= set(cell.nodes(cell.stride // 2))
            cells += cell.halves()
    return len(nodes)


def main() -> None:
    """Solve, compare, print a line a map and the sums."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--maps", type=int, default=30)
    arguments = parser.parse_args()
    grid = grid_of((5, 4), 4)
    print("map  unstable nodes   points: least, dampings, both   wrong nodes: dampings, both")
    rows = []
    for k, family in enumerate(families(arguments.seed, arguments.maps)):
        truth = every_node(family, grid)
        found = [solved_nodes(family, grid, passing) for passing in (False, True)]
        wrong = [wrong_nodes(known, grid, truth) for known in found]
        rows.append([int((truth > 0).sum()), least_points(grid, truth), *map(len, found), *wrong])
        print(k, *rows[-1], flush=True)
    table = np.array(rows)
    right = table[:, 4] == 0
    print("sums", *table.sum(axis=0))
    print("maps with wrong nodes", *(table[:, 4:] > 0).sum(axis=0))
    print("points of maps that dampings alone have right", *table[right, 1:4].sum(axis=0))


if __name__ == "__main__":
    main()
