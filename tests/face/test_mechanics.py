"""The mechanics as a library: arrays against numpy and against studies, batches against loops."""

from __future__ import annotations

import ast
import doctest
import importlib
import runpy
import sys
import warnings
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from own_blocks import write_blocks

import squealstudy as sq
from squealstudy.errors import ConvergenceError, ModelError, ParameterError, SquealstudyError
from squealstudy.mechanics.batch import is_point_mass_batch

PACKAGE = Path(sq.__file__).parent
# from the laws up to the library: what a study has nothing to do with
MECHANICS = ("laws", "kernels", "linalg", "models", "reduction", "system", "modes", "motion")
MECHANICS += ("stacked", "cycles", "shapes", "mechanics")
ABOVE = ("study", "engine", "kinds", "fidelity", "face", "face_model", "cli", "tables", "plots")
MODES_BAND = (10.0, 3000.0)
BRAKE_BAND = (800.0, 1600.0)
BLOCKS_BAND = (1e3, 4e4)
SIGNS = np.array([-1.0, 1.0])
NOT_OF_ONE_POINT = ["point_id", "track", "track_mac", "track_ambiguous"]


def companion_roots(C: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Roots (2n,) of lam^2 + lam C + K by numpy."""
    n = len(K)
    return np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-K, -C]]))


def study_modes(model: sq.Model, band: tuple[float, float], folder: Path):
    """The modes table of a study of the one design point."""
    found = sq.run(model.study(band=band), folder / "results", jobs=1).modes
    return found.drop(columns=[name for name in NOT_OF_ONE_POINT if name in found])


# -- layers


@pytest.mark.parametrize("package", MECHANICS)
def test_the_mechanics_knows_no_study_and_no_engine(package):
    """What is imported for types alone counts as well."""
    for path in (PACKAGE / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                parts = name.split(".")
                assert not (parts[0] == "squealstudy" and parts[1:2] and parts[1] in ABOVE), path


@pytest.mark.parametrize(
    "module", sorted(path.stem for path in (PACKAGE / "mechanics").glob("[a-z]*.py"))
)
def test_examples_of_docstrings(module):
    found = doctest.testmod(importlib.import_module(f"squealstudy.mechanics.{module}"))
    assert found.failed == 0


# -- against numpy


def test_hulten_is_its_closed_form():
    """Contact 1 slides along -q2, contact 2 along q1, and friction is against sliding."""
    mu, zeta = 0.4, 0.01
    system = sq.model("hulten", friction=mu).at(damping_ratio=zeta)
    w1, w2 = 2 * np.pi * np.array([100.0, 75.0])
    K = np.array([[w1**2, -mu * w2**2], [mu * w1**2, w2**2]])
    np.testing.assert_allclose(system.linear.K, K, rtol=1e-12)
    np.testing.assert_allclose(system.linear.C, 2 * zeta * np.diag([w1, w2]), atol=1e-9)
    # N1 - mu N2 = 100 N and N2 + mu N1 = 100 N
    normal = np.linalg.solve([[1.0, -mu], [mu, 1.0]], [100.0, 100.0])
    np.testing.assert_allclose(system.steady.force[:, 0], normal, rtol=1e-10)
    np.testing.assert_allclose(np.abs(system.steady.force[:, 1]), mu * normal, rtol=1e-10)


@pytest.mark.parametrize("name", ["hulten", "hoffmann", "belt"])
def test_modes_are_roots_of_the_linearised_matrices(name):
    system = sq.model(name).at(friction=0.6, damping_ratio=0.002)
    linear, modes = system.linear, system.modes(MODES_BAND)
    roots = companion_roots(linear.C, linear.K)
    roots = roots[(roots.imag >= 0) & (np.abs(roots) < 2 * np.pi * MODES_BAND[1])]
    order = np.argsort(np.abs(roots))
    np.testing.assert_allclose(np.sort(np.abs(modes.lam)), np.abs(roots[order]), rtol=1e-9)
    for lam, x, y in zip(modes.lam, modes.right.T, modes.left.T, strict=True):
        Q = lam**2 * linear.M + lam * linear.C + linear.K
        size = np.linalg.norm(linear.K)
        assert np.linalg.norm(Q @ x) < 1e-9 * size
        assert np.linalg.norm(y.conj() @ Q) < 1e-9 * size * np.linalg.norm(y)
        slope = y.conj() @ (2 * lam * linear.M + linear.C) @ x
        assert slope == pytest.approx(1.0, abs=1e-9)


def test_left_vectors_give_the_derivative_of_roots():
    mu, h = 0.4, 1e-5
    model = sq.model("hulten")
    ends = model.at(friction=[mu - h, mu + h])
    K_mu = np.diff(ends.linear.K, axis=0)[0] / (2 * h)
    modes = model.at(friction=mu).modes()
    slope = -np.einsum("ij,ij->j", modes.left.conj(), K_mu @ modes.right)
    by_difference = np.diff(ends.modes().lam, axis=0)[0] / (2 * h)
    np.testing.assert_allclose(slope, by_difference, rtol=1e-6)


def test_unreduced_matrices_hold_the_model():
    assembly = sq.model("hulten", mass=2.0).at().assembly
    np.testing.assert_allclose(assembly.M.toarray(), 2.0 * np.eye(2))
    assert assembly.K.nnz == 0  # all stiffness is that of contacts
    assert assembly.C.nnz == 0
    np.testing.assert_allclose(assembly.load, [-100.0, -100.0])
    assert list(assembly.slices) == ["mass"]


# -- against studies


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("hulten", {"friction": 0.5, "damping_ratio": 0.01}),
        ("hoffmann", {"friction": 0.9, "contact_law": "exponential"}),
    ],
)
def test_modes_are_those_of_a_study(name, values, tmp_path):
    model = sq.model(name, **values)
    own, study = model.modes(MODES_BAND), study_modes(model, MODES_BAND, tmp_path)
    assert list(own.columns) == list(study.columns)
    units = study.attrs["units"]
    assert own.attrs["units"] == {name: units[name] for name in own if name in units}
    assert (own.dtypes == study.dtypes).all()
    size = 2 * np.pi * own["frequency_hz"].to_numpy()  # rad/s
    # studies solve small models in batches: equal to round-off, of the moduli of roots
    for column in own:
        if own[column].dtype != float:
            assert (own[column] == study[column]).all()
        elif column == "residual":
            assert (study[column] < 1e-14).all()
        elif column.startswith("error"):
            np.testing.assert_allclose(own[column], study[column], rtol=0.5, atol=0.0)
        else:
            scale = size if column == "growth_rate" else 1.0
            apart = np.abs(own[column] - study[column])
            assert (apart <= 1e-12 * np.maximum(scale, own[column].abs())).all(), column


def expect_those_of_a_study(model: sq.Model, band: tuple[float, float], folder: Path) -> None:
    """Of a meshed model; and its basis is orthonormal in the mass."""
    own, study = model.modes(band), study_modes(model, band, folder)
    assert list(own.columns) == list(study.columns)
    assert len(own) == len(study) > 1
    np.testing.assert_allclose(own["frequency_hz"], study["frequency_hz"], rtol=1e-9)
    np.testing.assert_allclose(own["damping_ratio"], study["damping_ratio"], atol=1e-9)
    np.testing.assert_allclose(own["error_reduction"], study["error_reduction"], rtol=1e-3)
    np.testing.assert_allclose(own.filter(like="energy"), study.filter(like="energy"), atol=1e-8)
    assert (own["stability"] == study["stability"]).all()
    reduction = model.at().reduced(band)
    T, assembled = reduction.basis_matrix, reduction.assembly
    np.testing.assert_allclose(T.T @ (assembled.M @ T), np.eye(reduction.n), atol=1e-8)


def test_modes_of_a_model_file_are_those_of_a_study(tmp_path):
    write_blocks(tmp_path)
    model = sq.model(str(tmp_path / "blocks.toml"), friction=0.4, damping_ratio=0.001)
    expect_those_of_a_study(model, BLOCKS_BAND, tmp_path)


@pytest.mark.full_size
def test_modes_of_the_brake_are_those_of_a_study(tmp_path):
    model = sq.model("disc_brake", mesh="coarse", friction=0.4, damping_ratio=0.001)
    expect_those_of_a_study(model, BRAKE_BAND, tmp_path)


def test_design_points_of_a_meshed_structure_share_its_reduction(tmp_path):
    write_blocks(tmp_path)
    model = sq.model(str(tmp_path / "blocks.toml")).with_basis(band_hz=BLOCKS_BAND)
    batch = model.at(friction=[0.2, 0.4], pressure=[8e5, 2e6], sliding_speed=1.0)
    assert batch.reduced() is batch.reduced()
    for k, point in enumerate(batch):
        alone = model.with_basis(ranges={"pressure": (8e5, 2e6)}).at(
            **{name: point.values.columns[name] for name in ("friction", "pressure")},
            sliding_speed=1.0,
        )
        np.testing.assert_allclose(alone.linear.K, batch.linear.K[k], rtol=1e-9, atol=1e-3)


# -- batches


@settings(max_examples=8, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.9), st.floats(0.05, 3.0), st.floats(0.0, 0.05)),
        min_size=1,
        max_size=4,
    )
)
def test_a_batch_is_a_loop(points):
    friction, speed, damping = np.array(points).T
    model = sq.model("hulten", **{"friction_law.static_ratio": 1.2})
    batch = model.at(friction=friction, sliding_speed=speed, damping_ratio=damping)
    modes = batch.modes(MODES_BAND)
    for k, (mu, v, zeta) in enumerate(points):
        one = model.at(friction=mu, sliding_speed=v, damping_ratio=zeta)
        np.testing.assert_allclose(batch.linear.K[k], one.linear.K, rtol=1e-12)
        np.testing.assert_allclose(batch.linear.C[k], one.linear.C, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(batch.steady.pressure[k], one.steady.pressure, rtol=1e-9)
        alone, count = one.modes(MODES_BAND), modes.counts[k]
        np.testing.assert_allclose(modes.lam[k, :count], alone.lam, rtol=1e-9, atol=1e-6)


def test_scalars_arrays_and_structures_are_broadcast():
    system = sq.model("hulten").at(
        friction=0.3, frequency_1=[100.0, 110.0, 100.0], frequency_2=np.array([75.0])
    )
    assert len(system) == 3
    found = system.modes().frequency_hz
    np.testing.assert_allclose(found[0], found[2])
    assert found[1, -1] > found[0, -1]
    assert system[1].modes().frequency_hz == pytest.approx(found[1])
    table = system.modes().to_pandas()
    assert table["point"].tolist() == [0, 0, 1, 1, 2, 2]
    assert table["frequency_1"].tolist() == [100.0, 100.0, 110.0, 110.0, 100.0, 100.0]
    assert [point.values.columns["frequency_1"] for point in system] == [100.0, 110.0, 100.0]


def test_a_point_that_fails_is_the_status_of_its_row():
    family = sq.matrices(np.eye(1), {"1 / p": np.array([[4.0e4]])}, p=1.0)
    batch = family.at(p=[1.0, 0.0, 4.0])
    modes = batch.modes((1.0, 1e3))
    assert modes.status.tolist() == ["ok", "undefined", "ok"]
    assert modes.counts.tolist() == [1, 0, 1]
    assert np.isnan(modes.lam[1]).all()
    assert "1 / p" in modes.message[1]
    np.testing.assert_allclose(np.abs(modes.lam[[0, 2], 0]), [200.0, 100.0], rtol=1e-9)
    assert modes.to_pandas()["point"].tolist() == [0, 2]
    with pytest.raises(ConvergenceError):
        batch[1].modes((1.0, 1e3))


def test_a_batch_of_which_nothing_is_there():
    model = sq.model("hoffmann", contact_law="unilateral", sliding_speed=-1.0)
    batch = model.at(friction=[4.9, 5.0])
    modes = batch.modes()
    assert modes.status.tolist() == ["working_point"] * 2
    assert modes.lam.shape == (2, 0)
    assert len(modes.to_pandas()) == 0
    assert batch.linear.K.shape == batch.linear.M.shape == (2, 0, 0)
    assert batch.steady.force.shape == (2, 0, 3)


def test_a_component_mode_that_the_basis_does_not_hold(tmp_path):
    write_blocks(tmp_path)
    model = sq.model(str(tmp_path / "blocks.toml")).with_basis(band_hz=BLOCKS_BAND)
    name = "plate.modes[99].frequency_scale"
    with pytest.raises(ParameterError, match="plate has modes 1 to 6"):
        model.at(**{name: 0.9}).linear  # noqa: B018
    assert model.at(**{name: [0.9, 1.0]}).linear.status.tolist() == ["failed"] * 2


def test_steady_sliding_that_does_not_exist():
    """Rubbed the other way at high friction, contact that may open does."""
    model = sq.model("hoffmann", contact_law="unilateral", sliding_speed=-1.0)
    steady = model.at(friction=[0.5, 5.0]).steady
    assert steady.status.tolist() == ["ok", "working_point"]
    assert np.isfinite(steady.gap[0]).all()
    assert np.isnan(steady.gap[1]).all()
    assert steady.iterations.tolist()[1] == -1
    assert "no steady sliding" in steady.message[1]
    for step in ("steady", "linear"):
        with pytest.raises(ConvergenceError, match="no steady sliding"):
            getattr(model.at(friction=5.0), step)


def test_a_model_without_steady_sliding_of_its_own_has_it_at_a_design_point():
    model = sq.model("hoffmann", contact_law="unilateral", sliding_speed=-1.0)
    locked = sq.model("hoffmann", contact_law="unilateral", sliding_speed=-1.0, friction=5.0)
    one, other = (x.at(friction=0.5) for x in (model, locked))
    np.testing.assert_allclose(other.linear.K, one.linear.K)
    np.testing.assert_allclose(other.steady.gap, one.steady.gap)
    run = {"duration": 5e-3, "step": 1e-5}
    np.testing.assert_allclose(other.simulate(**run).torque, one.simulate(**run).torque)
    both = locked.at(friction=[4.5, 0.5])
    assert both.linear.status.tolist() == ["working_point", "ok"]
    with pytest.raises(ConvergenceError, match=r"friction 4\.5"):
        locked.at(friction=4.5).linear  # noqa: B018


# -- matrices


def test_matrices_that_are_there_are_a_model():
    rng = np.random.default_rng(1)
    M, C, K0 = (A @ A.T + np.eye(4) for A in rng.standard_normal((3, 4, 4)))
    G = rng.standard_normal((4, 4))
    model = sq.matrices(M, {"1": 1e6 * K0, "2*mu": 1e5 * G}, C=C, mu=0.2)
    system = model.at(mu=0.7)
    K = 1e6 * K0 + 1.4e5 * G
    np.testing.assert_allclose(system.linear.K, K)
    modes = system.modes((0.1, 1e4))
    wanted = companion_roots(np.linalg.solve(M, C), np.linalg.solve(M, K))
    wanted = wanted[wanted.imag > 0]
    np.testing.assert_allclose(np.sort(np.abs(modes.lam)), np.sort(np.abs(wanted)), rtol=1e-8)
    for lam, x, y in zip(modes.lam, modes.right.T, modes.left.T, strict=True):
        Q = lam**2 * M + lam * C + K
        assert np.linalg.norm(y.conj() @ Q) < 1e-8 * np.linalg.norm(K) * np.linalg.norm(y)
        assert y.conj() @ (2 * lam * M + C) @ x == pytest.approx(1.0, abs=1e-8)
    for step in ("steady", "assembly"):
        with pytest.raises(ModelError, match="neither contact nor components"):
            getattr(system, step)
    with pytest.raises(ParameterError, match="no value"):
        sq.matrices(M, {"mu": K})
    with pytest.raises(ParameterError, match="none of the coefficients"):
        sq.matrices(M, {"mu": K}, mu=1.0, nu=2.0)
    with pytest.raises(ModelError, match="square"):
        sq.matrices(M, K[:3])


@pytest.mark.filterwarnings("error")
def test_parts_of_numbers_are_not_dropped():
    """Imaginary parts of a batch were cut off, and masked values and entries counted as given."""
    masked = np.ma.masked_array([0.1, 0.5], [False, True])
    for values in (np.array([0.1, 0.5 + 1j]), [0.1 + 1j], masked):
        with pytest.raises(ParameterError, match="friction"):
            sq.model("hulten").at(friction=values)
    with pytest.raises(ModelError, match="K: expected a value of every entry, some are masked"):
        sq.matrices(np.eye(2), np.ma.masked_array(np.eye(2), np.eye(2) == 0))


def test_matrices_are_copied():
    """A stiffness that is changed in place for a second model is not that of the first."""
    own = sp.csr_matrix(np.diag([1e4, 4e4]))
    models = [sq.matrices(np.eye(2), own)]
    own.data *= 4.0
    models.append(sq.matrices(np.eye(2), own.todok()))
    highest = [np.abs(model.at().modes().lam).max() for model in models]
    np.testing.assert_allclose(highest, [200.0, 400.0])


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e6], ids=["mHz", "Hz", "MHz"])
def test_own_matrices_have_all_their_modes(scale):
    K = scale**2 * np.diag([4e5, 1e6, 2e6, 1e14])  # one far above all others
    K[0, 1] = K[1, 0] = 2e5 * scale**2
    C = scale * np.diag([5.0, 5.0, 9.0, 1e3])
    modes = sq.matrices(np.eye(4), K, C=C).at().modes()
    wanted = companion_roots(C / scale, K / scale**2)
    wanted = scale * wanted[wanted.imag > 0]
    np.testing.assert_allclose(modes.lam, wanted[np.argsort(np.abs(wanted))], rtol=1e-7)
    assert modes.status == "ok"
    free = sq.matrices(np.eye(2), scale**2 * np.array([[1e6, -1e6], [-1e6, 1e6]])).at().modes()
    assert np.abs(free.lam) == pytest.approx([scale * np.sqrt(2e6)])  # no motion of the free body


def test_an_empty_band_that_nobody_chose_is_warned_of():
    system = sq.model("hulten", frequency_1=2e4, frequency_2=3e4, friction=0.0).at()
    with pytest.warns(UserWarning, match=r"between 1 and 16000 Hz.* nearest has 20000 Hz"):
        assert not system.modes().counts
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not system.modes().counts  # once
        assert not system.modes((1.0, 10.0)).counts
    massless = sq.matrices(np.diag([1.0, 0.0]), np.diag([1e12, 1e6])).at()
    with pytest.warns(UserWarning, match="the default band"):
        assert not massless.modes().counts


@pytest.mark.parametrize("coupling", [1e4, 1e6])
def test_two_modes_that_are_one_are_not_stable(coupling):
    K = np.diag([1e6, 1e6, 2e6])
    K[0, 1] = coupling  # x_1 grows as t
    table = sq.matrices(np.eye(3), K).modes()
    assert table["stability"].tolist() == ["uncertain", "uncertain", "stable"]
    equal = sq.matrices(np.eye(3), np.diag([1e6, 1e6, 1e6])).modes()
    assert set(equal["stability"]) == {"stable"}  # bounded, whatever the start
    damped = sq.matrices(np.eye(3), K, C=5.0 * np.eye(3)).modes()
    assert set(damped["stability"]) == {"stable"}


# -- what is wrong


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"frction": 0.3}, "did you mean 'friction'"),
        ({"friction": [0.1, 0.2], "sliding_speed": [1.0, 2.0, 3.0]}, "has 2 values"),
        ({"friction": [0.1, -0.2]}, "at least 0"),
        ({"friction": [0.1, np.nan]}, "finite"),
        ({"sliding_speed": [1.0, 0.0]}, "other than 0"),
        ({"friction": [[0.1], [0.2]]}, "one axis"),
        ({"friction": []}, "one axis"),
        ({"friction": [True, False]}, "expected numbers"),
        ({"friction": ["a", "b"]}, "expected a number and its unit, got 'a'"),
        ({"friction": [0.1, {}]}, "an array of numbers"),
        ({"sliding_speed": "3 bar"}, "m/s"),
        ({"contact.cubic_stiffness": 1e15}, "does nothing here"),
    ],
)
def test_values_that_cannot_be_taken(values, message):
    with pytest.raises(ParameterError, match=message):
        sq.model("hulten").at(**values)


def test_what_a_batch_does_not_have():
    batch = sq.model("hulten").at(friction=[0.1, 0.2])
    with pytest.raises(ModelError, match=r"system\[i\].assembly"):
        batch.assembly  # noqa: B018
    with pytest.raises(ModelError, match="2 structures"):
        sq.model("hulten").at(mass=[1.0, 2.0]).reduced()
    with pytest.raises(TypeError, match="no length"):
        len(batch[0])
    with pytest.raises(IndexError):
        batch[2]
    for band in ((100.0, 10.0), (1.0,), "low"):
        with pytest.raises(ParameterError, match="band"):
            batch.modes(band)


def test_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    sq.model("hulten", friction=0.5).modes()
    sq.model("hulten").at(friction=[0.1, 0.2]).modes()
    assert list(tmp_path.iterdir()) == []


def test_units_and_options_of_design_points():
    model = sq.model("hoffmann")
    assert model.at(sliding_speed="36 km/h").point.values["sliding_speed"] == pytest.approx(10.0)
    own = model.at(contact_law="exponential", friction=0.3)
    assert own.point.law_kind == "exponential"
    with pytest.raises(SquealstudyError):
        model.at(contact_law="sticky")


# -- derivatives, runs, limit cycles


def test_sensitivities_are_differences_of_roots():
    system = sq.model("hulten", damping_ratio=0.01).at(friction=0.5)
    found = system.sensitivities("friction", "frequency_1")
    assert found.names == ("friction", "frequency_1")
    for column, (name, h) in enumerate((("friction", 1e-5), ("frequency_1", 1e-3))):
        value = system.point.values[name]
        ends = sq.model("hulten", damping_ratio=0.01, friction=0.5).at(**{name: value + h * SIGNS})
        slope = np.diff(ends.modes().lam[:, 0])[0] / (2 * h)
        assert found.derivative[0, column] == pytest.approx(slope, rel=1e-4)
        assert found.d_growth_rate[0, column] == pytest.approx(slope.real, rel=1e-4)
    table = found.to_pandas()
    assert table["parameter"].tolist() == ["friction", "frequency_1"]
    batch = sq.model("hulten").at(friction=[0.1, 0.5]).sensitivities("friction")
    assert [len(one.lam) for one in batch] == [0, 1]
    with pytest.raises(ParameterError, match="did you mean 'friction'"):
        system.sensitivities("frction")
    with pytest.raises(ParameterError, match="a number of modes"):
        system.sensitivities("friction", modes=0)


def test_a_run_grows_as_its_mode_does():
    """A little beyond the onset of flutter, ten periods from a small push."""
    system = sq.model("hulten", damping_ratio=0.01).at(friction=[0.32, 0.36])
    runs = system.simulate(duration=0.15, step=2e-5, save_every=10, perturbation=1e-6)
    growth = system.modes().growth_rate.max(axis=1)
    assert runs.status.tolist() == ["ok", "ok"]
    late = runs.time[0] > 0.05
    for energy, rate in zip(runs.history("modal_energy"), growth, strict=True):
        slope = np.polyfit(runs.time[0][late], np.log(energy[late]), 1)[0]
        assert slope == pytest.approx(2 * rate, rel=0.05)
    alone = system[1].simulate(duration=0.15, step=2e-5, save_every=10, perturbation=1e-6)
    np.testing.assert_allclose(alone.torque, runs.torque[1], rtol=1e-8)
    with pytest.raises(KeyError, match="modal_energy"):
        runs.history("energy")


def test_what_a_run_came_to_does_not_depend_on_the_rows_that_are_kept():
    """Rows 10 ms apart cannot show a motion of 92 Hz: summaries are of closer ones."""
    system = sq.model("hulten", damping_ratio=0.01).at(friction=0.5)
    every = {n: system.simulate(0.6, step=2e-5, save_every=n) for n in (1, 20, 500)}
    torque = every[1].torque[-10000:] - every[1].torque[-10000:].mean()
    power = np.abs(np.fft.rfft(np.hanning(10000) * torque))  # bins of 5 Hz
    for n, runs in every.items():
        row = runs.summary().iloc[0]
        assert row["torque_line_hz"] == pytest.approx(5.0 * np.argmax(power), abs=2.6), n
        assert row["frequency_hz"] == pytest.approx(row["torque_line_hz"], rel=1e-3), n
        assert row["class"] == "limit_cycle", n
        np.testing.assert_allclose(runs.torque, every[1].torque[::n], atol=1e-9)
        most = every[1].history("torque_max")[1:].reshape(-1, n).max(axis=1)
        np.testing.assert_allclose(runs.history("torque_max")[1:], most, atol=1e-9)
    none = system.simulate(0.6, step=2e-5, save_every=0)
    assert len(none.torque) == 0
    assert none.summary()["class"].item() == "limit_cycle"
    with pytest.raises(ParameterError, match="1009 has no divisor"):
        system.simulate(0.1, step=1e-7, save_every=1009)


def test_a_limit_cycle_is_what_a_run_comes_to():
    model = sq.model("hulten", contact_law="cubic", **{"contact.cubic_stiffness": 5e17})
    system = model.at(friction=0.305, damping_ratio=0.01)
    found = system.limit_cycles()
    cycle = found.cycles[0][1]
    runs = system.simulate(duration=2.5, step=5e-5, save_every=4, perturbation=1e-2)
    late = runs.torque[-2000:]  # some forty periods
    assert cycle.attracts
    assert late.std() == pytest.approx(cycle.levels["torque_rms"], rel=0.01)
    assert found.to_pandas()["stable"].tolist()[0]


# -- the shipped example


def test_the_shipped_continuation_ends_at_the_lock_in(tmp_path):
    folder = PACKAGE.parent / "studies"
    names = runpy.run_path(str(folder / "continuation.py"))
    friction, roots = names["followed"](sq.model("hulten"), 0.1, 0.6, 0.02)
    assert friction[-1] == pytest.approx((100**2 - 75**2) / (2 * 100 * 75), abs=1e-6)
    assert roots.shape == (len(friction), 2)
    with mpl.rc_context({"backend": "agg"}), pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["continuation.py", str(tmp_path / "picture.png")])
        runpy.run_path(str(folder / "continuation.py"), run_name="__main__")
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_batches_of_point_masses_are_solved_at_once_and_fail_row_by_row():
    friction, speed = np.linspace(0.1, 1.4, 7), np.linspace(0.2, 1.0, 7)
    batch = sq.model("hoffmann", contact_law="exponential").at(
        friction=friction, sliding_speed=speed, damping_ratio=0.01
    )
    assert is_point_mass_batch(batch.values)
    modes, frame = batch.modes(), batch.modes().to_pandas()
    for number, point in enumerate(batch):
        alone = point.modes()
        n = modes.counts[number]
        assert (n, modes.status[number]) == (alone.counts, alone.status)
        # gaps of both balance to 1e-11 of the movement under the load
        np.testing.assert_allclose(modes.lam[number, :n], alone.lam, rtol=1e-10)
        linear = point.linear
        lam, x = modes.lam[number, :n], modes.right[number, :, :n]
        R = x * lam**2 + linear.C @ x * lam + linear.K @ x
        assert (np.linalg.norm(R, axis=0) < 1e-10 * np.linalg.norm(linear.K)).all()
        y = modes.left[number, :, :n]
        own = np.einsum("ij,ij->j", y.conj(), 2 * lam * x + linear.C @ x)
        np.testing.assert_allclose(own, 1.0, rtol=1e-8)
        np.testing.assert_allclose(modes.energies[number, :, :n], alone.energies, atol=1e-12)
    assert frame["point"].nunique() == 7
    failing = sq.model("hulten").at(mass=[1.0, 1e150], stiffness_damping=[0.0, 1e149]).modes()
    assert failing.status.tolist() == ["ok", "overflow"]
    assert failing.counts.tolist() == [2, 0]


def test_a_run_says_what_its_step_may_do_to_its_numbers():
    batch = sq.model("hulten").at(friction=np.array([0.5, 0.55]))
    long, short = (
        batch.simulate(duration=0.2, step=step, perturbation=1e-3).summary()
        for step in (1e-3, 2e-5)
    )
    assert all("step" in reason for reason in long["invalid_reason"])
    assert list(short["invalid_reason"]) == ["", ""]
    assert all("the step changes is left out" in reason for reason in short["bounds_reason"])


RUN = {"duration": 0.01, "step": 1e-5}


@pytest.mark.parametrize(
    ("method", "arguments", "message"),
    [
        (
            "limit_cycles",
            {"harmonics": (10.0, 1000.0)},
            "'harmonics': .* whole number from 1 to 60",
        ),
        ("limit_cycles", {"harmonics": 0}, "'harmonics'"),
        ("limit_cycles", {"tolerance": np.nan}, "'tolerance': .* above 0 and at most 0.1, got nan"),
        ("limit_cycles", {"tolerance": 0.0}, "'tolerance'"),
        ("limit_cycles", {"reach": -1.0}, "'reach'"),
        ("simulate", RUN | {"save_every": 2.5}, "'save_every': expected a whole number"),
        ("simulate", RUN | {"perturbation": "x"}, "'perturbation': .* at least 0, got 'x'"),
        ("simulate", RUN | {"duration": True}, "'duration': expected a number above 0, got True"),
        ("sensitivities", {"change": 0.6}, "'change': .* at most 0.5, got 0.6"),
    ],
)
def test_an_argument_that_cannot_be_used_is_named_with_what_was_expected(
    method, arguments, message
):
    system = sq.model("hulten", friction=0.4).at()
    with pytest.raises(ParameterError, match=message):
        getattr(system, method)(**arguments)


def test_names_of_parameters_and_models_are_texts_or_paths(tmp_path):
    with pytest.raises(ParameterError, match="expected names of parameters, got"):
        sq.model("hulten").at().sensitivities(["friction"])
    with pytest.raises(SquealstudyError, match="path of a model file, got 3"):
        sq.model(3)
    with pytest.raises(SquealstudyError, match="no such file"):
        sq.model(tmp_path / "none.toml")


def test_a_run_that_no_memory_holds_is_one_sentence():
    with pytest.raises(SquealstudyError, match="memory ran out"):
        sq.model("hulten", friction=0.4).at().simulate(duration=1e9, step=1e-5)


def test_a_sweep_over_many_parameters_varies_the_first_fastest():
    """A friction map has 34 values: numpy's grids end at 32 parameters."""
    ones = {f"friction_law.map_ratio_{k}_{j}": [1.0] for k in range(1, 7) for j in range(1, 5)}
    speeds = {f"friction_law.map_speed_{k}": [float(k)] for k in range(1, 7)}
    pressures = {f"friction_law.map_pressure_{j}": [1e6 * j] for j in range(1, 5)}
    model = sq.model("hulten", friction_law="map")
    swept = {"friction": [0.1, 0.2], "sliding_speed": [1.0, 2.0, 3.0]}
    many = model.sweep(**swept, **ones, **speeds, **pressures)
    points = many.groupby("point").first()
    assert points["friction"].tolist() == [0.1, 0.2] * 3
    assert points["sliding_speed"].tolist() == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
    units = many.attrs["units"]  # those of swept values were missing
    assert (units["sliding_speed"], units["friction"], units["growth_rate"]) == ("m/s", "", "1/s")
    np.testing.assert_allclose(
        many["frequency_hz"], sq.model("hulten").sweep(**swept)["frequency_hz"], rtol=1e-12
    )


def test_matrices_whose_roots_are_all_0_are_told_so():
    """Of a default band it was said, though all modes had been looked for."""
    with pytest.warns(UserWarning, match="no mode has a frequency: all roots are 0"):
        assert not len(sq.matrices(np.eye(2), np.zeros((2, 2))).modes())
