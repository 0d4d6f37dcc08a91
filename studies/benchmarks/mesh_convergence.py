"""Component frequencies and unstable modes of the disc brake on three meshes.

Run:  python studies/benchmarks/mesh_convergence.py     (several minutes; the fine mesh is large)

Prints, for each mesh, the first elastic free-free frequencies of the components and the unstable
full-band modes at 12 bar and friction 0.5, all in the reduced model of that mesh.
"""

from __future__ import annotations

import time

import numpy as np

from squealstudy.analysis.design_state import DesignState
from squealstudy.analysis.point import solve_point
from squealstudy.models.catalogue import MODELS
from squealstudy.models.law import ContactLaw
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import BasisSettings
from squealstudy.reduction.prepared import prepare

BAND = (500.0, 8000.0)
LISTED = 4  # elastic modes of each component
NOMINAL = OperatingPoint(0.5, 12e5, 0.5, ContactLaw())


def main() -> None:
    brake = MODELS["disc_brake"]
    for mesh in ("coarse", "medium", "fine"):
        options = {o.name: o.choices[0] for o in brake.options} | {"mesh": mesh}
        started = time.perf_counter()
        assembly = brake.build(options, brake.defaults())
        cutoff = 1.5 * BAND[1]
        settings = BasisSettings(cutoff, cutoff, 1.125 * BAND[1], 3e-5)
        prepared = prepare(assembly, NOMINAL, settings)
        model = prepared.model
        seconds = time.perf_counter() - started
        print(f"\n{mesh}: {assembly.n_dof} DOF, reduced to {model.n} in {seconds:.0f} s")
        for name, start in zip(model.components, model.offsets, strict=False):
            first = int(start) + 6
            f = np.sqrt(model.k_el[first : first + LISTED]) / (2 * np.pi)
            print(f"  {name:10s}" + "".join(f"{x:10.1f}" for x in f) + " Hz")
        modes = solve_point(prepared, DesignState(NOMINAL), BAND)
        size = np.abs(modes.lam)
        zeta = -modes.lam.real / size
        for f, z in zip(size[zeta < -1e-7] / (2 * np.pi), zeta[zeta < -1e-7], strict=True):
            print(f"  unstable  {f:10.1f} Hz, damping {100 * z:.3f} %")


if __name__ == "__main__":
    main()
