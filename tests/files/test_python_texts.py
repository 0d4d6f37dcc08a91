"""Code of extensions is what stands in their texts, whatever bytecode lies beside them."""

from __future__ import annotations

import subprocess
import sys
from importlib._bootstrap_external import _code_to_timestamp_pyc
from importlib.util import cache_from_source
from pathlib import Path

import pytest

MAIN = """\
import {helper}
from squealstudy.engine.pictures import register_plot
print("text", {helper}.SAID)
@register_plot(needs=("points",))
def own(results):
    return None
"""
RUN = """\
import sys
from squealstudy.extensions import load_extension
load_extension(sys.argv[1])
"""


def forge(path: Path) -> None:
    """Bytecode of something else, which Python takes for that of the text."""
    code = compile("print('bytecode'); SAID = 'bytecode'", str(path), "exec")
    state = path.stat()
    made = Path(cache_from_source(str(path)))
    made.parent.mkdir(exist_ok=True)
    made.write_bytes(_code_to_timestamp_pyc(code, int(state.st_mtime), state.st_size))
    path.with_suffix(".pyc").write_bytes(made.read_bytes())


@pytest.mark.parametrize(
    "helper", [pytest.param("helping_text", marks=pytest.mark.full_size), "helping_package.inner"]
)
def test_forged_bytecode_is_not_executed(tmp_path, helper):
    main, inner = tmp_path / "own.py", tmp_path / f"{helper.replace('.', '/')}.py"
    inner.parent.mkdir(exist_ok=True)
    (tmp_path / "other.py").write_text("SAID = 'text'\n")
    if inner.parent != tmp_path:
        (inner.parent / "__init__.py").write_text("\n")
        forge(inner.parent / "__init__.py")
    inner.write_text("import other\nSAID = other.SAID\n")
    main.write_text(MAIN.format(helper=helper))
    for path in (main, inner, tmp_path / "other.py"):
        forge(path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.pyc")}
    done = subprocess.run(
        [sys.executable, "-c", RUN, main], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["text", "text"]
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.pyc")} == before
    honest = [sys.executable, "-c", "import other; print(other.SAID)"]
    said = subprocess.run(honest, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert "bytecode" in said.stdout  # Python's own import takes it
