"""Inspection of a component of a model file: its mesh, mass, damping and free modes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.components.attached import component_matrices
from squealstudy.models.components.bodies import Body, Brake, placement
from squealstudy.models.components.constraints import Relation, Tie
from squealstudy.models.components.dimensions import INERTIA, LENGTH, MASS, UNITS, extent_text
from squealstudy.models.components.free_modes import (
    FIRST_CUTOFF,
    LAST_CUTOFF,
    first_cutoff,
    read_mode_table,
    rigid_count,
    tabled_modes,
)
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import BY_MATERIAL, DAMPING, Numbers, dimension_of
from squealstudy.models.file_table import KeyPath
from squealstudy.wording import listed, plural

MASSES = (1e-3, 100.0)  # kg of a part of a brake, down to the pin of a rig
SIZES = (0.01, 1.0)  # m, the longest side of a part of a brake
SPEEDS = (20.0, 20_000.0)  # m/s of waves in solids, from soft rubber to beyond beryllium
RIGID = 1e-7  # norm of K r over the largest entry of K: a unit rigid motion r strains nothing below
N_LISTED_FREQUENCIES = 3  # elastic frequencies
DOUBTFUL = 0.2  # relative distance of measured and computed frequencies: perhaps another mode
MOTIONS = ("along x", "along y", "along z", "about x", "about y", "about z")


@dataclass
class Inspection:
    """What `inspect` tells about a model.

    Attributes
    ----------
    facts : list of (str, str)
        Name, such as that of a component, and text; the name is empty if it is that above.
    doubts : list of str
        What the user should look at before running a study.
    """

    facts: list[tuple[str, str]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def tell(self, name: str, text: str) -> None:
        """Add a fact."""
        self.facts.append((name, text))


def rigid_shapes(x: np.ndarray) -> np.ndarray:
    """Three translations and three rotations about the centroid of nodes x (n, 3): (3 n, 6)."""
    R = np.zeros((len(x), 3, 6))
    R[:, :, :3] = np.eye(3)
    for axis in range(3):
        R[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x - x.mean(axis=0))
    return R.reshape(-1, 6)


def _rigid_turns(n: int) -> np.ndarray:
    """Rotations of n nodes in the motions of `rigid_shapes`: (3 n, 6)."""
    return np.tile(np.hstack([np.zeros((3, 3)), np.eye(3)]), (n, 1))


def component_facts(
    inspection: Inspection, geometry: Geometry, body: Body, overrides: Mapping[KeyPath, float]
) -> None:
    """Add the facts of a component to an inspection.

    `overrides` are values in SI units that replace numbers of the file, by key.

    Raises
    ------
    ModelError
        As in `component_matrices`.
    """
    mesh, name, numbers = body.mesh, body.name, Numbers(geometry.file, overrides)
    kinds = ", ".join(f"{len(b.labels):,} {b.formulation}" for b in mesh.blocks)
    source = f"{mesh.origin.name}: {len(mesh.nodes):,} nodes"
    if body.matrices is None:
        inspection.tell(name, f"{source}, {kinds}; materials {listed(sorted(set(mesh.material)))}")
        other = {b.formulation: b.kind.verified for b in mesh.blocks}
        for formulation, verified in other.items():
            if "K and M" not in verified:
                inspection.tell("", f"{formulation}: confirmed by CalculiX: {verified}")
    else:
        lacking = int(body.expansion.lacking.sum())
        turns = int((np.diff(body.expansion.turns.indptr) > 0).sum())
        modal = int((body.expansion.places < 0).sum()) - turns
        details = f", {lacking} freedoms are not in them" if lacking else ""
        if modal:
            details = f", {plural(modal, 'modal coordinate')}{details or ', all nodes recovered'}"
        if turns:
            details = f", {plural(turns, 'turn')} of nodes{details}"
        inspection.tell(name, f"{source} of matrices{details}")
    relations = [c for c in mesh.constraints if isinstance(c, Relation)]
    if len(relations) == 1:
        inspection.tell("", relations[0].told)
    elif relations:
        inspection.tell("", f"{len(relations)} displacements follow others by equations")
    for constraint in mesh.constraints:
        if isinstance(constraint, Relation):
            continue
        inspection.tell("", constraint.told)
        if isinstance(constraint, Tie) and constraint.beside:
            inspection.doubts.append(
                f"{name}: {constraint.name}: {constraint.beside} nodes of the slave are not on the "
                f"master and free, {len(constraint.nodes)} are tied: meant so?"
            )
        if isinstance(constraint, Tie) and constraint.coarse:
            inspection.doubts.append(
                f"{name}: {constraint.name}: the slave has the coarser mesh, and the master "
                "is free between its nodes: make the finer face the slave"
            )
    for i, point_mass in enumerate(geometry.file.point_mass):
        if point_mass.on.partition(".")[0] == name:
            where = "spread over" if point_mass.at is None else f"at {list(point_mass.at)} by"
            weight = UNITS[geometry.file.units][1]
            mass = numbers.at("point_mass", i, "mass") / MASS.factor(geometry.file.units)
            text = f"mass {point_mass.name}: {mass:g} {weight}, {where} {point_mass.on}"
            inspection.tell("", text)
    if mesh.discrete:
        masses = len(mesh.mass_nodes)
        many = [plural(len(mesh.discrete) - masses, "spring")] * (len(mesh.discrete) > masses)
        many += [plural(masses, "mass", "masses")] * (masses > 0)
        inspection.tell("", f"{' and '.join(many)} of the deck")
    _damping(inspection, numbers, name)
    for text in _passed_over(mesh):
        inspection.tell("", text)
    K, M = component_matrices(geometry, name, overrides)
    _weight(inspection, geometry.brake, body, M)
    _location(inspection, geometry.brake, body)
    if body.matrices is None:
        _waves(inspection, mesh, name, geometry.file.units)
    _rigid(inspection, body, K, M)
    _measured(inspection, geometry, name, K, M)


def _passed_over(mesh: SolidMesh) -> list[str]:
    """Texts on keywords left out or read as something else: "of the file: *PLASTIC (line 3): ...".

    One text for each reason; a keyword is named with its first line.
    """
    reasons: dict[str, dict[str, int]] = {}
    for note in mesh.passed_over:
        reasons.setdefault(note.why, {}).setdefault(note.keyword, note.line)
    return [
        "of the file: "
        + ", ".join(f"{k} (line {line})" if line else k for k, line in keywords.items())
        + f": {why}"
        for why, keywords in reasons.items()
    ]


def _measured(
    inspection: Inspection, geometry: Geometry, name: str, K: sp.csr_matrix, M: sp.csr_matrix
) -> None:
    """Tell measured and computed free modes; doubt those that are far apart."""
    table = geometry.file.components[name].measured
    if table is None:
        return
    cutoff = FIRST_CUTOFF
    modes = tabled_modes(geometry.brake, name, K, M, cutoff)
    lines = len(read_mode_table(geometry.brake.located(table)))
    while len(modes) < lines and 2 * cutoff <= LAST_CUTOFF:
        cutoff = 2 * cutoff
        modes = tabled_modes(geometry.brake, name, K, M, cutoff)
    for mode in modes:
        texts = [f"{mode.computed_hz:.1f} Hz"]
        if mode.frequency_scale is not None:
            change = 100 * (mode.frequency_scale - 1)
            texts.append(f"measured {mode.frequency_hz:.1f} Hz ({change:+.2f} % from computed)")
            if abs(mode.frequency_scale - 1) > DOUBTFUL:
                inspection.doubts.append(
                    f"{name}: mode {mode.number} is measured at {mode.frequency_hz:.1f} Hz and "
                    f"computed at {mode.computed_hz:.1f} Hz: is it this mode?"
                )
        if mode.damping_ratio is not None:
            texts.append(f"damping ratio {mode.damping_ratio:.3g}")
        inspection.tell("", f"{table}: mode {mode.number}: {', '.join(texts)}")
    if len(modes) < lines:
        inspection.doubts.append(
            f"{name}: {plural(lines - len(modes), 'line')} of {table} above {cutoff:g} Hz"
        )


def _damping(inspection: Inspection, numbers: Numbers, name: str) -> None:
    """Tell the damping that the model file gives a component, in SI units."""
    table = numbers.file.components[name]
    keys: KeyPath = ("components", name)
    texts = [
        f"{key} {numbers.at(*keys, key):.4g} {dimension_of((*keys, key)).unit}"
        for key in DAMPING
        if numbers.at(*keys, key)
    ]
    by_material = {m: numbers.at(*keys, BY_MATERIAL, m) for m in table.material_damping}
    texts += [f"of {material} {beta:.4g} s" for material, beta in by_material.items()]
    texts += [f"C of {table.file_of('C')}"] * (table.C is not None)
    if texts:
        inspection.tell("", f"damping: {', '.join(texts)}")


def _weight(inspection: Inspection, brake: Brake, body: Body, M: sp.csr_matrix) -> None:
    """Tell sides, mass and principal moments of inertia; doubt what no part of a brake has."""
    R = body.expansion.freedoms(rigid_shapes(body.nodes), _rigid_turns(len(body.nodes)))
    about = R.T @ (M @ R)
    mass = float(about[0, 0])
    offset = np.array([about[5, 1], -about[5, 0], about[4, 0]]) / max(mass, 1e-300)
    inertia = about[3:, 3:] - mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    principal = np.linalg.eigvalsh(inertia)
    sides = np.ptp(body.nodes, axis=0)
    length, weight, moment = UNITS[brake.file.units]
    in_units = (d.factor(brake.file.units) for d in (LENGTH, MASS, INERTIA))
    length_size, mass_size, inertia_size = in_units
    extent = " x ".join(f"{s / length_size:.4g}" for s in sides)
    moments = ", ".join(f"{p / inertia_size:.3g}" for p in principal)
    shown = "" if weight == "kg" else f" ({mass:.4g} kg)"
    inspection.tell(
        "", f"{extent} {length}, {mass / mass_size:.4g} {weight}{shown}, inertia {moments} {moment}"
    )
    if not MASSES[0] <= mass <= MASSES[1] or not SIZES[0] <= sides.max() <= SIZES[1]:
        inspection.doubts.append(
            f"{body.name} weighs {mass:.3g} kg and is {1e3 * sides.max():.3g} mm long, which no "
            f"part of a brake is: are its numbers in {brake.file.units}?"
        )


def _location(inspection: Inspection, brake: Brake, body: Body) -> None:
    """Tell where a part lies in its file, as `sets` need it, and where it was moved to."""
    units = brake.file.units
    turn, shift = placement(body.name, brake.file.components[body.name], units)
    size, unit = LENGTH.factor(units), UNITS[units][0]
    text = extent_text((body.nodes - shift) @ turn / size, unit)
    is_moved = shift.any() or (turn != np.eye(3)).any()
    inspection.tell(
        "", f"{text}; moved {extent_text(body.nodes / size, unit)}" if is_moved else text
    )


def _waves(inspection: Inspection, mesh: SolidMesh, name: str, units: str) -> None:
    """Doubt materials in which waves are slower or faster than in any solid."""
    doubtful = []
    for label in sorted(set(mesh.material)):
        material = mesh.materials[label]
        modulus = float(np.diag(material.stiffness())[:3].max())
        speed = np.sqrt(modulus / material.density)
        if not SPEEDS[0] <= speed <= SPEEDS[1]:
            doubtful.append(f"{label} at {speed:.2g} m/s")
    if doubtful:
        inspection.doubts.append(
            f"{name}: waves would run in {listed(doubtful)}: are moduli and densities in {units}?"
        )


def _rigid(inspection: Inspection, body: Body, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
    """Tell the number of rigid modes, six for a free body, and the first elastic frequencies."""
    R = rigid_shapes(body.nodes)
    size = np.linalg.norm(R, axis=0)
    R = body.expansion.freedoms(R / size, _rigid_turns(len(body.nodes)) / size)
    forces = np.linalg.norm(K @ R, axis=0) / max(abs(K).max(), 1e-300)
    costly = [m for m, f in zip(MOTIONS, forces, strict=True) if f > RIGID]
    cutoff, elastic, rigid = first_cutoff(K, M), np.zeros(0), 0
    while cutoff <= LAST_CUTOFF and len(elastic) < N_LISTED_FREQUENCIES:
        omega, _ = real_modes(M, K, cutoff)
        rigid = rigid_count(K, M, omega)
        elastic, cutoff = omega[rigid:] / (2 * np.pi), 2 * cutoff
    hz = ", ".join(f"{f:.1f}" if f >= 1.0 else f"{f:.2g}" for f in elastic[:N_LISTED_FREQUENCIES])
    first = f"first free modes {hz} Hz" if hz else f"no other mode up to {cutoff / 2:g} Hz"
    inspection.tell("", f"{plural(rigid, 'rigid mode')}, {first}")
    if costly:
        inspection.doubts.append(
            f"{body.name}: {plural(rigid, 'rigid mode')} of six, for motions {listed(costly)} "
            f"strain it (K R = {forces.max():.1e}): is a support still in the matrix, or "
            "are its rows those of other nodes?"
        )
    elif rigid > 6:
        bodies = [s for s in body.mesh.element_sets if re.fullmatch(r"BODY\d+", s)]
        text = f"{body.name}: {rigid} rigid modes of six: parts of it are not connected, or hang on"
        text += " a line or a point"
        if bodies:
            text += f'; its bodies are {listed(bodies)}: part = "{bodies[0]}" reads one'
        inspection.doubts.append(text)
