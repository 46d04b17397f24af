"""Contact between deformable bodies beside closed forms: tables of docs/verification/contact.md.

    python3 benches/contact.py [STUDY ...] [--mpm target/release/mpm] [--finest LEVEL]

Writes decks into a temporary folder, runs `mpm` (from --mpm or the variable MPM) on one thread, and prints a Markdown
table for each study; `--finest 2` stops after the second grid of each.

    patch     two blocks of unequal stiffness, one on the other: uniform stress
    mirror    a body on its mirror image, and on a smooth plane
    hertz     equal and unequal cylinders: half width and pressure of Hertz, in both orders of the pair
    cattaneo  cylinders that are then sheared: the zone that sticks
    slope     a block on an inclined plane
    drag      a soft block that is drawn along a stiff one
    stiff     a punch 10⁵ times as stiff as the ground, and a tool of its shape

Needs NumPy.
"""

import argparse
import itertools
import math
import os
import tempfile

import numpy

import contact_decks as decks
import soils
from soils import filled, order, print_table, run
from tools import share_within

METHODS = ("gimp", "cpdi1", "cpdi2")


def fields_of(found, series):
    """Arrays of the last VTU file of a series."""
    fields = soils.point_fields(max((found.folder / "out").glob(f"{series}_*.vtu")))
    return {name: values[:, 0] if values.shape[1] == 1 else values for name, values in fields.items()}


def tried(program, folder, deck, **settings):
    """The outcome of a run, or None and the code of the error that ended it."""
    try:
        return run(program, folder, deck, **settings), "completed"
    except RuntimeError as error:
        lines = [line for line in str(error).splitlines() if line.startswith("error[")]
        return None, f"ends with {lines[-1][6:10]}" if lines else "fails"


# Two blocks


def patch_rows(program, folder, finest):
    exact = -328005.37114501  # E ln(λ)/λ, equal in both blocks, which shorten by 0.3 m together
    for first, second in itertools.product(METHODS, METHODS):
        errors, overlaps = [], []
        for offset in (0, 0.06, 0.1):
            found = run(program, folder, decks.PATCH, first=first, second=second, offset=offset)
            errors.append(abs(fields_of(found, "points")["cauchy_stress"][:, 1] / exact - 1).max())
            overlaps.append(max(found.column("lower_on_upper_overlap")) / 0.2)
        yield [first, second, *(f"{error:.0e}" for error in errors), f"{max(overlaps):.0e}"]


def patch(program, folder, finest):
    headings = ["lower", "upper", "line of the grid", "0.3 h above it", "mid-cell", "overlap / h"]
    print_table("Two blocks: largest error of the uniform stress", headings, patch_rows(program, folder, finest))


def mirror_rows(program, folder, finest):
    for method in METHODS:
        for h in (0.2, 0.1)[:finest]:
            pair, plane = (run(program, folder, deck, h=h, method=method) for deck in (decks.MIRROR, decks.MIRROR_ON_PLANE))
            forces = [numpy.array(found.column("drag_ry")) for found in (pair, plane)]
            side = numpy.abs(pair.column("drag_rx")).max() / numpy.abs(forces[0]).max()
            yield [method, h, f"{abs(forces[0] / forces[1] - 1).max():.1e}", f"{side:.0e}",
                   f"{max(pair.column('lower_on_upper_overlap')) / h:.0e}", *pair.cost]


def mirror(program, folder, finest):
    headings = ["method", "h", "difference of the force", "lateral / vertical force", "overlap / h", "steps", "cuts", "CPU s"]
    print_table("A body on its mirror image, beside a body on a smooth plane", headings, mirror_rows(program, folder, finest))


# Cylinders


class Cylinders:
    """Two cylinders under a load per length, and what Hertz says about them."""

    def __init__(self, load, radii, young, poisson):
        self.load, self.radii, self.young, self.poisson = load, radii, young, poisson
        modulus = 1 / sum((1 - v * v) / e for e, v in zip(young, poisson))
        radius = 1 / sum(1 / r for r in radii)
        self.half_width = math.sqrt(4 * load * radius / (math.pi * modulus))
        self.pressure = 2 * load / (math.pi * self.half_width)

    def axis(self, low, high, h):
        """Intervals of an axis: even cells as far as 1.5 half widths from 0, growing ones beyond."""
        fine = round(1.5 * self.half_width / h) * h
        intervals = []
        if low < 0:
            cells, ratio = soils.widening(fine, -low, h)
            intervals += [{"to": -fine, "cells": cells, "ratio": 1 / ratio}]
        intervals += [{"to": fine, "cells": round((fine - (-fine if low < 0 else 0)) / h)}]
        cells, ratio = soils.widening(fine, high, h)
        intervals += [{"to": high, "cells": cells, "ratio": ratio}]
        return intervals

    def quarter(self, radius, up, h, both_sides=False):
        """Half of a cylinder as far as its middle, or a quarter of it: the corners of a polygon whose chords end on the
        middles of the cells near the contact, and the number of its flat side."""
        fine, xs = 1.5 * self.half_width, [0.0]
        step = h / 2
        while xs[-1] < radius * math.sin(math.radians(85)):
            step = step if xs[-1] < fine else min(1.1 * step, radius / 20)
            xs.append(xs[-1] + step)
        angles = [math.asin(x / radius) for x in xs if x < radius * math.sin(math.radians(80))] + [math.pi / 2]
        arc = [(radius * math.sin(a), up * radius * (1 - math.cos(a))) for a in angles]
        if both_sides:
            arc = [(-x, y) for x, y in reversed(arc[1:])] + arc
            return arc, len(arc) - 1
        return [*arc, (0.0, up * radius)], len(arc) - 1

    def deck(self, template, h, names, both_sides=False, **words):
        shapes = [self.quarter(radius, up, h, both_sides) for radius, up in zip(self.radii, (-1, 1))]
        width, (low, high) = max(self.radii), (-self.radii[0], 1.02 * self.radii[1])
        columns = self.axis(-width if both_sides else 0, width, h)
        text = [", ".join(f"[{x!r}, {y!r}]" for x, y in shape) for shape, _ in shapes]
        return filled(
            template, COLUMNS=columns, ROWS=self.axis(low, high, h), LOWER=text[0], UPPER=text[1], BASE=shapes[0][1],
            TOP=shapes[1][1], LEFT=-width if both_sides else 0, WIDTH=2 * width if both_sides else width, DEPTH=low,
            HEIGHT=high - low, FIRST=names[0], SECOND=names[1], E_L=self.young[0], E_U=self.young[1], NU_L=self.poisson[0],
            NU_U=self.poisson[1], PRESSURE=self.load / (2 * self.radii[1]), **words)


EQUAL = Cylinders(50, (0.2, 0.2), (1e5, 1e5), (0.3, 0.3))
LIGHT = Cylinders(50 / 16, (0.2, 0.2), (1e5, 1e5), (0.3, 0.3))
UNEQUAL = Cylinders(50, (0.2, 0.3), (1e5, 4e5), (0.3, 0.2))


def on_upper(found):
    """Positions along x, forces of contact on the upper body, and states."""
    fields = fields_of(found, "contacts")
    sign = numpy.where(fields["body"] == 1, 1.0, -1.0)
    return fields["Points"][:, 0], sign[:, None] * fields["force"], fields["state"]


def hertz_rows(program, folder, finest):
    share = 2 / math.pi * (math.asin(0.5) + 0.5 * math.sqrt(0.75))
    cases = [("equal", EQUAL, ("lower", "upper")), ("equal, a sixteenth of the load", LIGHT, ("lower", "upper")),
             ("unequal", UNEQUAL, ("lower", "upper")), ("unequal, other order", UNEQUAL, ("upper", "lower"))]
    for label, pair, names in cases:
        widths, largest = [], []
        for cells in (4, 8, 16)[:finest]:
            h = pair.half_width / cells
            found = run(program, folder, pair.deck(decks.HERTZ, h, names))
            x, force, _ = on_upper(found)
            load = 2 * force[:, 1].sum()
            widths.append(math.sqrt(8 * (x**2 * force[:, 1]).sum() / load) / pair.half_width - 1)
            largest.append(share_within(abs(x), force[:, 1], pair.half_width / 2, h, 1) / share - 1)
            yield [label, f"a/{cells}", load, 100 * widths[-1], order(widths), 100 * largest[-1], order(largest),
                   f"{max(found.column(overlap_of(names))) / h:.0e}", found.summary["linear_solves"], *found.cost]


def overlap_of(names):
    return f"{names[0]}_on_{names[1]}_overlap"


def hertz(program, folder, finest):
    headings = ["cylinders", "h", "load", "half width %", "order", "pressure within a/2 %", "order", "overlap / h", "solves", "steps", "cuts", "CPU s"]
    print_table("Cylinders: errors beside Hertz", headings, hertz_rows(program, folder, finest))


def cattaneo_rows(program, folder, finest):
    friction, errors = 0.3, []
    for cells in (4, 8, 16)[:finest]:
        h = EQUAL.half_width / cells
        found = run(program, folder, EQUAL.deck(decks.CATTANEO, h, ("lower", "upper"), both_sides=True))
        x, force, state = on_upper(found)
        normal, shear = force[:, 1].sum(), force[:, 0].sum()
        width = math.sqrt(4 * (x**2 * force[:, 1]).sum() / normal - 4 * (x @ force[:, 1] / normal) ** 2)
        exact = math.sqrt(1 - abs(shear) / (friction * normal))
        # What is missing to full friction, μp − |t|, is the distribution of Hertz over the zone that sticks.
        missing = friction * force[:, 1] - numpy.abs(force[:, 0])
        mean = x @ missing / missing.sum()
        zone = 2 * math.sqrt(((x - mean) ** 2 @ missing) / missing.sum()) / width
        sticks = numpy.abs(x[state == 1] - mean)
        slides = numpy.abs(x[state == 2] - mean)
        states = (sticks.max() + slides[slides > sticks.max()].min()) / 2 / width if len(sticks) else 0.0
        errors.append(zone / exact - 1)
        yield [f"a/{cells}", normal, shear / (friction * normal), exact, zone, 100 * errors[-1], order(errors), states,
               found.summary["linear_solves"], *found.cost]


def cattaneo(program, folder, finest):
    headings = ["h", "load", "Q/(μP)", "c/a, exact", "c/a by moments", "error %", "order", "c/a by states", "solves",
                "steps", "cuts", "CPU s"]
    print_table("Cylinders that are sheared: the zone that sticks", headings, cattaneo_rows(program, folder, finest))


# Blocks


def slope_rows(program, folder, finest):
    for method in METHODS:
        for ratio in (0.99, 1.01):
            found, outcome = tried(program, folder, decks.SLOPE, method=method, ratio=ratio)
            if found is None:
                yield [method, ratio, outcome, "–", "–", "–", "–", "–"]
                continue
            shear, normal = found.column("upper_on_lower_fx")[-1], found.column("upper_on_lower_fy")[-1]
            weight = 2 * 1000 * 9.81
            yield [method, ratio, "in equilibrium", f"{abs(shear / (0.3 * ratio * weight) - 1):.0e}",
                   f"{abs(normal / weight + 1):.0e}", *found.cost]


def slope(program, folder, finest):
    headings = ["method", "slope / μ", "outcome", "error of the shear", "error of the normal force", "steps", "cuts", "CPU s"]
    print_table("A block on a slope, μ = 0.3", headings, slope_rows(program, folder, finest))


def drag_rows(program, folder, finest):
    for method in METHODS:
        for h in (0.5, 0.25)[:finest]:
            found, outcome = tried(program, folder, decks.DRAG, method=method, h=h)
            if found is None:
                yield [method, h, outcome] + ["–"] * 5
                continue
            yield [method, h, found.column("drag_rx")[-1], f"{found.column('drag_rx')[-1] / 12e3 - 1:.1e}",
                   found.summary["linear_solves"], *found.cost]


def drag(program, folder, finest):
    headings = ["method", "h", "force", "error", "solves", "steps", "cuts", "CPU s"]
    print_table("A block that is drawn along: μN = 12 kN", headings, drag_rows(program, folder, finest))


def stiff_rows(program, folder, finest):
    for shape, friction in itertools.product(("box", "disc"), (0, 0.3)):
        differences = []
        for cells in (4, 8)[:finest]:
            h, found, why = 0.5 / cells, {}, {}
            for kind in ("body", "tool"):
                corners, top = decks.punch(shape)
                words = {"PUNCH": ", ".join(f"[{x!r}, {y!r}]" for x, y in corners), "TOP": top}
                found[kind], why[kind] = tried(program, folder, filled(decks.PUNCH[kind], **words), h=h, friction=friction)
            if None in found.values():
                yield [shape, friction, cells, *why.values()] + ["–"] * 6
                continue
            times = [round(0.1 * k, 9) for k in range(1, 11)]
            force = {}
            for kind, column in (("body", "drive_ry"), ("tool", "punch_fy")):
                rows = found[kind].rows
                force[kind] = numpy.interp(times, [float(row["time"]) for row in rows], [float(row[column]) for row in rows])
            ratio = numpy.abs(force["body"] / force["tool"] - 1)
            differences.append(ratio[-1])
            solves = [found[kind].summary["linear_solves"] for kind in ("body", "tool")]
            yield [shape, friction, cells, force["tool"][-1], force["body"][-1], 100 * ratio[-1], 100 * ratio.max(),
                   order(differences), *solves, solves[0] / solves[1]]


def stiff(program, folder, finest):
    headings = ["punch", "μ", "cells per half width", "force of the tool", "of the body", "difference at the end %",
                "largest %", "order", "solves of the body", "of the tool", "ratio"]
    print_table("A stiff punch and a tool of its shape, 0.4 m deep", headings, stiff_rows(program, folder, finest))


STUDIES = {"patch": patch, "mirror": mirror, "hertz": hertz, "cattaneo": cattaneo, "slope": slope, "drag": drag, "stiff": stiff}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", choices=[[], *STUDIES], metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--mpm", default=os.environ.get("MPM", soils.ROOT / "target/release/mpm"), help="the program")
    parser.add_argument("--finest", type=int, default=3, help="number of grids of each study")
    options = parser.parse_args()
    for name in options.studies or STUDIES:
        with tempfile.TemporaryDirectory() as folder:
            STUDIES[name](options.mpm, folder, options.finest)


if __name__ == "__main__":
    main()
