"""A plot from one file outside the package: drawn by a run, found by results, checked by a number.

The file `my_plot.py` is what one writes; nothing of the package names it.
"""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from study_texts import study_text, sweep_text

import squealstudy as sq
from squealstudy.engine import pictures
from squealstudy.engine.report import report
from squealstudy.engine.report_pictures import images
from squealstudy.errors import ExtensionError, ResultsError

STUDY = (
    study_text("lockin", "{kind}", "hulten")
    + """\
[parameters]
friction = 0.5
"""
    + sweep_text("friction", 0.0, 0.6, 7)
    + """\
[modes]
band = [1.0, 1000.0]
"""
)


@pytest.fixture(autouse=True)
def my_plot(monkeypatch):
    """Registered while a test lasts."""
    monkeypatch.setattr(pictures, "_REGISTERED", dict(pictures.plots()))
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.delitem(sys.modules, "my_plot", raising=False)
    return importlib.import_module("my_plot")


def results_of(tmp_path, kind="complex_modes"):
    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(kind=kind))
    return sq.run(path, tmp_path / "results", jobs=1)


def test_the_plot_is_drawn_and_shows_every_unstable_mode(tmp_path):
    results = results_of(tmp_path)
    figure = results.plot.unstable_by_band(width=50.0)
    assert isinstance(figure, Figure)
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    assert sum(heights) == np.sum(results.modes["unstable"]) > 0
    assert "unstable_by_band" in dir(results.plot)
    assert tmp_path / "unstable_by_band.png" in results.draw(tmp_path)


def test_one_that_fails_is_named_and_the_others_are_drawn(tmp_path):
    """No mode is unstable: the largest of no frequency is no number."""
    path = tmp_path / "study.toml"
    text = STUDY.format(kind="complex_modes").replace("stop = 0.6", "stop = 0.1")
    path.write_text(text)
    results = sq.run(path, tmp_path / "results", jobs=1)
    assert not results.modes["unstable"].any()
    with pytest.raises(ExtensionError, match=r"my_plot\.py: the plot 'unstable_by_band' cannot"):
        results.draw(tmp_path / "drawn")
    assert (tmp_path / "drawn" / "stability_diagram.png").is_file()


def no_figure(results):
    return None


def no_text(results):
    figure = Figure()
    figure.subplots().set_title("$\\frac{$")  # fails when it is written
    return figure


def no_choices(results):
    raise KeyError("\x1b[31m")


@pytest.mark.parametrize("draw", [no_figure, no_text])
def test_what_cannot_be_written_is_named_as_well(tmp_path, monkeypatch, draw):
    """In pictures beside tables, in a page to hand on, and in a notebook."""
    few = {"unstable_by_band": pictures.plots()["unstable_by_band"]}
    monkeypatch.setattr(pictures, "_REGISTERED", few)
    sq.register_plot(points=("friction",))(draw)
    results = results_of(tmp_path)
    said = f"test_plot\\.py: the plot '{draw.__name__}' cannot be drawn"
    with pytest.raises(ExtensionError, match=said):
        results.draw(tmp_path / "drawn")
    assert (tmp_path / "drawn" / "unstable_by_band.png").is_file()
    with pytest.raises(ExtensionError, match=said):
        report([results], shapes=False)
    with pytest.raises(ExtensionError, match=said):
        list(images(results))


def test_choices_that_fail_are_named(tmp_path):
    sq.register_plot(no_choices, points=("friction",))(no_figure)
    with pytest.raises(ExtensionError, match=r"test_plot\.py: the plot 'no_figure' cannot"):
        list(pictures.pictures(results_of(tmp_path)))


def test_results_without_its_tables_have_no_such_picture(tmp_path):
    results = results_of(tmp_path, "sensitivity")
    assert "unstable_by_band" not in dir(results.plot)
    with pytest.raises(ResultsError, match="unstable_by_band needs a table 'modes'"):
        results.plot.unstable_by_band()
    assert not any("unstable_by_band" in path.name for path in results.draw(tmp_path))


def test_a_name_is_given_once_and_an_unknown_one_is_told(tmp_path):
    with pytest.raises(ValueError, match="there is a plot 'evolution' already"):

        @sq.register_plot()
        def evolution(results):
            """Another of that name."""

    with pytest.raises(AttributeError, match=r"no plot 'evolutoin', expected .*evolution"):
        results_of(tmp_path).plot.evolutoin  # noqa: B018
