"""``*NONSTRUCTURAL MASS`` of Abaqus: mass of an element set in addition to that of its material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from squealstudy.models.components.inp_cards import Card
from squealstudy.models.components.inp_distributions import ElementsOf
from squealstudy.models.components.jacobians import volumes
from squealstudy.models.components.mesh import SolidMesh

KEYWORD = "NONSTRUCTURALMASS"
CARD_PARAMETERS = ("ELSET", "UNITS", "DISTRIBUTION")
TOTAL, PER_VOLUME = "TOTALMASS", "MASSPERVOLUME"
BY_MASS, BY_VOLUME = "MASSPROPORTIONAL", "VOLUMEPROPORTIONAL"


def with_added_mass(mesh: SolidMesh, cards: Sequence[Card], elements_of: ElementsOf) -> SolidMesh:
    """Add the densities that cards state to a mesh; ModelError about a line that is wrong.

    `elements_of` returns the indices of the elements of a set.
    """
    density = mesh.added_density.copy()
    for card in cards:
        if card.keyword != KEYWORD:
            continue
        card.check(CARD_PARAMETERS)
        units = _plain(card.value("UNITS"))
        how = _plain(card.parameters.get("DISTRIBUTION", BY_MASS))
        if units not in (TOTAL, PER_VOLUME):
            raise card.error(
                f"UNITS={units} is not supported: expected TOTAL MASS or MASS PER VOLUME"
            )
        if how not in (BY_MASS, BY_VOLUME):
            raise card.error(f"DISTRIBUTION={how} is not supported")
        ((line, added_mass),) = card.numbers("a mass", 1, 1)
        if not added_mass >= 0:
            raise line.error(f"expected a mass of zero or above, got {added_mass:g}")
        elements = elements_of(card.line, card.value("ELSET"))
        if not len(elements):
            raise card.error(f"ELSET={card.value('ELSET')} has no solid element")
        if units == TOTAL:
            if how == BY_MASS and len(set(mesh.material[elements])) > 1:
                raise card.error(
                    "a mass in proportion to that of several materials is not supported: expected "
                    "DISTRIBUTION=VOLUME PROPORTIONAL, or a set of one material"
                )
            added_mass /= volumes(mesh)[elements].sum()
        density[elements] += added_mass
    return replace(mesh, added_density=density)


def _plain(text: str) -> str:
    return "".join(text.split()).upper()
