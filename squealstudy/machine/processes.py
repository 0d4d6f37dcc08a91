"""Signals, and lifelines by which processes end together."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

SIGNALS = {signal.SIGINT, signal.SIGTERM}
# that of a terminal that closes, which Windows does not have
SIGNALS |= {getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name)}
SAFE_PATH = "PYTHONSAFEPATH"
SILENTLY = "ignore:resource_tracker:UserWarning"
SIGNAL_EXIT_CODE_OFFSET = 128  # exit code of a process that a signal ended, less its number
SIGNAL_RETRY_S = 0.01  # time after which a dropped signal is sent again

_pipes: list[tuple[Connection, Connection]] = []  # at most one


def is_running(process: int) -> bool:
    """Whether there is a process with this id."""
    return psutil.pid_exists(process)


class InterruptedRun(BaseException):
    """Raised by a signal in `interruptible`; `exit_code` is the one that shells expect."""

    def __init__(self, number: int) -> None:
        self.exit_code = SIGNAL_EXIT_CODE_OFFSET + number


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Raise InterruptedRun on Ctrl-C, SIGTERM and SIGHUP; a second signal ends the process.

    In a finaliser or a callback of garbage collection Python drops the exception, with a traceback
    on stderr. A signal that arrives there is sent again a moment later.
    """

    def interrupt(number: int, _frame: object) -> None:
        for each in handled:
            signal.signal(each, signal.SIG_DFL)
        raise InterruptedRun(number)

    def dropped(hook_arguments: sys.UnraisableHookArgs) -> None:
        if not isinstance(hook_arguments.exc_value, InterruptedRun):
            previous_hook(hook_arguments)
            return
        for each in handled:
            signal.signal(each, interrupt)
        number = hook_arguments.exc_value.exit_code - SIGNAL_EXIT_CODE_OFFSET
        threading.Timer(SIGNAL_RETRY_S, os.kill, (os.getpid(), number)).start()

    handled = [each for each in SIGNALS if signal.getsignal(each) != signal.SIG_IGN]  # by nohup
    before = {each: signal.signal(each, interrupt) for each in handled}
    previous_hook, sys.unraisablehook = sys.unraisablehook, dropped
    try:
        yield
    finally:
        sys.unraisablehook = previous_hook
        for each, handler in before.items():
            signal.signal(each, handler)


def lifeline() -> Connection:
    """The end of a pipe, for processes that are to end with this one (`end_with`).

    Nothing is ever written to it. The system closes the other end when this process ends.
    """
    from multiprocessing import Pipe

    if not _pipes:
        _pipes.append(Pipe(duplex=False))
    return _pipes[0][0]


def cut_lifeline() -> None:
    """End all processes that have the lifeline of this one; `lifeline` then makes a new one."""
    while _pipes:
        for end in _pipes.pop():
            end.close()


if hasattr(os, "register_at_fork"):  # a fork of this process would hold the pipe open
    os.register_at_fork(after_in_child=cut_lifeline)


def end_with(lifeline: Connection) -> None:
    """End this process when the one that made `lifeline` ends; from now on ignore signals."""
    _end_when(lambda: lifeline.poll(None))


def end_with_input() -> None:
    """End this process when its parent closes its standard input; from now on ignore signals."""
    _end_when(lambda: os.read(0, 1))


def _end_when(over: Callable[[], object]) -> None:
    """End this process at once when `over` returns."""
    for number in SIGNALS:  # a terminal or a scheduler sends them to all processes
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        with contextlib.suppress(OSError, EOFError):
            over()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _without_current_directory() -> Iterator[None]:
    """Keep processes that start within from importing modules of the current directory.

    It may belong to anybody.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


@contextlib.contextmanager
def starting_processes() -> Iterator[None]:
    """Start processes within that get no signals and do not import the main file.

    A main file may run a study when it is imported. Signals that arrive meanwhile wait until the
    end, since a half started process would print a traceback. The processes do not import modules
    of the current directory, which may belong to anybody.
    """
    from multiprocessing import get_context

    # the first lock starts the resource tracker, which unblocks signals, and removes what a killed
    # run leaves
    sys.warnoptions.append(SILENTLY)
    with _without_current_directory():
        get_context("spawn").Lock()
    sys.warnoptions.remove(SILENTLY)
    main = sys.modules["__main__"]
    masked = hasattr(signal, "pthread_sigmask")  # not on Windows
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS) if masked else ()
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        with _without_current_directory(), _signals_wait():
            yield
    finally:
        sys.modules["__main__"] = main
        if masked:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _signals_wait() -> Iterator[None]:
    """Raise signals at the end: Python also handles those that came to unmasked threads."""
    came: list[int] = []
    main = threading.current_thread() is threading.main_thread()  # no other may set handlers
    heeded = [each for each in SIGNALS if main and callable(signal.getsignal(each))]
    before = {each: signal.signal(each, lambda n, _: came.append(n)) for each in heeded}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
        for number in came:
            signal.raise_signal(number)
