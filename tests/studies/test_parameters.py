"""The grammar of parameter names."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.errors import ParameterError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.parameter_names import (
    QUANTITIES,
    ModeParameter,
    PlainParameter,
    check_disjoint,
    parse_parameter,
)
from squealstudy.study.design import DesignPoint
from squealstudy.wording import did_you_mean

BRAKE = MODELS["disc_brake"]


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_every_parameter_of_every_model_is_plain(model):
    for parameter in model.parameters:
        found = parse_parameter(parameter.name, model)
        assert isinstance(found, PlainParameter)
        assert (found.name, found.default) == (parameter.name, parameter.default)
        assert (found.unit, found.structural) == (parameter.unit, parameter.structural)
        assert found.check(found.default) == found.default


@pytest.mark.parametrize(
    ("numbers", "modes"),
    [("13", (13,)), ("12-14", (12, 13, 14)), ("3,7-9", (3, 7, 8, 9)), ("9, 1-2", (1, 2, 9))],
)
def test_mode_parameters(numbers, modes):
    name = f"caliper.modes[{numbers}].frequency_scale"
    found = parse_parameter(name, BRAKE)
    assert found == ModeParameter(name, "caliper", modes, "frequency_scale")
    assert (found.default, found.unit, found.structural) == (1.0, "", False)
    assert parse_parameter("disc.modes[7].damping_ratio", BRAKE).default == 0.0


@pytest.mark.parametrize(("numbers", "modes"), [("44", (44,)), ("3,7-9", (3, 7, 8, 9))])
def test_modes_of_the_assembly(numbers, modes):
    name = f"modes[{numbers}].damping_ratio"
    found = parse_parameter(name, MODELS["hulten"])
    assert found == ModeParameter(name, "", modes, "damping_ratio")
    assert (found.default, found.unit, found.structural) == (0.0, "", False)
    assert found.check(1) == 1.0
    for value in (-0.1, 1.1, float("nan"), "1"):
        with pytest.raises(ParameterError):
            found.check(value)


@given(
    st.sampled_from(BRAKE.components),
    st.sets(st.integers(1, 300), min_size=1, max_size=12),
    st.sampled_from(QUANTITIES),
    st.booleans(),
)
def test_grammar_round_trip(component, modes, quantity, ranges):
    name = f"{component}.modes[{_written(sorted(modes), ranges)}].{quantity}"
    found = parse_parameter(name, BRAKE)
    assert found == ModeParameter(name, component, tuple(sorted(modes)), quantity)


def _written(modes: list[int], ranges: bool) -> str:
    """Mode numbers as a list, neighbours as a range where asked for."""
    runs: list[list[int]] = []
    for mode in modes:
        if ranges and runs and runs[-1][-1] == mode - 1:
            runs[-1].append(mode)
        else:
            runs.append([mode])
    return ",".join(str(r[0]) if len(r) == 1 else f"{r[0]}-{r[-1]}" for r in runs)


@pytest.mark.parametrize(
    ("name", "fragment"),
    [
        ("fricton", "did you mean 'friction'"),
        ("disc.young_moduls", "did you mean 'disc.young_modulus'"),
        ("xyzzy", "'squealstudy models' lists"),
        ("", "no parameter ''"),
        ("rotor.modes[3].damping_ratio", "components are disc, inner_pad, outer_pad, caliper"),
        ("caliper.modes[0].damping_ratio", "numbers from 1 to 10000, got '0'"),
        ("caliper.modes[0-3].damping_ratio", "numbers from 1 to 10000, got '0-3'"),
        ("caliper.modes[-1].damping_ratio", "expected mode numbers from 1 like"),
        ("caliper.modes[].damping_ratio", "expected mode numbers from 1 like"),
        ("caliper.modes[3,].damping_ratio", "expected mode numbers from 1 like"),
        ("caliper.modes[1.5].damping_ratio", "expected mode numbers from 1 like"),
        ("caliper.modes[٣].damping_ratio", "expected mode numbers from 1 like"),
        ("caliper.modes[9-7].damping_ratio", "ascending range of modes, got '9-7'"),
        ("caliper.modes[7-9,8].damping_ratio", "appears twice"),
        ("caliper.modes[1-999999999].damping_ratio", "from 1 to 10000"),
        ("caliper.modes[3].stiffness", "frequency_scale or damping_ratio"),
        ("caliper.modes[3]", "expected a name like"),
        ("modes[3].frequency_scale", "modes of the assembly have damping_ratio only"),
        ("modes[3].frequency_scale", "expected '<component>.modes[3].frequency_scale'"),
        ("modes[3].mass", "frequency_scale or damping_ratio"),
        ("modes[0].damping_ratio", "numbers from 1 to 10000, got '0'"),
        ("modes[].damping_ratio", "expected mode numbers from 1 like"),
        (".modes[3].damping_ratio", "expected a name like"),
        ("modes[3]", "'modes[44].damping_ratio'"),
        ("caliper.modes.damping_ratio", "expected a name like"),
        ("caliper.modes[3].damping_ratio ", "expected a name like"),
    ],
)
def test_unknown_names_say_what_was_expected(name, fragment):
    with pytest.raises(ParameterError) as caught:
        parse_parameter(name, BRAKE)
    assert caught.value.key == name
    assert fragment in caught.value.message


@given(st.text(alphabet="caliperdsmo.[]-,0123456789_ ", max_size=40))
def test_any_name_is_known_or_a_parameter_error(name):
    try:
        found = parse_parameter(name, BRAKE)
    except ParameterError as error:
        known = error.key
    else:
        known = found.name
    assert known == name


@pytest.mark.parametrize(
    ("quantity", "good", "bad"),
    [
        ("frequency_scale", (0.5, 1, 10.0), (0.0, -1.0, 10.1, float("nan"), True, "1")),
        ("damping_ratio", (0, 0.5, 1.0), (-0.1, 1.01, float("inf"), False, None)),
    ],
)
def test_values_of_mode_parameters_are_bounded(quantity, good, bad):
    parameter = parse_parameter(f"caliper.modes[7].{quantity}", BRAKE)
    assert [parameter.check(v) for v in good] == [float(v) for v in good]
    for value in bad:
        with pytest.raises(ParameterError) as caught:
            parameter.check(value)
        assert caught.value.key == parameter.name


def _parsed(*names: str):
    return [parse_parameter(name, BRAKE) for name in names]


@pytest.mark.parametrize(
    ("first", "second", "what"),
    [
        (
            "caliper.modes[12-14].damping_ratio",
            "caliper.modes[14].damping_ratio",
            "caliper mode 14",
        ),
        ("modes[2-4].damping_ratio", "modes[4].damping_ratio", "assembly mode 4"),
    ],
)
def test_two_names_for_the_same_mode_are_an_error(first, second, what):
    with pytest.raises(ParameterError) as caught:
        check_disjoint(_parsed("friction", first, second))
    assert caught.value.key == second
    assert caught.value.message == f"'{second}' and '{first}' both set damping_ratio of {what}"


def test_other_quantities_components_modes_and_the_same_name_are_no_error():
    check_disjoint(
        _parsed(
            "caliper.modes[12-14].damping_ratio",
            "caliper.modes[12-14].damping_ratio",
            "caliper.modes[12-14].frequency_scale",
            "disc.modes[12-14].damping_ratio",
            "caliper.modes[15].damping_ratio",
            "modes[12-14].damping_ratio",
        )
    )


def test_closest_words():
    assert did_you_mean("pressur", ["pressure", "friction"]) == "; did you mean 'pressure'?"
    assert did_you_mean("zzz", ["pressure", "friction"]) == ""


def test_a_point_of_other_values_has_no_id():
    values = dict(BRAKE.defaults())
    point = DesignPoint(BRAKE, {}, values, point_id="a", structure="b")
    structural = next(p.name for p in BRAKE.parameters if p.structural)
    slower = point.with_values(values | {"sliding_speed": 0.5 * values["sliding_speed"]})
    thicker = point.with_values(values | {structural: 1.1 * values[structural]})
    assert (slower.point_id, slower.structure) == ("", "b")
    assert (thicker.point_id, thicker.structure) == ("", "")
