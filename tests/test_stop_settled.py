"""Runs that stop once their outcome is known: pauses that change nothing, and who may stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import FrictionLaw, ModalSystem, TransientDesign
from squealstudy.analysis.transient.watch import Watch
from squealstudy.errors import ParameterError
from squealstudy.models.law import ContactLaw

SHORT = TransientSettings(duration=1.2e-3, step=2e-6, save_every=5)
N = 10


@pytest.fixture(scope="module")
def lively() -> tuple[ModalSystem, list[TransientDesign], np.ndarray]:
    """Ten modes over twelve points that stick, slip and open; designs need unlike iterations."""
    rng = np.random.default_rng(3)
    one = np.ones(12)
    system = ModalSystem(
        omega2=(2 * np.pi * np.linspace(1e3, 8e3, N)) ** 2,
        N=rng.normal(size=(12, N)),
        T1=rng.normal(size=(12, N)),
        T2=rng.normal(size=(12, N)),
        area=1e-4 * one,
        frictional=one,
        radius=0.1 * one,
        gap=0 * one,
        k_ref=50.0 * one,
        force=np.column_stack([10.0 * one, -4.0 * one, 0 * one]),
        sensors=np.eye(N)[:3],
    )
    law = ContactLaw("exponential", p0=1e5, lam=5e5)
    speeds = (0.05, 0.1, 0.2, 0.4, 0.8)
    designs = [
        TransientDesign(law, FrictionLaw(mu, mu, 1e7), speed, np.full(N, 20.0))
        for mu, speed in zip(np.linspace(0.2, 0.6, 5), speeds, strict=True)
    ]
    return system, designs, 0.02 * rng.normal(size=N)


def never(k: int, run: TransientResult) -> str:
    return ""


def same(a: TransientResult, b: TransientResult, rows: int | None = None) -> bool:
    """Histories bit by bit, of `a` its first `rows`."""
    pairs = [(a.history[name], b.history[name]) for name in b.history]
    pairs += [(a.displacement, b.displacement), (a.velocity, b.velocity)]
    return all(np.array_equal(x[:rows], y) for x, y in pairs)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_pauses_change_nothing(lively, count):
    """Also where designs of a batch are at different times when one of them pauses."""
    system, designs, kick = lively
    times: list[tuple[int, float]] = []

    def judge(k: int, run: TransientResult) -> str:
        times.append((k, run.time))
        return ""

    whole = simulate(system, designs[:count], SHORT, 0 * kick, kick)
    watch = Watch([37, 50, 64, 85, 1000][:count], judge)
    looked_at = simulate(system, designs[:count], SHORT, 0 * kick, kick, watch)
    assert len({r.mean_iterations for r in whole}) == count
    for a, b in zip(whole, looked_at, strict=True):
        assert b.outcome == "ok"
        assert b.stop_reason == "end"
        assert same(a, b)
        assert np.array_equal(a.q, b.q)
        assert np.array_equal(a.v, b.v)
        assert a.energy == b.energy
        assert (a.mean_iterations, a.max_iterations) == (b.mean_iterations, b.max_iterations)
    first = [t for k, t in times if k == 0]
    np.testing.assert_allclose(first, 2e-6 * np.arange(40, 600, 40))  # 37 steps are 8 rows


@pytest.mark.parametrize("count", [1, 2])
def test_a_stopped_run_is_the_shorter_run(lively, count):
    system, designs, kick = lively
    watch = Watch([100] * count, lambda k, run: "known" if run.time > 3.9e-4 else "")
    stopped = simulate(system, designs[:count], SHORT, 0 * kick, kick, watch)
    for design, a in zip(designs, stopped, strict=False):
        (b,) = simulate(system, [design], replace(SHORT, duration=4e-4), 0 * kick, kick)
        assert a.stop_reason == "known"
        assert a.time == pytest.approx(4e-4, rel=1e-12)
        assert same(a, b) or count > 1
        np.testing.assert_allclose(a.q, b.q, rtol=1e-6, atol=1e-12)
        assert a.energy.stored_end == pytest.approx(b.energy.stored_end, rel=1e-6)
        assert a.energy.residual == pytest.approx(b.energy.residual, rel=1e-3, abs=1e-12)


def test_designs_of_a_batch_stop_one_by_one(lively):
    system, designs, kick = lively
    whole = simulate(system, designs, SHORT, 0 * kick, kick)
    watch = Watch([100] * 5, lambda k, run: "known" if run.time > 1.9e-4 * (k + 1) else "")
    stopped = simulate(system, designs, SHORT, 0 * kick, kick, watch)
    for k, (a, b) in enumerate(zip(whole, stopped, strict=True)):
        assert b.time == pytest.approx(2e-4 * (k + 1), rel=1e-9)
        assert len(b.history["time"]) == 20 * (k + 1) + 1
        scale = np.abs(a.velocity).max()
        np.testing.assert_allclose(b.velocity, a.velocity[: len(b.velocity)], atol=1e-6 * scale)


def test_a_failed_design_does_not_stop_the_others(lively):
    """Without iterations to spare one design fails between the pauses of the others."""
    system, designs, kick = lively
    law = ContactLaw("exponential", p0=1e5, lam=1e9)
    bad = replace(designs[1], contact=law)
    seen: set[int] = set()

    def judge(k: int, run: TransientResult) -> str:
        seen.add(k)
        return "known" if k == 0 else ""

    runs = simulate(
        system, [designs[0], bad, designs[2]], SHORT, 0 * kick, kick, Watch([100] * 3, judge)
    )
    assert [r.stop_reason for r in runs] == ["known", "failed", "end"]
    assert runs[1].outcome != "ok"
    assert runs[1].message
    assert seen == {0, 2}
    assert runs[2].time == pytest.approx(SHORT.duration)


def test_watches_that_cannot_look(lively):
    system, designs, kick = lively
    with pytest.raises(ParameterError, match="saved rows"):
        simulate(system, designs[:1], replace(SHORT, save_every=0), kick, kick, Watch([5], never))
    for steps in ([0], [5, 5]):
        with pytest.raises(ParameterError, match="positive number of steps"):
            simulate(system, designs[:1], SHORT, kick, kick, Watch(steps, never))
