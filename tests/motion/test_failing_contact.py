"""What is told of the contact where a run fails."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from squealstudy.kernels.newmark_layout import POINT_GAP
from squealstudy.motion.simulate import failing_contact


def test_springs_of_the_model_are_no_contact_points_that_give_way():
    """A pad with one contact and a cubic spring was told to give way at 2 of 2 contact points."""
    rows = np.zeros((POINT_GAP + 1, 2))
    softening = SimpleNamespace(evaluate=lambda gap: (0 * gap, np.where(np.abs(gap) > 1, -1, 1)))
    point = SimpleNamespace(points=lambda _: rows, contact=softening)
    motion = SimpleNamespace(q=np.array([2.0]), point=point)
    system = SimpleNamespace(N=np.ones((2, 1)), touching=slice(1))
    told = "a softening contact spring has given way at 1 of 1 contact point"
    assert failing_contact(system, motion) == told
