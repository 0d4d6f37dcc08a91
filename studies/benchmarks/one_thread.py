"""Imported before numpy: linear algebra in one thread, as in workers.

Processor time is then that of one core; on a loaded machine two threads cost several times one.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
