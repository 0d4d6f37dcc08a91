"""Components from bulk data of Nastran and OptiStruct (``.bdf``, ``.nas``, ``.dat``, ``.fem``).

Reads solids with their materials, node sets, surfaces, couplings, springs and masses. Elements have
the formulations of this program, not those of Nastran. Element sets are named by property, PID3,
node sets by the number of their SET1, SET7.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.bulk_cards import BulkCard, Systems, read_bulk
from squealstudy.models.components.bulk_couplings import READ as COUPLINGS
from squealstudy.models.components.bulk_couplings import BulkCouplings
from squealstudy.models.components.bulk_discrete import READ as DISCRETE
from squealstudy.models.components.bulk_discrete import BulkDiscrete
from squealstudy.models.components.bulk_materials import OVER_TEMPERATURE, BulkMaterials
from squealstudy.models.components.bulk_materials import READ as MATERIALS
from squealstudy.models.components.bulk_names import MODEL_FILE, P_ELEMENTS, PASSED_OVER
from squealstudy.models.components.bulk_surfaces import PLATES, BulkSurfaces
from squealstudy.models.components.bulk_surfaces import READ_CARDS as SURFACES
from squealstudy.models.components.constraints import Coupling
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.marked_faces import FACES
from squealstudy.models.components.mesh import ElementBlock, PassedOver, SolidMesh
from squealstudy.models.components.middle_nodes import LACKING, Middles
from squealstudy.models.matrices.dmig import fields_of

# card and number of nodes -> name of the element, formulation, columns of its nodes in our order
SOLIDS: dict[tuple[str, int], tuple[str, str, tuple[int, ...]]] = {
    ("CTETRA", 4): ("CTETRA4", "C3D4", tuple(range(4))),
    ("CTETRA", 10): ("CTETRA10", "C3D10", tuple(range(10))),
    ("CPYRAM", 5): ("CPYRAM5", "C3D5", tuple(range(5))),
    ("CPYRAM", 13): ("CPYRAM13", "C3D13", tuple(range(13))),
    ("CPENTA", 6): ("CPENTA6", "C3D6", tuple(range(6))),
    ("CPENTA", 15): ("CPENTA15", "C3D15", (*range(9), 12, 13, 14, 9, 10, 11)),
    ("CHEXA", 8): ("CHEXA8", "C3D8I", tuple(range(8))),
    ("CHEXA", 20): ("CHEXA20", "C3D20", (*range(12), *range(16, 20), *range(12, 16))),
}
BRICK = "CHEXA8"
BUBBLE, FULL = ("", "0", "BUBBLE"), ("1", "FULL")  # values of IN and ISOP of a PSOLID
CORNERS = {"CTETRA": 4, "CPYRAM": 5, "CPENTA": 6, "CHEXA": 8}
PLATE_SECTIONS = ("PSHELL",)
SYSTEMS = ("CORD2R", "CORD2C", "CORD2S")
OF_MESH = ("GRID", "GRDSET", "SET1", *CORNERS, "PSOLID", *SYSTEMS)
READ = (*OF_MESH, *MATERIALS, *OVER_TEMPERATURE, *SURFACES, *COUPLINGS, *DISCRETE)
# commands of case control that add a matrix of DMIG to those of the elements
SELECTED = ("K2GG", "M2GG", "B2GG", "K42GG", "K2PP", "M2PP", "B2PP")
SELECTS = re.compile(rf"\s*({'|'.join(SELECTED)})\s*=", re.I)
ORDERS = "; p-elements have orders and curved sides that elements here do not have"
COUPLED = "COUPMASS"  # the parameter of consistent masses
WEIGHT = "WTMASS"  # the parameter that multiplies the mass of elements


def read_bdf(
    path: Path,
    part: str | None = None,
    *,
    treat_as: Mapping[str, str] | None = None,
    pass_over: Collection[str] = (),
    points: bool = False,
    temperature: float | None = None,
) -> SolidMesh:
    """Read a component from bulk data, in the units of the file.

    Parameters
    ----------
    path : Path
    part : str or None
        Element set to read: those of a property, such as PID3. None reads all elements.
    treat_as : dict of str -> str
        Formulation by type of element, such as CHEXA8. For plates, such as CQUAD4, it can be
        "faces": their properties become surfaces of the solids.
    pass_over : collection of str
        Unsupported cards, and commands of case control, to leave out without an error.
    points : bool
        The deck has the nodes of matrices: it needs no elements, all nodes stay, and unsupported
        cards are left out without an error.
    temperature : float or None
        Temperature at which to take materials with MATT1.

    Returns
    -------
    SolidMesh
        `passed_over` lists all cards that are left out.

    Raises
    ------
    ModelError
        A card is malformed, or refers to what the deck lacks; cards are not supported.
    """
    formulation_of = _treated(path, treat_as or {})
    cards, above = read_bulk(path)
    named = {name.upper() for name in treat_as or {}}
    ignored = {name.upper() for name in pass_over}
    if points:
        ignored |= {*SELECTED, *(card.name for card in cards if card.name not in READ)}
    mesh = _Deck(path, cards, above, formulation_of, named, ignored, points, temperature).mesh()
    return mesh if part is None else mesh.part(mesh.find("element_sets", part))


def _treated(path: Path, treat_as: Mapping[str, str]) -> dict[str, str]:
    """Formulation of each type of element, and "faces" for plates that mark faces."""
    formulation_of = {name: formulation for name, formulation, _ in SOLIDS.values()}
    for written, name in treat_as.items():
        if written.upper() in PLATES and name == FACES:
            formulation_of[written.upper()] = FACES
        elif written.upper() not in formulation_of or name not in FORMULATIONS:
            names = ", ".join(n for n, *_ in SOLIDS.values())
            raise ModelError(
                f"{path}: treat_as {written} = '{name}': expected one of {names} and a formulation "
                f"of {', '.join(FORMULATIONS)}, or one of {', '.join(PLATES)} and '{FACES}'"
            )
        else:
            formulation_of[written.upper()] = name
    return formulation_of


class _Deck:
    """The cards of a deck, and the component that they describe."""

    def __init__(
        self,
        path: Path,
        cards: list[BulkCard],
        above: list[Line],
        formulation_of: Mapping[str, str],
        named_keywords: Collection[str],
        ignored: set[str],
        points: bool,
        temperature: float | None,
    ) -> None:
        self._temperature, self._named_keywords = temperature, named_keywords
        self._path, self._points, self._formulation_of = path, points, formulation_of
        self._above, self._turned = above, set[int]()
        self._cards: dict[str, list[BulkCard]] = {}
        for card in cards:
            self._cards.setdefault(card.name, []).append(card)
        self._notes: list[PassedOver] = []
        _refuse_selections(above, ignored)
        self._weight = self._factor(above)
        self._consistent = self._coupled_mass(above)
        plates = [name for name in PLATES if formulation_of.get(name) == FACES]
        read_cards = {*READ, *plates, *(PLATE_SECTIONS if plates else ())}
        self._refuse(read_cards | ignored | set(PASSED_OVER))
        for name, cards_of_name in self._cards.items():
            if cards_of_name and name not in read_cards:
                self._note(cards_of_name, PASSED_OVER.get(name, "as asked for"))
        self._plates = plates

    def _refuse(self, supported: set[str]) -> None:
        """Raise ModelError with a list of all cards that are not supported."""
        unknown = {name: cards for name, cards in self._cards.items() if name not in supported}
        if not unknown:
            return
        listed = ", ".join(
            f"{name} ({len(cards)}, first in line {cards[0].lines[0].place + 1})"
            for name, cards in unknown.items()
        )
        names = ", ".join(f'"{name}"' for name in unknown)
        first = min((cards[0] for cards in unknown.values()), key=lambda card: card.lines[0].place)
        advice = "; plates that mark faces alone: treat_as {CQUAD4 = 'faces'}"
        raise first.lines[0].error(
            f"cards that are not supported: {listed}"
            + (advice if set(unknown) & set(PLATES) else "")
            + (ORDERS if set(unknown) & set(P_ELEMENTS) else "")
            + f"; where neither mass nor stiffness depend on them: pass_over = [{names}]"
        )

    def _parameters(self, above: list[Line], name: str) -> list[BulkCard]:
        """Remove the cards of a PARAM from the deck and return them, with those above the bulk."""
        cards = self._all("PARAM")
        for line in above:
            first, fields = fields_of(line.text)
            if first.upper().rstrip("*") == "PARAM":
                cards.append(BulkCard("PARAM", fields, [line] * len(fields)))
        parameter_cards = [card for card in cards if card.at(0).upper() == name]
        if parameter_cards and "PARAM" in self._cards:
            self._cards["PARAM"] = [c for c in self._cards["PARAM"] if c not in parameter_cards]
        return parameter_cards

    def _factor(self, above: list[Line]) -> float:
        """Factor on the mass of elements, PARAM,WTMASS."""
        by_factor = {card.real(1, "a factor"): card for card in self._parameters(above, WEIGHT)}
        for factor, card in by_factor.items():
            if not factor > 0:
                raise card.error(f"expected {WEIGHT} above zero", 1)
            if len(by_factor) > 1:
                listed = ", ".join(f"{v:g}" for v in by_factor)
                raise card.error(f"{WEIGHT} has the values {listed}", 1)
        return next(iter(by_factor), 1.0)

    def _coupled_mass(self, above: list[Line]) -> bool:
        """Whether masses are consistent: Nastran lumps them unless PARAM,COUPMASS is positive."""
        flags = [card.whole(1, "a number") for card in self._parameters(above, COUPLED)]
        return bool(flags) and flags[-1] > 0

    def _note(self, cards: list[BulkCard], why: str) -> None:
        line = cards[0].lines[0]
        count = f" ({len(cards)})" if len(cards) > 1 else ""
        self._notes.append(PassedOver(cards[0].name + count, line.file.path, line.place + 1, why))

    def _all(self, *names: str) -> list[BulkCard]:
        return [card for name in names for card in self._cards.get(name, [])]

    def mesh(self) -> SolidMesh:
        """The component."""
        self._read_nodes()
        blocks, pids = self._solids()
        mesh = SolidMesh(self._path, self._nodes, self._numbers, blocks)
        property_of = np.concatenate([np.zeros(0, int), *(pids[b.formulation] for b in blocks)])
        sets = {f"PID{p}": np.flatnonzero(property_of == p) for p in np.unique(property_of)}
        mesh = replace(mesh, element_sets=sets, node_sets=self._sets())
        mesh = self._with_materials(mesh, property_of)
        mesh = BulkSurfaces(mesh, self._all, self._places, self._note).read(self._plates)
        couplings = BulkCouplings(self._all, self._places, mesh.nodes).read()
        mesh = self._with_discrete(replace(mesh, constraints=tuple(couplings)))
        mesh = self._with_mass(self._middles.tied(mesh))
        return self._without_unused(mesh)

    # -- nodes and elements ----------------------------------------------------------------------
    def _read_nodes(self) -> None:
        self._systems = systems = Systems(self._all(*SYSTEMS))
        for first in self._all("GRDSET")[:1]:
            for card in self._all("GRID"):
                card.fields[1:2] = [card.at(1) or first.at(1)]
        place_of: dict[int, np.ndarray] = {}
        supported: list[BulkCard] = []
        for card in self._all("GRID"):
            number = card.whole(0, "a node number")
            x = np.array([card.real(k, "a coordinate", 0.0) for k in (2, 3, 4)])
            x = systems.in_basic(card, 1, x)
            if number in place_of and not np.array_equal(place_of[number], x):
                raise card.error(f"node {number} is there twice, at different places")
            place_of[number] = x
            if card.at(6).strip("0"):
                supported.append(card)
            if card.at(5).strip("0"):
                self._turned.add(number)
        if not place_of:
            raise ModelError(f"{self._path} has no GRID")
        if supported:
            self._note(supported, "its supports are " + MODEL_FILE)
        self._numbers = np.array(sorted(place_of), dtype=np.int64)
        self._nodes = np.array([place_of[n] for n in self._numbers])

    def _places(self, card: BulkCard, numbers: list[int]) -> np.ndarray:
        """Indices of node numbers; ModelError about an unknown one."""
        node_numbers = np.array(numbers, dtype=np.int64)
        indices = np.minimum(np.searchsorted(self._numbers, node_numbers), len(self._numbers) - 1)
        wrong = self._numbers[indices] != node_numbers
        if wrong.any():
            raise card.error(f"there is no node {node_numbers[wrong][0]}")
        return indices

    def _solids(self) -> tuple[tuple[ElementBlock, ...], dict[str, np.ndarray]]:
        """Blocks of solid elements by formulation, and property numbers of the elements of each."""
        plain = self._plain_bricks()
        self._middles = Middles(len(self._numbers))
        rows: dict[str, list[tuple[int, int, np.ndarray]]] = {}
        labels: set[int] = set()
        for card in self._all(*CORNERS):
            label, pid = card.whole(0, "an element number"), card.whole(1, "a property", -1)
            if label in labels:
                raise card.error(f"element {label} is there twice")
            labels.add(label)
            words = card.fields[2:]
            while words and not words[-1]:
                words.pop()
            min_nodes, max_nodes = sorted(n for name, n in SOLIDS if name == card.name)
            count = min_nodes if len(words) <= min_nodes else max_nodes
            if not min_nodes <= len(words) <= max_nodes or not all(words[:min_nodes]):
                count = len([w for w in words if w])
                raise card.error(
                    f"element {label}: expected {min_nodes} or {max_nodes} nodes, found {count}"
                )
            name, _, order = SOLIDS[card.name, count]
            present = [k for k in range(count) if card.at(2 + k).strip("0")]
            if not set(range(min_nodes)) <= set(present):
                raise card.error(f"element {label}: expected nodes at its corners")
            nodes = np.full(count, LACKING)
            numbers = [card.whole(2 + k, "a node number") for k in present]
            nodes[present] = self._places(card, numbers)
            formulation = self._formulation_of[name]
            if name == BRICK and pid in plain and BRICK not in self._named_keywords:
                formulation = "C3D8"
            nodes = self._middles.filled(FORMULATIONS[formulation].shape, nodes[list(order)])
            rows.setdefault(formulation, []).append((label, label if pid < 0 else pid, nodes))
        if not rows and not self._points:
            raise ModelError(f"{self._path} has no solid element: CTETRA, CPYRAM, CPENTA or CHEXA")
        self._nodes, self._numbers = self._middles.added(self._nodes, self._numbers)
        blocks = tuple(
            ElementBlock(
                k, np.array([n for *_, n in elements]), np.array([e for e, *_ in elements])
            )
            for k, elements in rows.items()
        )
        return blocks, {k: np.array([p for _, p, _ in elements]) for k, elements in rows.items()}

    def _plain_bricks(self) -> set[int]:
        """Properties whose bricks are standard isoparametric elements (PSOLID, ISOP = FULL)."""
        plain: set[int] = set()
        without: list[BulkCard] = []
        for card in self._all("PSOLID"):
            points, scheme = (card.at(k).upper() for k in (3, 5))
            if points not in BUBBLE and scheme in FULL:
                plain.add(card.whole(0, "a property"))
            elif points not in BUBBLE:
                without.append(card)
        if without:
            self._note(
                without,
                "IN: bricks without bubble functions and with reduced shear are not supported: "
                "they are read as C3D8I",
            )
        return plain

    # -- sets and couplings ----------------------------------------------------------------------
    def _sets(self) -> dict[str, np.ndarray]:
        node_sets: dict[str, np.ndarray] = {}
        for card in self._all("SET1"):
            name = f"SET{card.whole(0, 'a number of the set')}"
            if name in node_sets:
                raise card.error(f"there is a {name} already")
            node_sets[name] = np.unique(self._places(card, card.listed(1, "a node")))
        return node_sets

    # -- materials -------------------------------------------------------------------------------
    def _with_materials(self, mesh: SolidMesh, property_of: np.ndarray) -> SolidMesh:
        read = BulkMaterials(self._all, self._weight, self._temperature, self._note)
        for card in self._all("PSOLID"):
            property_number = card.whole(0, "a property")
            if (property_of == property_number).any():
                if card.at(6).upper() == "PFLUID":
                    raise card.error(
                        f"PFLUID: the elements of PID{property_number} are a fluid's", 6
                    )
                name, elastic = read.read(card)
                mesh = mesh.with_material(name, elastic, f"PID{property_number}")
        return mesh

    def _with_discrete(self, mesh: SolidMesh) -> SolidMesh:
        """Add springs, masses and equations."""

        def place(card: BulkCard, number: int) -> int:
            return int(self._places(card, [number])[0])

        turning = {c.reference for c in mesh.constraints if isinstance(c, Coupling)}
        read = BulkDiscrete(self._all, place, self._turned, mesh.nodes, turning, self._systems)
        bare = mesh.bare
        constraints = (*mesh.constraints, *read.equations(self._above, bare))
        springs_and_masses = tuple(read.springs_and_masses(self._weight))
        mesh = replace(mesh, constraints=constraints, discrete=springs_and_masses)
        ground = bare.copy()
        ground[mesh.used_without_element] = False
        for spring in springs_and_masses:
            if ground[spring.nodes].any():
                named = mesh.nodes_named(spring.nodes[ground[spring.nodes]])
                raise mesh.error(f"{spring.name}: {named}: no element has a node that it joins")
        return mesh

    def _with_mass(self, mesh: SolidMesh) -> SolidMesh:
        """Mark the mass as lumped where Nastran lumps it by a known rule, and note it."""
        if self._consistent or self._points:
            return mesh
        quadratic = sorted({b.formulation for b in mesh.blocks if b.nodes.shape[1] > 8})
        absent = "PARAM,COUPMASS is not above zero, so that Nastran lumps the mass"
        why = f"{absent}, as here; mass = 'full' does not"
        if quadratic:
            why = f"{absent}; that of {', '.join(quadratic)} is consistent here"
        note = PassedOver("COUPMASS", self._path, 0, why)
        return replace(mesh, lumped=not quadratic, passed_over=(*mesh.passed_over, note))

    def _without_unused(self, mesh: SolidMesh) -> SolidMesh:
        used = mesh.used_nodes()
        if not used.all() and not self._points:
            why = f"{mesh.nodes_named(np.flatnonzero(~used))}: no element has such a node"
            self._notes.append(PassedOver("GRID", self._path, 0, why))
            mesh = mesh.part(np.arange(mesh.n_elements))
        return replace(mesh, passed_over=(*mesh.passed_over, *self._notes))


def _refuse_selections(above: list[Line], ignored: set[str]) -> None:
    """Raise ModelError where case control adds a matrix to those of the elements."""
    for line in above:
        match = SELECTS.match(line.text)
        if match is not None and match[1].upper() not in ignored:
            name = match[1].upper()
            raise line.error(
                f"{name} adds a matrix of DMIG to those of the elements, which is not supported. "
                f"Give the whole as K and M in the model file, or name {name} in pass_over where "
                "nothing of this component is in it"
            )
