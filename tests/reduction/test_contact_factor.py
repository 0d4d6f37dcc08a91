"""Solves by one symmetric factor and the contact's low rank, against a factor of each matrix."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from blocks import OPERATING as BLOCKS_OPERATING
from blocks import blocks
from conftest import CUTOFF, NOMINAL, TOP

from squealstudy.errors import ConvergenceError
from squealstudy.kinds.complex_modes import full_order_check
from squealstudy.linalg.factor import factorise
from squealstudy.linalg.sparse_qep import WoodburyFactor
from squealstudy.models.operating import DesignState
from squealstudy.modes.full_order import contact_factor
from squealstudy.modes.full_order.contact_factor import ContactFactor, HeldStiffness
from squealstudy.modes.full_order.modes import (
    full_order_roots,
    full_order_system,
    stiffness_residuals,
)
from squealstudy.reduction.contact_space import ContactRows, contact_space
from squealstudy.reduction.working_point import working_point

BAND = (2 * np.pi * 500.0, 2 * np.pi * TOP)
CHANGED = {("caliper", 8): 1.25, ("disc", 9): 0.8}
CHANGED_STATE = DesignState(
    replace(NOMINAL, friction=0.6),
    CHANGED,
    damping_ratio=0.005,
    assembly_damping={12: 0.03},
    stiffness_damping=1.5e-7,
)
STATES = {
    "strong friction": DesignState(replace(NOMINAL, friction=0.7, brake_pressure=3e6)),
    "partly open": DesignState(replace(NOMINAL, friction=0.5, brake_pressure=2e4)),
}


@pytest.fixture(scope="module")
def held(least_brake):
    """With a contact that is far stiffer than that of any state."""
    return HeldStiffness.of(least_brake.assembly, 3.0 * least_brake.space.k_c)


def systems(least_brake, state, held):
    """Without the held stiffness, and with it."""
    point = working_point(least_brake.space, state.operating)
    given = (least_brake.assembly, least_brake.modes, point, state, CUTOFF)
    return full_order_system(*given), full_order_system(*given, held)


@pytest.mark.parametrize("name", STATES)
def test_solves_are_those_of_a_factor_of_the_matrix(least_brake, held, name):
    plain, system = systems(least_brake, STATES[name], held)
    assert abs(plain.K.sparse - system.K.sparse).max() == 0.0
    A = system.K.sparse
    assert system.factor.A is A
    assert system.factor.plain_error < 1e-12
    assert system.factor.lean() == system.factor.solve_once
    b = np.random.default_rng(0).standard_normal((least_brake.assembly.n_dof, 5))
    expected = factorise(A).solve(b)
    for solve in (system.factor.solve, system.factor.solve_once):
        np.testing.assert_allclose(solve(b), expected, atol=1e-9 * np.abs(expected).max())
    x = system.factor.solve(b[:, 0] + 1j * b[:, 1])
    np.testing.assert_allclose(
        x, expected[:, 0] + 1j * expected[:, 1], atol=1e-10 * np.abs(expected).max()
    )


@pytest.mark.full_size
def test_roots_with_changed_and_damped_modes_are_those_of_a_factor_of_the_matrix(least_brake, held):
    plain, system = systems(least_brake, CHANGED_STATE, held)
    b = np.random.default_rng(0).standard_normal(least_brake.assembly.n_dof)
    x = WoodburyFactor(system.K, factor=system.factor).solve(b)  # component modes have rows of U
    np.testing.assert_allclose(system.K @ x, b, atol=1e-8 * np.abs(b).max())
    np.testing.assert_allclose(system.omega, plain.omega, rtol=1e-9)
    found, expected = full_order_roots(system, BAND), full_order_roots(plain, BAND)
    assert len(found.lam) == len(expected.lam) > 5
    assert found.n_below == expected.n_below
    apart = np.abs(found.lam - expected.lam)
    assert (apart <= found.error + expected.error).all()
    assert (apart < 1e-8 * np.abs(found.lam)).all()
    assert stiffness_residuals(plain, found.lam, found.psi).max() < 1e-8


def test_meshes_that_do_not_match():
    assembly, state = blocks(), DesignState(replace(BLOCKS_OPERATING, friction=0.6))
    point = working_point(
        contact_space(assembly, 1e11, np.zeros((assembly.n_dof, 0))), state.operating
    )
    system = full_order_system(assembly, {}, point, state, CUTOFF, HeldStiffness.of(assembly, 1e9))
    b = np.random.default_rng(0).standard_normal(assembly.n_dof)
    x = system.factor.solve(b)
    np.testing.assert_allclose(system.K @ x, b, atol=1e-8 * np.abs(b).max())


def test_solves_that_lose_too_much_are_refined(monkeypatch, least_brake, held):
    _, system = systems(least_brake, STATES["strong friction"], held)
    monkeypatch.setattr(contact_factor, "MAX_UNREFINED_BACKWARD_ERROR", 0.0)
    assert system.factor.lean() == system.factor.solve


def test_it_goes_to_other_processes(least_brake, held):
    _, system = systems(least_brake, STATES["strong friction"], held)
    b = np.random.default_rng(0).standard_normal(least_brake.assembly.n_dof)
    again = pickle.loads(pickle.dumps(system.factor))
    np.testing.assert_allclose(again.solve(b), system.factor.solve(b), rtol=1e-6, atol=1e-18)


def test_a_singular_stiffness_is_refused():
    """A spring of 2 N/m that is all contact, and no contact left."""
    one = sp.identity(1, format="csr")
    rows = ContactRows(one, one, np.array([0]), np.eye(1), np.array([0]))
    held = HeldStiffness(np.array([2.0]), factorise(2.0 * one), rows, 0.5 * np.eye(1), np.zeros(1))
    with pytest.raises(ConvergenceError) as caught:
        ContactFactor(replace(held, C_TN=0.5 * np.eye(1)), 0.0 * one, np.zeros(1), np.zeros(1))
    assert caught.value.status == "singular"
    open_half = ContactFactor(replace(held, C_TN=0.5 * np.eye(1)), one, np.ones(1), np.zeros(1))
    assert open_half.solve(np.ones(1)) == pytest.approx(1.0)


def test_large_models_hold_one_factor_for_all_points(monkeypatch, least_brake):
    """Of a structure; another one takes its place."""
    made, used = [], []
    held = HeldStiffness.of(least_brake.assembly, least_brake.space.k_c)
    monkeypatch.setattr(
        HeldStiffness, "of", staticmethod(lambda assembly, k: (made.append(k), held)[1])
    )
    monkeypatch.setattr(full_order_check, "_stiffness_by_structure", {})
    monkeypatch.setattr(
        full_order_check, "unreduced_assembly", lambda *_: (least_brake.assembly, {})
    )
    monkeypatch.setattr(full_order_check, "full_order_modes", lambda *given: used.append(given[-1]))
    settings = SimpleNamespace(damped_to=CUTOFF)

    def solve(structure):
        point = SimpleNamespace(structure=structure, state=lambda: DesignState(NOMINAL))
        full_order_check.solve_unreduced(None, point, settings, (500.0, TOP))

    solve("a")
    assert used == [None] or HeldStiffness.pays(least_brake.assembly)
    for backend, expected in (("superlu", []), ("pardiso", []), ("cholmod", ["a", "b"])):
        monkeypatch.setattr(contact_factor, "automatic_backend", lambda *_, b=backend, **__: b)
        made.clear()
        for structure in ("a", "a", "b"):
            solve(structure)
        assert len(made) == len(expected)
    assert used[-1] is held
    assert list(full_order_check._stiffness_by_structure) == ["b"]

    def refused(*_):
        raise ConvergenceError("singular", "not definite")

    monkeypatch.setattr(HeldStiffness, "of", staticmethod(refused))
    solve("c")  # by a factor of each matrix then
    assert used[-1] is None
    monkeypatch.setattr(full_order_check, "_built", {("b", False): (least_brake.assembly, {})})
    full_order_check.forget()
    assert not full_order_check._stiffness_by_structure
    assert not full_order_check._built
