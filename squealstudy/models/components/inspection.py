"""What a model file was understood as: facts to look at before an hour is spent, and doubts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import Body, Brake
from squealstudy.models.components.constraints import Tie
from squealstudy.models.components.dimensions import LENGTH, MASS, STRESS, Dimension
from squealstudy.models.components.free_modes import (
    read_mode_table,
    rigid_count,
    tabled_modes,
)
from squealstudy.models.components.geometry import Geometry, geometry_of
from squealstudy.models.components.model_file import (
    BY_MATERIAL,
    DAMPING,
    KeyPath,
    Numbers,
    dimension_of,
)
from squealstudy.models.components.point_masses import component_matrices
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.wording import duration, listed, plural

MASSES = (0.02, 100.0)  # kg of a part of a brake
SIZES = (0.01, 1.0)  # m, the longest side of a part of a brake
INERTIA = Dimension((2, 1, 0), "kg m2")
RIGID = 1e-7  # K R over K and R: rigid motions that cost no energy
FREE = 1e-9  # of the largest stiffness a mass: motions that nothing holds
FIRST_CUTOFF, LAST_CUTOFF = 2000.0, 64_000.0  # Hz
LISTED = 3  # elastic frequencies
DOUBTFUL = 0.2  # of a frequency: measured and computed ones of another mode
SPREAD = 0.3  # of the law's length: gaps that change the contact
PARTLY = 0.95  # of a slave face
BALANCE = 1e-6
# of reductions of 14,769, 48,588 and 115,959 freedoms: 0.85, 2.0, 3.5 GB; 18, 72, 350 s of a core
MEMORY, MEMORY_EACH = 0.4, 3e-5  # GB
SECONDS, FREEDOMS, GROWTH = 18.0, 14_769, 1.4
NAMES = {"t-mm-s": ("mm", "t", "t mm2"), "mm-kg-ms": ("mm", "kg", "kg mm2")}
MOTIONS = ("along x", "along y", "along z", "about x", "about y", "about z")


@dataclass
class Inspection:
    """Facts, name and text, and doubts: what should be looked at before a study is run."""

    facts: list[tuple[str, str]] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def tell(self, name: str, text: str) -> None:
        """Add a fact."""
        self.facts.append((name, text))


def inspect(brake: Brake, assembly: Assembly, pressure: float) -> Inspection:
    """Look at a brake.

    Parameters
    ----------
    brake : Brake
    assembly : Assembly
        Of it, at its defaults.
    pressure : float
        Brake pressure, Pa: the contact law's length is that under it.

    Raises
    ------
    ModelError
        As `geometry_of` and `component_matrices`.
    """
    found, geometry = Inspection(), geometry_of(brake)
    for body in geometry.bodies.values():
        _component(found, geometry, body)
    _held(found, geometry, assembly)
    _contact(found, geometry, assembly, pressure)
    _ties(found, geometry, assembly)
    _rotation(found, geometry, assembly)
    _load(found, geometry)
    _stresses(found, geometry)
    n, points = assembly.n_dof, assembly.contact.n_points
    seconds = SECONDS * (n / FREEDOMS) ** GROWTH
    found.tell(
        "size",
        f"{n:,} degrees of freedom, {points:,} contact points; a reduction needs about "
        f"{MEMORY + n * MEMORY_EACH:.1f} GB and {duration(seconds)} of a core",
    )
    return found


def rigid_shapes(x: np.ndarray) -> np.ndarray:
    """Three translations and three turns about the centre (3 n, 6) of nodes x (n, 3)."""
    R = np.zeros((len(x), 3, 6))
    R[:, :, :3] = np.eye(3)
    for axis in range(3):
        R[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x - x.mean(axis=0))
    return R.reshape(-1, 6)


# -- components ----------------------------------------------------------------------------------
def _component(found: Inspection, geometry: Geometry, body: Body) -> None:
    mesh, name = body.mesh, body.name
    kinds = ", ".join(f"{len(b.labels):,} {b.formulation}" for b in mesh.blocks)
    source = f"{mesh.origin.name}: {len(mesh.nodes):,} nodes"
    if body.matrices is None:
        found.tell(name, f"{source}, {kinds}; materials {listed(sorted(set(mesh.material)))}")
        other = {b.formulation: b.kind.verified for b in mesh.blocks}
        for formulation, verified in other.items():
            if "K and M" not in verified:
                found.tell("", f"{formulation}: confirmed by CalculiX: {verified}")
    else:
        lacking = int(body.expansion.lacking.sum())
        modal = int((body.expansion.places < 0).sum())
        held = f", {lacking} freedoms are not in them" if lacking else ""
        if modal:
            held = f", {plural(modal, 'modal coordinate')}{held or ', all nodes recovered'}"
        found.tell(name, f"{source} of matrices{held}")
    for constraint in mesh.constraints:
        found.tell("", constraint.told)
        if isinstance(constraint, Tie) and constraint.beside:
            found.doubts.append(
                f"{name}: {constraint.name}: {constraint.beside} nodes of the slave are not on the "
                f"master and free, {len(constraint.nodes)} are tied: meant so?"
            )
        if isinstance(constraint, Tie) and constraint.coarse:
            found.doubts.append(
                f"{name}: {constraint.name}: the slave has the coarser mesh, and the master "
                "is free between its nodes: make the finer face the slave"
            )
    for point_mass in geometry.file.point_mass:
        if point_mass.on.partition(".")[0] == name:
            where = "spread over" if point_mass.at is None else f"at {list(point_mass.at)} by"
            weight = NAMES.get(geometry.file.units, ("m", "kg", "kg m2"))[1]
            text = f"mass {point_mass.name}: {point_mass.mass:g} {weight}, {where} {point_mass.on}"
            found.tell("", text)
    _damping(found, geometry, name)
    for note in mesh.passed_over[:5]:
        found.tell("", f"not read: {note.keyword} (line {note.line}): {note.why}")
    if len(mesh.passed_over) > 5:
        found.tell("", f"and {len(mesh.passed_over) - 5} more that are not read")
    K, M = component_matrices(geometry, name, {})
    _weight(found, geometry.brake, body, M)
    _rigid(found, body, K, M)
    _measured(found, geometry, name, K, M)


def _measured(
    found: Inspection, geometry: Geometry, name: str, K: sp.csr_matrix, M: sp.csr_matrix
) -> None:
    """What a table imposes on free modes, and where it is far from what is computed."""
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
        told = [f"{mode.computed_hz:.1f} Hz"]
        if mode.frequency_scale is not None:
            change = 100 * (mode.frequency_scale - 1)
            told.append(f"measured {mode.frequency_hz:.1f} Hz ({change:+.2f} %)")
            if abs(mode.frequency_scale - 1) > DOUBTFUL:
                found.doubts.append(
                    f"{name}: mode {mode.number} is measured at {mode.frequency_hz:.1f} Hz and "
                    f"computed at {mode.computed_hz:.1f} Hz: is it this mode?"
                )
        if mode.damping_ratio is not None:
            told.append(f"damping ratio {mode.damping_ratio:.3g}")
        found.tell("", f"{table}: mode {mode.number}: {', '.join(told)}")
    if len(modes) < lines:
        found.doubts.append(
            f"{name}: {plural(lines - len(modes), 'line')} of {table} above {cutoff:g} Hz"
        )


def _damping(found: Inspection, geometry: Geometry, name: str) -> None:
    """Damping of its own, in SI units."""
    numbers, table = Numbers(geometry.file, {}), geometry.file.components[name]
    keys: KeyPath = ("components", name)
    told = [
        f"{key} {numbers.at(*keys, key):.4g} {dimension_of((*keys, key)).unit}"
        for key in DAMPING
        if getattr(table, key)
    ]
    by_material = {m: numbers.at(*keys, BY_MATERIAL, m) for m in table.material_damping}
    told += [f"of {material} {beta:.4g} s" for material, beta in by_material.items()]
    told += [f"C of {table.file_of('C')}"] * (table.C is not None)
    if told:
        found.tell("", f"damping: {', '.join(told)}")


def _weight(found: Inspection, brake: Brake, body: Body, M: sp.csr_matrix) -> None:
    """Mass, sides and inertia, and whether they are a brake's."""
    R = body.expansion.freedoms(rigid_shapes(body.nodes))
    about = R.T @ (M @ R)
    mass = float(about[0, 0])
    offset = np.array([about[5, 1], -about[5, 0], about[4, 0]]) / max(mass, 1e-300)
    inertia = about[3:, 3:] - mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    principal = np.linalg.eigvalsh(inertia)
    sides = np.ptp(body.nodes, axis=0)
    length, weight, moment = NAMES.get(brake.file.units, ("m", "kg", "kg m2"))
    in_units = (d.factor(brake.file.units) for d in (LENGTH, MASS, INERTIA))
    one, two, three = in_units
    extent = " x ".join(f"{s / one:.4g}" for s in sides)
    moments = ", ".join(f"{p / three:.3g}" for p in principal)
    shown = "" if weight == "kg" else f" ({mass:.4g} kg)"
    found.tell(
        "", f"{extent} {length}, {mass / two:.4g} {weight}{shown}, inertia {moments} {moment}"
    )
    if not MASSES[0] <= mass <= MASSES[1] or not SIZES[0] <= sides.max() <= SIZES[1]:
        found.doubts.append(
            f"{body.name} weighs {mass:.3g} kg and is {1e3 * sides.max():.3g} mm long, which no "
            f"part of a brake is: are its numbers in {brake.file.units}?"
        )


def _rigid(found: Inspection, body: Body, K: sp.csr_matrix, M: sp.csr_matrix) -> None:
    """Rigid modes, six of a free body, and the first elastic frequencies."""
    R = rigid_shapes(body.nodes)
    R = body.expansion.freedoms(R / np.linalg.norm(R, axis=0))
    forces = np.linalg.norm(K @ R, axis=0) / max(abs(K).max(), 1e-300)
    costly = [m for m, f in zip(MOTIONS, forces, strict=True) if f > RIGID]
    cutoff, elastic, rigid = FIRST_CUTOFF, np.zeros(0), 0
    while cutoff <= LAST_CUTOFF and len(elastic) < LISTED:
        omega, _ = real_modes(M, K, cutoff)
        rigid = rigid_count(K, M, omega)
        elastic, cutoff = omega[rigid:] / (2 * np.pi), 2 * cutoff
    hz = ", ".join(f"{f:.1f}" for f in elastic[:LISTED])
    first = f"first free modes {hz} Hz" if hz else f"no other mode up to {cutoff / 2:g} Hz"
    found.tell("", f"{plural(rigid, 'rigid mode')}, {first}")
    if costly:
        found.doubts.append(
            f"{body.name}: {plural(rigid, 'rigid mode')} of six, for motions {listed(costly)} "
            f"strain it (K R = {forces.max():.1e}): is a support still in the matrix, or "
            "are its rows those of other nodes?"
        )
    elif rigid > 6:
        found.doubts.append(
            f"{body.name}: {rigid} rigid modes of six: parts of it are not connected, or hang on a "
            "line or a point"
        )


# -- what is between -----------------------------------------------------------------------------
def _held(found: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    """Rigid motions of components that neither springs nor contact hold."""
    columns, names = [], []
    for component in assembly.components:
        body = geometry.bodies[component.name]
        whole = body.expansion.freedoms(rigid_shapes(body.nodes))
        part = np.zeros((assembly.n_dof, 6))
        part[assembly.slices[component.name]] = whole[geometry.kept[component.name]]
        columns.append(part)
        names += [(component.name, motion) for motion in MOTIONS]
    R = np.hstack(columns)
    c = assembly.contact
    K = assembly.K_el + assembly.K_springs(static=True)
    K = K + 1e12 * (c.N.T @ sp.diags(c.area) @ c.N)
    stiffness, mass = R.T @ (K @ R), R.T @ (assembly.M @ R)
    w2, shapes = la.eigh(stiffness, mass)
    free = shapes[:, w2 < FREE * max(float(w2[-1]), 1e-300)]
    if not free.shape[1]:
        found.tell("held", "every component, by springs and contact")
        return
    size = np.sqrt(np.einsum("ij,ij->i", free, free) * np.diag(mass))
    loose = [f"{n} {m}" for (n, m), s in zip(names, size, strict=True) if s > 0.1 * size.max()]
    found.doubts.append(
        f"{plural(free.shape[1], 'motion')} of components that nothing holds, of {listed(loose)}: "
        "a spring, a layer or a held set is missing (there is no working point without)"
    )


def _contact(found: Inspection, geometry: Geometry, assembly: Assembly, pressure: float) -> None:
    law = assembly.contact.law
    force = float(np.abs(assembly.load).sum()) * pressure  # on both sides of the disc
    mean = max(force / assembly.contact.area.sum(), 1.0)
    length = law.gap_scale(mean)
    size = LENGTH.factor(geometry.file.units)
    unit = NAMES.get(geometry.file.units, ("m",))[0]
    for i, (table, pair) in enumerate(zip(geometry.file.contact, geometry.contacts, strict=True)):
        low, high = (float(f(pair.geometric_gap)) / size for f in (np.min, np.max))
        normal = np.average(pair.slave.normal, axis=0, weights=pair.slave.area)
        spread = pair.gap_spread / length
        name = geometry.file.name_of("contact", i)
        found.tell(
            name,
            f"{table.kind}: {table.slave} on {table.master}, {len(pair.gap0):,} points, "
            f"{pair.slave.area.sum() / size**2:.4g} {unit}2, "
            f"{100 * pair.in_reach:.1f} % of the slave",
        )
        found.tell(
            "",
            f"normal of the slave {_vector(normal)}; gap {low:.3g} to {high:.3g} {unit} in the "
            f"files, scatter {spread:.2g} of the law's length ({1e6 * length:.2g} um at {mean:.2g} "
            f"Pa); taken as {table.initial_gap}",
        )
        if pair.in_reach < PARTLY:
            found.doubts.append(
                f"{name}: {100 * pair.in_reach:.0f} % of {table.slave} lies within "
                f"{table.search:g} {unit} of {table.master}: meant so?"
            )
        if table.initial_gap == "geometric" and spread > SPREAD:
            found.doubts.append(
                f"{name}: the gaps of the meshes scatter by {spread:.2g} lengths of the law, more "
                f'than {SPREAD:g}: chords of facets decide where it touches; initial_gap = "zero" '
                "leaves them out"
            )


def _ties(found: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    size = LENGTH.factor(geometry.file.units)
    unit = NAMES.get(geometry.file.units, ("m",))[0]
    for table, pair in zip(geometry.file.tie, geometry.ties, strict=True):
        spring = next(s for s in assembly.springs if s.name == table.name)
        assert isinstance(spring, SpringInterface)
        bedding = float(spring.stiffness[: len(pair.gap0)].sum() / pair.slave.area.sum())
        found.tell(
            table.name,
            f"tie: {table.slave} on {table.master}, {len(pair.gap0):,} points, "
            f"{100 * pair.in_reach:.1f} % of the slave, {bedding:.3g} N/m3, gap up to "
            f"{np.abs(pair.geometric_gap).max() / size:.2g} {unit}",
        )
        if pair.in_reach < PARTLY:
            found.doubts.append(
                f"{table.name}: {100 * pair.in_reach:.0f} % of {table.slave} is tied to "
                f"{table.master}: meant so?"
            )


def _vector(v: np.ndarray) -> str:
    return "[" + ", ".join(f"{c + 0.0:.3g}" for c in np.round(v, 6)) + "]"


def _rotation(found: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    rotation, contact = geometry.rotation, assembly.contact
    if rotation is None or geometry.file.rotation is None:
        found.tell("rotation", "none: nothing slides")
        return
    size = LENGTH.factor(geometry.file.units)
    unit = NAMES.get(geometry.file.units, ("m",))[0]
    rubbing = contact.frictional > 0
    radius = contact.radius[rubbing] / size
    rotor = ", ".join(geometry.rotors.names if geometry.rotors else ()) or "nothing"
    text = f"{rotor} turns about {_vector(rotation.direction)} through "
    text += _vector(np.asarray(rotation.point) / size)
    if len(radius):
        text += f"; contact from {radius.min():.4g} to {radius.max():.4g} {unit} of the axis"
    middle = geometry.effective_radius
    text += (
        "; all points at sliding_speed"
        if middle is None
        else f"; sliding_speed is that at {middle / size:.4g} {unit}"
    )
    found.tell("rotation", text)


def _stresses(found: Inspection, geometry: Geometry) -> None:
    table, bodies = geometry.file.stress_stiffening, geometry.bodies.values()
    if table is None:
        return
    megapascal = table.pressure * STRESS.factor(geometry.file.units) / 1e6
    told = ", ".join(b.name for b in bodies if b.matrices is None) or "nothing"
    text = f"stresses of {megapascal:g} MPa and a friction of {table.friction:g} stiffen {told}"
    without = ", ".join(b.name for b in bodies if b.matrices is not None)
    found.tell("stresses", text + (f"; not {without}, of matrices" if without else ""))


def _load(found: Inspection, geometry: Geometry) -> None:
    """Sums of the forces of a unit pressure, and whether they are in balance."""
    for i, table in enumerate(geometry.file.load):
        sums = []
        for surface in geometry.loads[i]:
            if surface is not None:
                share = surface.area / surface.area.sum()
                sums.append(-(share[:, None] * surface.normal).sum(axis=0))
        name = geometry.file.name_of("load", i)
        text = f"pressure pushes {table.pressure_on} along {_vector(sums[0])}"
        if len(sums) == 1:
            found.tell(name, f"{text}; no reaction")
            continue
        left = float(np.linalg.norm(sums[0] + sums[1]))
        found.tell(name, f"{text}, {table.reaction_on} along {_vector(sums[1])}")
        if left > BALANCE:
            found.doubts.append(
                f"{name}: pressure and reaction leave {100 * left:.2g} % of the force: their faces "
                "do not face each other"
            )
