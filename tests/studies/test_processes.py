"""Worker processes: they end with their parent, leave signals to it, and know its files."""

from __future__ import annotations

import gc
import json
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path

import psutil
import pytest

from squealstudy.engine import workers as module
from squealstudy.engine.workers import TASKS_IN_FLIGHT_PER_WORKER, Workers, one_thread
from squealstudy.errors import MachineError
from squealstudy.machine.processes import starting_processes

EXTENSION = Path(__file__).parents[1] / "extension" / "my_friction_curve.py"
STUDY = """
import time
from squealstudy.engine.workers import Workers
list(Workers(2).each(abs, [1, 2, 3, 4]))
"""
WAITING = """
import time
from squealstudy.engine.workers import Workers

class Late:  # workers start, and get no task
    def __reduce__(self):
        time.sleep(100.0)

list(Workers(2).each(id, [Late(), Late()]))
"""
COMMAND = """
import sys, time
from squealstudy import face
from squealstudy.cli.app import main
from squealstudy.engine.workers import Workers

def run(*_):
    print("begun", flush=True)
    list(Workers(2).each(time.sleep, [100.0] * 4))

face.read_study = face.run = run
sys.argv[1:] = ["run", "study.toml"]
main()
"""
RENEWED = f"""
import json, os, sys
from squealstudy.engine.workers import Workers
from squealstudy.extensions import load_extension

def found(_task):
    return os.getpid(), any(name.startswith("squealstudy_extension") for name in sys.modules)

def show():
    print(json.dumps(list(Workers(2).each(found, range(8)))))

show()
show()
load_extension({str(EXTENSION)!r})
show()
"""
WARMING = """
import time
from squealstudy.motion.warmup import begin_warming
begin_warming()
time.sleep(100)
"""
LONGEST = 20.0  # s: on a machine in use


@pytest.fixture(autouse=True)
def _interrupts_are_heeded():
    """Also where a shell runs the tests in the background, and ignores them."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def started(code, **environment):
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | environment,
    )


def descendants(process, number):
    """Its processes, once there are so many."""
    deadline, parent = time.monotonic() + LONGEST, psutil.Process(process.pid)
    while len(found := parent.children(recursive=True)) < number:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    return found


def all_gone(processes):
    _, alive = psutil.wait_procs(processes, timeout=LONGEST)
    return not [p for p in alive if p.status() != psutil.STATUS_ZOMBIE]


@pytest.mark.parametrize("number", [1, 3])  # of processes there are: as workers appear
def test_a_killed_parent_leaves_no_worker_behind(number):
    with started(WAITING) as parent:
        found = descendants(parent, number)
        parent.kill()
        assert all_gone(found)


def test_a_killed_run_is_not_commented_on_by_the_standard_library():
    with started(COMMAND) as parent:
        assert parent.stdout.readline() == "begun\n"
        found = descendants(parent, 3)
        time.sleep(1.0)
        parent.kill()
        assert parent.communicate(timeout=LONGEST) == ("", "")
        assert all_gone(found)


def test_a_killed_parent_leaves_no_compilation_behind(tmp_path):
    with started(WARMING, NUMBA_CACHE_DIR=str(tmp_path)) as parent:
        found = descendants(parent, 1)
        parent.kill()
        assert all_gone(found)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("send", "number", "code"),
    [
        (os.killpg, signal.SIGINT, 130),  # as a terminal does
        (os.kill, signal.SIGTERM, 143),  # as a scheduler does
        pytest.param(os.kill, signal.SIGINT, 130, marks=pytest.mark.full_size),
        pytest.param(os.killpg, signal.SIGTERM, 143, marks=pytest.mark.full_size),
    ],
)
def test_a_signal_ends_a_run_with_one_sentence(send, number, code):
    with started(COMMAND) as parent:
        assert parent.stdout.readline() == "begun\n"
        found = descendants(parent, 3)
        send(parent.pid, number)
        screen = parent.communicate(timeout=LONGEST)
        assert screen == ("", "squealstudy: interrupted; the same command goes on where it was\n")
        assert parent.returncode == code
        assert all_gone(found)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_waits_for_processes_that_are_starting():
    """Also one that comes to another thread, whose mask is its own."""
    now, order = threading.Event(), []

    def send():
        now.wait(LONGEST)
        signal.raise_signal(signal.SIGINT)
        order.append("sent")

    other = threading.Thread(target=send)
    other.start()
    with pytest.raises(KeyboardInterrupt), starting_processes():  # noqa: PT012 - it raises at its end
        now.set()
        other.join(LONGEST)
        time.sleep(0.01)
        order.append("started")
    assert order == ["sent", "started"]


def test_a_worker_that_is_killed_ends_the_work_and_others_start():
    with pytest.raises(MachineError, match="a worker process died"):
        list(Workers(2).each(os._exit, [9, 9, 9]))
    assert sorted(Workers(2).each(abs, [-1, -2, -3])) == [1, 2, 3]


def test_an_error_ends_the_work_at_once():
    began = time.monotonic()
    with pytest.raises(TypeError):
        list(Workers(2).each(time.sleep, [100.0, "no number", 100.0]))
    assert time.monotonic() - began < LONGEST


@pytest.mark.parametrize(("jobs", "patience"), [(1, 0.0), (2, 0.0), (2, 100.0)])
def test_tasks_are_drawn_as_they_are_needed(jobs, patience):
    """And all of them are done, those that are drawn first too."""
    drawn, told = [], []
    tasks = (drawn.append(i) or -i for i in range(40))
    workers = Workers(jobs, lambda *facts: told.append(facts), lambda: patience)
    found = []
    for value in workers.each(abs, tasks, "values", total=40):
        found.append(value)
        assert len(drawn) <= len(found) + TASKS_IN_FLIGHT_PER_WORKER * jobs
    assert sorted(found) == list(range(40))
    assert told == [("values", done, 40) for done in range(41)]


@pytest.mark.full_size  # memory of thousands of tasks
def test_tasks_and_results_are_not_kept():
    kept = weakref.WeakSet()

    class Task(str):  # of which weak references are possible
        pass

    def tasks():
        for _ in range(6):
            task = Task()
            kept.add(task)
            yield task
            del task

    for _ in Workers().each(len, tasks()):
        gc.collect()
        assert len(kept) <= 2


@pytest.mark.full_size  # by default a guardless program and killed workers: around
def test_workers_stay_until_an_extension_comes():
    done = subprocess.run([sys.executable, "-c", RENEWED], capture_output=True, text=True)
    assert done.stderr == ""
    first, again, others = map(json.loads, done.stdout.splitlines())
    assert {known for _, known in first + again} == {False}
    assert {known for _, known in others} == {True}
    assert len({pid for pid, _ in first + again}) <= 2
    assert not {pid for pid, _ in first + again} & {pid for pid, _ in others}


def test_a_program_needs_no_guard(tmp_path):
    """Workers do not execute the main file of the program: it would run the study once more."""
    program = tmp_path / "program.py"
    program.write_text("print('once')" + STUDY)
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("once\n", "")


@pytest.mark.skipif(sys.platform == "win32", reason="NOT TRIED HERE: signals of POSIX")
def test_an_interrupt_during_the_imports_leaves_no_traceback() -> None:
    code = (
        "import os, signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from squealstudy.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_thread_pools_are_looked_for_again_where_modules_changed(monkeypatch):
    """One module gone and another one there: as many as before, and perhaps another BLAS."""
    monkeypatch.setitem(sys.modules, "squealstudy_first", module)
    with one_thread():
        looked = module._thread_pools.cache_info().misses
    with one_thread():
        assert module._thread_pools.cache_info().misses == looked
    monkeypatch.delitem(sys.modules, "squealstudy_first")
    monkeypatch.setitem(sys.modules, "squealstudy_second", module)
    with one_thread():
        assert module._thread_pools.cache_info().misses == looked + 1
