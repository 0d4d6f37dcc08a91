"""Distributions of random designs: quantiles, samples of a study, one clear message for misuse."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.stats import qmc

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import ResolvedStudy, parse_study
from squealstudy.study.distributions import Distribution
from squealstudy.study.sampling import count_points, design_points
from squealstudy.tables.sobol import base_rows, grouped, is_saltelli, saltelli_rows

U = np.linspace(0.001, 0.999, 41)
HEAD = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "disc_brake"\n'


def study(*sweeps: str, kind: str = "sobol", samples: int = 64) -> ResolvedStudy:
    names = ("friction", "pressure", "contact.lambda", "sliding_speed")
    tables = [f'[[sweep]]\nparameter = "{n}"\n{s}\n' for n, s in zip(names, sweeps, strict=False)]
    design = f'[design]\ntype = "{kind}"\nsamples = {samples}\nseed = 1\n'
    return parse_study(f"{HEAD}{''.join(tables)}{design}", Path("s.toml"))


# -- quantiles -----------------------------------------------------------------------------------
CASES = {
    "uniform": (Distribution("uniform", start=2.0, stop=5.0), lambda x: (x - 2.0) / 3.0),
    "log": (
        Distribution("uniform", start=1e5, stop=1e7, scale="log"),
        lambda x: np.log(x / 1e5) / np.log(100.0),
    ),
    "normal": (Distribution("normal", 0.4, 0.05), lambda x: stats.norm.cdf((x - 0.4) / 0.05)),
    "truncated": (
        Distribution("truncated_normal", 0.4, 0.1, 0.3, 0.7),
        lambda x: (
            (stats.norm.cdf((x - 0.4) / 0.1) - stats.norm.cdf(-1.0))
            / (stats.norm.cdf(3.0) - stats.norm.cdf(-1.0))
        ),
    ),
    "lognormal": (
        Distribution("lognormal", 5e5, 0.3, scale="log"),
        lambda x: stats.norm.cdf(np.log(x / 5e5) / 0.3),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_quantiles_invert_the_distribution_function(name):
    distribution, cdf = CASES[name]
    values = distribution.quantiles(U)
    np.testing.assert_allclose(cdf(values), U, rtol=1e-9)
    assert (np.diff(values) > 0).all()
    low, high = distribution.range
    assert low < distribution.quantiles(np.array([0.5]))[0] < high
    if distribution.bounded:
        assert (low, high) == (distribution.start, distribution.stop)
    else:
        np.testing.assert_allclose(cdf(np.array([low, high])), [1e-4, 1 - 1e-4], rtol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_ends_of_the_unit_interval_stay_finite_and_in_range(name):
    distribution, _ = CASES[name]
    ends = distribution.quantiles(np.array([0.0, 1.0 - 2.0**-53]))
    assert np.isfinite(ends).all()
    assert distribution.start <= ends[0] < ends[1] <= distribution.stop


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.floats(-6, 6), st.floats(1e-3, 8))
def test_truncated_values_never_leave_their_ends(mean, std, left, width):
    start, stop = mean + left * std, mean + (left + width) * std
    values = Distribution("truncated_normal", mean, std, start, stop).quantiles(np.append(0.0, U))
    assert (values >= start).all()
    assert (values <= stop).all()
    assert (np.diff(values) >= 0).all()


# -- samples of a study ----------------------------------------------------------------------------
SWEEPS = (
    'distribution = "normal"\nmean = 0.4\nstd = 0.05',
    'distribution = "lognormal"\nmedian = 12e5\nsigma = 0.3',
    'distribution = "truncated_normal"\nmean = 5e5\nstd = 1e5\nstart = 4e5\nstop = 8e5',
    'start = 0.1\nstop = 3\nscale = "log"',
)


@pytest.mark.parametrize("std", [1e6, 1e9, 1e15, 1e17, 1e300])
@pytest.mark.parametrize("mean", [0.0, 0.45, 1e3])
def test_a_truncated_normal_much_wider_than_its_ends_is_uniform(mean, std):
    distribution = Distribution("truncated_normal", mean, std, 0.3, 0.6)
    np.testing.assert_allclose(distribution.quantiles(U), 0.3 + 0.3 * U, rtol=1e-6)


def test_a_sobol_study_transforms_the_sequence_of_its_seed():
    points = design_points(study(*SWEEPS))
    unit = qmc.Sobol(4, scramble=True, seed=np.random.default_rng(1)).random_base2(6)
    expected = [
        stats.norm(0.4, 0.05).ppf(unit[:, 0]),
        stats.lognorm(0.3, scale=12e5).ppf(unit[:, 1]),
        stats.truncnorm(-1, 3, 5e5, 1e5).ppf(unit[:, 2]),
        0.1 * 30.0 ** unit[:, 3],
    ]
    np.testing.assert_allclose(points.T, expected, rtol=1e-12)


def test_latin_hypercube_has_the_moments_of_its_distributions():
    points = design_points(study(*SWEEPS, kind="latin_hypercube", samples=2000))
    friction, log_pressure = points[:, 0], np.log(points[:, 1])
    assert friction.mean() == pytest.approx(0.4, abs=1e-4)
    assert friction.std() == pytest.approx(0.05, rel=5e-3)
    assert log_pressure.mean() == pytest.approx(math.log(12e5), abs=1e-3)
    assert log_pressure.std() == pytest.approx(0.3, rel=5e-3)


def test_sweeps_of_lognormal_parameters_are_logarithmic():
    sweeps = study(*SWEEPS).sweeps
    assert [s.scale for s in sweeps] == ["linear", "log", "linear", "log"]
    assert (sweeps[2].low, sweeps[2].high) == (4e5, 8e5)
    assert sweeps[0].low == pytest.approx(0.4 - 3.719 * 0.05, abs=1e-4)
    assert all(s.values == () for s in sweeps)


# -- the sample of Sobol indices -------------------------------------------------------------------
def test_the_sample_of_sobol_indices_is_that_of_saltelli():
    random = study(*SWEEPS, kind="sobol_indices", samples=16)
    points = design_points(random)
    assert count_points(random) == len(points) == 16 * 6
    x = points
    assert is_saltelli(x)
    assert not is_saltelli(x[6:][::-1])
    rows = x.reshape(16, 6, 4)
    for i in range(4):
        others = np.arange(4) != i
        np.testing.assert_array_equal(rows[:, 2 + i, i], rows[:, 1, i])
        np.testing.assert_array_equal(rows[:, 2 + i][:, others], rows[:, 0][:, others])
    assert len(np.unique(x, axis=0)) == len(x)
    more = design_points(study(*SWEEPS, kind="sobol_indices", samples=32))
    assert (more[: len(points)] == points).all()
    assert base_rows(12, 4).tolist() == [True, True, False, False, False, False] * 2


def test_groups_with_a_hole_are_left_out():
    A, B = np.arange(6.0).reshape(3, 2), 10 + np.arange(6.0).reshape(3, 2)
    values = saltelli_rows(A, B) @ [1.0, 100.0]
    values[5] = np.nan  # second point of the second group
    groups, dropped = grouped(values, 2)
    assert dropped == 1
    np.testing.assert_array_equal(groups.a, (A @ [1.0, 100.0])[[0, 2]])
    np.testing.assert_array_equal(groups.b, (B @ [1.0, 100.0])[[0, 2]])
    np.testing.assert_array_equal(groups.ab[1], (A[:, 0] + 100 * B[:, 1])[[0, 2]])


# -- misuse ----------------------------------------------------------------------------------------
NORMAL = 'distribution = "normal"\nmean = 0.4\nstd = 0.05'
BAD = {  # text of the friction sweep, design, key at fault, part of the message
    "unknown": ('distribution = "gauss" #!', "sobol", "sweep[1].distribution", "'normal'"),
    "no mean": ('distribution = "normal" #!\nstd = 0.1', "sobol", "sweep[1].mean", "missing"),
    "no sigma": ('distribution = "lognormal"\nmedian = 1', "sobol", "sweep[1].sigma", "missing"),
    "no numbers": ('distribution = "lognormal"', "sobol", "sweep[1]", "give median and sigma"),
    "ends of a normal": (
        f"{NORMAL}\nstart = 0 #!\nstop = 1",
        "sobol",
        "sweep[1].start",
        "a normal distribution has mean and std, not 'start'; truncated_normal has ends",
    ),
    "mean of a uniform": (
        "start = 0\nstop = 1\nmean = 0.4 #!",
        "sobol",
        "sweep[1].mean",
        "a uniform distribution has start and stop, not 'mean'",
    ),
    "scale of a normal": (
        f'{NORMAL}\nscale = "linear" #!',
        "sobol",
        "sweep[1].scale",
        "not 'scale'",
    ),
    "std zero": (NORMAL.replace("0.05", "0 #!"), "sobol", "sweep[1].std", "more than 0"),
    "median negative": (
        'distribution = "lognormal"\nmedian = -1 #!\nsigma = 1',
        "sobol",
        "sweep[1].median",
        "more than 0",
    ),
    "normal in a grid": (
        NORMAL.replace('"normal"', '"normal" #!'),
        "grid",
        "sweep[1].distribution",
        "only sobol, latin_hypercube, sobol_indices designs have 'distribution'",
    ),
    "tail below the bound": (
        'distribution = "normal" #!\nmean = 0.1\nstd = 0.05',
        "latin_hypercube",
        "sweep[1].distribution",
        "expected at least 0, got -0.0859508; distribution = 'truncated_normal'",
    ),
    "truncated beyond the bound": (
        'distribution = "truncated_normal"\nmean = 0.1\nstd = 0.05\nstart = -0.1 #!\nstop = 1',
        "sobol",
        "sweep[1].start",
        "expected at least 0",
    ),
    "truncated to nothing": (
        'distribution = "truncated_normal"\nmean = 0.1\nstd = 0.05\nstart = 0.2\nstop = 0.2 #!',
        "sobol",
        "sweep[1].stop",
        "the same as start",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_misuse_is_named_by_line_and_key(case):
    sweep, kind, key, message = BAD[case]
    design = f'[design]\ntype = "{kind}"\n' + ("samples = 8\n" if kind != "grid" else "")
    text = f'{HEAD}[[sweep]]\nparameter = "friction"\n{sweep}\n{design}'
    with pytest.raises(StudyFileError) as caught:
        parse_study(text, Path("s.toml"))
    error = caught.value
    assert error.key == key
    assert message in error.message
    marked = [i for i, line in enumerate(text.splitlines(), start=1) if line.endswith("#!")]
    if marked and "missing" not in message:
        assert error.line == marked[0]


def test_a_rare_sample_beyond_the_bound_is_refused_before_the_run():
    random = study('distribution = "normal"\nmean = 0.4\nstd = 0.1', samples=2**16)
    with pytest.raises(StudyFileError, match="truncated_normal") as caught:
        design_points(random)
    assert caught.value.key == "sweep[1].distribution"
    fewer = study('distribution = "normal"\nmean = 0.4\nstd = 0.1', samples=2**10)
    assert design_points(fewer).min() > 0


@pytest.mark.parametrize(
    ("samples", "sweeps", "key", "message"),
    [
        (12, SWEEPS[:2], "design.samples", "from 8 on, such as 8 or 16, got 12"),
        (4, SWEEPS[:2], "design.samples", "from 8 on, such as 8 or 16, got 4"),
        (16, SWEEPS[:1], "design.type", "at least two [[sweep]] tables"),
    ],
)
def test_what_sobol_indices_need(samples, sweeps, key, message):
    with pytest.raises(StudyFileError) as caught:
        study(*sweeps, kind="sobol_indices", samples=samples)
    assert (caught.value.key, message in caught.value.message) == (key, True)
