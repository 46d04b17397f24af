"""The picture of the README: the cantilever at six loads."""

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from figures import mesh_of_step, quads, save
from pages.runs import ROOT


def draw(runs):
    out = runs("beam", h=0.25, n=4, method="gimp", update="corners", every=1)
    figure = Figure(figsize=(8.8, 7.4), layout="constrained")
    axes = figure.add_subplot(aspect="equal")
    for line in np.arange(0, 11.01, 0.25):
        axes.plot([line, line], [0, 10], color="0.93", lw=0.5, zorder=0)
        if line <= 10:
            axes.plot([0, 11], [line, line], color="0.93", lw=0.5, zorder=0)
    for step in (0, 2, 5, 10, 20, 50):
        mesh = mesh_of_step(out, "domains", step)
        corners, tension = quads(mesh), -np.asarray(mesh.cell_data["pressure"]) / 1e6
        drawn = PolyCollection(corners, array=tension, cmap="RdYlBu_r", edgecolors="0.25", linewidths=0.15, zorder=2 + step)
        drawn.set_clim(-0.8, 0.8)
        axes.add_collection(drawn)
        tip = corners.reshape(-1, 2)
        tip = tip[np.argmax(tip[:, 0] - 0.3 * tip[:, 1])]
        axes.annotate(f"{2 * step} kN", tip, xytext=(7, 0), textcoords="offset points", fontsize=9, color="0.25")
    axes.set(xlim=(0, 11), ylim=(0, 10.1), xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    figure.colorbar(drawn, ax=axes, label="mean stress [MPa], tension positive", shrink=0.6, pad=0.01)
    (ROOT / "docs/images").mkdir(exist_ok=True)
    save(figure, ROOT / "docs/images/beam.png")
