"""Surfaces of bulk data of Nastran and OptiStruct: BSURFS, SURF, plates that mark faces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.models.components.bulk_cards import BulkCard
from squealstudy.models.components.faces import faces_with_corners
from squealstudy.models.components.marked_faces import MarkedFaces
from squealstudy.models.components.mesh import PassedOver, SolidMesh

READ = ("BSURFS", "SURF", "BSURF")
PLATES = {"CTRIA3": 3, "CTRIA6": 6, "CQUAD4": 4, "CQUAD8": 8}
NO_FACES = np.zeros((0, 2), dtype=np.int64)
PlacesOfNodes = Callable[[BulkCard, list[int]], np.ndarray]


class BulkSurfaces:
    """Reads them.

    Parameters
    ----------
    mesh : SolidMesh
    cards : callable
        All cards of some names.
    places : callable
        Of node numbers of a card.
    note : callable
        Takes cards and why something of them is passed over.
    """

    def __init__(
        self,
        mesh: SolidMesh,
        cards: Callable[..., Sequence[BulkCard]],
        places: PlacesOfNodes,
        note: Callable[[list[BulkCard], str], None],
    ) -> None:
        self._mesh, self._all, self._places, self._note = mesh, cards, places, note
        self._order = np.argsort(mesh.labels)

    def read(self, plates: Sequence[str]) -> SolidMesh:
        """The mesh with its surfaces; `plates` are cards that mark faces.

        ModelError about the card of what is wrong.
        """
        surfaces, notes = self._marked(plates)
        for card in self._all("BSURFS"):
            name = f"BSURFS{card.whole(0, 'a number of the surface')}"
            _add(surfaces, name, self._listed_faces(card))
        for card in self._all("SURF"):
            name = f"SURF{card.at(0)}"
            kind = card.at(1).upper()
            if kind == "ELFACE":
                _add(surfaces, name, self._element_faces(card))
            elif kind == "FACE":
                _add(surfaces, name, self._faces_by_corners(card))
            else:
                self._note([card], "a SURF that is no list of ELFACE or FACE")
        return replace(self._mesh, surfaces=surfaces, passed_over=(*self._mesh.passed_over, *notes))

    def _marked(self, plates: Sequence[str]) -> tuple[dict[str, np.ndarray], list[PassedOver]]:
        """Plates by their properties, and those that a BSURF lists."""
        marked, labels = MarkedFaces(), dict[str, list[int]]()
        number_of: dict[int, int] = {}
        for number, card in enumerate(self._all(*plates)):
            nodes = [card.whole(2 + k, "a node number") for k in range(PLATES[card.name])]
            marked.add(np.array([number]), self._places(card, nodes)[None])
            labels.setdefault(f"PID{card.whole(1, 'a property')}", []).append(number)
            number_of[card.whole(0, "an element number")] = number
        for card in self._all("BSURF"):
            listed = card.listed(1, "an element number")
            if all(label in number_of for label in listed):
                elements = labels.setdefault(f"BSURF{card.whole(0, 'a number of the surface')}", [])
                elements += [number_of[label] for label in listed]
            else:
                self._note([card], "faces of plates, which treat_as does not call faces")
        surfaces, notes = {}, []
        for name, numbers in labels.items():
            faces, note = marked.surface(self._mesh, name, np.array(numbers))
            notes += [note] if note else []
            if len(faces):
                surfaces[name] = faces
        return surfaces, notes

    def _element(
        self, card: BulkCard, place: int
    ) -> tuple[int, np.ndarray, Sequence[Sequence[int]]]:
        """Place of an element, its nodes, its faces; ModelError about one that there is not."""
        label = card.whole(place, "an element number")
        mesh, at = self._mesh, self._order
        if not len(at):
            raise card.error(f"there is no solid element {label}", place)
        k = int(np.searchsorted(mesh.labels, label, sorter=at))
        element = int(at[min(k, len(at) - 1)])
        if mesh.labels[element] != label:
            raise card.error(f"there is no solid element {label}", place)
        b = int(np.searchsorted(mesh.starts, element, side="right")) - 1
        block = mesh.blocks[b]
        return element, block.nodes[element - mesh.starts[b]], block.kind.shape.faces

    def _listed_faces(self, card: BulkCard) -> np.ndarray:
        """Faces of a BSURFS: an element and three nodes of its face each."""
        pairs = []
        for place in range(4, len(card.fields), 4):
            if not card.at(place):
                continue
            element, element_nodes, faces = self._element(card, place)
            numbers = [card.whole(place + i, "a node") for i in (1, 2, 3)]
            nodes = set(self._places(card, numbers).tolist())
            of = [i for i, f in enumerate(faces, 1) if nodes <= {*element_nodes[list(f)]}]
            if len(of) != 1:
                label = self._mesh.labels[element]
                raise card.error(f"element {label} has no face with {numbers}", place)
            pairs.append((element, of[0]))
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def _element_faces(self, card: BulkCard) -> np.ndarray:
        """Faces of SURF, ELFACE: an element, a corner of its face and the opposite one each.

        As of PLOAD4: of a triangle of a wedge without the second; of a tetrahedron the second is
        the corner that is not of the face.
        """
        pairs = []
        for place in range(8, len(card.fields), 8):
            if not card.at(place):
                continue
            element, element_nodes, faces = self._element(card, place)
            numbers = [card.whole(place + i, "a corner", 0) for i in (1, 2)]
            named_nodes = self._places(card, [n for n in numbers if n])
            corners = [
                [int(element_nodes[i]) for i in f[: 4 if len(f) in (4, 8) else 3]] for f in faces
            ]
            of = [i for i, f in enumerate(corners, 1) if self._is_meant(f, named_nodes, len(faces))]
            if len(of) != 1:
                shown = ", ".join(str(n) for n in numbers if n) or "no corner"
                text = f"element {self._mesh.labels[element]}: {shown} does not say which face"
                raise card.error(text, place)
            pairs.append((element, of[0]))
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)

    @staticmethod
    def _is_meant(corners: list[int], given: np.ndarray, n_faces: int) -> bool:
        if not len(given) or given[0] not in corners:
            return False
        if n_faces == 4:
            return len(given) == 2 and given[1] not in corners
        if len(given) == 1:
            return len(corners) == 3
        if len(corners) == 3 or given[1] not in corners:
            return False
        return abs(corners.index(int(given[0])) - corners.index(int(given[1]))) == 2

    def _faces_by_corners(self, card: BulkCard) -> np.ndarray:
        """Faces of SURF, FACE: three or four corners each."""
        rows = []
        for place in range(8, len(card.fields), 8):
            numbers = [card.whole(place + i, "a corner", 0) for i in range(4)]
            named_nodes = self._places(card, [n for n in numbers if n])
            if len(named_nodes):
                if len(named_nodes) < 3:
                    raise card.error("expected three or four corners of a face", place)
                rows.append([*named_nodes.tolist(), *[-1] * (4 - len(named_nodes))])
        faces, there = faces_with_corners(self._mesh, np.array(rows).reshape(-1, 4))
        if not there.all():
            self._note([card], f"{(~there).sum()} of {len(rows)} faces are none of the boundary")
        return faces


def _add(surfaces: dict[str, np.ndarray], name: str, faces: np.ndarray) -> None:
    both = np.vstack([surfaces.get(name, NO_FACES), faces])
    if len(both):
        surfaces[name] = np.unique(both, axis=0)
