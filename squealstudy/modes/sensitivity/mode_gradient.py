"""Products y^H Q_theta x of a complex mode and its neighbours: what derivatives are made of."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from squealstudy.modes.sensitivity.damping_gradient import DampingGradient
from squealstudy.modes.sensitivity.mode_family import ModeFamily
from squealstudy.system.linearise import ContactStructure, StructureWeights
from squealstudy.system.parametric import DAMPING, Columns, ParametricSystem, Term


class RealModes(NamedTuple):
    """Real modes that modal damping is put on.

    Attributes
    ----------
    omega : ndarray (m,)
        rad/s.
    phi : ndarray (n, m)
        Mass-normalised.
    momenta : ndarray (n, m)
        M phi.
    zeta : ndarray (m,)
        Their damping ratios.
    """

    omega: np.ndarray
    phi: np.ndarray
    momenta: np.ndarray
    zeta: np.ndarray


class ModeGradient:
    """A family of modes, seen through the terms of its structure.

    Parameters
    ----------
    family : ModeFamily
    structure : ContactStructure
        In the coordinates of the family.
    real : RealModes or None
        Needed where modal damping is in force, or a damping ratio of the assembly is asked for.

    Attributes
    ----------
    damping : DampingGradient or None
        None without modal damping.
    """

    def __init__(
        self, family: ModeFamily, structure: ContactStructure, real: RealModes | None
    ) -> None:
        self.family, self._N, self._real = family, structure.N, real
        self._X, self._Y = Columns(family.X), Columns(family.Y)
        terms = structure.system.terms
        self.damping = None
        if real is not None:
            rows = real.momenta.T
            terms = (*terms, Term(DAMPING, rows, rows))
            if real.zeta.any():
                left, right = rows @ family.Y[:, 0].conj(), rows @ family.X[:, 0]
                lam = complex(family.lam[0])
                self.damping = DampingGradient(real.omega, real.zeta, lam, left, right)
        self._system = ParametricSystem(structure.n, terms)

    def products(self, by: StructureWeights, ratios: np.ndarray | None = None) -> np.ndarray:
        """y_i^H Q_theta(lambda_j) x_j (k, k) under changes of weights and damping ratios (m,).

        The change of modal damping with the stiffness enters the first mode's own product only;
        between different modes it is of second order beside the stiffness itself.
        """
        weights: tuple[Any, ...] = by
        if self._real is not None:
            weights = (*by, 0.0 if ratios is None else 2.0 * self._real.omega * ratios)
        found = self._system.forms(weights, self.family.lam, self._X, self._Y)
        if self.damping is not None:
            if np.ndim(by.normal):
                found[0, 0] += self._by_normal @ by.normal
            if np.ndim(by.elastic):
                found[0, 0] += self._by_elastic @ by.elastic
        return found

    @cached_property
    def _by_normal(self) -> np.ndarray:
        """Of modal damping by the normal contact weights (nc,)."""
        assert self.damping is not None
        assert self._real is not None
        return self.damping.by_rows(np.asarray(self._N @ self._real.phi))

    @cached_property
    def _by_elastic(self) -> np.ndarray:
        """Of modal damping by the elastic diagonal (n,)."""
        assert self.damping is not None
        assert self._real is not None
        return self.damping.by_rows(self._real.phi)
