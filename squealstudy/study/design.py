"""A design point of a study: values of all parameters, and what they are kept under."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from squealstudy.models.model_point import ModelPoint


@dataclass(frozen=True)
class DesignPoint(ModelPoint):
    """All parameter values of one design point, and what its row and its model are kept under.

    Attributes
    ----------
    point_id : str
        Identity of its row; empty for a point that is in no table.
    structure : str
        Key of its prepared model in the cache; empty where none is known.
    """

    point_id: str = ""
    structure: str = ""

    def with_values(self, values: Mapping[str, float]) -> DesignPoint:
        """A point of other values: without id, without structure where that is another one.

        What follows a table follows it where what that is over has changed.
        """
        values = self.model.followed(values, self.values)
        other = replace(self, values=values, point_id="")
        same = all(
            values[p.name] == self.values[p.name] for p in self.model.parameters if p.structural
        )
        return other if same else replace(other, structure="")
