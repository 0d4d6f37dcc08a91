"""Base of all sections of a study file: strict types, and types of values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Strict

from squealstudy.wording import shown


def flatten(tables: object) -> object:
    """Tables with flat keys, as by `flat_keys`; anything else unchanged."""
    return flat_keys(tables) if isinstance(tables, dict) else tables


def flat_keys(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted keys, whether a file writes these in quotes or as nested tables.

    ValueError where a key is given twice, or a table is empty.
    """
    flat: dict[str, Any] = {}
    pending = [(str(k), v) for k, v in reversed([*tables.items()])]
    while pending:
        name, entry = pending.pop()
        if entry == {}:
            raise ValueError(f"'{name}' is an empty table, expected a value")
        if isinstance(entry, dict):
            pending.extend((f"{name}.{k}", v) for k, v in reversed(entry.items()))
        elif name in flat:
            raise ValueError(f"'{name}' is given twice")
        else:
            flat[name] = entry
    return flat


def _two(band: object) -> object:
    if not isinstance(band, list | tuple) or len(band) != 2:
        described = f"{len(band)} values" if isinstance(band, list) else shown(band)
        raise ValueError(f"expected two frequencies [low, high] in Hz, got {described}")
    return band


def _ascending(band: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= band[0] < band[1]:
        raise ValueError(
            f"expected [low, high] with 0 <= low < high, got [{band[0]:g}, {band[1]:g}]"
        )
    return band


FloatList = Annotated[tuple[float, ...], Strict(False)]
Band = Annotated[
    tuple[float, float], Strict(False), BeforeValidator(_two), AfterValidator(_ascending)
]
NumberTable = Annotated[dict[str, float], BeforeValidator(flatten)]
Changes = Annotated[dict[str, Any], BeforeValidator(flatten)]  # dotted keys of a study file


class Section(BaseModel):
    """A table of the file: unknown keys are errors, and nothing is converted silently."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class NamedSection(Section):
    """Section [study] of any kind: name, kind and description of the study."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]+$",
        max_length=100,
        description="name of the study and of its results directory: letters, digits, _ and -",
    )
    kind: str
    description: str = Field(default="", description="free text, copied to the results")
