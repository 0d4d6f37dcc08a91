"""Assumptions of models and methods: where they fail, and how loudly."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from study_runs import plan_of, solved
from study_texts import study_text

from squealstudy.cli import app as cli
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.engine.validity import (
    open_reason,
    parameter_reasons,
    points_by_rule,
    with_validity,
)
from squealstudy.errors import StudyFileError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.parameter import Assumption
from squealstudy.tables.validity import CLOSED_RULE, OLD_CLOSED_RULE, pulling_rows, validity_counts

STUDY = (
    study_text("s", "{kind}", "{model}")
    + """\
{more}
[modes]
band = [1.0, 1000.0]
reference_points = 0
"""
)
FRICTION = """
[[sweep]]
parameter = "friction"
values = [0.2, 0.9, 1.2]
"""
TIME = """
[transient]
duration = 0.1
step = 2e-5
perturbation = 1.0
"""


def reasons_by_point(found):
    """Reasons of each design point that breaks an assumption, by its position."""
    reasons = {}
    for broken in found:
        for row, text in broken.texts():
            reasons.setdefault(row, []).append(text)
    return reasons


def text_of(model: str, more: str, kind: str = "complex_modes") -> str:
    return STUDY.format(kind=kind, model=model, more=more)


def planned(model: str, more: str, kind: str = "complex_modes") -> Plan:
    return plan_of(text_of(model, more, kind))


def points_of(tmp_path: Path, *args: str) -> pd.DataFrame:
    return solved(planned(*args), tmp_path / "r").points


# -- inputs that no physics allows


@pytest.mark.parametrize(
    ("model", "name", "value", "expected"),
    [
        ("hulten", "friction", -1.0, "at least 0"),
        ("hulten", "friction", 50.0, "at most 5"),
        ("hulten", "damping_ratio", 314.0, "at most 1"),
        ("hulten", "stiffness_damping", -1e-6, "at least 0"),
        ("belt", "stiffness", -1.0, "a value above 0"),
        ("disc_brake", "disc.poisson_ratio", 0.5, "below 0.5"),
        ("disc_brake", "caliper.poisson_ratio", -1.0, "above -1"),
        ("disc_brake", "pad.lining_poisson_ratio", 1.0, "below 1"),
        ("disc_brake", "pad.half_angle", 200.0, "below 180"),
    ],
)
@pytest.mark.parametrize("swept", [False, True])
def test_what_no_physics_allows_is_an_error_at_its_key(model, name, value, expected, swept):
    more = f'[parameters]\n"{name}" = {value}'
    if swept:
        more = f'[[sweep]]\nparameter = "{name}"\nvalues = [{value}]'
    with pytest.raises(StudyFileError) as error:
        planned(model, more)
    message = str(error.value)
    assert message.startswith("study.toml, line ")
    assert name in message
    assert expected in message


def test_parameters_with_units_have_no_bound_but_zero():
    """A bound of 1 s on Rayleigh's beta is another one in milliseconds."""
    for model in MODELS.values():
        for p in model.parameters:
            if p.unit not in ("", "deg"):
                assert np.isinf([p.maximum, p.below]).all(), p.name
                assert p.minimum in (0.0, -np.inf), p.name
    assert planned("hulten", "[parameters]\nstiffness_damping = 1e6").tasks.without_names(0)


def test_materials_that_contract_or_swell_sideways_are_allowed():
    for text in ('"disc.poisson_ratio" = -0.2', '"pad.lining_poisson_ratio_z" = 0'):
        assert planned("disc_brake", f"[parameters]\n{text}").tasks.without_names(0)


# -- points outside


def test_friction_above_one_is_outside_hultens_model(tmp_path):
    points = points_of(tmp_path, "hulten", FRICTION)
    assert (points["status"] == "ok").all()
    assert points["valid"].dtype == "boolean"
    assert points["valid"].tolist() == [True, True, False]
    assert points["invalid_reason"].tolist()[:2] == ["", ""]
    reason = points["invalid_reason"].iloc[2]
    assert reason.startswith("both contacts press only for friction below 1: 1.2; ")
    assert "share of its area that lifts off: 0.36" in reason
    table = pq.read_table(tmp_path / "r" / "points.parquet")
    assert table.column_names[-2:] == ["valid", "invalid_reason"]


def reasons(plan) -> list[str]:
    """Of its first point."""
    return reasons_by_point(parameter_reasons(plan)).get(0, [])


def test_hultens_bound_is_that_of_the_friction_at_its_sliding_speed():
    """1.0 itself unloads one contact; friction that has fallen with speed counts as it is."""
    law = '[parameters]\nfriction = 0.6\n"friction_law.static_ratio" = 2.0\nsliding_speed = {}'
    at_rest, fast = (reasons(planned("hulten", law.format(v))) for v in (1e-3, 5.0))
    assert at_rest == ["both contacts press only for friction below 1: 1.199"]
    assert fast == []
    assert reasons(planned("hulten", "[parameters]\nfriction = 1.0"))
    assert reasons(planned("hoffmann", "[parameters]\nfriction = 1.2")) == []
    dry = reasons(planned("hoffmann", "[parameters]\nfriction = 2.5"))
    assert dry == ["static friction of dry contacts is at most 2: 2.5"]


def test_assumptions_of_many_points_are_those_of_each():
    law = '[parameters]\n"friction_law.static_ratio" = 1.5\n'
    sweeps = "".join(
        f'[[sweep]]\nparameter = "{name}"\nvalues = {values}\n'
        for name, values in (
            ("friction", [0.5, 0.9, 1.0, 3.0]),
            ("damping_ratio", [0.0, 0.3]),
            ("sliding_speed", [0.1, 4.0]),
        )
    )
    plan = planned("hulten", law + sweeps)
    found = reasons_by_point(parameter_reasons(plan))
    for i, task in enumerate(plan.tasks):
        own = {k: v for k, v in task.values.items() if k in plan.study.shown_parameters}  # noqa: PD011
        alone = "[parameters]\n" + "".join(f'"{k}" = {v}\n' for k, v in own.items())
        assert found.get(i, []) == reasons(planned("hulten", alone))
    counts = dict(points_by_rule(parameter_reasons(plan)))
    assert counts["modal damping is light, a ratio of at most 0.2"] == 8


def test_a_group_that_takes_numbers_alone_is_asked_point_by_point():
    rule = Assumption("small", lambda v: max(v["a"], 1.0) * v["b"], 2.0)
    assert rule.values({"a": np.array([0.5, 3.0]), "b": 2.0}, 2).tolist() == [2.0, 6.0]
    assert rule.values({"a": 4.0, "b": 0.5}, 3).tolist() == [2.0] * 3


def test_overdamped_modes_are_no_quiet_design(tmp_path):
    """beta = 1 s is a damping ratio of pi f = 314 at 100 Hz: nothing oscillates."""
    points = points_of(tmp_path, "hulten", "[parameters]\nstiffness_damping = 1.0")
    assert points["n_modes"].fillna(0).tolist() == [0]
    assert points["valid"].tolist() == [False]
    reason = "modes of the band are damped below critical, damping ratio: 314.2"
    assert points["invalid_reason"].tolist() == [reason]


@pytest.mark.parametrize(("beta", "valid"), [(3.1e-3, True), (3.2e-3, False)])
def test_critical_damping_is_where_the_highest_mode_of_the_band_has_it(tmp_path, beta, valid):
    points = points_of(tmp_path, "hulten", f"[parameters]\nstiffness_damping = {beta}")
    assert points["valid"].tolist() == [valid]  # pi beta 100 Hz = 1 at 3.183e-3 s


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("damping_ratio", 0.25, "modal damping is light, a ratio of at most 0.2: 0.25"),
        ("modes[3].damping_ratio", 0.3, "modal damping is light, a ratio of at most 0.2: 0.3"),
        ("caliper.modes[8].damping_ratio", 1.0, "component modes are damped below critical: 1"),
        ("caliper.modes[8].damping_ratio", 0.5, ""),
        ("caliper.modes[8].frequency_scale", 1.5, ""),
        ("pressure", 3e8, "strains of the lining are small, at most 0.02: 0.06228"),
    ],
)
def test_dubious_parameters_of_the_brake(name, value, rule):
    found = reasons(planned("disc_brake", f'[parameters]\n"{name}" = {value}'))
    assert found == ([rule] if rule else [])


def test_a_contact_mostly_open_and_points_that_failed():
    plan = planned("disc_brake", FRICTION)
    table = pd.DataFrame({"status": ["ok", "inaccurate", "working_point"]})
    found = with_validity(plan, table.assign(open_share=[0.5, 0.51, np.nan]))
    assert found["valid"].tolist() == [True, False, pd.NA]
    reasons = ["", "the contact is closed over 50% of its area or more, open share: 0.51", ""]
    assert found["invalid_reason"].tolist() == reasons
    assert validity_counts(found)[:2] == (1, 2)
    assert open_reason("bilateral", 0.0) == open_reason("exponential", 0.5) == ""
    assert open_reason("bilateral", 0.01).endswith(": 0.01")
    assert validity_counts(table) == (0, 0, [])  # of an earlier version


def test_in_time_a_bilateral_contact_that_pulls_and_a_far_kick():
    plan = planned("hoffmann", "[parameters]\nsliding_speed = 0.08" + FRICTION + TIME, "transient")
    table = pd.DataFrame({"status": "ok", "class": "limit_cycle"}, index=range(3))
    table = table.assign(open_share=0.1, open_share_max=[0.0, 1.0, 0.0])
    table = table.assign(perturbation=[0.1, 0.1, 1.0], invalid_reason=["", "", "a step: long"])
    found = with_validity(plan, table)
    assert found["valid"].tolist() == [True, False, False]
    _, pulls, kicked = found["invalid_reason"]
    assert pulls.endswith("share of its area that lifts off: 1")
    assert kicked.startswith("a step: long; the disturbance is at most 10 times the sliding speed")
    assert kicked.endswith("far from steady sliding: 12.5")
    assert found.columns[-2:].tolist() == ["valid", "invalid_reason"]


@pytest.mark.parametrize(
    ("step", "told"),
    [(1e-3, "4.5 steps:"), (5e-4, "8.9 steps:"), (2e-4, "22 steps and"), (5e-5, "")],
)
def test_growth_that_the_step_does_not_resolve_is_told(tmp_path, step, told):
    """Hoffmann's oscillator just beyond its onset: steps shift what couples the two modes."""
    more = """
[parameters]
friction = 0.78
damping_ratio = 0.01
sliding_speed = 5.0
"""
    time = TIME.replace("2e-5", f"{step}").replace("= 1.0", "= 1e-6")
    text = text_of("hoffmann", more, "transient") + time
    point = solved(text, tmp_path / "results").points.iloc[0]
    assert point["status"] == "ok"
    assert bool(point["valid"]) == (not told)
    if told:
        rule = "the step resolves the fastest mode: a period of the mode at 224.2 Hz has "
        assert point["invalid_reason"].startswith(rule + told)
    else:
        assert point["growth_rate"] == pytest.approx(point["predicted_growth_rate"], rel=0.05)


def test_round_off_without_friction_is_no_limit_cycle(tmp_path):
    """Nothing disturbs, nothing rubs: energies of 1e-35 J are rest."""
    more = "[parameters]\nfriction = 0.0\ndamping_ratio = 0.01\nsliding_speed = 5.0\n"
    time = TIME.replace("= 1.0", "= 0.0").replace("0.1", "0.05").replace("2e-5", "5e-5")
    text = text_of("hoffmann", more, "transient") + time
    point = solved(text, tmp_path / "results").points.iloc[0]
    assert (point["status"], point["class"], point["message"]) == ("ok", "stable", "")
    assert bool(point["valid"])


def test_what_decays_in_the_band_is_not_stable_while_a_mode_below_it_grows(tmp_path):
    """Hoffmann's oscillator at its onset: 221.6 Hz grows slowly, what was kicked decays first."""
    more = "[parameters]\nfriction = 0.752\ndamping_ratio = 0.01\nsliding_speed = 5.0\n"
    time = TIME.replace("= 1.0", "= 1e-3").replace("0.1", "0.05").replace("2e-5", "5e-5")
    text = text_of("hoffmann", more, "transient").replace("[1.0, 1000.0]", "[228.0, 1000.0]")
    point = solved(text + time, tmp_path / "results").points.iloc[0]
    assert (point["n_unstable"], point["n_unstable_above"], point["n_unstable_below"]) == (0, 0, 1)
    assert point["class"] == "undecided"


def test_matrices_have_no_contact_to_judge(tmp_path):
    import scipy.io
    import scipy.sparse as sp

    for name, size in (("m", 1.0), ("k", 1e6)):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", sp.eye(3, format="csr") * size)
    terms = "".join(
        f'[[model.term]]\nmatrix = "{name.upper()}"\nfile = "{tmp_path / name}.mtx"\n'
        for name in ("m", "k")
    )
    points = points_of(tmp_path, "matrices", terms)
    assert points["valid"].tolist() == [True]


# -- screens


def test_screens_say_how_many_points_are_outside_and_why(tmp_path, capsys):
    path = tmp_path / "study.toml"
    path.write_text(text_of("hulten", FRICTION))
    cli.check(path, tmp_path / "r", 1)
    said = " ".join(capsys.readouterr().out.split())
    wanted = (
        "1 of 3 points will be outside: 1 breaks 'both contacts press only for friction below 1'"
    )
    assert wanted in said
    run_study(planned("hulten", FRICTION), tmp_path / "r", jobs=1)
    cli.rank(tmp_path / "r")
    said = " ".join(capsys.readouterr().out.split())
    assert "1 of 3 solved design points is outside validity: 1 breaks 'both contacts" in said
    cli.rank(tmp_path / "r", where="valid", csv=True)
    assert pd.read_csv(io.StringIO(capsys.readouterr().out))["unstable_share"].tolist() == [0.5]
    cli.rank(tmp_path / "r", csv=True)
    assert "validity" not in capsys.readouterr().out


def test_robust_says_it_too(tmp_path, capsys):
    more = '[design]\ntype = "sobol"\nsamples = 16\n[[sweep]]\nparameter = "friction"\n'
    more += "start = 0.5\nstop = 1.5"
    run_study(planned("hulten", more), tmp_path / "r", jobs=1)
    cli.robust(tmp_path / "r")
    said = " ".join(capsys.readouterr().out.split())
    assert "8 break 'both contacts press only for friction below 1'" in said
    assert "of 16 solved design points are outside validity: " in said


def test_models_are_valid_at_their_defaults():
    for model in MODELS.values():
        assert not any(a.values(model.defaults(), 1)[0] > a.most for a in model.assumptions)
    assert {name for name, model in MODELS.items() if model.assumptions} == set(MODELS)


@pytest.mark.parametrize("rule", [CLOSED_RULE, OLD_CLOSED_RULE])
def test_results_made_before_tell_a_contact_that_pulls(rule):
    points = pd.DataFrame({"invalid_reason": ["", f"{rule}: 0.4"], "valid": [True, False]})
    assert pulling_rows(points).tolist() == [1]
