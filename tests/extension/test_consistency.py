"""Laws from outside whose functions contradict each other, or parameters of a model: refused."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from squealstudy.errors import ExtensionError, ModelError
from squealstudy.extensions import load_extension
from squealstudy.laws import CONTACT_LAWS
from squealstudy.laws.friction_law import FRICTION_CURVES
from squealstudy.models.catalogue import MODELS

HERE = Path(__file__).parent
CURVE = (HERE / "my_friction_curve.py").read_text(encoding="utf-8")
LAW = (HERE / "my_contact_law.py").read_text(encoding="utf-8")
RETURN = "return friction * share, 0.0 * s, -friction * share * share / fade"
MU = "def mu(s: float, p: float, friction: float, fade: float)"
CURVES = {
    "dmu/dp at s = 0.0437 m/s, p = 130000 Pa is 0, differences give -": (
        "-friction * share * share / fade",
        "0.0",
    ),
    "dmu/ds at s = 0.0437 m/s, p = 130000 Pa is 1, differences give 0": ("0.0 * s", "1.0"),
    "expected to take (s, p, friction, friction_law.fade_pressure)": (", fade: float)", ")"),
    "expected mu, dmu/ds, dmu/dp as finite numbers, got 0.3": (RETURN, "return friction * share"),
    "NameError: name 'exp' is not defined": ("max(p, 0.0) / fade", "exp(p)"),
    "expected mu to be 0 at s = 0.0437 m/s, p = 130000 Pa with a friction of 0": (
        "return friction * share",
        "return 0.1 + friction * share",
    ),
}


def changed(tmp_path, text, old, new):
    assert old in text
    path = tmp_path / "changed_law.py"
    path.write_text(text.replace(old, new).replace('name="fading"', 'name="changed"'))
    return path


@pytest.mark.parametrize("message", CURVES)
def test_a_friction_curve_that_contradicts_itself_is_refused(tmp_path, message):
    path = changed(tmp_path, CURVE, *CURVES[message])
    with pytest.raises(ExtensionError) as caught:
        load_extension(path)
    assert f"changed_law.py: mu of law 'changed': {message}" in str(caught.value)
    assert "changed" not in FRICTION_CURVES.names


@pytest.mark.parametrize("function", ["pressure", "potential"])
def test_a_contact_law_that_contradicts_itself_is_refused(function):
    law = CONTACT_LAWS["unilateral"]

    def twice(g, *parameters):
        found = getattr(law, function)(g, *parameters)
        return (found[0], 2.0 * found[1]) if function == "pressure" else 2.0 * found

    with pytest.raises(ModelError, match=r"of law .unilateral.: (dp|-p, which is dU).dg,? at g ="):
        replace(law, **{function: twice}).expect_consistent()


def test_the_laws_of_the_package_are_consistent():
    for law in (*FRICTION_CURVES, *CONTACT_LAWS):
        if law.in_package:
            law.expect_consistent()
    assert "exponential" in CONTACT_LAWS.names


def test_a_parameter_of_a_model_is_not_taken_by_a_law(monkeypatch):
    """The default of the law would replace that of the model, in studies of other laws too."""
    curve = FRICTION_CURVES["exponential_fall"]
    angle = type(curve.parameters[0])("alpha1", 4.0, "Pa", "something else")
    other = type(curve)(
        name="heavy",
        description="with a name of the model's",
        parameters=(angle,),
        mu=lambda s, p, friction, alpha1: (friction, 0.0, 0.0),
    )
    monkeypatch.setitem(FRICTION_CURVES._known, "heavy", other)
    with pytest.raises(ModelError, match="'alpha1' is a parameter of the model hoffmann"):
        MODELS["hoffmann"].defaults()
    assert math.isfinite(MODELS["disc_brake"].defaults()["friction"])
    assert MODELS["belt"].defaults()["friction_law.static_ratio"] == 2.0  # its own default
