"""Errors of squealstudy: every layer may raise them, and `cli` prints each as one line."""

from __future__ import annotations

import os
import traceback
from pathlib import Path

DEBUG = "SQUEALSTUDY_DEBUG"  # environment variable: errors are shown with a traceback
PACKAGE = Path(__file__).parent


class SquealstudyError(Exception):
    """Base of all errors that a user can cause or meet; its text is the message to show.

    ``exit_code`` is the exit code of the command: 2 where the input is at fault, else 1.
    """

    exit_code = 2

    def _render_traceback_(self) -> list[str]:
        """Lines for a notebook: the calling line and the message, or with DEBUG the traceback."""
        if os.environ.get(DEBUG):
            return traceback.format_exception(self)
        caller = None
        for frame in traceback.extract_tb(self.__traceback__):
            if Path(frame.filename).is_relative_to(PACKAGE):
                break
            caller = frame
        line = [] if caller is None else [f"line {caller.lineno}: {caller.line}"]
        return [*line, f"{type(self).__name__}: {self}"]


class MachineError(SquealstudyError):
    """A refusal by the machine: a full disk, a permission, memory, a process that was killed.

    The input is not at fault: the same works where the machine allows it.
    """

    exit_code = 1


class StudyFileError(SquealstudyError):
    """A study file that cannot be used.

    Parameters
    ----------
    message : str
        What is wrong, and what was expected.
    path : Path or None
        The study file.
    key : str
        The key at fault, dotted as in the file (``sweep[2].num``); empty for the whole file.
    line : int or None
        Line of that key, counted from 1; None where it is not known.
    """

    def __init__(
        self, message: str, path: Path | None = None, key: str = "", line: int | None = None
    ) -> None:
        message, key = printable(message), printable(key)
        self.message, self.path, self.key, self.line = message, path, key, line
        where = "" if path is None else str(path)
        if line is not None:
            where += f", line {line}"
        if key:
            where += f", key '{key}'" if where else f"key '{key}'"
        super().__init__(f"{where}: {message}" if where else message)


def printable(text: str) -> str:
    """Text of a file, with control characters as escapes."""
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


class ParameterError(SquealstudyError):
    """A parameter name or value that the model does not know or cannot take.

    ``key`` is the parameter's name as the user wrote it.
    """

    def __init__(self, key: str, message: str) -> None:
        self.key, self.message = key, message
        super().__init__(f"parameter '{key}': {message}")


class ExtensionError(SquealstudyError):
    """A file outside the package that cannot be used: it is missing, fails, or has changed."""

    def __init__(self, path: Path, message: str) -> None:
        self.path, self.message = path, message
        super().__init__(f"{path}: {message}")


class ModelError(SquealstudyError):
    """An assembly, component or interface whose arrays contradict each other."""


class ResultsError(SquealstudyError):
    """A results directory that is missing, damaged, unfinished or of another study."""


class UnknownColumnError(ResultsError, KeyError):
    """A column that a table of results does not have."""

    def __str__(self) -> str:  # that of KeyError puts the sentence in quotes
        return Exception.__str__(self)


class UnknownNameError(ResultsError, AttributeError):
    """A table, method or plot that results do not have."""


class ContradictionError(ResultsError):
    """Results whose files contradict each other, by damage or by an error of this program."""

    exit_code = 1


class ConvergenceError(SquealstudyError):
    """An iteration that did not reach its tolerance.

    ``status`` is a short word for tables (``not_converged``, ``lift_off``, ...).
    """

    def __init__(self, status: str, message: str) -> None:
        self.status = status
        super().__init__(message)
