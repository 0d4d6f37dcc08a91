"""Sections of keyword files: which elements have which material and which material axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_materials import MaterialText, read_orientation
from squealstudy.models.components.materials import Elastic, Orientation
from squealstudy.models.components.mesh import SolidMesh

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
