"""The command line as a user meets it: one message, exit code 2, nothing written."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from study_runs import command
from tiny_meshes import tiny_meshes

import squealstudy as sq
from squealstudy import open_results
from squealstudy.engine.mode_vectors import mode_vectors
from squealstudy.errors import ConvergenceError
from squealstudy.linalg.factor import LABELS, automatic_backend
from squealstudy.modes.point import solve_point

STUDIES = Path(__file__).parents[2] / "studies"
STUDY = """[study]
name = "lockin"
kind = "complex_modes"

[model]
name = "hulten"

[parameters]
friction = 0.5

[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = 13

[modes]
band = [1.0, 1000.0]
"""


@pytest.fixture
def study(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


BAD = [
    ("num = 13", "nmu = 13", 15, "sweep[1].nmu", "unknown key"),
    ("num = 13", 'num = "many"', 15, "sweep[1].num", "whole number"),
    ('parameter = "friction"', 'parameter = "frction"', 12, "sweep[1].parameter", "friction"),
    ('parameter = "friction"', 'parameter = "disc.modes[1].damping_ratio"', 12, "sweep", "mass"),
    ('parameter = "friction"', 'parameter = "mass.modes[0].damping_ratio"', 12, "sweep", "1"),
    ('parameter = "friction"', 'parameter = "mass.modes[3].damping_ratio"', 12, "sweep", "1 to 2"),
    ("friction = 0.5", "friction = -0.5", 9, "parameters.friction", "at least 0"),
    ("friction = 0.5", 'friction = "much"', 9, "parameters.friction", "number"),
    ("friction = 0.5", "pressure = -1.0", 9, "parameters.pressure", "parameter"),
    ("[1.0, 1000.0]", "[1000.0, 1.0]", 18, "modes.band", "low"),
    ("stop = 0.6\nnum = 13", "values = []", 12, "sweep[1]", "value"),
    ("friction = 0.5", "friction = = 1", 9, "", "TOML"),
    ('name = "hulten"', 'name = "hulton"', 6, "model.name", "hulten"),
]


@pytest.mark.parametrize(("old", "new", "line", "key", "expected"), BAD)
@pytest.mark.parametrize("verb", ["run", "check"])
def test_bad_study_is_one_message(study, capsys, tmp_path, verb, old, new, line, key, expected):
    study.write_text(STUDY.replace(old, new, 1))
    assert command(verb, "study.toml") == 2
    screen = capsys.readouterr()
    assert screen.err.count("\n") == 1
    assert screen.err.startswith("squealstudy: study.toml")
    assert f"line {line}" in screen.err or "sweep" in key
    assert key in screen.err
    assert expected in screen.err
    assert screen.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["study.toml"]


def test_the_name_that_others_have_for_a_design_is_told_apart(study, capsys):
    study.write_text(STUDY + '[design]\ntype = "saltelli"\nsamples = 8\n')
    assert command("check", "study.toml") == 2
    message = capsys.readouterr().err
    assert "line 20, key 'design.type'" in message
    assert "named 'sobol_indices' here" in message


@pytest.mark.parametrize("verb", ["run", "check"])
@pytest.mark.parametrize("kind", ["complex_modes", "sensitivity"])
def test_a_mode_that_the_assembly_lacks_is_one_message(study, capsys, verb, kind):
    text = STUDY.replace("friction = 0.5", '"modes[9].damping_ratio" = 0.01', 1)
    study.write_text(text.replace("complex_modes", kind))
    assert command(verb, "study.toml", "-j", "1") == 2
    message = capsys.readouterr().err
    assert (
        "line 9, key 'parameters.modes[9].damping_ratio': the assembly has modes 1 to 2" in message
    )
    assert not Path("results/lockin").exists()


@pytest.mark.usefixtures("one_by_one")
def test_a_run_whose_every_point_failed_says_so_each_time(study, monkeypatch, capsys):
    def fail(*_):
        raise ConvergenceError("not_converged", "no luck")

    monkeypatch.setattr("squealstudy.kinds.complex_modes.problems.solve_point", fail)
    for _ in range(2):
        assert command("run", "study.toml", "-j", "1") == 2
        screen = capsys.readouterr()
        assert "every design point failed (13 not_converged), the first with: no luck" in screen.err
        assert "nothing to do" not in screen.out


@pytest.mark.usefixtures("one_by_one")
def test_a_run_with_failed_points_says_how_many_and_why(study, monkeypatch, capsys):
    def fail_above(prepared, state, *more):
        if state.operating.friction > 0.4:
            raise ConvergenceError("not_converged", "no luck")
        return solve_point(prepared, state, *more)

    monkeypatch.setattr("squealstudy.kinds.complex_modes.problems.solve_point", fail_above)
    for first in ("13: 9 solved, ", "13: all were there already, nothing to do, "):
        assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
        told = f"{first}4 not ok (4 not_converged; see message in points)"
        assert told in " ".join(capsys.readouterr().out.split())
    results = open_results("results/lockin")
    assert repr(results) == (
        "<Results 'results/lockin': complex_modes of hulten over friction: "
        "13 design points, 4 failed>"
    )


@pytest.mark.parametrize("place", ["study.toml/below", "/proc/nowhere"])
def test_a_place_that_cannot_be_written_is_one_message(study, capsys, place):
    assert command("run", "study.toml", "-j", "1", "-o", place) == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert place in message
    assert "internal error" not in message


@pytest.mark.full_size  # by default: test_store.py
def test_damaged_results_are_made_again_or_refused(study, capsys):
    run = ("run", "study.toml", "-j", "1", "--no-pictures")
    assert command(*run) == 0
    Path("results/lockin/points.parquet").write_text("x")
    assert command(*run) == 0
    assert len(open_results("results/lockin").points) == 13
    capsys.readouterr()
    for content in ("[]", "{}"):
        Path("results/lockin/manifest.json").write_text(content)
        assert command("rank", "results/lockin") == 2
        assert "manifest.json: not a manifest of squealstudy" in capsys.readouterr().err
        assert command(*run) == 0
        assert "damaged" in capsys.readouterr().err


def test_screens_of_a_study_without_modes_in_its_band(study, capsys):
    study.write_text(STUDY.replace("[1.0, 1000.0]", "[300.0, 400.0]"))
    assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
    screen = capsys.readouterr().out
    assert "No mode lies between 300 and 400 Hz at any design point." in screen
    assert "the full-order model has no mode in the band either, at 2 points" in screen
    assert command("check", "study.toml", "-j", "1") == 0
    assert "nothing is left to solve" in capsys.readouterr().out
    assert command("rank", "study.toml") == 2
    assert "expected a results directory such as results/NAME" in capsys.readouterr().err


def test_missing_and_unreadable_files(study, capsys, tmp_path):
    for name in ("nowhere.toml", "."):
        assert command("run", name) == 2
        assert capsys.readouterr().err.count("\n") == 1
    study.write_bytes(b"\xff\xfe\x00")
    assert command("run", "study.toml") == 2
    assert "study.toml" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_large_design_needs_yes(study, capsys, tmp_path):
    study.write_text(STUDY.replace("num = 13", "num = 13\n[design]\nlimit = 12"))
    assert command("run", "study.toml") == 2
    assert "--yes" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()
    assert command("run", "study.toml", "--yes", "--no-pictures", "-j", "1") == 0


def test_run_rank_and_plot(study, capsys, tmp_path):
    assert command("run", "study.toml", "-j", "1") == 0
    screen = capsys.readouterr().out
    assert "points.parquet" in screen
    assert "51.2 %" not in screen
    assert "53.8 %" in screen  # 7 of 13 points lie beyond 0.29167
    pictures = sorted(p.name for p in (tmp_path / "results" / "lockin").glob("*.png"))
    assert "stability_diagram.png" in pictures
    assert all(name in screen for name in pictures)
    assert command("rank", "results/lockin", "--csv", "--by", "growth") == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[0].startswith("track,kind,frequency_hz")
    assert len(rows) == 2
    assert command("plot", "results/lockin", "-o", "pictures") == 0
    assert sorted(p.name for p in (tmp_path / "pictures").glob("*.png")) == pictures
    assert command("run", "study.toml", "-j", "1") == 0
    assert "nothing to do" in capsys.readouterr().out


@pytest.mark.usefixtures("one_by_one")
def test_a_screen_says_what_was_found_how_sure_that_is_and_what_next(study, capsys):
    run = ("run", "study.toml", "-j", "1", "--no-pictures")
    assert command(*run) == 0
    short = capsys.readouterr().out
    found, rest = short.split("\n\nHow sure\n")
    sure, after = rest.split("\n\nWhat next\n")
    assert found.startswith("1 mode is unstable between 1 and 1000 Hz: T1 at 94 Hz first at")
    assert [line.split("  ")[0].strip() for line in sure.splitlines() if line[0] != " "] == [
        *("design points", "outside band", "estimates", "error", "undamped")
    ]
    assert "squealstudy rank results/lockin --why" in after
    assert command(*run, "--verbose") == 0
    long = capsys.readouterr().out
    assert "What was done\ntime" in long
    assert "points by rung" in long
    assert "points by rung" not in short


@pytest.mark.parametrize("option", ["--why", "--names"])
def test_where_no_mode_grows_a_ranking_says_so_whatever_is_asked_of_it(study, capsys, option):
    """It printed nothing at all."""
    study.write_text(study.read_text().replace("stop = 0.6", "stop = 0.1"))
    assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
    capsys.readouterr()
    assert command("rank", "results/lockin", option) == 0
    out, err = capsys.readouterr()
    assert out.startswith("No mode between")
    assert "tell of modes that oscillate and grow: there is none" in " ".join(err.split())


def test_why_tells_of_a_point_within_the_query_if_others_grow_alike(tmp_path, monkeypatch, capsys):
    """Roots of Hoffmann's oscillator do not depend on the sliding speed."""
    monkeypatch.chdir(tmp_path)
    study = sq.model("hoffmann").study("alike")
    sq.run(study.with_(friction=[0.6, 0.9], sliding_speed=[0.5, 1.0, 2.0]))
    for where, told in (("sliding_speed > 1.5", "2 m/s"), ("sliding_speed < 0.7", "0.5 m/s")):
        assert command("rank", "results/alike", "--where", where, "--why") == 0
        assert f"at friction 0.9, sliding_speed {told}" in capsys.readouterr().out


def test_why_two_modes_of_a_small_model_lock_in(study, capsys):
    """Hulten's undamped model: all growth is of unsymmetric stiffness, from two modes in half."""
    assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
    capsys.readouterr()
    assert command("rank", "results/lockin", "--why") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "1/s at friction 0." in told
    assert "at 75.0 Hz without friction" in told
    assert "of that at 100.0 Hz" in told
    assert "deg out of phase: the two have locked in" in told
    assert "energy in" not in told  # all is in the interfaces of a lumped model
    assert "-0 of damping" not in told  # no sign where there is none
    assert command("rank", "results/lockin", "--where", "friction < 0.43", "--why") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "1/s at friction 0.4, design point 8" in told  # not at .6, where the whole study is
    vectors = mode_vectors(open_results("results/lockin"), 1)
    assert vectors.by_stiffness == pytest.approx(vectors.lam.real, rel=1e-9)
    assert vectors.by_velocity == pytest.approx(0.0, abs=1e-9)
    assert vectors.coordinates == ("mass 1", "mass 2")
    values = sq.model("hulten").parameters["value"]
    w = 2 * np.pi * values[["frequency_1", "frequency_2"]].to_numpy()
    mu = 0.6
    K = np.array([[w[0] ** 2, -mu * w[1] ** 2], [mu * w[0] ** 2, w[1] ** 2]])
    Q = vectors.lam**2 * np.eye(2) + K
    size = np.abs(vectors.lam) ** 2
    assert np.abs(Q @ vectors.right).max() < 1e-8 * size
    assert np.abs(vectors.left.conj() @ Q).max() < 1e-8 * size


def test_bad_rank_is_one_message(study, capsys):
    assert command("run", "study.toml", "-j", "1", "--no-pictures") == 0
    capsys.readouterr()
    for arguments, expected in (
        (["--by", "colour"], "colour"),
        (["--where", "friction >"], "friction >"),
        (["--where", "colour > 1"], "colour"),
    ):
        assert command("rank", "results/lockin", *arguments) == 2
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert expected in message


def test_results_that_are_none(study, capsys, tmp_path):
    for verb in ("rank", "plot"):
        assert command(verb, str(tmp_path)) == 2
        assert "manifest" in capsys.readouterr().err


def test_check_counts_and_estimates(study, capsys, tmp_path):
    assert command("check", "study.toml") == 0
    screen = capsys.readouterr().out
    assert "13 points" in screen
    assert "an exact point takes" in screen
    assert "up to about 20 points between those of the study" in screen
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("shipped", "said"),
    [
        ("kicked_design", "damping_ratio 0.01 to 0.21, searched"),
        ("robust_brake", "friction 0.2 to 0.7, truncated_normal"),
        ("first_brake", "friction 0.1 to 0.7, 7 values"),
    ],
)
def test_check_says_how_values_are_chosen(shipped, said, capsys, tmp_path):
    text = (STUDIES / f"{shipped}.toml").read_text(encoding="utf-8")
    text = text.replace('"medium"', '"coarse"\ncontact_points = 2').replace("8000.0", "4000.0")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with tiny_meshes(tmp_path / "cache"):
        assert command("check", str(tmp_path / "study.toml")) == 0
    assert said in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("old", "new", "said", "absent"),
    [
        ("-5.4e17", "0.0", "cubic (linear, as contact.cubic_stiffness is 0)", ""),
        ("-5.4e17", "-5.4e17", "friction is the same at all speeds", "linear"),
        ("sliding_speed = 10.0", '"friction_law.static_ratio" = 1.2\nsliding_speed = 10.0',
         "friction_law = exponential_fall", "the same at all speeds"),
    ],
)  # fmt: skip
def test_check_says_what_is_left_of_a_law(old, new, said, absent, capsys, tmp_path):
    text = (STUDIES / "kicked_squeal.toml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    (tmp_path / "study.toml").write_text(text.replace(old, new), encoding="utf-8")
    assert command("check", str(tmp_path / "study.toml")) == 0
    screen = " ".join(capsys.readouterr().out.split())
    assert said in screen
    assert not absent or absent not in screen


def test_check_of_a_design_study_says_what_comes_on_top(capsys):
    assert command("check", str(STUDIES / "kicked_design.toml")) == 0
    screen = " ".join(capsys.readouterr().out.split())
    assert "up to 400 designs of the search, and the proof of the one" in screen


def test_check_tells_a_time_between_bounds_before_the_first_reduction(
    study, monkeypatch, capsys, tmp_path
):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "empty"))
    text = STUDY.replace('"hulten"', '"disc_brake"\nmesh = "coarse"').replace("1000.0", "8000.0")
    study.write_text(text)
    assert command("check", "study.toml", "--jobs", "1") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert re.search(
        r"time about \d+ (s|min), \d+ s to \d min, without pictures: 1 reduction of", told
    )
    factors = LABELS[automatic_backend(14_769, definite=True)]
    told_size = f"14,769 degrees of freedom, factors by {factors}, 5 s to 2 min, by reductions of"
    assert told_size in told
    assert "--build makes the first one" in told
    study.write_text(text.replace("complex_modes", "limit_cycles"))
    assert command("check", "study.toml") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "what follows cannot be told before: --build" in told


@pytest.mark.parametrize(
    ("parameter", "values", "key", "line"),
    [
        ("caliper.finger_inner_angle", "[26.0, 30.0]", "sweep[1].parameter", 12),
        ("pad.outer_radius", "[0.09]", "sweep[1].parameter", 12),
        ("friction", "[0.5]\n[parameters]\ncaliper.outer_radius = 0.146", "parameters", 15),
    ],
)
@pytest.mark.parametrize("verb", ["run", "check"])
def test_a_part_that_vanishes_is_told_before_anything_is_built(
    study, monkeypatch, capsys, tmp_path, verb, parameter, values, key, line
):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "empty"))
    text = STUDY.replace('"hulten"', '"disc_brake"').replace(
        "[parameters]\nfriction = 0.5\n", "\n\n"
    )
    text = text.replace('parameter = "friction"', f'parameter = "{parameter}"')
    study.write_text(text.replace("start = 0.0\nstop = 0.6\nnum = 13", f"values = {values}"))
    assert command(verb, "study.toml") == 2
    message = capsys.readouterr().err
    assert message.startswith(f"squealstudy: study.toml, line {line}, key '{key}")
    assert "expected" in message
    assert "a part would vanish" in message
    assert not any((tmp_path / "empty").rglob("*"))


def test_geometries_that_cannot_be_built_are_counted(study, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "empty"))
    text = STUDY.replace('"hulten"', '"disc_brake"').replace("1000.0", "8000.0")
    text = text.replace('parameter = "friction"', 'parameter = "hub.radius"')
    study.write_text(
        text.replace("start = 0.0\nstop = 0.6\nnum = 13", "values = [0.05, 0.03, 0.07]")
    )
    assert command("check", "study.toml") == 0
    assert "2 of 3 geometries cannot be built" in capsys.readouterr().err


def test_models_lists_units_and_defaults(capsys):
    assert command("models") == 0
    assert "disc_brake" in capsys.readouterr().out
    assert command("models", "disc_brake") == 0
    screen = capsys.readouterr().out
    assert screen.endswith("modes of its components: squealstudy models disc_brake --modes\n")
    assert "disc.young_modulus" in screen
    assert "1.2e+11" in screen
    assert re.search(r"^added_mass\.<set> +0 +kg", screen, re.MULTILINE)
    assert "caliper.BRIDGE" in screen
    assert command("models", "hoffman") == 2
    assert "hoffmann" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["hulten", "hoffmann", "belt"])
def test_models_lists_the_modes_of_components(name, capsys):
    assert command("models", name) == 0
    screen = capsys.readouterr().out
    assert "free-free modes, Hz (number: frequency, rigid ones first)" in screen
    assert re.search(r"^\w+ +[12] +1", screen, re.MULTILINE)  # component, DOF, its modes


@pytest.mark.full_size  # needs the modes of two meshes
def test_modes_of_components_are_those_of_the_mesh_asked_for(tmp_path, capsys):
    with tiny_meshes(tmp_path / "cache"):
        assert command("models", "disc_brake", "--mesh", "coarse") == 0
        screen = capsys.readouterr().out
        assert "free-free modes of the coarse mesh, Hz" in screen
        modes = sq.model("disc_brake", mesh="coarse").component_modes()
    caliper = modes[modes["component"] == "caliper"]
    assert re.search(
        rf"^caliper +{caliper['n_dof'].iloc[0]} +1-6: rigid; 7: ", screen, re.MULTILINE
    )
    assert command("models", "disc_brake", "--mesh", "corse") == 2
    assert "did you mean 'coarse'" in capsys.readouterr().err


def test_a_check_that_compares_nothing_says_so(study, capsys):
    """Modes of 10 % damping: none that errors are stated for."""
    text = STUDY.replace("start = 0.0\nstop = 0.6\nnum = 13", "values = [0.1]")
    study.write_text(text.replace("friction = 0.5", "damping_ratio = 0.1"))
    assert command("run", "study.toml", "--no-pictures") == 0
    assert "not known: the full-order model has no mode of damping < 5 %" in " ".join(
        capsys.readouterr().out.split()
    )
    assert open_results("results/lockin").points["reference_frequency_error"].isna().all()


def test_fast_growing_modes_are_checked_too(study, capsys):
    """At 0.4 the modes of Hulten's model grow and decay with 13 % damping."""
    study.write_text(STUDY.replace("start = 0.0\nstop = 0.6\nnum = 13", "values = [0.4]"))
    assert command("run", "study.toml", "--no-pictures") == 0
    assert "none is missed" in capsys.readouterr().out
    assert open_results("results/lockin").points["reference_frequency_error"].max() < 1e-9


def test_schema_as_tables_to_read(capsys):
    assert command("schema", "--kind", "model_file", "--tables") == 0
    text = capsys.readouterr().out
    assert "| `slave` | text |  | *required* | COMPONENT.SET that has the contact points. |" in text
    assert text.startswith("## Top of the file")


def test_columns_are_told_without_the_site(capsys):
    """Every page of the reference that is made has a command that prints it."""
    assert command("columns") == 0
    assert "limit_cycles points, verdicts" in " ".join(capsys.readouterr().out.split())
    assert command("columns", "complex_modes", "modes") == 0
    screen = " ".join(capsys.readouterr().out.split())
    assert "frequency_hz Hz abs(lambda) / 2 pi of the root lambda; Im lambda / 2 pi is" in screen
    assert "Its error: error_estimate." in screen
    for words, said in (
        (("complex_mode",), "did you mean 'complex_modes'?"),
        (("transient", "point"), "there is no table of transient 'point'"),
    ):
        assert command("columns", *words) != 0
        assert said in " ".join(capsys.readouterr().err.split())


def test_schema_is_json_schema(capsys):
    assert command("schema") == 0
    schema = json.loads(capsys.readouterr().out)
    assert {"study", "model", "sweep", "modes"} <= set(schema["properties"])


def test_version_names_what_computes(capsys):
    assert command("--version") == 0
    screen = capsys.readouterr().out
    assert re.fullmatch(
        r"squealstudy [\d.]+, Python [\d.]+, numpy [\d.]+, scipy [\d.]+, numba [\d.]+, \S+ \S+\n",
        screen,
    ), screen


def test_lines_of_the_help_are_not_cut_off(capsys):
    assert command("--help") == 0
    screen = capsys.readouterr().out
    assert "..." not in screen.replace("[ARGS]...", "")
    assert "print what was found, how sure that is, what next." in " ".join(screen.split())


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom squealstudy.cli.app import main\n"
        "sys.argv = ['squealstudy', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'numpy', 'scipy', 'pandas', 'pyarrow', 'skfem', 'matplotlib', "
        "'pydantic'}\n"
        "sys.stderr.write(' '.join(sorted(heavy & set(sys.modules))))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Usage" in done.stdout
    assert done.stderr == ""
