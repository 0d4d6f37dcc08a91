"""Folders of the cache and of compiled kernels, and substitutes if these cannot be used."""

from __future__ import annotations

import atexit
import contextlib
import errno
import os
import shutil
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from squealstudy import faults

ENVIRONMENT = "SQUEALSTUDY_CACHE"
COMPILED, KERNELS = "NUMBA_CACHE_DIR", "kernels"  # numba's variable; a folder in the cache
CACHE_TRIAL_BYTES = bytes(2**20)  # written on trial; a cache that does not take it is of no use


def cache_directory() -> Path:
    """$SQUEALSTUDY_CACHE, else the user's cache directory; it may not exist yet.

    Raises OSError if no home directory is known.
    """
    from_environment = os.environ.get(ENVIRONMENT)
    return Path(from_environment) if from_environment else user_cache()


def user_cache() -> Path:
    """The cache directory of this user, whatever $SQUEALSTUDY_CACHE is."""
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        raise FileNotFoundError(errno.ENOENT, "no home directory", "~/.cache") from None
    return base / "squealstudy"


@contextlib.contextmanager
def usable_cache(warn: Callable[[str], None]) -> Iterator[None]:
    """Provide a cache that can be written: a temporary one, with a warning, if the usual cannot.

    The content of the usual cache is then not used, as new parts would be written beside it.
    """
    try:
        _try_writing(cache_directory())
    except OSError as error:
        reason = faults.sentence(error)
    else:
        yield
        return
    warn(f"the cache cannot be written ({reason}): what it would keep is made for this run alone")
    before = os.environ.get(ENVIRONMENT)
    with tempfile.TemporaryDirectory(prefix="squealstudy-", ignore_cleanup_errors=True) as folder:
        os.environ[ENVIRONMENT] = folder
        try:
            yield
        finally:
            os.environ.pop(ENVIRONMENT)
            if before is not None:
                os.environ[ENVIRONMENT] = before


def compiled_base() -> Path:
    """Folder of compiled kernels: $NUMBA_CACHE_DIR, else one in the cache.

    Kernels are executed when they are loaded. If other users may write to the folder, or nobody
    can, they are kept in the user's own cache, or else in a temporary directory for this process
    and its workers; a warning says so.
    """
    from_environment = os.environ.get(ENVIRONMENT)
    return _safe_kernel_folder(
        os.environ.get(COMPILED)
        or (str(Path(from_environment, KERNELS)) if from_environment else "")
    )


@cache
def _safe_kernel_folder(folder: str) -> Path:
    """A folder for compiled kernels in which nobody else can write."""
    reasons = []
    for in_user_cache in (False, True) if folder else (True,):
        try:
            path = user_cache() / KERNELS if in_user_cache else Path(folder)
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not others_may_write(path):
                _try_writing(path)
                break
            reasons.append(f"{path}: others may write there, and kernels are executed")
        except OSError as error:
            reasons.append(faults.sentence(error) or str(error))
    else:
        path = Path(tempfile.mkdtemp(prefix="squealstudy-kernels-"))
        _remove_at_exit(path, os.getpid())
    if reasons:
        os.environ[COMPILED] = str(path)
        warnings.warn(f"compiled kernels are kept in {path} ({reasons[0]})", stacklevel=2)
    return path


def others_may_write(path: Path) -> bool:
    """Whether another user than root may put files in a directory or replace it.

    False where files have no owners (Windows). A group with the number of a folder's owner is taken
    to be that user's own.
    """
    if not hasattr(os, "geteuid"):
        return False
    for folder in (path.resolve(), *path.resolve().parents):
        state = folder.stat()
        others = stat.S_IWOTH | (stat.S_IWGRP if state.st_gid != state.st_uid else 0)
        is_sticky = folder != path.resolve() and state.st_mode & stat.S_ISVTX  # as /tmp
        if state.st_uid not in (0, os.geteuid()) or (state.st_mode & others and not is_sticky):
            return True
    return False


def _try_writing(directory: Path) -> None:
    """Raise OSError if a directory cannot be made, or takes no file."""
    with faults.named(directory):
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory) as file:
            file.write(CACHE_TRIAL_BYTES)


def _remove_at_exit(path: Path, owner: int) -> None:
    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(path, ignore_errors=True)

    atexit.register(remove)
