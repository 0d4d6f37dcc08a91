"""Results of an earlier version of squealstudy, whose models gave other numbers."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest
from study_texts import study_text
from typer.testing import CliRunner

import squealstudy
from squealstudy.cli.app import app
from squealstudy.engine.manifest import outdated
from squealstudy.engine.manifest_file import read_manifest, write_manifest
from squealstudy.linalg.factor import MODULES
from squealstudy.models.catalogue import MODELS
from squealstudy.models.parameter import ModelChange

COMPLEX = (
    study_text("old", "complex_modes", "hoffmann")
    + """\
[[sweep]]
parameter = "friction"
values = [0.5, 0.8]
[modes]
band = [10.0, 1000.0]
"""
)
TIME = """
[transient]
duration = 0.05
step = 1e-4
perturbation = 1e-3
"""
SINCE = "since when springs are softer"


def command(*arguments: str):
    done = CliRunner().invoke(app, [*arguments])
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture
def changed(monkeypatch):
    """Hoffmann's model with a change in this version, of its default damping too."""
    change = ModelChange(squealstudy.__version__, "springs are softer", {"damping_ratio": 0.3})
    model = replace(MODELS["hoffmann"], changes=(change,))
    monkeypatch.setitem(MODELS, "hoffmann", model)
    return model


def study(folder: Path, text: str, name: str) -> tuple[str, Path]:
    file, directory = folder / f"{name}.toml", folder / name
    file.write_text(text)
    command("run", str(file), "--output", str(directory), "--no-pictures")
    return str(file), directory


def made_by_the_first(directory: Path) -> None:
    manifest = read_manifest(directory)
    manifest["versions"]["squealstudy"] = "0.1.0"
    manifest["study_hash"] = "of the code of then"
    write_manifest(directory, manifest)


def test_resuming_results_of_before_a_change_warns(tmp_path, changed):
    file, directory = study(tmp_path, COMPLEX, "old")
    assert read_manifest(directory)["versions"]["squealstudy"] == squealstudy.__version__
    for name in MODULES.values():  # of the library of sparse factors, where one is installed
        has_version = name in read_manifest(directory)["versions"]
        assert has_version == (find_spec(name) is not None)
    made_by_the_first(directory)
    for verb in ("check", "run"):
        options = ("--no-pictures",) if verb == "run" else ()
        said = command(verb, file, "--output", str(directory), *options).stderr
        assert f"made by squealstudy 0.1.0, {SINCE}; all design points" in said
    again = command("run", file, "--output", str(directory), "--no-pictures")
    assert "warning" not in again.stderr  # now they are of this version


def test_comparing_results_of_before_a_change_warns(tmp_path, changed):
    _, modes = study(tmp_path, COMPLEX, "modes")
    _, time = study(tmp_path, COMPLEX.replace("complex_modes", "transient") + TIME, "time")
    assert SINCE not in command("compare", str(modes), str(time)).stderr
    made_by_the_first(time)
    said = command("compare", str(modes), str(time)).stderr
    assert f"{time}: made by squealstudy 0.1.0, {SINCE}" in said


def test_a_parameter_that_only_one_study_names_has_the_default_of_its_time(tmp_path, changed):
    """0.3 was the default when the results were made, not the one of today."""
    swept = COMPLEX + '\n[[sweep]]\nparameter = "damping_ratio"\nvalues = [0.0, 0.3]\n'
    _, modes = study(tmp_path, swept, "modes")
    _, time = study(tmp_path, COMPLEX.replace("complex_modes", "transient") + TIME, "time")
    made_by_the_first(time)
    table = command("compare", str(modes), str(time), "--csv").stdout
    assert "0.8,0.3" in table
    assert "0.8,0.0" not in table


def test_defaults_of_the_brake_by_version():
    brake = MODELS["disc_brake"]
    assert (brake.defaults()["damping_ratio"], brake.defaults()["stiffness_damping"]) == (
        0.005,
        1.5e-7,
    )
    assert brake.defaults("0.1.0")["damping_ratio"] == 0.0
    assert brake.defaults("0.1.0")["stiffness_damping"] == 0.0
    assert brake.defaults("0.10.1") == brake.defaults()  # a number, not a text


def test_what_has_not_changed_is_not_warned_of(tmp_path):
    manifest = {"model": "belt", "versions": {"squealstudy": "0.1.0"}}
    assert outdated(tmp_path, manifest) == ""
    assert outdated(tmp_path, {**manifest, "model": "matrices"}) == ""
    assert "damping_ratio is 0.005" in outdated(tmp_path, {**manifest, "model": "disc_brake"})


def hoffmann() -> squealstudy.Study:
    model = squealstudy.model("hoffmann", damping_ratio=0.01)
    return model.study(band=(10.0, 1000.0)).with_(friction=[0.5, 0.8])


def test_another_version_of_the_same_code_opens_results_and_solves_nothing_again(
    tmp_path, monkeypatch
):
    """A version is told in the manifest; ids and hashes are of the code, not of its number."""
    first = squealstudy.run(hoffmann(), tmp_path / "results", jobs=1)
    manifest = read_manifest(first.directory)
    manifest["versions"]["squealstudy"] = "0.2.0"
    write_manifest(first.directory, manifest)
    pd.testing.assert_frame_equal(squealstudy.open_results(first.directory).modes, first.modes)
    monkeypatch.setattr("squealstudy.engine.manifest.__version__", "9.9.9")
    again = squealstudy.run(hoffmann(), first.directory, jobs=1)
    assert (first.solved, again.solved) == (2, 0)
    pd.testing.assert_frame_equal(again.modes, first.modes)


def test_the_citation_names_this_version():
    text = (Path(squealstudy.__file__).parents[1] / "CITATION.cff").read_text("utf-8")
    assert f"version: {squealstudy.__version__}\n" in text
