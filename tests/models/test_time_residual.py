"""The linearisation judged by central differences of the unreduced residual in time.

The residual is written here, from the laws of the time domain's kernels at each contact point; no
tangent of them is used. Steps of the differences are halved until round-off: where the error falls
with the square of the step, extrapolation tells the limit, and how far to trust it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from own_blocks import write_blocks

from squealstudy.kernels.laws import contact_at, friction_at, law_row
from squealstudy.laws import FrictionLaw, contact_law, friction_curve
from squealstudy.models.assembly import Assembly
from squealstudy.models.components.build import build_assembly
from squealstudy.models.operating import DesignState, OperatingPoint
from squealstudy.modes.full_order.modes import full_order_system
from squealstudy.reduction.cmt import component_modes
from squealstudy.reduction.contact_space import contact_space
from squealstudy.reduction.working_point import WorkingPoint, working_point
from squealstudy.study.components import read_model

STEEP = 1e13  # N s/m3: slope of friction at zero sliding, saturated at all speeds here
FALLING = friction_curve(static_ratio=1.8, decay_speed=0.3)
FAST = OperatingPoint(0.4, 12e5, 0.5, contact_law(), FALLING)
SLOW = replace(FAST, brake_pressure=2e5, sliding_speed=-0.06, friction=0.55)  # in reverse
POINTS = {"fast": FAST, "slow": SLOW}
STEPS = 2.0 ** -np.arange(3, 14)  # of the speed of sliding, and of the depth of the contact law
TOP = 2e5  # Hz
TRUSTED = 1e-8  # relative: what extrapolation must reach for the test to mean something


@dataclass(frozen=True)
class Residual:
    """Forces of an assembly about steady sliding without those of inertia, in x and v = x'.

    Zero at rest. Layers and springs, contact and friction at each point as kernels have them;
    stiffness damping is that of elastic forces at x + beta v. `K` and `C` are linear
    ones beside them.
    """

    assembly: Assembly
    state: DesignState
    point: WorkingPoint
    K: np.ndarray | float = 0.0
    C: np.ndarray | float = 0.0

    def contact(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Forces of contact and friction (n_dof,)."""
        c, own = self.assembly.contact, self.state.operating
        law = law_row(own.law, FrictionLaw(own.friction, STEEP, own.curve))
        gap, late = self.point.gap + c.N @ x, self.point.gap + c.N @ self._late(x, v)
        along = own.sliding_speed * c.speed_factor + c.T @ v
        across = c.T_perp @ v
        force = np.zeros(self.assembly.n_dof)
        normal, t1, t2 = (np.zeros(c.n_points) for _ in range(3))
        for i in range(c.n_points):
            p, _ = contact_at(law, gap[i])
            normal[i], _ = contact_at(law, late[i])
            t1[i], t2[i], sticks = friction_at(law, c.frictional[i], p, along[i], across[i])
            assert not sticks
        force -= c.N.T @ (c.area * normal)
        return force - c.T.T @ (c.area * t1) - c.T_perp.T @ (c.area * t2)

    def _late(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return x + self.state.stiffness_damping * v

    def __call__(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The residual (n_dof,), N."""
        late = self._late(x, v)
        force = self.assembly.K_el @ late + self.contact(x, v)
        for spring in self.assembly.springs:
            force += spring.B.T @ (spring.stiffness * (spring.B @ late))
        return force + np.dot(self.K, late) + np.dot(self.C, v)


def extrapolated(difference: Callable[[float], np.ndarray]) -> tuple[np.ndarray, float, float]:
    """Limit of central differences over STEPS, its error and the order seen, both by themselves.

    Of each two steps Richardson's value; that with the least change to the next is taken.
    """
    rows = np.array([difference(h) for h in STEPS])
    better = (4 * rows[1:] - rows[:-1]) / 3
    size = np.abs(better[-1]).max()
    changes = np.abs(np.diff(better, axis=0)).max(axis=1) / size
    best = int(changes.argmin())
    falls = np.abs(np.diff(rows, axis=0)).max(axis=1)
    order = float(np.log2(falls[0] / falls[1]))
    return better[best + 1], float(changes[best]), order


def compared(residual, K, C, x):
    """Errors of K x and C x against differences of the residual, the differences' own, orders."""
    c, own = residual.assembly.contact, residual.state.operating
    depth = 1.0 / residual.state.operating.law.parameters[1]
    rest = np.zeros_like(x)
    slide = max(np.abs(c.T @ x).max(), np.abs(c.T_perp @ x).max())
    units = (
        depth / np.abs(c.N @ x).max(),
        abs(own.sliding_speed) * c.speed_factor.min() / slide,
    )
    found = []
    for A, unit, by_position in ((K, units[0], True), (C, units[1], False)):

        def difference(h, unit=unit, by_position=by_position):
            d = h * unit * x
            sides = [(s * d, rest) if by_position else (rest, s * d) for s in (1, -1)]
            up, down = (residual(*side) for side in sides)
            return (up - down) / (2 * h * unit)

        limit, error, order = extrapolated(difference)
        found.append((np.abs(A @ x - limit).max() / np.abs(limit).max(), error, order))
    return found


def judge(residual, system, shapes, round_off=1e-11):
    """K and C hold for every shape to three times what the differences err by themselves."""
    for x in shapes:
        for error, own, order in compared(residual, system.K, system.C, x):
            assert own < TRUSTED
            assert error < 3 * own + round_off
            assert order == pytest.approx(2.0, abs=0.35)


def shapes_of(assembly: Assembly, count: int) -> np.ndarray:
    """Motions (count, n_dof) that open, slide along and across, smooth over the contact."""
    rng = np.random.default_rng(11)
    c = assembly.contact
    rows = sp.vstack([c.N, c.T, c.T_perp])
    return (rows.T @ rng.standard_normal((rows.shape[0], count))).T


@pytest.fixture(scope="module")
def blocks(tmp_path_factory):
    """Blocks of solid elements that turn about an axis near them: sliding speeds of 1 to 3."""
    study = write_blocks(
        tmp_path_factory.mktemp("model"), ("point = [4.0, -100.0, 0.0]", "point = [4.0, -1.0, 0.0]")
    )
    assembly = build_assembly(read_model(study.parent / "blocks.toml").build.brake, FAST.law, {})
    assert np.ptp(assembly.contact.speed_factor) > 0.5
    return assembly


@pytest.mark.parametrize("name", list(POINTS))
def test_contact_and_friction_of_blocks(blocks, name):
    """Contact stiffness, friction that follows it, falls with speed and turns; layers, springs."""
    operating = POINTS[name]
    point = working_point(contact_space(blocks, 1e11, np.zeros((blocks.n_dof, 0))), operating)
    state = DesignState(operating)
    system = full_order_system(blocks, {}, point, state, 1e5)
    residual = Residual(blocks, state, point)
    judge(residual, system, shapes_of(blocks, 3))
    x = shapes_of(blocks, 1)[0]
    # what a term that is missing or of the wrong sign would do
    weights = system.weights
    for field in ("coupling", "across", "along"):
        named = system.structure.system
        wrong = weights._replace(**{field: 0.99 * getattr(weights, field)})
        _, C, K = named.sparse_matrices(wrong)
        errors = [row[0] for row in compared(residual, K, C, x)]
        assert max(errors) > 1e-6, field  # elastic forces of x, which bends elements, are large


KEYS = (("slider", 8), ("plate", 9))
DAMPERS = {KEYS[0]: 0.03, KEYS[1]: 0.02}


@pytest.mark.parametrize(
    "state",
    [
        DesignState(FAST, {KEYS[0]: 1.1}, DAMPERS, stiffness_damping=2e-8),
        DesignState(FAST, {}, DAMPERS, 0.01, {9: 0.04}, 2e-8),
    ],
    ids=["of components", "of the assembly"],
)
def test_structural_damping_of_blocks(blocks, state):
    """Stiffness damping, dampers and changes of component modes; modal damping of the assembly."""
    modes = component_modes(blocks, TOP)
    point = working_point(contact_space(blocks, 1e11, np.zeros((blocks.n_dof, 0))), FAST)
    system = full_order_system(blocks, modes, point, state, TOP)
    named = {c.name: c for c in blocks.components}
    n = blocks.n_dof
    changes, C = np.zeros((n, n)), np.zeros((n, n))
    for key, zeta in state.mode_damping.items():
        component, span = named[key[0]], blocks.slices[key[0]]
        w2, phi = la.eigh(component.K.toarray(), component.M.toarray())
        row = component.M @ phi[:, key[1] - 1]
        scale, omega = state.frequency_scale.get(key, 1.0), np.sqrt(w2[key[1] - 1])
        C[span, span] += 2 * zeta * scale * omega * np.outer(row, row)
        changes[span, span] += (scale * scale - 1) * omega**2 * np.outer(row, row)
    w2, phi = la.eigh(_stiffness(Residual(blocks, state, point)) + changes, blocks.M.toarray())
    ratios = np.full(n, state.damping_ratio)
    for mode, ratio in state.assembly_damping.items():
        ratios[mode - 1] = ratio
    coefficient = 2 * ratios * np.minimum(np.sqrt(w2), 2 * np.pi * TOP)
    rows = blocks.M @ phi
    C += (rows * coefficient) @ rows.T
    judge(Residual(blocks, state, point, changes, C), system, shapes_of(blocks, 2), 1e-9)


def _stiffness(residual: Residual) -> np.ndarray:
    """K (n, n) of a residual whose contact alone is not linear, by differences at the contact."""
    assembly = residual.assembly
    K = assembly.K_el.toarray()
    for spring in assembly.springs:
        K += (spring.B.T @ sp.diags(spring.stiffness) @ spring.B).toarray()
    law = law_row(residual.state.operating.law, FrictionLaw(0.0, STEEP, FALLING))
    h, c = 1e-4 / residual.state.operating.law.parameters[1], assembly.contact
    slope = [
        (contact_at(law, g - h)[0] - contact_at(law, g + h)[0]) / (2 * h)
        for g in residual.point.gap
    ]
    return K + (c.N.T @ sp.diags(c.area * slope) @ c.N).toarray()


@pytest.mark.parametrize("name", list(POINTS))
def test_contact_and_friction_of_the_brake(brake, name):
    """The same of the coarse generated brake, unreduced."""
    operating = replace(POINTS[name], law=brake.assembly.contact.law)
    point = working_point(brake.space, operating)
    state = DesignState(operating, stiffness_damping=1e-7)
    system = full_order_system(brake.assembly, {}, point, state, 6e3)
    judge(Residual(brake.assembly, state, point), system, shapes_of(brake.assembly, 1))
