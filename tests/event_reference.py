"""The independent judge of runs and limit cycles of belt, Hoffmann's and Hulten's model.

Own equations (THEORY.md eq. (1), (2), (4) to (9), (11), (12), (17), (18)), own integrator: nothing
of the package is imported. DOP853 at 1e-9 in pieces that end where a contact point leaves its
phase: at the corner of the regularised law, where it turns round, where contact opens or closes.
`test_event_reference.py` holds it against scipy's `solve_ivp` in pieces, against Runge and Kutta's
method at steps that change nothing, energy balances, tolerances and eigenvalues.

    found = run(design("belt", **{"sliding_speed": 0.5}), 0.5, kick=0.1)
    cycle = found.cycle()  # frequency_hz, mean, rms, peak_to_peak, shares
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any

import event_laws as laws
import event_steps as steps
import numpy as np
from event_laws import CONTACT_CODES, Case

AREA_STIFFNESS = 5e11  # Pa/m: stiffness of a minimal model's contact over its area
SHARE = 0.002  # of the sliding speed: regularisation where none is given
SATURATES = 5.0  # k_t s over the bound, from which on the smooth law is at its bound
LIGHTEST = 0.05  # of the load: what it is raised from
CORRECTIONS, BACKTRACKS = 60, 40

_COMMON = {
    "friction": 0.5,
    "sliding_speed": 0.5,
    "damping_ratio": 0.0,
    "stiffness_damping": 0.0,
    "friction_law.static_ratio": 1.0,
    "friction_law.decay_speed": 0.5,
    "contact.kt": 0.0,
    "contact.regularisation_speed": 0.0,
    "contact.p0": 1e5,
    "contact.lambda": 5e5,
    "contact.stiffness": AREA_STIFFNESS,
    "contact.exponent": 1.5,
    "contact.cubic_stiffness": 0.0,
    "mass": 1.0,
    "normal_force": 100.0,
}
_OWN = {
    "belt": {
        "sliding_speed": 1.0,
        "damping_ratio": 0.05,
        "friction_law.static_ratio": 2.0,
        "stiffness": (200 * np.pi) ** 2,
        "normal_force": 200 * np.pi,
        "contact_stiffness": 1e8,
    },
    "hoffmann": {
        "k1": 2e6 / 3 * (2 - np.sqrt(3)),
        "k2": 2e6 / 3 * (2 + np.sqrt(3)),
        "contact_stiffness": 4e6 / 3,
        "alpha1": 150.0,
        "alpha2": 30.0,
    },
    "hulten": {"frequency_1": 100.0, "frequency_2": 75.0},
}
_LAWS = {  # parameters of each contact law
    "exponential": ("contact.p0", "contact.lambda"),
    "power": ("contact.stiffness", "contact.exponent"),
    "cubic": ("contact.stiffness", "contact.cubic_stiffness"),
    "unilateral": ("contact.stiffness", "contact.stiffness"),
    "bilateral": ("contact.stiffness", "contact.stiffness"),
}


@dataclass(frozen=True)
class SmallDesign:
    """A design point of a small model, `values` by the names of study files.

    `slowest` is the least sliding speed of its study, by which friction is regularised where no
    slope is given; `coulomb` leaves regularisation away.
    """

    model: str
    values: dict[str, float] = field(default_factory=dict)
    contact_law: str = "bilateral"
    smooth: bool = False
    slowest: float = 0.0
    coulomb: bool = False

    def __getitem__(self, name: str) -> float:
        known = _COMMON | _OWN[self.model]
        unknown = set(self.values) - set(known)
        if unknown:
            raise KeyError(f"{self.model} has no {sorted(unknown)}")
        return {**known, **self.values}[name]

    def with_values(self, **values: float) -> SmallDesign:
        """The design with other values."""
        return replace(self, values={**self.values, **values})


def design(model: str, contact_law: str = "bilateral", smooth: bool = False, **values: float):
    """A design of a model with these values; dots of names need `**{...}`."""
    found = SmallDesign(model, values, contact_law, smooth)
    found["friction"]  # tells unknown names
    return found


def once(function: Callable[[SmallDesign], Any]) -> Callable[[SmallDesign], Any]:
    """A function of a design that is evaluated once for each."""
    known: dict[object, Any] = {}

    @wraps(function)
    def kept(d: SmallDesign) -> Any:
        key = (d.model, *sorted(d.values.items()), d.contact_law, d.smooth, d.slowest, d.coulomb)
        if key not in known:
            known[key] = function(d)
        return known[key]

    return kept


# -- steady sliding and small motion --------------------------------------------------------------
def geometry(d: SmallDesign) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """K (2, 2) of the springs, load (2,), N, T (points, 2), area (points,)."""
    if d.model == "hulten":
        stiffness = d["mass"] * (2 * np.pi * np.array([d["frequency_1"], d["frequency_2"]])) ** 2
        T = np.array([[0.0, -1.0], [1.0, 0.0]])
        load = np.full(2, -d["normal_force"])
        return np.zeros((2, 2)), load, np.eye(2), T, stiffness / AREA_STIFFNESS
    N, T = np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])
    load, area = np.array([0.0, -d["normal_force"]]), np.array([d["contact_stiffness"]])
    if d.model == "belt":
        return np.diag([d["stiffness"], 0.0]), load, N, T, area / AREA_STIFFNESS
    K = np.zeros((2, 2))
    for k, angle in ((d["k1"], d["alpha1"]), (d["k2"], d["alpha2"])):
        n = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
        K += k * np.outer(n, n)
    return K, load, N, T, area / AREA_STIFFNESS


def _law(d: SmallDesign) -> tuple[int, float, float]:
    first, second = (d[name] for name in _LAWS[d.contact_law])
    return CONTACT_CODES[d.contact_law], first, second


def _pressure(law: tuple[int, float, float], g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressures and tangents of all points, open ones as the law has them."""
    shut = (g < 0.0) if law[0] in (laws.UNILATERAL, laws.POWER) else np.ones(len(g), bool)
    p = np.array([laws.pressure(*law, x) for x in g])
    kappa = np.array([laws.tangent(*law, x) for x in g])
    return np.where(shut, p, 0.0), np.where(shut, kappa, 0.0)


def friction_at(d: SmallDesign, s: float) -> float:
    """Coefficient at a sliding speed."""
    return laws.coefficient(
        d["friction"], d["friction_law.static_ratio"], d["friction_law.decay_speed"], s
    )


@once
def steady(d: SmallDesign) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Displacements (2,), pressures and tangents (points,) of steady sliding (THEORY.md eq. (12)).

    Load, then friction are brought up in steps from none: of a contact that softens the state is
    the one reached from rest. ValueError where no state balances the load.
    """
    K, whole, N, T, area = geometry(d)
    law, side = _law(d), float(np.sign(d["sliding_speed"]))
    x = np.zeros(2)
    friction = side * friction_at(d, abs(d["sliding_speed"]))
    rising = [(s, 0.0) for s in np.linspace(LIGHTEST, 1.0, 20)]
    for pressed, share in [*rising, *((1.0, s) for s in np.linspace(0.05, 1.0, 20))]:
        mu, load = share * friction, pressed * whole

        def imbalance(x, mu=mu, load=load):
            p, kappa = _pressure(law, N @ x)
            grip = area * mu * (p > 0)  # contact that pulls has no friction
            F = K @ x - load - N.T @ (area * p) + T.T @ (grip * p)
            J = K + N.T @ np.diag(area * kappa) @ N - T.T @ np.diag(grip * kappa) @ N
            return F, J

        x = _newton(imbalance, x, float(np.abs(whole).max()))
    p, kappa = _pressure(law, N @ x)
    return x, p, kappa


def _newton(imbalance, x, scale):
    """The root of an imbalance near x; steps that make it worse are halved."""
    F, J = imbalance(x)
    for _ in range(CORRECTIONS):
        size = np.abs(F).max()
        if size <= 1e-12 * scale:
            return x
        step = np.linalg.solve(J, F)
        for _ in range(BACKTRACKS):
            new, J_new = imbalance(x - step)
            if np.isfinite(new).all() and np.abs(new).max() < size:
                break
            step = 0.5 * step
        else:
            if size <= 1e-9 * scale:
                return x
            raise ValueError("no steady sliding was found")
        x, F, J = x - step, new, J_new
    raise ValueError("no steady sliding was found")


def damping(d: SmallDesign, kappa: np.ndarray) -> np.ndarray:
    """C (2, 2) of a design's own steady sliding (THEORY.md eq. (18), (19))."""
    K, _, N, _, area = geometry(d)
    K = K + N.T @ np.diag(area * kappa) @ N
    squares, shapes = np.linalg.eigh(K / d["mass"])
    rates = 2 * d["damping_ratio"] * np.sqrt(np.maximum(squares, 0.0))
    return d["mass"] * (shapes * rates) @ shapes.T + d["stiffness_damping"] * K


@once
def roots(d: SmallDesign) -> tuple[np.ndarray, np.ndarray]:
    """Roots (k,) [rad/s] with positive imaginary part, fastest growth first, and vectors (2, k)."""
    K, _, N, T, area = geometry(d)
    _, p, kappa = steady(d)
    C, speed = damping(d, kappa), d["sliding_speed"]
    mu = friction_at(d, abs(speed))
    falls = (d["friction"] - mu) / d["friction_law.decay_speed"]  # dmu/ds
    drag = np.sign(speed) * mu * area * kappa * (p > 0)
    K = K + N.T @ np.diag(area * kappa) @ N - T.T @ np.diag(drag) @ N
    C = C + falls * T.T @ np.diag(area * np.maximum(p, 0.0)) @ T
    zero, m = np.zeros((2, 2)), d["mass"]
    lam, vectors = np.linalg.eig(np.block([[zero, np.eye(2)], [-K / m, -C / m]]))
    keep = np.flatnonzero(lam.imag > 0)
    keep = keep[np.argsort(-lam[keep].real)]
    return lam[keep], vectors[:2, keep]


def slope_of(d: SmallDesign, p: np.ndarray) -> float:
    """k_t [N s/m3] (THEORY.md eq. (11))."""
    if d.coulomb:
        return np.inf
    if d["contact.kt"] > 0:
        return d["contact.kt"]
    speed = d["contact.regularisation_speed"] or SHARE * (d.slowest or abs(d["sliding_speed"]))
    return max(friction_at(d, 0.0), 1e-3) * float(p.max()) / speed


@once
def case_of(d: SmallDesign) -> Case:
    """The design as the judge integrates it, about its own steady sliding."""
    K, load, N, T, area = geometry(d)
    x, p, kappa = steady(d)
    return Case(
        d["mass"],
        K,
        damping(d, kappa),
        load,
        x,
        N,
        T,
        area,
        d["sliding_speed"],
        slope_of(d, p),
        d.smooth,
        *_law(d),
        d["friction"],
        d["friction_law.static_ratio"],
        d["friction_law.decay_speed"],
        0.01 * float(area @ p / area.sum()),
    )


def kicked(d: SmallDesign, velocity: float, band: tuple[float, float]) -> np.ndarray:
    """Start (4,) along the unstable modes of a band, or its least stable one, from steady sliding.

    At the phase of each at which its velocity is largest; signs by the first of gaps and slidings
    that has half of the largest; `velocity` is that of the contact, m/s.
    """
    _, _, N, T, _ = geometry(d)
    lam, vectors = roots(d)
    inside = (abs(lam) >= 2 * np.pi * band[0]) & (abs(lam) <= 2 * np.pi * band[1])
    lam, vectors = lam[inside], vectors[:, inside]
    count = max(1, int((lam.real > 1e-9 * abs(lam)).sum()))

    def size(v):
        return np.sqrt((np.abs(N @ v) ** 2 + np.abs(T @ v) ** 2).max())

    x, v = np.zeros(2), np.zeros(2)
    for root, shape in zip(lam[:count], vectors.T[:count], strict=True):
        own = shape * np.exp(-0.5j * np.angle(((root * shape) ** 2).sum()))
        moved = np.concatenate([N @ (root * own).real, T @ (root * own).real])
        first = moved[np.argmax(np.abs(moved) >= 0.5 * np.abs(moved).max())]
        factor = np.copysign(1.0, first) / size(root * own)
        x, v = x + factor * own.real, v + factor * (root * own).real
    return np.concatenate([x, v]) * velocity / size(v)


# -- runs -----------------------------------------------------------------------------------------
def run(
    d: SmallDesign,
    duration: float,
    kick: float = 0.1,
    start: np.ndarray | None = None,
    sample: float = 0.0,
    tolerance: float = 1e-9,
    band: tuple[float, float] = (0.0, 1e6),
):
    """A run of `duration` s from a kick [m/s] or a start (4,); 400 samples a period by default."""
    from event_levels import Record

    case = case_of(d)
    lam, _ = roots(d)
    omega = float(abs(lam).max()) if len(lam) else np.sqrt(np.abs(case.K).max() / case.mass)
    slowest = float(abs(lam).min()) if len(lam) else omega
    y = np.zeros(laws.N_ROWS)
    y[:4] = kicked(d, kick, band) if start is None else start
    sample = sample or 2 * np.pi / slowest / 400
    n = max(1, round(duration / sample))
    rows, extremes = np.zeros((n + 1, laws.N_ROWS + 2)), np.zeros((n, 2))
    floor = 1e-6 * max(abs(d["sliding_speed"]), float(np.abs(y[2:4]).max()))
    floor = min(floor, float(np.abs(y[2:4]).max()) or floor)
    status, events = steps.integrate(case, y, sample, rows, extremes, tolerance, floor, omega)
    if status != steps.DONE:
        raise ArithmeticError(f"the judge's run ended with status {status}")
    return Record(d, case, sample, rows, extremes, events)
