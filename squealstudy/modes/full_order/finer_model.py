"""The next larger component-mode model: how far a reduced model is from the full-order one.

At a few working points the reduced right and left modes leave loads r = Q(lam) T psi in the
unreduced equations. The nearly static responses (K0 + s M)^-1 r to random sums of them, each mode
of unit energy, span what the basis lacks (a randomised range finder: Halko, Martinsson, Tropp
2011); K0 + s M is the matrix the assembly's modes were found with. The basis with these responses
makes a finer model, whose roots are nearer to those of the full-order model by orders of magnitude:
the distance between the roots of the two models is the error of the smaller one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.laws.own_friction import is_linear
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.linalg.factor import side_by_side
from squealstudy.models.operating import DesignState, ModeKey, OperatingPoint
from squealstudy.modes.point import PointModes, solve_point, state_working_point
from squealstudy.reduction.cmt import (
    ComponentBasis,
    ComponentModes,
    ReducedModel,
    momenta,
    project,
)
from squealstudy.reduction.orthonormal import GRAM_RESOLUTION, new_directions, outside
from squealstudy.reduction.prepared import PreparedModel, shape_basis
from squealstudy.reduction.projected import AnyAssembly, AnyComponent
from squealstudy.root_pairs import partner_distances
from squealstudy.system.contact_weights import ContactWeights, contact_weights
from squealstudy.system.linearise import component_frequencies, linearise

DIRECTIONS = 160  # static responses: with fewer some of what moves a root is left out
# smallest direction kept, relative to the largest (its square: relative in elastic energy)
FINER_SVD_CUTOFF = 0.003  # in a finer model
ENRICHING = 0.012  # in a basis that is enriched
STRONG = 0.7  # least friction of loads in training: they also cover weaker friction
BAND_WIDENING = 0.02  # relative widening of the band in which the finer model is compared
FINER_MODEL_SAFETY_FACTOR = 2.0  # on the distance to the finer model, for what that lacks too
SAME_ROOT = 1e-12  # relative: round-off of the difference of two dense eigenvalues
LOW_END_RATIO = 0.02  # below this frequency, over the band's top, bodies are nearly free


@dataclass(frozen=True)
class ReductionRecord:
    """Record of what a prepared model was made from.

    Attributes
    ----------
    assembly : AnyAssembly
    modes : mapping of component name -> ComponentModes
    points : tuple of OperatingPoint
        Operating points at which residual loads are taken, with strong friction and with none.
    scales : tuple of mapping of (component, mode) -> float
        Factors on component frequencies, with which the first point is loaded again.
    top_hz : float
        The largest frequency [Hz] of the modes whose loads are taken.
    damped_to_hz : float
        The largest frequency [Hz] of the real modes with modal damping of their own, in the
        unreduced assembly and in the finer model; that all reduced ones have it is an error.
    """

    assembly: AnyAssembly
    modes: Mapping[str, ComponentModes]
    points: tuple[OperatingPoint, ...]
    top_hz: float
    damped_to_hz: float
    scales: tuple[Mapping[ModeKey, float], ...] = ()

    @property
    def states(self) -> list[DesignState]:
        """Design states at which the loads left by reduced modes are computed."""
        # without gyroscopic terms: with and without them, a structure has one basis
        strong = [replace(p, friction=max(p.friction, STRONG), gyroscopic=0.0) for p in self.points]
        none = [replace(p, friction=0.0) for p in strong]
        changed = [DesignState(strong[0], scale) for scale in self.scales]
        return [*map(DesignState, [*strong, *none]), *changed]


def with_finer_model(
    prepared: PreparedModel, basis: ComponentBasis, record: ReductionRecord, rounds: int = 0
) -> tuple[PreparedModel, ComponentBasis]:
    """A prepared model, in this basis or in an enriched one, together with its finer model.

    Parameters
    ----------
    prepared : PreparedModel
    basis : ComponentBasis
    record : ReductionRecord
    rounds : int
        With 0 the basis stays. With 1 the leading static responses, which cover most of its error,
        join it, and all of them make the finer model. With 2 all of them join it first, and then
        the leading responses that this larger basis lacks.

    Returns
    -------
    PreparedModel, ComponentBasis
        The finer model is None where a contact point is stuck without a stiffness, where no point
        has modes, and where a factorisation fails.
    """
    if not is_linear(prepared.model.own_friction):  # a stuck point has no tangent
        return replace(prepared, finer=None), basis
    try:
        if rounds > 1:
            responses = _responses(prepared, basis, record)
            model, basis = extended_basis(
                record.assembly, record.modes, basis, responses, FINER_SVD_CUTOFF
            )
            prepared = _in_basis(prepared, model, basis, record)
        responses = _responses(prepared, basis, record)
        finer, _ = extended_basis(record.assembly, record.modes, basis, responses, FINER_SVD_CUTOFF)
        if rounds > 0:
            model, basis = extended_basis(
                record.assembly, record.modes, basis, responses, ENRICHING
            )
            prepared = _in_basis(prepared, model, basis, record)
    except np.linalg.LinAlgError:  # an error that is not known is better than no study
        return replace(prepared, finer=None), basis
    finer = replace(finer, damped_to=2 * np.pi * record.damped_to_hz)
    return replace(prepared, finer=finer), basis


def _in_basis(
    prepared: PreparedModel, model: ReducedModel, basis: ComponentBasis, record: ReductionRecord
) -> PreparedModel:
    """The same structure projected on another basis, without a finer model."""
    phi, sensors = shape_basis(record.assembly, model, basis, prepared.nominal_tangent)
    return replace(prepared, model=model, shape_basis=phi, sensor_shapes=sensors, finer=None)


def _responses(
    prepared: PreparedModel, basis: ComponentBasis, record: ReductionRecord
) -> np.ndarray:
    """Nearly static responses (n_dof, DIRECTIONS) to residual loads."""
    return basis.factor.solve_once(residual_loads(prepared, basis, record))


def residual_loads(
    prepared: PreparedModel, basis: ComponentBasis, record: ReductionRecord
) -> np.ndarray:
    """Random sums (n_dof, DIRECTIONS) of the loads that reduced modes leave unbalanced.

    Each mode is scaled to unit energy |lam|^2 psi^H M psi, so that its load counts as much as it
    moves the root relatively. A random vector fixes its phase, whatever the eigensolver returns.
    Modes are summed in reduced coordinates, and only the sums are expanded.

    Points without a working point or modes are left out; LinAlgError if none is left.
    """
    rng = np.random.default_rng(0)  # the same structure has the same finer model
    restricted = basis.restrict(rng.standard_normal(record.assembly.n_dof))
    sums = _ResidualSums(prepared.model)
    with side_by_side(record.assembly.n_dof) as pool:
        solved = list(
            pool.map(lambda state: _loading_modes(prepared, state, record), record.states)
        )
    for modes in chain.from_iterable(solved):  # in their order: so are the random numbers
        lam, x = modes.lam, modes.x
        toward = restricted @ x
        x = x * (toward.conj() / np.abs(toward) / np.abs(lam))  # x has unit norm in M
        mixed = rng.standard_normal((2 * len(lam), DIRECTIONS))
        powers = [_mixed(x * lam**power, mixed) for power in range(3)]
        sums.add(powers, modes.contact, modes.are_left)
        sums.add_changes(powers[0], modes.changes)
    if not sums.any:
        raise np.linalg.LinAlgError("no point has modes")
    return sums.loads(basis, record)


@dataclass(frozen=True, eq=False)
class _LoadingModes:
    """Reduced right or left modes x (n, m) of a state, with roots lam (m,) [rad/s]."""

    lam: np.ndarray
    x: np.ndarray
    are_left: bool
    contact: ContactWeights
    changes: Mapping[ModeKey, float]


def _loading_modes(
    prepared: PreparedModel, state: DesignState, record: ReductionRecord
) -> list[_LoadingModes]:
    """Right modes of a state, and with friction left ones; where a solution fails, those so far."""
    modes: list[_LoadingModes] = []
    with contextlib.suppress(ConvergenceError, np.linalg.LinAlgError):
        point = state_working_point(prepared, state)
        small = linearise(prepared.model, point, state)
        contact = contact_weights(prepared.model, point, state.operating)
        changes = state.stiffness_changes(component_frequencies(prepared.model))
        top = 2 * np.pi * record.top_hz
        for are_left in (False, True) if state.operating.friction else (False,):
            C, K = (small.C.T, small.K.T) if are_left else (small.C, small.K)
            lam, x = dense_roots(C, K, (LOW_END_RATIO * top, top))
            modes.append(_LoadingModes(lam, x, are_left, contact, changes))
    return modes


def _mixed(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Real sums (n, k) of the real and the imaginary parts of x (n, m) with weights (2m, k)."""
    sums: np.ndarray = np.hstack([x.real, x.imag]) @ weights
    return sums


class _ResidualSums:
    """Sums of loads lam^2 M psi + lam C psi + K psi of many points, in reduced coordinates.

    Attributes
    ----------
    any : bool
        Whether the modes of a point were added.
    """

    def __init__(self, model: ReducedModel) -> None:
        self._model, self.any = model, False
        self._inertia = self._elastic = np.zeros((model.n, DIRECTIONS))
        self._normal = self._sliding = self._across = np.zeros((len(model.area), DIRECTIONS))
        self._changed: dict[ModeKey, np.ndarray] = {}

    def add(self, powers: list[np.ndarray], contact: ContactWeights, are_left: bool) -> None:
        """Add one point's sums (n, DIRECTIONS) of x, lam x and lam^2 x over its modes x.

        `are_left` says that x are left vectors.
        """
        x, speed, inertia = powers
        model, self.any = self._model, True
        self._inertia, self._elastic = self._inertia + inertia, self._elastic + x
        normal = model.N @ x
        self._normal = self._normal + contact.normal[:, None] * normal
        if are_left:  # left vectors belong to K^T, where the coupling N-T is transposed
            self._normal = self._normal + contact.coupling[:, None] * (model.T @ x)
        else:
            self._sliding = self._sliding + contact.coupling[:, None] * normal
        if np.any(contact.along):
            self._sliding = self._sliding + contact.along[:, None] * (model.T @ speed)
        self._across = self._across + contact.across[:, None] * (model.T_perp @ speed)

    def add_changes(self, x: np.ndarray, changes: Mapping[ModeKey, float]) -> None:
        """Add the loads of changed modal stiffnesses [(rad/s)^2] on the sums x (n, DIRECTIONS)."""
        for key, change in changes.items():
            load = change * x[self._model.mode_coordinate(*key)]
            self._changed[key] = self._changed.get(key, 0.0) + load

    def loads(self, basis: ComponentBasis, record: ReductionRecord) -> np.ndarray:
        """The summed loads on all degrees of freedom (n_dof, DIRECTIONS), N."""
        assembly, c = record.assembly, record.assembly.contact
        stiffness = assembly.K_el + assembly.K_springs()
        total = assembly.M @ basis.expand(self._inertia) + stiffness @ basis.expand(self._elastic)
        total += c.N.T @ self._normal + c.T.T @ self._sliding + c.T_perp.T @ self._across
        if self._changed:
            U = momenta(assembly, record.modes, list(self._changed))
            total += U.T @ np.vstack(list(self._changed.values()))
        loads: np.ndarray = total
        return loads


def reduction_errors(
    prepared: PreparedModel, state: DesignState, band_hz: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Roots (m,) of a design point in the reduced model and their errors (m,), in rad/s.

    An error is the distance to the partner among the roots of the finer model. Both models are
    solved exactly. The finer model is solved a little beyond the band, because the partner of a
    root near its edge may lie there.

    Raises
    ------
    ConvergenceError
        Where there is no working point, or no finer model.
    """
    modes = solve_point(prepared, state, band_hz)
    return modes.lam, _from_finer(prepared, state, band_hz, modes)


def relative_errors(
    prepared: PreparedModel, state: DesignState, band_hz: tuple[float, float], modes: PointModes
) -> np.ndarray:
    """Errors of reduced roots (m,) against the unreduced model, relative to their moduli.

    `modes` are the modes of the design point in the reduced model. A safety factor and the error
    of the basis allow for the error of the finer model itself.

    Raises
    ------
    ConvergenceError
        Where there is no finer model.
    """
    rel_errors = _from_finer(prepared, state, band_hz, modes) / np.abs(modes.lam)
    return np.maximum(FINER_MODEL_SAFETY_FACTOR * (rel_errors + prepared.basis_error), SAME_ROOT)


def _from_finer(
    prepared: PreparedModel, state: DesignState, band_hz: tuple[float, float], modes: PointModes
) -> np.ndarray:
    low, high = band_hz
    margin = (low * (1.0 - BAND_WIDENING), high * (1.0 + BAND_WIDENING))
    assert modes.working_point is not None
    finer = finer_modes(prepared, state, margin, modes.working_point.gap)
    return partner_distances(modes.lam, finer.lam)


def root_distances(
    prepared: PreparedModel,
    other: PreparedModel,
    states: Sequence[DesignState],
    band_hz: tuple[float, float],
) -> float:
    """Largest relative distance of roots in the band from those of another model, over states.

    States without a working point are left out; infinite where all are.
    """
    low, high = band_hz
    margin = (low * (1.0 - BAND_WIDENING), high * (1.0 + BAND_WIDENING))
    distances = []
    for state in states:
        with contextlib.suppress(ConvergenceError):
            roots_here = solve_point(prepared, state, band_hz).lam
            to_partner = partner_distances(roots_here, solve_point(other, state, margin).lam)
            distances.append(float((to_partner / np.abs(roots_here)).max(initial=0.0)))
    return max(distances, default=np.inf)


def finer_modes(
    prepared: PreparedModel,
    state: DesignState,
    band_hz: tuple[float, float],
    gap: np.ndarray | None = None,
) -> PointModes:
    """Complex modes of a design point in the finer model; `gap` (nc,) of its working point.

    Raises
    ------
    ConvergenceError
        Where there is no working point, or no finer model.
    """
    if prepared.finer is None:
        raise ConvergenceError("failed", "there is no finer model of this structure")
    n = prepared.finer.n
    larger = replace(prepared, model=prepared.finer, shape_basis=np.zeros((n, 1)))
    return solve_point(larger, state, band_hz, gap)


def extended_basis(
    assembly: AnyAssembly,
    modes: Mapping[str, ComponentModes],
    basis: ComponentBasis,
    added: np.ndarray,
    share: float,
) -> tuple[ReducedModel, ComponentBasis]:
    """The basis of each component extended by what `added` has outside its span; the model in it.

    Parameters
    ----------
    assembly : AnyAssembly
    modes : mapping of component name -> ComponentModes
        The first coordinates of each component, which stay what they are.
    basis : ComponentBasis
    added : ndarray (n_dof, k)
        Displacements of the assembly.
    share : float
        Directions are kept whose elastic energy is more than share^2 of the largest direction's
        over all components: a component that hardly deforms gets few.
    """
    parts: Sequence[AnyComponent] = assembly.components

    def missing(part: AnyComponent, block: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return outside(part.M, part.K, block, added[assembly.slices[part.name]])

    def extended(
        component: AnyComponent,
        block: np.ndarray,
        missing_directions: tuple[np.ndarray, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        X, energy = missing_directions
        count = modes[component.name].phi.shape[1]
        phi, chosen = block[:, :count], X[:, energy > min_energy]
        size = np.sqrt(np.einsum("ij,ij->j", chosen, component.M @ chosen))
        more = new_directions(component.M, block, chosen / size, GRAM_RESOLUTION)
        other_columns = np.hstack([block[:, count:], more])
        k_rest, y = la.eigh(other_columns.T @ (component.K @ other_columns))
        k_phi = np.einsum("ij,ij->j", phi, component.K @ phi)
        return np.ascontiguousarray(np.hstack([phi, other_columns @ y])), np.concatenate(
            [k_phi, k_rest]
        )

    with side_by_side(assembly.n_dof) as pool:
        missing_directions = list(pool.map(missing, parts, basis.blocks))
        min_energy = share**2 * max(energy.max(initial=0.0) for _, energy in missing_directions)
        blocks, diagonals = zip(
            *pool.map(extended, parts, basis.blocks, missing_directions), strict=True
        )
    larger = replace(basis, blocks=blocks)
    return project(assembly, larger, diagonals, modes), larger
