"""Runs decks through the command line, reads their results and prints tables."""

import csv
import json
import subprocess
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
DOMAIN_VOLUME = {"volume": "domain"}  # a parameter of the decks
CUT_STEPS = {"beam", "annulus", "collapse"}  # decks that cut steps, which the paper does not


class Runs:
    """Runs decks through the command line and keeps their results."""

    def __init__(self, program, directory):
        self.program, self.directory = Path(program).resolve(), Path(directory).resolve()

    def __call__(self, deck, **parameters):
        """The results directory of a deck, a name in `inputs` or a path without suffix, with these parameters.

        A run that fails leaves the steps before the failure. Raises RuntimeError if the deck cannot be run at all.
        """
        if parameters.get("method") == "mpm":
            parameters.pop("update", None)
        if deck in CUT_STEPS:
            parameters.setdefault("smallest", 1)
        name = "_".join([deck, *(f"{key}-{value}" for key, value in parameters.items())])
        out = self.directory / name
        if not (out / "summary.json").exists():
            file = ROOT / "inputs" / f"{deck}.yaml"
            settings = [word for key, value in parameters.items() for word in ("--set", f"{key}={value}")]
            command = [self.program, "run", file, *settings, "--out", out]
            process = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            if process.returncode not in (0, 1):
                (out / "summary.json").unlink(missing_ok=True)
                raise RuntimeError(process.stderr)
        return out


def summary(out):
    return json.loads((out / "summary.json").read_text())


def table(out, name):
    """A table of results as a mapping of columns."""
    with open(out / f"{name}.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def heading(*cells):
    print()
    row(*cells)
    row(*["---"] * len(cells))


def table_of_residuals(out, paper):
    """Residuals side by side with the paper's table: the paper's value / ours."""
    rows = table(out, "convergence")
    heading("iteration", *(f"step {step}" for step in paper))
    ours = {step: rows["residual"][rows["step"] == step] for step in paper}
    for iteration in range(max(len(values) for values in [*paper.values(), *ours.values()])):
        cell = lambda values: f"{values[iteration]:.3e}" if iteration < len(values) else "–"
        row(iteration, *(f"{cell(paper[step])} / {cell(ours[step])}" for step in paper))
