"""Pictures of a report in order of importance, each with an alternative text."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from squealstudy.engine.pictures import NOTHING_TO_SEE, Choices, Plot, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from squealstudy.engine.result_tables import ResultTables

DPI = 110
# beginnings of the names of pictures, in the order of a report
FIRST_PICTURES = (
    *("torque_history", "verdict_map", "design_history"),
    *("evolution", "stability_map_growth", "designs", "cycle_levels", "levels"),
    *("robust", "sensitivity", "ranking", "stability_diagram_worst", "operating_matrix"),
    *("cycle_growth", "growth_comparison", "spectrogram", "modal_energies"),
)
MAX_LABELS = 6  # most axes in an alternative text


def in_order(results: ResultTables) -> list[tuple[str, Plot, Choices]]:
    """All pictures of results in the order of FIRST_PICTURES, the loudest run before others.

    Pictures along the default parameter come first.
    """
    loudest = None
    if results.kind == "transient" and results.points["torque_rms"].notna().any():
        loudest = int(results.points["torque_rms"].to_numpy(float, na_value=-1.0).argmax())

    def rank(picture: tuple[str, Plot, Choices]) -> tuple[bool, int, bool]:
        name, _, choices = picture
        is_other_line = choices.get("along", results.along) != results.along
        order = next(
            (k for k, start in enumerate(FIRST_PICTURES) if name.startswith(start)),
            len(FIRST_PICTURES),
        )
        return is_other_line, order, "point" in choices and choices["point"] != loudest

    return sorted(pictures(results), key=rank)


def report_pictures(results: ResultTables, max_bytes: int) -> tuple[list[str], int]:
    """HTML of the pictures that fit into `max_bytes`, a note on others, and the bytes they take."""
    figures, spent, left_out = [], 0, []
    for name, plot, choices in in_order(results):
        image, drawn = BytesIO(), plot(results, **choices)
        if drawn.get_label() == NOTHING_TO_SEE:
            continue
        with plot.named():
            drawn.savefig(image, format="png", dpi=DPI)
        text = b64encode(image.getvalue()).decode()
        if spent + len(text) > max_bytes:
            left_out.append(name)
            continue
        spent += len(text)
        what = (plot.draw.__doc__ or name).strip().splitlines()[0]
        figures.append(figure_of(text, f"{what} ({name})", f"{what} {in_words(drawn)}"))
    if left_out:
        figures.append(
            f'<p class="note">Left out for their size: {escape(", ".join(left_out))}.</p>'
        )
    return figures, spent


def figure_of(image: str, caption: str, alternative: str) -> str:
    """A picture (PNG in base64) with its caption and its alternative text."""
    return (
        f'<figure><img alt="{escape(alternative.strip())}" src="data:image/png;base64,{image}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def in_words(figure: Figure) -> str:
    """Alternative text of a figure: its titles and the labels of its axes."""
    titles = [figure.get_suptitle()]
    labels: dict[str, None] = {}
    for axes in figure.axes:
        titles += [axes.get_title(), axes.get_title(loc="left")]
        x, y = axes.get_xlabel(), axes.get_ylabel()
        labels |= dict.fromkeys([f"{y} over {x}"] if x and y else filter(None, (x, y)))
    titles_shown = dict.fromkeys(" ".join(text.split()) for text in titles if text.strip())
    return "; ".join([*titles_shown, *list(labels)[:MAX_LABELS]]) + (
        "." if titles_shown or labels else ""
    )


def images(results: ResultTables) -> Iterator[str]:
    """HTML images of all pictures that the results allow, in order of importance."""
    for _, plot, choices in in_order(results):
        image, drawn = BytesIO(), plot(results, **choices)
        with plot.named():
            drawn.savefig(image, format="png")
        encoded = b64encode(image.getvalue()).decode()
        yield f'<img alt="{escape(in_words(drawn))}" src="data:image/png;base64,{encoded}">'
