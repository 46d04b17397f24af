"""Simple shear, section 7.2: Figures 9 and 10."""

from pathlib import Path

import numpy as np
from matplotlib.collections import PolyCollection

from figures import mesh_of_step
from pages.drawing import SUPPORT, UPDATES, WHITE, dimension, draw_set_up, panels, save_svg
from pages.runs import heading, row, summary

HERE = Path(__file__).resolve().parents[1]
YOUNG, POISSON, RADIUS = 10e3, 0.3, 5e3
MODULUS = YOUNG / (2 * (1 + POISSON))


def elastic_stress(gamma):
    """Cauchy stress (xx, xy) of Hencky elasticity in simple shear."""
    stretch = 2 * np.arcsinh(gamma / 2)
    slope = np.divide(stretch, np.sinh(stretch), out=np.ones_like(stretch), where=stretch > 0)
    return MODULUS * slope * gamma**2 / 2, MODULUS * slope * gamma


def plastic_stress(gamma):
    """Cauchy stress (xx, xy) of von Mises perfect plasticity in simple shear, the exact solution of the rate equations."""
    xx, xy = elastic_stress(gamma)
    e = RADIUS / (np.sqrt(8) * MODULUS)  # half the largest elastic logarithmic strain of b at yield
    onset = 2 * np.sinh(e)
    flow = gamma > onset
    turn = (gamma[flow] - onset) / (2 * np.sinh(2 * e)) + np.arctanh(np.exp(-e))
    angle = 2 * np.arctan(np.exp(-2 * e) / np.tanh(turn))
    xx[flow], xy[flow] = RADIUS / np.sqrt(2) * np.cos(angle), RADIUS / np.sqrt(2) * np.sin(angle)
    return xx, xy


def outer_layer(places, n):
    """The points of the outer layer of a square of n x n points, from their places at the start."""
    lines = np.round(places * n - 0.5).astype(int)
    return (lines == 0).any(axis=1) | (lines == n - 1).any(axis=1)


def set_up(runs):
    """Figure 9."""
    h, n = 0.125, 2
    out = runs("shear", method="mpm", n=n, every=1)
    outer = outer_layer(np.asarray(mesh_of_step(out, "points", 0).points)[:, :2], 8 * n)
    figure, pair = panels(2, 1, 7, 5.2, sharex=True, sharey=True)
    for (axes,), step, title in zip(pair, (0, 10), ("$\\Delta l$ = 0", "$\\Delta l$ = 2 m, step 10")):
        places = draw_set_up(axes, out, (3.5, 1), h, 4, step)
        cells = np.unique(np.floor(places[outer] / h).astype(int), axis=0)
        corners = h * (cells[:, None] + [(0, 0), (1, 0), (1, 1), (0, 1)])
        axes.add_collection(PolyCollection(corners, facecolors=SUPPORT, alpha=0.15, zorder=1))
        axes.plot(*np.unique(corners.reshape(-1, 2), axis=0).T, "s", color=SUPPORT, ms=3, mfc="white", mew=0.7, zorder=2)
        axes.plot(*places[outer].T, "o", color="black", ms=4, mew=0, zorder=3)
        axes.set_title(title, fontsize=9)
        axes.set(xlim=(-0.1, 3.45), ylim=(-0.25, 1.25))
        axes.tick_params(labelsize=7)
    above = pair[0, 0]
    above.annotate("nodes and cells with prescribed motion", (1.0, 0.75), xytext=(1.3, 0.75), color=SUPPORT, fontsize=9,
                   va="center", arrowprops={"arrowstyle": "-", "color": SUPPORT, "lw": 0.8}, bbox=WHITE)
    above.annotate("outer layer of points", (0.97, 0.28), xytext=(1.3, 0.28), fontsize=9, va="center",
                   arrowprops={"arrowstyle": "-", "lw": 0.8}, bbox=WHITE)
    dimension(above, (0, -0.12), (1, -0.12), "$l_0$ = 1 m")
    dimension(pair[1, 0], (0, 1.12), (2, 1.12), "$\\Delta l$ = 2 m")
    save_svg(figure, HERE / "shear-set-up.svg")


def uniform_stress(runs):
    """Figure 10."""
    fine = np.linspace(0, 6, 601)
    figure, (pair,) = panels(1, 2, 9, 3.8)
    heading("case", "steps", "largest difference from the closed form / E", "largest spread over the points / E")
    cases = [(pair[0], "(a) elastic", 1e12, elastic_stress), (pair[1], "(b) elasto-plastic", RADIUS, plastic_stress)]
    for axes, title, yield_stress, exact in cases:
        for steps, h in ((30, 0.125), (300, 1), (3000, 1)):  # one cell: every node is prescribed
            every = steps // 30
            out = runs("shear", method="mpm", **{"yield": yield_stress}, steps=steps, h=h, every=every)
            gamma = np.linspace(0, 6, 31)
            stress, spread = [], 0.0
            for step in range(0, steps + 1, every):
                values = np.asarray(mesh_of_step(out, "points", step).point_data["cauchy_stress"])
                stress.append(values.mean(axis=0)[[0, 3]])
                spread = max(spread, np.ptp(values, axis=0).max())
            stress = np.array(stress).T
            difference = np.abs(stress - np.array(exact(gamma.copy()))).max()
            row(title, steps, f"{difference / YOUNG:.1e}", f"{spread / YOUNG:.1e}")
            if steps == 30:
                for name, colour, values, curve in zip(("xx", "xy"), ("C3", "C0"), stress, exact(fine.copy())):
                    axes.plot(fine, curve / YOUNG, color="0.6", lw=2.5, zorder=1)
                    axes.plot(gamma, values / YOUNG, "o", ms=3.5, color=colour, label=f"$\\sigma_{{{name}}}$ / E", zorder=2)
        axes.set(xlabel="$\\Delta l$ / $l_0$", title=title)
        axes.grid(alpha=0.3)
        axes.legend()
    save_svg(figure, HERE / "shear.svg")


def spread_by_update(runs):
    heading("method and update", "outcome", "largest spread of stress over the points in any step / E")
    for update in ["mpm", *UPDATES]:
        method = "mpm" if update == "mpm" else "gimp"
        out = runs("shear", method=method, update=update, every=1)
        result = summary(out)
        spread = 0.0
        for step in range(1, result["steps"] + 1):
            values = np.asarray(mesh_of_step(out, "points", step).point_data["cauchy_stress"])
            spread = max(spread, np.ptp(values, axis=0).max())
        row(update, result["outcome"], f"{spread / YOUNG:.1e}")


def draw(runs):
    set_up(runs)
    uniform_stress(runs)
    spread_by_update(runs)
