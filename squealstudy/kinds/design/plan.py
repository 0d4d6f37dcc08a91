"""Design points of a design study: designs at operating points, one analysis each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from squealstudy.engine.design_points import DesignPoints, DesignValues, PlannedNames
from squealstudy.engine.keys import ID_TYPE, content_hash
from squealstudy.engine.plan import Plan
from squealstudy.engine.shared_range import SharedRange, shared_range
from squealstudy.errors import StudyFileError
from squealstudy.kinds.design.study import DesignStudy
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import design_points

# analyses: modes with and without sensitivities, limit cycles, the unreduced model, runs in time
MODES, ROOTS, CYCLES, FULL, IN_TIME = "modes", "roots", "cycles", "full_order", "in_time"
MAX_STRUCTURES = 1_000_000  # most structures of a search whose variables change the structure


class Evaluation(NamedTuple):
    """One analysis of one design at one operating point.

    Attributes
    ----------
    values : tuple of float
        Values of the operation, the variables and the scattered parameters, in the order of
        `DesignStudy.sweeps`.
    analysis : str
        One of MODES to IN_TIME.
    """

    values: tuple[float, ...]
    analysis: str

    def of(self, columns: slice) -> tuple[float, ...]:
        """The values in these columns."""
        return self.values[columns]


class AnalysisNames(PlannedNames):
    """Names of design points of different analyses.

    `analyses` (n,) has the analysis of each; points of one analysis have different values. `starts`
    is all that runs in time depend on beside their point.
    """

    def __init__(
        self,
        values: DesignValues,
        analyses: np.ndarray,
        starts: Sequence[Any],
        key_of: Callable[[DesignPoint], str],
        hash_of: Callable[[str], str],
    ) -> None:
        super().__init__(values, key_of, hash_of)
        self._all, self._analyses, self._starts = values, analyses, starts
        self._makers = key_of, hash_of

    @cached_property
    def ids(self) -> np.ndarray:
        """Id (n,) of each point, 16 bytes."""
        ids = np.empty(len(self._analyses), dtype=ID_TYPE)
        key_of, hash_of = self._makers
        for analysis in np.unique(self._analyses).tolist():
            rows = np.flatnonzero(self._analyses == analysis)

            def analysis_hash(key: str, analysis: str = analysis) -> str:
                starts = self._starts if analysis == IN_TIME else ()
                return content_hash([analysis, hash_of(key), *starts])

            ids[rows] = PlannedNames(self._all.at(rows), key_of, analysis_hash).ids
        return ids

    def name(self, number: int) -> str:
        """Id of one of the points."""
        return str(self.ids[number], "ascii")


class DesignPlan(Plan):
    """The design points that the search has asked for so far, in order.

    Parameters
    ----------
    study : DesignStudy
    evaluations : sequence of Evaluation
        The evaluations, each once.
    before : DesignPlan or None
        An earlier plan of the study, whose rows have been read already.

    Attributes
    ----------
    row_of : dict
        Rows that were read, by the ids of their points.
    files_read : set of str
        Names of the chunk files they are from.
    caches : dict
        Results that are computed once for all plans of the study, by name.
    """

    def __init__(
        self,
        study: DesignStudy,
        evaluations: Sequence[Evaluation],
        before: DesignPlan | None = None,
    ) -> None:
        self.evaluations = tuple(evaluations)
        self.row_of: dict[str, dict[str, Any]] = {} if before is None else before.row_of
        self.files_read: set[str] = set() if before is None else before.files_read
        self.caches: dict[str, Any] = {} if before is None else before.caches
        swept = np.array([a.values for a in self.evaluations], dtype=float)
        super().__init__(study, np.asfortranarray(swept.reshape(len(self.evaluations), -1)))

    @property
    def design_study(self) -> DesignStudy:
        """The study, by its own type."""
        return cast("DesignStudy", self.study)

    @cached_property
    def tasks(self) -> DesignPoints:
        """Design points; their analyses are part of their names."""
        analyses = np.array([a.analysis for a in self.evaluations])
        starts = today_values(self.design_study), nominal_operation(self.design_study)
        names = AnalysisNames(self._values, analyses, starts, self.structure_key, self._model_hash)
        return DesignPoints(self._values, names)

    @cached_property
    def shared_range(self) -> SharedRange | None:
        """The range over which structures share a basis, whatever the evaluations are."""
        study = self.design_study
        swept = [*study.sweeps[study.n_operating :]]
        if any(s.parameter.structural for s in swept):
            return shared_range(study, MAX_STRUCTURES)
        matrix = operating_points(study)
        structural_columns = [
            k for k, s in enumerate(study.operation.sweeps) if s.parameter.structural
        ]
        return shared_range(
            study,
            len(np.unique(matrix[:, structural_columns], axis=0)) if structural_columns else 1,
        )

    @property
    def grid_shape(self) -> None:
        """None: the points of a search form no grid."""
        return

    def ends(self, name: str) -> tuple[float, float]:
        """Ends of a parameter's range in the study, so that added designs do not change bases."""
        swept_ends = next(((s.low, s.high) for s in self.study.sweeps if s.name == name), None)
        low, high = swept_ends or (self.study.values[name],) * 2
        return float(low), float(high)

    def error(self, parameter: str, message: str) -> StudyFileError:
        """A StudyFileError at the place where the study names a parameter."""
        return self.study.error(self.design_study.place(parameter), message)


def today_values(study: DesignStudy) -> dict[str, float]:
    """Today's values of the variables."""
    return {v.name: v.nominal for v in study.variables}


def nominal_operation(study: DesignStudy) -> dict[str, float]:
    """Values in [parameters] of the swept operating parameters that do not change the structure."""
    swept = (s.parameter for s in study.sweeps[: study.n_operating])
    return {p.name: study.value_of(p) for p in swept if not p.structural}


def first_plan(study: DesignStudy) -> DesignPlan:
    """Today's design over the matrix of operation."""
    points = operating_points(study)
    return DesignPlan(study, [evaluation(study, p, study.nominal) for p in points])


def operating_points(study: DesignStudy) -> np.ndarray:
    """The matrix of operation (m, n_operating), in the order of the file."""
    return design_points(study.operation)


def evaluation(
    study: DesignStudy,
    point: np.ndarray,
    design: np.ndarray,
    analysis: str = MODES,
    scatter: np.ndarray | None = None,
) -> Evaluation:
    """One design (d,) at one operating point; scattered values (k,) by default nominal."""
    uncertain = study.uncertain_nominal if scatter is None else scatter
    values = np.concatenate([point, design, uncertain], dtype=float)
    return Evaluation(tuple(values.tolist()), analysis)
