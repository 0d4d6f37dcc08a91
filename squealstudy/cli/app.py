"""The `squealstudy` command: its subcommands, and how errors and signals end it."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import platform
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

from squealstudy import faults
from squealstudy.cli.model_commands import inspect, models, warmup
from squealstudy.cli.options import DONE, FAULT, USAGE_ERROR
from squealstudy.cli.result_commands import (
    columns,
    compare,
    explore,
    plot,
    rank,
    report,
    robust,
    shape,
)
from squealstudy.cli.study_commands import check, examples, export, new, run, schema, sensitivity
from squealstudy.errors import DEBUG, SquealstudyError
from squealstudy.machine.processes import InterruptedRun, cut_lifeline, interruptible
from squealstudy.screen import plain

NAME = "squealstudy"
UsageError: type[Any] = typer.BadParameter.mro()[1]  # click's, of which typer exports no name

app = typer.Typer(
    help="Which modes of a brake squeal, why, and which design change silences them.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


LIBRARIES = ("numpy", "scipy", "numba")  # libraries whose versions a report of an error needs


def _version(is_requested: bool) -> None:
    """Print versions of squealstudy, Python and libraries, and end."""
    if not is_requested:
        return
    from importlib.metadata import version

    from squealstudy import __version__, screen

    parts = [f"{NAME} {__version__}", f"Python {platform.python_version()}"]
    parts += [f"{name} {version(name)}" for name in LIBRARIES]
    screen.show(", ".join([*parts, f"{platform.system()} {platform.machine()}"]), unbroken=True)
    raise typer.Exit(DONE)


@app.callback()
def load_extensions(
    extension: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="File of Python with a law, a model, a kind or a plot of your own, executed "
            "first; a study names its own. Before the command; may be repeated.",
        ),
    ] = None,
    version: Annotated[  # noqa: ARG001 - its callback ends the program
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print versions, and end."
        ),
    ] = False,
) -> None:
    """Which modes of a brake squeal, why, and which design change silences them."""
    if extension:
        from squealstudy.extensions import load_extension

        for path in extension:
            load_extension(path)


def first_sentence(text: str) -> str:
    """The first sentence of a text, on one line."""
    return re.split(r"(?<=\.)\s", " ".join(text.split()), maxsplit=1)[0]


COMMANDS: tuple[Callable[..., None], ...] = (
    *(run, check, rank, robust, sensitivity, plot, explore, shape, report),
    *(columns, compare, inspect, export, warmup, models, examples, new, schema),
)
for command in COMMANDS:
    app.command(short_help=first_sentence(command.__doc__ or ""))(command)


def main() -> None:
    """Entry point: any error is one message on stderr, with an exit code of its kind."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(
            stream, io.TextIOWrapper
        ):  # a terminal may not be able to show all characters
            stream.reconfigure(errors="backslashreplace")
    with warnings_told():
        log, lines = logging.getLogger(NAME), logging.StreamHandler()  # to stderr
        log.addHandler(lines)
        log.setLevel(logging.INFO)
        code = _outcome(sys.argv[1:] or ["--help"])
        log.removeHandler(lines)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except AttributeError:  # closed from the beginning
            continue
        except OSError:  # already told: Python would try again at its end, and complain
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    raise SystemExit(code)


@contextlib.contextmanager
def warnings_told() -> Iterator[None]:
    """Write warnings of libraries to stderr, one line each and without control characters."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: _tell(f"warning: {message}")
        yield


def _outcome(arguments: list[str]) -> int:
    """Run a command line; returns its exit code, and tells errors on stderr."""
    context = None
    try:
        with (
            interruptible(),
            faults.told(),
            get_command(app).make_context(NAME, arguments) as context,
        ):
            context.command.invoke(context)
    except typer.Exit as error:
        return error.exit_code
    except UsageError as error:
        where = error.ctx.command_path if error.ctx else NAME
        _tell(f"{NAME}: {error.format_message()} ({where} --help says what is expected)")
        return USAGE_ERROR
    except BrokenPipeError:  # a reader such as `head` has gone
        return DONE
    except InterruptedRun as signal:
        command = context.invoked_subcommand if context else None
        goes_on = "; the same command goes on where it was" if command == run.__name__ else ""
        _tell(f"{NAME}: interrupted{goes_on}")
        return signal.exit_code
    except Exception as error:
        if os.environ.get(DEBUG) and getattr(error, "exit_code", FAULT) == FAULT:
            raise
        if isinstance(error, SquealstudyError):
            _tell(f"{NAME}: {error}")
            return error.exit_code
        what = f"internal error, {type(error).__name__}: {error}"
        _tell(f"{NAME}: {what}; {DEBUG}=1 shows where")
        return FAULT
    finally:
        cut_lifeline()  # else Python would wait at its end for workers that nobody needs
    return DONE


def _tell(text: str) -> None:
    """Write a line to stderr, where there is one."""
    with contextlib.suppress(AttributeError, OSError):
        sys.stderr.write(plain(text) + "\n")
