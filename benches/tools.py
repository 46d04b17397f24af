"""Rigid tools beside closed forms: tables of docs/verification/tools.md.

    python3 benches/tools.py [STUDY ...] [--mpm target/release/mpm] [--finest LEVEL]

Writes decks into a temporary folder, runs `mpm` (from --mpm or the variable MPM) on one thread, and prints a Markdown
table for each study; `--finest 2` stops after the second grid of each. All studies take about half an hour of CPU time.

    platen    a cube between a floor and a smooth plate: uniform stress, overlap
    hertz     cylinders and spheres pressed onto a block: half width and pressure of Hertz
    slope     a block on an inclined plane with friction, and a block that is dragged
    cylinder  a circle pressed into a slab, then slid, turned or rolled
    rolling   a circle that rolls with creep: the tangential force of Carter (1926)
    footing   a strip footing on clay as a tool, and held by nodes
    pipe      full flow around a buried pipe, beside the bounds of Randolph and Houlsby (1984)
    cost      CPU time of analyses with a tool and with boundary conditions in its place

Needs NumPy for `platen`, `hertz` and `cylinder`.
"""

import argparse
import math
import os
import pathlib
import re
import tempfile

import soils
import tools_decks as decks
from soils import extrapolated, filled, order, order_of_changes, print_table, run

PRANDTL = 2 + math.pi


def fields_of(found, series):
    """Arrays of the last VTU file of a series."""
    return soils.point_fields(max((found.folder / "out").glob(f"{series}_*.vtu")))


def balance(found, tools):
    """Largest sum of the forces of tools and of the reactions in a row, relative to the largest of them."""
    worst = 0.0
    for row in found.rows:
        for axis in "xyz":
            forces = [float(value) for name, value in row.items()
                      if name.endswith(f"_r{axis}") or name in [f"{tool}_f{axis}" for tool in tools]]
            largest = max(abs(float(row[name])) for name in row if "_f" in name and name.split("_f")[0] in tools)
            worst = max(worst, abs(sum(forces)) / largest)
    return worst


def tried(program, folder, deck, **settings):
    """The outcome of a run, or None and the code of the error that ended it."""
    try:
        return run(program, folder, deck, **settings), "completed"
    except RuntimeError as error:
        codes = re.findall(r"^error\[(\w+)\]", str(error), re.MULTILINE)
        return None, f"ends with {codes[-1]}" if codes else str(error).strip().splitlines()[-1]


# Uniform stress under a plate


def platen_rows(program, folder):
    exact = 1e6 * math.log(0.75) / 0.75
    cases = [(2, decks.HALF_SPACE, method, steps, grids) for method, steps, grids in [
        ("gimp", 20, (0.2, 0.1, 0.05)), ("cpdi1", 20, (0.1,)), ("cpdi2", 20, (0.2, 0.1, 0.05)), ("mpm", 1, (0.1,)),
        ("mpm", 20, (0.2, 0.1, 0.05))]]
    cases += [(2, decks.BOX, method, 20, (0.1,)) for method in ("gimp", "cpdi2")]
    cases += [(3, decks.HALF_SPACE, method, 20, (0.2,)) for method in ("gimp", "cpdi2")]
    cases += [(3, decks.BOX, "gimp", 20, (0.2,))]
    for axes, shapes, method, steps, grids in cases:
        for h in grids:
            deck = filled(decks.PLATEN if axes == 2 else decks.PLATEN_IN_SPACE, SHAPE=shapes[axes])
            found = run(program, folder, deck, method=method, steps=steps, h=h)
            stress = fields_of(found, "points")["cauchy_stress"][:, axes - 1]
            force = found.column(f"platen_f{'xyz'[axes - 1]}")[-1]
            yield ["plane strain" if axes == 2 else "solid", "half-space" if shapes is decks.HALF_SPACE else "box", method, h,
                   steps, f"{abs(stress / exact - 1).max():.1e}", f"{abs(force / exact / 0.8 ** (axes - 1) - 1):.1e}",
                   f"{max(found.column('platen_overlap')):.1e}", f"{balance(found, ['platen']):.1e}",
                   round(found.summary["linear_solves"] / steps, 1), *found.cost]


def platen(program, folder, finest):
    headings = ["idealisation", "tool", "method", "h", "steps asked", "largest error of the stress", "error of the force",
                "overlap (m)", "balance", "solves per step", "steps", "cuts", "CPU s"]
    print_table("Cube under a smooth plate: σ = E ln(0.75)/0.75", headings, platen_rows(program, folder))


# Hertz


A, SIDE = 0.02, 0.5  # half width, and side of the block; the tool has radius 1
PLANE_MODULUS = 1e6 / (1 - 0.3**2)


def hertz_deck(deck, h, side=SIDE, fine=2 * A):
    """The block under the ball, with cells of size h as far as `fine` from the place of contact."""
    cells, ratio = soils.widening(fine, side, h)
    columns = f"{{to: {fine}, cells: {round(fine / h)}}}, {{to: {side}, cells: {cells}, ratio: {ratio!r}}}"
    above = 4 * h
    rows = f"{{to: {side - fine}, cells: {cells}, ratio: {1 / ratio!r}}}, {{to: {side + above}, cells: {round((fine + above) / h)}}}"
    return filled(deck, COLUMNS=columns, ROWS=rows, SIDE=side, TOP=side + above, CENTRE=side + 1)


def share_within(distances, forces, reach, h, power):
    """Share of the load within a distance from the middle: sums of forces hold up to the middles between places, and grow
    between these with the distance on a line, and with its square on a circle."""
    places = []
    for distance, force in sorted(zip(distances, forces)):
        if places and distance - places[-1][0] < h / 4:
            places[-1][1] += force
        else:
            places.append([distance, force])
    ends = [(a + b) / 2 for (a, _), (b, _) in zip(places, places[1:])]
    sums, total = [(0.0, 0.0)], 0.0
    for end, (_, force) in zip(ends, places):
        total += force
        sums.append((end**power, total))
    for (x0, s0), (x1, s1) in zip(sums, sums[1:]):
        if x1 > reach**power:
            return (s0 + (s1 - s0) * (reach**power - x0) / (x1 - x0)) / sum(forces)
    return math.nan


def hertz_measured(found, h):
    """Distances from the middle and forces of the places in contact."""
    import numpy

    fields = fields_of(found, "contacts")
    normal, force = fields["normal"], fields["force"]
    up = 2 if abs(normal[:, 2]).max() > 0.5 else 1
    # A place on the sphere of radius 1 lies where its normal says.
    distance = numpy.sqrt(sum(normal[:, d] ** 2 for d in range(up)))
    return distance, -force[:, up]


def hertz_rows(program, folder, finest):
    line, ball = math.pi * PLANE_MODULUS * A**2 / 4, 4 * PLANE_MODULUS * A**3 / 3
    in_line = 2 / math.pi * (math.asin(0.5) + 0.5 * math.sqrt(0.75))
    in_ball = 1 - 0.75**1.5
    cases = [("cylinder, plane strain", decks.HERTZ, method, [2, 4, 8, 16], {}, line / 2, (4, in_line))
             for method in ("gimp", "cpdi2")]
    cases += [("sphere, axisymmetric", decks.HERTZ, method, [2, 4, 8, 16], {"idealisation": "axisymmetric"}, ball,
               (2.5, in_ball)) for method in ("gimp", "cpdi2")]
    cases += [("sphere, a quarter in space", decks.HERTZ_IN_SPACE, "cpdi2", [2, 4], {}, ball / 4, (2.5, in_ball))]
    for label, deck, method, cells, settings, load, (moment, share) in cases:
        widths, shares = [], []
        space = deck is decks.HERTZ_IN_SPACE
        for count in cells[:finest]:
            h = A / count
            sizes = {"side": 10 * A, "fine": 1.5 * A} if space else {}
            found, why = tried(program, folder, hertz_deck(deck, h, **sizes), method=method, load=load, **settings)
            if found is None:
                yield [label, method, f"a/{count}", why]
                continue
            distance, force = hertz_measured(found, h)
            width = math.sqrt(moment * float((distance**2 * force).sum() / force.sum()))
            inner = share_within(distance.tolist(), force.tolist(), A / 2, h, 1 if moment == 4 else 2)
            widths.append(width / A - 1)
            shares.append(inner / share - 1)
            axis = "z" if space else "y"
            yield [label, method, f"a/{count}", len(force), 100 * widths[-1], order(widths), inner, share, 100 * shares[-1],
                   f"{abs(found.column(f'ball_f{axis}')[-1] / load + 1):.0e}", f"{max(found.column('ball_overlap')) / h:.0e}",
                   found.summary["linear_solves"], *found.cost]


def hertz(program, folder, finest):
    headings = ["case", "method", "h", "places", "error of a %", "order", "share within a/2", "exact", "error %",
                "error of the load", "overlap / h", "solves", "steps", "cuts", "CPU s"]
    print_table("Hertz: half width, and share of the load within half of it", headings, hertz_rows(program, folder, finest))


# Friction on planes


def slope_rows(program, folder, finest):
    for method in ("mpm", "gimp", "cpdi2"):
        for tangent in (0.27, 0.299, 0.2999, 0.3001, 0.301, 0.31):
            found, why = tried(program, folder, filled(decks.SLOPE, STEPS=decks.TILTED), method=method, steps=2, tangent=tangent)
            if found is None:
                yield [method, tangent, "–", why]
                continue
            along, across = found.column("plane_fx")[-1] / -2500, found.column("plane_fy")[-1] / 2500
            yield [method, tangent, f"{abs(along - tangent):.1e}, {abs(across - 1):.1e}", "in equilibrium"]


def slide_rows(program, folder, finest):
    for mu in (0.3, 1):
        for method in ("mpm", "gimp", "cpdi2"):
            found, why = tried(program, folder, filled(decks.SLOPE, STEPS=decks.SLIDING), method=method, mu=mu)
            if found is None:
                yield ["on a slope", method, mu, why]
                continue
            rows = [row for row in found.rows if row["stage"] == "2" and float(row["time"]) > 1.45]
            errors = [abs(float(row["along_fx"]) / 2500 / mu - 1) for row in rows]
            yield ["on a slope", method, mu, f"{max(errors):.1e}", f"{max(found.column('plane_overlap')):.1e}", *found.cost]
    for mu in (0.2, 0.6):
        for method in ("mpm", "gimp", "cpdi2"):
            found, why = tried(program, folder, decks.DRAGGED, method=method, mu=mu)
            if found is None:
                yield ["dragged", method, mu, why]
                continue
            last = [row for row in found.rows if float(row["time"]) > 1.75]
            errors = [abs(float(row["floor_fx"]) / float(row["floor_fy"]) / mu + 1) for row in last]
            yield ["dragged", method, mu, f"{max(errors):.1e}", f"{max(found.column('floor_overlap')):.1e}", *found.cost]


def slope(program, folder, finest):
    headings = ["method", "tan of the slope", "errors of both forces / weight", "outcome"]
    print_table("A block on a plane, μ = 0.3", headings, slope_rows(program, folder, finest))
    headings = ["block", "method", "μ", "error of the ratio of forces", "overlap (m)", "steps", "cuts", "CPU s"]
    print_table("A block that slides: tangential over normal force, against μ", headings, slide_rows(program, folder, finest))


# A circle on a slab


def cylinder_rows(program, folder, finest):
    cases = [(motion, method, h, 0.3) for motion in list(decks.MOTIONS)[:3]
             for method, grids in (("gimp", (0.0625, 0.03125)), ("cpdi2", (0.0625, 0.03125))) for h in grids[:finest]]
    cases += [("rolled by 0.2, free to turn", "gimp", 0.0625, mu) for mu in (0.3, 0.6)]
    for motion, method, h, mu in cases:
        found, why = tried(program, folder, filled(decks.CYLINDER, MOTION=decks.MOTIONS[motion]), method=method, h=h, mu=mu)
        if found is None:
            yield [motion, method, h, mu, why]
            continue
        fields = fields_of(found, "contacts")
        pressing = (fields["force"] * fields["normal"]).sum(axis=1)
        shear = (((fields["force"] - pressing[:, None] * fields["normal"]) ** 2).sum(axis=1)) ** 0.5
        sum_of_normal = float(pressing.sum())
        fx, fy, mz, turn = (found.column(f"roller_{name}")[-1] for name in ("fx", "fy", "mz", "turn_z"))
        sliding = int((fields["state"] == 2).sum())
        errors = [abs(float(shear.sum()) / (mu * sum_of_normal) - 1), abs(abs(mz) / (mu * 0.5 * sum_of_normal) - 1)]
        yield [motion, method, h, mu, len(pressing), sliding, fx / -fy,
               *(f"{error:.0e}" if sliding == len(pressing) else "–" for error in errors), abs(mz) / (0.5 * sum_of_normal), f"{turn:.2f}",
               f"{found.column('roller_overlap')[-1]:.0e}", f"{balance(found, ['roller']):.0e}", *found.cost]


def cylinder(program, folder, finest):
    headings = ["motion", "method", "h", "μ", "places", "of them slide", "f_x / f_y", "error of Σt/(μN)", "error of M/(μRN)",
                "M/(RN)", "turn (°)", "overlap (m)", "balance", "steps", "cuts", "CPU s"]
    print_table("A circle, R = 0.5, pressed 0.02 into a slab, then moved", headings, cylinder_rows(program, folder, finest))


# Rolling contact


ROLLING_A = 0.04  # half width of Hertz; the circle has radius 1
ROLLING_MU = 0.3
ROLLING_MODULUS = 1e6 / (1 - 0.4999**2)


def rolling_deck(h, way, rotation, side=1.0, fine=2 * ROLLING_A):
    """The slab, with cells of size h below the way of the circle."""
    cells, ratio = soils.widening(fine, side, h)
    columns = (f"{{to: {-fine}, cells: {cells}, ratio: {1 / ratio!r}}}, "
               f"{{to: {fine + way!r}, cells: {round((2 * fine + way) / h)}}}, {{to: {side + way!r}, cells: {cells}, ratio: {ratio!r}}}")
    above = 4 * h
    rows = f"{{to: {-fine}, cells: {cells}, ratio: {1 / ratio!r}}}, {{to: {above!r}, cells: {round((fine + above) / h)}}}"
    return filled(decks.ROLLING, COLUMNS=columns, ROWS=rows, LEFT=-side, RIGHT=side + way, WIDTH=2 * side + way, SIDE=side,
                  HEIGHT=side + above, ROTATION=rotation)


def rolling_rows(program, folder, finest):
    load = math.pi * ROLLING_MODULUS * ROLLING_A**2 / 4
    for method, count, shares in [("gimp", 4, (0.25, 0.5, 0.75)), ("cpdi2", 4, (0.5,)), ("gimp", 8, (0.5,))][: 3 if finest > 1 else 1]:
        h, way = ROLLING_A / count, 12 * ROLLING_A
        settings = {"method": method, "load": load, "way": way, "mu": ROLLING_MU, "steps": 2 * round(way / h)}
        free, why = tried(program, folder, rolling_deck(h, way, decks.FREE_TO_TURN), **settings)
        if free is None:
            yield [method, f"a/{count}", "free to turn", why]
            continue
        # The last half of the way.
        rows = [row for row in free.rows if row["roller_fx"] and float(row["time"]) >= 1.5]
        half = {name: [float(row[f"roller_{name}"]) for row in rows] for name in ("fx", "mz", "turn_z", "ux")}
        turned, moved = (half[name][-1] - half[name][0] for name in ("turn_z", "ux"))
        per_way = -math.radians(turned) / moved
        most, moment = (max(map(abs, half[name])) / (ROLLING_MU * load) for name in ("fx", "mz"))
        yield [method, f"a/{count}", "free to turn", f"{1 - per_way:.2e}", f"{most:.4f} at most", 0, "–", f"{moment:.0e}", *free.cost]
        for share in shares:
            creep = share * ROLLING_MU * ROLLING_A
            turn = math.degrees(way * (per_way - creep))
            found, why = tried(program, folder, rolling_deck(h, way, decks.TURNED), turn=turn, **settings)
            if found is None:
                yield [method, f"a/{count}", f"{share}", why]
                continue
            exact = 1 - (1 - share) ** 2
            last = found.column("roller_fx")[-1] / (ROLLING_MU * load)
            yield [method, f"a/{count}", f"{share}", f"{1 - per_way + creep:.2e}", last, exact, 100 * (last / exact - 1),
                   found.column("roller_mz")[-1] / (ROLLING_MU * load), *found.cost]


def rolling(program, folder, finest):
    headings = ["method", "h", "creep beyond free rolling × R/(μa)", "1 − ωR/v", "Q/(μP)", "Carter", "error %", "M/(μPR)", "steps",
                "cuts", "CPU s"]
    print_table("A circle that rolls on a slab by 12a, a = R/25, ν = 0.4999", headings, rolling_rows(program, folder, finest))


# Strip footing


def curve_of(found, column):
    """Loads in units of c over the times of the requested steps."""
    curve = {}
    for row in found.rows:
        tenths = float(row["time"]) * 10
        if abs(tenths - round(tenths)) < 1e-6:
            curve[round(tenths)] = abs(float(row[column])) / 1000
    return curve


def footing_rows(program, folder, finest):
    for rough in (False, True):
        for method in ("gimp", "cpdi2"):
            errors, of_tool = {True: [], False: []}, []
            for h in [0.25, 0.125, 0.0625][:finest]:
                curves, found = {}, {}
                for by_tool in (True, False):
                    found[by_tool] = run(program, folder, decks.strip(by_tool, rough), method=method, h=h)
                    curves[by_tool] = curve_of(found[by_tool], "footing_fy" if by_tool else "footing_ry")
                    errors[by_tool].append(curves[by_tool][10] / PRANDTL - 1)
                tool, nodes = curves[True], curves[False]
                of_tool.append(tool[10])
                largest = max(abs(tool[k] / nodes[k] - 1) for k in nodes)
                effective = tool[10] / (1 + h / 2)
                yield ["rough" if rough else "smooth", method, f"B/{round(2 / h)}", nodes[10], tool[10],
                       100 * errors[False][-1], 100 * errors[True][-1], order(errors[True]), extrapolated(of_tool),
                       100 * (effective / PRANDTL - 1), 100 * largest, 100 * (tool[10] / tool[8] - 1),
                       f"{max(found[True].column('footing_overlap')) / h:.0e}",
                       *(f"{found[k].summary['linear_solves']}, {found[k].cost[2]}" for k in (False, True))]


def width_rows(program, folder, finest):
    for rough in (False, True):
        for method in ("gimp", "cpdi2"):
            h = 0.125
            for beyond in (0, 0.25, 0.49, 0.51, 0.75, 1):
                found = run(program, folder, decks.strip(True, rough), method=method, h=h, half=1 + beyond * h)
                load = curve_of(found, "footing_fy")[10]
                yield ["rough" if rough else "smooth", method, beyond, load, load / PRANDTL, 1 + beyond * h,
                       100 * (load / PRANDTL / (1 + beyond * h) - 1), int(found.column("footing_contacts")[-1])]


def footing(program, folder, finest):
    headings = ["footing", "method", "h", "nodes: load / c", "tool: load / c", "error of nodes %", "of the tool %", "its order",
                "extrapolated", "width B + h: error %", "largest difference on the curve %", "tool: rise %", "overlap / h",
                "nodes: solves, CPU s", "tool: solves, CPU s"]
    print_table("Strip footing: 2 + π = 5.1416", headings, footing_rows(program, folder, finest))
    headings = ["footing", "method", "half width beyond 1, in h", "load / c", "load / (2 + π) c", "half width", "error %", "places"]
    print_table("Footings whose edge lies between grid lines, h = B/16", headings, width_rows(program, folder, finest))


# Pipe


def full_flow(alpha):
    """Force over D s_u: the lower bound of Randolph and Houlsby (1984)."""
    angle = math.asin(alpha)
    return math.pi + 2 * angle + 2 * math.cos(angle) + 4 * (math.cos(angle / 2) + math.sin(angle / 2))


INTERFACES = {"smooth": (0, {}), "α = 0.5": (0.5, {"adhesion": 500}), "rough": (1, {"friction": "rough"})}


def pipe_rows(program, folder, finest):
    cases = [("smooth", 10, True, 4), ("rough", 10, True, 4), ("smooth", 20, True, 3), ("rough", 20, True, 3)]
    cases += [("smooth", 10, False, 3), ("α = 0.5", 10, False, 3), ("rough", 10, False, 3), ("α = 0.5", 10, True, 2)]
    for name, outer, triangles, grids in cases:
        alpha, settings = INTERFACES[name]
        exact, values = full_flow(alpha), []
        for across in [12, 24, 48, 96][: min(finest, grids)]:
            mesh = pathlib.Path(folder) / f"ring_{across}_{outer}_{triangles}.msh"
            mesh.write_text(decks.ring(across, outer, triangles))
            deck = filled(decks.PIPE, MESH=mesh, POINTS="points_per_triangle" if triangles else "points_per_cell")
            found, why = tried(program, folder, deck, **settings)
            cells = "triangles" if triangles else "quadrilaterals"
            if found is None:
                yield [name, cells, outer / 2, across, why]
                continue
            # Half of the force over the radius is the force over the diameter.
            loads = [-force / 1000 for force in found.column("pipe_fy")]
            before = max(load for load, t in zip(loads, found.column("time")) if t <= 0.8 + 1e-9)
            values.append(loads[-1])
            errors = [value / exact - 1 for value in values]
            yield [name, cells, outer / 2, across, loads[-1], exact, 100 * errors[-1], order(errors), order_of_changes(values),
                   extrapolated(values), 100 * (extrapolated(values) / exact - 1), 100 * (loads[-1] - before) / loads[-1],
                   f"{max(found.column('pipe_overlap')):.0e}", int(found.column("pipe_contacts")[-1]),
                   found.summary["linear_solves"], *found.cost]


def pipe(program, folder, finest):
    headings = ["interface", "cells", "outside at D ×", "cells per half circle", "N", "exact", "error %", "order",
                "order of changes", "extrapolated", "its error %", "rise %", "overlap / R", "places", "solves", "steps", "cuts",
                "CPU s"]
    print_table("Full flow around a pipe: N = F/(D s_u)", headings, pipe_rows(program, folder, finest))


# Cost


def cost_rows(program, folder, finest):
    cases = []
    for rough in (False, True):
        words = {"FRICTION": "rough" if rough else "0", "FIX": "fix: [x], " if rough else ""}
        pair = {by_tool: filled(decks.LAYER, PLATE=decks.PLATE_AS_TOOL if by_tool else decks.PLATE_BY_NODES) for by_tool in (True, False)}
        pair = {by_tool: filled(deck, **words) for by_tool, deck in pair.items()}
        cases += [(f"{'rough' if rough else 'smooth'} plate on {high} cells", pair, "plate", {"method": method, "high": high})
                  for high in (5, 10) for method in ("gimp", "cpdi2")]
    for rough in (False, True):
        pair = {True: decks.elastic(decks.strip(True, rough)).replace("friction: rough", "friction: 1"),
                False: decks.elastic(decks.strip(False, rough))}
        cases += [("footing, μ = 1, h = B/16" if rough else "smooth footing, h = B/16", pair, "footing",
                   {"method": method, "h": 0.125, "steps": 20, "to": 0.02}) for method in ("gimp", "cpdi2")]
    for label, pair, name, settings in cases:
        best = {}
        for by_tool in (False, True) * 3:
            found = run(program, folder, pair[by_tool], **settings)
            summary = found.summary
            cpu = summary["cpu_seconds"]["total"] - summary["cpu_seconds"]["output"]
            if by_tool not in best or cpu < best[by_tool][0]:
                best[by_tool] = cpu, summary, found
        (nodes, of_nodes, _), (tool, of_tool, found) = best[False], best[True]
        touching = int(found.column(f"{name}_contacts")[-1])
        def parts(summary):
            """CPU time outside of the linear solver per point and evaluation, [µs], and in it per solve, [ms]."""
            cpu = summary["cpu_seconds"]
            outside = sum(cpu[part] for part in ("basis", "assembly", "update")) / summary["evaluations"] / summary["points"]
            return 1e6 * outside, 1e3 * sum(cpu[part] for part in ("analyse", "factorise", "solve")) / summary["linear_solves"]

        (assembly, solver), (with_tool, with_lu) = parts(of_nodes), parts(of_tool)
        per = [1e6 * cpu / summary["evaluations"] / summary["points"] for cpu, summary in ((nodes, of_nodes), (tool, of_tool))]
        yield [label, settings["method"], of_tool["points"], touching, f"{100 * touching / of_tool['points']:.1f}",
               *(f"{s['evaluations']}, {s['linear_solves']}" for s in (of_nodes, of_tool)), *map(shortly, (*per, per[1] / per[0])),
               *map(shortly, (assembly, with_tool, with_tool / assembly, solver, with_lu, with_lu / solver)),
               *map(shortly, (nodes, tool, tool / nodes))]


def shortly(value):
    return f"{value:.2f}"


def cost(program, folder, finest):
    headings = ["case", "method", "points", "places", "places / points %", "nodes: evaluations, solves", "tool: evaluations, solves",
                "all, µs per point and evaluation: nodes", "tool", "ratio", "without solver: nodes", "tool", "ratio",
                "solver, ms per solve: nodes", "tool", "ratio", "CPU s: nodes", "tool", "ratio"]
    print_table("CPU time without output, best of three", headings, cost_rows(program, folder, finest))


STUDIES = {"platen": platen, "hertz": hertz, "slope": slope, "cylinder": cylinder, "rolling": rolling, "footing": footing, "pipe": pipe, "cost": cost}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", choices=[[], *STUDIES], metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--mpm", default=os.environ.get("MPM", soils.ROOT / "target/release/mpm"), help="the program")
    parser.add_argument("--finest", type=int, default=4, help="number of grids of each study")
    options = parser.parse_args()
    for name in options.studies or STUDIES:
        with tempfile.TemporaryDirectory() as folder:
            STUDIES[name](options.mpm, folder, options.finest)


if __name__ == "__main__":
    main()
