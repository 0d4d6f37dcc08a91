"""Design points: counts, order, ranges and reproducibility."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import ResolvedStudy, parse_study
from squealstudy.study.sampling import count_points, design_points, grid_shape
from squealstudy.study.sweeps import levels

HEAD = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "disc_brake"\n'
NAMES = ("friction", "pressure", "caliper.modes[12-14].frequency_scale", "sliding_speed")
LEVELS = st.lists(st.floats(0.01, 5), min_size=1, max_size=6, unique=True)


def study(design: str, *sweeps: str) -> ResolvedStudy:
    tables = [f'[[sweep]]\nparameter = "{n}"\n{s}\n' for n, s in zip(NAMES, sweeps, strict=False)]
    return parse_study(f"{HEAD}{''.join(tables)}[design]\n{design}\n", Path("s.toml"))


def random_study(kind: str, n: int, seed: int, *sweeps: str) -> ResolvedStudy:
    return study(f'type = "{kind}"\nsamples = {n}\nseed = {seed}', *sweeps)


# -- grid and zip --------------------------------------------------------------------------------
def test_no_sweep_is_one_point():
    for kind in ("grid", "zip"):
        alone = study(f'type = "{kind}"')
        assert (count_points(alone), design_points(alone).shape) == (1, (1, 0))
    assert grid_shape(study('type = "grid"')) == ()


@settings(max_examples=50, deadline=None)
@given(st.lists(LEVELS, min_size=1, max_size=4))
def test_grid_has_every_combination_once_first_sweep_fastest(values):
    grid = study('type = "grid"', *(f"values = {v}" for v in values))
    points = design_points(grid)
    shape = tuple(map(len, values))
    assert (grid_shape(grid), count_points(grid), len(points)) == (
        shape,
        math.prod(shape),
        math.prod(shape),
    )
    assert [s.name for s in grid.sweeps] == list(NAMES[: len(values)])
    for k, point in enumerate(points):
        index = np.unravel_index(k, shape, order="F")
        assert point.tolist() == [v[i] for v, i in zip(values, index, strict=True)]


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 8), st.integers(1, 4), st.randoms(use_true_random=False))
def test_zip_takes_values_side_by_side(length, n_sweeps, random):
    values = [random.sample([i / 10 for i in range(1, 40)], length) for _ in range(n_sweeps)]
    zipped = study('type = "zip"', *(f"values = {v}" for v in values))
    assert count_points(zipped) == length
    assert grid_shape(zipped) is None
    assert [tuple(p) for p in design_points(zipped).tolist()] == list(zip(*values, strict=True))


def test_names_are_kept_as_written():
    written = study('type = "grid"', *["values = [1]"] * 3)
    names = ["friction", "pressure", "caliper.modes[12-14].frequency_scale"]
    assert [s.name for s in written.sweeps] == names
    assert design_points(written).tolist() == [[1.0, 1.0, 1.0]]


# -- levels --------------------------------------------------------------------------------------
@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 40), st.booleans())
def test_linear_levels_are_those_of_linspace(start, width, num, downwards):
    stop = start - width if downwards else start + width
    found = levels(start, stop, num, "linear")
    assert (len(found), found[0], found[-1]) == (num, start, stop)
    expected = np.linspace(start, stop, num)
    np.testing.assert_allclose(found, expected, rtol=1e-15, atol=1e-8 * width / num + 1e-9)


@given(st.floats(1e-8, 1e8), st.floats(1.001, 1e6), st.integers(2, 40))
def test_log_levels_have_a_constant_ratio(start, factor, num):
    found = levels(start, start * factor, num, "log")
    assert (found[0], found[-1]) == (start, start * factor)
    np.testing.assert_allclose(np.diff(np.log(found)), np.log(factor) / (num - 1), atol=1e-11)


def test_levels_of_two_ranges_agree_where_they_meet():
    wide, narrow = levels(0.0, 0.7, 29, "linear"), levels(0.0, 0.5, 21, "linear")
    assert wide[3] == narrow[3] == 0.075
    assert set(narrow) <= set(wide)
    assert levels(1e5, 1e7, 3, "log") == (1e5, 1e6, 1e7)
    assert levels(-0.3, 0.3, 7, "linear")[3] == 0.0


def test_one_value_of_a_range_is_its_start():
    one = study('type = "grid"', "start = 0.2\nstop = 0.7\nnum = 1")
    assert design_points(one).tolist() == [[0.2]]


# -- random designs ------------------------------------------------------------------------------
RANGES = ("start = 0.1\nstop = 0.7", 'start = 4e6\nstop = 1e5\nscale = "log"')


@pytest.mark.parametrize("kind", ["sobol", "latin_hypercube"])
@pytest.mark.parametrize("n", [1, 8, 100])
def test_random_designs_stay_in_range_and_repeat_by_seed(kind, n):
    points = design_points(random_study(kind, n, 3, *RANGES))
    assert len(points) == count_points(random_study(kind, n, 3, *RANGES)) == n
    assert ((points >= [0.1, 1e5]) & (points <= [0.7, 4e6])).all()
    assert (points == design_points(random_study(kind, n, 3, *RANGES))).all()
    assert (points != design_points(random_study(kind, n, 4, *RANGES))).all()
    assert grid_shape(random_study(kind, n, 3, *RANGES)) is None


def test_sobol_points_are_scipys_and_log_ranges_are_even_in_the_logarithm():
    found = design_points(random_study("sobol", 64, 5, *RANGES))
    unit = qmc.Sobol(2, scramble=True, seed=np.random.default_rng(5)).random_base2(6)
    friction, decades = found[:, 0], np.log10(found[:, 1])
    np.testing.assert_allclose(friction, 0.1 + 0.6 * unit[:, 0], rtol=1e-14)
    np.testing.assert_allclose(decades, 5 + np.log10(40) * unit[:, 1], rtol=1e-14)
    counts, _ = np.histogram(decades, bins=8, range=(5, 5 + np.log10(40)))
    assert (counts == 8).all()


def test_more_sobol_samples_keep_the_first_ones():
    few = design_points(random_study("sobol", 20, 1, *RANGES))
    assert (design_points(random_study("sobol", 30, 1, *RANGES))[:20] == few).all()


def test_latin_hypercube_has_one_point_in_every_slice():
    points = design_points(random_study("latin_hypercube", 30, 0, *RANGES))
    slices = np.floor((points[:, 0] - 0.1) / 0.6 * 30)
    assert sorted(slices) == list(range(30))


# -- limit ---------------------------------------------------------------------------------------
BIG = ("start = 0\nstop = 1\nnum = 1000", "start = 1\nstop = 2\nnum = 1000")


def check_limit(study, yes=False):
    plan = SimpleNamespace(study=study, swept=range(count_points(study)))
    study.kind.check_limit(plan, yes)


def test_count_of_a_vast_grid_is_not_built():
    with pytest.raises(StudyFileError, match="would have 100,000,000,000,000,000,000 points"):
        study("limit = 10", *["start = 1\nstop = 2\nnum = 100000"] * 4)


def test_more_points_than_the_limit_need_yes():
    big = study('type = "grid"\nlimit = 999_999', *BIG)
    with pytest.raises(StudyFileError, match="--yes") as caught:
        check_limit(big)
    error = caught.value
    assert (error.key, error.path) == ("design.limit", Path("s.toml"))
    assert big.source.text.splitlines()[error.line - 1] == "limit = 999_999"
    assert "1,000,000 design points, more than the limit of 999,999" in error.message
    check_limit(big, yes=True)


def test_as_many_points_as_the_limit_are_accepted():
    check_limit(study('type = "grid"\nlimit = 1_000_000', *BIG))


def test_default_limit_names_the_design_table():
    big = study('type = "grid"', *BIG)
    with pytest.raises(StudyFileError, match="20,000") as caught:
        check_limit(big)
    assert caught.value.key == "design.limit"
    assert big.source.text.splitlines()[caught.value.line - 1] == "[design]"
