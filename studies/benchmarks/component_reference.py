"""Free frequencies of the brake's components by elements of high order, to judge meshes by.

Displacements (u_r, u_theta, u_z) are products of scikit-fem's hierarchical line elements in r,
theta and z; the disc is solved harmonic by harmonic, pad and caliper in halves that are even or
odd in theta. Cells shrink geometrically towards re-entrant corners, and the geometry is exact.
Three orders are extrapolated. Nothing of the meshes of the package enters but the blocks, of
which the solids are the union.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp
from skfem import Basis, ElementLinePp, MeshLine

from squealstudy.linalg.real_modes import real_modes, rigid_modes
from squealstudy.models.catalogue.disc_brake.solids import COARSE, BrakeMesher
from squealstudy.models.fem.grid import Interval, graded_lines
from squealstudy.models.fem.solid import Material

logging.getLogger("skfem").setLevel(logging.ERROR)
RATIO = 0.15  # of one layer's distance from a corner to the next one's
HARMONICS = 12  # nodal diameters of the disc, more than any mode below the cutoff has
# m, rad, m: longest cells between the layers
LENGTHS = {"disc": (0.03, 0.0, 0.03), "pad": (0.013, 0.1, 0.02), "caliper": (0.08, 0.5, 0.06)}
# strain (Voigt: rr, tt, zz, tz, rz, rt), component, derivatives in r, theta, z, power of r, sign
TERMS = (
    (0, 0, (1, 0, 0), 0, 1),
    (1, 1, (0, 1, 0), -1, 1),
    (1, 0, (0, 0, 0), -1, 1),
    (2, 2, (0, 0, 1), 0, 1),
    (3, 1, (0, 0, 1), 0, 1),
    (3, 2, (0, 1, 0), -1, 1),
    (4, 0, (0, 0, 1), 0, 1),
    (4, 2, (1, 0, 0), 0, 1),
    (5, 0, (0, 1, 0), -1, 1),
    (5, 1, (1, 0, 0), 0, 1),
    (5, 1, (0, 0, 0), -1, -1),
)


class Line:
    """One direction: integrals (n_cells, n, n) of products of shape functions on each cell."""

    def __init__(self, lines: np.ndarray, order: int) -> None:
        basis = Basis(MeshLine(lines), ElementLinePp(order), intorder=2 * order + 6)
        shape = basis.dx.shape
        self.dofs, self.n = basis.element_dofs, basis.N
        self._x, self._dx = np.asarray(basis.global_coordinates())[0], basis.dx
        self._values = [
            np.stack([np.broadcast_to(np.asarray(f[0]), shape) for f in basis.basis]),
            np.stack([np.broadcast_to(f[0].grad[0], shape) for f in basis.basis]),
        ]

    def integrals(self, first: int, second: int, power: int = 0) -> np.ndarray:
        """Of the derivatives `first` and `second` (0 or 1), with x to a power."""
        a, b = self._values[first], self._values[second]
        return np.einsum("ieq,jeq,eq->eij", a, b, self._dx * self._x**power, optimize=True)


class Harmonic:
    """In place of the theta direction: u_r, u_z ~ cos n theta, u_theta ~ sin n theta."""

    n = 1
    dofs = np.zeros((1, 1), dtype=int)

    def __init__(self, diameters: int) -> None:
        self.diameters = diameters

    def factor(self, component: int, derivative: int) -> float:
        """Of the term after the common cosine or sine is taken out."""
        if not derivative:
            return 1.0
        return self.diameters if component == 1 else -self.diameters


def theta_integrals(theta: Line | Harmonic, cells: np.ndarray, one: tuple, other: tuple):
    """Integrals around of two terms, (n_cells, n, n)."""
    if isinstance(theta, Line):
        return theta.integrals(one[2][1], other[2][1])[cells]
    value = theta.factor(one[1], one[2][1]) * theta.factor(other[1], other[2][1])
    return np.full((len(cells), 1, 1), value)


def matrices(r: Line, theta: Line | Harmonic, z: Line, cells: np.ndarray, material: list[Material]):
    """M, K and the theta function of each scalar degree of freedom; cells (n, 3) in r, theta, z."""
    i, j, k = cells.T
    count = r.dofs.shape[0] * theta.dofs.shape[0] * z.dofs.shape[0]
    numbers = (r.dofs[:, i][:, None, None] * theta.n + theta.dofs[:, j][None, :, None]) * z.n
    numbers = (numbers + z.dofs[:, k][None, None]).reshape(count, -1)
    used, dofs = np.unique(numbers, return_inverse=True)
    dofs = dofs.reshape(numbers.shape)
    rows, cols = np.repeat(dofs.T, count, axis=1).ravel(), np.tile(dofs.T, (1, count)).ravel()

    def product(one: tuple, other: tuple, power: int) -> np.ndarray:
        parts = (
            r.integrals(one[2][0], other[2][0], 1 + power)[i],
            theta_integrals(theta, j, one, other),
            z.integrals(one[2][2], other[2][2])[k],
        )
        found = np.einsum("eab,ecd,efg->eacfbdg", *parts, optimize=True)
        return found.reshape(-1, count, count)

    def scattered(values: np.ndarray) -> sp.csr_matrix:
        n = len(used)
        return sp.coo_matrix((values.ravel(), (rows, cols)), shape=(n, n)).tocsr()

    rho = np.array([m.density for m in material])[:, None, None]
    value = (0, 0, (0, 0, 0), 0, 1)
    M = sp.block_diag([scattered(rho * product(value, value, 0))] * 3, format="csr")
    C = np.stack([m.stiffness() for m in material])
    K = [[sp.csr_matrix((len(used), len(used))) for _ in range(3)] for _ in range(3)]
    for one in TERMS:
        for other in TERMS:
            weight = one[4] * other[4] * C[:, one[0], other[0], None, None]
            if one[1] <= other[1] and weight.any():
                K[one[1]][other[1]] += scattered(weight * product(one, other, one[3] + other[3]))
    for c, d in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        K[c][d] = (K[c][c] + K[c][c].T) / 2 if c == d else K[c][d]
        K[d][c] = K[c][d].T
    return M, sp.bmat(K, format="csr"), (used // z.n) % theta.n


def reference_lines(breaks: np.ndarray, length: float, layers: int):
    """Lines through the breaks; all but the ends count as re-entrant corners.

    Cells between the layers are no longer than `length`, where it is not zero. An interval that is
    short beside the longest is a layer of its own: it has fewer.
    """
    intervals, sizes = [], np.diff(breaks)
    for i, size in enumerate(sizes):
        fewer = int(np.log(sizes.max() / size) / -np.log(RATIO))
        shares = tuple(2 * RATIO**n for n in range(layers - fewer, 0, -1))
        low = shares if i else ()
        high = shares if i < len(breaks) - 2 else ()
        cells = int(np.ceil(size / length - 1e-9)) if length else 1
        intervals.append(Interval(cells, low, high))
    return graded_lines(breaks, intervals)


def frequencies(
    component: str, values: Mapping[str, float], cutoff: float, order: int, layers: int
) -> np.ndarray:
    """Elastic free frequencies [Hz] of a component up to a cutoff, ascending, at one order."""
    mesher = BrakeMesher(values, COARSE)
    grid, materials = mesher.component(component).grid, mesher.materials(component)
    whole = [(line[0], line[-1]) for line in grid.lines]
    bounds = [
        [np.clip(np.array((b.r, b.theta, b.z)[axis]), *whole[axis]) for b in grid.blocks]
        for axis in range(3)
    ]
    breaks = [np.unique(np.round(np.concatenate(b), 12)) for b in bounds]
    disc = component == "disc"
    if not disc:
        breaks[1] = np.append(0.0, breaks[1][breaks[1] > 0])
    lengths = LENGTHS["pad" if component.endswith("pad") else component]
    lines = [reference_lines(b, n, layers) for b, n in zip(breaks, lengths, strict=True)]
    if disc:
        lines[1] = np.array([0.0, 2 * np.pi])
    centres = np.meshgrid(*((x[1:] + x[:-1]) / 2 for x in lines), indexing="ij")
    owner = np.full(centres[0].shape, -1)
    for n in range(len(grid.blocks)):
        inside = [(x > b[n][0]) & (x < b[n][1]) for x, b in zip(centres, bounds, strict=True)]
        owner[np.logical_and.reduce(inside)] = n
    cells = np.argwhere(owner >= 0)
    material = [materials[grid.blocks[n].material] for n in owner[owner >= 0]]
    r, z = Line(lines[0], order), Line(lines[2], order)
    if disc:
        return _of_ring(r, z, cells, material, cutoff)
    return _of_halves(r, Line(lines[1], order), z, cells, material, cutoff)


def _of_ring(r: Line, z: Line, cells: np.ndarray, material: list[Material], cutoff: float):
    found = []
    for diameters in range(HARMONICS + 1):
        M, K, _ = matrices(r, Harmonic(diameters), z, cells, material)
        hz = _elastic(M, K, cutoff)
        found.extend(np.repeat(hz, 1 if diameters == 0 else 2))
        if diameters > 2 and not len(hz):
            break
    return np.sort(found)


def _of_halves(r: Line, theta: Line, z: Line, cells: np.ndarray, material, cutoff: float):
    M, K, line = matrices(r, theta, z, cells, material)
    on_plane, found = line == theta.dofs[0, 0], []
    for held in ((1,), (0, 2)):  # even: u_theta vanishes on the plane of symmetry; odd: the others
        free = ~np.concatenate([on_plane & (c in held) for c in range(3)])
        found.extend(_elastic(M[free][:, free], K[free][:, free], cutoff))
    return np.sort(found)


def _elastic(M: sp.csr_matrix, K: sp.csr_matrix, cutoff: float) -> np.ndarray:
    omega, _ = real_modes(M, K, cutoff)
    hz: np.ndarray = omega[rigid_modes(M, K, omega) :] / (2 * np.pi)
    return hz[hz > RIGID_BELOW]


RIGID_BELOW = 100.0  # Hz: turns are not polynomials in theta, rigid rotations come out nearly so


def extrapolated(
    component: str, values: Mapping[str, float], cutoff: float, order: int = 4, layers: int = 2
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] from the three orders up to `order`, and the last step's relative change.

    Aitken's rule on each frequency: errors of graded meshes fall by a constant factor an order.
    """

    def at(order: int, layers: int) -> np.ndarray:
        return frequencies(component, values, cutoff * 1.1, order, layers)

    three = [at(order - 2, layers), at(order - 1, layers)]
    if component == "caliper" and layers > 1:
        coarser = [at(n, layers - 1) for n in (order - 2, order - 1, order)]
        three.append(_with_last_layer(three, coarser, order))
    else:
        three.append(at(order, layers))
    count = int((three[2] < cutoff).sum())
    a, b, c = (f[:count] for f in three)
    first, second = a - b, b - c
    return c - second**2 / (first - second), second / c


def _with_last_layer(two: list[np.ndarray], coarser: list[np.ndarray], order: int) -> np.ndarray:
    """Frequencies at an order and all layers, which together need 6 GB for the caliper.

    What a layer at a corner changes falls by a power of the order, which the two orders below,
    solved with all layers (`two`) and with one fewer (`coarser`), tell. Against a solution:
    0.005 % at most on the default caliper.
    """
    count = min(len(f) for f in (*two, *coarser))
    (a, b), (c, d, top) = ([f[:count] for f in part] for part in (two, coarser))
    power = np.log((c - a) / (d - b)) / np.log((order - 1) / (order - 2))
    found: np.ndarray = top - (d - b) * ((order - 1) / order) ** power
    return found
