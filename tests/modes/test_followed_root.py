"""An onset by one followed root is that by all modes, or there is none by it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from conftest import NOMINAL
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import MU_C, hulten_stiffness

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.quadratic_pencil import QuadraticPencil
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import linearised_point, solve_point
from squealstudy.modes.tracking.followed_root import FollowedEnd, PencilLine, followed_onset
from squealstudy.modes.tracking.onsets import Onset, SolvedLine, refine_onset
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.modes.tracking.refinement import Modes

PRECISION = 1e-6
Matrices = Callable[[float], tuple[np.ndarray, np.ndarray]]


def all_modes(C: np.ndarray, K: np.ndarray) -> Modes:
    """Every oscillating mode, out of the companion matrix as it is."""
    n = len(K)
    lam, z = la.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    kept = np.flatnonzero(lam.imag > 0)
    kept = kept[np.argsort(np.abs(lam[kept]))]
    shapes = z[:n, kept].T
    return Modes(lam[kept], shapes / np.linalg.norm(shapes, axis=1)[:, None])


class Line:
    """A family of matrices along a parameter, and the modes of both its ends."""

    def __init__(self, matrices: Matrices, low: float, high: float) -> None:
        self.matrices, self.low, self.high = matrices, low, high
        self.at_low, self.at_high = (all_modes(*matrices(x)) for x in (low, high))
        self.asked: list[float] = []

    def places(self, tolerance: float = 0.0) -> list[tuple[int, int]]:
        """Modes at both ends, paired by shape, that are unstable at one of them."""
        a, b = self.at_low, self.at_high
        partner = pair_modes(a.lam, a.shapes, b.lam, b.shapes).partner
        pairs = [(i, int(j)) for i, j in enumerate(partner) if j >= 0]
        unstable = [lam.real > tolerance * np.abs(lam) for lam in (a.lam, b.lam)]
        return [(i, j) for i, j in pairs if unstable[0][i] != unstable[1][j]]

    def followed(self, i: int, j: int, tolerance: float = 0.0) -> Onset | None:
        def pencil(x: float) -> QuadraticPencil:
            self.asked.append(x)
            C, K = self.matrices(x)
            return QuadraticPencil(sp.identity(len(K), format="csr"), C, K)

        ends = FollowedEnd(self.low, self.at_low, i), FollowedEnd(self.high, self.at_high, j)
        line = PencilLine(pencil, np.eye(len(self.matrices(self.low)[0])))
        return followed_onset(line, ends, tolerance, PRECISION)

    def by_all_modes(self, i: int, j: int, tolerance: float = 0.0) -> Onset:
        samples = SolvedLine(
            self.low, self.at_low, self.high, self.at_high, lambda x: all_modes(*self.matrices(x))
        )
        return refine_onset(samples, i, j, tolerance, PRECISION)

    def root_near(self, x: float, lam: complex) -> complex:
        """The root nearest a value."""
        found = all_modes(*self.matrices(x)).lam
        return complex(found[np.argmin(np.abs(found - lam))])


def random_family(seed: int, n: int = 12) -> Matrices:
    """Modes of one to four kHz, lightly damped, that a matrix of no symmetry drives unstable."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    omega = np.sort(rng.uniform(1.0, 4.0, n))
    K = turn @ np.diag(omega**2) @ turn.T
    C = turn @ np.diag(2.0 * rng.uniform(0.0005, 0.004, n) * omega) @ turn.T
    drive = 0.4 * rng.standard_normal((n, n))
    slope = 0.06 * rng.standard_normal((n, n))
    return lambda mu: (C - mu * (slope + slope.T) / 2, K + mu * drive)


@given(st.integers(0, 2**20), st.floats(0.01, 0.1))
@settings(max_examples=40)
def test_of_random_families_the_onset_is_that_by_all_modes(seed, width):
    line = Line(random_family(seed), 0.2, 0.2 + width)
    for i, j in line.places():
        onset = line.followed(i, j)
        if onset is None:
            continue
        slow = line.by_all_modes(i, j)
        assert onset.value == pytest.approx(slow.value, abs=2 * PRECISION)
        assert onset.frequency_hz == pytest.approx(slow.frequency_hz, rel=1e-5)
        lam = line.root_near(onset.value, 2j * np.pi * onset.frequency_hz)
        assert abs(lam.real) < 1e-4 * abs(lam)


def test_most_onsets_need_no_other_mode():
    lines = [Line(random_family(seed), 0.2, 0.22) for seed in range(60)]
    answers = [line.followed(i, j) for line in lines for i, j in line.places()]
    assert len(answers) >= 10
    assert sum(onset is not None for onset in answers) >= 0.7 * len(answers)


def test_the_root_is_exact():
    """To the last digits: what is solved in between is no approximation."""
    line = Line(random_family(3), 0.2, 0.24)
    exact = 0
    for i, j in line.places():
        onset = line.followed(i, j)
        if onset is not None:
            near = 2j * np.pi * onset.frequency_hz
            x = min(line.asked, key=lambda x: abs(x - onset.value))
            assert abs(line.root_near(x, near)) == pytest.approx(abs(near), rel=1e-12)
            exact += 1
    assert exact


def coupled(mu_c: float, c: tuple[float, float], more: float = 3.0) -> Matrices:
    """Two modes that lock in near a friction, and one far above them."""
    K = np.diag([1.0, 1.0 + 2.0 * mu_c, more])
    C = np.diag([*c, 0.02])

    def matrices(mu: float) -> tuple[np.ndarray, np.ndarray]:
        drive = np.zeros((3, 3))
        drive[0, 1], drive[1, 0] = mu, -mu
        return C, K + drive

    return matrices


@pytest.mark.parametrize("low", [0.05, 0.2, 0.29])
@pytest.mark.parametrize("c", [(0.0, 0.0), (0.0, 0.05), (0.05, 0.0), (0.002, 0.01)])
def test_the_lock_in_of_an_undamped_and_a_damped_mode_is_that_by_all_modes(c, low):
    """The growth rate is no smooth function there, and two roots are next to each other."""
    line = Line(coupled(0.3, c), low, 0.31)
    tolerance = 1e-7
    unstable = int(np.argmax(line.at_high.lam.real))
    for i in range(2):  # whichever label the growing mode has at the stable end
        try:
            slow = line.by_all_modes(i, unstable, tolerance)
        except ConvergenceError:
            assert line.followed(i, unstable, tolerance) is None
            continue
        onset = line.followed(i, unstable, tolerance)
        if onset is not None:
            assert onset.value == pytest.approx(slow.value, abs=2 * PRECISION)


def test_at_an_undamped_lock_in_all_modes_are_asked():
    """Both modes of the stable end become the unstable one: neither is clearly this."""
    line = Line(coupled(0.3, (0.0, 0.0)), 0.29, 0.305)
    assert [line.followed(i, 0, 1e-7) for i in range(2)] == [None, None]


def independent(*roots: Callable[[float], complex]) -> Matrices:
    """Modes of given roots, of shapes that turn a little."""

    def matrices(mu: float) -> tuple[np.ndarray, np.ndarray]:
        lam = np.array([root(mu) for root in roots])
        turn = la.expm(0.3 * mu * (np.eye(len(lam), k=1) - np.eye(len(lam), k=-1)))
        return turn @ np.diag(-2.0 * lam.real) @ turn.T, turn @ np.diag(abs(lam) ** 2) @ turn.T

    return matrices


def test_two_onsets_next_to_each_other_are_two():
    at = 0.5, 0.50002
    line = Line(
        independent(
            lambda mu: 0.01 * (mu - at[0]) + 1.0j,
            lambda mu: 0.02 * (mu - at[1]) + 1.05j,
            lambda mu: -0.1 + 1.1j,
        ),
        0.45,
        0.55,
    )
    pairs = line.places()
    assert len(pairs) == 2
    onsets = [line.followed(i, j) for i, j in pairs]
    assert [onset.value for onset in onsets] == pytest.approx(at, abs=2 * PRECISION)


@pytest.mark.parametrize(("low", "high"), [(0.5, 0.55), (0.45, 0.5)])
def test_an_onset_exactly_at_a_design_point_is_there_without_a_solve(low, high):
    """What the point itself says counts; such roots are told from zero before."""
    line = Line(independent(lambda mu: 0.01 * (mu - 0.5) + 1.0j, lambda mu: -0.1 + 2.0j), low, high)
    for end in (line.at_low, line.at_high):
        end.lam.real[np.abs(end.lam.real) < 1e-14] = 0.0
    onset = line.followed(0, 0)
    slow = line.by_all_modes(0, 0)
    assert onset == slow
    assert (onset.value, onset.evaluations) == (0.5, 0)


def test_a_mode_whose_frequency_another_passes_keeps_its_onset():
    line = Line(
        independent(
            lambda mu: 0.02 * (mu - 0.52) + 1.0j,
            lambda mu: -0.03 + (1.0 + 2.0 * (mu - 0.5)) * 1j,
        ),
        0.45,
        0.57,
    )
    ((i, j),) = line.places()
    assert (i, j) == (1, 0)  # the other one was below, and is above
    onset = line.followed(i, j)
    assert onset.value == pytest.approx(0.52, abs=2 * PRECISION)
    assert onset.value == pytest.approx(line.by_all_modes(i, j).value, abs=2 * PRECISION)


def test_a_wrong_label_at_one_end_is_left_to_all_modes():
    line = Line(
        independent(
            lambda mu: 0.01 * (mu - 0.5) + 1.0j, lambda mu: -0.1 + 1.02j, lambda mu: -0.1 + 1.3j
        ),
        0.45,
        0.55,
    )
    assert line.followed(0, 0) is not None
    assert line.followed(1, 0) is None
    assert line.asked[-1] != line.low


def test_a_design_point_without_an_equilibrium_leaves_the_onset_to_all_modes():
    line = Line(random_family(3), 0.2, 0.24)
    (i, j), *_ = line.places()
    assert line.followed(i, j) is not None
    known = line.matrices

    def failing(x: float) -> tuple[np.ndarray, np.ndarray]:
        if line.low < x < line.high:
            raise ConvergenceError("not_converged", "no working point")
        return known(x)

    line.matrices = failing
    assert line.followed(i, j) is None


def test_the_undamped_lock_in_of_hulten_is_at_its_closed_form():
    line = Line(lambda mu: (np.zeros((2, 2)), hulten_stiffness(mu)), 0.2, 0.3)
    unstable = int(np.argmax(line.at_high.lam.real))
    assert line.by_all_modes(0, unstable, 1e-7).value == pytest.approx(MU_C, abs=1e-5)
    onset = line.followed(0, unstable, 1e-7)
    assert onset is None or onset.value == pytest.approx(MU_C, abs=1e-5)


def test_onsets_of_a_brake_are_those_by_all_modes(prepared):
    """Several of its modes turn unstable between two frictions a step of a study apart."""

    def state(mu: float) -> DesignState:
        return DesignState(replace(NOMINAL, friction=mu), damping_ratio=1e-4)

    def solve(mu: float) -> Modes:
        found = solve_point(prepared, state(mu), (500.0, 5000.0))
        kept = ~found.overdamped
        return Modes(found.lam[kept], found.shapes[kept])

    def pencil(mu: float) -> QuadraticPencil:
        return linearised_point(prepared, state(mu))[1].pencil

    line, compared = PencilLine(pencil, prepared.shape_basis), 0
    frictions = np.linspace(0.05, 0.65, 13)
    modes = [solve(mu) for mu in frictions]
    for low, high, a, b in zip(frictions, frictions[1:], modes, modes[1:], strict=False):
        partner = pair_modes(a.lam, a.shapes, b.lam, b.shapes).partner
        for i, j in enumerate(partner):
            if j >= 0 and (a.lam[i].real > 0) != (b.lam[j].real > 0):
                ends = FollowedEnd(low, a, i), FollowedEnd(high, b, int(j))
                onset = followed_onset(line, ends, 0.0, PRECISION)
                samples = SolvedLine(low, a, high, b, solve)
                slow = refine_onset(samples, i, int(j), 0.0, PRECISION)
                if onset is not None:
                    assert onset.value == pytest.approx(slow.value, abs=2 * PRECISION)
                    assert onset.frequency_hz == pytest.approx(slow.frequency_hz, rel=1e-6)
                    compared += 1
    assert compared
