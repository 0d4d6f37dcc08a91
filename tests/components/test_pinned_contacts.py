"""Meshed contacts off the rotor, stuck or sliding, and friction laws of contacts: against numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from pinned_blocks import OF_ABUTMENT, OF_PARAMETERS, write_pinned

import squealstudy as sq
from squealstudy.errors import ModelError, ParameterError, StudyFileError
from squealstudy.study.components import inspected, read_model
from squealstudy.study.preparations import preparations

BAND = (500.0, 4.2e4)
WHOLE = {"band_hz": (500.0, 1e5), "component_cutoff_factor": 100.0}  # a basis of all freedoms
SHEAR, SPEED = 5e11, 0.5  # N/m3, m/s


class ByHand:
    """Matrices of the block, its abutment's slip along +z taken from two tangents of a plane."""

    def __init__(self, system):
        assembly, operating = system.assembly.assembled, system.assembly.operating
        c = assembly.contact
        self.M = assembly.M.toarray()
        self.K = (assembly.K_el + assembly.K_springs()).toarray()
        self.load = assembly.load * operating.brake_pressure
        self.k, self.area = operating.law.value("contact.stiffness") * c.area, c.area
        self.speed = SPEED * c.speed_factor
        self.off = np.array(c.pairs) == "abutment"
        self.N, T, P = (A.toarray() for A in (c.N, c.T, c.T_perp))
        z = np.zeros(assembly.n_dof)
        z[assembly.slices["slider"]][2::3] = 1.0
        first = (np.abs(T @ z) > np.abs(P @ z))[:, None]
        slip, across = np.where(first, T, P), np.where(first, P, T)
        slip = -slip * np.sign(slip @ z)[:, None]  # the bracket past the block
        self.T, self.P = (np.where(self.off[:, None], a, b) for a, b in ((slip, T), (across, P)))

    def roots(self, stuck, mu_abutment=0.3, shear=SHEAR, friction=0.4, tied=False):
        """Eigenvalues above the real axis, and pressures."""
        mu = np.where(self.off, 0.0 if stuck else mu_abutment, friction)
        K = self.K + self.N.T @ (self.k[:, None] * self.N)
        K = K - self.T.T @ ((mu * self.k)[:, None] * self.N)
        pressing = -self.k * (self.N @ np.linalg.solve(K, self.load))
        assert (pressing > 0).all()
        C = self.P.T @ (np.where(self.off, 0.0, mu * pressing / self.speed)[:, None] * self.P)
        held = np.vstack([self.T[self.off], self.P[self.off]])
        M = self.M
        if stuck and not tied:
            K = K + held.T @ (np.tile(shear * self.area[self.off], 2)[:, None] * held)
        if tied:
            free = la.null_space(held)
            M, C, K = (free.T @ A @ free for A in (M, C, K))
        n = len(M)
        rows = [-np.linalg.solve(M, A) for A in (K, C)]
        lam = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], rows]))
        return lam[lam.imag > 0], pressing / self.area


def nearest(expected, lam):
    return expected[np.abs(expected - lam[:, None]).argmin(axis=1)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pinned")


@pytest.fixture(scope="module")
def path(folder):
    return str(write_pinned(folder / "own"))


@pytest.fixture(scope="module")
def frictionless(folder):
    plain = (OF_ABUTMENT, 'kind = "frictionless"\n'), (OF_PARAMETERS, "")
    path = write_pinned(folder / "plain", *plain)
    return sq.model(str(path), contact_law="bilateral").with_basis(**WHOLE).at()


@pytest.fixture(scope="module")
def judge(frictionless):
    return ByHand(frictionless)


@pytest.fixture(scope="module")
def model(path):
    return sq.model(path, contact_law="bilateral").with_basis(**WHOLE)


@pytest.mark.parametrize(
    ("state", "mu", "shear"), [(0, 0.3, SHEAR), (0, 0.6, 1.0), (1, 0.3, SHEAR)]
)
def test_roots_and_pressures_are_those_by_hand(model, judge, state, mu, shear):
    expected, pressing = judge.roots(state, mu, shear)
    system = model.at(abutment_state=state, mu_abutment=mu, shear=shear)
    assert system.steady.pressure == pytest.approx(pressing, rel=1e-9)
    lam = system.modes().lam
    assert len(lam) > 10
    assert np.abs(nearest(expected, lam) / lam - 1).max() < 1e-9


def test_without_friction_it_is_frictionless_and_very_stiff_it_is_tied(model, judge, frictionless):
    sliding = model.at(abutment_state=0, mu_abutment=0.0)
    assert sliding.modes().lam == pytest.approx(frictionless.modes().lam, rel=1e-12)
    tied, _ = judge.roots(True, tied=True)
    errors = []
    for shear in (1e15, 1e16):
        lam = model.at(abutment_state=1, shear=shear).modes(BAND).lam
        errors.append(np.abs(nearest(tied, lam) / lam - 1).max())
    assert errors[0] < 1e-3
    assert errors[1] == pytest.approx(errors[0] / 10, rel=0.05)


def test_reversed_slip_and_reversed_rotor(folder, judge, model):
    """Slip along -z pulls the other way; where the rotor turns back the sign of slip stays."""
    path = write_pinned(folder / "away", ("[0, 0, 1]\ntangential", "[0, 0.0, -2]\ntangential"))
    away = sq.model(str(path), contact_law="bilateral").with_basis(**WHOLE)
    judge.T[judge.off] *= -1.0
    expected, _ = judge.roots(stuck=False)
    judge.T[judge.off] *= -1.0
    lam = away.at(abutment_state=0).modes().lam
    assert np.abs(nearest(expected, lam) / lam - 1).max() < 1e-9
    rows = model.at(abutment_state=0).assembly.assembled.contact
    operating = model.at(abutment_state=0, sliding_speed=-SPEED).assembly.operating
    p = np.ones(rows.n_points)
    mu = operating.friction_at(p, rows.speed_factor, rows.own_friction).mu
    assert mu[judge.off] == pytest.approx(0.3)
    assert mu[~judge.off] == pytest.approx(-0.4)


@pytest.mark.parametrize(("state", "names"), [(0, ("mu_abutment", "friction")), (1, ("shear",))])
def test_derivatives_are_those_of_the_roots_by_hand(model, judge, state, names):
    values = {"mu_abutment": 0.3, "shear": SHEAR, "friction": 0.4}
    found = model.at(abutment_state=state).sensitivities(*names, modes=4, band=BAND)
    for name in names:
        ends = [judge.roots(state, **{name: values[name] * (1 + h)})[0] for h in (1e-5, -1e-5)]
        ends = [nearest(lam, found.lam) for lam in ends]
        expected = (ends[0] - ends[1]) / (2e-5 * values[name])
        wrong = np.abs(found.derivative[:, found.names.index(name)] - expected).max()
        assert wrong < 1e-5 * np.abs(expected).max(), name


def test_errors_of_a_reduction_hold(path, judge):
    """Of few component modes, stuck and sliding, as far as they are told."""
    reduced = sq.model(path, contact_law="bilateral").with_basis(
        band_hz=BAND, component_cutoff_factor=1.0, residual_responses=False
    )
    for state in (0, 1):
        modes = reduced.at(abutment_state=state).modes()
        wrong = np.abs(nearest(judge.roots(state)[0], modes.lam) - modes.lam)
        assert wrong.max() > 1e-2
        assert (wrong < 2 * modes.error).all()


def test_a_run_sticks_and_slips_by_itself(path):
    """In the basis of runs as in one of all freedoms; it rests where it is held, at no speed."""
    runs = []
    whole = {"assembly_cutoff_factor": 100.0, "tolerance": 1e-9, "component_cutoff_factor": 100.0}
    plain = sq.model(path, contact_law="unilateral", shear=0.0, mu_abutment=0.02)
    for basis in (None, {**whole, "residual_responses": False, "tells_error": False}):
        model = plain if basis is None else plain.with_basis(band_hz=BAND, **basis)
        point = model.at(abutment_state=1)
        runs.append(point.simulate(1e-4, step=1e-7, perturbation=0.2, band=BAND).motions[0])
        with pytest.raises(ModelError, match="stuck has no tangential stiffness in complex modes"):
            point.modes()
    torques = [run.history["torque"] for run in runs]
    size = np.ptp(torques[1])
    assert len(runs[0].q) < 0.8 * len(runs[1].q)
    assert np.abs(torques[0] - torques[1]).max() < 2e-3 * size
    assert abs(runs[0].energy.relative) < 1e-4
    held = plain.at(abutment_state=1, mu_abutment=0.5)
    held = held.simulate(1e-4, step=1e-7, perturbation=0.2, band=BAND).motions[0]
    assert np.abs(held.history["torque"] - torques[0]).max() > 0.02 * size
    for values in ({"shear": SHEAR}, {"abutment_state": 0, "shear": 0.0}):
        with pytest.raises(ModelError, match="in time a contact with a state sticks and slips"):
            plain.at(**values).simulate(1e-6, step=1e-7)


LAW = "friction_law = {static_ratio = 1.3, decay_speed = 200.0}\n"


def test_a_friction_law_of_a_contact_is_that_of_the_study(folder, path):
    """Whatever the study's law is, roots and derivatives are those of the contact's own numbers."""
    sliding = 'kind = "sliding"\n'
    text = 'own_decay = {path = "contact.lining.friction_law.decay_speed"}\n'
    changes = (sliding, sliding + LAW), ("friction = {", text + "friction = {")
    own = sq.model(str(write_pinned(folder / "law", *changes)), contact_law="bilateral")
    law = {"friction_law.static_ratio": 1.3, "friction_law.decay_speed": 0.2}
    expected = sq.model(path, contact_law="bilateral", **law).at()
    slopes = [
        point.sensitivities("sliding_speed", name, modes=2, band=BAND)
        for point, name in ((expected, "friction_law.decay_speed"), (own.at(), "own_decay"))
    ]
    assert slopes[1].lam == pytest.approx(slopes[0].lam, rel=1e-6)
    by = [rows.derivative for rows in slopes]
    assert (np.abs(by[1] - by[0]).max(axis=0) < 1e-4 * np.abs(by[0]).max(axis=0)).all()
    with pytest.raises(ParameterError, match="does nothing here: every sliding contact has its"):
        own.at(**law)
    with pytest.raises(StudyFileError, match="it belongs to friction_law exponential_fall or stri"):
        own.with_(friction_law="table").at().modes()


LINING = 'kind = "sliding"\nslave = "slider.BOTTOM"\n'
STATE = 'state = "stuck"\n'
BAD = [
    (LINING, 'friction = 0.3\nstate = "stuck"\nsliding = [1, 0, 0]\nslave = "slider.BOTTOM"\n',
     "contact[1].state", 'plate turns, and what touches it slides at sliding_speed: expected no'),
    (LINING, LINING + STATE, "contact[1]", "state: expected only of a contact without the key"),
    (LINING, 'slave = "slider.BOTTOM"\n', "contact[1]", "the key 'kind' is missing"),
    (STATE, 'state = "slipping"\n', "contact[2].state",
     "expected 'stuck' or 'sliding', got 'slipping'"),
    (STATE, "state = 0.5\n", "contact[2].state", "expected 'stuck' or 'sliding', got 0.5"),
    ('abutment_state = {path = "contact.abutment.state"}\n', "\n", "", ""),
    (STATE, "", "contact[2]", "the key 'kind' is missing: sliding, stuck or frictionless"),
    ("friction = 0.3\n", "", "contact[2]", "the key 'friction' is missing"),
    ("friction = 0.3\n", "friction = -0.3\n", "contact[2].friction",
     "expected at least 0, got -0.3"),
    ("friction = 0.3\n", "friction = 0.3\nfriction_factor = 2.0\n", "contact[2]",
     "friction_factor: a contact with its own friction has no such key"),
    ("friction = 0.3\n", "friction = 0.3\n" + LAW, "contact[2]",
     "friction_law: expected only of a sliding contact"),
    ("sliding = [0, 0, 1]\n", "", "contact[2]", "the key 'sliding' is missing: the direction"),
    ("sliding = [0, 0, 1]\n", "sliding = [0, 0, 0]\n", "contact[2]", "sliding: expected the dir"),
    (LINING, LINING + "sliding = [1, 0, 0]\n", "contact[1]", "sliding: expected only of a contact"),
    (LINING, LINING + "friction_law = {static_rato = 1.2}\n",
     "contact[1].friction_law.static_rato", "no friction law has 'static_rato', expected one of"),
    (LINING, LINING + "friction_law = {static_ratio = 0.2}\n",
     "contact[1].friction_law.static_ratio", "expected at least 1, got 0.2"),
    (LINING, LINING + "friction_law = {decay_speed = 1.0, ratio_1 = 1.0}\n",
     "contact[1].friction_law.ratio_1", "expected numbers of one friction law"),
    ('"contact.abutment.state"', '"contact.abutment.friction_law.static_ratio"',
     "parameters.abutment_state.path", "expected contact.abutment.friction_law.KEY, where KEY is"),
    ('{path = "contact.abutment.state"}', '{path = "contact.abutment.state", default = 2}',
     "parameters.abutment_state.default", "expected at most 1, got 2"),
]  # fmt: skip


@pytest.mark.parametrize(("good", "bad", "key", "message"), BAD)
def test_bad_input_is_told_in_a_sentence(tmp_path, good, bad, key, message):
    if not message:  # what slides for good is held by nothing
        path = write_pinned(tmp_path, (good, bad), (STATE, 'state = "sliding"\n'))
        key, message = "contact[2].tangential", "it holds a contact that is stuck, and this one sli"
    else:
        path = write_pinned(tmp_path, (good, bad))
    with pytest.raises(StudyFileError) as error:
        read_model(path)
    assert error.value.key == key
    assert message in error.value.message
    assert "pinned.toml" in str(error.value)


def test_values_that_nothing_can_have_are_told(folder, model):
    text = r"abutment_state = 0.5 \(SI\): expected 1 \(stuck\) or 0 \(sliding\), got 0.5: a state"
    with pytest.raises(ModelError, match=text):
        model.at(abutment_state=0.5).modes()
    path = write_pinned(folder / "leaves", ("[0, 0, 1]\ntangential", "[1, 0, 0]\ntangential"))
    with pytest.raises(StudyFileError, match="9 of 9 points have normals along its direction 'sl"):
        sq.model(str(path)).at().modes()


STUDY = """\
[study]
name = "states"
kind = "complex_modes"
[model]
file = "{path}"
[[sweep]]
parameter = "abutment_state"
values = [1, 0]
[[sweep]]
parameter = "mu_abutment"
values = [0.1, 0.3]
"""


def test_what_slides_and_what_sticks_is_told(folder, path):
    """`inspect` says what a contact does, `check` what follows what, in modes and in time."""
    (folder / "states.toml").write_text(STUDY.format(path=path))
    study = sq.read_study(folder / "states.toml")
    sticks = (
        "is stuck, by 5e+11 N/m3 in plane, where 'abutment_state' is 1, and slides, with friction"
    )
    assert preparations(study.resolved) == (
        f"abutment {sticks} 'mu_abutment' at all speeds, where 0",
    )
    text = (folder / "states.toml").read_text()
    in_time = text.partition("[[sweep]]")[0].replace("complex_modes", "transient")
    (folder / "time.toml").write_text(in_time + "[parameters]\nshear = 0.0\n")
    told = preparations(sq.read_study(folder / "time.toml").resolved)
    assert told == ("abutment sticks and slips by itself, from no friction, with friction 0.3",)
    (folder / "time.toml").write_text(in_time)
    (told,) = preparations(sq.read_study(folder / "time.toml").resolved)
    assert told.startswith(
        "abutment cannot be run: in time a contact with a state sticks and slips"
    )
    facts = dict(inspected(read_model(Path(path)))[0].facts)
    assert facts["abutment"].startswith("stuck: slider.LEFT on bracket.RIGHT, 9 points")
    assert facts["abutment"].endswith(
        "friction 0.3, slips along [0, 0, 1], stuck by 5e+11 N/m3 in plane"
    )
    assert "contact from 100.7 to 102.3 mm of the axis" in facts["rotation"]
