"""Kernels that few tests need: each day as plain Python, compiled on one day of ten."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = ("motion/test_integrators.py", "motion/test_hybrid.py", "stability/test_explicit.py")


def test_kernels_do_as_python_what_short_tests_ask_of_them():
    """Those marked `as_python`, in a process without the compiler: orders, twins, ends of runs."""
    asked = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider"]
    files = [str(ROOT / "tests" / name) for name in FILES]
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTEST_ADDOPTS": ""}
    done = subprocess.run(
        [*asked, "-m", "as_python", *files], cwd=ROOT, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (passed,) = re.findall(r"(\d+) passed", done.stdout)
    assert int(passed) >= 30
