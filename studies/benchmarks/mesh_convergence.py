"""Errors of the disc brake's meshes.

Run:  python studies/benchmarks/mesh_convergence.py components [GEOMETRY ...] [--only inner_pad]
      python studies/benchmarks/mesh_convergence.py refined
      python studies/benchmarks/mesh_convergence.py chart
      python studies/benchmarks/mesh_convergence.py assembled [coarse medium fine]

`components`: elastic free modes below 6 kHz of each component and density against references of
high order (`component_reference.py`), for the default geometry and five others; half an hour, the
default alone some minutes. `refined`: the medium mesh with all cells divided in r, around, in z
and in all, and with full integration; ten minutes. Both keep their rows in
results/mesh_convergence.csv, which `chart` draws; with PARDISO (extra `mkl`) they stay below 6 GB.
`--only` takes some of the components, `--densities` some of the meshes, `--order` references up to
another order. `assembled`: unstable modes of the brake to 8 kHz (`--top`) at 12 bar and friction
0.5, each density against the next finer one, in the reduced model of each mesh.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from component_reference import extrapolated
from mesh_chart import mesh_chart

from squealstudy.laws import contact_law
from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.solids import DENSITIES, MEDIUM, BrakeMesher
from squealstudy.models.fem.solid import FULL_INTEGRATION_ORDER, REDUCED_INTEGRATION_ORDER
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.point import solve_point
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import prepare

TOP = 6e3  # Hz, of the free modes
BOTTOM = 500.0  # Hz, of complex modes
NOMINAL = OperatingPoint(0.5, 12e5, 0.5, contact_law())
TABLE, CHART = Path("results/mesh_convergence.csv"), Path("results/charts/mesh.png")
COLUMNS = ["geometry", "component", "mesh", "points", "dof", "low", "high", "median"]  # errors, %
SOLIDS = {"disc": (5, 3), "inner_pad": (4, 1), "caliper": (4, 2)}  # order, layers of the reference
GEOMETRIES: dict[str, dict[str, float]] = {
    "default": {},
    "tall": {
        "disc.bell_height": 0.040,
        "disc.top_thickness": 0.008,
        "disc.bell_outer_radius": 0.078,
        "disc.bell_inner_radius": 0.068,
        "pad.lining_thickness": 0.006,
        "caliper.body_thickness": 0.05,
        "caliper.finger_thickness": 0.020,
    },
    "thin": {
        "disc.thickness": 0.009,
        "disc.outer_radius": 0.150,
        "disc.bell_inner_radius": 0.068,
        "pad.half_angle": 26.0,
        "pad.plate_thickness": 0.006,
        "caliper.bridge_inner_radius": 0.150,
        "caliper.outer_radius": 0.172,
        "caliper.body_half_angle": 22.0,
        "caliper.finger_inner_angle": 7.0,
        "caliper.finger_outer_angle": 23.0,
    },
    "wide": {
        "disc.thickness": 0.014,
        "disc.inner_radius": 0.030,
        "disc.bell_height": 0.020,
        "pad.half_angle": 34.0,
        "pad.ear_angle": 4.0,
        "caliper.bridge_inner_radius": 0.144,
        "caliper.outer_radius": 0.158,
        "caliper.finger_thickness": 0.012,
        "caliper.bridge_half_angle": 30.0,
        "caliper.body_half_angle": 24.0,
        "caliper.finger_inner_angle": 3.0,
        "caliper.finger_outer_angle": 28.0,
    },
    "small": {
        "disc.outer_radius": 0.130,
        "disc.bell_outer_radius": 0.070,
        "disc.bell_inner_radius": 0.063,
        "disc.top_thickness": 0.005,
        "pad.outer_radius": 0.130,
        "pad.inner_radius": 0.085,
        "caliper.inner_radius": 0.085,
        "caliper.bridge_inner_radius": 0.136,
        "caliper.outer_radius": 0.152,
        "caliper.body_thickness": 0.035,
    },
    "large": {
        "disc.outer_radius": 0.165,
        "disc.thickness": 0.015,
        "disc.bell_outer_radius": 0.085,
        "disc.bell_inner_radius": 0.078,
        "disc.bell_height": 0.034,
        "pad.outer_radius": 0.165,
        "pad.inner_radius": 0.105,
        "pad.half_angle": 28.0,
        "pad.ear_angle": 6.0,
        "pad.lining_thickness": 0.012,
        "caliper.inner_radius": 0.105,
        "caliper.bridge_inner_radius": 0.172,
        "caliper.outer_radius": 0.195,
        "caliper.body_half_angle": 18.0,
        "caliper.finger_outer_angle": 24.0,
    },
}


def errors(mesher: BrakeMesher, component: str, exact: np.ndarray) -> tuple[int, np.ndarray]:
    """Degrees of freedom, and relative errors of the free modes in percent."""
    solid = mesher.component(component)
    omega, _ = real_modes(solid.M, solid.K, 1.15 * TOP, len(exact) + 8)  # about so many
    hz = omega[rigid_modes(solid.M, solid.K, omega) :] / (2 * np.pi)
    return solid.M.shape[0], 100 * (hz[: len(exact)] / exact - 1)


def show(key: tuple[str, str, str, int], n_dof: int, error: np.ndarray, started: float) -> None:
    """Print the errors of a mesh, and keep them; `key`: geometry, component, mesh, points."""
    label = f"{key[2]} {key[3]} points"
    print(
        f"  {label:24s}{n_dof:8d} DOF   from {error.min():+.2f} to {error.max():+.2f} %, "
        f"median {np.median(error):+.2f} %   {time.perf_counter() - started:.1f} s",
        flush=True,
    )
    row = [*key, n_dof, error.min(), error.max(), np.median(error)]
    table = pd.DataFrame([row], columns=COLUMNS)
    if TABLE.exists():
        table = pd.concat([pd.read_csv(TABLE), table]).drop_duplicates(COLUMNS[:4], keep="last")
    TABLE.parent.mkdir(exist_ok=True)
    table.to_csv(TABLE, index=False, float_format="%.5g")


def reference(component: str, values: dict[str, float], order: int | None) -> np.ndarray:
    started = time.perf_counter()
    usual, layers = SOLIDS[component]
    exact, step = extrapolated(component, values, TOP, order or usual, layers)
    print(
        f"{component}: {len(exact)} modes, the last order changes them by "
        f"{100 * np.abs(step).max():.3f} % at most, {time.perf_counter() - started:.0f} s",
        flush=True,
    )
    return exact


def components(given: argparse.Namespace) -> None:
    """Errors of the densities."""
    for geometry in given.names or list(GEOMETRIES):
        print(f"\n{geometry}")
        values = MODELS["disc_brake"].defaults() | GEOMETRIES[geometry]
        for component in given.only:
            exact = reference(component, values, given.order)
            for name in given.densities:
                started = time.perf_counter()
                found = errors(BrakeMesher(values, DENSITIES[name]), component, exact)
                show((geometry, component, name, 8), *found, started)


def refined(given: argparse.Namespace) -> None:
    """Errors of the medium mesh with divided cells."""
    values = MODELS["disc_brake"].defaults()
    for component in given.only:
        exact = reference(component, values, given.order)
        for split in ((1, 1, 1), (2, 1, 1), (1, 2, 1), (1, 1, 2), (2, 2, 2)):
            for order in (REDUCED_INTEGRATION_ORDER, FULL_INTEGRATION_ORDER):
                started = time.perf_counter()
                mesher = BrakeMesher(values, replace(MEDIUM, split=split), order)
                mesh = "medium " + "x".join(map(str, split))
                key = ("default", component, mesh, 8 if order == REDUCED_INTEGRATION_ORDER else 27)
                show(key, *errors(mesher, component, exact), started)


def chart(_: argparse.Namespace) -> None:
    """Draw the rows that are kept."""
    CHART.parent.mkdir(parents=True, exist_ok=True)
    mesh_chart(pd.read_csv(TABLE)).savefig(CHART, dpi=90)


def unstable(mesh: str, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and damping ratios of the unstable modes of a mesh."""
    brake = MODELS["disc_brake"]
    options = {o.name: o.choices[0] for o in brake.options} | {"mesh": mesh}
    started = time.perf_counter()
    assembly = brake.build(options, brake.defaults())
    built = time.perf_counter() - started
    settings = ReductionSettings(1.5 * top, 1.5 * top, 1.125 * top, 3e-5)
    prepared = prepare(assembly, NOMINAL, settings)
    seconds = time.perf_counter() - started
    print(
        f"\n{mesh}: {assembly.n_dof} DOF, built in {built:.1f} s, "
        f"with its reduction to {prepared.model.n} in {seconds:.1f} s"
    )
    modes = solve_point(prepared, DesignState(NOMINAL), (BOTTOM, top))
    size = np.abs(modes.lam)
    zeta = -modes.lam.real / size
    return size[zeta < -1e-7] / (2 * np.pi), zeta[zeta < -1e-7]


def assembled(given: argparse.Namespace) -> None:
    """Unstable modes of meshes, each beside the nearest of the mesh before."""
    before = None
    for mesh in given.names or list(DENSITIES):
        hz, zeta = found = unstable(mesh, given.top)
        for f, z in zip(hz, zeta, strict=True):
            text = f"  unstable {f:9.1f} Hz, damping {100 * z:+.3f} %"
            if before is not None and len(before[0]):
                k = np.abs(before[0] - f).argmin()
                text += (
                    f"   the mesh before: {100 * (before[0][k] / f - 1):+.2f} % in frequency, "
                    f"{100 * (before[1][k] - z):+.3f} % (absolute) in damping"
                )
            print(text, flush=True)
        before = found


def main() -> None:
    """Do what the command line asks for."""
    tasks = {"components": components, "refined": refined, "assembled": assembled, "chart": chart}
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("task", nargs="?", choices=list(tasks), default="components")
    parser.add_argument("names", nargs="*", help="geometries, or meshes of the assembled brake")
    parser.add_argument("--only", nargs="+", choices=list(SOLIDS), default=list(SOLIDS))
    parser.add_argument("--densities", nargs="+", choices=list(DENSITIES), default=list(DENSITIES))
    parser.add_argument("--order", type=int, help="of the references, the highest of three")
    parser.add_argument("--top", type=float, default=8000.0, help="Hz, of the assembled brake")
    given = parser.parse_args()
    tasks[given.task](given)


if __name__ == "__main__":
    main()
