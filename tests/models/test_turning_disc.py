"""A disc that turns, seen from the pads: gyroscopic terms, what they do to modes and in time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from conftest import NOMINAL, build_model
from own_blocks import write_blocks
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation
from study_runs import solved
from tiny_meshes import tiny_cache, tiny_meshes

import squealstudy as sq
from squealstudy.cli.run import blocks
from squealstudy.errors import ModelError, ParameterError
from squealstudy.kinds.complex_modes.error_text import turning_rows
from squealstudy.linalg.real_modes import real_modes
from squealstudy.mechanics.motions import set_up
from squealstudy.models.catalogue import MODELS
from squealstudy.models.catalogue.disc_brake.as_files import brake_meshes
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.components.bodies import Body
from squealstudy.models.components.expansion import expanded
from squealstudy.models.components.mesh_matrices import mass_matrix
from squealstudy.models.components.rotation import turning_matrix
from squealstudy.models.turning import Rotors
from squealstudy.modes.turning_effect import turning_effect
from squealstudy.motion.integrator import integrator
from squealstudy.motion.point import perturbed
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.simulate import simulate
from squealstudy.reduction.hybrid import hybrid_model
from squealstudy.screen import as_text

ROTOR = Rotors(("disc",))
OPTIONS = {"mesh": "coarse", "contact_points": 2, "kinematics": "uniform"}
NEUTRAL = 1e-7  # damping ratio, as studies have it
OFF, ON = {"gyroscopic_factor": 0.0}, {"gyroscopic_factor": 1.0}


TURNING_STUDY = """
[study]
name = "left_out"
kind = "complex_modes"

[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
kinematics = "uniform"

[parameters]
sliding_speed = 5.0
damping_ratio = 0.002

[[sweep]]
parameter = "friction"
values = [0.2, 0.4, 0.6]

[modes]
band = [500.0, 4000.0]
refine_onsets = false
refine_tracking = false
reference_points = 0
"""


def free_disc(top_hz=4000.0, **values):
    """Coordinates, M, gyroscopic matrix of 1 rad/s, elastic free modes of a coarse disc."""
    mesher = BrakeMesher(MODELS["disc_brake"].defaults() | values, COARSE)
    solid = mesher.component("disc")
    omega, phi = real_modes(solid.M, solid.K, top_hz)
    elastic = omega > 100.0
    G = solid.gyroscopic(ROTOR, "disc")
    return solid.coordinates, solid.M, G, omega[elastic], phi[:, elastic]


@pytest.fixture(scope="module")
def disc():
    return free_disc()


def diameters(coordinates, phi):
    """Nodal diameters of modes, by the largest harmonic of motion along and off the axis."""
    angle = np.arctan2(coordinates[:, 1], coordinates[:, 0])
    radial = phi[0::3] * np.cos(angle)[:, None] + phi[1::3] * np.sin(angle)[:, None]
    waves = np.exp(1j * np.arange(12)[:, None] * angle)
    size = np.abs(waves @ phi[2::3]) ** 2 + np.abs(waves @ radial) ** 2
    return size.argmax(axis=0)


def doublets(omega):
    return [i for i in range(len(omega) - 1) if omega[i + 1] / omega[i] - 1.0 < 1e-5]


def split(disc, rate):
    """Roots, rad/s, of the modes of a free disc at a rate of rotation [rad/s]: imaginary."""
    _, _, G, omega, phi = disc
    n, C = len(omega), rate * (phi.T @ (G @ phi))
    roots = la.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(omega**2), -C]]))
    assert np.abs(roots.real).max() < 1e-9 * omega.max()  # nothing gains or loses
    return np.sort(roots.imag[roots.imag > 0])


def test_doublets_split_to_both_sides_by_the_diameters(disc):
    """Out of plane omega +- n rate within 2 %; modes without diameters stay where they are."""
    coordinates, _, _, omega, phi = disc
    n, rate = diameters(coordinates, phi), 20.0
    roots = split(disc, rate)
    along = (phi[2::3] ** 2).sum(axis=0) > 0.9 * (phi**2).sum(axis=0)
    waves = [i for i in doublets(omega) if along[i]]
    assert {2, 3, 4} <= set(n[waves].tolist())
    for i in waves:
        low, high = roots[i : i + 2]
        assert (high - low) / 2 == pytest.approx(n[i] * rate, rel=0.02)
        assert (high + low) / 2 == pytest.approx(omega[i], rel=1e-4)
    alone = [i for i in np.flatnonzero(n == 0) if along[i]]
    assert alone
    assert roots[alone] == pytest.approx(omega[alone], rel=1e-5)


def test_all_doublets_split_as_coriolis_forces_on_the_disc_have_it(disc):
    """Of axes that turn with the disc: Coriolis forces split, then diameters pass the pads."""
    coordinates, M, G, omega, phi = disc
    across = sp.kron(sp.identity(len(coordinates)), [[0, -1, 0], [1, 0, 0], [0, 0, 0]])  # e x u
    coriolis, seen = 2.0 * phi.T @ (M @ (across @ phi)), phi.T @ (G @ phi)
    n = diameters(coordinates, phi)
    assert len(doublets(omega)) > 4
    for i in doublets(omega):
        expected = 2 * n[i] - abs(coriolis[i, i + 1])
        assert abs(seen[i, i + 1]) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("rate", [pytest.param(4.0, marks=pytest.mark.full_size), 40.0])
def test_three_diameters_near_three_kilohertz(rate):
    """.06 to .6 % to either side at 4 to 40 rad/s."""
    thick = free_disc(3600.0, **{"disc.thickness": 0.024})
    coordinates, _, _, omega, phi = thick
    n = diameters(coordinates, phi)
    (i,) = [i for i in doublets(omega) if n[i] == 3 and omega[i] < 2 * np.pi * 3600.0][:1]
    assert omega[i] / (2 * np.pi) == pytest.approx(3000.0, rel=0.1)
    low, high = split(thick, rate)[i : i + 2]
    expected = 3 * rate / (2 * np.pi * 3000.0)
    assert (high - low) / (2 * omega[i]) == pytest.approx(expected, rel=0.12)
    assert 0.0005 < expected < 0.0065


CONTACT = """\
[[contact]]
between = ["disc", "belt"]
normal = "z"
sliding = "x"
stiffness = 1e7
at = [0.05, 0.13, 0.01]
[[load]]
on = "disc"
direction = "-z"
force = 100
at = [0.05, 0.13, 0.01]
"""


def tilts(coordinates):
    x, y, z = coordinates.T
    o = np.zeros(len(x))
    return np.stack([np.column_stack([o, -z, y]), np.column_stack([z, o, -x])]).reshape(2, -1).T


def test_a_rigid_disc_is_the_lumped_one_that_spins(disc, tmp_path):
    """Two tilts are coupled by the polar inertia, as `spin` of a lumped model has it."""
    coordinates, M, G, _, _ = disc
    turn = np.cross([0.0, 0.0, 1.0], coordinates).ravel()
    polar, R = float(turn @ (M @ turn)), tilts(coordinates)
    path = tmp_path / "disc.toml"
    path.write_text(
        f"""\
[[mass]]
name = "disc"
inertia = {R[:, 0] @ (M @ R[:, 0])}
directions = ["rx", "ry"]
spin = {polar}
"""
        + "".join(
            f"""\
[[spring]]
between = ["disc", "ground"]
direction = "{d}"
stiffness = 1e7
"""
            for d in ("rx", "ry")
        )
        + CONTACT
    )
    lumped = sq.model(str(path)).at().assembly.C.toarray()
    np.testing.assert_allclose(R.T @ (G @ R), lumped, rtol=1e-6, atol=1e-9 * polar)
    shifts = np.tile(np.eye(3), (len(coordinates), 1))
    assert np.abs(G @ shifts).max() < 1e-9 * abs(G).max()  # a moved disc turns as before


# -- meshes of one's own ---------------------------------------------------------------------------
def body_of(mesh):
    mesh, expansion = expanded(mesh)
    return Body("disc", mesh, None, expansion), mesh_mass(mesh)


def mesh_mass(mesh):
    return mass_matrix(mesh)


def test_a_disc_of_a_file_is_the_generated_one(disc):
    """And about a slanted axis elsewhere the tilts across it have the same polar inertia."""
    coordinates, _, G, _, _ = disc
    mesh = brake_meshes(OPTIONS, MODELS["disc_brake"].defaults())["disc"]
    body, mass = body_of(mesh)
    own = turning_matrix(body, mesh, ROTOR, mass)
    assert abs(own + own.T).max() == 0.0
    apart, node = KDTree(mesh.nodes).query(coordinates)
    assert apart.max() < 1e-9
    place = (3 * node[:, None] + np.arange(3)).ravel()
    assert abs(own[place][:, place] - G).max() < 1e-10 * abs(G).max()
    turn, shift = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix(), np.array([0.1, 0.2, -0.3])
    placed = replace(mesh, nodes=mesh.nodes @ turn.T + shift)
    rotors = Rotors(("disc",), shift, turn[:, 2])
    elsewhere = turning_matrix(replace(body, mesh=placed), placed, rotors, mass)
    in_place = sp.kron(sp.identity(len(node)), turn)  # of scalar functions: the same matrix
    assert abs(elsewhere - in_place.T @ own @ in_place).max() < 1e-9 * abs(own).max()


def test_a_disc_that_is_not_symmetric_is_refused():
    mesh = brake_meshes(OPTIONS, MODELS["disc_brake"].defaults())["disc"]
    (block,) = mesh.blocks
    middle = mesh.nodes[block.nodes].mean(axis=1)
    x, y, _ = middle.T
    hole = (np.hypot(x - 0.1, y) < 0.02) & (np.hypot(x, y) > 0.08)
    assert hole.any()
    keep = np.flatnonzero(~hole)
    pierced = replace(
        mesh,
        blocks=(replace(block, nodes=block.nodes[keep], labels=block.labels[keep]),),
        material=mesh.material[keep],
        orientation=mesh.orientation[keep],
        added_density=mesh.added_density[keep],
        surfaces={},
        element_sets={},
    )
    body = Body("disc", pierced, None, expanded(mesh)[1])
    with pytest.raises(ModelError, match=r"disc is not symmetric about its axis .* mm a face") as e:
        turning_matrix(body, pierced, ROTOR, mesh_mass(pierced))
    assert "across the rotation" in str(e.value)
    heavier = mesh_mass(mesh)
    heavier = heavier + sp.diags(np.r_[0.01, np.zeros(heavier.shape[0] - 1)])
    with pytest.raises(ModelError, match="carries masses beside its elements"):
        turning_matrix(Body("disc", mesh, None, expanded(mesh)[1]), mesh, ROTOR, heavier)
    matrices = (heavier, heavier, None)
    with pytest.raises(ModelError, match="given by matrices"):
        turning_matrix(Body("disc", mesh, matrices, expanded(mesh)[1]), mesh, ROTOR, heavier)


def test_a_pad_is_no_disc():
    mesher = BrakeMesher(MODELS["disc_brake"].defaults(), COARSE)
    with pytest.raises(ModelError, match="inner_pad is not symmetric"):
        mesher.component("inner_pad").gyroscopic(ROTOR, "inner_pad")


# -- the brake -------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def small_brake(tiny_brake, assembled_once):
    return sq.model("disc_brake", mesh="coarse", contact_points=2)


BAND = (500.0, 4000.0)


def test_a_model_without_a_disc_says_so(small_brake):
    with pytest.raises(ParameterError, match="gyroscopic_factor"):
        sq.model("hoffmann").at(**ON)
    assembly = small_brake.at().assembly
    assert assembly.assembled.turning is not None
    assert abs(assembly.C).max() == 0.0
    turning = small_brake.at(sliding_speed=0.7, **ON).assembly.C
    assert abs(turning + turning.T).max() <= 1e-15 * abs(turning).max()
    reverse = small_brake.at(sliding_speed=-0.7, **ON).assembly.C
    assert abs(turning + reverse).max() == 0.0


def test_rates_are_those_of_the_mean_radius(small_brake):
    radius = 2 / 3 * (0.14**3 - 0.09**3) / (0.14**2 - 0.09**2)
    assembly = build_model("disc_brake", OPTIONS)
    assert assembly.rotors.radius == pytest.approx(radius)
    page = (Path(__file__).parents[2] / "docs" / "howto" / "turning-disc.md").read_text("utf-8")
    assert "`(2/3)(b^3-a^3)/(b^2-a^2)`" in page
    assert f"{radius:.4f} m by" in page
    (disc,) = (c for c in assembly.components if c.name == "disc")
    span, expected = assembly.slices["disc"], 0.7 / radius * disc.turning
    turning = small_brake.at(sliding_speed=0.7, **ON).assembly.C
    assert abs(turning[span, span] - expected).max() < 1e-12 * abs(expected).max()
    assert turning.nnz == disc.turning.nnz


def test_a_conservative_brake_neither_gains_nor_loses(small_brake):
    """Without friction and damping roots are imaginary, and a run keeps its energy."""
    still = small_brake.with_(
        friction=0.0, damping_ratio=0.0, stiffness_damping=0.0, contact_law="bilateral", **ON
    )
    system = still.at(sliding_speed=5.0)
    modes, without = system.modes(BAND), still.at(sliding_speed=5.0, **OFF).modes(BAND)
    assert np.abs(modes.growth_rate).max() < 1e-6
    moved = np.abs(modes.frequency_hz - without.frequency_hz) / without.frequency_hz
    assert 1e-6 < moved.max() < 0.01
    effect = turning_effect(
        system.reduced(BAND).prepared,
        still.at(sliding_speed=5.0, **OFF).point.state(),
        without.lam,
        BAND,
        NEUTRAL,
    )
    assert effect.decided == 0, "signs of round-off decide nothing"
    ((reference, start, _, _),) = set_up(system._in_time(BAND), "regularised", single=True)
    assert np.abs(start.damping_between + start.damping_between.T).max() < 1e-9
    for method, within in (("newmark", 1e-6), ("exponential", 1e-4)):
        settings = MotionSettings(1e-3, 1e-6, 10, integrator=integrator(method))
        pushed = perturbed(reference.system, start, 0.01, modes=range(8, 20))
        (run,) = simulate(reference.system, [pushed], settings)
        assert run.outcome == "ok"
        assert run.energy.stored_end == pytest.approx(run.energy.stored_start, rel=within)


def test_the_effect_told_beside_the_check_at_full_order(small_brake):
    """Against modes with and without; from either side."""
    values = {"sliding_speed": 5.0, "friction": 0.6, "damping_ratio": 0.002}
    off, on = (small_brake.at(**values, **x) for x in (OFF, ON))
    prepared = off.reduced(BAND).prepared
    off_lam, on_lam = off.modes(BAND).lam, on.modes(BAND).lam
    light = off_lam[np.abs(off_lam.real) < 0.05 * np.abs(off_lam)]
    partners = on_lam[np.abs(on_lam[None] - light[:, None]).argmin(axis=1)]
    effect = turning_effect(prepared, off.point.state(), off_lam, BAND, NEUTRAL)
    assert effect.growth == pytest.approx(np.abs((partners - light).real).max(), rel=1e-6)
    moved = np.abs(np.abs(partners) / np.abs(light) - 1.0).max()
    assert effect.frequency == pytest.approx(moved, rel=1e-6)
    decided = (partners.real > 0) != (light.real > 0)
    assert effect.decided == decided.sum() > 0
    assert effect.decided_growth == pytest.approx(np.abs((partners - light).real)[decided].max())
    assert effect.decided_growth < 0.9 * effect.growth, "another mode changes more"
    back = turning_effect(prepared, on.point.state(), on_lam, BAND, NEUTRAL)
    assert back.growth == pytest.approx(effect.growth, rel=0.1)
    assert effect.decided == back.decided


def test_what_has_none_says_so(small_brake, tmp_path):
    """A rotor that is no disc, another representation."""
    write_blocks(tmp_path)
    with pytest.raises(ParameterError, match="is not symmetric about its axis of rotation"):
        sq.model(str(tmp_path / "blocks.toml")).at(**ON).modes((1.0, 1e5))
    assembly = small_brake.at().assembly.assembled
    with pytest.raises(ModelError, match="hybrid representation has no gyroscopic terms"):
        hybrid_model(assembly, None, replace(NOMINAL, gyroscopic=1.0), None)


def test_terms_that_are_left_out_are_told_where_nothing_is_checked(small_brake, tmp_path):
    """By roots with and without the terms at the points of the design, none at full order."""
    with tiny_meshes(tiny_cache()):
        results = solved(TURNING_STUDY, tmp_path)
        changes = []
        for friction in results.points["friction"]:
            values = {"friction": friction, "sliding_speed": 5.0, "damping_ratio": 0.002}
            off, on = (small_brake.at(**values, **x).modes(BAND).lam for x in (OFF, ON))
            light = off[np.abs(off.real) < 0.05 * np.abs(off)]
            partners = on[np.abs(on[None] - light[:, None]).argmin(axis=1)]
            decided = (partners.real > 0) != (light.real > 0)
            changes.append(np.abs((partners - light).real[decided]).max(initial=0.0))
    facts, n_decided = results.manifest["turning"], np.count_nonzero(changes)
    assert (facts["looked"], facts["decided_points"]) == (len(changes), n_decided)
    assert 0 < n_decided < len(changes)
    assert facts["decided_growth"] == pytest.approx(max(changes), rel=1e-3)
    ((name, text),) = turning_rows(results.manifest)
    assert name == "gyroscopic"
    assert f"at {n_decided} of {len(changes)} design points" in text
    assert f"by up to {max(changes):.1f} 1/s (gyroscopic_factor = 1 has them)" in text
    assert text in " ".join(as_text(blocks(results, [])).split())


def test_terms_that_decide_nothing_or_are_there_are_not_told():
    told = {"looked": 5, "decided_points": 0, "decided_growth": 0.0}
    assert turning_rows({"turning": told}) == turning_rows({}) == turning_rows({"turning": None})


@pytest.mark.parametrize(
    "name",
    [
        "gyroscopic_factor",
        pytest.param("sliding_speed", marks=pytest.mark.full_size),
        pytest.param("disc.density", marks=pytest.mark.full_size),
    ],
)
def test_derivatives_are_those_of_finite_differences(name, small_brake):
    values = {"sliding_speed": 2.0, "gyroscopic_factor": 0.5, "disc.density": 7200.0}
    system = small_brake.at(**values)
    found = system.sensitivities(name, modes=3, band=BAND)
    h = 1e-4 * values[name]
    roots = [small_brake.at(**values | {name: values[name] + s}).modes(BAND).lam for s in (h, -h)]
    for lam, slope in zip(found.lam, found.derivative[:, 0], strict=True):
        ends = [at[np.abs(at - lam).argmin()] for at in roots]
        assert slope == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-3)
