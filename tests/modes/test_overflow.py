"""Numbers that squares cannot hold, and roots beside much larger ones: right, or told in words."""

import contextlib
from decimal import Decimal, getcontext
from fractions import Fraction
from typing import Annotated

import numpy as np
import pytest
import scipy.sparse as sp
from pydantic import TypeAdapter
from scipy.io import mmwrite

import squealstudy as sq
from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ConvergenceError, SquealstudyError
from squealstudy.kinds.design.section import VariableSection, VariantSection
from squealstudy.linalg.band_roots import roots_in_band
from squealstudy.linalg.overflow import expect_computable
from squealstudy.models.catalogue.hoffmann import STIFFNESS
from squealstudy.study.definition import parse_study

STUDY = """
[study]
name = "overflow"
kind = "{kind}"
[model]
{model}
[parameters]
{parameters}
[[sweep]]
parameter = "{swept}"
values = [{values}]
[modes]
band = [1.0, 1000.0]
{more}
"""


def results_of(tmp_path, parameters, kind="complex_modes", more="", **given):
    given = {"model": 'name = "hulten"', "swept": "friction", "values": "0.1, 0.5", **given}
    text = STUDY.format(kind=kind, parameters=parameters, more=more, **given)
    run_study(Plan(parse_study(text, tmp_path / "case.toml")), tmp_path / "results", jobs=1)
    return Results.open(tmp_path / "results")


@pytest.mark.parametrize("kind", ["complex_modes", "limit_cycles", "transient"])
@pytest.mark.parametrize(
    "parameters",
    [
        "stiffness_damping = 1e308",
        "stiffness_damping = 1e152",
        '"contact.stiffness" = 1e308',
        '"contact.stiffness" = 1e160',
    ],
)
def test_what_overflows_fails_in_words(tmp_path, kind, parameters):
    more = "[transient]\nduration = 0.1\nstep = 1e-4" if kind == "transient" else ""
    with pytest.raises(SquealstudyError, match=r"has entries .*expected finite numbers"):
        results_of(tmp_path, parameters, kind, more)


def test_a_point_that_overflows_leaves_the_others(tmp_path):
    points = results_of(tmp_path, "", swept="stiffness_damping", values="0.0, 1e160, 1e308").points
    assert points["status"].tolist() == ["ok", "overflow", "overflow"]
    assert points["n_modes"].tolist()[0] == 2


def soft_frequency(stiffness: float, friction: float) -> float:
    """Lower frequency [Hz] of Hoffmann's model by exact arithmetic: the roots of a square."""
    getcontext().prec = 400
    k = np.diag([p.default for p in STIFFNESS if p.name in ("k1", "k2")])
    angles = np.deg2rad([150.0, 30.0])
    D = np.column_stack([np.cos(angles), np.sin(angles)])
    S = [[Fraction(float(x)) for x in row] for row in D.T @ k @ D]
    k3, mu = Fraction(stiffness), Fraction(friction)
    trace = S[0][0] + S[1][1] + k3
    det = S[0][0] * (S[1][1] + k3) - (S[0][1] - mu * k3) * S[1][0]
    t, d = (Decimal(x.numerator) / Decimal(x.denominator) for x in (trace, det))
    return float(((t - (t * t - 4 * d).sqrt()) / 2).sqrt()) / (2 * np.pi)


@pytest.mark.parametrize("stiffness", [1e6, 1e20, 1e60, 1e80, 1e149])
def test_a_soft_mode_beside_a_stiff_contact_is_found(stiffness):
    modes = sq.model("hoffmann", contact_stiffness=stiffness, friction=0.4).modes()
    assert modes["frequency_hz"].iloc[0] == pytest.approx(soft_frequency(stiffness, 0.4), rel=1e-8)


def test_an_overdamped_model_has_no_mode_in_the_band(tmp_path):
    points = results_of(tmp_path, "stiffness_damping = 1e100").points  # roots of 1e-100 and 1e105
    assert points["status"].tolist() == ["ok", "ok"]
    assert points["n_modes"].tolist() == [0, 0]


MATRICES = """name = "matrices"
folder = "{folder}"
""" + "".join(
    f'[[model.term]]\nmatrix = "{x}"\nfile = "{x}.mtx"\ncoefficient = "{{factor}}{x.lower()}"\n'
    for x in "MCK"
)


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """Matrices of four coordinates in a folder, and numpy's roots of the band [Hz]."""
    folder, rng, n = tmp_path_factory.mktemp("family"), np.random.default_rng(0), 4
    B, S = rng.standard_normal((2, n, n))
    K, C = (B @ B.T + np.eye(n)) * 4e6 + 1e6 * (S - S.T), np.diag(rng.uniform(1, 5, n))
    for name, A in (("M", np.eye(n)), ("C", C), ("K", K)):
        mmwrite(folder / f"{name}.mtx", sp.csr_matrix(A), precision=17)
    lam = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]])) / (2 * np.pi)
    lam = lam[(lam.imag > 0) & (np.abs(lam) < 1000)]
    return folder, np.sort(np.abs(lam))


@pytest.mark.parametrize("factor", ["1e-149", "1e-30", "1e30", "1e140"])
def test_a_factor_of_all_matrices_changes_no_root(tmp_path, family, factor):
    folder, expected = family
    model = MATRICES.format(folder=folder.as_posix(), factor=f"{factor} * ")
    modes = results_of(tmp_path, "m = 1\nc = 1\nk = 1", model=model, swept="k", values="1.0").modes
    np.testing.assert_allclose(modes["frequency_hz"], expected, rtol=1e-9)


def test_coefficients_that_overflow_fail_their_points(tmp_path, family):
    folder, expected = family
    model = MATRICES.format(folder=folder.as_posix(), factor="")
    values = "1.0, 1e150, -1e300, 1e305"
    points = results_of(
        tmp_path, "m = 1\nc = 1\nk = 1", model=model, swept="k", values=values
    ).points
    assert points["status"].tolist() == ["ok", "overflow", "overflow", "overflow"]
    assert points["n_modes"].iloc[0] == len(expected)
    assert "the term 'k' of K has entries" in points["message"].iloc[2]


def test_masses_too_small_to_divide_by_are_refused(tmp_path, family):
    folder, _ = family
    model = MATRICES.format(folder=folder.as_posix(), factor="")
    given = {"model": model, "swept": "m", "values": "1.0, 1e-200"}
    points = results_of(tmp_path, "m = 1\nk = 1\nc = 1", **given).points
    assert points["status"].tolist() == ["ok", "overflow"]
    with pytest.raises(SquealstudyError, match="diagonal entry of 1e-160"):
        results_of(tmp_path / "mass", "mass = 1e-160")


def test_entries_are_looked_at_in_arrays_and_sparse_matrices():
    for A in (np.array([1.0, np.nan]), sp.csr_matrix([[0.0, -np.inf]]), -1e151):
        with pytest.raises(ConvergenceError, match="K has entries"):
            expect_computable([("K", A)])
    expect_computable([("K", sp.csr_matrix((2, 2))), ("C", 0.0), ("M", np.full(3, -1e149))])


@pytest.mark.parametrize("n", [3, 120])  # dense and sparse
def test_a_singular_pencil_is_called_so(n):
    A = sp.diags([*np.linspace(1e6, 2e6, n - 1), 0.0]).tocsr()
    M = sp.diags([*np.ones(n - 1), 0.0]).tocsr()
    with pytest.raises(ConvergenceError, match="singular for every lambda"):
        roots_in_band(M, sp.csr_matrix((n, n)), A, (1.0, 1e4))


@pytest.mark.parametrize("kind", ["sensitivity", "sensitivity at the limit"])
def test_derivatives_by_a_value_that_overflows_are_refused(tmp_path, kind):
    value = "1e308" if kind == "sensitivity" else "1e149"
    text = f"""
[study]
name = "far"
kind = "sensitivity"
[model]
name = "hoffmann"
[parameters]
friction = 1.0
"friction_law.static_ratio" = 1.3
"friction_law.decay_speed" = {value}
[sensitivity]
parameters = ["friction_law.decay_speed"]
[modes]
band = [1.0, 1000.0]
"""
    path = tmp_path / "far.toml"
    path.write_text(text, encoding="utf-8")
    if value == "1e308":
        with pytest.raises(SquealstudyError, match=r"sensitivity.parameters.*1e\+150 overflow"):
            sq.run(path, tmp_path / "results", jobs=1)
        return
    table = sq.run(path, tmp_path / "results", jobs=1).sensitivities
    slopes = table["d_growth_rate"].to_numpy()
    np.testing.assert_allclose(slopes, 0.0, atol=1e-100)  # exp(-v/1e149) is 1: nothing changes
    assert np.isfinite(table["finite_growth_change"]).all()


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ("[limit_cycles]\nfamilies = [1000000000]", "distinct modes from 1 to 10000"),
        ("[limit_cycles]\nfamilies = [0]", "distinct modes from 1 to 10000"),
    ],
)
def test_families_that_no_band_has_are_refused(tmp_path, section, told):
    text = STUDY.format(
        kind="limit_cycles",
        model='name = "hulten"',
        parameters="",
        swept="friction",
        values="0.1",
        more=section,
    )
    with pytest.raises(SquealstudyError, match=told):
        parse_study(text, tmp_path / "case.toml")


def test_costs_whose_sums_overflow_are_refused():
    for section in (VariableSection, VariantSection):
        field = section.model_fields["cost"]
        accepted = TypeAdapter(Annotated[float, field])
        assert accepted.validate_python(1e100) == 1e100
        with pytest.raises(ValueError, match="less than or equal to"):
            accepted.validate_python(1e308)


def test_cycles_do_not_diverge_by_round_off(tmp_path):
    """At 1e140 s the small roots are lost beside the largest: it is no divergence."""
    text = '[study]\nname = "lost"\nkind = "limit_cycles"\n[model]\nname = "hoffmann"\n'
    text += (
        "[parameters]\nfriction = 0.5\nstiffness_damping = 1e140\n[modes]\nband = [1.0, 1000.0]\n"
    )
    with contextlib.suppress(SquealstudyError):  # all points failed
        run_study(Plan(parse_study(text, tmp_path / "lost.toml")), tmp_path / "r", jobs=1)
    (row,) = Results.open(tmp_path / "r").points.to_dict("records")
    if row["status"] == "ok":  # where LAPACK of this processor finds no root of the band at all
        assert (row["n_unstable"], row["verdict"], row["valid"]) == (0, "undecided", False), row
    else:
        assert row["status"] == "overflow", row
        assert "too far apart" in row["message"]
