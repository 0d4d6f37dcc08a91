"""Commands on models and kernels; the work is imported when one runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from squealstudy.cli.options import (
    FAULT,
)

PICTURE_SUFFIXES = (".png", ".svg")


def inspect(
    model: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="Model file (TOML), or a mesh alone: .inp, .bdf, ..."),
    ],
    picture: Annotated[
        Path | None,
        typer.Option("--picture", "-p", help=f"Picture to draw, {' or '.join(PICTURE_SUFFIXES)}."),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            help="Universal file with measured modes of a free component, to be compared with its "
            "own: pairs with MAC and frequency; the picture is then the matrix of MAC."
        ),
    ] = None,
    component: Annotated[str | None, typer.Option(help="Which component was measured.")] = None,
    unit: Annotated[str, typer.Option(help="Of lengths measured, where the file has none.")] = "m",
    tolerance: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="How far a measured point may be from its node, as '3 mm'; default 2 % of the "
            "component's length.",
        ),
    ] = None,
    units: Annotated[str, typer.Option(help="Of a mesh alone: t-mm-s, mm-kg-ms or SI.")] = "t-mm-s",
    part: Annotated[
        str | None, typer.Option(help="Of a mesh alone: its instance, element set or body.")
    ] = None,
    pass_over: Annotated[
        list[str] | None,
        typer.Option(metavar="KEYWORD", help="Of a mesh alone: a keyword to pass over."),
    ] = None,
) -> None:
    """What a model file was understood as: parts, contact, rotation, loads, and doubts.

    Of a mesh alone, or of a model file without contact or load, what is there: mass, inertia, free
    modes, sets, materials. Exit code 1 where something is in doubt.
    """
    if (measured is None) != (component is None):
        raise typer.BadParameter("--measured needs --component, and --component --measured")
    if picture is not None and picture.suffix.lower() not in PICTURE_SUFFIXES:
        raise typer.BadParameter(f"{picture}: a picture is {' or '.join(PICTURE_SUFFIXES)}")
    if measured is not None and component is not None:
        from squealstudy.cli.inspect import inspected as compared

        if compared(model, component, measured, unit, tolerance, picture):
            raise typer.Exit(FAULT)
        return
    from squealstudy import face_model, screen
    from squealstudy.errors import ModelError
    from squealstudy.study.model_files import is_lumped

    if not model.exists() and str(model) in face_model.list_models():
        raise ModelError(
            f"'{model}' is no file but a model of squealstudy: squealstudy models {model} tells "
            "its options, parameters, springs and layers"
        )

    if is_lumped(model):
        from squealstudy.cli.inspect_lumped import lumped_facts

        if picture is not None:
            raise typer.BadParameter("a lumped model has no mesh to draw: no --picture")
        screen.show(*lumped_facts(model))
        return
    from squealstudy.cli.inspect import part_tables
    from squealstudy.study.components import inspected, inspected_part, read_model

    if model.suffix.lower() == ".toml":
        read = read_model(model, unfinished=True)
        inspection, geometry = inspected(read)
        facts, parameters = part_tables(read, inspection)
    else:
        inspection, geometry = inspected_part(model, units, part, pass_over or ())
        facts, parameters = [("units", units), *inspection.facts], []
    screen.show(screen.facts(facts))
    if parameters:
        screen.show("\nparameters", screen.facts(parameters))
    if picture is not None and geometry is not None:
        from squealstudy.cli.inspect import draw, draw_modes

        draw(geometry, picture)
        screen.show(f"\npicture: {picture}", unbroken=True)
        if not geometry.file.contact:
            for written in draw_modes(geometry, picture):
                screen.show(f"free modes: {written}", unbroken=True)
    for text in inspection.doubts:
        screen.warning(text)
    if inspection.doubts:
        raise typer.Exit(FAULT)


def models(
    name: Annotated[str | None, typer.Argument(help="Model to describe.")] = None,
    modes: Annotated[
        bool | None,
        typer.Option(
            help="List the components' free-free modes; by default of models without a mesh, and "
            "where --mesh names one."
        ),
    ] = None,
    mesh: Annotated[
        str | None, typer.Option(help="Of the modes; by default that of a study that names none.")
    ] = None,
) -> None:
    """List models, or one model's parameters with units and defaults; with --modes its components.

    Modes of components are free-free ones.
    """
    from squealstudy import face_model, screen
    from squealstudy.cli.models import CONTRACT, described
    from squealstudy.cli.models import LUMPED as LUMPED_KEYS
    from squealstudy.models.lumped.definition import DESCRIPTION as OF_LUMPED
    from squealstudy.models.lumped.definition import NAME as LUMPED
    from squealstudy.models.matrices.family import NAME as MATRICES

    listed = face_model.list_models()
    chosen = {} if mesh is None else {"mesh": mesh}
    if name is None:
        if chosen:
            raise typer.BadParameter("--mesh is of a model: name one")
        screen.show(screen.facts(listed.items()))
        screen.show("\nsquealstudy models NAME lists parameters, components and modes.")
    elif name == LUMPED and mesh is None:
        screen.show(f"{LUMPED}: {OF_LUMPED}\n\n{LUMPED_KEYS}")
    elif name == MATRICES and mesh is None:
        screen.show(f"{MATRICES}: {listed[MATRICES]}\n\n{CONTRACT}")
    else:
        model = face_model.model(name, **chosen)
        if modes is None:
            modes = mesh is not None or not model.definition.meshed
        for part in described(model, modes):
            screen.show(part)  # modes of a mesh take their time
        if model.definition.meshed and not modes:
            screen.show(f"\nFree-free modes of its components: squealstudy models {name} --modes")


def warmup(
    single: Annotated[bool, typer.Option("--single", help="Single-precision storage too.")] = False,
) -> None:
    """Compile the kernels of transient studies once, into the cache."""
    from squealstudy import screen
    from squealstudy.kernels.jit import compiled_directory
    from squealstudy.motion.warmup import warm_kernels

    seconds = warm_kernels(single)
    text = f"ready after {seconds:.1f} s, in {compiled_directory()}"
    screen.show(screen.facts([("kernels", text)]))
