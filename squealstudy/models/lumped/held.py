"""Checks that springs or contact hold every motion of a lumped model, and that loads press one."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from squealstudy.models.file_table import KeyPath, PlacedError
from squealstudy.models.lumped.masses import MassSpace
from squealstudy.models.lumped.matrices import MatrixSpace
from squealstudy.models.lumped.parts import LumpedParts
from squealstudy.wording import listed

# singular value of the rows of springs and contacts, scaled to norm 1, below which nothing holds it
UNSUPPORTED_SINGULAR_VALUE = 1e-9
# eigenvalue of a stiffness scaled to a diagonal of ones below which it holds nothing
UNSUPPORTED_EIGENVALUE = 1e-11
TAKES_PART = 0.05  # messages name coordinates that move more, over the largest
MAX_LISTED = 6  # coordinates that a message lists


def check_pressed(space: MatrixSpace, parts: LumpedParts) -> None:
    """Raise PlacedError where no stiffness or spring connects a load's coordinates to a contact."""
    is_coupled = np.abs(parts.structure.K[0]) > 0.0
    rows = [s.row[0] for s in parts.springs]
    spring_points = parts.contact.spring_points[0]
    rows += list(parts.contact.N[0, len(space.file.contact) :][spring_points[:, -1] == 0.0])
    for row in rows:
        is_coupled |= np.outer(row != 0.0, row != 0.0)
    groups = connected_components(is_coupled, directed=False)[1]
    points = parts.contact.N[0, : len(space.file.contact)]
    touching = set(groups[(points != 0.0).any(axis=0)])
    for i, load in enumerate(space.file.load):
        keys: KeyPath = ("load", i, "along")
        if not touching & {groups[space.place(name, keys)] for name, _ in load.along}:
            text = "no contact is pressed: no stiffness joins it to a coordinate of a [[contact]]"
            raise PlacedError(keys, text)


def check_held(space: MassSpace | MatrixSpace, parts: LumpedParts) -> None:
    """Raise PlacedError where neither springs, stiffness nor contact hold a motion."""
    rows = [s.row[0] for s in parts.springs if s.size[0] > 0.0]
    points, spring_points = parts.contact.N[0], parts.contact.spring_points[0]
    has_stiffness = np.ones(len(points), dtype=bool)
    has_stiffness[len(points) - len(spring_points) :] = spring_points[:, 0] > 0.0
    diagonal = np.diagonal(parts.structure.K[0])
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    holding_rows = np.vstack([*rows, *points[has_stiffness]]) * scale
    holding_rows = holding_rows / np.linalg.norm(holding_rows, axis=1, keepdims=True)
    roots, shapes = np.linalg.eigh(scale[:, None] * parts.structure.K[0] * scale)
    holding_rows = np.vstack([holding_rows, shapes.T[roots > UNSUPPORTED_EIGENVALUE]])
    _, sizes, motions = np.linalg.svd(holding_rows)
    free = motions[int((sizes > UNSUPPORTED_SINGULAR_VALUE).sum()) :]
    if not len(free):
        return
    participation = np.abs(free[0] * scale)
    moving = np.flatnonzero(participation > TAKES_PART * participation.max())
    keys: KeyPath
    if isinstance(space, MassSpace):
        names = [f"'{mass}' along {axis}" for mass, axis in (space.names[j] for j in moving)]
        first = space.names[moving[0]][0]
        keys = ("mass", [table.name for table in space.file.mass].index(first), "name")
    else:
        names = [f"coordinate {space.names[j]}" for j in moving]
        keys = ("term", [term.matrix for term in space.file.term].index("K"))
    together = "" if len(moving) == 1 else ", moving together"
    n_unlisted = len(names) - MAX_LISTED
    listed_names = names if n_unlisted <= 0 else [*names[:MAX_LISTED], f"{n_unlisted} others"]
    text = f"nothing holds {listed(listed_names)}{together}: expected a [[spring]] or [[contact]]"
    raise PlacedError(keys, f"{text} that does")
