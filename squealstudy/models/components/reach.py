"""A check that two faces of a pair face each other."""

from __future__ import annotations

from squealstudy.models.components.dimensions import LENGTH
from squealstudy.models.components.facet_geometry import Facets
from squealstudy.models.components.pairs import Pair
from squealstudy.models.file_table import KeyPath, PlacedError

LEAST_IN_REACH = 0.5  # a pair is refused if less of the slave is in reach
ALL_MET = 0.9  # if more of the master is met, the slave is merely the larger face


def expect_reach(
    pair: Pair, keys: KeyPath, slave: Facets, master: Facets, search: float, units: str
) -> None:
    """Raise PlacedError where less than half of the slave has the master within `search`.

    `search` is in the unit of length of the model file.
    """
    if pair.in_reach >= LEAST_IN_REACH:
        return
    size = LENGTH.factor(units)
    unit = "m" if units == "SI" else "mm"
    low, high = (g / size for g in pair.gap_range)
    met = pair.in_reach * slave.areas.sum() / master.areas.sum()
    raise PlacedError(
        keys,
        f"{100 * pair.in_reach:.0f} % of {slave.name} lies within {search:g} {unit} of "
        f"{master.name} (gap {low:.4g} to {high:.4g} {unit}): "
        + (
            f"{slave.name} is the larger face: exchange the two, or name the part of it that "
            f"meets {master.name}"
            if met > ALL_MET
            else "is a part placed wrongly, or search too small?"
        ),
    )
