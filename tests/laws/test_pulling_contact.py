"""Contact that pulls has no friction: one law for steady sliding, complex modes and runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cycle_models import Designs, linear_modes

from squealstudy.modes.point import linearised_point
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate

FORCE, HZ = 100.0, (100.0, 75.0)  # Hulten's model as it is by default


@pytest.mark.parametrize("speed", [0.5, -0.5])
@pytest.mark.parametrize("friction", [1.1, 1.6])
def test_of_two_contacts_one_pulls(friction, speed):
    """By hand: p1 - mu p2 = F and p2 + mu p1 = F; beyond mu = 1 p2 pulls, and has no friction."""
    designs = Designs("hulten", {"friction": friction, "sliding_speed": speed}, "bilateral")
    design = designs.at()
    first = int(speed < 0)  # the contact whose friction the other one carries
    normal = np.full(2, FORCE)
    normal[1 - first] = FORCE * (1.0 - friction)
    np.testing.assert_allclose(design.point.force[:, 0], normal, rtol=1e-9)
    drag = np.zeros(2)
    drag[first] = -np.sign(speed) * friction * FORCE
    np.testing.assert_allclose(design.point.force[:, 1], drag, rtol=1e-9, atol=1e-9)
    # one coupling alone makes a triangular matrix: no lock-in, frequencies of the springs
    _, linear = linearised_point(designs.prepared, designs.nominal.state())
    squares = np.sort(np.linalg.eigvals(linear.K).real)
    np.testing.assert_allclose(np.sqrt(squares) / (2 * np.pi), sorted(HZ), rtol=1e-9)
    lam, _ = linear_modes(design.oscillator)
    assert lam.real.max() < 1e-6 * abs(lam).max()
    # a run begins in balance and stays there
    still = replace(design.point, q0=np.zeros(2), v0=np.zeros(2))
    (run,) = simulate(
        designs.reference.system, [still], MotionSettings(duration=0.05, step=1e-4, save_every=10)
    )
    assert np.ptp(run.history["torque"]) < 1e-9 * FORCE
