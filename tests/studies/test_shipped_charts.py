"""Shipped work-precision studies, at reduced size, with one of their numbers."""

import re
from pathlib import Path

import pytest
from study_runs import load_plan

import squealstudy
from squealstudy.engine.runner import run_study

STUDIES = Path(__file__).parents[2] / "studies"


def measured(name, place, *changes):
    """Measurements of a shipped study with some of its text replaced."""
    text = (STUDIES / f"{name}.toml").read_text()
    for old, new in [
        (r"base = \"", f'base = "{STUDIES}/'),
        (r"repeats = \d+", "repeats = 1"),
        *changes,
    ]:
        assert re.search(old, text), old
        text = re.sub(old, new, text)
    path = place / f"{name}.toml"
    path.write_text(text)
    run_study(load_plan(path), place / "results", 1)
    table = squealstudy.open_results(place / "results").measurements
    return table[~table["reference"]].set_index("label")


@pytest.fixture(scope="module")
def belt(tmp_path_factory):
    """All integrators over a third of a second of stick-slip, at two settings each."""
    return measured(
        "integrators_belt",
        tmp_path_factory.mktemp("belt"),
        (r"points = 3", "points = 1"),
        (r"transient.save_every = 0", "transient.save_every = 0\ntransient.duration = 0.4"),
        (r"rtol = 1e-10", "rtol = 1e-8"),
        (r"values = \[0.25, 1.0\]", "values = [0.25, 0.5]"),
        (r"(values = \[\S+, \S+)\S*, .*\]", r"\1]"),
    )


@pytest.mark.full_size  # all seventeen; by default each by itself: test_integrators.py
def test_every_integrator_runs_and_implicit_ones_agree(belt):
    assert belt["method"].nunique() == 17
    newmark = belt[belt["method"] == "Newmark"]
    assert (newmark["status"] == "ok").all()
    assert newmark["error_torque_rms"].max() < 2e-2
    for name in ("HHT-alpha", "generalised alpha", "discrete gradient", "exponential"):
        own = belt[belt["method"] == name].iloc[0]
        assert own["status"] == "ok", name
        assert own["error_torque_rms"] < 5e-2, name


@pytest.mark.full_size
def test_outside_solvers_tighten_with_their_tolerance(belt):
    solver = belt[belt["method"] == "Radau"]
    errors = solver[["error_torque_rms", "error_torque_mean", "error_dominant_frequency"]]
    worst = errors.max(axis=1)  # one alone may be small by chance
    assert worst.iloc[-1] < min(1e-3, worst.iloc[0] / 2)


def test_integrators_through_lift_off(tmp_path):
    table = measured(
        "integrators_hoffmann",
        tmp_path,
        (r"points = 3", "points = 1"),
        (r"transient.save_every = 0", "transient.save_every = 0\ntransient.duration = 0.2"),
        (r"rtol = 1e-10", "rtol = 1e-8"),
        (
            r"(?s)\[\[method\]\]\nname = \"pre-warped.*?(\[\[method\]\]\nname = \"DOP853\")",
            r"\1",
        ),
        (r"(?s)\[\[method\]\]\nname = \"LSODA.*", ""),
        (r"(values = \[\S+, \S+)\S*, .*\]", r"\1]"),
    )
    good = table[table["method"].isin(("Newmark", "exponential"))]
    assert len(good) == 4
    assert (good["status"] == "ok").all()
    assert (good["error_torque_rms"] < 3e-2).all()
    assert (good["error_dominant_frequency"] < 1e-3).all()


@pytest.mark.full_size
def test_rungs_of_reanalysis(tmp_path):
    table = measured(
        "reanalysis",
        tmp_path,
        (r"points = 4", "points = 2"),
        (r"num = 400", "num = 24"),
        (
            r"\[work_precision.set\]",
            '[work_precision.set]\nmodel.mesh = "coarse"\n'
            "model.contact_points = 2\nmodes.band = [500.0, 2000.0]\nreduction.enrichment = false\n"
            "reduction.component_cutoff_factor = 3.0\nreduction.assembly_cutoff_factor = 3.0",
        ),
        (r"values = \[1e-2.*\]", "values = [1e-4]"),
        (r"(?s)\[\[method\]\]\nname = \"full order\".*", ""),
    )
    assert table.loc["dense", "error_frequency"] == 0.0
    assert table.loc["sweep basis, tolerance 0.0001", "error_frequency"] < 1e-4
    assert table.loc["two-step", "error_frequency"] > 1e-5
    assert (table[["missed", "n_failed"]].drop(index="perturbation").to_numpy() == 0).all()


@pytest.mark.full_size  # onsets of a brake: test_followed_root.py
def test_onset_of_the_brake(tmp_path):
    table = measured(
        "onset",
        tmp_path,
        (r"\npoints = 2", "\npoints = 1"),
        (r"num = 8", "num = 3"),
        (r"set.reduction\S+ = \S+\n", ""),
        (r"3500.0", "4000.0"),
        (
            r"modes.track = false",
            "modes.track = false\nmodes.refine_tracking = false\nreduction.enrichment = false",
        ),
        (r"(?s)\[\[method\]\]\nname = \"(dense|sweep basis|perturbation)\".*?(?=\[\[method)", ""),
        (r"(?s)\[\[method\]\]\nname = \"interpolated.*", ""),
    )
    errors = squealstudy.open_results(tmp_path / "results").errors
    onset = errors[errors["quantity"] == "onset"].set_index("label")
    assert 0.3 < onset.loc["dense, larger basis", "truth"] < 0.6  # the lock-in near 3.2 kHz
    assert 1e-3 < onset.loc["two-step", "error"] < 0.1
    assert table.loc["two-step", "missed"] == 0
    assert table.loc["two-step", "cost_onset"] > 3 * table.loc["two-step", "seconds_median"]
