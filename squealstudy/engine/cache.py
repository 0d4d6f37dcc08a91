"""The cache of values that can be made again: folders that appear whole, read as memory maps.

A value is a dataclass or named tuple of arrays, sparse matrices, numbers, texts and other such
values. Large arrays are files of their own; all else, small arrays included, is in one JSON file.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from squealstudy.array_files import read_arrays
from squealstudy.engine.keys import content_hash
from squealstudy.engine.packed_values import array_names, check_classes, packed, unpacked
from squealstudy.faults import named
from squealstudy.files import (
    OF_JSON,
    TEMPORARY,
    abandoned,
    file_hash,
    is_plain_file,
    read_whole,
    sealed,
    temporary_name,
    unsealed,
    write_bytes,
)
from squealstudy.paths import cache_directory
from squealstudy.reduction.prepared import PreparedFamily, PreparedModel
from squealstudy.study.design import DesignPoint

ARRAY = re.compile(r"[^/\\\x00]{1,250}\.npy")
NO_MORE_FILES = (errno.EMFILE, errno.ENFILE)
META, MODELS = "meta.json", "models"
GAPS_SUFFIX = ".npz"  # suffix of files of working points
FORMAT = 4  # number of the format of a folder; values in former formats are made again
MOST_PAST, LEAST_MESH_DOF = 30, 1000  # past reductions to look at: how many, and their least size
PROJECTION_S = "projection_s"  # key in the timings of a reduction on the basis of a range
FEWEST_KEPT_GAPS = 16  # a working point with fewer gaps is solved sooner than read
Prepared = PreparedModel | PreparedFamily


# -- values in folders ---------------------------------------------------------------------------
_verified: dict[Path, list[tuple[int, int]]] = {}  # sizes and times of files whose hashes are right


def is_whole(folder: Path) -> bool:
    """Whether a folder holds a value as it was written, of classes that values may have.

    Its files are read once in a process; later only their sizes and times are compared. A folder
    that is whole counts as used (`touched`).
    """
    try:
        if not is_plain_file(folder / META):
            return False
        meta = unsealed(read_whole(folder / META, OF_JSON))
        if not all(map(ARRAY.fullmatch, meta["files"])):
            return False
        files = {folder / name: sha256 for name, sha256 in meta["files"].items()}
        if not all(map(is_plain_file, files)):  # a device might never end
            return False
        sizes_and_times = [
            (p.stat().st_size, p.stat().st_mtime_ns) for p in (folder / META, *files)
        ]
        if _verified.get(folder) != sizes_and_times:
            if meta["format"] != FORMAT or any(file_hash(p) != h for p, h in files.items()):
                return False
            check_classes(meta["value"])
            if not array_names(meta["value"]) <= set(meta["files"]):
                return False
            unpacked(meta["value"], folder, thoroughly=True)
            _verified[folder] = sizes_and_times
    except OSError as error:
        if error.errno in NO_MORE_FILES:  # a limit of the process or machine, not the value's fault
            raise
        return False
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError):
        return False  # a file may hold anything
    _touch(folder)
    return True


def save_value(folder: Path, value: Any) -> None:
    """Write a value to a folder of the cache, which appears whole or not at all."""
    arrays: dict[str, np.ndarray] = {}
    content = packed(value, "", arrays)
    check_classes(content)
    with _appearing(folder) as temporary:
        for name, array in arrays.items():
            np.save(temporary / f"{name}.npy", array, allow_pickle=False)
        hashes = {p.name: file_hash(p) for p in sorted(temporary.iterdir())}
        meta = sealed({"format": FORMAT, "value": content, "files": hashes})
        (temporary / META).write_text(meta, encoding="utf-8")
    _touch(folder)


def discard(folder: Path) -> None:
    """Remove the folder of a value that turned out to be wrong, if it exists."""
    _remove_links(folder)
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _appearing(folder: Path) -> Iterator[Path]:
    """Give a new directory to fill, which then takes the place of a value's folder."""
    with named(folder):
        _remove_links(folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        remove_abandoned(folder.parent)
        temporary = temporary_name(folder)
        temporary.mkdir()
        yield temporary
        try:
            temporary.rename(folder)
        except OSError:  # another run was faster, or a damaged or unfinished folder is in the way
            if is_whole(folder):
                shutil.rmtree(temporary, ignore_errors=True)
            else:
                shutil.rmtree(folder, ignore_errors=True)
                temporary.rename(folder)


def _links(folder: Path) -> list[Path]:
    """Links among a folder and its parents below the folder of models, which itself may be one."""
    root = cache_directory() / MODELS
    if not folder.is_relative_to(root):
        return []
    return [
        p
        for p in (folder, *folder.parents)
        if p != root and p.is_relative_to(root) and p.is_symlink()
    ]


def _remove_links(folder: Path) -> None:
    """Remove links on the way to a folder, so that nothing is written outside the cache."""
    for link in _links(folder):
        link.unlink(missing_ok=True)


def remove_abandoned(folder: Path) -> None:
    """Remove unfinished files in a folder whose processes have ended."""
    for path in filter(abandoned, folder.glob(TEMPORARY)):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def load_value(folder: Path) -> Any:
    """Read a value; its arrays are read-only memory maps, which all workers share.

    Raises
    ------
    OSError
        Where the value is missing, or not as it was written.
    """
    if not is_whole(folder):
        raise OSError(f"{folder}: not as it was written; the next run makes it again")
    return unpacked(unsealed(read_whole(folder / META, OF_JSON))["value"], folder)


# -- other machines --------------------------------------------------------------------------------
_watching: list[set[Path]] = []


@contextmanager
def touched() -> Iterator[set[Path]]:
    """Collect folders of values and files of working points that are used inside this context."""
    paths: set[Path] = set()
    _watching.append(paths)
    try:
        yield paths
    finally:
        _watching.remove(paths)


def _touch(path: Path) -> None:
    for watched in _watching:
        watched.add(path)


def folders_of(key: str) -> list[Path]:
    """Whole folders of a key: first its prepared model's, then those of values made of that."""
    model_folder = prepared_path(key)
    folders = [model_folder, *sorted(p.parent for p in model_folder.glob(f"[!.]*/[!.]*/{META}"))]
    return [folder for folder in folders if is_whole(folder)]


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes by file name of the folder of a value, or of a file of working points."""
    files = [folder] if folder.is_file() else [p for p in folder.iterdir() if p.is_file()]
    return {file.name: file.read_bytes() for file in files}


def keep_contents(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write into this cache the files that `contents` read in another one.

    Raises
    ------
    OSError
        Where the value is not as it was written, or a path leads out of the folder of models.
    """
    inside = not {"..", "."} & set(folder.parts) and all(Path(n).name == n for n in files)
    if not (inside and folder.is_relative_to(cache_directory() / MODELS)):
        raise OSError(f"{folder}: not of the cache")
    if folder.suffix == GAPS_SUFFIX:
        for name, content in files.items():
            if hashlib.sha256(content).hexdigest() == Path(name).stem:
                _remove_links(folder.parent)
                write_bytes(folder.with_name(name), content)
        return
    if is_whole(folder):
        return
    with _appearing(folder) as temporary:
        for name, content in files.items():
            (temporary / name).write_bytes(content)
        if not is_whole(temporary):
            shutil.rmtree(temporary, ignore_errors=True)
            raise OSError(f"{folder}: not as it was written")


# -- prepared models -----------------------------------------------------------------------------
def prepared_path(key: str) -> Path:
    """Folder of the prepared model of a key, whether it exists or not."""
    return cache_directory() / MODELS / key


def is_prepared(key: str) -> bool:
    """Whether the cache holds the prepared model of a key, whole."""
    return bool(key) and is_whole(prepared_path(key))


def save_prepared(key: str, prepared: Prepared) -> None:
    """Write the prepared model of a structure or of a family of matrices to the cache."""
    save_value(prepared_path(key), prepared)


def load_any(key: str) -> Prepared:
    """Read the prepared model of a key: that of a structure or of a family of matrices."""
    prepared: Prepared = load_value(prepared_path(key))
    return prepared


def load_prepared(key: str) -> PreparedModel:
    """Read the prepared model of a structure; TypeError where the key is a family's."""
    prepared = load_any(key)
    if not isinstance(prepared, PreparedModel):
        raise TypeError(f"{key} is a family of matrices")
    return prepared


def past_reductions() -> list[tuple[int, float]]:
    """Degrees of freedom and seconds of the last reductions that the cache holds.

    Among the last MOST_PAST prepared models only those reduced from a mesh count. Only the JSON
    files are read.
    """
    folders = (cache_directory() / MODELS).glob(f"[!.]*/{META}")
    last = sorted((p for p in folders if is_plain_file(p)), key=lambda p: -p.stat().st_mtime)
    times = []
    for path in last[:MOST_PAST]:
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            fields = unsealed(read_whole(path, OF_JSON))["value"]["fields"]
            seconds, n_dof = fields["timings"]["mapping"], int(fields["n_dof"])
            if n_dof >= LEAST_MESH_DOF and PROJECTION_S not in seconds:
                times.append((n_dof, float(sum(seconds.values()))))
    return times


@lru_cache(maxsize=4)
def prepared_any(key: str) -> Prepared:
    """Like `load_any`, but the last few are read only once in a process."""
    return load_any(key)


@lru_cache(maxsize=4)
def prepared_model(key: str) -> PreparedModel:
    """Like `load_prepared`, but the last few are read only once in a process."""
    return load_prepared(key)


# -- working points, for later studies of the same model ----------------------------------------
@lru_cache(maxsize=4)
def _gaps(key: str) -> dict[str, np.ndarray]:
    """Gaps of working points of a structure that the cache has, by the key of the point."""
    gap_of: dict[str, np.ndarray] = {}
    if _links(_gap_folder(key)):  # files there may be anybody's
        return gap_of
    for file in sorted(_gap_folder(key).glob(f"[!.]*{GAPS_SUFFIX}")):
        with contextlib.suppress(ValueError, KeyError, OSError, TypeError):
            content = read_whole(file) if is_plain_file(file) else b""
            if hashlib.sha256(content).hexdigest() != file.stem:
                file.unlink(missing_ok=True)  # damaged, or named otherwise by another version
                continue
            arrays = read_arrays(io.BytesIO(content))
            keys, gaps = arrays["keys"], arrays["gaps"]
            if gaps.ndim == 2 and gaps.dtype == float and np.isfinite(gaps).all():
                gap_of.update(zip(keys.tolist(), gaps, strict=True))
    return gap_of


def _gap_folder(key: str) -> Path:
    return prepared_path(key) / "working_points"


def known_gap(key: str, design: DesignPoint) -> np.ndarray | None:
    """Gaps (nc,) [m] of the design's working point; None where no study has solved it before."""
    return _gaps(key).get(working_point_key(design)) if design.has_working_point else None


class NewGaps:
    """Working points that one chunk has solved, to be written for later studies."""

    def __init__(self) -> None:
        self._found: dict[str, dict[str, np.ndarray]] = {}

    def add(self, key: str, design: DesignPoint, gap: np.ndarray) -> None:
        """Add the gaps (nc,) [m] of a design's working point, if reading it would save time."""
        if design.has_working_point and len(gap) >= FEWEST_KEPT_GAPS:
            self._found.setdefault(key, {})[working_point_key(design)] = gap

    def save(self) -> None:
        """Write the gaps to the cache, in files that are named by hashes of their contents."""
        for key, gaps in self._found.items():
            content = io.BytesIO()
            np.savez(content, keys=np.array(list(gaps)), gaps=np.stack(list(gaps.values())))
            name = hashlib.sha256(content.getvalue()).hexdigest()
            _remove_links(_gap_folder(key))
            remove_abandoned(_gap_folder(key))
            write_bytes(_gap_folder(key) / f"{name}{GAPS_SUFFIX}", content.getvalue())
            _touch(_gap_folder(key) / f"{name}{GAPS_SUFFIX}")
            _gaps(key).update(gaps)


def working_point_key(design: DesignPoint) -> str:
    """Hash of all that a working point depends on beside its structure."""
    state = design.state()
    op = state.operating
    return content_hash(
        [
            [x if isinstance(x, str) else x.hex() for x in op.sliding_friction],
            float(op.brake_pressure).hex(),
            op.law.kind,
            [x.hex() for x in op.law.parameters],
            sorted((c, j, float(s).hex()) for (c, j), s in state.frequency_scale.items() if s != 1),
        ]
    )
