"""Compaction under self weight, section 7.1: Figures 6, 7 and 8."""

from pathlib import Path

import numpy as np
from matplotlib.collections import PolyCollection

from figures import COLOURS, mesh_of_step, quads, values_of
from pages.drawing import MARKERS, UPDATES, colour_bar, grid_lines, panels, save_svg
from pages.runs import DOMAIN_VOLUME, heading, row, summary

HERE = Path(__file__).resolve().parents[1]
CELLS = [2**k for k in range(1, 9)]
HEIGHT, WEIGHT = 50.0, 80 * 10.0  # m; N per original m3
SOFT, SOFT_CELL = 10e3, 1.5625  # Figure 8: Young's modulus, Pa, and size of the cells, m


def original_height(mesh):
    return np.asarray(mesh.points)[:, 1] - values_of(mesh.point_data, "displacement", "Y")


def error(out):
    """Eq. (42), from the points as they stand in the files; compressive stress is negative."""
    mesh = mesh_of_step(out, "points", -1)
    volume = mesh.point_data["volume"] / mesh.point_data["J"]
    exact = -WEIGHT * (HEIGHT - original_height(mesh))
    wrong = np.abs(values_of(mesh.point_data, "cauchy_stress", "YY") - exact)
    return float(np.sum(wrong * volume) / (WEIGHT * HEIGHT * np.sum(volume)))


def error_of_completed(out):
    return error(out) if summary(out)["outcome"] == "completed" else np.nan


def exact_profile(young):
    """Height (m) and vertical stress (Pa) of the compressed column, at equal differences of the logarithmic strain e.

    With no lateral strain and stress, σ = E e exp(-e) = -ρ g (H - Z), so that dz = exp(e) dZ = (E/ρ g)(1 - e) de.
    """
    lowest = 0.0
    for _ in range(50):  # Newton's method for E e exp(-e) = -ρ g H
        f = young * lowest * np.exp(-lowest) + WEIGHT * HEIGHT
        lowest -= f / (young * (1 - lowest) * np.exp(-lowest))
    e = np.linspace(lowest, 0, 400)
    place = young / WEIGHT * (e - e**2 / 2)
    return place - place[0], young * e * np.exp(-e)


def standard_points(runs):
    """Figure 6."""
    figure, ((left, right),) = panels(1, 2, 9.5, 3.9, sharey=True)
    heading("points per cell", *CELLS)
    by_cells = {}
    for number, n in enumerate([1, 2, 4, 8, 16, 64, 256]):
        errors = [error(runs("compaction", h=50 / c, n=n, nx=1, method="mpm", every=20)) for c in CELLS]
        row(n, *(f"{e:.2e}" for e in errors))
        left.loglog([c / 50 for c in CELLS], errors, marker=MARKERS[number], ms=4, lw=1, label=f"{n}")
        for c, e in zip(CELLS, errors):
            by_cells.setdefault(c, []).append((c * n / 50, e))
    for c, line in by_cells.items():
        right.loglog(*np.array(line).T, "o-", ms=4, lw=1, label=f"{50 / c:.5g} m")
    left.set(xlabel="1 / h  [1/m]", ylabel="error, eq. (42)", title="(a) standard points per cell in the vertical")
    right.set(xlabel="points per metre", title="(b) size of the cells")
    for axes in (left, right):
        axes.legend(fontsize=7, ncols=2)
        axes.grid(alpha=0.3)
    save_svg(figure, HERE / "compaction-mpm.svg")


def domain_updates(runs):
    """Figure 7."""
    figure, ((axes,),) = panels(1, 1, 6, 4.2)
    heading("update", *CELLS)
    cases = [(label, {}, "gimp", update) for update, label in UPDATES.items()]
    cases += [("CPDI2", {}, "cpdi2", "corners"), ("no update, volumes from domains", DOMAIN_VOLUME, "gimp", "none")]
    for number, (label, volume, method, update) in enumerate(cases):
        errors = [
            error_of_completed(runs("compaction", h=50 / c, n=2, method=method, update=update, every=20, **volume))
            for c in CELLS
        ]
        row(label, *(f"{e:.2e}" for e in errors))
        style = {"ls": "--", "color": "C0", "mfc": "white"} if volume else {}
        axes.loglog([c / 50 for c in CELLS], errors, marker=(MARKERS + "o")[number], ms=4, lw=1, label=label, **style)
    slope = np.array([0.2, 4.0])
    axes.loglog(slope, 1e-3 * slope**-2.0, "k--", lw=0.8, label="second order")
    axes.set(xlabel="1 / h  [1/m]", ylabel="error, eq. (42)")
    axes.legend(fontsize=7)
    axes.grid(alpha=0.3)
    save_svg(figure, HERE / "compaction-gimp.svg")


def soft_column(runs, update, **volume):
    return runs("compaction", h=SOFT_CELL, n=2, method="gimp", update=update, young=SOFT, every=20, **volume)


def table_of_soft_columns(runs):
    height, stress = exact_profile(SOFT)
    heading("update", "top of the soft column (m)", "lowest domain edge (m)", "error (42)", "stress of the lowest points (kPa)")
    row("exact", f"{height[-1]:.3f}", "0", "0", ", ".join(f"{-WEIGHT / 1e3 * (HEIGHT - SOFT_CELL * (k + 0.5) / 2):.1f}" for k in range(4)))
    cases = [(update, {}, update) for update in UPDATES]
    for label, volume, update in [*cases, ("no update, volumes from domains", DOMAIN_VOLUME, "none")]:
        out = soft_column(runs, update, **volume)
        extent = summary(out)["bodies"]["column"]["extent"]["domain"]
        mesh = mesh_of_step(out, "points", -1)
        lowest = values_of(mesh.point_data, "cauchy_stress", "YY")[np.argsort(original_height(mesh))[:8:2]]
        row(label, f"{extent['max'][1]:.3f}", f"{round(extent['min'][1], 4) + 0.0:.4f}", f"{error(out):.2e}",
            ", ".join(f"{s / 1e3:.1f}" for s in lowest))


def draw_base(axes, out, top, limits):
    """The domains near the base of a column over the grid, and the lower limit of the problem."""
    mesh = mesh_of_step(out, "domains", -1)
    corners, values = quads(mesh), values_of(mesh.cell_data, "cauchy_stress", "YY") / 1e3
    near = corners[:, :, 1].min(axis=1) < top
    drawn = PolyCollection(corners[near], array=values[near], cmap=COLOURS, edgecolors="black", linewidths=0.5, alpha=0.8, zorder=1)
    drawn.set_clim(*limits)
    axes.add_collection(drawn)
    grid_lines(axes, (SOFT_CELL, 3 * SOFT_CELL), SOFT_CELL, color="0.4", lw=0.6, zorder=2)
    axes.axhline(0, color="0.35", ls="--", lw=1.2, zorder=3)
    axes.set(aspect="equal", xlim=(-0.15, SOFT_CELL + 0.15), ylim=(-0.45, top), xticks=[])
    axes.tick_params(labelsize=7)


def soft_columns(runs):
    """Figure 8: stress over height under three updates, and the domains that they leave."""
    table_of_soft_columns(runs)
    cases = [
        ("no update,\nvolumes from domains", "none", DOMAIN_VOLUME, "C2"),
        ("no update", "none", {}, "C0"),
        ("det F (32)", "determinant", {}, "C1"),
        ("corners (37)", "corners", {}, "C3"),
    ]
    figure, ((plot, base, *insets),) = panels(1, 6, 12.5, 4.5, width_ratios=[3, 2.3, 1.6, 1.6, 1.6, 1.6])
    height, stress = exact_profile(SOFT)
    top, limits = 4.0, (-46, -12)
    for axes in (plot, base):
        axes.plot(stress / 1e3, height, color="0.75", lw=4, label="exact", zorder=0)
        for (label, update, volume, colour), marker in zip(cases, "dos^"):
            mesh = mesh_of_step(soft_column(runs, update, **volume), "points", -1)
            places, values = np.asarray(mesh.points)[:, 1], values_of(mesh.point_data, "cauchy_stress", "YY") / 1e3
            order = np.argsort(places)[::2]  # two equal points side by side
            axes.plot(values[order], places[order], marker=marker, color=colour, ms=3.2, lw=0.8, mfc="white", label=label)
        axes.axhline(0, color="0.35", ls="--", lw=1.2, zorder=0)
        axes.grid(alpha=0.3)
        axes.set(xlabel="vertical stress [kPa]")
    plot.set(ylabel="height [m]", xlim=(-50, 2), ylim=(-1, 30), title="the column")
    plot.legend(fontsize=8, loc="upper left")
    base.set(xlim=(-50, -10), ylim=(-0.45, top), title="its base")
    for axes, (label, update, volume, _) in zip(insets, cases):
        draw_base(axes, soft_column(runs, update, **volume), top, limits)
        axes.set_title(label, fontsize=9)
    colour_bar(figure, insets, limits, "vertical stress [kPa]", shrink=0.9, aspect=40)
    save_svg(figure, HERE / "compaction-soft.svg")


def draw(runs):
    standard_points(runs)
    domain_updates(runs)
    soft_columns(runs)
