"""Friction coefficients of contact points over the parameter `friction`."""

from __future__ import annotations

import numpy as np

from squealstudy.models.components.file_tables import FrictionTable
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import Numbers, ValuesError
from squealstudy.models.file_table import KeyPath, PlacedError

FACTOR_KEY, SPREAD_KEY = "friction_factor", "friction_spread"


def friction_factors(geometry: Geometry, numbers: Numbers, number: int) -> np.ndarray:
    """Factors (n,) at the points of a sliding contact.

    Those of a file deviate from their mean over the face by `friction_spread` times as much.

    Raises
    ------
    PlacedError
        A file of factors that cannot be used; a spread in the file by which some are below zero.
    ValuesError
        Such a spread of a parameter.
    """
    table, pair = geometry.file.contact[number], geometry.contacts[number]
    of_file = table.friction_factor
    if not isinstance(of_file, FrictionTable):
        uniform = 1.0 if of_file is None else numbers.at("contact", number, FACTOR_KEY)
        return np.full(len(pair.gap0), uniform)
    factors = geometry.measured(number, pair, FACTOR_KEY, of_file.file)
    if table.friction_spread is None:
        return factors
    keys: KeyPath = ("contact", number, SPREAD_KEY)
    mean = float(np.average(factors, weights=pair.slave.area))
    spread: np.ndarray = mean + numbers.at(*keys) * (factors - mean)
    if (spread < 0).any():
        most = mean / (mean - float(factors.min()))
        text = (
            f"expected a {SPREAD_KEY} of at most {most:.4g}, beyond which factors of "
            f"{of_file.file} are below 0: the least would be {spread.min():.3g}"
        )
        raise ValuesError((keys,), text) if keys in numbers.given else PlacedError(keys, text)
    return spread


def mean_and_largest(geometry: Geometry, number: int) -> tuple[float, float]:
    """Mean over the area and largest factor of a contact whose file says them.

    Raises
    ------
    PlacedError
        A file of factors that cannot be used.
    """
    table, pair = geometry.file.contact[number], geometry.contacts[number]
    assert isinstance(table.friction_factor, FrictionTable)
    factors = geometry.measured(number, pair, FACTOR_KEY, table.friction_factor.file)
    return float(np.average(factors, weights=pair.slave.area)), float(factors.max())
