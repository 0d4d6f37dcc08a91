"""Values with units in study files: the same number as one converted by hand, one clear refusal."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.engine.schema import study_schema
from squealstudy.errors import StudyFileError
from squealstudy.models.catalogue import MODELS
from squealstudy.models.units import UNITS, Unit, in_unit_of
from squealstudy.study.definition import parse_study
from squealstudy.study.design import DesignPoint

HEAD = '[study]\nname = "s"\nkind = "complex_modes"\n[model]\nname = "disc_brake"\n'
RANDOM = '[design]\ntype = "sobol"\nsamples = 8\n'


def study_of(text):
    return parse_study(text, Path("study.toml"))


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("12 bar", "Pa", 12e5),
        ("2 GPa", "Pa", 2e9),
        ("-3 mm", "m", -3e-3),
        ("9.1mm", "m", 9.1e-3),
        ("+1.5e2 um", "m", 1.5e-4),
        ("3 µm", "m", 3e-6),
        ("5 km/h", "m/s", 5 / 3.6),
        ("30 deg", "deg", 30.0),
        ("1 rad", "deg", 180 / math.pi),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("200 degC", "degC", 200.0),
        ("473.15 K", "degC", 200.0),
        ("20 degC", "K", 293.15),
        ("200 N/mm3", "N/m3", 2e11),
        ("200 N/mm^3", "N/m3", 2e11),
        ("200 N/mm³", "N/m3", 2e11),
        ("1e6 N*s/m3", "N s/m3", 1e6),
        ("7.2 g/cm3", "kg/m3", 7200.0),
        ("0.5 1/um", "1/m", 5e5),
        ("25 cm2", "m2", 25e-4),
        ("20 kN/mm", "N/m", 2e7),
        ("1 N/mm/mm", "Pa", 1e6),
        ("0.15 us", "s", 1.5e-7),
        ("45 %", "", 0.45),
        ("14.5 psi", "Pa", 14.5 * 6894.757293168361),
    ],
)
def test_numbers_with_units(text, unit, number):
    assert in_unit_of(text, unit) == pytest.approx(number, rel=1e-15)


@given(
    st.decimals(-10000, 10000, places=4, allow_nan=False),
    st.sampled_from(sorted(set(UNITS) - {"degC", "°C", "1"})),
)
def test_the_number_is_the_nearest_to_the_exact_product(number, name):
    """As one writes the converted number: 9.1 mm is 0.0091, not 0.009099999999999999."""
    own = {UNITS[n][1]: n for n in ("1", "kg", "m", "s", "K", "rad", "N", "Pa", "J", "W", "Hz")}
    size, powers = UNITS[name]
    unit = own.get(powers, "rad/s")
    assert in_unit_of(f"{number} {name}", unit) == float(Fraction(number) * size)


def test_the_units_of_all_parameters_are_known():
    for model in MODELS.values():
        for parameter in model.parameters:
            if parameter.unit and "^n" not in parameter.unit:
                assert in_unit_of(f"3 {parameter.unit}", parameter.unit) == 3.0


def test_a_difference_of_temperatures_has_no_zero():
    assert in_unit_of("5 degC", "degC", difference=True) == 5.0
    assert in_unit_of("5 K", "degC", difference=True) == 5.0
    assert in_unit_of("5 degC", "K", difference=True) == 5.0
    assert in_unit_of("0.1 1/degC", "1/K") == 0.1


WITH_UNITS = """
[parameters]
disc.young_modulus = "110 GPa"
"pad.lining_thickness" = "9.1 mm"
pad = {half_angle = "30 deg"}

[[sweep]]
parameter = "pressure"
values = ["2 bar", 4e5, "0.8 MPa"]

[[sweep]]
parameter = "sliding_speed"
start = "1.8 km/h"
stop = "2 m/s"
num = 3
"""
PLAIN = """
[parameters]
disc.young_modulus = 110e9
"pad.lining_thickness" = 0.0091
pad = {half_angle = 30.0}

[[sweep]]
parameter = "pressure"
values = [2e5, 4e5, 8e5]

[[sweep]]
parameter = "sliding_speed"
start = 0.5
stop = 2.0
num = 3
"""


def test_a_study_with_units_is_that_of_its_numbers():
    """Its design points, and so their ids, are those of the SI values."""
    one, other = study_of(HEAD + WITH_UNITS), study_of(HEAD + PLAIN)
    assert one.values == other.values
    assert [s.values for s in one.sweeps] == [s.values for s in other.sweeps]
    assert one.definition == other.definition
    ids = [DesignPoint(s.model, s.options, s.values).structural_values() for s in (one, other)]
    assert ids[0] == ids[1]


def test_a_distribution_with_units():
    text = '[[sweep]]\nparameter = "pressure"\ndistribution = "truncated_normal"\n'
    text += 'mean = "12 bar"\nstd = "1 bar"\nstart = "5 bar"\nstop = "20 bar"\n'
    found = study_of(HEAD + RANDOM + text).sweeps[0].distribution
    assert (found.mean, found.std, found.start, found.stop) == (12e5, 1e5, 5e5, 20e5)
    text = '[[sweep]]\nparameter = "pressure"\ndistribution = "lognormal"\n'
    text += 'median = "12 bar"\nsigma = 0.1\n'
    assert study_of(HEAD + RANDOM + text).sweeps[0].distribution.mean == 12e5


def parameter(name, value, message):
    return f'[parameters]\n{name} = "{value}"\n', 7, f"parameters.{name}", message


@pytest.mark.parametrize(
    ("text", "line", "key", "message"),
    [
        (
            '[parameters]\npressure = "3 mm"\n',
            7,
            "parameters.pressure",
            "pressure is in Pa: got '3 mm'; expected such as Pa, hPa, kPa, MPa, GPa, bar, mbar",
        ),
        (
            '[parameters]\nfriction = "3 mm"\n',
            7,
            "parameters.friction",
            "friction is a pure number",
        ),
        (
            '[parameters]\nfriction = "0.4"\n',
            7,
            "parameters.friction",
            "expected a number, got '0.4'",
        ),
        (
            '[parameters]\npressure = "12"\n',
            7,
            "parameters.pressure",
            "expected a number, got '12'",
        ),
        parameter("pressure", "12 ber", "did you mean 'bar'"),
        parameter("pressure", "1e999 Pa", "too large"),
        (
            '[parameters]\npressure = "-1 bar"\n',
            7,
            "parameters.pressure",
            "above 0 Pa, got -100000",
        ),
        parameter("presure", "12 bar", "did you mean 'pressure'"),
        (
            '[[sweep]]\nparameter = "pressure"\nvalues = [1e5, "3 mm"]\n',
            8,
            "sweep[1].values[2]",
            "pressure is in Pa: got '3 mm'",
        ),
        (
            '[[sweep]]\nparameter = "hub.radius"\nstart = 0.05\nstop = "5 bar"\nnum = 2\n',
            9,
            "sweep[1].stop",
            "hub.radius is in m: got '5 bar'",
        ),
        (
            '[[sweep]]\nparameter = "nothing"\nvalues = ["3 mm"]\n',
            7,
            "sweep[1].parameter",
            "no parameter 'nothing'",
        ),
    ],
)
def test_a_wrong_unit_is_one_message(text, line, key, message):
    with pytest.raises(StudyFileError) as caught:
        study_of(HEAD + text)
    assert (caught.value.line, caught.value.key) == (line, key)
    assert message in str(caught.value)


def test_modes_of_components_are_pure_numbers():
    text = '[parameters]\n"caliper.modes[13].damping_ratio" = "2 %"\n'
    assert study_of(HEAD + text).values["caliper.modes[13].damping_ratio"] == 0.02


@pytest.mark.parametrize("text", ["N/m s", "mmm", "/m", "m/", "m**2", "m^0", "N//m", "m 2"])
def test_what_is_no_unit(text):
    with pytest.raises(KeyError):
        Unit.named(text)


def test_the_schema_takes_texts_for_values_of_parameters():
    schema = study_schema()
    sweep = schema["$defs"]["SweepSection"]["properties"]
    for key in ("start", "stop", "mean", "std", "median"):
        assert sweep[key]["type"] == ["number", "string"]
    assert sweep["values"]["items"]["type"] == ["number", "string"]
    assert "string" in schema["properties"]["parameters"]["additionalProperties"]["type"]
