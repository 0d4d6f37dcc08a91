"""Runs from a study file to tables: resume, reuse, kill, failure, ownership."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from study_runs import comparable, plan_of, solved
from study_texts import study_text, sweep_text
from tiny_meshes import forget_models, tiny_cache, tiny_meshes

import squealstudy
from squealstudy.engine import cache, store
from squealstudy.engine.checked_points import reference_choice
from squealstudy.engine.plan import Plan
from squealstudy.engine.runner import run_study
from squealstudy.engine.workers import Pace
from squealstudy.errors import ResultsError, SquealstudyError, StudyFileError
from squealstudy.kinds.complex_modes import full_order_check

HULTEN = (
    study_text("lockin", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, "{stop}", "{num}")
    + """\
[modes]
band = [1.0, 1000.0]
"""
)

BRAKE = (
    study_text("brake", "complex_modes", "disc_brake")
    + """\
mesh = "coarse"
contact_points = 2
"""
    + sweep_text("friction", 0.1, 0.6, 12)
    + """\
[modes]
band = [500.0, 4000.0]
reference_points = 0
refine_tracking = false
refine_onsets = false
[reduction]
enrichment = false
"""
)


BATCHES = (  # ten tasks of small models, each one batch
    study_text("batches", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.9, 256)
    + sweep_text("frequency_2", 60.0, 110.0, 160)
    + """\
[modes]
band = [1.0, 1000.0]
reference_points = 0
refine_tracking = false
refine_onsets = false
[design]
limit = 50_000
"""
)


def hulten(stop: float = 0.6, num: int = 13) -> Plan:
    return plan_of(HULTEN.format(stop=stop, num=num))


def test_tables_hold_every_point_and_the_flutter(tmp_path: Path) -> None:
    report = run_study(hulten(), tmp_path / "r", jobs=1)
    results = squealstudy.open_results(tmp_path / "r")
    assert report.n_solved == 13
    assert (results.points["status"] == "ok").all()
    assert results.points["point_id"].is_unique
    beyond = results.points["friction"] > 0.2916666
    assert ((results.points["n_unstable"] == 1) == beyond).all()
    merged = results.modes[results.modes["unstable"]]
    real_part = (2 * np.pi * merged["frequency_hz"]) ** 2 - 2 * merged["growth_rate"] ** 2
    expected = (2 * np.pi) ** 2 * (100.0**2 + 75.0**2) / 2
    np.testing.assert_allclose(real_part, expected, rtol=1e-10)
    energies = results.modes.filter(like="energy_").sum(axis=1)
    np.testing.assert_allclose(energies, 1.0, rtol=1e-12)
    assert results.points["reference_frequency_error"].notna().sum() == 2


def test_same_study_again_does_nothing(tmp_path: Path) -> None:
    run_study(hulten(), tmp_path / "r", jobs=1)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "r").rglob("*") if p.name != ".lock"}
    report = run_study(hulten(), tmp_path / "r", jobs=1)
    after = {p: p.stat().st_mtime_ns for p in (tmp_path / "r").rglob("*") if p.name != ".lock"}
    assert report.n_solved == 0
    assert before == after


def test_changed_study_solves_only_what_is_new(tmp_path: Path) -> None:
    run_study(hulten(0.6, 13), tmp_path / "r", jobs=1)
    report = run_study(hulten(0.6, 25), tmp_path / "r", jobs=1)
    assert (report.n_solved, report.n_reused) == (12, 13)
    run_study(hulten(0.6, 25), tmp_path / "fresh", jobs=1)
    for mine, fresh in zip(comparable(tmp_path / "r"), comparable(tmp_path / "fresh"), strict=True):
        pd.testing.assert_frame_equal(mine, fresh)


@pytest.mark.usefixtures("one_by_one")
def test_a_small_model_is_one_file_of_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    run_study(hulten(), tmp_path / "results", jobs=1)
    kept = [p for p in (tmp_path / "cache" / "models").rglob("*") if p.is_file()]
    assert [p.name for p in kept] == [cache.META]


@pytest.mark.usefixtures("one_by_one")
def test_other_friction_range_reuses_reduction_and_working_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "FEWEST_KEPT_GAPS", 0)  # as of large models
    run_study(hulten(0.6, 13), tmp_path / "a", jobs=1)
    report = run_study(hulten(0.3, 7), tmp_path / "b", jobs=1)
    assert len(list((tmp_path / "cache" / "models").iterdir())) == 1
    assert report.n_solved == 7
    assert report.manifest["timings"]["working_points_reused"] == 7
    a, b = comparable(tmp_path / "a")[1], comparable(tmp_path / "b")[1]
    shared = a[a["point_id"].isin(b["point_id"])].reset_index(drop=True)
    pd.testing.assert_frame_equal(
        shared.drop(columns=["track_mac", "track_ambiguous"]),
        b.drop(columns=["track_mac", "track_ambiguous"]),
    )


def test_tables_do_not_depend_on_workers(tmp_path: Path) -> None:
    run_study(hulten(), tmp_path / "one", jobs=1)
    run_study(hulten(), tmp_path / "two", jobs=2)
    for a, b in zip(comparable(tmp_path / "one"), comparable(tmp_path / "two"), strict=True):
        pd.testing.assert_frame_equal(a, b)


def test_a_failed_point_is_a_row(tmp_path: Path) -> None:
    text = (
        HULTEN.format(stop=0.6, num=3)
        .replace("friction", "mass")
        .replace("start = 0.0", "start = 1.0")
    )
    plan = plan_of(text.replace("stop = 0.6", "stop = 3.0"))
    broken = plan.tasks[1]

    def build(options: object, values: dict[str, float]) -> object:
        if values["mass"] == 2.0:
            raise SquealstudyError("no such mass")
        return original(options, values)

    original, stack = broken.model.build, broken.model.stack
    object.__setattr__(plan.study.model, "build", build)
    object.__setattr__(plan.study.model, "stack", None)
    try:
        report = run_study(plan, tmp_path / "r", jobs=1)
    finally:
        object.__setattr__(plan.study.model, "build", original)
        object.__setattr__(plan.study.model, "stack", stack)
    points = squealstudy.open_results(tmp_path / "r").points
    assert points["status"].tolist() == ["ok", "structure", "ok"]
    assert points["message"].tolist()[1] == "no such mass"
    assert report.manifest["n_failed"] == 1
    assert points["n_modes"].isna().tolist() == [False, True, False]
    assert points["n_modes"].dropna().tolist() == [2, 2]


def test_directory_of_another_study_is_refused(tmp_path: Path) -> None:
    run_study(hulten(), tmp_path / "r", jobs=1)
    other = plan_of(HULTEN.format(stop=0.6, num=3).replace("lockin", "other"))
    with pytest.raises(ResultsError, match="belongs to study 'lockin'"):
        run_study(other, tmp_path / "r", jobs=1)
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "thesis.tex").write_text("precious")
    with pytest.raises(ResultsError, match="not empty"):
        run_study(hulten(), tmp_path / "foreign", jobs=1)
    assert [p.name for p in (tmp_path / "foreign").iterdir()] == ["thesis.tex"]


def test_mode_number_beyond_the_basis_writes_nothing(tmp_path: Path) -> None:
    text = HULTEN.format(stop=0.6, num=3) + '[parameters]\n"mass.modes[7].damping_ratio" = 0.1\n'
    with pytest.raises(StudyFileError, match="modes 1 to 2") as caught:
        run_study(plan_of(text), tmp_path / "r", jobs=1)
    assert caught.value.line is not None
    assert not (tmp_path / "r").exists()


def test_unfinished_and_damaged_results_are_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no such"):
        squealstudy.open_results(tmp_path / "nowhere")
    run_study(hulten(), tmp_path / "r", jobs=1)
    (tmp_path / "r" / "modes.parquet").unlink()
    with pytest.raises(ResultsError, match="not finished"):
        squealstudy.open_results(tmp_path / "r")
    (tmp_path / "r" / "manifest.json").write_text("{")
    with pytest.raises(ResultsError, match="readable manifest"):
        squealstudy.open_results(tmp_path / "r")


def test_point_ids_are_content(tmp_path: Path) -> None:
    ids = {t.point_id for t in hulten().tasks}
    assert {t.point_id for t in hulten().tasks} == ids
    other_band = plan_of(HULTEN.format(stop=0.6, num=13).replace("1000.0", "900.0"))
    assert not ids & {t.point_id for t in other_band.tasks}


def parts_of(points: int, seconds: float, jobs: int = 2) -> list[int]:
    """Sizes of tasks whose points take so long."""
    pace, found = Pace(), []
    for part in pace.parts(hulten(0.6, points).tasks, jobs):
        found.append(len(part))
        pace.took(len(part), seconds * len(part))
    return found


def test_tasks_are_small_where_points_are_expensive_and_balance_workers() -> None:
    sizes = parts_of(174, 1.0)
    assert (sum(sizes), max(sizes[1:])) == (174, 2)
    sizes = parts_of(8000, 1e-3)
    assert (sum(sizes), sizes[0]) == (8000, 16)  # nothing is known of their time
    assert sizes[1] == pytest.approx(8000 / 16, abs=2)
    assert max(sizes) < 2000
    assert sizes[-2] == 100  # a tenth of a second
    assert parts_of(3, 1e-3) == [1, 2]


def test_parts_have_one_structure_each_and_all_points() -> None:
    text = HULTEN.format(stop=0.6, num=50)
    text += '[[sweep]]\nparameter = "frequency_1"\nvalues = [90.0, 95.0, 100.0]\n'
    points = plan_of(text).tasks
    parts = list(Pace(1e-9).parts(points, 2))
    assert [len(set(part.structure_index.tolist())) for part in parts] == [1] * len(parts)
    names = [task.point_id for part in parts for task in part]
    assert sorted(names) == sorted(points.ids.astype(str).tolist())


def test_reference_points_begin_at_the_upper_corner_and_spread() -> None:
    plan = hulten(0.6, 13)
    friction = [plan.swept[i, 0] for i in reference_choice(plan, 3)]
    assert friction == pytest.approx([0.6, 0.0, 0.3])
    assert reference_choice(plan, 0) == []
    assert sorted(reference_choice(plan, 99)) == list(range(13))


@pytest.mark.parametrize(("freedoms", "expected"), [(0, 110_000), (48_588, 2), (115_959, 1)])
def test_large_checks_take_turns(
    monkeypatch: pytest.MonkeyPatch, freedoms: int, expected: int
) -> None:
    """Two at full order of 48,588 freedoms take 4 GB at once; of 115,959 one does."""
    prepared = {"small": SimpleNamespace(n_dof=3), "own": SimpleNamespace(n_dof=freedoms)}
    monkeypatch.setattr(full_order_check, "load_any", prepared.get)
    tasks = [
        SimpleNamespace(point=SimpleNamespace(structure=name), stacked=False) for name in prepared
    ]
    assert full_order_check.at_once(tasks[1:]) == expected
    assert full_order_check.at_once(tasks) == min(expected, full_order_check.SIDE_BY_SIDE // 3)


def test_rigid_body_noise_is_never_counted(tmp_path: Path) -> None:
    """A mass that is hardly held in one direction: far below the top of the band is no mode."""
    text = HULTEN.format(stop=0.1, num=3).replace("[1.0, 1000.0]", "[0.0, 1e5]")
    text += "[parameters]\nfrequency_1 = 1.5\nfrequency_2 = 0.9\n"
    results = solved(text, tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    assert results.modes["frequency_hz"].min() > 1.0
    assert not results.modes["unstable"].any()


# -- kill -----------------------------------------------------------------------------------------
@pytest.fixture
def tiny() -> Iterator[None]:
    """For one test alone."""
    with tiny_meshes(tiny_cache()):
        yield


def _start(study: Path, directory: Path) -> subprocess.Popen[bytes]:
    code = "from squealstudy.cli.app import main; main()"
    arguments = ["run", str(study), "-o", str(directory), "-j", "2", "--no-pictures"]
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _session_members(leader: int) -> list[int]:
    """Processes of the session, the leader apart: the workers and their helpers."""
    members = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        pid = int(stat.parent.name)
        if int(fields[3]) == leader and pid != leader and fields[0] != "Z":
            members.append(pid)
    return members


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    ("text", "after"),
    [
        pytest.param(BRAKE, (1, 6), id="points"),
        pytest.param(BATCHES, (1, 3), id="batches", marks=pytest.mark.full_size),
    ],
)
def test_sigkill_leaves_no_worker_and_resumes_to_the_same_tables(
    text: str, after: tuple[int, int], tmp_path: Path, tiny: None
) -> None:
    """Processes find the reduction of the smallest brake in the cache."""
    study = tmp_path / "study.toml"
    study.write_text(text)
    directory, clean = tmp_path / "killed", tmp_path / "clean"
    plan = plan_of(text)
    run_study(plan, clean, jobs=1)  # fills the cache too
    kills = 0
    for wanted in after:
        process = _start(study, directory)
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline and process.poll() is None:
            if len(list((directory / store.CHUNKS).glob("*.parquet"))) >= wanted:
                break
            time.sleep(0.01)
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
        deadline = time.monotonic() + 15
        while _session_members(process.pid) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert _session_members(process.pid) == []
    assert kills >= 1
    report = run_study(plan, directory, jobs=2)
    assert report.n_reused >= 1
    assert json.loads((directory / "manifest.json").read_text())["status"] == "complete"
    for a, b in zip(comparable(directory), comparable(clean), strict=True):
        pd.testing.assert_frame_equal(a, b)


@pytest.mark.full_size  # by default: test_structure_tracking.py
def test_tracks_follow_modes_over_structures(tmp_path: Path) -> None:
    """A swept material: nominal modes change sign and rotate, tracks must not."""
    text = BRAKE.replace('"friction"', '"disc.young_modulus"').replace("num = 12", "num = 2")
    text = text.replace("start = 0.1", "start = 1.2e11").replace("stop = 0.6", "stop = 1.22e11")
    plan = plan_of(text)
    assert len(plan.structures) == 2
    with tiny_meshes(tmp_path / "cache"):
        results = solved(plan, tmp_path / "r")
    assert (results.points["status"] == "ok").all()
    followed = results.modes[results.modes["track_mac"].notna() & ~results.modes["overdamped"]]
    assert followed["track_mac"].median() > 0.98
    counts = results.modes.groupby("track")["point_id"].nunique()
    assert (counts[counts.index > 0] == 2).mean() > 0.9


@pytest.mark.usefixtures("one_by_one")
def test_a_damaged_cache_entry_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache"))
    run_study(hulten(), tmp_path / "a", jobs=1)
    (entry,) = (tmp_path / "cache" / "models").iterdir()
    forget_models()  # as another process, which has no map of the file
    (entry / "model.k_el.npy").write_bytes(b"")
    run_study(hulten(), tmp_path / "b", jobs=1)
    for a, b in zip(comparable(tmp_path / "a"), comparable(tmp_path / "b"), strict=True):
        pd.testing.assert_frame_equal(a, b)
