"""Steady sliding of a batch: Newton in the gaps of all design points at once.

The equations are those of `reduction.working_point` (THEORY.md eq. (13), (14)). A design point
without a solution gets a state that says so, and the others continue.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from squealstudy.laws.corners import balanced_at_a_corner
from squealstudy.laws.spring import at_a_corner, engaged, spring_error
from squealstudy.reduction.contact_space import UNSUPPORTED_REL_ERROR
from squealstudy.reduction.working_point import (
    AMPLIFIED,
    GIVEN_WAY,
    MAX_ITERATIONS,
    MAX_STEP,
    OPEN,
    TOLERANCE,
    presses_open,
)
from squealstudy.stacked.operating import StackedOperating
from squealstudy.stacked.structures import StackedStructures

# codes of StackedSliding.state
SOLVED, SINGULAR, NO_EQUILIBRIUM, SPRING_TOUCHES, CONTACT_TOUCHES, BEYOND_LAW = range(6)
SMALLEST_POSITIVE = 1e-300


@dataclass(frozen=True, eq=False)
class StackedSliding:
    """Contact states at steady sliding, with a row for each design point.

    Attributes
    ----------
    gap, pressure, tangent : ndarray (m, c)
        Gaps [m], contact pressures [Pa] and tangents -dp/dg [Pa/m].
    residual, open_share, tangent_error : ndarray (m,)
        As in `WorkingPoint`.
    state : ndarray (m,) of int
        SOLVED, SINGULAR where some motion is free, NO_EQUILIBRIUM where Newton finds none,
        SPRING_TOUCHES and CONTACT_TOUCHES where a spring or contact point just touches,
        BEYOND_LAW where an open gap presses.
    """

    gap: np.ndarray
    pressure: np.ndarray
    tangent: np.ndarray
    residual: np.ndarray
    open_share: np.ndarray
    tangent_error: np.ndarray
    state: np.ndarray


@dataclass(frozen=True, eq=False)
class GapEquations:
    """The gap equations of m design points.

    Attributes
    ----------
    by_normal, by_sliding : ndarray (m, c, c)
        Opening of the gaps by unit normal forces, and closing by unit friction forces, m/N.
    by_load : ndarray (m, c)
        Opening by the loads, m.
    k_c : ndarray (m, 1), or (m, c) with springs
        Contact stiffness per area with which these compliances are computed, Pa/m.
    area : ndarray (m, c)
        Areas of the contact points, m2.
    moved : ndarray (m, n, 2 c + 1)
        Displacements by a unit normal force and a unit force along T at each contact point, and by
        the loads.
    load_travel : ndarray (m, c)
        Sizes of the terms of `by_load`, m.
    springs : ndarray (m, ns, 5)
        Numbers of the last points, which are springs (laws/spring.py).
    """

    structures: StackedStructures
    operating: StackedOperating
    by_normal: np.ndarray
    by_sliding: np.ndarray
    by_load: np.ndarray
    k_c: np.ndarray
    area: np.ndarray
    moved: np.ndarray
    load_travel: np.ndarray
    springs: np.ndarray

    @property
    def touching(self) -> slice:
        """The points that are contact, not springs."""
        return slice(self.area.shape[1] - self.springs.shape[1])

    def at(self, rows: np.ndarray) -> GapEquations:
        """The equations of some design points; the structures stay as they are."""
        return GapEquations(
            structures=self.structures,
            operating=self.operating.at(rows),
            by_normal=self.by_normal[rows],
            by_sliding=self.by_sliding[rows],
            by_load=self.by_load[rows],
            k_c=self.k_c[rows],
            area=self.area[rows],
            moved=self.moved[rows],
            load_travel=self.load_travel[rows],
            springs=self.springs[rows],
        )


def steady_sliding(
    structures: StackedStructures, k_el: np.ndarray, operating: StackedOperating
) -> StackedSliding:
    """Contact states of m design points.

    Parameters
    ----------
    structures : StackedStructures
        m structures, or one for all design points.
    k_el : ndarray (m, n)
        Elastic stiffness with the changes of component modes, (rad/s)^2.
    operating : StackedOperating
    """
    return _newton(*gap_equations(structures, k_el, operating))


def gap_equations(
    structures: StackedStructures, k_el: np.ndarray, operating: StackedOperating
) -> tuple[GapEquations, np.ndarray]:
    """The gap equations, and at which design points (m,) the static stiffness is regular.

    Arguments are those of `steady_sliding`.
    """
    m = len(operating.friction)
    area = np.broadcast_to(structures.area, (m, structures.N.shape[1]))
    # (m, n, 2), rad/s^2 sqrt(kg) m: both loads, and that by the brake pressure
    by_pressure = structures.load[..., 0] * operating.pressure[:, None]
    load = np.stack([by_pressure + structures.load[..., 1], by_pressure], axis=2)
    springs = structures.spring_points
    springs = np.broadcast_to(springs, (m, *springs.shape[1:]))
    touching = area[:, : area.shape[1] - springs.shape[1]]
    mean_pressure = _mean_pressure_of_loads(structures, operating, touching)
    k_c = operating.contact(operating.gap_at(mean_pressure)[:, None])[1][:, :1]
    if springs.shape[1]:
        k_c = np.concatenate([np.repeat(k_c, touching.shape[1], axis=1), springs[:, :, 0]], axis=1)
    K0 = np.zeros((m, structures.n, structures.n)) + structures.static_springs
    K0 = K0 + structures.N.swapaxes(1, 2) @ ((area * k_c)[:, :, None] * structures.N)
    K0[:, np.arange(structures.n), np.arange(structures.n)] += k_el
    right = np.concatenate(
        np.broadcast_arrays(structures.N.swapaxes(1, 2), structures.T.swapaxes(1, 2)), axis=2
    )
    columns = np.concatenate([np.broadcast_to(right, (m, *right.shape[1:])), load], 2)
    responses, is_regular = _solved(K0, columns)
    opened = structures.N @ responses
    c = area.shape[1]
    equations = GapEquations(
        structures=structures,
        operating=operating,
        by_normal=opened[:, :, :c],
        by_sliding=opened[:, :, c : 2 * c],
        by_load=opened[:, :, 2 * c],
        k_c=k_c,
        area=area,
        moved=responses[..., :-1],
        load_travel=_load_travel(structures.N, responses[..., -2], responses[..., -1]),
        springs=springs,
    )
    return equations, is_regular


def _load_travel(N: np.ndarray, both: np.ndarray, by_pressure: np.ndarray) -> np.ndarray:
    """Sizes (m, c) [m] of the terms of openings by both loads, of movements (m, n) by them.

    The brake pressure and constant loads may leave nothing of each other.
    """
    return _times(np.abs(N), np.abs(by_pressure) + np.abs(both - by_pressure))


def _mean_pressure_of_loads(
    structures: StackedStructures, operating: StackedOperating, area: np.ndarray
) -> np.ndarray:
    """Pressure (m,) [Pa]: sum of nodal forces over the contact area, for the stiffness k_c."""
    back = np.linalg.inv(structures.phi).swapaxes(1, 2)
    forces = back @ structures.load  # (m, n, 2), N/Pa and N
    force = np.abs(forces[..., 0] * operating.pressure[:, None] + forces[..., 1]).sum(axis=1)
    mean: np.ndarray = np.maximum(force / area.sum(axis=1), SMALLEST_POSITIVE)
    return mean


def _solved(K0: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K0^-1 columns (m, n, k), and which (m,) are accurate: other K0 are nearly singular."""
    finite = np.isfinite(K0).all(axis=(1, 2)) & np.isfinite(columns).all(axis=(1, 2))
    K0 = np.where(finite[:, None, None], K0, np.eye(K0.shape[1]))
    columns = np.where(finite[:, None, None], columns, 0.0)
    b = np.random.default_rng(0).standard_normal((K0.shape[1], 1))
    sides = np.concatenate([columns, np.broadcast_to(b, (len(K0), *b.shape))], axis=2)
    try:
        solutions = np.linalg.solve(K0, sides)
    except np.linalg.LinAlgError:
        solutions = np.full(sides.shape, np.nan)
        for i, (K, B) in enumerate(zip(K0, sides, strict=True)):
            try:
                solutions[i] = np.linalg.solve(K, B)
            except np.linalg.LinAlgError:
                continue
    with np.errstate(invalid="ignore", over="ignore"):
        wrong = np.linalg.norm((K0 @ solutions[..., -1:] - b)[..., 0], axis=1)
        is_accurate = finite & (wrong < UNSUPPORTED_REL_ERROR * np.linalg.norm(b))
    return np.where(is_accurate[:, None, None], solutions[..., :-1], 0.0), is_accurate


def _newton(equations: GapEquations, is_regular: np.ndarray) -> StackedSliding:
    """Solve the gap equations of all design points by Newton's method."""
    structures, operating, area = equations.structures, equations.operating, equations.area
    m, c = area.shape
    gap0 = np.broadcast_to(structures.gap0, (m, c))
    touching, springs = equations.touching, equations.springs
    contact_area = area[:, touching]
    stiffness = np.abs(equations.k_c * equations.by_load)[:, touching]
    loaded = (contact_area * stiffness).sum(axis=1) / contact_area.sum(axis=1)
    loaded = np.maximum(loaded, SMALLEST_POSITIVE)
    estimate = np.maximum(loaded, _closing_pressure(equations))
    largest_opening = np.abs(equations.by_load).max(axis=1)
    gap = np.repeat(operating.gap_at(estimate)[:, None], c, axis=1)
    first_spring = c - springs.shape[1]
    opened = (gap0 + equations.by_load)[:, first_spring:]
    gap[:, first_spring:] = engaged(opened, springs)
    state = np.where(is_regular, NO_EQUILIBRIUM, SINGULAR)
    open_rows = np.flatnonzero(is_regular)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(MAX_ITERATIONS):
            if not len(open_rows):
                break
            part = equations.at(open_rows)
            g, areas = gap[open_rows], part.area[:, touching]
            rows = PointRows(part, gap0[open_rows], open_rows)
            F, p, kappa = rows.imbalance(g)
            step = -rows.newton(F, p, kappa)
            mean = np.abs((areas * p[:, touching]).sum(axis=1) / areas.sum(axis=1))
            pressure = np.maximum(estimate[open_rows], mean)
            share = _damping(part.operating, pressure, g[:, touching], step[:, touching])
            g = g + share[:, None] * step
            F, p, kappa = rows.imbalance(g)
            relative = np.abs(F).max(axis=1) / (
                largest_opening[open_rows] + np.abs(g).max(axis=1) + SMALLEST_POSITIVE
            )
            scale = part.operating.gap_scale(pressure)
            small = np.abs(step[:, touching]).max(axis=1) / scale < TOLERANCE**0.5
            done = (share == 1.0) & small & (relative < TOLERANCE)
            if done.any():  # one more step, which leaves round-off only
                g[done] = (g - rows.newton(F, p, kappa))[done]
            gap[open_rows] = g
            state[open_rows[done]] = SOLVED
            lost = ~np.isfinite(step).all(axis=1)
            open_rows = open_rows[~done & ~lost]
        all_rows = PointRows(equations, gap0, np.arange(m))
        F, p, kappa = all_rows.imbalance(gap)
        movement = largest_opening + np.abs(gap).max(axis=1) + SMALLEST_POSITIVE
        residual = np.abs(F).max(axis=1) / movement
        of_contact = (x[:, touching] for x in (gap, p, kappa))
        solved = state == SOLVED
        state[solved & presses_open(*of_contact)] = BEYOND_LAW
        state[solved & _contact_at_corner(equations, gap0, gap)] = CONTACT_TOUCHES
        state[solved & at_a_corner(gap, springs)] = SPRING_TOUCHES
    return StackedSliding(
        gap=gap,
        pressure=p,
        tangent=kappa,
        residual=residual,
        open_share=_open_share(contact_area, p[:, touching], loaded),
        tangent_error=_tangent_error(area, p, kappa, F, spring_error(gap, F, springs)),
        state=state,
    )


def _contact_at_corner(e: GapEquations, gap0: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Which design points (m,) have contact balanced where its tangent jumps, at gaps (m, c)."""
    size = sum(np.abs(x).max(axis=1, initial=0.0) for x in (e.load_travel, gap0, gap))
    touching = e.touching
    return balanced_at_a_corner(
        lambda g: e.operating.contact(g)[1], gap[:, touching], size, e.area[:, touching]
    )


def _closing_pressure(equations: GapEquations) -> np.ndarray:
    """Pressure (m,) [Pa] that closes mean openings and preloaded gaps, as in `working_point`."""
    touching = equations.touching
    area = equations.area[:, touching]
    by_normal = equations.by_normal[:, touching, touching]
    unit = np.abs((area * _times(by_normal, area)).sum(axis=1))
    with np.errstate(over="ignore", invalid="ignore"):
        opened = np.abs((area * equations.by_load[:, touching]).sum(axis=1))
        preloaded = np.maximum(-equations.structures.gap0[:, touching], 0.0)
        closing = opened + (area * preloaded).sum(axis=1)
        closing = closing / np.maximum(unit, SMALLEST_POSITIVE)
    # an exponential law has no gap of zero pressure
    is_finite = np.isfinite(closing) & (closing > SMALLEST_POSITIVE)
    closing = np.where(is_finite, closing, 1.0)
    operating = equations.operating
    borne = operating.contact(operating.gap_at(closing)[:, None])[0][:, 0]
    pressure = np.where(borne > 0.99 * closing, closing, GIVEN_WAY * borne)
    return np.where(is_finite & np.isfinite(pressure), pressure, 0.0)


@dataclass(frozen=True, eq=False)
class PointRows:
    """Imbalance and Newton's step of some design points of a batch, `rows`."""

    equations: GapEquations
    gap0: np.ndarray
    rows: np.ndarray

    @property
    def _frictional(self) -> np.ndarray:
        return self._of(self.equations.structures.frictional)

    @property
    def _friction_of_points(self) -> tuple[np.ndarray, np.ndarray]:
        s = self.equations.structures
        return self._of(s.speed_factor), self._of(s.own_friction)

    def _of(self, values: np.ndarray) -> np.ndarray:
        return values if len(values) == 1 else values[self.rows]

    def imbalance(self, g: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """F(g) [m], pressure [Pa] and tangent [Pa/m], each (m, c)."""
        e = self.equations
        p, kappa = e.operating.at_points(g, e.springs)
        drag = e.operating.rubbing(p, *self._friction_of_points).mu * p * e.area * self._frictional
        normal = e.area * (p + e.k_c * (g - self.gap0))
        gap_change = _times(e.by_normal, normal) - _times(e.by_sliding, drag) + e.by_load
        return g - self.gap0 - gap_change, p, kappa

    def newton(self, F: np.ndarray, p: np.ndarray, kappa: np.ndarray) -> np.ndarray:
        """(dF/dg)^-1 F (m, c); NaN where the matrix is singular or not finite."""
        e = self.equations
        friction = e.operating.rubbing(p, *self._friction_of_points)
        grip = self._frictional * friction.following(p)
        normal = e.area * (kappa - e.k_c)
        sliding = e.area * grip * kappa
        J = e.by_normal * normal[:, None, :] - e.by_sliding * sliding[:, None, :]
        J[:, np.arange(J.shape[1]), np.arange(J.shape[1])] += 1.0
        return solved_rows(J, F)


def solved_rows(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A^-1 b (m, n) of matrices A (m, n, n); NaN where one is singular or not finite."""
    bad = ~(np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1))
    A = np.where(bad[:, None, None], np.eye(A.shape[1]), A)
    b = np.where(bad[:, None], np.nan, b)
    try:
        solutions: np.ndarray = np.linalg.solve(A, b[..., None])[..., 0]
    except np.linalg.LinAlgError:
        solutions = np.full(b.shape, np.nan)
        for i in range(len(A)):
            try:
                solutions[i] = np.linalg.solve(A[i], b[i])
            except np.linalg.LinAlgError:
                continue
    return solutions


def _times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    product: np.ndarray = np.einsum("mij,mj->mi", A, x)
    return product


def _damping(
    operating: StackedOperating, pressure: np.ndarray, g: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Share (m,) of each Newton step to take so that no contact point closes too far."""
    target = np.minimum(g, operating.gap_at(pressure)[:, None])
    closing = (target - g - step).max(axis=1) / operating.gap_scale(pressure)
    return np.where(closing > 0, np.minimum(1.0, MAX_STEP / np.where(closing > 0, closing, 1)), 1.0)


def _open_share(area: np.ndarray, p: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """`working_point.open_share` of each design point (m,)."""
    total = area.sum(axis=1)
    mean = (area * p).sum(axis=1) / total
    below = (area * (p < OPEN * mean[:, None])).sum(axis=1) / total
    return np.where(np.abs(mean) < OPEN * loaded, 1.0, below)


def _tangent_error(
    area: np.ndarray, p: np.ndarray, kappa: np.ndarray, F: np.ndarray, of_springs: np.ndarray
) -> np.ndarray:
    """Relative change (m,) of the contact stiffness where gaps err by AMPLIFIED times F (m, c)."""
    pressed, size = np.abs(p) > 0, np.abs(kappa)
    weight = np.where(pressed, area * size, 0.0)
    total_weight = np.maximum(weight.sum(axis=1), SMALLEST_POSITIVE)
    weight[:, weight.shape[1] - of_springs.shape[1] :] = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        change = AMPLIFIED * np.abs(F) * size / np.where(pressed, np.abs(p), 1.0)
        total = np.where(pressed, weight * change, 0.0).sum(axis=1)
    errors: np.ndarray = (total + AMPLIFIED * of_springs.sum(axis=1)) / total_weight
    return errors
