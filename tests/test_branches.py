"""Branches of cycles along a parameter: events with closed forms, on a basis that grows as well."""

from __future__ import annotations

import cycle_models as models
import numpy as np
import pytest

import squealstudy.cycles.projection as projected
from squealstudy.cycles.branch import BP, HOPF, NS, PD, TURN, branch
from squealstudy.cycles.continuation import Steps
from squealstudy.cycles.equations import PeriodicMotion
from squealstudy.cycles.growth import FAR
from squealstudy.cycles.oscillator import LocalForces, Oscillator
from squealstudy.cycles.projection import TARGET

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
    assert found.apart == 0.0
    assert found.motion.mu == pytest.approx(exact, abs=within)
    stable = [p.multipliers.stable for p in points if not p.event]
    assert stable[0]
    assert not stable[-1]
    assert points[-1].motion.mu == pytest.approx(bounds[0], abs=1e-12)


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


def test_a_branch_on_a_basis_that_grows(folding, monkeypatch):
    """Fold and Hopf point as in all coordinates; events know how exactly they are known."""
    bounds, stop = (-0.05, 0.2), models.shrunk(many(0.0), 1e-3)
    exact, end = branch(many, folding, bounds, 1.0, stop)
    monkeypatch.setattr(projected, "WHOLE", 4)
    few, few_end = branch(many, folding, bounds, 1.0, stop, SHORT, highest=3.0)
    assert end == few_end == "hopf"
    (fold,), (near,) = ([p for p in found if p.event == TURN] for found in (exact, few))
    assert near.motion.mu == pytest.approx(fold.motion.mu, rel=1e-3)
    assert near.motion.omega == pytest.approx(fold.motion.omega, rel=1e-4)
    tori, near = ([p for p in found if p.event == NS] for found in (exact, few))
    assert len(tori) == len(near) == 6
    for one, other in zip(tori, near, strict=True):
        assert one.apart == 0.0
        assert abs(one.motion.mu - other.motion.mu) < other.apart
    assert exact[-1].event == few[-1].event == HOPF
    assert few[-1].motion.mu == pytest.approx(exact[-1].motion.mu, abs=1e-5)
    assert max(p.error for p in few) < TARGET
    assert all(p.residual < projected.PROJECTED for p in few)
