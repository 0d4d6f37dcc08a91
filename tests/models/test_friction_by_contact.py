"""A friction coefficient of its own for each contact, as a factor on the study's."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from own_blocks import write_blocks
from study_runs import plan_of

import squealstudy as sq
from squealstudy.engine.export import export_reduced
from squealstudy.errors import StudyFileError
from squealstudy.models.catalogue import MODELS
from squealstudy.motion.point import automatic_slope
from squealstudy.study.components import read_model
from squealstudy.study.lumped import read_lumped

# a block between two discs that press on it from both sides, held by springs
BETWEEN = """\
[[mass]]
name = "block"
mass = 2.0
directions = ["x", "y"]

[[spring]]
between = ["block", "ground"]
direction = [1, 0.5]
stiffness = 2e5

[[spring]]
between = ["block", "ground"]
direction = [0.3, -1]
stiffness = 3e5

[[contact]]
name = "upper"
between = ["block", "disc"]
normal = "-y"
sliding = "x"
stiffness = 4e5
gap = -5e-4
friction_factor = "upper"

[[contact]]
name = "lower"
between = ["block", "disc"]
normal = "y"
sliding = "-x"
stiffness = 1e5
gap = -8e-4
speed_factor = 2.0
friction_factor = "1.5 * lower"

[parameters]
friction = 0.4
sliding_speed = 0.7
"friction_law.static_ratio" = 1.4
"friction_law.decay_speed" = 0.8
upper = 1.0
lower = 1.0
"""


def write(folder, text=BETWEEN):
    path = folder / "between.toml"
    path.write_text(text)
    return path


def matrices(upper, lower):
    """M, C, K by hand, and the forces of contact; friction falls with the speed."""

    def mu(v):
        return 0.4 * (1 + 0.4 * np.exp(-v / 0.8))

    def slope(v):
        return -0.4 * 0.4 / 0.8 * np.exp(-v / 0.8)

    K = np.zeros((2, 2))
    for d, k in (((1, 0.5), 2e5), ((0.3, -1), 3e5)):
        d = np.array(d) / np.linalg.norm(d)
        K += k * np.outer(d, d)
    C, f, contacts = np.zeros((2, 2)), np.zeros(2), []
    for n, s, k, gap, v, factor in (
        ((0, -1), (1, 0), 4e5, -5e-4, 0.7, upper),
        ((0, 1), (-1, 0), 1e5, -8e-4, 1.4, 1.5 * lower),
    ):
        n, s = np.array(n, float), np.array(s, float)
        pushed = n + factor * mu(v) * s
        K += k * np.outer(pushed, n)
        f -= k * gap * pushed
        contacts.append((n, s, k, gap, v, factor))
    u = np.linalg.solve(K, f)
    forces = []
    for n, s, k, gap, v, factor in contacts:
        forces.append(-k * (n @ u + gap))
        C += factor * slope(v) * forces[-1] * np.outer(s, s)
    return 2.0 * np.eye(2), C, K, np.array(forces)


def by_frequency(lam):
    return lam[np.argsort(lam.imag)]


def roots(M, C, K):
    zero = np.zeros_like(K)
    A = np.block([[zero, np.eye(len(K))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    lam = np.linalg.eigvals(A)
    return by_frequency(lam[lam.imag > 1.0])


@pytest.mark.parametrize(("upper", "lower"), [(1.0, 1.0), (0.5, 1.2), (0.0, 2.0), (2.5, 0.0)])
def test_roots_are_those_of_matrices_put_together_by_hand(tmp_path, upper, lower):
    M, C, K, forces = matrices(upper, lower)
    assert (forces > 0).all()
    system = sq.model(str(write(tmp_path))).at(upper=upper, lower=lower)
    assert system.steady.force[:, 0] == pytest.approx(forces, rel=1e-12)
    found = by_frequency(system.modes((1.0, 1000.0)).lam)
    assert found == pytest.approx(roots(M, C, K), rel=1e-11)


def test_factors_are_swept_as_a_batch(tmp_path):
    """Each row of a batch is what its point is alone."""
    model = sq.model(str(write(tmp_path)))
    upper, lower = np.array([0.3, 1.0, 2.0, 0.0]), np.array([1.0, 0.4, 0.0, 0.0])
    batch = model.at(upper=upper, lower=lower).modes((1.0, 1000.0))
    for k, pair in enumerate(zip(upper, lower, strict=True)):
        lam = by_frequency(batch.lam[k][np.isfinite(batch.lam[k])])
        assert lam == pytest.approx(roots(*matrices(*pair)[:3]), rel=1e-11)


@pytest.mark.parametrize("upper", [0.7, 0.0])
def test_derivatives_by_a_factor_are_those_of_matrices_by_hand(tmp_path, upper):
    """Steady sliding moves with it, too; alone, and as a batch."""
    model, h = sq.model(str(write(tmp_path))), 1e-5
    asked = {"modes": 2, "band": (1.0, 1000.0)}
    ends = [matrices(*x)[:3] for x in ((upper + h, 1.2), (upper, 1.2 + h), (upper, 1.2))]
    lam = [roots(*x) for x in ends]
    expected = np.transpose([(moved - lam[2]) / h for moved in lam[:2]])
    batch = model.at(upper=[upper, 0.9], lower=1.2).sensitivities("upper", "lower", **asked)
    for found in (
        model.at(upper=upper, lower=1.2).sensitivities("upper", "lower", **asked),
        batch[0],
    ):
        order = np.argsort(found.lam.imag)
        np.testing.assert_allclose(found.derivative[order], expected, rtol=1e-3)


def test_a_factor_that_no_dry_contact_has_is_doubted(tmp_path):
    """A friction of 0.4 at rest times 1.4, and times the largest factor."""
    definition = read_lumped(write(tmp_path))
    friction, _ = definition.assumptions
    for upper, lower in ((3.0, 1.0), (1.0, 2.0), (5.0, 1.0)):
        values = definition.defaults() | {"upper": upper, "lower": lower}
        (most,) = friction.values(values, 1)
        assert most == pytest.approx(0.4 * 1.4 * max(upper, 1.5 * lower), rel=1e-12)
    swept = definition.defaults() | {"upper": np.array([3.0, 5.0])}
    assert (friction.values(swept, 2) > friction.most).tolist() == [False, True]


def test_the_pad_of_a_brake_with_more_friction_is_doubted():
    brake = MODELS["disc_brake"]
    friction, values = brake.assumptions[0], brake.defaults() | {"friction": 0.5}
    for factor, most in ((0.1, 0.5), (5.0, 2.5)):
        given = values | {"inner_pad.friction_factor": factor}
        assert friction.values(given, 1) == pytest.approx([most])


def test_the_contact_of_a_model_file_with_more_friction_is_doubted(tmp_path):
    """Of a number, and of a parameter that is swept."""
    write_blocks(tmp_path, ("search = 0.1", 'search = 0.1\nname = "face"\nfriction_factor = 3.0'))
    path = tmp_path / "blocks.toml"
    friction, *_ = read_model(path).assumptions
    values = read_model(path).defaults() | {"friction": 0.5}
    assert friction.values(values, 1) == pytest.approx([1.5])
    path.write_text(path.read_text() + '[parameters.rub]\npath = "contact.face.friction_factor"\n')
    model = read_model(path)
    swept = values | {"rub": np.array([0.5, 3.0, 5.0])}
    assert model.assumptions[0].values(swept, 3) == pytest.approx([0.25, 1.5, 2.5])


def test_half_the_factor_is_half_the_friction_in_time(tmp_path):
    """Run for run: a factor of 1/2 on a friction of 0.8 is a friction of 0.4."""
    plain = BETWEEN.replace('"1.5 * lower"', '"lower"')
    model = sq.model(str(write(tmp_path, plain)), damping_ratio=0.001)
    run = {"duration": 0.3, "step": 2e-5, "perturbation": 1e-3}
    whole = model.at(friction=0.4).simulate(**run).summary().iloc[0]
    half = model.at(friction=0.8, upper=0.5, lower=0.5).simulate(**run).summary().iloc[0]
    names = ["torque_mean", "torque_rms", "normal_force_mean", "stick_share", "energy_balance"]
    for name in [n for n in names if n in whole.index]:
        assert half[name] == pytest.approx(whole[name], rel=1e-6, abs=1e-12), name
    assert whole["torque_rms"] > 0


def test_the_automatic_slope_is_that_of_the_point_with_most_friction(tmp_path):
    """Its friction at rest is the factor times the static coefficient, 0.4 times 1.4."""
    system = sq.model(str(write(tmp_path))).at(upper=0.2, lower=0.9)
    pressure = system.steady.pressure
    state = SimpleNamespace(operating=system.point.operating_point())
    point = SimpleNamespace(contact_pressure=pressure)
    slope = automatic_slope(system.assembly.contact, state, point, 1e-3)
    most = (np.array([0.2, 1.5 * 0.9]) * 0.4 * 1.4 * pressure).max()
    assert slope == pytest.approx(most / 1e-3, rel=1e-12)


def test_a_force_of_contact_is_no_share_of_it(tmp_path):
    """The mean normal force in time is that of steady sliding, whatever the factors are."""
    model = sq.model(str(write(tmp_path)), damping_ratio=0.02)
    system = model.at(upper=0.2, lower=0.1)
    runs = system.simulate(duration=0.05, step=2e-5, perturbation=1e-6)
    force = runs.history("normal_force")
    assert force[-1] == pytest.approx(matrices(0.2, 0.1)[3].sum(), rel=1e-3)


@pytest.fixture(scope="module")
def reduced_brake(tmp_path_factory, tiny_brake):
    """Export of the smallest brake: friction .5, the inner pad with 0.4 of it, the outer 1.3."""
    folder = tmp_path_factory.mktemp("export")
    text = """\
[study]
name = "pads"
kind = "complex_modes"
[model]
name = "disc_brake"
mesh = "coarse"
contact_points = 2
[parameters]
friction = 0.5
"inner_pad.friction_factor" = 0.4
"outer_pad.friction_factor" = 1.3
[[sweep]]
parameter = "friction"
values = [0.5]
[modes]
band = [500.0, 4000.0]
"""
    paths = export_reduced(plan_of(text), folder)
    return np.load(paths[0])


def test_pads_of_a_brake_have_friction_of_their_own(reduced_brake):
    """What is unsymmetric in K is friction alone: N and T of each pad, put together by hand."""
    e = reduced_brake
    half = len(e["area"]) // 2
    mu = 0.5 * np.repeat([0.4, 1.3], [half, len(e["area"]) - half])
    assert e["friction_coefficient"] == pytest.approx(mu, rel=1e-12)
    stiffness = e["area"] * e["tangent"] if e["tangent"].max() > 1e9 else e["tangent"]
    coupling = -e["T"].T @ ((mu * stiffness)[:, None] * e["N"])
    K = e["K"]
    friction = coupling - coupling.T
    np.testing.assert_allclose(K - K.T, friction, atol=1e-9 * np.abs(K).max())
    assert np.abs(friction).max() > 1e-3 * np.abs(K).max()


BAD = [
    ('"1.5 * lower"', '"lower - 2"', "friction_factor", "at least 0, got -1 of 'lower - 2'"),
    ('sliding = "x"\n', "friction = false\n", "friction_factor", "no such key"),
    ('"1.5 * lower"', '"lower * uper"', "friction_factor", "no parameter 'uper'"),
]


@pytest.mark.parametrize(("old", "new", "key", "words"), BAD)
def test_bad_factors_are_one_sentence(tmp_path, old, new, key, words):
    path = write(tmp_path, BETWEEN.replace(old, new, 1))
    with pytest.raises(StudyFileError) as told:
        read_lumped(path)
    assert words in str(told.value)
    assert key in str(told.value)
