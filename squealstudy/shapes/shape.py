"""A complex mode on all nodes of a model, with its energies and its motion at the contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.linalg.quadratic_pencil import squared
from squealstudy.linalg.real_modes import rigid_modes
from squealstudy.models.assembly import Assembly
from squealstudy.models.operating import ModeKey
from squealstudy.models.turning import Rotors
from squealstudy.reduction.cmt import Expansion, ReducedModel
from squealstudy.reduction.working_point import WorkingPoint
from squealstudy.shapes.parts import ShapePart, parts_of
from squealstudy.shapes.sources import Balance, Source, interface_energies, point_growth, sources_of
from squealstudy.system.coupled_pair import coupled_pair
from squealstudy.system.energies import reduced_energy_shares
from squealstudy.system.linearise import LinearisedModel, component_frequencies
from squealstudy.wording import in_digits, track_number

INTERFACES = "interfaces"
DAMPING = "damping"
UNNAMED = "contact"  # name of pairs of surfaces without names


@dataclass(frozen=True)
class Label:
    """Which mode it is.

    Attributes
    ----------
    study, point_id : str
        Name of the study, and id of the design point.
    row : int
        Row of the design point in the points table, from 0.
    values : mapping of parameter -> float
        Values of the design point that tables show.
    units : mapping of parameter -> str
        Units of parameters.
    mode : int
        Number of the mode at the design point, as in the modes table.
    track : int or None
        Number of the mode's track, as in rankings.
    fastest_hz : float or None
        Frequency of the track where it grows fastest, as in rankings, Hz.
    motion : str
        What the shape is of if it is no mode, such as ``end of the run``: it then has a frequency
        but no growth rate. Empty for modes.
    """

    study: str = ""
    point_id: str = ""
    row: int = 0
    values: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    mode: int = 0
    track: int | None = None
    motion: str = ""
    fastest_hz: float | None = None

    @property
    def number(self) -> str:
        """Name of the mode by its number: that of its track, else that at the design point."""
        if self.motion:
            return self.motion
        return f"mode {self.mode}" if self.track is None else track_number(self.track)

    @property
    def file_name(self) -> str:
        """Name of its files: number, frequency where it grows fastest, and id of the point."""
        hertz = (
            "" if self.fastest_hz is None else f"_{in_digits(self.fastest_hz)}_hz".replace(".", "_")
        )
        return f"{self.number.replace(' ', '_')}{hertz}_{self.point_id}"


@dataclass(frozen=True)
class ContactMotion:
    """The mode at the contact points, for a largest displacement of the shape of 1 m.

    A real quantity is the real part of the complex one times exp(i omega t).

    Attributes
    ----------
    points : ndarray (nc, 3)
        Coordinates of the contact points, m.
    area : ndarray (nc,)
        Area of each point, m2.
    pairs : tuple of str (nc,)
        Name of the pair of surfaces of each point.
    static_pressure : ndarray (nc,)
        Contact pressure in steady sliding, Pa.
    pressure : ndarray (nc,) complex
        Change of contact pressure -kappa N u, Pa per m.
    slip : ndarray (nc, 2) complex
        Relative displacement T u along the sliding direction and T_perp u across it, m per m.
    growth : ndarray (nc,)
        Part of friction at each point in the growth rate, 1/s (THEORY.md eq. (108)); positive where
        it feeds energy into the mode.
    power : ndarray (nc,)
        Mean power of friction at each point in a vibration of constant amplitude with a largest
        displacement of 1 m, W. At 1 um it is 1e-12 of that.
    """

    points: np.ndarray
    area: np.ndarray
    pairs: tuple[str, ...]
    static_pressure: np.ndarray
    pressure: np.ndarray
    slip: np.ndarray
    growth: np.ndarray
    power: np.ndarray

    @property
    def slip_amplitude(self) -> np.ndarray:
        """Largest slip (nc,) in a cycle, in any direction of the contact plane, m per m."""
        return amplitudes(self.slip)

    @property
    def fed(self) -> np.ndarray:
        """`growth` per area (nc,), 1/(s m2), which does not depend on the size of cells."""
        density: np.ndarray = self.growth / self.area
        return density


@dataclass(frozen=True)
class Shape:
    """A complex mode on all nodes (THEORY.md eq. (106), (107)).

    The motion is Re(displacement exp(lam t)). The largest displacement of a node in a cycle of
    constant amplitude is 1. The phase is chosen so that the sum of squares of the real part is
    largest.

    Attributes
    ----------
    label : Label
        Which mode it is.
    lam : complex
        Root, rad/s.
    coordinates : ndarray (n_nodes, 3)
        Coordinates of the nodes, m.
    displacement : ndarray (n_nodes, 3) complex
        Displacement of each node over the largest.
    parts : tuple of ShapePart
        Components of the model, in their order.
    energies : mapping of name -> float
        Share of each component, then of the interfaces, in the elastic energy (THEORY.md eq. (21)):
        the columns ``energy_*`` of the modes table.
    density : ndarray (n_nodes,)
        Share of the mode's elastic energy per volume at each node, 1/m3: the energy of the cells
        that meet there over their volume; NaN where a component has no cells.
    contact : ContactMotion
        The mode at the contact points.
    sources : tuple of Source
        Parts of the growth rate, which add up to it (THEORY.md eq. (108)): kinds of friction by
        pair of surfaces, damping by component, layer and contact. Parts that are zero are left out.
    interfaces : mapping of (kind, name) -> float
        Share of each ``layer`` (or spring) and each ``contact`` in the elastic energy; they add up
        to ``interfaces`` of `energies`.
    kinetic : mapping of name -> float
        Share of each component in psi^H M psi; they add up to 1.
    participation : mapping of (component, mode) -> float
        Share in psi^H M psi of each free-free mode of a component, numbered from 1 with rigid ones
        first. The rest of a component's share is motion that these modes do not have.
    frequencies : mapping of (component, mode) -> float
        Free-free frequency of each mode of `participation`, rad/s; 0 for rigid ones.
    rotors : Rotors or None
        The rotors and their axis.
    rubbed : mapping of component -> ndarray of int
        Indices of the contact points with friction on each rotor.
    pair : tuple of (float, float)
        For the two real modes, without coupling by friction, of which the mode mostly consists:
        frequency [Hz] and share in its kinetic energy, the larger share first; empty for a motion.
    pair_phase : float
        Phase between these two, deg, 0 to 90 (`system.coupled_pair`).
    """

    label: Label
    lam: complex
    coordinates: np.ndarray
    displacement: np.ndarray
    parts: tuple[ShapePart, ...]
    energies: Mapping[str, float]
    density: np.ndarray
    contact: ContactMotion
    sources: tuple[Source, ...]
    interfaces: Mapping[tuple[str, str], float] = field(default_factory=dict)
    kinetic: Mapping[str, float] = field(default_factory=dict)
    participation: Mapping[ModeKey, float] = field(default_factory=dict)
    frequencies: Mapping[ModeKey, float] = field(default_factory=dict)
    rotors: Rotors | None = None
    rubbed: Mapping[str, np.ndarray] = field(default_factory=dict)
    pair: tuple[tuple[float, float], ...] = ()
    pair_phase: float = np.nan

    @property
    def frequency_hz(self) -> float:
        """``|lam| / 2 pi``, Hz, as in the modes table."""
        return float(abs(self.lam) / (2 * np.pi))

    @property
    def growth_rate(self) -> float:
        """Re lam, 1/s."""
        return float(self.lam.real)

    @property
    def damping_ratio(self) -> float:
        """``-Re lam / |lam|``."""
        return float(-self.lam.real / abs(self.lam))

    @property
    def growth_from(self) -> dict[str, float]:
        """Parts of the growth rate, 1/s: friction of each pair of surfaces, and ``damping``."""
        fed = dict.fromkeys(self.contact.pairs, 0.0)
        for name in fed:
            of_pair = (s for s in self.sources if s.of_friction and s.where == name)
            fed[name] = sum(s.growth_rate for s in of_pair)
        return fed | {DAMPING: sum(s.growth_rate for s in self.sources if not s.of_friction)}

    @property
    def amplitude(self) -> np.ndarray:
        """Largest displacement (n_nodes,) of each node in a cycle; the largest of all is 1."""
        return amplitudes(self.displacement)

    def at(self, phase: float) -> np.ndarray:
        """Displacements (n_nodes, 3) at a phase [rad] of the cycle."""
        displacements: np.ndarray = (self.displacement * np.exp(1j * phase)).real
        return displacements

    def mac(self, other: Shape) -> float:
        """Modal assurance criterion with a shape of the same nodes, 0 to 1.

        ModelError if the other shape has other nodes.
        """
        a, b = self.displacement.ravel(), other.displacement.ravel()
        if len(a) != len(b):
            raise ModelError("shapes of different nodes have no MAC")
        return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real)


def amplitudes(u: np.ndarray) -> np.ndarray:
    """Largest ``|Re(u exp(i phi))|`` (n,) of complex vectors u (n, k): half axes of ellipses.

    THEORY.md eq. (107).
    """
    size, round_ = squared(u).sum(axis=1), np.abs((u**2).sum(axis=1))
    half_axes: np.ndarray = np.sqrt((size + round_) / 2)
    return half_axes


def turned(u: np.ndarray) -> complex:
    """The factor that scales vectors u (n, k) as those of a Shape (THEORY.md eq. (106))."""
    factor = np.exp(-0.5j * np.angle((u**2).sum()))
    real = (u * factor).real.ravel()
    if real[np.abs(real).argmax()] < 0:
        factor = -factor
    return complex(factor / amplitudes(u).max())


def shape_of(
    assembly: Assembly,
    expansion: Expansion,
    point: WorkingPoint,
    system: LinearisedModel,
    lam: complex,
    psi: np.ndarray,
    label: Label,
) -> Shape:
    """A mode of a component-mode model on all nodes of the assembly.

    Parameters
    ----------
    assembly : Assembly
        The assembly.
    expansion : Expansion
        Expansion of the component-mode model to the assembly.
    point : WorkingPoint
        Steady sliding about which the model is linearised.
    system : LinearisedModel
        The linearised component-mode model.
    lam : complex
        Root of an oscillating mode, rad/s.
    psi : ndarray (n,) complex
        Right vector in the coordinates of the model.
    label : Label
        Which mode it is.

    Raises
    ------
    ModelError
        Where the model has no node coordinates, or the root does not oscillate.
    """
    if any(not len(c.coordinates) for c in assembly.components):
        raise ModelError("this model has no mesh, and so no shape to show")
    if not lam.imag:
        raise ModelError("an overdamped mode does not oscillate: it has no shape to show")
    u = assembly.at_nodes(expansion.expand(psi))
    factor = turned(u)
    u, x = u * factor, psi * factor
    elastic = float(np.vdot(x, system.K_sym @ x).real)
    parts, density = parts_of(assembly, u, elastic)
    names = (*assembly.component_names, INTERFACES)
    shares = reduced_energy_shares(expansion.model, system.weights, x[:, None])[:, 0]
    model, pairs, dofs = expansion.model, _pairs(assembly), expansion.expand(x)
    balance = Balance(system, lam, x)
    friction = point_growth(model, system, balance, x)
    growth = np.asarray(sum(friction.values()))
    contact = _contact(assembly, expansion, point, growth, balance.power(growth), x)
    return Shape(
        label=label,
        lam=lam,
        coordinates=np.vstack([c.coordinates for c in assembly.components]),
        displacement=u,
        parts=parts,
        energies=dict(zip(names, map(float, shares), strict=True)),
        density=density,
        contact=contact,
        sources=sources_of(assembly, model, system, balance, friction, pairs, x, dofs),
        interfaces=interface_energies(assembly, model, system, pairs, x, dofs),
        frequencies=free_frequencies(assembly, model),
        rotors=assembly.rotors,
        rubbed=_rubbed(assembly),
        **_kinetic(model, x),
        **_pair(system, x),
    )


def _kinetic(model: ReducedModel, x: np.ndarray) -> dict[str, Any]:
    """Shares of components and of their free-free modes in x^H x, of a shape x (n,)."""
    share = squared(x) / squared(x).sum()
    sums = np.add.reduceat(share, model.offsets[:-1])
    modes = {
        (name, j + 1): float(share[int(start) + j])
        for name, start, count in zip(model.components, model.offsets, model.n_modes, strict=False)
        for j in range(count)
    }
    kinetic = dict(zip(model.components, map(float, sums), strict=True))
    return {"kinetic": kinetic, "participation": modes}


def _pair(system: LinearisedModel, x: np.ndarray) -> dict[str, Any]:
    """The real modes of a shape x (n,) with their shares, and the phase between them."""
    w2, phi = system.real_modes
    modes, share, phase = coupled_pair(phi, x)
    hz = np.sqrt(np.maximum(w2[modes], 0.0)) / (2 * np.pi)
    return {"pair": tuple(zip(hz.tolist(), share.tolist(), strict=True)), "pair_phase": phase}


def free_frequencies(assembly: Assembly, model: ReducedModel) -> dict[ModeKey, float]:
    """Frequency [rad/s] of each free-free mode of the basis; 0 for rigid ones."""
    omega_of = component_frequencies(model)
    for c in assembly.components:
        omega = np.array([w for (name, _), w in omega_of.items() if name == c.name])
        rigid = rigid_modes(c.M, c.K, omega)
        omega_of |= {(c.name, j + 1): 0.0 for j in range(rigid)}
    return omega_of


def _rubbed(assembly: Assembly) -> dict[str, np.ndarray]:
    contact, names = assembly.contact, assembly.rotors.names if assembly.rotors else ()
    rubbing = contact.frictional > 0
    touching = {name: contact.N[:, assembly.slices[name]].getnnz(axis=1) > 0 for name in names}
    return {name: np.flatnonzero(rubbing & rows) for name, rows in touching.items()}


def _contact(
    assembly: Assembly,
    expansion: Expansion,
    point: WorkingPoint,
    growth: np.ndarray,
    power: np.ndarray,
    x: np.ndarray,
) -> ContactMotion:
    """The motion at the contact points of a shape x (n,) in the coordinates of the model."""
    model, contact = expansion.model, assembly.contact
    opening, along, across = (rows @ x for rows in (model.N, model.T, model.T_perp))
    return ContactMotion(
        points=contact.points,
        area=contact.area,
        pairs=_pairs(assembly),
        static_pressure=point.contact_pressure,
        pressure=-point.tangent * opening,
        slip=np.column_stack([along, across]),
        growth=growth,
        power=power,
    )


def _pairs(assembly: Assembly) -> tuple[str, ...]:
    contact = assembly.contact
    return contact.pairs or (UNNAMED,) * contact.n_points
