"""The assembly of a model file: components, damping, contact, layers, springs, supports, load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.laws import ContactLaw, FrictionCurve, friction_curve
from squealstudy.laws.own_friction import SLIDING
from squealstudy.models.assembly import Assembly, Component, ContactInterface
from squealstudy.models.component_slices import expand_rows
from squealstudy.models.components.attached import (
    component_matrices,
    directions_at,
    springs_on,
)
from squealstudy.models.components.bodies import (
    Body,
    Brake,
    changed_mesh,
    own_numbers,
)
from squealstudy.models.components.contact_friction import state_of, tangential_of
from squealstudy.models.components.contact_numbers import as_in_file
from squealstudy.models.components.contact_rows import (
    ContactRows,
    contact_interface,
    contact_rows,
    tangents,
)
from squealstudy.models.components.file_matrices import check_definite, symmetric
from squealstudy.models.components.file_names import between
from squealstudy.models.components.geometry import (
    Geometry,
    geometry_at,
    geometry_of,
)
from squealstudy.models.components.heat import hot_gaps
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.components.mesh_cells import mesh_cells, moved_cells
from squealstudy.models.components.mesh_matrices import stiffness_matrix
from squealstudy.models.components.model_file import BY_MATERIAL, GROUND, Numbers
from squealstudy.models.components.pairs import Pair
from squealstudy.models.components.rotation import turning_matrix
from squealstudy.models.components.turn_rows import coupled, turn_of
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.linear_interfaces import SpringInterface

N_COMPARED = 1500  # degrees of freedom at which mode shapes of two structures are compared


def build_assembly(
    brake: Brake,
    law: ContactLaw,
    overrides: Mapping[KeyPath, float],
    curve: FrictionCurve | None = None,
) -> Assembly:
    """Assemble a model file.

    Parameters
    ----------
    brake : Brake
    law : ContactLaw
        The contact law.
    overrides : mapping of key -> float
        Values in SI units that replace numbers of the file, by key.
    curve : FrictionCurve, optional
        The friction law of the study; by default that of `friction_curve`.

    Raises
    ------
    PlacedError
        Something in the file is wrong (with its key), or the file has no loads.
    ModelError
        Values that no material can have.
    """
    geometry, as_meshed = geometry_at(brake, overrides), geometry_of(brake)
    numbers = Numbers(brake.file, overrides)
    matrices = {name: component_matrices(as_meshed, name, overrides) for name in geometry.bodies}
    free = geometry.kept
    components, rotors = [], geometry.rotors
    for name, body in geometry.bodies.items():
        C = damping_matrix(as_meshed.bodies[name], numbers, *matrices[name])
        mesh = changed_mesh(body, own_numbers(name, overrides))
        turning = None
        if rotors is not None and name in rotors.names and not rotors.unturned:
            try:
                turning = turning_matrix(body, mesh, rotors, matrices[name][1])
            except ModelError as error:  # of a study that asks for it
                rotors = replace(rotors, unturned=str(error))
        components.append(_component(body, mesh, *matrices[name], C, turning, free[name]))
    E, turns = (
        sp.block_diag(
            [getattr(body.expansion, key)[:, free[name]] for name, body in geometry.bodies.items()],
            format="csr",
        )
        for key in ("E", "turns")
    )
    interfaces = _Interfaces(geometry, numbers, E, turns)
    contact, ties = interfaces.contact(law, curve or friction_curve())
    load = interfaces.load()
    springs = (*interfaces.springs(), *ties)
    cold = Assembly(tuple(components), contact, springs, load, np.zeros_like(load), rotors)
    gap0 = contact.gap0 + hot_gaps(cold, geometry, overrides)
    return replace(cold, contact=replace(contact, gap0=gap0))


def _component(
    body: Body,
    mesh: SolidMesh,
    K: sp.csr_matrix,
    M: sp.csr_matrix,
    C: sp.csr_matrix | None,
    turning: sp.csr_matrix | None,
    dofs: np.ndarray,
) -> Component:
    keeps_all_dofs = len(dofs) == K.shape[0]
    if not keeps_all_dofs:
        K, M = (A[dofs][:, dofs].tocsr() for A in (K, M))
        C, turning = (None if A is None else A[dofs][:, dofs].tocsr() for A in (C, turning))
    if (M.diagonal() <= 0).any():
        dofs_in_file = body.expansion.places[dofs[M.diagonal() <= 0]]
        bad = np.unique(dofs_in_file[dofs_in_file >= 0] // 3)
        which = body.mesh.nodes_named(bad) if len(bad) else "turns of a reference node"
        raise PlacedError(("components", body.name), f"{which}: expected a mass above zero")
    if body.matrices is not None:
        check_definite(body.name, K, M)
    expansion = body.expansion
    plain = expansion.plain
    dofs_in_file = expansion.places[dofs]
    return Component(
        body.name,
        M,
        K,
        coordinates=body.nodes,
        correspondence=_compared(M),
        dofs=None
        if keeps_all_dofs and plain and len(dofs) == 3 * len(body.nodes)
        else dofs_in_file,
        expansion=None if plain else expansion.E[:, dofs].tocsr(),
        cells=mesh_cells(mesh) if body.matrices is None else moved_cells(mesh, expansion.lacking),
        C=C,
        turning=turning,
    )


def _compared(M: sp.csr_matrix) -> sp.csr_matrix:
    """Rows (m, n) that observe some degrees of freedom, times the square root of their mass.

    Up to `N_COMPARED` are drawn at random, always the same of a number n.
    """
    n = M.shape[0]
    some = np.sort(np.random.default_rng(0).permutation(n)[:N_COMPARED])
    weight = np.sqrt(M.diagonal()[some] * (n / len(some)))
    return sp.csr_matrix((weight, (np.arange(len(some)), some)), shape=(len(some), n))


class _Interfaces:
    """Contact, springs and load of a brake, over the degrees of freedom that are not fixed."""

    def __init__(
        self,
        geometry: Geometry,
        numbers: Numbers,
        expansion: sp.csr_matrix,
        turns: sp.csr_matrix,
    ) -> None:
        self._g, self._numbers, self._expansion, self._turns = geometry, numbers, expansion, turns

    def _free(self, rows: sp.spmatrix) -> sp.csr_matrix:
        """Rows over displacements of nodes as rows over the degrees of freedom not fixed."""
        free_rows = (rows.tocsr() @ self._expansion).tocsr()
        free_rows.sort_indices()
        return free_rows

    def _rows(self, *parts: tuple[str, sp.spmatrix]) -> sp.csr_matrix:
        return self._free(expand_rows(parts, self._g.spans, self._g.n_dof))

    def _turn_rows(self, *parts: tuple[str, sp.spmatrix]) -> sp.csr_matrix:
        """Rows over rotations of nodes as rows over the degrees of freedom not fixed."""
        over_freedoms = expand_rows(parts, self._g.spans, self._g.n_dof).tocsr() @ self._turns
        return over_freedoms.tocsr()

    def _pair_rows(
        self,
        number: int,
        kind: str,
        pair: Pair,
        names: Sequence[str],
        slip: Sequence[float] | None = None,
    ) -> ContactRows:
        """Rows of a pair over the displacements of all nodes, fixed ones included."""
        slave, master = (name.partition(".")[0] for name in names)
        rotor = self._g.file.rotor
        if kind == "sliding":
            keys: KeyPath = ("contact", number)
            if self._g.rotation is None:
                raise PlacedError(keys, "a sliding contact needs [rotation] with the axis")
            if rotor not in (None, slave, master):
                raise PlacedError(
                    keys,
                    f"neither {slave} nor {master} is the rotor '{rotor}': expected kind "
                    '"stuck" or "frictionless"',
                )
        return contact_rows(
            pair,
            slave,
            master,
            self._g.spans,
            self._g.n_dof,
            kind=kind,
            rotation=self._g.rotation,
            rotor="slave" if rotor == slave else "master",
            slip=None if slip is None else np.array(slip),
        )

    def contact(
        self, law: ContactLaw, curve: FrictionCurve
    ) -> tuple[ContactInterface, list[SpringInterface]]:
        """All contact points, and the springs that hold stuck ones in their plane."""
        parts, ties = [], []
        for i, (table, facing) in enumerate(
            zip(self._g.file.contact, self._g.contacts, strict=True)
        ):
            try:
                sides = (table.slave, table.master)
                rows = self._pair_rows(
                    i, table.kind or "frictionless", facing, sides, table.sliding
                )
            except PlacedError:
                raise
            except ModelError as error:
                raise PlacedError(("contact", i), str(error)) from error
            parts.append(rows)
            if table.tangential is not None:
                stiffness = tangential_of(self._numbers, i)
                if table.state is not None and state_of(self._numbers, i) == SLIDING:
                    stiffness = 0.0
                tie = rows.ties(self._g.file.name_of("contact", i), stiffness, table.state is None)
                ties.append(replace(tie, B=self._free(tie.B)))
        interface = contact_interface(parts, law)
        N, T, T_perp = (self._free(A) for A in (interface.N, interface.T, interface.T_perp))
        interface = replace(interface, N=N, T=T, T_perp=T_perp)
        sizes = [len(p.area) for p in parts]
        return as_in_file(interface, sizes, self._g, self._numbers, curve), ties

    # -- layers and springs ----------------------------------------------------------------------
    def springs(self) -> list[SpringInterface]:
        """Springs of all ties, couplings, layers and springs of the file."""
        ties = [self._tie(i) for i in range(len(self._g.file.tie))]
        layers = [self._layer(i) for i in range(len(self._g.file.layer))]
        couplings = [self._coupling(i) for i in range(len(self._g.file.coupling))]
        springs = [self._spring(i) for i in range(len(self._g.file.spring))]
        return [*ties, *couplings, *layers, *springs]

    def _tie(self, number: int) -> SpringInterface:
        table, facing = self._g.file.tie[number], self._g.ties[number]
        rows = self._pair_rows(number, "frictionless", facing, (table.slave, table.master))
        B = self._free(sp.vstack([rows.N, rows.T, rows.T_perp]))
        keys: KeyPath = ("tie", number, "bedding")
        is_given = table.bedding is not None or keys in self._numbers.given
        bedding = (
            self._numbers.at(*keys) if is_given else self._g.bedding(("slave", "master"), keys[:2])
        )
        return SpringInterface(table.name, B, np.tile(bedding * rows.area, 3))

    def _coupling(self, number: int) -> SpringInterface:
        table = self._g.file.coupling[number]
        keys: KeyPath = ("coupling", number, "bedding")
        is_given = table.bedding is not None or keys in self._numbers.given
        bedding = self._numbers.at(*keys) if is_given else self._g.bedding(("face",), keys[:2])
        coupling = coupled(self._g, number, bedding, self._rows, self._turn_rows)
        return SpringInterface(table.name, coupling.B, coupling.stiffness)

    def _layer(self, number: int) -> SpringInterface:
        table, layer = self._g.file.layer[number], self._g.layers[number]
        faces = [n for n in table.between if n.casefold() != GROUND]
        if isinstance(layer, Pair):
            rows = self._pair_rows(number, "frictionless", layer, faces)
            B = self._free(sp.vstack([rows.N, rows.T, rows.T_perp]))
            area = rows.area
        else:
            name = faces[0].partition(".")[0]
            directions = (layer.normal, *tangents(layer.normal))
            B = sp.vstack([self._rows((name, layer.observe(d))) for d in directions]).tocsr()
            area = layer.area
        normal, tangential = (
            self._numbers.at("layer", number, k) for k in ("normal", "tangential")
        )
        stiffness = np.concatenate([k * area for k in (normal, tangential, tangential)])
        return SpringInterface(table.name, B, stiffness, table.in_static)

    def _spring(self, number: int) -> SpringInterface:
        table = self._g.file.spring[number]
        keys: KeyPath = ("spring", number)
        k = self._numbers.list_at(*keys, "stiffness")
        side, other_side = between(table.between, keys)
        sets = [self._g.points(n, (*keys, "between")) for n in (side, other_side) if n is not None]

        def directions(points: np.ndarray) -> list[np.ndarray]:
            try:
                return directions_at(points, table.axes, self._g.rotation)
            except ModelError as error:
                raise PlacedError((*keys, "axes"), str(error)) from error

        second = sets[1] if other_side is not None else None
        interface = springs_on(
            table.name, sets[0], second, k, directions, self._rows, table.in_static
        )
        if table.rotary is None:
            return interface
        names = [n for n in (side, other_side) if n is not None]
        parts = [
            turn_of(self._g, n, points, (*keys, "between"))
            for n, (_, points) in zip(names, sets, strict=True)
        ]
        turned = [
            self._rows((t.component, t.by_displacements))
            + self._turn_rows((t.component, t.by_turns))
            for t in parts
        ]
        relative = turned[0] if len(turned) == 1 else turned[0] - turned[1]
        middle = np.vstack([points.points for _, points in sets]).mean(axis=0)
        axes = np.array([d[0] for d in directions(middle[None])])
        B = sp.vstack([interface.B, sp.csr_matrix(axes) @ relative]).tocsr()
        stiffness = np.append(interface.stiffness, self._numbers.list_at(*keys, "rotary"))
        return replace(interface, B=B, stiffness=stiffness)

    # -- load ------------------------------------------------------------------------------------
    def load(self) -> np.ndarray:
        """Forces (n_dof,) of a unit brake pressure [N/Pa]."""
        if not self._g.file.load:
            text = "there is no [[load]]: the brake pressure pushes nothing together"
            raise PlacedError(("load",), text)
        total = np.zeros(self._expansion.shape[1])
        for i, table in enumerate(self._g.file.load):
            mesh_area = float(self._g.loads[i][0].area.sum())
            area = mesh_area if table.area is None else self._numbers.at("load", i, "area")
            sides = zip(self._g.loads[i], (table.pressure_on, table.reaction_on), strict=True)
            for surface, reference in sides:
                if surface is not None and reference is not None:
                    share = area * surface.area / surface.area.sum()
                    rows = self._rows(
                        (reference.partition(".")[0], surface.observe(-surface.normal))
                    )
                    total += rows.T @ share
        return total


def damping_matrix(
    body: Body, numbers: Numbers, K: sp.csr_matrix, M: sp.csr_matrix
) -> sp.csr_matrix | None:
    """Damping matrix C_file + alpha M + beta K + sum of beta_m K_m over materials m [N s/m].

    None where the component has no damping.

    Parameters
    ----------
    body : Body
    numbers : Numbers
    K, M : csr_matrix (n, n)
        Of the component with the point masses on it.

    Raises
    ------
    PlacedError
        The component has no such material, or its stiffness cannot be computed.
    """
    keys: KeyPath = ("components", body.name)
    alpha, beta = (numbers.at(*keys, key) for key in ("mass_damping", "stiffness_damping"))
    parts = [factor * A for factor, A in ((alpha, M), (beta, K)) if factor]
    if body.matrices is not None and body.matrices[2] is not None:
        parts.append(body.matrices[2])
    table = numbers.file.components[body.name].material_damping
    by_material = {name: numbers.at(*keys, BY_MATERIAL, name) for name in table}
    if any(by_material.values()):
        parts += _of_materials(body, numbers.given, by_material)
    return symmetric(sum(parts)) if parts else None


def _of_materials(
    body: Body, overrides: Mapping[KeyPath, float], by_material: Mapping[str, float]
) -> list[sp.csr_matrix]:
    mesh = changed_mesh(body, own_numbers(body.name, overrides))
    matrices = []
    for name, beta in by_material.items():
        names = tuple(sorted(set(mesh.material)))
        if name not in names:
            listed = ", ".join(names)
            message = f"{body.name} has no material '{name}'; it has {listed}"
            raise PlacedError(("components", body.name, BY_MATERIAL, name), message, name, names)
        try:
            matrices.append(beta * body.expansion.restricted(stiffness_matrix(mesh, [name])))
        except ModelError as error:
            raise PlacedError(("components", body.name), str(error)) from error
    return matrices
