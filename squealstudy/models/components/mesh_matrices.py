"""Mass and stiffness of a meshed component; the stiffness also as terms times elastic moduli."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.formulations import Formulation, MassRule, integration
from squealstudy.models.components.jacobians import CHUNK, jacobians
from squealstudy.models.components.materials import Elastic, Orientation, moduli
from squealstudy.models.components.mesh import ElementBlock, SolidMesh

STRAINS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))  # of rows 11 22 33 23 13 12
NEARLY = 1e-12  # relative difference of moduli that changed by one factor
SCALE = "scale"  # name of a term that all moduli of a material multiply together


class StiffnessTerm(NamedTuple):
    """A symmetric matrix (3 n, 3 n), and the name of its modulus as factor: "lining.D3333".

    For elements with condensed inner displacements the name ends in ``scale``. The matrix is then
    that of the mesh's material, and a common factor on all its moduli multiplies it.
    """

    name: str
    K: sp.csr_matrix


def stiffness_terms(mesh: SolidMesh, material: str) -> tuple[StiffnessTerm, ...]:
    """The stiffness of all elements of a material, as terms.

    K of the mesh is the sum of `coefficients` times `K` over the terms of all materials. Degrees of
    freedom are 3 * node + axis.

    Raises
    ------
    ModelError
        The material is unknown, or no element has it; a Jacobian is negative.
    """
    elastic = material_of(mesh, material)
    parts = parts_of(mesh, material)
    terms = []
    linear = [p for p in parts if not p.block.kind.condensed]
    if linear:
        names, units = zip(*((m.name, m.unit) for m in moduli(elastic)), strict=True)
        for name, K in zip(names, _stiffness(mesh, linear, units), strict=True):
            terms.append(StiffnessTerm(f"{material}.{name}", K))
    condensed = [p for p in parts if p.block.kind.condensed]
    if condensed:
        (K,) = _stiffness(mesh, condensed, [elastic.stiffness()])
        terms.append(StiffnessTerm(f"{material}.{SCALE}", K))
    return tuple(terms)


def coefficients(
    mesh: SolidMesh, material: str, changed: Elastic | None = None
) -> dict[str, float]:
    """Factors on `stiffness_terms` by their names, for the mesh's material or a changed one.

    Raises
    ------
    ModelError
        The changed material is of another kind; its moduli have not all changed by one factor, and
        elements have condensed inner displacements.
    """
    elastic = material_of(mesh, material)
    new = elastic if changed is None else changed
    if type(new) is not type(elastic):
        raise ModelError(f"material '{material}': {type(new).__name__} in place of another kind")
    kinds = {p.block.kind.condensed for p in parts_of(mesh, material)}
    values = {m.name: m.value for m in moduli(new)} if False in kinds else {}
    if True in kinds:
        was = np.array([m.value for m in moduli(elastic)])
        now = np.array([m.value for m in moduli(new)])
        factor = float(now @ was / (was @ was))
        if np.abs(now - factor * was).max() > NEARLY * np.abs(now).max():
            raise mesh.error(
                f"material '{material}' belongs to elements with condensed inner freedoms (C3D8I): "
                "its moduli can change by one common factor only"
            )
        values[SCALE] = factor
    return {f"{material}.{name}": coefficient for name, coefficient in values.items()}


def stiffness_matrix(mesh: SolidMesh, materials: Collection[str] | None = None) -> sp.csr_matrix:
    """Stiffness (3 n, 3 n) [N/m] of the elements of all materials, or of some."""
    total = sp.csr_matrix((3 * len(mesh.nodes),) * 2)
    for name in used_materials(mesh) if materials is None else materials:
        (K,) = _stiffness(mesh, parts_of(mesh, name), [material_of(mesh, name).stiffness()])
        total = total + K
    return total.tocsr()


def element_stiffnesses(mesh: SolidMesh) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Chunks of elements: their indices (e,), nodes (e, k) and stiffness (e, 3 k, 3 k)."""
    for name in used_materials(mesh):
        factors = _factors(material_of(mesh, name).stiffness())
        for part, rows, X in chunks(mesh, parts_of(mesh, name)):
            K = _products(*strain_rows(mesh, part, rows, X), factors)
            m = 3 * X.shape[1]
            yield (
                part.start + rows,
                part.block.nodes[rows],
                _condensed(K, m) if part.block.kind.condensed else K,
            )


def mass_matrix(mesh: SolidMesh, rule: MassRule = "full") -> sp.csr_matrix:
    """Mass matrix (3 n, 3 n) [kg].

    Parameters
    ----------
    mesh : SolidMesh
    rule : str
        full: consistent, with enough points to be exact for elements with plane faces.
        as_stiffness: consistent, with the points of the stiffness as in CalculiX, which are far
        fewer for C3D10 and C3D20R. lumped: diagonal, by row sums for elements without middle nodes,
        for others by the diagonal scaled to the mass of the element (Hinton, Rock, Zienkiewicz
        1976).

    Raises
    ------
    ModelError
        An element has no material, or a negative Jacobian.
    """
    parts = [p for name in used_materials(mesh) for p in parts_of(mesh, name)]
    sums = NodeSums(mesh, parts, 1)
    for part, chunk, X in chunks(mesh, parts):
        points = part.block.kind.mass_rule(rule)
        N, dN = part.block.kind.shape.functions(points.points)
        det, _ = jacobians(mesh, part.start, chunk, X, dN)
        density = material_of(mesh, part.material).density + mesh.added_density[part.start + chunk]
        weight = det * points.weights * density[:, None]
        M = np.matmul(N.T * weight[:, None, :], N)
        sums.add(part, chunk, (_lumped(M, part.block.kind) if rule == "lumped" else M)[..., None])
    mass = sums.matrix()
    if rule == "lumped":
        mass = sp.diags(mass.diagonal())
    return sp.kron(mass, sp.eye(3), format="csr")


def _lumped(M: np.ndarray, kind: Formulation) -> np.ndarray:
    """Lumped masses (e, k, k) of consistent ones, with the same total."""
    at_nodes = M.sum(axis=2)
    if not all(kind.shape.is_corner(node) for node in range(kind.shape.nodes)):
        diagonal = np.einsum("ekk->ek", M)
        at_nodes = diagonal * (at_nodes.sum(axis=1) / diagonal.sum(axis=1))[:, None]
    return at_nodes[:, :, None] * np.eye(M.shape[1])


def used_materials(mesh: SolidMesh) -> list[str]:
    """Names of the materials of all elements; ModelError where an element has none."""
    names = sorted(set(mesh.material))
    if "" in names:
        without = np.flatnonzero(mesh.material == "")
        raise mesh.error(
            f"{mesh.elements_named(without)} ha{'s' if len(without) == 1 else 've'} no material"
        )
    return names


def material_of(mesh: SolidMesh, name: str) -> Elastic:
    """The material of a name; ModelError where the mesh has none."""
    if name in mesh.unfinished:
        raise ModelError(mesh.unfinished[name].missing)
    if name not in mesh.materials:
        names = ", ".join(sorted(mesh.materials)) or "none"
        raise mesh.error(f"there is no material '{name}', its materials are {names}")
    return mesh.materials[name]


@dataclass(frozen=True)
class ElementPart:
    """Elements of one block that have the same material and orientation.

    Attributes
    ----------
    block : ElementBlock
    rows : ndarray of int
        Places of the elements in the block.
    start : int
        Place of the block's first element in the mesh.
    material : str
    orientation : Orientation or None
    """

    block: ElementBlock
    rows: np.ndarray
    start: int
    material: str
    orientation: Orientation | None


def parts_of(mesh: SolidMesh, material: str) -> list[ElementPart]:
    """The elements of a material, by block and orientation; ModelError where there are none."""
    parts = []
    for block, start, end in zip(mesh.blocks, mesh.starts, mesh.starts[1:], strict=False):
        has_material = mesh.material[start:end] == material
        for name in sorted(set(mesh.orientation[start:end][has_material])):
            rows = np.flatnonzero(has_material & (mesh.orientation[start:end] == name))
            axes = mesh.orientations[name] if name else None
            parts.append(ElementPart(block, rows, int(start), material, axes))
    if not parts:
        raise mesh.error(f"no element has the material '{material}'")
    return parts


def chunks(
    mesh: SolidMesh, parts: Sequence[ElementPart]
) -> Iterator[tuple[ElementPart, np.ndarray, np.ndarray]]:
    """Chunks of elements: their part, their rows (e,) in its block, coordinates (e, k, 3)."""
    for part in parts:
        for start in range(0, len(part.rows), CHUNK):
            rows = part.rows[start : start + CHUNK]
            yield part, rows, mesh.nodes[part.block.nodes[rows]]


def _stiffness(
    mesh: SolidMesh, parts: Sequence[ElementPart], tensors: Sequence[np.ndarray]
) -> list[sp.csr_matrix]:
    """Stiffness matrices (3 n, 3 n), one for each of the elasticity matrices (6, 6)."""
    sums = [NodeSums(mesh, parts, 9)]
    sums += [sums[0].like() for _ in tensors[1:]]
    factors = [_factors(tensor) for tensor in tensors]
    for part, rows, X in chunks(mesh, parts):
        B, weight = strain_rows(mesh, part, rows, X)
        e, k = X.shape[:2]
        for total, tensor_factors in zip(sums, factors, strict=True):
            K = _products(B, weight, tensor_factors)
            if part.block.kind.condensed:
                K = _condensed(K, 3 * k)
            blocks = K.reshape(e, k, 3, k, 3).transpose(0, 1, 3, 2, 4)
            total.add(part, rows, blocks.reshape(e, k, k, 9))
    return [total.matrix() for total in sums]


def _factors(C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values s (r,) and rows V (r, 6) with C = V^T diag(s) V, r the rank of C."""
    values, vectors = np.linalg.eigh(C)
    nonzero = np.abs(values) > 1e-14 * np.abs(values).max()
    return values[nonzero], vectors[:, nonzero].T


def _products(
    B: np.ndarray, weight: np.ndarray, factors: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Integrals of B^T C B: (e, m, m) of strains B (e, q, 6, m) and weights (e, q)."""
    s, V = factors
    F = np.matmul(V, B)  # (e, q, r, m)
    e, _, _, m = F.shape
    weighted = F * (weight[:, :, None] * s)[..., None]
    K = np.matmul(F.reshape(e, -1, m).transpose(0, 2, 1), weighted.reshape(e, -1, m))
    return (K + K.transpose(0, 2, 1)) / 2


def inner_freedoms(B: np.ndarray, weight: np.ndarray, C: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Displacements of nodes u (e, k) with the inner ones appended, which carry no load: (e, m)."""
    k = u.shape[1]
    K = _products(B, weight, _factors(C))
    inner = -np.linalg.solve(K[:, k:, k:], np.matmul(K[:, k:, :k], u[..., None]))
    return np.hstack([u, inner[..., 0]])


def _condensed(K: np.ndarray, m: int) -> np.ndarray:
    """Condense the inner displacements from the m-th on, which carry no load."""
    inner = np.linalg.solve(K[:, m:, m:], K[:, m:, :m])
    reduced = K[:, :m, :m] - np.matmul(K[:, :m, m:], inner)
    return (reduced + reduced.transpose(0, 2, 1)) / 2


def strain_rows(
    mesh: SolidMesh, part: ElementPart, rows: np.ndarray, X: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Strains (e, q, 6, m) in material axes by m displacements, and weights [m3] (e, q)."""
    kind = part.block.kind
    rule = integration(kind.stiffness)
    N, dN = kind.shape.functions(rule.points)
    det, J = jacobians(mesh, part.start, rows, X, dN)
    inverse = np.linalg.inv(J)
    G = np.matmul(dN, inverse)  # slopes (e, q, k, 3) in x, y, z
    weight = det * rule.weights
    if kind.condensed:
        G = np.concatenate([G, _inner_slopes(kind, rule.points, X, det)], axis=2)
    B = _rows(G, material_axes(part, N, X))
    if kind.strains == "mean_dilatation":
        mean = (
            np.einsum("eq,eqni->eni", weight, G, optimize=True) / weight.sum(axis=1)[:, None, None]
        )
        B[:, :, :3] += ((mean[:, None] - G) / 3)[:, :, None]
    return B.reshape(*B.shape[:3], -1), weight


def material_axes(part: ElementPart, N: np.ndarray, X: np.ndarray) -> np.ndarray | None:
    """Material axes, rows of (e, q, 3, 3), at points with shape functions N (q, k).

    None where they are x, y, z.
    """
    if part.orientation is None:
        return None
    axes: np.ndarray = part.orientation.axes(np.einsum("qn,eni->eqi", N, X, optimize=True))
    return axes


def _rows(G: np.ndarray, axes: np.ndarray | None) -> np.ndarray:
    """Strains (e, q, 6, k, 3) by gradients G (e, q, k, 3), in axes, rows of (e, q, 3, 3)."""
    e, q, k, _ = G.shape
    B = np.zeros((e, q, 6, k, 3))
    if axes is None:
        for row, (i, j) in enumerate(STRAINS):
            B[:, :, row, :, i] += G[..., j]
            if i != j:
                B[:, :, row, :, j] += G[..., i]
        return B
    local = np.matmul(G, axes.transpose(0, 1, 3, 2))
    for row, (i, j) in enumerate(STRAINS):
        B[:, :, row] = local[..., j, None] * axes[:, :, None, i]
        if i != j:
            B[:, :, row] += local[..., i, None] * axes[:, :, None, j]
    return B


def _inner_slopes(
    kind: Formulation, points: np.ndarray, X: np.ndarray, det: np.ndarray
) -> np.ndarray:
    """Gradients (e, q, 3, 3) of the incompatible functions 1 - xi^2, xi from -1 to 1.

    They use the Jacobian at the centre, times its determinant over that at the point, so that a
    constant stress does no work on them (Taylor, Beresford, Wilson 1976). CalculiX leaves out this
    ratio, and its distorted elements do not pass the patch test.
    """
    _, dN = kind.shape.functions(np.full((1, 3), 0.5))
    J = np.einsum("eni,nj->eij", X, dN[0], optimize=True)
    slopes = -8 * (points - 0.5)[:, :, None] * np.eye(3)  # by the coordinates from 0 to 1
    ratio = np.linalg.det(J)[:, None] / det
    return np.matmul(slopes, np.linalg.inv(J)[:, None]) * ratio[..., None, None]


class NodeSums:
    """Sum of element matrices as one sparse matrix, with a block of values for each pair of nodes.

    Parameters
    ----------
    mesh : SolidMesh
    parts : sequence of ElementPart
        The elements that will be added.
    size : int
        Values of a block: 1 or 9, which is 3 x 3.
    """

    def __init__(self, mesh: SolidMesh, parts: Sequence[ElementPart], size: int) -> None:
        self.n, self.size = len(mesh.nodes), size
        pairs = [self._pairs(p, p.rows).ravel() for p in parts]
        keys = np.sort(np.concatenate(pairs))  # faster than np.unique, which hashes
        self.keys = keys[np.append(True, keys[1:] != keys[:-1])]
        self.data = np.zeros(len(self.keys) * size)

    def like(self) -> NodeSums:
        """An empty sum with the same pairs of nodes."""
        other = object.__new__(NodeSums)
        other.n, other.size, other.keys = self.n, self.size, self.keys
        other.data = np.zeros_like(self.data)
        return other

    def _pairs(self, part: ElementPart, rows: np.ndarray) -> np.ndarray:
        nodes = part.block.nodes[rows].astype(np.int64)
        return nodes[:, :, None] * self.n + nodes[:, None, :]

    def add(self, part: ElementPart, rows: np.ndarray, values: np.ndarray) -> None:
        """Add values (e, k, k, size) for all pairs of nodes of elements."""
        positions = np.searchsorted(self.keys, self._pairs(part, rows).ravel())
        np.add.at(
            self.data,
            (positions[:, None] * self.size + np.arange(self.size)).ravel(),
            values.ravel(),
        )

    def matrix(self) -> sp.csr_matrix:
        """The sum (n, n), or (3 n, 3 n) of blocks."""
        rows, columns = np.divmod(self.keys, self.n)
        starts = np.searchsorted(rows, np.arange(self.n + 1))
        if self.size == 1:
            return sp.csr_matrix((self.data, columns, starts), shape=(self.n, self.n))
        blocks = self.data.reshape(-1, 3, 3)
        K = sp.bsr_matrix((blocks, columns, starts), shape=(3 * self.n, 3 * self.n)).tocsr()
        K.eliminate_zeros()
        return K
