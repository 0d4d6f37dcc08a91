"""Sensitivities of complex modes of a batch of small models: all design points at once.

Results are those of `modes.sensitivity` for one design point, in arrays with a row for each mode:
derivatives in closed form, their ranges of validity, and finite changes solved again. Design points
for which arrays do not suffice are left to be solved one by one (`StackedSensitivities.left`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from squealstudy.errors import SquealstudyError
from squealstudy.models.parameter import ModelDefinition
from squealstudy.modes.sensitivity.mode_sensitivities import CONDITION_LIMIT, QUARTER, UNSEEN
from squealstudy.modes.sensitivity.reduced import ModeChoice
from squealstudy.modes.sensitivity.state_derivatives import StateParameter
from squealstudy.root_pairs import angular_band
from squealstudy.stacked.linear_slopes import MatrixSlope
from squealstudy.stacked.modes import Columns, StackedSystem, stacked_system
from squealstudy.stacked.state_slopes import StackedStep, StateSlopes
from squealstudy.stacked.structure_slopes import StructureSlopes
from squealstudy.stacked.two_sided import (
    StackedFamilies,
    biorthogonality,
    chosen_modes,
    drowned_rows,
    families,
    followed,
    right_pairs,
)

Changed = Callable[[], tuple[StackedSystem, np.ndarray | None]]


@dataclass(frozen=True)
class RequestedSensitivities:
    """Sensitivities that are requested for every design point of a batch.

    Attributes
    ----------
    state : sequence of StateParameter
        Parameters of the design state, in their order.
    structural : sequence of str
        Parameters of the structure.
    choice : ModeChoice
    change : float
        Finite change of each parameter, relative to its reference.
    band_hz : (low, high)
        Frequencies, Hz.
    """

    state: Sequence[StateParameter]
    structural: Sequence[str]
    choice: ModeChoice
    change: float
    band_hz: tuple[float, float]


@dataclass(frozen=True, eq=False)
class StackedSensitivities:
    """N modes of m design points and their sensitivities to P parameters.

    Attributes
    ----------
    names : tuple of str
        Names of the P parameters.
    system : StackedSystem
        All design points.
    left : ndarray (m,) of bool
        Design points that must be solved one by one; they have no modes here.
    owner : ndarray (N,) of int
        Design point of each mode, ascending; the modes of one point by falling growth.
    lam : ndarray (N,) complex
        Roots, rad/s.
    condition, residual, biorthogonality : ndarray (N,)
        As in `StackedFamilies` and `biorthogonality`.
    energies : ndarray (N, components + 1)
        Energy shares of components and interfaces.
    value, reference, change, component_hz : ndarray (N, P)
        As in `Step`.
    derivative, finite : ndarray (N, P) complex
        Derivative of the root [1/s per unit of the parameter], and its finite change [1/s]; NaN
        where there is none.
    match : ndarray (N, P)
        Match of the mode with that of the changed design (`followed`).
    validity : ndarray (N, P)
        Change of the parameter up to which the derivative holds (THEORY.md eq. (59)).
    near_coalescence : ndarray (N, P) of bool
        Whether the finite change is beyond the validity, or the root nearly a double one.
    reason : ndarray (N, P) of str
        Why there is no finite change; empty where there is one.
    """

    names: tuple[str, ...]
    system: StackedSystem
    left: np.ndarray
    owner: np.ndarray
    lam: np.ndarray
    condition: np.ndarray
    residual: np.ndarray
    biorthogonality: np.ndarray
    energies: np.ndarray
    value: np.ndarray
    reference: np.ndarray
    change: np.ndarray
    component_hz: np.ndarray
    derivative: np.ndarray
    finite: np.ndarray
    match: np.ndarray
    validity: np.ndarray
    near_coalescence: np.ndarray
    reason: np.ndarray


def stacked_sensitivities(
    model: ModelDefinition,
    options: Mapping[str, str | int],
    columns: Columns,
    count: int,
    requested: RequestedSensitivities,
) -> StackedSensitivities:
    """Sensitivities of `count` design points; other arguments and errors as in `stacked_system`."""
    system = stacked_system(model, options, columns, count)
    solved = np.ones(count, dtype=bool)
    solved[list(system.failures)] = False
    band = angular_band(requested.band_hz)
    pairs = right_pairs(*_matrices(system))
    is_left = solved & drowned_rows(pairs[0], band[1])
    owner, mode_index = chosen_modes(pairs[0], band, requested.choice)
    is_served = (solved & ~is_left)[owner]
    owner, mode_index = owner[is_served], mode_index[is_served]
    rows = np.unique(owner)  # changed designs are solved for these only
    part, part_columns = system, columns
    if len(rows) < count:
        part_columns = {k: np.asarray(x)[rows] if np.ndim(x) else x for k, x in columns.items()}
        pairs = (pairs[0][rows], pairs[1][rows])
        owner = np.searchsorted(rows, owner)
        if len(rows):
            part = stacked_system(model, options, part_columns, len(rows))
    batch = _SensitivityBatch(part, families(*_matrices(part), pairs, owner, mode_index), len(rows))
    slopes = StateSlopes(part)
    for parameter in requested.state if len(rows) else ():
        batch.by_state(slopes, parameter, requested)
    structure = StructureSlopes(model, options, part_columns, slopes)
    for name in requested.structural if len(rows) else ():
        batch.by_structure(structure, name, requested.change)
    names = (*(p.name for p in requested.state), *requested.structural)
    return batch.told(system, names, rows, is_left)


def _matrices(system: StackedSystem) -> tuple[np.ndarray, np.ndarray]:
    """C and K (m, n, n); 0 and the identity for design points that failed."""
    linear, solved = system.linear, np.ones(len(system.linear.K), dtype=bool)
    solved[list(system.failures)] = False
    is_solved = solved[:, None, None]
    return np.where(is_solved, linear.C, 0.0), np.where(
        is_solved, linear.K, np.eye(linear.K.shape[1])
    )


class _SensitivityBatch:
    """Chosen modes of design points, and their sensitivities as parameters are added."""

    def __init__(self, system: StackedSystem, families: StackedFamilies, count: int) -> None:
        self._system, self._modes = system, families
        self._C = _matrices(system)[0]
        self._left = np.zeros(count, dtype=bool)
        self._left[families.owner[~families.told]] = True
        self._columns: dict[str, list[np.ndarray]] = {name: [] for name in PER_PARAMETER}

    def by_state(
        self, slopes: StateSlopes, parameter: StateParameter, requested: RequestedSensitivities
    ) -> None:
        """Add a parameter of the design state."""
        step = slopes.step(parameter, requested.change, requested.band_hz[1])
        self._left |= ~slopes.value(parameter)[1]

        def changed() -> tuple[StackedSystem, None]:
            return slopes.moved(parameter, step.value + step.size), None

        self._add(step, slopes, slopes.by(parameter), changed)

    def by_structure(self, structure: StructureSlopes, name: str, change: float) -> None:
        """Add a parameter of the structure."""
        step = structure.step(name, change)
        by, good = structure.by(name)
        self._left |= ~good

        def changed() -> tuple[StackedSystem, np.ndarray]:
            return structure.moved(name, step.value + step.size)

        self._add(step, structure.slopes, by, changed)

    def _add(
        self, step: StackedStep, slopes: StateSlopes, by: MatrixSlope | None, changed: Changed
    ) -> None:
        """Add the sensitivities of all modes to one parameter."""
        owner = self._modes.owner
        size = step.size[owner]
        nothing = np.full(len(owner), np.nan)
        derivative, validity = nothing.astype(complex), nothing
        if by is not None:
            products = self._products(slopes, by)
            derivative, validity = _slope_and_validity(self._modes, *products, size)
        finite, match, reason = self._finite(changed)
        condition = self._modes.condition
        columns = {
            "value": step.value[owner],
            "reference": step.reference[owner],
            "change": size,
            "component_hz": step.component_hz[owner],
            "derivative": derivative,
            "finite": finite,
            "match": match,
            "validity": validity,
            "near_coalescence": (validity < np.abs(size)) | ~(condition < CONDITION_LIMIT),
            "reason": reason,
        }
        for name, values in columns.items():
            self._columns[name].append(values)

    def _products(
        self, slopes: StateSlopes, by: MatrixSlope
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First column and row (N, q) of `change_products`, and y^H M_theta x (N,) of the mass."""
        modes, owner = self._modes, self._modes.owner
        x, y, lam = modes.X[:, :, :1], modes.Y[:, :, :1].conj().swapaxes(1, 2), modes.lam
        first = lam[:, :1, None]
        K, C = by.K[owner], by.C[owner]
        right = K @ x + first * (C @ x)
        by_stiffness, by_damping = y @ K, y @ C
        mass = np.zeros(len(owner), dtype=complex)
        row = (by_stiffness @ modes.X)[:, 0] + lam * (by_damping @ modes.X)[:, 0]
        if by.M is not None:
            M = by.M[owner]
            right = right + first**2 * (M @ x)
            by_mass = (y @ M @ modes.X)[:, 0]
            row = row + lam[:, :1] * lam * by_mass
            mass = by_mass[:, 0]
        column = np.einsum("Nij,Ni->Nj", modes.Y.conj(), right[:, :, 0])
        modal = slopes.modal.following(by)
        if modal is not None:
            column[:, 0] += lam[:, 0] * (y @ modal[owner] @ x)[:, 0, 0]
        return column, row, mass

    def _finite(self, changed: Changed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Finite change of each root (N,), its match (N,), and the reason if there is none (N,)."""
        owner = self._modes.owner
        finite, match = np.full(len(owner), complex(np.nan, np.nan)), np.full(len(owner), np.nan)
        try:
            system, to_unchanged = changed()
        except SquealstudyError as error:
            return finite, match, np.full(len(owner), str(error), dtype=object)
        roots, X = right_pairs(*_matrices(system))
        if to_unchanged is not None:
            X = to_unchanged @ X
        root_change, matched = followed(self._C, self._modes, (roots, X))
        texts = np.full(len(self._left), "", dtype=object)
        for i, (_, message) in system.failures.items():
            texts[i] = message
        lost = texts[owner] != ""
        return np.where(lost, finite, root_change), np.where(lost, match, matched), texts[owner]

    def told(
        self,
        system: StackedSystem,
        names: tuple[str, ...],
        rows: np.ndarray,
        is_left: np.ndarray,
    ) -> StackedSensitivities:
        """Results at the points that are not left; `rows` are their design points in `system`."""
        modes, shape = self._modes, (len(self._modes.owner), len(names))
        is_served = ~self._left[modes.owner]
        is_left = is_left.copy()
        is_left[rows[self._left]] = True

        def table(name: str) -> np.ndarray:
            columns = self._columns[name]
            if columns:
                return np.stack(columns, axis=1)[is_served]
            return np.zeros((int(is_served.sum()), len(names)), dtype=PER_PARAMETER[name])

        energies = np.zeros((shape[0], 0))
        if shape[0]:
            energies = self._energies()
        owner = rows[modes.owner[is_served]] if len(rows) else modes.owner[is_served]
        return StackedSensitivities(
            names=names,
            system=system,
            left=is_left,
            owner=owner,
            lam=modes.lam[is_served, 0] if shape[0] else np.zeros(0, dtype=complex),
            condition=modes.condition[is_served] if shape[0] else np.zeros(0),
            residual=modes.residual[is_served],
            biorthogonality=biorthogonality(self._C, modes)[is_served],
            energies=energies[is_served],
            **{name: table(name) for name in PER_PARAMETER},
        )

    def _energies(self) -> np.ndarray:
        """Energy shares (N, components + 1)."""
        modes, owner = self._modes, self._modes.owner
        rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
        psi = np.zeros((len(self._left), modes.X.shape[1], int(rank.max()) + 1), dtype=complex)
        psi[owner, :, rank] = modes.X[:, :, 0]
        energies: np.ndarray = self._system.energies(psi).swapaxes(1, 2)[owner, rank]
        return energies


PER_PARAMETER: Mapping[str, type] = {
    "value": float,
    "reference": float,
    "change": float,
    "component_hz": float,
    "derivative": complex,
    "finite": complex,
    "match": float,
    "validity": float,
    "near_coalescence": bool,
    "reason": object,
}


def _slope_and_validity(
    modes: StackedFamilies, column: np.ndarray, row: np.ndarray, mass: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Slope and validity (THEORY.md eq. (59)) of each mode (N,), as in `slope_and_validity`."""
    norm, lam = modes.norm, modes.lam
    first = norm[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slope = np.where(first != 0, -column[:, 0] / first, complex(np.nan, np.nan))
        coupling = row[:, 1:] * column[:, 1:] / (first[:, None] * norm[:, 1:])
        curved = np.where(modes.there[:, 1:], coupling / (lam[:, :1] - lam[:, 1:]), 0.0)
        half = curved.sum(axis=1) - slope * lam[:, 0] * mass / first
        unseen = np.abs(half) * size**2 <= UNSEEN * np.abs(lam[:, 0])
        validity = np.where(np.isfinite(half), QUARTER * np.abs(slope) / np.abs(half), 0.0)
    return slope, np.where(unseen, np.inf, validity)
