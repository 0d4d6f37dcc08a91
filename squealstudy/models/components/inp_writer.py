"""Components written as files of Abaqus and CalculiX."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np

from squealstudy.files import write_atomic
from squealstudy.models.components.materials import Anisotropic, Elastic, Orientation
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.fem.solid import Isotropic

PER_LINE = 16  # most entries of a line that both codes read
MAX_NUMBER_CHARACTERS = 20  # of a number that CalculiX reads
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_. +-]{0,79}", re.ASCII)
FILE_NAMES = {"C3D8_BBAR": "C3D8"}  # names in files of formulations with another name here


def write_inp(mesh: SolidMesh, path: Path, steps: Sequence[str] = ()) -> None:
    """Write a component: nodes, elements, sets, surfaces, materials, orientations.

    `read_inp` returns the same mesh, with most numbers exactly the same. What Abaqus calls C3D8 is
    C3D8_BBAR here; it is written as C3D8.

    Parameters
    ----------
    mesh : SolidMesh
    path : Path
    steps : sequence of str
        Lines to add at the end.

    Raises
    ------
    ModelError
        The mesh has a name that such a file cannot hold; ties, couplings, springs, point masses or
        mass in addition to that of materials; both C3D8 and C3D8_BBAR.
    """
    if mesh.constraints:
        raise mesh.error(f"{mesh.constraints[0].name}: ties and couplings cannot be written")
    if mesh.added_density.any():
        raise mesh.error("mass in addition to that of materials cannot be written")
    if mesh.discrete:
        raise mesh.error(f"{mesh.discrete[0].name}: springs and point masses cannot be written")
    kinds = {block.formulation for block in mesh.blocks}
    if {"C3D8", "C3D8_BBAR"} <= kinds:
        raise mesh.error("C3D8 and C3D8_BBAR cannot be in one file: each is a C3D8 of its code")
    for names in (
        mesh.node_sets,
        mesh.element_sets,
        mesh.surfaces,
        mesh.materials,
        mesh.orientations,
    ):
        for name in names:
            if not NAME.fullmatch(name):
                raise mesh.error(f"'{name}' cannot be written as a name of a set or material")

    def write(temporary: Path) -> None:
        with temporary.open("w", encoding="ascii", newline="\n") as handle:
            for line in (*_lines(mesh), *steps):
                handle.write(line + "\n")

    write_atomic(path, write)


def number(x: float) -> str:
    """A number in at most 20 characters, with as many digits as these can hold."""
    shortest = repr(float(x))
    if len(shortest) <= MAX_NUMBER_CHARACTERS:
        return shortest
    size = abs(x)
    if not 1e-3 <= size < 1e9:
        return f"{x:.{14 if x > 0 else 13}e}"
    before = len(str(int(size))) if size >= 1 else 0
    text = f"{x:.{MAX_NUMBER_CHARACTERS - 1 - before - (x < 0)}f}"
    return text if before else text.replace("0.", ".", 1)


def _lines(mesh: SolidMesh) -> Iterator[str]:
    """Lines of an .inp file with the mesh."""
    if any(block.formulation == "C3D8_BBAR" for block in mesh.blocks):
        yield "** C3D8 with mean change of volume, as in Abaqus: read it with dialect abaqus"
    yield "*NODE"
    for label, x in zip(mesh.numbers, mesh.nodes, strict=True):
        yield f"{label}, " + ", ".join(number(c) for c in x)
    for block in mesh.blocks:
        yield f"*ELEMENT, TYPE={FILE_NAMES.get(block.formulation, block.formulation)}"
        for label, nodes in zip(block.labels, mesh.numbers[block.nodes], strict=True):
            yield from _wrapped([label, *nodes])
    for name, members in mesh.node_sets.items():
        yield f"*NSET, NSET={name}"
        yield from _wrapped(mesh.numbers[members])
    for name, members in mesh.element_sets.items():
        yield f"*ELSET, ELSET={name}"
        yield from _wrapped(mesh.labels[members])
    for name, faces in mesh.surfaces.items():
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        for element, face in faces:
            yield f"{mesh.labels[element]}, S{face}"
    for name, material in mesh.materials.items():
        yield from _material(name, material)
    for name, axes in mesh.orientations.items():
        yield from _orientation(name, axes)
    yield from _sections(mesh)


def _sections(mesh: SolidMesh) -> Iterator[str]:
    """Sections, each with an element set of the mesh or one that is added for it."""
    pairs = np.char.add(np.char.add(mesh.material.astype(str), "\n"), mesh.orientation.astype(str))
    taken = {name.upper() for name in mesh.element_sets}
    for pair in sorted(set(pairs)):
        material, axes = pair.split("\n")
        if not material:
            continue
        elements = np.flatnonzero(pairs == pair)
        same = (n for n, members in mesh.element_sets.items() if np.array_equal(members, elements))
        name = next(same, "")
        if not name:
            name = next(n for k in count(1) if (n := f"SECTION_{k}") not in taken)
            taken.add(name)
            yield f"*ELSET, ELSET={name}"
            yield from _wrapped(mesh.labels[elements])
        orientation = f", ORIENTATION={axes}" if axes else ""
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={material}{orientation}"


def _wrapped(
    numbers: Sequence[int] | Sequence[str] | np.ndarray, count: int = PER_LINE
) -> Iterator[str]:
    """Lines of up to `count` numbers, all but the last with a comma at the end."""
    words = [str(n) for n in numbers]
    for start in range(0, len(words), count):
        comma = "," if start + count < len(words) else ""
        yield ", ".join(words[start : start + count]) + comma


def _material(name: str, material: Elastic) -> Iterator[str]:
    """Lines of a *MATERIAL."""
    yield f"*MATERIAL, NAME={name}"
    yield "*DENSITY"
    yield number(material.density)
    if isinstance(material, Isotropic):
        yield "*ELASTIC, TYPE=ISO"
        yield f"{number(material.young_modulus)}, {number(material.poisson_ratio)}"
    else:
        kind = "ANISO" if isinstance(material, Anisotropic) else "ORTHO"
        yield f"*ELASTIC, TYPE={kind}"
        yield from _wrapped([number(entry) for entry in material.entries], 8)


def _orientation(name: str, axes: Orientation) -> Iterator[str]:
    """Lines of an *ORIENTATION."""
    yield f"*ORIENTATION, NAME={name}, SYSTEM={axes.system.upper()}"
    points = (*axes.a, *axes.b)
    if axes.system == "rectangular" and any(axes.origin):
        points = tuple(np.subtract((axes.a, axes.b), axes.origin).ravel())  # only directions count
    yield ", ".join(number(float(c)) for c in points)
    if axes.turn[1]:
        yield f"{axes.turn[0]}, {number(axes.turn[1])}"
