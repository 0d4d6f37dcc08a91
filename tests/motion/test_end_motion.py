"""Motion at the end of a run: on all nodes, and by the complex modes of its design point."""

from __future__ import annotations

import numpy as np
import pytest
import pyuff
from own_blocks import write_blocks
from study_runs import command, load_plan, solved

from squealstudy.engine.mode_shapes import PointShapes
from squealstudy.engine.result_names import STATES
from squealstudy.engine.results import Results
from squealstudy.errors import ModelError, ResultsError
from squealstudy.shapes.files import Signal, write_uff
from squealstudy.shapes.names import name_of
from squealstudy.shapes.picture import sources, title

STUDY = """
[study]
name = "blocks"
kind = "transient"

[model]
file = "blocks.toml"

[parameters]
friction = 0.6
damping_ratio = 1e-4

[modes]
band = [500.0, 80000.0]

[transient]
duration = 1.5e-3
step = 2e-7
perturbation = 1e-6
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Results:
    """Flutter near 61 kHz that grows by e^5, far from any limit."""
    folder = tmp_path_factory.mktemp("blocks")
    return solved(load_plan(write_blocks(folder, study=STUDY)), folder / "results")


def state(results):
    with np.load(results.directory / STATES / f"{results.points['point_id'][0]}.npz") as data:
        return data["q"], data["v"]


def test_what_grows_is_one_complex_mode(results):
    """Small motion that has grown: all of its energy in the plane of the unstable mode."""
    motion = results.end_motion()
    k = int(motion.share.argmax())
    assert motion.lam[k].real > 3000
    assert motion.share[k] > 0.9999
    assert motion.mac[k] > 0.99
    assert motion.residual < 1e-6
    assert motion.shape.frequency_hz == pytest.approx(motion.lam[k].imag / (2 * np.pi), rel=2e-3)
    assert name_of(motion.shape).text


def test_shares_are_those_of_the_definition(results):
    """Least squares on the real and imaginary part of each mode's state, measured by energy."""
    q, v = state(results)
    rng = np.random.default_rng(4)
    shapes = PointShapes(results, 0)
    motion = results.end_motion()
    w2, phi = np.linalg.eigh(shapes.system.K_sym)
    root = np.sqrt(w2)[:, None] * phi.T  # |root q|^2 = q^T K_sym q

    def states(x, w):
        return np.concatenate([root @ x, phi.T @ w])

    z = states(q, v)
    every = []
    for number, share, lam in zip(motion.number, motion.share, motion.lam, strict=True):
        psi = shapes.psi[:, number - 1]
        assert shapes.lam[number - 1] == lam
        turned = psi * np.exp(1j * rng.uniform(0, 6))
        plane = states(turned, lam * turned)
        plane = np.column_stack([plane.real, plane.imag])
        every.append(plane)
        seen = plane @ np.linalg.lstsq(plane, z, rcond=None)[0]
        assert share == pytest.approx(seen @ seen / (z @ z), rel=1e-8, abs=1e-12)
    whole = np.hstack(every)
    left = z - whole @ np.linalg.lstsq(whole, z, rcond=None)[0]
    assert motion.residual == pytest.approx(left @ left / (z @ z), rel=1e-3, abs=1e-11)


def test_displacement_is_that_of_the_state(results):
    """The shape at phase 0, undone in size and phase, is the displacement of the state."""
    q, v = state(results)
    shapes = PointShapes(results, 0)
    motion = results.end_motion()
    omega = 2 * np.pi * motion.shape.frequency_hz
    u, w = (shapes._assembly.at_nodes(shapes._expansion.expand(x)) for x in (q, v))
    U = motion.shape.displacement.ravel()
    factor = np.vdot(U, (u - 1j * w / omega).ravel()) / np.vdot(U, U)
    size = np.abs(u).max()
    assert np.abs((factor * U).real - u.ravel()).max() < 1e-9 * size
    assert np.abs((1j * omega * factor * U).real - w.ravel()).max() < 1e-9 * np.abs(w).max()


def test_command_shows_the_motion(results, capsys, tmp_path):
    out = tmp_path / "out"
    asked = ("shape", str(results.directory), "-o", str(out), "--uff", "--no-picture")
    assert command(*asked) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "end of the run: 61" in told
    assert "100.0 % of the energy in its plane of motion" in told
    shape = results.end_motion().shape
    assert not [text for text in (*title(shape), *sources(shape)) if "growth" in text]
    assert {p.suffix for p in out.iterdir()} == {".html", ".uff"}
    assert all(p.stem.startswith("end_of_the_run_") for p in out.iterdir())
    mode = pyuff.UFF(str(next(out.glob("*.uff")))).read_sets(2)
    assert mode["analysis_type"] == 5
    assert mode["freq"] == pytest.approx(results.end_motion().shape.frequency_hz, rel=1e-5)
    signals = pyuff.UFF(str(next(out.glob("*.uff")))).read_sets()[3:]
    kept = results.history(shape.label.point_id)
    names = [n for n in kept.columns if n != "time" and "_mode_" not in n]
    assert [s["id1"].rpartition(", ")[2] for s in signals] == names
    assert "torque" in names
    for name, signal in zip(names, signals, strict=True):
        assert signal["type"] == 58
        assert signal["ordinate_axis_units_lab"].strip() == (kept.attrs["units"][name] or "NONE")
        np.testing.assert_allclose(signal["data"], kept[name], rtol=1e-10, atol=1e-30)
        np.testing.assert_allclose(signal["x"], kept["time"], rtol=1e-5, atol=1e-12)


def test_a_signal_of_uneven_steps_is_refused(results, tmp_path):
    uneven = Signal("torque", "N m", np.array([0.0, 1.0, 2.1]), np.zeros(3))
    with pytest.raises(ModelError, match="torque: steps in time are not even"):
        write_uff(results.end_motion().shape, tmp_path / "a.uff", [uneven])
    assert not list(tmp_path.iterdir())


def test_what_has_no_motion(results, tmp_path):
    changed = results.points.assign(torque_line_hz=np.nan)
    with pytest.raises(ResultsError, match="has no motion to show"):
        results.with_tables(points=changed).end_motion(0)
    failed = results.points.assign(status="failed", message="no equilibrium")
    with pytest.raises(ResultsError, match="no run came to its end"):
        results.with_tables(points=failed).end_motion()
    with pytest.raises(ResultsError, match="no equilibrium"):
        results.with_tables(points=failed).end_motion(0)
    swapped = results.points.drop(columns="torque_rms")
    with pytest.raises(ResultsError, match="has no column torque_rms"):
        results.with_tables(points=swapped).end_motion()
    other = Results(results.directory, results.manifest | {"kind": "complex_modes"})
    with pytest.raises(ResultsError, match="is that of runs in time"):
        other.end_motion(0)
    assert command("shape", str(results.directory), "--mode", "3") == 2
    name = f"{STATES}/{results.points['point_id'][0]}.npz"
    kept = (results.directory / name).read_bytes()
    (results.directory / name).unlink()
    try:
        with pytest.raises(ResultsError, match=r"\.npz"):
            Results.open(results.directory).end_motion(0)
    finally:
        (results.directory / name).write_bytes(kept)
