"""Component Mode Tuning: component modes as coordinates of the assembly (THEORY.md eq. (25))."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws.own_friction import NO_OWN_FRICTION
from squealstudy.laws.spring import NO_SPRINGS
from squealstudy.linalg.factor import RefinedFactor, factorise, side_by_side
from squealstudy.linalg.real_modes import real_modes, shifted
from squealstudy.models.matrix_checks import is_skew
from squealstudy.models.operating import ModeKey
from squealstudy.reduction.enrichment import load_responses, sticking_modes
from squealstudy.reduction.orthonormal import MODE_TOLERANCE, complete_basis
from squealstudy.reduction.projected import AnyAssembly, AnyComponent
from squealstudy.reduction.working_point import WorkingPoint

MOST_KEPT = 8_000_000  # entries of the mode shapes that a process caches: 64 MB


@dataclass(frozen=True)
class ComponentModes:
    """Free-free modes of one component.

    Attributes
    ----------
    omega : ndarray (m,)
        Angular frequencies, rad/s; those of rigid-body modes come first, 0 to round-off.
    phi : ndarray (n, m)
        Mass-normalised mode shapes.
    """

    omega: np.ndarray
    phi: np.ndarray


@dataclass(frozen=True)
class ReductionSettings:
    """Settings of a reduction basis.

    Attributes
    ----------
    component_cutoff, assembly_cutoff : float
        Component and assembly modes up to these frequencies, Hz.
    load_cutoff : float
        Assembly modes up to here [Hz] make the loads of the enrichment; 0 for no loads.
    tolerance : float
        Smallest singular value of the enrichment that is kept, over its largest.
    """

    component_cutoff: float
    assembly_cutoff: float
    load_cutoff: float
    tolerance: float = 1e-4

    @property
    def damped_to(self) -> float:
        """Real modes of the unreduced assembly up to here [Hz] have modal damping of their own."""
        return max(self.component_cutoff, self.assembly_cutoff)


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """The assembly in component-mode coordinates: M = I, K_el diagonal.

    Attributes
    ----------
    components : tuple of str
    offsets : ndarray (n_components + 1,)
        Number of the first coordinate of each component, then n.
    n_modes : ndarray (n_components,)
        Number of free-free modes of each component; they are its first coordinates.
    k_el : ndarray (n,)
        Diagonal elastic stiffness, (rad/s)^2.
    K_springs : ndarray (n, n)
        Stiffness of the linear interfaces, symmetric, (rad/s)^2.
    N, T, T_perp : ndarray (nc, n)
        Contact observation (models.assembly.ContactInterface).
    area, frictional, radius, speed_factor : ndarray (nc,)
    damped_to : float
        Frequency [rad/s] beyond which modal damping takes real modes of the assembly as if they
        had this frequency (`modal_damping`).
    C_el : ndarray (n, n) or None
        Damping and gyroscopic terms of components and dampers (Assembly.C_el), rad/s; None where
        there are none.
    turning : ndarray (n, n) or None
        Gyroscopic terms of rotors at 1 m/s of sliding, 1/m, skew-symmetric; None where there are
        none.
    unturned : str
        Why a rotor has no gyroscopic terms; empty where it has, or where there is no rotor.
    spring_points : ndarray (ns, 5)
    own_friction : ndarray (nc, k)
        As in ContactInterface.
    load : ndarray (n,) or (0,)
        Load of a unit brake pressure (Assembly.load) on the coordinates; empty where springs act in
        vibration only, as these would resist a change of the load.
    """

    components: tuple[str, ...]
    offsets: np.ndarray
    n_modes: np.ndarray
    k_el: np.ndarray
    K_springs: np.ndarray
    N: np.ndarray
    T: np.ndarray
    T_perp: np.ndarray
    area: np.ndarray
    frictional: np.ndarray
    radius: np.ndarray
    speed_factor: np.ndarray
    damped_to: float = np.inf
    C_el: np.ndarray | None = None
    spring_points: np.ndarray = field(default_factory=lambda: NO_SPRINGS)
    load: np.ndarray = field(default_factory=lambda: np.zeros(0))
    turning: np.ndarray | None = None
    unturned: str = ""
    own_friction: np.ndarray = field(default_factory=lambda: NO_OWN_FRICTION)

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.k_el)

    @property
    def mode_counts(self) -> dict[str, int]:
        """Number of free-free modes of each component in the basis."""
        return {c: int(n) for c, n in zip(self.components, self.n_modes, strict=True)}

    def mode_coordinate(self, component: str, mode: int) -> int:
        """Coordinate of a component's free-free mode, numbered from 1, rigid modes included.

        Raises
        ------
        KeyError
            Unknown component, or a mode that is not in the basis.
        """
        i = self.components.index(component) if component in self.components else -1
        if i < 0 or not 1 <= mode <= self.n_modes[i]:
            raise KeyError((component, mode))
        return int(self.offsets[i]) + mode - 1


@dataclass(frozen=True)
class ComponentBasis:
    """Component blocks of T_R (THEORY.md eq. (24)), and the assembly modes in them.

    Attributes
    ----------
    blocks : tuple of ndarray (n_component, k)
    omega, phi : ndarray (m,), (n_dof, m)
        Angular frequencies [rad/s] and shapes of the assembly modes.
    factor : RefinedFactor (n_dof, n_dof)
        Factor of the stiffness plus a multiple of M with which the modes were computed. Its
        response to loads is near enough to the static one for the enrichment.
    """

    blocks: tuple[np.ndarray, ...] = field(repr=False)
    omega: np.ndarray
    phi: np.ndarray = field(repr=False)
    factor: RefinedFactor = field(repr=False)

    def expand(self, x: np.ndarray) -> np.ndarray:
        """Assembly displacements (n_dof, ...) from coordinates x (n, ...)."""
        return expanded(self.blocks, x)

    def restrict(self, loads: np.ndarray) -> np.ndarray:
        """Loads (n, ...) on the coordinates from loads (n_dof, ...) on the assembly."""
        ends = np.cumsum([0, *(len(b) for b in self.blocks)])
        parts = [b.T @ loads[i:j] for b, i, j in zip(self.blocks, ends, ends[1:], strict=False)]
        return np.concatenate(parts)


def expanded(blocks: Sequence[np.ndarray], x: np.ndarray) -> np.ndarray:
    """Displacements (n_dof, ...) from coordinates x (n, ...), by blocks (n_component, k)."""
    ends = np.cumsum([0, *(b.shape[1] for b in blocks)])
    parts = [b @ x[i:j] for b, i, j in zip(blocks, ends, ends[1:], strict=False)]
    return np.concatenate(parts)


@dataclass(frozen=True)
class Expansion:
    """A reduced model with its way back to all degrees of freedom.

    The two must come from one reduction. Another reduction of the same structure describes the same
    motions, but possibly in other coordinates, as modes of equal frequencies may be mixed.

    Attributes
    ----------
    model : ReducedModel
    blocks : tuple of ndarray (n_component, k)
        Blocks of the basis (`ComponentBasis`) that the model was projected on.
    """

    model: ReducedModel
    blocks: tuple[np.ndarray, ...]

    def expand(self, x: np.ndarray) -> np.ndarray:
        """Displacements (n_dof, ...) of the assembly from coordinates x (n, ...)."""
        return expanded(self.blocks, x)


def component_modes(assembly: AnyAssembly, cutoff_hz: float) -> dict[str, ComponentModes]:
    """Free-free modes of every component up to `cutoff_hz`.

    The process caches the last modes of sparse components, as structures that differ in contact,
    gaps or the angle of the rotor have the same components.
    """
    return {c.name: _free_modes(c, cutoff_hz) for c in assembly.components}


_kept_modes: dict[tuple[str, float], ComponentModes] = {}


def _free_modes(component: AnyComponent, cutoff_hz: float) -> ComponentModes:
    """Free modes of a component up to a frequency, cached by the content of its matrices."""
    if not sp.issparse(component.K):
        return ComponentModes(*real_modes(component.M, component.K, cutoff_hz))
    key = (_content(component.M, component.K), cutoff_hz)
    if key not in _kept_modes:
        modes = ComponentModes(*real_modes(component.M, component.K, cutoff_hz))
        for shared in (modes.omega, modes.phi):
            shared.flags.writeable = False
        _kept_modes[key] = modes
        while sum(m.phi.size for m in [*_kept_modes.values()]) > MOST_KEPT:
            _kept_modes.pop(next(iter(_kept_modes)))
        return modes
    return _kept_modes[key]


def _content(*matrices: sp.csr_matrix) -> str:
    """Hash of sparse matrices."""
    digest = hashlib.sha256()
    for A in matrices:
        for part in (A.indptr, A.indices, A.data):
            digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()


def momenta(
    assembly: AnyAssembly, modes: Mapping[str, ComponentModes], keys: Collection[ModeKey]
) -> np.ndarray:
    """Rows phi^T M (k, n_dof) of the component modes `keys`, over the assembly.

    Raises
    ------
    ModelError
        A component or a mode of it that `modes` does not have.
    """
    components = {c.name: c for c in assembly.components}
    rows = np.zeros((len(keys), assembly.n_dof))
    for row, (name, mode) in zip(rows, keys, strict=True):
        if name not in modes or not 1 <= mode <= modes[name].phi.shape[1]:
            raise ModelError(f"component '{name}' has no mode {mode} here")
        row[assembly.slices[name]] = components[name].M @ modes[name].phi[:, mode - 1]
    return rows


def reduce_cmt(
    assembly: AnyAssembly,
    modes: Mapping[str, ComponentModes],
    nominal: WorkingPoint,
    settings: ReductionSettings,
    others: Sequence[WorkingPoint] = (),
) -> tuple[ReducedModel, ComponentBasis]:
    """Build the component-mode basis at a nominal working point and project on it.

    Parameters
    ----------
    assembly : AnyAssembly
    modes : mapping of component name -> ComponentModes
    nominal : WorkingPoint
        The assembly modes are computed with its contact tangents.
    settings : ReductionSettings
    others : sequence of WorkingPoint
        Contact states that the study will reach (the ends of its pressure range). The static
        response to their change of contact stiffness joins the enrichment.

    Returns
    -------
    ReducedModel, ComponentBasis
    """
    K = assembly.K_el + assembly.K_springs() + assembly.K_contact(nominal.tangent)
    cutoff = settings.assembly_cutoff
    factor = factorise(shifted(assembly.M, K, cutoff), definite=True)
    omega, phi = real_modes(assembly.M, K, cutoff, factor)
    loaded = phi[:, omega <= 2 * np.pi * settings.load_cutoff]
    sticking = sticking_modes(assembly, K, nominal.tangent, cutoff)
    extra = load_responses(assembly, factor.lean(), nominal, others, loaded)

    def complete(component: AnyComponent) -> tuple[np.ndarray, np.ndarray]:
        span = assembly.slices[component.name]
        shapes = [(phi[span], MODE_TOLERANCE), (sticking[span], MODE_TOLERANCE)]
        shapes.append((extra[span], settings.tolerance))
        return complete_basis(component.M, component.K, modes[component.name].phi, shapes)

    components: Sequence[AnyComponent] = assembly.components
    with side_by_side(assembly.n_dof) as pool:
        blocks, diagonals = zip(*pool.map(complete, components), strict=True)
    basis = ComponentBasis(blocks=blocks, omega=omega, phi=phi, factor=factor)
    return project(assembly, basis, diagonals, modes), basis


def project(
    assembly: AnyAssembly,
    basis: ComponentBasis,
    diagonals: Sequence[np.ndarray],
    modes: Mapping[str, ComponentModes],
) -> ReducedModel:
    """Project interfaces and contact observation on the component blocks of `basis`."""
    c = assembly.contact
    K_springs = assembly.K_springs()
    spans = [assembly.slices[name] for name in assembly.component_names]

    def observe(A: sp.csr_matrix) -> np.ndarray:
        return np.hstack([A[:, s] @ T for s, T in zip(spans, basis.blocks, strict=True)])

    rows = [
        observe_block.T @ observe(K_springs[s])
        for s, observe_block in zip(spans, basis.blocks, strict=True)
    ]
    K_r = np.vstack(rows)
    in_vibration_only = abs(K_springs - assembly.K_springs(static=True)).max() > 0
    return ReducedModel(
        components=assembly.component_names,
        offsets=np.cumsum([0, *(T.shape[1] for T in basis.blocks)]),
        n_modes=np.array([modes[n].phi.shape[1] for n in assembly.component_names]),
        k_el=np.concatenate(diagonals),
        K_springs=(K_r + K_r.T) / 2,
        N=observe(c.N),
        T=observe(c.T),
        T_perp=observe(c.T_perp),
        area=c.area,
        frictional=c.frictional,
        radius=c.radius,
        speed_factor=c.speed_factor,
        C_el=_own_damping(assembly, basis),
        spring_points=c.spring_points,
        load=np.zeros(0) if in_vibration_only else basis.restrict(assembly.load),
        turning=_turning(assembly, basis),
        unturned="" if assembly.rotors is None else assembly.rotors.unturned,
        own_friction=c.own_friction,
    )


def _turning(assembly: AnyAssembly, basis: ComponentBasis) -> np.ndarray | None:
    """Gyroscopic terms of rotors in component-mode coordinates; None without any."""
    G = assembly.turning
    if G is None:
        return None
    spans = [assembly.slices[name] for name in assembly.component_names]
    blocks = [T.T @ (G[s, s] @ T) for s, T in zip(spans, basis.blocks, strict=True)]
    assembled: np.ndarray = la.block_diag(*((B - B.T) / 2 for B in blocks))
    return assembled


def _own_damping(assembly: AnyAssembly, basis: ComponentBasis) -> np.ndarray | None:
    """Damping of components and dampers in component-mode coordinates; None without any."""
    C = assembly.C_el
    if C is None:
        return None
    spans = [assembly.slices[name] for name in assembly.component_names]
    damped = np.hstack([C[:, s] @ T for s, T in zip(spans, basis.blocks, strict=True)])
    projected = np.vstack([T.T @ damped[s] for s, T in zip(spans, basis.blocks, strict=True)])
    damping: np.ndarray = projected if is_skew(C) else (projected + projected.T) / 2
    return damping
