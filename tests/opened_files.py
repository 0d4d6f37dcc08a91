"""Runs commands in this process and prints which files they open, one JSON list.

    python opened_files.py FOLDER

FOLDER holds the study files that COMMANDS name. Python tells of each file that it opens itself;
pyarrow, which opens files in its own code, is asked by the names of its functions.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import sys
import sysconfig
from pathlib import Path

COMMANDS = """
run study.toml --jobs 1 --no-pictures
check study.toml --jobs 1
check results/blocks
rank results/blocks --names --why
plot results/blocks
shape results/blocks --no-picture --page --vtu --uff
report results/blocks --output page.html --no-shapes
explore results/blocks --output explore.html
inspect blocks.toml
export study.toml --output exported
run scatter.toml --jobs 1 --no-pictures
robust results/scatter
rank results/scatter --csv
run modes.toml --jobs 1 --no-pictures
run belt.toml --jobs 1 --no-pictures
compare results/modes results/belt
schema
examples own_brake
examples
new new.toml --model hulten
""".strip().split("\n")
OF_PYARROW = {"read_table": 0, "read_schema": 0, "write_table": 1}  # place of the path
opened: set[str] = set()
listening = True


def note(event: str, arguments: tuple[object, ...]) -> None:
    """An audit hook: it cannot be taken off, so it stops listening."""
    if listening and event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
        opened.add(os.path.realpath(os.fsdecode(os.fspath(arguments[0]))))


def noted(function, place: int):
    @functools.wraps(function, updated=())
    def told(*arguments, **options):
        if len(arguments) > place:
            note("open", (arguments[place],))
        return function(*arguments, **options)

    return told


def main() -> None:
    """Run the commands; those of them that fail end this."""
    global listening
    sys.addaudithook(note)
    import pyarrow.parquet as pq

    class File(pq.ParquetFile):
        def __init__(self, source, *arguments, **options):
            note("open", (source,))
            super().__init__(source, *arguments, **options)

    pq.ParquetFile = File
    for name, place in OF_PYARROW.items():
        setattr(pq, name, noted(getattr(pq, name), place))
    from squealstudy.cli.app import main as squealstudy

    os.chdir(sys.argv[1])
    for command in COMMANDS:
        sys.argv = ["squealstudy", *command.split()]
        with contextlib.redirect_stdout(io.StringIO()):
            try:
                squealstudy()
            except SystemExit as end:
                if end.code and command.split()[0] != "inspect":  # which tells of tiny parts
                    sys.exit(f"{command}: exit code {end.code}")
    listening = False
    import squealstudy as package

    code = [*sysconfig.get_paths().values(), sys.prefix, sys.base_prefix, *package.__path__]
    folders = {os.path.realpath(path) for path in (*code, Path(__file__).parent)}
    files = [path for path in opened if not os.path.isdir(path)]  # synchronised
    told = sorted(path for path in files if not any(path.startswith(f + "/") for f in folders))
    sys.stdout.write(json.dumps(told))


if __name__ == "__main__":
    main()
