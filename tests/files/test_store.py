"""Results and caches that were damaged, killed in the middle or changed: noticed and made again."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

import pandas as pd
import pytest
from study_runs import command, comparable, plan_of
from study_texts import study_text, sweep_text

import squealstudy
from squealstudy.engine import cache, packed_values
from squealstudy.engine import store as store_module
from squealstudy.engine.journal import JOURNAL
from squealstudy.engine.manifest_file import read_manifest
from squealstudy.engine.result_names import CHUNKS, MANIFEST, REFERENCES, SET_ASIDE
from squealstudy.engine.runner import run_study
from squealstudy.engine.store import Store
from squealstudy.errors import ResultsError
from squealstudy.files import sealed, unsealed

STUDY = (
    study_text("lockin", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, "{stop}", "{num}")
    + """\
[modes]
band = [1.0, 1000.0]
reference_points = 1
"""
)
BELT = (
    study_text("belt", "transient", "belt")
    + """\
[parameters]
friction = 0.4
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 1.0]
[transient]
duration = 0.01
step = 1e-4
batch = 1
slope_pilot = "never"
save_every = 10
"""
)
TORN = b'{"files":{"chunks/0123456789abcdef.parquet":[12,"ab'


def lockin(num: int = 5, stop: float = 0.6):
    return plan_of(STUDY.format(num=num, stop=stop))


def run(directory: Path, plan=None, **given):
    """Warnings, and what the run reports."""
    told: list[str] = []
    return told, run_study(plan or lockin(), directory, 1, warn=told.append, **given)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    directory = tmp_path_factory.mktemp("whole") / "results"
    run(directory)
    return directory


@pytest.fixture
def results(whole, tmp_path) -> Path:
    """A copy of finished results."""
    copy = tmp_path / "results"
    for path in whole.rglob("*"):
        if path.is_file():
            target = copy / path.relative_to(whole)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
    return copy


def files(directory: Path) -> set[str]:
    return {p.relative_to(directory).as_posix() for p in directory.rglob("*") if p.is_file()}


def one(directory: Path, pattern: str) -> Path:
    return min(directory.glob(pattern))


def flip(path: Path, place: float = 0.6) -> None:
    """Change one bit of a file."""
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] ^= 4
    path.write_bytes(content)


def same(a: Path, b: Path) -> None:
    for mine, other in zip(comparable(a), comparable(b), strict=True):
        pd.testing.assert_frame_equal(mine, other)


# -- kills ---------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "left",
    [
        [],
        [".lock"],
        [".manifest.json.k7x2.tmp", JOURNAL],
        [JOURNAL],
        [f"{REFERENCES}/{16 * 'a'}.parquet"],
    ],
)
def test_a_kill_before_the_first_manifest_blocks_nothing(left, tmp_path):
    directory = tmp_path / "r"
    directory.mkdir()
    for name in left:
        (directory / name).parent.mkdir(exist_ok=True)
        (directory / name).write_text("")
    assert run(directory)[1].n_solved == 5
    assert not list(directory.rglob("*.tmp"))


def test_other_files_still_block(tmp_path):
    (tmp_path / ".lock").touch()
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(ResultsError, match=r"not empty \(thesis.tex\)"):
        run(tmp_path)
    (tmp_path / "thesis.tex").unlink()
    (tmp_path / REFERENCES).mkdir()
    (tmp_path / REFERENCES / "thesis.bib").touch()
    with pytest.raises(ResultsError, match=rf"not empty \({REFERENCES}\)"):
        run(tmp_path)


def test_what_a_kill_left_unfinished_is_removed_and_made_again(whole, results):
    chunk = one(results, f"{CHUNKS}/*")
    (results / "chunks" / ".x.tmp").touch()
    Store(results).journal.withdraw([f"{CHUNKS}/{chunk.name}"])
    told, report = run(results)
    assert (told, report.n_solved) == ([], 0)  # the tables were whole: nothing is left to do
    assert not chunk.exists()
    (results / JOURNAL).write_bytes((results / JOURNAL).read_bytes() + TORN)
    run(results, plan_of(STUDY.format(num=5, stop=0.6).replace("1000.0", "900.0")))
    told, report = run(results)
    assert report.n_solved >= 1
    assert not list(results.rglob("*.tmp"))
    same(whole, results)


# -- damage --------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", [f"{CHUNKS}/*", f"{REFERENCES}/*", "modes.parquet", MANIFEST])
@pytest.mark.parametrize("harm", [flip, lambda p: p.write_bytes(p.read_bytes()[:-7])])
def test_a_damaged_file_is_named_set_aside_and_made_again(whole, results, name, harm):
    path = one(results, name)
    harm(path)
    told, _ = run(results)
    named = path.relative_to(results).as_posix()
    assert len(told) == 1
    assert "damaged" in told[0]
    assert named in told[0]
    assert (results / SET_ASIDE / named).is_file()
    same(whole, results)
    assert run(results)[0] == []


def test_a_missing_chunk_is_solved_again(whole, results):
    one(results, f"{CHUNKS}/*").unlink()
    told, report = run(results)
    assert "missing" in told[0]
    assert report.n_solved >= 1
    same(whole, results)


@pytest.mark.parametrize("place", [0.05, 0.3, 0.5, 0.9])
def test_a_damaged_journal_never_makes_other_tables(whole, results, place):
    flip(results / JOURNAL, place)
    run(results)
    same(whole, results)
    flip(results / JOURNAL, place)
    (results / JOURNAL).write_bytes((results / JOURNAL).read_bytes()[: int(1000 * place)])
    run(results)
    same(whole, results)


def test_points_whose_line_of_the_journal_is_lost_are_solved_again(whole, results):
    """Tables that are whole hide that the chunk of a lost line is removed as never finished."""
    lines = (results / JOURNAL).read_bytes().splitlines(keepends=True)
    k = next(k for k, line in enumerate(lines) if CHUNKS.encode() in line)
    lines[k] = b"\0" * (len(lines[k]) - 1) + b"\n"
    (results / JOURNAL).write_bytes(b"".join(lines))
    run(results)
    assert list((results / CHUNKS).iterdir())
    same(whole, results)


@pytest.mark.parametrize("place", [0.1, 0.5, 0.9])
def test_a_damaged_table_is_never_read(results, place):
    flip(results / "modes.parquet", place)
    opened = squealstudy.open_results(results)
    assert len(opened.points) == 5
    with pytest.raises(ResultsError, match=r"modes.parquet: damaged.*run the study again"):
        _ = opened.modes
    (results / "points.parquet").write_bytes(b"PAR1")
    with pytest.raises(ResultsError, match=r"points.parquet: damaged"):
        squealstudy.open_results(results)


def test_one_digit_of_the_manifest_is_noticed(results):
    text = (results / MANIFEST).read_text()
    (results / MANIFEST).write_text(text.replace('"n_points": 5', '"n_points": 6'))
    with pytest.raises(ResultsError, match=r"manifest.json: not a readable manifest"):
        squealstudy.open_results(results)


def test_results_of_versions_without_a_journal_are_read(whole, results):
    (results / JOURNAL).unlink()
    (results / MANIFEST).write_text(json.dumps(read_manifest(results)))
    same(whole, results)
    told, report = run(results)
    assert (told, report.n_solved) == ([], 5)
    same(whole, results)


@pytest.mark.parametrize("folder", ["histories", "states"])
def test_a_point_whose_history_is_damaged_runs_again(folder, tmp_path):
    directory, plan = tmp_path / "r", plan_of(BELT)
    run(directory, plan)
    before = squealstudy.open_results(directory)
    point = before.points["point_id"].iloc[0]
    history = before.history(point)
    flip(one(directory, f"{folder}/{point}.*"))
    told, report = run(directory, plan)
    assert (len(told), report.n_solved) == (1, 1)
    pd.testing.assert_frame_equal(squealstudy.open_results(directory).history(point), history)
    flip(one(directory, f"histories/{point}.*"))
    with pytest.raises(ResultsError, match=r"histories/.*damaged"):
        squealstudy.open_results(directory).history(point)


# -- check ---------------------------------------------------------------------------------------
def test_check_says_what_a_directory_holds_and_whether_it_is_whole(results, capsys):
    assert command("check", str(results)) == 0
    text = capsys.readouterr().out
    for words in ("lockin: complex_modes of hulten", "5: 5 ok, 0 missing", "complete", "yes"):
        assert words in text
    flip(one(results, f"{CHUNKS}/*"))
    (results / "onsets.parquet").unlink()
    (results / "notes.txt").touch()
    before = files(results)
    assert command("check", str(results)) == 1
    text = capsys.readouterr().out
    for words in ("damaged", "chunks/", "missing", "onsets.parquet", "of others", "notes.txt"):
        assert words in text
    assert files(results) == before


def test_check_counts_lines_of_the_journal_that_cannot_be_read(results, capsys):
    with (results / JOURNAL).open("ab") as journal:
        journal.write(TORN)  # what only it names was never finished: all is whole
    assert command("check", str(results)) == 0
    assert "1 line cannot be read" in capsys.readouterr().out
    assert Store(results).journal.unreadable == 1
    lines = (results / JOURNAL).read_bytes()
    (results / JOURNAL).write_bytes(lines.replace(b'"files"', b'"filgs"', 1))
    assert Store(results).journal.unreadable == 2


def test_check_of_a_lost_journal_and_of_no_results(results, tmp_path, capsys):
    (results / JOURNAL).write_text("")
    assert command("check", str(results)) == 1
    assert "modes.parquet" in capsys.readouterr().out
    (tmp_path / "empty").mkdir()
    assert command("check", str(tmp_path / "empty")) == 2


# -- other settings ------------------------------------------------------------------------------
def test_chunks_that_were_read_are_not_read_again(results):
    store, schema = Store(results), lockin().kind.schema
    names, read = set(store.names(CHUNKS)), set()
    assert len(list(store.chunks(schema, read=read))) == len(names) > 0
    assert read == names
    assert not list(store.chunks(schema, read=read))


def test_a_run_says_what_it_takes_over(results):
    told, report = run(results, lockin(9))
    assert (told, report.n_reused) == ([], 5)
    told, report = run(results, lockin(3))
    assert report.n_solved == 0
    assert "3 of 9 design points solved before belong to this study as it is now" in told[0]
    assert "for the study or the code changed; 6 others stay" in told[0]


def test_settings_that_add_no_point_make_the_tables_anew(tmp_path):
    """A finer grid of a map that is stable all over: the same points stand for more nodes."""
    text = STUDY.format(num=3, stop=0.1) + '[design]\ntype = "boundary"\nlevels = {}\n'
    run(tmp_path, plan_of(text.format(1)))
    _, report = run(tmp_path, plan_of(text.format(2)))
    assert report.n_solved == 0
    assert squealstudy.open_results(tmp_path).boundary["levels"] == 2


def test_fresh_removes_what_the_study_wrote_and_nothing_else(whole, results):
    (results / "notes.txt").touch()
    (results / CHUNKS / "mine.txt").touch()
    run(results, lockin(4))
    flip(results / MANIFEST)
    told, report = run(results, fresh=True)
    assert (told, report.n_solved) == ([], 5)
    assert files(results) == files(whole) | {"notes.txt", "chunks/mine.txt"}
    same(whole, results)


def test_fresh_leaves_other_studies_and_invalid_ones_alone(results, tmp_path, capsys):
    before = files(results)
    other = plan_of(STUDY.format(num=5, stop=0.6).replace("lockin", "other"))
    with pytest.raises(ResultsError, match="belongs to study 'lockin'"):
        run(results, other, fresh=True)
    study = tmp_path / "study.toml"
    study.write_text(STUDY.format(num=0, stop=0.6))
    assert command("run", str(study), "-o", str(results), "--fresh") == 2
    assert files(results) == before


# -- permissions ---------------------------------------------------------------------------------
@pytest.mark.skipif(os.name == "nt", reason="no umask")
@pytest.mark.parametrize(("umask", "mode"), [(0o027, 0o640), (0o002, 0o664)])
def test_files_have_the_permissions_that_the_user_asks_for(
    umask, mode, tmp_path, monkeypatch, one_by_one, as_of_large_models
):
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    before = os.umask(umask)
    try:
        run(tmp_path / "r")
    finally:
        os.umask(before)
    found = [p for p in tmp_path.rglob("*") if p.is_file() and p.name != ".lock"]
    assert len(found) > 10
    assert {stat.S_IMODE(p.stat().st_mode) for p in found} == {mode}


# -- caches --------------------------------------------------------------------------------------
@pytest.fixture
def as_of_large_models(monkeypatch) -> None:
    """Arrays and working points of a small model are files of their own, as those of large ones."""
    monkeypatch.setattr(packed_values, "MOST_INLINE", 0)
    monkeypatch.setattr(cache, "FEWEST_KEPT_GAPS", 0)


@pytest.fixture
def cached(tmp_path, monkeypatch, one_by_one, as_of_large_models) -> Path:
    """The folder of the one model that a run has put into a cache of its own."""
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    kept = (cache._gaps, cache.prepared_any, cache.prepared_model)
    for function in kept:
        function.cache_clear()
    run(tmp_path / "first")
    for function in kept:
        function.cache_clear()
    return one(tmp_path / "cache" / "models", "*")


@pytest.mark.parametrize("name", ["meta.json", "*.npy", "working_points/*.npz"])
@pytest.mark.parametrize("place", [pytest.param(0.2, marks=pytest.mark.full_size), 0.9])
def test_a_damaged_cache_is_made_again(cached, tmp_path, name, place):
    path = one(cached, name)
    content = path.read_bytes()
    flip(path, place)
    run(tmp_path / "second")
    same(tmp_path / "first", tmp_path / "second")
    again = one(cached, name)
    if name == "*.npy":
        assert again.read_bytes() == content


@pytest.mark.parametrize("wanted", ["subprocess.Popen", "os.system", "squealstudy.cli.app.main"])
def test_nothing_in_a_cache_is_called(cached, wanted, monkeypatch):
    meta = unsealed((cached / "meta.json").read_bytes())
    meta["value"] = {"class": wanted, "fields": {"args": "touch called"}}
    (cached / "meta.json").write_text(sealed(meta))
    called = lambda name: pytest.fail(f"{name} is imported")  # noqa: E731
    monkeypatch.setattr(packed_values, "import_module", called)
    assert not cache.is_whole(cached)
    with pytest.raises(OSError, match="not as it was written"):
        cache.load_value(cached)


def test_a_value_of_another_class_is_not_kept(tmp_path):
    with pytest.raises(ValueError, match="Store is not a class"):
        packed_values.check_classes({"class": "squealstudy.engine.store.Store", "fields": {}})
    with pytest.raises(ValueError, match="pickle"):
        cache.save_value(tmp_path / "value", (cache.np.array([object()]),))


def test_what_a_killed_process_left_in_the_cache_is_removed(tmp_path):
    left = cache.temporary_name(tmp_path / "value")
    mine = left.with_name(left.name)
    gone = left.with_name(left.name.replace(f"-{os.getpid()}-", "-4194304-"))  # above the most
    mine.mkdir()
    gone.mkdir()
    (gone / "array.npy").touch()
    cache.save_value(tmp_path / "other", (1.0,))
    assert mine.exists()
    assert not gone.exists()


# -- tables in parts


@pytest.fixture
def in_parts(tmp_path, monkeypatch) -> Path:
    """Results whose tables of more than four rows are folders."""
    monkeypatch.setattr(store_module, "PART_ROWS", 4)
    run(tmp_path / "parts")
    return tmp_path / "parts"


def test_a_long_table_is_a_folder_that_pandas_opens_as_one(whole, in_parts):
    names = [path.name for path in sorted((in_parts / "modes.parquet").iterdir())]
    assert names == [f"part-0000{k}.parquet" for k in range(3)]
    for table in ("points", "modes", "onsets"):
        one, other = (pd.read_parquet(d / f"{table}.parquet") for d in (whole, in_parts))
        spent = ["wall_s"] if table == "points" else []
        pd.testing.assert_frame_equal(one.drop(columns=spent), other.drop(columns=spent))
    found = squealstudy.open_results(in_parts)
    pd.testing.assert_frame_equal(found.modes, pd.read_parquet(in_parts / "modes.parquet"))
    pd.testing.assert_frame_equal(found.rank(), squealstudy.open_results(whole).rank())
    told, report = run(in_parts)
    assert (told, report.n_solved) == ([], 0)


def test_a_damaged_part_is_noticed_set_aside_and_made_again(in_parts):
    before = pd.read_parquet(in_parts / "modes.parquet")
    part = in_parts / "modes.parquet" / "part-00001.parquet"
    part.write_bytes(part.read_bytes()[:-1] + b"x")
    with pytest.raises(ResultsError, match=r"modes\.parquet: damaged"):
        _ = squealstudy.open_results(in_parts).modes
    told, report = run(in_parts)
    assert "damaged" in told[0]
    assert report.n_solved == 0
    assert (in_parts / SET_ASIDE / "modes.parquet-part-00001.parquet").is_file()
    pd.testing.assert_frame_equal(pd.read_parquet(in_parts / "modes.parquet"), before)


def test_a_lost_part_is_made_again(in_parts):
    (in_parts / "modes.parquet" / "part-00002.parquet").unlink()
    with pytest.raises(ResultsError, match="not finished"):
        squealstudy.open_results(in_parts)
    told, _ = run(in_parts)
    assert "missing" in told[0]
    assert len(pd.read_parquet(in_parts / "modes.parquet")) == 10


def test_a_table_changes_between_file_and_folder_without_leftovers(in_parts, monkeypatch):
    monkeypatch.setattr(store_module, "PART_ROWS", 1000)
    run(in_parts, lockin(4))
    assert (in_parts / "modes.parquet").is_file()
    monkeypatch.setattr(store_module, "PART_ROWS", 3)
    run(in_parts, lockin(6))
    assert len(list((in_parts / "modes.parquet").iterdir())) == 4
    assert len(pd.read_parquet(in_parts / "modes.parquet")) == 12
    monkeypatch.setattr(store_module, "PART_ROWS", 6)
    run(in_parts, lockin(4))
    assert len(list((in_parts / "modes.parquet").iterdir())) == 2
    assert not Store(in_parts).unfinished()
    run(in_parts, lockin(3), fresh=True)
    assert (in_parts / "modes.parquet").is_file()
