"""Texts and pictures of `squealstudy inspect`: a model file, or measured beside computed modes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import RenderableType

from squealstudy.engine.pictures import save_figure
from squealstudy.errors import ModelError
from squealstudy.models.components.attached import component_matrices
from squealstudy.models.components.component_facts import Inspection
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.components.faces import boundary, facet_groups, facets
from squealstudy.models.components.free_modes import first_elastic
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.units import in_unit_of
from squealstudy.plots.style import finish, head, new_figure
from squealstudy.screen import Rows, facts, grid, show, warning
from squealstudy.shapes.assembled import Body, draw_assembly, draw_free_modes, eight
from squealstudy.shapes.measured import (
    MIN_PAIR_MAC,
    Correlation,
    Measured,
    correlated,
    read_measured,
)
from squealstudy.study.components import free_component, read_model
from squealstudy.wording import figure, listed, plural

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def part_tables(model: FileDefinition, inspection: Inspection) -> tuple[Rows, Rows]:
    """Rows of facts on a model file, and rows of the structural parameters that it declares."""
    rows = [
        (p.name, f"{p.default:g} {p.unit}".rstrip() + f"  {p.description}")
        for p in model.parameters
        if p.structural
    ]
    return [("model", model.description), *inspection.facts], rows


def draw(geometry: Geometry, path: Path) -> None:
    """Draw the assembly with coloured contact faces."""
    faces: dict[str, list[str]] = {}
    for contact in geometry.file.contact:
        for reference in (contact.slave, contact.master):
            name, _, label = reference.partition(".")
            faces.setdefault(name, []).append(label)
    if not faces:  # a part alone: its surfaces
        faces = {
            name: [*body.mesh.surfaces][:MAX_DRAWN_SURFACES]
            for name, body in geometry.bodies.items()
        }
    bodies = {}
    for name, body in geometry.bodies.items():
        drawn_facets = _outer(body.mesh)
        if len(drawn_facets):  # a superelement's nodes alone have none
            bodies[name] = Body(
                nodes=body.nodes,
                facets=drawn_facets,
                faces={
                    f"{name}.{label}": [g.nodes for g in facets(body.mesh, label)]
                    for label in dict.fromkeys(faces.get(name, ()))
                },
            )
    if not bodies:
        raise ModelError(f"{path}: there is nothing to draw: no component has solids")
    axis = np.array([0.0, 0.0, 1.0])
    if geometry.rotation is not None:
        axis = geometry.rotation.direction
    save_figure(draw_assembly(bodies, axis), path)


def _outer(mesh: SolidMesh) -> np.ndarray:
    """Facets (m, 8) of a mesh's boundary, each with eight nodes."""
    groups = facet_groups(mesh, boundary(mesh))
    return np.vstack([np.zeros((0, 8), dtype=np.int64), *(eight(g.nodes) for g in groups)])


def draw_modes(geometry: Geometry, path: Path) -> list[Path]:
    """Draw the first free modes of each component with solids, in files beside `path`."""
    written = []
    for name, body in geometry.bodies.items():
        outer = _outer(body.mesh)
        if not len(outer):
            continue
        K, M = component_matrices(geometry, name, {})
        hz, vectors = first_elastic(K, M, MAX_DRAWN_MODES)
        if not len(hz):
            continue
        displacements = [(body.expansion.E @ v).reshape(-1, 3) for v in vectors.T]
        titles = [f"{name}: {f:.1f} Hz" for f in hz]
        figure_of = draw_free_modes(
            body.nodes, outer, list(zip(titles, displacements, strict=True))
        )
        suffix = f"_{name}" if len(geometry.bodies) > 1 else ""
        written.append(path.with_name(f"{path.stem}{suffix}_modes{path.suffix}"))
        save_figure(figure_of, written[-1])
    return written


MAX_DRAWN_MODES = 6  # free modes of a part that are drawn
MAX_DRAWN_SURFACES = 8  # surfaces of a part alone that are drawn
# largest distance of a measured point from its node, over the largest side of the part
MAX_POINT_DISTANCE_RATIO = 0.02
N_RIGID_MODES = 6  # number of rigid modes of a free part
N_COLUMNS_TO_DAMPING = 3  # number of the table's columns up to the measured damping
MAX_MODES_WITH_FIGURES = 12  # number of modes up to which a picture has room for figures


def inspected(
    model: Path,
    component: str,
    path: Path,
    unit: str,
    tolerance: str | None,
    picture: Path | None,
) -> bool:
    """Show measured beside computed modes, and draw them if asked; whether there are doubts."""
    measured_and_correlation = compared(read_model(model), component, path, unit, tolerance)
    show(*correlation_lines(*measured_and_correlation))
    if picture is not None:
        save_figure(
            correlation_figure(*measured_and_correlation, f"{component}: {path.name}"), picture
        )
        show(f"\npicture: {picture}", unbroken=True)
    in_doubt = doubts(*measured_and_correlation)
    for text in in_doubt:
        warning(text)
    return bool(in_doubt)


def compared(
    model: FileDefinition, component: str, path: Path, unit: str, tolerance: str | None
) -> tuple[Measured, Correlation]:
    """Measured modes of a file, and their correlation with those of a free component.

    Parameters
    ----------
    model : FileDefinition
    component : str
    path : Path
        Universal file with the measured modes.
    unit : str
        Unit of its lengths, where the file has none.
    tolerance : str or None
        Largest distance of a point from its node, with its unit; None: MAX_POINT_DISTANCE_RATIO of
        the component's largest side.

    Raises
    ------
    StudyFileError, ModelError
        For the reasons of `free_component`, `read_measured` and `correlated`, or where a unit is
        not one of length.
    """
    body, (K, M), placement = free_component(model, component)
    measured = read_measured(path, _length(f"1 {unit}", "--unit"))
    max_distance = MAX_POINT_DISTANCE_RATIO * float(np.ptp(body.nodes, axis=0).max())
    if tolerance is not None:
        max_distance = _length(tolerance, "--tolerance")
    return measured, correlated(
        measured, K, M, body.nodes, body.expansion.E, placement, max_distance
    )


def _length(text: str, option: str) -> float:
    """The length [m] that a text with a unit gives; ModelError where it is no positive length."""
    try:
        length_m = in_unit_of(text, "m")
    except ValueError as error:
        raise ModelError(f"{option} {error}") from None
    if not length_m > 0:
        raise ModelError(f"{option}: expected a positive length, got '{text}'")
    return length_m


def correlation_lines(measured: Measured, correlation: Correlation) -> list[RenderableType]:
    """The table of pairs, and lines on the points and modes that were compared."""
    partner = dict(correlation.pairs)
    rows = [
        _row(measured, correlation, k, partner.get(k)) for k in range(len(measured.frequency_hz))
    ]
    titles = ["measured", "Hz", "damping %", "computed", "Hz", "difference %", "MAC"]
    if np.isfinite(measured.hysteretic).any():
        titles.insert(N_COLUMNS_TO_DAMPING, "hysteretic %")
        for row, ratio in zip(rows, measured.hysteretic, strict=True):
            row.insert(N_COLUMNS_TO_DAMPING, figure(100 * ratio, ".3f"))
    used, seen_dof = correlation.used, measured.measured_directions[correlation.used]
    unused_rows = np.flatnonzero(~used)
    where = "in the assembly" if correlation.in_assembly else "in its mesh's file"
    text = f"{used.sum()} of {plural(len(used), 'point')} have a node of the part as it is {where}"
    text += (
        f", at most {1e3 * correlation.distance[used].max():.3g} mm away; {seen_dof.sum()} freedoms"
    )
    lines: Rows = [("compared", text)]
    if len(unused_rows):
        distance_mm = 1e3 * correlation.distance[unused_rows]
        lines.append(
            (
                "no node for",
                f"{plural(len(unused_rows), 'point')}, {distance_mm.min():.3g} mm away or more",
            )
        )
    spare = _unpaired(correlation)
    if spare:
        lines.append(("not measured", "; ".join(spare)))
    if measured.left_out:
        lines.append(
            ("not used", f"{plural(measured.left_out, 'dataset')} that are no mode shapes")
        )
    return [grid(*titles, rows=rows), "", facts(lines)]


def _row(measured: Measured, correlation: Correlation, mode: int, group: int | None) -> list[str]:
    """Cells of a measured mode: its partner among the computed modes, and their MAC."""
    hz, zeta = measured.frequency_hz[mode], measured.damping_ratio[mode]
    first = [str(mode + 1), f"{hz:.1f}", figure(100 * zeta, ".3f")]
    if group is None:
        nearest = int(correlation.mac[mode].argmax())
        text = f"{correlation.mac[mode, nearest]:.2f} at most, of {_name(correlation, nearest)}"
        return [*first, "-", "-", "-", text]
    computed_hz = correlation.frequency_hz[group]
    off = f"{100 * (computed_hz / hz - 1):+.2f}" if hz > 0 else "-"
    return [
        *first,
        _name(correlation, group),
        f"{computed_hz:.1f}",
        off,
        f"{correlation.mac[mode, group]:.3f}",
    ]


def _name(correlation: Correlation, group: int) -> str:
    group_modes = correlation.groups[group]
    return f"{group_modes[0]}-{group_modes[-1]}" if len(group_modes) > 1 else str(group_modes[0])


def _unpaired(correlation: Correlation) -> list[str]:
    """Texts on computed modes without a measured partner."""
    taken = [sum(j == g for _, j in correlation.pairs) for g in range(len(correlation.groups))]
    return [
        f"{_name(correlation, g)} at {correlation.frequency_hz[g]:.1f} Hz"
        + (f" ({len(group_modes) - count} of {len(group_modes)})" if count > 0 else "")
        for g, (group_modes, count) in enumerate(zip(correlation.groups, taken, strict=True))
        if count < len(group_modes)
    ]


def doubts(measured: Measured, correlation: Correlation) -> list[str]:
    """Texts on doubts about the comparison, to be looked at before its numbers are trusted."""
    partner = dict(correlation.pairs)
    unpaired = [str(k + 1) for k in range(len(measured.frequency_hz)) if k not in partner]
    texts = []
    if unpaired:
        texts.append(
            f"no computed mode has a MAC of {MIN_PAIR_MAC:g} with measured "
            f"{', '.join(unpaired)}: another "
            "part or placement, a support in the test, or directions that differ?"
        )
    if correlation.n_rigid != N_RIGID_MODES:
        texts.append(
            f"the part has {plural(correlation.n_rigid, 'rigid mode')} of {N_RIGID_MODES}: it is "
            "not free"
        )
    if correlation.alike:
        i, j, mac = max(correlation.alike, key=lambda row: row[2])
        texts.append(
            f"the measured points tell modes {_name(correlation, j)} and {_name(correlation, i)} "
            f"apart badly (their MAC there is {mac:.2f}): more points or directions are needed"
        )
    if not correlation.used.all():
        unused_points = [str(n) for n in measured.numbers[~correlation.used]]
        texts.append(f"measured points without a node: {listed(unused_points)}")
    return texts


def correlation_figure(measured: Measured, correlation: Correlation, title: str) -> Figure:
    """Picture of the MAC matrix, with a row for each measured mode; pairs are framed."""
    m, g = correlation.mac.shape
    figure = new_figure(min(2.6 + 0.55 * g, 14.0), min(2.0 + 0.42 * m, 10.0))
    axes = figure.add_subplot()
    image = axes.imshow(correlation.mac, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    figure.colorbar(image, ax=axes, label="MAC", pad=0.02)
    if max(m, g) <= MAX_MODES_WITH_FIGURES:
        for (i, j), mac in np.ndenumerate(correlation.mac):
            ink = "white" if mac > 0.6 else "0.3"
            axes.text(j, i, f"{mac:.2f}", ha="center", va="center", fontsize=8, color=ink)
    for i, j in correlation.pairs:
        axes.plot(
            [j - 0.5, j + 0.5, j + 0.5, j - 0.5, j - 0.5],
            [i - 0.5, i - 0.5, i + 0.5, i + 0.5, i - 0.5],
            color="#D55E00",
            linewidth=1.6,
            clip_on=False,
        )
    names = [
        f"{_name(correlation, k)}\n{hz:.0f} Hz" for k, hz in enumerate(correlation.frequency_hz)
    ]
    axes.set_xticks(range(g), names, fontsize=8, rotation=0 if g <= MAX_MODES_WITH_FIGURES else 90)
    axes.set_yticks(
        range(m),
        [f"{k + 1}: {hz:.0f} Hz" for k, hz in enumerate(measured.frequency_hz)],
        fontsize=8,
    )
    finish(axes, "Computed mode", "Measured mode")
    axes.grid(False)
    head(axes, title, "framed: pairs")
    return figure
