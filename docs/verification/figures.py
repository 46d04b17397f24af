"""Draws mpm results in the style of Coombs et al. (2020): points, domains and the active grid cells.

    python docs/verification/figures.py RESULTS --field cauchy_stress --component XX --out beam.png
    python docs/verification/figures.py RESULTS --step 20 --domains --out domains.png

`RESULTS` is the output directory of a run. Needs the packages of tests/python/requirements.txt, and no display:
VTK only reads files, Matplotlib draws.
"""

import argparse
import io
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pyvista
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

LARGEST_FILE = 150_000
COLOURS = "turbo"  # blue is the most compressive stress, red the most tensile, as in the paper


def mesh_of_step(directory, series, step):
    """The mesh of a load step; -1 is the last one written. Raises KeyError if the step was not written."""
    entries = ElementTree.parse(Path(directory) / f"{series}.pvd").getroot().findall("./Collection/DataSet")
    for entry in reversed(entries):
        mesh = pyvista.read(Path(directory) / entry.get("file"))
        if step == -1 or int(mesh.field_data["Step"][0]) == step:
            return mesh
    raise KeyError(f"{series}.pvd in {directory} has no load step {step}")


def values_of(attributes, field, component):
    """One component, by name or number, of a field of points or cells."""
    array = attributes.VTKObject.GetArray(field)
    if array is None:
        raise KeyError(f"no field {field}; there are {', '.join(attributes.keys())}")
    values = np.asarray(attributes[field])
    if values.ndim == 1:
        return values
    names = [array.GetComponentName(i) for i in range(values.shape[1])]
    return values[:, names.index(component) if component in names else int(component)]


def quads(mesh):
    """Corners (x, y) of the cells of a mesh of quadrilaterals: cells x 4 x 2."""
    return np.asarray(mesh.points)[mesh.cell_connectivity.reshape(-1, 4), :2]


def draw_active_cells(axes, directory, step):
    """Shades the active grid cells grey."""
    cells = quads(mesh_of_step(directory, "grid", step))
    axes.add_collection(PolyCollection(cells, facecolors="0.85", edgecolors="0.65", linewidths=0.4, zorder=0))
    axes.update_datalim(cells.reshape(-1, 2))


def draw_points(directory, step, field, component, out_png, size=6.0, label=None):
    """Draws the deformed points, coloured by a field, over the active grid cells; `size` is in points of print."""
    mesh = mesh_of_step(directory, "points", step)
    values = values_of(mesh.point_data, field, component)
    figure, axes = frame(directory, step)
    drawn = axes.scatter(*np.asarray(mesh.points)[:, :2].T, c=values, s=size, cmap=COLOURS, linewidths=0, zorder=2)
    finish(figure, axes, drawn, label or title(field, component), out_png)


def draw_domains(directory, step, field, component, out_png, label=None):
    """Draws the domains of the points, coloured by a field, over the active grid cells."""
    mesh = mesh_of_step(directory, "domains", step)
    corners, values = quads(mesh), values_of(mesh.cell_data, field, component)
    figure, axes = frame(directory, step)
    drawn = PolyCollection(corners, array=values, cmap=COLOURS, edgecolors="black", linewidths=0.2, zorder=2)
    axes.add_collection(drawn)
    axes.update_datalim(corners.reshape(-1, 2))
    finish(figure, axes, drawn, label or title(field, component), out_png)


def title(field, component):
    return field.replace("_", " ") + ("" if component is None else f" {component}")


def frame(directory, step):
    """A figure with the active cells and axes of equal scale."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x", ylabel="y")
    draw_active_cells(axes, directory, step)
    return figure, axes


def finish(figure, axes, drawn, label, out_png):
    axes.autoscale_view()
    figure.colorbar(drawn, ax=axes, label=label, shrink=0.7)
    save(figure, out_png)


def save(figure, out_png):
    """Saves a PNG with a palette, at a lower resolution where it would be larger than 150 kB."""
    for dpi in (160, 140, 120, 105, 90, 75, 60):
        picture, compressed = io.BytesIO(), io.BytesIO()
        figure.savefig(picture, dpi=dpi, format="png")
        image = Image.open(picture).convert("RGB").quantize(256, dither=Image.Dither.NONE)
        image.save(compressed, format="png", optimize=True)
        if compressed.tell() < LARGEST_FILE:
            Path(out_png).write_bytes(compressed.getvalue())
            return
    raise ValueError(f"{out_png} would be larger than {LARGEST_FILE} bytes")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", help="output directory of a run")
    parser.add_argument("--step", type=int, default=-1, help="load step; the last one written where not stated")
    parser.add_argument("--field", default="cauchy_stress")
    parser.add_argument("--component", default="XX", help="name or number; ignored for scalars")
    parser.add_argument("--domains", action="store_true", help="draw the domains instead of the points")
    parser.add_argument("--out", required=True, help="PNG file to write")
    arguments = parser.parse_args()
    draw = draw_domains if arguments.domains else draw_points
    draw(arguments.results, arguments.step, arguments.field, arguments.component, arguments.out)


if __name__ == "__main__":
    main()
