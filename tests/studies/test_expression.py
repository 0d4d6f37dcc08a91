"""Coefficients as text: values, and nothing but arithmetic."""

from __future__ import annotations

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.models.matrices.expression import Expression, ExpressionError

POINT = {"a": 1.7, "b": -0.6, "omega": 12.0}
VALUES = {
    "2": 2.0,
    "omega": 12.0,
    "1/omega - 1": 1 / 12 - 1,
    "1/(2*pi*1600)": 1 / (2 * math.pi * 1600),
    "-a**2": -(1.7**2),
    "2**3**2": 512.0,
    "a - b - 1": 1.7 + 0.6 - 1,
    "+a * -b": 1.7 * 0.6,
    "b**2 + b**3": 0.6**2 - 0.6**3,
    "log(e) + log10(100) + sqrt(4)": 5.0,
    "sin(a) + cos(a) + tan(a)": math.sin(1.7) + math.cos(1.7) + math.tan(1.7),
    "asin(0.5) + acos(0.5) + atan(a)": math.pi / 2 + math.atan(1.7),
    "exp(b) + abs(b)": math.exp(-0.6) + 0.6,
    "min(a, b, 3) + max(a, b, -3)": -0.6 + 1.7,
    "1e-3*1_000": 1.0,
}
BAD = {  # text: what the message says
    "__import__('os')": "'__import__' is no function",
    "a.real": "attribute",
    "().__class__": "attribute",
    "a[0]": "index",
    "a < b": "comparison",
    "[x for x in a]": "reserved word",
    "lambda": "'lambda' is a reserved word",
    "a if b else c": "reserved word",
    "a and b": "reserved word",
    "(a := 3)": "assignment",
    "a = 3": "no expression",
    "a // b": "operator",
    "a % b": "operator",
    "a ^ b": "operator",
    "~a": "operator",
    "f'{a}'": "text",
    "'a'": "no real number",
    "1j": "no real number",
    "True": "reserved word",
    "sin": "needs its argument",
    "sin(a, b)": "one argument",
    "sin(x=a)": "named arguments",
    "min(a)": "two arguments",
    "max(*a)": "two arguments",
    "foo(a)": "'foo' is no function",
    "a(b)": "'a' is no function",
    "1e999": "too large",
    "9" * 400: "too large",
    "": "no expression",
    "1 +": "no expression",
    "(a": "no expression",
    "a\nb": "one line",
    "µ": "ASCII",
    "-" * 200 + "1": "deep",
    "(" * 400 + "1" + ")" * 400: "no expression",
    "+".join(["a"] * 600): "at most 1000 characters",
}
WITHOUT_VALUE = {
    "1/(omega - 12)": "division by zero",
    "9**9**9": "too large",
    "exp(omega**4)": "too large",
    "1e308*10": "inf",
    "b**0.5": "domain",
    "log(b)": "domain",
    "0**b": "domain",
    "asin(omega)": "domain",
}


@pytest.mark.parametrize("text", VALUES)
def test_values(text):
    assert Expression(text).value(POINT) == pytest.approx(VALUES[text], rel=1e-15)


def test_names_are_those_used_once_each():
    assert Expression("b*a + b - sin(omega)*pi*e").names == ("b", "a", "omega")
    assert Expression("2*pi").names == ()


@pytest.mark.parametrize("text", BAD, ids=lambda text: text[:20])
def test_anything_else_is_refused_with_a_reason(text):
    with pytest.raises(ExpressionError, match=BAD[text]) as caught:
        Expression(text)
    assert len(str(caught.value)) < 2 * len(text) + 200


def test_the_position_is_named():
    with pytest.raises(ExpressionError, match="character 9: 'foo'"):
        Expression("1 + 2 * foo(3)")


@pytest.mark.parametrize("text", WITHOUT_VALUE)
def test_no_finite_value_says_why(text):
    expression, started = Expression(text), time.perf_counter()
    with pytest.raises(ExpressionError, match=WITHOUT_VALUE[text]):
        expression.value(POINT)
    assert time.perf_counter() - started < 1.0  # 9**9**9 is never multiplied out


def test_the_parameters_are_named_where_there_is_no_value():
    with pytest.raises(ExpressionError, match="no value at omega = 12: division"):
        Expression("1/(omega - 12)").value(POINT)


@given(st.text(alphabet="abw01.+-*/()[]{},'\"_ \\=:<>!%&|^~@#\n\t;einfortlambda", max_size=40))
def test_no_text_does_anything_but_parse_or_fail_clearly(text):
    try:
        expression = Expression(text)
        value = expression.value(dict.fromkeys(expression.names, 0.5))
    except ExpressionError:
        return
    assert isinstance(value, float)
    assert math.isfinite(value)
