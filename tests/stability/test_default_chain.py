"""The default chain: what recovers what, and that each link is needed."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from squealstudy.kinds.transient.preparation import _closing
from squealstudy.laboratory.method_stability.contact_models import rough_state
from squealstudy.laboratory.method_stability.contract import (
    CONVERGED,
    FAILED,
    RECOVERED,
    WRONG,
    checked,
)
from squealstudy.laboratory.method_stability.default_chain import (
    DEFAULT_CHAIN,
    chain_settings,
    distance,
    run,
)
from squealstudy.laws import contact_law
from squealstudy.motion.integrators.exact_free_motion import ExactFreeMotion
from squealstudy.motion.system import CLOSING_LIMIT, closing_number

GRIDS = [
    {"step": np.geomspace(1e-7, 1e-4, 8), "kt": np.geomspace(1e6, 1e13, 8)},
    {"step": np.geomspace(1e-7, 1e-4, 8), "lambda": np.geomspace(5e4, 5e7, 8)},
]


@pytest.fixture(scope="module")
def cells():
    return [
        DEFAULT_CHAIN.evaluate(dict(zip(grid, values, strict=True)))
        for grid in GRIDS
        for values in itertools.product(*grid.values())
    ]


def test_nothing_fails_where_check_does_not_warn(cells):
    inside = [x for x in cells if x.predicted < 1]
    assert len(inside) > 40
    assert {x.outcome for x in inside} == {CONVERGED, RECOVERED}
    assert any(x.outcome == FAILED for x in cells)


def test_nothing_is_wrong_without_a_word(cells):
    wrong = [x for x in cells if x.outcome == WRONG]
    assert len(wrong) > 10
    assert all(x.flagged for x in wrong)


def test_cells_tell_the_distance_to_solved_steps(cells):
    inside = [x for x in cells if x.predicted < 1]
    assert 1e-6 < max(x.error for x in inside) < 5e-3


def helped(values, **switched_off):
    """The same run with and without a link of the chain."""
    knobs = checked(DEFAULT_CHAIN.knobs, values)
    state, step = rough_state(knobs), knobs["step"]
    without = chain_settings(step, ExactFreeMotion(**switched_off))
    return state, run(state, chain_settings(step)), run(state, without)


AITKEN = {"step": 3e-6, "kt": 3e10}
MOCK_UP = {"step": 1e-6, "kt": 3e12}


def test_aitken_recovers():
    cell = DEFAULT_CHAIN.evaluate(AITKEN)
    assert (cell.outcome, cell.by) == (RECOVERED, "aitken")
    state, chain, plain = helped(AITKEN, tangential_damping="never", aitken=False)
    alone = run(state, chain_settings(3e-6, ExactFreeMotion(tangential_damping="never")))
    assert alone.halvings == alone.newton_steps == 0
    assert plain.halvings > 0
    assert distance(state, alone, chain) < 1e-3


def test_the_mock_up_recovers():
    state, _, plain = helped(MOCK_UP, tangential_damping="never", aitken=False)
    alone = run(state, chain_settings(1e-6, ExactFreeMotion(aitken=False)))
    assert alone.outcome == "ok"
    assert alone.halvings == alone.newton_steps == 0
    assert alone.mean_iterations < 0.2 * plain.mean_iterations
    assert plain.halvings > 0


def test_halving_recovers():
    hard = {"step": 1e-5, "lambda": 1e6}
    _, chain, without = helped(hard, max_halvings=0)
    assert chain.outcome == "ok"
    assert chain.halvings > 0
    assert chain.newton_steps == 0
    assert without.newton_steps > 0


def test_newton_recovers_what_halving_does_not():
    knobs = checked(DEFAULT_CHAIN.knobs, {"step": 1e-5, "lambda": 1e6})
    state = rough_state(knobs)
    few = chain_settings(1e-5, ExactFreeMotion(max_halvings=0))
    assert run(state, few).outcome == "ok"
    cell = DEFAULT_CHAIN.evaluate({"step": 1e-4, "lambda": 5e7})
    assert (cell.outcome, cell.by) == (FAILED, "not_converged")


def test_closing_number():
    assert closing_number(contact_law("exponential", lam=5e5), 0.5, 1e-6) == pytest.approx(0.25)
    assert closing_number(contact_law("bilateral"), 0.5, 1e-6) == 0.0


def test_check_warns_of_contact_too_stiff_for_the_step():
    plan = SimpleNamespace(study=SimpleNamespace(section=SimpleNamespace(step=1e-5)))
    assert _closing(plan, [0.5, CLOSING_LIMIT]) == []
    (text,) = _closing(plan, [0.5, 2 * CLOSING_LIMIT])
    assert "contact is too stiff for the step" in text
    assert "A step of 5e-06 s" in text
