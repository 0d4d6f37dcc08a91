"""Integrators by name, with the face of the study's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from squealstudy.analysis.integrators.catalogue import INTEGRATORS
from squealstudy.analysis.integrators.integrate import integrate
from squealstudy.analysis.transient.settings import TransientResult, TransientSettings
from squealstudy.analysis.transient.system import ModalSystem, TransientDesign
from squealstudy.analysis.transient.watch import Watch
from squealstudy.errors import ParameterError
from squealstudy.study.transient.modal_runs import Integrate


def check_integrator(name: str, options: Mapping[str, Any]) -> None:
    """Raise ParameterError for an unknown integrator (key ``integrator``) or a bad option."""
    if name not in INTEGRATORS:
        raise ParameterError("integrator", f"'{name}' is none of {', '.join(INTEGRATORS)}")
    INTEGRATORS[name].values(options)


def chosen_integrator(name: str, options: Mapping[str, Any]) -> Integrate:
    """The integrator of that name as a function of systems and designs, one after the other.

    Runs go on to their end: nobody watches them.
    """

    def run(
        system: ModalSystem,
        designs: Sequence[TransientDesign],
        settings: TransientSettings,
        q0: np.ndarray,
        v0: np.ndarray,
        _: Watch | None,
    ) -> list[TransientResult]:
        starts = zip(designs, np.atleast_2d(q0), np.atleast_2d(v0), strict=True)
        return [integrate(name, system, d, settings, q, v, options) for d, q, v in starts]

    return run
