"""Components from keyword files of Abaqus and CalculiX (``.inp``)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.models.components.inp_cards import Card, read_cards
from squealstudy.models.components.inp_component import READ, Component
from squealstudy.models.components.inp_couplings import KEYWORDS
from squealstudy.models.components.inp_equations import KEYWORDS as EQUATIONS
from squealstudy.models.components.inp_keywords import (
    ELEMENTS,
    IN_ASSEMBLY,
    OTHER_LAWS,
    PASSED_OVER,
    REFUSED,
)
from squealstudy.models.components.inp_materials import MaterialText
from squealstudy.models.components.inp_refused import Refused, refuse, sift_elements
from squealstudy.models.components.inp_sectors import whole_body
from squealstudy.models.components.inp_text import Text, passed, unused
from squealstudy.models.components.marked_faces import FACES, NODES
from squealstudy.models.components.mesh import PassedOver, SolidMesh

Dialect = Literal["abaqus", "calculix"]
UNNAMED_FORMULATIONS = ("C3D8_BBAR",)  # formulations that no file can name
ABAQUS_ONLY = ("PART", "ASSEMBLY", "INSTANCE")
OF_ASSEMBLY = ("NSET", "ELSET", "SURFACE", "ORIENTATION", *KEYWORDS, *EQUATIONS)


@dataclass
class Instance:
    """An ``*INSTANCE``: its own card, and the cards up to its end."""

    card: Card
    cards: list[Card] = field(default_factory=list)


@dataclass
class Contents:
    """The cards of a file, sorted by where they stand. Names are in capitals.

    Attributes
    ----------
    model : list of Card
        Outside of parts and assembly.
    parts : dict of str -> list of Card
    instances : dict of str -> Instance
    assembly : list of Card
        Of the assembly itself, without instances.
    materials : dict of str -> MaterialText
    passed_over : list of PassedOver
    refused : list of Refused
    abaqus : bool
        Whether the file has parts or an assembly, which CalculiX does not have.
    """

    model: list[Card] = field(default_factory=list)
    parts: dict[str, list[Card]] = field(default_factory=dict)
    instances: dict[str, Instance] = field(default_factory=dict)
    assembly: list[Card] = field(default_factory=list)
    materials: dict[str, MaterialText] = field(default_factory=dict)
    passed_over: list[PassedOver] = field(default_factory=list)
    refused: list[Refused] = field(default_factory=list)
    abaqus: bool = False


def read_inp(
    path: Path,
    part: str | None = None,
    *,
    dialect: Dialect | None = None,
    treat_as: Mapping[str, str] | None = None,
    pass_over: Collection[str] = (),
    temperature: float | None = None,
    points: bool = False,
) -> SolidMesh:
    """Read a component from a file of Abaqus or CalculiX, in the units of the file.

    Parameters
    ----------
    path : Path
    part : str or None
        An instance of the assembly, which is placed as the file says; a part, in a file without
        instances; an element set, in a file without parts. Needed where there are several
        instances or parts.
    dialect : str or None
        abaqus or calculix, whose C3D8 differ (`C3D8_BBAR` and `C3D8`). By default abaqus where the
        file has parts or an assembly.
    treat_as : dict of str -> str
        Formulation by type of element, such as C3D8I for C3D8R. For plane elements and shells it
        can be "faces": their element sets become surfaces of the solids.
    pass_over : collection of str
        Unsupported keywords, and elements that are no solids, to leave out without an error, such
        as TIE or S8R.
    temperature : float or None
        Temperature at which to take materials that depend on it.
    points : bool
        The file has the nodes of matrices: it needs no elements, all nodes stay, and unsupported
        keywords are left out without an error.

    Returns
    -------
    SolidMesh
        `passed_over` lists all keywords that are left out.

    Raises
    ------
    ModelError
        Something is malformed, not supported, or refers to what the file lacks.
    """
    ignored = {_plain(keyword) for keyword in pass_over}
    contents = _sorted(read_cards(path), ignored)
    dialect_name = dialect or ("abaqus" if contents.abaqus else "calculix")
    elements = _elements(path, dialect_name, treat_as)
    text = _text(path, contents, part, elements)
    refused = [*contents.refused, *sift_elements(text, ignored)]
    if points:
        contents.passed_over += [passed(r.card, "of the matrices, or of nothing") for r in refused]
    else:
        refuse(refused)
    text.temperature, text.abaqus, text.points_alone = temperature, dialect_name == "abaqus", points
    text.passed_over += contents.passed_over
    component = Component(text)
    mesh = component.mesh()
    if part is not None and not contents.parts:
        mesh = mesh.part(mesh.find("element_sets", part))
    return whole_body(mesh, component.sectors())


def _plain(keyword: str) -> str:
    return "".join(keyword.split()).lstrip("*").upper()


def _elements(path: Path, dialect: Dialect, treat_as: Mapping[str, str] | None) -> dict[str, str]:
    """Formulation of each type of element that a file may have."""
    formulation_of = {name: name for name in FORMULATIONS if name not in UNNAMED_FORMULATIONS}
    if dialect == "abaqus":
        formulation_of["C3D8"] = "C3D8_BBAR"
    for written, name in (treat_as or {}).items():
        if name == FACES and written.upper() in NODES:
            formulation_of[written.upper()] = FACES
            continue
        if name not in FORMULATIONS:
            names = ", ".join(FORMULATIONS)
            raise ModelError(f"{path}: treat_as {written} = '{name}': expected one of {names}")
        if written.upper() not in (*formulation_of, *ELEMENTS):
            raise ModelError(f"{path}: treat_as: '{written}' is not a known solid element")
        formulation_of[written.upper()] = name
    return formulation_of


def _text(path: Path, contents: Contents, part: str | None, elements: Mapping[str, str]) -> Text:
    """The cards of the chosen component, and what else is needed to read them."""
    placed = (np.eye(3), np.zeros(3))
    if contents.parts and contents.model:
        raise contents.model[0].error(f"{contents.model[0].shown} stands outside of the parts")
    if contents.instances:
        instance = contents.instances[_chosen(path, "instance", list(contents.instances), part)]
        return _of_instance(contents, path, instance, elements)
    cards = contents.model
    if contents.parts:
        cards = contents.parts[_chosen(path, "part", list(contents.parts), part)]
    if not cards:
        raise ModelError(f"{path}: there are no nodes and elements")
    return Text(path, cards, (), "", contents.materials, *placed, elements)


def _chosen(path: Path, noun: str, names: list[str], name: str | None) -> str:
    """`name` in capitals, or the only one of `names`; ModelError where that is not possible."""
    if name is None and len(names) > 1:
        listed = ", ".join(names)
        raise ModelError(f"{path} has {len(names)} {noun}s ({listed}): expected the name of one")
    chosen = names[0] if name is None else name.upper()
    if chosen not in names:
        raise ModelError(f"{path} has no {noun} '{name}'; it has {', '.join(names)}")
    return chosen


def _sorted(cards: list[Card], pass_over: Collection[str]) -> Contents:
    """Sort cards by where they belong; ModelError about one in a wrong place or without an end.

    Refused cards are listed in `refused`.
    """
    contents = Contents()
    inside: list[Card] = []  # *PART, *ASSEMBLY, *INSTANCE, *STEP that are open
    material: MaterialText | None = None
    for card in cards:
        keyword = card.keyword
        if inside and inside[-1].keyword == "STEP":
            if keyword == "ENDSTEP":
                inside.pop()
            continue
        if keyword.startswith("END") and keyword[3:] in (*ABAQUS_ONLY, "STEP"):
            if not inside or inside[-1].keyword != keyword[3:]:
                raise card.error(f"{card.shown}: there is no open *{keyword[3:]}")
            inside.pop()
        elif keyword == "STEP":
            contents.passed_over.append(passed(card, "steps are stated in the study"))
            inside.append(card)
        elif keyword in ABAQUS_ONLY:
            contents.abaqus = True
            _open(contents, card, inside)
            inside.append(card)
        elif keyword in pass_over:
            contents.passed_over.append(passed(card, "as asked for"))
        elif keyword == "MATERIAL":
            name = card.value("NAME")
            if name.upper() in contents.materials:
                raise card.error(f"there is a material '{name}' already")
            material = contents.materials[name.upper()] = MaterialText(name, card)
        elif keyword in ("DENSITY", "ELASTIC"):
            if material is None:
                raise card.error(f"{card.shown} belongs after a *MATERIAL")
            material.add(card)
        elif keyword in OTHER_LAWS and material is not None:
            material.other = card
        elif keyword in PASSED_OVER:
            contents.passed_over.append(passed(card, PASSED_OVER[keyword]))
        elif keyword in REFUSED:
            text = f"{card.shown} is not supported: {REFUSED[keyword]}"
            contents.refused.append(Refused(card, keyword, text))
        elif keyword in READ:
            _sort_card(contents, card, inside, pass_over)
        else:
            contents.refused.append(Refused(card, keyword, f"{card.shown} is not known here"))
    if inside:
        raise inside[-1].error(f"{inside[-1].shown} has no end")
    return contents


def _open(contents: Contents, card: Card, inside: list[Card]) -> None:
    """Begin a part, an assembly or an instance at its card."""
    within = inside[-1].keyword if inside else ""
    if within != ("ASSEMBLY" if card.keyword == "INSTANCE" else ""):
        raise card.error(f"{card.shown} cannot stand {'within *' + within if within else 'here'}")
    card.check(("NAME", "PART") if card.keyword == "INSTANCE" else ("NAME",))
    if card.unused:
        contents.passed_over.append(unused(card))
    if card.keyword == "ASSEMBLY":
        return
    name = card.value("NAME").upper()
    if name in (contents.parts if card.keyword == "PART" else contents.instances):
        raise card.error(f"there is a {card.keyword.lower()} '{name}' already")
    if card.keyword == "PART":
        contents.parts[name] = []
    else:
        contents.instances[name] = Instance(card)


def _sort_card(
    contents: Contents, card: Card, inside: list[Card], pass_over: Collection[str]
) -> None:
    """Add a card of the mesh to the part, instance or assembly that is open."""
    within = inside[-1].keyword if inside else ""
    if not within:
        contents.model.append(card)
    elif within == "PART":
        contents.parts[inside[-1].value("NAME").upper()].append(card)
    elif within == "INSTANCE":
        contents.instances[inside[-1].value("NAME").upper()].cards.append(card)
    elif card.keyword in OF_ASSEMBLY:
        contents.assembly.append(card)
    elif card.keyword == "NODE":
        contents.passed_over.append(passed(card, "nodes of the assembly belong to no component"))
    elif card.keyword == "ELEMENT" and _plain(card.value("TYPE")) in pass_over:
        contents.passed_over.append(passed(card, "as asked for"))
    else:
        name = _plain(card.value("TYPE")) if card.keyword == "ELEMENT" else card.keyword
        text = f"{card.shown} in the assembly is not supported: {IN_ASSEMBLY}"
        contents.refused.append(Refused(card, name, text))


def _of_instance(
    contents: Contents, path: Path, instance: Instance, elements: Mapping[str, str]
) -> Text:
    """Text of the part of an instance, with its place in the assembly."""
    card = instance.card
    name = card.value("PART").upper()
    if name not in contents.parts:
        part_names = ", ".join(contents.parts) or "none"
        raise card.error(f"there is no part '{name}'; there is {part_names}")
    turn, shift = _placement(card)
    cards = [*contents.parts[name], *instance.cards]
    instance_name = card.value("NAME").upper()
    return Text(
        path, cards, contents.assembly, instance_name, contents.materials, turn, shift, elements
    )


def _placement(card: Card) -> tuple[np.ndarray, np.ndarray]:
    """Rotation matrix and shift of an instance: a point x moves to turn x + shift.

    The first line of the card is a shift. The second is a rotation after it: two points of its axis
    and the angle [deg].
    """
    if len(card.data) > 2:
        raise card.data[2].error("expected at most a line of a shift and a line of a turn")
    numbers = [[line.real(w, "a number") for w in line.words()] for line in card.data]
    for line, row, count in zip(card.data, numbers, (3, 7), strict=False):
        if len(row) != count:
            raise line.error(f"expected {count} numbers, found {len(row)}")
    shift = np.array(numbers[0]) if numbers else np.zeros(3)
    if len(numbers) < 2:
        return np.eye(3), shift
    a, b, angle = np.array(numbers[1][:3]), np.array(numbers[1][3:6]), np.deg2rad(numbers[1][6])
    if not np.linalg.norm(b - a) > 0:
        raise card.data[1].error("expected two different points of the axis")
    x, y, z = (b - a) / np.linalg.norm(b - a)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn, turn @ (shift - a) + a
