"""Equal tables in other units of mass, length and time; roots beside stiff springs."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from conftest import NOMINAL
from hypothesis import given, settings
from hypothesis import strategies as st
from unit_scaling import Units, same_table, scaled_text, solved, study_of

from squealstudy.engine.plan import Plan
from squealstudy.engine.results import Results
from squealstudy.engine.runner import run_study
from squealstudy.errors import ResultsError
from squealstudy.linalg.band_roots import pair_residuals, roots_in_band
from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import solve_point, state_working_point
from squealstudy.study.definition import load_study
from squealstudy.system.linearise import linearise
from squealstudy.wording import in_digits

OTHER_UNITS = [
    Units(time=1e-6),
    Units(time=1e6),
    Units(mass=1e6, time=1e3),
    Units(mass=1e-6, length=1e3, time=1e-3),
    Units(mass=1e6, length=1e-6, time=1e6),
]
SCENES = {
    "hulten": (("friction", list(np.linspace(0.05, 0.6, 7))), {"damping_ratio": 0.01}),
    "hoffmann": (
        ("friction", list(np.linspace(0.3, 1.2, 7))),
        {"damping_ratio": 0.005, "stiffness_damping": 1e-6},
    ),
    "belt": (("sliding_speed", list(np.linspace(0.9, 1.4, 6))), {}),
}
MODE_COLUMNS = {
    "mode": "exact",
    "track": "exact",
    "unstable": "exact",
    "overdamped": "exact",
    "method": "exact",
    "frequency_hz": "Hz",
}
ids = str


# -- minimal models through their parameters -----------------------------------------------------
@pytest.mark.parametrize("model", SCENES)
def test_complex_modes_tracks_and_onsets_are_equal_in_other_units(model, tmp_path):
    sweep, given_values = SCENES[model]
    band = (10.0, 1e4)
    base = solved(scaled_text(model, "complex_modes", Units(), sweep, given_values, band), tmp_path)
    assert len(base.modes) > 10
    assert len(base.onsets)
    unit = "" if sweep[0] == "friction" else "m/s"
    for number, units in enumerate(OTHER_UNITS[1::3]):
        text = scaled_text(model, "complex_modes", units, sweep, given_values, band)
        other = solved(text, tmp_path / str(number))
        assert (other.points["status"] == "ok").all()
        same_table(other.modes, base.modes, MODE_COLUMNS, units, 1e-9)
        # damping ratios and growth within round-off of the modulus, not of themselves
        size = base.modes["frequency_hz"].to_numpy()
        off = other.modes["growth_rate"] / units.factor("Hz") - base.modes["growth_rate"]
        assert (np.abs(off) < 1e-10 * size).all()
        columns = {"track": "exact", "status": "exact", "onset": unit, "frequency_hz": "Hz"}
        same_table(other.onsets, base.onsets, columns, units, 1e-7)


TRANSIENTS = {
    "belt": (("sliding_speed", [0.6, 1.3]), {}, 0.6, 0.1),
    "hoffmann": (("friction", [0.5, 0.9]), {"damping_ratio": 0.002}, 0.1, 0.01),
}


@pytest.mark.parametrize("model", TRANSIENTS)
def test_motion_is_classed_and_measured_equally_in_other_units(model, tmp_path):
    sweep, given_values, duration, kick = TRANSIENTS[model]
    section = {"duration": (duration, "s"), "step": (2e-5, "s"), "perturbation": (kick, "m/s")}

    def run(units, name):
        sections = {"transient": {**section, "save_every": (20, "")}}
        text = scaled_text(model, "transient", units, sweep, given_values, (10.0, 1e3), sections)
        return solved(text, tmp_path / name)

    units = OTHER_UNITS[2]
    columns = {
        "status": "exact",
        "class": "exact",
        "growth_rate": "1/s",
        "torque_rms": "N",
        "torque_mean": "N",
        "torque_line_hz": "Hz",
        "time_reached": "s",
        "stick_share": "",
    }
    points, base = run(units, "other").points, run(Units(), "base").points
    same_table(points, base, columns, units, 1e-5)


@pytest.mark.parametrize("units", OTHER_UNITS[1:3], ids=ids)
def test_sensitivities_and_finite_changes_are_equal_in_other_units(units, tmp_path):
    names = ["friction", "k1", "contact_stiffness", "alpha1", "stiffness_damping"]
    sections = {"sensitivity": {"modes": (2, ""), "parameters": (names, "")}}
    sweep, values = ("friction", [0.5, 0.9]), {"damping_ratio": 0.002, "stiffness_damping": 1e-6}
    text = [
        scaled_text("hoffmann", "sensitivity", u, sweep, values, (10.0, 1e3), sections)
        for u in (Units(), units)
    ]
    base, other = (solved(t, tmp_path / str(i)).sensitivities for i, t in enumerate(text))
    columns = {"parameter": "exact", "near_coalescence": "exact", "frequency_hz": "Hz"}
    columns |= {"growth_per_percent": "1/s", "frequency_per_percent": "Hz"}
    columns |= {"finite_growth_change": "1/s", "finite_frequency_change": "Hz", "condition": ""}
    same_table(other, base, columns, units, 1e-6)


@pytest.mark.parametrize("units", OTHER_UNITS[:2], ids=ids)
def test_robust_figures_are_equal_in_other_units(units, tmp_path):
    def run(u, name):
        text = scaled_text("hulten", "complex_modes", u, None, {"damping_ratio": 0.01})
        text = text.replace('"friction" =', '"friction_law.static_ratio" = 1.0 #')
        text = text.replace('"friction_law.static_ratio" = 1.0\n', "")
        text += '\n[design]\ntype = "sobol"\nsamples = 16\n'
        text += '[[sweep]]\nparameter = "friction"\nstart = 0.1\nstop = 0.6\n'
        return solved(text, tmp_path / name).robust()

    columns = {"track": "exact", "unstable_points": "exact", "points": "exact"}
    columns |= {"probability": "", "mean_growth_rate": "1/s", "growth_std": "1/s"}
    same_table(run(units, "other"), run(Units(), "base"), columns, units, 1e-8)


def test_no_limit_of_a_study_is_in_seconds_or_metres_a_second():
    section = {"duration": (0.1, "s"), "step": (1e-6, "s"), "perturbation": (1.0, "m/s")}
    damped, sections = {"stiffness_damping": 1e-4}, {"transient": section}
    for units in (Units(time=1e9), Units(time=1e-9)):
        text = scaled_text("belt", "transient", units, None, damped, (1.0, 1e3), sections)
        assert study_of(text).values["stiffness_damping"] == 1e-4 * units.time


# -- families of matrices ------------------------------------------------------------------------
FAMILY = """[study]
name = "family"
kind = "complex_modes"
[model]
name = "matrices"
{terms}
[parameters]
mu = 0.1
[[sweep]]
parameter = "mu"
values = {values}
[modes]
band = [{low!r}, {high!r}]
method = "{method}"
reference_points = 0
"""


def family_text(folder: Path, terms, band, method="full", values=(0.0, 0.1, 0.2, 0.25, 0.35)):
    """Write matrices (letter, array, coefficient) to a folder; the text of a study of them."""
    np.savez(folder / "m.npz", **{f"t{i}": A for i, (_, A, _) in enumerate(terms)})
    listed = "\n".join(
        f'[[model.term]]\nmatrix = "{k}"\nfile = "m.npz"\nvariable = "t{i}"\ncoefficient = "{c}"'
        for i, (k, _, c) in enumerate(terms)
    )
    low, high = band
    return FAMILY.format(terms=listed, values=list(values), low=low, high=high, method=method)


def run_family(folder: Path, *arguments) -> Results:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "study.toml"
    path.write_text(family_text(folder, *arguments))
    run_study(Plan(load_study(path)), folder / "results", 1)
    return Results.open(folder / "results")


def machine(n=16, pairs=((3, 7), (9, 4))):
    """A chain with friction that couples; roots of 8 to 90 Hz. Terms of (letter, matrix, text)."""
    K = 1e5 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    M = np.eye(n)
    F = np.zeros((n, n))
    for i, j in pairs:
        F[i, j], F[j, i] = -6e4, 6e4
    return [("M", M, "1"), ("C", 0.5 * M + 1e-5 * K, "1"), ("K", K, "1"), ("K", F, "mu")]


@pytest.mark.parametrize("method", ["full", "sweep_basis", "windows", "two_step", "perturbation"])
def test_matrices_give_equal_modes_in_other_units_by_every_rung(method, tmp_path):
    def run(units, name):
        factors = {"M": units.mass, "C": units.mass / units.time, "K": units.mass / units.time**2}
        terms = [(k, A * factors[k], c) for k, A, c in machine()]
        band = (1.0 / units.time, 60.0 / units.time)
        return run_family(tmp_path / name, terms, band, method)

    base = run(Units(), "base")
    assert len(base.modes) > 20
    rtol = 1e-9 if method == "full" else 1e-6  # what a basis holds is decided by a tolerance
    for number, units in enumerate(OTHER_UNITS[1::3]):
        other = run(units, str(number))
        same_table(other.points, base.points, {"status": "exact", "method": "exact"}, units, 0)
        same_table(other.modes, base.modes, MODE_COLUMNS, units, rtol)


def test_a_slow_band_is_not_empty(tmp_path):
    """[1e-4, 1e-3] Hz, where all modes of these matrices are."""
    terms = [(k, A / 1e5 ** ("MCK".index(k)), c) for k, A, c in machine()]
    slow = run_family(tmp_path / "slow", terms, (1e-4, 1e-3))
    fast = run_family(tmp_path / "fast", machine(), (10.0, 100.0))
    assert len(slow.modes) == len(fast.modes) > 20
    np.testing.assert_allclose(1e5 * slow.modes["frequency_hz"], fast.modes["frequency_hz"])


@settings(max_examples=10)
@given(st.floats(-6, 6), st.floats(-6, 6), st.sampled_from([12, 140]), st.booleans())
def test_rigid_modes_are_left_out_and_no_others_in_any_units(time, mass, n, damped):
    """A free chain from 0 Hz: its elastic modes and nothing else."""
    tau, m = 10.0**time, 10.0**mass
    K = sp.diags(
        [np.full(n - 1, -1.0), np.r_[1.0, np.full(n - 2, 2.0), 1.0], np.full(n - 1, -1.0)],
        [-1, 0, 1],
        format="csr",
    )
    M, C = sp.identity(n, format="csr"), (1e-3 if damped else 0.0) * K
    elastic = 2 * np.sin(np.pi * np.arange(1, n) / (2 * n))
    top = 0.9
    roots = roots_in_band(m * M, m / tau * C, m / tau**2 * K, (1e-5 * top / tau, top / tau))
    expected = elastic[elastic <= top]
    np.testing.assert_allclose(tau * np.abs(roots.lam), expected, rtol=1e-7)
    assert (roots.error < 1e-6 * np.abs(roots.lam)).all()
    omega, _ = real_modes(m * M, m / tau**2 * K, top / tau / (2 * np.pi))
    assert rigid_modes(m * M, m / tau**2 * K, omega) == 1
    assert len(omega) == len(expected) + 1


# -- the brake by its matrices -------------------------------------------------------------------
@pytest.mark.parametrize("units", [Units(mass=1e6, time=1e6), Units(mass=1e-6, time=1e-6)], ids=ids)
def test_the_matrices_of_the_brake_have_equal_roots_in_other_units(prepared, units):
    """M, C and K of its component modes at the nominal point, and the band."""
    state = DesignState(NOMINAL, stiffness_damping=1e-8)
    point = state_working_point(prepared, state)
    system = linearise(prepared.model, point, state)
    f = 2 * np.pi / units.time
    expected = solve_point(prepared, state, (500.0, 2500.0), point.gap)
    assert len(expected.lam) > 3
    matrices = [
        sp.csr_matrix(A * units.mass / units.time**power)
        for power, A in enumerate((np.eye(prepared.model.n), system.C, system.K))
    ]
    roots = roots_in_band(*matrices, (500.0 * f, 2500.0 * f))
    order = np.argsort(roots.lam.imag == 0, kind="stable")
    np.testing.assert_allclose(roots.lam[order] * units.time, expected.lam, rtol=1e-9)


# -- stiff springs -------------------------------------------------------------------------------
def joined(matrices, i, j, stiffness):
    """The stiffness with a spring between two coordinates; the problem with them made one."""
    n = len(matrices[0])
    stiff = matrices[2].copy()
    stiff[[i, j], [i, j]] += stiffness
    stiff[[i, j], [j, i]] -= stiffness
    T = np.delete(np.eye(n), j, axis=1)
    T[j, i] = 1.0
    return stiff, [T.T @ A @ T for A in matrices]


@pytest.mark.parametrize(("n", "stiffness"), list(itertools.product([16, 160], [1e11, 1e13, 1e15])))
def test_roots_beside_a_stiff_spring_are_right_within_their_error(n, stiffness):
    terms = machine(n)
    M, C, K = (1e3 * terms[0][1], 1e3 * terms[1][1], 1e3 * (terms[2][1] + 0.3 * terms[3][1]))
    stiff, one = joined((M, C, K), n // 2, n // 2 + 4, stiffness)
    band = (1.0, 400.0)
    exact = roots_in_band(*(sp.csr_matrix(A) for A in one), band)
    matrices = [sp.csr_matrix(A) for A in (M, C, stiff)]
    roots = roots_in_band(*matrices, band)
    assert len(roots.lam) == len(exact.lam) > 3
    size = np.abs(exact.lam)
    off = np.abs(roots.lam - exact.lam) / size
    bent = 10 * 1e8 / stiffness  # the spring gives a little
    assert (off <= roots.error / size + bent).all()
    assert (roots.error < 1e-4 * size).all()
    assert pair_residuals(*matrices, roots.lam, roots.psi).max() < 1e-13


def test_a_study_beside_a_stiff_spring_is_ok_and_one_beyond_all_digits_is_inaccurate(tmp_path):
    def run(stiffness):
        terms = machine()
        stiff, _ = joined([terms[0][1], terms[1][1], terms[2][1]], 8, 12, stiffness)
        terms[2] = ("K", stiff, "1")
        return run_family(tmp_path / f"{stiffness:g}", terms, (1.0, 60.0))

    base = run(1e9)
    for stiffness in (1e13, 1e15):
        found = run(stiffness)
        assert (found.points["status"] == "ok").all()
        np.testing.assert_allclose(
            found.modes["frequency_hz"], base.modes["frequency_hz"], rtol=3e-4
        )
        relative = found.modes["error_estimate"] / (2 * np.pi * found.modes["frequency_hz"])
        assert relative.max() > 1e-16 * stiffness / 1e7
        assert (relative < 1e-4).all()
    with pytest.raises(ResultsError, match="may be wrong by"):
        run(1e19)
    lost = Results.open(tmp_path / "1e+19" / "results")
    assert (lost.points["status"] == "inaccurate").all()
    assert lost.points["message"].str.contains("tolerance 0.0001").all()
    assert len(lost.modes) > 10
    assert not len(lost.rank())


def test_inaccurate_points_count_neither_way(tmp_path):
    """A stiff spring whose size is swept: points of one line are ok, others inaccurate."""
    terms = [*machine(), ("K", joined([np.zeros((16, 16))] * 3, 8, 12, 1.0)[0], "10**mu")]
    terms[3] = ("K", terms[3][1], "1.2")
    levels = [9.0, 11.0, 13.0, 19.0, 20.0]
    results = run_family(tmp_path, terms, (1.0, 60.0), "full", levels)
    points, modes = results.points, results.modes
    assert list(points["status"]) == ["ok", "ok", "ok", "inaccurate", "inaccurate"]
    held = modes.merge(points[["point_id", "status"]])
    assert (held["status"] == "inaccurate").any()
    assert modes["unstable"].any()
    ranked = results.rank()
    assert (ranked["unstable_points"] <= 3).all()
    assert not results.onsets["bracket_high"].gt(13.0).any()
    again = run_study(Plan(load_study(tmp_path / "study.toml")), tmp_path / "results", 1)
    assert again.n_solved == 0


# -- what is printed -----------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (3074.2, 0, "3074"),
        (12.4, 0, "12"),
        (1.234e-4, 0, "0.000123"),
        (4.567, 0, "4.57"),
        (0.0, 0, "0"),
        (-321.4, 1, "-321.4"),
        (-3.2e-7, 1, "-3.2e-07"),
        (float("nan"), 1, "nan"),
    ],
)
def test_numbers_keep_their_digits(value, decimals, text):
    assert in_digits(value, decimals) == text
