"""What a map draws of the boundary of stability between the lines on which it was solved."""

from __future__ import annotations

import numpy as np
import pytest
from matrix_families import write_family
from scipy.optimize import brentq
from study_runs import plan_of, solved
from study_texts import study_text, sweep_text

from squealstudy.engine.pictures import save_figure

K = np.array([[1.1e6, -3e5], [-3e5, 9e5]])
F = np.array([[0.0, 6e5], [0.0, 0.0]])
C = np.diag([20.0, 2.0])


@pytest.fixture(scope="module")
def destabilised(tmp_path_factory):
    """Unequal damping lowers the onset from .5556 without any to .518 with ever so little."""
    folder = tmp_path_factory.mktemp("destabilised")
    text = study_text("destabilised", "complex_modes", "matrices")
    terms = {"M": ("M", np.eye(2)), "K": ("K", K), "F": ("K", F), "C": ("C", C)}
    text += write_family(folder, terms, {"F": "mu", "C": "a"})
    text += "[parameters]\nmu = 0.5\na = 0.0\n" + sweep_text("mu", 0.4, 0.7, 7)
    text += '[[sweep]]\nparameter = "a"\nvalues = [0.0, 0.5, 1.0]\n'
    text += "[modes]\nband = [1.0, 1000.0]\nreference_points = 0\n"
    return solved(plan_of(text, folder / "study.toml"), folder / "results")


def onset(a: float) -> float:
    """Of the fastest mode, by eigenvalues."""

    def growth(mu: float) -> float:
        block = np.block([[np.zeros((2, 2)), np.eye(2)], [-(K + mu * F), -a * C]])
        return float(np.linalg.eigvals(block).real.max()) - 1e-4  # round-off without damping

    return float(brentq(growth, 0.45, 0.6, xtol=1e-9))


def test_the_boundary_is_dashed_between_the_onsets_that_were_solved(destabilised, tmp_path):
    assert onset(0.0) == pytest.approx(5 / 9, abs=1e-4)
    assert onset(0.01) == pytest.approx(onset(0.5), abs=2e-3)  # it jumps between the lines
    figure = destabilised.plot.stability_map(x="mu", y="a")
    axes = figure.axes[0]
    (dots,) = [line for line in axes.lines if line.get_marker() == "o"]
    mu, a = dots.get_data()
    assert sorted(a) == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(mu, [onset(each) for each in a], atol=1e-4)
    (joined,) = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert len(joined.get_xdata()) > 3
    solid = [line for line in axes.lines if line.get_linestyle() == "-"]
    assert all(line.get_path_effects() for line in solid)  # ticks alone
    (legend,) = figure.legends
    texts = " ".join(text.get_text() for text in legend.get_texts())
    assert "dashed where joined, not solved" in texts
    assert "onset, refined" in texts
    assert "a cell is coloured by the point in it" in texts
    save_figure(figure, tmp_path / "map.png")
