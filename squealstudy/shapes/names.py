"""What engineers call a mode: nodal diameters of the disc, component modes, rigid pads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.shapes.shape import Part, Shape
from squealstudy.system.linearise import squared

MIXED = "mixed"  # where no word fits
TOLD = 0.2  # least share of kinetic energy of a component that is named
PURE = 0.5  # least share of a harmonic, or of one component mode, that is named
RIGID = 0.8  # least share of rigid modes of what is called rigid
RIGID_MODES = 6  # of a free component: its first ones
MOST_DIAMETERS = 16
RADIAL = 3  # functions of the radius for each harmonic
EDGE = 0.02  # of the ring's width: nodes so near to it count as in it
SMALL = 0.05  # of the largest motion over the radius: below it a sign tells nothing


@dataclass(frozen=True)
class Waves:
    """Motion of the ring that is rubbed, as waves around the axis (THEORY.md eq. (109)).

    Attributes
    ----------
    out_of_plane : float
        Share of axial motion in the sum of |u|^2 over the ring.
    diameters : int
        Nodal diameters: the harmonic with the largest share in the axial motion, or in that in the
        plane, whichever is larger.
    share : float
        Of this harmonic in that motion.
    circles : int
        Nodal circles inside the ring, of axial motion; 0 of motion in the plane.
    """

    out_of_plane: float
    diameters: int
    share: float
    circles: int


@dataclass(frozen=True)
class Name:
    """A name with the figures that it rests on.

    Attributes
    ----------
    text : str
        As ``3 ND out of plane + caliper 13``; ``mixed`` where no word fits.
    waves : Waves or None
        None of a model without a rotor.
    """

    text: str
    waves: Waves | None


def name_of(shape: Shape) -> Name:
    """The name of a mode.

    Components with at least TOLD of the kinetic energy are named, the largest first: the rotor by
    its nodal diameters, any other as rigid where its rigid modes have at least RIGID of its kinetic
    energy, or by the free-free mode that has half of it.
    """
    waves = _waves(shape)
    words = []
    for component, share in sorted(shape.kinetic.items(), key=lambda item: -item[1]):
        if share < TOLD:
            break
        if component == shape.rotor and waves is not None:
            words.append(_rotor(component, waves))
        else:
            words.append(_component(shape, component, share))
    return Name(" + ".join(words) or MIXED, waves)


def figures_of(shape: Shape) -> str:
    """What the name rests on: kinetic energy by component, and the waves of the ring."""
    energy = ", ".join(
        f"{name.replace('_', ' ')} {100 * share:.0f} %" for name, share in shape.kinetic.items()
    )
    waves = name_of(shape).waves
    if waves is None:
        return f"kinetic energy: {energy}"
    axial = waves.out_of_plane >= PURE
    return (
        f"kinetic energy: {energy}; ring under the pads: {100 * waves.out_of_plane:.0f} % out of "
        f"plane, {waves.diameters} ND has {100 * waves.share:.0f} % of its motion "
        f"{'out of' if axial else 'in the'} plane"
    )


def _rotor(component: str, waves: Waves) -> str:
    plane = "out of plane" if waves.out_of_plane >= PURE else "in plane"
    if waves.share < PURE:
        return f"{component.replace('_', ' ')} {plane}"
    circles = f" {waves.circles} NC" if waves.circles else ""
    return f"{waves.diameters} ND{circles} {plane}"


def _component(shape: Shape, component: str, share: float) -> str:
    word = component.replace("_", " ")
    own = {mode: part for (name, mode), part in shape.participation.items() if name == component}
    rigid = sum(part for mode, part in own.items() if mode <= RIGID_MODES)
    if rigid >= RIGID * share:
        return f"rigid {word}"
    mode = max(own, key=lambda j: own[j])
    return f"{word} {mode}" if own[mode] >= PURE * share else word


def _waves(shape: Shape) -> Waves | None:
    """The waves of the ring that the contact points lie on; None without a rotor or points."""
    part = next((p for p in shape.parts if p.name == shape.rotor), None)
    if part is None or not len(shape.contact.points) or not part.blocks:
        return None
    nodes, weight = _ring(shape, part)
    x, y, _ = shape.coordinates[nodes].T
    r, theta = np.hypot(x, y), np.arctan2(y, x)
    u = shape.displacement[nodes]
    radial = (u[:, 0] * x + u[:, 1] * y) / r
    around = (u[:, 1] * x - u[:, 0] * y) / r
    directions = (u[:, 2], radial, around)
    axial, *plane = (float(weight @ squared(v)) for v in directions)
    out = axial / max(axial + sum(plane), 1e-300)
    used = directions[:1] if out >= PURE else directions[1:]
    scaled = 2 * (r - r.min()) / max(np.ptp(r), 1e-12) - 1
    over_radius = np.polynomial.legendre.legvander(scaled, RADIAL - 1)
    most = min(MOST_DIAMETERS, (len(np.unique(np.round(theta, 6))) - 1) // 4)
    orders = np.arange(-most, most + 1)
    base = np.exp(1j * theta[:, None] * orders)[:, :, None] * over_radius[:, None, :]
    base = base.reshape(len(r), -1)
    root = np.sqrt(weight)[:, None]
    fitted = [
        np.linalg.lstsq(root * base, root[:, 0] * v, rcond=None)[0].reshape(-1, RADIAL)
        for v in used
    ]
    size = np.zeros(most + 1)
    for coefficients in fitted:
        for n in range(most + 1):
            kept = np.where(np.abs(orders)[:, None] == n, coefficients, 0.0).ravel()
            size[n] += weight @ squared(base @ kept)
    n = int(size.argmax())
    total = sum(float(weight @ squared(v)) for v in used)
    circles = _circles(fitted[0][most + n], fitted[0][most - n]) if out >= PURE else 0
    return Waves(out, n, float(size[n] / max(total, 1e-300)), circles)


def _circles(one: np.ndarray, other: np.ndarray) -> int:
    """Sign changes over the radius of the larger of two waves, by their coefficients (RADIAL,)."""
    larger = one if np.linalg.norm(one) >= np.linalg.norm(other) else other
    values = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 41), larger)
    real = (values * np.exp(-0.5j * np.angle((values**2).sum()))).real
    told = real[np.abs(real) > SMALL * np.abs(real).max(initial=0.0)]
    return int((np.diff(np.sign(told)) != 0).sum())


def _ring(shape: Shape, part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n,) of the rotor between the radii and heights of the contact, their volumes (n,)."""
    volume = np.zeros(len(shape.coordinates))
    first = 0
    for _, cells in part.blocks:
        share = part.volumes[first : first + len(cells)] / cells.shape[1]
        np.add.at(volume, cells.ravel(), np.repeat(share, cells.shape[1]))
        first += len(cells)
    x, y, z = shape.contact.points.T
    r = np.hypot(x, y)
    edge = EDGE * np.ptp(r)
    at = shape.coordinates
    radius, height = np.hypot(at[:, 0], at[:, 1]), at[:, 2]
    inside = (volume > 0) & (radius >= r.min() - edge) & (radius <= r.max() + edge)
    inside &= (height >= z.min() - edge) & (height <= z.max() + edge)
    nodes = np.flatnonzero(inside)
    return nodes, volume[nodes]
