"""For hidden cells of the tutorials: files of a page, and commands as a reader types them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

FILE = re.compile(r"^```toml\n# (\S+\.toml)(?:, more)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def write_files(page: str, most: int = 100) -> None:
    """Write the TOML files that a page shows into the current directory.

    Parameters
    ----------
    page : str
        Below `docs`, without ending. The first line of a block names its file; those of one file
        are joined.
    most : int
        Blocks of a file that are written, from the first on.
    """
    path = Path(os.environ["SQUEALSTUDY_PAGES"]) / f"{page}.md"
    found: dict[str, list[str]] = {}
    for name, text in FILE.findall(path.read_text(encoding="utf-8")):
        found.setdefault(name, []).append(text)
    for name, texts in found.items():
        Path(name).write_text("\n".join(texts[:most]), encoding="utf-8")


def picture(pattern: str, width: int | None = None) -> Any:
    """The first picture that fits, as a notebook shows it; nothing where there is no notebook."""
    path = next(Path().glob(pattern))
    try:
        from IPython.display import Image
    except ImportError:
        return None
    return Image(str(path), width=width)


def command(line: str, code: int = 0, only: str = "") -> str:
    """Print what `squealstudy LINE` prints, and return it; AssertionError for another exit code.

    With `only` the lines alone that hold it, of standard error too.
    """
    plain = {k: v for k, v in os.environ.items() if "COLOR" not in k}  # which a notebook forces
    asked = [sys.executable, "-m", "squealstudy", *line.split()]
    done = subprocess.run(asked, capture_output=True, text=True, env=plain)
    assert done.returncode == code, done.stderr
    lines = [line.rstrip() for line in (done.stdout + (done.stderr if only else "")).splitlines()]
    sys.stdout.writelines(f"{line}\n" for line in lines if only in line)
    return "\n".join([*lines, done.stderr])
