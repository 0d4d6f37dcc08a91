"""The unreduced matrices of a design point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from squealstudy.models.assembly import Assembly, ContactInterface
from squealstudy.models.operating import OperatingPoint


@dataclass(frozen=True, eq=False)
class Unreduced:
    """M u'' + C u' + K u = load + contact forces, before anything is reduced.

    Attributes
    ----------
    assembled : Assembly
        Components, interfaces, degrees of freedom.
    operating : OperatingPoint
        Pressure, friction, sliding and laws of the design point.

    Examples
    --------
    >>> import squealstudy as sq
    >>> assembly = sq.model("hoffmann").at().assembly
    >>> assembly.names, assembly.M.shape, assembly.contact.n_points
    (('mass',), (2, 2), 1)
    """

    assembled: Assembly
    operating: OperatingPoint

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return self.assembled.n_dof

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the components in the order of their degrees of freedom (`slices`)."""
        return self.assembled.component_names

    @property
    def slices(self) -> dict[str, slice]:
        """Degrees of freedom of each component."""
        return self.assembled.slices

    @property
    def M(self) -> sp.csr_matrix:
        """Mass (n_dof, n_dof), kg."""
        return self.assembled.M

    @cached_property
    def C(self) -> sp.csr_matrix:
        """Damping of elements and gyroscopic terms (n_dof, n_dof), N s/m, without modal damping."""
        parts = [sp.csr_matrix(self.M.shape)]
        if self.assembled.C_el is not None:
            parts.append(self.assembled.C_el)
        turning, rotors = self.assembled.turning, self.assembled.rotors
        self.operating.expect_turning(turning, "" if rotors is None else rotors.unturned)
        if turning is not None and self.operating.turning:
            parts.append(self.operating.turning * turning)
        return sum(parts[1:], parts[0])

    @cached_property
    def K(self) -> sp.csr_matrix:
        """Stiffness (n_dof, n_dof) of components and linear springs, without contact, N/m.

        Cubic springs, and springs with a gap or that act on one side only, are the last points of
        `contact` instead.
        """
        return (self.assembled.K_el + self.assembled.K_springs()).tocsr()

    @property
    def contact(self) -> ContactInterface:
        """Contact points: N, T, T_perp (nc, n_dof), areas [m2], gaps [m], radii [m].

        The last points are nonlinear springs, with their properties `spring_points` (ns, 5).
        """
        return self.assembled.contact

    @property
    def load(self) -> np.ndarray:
        """Forces (n_dof,) of the brake pressure plus constant ones, N."""
        forces: np.ndarray = (
            self.operating.brake_pressure * self.assembled.load + self.assembled.constant_load
        )
        return forces
