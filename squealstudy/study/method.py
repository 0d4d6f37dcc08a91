"""Which rung of reanalysis serves a study: as its file says, or the one of least total cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.study.definition import Study, given_keys
from squealstudy.study.parameters import DAMPING_RATIO
from squealstudy.study.source import SourceText

AUTO, FULL, DENSE = "auto", "full", "dense"
SWEEP_BASIS, WINDOWS = "sweep_basis", "windows"
TWO_STEP, PERTURBATION = "two_step", "perturbation"
OVER_A_BASIS = (SWEEP_BASIS, WINDOWS)
FOR_COMPARISON = (TWO_STEP, PERTURBATION)
APPROXIMATE = (*OVER_A_BASIS, *FOR_COMPARISON)
# design points of one structure from which on windows take less time than dense points, by the
# number of parameters that vary; a basis is made by one process, points are solved by all.
# studies/benchmarks/method_costs.py measures these and what follows
PAYS_FROM = {1: 60, 2: 500, 3: 1500}
BASIS_PAYS_FROM = 600  # with more parameters: patches would be too many, a basis is not

BASIS_SOLVES = 60  # exact solves that a sweep basis costs: 23 over one parameter, 75 over two
# seconds of a design point over those of an exact solve, about
SERVED = {SWEEP_BASIS: 0.55, TWO_STEP: 0.9, PERTURBATION: 0.6}
# and in windows, where many points share a patch: (ALONE / points) ** FALLS, by the number of
# parameters that vary: .23 at 60 points over one; .89 and .64 at 300 and 500 over two; .13 at
# 20,000 is of an earlier state, whose exact points were dearer
ALONE, FALLS = {1: 2.5, 2: 230.0}, 0.46


def served_share(method: str, points: int, varied: int) -> float | None:
    """Seconds of a design point over those of an exact solve, about; None of exact methods.

    `points` are those of a structure, over so many parameters that vary.
    """
    if method != WINDOWS:
        return SERVED.get(method)
    share: float = min(1.0, (ALONE.get(varied, ALONE[2]) / max(points, 1)) ** FALLS)
    return share


class Method(NamedTuple):
    """A rung, the tolerance it keeps, and why it was chosen."""

    name: str
    tolerance: float
    reason: str

    @property
    def largest_error(self) -> float:
        """What a point's roots may be wrong by and count as solved, relative to their moduli.

        Rungs that are there for comparison keep no tolerance.
        """
        return np.inf if self.name in FOR_COMPARISON else self.tolerance

    @property
    def identity(self) -> list[object]:
        """What results depend on beside the model: nothing where the method is exact."""
        if self.name in APPROXIMATE:
            return [self.name, self.tolerance]
        return [FULL] if self.name == FULL else []


def choose_method(
    study: Study, swept: Sequence[Mapping[str, float]], structural: Sequence[str], exact: str
) -> Method:
    """The method of a study.

    Parameters
    ----------
    study : Study
    swept : sequence of mapping
        Swept values of each design point.
    structural : sequence of str
        Swept parameters whose every value is another structure.
    exact : str
        The rung that is exact for the model: dense, or full for matrices.

    Raises
    ------
    StudyFileError
        A method that cannot serve this study.
    """
    section = study.definition.modes
    single = _single_mode_damping(study, swept)
    if section.method != AUTO and study.definition.study.kind != "complex_modes":
        raise SourceText(study.path, study.text).error(
            ("modes", "method"),
            f"a {study.definition.study.kind} study has no choice of method: leave the key out",
        )
    if section.method != AUTO:
        if section.method in OVER_A_BASIS and single:
            raise SourceText(study.path, study.text).error(
                ("modes", "method"),
                f"{section.method} has no damping of single modes of the assembly ({single} is not "
                f"{DAMPING_RATIO}): expected dense, two_step or perturbation, or {DAMPING_RATIO} "
                "in its place",
            )
        if section.method == DENSE and exact == FULL:
            raise SourceText(study.path, study.text).error(
                ("modes", "method"),
                "a family of matrices has no component-mode coordinates for dense: expected full, "
                "sweep_basis or windows",
            )
        return Method(section.method, section.tolerance, _who_says(study))
    return _cheapest(study, swept, structural, exact, single)


def _who_says(study: Study) -> str:
    """Who set the method: the file, [fidelity], or a study of methods that varies the file."""
    if "modes.method" in given_keys(study):
        return "as the study says"
    return "as this variant sets it" if study.definition.fidelity is None else "by [fidelity]"


def _cheapest(
    study: Study,
    swept: Sequence[Mapping[str, float]],
    structural: Sequence[str],
    exact: str,
    single: str,
) -> Method:
    tolerance = study.definition.modes.tolerance
    if study.definition.study.kind != "complex_modes":
        return Method(exact, tolerance, "the only one of this kind of study")
    if single:
        return Method(exact, tolerance, f"{single} needs the real modes of each point")
    if study.definition.design.type == "boundary":
        return Method(exact, tolerance, "a boundary design has few points")
    if exact == DENSE and "mesh" not in study.options:
        return Method(exact, tolerance, "a model of few degrees of freedom")
    free = [s.name for s in study.sweeps if s.name not in structural]
    varied = sum(len({point[name] for point in swept}) > 1 for name in free)
    values = {tuple(point[name] for name in structural) for point in swept}
    each = len(swept) // max(len(values), 1)
    if not varied:
        return Method(exact, tolerance, "nothing varies that a basis could serve")
    if varied in PAYS_FROM and each >= PAYS_FROM[varied]:
        return Method(WINDOWS, tolerance, f"{each} points a structure pay for a basis and patches")
    if varied not in PAYS_FROM and (damped := _not_zero(study, swept, [DAMPING_RATIO])):
        return Method(exact, tolerance, f"{damped} is not interpolated over {varied} parameters")
    if varied not in PAYS_FROM and each >= BASIS_PAYS_FROM:
        return Method(SWEEP_BASIS, tolerance, f"{each} points a structure pay for a basis")
    return Method(exact, tolerance, f"{each} points a structure do not pay for a basis")


def _single_mode_damping(study: Study, swept: Sequence[Mapping[str, float]]) -> str:
    """Name of a damping ratio of a single assembly mode that is not that of all modes, or ''."""
    names = [*study.values, *(s.name for s in study.sweeps)]
    for name in (n for n in names if n.startswith("modes[")):
        if any(_at(study, point, name) != _at(study, point, DAMPING_RATIO) for point in swept):
            return name
    return ""


def _at(study: Study, point: Mapping[str, float], name: str) -> float:
    return point.get(name, study.values.get(name, 0.0))


def _not_zero(study: Study, swept: Sequence[Mapping[str, float]], names: Sequence[str]) -> str:
    """The first of some parameters that is not zero at some design point, or ''."""
    for name in names:
        if any(_at(study, point, name) for point in swept):
            return name
    return ""
