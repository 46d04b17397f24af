"""Strong and weak scaling of runs on several ranks: time, memory and messages.

    python3 benches/scaling.py PROGRAM strong --ranks 1 2 4 --set h=0.125
    python3 benches/scaling.py PROGRAM weak --ranks 1 8 64 --set h=0.125

PROGRAM is the program with `--features petsc`, release build. `strong` runs the block of inputs/block/block.yaml on more and
more ranks; `weak` refines it so that each rank keeps as many points (the spacing falls with the cube root of the ranks).
For each it prints wall time, CPU time summed over ranks, and two peaks of the memory of a rank, the largest of all ranks: all
that is resident, and that with the pages that the ranks of a machine share, such as those of libraries, divided between them
(sampled 20 times a second). The first row is the program without launcher. `--launcher` names another launcher, for example
"srun -n {ranks}".
"""

import argparse
import json
import os

import subprocess
import sys
import tempfile
import time
from pathlib import Path

DECK = Path(__file__).resolve().parents[1] / "inputs/block/block.yaml"
# Each rank reports its own resources when it ends.
MEASURE = """
import json, os, resource, subprocess, sys, time
process = subprocess.Popen(sys.argv[2:])
share = 0
while process.poll() is None:
    try:
        lines = open(f"/proc/{process.pid}/smaps_rollup").read().splitlines()
        share = max([share, *(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))])
    except (OSError, ValueError):
        pass
    time.sleep(0.05)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
name = f"{os.uname().nodename}_{os.getpid()}.json"
with open(os.path.join(sys.argv[1], name), "w") as file:
    json.dump({"cpu": used.ru_utime + used.ru_stime, "peak": used.ru_maxrss * 1024, "share": share}, file)
sys.exit(process.returncode)
"""


def measured(program, launcher, ranks, settings):
    """Runs the block without files; returns wall time, and CPU time and peak memory of each rank."""
    with tempfile.TemporaryDirectory() as directory:
        reports, out = Path(directory, "ranks"), Path(directory, "out")
        reports.mkdir()
        words = [word for setting in settings for word in ("--set", setting)]
        run = [program, "run", DECK, "--out", out, *words]
        command = [sys.executable, "-c", MEASURE, reports, *run]
        if ranks:
            command = [*launcher.format(ranks=ranks).split(), *command]
        else:
            command += ["--threads", "1"]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
                       "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        began = time.monotonic()
        done = subprocess.run(list(map(str, command)), env=environment, capture_output=True, text=True)
        wall = time.monotonic() - began
        if done.returncode:
            sys.exit(done.stderr)
        of_ranks = [json.loads(path.read_text()) for path in reports.iterdir()]
        summary = json.loads((out / "summary.json").read_text())
        return wall, of_ranks, summary


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("study", choices=["strong", "weak"])
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--set", action="append", default=[], help="parameter of the block")
    parser.add_argument("--launcher", default="mpirun --oversubscribe -n {ranks}")
    parser.add_argument("--repeat", type=int, default=1, help="runs of each, of which the fastest counts")
    arguments = parser.parse_args()
    given = dict(setting.split("=", 1) for setting in arguments.set)
    spacing = float(given.get("h", 0.25))
    print("| ranks | wall (s) | CPU (s) | peak, resident (MiB) | peak, share (MiB) | linear iterations |\n|---|---|---|---|---|---|")
    for ranks in [0, *arguments.ranks]:
        settings = dict(given)
        if arguments.study == "weak" and ranks:
            settings["h"] = spacing / ranks ** (1 / 3)
        settings = [f"{name}={value}" for name, value in settings.items()]
        runs = [measured(arguments.program, arguments.launcher, ranks, settings) for _ in range(arguments.repeat)]
        wall, of_ranks, summary = min(runs, key=lambda run: run[0])
        cpu = sum(rank["cpu"] for rank in of_ranks)
        peaks = [max(rank[key] for rank in of_ranks) / 2**20 for key in ("peak", "share")]
        iterations = summary.get("linear_iterations", summary.get("solver", {}).get("linear_iterations", "-"))
        print(f"| {ranks or 'no launcher'} | {wall:.2f} | {cpu:.2f} | {peaks[0]:.0f} | {peaks[1]:.0f} | {iterations} |", flush=True)


if __name__ == "__main__":
    main()
