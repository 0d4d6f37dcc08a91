"""A mistake in one stage of one design point is that point's row or an open question, no more.

An IndexError deep in a stage stands for what nobody foresaw. Each study must come to its end, and
points that the mistake did not meet must have the numbers of a study without it.
"""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from study_runs import plan_of
from study_texts import study_text, sweep_text

from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study

BAND = "[modes]\nband = [20.0, 1000.0]\n"
FALLS = "damping_ratio = 0.01\n"
STUDIES = {
    "complex_modes": study_text("a", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.6, 4)
    + "[modes]\nreference_points = 2\n",
    "transient": study_text("b", "transient", "hoffmann")
    + 'contact_law = "unilateral"\n[parameters]\n'
    + FALLS
    + sweep_text("friction", 0.5, 0.9, 3)
    + BAND
    + "[transient]\nduration = 0.02\nstep = 5e-5\n",
    "limit_cycles": study_text("c", "limit_cycles", "hoffmann")
    + 'contact_law = "cubic"\n[parameters]\n"contact.cubic_stiffness" = 2e20\nsliding_speed = 0.3\n'
    + FALLS
    + sweep_text("friction", 0.8, 0.9, 2)
    + BAND
    + '[limit_cycles]\nfamilies = [1]\nharmonics = 3\nfollow = "friction"\n',
    "sensitivity": study_text("d", "sensitivity", "hoffmann")
    + "[parameters]\n"
    + FALLS
    + sweep_text("friction", 0.5, 0.9, 3)
    + BAND
    + '[sensitivity]\nparameters = ["friction"]\n',
}
KINDS = "squealstudy.kinds"
OF_POINTS = [  # stages without which a point has no row that is ok
    ("complex_modes", f"{KINDS}.complex_modes.problems", "solve_point"),
    ("transient", f"{KINDS}.transient.starts", "_started"),
    ("transient", f"{KINDS}.transient.worker", "integrate"),
    ("transient", f"{KINDS}.transient.worker", "_row"),
    ("transient", f"{KINDS}.transient.worker", "_states"),
    ("limit_cycles", f"{KINDS}.limit_cycles.kind", "cycles_row"),
    ("sensitivity", f"{KINDS}.sensitivity.points", "design_sensitivities"),
]
AFTER_POINTS = [  # stages of tables and checks: tracking, onsets, full order, errors, branches
    ("complex_modes", f"{KINDS}.complex_modes.neighbourhood", "problem_of"),
    ("complex_modes", f"{KINDS}.complex_modes.neighbourhood", "refine_onset"),
    ("complex_modes", f"{KINDS}.complex_modes.outside_band", "_wider_modes"),
    ("complex_modes", f"{KINDS}.complex_modes.full_order_check", "solve_unreduced"),
    ("limit_cycles", f"{KINDS}.limit_cycles.continued", "_branch"),
]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Results of each study, made when they are asked for."""
    made: dict[str, Results] = {}

    def of(kind: str) -> Results:
        if kind not in made:
            directory = tmp_path_factory.mktemp(kind) / "out"
            run_study(plan_of(STUDIES[kind]), directory, 1)
            made[kind] = Results.open(directory)
        return made[kind]

    return of


def with_mistake(monkeypatch, module: str, name: str, calls: set[int] | None) -> list[int]:
    """Let a function fail at some of its calls, at all where None; which were made."""
    whole, made = getattr(import_module(module), name), list[int]()

    def failing(*arguments, **options):
        made.append(len(made))
        if calls is None or made[-1] in calls:
            return ()[3]  # IndexError
        return whole(*arguments, **options)

    monkeypatch.setattr(import_module(module), name, failing)
    return made


@pytest.mark.usefixtures("one_by_one")
@pytest.mark.parametrize(("kind", "module", "name"), OF_POINTS)
def test_a_mistake_in_a_point_is_that_points_row(
    kind, module, name, undisturbed, tmp_path, monkeypatch
):
    true = undisturbed(kind).points
    # a call in the batch (of `_started` two come before it), and that of the point by itself
    calls = {"_row": {1, 4}, "_started": {2, 3}}.get(name, {0, 1})
    made = with_mistake(monkeypatch, module, name, calls)
    run_study(plan_of(STUDIES[kind]), tmp_path / "out", 1)
    found = Results.open(tmp_path / "out")
    assert made
    failed = found.points["status"].to_numpy() != "ok"
    assert failed.any()
    assert not failed.all()
    assert "IndexError" in found.points["message"].to_numpy()[failed][0]
    for column in found.parameters:
        np.testing.assert_array_equal(found.points[column], true[column])
    numbers = [c for c in true if true[c].dtype == float and c not in ("wall_s", "peak_mb")]
    columns = [c for c in numbers if c.startswith(("max_growth", "torque", "n_"))]
    for column in columns:
        np.testing.assert_allclose(
            found.points[column][~failed], true[column][~failed], rtol=1e-9, err_msg=column
        )
    found.screen.findings(found)
    found.screen.facts(found)


@pytest.mark.usefixtures("one_by_one")
@pytest.mark.parametrize(("kind", "module", "name"), AFTER_POINTS)
def test_a_mistake_after_the_points_ends_no_study(
    kind, module, name, undisturbed, tmp_path, monkeypatch
):
    true = undisturbed(kind).points
    made = with_mistake(monkeypatch, module, name, None)
    run_study(plan_of(STUDIES[kind]), tmp_path / "out", 1)
    found = Results.open(tmp_path / "out")
    assert made
    assert (found.points["status"] == "ok").all()
    column = "max_growth_rate" if "max_growth_rate" in true else "n_unstable"
    np.testing.assert_allclose(found.points[column], true[column], rtol=1e-9)
    found.screen.findings(found)
    found.screen.facts(found)
    if kind == "complex_modes":
        found.rank()
