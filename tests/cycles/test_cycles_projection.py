"""Cycles of large models on few vectors: against the same balance in all coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import squealstudy.cycles.projection as projected
from squealstudy.cycles import curve as curves
from squealstudy.cycles import growth
from squealstudy.cycles.balance import sampled
from squealstudy.cycles.blocks import Blocks, mean_tangents
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import Path
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.floquet import floquet, floquet_on, monodromy, trapezoidal
from squealstudy.cycles.growth import family_curve, linear_motion
from squealstudy.cycles.harmonics import derivative, with_harmonics
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.cycles.projection import CYCLE_BASIS_ERROR, DAMPING_HELD, SIZE_HELD, Projection
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.dense_qep import dense_roots

N, GROUPS = 40, 5
STEPS = Steps(first=0.3, largest=0.5, count=80)


def oscillator():
    """Forty modes from 1 to 20 rad/s, damped, with five points that pull at small motions."""
    rng = np.random.default_rng(3)
    K, C = np.diag(np.linspace(1.0, 20.0, N) ** 2), 0.05 * np.eye(N)
    B = rng.normal(size=(GROUPS, 1, N)) / np.sqrt(N)
    B[:, 0, 0] += 1.0

    def forces(y, w):
        y, w = y[..., 0], w[..., 0]
        f = 0.03 * (1 - y**2) * w - 0.1 * y**3
        by_y, by_w = -0.06 * y * w - 0.3 * y**2, 0.03 * (1 - y**2)
        return LocalForces(f[..., None], by_y[..., None, None], by_w[..., None, None])

    return Oscillator(C, K, B, forces)


def of_fastest_mode(osc):
    """The basis of one complex mode, its root, its vector."""
    zero = np.zeros((1, osc.n))
    C, K = osc.tangent(zero, zero)
    lam, psi = dense_roots(C[0], K[0], (0.0, 5.0))
    k = int(np.argmax(lam.real))
    return Projection(osc, psi[:, k], lam[k].imag), lam[k], psi[:, k]


def found(osc, harmonics=5):
    projection, lam, phi = of_fastest_mode(osc)
    start = linear_motion(phi, lam, projection.weight, 1e-3)
    start = PeriodicMotion(with_harmonics(start.Q, harmonics), start.omega, start.parameter)

    def far(motion):
        return "far" if np.abs(motion.Q).max() > 4.0 else ""

    curve, end = family_curve(projection, start, far, STEPS)
    assert end == "far"
    (zero,) = [p for p in curve if p.event == "C"]
    return projection, zero.motion


@pytest.fixture(scope="module")
def both():
    osc = oscillator()
    with pytest.MonkeyPatch.context() as patch:
        exact, cycle = found(osc)
        assert exact.complete
        patch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
        few, near = found(osc)
    return osc, exact.solve(cycle, DAMPING_HELD)[0], few, replace(near, parameter=0.0)


def within(projection, motion):
    """What a basis holds of a motion."""
    equations = projection.equations(motion.harmonics)
    return equations.motion(equations.pack(motion))


def distance(projection, one, other):
    sizes = [np.hypot(*m.Q[[1, 1 + m.harmonics], 0]) for m in (one, other)]
    return abs(sizes[0] / sizes[1] - 1) + abs(one.omega / other.omega - 1)


def wrong(projection, motion, exact):
    """Norm of all that is wrong but its phase, relative, as the error of a basis."""
    off, turn = (A * projection.weight for A in (motion.Q - exact.Q, derivative(exact.Q)))
    off -= turn * (turn * off).sum() / (turn**2).sum()
    return np.linalg.norm(off) / np.linalg.norm(exact.Q * projection.weight)


def test_a_projected_cycle_is_that_of_all_coordinates(both):
    _, exact, few, near = both
    assert not few.complete
    cycle, error, residual = few.improve(near, CYCLE_BASIS_ERROR, DAMPING_HELD)
    assert few.size < N
    assert error < CYCLE_BASIS_ERROR
    assert residual < projected.PROJECTED_TOLERANCE
    assert distance(few, cycle, exact) < CYCLE_BASIS_ERROR
    corrected = few.corrected(cycle)
    assert corrected.omega == pytest.approx(exact.omega, abs=5e-6)
    assert wrong(few, corrected, exact) < 0.4 * wrong(few, cycle, exact) < 0.4 * CYCLE_BASIS_ERROR


def test_a_correction_to_first_order_mends_most_of_what_a_small_basis_lacks(both):
    """In all coordinates; of the frequency alone, which errs by less, it need not."""
    osc, exact, _, _ = both
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
        poor = of_fastest_mode(osc)[0]
        cycle, _ = poor.solve(exact, DAMPING_HELD)
        poor.join(cycle, poor.correction(cycle, True))
        cycle, _ = poor.solve(exact, DAMPING_HELD)
        poor.correction(cycle, True)
        before, after = (wrong(poor, m, exact) for m in (cycle, poor.corrected(cycle)))
    assert poor.size < 8
    assert 1e-2 < before < 5e-2
    assert after < 0.2 * before


def test_blocks_solve_each_harmonic_with_the_mean_tangents(both):
    """Against solutions of double precision, at another size and phase than where they were made.

    The first harmonic keeps both: its change has no part along it.
    """
    osc, exact, few, _ = both
    H, weight = exact.harmonics, few.weight
    exact = replace(exact, parameter=0.01)
    local = sampled(osc, osc.sampling(H), exact.Q, exact.omega)
    blocks = Blocks(osc, exact, local, weight)
    angle = 0.9 * np.arange(1, H + 1)[:, None]
    c, s = exact.Q[1 : H + 1], exact.Q[H + 1 :]
    turned = [c * np.cos(angle) + s * np.sin(angle), s * np.cos(angle) - c * np.sin(angle)]
    other = replace(exact, Q=1.04 * np.vstack([exact.Q[:1], *turned]))
    R = np.random.default_rng(5).normal(size=exact.Q.shape)
    found = blocks.step(R, other)
    K, C = mean_tangents(osc, local, exact.parameter)
    change = [np.linalg.solve(K, -R[0])]
    for h in range(1, H + 1):
        w = h * exact.omega
        A, r = K + 1j * w * C - w**2 * np.eye(N), -(R[h] - 1j * R[H + h])
        if h > 1:
            change.append(np.linalg.solve(A, r))
            continue
        q = other.Q[1] - 1j * other.Q[H + 1]
        bordered = np.block([[A, q[:, None]], [(weight**2 * q.conj())[None], np.zeros((1, 1))]])
        *x, shift = np.linalg.solve(bordered, np.append(r, 0.0))
        change.append(np.array(x))
    assert abs((weight**2 * q.conj()) @ change[1]) < 1e-10 * np.abs(weight**2 * q * change[1]).sum()
    for h, x in enumerate(change):
        own = found.Q[h] - (1j * found.Q[H + h] if h else 0.0)
        assert np.abs(own - x).max() < 2e-5 * np.abs(x).max()
    with np.errstate(all="ignore"):
        still = Blocks(osc, replace(exact, Q=0.0 * exact.Q), local, weight)
    with pytest.raises(ConvergenceError, match="singular"):
        still.step(R, other)
    # A q with omega + d, xi + e: -2 omega d + i omega e more, to first order
    assert found.omega == pytest.approx(-shift.real / (2.0 * exact.omega), rel=1e-4)
    assert found.parameter == pytest.approx(shift.imag / exact.omega, rel=1e-4)


def test_absurd_motions_are_told_and_do_not_spoil_a_basis(both):
    """Forces beyond single precision are corrected all the same; beyond double they are told."""
    osc, exact, _, _ = both
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
        poor = of_fastest_mode(osc)[0]
        poor.correction(exact, True)
        far = replace(exact, Q=1e20 * exact.Q)
        change = poor.correction(far)
        assert np.isfinite(change.Q).all()
        poor.grow(far, change)
        assert all(np.isfinite(V).all() for V in poor.vectors)
        for size, words in ((1e20, "absurdly stiff"), (1e120, "not finite")):
            with np.errstate(all="ignore"), pytest.raises(ConvergenceError, match=words):
                poor.correction(replace(exact, Q=size * exact.Q), size < 1e100)


def test_a_cycle_of_another_size_is_not_that_of_a_motion(both):
    _, exact, few, near = both
    cycle, _ = few.cycle_near(near, 7)
    assert distance(few, cycle, exact) < 1e-2
    with pytest.raises(ConvergenceError) as caught:
        few.cycle_near(PeriodicMotion(1.4 * near.Q, near.omega), 5)
    assert caught.value.status == "another_cycle"


def test_a_basis_in_which_the_way_on_cannot_be_told_is_refused(both):
    """A direction across a curve may as well be the way back; one along it tells which way."""
    _, exact, few, _ = both
    path = Path(few, 5, (SIZE_HELD, 1.0), lambda *_: "", STEPS, {})
    for factor in (0.9, 1.1):
        _, there = path._here(exact, replace(exact, Q=factor * exact.Q))
        assert np.sign(there.tangent[SIZE_HELD]) == np.sign(factor - 1.0)
    ahead, behind = (replace(exact, Q=factor * exact.Q) for factor in (1.1, 0.9))
    path._here(exact, ahead, behind)
    with pytest.raises(ConvergenceError, match="which way"):
        path._here(exact, ahead, replace(exact, Q=1.2 * exact.Q))
    with pytest.raises(ConvergenceError, match="which way"):
        path._here(exact, replace(exact, parameter=exact.parameter + 0.1))


def test_a_curve_that_turns_back_by_mistake_says_so(monkeypatch):
    """It is seen at half of its largest size, on the path on which it grew."""
    again, turned = Path._again, []

    def turn(path, curve, *way):
        equations, here = again(path, curve, *way)
        if curve[-1].motion.Q[1:].max() > 0.5 and not turned:
            turned.append(len(curve))
            here = replace(here, tangent=-here.tangent)
        return equations, here

    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
    monkeypatch.setattr(Path, "_again", turn)
    projection, lam, phi = of_fastest_mode(oscillator())
    start = linear_motion(phi, lam, projection.weight, 1e-3)
    start = PeriodicMotion(with_harmonics(start.Q, 5), start.omega, start.parameter)
    curve, end = family_curve(projection, start, lambda _: "", replace(STEPS, count=200))
    assert turned
    assert end == "retraced"
    sizes = [np.linalg.norm(p.motion.Q[[1, 6]]) for p in curve]
    back = [size / max(sizes) for size in sizes[int(np.argmax(sizes)) :]]
    assert back[-1] < 0.5
    assert sum(size < 0.5 for size in back) <= 2, back  # steps are long there


@pytest.mark.parametrize(("share", "end"), [(0.2, ""), (0.05, "other_resonance")])
def test_a_curve_passes_other_resonances_until_little_is_left_of_the_first_harmonic(
    both, monkeypatch, share, end
):
    """The first harmonic's share of a motion, in the norm of the basis."""
    _, exact, projection, _ = both
    told = []

    class Asked:
        def __init__(self, *settings, watched):
            self.ended = settings[3]

        def from_motion(self, start):
            Q = start.Q.copy()
            Q[[2, start.harmonics + 2]] = Q[[1, start.harmonics + 1]] / share
            told.append(self.ended(None, replace(start, Q=Q)))
            return [], told[-1]

    monkeypatch.setattr(growth, "Path", Asked)
    assert family_curve(projection, exact, lambda _: "", STEPS) == ([], end)


@pytest.mark.parametrize(
    ("times", "astray", "end"),
    [(1, False, "far"), (99, False, "not_converged"), (1, True, "not_converged")],
    ids=["once", "always", "and led to another motion"],
)
def test_a_lost_curve_is_taken_up_again_on_a_new_basis(monkeypatch, times, astray, end):
    """Where it was, to the same end; not for ever, and not from a motion that is another one."""
    step, improve, larger, lost = curves.next_point, Projection.improve, Path._grown, []

    def next_point(equations, here, *rest, **options):
        if here.u[-2] > np.log(0.5) and len(lost) < times:
            lost.append(here.u[-2])
            return None
        return step(equations, here, *rest, **options)

    def elsewhere(projection, motion, *rest):
        found, error, residual = improve(projection, motion, *rest)
        moved = replace(found, Q=(1.2 if lost and astray else 1.0) * found.Q)
        return moved, error, residual

    def no_help(path, equations, here, motion, *local):
        return larger(path, equations, here, motion, *local) if local else None

    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
    projection, lam, phi = of_fastest_mode(oscillator())
    start = linear_motion(phi, lam, projection.weight, 1e-3)
    start = PeriodicMotion(with_harmonics(start.Q, 5), start.omega, start.parameter)

    def far(motion):
        return "far" if np.abs(motion.Q).max() > 4.0 else ""

    smooth, _ = family_curve(projection, start, far, STEPS)
    monkeypatch.setattr(curves, "next_point", next_point)
    monkeypatch.setattr(Path, "_grown", no_help)
    monkeypatch.setattr(Projection, "improve", elsewhere)
    projection, _, _ = of_fastest_mode(oscillator())
    curve, reason = family_curve(projection, start, far, STEPS)
    assert lost
    assert reason == end
    sizes, mu = np.array([(p.motion.size, p.motion.parameter) for p in curve]).T
    assert np.all(np.diff(sizes[[not p.event for p in curve]]) > 0)
    known = [(p.motion.size, p.motion.parameter) for p in smooth]
    assert mu == pytest.approx(np.interp(sizes, *zip(*known, strict=True)), abs=5e-3)
    assert ("C" in [p.event for p in curve]) == (end == "far")


@pytest.mark.parametrize(
    ("back", "seen"),
    [({}, True), ({"omega": 1.01}, False), ({"mu": -0.5}, False), ({"shape": (1.0, 0.3)}, False)],
    ids=["the same", "frequency", "damping", "shape"],
)
def test_a_curve_that_comes_back_otherwise_is_no_retrace(back, seen):
    def motion(size, omega=1.0, mu=-0.4, shape=(1.0, 0.1)):
        return PeriodicMotion(size * np.array([(0.0, 0.0), shape, (0.0, 0.0)]), omega, mu)

    passed = [motion(size) for size in (1e-3, 0.1, 0.3, 1.0, 0.8)]
    assert not growth._retraced(passed)
    assert growth._retraced([*passed, motion(0.4, **back)]) == seen


def test_the_error_of_a_basis_is_told(both):
    """With the mode and what a first correction adds the estimate covers what is wrong."""
    osc, exact, _, _ = both
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
        poor = of_fastest_mode(osc)[0]
        start = within(poor, exact)
        cycle, _ = poor.solve(start, DAMPING_HELD)
        told = poor.error(cycle, poor.correction(cycle, True))
        wrong = np.linalg.norm((cycle.Q[1:] - exact.Q[1:]) * poor.weight)
        wrong /= np.linalg.norm(exact.Q * poor.weight)
        assert told > 10 * CYCLE_BASIS_ERROR
        assert told > 0.3 * wrong
        patch.setattr(projected, "MAX_VECTORS_PER_HARMONIC", 2)
        with pytest.raises(ConvergenceError, match="more than 2 vectors of a harmonic"):
            poor.improve(start, CYCLE_BASIS_ERROR, SIZE_HELD)


def test_stability_in_the_modes_about_a_cycle(both):
    osc, exact, few, near = both
    cycle = few.improve(near, CYCLE_BASIS_ERROR, DAMPING_HELD)[0]
    V, count = few.deviations(cycle, 8.0)
    np.testing.assert_allclose(V.T @ V, np.eye(V.shape[1]), atol=1e-9)
    assert count < V.shape[1] < N
    whole = floquet(osc, exact)
    small = floquet_on(osc, V, count, cycle, cycle)
    assert small.stable
    assert whole.stable
    assert abs(small.multipliers[0]) == pytest.approx(abs(whole.multipliers[0]), abs=2e-2)
    assert abs(small.multipliers[0]) != abs(whole.multipliers[0])


def test_slow_changes_of_a_cycle_are_among_its_deviations(both):
    """Few modes and vectors lack them in part, by ten times as much with three BLAS kernels."""
    osc, exact, _, _ = both
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
        few = Projection.on_harmonics_of(osc, exact)
        cycle = few.improve(exact, CYCLE_BASIS_ERROR, DAMPING_HELD)[0]
    ways = np.vstack(few._changes_of_size(cycle)) * few.weight
    off = []
    for aside in (few._changes_of_size, lambda motion: []):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(few, "_changes_of_size", aside)
            known, _ = np.linalg.qr(few.weight[:, None] * few.deviations(cycle, 1.0)[0])
        off.append(np.linalg.norm(ways - ways @ known @ known.T))
    assert off[0] < 0.2 * off[1]


def test_errors_of_multipliers_tell_what_a_basis_lacks(both):
    """All modes, and fewer: the errors cover what the multipliers near the circle are off by."""
    osc, exact, few, _ = both
    whole = floquet(osc, exact)
    V = np.linalg.qr(np.hstack([few.vectors[1], np.eye(N)]))[0]
    for count in (few.vectors[1].shape[1], few.vectors[1].shape[1] + 4):
        fewer = PeriodicMotion(with_harmonics(exact.Q, 3), exact.omega)
        found = floquet_on(osc, V, count, exact, fewer)
        near = np.abs(found.multipliers) > 0.97
        sizes = np.sort(np.abs(found.multipliers[near]))
        true = np.sort(np.abs(whole.multipliers))[-len(sizes) :]
        assert np.abs(sizes - true).max() <= found.errors[near].max()
        assert found.errors.max() < 0.1


def test_the_trapezoidal_rule_converges_to_the_monodromy(both):
    _, exact, few, _ = both
    V = few.vectors[1][:, :6]
    osc, cycle = few.oscillator.on(V), PeriodicMotion(exact.Q @ V, exact.omega)
    fine = monodromy(osc, cycle, 512)
    errors = [np.abs(trapezoidal(osc, cycle, steps) - fine).max() for steps in (400, 800)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] < 1e-2 * np.abs(fine).max()


def test_a_curve_holds_at_a_design_to_which_its_motions_need_little_change(both, monkeypatch):
    """Each first-order change is that which the balance there makes; a curve is judged by all."""
    osc, few = both[0], both[2]
    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
    lam, phi = of_fastest_mode(osc)[1:]
    start = linear_motion(phi, lam, few.weight, 1e-3)
    start = PeriodicMotion(with_harmonics(start.Q, 3), start.omega, start.parameter)
    curve, _ = family_curve(
        Projection(osc, phi, lam.imag), start, lambda m: "far" if m.size > 4.0 else "", STEPS
    )

    def softer(share):
        return replace(osc, K=osc.K - share * np.outer(*2 * [osc.K[1] + osc.K[0]]))

    assert growth.holds_here(osc, curve)
    assert growth.holds_here(softer(0.001), curve)
    assert not growth.holds_here(softer(0.05), curve)
    astray = replace(curve[-1].motion, Q=np.roll(curve[-1].motion.Q, 1, axis=1))
    assert not growth.holds_here(osc, [*curve, replace(curve[-1], motion=astray)])

    def lost(*_):
        raise ConvergenceError("singular_jacobian", "")

    monkeypatch.setattr(Projection, "correction", lost)
    assert not growth.holds_here(osc, curve)


def test_a_first_order_change_tells_how_far_a_motion_moves(both, monkeypatch):
    osc, exact = both[:2]
    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 10)
    for share in (1e-3, 1e-2):
        moved = replace(osc, K=osc.K * (1.0 + np.diag(np.linspace(0.0, share, N))))
        projection = Projection.on_harmonics_of(moved, exact)
        first = exact.changed(projection.correction(exact, True))
        better, *_ = projection.improve(exact, 1e-4, SIZE_HELD)
        told, true = (growth._rel_distance(projection.weight, exact, m) for m in (first, better))
        assert 0.5 < told / true < 2.0
