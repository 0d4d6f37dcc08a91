"""All that depends on the machine: locks, flushing, cores, memory, and processes that end together.

Linux, macOS and Windows differ here and nowhere else. Cores and memory are those that this process
may use: a container, a control group or an affinity may leave it a part of the machine.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import psutil

from squealstudy.errors import MachineError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

BYTES_PER_MB = 2**20
MOST_WORKERS = 61 if sys.platform == "win32" else 2**16  # that Python can wait for there
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")  # Linux alone
GROUPS, OWN_GROUPS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")  # Linux alone
NO_LOCKS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP}
NO_FLUSH = {errno.EINVAL, errno.EOPNOTSUPP, errno.ENOTSUP}


# -- files ----------------------------------------------------------------------------------------
class HeldError(Exception):
    """A lock that another process or thread holds."""


TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # numbers of these settings in <malloc.h>
# bytes; the latter is where glibc's own setting would end
MMAP_THRESHOLD_BYTES, MAPPED_LATER = 2**20, 2**25
KEPT_FREE = 2**28  # bytes


@contextlib.contextmanager
def lock(path: Path, wait: bool = True) -> Iterator[None]:
    """Hold a lock file, made with its directory; the lock dies with its process.

    Raises
    ------
    HeldError
        Where another holds it and `wait` is false.
    MachineError
        On a file system without locks.
    """
    from filelock import FileLock, Timeout

    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink():  # a lock empties the file that it opens
        raise MachineError(f"{path}: a link, where a lock file is expected: remove it")
    held = FileLock(path, fallback_to_soft=False)  # a soft lock outlives its process
    try:
        held.acquire(blocking=wait)
    except Timeout:
        raise HeldError(str(path)) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        raise MachineError(
            f"{path.parent}: this file system cannot lock files ({error.strerror}), and two runs "
            "would spoil each other's; choose a directory on a local disk"
        ) from error
    try:
        yield
    finally:
        held.release()


def flush(path: Path) -> None:
    """Bring a file, or the names in a directory, to the disk; the names where that is possible."""
    if path.is_dir():
        if sys.platform == "win32":  # which keeps names in a journal and opens no directory
            return
        mode = os.O_RDONLY
    else:
        mode = os.O_RDWR  # Windows flushes no file that is open for reading
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if not (path.is_dir() and error.errno in NO_FLUSH):
            raise
    finally:
        os.close(descriptor)


# -- cores ----------------------------------------------------------------------------------------
def cores() -> int:
    """Cores that this process may use: of the machine, its affinity and its control groups."""
    process = psutil.Process()
    allowed = len(process.cpu_affinity()) if hasattr(process, "cpu_affinity") else os.cpu_count()
    return max(1, min([allowed or 1, *_quotas()]))


def _quotas() -> Iterator[int]:
    """Cores that each control group allows, rounded up."""
    for group in _groups("cpu"):
        found = _first(group, "cpu.max") or " ".join(
            (_first(group, "cpu.cfs_quota_us"), _first(group, "cpu.cfs_period_us"))
        )
        quota, _, period = found.partition(" ")
        if quota.isdigit() and period.isdigit():  # else "max", -1 or nothing: no limit
            yield math.ceil(int(quota) / int(period))


def _groups(controller: str) -> Iterator[Path]:
    """Directories of the control groups of this process, and of those around them."""
    for line in _read(OWN_GROUPS).splitlines():
        _, controllers, name = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        top = GROUPS / controller if controllers else GROUPS  # of version 1, of version 2
        group = top / name.lstrip("/")
        yield from (group, *(p for p in group.parents if p.is_relative_to(top)))


def _first(group: Path, name: str) -> str:
    return _read(group / name).strip()


def _read(path: Path) -> str:
    """A file of the kernel; empty where there is none."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""


# -- memory ---------------------------------------------------------------------------------------
def available_memory_mb() -> float:
    """Memory that processes may still take without swapping or being killed, MB."""
    return min([psutil.virtual_memory().available, *_left()]) / BYTES_PER_MB


def _left() -> Iterator[int]:
    """Bytes that each control group leaves; files that it has read give way."""
    names = (
        ("memory.max", "memory.current", "inactive_file"),
        ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    )
    for group in _groups("memory"):
        for limit, used, cached in names:
            if (most := _first(group, limit)).isdigit():
                stat = dict(line.split() for line in _read(group / "memory.stat").splitlines())
                taken = int(_first(group, used) or 0) - int(stat.get(cached, 0))
                yield max(0, int(most) - taken)


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB."""
    if STATUS.is_file():  # getrusage would give a worker its parent's size at the fork
        return _status_mb("VmHWM")
    if sys.platform == "darwin":
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / BYTES_PER_MB
    return psutil.Process().memory_info().peak_wset / BYTES_PER_MB  # Windows


def _status_mb(name: str) -> float:
    fields = dict(line.split(":", 1) for line in _read(STATUS).splitlines())
    return float(fields[name].split()[0]) / 1024.0


def give_back_memory() -> None:
    """Give the machine what is free inside this process; Linux only.

    The C library keeps it otherwise, gigabytes after a factorisation of a large matrix.
    """
    _of_glibc("malloc_trim", 0)


@contextlib.contextmanager
def memory_returned() -> Iterator[None]:
    """Give back all memory that is freed within; Linux only.

    Arrays are mapped one by one meanwhile: the C library would soon take them from one heap, in
    which what stays between them keeps them all.
    """
    _of_glibc("mallopt", MMAP_THRESHOLD, MMAP_THRESHOLD_BYTES)
    try:
        yield
    finally:
        _of_glibc("mallopt", MMAP_THRESHOLD, MAPPED_LATER)
        give_back_memory()


def keep_free_memory() -> None:
    """Keep what is freed, up to 256 MB, for the next arrays; Linux only.

    The C library gives it back at once else, and the machine clears it again for the next design
    point.
    """
    _of_glibc("mallopt", MMAP_THRESHOLD, MAPPED_LATER)
    _of_glibc("mallopt", TRIM_THRESHOLD, KEPT_FREE)


def _of_glibc(name: str, *arguments: int) -> None:
    function = getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
    if function is not None:  # other C libraries need not have it
        function(*arguments)


@dataclass
class MemoryAbove:
    """Largest resident size within `memory_above`, MB above that before; NaN where unknown."""

    megabytes: float = float("nan")


@contextlib.contextmanager
def memory_above() -> Iterator[MemoryAbove]:
    """Watch the memory of what runs inside; Linux only, elsewhere NaN."""
    found = MemoryAbove()
    try:
        RESET.write_text("5", encoding="utf-8")  # the peak begins again at the present size
        before = _status_mb("VmRSS")
    except OSError:
        yield found
        return
    yield found
    found.megabytes = max(0.0, _status_mb("VmHWM") - before)


# -- processes ------------------------------------------------------------------------------------
def is_running(process: int) -> bool:
    """Whether there is a process of that number."""
    return psutil.pid_exists(process)


SIGNALS = {signal.SIGINT, signal.SIGTERM}  # and of a terminal that closes, where there is one:
SIGNALS |= {getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name)}


SIGNAL_EXIT_CODE_OFFSET = 128  # added to a signal's number by shells, for an exit code
SIGNAL_RETRY_S = 0.01  # s until a signal comes again


class InterruptedRun(BaseException):
    """What a signal raises in `interruptible`; `exit_code` is that which shells expect."""

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

    def dropped(what: sys.UnraisableHookArgs) -> None:
        if not isinstance(what.exc_value, InterruptedRun):
            told(what)
            return
        for each in handled:
            signal.signal(each, interrupt)
        number = what.exc_value.exit_code - SIGNAL_EXIT_CODE_OFFSET
        threading.Timer(SIGNAL_RETRY_S, os.kill, (os.getpid(), number)).start()

    handled = [each for each in SIGNALS if signal.getsignal(each) != signal.SIG_IGN]  # by nohup
    before = {each: signal.signal(each, interrupt) for each in handled}
    told, sys.unraisablehook = sys.unraisablehook, dropped
    try:
        yield
    finally:
        sys.unraisablehook = told
        for each, handler in before.items():
            signal.signal(each, handler)


_pipes: list[tuple[Connection, Connection]] = []  # one at most


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
    """The same for a process whose standard input is a pipe that its parent holds open."""
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


SAFE_PATH = "PYTHONSAFEPATH"
SILENTLY = "ignore:resource_tracker:UserWarning"


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
