"""File locks, and flushing files to the disk."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from squealstudy.errors import MachineError

NO_LOCK_ERRORS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP}
NO_FLUSH_ERRORS = {errno.EINVAL, errno.EOPNOTSUPP, errno.ENOTSUP}


class HeldError(Exception):
    """Raised where another process or thread holds a lock."""


@contextlib.contextmanager
def lock(path: Path, wait: bool = True) -> Iterator[None]:
    """Hold a lock on a file, which is made if it is missing. The lock ends with the process.

    Raises
    ------
    HeldError
        Another process or thread holds the lock, and `wait` is false.
    MachineError
        The file system has no locks, or the file is a link.
    """
    from filelock import FileLock, Timeout

    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink():  # a lock empties the file that it opens
        raise MachineError(f"{path}: a link, where a lock file is expected: remove it")
    file_lock = FileLock(path, fallback_to_soft=False)  # a soft lock outlives its process
    try:
        file_lock.acquire(blocking=wait)
    except Timeout:
        raise HeldError(str(path)) from None
    except OSError as error:
        if error.errno not in NO_LOCK_ERRORS:
            raise
        raise MachineError(
            f"{path.parent}: this file system cannot lock files ({error.strerror}), and two runs "
            "would spoil each other's; choose a directory on a local disk"
        ) from error
    try:
        yield
    finally:
        file_lock.release()


def flush(path: Path) -> None:
    """Flush a file to the disk, or the entries of a directory if the system can do that."""
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
        if not (path.is_dir() and error.errno in NO_FLUSH_ERRORS):
            raise
    finally:
        os.close(descriptor)
