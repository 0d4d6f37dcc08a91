"""Models of the Python face: of the catalogue, or of a model file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import ParameterError, SquealstudyError, StudyFileError
from squealstudy.face import Study, resolved_study
from squealstudy.mechanics.model import Model as MechanicalModel
from squealstudy.models.catalogue import MODELS, model_names
from squealstudy.models.components.definition import DESCRIPTION as OF_A_FILE
from squealstudy.models.components.definition import NAME as OF_FILE
from squealstudy.models.components.definition import FileDefinition
from squealstudy.models.lumped.definition import DESCRIPTION as OF_LUMPED
from squealstudy.models.lumped.definition import NAME as LUMPED
from squealstudy.models.matrices.family import DESCRIPTION as OF_MATRICES
from squealstudy.models.matrices.family import NAME as MATRICES
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import toml_text
from squealstudy.wording import did_you_mean, shown

MODEL_FILE = ".toml"


@dataclass(frozen=True, repr=False)
class Model(MechanicalModel):
    """A model at one design point (`mechanics.model.Model`) that can make a study of itself.

    Examples
    --------
    >>> import squealstudy as sq
    >>> model = sq.model("hulten", friction=0.5)
    >>> model.with_(mass="2 kg")
    <Model 'hulten': friction = 0.5, mass = 2.0>
    >>> model.component_modes()["rigid"].tolist()
    [True, True]
    >>> model.study(band=(10.0, 1e3))
    <Study 'model': complex_modes of hulten, model.toml>
    """

    def study(self, name: str = "model", band: tuple[float, float] | None = None) -> Study:
        """The complex-mode study of this one design point.

        Parameters
        ----------
        name : str
            Name of the study and of its results directory.
        band : (low, high) or None
            Frequency band, Hz; by default that of study files.

        Raises
        ------
        ParameterError
            Where ``band`` is no band of frequency.
        """
        options = {option.name for option in self.definition.options}
        try:
            ends = [] if band is None else list(band)
        except TypeError:
            raise ParameterError("band", f"expected [low, high] in Hz, got {band!r}") from None
        tables = {
            "study": {"name": name, "kind": "complex_modes"},
            "model": self._named() | {k: v for k, v in self.given.items() if k in options},
            "parameters": {k: v for k, v in self.given.items() if k not in options},
            "modes": {"reference_points": 0} | ({} if band is None else {"band": ends}),
        }
        text = toml_text(tables)
        try:
            return resolved_study(SourceText(Path(f"{name}.toml"), text), tables, text)
        except StudyFileError as error:  # there is no such file
            if not error.key.startswith("modes.band"):
                raise
            raise ParameterError("band", error.message) from None

    def _named(self) -> dict[str, str]:
        """Keys with which a study file names the model."""
        if isinstance(self.definition, FileDefinition):
            return {"file": str(Path(self.definition.path).resolve())}
        return {"name": self.definition.name}


def model(name: str | os.PathLike[str], **values: Any) -> Model:
    """A model of the catalogue or of a file: ``model("disc_brake", mesh="coarse", friction=0.4)``.

    Parameters
    ----------
    name : str or path
        One of `list_models`, or the path of a model file, which ends in ``.toml``.
    **values
        Parameters in SI units or with a unit, ``pressure="12 bar"``, and options. Names with dots
        are given as ``**{"contact.lambda": 1e6}``.

    Raises
    ------
    SquealstudyError
        For an unknown model, a parameter that it does not have, or a value that it cannot take.

    Examples
    --------
    >>> import squealstudy as sq
    >>> sq.model("hulten", friction=0.5)
    <Model 'hulten': friction = 0.5>
    """
    try:
        name = os.fspath(name)
    except TypeError:
        text = "expected the name of a model or the path of a model file"
        raise SquealstudyError(f"{text}, got {shown(name)}") from None
    if name.endswith(MODEL_FILE):
        from squealstudy.study.model_files import read_model_file

        return Model(read_model_file(Path(name)), values)
    if name == MATRICES:
        raise SquealstudyError(f"model '{MATRICES}' is made of the files that its study names")
    if name in (OF_FILE, LUMPED):
        raise SquealstudyError(f"model '{name}' is what a model file describes: give its path")
    if name not in MODELS:
        raise SquealstudyError(
            f"unknown model '{name}', expected {', '.join(model_names())}"
            + did_you_mean(name, model_names())
        )
    return Model(MODELS[name], values)


def list_models() -> dict[str, str]:
    """Descriptions of the models by name.

    Examples
    --------
    >>> import squealstudy as sq
    >>> "hulten" in sq.list_models()
    True
    """
    named = {m.name: m.description for m in MODELS.values()}
    by_path = "its path in place of the name"
    files = {OF_FILE: f"{OF_A_FILE}: {by_path}", LUMPED: f"{OF_LUMPED}: {by_path}"}
    return named | {MATRICES: OF_MATRICES} | files
