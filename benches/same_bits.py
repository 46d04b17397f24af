"""Whether two builds of the program give the same results, bit for bit.

    python3 benches/same_bits.py OLD NEW [--stress DIRECTORY] [--full]

Runs the examples of `inputs/`, on coarse grids unless `--full`, and every deck of DIRECTORY by both programs: OLD on one
thread, NEW on one and on two. Some examples are also interrupted, and resumed by NEW. Compares every file of the results
but for times and for the checkpoint, whose layout may change; exits with 1 where any differ. The random decks of the
stress set are written by

    STRESS_DECKS=DIRECTORY STRESS=200 cargo test --release --test fuzz stress -- --ignored
"""

import argparse
import json
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

INPUTS = pathlib.Path(__file__).resolve().parent.parent / "inputs"
EXAMPLES = [
    ("beam.yaml", "h=0.5"),
    ("beam.yaml", "h=0.5", "method=mpm"),
    ("beam.yaml", "h=0.5", "method=cpdi2"),
    ("collapse.yaml", "h=0.5"),
    ("collapse.yaml", "h=0.5", "method=mpm"),
    ("compaction.yaml",),
    ("shear.yaml", "h=0.25"),
    ("annulus.yaml", "segments=18"),
    ("cantilever.yaml", "h=0.5"),
    ("cantilever/structured.yaml", "h=0.5"),
    ("cylinder.yaml",),
    ("domains.yaml",),
    ("excavation.yaml", "h=0.5"),
    ("footing.yaml",),
    ("footing_stages.yaml", "h=0.5"),
    ("twist.yaml", "h=0.5"),
    ("block/block.yaml", "h=0.5"),
    ("cone/revolved.yaml",),
    ("cone/solid.yaml",),
    ("arch.yaml",),
    ("bearing.yaml",),
    ("cone.yaml",),
    ("pipe.yaml", "h=0.25"),
    ("plough.yaml", "h=0.5"),
    ("slope.yaml",),
    ("triaxial.yaml",),
    ("new/annulus.yaml",),
    ("new/beam.yaml",),
    ("new/collapse.yaml",),
    ("new/column.yaml",),
    ("new/footing.yaml",),
    ("new/shear.yaml",),
]
RESUMED = ["collapse.yaml", "beam.yaml", "footing.yaml"]
# Times, threads and versions differ between runs; checkpoints hold the state in a layout of their own.
UNCOMPARED = re.compile(r"checkpoint_\d+\.mpm|status\.json|run\.json")
OF_TIME = {"timings", "peak_memory_bytes", "memory", "threads", "program", "started", "finished", "resumed"}


def run(program, deck, settings, threads, out, *options):
    """Exit code of a run."""
    command = [program, "run", deck, "--threads", str(threads), "--out", out, *options]
    for setting in settings:
        command += ["--set", setting]
    return subprocess.run(command, capture_output=True, text=True).returncode


def without_times(value):
    """What of a summary does not depend on the run."""
    if isinstance(value, dict):
        parts = {key: without_times(part) for key, part in value.items()}
        return {key: part for key, part in parts.items() if key not in OF_TIME and "seconds" not in key}
    return [without_times(part) for part in value] if isinstance(value, list) else value


def contents(out):
    """The files of results by name: bytes, or what of them is to be compared."""
    files = {}
    for path in sorted(out.rglob("*")):
        name = str(path.relative_to(out))
        if path.is_dir() or UNCOMPARED.fullmatch(path.name):
            continue
        if path.name == "summary.json":
            files[name] = without_times(json.loads(path.read_text()))
        else:
            files[name] = path.read_bytes()
    return files


def differences(old, new):
    """Names of the files in which results differ."""
    a, b = contents(old), contents(new)
    names = [name for name in sorted(a.keys() | b.keys()) if a.get(name) != b.get(name)]
    return [name + keys_that_differ(a.get(name), b.get(name)) for name in names]


def keys_that_differ(a, b):
    """The keys of two summaries that differ, in brackets."""
    if not (isinstance(a, dict) and isinstance(b, dict)):
        return ""
    return " (" + ", ".join(sorted(key for key in a.keys() | b.keys() if a.get(key) != b.get(key))) + ")"


def interrupted(program, deck, settings, out):
    """Starts a run, stops it in the middle, and resumes it until it ends; says how often it was stopped."""
    command = [program, "run", deck, "--threads", "1", "--out", out]
    for setting in settings:
        command += ["--set", setting]
    stops, wait = 0, 0.05
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while True:
        try:
            process.wait(timeout=wait)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            stops += 1
            wait *= 2
        if process.wait() in (0, 1):
            return stops
        # Before the first checkpoint there is nothing to resume.
        options = ["--resume"] if any(out.glob("checkpoint_*.mpm")) else []
        process = subprocess.Popen(command + options, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=pathlib.Path)
    parser.add_argument("new", type=pathlib.Path)
    parser.add_argument("--stress", type=pathlib.Path)
    parser.add_argument("--full", action="store_true", help="the examples as they are")
    arguments = parser.parse_args()
    old, new = arguments.old.resolve(), arguments.new.resolve()
    missing = {str(path.relative_to(INPUTS)) for path in INPUTS.rglob("*.yaml")} - {name for name, *_ in EXAMPLES}
    if missing:
        parser.error(f"add {', '.join(sorted(missing))} to EXAMPLES")
    decks = [(INPUTS / name, () if arguments.full else settings) for name, *settings in EXAMPLES]
    if arguments.stress:
        decks += [(path, ()) for path in sorted(arguments.stress.glob("*.yaml"))]
    compared, failures, stops, began = 0, [], 0, time.time()
    with tempfile.TemporaryDirectory() as directory:
        outs = {name: pathlib.Path(directory) / name for name in ("old", "new", "resumed")}

        def compare(name, deck, settings):
            nonlocal compared
            found = differences(outs["old"], outs[name])
            compared += 1
            if found:
                failures.append(f"{deck.name} {' '.join(settings)} ({name}): {', '.join(found[:5])}")
                print("DIFFERS", failures[-1], flush=True)

        for deck, settings in decks:
            shutil.rmtree(outs["old"], ignore_errors=True)
            code = run(old, deck, settings, 1, outs["old"])
            for threads in (1, 2):
                shutil.rmtree(outs["new"], ignore_errors=True)
                if run(new, deck, settings, threads, outs["new"]) != code:
                    failures.append(f"{deck.name}: other exit code")
                    print("DIFFERS", failures[-1], flush=True)
                compare("new", deck, [*settings, f"threads={threads}"])
            if deck.name in RESUMED:
                shutil.rmtree(outs["resumed"], ignore_errors=True)
                stops += interrupted(new, deck, settings, outs["resumed"])
                compare("resumed", deck, settings)
    print(f"{len(decks)} decks, {compared} comparisons, {stops} interruptions, {len(failures)} differ, {time.time() - began:.0f} s")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
