"""Base of all tables of model files: strict types, names, vectors, and errors at a key."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, Strict

from squealstudy.errors import ModelError

KeyPath = tuple[str | int, ...]  # keys of the file, and 0-based positions in lists


class Table(BaseModel):
    """A table of the file: unknown keys are errors, and nothing is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Vector = Annotated[tuple[float, float, float], Strict(False)]
Texts = Annotated[tuple[str, ...], Strict(False)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


class PlacedError(ModelError):
    """An error at a key of the model file.

    Attributes
    ----------
    keys : tuple of str and int
        The key path.
    message : str
    word : str
        The wrong word, for a proposal of a similar one; empty without.
    known : tuple of str
        The words that are possible.
    """

    def __init__(
        self, keys: KeyPath, message: str, word: str = "", expected_words: tuple[str, ...] = ()
    ) -> None:
        self.keys, self.message, self.word, self.known = keys, message, word, expected_words
        super().__init__(message)
