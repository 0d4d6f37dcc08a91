"""The shipped studies, which are in the package of a wheel and in the folder `studies` of a clone.

A study is written with all files that it names: model files and meshes, studies on which it
measures methods, and studies whose results it reads.
"""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from squealstudy.errors import SquealstudyError
from squealstudy.files import write_atomic
from squealstudy.wording import did_you_mean

PACKAGE = Path(__file__).parents[1]
IN_WHEEL, IN_CLONE = PACKAGE / "examples", PACKAGE.parent / "studies"
NOT_SHIPPED = "benchmarks"  # folder of the clone
RESULTS = "results"  # folder in which a study finds the results of another


@dataclass(frozen=True)
class Example:
    """A shipped study.

    Attributes
    ----------
    name : str
        Name of its file, without the ending.
    path : Path
        The file.
    kind, description : str
        As the study file states them.
    after : tuple of str
        Names of the studies whose results it reads.
    """

    name: str
    path: Path
    kind: str
    description: str
    after: tuple[str, ...]


def _folder() -> Path:
    return IN_WHEEL if IN_WHEEL.is_dir() else IN_CLONE


@cache
def examples() -> Mapping[str, Example]:
    """The shipped studies by name: those of the top folder, then folder by folder."""
    folder, by_name = _folder(), {}
    paths = (p.relative_to(folder) for p in folder.rglob("*.toml"))
    for path in sorted(paths, key=lambda p: (p.parent.as_posix(), p.stem)):
        if path.parts[0] == NOT_SHIPPED:
            continue
        tables = _tables(folder / path)
        if study := tables.get("study"):
            kind_and_description = study["kind"], study.get("description", "")
            after = tuple(dict.fromkeys(_results_of(tables)))
            by_name[path.stem] = Example(path.stem, folder / path, *kind_and_description, after)
    return by_name


def list_examples() -> dict[str, str]:
    """Descriptions of the shipped studies by name; `write_example` writes one of them.

    Examples
    --------
    >>> import squealstudy as sq
    >>> sq.list_examples()["hulten_flutter"]
    "lock-in of the two modes of Hulten's model over friction"
    """
    return {name: example.description for name, example in examples().items()}


def write_example(name: str, folder: Path | str | None = None) -> list[Path]:
    """Write a shipped study, and the files that it needs, to run and to change.

    Parameters
    ----------
    name : str
        One of `list_examples`.
    folder : Path, str or None
        Folder to write to; by default the current directory for a single file, otherwise a new
        folder with the name of the study.

    Returns
    -------
    list of Path
        The written files, the study first.

    Raises
    ------
    SquealstudyError
        There is no such study, or a file exists already.

    Examples
    --------
    >>> import squealstudy as sq
    >>> [path.name for path in sq.write_example("hulten_flutter")]
    ['hulten_flutter.toml']
    """
    shipped = examples()
    if name not in shipped:
        raise SquealstudyError(
            f"there is no example '{name}'{did_you_mean(name, shipped)}; 'squealstudy examples' "
            "lists them"
        )
    files = list(dict.fromkeys(_with_named_files(shipped[name].path)))
    if folder is None:
        folder = "." if len(files) == 1 else name
    top = _common_folder(files)
    written = {path: Path(folder) / path.relative_to(top) for path in files}
    for path in written.values():
        if path.exists():
            raise SquealstudyError(f"{path}: there is such a file already, it is not overwritten")
    for path, to in written.items():
        write_atomic(to, partial(shutil.copyfile, path))
    return list(written.values())


def _common_folder(files: list[Path]) -> Path:
    folder = files[0].parent
    while not all(path.is_relative_to(folder) for path in files):
        folder = folder.parent
    return folder


def _with_named_files(path: Path) -> Iterator[Path]:
    """A file, and the shipped files that it names, to any depth."""
    yield path
    if path.suffix != ".toml":
        return
    tables = _tables(path)
    for study in _results_of(tables):
        yield from _with_named_files(examples()[study].path)
    for text in _texts(tables):
        named = path.parent / text
        if Path(text).suffix and named.is_file() and named.resolve().is_relative_to(_folder()):
            yield from _with_named_files(named)


def _results_of(tables: Mapping[str, Any]) -> Iterator[str]:
    """Names of the studies whose results a file reads."""
    for text in _texts(tables):
        folder, _, study = text.partition("/")
        if folder == RESULTS and study:
            yield study


def _tables(path: Path) -> Mapping[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _texts(value: Any) -> Iterator[str]:
    """All texts in tables and lists."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping | list):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _texts(inner)
