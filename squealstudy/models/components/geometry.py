"""Bodies of a model file and the faces that meet: one geometry serves all materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
import scipy.sparse as sp

from squealstudy.errors import ModelError
from squealstudy.models.components.bodies import (
    Body,
    Brake,
    body_of,
    held_turns,
    placement,
    turn_about,
    turned_body,
)
from squealstudy.models.components.contact_rows import Rotation, sliding
from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.face_map import FACTOR, GAP, FaceMap
from squealstudy.models.components.faces import facets
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.file_names import between
from squealstudy.models.components.file_tables import GapTable
from squealstudy.models.components.model_file import ROTOR_ANGLE, Numbers
from squealstudy.models.components.pairs import Pair, pair
from squealstudy.models.components.reach import expect_reach
from squealstudy.models.components.rotor_angle import expect_rotor, turns_with
from squealstudy.models.components.set_names import has_name
from squealstudy.models.fem.sampling import Surface
from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.turning import Rotors

SEARCH_OVER_FACET = 0.5  # default search distance over the radius of a facet
LAYER_POINTS = 3  # points along a side of a facet
MAX_TIE_GAP_OVER_FACET = 1e-4  # a tie over a larger gap, over facet size, strains in rigid turns
TIE_STIFFNESS_RATIO = 1000.0  # stiffness of a tie over that of a layer of elements beside it


class Geometry:
    """Bodies of a model file at an angle of the rotor, and the points at which they meet.

    Parameters
    ----------
    brake : Brake
    angle : float
        Angle by which turning components are turned from their meshes, deg.

    Attributes
    ----------
    bodies : dict of str -> Body
        Bodies in the order of the file, turned by the angle.
    spans : dict of str -> slice
        Range of each body among the displacements 3 * node + axis of all nodes.
    n_dof : int
        Number of these displacements.
    kept : dict of str -> ndarray of int
        Degrees of freedom of each body that no [[fixed]] table of the model file holds.
    rotation : Rotation or None
        Axis of the sliding; None where the file has none.
    contacts : list of Pair
        Contact points of each contact of the file.
    ties : list of Pair
        Points of each tie of the file.
    layers : list of Surface or Pair
        Points of each layer of the file; a Surface for a layer to ground.
    loads : list of (Surface, Surface or None)
        Points on which each load presses, and those of its reaction.
    """

    def __init__(self, brake: Brake, angle: float = 0.0) -> None:
        self.brake, self.file, self.angle = brake, brake.file, angle
        self.rotation = self._rotation()
        self.bodies = {name: self._body(name) for name in self.file.components}
        ends = np.cumsum([0, *(3 * len(b.nodes) for b in self.bodies.values())])
        self.spans = {
            name: slice(int(a), int(b))
            for name, a, b in zip(self.bodies, ends, ends[1:], strict=False)
        }
        self.n_dof = int(ends[-1])
        self.contacts = [self._contact(i) for i in range(len(self.file.contact))]
        self.ties = [self._tie(i) for i in range(len(self.file.tie))]
        self.layers = [self._layer(i) for i in range(len(self.file.layer))]
        self.loads = [self._load(i) for i in range(len(self.file.load))]
        self.kept = self._kept()

    def _body(self, name: str) -> Body:
        """A component, turned by the angle if it turns."""
        body = body_of(self.brake, name)
        return turned_body(body, *self._turn()) if name in self.turned else body

    @property
    def turned(self) -> tuple[str, ...]:
        """Names of the components that are turned from their meshes."""
        return self.file.turning if self.angle else ()

    def _turn(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and shift (3,) [m] of the turning components by the angle."""
        assert self.rotation is not None
        turn, point = turn_about(self.rotation.direction, self.angle), self.rotation.point
        return turn, point - turn @ point

    # -- names of the file -----------------------------------------------------------------------
    def split(self, reference: str, keys: KeyPath) -> tuple[str, str]:
        """Component and set of ``COMPONENT.SET``; PlacedError where one of them does not exist."""
        name, dot, label = reference.partition(".")
        if not dot or not label:
            raise PlacedError(keys, f"expected COMPONENT.SET, got '{reference}'")
        if name not in self.bodies:
            names = tuple(self.bodies)
            text = f"there is no component '{name}'; there is {', '.join(names)}"
            raise PlacedError(keys, text, name, names)
        mesh = self.bodies[name].mesh
        if not (has_name(mesh.surfaces, label) or has_name(mesh.node_sets, label)):
            sets = tuple(sorted({*mesh.surfaces, *mesh.node_sets}))
            listed = f"it has {', '.join(sets)}" if sets else "it has no sets at all"
            raise PlacedError(
                keys,
                f"{name} ({mesh.origin.name}) has no surface or node set '{label}'; {listed}",
                label,
                sets,
            )
        return name, label

    def face(self, reference: str, keys: KeyPath) -> tuple[str, Facets]:
        """Component and facets of a face ``COMPONENT.SET``."""
        name, label = self.split(reference, keys)
        body = self.bodies[name]
        try:
            blocks = tuple(group.nodes for group in facets(body.mesh, label))
            face_facets = Facets(body.nodes, blocks, reference)
        except ModelError as error:
            raise PlacedError(keys, str(error)) from error
        self._check_rows(
            name, np.unique(np.concatenate([b.ravel() for b in blocks])), reference, keys
        )
        return name, face_facets

    def _check_rows(self, name: str, nodes: np.ndarray, reference: str, keys: KeyPath) -> None:
        """Raise PlacedError where a component's matrices have no rows for some nodes of a set."""
        body = self.bodies[name]
        without_rows = nodes[body.expansion.lacking.reshape(-1, 3)[nodes].all(axis=1)]
        if len(without_rows):
            map_file = self.file.components[name].dof
            question = f"is {map_file} their DOF map?" if map_file else "is this their mesh?"
            raise PlacedError(
                keys,
                f"the matrices of {name} have no rows for {body.mesh.nodes_named(without_rows)} of "
                f"{reference}: {question}",
            )

    def nodes(self, reference: str, keys: KeyPath) -> tuple[str, np.ndarray]:
        """Component and places of the nodes of a set ``COMPONENT.SET``."""
        name, label = self.split(reference, keys)
        return name, self.bodies[name].mesh.node_set(label)

    def points(self, reference: str, keys: KeyPath) -> tuple[str, Surface]:
        """Component and points of a set: points of a face, or all nodes if the set is no face."""
        name, nodes = self.nodes(reference, keys)
        body, label = self.bodies[name], reference.partition(".")[2]
        if not has_name(body.mesh.surfaces, label):
            try:
                facets(body.mesh, label)
            except ModelError:
                return name, self._node_points(name, nodes, reference, keys)
        return name, self.face(reference, keys)[1].gauss_points(LAYER_POINTS)[0]

    def _node_points(self, name: str, nodes: np.ndarray, reference: str, keys: KeyPath) -> Surface:
        """Nodes of a set as points of weight 1 each."""
        self._check_rows(name, nodes, reference, keys)
        x, ones = self.bodies[name].nodes, np.ones(len(nodes))
        rows = (np.arange(len(nodes)), nodes)
        shape = sp.csr_matrix((ones, rows), (len(nodes), len(x)))
        return Surface(x[nodes], ones, np.tile([0.0, 0.0, 1.0], (len(nodes), 1)), shape)

    def _kept(self) -> dict[str, np.ndarray]:
        """The attribute `kept`; PlacedError where a set cannot be held."""
        fixed_freedoms = {
            name: np.zeros(b.expansion.E.shape[1], bool) for name, b in self.bodies.items()
        }
        for i, fixed in enumerate(self.file.fixed):
            keys: KeyPath = ("fixed", i, "set")
            name, nodes = self.nodes(fixed.set, keys)
            body = self.bodies[name]
            if name in self.turned and not turns_with(fixed.dofs, self._turn()[0]):
                text = f"holds {fixed.set} in some directions alone, which do not turn with it"
                raise PlacedError(ROTOR_ANGLE, f"[[fixed]] {text}: expected all, or the axis")
            of_turns = [3 * nodes + d - 4 for d in fixed.dofs if d > 3]
            fixed_freedoms[name] |= held_turns(of_turns, body, (*keys[:2], "dofs"))
            fixed_by_axis = [3 * nodes + d - 1 for d in fixed.dofs if d <= 3]
            fixed_rows = np.concatenate([np.zeros(0, dtype=np.int64), *fixed_by_axis])
            fixed_rows = fixed_rows[~body.expansion.lacking[fixed_rows]]
            follows = fixed_rows[~np.isin(fixed_rows, body.expansion.places)]
            if len(follows):
                raise PlacedError(
                    keys,
                    f"{body.mesh.nodes_named(np.unique(follows // 3))} of {fixed.set} follow "
                    "others by a tie, a coupling, or the recovery of a superelement: hold those",
                )
            fixed_freedoms[name] |= np.isin(body.expansion.places, fixed_rows)
        return {name: np.flatnonzero(~h) for name, h in fixed_freedoms.items()}

    # -- where faces meet ------------------------------------------------------------------------
    def _rotation(self) -> Rotation | None:
        table = self.file.rotation
        if table is None:
            return None
        try:
            point = np.array(table.point) * LENGTH.factor(self.file.units)
            return Rotation(point, np.array(table.axis))
        except ModelError as error:
            raise PlacedError(("rotation",), str(error)) from error

    def _contact(self, number: int) -> Pair:
        table = self.file.contact[number]
        keys: KeyPath = ("contact", number)
        _, slave = self.face(table.slave, (*keys, "slave"))
        _, master = self.face(table.master, (*keys, "master"))
        size = LENGTH.factor(self.file.units)
        measured = table.initial_gap if isinstance(table.initial_gap, GapTable) else None
        gap = "zero" if isinstance(table.initial_gap, GapTable) else table.initial_gap
        try:
            facing = pair(
                slave,
                master,
                search=table.search * size,
                quadrature=table.quadrature,
                initial_gap=gap if isinstance(gap, str) else gap * size,
                points_per_side=table.points,
            )
        except ModelError as error:
            raise PlacedError(keys, str(error)) from error
        expect_reach(facing, keys, slave, master, table.search, self.file.units)
        if measured is None:
            return facing
        return replace(facing, gap0=self.measured(number, facing, "initial_gap", measured.file))

    def measured(self, number: int, pair: Pair, key: str, file_name: str) -> np.ndarray:
        """Values (n,) [SI] at contact points, of a file in coordinates of the slave's file.

        `key` is the key of the contact that names the file: `initial_gap` or `friction_factor`.
        """
        name = self.file.sides(number)[0]
        turn, shift = placement(name, self.file.components[name], self.file.units)
        if name in self.turned:
            rotor_turn, rotor_shift = self._turn()
            turn, shift = rotor_turn @ turn, rotor_turn @ shift + rotor_shift
        try:
            column = GAP if key == "initial_gap" else FACTOR
            size = LENGTH.factor(self.file.units)
            face_map = FaceMap(self.brake.located(file_name), size, column)
            return face_map.at((pair.slave.points - shift) @ turn)
        except ModelError as error:
            raise PlacedError(("contact", number, key, "file"), str(error)) from error

    def _layer(self, number: int) -> Surface | Pair:
        table = self.file.layer[number]
        keys: KeyPath = ("layer", number)
        side, other_side = between(table.between, keys)
        _, slave = self.face(side, (*keys, "between"))
        if other_side is None:
            return slave.gauss_points(LAYER_POINTS)[0]
        _, master = self.face(other_side, (*keys, "between"))
        return self._opposite(slave, master, keys, table.search, table.quadrature)

    def _opposite(
        self, slave: Facets, master: Facets, keys: KeyPath, distance: float | None, quadrature: str
    ) -> Pair:
        """Points of two faces that meet within a distance, by default half a radius of a facet."""
        size = LENGTH.factor(self.file.units)
        default = SEARCH_OVER_FACET * float(slave.radii.mean())
        search = default if distance is None else distance * size
        try:
            facing = pair(slave, master, search=search, quadrature=quadrature)
        except ModelError as error:
            raise PlacedError(keys, str(error)) from error
        expect_reach(facing, keys, slave, master, search / size, self.file.units)
        return facing

    def _tie(self, number: int) -> Pair:
        table = self.file.tie[number]
        keys: KeyPath = ("tie", number)
        (slave_part, slave), (master_part, master) = (
            self.face(getattr(table, key), (*keys, key)) for key in ("slave", "master")
        )
        if slave_part == master_part:
            raise PlacedError(keys, f"expected faces of two components, got two of {slave_part}")
        facing = self._opposite(slave, master, keys, table.search, "clipped")
        facet = 2 * float(slave.radii.mean())
        widest = float(np.abs(facing.geometric_gap).max())
        if widest > MAX_TIE_GAP_OVER_FACET * facet:
            raise PlacedError(
                keys,
                f"the faces are up to {widest / facet:.1g} of a facet apart, more than "
                f"{MAX_TIE_GAP_OVER_FACET:g}: a tie over a gap would strain in rigid turns. Join "
                "the meshes in one .inp with *TIE, which moves the nodes, or use a [[layer]] of "
                "finite stiffness",
            )
        return facing

    def bedding(self, sides: Sequence[str], keys: KeyPath) -> float:
        """Stiffness per area [N/m3] of a tie or a coupling for which the file states none.

        `sides` are keys of its faces; the facets of the first give the size of elements. Raises
        PlacedError where no component beside it has materials.
        """
        table = self.file.at(keys)
        stiffest = 0.0
        for key in sides:
            body = self.bodies[self.split(getattr(table, key), (*keys, key))[0]]
            if body.matrices is None:
                tensors = [m.stiffness() for m in body.mesh.materials.values()]
                stiffest = max(stiffest, *(float(C.diagonal()[:3].max()) for C in tensors))
        if not stiffest:
            raise PlacedError(
                keys, "expected bedding = STIFFNESS PER AREA: the matrices have no materials"
            )
        _, face = self.face(getattr(table, sides[0]), (*keys, sides[0]))
        return TIE_STIFFNESS_RATIO * stiffest / (2 * float(face.radii.mean()))

    def _load(self, number: int) -> tuple[Surface, Surface | None]:
        table = self.file.load[number]
        keys: KeyPath = ("load", number)
        _, pressed = self.face(table.pressure_on, (*keys, "pressure_on"))
        surface = pressed.gauss_points(LAYER_POINTS)[0]
        if table.reaction_on is None:
            return surface, None
        _, reaction_face = self.face(table.reaction_on, (*keys, "reaction_on"))
        if table.reaction == "spread":
            return surface, reaction_face.gauss_points(LAYER_POINTS)[0]
        search = SEARCH_OVER_FACET * float(pressed.radii.mean())
        try:
            facing = pair(pressed, reaction_face, search=search, quadrature="gauss")
        except ModelError as error:
            raise PlacedError(keys, str(error)) from error
        size = LENGTH.factor(self.file.units)
        expect_reach(facing, keys, pressed, reaction_face, search / size, self.file.units)
        return facing.slave, facing.master

    @cached_property
    def effective_radius(self) -> float | None:
        """Radius [m] of the imposed sliding speed; None where all points slide at one speed."""
        table = self.file.rotation
        return None if table is None or table.uniform else self.mean_radius

    @cached_property
    def mean_radius(self) -> float | None:
        """Radius [m] of the sliding speed: the file's, or the arm of friction averaged by area.

        None where nothing slides.
        """
        table, rotation = self.file.rotation, self.rotation
        if table is None or rotation is None:
            return None
        if table.effective_radius is not None:
            return table.effective_radius * LENGTH.factor(self.file.units)
        arms, areas = [], []
        for i, (contact, facing) in enumerate(zip(self.file.contact, self.contacts, strict=True)):
            if contact.kind == "sliding":
                try:
                    arms.append(
                        sliding(facing, rotation, f"{contact.slave} on {contact.master}")[2]
                    )
                except ModelError as error:
                    raise PlacedError(("contact", i), str(error)) from error
                areas.append(facing.slave.area)
        if not arms:
            return None
        return float(np.average(np.concatenate(arms), weights=np.concatenate(areas)))

    @property
    def rotors(self) -> Rotors | None:
        """The turning components and their axis; None where nothing turns."""
        if self.rotation is None:
            return None
        point = np.asarray(self.rotation.point)
        radius = self.mean_radius
        no_radius = "" if radius else "nothing slides here: sliding_speed is at no radius"
        return Rotors(self.file.turning, point, self.rotation.direction, radius, no_radius)


@lru_cache(maxsize=4)
def geometry_of(brake: Brake, angle: float = 0.0) -> Geometry:
    """The geometry of a model file with its turning components at an angle [deg], cached.

    Raises PlacedError where the file cannot be used, or has no rotor that can be turned.
    """
    if angle:
        expect_rotor(brake.file)
    return Geometry(brake, angle)


def geometry_at(brake: Brake, overrides: Mapping[KeyPath, float]) -> Geometry:
    """`geometry_of` at the angle that the file states, or a parameter gives."""
    angle = 0.0 if brake.file.rotation is None else Numbers(brake.file, overrides).at(*ROTOR_ANGLE)
    return geometry_of(brake, angle)
