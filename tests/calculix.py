"""CalculiX run on meshes of components, and the meshes that it judges."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from component_meshes import box

from squealstudy.models.components.inp_writer import write_inp
from squealstudy.models.components.materials import Orientation

CCX = shutil.which("ccx")
AXES = {
    "global": None,
    "rectangular": Orientation("rectangular", (1, 2, 0.3), (-1, 1, 0.2)),
    "turned": Orientation("rectangular", (1, 2, 0.3), (-1, 1, 0.2), turn=(2, 33.0)),
    "cylindrical": Orientation("cylindrical", (-5, -4, 0), (-5.1, -4, 1)),
}


def ragged(name, material, axes):
    """A box of two or more elements of one kind with curved edges, and material axes."""
    mesh = box(name, (2, 1, 2), uneven=0.2, materials={"S": material})
    jagged = 0.05 * np.random.default_rng(3).uniform(-1, 1, mesh.nodes.shape)
    mesh = replace(mesh, nodes=mesh.nodes + jagged)
    if axes is None:
        return mesh
    which = np.full(mesh.n_elements, "O", dtype=object)
    return replace(mesh, orientations={"O": axes}, orientation=which)


def run(folder, mesh, *lines):
    """Let ccx do a step on a mesh; the folder and what it printed."""
    write_inp(mesh, folder / "job.inp", lines)
    done = subprocess.run(
        [CCX, "job"],
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    return done.stdout


def judged(folder, mesh):
    """K and M of ccx, degree of freedom 3 * node + axis; inner freedoms behind them."""
    said = run(folder, mesh, "*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP")
    assert (folder / "job.sti").exists(), said
    # node.direction as text: 10.1 and 1.1 differ, and so do 1.1 and 1.10
    words = [w.split(".") for w in (folder / "job.dof").read_text().split()]
    place = {int(n): i for i, n in enumerate(mesh.numbers)}
    inner = sorted({int(n) for n, _ in words} - set(place))
    place |= {n: len(mesh.nodes) + i for i, n in enumerate(inner)}
    at = np.array([3 * place[int(n)] + int(d) - 1 for n, d in words])
    found = []
    for ending in ("sti", "mas"):
        row, column, value = np.loadtxt(folder / f"job.{ending}").T
        i, j = at[row.astype(int) - 1], at[column.astype(int) - 1]
        other = i != j
        i, j = np.append(i, j[other]), np.append(j, i[other])
        n = 3 * len(place)
        found.append(sp.coo_matrix((np.append(value, value[other]), (i, j)), shape=(n, n)).tocsr())
    return found


def apart(A, B):
    """Largest difference as a share of the largest entry of B."""
    return abs(A - B).max() / abs(B).max()
