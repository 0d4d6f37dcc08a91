"""`squealstudy new`: files to start from that are true, run, and have an answer in them."""

import json
import re
import tomllib

import pytest

import squealstudy as sq
from squealstudy.cli import app as cli
from squealstudy.cli import study_commands
from squealstudy.engine import template
from squealstudy.engine.template import new_kinds, study_text
from squealstudy.errors import SquealstudyError
from squealstudy.models.catalogue import MODELS
from squealstudy.study.examples import examples
from squealstudy.study.kinds import kind_named, kind_names, model_kind

OF_METHODS = [name for name in kind_names() if kind_named(name).of_methods]
KINDS = [name for name in kind_names() if name not in OF_METHODS]
SMALL = [name for name, model in MODELS.items() if not model.meshed]
LONGEST = 85  # lines of a file with the keys that matter most


def test_every_kind_can_be_begun_with_and_the_option_names_them():
    assert set(new_kinds()) == {*kind_names(), template.ROBUST}
    said = str(study_commands.new.__annotations__["kind"])
    assert all(name in said for name in (*kind_names(), template.ROBUST))


def begun():
    """Of each model, kind and length; the check times a limit cycle of one small model alone."""
    for model in MODELS:
        for kind in (*KINDS, template.ROBUST):
            for whole in (False, True):
                rare = kind == "limit_cycles" and (model, whole) != ("hulten", False)
                marks = [pytest.mark.full_size] * (rare and not MODELS[model].meshed)
                name = f"{model}-{kind}-{'all' if whole else 'short'}"
                yield pytest.param(model, kind, whole, id=name, marks=marks)


@pytest.mark.parametrize(("model", "kind", "whole"), list(begun()))
def test_every_kind_of_every_model_passes_its_check(model, kind, whole, tmp_path, capsys):
    path = tmp_path / "start.toml"
    cli.new(path, model, kind, whole)
    cli.check(path, tmp_path / "results", jobs=1)
    shown = " ".join(capsys.readouterr().out.split())
    own = template.OF_ROBUST if kind == template.ROBUST else kind
    assert f"start: {own} on {model}, valid" in shown


@pytest.mark.parametrize("kind", OF_METHODS)
def test_kinds_of_methods_pass_theirs(kind, tmp_path, capsys):
    path = tmp_path / "start.toml"
    cli.new(path, "hoffmann" if kind == "work_precision" else None, kind)
    cli.check(path, tmp_path / "results", jobs=1)
    assert "start: " in capsys.readouterr().out
    assert sq.read_study(path).owner[:2] == ("start", kind)


@pytest.mark.parametrize("model", SMALL)
def test_what_is_swept_goes_from_stable_to_unstable(model, tmp_path):
    path = sq.new_study(tmp_path / "start.toml", "complex_modes", model)
    found = sq.run(path, tmp_path / "results", jobs=1)
    assert set(found.points["n_unstable"] > 0) == {True, False}


def test_a_study_in_time_to_start_from_ends_in_an_answer(tmp_path):
    """Rest below the onset, a limit cycle above."""
    path = sq.new_study(tmp_path / "start.toml", "transient", "hulten")
    found = sq.run(path, tmp_path / "results", jobs=1)
    assert found.points["class"].tolist() == ["stable"] * 2 + ["limit_cycle"] * 2


def test_the_range_of_the_brake_holds_the_onset_of_its_shipped_study():
    """Of `first_brake` (README): 0.287 at the component mode as it is."""
    begun = tomllib.loads(study_text("start", "complex_modes", "disc_brake"))
    shipped = tomllib.loads(examples()["first_brake"].path.read_text("utf-8"))
    assert begun["model"] == shipped["model"]
    sweep = begun["sweep"][0]
    assert sweep["parameter"] == "friction"
    assert sweep["start"] < 0.287 < sweep["stop"]


@pytest.mark.parametrize("kind", [*KINDS, template.ROBUST])
@pytest.mark.parametrize("model", MODELS)
def test_short_files_are_short_and_say_where_the_rest_is(model, kind):
    text = study_text("start", kind, model)
    lines = text.splitlines()
    assert len(lines) <= LONGEST
    assert f"squealstudy new FILE --model {model} --kind {kind} --all" in text
    assert len(study_text("start", kind, model, whole=True).splitlines()) > 2 * len(lines)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("model", MODELS)
def test_defaults_that_are_written_are_those_of_the_file(kind, model):
    """With every commented default taken in, the study is the same."""
    text = study_text("start", kind, model, whole=True)
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


@pytest.mark.parametrize("kind", KINDS)
def test_both_forms_are_the_same_study(kind):
    short, whole = (tomllib.loads(study_text("a", kind, "belt", w)) for w in (False, True))
    definition = model_kind(kind).definition
    assert definition.model_validate(short) == definition.model_validate(whole)


def test_a_file_that_is_there_stays(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    with pytest.raises(SquealstudyError, match="not overwritten"):
        sq.new_study(path, "complex_modes", "hulten")
    assert path.read_text() == "mine"
    (tmp_path / "a_base.toml").write_text("mine")
    with pytest.raises(SquealstudyError, match=r"a_base\.toml: .* not overwritten"):
        sq.new_study(tmp_path / "a.toml", "work_precision", "hulten")
    assert not (tmp_path / "a.toml").exists()


@pytest.mark.parametrize(
    ("kind", "model", "told"),
    [
        ("complex_mode", "hulten", "did you mean 'complex_modes'"),
        ("complex_modes", "hultn", "did you mean 'hulten'"),
        ("complex_modes", "matrices", "squealstudy models matrices"),
        ("transient", "matrices", "squealstudy models matrices"),
        ("transient", None, r"--model NAME, one of\n  belt +mass on a belt"),
        ("method_stability", "hulten", "a minimal model of its own"),
    ],
)
def test_what_does_not_go_together_is_one_clear_error(kind, model, told, tmp_path):
    path = tmp_path / "start.toml"
    with pytest.raises(SquealstudyError, match=told):
        sq.new_study(path, kind, model)
    assert not path.exists()


def test_a_schema_beside_it_is_named_for_editors(tmp_path):
    first = sq.new_study(tmp_path / "a.toml", model="hulten")
    assert "#:schema" not in first.read_text()
    second = sq.new_study(tmp_path / "b.toml", model="hulten", schema=True)
    line = second.read_text().splitlines()[0]
    assert line == f"#:schema ./{template.SCHEMA_FILE}"
    assert "sweep" in json.loads((tmp_path / template.SCHEMA_FILE).read_text())["properties"]
    third = sq.new_study(tmp_path / "c.toml", model="belt")
    assert third.read_text().startswith(line)
    assert sq.read_study(third).owner[2] == "belt"
