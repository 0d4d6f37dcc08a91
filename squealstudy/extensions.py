"""Python files outside the package that a study names: they register laws, rungs and the like.

A file is executed once in each process, workers included. The identity of results has the hash of
its source and of the modules in its folder that it imports.
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
HASH_DIGITS = 16  # digits of a hash
PACKAGE = Path(__file__).parent
_read: dict[Path, str] = {}  # files that this process executed, and their hashes
_registered: list[bool] = []  # for each thing registered outside the package: may models use it
_in_models: dict[str, bool] = {}  # by the hash of a file: may models use anything it registers


def load_extension(path: str | Path) -> str:
    """Execute a Python file, unless it was already; return its hash (`hash_of`).

    Raises
    ------
    ExtensionError
        Where the file is missing, fails, registers nothing, or has changed since it was executed.
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
        if str(path.parent) not in sys.path:  # at the end, so as to hide no installed module
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
    """Note that a module registers something; a file that registers nothing is refused.

    `in_models`: it is a model, or a law on which the nominal working point of a model may depend.
    """
    if module.partition(".")[0] != __package__:
        _registered.append(in_models)


def in_models(sources: Sequence[str]) -> list[str]:
    """Hashes of those extension files, among `sources`, on which a reduction may depend."""
    return [source for source in sources if _in_models.get(source, True)]


def remember(function: Callable[..., Any]) -> None:
    """Note the file of a function registered outside the package, for workers to execute it too.

    Raises
    ------
    ExtensionError
        Where it is a function of the main program, which workers cannot execute, or the file
        cannot be read or has changed.
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
    """Set up a worker: it ends with its parent, has one thread, and executes extension files."""
    end_with(lifeline)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before a library with threads is imported
    for path in files:
        load_extension(path)


def hash_of(path: Path) -> str:
    """Hash of a Python file and of all modules in its folder that it imports, also indirectly."""
    digest = hashlib.sha256()
    for text in sources_of(path).values():
        digest.update(text)
    return digest.hexdigest()[:HASH_DIGITS]


def sources_of(path: Path) -> dict[str, bytes]:
    """Sources of a Python file and of all modules in its folder that it imports, also indirectly.

    Keys are names in that folder; the file itself comes first.
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
    """Files of a folder that a Python file may import, anywhere in its text."""
    if folder.is_relative_to(PACKAGE):  # the package's own code is hashed as a whole
        return []
    try:
        nodes = list(ast.walk(ast.parse(text)))
    except (SyntaxError, ValueError):  # reported when the file is executed
        return []
    names = {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}
    names |= {str(n.module) for n in nodes if isinstance(n, ast.ImportFrom) and not n.level}
    files: list[Path] = []
    for name in sorted({name.partition(".")[0] for name in names}):
        module = folder / f"{name}.py"
        files += [module] if module.is_file() else sorted((folder / name).rglob("*.py"))
    return files


def _was_executed(path: Path, source: str) -> bool:
    """Whether a file was executed; ExtensionError if it has changed since."""
    if path in _read and _read[path] != source:
        raise ExtensionError(path, "has changed since it was executed: start Python anew")
    return path in _read
