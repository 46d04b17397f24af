"""How often the error bars of `mpm converge` cover values that are known in closed form, and how wide they are.

    python3 benches/error_bars.py [CASE ...] [--mpm target/release/mpm] [--csv FILE] [--keep FOLDER]

Runs a convergence study of each case on one thread and prints a line: the value and its bar, the order and the trend that
the study states, the exact value, the error, whether the bar covers it, whether the bar is narrower than 10 % of the value,
and the CPU time of all runs. The totals follow. `--csv` writes the same with the values on all grids; `--keep` keeps the
decks and results. Without names, all cases run, which takes about two minutes. A name may be the start of
several.

Loads are so small that the shape of the bodies does not change, unless the closed form is one of finite strain. Probes are
the points nearest to a place; they approach it as the cells shrink. Forces of bodies of revolution are those of the circle.
Sides of boxes lie on grid lines, and so do the ends of conditions. The finest grid has 16 cells across what matters, such as
a wall, a radius, a half width or a height, and 8 for soils with 20 degrees or more and in space; `--scale 2` halves these.
"""

import argparse
import csv
import json
import math
import pathlib
import shutil
import subprocess
import tempfile
from dataclasses import dataclass, field

ROOT = pathlib.Path(__file__).resolve().parent.parent
NARROW = 0.1


@dataclass
class Case:
    title: str
    deck: str
    quantity: str
    exact: float
    source: str
    settings: dict = field(default_factory=dict)


CASES = {}


def add(name, title, deck, quantity, exact, source, **settings):
    assert name not in CASES, name
    CASES[name] = Case(title, deck, quantity, exact, source, settings)


# Decks


def deck(size, law, conditions, h, shape="", loads="", surfaces="", probe="", steps="count: 1", idealisation="plane-strain",
         origin=None, parameters="", body="", refine="", materials="", bodies="", predictor="none", room=0):
    """A deck with a body of `law` that fills the grid, up to `room` below its top, unless `shape` is given; lists are
    text with an entry a line."""
    origin = origin or [0] * len(size)
    top = [a + b for a, b in zip(origin, size)]
    size = [*size[:-1], size[-1] + room]
    shape = shape or f"{{type: box, min: {origin}, max: {top}}}"

    def section(name, entries):
        lines = [line.strip() for line in entries.strip().splitlines()]
        return f"{name}:\n" + "".join(f"  - {{{line}}}\n" for line in lines) if lines else ""

    probes = f", probes: [{{name: tip, body: body, {probe}}}]" if probe else ""
    return (
        f"version: 1\nparameters: {{h: {h}, n: 2, method: mpm, strain: standard{parameters and ', '}{parameters}}}\n"
        f"analysis: {{idealisation: {idealisation}}}\n"
        f"grid: {{type: structured, origin: {origin}, size: {size}, spacing: \"${{h}}\"{refine}}}\n"
        f"materials:\n  main: {{{law}}}\n{materials}"
        f"bodies:\n  - {{name: body, material: main, method: \"${{method}}\", strain: \"${{strain}}\","
        f" points_per_cell: \"${{n}}\", shape: {shape}{body}}}\n{bodies}"
        + section("surfaces", surfaces) + section("boundary_conditions", conditions) + section("loads", loads)
        + f"steps: {{{steps}}}\nsolver: {{predictor: {predictor}}}\noutput: {{every: 0{probes}}}\n"
    )


ELASTIC = 'model: hencky, young: "${young}", poisson: "${nu}", density: 1'
CHANNEL = """name: base, nodes: {y: 0}, fix: [x, y]
name: left, nodes: {x: 0}, fix: [SIDE]
name: right, nodes: {x: 0.25}, fix: [SIDE]"""


def elastic(young, nu, more=""):
    return f"young: {young!r}, nu: {nu!r}{more and ', '}{more}"


# Elastic constants and small tools


def lame(young, nu):
    """Lamé's constants λ and μ."""
    return young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))


def oedometric(young, nu):
    return lame(young, nu)[0] + 2 * lame(young, nu)[1]


def solve(matrix, right):
    """The solution of a few linear equations."""
    rows = [list(row) + [value] for row, value in zip(matrix, right)]
    n = len(rows)
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(n):
            if i != k:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k])]
    return [rows[k][n] / rows[k][k] for k in range(n)]


def integral(function, a, b, parts=2000):
    """Simpson's rule."""
    width = (b - a) / parts
    inner = sum((4 if k % 2 else 2) * function(a + k * width) for k in range(1, parts))
    return (function(a) + inner + function(b)) * width / 3


# A column of height 1 under its weight, between smooth walls, or in shear under a horizontal weight; E = 1e6.


def columns():
    walls = CHANNEL.replace("SIDE", "x")
    top = "nearest: [0.125, 1], count: 2"

    def text(conditions, gravity, nu):
        load = f"name: weight, type: gravity, acceleration: {gravity}"
        return deck([0.25, 1], ELASTIC, conditions, 0.0625, loads=load, probe=top, parameters=elastic(1e6, nu))

    add("column-mpm", "column under its weight", text(walls, [0, -1], 0.3), "tip_uy", -0.5 / oedometric(1e6, 0.3), "γH²/2M",
        method="mpm")
    add("column-wall", "force of a column on its wall, at rest", text(walls, [0, -1], 0.3), "right_rx", -0.5 * 0.3 / 0.7,
        "K₀γH²/2", method="mpm")
    add("shear-cpdi2", "column sheared by a horizontal weight", text(CHANNEL.replace("SIDE", "y"), [1, 0], 0.2), "tip_ux",
        0.5 / lame(1e6, 0.2)[1], "γH²/2G", method="cpdi2")

    # At finite strain: Kirchhoff stress M ln λ, and the weight above is -M ln λ/λ.
    def shortening(modulus, weight):
        def stretch(y):
            low, high = 0.5, 1.0
            for _ in range(80):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if -modulus * math.log(middle) / middle > weight * (1 - y) else (low, middle)
            return 0.5 * (low + high)
        return integral(lambda y: stretch(y) - 1, 0, 1)

    for method, young in (("mpm", 20.0), ("gimp", 10.0), ("cpdi2", 5.0)):
        text_soft = deck([0.25, 1], ELASTIC, walls, 0.0625, loads="name: weight, type: gravity, acceleration: [0, -1]",
                         probe=top, steps="count: 4", parameters=elastic(young, 0.0))
        add(f"soft-{method}", f"soft column under its weight, γH/E = {1 / young:g}", text_soft, "tip_uy",
            shortening(young, 1.0), "stress M ln λ at finite strain", method=method)

    for n, young in ((3, 50.0), (4, 10.0)):
        text_soft = deck([0.25, 1], ELASTIC, walls, 0.0625, loads="name: weight, type: gravity, acceleration: [0, -1]",
                         probe=top, steps="count: 4", parameters=elastic(young, 0.0))
        add(f"soft-mpm-{n}", f"soft column with {n} x {n} points in a cell, γH/E = {1 / young:g}", text_soft, "tip_uy",
            shortening(young, 1.0), "stress M ln λ at finite strain", method="mpm", n=n)

    # A column of neo-Hookean material that hangs: μ (λ - 1/λ) + Λ ln λ/λ is the weight below.
    def lengthening(young, nu):
        first, mu = lame(young, nu)

        def stretch(weight):
            low, high = 1.0, 3.0
            for _ in range(80):
                middle = 0.5 * (low + high)
                stress = mu * (middle - 1 / middle) + first * math.log(middle) / middle
                low, high = (middle, high) if stress < weight else (low, middle)
            return 0.5 * (low + high)
        return integral(lambda y: stretch(1 - y) - 1, 0, 1)

    rubber = ELASTIC.replace("hencky", "neo-hookean")
    for method, young, nu in (("cpdi1", 3.0, 0.3), ("gimp", 5.0, 0.2)):
        text_hung = deck([0.25, 1], rubber, walls, 0.0625, loads="name: weight, type: gravity, acceleration: [0, 1]",
                         probe=top, steps="count: 4", parameters=elastic(young, nu), room=1)
        add(f"hung-{method}", f"neo-Hookean column that hangs, γH/E = {1 / young:.2g}", text_hung, "tip_uy",
            lengthening(young, nu), "stress at finite strain", method=method)

    # Exact on every grid: a stretched block, and one that is crushed; both of height and width 1 and free at one side. In a
    # second step, the held nodes would no longer lie at the end of the block.
    sides = "name: base, nodes: {y: 0}, fix: [y]\nname: left, nodes: {x: 0}, fix: [x]\n"
    text = deck([1, 1], ELASTIC, sides + "name: top, nodes: {y: 1}, uy: 1e-3", 0.0625, parameters=elastic(1e6, 0.0),
                room=0.25)
    add("patch-stretch", "stretched block", text, "top_ry", 1e6 * math.log(1.001) / 1.001, "E ln λ/λ", method="mpm")
    text = deck([1, 1], "model: tresca, young: 1e6, poisson: 0.3, cohesion: 1",
                sides + "name: top, nodes: {y: 1}, uy: -1e-5", 0.0625, room=0.25)
    add("patch-crush", "crushed block of Tresca's material", text, "top_ry", -2 / (1 - 1e-5), "2 c/λ", method="cpdi2",
        strain="mean-dilatation")


# A rod along x between smooth walls.


def rods():
    walls = "name: end, nodes: {x: 0}, fix: [x]\nname: base, nodes: {y: 0}, fix: [y]\nname: top, nodes: {y: 0.25}, fix: [y]"
    tip = "nearest: [1, 0.125], count: 2"
    force = 'name: pull, type: body-force, force: ["sin(pi*X/2)", 0]'
    text = deck([1, 0.25], ELASTIC, walls, 0.0625, loads=force, probe=tip, parameters=elastic(1e6, 0.3))
    add("rod-gimp", "rod under a body force sin πx/2", text, "tip_ux", 4 / math.pi**2 / oedometric(1e6, 0.3),
        "double integration", method="gimp")
    graded = 'model: hencky, young: "1e6*(1 + 2*X)", poisson: 0'
    end = "name: end, body: body, part: {edge: 1}"
    pull = "name: pull, type: traction, surface: end, traction: [1, 0]"
    text = deck([1, 0.25], graded, walls, 0.0625, loads=pull, surfaces=end, probe=tip)
    add("graded-rod-cpdi1", "rod whose modulus grows along its length", text, "tip_ux", 0.5e-6 * math.log(3),
        "integral of 1/E", method="cpdi1")


# A thick cylinder of inner radius 1 and outer radius 2, in plane strain.


def cylinder_displacement(young, nu, inner, outer, r, a=1.0, b=2.0):
    """Lamé's radial displacement under pressures at the inside and the outside."""
    first = (inner * a**2 - outer * b**2) / (b**2 - a**2)
    second = (inner - outer) * a**2 * b**2 / (b**2 - a**2)
    return (1 + nu) / young * ((1 - 2 * nu) * first * r + second / r)


# The box is larger than the ring: the sides of a box that touches it would count as parts of its surface there.
QUARTER = ("{type: intersection, of: [{type: annulus, center: [0, 0], inner: 1, outer: 2}, "
           "{type: box, min: [0, 0], max: [3, 3]}]}")
SYMMETRY = "name: axis, nodes: {x: 0}, fix: [x]\nname: base, nodes: {y: 0}, fix: [y]"
INSIDE = "name: inside, body: body, part: {box: {min: [0, 0], max: [1.0001, 1.0001]}}"
OUTSIDE = "name: outside, body: body, part: {half_space: {point: [1.0001, 1.0001], normal: [1, 1]}}"


def cylinders():
    ends = 'name: ends, nodes: {box: {min: [1, 0], max: [2, 0.25]}}, fix: [y]'

    def revolution(law, where, pressure, r, parameters, steps="count: 1", predictor="none"):
        surface = f"name: side, body: body, part: {{edge: {where}}}"
        load = f"name: push, type: pressure, surface: side, pressure: {pressure!r}, follows: false"
        return deck([1, 0.25], law, ends, 0.0625, loads=load, surfaces=surface, probe=f"nearest: [{r}, 0.125], count: 2",
                    idealisation="axisymmetric", origin=[1, 0], parameters=parameters, steps=steps, predictor=predictor)

    for method, nu, inner, outer, r in (("mpm", 0.3, 1, 0, 1), ("cpdi1", 0.0, 0, 1, 1), ("mpm", 0.45, 0, 1, 2)):
        text = revolution(ELASTIC, 3 if inner else 1, 1.0, r, elastic(1e6, nu))
        side = "inner" if inner else "outer"
        add(f"cylinder-{side}-{method}", f"thick cylinder under {side} pressure, ν = {nu}, displacement at r = {r}", text,
            "tip_ux", cylinder_displacement(1e6, nu, inner, outer, r), "Lamé", method=method)
    for method, nu, strain in (("gimp", 0.3, "standard"), ("mpm", 0.499, "mean-dilatation")):
        driven = ends + "\nname: inside, nodes: {x: 1}, ux: 1e-6"
        text = deck([1, 0.25], ELASTIC, driven, 0.0625, idealisation="axisymmetric", origin=[1, 0],
                    parameters=elastic(1e6, nu))
        force = 2 * math.pi * 0.25 * 1e-6 / cylinder_displacement(1e6, nu, 1, 0, 1)
        add(f"cylinder-driven-{method}-{nu}", f"thick cylinder widened at the inside, ν = {nu}, force", text, "inside_rx",
            force, "Lamé", method=method, strain=strain)
    for method, nu, load, place in (("cpdi2", 0.3, "inside", 1), ("cpdi2", 0.45, "inside", 2), ("cpdi1", 0.3, "outside", 1)):
        surface = INSIDE if load == "inside" else OUTSIDE
        push = f"name: push, type: pressure, surface: {load}, pressure: 1, follows: false"
        text = deck([2, 2], ELASTIC, SYMMETRY, 0.0625, shape=QUARTER, loads=push, surfaces=surface,
                    probe=f"nearest: [{place}, 0], count: 1", parameters=elastic(1e6, nu))
        add(f"ring-{load}-{method}-{place}",
            f"quarter of a thick cylinder under pressure at the {load}, ν = {nu}, r = {place}", text,
            "tip_ux", cylinder_displacement(1e6, nu, load == "inside", load == "outside", place), "Lamé", method=method)
    # Two layers that stick together: continuity of displacement and radial stress at r = 1.5.
    soft, stiff, nu = 1e6, 4e6, 0.3
    for inner_young, outer_young, method in ((soft, stiff, "mpm"),):
        # The pressure p between the layers makes their displacements equal.
        def gap(p):
            outer = cylinder_displacement(outer_young, nu, p, 0, 1.5, 1.5, 2)
            return cylinder_displacement(inner_young, nu, 1, p, 1.5, 1, 1.5) - outer
        p = gap(0) / (gap(0) - gap(1))
        other = f"  other: {{model: hencky, young: {outer_young!r}, poisson: {nu}}}\n"
        second = ('  - {name: outer, material: other, method: "${method}", points_per_cell: "${n}", '
                  "shape: {type: box, min: [1.5, 0], max: [2, 0.25]}}\n")
        text = deck([1, 0.25], ELASTIC, ends, 0.0625, shape="{type: box, min: [1, 0], max: [1.5, 0.25]}", origin=[1, 0],
                    loads="name: push, type: pressure, surface: side, pressure: 1, follows: false",
                    surfaces="name: side, body: body, part: {edge: 3}", probe="nearest: [1, 0.125], count: 2",
                    idealisation="axisymmetric", parameters=elastic(inner_young, nu), materials=other, bodies=second)
        add(f"layers-{method}", "cylinder of two layers under inner pressure", text, "tip_ux",
            cylinder_displacement(inner_young, nu, 1, p, 1, 1, 1.5), "Lamé, continuity", method=method)

    # Spinning: the body force is r. u = C r + D/r - r³/8M, with the radial stress zero at the free sides.
    def spinning(young, nu, a, b, r):
        first, mu = lame(young, nu)
        stiff = first + 2 * mu
        load = lambda s: (3 * stiff + first) * s**2 / (8 * stiff)  # noqa: E731
        if a == 0:
            c, d = load(b) / (stiff + first), 0.0
        else:
            c, d = solve([[stiff + first, -2 * mu / a**2], [stiff + first, -2 * mu / b**2]], [load(a), load(b)])
        return c * r + d / r - r**3 / (8 * stiff)

    for method, nu, inner, place in (("mpm", 0.3, 0, 1), ("gimp", 0.3, 1, 1), ("mpm", 0.49, 0, 1)):
        corner, outer = (0, 1) if inner == 0 else (1, 2)
        conditions = f"name: ends, nodes: {{box: {{min: [{corner}, 0], max: [{outer}, 0.25]}}}}, fix: [y]"
        conditions += "\nname: axis, nodes: {x: 0}, fix: [x]" if inner == 0 else ""
        text = deck([1, 0.25], ELASTIC, conditions, 0.0625, loads='name: spin, type: body-force, force: ["X", 0]',
                    origin=[corner, 0],
                    probe=f"nearest: [{place}, 0.125], count: 2", idealisation="axisymmetric", parameters=elastic(1e6, nu))
        kind = "shaft" if inner == 0 else "tube"
        strain = "mean-dilatation" if nu == 0.49 else "standard"
        add(f"spinning-{kind}-{method}-{nu}", f"spinning {kind} in plane strain, ν = {nu}", text, "tip_ux",
            spinning(1e6, nu, inner, outer, place), "Timoshenko and Goodier", method=method, strain=strain)


# A thick sphere of inner radius 1 and outer radius 2.


def spheres():
    def exact(young, nu, inner, outer, r):
        first, second = (inner - 8 * outer) / 7, (inner - outer) * 8 / 7
        return ((1 - 2 * nu) * first * r + (1 + nu) / 2 * second / r**2) / young

    for method, nu, load, place in (("cpdi2", 0.3, "inside", 1), ("cpdi2", 0.2, "outside", 1), ("cpdi1", 0.3, "inside", 2)):
        surface = INSIDE if load == "inside" else OUTSIDE
        text = deck([2, 2], ELASTIC, SYMMETRY, 0.0625, shape=QUARTER, idealisation="axisymmetric",
                    parameters=elastic(1e6, nu),
                    loads=f"name: push, type: pressure, surface: {load}, pressure: 1, follows: false", surfaces=surface,
                    probe=f"nearest: [0, {place}], count: 1")
        add(f"sphere-{load}-{method}", f"thick sphere under pressure at the {load}, ν = {nu}, pole at r = {place}", text,
            "tip_uy", exact(1e6, nu, load == "inside", load == "outside", place), "Lamé", method=method)
    shape = ("{type: intersection, of: [{type: difference, from: {type: sphere, center: [0, 0, 0], radius: 2}, "
             "minus: [{type: sphere, center: [0, 0, 0], radius: 1}]}, {type: box, min: [0, 0, 0], max: [3, 3, 3]}]}")
    conditions = "name: x, nodes: {x: 0}, fix: [x]\nname: y, nodes: {y: 0}, fix: [y]\nname: z, nodes: {z: 0}, fix: [z]"
    text = deck([2, 2, 2], ELASTIC, conditions, 0.125, shape=shape, idealisation="solid", parameters=elastic(1e6, 0.3),
                loads="name: push, type: pressure, surface: inside, pressure: 1, follows: false",
                surfaces="name: inside, body: body, part: {box: {min: [0, 0, 0], max: [1.0001, 1.0001, 1.0001]}}",
                probe="nearest: [0, 0, 1], count: 1")
    add("sphere-space-cpdi2", "eighth of a thick sphere in space", text, "tip_uz", exact(1e6, 0.3, 1, 0, 1), "Lamé",
        method="cpdi2")


# A cantilever of length 4 and depth 1 with exact tractions at its end and exact displacements at its root.


def beams():
    young, length = 1e6, 4.0
    for method, nu, quantity in (("gimp", 0.3, "tip_uy"), ("cpdi2", 0.45, "tip_uy"), ("mpm", 0.45, "strain_energy")):
        e, v, inertia, p = young / (1 - nu**2), nu / (1 - nu), 1 / 12, 1.0
        conditions = (f'name: root, nodes: {{x: 0}}, ux: "p*(Y - 0.5)/(6*e*{inertia!r})*(2 + v)*((Y - 0.5)^2 - 0.25)", '
                      f'uy: "-p/(6*e*{inertia!r})*3*v*(Y - 0.5)^2*{length}"')
        shear = 'name: shear, type: traction, surface: end, traction: [0, "-6*p*(0.25 - (Y - 0.5)^2)"]'
        text = deck([4, 1], ELASTIC, conditions, 0.0625, loads=shear, surfaces="name: end, body: body, part: {edge: 1}",
                    probe="nearest: [4, 0.5], count: 2", parameters=elastic(young, nu, f"e: {e!r}, v: {v!r}, p: {p!r}"))
        across = lambda x, y: -p / (6 * e * inertia) * (  # noqa: E731
            3 * v * y**2 * (length - x) + (4 + 5 * v) * x / 4 + (3 * length - x) * x**2)
        along = lambda y: p * y / (6 * e * inertia) * (2 + v) * (y**2 - 0.25)  # noqa: E731
        tau = lambda y: -p / (2 * inertia) * (0.25 - y**2)  # noqa: E731
        if quantity == "tip_uy":
            exact = across(length, 0)
        else:
            exact = 0.5 * integral(lambda y: tau(y) * (across(length, y) - across(0,
                                                                                  y)) - p * length * y / inertia * along(y),
                                   -0.5, 0.5)
        add(f"beam-{method}-{quantity.split('_')[1]}-{nu}", f"cantilever of depth 1 and length 4, ν = {nu}, {quantity}",
            text, quantity, exact, "Timoshenko and Goodier (1951), exact end conditions", method=method)

    # A block of length and depth 1 whose end turns: the bending moment, elastic and at its limit.
    ends = ("name: pin, nodes: {x: 0, y: 0}, fix: [y]\nname: root, nodes: {x: 0}, fix: [x]\n"
            'name: bend, nodes: {x: 1}, ux: "-turn*(Y - 0.5)"')
    text = deck([1, 1], ELASTIC, ends, 0.0625, parameters=elastic(1e6, 0.45, "turn: 1e-6"))
    add("bending-cpdi2", "pure bending, moment", text, "bend_mz", 1e-6 * 1e6 / (1 - 0.45**2) / 12, "E′Iκ", method="cpdi2")
    text = deck([1, 1], "model: tresca, young: 1e6, poisson: 0.3, cohesion: 1", ends, 0.0625, steps="count: 20",
                parameters="turn: 1e-3", predictor="last-step")
    add("hinge-mpm", "plastic moment", text, "bend_mz", 0.5, "kH²/2", method="mpm", strain="mean-dilatation")


# A layer of thickness 1 on a smooth or rough base under a pressure cos πx, between planes of symmetry.


def layers():
    def settlement(young, nu, k, rough):
        """Displacement of the surface under the pressure 1 at its crest, from F(y) cos kx as Airy's function."""
        mu, s, c = lame(young, nu)[1], math.sinh(k), math.cosh(k)
        # cosh, sinh, y cosh and y sinh of ky, with their derivatives at y = 0 and 1.
        at = {0: [(1, 0, k**2, 0), (0, k, 0, k**3), (0, 1, 0, 3 * k**2), (0, 0, 2 * k, 0)],
              1: [(c, k * s, k**2 * c, k**3 * s), (s, k * c, k**2 * s, k**3 * c),
                  (c, c + k * s, 2 * k * s + k**2 * c, 3 * k**2 * c + k**3 * s),
                  (s, s + k * c, 2 * k * c + k**2 * s, 3 * k**2 * s + k**3 * c)]}
        vertical = lambda f: -((2 - nu) * k**2 * f[1] - (1 - nu) * f[3]) / (2 * mu * k**2)  # noqa: E731
        along = lambda f: (1 - nu) * f[2] + nu * k**2 * f[0]  # noqa: E731
        shear = lambda f: f[1]  # noqa: E731
        rows = [[f[0] for f in at[1]], [f[1] for f in at[1]], [vertical(f) * mu for f in at[0]],
                [(along if rough else shear)(f) for f in at[0]]]
        factors = solve(rows, [1 / k**2, 0, 0, 0])
        return sum(factor * vertical(f) for factor, f in zip(factors, at[1]))

    for method, nu, rough in (("mpm", 0.3, False), ("cpdi2", 0.45, False), ("cpdi1", 0.0, True)):
        conditions = ("name: left, nodes: {x: 0}, fix: [x]\nname: right, nodes: {x: 1}, fix: [x]\n"
                      f"name: base, nodes: {{y: 0}}, fix: [{'x, y' if rough else 'y'}]")
        text = deck([1, 1], ELASTIC, conditions, 0.0625, surfaces="name: top, body: body, part: {edge: 2}",
                    loads='name: push, type: traction, surface: top, traction: [0, "-cos(pi*X)"]',
                    probe="nearest: [0, 1], count: 1", parameters=elastic(1e6, nu))
        add(f"layer-{method}", f"layer on a {'rough' if rough else 'smooth'} base under cos πx, ν = {nu}, settlement", text,
            "tip_uy", settlement(1e6, nu, math.pi, rough), "Airy's function", method=method)
    # The same in circles: J₀(kr) with J₁(k) = 0 in place of cos kx.
    k = 3.8317059702075125
    terms = " + ".join(f"{(-1) ** m * (k / 2) ** (2 * m) / math.factorial(m) ** 2!r}*X^{2 * m}" for m in range(1, 14))
    text = deck([1, 1], ELASTIC, SYMMETRY + "\nname: side, nodes: {x: 1}, fix: [x]", 0.0625,
                surfaces="name: top, body: body, part: {edge: 2}",
                loads=f'name: push, type: traction, surface: top, traction: [0, "-(1 + {terms})"]',
                probe="nearest: [0, 1], count: 1", idealisation="axisymmetric", parameters=elastic(1e6, 0.3))
    add("layer-circle-cpdi2", "layer on a smooth base under J₀, settlement", text, "tip_uy", settlement(1e6, 0.3, k, False),
        "Hankel transform", method="cpdi2")


# Plates with a hole or a crack, with exact conditions on their outer boundary.


def plates():
    shape = ("{type: difference, from: {type: box, min: [0, 0], max: [3, 3]}, "
             "minus: [{type: circle, center: [0, 0], radius: 1}]}")
    # Kirsch: unit tension along x.
    where = ("where: {a: 'atan2(Y, X)', c2: cos(2*a), c4: cos(4*a), s2: sin(2*a), s4: sin(4*a), q: 1/(X^2 + Y^2), "
             "xx: 1 - q*(1.5*c2 + c4) + 1.5*q^2*c4, yy: -q*(0.5*c2 - c4) - 1.5*q^2*c4, xy: -q*(0.5*s2 + s4) + 1.5*q^2*s4}")
    loads = (f'name: pull, type: traction, surface: right, {where}, traction: ["xx", "xy"]\n'
             f'name: lift, type: traction, surface: top, {where}, traction: ["xy", "yy"]')
    surfaces = ("name: right, body: body, part: {half_space: {point: [2.9999, 0], normal: [1, 0]}}\n"
                "name: top, body: body, part: {half_space: {point: [0, 2.9999], normal: [0, 1]}}")
    for method, nu, along in (("cpdi1", 0.3, True), ("cpdi2", 0.0, False)):
        text = deck([3, 3], ELASTIC, SYMMETRY, 0.0625, shape=shape, loads=loads, surfaces=surfaces,
                    probe=f"nearest: {[1, 0] if along else [0, 1]}, count: 1", parameters=elastic(1e6, nu))
        exact = (3 if along else -1) * 4 * (1 - nu) / (8 * lame(1e6, nu)[1])
        add(f"hole-{method}-{'x' if along else 'y'}",
            f"plate with a hole in tension, ν = {nu}, rim at {'0' if along else '90'}°", text,
            "tip_ux" if along else "tip_uy", exact, "Kirsch (1898)", method=method)

    # The upper half of a square with a crack along x < 0: unit stress intensity in mode I.
    young, nu = 1e6, 0.3
    mu, kappa = lame(young, nu)[1], 3 - 4 * nu
    factor = 1 / (2 * mu * math.sqrt(2 * math.pi))
    where = ("where: {r: sqrt(X^2 + Y^2), a: 'atan2(Y, X)/2', "
             f"u: {factor!r}*sqrt(r)*cos(a)*({kappa - 1!r} + 2*sin(a)^2), "
             f"v: {factor!r}*sqrt(r)*sin(a)*({kappa + 1!r} - 2*cos(a)^2)}}")
    conditions = "name: line, nodes: {box: {min: [0, 0], max: [1, 0]}}, fix: [y]\n" + "\n".join(
        f'name: {name}, nodes: {{{place}}}, {where}, ux: "u", uy: "v"' for name,
        place in (("left", "x: -1"), ("right", "x: 1"), ("top", "y: 1")))

    def power(x, y, nx, ny):
        r, a = math.hypot(x, y), math.atan2(y, x) / 2
        u = factor * math.sqrt(r) * math.cos(a) * (kappa - 1 + 2 * math.sin(a) ** 2)
        v = factor * math.sqrt(r) * math.sin(a) * (kappa + 1 - 2 * math.cos(a) ** 2)
        s = math.cos(a) / math.sqrt(2 * math.pi * r)
        xx, yy = s * (1 - math.sin(a) * math.sin(3 * a)), s * (1 + math.sin(a) * math.sin(3 * a))
        xy = s * math.sin(a) * math.cos(3 * a)
        return 0.5 * ((xx * nx + xy * ny) * u + (xy * nx + yy * ny) * v)

    energy = (integral(lambda y: power(1, y, 1, 0) + power(-1, y, -1, 0), 1e-12, 1) + integral(lambda x: power(x, 1, 0, 1),
                                                                                               -1, 1))
    for method in ("mpm", "gimp"):
        text = deck([2, 1], ELASTIC, conditions, 0.0625, origin=[-1, 0], probe="nearest: [-0.5, 0], count: 2",
                    parameters=elastic(young, nu))
        if method == "mpm":
            add("crack-energy-mpm", "crack in mode I, energy", text, "strain_energy", energy, "Williams (1957)",
                method=method)
        else:
            add(f"crack-opening-{method}", "crack in mode I, opening", text, "tip_uy", factor * math.sqrt(0.5) * (kappa + 1),
                "Williams (1957)", method=method)

    # An L-shaped body whose sides meet at 270 degrees, loaded symmetrically about the bisector of the corner.
    power_of, q = 0.5444837367824622, 0.5430755788367373

    def field(x, y):
        """Displacements and stresses at a position."""
        r, turned = math.hypot(x, y), math.atan2(y, x) % (2 * math.pi) - 0.75 * math.pi
        m, s = power_of, r**power_of / (2 * mu)
        u = s * ((kappa - q * (m + 1)) * math.cos(m * turned) - m * math.cos((m - 2) * turned))
        v = s * ((kappa + q * (m + 1)) * math.sin(m * turned) + m * math.sin((m - 2) * turned))
        t = m * r ** (m - 1)
        xx = t * ((2 - q * (m + 1)) * math.cos((m - 1) * turned) - (m - 1) * math.cos((m - 3) * turned))
        yy = t * ((2 + q * (m + 1)) * math.cos((m - 1) * turned) + (m - 1) * math.cos((m - 3) * turned))
        xy = t * ((m - 1) * math.sin((m - 3) * turned) + q * (m + 1) * math.sin((m - 1) * turned))
        c, d = math.cos(0.75 * math.pi), math.sin(0.75 * math.pi)
        stress = (c * c * xx - 2 * c * d * xy + d * d * yy, d * d * xx + 2 * c * d * xy + c * c * yy,
                  c * d * (xx - yy) + (c * c - d * d) * xy)
        return (c * u - d * v, d * u + c * v), stress

    def work(x, y, nx, ny):
        (u, v), (xx, yy, xy) = field(x, y)
        return 0.5 * ((xx * nx + xy * ny) * u + (xy * nx + yy * ny) * v)

    corner_energy = (integral(lambda y: work(1, y, 1, 0), 1e-12, 1) + integral(lambda x: work(x, 1, 0, 1), -1, 1)
                     + integral(lambda y: work(-1, y, -1, 0), -1, 1) + integral(lambda x: work(x, -1, 0, -1), -1, -1e-12))
    free = [field(0.5, 1e-12)[1][k] for k in (1, 2)] + [field(-1e-12, -0.5)[1][k] for k in (0, 2)]
    assert max(map(abs, free)) < 1e-6, free
    m, s = power_of, 1 / (2 * mu)
    where = ("where: {a: 'atan2(Y, X)', b: 'if(a < -pi/4, a + 2*pi, a) - 0.75*pi', "
             f"s: {s!r}*(X^2 + Y^2)^{m / 2!r}, u: 's*({kappa - q * (m + 1)!r}*cos({m!r}*b) - {m!r}*cos({m - 2!r}*b))', "
             f"v: 's*({kappa + q * (m + 1)!r}*sin({m!r}*b) + {m!r}*sin({m - 2!r}*b))'}}")
    root = repr(math.sqrt(0.5))
    places = (("left", "x: -1"), ("right", "box: {min: [1, 0], max: [1, 1]}"), ("top", "y: 1"),
              ("bottom", "box: {min: [-1, -1], max: [0, -1]}"))
    conditions = "\n".join(f'name: {name}, nodes: {{{place}}}, {where}, ux: "-{root}*(u + v)", uy: "{root}*(u - v)"'
                           for name, place in places)
    shape = "{type: polygon, vertices: [[-1, -1], [0, -1], [0, 0], [1, 0], [1, 1], [-1, 1]]}"
    for method, quantity, exact in (("mpm", "strain_energy", corner_energy), ("cpdi2", "tip_uy", field(0.5, 1e-12)[0][1])):
        text = deck([2, 2], ELASTIC, conditions, 0.0625, origin=[-1, -1], shape=shape, probe="nearest: [0.5, 0], count: 2",
                    parameters=elastic(young, nu))
        add(f"corner-{method}", f"re-entrant corner, {quantity}", text, quantity, exact, "Williams (1952)", method=method)

    # A square held on all sides whose body force makes the displacements s and -s with s = 1e-6 sin πx sin πy.
    for method, nu, quantity in (("gimp", 0.45, "tip_ux"),):
        stiff, mu = lame(young, nu)
        sides = "\n".join(f"name: {name}, nodes: {{{place}}}, fix: [x, y]" for name,
                          place in (("a", "x: 0"), ("b", "x: 1"), ("c", "y: 0"), ("d", "y: 1")))
        # -(Λ + μ)(s,xx - s,xy) - μ(s,xx + s,yy), and likewise along y.
        f = 1e-6 * math.pi**2
        own, mixed = f * (stiff + 3 * mu), f * (stiff + mu)
        force = (f'name: force, type: body-force, force: ["{own!r}*sin(pi*X)*sin(pi*Y) + {mixed!r}*cos(pi*X)*cos(pi*Y)", '
                 f'"-{own!r}*sin(pi*X)*sin(pi*Y) - {mixed!r}*cos(pi*X)*cos(pi*Y)"]')
        text = deck([1, 1], ELASTIC, sides, 0.0625, loads=force, probe="nearest: [0.5, 0.5], count: 4",
                    parameters=elastic(young, nu))
        # Half the work of the force: the mixed part is orthogonal to the displacements.
        add(f"square-{method}", f"square under a body force, {quantity}", text, quantity,
            1e-6 if quantity == "tip_ux" else 2 * 0.5 * own * 1e-6 / 4,
            "manufactured", method=method)

    # A disc of radius and thickness 1 that is bent to a cap: u = krz, w = -kr²/2 - kνz²/2(1 - ν)·2.
    for method, nu in (("cpdi2", 0.45),):
        bent = ('name: axis, nodes: {x: 0}, fix: [x]\nname: rim, nodes: {x: 1}, ux: "1e-6*(Y - 0.5)"\n'
                "name: pin, nodes: {x: 1, y: 0}, fix: [y]")
        text = deck([1, 1], ELASTIC, bent, 0.0625, idealisation="axisymmetric", probe="nearest: [0, 0.5], count: 2",
                    parameters=elastic(1e6, nu))
        add(f"disc-{method}", f"bent disc, ν = {nu}, deflection", text, "tip_uy", 1e-6 * (0.5 + nu / (1 - nu) / 4),
            "Timoshenko and Goodier (1951)", method=method)


# Bars in space: torsion of a quarter of a bar of length 0.25 with free warping, and a bar that hangs from its top.


def solids():
    def rectangle(a, b):
        """Torsion constant of a rectangle with sides 2a < 2b."""
        series = sum(math.tanh(n * math.pi * b / (2 * a)) / n**5 for n in range(1, 200, 2))
        return 16 * a**3 * b * (1 / 3 - 64 * a / (math.pi**5 * b) * series)

    young, nu, turn = 1e6, 0.3, 1e-6
    symmetric = "name: x, nodes: {x: 0}, fix: [y, z]\nname: y, nodes: {y: 0}, fix: [x, z]\n"
    symmetric += "name: foot, nodes: {z: 0}, fix: [x, y]\nname: turned, nodes: {z: 0.25}, ux: \"-turn*Y\", uy: \"turn*X\""
    energy = lambda j: 0.5 * lame(young, nu)[1] * j * turn**2 / 0.25 / 4  # noqa: E731
    box = lambda x, y: f"{{type: box, min: [0, 0, 0], max: [{x}, {y}, 0.25]}}"  # noqa: E731
    disc = lambda r: f"{{type: cylinder, start: [0, 0, -1], end: [0, 0, 1], radius: {r}}}"  # noqa: E731
    both = lambda *parts: f"{{type: intersection, of: [{', '.join(parts)}]}}"  # noqa: E731
    for name, title, size, shape, j, methods in (
        ("square", "square bar", (1, 1), box(1, 1), rectangle(1, 1), ("gimp",)),
        ("shaft", "circular shaft", (1, 1), both(disc(1), box(1, 1)), math.pi / 2, ("cpdi2",)),
    ):
        for method in methods:
            text = deck([*size, 0.25], ELASTIC, symmetric, 0.0625, shape=shape, idealisation="solid",
                        parameters=elastic(young, nu, f"turn: {turn!r}"))
            source = "Saint-Venant" if name == "square" else "Coulomb"
            add(f"torsion-{name}-{method}", f"torsion of a {title}, energy", text, "strain_energy", energy(j), source,
                method=method)

    # A bar of revolution that hangs from its upper end, whose shape there is that of free hanging.
    for method, nu in (("cpdi2", 0.45),):
        conditions = f'name: axis, nodes: {{x: 0}}, fix: [x]\nname: top, nodes: {{y: 2}}, uy: "{nu}*X^2/(2*young)"'
        text = deck([1, 2], ELASTIC, conditions, 0.0625, loads="name: weight, type: gravity, acceleration: [0, -1]",
                    idealisation="axisymmetric", probe="nearest: [0, 0], count: 1", parameters=elastic(1e6, nu))
        add(f"hanging-{method}", f"hanging bar of revolution, ν = {nu}, lower end", text, "tip_uy", -(2**2) / 2e6,
            "Timoshenko and Goodier (1951)", method=method)

    # Manufactured, at finite strain: each point of a held cube turns about its axis by θ(r, z), of neo-Hookean material.
    source = (ROOT / "inputs/twist.yaml").read_text()
    angle = lambda s, t: 16 * (t * (1 - t)) ** 2 * (1 - s) ** 3  # noqa: E731
    radial = integral(lambda r: 2 * math.pi * r**3 * (6 * r * (1 - r**2) ** 2) ** 2, 0,
                      1) * integral(lambda z: angle(0, z / 2) ** 2, 0, 2)
    along = integral(lambda r: 2 * math.pi * r**3 * (1 - r**2) ** 6, 0,
                     1) * integral(lambda z: (8 * (2 * (z / 2) - 6 * (z / 2) ** 2 + 4 * (z / 2) ** 3)) ** 2, 0, 2)
    add("twist", "twisted cube at finite strain, energy", source, "strain_energy", 0.25 * 0.5**2 * (radial + along),
        "manufactured", method="gimp", alpha=0.5, steps=4, every=0, h=0.125)


# Plastic cylinders and spheres of inner radius 1 and outer radius 2.


def plastic_cylinders():
    ends = "name: ends, nodes: {box: {min: [1, 0], max: [2, 0.25]}}, fix: [y]"
    ring = 2 * math.pi * 0.25

    # Hill: yield to r = c; k is the shear strength, and 2k that of Tresca in tension.
    def pressure(c, k):
        return k * (1 - c**2 / 4 + 2 * math.log(c))

    young, nu, k = 1e6, 0.3, 1.0
    law = f"model: tresca, young: {young}, poisson: {nu}, cohesion: {k}"
    for method, c in (("mpm", 1.3), ("cpdi2", 1.7)):
        text = deck([1, 0.25], law, ends, 0.0625, idealisation="axisymmetric", origin=[1, 0],
                    surfaces="name: side, body: body, part: {edge: 3}",
                    loads=f"name: push, type: pressure, surface: side, pressure: {pressure(c, k)!r}, follows: false",
                    probe="nearest: [2, 0.125], count: 2", steps="count: 8")
        add(f"hill-{method}", f"partly plastic cylinder, yield to r = {c}, outer displacement", text, "tip_ux",
            (1 - nu**2) * 2 * k * c**2 / (young * 2), "Hill (1950)", method=method, strain="mean-dilatation")
    # The inside moves as in the closed form. Where it yields, d(ru)/dr = r (1 + ν)(1 - 2ν)(σr + σθ)/E, as plastic flow keeps
    # the volume, and the sum of the stresses is 2k (2 ln(r/c) + c²/4).
    c = 1.5
    at_c = cylinder_displacement(young, nu, k * (1 - c**2 / 4), 0, c, c, 2)
    dilatation = lambda r: (1 + nu) * (1 - 2 * nu) / young * 2 * k * (2 * math.log(r / c) + c**2 / 4)  # noqa: E731
    inner = c * at_c - integral(lambda r: r * dilatation(r), 1, c)
    text = deck([1, 0.25], law, ends + f"\nname: inside, nodes: {{x: 1}}, ux: {inner!r}", 0.0625,
                idealisation="axisymmetric", origin=[1, 0], steps="count: 8")
    add("hill-force-gimp", f"partly plastic cylinder, yield to r = {c}, force at the inside", text, "inside_rx",
        ring * pressure(c, k), "Hill (1950)", method="gimp", strain="mean-dilatation")

    # Limit pressures of the driven inside or outside.
    def friction(phi, c):
        n = (1 + math.sin(math.radians(phi))) / (1 - math.sin(math.radians(phi)))
        return n, c / math.tan(math.radians(phi))

    soil = lambda phi: (f"model: mohr-coulomb, young: 1e6, poisson: 0.3, cohesion: 1, "  # noqa: E731
                        f"friction_angle: {phi}, dilation_angle: {phi}")
    n20, h20 = friction(20, 1)
    for name, law, inside, to, exact, source, method, strain in (
        ("tresca", "model: tresca, young: 1e6, poisson: 0.3, cohesion: 1", True, 2e-5, 2 * math.log(2), "Hill (1950)", "mpm",
         "mean-dilatation"),
        ("soil-20", soil(20), True, 4e-5, h20 * (2 ** (1 - 1 / n20) - 1), "equilibrium and yield", "mpm", "mean"),
        ("soil-outside", soil(20), False, -4e-5, h20 * (2 ** (n20 - 1) - 1), "equilibrium and yield", "mpm", "mean"),
    ):
        place = "x: 1" if inside else "x: 2"
        text = deck([1, 0.25], law, ends + f"\nname: side, nodes: {{{place}}}, ux: {to}", 0.0625,
                    idealisation="axisymmetric", origin=[1, 0], steps="count: 40, until: limit", predictor="last-step")
        add(f"limit-cylinder-{name}", f"limit pressure of a cylinder, {name}", text, "limit_load",
            ring * exact * (1 if inside else 2), source, method=method, strain=strain)

    # Spheres under pressure, loaded by its factor and controlled by the displacement of the equator.
    for name, law, exact, method, strain in (
        ("tresca", "model: tresca, young: 1e6, poisson: 0.3, cohesion: 1", 4 * math.log(2), "cpdi2", "mean-dilatation"),
        ("soil", soil(20), h20 * (2 ** (2 * (1 - 1 / n20)) - 1), "cpdi1", "mean"),
    ):
        text = deck([2, 2], law, SYMMETRY, 0.0625, shape=QUARTER, idealisation="axisymmetric", surfaces=INSIDE,
                    loads="name: push, type: pressure, surface: inside, pressure: 1, follows: false",
                    probe="nearest: [1, 0], count: 1",
                    steps="count: 40, until: limit, control: {type: displacement, probe: tip, axis: x, to: 5e-5}")
        add(f"limit-sphere-{name}", f"limit pressure of a sphere, {name}", text, "limit_load", exact,
            "Hill (1950)" if name == "tresca"
            else "equilibrium and yield", method=method, strain=strain)


# Limit loads. All soils flow with their friction angle.


def limits():
    def factors(phi):
        tangent = math.tan(math.radians(phi))
        nq = math.exp(math.pi * tangent) * math.tan(math.radians(45 + phi / 2)) ** 2
        return nq, (nq - 1) / tangent

    def footing(width, depth, law, to, h, rough=False, edge=1, idealisation="plane-strain", initial="", loads="",
                surfaces="", held="nodes"):
        refine = f', refine: [{{at: [1, {depth}], to: "${{h/{edge}}}"}}]' if edge > 1 else ""
        conditions = (f"name: axis, nodes: {{x: 0}}, fix: [x]\nname: side, nodes: {{x: {width}}}, fix: [x]\n"
                      f"name: base, nodes: {{y: 0}}, fix: [x, y]\n"
                      f"name: footing, nodes: {{box: {{min: [0, {depth}], max: [1, {depth}]}}}}, uy: {-to!r}"
                      f"{', fix: [x]' if rough else ''}")
        return deck([width, depth], law, conditions, h, steps="count: 40, until: limit", refine=refine,
                    idealisation=idealisation, loads=loads, surfaces=surfaces, body=initial, predictor="last-step", room=0.5)

    tresca = "model: tresca, young: 1e4, poisson: 0.49, cohesion: 1"
    mises = "model: von-mises, young: 1e4, poisson: 0.49, undrained_strength: 1"
    soil = lambda phi, c=1: (f"model: mohr-coulomb, young: 1e5, poisson: 0.3, cohesion: {c}, "  # noqa: E731
                             f"friction_angle: {phi}, dilation_angle: {phi}, density: 1")
    strip = "Prandtl (1920)"
    for name, law, rough, edge, method in (("mises-rough", mises, True, 1, "mpm"), ("mises-smooth", mises, False, 1, "gimp"),
                                           ("tresca-rough", tresca, True, 4, "mpm"),
                                           ("tresca-smooth", tresca, False, 2, "cpdi2")):
        add(f"strip-{name}", f"strip footing on clay, {name}, cells {edge} times smaller at its edge",
            footing(4, 2, law, 0.005, 0.0625, rough, edge),
            "limit_load", 2 + math.pi, strip, method=method, strain="mean-dilatation")
    for phi, rough, edge, width, depth, method in ((10, True, 2, 4, 2, "mpm"), (20, True, 4, 7, 3, "mpm"),
                                                   (20, False, 2, 7, 3, "cpdi2"),
                                                    (30, False, 4, 10, 4, "gimp")):
        nc = factors(phi)[1]
        add(f"strip-c-{phi}-{'rough' if rough else 'smooth'}", f"strip footing, N_c at φ = {phi}°",
            footing(width, depth, soil(phi), float(f"{(30e-5 if phi == 30 else 15e-5) * nc:.3g}"),
                    0.125 if phi > 10 else 0.0625, rough, edge), "limit_load", nc, strip,
            method=method, strain="mean")
    nq = factors(20)[0]
    text = footing(7, 3, soil(20, 0), float(f"{15e-5 * nq:.3g}"), 0.125, True, 4,
                   initial=", initial_stress: {type: components, stress: {xx: -1, yy: -1, zz: -1}}",
                   surfaces="name: top, body: body, part: {box: {min: [0, 3], max: [7, 3]}}",
                   loads="name: surcharge, type: traction, surface: top, traction: [0, -1], curve: [[0, 1], [1, 1]]")
    add("strip-q-20", "strip footing, N_q at φ = 20°, force beyond the surcharge", text, "limit_load", nq - 1,
        "Reissner (1924)", method="cpdi2", strain="mean")
    for name, law, exact, source, width, depth, h, to, strain in (
        ("tresca", tresca, 5.69, "Shield (1955)", 3, 2, 0.0625, 0.004, "mean-dilatation"),
        ("20", soil(20), 20.1, "Cox et al. (1961)", 4, 3, 0.0625, 0.003, "mean"),
        ("30", soil(30), 49.3, "Cox et al. (1961)", 6, 4, 0.125, 0.008, "mean"),
    ):
        add(f"circle-{name}", f"smooth circular footing, {name}",
            footing(width, depth, law, to, h, edge=4, idealisation="axisymmetric"),
            "limit_load", math.pi * exact, source, method="mpm", strain=strain)

    cut = ("name: back, nodes: {x: 0}, fix: [x]\nname: front, nodes: {x: 3.5}, fix: [x]\n"
           "name: base, nodes: {y: 0}, fix: [x, y]")
    corner = "{type: polygon, vertices: [[0, 0], [3.5, 0], [3.5, 1], [2, 1], [2, 2], [0, 2]]}"
    weight = "name: weight, type: gravity, acceleration: [0, -1]"
    control = "count: 30, until: limit, control: {type: displacement, probe: tip, axis: y, to: -0.004}"
    clay = "model: von-mises, young: 1e4, poisson: 0.49, undrained_strength: 1, density: 1"
    text = deck([3.5, 2.5], clay, cut, 0.0625, shape=corner, loads=weight, probe="nearest: [2, 2]", steps=control)
    add("cut-mpm", "vertical cut in clay, load factor", text, "limit_load", 3.776, "bounds 3.772 and 3.778", method="mpm",
        strain="mean-dilatation")
    stages = ("stages:\n  - {name: gravity, steps: {count: 2}, factors: {weight: 1}, then: {reset: [displacement]}}\n"
              "  - {name: safety, steps: {count: 10, "
              "control: {type: strength-reduction, from: 1.2, to: 3, tolerance: 0.005}}}\n")
    tresca_cut = "model: tresca, young: 1e4, poisson: 0.49, cohesion: 0.5, density: 1"
    text = deck([3.5, 2.5], tresca_cut, cut, 0.0625, shape=corner, loads=weight).replace("steps: {count: 1}\n", stages)
    add("cut-factor", "vertical cut in clay, factor of safety", text, "factor_of_safety", 3.776 / 2,
        "bounds 3.772 and 3.778", method="gimp", strain="mean-dilatation")

    # A column that a horizontal weight shears: it slides on its base once γH reaches the strength.
    text = deck([0.25, 1], "model: tresca, young: 1e4, poisson: 0.3, cohesion: 1.5, density: 1",
                CHANNEL.replace("SIDE", "y"), 0.0625,
                loads="name: weight, type: gravity, acceleration: [1, 0]").replace("steps: {count: 1}\n",
                                                                                   stages.replace("1.2", "1"))
    add("slide-factor", "layer that slides on its base, factor of safety", text, "factor_of_safety", 1.5, "c/γH",
        method="mpm")

    # A quarter of a plate with deep notches in tension; the ligament is 1 wide.
    plate = ("name: axis, nodes: {x: 0}, fix: [x]\nname: ligament, nodes: {box: {min: [0, 0], max: [0.5, 0]}}, fix: [y]\n"
             "name: end, nodes: {y: 6}, uy: 0.003")
    for method in ("mpm", "cpdi2"):
        edge = 4 if method == "mpm" else 1
        text = deck([5, 6], "model: von-mises, young: 1e5, poisson: 0.3, undrained_strength: 1", plate, 0.0625,
                    steps="count: 60, until: limit",
                    refine=f', refine: [{{at: [0.5, 0], to: "${{h/{edge}}}"}}]' if edge > 1 else "", predictor="last-step")
        add(f"notch-{method}", "plate with deep notches in tension", text, "limit_load", (2 + math.pi) / 2, "Hill (1952)",
            method=method, strain="mean-dilatation")

    # A smooth wall of height 1 above a smooth base, pushed into the ground or drawn from it.
    def wall(phi, c, surcharge, to, toe, method, quantity="wall_rx", steps="count: 40, until: limit"):
        k = math.tan(math.radians(45 + phi / 2)) ** 2
        depth, width = 1 + toe, 4
        conditions = (f"name: wall, nodes: {{box: {{min: [0, {toe}], max: [0, {depth}]}}}}, ux: {to!r}\n"
                      f"name: far, nodes: {{x: {width}}}, fix: [x]\n"
                      f"name: base, nodes: {{y: 0}}, fix: [{'x, y' if toe else 'y'}]")
        if toe:
            conditions += f'\nname: below, nodes: {{box: {{min: [0, 0], max: [0, "${{{toe} - 1e-6}}"]}}}}, fix: [x]'
        initial = f", initial_stress: {{type: geostatic, surface: {depth}, k0: 1, surcharge: {surcharge}}}"
        loads = "name: weight, type: gravity, acceleration: [0, -1]"
        if surcharge:
            loads += f"\nname: surcharge, type: traction, surface: top, traction: [0, {-surcharge}], curve: [[0, 1], [1, 1]]"
        top = f"name: top, body: body, part: {{box: {{min: [0, {depth}], max: [{width}, {depth}]}}}}"
        surfaces = top if surcharge else ""
        return k, deck([width, depth], soil(phi, c).replace("1e5", "1e6"), conditions, 0.0625, steps=steps, body=initial,
                       loads=loads, surfaces=surfaces, predictor="last-step", room=0.5)

    for phi, toe, method in ((20, 0, "cpdi2"), (20, 1, "mpm"), (30, 1, "gimp")):
        # Above a base, cohesion grows with the square of the depth; otherwise every grid would be exact.
        cohesion, total = (0.5, 0.5) if toe else (f'"0.5 + ({1 + toe} - Y)^2"', 0.5 + 1 / 3)
        k, text = wall(phi, cohesion, 0, 5e-5, toe, method, steps="count: 40")
        add(f"passive-{phi}-{'toe' if toe else 'base'}", f"passive force of a smooth wall, φ = {phi}°", text, "wall_rx",
            0.5 * k + 2 * total * math.sqrt(k), "Rankine (1857)", method=method, strain="mean")
    for phi, toe, method in ((20, 1, "mpm"),):
        cohesion, total = 0, 0
        k, text = wall(phi, cohesion, 1, -2e-5, toe, method, steps="count: 40")
        add(f"active-{phi}-{'toe' if toe else 'base'}", f"active force of a smooth wall under a surcharge, φ = {phi}°", text,
            "wall_rx",
            (0.5 + 1) / k - 2 * total / math.sqrt(k), "Rankine (1857)", method=method, strain="mean")


columns()
rods()
cylinders()
spheres()
beams()
layers()
plates()
solids()
plastic_cylinders()
limits()


# Runs


HEADINGS = ["case", "quantity", "value", "bar", "bar %", "order", "trend", "exact", "error %", "covered", "narrow", "CPU s",
            "spread", "coarse", "middle", "fine", "moved", "within coarse", "within middle", "within fine", "sizes", "why",
            "source"]


def run(program, name, folder, scale):
    """The study of a case, as a line of the table."""
    case, folder = CASES[name], pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path, out = folder / f"{name}.yaml", folder / name
    shutil.rmtree(out, ignore_errors=True)
    path.write_text(case.deck)
    command = [program, "converge", path, "--quantity", case.quantity, "--out", out, "--threads", "1"]
    settings = case.settings
    if scale != 1:
        settings = settings | {"h": float(settings.get("h") or case.deck.split("{h: ")[1].split(",")[0]) * scale}
    for key, value in settings.items():
        command += ["--set", f"{key}={value}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if not (out / "convergence_study.json").exists():
        raise RuntimeError(done.stderr.strip() or f"exit {done.returncode}")
    study = json.loads((out / "convergence_study.json").read_text())
    estimate, grids, moved = study["estimate"], study["grids"], study["moved"]
    value, bar, trend = estimate["value"], estimate["bar"], estimate["trend"]
    if bar is None:
        raise RuntimeError(f"no bar: {trend}")
    cpu = sum(grid["cpu_seconds"] for grid in [*grids, *([moved] if moved else [])])
    return [name, case.quantity, value, bar, 100 * bar / abs(value), estimate["order"], trend["kind"], case.exact,
            100 * (value / case.exact - 1), abs(value - case.exact) <= bar, bar < NARROW * abs(value), cpu,
            estimate["spread"],
            *(grid["value"] for grid in grids), moved and moved["value"], *(grid["within"] for grid in grids),
            " ".join(f"{grid['size']:g}" for grid in grids), trend.get("why", ""), case.source]


def shown(cells):
    name, _, value, bar, relative, order, trend, exact, error, covered, narrow, cpu = cells[:12]
    order = "-" if order is None else f"{order:.2f}"
    words = ("yes" if covered else "NO", "yes" if narrow else "NO")
    return (f"{name:28} {value:12.5e} {bar:9.2e} {relative:8.3g} {order:>5} {trend:8} {exact:12.5e} {error:+9.3g} "
            f"{words[0]:>7} {words[1]:>6} {cpu:6.1f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--mpm", default=ROOT / "target/release/mpm", help="the program")
    parser.add_argument("--scale", type=float, default=1,
                        help="sides of all cells relative to those of the decks, such as 2")
    parser.add_argument("--csv", type=pathlib.Path, help="file for the table")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for decks and results")
    options = parser.parse_args()
    chosen = [name for name in CASES if not options.cases or any(name.startswith(start) for start in options.cases)]
    print(f"{'case':28} {'value':>12} {'bar':>9} {'bar %':>8} {'order':>5} {'trend':8} {'exact':>12} {'error %':>9} "
          "covered narrow  CPU s")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen:
            try:
                rows.append(run(options.mpm, name, options.keep or folder, options.scale))
            except RuntimeError as error:
                print(f"{name:28} fails: {str(error).splitlines()[0]}", flush=True)
                continue
            print(shown(rows[-1]), flush=True)
    if options.csv:
        with open(options.csv, "w", newline="") as file:
            csv.writer(file).writerows([HEADINGS, *rows])
    count = len(rows)
    if count:
        covered, narrow = sum(row[9] for row in rows), sum(row[10] for row in rows)
        print(f"\n{count} cases, {sum(row[11] for row in rows):.0f} s of CPU time")
        print(f"the bar covers the exact value in {covered} of {count}: {100 * covered / count:.1f} %")
        print(f"the bar is narrower than {100 * NARROW:g} % of the value in {narrow} of {count}: "
              f"{100 * narrow / count:.1f} %")


if __name__ == "__main__":
    main()
