"""Limit loads of bodies that flow at constant volume, by every treatment of locking, beside exact values.

    python3 benches/locking.py [CASE ...] [--mpm target/release/mpm] [--csv FILE] [--finest 0.125] [--quick]

Writes a deck for each case into a temporary folder, runs it over methods, treatments, numbers of points and spacings on
one thread, and prints a table for each case; `--csv` adds all rows to a file. `--quick` runs MPM with 2 x 2 points only.
All cases take about half an hour of CPU time.

All bodies are von Mises material that flows in shear at c, in plane strain the material of Tresca. Displacements are so
small that the shape of the body does not matter. The limit load is the load at the end of the displacement; `rise` is
its growth over the last fifth, which is large where the load has no limit.

Nodes that are held together stop moving only one cell further on. Where nodes hold the footing or the ligament, the
table has two errors: one of the load over the true width, and one of the load over the integral of the basis functions
of the held nodes, half a cell more on each free side. A load on a surface needs no such choice.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import tempfile
from dataclasses import dataclass
from typing import Callable

ROOT = pathlib.Path(__file__).resolve().parent.parent
PRANDTL = 2 + math.pi
COHESION = 1000.0
YIELD_STRESS = 0.45  # of the plate
SPACINGS = [0.5, 0.25, 0.125, 0.0625]

# Half of the ground under a strip footing of half width 1, or under a circular footing of radius 1.
GROUND = """
version: 1
parameters: {h: 0.25, n: 2, method: mpm, volumetric: mean-dilatation, idealisation: plane-strain,
             steps: 10, to: 0.0005, every: 0}
analysis: {idealisation: "${idealisation}"}
grid: {type: structured, origin: [0, 0], size: [5, 3.5], spacing: "${h}"}
materials:
  clay: {model: von-mises, young: 1e8, poisson: 0.49, deviatoric_yield_stress: "${sqrt(2)*1000}"}
bodies:
  - {name: soil, material: clay, shape: {type: box, min: [0, 0], max: [5, 3]}, method: "${method}",
     points_per_cell: "${n}", strain: "${volumetric}"}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
"""
NODES = """
  - {name: footing, nodes: {box: {min: [0, 3], max: [1, 3]}}, FIX uy: "${-to}"}
steps: {count: "${steps}"}
output: {every: "${every}"}
"""
SURFACE = """
  - {name: footing, surface: strip, FIX uy: "${-to}"}
surfaces:
  - {name: strip, body: soil, part: {box: {min: [0, 2.999], max: [1, 3.001]}}}
steps: {count: "${steps}"}
output: {every: "${every}"}
"""
PRESSURE = """
  FRICTION
surfaces:
  - {name: strip, body: soil, part: {box: {min: [0, 2.999], max: [1, 3.001]}}}
loads:
  - {name: strip, type: traction, surface: strip, traction: [0, -1000]}
steps: {count: "${steps}", control: {type: displacement, probe: middle, axis: y, to: "${-to}"}}
output: {every: "${every}", probes: [{name: middle, body: soil, nearest: [0, 3]}]}
"""
FRICTION = "- {name: friction, nodes: {box: {min: [0, 3], max: [1, 3]}}, fix: [x]}"

# The footing as a body of points, 10⁴ times as stiff as the ground and pressed at its top.
CONCRETE = "  concrete: {model: hencky, young: 1e12, poisson: 0.2}\n"
BLOCK = """  - {name: block, material: concrete, shape: {type: box, min: [0, 3], max: [1, 3.5]}, method: "${method}",
     points_per_cell: "${n}"}
"""

# A quarter of the ground under a circular footing in space; the footing is added row by row.
QUARTER = """
version: 1
parameters: {h: 0.5, n: 2, method: mpm, volumetric: mean-dilatation, steps: 5, to: 0.0005, every: 0}
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [3, 3, 2.5], spacing: "${h}"}
materials:
  clay: {model: von-mises, young: 1e8, poisson: 0.49, deviatoric_yield_stress: "${sqrt(2)*1000}"}
bodies:
  - {name: soil, material: clay, shape: {type: box, min: [0, 0, 0], max: [3, 3, 2]}, method: "${method}",
     points_per_cell: "${n}", strain: "${volumetric}"}
steps: {count: "${steps}"}
output: {every: "${every}"}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: right, nodes: {x: 3}, fix: [x]}
  - {name: rear, nodes: {y: 3}, fix: [y]}
  - {name: base, nodes: {z: 0}, fix: [x, y, z]}
"""

# A quarter of a plate, 10 wide and 30 high, whose notches leave a ligament of width 1. Young's modulus is 100 times that of
# steel, so that the load reaches its limit before the ligament thins; the limit does not depend on it.
PLATE = """
version: 1
parameters: {h: 0.125, n: 2, method: mpm, volumetric: mean-dilatation, steps: 20, to: 0.002, young: 20690, every: 0}
grid:
  type: structured
  origin: [0, 0]
  size: [5, 15]
  spacing:
    - [{to: 2, cells: "${2/h}"}, {to: 5, cells: "${1/h}", ratio: "${2^(2*h)}"}]
    - [{to: 1, cells: "${1/h}"}, {to: 15, cells: "${2/h}", ratio: "${2^(2*h)}"}]
materials:
  steel: {model: von-mises, young: "${young}", poisson: 0.29, deviatoric_yield_stress: "${sqrt(2/3)*0.45}"}
bodies:
  - {name: plate, material: steel, method: "${method}", points_per_cell: "${n}", strain: "${volumetric}",
     shape: {type: box, min: [0, 0], max: [5, 15]}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: ligament, nodes: {box: {min: [0, 0], max: [0.5, 0]}}, fix: [y]}
  - {name: end, nodes: {y: 15}, uy: "${to}"}
steps: {count: "${steps}"}
output: {every: "${every}"}
"""
# A vertical cut of height 1 in deep ground, whose weight grows.
CUT = """
version: 1
parameters: {h: 0.25, n: 2, method: mpm, volumetric: mean-dilatation, steps: 20, to: 0.0002, every: 0}
grid: {type: structured, origin: [0, 0], size: [3.5, 2.5], spacing: "${h}"}
materials:
  clay: {model: von-mises, young: 1e8, poisson: 0.49, deviatoric_yield_stress: "${sqrt(2)*1000}", density: 1000}
bodies:
  - {name: soil, material: clay, method: "${method}", points_per_cell: "${n}", strain: "${volumetric}",
     shape: {type: polygon, vertices: [[0, 0], [3.5, 0], [3.5, 1], [2, 1], [2, 2], [0, 2]]}}
boundary_conditions:
  - {name: back, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {x: 3.5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -1]}
steps: {count: "${steps}", control: {type: displacement, probe: crest, axis: y, to: "${-to}"}}
output: {every: "${every}", probes: [{name: crest, body: soil, nearest: [2, 2]}]}
"""


def stiff_block(h):
    text = GROUND.replace("materials:\n", "materials:\n" + CONCRETE)
    text = text.replace("boundary_conditions:\n", BLOCK + "boundary_conditions:\n").rstrip("\n")
    return text + NODES.replace("FIX ", ROUGH).replace("[0, 3], max: [1, 3]", "[0, 3.5], max: [1, 3.5]")


def held_rows(h):
    """Boundary conditions that hold the nodes of a quarter of a disc of radius 1, one for each row of nodes."""
    rows = []
    for j in range(round(1 / h) + 1):
        reach = math.floor(math.sqrt(1 - (j * h) ** 2) / h + 1e-9) * h
        box = f"{{min: [0, {j * h}, 2], max: [{reach}, {j * h}, 2]}}"
        rows.append(f'  - {{name: row{j}, nodes: {{box: {box}}}, fix: [x, y], uz: "${{-to}}"}}\n')
    return "".join(rows)


def held_area(h):
    """Integral of the basis functions of the nodes that `held_rows` holds."""
    area = 0.0
    for j in range(round(1 / h) + 1):
        reach = math.floor(math.sqrt(1 - (j * h) ** 2) / h + 1e-9)
        area += (0.5 if j == 0 else 1) * (reach + 0.5) * h**2
    return area


@dataclass
class Case:
    title: str
    deck: Callable[[float], str]
    load: str  # column of history.csv, or the start of the names of several
    unit: float  # by which the load is divided
    exact: float
    source: str
    spacings: list
    # Integral of the basis functions of the held nodes over the true width or area.
    widening: Callable[[float], float] | None = None
    settings: tuple = ()
    runs: str = "few"  # `all`, `few`, `one`


def ground(end, fix="", friction=""):
    friction = f"  {friction}\n" if friction else ""
    text = GROUND.rstrip("\n") + end.replace("FIX ", fix).replace("  FRICTION\n", friction)
    return lambda h: text


ROUGH = "fix: [x], "
PI_C = COHESION * math.pi
STRIP = "Prandtl (1920)"
# The exact load, 6.048 c (Eason and Shield 1960), is that of Tresca. The surface of von Mises lies between the hexagons of
# Tresca for c and for cos 30° c, so its load is between 5.238 c and 6.048 c. The value is that of `limit_analysis.py`.
ROUGH_CIRCLE = 5.515
CIRCLE = "limit analysis for von Mises, ± 0.02"
CASES = {
    "strip-rough": Case("Rough strip footing, uniform pressure", ground(PRESSURE, friction=FRICTION), "base_ry", COHESION,
                        PRANDTL, STRIP, SPACINGS, runs="all"),
    "strip-smooth": Case("Smooth strip footing, uniform pressure", ground(PRESSURE), "base_ry", COHESION,
                         PRANDTL, STRIP, SPACINGS),
    "nodes-rough": Case("Rough strip footing held by nodes", ground(NODES, ROUGH), "footing_ry", COHESION,
                        PRANDTL, STRIP, SPACINGS, lambda h: 1 + h / 2, runs="all"),
    "nodes-smooth": Case("Smooth strip footing held by nodes", ground(NODES), "footing_ry", COHESION,
                         PRANDTL, STRIP, SPACINGS, lambda h: 1 + h / 2),
    "surface-rough": Case("Rough strip footing held by its surface", ground(SURFACE, ROUGH), "footing_ry", COHESION,
                          PRANDTL, STRIP, SPACINGS, runs="one"),
    "surface-smooth": Case("Smooth strip footing held by its surface", ground(SURFACE), "footing_ry", COHESION,
                           PRANDTL, STRIP, SPACINGS, runs="one"),
    "block-rough": Case("Rough strip footing of stiff points", stiff_block, "footing_ry", COHESION, PRANDTL, STRIP,
                        SPACINGS, lambda h: 1 + h / 2, runs="one"),
    "notch": Case("Double-edge-notched plate, ligament held by nodes", lambda h: PLATE,
                  "ligament_ry", 0.5, PRANDTL / math.sqrt(3) * YIELD_STRESS, "Nagtegaal et al. (1974)",
                  [0.125, 0.0625, 0.03125], lambda h: 1 + h),
    "cut": Case("Vertical cut", lambda h: CUT, "load_factor", 1, 3.776, "bounds 3.772 and 3.778",
                [0.25, 0.125, 0.0625, 0.03125]),
    "circle": Case("Rough circular footing held by nodes, body of revolution", ground(NODES, ROUGH), "footing_ry", PI_C,
                   ROUGH_CIRCLE, CIRCLE, SPACINGS, lambda h: 1 + h + h**2 / 3, ("idealisation=axisymmetric",)),
    "space": Case("Rough circular footing held by nodes, a quarter in space", lambda h: QUARTER + held_rows(h), "row",
                  PI_C / 4, ROUGH_CIRCLE, CIRCLE, [0.5, 0.25, 0.125], lambda h: held_area(h) / (math.pi / 4), runs="one"),
}


def combinations(runs, quick):
    """Methods, treatments and numbers of points per cell along an axis."""
    one = [("mpm", "standard", 2), ("mpm", "mean-dilatation", 2)]
    if quick:
        return one
    few = [("mpm", "standard", 2), ("gimp", "standard", 2)]
    few += [("mpm", "mean-dilatation", n) for n in (2, 3, 4)]
    few += [("mpm", "f-bar", 2), ("gimp", "mean-dilatation", 2), ("gimp", "f-bar", 2)]
    few += [("cpdi1", "mean-dilatation", 2), ("cpdi2", "mean-dilatation", 2)]
    if runs == "one":
        return one + [("mpm", "mean-dilatation", 3), ("mpm", "f-bar", 2), ("gimp", "mean-dilatation", 2)]
    if runs == "few":
        return few
    every = [(method, "standard", n) for method, n in (("mpm", 2), ("mpm", 3), ("gimp", 2), ("cpdi2", 2))]
    every += [(method, "mean-dilatation", n) for method in ("mpm", "gimp", "cpdi1", "cpdi2") for n in (2, 3, 4)]
    return every + [(method, "f-bar", n) for method in ("mpm", "gimp") for n in (2, 3)]


@dataclass
class Outcome:
    """What a run found: loads over the steps in equilibrium, in units of the case, and what they cost."""

    time: list
    loads: list
    summary: dict
    widening: float

    @property
    def load(self):
        return self.loads[-1]

    @property
    def effective(self):
        return self.load / self.widening

    @property
    def rise(self):
        """Growth of the load over the last fifth, relative to its end."""
        before = max((load for time, load in zip(self.time, self.loads) if time <= 0.8 * self.time[-1] + 1e-9), default=0)
        return (self.load - before) / self.load


def run(program, name, folder, h, **settings):
    """Runs a case in a folder; raises RuntimeError if no step is in equilibrium."""
    case, folder = CASES[name], pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    deck, out = folder / f"{name}.yaml", folder / "out"
    deck.write_text(case.deck(h))
    command = [program, "run", deck, "--threads", "1", "--out", out, "--set", f"h={h}"]
    for setting in [*case.settings, *(f"{key}={value}" for key, value in settings.items())]:
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True)
    return outcome(case, out, h, done.stderr)


def outcome(case, out, h, message=""):
    if not (out / "history.csv").exists():
        raise RuntimeError(message)
    with open(out / "history.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
    if not rows:
        raise RuntimeError(message)
    names = [key for key in rows[0] if key == case.load or key.startswith(case.load) and key.endswith("_rz")]
    loads = [abs(sum(float(row[key]) for key in names)) / case.unit for row in rows]
    summary = json.loads((out / "summary.json").read_text())
    return Outcome([float(row["time"]) for row in rows], loads, summary, case.widening(h) if case.widening else 1.0)


HEADINGS = ["case", "method", "treatment", "n", "h", "load", "exact", "error %", "order", "effective", "error of it %",
            "order of it", "rise %", "steps", "cuts", "iterations", "CPU s"]


def order(errors, spacings):
    """Order of convergence from the last two errors; none at the first or where they have different signs."""
    if len(errors) < 2 or not errors[-1] * errors[-2] > 0:
        return math.nan
    return math.log(errors[-2] / errors[-1]) / math.log(spacings[-2] / spacings[-1])


def rows_of(program, name, combination, finest):
    """Rows of the table for one combination over all spacings."""
    case, (method, treatment, n) = CASES[name], combination
    done, raw, effective = [], [], []
    for h in case.spacings:
        if h < finest:
            continue
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = run(program, name, folder, h, method=method, volumetric=treatment, n=n)
            except RuntimeError as error:
                yield [name, method, treatment, n, h, f"fails: {str(error).strip().splitlines()[0]}"]
                continue
        done.append(h)
        raw.append(found.load / case.exact - 1)
        effective.append(found.effective / case.exact - 1)
        of_effective = [found.effective, 100 * effective[-1], order(effective, done)]
        if case.widening is None:
            of_effective = [math.nan] * 3
        of_summary = [found.summary[key] for key in ("steps", "failed_attempts", "linear_solves")]
        yield [name, method, treatment, n, h, found.load, case.exact, 100 * raw[-1], order(raw, done), *of_effective,
               100 * found.rise, *of_summary, found.summary["cpu_seconds"]["total"]]
        if found.time[-1] < 1 - 1e-9:
            yield [name, method, treatment, n, h, f"stops at {100 * found.time[-1]:.0f} %: {found.summary['reason']}"]


def shown(value):
    if isinstance(value, float):
        return "–" if math.isnan(value) else f"{value:.4g}"
    return str(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[[], *CASES], metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--mpm", default=ROOT / "target/release/mpm", help="the program")
    parser.add_argument("--csv", type=pathlib.Path, help="file to which the rows are added")
    parser.add_argument("--finest", type=float, default=0, help="no grid finer than this")
    parser.add_argument("--quick", action="store_true", help="MPM with 2 x 2 points only")
    options = parser.parse_args()
    for name in options.cases or CASES:
        case = CASES[name]
        print(f"\n### {case.title}\n\nExact: {shown(case.exact)} ({case.source})\n")
        print("| " + " | ".join(HEADINGS[1:]) + " |\n|" + "---|" * (len(HEADINGS) - 1))
        for combination in combinations(case.runs, options.quick):
            for cells in rows_of(options.mpm, name, combination, options.finest):
                print("| " + " | ".join(map(shown, cells[1:])) + " |", flush=True)
                if options.csv:
                    new = not options.csv.exists()
                    with open(options.csv, "a", newline="") as file:
                        csv.writer(file).writerows([HEADINGS, cells] if new else [cells])


if __name__ == "__main__":
    main()
