"""Contacts with friction, a friction law and a state of their own, against judges."""

from __future__ import annotations

import numpy as np
import pytest
from lumped_files import HULTEN
from own_blocks import write_blocks
from scipy.integrate import solve_ivp
from study_runs import command

import squealstudy as sq
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.study.lumped import read_lumped

PER_AREA = 5e11  # Pa/m, of contact.stiffness by default

BLOCK = """\
[[mass]]
name = "block"
mass = 2.0
directions = ["x", "y"]
[[spring]]
between = ["block", "ground"]
direction = [0.8, 0.6]
stiffness = 3e5
[[contact]]
name = "bracket"
between = ["block", "ground"]
normal = "y"
sliding = "x"
stiffness = 1e6
friction = "mu_bracket"
state = "bracket_state"
tangential = "k_t"
[[load]]
on = "block"
direction = "-y"
force = 100
[parameters]
mu_bracket = 0.3
bracket_state = 1
k_t = { default = 4e5, unit = "N/m" }
"""

# two pads on a disc, each with a law of its own, and a pin between one and the other or the ground
THREE = """\
[[mass]]
name = "a"
mass = 1.3
directions = ["x", "y"]
[[mass]]
name = "b"
mass = 2.1
directions = ["x", "y"]
[[spring]]
between = ["a", "b"]
direction = [1, 0.6]
stiffness = "k_ab"
[[spring]]
between = ["a", "ground"]
direction = "x"
stiffness = 3e5
[[spring]]
between = ["b", "ground"]
direction = "x"
stiffness = 2e5
[[damper]]
between = ["a", "ground"]
direction = "x"
damping = 20
[[contact]]
name = "one"
between = ["a", "disc"]
normal = "y"
sliding = "-x"
stiffness = 4e5
friction = "mu_one"
friction_law = { static_ratio = 1.6, decay_speed = "v_one" }
speed_factor = 1.2
[[contact]]
name = "two"
between = ["b", "disc"]
normal = "y"
sliding = "-x"
stiffness = 3e5
friction_factor = 0.8
friction_law = { decay_speed = 0.1 }
[[contact]]
name = "pin"
between = ["a", "ground"]
normal = "x"
sliding = "SIGNy"
stiffness = 7e5
friction = "mu_pin"
state = "pin"
tangential = "k_t"
[[load]]
on = "a"
direction = [-1, -1]
force = 1000
[[load]]
on = "b"
direction = "-y"
force = 600
[parameters]
friction = 0.35
sliding_speed = 0.25
"friction_law.static_ratio" = 1.4
"friction_law.decay_speed" = 0.3
k_ab = { default = 2e5, unit = "N/m" }
mu_one = 0.45
v_one = { default = 0.2, unit = "m/s" }
mu_pin = 0.2
pin = "stuck"
k_t = { default = 5e5, unit = "N/m" }
""".replace('pin = "stuck"', "pin = 1")


class Three:
    """M, C and K of the three contacts by hand."""

    M = np.diag([1.3, 1.3, 2.1, 2.1])
    N = np.array([[0.0, 1, 0, 0], [0, 0, 0, 1], [1, 0, 0, 0]])
    k = np.array([4e5, 3e5, 7e5])
    f = 1000.0 / np.hypot(1, 1) * np.array([-1.0, -1, 0, 0]) + np.array([0, 0, 0, -600.0])

    def __init__(self, sign=1.0, speed=0.25, mu_one=0.45, v_one=0.2, mu_pin=0.2, k_t=5e5, k_ab=2e5):
        self.T = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -sign, 0, 0]])
        self.speed, self.mu_one, self.v_one = speed, mu_one, v_one
        self.mu_pin, self.k_t = mu_pin, k_t
        row = np.array([1, 0.6, -1, -0.6]) / np.hypot(1, 0.6)
        self.K = np.diag([3e5, 0, 2e5, 0]) + k_ab * np.outer(row, row)
        self.C = np.diag([20.0, 0, 0, 0])

    def mu(self, s):
        """Coefficients at speeds of the three, and their slopes by it."""
        excess = self.mu_one * 0.6 * np.exp(-s[0] / self.v_one)
        other = 0.8 * 0.35 * 0.4 * np.exp(-s[1] / 0.1)
        mu = np.array([self.mu_one + excess, 0.8 * 0.35 + other, self.mu_pin])
        return mu, np.array([-excess / self.v_one, -other / 0.1, 0.0])

    def roots(self, stuck):
        """Eigenvalues above the real axis."""
        mu, slope = self.mu(abs(self.speed) * np.array([1.2, 1.0, 1.0]))
        mu = mu * [np.sign(self.speed), np.sign(self.speed), 0.0 if stuck else 1.0]
        K = self.K + self.N.T @ ((self.k[:, None]) * self.N)
        K = K - self.T.T @ ((mu * self.k)[:, None] * self.N)
        pressing = -self.k * (self.N @ np.linalg.solve(K, self.f))
        assert (pressing > 0).all()
        C = self.C + self.T.T @ ((pressing * slope)[:, None] * self.T)
        if stuck:
            K = K + self.k_t * np.outer(self.T[2], self.T[2])
        rows = [-np.linalg.solve(self.M, A) for A in (K, C)]
        lam = np.linalg.eigvals(np.block([[np.zeros((4, 4)), np.eye(4)], rows]))
        return by_frequency(lam[lam.imag > 0])


def by_frequency(lam):
    return lam[np.argsort(lam.imag)]


def model_of(tmp_path, text, **values):
    path = tmp_path / "own.toml"
    path.write_text(text)
    return sq.model(str(path), **values)


def three(tmp_path, sign="", **values):
    return model_of(tmp_path, THREE.replace("SIGN", sign), **values)


@pytest.mark.parametrize("sliding", ["x", "-x"])
def test_a_block_between_two_springs_by_hand(tmp_path, sliding):
    """Stuck the tangential stiffness acts; sliding the normal force couples by the sign of slip."""
    model = model_of(tmp_path, BLOCK.replace('sliding = "x"', f'sliding = "{sliding}"'))
    mu = np.linspace(0.0, 0.5, 5)
    xx, xy, yy = 3e5 * 0.64, 3e5 * 0.48, 3e5 * 0.36 + 1e6
    for state, tangential, coupled in ((1, 4e5, 0.0 * mu), (0, 0.0, mu)):
        # friction pulls the block along `sliding`: against T, by which the ground slides past it
        pull = coupled * 1e6 * (1.0 if sliding == "x" else -1.0)
        trace, det = xx + tangential + yy, (xx + tangential) * yy - xy * (xy + pull)
        w2 = np.stack([trace - np.sqrt(trace**2 - 4 * det), trace + np.sqrt(trace**2 - 4 * det)])
        expected = np.sqrt(w2.T / 2 / 2.0)
        modes = model.at(mu_bracket=mu, bracket_state=state).modes()
        found = np.sort(modes.lam.imag, axis=1)
        assert found == pytest.approx(expected, rel=1e-9), state
        one = model.at(mu_bracket=mu[2], bracket_state=state).modes()
        assert np.sort(one.lam.imag) == pytest.approx(expected[2], rel=1e-9), state


@pytest.mark.parametrize("sign", ["", "-"])
def test_contacts_of_unlike_laws_by_hand(tmp_path, sign):
    """Slopes of each law in its damping, states and directions; a batch, and one by one."""
    model, side = three(tmp_path, sign), -1.0 if sign else 1.0
    points = [
        {"sliding_speed": v, "mu_pin": mu, "pin": state, "v_one": v_one}
        for v, mu, state, v_one in ((0.25, 0.2, 1, 0.2), (0.1, 0.4, 0, 0.5), (-0.25, 0.3, 0, 0.2))
    ]
    columns = {name: np.array([point[name] for point in points]) for name in points[0]}
    batch = model.at(**columns).modes()
    for i, point in enumerate(points):
        judge = Three(side, point["sliding_speed"], v_one=point["v_one"], mu_pin=point["mu_pin"])
        expected = judge.roots(point["pin"] == 1)
        for lam in (batch.lam[i], model.at(**point).modes().lam):
            assert by_frequency(lam[: len(expected)]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("state", [0, 1])
def test_derivatives_are_those_of_the_roots_by_hand(tmp_path, state):
    values = {"speed": 0.25, "mu_one": 0.45, "v_one": 0.2, "mu_pin": 0.2, "k_t": 5e5, "k_ab": 2e5}
    names = {"speed": "sliding_speed"}
    model = three(tmp_path)
    asked = [names.get(name, name) for name in values]
    one = model.at(pin=state).sensitivities(*asked, modes=4)
    batch = model.at(pin=np.array([state, 1 - state])).sensitivities(*asked, modes=4)[0]
    for name, value in values.items():
        ends = [Three(**{**values, name: value * (1 + h)}).roots(state) for h in (1e-5, -1e-5)]
        expected = (ends[0] - ends[1]) / (2e-5 * value)
        scale = np.abs(expected).max() + 1e-3 / value
        for rows in (one, batch):
            column = rows.names.index(names.get(name, name))
            order = np.argsort(rows.lam.imag)
            wrong = np.abs(rows.derivative[order, column] - expected).max()
            assert wrong < 1e-6 * scale, (name, state)


def test_a_run_sticks_and_slips_by_itself(tmp_path):
    """Against the same law of each contact by Radau's method: a pin slides at no imposed speed."""
    slope = 300.0 / (4e5 / PER_AREA) / 3e-3
    model = three(tmp_path, k_t=0.0, mu_pin=0.03, contact_law="unilateral", **{"contact.kt": slope})
    judge = Three(mu_pin=0.03)
    motion = model.at(k_ab=3e5).simulate(0.03, step=2e-6, save_every=5, perturbation=0.3).motions[0]
    judge.K = Three(k_ab=3e5).K
    speed = 0.25 * np.array([1.2, 1.0, 0.0])

    def forces(q, v):
        pressing, w = judge.k * np.maximum(-judge.N @ q, 0.0), speed + judge.T @ v
        held = slope * judge.k / PER_AREA * np.abs(w)
        bound = judge.mu(np.abs(w))[0] * pressing
        return pressing, -np.sign(w) * np.minimum(held, bound), held < bound

    def rate(_, z):
        q, v = z[:4], z[4:]
        pressing, drag, _ = forces(q, v)
        pull = judge.f - judge.K @ q - judge.C @ v + judge.N.T @ pressing + judge.T.T @ drag
        return np.concatenate([v, pull / np.diag(judge.M)])

    mu = judge.mu(speed)[0] * [1.0, 1.0, 0.0]
    K = judge.K + judge.N.T @ (judge.k[:, None] * judge.N)
    still = np.linalg.solve(K - judge.T.T @ ((mu * judge.k)[:, None] * judge.N), judge.f)
    system = model.at(k_ab=3e5).simulate(1e-5, step=2e-6).systems[0]
    rows = np.linalg.lstsq(
        np.vstack([judge.N, judge.T]), np.vstack([system.N, system.T1]), rcond=None
    )[0]
    q, v = (rows @ motion.point.q0, rows @ motion.point.v0)
    ran = solve_ivp(
        rate, (0, 0.03), np.concatenate([still + q, v]), "Radau",
        t_eval=motion.times, rtol=1e-8, atol=1e-11, max_step=2e-5,
    ).y.T  # fmt: skip
    drags = np.array([forces(z[:4], z[4:])[1] for z in ran])
    stuck = np.array([forces(z[:4], z[4:])[2][2] for z in ran])
    assert 0.02 < stuck.mean() < 0.9, "the pin sticks and slips"
    wrong = motion.history["torque"] + drags[:, :2].sum(axis=1)
    assert np.abs(wrong).max() < 1e-3 * np.abs(drags).max()
    assert abs(motion.energy.relative) < 1e-5
    assert not motion.history["stick"][stuck].all(), "the pin is none of what sticks"


PINNED = HULTEN.replace(
    "[[load]]",
    """\
[[contact]]
name = "pin"
between = ["mass", "ground"]
normal = "x"
sliding = "y"
stiffness = 1e4
gap = -1e-3
friction = "mu_pin"
state = "stuck"

[[load]]""",
    1,
).replace("[parameters]", "[parameters]\nmu_pin = 0.05")


def test_a_cycle_with_a_pin_is_that_of_a_run(tmp_path):
    options = {"contact_law": "cubic", "contact.cubic_stiffness": 5e17}
    point = model_of(tmp_path, PINNED, **options).at(friction=0.36, damping_ratio=0.01)
    ((_, cycle),) = [(n, c) for n, c in point.limit_cycles().cycles if c.attracts]
    motion = point.simulate(2.0, step=1e-4, save_every=1, perturbation=2.0).motions[0]
    torque, times = motion.history["torque"][-10000:], motion.times[-10000:]
    rises = np.flatnonzero((torque[:-1] < torque.mean()) & (torque[1:] >= torque.mean()))
    hz = (len(rises) - 1) / (times[rises[-1]] - times[rises[0]])
    assert cycle.motion.omega / (2 * np.pi) == pytest.approx(hz, rel=1e-3)
    assert cycle.levels["torque_rms"] == pytest.approx(torque.std(), rel=2e-3)
    without = model_of(tmp_path, PINNED, **options).at(
        friction=0.36, damping_ratio=0.01, mu_pin=0.0
    )
    assert without.limit_cycles().cycles[0][1].levels["torque_rms"] > 1.05 * torque.std()


def test_what_a_state_cannot_be_is_told(tmp_path):
    model = model_of(tmp_path, BLOCK)
    with pytest.raises(ModelError, match="expected 'tangential' above 0"):
        model.at(k_t=0.0).modes()
    batch = model.at(k_t=np.array([0.0, 1e5])).modes()
    assert batch.status.tolist() == ["failed", "ok"]
    assert "expected 'tangential'" in batch.message[0]
    with pytest.raises(ModelError, match=r"expected 1 \(stuck\) or 0 \(sliding\), got 0\.5"):
        model.at(bracket_state=0.5).modes()
    for values in ({}, {"bracket_state": 0, "k_t": 0.0}):
        with pytest.raises(ModelError, match="in time a contact with a state sticks and slips"):
            model.at(**values).simulate(1e-4)
    model.at(k_t=0.0).simulate(1e-4, step=1e-5)


STUDY = """\
[study]
name = "states"
kind = "complex_modes"
[model]
file = "own.toml"
[[sweep]]
parameter = "bracket_state"
values = [0, 1]
[[sweep]]
parameter = "mu_bracket"
values = [0.1, 0.3]
[modes]
band = [1.0, 2000.0]
"""


def test_parameters_that_no_contact_follows_are_refused(tmp_path):
    block, three_contacts = model_of(tmp_path, BLOCK), three(tmp_path)
    for name, why in (
        ("friction", "every contact with friction has its own"),
        ("sliding_speed", "no contact slides at it"),
        ("friction_law.static_ratio", "no contact slides"),
    ):
        with pytest.raises(ParameterError, match=f"does nothing here: {why}"):
            block.at(**{name: 1.0})
    three_contacts.at(**{"friction": 0.3, "friction_law.static_ratio": 1.2})
    with pytest.raises(ParameterError, match="every contact with friction has its own"):
        three_contacts.at(**{"friction_law.decay_speed": 0.4})


def test_a_swept_state_of_a_study(tmp_path, capsys):
    (tmp_path / "own.toml").write_text(BLOCK)
    (tmp_path / "study.toml").write_text(STUDY)
    results = sq.run(tmp_path / "study.toml", tmp_path / "results", jobs=1)
    assert (results.points["status"] == "ok").all()
    rows = results.modes.merge(results.points[["point_id", "bracket_state", "mu_bracket"]])
    lowest = rows.groupby(["bracket_state", "mu_bracket"])["frequency_hz"].min()
    assert lowest[1.0, 0.1] == pytest.approx(lowest[1.0, 0.3], rel=1e-12)
    assert lowest[1.0, 0.1] > lowest[0.0, 0.1] > lowest[0.0, 0.3]
    assert command("inspect", str(tmp_path / "own.toml")) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for words in ("friction mu_bracket,", "state bracket_state,", "k_t N/m"):
        assert words in shown


def test_numbers_of_another_law_choose_it(tmp_path):
    """The model's friction law is the one that its contacts have numbers of; another is refused."""
    text = THREE.replace("SIGN", "").replace(
        "friction_law = { decay_speed = 0.1 }", "friction_law = { exponent = 1.0 }"
    )
    law = next(o for o in read(tmp_path, text).options if o.name == "friction_law").choices[0]
    assert law == "stribeck"
    with pytest.raises(ModelError, match="it belongs to friction_law stribeck"):
        model_of(tmp_path, text, friction_law="exponential_fall").at().modes()


def read(tmp_path, text):
    path = tmp_path / "own.toml"
    path.write_text(text)
    return read_lumped(path)


STATE = 'state = "bracket_state"\n'
BAD = [
    (STATE, "", "contact[1].between", "the ground does not slide"),
    (STATE, 'state = "held"\n', "contact[1].state", "there is no parameter 'held'"),
    (STATE, "state = true\n", "contact[1].state", "'stuck', 'sliding' or a parameter"),
    (STATE, 'state = "2 * bracket_state"\n', "contact[1].state",
     "expected 1 (stuck) or 0 (sliding), got 2"),
    (STATE, STATE + "speed_factor = 0.5\n", "contact[1].speed_factor", "no sliding is imposed"),
    (STATE, STATE + "radius = 0.1\n", "contact[1].radius", "no sliding is imposed"),
    (STATE, STATE + "friction_factor = 0.5\n", "contact[1].friction_factor", "its own friction"),
    (STATE, STATE + "friction_law = { static_ratio = 1.5 }\n", "contact[1].friction_law",
     "no sliding is imposed"),
    ('"block", "ground"]\nnormal', '"block", "belt"]\nnormal', "contact[1].state",
     "the belt slides at sliding_speed"),
    ('friction = "mu_bracket"', 'friction = "-mu_bracket"', "contact[1].friction",
     "expected at least 0, got -0.3"),
    ('friction = "mu_bracket"', 'friction = "20 * mu_bracket"', "contact[1].friction",
     "expected at most 5, got 6"),
    ('friction = "mu_bracket"', 'friction = "mu_braket"', "contact[1].friction",
     "there is no parameter 'mu_braket'"),
    ('friction = "mu_bracket"', "friction = [1]", "contact[1].friction", "false for none"),
    ('friction = "mu_bracket"', "friction = false", "contact[1].sliding", "without friction"),
    ('tangential = "k_t"', 'tangential = "-k_t"', "contact[1].tangential",
     "at least 0 N/m, got -400000"),
]  # fmt: skip
OF_LAW = [
    ("decay_speed = 0.1", "decay_sped = 0.1", "contact[2].friction_law.decay_sped",
     "no friction law has 'decay_sped'"),
    ("decay_speed = 0.1", "decay_speed = 0.0", "contact[2].friction_law.decay_speed",
     "expected a value above 0 m/s, got 0"),
    ("static_ratio = 1.6", "static_ratio = 0.5", "contact[1].friction_law.static_ratio",
     "expected at least 1, got 0.5"),
    ("decay_speed = 0.1", "ratio_1 = 1.0", "contact[2].friction_law.ratio_1",
     "expected numbers of one friction law"),
    ('state = "pin"\n', "", "contact[3].between", "the ground does not slide"),
    ('"a", "ground"]\nnormal = "x"', '"a", "b"]\nnormal = "x"', "", ""),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "good", "bad", "key", "message"),
    [(BLOCK, *case) for case in BAD] + [(THREE.replace("SIGN", ""), *case) for case in OF_LAW],
)
def test_bad_input_is_told_in_a_sentence(tmp_path, text, good, bad, key, message):
    assert good in text
    if not message:
        read(tmp_path, text.replace(good, bad, 1))
        return
    with pytest.raises(StudyFileError) as error:
        read(tmp_path, text.replace(good, bad, 1))
    assert error.value.key == key
    assert message in error.value.message


def test_friction_of_a_meshed_contact_is_its_own(tmp_path):
    """Whatever the parameter friction is, modes, derivatives and runs are those of its own."""
    named = ("search = 0.1", 'search = 0.1\nname = "face"')
    write_blocks(tmp_path / "plain", named, ("{default = 0.4}", "{default = 0.45}"))
    write_blocks(tmp_path / "own", (named[0], named[1] + "\nfriction = 0.45"))
    paths = [tmp_path / name / "blocks.toml" for name in ("plain", "own")]
    text = paths[1].read_text() + '[parameters.face]\npath = "contact.face.friction"\n'
    paths[1].write_text(text)
    band = (500.0, 60000.0)
    plain, own = (sq.model(str(path), **{"friction_law.static_ratio": 1.3}) for path in paths)
    expected, found = plain.at(friction=0.45), own.at()
    modes = [point.modes(band).lam for point in (expected, found)]
    assert modes[1] == pytest.approx(modes[0], rel=2e-6)  # bases of two models
    with pytest.raises(
        ParameterError, match="does nothing here: every sliding contact has its own"
    ):
        own.at(friction=0.2)
    slopes = [
        point.sensitivities(name, "sliding_speed", "friction_law.static_ratio", modes=2, band=band)
        for point, name in ((expected, "friction"), (found, "face"))
    ]
    for name, other in (("friction", "face"), *[(x, x) for x in slopes[0].names[1:]]):
        by = [
            rows.derivative[:, rows.names.index(x)]
            for rows, x in zip(slopes, (name, other), strict=True)
        ]
        scale = np.abs(by[0]).max()
        assert np.abs(by[1] - by[0]).max() < 1e-4 * scale, name
    runs = [point.simulate(2e-4, step=1e-6, band=band).torque for point in (expected, found)]
    assert runs[1] == pytest.approx(runs[0], rel=1e-6)
    both = text.replace("friction = 0.45", "friction = 0.45\nfriction_factor = 2.0")
    paths[1].write_text(both)
    with pytest.raises(StudyFileError, match="a contact with its own friction has no such key"):
        sq.model(str(paths[1]))
