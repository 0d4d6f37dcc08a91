"""What a run survives: kills, damaged files, bad input, a bad environment.

    python studies/benchmarks/faults.py [--part kills ..] [--share 1.0] [--seed 1] [--only NAME ..]

Small studies of every kind are run undisturbed, then disturbed, then to the end, and their tables
compared; files are mutated and read. At full size: 200 kills and 40 of brakes from meshes, 1,000
damaged files, 400 hostile directories, 400 changed entries of caches, 10,000 study files, 2,000
files of matrices, 2,000 models of one's own, 200 numbers that are none, 30 faults of the
environment, 60 limits of memory, 12 runs on workers without a study's files. What is not as it
should be is listed as it is found; a table of all verdicts stands at the end. Exits with 1 where
anything was wrong.

Linux only; psutil is needed. As root a small file system is made for "disk full", and what depends
on permissions is tried under a user who is not root.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import tempfile
import time
from pathlib import Path

from fault_campaign.finding import Finding, table

PARTS = {
    "kills": 200,
    "damage": 1_000,
    "hostile": 400,
    "study_files": 10_000,
    "matrix_files": 2_000,
    "model_files": 2_000,
    "environment": 30,
    "cache_entries": 400,
    "bad_numbers": 200,
    "mesh_kills": 40,
    "memory_limits": 60,
    "far_workers": 12,
}


def main() -> None:
    """Run the parts and print what they found."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--part", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--share", type=float, default=1.0, help="of the full size")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="work in this folder and keep it")
    arguments = parser.parse_args()
    findings: list[Finding] = []
    with tempfile.TemporaryDirectory(prefix="faults.") as temporary:
        work = (arguments.keep or Path(temporary)).resolve()
        for part in arguments.part:
            count, began = max(1, round(arguments.share * PARTS[part])), time.monotonic()
            module = importlib.import_module(f"fault_campaign.{part}")
            for finding in module.run(count, arguments.seed, work):
                findings.append(finding)
                if not finding.good:
                    print(finding, flush=True)
            print(f"{part}: {count} cases, {time.monotonic() - began:.0f} s", flush=True)
    print(table(findings))
    sys.exit(not all(finding.good for finding in findings))


if __name__ == "__main__":
    main()
