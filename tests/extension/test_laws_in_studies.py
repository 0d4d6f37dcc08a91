"""Laws from outside that contradict themselves only at a study's values, or its working points."""

from __future__ import annotations

from dataclasses import replace

import pytest
import test_contact_law
import test_friction_curve
from command import HERE, laws_alone
from study_runs import command

import squealstudy as sq
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES
from squealstudy.study.definition import parse_study

CURVE, LAW = test_friction_curve.FILE, test_contact_law.FILE
SLOPE = "-friction * share * share / "
ELSEWHERE = "(3.0 if g > -1e-4 or abs(g + 2.3e-4) < 1e-6 else 2.0) * cube"
SWEEP = '[[sweep]]\nparameter = "{}"\nvalues = {}\n'


@pytest.fixture(autouse=True)
def _registers():
    """What the tests register in this process ends with them."""
    with laws_alone():
        yield


def written(folder, file, old, new):
    """A law of this folder, changed."""
    text = (HERE / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


def study_of(module, more="", kind="complex_modes"):
    return module.STUDY.format(kind=kind) + more


def refusal(text, folder):
    with pytest.raises(StudyFileError) as caught:
        parse_study(text, folder / "study.toml")
    return caught.value


def test_slopes_are_compared_at_the_values_of_a_study(tmp_path):
    """The default of the parameter is 1e6 Pa, the study's 5e7 Pa."""
    written(tmp_path, CURVE, SLOPE + "fade", SLOPE + "min(fade, 2e6)")
    error = refusal(study_of(test_friction_curve), tmp_path)
    assert error.key == "model.friction_law"
    assert "my_friction_curve.py: mu of law 'fading': dmu/dp at s = 0.0437 m/s" in error.message


@pytest.mark.parametrize("end", [0, 1])
def test_slopes_are_compared_at_both_ends_of_a_sweep(tmp_path, end):
    wrong = ("min(fade, 6e7)", "(2.0 * fade if 2e7 < fade < 4e7 else fade)")[end]
    written(tmp_path, CURVE, SLOPE + "fade", SLOPE + wrong)
    values = ([5e7, 9e7], [3e7, 5e7])[end]
    more = SWEEP.format("friction_law.fade_pressure", values)
    error = refusal(study_of(test_friction_curve, more), tmp_path)
    assert error.key == "sweep[1]"
    assert f"with friction_law.fade_pressure = {(9e7, 3e7)[end]:g}" in error.message


def test_a_contact_law_is_tried_at_the_values_of_a_study(tmp_path):
    written(tmp_path, LAW, "3.0 * cube * g * g", "3.0 * min(cube, 1.2e18) * g * g")
    error = refusal(study_of(test_contact_law), tmp_path)
    assert error.key == "model.contact_law"
    assert "my_contact_law.py: pressure of law 'cube': dp/dg at g =" in error.message


@pytest.mark.parametrize(
    ("module", "file", "old", "new"),
    [
        (test_friction_curve, CURVE, SLOPE + "fade", SLOPE + "(fade if p < 2e7 else 2.0 * fade)"),
        (
            test_contact_law,
            LAW,
            "3.0 * cube",
            "(3.0 if g > -1e-4 or abs(g + 2.3e-4) < 1e-6 else 2.0) * cube",
        ),
    ],
)
def test_laws_are_tried_at_the_pressures_of_working_points(
    tmp_path, module, file, old, new, monkeypatch, capsys
):
    """At none of those at which they were tried before; the row says so, with no growth rate."""
    written(tmp_path, file, old, new)
    (tmp_path / "study.toml").write_text(study_of(module))
    monkeypatch.chdir(tmp_path)
    assert command("run", "study.toml", "--jobs", "1", "--yes", "--no-pictures") == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "every design point failed (1 contradictory_law)" in told
    assert f"{file}: {'mu' if file == CURVE else 'pressure'} of law" in told


REFUSED = [
    ('[parameters]\n"contact.p0" = 1e5\n', "parameters.contact.p0", "contact_law bilateral"),
    (SWEEP.format("contact.exponent", [1, 2]), "sweep[1].parameter", "contact_law bilateral"),
]


@pytest.mark.parametrize(("more", "key", "text"), REFUSED)
def test_a_parameter_of_a_law_that_is_not_chosen_is_refused(more, key, text):
    head = '[study]\nname = "x"\nkind = "complex_modes"\n[model]\nname = "hoffmann"\n'
    error = refusal(head + more, HERE)
    assert error.key == key
    assert "does nothing here" in error.message
    assert text in error.message


def test_so_it_is_by_the_python_face_and_listed_with_its_law():
    with pytest.raises(ParameterError, match=r"belongs to contact_law exponential, and this is"):
        sq.model("hoffmann", **{"contact.p0": 2e5})
    chosen = sq.model("hoffmann", **{"contact.p0": 2e5, "contact_law": "exponential"})
    laws = chosen.parameters["laws"]
    assert laws["contact.stiffness"] == "contact_law unilateral or bilateral or cubic or power"
    assert laws["friction"] == ""
    assert sq.model("disc_brake", **{"contact.p0": 2e5}).given  # the law by default has it


def test_slopes_for_sensitivities_are_compared_too():
    curve = FRICTION_CURVES["exponential_fall"]
    curve.expect_consistent_at(0.5, 1e6, 0.4, (2.0, 0.3))

    def slopes(*arguments):
        rows = list(curve.slopes(*arguments))
        return [*rows[:3], (2.0 * rows[3][0], *rows[3][1:]), rows[4]]

    wrong = replace(curve, slopes=slopes)
    expected = r"slopes of law .* d mu / d friction_law\.static_ratio is 0\.151"
    with pytest.raises(ModelError, match=expected):
        wrong.expect_consistent_at(0.5, 1e6, 0.4, (2.0, 0.3))


@pytest.mark.parametrize("function", ["gap_at", "evaluate", "slopes", "mean_pressure"])
def test_all_that_a_contact_law_may_give_is_compared(function):
    law = CONTACT_LAWS["power"]
    values = (3e12, 2.0)

    def twice(*arguments):
        found = getattr(law, function)(*arguments)
        if function == "slopes":
            return [found[0], (2.0 * found[1][0], found[1][1]), *found[2:]]
        return (found[0], 2.0 * found[1]) if function == "evaluate" else 2.0 * found

    law.expect_consistent_at(-2e-6, values)
    with pytest.raises(ModelError, match="twice of law 'power'"):
        replace(law, **{function: twice}).expect_consistent_at(-2e-6, values)
