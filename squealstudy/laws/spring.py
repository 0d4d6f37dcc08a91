"""Springs with a third power, with a gap, or of one side, and dampers of third power.

They are contact points of 1 m2 without friction, the last of a structure, whose law is this one in
place of the study's. Each has five numbers, a row of an array `springs` (ns, 5): stiffness k [N/m],
cubic stiffness c [N/m3], gap [m], side, 1 where it only pulls back what lengthens it, -1 where it
only pushes back what shortens it, 0 for both, and cubic damping [N s3/m3]: the gap of such a damper
is its elongation, and so is its sliding (THEORY.md eq. (5a)). It has no part in the
linearisation. Functions of one point are compiled by kernels.
"""

from __future__ import annotations

import numpy as np

from squealstudy.laws.contact_law import ContactLaw

N_SPRING = 5  # numbers of a spring
NO_SPRINGS = np.zeros((0, N_SPRING))
CORNER_REL_TOLERANCE = 1e-9  # distance to a corner, of the gaps: closer, the tangent is undecided


def deflection(e: float, gap: float, side: float) -> float:
    """Elongation beyond the gap [m]; NaN for a NaN."""
    if side >= 0.0 and e > gap:
        return e - gap
    if side <= 0.0 and -e > gap:
        return e + gap
    return 0.0 * e


def spring_pressure(
    e: float, stiffness: float, cubic: float, gap: float, side: float
) -> tuple[float, float]:
    """Force that pushes the ends apart [N], and tangent [N/m]."""
    d = deflection(e, gap, side)
    tangent = stiffness + 3.0 * cubic * d * d
    acts = d != 0.0 or (gap == 0.0 and side == 0.0)
    return -(stiffness + cubic * d * d) * d, tangent if acts else 0.0


def damper_force(rate: float, damping: float) -> tuple[float, float]:
    """Force of a damper of third power along its elongation [N], and its slope [N s/m]."""
    square = rate * rate
    return -damping * square * rate, -3.0 * damping * square


def spring_potential(e: float, stiffness: float, cubic: float, gap: float, side: float) -> float:
    """Stored energy, J."""
    d = deflection(e, gap, side)
    return 0.5 * (stiffness + 0.5 * cubic * d * d) * d * d


def mean_spring_pressure(
    e: float, width: float, stiffness: float, cubic: float, gap: float, side: float
) -> float:
    """Mean force over the elongations from e - width/2 to e + width/2: what the energy loses."""
    a, b = deflection(e - 0.5 * width, gap, side), deflection(e + 0.5 * width, gap, side)
    share = (b - a) / width if width != 0.0 else 1.0
    return -0.5 * share * (stiffness + 0.5 * cubic * (a * a + b * b)) * (a + b)


def deflections(e: np.ndarray, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Elongations (..., ns) beyond the gaps of springs (..., ns, 5), and which of them act."""
    gap, side = springs[..., 2], springs[..., 3]
    longer, shorter = (side >= 0.0) & (e > gap), (side <= 0.0) & (-e > gap)
    d = np.where(longer, e - gap, np.where(shorter, e + gap, 0.0 * e))
    return d, (d != 0.0) | ((gap == 0.0) & (side == 0.0))


def evaluate_springs(e: np.ndarray, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`spring_pressure` of elongations (..., ns) and springs (..., ns, 5)."""
    d, acts = deflections(e, springs)
    k, c = springs[..., 0], springs[..., 1]
    return -(k + c * d * d) * d, np.where(acts, k + 3.0 * c * d * d, 0.0)


def spring_slopes(e: np.ndarray, springs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of force and tangent by the elongations (..., ns)."""
    d, _ = deflections(e, springs)
    return -evaluate_springs(e, springs)[1], 6.0 * springs[..., 1] * d


def spring_error(gaps: np.ndarray, wrong: np.ndarray, springs: np.ndarray) -> np.ndarray:
    """Changes (..., ns) of the tangents by wrong gaps, both (..., nc), the last of springs."""
    first = gaps.shape[-1] - springs.shape[-2]
    slope = spring_slopes(gaps[..., first:], springs)[1]
    change: np.ndarray = np.abs(slope * wrong[..., first:])
    return change


def engaged(e: np.ndarray, springs: np.ndarray) -> np.ndarray:
    """Elongations (..., ns) moved on by the gap, to where the springs (..., ns, 5) act."""
    gap, side = springs[..., 2], springs[..., 3]
    way = np.where(side == 0.0, np.where(e < 0.0, -1.0, 1.0), side)
    elongations: np.ndarray = np.where((gap == 0.0) & (side == 0.0), e, way * (np.abs(e) + gap))
    return elongations


def at_a_corner(gaps: np.ndarray, springs: np.ndarray) -> np.ndarray:
    """Whether springs (..., ns, 5), the last of gaps (..., nc), are where they begin to act.

    There the tangent is the stiffness to one side and nothing to the other.
    """
    if not springs.shape[-2]:
        return np.zeros(gaps.shape[:-1], dtype=bool)
    e = gaps[..., gaps.shape[-1] - springs.shape[-2] :]
    gap, side, k = springs[..., 2], springs[..., 3], springs[..., 0]
    tolerance = CORNER_REL_TOLERANCE * np.abs(gaps).max(axis=-1, initial=0.0)[..., None]
    kinked = (k != 0.0) & ((gap != 0.0) | (side != 0.0))
    upper = (side >= 0.0) & (np.abs(e - gap) <= tolerance)
    lower = (side <= 0.0) & (np.abs(e + gap) <= tolerance)
    cornered: np.ndarray = (kinked & (upper | lower)).any(axis=-1)
    return cornered


def evaluate_points(
    law: ContactLaw, springs: np.ndarray, g: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pressure [Pa] and tangent [Pa/m] at gaps g (nc,), of which the last are of springs."""
    if not len(springs):
        return law.evaluate(g)
    first = len(g) - len(springs)
    pairs = law.evaluate(g[:first]), evaluate_springs(g[first:], springs)
    p, kappa = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return p, kappa


def slopes_of_points(
    law: ContactLaw, springs: np.ndarray, g: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """`ContactLaw.slopes` at gaps g (nc,): parameters of the law move no springs."""
    if not len(springs):
        return law.slopes(g)
    first, still = len(g) - len(springs), np.zeros(len(springs))
    by_gap, *others = law.slopes(g[:first])
    of_springs = spring_slopes(g[first:], springs)
    pairs = [(by_gap, of_springs), *((slope, (still, still)) for slope in others)]
    return [(np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1]])) for a, b in pairs]
