"""Transient studies at the command line, as a user meets them: the belt, from file to pictures."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path

import pandas as pd
import pytest
from made_results import made
from study_runs import command
from transient_tables import modes_table, points_table

from squealstudy import screen as screens

BELT = """[study]
name = "belt"
kind = "transient"

[model]
name = "belt"

[[sweep]]
parameter = "sliding_speed"
values = [0.6, 1.0, 1.3]

[modes]
band = [10.0, 1000.0]

[transient]
duration = 0.5
step = 1e-4
perturbation = 1e-3
save_every = 5
"""
PREDICTED = BELT.replace('"belt"\nkind = "transient"', '"modes"\nkind = "complex_modes"')
PREDICTED = PREDICTED[: PREDICTED.index("[transient]")]
HULTEN = BELT.replace('name = "belt"\n\n[[', 'name = "hulten"\n\n[[')
BOUNDARY = 1.151293  # m/s, the speed above which steady sliding is stable


def one_line(screen) -> str:
    (line,) = [line for line in screen.err.splitlines() if line.startswith("squealstudy: ")]
    assert "internal error" not in line
    return line


def files_below(directory: Path) -> set[str]:
    return {p.relative_to(directory).as_posix() for p in directory.rglob("*")}


def as_table(screen) -> pd.DataFrame:
    return pd.read_csv(io.StringIO(screen.out), keep_default_na=False, na_values=[""])


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A directory with both studies of the belt, the runs with all pictures; what was printed."""
    directory = tmp_path_factory.mktemp("belt")
    (directory / "belt.toml").write_text(BELT)
    (directory / "modes.toml").write_text(PREDICTED)
    printed = io.StringIO()
    with contextlib.chdir(directory), contextlib.redirect_stdout(printed):
        assert command("run", "modes.toml", "--jobs", "1", "--no-pictures") == 0
        assert command("run", "belt.toml", "--jobs", "1") == 0
    return directory, printed.getvalue()


@pytest.fixture
def there(home, monkeypatch):
    monkeypatch.chdir(home[0])
    return home[0]


@pytest.fixture
def study(tmp_path, monkeypatch):
    """A fresh directory; call it with changes of the study for a file to run."""
    monkeypatch.chdir(tmp_path)

    def write(*changes: tuple[str, str], name: str = "study.toml", text: str = BELT) -> str:
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / name).write_text(text)
        return name

    return write


# -- run and what it leaves ----------------------------------------------------------------------
def test_run_leaves_tables_states_histories_and_nothing_else(home):
    results = home[0] / "results" / "belt"
    points = pd.read_parquet(results / "points.parquet")
    ids = set(points["point_id"])
    assert points["status"].tolist() == ["ok"] * 3
    assert {p.stem for p in (results / "histories").glob("*.parquet")} == ids
    assert {p.stem for p in (results / "states").glob("*.npz")} == ids
    assert not list(results.rglob(".*.tmp"))
    manifest = json.loads((results / "manifest.json").read_text())
    assert (manifest["status"], manifest["kind"]) == ("complete", "transient")
    assert manifest["transient"]["step"] == 1e-4


def test_growth_changes_sign_at_the_known_speed(home):
    points = pd.read_parquet(home[0] / "results/belt/points.parquet")
    slow = points["sliding_speed"] < BOUNDARY
    assert (points.loc[slow, "class"] != "stable").all()
    assert (points.loc[~slow, "class"] == "stable").all()
    fitted, predicted = points["growth_rate"], points["predicted_growth_rate"]
    assert ((predicted > 0) == slow).all()
    assert ((fitted / predicted - 1).abs() < 0.03).all()


def test_run_prints_each_point_and_the_pictures(home):
    printed = home[1]
    told = ("limit cycle", "stable", "sticks", "energies balance to", "growth_comparison.png")
    for text in told:
        assert text in printed
    for drawn in re.findall(r"results/belt/\w+\.png", printed):
        assert (home[0] / drawn).stat().st_size > 5000


def test_a_second_run_finds_everything(there, capsys):
    tables = {p: p.stat().st_mtime_ns for p in (there / "results/belt").glob("*.parquet")}
    assert command("run", "belt.toml", "--jobs", "1", "--no-pictures") == 0
    assert "nothing to do" in capsys.readouterr().out
    assert {p: p.stat().st_mtime_ns for p in tables} == tables


def test_a_broken_off_run_goes_on(study, capsys):
    """One chunk is lost, a temporary file is left, as a kill leaves them."""
    name = study(
        ("save_every = 5", "save_every = 5\nbatch = 1"), ("duration = 0.5", "duration = 0.05")
    )
    assert command("run", name, "--jobs", "1", "--no-pictures") == 0
    whole = pd.read_parquet("results/belt/points.parquet").drop(columns="wall_s")
    lost = sorted(Path("results/belt/chunks").glob("*.parquet"))[0]
    lost.rename(lost.with_name(f".{lost.name}.x.tmp"))
    for table in ("points", "modes", "growth"):
        Path(f"results/belt/{table}.parquet").unlink()
    capsys.readouterr()
    assert command("rank", "results/belt") == 2
    assert "not finished" in one_line(capsys.readouterr())
    assert command("run", name, "--jobs", "1", "--no-pictures") == 0
    assert "1 solved now, 2 found" in capsys.readouterr().out
    again = pd.read_parquet("results/belt/points.parquet").drop(columns="wall_s")
    pd.testing.assert_frame_equal(again, whole)
    assert not list(Path("results").rglob("*.tmp"))


def test_another_study_is_not_overwritten(there, study, home, capsys):
    name = study(('name = "belt"\nkind', 'name = "other"\nkind'))
    target = str(home[0] / "results/belt")
    before = files_below(home[0])
    assert command("run", name, "--output", target) == 2
    assert "belongs to study 'belt'" in one_line(capsys.readouterr())
    assert files_below(home[0]) == before


# -- rank, compare, plot -------------------------------------------------------------------------
def test_rank_names_the_mode_that_vibrates(there, capsys):
    assert command("rank", "results/belt", "--csv") == 0
    table = as_table(capsys.readouterr())
    assert table["mode"].iloc[0] == 1
    assert table["frequency_hz"].iloc[0] == pytest.approx(100.0, abs=0.01)
    assert table["energy_share"].iloc[0] > 0.99
    assert table["points"].iloc[0] == 2  # the third is stable


@pytest.mark.parametrize("option", ["--names", "--why"])
def test_runs_have_no_modes_to_name(there, capsys, option):
    assert command("rank", "results/belt", option) == 2
    assert "--names and --why are of modes" in capsys.readouterr().err


def test_rank_where_chooses_points(there, capsys):
    assert command("rank", "results/belt", "--where", "sliding_speed < 0.9", "--csv") == 0
    assert as_table(capsys.readouterr())["points"].iloc[0] == 1
    assert command("rank", "results/belt", "--where", "sliding_speed > 1.2") == 0
    assert "Nothing within the query keeps vibrating" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kinds", "told"),
    [
        (("undecided", "undecided"), "is known to keep vibrating; 2 undecided runs left out."),
        (("undecided", "stable"), "is known to keep vibrating; 1 undecided run left out."),
        (("stable", "stable"), "No design point keeps vibrating."),
        (("stable", "failed"), "No design point is known to keep vibrating."),
        (("limit_cycle", "undecided"), "no mode has more; 1 undecided run left out"),
    ],
)
def test_rank_says_which_runs_may_yet_vibrate(capsys, kinds, told):
    points = points_table({"friction": [0.4, 0.5]}, kinds)
    modes = modes_table({"p0": {44: 0.6}, "p1": {44: 0.6}})
    results = made("transient", points=points, modes=modes)
    screens.show(*results.screen.ranking(results))
    assert told in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("where", "told"), [("speed < 1", "unknown column"), ("sliding_speed <", "cannot be used")]
)
def test_rank_tells_what_is_wrong_with_a_condition(there, capsys, where, told):
    assert command("rank", "results/belt", "--where", where) == 2
    assert told in one_line(capsys.readouterr())


@pytest.mark.parametrize("swapped", [False, True])
def test_compare_joins_prediction_and_motion(there, capsys, swapped):
    pair = ["results/modes", "results/belt"]
    assert command("compare", *(pair[::-1] if swapped else pair), "--csv") == 0
    table = as_table(capsys.readouterr())
    found = table[table["track"] > 0]
    assert found["sliding_speed"].tolist() == [0.6, 1.0]
    assert (found["growth_rate"] / found["predicted_growth_rate"] - 1).abs().max() < 1e-6
    assert found["deviation"].abs().max() < 0.03
    lasts = found["class"].isin(["limit_cycle", "irregular"]).to_numpy()
    assert lasts[0]
    assert found.loc[lasts, "expressed"].astype(str).eq("True").all()
    assert found.loc[~lasts, "expressed"].isna().all()  # at 1 m/s it may still grow at the end
    assert found.loc[lasts, "level_share"].between(0.99, 1.0).all()


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        (
            "results/belt",
            "results/belt",
            "expected results of kind complex_modes or limit_cycles and of kind transient",
        ),
        ("results/modes", "results/none", "no such results directory"),
        ("results", "results/belt", "no manifest.json"),
    ],
)
def test_compare_of_the_wrong_directories(there, capsys, first, second, told):
    assert command("compare", first, second) == 2
    assert told in one_line(capsys.readouterr())


@pytest.mark.full_size  # the same pictures as `run`; elsewhere too in test_cli.py
def test_a_run_is_drawn(there):
    drawn = {p.stem for p in (there / "results" / "belt").glob("*.png")}
    assert {
        "growth_comparison",
        "levels_sliding_speed",
        "torque_history_sliding_speed_0.6",
    } <= drawn
    assert {"modal_energies_sliding_speed_1.3", "spectrogram_sliding_speed_1.3"} <= drawn


def test_plot_draws_elsewhere(there, tmp_path):
    assert command("plot", "results/modes", "--output", str(tmp_path / "p")) == 0
    assert (tmp_path / "p" / "evolution_sliding_speed.png").stat().st_size > 5000
    assert not list((there / "results" / "modes").glob("*.png"))


# -- check ---------------------------------------------------------------------------------------
def test_check_counts_and_writes_nothing(study, tmp_path, capsys):
    name = study()
    assert command("check", name, "--jobs", "1") == 0
    screen = capsys.readouterr()
    assert "3 points, 3 of them not yet in" in screen.out
    assert "an exact point takes" in screen.out
    assert "warning" not in screen.err
    assert files_below(tmp_path) == {name}


def test_check_warns_of_friction_too_stiff_for_the_step(study, capsys):
    name = study(("[[sweep]]", "[parameters]\ncontact.kt = 1e14\n\n[[sweep]]"))
    assert command("check", name, "--jobs", "1") == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "friction is too stiff for the step" in told
    step = float(re.search(r"[Aa] step of (\S+) s or", told).group(1))
    slope = float(re.search(r"contact.kt of (\S+) would do", told).group(1))
    assert 0 < step < 1e-4
    assert 0 < slope < 1e14


@pytest.mark.parametrize(("kt", "step"), [(2e9, None), (2e10, "1.5e-05")])
def test_check_tells_the_step_at_which_stuck_friction_does_not_ring(study, capsys, kt, step):
    """Stick numbers of 20 and 200: levels are not known beyond 30, steps converge up to 1000."""
    name = study(("[[sweep]]", f"[parameters]\ncontact.kt = {kt:g}\n\n[[sweep]]"))
    assert command("check", name, "--jobs", "1") == 0
    told = " ".join(capsys.readouterr().err.split())
    assert ("where half of the contact sticks its friction rings" in told) == (step is not None)
    assert step is None or f"(h k_t |T|^2 / 2 is 200). A step of {step} s avoids it" in told


def test_check_warns_of_growth_above_the_band(study, capsys):
    name = study(
        ("[10.0, 1000.0]", "[10.0, 80.0]"),
        ("sliding_speed", "friction"),
        ("[0.6, 1.0, 1.3]", "[0.1, 0.5]"),
        text=HULTEN,
    )
    assert command("check", name, "--jobs", "1") == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "a mode above the band of 80 Hz is unstable too" in told


# -- errors --------------------------------------------------------------------------------------
BAD = [
    ("step = 1e-4", "step = 0.0", 17, "transient.step", "more than 0"),
    ("step = 1e-4", 'step = "1e-4"', 17, "transient.step", "number"),
    ("step = 1e-4", "step = true", 17, "transient.step", "number"),
    ("step = 1e-4", "step = inf", 17, "transient.step", "finite"),
    ("step = 1e-4", "steps = 1e-4", 17, "transient.steps", "did you mean 'step'"),
    ("duration = 0.5", "duration = 1e-5", 15, "transient", "shorter than one step"),
    ("save_every = 5", "save_every = 2.5", 19, "transient.save_every", "whole number"),
    ("save_every = 5", "sensors = [2000.0, 9000.0]", 19, "transient.sensors", "no assembly mode"),
    ("save_every = 5", "sensors = [9]", 19, "transient.sensors", "2 modes"),
    ("save_every = 5", "perturb_modes = [9]", 19, "transient.perturb_modes", "modes 1 to 2"),
    ("save_every = 5", "perturb_modes = [true]", 19, "transient.perturb_modes", "whole number"),
    ("perturbation = 1e-3", "perturbation = -1.0", 18, "transient.perturbation", "at least 0"),
    ("save_every = 5", 'start = "nowhere"', 19, "transient.start", "results of a transient study"),
    ("save_every = 5", 'start_point = "ab"', 15, "transient", "needs a results directory"),
    ("save_every = 5", "pod_vectors = 3", 15, "transient", "modes_below"),
    ("save_every = 5", "modes_below = 5.0", 19, "transient.modes_below", "no assembly mode"),
    ("save_every = 5", 'method = "euler"', 19, "transient.method", "newmark"),
    (
        "[[sweep]]",
        "[parameters]\n'modes[7].damping_ratio' = 0.1\n[[sweep]]",
        9,
        "modes[7]",
        "1 to 2",
    ),
    ('parameter = "sliding_speed"', 'parameter = "contact.kt"\nscale = "cube"', 10, "scale", "log"),
]


@pytest.mark.parametrize(("old", "new", "line", "key", "expected"), BAD)
def test_a_bad_study_is_one_message_and_leaves_nothing(
    study, tmp_path, capsys, old, new, line, key, expected
):
    name = study((old, new))
    assert command("run", name, "--jobs", "1") == 2
    told = one_line(capsys.readouterr())
    assert told.startswith(f"squealstudy: {name}, line {line}")
    assert key in told
    assert expected in told
    assert files_below(tmp_path) == {name}


# -- continued runs ------------------------------------------------------------------------------
def continued(home: Path, point: str = "") -> tuple[str, str]:
    more = f'save_every = 5\nstart = "{home / "results/belt"}"\n'
    return "save_every = 5\n", more + (f'start_point = "{point}"\n' if point else "")


def test_a_continued_run_goes_on_where_the_other_ended(home, study):
    points = pd.read_parquet(home[0] / "results/belt/points.parquet")
    first = points.iloc[0]
    name = study(
        continued(home[0], first["point_id"]),
        ("perturbation = 1e-3\n", ""),  # nothing is added to a continued state unless it is given
        ("values = [0.6, 1.0, 1.3]", "values = [0.6]"),
        ('name = "belt"\nkind', 'name = "more"\nkind'),
    )
    assert command("run", name, "--jobs", "1", "--no-pictures") == 0
    more = pd.read_parquet("results/more/points.parquet").iloc[0]
    assert more["perturbation"] == 0.0
    assert more["class"] == "limit_cycle"
    assert more["torque_rms"] == pytest.approx(first["torque_rms"], rel=0.03)
    ends, begins = (
        pd.read_parquet(directory / "histories" / f"{row['point_id']}.parquet")
        for directory, row in ((home[0] / "results/belt", first), (Path("results/more"), more))
    )
    for column in ("torque", "energy"):
        assert begins[column].iloc[0] == pytest.approx(ends[column].iloc[-1], rel=1e-4)


@pytest.mark.parametrize(
    ("point", "change", "told"),
    [
        ("", None, "name one by start_point"),
        ("no-such-point", None, "is not finished, failed, or is unknown"),
        ("first", ("[[sweep]]", "[parameters]\nmass = 2.0\n\n[[sweep]]"), "of another model"),
    ],
)
def test_a_start_that_does_not_fit(home, study, capsys, tmp_path, point, change, told):
    ids = pd.read_parquet(home[0] / "results/belt/points.parquet")["point_id"]
    chosen = str(ids.iloc[0]) if point == "first" else point
    name = study(continued(home[0], chosen), *([change] if change else []))
    assert command("run", name, "--jobs", "1") == 2
    assert told in one_line(capsys.readouterr())
    assert files_below(tmp_path) == {name}


def test_a_start_from_complex_modes(home, study, capsys):
    old, new = continued(home[0])
    name = study((old, new.replace("results/belt", "results/modes")))
    assert command("check", name) == 2
    assert "complex_modes study, which has no final state" in one_line(capsys.readouterr())


# -- little is kept, nothing moves -----------------------------------------------------------------
def test_a_run_without_histories_keeps_its_summary(study, capsys):
    name = study(("save_every = 5", "save_every = 0"), ("duration = 0.5", "duration = 0.2"))
    assert command("run", name, "--jobs", "1") == 0
    assert "torque_history" not in capsys.readouterr().out
    assert not Path("results/belt/histories").exists()
    assert pd.read_parquet("results/belt/points.parquet")["torque_rms"].notna().all()


def test_without_a_perturbation_nothing_moves(study):
    name = study(("perturbation = 1e-3", "perturbation = 0.0"), ("[0.6, 1.0, 1.3]", "[1.3]"))
    assert command("run", name, "--jobs", "1", "--no-pictures") == 0
    point = pd.read_parquet("results/belt/points.parquet").iloc[0]
    assert (point["status"], point["class"], point["perturbation"]) == ("ok", "stable", 0.0)
    assert point["torque_rms"] == 0.0
    assert point["torque_mean"] == pytest.approx(point["torque_static"], rel=1e-9)
