"""What the machine refuses: one sentence, exit code 1, what is finished is kept."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import scipy.sparse as sp
from fault_runs import GOES_ON, RUN, STUDY, is_one_sentence
from study_runs import command, comparable, solved

from squealstudy import faults
from squealstudy.errors import ConvergenceError, MachineError, SquealstudyError
from squealstudy.kinds.complex_modes import stored_shapes
from squealstudy.linalg import factor

needs_limits = pytest.mark.skipif(sys.platform == "win32", reason="NOT TRIED HERE: needs ulimit")
needs_dev_full = pytest.mark.skipif(
    not Path("/dev/full").is_char_device(), reason="NOT TRIED HERE: needs /dev/full"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def small_disk(folder: Path) -> Iterator[Path]:
    """A file system of 24 kB, on which a run does not find room for its tables."""
    place = folder / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=24k", "none", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("NOT TRIED HERE: a full disk needs root, to mount a small one")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def shell(before: str, *arguments: str, after: str = "") -> subprocess.CompletedProcess[str]:
    """The command in a shell of its own, `before` which a limit is set."""
    words = " ".join([f"'{sys.executable}' -m squealstudy", *arguments])
    return subprocess.run(
        ["bash", "-c", f"{before} {words} {after}"], capture_output=True, text=True, timeout=120
    )


def goes_on_to_the_same_tables(folder: Path, directory: Path) -> None:
    assert command(*RUN, str(directory)) == 0
    solved(STUDY, folder / "undisturbed")
    for a, b in zip(comparable(directory), comparable(folder / "undisturbed"), strict=True):
        pd.testing.assert_frame_equal(a, b)
    assert not list(directory.rglob("*.tmp"))


# -- disks ----------------------------------------------------------------------------------------
def test_a_full_disk(folder: Path, small_disk: Path) -> None:
    is_one_sentence(shell("", *RUN, "disk/out"), "disk/out", "the disk is full", GOES_ON)
    subprocess.run(["mount", "-o", "remount,size=4m", str(small_disk)], check=True)
    assert list((small_disk / "out" / "chunks").iterdir())
    goes_on_to_the_same_tables(folder, small_disk / "out")


@pytest.mark.parametrize(
    "line",
    [
        "plot out -o disk/new",
        pytest.param("report out -o disk/new.html", marks=pytest.mark.full_size),
        "export study.toml -o disk/new",
    ],
)
def test_other_commands_leave_nothing_half_written(
    folder: Path, small_disk: Path, line: str
) -> None:
    if not line.startswith("export"):
        solved(STUDY, folder / "out")
    (small_disk / "others").write_bytes(bytes(24_000))
    is_one_sentence(shell("", *line.split()), "disk/new", "the disk is full")
    assert [path.name for path in small_disk.rglob("*") if path.is_file()] == ["others"]


@pytest.mark.full_size
@needs_limits
def test_a_limit_of_file_size(folder: Path) -> None:
    done = shell("ulimit -f 4;", *RUN, "out")
    is_one_sentence(done, "may not become that large", "ulimit -f", GOES_ON)
    goes_on_to_the_same_tables(folder, folder / "out")


@needs_dev_full
@pytest.mark.parametrize("verb", [pytest.param("schema", marks=pytest.mark.full_size), "models"])
def test_a_screen_that_cannot_be_written(verb: str) -> None:
    is_one_sentence(shell("", verb, after="> /dev/full"), "the disk is full")


@needs_limits
@pytest.mark.parametrize("after", ["| true; exit ${PIPESTATUS[0]}", ">&-", "2>&-"])
def test_a_reader_that_is_gone_is_no_error(after: str) -> None:
    done = shell("", "models", after=after)
    assert (done.returncode, done.stderr) == (0, "")


@needs_dev_full
@pytest.mark.parametrize("buffer", [0, 4096])  # refused as it is written, as it is closed
def test_shapes_leave_nothing_on_a_full_disk(folder: Path, buffer: int) -> None:
    writer = stored_shapes.ShapeWriter(folder)
    writer._file.close()
    full = Path("/dev/full").open("wb", buffer)  # noqa: SIM115 - the writer closes it
    writer._file = full
    with pytest.raises(OSError, match=str(folder)) as caught:  # noqa: PT012 - by either
        writer.write(pa.chunked_array([pa.array([b"12345678"])]))
        writer.close(np.arange(1), np.ones(1))
    assert caught.value.errno == errno.ENOSPC
    assert not list(folder.glob(".*.tmp"))


# -- limits ---------------------------------------------------------------------------------------
def one_by_one(path: Path) -> None:
    """Have a study solved by a method that makes no batches: it needs the cache, and workers."""
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("[modes]", '[modes]\nmethod = "full"'), encoding="utf-8")


@pytest.mark.full_size  # by default a full disk: above
@needs_limits
def test_too_many_open_files(folder: Path) -> None:
    one_by_one(folder / "study.toml")
    done = shell("ulimit -n 6;", *RUN, "out")
    is_one_sentence(done, "too many files are open", "ulimit -n")


@needs_limits
def test_no_memory_that_processes_share(folder: Path) -> None:
    """Where /dev/shm is full or not there, no worker can start."""
    one_by_one(folder / "study.toml")
    (folder / "fails.py").write_text(
        "import _multiprocessing\n"
        "def refused(*_, **__): raise OSError(28, 'No space left on device')\n"
        "refused.SEM_VALUE_MAX = 1\n"
        "_multiprocessing.SemLock = refused\n"
        "from squealstudy.engine import model_kind\n"
        "model_kind.WORKER_START_WORTH_S = 0.0\n"
        "import sys; from squealstudy.cli.app import main\n"
        "sys.argv = ['squealstudy', 'run', 'study.toml', '-j', '2', '-o', 'out']; main()\n"
    )
    done = subprocess.run([sys.executable, "fails.py"], capture_output=True, text=True)
    is_one_sentence(done, "/dev/shm", "--jobs 1")


@needs_limits
def test_a_current_directory_that_was_removed(folder: Path) -> None:
    (folder / "gone").mkdir()
    path = str(folder / "study.toml")
    done = shell("cd gone; rmdir ../gone;", "run", path, "--no-pictures")
    is_one_sentence(done, "results")


# -- sentences ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("error", "text"),
    [
        (OSError(errno.ENOSPC, "x", "a/b"), "a/b: the disk is full"),
        (OSError(errno.EDQUOT, "x", "a/b"), "a/b: your quota"),
        (OSError(errno.EACCES, "x", "a/b"), "a/b: permission denied"),
        (OSError(errno.EROFS, "x", "a/b"), "a/b: the disk is read-only"),
        (OSError(errno.EEXIST, "x", "a/b"), "a/b: there is a file already"),
        (OSError(errno.EBUSY, "x", "a/b"), f"a/b: {os.strerror(errno.EBUSY)}"),
        (OSError("80 requested and 8 written"), "the disk is full"),
        (FileNotFoundError(errno.ENOENT, "No usable temporary directory found in []"), "TMPDIR"),
        (MemoryError(), "memory ran out"),
        (RuntimeError("can't start new thread"), "no more processes or threads"),
        (ImportError("x.so: failed to map segment from shared object"), "memory ran out"),
        (RuntimeError("a mistake of ours"), None),
        (ValueError("10 requested and 8 found"), None),
        (UnicodeEncodeError("utf-8", "a\udcc3b", 1, 2, "surrogates not allowed"), r"a\udcc3b: its"),
        (UnicodeEncodeError("ascii", "é", 0, 1, "ordinal not in range(128)"), None),
        (BrokenPipeError(errno.EPIPE, "x"), None),
        (SquealstudyError("told already: Too many open files"), None),
    ],
)
def test_what_the_machine_refuses_has_a_sentence(error: Exception, text: str | None) -> None:
    found = faults.sentence(error)
    assert found is None if text is None else found is not None and text in found


def test_the_file_is_named_not_the_temporary_one() -> None:
    with (
        pytest.raises(MachineError, match=r"^out/points.parquet: the disk is full.*; go on$"),
        faults.told("; go on"),
        faults.named(Path("out/points.parquet")),
    ):
        raise OSError(errno.ENOSPC, "no space", ".points.parquet.1234.tmp")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("SUPERLU_MALLOC fails for buf in intMalloc()", MemoryError),
        ("Factor is exactly singular", ConvergenceError),
    ],
)
def test_memory_that_ran_out_is_no_singular_matrix(
    monkeypatch: pytest.MonkeyPatch, text: str, expected: type[Exception]
) -> None:
    """A failed design point is kept; one without memory must be solved again."""

    def fails(_: object) -> None:
        raise RuntimeError(text)

    monkeypatch.setattr(factor, "symmetric_lu", fails)
    with pytest.raises(expected):
        factor.SuperLUFactor(sp.eye(3).tocsr())
