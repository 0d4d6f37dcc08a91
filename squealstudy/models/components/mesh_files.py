"""Reads and checks meshes from files of all formats."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.checks import DOUBLED, check_mesh, check_places
from squealstudy.models.components.component_table import ComponentTable
from squealstudy.models.components.handed import righted
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.sectors import Repetition, repeated

ANSYS, NASTRAN = ".cdb", (".bdf", ".nas", ".dat", ".fem")
FORMATS = (".inp", ".msh", ".unv", ".med", ANSYS, *NASTRAN)
BODY = re.compile(r"BODY[1-9][0-9]*", re.I)  # name of a part that nothing connects to others
BODIES = 100  # largest number of bodies that become element sets
POINTER = b"version https://git-lfs.github.com"  # start of a file that Git LFS has not fetched
ADVICE = (
    (
        (".vtu", ".vtk", ".xdmf", ".exo", ".e", ".mesh", ".avs", ".xml"),
        "; meshio or gmsh converts it to .msh or .inp",
    ),
    ((".stp", ".step", ".igs", ".iges", ".brep", ".stl", ".x_t"), "; it is a shape: mesh it first"),
    ((".odb", ".op2", ".rst", ".db", ".hm", ".cae"), "; let its program write the mesh as text"),
    ((".k", ".key"), "; LS-PrePost and others write it as .inp or .bdf"),
)


def read_mesh(path: Path, table: ComponentTable) -> SolidMesh:
    """Read and check the mesh of a component, in the units of its file.

    Where it consists of several bodies that nothing connects, each is also an element set, BODY1,
    BODY2, ..., which the component's `part` may name.

    Raises
    ------
    ModelError
        The file cannot be read, or the mesh has a fault (`check_mesh`).
    """
    body = table.part if table.part is not None and BODY.fullmatch(table.part) else None
    mesh = _read(path, table if body is None else table.model_copy(update={"part": None}))
    check_places(mesh)
    mesh = righted(mesh)
    if (how := table.repeat) is not None:
        mesh = repeated(mesh, Repetition(np.array(how.point), np.array(how.axis), how.count))
    bodies, points = mesh.body_of, table.mesh is None
    if 0 < bodies.max(initial=0) < BODIES:
        body_sets = {f"BODY{k + 1}": np.flatnonzero(bodies == k) for k in range(bodies.max() + 1)}
        mesh = replace(mesh, element_sets={**body_sets, **mesh.element_sets})
    if body is not None:
        mesh = mesh.part(mesh.find("element_sets", body))
    check_mesh(mesh, DOUBLED in [name.upper() for name in table.pass_over], points)
    return mesh


def _read(path: Path, table: ComponentTable) -> SolidMesh:
    ending = path.suffix.lower()
    if path.is_file():
        with path.open("rb") as handle:
            if handle.read(len(POINTER)) == POINTER:
                raise ModelError(f"{path} is a pointer of Git LFS: 'git lfs pull' brings the file")
    if table.temperature is not None and ending not in (".inp", *NASTRAN):
        raise ModelError(f"{path}: materials over temperature are read of .inp and bulk data alone")
    if ending == ".inp":
        from squealstudy.models.components.inp import read_inp

        mesh = read_inp(
            path,
            table.part,
            dialect=table.dialect,
            treat_as=table.treat_as,
            pass_over=table.pass_over,
            temperature=table.temperature,
            points=table.mesh is None,
        )
    elif ending in (".msh", ".unv", ".med"):
        if ending == ".msh":
            from squealstudy.models.components.gmsh import read_gmsh as read
        elif ending == ".unv":
            from squealstudy.models.components.unv import read_unv as read
        else:
            from squealstudy.models.components.med import read_med as read
        mesh = read(path, treat_as=table.treat_as)
        if table.part is not None:
            mesh = mesh.part(mesh.find("element_sets", table.part))
    elif ending in NASTRAN:
        from squealstudy.models.components.nastran import read_bdf

        mesh = read_bdf(
            path,
            table.part,
            treat_as=table.treat_as,
            pass_over=table.pass_over,
            points=table.mesh is None,
            temperature=table.temperature,
        )
    elif ending == ANSYS:
        from squealstudy.models.components.ansys import read_cdb

        mesh = read_cdb(path, table.part, treat_as=table.treat_as, pass_over=table.pass_over)
    else:
        formats = ", ".join(FORMATS)
        advice = next((text for endings, text in ADVICE if ending in endings), "")
        raise ModelError(
            f"{path}: unknown format '{path.suffix}', expected one of {formats}{advice}"
        )
    return mesh
