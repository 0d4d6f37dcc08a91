"""The sliding speed at which friction saturates in time: one for all design points of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from squealstudy.models.operating import (
    REGULARISATION_SHARE,
    REGULARISATION_SPEED,
    SLIDING_SPEED,
    SLOPE,
)
from squealstudy.study.definition import Study
from squealstudy.study.design import DesignPoint


def slowest_speed(study: Study, swept: Sequence[Mapping[str, float]]) -> float:
    """Slowest sliding speed of the design points of a study, m/s."""
    nominal = study.values[SLIDING_SPEED.name]
    return min(abs(point.get(SLIDING_SPEED.name, nominal)) for point in swept)


def is_automatic(values: Mapping[str, float]) -> bool:
    """Whether a design point's slope of friction follows from the slowest of its study."""
    return values[SLOPE.name] == 0 and values[REGULARISATION_SPEED.name] == 0


def with_speed(values: Mapping[str, float], slowest: float) -> dict[str, float]:
    """The values of a design point, its regularisation speed resolved where it is automatic.

    What is solved is then named by the values: design points of two studies that saturate at the
    same speed are the same, whatever else is swept.
    """
    if not is_automatic(values):
        return dict(values)
    return {**values, REGULARISATION_SPEED.name: REGULARISATION_SHARE * slowest}


def regularised(design: DesignPoint) -> bool:
    """Whether the slope follows from a regularisation speed; else the file gives it."""
    return design.values[SLOPE.name] == 0


def regularisation_facts(
    designs: Sequence[DesignPoint], slowest: float, automatic: int
) -> dict[str, Any] | None:
    """For manifest and screens; None where every design point has a slope of its own.

    Returns
    -------
    dict
        ``speed``, ``speed_highest``: least and largest regularisation speed in use, m/s;
        ``slowest_sliding_speed``, m/s, and the ``share`` of it that is automatic; ``points``:
        design points whose slope follows from such a speed, ``automatic``: those among them whose
        speed follows from the slowest one.
    """
    speeds = [d.values[REGULARISATION_SPEED.name] for d in designs if regularised(d)]
    if not speeds:
        return None
    return {
        "speed": min(speeds),
        "speed_highest": max(speeds),
        "slowest_sliding_speed": slowest,
        "share": REGULARISATION_SHARE,
        "points": len(speeds),
        "automatic": automatic,
    }
