"""Entries of a cache that others wrote or that changed: made again, never followed or executed."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import scipy.sparse as sp

from squealstudy.engine import cache, packed_values
from squealstudy.files import file_hash, sealed
from squealstudy.kinds.complex_modes import reduction_errors
from squealstudy.kinds.transient import preparation
from squealstudy.models.matrices.family import FamilyTerm
from squealstudy.motion.shared_modes import Training
from squealstudy.reduction.contact_space import ContactRows

SECRET = "not yours"
MANY = packed_values.MOST_INLINE + 1
TRAINING = Training(np.eye(2), np.eye(2, dtype=complex))


@pytest.fixture
def entry(tmp_path) -> Path:
    eye, many = sp.eye(MANY).tocsr(), np.arange(MANY)
    value = ContactRows(eye, eye, many, np.eye(3), many[:3])  # the latter stand in the JSON file
    cache.save_value(tmp_path / "entry", value)
    assert cache.is_whole(tmp_path / "entry")
    return tmp_path / "entry"


def meta(entry: Path) -> dict:
    return json.loads((entry / cache.META).read_text())


def write(entry: Path, content: dict) -> None:
    (entry / cache.META).write_text(sealed(content))
    os.utime(entry / cache.META, ns=(1, hash(str(content)) % 10**9))
    cache._verified.clear()


def test_a_value_of_arrays_and_matrices_is_read(entry):
    found = cache.load_value(entry)
    assert found.normal.tolist() == list(range(MANY))
    assert (sp.eye(MANY) != found.S_N).nnz == 0
    assert sorted(p.stem for p in entry.glob("*.npy") if "." not in p.stem) == ["normal"]
    for array, expected in ((found.Z, np.eye(3)), (found.sliding, np.arange(3))):
        assert array.dtype == expected.dtype
        assert not array.flags.writeable
        np.testing.assert_array_equal(array, expected)


@pytest.mark.parametrize(
    "array",
    [
        np.array([0.1, -0.0, 1e-320, np.pi, -1e308]),
        np.array([2**62, -3]),
        np.array([[True, False]]),
        np.zeros((0, 4)),
        np.array(2.5),
        np.array([1, 2], np.int32),
        np.array([np.nan, np.inf]),
        np.array([1j]),
        np.array([0.1], np.float32),
    ],
)
def test_small_arrays_are_kept_to_the_last_bit(tmp_path, array):
    cache.save_value(tmp_path / "entry", (array,))
    (found,) = cache.load_value(tmp_path / "entry")
    assert found.dtype == array.dtype
    assert found.shape == array.shape
    assert found.tobytes() == array.tobytes()


@pytest.mark.parametrize("name", ["../secret.npy", "/dev/zero", "a/b.npy", "x.npy\x00", "y.pkl"])
def test_names_outside_the_folder_are_not_read(entry, name):
    content = meta(entry)
    content["files"][name] = "00"
    write(entry, content)
    assert not cache.is_whole(entry)


def test_arrays_that_are_no_files_of_the_entry_are_not_read(entry):
    np.save(entry.parent / "other.npy", np.arange(3))
    content = meta(entry)
    content["value"]["fields"]["normal"] = {"array": "../other"}
    write(entry, content)
    assert not cache.is_whole(entry)


def test_a_link_to_a_device_is_not_read(entry):
    (entry / "normal.npy").unlink()
    (entry / "normal.npy").symlink_to("/dev/zero")
    cache._verified.clear()
    assert not cache.is_whole(entry)


WRONG = [
    {"class": "os.system", "fields": {}},
    {"class": "squealstudy.reduction.contact_space.ContactRows", "fields": {"x": 1}},
    {"class": "squealstudy.reduction.contact_space.ContactRows", "fields": []},
    {"csr": [1, 2, 3], "shape": [3, 3]},
    {"tuple": 3},
    {"mapping": []},
    {"array": 5},
    {"entries": [1.0], "type": "O", "shape": [1]},
    {"entries": [1.0], "type": "f8", "shape": [2]},
    {"entries": ["x"], "type": "f8", "shape": [1]},
    {"entries": [[1.0], [1.0, 2.0]], "type": "f8", "shape": [3]},
    {"entries": [1.0], "shape": [1]},
    {},
]


@pytest.mark.parametrize("value", WRONG)
def test_sealed_values_that_are_none_are_made_again(entry, value):
    write(entry, meta(entry) | {"value": value})
    assert not cache.is_whole(entry)
    with pytest.raises(OSError, match="not as it was written"):
        cache.load_value(entry)


def test_indices_that_lead_out_of_a_matrix_are_refused(entry):
    """Compiled code follows them into memory of others."""
    file = entry / "S_N.indices.npy"
    indices = np.load(file)
    indices[1] = 10**6
    np.save(file, indices)
    content = meta(entry)
    content["files"][file.name] = file_hash(file)
    write(entry, content)
    assert not cache.is_whole(entry)


def test_pickles_are_not_read(entry):
    file = entry / "normal.npy"
    np.save(file, np.array([Executed()], dtype=object), allow_pickle=True)
    content = meta(entry)
    content["files"][file.name] = file_hash(file)
    write(entry, content)
    assert not cache.is_whole(entry)
    assert not Path(MARK).exists()


MARK = "executed_by_a_pickle"


class Executed:
    def __reduce__(self):
        return (open, (MARK, "w"))


def test_working_points_that_are_none_are_passed_over(monkeypatch, tmp_path):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    folder = cache._gap_folder("k")
    folder.mkdir(parents=True)
    good, nan, text = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez(good, keys=np.array(["a"]), gaps=np.ones((1, 2)))
    np.savez(nan, keys=np.array(["b"]), gaps=np.full((1, 2), np.nan))
    np.savez(text, keys=np.array(["c"]))
    pickled = pickle.dumps(Executed())
    for content in (good.getvalue(), nan.getvalue(), text.getvalue(), pickled, b"no archive"):
        (folder / f"{hashlib.sha256(content).hexdigest()}.npz").write_bytes(content)
    cache._gaps.cache_clear()
    assert list(cache._gaps("k")) == ["a"]
    assert not Path(MARK).exists()


@pytest.fixture
def theirs(monkeypatch, tmp_path) -> Path:
    """A folder of somebody's arrays, beside a cache in which others can write."""
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    folder = tmp_path / "theirs"
    (folder / "working_points").mkdir(parents=True)
    for place in (folder, folder / "working_points"):
        np.savez(place / "thesis.npz", x=np.arange(3))
    cache._gaps.cache_clear()
    return folder


@pytest.mark.parametrize("level", ["model", "working_points"])
def test_links_in_a_cache_remove_and_write_nothing_elsewhere(theirs, level):
    """Files of working points that are none are removed, but not where a link leads."""
    before = sorted(theirs.rglob("*"))
    model = cache.prepared_path("k")
    link = model if level == "model" else cache._gap_folder("k")
    link.parent.mkdir(parents=True)
    link.symlink_to(theirs, target_is_directory=True)
    assert cache._gaps("k") == {}
    assert sorted(theirs.rglob("*")) == before
    new = cache.NewGaps()
    new._found = {"k": {"a": np.ones(2)}}
    new.save()
    assert sorted(theirs.rglob("*")) == before
    cache._gaps.cache_clear()
    assert list(cache._gaps("k")) == ["a"]
    if level == "model":
        cache._remove_links(model)
        shutil.rmtree(model)
        model.symlink_to(theirs, target_is_directory=True)
        eye, rows = sp.eye(3).tocsr(), np.arange(3)
        cache.save_value(model / "value", ContactRows(eye, eye, rows, rows, rows))
        assert sorted(theirs.rglob("*")) == before
        assert cache.is_whole(model / "value")


def test_a_working_point_file_without_end_is_passed_over(theirs):
    folder = cache._gap_folder("k")
    folder.mkdir(parents=True)
    (folder / f"{'0' * 64}.npz").touch()
    os.truncate(folder / f"{'0' * 64}.npz", 2**42)
    assert cache._gaps("k") == {}


ROOTS, ERRORS = np.array([-1 + 5j, 1 + 5j]), np.array([0.1, 0.2])
NO_ERRORS = {
    "number": (1e308, ERRORS),
    "texts": (ROOTS, ERRORS.astype(str)),
    "complex": (ROOTS, ERRORS.astype(complex)),
    "shape": (ROOTS, ERRORS[None]),
    "shorter": (ROOTS[:1], ERRORS),
    "real": (ROOTS.real, ERRORS),
}


@pytest.mark.parametrize("case", list(NO_ERRORS))
def test_errors_of_a_reduction_that_are_none_are_made_again(monkeypatch, tmp_path, case):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    path = cache.prepared_path("k") / "reduction_errors" / "a"
    task = reduction_errors.ReductionErrorTask(mock.MagicMock(), (1.0, 2.0), path)
    assert task.read() is None
    cache.save_value(path, reduction_errors.ReductionErrors(*NO_ERRORS[case]))
    assert cache.is_whole(path)
    assert task.read() is None
    for name in ("prepared_model", "relative_errors", "solve_point"):
        monkeypatch.setattr(reduction_errors, name, mock.MagicMock())
    reduction_errors.solve_point.return_value.lam = ROOTS
    reduction_errors.relative_errors.return_value = ERRORS
    reduction_errors.solve_sample(task)
    assert task.read().relative.tolist() == ERRORS.tolist()


@pytest.mark.parametrize("value", [1e308, ("a", 1.0), (TRAINING, "x"), (TRAINING, float("inf"))])
def test_a_training_that_is_none_is_made_again(monkeypatch, tmp_path, value):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path))
    folder = cache.prepared_path("k") / "training"
    monkeypatch.setattr(preparation, "training_path", lambda plan, key: folder)
    cache.save_value(folder, value)
    plan = mock.MagicMock(structures=["k"])
    assert preparation.training_seconds(plan) == 0.0
    monkeypatch.setattr(preparation, "training_run", lambda plan, key: TRAINING)
    preparation.make_training_runs(plan, lambda *told: None)
    assert preparation.training_seconds(plan) > 0.0


@pytest.mark.parametrize("damage", ["flip", "cut", "empty", "swap"])
def test_changed_files_are_noticed(entry, damage):
    file = entry / "normal.npy"
    content = bytearray(file.read_bytes())
    if damage == "flip":
        content[-1] ^= 4
    elif damage == "swap":
        content = bytearray((entry / "S_N.indices.npy").read_bytes())
    else:
        del content[0 if damage == "empty" else -3 :]
    file.write_bytes(bytes(content))
    cache._verified.clear()
    assert not cache.is_whole(entry)


def test_another_version_is_made_again(entry):
    write(entry, meta(entry) | {"format": cache.FORMAT - 1})
    assert not cache.is_whole(entry)


def test_classes_of_values_are_those_of_the_package():
    assert f"{FamilyTerm.__module__}.FamilyTerm" in packed_values.CLASSES


# -- the directory in which a command is run ----------------------------------------------------
SCRIPT = """\
from multiprocessing import get_context
from squealstudy.machine.processes import starting_processes
if __name__ == "__main__":
    with starting_processes():
        worker = get_context("spawn").Process(target=print, args=(1,))
        worker.start()
    worker.join()
"""
# what `python -m` imports before it reads the package: nothing of ours runs before that
BEFORE_US = {
    *("collections", "contextlib", "functools", "importlib", "keyword", "operator", "reprlib"),
    *("types", "warnings"),
}
HOSTILE = sys.stdlib_module_names | {"numpy", "pandas", "pydantic", "typer", "numba", "rich"}


@pytest.mark.parametrize("way", ["-m", "script"])
def test_modules_in_the_current_directory_are_not_imported(way, tmp_path):
    """A folder of a colleague may hold a file that is called as a module of Python."""
    for name in HOSTILE - BEFORE_US:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'a').close()")
    script = tmp_path / "elsewhere" / "command.py"  # a program that starts worker processes
    script.parent.mkdir()
    script.write_text(SCRIPT)
    given = ["-m", "squealstudy", "--help"] if way == "-m" else [str(script)]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    environment.pop("PYTHONSAFEPATH", None)
    done = subprocess.run(
        [sys.executable, *given],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ("COMMAND" if way == "-m" else "1") in done.stdout, done.stderr
    assert not (tmp_path / "executed").exists(), done.stderr


def test_a_package_in_the_current_directory_is_found_there(tmp_path):
    """Of a copy of the sources, that of their folder; other modules beside it come last."""
    (tmp_path / "squealstudy").symlink_to(Path(__file__).parents[2] / "squealstudy")
    (tmp_path / "numpy.py").write_text("raise SystemExit('executed')")
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    code = "import sys; sys.argv = ['-m']; sys.orig_argv = ['python', '-m', 'squealstudy']; "
    code += "import squealstudy, numpy; print(squealstudy.__path__)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout, done.stderr


def test_a_program_that_imports_the_package_keeps_its_own_directory(tmp_path):
    """`python -m theirs.main`, whose package imports ours first and a module beside it then."""
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "__init__.py").write_text("import squealstudy\n")
    (tmp_path / "theirs" / "main.py").write_text("import beside\n")
    (tmp_path / "beside.py").write_text("print('found')\n")
    done = subprocess.run(
        [sys.executable, "-m", "theirs.main"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "found\n", done.stderr
