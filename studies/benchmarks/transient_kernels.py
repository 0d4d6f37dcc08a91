"""Speed of the Newmark kernels on synthetic systems of the brake's size.

Run alone on an idle machine:  python studies/benchmarks/transient_kernels.py [--modes 555 170]
[--points 288] [--large] [--workers] [--dop853]

Seconds a design point for 1e5 steps of 1 us with the passes over the contact a step, single and in
batches, smooth and with stick-slip and lift-off; GB/s of the pass for one design against plain
reading of the same matrix; compilation apart. Medians of alternated runs, one core.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace

import numba
import numpy as np
import scipy.linalg as la
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

from squealstudy.kernels import newmark_layout as layout
from squealstudy.kernels.newmark_forces import pass_one
from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.motion.integrators.newmark import Newmark
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import KernelRun, simulate
from squealstudy.motion.system import (
    ModalSystem,
    MotionPoint,
    stick_number,
)

STEP = 1e-6
LEVELS = {"smooth": 0.05, "stick-slip": 0.6}  # m/s, largest relative velocity at the start
REPEATS = 3
WARM = "from squealstudy.motion.warmup import warm_kernels; print(warm_kernels({single}))"


def brake_like(n: int, nc: int, highest: float = 200e3) -> tuple[ModalSystem, MotionPoint]:
    """A frictional assembly in the coordinates of its closed reference, 10 bar, mu 0.5.

    Contact adds the same share to every mode's stiffness, which brings the stick number to the
    generated brake's (13 at 1 us on the coarse mesh).
    """
    rng = np.random.default_rng(3)
    w2 = (2 * np.pi * np.geomspace(800, highest, n)) ** 2
    area = rng.uniform(0.5, 1.5, nc) * 1e-2 / nc
    law = contact_law("exponential", p0=1e5, lam=5e5)
    p = rng.uniform(0.5, 1.5, nc) * 1e6
    k = area * p * law.value("contact.lambda")
    shapes = rng.normal(size=(3, nc, n)) * np.sqrt(0.04 * w2 / k.sum())
    values, phi = la.eigh(np.diag(w2) + shapes[0].T @ (k[:, None] * shapes[0]))
    N, T1, T2 = shapes @ phi
    mu, speed = 0.5, 0.5
    friction = FrictionLaw(mu, mu * p.max() / (0.02 * speed))
    gap = np.array([law.gap_at(x) for x in p])
    force = np.column_stack([area * p, -mu * area * p, 0 * p])
    one = np.ones(nc)
    system = ModalSystem(
        values, N, T1, T2, area, one, 0.1 * one, gap, k, force, sensed=np.arange(4) + 1
    )
    return system, MotionPoint(law, friction, speed, 0.01 * np.sqrt(values))


def kick(system: ModalSystem, level: float) -> np.ndarray:
    """Initial velocity, mostly below 4 kHz."""
    hertz = np.sqrt(system.omega2) / (2 * np.pi)
    v = np.random.default_rng(1).normal(size=system.n) / (1 + (hertz / 4e3) ** 3)
    return level * v / np.sqrt(((system.T1 @ v) ** 2 + (system.T2 @ v) ** 2).max())


def designs_of(design: MotionPoint, nb: int, v0: np.ndarray) -> list[MotionPoint]:
    friction = design.friction
    values = np.linspace(0.5, 0.4, nb)
    return [replace(design, friction=replace(friction, friction=m), v0=v0) for m in values]


def seconds(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def speeds(n: int, nc: int, steps: int, batches: list[int]) -> None:
    """Table of one size."""
    system, design = brake_like(n, nc)
    print(
        f"\n{n} modes, {nc} contact points, stick number {stick_number(system, design, STEP):.1f}"
    )
    forms = [(nb, single) for single in (False, True) for nb in (1, *batches)]
    print(
        f"{'':12}"
        + "".join(f"{nb:>8} {'f32' if s else 'f64'}" for nb, s in forms)
        + "   passes   stick    open"
    )
    for case, level in LEVELS.items():
        v0 = kick(system, level)
        times: dict[tuple[int, bool], list[float]] = {form: [] for form in forms}
        for _ in range(REPEATS):
            for nb, single in forms:
                settings = MotionSettings(steps * STEP, STEP, 10, Newmark(single_storage=single))
                began = time.perf_counter()
                results = simulate(system, designs_of(design, nb, v0), settings)
                took = time.perf_counter() - began
                if any(r.outcome != "ok" for r in results):
                    raise SystemExit(f"{case}: {[r.message for r in results]}")
                times[nb, single].append(took / nb * 1e5 / steps)
        row = "".join(f"{statistics.median(times[form]):12.2f}" for form in forms)
        first = results[0]
        stick, opened = (first.history[name].mean() for name in ("stick", "open"))
        print(f"{case:12}{row}{first.mean_iterations:9.2f}{stick:8.1%}{opened:8.1%}", flush=True)


@numba.njit(error_model="numpy")
def many_passes(B, modal, work, repeats):
    for _ in range(repeats):
        pass_one(B, modal, work, 0)


@numba.njit(error_model="numpy", fastmath=True)
def read(x, repeats):
    total = 0.0
    for _ in range(repeats):
        for j in range(x.size):
            total += x[j]
    return total


def plain_arrays(system: ModalSystem, design: MotionPoint, duration: float) -> tuple:
    """Arguments of the kernels."""
    settings = MotionSettings(duration, STEP, 0, Newmark(tangential_damping="never"))
    return KernelRun.of(system, [design], settings).arguments


def bandwidth(n: int, nc: int, repeats: int) -> None:
    """GB/s of the pass for one design and of reading B, alternated."""
    system, design = brake_like(n, nc)
    B, modal, _, work, _ = plain_arrays(system, design, STEP)
    flat = B.reshape(-1)
    many_passes(B, modal, work, 1)
    read(flat, 1)
    passes, reads = [], []
    for _ in range(7):
        passes.append(seconds(lambda: many_passes(B, modal, work, repeats)))
        reads.append(seconds(lambda: read(flat, repeats)))
    ours, plain = (B.nbytes * repeats / statistics.median(t) / 1e9 for t in (passes, reads))
    share = 100 * ours / plain
    print(
        f"B of {n} x {nc} ({B.nbytes / 1e6:.1f} MB): pass {ours:.1f} GB/s, "
        f"reading {plain:.1f} GB/s, {share:.0f} %"
    )


@numba.njit(error_model="numpy")
def rate(y, B, modal, work):
    """Right-hand side of y = (q, v) by the same pass."""
    x, modes = work.x[0], modal.modes[0]
    n = y.size // 2
    for j in range(n):
        x[layout.Q_TRIAL, j] = y[j]
        x[layout.V_TRIAL, j] = y[n + j]
    pass_one(B, modal, work, 0)
    dy = np.empty_like(y)
    for j in range(n):
        dy[j] = y[n + j]
        dy[n + j] = x[layout.FORCE, j] + modes[2, j] - modes[1, j] * y[n + j] - modes[0, j] * y[j]
    return dy


def against_dop853(n: int = 100, nc: int = 50, duration: float = 5e-3) -> None:
    """Time of both at the error of Newmark at 1 us, pre-warped."""
    system, design = brake_like(n, nc)
    design = replace(design, friction=replace(design.friction, regularisation="smooth"))
    settings = MotionSettings(duration, STEP, 0, Newmark(prewarp=True))
    B, modal, _, work, _ = plain_arrays(system, design, duration)
    v0 = kick(system, LEVELS["stick-slip"])
    design = replace(design, v0=v0)

    def dop853(rtol: float) -> np.ndarray:
        start = np.concatenate([0 * v0, v0])
        solution = solve_ivp(
            lambda t, y: rate(y, B, modal, work),
            (0.0, duration),
            start,
            "DOP853",
            rtol=rtol,
            atol=rtol * 1e-3 * np.concatenate([np.abs(v0).max() / 1e4 + 0 * v0, 1 + 0 * v0]),
            t_eval=[duration],
        )
        return solution.y[n:, -1]

    exact = dop853(1e-11)
    simulate(system, [design], replace(settings, duration=STEP))
    ours = simulate(system, [design], settings)[0].v
    error = la.norm(ours - exact) / la.norm(exact)
    rtol = 1e-1
    while la.norm(dop853(rtol) - exact) / la.norm(exact) > error and rtol > 1e-10:
        rtol /= 3
    pairs = [
        (
            seconds(lambda: simulate(system, [design], settings)),
            seconds(lambda: dop853(rtol)),
        )
        for _ in range(REPEATS)
    ]
    newmark, other = (statistics.median(t) for t in zip(*pairs, strict=True))
    print(
        f"\n{n} modes, {nc} points, {duration * 1e3:g} ms: Newmark at 1 us {newmark:.3f} s with "
        f"error {error:.1e}; DOP853 to the same error (rtol {rtol:.0e}) {other:.3f} s, "
        f"{other / newmark:.1f} times as long"
    )


def compilation() -> None:
    """Seconds to compile into an empty cache, and to load from it."""
    for single in (False, True):
        with tempfile.TemporaryDirectory() as cache:
            environment = os.environ | {"SQUEALSTUDY_CACHE": cache}
            command = [sys.executable, "-c", WARM.format(single=single)]
            times = [
                float(subprocess.check_output(command, env=environment, text=True))
                for _ in range(2)
            ]
        forms = "f64 and f32" if single else "f64"
        print(f"kernels ({forms}): compiled in {times[0]:.1f} s, loaded in {times[1]:.1f} s")


def workers(n: int, nc: int, steps: int) -> None:
    """Two processes against one, each with the same batch of 8."""
    job = [sys.executable, __file__, "--job", str(n), str(nc), str(steps)]
    alone, together = [], []
    for _ in range(REPEATS):
        alone.append(float(subprocess.check_output(job, text=True)))
        pair = [subprocess.Popen(job, stdout=subprocess.PIPE, text=True) for _ in range(2)]
        together.append(max(float(p.communicate()[0]) for p in pair))
    gain = 2 * statistics.median(alone) / statistics.median(together)
    print(f"\ntwo processes, {n} modes, batches of 8: {gain:.2f} times one")


def job(n: int, nc: int, steps: int) -> float:
    """Seconds of a batch of 8."""
    system, design = brake_like(n, nc)
    v0 = kick(system, LEVELS["stick-slip"])
    settings = MotionSettings(STEP, STEP, 10)
    simulate(system, designs_of(design, 8, v0), settings)
    longer = replace(settings, duration=steps * STEP)
    return seconds(lambda: simulate(system, designs_of(design, 8, v0), longer))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--modes", type=int, nargs="+", default=[555, 170])
    parser.add_argument("--points", type=int, default=288)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--batches", type=int, nargs="*", default=[4, 8, 16])
    parser.add_argument("--large", action="store_true", help="the pass over 69 MB, too")
    parser.add_argument("--dop853", action="store_true", help="the comparison with scipy")
    parser.add_argument("--workers", action="store_true", help="two processes against one")
    parser.add_argument("--compile", action="store_true", help="into empty caches, too")
    parser.add_argument("--job", type=int, nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    with threadpool_limits(1):
        if chosen.job:
            print(job(*chosen.job))
            return
        for n in chosen.modes:
            job(n, chosen.points, 2)
            speeds(n, chosen.points, chosen.steps, chosen.batches)
            bandwidth(n, chosen.points, 50)
        if chosen.large:
            bandwidth(1200, 2400, 3)
        if chosen.dop853:
            against_dop853()
        if chosen.workers:
            workers(chosen.modes[0], chosen.points, chosen.steps)
        if chosen.compile:
            compilation()


if __name__ == "__main__":
    main()
