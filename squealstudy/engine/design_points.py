"""Holds the design points of a plan as one array for each parameter, so that millions fit memory.

A point takes 8 bytes for each swept parameter and 16 bytes for its id. A `DesignPoint`, with its
dict of all parameters, takes more: it is made when it is asked for.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, overload

import numpy as np

from squealstudy.engine.keys import ID_TYPE, content_hash, point_ids
from squealstudy.models.parameter import ModelDefinition
from squealstudy.study.design import DesignPoint
from squealstudy.study.sampling import distinct_rows

POINTS_PER_BLOCK = 4096  # number of points that are made at once while iterating


@dataclass(frozen=True, eq=False)
class DesignValues:
    """Values of all parameters at `count` design points.

    Attributes
    ----------
    model : ModelDefinition
    options : mapping of str -> str or int
        A value of every option of the model.
    common : mapping of str -> float
        Value of every parameter at the first point, which all points have unless it is `varied`.
    varied : mapping of str -> ndarray (count,)
        Values of the parameters that may differ between points.
    count : int
        Number of design points.
    one_structure : bool
        Whether structural values do not divide the points into structures: in batches of small
        models each point is solved together with its structure.
    """

    model: ModelDefinition
    options: Mapping[str, str | int]
    common: Mapping[str, float]
    varied: Mapping[str, np.ndarray]
    count: int
    one_structure: bool = False

    @classmethod
    def of(
        cls,
        model: ModelDefinition,
        options: Mapping[str, str | int],
        columns: Mapping[str, float | np.ndarray],
        count: int,
    ) -> DesignValues:
        """Values of design points from `columns`, each a number or an array (count,)."""
        varied = {k: x for k, x in columns.items() if isinstance(x, np.ndarray)}
        first = {k: float(x[0] if isinstance(x, np.ndarray) else x) for k, x in columns.items()}
        return cls(model, options, first, varied, count)

    def column(self, name: str) -> np.ndarray:
        """Values (count,) of a parameter, not to be written to; KeyError where there is none."""
        if name in self.varied:
            return self.varied[name]
        return np.broadcast_to(self.common[name], self.count)

    def at(self, rows: np.ndarray | slice) -> DesignValues:
        """Values of the points at some rows."""
        varied = {name: x[rows] for name, x in self.varied.items()}
        count = len(range(*rows.indices(self.count)) if isinstance(rows, slice) else rows)
        return DesignValues(
            self.model, self.options, self.common, varied, count, self.one_structure
        )

    def values_of(self, number: int) -> dict[str, float]:
        """Values of all parameters at one of the points."""
        return {**self.common, **{name: float(x[number]) for name, x in self.varied.items()}}

    @cached_property
    def structure_index(self) -> np.ndarray:
        """Number (count,) int32 of the structure of each point, in order of first appearance."""
        if self.one_structure:
            return np.zeros(self.count, dtype=np.int32)
        names = [p.name for p in self.model.parameters if p.structural and p.name in self.varied]
        return distinct_rows([self.varied[name] for name in names], self.count)


class Names(Protocol):
    """Ids of design points, and keys of the prepared models of their structures."""

    @property
    def structures(self) -> tuple[str, ...]:
        """Keys of prepared models, each once."""
        ...

    @property
    def structure_index(self) -> np.ndarray:
        """Place (n,) int32 of each point's key among them."""
        ...

    @property
    def ids(self) -> np.ndarray:
        """Id (n,) of each point, 16 bytes."""
        ...

    def name(self, number: int) -> str:
        """Id of one of the points, without the others'."""
        ...


@dataclass(frozen=True, eq=False)
class GivenNames:
    """Ids and keys that are stored as arrays, as in a task for a worker."""

    structures: tuple[str, ...]
    structure_index: np.ndarray
    ids: np.ndarray

    def name(self, number: int) -> str:
        """Id of one of the points."""
        return str(self.ids[number], "ascii")


@dataclass(frozen=True, eq=False)
class PartNames:
    """Ids and keys of the points at some `rows` of the `whole` design."""

    whole: Names
    rows: np.ndarray

    @property
    def structures(self) -> tuple[str, ...]:
        """Keys of prepared models of the whole design."""
        return self.whole.structures

    @property
    def structure_index(self) -> np.ndarray:
        """Place (n,) int32 of each point's key among them."""
        return self.whole.structure_index[self.rows]

    @property
    def ids(self) -> np.ndarray:
        """Id (n,) of each point, 16 bytes."""
        return self.whole.ids[self.rows]

    def name(self, number: int) -> str:
        """Id of one of the points, without the others'."""
        return self.whole.name(int(self.rows[number]))


class PlannedNames:
    """Ids and keys of all points of a plan, computed when they are asked for.

    If a random design draws the same values twice, the later point gets another id, so that it is
    solved and counted separately.

    Parameters
    ----------
    values : DesignValues
    key_of : callable
        Takes a design point without id and key, returns the key of its prepared model.
    hash_of : callable
        Takes the key of a prepared model, returns a hash of all that decides results at its points
        apart from their values.
    """

    def __init__(
        self,
        values: DesignValues,
        key_of: Callable[[DesignPoint], str],
        hash_of: Callable[[str], str],
    ) -> None:
        self._values, self._key_of, self._hash_of = values, key_of, hash_of

    @cached_property
    def _keys(self) -> list[str]:
        """Key of each structure; several structures of different values may have one key."""
        _, first = np.unique(self._values.structure_index, return_index=True)
        without_names = (DesignPoints(self._values, _NO_NAMES).without_names(int(i)) for i in first)
        return [self._key_of(point) for point in without_names]

    @cached_property
    def structures(self) -> tuple[str, ...]:
        """Keys of prepared models in order of first appearance."""
        return tuple(dict.fromkeys(self._keys))

    @cached_property
    def structure_index(self) -> np.ndarray:
        """Place (n,) int32 of each point's key among them."""
        if len(self.structures) == len(self._keys):
            return self._values.structure_index
        index = np.array([self.structures.index(key) for key in self._keys], dtype=np.int32)
        return index[self._values.structure_index]

    @cached_property
    def _hashes(self) -> list[str]:
        return [self._hash_of(key) for key in self.structures]

    @cached_property
    def _values_for_ids(self) -> DesignValues:
        """The values that decide ids: without parameters of laws that are not in use."""
        names = DesignPoints(self._values, _NO_NAMES).without_names(0).own_values
        v = self._values
        varied = {k: x for k, x in v.varied.items() if k in names}
        return DesignValues(v.model, v.options, names, varied, v.count, v.one_structure)

    @cached_property
    def _repeated_draws(self) -> dict[int, int]:
        """Points with the values of an earlier point, and the number of that draw, from 2 on."""
        columns = [x.view(np.uint64) for x in self._values_for_ids.varied.values()]
        columns.append(self.structure_index.astype(np.uint64))
        hashes = np.zeros(self._values.count, dtype=np.uint64)
        # points with different hashes differ; the columns of points with equal hashes are compared
        for column in columns:
            hashes = (hashes ^ column) * np.uint64(0x9E3779B97F4A7C15)
            hashes ^= hashes >> np.uint64(29)
        order = np.argsort(hashes, kind="stable")
        equal = np.flatnonzero(hashes[order[1:]] == hashes[order[:-1]])
        draws: Counter[tuple[int, ...]] = Counter()
        repeated = {}
        for i in np.unique(order[np.concatenate([equal, equal + 1])]).tolist():
            values = tuple(int(column[i]) for column in columns)
            draws[values] += 1
            if draws[values] > 1:
                repeated[i] = draws[values]
        return repeated

    @cached_property
    def ids(self) -> np.ndarray:
        """Id (n,) of each point, 16 bytes."""
        ids = np.empty(self._values.count, dtype=ID_TYPE)
        for number, rows in _groups(self.structure_index, len(self.structures)):
            part = self._values_for_ids.at(rows)
            structure_hash = self._hashes[number]
            ids[rows] = point_ids(structure_hash, part.common, part.varied, part.count)
        for i, draw in self._repeated_draws.items():
            ids[i] = self._drawn_again(str(ids[i], "ascii"), draw)
        return ids

    def name(self, number: int) -> str:
        """Id of one of the points, without computing those of the others."""
        if "ids" in self.__dict__:
            return str(self.ids[number], "ascii")
        part = self._values_for_ids.at(slice(number, number + 1))
        structure_hash = self._hashes[self.structure_index[number]]
        name = str(point_ids(structure_hash, part.common, part.varied, 1)[0], "ascii")
        draw = self._repeated_draws.get(number, 1)
        return name if draw == 1 else self._drawn_again(name, draw)

    @staticmethod
    def _drawn_again(name: str, draw: int) -> str:
        """Id of a point whose values are drawn again, from the id of the first such point."""
        return content_hash([name, draw])


def _groups(index: np.ndarray, count: int) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each number below `count` that an index (n,) contains, with its rows, ascending."""
    order = np.argsort(index, kind="stable")
    ends = np.searchsorted(index[order], np.arange(count + 1))
    for number, (start, end) in enumerate(itertools.pairwise(ends.tolist())):
        if end > start:
            yield number, order[start:end]


_NO_NAMES = GivenNames((), np.zeros(0, dtype=np.int32), np.zeros(0, dtype=ID_TYPE))


class DesignPoints(Sequence[DesignPoint]):
    """A sequence of design points that makes each `DesignPoint` when it is asked for.

    Parameters
    ----------
    values : DesignValues
    names : Names
    """

    def __init__(self, values: DesignValues, names: Names) -> None:
        self._values, self._names = values, names

    @property
    def ids(self) -> np.ndarray:
        """Id (n,) of each point, 16 bytes; made when first asked for."""
        return self._names.ids

    @property
    def structures(self) -> tuple[str, ...]:
        """Keys of the prepared models, for a whole plan in order of first appearance."""
        return self._names.structures

    @property
    def structure_index(self) -> np.ndarray:
        """Place (n,) int32 of each point's key among `structures`."""
        return self._names.structure_index

    def column(self, name: str) -> np.ndarray:
        """Values (n,) of a parameter, not to be written to; KeyError where there is none."""
        return self._values.column(name)

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that may differ between points."""
        return tuple(self._values.varied)

    @property
    def model(self) -> ModelDefinition:
        """Model of all points."""
        return self._values.model

    @property
    def options(self) -> Mapping[str, str | int]:
        """Options of the model."""
        return self._values.options

    @property
    def columns(self) -> dict[str, float | np.ndarray]:
        """Every parameter's values (n,); one number where it is the same at all points."""
        return {**self._values.common, **self._values.varied}

    def of_structures(self) -> Iterator[tuple[str, np.ndarray]]:
        """Key of each structure in use and the rows of its points, ascending."""
        for number, rows in _groups(self.structure_index, len(self.structures)):
            yield self.structures[number], rows

    def at(self, rows: np.ndarray | slice) -> DesignPoints:
        """Some of the points, with their ids and keys."""
        chosen = np.arange(len(self))[rows] if isinstance(rows, slice) else np.asarray(rows, int)
        names = self._names
        if isinstance(names, PartNames):
            return DesignPoints(self._values.at(chosen), PartNames(names.whole, names.rows[chosen]))
        return DesignPoints(self._values.at(chosen), PartNames(names, chosen))

    def __reduce__(self) -> tuple[Any, ...]:
        """Give another process the points with their ids and keys, not the plan."""
        used, index = np.unique(self.structure_index, return_inverse=True)
        keys = tuple(self.structures[i] for i in used)
        return DesignPoints, (self._values, GivenNames(keys, index.astype(np.int32), self.ids))

    def without_names(self, number: int) -> DesignPoint:
        """A point with neither id nor structure."""
        v = self._values
        return DesignPoint(v.model, v.options, v.values_of(number))

    def __len__(self) -> int:
        return self._values.count

    @overload
    def __getitem__(self, index: int) -> DesignPoint: ...
    @overload
    def __getitem__(self, index: slice) -> DesignPoints: ...
    def __getitem__(self, index: int | slice) -> DesignPoint | DesignPoints:
        if isinstance(index, slice):
            return self.at(index)
        number = range(len(self))[index]  # IndexError beyond the ends
        v = self._values
        return DesignPoint(
            model=v.model,
            options=v.options,
            values=v.values_of(number),
            point_id=self._names.name(number),
            structure=self.structures[self.structure_index[number]],
        )

    def __iter__(self) -> Iterator[DesignPoint]:
        v, keys = self._values, self.structures
        for start in range(0, len(self), POINTS_PER_BLOCK):
            rows = slice(start, start + POINTS_PER_BLOCK)
            names = self.ids[rows].tolist()
            structure_numbers = self.structure_index[rows].tolist()
            columns = [x[rows].tolist() for x in v.varied.values()]
            for i, (name, number) in enumerate(zip(names, structure_numbers, strict=True)):
                varied_values = {k: x[i] for k, x in zip(v.varied, columns, strict=True)}
                values = {**v.common, **varied_values}
                yield DesignPoint(v.model, v.options, values, name.decode(), keys[number])
