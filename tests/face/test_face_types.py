"""The package tells programs its types: `py.typed`, and a script that mypy reads strictly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typed_face

import squealstudy
from squealstudy.engine import pictures

ROOT = Path(__file__).parents[2]


def test_the_script_with_types_does_what_it_says(tmp_path, monkeypatch):
    monkeypatch.setattr(pictures, "_REGISTERED", dict(pictures.plots()))  # what it adds ends
    typed_face.mechanics()
    typed_face.study_and_results(tmp_path)


def test_the_package_says_that_it_has_types():
    assert (Path(squealstudy.__file__).parent / "py.typed").is_file()


@pytest.mark.full_size
def test_mypy_reads_a_program_strictly_and_finds_wrong_names(tmp_path):
    """As of a user: without the settings of this project, whose own `mypy` reads it as well."""
    pytest.importorskip("mypy", reason="no mypy: nothing says that programs with types pass")
    wrong = "import squealstudy as sq\n\nsq.read_studdy('a.toml')\nsq.model('hulten').at().mods()\n"
    (tmp_path / "typed_face.py").write_text((ROOT / "tests" / "typed_face.py").read_text("utf-8"))
    (tmp_path / "wrong.py").write_text(wrong)
    options = ["--strict", "--follow-imports", "silent", "--cache-dir", str(tmp_path / "cache")]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "typed_face.py", "wrong.py"],
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert 'Module has no attribute "read_studdy"' in done.stdout
    assert '"System" has no attribute "mods"' in done.stdout
    assert "Found 2 errors in 1 file" in done.stdout, done.stdout + done.stderr
