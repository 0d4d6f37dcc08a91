"""What the checks of files of others cost when the results of a large study are opened and read.

    python studies/benchmarks/opening_cost.py [--points 100001] [--rounds 15]

Opens results of so many design points and reads their tables, in alternation with all checks and
with each kind of them left out; seconds of the processor, the least of the rounds of each, for
whatever else runs on the machine only adds to them.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import squealstudy as sq
from squealstudy.engine import journal, manifest_file, result_tables, store, table_files

STUDY = """\
[study]
name = "many"
kind = "complex_modes"
[model]
name = "hulten"
[[sweep]]
parameter = "friction"
start = 0.0
stop = 0.6
num = {points}
[modes]
band = [1.0, 1000.0]
"""
LEFT_OUT: dict[str, tuple[tuple[object, str, Callable[..., object]], ...]] = {
    "nothing": (),
    "hashes": ((journal, "_hash_of", lambda path, state: ""),),
    "facts of the manifest": ((manifest_file, "check_facts", lambda *given: None),),
    "columns": ((result_tables, "misfit", lambda *given: ""),),
    "room in memory": ((table_files, "expect_room", lambda *given: None),),
}


def seconds(directory: Path, left_out: str) -> float:
    """Of the processor, to open results and read points and modes."""
    journal._hashes.clear()
    if left_out == "hashes":  # what a file should have is what it is said to have
        patched = [mock.patch.object(store.Journal, "fault", return_value="")]
    else:
        patched = [mock.patch.object(*one) for one in LEFT_OUT[left_out]]
    for one in patched:
        one.start()
    began = time.process_time()
    found = sq.open_results(directory)
    for name in ("points", "modes"):
        found.table(name)
    spent = time.process_time() - began
    for one in patched:
        one.stop()
    return spent


def main() -> None:
    """Print what each kind of check takes of an opening."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=100_001)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        study, directory = Path(temporary, "many.toml"), Path(temporary, "results")
        study.write_text(STUDY.format(points=arguments.points))
        sq.run(study, directory, jobs=1, yes=True)
        found: dict[str, list[float]] = {name: [] for name in LEFT_OUT}
        for _ in range(arguments.rounds):
            for name, spent in found.items():
                spent.append(seconds(directory, name))
        whole = min(found["nothing"])
        print(f"{arguments.points:,} design points: opened and read in {whole:.3f} CPU-s")
        for name in list(LEFT_OUT)[1:]:
            print(f"{name}: {100 * (1 - min(found[name]) / whole):.1f} % of it")


if __name__ == "__main__":
    main()
