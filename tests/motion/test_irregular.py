"""Levels of irregular motion: bounds that cover the mean, and methods that agree within them."""

import re
from pathlib import Path

import numpy as np
import pytest
from motions import bursts
from study_runs import load_plan, plan_of

import squealstudy
from squealstudy.engine.runner import run_study
from squealstudy.kinds.work_precision.variants import make_variants
from squealstudy.motion.outcome.intervals import mean_interval, pooled_interval
from squealstudy.study.definition import load_any

STUDIES = Path(__file__).parents[2] / "studies"
NEIGHBOURS = """
[[sweep]]
parameter = "damping_ratio"
start = 0.005
stop = 0.00500005
num = 24
"""
OTHER_BRAKE = """
[[method]]
name = "more damping"
set.parameters.damping_ratio = 0.05
"""


@pytest.mark.parametrize("memory", [5, 50, 500])  # of 2000 rows: the last is too slow for windows
def test_pooled_bounds_cover_the_mean(memory):
    starts = 4
    found = np.array(mean_interval(bursts(memory, 2000, 300 * starts))).reshape(3, 300, starts)
    pooled = np.array([pooled_interval(*one) for one in found.swapaxes(0, 1)])
    covered = np.mean((pooled[:, 1] <= 1) & (pooled[:, 2] >= 1))
    assert 0.9 <= covered < 1
    hull = found[2].max(axis=1) - found[1].min(axis=1)
    assert (pooled[:, 2] - pooled[:, 1]).mean() < 0.75 * hull.mean()


def test_runs_that_are_one_run_keep_its_bounds():
    same = np.full(4, 10.0)
    assert pooled_interval(same, same - 2, same + 2) == (10.0, 8.0, 12.0)


def test_more_starts_narrow_the_bounds():
    rng = np.random.default_rng(2)
    widths = []
    for starts in (4, 16):
        values = 10 + rng.normal(size=(200, starts))
        pooled = np.array([pooled_interval(v, v - 2, v + 2) for v in values])
        widths.append((pooled[:, 2] - pooled[:, 1]).mean())
    assert widths[1] < 0.5 * widths[0]


def test_starts_that_end_in_cycles_of_their_own_are_within_the_bounds():
    values = np.array([10.0, 20.0, 10.0, 20.0])
    mean, low, high = pooled_interval(values, values - 0.1, values + 0.1)
    assert mean == 15.0
    assert low <= 10.0
    assert high >= 20.0
    alone = pooled_interval(values[:1], values[:1] - 0.1, values[:1] + 0.1)
    assert alone == (10.0, 9.9, 10.1)


@pytest.mark.full_size
def test_bounds_of_an_irregular_cycle_cover_the_mean_of_many(tmp_path):
    """Runs of a chaotic brake, which damping that differs by 1e-6 soon tells apart.

    By default bursts above, whose mean is known, and methods on the same brake below.
    Which run comes out where is up to round-off: shares of runs are judged, not single ones.
    """
    text = (STUDIES / "irregular_cycle.toml").read_text()
    text = re.sub(r"duration = \S+", "duration = 0.08", text).replace("= 1e-4", "= 1e-2")
    text = text.replace("8000.0", "4000.0")  # its motion is below
    run_study(plan_of(text + NEIGHBOURS, STUDIES / "irregular_cycle.toml"), tmp_path, 1)
    points = squealstudy.open_results(tmp_path).points
    for name, spread in (("torque_rms", 0.02), ("torque_mean", 0.01)):
        value, low, high = (points[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high"))
        mean = value.mean()
        assert value.std() > spread * mean  # apart they are
        told = np.isfinite(low)
        assert told.mean() > 0.5
        covers = (low <= mean) & (high >= mean)
        assert covers[told].mean() >= 2 / 3  # of 95 %; .9 of 48 runs did
        parts = [slice(first, first + 4) for first in range(0, 24, 4)]
        pooled = np.array([pooled_interval(value[p], low[p], high[p]) for p in parts])
        # where another step changes a chaotic run by more than half, its bounds are not told
        pooled = pooled[np.isfinite(pooled[:, 1:]).all(axis=1)]
        assert len(pooled) >= 3  # of 6
        assert ((pooled[:, 1] <= mean) & (pooled[:, 2] >= mean)).mean() >= 2 / 3
        assert (pooled[:, 2] - pooled[:, 1]).mean() < 0.5 * mean  # and they say something


@pytest.mark.full_size
def test_methods_agree_within_the_bounds_and_another_brake_does_not(tmp_path):
    text = (STUDIES / "irregular.toml").read_text()
    text = re.sub(r'base = "', f'base = "{STUDIES}/', text)
    text = text.replace(
        "[work_precision.set]",
        "[work_precision.set]\ntransient.duration = 0.06\ntransient.sensors = [500.0, 4000.0]",
    ).replace("starts = 4", "starts = 8")
    text = text.replace("step = 5e-7", "step = 2e-6").replace("[5e-7, 1e-6]", "[2e-6]")
    text = re.sub(r"values = \[1e-6, 2e-6.*\]", "values = [1e-6]", text)
    text = text.partition('[[method]]\nname = "LSODA')[0] + OTHER_BRAKE
    path = tmp_path / "irregular.toml"
    path.write_text(text)
    ran = {v.label: v.plan.study.section for v in make_variants(load_any(path))}
    assert ran["Newmark, step 1e-06"].integrator.name == "newmark"
    assert ran["exponential, step 1e-06"].integrator.name == "exponential"
    run_study(load_plan(path), tmp_path / "out", 1)
    table = squealstudy.open_results(tmp_path / "out").measurements.set_index("method")
    for name in ("torque_rms", "torque_mean"):
        error, chance = table[f"error_{name}"], table[f"chance_{name}"]
        assert chance.between(0.01, 0.25).all()
        for method in ("Newmark", "exponential", "central difference"):
            assert error[method] <= 2 * chance[method], method  # of 95 %: twice is 1 in 1000
            assert table.loc[method, f"within_{name}"] == (error[method] <= chance[method])
        assert error["more damping"] > 2 * chance["more damping"]
        assert not table.loc["more damping", f"within_{name}"]
