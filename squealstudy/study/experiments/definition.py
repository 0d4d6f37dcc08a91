"""Files of experiments: which files are, and what they say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from squealstudy.errors import StudyFileError
from squealstudy.study.definition import Study, parse_study
from squealstudy.study.experiments.base import BaseStudy, read_base
from squealstudy.study.experiments.sections import (
    MethodStabilityDefinition,
    WorkPrecisionDefinition,
)
from squealstudy.study.kinds import EXPERIMENTS, KINDS
from squealstudy.study.parameters import did_you_mean
from squealstudy.study.source import SourceText, parse_toml, read_text, shown, validate
from squealstudy.study.toml_lines import KeyPath

WORK_PRECISION, METHOD_STABILITY = EXPERIMENTS


@dataclass(frozen=True)
class File:
    """An experiment's file."""

    source: SourceText

    def error(self, keys: KeyPath, message: str) -> StudyFileError:
        """The error to raise about a key of the file."""
        return self.source.error(keys, message)


@dataclass(frozen=True)
class PrecisionFile(File):
    """A work-precision study, checked, with the study it is made on."""

    definition: WorkPrecisionDefinition
    base: BaseStudy

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and model: whose results directory it is."""
        return self.definition.study.name, WORK_PRECISION, self.base.study.model.name


@dataclass(frozen=True)
class StabilityFile(File):
    """A method-stability study, checked but for its case and knobs."""

    definition: MethodStabilityDefinition

    @property
    def owner(self) -> tuple[str, str, str]:
        """Name, kind and case: whose results directory it is."""
        study = self.definition.study
        return study.name, METHOD_STABILITY, self.definition.method_stability.case


Experiment = PrecisionFile | StabilityFile


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
    if _kind(tables) == METHOD_STABILITY:
        return StabilityFile(source, validate(MethodStabilityDefinition, source, tables))
    definition = validate(WorkPrecisionDefinition, source, tables)
    keys = ("work_precision", "base")
    path = source.path.parent / definition.work_precision.base
    if not path.is_file():
        raise source.error(keys, f"there is no study file {path}")
    return PrecisionFile(source, definition, read_base(path))
