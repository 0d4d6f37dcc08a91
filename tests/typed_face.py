"""The face as a program with types uses it: `mypy` reads this file, `test_face_types.py` runs it.

`assert_type` fails where the face says less of a type than is known.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, assert_type

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import squealstudy as sq
from squealstudy.engine.kind import Planned
from squealstudy.errors import StudyFileError
from squealstudy.kinds.methods import MethodsFile
from squealstudy.laws import ContactLawDefinition, FrictionCurveDefinition, register
from squealstudy.mechanics.limit_cycles import LimitCycles
from squealstudy.mechanics.linear import LinearSystem
from squealstudy.mechanics.modes import ComplexModes
from squealstudy.mechanics.motions import Runs
from squealstudy.mechanics.reduction import Reduction
from squealstudy.mechanics.sensitivities import Sensitivities
from squealstudy.mechanics.steady import SteadySliding
from squealstudy.mechanics.unreduced import Unreduced
from squealstudy.modes.rungs import register_rung
from squealstudy.motion.integrator import register_integrator
from squealstudy.study.definition import ResolvedStudy
from squealstudy.study.kinds import register_kind

BAND_HZ = (10.0, 1000.0)
HOOKS = (register, register_rung, register_integrator, register_kind)
DEFINITIONS = (ContactLawDefinition, FrictionCurveDefinition)


def mechanics() -> None:
    """Models and each step of the library."""
    model = sq.model("hulten", friction=0.5, damping_ratio=0.01)
    system = model.at(friction=np.linspace(0.1, 0.5, 2))
    assert_type(system, sq.System)
    assert_type(system[1], sq.System)
    point = model.at()
    assert_type(point.assembly, Unreduced)
    assert_type(point.reduced(), Reduction)
    assert_type(point.steady, SteadySliding)
    assert_type(point.linear, LinearSystem)
    modes = system.modes(BAND_HZ)
    assert_type(modes, ComplexModes)
    assert_type(modes.growth_rate, np.ndarray)
    assert_type(modes.left, np.ndarray)
    assert_type(modes.to_pandas(), pd.DataFrame)
    assert_type(model.sweep(friction=[0.1, 0.5]), pd.DataFrame)
    assert_type(point.sensitivities("friction"), Sensitivities | tuple[Sensitivities, ...])
    runs = point.simulate(1e-3, step=1e-5)
    assert_type(runs, Runs)
    assert_type(runs.torque, np.ndarray)
    assert_type(runs.summary(), pd.DataFrame)
    assert_type(point.limit_cycles(), LimitCycles | tuple[LimitCycles, ...])
    assert_type(sq.matrices(np.eye(2), np.diag([1e6, 2e6])).modes(BAND_HZ), pd.DataFrame)
    assert_type(sq.list_models(), dict[str, str])


def study_and_results(folder: Path) -> None:
    """A study, its results, tables and pictures."""
    study = sq.model("hulten").study(band=BAND_HZ).with_(friction=[0.1, 0.5])
    assert_type(study, sq.Study)
    assert_type(study.plan(), Planned)
    assert_type(len(study.plan().tasks), int)
    assert_type(study.resolved, ResolvedStudy | MethodsFile[Any])
    assert_type(study.text, str)
    assert_type(study.directory, Path)
    assert_type(sq.read_study(sq.new_study(folder / "new.toml", model="belt")), sq.Study)
    assert_type(sq.write_example("hulten_flutter", folder), list[Path])
    results = sq.run(study, folder / "results", jobs=1)
    assert_type(results, sq.Results)
    assert_type(results.points, pd.DataFrame)
    assert_type(results.onsets, pd.DataFrame)
    assert_type(results.rank(), pd.DataFrame)
    assert_type(sq.other_codes(results.modes), pd.DataFrame)
    assert_type(results.units, dict[str, str])
    assert_type(results.plot.evolution(along="friction"), Figure)

    @sq.register_plot(modes=("frequency_hz", "growth_rate"))
    def roots(results: sq.Results, size: float = 9.0) -> Figure:
        figure = Figure()
        modes = results.modes
        figure.add_subplot().scatter(modes["frequency_hz"], modes["growth_rate"], size)
        return figure

    assert_type(roots(results, size=4.0), Figure)
    assert_type(sq.open_results(folder / "results"), sq.Results)
    with contextlib.suppress(StudyFileError):
        study.with_({"modes.method": "none"})
    assert_type(StudyFileError("expected one of them", key="modes.method").key, str)
