"""Motions for tests: design points with starts, and runs that are made up."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from squealstudy.motion.growing_modes import GrowingModes
from squealstudy.motion.motion import EnergyBalance, Motion
from squealstudy.motion.simulate import simulate


def started(designs, q0, v0):
    """The design points with initial states (n,) or (nb, n)."""
    starts = (np.broadcast_to(x, (len(designs), np.shape(x)[-1])) for x in (q0, v0))
    return [replace(d, q0=q, v0=v) for d, q, v in zip(designs, *starts, strict=True)]


def run_one(system, design, settings, q0, v0):
    """Motion of one design point from a state, numbers or (n,)."""
    q0, v0 = (np.atleast_1d(np.asarray(x, dtype=float)) for x in (q0, v0))
    return simulate(system, [replace(design, q0=q0, v0=v0)], settings)[0]


def growing(lam, right, n_unstable, **known) -> GrowingModes:
    """Growing modes of which some things are known."""
    return GrowingModes(lam=lam, right=right, left=right, n_unstable=n_unstable, **known)


def made_up(history, q, v, omega, modes, watched) -> Motion:
    """A run of sensed modes q, v (rows, ns), and what watches growing ones (2, rows, 8 m)."""
    return Motion(
        point=SimpleNamespace(
            speed=1.0, growing=modes, static_torque=300.0, continued=False, schedule=None
        ),
        sensed=np.arange(len(omega)) + 1,
        omega=omega,
        outcome="ok",
        message="",
        time=float(history["time"][-1]),
        q=q[-1],
        v=v[-1],
        history=history,
        displacement=np.hstack([q, watched[0]]),
        velocity=np.hstack([v, watched[1]]),
        q_history=q[:0],
        mean_iterations=1.0,
        max_iterations=1,
        halvings=0,
        newton_steps=0,
        contraction=0.0,
        energy=EnergyBalance(*6 * [0.0]),
        steps=1,
    )


def changed(motion, **changes) -> Motion:
    """The run with other attributes of its design point."""
    return replace(motion, point=SimpleNamespace(**{**vars(motion.point), **changes}))


def bursts(memory, rows, runs):
    """Squares (rows, runs), of mean 1, of unit noise that is correlated over `memory` rows."""
    rng, keep = np.random.default_rng(1), np.exp(-1 / memory) if memory else 0.0
    x, kicks = rng.normal(size=runs), np.sqrt(1 - keep**2) * rng.normal(size=(rows, runs))
    values = np.empty_like(kicks)
    for row, kick in enumerate(kicks):
        x = keep * x + kick
        values[row] = x**2
    return values
