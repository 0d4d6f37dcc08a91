"""`squealstudy examples`: the shipped studies, whole, from a clone as from a wheel."""

import os
import runpy
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from test_pages import shipped

import squealstudy as sq
from squealstudy.cli import study_commands as cli
from squealstudy.errors import SquealstudyError
from squealstudy.study import examples as shelf

ROOT = Path(__file__).parents[2]
OF_OTHERS = "outside_data"  # whose matrices are not shipped


def test_every_shipped_study_is_listed():
    assert sorted(sq.list_examples()) == sorted(Path(file).stem for file in shipped())


@pytest.mark.parametrize("name", sorted(sq.list_examples()))
def test_a_study_is_written_with_all_that_it_needs(name, tmp_path):
    """It can be read where it was written, and nothing that it names lies elsewhere."""
    written = sq.write_example(name, tmp_path)
    assert written[0] == tmp_path / f"{name}.toml"
    whole = tmp_path.resolve()
    assert all(path.resolve().is_relative_to(whole) for path in written)
    if shelf.examples()[name].path.parent.name == OF_OTHERS:
        return
    assert sq.read_study(written[0]).owner[0] == name


def test_meshes_and_results_of_others_come_too(tmp_path):
    own = {path.name for path in sq.write_example("own_brake", tmp_path / "a")}
    assert {"brake.toml", "disc.msh", "inner_pad.msh", "outer_pad.msh", "caliper.msh"} < own
    goes_on = [path.name for path in sq.write_example("squeal_damping", tmp_path / "b")]
    assert goes_on == ["squeal_damping.toml", "squeal_nominal.toml"]


def test_one_file_goes_here_and_several_into_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sq.write_example("hulten_flutter")
    sq.write_example("own_brake")
    assert sorted(os.listdir()) == ["hulten_flutter.toml", "own_brake"]


def test_what_is_there_stays(tmp_path):
    (tmp_path / "disc.msh").write_text("mine")
    with pytest.raises(SquealstudyError, match=r"disc\.msh: there is such a file"):
        sq.write_example("own_brake", tmp_path)
    assert os.listdir(tmp_path) == ["disc.msh"]


def test_a_wrong_name_is_one_sentence():
    with pytest.raises(SquealstudyError, match="did you mean 'first_brake'"):
        sq.write_example("frist_brake")


def test_the_screen_says_what_to_run_and_in_which_order(tmp_path, capsys):
    cli.examples("squeal_damping", tmp_path)
    *_, first, second = capsys.readouterr().out.split("squealstudy run ")
    assert (Path(first.strip()).stem, Path(second.strip()).stem) == (
        "squeal_nominal",
        "squeal_damping",
    )
    cli.examples()
    assert "coarse brake over friction, and over frequency" in capsys.readouterr().out


@pytest.fixture
def index_page(monkeypatch) -> Callable[..., str]:
    """`for_an_index` of the build hook, without hatchling."""
    interface = ModuleType("hatchling.metadata.plugin.interface")
    interface.MetadataHookInterface = object
    monkeypatch.setitem(sys.modules, "hatchling.metadata.plugin.interface", interface)
    hook = runpy.run_path(str(ROOT / "hatch_build.py"))
    return hook["for_an_index"]


def test_the_page_of_a_package_index_needs_no_clone(index_page):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    page = index_page(readme)
    assert "](" not in page
    assert "pip install squealstudy" in page
    assert "-e " not in page
    assert "squealstudy examples softer_lining && squealstudy run softer_lining.toml" in page
    assert "run studies/" not in page
    assert "`CHANGELOG.md`" in page
    assert len(page) > 0.8 * len(readme)
    linked = index_page(readme, "https://example.org/tree/main/")
    assert "](https://example.org/tree/main/docs/howto/why.md)" in linked
    assert "](https://example.org/tree/main/results/charts/overview.png)" in linked


def test_a_wheel_holds_them_all():
    """What the package of a wheel takes from the folder of the clone is what examples name."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = settings["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["sources"] == {shelf.IN_CLONE.name: f"squealstudy/{shelf.IN_WHEEL.name}"}
    held = {path for pattern in wheel["include"] for path in ROOT.glob(pattern.removeprefix("/"))}
    for example in shelf.examples().values():
        assert set(shelf._with_named_files(example.path)) <= held, example.name
