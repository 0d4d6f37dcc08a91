"""Values with units, as study files give them: "12 bar", "-3 mm", "2 GPa", "30 deg".

A text is converted into a number in the parameter's own unit before a file is checked further, so
that computations, names and hashes use numbers only. Conversion is in exact fractions, rounded
once: "9.1 mm" is 0.0091 to the last bit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from squealstudy.errors import ParameterError
from squealstudy.models.parameter_names import StudyParameter
from squealstudy.shown_units import UnitAsWritten
from squealstudy.wording import did_you_mean, shown

if TYPE_CHECKING:
    from squealstudy.parameter import Parameter

# exponents of kilogram, metre, second, kelvin, radian
Powers = tuple[int, int, int, int, int]
PURE: Powers = (0, 0, 0, 0, 0)
MASS, LENGTH, TIME, KELVIN, ANGLE = (
    (1, 0, 0, 0, 0),
    (0, 1, 0, 0, 0),
    (0, 0, 1, 0, 0),
    (0, 0, 0, 1, 0),
    (0, 0, 0, 0, 1),
)
FORCE: Powers = (1, 1, -2, 0, 0)
STRESS: Powers = (1, -1, -2, 0, 0)
ENERGY: Powers = (1, 2, -2, 0, 0)
POWER: Powers = (1, 2, -3, 0, 0)
RATE: Powers = (0, 0, -1, 0, 0)
TURN = 2 * Fraction(math.pi)

# name -> (size in SI units as an exact fraction, powers)
UNITS: dict[str, tuple[Fraction, Powers]] = {
    name: (Fraction(size), powers)
    for powers, sizes in (
        (PURE, {"1": "1", "%": "1e-2"}),
        (MASS, {"kg": "1", "g": "1e-3", "mg": "1e-6", "t": "1e3"}),
        (LENGTH, {"m": "1", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6", "μm": "1e-6"}),
        (LENGTH, {"nm": "1e-9", "km": "1e3", "in": "0.0254"}),
        (TIME, {"s": "1", "ms": "1e-3", "us": "1e-6", "µs": "1e-6", "μs": "1e-6"}),
        (TIME, {"min": "60", "h": "3600"}),
        (KELVIN, {"K": "1"}),
        (ANGLE, {"rad": "1"}),
        (FORCE, {"N": "1", "mN": "1e-3", "kN": "1e3", "MN": "1e6"}),
        (STRESS, {"Pa": "1", "hPa": "1e2", "kPa": "1e3", "MPa": "1e6", "GPa": "1e9"}),
        (STRESS, {"bar": "1e5", "mbar": "1e2", "psi": "6894.757293168361"}),
        (ENERGY, {"J": "1", "mJ": "1e-3", "kJ": "1e3"}),
        (POWER, {"W": "1", "kW": "1e3"}),
        (RATE, {"Hz": "1", "kHz": "1e3", "MHz": "1e6"}),
    )
    for name, size in sizes.items()
}
UNITS["deg"] = UNITS["°"] = (TURN / 360, ANGLE)
UNITS["rpm"] = (TURN / 60, (0, 0, -1, 0, 1))
CELSIUS = ("degC", "°C")  # of temperatures; a difference of two is in kelvins
UNITS |= dict.fromkeys(CELSIUS, (Fraction(1), KELVIN))
ZERO_CELSIUS = Fraction("273.15")
# abbreviations of quotients
SHORT = {"kph": "km/h", "kmh": "km/h", "mps": "m/s"}

MOST_NAMED = 7  # units that an error names

QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)(?![eE][+-]?[0-9])"
    r"\s*(?P<unit>[^\s\d.].{0,40}?|1/.{1,40}?)\s*"
)
FACTOR = re.compile(r"(?P<name>[^\W\d_]+|°C|°|%|1)(?:\^?(?P<power>-?[1-9]))?")
SIGNS = {"²": "2", "³": "3", "·": " ", "⋅": " ", "−": "-"}


@dataclass(frozen=True)
class Unit:
    """A unit as a product of powers of SI units.

    Attributes
    ----------
    name : str
        Name as written.
    size : Fraction
        Size in SI units.
    powers : tuple of int
        Exponents of kilogram, metre, second, kelvin, radian.
    """

    name: str
    size: Fraction
    powers: Powers

    @classmethod
    def named(cls, text: str) -> Unit:
        """The unit of a text such as ``N s/m3``; KeyError with the part that is no unit.

        Factors are separated by blanks or *; every divisor has its own slash, as in ``m/s/s``.
        """
        plain = text
        for character, written in SIGNS.items():
            plain = plain.replace(character, written)
        above, *below = SHORT.get(plain, plain).split("/")
        first = re.split(r"[ *]+", above.strip()) if plain else []
        factors: list[tuple[str, int]] = [(word, 1) for word in first]
        factors += [(word.strip(), -1) for word in below]
        size, powers = Fraction(1), PURE
        for word, sign in factors:
            match = FACTOR.fullmatch(word)
            if match is None or match["name"] not in UNITS:
                raise KeyError(word)
            power = int(match["power"] or 1)
            factor, dimension = UNITS[match["name"]]
            size *= Fraction(factor**power) ** sign
            powers = _product(powers, dimension, sign * power)
        return cls(text, size, powers)


def _product(powers: Powers, other: Powers, power: int) -> Powers:
    a, b, c, d, e = (x + power * y for x, y in zip(powers, other, strict=True))
    return a, b, c, d, e


def in_unit_of(text: str, unit: str, difference: bool = False) -> float:
    """The number that a text such as ``12 bar`` stands for, in `unit`.

    Parameters
    ----------
    text : str
        A number and its unit.
    unit : str
        Unit of the parameter; empty for a pure number.
    difference : bool
        Whether the number is a difference, such as a standard deviation: of temperatures it is then
        converted without the offset of the zero.

    Raises
    ------
    ValueError
        The text is wrong; the message continues a sentence that begins with the parameter's name.
    """
    expectation = f"is in {unit}" if unit else "is a pure number"
    match = QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(f"{expectation}: expected a number and its unit, got {shown(text)}")
    try:
        target = Unit.named(unit)
    except KeyError:  # such as Pa/m^n, where the exponent n is a parameter
        raise ValueError(f"{expectation}: expected a number, got {shown(text)}") from None
    try:
        written = Unit.named(match["unit"])
    except KeyError as error:
        word = str(error.args[0])
        fitting = UNITS  # in a product or quotient any unit may be meant
        if word == match["unit"]:
            fitting = {k: v for k, v in UNITS.items() if v[1] == target.powers} or UNITS
        hint = did_you_mean(word, fitting) if word.isalpha() else ""
        raise ValueError(
            f"{expectation}: got {shown(text)}, whose unit is not known{hint}"
        ) from None
    if written.powers != target.powers:
        fitting_names = [name for name, (_, powers) in UNITS.items() if powers == target.powers]
        expected = f"; expected such as {', '.join(fitting_names[:MOST_NAMED])}"
        has_unit = bool(unit and fitting_names)
        raise ValueError(f"{expectation}: got {shown(text)}{expected * has_unit}")
    in_si = Fraction(match["number"]) * written.size
    if not difference:
        in_si += ZERO_CELSIUS * ((written.name in CELSIUS) - (target.name in CELSIUS))
    try:
        return float(in_si / target.size)
    except OverflowError:
        raise ValueError(f"{expectation}: got {shown(text)}, a number too large") from None


def _unit_of(text: str) -> str:
    match = QUANTITY.fullmatch(text)
    return match["unit"] if match else ""


def unit_as_written(texts: Sequence[str], unit: str) -> str:
    """`unit` of a parameter, with the unit in which texts such as ``12 bar`` give its values.

    The first text decides on columns, `UnitAsWritten.of_size` on single values. Pure numbers and
    temperatures keep the unit of tables.
    """
    try:
        target = Unit.named(unit)
        units = [Unit.named(name) for name in dict.fromkeys(map(_unit_of, texts))]
    except KeyError:
        return unit
    if units[0].powers != target.powers or target.powers in (PURE, KELVIN):
        return unit
    written, *others = (
        (u.name, float(u.size / target.size)) for u in units if u.powers == target.powers
    )
    return UnitAsWritten(unit, *written, tuple(others))


def with_bare_unit(value: Any, parameter: Parameter) -> Any:
    """A bare number as a text with its unit, where such numbers are not in the parameter's unit."""
    bare = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value!r} {parameter.bare}" if bare and parameter.bare else value


def quantity(value: Any, parameter: StudyParameter) -> Any:
    """A value of a parameter; a text with a unit is made a number, or ParameterError is raised.

    Other values are returned unchanged, for the parameter's own check.
    """
    if not isinstance(value, str):
        return value
    try:
        return in_unit_of(value, parameter.unit, parameter.difference)
    except ValueError as error:
        raise ParameterError(parameter.name, str(error)) from None
