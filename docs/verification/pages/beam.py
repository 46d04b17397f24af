"""Elastic cantilever, section 7.3: Figures 11 to 17, Tables 3, 4 and 5."""

from pathlib import Path

import numpy as np

from figures import COLOURS, mesh_of_step, save
from pages.drawing import (
    SUPPORT, UPDATES, WHITE, colour_bar, dimension, discs, draw_rollers, draw_set_up, draw_stress, encircle, held_nodes, panels,
    save_svg, shade_cells, stress_limits, stress_values,
)
from pages.elastica import elastica
from pages.runs import DOMAIN_VOLUME, heading, row, summary, table, table_of_residuals

HERE = Path(__file__).resolve().parents[1]
SIZES = (0.5, 0.25, 0.125)
COUNTS = (3, 6, 9, 12)
LENGTH, FORCE, STEPS = 10.0, 100e3, 50
TABLE_3 = {
    10: [1.622e1, 1.242e-1, 2.436e-4, 5.524e-5, 1.470e-10],
    20: [1.107e1, 1.699e-2, 1.366e-5, 3.660e-7, 9.912e-15],
    40: [8.740, 1.731e-3, 2.890e-6, 1.131e-10],
    49: [6.774, 1.509e-3, 1.072e-5, 1.089e-9, 3.250e-15],
    50: [6.901, 9.246e-4, 2.112e-6, 5.012e-11],
}
TABLE_4 = {"mpm": (210, 210, 215), "gimp": (214, 218, 227), "cpdi2": (205, 202, 202)}
TIMES_OF_TABLE_4 = {"mpm": (1.11, 5.60, 32.54), "gimp": (1.16, 5.47, 34.23), "cpdi2": (1.08, 5.04, 32.07)}


def set_up(runs):
    """Figure 11."""
    out = runs("beam", h=0.5, n=2, method="mpm", every=1)
    figure, ((axes,),) = panels(1, 1, 7.5, 3.4)
    places = draw_set_up(axes, out, (11, 10), 0.5, 4)
    loaded = places[np.argsort(np.hypot(*(places - [LENGTH, 9.5]).T))[:2]]
    axes.plot(*loaded.T, "o", color="black", ms=5)
    axes.annotate("", (loaded[0, 0], 7.6), (loaded[0, 0], 9), arrowprops={"arrowstyle": "-|>", "lw": 1.5, "color": "black"})
    axes.text(loaded[0, 0] - 0.15, 8, "100 kN", ha="right", va="center", bbox=WHITE)
    pin, held = held_nodes(out, 1), held_nodes(out, 0)
    draw_rollers(axes, held[held[:, 1] != pin[0, 1]], 0, 0.1)
    axes.plot(*pin.T, marker=5, ms=9, color=SUPPORT, ls="none", clip_on=False, zorder=4)
    axes.annotate("pinned node", (0.12, 9.42), xytext=(0.9, 8.2), color=SUPPORT, fontsize=9, bbox=WHITE,
                  arrowprops={"arrowstyle": "-", "color": SUPPORT, "lw": 0.8})
    dimension(axes, (0, 10.35), (LENGTH, 10.35), "$l_0$ = 10 m")
    dimension(axes, (10.7, 9), (10.7, 10), "$d_0$ = 1 m", offset=(0, -32))
    axes.set(xlim=(-0.5, 11.4), ylim=(6.2, 10.7))
    axes.set_axis_off()
    save_svg(figure, HERE / "beam-set-up.svg")


def deformed_points(runs):
    """Figure 12; where a run does not reach full load, its last panel comes from one with 100 steps."""
    floors = {4: 6.2, 8: 4.2, 16: 2.2, 50: 0.7}
    ratios = [10.3 - floor for floor in floors.values()]
    figure, grid = panels(4, 3, 10, 10, height_ratios=ratios, sharex=True)
    for axes_of_step, (step, floor) in zip(grid, floors.items()):
        shown = []
        for h in SIZES:
            out = runs("beam", h=h, n=2, method="mpm", every=1)
            if summary(out)["steps"] >= step:
                shown.append((out, step, f"h = {h} m, step {step}"))
            else:
                shown.append((runs("beam", h=h, n=2, method="mpm", steps=100, every=100), 100, f"h = {h} m, step 100 of 100"))
        limits = stress_limits(np.concatenate([stress_values(out, at, "XX") for out, at, _ in shown]))
        for axes, (out, at, title), h in zip(axes_of_step, shown, SIZES):
            draw_stress(axes, out, at, h, "XX", limits, title, diameter=(0.42 if h > 0.2 else 0.5) * h)
            axes.set(xlim=(0, 10.2), ylim=(floor, 10.3))
        limits = (limits[0] / 1e6, limits[1] / 1e6)
        colour_bar(figure, axes_of_step, limits, "horizontal stress [MPa]", aspect=6 * ratios[list(floors).index(step)] / 2)
    save(figure, HERE / "beam-points.png")


def force_displacement(axes, out, label, colour):
    """Load over the displacement of the loaded points; returns the last point of both curves."""
    history = table(out, "history")
    force = np.concatenate([[0], history["time"]])
    ends = []
    for column in ("tip_ux", "tip_uy"):
        displacement = np.concatenate([[0], -history[column] / LENGTH])
        axes.plot(displacement, force, lw=1.1, color=colour, label=label if column == "tip_ux" else None)
        ends.append((displacement[-1], force[-1]))
    return ends


def add_elastica(axes):
    force = np.linspace(0.05, 1, 20)
    x, y = -elastica(force * FORCE) / LENGTH
    axes.plot(x, force, "ko", ms=3, label="elastica", zorder=3)
    axes.plot(y, force, "ko", ms=3, mfc="white", zorder=3)


def force_panels(runs, path, rows, groups):
    """Panels of load against displacement, and their table; a run that stops is marked at its last step."""
    figure, grid = panels(rows, 2, 9.5, 3.7 * rows, sharex=True, sharey=True)
    for axes, (title, cases) in zip(grid.flat, groups):
        for number, (label, parameters) in enumerate(cases):
            out = runs("beam", **parameters, every=0)
            result, history = summary(out), table(out, "history")
            outcome = result["outcome"] if result["outcome"] == "completed" else result["reason"]
            row(title + ": " + label, outcome, result["evaluations"], f"{history['tip_ux'][-1]:.5f}",
                f"{history['tip_uy'][-1]:.5f}", result["indefinite_solves"])
            ends = force_displacement(axes, out, label, f"C{number}")
            if result["outcome"] != "completed":
                axes.plot(*np.transpose(ends), "o", ms=6, color="0.6", mec="black", mew=0.6, zorder=4)
        add_elastica(axes)
        axes.set(title=title)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="upper left")
    for axes in grid[-1]:
        axes.set(xlabel="displacement / $l_0$ (left curves: horizontal, right: vertical)")
    for axes in grid[:, 0]:
        axes.set(ylabel="load / 100 kN")
    save_svg(figure, path)


def force_of_standard_points(runs):
    """Figure 13. With h = 0.125 m and 9 x 9 points, 50 steps do not reach full load; 100 do."""
    groups = [
        (f"({mark}) h = {h} m", [(f"{n} x {n} points", dict(h=h, n=n, method="mpm")) for n in COUNTS])
        for mark, h in zip("abc", SIZES)
    ]
    groups[2][1][2] = ("9 x 9 points, 100 steps", dict(h=0.125, n=9, method="mpm", steps=100))
    groups.append(("(d) 6 x 6 points", [(f"h = {h} m", dict(h=h, n=6, method="mpm")) for h in SIZES]))
    force_panels(runs, HERE / "beam-force.svg", 2, groups)


def force_of_gimp(runs):
    """Figure 15."""
    by_size = [(f"h = {h} m", dict(h=h, n=6, method="gimp", update="corners")) for h in SIZES]
    by_update = [(label, dict(h=0.5, n=6, method="gimp", update=update)) for update, label in UPDATES.items()]
    by_update.append((
        "$F_{ii}$ (33), volumes from domains", dict(**DOMAIN_VOLUME, h=0.5, n=6, method="gimp", update="diagonal"),
    ))
    groups = [("(a) 6 x 6 points, corners (37)", by_size), ("(b) 6 x 6 points, h = 0.5 m", by_update)]
    force_panels(runs, HERE / "beam-gimp.svg", 1, groups)


def roughness(out):
    """Share of the horizontal stress that a smooth field cannot explain, and the largest value of that field, Pa.

    The field is a polynomial of the original position, of degree 4 along and 3 across the beam, fitted to the points
    between 0.5 and 4 m from the root; the share is the root mean square of the rest over that of the field.
    """
    mesh = mesh_of_step(out, "points", -1)
    x, y = (np.asarray(mesh.points) - np.asarray(mesh.point_data["displacement"])).T[:2]
    near = (x > 0.5) & (x < 4)
    x, y, stress = (x[near] - 2.25) / 1.75, (y[near] - 9.5) / 0.5, stress_values(out, -1, "XX")[near]
    terms = np.stack([x**i * y**j for i in range(5) for j in range(4)], axis=1)
    field = terms @ np.linalg.lstsq(terms, stress, rcond=None)[0]
    return np.sqrt(np.mean((stress - field) ** 2) / np.mean(field**2)), np.abs(field).max()


def points_in_nearly_empty_cells(out, h, count):
    """The points near the root that stand out most from the mean stress of their neighbours, in cells filled by less
    than a tenth."""
    mesh = mesh_of_step(out, "points", -1)
    places, stress = np.asarray(mesh.points)[:, :2], stress_values(out, -1, "XX")
    cells, cell = np.unique(np.floor(places / h).astype(int), axis=0, return_inverse=True)
    filling = np.bincount(cell.ravel(), weights=mesh.point_data["volume"], minlength=len(cells)) / h**2
    candidates = np.flatnonzero((filling[cell.ravel()] < 0.1) & (places[:, 0] < 4) & (places[:, 1] > 6.4))
    distance = np.linalg.norm(places[candidates, None] - places[None], axis=2)
    excess = [np.abs(stress[p] - stress[d < 0.75 * h].mean()) for p, d in zip(candidates, distance)]
    chosen = []
    for p in candidates[np.argsort(excess)[::-1]]:
        if all(np.linalg.norm(places[p] - places[q]) > h for q in chosen):
            chosen.append(p)
    return places[chosen[:count]]


def stress_at_the_root(runs):
    """Figure 14."""
    h, limits = 0.25, (-2e6, 2e6)
    figure, grid = panels(2, 2, 9.2, 8.2)
    heading("points", "outcome", "rough part of the horizontal stress", "largest of the smooth part (MPa)")
    for axes, n in zip(grid.flat, COUNTS):
        out = runs("beam", h=h, n=n, method="mpm", every=STEPS)
        share, largest = roughness(out)
        row(f"{n} x {n}", summary(out)["outcome"], f"{100 * share:.1f} %", f"{largest / 1e6:.2f}")
        draw_stress(axes, out, -1, h, "XX", limits, f"{n} x {n} points", diameter=(0.85 if n < 9 else 1.15) * h / n, hard=n >= 9)
        axes.set(xlim=(0, 4.2), ylim=(6.1, 10.2))
        if n == 6:
            for place in points_in_nearly_empty_cells(out, h, 2):
                encircle(axes, place, 0.14)
        whole = axes.inset_axes((0.02, 0.02, 0.3, 0.56))
        shade_cells(whole, out, -1, h, width=0.1)
        places = np.asarray(mesh_of_step(out, "points", -1).points)[:, :2]
        discs(whole, places, stress_values(out, -1, "XX"), 1.2 * h / n, COLOURS, limits, hard=True)
        whole.plot([0, 4.2, 4.2, 0, 0], [6.1, 6.1, 10.2, 10.2, 6.1], color="0.3", lw=0.6)
        whole.set(aspect="equal", xlim=(-0.1, 4.9), ylim=(0.8, 10.3), xticks=[], yticks=[])
    colour_bar(figure, grid, (limits[0] / 1e6, limits[1] / 1e6), "horizontal stress [MPa]", shrink=0.6, aspect=30)
    save(figure, HERE / "beam-root.png")
    out = runs("beam", h=h, n=6, method="cpdi2", update="corners", every=STEPS)
    row("CPDI2, 6 x 6", summary(out)["outcome"], f"{100 * roughness(out)[0]:.1f} %", f"{roughness(out)[1] / 1e6:.2f}")


def domains_at_the_end(runs):
    """Figure 16."""
    figure, grid = panels(1, 4, 14, 4.6)
    outs = [runs("beam", h=h, n=6, method="gimp", update="corners", every=STEPS) for h in SIZES]
    limits = stress_limits(np.concatenate([stress_values(out, -1, "YY", "domains") for out in outs]))
    for axes, out, h in zip(grid[0], outs, SIZES):
        draw_stress(axes, out, -1, h, "YY", limits, f"h = {h} m")
        axes.set(xlim=(0, 6), ylim=(0.5, 10.3))
    end = grid[0, 3]
    draw_stress(end, outs[-1], -1, SIZES[-1], "YY", limits, "h = 0.125 m, loaded end", lines=0.15)
    tip = summary(outs[-1])["bodies"]["beam"]["extent"]["domain"]
    end.set(xlim=(tip["max"][0] - 1.5, tip["max"][0] + 0.2), ylim=(tip["min"][1] - 0.2, tip["min"][1] + 1.9))
    mesh = mesh_of_step(outs[-1], "points", -1)
    places = np.asarray(mesh.points)[:, :2]
    original = places - np.asarray(mesh.point_data["displacement"])[:, :2]
    loaded = np.argsort(np.hypot(*(original - [LENGTH, 9.5]).T))[:2]
    encircle(end, places[loaded].mean(axis=0) + [0, 0.06], 0.22, "A")
    colour_bar(figure, grid, (limits[0] / 1e6, limits[1] / 1e6), "vertical stress [MPa]", shrink=0.85, aspect=30)
    save(figure, HERE / "beam-domains.png")


def force_of_cpdi2(runs):
    """Figure 17, with 6 x 6 points beside it, and the difference from GIMP."""
    figure, (pair,) = panels(1, 2, 9.5, 3.9, sharey=True)
    heading("final displacement", "GIMP (37) u_x", "u_y", "CPDI2 u_x", "u_y", "difference x", "difference y")
    for axes, n in zip(pair, (3, 6)):
        for number, h in enumerate(SIZES):
            tips, completed = [], []
            for method in ("gimp", "cpdi2"):
                out = runs("beam", h=h, n=n, method=method, update="corners", every=0)
                history = table(out, "history")
                tips.append((history["tip_ux"][-1], history["tip_uy"][-1]))
                completed.append(len(history["step"]) == STEPS)
            force_displacement(axes, out, f"h = {h} m", f"C{number}")
            cells = [f"{u:.5f}" if done else "stops" for tip, done in zip(tips, completed) for u in tip]
            row(f"{n} x {n}, h = {h}", *cells, *(f"{b - a:+.5f}" for a, b in zip(*tips) if all(completed)))
        add_elastica(axes)
        axes.set(title=f"CPDI2, {n} x {n} points", xlabel="displacement / $l_0$ (left curves: horizontal, right: vertical)")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="upper left")
    pair[0].set(ylabel="load / 100 kN")
    save_svg(figure, HERE / "beam-cpdi2.svg")


def counts_and_times(runs):
    """Tables 4 and 5; times are CPU times of one machine."""
    case = lambda method, h, **more: summary(runs("beam", h=h, n=6, method=method, update="corners", every=0, **more))
    heading("Table 4", "evaluations at 1e-9", "at 1e-6", "paper", "CPU time / that of standard points at h = 0.5 m", "paper")
    unit = case("mpm", 0.5)["cpu_seconds"]["total"]
    for method, counts in TABLE_4.items():
        for h, count, time in zip(SIZES, counts, TIMES_OF_TABLE_4[method]):
            strict, loose = case(method, h), case(method, h, tolerance="1e-6")
            row(f"{method}, h = {h} m", strict["evaluations"], loose["evaluations"], count,
                f"{strict['cpu_seconds']['total'] / unit:.2f}", f"{time / TIMES_OF_TABLE_4['mpm'][0]:.2f}")
    result = case("mpm", 0.5)
    print(f"\nTable 5: {result['points']} points x {result['evaluations']} evaluations"
          f" = {result['points'] * result['evaluations']}, {result['steps']} steps, {result['cells']} cells")
    heading("phase", "share of the CPU time")
    total = result["cpu_seconds"]["total"]
    for phase, seconds in result["cpu_seconds"].items():
        row(phase, f"{100 * seconds / total:.1f} %")


def draw(runs):
    x, y = elastica([FORCE])
    print(f"\nElastica at full load: {x[0]:.5f}, {y[0]:.5f} m")
    set_up(runs)
    deformed_points(runs)
    heading("beam", "outcome", "evaluations", "tip u_x (m)", "tip u_y (m)", "indefinite solves")
    force_of_standard_points(runs)
    force_of_gimp(runs)
    stress_at_the_root(runs)
    domains_at_the_end(runs)
    force_of_cpdi2(runs)
    table_of_residuals(runs("beam", h=0.125, n=6, method="gimp", update="corners", every=0), TABLE_3)
    counts_and_times(runs)
