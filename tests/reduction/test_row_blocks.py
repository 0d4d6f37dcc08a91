"""Sums of products of matrices whose rows see a part of the coordinates only."""

from __future__ import annotations

import numpy as np
import pytest

from squealstudy.system.parametric import DAMPING, STIFFNESS, ParametricSystem, Term
from squealstudy.system.row_blocks import MOST_BLOCKS, blocks_of

N = 120


def in_blocks(seed: int, rows: int = 90) -> np.ndarray:
    """Rows in turn of three kinds: two runs of columns, one run, and none at all."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((rows, N))
    A[0::3, 30:70] = 0.0
    A[1::3, :55] = 0.0
    A[2::3] = 0.0
    return A


def test_blocks_are_rows_that_see_the_same_columns():
    blocks = blocks_of([in_blocks(0), in_blocks(1)])
    found = {tuple(b.rows.tolist()): [(s.start, s.stop) for _, s in b.runs] for b in blocks}
    assert found == {
        tuple(range(0, 90, 3)): [(0, 30), (70, N)],
        tuple(range(1, 90, 3)): [(55, N)],
    }
    other = in_blocks(1)
    other[1::3, 3] = 1.0  # what one of the matrices sees belongs to the block of both
    runs = {
        b.rows[0]: [(s.start, s.stop) for _, s in b.runs] for b in blocks_of([in_blocks(0), other])
    }
    assert runs[1] == [(3, 4), (55, N)]


def test_there_are_no_blocks_where_they_save_nothing():
    rng = np.random.default_rng(0)
    assert blocks_of([rng.standard_normal((90, N))]) == ()
    assert blocks_of([rng.standard_normal((90, 20)) * (np.arange(90)[:, None] % 2)]) == ()
    assert blocks_of([np.zeros((0, N))]) == ()
    scattered = np.eye(N)[: MOST_BLOCKS + 1]
    assert blocks_of([scattered]) == ()
    assert len(blocks_of([scattered[:MOST_BLOCKS]])) == MOST_BLOCKS


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sums_are_those_of_whole_products(sign):
    rng = np.random.default_rng(2)
    A, B, full = in_blocks(3), in_blocks(4), rng.standard_normal((7, N))
    terms = (
        Term(STIFFNESS, None, None),
        Term(STIFFNESS, A, A),
        Term(STIFFNESS, B, A),
        Term(DAMPING, B, B),
        Term(DAMPING, A, A),
        Term(DAMPING, full, full),
    )
    weights = (
        rng.uniform(1, 2, N),
        *(sign * rng.uniform(0, 1, 90) for _ in range(4)),
        rng.uniform(0, 1, 7),
    )
    system = ParametricSystem(N, terms)
    for numbers in ([0, 1, 2], [1], [2], [3, 4, 5], range(6)):
        expected = np.zeros((N, N))
        for i in numbers:
            left, right = (np.eye(N) if s is None else s for s in (terms[i].left, terms[i].right))
            expected += left.T @ np.diag(weights[i]) @ right
        found = system.summed(weights, numbers)
        assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()
    scalar = (1.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    assert np.allclose(system.summed(scalar, range(6)), np.eye(N) + 2.0 * A.T @ A)
