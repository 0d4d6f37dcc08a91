"""Hybrid against modal on the coarse brake: size, time, solves, growth rate, limit cycle.

Run:  python studies/benchmarks/hybrid.py --limit-cycle 0.04     (about five minutes)
      --layers 1 --traces 12e3 --joint        what the hybrid basis keeps; traces together
      --damped 12e3 --beyond 0.01 --flat      damping, see below
      --growth 4e-3 --step 2e-6 --speed 0.02  durations, step and perturbation
      --only modal plain hybrid               representations
      --above                                 full-order growth above the band, undamped
      --top 8e3                               of the band of the modal representations, in Hz

Both representations have 144 contact points (contact_points = 2), 12 bar, friction 0.5, sliding
0.5 m/s, k_t = mu max(p) / (0.02 speed) per area and structural damping of 0.5 % on all modes up to
`--damped` Hz; beyond, it rises with frequency from `--beyond`. With 0.5 % there too the full-order
brake squeals at 29 kHz. `--flat` leaves 0.5 % on all coordinates of the modal representations.

Growth is that of the modal energy of a run that starts on the fastest growing complex mode of the
enriched modal model. The limit cycle starts there too, with `--speed` m/s at the contact point
that moves most, from one and the same full-order state for all; torque figures are of the last 40 %
of the run. `plain` is the modal representation without enrichment (load_cutoff = 0).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from squealstudy.laws import FrictionLaw, contact_law
from squealstudy.models.catalogue import MODELS
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.motion.growing_modes import growing_modes
from squealstudy.motion.hybrid_arrays import uniform_damping
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import shared_modes
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import MotionPoint
from squealstudy.reduction.cmt import ReductionSettings, component_modes, reduce_cmt
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.hybrid import HybridSettings, assembly_stiffness, hybrid_model
from squealstudy.reduction.prepared import mean_contact_stiffness, mode_shapes
from squealstudy.reduction.working_point import working_point

ZETA = 0.005
SPEED = 0.5  # m/s
NOMINAL = OperatingPoint(0.5, 12e5, SPEED, contact_law())
CUTOFF, LOAD_CUTOFF = 1.5, 1.125  # times the top of the band
TOLERANCE = 1e-4
LAST = 0.4  # of a run, for the figures of the torque


@dataclass(frozen=True)
class Representation:
    """A name, its number of coordinates, how to run it and how to read a full-order state."""

    name: str
    n: int
    run: Callable
    restrict: Callable


def main() -> None:
    options = arguments()
    started = time.perf_counter()
    definition = MODELS["disc_brake"]
    chosen = {o.name: o.choices[0] for o in definition.options}
    chosen |= {"mesh": "coarse", "contact_points": 2}
    assembly = definition.build(chosen, definition.defaults())
    cutoff = CUTOFF * options.top
    modes = component_modes(assembly, cutoff)
    shapes = mode_shapes(assembly, modes)
    space = contact_space(assembly, mean_contact_stiffness(assembly, NOMINAL), shapes)
    point = working_point(space, NOMINAL)
    if options.above:
        print_above(assembly, point)
    friction = FrictionLaw(0.5, 0.5 * point.contact_pressure.max() / (0.02 * SPEED))
    print(f"brake and working point: {time.perf_counter() - started:.0f} s", flush=True)
    found = {}
    lam, u, v = 0j, np.zeros(0), np.zeros(0)
    for name, load_cutoff in (("modal", LOAD_CUTOFF * options.top), ("plain", 0.0)):
        settings = ReductionSettings(cutoff, cutoff, load_cutoff)
        model, basis = reduce_cmt(assembly, modes, point, settings)
        reference = shared_modes(model, point, DesignState(NOMINAL, damping_ratio=ZETA))
        growing = growing_modes(
            reference.C, reference.K, reference.system.omega2, (500.0, options.top), 1e-7
        )
        print_growth(name, model.n, growing)
        if name == "modal":
            lam = growing.lam[0]
            psi = basis.expand(reference.phi @ growing.right[:, 0])
            most = np.abs(assembly.contact.T @ psi * lam).max()
            u, v = (psi / most).real, (psi * lam / most).real  # 1 m/s at that contact point
        found[name] = modal_representation(name, options, assembly, basis, reference, friction)
    if "hybrid" in options.only:
        found["hybrid"] = hybrid_representation(options, assembly, point, friction)
    for name in options.only:
        measure_growth(found[name], options, u, v, lam)
    if options.limit_cycle:
        for name in options.only:
            measure_cycle(found[name], options, u, v)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--top", type=float, default=8e3, help="Hz")
    parser.add_argument("--layers", type=int, default=1)
    parser.add_argument("--traces", type=float, default=12e3, help="Hz")
    parser.add_argument("--damped", type=float, default=12e3, help="Hz, modes of ratio 0.5 %%")
    parser.add_argument("--beyond", type=float, default=0.01, help="ratio from where it rises")
    parser.add_argument("--flat", action="store_true", help="modal: 0.5 %% on all coordinates")
    parser.add_argument("--joint", action="store_true", help="traces of all components together")
    parser.add_argument("--growth", type=float, default=4e-3, help="s")
    parser.add_argument("--limit-cycle", type=float, default=0.0, help="s; 0 runs none")
    parser.add_argument("--step", type=float, default=2e-6, help="s")
    parser.add_argument("--speed", type=float, default=0.02, help="m/s")
    parser.add_argument("--above", action="store_true", help="full-order growth above the band")
    parser.add_argument("--only", nargs="+", default=["modal", "plain", "hybrid"])
    return parser.parse_args()


def modal_representation(name, options, assembly, basis, reference, friction) -> Representation:
    omega = reference.system.frequencies
    cutoff = 2 * np.pi * options.damped
    rising = 2.0 * options.beyond / cutoff * omega**2
    c = np.where(omega <= cutoff, 2.0 * ZETA * omega, rising)
    if options.flat:
        c = 2.0 * ZETA * omega
    design = MotionPoint(NOMINAL.law, friction, SPEED, c)
    T = la.block_diag(*basis.blocks) @ reference.phi
    rows = (assembly.M @ T).T

    def run(settings, q0, v0):
        return simulate(reference.system, [replace(design, q0=q0, v0=v0)], settings)[0]

    return Representation(name, reference.system.n, run, lambda u: rows @ u)


def hybrid_representation(options, assembly, point, friction) -> Representation:
    started = time.perf_counter()
    settings = HybridSettings(options.traces, options.damped, options.layers, not options.joint)
    model = hybrid_model(assembly, point, NOMINAL, settings)
    c, beta = uniform_damping(model, ZETA, options.beyond)
    design = MotionPoint(NOMINAL.law, friction, SPEED, c, beta=beta)
    explicit = len(model.basis.explicit)
    print(
        f"hybrid: {model.n} coordinates, {explicit} explicit, {len(model.omega)} damped modes, "
        f"{time.perf_counter() - started:.0f} s"
    )

    def run(settings, q0, v0):
        return simulate_hybrid(model, replace(design, q0=q0, v0=v0), settings)

    return Representation("hybrid", model.n, run, model.basis.restrict)


def print_growth(name, n, growing) -> None:
    listed = ", ".join(f"{abs(x) / (2 * np.pi):.1f} Hz {x.real:.2f} 1/s" for x in growing.lam)
    print(
        f"{name}: {n} coordinates, 0.5 % on all of them: unstable {listed}; "
        f"{growing.n_outside} outside the band, fastest {growing.frequency_outside:.0f} Hz "
        f"{growing.growth_outside:.0f} 1/s",
        flush=True,
    )


def measure_growth(what, options, u, v, lam) -> None:
    settings = MotionSettings(options.growth, options.step, 5, tolerance=TOLERANCE)
    q0, v0 = 1e-6 * what.restrict(u), 1e-6 * what.restrict(v)
    what.run(MotionSettings(5 * options.step, options.step, 1), q0, v0)  # compiles
    started = time.perf_counter()
    result = what.run(settings, q0, v0)
    seconds = time.perf_counter() - started
    growth = 0.5 * np.polyfit(result.history["time"], np.log(result.history["modal_energy"]), 1)[0]
    print(
        f"{what.name:8s} growth {growth:8.2f} 1/s (complex mode {lam.real:.2f}), "
        f"{1e3 * seconds / settings.n_steps:.3f} ms a step{effort(result)}",
        flush=True,
    )


def measure_cycle(what, options, u, v) -> None:
    settings = MotionSettings(options.limit_cycle, options.step, 5, tolerance=TOLERANCE)
    started = time.perf_counter()
    q0, v0 = options.speed * what.restrict(u), options.speed * what.restrict(v)
    result = what.run(settings, q0, v0)
    seconds = time.perf_counter() - started
    torque = result.history["torque"]
    last = torque[-int(LAST * len(torque)) :]
    parts = [np.std(x) for x in np.array_split(last, 4)]
    print(
        f"{what.name:8s} {result.outcome} {result.message}\n"
        f"  torque mean {last.mean():.2f} N m, RMS {last.std():.2f} "
        f"(quarters {', '.join(f'{x:.1f}' for x in parts)}), peak to peak {np.ptp(last):.1f}, "
        f"dominant {dominant(last, 5 * options.step):.0f} Hz\n"
        f"  stick {100 * result.history['stick'][-len(last) :].mean():.2f} %, "
        f"open {100 * result.history['open'][-len(last) :].mean():.2f} %, "
        f"energy balance {result.energy.relative:.1e}, evaluations {result.mean_iterations:.2f} "
        f"(most {result.max_iterations}), halvings {result.halvings}, "
        f"{1e3 * seconds / settings.n_steps:.3f} ms a step{effort(result)}",
        flush=True,
    )


def dominant(x, step) -> float:
    """Frequency of the largest line [Hz], by a parabola through the logarithm of three bins."""
    spectrum = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x))))
    k = int(np.argmax(spectrum[1:-1])) + 1
    a, b, c = np.log(spectrum[k - 1 : k + 2])
    return (k + 0.5 * (a - c) / (a - 2 * b + c)) / (len(x) * step)


def effort(result) -> str:
    solves = getattr(result, "solves", None)
    if solves is None:
        return ""
    return f", {solves:.2f} solves and {result.columns:.0f} columns a step"


def print_above(assembly, point) -> None:
    """Fastest growth above the band: full-order roots nearest to some frequencies, undamped."""
    c, mu = assembly.contact, NOMINAL.friction * assembly.contact.frictional
    K = assembly_stiffness(assembly, point)
    K = (K - c.T.T @ sp.diags(mu * c.area * point.tangent) @ c.N).tocsr()
    C = c.T_perp.T @ sp.diags(mu * c.area * point.contact_pressure / SPEED) @ c.T_perp
    for centre in np.arange(14e3, 40e3, 4e3):
        lam = roots_near(assembly.M, C.tocsr(), K, 2j * np.pi * centre, 40)
        worst = lam[np.argmax(lam.real / np.abs(lam))]
        low, high = np.abs(lam).min() / (2 * np.pi), np.abs(lam).max() / (2 * np.pi)
        print(
            f"full order, {low:.0f} to {high:.0f} Hz: fastest {abs(worst) / (2 * np.pi):.0f} Hz, "
            f"{worst.real:.0f} 1/s, damping {-100 * worst.real / abs(worst):.2f} %",
            flush=True,
        )


def roots_near(M, C, K, s, count) -> np.ndarray:
    """Roots of lambda^2 M + lambda C + K nearest to s, by shift-invert on the companion form."""
    n, size = M.shape[0], abs(s)
    lu = spla.splu(
        (s * s * M + s * C + K).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )

    def apply(z):
        x, v = z.ravel()[:n], z.ravel()[n:] * size
        y = -lu.solve(M @ v + C @ x + s * (M @ x))
        return np.concatenate([y, (x + s * y) / size])

    operator = spla.LinearOperator((2 * n, 2 * n), matvec=apply, dtype=complex)
    v0 = np.random.default_rng(0).standard_normal(2 * n).astype(complex)
    theta = spla.eigs(operator, k=count, which="LM", v0=v0, return_eigenvectors=False)
    return s + 1 / theta


if __name__ == "__main__":
    main()
