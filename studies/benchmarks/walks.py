"""The way of one design point through the package: files and functions, by kind of study.

    python studies/benchmarks/walks.py [complex_modes transient ...] [--list] [--model hoffmann]

The smallest study of a kind, of the coarse brake, is run twice, each time in a process of its own:
in the second, models and kernels are there. `sys.setprofile` then notes each function of the
package that a worker calls from a task to its rows, and that the tables need after that. Not
counted are comprehensions, lambdas and what modules do as they are imported. `--list` shows the
functions by file, with lines and calls, in the order in which they are met.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

HEAD = """
[study]
name = "walk"
kind = "{kind}"

[model]
name = "{model}"
{mesh}

[parameters]
friction = 0.5
"""
MESHES = {"disc_brake": 'mesh = "coarse"', "hoffmann": ""}
# the tables of a study file that a kind needs beside those
SECTIONS = {
    "complex_modes": "",
    "transient": "[transient]\nduration = 0.002\nstep = 1e-6\nperturbation = 1e-3\n",
    "limit_cycles": '[limit_cycles]\nharmonics = 3\nfamilies = "screened"\nscreen = 1.0\n',
    "sensitivity": "",
}
PARTS = ("worker", "tables")
CHOSEN = ("laws/", "modes/rungs/")  # a study chooses those of its own: told apart


class Walk:
    """Functions of the package that are called, in their order.

    Attributes
    ----------
    calls : dict of (file, name, first line, last line) -> int
    """

    def __init__(self, package: Path) -> None:
        self.root = f"{package}/"
        self.calls: dict[tuple[str, str, int, int], int] = {}
        self.importing = 0

    def note(self, frame: FrameType, event: str, _: Any) -> None:
        """What `sys.setprofile` calls."""
        code = frame.f_code
        if code.co_name == "<module>":
            self.importing += {"call": 1, "return": -1}.get(event, 0)
        if event != "call" or self.importing or code.co_name.startswith("<"):
            return
        if code.co_filename.startswith(self.root):
            lines = [line for *_, line in code.co_lines() if line]
            name = code.co_qualname.replace(".<locals>", "")
            key = (code.co_filename[len(self.root) :], name, code.co_firstlineno, max(lines))
            self.calls[key] = self.calls.get(key, 0) + 1

    def of(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, walked through."""

        def walked(*args: Any, **kwargs: Any) -> Any:
            sys.setprofile(self.note)
            try:
                return function(*args, **kwargs)
            finally:
                sys.setprofile(None)

        return walked


def walk(study: Path, output: Path) -> dict[str, list[list[Any]]]:
    """Run a study in this process; (file, function, first, last line, calls) of each part."""
    import squealstudy
    from squealstudy import read_study
    from squealstudy.engine import runner

    package = Path(squealstudy.__file__).parent
    walks = {part: Walk(package) for part in PARTS}
    runner.solve_chunk = walks["worker"].of(runner.solve_chunk)
    plan = read_study(study).plan()
    kind = plan.kind
    object.__setattr__(kind, "build_tables", walks["tables"].of(kind.build_tables))
    runner.run_study(plan, output, jobs=1, yes=True, fresh=True)
    return {p: [[*key, n] for key, n in w.calls.items()] for p, w in walks.items()}


def walks_of(kind: str, model: str) -> dict[str, list[list[Any]]]:
    """As `walk`, of the second run of a kind's smallest study."""
    with tempfile.TemporaryDirectory() as name:
        study = Path(name) / "walk.toml"
        head = HEAD.format(kind=kind, model=model, mesh=MESHES[model])
        study.write_text(head + SECTIONS[kind], encoding="utf-8")
        command = [sys.executable, __file__, "--run", str(study), str(study.with_suffix(""))]
        for _ in range(2):
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(done.stdout + done.stderr)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def show(functions: list[list[Any]]) -> None:
    """Functions of a part by file, with their lines and calls."""
    for file in dict.fromkeys(row[0] for row in functions):
        print(f"  {file}")
        for _, name, first, last, calls in (row for row in functions if row[0] == file):
            print(f"    {name:<50} {last - first + 1:>4} lines {calls:>6} calls")


def main() -> None:
    """Print how many files and functions there are."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kinds", nargs="*", default=list(SECTIONS), metavar="KIND")
    parser.add_argument("--list", action="store_true", help="each function")
    parser.add_argument("--model", choices=MESHES, default="disc_brake")
    parser.add_argument("--run", nargs=2, type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        print(json.dumps(walk(*arguments.run)))
        return
    print(f"{'kind':<16}{'part':<10}{'files':>6}{'less laws, rungs':>18}{'functions':>11}")
    for kind in arguments.kinds:
        walks = walks_of(kind, arguments.model)
        walks["both"] = [row for functions in walks.values() for row in functions]
        for part, functions in walks.items():
            files = {row[0] for row in functions}
            counted = [file for file in files if not file.startswith(CHOSEN)]
            n_functions = len({tuple(row[:3]) for row in functions})
            print(f"{kind:<16}{part:<10}{len(files):>6}{len(counted):>18}{n_functions:>11}")
            if arguments.list and part != "both":
                show(functions)
        sys.stdout.flush()


if __name__ == "__main__":
    main()
