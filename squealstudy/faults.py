"""Refusals of the machine in one sentence each: disk, permission, memory, files, processes."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from squealstudy.errors import MachineError, SquealstudyError

# limits of the machine; some libraries report them only by the text of another error
LIMITS = {
    errno.ENOSPC: "the disk is full: free some space",
    errno.EDQUOT: "your quota of the disk is used up: free some space",
    errno.EMFILE: "too many files are open: raise the limit (ulimit -n) or give fewer --jobs",
    errno.ENFILE: "too many files are open on this machine: close some programs",
    errno.ENOMEM: "memory ran out: give fewer --jobs, raise the limit or make the model smaller",
    errno.EAGAIN: "no more processes or threads may start: raise the limits (ulimit -u, -v) or "
    "give fewer --jobs",
}
REFUSED = LIMITS | {
    errno.EFBIG: "a file may not become that large here: raise the limit (ulimit -f)",
    errno.EROFS: "the disk is read-only: choose another place",
    errno.EACCES: "permission denied: ask the owner for it or choose another place",
    errno.EPERM: "the system does not permit it: choose another place",
    errno.ENOENT: "it is not there, or was removed meanwhile",
    errno.ENOTDIR: "a part of the path is a file: choose another place",
    errno.EEXIST: "there is a file already: choose another place",
    errno.EISDIR: "it is a directory: choose another place",
    errno.ENAMETOOLONG: "the name is too long: choose a shorter one",
    errno.EIO: "the disk does not answer",
}
SPEAKING = (OSError, RuntimeError, ImportError)  # errors of libraries whose texts are searched
NO_TEXT = "its name is no text in UTF-8 here: set PYTHONUTF8=1 or choose another place"
NO_TEMPORARY = "no directory for temporary files can be written: name one in TMPDIR"
NO_DIRECTORY = "the current directory was removed: change to another"
TEXTS = {os.strerror(code): code for code in LIMITS} | {
    "can't start new thread": errno.EAGAIN,
    "alloc fails": errno.ENOMEM,  # SuperLU
    "failed to map segment": errno.ENOMEM,  # a library that is being loaded
    "requested and": errno.ENOSPC,  # numpy: 80 requested and 8 written
}


@contextlib.contextmanager
def named(path: Path | str) -> Iterator[None]:
    """Make errors of the operating system name `path`, not a temporary file or none."""
    try:
        yield
    except OSError as error:
        code = _code(error)
        if code is None:
            raise
        raise OSError(code, os.strerror(code), str(path)) from error


@contextlib.contextmanager
def told(then: str = "") -> Iterator[None]:
    """Raise refusals of the machine as MachineError; their text ends with `then`."""
    try:
        yield
    except Exception as error:
        if (text := sentence(error)) is None:
            raise
        raise MachineError(text + then) from error


def sentence(error: Exception) -> str | None:
    """Sentence on what failed, where, and what to do; None where the machine is not at fault."""
    if isinstance(error, MachineError):
        return str(error)
    if isinstance(error, SquealstudyError | BrokenPipeError):  # a pipe: a reader such as `head`
        return None
    if isinstance(error, UnicodeEncodeError) and error.reason == "surrogates not allowed":
        # bytes of a path that the locale does not know; ASCII, so that any console shows it
        return f"{ascii(error.object)[1:-1]}: {NO_TEXT}"
    code = _code(error)
    if code is None:
        return str(error) if isinstance(error, OSError) else None
    path = getattr(error, "filename", None)
    if code == errno.ENOENT and not path:
        return NO_TEMPORARY if "temporary" in str(error) else NO_DIRECTORY
    text = REFUSED.get(code) or os.strerror(code)
    return f"{path}: {text}" if path else text


def raise_if_memory(error: RuntimeError) -> None:
    """Raise MemoryError if an error of SuperLU says that memory ran out."""
    if _code(error) == errno.ENOMEM:
        raise MemoryError(str(error)) from error


def _code(error: Exception) -> int | None:
    """The error number of what the operating system refused; None for other errors."""
    if isinstance(error, MemoryError):
        return errno.ENOMEM
    if (code := getattr(error, "errno", None)) is not None:
        return int(code)
    if not isinstance(error, SPEAKING):
        return None
    message = str(error).lower()
    return next((code for text, code in TEXTS.items() if text.lower() in message), None)
