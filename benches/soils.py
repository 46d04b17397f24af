"""Soil laws in boundary-value problems beside closed forms and published numbers: tables of docs/verification/soils.md.

    python3 benches/soils.py [STUDY ...] [--mpm target/release/mpm] [--finest LEVEL]

Writes decks into a temporary folder, runs `mpm` (from --mpm or the variable MPM) on one thread, and prints a Markdown
table for each study; `--finest 2` stops after the second grid of each. All studies take about 16 minutes of CPU time.

    slope       strength reduction of example 1 of Griffiths and Lane (1999): by grid, method, points, flow, treatment
    clay-slope  strength reduction of an undrained slope on a foundation of another strength
    weak-layer  strength reduction of an undrained slope with a thin weak layer
    bearing     bearing capacity factors N_c at 20, 25 and 30 degrees, and N_q at 30 degrees
    cylinder    thick cylinder of Mohr-Coulomb and Tresca material, widened by half its inner radius
    cut         strength reduction of a vertical cut
    softening   a vertical cut in softening clay, to a settlement of a tenth of its height
    block       Cam-clay between plates, and in triaxial and biaxial tests, beside `mpm element`

Needs NumPy for `block` only. Loads and factors of analyses with displacements converge from above with order 1, since
a velocity that jumps across a line is spread over a cell. Slopes that fail slide on, and after a displacement of some
per cent of their height they may find equilibrium again. Hence the studies of slopes report two factors: `stands`, the
last one with equilibrium, and F, the one at which the settlement of the crest reaches 1/1000 of the height, or `stands`
if equilibrium ceases before.
"""

import argparse
import csv
import json
import math
import os
import pathlib
import subprocess
import tempfile
from dataclasses import dataclass

import soils_decks as decks

ROOT = pathlib.Path(__file__).resolve().parent.parent
CUT = 3.776  # γH/c of a vertical cut in clay, between 3.772 and 3.778


@dataclass
class Outcome:
    """What a run found: its converged rows and its summary."""

    rows: list
    summary: dict
    folder: pathlib.Path

    def column(self, name):
        return [float(row[name]) for row in self.rows if row[name]]

    @property
    def cost(self):
        summary = self.summary
        return [summary["steps"], summary["failed_attempts"], round(summary["cpu_seconds"]["total"], 1)]


def filled(deck, **words):
    """The deck with its words in capitals replaced."""
    for word, value in words.items():
        deck = deck.replace(word, str(value))
    return deck


def run(program, folder, deck, **settings):
    """Runs a deck in a new folder below `folder`; raises RuntimeError with the message unless the run completes."""
    place = pathlib.Path(tempfile.mkdtemp(dir=folder))
    (place / "deck.yaml").write_text(deck)
    command = [program, "run", place / "deck.yaml", "--threads", "1", "--out", place / "out"]
    for name, value in settings.items():
        command += ["--set", f"{name}={value}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    with open(place / "out/history.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
    return Outcome(rows, json.loads((place / "out/summary.json").read_text()), place)


def order(errors):
    """Order of convergence from the last two errors, each on a grid half as wide as the one before."""
    if len(errors) < 2 or not errors[-2] * errors[-1] > 0:
        return math.nan
    return math.log2(errors[-2] / errors[-1])


def order_of_changes(values):
    """Order of convergence from the last two changes of three values; it needs no exact value."""
    return order([a - b for a, b in zip(values[-3:], values[-2:])]) if len(values) > 2 else math.nan


def extrapolated(values):
    """The limit of the last two values on grids of half the spacing each, if they converge with order 1."""
    return 2 * values[-1] - values[-2] if len(values) > 1 else math.nan


def shown(value):
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.5g}"
    return str(value)


def print_table(title, headings, rows):
    print(f"\n### {title}\n\n| " + " | ".join(headings) + " |\n|" + "---|" * len(headings), flush=True)
    for row in rows:
        print("| " + " | ".join(map(shown, row)) + " |", flush=True)


# Slopes and cuts by strength reduction


def factor_at(found, settlement):
    """The factor at which the crest has settled so far in the stage of the reduction, interpolated; the last factor with
    equilibrium, if equilibrium ceases before."""
    points = [(0.0, 1.0)]
    points += [(-float(row["crest_uy"]), float(row["strength_factor"])) for row in found.rows if row["stage"] == "2"]
    for (u, f), (w, g) in zip(points, points[1:]):
        if w >= settlement:
            return f + (g - f) * (settlement - u) / (w - u)
    if found.summary["strength_reduction"]["fails"] is None:
        return math.nan
    return points[-1][1]


def reduction_rows(program, folder, deck, height, reference, cases, exact=False):
    """Rows with both factors, over several spacings per case; a case is a label, spacings and settings. The order is that
    of the errors if the reference is exact, else that of the changes from grid to grid."""
    for label, spacings, settings in cases:
        factors = []
        for h in spacings:
            found = run(program, folder, deck, h=h, **settings)
            factor = factor_at(found, height / 1000)
            bounds, settled = found.summary["strength_reduction"], -1000 * found.column("crest_uy")[-1] / height
            factors.append(factor)
            errors = [f / reference - 1 for f in factors]
            rate = order(errors) if exact else order_of_changes(factors)
            fails = "none" if bounds["fails"] is None else f"{bounds['fails']:.4f}"
            yield [label, h, factor, 100 * errors[-1], rate, extrapolated(factors), round(bounds["stands"], 4), fails,
                   round(settled, 1), *found.cost]


REDUCTION = ["case", "h", "F", "error %", "order", "extrapolated", "stands", "fails", "settled ‰ of H", "steps",
             "cuts", "CPU s"]


def slope(program, folder, finest):
    grids = [1, 0.5, 0.25][:finest]
    flow = {"psi": 20}
    cases = [("GIMP 3 × 3", grids, {}), ("MPM 3 × 3", grids, {"method": "mpm"}), ("CPDI2 3 × 3", grids, {"method": "cpdi2"})]
    cases += [(f"GIMP {n} × {n}", grids[:2], {"n": n}) for n in (2, 4)]
    cases += [("ψ = φ, GIMP 3 × 3", grids[:2], flow | {"steps": 30})]
    cases += [("standard, GIMP 3 × 3", grids[:2], {"volumetric": "standard"}),
              ("standard, ψ = φ, GIMP 3 × 3", grids[:2], flow | {"volumetric": "standard"})]
    rows = reduction_rows(program, folder, decks.SLOPE, 10, 1.4, cases)
    print_table("Slope of Griffiths and Lane, example 1: 1.40 by finite elements, 1.380 by charts", REDUCTION, rows)


def clay_slope(program, folder, finest):
    deck = filled(decks.CLAY_SLOPE, REGION=decks.FOUNDATION)
    for ratio, published, end in [(1, 1.47, 1.6), (2, 2.1, 2.4)]:
        settings = {"ratio": ratio, "to": end, "steps": 30}
        cases = [("MPM 2 × 2", [2, 1, 0.5, 0.25][:finest], settings),
                 ("GIMP 2 × 2", [2, 1, 0.5][:finest], settings | {"method": "gimp"})]
        rows = reduction_rows(program, folder, deck, 10, published, cases)
        print_table(f"Undrained slope, foundation {ratio} times as strong: {published} by Taylor's charts", REDUCTION, rows)


def weak_layer(program, folder, finest):
    deck = filled(decks.CLAY_SLOPE, REGION=decks.WEAK_LAYER)
    for ratio, published in [(1, 1.47), (0.8, 1.45), (0.6, 1.40), (0.5, 1.25)]:
        settings = {"ratio": ratio, "to": 1.6, "steps": 30}
        cases = [("MPM 2 × 2", [1, 0.5, 0.25, 0.125][:finest], settings),
                 ("GIMP 2 × 2", [1, 0.5, 0.25][:finest], settings | {"method": "gimp"})]
        rows = reduction_rows(program, folder, deck, 10, published, cases)
        print_table(f"Slope with a thin layer {ratio} times as strong: {published} by Griffiths and Lane", REDUCTION, rows)


def cut(program, folder, finest):
    deck = filled(decks.CUT, SOFTENING="", WEIGHT=-2.5, STEPS=decks.REDUCTION)
    grids = [0.25, 0.125, 0.0625, 0.03125][:finest]
    cases = [("E = 10⁶ c", grids, {})]
    cases += [("E = 10³ c", grids[:3], {"young": 1e3})]
    rows = reduction_rows(program, folder, deck, 1, CUT / 2.5, cases, exact=True)
    print_table(f"Vertical cut, γH/c = 2.5: {CUT / 2.5:.4f}", REDUCTION, rows)


# Bearing capacity


def widening(start, end, h, growth=1.15):
    """Number of cells from `start` to `end` and their ratio, the first of size about h and each larger than the last."""
    cells = max(2, math.ceil(math.log(1 + (end - start) * (growth - 1) / h) / math.log(growth)))
    low, high = 1.0, growth
    for _ in range(60):
        ratio = (low + high) / 2
        size = (end - start) * (ratio - 1) / (ratio**cells - 1) if ratio > 1 else (end - start) / cells
        low, high = (ratio, high) if size > h else (low, ratio)
    return cells, ratio


def strip_deck(h, width, depth, fine, rough=False, surcharge=False):
    """The ground under a strip, with cells of size h in a region of the size `fine`, which holds the mechanism."""
    cells, ratio = widening(fine[0], width, h)
    columns = f"{{to: {fine[0]}, cells: {round(fine[0] / h)}}}, {{to: {width}, cells: {cells}, ratio: {ratio!r}}}"
    cells, ratio = widening(fine[1], depth, h)
    rows = f"{{to: {depth - fine[1]}, cells: {cells}, ratio: {1 / ratio!r}}}, {{to: {depth}, cells: {round(fine[1] / h)}}}"
    rows += f", {{to: {depth + 0.5}, cells: {round(0.5 / h)}}}"
    words = {"COLUMNS": columns, "ROWS": rows, "WIDTH": width, "HEIGHT": depth + 0.5, "BELOW": depth - 0.001, "ABOVE": depth + 0.001}
    words |= {"FRICTION": decks.ROUGH if rough else "", "SURCHARGE": decks.SURCHARGE if surcharge else "",
              "INITIAL": decks.INITIAL if surcharge else "", "DEPTH": depth}
    return filled(decks.STRIP, **words)


def n_q(phi):
    """Prandtl's and Reissner's factor of the surcharge."""
    t = math.radians(phi)
    return math.tan(math.pi / 4 + t / 2) ** 2 * math.exp(math.pi * math.tan(t))


def n_c(phi):
    return (n_q(phi) - 1) / math.tan(math.radians(phi))


def strip_loads(found):
    """Pressures on the strip, in units of c, or of the surcharge."""
    return [-force / 1000 for force in found.column("strip_fy")]


def bearing_rows(program, folder, cases, finest):
    for label, grids, phi, exact, shift, (width, depth, fine), options, settings in cases:
        values = []
        for h in [0.5, 0.25, 0.125][: min(finest, grids)]:
            deck = strip_deck(h, width, depth, fine, **options)
            found = run(program, folder, deck, **({"phi": phi, "psi": phi} | settings))
            loads, time = strip_loads(found), found.column("time")
            before = max(load for load, t in zip(loads, time) if t <= 1.8 + 1e-9)
            values.append(loads[-1] + shift)
            errors = [value / exact - 1 for value in values]
            rise = 100 * (loads[-1] - before) / loads[-1]
            settled = -float(found.rows[-1]["middle_uy"]) / 2
            yield [label, f"B/{round(2 / h)}", values[-1], exact, 100 * errors[-1], order(errors), extrapolated(values),
                   rise, f"{100 * settled:.2f}", *found.cost]


def bearing(program, folder, finest):
    # Width, depth, and the size of the region with fine cells: Hill's mechanism is 3.5, 4.2 and 5.3 wide.
    sizes = {20: (8, 4, (4, 2)), 25: (10, 5, (4.5, 2)), 30: (14, 7, (5.5, 2.5))}
    one = {"n": 1, "to": 0.0005, "steps": 6}
    cases = [(f"N_c, φ = ψ = {phi}°, 1 point", grids, phi, n_c(phi), 0, sizes[phi], {}, one)
             for phi, grids in ((20, 3), (25, 2), (30, 2))]
    cases += [("N_c, φ = ψ = 20°, 1 point, rough", 3, 20, n_c(20), 0, (12, 6, (7, 3)), {"rough": True}, one)]
    # The pressure of the strip adds to the surcharge; both are in units of the surcharge.
    soft = {"cohesion": 0, "young": 1e8, "to": 0.002}
    cases += [("N_q, φ = ψ = 30°, 1 point", 2, 30, n_q(30), 1, sizes[30], {"surcharge": True}, one | soft)]
    at_20 = (20, n_c(20), 0, sizes[20], {})
    cases += [("N_c, φ = 20°, ψ = 0, 2 × 2 points", 2, *at_20, {"psi": 0}), ("N_c, φ = ψ = 20°, 2 × 2 points", 2, *at_20, {}),
              ("N_c, φ = ψ = 20°, 3 × 3 points", 2, *at_20, {"n": 3}),
              ("N_c, φ = ψ = 20°, 2 × 2 points, standard", 2, *at_20, {"volumetric": "standard"})]
    headings = ["case", "h", "factor", "exact", "error %", "order", "extrapolated", "rise %",
                "settlement % of B", "steps", "cuts", "CPU s"]
    print_table("Bearing capacity factors", headings, bearing_rows(program, folder, cases, finest))


# Thick cylinder


def cylinder_pressure(phi, psi, radius, u):
    """Pressure over c that widens a rigid-plastic cylinder of radii 1 and 3 and so moves the point at `radius` by u.

    Equilibrium dσ_r/dr = (σ_θ - σ_r)/r with the yield condition σ_r = α σ_θ + Y in pressures, and flow with
    dε_θ = -β dε_r in extensions, which makes r^(1 + 1/β) grow by the same amount everywhere."""
    ratio = lambda angle: math.tan(math.pi / 4 + math.radians(angle) / 2) ** 2
    exponent = 1 + 1 / ratio(psi)
    growth = (radius + u) ** exponent - radius**exponent
    inner, outer = ((side**exponent + growth) ** (1 / exponent) for side in (1, 3))
    if phi == 0:
        return 2 * math.log(outer / inner)
    alpha = ratio(phi)
    return 2 * math.sqrt(alpha) / (alpha - 1) * ((outer / inner) ** ((alpha - 1) / alpha) - 1)


def cylinder_rows(program, folder, finest):
    for label, phi, psi, settings in [("Tresca", 0, 0, {}), ("φ = 30°, ψ = 0", 30, 0, {}), ("φ = 30°, ψ = 15°", 30, 15, {"steps": 40}),
                                      ("φ = ψ = 30°", 30, 30, {}), ("φ = 30°, ψ = 0, MPM", 30, 0, {"method": "mpm"})]:
        law = "model: mohr-coulomb, friction_angle: \"${phi}\", dilation_angle: \"${psi}\"" if phi else "model: tresca"
        errors = []
        for h in [0.25, 0.125, 0.0625, 0.03125][:finest]:
            found = run(program, folder, filled(decks.CYLINDER, MODEL=law), h=h, phi=phi, psi=psi, **settings)
            moved, loads = found.column("inside_ux"), found.column("load_factor")
            probe = 1 + h / 4  # the innermost of two points in a cell
            along = [load / cylinder_pressure(phi, psi, probe, u) - 1 for u, load in zip(moved, loads) if u > 0.049]
            # Domains and points pass grid lines, which shakes the pressure; the mean is what converges.
            errors.append(sum(along) / len(along))
            exact = cylinder_pressure(phi, psi, probe, moved[-1])
            yield [label, h, loads[-1], exact, 100 * errors[-1], order(errors), 100 * min(along), 100 * max(along), *found.cost]


def cylinder(program, folder, finest):
    headings = ["case", "h/a", "p/c at the end", "exact", "mean error %", "order", "least %", "largest %", "steps", "cuts", "CPU s"]
    print_table("Thick cylinder, widened from 1 to 1.5", headings, cylinder_rows(program, folder, finest))


# Softening


def softening_rows(program, folder, finest):
    for label, band in [("band = H/8", ", band: 0.125"), ("no band", "")]:
        peaks, ends = [], []
        for h in [0.25, 0.125, 0.0625][:finest]:
            law = decks.SOFTENING.replace(" BAND", band)
            deck = filled(decks.CUT, SOFTENING=law, WEIGHT=-1, STEPS=decks.SETTLEMENT)
            found = run(program, folder, deck, h=h, young=500, to=0.1)
            settled, loads = [-u for u in found.column("crest_uy")], found.column("load_factor")
            at = lambda u: min(zip(settled, loads), key=lambda pair: abs(pair[0] - u))[1]
            peaks.append(max(loads))
            ends.append(loads[-1])
            yield [label, h, peaks[-1], *map(at, (0.01, 0.02, 0.05)), ends[-1], *found.cost]


def softening(program, folder, finest):
    headings = ["case", "h/H", "peak", "at 0.01 H", "0.02 H", "0.05 H", "0.1 H", "steps", "cuts", "CPU s"]
    print_table("Vertical cut in softening clay: γH/c over the settlement", headings, softening_rows(program, folder, finest))


# Cam-clay


def point_fields(path):
    """Arrays of a VTU file of `mpm` by name, one row per point, with the positions as `Points`."""
    import zlib
    import xml.etree.ElementTree as ElementTree

    import numpy

    text, _, data = path.read_bytes().partition(b'<AppendedData encoding="raw">')
    data = data[data.index(b"_") + 1 :]
    fields = {}
    piece = ElementTree.fromstring(text + b"</VTKFile>").find(".//Piece")
    for array in [*piece.find("Points"), *piece.find("PointData")]:
        start = int(array.get("offset"))
        blocks = int(numpy.frombuffer(data, "<u8", 1, start)[0])
        sizes = numpy.frombuffer(data, "<u8", blocks, start + 24)
        start, raw = start + 24 + 8 * blocks, b""
        for size in map(int, sizes):
            raw, start = raw + zlib.decompress(data[start : start + size]), start + size
        kind = numpy.dtype(array.get("type").lower()).newbyteorder("<")
        fields[array.get("Name")] = numpy.frombuffer(raw, kind).reshape(-1, int(array.get("NumberOfComponents", 1)))
    return fields


PATHS = {  # settings of the deck, and the strains of `mpm element` along x and z per strain of the plate on the right
    "oedometer": ({"to": 0.2}, (0, 0)),
    "biaxial compression by two plates": ({"to": 0.2, "lateral": 0.1}, (1, 0)),
    "isotropic compression of a cylinder": ({"to": 0.1, "lateral": 0.1, "k0": 1, "idealisation": "axisymmetric"}, (1, 1)),
    "triaxial extension of a cylinder": ({"to": -0.1, "lateral": 0.05, "k0": 1, "idealisation": "axisymmetric"}, (1, 1)),
}
PRESSED = {  # settings of the deck with a pressure on one side, and the path of `mpm element`
    "drained triaxial test": ({"idealisation": "axisymmetric"}, "triaxial-drained"),
    "drained triaxial test, K₀ = 0.6": ({"idealisation": "axisymmetric", "k0": 0.6}, "triaxial-drained"),
    "drained triaxial test, OCR = 8": ({"idealisation": "axisymmetric", "ocr": 8}, "triaxial-drained"),
    "drained biaxial test": ({"idealisation": "plane-strain"}, "biaxial"),
}


def element_row(program, found, *options, **settings):
    """The last row that `mpm element` finds for the material of the deck that was run."""
    command = [program, "element", found.folder / "deck.yaml", "--confining", "60e3", "--output", "-", *map(str, options)]
    for name, value in settings.items():
        command += ["--set", f"{name}={value}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return list(csv.DictReader(done.stdout.splitlines()))[-1]


def deviations(found, row):
    """Largest relative deviations of all points at the end from the row of `mpm element`: of the normal stresses and of the
    preconsolidation pressure; then both in the row."""
    import numpy

    fields = point_fields(max((found.folder / "out").glob("points_*.vtu")))
    stress = numpy.array([float(row[f"stress_{c}"]) for c in ("xx", "yy", "zz")])
    preconsolidation = float(row["preconsolidation_pressure"])
    of_stress = numpy.abs(fields["cauchy_stress"][:, :3] / stress - 1).max()
    of_size = numpy.abs(fields["preconsolidation_pressure"] / preconsolidation - 1).max()
    return float(of_stress), float(of_size), stress, preconsolidation


def block_errors(program, folder, path, **settings):
    """What `deviations` finds after moving the plates along a path of `PATHS`."""
    own, (along_x, along_z) = PATHS[path]
    settings, steps = own | settings, 20
    found = run(program, folder, filled(decks.BLOCK, MATERIAL=decks.CAM_CLAY), **settings)
    shares = [k / steps for k in range(1, steps + 1)]
    lateral, axial = ([math.log(1 - settings.get(name, 0) * share) for share in shares] for name in ("lateral", "to"))
    lines = ["xx,yy,zz"] + [f"{along_x * x!r},{y!r},{along_z * x!r}" for x, y in zip(lateral, axial)]
    (found.folder / "path.csv").write_text("\n".join(lines) + "\n")
    options = ["--path", "strain", "--steps", 1, "--file", found.folder / "path.csv", "--k0", settings.get("k0", 0.6)]
    return deviations(found, element_row(program, found, *options))


def pressed_errors(program, folder, test, **settings):
    """What `deviations` finds after a test of `PRESSED`, whose points and `mpm element` take the same steps of strain."""
    own, path = PRESSED[test]
    settings = own | settings
    found = run(program, folder, filled(decks.CELL, MATERIAL=decks.CAM_CLAY), **settings)
    options = ["--path", path, "--to", 0.2, "--steps", 20, "--k0", settings.get("k0", 1)]
    return deviations(found, element_row(program, found, *options, **settings))


def pressures(stress, size):
    return [", ".join(f"{-value / 1e3:.1f}" for value in stress), f"{size / 1e3:.1f}"]


def block_rows(program, folder):
    for path in PATHS:
        mean = "mean-dilatation"
        for method, treatment in [("mpm", "standard"), ("mpm", mean), ("gimp", mean), ("cpdi2", mean)]:
            *errors, stress, size = block_errors(program, folder, path, method=method, volumetric=treatment)
            yield [path, method, treatment, *pressures(stress, size), *(f"{error:.1e}" for error in errors)]


def pressed_rows(program, folder):
    for test in PRESSED:
        for method, treatment, columns in [("mpm", "standard", 2), ("gimp", "standard", 2), ("cpdi2", "standard", 2),
                                           ("cpdi2", "standard", 0.25), ("cpdi2", "mean-dilatation", 0.25),
                                           ("gimp", "standard", 0.25)]:
            settings = {"method": method, "volumetric": treatment, "columns": columns}
            *errors, stress, size = pressed_errors(program, folder, test, **settings)
            yield [test, method, treatment, columns, *pressures(stress, size), *(f"{error:.1e}" for error in errors)]


def block(program, folder, finest):
    headings = ["path", "method", "treatment", "pressures x, y, z (kPa)", "P_c (kPa)", "error of stress", "error of P_c"]
    print_table("Cam-clay between plates: largest relative deviation from `mpm element`", headings, block_rows(program, folder))
    headings.insert(3, "columns")
    print_table("Cam-clay under a pressure on its side", headings, pressed_rows(program, folder))


STUDIES = {"slope": slope, "clay-slope": clay_slope, "weak-layer": weak_layer, "bearing": bearing, "cylinder": cylinder,
           "cut": cut, "softening": softening, "block": block}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", choices=[[], *STUDIES], metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--mpm", default=os.environ.get("MPM", ROOT / "target/release/mpm"), help="the program")
    parser.add_argument("--finest", type=int, default=4, help="number of grids of each study")
    options = parser.parse_args()
    for name in options.studies or STUDIES:
        with tempfile.TemporaryDirectory() as folder:
            STUDIES[name](options.mpm, folder, options.finest)


if __name__ == "__main__":
    main()
