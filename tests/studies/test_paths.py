"""Caches that cannot be written or that others may write to, as a user without root's rights."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pandas as pd
import pytest
from fault_runs import GOES_ON, RUN, STUDY, is_one_sentence
from study_runs import comparable, solved

from squealstudy import paths

NO_RIGHTS = "-dac_override,-dac_read_search,-fowner,-chown"
owners = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="NOT TRIED HERE: needs owners")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "study.toml").write_text(STUDY)
    monkeypatch.chdir(tmp_path)
    for name in (paths.COMPILED, "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    return tmp_path


def run(cache: Path | None, *arguments: str, **changes: str) -> subprocess.CompletedProcess[str]:
    """The command of a user whom permissions bind, root here or not."""
    environment = {k: v for k, v in os.environ.items() if k not in changes} | {
        k: v for k, v in changes.items() if v
    }
    environment[paths.ENVIRONMENT] = str(cache or "")
    command = [sys.executable, "-m", "squealstudy", *arguments]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("NOT TRIED HERE: root ignores permissions, and there is no setpriv")
        command = ["setpriv", "--inh-caps=-all", f"--bounding-set={NO_RIGHTS}", *command]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)


def made(folder: Path, kind: str) -> Path:
    cache = folder / "cache"
    if kind == "a file":
        cache.write_text("")
    elif kind == "below a file":
        (folder / "file").write_text("")
        cache = folder / "file" / "cache"
    elif kind == "read-only":
        cache.mkdir(mode=0o555)
    return cache


@owners
@pytest.mark.parametrize(
    "kind",
    [
        *(pytest.param(k, marks=pytest.mark.full_size) for k in ("a file", "below a file")),
        "read-only",
    ],
)
def test_a_cache_that_cannot_be_written_is_one_warning(folder: Path, kind: str) -> None:
    cache = made(folder, kind)
    done = run(cache, *RUN, "out")
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert len(told) == 1
    assert f"the cache cannot be written ({cache}: " in told[0]
    solved(STUDY, folder / "undisturbed")
    for a, b in zip(comparable(folder / "out"), comparable(folder / "undisturbed"), strict=True):
        pd.testing.assert_frame_equal(a, b)


@pytest.mark.full_size  # by default a cache that cannot be written: above
@owners
def test_no_home_is_a_warning(folder: Path) -> None:
    """Nobody's number in no list of users: where there is root, in a namespace of users."""
    program = shutil.which("unshare")
    spaced = [program or "", "--user", "--map-user=54321", "--map-group=54321"]
    if program is None or subprocess.run([*spaced, "true"], capture_output=True).returncode:
        pytest.skip("NOT TRIED HERE: a user without a home needs unshare")
    environment = {k: v for k, v in os.environ.items() if k not in ("HOME", paths.ENVIRONMENT)}
    command = [*spaced, sys.executable, "-m", "squealstudy", *RUN, "out"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "warning: the cache cannot be written (~/.cache: " in done.stderr


@owners
def test_a_results_directory_without_permission(folder: Path) -> None:
    (folder / "results").mkdir(mode=0o555)
    is_one_sentence(run(folder / "cache", *RUN, "results/out"), "permission denied", GOES_ON)


# -- compiled kernels, whose loading executes them ------------------------------------------------
@owners
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o757])
def test_kernels_are_not_kept_where_others_write(
    folder: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    shared = folder / "shared"
    shared.mkdir()
    if os.geteuid() == 0:
        os.chown(shared, -1, 12345)
    elif mode == 0o770:
        pytest.skip("NOT TRIED HERE: another group needs root")
    shared.chmod(mode)
    monkeypatch.setenv(paths.ENVIRONMENT, str(shared))
    with pytest.warns(UserWarning, match=f"{shared}/kernels: others may write there"):
        assert paths.compiled_base() == folder / "home" / ".cache" / "squealstudy" / "kernels"
    assert paths.compiled_base().stat().st_mode & 0o077 == 0
    monkeypatch.setenv(paths.COMPILED, "")  # undo what workers inherit


@owners
def test_kernels_of_another_owner_are_not_loaded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if os.geteuid() != 0:
        pytest.skip("NOT TRIED HERE: another owner needs root")
    theirs = folder / "theirs" / "kernels"
    theirs.mkdir(parents=True, mode=0o755)
    os.chown(theirs, 12345, 12345)
    assert paths.others_may_write(theirs)
    os.chown(theirs.parent, 12345, 12345)
    os.chown(theirs, 0, 0)
    assert paths.others_may_write(theirs)  # who could put another in its place
    os.chown(theirs.parent, 0, 0)
    assert not paths.others_may_write(theirs)


@owners
def test_nowhere_to_keep_kernels_is_a_temporary_directory(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "home").write_text("")
    monkeypatch.setenv(paths.COMPILED, str(folder / "home" / "kernels"))
    with pytest.warns(UserWarning, match="a part of the path is a file"):
        base = paths.compiled_base()
    assert os.environ[paths.COMPILED] == str(base)
    assert base.is_dir()
    assert not paths.others_may_write(base)
    base.rmdir()


def test_kernels_of_this_session_are_where_the_rule_says() -> None:
    from squealstudy.kernels import jit

    assert Path(numba.config.CACHE_DIR).parent == paths.compiled_base()
    assert jit.compiled_directory().parent == paths.compiled_base()
