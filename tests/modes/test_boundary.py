"""Boundary designs: the map of the full grid from a fraction of its points, whatever happens."""

from __future__ import annotations

import itertools
import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from study_runs import command, comparable, plan_of, solved
from study_texts import study_text, sweep_text

import squealstudy
from squealstudy.engine.pictures import save_figure
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.kinds.complex_modes.boundary import (
    BoundaryGrid,
    CellRule,
    most_points,
    refine,
)
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.kinds.complex_modes.rows import read_roots
from squealstudy.modes.judged_roots import unstable_roots
from squealstudy.tables.boundary_map import full_points, full_tables
from squealstudy.tables.mode_ranking import rank_modes

TOLERANCE = 1e-7


# -- the refinement alone, of functions ------------------------------------------------------------
def grid_of(shape: tuple[int, ...], levels: int) -> BoundaryGrid:
    fine = [(n - 1) * 2**levels + 1 for n in shape]
    axes = tuple(tuple(np.linspace(0.0, 1.0, n).tolist()) for n in fine)
    return BoundaryGrid(tuple("xyz"[: len(shape)]), axes, levels)


def roots(*pairs: tuple[float, float]) -> np.ndarray:
    """Roots of (frequency in Hz, damping ratio)."""
    return np.array([2 * np.pi * f * complex(-z, math.sqrt(1 - z * z)) for f, z in pairs])


def explored(grid: BoundaryGrid, solve) -> dict[tuple[int, ...], np.ndarray | None]:
    """All nodes that the refinement asks for, solved round by round."""
    known: dict[tuple[int, ...], np.ndarray | None] = {}
    while True:
        wanted = refine(grid, known, TOLERANCE)
        fresh = [node for node in wanted if node not in known]
        if not fresh:
            return known
        known |= {node: solve(*grid.values([node])[0]) for node in fresh}


def count_of(lam: np.ndarray | None) -> int:
    """Unstable roots of a node, -1 where it failed."""
    return -1 if lam is None else int((lam.real / np.abs(lam) > TOLERANCE).sum())


def map_of(grid: BoundaryGrid, known) -> tuple[np.ndarray, pd.DataFrame, np.ndarray]:
    """Unstable modes at every node of the full grid (-1: failed), the points, which were solved."""
    points = pd.DataFrame(grid.values(list(known)), columns=list(grid.names))
    points["point_id"] = [f"p{i}" for i in range(len(points))]
    points["status"] = ["failed" if lam is None else "ok" for lam in known.values()]
    axes = dict(zip(grid.names, grid.axes, strict=True))
    table, solved = full_points(points, axes, grid.levels)
    count = {f"p{i}": count_of(lam) for i, lam in enumerate(known.values())}
    return table["point_id"].map(count).to_numpy().reshape(grid.shape, order="F"), points, solved


def everywhere(grid: BoundaryGrid, solve) -> np.ndarray:
    """The same of a grid study: every node solved."""
    found = np.zeros(grid.shape, dtype=int)
    for node in itertools.product(*map(range, grid.shape)):
        lam = solve(*grid.values([node])[0])
        found[node] = count_of(lam)
    return found


def disc(x: float, y: float) -> np.ndarray:
    """Unstable inside a circle, and a second mode in a corner."""
    return roots(
        (1000.0, 0.05 * ((x - 0.45) ** 2 + (y - 0.5) ** 2 - 0.09)),
        (2000.0, 0.02 * (1.5 - x - y)),
        (3000.0, 0.01),
    )


def test_the_map_is_that_of_the_full_grid_at_a_fraction_of_its_points():
    grid = grid_of((5, 5), 4)
    known = explored(grid, disc)
    found, _, solved = map_of(grid, known)
    np.testing.assert_array_equal(found, everywhere(grid, disc))
    assert solved.sum() == len(known) < 0.25 * found.size


def test_each_level_costs_about_twice_the_points_of_the_last():
    counts = [len(explored(grid_of((5, 5), levels), disc)) for levels in (1, 2, 3, 4)]
    growth = np.diff(counts[1:]) / np.diff(counts[:-1])
    assert (growth < 2.6).all()  # a line has twice the points at half the spacing; an area four


def test_one_and_three_parameters():
    line = grid_of((4,), 5)
    known = explored(line, lambda x: roots((1000.0, 0.01 * (0.377 - x))))
    found, *_ = map_of(line, known)
    np.testing.assert_array_equal(found, (np.array(line.axes[0]) > 0.377).astype(int))
    assert len(known) == 4 + 5
    ball = grid_of((4, 4, 4), 2)

    def solve(x: float, y: float, z: float) -> np.ndarray:
        return roots((1000.0, 0.05 * ((x - 0.4) ** 2 + (y - 0.5) ** 2 + z**2 - 0.16)))

    known = explored(ball, solve)
    found, *_ = map_of(ball, known)
    np.testing.assert_array_equal(found, everywhere(ball, solve))
    assert len(known) < 0.6 * found.size


@settings(max_examples=10)
@given(
    st.floats(0, 2 * math.pi),
    st.floats(-0.4, 1.4),
    st.floats(0.0, 0.3),
    st.floats(0, 2 * math.pi),
)
def test_any_wavy_line_is_found_and_every_cell_agrees(angle, offset, wave, phase):
    def solve(x: float, y: float) -> np.ndarray:
        across = x * math.cos(angle) + y * math.sin(angle)
        along = -x * math.sin(angle) + y * math.cos(angle)
        return roots((1000.0, 1e-3 * (across - offset + 0.3 * wave * math.sin(4 * along + phase))))

    grid = grid_of((5, 4), 3)
    known = explored(grid, solve)
    found, points, _ = map_of(grid, known)
    pending = [(c, 8) for c in itertools.product(range(0, 32, 8), range(0, 24, 8))]
    while pending:  # down to the cells that were not halved
        corner, stride = pending.pop()
        if stride > 1 and tuple(c + stride // 2 for c in corner) in known:
            half = stride // 2
            shifts = itertools.product((0, half), repeat=2)
            pending += [((corner[0] + i, corner[1] + j), half) for i, j in shifts]
        elif stride > 1:
            box = tuple(slice(c, c + stride + 1) for c in corner)
            assert len(np.unique(found[box])) == 1
    assert points["point_id"].is_unique


def test_decisions_follow_from_the_nodes_asked_for_alone():
    """Rows of later rounds, or of another resolution, change nothing."""
    grid = grid_of((5, 5), 3)
    full = {
        node: disc(*grid.values([node])[0]) for node in itertools.product(*map(range, grid.shape))
    }
    known = explored(grid, disc)
    assert refine(grid, full, TOLERANCE) == list(known)
    few = refine(grid, dict(list(known.items())[:30]), TOLERANCE)
    assert few == list(known)[: len(few)]
    assert len(grid.coarse_nodes()) < len(few) < len(known)


# -- what is halved --------------------------------------------------------------------------------
def cell(a, b, c, d, beyond=None, tolerance=TOLERANCE) -> bool:
    """Whether a cell of these four corners is halved; `beyond` is left of the first two."""
    rule = CellRule((9, 5), tolerance)
    rule.add({(4, 0): a, (8, 0): b, (4, 4): c, (8, 4): d})
    if beyond is not None:
        rule.add({(0, 0): beyond, (0, 4): beyond})
    return rule.changes_inside((4, 0), 4)


STABLE, FLUTTER = roots((1000.0, 0.01), (1500.0, 0.02)), roots((1000.0, -0.01), (1500.0, 0.02))
OTHER = roots((1000.0, 0.01), (1500.0, -0.02))


def test_corners_of_different_counts_and_failures():
    assert not cell(STABLE, STABLE, STABLE, STABLE)
    assert not cell(FLUTTER, FLUTTER, FLUTTER, FLUTTER)
    assert cell(STABLE, STABLE, STABLE, FLUTTER)
    assert cell(STABLE, None, STABLE, STABLE)
    assert not cell(None, None, None, None)
    assert not cell(*[roots((1000.0, -1e-8))] * 2, *[roots((1000.0, 0.01))] * 2)  # within tolerance


def test_other_modes_unstable_at_the_same_count():
    assert cell(FLUTTER, OTHER, FLUTTER, OTHER)
    shifted = roots((1020.0, -0.01), (1500.0, 0.02))
    assert not cell(FLUTTER, shifted, FLUTTER, shifted)


def test_damping_that_dips_between_two_corners():
    near, far = roots((1000.0, 0.002)), roots((1000.0, 0.002))
    assert not cell(near, far, near, far)
    assert not cell(near, far, near, far, beyond=roots((1000.0, 0.01)))  # -0.125 x 1 + ... > 0
    assert cell(near, far, near, far, beyond=roots((1000.0, 0.05)))
    # the same of an unstable mode that calms down on the way
    near, far = roots((1000.0, -0.002)), roots((1000.0, -0.002))
    assert cell(near, far, near, far, beyond=roots((1000.0, -0.05)))
    # and modes without a partner predict nothing
    assert not cell(near, far, near, far, beyond=roots((3000.0, -0.05)))


def test_an_island_between_the_nodes_of_the_coarse_grid_is_found_by_its_slopes():
    def solve(x: float, y: float) -> np.ndarray:
        return roots((1000.0, 0.1 * ((x - 0.5) ** 2 + (y - 0.5) ** 2 - 0.1)))

    grid = grid_of((6, 6), 3)  # nodes at multiples of 0.2: the circle of 0.316 holds four of them
    known = explored(grid, solve)
    np.testing.assert_array_equal(map_of(grid, known)[0], everywhere(grid, solve))

    def small(x: float, y: float) -> np.ndarray:
        return roots((1000.0, 0.1 * ((x - 0.5) ** 2 + 0.02 * (y - 0.5) ** 2 - 0.009)))

    known = explored(grid, small)  # 0.095 wide: between the columns 0.4 and 0.6
    assert not any((known[n].real > 0).any() for n in grid.coarse_nodes())
    np.testing.assert_array_equal(map_of(grid, known)[0], everywhere(grid, small))


@settings(max_examples=30)
@given(
    st.floats(1e-9, 1e3),
    st.floats(1.001, 1e6),
    st.integers(2, 40),
    st.integers(1, 10),
    st.sampled_from(["linear", "log"]),
    st.booleans(),
)
def test_every_first_point_is_a_node_of_the_full_grid(start, factor, num, halvings, scale, falls):
    low, high = start, start * factor
    first, last = (high, low) if falls else (low, high)
    sweep = f"start = {first!r}\nstop = {last!r}\nnum = {num}\nscale = '{scale}'"
    text = ONE_SWEEP.format(sweep=sweep, levels=halvings)
    plan = plan_of(text)
    grid = BoundaryGrid.of(plan.study)
    (axis,) = grid.axes
    assert [grid.node(point) for point in plan.swept.tolist()] == grid.coarse_nodes()
    assert (axis[0], axis[-1]) == (first, last)
    assert (np.diff(axis) * (-1 if falls else 1) > 0).all()
    spacing = np.diff(np.log(axis) if scale == "log" else axis)
    np.testing.assert_allclose(spacing, spacing.mean(), rtol=1e-5)


ONE_SWEEP = (
    study_text("line", "complex_modes", "hulten")
    + """\
[[sweep]]
parameter = "normal_force"
{sweep}
[design]
type = "boundary"
levels = {levels}
"""
)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_halvings_too_small_for_floating_point_are_refused(scale):
    sweep = f"start = 1.0\nstop = 1.0000000000001\nnum = 9\nscale = '{scale}'"
    with pytest.raises(StudyFileError, match=r"stop.*too near to start for 10 halvings"):
        plan_of(ONE_SWEEP.format(sweep=sweep, levels=10))


def test_around_a_failed_node_the_map_is_as_fine_as_it_goes():
    grid = grid_of((4, 4), 2)
    failing = {(4, 4), (5, 4)}

    def solve(x: float, y: float) -> np.ndarray | None:
        node = (round(x * 12), round(y * 12))
        return None if node in failing else roots((1000.0, 0.01))

    known = explored(grid, solve)
    np.testing.assert_array_equal(map_of(grid, known)[0], everywhere(grid, solve))
    assert all((4 + i, 4 + j) in known for i, j in itertools.product((-1, 0, 1), repeat=2))


# -- a study against the grid study of its resolution ----------------------------------------------
BOUNDARY = (
    study_text("map", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.7, 6)
    + sweep_text("damping_ratio", 0.001, 0.2, 4)
    + """\
scale = "log"
[design]
type = "boundary"
levels = 3
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
)
GRID = (
    BOUNDARY.replace('"boundary"\nlevels = 3', '"grid"')
    .replace("num = 4\n", "num = 25\n")
    .replace("num = 6\n", "num = 41\n")
)


FEW = BOUNDARY.replace("levels = 3", "levels = 2")  # 273 nodes of the full grid


@pytest.fixture(scope="module")
def few(tmp_path_factory) -> Path:
    """Results of a coarser boundary study."""
    place = tmp_path_factory.mktemp("boundary") / "few"
    run_study(plan_of(FEW), place, jobs=1)
    return place


@pytest.fixture(scope="module")
def directories(tmp_path_factory) -> tuple[Path, Path]:
    """Results of the boundary study and of the grid study."""
    root = tmp_path_factory.mktemp("boundary")
    run_study(plan_of(BOUNDARY), root / "map", jobs=1)
    run_study(plan_of(GRID), root / "grid", jobs=1)
    return root / "map", root / "grid"


def test_the_study_agrees_with_the_grid_study_at_every_node(directories):
    found, grid = (squealstudy.open_results(d) for d in directories)
    nodes, solved = found.nodes
    keys = ["friction", "damping_ratio"]
    pd.testing.assert_frame_equal(nodes[keys], grid.points[keys])
    np.testing.assert_array_equal(nodes["n_unstable"], grid.points["n_unstable"])
    assert set(found.points["point_id"]) < set(grid.points["point_id"])  # the very same points
    facts = found.manifest["boundary"]
    assert facts["points_solved"] == len(found.points) == solved.sum()
    assert facts["full_grid_points"] == len(grid.points) == 41 * 25
    assert facts["fraction"] == pytest.approx(len(found.points) / 1025)
    assert facts["fraction"] < 0.2
    assert found.manifest["n_points"] == len(found.points)


def test_the_ranking_is_over_the_map_not_over_where_points_crowd(directories):
    found, grid = (squealstudy.open_results(d) for d in directories)
    mine, theirs = found.rank(), grid.rank()
    assert mine["unstable_share"].sum() == pytest.approx(theirs["unstable_share"].sum())
    assert mine["threshold"].min() == pytest.approx(theirs["threshold"].min(), abs=0.7 / 40)
    worst = theirs.sort_values("max_growth_rate").iloc[-1]
    assert mine["at"].iloc[0] == worst["at"]
    crowded = rank_modes(found.points, found.modes)
    assert crowded["unstable_share"].sum() != pytest.approx(mine["unstable_share"].sum(), abs=0.02)


def test_full_tables_have_every_node_once(directories):
    results = squealstudy.open_results(directories[0])
    facts = results.manifest["boundary"]
    points, modes = full_tables(results.points, results.modes, facts["axes"], facts["levels"])
    assert points["point_id"].is_unique
    assert len(points) == 1025
    unstable = modes[modes["unstable"]]["point_id"].value_counts()
    counted = points["point_id"].map(unstable).fillna(0)
    np.testing.assert_array_equal(counted, points["n_unstable"])
    with pytest.raises(ResultsError, match="not on the map"):
        full_tables(results.points, results.modes, {**facts["axes"], "friction": [0.0, 0.7]}, 0)


def test_a_failed_node_is_no_solved_one(directories):
    found = squealstudy.open_results(directories[0])
    lost = found.points.copy()
    lost.loc[0, "status"] = "not_converged"
    fewer = found.with_tables(points=lost, modes=found.modes, onsets=found.onsets)
    assert fewer.nodes[1].sum() == found.nodes[1].sum() - 1
    assert f"({len(lost) - 1} solved)" in fewer.screen.verdict(fewer)


def test_counts_are_those_of_the_table(directories):
    results = squealstudy.open_results(directories[0])
    ids = results.points["point_id"]
    roots = read_roots(Store(directories[0]), set(ids), tolerance=1e-4)
    counts = [len(unstable_roots(roots[i], TOLERANCE)) for i in ids]
    assert counts == results.points["n_unstable"].tolist()


def test_same_study_again_does_nothing(directories):
    report = run_study(plan_of(BOUNDARY), directories[0], jobs=1)
    n = len(squealstudy.open_results(directories[0]).points)
    assert (report.n_solved, report.n_reused) == (0, n)


@pytest.mark.parametrize("stopped_after", [1, 30])  # points
def test_a_killed_run_goes_on_to_the_same_points(few, tmp_path, stopped_after, monkeypatch):
    """In the first round, and in one that finished points asked for."""
    solve, done = ComplexModes.solve, []

    def dying(self, task):
        if sum(len(task.points) for task in done) >= stopped_after:
            raise KeyboardInterrupt
        done.append(task)
        return solve(self, task)

    monkeypatch.setattr(ComplexModes, "solve", dying)
    with pytest.raises(KeyboardInterrupt):
        run_study(plan_of(FEW), tmp_path / "r", jobs=1)
    with pytest.raises(ResultsError, match="not finished"):
        squealstudy.open_results(tmp_path / "r")
    monkeypatch.setattr(ComplexModes, "solve", solve)
    kept = sum(len(task.points) for task in done)
    report = run_study(plan_of(FEW), tmp_path / "r", jobs=1)
    assert report.n_reused == kept > 0
    assert report.manifest["boundary"]["points_solved"] == report.n_solved + kept
    for mine, clean in zip(comparable(tmp_path / "r"), comparable(few), strict=True):
        pd.testing.assert_frame_equal(mine, clean)


def test_more_levels_keep_what_is_there(few, tmp_path):
    coarse = BOUNDARY.replace("levels = 3", "levels = 1")
    first = run_study(plan_of(coarse), tmp_path / "r", jobs=1)
    report = run_study(plan_of(FEW), tmp_path / "r", jobs=1)
    assert report.n_reused == first.n_solved
    for mine, clean in zip(comparable(tmp_path / "r"), comparable(few), strict=True):
        pd.testing.assert_frame_equal(mine, clean)


def test_a_structural_parameter_is_built_round_by_round(tmp_path):
    """Flutter of Hulten's model in closed form, over friction and a frequency."""
    text = BOUNDARY.replace(
        '"damping_ratio"\nstart = 0.001\nstop = 0.2\nnum = 4\nscale = "log"', F2
    )
    text = text.replace("levels = 3", "levels = 2")
    results = solved(text, tmp_path / "r")
    nodes, _ = results.nodes
    w1, w2 = 100.0, nodes["frequency_2"]
    flutters = nodes["friction"] > (w1**2 - w2**2).abs() / (2 * w1 * w2) + 1e-12
    np.testing.assert_array_equal(nodes["n_unstable"] == 1, flutters)
    assert len(results.points) < 0.5 * len(nodes)


F2 = '"frequency_2"\nstart = 60.0\nstop = 90.0\nnum = 4'


def test_a_round_beyond_the_limit_needs_yes(tmp_path):
    text = BOUNDARY.replace("levels = 3", "levels = 2\nlimit = 40")
    with pytest.raises(StudyFileError, match="more than the limit of 40"):
        run_study(plan_of(text), tmp_path / "r", jobs=1)
    report = run_study(plan_of(text), tmp_path / "r", jobs=1, yes=True)
    assert report.n_reused == 24
    assert report.manifest["n_points"] > 40


def test_other_designs_do_not_grow(directories):
    plan = plan_of(GRID)
    assert plan.kind.extended_plan(plan, Store(directories[1])) is plan
    assert most_points(plan.study) == 1025
    assert most_points(plan_of(BOUNDARY).study) == 1025


# -- pictures and screens --------------------------------------------------------------------------
def test_the_map_is_drawn_with_its_cells_and_nodes(directories, tmp_path):
    results = squealstudy.open_results(directories[0])
    _, solved = results.nodes
    figure = results.plot.stability_map(x="friction", y="damping_ratio")
    axes = figure.axes[0]
    (mesh,) = [c for c in axes.collections if type(c).__name__ == "QuadMesh"]
    assert mesh.get_array().shape == (25, 41)
    (dots,) = [line for line in axes.lines if line.get_marker() == "."]
    assert len(dots.get_xdata()) == solved.sum()
    assert f"{solved.sum()} of 1025 nodes solved" in axes.get_title(loc="left")
    save_figure(figure, tmp_path / "map.png")


@pytest.mark.full_size  # by default pictures of few
def test_pictures_of_many_nodes_stay_as_a_finished_run_finds_them(few, tmp_path, monkeypatch):
    path, out = tmp_path / "map.toml", tmp_path / "out"
    path.write_text(FEW)
    shutil.copytree(few, out)
    squealstudy.run(path, out, jobs=1).draw()
    again = squealstudy.run(path, out, jobs=1)
    assert len(again.points) < 250
    for fewest, kept in ((274, False), (273, True)):  # nodes of the full grid: 273
        monkeypatch.setattr("squealstudy.engine.results.KEEP_PICTURES", fewest)
        assert bool(again.drawn) is kept
    assert {path.name for path in again.drawn} == {path.name for path in out.glob("*.png")}
    again.drawn[0].unlink()
    assert not again.drawn


def test_check_gives_a_range_and_plot_draws(directories, monkeypatch, capsys, tmp_path):
    study = tmp_path / "map.toml"
    study.write_text(BOUNDARY)
    monkeypatch.chdir(tmp_path)
    assert command("check", "map.toml") == 0
    screen = " ".join(capsys.readouterr().out.split())
    assert "24 points, 24 of them not yet" in screen
    assert "1,025 at most (full grid)" in screen
    assert " s to " in screen
    assert command("check", "map.toml", "-o", str(directories[0])) == 0
    assert ", 0 of them not yet" in capsys.readouterr().out
    assert command("plot", str(directories[0]), "-o", str(tmp_path)) == 0
    assert (tmp_path / "stability_map_count.png").is_file()
    assert command("rank", str(directories[0])) == 0


@pytest.mark.parametrize("sweeps", [1, pytest.param(3, marks=pytest.mark.full_size)])
def test_one_and_three_sweeps_run_and_are_drawn(sweeps, monkeypatch, capsys, tmp_path):
    text = BOUNDARY.replace("num = 4", "num = 3").replace("levels = 3", "levels = 1")
    text = text.replace("num = 6", "num = 4")
    first = text.index('[[sweep]]\nparameter = "damping_ratio"')
    design = text.index("[design]")
    third = '[[sweep]]\nparameter = "sliding_speed"\nstart = 0.5\nstop = 1.0\nnum = 2\n'
    middle = "" if sweeps == 1 else text[first:design] + third
    study = tmp_path / "map.toml"
    study.write_text(text[:first] + middle + text[design:])
    monkeypatch.chdir(tmp_path)
    assert command("run", "map.toml", "-j", "1") == 0
    results = squealstudy.open_results(tmp_path / "results" / "map")
    nodes, _ = results.nodes
    assert len(nodes) == (7 if sweeps == 1 else 7 * 5 * 3)
    maps = list((tmp_path / "results" / "map").glob("stability_map*.png"))
    assert len(maps) == (0 if sweeps == 1 else 2)


# -- misuse ----------------------------------------------------------------------------------------
BAD = {
    "values": ("num = 4", "values = [0.1] #!\nnum = 4", "sweep[2].values", "halves a range"),
    "one value": ("num = 6", "num = 1 #!", "sweep[1].num", "at least 2"),
    "no num": ("num = 6", "", "sweep[1].num", "'num' of a swept range is missing"),
    "levels of a grid": ('"boundary"', '"grid"', "design.levels", "only boundary designs"),
    "samples": ("levels = 3", "samples = 8 #!", "design.samples", "not boundary"),
    "too fine": ("levels = 3", "levels = 10 #!", "design.levels", "the full grid would have"),
    "too many levels": ("levels = 3", "levels = 11 #!", "design.levels", "at most 10"),
    "distribution": ("num = 6", 'distribution = "normal" #!', "sweep[1].distribution", "only"),
    "in time": ('"complex_modes"', '"transient"', "design.type", "needs kind = 'complex_modes'"),
}


@pytest.mark.parametrize("case", BAD)
def test_misuse_is_named_by_line_and_key(case):
    old, new, key, message = BAD[case]
    text = BOUNDARY.replace(old, new, 1)
    with pytest.raises(StudyFileError) as caught:
        plan_of(text)
    assert caught.value.key == key
    assert message in caught.value.message
    marked = [i for i, line in enumerate(text.splitlines(), start=1) if line.endswith("#!")]
    assert not marked or caught.value.line == marked[0]


def test_four_sweeps_are_too_many():
    extra = "".join(
        f'[[sweep]]\nparameter = "{name}"\nstart = 0.1\nstop = 0.2\nnum = 2\n'
        for name in ("sliding_speed", "mass")
    )
    with pytest.raises(StudyFileError, match="1 to 3"):
        plan_of(BOUNDARY.replace("[design]", extra + "[design]"))
