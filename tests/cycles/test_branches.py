"""Branches of cycles along a parameter: events with closed forms, on a basis that grows as well."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cycle_models as models
import numpy as np
import pandas as pd
import pytest

import squealstudy.cycles.projection as projected
from squealstudy.cycles.branch import (
    BP,
    CLOSED,
    HOPF,
    NS,
    PD,
    RANGE,
    SHRUNK,
    BranchPoint,
    Loop,
    _with_changes,
    branch,
    cycles_along,
)
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.curve import CurveMotion
from squealstudy.cycles.cycle import Search
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.families import families
from squealstudy.cycles.floquet import Floquet
from squealstudy.cycles.folds import FOLD, folds_alone
from squealstudy.cycles.growth import FAR
from squealstudy.cycles.moving import Moving
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.cycles.projection import CURVE_BASIS_ERROR
from squealstudy.kinds.limit_cycles import branch_words, continued

MU = 0.02  # of van der Pol's oscillator: its cycle is 2 cos t, to first order

SHORT = Steps(first=0.1, least=1e-3, largest=0.15, count=200)  # pairs that leave and return


def watched(K, C, coupling=0.0, even=0.0):
    """Van der Pol's oscillator x and a linear one y, whose stiffness has `coupling` x.

    With `even` times y x^2 as well.
    """

    def forces(s, w):
        x, y, v = s[..., 0], s[..., 1], w[..., 0]
        f = np.stack([MU * (1 - x**2) * v, -coupling * x * y - even * x**2 * y], axis=-1)
        by_s, by_w = np.zeros((*s.shape, 2)), np.zeros((*s.shape, 2))
        by_s[..., 0, 0], by_w[..., 0, 0] = -2 * MU * x * v, MU * (1 - x**2)
        by_s[..., 1, 0] = -coupling * y - 2 * even * x * y
        by_s[..., 1, 1] = -coupling * x - even * x**2
        return LocalForces(f, by_s, by_w)

    return Oscillator(np.diag([0.0, C]), np.diag([1.0, K]), np.eye(2)[None], forces)


def van_der_pol(mu_value):
    """Its cycle, as a start of branches at a value of the parameter."""
    motion = PeriodicMotion(np.zeros((11, 2)), 1.0, mu_value)
    motion.Q[1, 0] = 2.0
    return motion


@pytest.mark.parametrize(
    ("at", "bounds", "event", "exact", "within"),
    [
        # y'' + p y' + 2.3 y = 0: its multipliers are on the unit circle at p = 0
        (lambda p: watched(2.3, p), (-0.05, 0.1), NS, 0.0, 1e-6),
        # y'' + p y' + (1/4 + e x) y = 0, x = 2 cos t: grows by e - p/2 at half the frequency
        (lambda p: watched(0.25, p, coupling=0.02), (0.02, 0.07), PD, 0.04, 1e-3),
        # y'' + p y' + (.96 + e x^2) y = 0: grows by e/2 - p/2 at the frequency itself
        (lambda p: watched(0.96, p, even=0.02), (0.01, 0.04), BP, 0.02, 1e-3),
    ],
    ids=["torus", "flip", "branch point"],
)
def test_multipliers_that_pass_the_unit_circle(at, bounds, event, exact, within):
    points, end = branch(at, van_der_pol(bounds[1]), bounds, -1.0, lambda _: "")
    assert end == "range"
    (found,) = [p for p in points if p.event]
    assert found.event == event
    assert found.apart < 1e-6  # what the series errs by, located
    assert found.motion.parameter == pytest.approx(exact, abs=within)
    stable = [p.multipliers.stable for p in points if not p.event]
    assert stable[0]
    assert not stable[-1]
    assert points[-1].motion.parameter == pytest.approx(bounds[0], abs=1e-12)


def many(nu):
    """Ten modes, with four points whose damping falls and rises again with amplitude."""
    n, rng = 10, np.random.default_rng(3)
    B = rng.normal(size=(4, 1, n)) / np.sqrt(n)
    B[:, 0, 0] += 1.0

    def forces(y, w):
        y, w = y[..., 0], w[..., 0]
        c = 0.04 * (nu - y**2 + y**4)
        f, by_y = -c * w - 0.1 * y**3, -0.04 * (4 * y**3 - 2 * y) * w - 0.3 * y**2
        return LocalForces(f[..., None], by_y[..., None, None], -c[..., None, None])

    K = np.diag([1.0, *np.linspace(7.3, 20.0, n - 1) ** 2])
    return Oscillator(0.001 * np.eye(n), K, B, forces)


@pytest.fixture(scope="module")
def folding():
    osc = many(0.03)
    lam, psi = models.linear_modes(osc)
    k = int(np.argmin(abs(lam)))
    equations, curve = models.growth_curve(
        osc, lam[k], psi[:, k], 1e-2, 5, lambda m: np.abs(m.Q).max() > 1.3
    )
    assert curve.end == FAR
    outer = equations.motion(curve.at("C")[-1].u)
    return PeriodicMotion(outer.Q, outer.omega, 0.03)


@pytest.mark.full_size  # by default on all coordinates, and bases: test_cycles_projection.py
def test_a_branch_on_a_basis_that_grows(folding, monkeypatch):
    """Fold and Hopf point as in all coordinates; events know how exactly they are known."""
    bounds, stop = (-0.05, 0.2), models.shrunk(many(0.0), 1e-3)
    exact, end = branch(many, folding, bounds, 1.0, stop)
    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 4)
    # with few modes errors of multipliers are so wide that one torus is not told
    few, few_end = branch(many, folding, bounds, 1.0, stop, SHORT, highest=8.0)
    assert end == few_end == "hopf"
    (fold,), (near,) = ([p for p in found if p.event == FOLD] for found in (exact, few))
    assert near.motion.parameter == pytest.approx(fold.motion.parameter, rel=1e-3)
    assert near.motion.omega == pytest.approx(fold.motion.omega, rel=1e-4)
    tori, near = ([p for p in found if p.event == NS] for found in (exact, few))
    assert len(tori) == len(near) == 6
    for one, other in zip(tori, near, strict=True):
        assert one.apart < other.apart  # which has the step, too
        assert abs(one.motion.parameter - other.motion.parameter) < other.apart
    assert exact[-1].event == few[-1].event == HOPF
    assert few[-1].motion.parameter == pytest.approx(exact[-1].motion.parameter, abs=1e-5)
    assert max(p.error for p in few) < CURVE_BASIS_ERROR
    assert all(p.residual < projected.PROJECTED_TOLERANCE for p in few)


# -- closed branches -------------------------------------------------------------------------------
LEAST = (
    0.05  # damping of small motions over p: LEAST + p^2, so that steady sliding is always stable
)
ISOLA = (-0.4, 0.4)


def on_isola(p):
    return models.scalar_oscillator(models.quintic, LEAST + p**2)


@pytest.fixture(scope="module")
def isola():
    """Cycles at p = 0, the inner and the outer one; the fold over the damping."""
    osc = on_isola(0.0)
    lam, psi = models.linear_modes(osc)
    equations, curve = models.growth_curve(
        osc, lam[0], psi[:, 0], 1e-2, 9, lambda m: np.abs(m.Q).max() > 2.0
    )
    inner, outer = (equations.motion(p.u) for p in curve.at("C"))
    points, _ = branch(
        lambda nu: models.scalar_oscillator(models.quintic, nu),
        PeriodicMotion(outer.Q, outer.omega, LEAST),
        (0.0, 0.2),
        1.0,
        models.shrunk(osc, 1e-3),
    )
    (fold,) = (p.motion.parameter for p in points if p.event == FOLD)  # AUTO-07p: test_cycles_auto
    return inner, outer, np.sqrt(fold - LEAST)


@pytest.mark.parametrize(
    ("p", "direction"),
    [
        (0.2, -1.0),
        (0.2738, 1.0),
        pytest.param(0.0, 1.0, marks=pytest.mark.full_size),
        pytest.param(0.2738, -1.0, marks=pytest.mark.full_size),
        pytest.param(-0.25, 1.0, marks=pytest.mark.full_size),
    ],
)
def test_a_closed_branch_is_followed_once(isola, p, direction):
    """From far of its folds and from next to one; it ends where it began."""
    _, outer, fold = isola
    points, end = branch(
        on_isola, PeriodicMotion(outer.Q, outer.omega, p), ISOLA, direction, lambda _: ""
    )
    assert end == CLOSED
    assert points[-1].motion.parameter == pytest.approx(p, abs=1e-15)
    assert points[-1].motion.size == points[0].motion.size
    folds = sorted(point.motion.parameter for point in points if point.event)
    assert folds == pytest.approx([-fold, fold], abs=1e-8)
    mu = np.array([point.motion.parameter for point in points])
    assert np.abs(np.diff(mu)).sum() == pytest.approx(4 * fold, abs=1e-8)  # there and back
    loud = [q for q in points if not q.event and abs(q.motion.parameter) < 0.27]
    assert all(q.multipliers.stable == (q.motion.size > 1.05) for q in loud)


def test_a_closed_branch_on_a_basis_that_grows(folding, monkeypatch):
    def at(p):
        return many(0.03 + p**2)

    monkeypatch.setattr(projected, "MAX_UNPROJECTED_COORDINATES", 4)
    start = PeriodicMotion(folding.Q, folding.omega, 0.0)
    _, curve, end = cycles_along(at, start, (-0.5, 0.5), 1.0, lambda _: "")
    assert end == CLOSED
    folds = sorted(p.motion.parameter for p in curve if p.event)
    assert len(folds) == 2
    assert folds[0] == pytest.approx(-folds[1], rel=2e-3)


def narrow(x, v, p):
    """Cycles of x^2 = A at p = .1 (A^3 - 3 A^2 + 2.94 A), nearly: three beside each other."""
    c = p - 1.176 * x**2 + 2.4 * x**4 - 1.28 * x**6
    return -c * v, (2.352 * x - 9.6 * x**3 + 7.68 * x**5) * v, -c


@pytest.mark.parametrize(("size", "back"), [(0.89, True), (1.09, False)])
def test_another_cycle_beside_the_start_is_not_the_start(size, back):
    """Steps past p = .094 upwards, on the branch of the start and beside it."""
    bounds = (0.093, 0.095)

    def near(p, a):
        motion = PeriodicMotion(np.zeros((11, 1)), 1.0, p)
        motion.Q[1] = a
        return motion

    moving = Moving(lambda p: models.scalar_oscillator(narrow, p), bounds, near(0.094, 0.89))
    loop = Loop(moving, near(0.094, 0.89))
    told = []
    for motion in (near(0.0941, 0.89), near(0.0935, size), near(0.0947, size)):
        place = moving.equations(5).pack(motion)[-3:]
        told.append(loop.back(place, motion))
    assert told == [False, False, back]


def test_a_line_has_a_closed_branch_once(isola, monkeypatch):
    _, outer, _ = isola
    monkeypatch.setattr(continued, "ended", lambda *_, **__: "")
    way = SimpleNamespace(
        bounds=ISOLA, oscillator=on_isola, request=SimpleNamespace(band=(0.0, 9.0))
    )
    found = continued._branch(way, continued.Start("a-1-1", 1, 0.0, outer.Q, outer.omega))
    assert found.ends == (CLOSED, CLOSED)
    assert [p.event for p in found.points].count(FOLD) == 2
    assert len(found.crossings(0.1)) == 2


def test_a_screen_tells_a_closed_branch_once():
    """Both ends of it are the same."""
    names = ("cycle_id", "point_id", "along", "event", "value", "criticality", "branch_end")
    rows = [("a-1-1", "a", "p", "F", 0.2, "", CLOSED), ("a-1-1", "a", "p", "", 0.1, "", CLOSED)]
    branches, points = pd.DataFrame(rows, columns=list(names)), pd.DataFrame({"point_id": ["a"]})
    branches = branches.assign(level_error=4e-4)
    results = SimpleNamespace(table=lambda _: branches, points=points, units={}, parameters=[])
    (row,) = branch_words.branch_rows(results)
    assert row == (
        "branch",
        "along p: fold at 0.2; comes back to its start; its levels err by up to 0.04 %",
    )


def test_a_step_to_a_neighbour_on_a_closed_branch(isola):
    """To a design within its folds, with the cycle there; from one beyond them nothing comes."""
    _, outer, fold = isola
    start = PeriodicMotion(outer.Q, outer.omega, 0.0)
    _, curve, end = cycles_along(on_isola, start, (0.0, 0.9 * fold), 1.0, lambda _: "")
    assert end == RANGE
    assert curve[-1].motion.parameter == 0.9 * fold
    assert curve[-1].motion.size > 1.05


def loose(p):
    """x'' + (.3 - p) x' + (|x| - 1)^2 x' + x = 0, the third term beyond |x| = 1 alone.

    Beside it y, which x drives.
    """

    def forces(s, w):
        x, v = s[..., 0], w[..., 0]
        beyond = np.maximum(np.abs(x) - 1, 0.0)
        f = np.stack([-(beyond**2) * v, 0.1 * x], axis=-1)
        by_s, by_w = np.zeros((*s.shape, 2)), np.zeros((*s.shape, 2))
        by_s[..., 0, 0], by_w[..., 0, 0] = -2 * beyond * np.sign(x) * v, -(beyond**2)
        by_s[..., 1, 0] = 0.1
        return LocalForces(f, by_s, by_w)

    return Oscillator(np.diag([0.3 - p, 0.2]), np.diag([1.0, 2.3]), np.eye(2)[None], forces)


def test_cycles_of_all_sizes_at_one_value_have_neither_folds_nor_branch_points():
    """Below |x| = 1 all cycles lie at .3; larger ones where p and (|x| - 1)^2 do equal work."""
    amplitude, t = 1.6, np.linspace(0, 2 * np.pi, 4000, endpoint=False)
    beyond = np.maximum(np.abs(amplitude * np.cos(t)) - 1, 0.0) ** 2
    p = (beyond * np.sin(t) ** 2).mean() / (np.sin(t) ** 2).mean()
    start = PeriodicMotion(np.zeros((21, 2)), 1.0, 0.3 + p)
    start.Q[1, 0] = amplitude

    def stop(motion):
        return SHRUNK if np.linalg.norm(motion.Q) < 1e-3 else ""

    points, end = branch(loose, start, (0.1, 0.3 + 2 * p), -1.0, stop)
    assert end == SHRUNK
    at_one_value = [q for q in points if abs(q.motion.parameter - 0.3) < 1e-9]
    assert len(at_one_value) > 5
    assert [q.event for q in points if q.event] == [HOPF]


def multipliers_at(value, *multipliers):
    """A cycle on a branch; the last multiplier is taken for the cycle's own."""
    motion = PeriodicMotion(np.array([[0.0], [1.0], [0.0]]), 1.0, value)
    floquet = Floquet(np.array(multipliers, complex), np.eye(4), np.full(4, 4e-13), 1.0)
    return BranchPoint(motion, floquet, 0.0)


@pytest.mark.parametrize(
    ("pair", "events"), [(0.855 + 0.397j, []), (0.92 + 0.45j, [NS])], ids=["inside", "passes"]
)
def test_where_all_sizes_lie_at_one_value_no_torus_is_born(pair, events):
    """Hoffmann's oscillator, its contact closed: two multipliers are 1 to round-off, a pair .94.

    With the contact open one has left 1. Where the pair leaves the circle with it, that is told.
    """
    one, inside = 1.0 + 3e-13, 0.849 + 0.404j
    flat = [inside, np.conj(inside)]
    points = [
        multipliers_at(0.3, one, one, *flat),
        multipliers_at(0.3, one, one, *flat),
        multipliers_at(0.3, one, *flat, one),
        multipliers_at(0.4, pair, np.conj(pair), 0.96, 1.0),
    ]
    changed = _with_changes(SimpleNamespace(complete=False), points, np.inf, 1.0)
    assert [p.event for p in changed if p.event] == events


@pytest.mark.parametrize(
    ("values", "turns", "folds"),
    [
        ([0.3, 0.2, 0.2 + 1e-12, 0.2, 0.1], [2, 3], []),  # passes
        ([0.3, 0.2, 0.2 + 1e-12, 0.2, 0.3], [2, 3], [2]),  # turns back
        ([0.3, 0.2, 0.3, 0.4, 0.3], [1, 3], [1, 3]),
        ([0.3, 0.2, 0.2 + 1e-12, 0.2], [2, 3], []),  # ends there
        ([0.3, 0.4, 0.41, 0.40999, 0.4, 0.3], [3], [2]),  # in a jump behind the largest value,
        ([0.3, 0.4, 0.40999, 0.41, 0.4, 0.3], [2], [3]),  # and in one before it
    ],
)
def test_turns_by_round_off_are_no_folds(values, turns, folds):
    curve = [
        CurveMotion(PeriodicMotion(np.zeros((3, 1)), 1.0, value), 0.0, 0.0, event)
        for value, event in zip(
            values, [FOLD if k in turns else "" for k in range(len(values))], strict=True
        )
    ]
    assert [k for k, p in enumerate(folds_alone(curve, 1e-7)) if p.event == FOLD] == folds


def test_a_fold_of_a_cycle_that_sticks_is_within_its_error():
    """Runs of Runge and Kutta keep the cycle at 1.58957 m/s and lose it at 1.58958."""
    designs = models.Designs("belt", {}, None, saturation=0.2)
    contact = designs.at(sliding_speed=1.55)
    search = Search(11, 1e-2, 2.0)
    found = families(contact, (1.0, 1e6), [1], 1e-9, search)
    cycle = found.families[0][1].loudest.motion
    points, _ = branch(
        lambda v: designs.at(sliding_speed=float(v)).oscillator,
        replace(cycle, parameter=1.55),
        (1.25, 1.7),
        1.0,
        lambda m: FAR if m.parameter < 1.55 else "",
    )
    (fold,) = [p for p in points if p.event == FOLD]
    assert fold.motion.parameter > 1.5896
    assert abs(fold.motion.parameter - 1.589575) < fold.apart < 1e-3


@pytest.mark.parametrize(("harmonics", "judges"), [(17, 39), (59, 100), (100, 67)])
def test_multipliers_of_any_number_of_harmonics_are_held_against_another(
    harmonics, judges, monkeypatch
):
    """Beyond 38 none was: a pad that sticks had .9033 +- .0011 for .9137."""
    held = []
    circle = PeriodicMotion(np.zeros((2 * harmonics + 1, 1)), 1.0, 0.5)
    circle.Q[1] = 2.0
    moving = Moving(lambda p: models.scalar_oscillator(models.van_der_pol, p), (0, 1), circle)
    cycle, _, _ = moving.improve(circle, CURVE_BASIS_ERROR, projected.DAMPING_HELD)
    monkeypatch.setattr(
        projected, "floquet", lambda osc, cycle, other=None: held.append(other.harmonics)
    )
    moving.stability(cycle, np.inf)
    assert held == [judges]
