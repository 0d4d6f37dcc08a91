"""What grows outside a study's band is found and said: judged by eigenvalues of numpy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from study_runs import solved
from study_texts import study_text

from squealstudy.kinds.complex_modes.outside_band import spread
from squealstudy.kinds.complex_modes.outside_text import grows_outside, outside_text

HULTEN = (
    study_text("hulten_band", "complex_modes", "hulten")
    + """\
[parameters]
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
values = [0.1, 0.2, 0.8, 0.9]
[modes]
band = [{low}, {high}]
reference_points = 0
"""
)
COLUMNS = ["n_unstable_below", "n_unstable_above", "growth_outside", "frequency_outside_hz"]
# of Hulten's model with these values: 182.600184 1/s at 97.690128 Hz and 206.552633 at 100.116331
GROWING = {0.8: (182.600184, 97.690128), 0.9: (206.552633, 100.116331)}


@pytest.mark.parametrize(
    ("low", "high"), [(1.0, 60.0), (98.5, 500.0), (150.0, 500.0), (1.0, 500.0)]
)
def test_of_few_coordinates_every_growing_mode_is_seen(low, high, tmp_path):
    results = solved(HULTEN.format(low=low, high=high), tmp_path)
    for _, row in results.points.iterrows():
        growth, hz = GROWING.get(row["friction"], (np.nan, np.nan))
        below, above = float(hz < low), float(hz > high)
        told = row[COLUMNS].astype(float).to_numpy()
        outside = below or above
        expected = [below, above, growth if outside else np.nan, hz if outside else np.nan]
        np.testing.assert_allclose(told, expected, rtol=1e-6)
    verdict = results.screen.verdict(results)
    sentence = grows_outside(results.manifest, results.units)
    assert sentence in verdict
    assert bool(sentence) == (not (low < 97 and high > 101))
    if (low, high) == (1.0, 60.0):
        assert sentence.endswith(
            "above 60 Hz 1 mode grows at friction 0.9, where growth is largest: 100 Hz, 207 1/s."
        )
        of_more = results.manifest | {"n_points": 400}  # elsewhere it may grow faster
        text = "at friction 0.9, where growth is largest of the points looked at: 100 Hz, 207 1/s"
        assert text in grows_outside(of_more, results.units)
        assert text in outside_text(of_more, results.units)


FAMILY = """\
[study]
name = "family"
kind = "complex_modes"
[model]
name = "matrices"
folder = "{folder}"
[[model.term]]
matrix = "M"
file = "M.npz"
coefficient = "1"
[[model.term]]
matrix = "C"
file = "C.npz"
coefficient = "1"
[[model.term]]
matrix = "K"
file = "K.npz"
coefficient = "1"
[[model.term]]
matrix = "K"
file = "F.npz"
coefficient = "mu"
[parameters]
mu = 1.0
[[sweep]]
parameter = "mu"
values = [0.2, 0.6, 1.0]
[modes]
band = [100.0, 300.0]
reference_points = 0
"""


@pytest.mark.parametrize(("n", "reach"), [(9, None), (70, 450.0)])
def test_of_a_family_with_many_coordinates_up_to_its_reach(n, reach, tmp_path):
    rng = np.random.default_rng(3)
    M, C = np.eye(n), 4.0 * np.eye(n)
    hz = np.linspace(60.0, 620.0, n)
    K = np.diag((2 * np.pi * hz) ** 2)
    F = rng.normal(size=(n, n))
    F = 1.2e6 * np.sqrt(9 / n) * (F - F.T)  # flutter of several pairs
    for name, A in {"M": M, "C": C, "K": K, "F": F}.items():
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(A))
    results = solved(FAMILY.format(folder=tmp_path), tmp_path / "results")
    seen = 0
    looked = results.points[results.points["n_unstable_above"].notna()]
    assert len(looked) == 3
    for _, row in looked.iterrows():
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-(K + row["mu"] * F), -C]])
        lam = np.linalg.eigvals(A)
        lam = lam[(lam.real > 1e-6 * abs(lam)) & (lam.imag >= 0)]
        f = abs(lam) / (2 * np.pi)
        below, above = lam[f < 100.0], lam[(f > 300.0) & (f < (reach or np.inf))]
        assert row["n_unstable_below"] == len(below)
        assert row["n_unstable_above"] == len(above)
        outside = np.concatenate([below, above])
        if len(outside):
            assert row["growth_outside"] == pytest.approx(outside.real.max(), rel=1e-6)
        seen += len(outside)
    assert seen  # the case shows something
    assert results.manifest["outside_band"]["reach_hz"] == reach
    text = outside_text(results.manifest, results.units)
    assert ("none were sought above 450 Hz" in text) == (reach is not None)
    for low, sides in ((100, "below 100 or above 300"), (0, "above 300")):
        unsearched = {"band_hz": (low, 300), "outside_band": {"looked": 0}}
        assert outside_text(unsearched, {}) == f"no modes were sought {sides} Hz"


def test_points_that_are_looked_at_lie_apart_and_begin_with_the_fastest_growth():
    x = np.linspace(0.0, 1.0, 11)
    X = np.array([(a, 1e6 * b) for a in x for b in x])
    growth = -np.hypot(X[:, 0] - 0.3, X[:, 1] / 1e6 - 1.0)
    rows = np.arange(len(X)) + 7
    chosen = np.array(spread(X, growth, 5, rows)) - 7
    assert tuple(X[chosen[0]]) == pytest.approx((0.3, 1e6))
    corners = {tuple(X[i]) for i in chosen[1:]}
    assert {(1.0, 0.0), (0.0, 0.0)} <= corners
    assert spread(X[:1], growth[:1], 5, rows[:1]) == [7]


def test_older_results_say_nothing_of_it():
    assert outside_text({"band_hz": [1.0, 2.0]}, {}) == ""
    assert grows_outside({"band_hz": [1.0, 2.0]}, {}) == ""


def test_growth_without_oscillation_outside_has_no_frequency_and_half_a_hertz_is_not_none(tmp_path):
    n = 2
    for name, A in {"M": np.eye(n), "C": np.zeros((n, n)), "F": np.zeros((n, n))}.items():
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(A))
    sp.save_npz(tmp_path / "K.npz", sp.csr_matrix(np.diag([-9e4, 1e6])))
    found = solved(FAMILY.format(folder=tmp_path), tmp_path / "r")
    text = "below 100 Hz 1 mode grows at mu {}, where growth is largest: {}, {} 1/s"
    told = text.format(1, "without oscillation", 300)
    assert told in found.screen.verdict(found)
    slow = np.diag([(2 * np.pi * 0.5) ** 2, 1e6])
    sp.save_npz(tmp_path / "K.npz", sp.csr_matrix(slow))
    sp.save_npz(tmp_path / "C.npz", sp.csr_matrix(np.diag([-0.01, 1.0])))
    found = solved(FAMILY.format(folder=tmp_path), tmp_path / "s")
    assert text.format(1, "0.5 Hz", 0.005) in found.screen.verdict(found)


@pytest.mark.parametrize("damping", [0.0, 0.01])
def test_modes_that_do_not_decay_are_told_of(damping, tmp_path):
    text = HULTEN.format(low=1.0, high=500.0).replace("0.01", str(damping))
    results = solved(text, tmp_path)
    facts = dict(results.screen.facts(results))
    if damping:
        assert "undamped" not in facts
    else:  # at friction 0.1 and 0.2, below the onset
        assert facts["undamped"].startswith("at 2 design points a mode that counts as stable")


@pytest.mark.parametrize(("band", "told"), [((100, 1000), True), ((1, 1000), False)])
def test_divergence_is_told_of_whatever_the_band(band, told, tmp_path):
    K, F = np.diag([4e5, 1e6]), np.array([[0.0, 1.5e6], [1.5e6, 0.0]])
    for name, A in {"M": np.eye(2), "C": 5.0 * np.eye(2), "K": K, "F": F}.items():
        sp.save_npz(tmp_path / f"{name}.npz", sp.csr_matrix(A))
    text = FAMILY.format(folder=tmp_path).replace("[100.0, 300.0]", str(list(map(float, band))))
    text = text.replace("values = [0.2, 0.6, 1.0]", "start = 0\nstop = 1\nnum = 11")
    results = solved(text, tmp_path / "results")
    # from mu = sqrt(4e5 * 1e6) / 1.5e6 = 0.4216 on; its root comes into the band at 0.8
    sentence = (
        "diverges, without oscillation, at 6 of 11 design points looked at, within mu 0.5 to 1."
    )
    assert (sentence in results.screen.verdict(results)) == told


def test_what_is_slower_than_was_sought_is_not_said_to_be_stable():
    """A divergence below 1e-5 of the band's top counts as the motion of a free body."""
    facts = {"looked": 2, "reach_hz": None, "below": None, "above": None}
    manifest = {"outside_band": facts, "n_points": 2}
    told = outside_text(manifest | {"band_hz": (500.0, 8000.0)}, {})
    assert told.startswith("nothing grows from 0.08 to 500 Hz or above 8000 Hz at 2 design points")
    told = outside_text(manifest | {"band_hz": (0.0, 1e6)}, {})
    assert told.endswith("; no motion was sought below 10 Hz")
