"""Where growth comes from: each part against unreduced matrices, the sum of every mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import NOMINAL, TOP
from own_blocks import STUDY, write_blocks
from study_runs import command, plan_of
from study_texts import study_text, sweep_text

from squealstudy import open_results, read_study, run
from squealstudy.engine.runner import run_study
from squealstudy.laws import friction_curve
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import band_modes, linearised_point
from squealstudy.reduction.cmt import Expansion
from squealstudy.shapes.shape import INTERFACES, Label, shape_of
from squealstudy.shapes.sources import (
    ACROSS,
    ALONG,
    ASSEMBLY,
    COMPONENT,
    CONTACT,
    COUPLING,
    FRICTION,
    LAYER,
)

FALLING = friction_curve("exponential_fall", static_ratio=1.5, decay_speed=0.4)
BETA, ZETA = 1.5e-7, 0.003
STATE = DesignState(
    replace(NOMINAL, friction=0.6, curve=FALLING, sliding_speed=-0.3),
    frequency_scale={("caliper", 7): 1.05},
    mode_damping={("disc", 9): 0.02, ("caliper", 7): 0.01},
    damping_ratio=ZETA,
    assembly_damping={5: 0.02},
    stiffness_damping=BETA,
)


@pytest.fixture(scope="module")
def solved(brake, reduced, prepared):
    """Working point, system and shapes of all modes of a point with every kind of friction."""
    model, basis = reduced
    point, system = linearised_point(prepared, STATE)
    lam, psi, *_ = band_modes(system, point, (500.0, TOP))
    expansion = Expansion(model, basis.blocks)
    told = [i for i in range(len(lam)) if lam[i].imag]
    shapes = [
        shape_of(brake.assembly, expansion, point, system, lam[i], psi[:, i], Label()) for i in told
    ]
    return point, system, shapes


def expect_balance(shape):
    """Parts add up to the growth rate, to 1e-6 of it or 1e-9 of the largest part."""
    parts = np.array([s.growth_rate for s in shape.sources])
    largest = np.abs(parts).max()
    assert parts.sum() == pytest.approx(shape.growth_rate, rel=1e-6, abs=1e-9 * largest)
    assert sum(shape.growth_from.values()) == pytest.approx(parts.sum(), abs=1e-12 * largest)
    friction = sum(s.growth_rate for s in shape.sources if s.of_friction)
    assert shape.contact.growth.sum() == pytest.approx(friction, abs=1e-9 * largest)
    assert shape.contact.power.sum() == pytest.approx(
        sum(s.power for s in shape.sources if s.of_friction), rel=1e-9
    )


def test_parts_add_up_for_every_mode(solved):
    shapes = solved[-1]
    assert len(shapes) > 20
    for shape in shapes:
        expect_balance(shape)
    kinds = {s.kind for shape in shapes for s in shape.sources}
    assert kinds == {*FRICTION, COMPONENT, LAYER, CONTACT, ASSEMBLY}
    for shape in shapes:
        assert all(s.growth_rate < 0 for s in shape.sources if not s.of_friction)
        assert all(s.growth_rate < 0 for s in shape.sources if s.kind == ACROSS)
        assert all(s.growth_rate > 0 for s in shape.sources if s.kind == ALONG)


def test_each_part_is_that_of_the_unreduced_matrices(brake, solved):
    """Weights of friction by hand, of a curve that falls, in reverse; power by mean F v."""
    point, _, shapes = solved
    assembly, contact = brake.assembly, brake.assembly.contact
    p, k_n = point.contact_pressure, contact.area * point.tangent
    v = 0.3
    mu = 0.6 * (1 + 0.5 * np.exp(-v / 0.4))
    slope = -0.6 * 0.5 / 0.4 * np.exp(-v / 0.4)
    for shape in shapes[::4]:
        u, omega = shape.displacement.ravel(), shape.lam.imag
        mass = 2 * omega * np.vdot(u, assembly.M @ u).real
        N, T, T_perp = (A @ u for A in (contact.N, contact.T, contact.T_perp))
        by_hand = {
            # traction on the slave is -mu p w/|w|; sliding is against T, so that it is +mu p
            COUPLING: -(mu * k_n * (T.conj() * N).imag),
            ALONG: omega * (contact.area * p * -slope * np.abs(T) ** 2),
            ACROSS: -omega * contact.area * p * mu / v * np.abs(T_perp) ** 2,
        }
        for kind, of_points in by_hand.items():
            for pair in set(contact.pairs):
                here = np.array(contact.pairs) == pair
                found = _one(shape, kind, pair)
                expected = of_points[here].sum() / mass
                assert found.growth_rate == pytest.approx(expected, rel=1e-5), (kind, pair)
                assert found.power == pytest.approx(omega * of_points[here].sum() / 2, rel=1e-5)
        for spring in assembly.springs:
            taken = BETA * np.vdot(u, spring.matrix() @ u).real
            assert _one(shape, LAYER, spring.name).growth_rate == pytest.approx(
                -omega * taken / mass, rel=1e-5
            )
        for component in assembly.components:
            own = u[assembly.slices[component.name]]
            taken = BETA * np.vdot(own, component.K @ own).real
            found = _one(shape, COMPONENT, component.name).growth_rate
            if component.name in ("disc", "caliper"):  # with dampers of component modes
                assert found <= -omega * taken / mass * (1 - 1e-6)
            else:
                assert found == pytest.approx(-omega * taken / mass, rel=1e-5)


def _one(shape, kind, where):
    return next(s for s in shape.sources if (s.kind, s.where) == (kind, where))


def test_interfaces_hold_what_is_not_in_components(solved):
    for shape in solved[-1]:
        assert sum(shape.interfaces.values()) == pytest.approx(shape.energies[INTERFACES], abs=1e-9)
        assert min(shape.interfaces.values()) >= 0


def test_a_brake_of_ones_own(tmp_path):
    """Layers and springs of a model file under their names; parts of every mode of two points."""
    study = STUDY + "\n[parameters]\nstiffness_damping = 1e-7\ndamping_ratio = 0.002\n"
    path = write_blocks(tmp_path / "blocks", study=study)
    run(read_study(path), tmp_path / "results")
    results = open_results(tmp_path / "results")
    seen = set()
    for row, point_id in enumerate(results.points["point_id"]):
        own = results.modes[(results.modes["point_id"] == point_id) & ~results.modes["overdamped"]]
        for mode in own["mode"]:
            shape = results.shape(row, int(mode))
            expect_balance(shape)
            seen |= {(s.kind, s.where) for s in shape.sources}
            assert {name for _, name in shape.interfaces} == {
                "bed",
                "guides",
                *shape.contact.pairs,
            }
    assert {(LAYER, "bed"), (LAYER, "guides"), (COMPONENT, "plate"), (COMPONENT, "slider")} <= seen


def test_modes_that_falling_friction_feeds_have_not_locked_in(tmp_path, capsys):
    """Both roots grow, at frequencies far apart: friction that falls mixes the two real modes."""
    text = study_text("fall", "complex_modes", "hoffmann")
    text += "[parameters]\nfriction = 0.05\nnormal_force = 1000.0\nsliding_speed = 0.05\n"
    text += '"friction_law.static_ratio" = 5.0\n"friction_law.decay_speed" = 0.1\n'
    text += sweep_text("damping_ratio", 0.0, 0.001, 2) + "[modes]\nband = [1.0, 2000.0]\n"
    run_study(plan_of(text), tmp_path / "r", jobs=1)
    results = open_results(tmp_path / "r")
    frequencies = results.modes["frequency_hz"].to_numpy()[:2]
    assert np.ptp(frequencies) > 0.1 * frequencies.mean()
    assert results.modes["unstable"].all()
    assert command("rank", str(tmp_path / "r"), "--why") == 0
    told = capsys.readouterr().out
    assert told.count("made of") == 2
    assert "locked in" not in told


SHARED = """
mass = [
    {name = "pad", mass = 1.2, directions = ["x", "y"]},
    {name = "caliper", mass = 6.0, directions = ["x", "y"]},
]
spring = [
    {between = ["pad", "caliper"], direction = "x", stiffness = "k"},
    {between = ["pad", "caliper"], direction = "y", stiffness = "1.3 * k"},
    {between = ["caliper", "ground"], direction = [1, 0.5], stiffness = "0.2 * k"},
    {between = ["caliper", "ground"], direction = [-0.3, 1], stiffness = "0.4 * k"},
]
damper = [{between = ["pad", "caliper"], direction = "x", damping = "c"}]
contact = [
    {between = ["pad", "disc"], normal = "y", sliding = "-x", stiffness = 1e7},
]
load = [{on = "pad", direction = "-y", force = 1500.0}]
[parameters]
friction = 0.9
sliding_speed = 1.0
"friction_law.decay_speed" = 0.4
k = {default = 8e6, unit = "N/m"}
c = {default = 20.0, unit = "N s/m"}
"""


def test_modes_that_share_their_motion_have_not_locked_in_where_damping_alone_makes_them_grow(
    tmp_path, capsys
):
    """Friction mixes two real modes far apart in one phase; without damping nothing grows."""
    (tmp_path / "shared.toml").write_text(SHARED)
    head = study_text("mixed", "complex_modes", "lumped")
    head = head.replace('name = "lumped"', 'file = "shared.toml"')
    band = "[modes]\nband = [1.0, 2000.0]\nreference_points = 0\n"
    damping = sweep_text("friction_law.static_ratio", 1.4, 1.5, 2) + sweep_text("c", 10.0, 20.0, 2)
    n_unstable = []
    for name, sweeps in (("damped", damping), ("bare", sweep_text("c", 0.0, 0.0, 1))):
        study = tmp_path / f"{name}.toml"
        study.write_text(head.replace("mixed", name) + sweeps + band)
        run_study(read_study(study).plan(), tmp_path / name, jobs=1)
        n_unstable.append(int(open_results(tmp_path / name).points["n_unstable"].max()))
    assert n_unstable[0] > n_unstable[1] == 0
    assert command("rank", str(tmp_path / "damped"), "--why") == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "deg out of phase" in told
    assert "locked in" not in told
