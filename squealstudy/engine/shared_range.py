"""Finds the range of materials and springs over which structures can share a basis."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sampling import farthest_points
from squealstudy.wording import amount

# candidates at which reductions are made are a lattice with the most of these points for each
# parameter that has at most so many points; for many parameters as many points of a Sobol sequence
LATTICE_POINTS = (9, 5, 3)
MOST_LATTICE = 4096


@dataclass(frozen=True)
class SharedRange:
    """A box of swept structural parameters.

    Attributes
    ----------
    names : tuple of str
    low, high : tuple of float
        Lowest and highest value of each, in SI units.
    units : tuple of str
        SI unit of each; empty for a pure number.
    """

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    units: tuple[str, ...]

    @property
    def text(self) -> str:
        """Text on the range, such as "pad.young_modulus from 1 GPa to 2 GPa"."""
        ends = zip(self.names, self.low, self.high, self.units, strict=True)
        return ", ".join(
            f"{name} from {amount(low, unit, high)} to {amount(high, unit)}"
            for name, low, high, unit in ends
        )

    @property
    def tests(self) -> int:
        """Number of consecutive reductions that the basis must represent before they are added."""
        return len(self.names)

    @property
    def most(self) -> int:
        """Largest number of reductions."""
        return 4 + 3 * len(self.names)

    @property
    def worth(self) -> int:
        """Number of structures from which a shared basis takes less time than one for each."""
        return 4 + 4 * len(self.names)

    @property
    def identity(self) -> list[list[str]]:
        """All that decides at which values reductions are made."""
        ends = zip(self.names, self.low, self.high, strict=True)
        return [[name, low.hex(), high.hex()] for name, low, high in ends]

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether values of parameters, by name, are within the range."""
        ends = zip(self.names, self.low, self.high, strict=True)
        return all(low <= values[name] <= high for name, low, high in ends)

    def places(self) -> list[dict[str, float]]:
        """Values at which reductions are made, in this order.

        The upper corner of the range is first; each next point is the farthest from those before
        it. Positive parameters are spaced by their logarithms.
        """
        d = len(self.names)
        levels = next((n for n in LATTICE_POINTS if n**d <= MOST_LATTICE), 0)
        if levels:
            X = np.array(list(itertools.product(np.linspace(0.0, 1.0, levels), repeat=d)))
        else:
            from scipy.stats import qmc  # slow to load

            X = qmc.Sobol(d, scramble=False).random(MOST_LATTICE)
            X = np.vstack([X, np.ones(d)])  # its first point is the lower end
        chosen = X[farthest_points(X, self.most)]
        return [
            {
                name: _between(low, high, float(share))
                for name, low, high, share in zip(self.names, self.low, self.high, x, strict=True)
            }
            for x in chosen
        ]


def _between(low: float, high: float, share: float) -> float:
    if share in (0.0, 1.0):
        return high if share else low
    if low > 0.0:
        return float(low * (high / low) ** share)
    return low + share * (high - low)


def shared_range(study: ResolvedStudy, structures: int) -> SharedRange | None:
    """The range over which a study shares a basis; None where each structure has its own.

    It is None with few structures, where parameters follow tables, and where a swept structural
    parameter moves nodes or contact points.
    """
    model = study.model
    if model.tables or not study.definition.reduction.shared_basis:
        return None
    in_place = {p.name: model.in_place(p) for p in model.parameters if p.structural}
    unit_of = {p.name: p.unit for p in model.parameters}
    swept = [s for s in study.sweeps if s.name in in_place and s.low < s.high]
    if not all(in_place[s.name] for s in swept):
        return None
    candidate = SharedRange(
        tuple(s.name for s in swept),
        tuple(s.low for s in swept),
        tuple(s.high for s in swept),
        tuple(unit_of[s.name] for s in swept),
    )
    return candidate if swept and structures >= candidate.worth else None
