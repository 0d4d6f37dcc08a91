"""Import modules of users' folders from their source text, never from bytecode beside it.

Python takes bytecode in ``__pycache__`` as that of a source whose size and time it names, whatever
the bytecode does: what is executed might not be what was read and hashed.
"""

from __future__ import annotations

import sys
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    SourceFileLoader,
)
from pathlib import Path
from types import CodeType

_folders: list[Path] = []


class TextLoader(SourceFileLoader):
    """Executes the text of a module, and neither reads nor writes bytecode."""

    def get_code(self, fullname: str) -> CodeType:
        """Code compiled from the source text."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def import_texts_of(folder: Path) -> None:
    """Find modules in a folder too, after all other places; sources come before compiled ones."""
    if not _folders:
        sys.path_hooks.insert(0, _finder)
    _folders.append(folder)
    sys.path_importer_cache.pop(str(folder), None)
    sys.path.append(str(folder))


def _finder(path: str) -> FileFinder:
    """Importer for such a folder or a package in it; ImportError for other paths."""
    folder_path = Path(path)
    if not any(folder_path == folder or _is_package(folder_path, folder) for folder in _folders):
        raise ImportError(path)
    return FileFinder(
        path, (TextLoader, SOURCE_SUFFIXES), (ExtensionFileLoader, EXTENSION_SUFFIXES)
    )


def _is_package(path: Path, folder: Path) -> bool:
    """Whether a path is below a folder, and not in another entry of sys.path below it."""
    if not path.is_relative_to(folder):
        return False
    between = {path, *path.parents} - {folder, *folder.parents}
    return not between & {Path(entry) for entry in sys.path if entry}
