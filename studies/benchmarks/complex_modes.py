"""Time and error of the complex-mode sweep on the medium brake, stage by stage.

Run alone on an idle machine:  python studies/benchmarks/complex_modes.py [--mesh coarse]
      --top 8000 --states 8     of the band, in Hz; how many of the states

Prints seconds of each stage (compilation excluded; design points as the median of several, one
BLAS thread) and the error of the reduced model against the full-order model at states away from
where the basis was made. "Light" modes: |damping ratio| < 5 %.
"""

from __future__ import annotations

import argparse
import statistics
import time

import numpy as np
from threadpoolctl import threadpool_limits

from squealstudy.laws import contact_law
from squealstudy.machine.resources import peak_memory_mb
from squealstudy.models.catalogue import MODELS
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.full_order.modes import full_order_modes
from squealstudy.modes.point import solve_point, state_working_point
from squealstudy.reduction.cmt import ReductionSettings, component_modes
from squealstudy.reduction.prepared import prepare
from squealstudy.root_pairs import paired_with_full_order

BOTTOM = 500.0  # Hz
GROUP = ("caliper", 7), ("caliper", 8), ("caliper", 9)
REPEATS = 5


def at(pressure: float, friction: float, **changes: dict) -> DesignState:
    return DesignState(OperatingPoint(friction, pressure, 0.5, contact_law()), **changes)


STATES = {
    "nominal 12 bar, mu 0.5": at(12e5, 0.5),
    "2 bar, mu 0.5": at(2e5, 0.5),
    "30 bar, mu 0.5": at(30e5, 0.5),
    "30 bar, mu 0.7": at(30e5, 0.7),
    "12 bar, mu 0": at(12e5, 0.0),
    "caliper 7-9 frequency -50 %": at(12e5, 0.5, frequency_scale=dict.fromkeys(GROUP, 0.5)),
    "caliper 7-9 frequency +50 %": at(12e5, 0.5, frequency_scale=dict.fromkeys(GROUP, 1.5)),
    "caliper 7-9 damping 50 %": at(12e5, 0.5, mode_damping=dict.fromkeys(GROUP, 0.5)),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh", default="medium", choices=["coarse", "medium", "fine"])
    parser.add_argument("--top", type=float, default=8000.0, help="Hz")
    parser.add_argument("--states", type=int, default=len(STATES), help="how many of them")
    arguments = parser.parse_args()
    mesh, band, cutoff = arguments.mesh, (BOTTOM, arguments.top), 1.5 * arguments.top
    settings = ReductionSettings(cutoff, cutoff, 1.125 * arguments.top, 3e-5)
    brake = MODELS["disc_brake"]
    options = {o.name: o.choices[0] for o in brake.options} | {"mesh": mesh}
    contact_law().evaluate(np.zeros(1))  # compile

    started = time.perf_counter()
    assembly = brake.build(options, brake.defaults())
    print(f"{mesh} brake, {assembly.n_dof} DOF, {assembly.contact.n_points} contact points")
    print(f"assembly             {time.perf_counter() - started:8.2f} s")
    nominal = STATES["nominal 12 bar, mu 0.5"].operating
    training = [STATES[s].operating for s in ("2 bar, mu 0.5", "30 bar, mu 0.5")]
    started = time.perf_counter()
    prepared = prepare(assembly, nominal, settings, training)
    total = time.perf_counter() - started
    for stage, seconds in prepared.timings.items():
        print(f"  {stage.removesuffix('_s'):18s} {seconds:8.2f} s")
    print(f"reduction in all     {total:8.2f} s, {prepared.model.n} DOF")
    modes = component_modes(assembly, cutoff)
    with threadpool_limits(1):
        _points(prepared, band, list(STATES.values())[: min(arguments.states, 4)])
        print(f"\nagainst the full-order model, light modes in {BOTTOM:g} to {arguments.top:g} Hz")
        print(f"{'state':30s}{'modes':>6s}{'df/f':>10s}{'d zeta':>10s}{'missed':>8s}{'full s':>8s}")
        for name, state in list(STATES.items())[: arguments.states]:
            reduced = solve_point(prepared, state, band)
            started = time.perf_counter()
            full = full_order_modes(prepared, assembly, modes, state, band, cutoff)
            seconds = time.perf_counter() - started
            pairs = paired_with_full_order(reduced.lam, full.lam)
            print(
                f"{name:30s}{len(full.lam):6d}{pairs.frequency_error:10.1e}{pairs.damping_error:10.1e}"
                f"{pairs.missed:8d}{seconds:8.1f}"
            )
    print(f"\npeak memory {peak_memory_mb() / 1024:.2f} GB")


def _points(prepared, band: tuple[float, float], states: list[DesignState]) -> None:
    working, point = [], []
    for state in states * REPEATS:
        started = time.perf_counter()
        state_working_point(prepared, state)
        working.append(time.perf_counter() - started)
        started = time.perf_counter()
        solve_point(prepared, state, band)
        point.append(time.perf_counter() - started)
    for name, values in (("working point", working), ("design point", point)):
        print(
            f"{name:20s} {statistics.median(values):8.3f} s median, "
            f"{min(values):.3f} to {max(values):.3f}, one core"
        )


if __name__ == "__main__":
    main()
