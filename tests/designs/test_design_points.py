"""Design points as arrays: what is made of them when asked for, and what they are named by."""

from __future__ import annotations

import pickle
import tracemalloc

import numpy as np
import pytest
from joblib import wrap_non_picklable_objects
from study_runs import plan_of
from study_texts import study_text

from squealstudy.engine.keys import content_hash, point_id, point_ids
from squealstudy.engine.plan import Plan

HULTEN = (
    study_text("points", "complex_modes", "hulten")
    + """\
[design]
type = "{design}"
{more}
"""
)
GRID = HULTEN.format(design="grid", more="") + "".join(
    f'[[sweep]]\nparameter = "{name}"\nvalues = {values}\n'
    for name, values in (
        ("friction", [0.0, 0.25, 0.5]),
        ("frequency_1", [100.0, 90.0, 110.0]),
        ("damping_ratio", [0.0, 0.01]),
    )
)
SOBOL = (
    HULTEN.format(design="sobol", more="samples = {n}\nlimit = 10000000")
    + '[[sweep]]\nparameter = "friction"\nstart = 0.0\nstop = 0.6\n'
    + '[[sweep]]\nparameter = "damping_ratio"\nstart = 0.0\nstop = 0.02\n'
)


@pytest.mark.usefixtures("one_by_one")
def test_points_are_named_by_their_values_one_by_one_or_all_at_once():
    plan, lone = plan_of(GRID), plan_of(GRID)
    tasks = list(plan.tasks)
    assert [lone.tasks[i].point_id for i in range(18)] == [t.point_id for t in tasks]
    assert plan.tasks.ids.astype(str).tolist() == [t.point_id for t in tasks]
    for i, task in enumerate(tasks):
        assert task == plan.tasks[i]
        key = plan.structure_key(plan.tasks.without_names(i))
        assert task.structure == key
        assert task.point_id == point_id(plan._model_hash(key), task.own_values)
        swept = [task.values[sweep.name] for sweep in plan.study.sweeps]
        assert swept == plan.swept[i].tolist()


def test_texts_of_ids_hold_any_name_and_any_value():
    varied = {"b%s": np.array([0.1, -0.0, 1e300]), "a": np.array([1.0, 2.0, 3.0])}
    values = {"c": 7, 'quoted "%d"': 0.25, "a": 0.0, "b%s": 0.0}
    found = point_ids("hash", values, varied, 3).astype(str).tolist()
    own = [{**values, **{k: float(x[i]) for k, x in varied.items()}} for i in range(3)]
    assert found == [point_id("hash", v) for v in own]
    assert point_ids("hash", values, {}, 2).astype(str).tolist() == [point_id("hash", values)] * 2


@pytest.mark.usefixtures("one_by_one")
def test_structures_stand_in_order_of_first_appearance():
    points = plan_of(GRID).tasks
    assert points.structure_index.tolist() == [i // 3 % 3 for i in range(18)]
    assert [points[3 * k].structure for k in range(3)] == list(points.structures)
    rows = dict(points.of_structures())
    assert list(rows) == list(points.structures)
    assert rows[points.structures[1]].tolist() == [3, 4, 5, 12, 13, 14]
    assert points.column("frequency_1")[rows[points.structures[1]]].tolist() == [90.0] * 6


def test_some_of_the_points_keep_their_names_in_another_process():
    points = plan_of(GRID).tasks
    part = points.at(np.array([17, 3, 4]))
    call = wrap_non_picklable_objects(lambda: part)  # a model has functions without names
    there = pickle.loads(pickle.dumps(call))()
    assert [t.point_id for t in there] == [t.point_id for t in part]
    assert list(part) == [points[17], points[3], points[4]]
    assert part[1:][0] == points[3] == points[3:5][0]
    assert part[-1] == points[4]
    assert there[-1].values == points[4].values
    with pytest.raises(IndexError):
        there[3]
    assert there.column("mass").tolist() == [1.0] * 3


def test_a_point_drawn_again_is_another_one():
    whole = plan_of(SOBOL.format(n=4))
    again = Plan(whole.study, whole.swept[[0, 1, 0, 2, 1, 0]])
    ids = whole.tasks.ids.astype(str).tolist()
    twice = [content_hash([ids[0], 2]), content_hash([ids[1], 2]), content_hash([ids[0], 3])]
    expected = [ids[0], ids[1], twice[0], ids[2], twice[1], twice[2]]
    assert [task.point_id for task in again.tasks] == expected
    lone = Plan(whole.study, again.swept)
    assert [lone.tasks[i].point_id for i in (5, 2, 0)] == [twice[2], twice[0], ids[0]]


def test_many_points_are_counted_without_holding_any():
    """A million points with ids were 1.3 GB."""
    tracemalloc.start()
    plan = plan_of(SOBOL.format(n=2**17))
    assert len(plan.tasks) == 2**17
    assert plan.tasks[2**17 - 1].values["friction"] == plan.swept[-1, 0]
    assert len(plan.structures) == 1
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert held < 60 * 2**17
