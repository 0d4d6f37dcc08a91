"""What a rung is: a way from design points of one structure to their complex modes, with errors."""

from __future__ import annotations

import hashlib
import inspect
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from squealstudy.errors import ConvergenceError
from squealstudy.modes.point import PointModes
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.tracking.refinement import Modes

Found = tuple[int, PointModes | ConvergenceError]


class Scope(NamedTuple):
    """What a study asks of a rung, known before anything is made.

    Attributes
    ----------
    reduced : bool
        The model has component-mode coordinates, be they complete; a family of matrices has none.
    varied : int
        Parameters that vary within a structure.
    points : int
        Design points a structure.
    damped : str
        Name of the damping ratio of all assembly modes where a design point has one, or ''.
    single : str
        Name of a damping ratio of a single assembly mode that is not that of all, or ''.
    """

    reduced: bool
    varied: int
    points: int
    damped: str = ""
    single: str = ""


class Offer(NamedTuple):
    """Whether a rung saves time over exact solves of a study, and why or why not; '' where unasked.

    Attributes
    ----------
    pays : bool
    reason : str
    """

    pays: bool
    reason: str


class Rung(ABC):
    """A way to the complex modes of design points, exact or approximate.

    A subclass is registered by an instance ``RUNG`` in a file of `squealstudy.modes.rungs`, or by
    `register_rung`. Its name is the choice of ``[modes] method`` in study files.

    Attributes
    ----------
    name : str
    description : str
        One line.
    exact : bool
        Its error is that of the eigensolver: it has no tolerance, and other rungs fall back on it.
    unreduced : bool
        It solves the full-order model, so that points have no error of a reduction.
    keeps_tolerance : bool
        A point whose estimated error exceeds the study's tolerance is solved exactly. Rungs that do
        not are for comparison.
    over_a_basis : bool
        It reads the problem's sweep basis, which is made before its points are solved.
    shares_work : bool
        Points of a box are cheaper together than one by one.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    exact: ClassVar[bool] = False
    unreduced: ClassVar[bool] = False
    keeps_tolerance: ClassVar[bool] = True
    over_a_basis: ClassVar[bool] = False
    shares_work: ClassVar[bool] = False

    @abstractmethod
    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[Found]:
        """Complex modes of design points of one structure, in any order.

        Parameters
        ----------
        problem : Problem
        points : sequence of Point
        box : Box
            Part of the problem's coordinates that holds them; it follows from the study's whole
            design, so that results do not depend on which of its points are asked for.

        Yields
        ------
        (int, PointModes or ConvergenceError)
            Index among the points, and the modes or why there are none.

        Raises
        ------
        ConvergenceError, LinAlgError
            Where the method fails; the points that it has not yielded are then solved exactly.
        """

    def modes_at(self, problem: Problem, point: Point, box: Box) -> Modes:
        """Oscillating modes of a point between those of a study, for tracking and onsets.

        Raises
        ------
        ConvergenceError
            Where it has none.
        """
        ((_, found),) = self.solve(problem, [point], box)
        if isinstance(found, ConvergenceError):
            raise found
        kept = ~found.overdamped
        return Modes(found.lam[kept], found.shapes[kept])

    def refusal(self, scope: Scope) -> str:
        """Why this rung cannot serve a study, and what can; '' where it can."""
        return ""

    @property
    def setup_solves(self) -> int:
        """Exact solves that cost as much as what a structure needs before its points, about."""
        return 0

    def relative_cost(self, points: int, varied: int) -> float:
        """Seconds of a design point over those of an exact solve, about.

        Parameters
        ----------
        points : int
            Design points a structure.
        varied : int
            Parameters that vary in them.
        """
        return 1.0

    def offer(self, scope: Scope) -> Offer:
        """Whether an ``auto`` study is to be served by this rung; by default never."""
        return Offer(False, "")

    @property
    def source_hash(self) -> str:
        """Hash of the file of a rung from outside; '' of the package's, whose code results know."""
        if type(self).__module__.startswith("squealstudy."):
            return ""
        source = inspect.getsource(inspect.getmodule(type(self)) or type(self))
        return hashlib.sha256(source.encode()).hexdigest()[:16]
