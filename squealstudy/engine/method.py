"""Which rung serves a study: as its file says, or the one of least total cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from squealstudy.models.matrices.family import FamilyDefinition
from squealstudy.modes.rung import Rung, Scope
from squealstudy.modes.rungs import AUTO, all_rungs, exact_rung, rung_named
from squealstudy.study.definition import ResolvedStudy, given_keys
from squealstudy.study.parameters import DAMPING_RATIO


class RungChoice(NamedTuple):
    """A rung by its name, the tolerance it keeps, and why it was chosen.

    Attributes
    ----------
    name : str
    tolerance : float
        Largest error of lightly damped and of growing roots, relative to their moduli.
    reason : str
    exact : str
        The rung that is exact for the model, for what this one cannot solve.
    """

    name: str
    tolerance: float
    reason: str
    exact: str

    @property
    def rung(self) -> Rung:
        """The rung itself."""
        return rung_named(self.name)

    @property
    def largest_error(self) -> float:
        """What a point's roots may be wrong by and count as solved, relative to their moduli."""
        return self.tolerance if self.rung.keeps_tolerance else np.inf

    @property
    def identity(self) -> list[object]:
        """What results depend on beside the model: nothing where the reduced model is exact."""
        rung = self.rung
        outside = [rung.source_hash] if rung.source_hash else []
        if rung.exact:
            return [rung.name, *outside] if rung.unreduced or outside else []
        return [rung.name, self.tolerance, *outside]


def choose_method(study: ResolvedStudy, swept: Sequence[Mapping[str, float]]) -> RungChoice:
    """Choose the rung of a study: as its file says, or the one of least total cost.

    Parameters
    ----------
    study : ResolvedStudy
    swept : sequence of mapping
        Swept values of each design point.

    Raises
    ------
    StudyFileError
        A method that cannot serve this study.
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
    if refusal := rung_named(section.method).refusal(scope):
        others = ", ".join(rung.name for rung in all_rungs() if not rung.refusal(scope))
        raise study.error(("modes", "method"), f"{refusal}: expected one of {others}")
    return RungChoice(section.method, section.tolerance, _who_says(study), exact)


def _who_says(study: ResolvedStudy) -> str:
    """Who set the method: the file, [fidelity], or a study of methods that varies the file."""
    if "modes.method" in given_keys(study):
        return "as the study says"
    return "as this variant sets it" if study.definition.fidelity is None else "by [fidelity]"


def _scope(study: ResolvedStudy, swept: Sequence[Mapping[str, float]]) -> Scope:
    structural = [s.name for s in study.sweeps if s.parameter.structural]
    free = [s.name for s in study.sweeps if not s.parameter.structural]
    structures = {tuple(point[name] for name in structural) for point in swept}
    return Scope(
        reduced=not isinstance(study.model, FamilyDefinition),  # a family has no reduction
        varied=sum(len({point[name] for point in swept}) > 1 for name in free),
        points=len(swept) // max(len(structures), 1),
        damped=DAMPING_RATIO if any(_at(study, p, DAMPING_RATIO) for p in swept) else "",
        single=_single_mode_damping(study, swept),
    )


def _cheapest(study: ResolvedStudy, scope: Scope, exact: str) -> tuple[str, str]:
    """The rung of an ``auto`` study, and the reason."""
    if not study.kind.chooses_rung:
        return exact, "the only one of this kind of study"
    if scope.single:
        return exact, f"{scope.single} needs the real modes of each point"
    if study.definition.design.type == "boundary":
        return exact, "a boundary design has few points"
    if scope.reduced and "mesh" not in study.options:
        return exact, "a model of few degrees of freedom"
    if not scope.varied:
        return exact, "nothing varies that a basis could serve"
    offers = [(rung, rung.offer(scope)) for rung in all_rungs() if not rung.refusal(scope)]
    paying = [(rung, offer.reason) for rung, offer in offers if offer.pays]
    if not paying:
        return exact, "; ".join(offer.reason for _, offer in offers if offer.reason)
    rung, why = min(paying, key=lambda found: found[0].relative_cost(scope.points, scope.varied))
    return rung.name, why


def _single_mode_damping(study: ResolvedStudy, swept: Sequence[Mapping[str, float]]) -> str:
    """Name of a damping ratio of a single assembly mode that is not that of all modes, or ''."""
    names = [*study.values, *(s.name for s in study.sweeps)]
    for name in (n for n in names if n.startswith("modes[")):
        if any(_at(study, point, name) != _at(study, point, DAMPING_RATIO) for point in swept):
            return name
    return ""


def _at(study: ResolvedStudy, point: Mapping[str, float], name: str) -> float:
    return point.get(name, study.values.get(name, 0.0))
