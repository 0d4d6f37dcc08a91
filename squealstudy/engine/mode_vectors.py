"""Right and left vectors of modes of models without a mesh, which show why they grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from squealstudy.engine.mode_shapes import chosen_modes, plan_of
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.mechanics.linear import LinearSystem
from squealstudy.mechanics.model import Model
from squealstudy.models.lumped.build import LumpedBuild
from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.study.family import read_family
from squealstudy.system.coupled_pair import coupled_pair
from squealstudy.tables.other_codes import roots_of

SAME_ROOT_REL_DISTANCE = 1e-4  # largest relative distance of a root solved again from the table's
SYMMETRIC = 1e-12  # largest difference of a mass matrix from its transpose over its largest entry
# largest imaginary part, relative to its size, of a squared frequency that counts as real: equal
# ones are split by 1e-8
REAL_SQUARE = 1e-6


@dataclass(frozen=True)
class ModeVectors:
    """A mode of a model of few coordinates.

    Attributes
    ----------
    row : int
        Row of its design point in `points`.
    lam : complex
        Eigenvalue, rad/s.
    coordinates : tuple of str (n,)
        Names of the model's own degrees of freedom.
    right, left : ndarray (n,) complex
        Right and left vectors, scaled so that the largest entry of each is 1.
    by_stiffness, by_velocity : float
        Parts of the growth rate [1/s] that the unsymmetric part of K and that C contribute. NaN
        where M is not symmetric.
    pair_hz, pair_share : ndarray (2,)
        Frequencies [Hz] of the two real modes of M and the symmetric part of K that carry most of
        the mode's kinetic energy, and their shares of it (0 to 1), the largest first; NaN where M
        is not positive definite.
    phase_deg : float
        Phase between the coordinates of these two, 0 to 90 deg; NaN where one moves alone.
    locked_in : bool
        Whether without damping this mode and another have one frequency, and one of both grows.
    """

    row: int
    lam: complex
    coordinates: tuple[str, ...]
    right: np.ndarray
    left: np.ndarray
    by_stiffness: float
    by_velocity: float
    pair_hz: np.ndarray
    pair_share: np.ndarray
    phase_deg: float
    locked_in: bool


def mode_vectors(results: ResultTables, track: int, point: str | None = None) -> ModeVectors:
    """Solve a tracked mode again, at a `point_id`, by default that where it grows fastest.

    Raises
    ------
    ResultsError
        Where there is no such track, or this version finds other modes or no files of the study.
    """
    row, (number, *_) = chosen_modes(results, point, None, track)
    plan = plan_of(results)
    definition = plan.study.model
    values = {
        n: float(np.broadcast_to(v, len(plan.tasks))[row]) for n, v in plan.tasks.columns.items()
    }
    # parameters of laws that were not chosen, which a Model refuses, are at their defaults
    values = {n: v for n, v in values.items() if v != definition.defaults().get(n)}
    family = None
    if isinstance(definition, FamilyDefinition):
        try:
            family = read_family(definition, plan.study.source)
        except StudyFileError as error:
            raise ResultsError(
                f"{results.directory}: the study's matrices are not where the study says, seen "
                f"from here ({error.message}): set SQUEALSTUDY_DATA to their folder"
            ) from error
    system = Model(definition, {**plan.tasks.options, **values}, family=family).at()
    modes = system.modes(plan.band_hz)
    of_point = results.modes[results.modes["point_id"] == results.points["point_id"].iloc[row]]
    (root,) = roots_of(of_point[of_point["mode"] == number])
    k = int(np.abs(modes.lam - root).argmin())
    if abs(modes.lam[k] - root) > SAME_ROOT_REL_DISTANCE * abs(root):
        raise ResultsError(
            f"{results.directory}: design point {row} has other modes now: run the study again"
        )
    lam, right, left_vector = modes.lam[k], modes.right[:, k], modes.left[:, k]
    by_stiffness, by_velocity = _growth(system.linear, lam, right)
    pair_hz, pair_share, phase_deg = _pair(system.linear, right)
    if family is None:
        reduced = system.reduced()
        coordinates = _coordinates(definition.build, system.assembly.slices)
        right, left_vector = reduced.expand(right), reduced.expand(left_vector)
    else:
        coordinates = tuple(str(i + 1) for i in range(len(right)))
    return ModeVectors(
        row=row,
        lam=complex(lam),
        coordinates=coordinates,
        right=_by_largest(right),
        left=_by_largest(left_vector),
        by_stiffness=by_stiffness,
        by_velocity=by_velocity,
        pair_hz=pair_hz,
        pair_share=pair_share,
        phase_deg=phase_deg,
        locked_in=_locked_in(system.linear, lam),
    )


def _coordinates(build: object, slices: dict[str, slice]) -> tuple[str, ...]:
    """Names of degrees of freedom: those of a lumped file, else each component with a number."""
    if isinstance(build, LumpedBuild):
        return tuple(n if isinstance(n, str) else " ".join(n) for n in build.space.names)
    return tuple(
        f"{name} {i + 1}" for name, part in slices.items() for i in range(part.stop - part.start)
    )


def _by_largest(x: np.ndarray) -> np.ndarray:
    scaled: np.ndarray = x / x[np.abs(x).argmax()]
    return scaled


def _locked_in(linear: LinearSystem, lam: complex) -> bool:
    """Whether with M and K alone the squared root nearest to a mode's frequency is complex."""
    squares = scipy.linalg.eigvals(np.asarray(linear.K), np.asarray(linear.M))
    nearest = squares[np.abs(np.sqrt(squares.astype(complex)) - abs(lam.imag)).argmin()]
    return bool(abs(nearest.imag) > REAL_SQUARE * abs(nearest))


def _growth(linear: LinearSystem, lam: complex, x: np.ndarray) -> tuple[float, float]:
    """Parts of the growth rate [1/s] due to unsymmetric K and due to C (THEORY.md eq. (108))."""
    M, C, K = (np.asarray(A) for A in (linear.M, linear.C, linear.K))
    if np.abs(M - M.T).max() > SYMMETRIC * np.abs(M).max():
        return np.nan, np.nan
    of_velocity, of_stiffness = np.vdot(x, C @ x), np.vdot(x, K @ x)
    scale = 2 * lam.imag * np.vdot(x, M @ x).real + of_velocity.imag
    return float(-of_stiffness.imag / scale), float(-lam.imag * of_velocity.real / scale)


def _pair(linear: LinearSystem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Frequencies [Hz], shares and phase [deg] of the two real modes that a mode is made of."""
    M, K = np.asarray(linear.M), np.asarray(linear.K_sym)
    try:
        squares, phi = scipy.linalg.eigh(K, M)
        low = np.linalg.cholesky(M)
    except np.linalg.LinAlgError:  # no positive definite mass
        return np.full(2, np.nan), np.full(2, np.nan), np.nan
    pair = coupled_pair(low.T @ phi, low.T @ x)
    hz = np.sqrt(np.maximum(squares[pair.modes], 0.0)) / (2 * np.pi)
    return hz, pair.share, pair.phase_deg
