"""Claims of Vermot des Roches et al. 2010 on tables of known answers, and the page of them."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from made_results import made
from transient_tables import growth_table, modes_table, points_table

import squealstudy

PAPER = Path(__file__).parents[2] / "studies" / "paper"
ALONE, GROUP = "caliper.modes[7]", "caliper.modes[8-9]"
RATIOS = [0.0, 0.02, 0.05, 0.10, 0.02, 0.05, 0.10]
OTHERS = [0.0, 0.0, 0.0, 0.0, 0.02, 0.05, 0.10]


@pytest.fixture(scope="module")
def script():
    """The script, whose folder is on the path as where it is run."""
    sys.path.insert(0, str(PAPER))
    try:
        import paper as found
    finally:
        sys.path.remove(str(PAPER))
    return found


def of_modes(points, growth):
    """Complex modes: growth[k] has that of each track at point k, in 1/s."""
    rows = [
        {"point_id": f"p{k}", "track": track, "frequency_hz": 3000.0 + 100 * track}
        | {"growth_rate": rate, "unstable": rate > 0, "overdamped": False}
        | {"error_estimate": 0.1, "track_ambiguous": False}
        | {"energy_disc": 0.4, "energy_caliper": 0.3}
        | {"energy_inner_pad": 0.05, "energy_outer_pad": 0.15, "energy_interfaces": 0.1}
        for k, own in enumerate(growth)
        for track, rate in enumerate(own)
    ]
    ids = [f"p{k}" for k in range(len(growth))]
    points = pd.DataFrame({"point_id": ids, "status": "ok", **points})
    columns = ["track", "onset", "direction", "status"]
    onsets = pd.DataFrame([(0, 0.291, "in", "refined")], columns=columns)
    return made(points=points, modes=pd.DataFrame(rows), onsets=onsets)


def in_time(kinds, levels, dominant, energies):
    """Seven runs with more and more damping, or the first of them alone."""
    n = len(kinds)
    parameters = {f"{ALONE}.damping_ratio": RATIOS[:n], f"{GROUP}.damping_ratio": OTHERS[:n]}
    columns = {"torque_rms": levels, "dominant_mode": dominant}
    points = points_table(parameters, kinds, **columns)
    for name in ("harmonic_2_level", "harmonic_3_level", "dominant_level"):
        points[name] = 0.2 if name.startswith("harmonic") else 2.0
    points["open_share"], points["energy_balance"], points["n_coordinates"] = 0.1, 1e-4, 500
    points["perturbation"] = 1e-3
    modes = modes_table({f"p{k}": {44: e, 45: 1 - e} for k, e in enumerate(energies)})
    growth = growth_table([("p0", 1, 3200.0, 300.0, 303.0, 0.6), ("p0", 2, 4900.0, 20.0, None, 0)])
    growth["unstable"], growth["expressed"] = True, growth["level_share"] > 0.05
    return made(kind="transient", points=points, modes=modes, growth=growth)


@pytest.fixture
def found(script):
    """A brake that does all that is claimed."""
    scale, damping = f"{ALONE}.frequency_scale", f"{ALONE}.damping_ratio"
    grid = {scale: [0.5, 1.0, 0.5, 1.0], f"{GROUP}.frequency_scale": [1.0, 1.0, 0.5, 0.5]}
    shifted = of_modes(grid, [(-1.0, 40.0), (90.0, -5.0), (20.0, -5.0), (60.0, -5.0)])
    grid = {damping: [0.0, 0.5, 0.0, 0.5], f"{GROUP}.damping_ratio": [0.0, 0.0, 0.5, 0.5]}
    damped = of_modes(grid, [(90.0, -5.0), (50.0, 7.0), (50.0, -5.0), (-2.0, -3.0)])
    nominal = of_modes({"friction": [0.3, 0.5]}, [(1.0, -5.0), (90.0, 3.0)])
    nominal.points["reference_frequency_error"] = [1e-5, float("nan")]
    nominal.points["reference_damping_error"] = [2e-5, float("nan")]
    sensitivities = pd.DataFrame(
        {"point_id": "p0", "mode": 1, "frequency_hz": 3000.0, "growth_rate": 90.0}
        | {"component": ["disc", "caliper"], "component_mode": [9, 7]}
        | {"growth_per_percent": [3.0, -8.0], "near_coalescence": False}
    )
    cycles = ["limit_cycle"] * 6 + ["growing"]
    levels = [60.0, 50.0, 40.0, 45.0, 50.0, 30.0, 20.0]
    runs = in_time(
        cycles, levels, [44, 44, 44, 45, 44, 44, 45], [1, 0.9, 0.8, 0.1, 0.9, 0.5, 0.001]
    )
    one = in_time(["limit_cycle"], [60.0], [44], [1.0])
    projection = pd.DataFrame(
        {"basis": ["modes below 8 kHz", "all coordinates"], "truncated": [True, False]}
        | {"mac": [0.999, 1.0], "outer_pad": [1e-3, 0.0]}
    )
    sensitivity = made(kind="sensitivity", sensitivities=sensitivities)
    return script.Found(nominal, sensitivity, shifted, damped, one, one, runs, projection)


def test_a_brake_that_does_what_is_claimed_agrees_with_all_of_it(script, found):
    answers = {claim.text: told["band"] for claim, told in script.compared({"band": found})}
    assert len(answers) == 19
    assert {text: said for text, said in answers.items() if said[0] != "agrees"} == {}


def test_a_brake_that_does_not_is_said_to_differ(script, found):
    """Stable before it is shifted, handed on by the group's damping, no cycle."""
    modes = found.frequency.modes.assign(unstable=lambda t: (t["track"] == 1) & t["unstable"])
    gone = found.frequency.with_tables(points=found.frequency.points, modes=modes)
    both = found.damping.modes.assign(unstable=lambda t: t["track"] == 0)
    loud = found.damping.with_tables(points=found.damping.points, modes=both)
    stopped = in_time(["stable"] * 7, [0.0] * 7, [44] * 7, [1.0] * 7)
    other = replace(found, frequency=gone, damping=loud, damped=stopped, squeal=stopped)
    told = {claim.figure: said["x"] for claim, said in script.compared({"x": other})}
    assert told["8, left"][0] == "cannot be told"  # nothing is unstable that could be handed on
    assert told["9"][0] == told["10"][0] == "does not"
    assert told["14, above"][0] == "cannot be told"
    assert told["11"][0] == "cannot be told"
    assert told["16"][0] == "cannot be told"


def answers_of(script, found, *figures):
    """Verdicts and sentences of these figures, in the order of the claims."""
    return [told["x"] for c, told in script.compared({"x": found}) if c.figure in figures]


def test_a_mode_unstable_at_the_lowest_friction_comes_before_the_first_onset(script, found):
    found.stability.onsets.loc[1] = (1, float("nan"), "in", "below_range")
    ((_, said),) = answers_of(script, found, "5")
    assert "1 is so at a friction of 0.3 already; the next turns unstable at a friction of" in said


def test_a_brake_that_is_silent_between_two_levels_is_so_in_part(script, found):
    """Unstable again with most damping; a lost track is not called stable."""
    damping = found.damping
    grid = pd.DataFrame({f"{ALONE}.damping_ratio": [0.0, 0.2, 0.5]}).assign(
        **{f"{GROUP}.damping_ratio": [0.0, 0.2, 0.5]}
    )
    again = of_modes(grid, [(90.0, -5.0), (-2.0, -3.0), (-2.0, 4.0)])
    assert answers_of(script, replace(found, damping=again), "10")[0][0] == "partly"
    shifted = found.frequency
    known = shifted.modes[(shifted.modes["track"] != 0) | (shifted.modes["growth_rate"] > 0)]
    lost = shifted.with_tables(points=shifted.points, modes=known)
    told = answers_of(script, replace(found, frequency=lost, damping=damping), "8, left")
    assert told[0] == ("cannot be told", "stable at 0 of 2 values; not followed to -50 %")


def test_a_cycle_goes_on_at_its_level_whatever_its_first_run_is_called(script, found):
    damped = found.damped
    undecided = damped.points.assign(**{"class": ["undecided", *damped.points["class"][1:]]})
    named = replace(found, damped=damped.with_tables(points=undecided, modes=damped.modes))
    assert answers_of(script, named, "14, above")[0][0] == "agrees"
    louder = undecided.assign(torque_rms=[70.0, *undecided["torque_rms"][1:]])
    other = replace(found, damped=damped.with_tables(points=louder, modes=damped.modes))
    verdict, said = answers_of(script, other, "14, above")[0]
    assert verdict == "cannot be told"
    assert said.startswith("there is no cycle to damp; 0 %: undecided, 70.0 N m")


def test_a_mode_that_the_reduced_model_misses_is_told(script, found):
    found.stability.manifest["reference"] = [{"missed_modes": 0}, {"missed_modes": 1}]
    (told,) = (t["x"] for c, t in script.compared({"x": found}) if c.figure == "section 1.2")
    assert told[0] == "partly"
    assert told[1].endswith("1 of its modes missed")


def test_failed_points_answer_nothing(script, found):
    lost = found.damping.points.assign(status="not_converged")
    none = found.damping.with_tables(points=lost, modes=found.damping.modes.iloc[:0])
    told = script.compared({"x": replace(found, damping=none)})
    said = [answer["x"][0] for claim, answer in told if claim.figure in ("9", "10")]
    assert said == ["cannot be told"] * 2


def test_the_page_has_every_claim_with_its_answers(script, found):
    text = script.page({"band": found, "shipped": found}, {"band": [], "shipped": []}, {"x": 2.0})
    for claim, _ in script.compared({}):
        assert claim.text in text
    assert text.count("**agrees**") == 2 * 19
    assert "| agrees | 19 | 19 |" in text
    assert "{" not in text.replace("{table", "")


@pytest.mark.parametrize("setting", ["band", "shipped"])
def test_studies_of_both_settings_are_valid(script, setting, monkeypatch):
    monkeypatch.chdir(PAPER.parents[1])
    for what in script.STUDIES:
        study = script.Runs.study(what, setting)
        values = dict(study.resolved.values)
        expected = (0.02, 0.0) if setting == "band" else (0.005, 1.5e-7)
        assert (values["damping_ratio"], values["stiffness_damping"]) == expected
        assert values.get("modes[1-60].damping_ratio", 0.005) == (0.0, 0.005)[setting != "band"]
        assert study.tables["study"]["name"].startswith("paper_")
        assert isinstance(study, squealstudy.face.Study)
