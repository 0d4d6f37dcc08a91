"""Shapes as files for other programs: VTU and PVD for ParaView, UFF for test software."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import meshio
import numpy as np

from squealstudy.errors import ModelError
from squealstudy.files import write_atomic, write_text
from squealstudy.models.cells import NONE
from squealstudy.shapes.shape import Shape

MESHIO = {  # names of cells in meshio, whose nodes have the same order
    "tet4": "tetra",
    "tet10": "tetra10",
    "pyramid5": "pyramid",
    "pyramid13": "pyramid13",
    "wedge6": "wedge",
    "wedge15": "wedge15",
    "hex8": "hexahedron",
    "hex20": "hexahedron20",
}
N_PHASES = 24  # phases of a cycle, in a PVD file
QUAD, TRIANGLE = 94, 91  # thin shells of dataset 2412, drawn by their corners
# codes of dataset 55: structural, complex modes, three translations, displacement, complex numbers
STRUCTURE, COMPLEX_MODES, TRANSLATIONS, DISPLACEMENT, COMPLEX = 1, 3, 2, 8, 5
RESPONSE = 5  # code of dataset 55: response at a frequency
# codes of dataset 58: function over time, real double precision, even steps, general quantity, time
IN_TIME, REAL_DOUBLE, EVEN, GENERAL, TIME = 1, 4, 1, 1, 17
EVEN_STEP_TOLERANCE = 1e-6  # steps with a smaller spread over their mean are even


class Signal(NamedTuple):
    """A quantity over time, at even steps: its name, unit, times [s] (n,) and values (n,)."""

    name: str
    unit: str
    time: np.ndarray
    values: np.ndarray


def write_vtu(shape: Shape, path: Path) -> list[Path]:
    """Write the mesh with the shape, the contact points, and a cycle in phases.

    Complex values are written as real and imaginary parts. The `displacement` of the phases has no
    unit; its largest value is 1.

    Parameters
    ----------
    shape : Shape
        The shape.
    path : Path
        Path of the first file, ``NAME.vtu``; beside it are written ``NAME_contact.vtu``,
        ``NAME.pvd`` and the folder ``NAME_phases``.

    Returns
    -------
    list of Path
        The files to open.

    Raises
    ------
    ModelError
        Where the shape has no cells.
    """
    still = {
        "real": shape.displacement.real,
        "imag": shape.displacement.imag,
        "amplitude": shape.amplitude,
        "strain_energy_density": shape.density,
    }
    _write_mesh(_mesh(shape, still), path)
    written = [path]
    if len(shape.contact.points):
        written.append(path.with_name(f"{path.stem}_contact.vtu"))
        _write_mesh(_contact(shape), written[-1])
    folder = path.with_name(f"{path.stem}_phases")
    steps = []
    for number in range(N_PHASES):
        displacement = {"displacement": shape.at(2 * np.pi * number / N_PHASES)}
        file = folder / f"{number:02d}.vtu"
        _write_mesh(_mesh(shape, displacement), file)
        steps.append(
            f'<DataSet timestep="{number / N_PHASES:.6f}" file="{folder.name}/{file.name}"/>'
        )
    written.append(path.with_suffix(".pvd"))
    write_text(
        written[-1],
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
        + "\n".join(steps)
        + "\n</Collection>\n</VTKFile>\n",
    )
    return written


def _write_mesh(mesh: meshio.Mesh, path: Path) -> None:
    write_atomic(path, lambda temporary: mesh.write(temporary, file_format="vtu"))


def _mesh(shape: Shape, values: Mapping[str, np.ndarray]) -> meshio.Mesh:
    """The shape as a mesh for files of other programs; ModelError without cells."""
    cells, component, share = [], [], []
    for number, part in enumerate(shape.parts):
        first = 0
        for kind, nodes in part.blocks:
            cells.append((MESHIO[kind], nodes))
            component.append(np.full(len(nodes), number, dtype=np.int32))
            share.append(part.cell_energy[first : first + len(nodes)])
            first += len(nodes)
    if not cells:
        raise ModelError("no component of this model has cells: there is no mesh to write")
    return meshio.Mesh(
        shape.coordinates,
        cells,
        point_data=dict(values),
        cell_data={"component": component, "share_of_elastic_energy": share},
    )


def _contact(shape: Shape) -> meshio.Mesh:
    """Mesh of the contact points, with fields named as in `ContactMotion` and in its units."""
    contact = shape.contact
    numbers = np.arange(len(contact.points))
    values = {
        "area": contact.area,
        "static_pressure": contact.static_pressure,
        "pressure_real": contact.pressure.real,
        "pressure_imag": contact.pressure.imag,
        "slip_amplitude": contact.slip_amplitude,
        "growth_per_area": contact.fed,
    }
    return meshio.Mesh(contact.points, [("vertex", numbers[:, None])], point_data=values)


def write_uff(shape: Shape, path: Path, signals: Sequence[Signal] = ()) -> list[Path]:
    """Write surface nodes (dataset 15), facets (2412) and mode (55) of a shape, and signals (58).

    Lengths are in m, nodes are numbered from 1, and the root is in rad/s. Datasets have six digits,
    signals twelve.

    Returns
    -------
    list of Path
        The file.

    Raises
    ------
    ModelError
        Where the shape has no cells, or the steps of a signal are not even.
    """
    import pyuff

    facets = np.concatenate([part.facets for part in shape.parts])
    used = np.unique(facets[facets != NONE])
    if not len(used):
        raise ModelError("no component of this model has cells: there is no surface to write")
    x, y, z = shape.coordinates[used].T
    label, u = shape.label, shape.displacement[used]
    what, damping = label.number, f", damping ratio {shape.damping_ratio:.6g}"
    kind: dict[str, Any] = {"analysis_type": COMPLEX_MODES, "mode_n": label.mode, "eig": shape.lam}
    if label.motion:
        damping = ""
        kind = {"analysis_type": RESPONSE, "freq_step_n": 1, "freq": shape.frequency_hz}
    sets: list[dict[Any, Any]] = [
        pyuff.prepare_15(node_nums=(used + 1).tolist(), x=x, y=y, z=z),
        {"type": 2412, QUAD: list(_shells(shape, QUAD)), TRIANGLE: list(_shells(shape, TRIANGLE))},
        pyuff.prepare_55(
            id1=f"{label.study}, design point {label.row}, {what}"[:80],
            id2=f"{shape.frequency_hz:.6g} Hz{damping}",
            id3="NONE",
            id4="NONE",
            id5="NONE",
            model_type=STRUCTURE,
            data_ch=TRANSLATIONS,
            spec_data_type=DISPLACEMENT,
            data_type=COMPLEX,
            n_data_per_node=3,
            load_case=1,
            **kind,
            node_nums=(used + 1).tolist(),
            r1=u[:, 0],
            r2=u[:, 1],
            r3=u[:, 2],
        ),
        *(_function(signal, f"{label.study}, design point {label.row}") for signal in signals),
    ]
    write_atomic(path, lambda temporary: pyuff.UFF(str(temporary)).write_sets(sets, "add"))
    return [path]


def _function(signal: Signal, where: str) -> dict[Any, Any]:
    """Dataset 58 of a signal that belongs to no node."""
    import pyuff

    steps = np.diff(signal.time)
    if len(steps) and np.ptp(steps) > EVEN_STEP_TOLERANCE * steps.mean():
        raise ModelError(f"{signal.name}: steps in time are not even")
    dataset: dict[Any, Any] = pyuff.prepare_58(
        binary=0,
        func_type=IN_TIME,
        id1=f"{where}, {signal.name}"[:80],
        id2="NONE",
        id3="NONE",
        id4="NONE",
        id5="NONE",
        ver_num=0,
        load_case_id=0,
        rsp_ent_name="NONE",
        rsp_node=0,
        rsp_dir=0,
        ref_ent_name="NONE",
        ref_node=0,
        ref_dir=0,
        ord_data_type=REAL_DOUBLE,
        num_pts=len(signal.time),
        abscissa_spacing=EVEN,
        abscissa_min=float(signal.time[0]),
        abscissa_inc=float(steps.mean()) if len(steps) else 0.0,
        z_axis_value=0.0,
        abscissa_spec_data_type=TIME,
        abscissa_axis_units_lab="s",
        ordinate_spec_data_type=GENERAL,
        ordinate_axis_units_lab=signal.unit or "NONE",
        orddenom_spec_data_type=0,
        z_axis_spec_data_type=0,
        data=np.asarray(signal.values, dtype=float),
        x=np.asarray(signal.time, dtype=float),
    )
    return dataset


def _shells(shape: Shape, kind: int) -> Iterator[dict[str, Any]]:
    """Yield the facets with as many corners as that kind of element; materials are components."""
    number = 0
    for material, part in enumerate(shape.parts, start=1):
        for facet in part.facets:
            corners = [int(n) + 1 for n in facet[:4] if n != NONE]
            number += 1
            if len(corners) == (4 if kind == QUAD else 3):
                yield {
                    "element_nums": number,
                    "fe_descriptor": kind,
                    "phys_table": 1,
                    "mat_table": material,
                    "color": material,
                    "num_nodes": len(corners),
                    "nodes_nums": corners,
                }
