"""The ladder of reanalysis: error against time per point for every rung, on the brake and on M0.

Run:  python studies/benchmarks/reanalysis.py --mesh medium --top 16000 --box mu --points 24
      --box mu | scale | damping     friction 0 to 0.7; the frequency of a component mode by 0.5 to
                                     1.5; its damping 0 to 10 %
      --box map | box                friction and pressure 2 to 30 bar at once; and sliding speed
                                     0.1 to 3 m/s too
      --m0                           the brake M0 over disc speed instead
      --quick                        few points, loose tolerances
      --tolerances 1e-4 1e-5         of the bases and windows
      --study N                      time N random points as a study too, patches counted

One process, one thread; times are of the processor, all rungs in turn at each point. Points are
random, no basis was trained on them. Milliseconds are medians a point: of the roots alone (values),
with right and left vectors, with the estimate of their errors besides. Working points are apart,
and so is what is paid once (set-up). `x dense` compares with the exact rung, which finds the roots
of the band with right vectors; `x geev` with all values by LAPACK, no vectors. Light modes have
|zeta| < 5 %; `heavy` is the largest relative error of all the others, overdamped roots among them;
`missed` counts light modes that are more than 1 % off; <=2x and <=5x are the shares of light modes
whose true error is within so many estimates.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import one_thread  # noqa: F401

# isort: split

import numpy as np
from reanalysis_rungs import m0, measure, picture, rungs
from reanalysis_rungs.brake import BOXES, brake_problem

from squealstudy.modes.reanalysis.problem import Linearisation

TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6)
MOST = {1: 8, 2: 16, 3: 16}  # design points that a sweep basis may use


def brake(arguments: argparse.Namespace) -> None:
    """All rungs over one box of the generated brake."""
    problem = brake_problem(arguments.mesh, arguments.top, arguments.box)
    d = problem.dimension
    theta = np.random.default_rng(2024).uniform(-1, 1, (arguments.points, d))
    _, setup = measure.timed(lambda: problem.field)
    samples, ms = measure.timed(lambda: problem.samples(theta))
    kept = [i for i, s in enumerate(samples) if isinstance(s, Linearisation)]
    weights = [samples[i].weights for i in kept]
    print(
        f"{arguments.mesh} brake, {problem.system.n} coordinates, box '{arguments.box}', "
        f"{len(kept)} points of {len(theta)}; working points: set-up {setup / 1e3:.1f} s, "
        f"{ms / len(theta):.2f} ms a point"
    )
    points = rungs.exact_points(problem, theta[kept], weights)
    ways = [rungs.geev(problem, points), rungs.dense(problem, points)]
    ways += [rungs.two_step(problem, points, factor) for factor in (1.0, 2.0, 3.0)]
    ways += [rungs.perturbation(problem, points, order) for order in (1, 2)]
    studies = []
    for tolerance in arguments.tolerances:
        basis, projected = rungs.sweep_basis(problem, points, tolerance / 3, MOST[d])
        ways += [projected, rungs.windows(problem, basis, points, tolerance)]
        if arguments.study:
            many = np.random.default_rng(7).uniform(-1, 1, (arguments.study, d))
            each, served = rungs.whole_study(problem, basis, many, tolerance)
            studies.append(f"study at {tolerance:.0e}: {each:.2f} ms a point, {served}")
    for i in range(len(kept)):
        for way in ways:
            way.at(i)
    geev, dense, *_ = rows = [way.row for way in ways]
    print(measure.HEAD)
    for row in rows:
        print(measure.line(row, dense.vectors_ms, geev.cheapest_ms))
    print("\n".join(studies))
    marks = [(r.name, r.vectors_ms, r.error) for r in rows[2:]]
    path = arguments.out / f"reanalysis_{arguments.mesh}_{arguments.top:.0f}_{arguments.box}.png"
    title = f"{arguments.mesh} brake to {arguments.top / 1e3:g} kHz: {arguments.box}"
    picture.draw(marks, title, "largest error of light modes, df/f or dzeta", path)
    print(path)


def m0_brake(arguments: argparse.Namespace) -> None:
    """M0 over 2 pi to 40 pi rad/s."""
    brake = m0.M0(3 if arguments.quick else 10)
    exact, full_ms = brake.exact
    print(f"M0: {brake.family.n} coordinates, full order {full_ms:.0f} ms a point, ", end="")
    print(f"{[len(lam) for lam in exact]} roots in the published region")
    print(m0.HEAD)
    rows = []

    def add(*more: m0.M0Row | None) -> None:
        for row in more:
            if row is not None:
                rows.append(row)
                print(row, flush=True)

    for count in (3,) if arguments.quick else (3, 5, 9):
        by_log = np.geomspace(m0.LOW, m0.HIGH, count)
        for d in (40, 75, 85, 120, 160, 220):
            if not arguments.quick:
                add(brake.pod(np.linspace(m0.LOW, m0.HIGH, count), d, "POD equidistant speeds"))
            add(brake.pod(by_log, d, "POD logarithmic speeds"))
    for tolerance in (1e-3,) if arguments.quick else (1e-4, 1e-6, 1e-8):
        add(*brake.windows(tolerance, 3 if arguments.quick else 12))
    faster(rows)
    marks = [(r.name, float(np.median(r.ms)), r.error) for r in rows]
    path = arguments.out / "reanalysis_m0.png"
    title = "brake M0 over disc speed, published region"
    picture.draw(marks, title, "largest error over the largest modulus", path)
    print(path)


def faster(rows: list[m0.M0Row]) -> None:
    """Each rung beside the fastest POD that is at least as accurate."""
    pods = [r for r in rows if r.name.startswith("POD")]
    for row in rows:
        rivals = [np.median(p.ms) for p in pods if p.error <= row.error]
        if row not in pods:
            ratio = f"{min(rivals) / np.median(row.ms):.1f}x" if rivals else "no POD gets there"
            print(f"{row.name}, d = {row.d}, {row.speeds} speeds, {row.error:.0e}: {ratio}")


def main() -> None:
    """Read the arguments, run, print, plot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", choices=("coarse", "medium"), default="coarse")
    parser.add_argument("--top", type=float, default=8000.0, help="Hz, top of the band")
    parser.add_argument("--points", type=int, default=24)
    parser.add_argument("--box", choices=tuple(BOXES), default="mu")
    parser.add_argument("--m0", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--tolerances", type=float, nargs="+")
    parser.add_argument("--study", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("results") / "reanalysis")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.points = min(arguments.points, 4)
    arguments.tolerances = arguments.tolerances or (
        TOLERANCES[:2] if arguments.quick else TOLERANCES
    )
    if arguments.m0:
        m0_brake(arguments)
    else:
        brake(arguments)


if __name__ == "__main__":
    main()
