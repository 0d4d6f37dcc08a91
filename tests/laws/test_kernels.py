"""Contact laws: closed form, tangent against central differences, NaN, and the readable twin."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.errors import ModelError
from squealstudy.kernels.laws import contact_at, law_row
from squealstudy.kernels.newmark_layout import LAW_CONTACT
from squealstudy.laws import (
    CONTACT_LAWS,
    REGULARISATIONS,
    ContactLaw,
    FrictionCurve,
    FrictionLaw,
    contact_law,
)
from squealstudy.laws.contact.exponential import sinh_over

LAWS = {
    "exponential": contact_law("exponential", p0=1e5, lam=5e5),
    "unilateral": contact_law("unilateral", stiffness=5e11),
    "power": contact_law("power", stiffness=3e14, exponent=1.5),
    "bilateral": contact_law("bilateral", stiffness=5e11),
    "cubic": contact_law("cubic", stiffness=5e11, cubic=3e22),
}
GAPS = np.array([-8e-6, -3e-6, -1e-7, 1e-7, 2e-6, 9e-6])


def gaps(low=-2e-5, high=2e-5):
    return st.floats(low, high, allow_nan=False)


@pytest.mark.parametrize("kind", LAWS)
def test_tangent_is_minus_the_slope(kind):
    # central differences away from the kink at g = 0
    h = 1e-10
    p_plus, _ = LAWS[kind].evaluate(GAPS + h)
    p_minus, _ = LAWS[kind].evaluate(GAPS - h)
    _, kappa = LAWS[kind].evaluate(GAPS)
    np.testing.assert_allclose(kappa, (p_minus - p_plus) / (2 * h), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize(
    ("kind", "gap", "pressure", "tangent"),
    [
        ("exponential", 0.0, 1e5, 5e10),
        ("exponential", -math.log(2) / 5e5, 2e5, 1e11),
        ("unilateral", -2e-6, 1e6, 5e11),
        ("unilateral", 2e-6, 0.0, 0.0),
        ("unilateral", 0.0, 0.0, 0.0),
        ("power", -4e-6, 3e14 * 8e-9, 3e14 * 1.5 * 2e-3),
        ("power", 4e-6, 0.0, 0.0),
        ("power", 0.0, 0.0, 0.0),
        ("bilateral", -2e-6, 1e6, 5e11),
        ("bilateral", 2e-6, -1e6, 5e11),
        ("cubic", -2e-6, 1e6 + 2.4e5, 5e11 + 3.6e11),
        ("cubic", 2e-6, -1e6 - 2.4e5, 5e11 + 3.6e11),
        ("cubic", 0.0, 0.0, 5e11),
    ],
)
def test_closed_form(kind, gap, pressure, tangent):
    p, kappa = LAWS[kind].evaluate(np.array([gap]))
    assert p[0] == pytest.approx(pressure, rel=1e-14)
    assert kappa[0] == pytest.approx(tangent, rel=1e-14)


@pytest.mark.parametrize("kind", LAWS)
def test_nan_stays_nan(kind):
    p, kappa = LAWS[kind].evaluate(np.array([-1e-6, np.nan, 1e-6]))
    assert np.isnan(p).tolist() == [False, True, False]
    assert np.isfinite(kappa[[0, 2]]).all()


def test_exponential_is_clipped_not_infinite():
    p, kappa = LAWS["exponential"].evaluate(np.array([-1.0]))
    assert p[0] == pytest.approx(1e5 * math.exp(200.0))
    assert np.isfinite(kappa[0])


@given(gap=gaps(), kind=st.sampled_from(sorted(LAWS)))
def test_agrees_with_the_readable_twin(gap, kind):
    law = LAWS[kind]
    p, kappa = law.evaluate(np.array([gap]))
    a, b = (*law.parameters, 1.0)[:2]
    assert p[0] == pytest.approx(reference.contact_pressure(kind, a, b, gap), rel=1e-13)
    # subnormal gaps: (-g)^b / (-g) of the kernel against (-g)^(b-1)
    if gap == 0 or abs(gap) > 1e-200:
        assert kappa[0] == pytest.approx(reference.contact_tangent(kind, a, b, gap), rel=1e-13)


@pytest.mark.parametrize("kind", LAWS)
def test_compiled_and_python_agree(kind):
    # the same source, interpreted: what NUMBA_DISABLE_JIT=1 runs
    law = LAWS[kind]
    plain, row = law.definition.pressure, law_row(law, FrictionLaw(0.5, 1.0))
    p, kappa = law.evaluate(GAPS)
    for i, gap in enumerate(GAPS):
        assert plain(gap, *law.parameters) == pytest.approx((p[i], kappa[i]), rel=1e-14)
        assert contact_at(row, gap) == pytest.approx((p[i], kappa[i]), rel=1e-14)


@given(gap=st.tuples(gaps(), gaps()), kind=st.sampled_from(sorted(LAWS)))
def test_pressure_never_grows_as_the_gap_opens(gap, kind):
    p, kappa = LAWS[kind].evaluate(np.sort(gap))
    assert p[0] >= p[1]
    assert (kappa >= 0).all()


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("pressure", [1e3, 1e6])
def test_gap_at_inverts_the_law(kind, pressure):
    law = LAWS[kind]
    p, kappa = law.evaluate(np.array([law.gap_at(pressure)]))
    assert p[0] == pytest.approx(pressure, rel=1e-12)
    # over its gap scale the law changes by its own size
    assert kappa[0] * law.gap_scale(pressure) == pytest.approx(
        pressure * (law.value("contact.exponent") if kind == "power" else 1.0), rel=1e-12
    )


@pytest.mark.parametrize("kind", LAWS)
def test_pressure_is_the_slope_of_the_potential(kind):
    """And nothing is stored where nothing presses."""
    law, h = LAWS[kind], 1e-11
    potential = law.definition.potential
    p, _ = law.evaluate(GAPS)
    for gap, pressure in zip(GAPS, p, strict=True):
        less, more = (potential(gap + sign * h, *law.parameters) for sign in (1, -1))
        assert (more - less) / (2 * h) == pytest.approx(pressure, rel=1e-6, abs=1e-6)
    if not law.definition.pulls:
        assert potential(1e-3, *law.parameters) == pytest.approx(0.0, abs=1e-200)
    assert potential(0.0, *law.parameters) == (0.2 if kind == "exponential" else 0.0)


@pytest.mark.parametrize("d", [0.0, 1e-12, 0.9e-6, 1.1e-6, 3e-4, 1.9e-3, 5e-3, -0.9e-6, -5e-3])
@pytest.mark.parametrize(
    "law",
    [
        contact_law("exponential", p0=1e5, lam=700.0),
        contact_law("unilateral", stiffness=3e9),
        contact_law("power", stiffness=3e9, exponent=2.0),
        contact_law("power", stiffness=3e9, exponent=3.0),
        contact_law("bilateral", stiffness=3e9),
        contact_law("cubic", stiffness=3e9, cubic=2e15),
        contact_law("cubic", stiffness=3e9, cubic=-5e14),
    ],
    ids=str,
)
def test_mean_pressure_is_the_integral_over_the_step(law, d):
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half, g = abs(d) / 2, -1e-3
    middle, share = g, 1.0
    if g + half > 0 and law.kind in ("unilateral", "power"):  # open over the rest of the step
        middle, share = (g - half) / 2, (half - g) / 2 / half
        half = (half - g) / 2
    p, _ = law.evaluate(middle + half * nodes)
    mean = law.definition.mean_pressure(g, d, *law.parameters)
    assert mean == pytest.approx(share * weights @ p / 2, rel=1e-10)


@pytest.mark.parametrize("kind", LAWS)
def test_mean_pressure_of_no_step_is_the_pressure(kind):
    """At a gap of 0 too; and open contact has none over small steps."""
    law = LAWS[kind].definition
    for gap in (*GAPS, 0.0):
        p, _ = law.pressure(gap, *LAWS[kind].parameters)
        assert law.mean_pressure(gap, 0.0, *LAWS[kind].parameters) == pytest.approx(p, rel=1e-14)
    if kind in ("unilateral", "power"):
        assert law.mean_pressure(2e-6, 3e-6, *LAWS[kind].parameters) == 0.0


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_a_softening_spring_presses_until_it_gives_way(share):
    """With 2/3 k g at most, where its tangent is zero: no gap has more."""
    law = contact_law("cubic", stiffness=5e11, cubic=-3e22)
    widest = math.sqrt(5e11 / 9e22)
    most = 2 / 3 * 5e11 * widest
    p, kappa = law.evaluate(np.array([law.gap_at(share * most)]))
    assert p[0] == pytest.approx(share * most, rel=1e-12)
    assert kappa[0] > 0
    assert law.gap_at(2 * most) == pytest.approx(-widest, rel=1e-12)
    p, kappa = law.evaluate(np.array([-widest]))
    assert p[0] == pytest.approx(most, rel=1e-12)
    assert abs(kappa[0]) < 1e-3
    assert contact_law("cubic", cubic=0.0).gap_at(1e6) == contact_law("bilateral").gap_at(1e6)


@pytest.mark.parametrize("kind", ["unilateral", "power"])
def test_nothing_depends_on_anything_where_contact_is_open(kind):
    for by in LAWS[kind].slopes(np.array([0.0, 1e-9, 2e-6])):
        np.testing.assert_array_equal(by, 0.0)


@pytest.mark.parametrize("z", [0.0, 1e-9, 1e-2, 0.5, 0.999, 1.001, 5.0, 150.0])
def test_sinh_over_its_argument(z):
    """Its series up to 1, to round-off."""
    exact = math.sinh(z) / z if z else 1.0
    assert sinh_over(z) == pytest.approx(exact, rel=6e-16 if z < 1 else 1e-14)
    assert sinh_over(-z) == sinh_over(z)
    assert math.isfinite(sinh_over(1e4))


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("pressure", [1e3, 1e5, 1e7])
def test_what_a_law_does_not_give_follows_from_its_pressure(kind, pressure, monkeypatch):
    """Its gap by bisection, closed or open, and its derivatives by differences."""
    law, given = LAWS[kind], LAWS[kind].definition
    bare = replace(given, gap_at=None, gap_scale=None, evaluate=None, slopes=None)
    gap, slopes = law.gap_at(pressure), law.slopes(GAPS)
    p, kappa = law.evaluate(GAPS)
    tangent = law.evaluate(np.array([gap]))[1][0]
    monkeypatch.setitem(CONTACT_LAWS._known, kind, bare)
    assert law.gap_at(pressure) == pytest.approx(gap, rel=1e-12, abs=1e-20)
    assert law.gap_scale(pressure) == pytest.approx(pressure / tangent, rel=1e-12)
    np.testing.assert_allclose(law.evaluate(GAPS), (p, kappa), rtol=1e-13)
    own = law.slopes(GAPS)
    assert len(own) == 1 + len(law.parameters)
    for found, exact in zip(own, slopes, strict=True):
        for a, b in zip(found, exact, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6 * np.abs(b).max())


@pytest.mark.parametrize("name", ["regularised", "smooth"])
@pytest.mark.parametrize("s", [1e-4, 0.03, 0.9, 4.0])
def test_regularised_friction_and_its_slopes(name, s):
    """From the slope k_t at rest up to the bound, which it has where it is saturated."""
    law, k_t, b, h = REGULARISATIONS[name], 2e5, 1e5, 1e-7
    f, by_s, by_b = law.partials(k_t, b, s)
    assert law.resistance(k_t, b, s) * s == pytest.approx(f, rel=1e-9)
    ahead, back = (law.partials(k_t, b, s * (1 + x))[0] for x in (h, -h))
    assert by_s == pytest.approx((ahead - back) / (2 * h * s), rel=1e-6, abs=1e-3)
    ahead, back = (law.partials(k_t, b * (1 + x), s)[0] for x in (h, -h))
    assert by_b == pytest.approx((ahead - back) / (2 * h * b), rel=1e-6, abs=1e-9)
    rest, saturated = 1e-9, 1.001 * law.saturation * b / k_t
    assert law.partials(k_t, b, rest)[0] == pytest.approx(k_t * rest, rel=1e-9)
    assert law.partials(k_t, b, saturated)[0] == pytest.approx(b, rel=1.1e-4)
    assert law.resistance(k_t, b, 0.0) == k_t
    kinked = name == "regularised"
    assert law.slope(k_t, b, s) == pytest.approx(k_t if kinked else f / s, rel=1e-9)
    if kinked:  # kernels divide by a bound of 0, Python does not
        assert law.resistance(k_t, 0.0, s) == 0.0


def test_every_law_has_a_code_of_its_own():
    rows = [law_row(law, FrictionLaw(0.5, 1.0)) for law in LAWS.values()]
    assert sorted(law.name for law in CONTACT_LAWS if law.in_package) == sorted(LAWS)
    assert len({row[LAW_CONTACT] for row in rows}) == len(rows)


@pytest.mark.parametrize(
    "arguments",
    [
        {"kind": "hertz"},
        {"kind": "exponential", "lam": 0.0},
        {"kind": "exponential", "p0": -1.0},
        {"kind": "unilateral", "stiffness": math.nan},
        {"kind": "bilateral", "stiffness": math.inf},
        {"kind": "power", "exponent": 0.9},
    ],
)
def test_bad_law_is_refused(arguments):
    with pytest.raises(ModelError):
        contact_law(**arguments)


def test_laws_are_keys_whatever_their_values_came_as():
    """Of a file or of numpy: values become floats, which name a design point."""
    for values in ([5], np.array([5]), (5,)):
        law = ContactLaw("unilateral", values)
        assert law == ContactLaw("unilateral", (5.0,))
        assert hash(law) == hash(ContactLaw("unilateral", (5.0,)))
        assert type(law.parameters[0]) is float
    curve = FrictionCurve("exponential_fall", [2, np.float32(0.5)])
    assert [type(x) for x in curve.parameters] == [float, float]
    assert hash(curve) == hash(FrictionCurve("exponential_fall", (2.0, 0.5)))


@pytest.mark.parametrize(
    ("friction", "k_t", "regularisation"),
    [
        *((0.5, 1e6, "none"), (-0.1, 1e6, "smooth"), (0.5, 0.0, "smooth")),
        *((0.5, -1.0, "regularised"), (math.nan, 1e6, "smooth"), (0.5, math.inf, "smooth")),
    ],
)
def test_bad_friction_in_time_is_refused(friction, k_t, regularisation):
    with pytest.raises(ModelError):
        FrictionLaw(friction, k_t, regularisation=regularisation)
    assert FrictionLaw(0.0, 1e6).saturation == 1.0


def test_compiled_kernels_are_kept_by_a_hash_of_all_sources(tmp_path, monkeypatch):
    from squealstudy.kernels import jit

    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    before = jit.compiled_directory()
    assert before.is_relative_to(tmp_path)
    copy = tmp_path / "kernels_source"
    copy.mkdir()
    for path in Path(jit.__file__).parent.glob("*.py"):
        (copy / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(jit, "__file__", str(copy / "jit.py"))
    assert jit.compiled_directory() == before
    (copy / "laws.py").write_text("# another law")
    assert jit.compiled_directory() != before
    monkeypatch.undo()
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert jit.compiled_directory() == before
    monkeypatch.setattr(jit, "SOURCES", (("exponential", "changed"), *jit.SOURCES[1:]))
    assert jit.compiled_directory() != before
