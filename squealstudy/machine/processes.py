"""Processes: that end together, by signals and lifelines."""

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

SIGNALS = {signal.SIGINT, signal.SIGTERM}  # and of a terminal that closes, where there is one:
SIGNALS |= {getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name)}
SAFE_PATH = "PYTHONSAFEPATH"
SILENTLY = "ignore:resource_tracker:UserWarning"
SIGNAL_EXIT_CODE_OFFSET = 128  # added to a signal's number by shells, for an exit code
SIGNAL_RETRY_S = 0.01  # s until a signal comes again

_pipes: list[tuple[Connection, Connection]] = []  # one at most


def is_running(process: int) -> bool:
    """Whether there is a process of that number."""
    return psutil.pid_exists(process)


class InterruptedRun(BaseException):
    """Raised by a signal in `interruptible`; `exit_code` is the one that shells expect."""

    def __init__(self, number: int) -> None:
        self.exit_code = SIGNAL_EXIT_CODE_OFFSET + number


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C, and what ends processes politely, raise InterruptedRun; the second ends at once.

    Python drops an exception in a finaliser or a callback of garbage collection with a traceback on
    stderr. A signal that comes there comes again a moment later.
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
    """The end of a pipe, to hand to processes that shall end with this one (`end_with`).

    Nothing is ever written; the system closes the other end when this process is gone.
    """
    from multiprocessing import Pipe

    if not _pipes:
        _pipes.append(Pipe(duplex=False))
    return _pipes[0][0]


def cut_lifeline() -> None:
    """End all processes that have been handed the lifeline of this one; others get a new one."""
    while _pipes:
        for end in _pipes.pop():
            end.close()


if hasattr(os, "register_at_fork"):  # a fork of this process would hold the pipe open
    os.register_at_fork(after_in_child=cut_lifeline)


def end_with(lifeline: Connection) -> None:
    """End this process with that from which `lifeline` came, which alone gets signals."""
    _end_when(lambda: lifeline.poll(None))


def end_with_input() -> None:
    """End this process when its parent closes the pipe that is its standard input."""
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
    """For processes that start here: they look for no modules there, for it may be anybody's."""
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
    """For processes that start here: signals go to this one alone, its main file is not theirs.

    A main file may run a study as it is read, and so would they. A signal that comes meanwhile
    waits: a process that has half of what it needs would say so in a traceback. They look for no
    modules in the current directory, which may be anybody's.
    """
    from multiprocessing import get_context

    # what starts with the first lock lets signals through, and removes what a killed run leaves
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
    """Raise signals at the end: Python heeds those that came to a thread without a mask, too."""
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
