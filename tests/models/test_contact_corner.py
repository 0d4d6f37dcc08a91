"""Contact that just touches: unilateral contact has no tangent there, smooth laws have one."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

import squealstudy as sq
from squealstudy.errors import ConvergenceError
from squealstudy.laws.contact_law import contact_law
from squealstudy.laws.corners import balanced_at_a_corner

BAND = (1.0, 1000.0)
HELD, CONTACT = 4e4, 1e6  # N/m
S, C = sin(0.5), cos(0.5)
BLOCK = f"""
[[mass]]
name = "block"
mass = 1.0
directions = ["x", "y"]

[[spring]]
between = ["block", "ground"]
direction = "x"
stiffness = {HELD}

[[spring]]
between = ["block", "ground"]
direction = "y"
stiffness = {HELD}

[parameters]
friction = 0.3
push = {{ default = 0.0, unit = "N" }}
"""
LEVEL, SLOPE = ('"y"', '"-x"'), (f"[{-S}, {C}]", f"[{-C}, {-S}]")


def contact(directions, gap=0.0):
    normal, sliding = directions
    return (
        f'[[contact]]\nbetween = ["block", "belt"]\nnormal = {normal}\nsliding = {sliding}\n'
        f"stiffness = {CONTACT}\ngap = {gap}\n"
    )


def load(direction, force, key="force"):
    return f'[[load]]\non = "block"\ndirection = {direction}\n{key} = {force}\n'


PUSH = load('"-y"', '"push"')
BALANCED = {
    "no load": contact(LEVEL) + PUSH,
    "loads that cancel but for round-off": contact(LEVEL)
    + "".join(load('"y"', f) for f in (0.1, 0.2, -0.3))
    + PUSH,
    "a load along the face": contact(SLOPE)
    + load(f"[{C}, {S}]", 50.0)
    + load(f"[{S}, {-C}]", '"push"'),
    "a pressure and a force": contact(LEVEL) + load('"-y"', 1e-4, "area") + load('"y"', 3.3) + PUSH,
    "a force that opens a preloaded gap": contact(LEVEL, -7e-5) + load('"y"', 2.8) + PUSH,
}


@pytest.fixture(params=BALANCED)
def text(request):
    return BLOCK + BALANCED[request.param]


def model(folder, text, law, **values):
    path = folder / "block.toml"
    path.write_text(text)
    values = {"pressure": 3.3e4} | values if "area" in text else values
    return sq.model(str(path), contact_law=law, **values)


def test_contact_that_just_touches_has_no_tangent(tmp_path, text):
    """A load of 1e-9 N to either side has one: closed or open, as springs in a row."""
    block = model(tmp_path, text, "unilateral")
    modes = block.at(push=np.array([0.0, 1e-9, -1e-9])).modes(BAND)
    assert list(modes.status) == ["working_point", "ok", "ok"]
    assert "a contact point just touches in steady sliding" in modes.message[0]
    closed, opened = np.abs(modes.lam[1:])
    assert closed[1] == pytest.approx(np.sqrt(HELD + CONTACT))
    assert opened[1] == pytest.approx(np.sqrt(HELD))
    with pytest.raises(ConvergenceError, match="a contact point just touches"):
        block.at().modes(BAND)
    with pytest.raises(ConvergenceError, match="a contact point just touches"):
        block.at().simulate(duration=0.01, step=1e-5, band=BAND)


def test_a_batch_of_one_and_small_loads(tmp_path):
    """Loads far below the others still press or open: round-off alone is undecided."""
    text = BLOCK + contact(LEVEL) + load('"-y"', 100.0) + load('"y"', 100.0) + PUSH
    block = model(tmp_path, text, "unilateral")
    for push, expected in ((1e-9, HELD + CONTACT), (-1e-9, HELD)):
        modes = block.at(push=push).modes(BAND)
        assert np.abs(modes.lam).max() == pytest.approx(np.sqrt(expected))


@pytest.mark.parametrize(
    ("law", "stiffness"),
    [("bilateral", CONTACT), ("cubic", CONTACT), ("power", 0.0)],
)
def test_smooth_laws_have_a_tangent_there(tmp_path, law, stiffness):
    """The power 3/2 too, which has no stiffness at a gap of 0."""
    block = model(tmp_path, BLOCK + contact(LEVEL) + PUSH, law)
    modes = block.at(push=np.array([0.0, 0.0])).modes(BAND)
    assert list(modes.status) == ["ok", "ok"]
    assert np.abs(modes.lam[0]).max() == pytest.approx(np.sqrt(HELD + stiffness))
    single = block.at().modes(BAND)
    assert np.abs(single.lam) == pytest.approx(np.abs(modes.lam[0]))


def two_stiffnesses(g):
    """Tangents of a law of outside that is twice as stiff below a gap of -2 um."""
    return np.where(g < -2e-6, 2.0, 1.0) * np.exp(-g / 1e-6)


def tangents(kind, **values):
    law = contact_law(kind, **values)
    return lambda g: law.evaluate(g)[1]


@pytest.mark.parametrize(
    ("law", "gap", "expected"),
    [
        (two_stiffnesses, -2e-6, True),
        (two_stiffnesses, -2e-6 * (1 + 1e-9), False),
        (two_stiffnesses, 0.0, False),
        (tangents("unilateral"), 0.0, True),
        (tangents("unilateral"), -1e-16, False),
        (tangents("unilateral"), 1e-16, False),
        (tangents("power", exponent=1.0), 0.0, True),
        (tangents("power", exponent=1.1), 0.0, False),
        (tangents("exponential"), 0.0, False),
        (tangents("exponential", lam=5e7), -1e-6, False),
    ],
)
def test_only_round_off_is_undecided(law, gap, expected):
    """Of gaps of some um: whole brakes have points a millionth of that from where they open."""
    gaps = np.array([[-3e-6, 2e-6, gap]])
    area = np.full((1, 3), 1e-4)
    assert balanced_at_a_corner(law, gaps, np.array([5e-6]), area) == [expected]
    area[0, 2] = 0.0  # a point without area has no stiffness
    assert not balanced_at_a_corner(law, gaps, np.array([5e-6]), area)[0]
