"""Pictures of a report: the one of the question first, each with words for who does not see it."""

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
# how names of pictures begin, what a study asks first; of several tables a study has those it needs
ORDER = (
    *("torque_history", "verdict_map", "design_history"),
    *("evolution", "stability_map_growth", "cycle_levels", "levels"),
    *("robust", "sensitivity", "ranking", "stability_diagram_worst", "operating_matrix"),
    *("cycle_growth", "growth_comparison", "spectrogram", "modal_energies"),
)
MOST_LABELS = 6  # labels of axes that an alternative text names


def in_order(results: ResultTables) -> list[tuple[str, Plot, Choices]]:
    """As `pictures`: that which answers the study's question first, of runs that of the loudest."""
    loudest = None
    if results.kind == "transient" and results.points["torque_rms"].notna().any():
        loudest = int(results.points["torque_rms"].to_numpy(float, na_value=-1.0).argmax())

    def place(found: tuple[str, Plot, Choices]) -> tuple[bool, int, bool]:
        name, _, choices = found
        aside = choices.get("along", results.along) != results.along
        first = next((k for k, start in enumerate(ORDER) if name.startswith(start)), len(ORDER))
        return aside, first, "point" in choices and choices["point"] != loudest

    return sorted(pictures(results), key=place)


def report_pictures(one: ResultTables, room: int) -> tuple[list[str], int]:
    """Figures (HTML) of all pictures that fit into so many bytes, and the bytes they take."""
    figures, spent, left_out = [], 0, []
    for name, plot, choices in in_order(one):
        image, drawn = BytesIO(), plot(one, **choices)
        if drawn.get_label() == NOTHING_TO_SEE:
            continue
        with plot.named():
            drawn.savefig(image, format="png", dpi=DPI)
        text = b64encode(image.getvalue()).decode()
        if spent + len(text) > room:
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


def figure_of(image: str, caption: str, instead: str) -> str:
    """A picture (PNG in base64) with what stands below it and instead of it."""
    return (
        f'<figure><img alt="{escape(instead.strip())}" src="data:image/png;base64,{image}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def in_words(figure: Figure) -> str:
    """Titles of a figure, and what its axes show."""
    titles = [figure.get_suptitle()]
    labels: dict[str, None] = {}
    for axes in figure.axes:
        titles += [axes.get_title(), axes.get_title(loc="left")]
        x, y = axes.get_xlabel(), axes.get_ylabel()
        labels |= dict.fromkeys([f"{y} over {x}"] if x and y else filter(None, (x, y)))
    titles_shown = dict.fromkeys(" ".join(text.split()) for text in titles if text.strip())
    return "; ".join([*titles_shown, *list(labels)[:MOST_LABELS]]) + (
        "." if titles_shown or labels else ""
    )


def images(results: ResultTables) -> Iterator[str]:
    """Every picture that the results allow, drawn for a page of HTML, the most telling first."""
    for _, plot, choices in in_order(results):
        image, drawn = BytesIO(), plot(results, **choices)
        with plot.named():
            drawn.savefig(image, format="png")
        encoded = b64encode(image.getvalue()).decode()
        yield f'<img alt="{escape(in_words(drawn))}" src="data:image/png;base64,{encoded}">'
