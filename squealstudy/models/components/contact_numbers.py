"""Numbers that a model file states for contact points: gaps, friction factors, speeds, friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from squealstudy.laws import FrictionCurve
from squealstudy.models.assembly import ContactInterface
from squealstudy.models.components.contact_friction import own_friction
from squealstudy.models.components.friction_factors import friction_factors
from squealstudy.models.components.geometry import Geometry
from squealstudy.models.components.model_file import Numbers


def as_in_file(
    contact: ContactInterface,
    sizes: Sequence[int],
    geometry: Geometry,
    numbers: Numbers,
    curve: FrictionCurve,
) -> ContactInterface:
    """The contact points with the numbers that the model file states for them.

    Parameters
    ----------
    contact : ContactInterface
        Points of all contacts, in the order of the file.
    sizes : sequence of int
        Number of points of each contact.
    geometry : Geometry
    numbers : Numbers
    curve : FrictionCurve
        The friction law of the study.

    Raises
    ------
    PlacedError, ValuesError
        As in `friction_factors` and `own_friction`.
    """
    gap, frictional = contact.gap0.copy(), contact.frictional.copy()
    speed, middle = contact.speed_factor.copy(), geometry.effective_radius
    begins = np.cumsum([0, *sizes])
    for i, table in enumerate(geometry.file.contact):
        points = slice(begins[i], begins[i + 1])
        if table.friction_factor is not None:
            frictional[points] = friction_factors(geometry, numbers, i)
        if table.gap_scale is not None:
            gap[points] *= numbers.at("contact", i, "gap_scale")
    for key, gap_value in numbers.given.items():
        if key[0] == "contact" and key[2] == "initial_gap":
            gap[begins[int(key[1])] : begins[int(key[1]) + 1]] = gap_value
    if middle is not None:
        speed = np.where(frictional > 0, contact.radius / middle, 1.0)
    for i, table in enumerate(geometry.file.contact):
        if table.state is not None:
            speed[begins[i] : begins[i + 1]] = 0.0
    names = (geometry.file.name_of("contact", i) for i in range(len(sizes)))
    return replace(
        contact,
        gap0=gap,
        frictional=frictional,
        speed_factor=speed,
        pairs=tuple(name for name, n in zip(names, sizes, strict=True) for _ in range(n)),
        own_friction=own_friction(numbers, begins, curve),
    )
