"""A design point of a study: values of all parameters, its id and the key of its structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from squealstudy.models.model_point import ModelPoint


@dataclass(frozen=True)
class DesignPoint(ModelPoint):
    """All parameter values of one design point, with the keys of its row and its model.

    Attributes
    ----------
    point_id : str
        Id of its row; empty for a point that is in no table.
    structure : str
        Key of its prepared model in the cache; empty if it is not known.
    """

    point_id: str = ""
    structure: str = ""

    def with_values(self, values: Mapping[str, float]) -> DesignPoint:
        """A point with other values, without id. It keeps its structure if that is the same.

        Parameters that follow a table get the value of the table where what it is over has changed.
        """
        values = self.model.followed(values, self.values)
        other = replace(self, values=values, point_id="")
        same = all(
            values[p.name] == self.values[p.name] for p in self.model.parameters if p.structural
        )
        return other if same else replace(other, structure="")
