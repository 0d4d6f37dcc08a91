"""One design point, one damping: growth in time and in limit cycles is that of complex modes.

Designs differ from the nominal one in all that may differ without another structure.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from blocks import OPERATING, blocks
from conftest import CUTOFF, NOMINAL
from cycle_models import Designs, linear_modes
from motions import started
from shared_kernels import OF_THE_HYBRID_MODEL
from study_runs import solved

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.engine.comparison import compare_results
from squealstudy.errors import ModelError, SquealstudyError
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
from squealstudy.linalg.dense_qep import dense_roots
from squealstudy.models.operating import DesignState
from squealstudy.modes.point import linearised_point
from squealstudy.motion.growing_modes import projection
from squealstudy.motion.hybrid_run import simulate_hybrid
from squealstudy.motion.integrators.newmark import NewmarkNewton
from squealstudy.motion.point import friction_law, motion_point, perturbed, tangent
from squealstudy.motion.settings import MotionSettings
from squealstudy.motion.shared_modes import Training, shared_modes, truncated, with_pod
from squealstudy.motion.simulate import simulate
from squealstudy.motion.system import ModalSystem, MotionPoint
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.hybrid import HybridSettings, hybrid_model, hybrid_model_at
from squealstudy.reduction.prepared import shape_column
from squealstudy.reduction.working_point import working_point
from squealstudy.system.linearise import linearise

SAME = 1e-9  # of growth rates, relative
ROUND_OFF = 1e-13  # of a root, relative to its size
BAND = (500.0, 8000.0)


def same_growth(found, wanted):
    """Of oscillating roots (m,), the fastest growth first."""
    found, wanted = (lam[np.argsort(-lam.real)] for lam in (found, wanted))
    limit = SAME * np.abs(wanted.real) + ROUND_OFF * np.abs(wanted)
    return bool((np.abs(found.real - wanted.real) <= limit).all())


def upper(lam):
    return lam[lam.imag > 0]


# -- minimal models -------------------------------------------------------------------------------
CASES = [
    ("hoffmann", "exponential", {"damping_ratio": 0.03, "contact.p0": 1e6, "contact.lambda": 5e4}),
    ("hoffmann", "cubic", {"damping_ratio": 0.02, "contact.cubic_stiffness": 1e17}),
    ("hulten", "cubic", {"damping_ratio": 0.01, "contact.cubic_stiffness": 1e17}),
    ("belt", "", {"damping_ratio": 0.02}),
]
OWN = ("friction", "sliding_speed", "damping_ratio", "friction_law.static_ratio", "contact.p0")
OWN = (*OWN, "contact.lambda", "contact.cubic_stiffness", "contact.exponent")


def random_designs(nominal, count, seed):
    """Values that need no other structure, each a third to three times the nominal one."""
    rng = np.random.default_rng(seed)
    names = [name for name in OWN if name in nominal]
    for _ in range(count):
        values = {name: nominal[name] * 3 ** rng.uniform(-1, 1) for name in names}
        values["friction_law.static_ratio"] = rng.uniform(1.0, 2.0)
        values["stiffness_damping"] = rng.choice([0.0, 10 ** rng.uniform(-7, -5)])
        yield {**values, "friction": rng.uniform(0.05, 1.2)}


@pytest.mark.parametrize(("model", "law", "values"), CASES)
def test_growth_of_minimal_models(model, law, values):
    designs = Designs(model, values, law)
    solved_designs = 0
    for other in random_designs(designs.nominal.values, 40, seed=7):
        point = designs.nominal.with_values({**designs.nominal.values, **other})
        try:
            oscillator = designs.at(**other)
        except SquealstudyError:
            continue  # no working point, or friction that does not saturate
        _, linear = linearised_point(designs.prepared, point.state())
        wanted = upper(dense_roots(linear.C, linear.K, (0.0, np.inf))[0])
        assert same_growth(linear_modes(oscillator.oscillator)[0], wanted)
        fastest = wanted[np.argmax(wanted.real)]
        unstable = fastest.real > 1e-6 * abs(fastest)
        assert not unstable or same_growth(oscillator.point.growing.lam[:1], fastest[None])
        solved_designs += 1
    assert solved_designs >= 20


@pytest.mark.parametrize(("slope", "growth"), [(3e4, 224.178), (1e5, -28.458)])
def test_designs_have_their_own_damping_wherever_the_nominal_one_is(slope, growth):
    """Hoffmann's model with an exponential contact; growth by 2 x 2 eigenvalues of each design."""
    values = {"friction": 1.0, "damping_ratio": 0.03, "contact.p0": 1e6}
    designs = Designs("hoffmann", values, "exponential")
    lam, _ = linear_modes(designs.at(**{"contact.lambda": slope}).oscillator)
    assert lam[0].real == pytest.approx(growth, abs=1e-3)


@pytest.mark.parametrize("method", [None, NewmarkNewton()])
def test_runs_grow_as_predicted(method):
    """In a batch whose designs have one, another and no damping between coordinates."""
    values = {"friction": 1.0, "damping_ratio": 0.03, "contact.p0": 1e6}
    designs = Designs("hoffmann", values, "exponential")
    slopes = (3e4, 4e4, 5e5, 3e4, 4e4)
    points = [designs.at(**{"contact.lambda": slope}).point for slope in slopes]
    assert [p.damping_between is None for p in points] == [False, False, True, False, False]
    settings = MotionSettings(duration=0.02, step=2e-6, save_every=10, tolerance=1e-9)
    settings = settings if method is None else replace(settings, integrator=method)
    system = designs.reference.system
    for point, motion in zip(
        points,
        simulate(system, [perturbed(system, p, 1e-9) for p in points], settings),
        strict=True,
    ):
        xi = np.abs(projection(motion.displacement[:, :4], motion.velocity[:, :4]))
        growth = np.polyfit(motion.history["time"], np.log(xi), 1)[0]
        lam = point.growing.lam[0]
        assert growth == pytest.approx(lam.real, abs=1e-5 * abs(lam))
        assert abs(motion.energy.relative) < 1e-6


STUDY = """
[study]
name = "{kind}"
kind = "{kind}"
[model]
name = "hoffmann"
contact_law = "exponential"
[parameters]
friction = 1.0
damping_ratio = 0.03
"contact.p0" = 1e6
[[sweep]]
parameter = "contact.lambda"
values = [30000.0, 40000.0]
{more}
"""
IN_TIME = "[transient]\nduration = 0.03\nstep = 1e-5\nperturbation = 1e-6\n"


def test_compared_studies_predict_one_growth(tmp_path):
    modes = solved(STUDY.format(kind="complex_modes", more=""), tmp_path / "modes")
    runs = solved(STUDY.format(kind="transient", more=IN_TIME), tmp_path / "runs")
    table = compare_results(modes, runs)
    assert len(table) == 2
    np.testing.assert_allclose(table["predicted_growth_rate"], table["growth_rate"], rtol=SAME)
    np.testing.assert_allclose(table["fitted_growth_rate"], table["growth_rate"], rtol=1e-2)


def test_verdicts_are_those_of_the_designs_alone(tmp_path):
    """The design at 1e5 /m does not squeal by itself, whichever the nominal one is."""
    text = STUDY.format(kind="limit_cycles", more="").replace("40000.0", "100000.0")
    found = solved(text, tmp_path / "cycles")
    growth = found.table("verdicts").groupby("point_id")["growth_rate"].max()
    growth = growth[found.points["point_id"]]
    np.testing.assert_allclose(growth, [224.178, -28.458], atol=1e-3)
    assert found.points["verdict"].tolist() == ["squeals", "squeals_if_kicked"]


# -- the brake ------------------------------------------------------------------------------------
KEYS = (("caliper", 7), ("caliper", 8))


@pytest.fixture(scope="module")
def reference(brake, reduced):
    return shared_modes(reduced[0], brake.point, DesignState(NOMINAL), KEYS)


def random_states(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        operating = replace(
            NOMINAL,
            friction=rng.uniform(0.1, 0.6),
            brake_pressure=10 ** rng.uniform(5.4, 6.5),
            sliding_speed=rng.uniform(0.2, 2.0),
            law=contact_law(p0=10 ** rng.uniform(4.8, 5.2), lam=10 ** rng.uniform(5.5, 5.9)),
            curve=friction_curve(static_ratio=rng.uniform(1.0, 1.4), decay_speed=0.5),
        )
        yield DesignState(
            operating,
            {KEYS[0]: rng.uniform(0.8, 1.25)},
            {KEYS[1]: rng.uniform(0.0, 0.1)},
            damping_ratio=rng.uniform(0.001, 0.02),
            stiffness_damping=rng.uniform(0.0, 2e-7),
            assembly_damping={int(rng.integers(5, 40)): 0.03},
        )


def bases(reference):
    """All modes, modes up to a frequency, and these with vectors of a run (here any)."""
    rng, n = np.random.default_rng(3), reference.system.n
    rows = rng.normal(size=(50, n)) / np.maximum(reference.system.frequencies, 1.0)
    training = Training(rows, np.zeros((n, 0), dtype=complex))
    return reference, truncated(reference, CUTOFF), with_pod(reference, CUTOFF, training, 20)


@pytest.mark.parametrize("state", list(random_states(4, seed=11)))
def test_growth_of_the_brake_on_any_basis(brake, reduced, reference, state):
    """The matrices of complex modes on the coordinates of a run."""
    model = reduced[0]
    omega = {k: model.k_el[model.mode_coordinate(*k)] ** 0.5 for k in KEYS}
    changes = state.stiffness_changes(omega)
    space = brake.space.changed({shape_column(model, *k): v for k, v in changes.items()})
    point = working_point(space, state.operating)
    linear = linearise(model, point, state)
    for shared in bases(reference):
        friction = friction_law(shared.system, state, point, 0.0, 1e-3, "regularised")
        made = motion_point(shared, point, state, friction, BAND, 1e-7)
        C, K = (shared.phi.T @ A @ shared.phi for A in (linear.C, linear.K))
        np.testing.assert_allclose(
            tangent(shared.system, made, point, state)[0], C, atol=1e-10 * np.abs(C).max()
        )
        of_cycles = ContactOscillator(shared.system, made).oscillator
        for matrix, wanted in zip(
            of_cycles.tangent(*[np.zeros((1, of_cycles.n))] * 2), (C, K), strict=True
        ):
            np.testing.assert_allclose(matrix[0], wanted, atol=1e-10 * np.abs(wanted).max())
        low, high = (2 * np.pi * f for f in BAND)
        wanted = upper(dense_roots(C, K, (low, high))[0])
        wanted = wanted[np.argsort(-wanted.real)][: len(made.growing.lam)]
        limit = SAME * np.abs(wanted.real) + 1e-11 * np.abs(wanted)
        assert (np.abs(made.growing.lam.real - wanted.real) <= limit).all()


# -- the hybrid representation --------------------------------------------------------------------
ZETA = 0.02


@pytest.fixture(scope="module")
def pressed():
    """The hybrid model of two blocks with all modes, and two other working points."""
    assembly = blocks()
    space = contact_space(assembly, 1e11, np.zeros((assembly.n_dof, 0)))
    settings = HybridSettings(1e9, 1e9)
    model = hybrid_model(assembly, working_point(space, OPERATING), OPERATING, settings)
    found = []
    for pressure, law in ((2.5, OPERATING.law), (0.5, contact_law(p0=3e4, lam=4e5))):
        operating = replace(OPERATING, brake_pressure=pressure, friction=0.3, law=law)
        found.append((operating, working_point(space, operating)))
    return assembly, model, found


def square_root_damping(M, K):
    """2 zeta (M^-1 K)^(1/2) with the mass, by Schur's method (Higham 1987), no eigenvectors."""
    m = np.sqrt(M.diagonal())
    root = la.sqrtm(K / np.outer(m, m)).real
    return 2 * ZETA * root * np.outer(m, m)


def damped(own):
    """Rates of all modes of the hybrid model, and nothing beyond."""
    return 2 * ZETA * own.omega


@pytest.mark.parametrize("number", [0, 1])
def test_growth_of_the_hybrid_representation(pressed, number):
    """Beside the unreduced blocks: all traces, so that both have the same motions."""
    assembly, model, points = pressed
    operating, point = points[number]
    contact = assembly.contact
    K = assembly.K_el + assembly.K_springs() + assembly.K_contact(point.tangent)
    M, K = assembly.M.toarray(), K.toarray()
    own = hybrid_model_at(model, contact.area * point.tangent)
    assert len(own.omega) == own.n == len(M)
    U = own.M @ own.phi
    C = (U * damped(own)) @ U.T

    def roots(M, C, K, N, T, P, k_n):
        K = K - T.T @ sp.diags(operating.friction * k_n) @ N
        drag = operating.friction * contact.area * point.contact_pressure / operating.sliding_speed
        C = C + P.T @ sp.diags(drag) @ P
        L = la.cholesky(M, lower=True)
        C, K = (
            la.solve_triangular(L, la.solve_triangular(L, A, lower=True).T, lower=True).T
            for A in (np.asarray(C), np.asarray(K))
        )
        return upper(dense_roots(C, K, (0.0, np.inf))[0])

    k_n = contact.area * point.tangent
    sides = [A.toarray() for A in (contact.N, contact.T, contact.T_perp)]
    wanted = roots(M, square_root_damping(M, K), K, *sides, k_n)
    sides = [A.toarray() for A in (own.N, own.T, own.T_perp)]
    found = roots(own.M.toarray(), C, own.K.toarray(), *sides, k_n)
    wanted, found = (lam[np.argsort(np.abs(lam))] for lam in (wanted, found))
    assert len(wanted) == len(found)
    np.testing.assert_allclose(found.real, wanted.real, atol=1e-9 * np.abs(wanted).max())


@OF_THE_HYBRID_MODEL
def test_hybrid_and_modal_kernels_agree_about_another_working_point(pressed):
    """One keeps its own real modes, the other those of the reference, damped between them."""
    _, model, ((operating, point), _) = pressed
    own = hybrid_model_at(model, model.area * point.tangent)
    force = point.forces(own, operating)
    friction = FrictionLaw(0.3, 0.3 * point.contact_pressure.max() / 4e-3)
    design = MotionPoint(
        operating.law,
        friction,
        operating.sliding_speed,
        damped(own),
        gap=point.gap,
        force=force,
    )
    shape = 0.4 * model.phi[:, :8].sum(axis=1)
    design = replace(design, v0=shape / np.abs(shape).max(), q0=np.zeros(model.n))
    settings = MotionSettings(2e-3, 2e-6, 5, tolerance=1e-9)
    sensed = np.arange(1, 11)
    hybrid = simulate_hybrid(own, design, settings, sensed, model)

    rows = (model.N @ model.phi, model.T @ model.phi, model.T_perp @ model.phi)
    contact = (model.area, model.frictional, model.radius, model.gap, model.k_ref, model.force)
    system = ModalSystem(model.omega**2, *rows, *contact, sensed=sensed)
    seen = model.phi.T @ model.M @ own.phi
    C = (seen * damped(own)) @ seen.T
    between = 0.5 * (C + C.T) - np.diag(np.diag(C))
    modal = replace(design, c=np.diag(C).copy(), damping_between=between)
    plain = replace(modal, damping_between=None)
    both = started([modal, plain], np.zeros(model.n), model.sensors @ design.v0)
    beside, without = simulate(system, both, settings)
    assert hybrid.outcome == beside.outcome == "ok"
    other = without.velocity - beside.velocity
    assert np.abs(other).max() > 1e-3 * np.abs(beside.velocity).max()
    np.testing.assert_allclose(hybrid.omega, model.omega[:10])
    for name in ("displacement", "velocity"):
        wanted = getattr(beside, name)
        np.testing.assert_allclose(getattr(hybrid, name), wanted, atol=1e-4 * np.abs(wanted).max())
    for name in ("torque", "stored", "modal_energy", "dissipated_damping"):
        size = np.abs(beside.history[name]).max()
        np.testing.assert_allclose(hybrid.history[name], beside.history[name], atol=2e-4 * size)
    assert hybrid.energy.relative == pytest.approx(beside.energy.relative, abs=1e-4)


def test_hybrid_models_at_their_own_working_point_are_themselves(pressed):
    _, model, _ = pressed
    assert hybrid_model_at(model, model.k_ref * (1 + 1e-12)) is model
    design = MotionPoint(OPERATING.law, FrictionLaw(0.3, 1e9), 0.2, damped(model))
    n = model.n
    with pytest.raises(ModelError, match="damping_between"):
        simulate_hybrid(
            model, replace(design, damping_between=np.zeros((n, n))), MotionSettings(1e-5, 1e-6)
        )
