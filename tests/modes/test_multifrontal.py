"""Factors by dense fronts, and the order of elimination: solutions, fill, failures, threads."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.errors import ConvergenceError
from squealstudy.linalg import factor as factors
from squealstudy.linalg.factor import (
    FrontsFactor,
    SuperLUFactor,
    factorise,
    is_definite,
    solve_threads,
    symmetric_lu,
)
from squealstudy.linalg.nested_dissection import LEAF_ROWS, elimination_tree


def grid(*sides: int, of_node: int = 1) -> sp.csr_matrix:
    """A definite matrix on a grid of nodes, each coupled with those around it and in itself."""
    line = [sp.diags([-1.0, 4.0, -1.0], [-1, 0, 1], shape=(n, n)) for n in sides]
    A = line[0]
    for other in line[1:]:
        A = sp.kron(A, other)
    node = np.eye(of_node) + 0.1 * np.ones((of_node, of_node))
    return sp.kron(A, node).tocsr()


def scattered(n: int, links: int, seed: int, hubs: int = 0) -> sp.csr_matrix:
    """A definite matrix of a random graph, mostly of several parts."""
    rng = np.random.default_rng(seed)
    i, j = rng.integers(n, size=(2, links))
    B = sp.coo_matrix((rng.standard_normal(links), (i, j)), shape=(n, n)).tolil()
    for hub in rng.integers(n, size=hubs):
        B[hub, :] = rng.standard_normal(n)
    S = (B + B.T).tocsr()
    S.setdiag(0.0)
    S.eliminate_zeros()
    return (S + sp.diags(abs(S).sum(axis=1).A1 + 1.0)).tocsr()


def assert_solves(A, columns=3):
    b = np.random.default_rng(1).standard_normal((A.shape[0], columns))
    factor = FrontsFactor(A)
    x = factor.solve_once(b)
    size = abs(A) @ np.abs(x) + np.abs(b)
    assert (np.abs(A @ x - b) / size).max() < 1e-13
    np.testing.assert_allclose(factor.solve_once(b[:, 0]), x[:, 0], rtol=1e-9, atol=1e-12)
    return factor


@given(n=st.integers(1, 400), density=st.floats(0.0, 3.0), seed=st.integers(0, 99))
def test_random_matrices_are_solved(n, density, seed):
    A = scattered(n, int(density * n), seed)
    tree = elimination_tree(A)
    assert sorted(tree.order) == list(range(n))
    assert tree.fronts[0].start == 0
    assert tree.fronts[-1].stop == n
    assert_solves(A)


def test_the_order_is_one_of_nested_dissection():
    """Every entry of the factor is in its front, and a front reaches only what is above it."""
    A = grid(12, 11, 5, of_node=2)
    tree = elimination_tree(A)
    place = np.argsort(tree.order)
    entries = A.tocoo()
    lower = place[entries.row] > place[entries.col]
    row, column = place[entries.row[lower]], place[entries.col[lower]]
    parent = {child: i for i, front in enumerate(tree.fronts) for child in front.children}
    assert len(tree.fronts) > 10
    for number, front in enumerate(tree.fronts):
        own = (column >= front.start) & (column < front.stop)
        assert np.isin(row[own], [*range(front.start, front.stop), *front.boundary]).all()
        if len(front.boundary):
            above = tree.fronts[parent[number]]
            beyond = front.boundary[front.boundary >= above.stop]
            assert front.boundary[0] < above.stop
            assert np.isin(beyond, above.boundary).all()


@pytest.mark.parametrize(
    ("sides", "most"), [((11, 10, 10), 1.7), ((60, 50, 1), 2.0), ((900, 1, 1), 12.0)]
)
def test_fill_is_not_far_from_that_of_minimum_degree(sides, most):
    A = grid(*sides, of_node=3)
    tree = elimination_tree(A)
    diagonal_blocks = sum((f.stop - f.start) * (f.stop - f.start - 1) // 2 for f in tree.fronts)
    assert tree.factor_entries - diagonal_blocks < most * symmetric_lu(A).L.nnz
    assert_solves(A)


def test_rows_that_reach_everything_are_eliminated_last():
    A = scattered(3000, 3000, 0, hubs=4)
    tree = elimination_tree(A)
    assert tree.factor_entries < 20 * A.nnz
    assert_solves(A)


def test_rows_of_one_pattern_stay_together():
    of_node = 3
    tree = elimination_tree(grid(40, 40, of_node=of_node))
    nodes = tree.order.reshape(-1, of_node) // of_node
    assert (nodes == nodes[:, :1]).all()
    full = elimination_tree(sp.csr_matrix(np.ones((5 * LEAF_ROWS, 5 * LEAF_ROWS))))
    assert len(full.fronts) == 1


def test_threads_do_not_change_a_bit():
    A = grid(20, 19, 8, of_node=3)
    b = np.random.default_rng(0).standard_normal((A.shape[0], 150))
    solutions = []
    for count in (1, 2):
        with solve_threads(count):
            solutions.append(FrontsFactor(A).solve_once(b))
    np.testing.assert_array_equal(*solutions)


@pytest.mark.parametrize("place", [0, 1000, 2399])
def test_a_matrix_that_is_not_definite_is_refused(place):
    A = grid(20, 20, 6).tolil()
    A[place, place] = -1.0
    with pytest.raises(ConvergenceError, match="not positive") as caught:
        factorise(A.tocsr(), definite=True)
    assert caught.value.status == "singular"
    assert not is_definite(A.tocsr())
    assert is_definite(grid(20, 20, 6))


def test_too_much_fill_is_left_to_superlu(monkeypatch):
    A = grid(20, 20, 6)
    assert type(factorise(A, definite=True)) is FrontsFactor
    assert type(factorise(A)) is SuperLUFactor
    monkeypatch.setattr(factors, "MAX_FILL_RATIO", 1.0)
    assert type(factorise(A, definite=True)) is SuperLUFactor
    assert is_definite(A)
