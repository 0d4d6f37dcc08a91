"""Code of extensions that results were made with, and when it may be executed.

Manifests hold the code as text, which is never executed: a results directory, and a hash in its
manifest, may come from anybody. Only two kinds of files are executed: those that ``--extension``
names, and those of the user's list. Every run enters the extensions that it executes in that list.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from squealstudy.errors import ExtensionError, ResultsError, printable
from squealstudy.extensions import executed_files, hash_of, load_extension, sources_of
from squealstudy.files import sealed, unsealed, write_bytes, write_text
from squealstudy.paths import cache_directory, others_may_write, user_cache

RECORDS = "extensions"  # key of the manifest
LIST_FOLDER = "executed_extensions"  # folder of the cache with a folder for each hash
ENTRY_FILE = "entry.json"  # file there with path and name of the extension


def recorded_extensions(hashes: Sequence[str]) -> list[dict[str, Any]]:
    """Extensions of these hashes as a manifest keeps them: name, hash and source texts."""
    files = {source_hash: path for path, source_hash in executed_files().items()}
    return [
        {
            "name": files[source_hash].name,
            "hash": source_hash,
            "sources": {
                n: t.decode(errors="replace") for n, t in sources_of(files[source_hash]).items()
            },
        }
        for source_hash in hashes
        if source_hash in files
    ]


def enter_executed(hashes: Sequence[str]) -> None:
    """Enter extensions that this process has executed, by their hashes, in the user's list."""
    for path, source_hash in executed_files().items():
        if source_hash in hashes and _listed_file(source_hash) is None:
            folder = _list_folder() / source_hash
            for name, text in sources_of(path).items():
                write_bytes(folder / name, text)
            write_text(folder / ENTRY_FILE, sealed({"path": str(path), "name": path.name}))


def execute_recorded(manifest: Mapping[str, Any], directory: Path) -> tuple[str, ...]:
    """Execute the extensions of results, and return their hashes.

    Raises
    ------
    ResultsError
        This user has not run an extension on this machine, and ``--extension`` does not name it.
    """
    files_of_this_process = executed_files()
    hashes = []
    for record in manifest.get(RECORDS, []):
        name, source_hash = _name_and_hash(record, directory)
        path = next((p for p in files_of_this_process if p.name == name), None) or _listed_file(
            source_hash
        )
        if path is None:
            raise ResultsError(
                f"{directory}: the study has code of its own, {name}, which you have not run on "
                f"this machine: it is not executed. Read it ('{RECORDS}' in manifest.json), then "
                f"name a file of yours with squealstudy --extension {name} and the command"
            )
        try:
            hashes.append(load_extension(path))
        except ExtensionError as error:
            raise ResultsError(f"{directory}: {error}") from error
    return tuple(hashes)


def extensions_of_results(manifest: Mapping[str, Any], directory: Path) -> list[tuple[str, bool]]:
    """Names of the extensions that results were made with, and whether commands execute them."""
    names_and_hashes = [_name_and_hash(record, directory) for record in manifest.get(RECORDS, [])]
    return [(name, _listed_file(source_hash) is not None) for name, source_hash in names_and_hashes]


def _name_and_hash(record: Mapping[str, Any], directory: Path) -> tuple[str, str]:
    """Name and hash of a record; ResultsError where they are absent or of wrong form."""
    name, source_hash = record.get("name"), record.get("hash")
    if not isinstance(name, str) or not isinstance(source_hash, str) or not source_hash.isalnum():
        raise ResultsError(f"{directory}: '{RECORDS}' in manifest.json names no file and hash")
    return printable(Path(name).name)[:100], source_hash


def _list_folder() -> Path:
    """Folder of the user's list of extensions, in which nobody else can write."""
    cache_folder = cache_directory()
    return (
        user_cache() if cache_folder.is_dir() and others_may_write(cache_folder) else cache_folder
    ) / LIST_FOLDER


def _listed_file(source_hash: str) -> Path | None:
    """The file of a hash in the user's list: the original, else its copy; None without either."""
    folder = _list_folder() / source_hash
    try:
        entry = unsealed((folder / ENTRY_FILE).read_bytes())
        candidates = [Path(entry["path"]), folder / Path(entry["name"]).name]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    for path in candidates:
        try:
            if hash_of(path) == source_hash:
                return path
        except ExtensionError:
            continue
    return None
