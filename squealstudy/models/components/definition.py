"""A model that a file describes, as a study sees it."""

from __future__ import annotations

from dataclasses import dataclass, field

from squealstudy.models.parameter import ModelDefinition

NAME = "components"
DESCRIPTION = (
    "a brake of one's own: meshes or matrices, contact, layers and springs of a model file"
)


@dataclass(frozen=True)
class FileDefinition(ModelDefinition):
    """A model file that was read and checked, with all files that it names.

    Attributes
    ----------
    path : str
        Path of the model file.
    files : tuple of str
        Hashes of the model file and of every file that it reads, included files too.
    own_of_law : frozenset of str
        Parameters of the friction law for which contacts have values of their own.
    """

    path: str = ""
    files: tuple[str, ...] = ()
    own_of_law: frozenset[str] = field(default=frozenset(), kw_only=True)

    @property
    def meshed(self) -> bool:
        """Always true: it is a finite-element model."""
        return True
