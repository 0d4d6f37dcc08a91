"""Results of others in commands: what contradicts itself is a sentence, as all else is."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import Any

import typer

from squealstudy.errors import ContradictionError, SquealstudyError
from squealstudy.machine.processes import InterruptedRun

PASSED = (SquealstudyError, OSError, MemoryError, InterruptedRun, typer.Exit, typer.BadParameter)


def on_results(command: Callable[..., None]) -> Callable[..., None]:
    """A command that reads results: facts and columns are checked, but not every value of them."""

    @wraps(command)
    def told(*arguments: Any, **options: Any) -> None:
        try:
            command(*arguments, **options)
        except PASSED:
            raise
        except Exception as error:
            arguments_by_name = signature(command).bind(*arguments, **options).arguments
            names = ("results", "frequency", "time")
            results_given = [arguments_by_name[name] for name in names if name in arguments_by_name]
            listed = [
                renderable
                for part in results_given
                for renderable in (part if isinstance(part, list) else [part])
            ]
            raise ContradictionError(
                f"{', '.join(map(str, listed))}: what the files say does not fit together "
                f"({type(error).__name__}: {error}): they are not as a run of this version writes "
                "them, or this is a mistake of ours; run the study again. SQUEALSTUDY_DEBUG=1 "
                "shows where"
            ) from error

    return told
