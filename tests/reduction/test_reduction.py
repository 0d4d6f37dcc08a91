"""Component-mode reduction: the basis to round-off, its modes against the full-order brake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
import scipy.linalg as la
import scipy.sparse as sp
from blocks import OPERATING as BLOCKS_OPERATING
from blocks import blocks
from conftest import NOMINAL, TOP, prepare_brake, reduce_brake
from hypothesis import given
from hypothesis import strategies as st

from squealstudy.linalg.dense_qep import backward_error, dense_roots
from squealstudy.linalg.factor import solve_threads
from squealstudy.linalg.sparse_qep import LowRankSum, smallest_roots
from squealstudy.models.operating import DesignState
from squealstudy.reduction.cmt import ReductionSettings, component_modes, reduce_cmt
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.orthonormal import complete_basis
from squealstudy.reduction.prepared import (
    contact_stiffness,
    mean_contact_stiffness,
    mode_shapes,
    shape_column,
)
from squealstudy.reduction.working_point import working_point
from squealstudy.system.energies import energy_shares, reduced_energy_shares
from squealstudy.system.linearise import StructureWeights, component_frequencies, linearise

BAND = (2 * np.pi * 500.0, 2 * np.pi * TOP)
LOW = {"band": (BAND[0], 2 * np.pi * 2500.0), "least": 6}  # half of the band
FULL_SIZE_TOP = 8e3  # Hz


def test_two_threads_make_the_same_model_to_the_last_bit(brake):
    """Components are completed side by side."""
    low, made = ReductionSettings(1500.0, 1500.0, 1000.0), []
    for count in (1, 2):
        with solve_threads(count):
            made.append(reduce_cmt(brake.assembly, brake.modes, brake.point, low)[0])
    one, two = made
    assert one.n == two.n > 20
    for name in ("k_el", "K_springs", "N", "T"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


# -- the basis -----------------------------------------------------------------------------------
def test_mass_is_the_identity(brake, reduced):
    _, basis = reduced
    for component, T in zip(brake.assembly.components, basis.blocks, strict=True):
        assert np.abs(T.T @ (component.M @ T) - np.eye(T.shape[1])).max() <= 1e-12


def test_elastic_stiffness_is_diagonal(brake, reduced):
    model, basis = reduced
    ends = model.offsets[1:-1]
    parts = zip(brake.assembly.components, basis.blocks, np.split(model.k_el, ends), strict=True)
    for component, T, k in parts:
        K = T.T @ (component.K @ T)
        assert np.abs(K - np.diag(k)).max() <= 1e-12 * np.abs(k).max()


def test_component_modes_are_coordinates(brake, reduced):
    model, basis = reduced
    omega = component_frequencies(model)
    for name, T, start in zip(model.components, basis.blocks, model.offsets[:-1], strict=True):
        modes = brake.modes[name]
        np.testing.assert_array_equal(T[:, : len(modes.omega)], modes.phi)
        for j in range(7, len(modes.omega) + 1):
            assert model.mode_coordinate(name, j) == start + j - 1
            assert omega[name, j] == pytest.approx(modes.omega[j - 1], rel=1e-9)
    assert model.n == sum(T.shape[1] for T in basis.blocks)


@pytest.mark.parametrize("key", [("disc", 0), ("disc", 10_000), ("rotor", 7)])
def test_modes_that_the_basis_does_not_hold(reduced, key):
    with pytest.raises(KeyError):
        reduced[0].mode_coordinate(*key)


def test_observation_is_that_of_the_assembly(brake, reduced):
    model, basis = reduced
    x = np.random.default_rng(0).standard_normal(model.n)
    q, c = basis.expand(x), brake.assembly.contact
    for name in ("N", "T", "T_perp"):
        seen = getattr(c, name) @ q
        np.testing.assert_allclose(getattr(model, name) @ x, seen, atol=1e-12 * np.abs(seen).max())
    energy = q @ (brake.assembly.K_springs() @ q)
    assert x @ model.K_springs @ x == pytest.approx(energy, rel=1e-10)


def test_contact_stiffness_is_that_of_the_linearisation(brake, reduced):
    """Without friction; that of the reference is of a uniform pressure under both loads."""
    K = linearise(reduced[0], brake.point, DesignState(NOMINAL)).K_sym
    found = contact_stiffness(reduced[0], brake.point.tangent)
    np.testing.assert_allclose(found, K, atol=1e-12 * np.abs(K).max())
    both = replace(brake.assembly, constant_load=2e5 * brake.assembly.load)
    pressure = 14e5 * np.abs(brake.assembly.load).sum() / brake.assembly.contact.area.sum()
    stiffness = NOMINAL.law.value("contact.lambda") * pressure
    assert mean_contact_stiffness(both, NOMINAL) == pytest.approx(stiffness, rel=1e-12)


def test_energy_shares_where_contact_gives_way_sum_to_one():
    """Also of a mode of negative energy."""
    gone = StructureWeights(springs=0.0, normal=np.array([-2.0]))
    one = np.ones((1, 1))
    shares = energy_shares(one, one, one, gone, one + 0j)
    np.testing.assert_allclose(shares[:, 0], [-1.0, 2.0])


def test_energy_shares_do_not_depend_on_the_phase(reduced):
    """Those of a complex shape sum to one, whatever it is multiplied by."""
    model = reduced[0]
    weights = StructureWeights(mass=1.0, elastic=model.k_el, springs=1.0, normal=1e5 * model.area)
    psi = np.random.default_rng(1).standard_normal((model.n, 3, 2)).view(complex)[..., 0]
    shares = reduced_energy_shares(model, weights, psi)
    assert shares.shape == (len(model.components) + 1, 3)
    assert (shares > 0).all()
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-12)
    np.testing.assert_allclose(reduced_energy_shares(model, weights, 2j * psi), shares, rtol=1e-9)
    assert not any(StructureWeights())  # what is not named has no weight


def test_the_basis_holds_the_response_to_friction():
    """Of the modes below the cutoff of loads, to friction that follows their contact forces."""
    assembly = blocks()
    modes = component_modes(assembly, 2e3)
    space = contact_space(assembly, 1e11, mode_shapes(assembly, modes))
    point = working_point(space, BLOCKS_OPERATING)
    settings = ReductionSettings(2e3, 2e3, 0.0, tolerance=1e-6)
    small, basis = reduce_cmt(assembly, modes, point, settings)
    few = replace(settings, load_cutoff=1.001 * basis.omega[2] / (2 * np.pi))
    model, basis = reduce_cmt(assembly, modes, point, few)
    assert model.n > small.n
    c, phi = assembly.contact, basis.phi[:, :3]  # fewer than contact points
    follows, drag = (c.frictional * c.area * x for x in (point.tangent, point.contact_pressure))
    assert np.ptp(follows) > 0.1 * follows.max()
    loads = (
        c.T.T @ (follows[:, None] * (c.N @ phi)),
        c.T_perp.T @ (drag[:, None] * (c.T_perp @ phi)),
    )
    for load in loads:
        response = basis.factor.solve(load)
        for component, T in zip(assembly.components, basis.blocks, strict=True):
            own = response[assembly.slices[component.name]]
            left = own - T @ (T.T @ (component.M @ own))
            assert np.linalg.norm(left) < 1e-4 * np.linalg.norm(own)


def test_nominal_real_modes(brake, reduced):
    model, basis = reduced
    K_sym = linearise(model, brake.point, DesignState(NOMINAL)).K_sym
    omega = np.sqrt(la.eigvalsh(K_sym)[: len(basis.omega)])
    np.testing.assert_allclose(omega, basis.omega, rtol=1e-8)
    c = brake.assembly.contact
    K = brake.assembly.K_el + brake.assembly.K_springs()
    K = K + c.N.T @ sp.diags(c.area * brake.point.tangent) @ c.N
    R = K @ basis.phi - (brake.assembly.M @ basis.phi) * basis.omega**2
    assert np.linalg.norm(R, axis=0).max() < 1e-6 * np.linalg.norm(K @ basis.phi, axis=0).max()


# -- complex modes against the full-order brake --------------------------------------------------
def full_order(brake, point, state, band, n_roots):
    """Roots of the unreduced brake in the band, by THEORY.md eq. (17), residual checked."""
    k_n = brake.assembly.contact.area * point.tangent
    M, C, K = reference.linearised(brake.assembly, point.contact_pressure, k_n, state.operating)
    U, dk, dc = [], [], []
    masses = {c.name: c.M for c in brake.assembly.components}
    for name, j in {**state.frequency_scale, **state.mode_damping}:
        u = np.zeros(brake.assembly.n_dof)
        u[brake.assembly.slices[name]] = masses[name] @ brake.modes[name].phi[:, j - 1]
        omega = brake.modes[name].omega[j - 1]
        scale = state.frequency_scale.get((name, j), 1.0)
        U.append(u)
        dk.append((scale**2 - 1) * omega**2)
        dc.append(2 * state.mode_damping.get((name, j), 0.0) * scale * omega)
    low = np.array(U).reshape(len(U), brake.assembly.n_dof).T
    K_low, C_low = LowRankSum(K, low, np.array(dk)), LowRankSum(C, low, np.array(dc))
    lam, psi = smallest_roots(M, C_low, K_low, n_roots, band[1] / 2)
    assert np.abs(lam).max() > band[1]
    kept = (np.abs(lam) > band[0]) & (np.abs(lam) < band[1])
    assert reference.residuals(M, C_low, K_low, lam[kept], psi[:, kept]).max() < 1e-8
    return lam[kept]


def solve(brake, model, state, band):
    """Working point and roots of the reduced brake."""
    changes = state.stiffness_changes(component_frequencies(model))
    space = brake.space.changed({shape_column(model, *key): dk for key, dk in changes.items()})
    point = working_point(space, state.operating)
    system = linearise(model, point, state)
    lam, psi = dense_roots(system.C, system.K, (0.9 * band[0], 1.1 * band[1]))
    assert backward_error(system.C, system.K, lam, psi).max() < 1e-12
    return point, lam


def compare(brake, model, state, tolerance, band=BAND, least=12):
    """Every lightly damped full-order root has a reduced one of its own within tolerance."""
    point, lam = solve(brake, model, state, band)
    exact = full_order(brake, point, state, band, 7 * least)
    exact = exact[np.abs(exact.real) < 0.05 * np.abs(exact)]
    assert len(exact) > least
    nearest = np.abs(lam[None, :] - exact[:, None]).argmin(axis=1)
    assert len(set(nearest)) == len(exact)
    size, found = np.abs(exact), lam[nearest]
    np.testing.assert_allclose(np.abs(found), size, rtol=tolerance)
    zeta = -exact.real / size
    np.testing.assert_allclose(-found.real / np.abs(found), zeta, atol=tolerance)
    return zeta


def test_complex_modes_at_the_nominal_point(brake, reduced):
    zeta = compare(brake, reduced[0], DesignState(NOMINAL), 1e-5)
    assert zeta.min() < -1e-3  # it squeals


@pytest.mark.full_size
def test_complex_modes_at_low_pressure(brake, reduced):
    """By default with other changes: `..._shifted_up_and_damped`."""
    compare(brake, reduced[0], DesignState(replace(NOMINAL, brake_pressure=2e5)), 1e-3)


def test_complex_modes_at_high_pressure_with_caliper_modes_at_half(brake, reduced):
    shifted = {("caliper", j): 0.5 for j in (7, 8, 9)}
    compare(
        brake, reduced[0], DesignState(replace(NOMINAL, brake_pressure=30e5), shifted), 1e-3, **LOW
    )


def test_complex_modes_with_modes_shifted_up_and_damped(brake, reduced):
    state = DesignState(
        replace(NOMINAL, friction=0.3, sliding_speed=1.5, brake_pressure=2e5),
        frequency_scale={("caliper", j): 1.5 for j in (7, 8, 9)} | {("inner_pad", 7): 0.5},
        mode_damping={("caliper", 7): 0.1, ("outer_pad", 7): 0.05},
    )
    compare(brake, reduced[0], state, 1e-3)


@pytest.mark.full_size("medium brake")  # has a day apart from other long ones
def test_medium_brake():
    medium = prepare_brake("medium", FULL_SIZE_TOP)
    model, _ = reduce_brake(medium, FULL_SIZE_TOP)
    size = {"band": (BAND[0], 2 * np.pi * FULL_SIZE_TOP), "least": 20}
    compare(medium, model, DesignState(NOMINAL), 1e-5, **size)
    shifted = {("caliper", j): 1.5 for j in (7, 8, 9)}
    for state in (
        DesignState(replace(NOMINAL, brake_pressure=2e5), shifted),
        DesignState(replace(NOMINAL, brake_pressure=30e5), dict.fromkeys(shifted, 0.5)),
    ):
        compare(medium, model, state, 1e-3, **size)


def test_changes_are_diagonal_entries(brake, reduced):
    model = reduced[0]
    plain = linearise(model, brake.point, DesignState(NOMINAL))
    state = DesignState(NOMINAL, {("caliper", 8): 1.25}, {("caliper", 8): 0.1, ("disc", 9): 0.02})
    system = linearise(model, brake.point, state)
    omega = component_frequencies(model)
    i, j = model.mode_coordinate("caliper", 8), model.mode_coordinate("disc", 9)
    dK, dC = system.K - plain.K, system.C - plain.C
    w8, w9 = omega["caliper", 8], omega["disc", 9]
    assert dK[i, i] == pytest.approx((1.25**2 - 1) * w8**2, rel=1e-6)
    assert dC[i, i] == pytest.approx(2 * 0.1 * 1.25 * w8, rel=1e-9)
    assert dC[j, j] == pytest.approx(2 * 0.02 * w9, rel=1e-9)
    dK[i, i] = dC[i, i] = dC[j, j] = 0.0
    assert not dK.any()
    assert not dC.any()


def test_uniform_modal_damping(brake, reduced):
    model = reduced[0]
    calm = DesignState(replace(NOMINAL, friction=0.0), damping_ratio=0.02)
    system = linearise(model, brake.point, calm)
    lam, _ = dense_roots(system.C, system.K, BAND)
    np.testing.assert_allclose(-lam.real / np.abs(lam), 0.02, rtol=1e-6)
    omega = np.sqrt(la.eigvalsh(system.K_sym))
    inside = (omega > BAND[0]) & (omega < BAND[1])
    np.testing.assert_allclose(np.abs(lam), omega[inside], rtol=1e-9)


# -- orthonormalisation --------------------------------------------------------------------------
def pencil(n, seed):
    """A mass and a stiffness with two rigid modes, and all their modes."""
    rng = np.random.default_rng(seed)
    A, B = rng.standard_normal((2, n, n))
    M, K = A @ A.T + n * np.eye(n), B[:, 2:] @ B[:, 2:].T * 1e6
    return sp.csr_matrix((M + M.T) / 2), sp.csr_matrix((K + K.T) / 2), la.eigh(K, M)[1]


def check_basis(M, K, phi, T, k):
    assert np.abs(T.T @ (M @ T) - np.eye(T.shape[1])).max() < 1e-11
    off = T.T @ (K @ T) - np.diag(k)
    assert np.abs(off).max() < 1e-11 * max(np.abs(K).max(), 1.0)
    np.testing.assert_array_equal(T[:, : phi.shape[1]], phi)
    assert T.shape[1] <= M.shape[0]
    assert len(k) == T.shape[1]


@given(
    n=st.integers(3, 20),
    kept=st.floats(0, 1),
    copies=st.lists(st.floats(-9, 0), min_size=0, max_size=6),
    seed=st.integers(0, 10_000),
)
def test_basis_of_near_dependent_traces(n, kept, copies, seed):
    M, K, modes = pencil(n, seed)
    phi = np.ascontiguousarray(modes[:, : round(kept * n)])
    rng = np.random.default_rng(seed + 1)
    traces = rng.standard_normal((n, 2))
    copied = [traces[:, 0] + 10.0**e * rng.standard_normal(n) for e in copies]
    traces = np.column_stack([traces, *copied, np.zeros(n), 1e-3 * traces[:, 1], phi[:, :1]])
    T, k = complete_basis(M, K, phi, [(traces, 1e-6), (2 * traces, 1e-4)])
    check_basis(M, K, phi, T, k)
    left = traces - T @ (T.T @ (M @ traces))  # all but what the tolerance drops is spanned
    size = np.sqrt(np.einsum("ij,ij->", traces, M @ traces))
    assert np.sqrt(np.abs(np.einsum("ij,ij->", left, M @ left))) < 1e-5 * size


def test_traces_inside_the_modes_add_nothing():
    M, K, modes = pencil(6, 0)
    phi = np.ascontiguousarray(modes[:, :3])
    inside = phi @ np.random.default_rng(1).standard_normal((3, 5))
    for traces in (inside, np.zeros((6, 4)), np.zeros((6, 0))):
        T, k = complete_basis(M, K, phi, [(traces, 1e-6)])
        check_basis(M, K, phi, T, k)
        assert T.shape[1] == 3


def test_complete_modes_leave_no_room_for_noise():
    M, K, modes = pencil(6, 0)
    traces = np.random.default_rng(1).standard_normal((6, 5))
    T, k = complete_basis(M, K, modes, [(traces, 1e-6)])
    check_basis(M, K, modes, T, k)
    assert T.shape == (6, 6)


def test_small_independent_trace_is_kept_or_dropped_by_the_tolerance():
    M, K, modes = pencil(8, 3)
    phi, rest = np.ascontiguousarray(modes[:, :3]), modes[:, 3:]
    traces = np.column_stack([rest[:, 0], rest[:, 0] + 1e-4 * rest[:, 1]])
    for tolerance, width in ((1e-6, 5), (1e-3, 4)):
        T, k = complete_basis(M, K, phi, [(traces, tolerance)])
        check_basis(M, K, phi, T, k)
        assert T.shape[1] == width
