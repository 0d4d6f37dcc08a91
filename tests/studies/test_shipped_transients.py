"""Every shipped transient study, on the smallest brake and for a shorter time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from study_runs import plan_of, solved
from tiny_meshes import tiny_cache, tiny_meshes

from squealstudy.engine.comparison import compare_results
from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ResultsError
from squealstudy.models.catalogue.disc_brake.solids import COARSE

STUDIES = Path(__file__).parents[2] / "studies"


def reduced(name: str, duration: float, every: int = 1, **changes: str) -> Plan:
    """The study with the coarse mesh, a step of 2 us and a stronger start.

    Of listed values each `every`-th.
    """
    text = (STUDIES / f"{name}.toml").read_text().replace('"medium"', '"coarse"')
    text = re.sub(
        r"^values = \[(.*)\]",
        lambda found: f"values = [{', '.join(found[1].split(', ')[::every])}]",
        text,
        flags=re.MULTILINE,
    )
    text = re.sub(r"duration = \S+", f"duration = {duration}", text)
    text = text.replace("step = 1e-6", "step = 2e-6")
    text = text.replace("perturbation = 1e-3", "perturbation = 1e-2")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return plan_of(text, STUDIES / f"{name}.toml")


def results_of(plan: Plan, directory: Path) -> Results:
    results = solved(plan, directory)
    assert (results.points["status"] == "ok").all()
    return results


@pytest.fixture(scope="module")
def tiny():
    with tiny_meshes(tiny_cache()):
        yield


@pytest.fixture(scope="module")
def nominal(tiny, tmp_path_factory) -> Results:
    directory = tmp_path_factory.mktemp("shipped") / "squeal_nominal"
    return results_of(reduced("squeal_nominal", 0.06), directory)


def test_squeal_nominal(nominal):
    """Growth as predicted, then a bounded torque (Vermot des Roches et al. 2010, fig. 11)."""
    point = nominal.points.iloc[0]
    assert point["class"] == "limit_cycle"
    assert point["growth_rate"] == pytest.approx(point["predicted_growth_rate"], rel=0.005)
    assert point["torque_peak_to_peak"] < point["torque_static"]
    assert 0.05 * point["torque_static"] < point["torque_rms"] < 0.2 * point["torque_static"]
    assert point["torque_line_hz"] == pytest.approx(point["predicted_frequency_hz"], rel=0.05)
    assert abs(point["energy_balance"]) < 1e-3
    history = nominal.history(point["point_id"])
    early, late = history[history["time"] < 0.005], history[history["time"] > 0.05]
    assert late["torque"].std() > 10 * early["torque"].std()


@pytest.mark.full_size
def test_squeal_damping(nominal, tmp_path):
    """Damping the group of caliper modes quietens the limit cycle more than one of them."""
    changes = {'"results/squeal_nominal"': f'"{nominal.directory}"'}
    plan = reduced("squeal_damping", 0.01, every=3, **changes)  # none, one, the other, the group
    points = results_of(plan, tmp_path / "damping").points
    level = points["torque_rms"].to_numpy()
    assert level[0] == pytest.approx(nominal.points["torque_rms"][0], rel=0.03)
    assert level[3] < level[1] < level[0]
    assert level[3] < level[2] < level[0]
    assert points["caliper.modes[7].damping_ratio"].tolist() == [0.0, 0.1, 0.0, 0.1]
    assert (points["perturbation"] == 0.0).all()


@pytest.mark.full_size
def test_squeal_friction(tmp_path):
    """Eight friction coefficients: the growth rate that a user reads is the complex mode's."""
    with tiny_meshes(tmp_path / "cache", COARSE):  # others of this file have smaller ones
        results = results_of(reduced("squeal_friction", 0.04), tmp_path / "friction")
    points = results.points
    forecast = points["predicted_growth_rate"]
    error = points["growth_rate"] - forecast
    is_short = points["growth_method"] == "too_short"  # grows by half its size in the time
    assert (is_short == error.isna()).all()
    assert is_short.sum() <= 1
    assert (error.abs() < 0.03 * forecast.abs() + 0.1)[~is_short].all()
    assert (points.loc[forecast < 0, "class"] == "stable").all()
    assert (points.loc[forecast > 0, "class"] != "stable").all()
    assert (forecast > 0).sum() >= 4
    assert len(results.rank()) >= 1


@pytest.mark.full_size  # a brake in time
def test_steps_that_cannot_converge_are_told_before_and_are_a_row_after(nominal, tmp_path):
    """k_t far too large: `check` warns, the row has the time and the reason."""
    changes = {"friction = 0.5\n": 'friction = 0.5\n"contact.kt" = 1e13\n'}
    changes["perturbation = 1e-2"] = "perturbation = 2.0"  # enough to stick
    plan = reduced("squeal_nominal", 0.001, **changes)
    warned: list[str] = []
    with pytest.raises(ResultsError, match="the contact iteration did not converge"):
        run_study(plan, tmp_path / "stiff", jobs=1, warn=warned.append)
    assert any("friction is too stiff for the step" in text for text in warned)
    point = Results.open(tmp_path / "stiff").points.iloc[0]
    assert (point["status"], point["class"]) == ("not_converged", "failed")
    assert point["message"].startswith("t = ")


@pytest.mark.full_size  # small models: test_comparison.py
def test_compare_with_complex_modes(nominal, tmp_path):
    """The same model in both domains: the same growth rates, from one frequency study."""
    plan = reduced("squeal_modes", 0.0, every=3, **{"[modes]": "[modes]\nreference_points = 0"})
    run_study(plan, tmp_path / "modes", jobs=1)
    table = compare_results(Results.open(tmp_path / "modes"), nominal)
    assert len(table) == nominal.points["n_unstable"][0]
    np.testing.assert_allclose(table["growth_rate"], table["predicted_growth_rate"], rtol=1e-6)
    assert (table["deviation"].abs() < 0.03).all()
    assert table["expressed"].any()


@pytest.mark.full_size
def test_belt_oscillator(tmp_path):
    """Stick-slip below the speed ln(10)/2 = 1.151293 m/s, steady sliding above."""
    text = (STUDIES / "belt_oscillator.toml").read_text().replace("= 2.0 ", "= 1.0 ")
    plan = plan_of(text, STUDIES / "belt_oscillator.toml")
    points = results_of(plan, tmp_path / "belt").points
    stable = points["sliding_speed"] > np.log(10) / 2
    assert (points.loc[stable, "class"] == "stable").all()
    assert (points.loc[~stable, "class"].isin(["growing", "limit_cycle"])).all()
    assert (points.loc[points["sliding_speed"] < 0.8, "class"] == "limit_cycle").all()
