"""The map of a method's stability, from a plain table."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from made_results import made

from squealstudy.engine.pictures import save_figure
from squealstudy.errors import ResultsError
from squealstudy.plots.method_stability import CLASSES, tally


def table(boundary=0.5) -> pd.DataFrame:
    """Works where step times slope is below `boundary`."""
    rows = [
        {"step": h, "slope": k, "predicted": h * k / boundary}
        for h, k in itertools.product(np.geomspace(1e-3, 1.0, 9), np.linspace(0.1, 2.0, 8))
    ]
    cells = pd.DataFrame(rows)
    cells["outcome"] = np.where(cells["predicted"] < 1, "converged", "failed")
    cells["by"], cells["flagged"] = "", cells["outcome"] == "failed"
    return cells


def method_stability_map(cells, x="step", y="slope", units=None, title="", boundary="", words=None):
    facts = {"knobs": [x, y], "title": title, "boundary": boundary, "words": words or {}}
    return made("method_stability", units, cells=cells, facts=facts).plot.method_stability()


def labels(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_classes_and_the_boundary(tmp_path):
    cells = table()
    figure = method_stability_map(
        cells, "step", "slope", {"step": "s"}, "a method", "x = 1", {"step": "time step h"}
    )
    axes = figure.axes[0]
    works = int((cells["outcome"] == "converged").sum())
    assert labels(figure) == [
        f"converged ({works})",
        f"failed, said so ({72 - works})",
        "predicted: x = 1",
    ]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("step [s]: time step h", "slope")
    assert f"works in {works} of {works} cells within" in axes.get_title(loc="left")
    (line,) = (c for c in axes.collections if hasattr(c, "levels"))
    vertices = np.concatenate([path.vertices for path in line.get_paths()])
    crossing = vertices[:, 0] * vertices[:, 1]
    assert np.median(crossing) == pytest.approx(0.5, rel=0.05)
    save_figure(figure, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_wrong_without_a_word_is_loud():
    cells = table()
    cells.loc[[3, 5], "outcome"] = "wrong"
    cells.loc[3, "flagged"], cells.loc[5, "flagged"] = True, False
    figure = method_stability_map(cells, "step", "slope")
    assert "WRONG, NOT FLAGGED (1)" in labels(figure)
    (crosses,) = figure.axes[0].lines
    assert crosses.get_xydata().tolist() == [[cells["step"][5], cells["slope"][5]]]
    assert tally(cells).endswith("1 wrong without a warning")
    cells.loc[5, "flagged"] = True
    calm = method_stability_map(cells, "step", "slope")
    assert len(calm.axes[0].lines) == 0
    assert "wrong, flagged (2)" in labels(calm)


def test_a_cell_without_a_prediction_is_not_beyond_the_boundary():
    cells = table()
    beyond = int((cells["predicted"] >= 1).sum())
    failed = cells.index[cells["predicted"] >= 1][0]
    cells.loc[failed, "predicted"] = np.nan
    assert tally(cells).endswith(f"in 0 of {beyond - 1} beyond; 1 cell without a prediction")


def test_who_recovered_is_counted():
    cells = table()
    cells.loc[:2, "outcome"], cells.loc[:1, "by"], cells.loc[2, "by"] = "recovered", "aitken", "x"
    assert "by aitken (2)\nby x (1)" in labels(method_stability_map(cells, "step", "slope"))[1]


def test_every_class_has_its_own_colour():
    assert len({colour for colour, _ in CLASSES.values()}) == len(CLASSES)


@pytest.mark.parametrize("predicted", [np.nan, 0.0, np.inf, 0.5, 2.0])
def test_a_boundary_that_is_not_there(predicted):
    cells = table()
    cells["predicted"] = predicted
    figure = method_stability_map(cells, "step", "slope", boundary="x = 1")
    side = "beyond it throughout" if predicted > 1 else "not crossed"
    assert labels(figure)[-1] == f"predicted: x = 1: {side}"


def test_missing_cells_stay_open():
    figure = method_stability_map(table().drop(index=[7, 20]), "step", "slope")
    mesh = figure.axes[0].collections[0]
    assert np.ma.getmaskarray(mesh.get_array()).sum() == 2


def test_what_cannot_be_drawn():
    with pytest.raises(ResultsError, match="'odd' is none of"):
        method_stability_map(table().assign(outcome="odd"))
    with pytest.raises(ResultsError, match="needs a column 'predicted' in the table 'cells'"):
        method_stability_map(table().drop(columns="predicted"))
