"""How the site is built: `sphinx-build -W --keep-going docs site`."""

from __future__ import annotations

import os
import shutil
import sys
from importlib.metadata import files
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

import generate  # noqa: E402

import squealstudy  # noqa: E402
from squealstudy.engine import pictures  # noqa: E402
from squealstudy.paths import user_cache  # noqa: E402

project = "squealstudy"
author = "the authors of squealstudy"
project_copyright = author
version = release = squealstudy.__version__
generate.write()
os.environ["SQUEALSTUDY_PAGES"] = str(DOCS)  # for the cells of tutorials

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_copybutton",
]
exclude_patterns = ["generated/parts", "**/.ipynb_checkpoints"]
suppress_warnings = ["mystnb.unknown_mime_type"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 4
myst_fence_as_directive = ["math"]
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"

# tutorials are executed, or come from the cache, which asks for the text of cells alone: its folder
# is named by the sources and by what else the pages read. SQUEALSTUDY_DOCS=off executes none
nb_execution_mode = os.environ.get("SQUEALSTUDY_DOCS", "cache")
nb_execution_cache_path = str(user_cache() / "pages" / generate.digest())
nb_execution_timeout = 900
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_execution_in_temp = True

html_theme = "furo"
html_title = f"squealstudy {release}"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_show_sourcelink = False
mathjax_path = "tex-svg.js"


def _equations(app: Any, exception: Exception | None) -> None:
    """Lay MathJax's one file (Apache-2.0) among the static ones: equations need no network."""
    if exception is None and app.builder.format == "html":
        found = files("sphinx-mathjax-offline") or ()
        (path,) = (f for f in found if f.name == mathjax_path)
        shutil.copy(str(path.locate()), Path(app.outdir) / "_static" / mathjax_path)


def _links(app: Any, docname: str, source: list[str]) -> None:
    """Links into the clone lead to the pages that are made of its files."""
    path = Path(app.env.doc2path(docname))
    if path.suffix == ".md" and path.parent != generate.GENERATED:
        source[0] = generate.relinked(source[0], path, path)


def _of_results(_app: Any, _what: str, name: str, *others: Any) -> None:
    """Docstrings of plots as those of methods of `results.plot`, which have the results."""
    if name.startswith("squealstudy.plots."):
        lines = others[-1]
        lines[:] = pictures._without_results("\n".join(lines)).splitlines()


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _of_results, priority=100)  # numpydoc is later
    app.connect("source-read", _links)
    app.connect("build-finished", _equations)
