"""Files of Python outside the package, that a study names: they register what they hold.

A file is executed once in a process, and so is it in worker processes. What it holds is part of
the identity of results by the hash of its source, and of the modules of its own folder that it
imports.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from squealstudy.errors import ExtensionError, SquealstudyError
from squealstudy.machine.processes import end_with
from squealstudy.python_texts import TextLoader, import_texts_of

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
HASH_DIGITS = 16  # of a hash
PACKAGE = Path(__file__).parent
_read: dict[Path, str] = {}  # files of this process and the hashes of what was executed
_registered: list[bool] = []  # what was registered outside the package: whether models see it
_in_models: dict[str, bool] = {}  # by the hash of a file, whether models see any of what it holds


def load_extension(path: str | Path) -> str:
    """Execute a file of Python, if it was not yet; the hash of its source.

    Raises
    ------
    ExtensionError
        A file that is not there, that fails, that registers nothing, or that has changed since it
        was executed.
    """
    path = Path(path).resolve()
    source = hash_of(path)
    if _was_executed(path, source):
        return source
    name = f"squealstudy_extension_{path.stem}_{source}"
    if name not in sys.modules:
        loader = TextLoader(name, str(path))
        spec = importlib.util.spec_from_file_location(name, path, loader=loader)
        if spec is None or spec.loader is None:
            raise ExtensionError(path, "is no file of Python")
        before = len(_registered)
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        if str(path.parent) not in sys.path:  # last: no module of its folder hides an installed one
            import_texts_of(path.parent)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[name]
            is_ours = isinstance(error, SquealstudyError)
            text = str(error) if is_ours else f"{type(error).__name__}: {error}"
            raise ExtensionError(path, text) from error
        if len(_registered) == before:
            del sys.modules[name]
            raise ExtensionError(
                path, "registers nothing: expected register(law), register_rung(rung) or the like"
            )
        _in_models[source] = any(_registered[before:])
    _read[path] = source
    return source


def note_registered(module: str, in_models: bool = False) -> None:
    """Note the module of what is registered, of whatever sort: a file without any is refused.

    `in_models`: it is a model, or a law that the nominal working point of a model depends on.
    """
    if module.partition(".")[0] != __package__:
        _registered.append(in_models)


def in_models(sources: Sequence[str]) -> list[str]:
    """Extensions among some files, by their hashes, that may decide how a model is reduced."""
    return [source for source in sources if _in_models.get(source, True)]


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
    source = hash_of(path)
    if not _was_executed(path, source):
        _read[path] = source


def extension_files() -> tuple[Path, ...]:
    """All files outside the package that this process has executed."""
    return tuple(_read)


def executed_files() -> dict[Path, str]:
    """All files outside the package that this process has executed, with their hashes."""
    return dict(_read)


def start_worker(lifeline: Connection, files: tuple[Path, ...]) -> None:
    """Set a worker up: it ends with its parent, has one thread, and knows its files."""
    end_with(lifeline)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before a library that has threads comes
    for path in files:
        load_extension(path)


def hash_of(path: Path) -> str:
    """Hash of a file of Python and of the modules of its folder that it imports, and these."""
    digest = hashlib.sha256()
    for text in sources_of(path).values():
        digest.update(text)
    return digest.hexdigest()[:HASH_DIGITS]


def sources_of(path: Path) -> dict[str, bytes]:
    """Source of a file of Python, and of the modules of its folder that it imports, and these.

    By their names in that folder; the file itself comes first.
    """
    content_of: dict[Path, bytes] = {}
    pending = [path]
    while pending:
        file = pending.pop(0)
        if file not in content_of:
            content_of[file] = _content(file)
            pending += _helpers(content_of[file], path.parent)
    return {file.relative_to(path.parent).as_posix(): text for file, text in content_of.items()}


def _content(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # a pipe might never end
            raise ExtensionError(path, "is no file of Python")
        return path.read_bytes()
    except OSError as error:
        raise ExtensionError(path, f"cannot be read: {error.strerror or error}") from None


def _helpers(text: bytes, folder: Path) -> list[Path]:
    """Files of a folder that a file of Python may import, wherever in it."""
    if folder.is_relative_to(PACKAGE):  # its own code is hashed as a whole
        return []
    try:
        nodes = list(ast.walk(ast.parse(text)))
    except (SyntaxError, ValueError):  # told when it is executed
        return []
    names = {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}
    names |= {str(n.module) for n in nodes if isinstance(n, ast.ImportFrom) and not n.level}
    files: list[Path] = []
    for name in sorted({name.partition(".")[0] for name in names}):
        module = folder / f"{name}.py"
        files += [module] if module.is_file() else sorted((folder / name).rglob("*.py"))
    return files


def _was_executed(path: Path, source: str) -> bool:
    """Whether a file was executed; ExtensionError where it was another one then."""
    if path in _read and _read[path] != source:
        raise ExtensionError(path, "has changed since it was executed: start Python anew")
    return path in _read
