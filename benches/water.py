"""Water at rest and undrained materials against closed forms.

    python benches/water.py PROGRAM [case ...]

prints a row per case. It needs numpy and pyvista, which reads the result files. The page docs/verification/water.md shows
these numbers.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista

PROGRAM = "mpm"
METHODS = ["mpm", "gimp", "cpdi1", "cpdi2"]


def run(name, deck):
    """Runs a deck; returns its summary, the last row of its history, and its last points."""
    folder = Path(tempfile.mkdtemp(prefix=f"water-{name}-"))
    (folder / "deck.yaml").write_text(deck)
    done = subprocess.run(
        [PROGRAM, "run", str(folder / "deck.yaml"), "--out", str(folder / "out")], capture_output=True, text=True
    )
    if not (folder / "out" / "summary.json").exists():
        sys.exit(f"{name}: {done.stdout[-2000:]}\n{done.stderr[-3000:]}")
    summary = json.loads((folder / "out" / "summary.json").read_text())
    if summary["outcome"] != "completed":
        print(f"  {name}: {summary['outcome']} {summary['reason']}")
    with open(folder / "out" / "history.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
    last = {key: float(value) for key, value in rows[-1].items() if value not in ("", None)}
    reader = pyvista.get_reader(str(folder / "out" / "points.pvd"))
    reader.set_active_time_value(reader.time_values[-1])
    return summary, last, reader.read()[0]


GROUND = dict(density=1600.0, porosity=0.4, gravity=9.81, weight=9810.0, height=4.0, k0=0.6)


def column(method, level, space=False, extra="", initial=True):
    """Ground of four metres between rollers with a level of water."""
    g = GROUND
    size, high = ("[1, 1, 6]", "[1, 1, 4]") if space else ("[1, 6]", "[1, 4]")
    low = "[0, 0, 0]" if space else "[0, 0]"
    z = "z" if space else "y"
    down = f"[0, 0, -{g['gravity']}]" if space else f"[0, -{g['gravity']}]"
    sides = "\n".join(
        f"  - {{name: {axis}{side}, nodes: {{{axis}: {side}}}, fix: [{axis}]}}"
        for axis in ("xy" if space else "x")
        for side in (0, 1)
    )
    stress = f"    initial_stress: {{type: geostatic, surface: 4, k0: {g['k0']}}}\n" if initial else ""
    return f"""
version: 1
analysis: {{idealisation: {'solid' if space else 'plane-strain'}}}
grid: {{type: structured, origin: {low}, size: {size}, spacing: 0.5}}
materials:
  soil: {{model: hencky, young: 2e7, poisson: 0.3, density: {g['density']}, porosity: {g['porosity']}}}
bodies:
  - name: soil
    material: soil
    method: {method}
    shape: {{type: box, min: {low}, max: {high}}}
    points_per_cell: 2
{stress}water: {{unit_weight: {g['weight']}, level: {level}}}
boundary_conditions:
{sides}
  - {{name: base, nodes: {{{z}: 0}}, fix: [{z}]}}
loads:
  - {{name: weight, type: gravity, acceleration: {down}}}
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
{extra or 'steps: {count: 1}'}
"""


def vertical(z, level, half):
    """Effective vertical stress at height z, mean over the vertical extent of the domain of a point, [stress]."""
    g = GROUND
    lift = g["weight"] * (1 - g["porosity"])
    depth = np.clip(level - z, -half, half)
    below = np.where(level - z >= half, level - z, (depth + half) ** 2 / (4 * half))
    below = np.where(level - z <= -half, 0.0, below)
    above = max(level - g["height"], 0.0)
    return -(g["density"] * g["gravity"] * (g["height"] - z) - lift * (below - above))


def k0():
    """Ground at rest with a level anywhere."""
    print("K0 ground: level, largest error of the effective stress and of the total stress, relative to the largest; "
          "largest displacement, residual at time 0")
    for space in (False, True):
        for method in METHODS:
            for level in (0.13, 1.0, 2.3, 2.3755, 4.0, 5.2):
                summary, last, points = run("k0", column(method, level, space))
                axis = 2 if space else 1
                z = points.points[:, axis]
                stress = points.point_data["cauchy_stress"]
                total = points.point_data["total_stress"]
                exact = vertical(z, level, 0.125)
                largest = np.abs(exact).max()
                error = np.abs(stress[:, axis] - exact).max() / largest
                lateral = np.abs(stress[:, 0] - GROUND["k0"] * exact).max() / largest
                pressure = GROUND["weight"] * np.maximum(level - z, 0)
                water = np.abs(stress[:, axis] - pressure - total[:, axis]).max() / largest
                moved = np.abs(points.point_data["displacement"]).max()
                print(f"  {'space' if space else 'plane'} {method:6} {level:6} {max(error, lateral):.1e} {water:.1e} "
                      f"{moved:.1e} {summary.get('initial_state', {}).get('residual', float('nan')):.1e}")


def lift():
    """The force on the support of a body in water is its weight less its buoyancy."""
    print("body in water: level, drainage, force on the support, weight less buoyancy, relative error")
    for method in METHODS:
        for level, drainage in ((0.3137, "drained"), (5.0, "drained"), (0.3137, "dry"), (5.0, "dry")):
            pores = "drainage: dry" if drainage == "dry" else "porosity: 0.4"
            deck = f"""
version: 1
grid: {{type: structured, origin: [0, -0.5], size: [3, 2.5], spacing: 0.25}}
materials:
  stone: {{model: neo-hookean, young: 1e6, poisson: 0.2, density: 1600, {pores}}}
bodies:
  - {{name: stone, material: stone, method: {method}, shape: {{type: box, min: [1, 0], max: [2, 1]}}, points_per_cell: 2}}
water: {{unit_weight: 9810, level: {level}}}
boundary_conditions:
  - {{name: base, nodes: {{y: 0}}, fix: [x, y]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, -9.81]}}
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
steps: {{count: 2}}
"""
            _, last, points = run("lift", deck)
            found = last["base_ry"]
            grains = 0.6 if drainage == "drained" else 1.0
            volume = points.point_data["volume"]
            if level > 1:
                wet = 1.0
                expected = 1600 * 9.81 - grains * 9810 * wet
                print(f"  {method:6} {level} {drainage} {found:.10g} {expected:.10g} {found / expected - 1:.1e}")
            else:
                # The force of the water is reported, too; how deep the block stands depends on its deformation.
                water = last["water_fy"]
                expected = 1600 * 9.81 - water
                print(f"  {method:6} {level} {drainage} {found:.10g} {expected:.10g} {found / expected - 1:.1e} "
                      f"wet share {water / grains / 9810:.6f}, volume {volume.sum():.6f}")


def drawdown():
    """A level that falls in a stage loads the ground by the weight that the water no longer carries."""
    print("level 5 to 1: error of the mean effective stress of a cell, relative to the largest; settlement, closed form")
    for method in METHODS:
        extra = """stages:
  - {name: rest, steps: {count: 1}}
  - {name: fall, steps: {count: 8}, water: {level: 1}}
"""
        summary, last, points = run("drawdown", column(method, 5, False, extra))
        z = points.points[:, 1]
        exact = vertical(z, 1, 0.125)
        stress = points.point_data["cauchy_stress"][:, 1]
        # Linear cells give a constant change of stress, so that means over cells are compared.
        cell = np.floor(points.point_data["displacement"][:, 1] * -1 / 0.5 + z / 0.5).astype(int)
        means = [abs((stress - exact)[cell == k].mean()) for k in np.unique(cell)]
        error = max(means) / np.abs(exact).max()
        settled = -points.point_data["displacement"][:, 1].min()
        lift = 9810 * 0.6
        modulus = 2e7 * 0.7 / (1.3 * 0.4)
        expected = lift * (3 * 3 / 2 + 3 * 1) / modulus
        print(f"  {method:6} {error:.1e} {settled:.6e} {expected:.6e}")


def undrained():
    """The stiffness in an oedometer and Skempton's B."""
    young, poisson, whole = 1e7, 0.3, 0.495
    bulk = young / (3 * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    water = 3 * bulk * (whole - poisson) / ((1 - 2 * whole) * (1 + poisson))
    print("undrained column, load q: settlement over that of M_u = K' + 4G/3 + K_w/n; excess pressure over q K_w/n/M_u")
    for method in METHODS:
        for q in (10.0, 1e4):
            deck = f"""
version: 1
grid: {{type: structured, origin: [0, 0], size: [1, 3], spacing: 0.5}}
materials:
  clay: {{model: hencky, young: {young}, poisson: {poisson}, drainage: undrained, undrained_poisson: {whole}}}
bodies:
  - name: clay
    material: clay
    method: {method}
    strain: mean-dilatation
    shape: {{type: box, min: [0, 0], max: [1, 2]}}
    points_per_cell: 2
surfaces: [{{name: top, body: clay, part: {{edge: 2}}}}]
boundary_conditions:
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 1}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
loads:
  - {{name: load, type: pressure, surface: top, pressure: {q}}}
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
steps: {{count: 1}}
"""
            _, _, points = run("undrained", deck)
            stiff = bulk + 4 * shear / 3 + water
            # At finite strain, q = -(M e - J p)/J with p = -K e, e = ln J.
            strain = -q / stiff
            for _ in range(50):
                ratio = np.exp(strain)
                stress = ((bulk + 4 * shear / 3) * strain) / ratio + water * strain
                slope = (bulk + 4 * shear / 3) * (1 - strain) / ratio + water
                strain -= (stress + q) / slope
            volume = points.point_data["volume"].sum() / 2
            pressure = points.point_data["pore_pressure"]
            print(f"  {method:6} q {q:8} strain {np.log(volume) / strain - 1:.1e} pressure "
                  f"{np.abs(pressure / (-water * strain) - 1).max():.1e} B {pressure.mean() / q:.6f} "
                  f"{water / stiff:.6f}")


def release():
    """A stage that makes the material drained releases the excess pressure."""
    print("undrained load, then drained: settlement over that of the drained load, excess pressure left, effective stress/q")
    young, poisson, q = 1e7, 0.3, 1e3
    for method in METHODS:
        deck = f"""
version: 1
grid: {{type: structured, origin: [0, 0], size: [1, 3], spacing: 0.5}}
materials:
  clay: {{model: hencky, young: {young}, poisson: {poisson}, drainage: undrained, undrained_poisson: 0.495}}
  drained: {{model: hencky, young: {young}, poisson: {poisson}}}
bodies:
  - name: clay
    material: clay
    method: {method}
    strain: mean-dilatation
    shape: {{type: box, min: [0, 0], max: [1, 2]}}
    points_per_cell: 2
surfaces: [{{name: top, body: clay, part: {{edge: 2}}}}]
boundary_conditions:
  - {{name: left, nodes: {{x: 0}}, fix: [x]}}
  - {{name: right, nodes: {{x: 1}}, fix: [x]}}
  - {{name: base, nodes: {{y: 0}}, fix: [y]}}
loads:
  - {{name: load, type: pressure, surface: top, pressure: {q}}}
solver: {{tolerance: 1e-12}}
output: {{precision: double}}
stages:
  - {{name: load, steps: {{count: 1}}, factors: {{load: 1}}}}
  - {{name: wait, steps: {{count: 4}}, material: {{clay: drained}}}}
"""
        _, _, points = run("release", deck)
        modulus = young * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))
        strain = -q / modulus
        for _ in range(50):
            strain -= (modulus * strain * np.exp(-strain) + q) / (modulus * (1 - strain) * np.exp(-strain))
        volume = points.point_data["volume"].sum() / 2
        stress = points.point_data["cauchy_stress"][:, 1]
        print(f"  {method:6} {np.log(volume) / strain - 1:.1e} {np.abs(points.point_data['pore_pressure']).max():.1e} "
              f"{np.abs(stress / -q - 1).max():.1e}")


def slope():
    """A slope under water comes to rest as one whose density is less by that of the displaced water does in air."""
    print("slope under water and in air with buoyant density: largest differences, relative to the largest value")
    deck = (Path(__file__).parents[1] / "inputs" / "submerged_slope.yaml").read_text()
    first, last = deck.index("  - {name: drawdown"), deck.index("output:")
    output = deck[last:].replace("  every: 5 ", "  precision: double\n  every: 5 ")
    deck = deck[:first] + "\nsolver: {tolerance: 1e-12}\n" + output
    wet = deck.replace("  fall: 5 ", "  fall: 0 ").replace("level: 10}", "level: 12}")
    dry = deck.replace("water: {unit_weight: 10e3, level: 10}", "")
    dry = dry.replace("density: 2000\n    porosity: 0.001", "density: 1001")
    wet, dry = run("wet", wet)[2], run("dry", dry)[2]
    for field in ("displacement", "cauchy_stress"):
        found, expected = wet.point_data[field], dry.point_data[field]
        print(f"  {field} {np.abs(found - expected).max() / np.abs(expected).max():.1e}")


CLAY = """
version: 1
grid: {type: structured, origin: [0, 0], size: [2, 2], spacing: 1}
water: {bulk_modulus: 2.2e9}
materials:
  drained: {model: hencky, young: 1e7, poisson: 0.3}
  rock: {model: hencky, young: 1e7, poisson: 0.3, drainage: undrained, porosity: 0.4}
bodies:
  - {name: a, material: rock, strain: mean-dilatation, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [1, 1]}}
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
steps: {count: 1}
"""


def skempton():
    """Skempton's B of a point: the share of an isotropic pressure that the water takes."""
    print("isotropic compression of a point: excess pressure over total pressure, K_w/n/(K' + K_w/n), relative error")
    folder = Path(tempfile.mkdtemp(prefix="water-skempton-"))
    (folder / "deck.yaml").write_text(CLAY)
    table = folder / "table.csv"
    subprocess.run([PROGRAM, "element", folder / "deck.yaml", "--material", "rock", "--path", "isotropic",
                    "--to", "1e-6", "--steps", "1", "--output", table], check=True, capture_output=True)
    with open(table, newline="") as file:
        row = list(csv.DictReader(file))[-1]
    found = float(row["excess_pore_pressure"]) / float(row["pressure"])
    bulk, water = 1e7 / 1.2, 2.2e9 / 0.4
    # The Kirchhoff stress of the law is divided by J.
    expected = water / (water + bulk * np.exp(1e-6))
    print(f"  {found:.12f} {expected:.12f} {found / expected - 1:.1e}")


def triaxial():
    """An undrained triaxial test of modified Cam-clay on a grid, and of one point."""
    print("undrained triaxial test of modified Cam-clay: q and excess pressure of the sample over those of the point")
    folder = Path(tempfile.mkdtemp(prefix="water-triaxial-"))
    deck = (Path(__file__).parents[1] / "inputs" / "triaxial.yaml").read_text()
    deck = deck.replace("    reference_pressure: 100e3\n",
                        "    reference_pressure: 100e3\n    porosity: 0.5\n    drainage: undrained\n"
                        "water: {bulk_modulus: 2.2e9}\n")
    deck = deck.replace("    method: cpdi2", "    strain: mean-dilatation\n    method: cpdi2")
    deck = deck.replace("  every: 10", "  precision: double\n  every: 40") + "solver: {tolerance: 1e-12}\n"
    _, _, points = run("triaxial", deck)
    (folder / "deck.yaml").write_text(deck)
    table = folder / "table.csv"
    subprocess.run([PROGRAM, "element", folder / "deck.yaml", "--material", "clay", "--path", "triaxial-drained",
                    "--confining", "100e3", "--to", "0.2", "--steps", "40", "--output", table],
                   check=True, capture_output=True)
    with open(table, newline="") as file:
        row = list(csv.DictReader(file))[-1]
    stress, excess = points.point_data["cauchy_stress"], points.point_data["excess_pore_pressure"]
    q = stress[:, 0] - stress[:, 1]
    print(f"  q {float(row['deviatoric_stress']):.6f} {np.abs(q / float(row['deviatoric_stress']) - 1).max():.1e}, "
          f"pressure {float(row['excess_pore_pressure']):.6f} "
          f"{np.abs(excess / float(row['excess_pore_pressure']) - 1).max():.1e}")


def main():
    global PROGRAM
    PROGRAM = sys.argv[1]
    cases = {"k0": k0, "lift": lift, "drawdown": drawdown, "undrained": undrained,
             "release": release, "skempton": skempton, "triaxial": triaxial, "slope": slope}
    for name in sys.argv[2:] or cases:
        cases[name]()


if __name__ == "__main__":
    main()
