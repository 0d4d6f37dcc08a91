"""Commands on results directories; the work is imported when one runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from squealstudy.cli.foreign import on_results
from squealstudy.cli.options import (
    By,
    Csv,
    ResultsPath,
    Top,
    Where,
)
from squealstudy.errors import ResultsError


@on_results
def rank(
    results: ResultsPath,
    by: By = "share",
    top: Top = None,
    where: Where = None,
    csv: Csv = False,
    names: Annotated[
        bool,
        typer.Option(
            "--names",
            help="Name each mode by its shape (nodal diameters, component modes, rigid pads); the "
            "first time a structure is expanded for it.",
        ),
    ] = False,
    why: Annotated[
        bool,
        typer.Option(
            "--why",
            help="Split the growth of each mode, where it grows fastest, into friction by pad and "
            "damping by component and layer.",
        ),
    ] = False,
) -> None:
    """Which modes are unstable: how widely, how strongly, from where on, in which component."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside

    opened = face.open_results(results)
    if names or why:
        from squealstudy.cli.shape import names as named
        from squealstudy.cli.shape import points_of_ranking, reasons
        from squealstudy.engine.kind_screen import N_RANKING_ROWS
        from squealstudy.paths import usable_cache

        with usable_cache(screen.warning):
            ranking = opened.rank(by, top or N_RANKING_ROWS, where)
            if "track" not in ranking:
                text = f"--names and --why are of modes, these are results of kind {opened.kind}"
                raise ResultsError(f"{results}: {text}")
            tracks = ranking["track"]
            if why:
                mode_facts = reasons(opened, tracks, points_of_ranking(opened, ranking, where))
            else:
                mode_facts = named(opened, tracks)
        if mode_facts:
            screen.show(screen.facts(mode_facts))
            return
        screen.warning("--names and --why tell of modes that oscillate and grow: there is none")
    if csv:
        screen.show_csv(opened.rank(by, top, where))
        return
    screen.show(*opened.screen.ranking(opened, by, top, where))
    screen.show(*outside(opened, "of the whole study: " if where else ""))


@on_results
def robust(
    results: ResultsPath,
    top: Top = None,
    csv: Csv = False,
    indices: Annotated[
        bool, typer.Option("--indices", help="Print the Sobol indices alone.")
    ] = False,
) -> None:
    """Probability of instability of a random design, and its Sobol indices."""
    from squealstudy import face, screen
    from squealstudy.cli.run import outside
    from squealstudy.engine.kind_screen import N_RANKING_ROWS
    from squealstudy.kinds.complex_modes import random_screen
    from squealstudy.study.sweeps import SOBOL_INDICES

    opened = face.open_results(results)
    if csv:
        screen.show_csv(opened.sobol_indices(top) if indices else opened.robust())
        return
    n_rows, sampled, names = (
        top or N_RANKING_ROWS,
        opened.design == SOBOL_INDICES,
        opened.track_names,
    )
    if not indices:
        table = opened.robust().iloc[: n_rows + 1]
        screen.show(
            *random_screen.probabilities(
                table, sampled, names, opened.units, opened.fact("band_hz")
            )
        )
        screen.show(*([""] if sampled else []))
    if indices or sampled:
        screen.show(*random_screen.indices(opened.sobol_indices(n_rows), names))
    screen.show(*outside(opened))


@on_results
def plot(
    results: ResultsPath,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory of the pictures.")
    ] = None,
) -> None:
    """Draw every picture that the tables of the results allow."""
    from squealstudy import face, screen

    screen.show(*map(str, face.open_results(results).draw(output)), unbroken=True)


@on_results
def report(
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULTS...", help="Results directories.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The page; it is written over.")
    ] = Path("report.html"),
    shapes: Annotated[
        bool,
        typer.Option(
            help="Show, moving, the mode that grows fastest, or the end of the loudest run, of "
            "models with a mesh: that design point is solved again, after a reduction where the "
            "cache holds none of this version."
        ),
    ] = True,
) -> None:
    """One page of HTML that needs nothing else: verdicts, pictures, tables, errors, provenance."""
    from squealstudy import face, screen
    from squealstudy.engine.report import write_report

    write_report([face.open_results(path) for path in results], output, shapes)
    screen.show(str(output), unbroken=True)


@on_results
def explore(
    results: ResultsPath,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The page; it is written over.")
    ] = Path("explore.html"),
    where: Where = None,
) -> None:
    """One page of HTML to click through: map, modes, tracks, cycles or runs; needs no network."""
    from squealstudy import face, screen

    explorer = face.open_results(results).explore(where)
    screen.show(str(explorer.save(output)), unbroken=True)


@on_results
def shape(
    results: ResultsPath,
    point: Annotated[
        str | None,
        typer.Option(
            help="Design point: its row of the points table, from 0, or its point_id. Default: "
            "where the mode grows fastest."
        ),
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(
            help="Modes by their numbers at the point, as in the modes table (12 or 12,14), "
            "'unstable' or 'all'. Default: the one that grows fastest."
        ),
    ] = None,
    track: Annotated[
        int | None, typer.Option(min=0, help="Instead: the mode by its number in 'rank'.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder; default RESULTS/shapes.")
    ] = None,
    picture: Annotated[bool, typer.Option(help="Write a picture (PNG) of each mode.")] = True,
    page: Annotated[bool, typer.Option(help="Write a page (HTML) in which the modes move.")] = True,
    vtu: Annotated[bool, typer.Option("--vtu", help="Write VTU and PVD for ParaView.")] = False,
    uff: Annotated[
        bool, typer.Option("--uff", help="Write universal files (15, 2412, 55).")
    ] = False,
) -> None:
    """What modes, or ends of runs, look like: a picture, a page, files for other programs."""
    from squealstudy import face, screen
    from squealstudy.cli.shape import shapes
    from squealstudy.paths import usable_cache

    with usable_cache(screen.warning):
        kinds = (picture, page, vtu, uff)
        facts = shapes(face.open_results(results), point, mode, track, output, kinds)
    screen.show(screen.facts(facts))


def columns(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="[KIND|RESULTS]", help="Kind of study, as complex_modes, or its results."
        ),
    ] = None,
    table: Annotated[str | None, typer.Argument(help="One table alone, as points.")] = None,
) -> None:
    """What the columns of result tables mean: unit, definition, error."""
    from squealstudy import face, screen
    from squealstudy.cli.columns import described, kinds_and_tables
    from squealstudy.columns import COLUMNS

    if kind is not None and kind not in COLUMNS and Path(kind).is_dir():
        kind = face.open_results(Path(kind)).kind
    screen.show(*(kinds_and_tables() if kind is None else described(kind, table)))


@on_results
def compare(
    frequency: Annotated[
        Path, typer.Argument(metavar="RESULTS", help="Complex modes, or limit cycles.")
    ],
    other: Annotated[
        Path,
        typer.Argument(
            metavar="OTHER_RESULTS",
            help="Complex modes after a change of the first, or results in time.",
        ),
    ],
    csv: Csv = False,
) -> None:
    """What a change does to unstable modes, or what is predicted beside what happens in time.

    Of two studies of complex modes: onsets, growth and shares before and after. Of one and its
    runs in time: growth against fitted growth, and which instabilities express themselves; of limit
    cycles verdicts, levels and frequencies, and which designs are bistable.
    """
    from squealstudy import face, screen
    from squealstudy.cli.before_after import before_after
    from squealstudy.cli.compare import comparison, cycle_comparison
    from squealstudy.cli.run import outside
    from squealstudy.engine.comparison import in_order
    from squealstudy.engine.manifest import outdated

    pair = face.open_results(frequency), face.open_results(other)
    is_change = all("onsets" in results.tables for results in pair)
    pair = pair if is_change else in_order(*pair)
    for results in pair:
        if text := outdated(results.directory, results.manifest):
            screen.warning(f"{text}; run that study again")
    table = pair[0].compare(pair[1])
    if csv:
        screen.show_csv(table)
        return
    if is_change:
        screen.show(*before_after(table, *pair))
        return
    cycles = "agreement" in table
    screen.show(*(cycle_comparison(table) if cycles else comparison(table, pair[0].track_names)))
    for name, results in zip((pair[0].kind.replace("_", " "), "time"), pair, strict=True):
        screen.show(*outside(results, f"{name} study: "))
