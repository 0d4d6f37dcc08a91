"""Sensitivity studies end to end: file, tables, ranking, picture, refusals."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from study_runs import command, plan_of, solved

import squealstudy
from squealstudy.engine.rows import failed_row
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError, StudyFileError
from squealstudy.kinds.sensitivity.screen import _strongest_in_words, sensitivities
from squealstudy.kinds.sensitivity.tables import SCHEMA, build_tables
from squealstudy.plots.sensitivity_bars import sensitivity_bars
from squealstudy.reduction import working_point
from squealstudy.stacked import sliding
from squealstudy.tables.sensitivity_ranking import (
    mode_sensitivities,
    rank_sensitivities,
    step_text,
)

HULTEN = """[study]
name = "slopes"
kind = "sensitivity"

[model]
name = "hulten"

[parameters]
damping_ratio = 0.01

[[sweep]]
parameter = "friction"
start = 0.1
stop = 0.5
num = 5

[sensitivity]
modes = 2
parameters = ["friction", "sliding_speed", "damping_ratio", "frequency_1", "modes[1].damping_ratio"]
"""
BRAKE = """[study]
name = "slopes"
kind = "sensitivity"
[model]
name = "disc_brake"
mesh = "coarse"
[sensitivity]
parameters = ["friction"]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    directory = tmp_path_factory.mktemp("slopes") / "r"
    return solved(plan_of(HULTEN), directory)


def test_tables(results):
    points, table = results.points, results.sensitivities
    assert (points["status"] == "ok").all()
    assert len(points) == 5
    assert (points["n_modes"] == 2).all()
    assert len(table) == 5 * 2 * 5
    assert (table["residual"] < 1e-12).all()
    assert (table["biorthogonality"] < 1e-10).all()
    growing = table.groupby("point_id")["growth_rate"].max()
    assert points.set_index("point_id")["max_growth_rate"].equals(growing[points["point_id"]])


def test_columns_agree_with_each_other(results):
    table = results.sensitivities
    friction = table[table["parameter"] == "friction"]
    np.testing.assert_allclose(friction["change"], 0.01 * friction["value"], rtol=1e-12)
    np.testing.assert_allclose(
        friction["growth_per_percent"], 0.01 * friction["value"] * friction["d_growth_rate"]
    )
    damping = table[table["parameter"] == "damping_ratio"]
    assert (damping["change"] == 0.01).all()
    for quantity, name in (("growth", "growth_rate"), ("frequency", "frequency_hz")):
        np.testing.assert_allclose(
            table[f"predicted_{quantity}_change"], table["change"] * table[f"d_{name}"]
        )
    zeta = -table["growth_rate"] / (2 * np.pi * table["frequency_hz"])
    np.testing.assert_allclose(table["damping_ratio"], zeta)
    held = table[~table["near_coalescence"] & table["disagreement"].notna()]
    assert held["disagreement"].median() < 0.05
    # speed does nothing without a fall of friction, and nothing is compared with round-off
    speed = table[table["parameter"] == "sliding_speed"]
    assert (speed["d_growth_rate"] == 0).all()
    assert speed["disagreement"].isna().all()
    outside = table["validity_range"] < table["change"].abs()
    assert ((outside | (table["condition"] >= 100)) == table["near_coalescence"]).all()
    assert 0 < table["near_coalescence"].mean() < 0.5


def test_slopes_beside_a_mode_of_negative_stiffness(tmp_path, monkeypatch):
    """It has no modal damping; slopes of the other mode by differences.

    Contact that has given way makes such a mode, in a state that is refused as steady sliding.
    """
    for where in (working_point, sliding):
        monkeypatch.setattr(where, "presses_open", lambda gap, *_: np.zeros(gap.shape[:-1], bool))
    given = {"k1": 1.31e6, "k2": 1.356e6, "contact_stiffness": 2.6e6, "friction": 0.6}
    given |= {"contact.cubic_stiffness": -5.4e17, "damping_ratio": 0.01, "normal_force": 2500.0}
    values = "\n".join(f'"{name}" = {value}' for name, value in given.items())
    names = [name for name in given if name != "damping_ratio"]
    asked = ", ".join(f'"{name}"' for name in names)
    text = f"""[study]
name = "gives_way"
kind = "sensitivity"
[model]
name = "hoffmann"
contact_law = "cubic"
[parameters]
{values}
[sensitivity]
modes = [226.0]
parameters = [{asked}]
"""
    table = solved(plan_of(text), tmp_path / "r").sensitivities.set_index("parameter")

    def growth(name, step):
        changed = given | {name: given[name] * (1 + step)}
        modes = squealstudy.model("hoffmann", contact_law="cubic", **changed).modes()
        assert modes["growth_rate"].max() > 1e3  # no oscillation
        near = (modes["frequency_hz"] - 226.0).abs().idxmin()
        return modes["growth_rate"][near]

    for name in names:
        slope = (growth(name, 1e-3) - growth(name, -1e-3)) / (2e-3 * given[name])
        assert table["d_growth_rate"][name] == pytest.approx(slope, rel=2e-3), name


def test_a_second_run_has_nothing_to_do(results):
    report = run_study(plan_of(HULTEN), results.directory, jobs=1)
    assert report.n_solved == 0
    other = run_study(plan_of(HULTEN.replace("num = 5", "num = 9")), results.directory, jobs=1)
    assert other.n_reused == 5
    assert other.n_solved == 4
    changed = HULTEN + "change = 0.02\n"  # a step is part of what a point is
    assert run_study(plan_of(changed), results.directory, jobs=1).n_reused == 0
    run_study(plan_of(HULTEN), results.directory, jobs=1)


def test_ranking_of_one_mode(results):
    table = results.sensitivities
    mode = mode_sensitivities(table)
    assert mode["growth_rate"].iloc[0] == table["growth_rate"].max()
    assert len(mode) == 5
    ranked = rank_sensitivities(mode, 3)
    sizes = ranked["growth_per_percent"].abs()
    assert len(ranked) == 3
    assert sizes.is_monotonic_decreasing
    assert sizes.iloc[0] == mode["growth_per_percent"].abs().max()
    point = str(results.points["point_id"].iloc[0])
    lower = mode_sensitivities(table, 76.0, point)
    assert lower["frequency_hz"].iloc[0] == pytest.approx(75.5, abs=1.0)
    with pytest.raises(ResultsError, match="no mode near 300"):
        mode_sensitivities(table, 300.0)


def test_other_tables_and_rankings_are_refused(results):
    for ask in (lambda: results.modes, lambda: results.rank(), lambda: results.growth):
        with pytest.raises(ResultsError, match="sensitivity"):
            ask()


def test_a_failed_point_has_no_count_of_modes(tmp_path):
    study = plan_of(HULTEN)
    rows = [failed_row(SCHEMA, task.point_id, "working_point", "lost") for task in study.tasks]
    store = Store(tmp_path)
    store.write_rows(rows, SCHEMA)
    build_tables(study, store)
    counts = pd.read_parquet(tmp_path / "points.parquet")["n_modes"]
    assert counts.isna().all()
    assert counts.dtype == "Int64"


def test_stable_design_gives_no_rows(tmp_path):
    text = HULTEN.replace("modes = 2\n", "").replace("stop = 0.5", "stop = 0.2")
    found = solved(text, tmp_path / "r")
    assert len(found.sensitivities) == 0
    assert (found.points["n_modes"] == 0).all()
    assert found.points["max_growth_rate"].isna().all()
    assert isinstance(found.plot.sensitivity(), Figure)
    none = "No mode that oscillates in the band is unstable at any of the 5 solved points: "
    assert found.screen.verdict(found).startswith(none)
    lost = found.points.assign(status="working_point")
    failed = found.with_tables(points=lost, sensitivities=found.sensitivities)
    assert failed.screen.verdict(failed).startswith("No design point is solved: ")


def test_defaults_and_families_of_component_modes():
    """Operating point, contact law and every elastic component mode."""
    asked = plan_of(BRAKE.replace('parameters = ["friction"]', "")).identity[1]
    assert asked[:4] == ["friction", "pressure", "contact.lambda", "sliding_speed"]
    assert "caliper.modes[*].frequency_scale" in asked
    assert "disc.modes[*].damping_ratio" in asked
    assert plan_of(HULTEN.replace("modes = 2\nparameters", "modes = 2\n#")).identity[1] == [
        "friction",
        "sliding_speed",
        "mass.modes[*].frequency_scale",
        "mass.modes[*].damping_ratio",
    ]


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ('"friction"', '"frction"', "sensitivity.parameters[1]", "did you mean 'friction'"),
        ('"friction"', '"friction", "friction"', "sensitivity.parameters", "listed twice"),
        ('"friction"', '"contact.stiffness"', "sensitivity.parameters[1]", "does nothing"),
        ('"friction"', '"contact.kt"', "sensitivity.parameters[1]", "in time only"),
        ('"friction"', '"modes[*].damping_ratio"', "sensitivity.parameters[1]", "mode numbers"),
        ('"friction"', '"callper.modes[*].damping_ratio"', "sensitivity", "caliper"),
        ('"friction"', '"caliper.modes[*].damping"', "sensitivity", "frequency_scale"),
        ("parameters", "modes = 0\nparameters", "sensitivity.modes", "number of modes"),
        ("parameters", 'modes = "fast"\nparameters', "sensitivity.modes", "unstable"),
        ("parameters", "modes = []\nparameters", "sensitivity.modes", "Hz"),
        ("parameters", "modes = [-3.0]\nparameters", "sensitivity.modes", "Hz"),
        ("parameters", "change = 0\nparameters", "sensitivity.change", "more than 0"),
        ("parameters", "step = 0.1\nparameters", "sensitivity.step", "unknown key"),
        ('"sensitivity"', '"complex_modes"', "", "[sensitivity] section needs"),
    ],
)
def test_bad_section_names_its_place(old, new, key, expected):
    with pytest.raises(StudyFileError) as caught:
        assert plan_of(BRAKE.replace(old, new, 1)).tasks[0]
    assert caught.value.key.startswith(key)
    assert expected in str(caught.value)
    assert caught.value.line is not None or not key


def test_modes_beyond_the_basis_are_refused(tmp_path):
    text = HULTEN.replace('"modes[1].damping_ratio"', '"mass.modes[3].damping_ratio"')
    with pytest.raises(StudyFileError, match="mass has modes 1 to 2 in this basis, got 3"):
        run_study(plan_of(text), tmp_path / "r", jobs=1)
    text = HULTEN.replace('"modes[1].damping_ratio"', '"modes[3].damping_ratio"')
    with pytest.raises(StudyFileError, match="the assembly has modes 1 to 2"):
        run_study(plan_of(text), tmp_path / "r", jobs=1)
    assert not (tmp_path / "r").exists()


# -- commands and picture -------------------------------------------------------------------------
def test_commands(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(HULTEN)
    assert command("run", "study.toml", "-j", "1") == 0
    screen = capsys.readouterr().out
    assert "sensitivities.parquet" in screen
    assert "frequency_1" in screen
    pictures = list(Path("results/slopes").glob("sensitivity_*.png"))
    assert len(pictures) == 2
    assert command("sensitivity", "results/slopes", "--top", "2") == 0
    assert "first 2 of 5 parameters" in capsys.readouterr().out
    assert command("sensitivity", "study.toml", "--csv", "--mode", "100", "-j", "1") == 0
    table = pd.read_csv(io.StringIO(capsys.readouterr().out))
    assert len(table) == 5
    assert table["growth_per_percent"].abs().is_monotonic_decreasing


def test_a_study_of_complex_modes_gives_its_nominal_sensitivities(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    text = HULTEN.split("[sensitivity]")[0].replace('"sensitivity"', '"complex_modes"')
    text = text.replace("[parameters]", "[parameters]\nfriction = 0.4")
    Path("study.toml").write_text(text)
    assert command("sensitivity", "study.toml", "-j", "1") == 0
    assert "sliding_speed" in capsys.readouterr().out
    found = squealstudy.open_results("results/slopes_sensitivity")
    assert len(found.points) == 1
    assert found.points["friction"].iloc[0] == 0.4


def test_bars_show_both_changes_and_hatch_the_meaningless(results):
    mode = rank_sensitivities(mode_sensitivities(results.sensitivities))
    mode = mode.assign(near_coalescence=[True, *[False] * 4])
    figure = sensitivity_bars(mode, top=4)
    bars = figure.axes[0].patches
    assert len(bars) == 8
    widths = [bar.get_width() for bar in bars]
    np.testing.assert_allclose(widths[:4], mode["predicted_growth_change"][:4])
    np.testing.assert_allclose(widths[4:], mode["finite_growth_change"][:4])
    assert [bool(bar.get_hatch()) for bar in bars] == [True] + [False] * 7
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels[0].startswith(mode["parameter"].iloc[0])
    assert step_text(mode[mode["parameter"] == "friction"].iloc[0]) == "+1 %"
    assert step_text(mode[mode["parameter"] == "damping_ratio"].iloc[0]) == "+0.01"


def test_what_moves_growth_most_is_told_by_reanalysis():
    """Of paper_sensitivity: to first order an outer pad's mode comes second, by reanalysis not."""
    rows = [
        ("disc.modes[26].frequency_scale", 27.41, 21.49),
        ("disc.modes[25].frequency_scale", -15.29, -15.64),
        ("outer_pad.modes[9].frequency_scale", -11.33, -11.27),
        ("caliper.modes[10].frequency_scale", -11.31, -11.49),
        ("caliper.modes[7].frequency_scale", -4.592, np.nan),
    ]
    names = ("parameter", "predicted_growth_change", "finite_growth_change")
    table = [
        dict(zip(names, row, strict=True))
        | {"component_frequency_hz": 4e3, "change": 0.01, "value": 1.0}
        for row in rows
    ]
    told = _strongest_in_words(table)
    assert told.startswith("Its growth falls most with disc.modes[25].frequency_scale")
    assert "(-15.6 1/s) and caliper.modes[10].frequency_scale" in told
    assert told.endswith("(+21.5 1/s).")
    assert _strongest_in_words(table[4:]).endswith("(-4.59 1/s).")  # where there is no other
    assert _strongest_in_words([]) == ""


def test_of_parameters_that_are_not_listed_too_one_may_move_growth_most(results):
    """Rows are ranked by 1 % of a parameter; by its own step another one may do more."""
    mode = mode_sensitivities(results.sensitivities)
    last = rank_sensitivities(mode).iloc[-1]["parameter"]
    table = results.sensitivities.copy()
    table.loc[table["parameter"] == last, "finite_growth_change"] = -1e4
    told = sensitivities(results.with_tables(sensitivities=table), top=1)
    assert told[1].startswith(f"Its growth falls most with {last} ")
