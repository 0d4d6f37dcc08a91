"""The sliding speed at which friction saturates in time, one for all design points together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from squealstudy.models.operating import REGULARISATION_SHARE, REGULARISATION_SPEED, SLOPE


def is_automatic(values: Mapping[str, float | np.ndarray]) -> Any:
    """Whether slopes of friction follow from the slowest design point; of each if given arrays."""
    return (values[SLOPE.name] == 0) & (values[REGULARISATION_SPEED.name] == 0)


def with_speed(
    values: Mapping[str, float | np.ndarray], slowest: float
) -> dict[str, float | np.ndarray]:
    """Values of design points, the regularisation speed resolved where it is automatic.

    What is solved is then named by the values: design points of two studies that saturate at the
    same speed are the same, whatever else is swept.
    """
    automatic, given_speed = is_automatic(values), values[REGULARISATION_SPEED.name]
    if not np.any(automatic):
        return dict(values)
    resolved = REGULARISATION_SHARE * slowest
    speed = np.where(automatic, resolved, given_speed) if np.ndim(automatic) else resolved
    return {**values, REGULARISATION_SPEED.name: speed}
