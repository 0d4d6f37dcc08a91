"""Two elastic bodies of any element that touch, and the surfaces by which they do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.sparse.linalg import splu

from squealstudy.models.components.contact_rows import Rotation, contact_rows
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.pairs import pair

E, NU = 2.0, 0.3
LAM, MU = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
ELEMENTS = {  # mesh, element by the number of nodes
    "hex8": (skfem.MeshHex, skfem.ElementHex1),
    "hex20": (skfem.MeshHex2, skfem.ElementHexS2),
    "hex27": (skfem.MeshHex2, skfem.ElementHex2),
    "tet4": (skfem.MeshTet, skfem.ElementTetP1),
    "tet10": (skfem.MeshTet2, skfem.ElementTetP2),
}


FACETS = {3: "tet4", 4: "hex8", 6: "tet10", 8: "hex20", 9: "hex27"}  # of the elements
AXIS = Rotation(np.zeros(3), np.array([0.0, 0.0, 2.0]))


@dataclass(frozen=True)
class Body:
    mesh: skfem.Mesh
    basis: skfem.CellBasis

    @property
    def nodes(self):
        return np.ascontiguousarray(self.basis.doflocs.T)

    def facets(self, keep):
        """Boundary facets whose centre (x, y, z) passes `keep`, seen from outside."""
        found = self.mesh.boundary_facets()
        corners = self.mesh.p[:, self.mesh.facets[:, found]]
        return facets_of(self.basis, found[keep(*corners.mean(axis=1))])

    def stiffness(self):
        """K (3 n, 3 n), isotropic."""
        G = [
            [
                skfem.BilinearForm(lambda u, v, w, k=k, m=m: v.grad[k] * u.grad[m]).assemble(
                    self.basis
                )
                for m in range(3)
            ]
            for k in range(3)
        ]
        trace = G[0][0] + G[1][1] + G[2][2]
        rows = [
            [LAM * G[i][j] + MU * (G[j][i] + (trace if i == j else 0 * trace)) for j in range(3)]
            for i in range(3)
        ]
        n = self.basis.N
        order = np.arange(3 * n).reshape(3, n).T.ravel()
        return sp.bmat(rows).tocsr()[order][:, order]


def facets_of(basis, found):
    """Facets of a scikit-fem mesh in the order of VTK, from where their nodes lie."""
    mesh, blocks = basis.mesh, []
    middle = {}
    if basis.edge_dofs.size:
        middle = {frozenset(e): d for e, d in zip(mesh.edges.T, basis.edge_dofs[0], strict=True)}
    for f in found:
        corners = mesh.p[:, mesh.facets[:, f]].T
        off = corners - corners.mean(axis=0)
        normal = np.cross(off[0], off[1])
        inside = mesh.p[:, mesh.t[:, mesh.f2t[0, f]]].mean(axis=1)
        normal *= np.sign(normal @ (corners.mean(axis=0) - inside)) / np.linalg.norm(normal)
        order = np.argsort(np.arctan2(off @ np.cross(normal, off[0]), off @ off[0]))
        ring = mesh.facets[order, f]
        edges = [frozenset(e) for e in zip(ring, np.roll(ring, -1), strict=True)]
        nodes = [*basis.nodal_dofs[0, ring], *(middle[e] for e in edges if middle)]
        blocks.append([*nodes, *(basis.facet_dofs[:1, f] if basis.facet_dofs.size else ())])
    return Facets(np.ascontiguousarray(basis.doflocs.T), (np.array(blocks),))


def body(element, lengths, cells, origin=(0.0, 0.0, 0.0), warp=None):
    """A block on its lines; `warp` maps the places (3, n) of its nodes."""
    mesh_of, element_of = ELEMENTS[element]
    straight = skfem.MeshTet if element.startswith("tet") else skfem.MeshHex
    lines = [o + np.linspace(0, L, n + 1) for o, L, n in zip(origin, lengths, cells, strict=True)]
    mesh = straight.init_tensor(*lines)
    if mesh_of is not straight:
        mesh = mesh_of.from_mesh(mesh)
    if warp:
        mesh = type(mesh)(warp(mesh.doflocs), mesh.t, sort_t=False, validate=False)
    return Body(mesh, skfem.CellBasis(mesh, element_of(), intorder=4))


def pressures(slave, master, pair, rows, loads, held, stiffness=50.0, prestress=0.0):
    """Contact pressures of two bodies under nodal loads, by springs per area in the contact.

    `loads` are forces (3 n,) of each body, `held` its fixed degrees of freedom.
    """
    K = sp.block_diag([slave.stiffness(), master.stiffness()]).tocsr()
    k = stiffness * pair.slave.area
    K = (K + rows.N.T @ sp.diags(k) @ rows.N).tocsc()
    f = np.concatenate(loads) + rows.N.T @ (prestress * pair.slave.area)
    free = np.setdiff1d(np.arange(len(f)), np.concatenate([held[0], held[1] + len(loads[0])]))
    u = np.zeros(len(f))
    u[free] = splu(K[free][:, free]).solve(f[free])
    return prestress - stiffness * (rows.N @ u)


def pressed(facets, p=1.0):
    """Nodal forces (3 n,) of a uniform pressure on facets."""
    surface, _ = facets.gauss_points(5)
    forces = surface.shape.T @ (-p * surface.area[:, None] * surface.normal)
    return np.asarray(forces).ravel()


def at(body, place):
    """Number of the node nearest to a place."""
    return int(np.linalg.norm(body.nodes - np.asarray(place), axis=1).argmin())


def on(height):
    return lambda x, y, z: abs(z - height) < 1e-9


def plane(kind, cells, up, lengths=(1.0, 1.0), origin=(0.0, 0.0), height=0.0, warp=None):
    """Facets of a rectangle that looks up or down."""
    z = height - 0.4 if up else height
    block = body(FACETS[kind], (*lengths, 0.4), (*cells, 1), (*origin, z), warp)
    return block.facets(on(height))


def moved(facets, *shift):
    return replace(facets, coordinates=facets.coordinates + np.array(shift))


def turned(facets, angle, shift):
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = facets.coordinates.T
    places = np.column_stack([c * x - s * y + shift[0], s * x + c * y + shift[1], z])
    return replace(facets, coordinates=places)


def rows_of(p, kind="frictionless", rotor="master", rotation=AXIS):
    """Rows of slave and master as two components."""
    n, m = (3 * s.shape.shape[1] for s in (p.slave, p.master))
    spans = {"slave": slice(0, n), "master": slice(n, n + m)}
    return contact_rows(
        p, "slave", "master", spans, n + m, kind=kind, rotation=rotation, rotor=rotor
    )


def rigid(*facets):
    """Translations and rotations (3 n, 6) of the nodes of several surfaces after each other."""
    x = np.vstack([f.coordinates for f in facets])
    R = np.zeros((len(x), 3, 6))
    R[:, :, :3] = np.eye(3)
    for axis in range(3):
        R[:, :, 3 + axis] = np.cross(np.eye(3)[axis], x)
    return R.reshape(-1, 6)


def sector(x):
    """A unit square to .5 rad of a ring of radii .9 and 1.4."""
    r, t = 0.9 + 0.5 * x[0], 0.5 * (x[1] - 0.5)
    return np.stack([r * np.cos(t), r * np.sin(t), x[2]])


def patch(upper, lower, warp=None, **settings):
    """Two blocks pressed by 1 Pa: largest error of the contact pressures, and the pair."""
    (e1, n1), (e2, n2) = upper, lower
    top = body(e1, (1, 1, 0.4), (*n1, 1), (0, 0, 0), warp)
    base = body(e2, (1, 1, 0.4), (*n2, 1), (0, 0, -0.4), warp)
    p = pair(top.facets(on(0.0)), base.facets(on(0.0)), search=1e-2, **settings)
    assert (p.slave.area > 0).all()
    one, other = ((1, 0.5), (0, 0.5)) if warp else ((0, 0), (1, 0))

    def held(b: Body, z):
        places = [np.array([[x], [y], [z]], dtype=float) for x, y in (one, other)]
        a, c = (at(b, warp(x)[:, 0] if warp else x[:, 0]) for x in places)
        return np.array([3 * a, 3 * a + 1, 3 * c + 1])

    floor = 3 * np.flatnonzero(abs(base.nodes[:, 2] + 0.4) < 1e-9) + 2
    loads = pressed(top.facets(on(0.4))), np.zeros(3 * len(base.nodes))
    supports = held(top, 0.4), np.concatenate([held(base, -0.4), floor])
    return abs(pressures(top, base, p, rows_of(p), loads, supports) - 1).max(), p
