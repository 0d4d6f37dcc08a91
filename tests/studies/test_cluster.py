"""Studies on a cluster of dask.distributed: the same tables, whatever happens to its processes."""

from __future__ import annotations

import itertools
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cluster_tasks
import numpy as np
import pandas as pd
import pytest
import scipy.io
from own_blocks import STUDY as BLOCKS
from own_blocks import write_blocks
from study_runs import command
from study_texts import study_text, sweep_text

import squealstudy as sq
from squealstudy import extensions
from squealstudy.engine.cache import (
    contents,
    is_whole,
    keep_contents,
    prepared_path,
    save_value,
    touched,
)
from squealstudy.engine.cluster_worker import Setting, answer, versions
from squealstudy.engine.workers import TASKS_IN_FLIGHT_PER_WORKER, Workers
from squealstudy.errors import MachineError
from squealstudy.machine.processes import InterruptedRun, interruptible
from squealstudy.modes.reanalysis.polynomials import ExpandedWeights

pytest.importorskip("distributed", reason="NOT TRIED: distributed is not installed")

from clusters import LONGEST, MODULES, Loopback
from distributed import Client

from squealstudy.engine.cluster import _keys, _pickled, connected

STUDIES = Path(__file__).parents[2] / "studies"
HULTEN = (
    study_text("hulten", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.6, 40)
    + """\
[modes]
band = [1.0, 1000.0]
"""
)
BOUNDARY = (
    study_text("map", "complex_modes", "hulten")
    + sweep_text("friction", 0.0, 0.6, 4)
    + sweep_text("frequency_2", 60.0, 90.0, 3)
    + """\
[design]
type = "boundary"
levels = 2
[modes]
band = [1.0, 1000.0]
"""
)
INDICES = (
    study_text("indices", "complex_modes", "hulten")
    + """\
[[sweep]]
parameter = "friction"
distribution = "normal"
mean = 0.3
std = 0.05
[[sweep]]
parameter = "sliding_speed"
start = 0.5
stop = 2.0
[design]
type = "sobol_indices"
samples = 8
[modes]
band = [1.0, 1000.0]
"""
)
FEWER = {  # two designs, and branches that end soon
    "num = 20": "num = 2",
    "start = 0.05": "start = 0.7",
    "stop = 1.0": "stop = 0.9",
    "reach = 0.5": "reach = 0.05",
}


def few_cycles() -> str:
    """Limit cycles of a shipped study, and their branches, at two designs."""
    text = (STUDIES / "kicked_squeal.toml").read_text(encoding="utf-8")
    for old, new in FEWER.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


CYCLES = few_cycles()
DESIGN = (STUDIES / "kicked_design.toml").read_text(encoding="utf-8")
SENSITIVITY = (
    study_text("slopes", "sensitivity", "hulten")
    + """\
[parameters]
damping_ratio = 0.01
"""
    + sweep_text("friction", 0.1, 0.5, 5)
    + """\
[sensitivity]
modes = 2
parameters = ["friction", "damping_ratio", "frequency_1"]
"""
)
BELT = (
    study_text("belt", "transient", "belt")
    + """\
[[sweep]]
parameter = "sliding_speed"
values = [0.5, 0.9, 1.1, 1.3]
[modes]
band = [10.0, 1000.0]
[transient]
duration = 0.1
step = 2e-5
perturbation = 1e-5
save_every = 20
"""
)
STABILITY = """
[study]
name = "methods"
kind = "method_stability"
[method_stability]
case = "coalescence"
[[knob]]
name = "anchor"
values = [0.1, 0.3, 0.5]
[[knob]]
name = "step"
values = [1e-3, 0.1]
"""
PRECISION = """
[study]
name = "rungs"
kind = "work_precision"
[work_precision]
base = "base.toml"
points = 3
repeats = 1
[reference]
name = "dense"
set.modes.method = "dense"
[[method]]
name = "perturbation"
set.modes.method = "perturbation"
"""
TRYING = '''
"""Complex modes whose tasks take their time, or end their worker."""
import os, sys, time
from squealstudy.kinds.complex_modes.kind import ComplexModes
from squealstudy.study.kinds import register_kind


class Trying(ComplexModes):
    name = "{name}"

    def solve(self, task):
        time.sleep({seconds} * len(list(task.points)))
        if {deadly!r} in [round(p.values["friction"], 3) for p in task.points]:
            with open({deaths!r}, "a") as file:
                file.write("died\\n")
            os._exit(9)
        return super().solve(task)


register_kind(Trying())
'''
IN_TIME = """
[transient]
representation = "{}"
duration = 2e-4
step = 1e-6
"""
TIMED = re.compile("wall_s|second|memory")
DEAD = 0.3
MOST = 240  # s of a test, on a machine in use
NUMBER = itertools.count()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two workers that live as long as the tests of this file."""
    made = Loopback(tmp_path_factory.mktemp("cluster"))
    try:
        made.add("a", "b")
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def mortal(tmp_path_factory):
    """Two workers that are started again when they die."""
    made = Loopback(tmp_path_factory.mktemp("mortal"))
    try:
        made.add("a", "b", nanny=True)
        yield made
    finally:
        made.close()


@pytest.fixture
def own(tmp_path):
    """A cluster of one test, without workers."""
    made = Loopback(tmp_path)
    try:
        yield made
    finally:
        made.close()


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with a cache that is nobody else's."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SQUEALSTUDY_CACHE", str(tmp_path / "cache-here"))
    return tmp_path


@pytest.fixture(autouse=True)
def _as_a_new_process(monkeypatch):
    """Other tests' extensions are none of ours, nor ours theirs; interrupts arrive.

    A shell in the background ignores them.
    """
    monkeypatch.setattr(extensions, "_read", {})
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def _limit():
    """No test may take for ever, whatever its processes do."""

    def late(*_):
        raise TimeoutError("a test of clusters took too long")

    if not hasattr(signal, "SIGALRM"):
        yield
        return
    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(MOST)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def study(folder: Path, text: str, name: str = "study.toml") -> Path:
    (folder / name).write_text(text)
    return folder / name


def trying(folder: Path, seconds: float = 0.0, deadly: float = -1.0, num: int = 40) -> Path:
    """A study of the extension above; each has its own, for workers know one of a name."""
    name = f"trying_{next(NUMBER)}"
    values = {"name": name, "seconds": seconds, "deadly": deadly, "deaths": str(folder / "deaths")}
    (folder / "trying.py").write_text(TRYING.format(**values))
    text = HULTEN.replace('kind = "complex_modes"', f'kind = "{name}"\nextensions = ["trying.py"]')
    return study(
        folder,
        text.replace("num = 40", f"num = {num}").replace("[modes]", "[modes]\ntrack = false"),
    )


def tables(directory: Path) -> dict[str, pd.DataFrame]:
    """All tables, without what was timed."""
    found = {path.stem: pd.read_parquet(path) for path in directory.glob("*.parquet")}
    if "measurements" in found:
        found["measurements"] = found["measurements"].drop(columns=["cost", "cost_onset"])
    return {name: t.drop(columns=[c for c in t if TIMED.search(c)]) for name, t in found.items()}


def there_and_here(path: Path, folder: Path, client: Client) -> tuple[sq.Results, sq.Results]:
    """A study on a cluster and by this process, from an empty cache; their tables are equal."""
    there = sq.run(path, folder / "there", client=client, warn=print)
    cache = os.environ["SQUEALSTUDY_CACHE"]
    os.environ["SQUEALSTUDY_CACHE"] = str(folder / "cache-local")
    try:
        local = sq.run(path, folder / "local", jobs=1, warn=print)
    finally:
        os.environ["SQUEALSTUDY_CACHE"] = cache
    found, expected = tables(folder / "there"), tables(folder / "local")
    assert found.keys() == expected.keys()
    for name in expected:
        assert len(expected[name].columns) > 1
        pd.testing.assert_frame_equal(found[name], expected[name], check_exact=True)
    return there, local


def started(*arguments: object, folder: Path) -> subprocess.Popen:
    """The command, as a process of its own."""
    code = "from squealstudy.cli.app import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": MODULES},
    )


def begun(folder: Path) -> None:
    """Wait until the journal of a run names a chunk of rows."""
    deadline, journal = time.monotonic() + LONGEST, folder / "journal.jsonl"
    while not (journal.is_file() and "chunks/" in journal.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def gone(cluster: Loopback, kept: int = 0) -> bool:
    """Whether no task of ours is left, soon, or only so many."""
    deadline = time.monotonic() + LONGEST / 2
    while len(cluster.left()) > kept and time.monotonic() < deadline:
        time.sleep(0.1)
    return len(cluster.left()) <= kept


# -- the same tables -------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "text",
    [
        *(HULTEN, BOUNDARY, BELT),
        *(
            pytest.param(text, marks=pytest.mark.full_size)
            for text in (INDICES, SENSITIVITY, CYCLES, STABILITY, DESIGN)
        ),
    ],
    ids=lambda t: t.split('"')[1],
)
def test_tables_are_those_of_a_local_run(cluster, here, text):
    path = study(here, text)
    there, local = there_and_here(path, here, cluster.client)
    assert there.solved == local.solved > 0
    assert gone(cluster)
    assert sq.run(path, here / "there", client=cluster.client).solved == 0


def test_what_is_timed_is_timed_here_and_finds_the_same(cluster, here):
    study(here, HULTEN, "base.toml")
    there, _ = there_and_here(study(here, PRECISION), here, cluster.client)
    assert (there.measurements["status"] == "ok").all()
    assert len(there.errors)


@pytest.mark.parametrize(
    "in_time",
    ["", *(pytest.param(name, marks=pytest.mark.full_size) for name in ("modal", "hybrid"))],
)
def test_a_model_file_in_modes_and_in_time(cluster, here, in_time):
    """Its meshes are here: workers get what was made of them, or tasks stay."""
    path = write_blocks(here / "model", study=BLOCKS + IN_TIME.format(in_time) * bool(in_time))
    if in_time:
        path.write_text(path.read_text().replace("complex_modes", "transient"))
        # all load their kernels: those that a process has just compiled may round differently
        done = started("run", path, "-o", "compiled", "--jobs", "1", folder=here)
        done.communicate(timeout=MOST)
        assert done.returncode == 0
    there, _ = there_and_here(path, here, cluster.client)
    assert (there.points["status"] == "ok").all()


def test_histories_and_final_states_come_too_and_a_run_goes_on_from_one(cluster, here):
    path = study(here, BELT)
    for name, client in (("there", cluster.client), ("local", None)):
        sq.run(path, here / name, jobs=1, client=client)
    files = {
        name: {p.relative_to(here / name): p for p in (here / name).glob("*/*") if p.is_file()}
        for name in ("there", "local")
    }
    kept = [p for p in files["local"] if p.parts[0] in ("histories", "states")]
    assert len(kept) == 8
    for file in kept:
        assert files["there"][file].read_bytes() == files["local"][file].read_bytes()
    point = str(sq.open_results(here / "there").points["point_id"][0])
    more = f'save_every = 20\nstart = "{here / "there"}"\nstart_point = "{point}"'
    again = study(
        here, BELT.replace("save_every = 20", more).replace('"belt"\nkind', '"more"\nkind')
    )
    found = sq.run(again, here / "again", client=cluster.client).points
    assert (found["status"] == "ok").all()


def test_a_family_of_matrices_is_read_here(cluster, here):
    """Its files are: workers get what was made of them."""
    scipy.io.mmwrite(here / "m.mtx", np.eye(2))
    scipy.io.mmwrite(here / "k.mtx", np.array([[1e4, 10.0], [-10.0, 1.1e4]]))
    text = """
[study]
name = "family"
kind = "complex_modes"
[model]
name = "matrices"
[[model.term]]
matrix = "M"
file = "m.mtx"
[[model.term]]
matrix = "K"
file = "k.mtx"
coefficient = "k"
[parameters]
k = 1.0
[[sweep]]
parameter = "k"
values = [1.0, 1.5, 2.0]
[modes]
band = [1.0, 1000.0]
"""
    found = sq.run(study(here, text), here / "there", client=cluster.client)
    assert (found.points["status"] == "ok").all()


OWN_BRAKE = STUDIES / "own_brake" / "own_brake.toml"
SLOPES = {"study.kind": "sensitivity", "modes.reference_points": 0}


@pytest.mark.parametrize(
    ("changes", "local"),
    [
        ({}, False),
        ({"modes.method": "full"}, True),
        (SLOPES | {"sensitivity.parameters": ["friction"]}, False),
        (SLOPES | {"sensitivity.parameters": ["friction", "lining.E3"]}, True),
        ({"study.kind": "transient"}, False),
        ({"study.kind": "transient", "transient.representation": "hybrid"}, True),
    ],
)
def test_tasks_that_read_meshes_stay_here(changes, local):
    if changes.get("study.kind") == "transient":
        changes = changes | {"transient.duration": 1e-3, "modes.reference_points": 0}
    plan = sq.read_study(OWN_BRAKE).with_(changes).plan()
    workers = Workers(2, cluster=object())
    assert (plan.kind.usable_workers(plan, workers).cluster is None) == local


def test_an_extension_imports_from_its_own_folder_here_and_there(cluster, here, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    number = next(NUMBER)
    (here / f"helper_{number}.py").write_text(f"NAME = 'trying_{number}'\n")
    path = trying(here, num=5)
    made = here / "trying.py"
    own = next(line for line in made.read_text().splitlines() if "name =" in line)
    text = made.read_text().replace(own, f"    name = helper_{number}.NAME")
    made.write_text(text.replace("import os,", f"import helper_{number}, os,"))
    kind = own.split('"')[1]
    path.write_text(path.read_text().replace(kind, f"trying_{number}"))
    found = sq.run(path, here / "there", client=cluster.client)
    assert (found.points["status"] == "ok").all()


def test_check_tells_of_workers_and_memory(cluster, here, capsys):
    path = study(here, HULTEN)
    assert command("check", str(path), "--scheduler", str(cluster.file)) == 0
    screen, errors = capsys.readouterr()
    assert errors == ""
    told = " ".join(screen.split())
    assert "GB a worker, and here" in told
    assert f"2 workers of 1.9 to 1.9 GB; all have squealstudy {sq.__version__}" in told


# -- how tasks are handed out ----------------------------------------------------------------------
def test_tasks_are_drawn_as_workers_need_them(cluster, here):
    drawn, told = [], []
    tasks = (drawn.append(i) or -i for i in range(40))
    with connected(cluster.client, print) as place:
        workers = Workers(place.size, lambda *facts: told.append(facts), cluster=place)
        found = []
        for value in workers.each(abs, tasks, "values", total=40):
            found.append(value)
            assert len(drawn) <= len(found) + TASKS_IN_FLIGHT_PER_WORKER * 2
    assert sorted(found) == list(range(40))
    assert told[-1] == ("values", 40, 40)


def test_what_leaves_early_leaves_no_task_and_others_alone(cluster, here):
    """Also where it leaves by a signal."""
    other = cluster.client.submit(time.sleep, 2.0, pure=False)
    with connected(cluster.client, print) as place:
        for found in Workers(2, cluster=place).each(time.sleep, [0.0] + [0.5] * 50):
            assert found is None
            break
        assert gone(cluster, kept=1)  # what all tasks have in common
        with pytest.raises(InterruptedRun), interruptible():  # noqa: PT012
            for _ in Workers(2, cluster=place).each(time.sleep, [0.0] + [0.5] * 50):
                signal.raise_signal(signal.SIGTERM)
    del place, found
    assert gone(cluster)
    assert other.result(timeout=LONGEST) is None


def test_errors_of_tasks_are_those_of_local_ones(cluster, here):
    """By their texts, where they cannot be read on another machine."""
    with connected(cluster.client, print) as place:
        with pytest.raises(TypeError):
            list(Workers(2, cluster=place).each(abs, [1, "no number", 2]))
        with pytest.raises(MachineError, match="ParameterError: parameter 'mu': too large"):
            list(Workers(2, cluster=place).each(cluster_tasks.refused, ["mu"]))


def test_a_worker_with_threads_does_one_task_at_a_time():
    at_work, most = [], []

    def work(n):
        at_work.append(n)
        most.append(len(at_work))
        time.sleep(0.05)
        at_work.remove(n)

    call = pickle.dumps((len, "four"))
    assert answer(Setting(versions(), []), [], frozenset(), call).task_result == 4
    _REMEMBERED["work"] = work
    call = pickle.dumps((_remembered, 1))
    threads = [
        threading.Thread(target=answer, args=(Setting(versions(), []), [], frozenset(), call))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1, 1, 1, 1]


_REMEMBERED = {}


def _remembered(n):
    return _REMEMBERED["work"](n)


# -- what goes along -------------------------------------------------------------------------------
def test_places_in_the_cache_are_those_of_the_reader(here, monkeypatch):
    here_, outside = prepared_path("0123456789abcdef") / "training", Path("elsewhere")
    call = _pickled((print, [here_, outside]))
    monkeypatch.setenv("SQUEALSTUDY_CACHE", "/another/cache")
    _, found = pickle.loads(call)
    assert found == [Path("/another/cache/models/0123456789abcdef/training"), outside]


def test_keys_are_found_wherever_a_task_has_them():
    one, two, three = "0123456789abcdef", "00aa11bb22cc33dd", "ffeeddccbbaa9988"
    for task in ({"key": one, "of": [two, three]}, np.array([one, two, three])):
        assert {one, two, three} <= _keys(_pickled(task))
    assert {one, two} <= _keys(_pickled(np.array([one, two], dtype="S16")))


def test_contents_of_a_cache_are_held_against_their_hashes(here):
    value = ExpandedWeights(
        *(np.arange(100.0) for _ in range(len(ExpandedWeights.__annotations__)))
    )
    place = prepared_path("0123456789abcdef")
    with touched() as places:
        save_value(place, value)
    assert places == {place}
    files = contents(place)
    other = prepared_path("00aa11bb22cc33dd")
    keep_contents(other, files)
    assert is_whole(other)
    damaged = files | {next(n for n in files if n.endswith(".npy")): b"other"}
    for wrong, content in (
        (prepared_path("ffeeddccbbaa9988"), damaged),
        (prepared_path("..") / ".." / "elsewhere", files),
        (here / "elsewhere", files),
    ):
        with pytest.raises(OSError, match="not "):
            keep_contents(wrong, content)
        assert not wrong.exists()


# -- what goes wrong -------------------------------------------------------------------------------
def test_a_worker_of_another_version_is_refused_before_any_task(cluster, here, capsys):
    old = "import squealstudy.version; squealstudy.version.__version__ = '0.0.1'"
    path = study(here, HULTEN)
    cluster.add("old", before=old)
    try:
        assert command("run", str(path), "--scheduler", cluster.address) == 1
    finally:
        cluster.kill_worker()
    errors = capsys.readouterr().err
    assert "has squealstudy 0.0.1 (source " in errors
    assert "install the same versions there as here" in errors
    assert errors.count("\n") == 1
    assert not (here / "results").exists()
    late = answer, Setting(versions() | {"numpy": "0.1"}, []), [], frozenset(), b""
    with pytest.raises(MachineError, match=r"a worker has numpy .*, not 0\.1"):
        late[0](*late[1:])


@pytest.mark.full_size  # one of another version is in the test before
def test_a_worker_without_squealstudy_is_refused(own, here):
    own.add("bare", before="import sys; sys.modules['squealstudy'] = None")
    with pytest.raises(MachineError, match=r"worker tcp://\S+ cannot be used .*install the same"):
        sq.run(study(here, HULTEN), here / "out", client=own.client)


def test_without_the_library_one_sentence_names_the_extra(here, monkeypatch, capsys):
    for name in [n for n in sys.modules if n.startswith("squealstudy.engine.cluster")]:
        monkeypatch.delitem(sys.modules, name)  # which import it
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert command("run", str(study(here, HULTEN)), "--scheduler", "tcp://x:1") == 1
    told = capsys.readouterr().err
    assert "pip install 'squealstudy[cluster]'" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    "place", ["nowhere.json", pytest.param("tcp://127.0.0.1:1", marks=pytest.mark.full_size)]
)
def test_no_scheduler(here, place, monkeypatch):
    monkeypatch.setattr("squealstudy.engine.cluster_scheduler.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(MachineError, match=place):
        sq.run(study(here, HULTEN), here / "out", client=place)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.full_size  # by default workers of this machine: test_processes.py
def test_a_signal_ends_a_run_and_its_tasks(cluster, here, number, code):
    path = trying(here, seconds=0.2, num=200)
    done = started("run", path, "-o", "out", "--scheduler", cluster.address, folder=here)
    begun(here / "out")
    done.send_signal(number)
    _, errors = done.communicate(timeout=LONGEST)
    assert done.returncode == code, errors
    assert errors.endswith("squealstudy: interrupted; the same command goes on where it was\n")
    assert "distributed" not in errors
    assert gone(cluster)


@pytest.mark.full_size  # test_runner.py kills, too
def test_a_killed_client_leaves_no_task_and_the_same_command_goes_on(cluster, here):
    path = trying(here, seconds=0.2, num=100)
    done = started("run", path, "-o", "out", "--scheduler", cluster.address, folder=here)
    begun(here / "out")
    done.kill()
    done.communicate(timeout=LONGEST)
    assert gone(cluster)
    again = sq.run(path, here / "out", client=cluster.client)
    assert 0 < again.solved < 100
    assert (again.points["status"] == "ok").all()


@pytest.mark.full_size  # three workers of its own
def test_peers_replace_a_worker_that_dies_and_late_ones_help(own, here):
    own.add("a", "b")
    with connected(own.client, print) as place:
        found = Workers(2, cluster=place).each(cluster_tasks.process, [0.1] * 60)
        first = [next(found)]
        while len(set(first)) < 2:
            first.append(next(found))
        own.kill_worker()
        own.add("c")
        rest = list(found)
    assert len(first) + len(rest) == 60
    assert len(set(first + rest)) == 3
    assert len(set(rest[-20:])) == 2


@pytest.mark.full_size
def test_a_task_that_ends_its_workers_becomes_failed_rows(mortal, here):
    path = trying(here, deadly=DEAD, num=61)
    found = sq.run(path, here / "out", client=mortal.client, warn=print).points
    failed = found[found["status"] != "ok"]
    assert DEAD in failed["friction"].round(3).tolist()
    assert len(failed) < 61  # the points of its task
    assert set(failed["status"]) == {"worker_died"}
    assert failed["message"].str.contains("every worker that tried it died").all()
    assert (here / "deaths").read_text() == "died\n" * 3
    assert gone(mortal)


@pytest.mark.full_size
def test_a_task_ends_three_workers_at_most(mortal, here):
    """Of a task without rows the error is raised; three of a study's: the test above."""
    deaths = here / "deaths"
    with connected(mortal.client, print) as place, pytest.raises(MachineError, match="died"):
        list(Workers(2, cluster=place).each(cluster_tasks.die, [str(deaths)]))
    assert deaths.read_text() == "died\n" * 3
    assert (
        mortal.client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.allowed_failures) == 3
    )
    plugins = mortal.client.run_on_scheduler(lambda dask_scheduler: [*dask_scheduler.plugins])
    assert not [name for name in plugins if name.startswith("squealstudy")]


@pytest.mark.full_size  # a killed client goes on in the test before
def test_a_lost_scheduler_ends_a_run_and_the_same_command_goes_on(own, cluster, here):
    own.add("a")
    path = trying(here, seconds=0.2, num=100)
    done = started("run", path, "-o", "out", "--scheduler", own.file, folder=here)
    begun(here / "out")
    own.kill_scheduler()
    lost = time.monotonic()
    _, errors = done.communicate(timeout=LONGEST)
    assert time.monotonic() - lost < 30.0
    assert done.returncode == 1, errors
    assert errors.splitlines()[-1].endswith(
        "the scheduler does not answer any more; what is finished is kept, and the same command "
        "goes on from there"
    )
    assert "Traceback" not in errors
    again = sq.run(path, here / "out", client=cluster.client)
    assert 0 < again.solved < 100
    assert (again.points["status"] == "ok").all()
