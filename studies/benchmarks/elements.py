"""Elements of components from files: against CalculiX, on a cantilever, and how long they take.

Run:  python studies/benchmarks/elements.py judge
      python studies/benchmarks/elements.py cantilever [BARS]
      python studies/benchmarks/elements.py speed [CELLS]

`judge`: largest difference of K and M from those of CalculiX (program ccx), as a share of the
largest entry, over boxes of distorted elements with curved edges, isotropic and orthotropic, with
four kinds of material axes. The mass has the points of the stiffness, as CalculiX has it.
`cantilever`: error of the first frequency of a bar 10 x 1 x 1 with Poisson's ratio 0, of the first
BARS meshes (by default all three), against one twice as fine.
`speed`: seconds of processor time to write and read a file of CELLS^3 elements C3D20 (by default
16), to check it and to assemble it; the memory that the process came to.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "components"))

from calculix import AXES, CCX, apart, judged, ragged
from component_meshes import LINING, STEEL, box
from test_component_elements import cantilever

from squealstudy.models.components.checks import check_mesh
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp import read_inp
from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.mesh_matrices import (
    mass_matrix,
    stiffness_matrix,
    stiffness_terms,
)

CELLS = [(5, 2, 2), (10, 2, 2), (20, 2, 2)]


def judge() -> None:
    """A line for each element that CalculiX has as it is."""
    if CCX is None:
        sys.exit("there is no program ccx (Debian: calculix-ccx)")
    print(f"{'element':10s} {'K':>8s} {'M':>8s}   largest differences from CalculiX")
    for name, kind in FORMULATIONS.items():
        if not kind.verified.startswith("K and M"):
            continue
        errors = []
        for material in (STEEL, LINING):
            for axes in AXES.values():
                mesh = ragged(name, material, axes)
                with tempfile.TemporaryDirectory() as folder:
                    K, M = judged(Path(folder), mesh)
                M_own = mass_matrix(mesh, "as_stiffness")
                errors.append((apart(stiffness_matrix(mesh), K), apart(M_own, M)))
        K_error, M_error = (max(e) for e in zip(*errors, strict=True))
        print(f"{name:10s} {K_error:8.0e} {M_error:8.0e}")


def bars(count: int) -> None:
    """A line for each element: errors over the cells along, across and across."""
    meshes = CELLS[:count]
    along, across, _ = meshes[-1]
    reference = cantilever("C3D20", (2 * along, 2 * across, 2 * across))
    print(f"{'element':10s} " + " ".join(f"{'x'.join(map(str, c)):>9s}" for c in meshes))
    for name in FORMULATIONS:
        errors = [cantilever(name, cells) / reference - 1 for cells in meshes]
        print(f"{name:10s} " + " ".join(f"{error:9.1e}" for error in errors))


def timed(what: str, work: Callable[[], Any]) -> Any:
    """Do the work and print its time."""
    start = process_time()
    found = work()
    print(f"{what:24s} {process_time() - start:6.1f} s")
    return found


def speed(cells: int) -> None:
    """Times of a cube of cells^3 elements."""
    mesh = box("C3D20", (cells,) * 3)
    print(f"{mesh.n_elements} elements C3D20, {3 * len(mesh.nodes)} degrees of freedom")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.inp"
        timed("write", lambda: write_inp(mesh, path))
        print(f"{'size of the file':24s} {path.stat().st_size / 1e6:6.1f} MB")
        mesh = timed("read", lambda: read_inp(path))
    timed("check", lambda: check_mesh(mesh))
    timed("mass", lambda: mass_matrix(mesh))
    timed("stiffness, 2 terms", lambda: stiffness_terms(mesh, "S"))
    orthotropic = box("C3D20", (cells,) * 3, materials={"S": LINING})
    timed("stiffness, 9 terms", lambda: stiffness_terms(orthotropic, "S"))
    print(f"{'memory':24s} {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:6.2f} GB")


def main() -> None:
    """Do what the command line asks for."""
    what, *more = sys.argv[1:] or ["help"]
    if what == "judge":
        judge()
    elif what == "cantilever":
        bars(int(more[0]) if more else len(CELLS))
    elif what == "speed":
        speed(int(more[0]) if more else 16)
    else:
        print(__doc__)


if __name__ == "__main__":
    main()
