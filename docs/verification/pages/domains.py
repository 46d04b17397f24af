"""Domain updates under homogeneous motions, section 6.4: Table 2, Figures 4 and 5."""

from pathlib import Path

import numpy as np
from matplotlib.patches import Polygon

from figures import mesh_of_step, quads
from pages.drawing import UPDATES, panels, save_svg
from pages.runs import heading, row

HERE = Path(__file__).resolve().parents[1]
# Parameters of the deck, and the half lengths that a suitable update gives, relative to the original ones.
MODES = {
    "simple stretch": (dict(stretch_y=0.6), (1, 0.6)),
    "hydrostatic compression": (dict(stretch_x=0.7, stretch_y=0.7), (0.7, 0.7)),
    "simple shear": (dict(shear=1), (1, 1)),
    "pure rotation": (dict(angle=np.pi / 3), (1, 1)),
}
PAPER = {
    "simple stretch": "××✓✓✓", "hydrostatic compression": "×✓✓✓✓", "simple shear": "✓✓✓×✓", "pure rotation": "✓✓×✓✓",
}
ORIGINAL, UPDATED = "0.85", "0.45"


def domain(out, step=-1):
    """Corners (x, y) of the domain."""
    return quads(mesh_of_step(out, "domains", step))[0]


def gradient(out):
    """F in the plane."""
    return np.asarray(mesh_of_step(out, "points", -1).point_data["deformation_gradient"])[0].reshape(3, 3)[:2, :2]


def table_2(runs):
    """Table 2, and every case drawn: original domain, updated domain, true shape of the deformed domain."""
    figure, grid = panels(len(MODES), len(UPDATES), 11, 4.9, sharex=True, sharey=True)
    heading("motion", *(f"{update} (l_x, l_y; domain / point volume)" for update in UPDATES))
    for axes_of_mode, (mode, (parameters, suitable)) in zip(grid, MODES.items()):
        cells = []
        for k, (axes, update) in enumerate(zip(axes_of_mode, UPDATES)):
            out = runs("domains", method="gimp", update=update, **parameters)
            lengths, F = np.ptp(domain(out), axis=0), gradient(out)
            mark = "✓" if np.allclose(lengths, suitable, atol=1e-9) else "×"
            paper = PAPER[mode][k] if k < 5 else "–"
            volume = np.prod(lengths) / np.linalg.det(F)
            cells.append(f"{mark} (paper {paper}): {lengths[0]:.4f}, {lengths[1]:.4f}; {volume:.4f}")
            axes.add_patch(Polygon(domain(out, 0), facecolor=ORIGINAL, zorder=0))
            axes.add_patch(Polygon(domain(out), facecolor=UPDATED if mark == "✓" else "#c0563b", alpha=0.85, zorder=1))
            axes.add_patch(Polygon(domain(out, 0) @ F.T, fill=False, linestyle="--", linewidth=0.9, zorder=2))
            axes.set(aspect="equal", xlim=(-1.1, 1.1), ylim=(-0.8, 0.8), xticks=[], yticks=[])
            axes.spines[:].set_visible(False)
        axes_of_mode[0].set_ylabel(mode.replace(" ", "\n"), rotation=0, ha="right", va="center")
        row(mode, *cells)
    for axes, label in zip(grid[0], UPDATES.values()):
        axes.set_title(label, fontsize=9)
    save_svg(figure, HERE / "domains-updates.svg")


def draw_middle_lines(axes, places, **style):
    """The lines through the middles of opposite sides."""
    middles = (places + np.roll(places, -1, axis=0)) / 2
    for k in (0, 1):
        axes.plot(*middles[[k, k + 2]].T, color="black", lw=1, ms=5, marker="o", zorder=4, **style)
    return middles


def unsuitable_updates(axes, out, title):
    """Figure 4: a domain that shrinks or changes its volume in an isochoric motion."""
    axes.add_patch(Polygon(domain(out, 0), facecolor=ORIGINAL, zorder=0))
    axes.add_patch(Polygon(domain(out), facecolor=UPDATED, alpha=0.8, zorder=1))
    draw_middle_lines(axes, domain(out, 0), mfc="black")
    draw_middle_lines(axes, domain(out, 0) @ gradient(out).T, ls="--", mfc="white")
    axes.set_title(title, fontsize=9)


def update_by_corners(runs, axes):
    """Figure 5 (a): corners move with the grid, (35), mid-sides give lengths, (36), the volume is corrected, (37)."""
    motion = dict(steps=1, angle=0.6, stretch_x=1.25)
    original = domain(runs("domains", method="cpdi2", **motion), 0)
    moved = domain(runs("domains", method="cpdi2", **motion))
    out = runs("domains", method="gimp", update="corners", **motion)
    axes.add_patch(Polygon(original, facecolor=ORIGINAL, zorder=0))
    axes.add_patch(Polygon(original, fill=False, edgecolor="0.75", zorder=2))
    axes.add_patch(Polygon(moved, fill=False, linestyle="--", linewidth=0.9, zorder=3))
    axes.plot(*original.T, "o", color="black", mfc="white", ms=6, ls="none", zorder=5)
    axes.plot(*moved.T, "o", color="black", mfc="0.6", ms=6, ls="none", zorder=5)
    middles = draw_middle_lines(axes, moved, ls=":", mfc="black")
    half = np.ptp(middles, axis=0) / 2
    axes.add_patch(Polygon(half * [(-1, -1), (1, -1), (1, 1), (-1, 1)], fill=False, edgecolor="#c0392b", lw=1, zorder=2))
    axes.add_patch(Polygon(domain(out), facecolor=UPDATED, alpha=0.7, zorder=1))
    axes.set_title("Fig. 5 (a): corners (37)", fontsize=9)
    expected = half * np.sqrt(np.linalg.det(gradient(out)) * 0.25 / np.prod(half))
    ours = np.ptp(domain(out), axis=0) / 2
    print(f"\nFigure 5 (a): half lengths {ours}, from the corners of CPDI2 by (36) and (37) {expected}")


def figures_4_and_5(runs):
    figure, (three,) = panels(1, 3, 10, 3.6, sharex=True, sharey=True)
    turned = runs("domains", method="gimp", update="diagonal", **MODES["pure rotation"][0])
    sheared = runs("domains", method="gimp", update="stretch", **MODES["simple shear"][0])
    unsuitable_updates(three[0], turned, "Fig. 4 (a): rotation by 60°, $F_{ii}$ (33)")
    unsuitable_updates(three[1], sheared, "Fig. 4 (b): simple shear 1, $U_{ii}$ (34)")
    update_by_corners(runs, three[2])
    for axes in three:
        axes.set(aspect="equal", xlim=(-1.05, 1.05), ylim=(-0.85, 0.85), xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
    save_svg(figure, HERE / "domains.svg")


def draw(runs):
    table_2(runs)
    figures_4_and_5(runs)
