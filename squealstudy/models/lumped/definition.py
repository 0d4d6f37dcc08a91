"""The definition of a lumped model from a file."""

from __future__ import annotations

from dataclasses import dataclass

from squealstudy.models.components.definition import FileDefinition

NAME = "lumped"
TABLES_OF_FILE = ("mass", "term")  # a lumped model's file has one of them
DESCRIPTION = (
    "point masses, or own matrices, with springs, dampers and contact points: a model file with "
    "[[mass]] or [[term]]"
)


@dataclass(frozen=True)
class LumpedDefinition(FileDefinition):
    """A lumped model file, read and checked."""

    @property
    def meshed(self) -> bool:
        """False: the model has no mesh, and is not reduced."""
        return False
