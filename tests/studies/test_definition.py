"""Study files: what a good one resolves to, and one clear message for every bad one."""

from __future__ import annotations

import json
import os
import string
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from squealstudy.engine.schema import study_schema
from squealstudy.errors import ExtensionError, StudyFileError
from squealstudy.extensions import load_extension
from squealstudy.study.definition import load_study, parse_study
from squealstudy.study.sampling import count_points, design_points
from squealstudy.study.toml_text import KeyLines

GOOD = """\
# friction and pressure
[study]
name = "friction_pressure"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "coarse"

[parameters]
friction = 0.4
disc.young_modulus = 1.1e11
"caliper.modes[13].damping_ratio" = 0.1

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.7
num = 29

[[sweep]]
parameter = "pressure"
values = [2e5, 4e5, 8e5]

[design]
type = "grid"

[modes]
band = [500.0, 8000.0]
"""
HEAD = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "disc_brake"\n'
RANDOM = '[design]\ntype = "sobol"\nsamples = 8\n'


def study_of(text: str):
    return parse_study(text, Path("study.toml"))


def error_of(text: str) -> StudyFileError:
    with pytest.raises(StudyFileError) as caught:
        study_of(text)
    return caught.value


def sweep(*lines: str, parameter: str = "friction") -> str:
    return "\n".join(["[[sweep]]", f'parameter = "{parameter}"', *lines, ""])


# -- good files ----------------------------------------------------------------------------------
def test_good_file_is_resolved(tmp_path):
    path = tmp_path / "good.toml"
    path.write_text(GOOD, encoding="utf-8")
    study = load_study(path)
    assert (study.source.path, study.source.text, study.name) == (path, GOOD, "friction_pressure")
    assert study.model.name == "disc_brake"
    laws = {"contact_law": "exponential", "friction_law": "exponential_fall"}
    mine = {"mesh": "coarse", "contact_points": 3, "kinematics": "uniform"}
    assert study.options == mine | laws
    assert study.values["disc.young_modulus"] == 1.1e11
    assert study.values["friction"] == 0.4
    assert study.values["caliper.modes[13].damping_ratio"] == 0.1
    untouched = study.model.defaults().keys() - study.definition.parameters.keys()
    assert all(study.values[name] == study.model.parameter(name).default for name in untouched)
    assert len(study.values) == len(study.model.parameters) + 1
    assert study.shown_parameters == (
        "friction",
        "pressure",
        "disc.young_modulus",
        "caliper.modes[13].damping_ratio",
    )
    friction, pressure = study.sweeps
    assert (friction.low, friction.high, len(friction.values)) == (0.0, 0.7, 29)
    assert pressure.values == (2e5, 4e5, 8e5)


def test_defaults_are_those_of_the_contract():
    definition = study_of(HEAD).definition
    design, modes, reduction = definition.design, definition.modes, definition.reduction
    assert (design.type, design.seed, design.limit) == ("grid", 0, 20000)
    assert modes.band == (500.0, 8000.0)
    assert (modes.stability_tolerance, modes.track, modes.reference_points) == (1e-7, True, 2)
    assert (reduction.component_cutoff_factor, reduction.assembly_cutoff_factor) == (1.5, 1.25)
    assert (reduction.tolerance, reduction.enrichment) == (1e-4, True)
    assert reduction.residual_responses


def test_band_of_minimal_models_is_wide_and_a_given_band_stays():
    minimal = HEAD.replace("disc_brake", "hulten")
    assert study_of(minimal).definition.modes.band == (1.0, 16000.0)
    assert study_of(minimal + "[modes]\ntrack = false\n").definition.modes.band == (1.0, 16000.0)
    assert study_of(HEAD + "[modes]\nband = [0, 20]\n").definition.modes.band == (0.0, 20.0)


@pytest.mark.parametrize(
    "lines",
    [
        "disc.young_modulus = 1e11",
        '"disc.young_modulus" = 1e11',
        "[parameters.disc]\nyoung_modulus = 100_000_000_000",
        "disc = {young_modulus = 1e11}",
    ],
)
def test_dotted_and_quoted_parameters_are_the_same(lines):
    study = study_of(f"{HEAD}[parameters]\n{lines}\n")
    assert study.definition.parameters == {"disc.young_modulus": 1e11}


def test_byte_order_mark_and_windows_line_ends_are_read(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())
    assert count_points(load_study(str(path))) == 87


# -- bad files: the line expected to be named ends in #! ------------------------------------------
BAD = {
    "unknown key": (GOOD.replace("num = 29", "nmu = 29 #!"), "sweep[1].nmu", "mean 'num'"),
    "unknown table": (GOOD + "[mdoes] #!\n", "mdoes", "did you mean 'modes'"),
    "unknown option": (
        GOOD.replace('mesh = "coarse"', 'mseh = "coarse" #!'),
        "model.mseh",
        "did you mean 'mesh'",
    ),
    "option choice": (
        GOOD.replace('"coarse"', '"corse" #!'),
        "model.mesh",
        "expected 'medium' or 'coarse' or 'fine', got 'corse'; did you mean 'coarse'?",
    ),
    "option type": (
        HEAD + "contact_points = 3.0 #!\n",
        "model.contact_points",
        "expected 3 or 2 or 4, got 3.0",
    ),
    "option bool": (HEAD + "contact_points = true #!\n", "model.contact_points", "got true"),
    "option of another model": (
        HEAD.replace("disc_brake", "hulten") + 'mesh = "fine" #!\n',
        "model.mesh",
        "unknown key of model 'hulten'; its options are",
    ),
    "unknown model": (
        GOOD.replace('"disc_brake"', '"disk_brake" #!'),
        "model.name",
        "did you mean 'disc_brake'",
    ),
    "missing key": (
        HEAD.replace('name = "s"\n', "").replace("[study]", "[study] #!"),
        "study.name",
        "the key 'name' is missing",
    ),
    "missing table": (
        '[study]\nname = "s"\nkind = "complex_modes"\n',
        "model",
        "[model] is missing",
    ),
    "kind": (
        GOOD.replace('"complex_modes"', '"modes" #!'),
        "study.kind",
        "expected one of complex_modes",
    ),
    "study name": (
        GOOD.replace('"friction_pressure"', '"a/b" #!'),
        "study.name",
        "letters, digits",
    ),
    "number for text": (
        GOOD.replace('"friction_pressure"', "3 #!"),
        "study.name",
        "text in quotes",
    ),
    "text for number": (
        GOOD.replace("friction = 0.4", 'friction = "0.4" #!'),
        "parameters.friction",
        "expected a number, got '0.4'",
    ),
    "bool for number": (
        GOOD.replace("friction = 0.4", "friction = true #!"),
        "parameters.friction",
        "expected a number, got true",
    ),
    "nan": (GOOD.replace("= 0.4", "= nan #!"), "parameters.friction", "a finite number, got nan"),
    "inf in a sweep": (
        GOOD.replace("4e5, 8e5]", "\ninf, #!\n8e5]"),
        "sweep[2].values[2]",
        "a finite number, got inf",
    ),
    "text in a sweep": (
        GOOD.replace("4e5, 8e5]", '"4e5", 8e5] #!'),
        "sweep[2].values[2]",
        "a number, got '4e5'",
    ),
    "fraction for num": (GOOD.replace("29", "29.0 #!"), "sweep[1].num", "a whole number, got 29.0"),
    "num zero": (GOOD.replace("29", "0 #!"), "sweep[1].num", "expected at least 1, got 0"),
    "num vast": (
        GOOD.replace("29", "99999999999 #!"),
        "sweep[1].num",
        "expected at most 1000000, got",
    ),
    "negative pressure": (
        GOOD.replace("8e5]", "-8e5] #!"),
        "sweep[2].values[3]",
        "pressure: expected a value above 0 Pa, got -800000",
    ),
    "negative pressure set": (
        HEAD + "[parameters]\npressure = -1e5 #!\n",
        "parameters.pressure",
        "expected a value above 0 Pa, got -100000",
    ),
    "stop out of bounds": (GOOD.replace("0.7", "70 #!"), "sweep[1].stop", "expected at most 5"),
    "unknown parameter": (
        GOOD.replace('"friction"', '"fricton" #!'),
        "sweep[1].parameter",
        "no parameter 'fricton'; did you mean 'friction'",
    ),
    "unknown parameter set": (
        GOOD.replace("disc.young_modulus = 1.1e11", "disc.youngs = 1 #!"),
        "parameters.disc.youngs",
        "no parameter 'disc.youngs'",
    ),
    "unknown component": (
        HEAD
        + sweep("values = [1]", parameter="calliper.modes[3].frequency_scale").replace(
            '"\nv', '" #!\nv'
        ),
        "sweep[1].parameter",
        "no component 'calliper'; its components are disc, inner_pad, outer_pad, caliper",
    ),
    "mode number": (
        GOOD.replace('modes[13].damping_ratio" = 0.1', 'modes[0].damping_ratio" = 0.1 #!'),
        "parameters.caliper.modes[0].damping_ratio",
        "expected mode numbers from 1",
    ),
    "mode value": (
        GOOD.replace('damping_ratio" = 0.1', 'damping_ratio" = -0.1 #!'),
        "parameters.caliper.modes[13].damping_ratio",
        "expected at least 0",
    ),
    "mode set twice": (
        GOOD
        + sweep("values = [0.1]", parameter="caliper.modes[12-14].damping_ratio").replace(
            '"\nv', '" #!\nv'
        ),
        "sweep[3].parameter",
        "'caliper.modes[13].damping_ratio' both set damping_ratio of caliper mode 13",
    ),
    "parameter without a value": (
        HEAD + "[parameters] #!\nfriction = {}\n",
        "parameters",
        "'friction' is an empty table, expected a value",
    ),
    "unknown parameter without a value": (
        HEAD + "[parameters] #!\n[parameters.nosuch.deeper]\n",
        "parameters",
        "'nosuch.deeper' is an empty table, expected a value",
    ),
    "parameter twice": (
        HEAD + '[parameters] #!\ndisc.density = 1\n"disc.density" = 1\n',
        "parameters",
        "'disc.density' is given twice",
    ),
    "swept twice": (
        GOOD.replace('parameter = "pressure"', 'parameter = "friction" #!').replace("e5", "e-5"),
        "sweep[2].parameter",
        "'friction' is swept twice",
    ),
    "empty values": (
        GOOD.replace("[2e5, 4e5, 8e5]", "[] #!"),
        "sweep[2].values",
        "at least one value",
    ),
    "empty sweep": (
        HEAD + sweep().replace("[[sweep]]", "[[sweep]] #!"),
        "sweep[1]",
        "the sweep is empty: give values, or start, stop and num",
    ),
    "no stop": (
        HEAD + sweep("start = 0", "num = 3").replace("[[sweep]]", "[[sweep]] #!"),
        "sweep[1].stop",
        "'stop' of a swept range is missing",
    ),
    "values and num": (
        GOOD.replace("8e5]", "8e5]\nnum = 3 #!"),
        "sweep[2].num",
        "either values or start, stop and num",
    ),
    "repeated value": (GOOD.replace("8e5]", "4e5] #!"), "sweep[2].values", "appears twice"),
    "start is stop": (GOOD.replace("0.7", "0.0 #!"), "sweep[1].stop", "the same as start"),
    "levels too close": (
        HEAD + sweep("start = 1", "stop = 1.0000000000000002 #!", "num = 9"),
        "sweep[1].stop",
        "a value appears twice",
    ),
    "log from zero": (
        GOOD.replace("start = 0.0", 'scale = "log"\nstart = 0.0 #!'),
        "sweep[1].start",
        "log scale needs values above 0",
    ),
    "scale": (
        GOOD.replace("num =", 'scale = "lg" #!\nnum ='),
        "sweep[1].scale",
        "'linear' or 'log'",
    ),
    "one bracket": (
        HEAD + "[sweep] #!\nparameter = 'friction'\nvalues = [1]\n",
        "sweep",
        "expected [[sweep]] with two brackets",
    ),
    "two brackets": (HEAD + "[[modes]] #!\n", "modes", "expected [modes] with one bracket"),
    "zip lengths": (
        GOOD.replace('"grid"', '"zip"').replace("8e5]", "8e5] #!"),
        "sweep[2].values",
        "'pressure' has 3 values, 'friction' has 29",
    ),
    "zip repeats": (
        HEAD + sweep("values = [0.1, 0.1]") + '[design]\ntype = "zip" #!\n',
        "design.type",
        "appears twice",
    ),
    "design type": (
        GOOD.replace('"grid"', '"gird" #!'),
        "design.type",
        "'sobol_indices' or 'boundary', got 'gird'; did you mean 'grid'",
    ),
    "samples of a grid": (
        GOOD.replace('"grid"', '"grid"\nsamples = 3 #!'),
        "design.samples",
        "not grid",
    ),
    "seed of a grid": (GOOD.replace('"grid"', '"grid"\nseed = 3 #!'), "design.seed", "not grid"),
    "no samples": (
        HEAD + sweep("start = 0", "stop = 1") + '[design] #!\ntype = "sobol"\n',
        "design.samples",
        "'samples' is missing",
    ),
    "levels in random": (
        HEAD + sweep("values = [1, 2] #!") + RANDOM,
        "sweep[1].values",
        "a sobol design samples a range",
    ),
    "num in random": (
        HEAD + sweep("start = 0", "stop = 1", "num = 3 #!") + RANDOM,
        "sweep[1].num",
        "'samples' in [design] counts",
    ),
    "nothing to sample": (
        HEAD + RANDOM.replace('"sobol"', '"sobol" #!'),
        "design.type",
        "needs at least one [[sweep]]",
    ),
    "seed negative": (HEAD + "[design]\nseed = -1 #!\n", "design.seed", "at least 0"),
    "band reversed": (
        GOOD.replace("[500.0, 8000.0]", "[8000.0, 500.0] #!"),
        "modes.band",
        "expected [low, high] with 0 <= low < high, got [8000, 500]",
    ),
    "band of one": (
        GOOD.replace("[500.0, 8000.0]", "[500.0] #!"),
        "modes.band",
        "two frequencies [low, high] in Hz, got 1 values",
    ),
    "band of text": (GOOD.replace("8000.0]", '"8k"] #!'), "modes.band[2]", "a number, got '8k'"),
    "band no list": (GOOD.replace("[500.0, 8000.0]", "5 #!"), "modes.band", "got 5"),
    "number for true": (HEAD + "[modes]\ntrack = 1 #!\n", "modes.track", "true or false, got 1"),
    "cutoff": (
        HEAD + "[reduction]\nassembly_cutoff_factor = 0.5 #!\n",
        "reduction.assembly_cutoff_factor",
        "at least 1",
    ),
    "number for table": ("modes = 3 #!\n" + HEAD, "modes", "expected a table of keys, got 3"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_file_is_named_by_file_line_and_key(name):
    text, key, fragment = BAD[name]
    marked = [i for i, line in enumerate(text.splitlines(), start=1) if line.endswith("#!")]
    error = error_of(text)
    assert error.key == key
    assert fragment in error.message
    assert error.line == (marked[0] if marked else None)
    assert error.path == Path("study.toml")
    place = (
        f"study.toml, line {error.line}, key '{key}': " if marked else f"study.toml, key '{key}'"
    )
    assert str(error).startswith(place)
    assert "\n" not in str(error)


def test_several_errors_are_reported_in_the_order_of_the_file():
    text = GOOD.replace("num = 29", 'num = "x"').replace('name = "friction_pressure"', "name = 5")
    error = error_of(text + "track = 3\n")
    assert (error.key, error.line) == ("study.name", 3)
    first, second, third = error.message.split("\n")
    assert first == "expected text in quotes, got 5"
    assert second.endswith("key 'sweep[1].num': expected a whole number, got 'x'")
    assert third.endswith("key 'modes.track': expected true or false, got 3")
    line = next(i for i, s in enumerate(text.splitlines(), start=1) if s.startswith("num ="))
    assert second.startswith(f"line {line}, ")
    assert error_of(GOOD.replace("29", '"x"')).message == "expected a whole number, got 'x'"


def test_many_errors_are_reported_at_once():
    values = ", ".join(['"x"'] * 20_000)
    error = error_of(HEAD + sweep(f"values = [{values}]"))
    assert error.key == "sweep[1].values[1]"
    assert error.message.count("\n") == 11
    assert error.message.endswith("\nand 19989 more")


def test_many_empty_tables_are_one_error_soon():
    error = error_of(HEAD + "[[sweep]]\n" * 2_000)
    assert error.key == "sweep[1].parameter"
    assert error.message.endswith("\nand 1989 more")


def test_designs_of_absurd_size_are_refused_before_they_are_made():
    grid = sweep("start = 0.1\nstop = 0.2\nnum = 10000")
    second = "[[sweep]]\nparameter = 'pressure'\nstart = 1e5\nstop = 2e5\nnum = 10100\n"
    message = error_of(HEAD + grid + second).message
    assert "would have 101,000,000 points, more than 100,000,000" in message
    indices = "[design]\ntype = 'sobol_indices'\nsamples = 33554432\n"
    ranges = (
        grid.replace("num = 10000", "")
        + "[[sweep]]\nparameter = 'pressure'\nstart = 1e5\nstop = 2e5\n"
    )
    error = error_of(HEAD + ranges + indices)
    assert (error.key, error.message.split(",")[0]) == (
        "design.samples",
        "the design would have 134",
    )


def test_control_characters_of_a_file_do_not_reach_the_screen():
    error = error_of(GOOD.replace('name = "friction_pressure"', 'name = "a\\u0000\\u001b\\u202e"'))
    assert "got 'a\\x00\\x1b\\u202e'" in str(error)


@pytest.mark.parametrize(
    ("text", "line", "fragment"),
    [
        ("[study]\nname = \n", 2, "Invalid value (column 8)"),
        ("[study\n", 1, "Expected ']'"),
        (HEAD + 'name = "hulten"\n', 6, "a key is given twice"),
        ("a = [1,\n2\n", 2, "(end of file)"),
        ("a = " + "9" * 5000 + "\n", None, "digits"),
        ("a = " + "[" * 5000 + "\n", None, "nested too deeply"),
        ("a = 2026-02-30\n", 1, "Invalid date"),
        ("a = [0.1, -.2]\n", 1, "Invalid value '-.2': a number begins with a digit, -0.2"),
        ("a = 12.e5 # Pa\n", 1, "a number has a digit after its point, 12.0e5"),
        ("a = 1,5\n", 1, "a number has a point, and no comma"),
        ("a = True\n", 1, "Invalid value 'True': expected true"),
        ("a = hoffmann\n", 1, 'text stands in plain quotes, "hoffmann"'),
        ("a = “x”\n", 1, 'text stands in plain quotes, "x"'),
        ("a = 5 Pa\n", 1, "Expected newline"),
    ],
)
def test_toml_syntax_errors_have_a_line(text, line, fragment):
    error = error_of(text)
    assert error.line == line
    assert error.message.startswith("not valid TOML: ")
    assert fragment in error.message


def test_files_that_cannot_be_read(tmp_path):
    latin = tmp_path / "latin.toml"
    latin.write_bytes("# ok\n# Stra\xdfe\n".encode("latin-1"))
    for path, line, fragment in (
        (tmp_path / "absent.toml", None, "no such file"),
        (tmp_path, None, "directory"),
        (latin / "x.toml", None, "cannot be read"),
        (latin, 2, "UTF-8"),
    ):
        with pytest.raises(StudyFileError, match=fragment) as caught:
            load_study(path)
        assert (caught.value.path, caught.value.line) == (path, line)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="NOT TRIED HERE: needs pipes with names")
def test_pipes_and_devices_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(StudyFileError, match="a pipe or a device"):
            load_study(path)
    with pytest.raises(ExtensionError, match="no file of Python"):
        load_extension(tmp_path / "pipe")


def test_huge_and_deep_content_ends_in_a_message():
    assert error_of(f"{HEAD}[parameters]\nfriction = 0x{'f' * 6000}\n").key == "parameters.friction"
    deep = ".".join(["a"] * 1500)
    assert error_of(f"{HEAD}[parameters]\n{deep} = 1\n").line == 7
    assert error_of(f"{HEAD}[parameters]\nfriction = {'[' * 200}{']' * 200}\n").line == 7


def _mutations(text: str) -> st.SearchStrategy[str]:
    """The text with a few lines or characters removed, doubled, swapped or replaced."""
    tokens = ["nan", "-1", "1e400", "true", '"', "'", "[", "]", "{}", "=", ".", "#", "\n", "\x00"]
    tokens += ['"""', "[[sweep]]", "[design]", '"sobol"', "samples = 3", "0", "9" * 30, "é", "\r"]
    tokens += ["modes[1-3]", "values = []", 'scale = "log"', "1979-05-27", ","]
    position = st.integers(0, len(text))
    edit = st.tuples(position, st.integers(0, 25), st.sampled_from(["", *tokens]))

    def apply(edits: list[tuple[int, int, str]]) -> str:
        out = text
        for start, width, new in edits:
            out = out[:start] + new + out[start + width :]
        return out

    return st.lists(edit, min_size=1, max_size=4).map(apply)


def _check_only_study_errors(text: str) -> None:
    try:
        study = study_of(text)
    except StudyFileError as e:
        error = e
    else:
        if count_points(study) < 5000:
            assert len(design_points(study)) == count_points(study)
        return
    assert error.message
    assert error.line is None or 1 <= error.line <= text.count("\n") + 1


@settings(max_examples=100, deadline=None)
@given(_mutations(GOOD))
def test_mutated_files_raise_nothing_else(text):
    _check_only_study_errors(text)


@pytest.mark.full_size
@settings(max_examples=1000, deadline=None)
@given(_mutations(GOOD))
def test_many_mutated_files_raise_nothing_else(text):
    _check_only_study_errors(text)


@settings(max_examples=60, deadline=None)
@given(_mutations(HEAD + sweep("start = 0.1", "stop = 1", 'scale = "log"') + RANDOM))
def test_mutated_random_designs_raise_nothing_else(text):
    _check_only_study_errors(text)


KEYS = (
    *("name", "kind", "mesh", "type", "samples", "seed", "limit", "band", "track", "values"),
    *("start", "stop", "num", "scale", "parameter", "friction", "tolerance"),
    *("model_config", "options", "__class__"),
)
SCALARS = st.one_of(
    st.integers(-(2**70), 2**70), st.floats(), st.booleans(), st.text(max_size=5), st.just([])
)


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from(["study", "model", "design", "modes", "reduction", "sweep", "parameters"]),
    st.sampled_from(KEYS),
    st.one_of(SCALARS, st.lists(SCALARS, max_size=3), st.dictionaries(st.text(), SCALARS)),
)
def test_any_value_under_any_key_raises_nothing_else(section, key, value):
    document = tomllib.loads(GOOD)
    table = document[section] if section in document else document.setdefault(section, {})
    (table[0] if isinstance(table, list) else table)[key] = value
    _check_only_study_errors(_toml(document))


def _toml(document: dict) -> str:
    """TOML with each top-level table inline: JSON strings and numbers are nearly TOML's."""

    def inline(value) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{json.dumps(k)} = {inline(v)}" for k, v in value.items()) + "}"
        if isinstance(value, list):
            return "[" + ", ".join(inline(v) for v in value) + "]"
        return json.dumps(value).replace("NaN", "nan").replace("Infinity", "inf")

    return "".join(f"{json.dumps(k)} = {inline(v)}\n" for k, v in document.items())


# -- lines ---------------------------------------------------------------------------------------
TOML = '''\
title = "x" # top
"a.b" = 1
a.b = 2
text = """
[fake]
key = 1 \\""" still
""" # end
raw = \'\'\'
[[fake]]
\'\'\'\'
[table] # [not]
list = [ # comment ]
  1, # two
  [2,
   3],
  {deep = "}", "quo\\u0074ed" = 5},
]
date = 1979-05-27 07:32:00
[[many]]
key = 1
[many.sub]
key = 2
[[many]]
key = 3
[[many.inner]]
key = 4
[ spaced . "k.e" ]
x = '#'
'''


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("title",), 1),
        (("a.b",), 2),
        (("a", "b"), 3),
        (("text",), 4),
        (("raw",), 8),
        (("table",), 11),
        (("table", "list"), 12),
        (("table", "list", 0), 13),
        (("table", "list", 1, 1), 15),
        (("table", "list", 2, "quoted"), 16),
        (("table", "list", 2, "absent"), 16),
        (("table", "date"), 18),
        (("many",), 19),
        (("many", 0, "key"), 20),
        (("many", 0, "sub", "key"), 22),
        (("many", 1), 23),
        (("many", 1, "key"), 24),
        (("many", 1, "inner", 0, "key"), 26),
        (("many", 1, "absent", "deeper"), 23),
        (("spaced", "k.e", "x"), 28),
        (("spaced.k.e.x",), 28),
        (("fake",), None),
        (("key",), None),
    ],
)
def test_line_of_a_key(keys, line):
    tomllib.loads(TOML)
    assert KeyLines(TOML).find(keys) == line


def test_every_key_of_a_document_is_found():
    def walk(value, path):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield (*path, key)
            if isinstance(item, dict | list):
                yield from walk(item, (*path, key))

    lines = KeyLines(TOML)
    places = [lines.find(keys) for keys in walk(tomllib.loads(TOML), ())]
    assert places == sorted(places)  # tables of a document come in their order
    assert (min(places), max(places)) == (1, 28)


@given(st.text(alphabet=string.ascii_letters[:3] + "[]{}=.,#\"'\\ \n1", max_size=60))
def test_every_key_of_any_valid_text_has_a_line(text):
    try:
        document = tomllib.loads(text)
    except ValueError:
        document = {}
    lines = KeyLines(text)
    assert all(1 <= lines.find((key,)) <= text.count("\n") + 1 for key in document)


# -- schema and import ---------------------------------------------------------------------------
def test_schema_names_every_table_and_model():
    schema = study_schema()
    assert schema["$schema"].startswith("https://json-schema.org/")
    tables = {"study", "model", "parameters", "sweep", "design", "modes", "reduction"}
    tables |= {"transient", "sensitivity", "fidelity", "limit_cycles"}
    tables |= {"goal", "variable", "uncertain", "variant"}
    assert schema["properties"].keys() == tables
    model = schema["$defs"]["ModelSection"]["properties"]
    known = ["belt", "disc_brake", "hoffmann", "hulten", "matrices", "components", "lumped"]
    assert model["name"]["enum"] == known
    assert model["mesh"]["enum"] == ["medium", "coarse", "fine"]
    text = json.dumps(schema)
    assert "null" not in text
    for section in schema["$defs"].values():
        assert section["additionalProperties"] is False
        assert all(field["description"] for field in section["properties"].values())


def test_definition_imports_nothing_heavy():
    code = (
        "import sys, squealstudy.study.definition\n"
        "print({'scipy', 'numba', 'pandas', 'skfem', 'numpy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_value_far_from_usual_ones_is_doubted():
    for text in (
        "[parameters]\npressure = 12",
        sweep("values = [12, 1e6]").replace("friction", "pressure"),
    ):
        (doubt,) = study_of(HEAD + text).doubts
        assert doubt.startswith("pressure = 12 Pa is far from the usual 1000 to 1e+08 Pa")
    assert not study_of(GOOD).doubts
