"""Finite elements of the generated models against closed forms and published values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
from skfem import MeshHex, MeshHex2

from squealstudy.errors import ModelError
from squealstudy.linalg.real_modes import real_modes
from squealstudy.models.fem.grid import GridBlock, Interval, cylindrical_mesh, graded_lines
from squealstudy.models.fem.sampling import facing_surface, sample_surface
from squealstudy.models.fem.solid import (
    Isotropic,
    TransverselyIsotropic,
    assemble_solid,
    orthotropic_stiffness,
)

STEEL = Isotropic(210e9, 0.3, 7800.0)
TURN = (0.0, 2 * np.pi)
ANYWHERE = (-np.inf, np.inf)
# lining + plate and disc volumes of the default brake, m3 (sectors of circular rings)
SECTOR = np.pi * (0.140**2 - 0.090**2)
VOLUME_MASS = {
    "disc": 7200.0
    * np.pi
    * (
        (0.140**2 - 0.066**2) * 0.012
        + (0.072**2 - 0.066**2) * 0.028
        + (0.072**2 - 0.034**2) * 0.006
    ),
    "inner_pad": SECTOR * (60 / 360 * 0.010 * 2500.0 + 70 / 360 * 0.005 * 7800.0),
    "outer_pad": SECTOR * (60 / 360 * 0.010 * 2500.0 + 70 / 360 * 0.005 * 7800.0),
    "caliper": 7100.0
    * np.pi
    * (
        (0.164**2 - 0.146**2) * 50 / 360 * (0.040 + 0.042 + 0.016)
        + (0.146**2 - 0.090**2) * 40 / 360 * 0.040
        + (0.146**2 - 0.090**2) * 40 / 360 * 0.016
    ),
}


def ring(r, z, n_r, n_theta, n_z, material=STEEL):
    """A full ring, r and z (low, high) in m."""
    lines = np.linspace(*r, n_r + 1), np.linspace(*TURN, n_theta + 1), np.linspace(*z, n_z + 1)
    grid = cylindrical_mesh(*lines, [GridBlock(ANYWHERE, ANYWHERE, ANYWHERE, "m")])
    return assemble_solid(grid, {"m": material})


def sector(material=STEEL, skew=0.0):
    """A curved sector of 2 x 3 x 2 cells; `skew` shears the Cartesian nodes."""
    lines = np.linspace(0.09, 0.14, 3), np.linspace(-0.5, 0.5, 4), np.linspace(0.0, 0.02, 3)
    grid = cylindrical_mesh(*lines, [GridBlock(ANYWHERE, ANYWHERE, ANYWHERE, "m")])
    if skew:
        p = grid.mesh.doflocs.copy()
        p[0] += skew * p[2]
        grid = replace(grid, mesh=MeshHex2(p, grid.mesh.t, sort_t=False, validate=False))
    return assemble_solid(grid, {"m": material})


def box(lengths, cells, material=STEEL):
    """A rectangular block."""
    lines = [np.linspace(0.0, L, n + 1) for L, n in zip(lengths, cells, strict=True)]
    grid = cylindrical_mesh(*lines, [GridBlock(ANYWHERE, ANYWHERE, ANYWHERE, "m")])
    mesh = MeshHex2.from_mesh(MeshHex.init_tensor(*lines))
    return assemble_solid(replace(grid, mesh=mesh), {"m": material})


def rigid_shapes(x):
    """Three translations and three rotations (3 n_nodes, 6) at node coordinates x."""
    R = np.zeros((len(x), 3, 6))
    R[:, :, :3] = np.eye(3)
    for axis in range(3):
        R[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    return R.reshape(-1, 6)


def elastic(solid, n, cutoff):
    """First n elastic frequencies, Hz."""
    omega, _ = real_modes(solid.M, solid.K, cutoff)
    return omega[6 : 6 + n] / (2 * np.pi)


# -- mass, rigid modes, doublets of the brake's solids -------------------------------------------
@pytest.mark.parametrize("name", list(VOLUME_MASS))
def test_mass_is_volume_times_density(brake, name):
    component = next(c for c in brake.assembly.components if c.name == name)
    # a parabola for an arc of half angle h loses h^4 / 30 of its sector; cells are 15 deg at most
    lost = np.deg2rad(7.5) ** 4 / 30
    assert 0 <= 1 - component.mass / VOLUME_MASS[name] <= lost * (1 + 1e-3)


@pytest.mark.parametrize("name", list(VOLUME_MASS))
def test_six_rigid_modes(brake, name):
    component = next(c for c in brake.assembly.components if c.name == name)
    R = rigid_shapes(component.coordinates)
    largest = abs(component.K).max() * np.abs(R).max(axis=0)
    assert (np.abs(component.K @ R).max(axis=0) < 1e-11 * largest).all()
    hz = brake.modes[name].omega / (2 * np.pi)
    assert (hz[:6] < 0.1).all()
    assert hz[6] > 900.0


def test_rigid_rotation_carries_the_inertia_of_the_ring():
    solid = ring((0.05, 0.08), (-0.01, 0.01), 1, 36, 1)
    R = rigid_shapes(solid.coordinates)
    inertia = np.diag(R.T @ (solid.M @ R))
    mass = 7800.0 * np.pi * (0.08**2 - 0.05**2) * 0.02
    polar = mass * (0.08**2 + 0.05**2) / 2
    across = mass * (3 * (0.08**2 + 0.05**2) + 0.02**2) / 12
    expected = [mass] * 3 + [across, across, polar]
    np.testing.assert_allclose(inertia, expected, rtol=5e-6)


def test_disc_modes_come_in_doublets(brake):
    hz = brake.modes["disc"].omega[6:] / (2 * np.pi)
    step = np.diff(hz) / hz[:-1]
    paired = step < 1e-6
    assert paired[[0, 3, 5]].all()  # 2, 3, 4 nodal diameters; (0, 1) circle between
    assert paired.sum() >= len(hz) // 3
    # nothing lies in between: a pair either coincides or is clearly two modes
    assert not ((step > 1e-6) & (step < 1e-4)).any()


# -- closed forms --------------------------------------------------------------------------------
def test_free_beam_bending():
    L, b, h = 0.5, 0.008, 0.01
    hz = elastic(box((L, b, h), (20, 1, 1)), 4, 1200.0)
    E, A = 210e9, b * h
    weak = [reference.free_beam_frequency(j, E, h * b**3 / 12, 7800 * A, L) for j in (1, 2)]
    strong = [reference.free_beam_frequency(j, E, b * h**3 / 12, 7800 * A, L) for j in (1, 2)]
    # rotary inertia and shear lower the frequency: about 10 (h/L)^2 and 40 (h/L)^2
    np.testing.assert_allclose(hz, sorted(weak + strong), rtol=1.5e-2)
    np.testing.assert_allclose(hz[:2], [weak[0], strong[0]], rtol=4e-3)
    assert (hz < sorted(weak + strong)).all()


def test_thin_ring_in_plane():
    R, h, b = 0.1, 0.002, 0.002
    hz = elastic(ring((R - h / 2, R + h / 2), (0.0, b), 1, 144, 1), 24, 1400.0)
    for n in (2, 3, 4):
        exact = reference.thin_ring_frequency(n, 210e9, b * h**3 / 12, 7800 * b * h, R)
        found = np.sort(np.abs(hz / exact - 1.0))[:2]
        assert (found < 1e-3).all(), (n, exact, found)  # both of the doublet


@pytest.mark.parametrize(
    ("ratio", "published"), [(0.1, (5.30, 8.77, 12.4)), (0.3, (4.91, 8.36, 12.26))]
)
def test_plate_reference_agrees_with_published_annuli(ratio, published):
    # Leissa, NASA SP-160, chapter 2: completely free annuli, nu = 0.3
    exact = [reference.free_annulus_parameter(n, 0, 0.3, ratio) for n in (2, 0, 3)]
    np.testing.assert_allclose(exact, published, rtol=4e-3)


def test_free_annular_plate():
    ratio, a, h = 0.3, 0.2, 0.004
    exact = [reference.free_annulus_parameter(n, 0, 0.3, ratio) for n in (2, 0, 3)]
    hz = elastic(ring((ratio * a, a), (0.0, h), 5, 60, 1), 5, 1200.0)
    D = 210e9 * h**3 / 12 / (1 - 0.3**2)
    parameters = 2 * np.pi * hz * a**2 * np.sqrt(7800 * h / D)
    # thickness 1/50 of the radius: shear and rotary effects of 1e-3
    np.testing.assert_allclose(parameters, np.repeat(exact, [2, 1, 2]), rtol=2e-3)


def test_plate_reference_reaches_the_full_disc():
    # published for the solid free disc, nu = 0.3: 5.358, 9.003, 12.439, 20.475
    exact = [reference.free_annulus_parameter(n, 0, 0.3, 1e-3) for n in (2, 0, 3, 1)]
    np.testing.assert_allclose(exact, [5.358, 9.003, 12.439, 20.475], atol=6e-4)


def torsion_error(n):
    """Relative error of a hollow cylinder's first torsional mode, pi c_s / L for any thickness.

    n cells along the axis, 6 n around; the mode is linear in the radius.
    """
    inner, outer, L = 0.03, 0.05, 0.1
    solid = ring((inner, outer), (0.0, L), 1, 6 * n, n)
    exact = np.pi / L * np.sqrt(210e9 / 2.6 / 7800.0)
    omega, phi = real_modes(solid.M, solid.K, 1.1 * exact / (2 * np.pi))
    x, y, z = solid.coordinates.T
    shape = np.column_stack([-y, x, 0 * x]) * np.cos(np.pi * z / L)[:, None]
    M_shape = solid.M @ shape.ravel()
    share = (phi.T @ M_shape) ** 2 / (shape.ravel() @ M_shape)
    assert share.max() > 0.9999
    return omega[share.argmax()] / exact - 1.0


def test_frequency_converges_with_the_fourth_power_of_the_size():
    cells = np.array([2, 3, 4, 6])
    errors = np.array([torsion_error(n) for n in cells])
    assert (errors > 0).all()  # from above, as Rayleigh quotients do
    order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.15)
    assert errors[-1] < 1e-4


# -- elements, quadrature, sampling --------------------------------------------------------------
@pytest.mark.parametrize("skew", [0.0, 0.7])
def test_patch_of_constant_strain(skew):
    material = TransverselyIsotropic(6e9, 2e9, 1.5e9, 0.15, 0.2, 2500.0)
    solid = sector(material, skew)
    rng = np.random.default_rng(1)
    gradient = rng.standard_normal((3, 3))
    u = (solid.coordinates @ gradient.T + rng.standard_normal(3)).ravel()
    e = (gradient + gradient.T) / 2
    strain = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[1, 2], 2 * e[0, 2], 2 * e[0, 1]])
    t = np.zeros(len(u))
    t[::3] = 1.0
    volume = t @ (solid.M @ t) / 2500.0
    energy = strain @ material.stiffness() @ strain * volume
    assert u @ (solid.K @ u) == pytest.approx(energy, rel=1e-12)
    force = (solid.K @ u).reshape(-1, 3)
    inner = solid.basis.complement_dofs(solid.basis.get_dofs())
    assert len(inner)
    assert np.abs(force[inner]).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize("points", [2, 3, 4])
def test_quadrature_measures_surfaces(points):
    solid = ring((0.05, 0.08), (0.0, 0.02), 2, 24, 1)
    top = sample_surface(solid, lambda r, t, z: abs(z - 0.02) < 1e-9, points)
    outside = sample_surface(solid, lambda r, t, z: r > 0.079, points)
    assert len(top.area) == 2 * 24 * points**2
    assert top.area.sum() == pytest.approx(np.pi * (0.08**2 - 0.05**2), rel=1e-5)
    assert outside.area.sum() == pytest.approx(2 * np.pi * 0.08 * 0.02, rel=1e-5)
    np.testing.assert_allclose(top.normal, np.tile([0.0, 0.0, 1.0], (len(top.area), 1)), atol=1e-12)
    radial = outside.points * [1, 1, 0] / np.hypot(*outside.points.T[:2])[:, None]
    assert np.einsum("ij,ij->i", outside.normal, radial).min() > 0.9999
    # integral of x^2 over the flat face: the weights are no mere count
    second = top.area @ top.points[:, 0] ** 2
    assert second == pytest.approx(np.pi / 4 * (0.08**4 - 0.05**4), rel=5e-5)


def test_surface_without_facets_is_refused():
    with pytest.raises(ModelError, match="no facet"):
        sample_surface(sector(), lambda r, t, z: r > 1.0)


def test_facing_surface_reproduces_linear_fields():
    below = sector()
    lines = np.linspace(0.08, 0.15, 3), np.linspace(-0.6, 0.6, 6), np.array([0.02, 0.03])
    above = assemble_solid(
        cylindrical_mesh(*lines, [GridBlock(ANYWHERE, ANYWHERE, ANYWHERE, "m")]), {"m": STEEL}
    )
    one = sample_surface(below, lambda r, t, z: abs(z - 0.02) < 1e-9)
    other = facing_surface(above, one)
    np.testing.assert_array_equal(other.normal, -one.normal)
    np.testing.assert_array_equal(other.area, one.area)
    for solid, surface in ((below, one), (above, other)):
        nodes = solid.coordinates
        np.testing.assert_allclose(surface.shape @ nodes, one.points, atol=1e-12)
        field = nodes @ [[1.0, 2.0, 3.0], [0.0, -1.0, 4.0], [2.0, 0.0, 1.0]] + [5.0, 6.0, 7.0]
        seen = surface.observe(np.array([0.0, 0.6, 0.8])) @ field.ravel()
        exact = one.points @ [[1.0, 2.0, 3.0], [0.0, -1.0, 4.0], [2.0, 0.0, 1.0]] + [5.0, 6.0, 7.0]
        np.testing.assert_allclose(seen, exact @ [0.0, 0.6, 0.8], rtol=1e-12)


def test_points_outside_the_facing_solid_are_refused():
    one = sample_surface(sector(), lambda r, t, z: abs(z - 0.02) < 1e-9)
    with pytest.raises(ModelError, match="outside"):
        facing_surface(ring((0.05, 0.13), (0.02, 0.03), 1, 12, 1), one)


# -- materials and grids -------------------------------------------------------------------------
def test_transverse_isotropy_contains_isotropy():
    E, nu = 6e9, 0.2
    same = TransverselyIsotropic(E, E, E / (2 * (1 + nu)), nu, nu, 2500.0)
    np.testing.assert_allclose(
        same.stiffness(), Isotropic(E, nu, 2500.0).stiffness(), rtol=1e-12, atol=1e-3
    )
    C = STEEL.stiffness()
    lame = 210e9 * 0.3 / (1.3 * 0.4)
    assert C[0, 1] == pytest.approx(lame, rel=1e-12)
    assert C[3, 3] == pytest.approx(210e9 / 2.6, rel=1e-12)


@pytest.mark.parametrize(
    "material",
    [
        Isotropic(-1.0, 0.3, 1.0),
        Isotropic(1e9, 0.5, 1.0),
        Isotropic(1e9, 0.3, 0.0),
        TransverselyIsotropic(6e9, 2e9, 1e9, 0.15, 3.0, 2500.0),
    ],
)
def test_impossible_material_is_refused(material):
    with pytest.raises(ModelError):
        material.stiffness()


CORNERS = (Interval(2), Interval(1, high=(0.1, 0.3)), Interval(3, low=(0.1, 0.3)), Interval())


@pytest.mark.parametrize("split", [1, 2, 3])
def test_graded_lines_keep_every_break(split):
    breaks = [0.034, 0.05, 0.066, 0.072, 0.14]
    lines = graded_lines(breaks, CORNERS, split)
    assert np.isin(np.round(breaks, 12), np.round(lines, 12)).all()
    assert (np.diff(lines) > 0).all()
    assert len(lines) == 1 + split * (2 + 3 + 5 + 1)
    coarse = graded_lines(breaks, CORNERS)
    np.testing.assert_allclose(lines[::split], coarse, rtol=1e-14)


def test_layers_have_shares_of_the_local_size():
    lines = graded_lines([0.0, 1.0, 4.0], [Interval(1, high=(0.1, 0.3)), Interval(1, low=(0.2,))])
    size = 1.0 * 3.0 / (1.0 + 3.0)
    expected = [0.0, 1 - 0.3 * size, 1 - 0.1 * size, 1.0, 1 + 0.2 * size, 4.0]
    np.testing.assert_allclose(lines, expected, rtol=1e-14)


def test_blocks_without_cells_are_refused():
    lines = np.array([0.1, 0.2]), np.array([0.0, 0.1]), np.array([0.0, 0.1])
    with pytest.raises(ModelError, match="no cell"):
        cylindrical_mesh(*lines, [GridBlock((0.3, 0.4), TURN, ANYWHERE, "m")])


def test_moduli_too_small_to_be_divided_by_are_told():
    with pytest.raises(ModelError, match="too small to be divided by"):
        orthotropic_stiffness((1e9, 1e9, 1e9), (0.1, 0.1, 0.1), (1e9, 5e-324, 1e9), 2500.0)
