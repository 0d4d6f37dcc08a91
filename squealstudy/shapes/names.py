"""Names of modes as engineers use them: nodal diameters, component modes, rigid pads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.linalg.quadratic_pencil import squared
from squealstudy.shapes.parts import ShapePart
from squealstudy.shapes.shape import Shape

AND = " + "  # between the components of a name
MIXED = "mixed"  # where no word fits
MIN_NAMED_ENERGY_SHARE = 0.2  # least share of the kinetic energy of a component that is named
MIN_NAMED_SHARE = 0.5  # least share of a harmonic, or of a component mode, that is named
MIN_RIGID_SHARE = 0.8  # least share of rigid modes in a component that is called rigid
SAME_NAME_REL_DISTANCE = 1e-3  # relative distance of frequencies of modes that are named together
MOST_DIAMETERS = 16
N_RADIAL_FUNCTIONS = 3  # functions of the radius for each harmonic
THIN_RING_RATIO = 0.03  # width of a ring over its radius; thinner rings have no nodal circles
RIM_TOLERANCE = 0.02  # nodes within this distance of a ring, over its width, count as inside
MAX_RING_GAP_RAD = np.pi / 6  # widest angle without nodes in a closed ring, rad
MIN_SIGNED_MOTION = 0.05  # motion, over the largest along the radius, whose sign counts


@dataclass(frozen=True)
class Waves:
    """Motion of a rotor's ring at the contact, as waves around the axis (THEORY.md eq. (109)).

    Attributes
    ----------
    out_of_plane : float
        Share of axial motion in the sum of ``|u|^2`` over the ring.
    diameters : int
        Number of nodal diameters: the harmonic with the largest share in the axial motion or in the
        motion in the plane, whichever of both is larger.
    share : float
        Share of this harmonic in that motion.
    circles : int
        Number of nodal circles inside the ring in axial motion; 0 for motion in the plane.
    """

    out_of_plane: float
    diameters: int
    share: float
    circles: int


@dataclass(frozen=True)
class Name:
    """A name of a mode, with the waves that it comes from.

    Attributes
    ----------
    text : str
        Name such as ``3 ND out of plane + caliper 13``; ``mixed`` if no component is named.
    waves : Waves or None
        Waves of the rotor that moves most, of those with a ring; None without one.
    """

    text: str
    waves: Waves | None


def name_of(shape: Shape) -> Name:
    """The name of a mode.

    Components with at least MIN_NAMED_ENERGY_SHARE of the kinetic energy are named, the largest
    share first. A component whose rigid modes have at least MIN_RIGID_SHARE of its kinetic energy
    is called rigid. Another rotor with a ring is named by its nodal diameters, and any other
    component by the free-free mode that has half of its kinetic energy, if one has. Free-free modes
    of equal frequency, as of symmetric parts, are named together, as round-off numbers them.
    """
    names = shape.rotors.names if shape.rotors else ()
    rotors = sorted(names, key=lambda name: -shape.kinetic.get(name, 0.0))
    waves = {name: _waves(shape, name) for name in rotors}
    words = []
    for component, share in sorted(shape.kinetic.items(), key=lambda item: -item[1]):
        if share < MIN_NAMED_ENERGY_SHARE:
            break
        component_waves = waves.get(component)
        if component_waves and _rigid(shape, component) < MIN_RIGID_SHARE * share:
            words.append(_rotor(component, component_waves, len(rotors) > 1))
        else:
            words.append(_component(shape, component, share))
    return Name(AND.join(words) or MIXED, next(filter(None, waves.values()), None))


def figures_of(shape: Shape) -> str:
    """Text on what the name comes from: kinetic energy by component, and waves of the ring."""
    energy = ", ".join(
        f"{name.replace('_', ' ')} {100 * share:.0f} %" for name, share in shape.kinetic.items()
    )
    waves = name_of(shape).waves
    if waves is None:
        return f"kinetic energy: {energy}"
    axial = waves.out_of_plane >= MIN_NAMED_SHARE
    return (
        f"kinetic energy: {energy}; ring: {100 * waves.out_of_plane:.0f} % out of "
        f"plane, {waves.diameters} ND has {100 * waves.share:.0f} % of its motion "
        f"{'out of' if axial else 'in the'} plane"
    )


def _rotor(component: str, waves: Waves, several: bool) -> str:
    """The waves of a rotor in words; with its name if there are several rotors."""
    word = component.replace("_", " ")
    plane = "out of plane" if waves.out_of_plane >= MIN_NAMED_SHARE else "in plane"
    if waves.share < MIN_NAMED_SHARE:
        return f"{word} {plane}"
    circles = f" {waves.circles} NC" if waves.circles else ""
    return f"{word} " * several + f"{waves.diameters} ND{circles} {plane}"


def _component(shape: Shape, component: str, share: float) -> str:
    """Words for the motion of one component in a shape."""
    word = component.replace("_", " ")
    mode_shares = {
        mode: part for (name, mode), part in shape.participation.items() if name == component
    }
    omega = {mode: shape.frequencies.get((component, mode), np.nan) for mode in mode_shares}
    if _rigid(shape, component) >= MIN_RIGID_SHARE * share:
        return f"rigid {word}"
    groups: list[list[int]] = []
    for mode in sorted(mode for mode in mode_shares if omega[mode] != 0):
        near = (
            bool(groups)
            and omega[mode] - omega[groups[-1][-1]] < SAME_NAME_REL_DISTANCE * omega[mode]
        )
        groups = [*groups[:-1], [*groups[-1], mode]] if near else [*groups, [mode]]
    parts = [sum(mode_shares[mode] for mode in group) for group in groups]
    if not parts or max(parts) < MIN_NAMED_SHARE * share:
        return word
    first, *more = groups[int(np.argmax(parts))]
    return f"{word} {first}-{more[-1]}" if more else f"{word} {first}"


def _rigid(shape: Shape, component: str) -> float:
    """Share of the rigid modes of a component in the mode's kinetic energy."""
    return sum(
        part
        for key, part in shape.participation.items()
        if key[0] == component and shape.frequencies.get(key) == 0
    )


def _waves(shape: Shape, rotor: str) -> Waves | None:
    """The waves of a rotor's ring at the contact; None if it has none or the ring is not closed."""
    part = next((p for p in shape.parts if p.name == rotor), None)
    rubbed = shape.rubbed.get(rotor, np.zeros(0, dtype=int))
    if shape.rotors is None or part is None or not len(rubbed) or not part.blocks:
        return None
    axes = _axes(shape.rotors.direction)
    positions = (shape.coordinates - shape.rotors.point) @ axes
    nodes, weight = _ring(
        positions, (shape.contact.points[rubbed] - shape.rotors.point) @ axes, part
    )
    x, y, _ = positions[nodes].T
    r, theta = np.hypot(x, y), np.arctan2(y, x)
    most = _most_diameters(theta)
    if most is None:
        return None
    u = shape.displacement[nodes] @ axes
    radial = (u[:, 0] * x + u[:, 1] * y) / r
    around = (u[:, 1] * x - u[:, 0] * y) / r
    directions = (u[:, 2], radial, around)
    axial, *plane = (float(weight @ squared(v)) for v in directions)
    out = axial / max(axial + sum(plane), 1e-300)
    used = directions[:1] if out >= MIN_NAMED_SHARE else directions[1:]
    over_radius = _over_radius(r)
    orders = np.arange(-most, most + 1)
    base = np.exp(1j * theta[:, None] * orders)[:, :, None] * over_radius[:, None, :]
    base = base.reshape(len(r), -1)
    root = np.sqrt(weight)[:, None]
    fitted = [
        np.linalg.lstsq(root * base, root[:, 0] * v, rcond=None)[0].reshape(-1, N_RADIAL_FUNCTIONS)
        for v in used
    ]
    size = np.zeros(most + 1)
    for coefficients in fitted:
        for n in range(most + 1):
            of_order = np.where(np.abs(orders)[:, None] == n, coefficients, 0.0).ravel()
            size[n] += weight @ squared(base @ of_order)
    n = int(size.argmax())
    total = sum(float(weight @ squared(v)) for v in used)
    circles = _circles(fitted[0][most + n], fitted[0][most - n]) if out >= MIN_NAMED_SHARE else 0
    return Waves(out, n, float(size[n] / max(total, 1e-300)), circles)


def _over_radius(r: np.ndarray) -> np.ndarray:
    """Legendre functions (n, N_RADIAL_FUNCTIONS) of radii (n,); of a thin ring only the constant.

    The radii of nodes on a drum's face differ only by chords: variation over them is noise.
    """
    span = float(np.ptp(r))
    values: np.ndarray = np.polynomial.legendre.legvander(
        2 * (r - r.min()) / max(span, 1e-12) - 1, N_RADIAL_FUNCTIONS - 1
    )
    if span < THIN_RING_RATIO * r.mean():
        values[:, 1:] = 0.0
    return values


def _circles(wave: np.ndarray, other_wave: np.ndarray) -> int:
    """Number of sign changes over the radius of the larger of two waves, given by coefficients."""
    larger = wave if np.linalg.norm(wave) >= np.linalg.norm(other_wave) else other_wave
    values = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 41), larger)
    real = (values * np.exp(-0.5j * np.angle((values**2).sum()))).real
    significant = real[np.abs(real) > MIN_SIGNED_MOTION * np.abs(real).max(initial=0.0)]
    return int((np.diff(np.sign(significant)) != 0).sum())


def _axes(direction: np.ndarray) -> np.ndarray:
    """Columns (3, 3): two directions across an axis and the axis, right-handed; x, y, z for z."""
    unit_vector = np.eye(3)[np.abs(direction).argmin()]
    unit_vector = unit_vector - (unit_vector @ direction) * direction
    unit_vector /= np.linalg.norm(unit_vector)
    return np.column_stack([unit_vector, np.cross(direction, unit_vector), direction])


def _most_diameters(theta: np.ndarray) -> int | None:
    """Largest number of waves that nodes at angles (n,) can resolve; None if they are no ring.

    There are at least twice as many nodes as unknowns of the least squares, and four nodes in a
    wave.
    """
    around = np.unique(np.round(theta, 6))
    if not len(around) or np.diff(around, append=around[0] + 2 * np.pi).max() > MAX_RING_GAP_RAD:
        return None
    most = min(
        MOST_DIAMETERS, (len(around) - 1) // 4, (len(theta) // (2 * N_RADIAL_FUNCTIONS) - 1) // 2
    )
    return most if most >= 1 else None


def _ring(
    positions: np.ndarray, points: np.ndarray, part: ShapePart
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n,) of a rotor between the radii and heights of its contact, and their volumes (n,).

    The ring of a disc extends to its rim. `positions` of nodes and contact `points` (k, 3) are in
    the axes of `_axes`.
    """
    volume = np.zeros(len(positions))
    first = 0
    for _, cells in part.blocks:
        share = part.volumes[first : first + len(cells)] / cells.shape[1]
        np.add.at(volume, cells.ravel(), np.repeat(share, cells.shape[1]))
        first += len(cells)
    x, y, z = points.T
    r = np.hypot(x, y)
    edge = RIM_TOLERANCE * np.ptp(r)
    radius, height = np.hypot(positions[:, 0], positions[:, 1]), positions[:, 2]
    flat = np.ptp(r) > THIN_RING_RATIO * r.mean()  # else a drum, whose ring is the contact alone
    rim = np.inf if flat else r.max() + edge
    inside = (volume > 0) & (radius >= r.min() - edge) & (radius <= rim)
    inside &= (height >= z.min() - edge) & (height <= z.max() + edge)
    nodes = np.flatnonzero(inside)
    return nodes, volume[nodes]
