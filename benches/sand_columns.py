"""Collapse of columns of sand against the experiments of Lube et al. (2005) and Lajeunesse et al. (2005), in the plane.

    python benches/sand_columns.py PROGRAM [a ...] [cells=8,16,32] [phi=31]

runs inputs/column.yaml for each aspect ratio and grid, given by the number of cells in the width, and prints the run-out and the final height over the width
r of the column with the published values. The front is where one per cent of the sand lies beyond.
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

DECK = Path(__file__).parent.parent / "inputs" / "column.yaml"


def published(a):
    lube = 1.2 * a if a < 2.3 else 1.9 * a ** (2 / 3), a if a < 1.15 else a**0.4
    lajeunesse = 1.2 * a if a < 3 else 1.9 * a ** (2 / 3), a if a < 0.7 else a ** (1 / 3)
    return lube, lajeunesse


def main():
    program = sys.argv[1]
    grids = [word[6:] for word in sys.argv[2:] if word.startswith("cells=")] or ["4,8,16"]
    phi = [word[4:] for word in sys.argv[2:] if word.startswith("phi=")] or ["31"]
    ratios = [float(word) for word in sys.argv[2:] if "=" not in word]
    for a in ratios or [0.5, 1.0, 3.0, 5.0]:
        lube, lajeunesse = published(a)
        print(f"a {a:g}: Lube {lube[0]:.2f}, {lube[1]:.2f}; Lajeunesse {lajeunesse[0]:.2f}, {lajeunesse[1]:.2f}")
        for cells in map(int, grids[0].split(",")):
            out = Path(tempfile.mkdtemp(prefix="column-"))
            end = 0.1 * math.ceil(10 * (0.5 + 0.35 * math.sqrt(a)))
            values = {"a": a, "phi": phi[0], "h": 0.1 / cells, "end": end, "size": 0.016 / cells, "room": math.ceil(2 + 3 * a ** (2 / 3))}
            sets = [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
            done = subprocess.run(
                [program, "run", str(DECK), *sets, "--out", str(out / "out")], capture_output=True, text=True
            )
            if not (out / "out" / "summary.json").exists():
                print(done.stdout[-500:], done.stderr[-1500:])
                continue
            summary = json.loads((out / "out" / "summary.json").read_text())
            motion = summary["motion"]
            energies = motion["energies"]
            size = energies["supplied"]
            print(
                f"  r/h {cells:2}: {summary['outcome']}, run-out {motion['runout'] / 0.1:.2f}, height {motion['height'] / 0.1:.2f}, "
                f"kinetic {energies['kinetic'] / size:.1e}, defect {energies['defect'] / size:+.3f}, ghost {energies['ghost'] / size:.3f}, "
                f"{summary['points']} points, {summary['steps']} steps, {summary['cpu_seconds']['total']:.0f} s"
                + (f" ({summary['reason']} at {summary['steps']})" if summary["reason"] else ""),
                flush=True,
            )


if __name__ == "__main__":
    main()
