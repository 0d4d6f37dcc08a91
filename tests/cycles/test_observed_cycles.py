"""Velocities of points and radiated power of cycles, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from component_meshes import box
from own_blocks import STUDY as BLOCKS
from own_blocks import write_blocks
from study_runs import plan_of, solved
from test_limit_cycles_study import STUDY, study

import squealstudy as sq
from squealstudy.cycles.harmonics import series_at
from squealstudy.engine.cycle_states import CycleSeries, stored_cycles
from squealstudy.engine.mode_shapes import expansion
from squealstudy.engine.store import Store
from squealstudy.engine.structures import build_structure, build_task
from squealstudy.errors import StudyFileError
from squealstudy.kinds.limit_cycles.observed import Observer, Observers
from squealstudy.kinds.limit_cycles.section import NamedPoint
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.components.mesh_cells import mesh_cells
from squealstudy.reduction.cmt import Expansion, ReducedModel
from squealstudy.shapes.radiation import AIR_IMPEDANCE_PA_S_PER_M, mean_square_form

SIDES = (3.0, 2.0, 2.5)
POINTS = """points = [
    {name = "along", component = "mass", at = 1},
    {name = "away", component = "mass", at = 2},
]
"""


def meshed(formulation, cells=(2, 2, 2)):
    """A box as a component, without any use of its matrices."""
    mesh = box(formulation, cells, SIDES)
    n = 3 * len(mesh.nodes)
    one = sp.eye(n, format="csr")
    return Component("box", one, one, mesh.nodes, cells=mesh_cells(mesh))


def motions(component):
    """Three translations and a turn about z (n, 4)."""
    x = component.coordinates
    moved = np.zeros((len(x), 3, 4))
    moved[:, np.arange(3), np.arange(3)] = 1.0
    moved[:, 0, 3], moved[:, 1, 3] = -x[:, 1], x[:, 0]
    return moved.reshape(-1, 4)


@pytest.mark.parametrize("formulation", ["C3D8", "C3D20", "C3D4", "C3D10", "C3D6"])
def test_the_square_of_normal_velocities_over_a_box(formulation):
    """Faces a b move with v where it is normal to them; a turn moves x = a faces with v_x = -y."""
    a, b, c = SIDES
    component = meshed(formulation)
    G = mean_square_form(component, motions(component))
    np.testing.assert_allclose(np.diag(G)[:3], [2 * b * c, 2 * a * c, 2 * a * b], rtol=1e-12)
    assert G[3, 3] == pytest.approx(2 * c * b**3 / 3 + 2 * c * a**3 / 3)
    assert G[0, 3] == pytest.approx(-c * b**2)  # of -y over both faces
    assert np.abs(G[2, [0, 1, 3]]).max() < 1e-12


def test_power_and_velocities_of_a_moving_box():
    """v = omega (2 sin, 1 cos), normal to faces of 2 b c and 2 a c."""
    component = meshed("C3D8")
    block = motions(component)[:, :2]
    n = component.n_dof
    none = sp.csr_matrix((0, n))
    contact = ContactInterface(
        none, none, none, np.zeros(0), np.zeros(0), np.zeros(0), None, np.zeros(0)
    )
    assembly = Assembly((component,), contact, (), np.zeros(n), np.zeros(n))
    rows = np.zeros((0, 2))
    points = [np.zeros(0)] * 4
    model = ReducedModel(
        ("box",),
        np.array([0, 2]),
        np.array([2]),
        np.zeros(2),
        np.zeros((2, 2)),
        rows,
        rows,
        rows,
        *points,
    )
    corner = NamedPoint(name="corner", component="box", at=(3.1, 2.0, 2.5))
    seen = Observer.of(assembly, Expansion(model, (block,)), ["box"], [corner])
    Q, omega = np.array([[5.0, 0.0], [2.0, 0.0], [0.0, 1.0]]), 10.0
    a, b, c = SIDES
    expected = AIR_IMPEDANCE_PA_S_PER_M * omega**2 * (4 * b * c + a * c)  # mean squares 2 and 1/2
    assert seen.power(Q, omega) == pytest.approx(expected)
    ((rms, peak),) = seen.velocities(Q, omega).values()
    assert rms == pytest.approx(omega * np.sqrt(2.5))
    assert peak == pytest.approx(2 * omega)
    assert seen.places["corner"].distance == pytest.approx(0.1)
    silent = Observer.of(assembly, Expansion(model, (block,)), [], [])
    assert np.isnan(silent.power(Q, omega))
    assert silent.velocities(Q, omega) == {}


def test_velocities_stand_in_a_table_of_their_own(tmp_path):
    """Of Hoffmann's mass, whose coordinates are the contact's: along the belt and away from it."""
    changes = {"points": ("tolerance = 1e-3", f"tolerance = 1e-3\n{POINTS}")}
    results = solved(plan_of(study([0.6], **changes), STUDY), tmp_path / "points")
    cycles = results.table("cycles").set_index("cycle_id")
    rows = results.table("velocities").set_index(["cycle_id", "point"])
    assert len(rows) == 2 * len(cycles)
    assert (rows["distance"] == 0).all()
    assert rows.attrs["units"]["velocity_peak"] == "m/s"
    theta = 2 * np.pi * np.arange(512) / 512
    for series in stored_cycles(Store(results.directory)):
        v = series.omega * (series_at(theta, (len(series.Q) - 1) // 2)[1] @ series.Q)
        size = np.sqrt((v**2).sum(axis=1).max())  # mass 1 kg: M-normalised coordinates are m
        both = rows.loc[series.cycle_id]
        assert both["velocity_rms"].pow(2).sum() == pytest.approx((v**2).sum(axis=1).mean())
        assert both["velocity_peak"].max() <= size <= np.hypot(*both["velocity_peak"])
        assert cycles.loc[series.cycle_id, "contact_velocity"] == pytest.approx(size, rel=1e-3)
    assert cycles["radiated_power"].isna().all()


def test_observers_lead_from_a_reduced_model_to_all_nodes(tmp_path):
    """A rigid motion of the slider up and down: its top and bottom of 10 mm2 radiate."""
    text = BLOCKS.replace("complex_modes", "limit_cycles").replace("reference_points = 1\n", "")
    text += '[limit_cycles]\nradiating = ["slider"]\npoints = [\n'
    text += '{name = "on it", component = "slider", at = [1.5e-3, 0.5e-3, 4e-3]},\n'
    text += '{name = "off it", component = "plate", at = [0.0, 0.0, 0.0]},\n]\n'
    plan = sq.read_study(write_blocks(tmp_path, study=text)).plan()
    ((key, point),) = plan.structures.items()
    build_structure(build_task(plan, point, 1))
    slider = point.assembly().components[1]
    up = np.zeros((len(slider.coordinates), 3))
    up[:, 2] = 1.0
    way = expansion(plan, 0, lambda *_: None)
    x = np.zeros(way.model.n)
    x[way.model.offsets[1] :] = way.blocks[1].T @ (slider.M @ up.ravel()[slider.places])
    Q, omega = np.vstack([0 * x, x, 0 * x]), 100.0
    power, rows = Observers(plan).observe(CycleSeries("a-1-1", key, Q, omega))
    assert power == pytest.approx(AIR_IMPEDANCE_PA_S_PER_M * 0.5 * omega**2 * 20e-6, rel=1e-6)
    on, off = rows
    assert on["velocity_peak"] == pytest.approx(omega, rel=1e-6)
    assert on["velocity_rms"] == pytest.approx(omega / np.sqrt(2), rel=1e-6)
    assert on["distance"] < 1e-9
    assert off["velocity_peak"] == 0.0


@pytest.mark.parametrize(
    ("line", "key", "told"),
    [
        ('radiating = ["mass"]', "radiating", "has no mesh"),
        ('radiating = ["disc"]', "radiating", "expected components ('mass'), got 'disc'"),
        (POINTS.replace("mass", "disc"), "points", "expected a component ('mass')"),
        (POINTS.replace("at = 2", "at = 3"), "points", "degrees of freedom 1 to 2, got 3"),
        (POINTS.replace("at = 2", "at = 0"), "points", "a degree of freedom from 1"),
        (POINTS.replace("at = 2", "at = [0, 0, 0]"), "points", "a degree of freedom from 1"),
        (POINTS.replace("away", "along"), "points", "distinct names"),
    ],
)
def test_what_cannot_be_observed_is_named(tmp_path, line, key, told):
    text = study([0.6], wrong=("tolerance = 1e-3", f"tolerance = 1e-3\n{line}"))
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyFileError) as caught:
        sq.read_study(path)
    assert caught.value.key.startswith(f"limit_cycles.{key}")
    assert told in str(caught.value)
