"""Design points of a study: every combination, side by side, or spread over the ranges."""

from __future__ import annotations

import itertools
import math

import numpy as np

from squealstudy.study.definition import Study
from squealstudy.study.source import SourceText
from squealstudy.study.sweeps import Sweep


def count_points(study: Study) -> int:
    """Number of design points, without making them."""
    design = study.definition.design
    if design.samples is not None:
        return design.samples
    lengths = [len(sweep.values) for sweep in study.sweeps]
    return math.prod(lengths) if design.type == "grid" else max(lengths, default=1)


def check_limit(study: Study, yes: bool) -> None:
    """Raise StudyFileError (key ``design.limit``) for more points than the limit, unless `yes`."""
    count, limit = count_points(study), study.definition.design.limit
    if count > limit and not yes:
        raise SourceText(study.path, study.text).error(
            ("design", "limit"),
            f"the study has {count:,} design points, more than the limit of {limit:,}: "
            "give --yes to run it all the same, raise the limit or sweep fewer values",
        )


def grid_shape(study: Study) -> tuple[int, ...] | None:
    """Number of values of each sweep, the first varying fastest; None where there is no grid."""
    if study.definition.design.type != "grid":
        return None
    return tuple(len(sweep.values) for sweep in study.sweeps)


def design_points(study: Study) -> list[dict[str, float]]:
    """Swept values of each design point, by parameter name.

    In a grid the first sweep varies fastest: its lines are contiguous. The points of a random
    design are decided by its seed.
    """
    names = [sweep.name for sweep in study.sweeps]
    kind = study.definition.design.type
    if kind == "grid":
        slowest_first = itertools.product(*(s.values for s in reversed(study.sweeps)))
        rows = [tuple(reversed(row)) for row in slowest_first]
    elif kind == "zip":
        rows = list(zip(*(s.values for s in study.sweeps), strict=True)) or [()]
    else:
        rows = _random_rows(study)
    return [dict(zip(names, row, strict=True)) for row in rows]


def _random_rows(study: Study) -> list[tuple[float, ...]]:
    unit = _unit_points(study)
    columns = [_spread(sweep, u) for sweep, u in zip(study.sweeps, unit.T, strict=True)]
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _unit_points(study: Study) -> np.ndarray:
    """Points in the unit cube (n_points, n_sweeps)."""
    from scipy.stats import qmc

    design, n = study.definition.design, count_points(study)
    rng = np.random.default_rng(design.seed)
    if design.type == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(len(study.sweeps), seed=rng).random(n))
    # a power of two is drawn, and its beginning taken: the sequence is the same
    sobol = qmc.Sobol(len(study.sweeps), scramble=True, seed=rng)
    return np.asarray(sobol.random_base2((n - 1).bit_length()))[:n]


def _spread(sweep: Sweep, u: np.ndarray) -> np.ndarray:
    """Values of a swept range from numbers in [0, 1)."""
    if sweep.scale == "log":
        a, b = math.log(sweep.low), math.log(sweep.high)
        x = np.exp(a + (b - a) * u)
    else:
        x = sweep.low + (sweep.high - sweep.low) * u
    return np.clip(x, sweep.low, sweep.high)
