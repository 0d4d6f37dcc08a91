"""What design points of one structure share: contact compliances and component-mode model."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from squealstudy.errors import ConvergenceError
from squealstudy.laws.spring import evaluate_points
from squealstudy.linalg.band_roots import FIRST_ROOTS, roots_in_band
from squealstudy.linalg.factor import side_by_side, threads_to_share
from squealstudy.models.matrices.family import ORDERS, MatrixFamily
from squealstudy.models.operating import OperatingPoint
from squealstudy.reduction.cmt import (
    ComponentBasis,
    ComponentModes,
    ReducedModel,
    ReductionSettings,
    component_modes,
    reduce_cmt,
)
from squealstudy.reduction.contact_space import ContactSpace, contact_space
from squealstudy.reduction.projected import AnyAssembly
from squealstudy.reduction.working_point import WorkingPoint, working_point


@dataclass(frozen=True)
class PreparedModel:
    """One structure, ready for design points.

    Attributes
    ----------
    space : ContactSpace
        Gives working points; its shapes U are all component modes in order, rigid ones included.
    model : ReducedModel
        Gives complex modes and runs in time.
    shape_basis : ndarray (n, k)
        Real modes of the nominal working point in reduced coordinates, up to the assembly cutoff.
        Mode shapes are compared by their coordinates on it.
    sensor_shapes : ndarray (s, k)
        These modes at the places that correspond between structures (Assembly.correspondence).
        Shapes of structures that differ in material, geometry or mesh are compared there.
    nominal_gap : ndarray (nc,)
        Gaps of the nominal working point [m], from which Newton starts at every other one.
    nominal_tangent : ndarray (nc,)
        Contact tangents of the nominal working point, Pa/m.
    finer : ReducedModel or None
        The next larger model (modes/full_order/finer_model.py), by which the error of `model` is
        estimated; None where `model` is complete.
    n_dof : int
        Degrees of freedom of the assembly.
    timings : mapping of stage -> seconds
    basis_error : float
        Largest relative error of a root that a basis shared by a range of structures makes; 0 for
        a basis made for this structure.
    """

    space: ContactSpace
    model: ReducedModel
    shape_basis: np.ndarray
    sensor_shapes: np.ndarray
    nominal_gap: np.ndarray
    timings: Mapping[str, float] = field(default_factory=dict)
    nominal_tangent: np.ndarray = field(default_factory=lambda: np.zeros(0))
    finer: ReducedModel | None = None
    n_dof: int = 0
    basis_error: float = 0.0

    @property
    def shape_rows(self) -> np.ndarray:
        """Rows (k, n) that give a mode shape's coordinates on the shape basis."""
        return self.shape_basis.T


def unit_shapes(coordinates: np.ndarray) -> np.ndarray:
    """Turn coordinates (k, m) of m shapes into rows of unit norm (m, k) complex64 to compare."""
    rows = coordinates.T / np.maximum(np.linalg.norm(coordinates, axis=0)[:, None], 1e-300)
    unit: np.ndarray = rows.astype(np.complex64)
    return unit


def prepare(
    assembly: AnyAssembly,
    nominal: OperatingPoint,
    settings: ReductionSettings,
    others: Sequence[OperatingPoint] = (),
) -> PreparedModel:
    """Prepare one structure for design points.

    Arguments and errors are those of `prepare_with_basis`.
    """
    return prepare_with_basis(assembly, nominal, settings, others)[0]


def prepare_with_basis(
    assembly: AnyAssembly,
    nominal: OperatingPoint,
    settings: ReductionSettings,
    others: Sequence[OperatingPoint] = (),
    space: ContactSpace | Callable[[Mapping[str, ComponentModes]], ContactSpace] | None = None,
) -> tuple[PreparedModel, Mapping[str, ComponentModes], ComponentBasis]:
    """The prepared model, its component modes and its basis.

    `others` are operating points at the ends of the study's pressure and contact-law ranges; those
    without a working point are left out. `space` is the contact space of this assembly and its
    component modes if it is made already, or a function that makes it from the modes.

    Raises
    ------
    ConvergenceError
        The nominal working point does not exist, or some motion is free.
    """
    clock = _Clock()
    with side_by_side(assembly.n_dof) as pool:
        modes_to_come = pool.submit(component_modes, assembly, settings.component_cutoff)
        if threads_to_share() == 1:
            modes_to_come.result()
        if space is None:  # not in the pool: this thread shares its solves with others
            stiffness = mean_contact_stiffness(assembly, nominal)
            space = contact_space(
                assembly, stiffness, lambda: mode_shapes(assembly, modes_to_come.result())
            )
        modes = modes_to_come.result()
    space = space(modes) if callable(space) else space
    clock.stage("components_s")
    point = working_point(space, nominal)
    reached = _reachable(space, others)
    clock.stage("working_point_s")
    model, basis = reduce_cmt(assembly, modes, point, settings, reached)
    prepared = with_shapes(assembly, space, model, basis, point)
    clock.stage("reduction_s")
    return replace(prepared, timings=clock.stages), modes, basis


def with_shapes(
    assembly: AnyAssembly,
    space: ContactSpace,
    model: ReducedModel,
    basis: ComponentBasis,
    nominal: WorkingPoint,
) -> PreparedModel:
    """Add to a reduced model its real modes at the nominal working point, and their sensor rows."""
    phi, sensors = shape_basis(assembly, model, basis, nominal.tangent)
    return PreparedModel(
        space=space,
        model=model,
        shape_basis=phi,
        sensor_shapes=sensors,
        nominal_gap=nominal.gap,
        nominal_tangent=nominal.tangent,
        n_dof=assembly.n_dof,
    )


def shape_basis(
    assembly: AnyAssembly, model: ReducedModel, basis: ComponentBasis, tangent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`shape_basis` and `sensor_shapes` of PreparedModel, with contact tangents (nc,) [Pa/m]."""
    K = contact_stiffness(model, tangent)
    count = min(max(len(basis.omega), 1), model.n)  # stiff parts have no mode below the cutoff
    _, phi = la.eigh(K, subset_by_index=(0, count - 1))
    return phi, assembly.correspondence @ basis.expand(phi)


def contact_stiffness(model: ReducedModel, tangent: np.ndarray) -> np.ndarray:
    """Symmetric stiffness (n, n) with contact tangents (nc,) [Pa/m] and without friction."""
    K = model.K_springs + model.N.T @ ((model.area * tangent)[:, None] * model.N)
    K[np.diag_indices_from(K)] += model.k_el
    stiffness: np.ndarray = K
    return stiffness


def natural_frequencies(prepared: PreparedModel, nominal: OperatingPoint) -> np.ndarray:
    """Frequencies (n,) of all real modes at the nominal working point, Hz, ascending."""
    _, tangent = evaluate_points(nominal.law, prepared.space.spring_points, prepared.nominal_gap)
    w2 = la.eigvalsh(contact_stiffness(prepared.model, tangent))
    frequencies_hz: np.ndarray = np.sqrt(np.maximum(w2, 0.0)) / (2 * np.pi)
    return frequencies_hz


def _reachable(space: ContactSpace, points: Sequence[OperatingPoint]) -> list[WorkingPoint]:
    working_points = []
    for point in points:
        with contextlib.suppress(ConvergenceError):
            working_points.append(working_point(space, point))
    return working_points


def mean_contact_stiffness(assembly: AnyAssembly, nominal: OperatingPoint) -> float | np.ndarray:
    """Contact stiffness per area at a uniform pressure that the nominal loads give, Pa/m.

    An array (nc,) where some contact points are springs, with their linear stiffness [N/m].
    """
    area, springs = assembly.contact.area, assembly.contact.spring_points
    touching = len(area) - len(springs)
    force = np.abs(nominal.brake_pressure * assembly.load + assembly.constant_load).sum()
    pressure = max(force / area[:touching].sum(), 1e-300)
    gap = np.array([nominal.law.gap_at(pressure)])
    stiffness = float(nominal.law.evaluate(gap)[1][0])
    if not len(springs):
        return stiffness
    return np.concatenate([np.full(touching, stiffness), springs[:, 0]])


def mode_shapes(assembly: AnyAssembly, modes: Mapping[str, ComponentModes]) -> np.ndarray:
    """U = M phi of all component modes over the assembly (n_dof, m), components in order."""
    columns = []
    for c in assembly.components:
        U = np.zeros((assembly.n_dof, modes[c.name].phi.shape[1]))
        U[assembly.slices[c.name]] = c.M @ modes[c.name].phi
        columns.append(U)
    return np.hstack(columns)


def shape_column(model: ReducedModel, component: str, mode: int) -> int:
    """Column of U (ContactSpace) of a component mode numbered from 1."""
    i = model.components.index(component)
    return int(model.n_modes[:i].sum()) + mode - 1


class _Clock:
    """Wall time of consecutive stages."""

    def __init__(self) -> None:
        self._last = time.perf_counter()
        self.stages: dict[str, float] = {}

    def stage(self, name: str) -> None:
        now = time.perf_counter()
        self.stages[name] = now - self._last
        self._last = now


# nominal shapes are computed up to this times the band's end, for modes that a sweep moves into it
BAND_FACTOR = 1.1
SHAPE_TOLERANCE = 1e-2  # nominal shapes with a larger relative singular value are independent
MAX_COMPARED_COORDINATES = (
    64  # coordinates with mass up to which shapes are compared by all of them
)
N_RANDOM_DIRECTIONS = (
    16  # random directions beside the nominal shapes, for modes outside their span
)
FIRST_ROOT_COUNT_FACTOR = 1.08  # roots that a design point asks for first, over those at nominal


@dataclass(frozen=True)
class PreparedFamily:
    """A family of matrices with the data that its design points share.

    Attributes
    ----------
    model : MatrixFamily
    scale : ndarray (n,)
        Square root of the diagonal of the nominal mass matrix, which puts displacements and
        rotations in one unit. Where the nominal point has no roots, the sum of all mass terms takes
        its place; 1 where the diagonal is zero.
    shape_basis : ndarray (n, k)
        Orthonormal columns; shapes of all points are compared by their coordinates on it. In a
        small family they are all coordinates with mass. Else they span the real and imaginary parts
        of the scaled mode shapes at the nominal point, and some random directions.
    n_roots : int
        Number of roots to ask for first at a design point, conjugates included.
    timings : mapping of stage -> seconds
    """

    model: MatrixFamily
    scale: np.ndarray
    shape_basis: np.ndarray
    n_roots: int
    timings: Mapping[str, float] = field(default_factory=dict)

    @property
    def shape_rows(self) -> np.ndarray:
        """Rows (k, n) that give a mode shape's coordinates on the shape basis."""
        rows: np.ndarray = self.shape_basis.T * self.scale
        return rows


def prepare_family(
    family: MatrixFamily, nominal: Mapping[str, float], band: tuple[float, float]
) -> PreparedFamily:
    """Solve the nominal point and make the shape basis from its mode shapes (`compared_on`).

    Without roots there the basis of a large family is one coordinate and random directions.

    Parameters
    ----------
    family : MatrixFamily
    nominal : mapping of parameter -> value
    band : (low, high)
        Angular frequencies, rad/s.

    Raises
    ------
    ModelError
        A coefficient that has no value at the nominal point.
    ConvergenceError
        Entries too large or too small to compute with.
    """
    started = time.perf_counter()
    M, C, K = family.matrices(nominal)
    scale, psi, inside = _scale(M.diagonal()), np.zeros((family.n, 0)), 0
    try:
        roots = roots_in_band(M, C, K, (band[0], BAND_FACTOR * band[1]))
    except ConvergenceError:  # other points may be solvable all the same
        masses = [abs(t.matrix.diagonal()) for t in family.terms if t.order == ORDERS["M"]]
        scale = _scale(np.sum(masses, axis=0))
    else:
        psi = roots.psi
        beyond = roots.lam[np.abs(roots.lam) > band[1]]
        inside = roots.n_below - len(beyond) - int((beyond.imag > 0).sum())
    first = min(max(int(FIRST_ROOT_COUNT_FACTOR * inside), FIRST_ROOTS), 2 * family.n)
    basis = compared_on(scale[:, None] * psi, scale > 0.0)
    return PreparedFamily(
        model=family,
        scale=scale,
        shape_basis=basis,
        n_roots=first,
        timings={"nominal_s": time.perf_counter() - started},
    )


def compared_on(psi: np.ndarray, massive: np.ndarray) -> np.ndarray:
    """Orthonormal columns (n, k) on which shapes are compared, made from shapes psi (n, m).

    A mode that a sweep brings into the band may be orthogonal to all of these. It still has a
    component on directions that are drawn at random, the same ones at every call. Only coordinates
    that are `massive` (n,) take part.
    """
    n, count = len(psi), int(massive.sum())
    if count <= MAX_COMPARED_COORDINATES:
        return np.eye(n)[:, massive]
    spanned = spanning(psi)
    drawn = np.random.default_rng(0).standard_normal(
        (n, min(N_RANDOM_DIRECTIONS, count - spanned.shape[1]))
    )
    drawn *= massive[:, None]
    drawn -= spanned @ (spanned.T @ drawn)
    return np.hstack([spanned, np.linalg.qr(drawn)[0]])


def spanning(psi: np.ndarray) -> np.ndarray:
    """Orthonormal columns (n, k) that span the real and imaginary parts of shapes (n, m).

    Without shapes, the first coordinate stands for all.
    """
    if not psi.shape[1]:
        return np.eye(len(psi), 1)
    unit = psi / np.maximum(np.linalg.norm(psi, axis=0), 1e-300)
    U, s, _ = np.linalg.svd(np.hstack([unit.real, unit.imag]), full_matrices=False)
    basis: np.ndarray = U[:, s > SHAPE_TOLERANCE * s[0]]
    return basis


def _scale(diagonal: np.ndarray) -> np.ndarray:
    """Square root of the modulus of each entry; ones where the whole diagonal is zero."""
    size: np.ndarray = np.sqrt(np.abs(diagonal))
    return size if size.any() else np.ones(len(diagonal))
