"""Folds of contact that opens are within their errors of a shooting by the judge of runs.

Beside a fold, cycles are shot at given places of their turning point: along these the parameter has
an extremum.
"""

from __future__ import annotations

import numpy as np
import pytest
from event_reference import design, run
from study_runs import solved

from squealstudy.cycles.trials import state_of
from squealstudy.kinds.limit_cycles.continued import Branch

VALUES = {
    "sliding_speed": 1.0,
    "damping_ratio": 0.015,
    "contact.exponent": 1.5,
    "contact.stiffness": 2e14,
    "contact.regularisation_speed": 0.005,
}
STUDY = """
[study]
name = "fold"
kind = "limit_cycles"
[model]
name = "hoffmann"
contact_law = "power"
[parameters]
{values}
friction = 0.5
[[sweep]]
parameter = "friction"
values = [0.5, 0.8, 1.1]
[modes]
band = [10.0, 1000.0]
[limit_cycles]
reach = 2.0
follow = "friction"
undecided_in_time = false
neighbours = false
"""
PLACES = np.array([0.99, 0.995, 1.0, 1.005, 1.01])  # of the turning point, over that of the fold
STEP = 1e-6  # of differences, relative


def flow(friction, start, period, samples=60):
    """States (n, 4) of the judge over a period."""
    d = design("hoffmann", "power", **VALUES, friction=float(friction))
    return run(d, period, start=start, sample=period / samples, tolerance=1e-12).rows[:, :4]


def shot(place, unknowns, scale):
    """The cycle that turns at a place: its normal displacement and speed, period, friction."""
    size = np.array([place, scale[0], scale[1] / scale[0] * place, scale[1]])

    def gap(u):
        normal, speed, period, friction = u * scale
        start = np.array([place, normal, 0.0, speed])
        return (flow(friction, start, period)[-1] - start) / size

    for _ in range(12):
        F = gap(unknowns)
        if np.abs(F).max() < 1e-10:
            break
        steps = STEP * np.eye(4)
        J = np.array([(gap(unknowns + s) - gap(unknowns - s)) / (2.0 * STEP) for s in steps]).T
        unknowns = unknowns - np.linalg.solve(J, F)
    assert np.abs(F).max() < 1e-8
    return unknowns


def judged_fold(line, motion):
    """Friction at the fold near a motion of a branch."""
    normal, tangential, _ = line.contact(motion.parameter).oscillator.B[0]
    q, v = state_of(motion)
    start = np.array([tangential @ q, normal @ q, tangential @ v, normal @ v])
    period = 2.0 * np.pi / motion.omega
    rows = flow(motion.parameter, start, period, 800)
    turning = rows[int(np.argmax(rows[:-1, 0]))]
    scale = np.array([*np.abs(rows[:, [1, 3]]).max(axis=0), period, motion.parameter])
    begin = np.array([turning[1], turning[3], period, motion.parameter]) / scale
    middle = shot(turning[0], begin, scale)
    friction = [shot(p * turning[0], middle, scale)[-1] * motion.parameter for p in PLACES]
    fit = np.polynomial.Polynomial.fit(PLACES - 1.0, np.array(friction) - friction[2], 4)
    roots = fit.deriv().roots()
    real = roots[np.abs(roots.imag) < 1e-9].real
    return friction[2] + float(fit(real[np.argmin(np.abs(real))]))


@pytest.mark.full_size
def test_folds_of_contact_that_opens_are_within_their_errors(tmp_path, monkeypatch):
    """.52615486 +- 6.3e-8 was told of .52615478."""
    branches, rows_of = [], Branch.rows
    monkeypatch.setattr(
        Branch, "rows", lambda b, line, along: branches.append((b, line)) or rows_of(b, line, along)
    )
    values = "\n".join(f'"{name}" = {value!r}' for name, value in VALUES.items())
    solved(STUDY.format(values=values), tmp_path)
    folds = [(p, line) for b, line in branches for p in b.points if p.event == "F"]
    assert len(folds) == 2
    for point, line in folds:
        exact = judged_fold(line, point.motion)
        assert abs(point.motion.parameter - exact) < point.apart < 1e-4
