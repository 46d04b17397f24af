"""Locking: limit loads with and without it, the strains and pressures of a footing, and the collapse of section 7.5."""

import sys
from pathlib import Path

import numpy as np

from figures import mesh_of_step, save
from pages.collapse import TABLE_6, extent_and_height
from pages.drawing import MARKERS, colour_bar, discs, panels, save_svg
from pages.runs import ROOT, heading, row, summary

sys.path.insert(0, str(ROOT / "benches"))
import locking  # noqa: E402

HERE = Path(__file__).resolve().parents[1]
CURED, STANDARD = "mean-dilatation", "standard"
NAMES = {
    "strip-rough": "rough strip", "strip-smooth": "smooth strip", "notch": "notched plate", "cut": "vertical cut",
}


def found(runs, name, h, volumetric, **settings):
    """Outcome and results directory of a case with standard points, 2 x 2 in a cell."""
    words = [f"locking-{name}", f"h-{h}", volumetric, *(f"{key}-{value}" for key, value in settings.items())]
    folder = runs.directory / "_".join(words)
    if not (folder / "out/summary.json").exists():
        locking.run(runs.program, name, folder, h, method="mpm", n=2, volumetric=volumetric, **settings)
    return locking.outcome(locking.CASES[name], folder / "out", h), folder / "out"


def curves(runs):
    """Load over displacement of the rough strip, and errors of limit loads over the spacing."""
    figure, ((left, right),) = panels(1, 2, 9.2, 3.8)
    left.axhline(locking.PRANDTL, color="0.4", lw=1)
    left.text(0.01, locking.PRANDTL - 0.1, "2 + π", color="0.3", va="top")
    for h, colour in ((0.25, "#7fb3d5"), (0.125, "#2c6fbb"), (0.0625, "#123a6b")):
        for volumetric, style in ((CURED, "-"), (STANDARD, "--")):
            run, _ = found(runs, "strip-rough", h, volumetric)
            label = f"h = B/{round(2 / h)}" if volumetric == CURED else None
            left.plot([0, *(0.5 * np.array(run.time))], [0, *run.loads], style, color=colour, label=label)
    left.set(xlabel="displacement of the middle [10⁻³ B/2]", ylabel="mean pressure / c", xlim=(0, 0.5), ylim=(0, 10))
    left.legend(loc="lower right", title="dashed: standard", fontsize=8, title_fontsize=8)
    for (name, title), marker in zip(NAMES.items(), MARKERS):
        case = locking.CASES[name]
        length = 0.5 if name == "notch" else 1
        for volumetric, style in ((CURED, "-"), (STANDARD, "--")):
            errors = [100 * (found(runs, name, h, volumetric)[0].load / case.exact - 1) for h in case.spacings]
            sizes = [h / length for h in case.spacings]
            colour = f"C{list(NAMES).index(name)}"
            right.loglog(sizes, errors, style + marker, ms=4, color=colour, label=title if volumetric == CURED else None)
    right.loglog([0.06, 0.24], [0.5, 2], color="0.5", lw=0.8)
    right.text(0.2, 1.1, "order 1", color="0.3", va="top")
    right.set(xlabel="h / half width, half ligament or height", ylabel="error of the limit load [%]")
    right.set_xticks([1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2], ["1/32", "1/16", "1/8", "1/4", "1/2"])
    right.minorticks_off()
    right.legend(fontsize=8, title="dashed: standard", title_fontsize=8)
    save_svg(figure, HERE / "locking-loads.svg")


def footing(runs):
    """Plastic strain and pressure under the rough strip at its limit load."""
    figure, grid = panels(2, 2, 8.6, 5.2)
    h, limits = 0.125, ((0, 0.15), (-2, 8))
    for column, (volumetric, title) in enumerate([(STANDARD, "standard"), (CURED, "mean dilatation")]):
        run, out = found(runs, "strip-rough", h, volumetric, every=100)
        mesh = mesh_of_step(out, "points", -1)
        places = np.asarray(mesh.points)[:, :2]
        fields = 1e2 * np.asarray(mesh.point_data["equivalent_plastic_strain"]), np.asarray(mesh.point_data["pressure"]) / 1e3
        for axes, values, colours, range_ in zip(grid[:, column], fields, ("YlOrRd", "turbo"), limits):
            discs(axes, places, values, 0.65 * h, colours, range_)
            axes.plot([0, 1], [3.04, 3.04], color="black", lw=3)
            axes.set(xlim=(0, 4), ylim=(1, 3.1), aspect="equal")
            axes.tick_params(labelsize=7)
        grid[0, column].set_title(f"{title}: mean pressure {run.load:.2f} c", fontsize=9)
    colour_bar(figure, grid[0], limits[0], "equivalent plastic strain [%]", "YlOrRd", shrink=0.8)
    colour_bar(figure, grid[1], limits[1], "pressure / c", shrink=0.8)
    save(figure, HERE / "locking-footing.png")


def collapse(runs):
    """The collapse of section 7.5 without locking, beside Table 6."""
    text = (ROOT / "inputs/collapse.yaml").read_text()
    text = text.replace("parameters: {", "parameters: {volumetric: standard, ")
    text = text.replace('points_per_cell: "${n}"', 'points_per_cell: "${n}", strain: "${volumetric}"')
    deck = runs.directory / "collapse-without-locking"
    runs.directory.mkdir(parents=True, exist_ok=True)
    deck.with_suffix(".yaml").write_text(text)
    heading("h (m)", "points", "extent, paper", "mean dilatation", "f-bar", "height, paper", "mean dilatation", "f-bar")
    for n in (3, 6):
        for i, h in enumerate((2, 1, 0.5, 0.25)):
            ends = []
            for volumetric in (CURED, "f-bar"):
                out = runs(str(deck), h=h, n=n, method="mpm", every=0, volumetric=volumetric)
                steps = summary(out)["steps"]
                note = "" if summary(out)["outcome"] == "completed" else f" (step {steps})"
                ends.append([f"{end:.3f}{note}" for end in extent_and_height(out)])
            (x, y), (x_bar, y_bar) = ends
            row(h, f"{n} x {n}", TABLE_6[n][0][i], x, x_bar, TABLE_6[n][1][i], y, y_bar)


def draw(runs):
    curves(runs)
    footing(runs)
    collapse(runs)
