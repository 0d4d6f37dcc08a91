"""The site: its reference is whole, its pages are plain, short and reachable, their cells run."""

import importlib.util
import inspect
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

import squealstudy
from squealstudy import wording
from squealstudy.cli.app import app
from squealstudy.columns import COLUMNS, column_names
from squealstudy.engine.pictures import plots
from squealstudy.engine.schema import (
    EXAMPLES,
    lumped_schema,
    methods_schema,
    model_schema,
    study_schema,
)
from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES, REGULARISATIONS
from squealstudy.models.components.formulations import FORMULATIONS
from squealstudy.study.definition import parse_study
from squealstudy.study.kinds import definition_of, kind_names
from squealstudy.study.sections import StudyDefinition

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PARTS = ("tutorials", "howto", "reference", "explanation")
PAGES = sorted(p for p in DOCS.rglob("*.md") if "generated" not in p.parts)
MOST_WORDS = 400  # of a how-to page, without code
LONGEST, MEAN = 35, 20  # words of a sentence; of a page with ten sentences or more
FENCE = re.compile(r"^(```+)(.*?)\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
FRONT = re.compile(r"\A---\n.*?^---\n", re.MULTILINE | re.DOTALL)


def name(page: Path) -> str:
    return page.relative_to(DOCS).as_posix()


@pytest.fixture(scope="module")
def generate():
    """The module that makes the generated pages; it needs no Sphinx."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def parts(generate) -> dict[str, str]:
    return generate.parts()


SCHEMAS = {
    "study-keys": study_schema,
    "model-keys": model_schema,
    "lumped-keys": lambda: lumped_schema("lumped_file"),
    "matrix-keys": lambda: lumped_schema("matrix_file"),
    "work-precision-keys": lambda: methods_schema("work_precision"),
    "method-stability-keys": lambda: methods_schema("method_stability"),
}


@pytest.mark.parametrize("page", SCHEMAS)
def test_every_key_has_a_row_a_meaning_and_an_example(parts, page):
    schema = SCHEMAS[page]()
    for table in schema["$defs"].values():
        for key, found in table["properties"].items():
            assert found["description"], key
            assert len(found["examples"]) == 1, (table["title"], key)
            assert f"| `{key}` |" in parts[page], key
    for key, found in schema["properties"].items():
        assert found["description"], key
        assert f"`{key}`" in parts[page] or f"[{key}" in parts[page], key


def test_kinds_and_units_are_told(parts):
    text = parts["study-keys"]
    assert "Kinds: `transient`." in text
    assert "Kinds: `design`, `limit_cycles`." in text
    assert re.search(r"\| `step` \| number, above 0 \| s \| `1e-06` \|", text)
    assert re.search(r"\| `rho` \| number, above 0 \| kg/m3 \|", parts["model-keys"])
    assert "| `normal` | list of 3, number |  |  | Direction in which" in parts["model-keys"]
    assert '| `mass` | `"full"` or `"as_stiffness"` or `"lumped"` |  |' in parts["model-keys"]
    assert "## `[components.NAME]`" in parts["model-keys"]


def test_examples_of_keys_are_what_files_may_say():
    """Each table of them, alone, as pydantic reads it: types, ranges, choices."""
    from pydantic import TypeAdapter, ValidationError

    from squealstudy.models.components.model_file import ModelFile
    from squealstudy.models.lumped.matrix_tables import MatrixFile
    from squealstudy.models.lumped.tables import LumpedFile

    whole = {n: definition_of(n) for n in kind_names()}
    of_studies = [d for d in whole.values() if issubclass(d, StudyDefinition)]
    classes = {"study": of_studies, "model_file": [ModelFile]}
    classes |= {"lumped_file": [LumpedFile], "matrix_file": [MatrixFile]}
    classes |= {n: [whole[n]] for n in ("work_precision", "method_stability")}
    types = {"float_type", "int_type", "string_type", "bool_type", "literal_error"}
    types |= {"greater_than", "greater_than_equal", "less_than_equal", "extra_forbidden"}
    for path in EXAMPLES.glob("*.toml"):
        example = tomllib.loads(path.read_text("utf-8"))
        for key, value in example.items():
            fields = [f for d in classes[path.stem] if (f := d.model_fields.get(key))]
            assert fields, key
            try:
                TypeAdapter(fields[-1].annotation).validate_python(value)
            except ValidationError as error:  # of keys that exclude each other, say
                wrong = [e for e in error.errors() if e["type"] in types]
                inner = [e for e in wrong if "function" not in str(e["loc"])]
                assert not inner or len({e["loc"][:2] for e in inner}) < len(inner), inner


def test_every_column_of_every_table_is_on_the_page(parts):
    for kind, tables in COLUMNS.items():
        for table, columns in tables.items():
            text = parts["columns"].split(f"### `{table}` of `{kind}`\n")[1].split("\n##")[0]
            for column in columns:
                for one in column_names(column.name):
                    assert f"`{one}`" in text, (kind, table, one)


def test_patterns_of_columns_are_names():
    assert column_names(r"n_unstable_(low|high)") == ["n_unstable_low", "n_unstable_high"]
    assert column_names("low|high") == ["low", "high"]
    assert column_names(r"energy_mode_\d+") == ["energy_mode_*"]


def test_every_public_name_is_on_the_page(parts):
    public = {n for n in squealstudy.__all__ if not n.startswith("__")}
    shown = re.findall(r"^\.\. auto(?:class|function):: ([\w.]+)", parts["python"], re.MULTILINE)
    assert public <= {s.removeprefix("squealstudy.") for s in shown}
    for path in shown:
        module, _, last = path.rpartition(".")
        assert inspect.getdoc(getattr(importlib.import_module(module), last)), path
    assert {path.rpartition(".")[2] for path in shown} >= {*plots(), "Plots"}


def test_what_extensions_import_is_on_the_page(parts, generate):
    page = parts["extensions"]
    rows = dict(re.findall(r"^\| `([\w.]+)` \| (.*?) \| \[", page, re.MULTILINE))
    names = generate.extension_names()
    assert {len(files) > 0 for files in names.values()} == {True}
    for module, imported in names:
        assert f"`{imported}`" in rows[module], (module, imported)
    shown = set(re.findall(r"^\.\. auto\w+:: ([\w.]+)", page, re.MULTILINE))
    hooks = {f"{module}.{n}" for module, n in names if n.startswith("register")}
    assert len(hooks) == 6
    assert hooks - {"squealstudy.register_plot"} <= shown
    assert {path.rpartition(".")[2] for path in shown} >= set(generate.TO_DEFINE)


def test_public_members_of_results_are_those_that_dir_lists(parts, generate):
    """Of no results all: what a kind has not is not listed for it."""
    (members,) = re.findall(r"autoclass:: squealstudy.Results\n   :members: (.*)", parts["python"])
    assert members.split(", ") == generate.public_of_results()
    assert {"rank", "modes", "shape", "robust"} < set(generate.public_of_results())
    assert not {"rows", "batches", "screen", "store"} & set(generate.public_of_results())


def test_every_command_and_option_is_on_the_page(parts):
    for command in app.registered_commands:
        word = command.callback.__name__
        text = parts["commands"].split(f"## `{word}`\n")[1].split("\n## ")[0]
        assert f"Usage: squealstudy {word} " in text
        assert "--help" in text


def test_every_model_parameter_and_law_is_on_the_page(parts):
    for model in squealstudy.list_models():
        assert f"## `{model}`" in parts["models"]
    for parameter in squealstudy.model("disc_brake").parameters.index:
        assert f"| `{parameter}` |" in parts["models"]
    for laws in (CONTACT_LAWS, FRICTION_CURVES, REGULARISATIONS):
        for law in laws:
            assert f"| `{getattr(law, 'name', law)}` |" in parts["laws"]


def test_words_in_tables_are_explained():
    text = (DOCS / "reference" / "words-in-tables.md").read_text(encoding="utf-8")
    words = {*wording.VERDICTS, *wording.SUSTAINED, wording.STABLE, wording.GROWING, wording.FAILED}
    outcomes = {"met", "met_linear", "undecided", "none_found", "stopped", "unproven"}
    onsets = {"refined", "cubic", "renumbered", "failed", "interpolated", "within_error"}
    onsets |= {"below_range", "first_seen", "broken", "bracketed", "left_band"}
    for word in words | outcomes | onsets | {"ok", "inaccurate", "overflow", "singular"}:
        assert re.search(rf"^\|.*`{word}`", text, re.MULTILINE), word
    for letters in (wording.VERDICT_LETTERS, wording.CLASS_LETTERS):
        for word, letter in letters.items():
            assert f"`{word}` | `{letter}` |" in text or word == wording.FAILED, word


def test_elements_are_those_there_are_with_what_is_confirmed_of_them():
    page = (DOCS / "reference" / "elements.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `C3D\w+` \| (?:tet|pyr|wed|hex).*$", page, re.MULTILINE)
    assert sorted(re.match(r"\| `(\w+)`", row)[1] for row in rows) == sorted(FORMULATIONS)
    for row in rows:
        element, *_, K, M, _ = (cell.strip() for cell in row.strip("|").split("|"))
        verified = FORMULATIONS[element.strip("`")].verified
        assert ("published" in K) == (not verified.startswith("K and M")), row
        assert re.fullmatch(r"\de-\d\d|as `C3D8`|exact integrals", M), row


# -- prose ---------------------------------------------------------------------------------------
def prose(page: Path) -> str:
    """The text of a page without front matter and code."""
    return FENCE.sub("", FRONT.sub("", page.read_text(encoding="utf-8")))


def sentences(page: Path) -> list[list[str]]:
    """Words of each sentence outside tables and headings; a list's entry ends one."""
    kept, glossary = [], page.stem == "glossary"
    text = page.read_text("utf-8") if glossary else prose(page)
    for line in text.splitlines():
        starts = re.match(r"\s*([-*]|\d+\.) ", line)
        if re.match(r"\s*(\||#|!\[|```)", line) or not line.strip() or starts:
            kept.append("\n")
        if not re.match(r"\s*(\||#|!\[|```)", line):
            kept.append(re.sub(r"^\s*([-*]|\d+\.) ", "", line))
            kept.append("\n" if glossary else " ")
    plain = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", "".join(kept))
    plain = re.sub(r"`[^`]*`", "code", plain)
    found = re.split(r"\n|(?<=[.!?])[)*]*\s+", plain)
    return [s for one in found if len(s := re.findall(r"\S*\w\S*", one)) > 1]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_sentences_are_short(page):
    found = sentences(page)
    for words in found:
        assert len(words) <= LONGEST, " ".join(words)
    if len(found) >= 10:
        assert sum(map(len, found)) / len(found) <= MEAN


@pytest.mark.parametrize("page", sorted((DOCS / "howto").glob("*.md")), ids=name)
def test_how_to_pages_are_short(page):
    assert len(prose(page).split()) <= MOST_WORDS


def test_every_page_is_in_one_part_and_in_the_contents_once():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = [w for block in FENCE.findall(index) for w in block[2].split("\n\n")[-1].split()]
    there = [name(p).removesuffix(".md") for p in PAGES if p != DOCS / "index.md"]
    assert sorted(w for w in listed if not w.startswith("generated/")) == sorted(there)
    assert all(t.split("/")[0] in (*PARTS, "install") for t in there)
    for page in PAGES:
        title = re.search(r"^# (.*)$", prose(page), re.MULTILINE)[1]
        assert len(title.split()) <= 5, title


def test_pages_made_of_the_clone_are_in_the_contents(generate):
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    for made in generate.pages():
        assert f"\ngenerated/{made}\n" in index, made
    assert all((ROOT / source).is_file() for source in generate.PAGES)


def test_pages_made_of_the_clone_name_no_page_that_the_site_lacks(generate):
    for source in generate.PAGES:
        text = (ROOT / source).read_text(encoding="utf-8")
        for _, to in generate.LINK.findall(text):
            path = to.partition("#")[0]
            if "://" in to or not path.endswith(".md"):
                continue
            target = (ROOT / source).parent.joinpath(path).resolve()
            on_site = str(target.relative_to(ROOT)) in generate.PAGES
            assert on_site or target.is_relative_to(DOCS), f"{source}: {to}"


# -- what pages run --------------------------------------------------------------------------------
def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of the fenced blocks of a page."""
    return [(b[1].strip(), b[2]) for b in FENCE.findall(page.read_text(encoding="utf-8"))]


def run_of(page: Path, capsys) -> dict[str, Any]:
    """Names after the Python of a page; what it prints is what the page shows behind it."""
    names: dict[str, Any] = {}
    found = blocks(page)
    for k, (language, text) in enumerate(found):
        if language != "python":
            continue
        exec(compile(text, str(page), "exec"), names)
        printed = capsys.readouterr().out
        if k + 1 < len(found) and found[k + 1][0] == "text" and "print(" in text:
            assert printed.split() == found[k + 1][1].split()
    return names


@pytest.mark.parametrize("page", ["from-matlab", "lumped-model", "arrays"])
def test_python_of_how_to_pages(page, capsys):
    names = run_of(DOCS / "howto" / f"{page}.md", capsys)
    if page == "arrays":
        assert names["slope"][0].real > 0


@pytest.mark.parametrize("page", ["from-abaqus", "which-friction", "results-elsewhere"])
def test_python_of_how_to_pages_on_results(page, first_brake, monkeypatch, capsys):
    text = (DOCS / "howto" / f"{page}.md").read_text(encoding="utf-8")
    (wanted,) = set(re.findall(r'open_results\("results/(\w+)"\)', text)) - {"NAME"}
    monkeypatch.chdir(first_brake)
    if not (first_brake / "results" / wanted).exists():
        os.symlink("first_brake", first_brake / "results" / wanted)
    run_of(DOCS / "howto" / f"{page}.md", capsys)


def test_python_of_the_page_on_pandas(first_brake, monkeypatch):
    """It runs, and its tables hold what the page says of them."""
    monkeypatch.chdir(first_brake)
    names: dict[str, Any] = {}
    for language, text in blocks(DOCS / "howto" / "pandas.md"):
        if language == "python":
            exec(compile(text, "pandas.md", "exec"), names)
    assert names["by_track"]["growth_rate"].max() > 0
    designs = names["designs"]
    assert designs.loc[(1.1, 0.05), "growth_rate"] == designs["growth_rate"].min()


def test_python_of_the_page_on_elements(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names = run_of(DOCS / "reference" / "elements.md", capsys)
    assert names["K"].shape == names["M"].shape == (3 * len(names["mesh"].nodes),) * 2


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_toml_of_pages_is_toml(page):
    for language, text in blocks(page):
        if language == "toml":
            tomllib.loads(text)


def test_whole_studies_of_pages_are_valid():
    """Those of the generated brake; others name files that a page does not have."""
    found = [t for p in PAGES for lang, t in blocks(p) if lang == "toml" and "[study]" in t]
    whole = [t for t in found if '"disc_brake"' in t and "extensions" not in t]
    assert len(whole) >= 4
    for text in whole:
        parse_study(text, Path("page.toml"))


@pytest.mark.full_size
@pytest.mark.parametrize("page", sorted((DOCS / "tutorials").glob("*.md")), ids=name)
def test_tutorials_run_and_their_numbers_hold(page, tmp_path, monkeypatch):
    """All cells, as the site does, the hidden ones with their assertions among them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    monkeypatch.setenv("SQUEALSTUDY_PAGES", str(DOCS))
    names: dict[str, Any] = {}
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    cells = [text for language, text in blocks(page) if language == "{code-cell} python"]
    assert sum("assert" in cell for cell in cells) > 3
    for cell in cells:
        code = "\n".join(line for line in cell.splitlines() if not line.startswith(":tags:"))
        exec(compile(code, str(page), "exec"), names)
