"""The register of plots: those of the folder `plots`, and those of extensions.

A plot draws a matplotlib figure from results. It says which tables and columns it needs, so that
every study gets the pictures that its tables allow. No plot is named anywhere else.
"""

from __future__ import annotations

import contextlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from io import BytesIO
from pathlib import Path
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar

from squealstudy.engine.manifest_file import PICTURES, write_manifest
from squealstudy.engine.result_tables import ResultTables
from squealstudy.errors import ExtensionError, ResultsError, SquealstudyError, UnknownNameError
from squealstudy.extensions import note_registered
from squealstudy.files import write_atomic
from squealstudy.wording import did_you_mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 130
AS_PNG = "_repr_png_"  # method by which a notebook shows a figure at the end of a cell
NOTHING_TO_SEE = "nothing to see"  # label of a figure that only says why it is empty
PACKAGE = "squealstudy"
FOLDER = "squealstudy.plots"
Draw = Callable[..., "Figure"]
AnyDraw = TypeVar("AnyDraw", bound=Draw)
Choices = Mapping[str, Any]  # arguments of a plot beside the results
Pictures = Callable[[Any], Iterable[tuple[str, Choices]]]  # of `Results`


def once(_: ResultTables) -> Iterable[tuple[str, Choices]]:
    """One picture of a study, with default arguments."""
    return [("", {})]


@dataclass(frozen=True)
class Plot:
    """A way to draw results.

    Attributes
    ----------
    name : str
        Of the method ``results.plot.<name>``, and of the picture files.
    draw : callable
        (results, **choices) -> Figure.
    needs : mapping of str -> sequence of str
        Tables of the results, and the columns of each that are drawn.
    pictures : callable
        (results) -> the pictures that a study gets: for each the suffix of its file's name, and the
        arguments of `draw`.
    """

    name: str
    draw: Draw
    needs: Mapping[str, Sequence[str]] = field(default_factory=dict)
    pictures: Pictures = once

    def missing(self, results: ResultTables) -> str:
        """Text on the first needed table or column that the results lack; empty without one."""
        for table, columns in self.needs.items():
            if table not in results.tables:
                return f"a table '{table}'"
            for column in columns:
                if column not in results.columns(table):
                    return f"a column '{column}' in the table '{table}'"
        return ""

    def __call__(self, results: ResultTables, *arguments: Any, **choices: Any) -> Figure:
        """The figure, which a notebook shows; arguments as those of `draw`.

        ResultsError where the results lack a needed table or column; ExtensionError where a plot
        from outside the package fails.
        """
        if lacking := self.missing(results):
            raise ResultsError(
                f"{results.directory}: the plot {self.name} needs {lacking}, which these results "
                f"of kind {results.kind} do not have"
            )
        from matplotlib.figure import Figure

        with self.named():
            figure = self.draw(results, *arguments, **choices)
            if not isinstance(figure, Figure):
                raise TypeError(f"expected a Figure of Matplotlib, got {figure!r}")
        if not hasattr(figure, AS_PNG):  # matplotlib's own way begins with a figure of pyplot
            setattr(figure, AS_PNG, partial(_png, figure))
        return figure

    @contextlib.contextmanager
    def named(self) -> Iterator[None]:
        """Raise ExtensionError, with its file, where a plot from outside the package fails.

        Errors of squealstudy and of the machine stay as they are.
        """
        try:
            yield
        except (SquealstudyError, OSError, MemoryError):
            raise
        except Exception as error:
            code = self.draw.__code__ if isinstance(self.draw, FunctionType) else None
            if code is None or self.draw.__module__.split(".")[0] == PACKAGE:
                raise
            error_text = f"{type(error).__name__}: {error}"
            raise ExtensionError(
                Path(code.co_filename), f"the plot '{self.name}' cannot be drawn ({error_text})"
            ) from error


def _png(figure: Figure) -> bytes:
    """The figure as a notebook shows it."""
    image = BytesIO()
    figure.savefig(image, format="png")
    return image.getvalue()


_REGISTERED: dict[str, Plot] = {}


def register_plot(
    pictures: Pictures = once, **needs: Sequence[str]
) -> Callable[[AnyDraw], AnyDraw]:
    """Decorator: register a function of results that returns a Figure as the plot of its name.

    Parameters
    ----------
    pictures : callable
        As in `Plot`; by default one picture.
    **needs : sequence of str
        Columns by table, as ``modes=("frequency_hz",)``.

    Raises
    ------
    ValueError
        Another plot has the name.

    Examples
    --------
    >>> import squealstudy as sq
    >>> from matplotlib.figure import Figure
    >>> @sq.register_plot(modes=("frequency_hz", "growth_rate"))
    ... def growth_over_frequency(results: sq.Results) -> Figure:
    ...     figure = Figure()
    ...     modes = results.modes
    ...     figure.add_subplot().plot(modes["frequency_hz"], modes["growth_rate"], ".")
    ...     return figure
    """

    def registered(draw: AnyDraw) -> AnyDraw:
        name = draw.__name__
        earlier = _REGISTERED.get(name)
        if earlier is not None and earlier.draw.__module__ != draw.__module__:
            raise ValueError(f"there is a plot '{name}' already, in {earlier.draw.__module__}")
        _REGISTERED[name] = Plot(name, draw, needs, pictures)
        note_registered(draw.__module__)
        return draw

    return registered


def plots() -> Mapping[str, Plot]:
    """All plots by name; the first call imports those of the package."""
    _read_folder()
    return _REGISTERED


@cache
def _read_folder() -> None:
    for module in pkgutil.iter_modules(import_module(FOLDER).__path__):
        import_module(f"{FOLDER}.{module.name}")


class Plots:
    """The plots of some results as methods: ``results.plot.evolution(along="friction")``.

    `dir` lists those for which the results have the tables.
    """

    def __init__(self, results: ResultTables) -> None:
        self._results = results

    def __repr__(self) -> str:
        return f"<Plots: {', '.join(dir(self)) or 'none'}>"

    def __getattr__(self, name: str) -> Draw:
        """The plot of that name; UnknownNameError, an AttributeError, where there is none."""
        if name.startswith("_"):
            raise AttributeError(name)
        plot = plots().get(name)
        if plot is None:
            hint = did_you_mean(name, plots())
            names = ", ".join(dir(self)) or "none: these results have no plots"
            raise UnknownNameError(f"there is no plot '{name}', expected {names}{hint}")
        return _method(plot, self._results)

    def __dir__(self) -> list[str]:
        """Plots for which these results have the tables and at least one picture."""
        return sorted({plot.name for _, plot, _ in pictures(self._results)})


def _method(plot: Plot, results: ResultTables) -> Draw:
    """A plot as a method of some results: with signature and docstring of its function."""

    def method(*arguments: Any, **choices: Any) -> Figure:
        return plot(results, *arguments, **choices)

    signature = inspect.signature(plot.draw)
    parameters_but_results = list(signature.parameters.values())[1:]
    method.__name__ = method.__qualname__ = plot.name
    method.__module__ = plot.draw.__module__
    method.__doc__ = _without_results(inspect.getdoc(plot.draw) or "")
    method.__signature__ = signature.replace(parameters=parameters_but_results)  # type: ignore[attr-defined]
    return method


def _without_results(text: str) -> str:
    """A docstring of a plot as that of a method: without `results`, with the returned figure."""
    text = re.sub(r"^results : .*\n(?: +.*\n?)*", "", text, flags=re.MULTILINE)
    text = re.sub(r"^Parameters\n-+\s*(?=\n\n|\n*\Z)", "", text, flags=re.MULTILINE)
    section = re.search(r"^(?:Raises|Examples)\n-+\n", text, re.MULTILINE)
    end = section.start() if section else len(text)
    head, tail = text[:end].strip(), text[end:]
    return f"{head}\n\nReturns\n-------\nmatplotlib.figure.Figure\n\n{tail}".rstrip() + "\n"


def pictures(results: ResultTables) -> Iterable[tuple[str, Plot, Choices]]:
    """Name of the file, plot and choices of every picture that the results allow."""
    for name, plot in sorted(plots().items()):
        if not plot.missing(results):
            with plot.named():
                choices_of_plot = list(plot.pictures(results))
            for suffix, choices in choices_of_plot:
                yield name + suffix, plot, choices


def draw_pictures(results: ResultTables, directory: Path | None) -> list[Path]:
    """Draw every picture that results allow, as `Results.draw`."""
    to_draw = list(pictures(results))
    paths = [(directory or results.directory) / f"{name}.png" for name, _, _ in to_draw]
    if directory is None and paths:  # before drawing, so that the manifest has all that exist
        results.manifest[PICTURES] = sorted(path.name for path in paths)
        write_manifest(results.directory, results.manifest)
    failed: list[ExtensionError] = []
    for path, (_, plot, choices) in zip(paths, to_draw, strict=True):
        try:
            with plot.named():
                save_figure(_signed(plot(results, **choices), results), path)
        except ExtensionError as error:  # the others are still drawn
            failed.append(error)
    if failed:
        raise failed[0]
    return paths


def _signed(figure: Figure, results: ResultTables) -> Figure:
    """The figure with the name of its study in a corner, for files that are passed on alone."""
    text = f"study {results.manifest['name']}"
    figure.text(0.004, 0.004, text, fontsize=8, color="0.45", ha="left", va="bottom")
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as SVG if the suffix says so, else as PNG; whole or not at all.

    Missing directories are made. OSError where the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    def write(temporary: Path) -> None:
        figure.set_dpi(DPI)
        if path.suffix.lower() == ".svg":
            figure.savefig(temporary, format="svg")
        else:
            FigureCanvasAgg(figure).print_png(temporary)  # draws once; `savefig` draws twice

    write_atomic(path, write)
