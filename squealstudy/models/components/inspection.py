"""Inspection of a model file: facts and doubts, to look at before running a study."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly
from squealstudy.models.components.bodies import Brake, body_of
from squealstudy.models.components.component_facts import (
    MOTIONS,
    Inspection,
    component_facts,
    rigid_shapes,
)
from squealstudy.models.components.dimensions import LENGTH, STRESS, UNITS
from squealstudy.models.components.file_tables import GapTable
from squealstudy.models.components.geometry import Geometry, geometry_at, geometry_of
from squealstudy.models.components.heat import hot_gaps, temperature_rise
from squealstudy.models.components.interface_facts import (
    friction_of,
    kind_of_contact,
    tell_interfaces,
)
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.model_file import HEAT, WEAR, ModelFile, Numbers
from squealstudy.models.file_table import KeyPath
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.wording import duration, listed, plural

FREE = 1e-9  # a rigid motion is free if its eigenvalue over the largest is smaller
SAME_PLACE = 1e-9  # meshes are the same if nodes are closer, over the component's size
SPREAD = 0.3  # gaps are doubted if their spread over the contact law's length is larger
PARTLY = 0.95  # a pair is doubted if less of the slave is in reach of the master
MAX_GAP_OVER_LAW_LENGTH = 5.0  # a pair is doubted if its least gap over the law's length is larger
BALANCE = 1e-6  # share of a force, or length of a mean normal, that counts as zero
# of reductions of 14,769, 48,588 and 115,959 freedoms: 0.85, 2.0, 3.5 GB; 18, 72, 350 s of a core
MEMORY, MEMORY_EACH = 0.4, 3e-5  # GB, and GB for each degree of freedom
SECONDS, FREEDOMS, GROWTH = 18.0, 14_769, 1.4  # s at a number of degrees of freedom; exponent


def inspect(
    brake: Brake, assembly: Assembly, pressure: float, overrides: Mapping[KeyPath, float]
) -> Inspection:
    """Collect facts and doubts about a brake.

    Parameters
    ----------
    brake : Brake
    assembly : Assembly
        The brake's, with `overrides`.
    pressure : float
        Brake pressure, Pa, at which the length scale of the contact law is taken.
    overrides : mapping of key -> float
        Values in SI units that replace numbers of the file, by key.

    Raises
    ------
    ModelError
        As in `geometry_of` and `component_matrices`.
    """
    geometry, as_meshed = geometry_at(brake, overrides), geometry_of(brake)
    inspection = Inspection()
    for body in as_meshed.bodies.values():
        component_facts(inspection, as_meshed, body, overrides)
    unheld(inspection, geometry, assembly)
    _contact(inspection, geometry, assembly, pressure, overrides)
    _ties(inspection, geometry, assembly)
    tell_interfaces(inspection, Numbers(geometry.file, overrides))
    _rotation(inspection, geometry, assembly)
    _load(inspection, geometry)
    _stresses(inspection, geometry)
    _heat(inspection, geometry, assembly, overrides)
    _wear(inspection, geometry, assembly, overrides)
    n, points = assembly.n_dof, assembly.contact.n_points
    seconds = SECONDS * (n / FREEDOMS) ** GROWTH
    inspection.tell(
        "size",
        f"{n:,} degrees of freedom, {points:,} contact points; a reduction needs about "
        f"{MEMORY + n * MEMORY_EACH:.1f} GB and {duration(seconds)} of a core",
    )
    return inspection


# -- supports, contact and interfaces ------------------------------------------------------------
def unheld(inspection: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    """Tell what holds the components, or doubt rigid motions that nothing holds."""
    columns, names = [], []
    for component in assembly.components:
        body = geometry.bodies[component.name]
        rigid_motions = body.expansion.freedoms(rigid_shapes(body.nodes))
        part = np.zeros((assembly.n_dof, 6))
        part[assembly.slices[component.name]] = rigid_motions[geometry.kept[component.name]]
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
        inspection.tell("held", f"every component, by {listed(_holders(geometry.file))}")
        return
    size = np.sqrt(np.einsum("ij,ij->i", free, free) * np.diag(mass))
    loose = [f"{n} {m}" for (n, m), s in zip(names, size, strict=True) if s > 0.1 * size.max()]
    inspection.doubts.append(
        f"{plural(free.shape[1], 'motion')} of components that nothing holds, of {listed(loose)}: "
        "a spring, a layer or a fixed set is missing; without it there is no working point"
    )


def _holders(file: ModelFile) -> list[str]:
    """Names of the kinds of parts that hold components at rest, and of fixed sets."""
    holders = ["contact"]
    holders += ["springs"] * any(spring.in_static for spring in file.spring)
    holders += [f"{table}s" for table in ("layer", "tie", "coupling") if file.at((table,))]
    for fixed in file.fixed:
        some = f" ({', '.join(map(str, fixed.dofs))})" if set(fixed.dofs) != {1, 2, 3} else ""
        holders.append(f"fixed {fixed.set}{some}")
    return holders


def _contact(
    inspection: Inspection,
    geometry: Geometry,
    assembly: Assembly,
    pressure: float,
    overrides: Mapping[KeyPath, float],
) -> None:
    law, numbers = assembly.contact.law, Numbers(geometry.file, overrides)
    force = float(np.abs(assembly.load).sum()) * pressure  # on both sides of the disc
    mean = max(force / assembly.contact.area.sum(), 1.0)
    length = law.gap_scale(mean)
    size = LENGTH.factor(geometry.file.units)
    unit = UNITS[geometry.file.units][0]
    for i, (table, pair) in enumerate(zip(geometry.file.contact, geometry.contacts, strict=True)):
        low, high = (float(f(pair.geometric_gap)) / size for f in (np.min, np.max))
        normal = np.average(pair.slave.normal, axis=0, weights=pair.slave.area)
        spread = pair.gap_spread / length
        name, taken = geometry.file.name_of("contact", i), str(table.initial_gap)
        if isinstance(table.initial_gap, GapTable):
            smallest, largest = (float(f(pair.gap0)) / size for f in (np.min, np.max))
            taken = f"{smallest:.3g} to {largest:.3g} {unit} of {table.initial_gap.file}"
        elif not isinstance(table.initial_gap, str):
            gap = overrides.get(("contact", i, "initial_gap"), table.initial_gap * size)
            taken = f"{gap / size:g} {unit}"
        inspection.tell(
            name,
            f"{kind_of_contact(numbers, i)}: {table.slave} on {table.master}, "
            f"{len(pair.gap0):,} points, "
            f"{pair.slave.area.sum() / size**2:.4g} {unit}2, "
            f"{100 * pair.in_reach:.1f} % of the slave{friction_of(geometry, numbers, i)}",
        )
        inspection.tell(
            "",
            f"{_normals(normal)}; gap {low:.3g} to {high:.3g} {unit} in the "
            f"files, scatter {spread:.2g} of the law's length ({1e6 * length:.2g} um at {mean:.2g} "
            f"Pa); taken as {taken}",
        )
        if pair.in_reach < PARTLY:
            inspection.doubts.append(
                f"{name}: {100 * pair.in_reach:.0f} % of {table.slave} lies within "
                f"{table.search:g} {unit} of {table.master}: meant so?"
            )
        smallest = float(pair.gap0.min()) / length
        if smallest > MAX_GAP_OVER_LAW_LENGTH:
            inspection.doubts.append(
                f"{name} is open without pressure, by {smallest:.2g} lengths of the law or more: "
                "unless the brake pressure closes it, nothing rubs; see open_share in results"
            )
        if (pull := _pull(geometry, i)) > 0:
            inspection.doubts.append(
                f"{name}: the pressure pulls {table.slave} and {table.master} apart, with "
                f"{100 * pull:.0f} % of its force on them: the other face of the pad, or normals "
                "that point inwards?"
            )
        if table.initial_gap == "geometric" and spread > SPREAD:
            inspection.doubts.append(
                f"{name}: the gaps of the meshes scatter by {spread:.2g} lengths of the law, more "
                f'than {SPREAD:g}: chords of facets decide where it touches; initial_gap = "zero" '
                "leaves them out"
            )


def _pull(geometry: Geometry, number: int) -> float:
    """Force on the two components of a contact that opens it, over the force of the pressure."""
    table, pair = geometry.file.contact[number], geometry.contacts[number]
    opening = -np.average(pair.slave.normal, axis=0, weights=pair.slave.area)
    sides = {table.slave.partition(".")[0]: opening, table.master.partition(".")[0]: -opening}
    total = 0.0
    for load, surfaces in zip(geometry.file.load, geometry.loads, strict=True):
        names = (load.pressure_on, load.reaction_on)
        for name, surface in zip(names, surfaces, strict=False):
            if surface is not None and name is not None:
                push = -np.average(surface.normal, axis=0, weights=surface.area)
                total += float(push @ sides.get(name.partition(".")[0], np.zeros(3)))
    return total if total > BALANCE else 0.0


def same_mesh(first: SolidMesh, other: SolidMesh) -> bool:
    """Whether two meshes of one component have the same elements in the same places."""
    from scipy.spatial import cKDTree

    distance, node = cKDTree(first.nodes).query(other.nodes)
    span = float(np.ptp(first.nodes, axis=0).max())
    if distance.max() > SAME_PLACE * span or len(np.unique(node)) < len(node):
        return False
    start = 0
    for a, b in zip(first.blocks, other.blocks, strict=True):
        rows = slice(start, start := start + len(a.nodes))
        elements = [
            {*zip(map(tuple, np.sort(nodes, axis=1).tolist()), mesh.material[rows], strict=True)}
            for nodes, mesh in ((a.nodes, first), (node[b.nodes], other))
        ]
        if elements[0] != elements[1]:
            return False
    return True


def _ties(inspection: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    size = LENGTH.factor(geometry.file.units)
    unit = UNITS[geometry.file.units][0]
    for table, pair in zip(geometry.file.tie, geometry.ties, strict=True):
        spring = next(s for s in assembly.springs if s.name == table.name)
        assert isinstance(spring, SpringInterface)
        bedding = float(spring.stiffness[: len(pair.gap0)].sum() / pair.slave.area.sum())
        inspection.tell(
            table.name,
            f"tie: {table.slave} on {table.master}, {len(pair.gap0):,} points, "
            f"{100 * pair.in_reach:.1f} % of the slave, {bedding:.3g} N/m3, gap up to "
            f"{np.abs(pair.geometric_gap).max() / size:.2g} {unit}",
        )
        if pair.in_reach < PARTLY:
            inspection.doubts.append(
                f"{table.name}: {100 * pair.in_reach:.0f} % of {table.slave} is tied to "
                f"{table.master}: meant so?"
            )


def _vector(v: np.ndarray) -> str:
    return "[" + ", ".join(f"{c + 0.0:.3g}" for c in np.round(v, 6)) + "]"


def _normals(mean: np.ndarray) -> str:
    """Text on the mean normal of a slave."""
    if np.linalg.norm(mean) < BALANCE:
        return "the slave looks all round, its normals cancel"
    return f"normal of the slave {_vector(mean)}"


def _along(force: np.ndarray) -> str:
    """Text on the direction of a force."""
    return f"along {_vector(force)}" if np.linalg.norm(force) >= BALANCE else "from all round"


def _rotation(inspection: Inspection, geometry: Geometry, assembly: Assembly) -> None:
    rotation, contact = geometry.rotation, assembly.contact
    if rotation is None or geometry.file.rotation is None:
        inspection.tell("rotation", "none: nothing slides")
        return
    size = LENGTH.factor(geometry.file.units)
    unit = UNITS[geometry.file.units][0]
    rubbing = (contact.frictional > 0) & (contact.speed_factor > 0)
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
    inspection.tell("rotation", text)
    for name in geometry.turned:
        again = same_mesh(geometry.bodies[name].mesh, body_of(geometry.brake, name).mesh)
        inspection.tell(
            "angle",
            f"{name} stands turned by {geometry.angle:g} deg; its mesh "
            + ("is the same there" if again else "is another there, of a symmetric part too"),
        )


def _stresses(inspection: Inspection, geometry: Geometry) -> None:
    table, bodies = geometry.file.stress_stiffening, geometry.bodies.values()
    if table is None:
        return
    megapascal = table.pressure * STRESS.factor(geometry.file.units) / 1e6
    names = ", ".join(b.name for b in bodies if b.matrices is None) or "nothing"
    text = f"stresses of {megapascal:g} MPa and a friction of {table.friction:g} stiffen {names}"
    without = ", ".join(b.name for b in bodies if b.matrices is not None)
    inspection.tell("stresses", text + (f"; not {without}, of matrices" if without else ""))


def _wear(
    inspection: Inspection,
    geometry: Geometry,
    assembly: Assembly,
    overrides: Mapping[KeyPath, float],
) -> None:
    """Tell how deep sliding has worn each contact with friction."""
    file = geometry.file
    if file.wear is None:
        return
    numbers, size, unit = Numbers(file, overrides), LENGTH.factor(file.units), UNITS[file.units][0]
    megapascal = file.wear.pressure * STRESS.factor(file.units) / 1e6
    load = f"{megapascal:g} MPa and a friction of {file.wear.friction:g}"
    distance = numbers.at(WEAR, "distance")
    if not distance:
        inspection.tell("wear", "the faces are new: the distance of [wear] is 0")
        return
    unworn = new_gaps(geometry, numbers) + hot_gaps(assembly, geometry, overrides)
    depth = assembly.contact.gap0 - unworn
    depths, begins = [], np.cumsum([0, *(len(pair.gap0) for pair in geometry.contacts)])
    for i, pair in enumerate(geometry.contacts):
        rows = slice(begins[i], begins[i + 1])
        contact = assembly.contact
        rubbing = (contact.frictional[rows] > 0) & (contact.speed_factor[rows] > 0)
        worn = depth[rows][rubbing] / size
        if len(worn):
            mean = np.average(worn, weights=pair.slave.area[rubbing])
            name = file.name_of("contact", i)
            depths.append(f"{name} {worn.min():.3g} to {worn.max():.3g} {unit} (mean {mean:.3g})")
    text = "; ".join(depths) or "nothing: no contact has friction"
    inspection.tell("wear", f"{distance / size:g} {unit} of sliding at {load} wore off {text}")


def _heat(
    inspection: Inspection,
    geometry: Geometry,
    assembly: Assembly,
    overrides: Mapping[KeyPath, float],
) -> None:
    """Tell temperatures of hot components, and how far they open the gaps together."""
    numbers = Numbers(geometry.file, overrides)
    hot = [n for n, table in geometry.file.components.items() if table.heat is not None]
    if not hot:
        return
    texts = []
    for name in hot:
        rise = numbers.at("components", name, *HEAT) * temperature_rise(
            geometry.brake, body_of(geometry.brake, name)
        )
        texts.append(f"{name} is {rise.min():.4g} to {rise.max():.4g} K above its mesh")
    size, unit = LENGTH.factor(geometry.file.units), UNITS[geometry.file.units][0]
    opened, pairs = hot_gaps(assembly, geometry, overrides) / size, np.array(assembly.contact.pairs)
    for name in dict.fromkeys(assembly.contact.pairs):
        smallest, largest = (f(opened[pairs == name]) for f in (np.min, np.max))
        texts.append(f"{name} opens by {smallest:.3g} to {largest:.3g} {unit}")
    inspection.tell("heat", f"{'; '.join(texts)}, but for motions that nothing holds")


def new_gaps(geometry: Geometry, numbers: Numbers) -> np.ndarray:
    """Gaps (n_points,) [m] at rest of all contacts, as if new."""
    gaps = []
    for i, (table, pair) in enumerate(zip(geometry.file.contact, geometry.contacts, strict=True)):
        scale = 1.0 if table.gap_scale is None else numbers.at("contact", i, "gap_scale")
        gap_value = numbers.given.get(("contact", i, "initial_gap"))
        gaps.append(pair.gap0 * scale if gap_value is None else np.full_like(pair.gap0, gap_value))
    all_gaps: np.ndarray = np.concatenate(gaps)
    return all_gaps


def _load(inspection: Inspection, geometry: Geometry) -> None:
    """Tell the resultants of a unit pressure; doubt them where they are not in balance."""
    for i, table in enumerate(geometry.file.load):
        sums = []
        for surface in geometry.loads[i]:
            if surface is not None:
                share = surface.area / surface.area.sum()
                sums.append(-(share[:, None] * surface.normal).sum(axis=0))
        name = geometry.file.name_of("load", i)
        if np.linalg.norm(sums[0]) < BALANCE:
            inspection.doubts.append(
                f"{name}: the forces of the pressure on {table.pressure_on} cancel: is this the "
                "face that is pressed?"
            )
        text = f"pressure pushes {table.pressure_on} {_along(sums[0])}"
        if table.area is None:
            size = LENGTH.factor(geometry.file.units) ** 2
            unit = UNITS[geometry.file.units][0]
            text += f", over its own {geometry.loads[i][0].area.sum() / size:.4g} {unit}2"
        if len(sums) == 1:
            inspection.tell(name, f"{text}; no reaction")
            continue
        unbalanced = float(np.linalg.norm(sums[0] + sums[1]))
        inspection.tell(name, f"{text}, {table.reaction_on} {_along(sums[1])}")
        if unbalanced > BALANCE:
            inspection.doubts.append(
                f"{name}: pressure and reaction leave {100 * unbalanced:.2g} % of the force: "
                "their faces do not face each other"
            )
