"""Over which range of swept materials and springs the structures of a study have one basis."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.sampling import farthest_points

LATTICE_POINTS = (9, 5, 3)  # of each parameter, at which reductions are made: as many as
MOST_LATTICE = 4096  # places allow; of more parameters as many random ones


@dataclass(frozen=True)
class SharedRange:
    """Structural parameters that are swept, each from `low` to `high`.

    Attributes
    ----------
    names : tuple of str
    low, high : tuple of float
    """

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @property
    def text(self) -> str:
        """In words."""
        ends = zip(self.names, self.low, self.high, strict=True)
        return ", ".join(f"{name} from {low:g} to {high:g}" for name, low, high in ends)

    @property
    def tests(self) -> int:
        """Reductions in a row that must be known before they are made: one a parameter."""
        return len(self.names)

    @property
    def most(self) -> int:
        """Reductions after which no more are tried."""
        return 4 + 3 * len(self.names)

    @property
    def worth(self) -> int:
        """Structures from which on it takes less time than a reduction of each."""
        return 4 + 4 * len(self.names)

    @property
    def identity(self) -> list[list[str]]:
        """All that decides where reductions are made."""
        ends = zip(self.names, self.low, self.high, strict=True)
        return [[name, low.hex(), high.hex()] for name, low, high in ends]

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether values of parameters are within it."""
        ends = zip(self.names, self.low, self.high, strict=True)
        return all(low <= values[name] <= high for name, low, high in ends)

    def places(self) -> list[dict[str, float]]:
        """Values at which reductions are made, in this order: the ends first, then between.

        Positive values are divided by their logarithms.
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
    """The range of a study with so many structures; None where each has a basis of its own.

    All that is swept must leave nodes and contact where they are. What follows a table has no range
    of its own.
    """
    model = study.model
    if model.tables or not study.definition.reduction.shared_basis:
        return None
    in_place = {p.name: model.in_place(p) for p in model.parameters if p.structural}
    swept = [s for s in study.sweeps if s.name in in_place and s.low < s.high]
    if not all(in_place[s.name] for s in swept):
        return None
    candidate = SharedRange(
        tuple(s.name for s in swept), tuple(s.low for s in swept), tuple(s.high for s in swept)
    )
    return candidate if swept and structures >= candidate.worth else None
