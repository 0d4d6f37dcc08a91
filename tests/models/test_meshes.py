"""Meshes of the generated brake: their errors, mechanisms, and what a sweep does to them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import CUTOFF, benchmark
from tiny_meshes import SMALL

from squealstudy.engine.forecast import mesh_error
from squealstudy.engine.plan import Plan
from squealstudy.errors import ParameterError, SquealstudyError
from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.parameters import ASCENDING
from squealstudy.models.catalogue.disc_brake.solids import (
    COARSE,
    DENSITIES,
    FINE,
    MEDIUM,
    BrakeMesher,
)
from squealstudy.models.fem.grid import cylindrical_mesh
from squealstudy.models.fem.sampling import shape_functions
from squealstudy.models.fem.solid import FULL_INTEGRATION_ORDER
from squealstudy.modes.point import PointModes
from squealstudy.study.definition import load_study

STUDY = Path(__file__).parents[2] / "studies" / "friction_pressure.toml"
SOLIDS = ("disc", "inner_pad", "caliper")
TOP = 6e3  # Hz
# lengths and angles that meshes follow; the fingers end with the bridge by default, see below
LENGTHS = [
    p.name
    for p in MODELS["disc_brake"].parameters
    if p.unit in ("m", "deg")
    and p.name not in ("caliper.finger_outer_angle", "caliper.bridge_half_angle")
]


class Lines(BrakeMesher):
    """Makes grids without elements."""

    def _solid(self, component, lines, blocks):
        return cylindrical_mesh(*lines, blocks)


def default(**changes):
    return MODELS["disc_brake"].defaults() | {k.replace("__", "."): v for k, v in changes.items()}


def elastic(solid, cutoff=TOP):
    omega, _ = real_modes(solid.M, solid.K, cutoff)
    return omega[rigid_modes(solid.M, solid.K, omega) :] / (2 * np.pi)


# -- errors --------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "component",
    ["inner_pad", *(pytest.param(c, marks=pytest.mark.full_size) for c in ("caliper", "disc"))],
)
def test_free_modes_of_the_coarse_mesh_against_elements_of_third_order(component):
    layers = {"disc": 2, "inner_pad": 1, "caliper": 1}[component]
    exact = benchmark("component_reference").frequencies(component, default(), TOP, 3, layers)
    hz = elastic(BrakeMesher(default(), COARSE).component(component), 1.05 * TOP)
    np.testing.assert_allclose(hz[: len(exact)], exact, rtol=0.03)
    assert len(exact) == {"disc": 20, "inner_pad": 4, "caliper": 5}[component]


@pytest.mark.full_size
@pytest.mark.parametrize("geometry", list(benchmark("mesh_convergence").GEOMETRIES))
@pytest.mark.parametrize("component", SOLIDS)
def test_free_modes_of_medium_and_fine_meshes(component, geometry):
    measured = benchmark("mesh_convergence")
    values, reference = default() | measured.GEOMETRIES[geometry], measured.SOLIDS[component]
    exact, _ = benchmark("component_reference").extrapolated(component, values, TOP, *reference)
    for density, error in ((COARSE, 0.03), (MEDIUM, 0.01), (FINE, 0.003)):
        hz = elastic(BrakeMesher(values, density).component(component), 1.05 * TOP)
        np.testing.assert_allclose(hz[: len(exact)], exact, rtol=error)


# -- mechanisms of reduced integration -----------------------------------------------------------
@pytest.mark.parametrize("component", SOLIDS)
def test_no_mode_owes_its_frequency_to_reduced_integration(brake, component):
    """A mechanism has no energy at 8 points and a large one at 27."""
    reduced = next(c for c in brake.assembly.components if c.name == component)
    full = BrakeMesher(default(), SMALL, FULL_INTEGRATION_ORDER).component(component)
    modes = brake.modes[component]
    assert rigid_modes(reduced.M, reduced.K, modes.omega) == 6
    phi = modes.phi[:, 6:]
    ratio = np.einsum("ij,ij->j", phi, full.K @ phi) / modes.omega[6:] ** 2
    assert modes.omega[-1] > 0.8 * 2 * np.pi * CUTOFF
    assert (ratio > 1 - 1e-9).all()
    assert (ratio < 2).all()


# -- sweeps of the geometry ----------------------------------------------------------------------
@pytest.mark.parametrize("density", ["coarse", "medium"])
@pytest.mark.parametrize("component", SOLIDS)
def test_a_sweep_of_a_length_keeps_the_cells(component, density):
    mesh = Lines(default(), DENSITIES[density]).component(component).mesh
    for name in LENGTHS:
        for factor in (0.96, 1.03):
            values = default()
            values[name] *= factor
            other = Lines(values, DENSITIES[density]).component(component).mesh
            np.testing.assert_array_equal(other.t, mesh.t, err_msg=name)


@pytest.mark.parametrize(
    ("component", "name"),
    [
        ("inner_pad", "pad.lining_thickness"),
        ("inner_pad", "piston.half_angle"),
        ("caliper", "caliper.bridge_inner_radius"),
        ("caliper", "caliper.body_half_angle"),
        ("disc", "disc.bell_height"),
        ("disc", "disc.bell_outer_radius"),
    ],
)
def test_frequencies_are_smooth_in_a_length(component, name):
    """Third differences over .2 % of the length: curvature leaves 1e-8 of them."""
    hz = []
    for share in np.linspace(0.999, 1.001, 5):
        values = default()
        values[name] *= share
        mesher = BrakeMesher(values, replace(COARSE, around=6))
        hz.append(elastic(mesher.component(component), 3.2e3)[:2])
    assert np.abs(np.diff(hz, n=3, axis=0) / hz[0]).max() < 3e-8
    assert name == "piston.half_angle" or np.abs(np.diff(hz, axis=0) / hz[0]).max() > 1e-5


def test_fingers_may_end_beside_the_bridge():
    """The shape is another one then, and so is the mesh, but frequencies hardly move."""
    hz = []
    for angle in (24.99, 25.0, 25.01):
        values = default(caliper__finger_outer_angle=angle)
        hz.append(elastic(BrakeMesher(values, COARSE).component("caliper"), 4.5e3))
    np.testing.assert_allclose(hz, hz[1][None].repeat(3, axis=0), rtol=5e-3)


@pytest.mark.parametrize("pair", [pair for names in ASCENDING for pair in pairwise(names)])
def test_parts_that_vanish_are_named(pair):
    smaller, larger = pair
    values = default()
    with pytest.raises(ParameterError, match="must be larger than") as found:
        BrakeMesher(values | {smaller: values[larger]}, COARSE)
    assert smaller in str(found.value)


# -- places in thin cells ------------------------------------------------------------------------
def test_points_of_thin_cells_are_found():
    solid = BrakeMesher(default(disc__bell_outer_radius=0.0665), MEDIUM).component("disc")
    rng = np.random.default_rng(0)
    r, theta = rng.uniform(0.0662, 0.14, 400), rng.uniform(-np.pi, np.pi, 400)
    points = np.column_stack([r * np.cos(theta), r * np.sin(theta), rng.uniform(1e-3, 0.011, 400)])
    np.testing.assert_allclose(
        shape_functions(solid, points) @ solid.coordinates, points, atol=1e-12
    )


# -- what a study is told ------------------------------------------------------------------------
def found_modes(lam):
    """Modes of roots lam, each with a shape of its own."""
    lam = np.array(lam)
    some = np.zeros(len(lam))
    modes = PointModes(lam, some, np.zeros((1, len(lam))), np.eye(len(lam)), None, some)
    return modes, np.eye(len(lam), 8), 1.0


def test_error_of_a_mesh_is_that_of_paired_light_modes(monkeypatch):
    own = [-3.0 + 1010j, 8.0 + 2000j, -900.0 + 3000j]
    finer = [-2.0 + 1000j, -4.0 + 2000j, -800.0 + 3000j, 1.0 + 9000j]
    answers = iter([found_modes(own), found_modes(finer)])
    monkeypatch.setattr("squealstudy.engine.forecast._nominal_modes", lambda *_: next(answers))
    found = mesh_error(Plan(load_study(STUDY)), 1)
    assert found.meshes == ("medium", "fine")
    assert found.frequency == pytest.approx([0.01, 0.0], abs=1e-4)
    assert found.damping == pytest.approx([3 / 1010 - 2 / 1000, 12 / 2000], rel=1e-3)
    assert found.unpaired == 1
    assert found.unstable == (1, 1)


@pytest.mark.parametrize("mesh", ["fine", ""])
def test_error_of_a_mesh_without_a_finer_one_is_refused(mesh):
    study = load_study(STUDY)
    options = {k: v for k, v in (study.options | {"mesh": mesh}).items() if v}
    with pytest.raises(SquealstudyError, match="finer mesh than 'fine'" if mesh else "no mesh"):
        mesh_error(Plan(replace(study, options=options)), 1)
