"""What the figures of the pages have in common: labels, panels, points, domains, set-ups."""

import io
import re

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse

from figures import COLOURS, mesh_of_step, quads, values_of

UPDATES = {
    "none": "no update",
    "determinant": "det F (32)",
    "diagonal": "$F_{ii}$ (33)",
    "stretch": "$U_{ii}$ (34)",
    "corners": "corners (37)",
    "diagonal-corrected": "$F_{ii}$ + volume (38)",
    "diagonal-incremental": "$\\Delta F_{ii}$ + volume (39)",
}
MARKERS = "osD^v<>p"
# The paper's maps for displacement and body force run from blue to yellow.
BLUE_TO_YELLOW = LinearSegmentedColormap.from_list("blue to yellow", ["#26329b", "#2077c4", "#2aa8a8", "#9dc261", "#fbe725"])
SUPPORT = "#c0392b"  # colour of what holds a body
WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 1}  # background of texts


def panels(rows, columns, width, height, **options):
    """A figure of this size in inches and its axes as an array, rows x columns."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def save_svg(figure, path):
    """Saves a drawing with text as text, coordinates to a hundredth of a point and no date."""
    picture = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "mpm"}):
        figure.savefig(picture, format="svg", metadata={"Date": None, "Creator": None})
    shorten = lambda tag: re.sub(r"(\d+\.\d\d)\d+", r"\1", tag[0])  # within tags: texts keep their digits
    path.write_text(re.sub(r"<[^>]+>", shorten, picture.getvalue()))


def corners_of_cells(mesh):
    """Corners (x, y) of the cells of a mesh whose cells all have the same number of corners: cells x corners x 2."""
    each = len(mesh.cell_connectivity) // mesh.n_cells
    return np.asarray(mesh.points)[mesh.cell_connectivity.reshape(-1, each), :2]


def occupied_cells(out, step, h):
    """Corners of the square cells, of size h from the origin, that the points hold or their domains overlap at the end
    of a step: the active cells of the step after it. (`grid_NNNN.vtu` has those of the step itself.)"""
    places = np.asarray(mesh_of_step(out, "points", step).points)[:, :2]
    low = high = places
    if (out / "domains.pvd").exists():
        corners = quads(mesh_of_step(out, "domains", step))
        low, high = np.maximum(corners.min(axis=1), 0), corners.max(axis=1)
    first = np.floor(low / h + 1e-9).astype(int)
    last = np.maximum(first, np.ceil(high / h - 1e-9).astype(int) - 1)
    cells = {(i, j) for (a, b), (c, d) in zip(first, last) for i in range(a, c + 1) for j in range(b, d + 1)}
    return h * (np.array(sorted(cells))[:, None] + [(0, 0), (1, 0), (1, 1), (0, 1)])


def shade_cells(axes, out, step, h, face="0.92", edge="0.72", width=0.3):
    """Shades the active grid cells."""
    cells = occupied_cells(out, step, h)
    axes.add_collection(PolyCollection(cells, facecolors=face, edgecolors=edge, linewidths=width, zorder=0))


def discs(axes, places, values, diameter, colours, limits, hard=False):
    """Points as discs of a diameter in the units of the axes; hard edges keep the file of very many small."""
    widths = np.full(len(places), diameter)
    drawn = EllipseCollection(widths, widths, 0 * widths, units="xy", offsets=places, offset_transform=axes.transData,
                              array=values, cmap=colours, linewidths=0, antialiaseds=not hard, zorder=2)
    drawn.set_clim(*limits)
    axes.add_collection(drawn)
    return drawn


def stress_limits(values):
    """Colour limits symmetric about zero that leave out the most extreme hundredth of the points."""
    limit = np.quantile(np.abs(values), 0.99)
    return -limit, limit


def stress_values(out, step, component, series="points"):
    mesh = mesh_of_step(out, series, step)
    return values_of(mesh.point_data if series == "points" else mesh.cell_data, "cauchy_stress", component)


def draw_stress(axes, out, step, h, component, limits, title=None, diameter=None, lines=0.0, hard=False):
    """Points of a diameter, or domains where it is not given, coloured by a stress component, over the active cells."""
    shade_cells(axes, out, step, h)
    mesh = mesh_of_step(out, "domains" if diameter is None else "points", step)
    values = stress_values(out, step, component, "domains" if diameter is None else "points")
    if diameter is None:
        drawn = PolyCollection(quads(mesh), array=values, cmap=COLOURS, edgecolors="black" if lines else "face",
                               linewidths=lines or 0.1, zorder=2)
        drawn.set_clim(*limits)
        axes.add_collection(drawn)
    else:
        discs(axes, np.asarray(mesh.points)[:, :2], values, diameter, COLOURS, limits, hard)
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=9)
    axes.tick_params(labelsize=7)


def colour_bar(figure, axes, limits, label, colours=COLOURS, **options):
    """One colour bar for all the axes given; `limits` and `label` share a unit."""
    figure.colorbar(ScalarMappable(Normalize(*limits), colours), ax=axes, label=label, **options)


def encircle(axes, place, radius, text=None):
    """A dashed circle around something the text speaks of."""
    axes.add_patch(Ellipse(place, 2 * radius, 2 * radius, fill=False, edgecolor="black", linestyle="--", linewidth=1.1, zorder=9))
    if text:
        axes.annotate(text, (place[0] + 0.75 * radius, place[1] + 0.75 * radius), xytext=(3, 3), textcoords="offset points", zorder=9)


# Set-ups: what a deck places on the grid before anything moves


def grid_lines(axes, size, spacing, **style):
    """The lines of a grid from the origin, as one path."""
    ends = [[(x, 0), (x, size[1]), (np.nan, np.nan)] for x in np.arange(0, size[0] + 0.5 * spacing, spacing)]
    ends += [[(0, y), (size[0], y), (np.nan, np.nan)] for y in np.arange(0, size[1] + 0.5 * spacing, spacing)]
    axes.plot(*np.concatenate(ends).T, **style)


def draw_set_up(axes, out, size, spacing, markersize, step=0):
    """The background grid, its active cells and the points of a step; returns the places of the points."""
    grid_lines(axes, size, spacing, color="0.8", lw=0.4, zorder=-2)
    shade_cells(axes, out, step, spacing, face="0.88", edge="0.6", width=0.4)
    places = np.asarray(mesh_of_step(out, "points", step).points)[:, :2]
    axes.plot(*places.T, "o", color="#2c6fbb", ms=markersize, mew=0, zorder=2)
    axes.set_aspect("equal")
    return places


def held_nodes(out, axis):
    """Places (x, y) of the nodes on which boundary conditions exert a force along an axis in the first load step."""
    mesh = mesh_of_step(out, "grid", 1)
    force = np.asarray(mesh.point_data["reaction"])[:, axis]
    return np.asarray(mesh.points)[np.abs(force) > 1e-12 * np.abs(force).max(initial=1e-300), :2]


def draw_rollers(axes, places, axis, radius, side=-1):
    """Rollers on nodes: circles beside them, on the side from which they hold, and the surface they roll on."""
    for place in places:
        centre = np.array(place, dtype=float)
        centre[axis] += side * radius
        axes.add_patch(Circle(centre, radius, facecolor="white", edgecolor=SUPPORT, lw=1, zorder=3, clip_on=False))
    low, high = places.min(axis=0), places.max(axis=0)
    wall = 2 * side * radius
    if axis == 0:
        axes.plot([low[0] + wall] * 2, [low[1] - radius, high[1] + radius], color=SUPPORT, lw=1.2, clip_on=False)
    else:
        axes.plot([low[0] - radius, high[0] + radius], [low[1] + wall] * 2, color=SUPPORT, lw=1.2, clip_on=False)


def dimension(axes, start, end, text, offset=(0, 0)):
    """A dimension line between two places, with its text in the middle."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "lw": 0.8, "shrinkA": 0, "shrinkB": 0}, annotation_clip=False)
    middle = (np.asarray(start, dtype=float) + np.asarray(end, dtype=float)) / 2
    axes.annotate(text, middle, xytext=offset, textcoords="offset points", ha="center", va="center", fontsize=9,
                  annotation_clip=False, bbox=WHITE)
