"""Results of others: what their journal and manifest name, links in them, code that they keep."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from study_runs import command, plan_of
from study_texts import study_text, sweep_text

from squealstudy.engine.journal import JOURNAL
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.recorded_code import (
    RECORDS,
    enter_executed,
    execute_recorded,
    extensions_of_results,
    recorded_extensions,
)
from squealstudy.engine.result_names import CHUNKS, LOCK, MANIFEST, SET_ASIDE
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import Store
from squealstudy.errors import MachineError, ResultsError
from squealstudy.extensions import load_extension
from squealstudy.files import sealed

STUDY = study_text("lockin", "complex_modes", "hulten") + sweep_text("friction", 0.0, 0.6, 5)
SECRET = "not yours"


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    directory = tmp_path_factory.mktemp("whole") / "results"
    run_study(plan_of(STUDY), directory, 1)
    return directory


@pytest.fixture
def results(whole, tmp_path) -> Path:
    """A copy beside a folder of somebody else's files."""
    for path in (p for p in whole.rglob("*") if p.is_file()):
        target = tmp_path / "results" / path.relative_to(whole)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    (tmp_path / "outside").mkdir()
    for name in ("a", "b", "0123456789abcdef.parquet", "thesis.png"):
        (tmp_path / "outside" / name).write_text(SECRET)
    return tmp_path / "results"


def outside(results: Path) -> dict[str, str]:
    folder = results.parent / "outside"
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*")}


def run(directory: Path, **given) -> tuple[list[str], object]:
    told: list[str] = []
    return told, run_study(plan_of(STUDY), directory, 1, warn=told.append, **given)


def add_line(results: Path, names: list[str], key: str = "files") -> None:
    said = {name: [len(SECRET), "00"] for name in names} if key == "files" else names
    with (results / JOURNAL).open("a") as journal:
        journal.write(json.dumps({key: said}) + "\n")


def reseal(results: Path, **changes) -> None:
    content = {**(read_manifest(results) or {}), **changes}
    (results / MANIFEST).write_text(sealed(content))


HOSTILE_NAMES = [
    "{outside}/a",
    "../outside/b",
    "chunks/../../outside/b",
    "link/c",
    "notes.txt",
    "chunks/notes.txt",
    "./points.parquet/../../outside/a",
    "modes.parquet\n",
    "C:\\a.parquet",
    "",
]


@pytest.mark.parametrize("key", ["files", "gone"])
@pytest.mark.parametrize("fresh", [False, True])
def test_names_that_no_run_writes_are_neither_moved_nor_removed(results, fresh, key, capsys):
    (results / "link").symlink_to(results.parent / "outside")
    (results / "notes.txt").write_text(SECRET)
    (results / CHUNKS / "notes.txt").write_text(SECRET)
    before = outside(results)
    names = [name.format(outside=results.parent / "outside") for name in HOSTILE_NAMES]
    for name in names:
        add_line(results, [name, "points.parquet"], key)
    store = Store(results)
    assert store.journal.refused == names
    assert "points.parquet" in store.journal.entries  # as the run's own line has it
    command("check", str(results))
    assert "which no run writes here: not touched" in capsys.readouterr().out
    told, _ = run(results, fresh=fresh)
    assert fresh or any("not touched" in text for text in told)
    assert outside(results) == before
    assert (results / "notes.txt").read_text() == SECRET
    assert (results / CHUNKS / "notes.txt").read_text() == SECRET
    assert command("check", str(results)) == 0


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("name", [JOURNAL, MANIFEST, "points.parquet"])
def test_a_file_that_has_another_name_elsewhere_stays_as_it_is(results, name, fresh):
    """As in a backup of hard links, or by malice on a shared disk."""
    kept = results.parent / "outside" / "a"
    content = (results / name).read_bytes()
    kept.write_bytes(content)
    (results / name).unlink()
    os.link(kept, results / name)
    for path in sorted((results / CHUNKS).iterdir()):
        path.unlink()  # so that there is something to do
    run(results, fresh=fresh)
    assert kept.read_bytes() == content
    assert Store(results).faults() == {}


@pytest.mark.parametrize("name", [CHUNKS, "references", SET_ASIDE, "onsets.parquet"])
@pytest.mark.parametrize("fresh", [False, True])
def test_nothing_is_written_or_removed_through_a_link(results, name, fresh):
    add_line(results, [f"{CHUNKS}/0123456789abcdef.parquet"])
    target = results / name
    if target.exists():
        target.rename(results.parent / f"old_{name}")
    target.symlink_to(results.parent / "outside", target_is_directory=True)
    before = outside(results)
    with pytest.raises(ResultsError, match="outside the results directory"):
        run(results, fresh=fresh)
    assert outside(results) == before
    assert target.is_symlink()


@pytest.mark.parametrize("name", [LOCK, JOURNAL, MANIFEST])
def test_own_files_that_are_links_out_are_refused(results, name):
    (results / name).unlink(missing_ok=True)
    (results / name).symlink_to(results.parent / "outside" / "a")
    before = outside(results)
    with pytest.raises((ResultsError, MachineError), match=r"leads to|a link"):
        run(results)
    assert outside(results) == before


@pytest.mark.parametrize("name", [LOCK, "onsets.parquet", CHUNKS])
def test_links_in_a_circle_are_refused(results, name):
    if (results / name).exists():
        (results / name).rename(results.parent / "old")
    (results / name).symlink_to(name)
    with pytest.raises((ResultsError, MachineError), match=r"itself|a link"):
        run(results)
    command("check", str(results))


@pytest.mark.parametrize("values", [[{"a": 1}], [[1, 2]], [b"\xff"], [7], [None]])
def test_a_table_that_is_none_of_its_kind_is_told_by_check(results, values, capsys):
    path = results / "points.parquet"
    table = pq.read_table(path)
    place = table.schema.get_field_index("status")
    forged = pa.array(values * table.num_rows)
    pq.write_table(table.set_column(place, "status", forged), path)
    entry = [path.stat().st_size, hashlib.sha256(path.read_bytes()).hexdigest()]
    with (results / JOURNAL).open("a") as journal:
        journal.write(json.dumps({"files": {path.name: entry}}) + "\n")
    assert command("check", str(results)) == 1
    told = capsys.readouterr().out
    assert "points.parquet: column 'status' holds" in told
    assert "5 ok" in told  # by the chunks


def test_check_says_what_would_be_executed_where_that_is_nothing(results, capsys):
    command("check", str(results))
    assert "none of its own: no command executes anything" in capsys.readouterr().out
    (results / MANIFEST).unlink()
    command("check", str(results))
    assert "cannot be told without a manifest" in capsys.readouterr().out


@pytest.mark.parametrize("content", ["{}", "3", "[" * 50_000, '{"point_id": 1}', "\xff"])
def test_checks_at_full_order_that_are_none_are_made_again(results, content):
    (file,) = sorted((results / "references").iterdir())[:1]
    file.write_text(content)
    told = file.read_bytes()
    entry = [len(told), hashlib.sha256(told).hexdigest()]
    with (results / JOURNAL).open("a") as journal:
        journal.write(json.dumps({"files": {f"references/{file.name}": entry}}) + "\n")
    assert file.stem not in Store(results).references()


def test_links_that_stay_inside_are_used(results):
    (results / CHUNKS).rename(results / "big")
    (results / CHUNKS).symlink_to("big", target_is_directory=True)
    assert run(results)[1].n_solved == 0


def test_a_file_that_is_a_link_is_not_what_the_run_wrote(results):
    table = results / "onsets.parquet"
    table.rename(results.parent / "outside" / "onsets.parquet")
    table.symlink_to(results.parent / "outside" / "onsets.parquet")
    assert Store(results).fault("onsets.parquet") == "damaged"


def test_a_folder_of_a_link_is_not_read(results):
    (results / "histories").symlink_to(results.parent / "outside", target_is_directory=True)
    assert not Store(results).kept_histories()
    assert not Store(results).unfinished()


HOSTILE_FACTS = [
    ("timings", None),
    ("versions", "x"),
    ("design", None),
    ("parameters", {"friction": 1}),
    ("n_points", -1),
    ("n_points", "many"),
    ("units", {"friction": 3}),
    ("pictures", ["../outside/thesis.png"]),
    ("pictures", ["notes.txt"]),
    ("pictures", [".hidden.png"]),
    ("beside", {"../outside": ""}),
    ("beside", {"/etc": ""}),
    ("name", ["x"]),
    ("extensions", "my_law.py"),
]


@pytest.mark.parametrize(("key", "value"), HOSTILE_FACTS)
def test_facts_that_are_none_are_one_sentence(results, key, value, capsys):
    reseal(results, **{key: value})
    to = ["--output", str(results / "page.html")]
    for arguments in (["rank"], ["report", *to], ["plot"], ["explore", *to]):
        assert command(arguments[0], str(results), *arguments[1:]) == 2
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert f"key '{key}" in message
    assert command("check", str(results)) == 1
    before = outside(results)
    run(results)  # the journal tells whose it is
    assert outside(results) == before
    assert command("check", str(results)) == 0


def test_without_its_manifest_a_directory_is_not_whole(results, capsys):
    (results / MANIFEST).unlink()
    assert command("check", str(results)) == 1
    assert "no: run the study again" in capsys.readouterr().out


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no such device here")
def test_devices_are_not_read(results):
    for name in (MANIFEST, JOURNAL):
        (results / name).unlink()
        (results / name).symlink_to("/dev/zero")
    assert read_manifest(results) is None
    assert not Store(results).journal.entries
    os.mkfifo(results / CHUNKS / "fedcba9876543210.parquet")
    add_line_of = Store(results.parent / "empty")
    assert not add_line_of.journal.begun


# -- code ----------------------------------------------------------------------------------------
CODE = """\
from pathlib import Path
from squealstudy.engine.pictures import register_plot
Path(__file__).with_name("executed").touch()
@register_plot(needs=("points",))
def {name}(results):
    return None
"""


@pytest.fixture
def code(tmp_path, request) -> Path:
    file = tmp_path / "theirs" / "my_plot.py"
    file.parent.mkdir()
    name = "plot_" + "".join(c if c.isalnum() else "_" for c in request.node.name)
    file.write_text(CODE.format(name=name.lower()))
    return file


@pytest.fixture
def own_list(tmp_path, monkeypatch):
    """A cache of a user who has run nothing yet."""
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))


@pytest.mark.usefixtures("own_list")
def test_code_in_results_is_executed_only_where_its_user_has_run_it(code, tmp_path):
    source = load_extension(code)
    (code.parent / "executed").unlink()
    manifest = {RECORDS: recorded_extensions([source])}
    assert manifest[RECORDS][0]["sources"] == {"my_plot.py": code.read_text()}
    _forget(source)
    (tmp_path / "my_plot.py").write_text(code.read_text())  # in the directory itself
    assert extensions_of_results(manifest, tmp_path) == [("my_plot.py", False)]
    with pytest.raises(ResultsError, match=r"my_plot\.py, which you have not run on this machine"):
        execute_recorded(manifest, tmp_path)
    assert not list(tmp_path.rglob("executed"))


@pytest.mark.usefixtures("own_list")
@pytest.mark.parametrize("moved", [False, True])
def test_code_that_was_run_here_serves_without_an_option(code, tmp_path, moved):
    source = load_extension(code)
    enter_executed([source])
    manifest = {RECORDS: recorded_extensions([source])}
    (code.parent / "executed").unlink()
    _forget(source)
    if moved:  # its copy in the cache is executed
        code.write_text("raise RuntimeError('another file now')")
    assert extensions_of_results(manifest, tmp_path) == [("my_plot.py", True)]
    changed = {RECORDS: [manifest[RECORDS][0] | {"sources": {"my_plot.py": "raise SystemExit"}}]}
    # plots cannot be registered twice from two places: as a process of its own would have it
    sys.modules[f"squealstudy_extension_my_plot_{source}"] = sys  # "executed"
    try:
        assert execute_recorded(changed, tmp_path) == (source,)
    finally:
        _forget(source)


def _forget(source: str) -> None:
    """As a new process, which has executed nothing."""
    from squealstudy import extensions

    for path in [p for p, s in extensions._read.items() if s == source]:
        del extensions._read[path]
    sys.modules.pop(f"squealstudy_extension_my_plot_{source}", None)


@pytest.mark.parametrize("record", [{}, {"name": 3, "hash": "a"}, {"name": "x", "hash": "../a"}])
def test_records_that_name_no_hash_are_one_sentence(record, tmp_path):
    with pytest.raises(ResultsError, match="names no file and hash"):
        execute_recorded({RECORDS: [record]}, tmp_path)
