"""Kernels compiled ahead of the workers."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import pytest

from squealstudy.kernels.newmark_batch import newmark_batch
from squealstudy.motion import warmup

SCRIPT = """
from squealstudy.motion.warmup import warm_kernels
from squealstudy.kernels.newmark_batch import newmark_batch
print(warm_kernels())
print(sum(newmark_batch.stats.cache_misses.values()))
"""


def test_the_kernel_is_ready():
    assert warmup.warm_kernels() < 120
    assert newmark_batch.signatures
    assert warmup.warm_kernels() < 0.5


def test_another_process_finds_the_kernels_compiled():
    warmup.warm_kernels()
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    seconds, misses = done.stdout.split()
    assert misses == "0"
    assert float(seconds) < 20


@pytest.mark.parametrize(("compiled", "lines"), [(False, 1), (True, 0)])
def test_compiling_is_told(compiled, lines, monkeypatch, caplog):
    monkeypatch.setattr(warmup, "_is_compiled", lambda: compiled)
    caplog.set_level("INFO", "squealstudy")
    warmup.warm([])
    assert sum("are compiled, once" in text for text in caplog.messages) == lines


def test_warming_waits_for_another_process():
    finished = []
    thread = threading.Thread(target=lambda: finished.append(warmup.warm_kernels()))
    with warmup.alone():
        thread.start()
        time.sleep(0.3)
        assert not finished
    thread.join(120)
    assert finished[0] > 0.2
