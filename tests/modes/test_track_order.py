"""Tracks of a study do not depend on the order of its values, nor end where a step is long."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matrix_families import write_family
from reference import oscillating_modes
from study_runs import plan_of, solved
from study_texts import study_text

import squealstudy
from squealstudy.kinds.complex_modes.screen import _legend
from squealstudy.modes.tracking.tree import cross_edges, grid_places, tracking_tree

HZ = 2 * np.pi


# -- neighbours are neighbours in value


@given(st.lists(st.integers(1, 5), min_size=1, max_size=3), st.integers(0, 2**32 - 1))
def test_grid_steps_lead_from_a_value_to_the_next_greater_one(shape, seed):
    rng = np.random.default_rng(seed)
    values = [rng.permutation(np.cumsum(rng.uniform(0.1, 3.0, n))) for n in shape]
    place = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape, order="F"), axis=1)
    x = np.column_stack([v[i] for v, i in zip(values, place.T, strict=True)])
    ranks = np.column_stack(
        [np.argsort(np.argsort(v))[i] for v, i in zip(values, place.T, strict=True)]
    )
    assert np.array_equal(grid_places(x, tuple(shape)), ranks)
    parents = tracking_tree(x, tuple(shape))
    child = np.flatnonzero(parents >= 0)
    assert len(child) == len(x) - 1
    step = ranks[child] - ranks[parents[child]]
    assert (step.sum(axis=1) == 1).all()
    assert (step >= 0).all()
    a, b = cross_edges(x, parents, tuple(shape)).T
    assert (np.abs(ranks[a] - ranks[b]).sum(axis=1) == 1).all()
    edges = sum(int(np.prod(shape)) // n * (n - 1) for n in shape)
    assert len(a) == edges - len(child)


HULTEN = (
    study_text("order", "complex_modes", "hulten")
    + """\
[parameters]
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = FRICTION
[[sweep]]
parameter = "frequency_2"
values = FREQUENCY
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
)
ASCENDING = "[0.1, 0.2, 0.8, 0.9]", "[70.0, 75.0, 80.0]"
UNSORTED = "[0.1, 0.9, 0.2, 0.8]", "[80.0, 70.0, 75.0]"


def test_the_order_of_values_in_the_file_changes_nothing(tmp_path):
    found = []
    for k, (friction, frequency) in enumerate((ASCENDING, UNSORTED)):
        text = HULTEN.replace("FRICTION", friction).replace("FREQUENCY", frequency)
        found.append(solved(text, tmp_path / str(k)))
    tables = []
    for results in found:
        where = results.points[["point_id", "friction", "frequency_2"]]
        modes = results.modes.merge(where, on="point_id")
        columns = ["friction", "frequency_2", "mode", "track", "track_ambiguous", "track_mac"]
        tables.append(modes[columns].sort_values(columns[:3]).to_numpy(float))
    np.testing.assert_allclose(tables[1], tables[0], rtol=1e-9)
    columns = ["track", "onset", "frequency_2", "frequency_hz"]
    onsets = [r.onsets.sort_values(["frequency_2", "track"])[columns] for r in found]
    np.testing.assert_allclose(onsets[1], onsets[0], rtol=1e-9)
    columns = ["unstable_share", "max_growth_rate", "threshold"]
    ranked = [r.rank()[columns] for r in found]
    np.testing.assert_allclose(ranked[1], ranked[0], rtol=1e-9)
    assert ranked[1]["unstable_share"].tolist() == [0.5]  # one mode, not two of a quarter each


# -- modes that move far in one step


def one_mode(folder: Path, values: list[float], more: str = "", damping: str = "-1") -> str:
    """M = 1, C of a coefficient, K = (2 pi f)^2 over f."""
    terms = {"M": ("M", 1.0), "C": ("C", 1.0), "K": ("K", HZ**2)}
    text = study_text("one", "complex_modes", "matrices")
    text += write_family(folder, terms, {"C": damping, "K": "f*f"})
    text += f'[parameters]\nf = 100.0\n[[sweep]]\nparameter = "f"\nvalues = {values}\n'
    return text + f"[modes]\nband = [20.0, 3000.0]\nreference_points = 0\n{more}"


def run_family(text: str, folder: Path) -> squealstudy.Results:
    return solved(plan_of(text, folder / "study.toml"), folder / "results")


@pytest.mark.parametrize("values", [[100.0, 130.0, 170.0], [170.0, 100.0, 130.0], [100.0, 300.0]])
def test_one_degree_of_freedom_is_one_mode_however_far_it_moves(values, tmp_path):
    results = run_family(one_mode(tmp_path, values), tmp_path)
    assert results.modes["track"].tolist() == [1] * len(values)
    ranked = results.rank()
    assert ranked["unstable_share"].tolist() == [1.0]
    assert results.onsets["status"].tolist() == ["below_range"]
    assert results.screen.verdict(results).startswith("1 mode is unstable between ")
    assert not results.modes["track_ambiguous"].any()


@pytest.mark.parametrize("more", ["refine_points = 0\n", "refine_tracking = false\n"])
def test_what_is_not_refined_is_flagged_and_no_onset(more, tmp_path):
    results = run_family(one_mode(tmp_path, [100.0, 130.0, 170.0], more), tmp_path)
    assert results.modes["track"].nunique() == 3
    assert results.modes["track_ambiguous"].all()
    assert sorted(results.onsets["status"]) == ["below_range", "broken", "broken"]
    assert results.onsets[["onset", "bracket_low"]].isna().all(axis=None)
    assert (results.onsets["direction"] == "in").all()  # the mode grows on under another number
    ranked = results.rank().set_index("track")
    assert ranked["threshold_kind"].tolist().count("broken") == 2
    assert ranked["ambiguous"].all()
    assert "beside one that ends" in " ".join(_legend(results.rank(), results, None))


def test_a_mode_beyond_the_smallest_steps_is_flagged(tmp_path):
    results = run_family(one_mode(tmp_path, [100.0, 2000.0]), tmp_path)
    assert results.modes["track_ambiguous"].all()
    assert sorted(results.onsets["status"]) == ["below_range", "broken"]


def test_the_onset_of_a_mode_that_moves_far_in_the_step(tmp_path):
    """C = 1000 - 8 f vanishes at 125 Hz; from 100 to 160 Hz the mode moves by 60 %."""
    text = one_mode(tmp_path, [100.0, 160.0, 161.0], damping="1000 - 8*f")
    (row,) = run_family(text, tmp_path).onsets.to_dict("records")
    assert row["status"] == "refined"
    assert row["onset"] == pytest.approx(125.0, abs=row["error_estimate"])


def followed_growth(family, start: float, stop: float, count: int = 4000) -> np.ndarray:
    """Growth of each mode of a family in small steps, by the nearest root (count, m)."""
    steps = np.linspace(start, stop, count)
    roots = [family(x)[0] for x in steps]
    rows = [roots[0]]
    for lam in roots[1:]:
        ahead = 2 * rows[-1] - rows[-2] if len(rows) > 1 else rows[-1]
        rows.append(lam[np.abs(ahead[:, None] - lam).argmin(axis=1)])
    return steps, np.array(rows)


def random_family(rng: np.random.Generator, n: int = 6):
    """M = 1; damping, springs and a skew coupling that grows with mu: modes move and lock in."""
    w = HZ * np.sort(rng.uniform(80.0, 900.0, n))
    A, B = rng.normal(size=(2, n, n))
    K = np.diag(w**2) + 0.05 * (A + A.T) * np.sqrt(np.outer(w**2, w**2))
    F = 0.15 * B * np.sqrt(np.outer(w**2, w**2))
    C = np.diag(2 * 0.01 * w)
    return {"M": ("M", np.eye(n)), "C": ("C", C), "K": ("K", K), "F": ("K", F)}


def test_unsorted_and_unequal_values_of_random_families_give_the_tracks_of_small_steps(tmp_path):
    """Where no mode is flagged, a track holds one mode of a continuation in steps of 1/4000."""
    wrong = checked = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        terms = random_family(rng)
        values = rng.permutation(np.sort(rng.uniform(0.02, 1.0, 9)))
        folder = tmp_path / str(seed)
        folder.mkdir()
        text = study_text("family", "complex_modes", "matrices")
        text += write_family(folder, terms, {"F": "mu"})
        text += f'[parameters]\nmu = 1.0\n[[sweep]]\nparameter = "mu"\nvalues = {values.tolist()}\n'
        text += "[modes]\nband = [5.0, 5000.0]\nreference_points = 0\nrefine_onsets = false\n"
        results = run_family(text, folder)
        C, K, F = (np.asarray(terms[name][1]) for name in "CKF")
        steps, followed = followed_growth(
            lambda mu, C=C, K=K, F=F: oscillating_modes(C, K + mu * F), values.min(), values.max()
        )
        modes = results.modes.merge(results.points[["point_id", "mu"]], on="point_id")
        modes = modes[modes["track"] > 0].sort_values("mu")
        for _, track in modes.groupby("track"):
            if track["track_ambiguous"].any():
                continue
            at = np.abs(steps[:, None] - track["mu"].to_numpy()).argmin(axis=0)
            lam = track["growth_rate"].to_numpy() + 1j * HZ * track["frequency_hz"].to_numpy()
            lam = lam.real + 1j * np.sqrt(np.abs(lam.imag) ** 2 - lam.real**2)
            number = np.abs(followed[at] - lam[:, None]).argmin(axis=1)
            same = np.abs(followed[at, number[0]] - lam) < 2e-3 * np.abs(lam)
            wrong += not same.all()
            checked += 1
    assert checked > 10
    assert wrong == 0
