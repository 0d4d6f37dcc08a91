"""Limit cycles of design points, by harmonic balance."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from squealstudy.cycles.contact import ContactOscillator
from squealstudy.cycles.cycle import Cycle, Search
from squealstudy.cycles.families import families
from squealstudy.cycles.verdicts import Family
from squealstudy.mechanics.defaults import STABILITY_TOLERANCE
from squealstudy.mechanics.failures import FAILURES
from squealstudy.mechanics.motions import set_up
from squealstudy.mechanics.stacked_rows import messages, statuses
from squealstudy.mechanics.structures import Structures
from squealstudy.root_pairs import angular_band

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class LimitCycles:
    """The mode families of a design point and their limit cycles.

    Attributes
    ----------
    families : tuple of (int, Family)
        Number of each family's mode, and its growth over amplitude, cycles, verdict and reason.
    contact : ContactOscillator or None
        The equation of motion whose solutions the cycles are.
    status, message : str
        ``ok``, or in a batch why the design point has no families.

    Examples
    --------
    >>> import squealstudy as sq
    >>> model = sq.model("hulten", contact_law="cubic", **{"contact.cubic_stiffness": 5e17})
    >>> found = model.at(friction=0.305, damping_ratio=0.01).limit_cycles()
    >>> [family.verdict for _, family in found.families][:1], found.cycles[0][1].attracts
    (['squeals'], True)
    """

    families: tuple[tuple[int, Family], ...] = field(repr=False)
    contact: ContactOscillator | None = field(repr=False)
    status: str = "ok"
    message: str = ""

    @property
    def cycles(self) -> tuple[tuple[int, Cycle], ...]:
        """All cycles, each with the number of its mode."""
        return tuple((number, c) for number, family in self.families for c in family.cycles)

    def to_pandas(self) -> pd.DataFrame:
        """A row for each cycle: mode, verdict, frequency, levels with errors, stability."""
        import pandas as pd

        verdicts = {number: family.verdict for number, family in self.families}
        rows: list[dict[str, Any]] = [
            {
                "mode": number,
                "verdict": verdicts[number],
                "status": cycle.status,
                "frequency_hz": cycle.motion.omega / (2 * np.pi),
                **cycle.levels,
                "level_error": cycle.level_error,
                "velocity_error": cycle.velocity_error,
                "stable": cycle.attracts,
                "n_harmonics": cycle.motion.harmonics,
            }
            for number, cycle in self.cycles
        ]
        return pd.DataFrame(rows)


def limit_cycles(
    structures: Structures,
    harmonics: int | None,
    tolerance: float,
    reach: float,
    regularisation: str,
    single: bool,
) -> list[LimitCycles]:
    """Limit cycles of each design point (`System.limit_cycles`)."""
    ready = set_up(structures, regularisation, single)
    band = angular_band(structures.basis.band_hz)
    results: list[LimitCycles | Exception] = []
    for one in ready:
        if isinstance(one, Exception):
            results.append(one)
            continue
        reference, motion_start, *_ = one
        contact = ContactOscillator(reference.system, motion_start)
        search = Search(harmonics, tolerance, reach * abs(motion_start.speed), band[1])
        try:
            followed = families(contact, band, None, STABILITY_TOLERANCE, search)
            results.append(LimitCycles(tuple(followed.families), contact))
        except FAILURES as error:
            if single:
                raise
            results.append(error)
    outcomes = zip(results, statuses(results), messages(results), strict=True)
    return [
        LimitCycles((), None, status, message) if isinstance(x, Exception) else x
        for x, status, message in outcomes
    ]
