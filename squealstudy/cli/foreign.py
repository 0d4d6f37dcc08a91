"""Commands on results that may come from others: contradictions in them are told in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any

import typer

from squealstudy.errors import ContradictionError, SquealstudyError
from squealstudy.machine.processes import InterruptedRun

PASSED = (SquealstudyError, OSError, MemoryError, InterruptedRun, typer.Exit, typer.BadParameter)
RESULT_ARGUMENTS = ("results", "frequency", "other")  # arguments that are results directories


def on_results(command: Callable[..., None]) -> Callable[..., None]:
    """Decorator of a command that reads results: unexpected errors become ContradictionError.

    Facts and columns of results are checked when they are opened, but not every value.
    """

    @wraps(command)
    def told(*arguments: Any, **options: Any) -> None:
        try:
            command(*arguments, **options)
        except PASSED:
            raise
        except Exception as error:
            arguments_by_name = signature(command).bind(*arguments, **options).arguments
            arguments_given = [arguments_by_name.get(name, []) for name in RESULT_ARGUMENTS]
            directories = [
                path
                for entry in arguments_given
                for path in (entry if isinstance(entry, list) else [entry])
            ]
            raise ContradictionError(
                f"{', '.join(map(str, directories))}: what the files say does not fit together "
                f"({type(error).__name__}: {error}): they are not as a run of this version writes "
                "them, or this is a mistake of ours; run the study again. SQUEALSTUDY_DEBUG=1 "
                "shows where"
            ) from error

    return told
