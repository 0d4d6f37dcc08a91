"""An assembly: disjoint components, the interfaces between them, and loads (THEORY.md eq. (23)).

Interfaces are kept as observation matrices and point weights, not as assembled matrices, so that
stiffness, pressure, friction and law remain parameters (THEORY.md eq. (1), (2)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws import ContactLaw
from squealstudy.laws.own_friction import NO_OWN_FRICTION, has_own
from squealstudy.laws.spring import N_SPRING, NO_SPRINGS
from squealstudy.models.cells import ComponentCells
from squealstudy.models.component_slices import component_slices
from squealstudy.models.linear_interfaces import (
    DamperInterface,
    SpringInterface,
    StressStiffness,
)
from squealstudy.models.matrix_checks import check_masses, check_size, check_skew, check_symmetric
from squealstudy.models.turning import Rotors

if TYPE_CHECKING:  # scikit-fem is slow to load
    from squealstudy.models.fem.sampling import Surface


@dataclass(frozen=True)
class Component:
    """One elastic (or rigid) body of an assembly.

    Attributes
    ----------
    name : str
        Used in parameter names and in the columns ``energy_<name>``.
    M, K : csr_matrix (n, n)
        Mass [kg], positive definite, and elastic stiffness [N/m], positive semi-definite.
    coordinates : ndarray (n_nodes, 3)
        Node coordinates, m; empty for minimal models.
    correspondence : csr_matrix (s, n) or None
        Observes displacements by which mode shapes of two structures are compared: the same places
        of the component whatever the parameters, each times the square root of the mass that it
        represents. None for the degrees of freedom themselves, with the diagonal of M.
    cells : ComponentCells or None
        Cells of a meshed component, for pictures of its shapes.
    dofs : ndarray (n,) of int or None
        3 * node + axis of each degree of freedom; -1 for a rotation or a modal coordinate. None if
        all 3 n_nodes displacements are degrees of freedom: none is held, and no node follows
        others.
    expansion : csr_matrix (3 n_nodes, n) or None
        Maps degrees of freedom to displacements of all nodes, where some nodes follow others; None
        where `dofs` is enough.
    C : csr_matrix (n, n) or None
        The component's own damping, N s/m, symmetric; None where it has none.
    G : csr_matrix (n, n) or None
        Gyroscopic terms, N s/m, skew-symmetric; None where it does not turn or they are left out.
    turning : csr_matrix (n, n) or None
        Gyroscopic terms of a rotor seen from places at rest, kg at 1 rad/s, skew-symmetric; None
        where it is no rotor or has no such terms (`Rotors.unturned`).
    sets : mapping of name -> callable
        Named faces of a generated component; each callable returns the points of a face
        (models.fem.sampling.Surface).

    Raises
    ------
    ModelError
        Wrong shapes, non-finite values, asymmetry, or a diagonal that rules out definiteness.
    """

    name: str
    M: sp.csr_matrix
    K: sp.csr_matrix
    coordinates: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    correspondence: sp.csr_matrix | None = None
    cells: ComponentCells | None = None
    dofs: np.ndarray | None = None
    expansion: sp.csr_matrix | None = None
    C: sp.csr_matrix | None = None
    sets: Mapping[str, Callable[[], Surface]] = field(default_factory=dict)
    G: sp.csr_matrix | None = None
    turning: sp.csr_matrix | None = None

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ModelError(f"component name '{self.name}' must be an identifier")
        for label, A in (("mass", self.M), ("stiffness", self.K)):
            check_symmetric(f"component '{self.name}': {label} matrix", A, self.n_dof)
        if self.C is not None:
            check_symmetric(f"component '{self.name}': damping matrix", self.C, self.n_dof)
        if self.G is not None:
            check_skew(f"component '{self.name}': gyroscopic matrix", self.G, self.n_dof)
        if self.turning is not None:
            check_skew(f"component '{self.name}': matrix of rotation", self.turning, self.n_dof)
        check_masses(f"component '{self.name}': mass matrix", self.M)
        if (self.K.diagonal() < 0).any():
            raise ModelError(f"component '{self.name}': stiffness is not positive semi-definite")
        if self.correspondence is not None and self.correspondence.shape[1] != self.n_dof:
            raise ModelError(
                f"component '{self.name}': its correspondence does not have {self.n_dof} columns"
            )
        expected = 3 * len(self.coordinates) if self.dofs is None else len(self.dofs)
        if len(self.coordinates) and expected != self.n_dof:
            raise ModelError(
                f"component '{self.name}': {len(self.coordinates)} nodes do not match "
                f"{self.n_dof} degrees of freedom"
            )

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return int(self.M.shape[0])

    @property
    def observer(self) -> sp.csr_matrix:
        """The matrix `correspondence`, or its default where it is None."""
        if self.correspondence is not None:
            return self.correspondence
        return sp.diags(np.sqrt(self.M.diagonal())).tocsr()

    @property
    def mass(self) -> float:
        """Mass [kg] that moves in a unit translation along x (3-D components)."""
        t = ((self.places >= 0) & (self.places % 3 == 0)).astype(float)
        return float(t @ (self.M @ t))

    @property
    def places(self) -> np.ndarray:
        """3 * node + axis of each degree of freedom (n,) (3-D components), -1 for none."""
        return np.arange(self.n_dof) if self.dofs is None else self.dofs

    def at_nodes(self, u: np.ndarray) -> np.ndarray:
        """Displacements (3 n_nodes, ...) of all nodes from degrees of freedom u (n, ...)."""
        if self.expansion is not None:
            expanded: np.ndarray = self.expansion @ u
            return expanded
        displacements = np.zeros((3 * len(self.coordinates), *u.shape[1:]), dtype=u.dtype)
        displacements[self.places] = u
        return displacements

    def restricted(self, A: sp.csr_matrix) -> sp.csr_matrix:
        """A matrix (3 n_nodes, 3 n_nodes) of the nodes, over the degrees of freedom (n, n)."""
        if self.expansion is None:
            return A[self.places][:, self.places]
        projected = (self.expansion.T @ A @ self.expansion).tocsr()
        return ((projected + projected.T) / 2).tocsr()


@dataclass(frozen=True)
class ContactInterface:
    """Contact points with friction; degrees of freedom are those of the whole assembly.

    Attributes
    ----------
    N : csr_matrix (n_points, n_dof)
        Gap g = gap0 + N q, positive when open.
    T : csr_matrix (n_points, n_dof)
        Relative displacement of the sliding body under the other, along the sliding direction.
    T_perp : csr_matrix (n_points, n_dof)
        The same across the sliding direction (both in the contact plane).
    area : ndarray (n_points,)
        Area of each point, m2, positive.
    gap0 : ndarray (n_points,)
        Initial gap, m.
    radius : ndarray (n_points,)
        Arm of the friction force about the axis of rotation, m.
    law : ContactLaw
        Default law.
    frictional : ndarray (n_points,)
        Factor on the friction coefficient of the operating point, not negative; 0 for contact
        without friction, whose rows of T and T_perp may be empty.
    speed_factor : ndarray (n_points,)
        Sliding speed of each point over the imposed speed, positive. On a body that turns it is the
        radius of the point over the radius of the imposed speed. 1 by default, and set to 1 at
        points without friction. 0 at points with friction of their own on which no sliding is
        imposed.
    points : ndarray (n_points, 3)
        Coordinates of the points, m; empty for models without coordinates.
    pairs : tuple of str
        Name of the pair of surfaces to which each point belongs; empty without names.
    spring_points : ndarray (ns, 5)
        Values of the last ns points, which are springs instead of contact (columns:
        laws/spring.py). They have an area of 1 m2 and no friction.
    own_friction : ndarray (n_points, k)
        Values of points with friction of their own (columns: laws/own_friction.py); no columns
        without such points.
    """

    N: sp.csr_matrix
    T: sp.csr_matrix
    T_perp: sp.csr_matrix
    area: np.ndarray
    gap0: np.ndarray
    radius: np.ndarray
    law: ContactLaw
    frictional: np.ndarray
    speed_factor: np.ndarray = field(default_factory=lambda: np.zeros(0))
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    pairs: tuple[str, ...] = ()
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS)
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION)

    def __post_init__(self) -> None:
        n = self.n_points
        if has_own(self.own_friction) and len(self.own_friction) != n:
            raise ModelError(f"contact interface: 'own_friction' needs {n} rows")
        if self.spring_points.shape[1:] != (N_SPRING,) or not np.isfinite(self.spring_points).all():
            raise ModelError(
                f"contact interface: 'spring_points' needs {N_SPRING} finite values each"
            )
        check_size("contact interface: 'spring_points'", self.spring_points)
        if not self.speed_factor.size:
            object.__setattr__(self, "speed_factor", np.ones(n))
        for name in ("points", "pairs"):
            if len(getattr(self, name)) not in (0, n):
                raise ModelError(f"contact interface: '{name}' needs {n} entries, or none")
        for name in ("area", "gap0", "radius", "frictional", "speed_factor"):
            array = getattr(self, name)
            if array.shape != (n,) or not np.isfinite(array).all():
                raise ModelError(f"contact interface: '{name}' needs {n} finite values")
            check_size(f"contact interface: '{name}'", array)
        for name in ("N", "T", "T_perp"):
            if getattr(self, name).shape != self.N.shape:
                raise ModelError(f"contact interface: '{name}' differs in shape from N")
            if not np.isfinite(getattr(self, name).data).all():
                raise ModelError(f"contact interface: '{name}' has values that are not finite")
        if not (self.area > 0).all():
            raise ModelError("contact interface: every area must be positive")
        if not (self.frictional >= 0.0).all():
            raise ModelError("contact interface: no 'frictional' may be negative")
        rubbing = self.frictional > 0
        unmoved = self.speed_factor == 0.0 if has_own(self.own_friction) else np.zeros(n, bool)
        if not (self.speed_factor[rubbing & ~unmoved] > 0).all():
            raise ModelError("contact interface: every 'speed_factor' must be positive")
        if not rubbing.all():
            object.__setattr__(self, "speed_factor", np.where(rubbing, self.speed_factor, 1.0))

    @property
    def n_points(self) -> int:
        """Number of contact points."""
        return int(self.N.shape[0])


@dataclass(frozen=True)
class Assembly:
    """Components, interfaces and loads; degrees of freedom are numbered component by component.

    Attributes
    ----------
    components : tuple of Component
        Unique names.
    contact : ContactInterface
        All contact points.
    springs : tuple of SpringInterface or StressStiffness
        Linear interfaces.
    load : ndarray (n_dof,)
        Nodal forces of a unit brake pressure, N/Pa.
    constant_load : ndarray (n_dof,)
        Constant nodal forces, N.
    rotors : Rotors or None
        The turning components and their axis; None where nothing turns or no axis is given.
    dampers : tuple of DamperInterface
        Linear dampers between components and to the ground.

    Raises
    ------
    ModelError
        Arrays do not fit together.
    """

    components: tuple[Component, ...]
    contact: ContactInterface
    springs: tuple[SpringInterface | StressStiffness, ...]
    load: np.ndarray
    constant_load: np.ndarray
    rotors: Rotors | None = None
    dampers: tuple[DamperInterface, ...] = ()

    def __post_init__(self) -> None:
        names = self.component_names
        if len(set(names)) != len(names) or not names:
            raise ModelError(f"component names must be unique, got {names}")
        for interface in (*self.springs, *self.dampers):
            if interface.n_dof != self.n_dof:
                text = f"interface '{interface.name}' does not have {self.n_dof} columns"
                raise ModelError(text)
        if self.contact.N.shape[1] != self.n_dof:
            raise ModelError(f"contact interface does not have {self.n_dof} columns")
        for name in ("load", "constant_load"):
            array = getattr(self, name)
            if array.shape != (self.n_dof,) or not np.isfinite(array).all():
                raise ModelError(f"assembly: '{name}' needs {self.n_dof} finite values")
            check_size(f"assembly: '{name}'", array)

    @property
    def component_names(self) -> tuple[str, ...]:
        """Component names in the order of the numbering."""
        return tuple(c.name for c in self.components)

    @property
    def n_dof(self) -> int:
        """Total number of degrees of freedom."""
        return sum(c.n_dof for c in self.components)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Range of the degrees of freedom of each component."""
        return component_slices(self.components)[0]

    @cached_property
    def M(self) -> sp.csr_matrix:
        """Mass (n_dof, n_dof), kg."""
        return _block_diagonal([c.M for c in self.components])

    @cached_property
    def K_el(self) -> sp.csr_matrix:
        """Elastic stiffness (n_dof, n_dof) of the components, N/m: block diagonal."""
        return _block_diagonal([c.K for c in self.components])

    @cached_property
    def C_el(self) -> sp.csr_matrix | None:
        """Damping and gyroscopic terms (n_dof, n_dof) of components and dampers, N s/m."""
        if all(c.C is None and c.G is None for c in self.components) and not self.dampers:
            return None
        blocks = [
            sum((A for A in (c.C, c.G) if A is not None), sp.csr_matrix(c.K.shape))
            for c in self.components
        ]
        return sum((d.matrix() for d in self.dampers), sp.block_diag(blocks, format="csr"))

    @cached_property
    def turning(self) -> sp.csr_matrix | None:
        """Gyroscopic terms (n_dof, n_dof) of rotors at 1 m/s of sliding, kg/m; or None."""
        rotors = self.rotors
        if rotors is None or rotors.radius is None:
            return None
        if all(c.turning is None for c in self.components):
            return None
        blocks = [
            sp.csr_matrix(c.K.shape) if c.turning is None else c.turning for c in self.components
        ]
        return sp.block_diag(blocks, format="csr") / rotors.radius

    @cached_property
    def correspondence(self) -> sp.csr_matrix:
        """Block-diagonal matrix (rows, n_dof) of `Component.observer` of all components."""
        return _block_diagonal([c.observer for c in self.components])

    @cached_property
    def node_slices(self) -> dict[str, slice]:
        """Range of each component's nodes among the nodes of all components."""
        ends = np.cumsum([0, *(len(c.coordinates) for c in self.components)])
        return {
            c.name: slice(int(a), int(b))
            for c, a, b in zip(self.components, ends, ends[1:], strict=False)
        }

    def at_nodes(self, u: np.ndarray) -> np.ndarray:
        """Displacements (n_nodes, 3) of all nodes from degrees of freedom u (n_dof,).

        Every component needs coordinates.
        """
        by_component = [c.at_nodes(u[self.slices[c.name]]) for c in self.components]
        return np.concatenate(by_component).reshape(-1, 3)

    def K_springs(self, static: bool = False) -> sp.csr_matrix:
        """Stiffness of all linear interfaces; if `static`, of those in the static state."""
        matrices = [s.matrix() for s in self.springs if s.in_static or not static]
        return sum(matrices, sp.csr_matrix((self.n_dof, self.n_dof)))

    def K_contact(self, tangent: float | np.ndarray) -> sp.csr_matrix:
        """Stiffness (n_dof, n_dof) of the contact with tangents (n_points,) [Pa/m]."""
        c = self.contact
        return (c.N.T @ sp.diags(c.area * tangent) @ c.N).tocsr()


def _block_diagonal(blocks: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    """Block-diagonal matrix, made fast for a single block, as minimal models are built often."""
    return blocks[0].tocsr() if len(blocks) == 1 else sp.block_diag(blocks, format="csr")
