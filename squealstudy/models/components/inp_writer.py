"""Components written as files of Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from squealstudy.models.components.materials import Elastic, Orientation
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.fem.solid import Isotropic

PER_LINE = 16  # the most entries of a line that these codes read
NUMBER = "{:.13e}"  # 20 characters at most
WRITTEN = {"C3D8_BBAR": "C3D8"}  # names that are ours only


def write_inp(mesh: SolidMesh, path: Path, steps: Sequence[str] = ()) -> None:
    """Write a component: nodes, elements, sets, surfaces, materials, orientations.

    `read_inp` gives the same mesh, numbers to 14 digits, elements by blocks. What Abaqus calls
    C3D8 is C3D8_BBAR here; it is written as C3D8.

    Parameters
    ----------
    mesh : SolidMesh
    path : Path
    steps : sequence of str
        Lines to add at the end.
    """
    with path.open("w", encoding="ascii", errors="strict", newline="\n") as handle:
        for line in (*_lines(mesh), *steps):
            handle.write(line + "\n")


def _lines(mesh: SolidMesh) -> Iterator[str]:
    yield "*NODE"
    for number, x in zip(mesh.numbers, mesh.nodes, strict=True):
        yield f"{number}, " + ", ".join(NUMBER.format(c) for c in x)
    for block in mesh.blocks:
        yield f"*ELEMENT, TYPE={WRITTEN.get(block.formulation, block.formulation)}"
        for label, nodes in zip(block.labels, mesh.numbers[block.nodes], strict=True):
            yield from _wrapped([label, *nodes])
    for name, members in mesh.node_sets.items():
        yield f"*NSET, NSET={name}"
        yield from _wrapped(mesh.numbers[members], PER_LINE)
    for name, members in mesh.element_sets.items():
        yield f"*ELSET, ELSET={name}"
        yield from _wrapped(mesh.labels[members], PER_LINE)
    for name, faces in mesh.surfaces.items():
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        for element, face in faces:
            yield f"{mesh.labels[element]}, S{face}"
    for name, material in mesh.materials.items():
        yield from _material(name, material)
    for name, axes in mesh.orientations.items():
        yield from _orientation(name, axes)
    pairs = list(zip(mesh.material, mesh.orientation, strict=True))
    for number, (material_name, axes_name) in enumerate(sorted(set(pairs)), start=1):
        if material_name:
            own = [i for i, pair in enumerate(pairs) if pair == (material_name, axes_name)]
            yield f"*ELSET, ELSET=SECTION_{number}"
            yield from _wrapped(mesh.labels[own], PER_LINE)
            axes_part = f", ORIENTATION={axes_name}" if axes_name else ""
            yield f"*SOLID SECTION, ELSET=SECTION_{number}, MATERIAL={material_name}{axes_part}"


def _wrapped(numbers: Sequence[int] | np.ndarray, per_line: int = PER_LINE) -> Iterator[str]:
    """Numbers in lines; of an element each but the last ends in a comma."""
    words = [str(n) for n in numbers]
    for at in range(0, len(words), per_line):
        more = "," if at + per_line < len(words) else ""
        yield ", ".join(words[at : at + per_line]) + more


def _material(name: str, material: Elastic) -> Iterator[str]:
    yield f"*MATERIAL, NAME={name}"
    yield "*DENSITY"
    yield NUMBER.format(material.density)
    if isinstance(material, Isotropic):
        yield "*ELASTIC, TYPE=ISO"
        yield f"{NUMBER.format(material.young_modulus)}, {NUMBER.format(material.poisson_ratio)}"
    else:
        yield "*ELASTIC, TYPE=ORTHO"
        words = [NUMBER.format(entry) for entry in material.entries]
        yield ", ".join(words[:8]) + ","
        yield words[8]


def _orientation(name: str, axes: Orientation) -> Iterator[str]:
    yield f"*ORIENTATION, NAME={name}, SYSTEM={axes.system.upper()}"
    points = (*axes.a, *axes.b)
    if axes.system == "rectangular" and any(axes.origin):
        points = tuple(np.subtract((axes.a, axes.b), axes.origin).ravel())  # directions are all
    yield ", ".join(NUMBER.format(float(c)) for c in points)
    if axes.turn[1]:
        yield f"{axes.turn[0]}, {NUMBER.format(axes.turn[1])}"
