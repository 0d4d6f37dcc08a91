"""Shares of a vibration's energy in complex modes, and transfers within one of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import growing, made_up

from squealstudy.motion.growing_modes import coordinates, mode_planes
from squealstudy.motion.outcome.energies import (
    complex_shares,
    held_energies,
    level_shares,
    mode_energies,
    transfer,
)
from squealstudy.motion.outcome.growth_rows import growth_rows, mode_fits

TIME = np.arange(0.0, 0.1, 2e-5)
OMEGA = 2 * np.pi * np.array([1000.0, 1010.0, 1700.0])
LOCKED = np.array([1.0, 1.0j, 0.0])  # the two first modes, a quarter of a period apart
MIXED = np.array([0.0, 1.0, 0.8])


def motion(lam, x, amplitude=1.0, time=TIME):
    """Displacements and velocities (rows, 3) along a complex mode."""
    z = amplitude * np.exp(lam * time)[:, None] * x
    return 2 * z.real, 2 * (lam * z).real


def states_of(q, v, lam, right):
    rows, overlap = mode_planes(OMEGA**2, lam, right)
    seen = [coordinates(q @ r.T, v @ r.T) for r in rows]
    return np.hstack(seen), overlap


def shares(q, v, lam, right, extra=0.0):
    energy = mode_energies(q - q.mean(axis=0), v - v.mean(axis=0), OMEGA).sum(axis=1).mean()
    return complex_shares(*states_of(q, v, lam, right), float(energy) + extra)


LAM = np.array([30 + 6300j, 20 + 6800j])
RIGHT = np.column_stack([LOCKED, MIXED])


def test_motion_along_one_mode_is_all_its_own_energy():
    for k in range(2):
        q, v = motion(1j * LAM[k].imag, RIGHT[:, k])
        alone = shares(q, v, LAM[k : k + 1].imag * 1j, RIGHT[:, k : k + 1])
        assert alone == pytest.approx([1.0], rel=1e-9)
        both = shares(q, v, 1j * LAM.imag, RIGHT)
        assert both[k] == pytest.approx(1.0, rel=1e-9)
        assert both[1 - k] == pytest.approx(0.0, abs=1e-9)


def test_a_static_shift_is_no_vibration():
    q, v = motion(1j * LAM[0].imag, LOCKED)
    assert shares(
        q + np.array([0.3, 2.0, -1.0]), v, 1j * LAM[:1].imag, RIGHT[:, :1]
    ) == pytest.approx([1.0])
    assert np.isnan(shares(0 * q, 0 * v, LAM, RIGHT)).all()


def test_one_mode_given_twice_does_not_count_twice():
    """Projections on the same plane add up to 200 % of the energy."""
    q, v = motion(1j * LAM[0].imag, LOCKED)
    twice = shares(q, v, 1j * LAM[[0, 0]].imag, RIGHT[:, [0, 0]])
    assert twice == pytest.approx([1.0, 0.0], abs=1e-9)


def test_the_mode_that_turns_the_other_way_is_another():
    q, v = motion(1j * LAM[0].imag, LOCKED.conj())
    against = shares(q, v, 1j * LAM[:1].imag, RIGHT[:, :1])
    assert against[0] < 1e-3


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), m=st.integers(1, 5))
def test_shares_are_within_the_whole_whatever_the_modes(seed, m):
    rng = np.random.default_rng(seed)
    right = rng.normal(size=(3, m)) + 1j * rng.normal(size=(3, m)) * rng.choice([0.0, 1e-9, 1.0])
    lam = rng.normal(size=m) * 100 + 1j * rng.uniform(3e3, 2e4, m)
    q, v = rng.normal(size=(200, 3)) / OMEGA, rng.normal(size=(200, 3))
    found = shares(q, v, lam, right)
    assert (found >= 0).all()
    assert found.sum() <= 1 + 1e-9
    assert found.sum() > 0
    again = shares(7.0 * q, 7.0 * v, lam, right)
    np.testing.assert_allclose(again, found, rtol=1e-7, atol=1e-9)


# -- a whole run


def recorded(q, v, n_unstable=2, lam=LAM, right=RIGHT):
    """A run of three modes that follows two complex ones."""
    energy = mode_energies(q, v, OMEGA).sum(axis=1)
    names = ("normal_force", "stick", "slip", "open")
    history = {"time": TIME, "torque": v @ [1.0, 1.0, 1.0], "modal_energy": energy}
    history |= dict.fromkeys(names, 0 * TIME)
    rows, overlap = mode_planes(OMEGA**2, lam, right)
    sensors = np.concatenate([np.zeros_like(rows), rows]).reshape(-1, 3)
    known = {"sensors": sensors, "energy": np.ones(len(lam)), "overlap": overlap}
    modes = growing(lam, right, n_unstable, **known)
    return made_up(history, q, v, OMEGA, modes, (q @ sensors.T, v @ sensors.T))


LAST = slice(3000, None)


def rows_of(run, kind):
    return growth_rows(run, mode_fits(run), kind, LAST)


def test_a_run_knows_its_shares_from_its_sensors():
    one, other = motion(6300j, LOCKED), motion(6800j, MIXED, 0.3)
    q, v = (a + b for a, b in zip(one, other, strict=True))
    run = recorded(q + np.array([0.1, 0.0, 0.0]), v)
    found = level_shares(run, LAST)
    np.testing.assert_allclose(found, shares(q[LAST], v[LAST], LAM, RIGHT), rtol=1e-2)
    assert found[0] > 0.8
    assert 0.02 < found[1] < 0.2


@pytest.mark.parametrize(
    ("kind", "expressed"),
    [("limit_cycle", [True, False]), ("irregular", [True, False]), ("stable", [False, False])]
    + [(kind, [None, None]) for kind in ("growing", "undecided", "failed")],
)
def test_an_instability_is_expressed_in_a_vibration_that_lasts(kind, expressed):
    """Whatever energy there was counted: runs that grow or die away had their modes 'live'."""
    rows = rows_of(recorded(*motion(6300j, LOCKED)), kind)
    assert [row["expressed"] for row in rows] == expressed
    known = kind in ("limit_cycle", "irregular")
    assert [np.isfinite(row["level_share"]) for row in rows] == [known, known]
    assert [row["unstable"] for row in rows] == [True, True]


def test_a_stable_mode_has_a_share_and_is_no_instability():
    rows = rows_of(recorded(*motion(6300j, LOCKED), n_unstable=0), "limit_cycle")
    assert [row["expressed"] for row in rows] == [None, None]
    assert not any(row["unstable"] for row in rows)
    assert rows[0]["level_share"] == pytest.approx(1.0, rel=1e-3)


def test_what_nothing_disturbed_does_not_tell():
    still = np.zeros((len(TIME), 3))
    rows = rows_of(recorded(still, still), "stable")
    assert [row["expressed"] for row in rows] == [None, None]


# -- transfers


def lead(first, last, when=0.05):
    """Velocities of two real modes, one before and the other after."""
    late = when < TIME
    level = np.where(TIME < 0.02, 1e-3 * np.exp((TIME - 0.02) / 0.004), 1.0)
    parts = [np.where(late, b, a) for a, b in zip(first, last, strict=True)]
    phases = [0.0, np.pi / 2, 0.0]
    waves = [p * level * np.cos(6300 * TIME + f) for p, f in zip(parts, phases, strict=True)]
    v = np.stack(waves, axis=1)
    return v / 6300, v


def transfers(q, v, right):
    run = recorded(q, v, right=right, lam=LAM[: right.shape[1]])
    return transfer(TIME, run.sensed_v**2, run.sensed, held_energies(run))


def test_parts_of_one_complex_mode_do_not_take_over_from_each_other():
    q, v = lead((1.0, 0.8, 0.01), (0.8, 1.0, 0.01))
    assert transfer(TIME, v**2, np.arange(3) + 1)[:2] == (1, 2)  # by real modes alone
    first, last, when = transfers(q, v, RIGHT[:, :1])
    assert (first, last) == (0, 0)
    assert np.isnan(when)


def test_a_mode_outside_the_first_complex_mode_takes_over():
    q, v = lead((1.0, 0.8, 0.01), (0.1, 0.1, 1.0))
    for right in (RIGHT[:, :1], np.column_stack([LOCKED, [0.0, 0.0, 1.0]])):
        first, last, when = transfers(q, v, right)
        assert (first, last) == (1, 3)
        assert when == pytest.approx(0.05, abs=2.1e-3)


def test_a_complex_mode_that_sensors_hardly_see_holds_nothing():
    hidden = np.array([[0.02], [0.02j], [1.0]])
    run = recorded(*lead((1.0, 0.8, 0.0), (0.8, 1.0, 0.0)), right=hidden, lam=LAM[:1])
    seen = replace(
        run,
        sensed=run.sensed[:2],
        omega=OMEGA[:2],
        displacement=np.delete(run.displacement, 2, axis=1),
        velocity=np.delete(run.velocity, 2, axis=1),
    )
    assert not held_energies(seen).any()
