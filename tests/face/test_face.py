"""The Python face: models, studies, runs and results as a user of the package meets them."""

from __future__ import annotations

import inspect
import pickle
import re
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import squealstudy as sq
from squealstudy.engine.manifest_file import write_manifest
from squealstudy.engine.pictures import plots
from squealstudy.errors import ParameterError, ResultsError, SquealstudyError, StudyFileError

FREQUENCY = """# over friction
[study]
name = "lockin"
kind = "complex_modes"
[model]
name = "hulten"
[parameters]
damping_ratio = 0.01
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 13
[modes]
band = [1.0, 1000.0]
"""
TIME = """[study]
name = "belt"
kind = "transient"
[model]
name = "belt"
[[sweep]]
parameter = "sliding_speed"
values = [0.8, 1.3]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.4
step = 1e-4
"""
METHODS = """[study]
name = "methods"
kind = "work_precision"
[work_precision]
base = "study.toml"
points = 1
repeats = 1
[reference]
set = {"modes.method" = "full"}
[[method]]
name = "dense"
set = {"modes.method" = "dense"}
"""
CELLS = """[study]
name = "cells"
kind = "method_stability"
[method_stability]
case = "coalescence"
[[knob]]
name = "anchor"
start = 0.0
stop = 0.6
num = 3
[[knob]]
name = "step"
start = 1e-3
stop = 1.0
num = 3
scale = "log"
"""
SCATTER = FREQUENCY.replace("num = 13\n", "") + '[design]\ntype = "latin_hypercube"\nsamples = 16\n'
SOBOL = (
    SCATTER.replace("latin_hypercube", "sobol_indices")
    .replace("[modes]", '[[sweep]]\nparameter = "damping_ratio"\nstart = 0.0\nstop = 0.02\n[modes]')
    .replace("damping_ratio = 0.01\n", "", 1)
)
SENSITIVITY = FREQUENCY.replace("complex_modes", "sensitivity").replace("num = 13", "num = 3")
KINDS = {
    "complex_modes": FREQUENCY,
    "transient": TIME,
    "sensitivity": SENSITIVITY,
    "work_precision": METHODS,
    "method_stability": CELLS,
    "robust": SOBOL,
}


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, sq.Results]:
    folder = tmp_path_factory.mktemp("face")
    (folder / "study.toml").write_text(FREQUENCY)
    found = {}
    for kind, text in KINDS.items():
        path = folder / f"{kind}.toml"
        path.write_text(text)
        found[kind] = sq.run(path, folder / kind, jobs=1, warn=lambda text: None)
    return found


@pytest.fixture
def study(tmp_path) -> sq.Study:
    path = tmp_path / "study.toml"
    path.write_text(FREQUENCY)
    return sq.read_study(path)


def test_the_package_is_imported_lightly():
    code = "import squealstudy, sys; print({'pandas', 'scipy', 'numba'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
    assert set(sq.__all__) <= set(dir(sq))
    for name in sq.__all__:
        assert getattr(sq, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        sq.runn  # noqa: B018


# -- models


def test_modes_of_a_model_lock_in_where_the_closed_form_says():
    """Hulten's model without damping: mu_c = |w1^2 - w2^2| / (2 w1 w2)."""
    values = sq.model("hulten").parameters["value"]
    w1, w2 = values["frequency_1"], values["frequency_2"]
    onset = abs(w1**2 - w2**2) / (2 * w1 * w2)
    model = sq.model("hulten", damping_ratio=0.0)
    below, above = (model.with_(friction=f * onset).modes((1.0, 1e3)) for f in (0.99, 1.01))
    assert not below["unstable"].any()
    assert above["unstable"].sum() == 1
    assert above["growth_rate"].sum() == pytest.approx(0.0, abs=1e-6)
    assert {"error_rung", "error_reduction", "damping_ratio"} <= set(above)
    assert above.attrs["units"]["growth_rate"] == "1/s"


def test_a_changed_model_leaves_the_first_as_it_is():
    model = sq.model("hulten", friction=0.3)
    other = model.with_(friction=0.4)
    assert model.parameters.loc["friction", "value"] == 0.3
    assert other.parameters.loc["friction", "value"] == 0.4
    assert set(model.parameters["unit"]) >= {"", "Hz"}
    assert len(sq.model("disc_brake", mesh="coarse").options) > 0
    own = model.component_modes(1e6)
    assert own["frequency_hz"].notna().all()
    assert {"hulten", "disc_brake", "matrices"} <= set(sq.list_models())


@pytest.mark.parametrize(
    ("ask", "kind", "told"),
    [
        (lambda: sq.model("hultn"), SquealstudyError, "did you mean 'hulten'"),
        (lambda: sq.model("matrices"), SquealstudyError, "files that its study names"),
        (lambda: sq.model("hulten", frction=0.5), ParameterError, "'frction'"),
        (lambda: sq.model("hulten", friction=-1.0), ParameterError, "at least 0"),
        (lambda: sq.model("disc_brake", mesh="huge"), ParameterError, "expected one of .*coarse"),
    ],
)
def test_what_a_model_does_not_have_is_told(ask, kind, told):
    with pytest.raises(kind, match=told):
        ask()


# -- studies


def test_a_changed_study_is_another_one(study, tmp_path):
    changed = study.with_({"sweep[1].num": 3, "modes.band": [1, 500], "parameters": None})
    assert [s.resolved.definition.sweep[0].num for s in (study, changed)] == [13, 3]
    assert changed.resolved.definition.modes.band == (1.0, 500.0)
    assert not changed.resolved.definition.parameters
    again = changed.with_({"modes.method": "dense"})
    assert again.resolved.definition.modes.band == (1.0, 500.0)  # earlier changes stay
    first, second = (
        sq.run(s, tmp_path / s.text[-30:].strip()[-5:], jobs=1) for s in (study, again)
    )
    assert first.manifest["study_hash"] != second.manifest["study_hash"]
    assert (len(first.points), len(second.points)) == (13, 3)
    assert first.manifest["study"] == FREQUENCY  # comments and all
    path = tmp_path / "again.toml"
    path.write_text(second.manifest["study"])
    assert sq.read_study(path).tables == again.tables


@pytest.mark.parametrize(
    ("changes", "key", "told"),
    [
        ({"modes.band": [2, 1]}, "modes.band", "low < high"),
        ({"modes.bnd": [1, 2]}, "modes.bnd", "unknown key"),
        ({"sweep[2].num": 3}, "sweep[2].num", "is no single table"),
        ({"sweep.num": 3}, "sweep.num", "is no single table"),
        ({"parameters.frction": 1.0}, "parameters.frction", "friction"),
    ],
)
def test_errors_of_a_change_name_file_and_key(study, changes, key, told):
    with pytest.raises(StudyFileError, match=told) as caught:
        study.with_(changes)
    assert caught.value.path == study.source.path
    assert caught.value.key == key


def test_a_file_that_is_wrong_is_told_with_its_line(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(FREQUENCY.replace("num = 13", "nm = 13"))
    with pytest.raises(StudyFileError, match=r"bad.toml, line 13, key 'sweep\[1\].nm'"):
        sq.run(path)
    path.write_text(TIME)
    study = sq.read_study(path)
    with pytest.raises(StudyFileError, match="expected sensitivity or complex_modes"):
        study.sensitivities()


def test_a_second_run_solves_nothing(study, tmp_path):
    first, second = (sq.run(study, tmp_path / "r", jobs=1) for _ in range(2))
    assert (first.solved, second.solved) == (13, 0)
    assert sq.open_results(tmp_path / "r").solved is None


# -- results


def numeric(table: pd.DataFrame) -> set[str]:
    kept = table.select_dtypes("number")
    return set(kept.columns)


@pytest.mark.parametrize("kind", KINDS)
def test_every_numeric_column_has_its_unit(results, kind):
    found = results[kind]
    tables = {name: found.table(name) for name in found.tables}
    if kind in ("complex_modes", "transient"):
        tables["ranking"] = found.rank()
    if kind == "transient":
        tables["history"] = found.history(0)
        tables["comparison"] = None
    if kind == "robust":
        tables |= {"robust": found.robust(), "indices": found.sobol_indices()}
    for name, table in tables.items():
        if table is not None:
            missing = numeric(table) - set(table.attrs["units"])
            assert not missing, (name, missing)


@pytest.mark.parametrize("kind", KINDS)
def test_tables_have_units_in_their_files(results, kind):
    """As a reader without squealstudy finds them, beside what pandas keeps there."""
    found = results[kind]
    for name in found.tables:
        schema = pq.read_schema(found.directory / f"{name}.parquet")
        metadata = {field.name: field.metadata or {} for field in schema}
        told = {n: facts[b"unit"].decode() for n, facts in metadata.items() if b"unit" in facts}
        assert told == found.table(name).attrs["units"], name
    if kind == "transient":
        (path, *_) = (found.directory / "histories").glob("*.parquet")
        assert pq.read_schema(path).field("energy").metadata[b"unit"] == b"J"


def test_units_are_those_of_the_quantity(results):
    units = results["transient"].points.attrs["units"]
    assert (units["torque_rms"], units["sliding_speed"], units["growth_rate"]) == (
        "N",
        "m/s",
        "1/s",
    )
    modes = results["complex_modes"].modes.attrs["units"]
    assert (modes["frequency_hz"], modes["damping_ratio"], modes["error_rung"]) == ("Hz", "", "1/s")
    onsets = results["complex_modes"].onsets.attrs["units"]
    assert (onsets["onset"], onsets["error_estimate"]) == ("", "")  # of the friction
    assert modes["error_estimate"] == "1/s"
    assert results["transient"].history(0).attrs["units"]["energy"] == "J"


@pytest.mark.parametrize("kind", KINDS)
def test_plots_are_figures(results, kind):
    found = results[kind]
    names = dir(found.plot)
    assert names
    drawn = 0
    for name in names:
        if name == "robust" and kind != "robust":
            continue
        if name == "stability_map" and kind != "robust":
            with pytest.raises(ResultsError, match="two parameters that vary"):
                found.plot.stability_map()
            continue
        figure = getattr(found.plot, name)()
        assert isinstance(figure, Figure), name
        drawn += 1
    assert drawn


@pytest.mark.parametrize("kind", KINDS)
def test_plots_are_methods_with_their_own_arguments(results, kind):
    """Completion and help of editors and notebooks show what a plot takes."""
    found = results[kind]
    for name in dir(found.plot):
        method = getattr(found.plot, name)
        own = list(inspect.signature(method).parameters)
        text = inspect.getdoc(method)
        assert "results" not in own
        assert "results :" not in text, name
        assert f"\nReturns\n{7 * '-'}\nmatplotlib.figure.Figure\n" in f"{text}\n", name
        assert all(re.search(rf"^(\w+, )?{word}(, \w+)? : ", text, re.M) for word in own), name
    evolution = results["complex_modes"].plot.evolution
    assert list(inspect.signature(evolution).parameters) == ["along", "fixed", "show", "ax"]
    assert isinstance(evolution("friction", show="growth_rate"), Figure)


def test_a_notebook_shows_a_plot_without_pyplot(results):
    figure = results["complex_modes"].plot.evolution("friction")
    assert figure._repr_png_().startswith(b"\x89PNG")
    again = pickle.loads(pickle.dumps(figure))
    assert again._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("kind", KINDS)
def test_plots_are_drawn_in_axes_of_the_user(results, kind):
    found = results[kind]
    for name in dir(found.plot):
        _, choices = next(iter(plots()[name].pictures(found)), ("", {}))
        figure = Figure(figsize=(24, 10))
        left, right = figure.subplots(1, 2)
        assert getattr(found.plot, name)(ax=left, **choices) is figure, name
        drawn = [axes for axes in figure.findobj(Axes) if axes is not right]
        assert any(axes.has_data() for axes in drawn), name
        assert not right.has_data(), name
        figure.savefig(BytesIO())
    if kind == "complex_modes":
        figure = Figure()
        axes = figure.subfigures(1, 2)[0].subplots()
        assert found.plot.evolution("friction", show="frequency_hz", ax=axes) is figure
        with pytest.raises(ResultsError, match="did you mean 'frequency_hz'"):
            found.plot.evolution("friction", show="frequency", ax=axes)


@pytest.mark.parametrize("kind", KINDS)
def test_dir_shows_what_is_public_and_there(results, kind):
    found = results[kind]
    names = dir(found)
    assert not any(name.startswith("_") for name in names)
    assert {"plot", "rank", "table", *found.tables} <= set(names)
    for name in names:
        getattr(found, name)
    assert ("history" in names) == (kind == "transient")
    assert ("onsets" in names) == (kind in ("complex_modes", "robust"))
    assert ("sobol_indices" in names) == (kind == "robust")
    assert "store" not in names


@pytest.mark.full_size  # by default a picture: above
def test_a_notebook_shows_ranking_and_picture(results):
    pages = {kind: found._repr_html_() for kind, found in results.items()}
    html = pages["complex_modes"]
    assert "share of the 13 solved points" in html
    assert "data:image/png;base64," in html
    assert "worst at" in html
    assert "limit cycle" in pages["transient"]
    assert all("<pre>" in page for page in pages.values())


def test_what_a_kind_does_not_have_is_told(results):
    with pytest.raises(ResultsError, match="a sensitivity study has no table 'modes', it has"):
        results["sensitivity"].modes  # noqa: B018
    with pytest.raises(ResultsError, match="a complex_modes study has no histories"):
        results["complex_modes"].history(0)
    with pytest.raises(
        ResultsError,
        match="expected results of kind complex_modes or limit_cycles and of kind transient",
    ):
        results["transient"].compare(results["transient"])
    with pytest.raises(AttributeError, match=r"no plot 'evoluton'.*did you mean 'evolution'"):
        results["complex_modes"].plot.evoluton()


def test_results_of_an_unknown_kind_are_one_clear_error(results, tmp_path):
    manifest = results["complex_modes"].manifest
    write_manifest(tmp_path, manifest | {"kind": "of_tomorrow"})
    with pytest.raises(ResultsError, match="kind 'of_tomorrow', which is not known here"):
        sq.open_results(tmp_path)


def test_comparison_of_two_studies(tmp_path):
    (tmp_path / "t.toml").write_text(TIME)
    time = sq.run(tmp_path / "t.toml", tmp_path / "t", jobs=1, warn=lambda text: None)
    study = sq.read_study(tmp_path / "t.toml")
    modes = study.with_({"study.kind": "complex_modes", "study.name": "f", "transient": None})
    frequency = sq.run(modes, tmp_path / "f", jobs=1)
    table, other = frequency.compare(time), time.compare(frequency)
    pd.testing.assert_frame_equal(table, other)
    assert not numeric(table) - set(table.attrs["units"])
    assert np.isfinite(table["growth_rate"]).any()


def test_the_command_does_the_same(results, tmp_path, monkeypatch, capsys):
    from squealstudy.cli import app as cli

    cli.rank(results["complex_modes"].directory, csv=True)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split(",") == list(results["complex_modes"].rank().columns)
    monkeypatch.chdir(tmp_path)
    cli.new(Path("start.toml"), "hulten")
    cli.check(Path("start.toml"))
    assert "valid" in capsys.readouterr().out


def test_values_and_sweeps_of_a_study_are_changed_by_their_names(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(FREQUENCY)
    study = sq.read_study(path)

    def value(changed, name):
        return changed.resolved.values[name]  # noqa: PD011 - of a study

    swept = study.with_(friction=np.array([0.1, 0.3, 0.5]))
    assert swept.tables["sweep"] == [{"parameter": "friction", "values": [0.1, 0.3, 0.5]}]
    more = swept.with_({"study.name": "more"}, frequency_1=["90 Hz", 0.1e3], damping_ratio=0.02)
    first, second = more.resolved.sweeps
    assert (first.name, second.name) == ("friction", "frequency_1")
    assert (second.low, second.high) == (90.0, 100.0)
    assert value(more, "damping_ratio") == 0.02
    assert more.tables["study"]["name"] == "more"
    single = more.with_(friction=0.4, frequency_1=None, contact_law="cubic")
    assert "sweep" not in single.tables
    assert value(single, "friction") == 0.4
    assert single.resolved.options["contact_law"] == "cubic"
    law = "contact.cubic_stiffness"
    changed = single.with_(**{law: [0.0, -1e17]})
    assert changed.resolved.sweeps[0].name == law
    assert value(changed.with_(**{law: 2.0}), law) == 2.0
    scale = "mass.modes[1].frequency_scale"
    assert value(study.with_(**{scale: 1.0}), scale) == 1.0
    assert study.tables["sweep"][0]["num"] == 13
    with pytest.raises(StudyFileError, match="did you mean 'friction'"):
        study.with_(fricton=[0.1, 0.2])


def test_a_study_of_methods_has_no_parameters_to_change(tmp_path):
    (tmp_path / "study.toml").write_text(FREQUENCY)
    path = tmp_path / "methods.toml"
    path.write_text(METHODS)
    with pytest.raises(StudyFileError, match="change those of its base"):
        sq.read_study(path).with_(friction=0.3)


def test_a_model_is_swept_into_one_table():
    """Against the closed form of Hulten's model, and point by point."""
    model = sq.model("hulten")
    table = model.sweep((1.0, 1e3), friction=np.linspace(0.0, 0.6, 61))
    least = table[table["unstable"]]["friction"].min()
    assert least == pytest.approx(0.30)  # (100^2 - 75^2) / (2 100 75) = 0.2917
    assert table.attrs["units"]["growth_rate"] == "1/s"
    grid = model.sweep((1.0, 1e3), friction=[0.4, 0.5, 0.6], frequency_2=["70 Hz", "80 Hz"])
    points = grid.drop_duplicates("point").set_index("point")
    assert points["friction"].tolist() == [0.4, 0.5, 0.6] * 2  # the first varies fastest
    assert points["frequency_2"].tolist() == [70.0] * 3 + [80.0] * 3
    own = model.with_(friction=0.6, frequency_2=70.0).modes((1.0, 1e3))
    mine = grid[(grid["point"] == 2).to_numpy()]
    np.testing.assert_allclose(mine["growth_rate"], own["growth_rate"], rtol=1e-9)
    assert len(model.sweep(friction=0.5)) == 2
    lifted = sq.model("hulten").sweep(friction=[0.5, 1.5])
    assert (0 in set(lifted["point"])) != (0 in lifted.attrs["failed"])
    with pytest.raises(ParameterError, match="got '7 hz', whose unit is not known"):
        model.sweep(frequency_2=["70 Hz", "7 hz"])


def test_unknown_columns_and_names_of_results_are_one_sentence(tmp_path, monkeypatch):
    monkeypatch.delenv("SQUEALSTUDY_DEBUG", raising=False)
    study = sq.model("hulten").study("names", band=(10.0, 1e3)).with_(friction=[0.2, 0.5])
    results = sq.run(study, tmp_path / "names", jobs=1)
    points = results.points
    assert type(points[points["friction"] > 0.3]) is type(points.merge(points)) is pd.DataFrame
    assert points.get("frction") is None  # as pandas has it
    assert not hasattr(results, "modez")
    for wrong, said in (
        (lambda: points["frction"], "this table has no column 'frction'; did you mean 'friction'?"),
        (lambda: points[["friction", "zz"]], "this table has no column 'zz'; it has point_id, "),
        (lambda: results.modez, "results have nothing named 'modez'; did you mean 'modes'"),
        (lambda: results.qqq, "results have nothing named 'qqq'; there are along, "),
        (lambda: results.plot.evolutoin, "there is no plot 'evolutoin'"),
    ):
        with pytest.raises((KeyError, AttributeError)) as caught:
            wrong()
        line, sentence = caught.value._render_traceback_()
        assert line.startswith("line ")
        assert sentence.partition(": ")[2].startswith(said)
        assert str(caught.value).startswith(said)
    with pytest.raises(AttributeError, match="did you mean 'read_study'"):
        sq.read_studdy  # noqa: B018


def test_a_notebook_shows_the_sentence_and_the_line_that_called_for_it(monkeypatch):
    monkeypatch.delenv("SQUEALSTUDY_DEBUG", raising=False)
    with pytest.raises(ParameterError) as caught:
        sq.model("hulten", fricton=0.3)
    line, sentence = caught.value._render_traceback_()
    assert line.endswith(': sq.model("hulten", fricton=0.3)')
    assert sentence.startswith("ParameterError: parameter 'fricton': ")
    monkeypatch.setenv("SQUEALSTUDY_DEBUG", "1")
    assert "Traceback" in caught.value._render_traceback_()[0]


def test_values_of_a_model_have_units():
    model = sq.model("belt", normal_force="2 kN", sliding_speed="-300 mm/s")
    assert model.given == {"normal_force": 2000.0, "sliding_speed": -0.3}
    assert model.with_(normal_force="3 N").given["normal_force"] == 3.0
    for text, message in (
        ("12 bar", "is in N: got '12 bar'"),
        ("12", "expected a number and its unit"),
        ("12 Nm", "whose unit is not known"),
        ("-2 N", "expected"),
    ):
        with pytest.raises(ParameterError, match=message):
            sq.model("belt", normal_force=text)
    with pytest.raises(ParameterError, match="expected one of"):
        sq.model("belt", friction_law="2 kN")


def test_misspelt_values_get_what_was_meant():
    """Of units those that the parameter can have; of options theirs."""
    for name, given, meant in (
        ("pressure", "12 bra", "'bar'"),
        ("mesh", "corse", "'coarse'"),
    ):
        with pytest.raises(ParameterError, match=rf"did you mean {meant}\?$"):
            sq.model("disc_brake", **{name: given})
