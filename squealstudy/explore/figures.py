"""Empty figures of Bokeh with named sources and annotations, which the page's script fills."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bokeh
from bokeh.embed import json_item
from bokeh.events import DoubleTap, MouseLeave, MouseMove, Reset, SelectionGeometry, Tap
from bokeh.models import (
    BoxAnnotation,
    BoxSelectTool,
    BoxZoomTool,
    ColumnDataSource,
    CustomJS,
    PanTool,
    Range1d,
    ResetTool,
    Span,
    WheelZoomTool,
)
from bokeh.plotting import figure

from squealstudy.colours import COLOURS, DARK, GREY

LIBRARY = Path(bokeh.__file__).with_name("server") / "static" / "js" / "bokeh.min.js"
HEIGHT, LOW = 380, 260  # px
BRUSH = "#0072B2"


def library() -> str:
    """Bokeh's script for browsers, as text that can stand in a page."""
    return LIBRARY.read_text(encoding="utf-8").replace("</script", "<\\/script")


def figures(kind: str) -> dict[str, Any]:
    """Figures by the id of their element in the page, as `Bokeh.embed.embed_item` takes them."""
    by_element = {"map": _map()}
    if kind == "complex_modes":
        by_element |= {"diagram": _diagram(), "line": _line("line")}
    elif kind == "limit_cycles":
        by_element["line"] = _line("line")
    else:
        by_element["history"] = _history()
    return {name: json.loads(json.dumps(json_item(fig))) for name, fig in by_element.items()}


def _figure(name: str, height: int, brush: str = "") -> Any:
    """A figure without points, which reports events to the page's script."""
    fig = figure(
        name=name,
        height=height,
        sizing_mode="stretch_width",
        tools=[],
        x_range=Range1d(0, 1),
        y_range=Range1d(0, 1),
        output_backend="canvas",
        toolbar_location="above",
        min_border_right=12,
    )
    fig.toolbar.logo = None
    zoom = BoxZoomTool(dimensions="width" if brush == "zoom" else "both")
    fig.add_tools(PanTool(), zoom, WheelZoomTool(), ResetTool())
    if brush in ("both", "width"):
        select = BoxSelectTool(dimensions=brush, renderers=[])
        fig.add_tools(select)
        fig.toolbar.active_drag = select
        box = BoxAnnotation(name="brush", fill_color=BRUSH, fill_alpha=0.08, line_color=BRUSH)
        box.visible = False
        fig.add_layout(box)
    else:
        fig.toolbar.active_drag = zoom
    fig.toolbar.active_scroll = None
    callback = CustomJS(args={"name": name}, code="window.squealstudy.happened(name, cb_obj)")
    for event in (Tap, DoubleTap, MouseMove, MouseLeave, Reset, SelectionGeometry):
        fig.js_on_event(event, callback)
    fig.grid.grid_line_color = "#E8E8E8"
    fig.outline_line_color = None
    return fig


def _points(fig: Any, name: str, **look: Any) -> None:
    """Draw points of a new source of this name, with columns x, y, fill, line, size, marker."""
    columns: dict[str, list[Any]] = {k: [] for k in ("x", "y", "fill", "line", "size", "marker")}
    source = ColumnDataSource(columns, name=name)
    look_columns = {
        "fill_color": "fill",
        "line_color": "line",
        "size": "size",
        "marker": "marker",
    } | look
    fig.scatter("x", "y", source=source, **look_columns)


def _ring(fig: Any) -> None:
    """Draw a ring around the chosen point."""
    source = ColumnDataSource({"x": [], "y": []}, name="chosen")
    look: dict[str, Any] = {"fill_color": None, "line_color": "#000000"}
    fig.scatter("x", "y", source=source, size=17, line_width=2.5, **look)


def _map() -> Any:
    fig = _figure("map", HEIGHT, "both")
    _points(fig, "points", line_width=0.6)
    _ring(fig)
    return fig


def _diagram() -> Any:
    """Growth over frequency of the modes of a design point, on top of those of a selection."""
    fig = _figure("diagram", HEIGHT, "width")
    fig.xaxis.axis_label, fig.yaxis.axis_label = "frequency [Hz]", "growth rate [1/s]"
    fig.add_layout(_zero())
    _points(fig, "others", fill_alpha=0.35)
    _points(fig, "points", line_width=1.4)
    _ring(fig)
    return fig


def _line(name: str) -> Any:
    """Lines of tracks, or of branches, over a parameter, with their points."""
    fig = _figure(name, HEIGHT)
    fig.add_layout(_zero())
    marker = Span(name="here", dimension="height", location=0, line_color=DARK, line_dash="dashed")
    fig.add_layout(marker)
    lines: dict[str, list[Any]] = {"xs": [], "ys": [], "colour": [], "width": [], "dash": []}
    fig.multi_line(
        "xs",
        "ys",
        source=ColumnDataSource(lines, name="lines"),
        line_color="colour",
        line_width="width",
        line_dash="dash",
    )
    _points(fig, "points", line_width=1.2)
    _ring(fig)
    return fig


def _history() -> Any:
    fig = _figure("history", HEIGHT, "zoom")
    fig.xaxis.axis_label = "time [s]"
    source = ColumnDataSource({"x": [], "y": []}, name="points")
    fig.line("x", "y", source=source, line_color=COLOURS[1], line_width=0.8)
    return fig


def _zero() -> Any:
    return Span(name="zero", dimension="width", location=0, line_color=GREY, line_width=1)
