"""README and pages beside it: snippets run, links and lists are true. The site: `test_docs.py`."""

import re
import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from study_runs import command

ROOT = Path(__file__).parents[2]
STUDIES = ROOT / "studies"
DOCS = ROOT / "docs"
GALLERY = DOCS / "reference" / "shipped-studies.md"
PAGES = [*(ROOT / f"{n}.md" for n in ("README", "CHANGELOG", "SECURITY"))]
PAGES += [*sorted(STUDIES.rglob("*.md")), ROOT / "squealstudy" / "README.md"]
PAGES += sorted(p for p in DOCS.rglob("*.md") if "generated" not in p.parts)
SNIPPET = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
MOST_LINES = 120  # of README.md
MOST_WORDS = 52_690  # of all pages written by hand: what they had before there was a site
MOST_WORDS_OF_THE_WAY = 400
LARGEST = 60_000  # bytes of a picture of the gallery


def shipped() -> list[str]:
    """Study files, relative to studies/; model files beside them are none."""
    found = (p for p in STUDIES.rglob("*.toml") if "study" in tomllib.loads(p.read_text("utf-8")))
    names = (p.relative_to(STUDIES) for p in found)
    return sorted(str(n) for n in names if n.parts[0] != "benchmarks")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """Of the headings, as they are linked to."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def names_after(page: Path) -> dict[str, Any]:
    """What the names of a page's snippets stand for at its end, run in the current directory."""
    snippets = SNIPPET.findall(page.read_text(encoding="utf-8"))
    assert snippets
    names: dict[str, Any] = {}
    with mpl.rc_context({"backend": "agg"}):
        for snippet in snippets:
            exec(compile(snippet, str(page), "exec"), names)
    return names


def test_snippets_of_readme(first_brake, monkeypatch):
    monkeypatch.chdir(first_brake)
    names = names_after(ROOT / "README.md")
    assert len(names["results"].points) == 3 * 2 * 2


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MOST_LINES


def test_readme_shows_the_shipped_study():
    blocks = re.findall(r"^```toml\n(.*?)^```$", PAGES[0].read_text("utf-8"), re.M | re.S)
    assert (STUDIES / "softer_lining.toml").read_text(encoding="utf-8") in blocks


@pytest.mark.full_size
def test_readme_shows_what_its_study_prints(tmp_path, capsys):
    """To the last digit that a number has on the screen: one unit of it may be round-off."""
    shown = re.findall(r"^```text\n(.*?)^```$", PAGES[0].read_text("utf-8"), re.M | re.S)[0]
    study = str(STUDIES / "softer_lining.toml")
    assert command("run", study, "-o", str(tmp_path / "results"), "--no-pictures") == 0
    printed = capsys.readouterr().out.split()[: len(shown.split())]
    for one, other in zip(shown.split(), printed, strict=True):
        try:
            assert float(one.strip(":.")) == pytest.approx(float(other.strip(":.")), rel=1e-3), one
        except ValueError:
            assert one == other


def test_pages_have_fewer_words_than_before():
    pages = {*PAGES, ROOT / "squealstudy" / "THEORY.md", STUDIES / "paper" / "page.txt"}
    pages -= {STUDIES / "paper" / "README.md"}  # made by paper.py
    assert sum(len(p.read_text(encoding="utf-8").split()) for p in pages) < MOST_WORDS


def test_every_study_is_in_the_gallery_once():
    links = LINK.findall(GALLERY.read_text(encoding="utf-8"))
    linked = [link.removeprefix("../../studies/") for link in links if link.endswith(".toml")]
    assert sorted(linked) == shipped()


def test_a_comment_at_the_head_says_what_a_study_asks():
    for file in shipped():
        text = (STUDIES / file).read_text(encoding="utf-8")
        assert text.startswith("# "), file
        assert tomllib.loads(text)["study"]["description"], file


def test_every_benchmark_is_on_its_page():
    page = (STUDIES / "benchmarks" / "README.md").read_text(encoding="utf-8")
    for file in (STUDIES / "benchmarks").glob("*.py"):
        assert file.name in page, file.name


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        if "://" in link:
            continue
        path, _, heading = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not heading or heading in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_name_files_that_exist(page):
    text = page.read_text(encoding="utf-8")
    for file in re.findall(r"(?<![\w/.])studies/[\w/]+\.(?:toml|py)", text):
        assert file == "studies/NAME.toml" or (ROOT / file).is_file(), file


@pytest.mark.parametrize("page", ["docs/explanation/plan-to-row.md", "squealstudy/README.md"])
def test_files_of_the_way_of_a_design_point_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    named = set(re.findall(r"(?<![\w/.])(?:\w+/)+\w+\.py", text))
    assert {"kinds/complex_modes/tables.py", "engine/chunk_writer.py"} <= named
    for file in named:
        assert (ROOT / "squealstudy" / file).is_file() or (ROOT / file).is_file(), file


def test_the_page_of_tests_names_files_that_exist():
    text = (ROOT / "tests" / "README.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:\w+/)?[\w*]+\.py)`", text)
    assert len(named) > 100
    assert not [name for name in named if not list((ROOT / "tests").glob(name))]


def test_the_page_from_plan_to_row_is_short():
    page = DOCS / "explanation" / "plan-to-row.md"
    assert len(page.read_text(encoding="utf-8").split()) <= MOST_WORDS_OF_THE_WAY


def test_pictures_of_the_gallery_are_small():
    for link in LINK.findall(GALLERY.read_text(encoding="utf-8")):
        if link.endswith(".png"):
            assert (GALLERY.parent / link).stat().st_size <= LARGEST, link
