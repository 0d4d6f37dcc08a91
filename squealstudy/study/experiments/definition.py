"""Files of experiments: which files are, and what they say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import Study, parse_study
from squealstudy.study.experiments.base import BaseStudy, read_base
from squealstudy.study.experiments.sections import WorkPrecisionDefinition
from squealstudy.study.kinds import KINDS
from squealstudy.study.parameters import did_you_mean
from squealstudy.study.results import EXPERIMENTS
from squealstudy.study.source import SourceText, parse_toml, read_text, shown, validate
from squealstudy.study.toml_lines import KeyPath

WORK_PRECISION = "work_precision"


@dataclass(frozen=True)
class Experiment:
    """An experiment's file, checked, with the study it is made on.

    Attributes
    ----------
    source : SourceText
    definition : WorkPrecisionDefinition
    base : BaseStudy
    """

    source: SourceText
    definition: WorkPrecisionDefinition
    base: BaseStudy

    @property
    def name(self) -> str:
        """Of the experiment and its results directory."""
        return self.definition.study.name

    @property
    def kind(self) -> str:
        """One of EXPERIMENTS."""
        return self.definition.study.kind

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """The error to raise about a key of the file."""
        return self.source.error(keys, message)


def load_any(path: Path) -> Study | Experiment:
    """Read and check a study file or an experiment's; StudyFileError whatever is wrong."""
    text = read_text(path)
    source = SourceText(path, text)
    tables = parse_toml(path, text)
    kind = _kind(tables)
    if isinstance(kind, str) and kind not in (*KINDS, *EXPERIMENTS):
        raise source.error(
            ("study", "kind"),
            f"expected one of {', '.join((*KINDS, *EXPERIMENTS))}, got {shown(kind)}"
            + did_you_mean(kind, (*KINDS, *EXPERIMENTS)),
        )
    return _experiment(source, tables) if kind in EXPERIMENTS else parse_study(text, path)


def _kind(tables: Mapping[str, Any]) -> object:
    study = tables.get("study")
    return study.get("kind") if isinstance(study, dict) else None


def _experiment(source: SourceText, tables: Mapping[str, Any]) -> Experiment:
    definition = validate(WorkPrecisionDefinition, source, tables)
    keys = ("work_precision", "base")
    path = source.path.parent / definition.work_precision.base
    if not path.is_file():
        raise source.error(keys, f"there is no study file {path}")
    return Experiment(source, definition, read_base(path))
