"""Integrators by name, with the face of the study's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from squealstudy.analysis.transient.settings import METHODS, TransientResult, TransientSettings
from squealstudy.analysis.transient.simulate import simulate
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.analysis.transient.watch import Watch
from squealstudy.errors import ParameterError
from squealstudy.study.transient.modal_runs import Integrate


def check_integrator(name: str, options: Mapping[str, Any]) -> None:
    """Raise ParameterError for an unknown integrator (key ``integrator``) or a bad option."""
    if name not in METHODS:
        raise ParameterError("integrator", f"'{name}' is none of {', '.join(METHODS)}")
    known = {f.name for f in fields(TransientSettings)}
    for option in options:
        if option not in known:
            raise ParameterError(option, f"expected one of {', '.join(sorted(known))}")


def chosen_integrator(name: str, options: Mapping[str, Any]) -> Integrate:
    """The integrator of that name as a function of systems and designs, one after the other."""

    def run(
        system: ModalSystem,
        designs: Sequence[TransientDesign],
        settings: TransientSettings,
        q0: np.ndarray,
        v0: np.ndarray,
        watch: Watch | None,
    ) -> list[TransientResult]:
        chosen = replace(settings, method=name, **options)
        return simulate(system, designs, chosen, q0, v0, watch)

    return run
