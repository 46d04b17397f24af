"""Capacities of soils with friction on grids of halved cells, beside exact values.

    python3 benches/capacity.py [CASE ...] [--mpm target/release/mpm] [--cells 8,16] [--methods mpm,gimp,cpdi2]
                                [--edge 4] [--csv capacity.csv]

Runs each case on several grids, on one thread, and prints a line per run: the capacity over the exact one, its bracket,
and what it cost; for the last two grids, also the order of the error and the extrapolated value. All soils flow with
their friction angle as the dilation angle, and all points of a cell take its mean increment (`strain: mean`). Footings are
held nodes; `cells` are those across the width or radius of a footing, or the height of a slope, and cells at the edge of a
footing are `edge` times smaller. Without names, all cases run, which takes several hours.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import tempfile
import time
from dataclasses import dataclass, field

ROOT = pathlib.Path(__file__).resolve().parent.parent
YOUNG = 1e7
GAMMA, STRESS = 20.0, 10.0  # unit weight; cohesion or surcharge

# Half of the ground under a strip footing of half width 1, loaded by one of cohesion, surcharge and weight alone.
STRIP = """
version: 1
parameters: {h: 0.25, edge: 4, n: 2, method: mpm, strain: mean, phi: 30, c: 0, q: 0, gamma: 0, to: 0.001, W: 10, D: 5}
grid: {type: structured, origin: [0, 0], size: ["${W}", "${D+0.5}"], spacing: "${h}",
       refine: [{at: [1, "${D}"], to: "${h/edge}"}]}
materials:
  soil: {model: mohr-coulomb, young: 1e7, poisson: 0.3, cohesion: "${c}", friction_angle: "${phi}",
         dilation_angle: "${phi}", density: "${gamma/10}"}
bodies:
  - {name: ground, material: soil, method: "${method}", strain: "${strain}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: ["${W}", "${D}"]}, STRESS}
surfaces: [{name: top, body: ground, part: {box: {min: [0, "${D}"], max: ["${W}", "${D}"]}}}]
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: "${W}"}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: footing, nodes: {box: {min: [0, "${D}"], max: [1, "${D}"]}}, uy: "${-to}"ROUGH}
loads:
LOADS
steps: {count: 40, until: limit}
solver: {predictor: last-step}
output: {every: 0}
"""
GEOSTATIC = 'initial_stress: {type: geostatic, surface: "${D}", k0: 1}'
UNIFORM = 'initial_stress: {type: components, stress: {xx: "${-q}", yy: "${-q}", zz: "${-q}"}}'
WEIGHT = "  - {name: weight, type: gravity, acceleration: [0, -10]}"
SURCHARGE = '  - {name: surcharge, type: traction, surface: top, traction: [0, "${-q}"], curve: [[0, 1], [1, 1]]}'

# Half of the meridian plane under a smooth circular footing of radius 1 (Cox et al. 1961).
CIRCLE = """
version: 1
parameters: {h: 0.25, edge: 4, n: 2, method: mpm, strain: mean, phi: 30, c: 1.6, gamma: 16, to: 0.004}
analysis: {idealisation: axisymmetric}
grid: {type: structured, origin: [0, 0], size: [6, 4.5], spacing: "${h}", refine: [{at: [1, 4], to: "${h/edge}"}]}
materials:
  soil: {model: mohr-coulomb, young: 240000, poisson: 0.2, cohesion: "${c}", friction_angle: "${phi}",
         dilation_angle: "${phi}", density: "${gamma/10}"}
bodies:
  - {name: ground, material: soil, method: "${method}", strain: "${strain}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [6, 4]}, STRESS}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 6}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: footing, nodes: {box: {min: [0, 4], max: [1, 4]}}, uy: "${-to}"}
LOADS
steps: {count: 40, until: limit}
solver: {predictor: last-step}
output: {every: 0}
"""

# A quarter of the ground under a smooth square footing of half width 1 on Tresca's material.
SQUARE = """
version: 1
parameters: {h: 0.25, edge: 1, n: 2, method: mpm, strain: mean, to: 0.012}
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [3, 3, 2.25], spacing: "${h}",
       refine: [{at: [1, 1, 2], to: "${h/edge}"}]}
materials: {clay: {model: tresca, young: 2.57e5, poisson: 0.285, cohesion: 100}}
bodies:
  - {name: ground, material: clay, method: "${method}", strain: "${strain}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0, 0], max: [3, 3, 2]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: right, nodes: {x: 3}, fix: [x, y, z]}
  - {name: rear, nodes: {y: 3}, fix: [x, y, z]}
  - {name: base, nodes: {z: 0}, fix: [x, y, z]}
  - {name: footing, nodes: {box: {min: [0, 0, 2], max: [1, 1, 2]}}, uz: "${-to}"}
steps: {count: 40, until: limit}
solver: {predictor: last-step}
output: {every: 0}
"""

# A slope under its weight: one at 45 degrees whose factor is 1 (Dawson et al. 1999), and examples 1 and 3 of Griffiths
# and Lane (1999), the latter without its weak layer.
SLOPE = """
version: 1
parameters: {h: 1, edge: 1, n: 2, method: gimp, strain: mean, phi: 20, c: 10, from: 0.8, to: 1.5}
grid: {type: structured, origin: [0, 0], size: [SIZE], spacing: "${h}"}
materials:
  soil: {model: mohr-coulomb, young: 1e5, poisson: 0.3, cohesion: "${c}", friction_angle: "${phi}",
         dilation_angle: "${phi}", density: 2}
bodies:
  - {name: slope, material: soil, method: "${method}", strain: "${strain}", points_per_cell: "${n}",
     shape: {type: polygon, vertices: [VERTICES]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: RIGHT}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
stages:
  - {name: gravity, steps: {count: 5}, factors: {weight: 1}, then: {reset: [displacement]}}
  - {name: safety, steps: {count: 10, control: {type: strength-reduction, from: "${from}", to: "${to}", tolerance: 0.005}}}
output: {every: 0}
"""

# Half of a clay layer above a trapdoor of half width 1 that is pulled down; the cover is as high as the door is wide.
TRAPDOOR = """
version: 1
parameters: {h: 0.25, edge: 4, n: 2, method: mpm, strain: mean, to: 0.002}
grid: {type: structured, origin: [0, 0], size: [5, 2.5], spacing: "${h}", refine: [{at: {x: 1}, to: "${h/edge}"}]}
materials: {clay: {model: von-mises, young: 1e5, poisson: 0.49, deviatoric_yield_stress: "${sqrt(2)*10}"}}
bodies:
  - {name: cover, material: clay, method: "${method}", strain: "${strain}", points_per_cell: "${n}",
     shape: {type: box, min: [0, 0], max: [5, 2]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 5}, fix: [x]}
  - {name: base, nodes: {box: {min: [1.0001, 0], max: [5, 0]}}, fix: [x, y]}
  - {name: door, nodes: {box: {min: [0, 0], max: [1, 0]}}, fix: [x], uy: "${-to}"}
steps: {count: 40, until: limit}
solver: {predictor: last-step}
output: {every: 0}
"""

# Bearing capacity factors of Martin (2005) for weight, rough and smooth.
N_GAMMA = {20: (2.839, 1.579), 30: (14.754, 7.653), 35: (34.476, 17.577)}


def n_q(phi):
    tangent = math.tan(math.radians(phi))
    return math.exp(math.pi * tangent) * math.tan(math.radians(45 + phi / 2)) ** 2


@dataclass
class Case:
    title: str
    deck: str
    exact: float  # of the capacity over `unit`
    source: str
    unit: float = 1.0
    added: float = 0.0  # to the load that the program states
    cells: float = 2.0  # number of cells of size 1
    settings: dict = field(default_factory=dict)
    quantity: str = "limit"


def strip(load, phi, is_rough):
    """The case of one bearing capacity factor."""
    factor = {"c": (n_q(phi) - 1) / math.tan(math.radians(phi)), "q": n_q(phi), "gamma": 0}[load]
    exact, source = factor, "Prandtl (1920), Reissner (1924)"
    if load == "gamma":
        exact, source = N_GAMMA[phi][0 if is_rough else 1], "Martin (2005)"
    weighs = load == "gamma"
    deck = STRIP.replace("STRESS", GEOSTATIC if weighs else UNIFORM).replace("LOADS", WEIGHT if weighs else SURCHARGE)
    deck = deck.replace("ROUGH", ", fix: [x]" if is_rough else "")
    value = GAMMA if weighs else STRESS
    settings = {"phi": phi, load: value, "to": float(f"{15 * exact * value / YOUNG:.3g}")}
    name = {"c": "N_c", "q": "N_q", "gamma": "N_γ"}[load]
    title = f"{name}, φ = ψ = {phi}°, {'rough' if is_rough else 'smooth'} strip"
    return Case(title, deck, exact, source, unit=value, added=value if load == "q" else 0.0, settings=settings)


CASES = {
    f"{load}-{phi}-{'rough' if is_rough else 'smooth'}": strip(load, phi, is_rough)
    for load in ("c", "q", "gamma")
    for phi in (20, 30, 35)
    for is_rough in (True, False)
}
COX = "Cox et al. (1961)"
HEAVY = CIRCLE.replace("STRESS", "initial_stress: {type: geostatic, surface: 4, k0: 0.5}")
HEAVY = HEAVY.replace("LOADS\n", "loads: [{name: weight, type: gravity, acceleration: [0, -10]}]\n")
LIGHT = CIRCLE.replace(", STRESS", "").replace("LOADS\n", "")
CASES |= {
    "cox": Case("smooth circle, φ = ψ = 30°, 10 γR/c", HEAVY, 141.0, COX, unit=1.6 * math.pi),
    "circle-30": Case("smooth circle without weight, φ = ψ = 30°", LIGHT, 49.3, COX, unit=1.6 * math.pi,
                      settings={"gamma": 0, "to": 0.002}),
    "circle-20": Case("smooth circle without weight, φ = ψ = 20°", LIGHT, 20.1, COX, unit=1.6 * math.pi,
                      settings={"gamma": 0, "phi": 20, "to": 0.001}),
    "square": Case("smooth square on Tresca's material, in space", SQUARE, 5.4, "between 5.14 and 5.71", unit=100.0),
    "dawson": Case("45° slope, φ = ψ = 20°", SLOPE.replace("SIZE", "40, 17").replace("RIGHT", "40").replace(
        "VERTICES", "[0, 0], [40, 0], [40, 5], [30, 5], [20, 15], [0, 15]"), 1.0, "Dawson et al. (1999)", cells=10.0,
        settings={"c": 12.38}, quantity="factor"),
    "griffiths-1": Case("26.6° slope, φ = ψ = 20°, c/γH = 0.05", SLOPE.replace("SIZE", "36, 12").replace(
        "VERTICES", "[0, 0], [32, 0], [12, 10], [0, 10]").replace("RIGHT", "36"), 1.38, "Bishop and Morgenstern (1960)",
        cells=10.0, settings={"from": 1}, quantity="factor"),
    "griffiths-3": Case("26.6° slope on a foundation, φ = 0, c/γH = 0.25", SLOPE.replace("SIZE", "60, 22").replace(
        "VERTICES", "[0, 0], [60, 0], [60, 10], [40, 10], [20, 20], [0, 20]").replace("RIGHT", "60"), 1.47,
        "Taylor (1937)", cells=10.0, settings={"from": 1, "c": 50, "phi": 0, "to": 1.8}, quantity="factor"),
    "trapdoor": Case("trapdoor in clay, cover as high as the door is wide", TRAPDOOR, 2.0,
                     "upper bound: two vertical planes", unit=10.0),
}


@dataclass
class Found:
    """The capacity over the unit of the case, its bracket, and what the run cost."""

    value: float
    bracket: tuple
    reached: bool
    note: str
    cpu: float


def run(program, case, h, edge, method, settings, seconds):
    with tempfile.TemporaryDirectory() as folder:
        deck, out = pathlib.Path(folder, "deck.yaml"), pathlib.Path(folder, "out")
        deck.write_text(case.deck)
        command = [program, "run", deck, "--threads", "1", "--out", out, "--set", f"h={h!r}", "--set", f"edge={edge}",
                   "--set", f"method={method}"]
        for key, value in (case.settings | settings).items():
            command += ["--set", f"{key}={value}"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds)
        if not (out / "summary.json").exists():
            raise RuntimeError(done.stderr.strip().splitlines()[0] if done.stderr.strip() else f"exit {done.returncode}")
        summary = json.loads((out / "summary.json").read_text())
    cpu = summary["cpu_seconds"]["total"]
    note = f"{summary['steps']} steps, {summary['failed_attempts']} failed, {summary['linear_solves']} solves"
    if summary.get("viscous_steps"):
        note += f", {summary['viscous_steps']} with viscosity"
    if case.quantity == "factor":
        search = summary["strength_reduction"]
        low, high = search["slides"] or (search["stands"], search["fails"] or math.nan)
        return Found(0.5 * (low + high), (low, high), search["slides"] is not None or search["fails"] is not None, note, cpu)
    limit = summary["limit_loads"][-1]
    scaled = lambda load: (abs(load) + case.added) / case.unit  # noqa: E731
    return Found(scaled(limit["load"]), tuple(map(scaled, limit["bracket"])), limit["reached"], note, cpu)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[[], *CASES], metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--mpm", default=ROOT / "target/release/mpm", help="the program")
    parser.add_argument("--cells", default="8,16", help="numbers of cells across the width, the radius or the height")
    parser.add_argument("--methods", default="mpm,gimp,cpdi2")
    parser.add_argument("--edge", default="4", help="how many times smaller cells at edges are, several to compare")
    parser.add_argument("--set", action="append", default=[], help="a parameter of all decks")
    parser.add_argument("--limit", type=float, help="seconds after which a run is given up")
    parser.add_argument("--csv", type=pathlib.Path, help="file to which the rows are added")
    options = parser.parse_args()
    settings = dict(pair.split("=", 1) for pair in options.set)
    for name in options.cases or CASES:
        case = CASES[name]
        print(f"\n{case.title}: {case.exact:.5g} ({case.source})", flush=True)
        for method in options.methods.split(","):
            for edge in options.edge.split(","):
                errors = []
                for cells in map(float, options.cells.split(",")):
                    began = time.time()
                    try:
                        found = run(options.mpm, case, case.cells / cells, edge, method, settings, options.limit)
                    except (RuntimeError, KeyError, subprocess.TimeoutExpired) as error:
                        print(f"  {method:6} {cells:4g} cells, edge {edge}: fails: {error}", flush=True)
                        continue
                    error = found.value / case.exact - 1
                    low, high = (100 * (bound / case.exact - 1) for bound in found.bracket)
                    reached = "" if found.reached else " NOT REACHED"
                    line = f"{found.value:8.4f} {100 * error:+6.2f} % ({low:+.2f} to {high:+.2f}){reached}"
                    print(f"  {method:6} {cells:4g} cells, edge {edge}: {line}; {found.note}, {found.cpu:.1f} s", flush=True)
                    if options.csv:
                        with open(options.csv, "a", newline="") as file:
                            csv.writer(file).writerow([name, method, edge, cells, found.value, case.exact, 100 * error, low,
                                                       high, found.reached, found.note, found.cpu, time.time() - began])
                    errors.append((cells, error))
                if len(errors) > 1 and errors[-1][1] * errors[-2][1] > 0:
                    (a, coarse), (b, fine) = errors[-2:]
                    order = math.log(coarse / fine) / math.log(b / a) if coarse / fine > 0 else math.nan
                    linear = fine + (fine - coarse) / (b / a - 1)
                    print(f"  {method:6} order {order:.2f}, extrapolated with order 1 {100 * linear:+.2f} %", flush=True)


if __name__ == "__main__":
    main()
