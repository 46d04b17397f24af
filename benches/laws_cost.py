"""CPU time of the laws of soil in whole runs, beside von Mises material: the table in docs/performance.md.

    python3 benches/laws_cost.py [--mpm target/release/mpm] [--rounds 5] [--only plane] [--decks FOLDER]

Ground between smooth walls under an isotropic pressure; its top sinks as a cosine wave on one side and rises on the other.
The strain decays with the depth, and each law has the strength with which a third of the points yields. A first stage
reaches this state in four steps, a second one moves on by a tenth in twelve steps. All flow is associated, and but for
Cam-clay the stiffness is symmetric. The share is that of the points whose plastic strain changes in the last step, in a
run with files. Then every law takes its turn after a run of von Mises material, on one thread and without files, in several rounds; the
ratios are medians over the rounds, each of runs within seconds, as the machine may be shared. --decks keeps the decks.

Needs NumPy.
"""

import argparse
import os
import pathlib
import statistics
import tempfile

import numpy
import soils

DECK = """
version: 1
parameters: {every: 0}
analysis: {idealisation: IDEALISATION}
grid: {type: structured, origin: ORIGIN, size: SIZE, spacing: SPACING}
materials:
  soil: {LAW}
bodies:
  - {name: ground, material: soil, shape: {type: box, min: ORIGIN, max: SIZE}, method: METHOD, points_per_cell: 2,
     initial_stress: {type: components, stress: {xx: -30e3, yy: -30e3, zz: -30e3}}}
boundary_conditions:
WALLS
  - {name: top, nodes: {UP: HEIGHT}, uUP: "-MOVE * WAVE", curve: [[0, 0], [1, 1], [2, 1.1]]}
stages:
  - {name: load, steps: {count: 4}}
  - {name: flow, steps: {count: 12}}
solver: {linear: LINEAR}
output: {every: "${every}", fields: [plastic_strain]}
"""
PLANE = {
    "IDEALISATION": "plane-strain", "ORIGIN": "[0, 0]", "SIZE": "[4, 2.5]", "SPACING": 1 / 32, "UP": "y", "HEIGHT": 2.5,
    "WAVE": "cos(pi * X / 4)", "MOVE": 2e-3, "LINEAR": "direct",
    "WALLS": """  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 4}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}""",
}
SPACE = {
    "IDEALISATION": "solid", "ORIGIN": "[0, 0, 0]", "SIZE": "[2, 2, 2]", "SPACING": 1 / 8, "UP": "z", "HEIGHT": 2,
    "WAVE": "cos(pi * X / 2) * cos(pi * Y / 2)", "MOVE": 2e-3, "LINEAR": "iterative",
    "WALLS": """  - {name: back, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {x: 2}, fix: [x]}
  - {name: left, nodes: {y: 0}, fix: [y]}
  - {name: right, nodes: {y: 2}, fix: [y]}
  - {name: base, nodes: {z: 0}, fix: [x, y, z]}""",
}
ELASTIC = "young: 5e7, poisson: 0.3"
FRICTION = "friction_angle: 20, dilation_angle: 20, strength: kirchhoff"
CAM_CLAY = "compression_index: 0.09, swelling_index: 0.018, critical_state_ratio: 1.05, shear_modulus: 1e6, reference_pressure: 30e3"
# Laws with the strengths with which a third of the points yields, in the plane and in space.
LAWS = {
    "von Mises": (f"model: von-mises, {ELASTIC}, undrained_strength: STRENGTH", 19.5e3, 21.5e3),
    "Tresca": (f"model: tresca, {ELASTIC}, cohesion: STRENGTH", 19e3, 19.4e3),
    "Mohr-Coulomb": (f"model: mohr-coulomb, {ELASTIC}, {FRICTION}, cohesion: STRENGTH", 6.2e3, 5.9e3),
    "Drucker-Prager": (f"model: drucker-prager, {ELASTIC}, {FRICTION}, match: plane-strain, cohesion: STRENGTH", 7.5e3, 9.8e3),
    "modified Cam-clay": (f"model: modified-cam-clay, {CAM_CLAY}, overconsolidation_ratio: STRENGTH", 1.016, 1.0001),
}


def deck(kind, law, method="mpm", strength=None):
    """The deck of a law, with its own strength unless one is given."""
    text, *strengths = LAWS[law]
    own = strengths[kind is SPACE] if strength is None else strength
    return soils.filled(DECK, LAW=text.replace("STRENGTH", str(own)), METHOD=method, **kind)


def yielding(program, folder, text):
    """Share of the points whose plastic strain changes in the last step."""
    found = soils.run(program, folder, text, every=1)
    before, after = (soils.point_fields(path) for path in sorted((found.folder / "out").glob("points_*.vtu"))[-2:])
    change = numpy.abs(after["plastic_strain"] - before["plastic_strain"]).max(axis=1)
    return float((change > 1e-9).mean())


def cost(program, folder, text):
    """CPU time per point and evaluation, in µs, of the assembly and of all but the output; then the summary."""
    summary = soils.run(program, folder, text).summary
    evaluated = summary["points"] * summary["evaluations"]
    own = 1e6 * summary["cpu_seconds"]["assembly"] / evaluated
    return own, summary["cpu_microseconds_per_point_and_evaluation"]["without_output"], summary


def rows(program, folder, kind, method, rounds):
    decks = {law: deck(kind, law, method) for law in LAWS}
    shares = {law: yielding(program, folder, text) for law, text in decks.items()}
    costs, ratios = ({law: [] for law in LAWS} for _ in range(2))
    for _ in range(rounds):
        for law, text in decks.items():
            base = cost(program, folder, decks["von Mises"])
            own = cost(program, folder, text)
            costs[law].append(own)
            ratios[law].append([a / b for a, b in zip(own[:2], base[:2])])
    for law in LAWS:
        assembly, total = (statistics.median(cost[k] for cost in costs[law]) for k in range(2))
        of_assembly, of_total = (statistics.median(ratio[k] for ratio in ratios[law]) for k in range(2))
        least, most = (pick(ratio[1] for ratio in ratios[law]) for pick in (min, max))
        summary = costs[law][0][2]
        yield [law, f"{100 * shares[law]:.0f} %", summary["evaluations"], summary["failed_attempts"], f"{assembly:.3f}",
               f"{of_assembly:.2f}", f"{total:.3f}", f"{of_total:.2f}", f"{least:.2f} to {most:.2f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mpm", default=os.environ.get("MPM", soils.ROOT / "target/release/mpm"), help="the program")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", choices=["plane", "space"])
    parser.add_argument("--method", default="mpm")
    parser.add_argument("--decks", type=pathlib.Path, help="a folder for the decks")
    options = parser.parse_args()
    headings = ["law", "yielding", "evaluations", "cuts", "assembly (µs)", "of von Mises", "total (µs)", "of von Mises", "range"]
    for name, kind in [("plane", PLANE), ("space", SPACE)]:
        if options.only not in (None, name):
            continue
        if options.decks:
            options.decks.mkdir(parents=True, exist_ok=True)
            for law in LAWS:
                (options.decks / f"{name}-{law.replace(' ', '-')}.yaml").write_text(deck(kind, law, options.method))
        with tempfile.TemporaryDirectory() as folder:
            table = rows(options.mpm, folder, kind, options.method, options.rounds)
            soils.print_table(f"{name}, {options.method}", headings, table)


if __name__ == "__main__":
    main()
