"""Work and precision of every integrator on synthetic systems of the brake's size.

Run alone on an idle machine:  python studies/benchmarks/integrators.py [--modes 100] [--points 50]
[--duration 2e-3] [--steps 0.25 0.5 1 2 4] [--methods newmark exponential] [--case smooth]

For each method and step: error of the end velocities and of the torque's RMS against a tight
DOP853, evaluations of the contact forces a step, processor time a step and of the run (the fastest
of a few). Compilation apart. `smooth` slides everywhere, `stick-slip` sticks and lifts off.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits
from transient_kernels import LEVELS, brake_like, kick, stick_number

from squealstudy.laboratory import integrators as compared
from squealstudy.motion.integrator import integrator, integrators
from squealstudy.motion.motion import Motion
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint

REPEATS = 3
INTEGRATORS = integrators()
assert compared.__name__  # it brings the laboratory's
ADAPTIVE = ("dop853", "radau", "bdf", "lsoda")
RTOLS = (1e-3, 1e-5, 1e-7)
ROWS = 8e-6  # s between rows of the histories
VARIANTS = {  # options beyond the defaults that are worth a line
    "newmark": ({}, {"prewarp": True}, {"tangential_damping": "never"}, {"extrapolate": False}),
    "generalised_alpha": ({}, {"tangential_damping": "never"}),
    "exponential": ({}, {"tangential_damping": "never"}, {"exact_limit": 1e9}),
    "central_difference": ({}, {"velocity": "lagged"}),
}


class Case:
    """One system at one level of motion, with its reference."""

    def __init__(self, n: int, nc: int, level: float, duration: float) -> None:
        self.system: ModalSystem
        self.design: MotionPoint
        self.system, self.design = brake_like(n, nc)
        self.v0 = kick(self.system, level)
        self.duration = duration
        self.reference = self.run("dop853", 1e-6, {"rtol": 1e-11})
        check = self.run("dop853", 1e-6, {"rtol": 1e-9})
        self.trust = self.error(check)

    def run(self, name: str, step: float, options: dict) -> Motion:
        every = max(1, round(ROWS / step))
        settings = MotionSettings(self.duration, step, every, integrator(name, options))
        return simulate(self.system, [replace(self.design, v0=self.v0)], settings)[0]

    def error(self, r: Motion) -> float:
        """Relative error of the end velocities."""
        wanted = self.reference.v
        return float(np.linalg.norm(r.v - wanted) / np.linalg.norm(wanted))

    def row(self, name: str, step: float, options: dict) -> str:
        self.run(name, step, options)  # compiles
        times = []
        for _ in range(REPEATS):
            began = time.process_time()
            r = self.run(name, step, options)
            times.append(time.process_time() - began)
        took, steps = min(times), max(r.steps, 1)
        rms = r.history["torque"].std() / self.reference.history["torque"].std() - 1
        measured = f"{self.error(r):9.1e} {rms:9.1e}" if r.outcome == "ok" else f"{r.outcome:>19}"
        return (
            f"{measured} {r.mean_iterations:7.2f} {took / steps * 1e6:9.1f} {took:9.3f} "
            f"{r.halvings:5d}"
        )


def table(case: Case, methods: list[str], steps: list[float]) -> None:
    print(f"{'':62} error  RMS error evals/s  us/step  seconds halved")
    for name in methods:
        for options in VARIANTS.get(name, ({},)):
            if name in ADAPTIVE:
                for rtol in RTOLS:
                    print(f"{name:22}{f'rtol {rtol:.0e}':40}{case.row(name, 1e-6, {'rtol': rtol})}")
                continue
            text = " ".join(f"{k} {v}" for k, v in options.items())
            for h in steps:
                print(
                    f"{name:22}{text:28}{h * 1e6:8.2f} us {case.row(name, h, options)}", flush=True
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--modes", type=int, default=100)
    parser.add_argument("--points", type=int, default=50)
    parser.add_argument("--duration", type=float, default=2e-3)
    parser.add_argument("--steps", type=float, nargs="+", default=[0.25, 0.5, 1, 2, 4])
    parser.add_argument("--methods", nargs="+", default=list(INTEGRATORS), choices=INTEGRATORS)
    parser.add_argument("--case", nargs="+", default=list(LEVELS), choices=LEVELS)
    chosen = parser.parse_args()
    with threadpool_limits(1):
        for name in chosen.case:
            case = Case(chosen.modes, chosen.points, LEVELS[name], chosen.duration)
            history = case.reference.history
            print(
                f"\n{chosen.modes} modes, {chosen.points} points, {name}: stick "
                f"{history['stick'].mean():.1%}, open {history['open'].mean():.1%}, stick number "
                f"{stick_number(case.system, case.design, 1e-6):.1f} at 1 us, reference to "
                f"{case.trust:.0e}"
            )
            table(case, chosen.methods, [1e-6 * h for h in chosen.steps])


if __name__ == "__main__":
    main()
