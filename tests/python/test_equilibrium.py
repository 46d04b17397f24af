"""A written step is an equilibrated step: the residual is recomputed from the written files, for random analyses whose
moduli, units, weights and sizes are drawn over twelve decades.

`EQUILIBRIUM=2000 ... pytest tests/python/test_equilibrium.py -k random -s` runs so many.
"""

import csv
import json
import os
import random
import subprocess

import pytest

from equilibrium_from_files import residuals_of_parts

TOLERANCE = 1e-9
MAX_ROUND_OFF = 1e-6


def draw(seed):
    """A deck of one or two bodies, and what the check needs to know of it."""
    rng = random.Random(seed)
    decades = lambda: 10 ** rng.uniform(-6, 6)
    cells, size = 6, decades()
    # Numbers of few digits, so that deck and check read the same.
    h = float(f"{size:.3g}")
    method = rng.choice(["mpm", "gimp"])
    bodies, materials = [], []
    layout = rng.choice(["one", "stacked", "apart"])
    boxes = {
        "one": [(0, 0, 4, 3)],
        "stacked": [(0, 0, 5, 2), (1, 2, 3, 4)],
        "apart": [(0, 0, 2, 3), (4, 0, 6, 2)],
    }[layout]
    moduli = [decades() for _ in boxes]
    if layout == "stacked" and rng.random() < 0.5:
        moduli[1] = moduli[0] * 10 ** rng.uniform(0, 12)
    per_volume = []
    for k, (box, young) in enumerate(zip(boxes, moduli)):
        law = rng.choice(["hencky", "neo-hookean", "von-mises"])
        extra = f", deviatoric_yield_stress: {young * 10 ** rng.uniform(-3, 0):.3g}" if law == "von-mises" else ""
        materials.append(f"  m{k}: {{model: {law}, young: {young:.6g}, poisson: {rng.choice([0, 0.2, 0.3])}{extra}}}")
        low, high = [f"{c} * {h!r}" for c in box[:2]], [f"{c} * {h!r}" for c in box[2:]]
        quote = lambda pair: ", ".join(f'"${{{c}}}"' for c in pair)
        bodies.append(
            f"  - {{name: b{k}, material: m{k}, method: {method}, points_per_cell: 2, "
            f"shape: {{type: box, min: [{quote(low)}], max: [{quote(high)}]}}}}"
        )
        strain = 10 ** rng.uniform(-12, -1.5)
        weight = strain * young / (h * 4)
        per_volume.append([float(f"{weight * rng.choice([0, 0.3, -0.2]):.6g}"), float(f"{-weight:.6g}")])
    loads = [
        f"  - {{name: w{k}, type: body-force, force: [{x!r}, {y!r}], bodies: [b{k}]}}"
        for k, (x, y) in enumerate(per_volume)
    ]
    deck = "\n".join(
        [
            "version: 1",
            f"title: Random analysis {seed}",
            "analysis: {stabilisation: {mode: off}}",
            f'grid: {{type: structured, origin: [0, 0], size: ["${{{cells} * {h!r}}}", "${{{cells} * {h!r}}}"], spacing: {h!r}}}',
            "materials:",
            *materials,
            "bodies:",
            *bodies,
            "boundary_conditions: [{name: floor, nodes: {y: 0}, fix: [x, y]}]",
            "loads:",
            *loads,
            "steps: {count: 2, smallest: 0.25}",
            "output: {every: 1}",
        ]
    )
    problem = {
        "h": h,
        "cells": cells,
        "method": method,
        "per_volume": per_volume,
        "held": lambda x, y: [y == 0, y == 0],
    }
    return deck, problem


def check(program, folder, seed):
    """Runs a deck; what became of it, with the largest residual of its written steps."""
    deck, problem = draw(seed)
    (folder / "deck.yaml").write_text(deck)
    out = folder / f"out{seed}"
    ran = subprocess.run(
        [program, "run", folder / "deck.yaml", "--out", out, "--threads", "1"], capture_output=True, text=True
    )
    assert ran.returncode in (0, 1), (seed, ran.returncode, ran.stderr)
    summary = json.loads((out / "summary.json").read_text())
    assert (ran.returncode == 0) == (summary["outcome"] == "completed"), seed
    rows = [row for row in csv.DictReader((out / "history.csv").open()) if row["converged"] == "1"]
    worst, last = 0.0, 0
    for row in rows:
        step, limited = int(row["step"]), row["rounding_limited"] == "1"
        if not (out / f"points_{step:04d}.vtu").exists() or step != last + 1:
            continue
        last = step
        limit = MAX_ROUND_OFF if limited else TOLERANCE
        for out_of_balance, force in residuals_of_parts(out, step, float(row["time"]), problem):
            # Recomputing sums of the same terms in another order costs some units of the last place.
            found = out_of_balance / force if out_of_balance > 0.0 else 0.0
            assert found <= 1.001 * limit + 1e-14, (seed, step, found, row["residual"], limited)
            worst = max(worst, found)
    code = summary.get("code")
    return ("completed" if ran.returncode == 0 else code), any(r["rounding_limited"] == "1" for r in rows), worst, last


def test_random_analyses_are_in_equilibrium(program, tmp_path):
    count = int(os.environ.get("EQUILIBRIUM", "12"))
    first = int(os.environ.get("EQUILIBRIUM_SEED", "0"))
    outcomes, checked, limited, worst = {}, 0, 0, [0.0, 0.0]
    for seed in range(first, first + count):
        outcome, is_limited, residual, steps = check(program, tmp_path, seed)
        outcomes[outcome] = outcomes.get(outcome, 0) + 1
        checked += steps
        limited += is_limited
        worst[is_limited] = max(worst[is_limited], residual)
    print(f"{count} decks: {outcomes}; {checked} steps checked, {limited} decks limited by round-off;")
    print(f"largest residual {worst[0]:.2e}, where limited {worst[1]:.2e}")
    assert checked >= count // 2
