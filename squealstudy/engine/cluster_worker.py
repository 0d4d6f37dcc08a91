"""A worker of a cluster: it does one task at a time, with the caller's models and extensions.

The worker shares no file system with the process that runs the study. Models and source texts come
with the tasks and are put into the worker's own cache; files that a task adds to this cache go back
with its result.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Any

from threadpoolctl import threadpool_limits

from squealstudy.engine.cache import contents, keep_contents, prepared_path, touched
from squealstudy.engine.keys import source_hash
from squealstudy.errors import MachineError, SquealstudyError
from squealstudy.extensions import THREADS, load_extension
from squealstudy.files import write_bytes
from squealstudy.machine.resources import peak_memory_mb
from squealstudy.paths import cache_directory
from squealstudy.version import __version__

PACKAGES = ("numpy", "scipy", "numba", "pyarrow")  # numbers and their transfer depend on them
SAME_VERSIONS_ADVICE = "install the same versions there as here"
# by path in the cache's folder of models: the files there, by name
Parcel = Mapping[str, Mapping[str, bytes]]


@dataclass(frozen=True)
class Setting:
    """Settings that all tasks of a run have in common.

    Attributes
    ----------
    versions : mapping of str -> str
        Versions of packages in the process that runs the study.
    extensions : sequence of mapping of str -> bytes
        Source texts by name for each extension: first its own file, then the files of its folder
        that it may import.
    """

    versions: Mapping[str, str]
    extensions: Sequence[Mapping[str, bytes]]


@dataclass(frozen=True)
class Answer:
    """Result of a task, and files it added to the cache that the caller did not have."""

    task_result: Any
    cached_files: Parcel = field(default_factory=dict)


@cache
def versions() -> dict[str, str]:
    """Versions that results depend on; squealstudy's includes the hash of its source."""
    python = ".".join(platform.python_version_tuple()[:2])
    version_text = f"{__version__} (source {source_hash(('.',))})"
    return {"squealstudy": version_text, "python": python} | {
        name: version(name) for name in PACKAGES
    }


def facts(dask_worker: Any) -> dict[str, Any]:
    """Versions of a worker, and its memory [MB]: the limit (0 without one) and the peak so far."""
    limit = getattr(dask_worker.memory_manager, "memory_limit", None) or 0
    return {"versions": versions(), "limit_mb": limit / 2**20, "used_mb": peak_memory_mb()}


def shared_value(value: Any) -> Any:
    """A value that tasks need, made by a task so that dask remakes it if its worker dies."""
    return value


def in_cache(name: str) -> Path:
    """A path in this process's cache."""
    return cache_directory() / name


_one_at_a_time = Lock()  # tasks would share the process's caches, warnings and library threads


def answer(
    setting: Setting, parcels: Sequence[Parcel], names_here: frozenset[str], call: bytes
) -> Answer:
    """Do a task and return its result.

    Parameters
    ----------
    setting : Setting
        Settings of the run.
    parcels : sequence of Parcel
        Models that the task needs.
    names_here : frozenset of str
        Paths in the folder of models that the caller has in its cache: they are not sent back.
    call : bytes
        A pickled function with its argument.
    """
    with _one_at_a_time:
        _enter(setting)
        for parcel in parcels:
            _unpack(parcel)
        function, task = pickle.loads(call)
        with threadpool_limits(1), touched() as touched_paths:
            try:
                task_result = function(task)
            except Exception as error:
                if _portable(error):
                    raise
                raise MachineError(f"{type(error).__name__}: {error}") from None
        models = prepared_path("")
        names = {path.relative_to(models).as_posix(): path for path in touched_paths}
        return Answer(
            task_result, {name: contents(names[name]) for name in names.keys() - names_here}
        )


def _portable(error: Exception) -> bool:
    """Whether an error can be pickled and read again."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return False
    return True


_entered: list[Setting] = []  # the setting of the last run, if any


def _enter(setting: Setting) -> None:
    """Check versions, set threads and load extensions, once for each run."""
    if setting in _entered:
        return
    if text := difference(setting.versions, versions()):
        raise MachineError(f"a worker has {text}: {SAME_VERSIONS_ADVICE}")
    os.environ.update(dict.fromkeys(THREADS, "1"))
    for files in setting.extensions:
        path = _extension_file(files)
        try:
            load_extension(path)
        except SquealstudyError as error:
            raise MachineError(
                f"a worker cannot read the extension {path.name} ({error}); where that was "
                "changed, it knows the former version: start the workers anew"
            ) from error
    _entered[:] = [setting]


def _extension_file(files: Mapping[str, bytes]) -> Path:
    """Write an extension into a folder that is named by its content; the path of its file."""
    digest = hashlib.sha256(repr(list(files.items())).encode()).hexdigest()
    folder = cache_directory() / "extensions" / digest
    for name, text in files.items():
        if not (folder / name).is_file():
            write_bytes(folder / name, text)
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    return folder / next(iter(files))


def difference(expected: Mapping[str, str], got: Mapping[str, str]) -> str:
    """Packages whose version on a worker is not the expected one, as text; empty where none."""
    others = {name: got.get(name, "none") for name in expected if got.get(name) != expected[name]}
    return ", ".join(f"{name} {text}, not {expected[name]}" for name, text in others.items())


_unpacked: set[str] = set()


def _unpack(parcel: Parcel) -> None:
    """Write files of the caller's cache to this worker's cache."""
    for name, files in parcel.items():
        folder = prepared_path(name)
        if name not in _unpacked or not folder.exists():
            keep_contents(folder, files)
            _unpacked.add(name)
