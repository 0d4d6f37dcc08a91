"""Pages of the site that are made when it is built, from the program itself and from the clone.

`python docs/generate.py` writes them to `docs/generated/`; `conf.py` does so before every build.
Only what has changed is written: Sphinx reads no other page again.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from squealstudy.engine.key_tables import cell, key_tables, sentence

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
GENERATED = DOCS / "generated"
PARTS = GENERATED / "parts"  # no pages, but parts of some

THEORY = (  # pages of squealstudy/THEORY.md: name, title, its sections
    ("theory-1", "Theory: the brake", range(1, 5)),
    ("theory-2", "Theory: complex modes", range(5, 8)),
    ("theory-3", "Theory: tracks and slopes", range(8, 10)),
    ("theory-4", "Theory: in time", range(10, 12)),
    ("theory-5", "Theory: limit cycles", range(16, 17)),
    ("theory-6", "Theory: the rest", (*range(12, 16), *range(17, 40))),
)
PAGES = {  # files of the clone that are pages of the site, too: name, title
    "squealstudy/README.md": ("how-built", "How it is built"),
    "squealstudy/THEORY.md": ("theory-1", ""),
    "tests/README.md": ("what-tests-guarantee", "What the tests guarantee"),
    "studies/benchmarks/README.md": ("benchmarks", "Benchmarks"),
    "studies/benchmarks/limit_cycles.md": ("benchmarks-limit-cycles", "Limit cycles, measured"),
    "studies/benchmarks/designs.md": ("benchmarks-designs", "Design studies, measured"),
    "studies/benchmarks/contact_and_squeal.md": (
        "benchmarks-contact",
        "Contact and squeal, measured",
    ),
    "studies/paper/README.md": ("paper", "Vermot des Roches 2010"),
    "CHANGELOG.md": ("changes", "Changes"),
    "SECURITY.md": ("security", "Security"),
}
LINK = re.compile(r"(!?\[[^\]]*\])\(([^)\s]+)\)")
FLAGS = re.MULTILINE | re.DOTALL
FENCE = re.compile(r"^(```.*?^```)$", FLAGS)
KEY_PAGES = (  # schema, heading of a table, what a table is in such a file
    ("study-keys", ""),
    ("model-keys", "model_file"),
    ("lumped-keys", "lumped_file"),
    ("matrix-keys", "matrix_file"),
    ("work-precision-keys", "work_precision"),
    ("method-stability-keys", "method_stability"),
)
WIDTH = 78  # characters of a line of help
KIND_TITLES = {
    "complex_modes": "Complex modes",
    "transient": "Runs in time",
    "limit_cycles": "Limit cycles",
    "sensitivity": "Sensitivities",
    "design": "Design studies",
    "work_precision": "Error over time of methods",
    "method_stability": "Where methods fail",
}
EXTENSIONS = ROOT / "tests" / "extension"
TO_DEFINE = (  # classes that extensions make instances of, or derive from
    *("Column", "ContactLawDefinition", "FixedJacobian", "FrictionCurveDefinition"),
    *("ModelDefinition", "ModelKind", "Parameter", "Rung"),
)
# the library behind `squealstudy.model(...).at(...)`: module and class
MECHANICS = (
    ("squealstudy.mechanics.unreduced", "Unreduced"),
    ("squealstudy.mechanics.reduction", "Reduction"),
    ("squealstudy.mechanics.steady", "SteadySliding"),
    ("squealstudy.mechanics.linear", "LinearSystem"),
    ("squealstudy.mechanics.modes", "ComplexModes"),
    ("squealstudy.mechanics.sensitivities", "Sensitivities"),
    ("squealstudy.mechanics.motions", "Runs"),
    ("squealstudy.mechanics.limit_cycles", "LimitCycles"),
)


def parts() -> dict[str, str]:
    """Text of what pages of the reference include, by name."""
    made = {name: _keys(of) for name, of in KEY_PAGES}
    made |= {"commands": _commands(), "columns": _columns(), "models": _models(), "laws": _laws()}
    return made | {"python": _python(), "extensions": _extensions()}


def pages() -> dict[str, str]:
    """Text of the pages that are files of the clone, by name."""
    made = dict(_theory())
    for source, (name, title) in PAGES.items():
        path = ROOT / source
        if title and path.is_file():
            made[name] = _moved(path, path.read_text("utf-8"), title)
    return made


def write() -> None:
    """Write the pages that have changed, and remove those that are no more."""
    for folder, made in ((GENERATED, pages()), (PARTS, parts())):
        folder.mkdir(exist_ok=True)
        for path in folder.glob("*.md"):
            if path.stem not in made:
                path.unlink()
        for name, text in made.items():
            path = folder / f"{name}.md"
            if not path.is_file() or path.read_text("utf-8") != text:
                path.write_text(text, "utf-8")


def digest() -> str:
    """Hash of what executed pages depend on beside their text."""
    found = hashlib.sha256()
    own = [*(ROOT / "squealstudy").rglob("*.py"), *(ROOT / "studies" / "own_brake").iterdir()]
    for path in sorted([*own, DOCS / "cells.py"]):
        found.update(path.read_bytes())
    for page in sorted((DOCS / "tutorials").glob("*.md")):  # files that hidden cells take from it
        found.update(
            "".join(re.findall(r"^```toml\n.*?^```$", page.read_text("utf-8"), FLAGS)).encode()
        )
    return found.hexdigest()[:16]


# -- files of the clone as pages -------------------------------------------------------------------
def relinked(text: str, source: Path, page: Path) -> str:
    """Links of a file of the clone, as they are on a page of the site.

    Parameters
    ----------
    text : str
    source : Path
        Where the links lead from.
    page : Path
        The page below `DOCS` that they stand on.
    """

    def changed(link: re.Match[str]) -> str:
        shown, to = link.groups()
        if "://" in to or to.startswith(("#", "mailto:")):
            return link[0]
        path, _, anchor = to.partition("#")
        target = (source.parent / path).resolve()
        known = PAGES.get(str(target.relative_to(ROOT))) if target.is_relative_to(ROOT) else None
        if known:
            target = GENERATED / f"{known[0]}.md"
            anchor = anchor if known[1] else ""  # theory is in parts
        elif target.is_dir():
            return shown.strip("[]")
        return f"{shown}({_from(page, target)}{'#' if anchor else ''}{anchor})"

    parts = FENCE.split(text)
    return "".join(p if k % 2 else LINK.sub(changed, p) for k, p in enumerate(parts))


def _from(page: Path, target: Path) -> str:
    """A path from a page to a file, with slashes."""
    up = page.resolve().parent
    steps = 0
    while not target.is_relative_to(up):
        up, steps = up.parent, steps + 1
    return "../" * steps + target.relative_to(up).as_posix()


def _moved(path: Path, text: str, title: str) -> str:
    body = re.sub(r"\A# .*\n", f"# {title}\n", text)
    return relinked(body, path, GENERATED / "page.md")


def _theory() -> Iterator[tuple[str, str]]:
    """The parts of THEORY.md, each with the sections that it holds."""
    path = ROOT / "squealstudy" / "THEORY.md"
    head, *sections = re.split(r"^(?=## )", path.read_text("utf-8"), flags=re.MULTILINE)
    for name, title, numbers in THEORY:
        own = [s for s in sections if (m := re.match(r"## (\d+)", s)) and int(m[1]) in numbers]
        if name == THEORY[0][0]:
            own = [re.sub(r"\A# .*\n", "", head), *own]
        if name == THEORY[-1][0]:
            own += [s for s in sections if not re.match(r"## \d", s)]
        yield name, relinked(f"# {title}\n\n" + "".join(own), path, GENERATED / "page.md")


# -- keys ------------------------------------------------------------------------------------------
def _keys(of: str) -> str:
    from squealstudy.engine.schema import schema_of

    return key_tables(schema_of(of or None))


# -- commands, tables, models, laws ----------------------------------------------------------------
def _commands() -> str:
    from typer.main import get_command

    from squealstudy.cli.app import COMMANDS, app

    whole = get_command(app)
    lines: list[str] = []
    for function in COMMANDS:
        command = whole.commands[function.__name__]  # type: ignore[attr-defined]
        context = type(whole.make_context("squealstudy", ["--"], resilient_parsing=True))(
            command, info_name=f"squealstudy {function.__name__}", terminal_width=WIDTH
        )
        lines += [f"## `{function.__name__}`", "", "```text", command.get_help(context), "```", ""]
    return "\n".join(lines)


def _columns() -> str:
    """Tables of each kind of study, with unit, meaning and error of each column."""
    from squealstudy.columns import COLUMNS, column_names, unit_of

    lines: list[str] = []
    for kind, tables in COLUMNS.items():
        lines += [f"## {KIND_TITLES[kind]}", "", f'Of `kind = "{kind}"`.', ""]
        for table, columns in tables.items():
            lines += [f"### `{table}` of `{kind}`", ""]
            lines += ["| column | unit | meaning | error |", "|---|---|---|---|"]
            for column in columns:
                names = column_names(column.name)
                unit = unit_of(names[0].replace("*", "1"), table) or ""
                error = ", ".join(f"`{e}`" for e in column.errors) or sentence(column.leaves_out)
                shown = ", ".join(f"`{name}`" for name in names)
                cells = (shown, unit, sentence(column.definition), error)
                lines.append("| " + " | ".join(cell(c) for c in cells) + " |")
            lines.append("")
    return "\n".join(lines)


def _parameter_rows(parameters: Any) -> list[str]:
    lines = ["| parameter | default | unit | meaning |", "|---|---|---|---|"]
    for name, row in parameters.iterrows():
        meaning = sentence(row["description"])
        meaning += " Each value costs a reduction." if row["structural"] else ""
        meaning += f" With {row['laws']}." if row["laws"] else ""
        cells = (f"`{name}`", f"{row['default']:g}", row["unit"], meaning)
        lines.append("| " + " | ".join(cell(c) for c in cells) + " |")
    return lines


def _models() -> str:
    import squealstudy as sq
    from squealstudy.cli.models import LUMPED

    lines: list[str] = []
    for name, description in sq.list_models().items():
        lines += [f"## `{name}`", "", sentence(description), ""]
        if name == "lumped":
            lines += ["```text", *LUMPED.splitlines(), "```", ""]
        if name in ("matrices", "components", "lumped"):  # of files
            continue
        model = sq.model(name)
        if len(model.options):
            lines += ["| option of `[model]` | default | others | meaning |", "|---|---|---|---|"]
            for option, row in model.options.iterrows():
                first, *others = map(str, row["choices"])
                cells = (f"`{option}`", first, ", ".join(others), sentence(row["description"]))
                lines.append("| " + " | ".join(cell(c) for c in cells) + " |")
            lines.append("")
        lines += [*_parameter_rows(model.parameters), ""]
    return "\n".join(lines)


def _laws() -> str:
    from squealstudy.laws import CONTACT_LAWS, FRICTION_CURVES, REGULARISATIONS

    lines: list[str] = []
    for title, laws in (
        ("Contact laws: `contact_law` of `[model]`", CONTACT_LAWS),
        ("Friction curves: `friction_law` of `[model]`", FRICTION_CURVES),
        ("Friction at rest: `friction` of `[transient]` and `[limit_cycles]`", REGULARISATIONS),
    ):
        lines += [f"## {title}", "", "| law | meaning | parameters |", "|---|---|---|"]
        for law in laws:
            definition = law if hasattr(law, "description") else laws[law]
            own = "; ".join(
                f"`{p.name}` [{p.unit or '1'}], {p.default:g}" for p in definition.parameters
            )
            cells = (f"`{definition.name}`", sentence(definition.description), own)
            lines.append("| " + " | ".join(cell(c) for c in cells) + " |")
        lines.append("")
    return "\n".join(lines)


# -- Python ----------------------------------------------------------------------------------------
def _python() -> str:
    import inspect

    import squealstudy
    from squealstudy.engine.pictures import plots

    lines: list[str] = []
    for name in squealstudy.__all__:
        if name.startswith("__"):
            continue
        found = getattr(squealstudy, name)
        kind = "class" if inspect.isclass(found) else "function"
        lines += [f"### `{name}`", "", *_documented(kind, f"squealstudy.{name}")]
    lines += [
        "## Pictures: `results.plot`",
        "",
        *_documented("class", "squealstudy.engine.pictures.Plots"),
    ]
    for name, plot in sorted(plots().items()):
        own = [*inspect.signature(plot.draw).parameters.values()][1:]
        shown = ", ".join(str(p.replace(annotation=p.empty)) for p in own)
        lines += [f"### `plot.{name}`", ""]
        lines += _documented("function", f"{plot.draw.__module__}.{plot.draw.__name__}({shown})")
    lines += ["## Steps of the mechanics", ""]
    for module, name in MECHANICS:
        lines += [f"### `{name}`", "", *_documented("class", f"{module}.{name}")]
    return "\n".join(lines)


def extension_names() -> dict[tuple[str, str], list[str]]:
    """Files that import a name of a module, by module and name: the examples of extensions."""
    files: dict[tuple[str, str], list[str]] = {}
    for path in sorted(EXTENSIONS.glob("my_*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("squealstudy"):
                for imported in node.names:
                    files.setdefault((str(node.module), imported.name), []).append(path.name)
    return files


def _extensions() -> str:
    """A table of what the examples import, and what is registered or derived from, in full."""
    from importlib import import_module

    lines = ["| from | import | as in |", "|---|---|---|"]
    names = extension_names()
    for module in sorted({module for module, _ in names}):
        imported = {name: used for (of, name), used in names.items() if of == module}
        files = sorted({file for used in imported.values() for file in used})
        cells = (f"`{module}`", ", ".join(f"`{n}`" for n in sorted(imported)))
        links = ", ".join(f"[{f}](../../tests/extension/{f})" for f in files)
        lines.append("| " + " | ".join((*cells, links)) + " |")
    lines.append("")
    for module, name in sorted(names):
        hook = getattr(import_module(module), name)
        if module != "squealstudy" and name.startswith("register"):
            lines += [f"### `{name}`", "", *_documented("function", f"{module}.{name}")]
        elif name in TO_DEFINE:
            lines += [f"### `{name}`", "", *_documented("class", f"{hook.__module__}.{name}")]
    return "\n".join(lines)


def public_of_results() -> list[str]:
    """What `dir(results)` lists, of results of any kind."""
    from squealstudy import Results
    from squealstudy.engine.named_tables import NamedTables
    from squealstudy.engine.results import OF_SOME_KINDS, PUBLIC

    tables = [name for name in vars(NamedTables) if not name.startswith("_")]
    names = dict.fromkeys((*PUBLIC, *OF_SOME_KINDS, *tables))
    return [name for name in names if hasattr(Results, name)]


def _documented(kind: str, name: str) -> list[str]:
    lines = ["```{eval-rst}", f".. auto{kind}:: {name}"]
    if name == "squealstudy.Results":
        lines += [f"   :members: {', '.join(public_of_results())}"]
    elif kind == "class":
        lines += ["   :members:"]
    if name == "squealstudy.Model":  # with those of the library's
        lines += ["   :inherited-members:"]
    return [*lines, "```", ""]


if __name__ == "__main__":
    write()
