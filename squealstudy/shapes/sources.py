"""Parts of a mode's growth rate and elastic energy: of friction, damping and interfaces.

The imaginary part of psi^H Q(lambda) psi = 0 splits the growth rate over any parts of C and K
(THEORY.md eq. (108)).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from squealstudy.linalg.quadratic_pencil import squared
from squealstudy.models.assembly import Assembly
from squealstudy.reduction.cmt import ReducedModel
from squealstudy.system.linearise import LinearisedModel

# kinds of sources; friction first
COUPLING, ALONG, ACROSS = "coupling", "along", "across"
FRICTION = (COUPLING, ALONG, ACROSS)
COMPONENT, LAYER, CONTACT, ASSEMBLY = "component", "layer", "contact", "assembly"


@dataclass(frozen=True)
class Source:
    """A part of the growth rate.

    Attributes
    ----------
    kind : str
        For friction: ``coupling`` (its change with pressure), ``along`` (its change with sliding
        speed) or ``across`` the sliding direction. For damping: ``component`` (its own damping,
        that of component modes, stiffness damping), ``layer`` (stiffness damping of springs and
        layers), ``contact`` (stiffness damping of the normal contact stiffness) or ``assembly``
        (modal damping).
    where : str
        Pair of surfaces, component, or layer; empty for the assembly.
    growth_rate : float
        Part of the growth rate, 1/s; positive where energy is fed into the mode.
    power : float
        Mean power fed into a vibration of constant amplitude with a largest displacement of 1 m, W;
        it is proportional to the square of the amplitude.
    """

    kind: str
    where: str
    growth_rate: float
    power: float

    @property
    def of_friction(self) -> bool:
        """Whether it is a part of friction, not of damping."""
        return self.kind in FRICTION


class Balance:
    """Parts of the growth rate and of the power of one mode.

    Parameters
    ----------
    system : LinearisedModel
        The linearised model.
    lam : complex
        Root of an oscillating mode, rad/s.
    x : ndarray (n,) complex
        Right vector with a largest displacement of 1 m.
    """

    def __init__(self, system: LinearisedModel, lam: complex, x: np.ndarray) -> None:
        self.omega = lam.imag
        self._scale = 2 * self.omega * squared(x).sum() + np.vdot(x, system.C @ x).imag

    def growth(self, damping: Any, stiffness: Any = 0.0) -> Any:
        """Growth rates [1/s] by parts Re x^H C_i x and Im x^H K_i x, numbers or arrays."""
        return -(self.omega * damping + stiffness) / self._scale

    def power(self, growth: Any) -> Any:
        """Mean power [W] at constant amplitude that parts of the growth rate [1/s] are."""
        return growth * self.omega * self._scale / 2


def point_growth(
    model: ReducedModel, system: LinearisedModel, balance: Balance, x: np.ndarray
) -> dict[str, np.ndarray]:
    """Part (nc,) of friction at each contact point in the growth rate [1/s], for each kind."""
    weights = system.weights
    opening, along, across = (rows @ x for rows in (model.N, model.T, model.T_perp))
    return {
        COUPLING: balance.growth(0.0, weights.coupling * (along.conj() * opening).imag),
        ALONG: balance.growth(weights.along * squared(along)),
        ACROSS: balance.growth(weights.across * squared(across)),
    }


def sources_of(
    assembly: Assembly,
    model: ReducedModel,
    system: LinearisedModel,
    balance: Balance,
    friction: Mapping[str, np.ndarray],
    pairs: tuple[str, ...],
    x: np.ndarray,
    u: np.ndarray,
) -> tuple[Source, ...]:
    """All parts of the growth rate of a mode that are not zero.

    Parameters
    ----------
    assembly, model, system : Assembly, ReducedModel, LinearisedModel
        The assembly, its component-mode model, and that model linearised.
    balance : Balance
        Balance of the mode.
    friction : mapping of kind -> ndarray (nc,)
        Growth rates by `point_growth`, 1/s.
    pairs : tuple of str (nc,)
        Pair of surfaces of each contact point.
    x : ndarray (n,) complex
        Right vector in the coordinates of the model.
    u : ndarray (n_dof,) complex
        Right vector in the degrees of freedom of the assembly.
    """
    weights, opening = system.weights, squared(model.N @ x)
    parts = [
        (kind, where, growth)
        for where in dict.fromkeys(pairs)
        for kind, of_points in friction.items()
        for growth in [float(of_points[_mask(pairs, where)].sum())]
    ]
    modal_damping = np.broadcast_to(weights.elastic_damping, model.n) * squared(x)
    if model.C_el is not None:  # block diagonal: each component has its own x^H C x
        modal_damping = modal_damping + weights.own_damping * (x.conj() * (model.C_el @ x)).real
    damping = [
        *(
            (COMPONENT, name, part)
            for name, part in zip(
                model.components, np.add.reduceat(modal_damping, model.offsets[:-1]), strict=True
            )
        ),
        *(
            (LAYER, name, weights.spring_damping * energy)
            for name, energy in _layer_energies(assembly, u)
        ),
        *(
            (CONTACT, pair, part)
            for pair, part in _by_pair(pairs, weights.normal_damping * opening)
        ),
        (ASSEMBLY, "", _modal(system, x)),
    ]
    parts += [(kind, where, float(balance.growth(part))) for kind, where, part in damping]
    return tuple(
        Source(kind, where, growth, float(balance.power(growth)))
        for kind, where, growth in parts
        if growth
    )


def interface_energies(
    assembly: Assembly,
    model: ReducedModel,
    system: LinearisedModel,
    pairs: tuple[str, ...],
    x: np.ndarray,
    u: np.ndarray,
) -> dict[tuple[str, str], float]:
    """Shares of layers and contacts, by kind and name, in the elastic energy of a mode."""
    total = float(np.vdot(x, system.K_sym @ x).real)
    weights = system.weights
    contact = _by_pair(pairs, weights.normal * squared(model.N @ x))
    energies = {(CONTACT, pair): part for pair, part in contact}
    energies |= {(LAYER, n): weights.springs * part for n, part in _layer_energies(assembly, u)}
    return {key: float(part / total) for key, part in energies.items()}


def _modal(system: LinearisedModel, x: np.ndarray) -> float:
    """x^H C x of the assembly's modal damping."""
    if not np.ndim(system.C_modal):
        return 0.0
    return float(np.vdot(x, np.asarray(system.C_modal) @ x).real)


def _layer_energies(assembly: Assembly, u: np.ndarray) -> Iterator[tuple[str, float]]:
    """Yield the name of each spring or layer, and u^H K u of all with that name."""
    for name in dict.fromkeys(s.name for s in assembly.springs):
        of_name = (s for s in assembly.springs if s.name == name)
        yield name, sum(s.energy(u) for s in of_name)


def _by_pair(pairs: tuple[str, ...], values: np.ndarray) -> Iterator[tuple[str, float]]:
    for pair in dict.fromkeys(pairs):
        yield pair, float(values[_mask(pairs, pair)].sum())


def _mask(pairs: tuple[str, ...], pair: str) -> np.ndarray:
    return np.array([name == pair for name in pairs], dtype=bool)
