"""Files of Python outside the package, that a study names: they register what they hold.

A file is executed once in a process, and so is it in worker processes. What it holds is part of
the identity of results by the hash of its source.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from squealstudy.errors import ExtensionError, SquealstudyError

LENGTH = 16  # of a hash
PACKAGE = Path(__file__).parent
_read: dict[Path, str] = {}  # files of this process and the hashes of what was executed


def load_extension(path: str | Path) -> str:
    """Execute a file of Python, if it was not yet; the hash of its source.

    Raises
    ------
    ExtensionError
        A file that is not there, that fails, or that has changed since it was executed.
    """
    path = Path(path).resolve()
    source = _hash(path)
    if _known(path, source):
        return source
    name = f"squealstudy_extension_{path.stem}_{source}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise ExtensionError(path, "is no file of Python")
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[name]
            known = isinstance(error, SquealstudyError)
            text = str(error) if known else f"{type(error).__name__}: {error}"
            raise ExtensionError(path, text) from error
    _read[path] = source
    return source


def remember(function: Callable[..., Any]) -> None:
    """Note the file of a function registered outside the package: workers must execute it too.

    Raises
    ------
    ExtensionError
        A function of the program itself, which workers cannot execute, or of no file.
    """
    path = Path(inspect.getfile(function)).resolve()
    if path.is_relative_to(PACKAGE):
        return
    if function.__module__ == "__main__":
        raise ExtensionError(path, "what is registered must be in a file of its own")
    source = _hash(path)
    if not _known(path, source):
        _read[path] = source


def extension_files() -> tuple[Path, ...]:
    """All files outside the package that this process has executed."""
    return tuple(_read)


class Extensions:
    """Files of this process that the process which receives this executes as well.

    It must come before what needs them: pickled objects are made in their order.
    """

    def __init__(self, paths: Iterable[Path]) -> None:
        self.paths = tuple(paths)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _received, (self.paths,)


def _received(paths: tuple[Path, ...]) -> Extensions:
    for path in paths:
        load_extension(path)
    return Extensions(paths)


def _hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:LENGTH]
    except OSError as error:
        raise ExtensionError(path, f"cannot be read: {error.strerror or error}") from None


def _known(path: Path, source: str) -> bool:
    """Whether a file was executed; ExtensionError where it was another one then."""
    if path in _read and _read[path] != source:
        raise ExtensionError(path, "has changed since it was executed: start Python anew")
    return path in _read
