"""A rung: a way from design points of one structure to their complex modes, with errors."""

from __future__ import annotations

import inspect
import traceback
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError, ExtensionError, SquealstudyError
from squealstudy.extensions import hash_of
from squealstudy.modes.answer import PointAnswer, checked
from squealstudy.modes.point import PointModes
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import lightly_damped
from squealstudy.modes.tracking.refinement import Modes


class Scope(NamedTuple):
    """Properties of a study by which a rung is chosen, known before anything is made.

    Attributes
    ----------
    reduced : bool
        Whether the model has component-mode coordinates, complete or not; a family of matrices has
        none.
    varied : int
        Number of parameters that vary within a structure.
    points : int
        Number of design points of each structure.
    damped : str
        Name of the damping ratio of all assembly modes where a design point has one, or ''.
    single : str
        Name of a damping ratio of a single assembly mode that differs from that of all, or ''.
    """

    reduced: bool
    varied: int
    points: int
    damped: str = ""
    single: str = ""


class Offer(NamedTuple):
    """Whether a rung saves time over exact solves of a study, and why or why not.

    Attributes
    ----------
    pays : bool
    reason : str
        Empty for a rung that is never offered.
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
        Whether its only error is that of the eigensolver: it has no tolerance, and other rungs fall
        back on it.
    unreduced : bool
        Whether it solves the full-order model, so that points have no error of a reduction.
    keeps_tolerance : bool
        Whether a point whose estimated error exceeds the study's tolerance, or is not known, is
        solved exactly instead. Rungs that do not keep it are for comparison.
    over_a_basis : bool
        Whether it needs the problem's sweep basis, which is then made before its points are solved.
    shares_work : bool
        Whether points of a box are cheaper together than one by one. Where times and errors are
        measured at a few points of a study, all points are solved with such a rung, and only these
        few with others. Searches for the cheapest settings try such rungs beside the exact one.
    """

    name: ClassVar[str]
    description: ClassVar[str]
    exact: ClassVar[bool] = False
    unreduced: ClassVar[bool] = False
    keeps_tolerance: ClassVar[bool] = True
    over_a_basis: ClassVar[bool] = False
    shares_work: ClassVar[bool] = False

    @abstractmethod
    def solve(self, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[PointAnswer]:
        """Complex modes of design points of one structure, in any order.

        It is called with many points, and by tracking and onsets with one at a time, of the same
        problem. So results that belong to a box may be stored by (problem, box), with the problem
        as a weak key; each worker process has its own. A rung has no options: constants of its file
        are part of the identity of results.

        Parameters
        ----------
        problem : Problem
            ``problem.theta(points)``: coordinates (n, d) in [-1, 1]; ``problem.point_at(theta)``: a
            design point there; ``problem.exact(point)``: its modes, those of the band alone, so
            that their number may differ between points, ascending in abs(lambda), so that two
            that cross change places: pair them by ``shapes``; ``problem.swept.samples(theta)[k]``:
            its Linearisation, with the working point, or the ConvergenceError of a point without.
            `exact` raises that error where there is no working point. ``problem.tolerance``: the
            study's, of errors relative to abs(lambda).
        points : sequence of Point
        box : Box
            Part of the problem's coordinates that holds them; it follows from the study's whole
            design, so that results do not depend on which of its points are asked for. A study of
            few points has one box over its whole range: halve it where modes change too much for
            the rung, and keep what each part costs. Corners
            ``box.low``, ``box.middle``, ``box.high`` (d,); ``box.local(theta)``: coordinates in
            [-1, 1] within it, ``box.place(local)`` back.

        Yields
        ------
        (int, PointModes or ConvergenceError)
            Index among the points, and the modes, or the error that says why there are none: then
            the point has failed. All numbers have to be those of this point, its working point too.
            A copy of another point's modes by `dataclasses.replace` needs all that differs.
            ``error_rung`` is the error of each root by the rung [1/s], NaN where it is not known:
            with ``keeps_tolerance`` such a point is solved exactly. ``residual`` is NaN where it
            was not computed. ``shapes`` have any complex phase: align them before interpolation.

        Raises
        ------
        ConvergenceError, LinAlgError, FloatingPointError, ValueError
            Where the method fails. Points that were not yielded, with an exception or without, are
            solved exactly, and results state the reason. To say why some are left over, raise
            ``ConvergenceError("not_converged", why)`` after the last one is yielded. A yielded
            ConvergenceError is final; its status is that of the point in tables: "not_converged",
            or that of the working point, which is passed on as it is.
        ExtensionError
            Raised by the caller for all other exceptions, and for anything but such a pair.
        """

    def modes_at(self, problem: Problem, point: Point, box: Box) -> Modes:
        """Oscillating modes of a point between those of a study, for tracking and onsets.

        Raises
        ------
        ConvergenceError
            Where it has none.
        """
        outcome = dict(answers(self, problem, [point], box)).get(0, LEFT_OVER)
        if isinstance(outcome, ConvergenceError):
            raise outcome
        if why := beyond_tolerance(self, problem, outcome):
            raise ConvergenceError("left_over", why)
        oscillates = ~outcome.overdamped
        return Modes(outcome.lam[oscillates], outcome.shapes[oscillates])

    def refusal(self, scope: Scope) -> str:
        """Why this rung cannot serve a study, and what can; '' where it can."""
        return ""

    @property
    def setup_solves(self) -> int:
        """Cost of the work for a structure before its points, in exact solves, about.

        Solves at nodes belong here, not in `relative_cost`.
        """
        return 0

    def relative_cost(self, points: int, varied: int) -> float:
        """Time of a design point over that of an exact solve, about.

        Parameters
        ----------
        points : int
            Number of design points of a structure.
        varied : int
            Number of parameters that vary in them.
        """
        return 1.0

    def offer(self, scope: Scope) -> Offer:
        """Whether an ``auto`` study should use this rung; by default never."""
        return Offer(False, "")

    @property
    def source_hash(self) -> str:
        """Hash of the file of a rung from outside the package; '' for the package's own."""
        if type(self).__module__.startswith("squealstudy."):
            return ""
        return hash_of(Path(inspect.getfile(type(self))))


LEFT_OVER = ConvergenceError("left_over", "not yielded")


def answers(
    rung: Rung, problem: Problem, points: Sequence[Point], box: Box
) -> Iterator[PointAnswer]:
    """Modes that a rung yields for design points; those from outside the package are checked.

    Raises
    ------
    ExtensionError
        A rung from outside that ends with another exception than `Rung.solve` allows, or whose
        modes are not those of these points or have numbers that no mode can have.
    ConvergenceError, LinAlgError, FloatingPointError, ValueError
        Those of `Rung.solve`.
    """
    if not rung.source_hash:
        yield from rung.solve(problem, points, box)
        return
    answered: set[int] = set()
    yielded = iter(rung.solve(problem, points, box))
    while True:
        try:
            answer = next(yielded)
        except StopIteration:
            return
        except (SquealstudyError, np.linalg.LinAlgError, FloatingPointError, ValueError):
            raise
        except Exception as error:
            raise _fault_of(rung, error, f"{type(error).__name__}: {error}") from error
        try:
            index, modes = checked(answer, rung.name, problem, points, answered)
        except (TypeError, ValueError) as error:
            raise _fault_of(rung, error, str(error)) from error
        answered.add(index)
        yield index, modes


def _fault_of(rung: Rung, error: Exception, text: str) -> ExtensionError:
    """An error of a rung from outside, with its file and the last line there in the traceback."""
    path = Path(inspect.getfile(type(rung)))
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename) == path]
    where = f"line {lines[-1]}: " if lines else ""
    return ExtensionError(path, f"{where}rung '{rung.name}': {text}")


def beyond_tolerance(rung: Rung, problem: Problem, modes: PointModes) -> str:
    """Why modes that a rung found do not keep the study's tolerance; '' where they do."""
    if modes.method != rung.name or not rung.keeps_tolerance or rung.exact:
        return ""
    judged = lightly_damped(modes.lam) | (modes.lam.real > 0)
    error = modes.error_rung[judged] / np.abs(modes.lam[judged])
    if (error <= problem.tolerance).all():
        return ""
    if np.isnan(error).any():
        return "an error is not known"
    return f"estimated error {error.max():.1e}, beyond the tolerance {problem.tolerance:g}"
