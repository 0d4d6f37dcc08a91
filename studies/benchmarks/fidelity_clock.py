"""Processor time of what settings of one study share, for `fidelity_costs.py`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from squealstudy.engine.measurement import Measurement
from squealstudy.engine.plan import Plan
from squealstudy.engine.structures import build_structures
from squealstudy.engine.workers import Workers, silent
from squealstudy.fidelity.pilots import FidelityStudy
from squealstudy.kinds.complex_modes.problems import swept_structures
from squealstudy.kinds.transient.batch import training_path
from squealstudy.study.kinds import kind_named


class Clock:
    """Processor time of what settings share, by what it is: made once a round, charged to each."""

    def __init__(self) -> None:
        self.spent: dict[object, float] = {}

    def study_seconds(
        self, fidelity: FidelityStudy, changes: Mapping[str, Any], made: Measurement
    ) -> float:
        """Of all points of a study with `changes`, and of what they share."""
        plan = fidelity.variant(changes, None)
        return self.shared(plan) + made.seconds * len(fidelity.plan.tasks)

    def shared(self, plan: Plan) -> float:
        """Of reductions, and of bases or training runs; makes what is not there."""
        kind = kind_named(plan.study.definition.study.kind)
        keys = list(plan.structures)
        total = sum(self._timed(k, partial(build_structures, plan, Workers(), {k})) for k in keys)
        return total + self._timed(what_is_prepared(plan), partial(kind.prepare, plan, silent))

    def _timed(self, name: object, make: Callable[[], object]) -> float:
        if name not in self.spent:
            started = time.process_time()
            make()
            self.spent[name] = time.process_time() - started
        return self.spent[name]


def what_is_prepared(plan: Plan) -> tuple[Path, ...]:
    """Files of sweep bases or training runs of a study: plans with the same share them."""
    if plan.study.definition.study.kind == "transient":
        wanted = plan.study.section.pod_vectors
        return tuple(training_path(plan, key) for key in plan.structures if wanted)
    if not plan.method.rung.over_a_basis:
        return ()
    return tuple(structure.path for structure in swept_structures(plan))
