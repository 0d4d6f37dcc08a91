"""The model of a study of a family of matrices: its terms, parameters and files."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

import scipy.sparse as sp

from squealstudy.errors import ModelError, StudyFileError
from squealstudy.models.matrices.expression import (
    RESERVED,
    Expression,
    ExpressionError,
)
from squealstudy.models.matrices.family import (
    NAME,
    ORDERS,
    REQUIRED,
    FamilyDefinition,
    FamilyTerm,
    MatrixFamily,
    TermSource,
    family_definition,
)
from squealstudy.models.matrices.files import read_term_matrix
from squealstudy.models.matrices.labelled import LabelledMatrix, together
from squealstudy.study.kinds import model_kind
from squealstudy.study.sections import ModelSection, StudyDefinition, TermSection
from squealstudy.study.source import SourceText
from squealstudy.study.toml_text import KeyPath
from squealstudy.wording import did_you_mean

DATA_VARIABLE = "SQUEALSTUDY_DATA"  # environment variable: replaces the folder that a study names
CONTACT_TABLES = ("contact", "spring", "damper", "load")  # tables of model files with [[term]] only
CONTACT_ADVICE = (
    'matrices with [[contact]] are a model of a file with [[term]], named by [model] file = "..."'
)
# columns of tables, which parameters must not be named like
RESERVED_NAMES = {"point_id", "status", "message", "wall_s", "method", "mode", "track", "track_mac"}
RESERVED_NAMES |= {"track_ambiguous", "frequency_hz", "growth_rate", "damping_ratio", "unstable"}
RESERVED_NAMES |= {
    "overdamped",
    "residual",
    "error_estimate",
    "n_modes",
    "n_unstable",
    "n_overdamped",
}
RESERVED_NAMES |= {
    "error_rung",
    "error_reduction",
    "stability",
    "n_unstable_low",
    "n_unstable_high",
}
RESERVED_NAMES |= {"n_unstable_below", "n_unstable_above", "growth_outside", "frequency_outside_hz"}
RESERVED_NAMES |= {"working_point_residual", "open_share", "onset", "line", "direction"}
RESERVED_NAMES |= {"contact_pressure_min", "contact_pressure_max"}
RESERVED_NAMES |= {"bracket_low", "bracket_high", "evaluations", "point_before", "point_after"}
RESERVED_NAMES |= {
    "reference_frequency_error",
    "reference_damping_error",
    "valid",
    "invalid_reason",
}


def family_of(definition: StudyDefinition, source: SourceText) -> FamilyDefinition:
    """The family of matrices that a study describes; opens no file.

    Raises
    ------
    StudyFileError
        The kind of study needs contact; there is no term of M or of K; a coefficient is no
        expression; a parameter has no value under [parameters], or no coefficient uses it; [model]
        has an option of another model.
    """
    section = definition.model
    kind = model_kind(definition.study.kind)
    if kind.needs_contact:
        raise source.error(
            ("study", "kind"),
            f"a model '{NAME}' has neither contact nor components: expected 'complex_modes', "
            f"got '{kind.name}'; {CONTACT_ADVICE}",
        )
    for name in section.options:
        hint = did_you_mean(name, ("term", "folder")) or "; its options are term, folder"
        if name in CONTACT_TABLES:
            hint = f": {CONTACT_ADVICE}"
        raise source.error(("model", name), f"unknown key of model '{NAME}'{hint}")
    _check_letters(section, source)
    expressions = [_expression(term, i, source) for i, term in enumerate(section.term)]
    folder = data_folder(section, source.path)
    sources = tuple(
        TermSource(t.matrix, folder / t.file, t.variable, e.text)
        for t, e in zip(section.term, expressions, strict=True)
    )
    return family_definition(sources, _nominal(expressions, definition.parameters, source))


def data_folder(section: ModelSection, study: Path) -> Path:
    """The folder of the matrices: that of the study file, or the one that it names.

    The environment variable SQUEALSTUDY_DATA, if set, replaces a folder that the study names.
    """
    if section.folder is None:
        return study.parent
    return Path(os.environ.get(DATA_VARIABLE) or study.parent / section.folder)


def file_digests(model: FamilyDefinition, source: SourceText) -> list[str]:
    """SHA-256 of each term's file; StudyFileError where one does not exist."""
    digests: dict[Path, str] = {}
    for i, term in enumerate(model.sources):
        if not term.path.is_file():
            raise _absent(term, i, source)
        if term.path not in digests:
            with term.path.open("rb") as handle:
                digests[term.path] = hashlib.file_digest(handle, "sha256").hexdigest()
    return [digests[term.path] for term in model.sources]


def read_family(model: FamilyDefinition, source: SourceText) -> MatrixFamily:
    """Read all matrices of a family from their files.

    Raises
    ------
    StudyFileError
        The file of a term cannot be used, or its matrix has another size than the first one.
    """
    term_matrices: list[sp.csr_matrix | LabelledMatrix] = []
    for i, term in enumerate(model.sources):
        keys: KeyPath = ("model", "term", i, "file" if term.variable is None else "variable")
        if not term.path.is_file():
            raise _absent(term, i, source)
        try:
            term_matrices.append(read_term_matrix(term.path, term.variable))
        except ModelError as error:
            raise source.error(keys, str(error)) from error
    labelled = [matrix for matrix in term_matrices if isinstance(matrix, LabelledMatrix)]
    placed = iter(together(labelled) if labelled else [])
    matrices = [next(placed) if isinstance(m, LabelledMatrix) else m for m in term_matrices]
    for i, (term, matrix) in enumerate(zip(model.sources, matrices, strict=True)):
        if matrix.shape != matrices[0].shape:
            n, first = matrix.shape[0], matrices[0].shape[0]
            message = f"{term.path} is {n} x {n}, the first term's matrix {first} x {first}"
            raise source.error(("model", "term", i, "file"), message)
    return MatrixFamily(
        tuple(
            FamilyTerm(ORDERS[term.matrix], matrix, Expression(term.coefficient))
            for term, matrix in zip(model.sources, matrices, strict=True)
        )
    )


def _check_letters(section: ModelSection, source: SourceText) -> None:
    for letter in REQUIRED:
        if all(term.matrix != letter for term in section.term):
            raise source.error(
                ("model",), f"model '{NAME}' needs a [[model.term]] with matrix = \"{letter}\""
            )


def _expression(term: TermSection, index: int, source: SourceText) -> Expression:
    """The expression of a term's coefficient; StudyFileError where it is none."""
    keys: KeyPath = ("model", "term", index, "coefficient")
    try:
        expression = Expression(term.coefficient)
    except ExpressionError as error:
        raise source.error(keys, str(error)) from None
    for name in expression.names:
        if name in RESERVED_NAMES:
            raise source.error(keys, f"'{name}' is a column of the tables: choose another name")
    return expression


def _nominal(
    expressions: list[Expression], values: Mapping[str, float], source: SourceText
) -> dict[str, float]:
    """Value of every parameter in the coefficients; StudyFileError about others in the study."""
    names = {name: i for i, e in reversed(list(enumerate(expressions))) for name in e.names}
    unused = [name for name in values if name not in names]
    for name, index in sorted(names.items(), key=lambda item: item[1]):
        if name not in values:
            hint = did_you_mean(name, unused) or f"; give {name} = ... there"
            raise source.error(
                ("model", "term", index, "coefficient"),
                f"'{name}' has no value under [parameters]{hint}",
            )
    for name in unused:
        what = "a constant or function" if name in RESERVED else "in none of the coefficients"
        listed = f"; they use {', '.join(names)}" if names else "; they use no parameter"
        message = f"'{name}' is {what}{did_you_mean(name, names) or listed}"
        raise source.error(("parameters", name), message)
    return {name: float(values[name]) for name in sorted(names)}


def _absent(term: TermSource, index: int, source: SourceText) -> StudyFileError:
    """Error for a file of a matrix that does not exist."""
    folder = term.path.parent
    what = f"no file {term.path.name} in {folder}" if folder.is_dir() else f"no folder {folder}"
    return source.error(
        ("model", "term", index, "file"),
        f'there is {what}; [model] folder = "..." names another folder, and the environment '
        f"variable {DATA_VARIABLE} replaces the one named there",
    )
