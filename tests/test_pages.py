"""The pages for a reader from outside: their snippets run, their links and lists are true."""

import re
import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import squealstudy
from squealstudy.cli.app import app
from squealstudy.models.components.formulations import FORMULATIONS

ROOT = Path(__file__).parents[1]
STUDIES = ROOT / "studies"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(STUDIES.rglob("*.md"))]
SNIPPET = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
MOST_LINES = 150  # of README.md
LARGEST = 60_000  # bytes of a picture of the gallery
TINY = [  # first_brake.toml in seconds
    ("start = 0.1\nstop = 0.7\nnum = 7", "values = [0.1, 0.4, 0.5]"),
    ("values = [0.9, 1.0, 1.1]", "values = [1.0, 1.1]"),
    ("8000.0]", "3500.0]\nreference_points = 0\nrefine_tracking = false"),
]


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


@pytest.fixture(scope="module")
def first_brake(tmp_path_factory, tiny_brake) -> Path:
    """A folder with a smaller studies/first_brake.toml and its results/first_brake."""
    text = (STUDIES / "first_brake.toml").read_text(encoding="utf-8")
    for old, new in TINY:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    folder = tmp_path_factory.mktemp("pages")
    path = folder / "studies" / "first_brake.toml"
    path.parent.mkdir()
    path.write_text(text, encoding="utf-8")
    squealstudy.run(path, folder / "results" / "first_brake", jobs=1)
    return folder


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


def test_snippets_of_the_pandas_page(first_brake, monkeypatch):
    """They run, and their tables hold what the page says of them."""
    monkeypatch.chdir(first_brake)
    said = names_after(STUDIES / "pandas.md")
    assert said["by_track"]["growth_rate"].max() > 0
    designs = said["designs"]
    assert designs.loc[(1.1, 0.05), "growth_rate"] == designs["growth_rate"].min()
    assert (said["margin"].loc[0.1] > 0).all()
    assert (said["margin"].loc[0.4] < 0).any()
    assert (said["table"]["gain"] > 0).any()


def test_snippets_of_the_mechanics_page(capsys):
    """They run, and print what the page says."""
    page = STUDIES / "mechanics.md"
    names = names_after(page)
    shown = re.findall(r"^```text\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    printed = capsys.readouterr().out
    assert printed.split() == "".join(shown).split()
    assert names["slope"][0].real > 0


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MOST_LINES


def test_readme_shows_the_shipped_study():
    blocks = re.findall(r"^```toml\n(.*?)^```$", PAGES[0].read_text("utf-8"), re.M | re.S)
    assert (STUDIES / "first_brake.toml").read_text(encoding="utf-8") in blocks


def test_readme_names_every_command():
    named = re.findall(r"^\| `squealstudy (\w+)", PAGES[0].read_text("utf-8"), re.MULTILINE)
    there = [c.name or c.callback.__name__ for c in app.registered_commands]
    assert sorted(named) == sorted(there)


def test_every_study_is_in_the_gallery_once():
    gallery = (STUDIES / "README.md").read_text(encoding="utf-8")
    linked = [link for link in LINK.findall(gallery) if link.endswith(".toml")]
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


def test_snippet_of_the_own_brake_page(monkeypatch):
    """It runs, and the page has every element, with what is confirmed of it."""
    page = STUDIES / "own_brake.md"
    monkeypatch.chdir(ROOT)
    said = names_after(page)
    assert said["K"].shape == said["M"].shape == (3 * len(said["mesh"].nodes),) * 2
    rows = re.findall(r"^\| `(C3D\w+)` .*$", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(rows) == sorted(FORMULATIONS)
    for row in re.findall(r"^\| `C3D\w+` .*$", page.read_text(encoding="utf-8"), re.MULTILINE):
        element, *_, K, M, _ = (cell.strip() for cell in row.strip("|").split("|"))
        verified = FORMULATIONS[element.strip("`")].verified
        assert ("published" in K) == (not verified.startswith("K and M")), row
        assert re.fullmatch(r"\de-\d\d|as `C3D8`|exact integrals", M), row


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text(encoding="utf-8")):
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


def test_pictures_of_the_gallery_are_small():
    for link in LINK.findall((STUDIES / "README.md").read_text(encoding="utf-8")):
        if link.endswith(".png"):
            assert (STUDIES / link).stat().st_size <= LARGEST, link
