"""What whole runs take, and how it grows with their size.

    python3 benches/decks.py [--program target/release/mpm] [--repeat 2] [--only beam]

Runs the examples of `inputs/` over sizes on one thread, without files of results, then one of them with files of every
step, and reads `summary.json`: CPU time by phase, evaluations and the largest resident memory. Of repeated runs the one
with the least CPU time counts, as other programs on the machine can only add to it. Tables are Markdown, for
`docs/performance.md`.
"""

import argparse
import json
import math
import pathlib
import subprocess
import tempfile

INPUTS = pathlib.Path(__file__).resolve().parent.parent / "inputs"
PHASES = ["set-up", "basis", "assembly", "analyse", "factorise", "solve", "update"]
EXAMPLES = [
    ("beam", "beam.yaml", "mpm", [0.5, 0.25, 0.125, 0.0625]),
    ("beam", "beam.yaml", "gimp", [0.5, 0.25, 0.125, 0.0625]),
    ("beam", "beam.yaml", "cpdi2", [0.5, 0.25, 0.125, 0.0625]),
    ("collapse", "collapse.yaml", "gimp", [1, 0.5, 0.25, 0.125, 0.0625]),
    ("block", "block/block.yaml", "mpm", [0.5, 0.25, 0.125]),
    ("block", "block/block.yaml", "gimp", [0.5, 0.25]),
]
FILES = [
    ("none", 0, ""),
    ("all fields, double", 1, ""),
    ("all fields, single", 1, "  precision: single\n"),
    ("displacement and stress, double", 1, "  fields: [displacement, cauchy_stress]\n"),
    ("displacement and stress, single", 1, "  fields: [displacement, cauchy_stress]\n  precision: single\n"),
]


def run(program, deck, method, spacing):
    """Summary of a run that succeeds; of one that does not, the reason."""
    with tempfile.TemporaryDirectory() as directory:
        command = [program, "run", INPUTS / deck, "--threads", "1", "--out", directory]
        for setting in [f"h={spacing}", f"method={method}", "every=0"]:
            command += ["--set", setting]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            return None, (done.stderr.strip().splitlines() or ["no message"])[0]
        return json.loads((pathlib.Path(directory) / "summary.json").read_text()), ""


def exponent(sizes, costs):
    """Slope of the straight line through the logarithms, by least squares."""
    x, y = ([math.log(v) for v in values] for values in (sizes, costs))
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)


def table(program, repeat, name, deck, method, spacings):
    print(f"\n### {name}, {method}\n")
    print("| h | points | unknowns | evaluations | CPU (s) | " + " | ".join(PHASES) + " | µs | bytes |")
    print("|" + "---|" * (7 + len(PHASES)))
    runs = []
    for spacing in spacings:
        done = [run(program, deck, method, spacing) for _ in range(repeat)]
        summaries = [summary for summary, _ in done if summary is not None]
        if not summaries:
            print(f"| {spacing} | failed: {done[0][1]} |")
            continue
        best = min(summaries, key=lambda summary: summary["cpu_seconds"]["total"])
        cpu, points = best["cpu_seconds"], best["points"]
        runs.append(best)
        phases = " | ".join(f"{cpu[phase]:.2f}" for phase in PHASES)
        each = 1e6 * cpu["total"] / (points * best["evaluations"])
        memory = best["peak_memory_bytes"] / points
        print(f"| {spacing} | {points} | {best['unknowns']} | {best['evaluations']} | {cpu['total']:.2f} "
              f"| {phases} | {each:.3f} | {memory:.0f} |", flush=True)
    if len(runs) > 1:
        def growth(cost):
            return exponent([summary["points"] for summary in runs],
                            [cost(summary) / summary["evaluations"] for summary in runs])

        parts = ", ".join(f"{phase} {growth(lambda s: max(s['cpu_seconds'][phase], 1e-4)):.2f}"
                          for phase in ("basis", "assembly", "factorise"))
        whole = growth(lambda s: s["cpu_seconds"]["total"])
        print(f"\nExponent of growth of CPU time per evaluation with points: {whole:.2f}; {parts}.", flush=True)


def files(program, repeat, method, spacing):
    """What the files of every step cost beside the run."""
    steps = 10
    print(f"\n### files, block, {method}, h = {spacing}, {steps} steps\n")
    print("| files | MB per step | CPU (s) | of them output | beside no files | a step later than the first |")
    print("|" + "---|" * 6)
    text = (INPUTS / "block/block.yaml").read_text()
    baseline = None
    for what, every, choice in FILES:
        done = []
        for _ in range(repeat):
            with tempfile.TemporaryDirectory() as directory:
                deck = pathlib.Path(directory) / "deck.yaml"
                deck.write_text(text.replace("\noutput:\n", f"\noutput:\n{choice}"))
                settings = [f"h={spacing}", f"method={method}", f"every={every}", f"steps={steps}"]
                command = [program, "run", deck, "--threads", "1", "--out", f"{directory}/out"]
                for setting in settings:
                    command += ["--set", setting]
                subprocess.run(command, capture_output=True, check=True)
                summary = json.loads(pathlib.Path(directory, "out/summary.json").read_text())["cpu_seconds"]
                size = sum(file.stat().st_size for file in pathlib.Path(directory, "out").glob("*.vtu"))
                first = output_of_first(program, deck, settings[:-1], directory) if every else 0
                done.append((summary["total"], summary["output"], first, size / (steps + 1)))
        total, output, first, size = min(done)
        baseline = baseline or total
        # The first step shows two states and encodes what never changes.
        later = (output - first) / (steps - 1)
        print(f"| {what} | {size / 1e6:.0f} | {total:.2f} | {output:.2f} | + {100 * (total / baseline - 1):.1f} % "
              f"| {later:.3f} s, {100 * later / (baseline / steps):.1f} % |", flush=True)


def output_of_first(program, deck, settings, directory):
    """CPU time of the files of a run with one step."""
    command = [program, "run", deck, "--threads", "1", "--out", f"{directory}/first"]
    for setting in [*settings, "steps=1"]:
        command += ["--set", setting]
    subprocess.run(command, capture_output=True, check=True)
    return json.loads(pathlib.Path(directory, "first/summary.json").read_text())["cpu_seconds"]["output"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=INPUTS.parent / "target/release/mpm", help="the program")
    parser.add_argument("--repeat", type=int, default=2, help="runs of each size")
    parser.add_argument("--only", default="", help="only examples whose name and method contain this")
    parser.add_argument("--finest", type=float, default=0, help="no grid finer than this")
    options = parser.parse_args()
    for name, deck, method, spacings in EXAMPLES:
        if options.only in f"{name} {method}":
            kept = [spacing for spacing in spacings if spacing >= options.finest]
            table(options.program, options.repeat, name, deck, method, kept)
    for method, spacing in [("mpm", 0.125), ("gimp", 0.25)]:
        if options.only in f"files {method}" and spacing >= options.finest:
            files(options.program, options.repeat, method, spacing)


if __name__ == "__main__":
    main()
