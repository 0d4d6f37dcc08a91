"""The angle at which a rotor stands: contact found anew there, component modes as they are."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from ring_disc import SECTORS, write_ring
from study_runs import command

import squealstudy as sq
from squealstudy.engine.report import report
from squealstudy.errors import SquealstudyError, StudyFileError
from squealstudy.reduction import cmt

HOLES = [(3, 0), (3, 1), (4, 1), (11, 0), (13, 1)]
BAND = (200.0, 5000.0)  # Hz
STEP = 360.0 / SECTORS
BY_HAND = "[components.disc]\nrotate = { axis = [0, 0, 1], angle = %g }\n"


def system(model, **values):
    return sq.model(str(model)).at(friction=0.5, **values)


def full_roots(found):
    """Roots from 200 to 5000 Hz of all degrees of freedom, by numpy from the parts of the model."""
    a, steady = found.assembly, found.steady
    c, slid = a.contact, 0.5 * np.maximum(steady.pressure, 0.0) * a.contact.area
    pressed = c.N.T @ sp.diags(c.area * steady.tangent) @ c.N
    rubbed = c.T.T @ sp.diags(0.5 * c.area * steady.tangent) @ c.N
    C = c.T_perp.T @ sp.diags(slid / (0.5 * c.speed_factor)) @ c.T_perp  # at 0.5 m/s
    K, M, n = (a.K + pressed - rubbed).toarray(), a.M.toarray(), a.n_dof
    below = np.linalg.solve(K, np.hstack([C.toarray(), M]))
    inverse = np.block([[-below[:, :n], -below[:, n:]], [np.eye(n), np.zeros((n, n))]])
    lam = 1.0 / np.linalg.eigvals(inverse)
    inside = (lam.imag > 2 * np.pi * 200.0) & (lam.imag < 2 * np.pi * 5000.0)
    return lam[inside]


def apart(one, other):
    """Largest relative distance of each root of `one` from the nearest of `other`."""
    return (np.abs(one[:, None] - other).min(axis=1) / np.abs(one)).max()


def same(one, other):
    largest = np.abs(other.steady.pressure).max()
    assert one.steady.pressure == pytest.approx(other.steady.pressure, abs=1e-9 * largest)
    lam, mu = full_roots(one), full_roots(other)
    assert len(lam) == len(mu) > 8
    assert apart(lam, mu) < 1e-9
    for system, exact in ((one, lam), (other, mu)):  # reduced models err by themselves
        lam = system.modes(BAND).lam
        assert apart(lam[lam.imag > 0.0], exact) < 1e-4


def test_a_disc_of_equal_sectors_is_the_same_after_each(tmp_path):
    """To round-off: its mesh repeats there. Between two steps the mesh is another."""
    model = write_ring(tmp_path)
    still = system(model)
    same(system(model, rotor_angle=4 * STEP), still)
    same(system(model, rotor_angle=-STEP), still)
    between = system(model, rotor_angle=STEP / 2)
    pressure = still.steady.pressure
    assert np.abs(between.steady.pressure - pressure).max() > 1e-6 * pressure.max()


HOT = """\
[components.disc]
materials.M.thermal_expansion = 1.1e-5
heat = { rise = 3.0, gradient = [0.02, 0.0, 0.5] }
"""
HELD = """
[[fixed]]
set = "disc.HUB"
dofs = [3]

[[spring]]
name = "stay"
between = ["disc.BOTTOM", "ground"]
stiffness = [4e3, 1e3, 2e3]

[[point_mass]]
name = "clip"
on = "disc.HUB"
mass = 1e-4

[stress_stiffening]
pressure = 1.0
friction = 0.5

[parameters]
"""
BARE: tuple[tuple[str, str], ...] = ()
FULL = (("[components.disc]\n", HOT), ("\n[parameters]\n", HELD))


@pytest.mark.parametrize(
    ("angle", "more"), [pytest.param(17.0, BARE, marks=pytest.mark.full_size), (-200.0, FULL)]
)
def test_a_disc_with_holes_is_the_mesh_turned_by_hand(tmp_path, angle, more):
    """With all that is on it: heat, masses and held sets turn, springs to ground stay."""
    model = write_ring(tmp_path / "angle", HOLES, *more)
    by_hand = write_ring(tmp_path / "hand", HOLES, *more, ("[components.disc]\n", BY_HAND % angle))
    turned, still = system(model, rotor_angle=angle), system(model)
    same(turned, system(by_hand))
    assert apart(full_roots(turned), full_roots(still)) > 1e-4  # it does something


def test_component_modes_are_found_once(tmp_path, monkeypatch):
    """Of disc and pad, whatever the angle."""
    asked = []
    real_modes = cmt.real_modes

    def counted(M, K, cutoff_hz, factor=None):
        asked.append((M.shape[0], factor is None))
        return real_modes(M, K, cutoff_hz, factor)

    cmt._kept_modes.clear()
    monkeypatch.setattr(cmt, "real_modes", counted)
    brake = sq.model(str(write_ring(tmp_path, HOLES)))
    for angle in (0.0, 17.0, 30.0):
        brake.at(rotor_angle=angle, friction=0.5).modes(BAND)
    of_components = [n for n, alone in asked if alone]
    assert len(of_components) == 2
    assert len(asked) > len(of_components)  # those of the assembly are others at each angle


PRESSURES = '"pressure"\nvalues = [1e6, 2e6]'


@pytest.mark.full_size  # by default a disc turned by hand: above
def test_a_sweep_tells_the_worst_angle(tmp_path, monkeypatch, capsys):
    """And check and report what turns; inspect tells whether the mesh is the same there."""
    monkeypatch.chdir(tmp_path)
    model = write_ring(tmp_path, HOLES)
    assert command("check", "study.toml") == 0
    path, said = tmp_path / "study.toml", "disc stands turned by 'rotor_angle'"
    assert said in " ".join(capsys.readouterr().out.split())
    swept = path.read_text()
    path.write_text(swept.replace('"rotor_angle"\nvalues = [0.0, 5.0, 10.0]', PRESSURES))
    assert command("check", "study.toml") == 0
    assert "stands turned" not in capsys.readouterr().out
    path.write_text(swept)
    assert command("run", "study.toml", "-o", "out", "--no-pictures") == 0
    screen = capsys.readouterr().out
    results = sq.open_results("out")
    assert said.split("'")[0] in report([results], shapes=False)
    modes = results.modes
    worst = modes.loc[modes["growth_rate"].idxmax()]
    angle = results.points.loc[results.points["point_id"] == worst["point_id"], "rotor_angle"]
    hertz = f"{worst['frequency_hz']:.0f}"
    row = next(r for r in screen.splitlines() if r.split()[1:2] == [hertz])
    assert row.split()[-2:] == [f"{float(angle.iloc[0]):g}", "deg"]
    for angle, words in ((22.5, "is the same there"), (7.0, "is another there")):
        model = write_ring(
            tmp_path / "whole",
            (),
            (
                "axis = [0, 0, 1]\n\n[components.disc]",
                f"axis = [0, 0, 1]\nangle = {angle}\n\n[components.disc]",
            ),
        )
        command("inspect", str(model))
        text = " ".join(capsys.readouterr().out.split())
        assert f"disc stands turned by {angle:g} deg; its mesh {words}" in text


JOINED = '[[spring]]\nname = "wire"\nbetween = ["disc.HUB", "pad.TOP"]\nstiffness = [1, 1, 1]\n'
HALF = '[[fixed]]\nset = "disc.HUB"\ndofs = [1]\n'
AXIS = "[rotation]\naxis = [0, 0, 1]\n"
BAD = [
    ((AXIS, ""), "parameters.rotor_angle.path", "and a table [rotation] of what turns"),
    (("rotation.angle", "rotation.axis"), "parameters.rotor_angle.path", "expected rotation.angle"),
    (("[[load]]", f"{JOINED}[[load]]"), "rotation.angle", "a spring joins disc, which turns, and"),
    (("[[load]]", f"{HALF}[[load]]"), "rotation.angle", "disc.HUB in some directions"),
    ((AXIS, AXIS + "angle = true\n"), "rotation.angle", "expected a number"),
]


@pytest.mark.parametrize(("change", "key", "words"), BAD)
def test_an_angle_that_cannot_be_is_one_sentence(tmp_path, change, key, words):
    model = write_ring(tmp_path, (), change)
    with pytest.raises(StudyFileError) as told:
        sq.model(str(model)).at(rotor_angle=5.0).assembly  # noqa: B018
    assert key in str(told.value)
    assert words in str(told.value)


def test_a_model_without_a_disc_has_no_angle():
    with pytest.raises(SquealstudyError, match="'rotor_angle'"):
        sq.model("hulten").at(rotor_angle=5.0)
