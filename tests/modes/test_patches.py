"""What patches are made of, each by itself: polynomials, boxes, blocks of modes, small problems."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import (
    HZ,
    SyntheticProblem,
    constant,
    in_order,
    random_brake,
    random_points,
    whole_box,
)
from test_windows import truncated_basis

from squealstudy.errors import ConvergenceError
from squealstudy.linalg.companion import all_pairs
from squealstudy.modes.reanalysis.estimate import two_sided_error
from squealstudy.modes.reanalysis.patch import (
    Box,
    Mixing,
    NodeModes,
    _oscillates_in_band,
    find_blocks,
    gauged,
    make_patch,
    mixing,
    mixing_by_direction,
)
from squealstudy.modes.reanalysis.polynomials import interpolation, spread_points
from squealstudy.modes.reanalysis.problem import in_band, lightly_damped
from squealstudy.modes.reanalysis.ritz import _eigenvalues, ritz_roots
from squealstudy.modes.reanalysis.sweep_basis import _on_faces, build_sweep_basis
from squealstudy.modes.rungs.windows import RUNG, Windows, _may_be_inside, _may_be_real, conditions

GRIDS = [(0, 1), (5, 1), (8, 1), (4, 2), (7, 2), (2, 3), (6, 3), (2, 5)]


# -- interpolation -------------------------------------------------------------------------------
@pytest.mark.parametrize(("degree", "dimension"), GRIDS)
def test_polynomials_of_the_degree_are_interpolated_exactly(degree, dimension):
    """Inside the box and beyond it, from as few nodes as there are coefficients."""
    grid = interpolation(degree, dimension)
    assert len(grid.nodes) == math.comb(degree + dimension, dimension)
    assert np.abs(grid.nodes).max() < 1
    direction = np.random.default_rng(degree).uniform(-1, 1, dimension)

    def polynomial(xi):
        return (0.3 + xi @ direction) ** degree

    at = 1.3 * random_points(20, dimension)
    found = grid.cardinals(at) @ polynomial(grid.nodes)
    np.testing.assert_allclose(found, polynomial(at), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("degree", "dimension"), GRIDS)
def test_nodes_are_placed_well(degree, dimension):
    """What errors at nodes become anywhere in the box: some square root of their number."""
    grid = interpolation(degree, dimension)
    amplified = np.abs(grid.cardinals(spread_points(dimension))).sum(axis=1).max()
    assert amplified < {1: 1.01, 2: 1.7}.get(dimension, 2.6) * len(grid.nodes) ** 0.5


@pytest.mark.parametrize(("dimension", "count"), [(0, 1), (1, 250), (2, 225), (5, 243), (9, 512)])
def test_points_that_stand_for_a_box_have_its_corners(dimension, count):
    """A regular grid of at most 250 points, unless there are more corners."""
    points = spread_points(dimension)
    assert points.shape == (count, dimension)
    assert (np.abs(points) == 1).all(axis=1).sum() == 2**dimension
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)


# -- boxes ---------------------------------------------------------------------------------------
def test_a_box_and_its_halves():
    box = Box(np.array([-1.0, 0.2]), np.array([0.0, 0.6]))
    theta = np.array([[-1.0, 0.6], [-0.5, 0.4], [-0.25, 0.3]])
    local = np.array([[-1.0, 1.0], [0.0, 0.0], [0.5, -0.5]])
    np.testing.assert_allclose(box.local(theta), local, atol=1e-15)
    np.testing.assert_allclose(box.place(local), theta, atol=1e-15)
    assert box.holds(np.array([[-1.0, 0.6], [0.0, 0.2], [0.01, 0.4], [-0.5, 0.19]])).tolist() == [
        *(True, True, False, False)
    ]
    low, high = box.halves(1)
    for half, ends in ((low, [[-1.0, 0.2], [0.0, 0.4]]), (high, [[-1.0, 0.4], [0.0, 0.6]])):
        np.testing.assert_allclose([half.low, half.high], ends)
    flat = Box(np.array([0.3]), np.array([0.3]))
    assert flat.local(np.array([[0.3]])) == 0.0


def test_points_on_faces_are_every_other_one():
    """Moved to the nearest face; the others stay."""
    points = random_points(11, 3)
    moved = _on_faces(points)
    np.testing.assert_array_equal(moved[1::2], points[1::2])
    assert (np.abs(moved[::2]) == 1).any(axis=1).all()
    np.testing.assert_allclose(
        np.abs(moved - points)[::2].sum(axis=1), 1 - np.abs(points[::2]).max(axis=1)
    )


# -- blocks --------------------------------------------------------------------------------------
def solved(C, K):
    return NodeModes(all_pairs(C, K), C)


def in_turn(lam):
    return lam[np.argsort(lam.imag)]


def chain(angle):
    """Modes of 3, 4 and 9 rad/s; the first two are turned by an angle into each other."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ np.diag([9.0, 16.0, 81.0]) @ turn.T


def test_modes_mix_as_far_as_they_are_turned():
    C = 1e-3 * np.eye(3)
    middle = solved(C, chain(0.0))
    same = mixing(middle, middle)
    np.testing.assert_allclose(same.right, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(same.left, np.eye(6), atol=1e-9)
    mixed = mixing(middle, solved(C, chain(0.5)))
    near = lambda lam, w: np.flatnonzero(np.abs(lam - 1j * w) < 0.1)[0]  # noqa: E731
    at, there = middle.pairs.lam, solved(C, chain(0.5)).pairs.lam
    share = mixed.right[near(at, 3.0), near(there, 4.0)] / mixed.right[near(at, 3.0)].max()
    # state vectors [x; lam x]: of unlike frequencies, (3 + 4) / (2 * 3) of the sine
    assert abs(share) > 0.3
    assert np.abs(mixed.right[near(at, 9.0)]).max() == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(("angle", "threshold", "sizes"), [(0.1, 0.3, 6), (0.5, 0.3, 4)])
def test_modes_that_mix_are_one_block(angle, threshold, sizes):
    C = 1e-3 * np.eye(3)
    middle, nodes = solved(C, chain(0.0)), [solved(C, chain(a)) for a in (-angle, 0.0, angle)]
    mixings = [mixing(middle, node) for node in nodes]
    blocks = find_blocks(mixings, threshold)
    assert len(blocks) == sizes
    assert sum(b.size for b in blocks) == 6
    for block in blocks:
        for number, node in enumerate(nodes):
            X, S, Y, T = gauged(block, number, node, mixings[number])
            K = chain((-angle, 0.0, angle)[number])
            np.testing.assert_allclose(X @ S @ S + C @ X @ S + K @ X, 0, atol=1e-9)
            Yh = Y.conj().T
            np.testing.assert_allclose(T @ T @ Yh + T @ Yh @ C + Yh @ K, 0, atol=1e-9)
            own = node.pairs.lam[block.at_nodes[number]]
            for A in (S, T):
                roots = np.linalg.eigvals(A)
                np.testing.assert_allclose(in_turn(roots), in_turn(own), rtol=1e-9)
    # of another angle the middle's modes are few of the node's: no gauge
    lost = mixings[0]._replace(right=0 * mixings[0].right)
    with pytest.raises(np.linalg.LinAlgError, match="gauge"):
        gauged(blocks[0], 0, nodes[0], lost)


def test_blocks_do_not_depend_on_the_lengths_of_modes():
    """Right ones of a node by any factor, left ones by its inverse."""
    C = 1e-3 * np.eye(3)
    middle, node = solved(C, chain(0.0)), solved(C, chain(0.5))
    mixed = mixing(middle, node)
    factor = 10.0 ** np.array([3, -3, 0, 2, -2, 1])
    scaled = Mixing(mixed.right * factor, mixed.left / factor[:, None])
    plain, other = (find_blocks([x], 0.3) for x in (mixed, scaled))
    assert [b.middle.tolist() for b in plain] == [b.middle.tolist() for b in other]


@pytest.mark.parametrize("length", [1e-3, 1.0, 1e3])
def test_left_modes_alone_may_link_a_block(length):
    """Whatever the length of a third one, which has a small share of both."""
    left = np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.01 * length, length]])
    sizes = [b.size for b in find_blocks([Mixing(np.eye(3), left)], 0.3)]
    assert sorted(sizes) == [1, 2]
    assert len(find_blocks([Mixing(np.eye(3), left)], 0.5)) == 3


def test_modes_mix_along_the_direction_that_turns_them():
    C, grid = 1e-3 * np.eye(3), interpolation(2, 2)
    middle = solved(C, chain(0.0))
    nodes = [solved(C, chain(0.4 * xi[1])) for xi in grid.nodes]
    slope = mixing_by_direction(grid, [mixing(middle, node) for node in nodes])
    assert slope[1] > 5 * abs(slope[0])
    assert mixing_by_direction(grid, [mixing(middle, middle)] * len(nodes)) == pytest.approx(
        [0.0, 0.0], abs=1e-9
    )


@pytest.mark.parametrize(("band", "followed"), [((2.5, 5.0), 2), ((2.5, 9.1), 3), ((5.0, 8.0), 1)])
def test_a_patch_follows_the_modes_of_its_band(band, followed):
    """Or the nearest one, where there is none."""
    C, grid = 1e-3 * np.eye(3), interpolation(2, 1)
    middle = solved(C, chain(0.0))
    nodes = [solved(C, chain(0.5 * xi[0])) for xi in grid.nodes]
    patch = make_patch(whole_box(1), grid, middle, nodes, band)
    assert sum(b.size for b in patch.blocks) == followed
    assert patch.m == followed
    assert [k for _, k in patch.slices] == [b.size for b in patch.blocks]


def test_vectors_of_a_patch_solve_its_problem_from_both_sides():
    """Between nodes, of veering modes in one block: as far as their errors say."""
    problem = random_brake(12, 1, 2, coupling=0.4)
    basis = build_sweep_basis(problem, 1e-9)
    box = Box(np.array([0.0]), np.array([0.2]))
    patch = Windows(problem, basis, 1e-5)._patch(box, interpolation(5, 1)).patch
    assert max(k for _, k in patch.slices) > 1
    theta = np.linspace(0.01, 0.19, 4)[:, None]
    weights = [problem.weights(row) for row in theta]
    roots = ritz_roots(patch, basis, theta, weights)
    C, K = basis.small.matrices(weights)
    for i, lam in enumerate(roots.lam):
        X, Yh = roots.X[i], roots.Y[i].conj().T
        slope = np.einsum("mr,rm->m", Yh, 2 * X * lam + C[i] @ X)
        np.testing.assert_allclose(slope, 1.0, rtol=1e-6)
        ahead = X * lam**2 + C[i] @ X * lam + K[i] @ X
        behind = Yh * lam[:, None] ** 2 + Yh @ C[i] * lam[:, None] + Yh @ K[i]
        size = np.abs(lam) ** 2
        assert (np.linalg.norm(ahead, axis=0) < 1e-4 * size * np.linalg.norm(X, axis=0)).all()
        assert (np.linalg.norm(behind, axis=1) < 1e-4 * size * np.linalg.norm(Yh, axis=1)).all()
        exact = all_pairs(C[i], K[i]).lam
        true = np.abs(lam[:, None] - exact).min(axis=1)
        assert (true <= 5 * roots.error[i] + 1e-11 * np.abs(lam)).all()
        assert (roots.error[i] < 1e-4 * np.abs(lam)).all()


def test_modes_near_the_band_must_be_followed():
    """Those a quarter beyond either end, of positive imaginary part; others need not be."""
    lam = 1j * np.array([79.0, 81.0, 150.0, 249.0, 251.0, -150.0])
    assert np.flatnonzero(_oscillates_in_band(lam, (100.0, 200.0), 1.25)).tolist() == [1, 2, 3]


@pytest.mark.parametrize("k", [1, 2, 3])
def test_eigenvalues_of_small_matrices(k):
    A = np.random.default_rng(k).standard_normal((7, k, k, 2)).view(complex)[..., 0]
    for found, exact in zip(_eigenvalues(A), A, strict=True):
        np.testing.assert_allclose(
            np.sort_complex(found), np.sort_complex(np.linalg.eigvals(exact)), rtol=1e-12
        )


# -- bands ---------------------------------------------------------------------------------------
def test_the_ends_of_a_band_belong_to_it():
    """Of the band widened by a factor; conjugates do not, real roots do."""
    lam = np.array([49.9j, 50j, 100j, 200j, -150.0 + 0j, 400j, 400.1j, -150j])
    assert np.flatnonzero(in_band(lam, (100.0, 200.0), 1.0)).tolist() == [2, 3, 4]
    assert np.flatnonzero(in_band(lam, (100.0, 200.0), 2.0)).tolist() == [1, 2, 3, 4, 5]


# -- what windows decide -------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("lam", "error", "may_be"),
    [
        (150j, 1.0, True),
        (98j, 1.0, False),
        (98j, 3.0, True),
        (203j, 1.0, False),
        (203j, 4.0, True),
        (150 - 2j, 1.0, False),
        (150 - 2j, 3.0, True),
        (150j, 0.1, False),  # within the tolerance: it is where it is found
        (150j, np.nan, True),
        (0.5j, 1.0, False),
    ],
)
def test_roots_that_may_lie_in_the_band(lam, error, may_be):
    found = _may_be_inside(np.array([lam]), np.array([error]), (100.0, 200.0), 1e-3)
    assert found.tolist() == [may_be]


def test_roots_that_may_be_real():
    lam = np.array([-3 + 1e-3j, -3 + 1e-3j, -3.0, -3 + 1e-3j])
    error = np.array([1e-2, 1e-4, 1.0, np.nan])
    assert _may_be_real(lam, error).tolist() == [True, False, False, True]


def test_points_of_a_window_cost_less_the_more_there_are():
    """As studies/benchmarks/method_costs.py measured: over one parameter, and over two."""
    assert RUNG.relative_cost(60, 1) == pytest.approx(0.23, abs=0.01)
    assert RUNG.relative_cost(300, 2) == pytest.approx(0.89, abs=0.01)
    assert RUNG.relative_cost(500, 2) == pytest.approx(0.7, abs=0.01)
    assert RUNG.relative_cost(1, 1) == RUNG.relative_cost(0, 2) == 1.0
    assert RUNG.relative_cost(20_000, 3) == RUNG.relative_cost(20_000, 2) < 0.15


class Served(Windows):
    """Points of a patch are good but for some rows; those are solved alone."""

    def __init__(self, bad):
        super().__init__(None, None, 1e-4)
        asked = {"bad": set(bad), "first": None}
        object.__setattr__(self, "asked", asked)

    def within_tolerance(self, found):
        return found == "good"

    def alone(self, theta):
        return "alone"

    def _points(self, patch, theta, rows):
        self.asked["first"] = self.asked["first"] or list(rows)
        return ((int(row), "bad" if row in self.asked["bad"] else "good") for row in rows)


@pytest.mark.parametrize(
    ("bad", "served", "alone"),
    [
        ([], 300, 0),
        ([0], 300, 1),
        ([0, 9, 18, 27, 36], 0, 0),  # of the first: the patch is not to serve any
        (range(1, 8), 300, 7),
        (range(1, 18), 34 + 32, 17),  # more than twice the nodes: what is left is not served
    ],
)
def test_points_that_a_patch_is_not_to_serve(bad, served, alone):
    """Of 300 points some that fill it are looked at first, then the others in batches of 32."""
    windows, theta = Served(bad), np.linspace(-1, 1, 300)[:, None]
    patch = SimpleNamespace(patch=SimpleNamespace(grid=interpolation(5, 1)))
    given, steps = [], windows._solve_in_patch(patch, theta, np.arange(300))
    try:
        while True:
            given.append(next(steps))
    except StopIteration as end:
        left = end.value
    assert len(given) == served
    assert sum(found == "alone" for _, found in given) == alone
    assert not any(found == "bad" for _, found in given)
    assert sorted([row for row, _ in given] + list(left)) == list(range(300))
    assert windows.asked["first"] == list(range(0, 300, 9))


def test_errors_of_the_basis_are_the_worst_of_the_nodes():
    """Per condition of the root, of all light modes of a block together."""
    problem = random_brake(20, 1, 2, coupling=0.4)
    basis = truncated_basis(problem, 14)
    box, grid = Box(np.array([0.0]), np.array([0.1])), interpolation(5, 1)
    followed = Windows(problem, basis, 1e-2)._patch(box, grid)
    blocks = followed.patch.blocks
    assert max(b.size for b in blocks) > 1
    largest = np.zeros(followed.patch.m)
    for number, theta in enumerate(box.place(grid.nodes)):
        weights = problem.weights(theta)
        pairs = basis.pairs(weights).take(np.concatenate([b.at_nodes[number] for b in blocks]))
        error = np.abs(two_sided_error(problem, weights, basis.expand(weights, pairs)))
        largest = np.maximum(
            largest, error / conditions(pairs.X, pairs.Y) * lightly_damped(pairs.lam)
        )
    assert (largest <= followed.floor[0] * (1 + 1e-9)).all()
    assert largest.max() == pytest.approx(followed.floor[0].max(), rel=1e-6)


def test_a_box_is_cut_where_modes_mix():
    """They veer along the first parameter alone: cuts along the others would be in vain."""
    n, rng = 12, np.random.default_rng(4)
    w = HZ * np.linspace(300.0, 1400.0, n)
    A = rng.standard_normal((n, n))
    pattern = np.diag(w) @ (A + A.T) @ np.diag(w) / np.sqrt(8 * n)
    problem = SyntheticProblem(
        [
            (np.diag(w**2), constant()),
            (pattern, lambda t: 0.7 * np.sin(5 * t[0])),
            (np.diag(w**2), lambda t: 1e-3 * t[1]),
        ],
        [(np.diag(2e-3 * w), constant())],
        2,
        (250.0, 1500.0),
    )
    windows = Windows(problem, build_sweep_basis(problem, 1e-6), 1e-5)
    found = in_order(windows.solve(whole_box(2), random_points(400, 2)))
    assert sum(p.method == "windows" for p in found) > 300
    assert windows.counts["nodes"] < 250


def test_points_without_a_working_point_in_a_corner_of_two_parameters():
    """Patches that reach into it are cut; every other point has its modes."""
    problem = random_brake(12, 2, 1)
    problem.refused = lambda theta: (
        ConvergenceError("working_point", "none") if theta.sum() > 1.2 else None
    )
    theta = random_points(200, 2)
    found = in_order(
        Windows(problem, build_sweep_basis(problem, 1e-5), 1e-4).solve(whole_box(2), theta)
    )
    failed = [isinstance(p, ConvergenceError) for p in found]
    np.testing.assert_array_equal(failed, theta.sum(axis=1) > 1.2)
    assert sum(failed) > 5
    assert sum(not f and p.method == "windows" for f, p in zip(failed, found, strict=True)) > 20


def test_a_part_of_the_design_without_modes_in_the_band():
    """One mode leaves it; the others are far above."""
    stiffness = np.diag([0.0, *(HZ * np.array([3000.0, 3500.0, 4000.0])) ** 2])
    moving = np.diag([HZ**2, 0.0, 0.0, 0.0])
    problem = SyntheticProblem(
        [(stiffness, constant()), (moving, lambda t: (1250.0 + 750.0 * t[0]) ** 2)],
        [(np.eye(4), constant())],
        1,
        (300.0, 1000.0),
    )
    windows = Windows(problem, build_sweep_basis(problem, 1e-5), 1e-4)
    theta = np.linspace(0.2, 1.0, 40)[:, None]
    found = in_order(windows.solve(Box(np.array([0.2]), np.array([1.0])), theta))
    assert [len(p.lam) for p in found] == [0] * 40
    assert {p.method for p in found} == {"windows"}
