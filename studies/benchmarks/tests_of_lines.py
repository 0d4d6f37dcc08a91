"""Which tests run a line, and how long they take: a plugin of pytest over coverage.py.

Contexts of coverage are the tests and, apart from them, the fixtures that several tests share: what
a fixture runs, all tests that need it run.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

SHARED = "SQUEALSTUDY_TESTS_SHARED"
SLOW = 10.0  # seconds from which on a test is left out
MERGED = ("seconds", "shared", "needs", "left_out")
OPTIONS = ("-q", "-n", "0", "-p", "no:cacheprovider", "--tb=no")


class Recorder:
    """Plugin of pytest: seconds of tests and shared fixtures, and what each of them runs."""

    def __init__(self, coverage: Any, kept: Path) -> None:
        self.coverage, self.kept = coverage, kept
        self.seconds: dict[str, float] = {}  # of tests that pass, without what they share
        self.shared: dict[str, float] = {}  # of fixtures that several tests share
        self.needs: dict[str, list[str]] = {}
        self.left_out: dict[str, str] = {}  # tests that fail or are too slow

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        def too_slow(*_):
            raise pytest.fail.Exception("too slow")

        known = item._fixtureinfo.name2fixturedefs
        used = [known[name][-1] for name in item._fixtureinfo.names_closure if name in known]
        self.needs[item.nodeid] = [_context(f) for f in used if f.scope != "function"]
        self.test, self.start, self.apart = item.nodeid, _seconds(), 0.0
        self.coverage.switch_context(item.nodeid)
        signal.signal(signal.SIGPROF, too_slow)
        signal.setitimer(signal.ITIMER_PROF, SLOW, 2.0)  # again where the first is caught
        done = yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        if fixturedef.scope == "function":
            return (yield)
        self.coverage.switch_context(_context(fixturedef))
        start = _seconds()
        value = yield
        self.shared[_context(fixturedef)] = _seconds() - start
        self.apart += _seconds() - start
        self.coverage.switch_context(self.test)
        return value

    def pytest_sessionfinish(self):
        for path in Path(os.environ[SHARED]).glob("*.pickle"):
            if not (self.kept / path.name).exists():
                shutil.copy(path, self.kept)

    def pytest_runtest_logreport(self, report):
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = _seconds() - self.start - self.apart
        elif report.failed:
            self.seconds.pop(report.nodeid, None)
            self.left_out[report.nodeid] = report.when


class Made:
    """Plugin of pytest: what `Recorder` kept of fixtures is taken as it is."""

    def __init__(self, kept: Path, names: Sequence[str] = ("brake", "reduced")) -> None:
        self.paths = [kept / f"{name}.pickle" for name in names]

    def pytest_sessionstart(self):
        for path in filter(Path.exists, self.paths):
            shutil.copy(path, os.environ[SHARED])


def _context(fixture: Any) -> str:
    return f"fixture {fixture.baseid}::{fixture.argname}"


def _seconds() -> float:
    return sum(os.times()[:4])


def record(folders: Sequence[Path], root: Path, test: Path, into: Path) -> None:
    """Run a file of tests under coverage of some folders, and write what was found to a file.

    What processes of a test session share, `conftest.shared`, is kept beside that file.
    """
    import coverage

    measured = coverage.Coverage(
        data_file=None, source=[str(folder) for folder in folders], config_file=False
    )
    recorder = Recorder(measured, into.parent)
    measured.start()
    pytest.main([*OPTIONS, str(test)], plugins=[recorder, Made(into.parent)])
    measured.stop()
    data = measured.get_data()
    found: dict[str, Any] = {k: getattr(recorder, k) for k in MERGED}
    found["lines"] = {
        str(Path(name).relative_to(root)): data.contexts_by_lineno(name)
        for name in data.measured_files()
    }
    into.write_text(json.dumps(found))


def merged(paths: Sequence[Path]) -> dict[str, Any]:
    """What `record` found, over several files of tests."""
    whole: dict[str, Any] = {"lines": {}} | {name: {} for name in MERGED}
    for path in paths:
        found = json.loads(path.read_text())
        # a fixture that was taken as it is has cost nothing
        found["shared"] = {k: max(s, whole["shared"].get(k, s)) for k, s in found["shared"].items()}
        for name in MERGED:
            whole[name] |= found[name]
        for file, lines in found["lines"].items():
            into = whole["lines"].setdefault(file, {})
            for line, contexts in lines.items():
                into[line] = sorted({*into.get(line, []), *contexts})
    return whole
