"""Picture of a shape: the deformed model, its parts drawn apart, and its contact faces."""

from __future__ import annotations

import textwrap
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from squealstudy.errors import ModelError
from squealstudy.shapes.names import name_of
from squealstudy.shapes.shape import DAMPING, Shape
from squealstudy.shapes.surface import Camera, picture, triangles, with_middles
from squealstudy.wording import setting

VIEW_DEG = (-38.0, 24.0)  # azimuth and elevation, deg
DISPLACEMENT_OVER_DIAGONAL = 0.05  # largest displacement that is drawn, over the model's diagonal
SAMPLES_PER_PIXEL = 2  # samples of a pixel in each direction
PIXEL_COLUMNS = 900
COLOURED_DECADES = 3.0  # decades of strain energy density with a colour of their own
PERCENT_PER_CM3 = 1e-4  # a density of 1/m3, in % per cm3
# from grey, at rest, to the colour of the largest displacement
AMPLITUDE_COLOURS = LinearSegmentedColormap.from_list(
    "amplitude", ["#ccd4da", "#ffe28c", "#f9963c", "#d8281f", "#7a0014"]
)
DENSITY_COLOURS = mpl.colormaps["viridis"]
GAP_OVER_DIAGONAL = 0.12  # shift between parts that are drawn apart, over the model's diagonal

EMBRACING_PART_SHIFT = 0.35  # shift of a part that embraces others, over the model's diagonal
TITLE_LINE_CHARACTERS = 130  # characters of a line of a title
SAME_HZ = 1e-6  # relative difference of the same frequency


def draw(shape: Shape) -> Figure:
    """Picture of amplitude on the deformed model, energy density on its parts, and contact faces.

    ModelError if the shape has no surface.
    """
    if not sum(len(part.facets) for part in shape.parts):
        raise ModelError("no component of this model has cells: there is no surface to draw")
    pairs = list(dict.fromkeys(shape.contact.pairs)) if len(shape.contact.points) else []
    figure: Any = Figure(figsize=(14.0, 7.0 + 3.4 * bool(pairs)), layout="constrained")
    figure.suptitle("\n".join([*title(shape), *sources(shape)]), fontsize=12)
    if pairs:
        upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=[6.4, 4.0])[:, 0]
    else:
        upper, lower = figure, None
    left_axes, right = upper.subplots(1, 2)
    _amplitude(left_axes, shape)
    _density(right, shape)
    if pairs:
        _contact(lower, shape, pairs)
    return figure


def title(shape: Shape) -> list[str]:
    """Lines of a title: mode, frequency, growth, damping and name; values of the design point."""
    label = shape.label
    values = ", ".join(
        setting(name, number, label.units.get(name, "")) for name, number in label.values.items()
    )
    figures = f"{shape.frequency_hz:.1f} Hz"
    if not label.motion:
        growth, damping = shape.growth_rate, 100 * shape.damping_ratio
        figures += f", growth {growth:+.4g} 1/s, damping {damping:.3g} %"
    what = f"{label.study}, design point {label.row}, {label.number}"
    first = f"{what}: {figures}; {name_of(shape).text}"
    if label.track is not None:
        values = f"{beside_the_number(shape)}; {values}" if values else beside_the_number(shape)
    return [first, *textwrap.wrap(values, TITLE_LINE_CHARACTERS)]


def beside_the_number(shape: Shape) -> str:
    """Number of a tracked mode at this point, and its frequency where it grows fastest.

    Rankings have that frequency; it is left out where this point is the fastest.
    """
    label = shape.label
    text = f"mode {label.mode} of this point"
    if label.fastest_hz is None or abs(label.fastest_hz / shape.frequency_hz - 1) < SAME_HZ:
        return text
    return f"{text}; {label.number} grows fastest at {label.fastest_hz:.1f} Hz"


def sources(shape: Shape) -> list[str]:
    """Texts on where the elastic energy is, and where the growth comes from."""
    energy = ", ".join(f"{words(k)} {100 * v:.0f} %" for k, v in shape.energies.items())
    if shape.label.motion:
        return [f"elastic energy: {energy}"]
    growth = ", ".join(
        f"{v:+.4g} by " + ("damping" if k == DAMPING else f"friction at {words(k)}")
        for k, v in shape.growth_from.items()
    )
    return [f"elastic energy: {energy}", f"growth [1/s]: {growth}"]


def words(name: str) -> str:
    """A component's name without underscores."""
    return name.replace("_", " ")


def deformed(shape: Shape) -> np.ndarray:
    """Positions (n_nodes, 3) of the nodes, m, with the real part of displacements as drawn."""
    size = DISPLACEMENT_OVER_DIAGONAL * float(np.linalg.norm(np.ptp(shape.coordinates, axis=0)))
    positions: np.ndarray = shape.coordinates + size * shape.at(0.0)
    return positions


def exploded_shifts(shape: Shape) -> np.ndarray:
    """Shift (n_parts, 3) [m] of each part, to draw the parts apart.

    It is along the axis in which the model is thinnest, in the order of the parts' centres. A part
    that embraces others is moved to its side instead.
    """
    extent = np.ptp(shape.coordinates, axis=0)
    axis = int(np.argmin(extent))
    step = GAP_OVER_DIAGONAL * float(np.linalg.norm(extent))
    shift = np.zeros((len(shape.parts), 3))
    low, high = np.array(
        [[f(shape.coordinates[p.nodes, axis]) for p in shape.parts] for f in (np.min, np.max)]
    )
    inside = [i for i in range(len(low)) if not _embraces(low, high, i)]
    order = sorted(inside, key=lambda i: (low[i] + high[i]) / 2)
    for rank, i in enumerate(order):
        shift[i, axis] = step * (rank - (len(order) - 1) / 2)
    centre = shape.coordinates.mean(axis=0)
    for i in set(range(len(low))) - set(inside):
        side = shape.coordinates[shape.parts[i].nodes].mean(axis=0) - centre
        side[axis] = 0.0
        shift[i] = (
            EMBRACING_PART_SHIFT
            / GAP_OVER_DIAGONAL
            * step
            * side
            / max(np.linalg.norm(side), 1e-300)
        )
    return shift


def _embraces(low: np.ndarray, high: np.ndarray, i: int) -> bool:
    """Whether part i reaches beyond at least two others at both ends of the axis."""
    beyond = (low[i] < low) & (high[i] > high)
    return bool(beyond.sum() >= 2)


def density_range(shape: Shape) -> tuple[float, float]:
    """Least and largest density of strain energy with a colour of its own, % per cm3."""
    density = shape.density[shape.density > 0] * PERCENT_PER_CM3
    high = float(np.percentile(density, 99.8)) if len(density) else 1.0
    return high / 10**COLOURED_DECADES, high


def _amplitude(axes: Axes, shape: Shape) -> None:
    colours = ScalarMappable(Normalize(0.0, 1.0), AMPLITUDE_COLOURS)
    _surface(axes, shape, deformed(shape), np.asarray(shape.amplitude), colours)
    axes.set_title("deformed, by amplitude", fontsize=11)
    _bar(axes, colours, "largest displacement in a cycle, of the largest of all")


def _density(axes: Axes, shape: Shape) -> None:
    """Draw the parts apart, coloured by the density of strain energy."""
    low, high = density_range(shape)
    colours = ScalarMappable(LogNorm(low, high), DENSITY_COLOURS)
    points = shape.coordinates.copy()
    for part, shift in zip(shape.parts, exploded_shifts(shape), strict=True):
        points[part.nodes] += shift
    _surface(
        axes,
        shape,
        points,
        np.maximum(np.nan_to_num(shape.density) * PERCENT_PER_CM3, low),
        colours,
    )
    axes.set_title("parts drawn apart, by density of strain energy", fontsize=11)
    _bar(axes, colours, "% of the elastic energy per cm3", extend="both")


def _surface(
    axes: Axes, shape: Shape, points: np.ndarray, values: np.ndarray, colours: ScalarMappable
) -> None:
    """Draw all parts into axes."""
    facets = np.concatenate([part.facets for part in shape.parts])
    surface = triangles(facets, len(points))
    points, values = with_middles(facets, points), with_middles(facets, values, smooth=False)
    camera = Camera.at(*VIEW_DEG)
    on_screen = camera.seen(points[np.unique(surface.nodes)])[:, :2]
    low, high = on_screen.min(axis=0), on_screen.max(axis=0)
    edge = 0.02 * float((high - low).max())
    window = (low[0] - edge, high[0] + edge, low[1] - edge, high[1] + edge)
    image = picture(points, surface, values, camera, window, SAMPLES_PER_PIXEL * PIXEL_COLUMNS)
    rgba = _fewer(image.colours(colours))
    axes.imshow(rgba, extent=window, interpolation="antialiased")
    axes.set_axis_off()


def _fewer(rgba: np.ndarray) -> np.ndarray:
    """A picture whose samples are averaged to pixels; colours are weighted by what is covered."""
    rows, columns = (n // SAMPLES_PER_PIXEL * SAMPLES_PER_PIXEL for n in rgba.shape[:2])
    tiles = rgba[:rows, :columns].reshape(
        rows // SAMPLES_PER_PIXEL,
        SAMPLES_PER_PIXEL,
        columns // SAMPLES_PER_PIXEL,
        SAMPLES_PER_PIXEL,
        4,
    )
    covered = tiles[..., 3:].mean(axis=(1, 3))
    colour = (tiles[..., :3] * tiles[..., 3:]).mean(axis=(1, 3)) / np.maximum(covered, 1e-9)
    return np.clip(np.concatenate([colour, covered], axis=2), 0.0, 1.0)


def _bar(axes: Axes, colours: ScalarMappable, label: str, extend: str = "neither") -> None:
    """Draw a colour bar below the axes."""
    figure: Any = axes.figure
    figure.colorbar(
        colours,
        ax=axes,
        orientation="horizontal",
        label=label,
        shrink=0.6,
        aspect=30,
        extend=extend,
        pad=0.02,
    )


def _contact(figure: Any, shape: Shape, pairs: list[str]) -> None:
    """Draw pressure, slip and growth by friction on each pair of contact faces."""
    contact = shape.contact
    how = ", linearised" if shape.label.motion else ""
    drawn: tuple[tuple[str, np.ndarray, Colormap, bool], ...] = (
        (
            f"pressure amplitude{how} [MPa/um]",
            np.abs(contact.pressure) * 1e-12,
            AMPLITUDE_COLOURS,
            False,
        ),
        ("slip amplitude [um/um]", contact.slip_amplitude, AMPLITUDE_COLOURS, False),
        ("growth by friction [1/s per cm2]", contact.fed * 1e-4, mpl.colormaps["RdBu_r"], True),
    )
    drawn = drawn[:2] if shape.label.motion else drawn
    grid = figure.subplots(1, len(drawn) * len(pairs), squeeze=False)[0]
    across = _plane(contact.points)
    for column, (label, values, colours, signed) in enumerate(drawn):
        high = float(np.abs(values).max()) or 1.0
        norm = TwoSlopeNorm(0.0, -high, high) if signed else Normalize(0.0, high)
        column_axes = [grid[len(pairs) * column + k] for k in range(len(pairs))]
        for axes, pair in zip(column_axes, pairs, strict=True):
            of_pair = np.array([name == pair for name in contact.pairs])
            _points(
                axes,
                contact.points[of_pair] @ across,
                contact.area[of_pair],
                values[of_pair],
                norm,
                colours,
            )
            axes.set_title(words(pair), fontsize=10)
        column_axes[0].set_ylabel("y [mm]", fontsize=8)
        figure.colorbar(
            ScalarMappable(norm, colours),
            ax=column_axes,
            orientation="horizontal",
            label=label,
            shrink=0.85,
            aspect=25,
            ticks=MaxNLocator(4),
        )


def _plane(points: np.ndarray) -> np.ndarray:
    """The two axes (3, 2), of x, y and z, along which the contact points spread most."""
    widest = np.sort(np.argsort(np.ptp(points, axis=0))[1:])
    return np.eye(3)[:, widest]


def _points(
    axes: Axes,
    positions: np.ndarray,
    area: np.ndarray,
    values: np.ndarray,
    norm: Any,
    colours: Colormap,
) -> None:
    """Draw contact points as spots of about their areas, in mm."""
    from matplotlib.collections import EllipseCollection

    size = 1e3 * np.sqrt(area)
    spots = EllipseCollection(
        1.12 * size,
        1.12 * size,
        np.zeros(len(size)),
        units="x",
        offsets=1e3 * positions,
        offset_transform=axes.transData,
        array=values,
        norm=norm,
        cmap=colours,
    )
    axes.add_collection(spots)
    low, high = 1e3 * positions.min(axis=0), 1e3 * positions.max(axis=0)
    edge = 0.06 * float((high - low).max())
    axes.set(xlim=(low[0] - edge, high[0] + edge), ylim=(low[1] - edge, high[1] + edge))
    axes.set_aspect("equal")
    axes.tick_params(labelsize=8)
    axes.set_xlabel("x [mm]", fontsize=8)
