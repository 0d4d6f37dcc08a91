"""Surfaces in bulk data of Nastran and OptiStruct: BSURFS, SURF, and plates on faces of solids."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.models.components.bulk_cards import BulkCard
from squealstudy.models.components.faces import faces_with_corners
from squealstudy.models.components.marked_faces import MarkedFaces
from squealstudy.models.components.mesh import PassedOver, SolidMesh

READ_CARDS = ("BSURFS", "SURF", "BSURF")
PLATES = {"CTRIA3": 3, "CTRIA6": 6, "CQUAD4": 4, "CQUAD8": 8}
NO_FACES = np.zeros((0, 2), dtype=np.int64)
PlacesOfNodes = Callable[[BulkCard, list[int]], np.ndarray]


class BulkSurfaces:
    """Reader of the surfaces of a deck.

    Parameters
    ----------
    mesh : SolidMesh
    cards : callable
        Returns all cards of the given names.
    places : callable
        Returns indices of nodes in the mesh, from a card and node numbers on it.
    note : callable
        Called with cards, and why something on them is passed over.
    """

    def __init__(
        self,
        mesh: SolidMesh,
        cards: Callable[..., Sequence[BulkCard]],
        places: PlacesOfNodes,
        note: Callable[[list[BulkCard], str], None],
    ) -> None:
        self._mesh, self._cards, self._places, self._note = mesh, cards, places, note
        self._order = np.argsort(mesh.labels)

    def read(self, plates: Sequence[str]) -> SolidMesh:
        """The mesh with its surfaces; `plates` are the names of cards that mark faces.

        ModelError about a card that is wrong.
        """
        surfaces, notes = self._marked(plates)
        for card in self._cards("BSURFS"):
            name = f"BSURFS{card.whole(0, 'a number of the surface')}"
            _add(surfaces, name, self._listed_faces(card))
        for card in self._cards("SURF"):
            name = f"SURF{card.at(0)}"
            kind = card.at(1).upper()
            if kind == "ELFACE":
                _add(surfaces, name, self._element_faces(card))
            elif kind == "FACE":
                _add(surfaces, name, self._faces_by_corners(card))
            else:
                self._note([card], "a SURF that lists neither ELFACE nor FACE")
        return replace(self._mesh, surfaces=surfaces, passed_over=(*self._mesh.passed_over, *notes))

    def _marked(self, plates: Sequence[str]) -> tuple[dict[str, np.ndarray], list[PassedOver]]:
        """Surfaces that plates mark, and notes on faces left out.

        Plates of property 5 mark the surface PID5, those that BSURF 2 lists the surface BSURF2.
        """
        marked, plates_of_surface = MarkedFaces(), dict[str, list[int]]()
        plate_of_element: dict[int, int] = {}
        for plate, card in enumerate(self._cards(*plates)):
            nodes = [card.whole(2 + k, "a node number") for k in range(PLATES[card.name])]
            marked.add(np.array([plate]), self._places(card, nodes)[None])
            name = f"PID{card.whole(1, 'a property')}"
            plates_of_surface.setdefault(name, []).append(plate)
            plate_of_element[card.whole(0, "an element number")] = plate
        for card in self._cards("BSURF"):
            elements = card.listed(1, "an element number")
            if all(element in plate_of_element for element in elements):
                name = f"BSURF{card.whole(0, 'a number of the surface')}"
                surface_plates = plates_of_surface.setdefault(name, [])
                surface_plates += [plate_of_element[element] for element in elements]
            else:
                self._note([card], "it lists plates that are not faces; treat_as can make them so")
        surfaces, notes = {}, []
        for name, surface_plates in plates_of_surface.items():
            faces, note = marked.surface(self._mesh, name, np.array(surface_plates))
            notes += [note] if note else []
            if len(faces):
                surfaces[name] = faces
        return surfaces, notes

    def _element(
        self, card: BulkCard, first_field: int
    ) -> tuple[int, np.ndarray, Sequence[Sequence[int]]]:
        """Index of an element, its nodes, its faces; ModelError where it does not exist."""
        label = card.whole(first_field, "an element number")
        mesh, order = self._mesh, self._order
        if not len(order):
            raise card.error(f"there is no solid element {label}", first_field)
        k = int(np.searchsorted(mesh.labels, label, sorter=order))
        element = int(order[min(k, len(order) - 1)])
        if mesh.labels[element] != label:
            raise card.error(f"there is no solid element {label}", first_field)
        b = int(np.searchsorted(mesh.starts, element, side="right")) - 1
        block = mesh.blocks[b]
        return element, block.nodes[element - mesh.starts[b]], block.kind.shape.faces

    def _listed_faces(self, card: BulkCard) -> np.ndarray:
        """Faces of a BSURFS, each given by an element and three nodes of its face.

        Behind the number of the surface are three empty fields, then four fields for each face.
        """
        pairs = []
        for first_field in range(4, len(card.fields), 4):
            if not card.at(first_field):
                continue
            element, element_nodes, faces = self._element(card, first_field)
            numbers = [card.whole(first_field + i, "a node") for i in (1, 2, 3)]
            nodes = set(self._places(card, numbers).tolist())
            matching = [i for i, f in enumerate(faces, 1) if nodes <= {*element_nodes[list(f)]}]
            if len(matching) != 1:
                label = self._mesh.labels[element]
                raise card.error(f"element {label} has no face with {numbers}", first_field)
            pairs.append((element, matching[0]))
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def _element_faces(self, card: BulkCard) -> np.ndarray:
        """Faces of SURF, ELFACE: for each an element, a corner of its face and the opposite corner.

        As in PLOAD4, a triangle of a wedge has no second corner, and for a tetrahedron the second
        is the corner that is not on the face. A face takes a line of eight fields, after the first.
        """
        pairs = []
        for first_field in range(8, len(card.fields), 8):
            if not card.at(first_field):
                continue
            element, element_nodes, faces = self._element(card, first_field)
            numbers = [card.whole(first_field + i, "a corner", 0) for i in (1, 2)]  # 0 if empty
            named_nodes = self._places(card, [n for n in numbers if n])
            corners_of = [  # middle nodes follow the corners
                [int(element_nodes[i]) for i in face[: 4 if len(face) in (4, 8) else 3]]
                for face in faces
            ]
            matching = [
                number
                for number, corners in enumerate(corners_of, 1)
                if self._names_face(corners, named_nodes, is_tetrahedron=len(faces) == 4)
            ]
            if len(matching) != 1:
                shown = ", ".join(str(n) for n in numbers if n) or "no corner"
                text = f"element {self._mesh.labels[element]}: {shown} does not say which face"
                raise card.error(text, first_field)
            pairs.append((element, matching[0]))
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    @staticmethod
    def _names_face(corners: list[int], stated_nodes: np.ndarray, is_tetrahedron: bool) -> bool:
        """Whether the one or two nodes of a line name the face that has these corners."""
        if not len(stated_nodes) or stated_nodes[0] not in corners:
            return False
        if is_tetrahedron:
            return len(stated_nodes) == 2 and stated_nodes[1] not in corners
        if len(stated_nodes) == 1:
            return len(corners) == 3
        if len(corners) == 3 or stated_nodes[1] not in corners:
            return False
        first, second = (corners.index(int(node)) for node in stated_nodes)
        return abs(first - second) == 2  # opposite corners of a quadrilateral

    def _faces_by_corners(self, card: BulkCard) -> np.ndarray:
        """Faces of SURF, FACE, each given by three or four corners on a line, after the first."""
        rows = []  # of corners, with -1 for the fourth of a triangle
        for first_field in range(8, len(card.fields), 8):
            numbers = [card.whole(first_field + i, "a corner", 0) for i in range(4)]
            named_nodes = self._places(card, [n for n in numbers if n])
            if len(named_nodes):
                if len(named_nodes) < 3:
                    raise card.error("expected three or four corners of a face", first_field)
                rows.append([*named_nodes.tolist(), *[-1] * (4 - len(named_nodes))])
        faces, on_boundary = faces_with_corners(self._mesh, np.array(rows).reshape(-1, 4))
        if not on_boundary.all():
            self._note(
                [card], f"{(~on_boundary).sum()} of {len(rows)} faces are not on the boundary"
            )
        return faces


def _add(surfaces: dict[str, np.ndarray], name: str, faces: np.ndarray) -> None:
    all_faces = np.vstack([surfaces.get(name, NO_FACES), faces])
    if len(all_faces):
        surfaces[name] = np.unique(all_faces, axis=0)
