"""Elastic annulus under torsion, section 7.4: Figures 18 and 19."""

from pathlib import Path

import numpy as np
import yaml
from matplotlib.collections import PolyCollection

from figures import mesh_of_step, save
from pages.drawing import BLUE_TO_YELLOW, MARKERS, colour_bar, corners_of_cells, discs, panels, save_svg
from pages.runs import ROOT, heading, row, summary

HERE = Path(__file__).resolve().parents[1]
SEGMENTS, COUNTS = (18, 36, 72, 144, 288), (1, 4, 8, 16, 144)
NAMES = {name: getattr(np, name) for name in ("sqrt", "cos", "sin")} | {"asinh": np.arcsinh, "atan2": np.arctan2}


def size_of_cells(segments):
    return 2 * np.pi * 1.25 / segments


def exact(original, alpha=0.1, inner=0.75, outer=1.25):
    """Displacement of the manufactured solution, eq. (44), at original positions."""
    x, y = original.T
    radius = np.hypot(x, y)
    angle = alpha * 16 * ((radius - inner) * (radius - outer)) ** 2 / (inner - outer) ** 4
    return np.stack([np.cos(angle) * x - np.sin(angle) * y - x, np.sin(angle) * x + np.cos(angle) * y - y], axis=1)


def places_and_displacements(out, step=-1):
    """Current places (x, y) of the points and their displacements (x, y)."""
    mesh = mesh_of_step(out, "points", step)
    return np.asarray(mesh.points)[:, :2], np.asarray(mesh.point_data["displacement"])[:, :2]


def error(out):
    """Mean distance of the points from where they should be, weighted with their original volume."""
    mesh = mesh_of_step(out, "points", -1)
    places, u = places_and_displacements(out)
    off = np.linalg.norm(u - exact(places - u), axis=1)
    return float(np.average(off, weights=mesh.point_data["volume"] / mesh.point_data["J"]))


def body_force(original, factor=1.0):
    """Force per volume (x, y) and its polar components, by the formulas of the deck, at original positions."""
    deck = yaml.safe_load((ROOT / "inputs/annulus.yaml").read_text())
    (load,) = deck["loads"]
    known = NAMES | {key: float(value) for key, value in deck["parameters"].items()}
    known |= {"X": original[:, 0], "Y": original[:, 1], "factor": factor}
    evaluate = lambda formula: eval(formula.replace("^", "**"), {"__builtins__": {}}, known)
    for name, formula in load["where"].items():  # in this deck every name stands before its use
        known[name] = evaluate(formula)
    return np.stack([evaluate(formula) for formula in load["force"]], axis=1), known["br"], known["bp"]


def unbalanced_moment(out, step, factor=1.0):
    """Moment of body force and reactions about the centre at the end of a step, relative to that of the body force.

    The internal forces have none, so that it vanishes if the program applied the body force evaluated here, that of the
    step times `factor`.
    """
    places, u = places_and_displacements(out, step)
    start = mesh_of_step(out, "points", step - 1)
    parameters = summary(out)["parameters"]
    force, _, _ = body_force(places - u, factor * step / float(parameters["steps"]))
    force *= np.asarray(start.point_data["volume"])[:, None]
    grid = mesh_of_step(out, "grid", step)
    reaction, nodes = np.asarray(grid.point_data["reaction"]), np.asarray(grid.points)
    moment = lambda at, of: np.sum(at[:, 0] * of[:, 1] - at[:, 1] * of[:, 0])
    return (moment(places, force) + moment(nodes, reaction)) / np.abs(moment(places, force))


def manufactured_solution(runs):
    """Figure 18."""
    out = runs("annulus", segments=144, n=16, every=1)
    places, u = places_and_displacements(out)
    force, radial, turning = body_force(places - u)
    print(f"\nlargest displacement {np.linalg.norm(u, axis=1).max():.4f} m, exact {np.linalg.norm(exact(places - u), axis=1).max():.4f} m;"
          f" body force: x {force[:, 0].min():.3f} to {force[:, 0].max():.3f}, y {force[:, 1].min():.3f} to {force[:, 1].max():.3f},"
          f" radial {radial.min():.3f} to {radial.max():.3f}, turning {turning.min():.3f} to {turning.max():.3f} N/m3")
    moments = [abs(unbalanced_moment(out, step)) for step in range(1, 11)]
    print(f"unbalanced moment of body force and reactions, largest of the ten steps: {max(moments):.1e}")
    figure, (row_of_axes,) = panels(1, 3, 11.5, 4.3)
    fields = [
        (np.linalg.norm(u, axis=1), (0, 0.1), "displacement [m]"),
        (force[:, 0], (-8, 8), "body force, x [N/m³]"),
        (force[:, 1], (-8, 8), "body force, y [N/m³]"),
    ]
    for axes, (values, limits, label) in zip(row_of_axes, fields):
        discs(axes, places, values, 0.02, BLUE_TO_YELLOW, limits)
        axes.set(aspect="equal", xlim=(-1.3, 1.3), ylim=(-1.3, 1.3))
        axes.tick_params(labelsize=7)
        colour_bar(figure, axes, limits, label, BLUE_TO_YELLOW, location="bottom", shrink=0.8, aspect=30)
    arrows = np.stack([np.cos(a := np.arange(24) * np.pi / 12), np.sin(a)], axis=1)  # material points at the middle radius
    row_of_axes[0].quiver(*arrows.T, *exact(arrows).T, angles="xy", scale_units="xy", scale=0.5, width=0.006, zorder=4)
    save(figure, HERE / "annulus-solution.png")


def convergence(runs):
    """Figure 19, the errors."""
    sizes = size_of_cells(np.array(SEGMENTS))
    figure, ((axes,),) = panels(1, 1, 5.5, 4.2)
    heading("points per triangle", *(f"{h:.4f}" for h in sizes), "slope")
    for number, n in enumerate(COUNTS):
        errors = []
        for s in SEGMENTS:
            out = runs("annulus", segments=s, n=n, every=10)
            if summary(out)["outcome"] != "completed":
                print(s, n, summary(out)["reason"])
            errors.append(error(out) if summary(out)["outcome"] == "completed" else np.nan)
        errors = np.array(errors)
        done = np.isfinite(errors)
        slope = np.polyfit(np.log(sizes[done]), np.log(errors[done]), 1)[0]
        row(n, *(f"{e:.4e}" for e in errors), f"{slope:.2f}")
        axes.loglog(1 / sizes[done], errors[done], marker=MARKERS[number], ms=4, lw=1, label=f"{n}")
    line = np.array([3.0, 40.0])
    axes.loglog(line, 0.1 * line**-2.0, "k--", lw=0.8, label="second order")
    axes.set(xlabel="1 / h  [1/m]", ylabel="mean displacement error  [m]")
    axes.legend(fontsize=7, title="points per triangle", title_fontsize=7)
    axes.grid(alpha=0.3)
    save_svg(figure, HERE / "annulus-error.svg")


def points_on_three_grids(runs):
    """Figure 19, the meshes."""
    figure, (row_of_axes,) = panels(1, 3, 12, 4.3)
    for axes, s in zip(row_of_axes, (36, 72, 144)):
        out = runs("annulus", segments=s, n=4, every=10)
        triangles = corners_of_cells(mesh_of_step(out, "grid", -1))
        axes.add_collection(PolyCollection(triangles, facecolors="none", edgecolors="0.45", linewidths=0.3 + 10 / s, zorder=0))
        places, u = places_and_displacements(out)
        discs(axes, places, np.linalg.norm(u, axis=1), 0.2 * size_of_cells(s), BLUE_TO_YELLOW, (0, 0.1))
        axes.set(aspect="equal", xlim=(-1.3, 1.3), ylim=(-1.3, 1.3))
        axes.set_title(f"h = {size_of_cells(s):.4f} m", fontsize=9)
        axes.tick_params(labelsize=7)
    colour_bar(figure, row_of_axes, (0, 0.1), "displacement [m]", BLUE_TO_YELLOW, shrink=0.85, aspect=30)
    save(figure, HERE / "annulus-points.png")


def draw(runs):
    manufactured_solution(runs)
    convergence(runs)
    points_on_three_grids(runs)
