"""Elasto-plastic collapse, section 7.5: Figures 20, 21 and 22, Tables 6, 7 and 8."""

from pathlib import Path

import numpy as np

from figures import mesh_of_step, quads, save
from pages.drawing import (
    UPDATES, WHITE, colour_bar, dimension, draw_rollers, draw_set_up, draw_stress, encircle, held_nodes, panels, save_svg,
)
from pages.runs import DOMAIN_VOLUME, heading, row, summary, table_of_residuals

HERE = Path(__file__).resolve().parents[1]
LIMITS = (-80e3, 20e3)
TABLE_6 = {
    3: ([13.343, 13.662, 13.731, 13.787], [6.357, 6.245, 6.245, 6.234]),
    6: ([13.359, 13.735, 13.797, 13.847], [6.437, 6.277, 6.251, 6.231]),
    9: ([13.380, 13.750, 13.812, 13.863], [6.452, 6.289, 6.255, 6.226]),
}
TABLE_7 = {
    "determinant": (13.645, 6.316), "diagonal": (14.415, 5.546), "stretch": (13.425, 6.441),
    "corners": (13.769, 6.392), "diagonal-corrected": (13.769, 6.257), "diagonal-incremental": (13.769, 6.257),
    "cpdi2": (13.780, 6.292),
}
TABLE_8 = {
    10: [2.656, 2.697e-4, 1.626e-9, 6.057e-15],
    20: [2.794, 3.088e-2, 2.410e-2, 2.568e-3, 3.910e-5, 6.949e-10],
    30: [2.701, 2.380e-2, 4.626e-2, 6.193e-3, 2.225e-4, 1.356e-7, 6.713e-14],
    40: [2.410, 1.759e-2, 3.049e-2, 5.156e-3, 1.497e-4, 1.944e-7, 3.159e-13],
}


def set_up(runs):
    """Figure 20."""
    out = runs("collapse", h=1, n=2, method="mpm", steps=40, every=1)
    figure, ((axes,),) = panels(1, 1, 7.2, 4.2)
    draw_set_up(axes, out, (16, 8), 1, 5)
    for axis in (0, 1):
        draw_rollers(axes, held_nodes(out, axis), axis, 0.17)
    dimension(axes, (0, 8.5), (8, 8.5), "$l_0$ = 8 m")
    dimension(axes, (8.5, 0), (8.5, 8), "$l_0$ = 8 m", offset=(30, 0))
    axes.annotate("", (13, 3), (13, 5), arrowprops={"arrowstyle": "-|>", "lw": 1.5, "color": "black"})
    axes.text(13.3, 4, "10 kN/m³", va="center", bbox=WHITE)
    axes.set(xlim=(-0.7, 16.3), ylim=(-0.7, 9))
    axes.set_axis_off()
    save_svg(figure, HERE / "collapse-set-up.svg")


def extent_and_height(out):
    high = summary(out)["bodies"]["block"]["extent"]["domain"]["max"]
    return high[0], high[1]


def bar(figure, axes):
    limits = (LIMITS[0] / 1e3, LIMITS[1] / 1e3)
    colour_bar(figure, axes, limits, "vertical stress [kPa]", shrink=0.5, aspect=30)


def standard_points(runs):
    """Figure 21 and Table 6."""
    figure, grid = panels(4, 3, 10, 7.8)
    heading("points", "h (m)", "extent, paper", "ours", "difference", "height, paper", "ours", "difference", "evaluations")
    for i, h in enumerate((2, 1, 0.5, 0.25)):
        for j, n in enumerate((3, 6, 9)):
            out = runs("collapse", h=h, n=n, method="mpm", every=40)
            x, y = extent_and_height(out)
            px, py = TABLE_6[n][0][i], TABLE_6[n][1][i]
            row(f"{n} x {n}", h, px, f"{x:.4f}", f"{x - px:+.4f}", py, f"{y:.4f}", f"{y - py:+.4f}", summary(out)["evaluations"])
            size = h / n
            draw_stress(grid[i, j], out, 40, h, "YY", LIMITS, f"h = {h} m, {n} x {n} points",
                        diameter=(0.95 if size > 0.3 else 1.2) * size, hard=size < 0.1)
            grid[i, j].set(xlim=(0, 16), ylim=(0, 8))
    bar(figure, grid)
    save(figure, HERE / "collapse-points.png")


def vanishing_domains(out, step):
    """Middle and radius of the region of the domains that have less than half of their volume J V_p0."""
    mesh, start = mesh_of_step(out, "domains", step), mesh_of_step(out, "domains", 0)
    corners, original = quads(mesh), quads(start)
    size, size_at_start = (np.prod(np.ptp(c, axis=1), axis=1) for c in (corners, original))
    small = size < 0.5 * size_at_start * np.asarray(mesh.cell_data["J"])
    print(np.count_nonzero(small), "of", len(small), "domains have less than half of their volume")
    places = corners.mean(axis=1)[small]
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    return middle, 1.1 * np.linalg.norm(places - middle, axis=1).max()


def domain_updates(runs):
    """Figure 22 and Table 7."""
    cases = [(UPDATES.get(u, "CPDI2"), {}, u, *values) for u, values in TABLE_7.items()]
    for update in ("diagonal", "stretch"):
        cases.append((UPDATES[update] + ", volumes from domains", DOMAIN_VOLUME, update, *TABLE_7[update]))
    figure, grid = panels(3, 2, 11, 9.3)
    other, rest = panels(1, 3, 14, 2.9)
    heading("update", "extent, paper", "ours", "difference", "height, paper", "ours", "difference", "evaluations")
    for axes, (title, volume, update, px, py) in zip([*grid.flat, *rest.flat], cases):
        method, update_of_deck = ("cpdi2", "corners") if update == "cpdi2" else ("gimp", update)
        every = 1 if volume else 40
        out = runs("collapse", h=1, n=6, method=method, update=update_of_deck, every=every, **volume)
        step = summary(out)["steps"]  # (33) with volumes from domains ends one step early
        if step < 40:
            print(title, "stops:", summary(out)["reason"])
        x, y = extent_and_height(out)
        row(title, px, f"{x:.4f}", f"{x - px:+.4f}", py, f"{y:.4f}", f"{y - py:+.4f}", summary(out)["evaluations"])
        note = "" if step == 40 else f", step {step}"
        draw_stress(axes, out, step, 1, "YY", LIMITS, title + note, lines=0.08)
        if update == "diagonal":
            encircle(axes, *vanishing_domains(out, step))
        axes.set(xlim=(0, 16), ylim=(-0.4, 8))
    for drawing, all_axes, name in ((figure, grid, "collapse-domains"), (other, rest, "collapse-cpdi2")):
        bar(drawing, all_axes)
        save(drawing, HERE / f"{name}.png")


def draw(runs):
    set_up(runs)
    standard_points(runs)
    domain_updates(runs)
    table_of_residuals(runs("collapse", h=1, n=6, method="gimp", update="diagonal-corrected", every=40), TABLE_8)
