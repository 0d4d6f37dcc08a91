"""Materials and orientations of files of Abaqus and CalculiX, and the sections that give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.materials import ENTRIES, Elastic, Orientation, Orthotropic
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.fem.solid import Isotropic

KINDS = {  # values of TYPE, without blanks
    "ISO": "isotropic",
    "ISOTROPIC": "isotropic",
    "ORTHO": "orthotropic",
    "ORTHOTROPIC": "orthotropic",
    "ENGINEERINGCONSTANTS": "engineering",
}
COUNTS = {"isotropic": 2, "orthotropic": 9, "engineering": 9}
WHAT = {
    "isotropic": "Young's modulus, Poisson's ratio",
    "orthotropic": ", ".join(f"D{entry}" for entry in ENTRIES),
    "engineering": "E1, E2, E3, nu12, nu13, nu23, G12, G13, G23",
}


@dataclass
class MaterialText:
    """A material as a file has it; read when an element needs it."""

    name: str
    card: Card
    density: Card | None = None
    elastic: Card | None = None

    def add(self, card: Card) -> None:
        """Take a ``*DENSITY`` or ``*ELASTIC``; ModelError about a second one."""
        field = card.keyword.lower()
        if getattr(self, field) is not None:
            raise card.error(f"material '{self.name}' has a {card.shown} already")
        setattr(self, field, card)

    def read(self) -> Elastic:
        """The material; ModelError about the line of what is missing or wrong."""
        for field in ("density", "elastic"):
            if getattr(self, field) is None:
                raise self.card.error(f"material '{self.name}' has no *{field.upper()}")
        assert self.density is not None
        assert self.elastic is not None
        self.density.check(())
        density = _of_one_temperature(self.density, "a density", 1)[0]
        self.elastic.check(("TYPE", "MODULI"))
        written = "".join(self.elastic.parameters.get("TYPE", "ISO").split()).upper()
        if written not in KINDS:
            known = ", ".join(KINDS)
            raise self.elastic.error(
                f"*ELASTIC, TYPE={written} is not supported; supported: {known}"
            )
        kind = KINDS[written]
        values = _of_one_temperature(self.elastic, WHAT[kind], COUNTS[kind])
        try:
            if kind == "isotropic":
                material: Elastic = Isotropic(values[0], values[1], density)
                material.stiffness()
            elif kind == "orthotropic":
                material = Orthotropic(tuple(values), density)
            else:
                E, nu, G = (tuple(values[i : i + 3]) for i in (0, 3, 6))
                material = Orthotropic.from_engineering(E, nu, G, density)  # type: ignore[arg-type]
        except (ModelError, ZeroDivisionError) as error:
            raise self.elastic.error(f"material '{self.name}': {error}") from error
        return material


def _of_one_temperature(card: Card, what: str, count: int) -> list[float]:
    """Numbers of a card without the temperature that may follow; ModelError where there is more."""
    numbers = card.numbers(what, count, 10**6)
    if len(numbers) > count + 1:
        line = numbers[count + 1][0]
        raise line.error(
            f"{card.shown}: expected {count} numbers ({what}) and at most a temperature; write the "
            "values at the temperature of the study"
        )
    return [value for _, value in numbers[:count]]


def read_orientation(card: Card) -> Orientation:
    """An ``*ORIENTATION`` by coordinates; ModelError about what is not supported or wrong."""
    card.check(("NAME", "SYSTEM", "DEFINITION"))
    system = card.parameters.get("SYSTEM", "RECTANGULAR").upper()
    if system not in ("RECTANGULAR", "CYLINDRICAL"):
        raise card.error(f"SYSTEM={system} is not supported; supported: RECTANGULAR, CYLINDRICAL")
    if card.parameters.get("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        raise card.error("only DEFINITION=COORDINATES is supported: write the points themselves")
    if not 1 <= len(card.data) <= 2:
        raise card.error(f"expected one or two lines of numbers, found {len(card.data)}")
    words = card.data[0].words()
    if len(words) not in (6, 9):
        raise card.data[0].error(f"expected two or three points, found {len(words)} numbers")
    x = [card.data[0].real(word, "a coordinate") for word in words] + [0.0] * 3
    turn = (1, 0.0)
    if len(card.data) == 2:
        line = card.data[1]
        axis, *angle = line.words()
        if len(angle) > 1 or axis not in ("1", "2", "3"):
            raise line.error(
                f"expected an axis 1, 2 or 3 and an angle, found '{line.text.strip()}'"
            )
        turn = (int(axis), line.real(angle[0], "an angle") if angle else 0.0)
    try:
        return Orientation(
            "rectangular" if system == "RECTANGULAR" else "cylindrical",
            (x[0], x[1], x[2]),
            (x[3], x[4], x[5]),
            (x[6], x[7], x[8]),
            turn,
        )
    except ModelError as error:
        raise card.error(str(error)) from error


SECTION = ("ELSET", "MATERIAL", "ORIENTATION", "CONTROLS")


def with_sections(
    mesh: SolidMesh,
    cards: Sequence[Card],
    materials_of_file: Mapping[str, MaterialText],
    elements_of: Callable[[Card], np.ndarray],
) -> SolidMesh:
    """The mesh with materials and axes of the ``*SOLID SECTION`` among cards.

    `elements_of` gives places of the elements of a section's set; ModelError about the line of
    what is not there, or given twice.
    """
    material = np.full(mesh.n_elements, "", dtype=object)
    orientation = material.copy()
    materials: dict[str, Elastic] = {}
    orientations: dict[str, Orientation] = {}
    axes = {c.value("NAME").upper(): c for c in cards if c.keyword == "ORIENTATION"}
    for card in cards:
        if card.keyword != "SOLIDSECTION":
            continue
        card.check(SECTION)
        elements = elements_of(card)
        name = card.value("MATERIAL")
        if name.upper() not in materials_of_file:
            known = ", ".join(m.name for m in materials_of_file.values()) or "none"
            raise card.error(f"there is no material '{name}'; there is {known}")
        text = materials_of_file[name.upper()]
        if text.name not in materials:
            materials[text.name] = text.read()
        if (material[elements] != "").any():
            twice = elements[material[elements] != ""]
            raise card.error(f"{mesh.elements_named(twice)}: a section is given already")
        material[elements] = text.name
        if turned := card.parameters.get("ORIENTATION"):
            if turned.upper() not in axes:
                raise card.error(f"there is no orientation '{turned}'")
            key = axes[turned.upper()].parameters["NAME"]
            orientations[key] = read_orientation(axes[turned.upper()])
            orientation[elements] = key
    return replace(
        mesh,
        materials=materials,
        material=material,
        orientations=orientations,
        orientation=orientation,
    )
