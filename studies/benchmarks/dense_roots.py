"""The exact dense rung against LAPACK's `geev`, on random problems: nothing missed or doubled.

Run:  python studies/benchmarks/dense_roots.py --points 5000
      --quick     a tenth of them

The kinds (tests/random_quadratics.py) are brakes with rigid modes, pairs about coalescence,
overdamped and critically damped modes, unsymmetric, gyroscopic, free, repeated, crowded, empty and
very stiff ones. For each kind: problems, those that the faster way handed back to `geev`, those
whose roots differ by more than their errors, roots beyond 1e-10 of their twin (they are next to a
coalescence), all roots, and CPU seconds of both.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import one_thread  # noqa: F401

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import numpy as np
from random_quadratics import KINDS, difference, random_problem

from squealstudy.linalg.dense_qep import (
    companion_roots,
    dense_roots,
    roots_inside,
)

SIZES = (64, 90, 120, 160)  # coordinates
WELL = 1e-10  # relative differences below are those of well-conditioned roots


def main() -> None:
    """Solve, compare, tell."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=5000)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    points = arguments.points // 10 if arguments.quick else arguments.points
    columns = ("problems", "to geev", "differ", "beyond 1e-10", "roots", "geev s", "ours s")
    table = {kind.__name__: np.zeros(len(columns)) for kind in KINDS}
    for number in range(points):
        row = table[KINDS[number % len(KINDS)].__name__]
        problem = random_problem(number, SIZES[number // len(KINDS) % len(SIZES)])
        clock = [time.process_time()]
        exact, _ = companion_roots(*problem)
        clock.append(time.process_time())
        lam, _ = dense_roots(*problem)
        clock.append(time.process_time())
        wrong = difference(problem, lam)
        if wrong:
            print(f"{number} {KINDS[number % len(KINDS)].__name__}: {wrong}", flush=True)
        back = roots_inside(problem.C, problem.K, problem.band[1]) is None
        far = sum(np.abs(exact - x).min(initial=np.inf) > WELL * abs(x) for x in lam)
        row += [1, back, bool(wrong), far, len(lam), *np.diff(clock)]
    print(f"{'kind':<12}" + "".join(f"{c:>14}" for c in columns))
    for kind, row in [*table.items(), ("all", sum(table.values()))]:
        counts = "".join(f"{int(x):>14}" for x in row[:5])
        print(f"{kind:<12}{counts}" + "".join(f"{x:>14.1f}" for x in row[5:]))


if __name__ == "__main__":
    main()
