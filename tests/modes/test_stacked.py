"""Small models in batches: equal to the way point by point, and to closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from study_runs import plan_of
from study_texts import study_text

from squealstudy.engine.chunk_rows import solve_chunk
from squealstudy.engine.workers import Workers
from squealstudy.errors import ConvergenceError, ParameterError
from squealstudy.kinds.complex_modes.kind import KIND
from squealstudy.laws import contact_law
from squealstudy.linalg import root_error
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.catalogue import MODELS
from squealstudy.models.linear_interfaces import SpringInterface
from squealstudy.models.model_point import ModelPoint
from squealstudy.models.operating import (
    CONTACT_OPTION,
    DAMPING,
    FRICTION,
    FRICTION_OPTION,
    PRESSURE,
    SLIDING_SPEED,
    STIFFNESS_DAMPING,
    contact_parameters,
    friction_parameters,
)
from squealstudy.models.parameter import ModelDefinition, structural
from squealstudy.modes.point import solve_point
from squealstudy.reduction.cmt import ReductionSettings
from squealstudy.reduction.prepared import prepare
from squealstudy.stacked.modes import stacked_system
from squealstudy.stacked.roots import conditions, stacked_roots

BAND = (1.0, 1000.0)
WORKERS = Workers(1)
WHOLE = ReductionSettings(np.inf, np.inf, 0.0)
CASES = {
    "hulten": (
        "hulten",
        {},
        {"friction": (0.0, 0.9), "frequency_1": (60.0, 110.0), "sliding_speed": (-1.0, -0.2)},
    ),
    "damped": (
        "hulten",
        {},
        {
            "friction": (0.0, 0.9),
            "damping_ratio": (0.0, 0.05),
            "modes[2].damping_ratio": (0.0, 0.1),
            "mass.modes[1].damping_ratio": (0.0, 0.1),
        },
    ),
    "cubic": (
        "hulten",
        {"contact_law": "cubic"},
        {
            "friction": (0.0, 0.9),
            "contact.cubic_stiffness": (1e17, 1e19),
            "stiffness_damping": (0.0, 1e-4),
        },
    ),
    "exponential": (
        "hoffmann",
        {"contact_law": "exponential"},
        {
            "friction": (0.0, 1.2),
            "contact.lambda": (1e4, 5e5),
            "friction_law.static_ratio": (1.0, 1.5),
            "damping_ratio": (0.0, 0.02),
            "k1": (1e5, 3e5),
            "alpha1": (120.0, 170.0),
        },
    ),
    "unilateral": (
        "hoffmann",
        {"contact_law": "unilateral"},
        {"friction": (0.0, 0.7), "mass": (0.5, 2.0)},
    ),
    "power": (
        "hoffmann",
        {"contact_law": "power"},
        {"friction": (0.0, 0.5), "normal_force": (50.0, 200.0), "damping_ratio": (0.01, 0.02)},
    ),
    "pulling": ("hulten", {}, {"friction": (1.05, 1.8), "damping_ratio": (0.0, 0.02)}),
    "belt": (
        "belt",
        {},
        {"friction": (0.0, 1.2), "sliding_speed": (0.2, 2.0), "stiffness": (1e5, 1e6)},
    ),
}

EPS = np.finfo(float).eps


def columns(name, ranges, count, seed):
    rng = np.random.default_rng(seed)
    return {**MODELS[name].defaults(), **{k: rng.uniform(*r, count) for k, r in ranges.items()}}


def point_of(model, options, values, row):
    own = {k: float(x if np.ndim(x) == 0 else x[row]) for k, x in values.items()}
    return ModelPoint(model, options, own)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("built", [False, True], ids=["stacked", "built one by one"])
def test_a_batch_is_its_points_one_by_one(case, built, monkeypatch):
    name, chosen, ranges = CASES[case]
    model = MODELS[name]
    if built:
        model = replace(model, stack=None)
    options = {o.name: o.choices[0] for o in model.options} | chosen
    count = 6
    values = columns(name, ranges, count, seed=len(case))
    system = stacked_system(model, options, values, count)
    roots = system.roots(BAND)
    energies, shapes = system.energies(roots.psi), system.shapes(roots.psi)
    assert not system.failures
    for row in range(count):
        point = point_of(model, options, values, row)
        prepared = prepare(point.assembly(), point.operating_point(), WHOLE)
        own = solve_point(prepared, point.state(), BAND)
        n = roots.count[row]
        lam = roots.lam[row, :n]
        np.testing.assert_allclose(lam, own.lam, rtol=1e-12)
        np.testing.assert_allclose(roots.error[row, :n], own.error_rung, rtol=0.5)
        np.testing.assert_allclose(energies[row, :, :n], own.energies, atol=1e-12)
        assert (roots.residual[row, :n] < 1e-14).all()
        seen = own.shapes @ prepared.sensor_shapes.T
        mac = np.abs(np.einsum("ij,ij->i", shapes[row, :n].conj(), seen))
        np.testing.assert_allclose(mac, 1.0, atol=1e-5)
        state, contact = own.working_point, system.sliding
        scale = np.abs(state.contact_pressure).max()
        error = np.abs(contact.pressure[row] - state.contact_pressure).max()
        assert error < 1e-12 * scale
        assert contact.open_share[row] == state.open_share


@given(
    friction=st.floats(0.0, 0.95),
    ratio=st.floats(1.0001, 2.0),
    size=st.sampled_from([1, 2, 7]),
)
@settings(max_examples=30, deadline=None)
def test_hulten_has_its_closed_form(friction, ratio, size):
    f1, f2 = 75.0 * ratio, 75.0
    values = MODELS["hulten"].defaults() | {
        "friction": np.full(size, friction),
        "frequency_1": f1,
        "frequency_2": np.full(size, f2),
    }
    options = {o.name: o.choices[0] for o in MODELS["hulten"].options}
    roots = stacked_system(MODELS["hulten"], options, values, size).roots(BAND)
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    K = np.array([[w1**2, -friction * w2**2], [friction * w1**2, w2**2]])
    own = np.sqrt(np.linalg.eigvals(K).astype(complex))
    expected = np.sort_complex(np.where(own.imag >= 0, 1j * own.conj(), 1j * own))
    coalescing = abs(friction - abs(f1**2 - f2**2) / (2 * f1 * f2)) < 1e-3
    for row in range(size):
        assert roots.count[row] == 2
        found = roots.lam[row]
        growing, largest = found.real.max(), expected.real.__abs__().max()
        assert abs(growing - largest) <= (20.0 if coalescing else 1e-6 * w1)
        np.testing.assert_allclose(
            np.sort(found.imag), np.sort(expected.imag), rtol=1e-2 if coalescing else 1e-9
        )


@given(st.integers(1, 9), st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_roots_are_those_of_the_companion_form(n, seed):
    rng = np.random.default_rng(seed)
    m = 5
    A = rng.standard_normal((m, n, n))
    K = 1e4 * (A @ A.swapaxes(1, 2) + 0.3 * rng.standard_normal((m, n, n)))
    C = rng.standard_normal((m, n, n)) + 3.0 * np.eye(n)
    found = stacked_roots(C, K, (1e-3, 1e6))
    for row in range(m):
        whole = np.block([[np.zeros((n, n)), np.eye(n)], [-K[row], -C[row]]])
        own = np.linalg.eigvals(whole)
        own = own[own.imag >= 0]
        lam = found.lam[row, : found.count[row]]
        assert len(lam) == len(own)
        distance = np.abs(lam[:, None] - own).min(axis=1)
        assert (distance <= 1e3 * found.error[row, : len(lam)] + 1e-9 * np.abs(lam)).all()
        psi = found.psi[row, :, : len(lam)]
        R = psi * lam**2 + C[row] @ psi * lam + K[row] @ psi
        assert (np.linalg.norm(R, axis=0) < 1e-9 * np.linalg.norm(K[row])).all()


def test_a_failing_point_is_its_own_row():
    model = MODELS["hulten"]
    options = {o.name: o.choices[0] for o in model.options}
    values = model.defaults() | {
        "mass": np.array([1.0, 1e308, 1.0]),
        "stiffness_damping": np.array([0.0, 0.0, 1e308]),
        "friction": 0.5,
    }
    system = stacked_system(model, options, values, 3)
    assert set(system.failures) == {1, 2}
    roots = system.roots(BAND)
    assert roots.count.tolist() == [2, 0, 0]
    alone = stacked_system(model, options, model.defaults() | {"friction": 0.5}, 1).roots(BAND)
    np.testing.assert_array_equal(roots.lam[0], alone.lam[0])


def test_lost_contact_is_a_status():
    model = MODELS["hoffmann"]
    options = {o.name: o.choices[0] for o in model.options} | {"contact_law": "unilateral"}
    # friction carries the mass off the belt where the springs are weak and steep
    values = model.defaults() | {"friction": np.array([0.3, 5.0]), "alpha1": 100.0, "k1": 1e6}
    system = stacked_system(model, options, values, 2)
    for row in range(2):
        point = point_of(model, options, values, row)
        status = "ok"
        try:
            prepare(point.assembly(), point.operating_point(), WHOLE)
        except ConvergenceError as error:
            status = error.status
        assert system.failures.get(row, ("ok", ""))[0] == status


def test_a_mode_that_is_not_there_is_told():
    model = MODELS["hulten"]
    options = {o.name: o.choices[0] for o in model.options}
    values = model.defaults() | {"modes[3].damping_ratio": 0.1}
    with pytest.raises(ParameterError, match="modes 1 to 2"):
        stacked_system(model, options, values, 1)


def test_a_mass_that_is_not_definite_fails_its_point_alone():
    """Positive on its diagonal and not definite: LAPACK refuses the batch, not other points."""
    text = study_text("bad", "complex_modes", "hulten")
    text += '[[sweep]]\nparameter = "mass"\nvalues = [1.0, 2.0, 3.0]\n'
    plan = plan_of(text)
    model, original = plan.study.model, plan.study.model.stack

    def stack(options, values):
        made = original(options, values)
        M = np.array(made.M)
        M[np.atleast_1d(values["mass"]) == 2.0] = np.array([[1.0, 2.0], [2.0, 1.0]])
        return replace(made, M=M)

    object.__setattr__(model, "stack", stack)
    try:
        (task,) = KIND.tasks(plan, plan.tasks, WORKERS)
        rows = solve_chunk(KIND, task).table
    finally:
        object.__setattr__(model, "stack", original)
    assert rows["status"].to_pylist() == ["ok", "failed", "ok"]
    assert [len(x) for x in rows["re"].to_pylist()] == [2, 0, 2]


def build_elastic(options, values):
    """Two elastic bodies in space-like coordinates: friction across, gaps, damping, springs."""
    rng = np.random.default_rng(5)

    def body(name, n):
        A, B = rng.standard_normal((2, n, n))
        M = values["mass"] * (A @ A.T + n * np.eye(n))
        K = 1e7 * (B @ B.T)
        C = 20.0 * np.diag(rng.uniform(0.5, 1.5, n))
        return Component(name, *(sp.csr_matrix(X) for X in (M, K)), C=sp.csr_matrix(C))

    parts = (body("disc", 3), body("pad", 4))
    rows = [sp.csr_matrix(rng.standard_normal((3, 7))) for _ in range(3)]
    contact = ContactInterface(
        *rows,
        area=np.array([1e-4, 2e-4, 1.5e-4]),
        gap0=np.array([0.0, 1e-6, 2e-6]),
        radius=np.ones(3),
        law=contact_law("exponential"),
        frictional=np.array([1.0, 1.0, 0.0]),
        speed_factor=np.array([1.0, 0.8, 1.0]),
    )
    B = sp.csr_matrix(np.eye(7) + 0.1 * rng.standard_normal((7, 7)))
    ground = SpringInterface("ground", B, np.full(7, 3e6))
    piston = SpringInterface("piston", sp.csr_matrix(np.eye(7)[:1]), np.array([2e6]), False)
    load = -rows[0].toarray().sum(axis=0) * 1e-4
    return Assembly(parts, contact, (ground, piston), load, 0.1 * load * 1e5)


ELASTIC = ModelDefinition(
    name="elastic",
    description="two elastic bodies",
    options=(CONTACT_OPTION, FRICTION_OPTION),
    declared=(
        FRICTION,
        PRESSURE,
        SLIDING_SPEED,
        DAMPING,
        STIFFNESS_DAMPING,
        friction_parameters,
        contact_parameters,
        *structural((("mass", 1.0, "kg", "of both"),)),
    ),
    components=("disc", "pad"),
    build=build_elastic,
)


def test_elastic_bodies_with_all_terms():
    """What minimal models lack: friction across, gaps, own damping, changed component modes."""
    count, rng = 6, np.random.default_rng(3)
    options = {"contact_law": "exponential", "friction_law": "exponential_fall"}
    values = ELASTIC.defaults() | {
        "friction": rng.uniform(0.1, 0.6, count),
        "pressure": rng.uniform(3e5, 2e6, count),
        "sliding_speed": rng.choice([-1.0, 1.0], count) * rng.uniform(0.02, 0.1, count),
        "friction_law.static_ratio": 1.4,
        "damping_ratio": rng.uniform(0.0, 0.02, count),
        "stiffness_damping": rng.uniform(0.0, 1e-6, count),
        "mass": rng.choice([0.5, 1.0], count),
        "pad.modes[3].frequency_scale": rng.uniform(0.8, 1.2, count),
        "disc.modes[2].damping_ratio": rng.uniform(0.0, 0.05, count),
        "modes[4].damping_ratio": rng.uniform(0.0, 0.05, count),
    }
    system = stacked_system(ELASTIC, options, values, count)
    assert not system.failures
    band = (1.0, 1e5)
    roots = system.roots(band)
    energies = system.energies(roots.psi)
    for row in range(count):
        point = point_of(ELASTIC, options, values, row)
        prepared = prepare(point.assembly(), point.operating_point(), WHOLE)
        own = solve_point(prepared, point.state(), band)
        n = roots.count[row]
        assert n == len(own.lam) == 7
        np.testing.assert_allclose(roots.lam[row, :n], own.lam, rtol=1e-9)
        np.testing.assert_allclose(energies[row, :, :n], own.energies, atol=1e-7)
        error = np.log(roots.error[row, :n] / own.error_rung)
        assert np.abs(error).max() < np.log(3.0)
        pressure = own.working_point.contact_pressure
        np.testing.assert_allclose(system.sliding.pressure[row], pressure, rtol=1e-9)


def test_conditions_are_those_point_by_point():
    """Beside a coalescence, where errors are more than the floor of round-off."""
    friction = 0.2916666 + np.array([0.0, 1e-9, 5e-8])
    K = np.array([[[4.0, -3.0 * mu * 2], [1.5 * mu * 2, 3.0]] for mu in friction]) * 1e5
    K = np.concatenate([K, np.array([[[1.0, 1.0], [0.0, 1.0 + 1e-9]]]) * 1e5])
    C = np.zeros_like(K)
    found = stacked_roots(C, K, (1e-3, 1e6))
    kept = found.held
    own = conditions(found.lam, found.psi, kept)
    for row in range(len(K)):
        lam, psi = found.lam[row, kept[row]], found.psi[row][:, kept[row]]
        alone = root_error.conditions(lam, psi, np.ones(2))
        round_off = EPS * alone**2  # of the inverse of a Gram matrix, whose condition is the square
        assert (np.abs(own[row, kept[row]] / alone - 1.0) < 1e-6 + round_off).all()
        told = root_error.root_errors(np.eye(2), C[row], K[row], lam, psi).error
        told = np.maximum(told, 1e-13 * np.abs(lam))
        assert (np.abs(found.error[row, kept[row]] / told - 1.0) < 1e-6 + round_off).all()
    assert own.max() > 1e3
