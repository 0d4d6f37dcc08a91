"""Chooses the rung of a study: the one that its file names, or that of least cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.models.parameter_names import DAMPING_RATIO
from squealstudy.modes.rung import Rung, Scope
from squealstudy.modes.rungs import AUTO, all_rungs, exact_rung, rung_named
from squealstudy.study.definition import ResolvedStudy, given_keys
from squealstudy.study.sampling import distinct_rows


class RungChoice(NamedTuple):
    """The rung of a study.

    Attributes
    ----------
    name : str
    tolerance : float
        Largest error of lightly damped and of growing roots, relative to their moduli.
    reason : str
        Why it was chosen.
    exact : str
        Name of the exact rung for the model, which solves points that this rung cannot.
    """

    name: str
    tolerance: float
    reason: str
    exact: str

    @property
    def rung(self) -> Rung:
        """The rung of that name."""
        return rung_named(self.name)

    @property
    def largest_error(self) -> float:
        """Relative error of a point's roots up to which it counts as solved."""
        return self.tolerance if self.rung.keeps_tolerance else np.inf

    @property
    def identity(self) -> list[object]:
        """What results depend on besides the model; empty for the exact rung of reduced models."""
        rung = self.rung
        outside = [rung.source_hash] if rung.source_hash else []
        if rung.exact:
            return [rung.name, *outside] if rung.unreduced or outside else []
        return [rung.name, self.tolerance, *outside]


def choose_method(study: ResolvedStudy, swept: np.ndarray) -> RungChoice:
    """Choose the rung of a study: as its file says, or the one of least total cost.

    Parameters
    ----------
    study : ResolvedStudy
    swept : ndarray (n_points, n_sweeps)
        Swept values of each design point.

    Raises
    ------
    StudyFileError
        The method of the file cannot solve this study.
    """
    section, scope = study.definition.modes, _scope(study, swept)
    exact = exact_rung(scope.reduced).name
    if section.method == AUTO:
        name, reason = _cheapest(study, scope, exact)
        return RungChoice(name, section.tolerance, reason, exact)
    if not study.kind.chooses_rung:
        raise study.error(
            ("modes", "method"),
            f"a {study.kind.name} study has no choice of method: leave the key out",
        )
    rung = rung_named(section.method)
    if not rung.exact and (name := _followed(study)):
        raise study.error(("modes", "method"), f"{name}: expected {AUTO} or {exact}")
    if refusal := rung.refusal(scope):
        others = ", ".join(rung.name for rung in all_rungs() if not rung.refusal(scope))
        raise study.error(("modes", "method"), f"{refusal}: expected one of {others}")
    return RungChoice(section.method, section.tolerance, _who_says(study), exact)


def _who_says(study: ResolvedStudy) -> str:
    """Text on who set the method: the file, [fidelity], or a variant in a study of methods."""
    if "modes.method" in given_keys(study):
        return "as the study says"
    return "as this variant sets it" if study.definition.fidelity is None else "by [fidelity]"


def _scope(study: ResolvedStudy, swept: np.ndarray) -> Scope:
    """What decides which rung serves a study: its design points, sweeps and damping."""
    structural = [k for k, s in enumerate(study.sweeps) if s.parameter.structural]
    free = [k for k, s in enumerate(study.sweeps) if not s.parameter.structural]
    structures = int(distinct_rows([swept[:, k] for k in structural], len(swept)).max()) + 1
    return Scope(
        reduced=not isinstance(study.model, FamilyDefinition),  # a family has no reduction
        varied=sum(bool(np.ptp(swept[:, k])) for k in free),
        points=len(swept) // structures,
        damped=DAMPING_RATIO if np.any(_values(study, swept, DAMPING_RATIO)) else "",
        single=_single_mode_damping(study, swept),
    )


def _cheapest(study: ResolvedStudy, scope: Scope, exact: str) -> tuple[str, str]:
    """The rung of an ``auto`` study, and the reason."""
    if not study.kind.chooses_rung:
        return exact, "the only one of this kind of study"
    if scope.single:
        return exact, f"{scope.single} needs the real modes of each point"
    if name := _followed(study):
        return exact, name
    if study.definition.design.type == "boundary":
        return exact, "a boundary design has few points"
    if scope.reduced and not study.model.meshed:
        return exact, "a model of few degrees of freedom"
    if not scope.varied:
        return exact, "each reduced model has one point"
    offers = [(rung, rung.offer(scope)) for rung in all_rungs() if not rung.refusal(scope)]
    paying = [(rung, offer.reason) for rung, offer in offers if offer.pays]
    if not paying:
        return exact, "; ".join(offer.reason for _, offer in offers if offer.reason)
    rung, why = min(paying, key=lambda offer: offer[0].relative_cost(scope.points, scope.varied))
    return rung.name, why


def _followed(study: ResolvedStudy) -> str:
    """Text on parameters that follow a table over a swept one; empty without any."""
    swept = {s.name for s in study.sweeps}
    names = [t.name for t in study.model.tables if swept.intersection(t.over)]
    return f"tables of {', '.join(names)} over what is swept bend at their knots" if names else ""


def _single_mode_damping(study: ResolvedStudy, swept: np.ndarray) -> str:
    """Name of a damping ratio of single assembly modes that differs from the uniform one, or ''."""
    names = [*study.values, *(s.name for s in study.sweeps)]
    for name in (n for n in names if n.startswith("modes[")):
        if np.any(_values(study, swept, name) != _values(study, swept, DAMPING_RATIO)):
            return name
    return ""


def _values(study: ResolvedStudy, swept: np.ndarray, name: str) -> np.ndarray | float:
    """Values of a swept parameter at all points (n,), else its value in the study, or 0."""
    for k, sweep in enumerate(study.sweeps):
        if sweep.name == name:
            column: np.ndarray = swept[:, k]
            return column
    return study.values.get(name, 0.0)
