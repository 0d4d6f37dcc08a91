"""Windows beside an exceptional point: kept, handed on, or said."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from squealstudy.laboratory.method_stability import windows_rung
from squealstudy.laboratory.method_stability.contract import CONVERGED, RECOVERED, WRONG
from squealstudy.laboratory.method_stability.windows_rung import WINDOWS_RUNG


@pytest.fixture(scope="module")
def cells():
    distances, tolerances = np.geomspace(1e-14, 0.1, 6), np.geomspace(1e-13, 1e-5, 4)
    return [
        WINDOWS_RUNG.evaluate({"distance": d, "tolerance": t, "damping_ratio": zeta})
        for zeta, t, d in itertools.product((0.0, 0.01), tolerances, distances)
    ]


def test_within_the_boundary_every_tolerance_is_kept(cells):
    inside = [x for x in cells if x.predicted < 1]
    assert all(x.outcome in (CONVERGED, RECOVERED) for x in inside)
    assert {x.outcome for x in inside} == {CONVERGED, RECOVERED}


def test_far_beyond_it_round_off_is_the_error(cells):
    beyond = [x for x in cells if x.predicted > 10]
    assert len(beyond) > 5
    assert all(x.outcome == WRONG for x in beyond)


def test_nothing_is_wrong_without_a_word(cells):
    assert all(x.flagged for x in cells if x.outcome == WRONG)


def test_the_windows_alone_serve_what_studies_ask_for():
    for away in (1e-14, 1e-6, 0.3):
        cell = WINDOWS_RUNG.evaluate({"distance": away, "tolerance": 1e-4})
        assert (cell.outcome, cell.by, cell.flagged) == (CONVERGED, "", False)


def test_error_grows_with_the_root_of_the_distance():
    near, far = (
        WINDOWS_RUNG.evaluate({"distance": d, "tolerance": 1e-13}).error for d in (1e-13, 1e-9)
    )
    assert near == pytest.approx(100 * far, rel=0.9)
    assert near > 20 * far


def test_a_rung_that_keeps_its_errors_to_itself_is_caught(monkeypatch):
    """The case sees it where estimates are too small: wrong, and nothing said so."""
    honest = windows_rung.Windows.solve

    def silent(self, box, theta):
        for row, point in honest(self, box, theta):
            yield row, point._replace(lam=point.lam * (1 + 1e-6))

    monkeypatch.setattr(windows_rung.Windows, "solve", silent)
    cell = WINDOWS_RUNG.evaluate({"distance": 1e-3, "tolerance": 1e-8})
    assert cell.outcome == WRONG
    assert not cell.flagged
