"""The [limit_cycles] section of a study file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Strict

from squealstudy.mechanics.defaults import (
    CYCLE_REACH,
    CYCLE_TOLERANCE,
    MAX_CYCLE_REACH,
    MAX_CYCLE_TOLERANCE,
    MAX_HARMONICS,
    TRANSIENT_BASIS,
)
from squealstudy.study.section import Section
from squealstudy.study.sections import StudyDefinition
from squealstudy.wording import shown

AUTO, ALL, SCREENED = "auto", "all", "screened"
MOST_FAMILY = 10_000  # largest number of a mode: no band has so many that oscillate


def _harmonics(value: object) -> object:
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    if value == AUTO or (is_whole and 1 <= value <= MAX_HARMONICS):  # type: ignore[operator]
        return value
    raise ValueError(f'expected "auto" or a number from 1 to {MAX_HARMONICS}, got {shown(value)}')


def _families(value: object) -> object:
    """The key `families`: "all", "screened" or numbers of modes; ValueError for others."""
    if value in (ALL, SCREENED):
        return value
    numbers = list(value) if isinstance(value, list | tuple) else []
    are_whole = all(isinstance(v, int) and not isinstance(v, bool) for v in numbers)
    if (
        numbers
        and are_whole
        and len(set(numbers)) == len(numbers)
        and 1 <= min(numbers) <= max(numbers) <= MOST_FAMILY
    ):
        return tuple(numbers)
    raise ValueError(
        f'expected "all", "screened" or a list of distinct modes from 1 to {MOST_FAMILY}, '
        f"got {shown(value)}"
    )


def _unchanged(value: int | str) -> int | str:
    return value


def _at(value: object) -> object:
    if isinstance(value, int) and not isinstance(value, bool) and value >= 1:
        return value
    numbers = list(value) if isinstance(value, list | tuple) else []
    if len(numbers) == 3 and all(isinstance(v, int | float) for v in numbers):
        return tuple(float(v) for v in numbers)
    raise ValueError(f"expected [x, y, z] in m or a degree of freedom from 1, got {shown(value)}")


def _distinct(points: tuple[NamedPoint, ...]) -> tuple[NamedPoint, ...]:
    names = [point.name for point in points]
    if len(set(names)) < len(names):
        raise ValueError("expected distinct names of points")
    return points


class NamedPoint(Section):
    """A point whose velocity is told."""

    name: str = Field(min_length=1, max_length=100, description="as tables call it")
    component: str = Field(description="component of the model that it is on")
    at: Annotated[tuple[float, float, float] | int, BeforeValidator(_at)] = Field(
        description="[x, y, z] in m: the nearest node; of a model without a mesh the number of a "
        "degree of freedom, from 1"
    )


class LimitCyclesSection(Section):
    """Which cycles are looked for, and how exactly."""

    harmonics: Annotated[
        Literal["auto"] | int, BeforeValidator(_harmonics), AfterValidator(_unchanged)
    ] = Field(
        default="auto",
        description="harmonics of a cycle: a number, or 'auto': more and more until the levels "
        "change by less than the tolerance",
    )
    tolerance: float = Field(
        default=CYCLE_TOLERANCE,
        gt=0,
        le=MAX_CYCLE_TOLERANCE,
        description="error of a cycle's level that is accepted, relative; a cycle beyond it has "
        "status 'inaccurate'",
    )
    families: Annotated[
        Literal["all", "screened"] | Annotated[tuple[int, ...], Strict(False)],
        BeforeValidator(_families),
    ] = Field(
        default="all",
        description="modes whose growth over amplitude is followed, stable ones too: 'all' of the "
        "band, 'screened' by their growth, or their numbers (from 1, by frequency in the band)",
    )
    screen: float = Field(
        default=525.0,
        gt=0,
        description="1/s: modes that decay faster are not followed where families are 'screened'",
    )
    reach: float = Field(
        default=CYCLE_REACH,
        gt=0,
        le=MAX_CYCLE_REACH,
        description="velocity at a contact point up to which growth is followed, over the "
        "sliding speed",
    )
    follow: str | None = Field(
        default=None,
        min_length=1,
        description="swept parameter, not of the structure, along which cycles are followed "
        "through folds between its least and its largest value: branches",
    )
    borders_over: str | None = Field(
        default=None,
        min_length=1,
        description="second swept parameter, not of the structure, over which folds and Hopf "
        "points of the branches are continued between its least and its largest value: borders",
    )
    share_curves: bool = Field(
        default=True,
        description="whether silent curves of a design serve the next one, if some of their "
        "motions, balanced there, show that they may: for models of many coordinates",
    )
    neighbours: bool = Field(
        default=True,
        description="whether a design without a stable cycle of its own is tried from those of "
        "its neighbours in the study",
    )
    undecided_in_time: bool = Field(
        default=True,
        description="whether a design that cycles leave open is run in time from the loudest of "
        "them: its verdict where all modes are stable, its level where it squeals",
    )
    kick_along_mode: bool = Field(
        default=False,
        description="whether the least kick along the mode that starts squeal is looked for in "
        "time, where a design squeals if kicked: the worst of 8 phases, bisected",
    )
    radiating: Annotated[tuple[str, ...], Strict(False)] = Field(
        default=(),
        description="meshed components whose surfaces radiate: equivalent radiated power of cycles",
    )
    points: Annotated[tuple[NamedPoint, ...], Strict(False), AfterValidator(_distinct)] = Field(
        default=(), description="points of components whose velocities are told of every cycle"
    )
    friction: Literal["regularised", "smooth"] = Field(
        default="regularised",
        description="friction below the bound: straight (Coulomb with a corner) or tanh",
    )


class LimitCyclesDefinition(StudyDefinition):
    """A whole file of a study of limit cycles, on the basis of studies in time."""

    other_defaults: ClassVar[Mapping[str, Mapping[str, Any]]] = {"reduction": TRANSIENT_BASIS}

    limit_cycles: LimitCyclesSection = Field(
        default=LimitCyclesSection(),
        description="which limit cycles are looked for (limit_cycles and design)",
    )


DEFINITION = LimitCyclesDefinition
