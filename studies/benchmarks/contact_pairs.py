"""Contact between meshes that do not match: how uniform a pressure comes over, and what it costs.

Run:  python studies/benchmarks/contact_pairs.py
      --quick     two pairs of blocks in the first table, a ninth of the facets in the second

The first table: two elastic blocks on each other (tests/touching.py), pressed by 1 Pa; largest
error of the contact pressures by Gauss points and by clipped segments, with the pieces of a curved
edge and the degree of the quadrature in brackets. `sector` is half a radian of a ring, where the
finer mesh reaches over the coarser one's outline; `missed` is that share of the slave's area. The
second: CPU seconds to pair 8,600 with 10,000 facets, after kernels are compiled.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import one_thread  # noqa: F401

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from touching import patch, plane, sector

from squealstudy.models.components.pairs import pair

PATCHES = [  # upper, lower, whether curved
    (("hex20", (7, 6)), ("hex20", (5, 6)), None),
    (("hex20", (2, 2)), ("hex20", (6, 6)), None),
    (("hex20", (6, 6)), ("hex20", (2, 2)), None),
    (("hex8", (5, 4)), ("hex8", (3, 7)), None),
    (("tet10", (4, 3)), ("hex20", (3, 5)), None),
    (("hex20", (4, 3)), ("tet10", (3, 5)), None),
    (("hex20", (7, 6)), ("hex20", (5, 6)), sector),
    (("hex20", (14, 12)), ("hex20", (10, 12)), sector),
    (("hex20", (4, 3)), ("tet10", (3, 5)), sector),
    (("hex20", (3, 3)), ("hex20", (9, 9)), sector),
    (("hex20", (9, 9)), ("hex20", (3, 3)), sector),
]
QUICK = [PATCHES[1], PATCHES[3]]  # of few elements
SETTINGS = ((4, 4), (4, 8), (8, 8))
TIMED = [(8, 8, sector), (8, 8, None), (6, 8, sector), (4, 4, None), (3, 3, None)]


def cells(kind: int, across: int, along: int) -> tuple[int, int]:
    """Cells of a plane: two triangles lie in each."""
    return (across, along // 2) if kind in (3, 6) else (across, along)


def main() -> None:
    """Press, pair, tell."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    part, patches = (3, QUICK) if quick else (1, PATCHES)
    heads = "".join(f"clipped {s!s:8}" for s in SETTINGS)
    print(f"{'slave':14}{'master':15}{'shape':8}{'gauss':9}{heads}missed")
    for upper, lower, warp in patches:
        errors = [patch(upper, lower, warp, quadrature="gauss")[0]]
        for pieces, degree in SETTINGS:
            error, p = patch(upper, lower, warp, pieces=pieces, degree=degree)
            errors.append(error)
        names = "".join(f"{e} {n[0]}x{n[1]}".ljust(14) for e, n in (upper, lower))
        found = f"{errors[0]:<9.1e}" + "".join(f"{e:<16.1e}" for e in errors[1:])
        missed = max(1 - p.in_reach, 0.0)
        print(f"{names} {'sector' if warp else 'square':8}{found}{missed:.0e}", flush=True)
    print(f"\n{'nodes':9}{'shape':8}{'facets':15}{'gauss':20}clipped")
    for kind, other, warp in TIMED:
        slave = plane(kind, cells(kind, 100 // part, 86 // part), up=False, warp=warp)
        master = plane(other, cells(other, 125 // part, 80 // part), up=True, warp=warp)
        found = ""
        for quadrature in ("gauss", "clipped"):
            pair(slave, master, search=1e-3, quadrature=quadrature)
            start = time.process_time()
            p = pair(slave, master, search=1e-3, quadrature=quadrature)
            spent = time.process_time() - start
            found += f"{spent:.2f} s, {len(p.gap0)} points".ljust(22)
        sizes = f"{len(slave.kinds)} on {len(master.kinds)}"
        shape = "sector" if warp else "square"
        print(f"{kind} on {other:<5}{shape:8}{sizes:16}{found}", flush=True)


if __name__ == "__main__":
    main()
