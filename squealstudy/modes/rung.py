"""What a rung is: a way from design points of one structure to their complex modes, with errors."""

from __future__ import annotations

import hashlib
import inspect
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from squealstudy.errors import ConvergenceError, ExtensionError, SquealstudyError
from squealstudy.modes.point import PointModes
from squealstudy.modes.problem import Point, Problem
from squealstudy.modes.reanalysis.patch import Box
from squealstudy.modes.reanalysis.problem import lightly_damped
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
        A point whose estimated error exceeds the study's tolerance, or is not known, is solved
        exactly instead. Rungs whose points are not are for comparison.
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

        It is called with many points, and by tracking and onsets with one at a time, of the same
        problem: what a box costs may be kept by (problem, box). A rung has no options of its own:
        constants of its file are part of the identity of results.

        Parameters
        ----------
        problem : Problem
            ``problem.theta(points)``: coordinates (n, d) in [-1, 1]; ``problem.point_at(theta)``: a
            design point there; ``problem.exact(point)``: its modes, those of the band alone, so
            that their number may differ between points; ``problem.swept.samples(theta)[k]``: its
            Linearisation, with the working point.
        points : sequence of Point
        box : Box
            Part of the problem's coordinates that holds them; it follows from the study's whole
            design, so that results do not depend on which of its points are asked for.

        Yields
        ------
        (int, PointModes or ConvergenceError)
            Index among the points, and the modes or why there are none: then the point has failed.
            All figures of the modes are this point's, its working point as well.

        Raises
        ------
        ConvergenceError, LinAlgError, FloatingPointError, ValueError
            Where the method fails. The points that it has not yielded, with an exception or
            without, are solved exactly, and results tell the reason.
        """

    def modes_at(self, problem: Problem, point: Point, box: Box) -> Modes:
        """Oscillating modes of a point between those of a study, for tracking and onsets.

        Raises
        ------
        ConvergenceError
            Where it has none.
        """
        found = dict(answers(self, problem, [point], box)).get(0, LEFT_OVER)
        if isinstance(found, ConvergenceError):
            raise found
        if why := beyond_tolerance(self, problem, found):
            raise ConvergenceError("left_over", why)
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


LEFT_OVER = ConvergenceError("left_over", "not yielded")


def answers(rung: Rung, problem: Problem, points: Sequence[Point], box: Box) -> Iterator[Found]:
    """What a rung yields for design points; what comes from outside the package is checked.

    Raises
    ------
    ExtensionError
        A rung from outside that ends with another exception than `Rung.solve` allows, or whose
        modes are none of these points' or have figures of different numbers.
    ConvergenceError, LinAlgError, FloatingPointError, ValueError
        As `Rung.solve`.
    """
    if not rung.source_hash:
        yield from rung.solve(problem, points, box)
        return
    path = Path(inspect.getfile(type(rung)))
    known: set[int] = set()
    try:
        for item in rung.solve(problem, points, box):
            index, found = _checked(item, len(points), known)
            known.add(index)
            yield index, found if isinstance(found, ConvergenceError) else _named(rung, found)
    except (SquealstudyError, np.linalg.LinAlgError, FloatingPointError, ValueError):
        raise
    except Exception as error:
        text = f"rung '{rung.name}': {type(error).__name__}: {error}"
        raise ExtensionError(path, text) from error


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


def _checked(item: Any, count: int, known: Collection[int]) -> Found:
    if not isinstance(item, tuple) or len(item) != 2:
        raise TypeError(f"expected to yield an index and modes, got {type(item).__name__}")
    index, found = item
    if not isinstance(index, int | np.integer) or not 0 <= index < count:
        raise TypeError(f"expected an index from 0 to {count - 1}, yielded {index!r}")
    if index in known:
        raise TypeError(f"yielded point {index} twice")
    if isinstance(found, ConvergenceError):
        return int(index), found
    if not isinstance(found, PointModes):
        raise TypeError(
            f"expected PointModes or a ConvergenceError of point {index}, "
            f"yielded {type(found).__name__}"
        )
    m = np.shape(found.lam)
    sizes = {name: np.shape(getattr(found, name)) for name in ("residual", "error_rung")}
    sizes["shapes"] = np.shape(found.shapes)[:1]
    sizes["energies"] = np.shape(found.energies)[1:]
    wrong = [f"{name} {size}" for name, size in sizes.items() if size != m]
    if len(m) != 1 or wrong:
        raise TypeError(f"modes of point {index} have figures of {', '.join(wrong)}, lam of {m}")
    if not np.isfinite(found.lam).all():
        raise TypeError(f"roots of point {index} are not finite")
    return int(index), found


def _named(rung: Rung, found: PointModes) -> PointModes:
    """Modes under the name of their rung, oscillating ones first, ascending in modulus."""
    order = np.lexsort((np.abs(found.lam), found.overdamped))
    return replace(
        found,
        lam=found.lam[order],
        residual=found.residual[order],
        energies=found.energies[:, order],
        shapes=found.shapes[order],
        error_rung=found.error_rung[order],
        method=rung.name,
    )
