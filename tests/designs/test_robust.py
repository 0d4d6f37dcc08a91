"""Sobol indices and probabilities of instability, from tables to the screen."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from explored import NO_ONSETS
from made_results import made
from scipy import stats
from scipy.stats import qmc
from study_runs import command, plan_of, solved

import squealstudy
from squealstudy import screen as screens
from squealstudy.engine.pictures import save_figure
from squealstudy.engine.runner import run_study
from squealstudy.errors import ConvergenceError, ResultsError
from squealstudy.kinds.complex_modes import random_screen
from squealstudy.plots.robust_bars import robust_bars
from squealstudy.tables import sobol
from squealstudy.tables.mode_ranking import rank_modes
from squealstudy.tables.robustness import probability_interval, robust_table
from squealstudy.tables.sobol import saltelli_estimate, saltelli_rows, sobol_table

NAMES = ("x1", "x2", "x3")


# -- tables made of functions ----------------------------------------------------------------------
def tables(x: np.ndarray, growth: np.ndarray, failed: np.ndarray | None = None):
    """Points at x (m, 3); a stable mode and mode 1, whose growth is given; NaN: not there."""
    m = len(x)
    failed = np.zeros(m, dtype=bool) if failed is None else failed
    ids = [f"p{i}" for i in range(m)]
    points = pd.DataFrame({"point_id": ids, "status": np.where(failed, "failed", "ok")})
    points = points.assign(**dict(zip(NAMES, x.T, strict=True)))
    here = np.flatnonzero(~failed & np.isfinite(growth))
    base = {"overdamped": False, "track_ambiguous": False, "energy_disc": 1.0}
    one = pd.DataFrame({"point_id": np.array(ids)[here], "track": 1, "growth_rate": growth[here]})
    one = one.assign(frequency_hz=1000.0)
    solved = np.flatnonzero(~failed)
    two = pd.DataFrame({"point_id": np.array(ids)[solved], "track": 2, "growth_rate": -1e4})
    modes = pd.concat([one, two.assign(frequency_hz=2000.0)], ignore_index=True).assign(**base)
    modes["damping_ratio"] = -modes["growth_rate"] / (2 * np.pi * modes["frequency_hz"])
    modes["unstable"] = modes["growth_rate"] > 0
    return points, modes


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices() -> tuple[np.ndarray, np.ndarray]:
    """First and total indices in closed form (Ishigami and Homma 1990), a = 7, b = 0.1."""
    a, b, p = 7.0, 0.1, np.pi
    v1 = 0.5 * (1 + b * p**4 / 5) ** 2
    v2 = a**2 / 8
    v13 = b**2 * p**8 * (1 / 18 - 1 / 50)
    v = v1 + v2 + v13
    return np.array([v1, v2, 0.0]) / v, np.array([v1 + v13, v2, v13]) / v


def saltelli_sample(n: int, seed: int = 0) -> np.ndarray:
    both = qmc.Sobol(6, seed=np.random.default_rng(seed)).random(n)
    return np.pi * (2 * saltelli_rows(both[:, :3], both[:, 3:]) - 1)


def test_ishigami_indices_come_out_of_a_table():
    x = saltelli_sample(2**12)
    table = sobol_table(*tables(x, ishigami(x)), NAMES)
    first, total = ishigami_indices()
    largest = table[table["quantity"] == "largest"]
    assert largest["parameter"].tolist() == list(NAMES)
    np.testing.assert_allclose(largest["first"], first, atol=0.02)
    np.testing.assert_allclose(largest["total"], total, atol=0.02)
    for name, exact in (("first", first), ("total", total)):
        assert (largest[f"{name}_low"] <= exact).all()
        assert (exact <= largest[f"{name}_high"]).all()
        assert (largest[f"{name}_high"] - largest[f"{name}_low"] < 0.2).all()
    # the other mode never leads: mode 1 alone has the same indices
    track = table[table["quantity"] == "track"]
    assert track["track"].unique().tolist() == [1]
    np.testing.assert_array_equal(track["first"], largest["first"])


def test_indices_are_those_of_scipy_and_the_same_every_time():
    x = saltelli_sample(256)
    f = ishigami(x).reshape(256, 5)
    func = {"f_A": f[:, 0][None], "f_B": f[:, 1][None], "f_AB": f[:, 2:].T[:, None]}
    found = stats.sobol_indices(func=func, n=256)
    mine = saltelli_estimate(f[:, 0], f[:, 1], f[:, 2:].T)
    np.testing.assert_allclose(mine, [found.first_order, found.total_order], rtol=1e-12)
    table = sobol_table(*tables(x, f.ravel()), NAMES)
    np.testing.assert_allclose(table["first"][:3], found.first_order, rtol=1e-12)
    np.testing.assert_allclose(table["total"][:3], found.total_order, rtol=1e-12)
    pd.testing.assert_frame_equal(table, sobol_table(*tables(x, f.ravel()), NAMES))


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_resamples_by_means_are_those_of_the_gathered_values(offset):
    rng = np.random.default_rng(8)
    groups = sobol.Groups(*rng.normal(offset, size=(2, 40)), rng.normal(offset, size=(3, 40)))
    groups.a[:3] = groups.b[:3] = offset + 2.0
    groups.ab[:, :3] = offset + 2.0
    moments = sobol._moments(groups)
    for rows in (*rng.integers(40, size=(20, 40)), np.full(40, 1)):
        found = sobol._from_moments(np.bincount(rows, minlength=40) @ moments / 40)
        a, b, ab = groups.a[rows], groups.b[rows], groups.ab[:, rows]
        np.testing.assert_allclose(found, saltelli_estimate(a, b, ab), rtol=1e-9, atol=1e-11)


def test_intervals_do_not_depend_on_how_many_resamples_are_drawn_at_once(monkeypatch):
    rng = np.random.default_rng(5)
    groups = sobol.Groups(*rng.normal(size=(2, 101)), rng.normal(size=(3, 101)))
    at_once = sobol._indices(groups, 0.95)
    monkeypatch.setattr(sobol, "ROWS_PER_DRAW", 707)
    pd.testing.assert_frame_equal(sobol._indices(groups, 0.95), at_once, check_exact=True)


def test_intervals_narrow_as_the_sample_grows():
    width = []
    for n in (64, 1024):
        x = saltelli_sample(n)
        table = sobol_table(*tables(x, ishigami(x)), NAMES, top=0)
        width.append((table["total_high"] - table["total_low"]).to_numpy())
    assert (width[1] < 0.5 * width[0]).all()


def test_failed_points_take_their_groups_along():
    x = saltelli_sample(2**11)
    failed = np.zeros(len(x), dtype=bool)
    failed[7::97] = True
    groups = len(np.unique(np.flatnonzero(failed) // 5))
    table = sobol_table(*tables(x, ishigami(x), failed), NAMES, top=0)
    assert (table["dropped_groups"] == groups).all()
    assert (table["groups"] == 2**11 - groups).all()
    first, total = ishigami_indices()
    np.testing.assert_allclose(table["first"], first, atol=0.06)
    np.testing.assert_allclose(table["total"], total, atol=0.06)


def test_too_many_failed_points_are_an_error_not_an_index():
    x = saltelli_sample(64)
    failed = np.arange(len(x)) % 7 == 0
    with pytest.raises(ResultsError, match=r"\d+ of 64 groups have one that failed"):
        sobol_table(*tables(x, ishigami(x), failed), NAMES)
    points, modes = tables(x, np.where(x[:, 0] > 0, ishigami(x), np.nan))
    with pytest.raises(ResultsError, match=r"has no mode in the band \(0 points failed\)"):
        sobol_table(points, modes[modes["track"] == 1], NAMES)


def test_a_track_that_is_rarely_there_has_no_indices():
    x = saltelli_sample(64)
    growth = np.where(x[:, 0] > 0, ishigami(x), np.nan)
    table = sobol_table(*tables(x, growth), NAMES)
    track = table[table["track"] == 1]
    assert track["first"].isna().all()
    assert (track["groups"] + track["dropped_groups"] == 64).all()
    assert table[table["quantity"] == "largest"]["first"].notna().all()


def test_growth_that_does_not_vary_has_no_influence():
    x = saltelli_sample(64)
    table = sobol_table(*tables(x, np.full(len(x), 3.0)), NAMES)
    assert (table[["first", "total", "first_low", "total_high", "variance"]] == 0).all(axis=None)


def test_round_off_of_undamped_roots_is_no_growth_that_scatters():
    """Hulten's model below flutter: friction had an index of .5, growth a scatter of 1e-14."""
    x = saltelli_sample(64)
    points, modes = tables(x, 1e-14 * ishigami(x))
    modes = modes[modes["track"] == 1].assign(unstable=False, error_rung=1e-12)
    table = sobol_table(points, modes, NAMES)
    assert (table[["first", "total", "first_low", "total_high", "variance"]] == 0).all(axis=None)
    (row,) = robust_table(points, modes).to_dict("records")
    assert (row["growth_mean"], row["growth_std"], row["max_growth_rate"]) == (0.0, 0.0, 0.0)
    real = modes.assign(growth_rate=1e-3 * ishigami(x))
    assert sobol_table(points, real, NAMES)["total"].max() > 0.3


def test_other_designs_are_refused():
    x = saltelli_sample(64)
    with pytest.raises(ResultsError, match="sobol_indices"):
        sobol_table(*tables(x[::-1], ishigami(x)), NAMES)


# -- probabilities ---------------------------------------------------------------------------------
def test_interval_bounds_are_those_of_clopper_and_pearson():
    alpha, n = 0.05, 100
    low, high = probability_interval(0, n, 0.95)
    assert (low, high) == (0.0, pytest.approx(1 - (alpha / 2) ** (1 / n)))
    low, high = probability_interval(30, n, 0.95)
    assert stats.binom.sf(29, n, low) == pytest.approx(alpha / 2)
    assert stats.binom.cdf(30, n, high) == pytest.approx(alpha / 2)


def test_interval_covers_at_least_as_often_as_it_says():
    p, n = 0.13, 60
    bounds = np.array([probability_interval(k, n, 0.9) for k in range(n + 1)])
    covering = (bounds[:, 0] <= p) & (p <= bounds[:, 1])
    assert stats.binom.pmf(np.arange(n + 1), n, p)[covering].sum() >= 0.9


def test_rows_of_the_robust_table():
    x = np.arange(12.0).reshape(4, 3)
    failed = np.array([False, False, True, False])
    table = robust_table(*tables(x, np.array([2.0, -4.0, 9.0, 6.0]), failed))
    assert table["quantity"].tolist() == ["any", "track"]
    row = table.iloc[1]
    assert (row["points"], row["failed_points"], row["unstable_points"]) == (3, 1, 2)
    assert row["probability"] == pytest.approx(2 / 3)
    assert row["mean_growth_rate"] == pytest.approx(8 / 3)
    assert row["growth_mean"] == pytest.approx(4 / 3)
    assert row["growth_std"] == pytest.approx(np.std([2, -4, 6], ddof=1))
    assert (row["max_growth_rate"], row["at"]) == (6.0, "x1=9, x2=10, x3=11")
    ranked = rank_modes(*tables(x, np.array([2.0, -4.0, 9.0, 6.0]), failed), by="mean_growth")
    assert ranked["mean_growth_rate"].iloc[0] == pytest.approx(8 / 3)


def test_a_mode_that_is_not_there_is_not_unstable():
    x = np.arange(12.0).reshape(4, 3)
    table = robust_table(*tables(x, np.array([2.0, np.nan, np.nan, -1.0])))
    row = table.iloc[1]
    assert (row["points"], row["present_points"], row["probability"]) == (4, 2, 0.25)
    assert table.iloc[0]["present_points"] == 4  # the other mode is
    # both stand beside each other elsewhere: mode 1 is not the one that is there, it has left
    assert (row["absent_points"], row["unknown_points"]) == (2, 0)


def test_a_mode_that_may_stand_under_another_number_counts_neither_way():
    """Mode 1 is unstable wherever tracking knows it; where it is lost the mode is number 3."""
    x = np.linspace(0, 1, 24).reshape(8, 3)
    points, modes = tables(x, np.full(8, 5.0))
    lost = (modes["track"] == 1) & modes["point_id"].isin(["p5", "p6", "p7"])
    modes.loc[lost, "track"] = 3
    table = robust_table(points, modes).set_index("track")
    for track, known in ((1, 5), (3, 3)):
        row = table.loc[track]
        assert (row["unstable_points"], row["unknown_points"]) == (known, 8 - known)
        assert row["probability"] == 1.0
        assert row["probability_low"] == probability_interval(known, known, 0.95)[0]
    assert table.index.tolist() == [0, 1, 3]  # by what is known, not by a share of few points
    assert table.loc[0, "probability"] == 1.0
    modes.loc[lost, "track"] = -1  # without a number it may be any mode
    assert robust_table(points, modes).set_index("track").loc[1, "unknown_points"] == 3


def locked_modes(x: np.ndarray):
    """Two modes of one frequency, grown by x1: one by g, the other by -g; numbers change at x2."""
    points, modes = tables(x, 8.0 * x[:, 0] - 2.0)
    one = (modes["track"] == 1).to_numpy()
    modes.loc[~one, "growth_rate"] = -modes.loc[one, "growth_rate"].to_numpy()
    changed = np.tile(x[:, 1] > 0.5, 2)
    modes["track"] = np.where(one != changed, 1, 2)
    modes["track_ambiguous"] = np.tile(np.abs(x[:, 1] - 0.5) < 0.1, 2)
    return points, modes.assign(frequency_hz=1000.0, unstable=modes["growth_rate"] > 0)


def test_a_mode_that_changes_its_number_is_one_mode_of_a_random_design(capsys):
    """Growth hangs on x1 alone; number by number it would hang on x2, where the number changes."""
    both = qmc.Sobol(6, seed=np.random.default_rng(1)).random(256)
    points, modes = locked_modes(0.25 + 0.75 * saltelli_rows(both[:, :3], both[:, 3:]))
    table = robust_table(points, modes)
    assert table["tracks"].tolist() == ["", "1, 2"]
    assert table["probability"].tolist() == [1.0, 1.0]
    assert table["growth_mean"][1] == table["growth_mean"][0]
    indices = sobol_table(points, modes, NAMES).set_index(["quantity", "parameter"])
    assert indices.loc[("track", "x2"), "total"] == 0.0
    assert indices.loc[("track", "x1"), "total"] == pytest.approx(1.0, abs=0.1)
    assert rank_modes(points, modes, scattered=True)["family"].tolist() == [1, 1]
    screens.show(*random_screen.probabilities(table))
    assert "T1 and T2 are one unstable mode, which changes its number" in capsys.readouterr().out
    facts = {"design": {"type": "sobol_indices"}, "parameters": [*NAMES], "sweeps": [*NAMES]}
    onsets = pd.DataFrame({name: pd.Series(dtype=d) for name, d in NO_ONSETS.items()})
    drawn = made(points=points, modes=modes, onsets=onsets, facts=facts).plot.stability_diagram()
    assert "1 unstable mode of 2 numbers" in drawn.axes[0].get_title(loc="left")


def test_the_screen_says_of_which_points_growth_is_and_what_failed_points_leave_open(capsys):
    x = np.arange(12.0).reshape(4, 3)
    failed = np.array([False, False, True, False])
    screens.show(
        *random_screen.probabilities(robust_table(*tables(x, np.array([2.0, -4, 9, 6]), failed)))
    )
    shown = " ".join(capsys.readouterr().out.split())
    assert "1.3 +- 5.0" in shown  # of 2, -4 and 6: of stable points, too
    assert "where the mode is in the band, stable or not" in shown
    assert "1 are not ok and count neither way: with them any is 50.0 to 75.0 %" in shown


def test_growth_without_oscillation_is_an_instability():
    x = np.linspace(0, 1, 12).reshape(4, 3)
    points, modes = tables(x, np.full(4, -3.0))
    real = modes.iloc[:2].assign(overdamped=True, track=-1, growth_rate=[40.0, -50.0])
    real = real.assign(point_id=["p1", "p2"], unstable=[True, False], damping_ratio=[-1.0, 1.0])
    table = robust_table(points, pd.concat([modes, real], ignore_index=True))
    assert table["quantity"].tolist() == ["any", "divergence"]
    assert table["probability"].tolist() == [0.25, 0.25]
    assert table["max_growth_rate"].tolist() == [40.0, 40.0]
    assert table["at"].tolist() == 2 * ["x1=0.272727, x2=0.363636, x3=0.454545"]
    assert table["unknown_points"].tolist() == [0, 0]


def test_only_failed_points_have_no_probability():
    x = np.arange(12.0).reshape(4, 3)
    with pytest.raises(ResultsError, match="every design point failed"):
        robust_table(*tables(x, np.ones(4), np.ones(4, dtype=bool)))


def two_unstable_modes():
    """Mode 1: rarely, strongly unstable; mode 2: always, weakly."""
    points, modes = tables(np.arange(30.0).reshape(10, 3), np.append(40.0, np.full(9, -1.0)))
    second = modes["track"] == 2
    modes.loc[second, "growth_rate"] = 5.0
    return points, modes.assign(unstable=modes["growth_rate"] > 0)


def test_ranking_by_probability_worst_case_and_mean():
    points, modes = two_unstable_modes()
    by = {name: rank_modes(points, modes, by=name)["track"].tolist() for name in RANKINGS}
    assert by == {"probability": [2, 1], "worst": [1, 2], "mean_growth": [2, 1]}


RANKINGS = ("probability", "worst", "mean_growth")


# -- a study: flutter in closed form ---------------------------------------------------------------
MEAN, STD, CRITICAL = 0.31, 0.03, (100.0**2 - 75.0**2) / (2 * 100.0 * 75.0)
STUDY = f"""
[study]
name = "scatter"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
distribution = "normal"
mean = {MEAN}
std = {STD}
[[sweep]]
parameter = "sliding_speed"
distribution = "lognormal"
median = 1.0
sigma = 0.5
[design]
type = "TYPE"
samples = SAMPLES
[modes]
band = [1.0, 1000.0]
reference_points = 0
refine_tracking = false
refine_onsets = false
"""


def run(
    directory: Path, kind: str, samples: int, study: str = STUDY
) -> squealstudy.engine.results.Results:
    text = study.replace("TYPE", kind).replace("SAMPLES", str(samples))
    return solved(text, directory)


@pytest.fixture(scope="module")
def sampled(tmp_path_factory):
    return run(tmp_path_factory.mktemp("robust") / "r", "sobol_indices", 64)


def test_probability_of_flutter_is_that_of_friction_above_its_threshold(sampled):
    exact = stats.norm.sf((CRITICAL - MEAN) / STD)
    table = sampled.robust()
    row = table.iloc[0]
    assert (row["quantity"], row["points"]) == ("any", 2 * 64)  # the independent part of the sample
    assert row["probability"] == pytest.approx(exact, abs=0.02)
    assert row["probability_low"] < exact < row["probability_high"]
    # one mode of the two is unstable at a time, whichever track it is on
    assert table["probability"].iloc[1:].sum() == pytest.approx(row["probability"])


@pytest.mark.parametrize(
    "kind", [pytest.param("sobol_indices", marks=pytest.mark.full_size), "latin_hypercube"]
)
def test_a_point_that_is_drawn_again_counts_again(kind, tmp_path):
    """Scatter far below the spacing of floating point: all points are equal."""
    narrow = STUDY.replace(f"std = {STD}", "std = 1e-20").replace("sigma = 0.5", "sigma = 1e-20")
    results = run(tmp_path / "r", kind, 8, narrow)
    points = results.points
    assert len(points) == (8 * 4 if kind == "sobol_indices" else 8)
    assert len(points[["friction", "sliding_speed"]].drop_duplicates()) == 1
    assert points["point_id"].is_unique
    points_to_indices = (
        '"sobol_indices" tells which parameter' in results.screen.findings(results)[0]
    )
    assert points_to_indices == (kind != "sobol_indices")
    row = results.robust().iloc[0]
    drawn = 16 if kind == "sobol_indices" else 8
    assert (row["points"], row["unstable_points"]) == (drawn, drawn)  # MEAN > CRITICAL
    assert results.rank()["points"].tolist() == [len(points)]
    again = run_study(plan_of(results.manifest["study"]), tmp_path / "r", 1)
    assert again.n_solved == 0
    assert command("plot", str(tmp_path / "r")) == 0


def test_growth_scatters_with_friction_alone(sampled):
    table = sampled.sobol_indices().set_index(["quantity", "parameter"])
    assert table.loc[("largest", "sliding_speed"), "total"] == 0.0
    friction = table.loc[("largest", "friction")]
    assert friction["first_low"] < 1.0 < friction["first_high"]
    assert friction["total_low"] < 1.0 < friction["total_high"]


def test_mean_growth_is_the_integral_over_the_distribution(sampled):
    mu = stats.norm.ppf((np.arange(20_000) + 0.5) / 20_000, MEAN, STD)
    w1, w2 = 2 * np.pi * 100.0, 2 * np.pi * 75.0
    root = np.sqrt(((w1**2 - w2**2) / 2) ** 2 - (mu * w1 * w2) ** 2 + 0j)
    growth = np.sqrt(-(w1**2 + w2**2) / 2 + root).real
    found = sampled.robust().iloc[0]
    assert found["mean_growth_rate"] == pytest.approx(growth.mean(), rel=0.03)
    assert found["growth_std"] == pytest.approx(growth.std(), rel=0.05)


def test_the_most_widespread_mode_is_told_with_all_its_numbers(sampled):
    assert len(sampled.rank()) == 2  # of one mode
    share = (sampled.points["n_unstable"] > 0).mean()
    verdict = sampled.screen.verdict(sampled)
    assert f"Hz, at {100 * share:.0f} % of the 256 solved points." in verdict, verdict


def test_the_answer_of_a_random_design_is_its_probability_and_what_it_depends_on(sampled):
    text = " ".join(screens.as_text(sampled.screen.findings(sampled)[:1]).split())
    row, index = sampled.robust().iloc[0], sampled.sobol_indices().iloc[0]
    low, high = (100 * row[f"probability_{end}"] for end in ("low", "high"))
    assert f"is unstable at {100 * row['probability']:.1f} % of " in text
    assert f"(95 % interval {low:.1f} to {high:.1f} %): T" in text
    assert f"The fastest growth is {row['max_growth_rate']:.1f} 1/s." in text
    assert f"{index['parameter']} {index['total']:.2f} ({index['total_low']:.2f} to " in text
    assert "sliding_speed" not in text  # on which nothing depends


def test_the_worst_case_is_that_of_all_solved_points_as_in_the_ranking():
    """Of three points two are draws; the third grows fastest, the second track there alone."""
    x = np.arange(9.0).reshape(3, 3)
    points, modes = tables(x, np.array([2.0, -4.0, 9.0]))
    drawn = np.array([True, True, False])
    table = robust_table(points, modes, drawn)
    assert table["max_growth_rate"].tolist() == [9.0, 9.0]
    assert set(table["at"]) == {"x1=6, x2=7, x3=8"}
    assert table["growth_mean"][1] == pytest.approx(-1.0)
    assert table["probability"].tolist() == [0.5, 0.5]
    only = robust_table(*tables(x, np.array([-2.0, -4.0, 9.0])), drawn)
    assert (len(only), only["probability"][0], only["max_growth_rate"][0]) == (1, 0.0, 9.0)


def test_a_sobol_design_has_probabilities_and_no_indices(tmp_path):
    results = run(tmp_path / "r", "sobol", 32)
    assert (results.robust()["points"] == 32).all()
    with pytest.raises(ResultsError, match="need a design of type 'sobol_indices', this is sobol"):
        results.sobol_indices()


def test_a_grid_has_no_probability(tmp_path):
    text = STUDY.replace("TYPE", "grid").replace("samples = SAMPLES", "")
    start, stop = text.index("[[sweep]]"), text.index("[design]")
    sweep = '[[sweep]]\nparameter = "friction"\nvalues = [0.2, 0.4]\n'
    text = text[:start] + sweep + text[stop:]
    run_study(plan_of(text), tmp_path / "r", jobs=1)
    with pytest.raises(ResultsError, match=r"probability of instability needs .* random design"):
        squealstudy.open_results(tmp_path / "r").robust()


def test_modes_without_indices_are_named_on_the_screen(capsys):
    x = saltelli_sample(64)
    made = tables(x, np.where(x[:, 0] > 0, ishigami(x), np.nan))
    screens.show(*random_screen.indices(sobol_table(*made, NAMES)))
    screen = capsys.readouterr().out
    assert "modes found at too few points for indices: T1" in screen
    assert screen.count("x1") == 1


def test_robust_on_the_screen_and_as_csv(sampled, capsys, tmp_path):
    directory = str(sampled.directory)
    assert ("probability", f"squealstudy robust {directory}") in sampled.screen.next_steps(sampled)
    assert command("robust", directory) == 0
    screen = capsys.readouterr().out
    assert "of 128 points of the two independent samples, all are ok" in screen
    assert "Clopper-Pearson" in screen
    assert screen.count("growth +- std") == 2  # a title and its meaning
    assert "mean  " not in screen
    assert "from 64 groups" in screen
    assert command("robust", directory, "--csv") == 0
    assert capsys.readouterr().out.startswith("quantity,track,frequency_hz,points")
    assert command("robust", directory, "--csv", "--indices") == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + len(sampled.sobol_indices())
    assert lines[1].startswith("largest,0,")
    assert command("rank", directory, "--by", "probability") == 0
    capsys.readouterr()
    assert command("plot", directory, "-o", str(tmp_path)) == 0
    assert (tmp_path / "robust.png").stat().st_size > 10_000


def test_bars_show_what_the_tables_say(tmp_path):
    x = saltelli_sample(64)
    growth = np.where(x[:, 0] > 0, ishigami(x), np.nan)
    made = tables(x, growth)
    probabilities, indices = robust_table(*made), sobol_table(*made, NAMES)
    figure = robust_bars(probabilities, indices.dropna(subset=["first", "total"]))
    left, *others = figure.axes
    widths = [bar.get_width() for bar in left.patches]
    np.testing.assert_allclose(widths, 100 * probabilities["probability"])
    assert [t.get_text() for t in left.get_yticklabels()] == ["any mode", "T1  1000 Hz"]
    shown = [bar.get_width() for bar in others[0].patches]
    largest = indices[indices["quantity"] == "largest"]
    np.testing.assert_allclose(shown, [*largest["first"], *largest["total"]])
    assert len(others) == 1  # mode 1 is found too rarely for indices
    save_figure(figure, tmp_path / "r.png")
    named = robust_bars(probabilities, None, {1: ("4 ND out of plane", True)}).axes[0]
    rows = [t.get_text() for t in named.get_yticklabels()]
    assert rows == ["any mode", "4 ND out of plane (changes), 1000 Hz (T1)"]


@pytest.mark.usefixtures("one_by_one")
def test_a_random_design_whose_every_point_failed_is_drawn(tmp_path, monkeypatch):
    """`plot` ended in the error of the probabilities, without any picture."""

    def fail(*_):
        raise ConvergenceError("not_converged", "no working point")

    monkeypatch.setattr("squealstudy.kinds.complex_modes.problems.solve_point", fail)
    with contextlib.suppress(ResultsError):  # run says that every point failed
        run(tmp_path / "r", "latin_hypercube", 8)
    names = [path.stem for path in squealstudy.open_results(tmp_path / "r").draw(tmp_path)]
    assert "stability_diagram" in names
    assert "robust" not in names


def test_modes_that_swap_numbers_are_counted_in_words():
    table = pd.DataFrame({"track": [7, 3, 9], "family": 3, "family_points": 6, "points": 8})
    (told,) = random_screen.families_in_words(table.assign(family_modes=2))
    assert told == (
        "T3, T7 and T9 stand for 2 modes that swap numbers between design points, so that a line "
        "may be of both: at least one is unstable at 75.0 % of them"
    )
    (told,) = random_screen.families_in_words(table[:2].assign(family_modes=1))
    assert told == (
        "T3 and T7 are one unstable mode, which changes its number between design points: it is "
        "unstable at 75.0 % of them"
    )
