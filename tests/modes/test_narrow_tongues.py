"""Maps of boundary designs hold tongues that are narrower than the cells of the coarse grid."""

from __future__ import annotations

import numpy as np
import pytest
from matrix_families import write_family
from study_runs import plan_of, solved
from study_texts import study_text, sweep_text
from tongues import TOLERANCE, every_node, families, grid_of, solved_nodes, wrong_nodes

from squealstudy.kinds.complex_modes.passing_modes import NodeModes, PassingModes

HZ = 2 * np.pi


@pytest.mark.full_size  # by default the tongue of a study: below
def test_no_node_of_random_maps_is_wrong():
    """`studies/benchmarks/narrow_tongues.py` has finer ones, and more of them."""
    grid, count = grid_of((5, 4), 3), 11
    missed = wrong = solved_points = unstable = 0
    for family in families(2026, count):
        truth = every_node(family, grid)
        unstable += int((truth > 0).sum())
        missed += wrong_nodes(solved_nodes(family, grid, False), grid, truth) > 0
        known = solved_nodes(family, grid, True)
        wrong += wrong_nodes(known, grid, truth)
        solved_points += len(known)
    assert unstable > 100
    assert missed == 2  # what flat damping at the corners does not show
    assert wrong == 0
    assert solved_points < 0.2 * count * truth.size


def modes_at(C, K) -> NodeModes:
    n = len(K)
    lam, z = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))
    kept = np.flatnonzero(lam.imag > 0)
    kept = kept[np.argsort(np.abs(lam[kept]))]
    return NodeModes(lam[kept], z[:n, kept].T, z[:n, kept].T)


def passing_pair(symmetric: float, skew: float, zeta: tuple[float, float]) -> bool:
    """Whether two oscillators that pass each other on an edge may lock in on it."""
    ends = {}
    for node, shift in (((0,), -0.1), ((8,), 0.1)):
        w = HZ * 100 * np.array([1.0, 1.0 + shift])
        K = np.diag(w**2) + (HZ * 100) ** 2 * np.array(
            [[0.0, symmetric + skew], [symmetric - skew, 0.0]]
        )
        ends[node] = modes_at(np.diag(2 * np.array(zeta) * w), K)
    return PassingModes(ends.__getitem__, TOLERANCE).inside([((0,), (8,))])


def test_modes_pass_unharmed_without_coupling_that_is_not_conservative():
    assert not passing_pair(0.0, 0.0, (0.001, 0.001))
    assert not passing_pair(0.02, 0.0, (0.001, 0.001))  # they veer, or cross if it is less
    assert not passing_pair(0.0, 0.001, (0.01, 0.01))  # lock-in would need a coupling of 2 zeta
    assert not passing_pair(0.0, 0.001, (0.0004, 0.1))  # 2 sqrt(zeta1 zeta2) with unequal damping
    assert passing_pair(0.0, 0.004, (0.001, 0.001))
    assert passing_pair(0.0, 0.004, (0.0001, 0.01))
    assert passing_pair(0.0, 1e-5, (0.0, 0.0))


TONGUE = (
    study_text("tongue", "complex_modes", "hulten")
    + "[parameters]\ndamping_ratio = 0.001\n"
    + sweep_text("friction", 0.01, 0.05, 3)
    + sweep_text("frequency_1", 50.0, 110.0, 4)
    + '[design]\ntype = "boundary"\nlevels = 3\n[modes]\nband = [1.0, 1000.0]\n'
    + "reference_points = 0\nrefine_onsets = false\n"
)


def unstable_hulten(friction, frequency, zeta: float) -> np.ndarray:
    """Unstable modes of each point, by eigenvalues."""
    found = []
    for mu, hz in zip(friction, frequency, strict=True):
        w1, w2 = HZ * hz, HZ * 75.0
        K = np.array([[w1**2, -mu * w2**2], [mu * w1**2, w2**2]])
        A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -2 * zeta * np.diag([w1, w2])]])
        lam = np.linalg.eigvals(A)
        found.append(((lam.imag > 0) & (lam.real > TOLERANCE * np.abs(lam))).sum())
    return np.array(found)


def test_the_tongue_between_the_nodes_of_a_study_is_found(tmp_path):
    """Over a frequency of the structure: at no node of the coarse grid any mode is unstable."""
    results = solved(TONGUE, tmp_path / "r")
    nodes, where = results.nodes
    expected = unstable_hulten(nodes["friction"], nodes["frequency_1"], 0.001)
    assert expected.sum() > 20
    np.testing.assert_array_equal(nodes["n_unstable"], expected)
    assert where.sum() < 0.5 * len(nodes)
    assert f"of the {len(nodes)} nodes of the map ({where.sum()} solved)" in results.screen.verdict(
        results
    )


def test_what_is_told_of_a_stable_map_is_told_of_its_solved_points(tmp_path):
    text = TONGUE.replace("damping_ratio = 0.001", "damping_ratio = 0.1")
    results = solved(text, tmp_path / "r")
    count, nodes = len(results.points), len(results.nodes[0])
    assert count == 12 < nodes
    told = f"at any of the {count} points that were solved, of {nodes} nodes of the map."
    assert told in results.screen.verdict(results)


def test_modes_of_families_are_orthogonal_in_their_mass(tmp_path):
    """Without friction nothing locks in, whatever the mass: no node is asked for."""
    folder = tmp_path
    M = np.array([[2.0, 0.6], [0.6, 1.0]])
    K = (HZ * 100) ** 2 * np.array([[2.0, 0.6], [0.6, 0.7]])
    terms = {
        "M": ("M", M),
        "C": ("C", 0.05 * M),
        "K": ("K", K),
        "T": ("K", (HZ * 100) ** 2 * np.diag([0.0, 0.4])),
        "F": ("K", (HZ * 100) ** 2 * np.array([[0.0, 0.05], [-0.05, 0.0]])),
    }
    head = study_text("family", "complex_modes", "matrices")
    head += write_family(folder, terms, {"T": "t", "F": "mu"})
    head += "[parameters]\nmu = 0.0\nt = 0.0\n"
    head += sweep_text("mu", "LOW", "HIGH", 3) + sweep_text("t", -1.0, 3.0, 4)
    head += '[design]\ntype = "boundary"\nlevels = 3\n[modes]\nband = [1.0, 1000.0]\n'
    head += "reference_points = 0\nrefine_onsets = false\ntrack = false\n"
    calm = head.replace("LOW", "0.0").replace("HIGH", "1e-6")
    results = solved(plan_of(calm, folder / "study.toml"), folder / "calm")
    assert len(results.points) == 12
    rough = head.replace("LOW", "0.2").replace("HIGH", "1.0")
    results = solved(plan_of(rough, folder / "study.toml"), folder / "rough")
    nodes, _ = results.nodes
    expected = []
    for mu, t in zip(nodes["mu"], nodes["t"], strict=True):
        A = terms["K"][1] + mu * terms["F"][1] + t * terms["T"][1]
        block = np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, A), -0.05 * np.eye(2)]]
        )
        lam = np.linalg.eigvals(block)
        expected.append(((lam.imag > 0) & (lam.real > TOLERANCE * np.abs(lam))).sum())
    np.testing.assert_array_equal(nodes["n_unstable"], expected)
    assert (nodes["n_unstable"] > 0).sum() > 0
