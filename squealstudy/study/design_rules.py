"""Which keys go with which design, and how many sweeps it takes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from squealstudy.study.kinds import model_kind
from squealstudy.study.sections import StudyDefinition, SweepSection
from squealstudy.study.source import SourceText

if TYPE_CHECKING:
    from squealstudy.study.sweeps import Sweep

SOBOL_INDICES = "sobol_indices"
RANDOM_DESIGNS = ("sobol", "latin_hypercube", SOBOL_INDICES)
BOUNDARY = "boundary"
LEAST_GROUPS = 8  # base points of sobol_indices: fewer tell nothing
LEAST_SWEEPS = {"sobol": 1, "latin_hypercube": 1, "sobol_indices": 2, BOUNDARY: 1}
MOST_BOUNDARY_SWEEPS = 3
MOST_NODES = 1_000_000  # of the full grid of a boundary design


def check_design(definition: StudyDefinition, sweeps: Sequence[Sweep], source: SourceText) -> None:
    """Raise StudyFileError where the design does not fit its sweeps, or has keys of another."""
    design = definition.design
    random = design.type in RANDOM_DESIGNS
    least = LEAST_SWEEPS.get(design.type, 0)
    if len(sweeps) < least:
        needed = "one [[sweep]]" if least == 1 else "two [[sweep]] tables"
        raise source.error(("design", "type"), f"a {design.type} design needs at least {needed}")
    if random and design.samples is None:
        raise source.error(
            ("design", "samples"),
            f"the key 'samples' is missing: number of points of a {design.type} design",
        )
    for key in ("samples", "seed"):
        if not random and key in design.model_fields_set:
            raise source.error(
                ("design", key),
                f"only {', '.join(RANDOM_DESIGNS)} designs have '{key}', not {design.type}",
            )
    if "levels" in design.model_fields_set and design.type != BOUNDARY:
        raise source.error(
            ("design", "levels"), f"only boundary designs have 'levels', not {design.type}"
        )
    n = design.samples or 1
    if design.type == "sobol_indices" and (n < LEAST_GROUPS or n & (n - 1)):
        below = max(LEAST_GROUPS, 1 << (n.bit_length() - 1))
        raise source.error(
            ("design", "samples"),
            f"expected a power of two from {LEAST_GROUPS} on, such as {below} or {2 * below}, "
            f"got {n}",
        )
    if design.type == "zip":
        _check_zip(definition.sweep, sweeps, source)
    if design.type == BOUNDARY:
        _check_boundary(definition, sweeps, source)


def _check_boundary(
    definition: StudyDefinition, sweeps: Sequence[Sweep], source: SourceText
) -> None:
    """Complex modes, few sweeps, a grid that is not vast."""
    kind, design = model_kind(definition.study.kind), definition.design
    if not kind.chooses_rung:
        raise source.error(
            ("design", "type"),
            f"a boundary design needs kind = 'complex_modes', this is {kind.name}",
        )
    if len(sweeps) > MOST_BOUNDARY_SWEEPS:
        raise source.error(
            ("design", "type"),
            f"a boundary design has 1 to {MOST_BOUNDARY_SWEEPS} [[sweep]] tables, "
            f"got {len(sweeps)}",
        )
    nodes = math.prod((len(s.values) - 1) * 2**design.levels + 1 for s in sweeps)
    if nodes > MOST_NODES:
        raise source.error(
            ("design", "levels"),
            f"the full grid would have {nodes:,} nodes, more than {MOST_NODES:,}: "
            "fewer levels, or a smaller num",
        )
    for i, sweep in enumerate(sweeps):
        steps = [b - a for a, b in itertools.pairwise(sweep.halved(design.levels))]
        if min(steps) <= 0 <= max(steps):
            raise source.error(
                ("sweep", i, "stop"), f"too near to start for {design.levels} halvings of each step"
            )


def _check_zip(
    sections: tuple[SweepSection, ...], sweeps: Sequence[Sweep], source: SourceText
) -> None:
    """Equal lengths, and no point twice."""
    for i, sweep in enumerate(sweeps):
        if len(sweep.values) != len(sweeps[0].values):
            raise source.error(
                ("sweep", i, "num" if sections[i].values is None else "values"),
                f"zip takes sweeps of equal length: '{sweep.name}' has {len(sweep.values)} values, "
                f"'{sweeps[0].name}' has {len(sweeps[0].values)}",
            )
    points = list(zip(*(s.values for s in sweeps), strict=True))
    if len(set(points)) < len(points):
        raise source.error(("design", "type"), "a point of this zip design appears twice")
