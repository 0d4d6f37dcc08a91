"""Materials and orientations in files of Abaqus and CalculiX, and sections that assign them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, pairwise

import numpy as np

from squealstudy.errors import ModelError
from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_distributions import ElementsOf, orientations_of
from squealstudy.models.components.inp_lines import Line
from squealstudy.models.components.materials import (
    ALL_ENTRIES,
    ENTRIES,
    Anisotropic,
    Elastic,
    Orientation,
    Orthotropic,
    Unfinished,
)
from squealstudy.models.components.mesh import SolidMesh
from squealstudy.models.fem.solid import Isotropic

KINDS = {  # kind of material by the value of TYPE, without blanks
    "ISO": "isotropic",
    "ISOTROPIC": "isotropic",
    "ORTHO": "orthotropic",
    "ORTHOTROPIC": "orthotropic",
    "ENGINEERINGCONSTANTS": "engineering",
    "ANISO": "anisotropic",
    "ANISOTROPIC": "anisotropic",
}
SECTION_PARAMETERS = ("ELSET", "MATERIAL", "ORIENTATION", "CONTROLS")
# number of numbers on *ELASTIC, and what they are
COUNTS = {"isotropic": 2, "orthotropic": 9, "engineering": 9, "anisotropic": 21}
MEANINGS = {
    "isotropic": "Young's modulus, Poisson's ratio",
    "orthotropic": ", ".join(f"D{entry}" for entry in ENTRIES),
    "anisotropic": ", ".join(f"D{entry}" for entry in ALL_ENTRIES),
    "engineering": "E1, E2, E3, nu12, nu13, nu23, G12, G13, G23",
}


@dataclass
class MaterialText:
    """The cards of a material, which are read when an element needs it.

    Attributes
    ----------
    name : str
    card : Card
        ``*MATERIAL``.
    density, elastic : Card or None
    other : Card or None
        A law other than linear elasticity, such as ``*HYPERELASTIC``.
    """

    name: str
    card: Card
    density: Card | None = None
    elastic: Card | None = None
    other: Card | None = None

    def add(self, card: Card) -> None:
        """Take a ``*DENSITY`` or ``*ELASTIC``; ModelError about a second one."""
        field = card.keyword.lower()
        if getattr(self, field) is not None:
            raise card.error(f"material '{self.name}' has a {card.shown} already")
        setattr(self, field, card)

    def read(self, temperature: float | None = None) -> Elastic | Unfinished:
        """The material at a temperature; Unfinished where numbers are missing.

        ModelError about a line that is wrong.
        """
        lacking: list[str] = []
        density = None
        if self.density is None:
            lacking.append(str(self.card.error(f"material '{self.name}' has no *DENSITY")))
        else:
            self.density.check(())  # *DENSITY has no parameter that is read
            rows = _rows(self.density, "a density", 1)
            density = _at(self.density, rows, temperature, lacking)
            if density is not None and not density[0] > 0:
                raise self.density.error(f"expected a density above zero, got {density[0]:g}")
        moduli = self._moduli(temperature, lacking)
        if moduli is not None and density is not None:
            return replace(moduli, density=density[0])
        return Unfinished(moduli, density[0] if density else None, "; ".join(lacking))

    def _moduli(self, temperature: float | None, lacking: list[str]) -> Elastic | None:
        """Moduli as a material of density 1, since the density is read apart.

        None, and a sentence in `lacking`, where moduli are missing.
        """
        if self.elastic is None:
            if self.other is not None:
                what = f"is {self.other.shown}, which is not read"
            else:
                what = "has no *ELASTIC"
            lacking.append(str((self.other or self.card).error(f"material '{self.name}' {what}")))
            return None
        self.elastic.check(("TYPE", "MODULI"))
        written = "".join(self.elastic.parameters.get("TYPE", "ISO").split()).upper()
        if written not in KINDS:
            supported = ", ".join(KINDS)
            text = f"*ELASTIC, TYPE={written} is not supported; supported: {supported}"
            lacking.append(str(self.elastic.error(text)))
            return None
        kind = KINDS[written]
        rows = _rows(self.elastic, MEANINGS[kind], COUNTS[kind])
        values = _at(self.elastic, rows, temperature, lacking)
        if values is None:
            return None
        try:
            if kind == "isotropic":
                return _isotropic(*values)
            if kind == "orthotropic":
                return Orthotropic(tuple(values), 1.0)
            if kind == "anisotropic":
                return Anisotropic(tuple(values), 1.0)
            young, ratios, shear = (tuple(values[i : i + 3]) for i in (0, 3, 6))
            return Orthotropic.from_engineering(young, ratios, shear, 1.0)  # type: ignore[arg-type]
        except (ModelError, ZeroDivisionError) as error:
            raise self.elastic.error(f"material '{self.name}': {error}") from error


def _isotropic(E: float, nu: float) -> Isotropic:
    if not (E > 0 and -1 < nu < 0.5):
        raise ModelError(f"expected E > 0 and -1 < nu < 0.5, got {E:g} and {nu:g}")
    return Isotropic(E, nu, 1.0)


# rows of numbers: the first line of each, and its numbers, the last of which is the temperature
Rows = list[tuple[Line, list[float]]]


def _rows(card: Card, meaning: str, n_values: int) -> Rows:
    """The rows of a card: `n_values` numbers and a temperature, 0 where it is not written.

    A row starts on a new line and may take several. ModelError about a line that is wrong.
    """
    rows: Rows = []
    is_complete = True
    for line in card.data:
        words = line.words()
        if is_complete:
            rows.append((line, []))
        row = rows[-1][1]
        row += [line.real(word, meaning) for word in words if word]
        is_complete = len(row) >= n_values
        if len(row) > n_values + 1:
            raise line.error(
                f"{card.shown}: expected {n_values} numbers ({meaning}) and a temperature, found "
                f"{len(row)}"
            )
    if not rows or not is_complete:
        line = card.data[-1] if card.data else card.line
        n_found = len(rows[-1][1]) if rows else 0
        raise line.error(f"{card.shown}: expected {n_values} numbers ({meaning}), found {n_found}")
    return [(line, row if len(row) > n_values else [*row, 0.0]) for line, row in rows]


def _at(
    card: Card, rows: Rows, temperature: float | None, lacking: list[str]
) -> list[float] | None:
    """Numbers at a temperature, linear between rows and constant outside them.

    None, and a sentence in `lacking`, where rows differ and no temperature is given. ModelError
    where temperatures do not increase.
    """
    table = np.array([row for _, row in rows])
    T, values = table[:, -1], table[:, :-1]
    for (_, before), (line, row) in pairwise(rows):
        if not row[-1] > before[-1]:
            raise line.error(f"{card.shown}: expected temperatures that rise")
    if (values == values[0]).all():
        return [float(v) for v in values[0]]
    if temperature is None:
        text = f"{card.shown} has values at {len(T)} temperatures: expected temperature = NUMBER"
        lacking.append(str(card.error(f"{text}; the table goes from {T[0]:g} to {T[-1]:g}")))
        return None
    return [float(np.interp(temperature, T, column)) for column in values.T]


def with_sections(
    mesh: SolidMesh,
    cards: Sequence[Card],
    materials_of_file: Mapping[str, MaterialText],
    elements_of: ElementsOf,
    temperature: float | None = None,
) -> SolidMesh:
    """Assign materials and material axes to elements, by the ``*SOLID SECTION`` among cards.

    `elements_of` returns the indices of the elements of a set or a label. ModelError about a line
    that names an unknown set or orientation, or gives elements a second section.
    """
    material = np.full(mesh.n_elements, "", dtype=object)
    orientation = material.copy()
    materials: dict[str, Elastic | Unfinished] = {}
    orientations: dict[str, Orientation] = {}
    axes_cards = {c.value("NAME").upper(): c for c in cards if c.keyword == "ORIENTATION"}
    for card in cards:
        if card.keyword != "SOLIDSECTION":
            continue
        card.check(SECTION_PARAMETERS)
        elements = elements_of(card.line, card.value("ELSET"))
        name = card.value("MATERIAL")
        stated = materials_of_file.get(name.upper())
        if stated is None:
            names = ", ".join(m.name for m in materials_of_file.values()) or "none"
            missing = card.error(f"there is no material '{name}'; there is {names}")
            materials.setdefault(name, Unfinished(None, None, str(missing)))
        else:
            name = stated.name  # in the capitals of *MATERIAL
            if name not in materials:
                materials[name] = stated.read(temperature)
        if (material[elements] != "").any():
            twice = elements[material[elements] != ""]
            raise card.error(f"{mesh.elements_named(twice)}: a section is given already")
        material[elements] = name
        if axes_name := card.parameters.get("ORIENTATION"):
            axes_card = axes_cards.get(axes_name.upper())
            if axes_card is None:
                raise card.error(f"there is no orientation '{axes_name}'")
            for places, axes in orientations_of(axes_card, cards, elements, elements_of):
                orientation[places] = _name_of(axes, axes_card.value("NAME"), orientations)
    return replace(
        mesh,
        materials={k: m for k, m in materials.items() if not isinstance(m, Unfinished)},
        unfinished={k: m for k, m in materials.items() if isinstance(m, Unfinished)},
        material=material,
        orientations=orientations,
        orientation=orientation,
    )


def _name_of(axes: Orientation, name: str, orientations: dict[str, Orientation]) -> str:
    """`name`, or `name@number` where other axes have it; the axes are put into `orientations`.

    An ``*ORIENTATION`` has several axes where a distribution gives them to its elements.
    """
    others = (f"{name}@{number}" for number in count(len(orientations) + 1))
    return next(n for n in chain([name], others) if orientations.setdefault(n, axes) == axes)
