"""Labels across a veering: direct up to its width, refined beyond, ambiguous if neither tells."""

from __future__ import annotations

import numpy as np
import pytest

from squealstudy.laboratory.method_stability import tracking
from squealstudy.laboratory.method_stability.contract import CONVERGED, RECOVERED, WRONG, checked
from squealstudy.laboratory.method_stability.tracking import TRACKING, exchanged, veering
from squealstudy.modes.tracking.pairing import pair_modes
from squealstudy.modes.tracking.refinement import StepRefinement


def test_the_modes_veer():
    knobs = checked(TRACKING.knobs, {"width": 0.01})
    at = [veering(np.array([x]), knobs) for x in (-0.005, 0.0, 0.005)]
    gaps = [np.diff(np.abs(m.lam) ** 2)[0] for m in at]
    assert gaps[1] == pytest.approx(tracking.SLOPE * 0.01 * tracking.OMEGA**2, rel=1e-6)
    assert gaps[0] == pytest.approx(np.sqrt(2) * gaps[1], rel=1e-6)
    turned = np.abs(at[0].shapes[0].conj() @ at[2].shapes[0]) ** 2
    assert turned == pytest.approx(0.5, abs=1e-6)  # a quarter turn of the shapes over the width


@pytest.mark.parametrize("middle", [0.0, 0.1])
def test_labels_hold_up_to_the_width(middle):
    for ratio in (0.1, 0.5, 0.95):
        cell = TRACKING.evaluate({"step": 0.02, "width": 0.02 / ratio, "middle": middle})
        assert cell.outcome == CONVERGED


@pytest.mark.parametrize("ratio", [2.0, 3.0, 4.0])
def test_refinement_recovers(ratio):
    values = {"step": 0.02, "width": 0.02 / ratio}
    cell = TRACKING.evaluate(values)
    assert (cell.outcome, cell.by) == (RECOVERED, "refinement")
    assert cell.cost > 0
    knobs = checked(TRACKING.knobs, values)
    a, b = (veering(np.array([x]), knobs) for x in (-0.01, 0.01))
    assert exchanged(pair_modes(a.lam, a.shapes, b.lam, b.shapes), a, b) == 1.0
    off = StepRefinement(lambda x: veering(x, knobs), depth=0)
    assert exchanged(off.pair(a, b, np.array([-0.01]), np.array([0.01])), a, b) == 1.0


def test_no_label_is_wrong_without_a_word():
    rng = np.random.default_rng(0)
    cells = [
        TRACKING.evaluate(
            {
                "step": 10 ** rng.uniform(-3, 0),
                "width": 10 ** rng.uniform(-4, 0),
                "middle": rng.uniform(0.4, 0.5) * rng.choice([-1, 1]),
                "damping_ratio": rng.uniform(0, 0.1),
            }
        )
        for _ in range(500)
    ]
    wrong = [x for x in cells if x.outcome == WRONG]
    assert len(wrong) > 10  # steps that end inside a veering far narrower than the smallest of them
    assert all(x.flagged for x in wrong)
    assert not any(x.flagged for x in cells if x.predicted < 0.5)
