"""`squealstudy new`: files to start from that are true and run."""

import re
import tomllib

import pytest

import squealstudy as sq
from squealstudy.cli import app as cli
from squealstudy.engine.template import study_text
from squealstudy.errors import SquealstudyError
from squealstudy.models.catalogue import MODELS
from squealstudy.study.kinds import kind_named, kind_names, model_kind

OF_METHODS = [name for name in kind_names() if kind_named(name).of_methods]
KINDS = [name for name in kind_names() if name not in OF_METHODS]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", MODELS)
def test_every_kind_of_every_model_passes_its_check(kind, model, tmp_path, capsys):
    path = tmp_path / "start.toml"
    cli.new(path, model, kind)
    cli.check(path, tmp_path / "results", jobs=1)
    shown = " ".join(capsys.readouterr().out.split())
    assert f"start: {kind} on {model}, valid" in shown


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", MODELS)
def test_defaults_that_are_written_are_those_of_the_file(kind, model):
    """With every commented default taken in, the study is the same."""
    text = study_text("start", kind, model)
    definition = model_kind(kind).definition
    given = tomllib.loads(text)
    keys = re.compile(r"# (\[?\[\w+\]\]?$|[\w.\"]+ = (?!\.\.\.$))|[^#]|$")
    lines = [line.removeprefix("# ") for line in text.splitlines() if keys.match(line)]
    whole = "\n".join(lines).split("[fidelity]")[0].split("[transient]")[0]  # keys exclude others
    whole = whole.split("[[variable]]")[0]
    full = tomllib.loads(whole)
    for section in ("modes", "reduction", "design"):
        every = set(definition.model_fields[section].annotation.model_fields)
        assert set(full[section]) <= every
    options = {o.name for o in MODELS[model].options}
    assert set(full["model"]) == {"name"} | options
    defaults = {p.name: p.default for p in MODELS[model].parameters}
    begun = {n: v for n, v in model_kind(kind).begins_with.items() if defaults.get(n) == 0.0}
    assert full["parameters"] == defaults | begun
    full["parameters"] = {}
    found, short = (definition.model_validate(t) for t in (full, given))
    for section in ("modes", "reduction", "design"):
        assert getattr(found, section) == getattr(short, section)


def test_a_file_that_is_there_stays(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    with pytest.raises(SquealstudyError, match="not overwritten"):
        sq.new_study(path, "complex_modes", "hulten")
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("kind", "model", "told"),
    [
        ("complex_mode", "hulten", "did you mean 'complex_modes'"),
        ("complex_modes", "hultn", "did you mean 'hulten'"),
        ("complex_modes", "matrices", "squealstudy models matrices"),
        ("transient", "matrices", "squealstudy models matrices"),
        *((kind, "hulten", "made on other study files") for kind in OF_METHODS),
    ],
)
def test_what_does_not_go_together_is_one_clear_error(kind, model, told, tmp_path):
    path = tmp_path / "start.toml"
    with pytest.raises(SquealstudyError, match=told):
        sq.new_study(path, kind, model)
    assert not path.exists()
