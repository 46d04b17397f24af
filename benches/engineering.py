"""Whether sensible decks of an engineer run to the end with defaults.

    python3 benches/engineering.py PROGRAM [--count 34] [--only FAMILY ...] [--seed 0] [--out DIRECTORY] [--jobs 1]

Writes COUNT random decks for each of twelve families (footings on nodes and as tools, slopes, excavations, walls, piles,
pipes, anchors, trapdoors, cantilevers, rings, upsetting), within what a reader of the how-to pages would try: two to four
points per cell, all methods, clay, sand with and without cohesion, softening, weight and stress at rest. Every key that a
deck does not need stays at its default. Each deck is run and counted as complete, slow (more than three times the steps
asked) or stopped, with the code and the diagnosis. The table at the end has a line for each family; DIRECTORY keeps the
decks, and `engineering.csv` with a line for each run.
"""

import argparse
import concurrent.futures
import csv
import json
import math
import pathlib
import random
import resource
import shutil
import subprocess
import sys
import tempfile

GRAVITY = 9.81
TIMEOUT = 600


class Draw:
    """Random choices of one deck; the same seed draws the same deck."""

    def __init__(self, family, number, seed):
        self.random = random.Random(f"{family} {number} {seed}")

    def between(self, low, high, digits=3):
        """A number between two bounds, with few digits as an engineer writes it."""
        value = self.random.uniform(low, high)
        return round(value, digits - 1 - math.floor(math.log10(abs(value))))

    def choose(self, *options):
        return self.random.choice(options)

    def chance(self, probability):
        return self.random.random() < probability


def clay(draw, low=15e3, high=60e3):
    """Undrained clay: Tresca's or von Mises's law, at times softening; returns the material and its strength."""
    strength = draw.between(low, high)
    young = round(strength * draw.between(150, 600))
    if draw.chance(0.4):
        return {"model": "von-mises", "young": young, "poisson": draw.choose(0.3, 0.45, 0.49),
                "undrained_strength": strength, "density": draw.choose(1600, 1800, 2000)}, strength
    material = {"model": "tresca", "young": young, "poisson": draw.choose(0.3, 0.45, 0.49), "cohesion": strength,
                "density": draw.choose(1600, 1800, 2000)}
    if draw.chance(0.25):
        material["softening"] = {"strain": draw.between(0.3, 1.0, 2), "residual_cohesion": round(strength * draw.between(0.3, 0.7)),
                                 "band": draw.choose(0.25, 0.5)}
    return material, strength


def sand(draw, cohesionless=True):
    """Soil with friction, often without cohesion; returns the material."""
    phi = draw.choose(25, 28, 30, 33, 36, 40)
    psi = draw.choose(0, 0, max(phi - 30, 0), phi // 3)
    cohesion = draw.choose(0, 100, 1000) if cohesionless else draw.choose(1000, 3000, 8000)
    material = {"model": "mohr-coulomb", "young": draw.choose(10e6, 20e6, 30e6, 60e6), "poisson": draw.choose(0.25, 0.3),
                "cohesion": cohesion, "friction_angle": phi, "dilation_angle": psi, "density": draw.choose(1600, 1700, 1900)}
    if cohesion > 0 and draw.chance(0.15):
        material["tensile_strength"] = 0
    if cohesion > 0 and draw.chance(0.2):
        material["softening"] = {"strain": 0.5, "residual_cohesion": cohesion / 2, "residual_friction_angle": phi - 4,
                                 "band": draw.choose(0.25, 0.5)}
    return material


def soil(draw):
    return clay(draw)[0] if draw.chance(0.5) else sand(draw)


def at_rest(draw, material, surface):
    """Stress at rest below a level surface: K0 after Jaky for sand, 0.6 to 1 for clay, which can carry it."""
    phi = material.get("friction_angle")
    k0 = draw.choose(0.6, 0.8, 1.0) if phi is None else round(1 - math.sin(math.radians(phi)), 2)
    strength = material.get("cohesion", material.get("undrained_strength"))
    if phi is None and (1 - k0) * material["density"] * GRAVITY * surface > 1.6 * strength:
        k0 = 1.0
    return {"type": "geostatic", "surface": surface, "k0": k0}


def points(draw, solid=False):
    """Method and points per cell; mean dilatation for material that flows."""
    body = {"points_per_cell": draw.choose(2, 2, 3)}
    method = draw.choose("cpdi2", "cpdi2", "gimp", "cpdi1", "mpm")
    if method != "cpdi2" or draw.chance(0.5):
        body["method"] = method
    if not solid:
        body["volumetric"] = "mean-dilatation"
    return body


def domains(draw):
    """As `points`, without standard points, which tools touch at their centres only."""
    while True:
        body = points(draw)
        if body.get("method") != "mpm":
            return body


def weight():
    return {"name": "weight", "type": "gravity", "acceleration": [0, -GRAVITY]}


def held(width, rough_base=True, base=0.0):
    """Rollers at both sides and a base."""
    return [
        {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
        {"name": "right", "nodes": {"x": width}, "fix": ["x"]},
        {"name": "base", "nodes": {"y": base}, "fix": ["x", "y"] if rough_base else ["y"]},
    ]


def deck(title, grid, materials, bodies, conditions, loads=(), steps=10, **others):
    content = {
        "version": 1,
        "title": title,
        "grid": grid,
        "materials": materials,
        "bodies": bodies,
        "boundary_conditions": conditions,
    }
    if loads:
        content["loads"] = list(loads)
    content |= others
    if "stages" not in content:
        content["steps"] = {"count": steps} if isinstance(steps, int) else steps
    content.setdefault("output", {})["every"] = 0
    return content


def structured(width, height, h):
    return {"type": "structured", "origin": [0, 0], "size": [width, height], "spacing": h}


def revolved(draw, content, probability):
    if draw.chance(probability):
        content["analysis"] = {"idealisation": "axisymmetric"}
    return content


def level_ground(draw, filling):
    """Ground without or with weight and stress at rest: width, depth, material, body and loads."""
    depth, width = draw.choose(4.0, 5.0), draw.choose(8.0, 10.0)
    material = soil(draw)
    body = {"name": "ground", "material": "soil", "shape": {"type": "box", "min": [0, 0], "max": [width, depth]}} | filling(draw)
    loads = []
    if "friction_angle" in material or draw.chance(0.6):
        body["initial_stress"] = at_rest(draw, material, depth)
        loads = [weight()]
    return width, depth, material, body, loads


def footing(draw):
    """A strip or a circle, held at nodes, sinks by up to a fifth of its width."""
    h = draw.choose(0.25, 0.5)
    half = draw.choose(1.0, 1.5, 2.0)
    width, depth, material, body, loads = level_ground(draw, points)
    push = {"name": "footing", "nodes": {"box": {"min": [0, depth], "max": [half, depth]}}, "uy": -round(draw.between(0.02, 0.2) * 2 * half, 3)}
    if draw.chance(0.6):
        push["ux"] = 0
    content = deck("footing", structured(width, depth + 1, h), {"soil": material}, [body], [*held(width), push], loads, draw.choose(10, 20, 40))
    return revolved(draw, content, 0.3)


def footing_tool(draw):
    """A strip or a circle as a rigid tool, smooth, rough or in between."""
    h = draw.choose(0.25, 0.5)
    half = draw.choose(1.0, 1.5, 2.0)
    width, depth, material, body, loads = level_ground(draw, domains)
    tool = {"name": "footing", "shape": {"type": "box", "min": [-half, depth], "max": [half, depth + 1]},
            "uy": -round(draw.between(0.02, 0.2) * 2 * half, 3), "friction": draw.choose(0, 0.3, 0.5, "rough")}
    content = deck("footing as a tool", structured(width, depth + 1, h), {"soil": material}, [body], held(width), loads,
                   draw.choose(10, 20, 40), tools=[tool])
    return revolved(draw, content, 0.3)


def slope(draw):
    """A slope that stands under its weight; often its strength is reduced afterwards."""
    h = draw.choose(0.5, 1.0)
    height, ratio = draw.choose(4.0, 6.0, 8.0), draw.choose(1.0, 1.5, 2.0, 3.0)
    base, crest = draw.choose(1.0, 2.0, 3.0), draw.choose(6.0, 8.0, 10.0)
    density = draw.choose(1700, 1900, 2000)
    gamma = density * GRAVITY
    if draw.chance(0.4):
        strength = gamma * height * draw.between(0.24, 0.4)
        material = {"model": "tresca", "young": 300 * round(strength), "poisson": 0.45, "cohesion": round(strength), "density": density}
        if draw.chance(0.3):
            material["softening"] = {"strain": 0.5, "residual_cohesion": round(0.8 * strength), "band": 0.5}
    else:
        phi = draw.choose(20, 25, 30, 35)
        # Strong enough to stand: charts of Taylor and of Bishop and Morgenstern give factors above 1.2 for these.
        cohesion = round(gamma * height * draw.between(0.05, 0.12), -2)
        material = {"model": "mohr-coulomb", "young": draw.choose(20e6, 50e6, 100e6), "poisson": 0.3, "cohesion": cohesion,
                    "friction_angle": phi, "dilation_angle": draw.choose(0, 0, phi // 3), "density": density}
    toe = crest + ratio * height
    width = math.ceil(toe + draw.choose(4.0, 6.0))
    shape = {"type": "polygon", "vertices": [[0, 0], [width, 0], [width, base], [toe, base], [crest, base + height], [0, base + height]]}
    body = {"name": "slope", "material": "soil", "shape": shape} | points(draw)
    stages = [{"name": "gravity", "steps": {"count": draw.choose(4, 5, 10)}, "factors": {"weight": 1}}]
    if draw.chance(0.7):
        stages.append({"name": "safety", "steps": {"count": draw.choose(10, 20), "control": {"type": "strength-reduction", "to": draw.choose(2, 3)}}})
    return deck("slope", structured(width, base + height + 1, h), {"soil": material}, [body], held(width), [weight()], stages=stages)


def excavation(draw):
    """A pit is dug in one to three lifts, with a battered or a propped side."""
    h = draw.choose(0.5, 0.5, 1.0)
    width, depth = 16.0, draw.choose(8.0, 10.0)
    lifts, lift = draw.choose(1, 2, 3), draw.choose(1.0, 1.0, 2.0)
    density = 1800
    deep = lifts * lift
    if draw.chance(0.6):
        strength = round(density * GRAVITY * deep * draw.between(0.35, 0.8))
        material = {"model": "tresca", "young": 300 * strength, "poisson": 0.45, "cohesion": strength, "density": density}
    else:
        phi = draw.choose(25, 30, 35)
        material = {"model": "mohr-coulomb", "young": draw.choose(20e6, 40e6), "poisson": 0.3,
                    "cohesion": round(density * GRAVITY * deep * draw.between(0.15, 0.3)), "friction_angle": phi,
                    "dilation_angle": 0, "density": density}
    shared = {"material": "soil", "initial_stress": at_rest(draw, material, depth)} | points(draw)
    bodies = [{"name": "ground", "shape": {"type": "polygon", "vertices": [
        [0, 0], [width, 0], [width, depth - deep], [10, depth - deep], [10, depth], [0, depth]]}} | shared]
    stages = [{"name": "rest", "steps": {"count": 1}}]
    for index in range(lifts):
        top = depth - index * lift
        bodies.append({"name": f"lift{index}", "shape": {"type": "box", "min": [10, top - lift], "max": [width, top]}} | shared)
        stages.append({"name": f"dig{index}", "steps": {"count": draw.choose(2, 4, 5)}, "remove": [f"lift{index}"]})
    conditions = held(width)
    if draw.chance(0.4) and lifts > 1:
        conditions.append({"name": "prop", "nodes": {"box": {"min": [10, depth], "max": [10, depth]}}, "fix": ["x"]})
        stages[2]["set"] = ["prop"]
    return deck("excavation", structured(width, depth + 1, h), {"soil": material}, bodies, conditions, [weight()], stages=stages)


def wall(draw):
    """A retaining wall moves towards or away from the soil: held nodes or a rigid plate."""
    h = draw.choose(0.25, 0.5)
    height, width = draw.choose(2.0, 3.0), draw.choose(6.0, 8.0)
    material = soil(draw)
    as_tool, active = draw.chance(0.4), draw.chance(0.5)
    body = {"name": "soil", "material": "soil", "initial_stress": at_rest(draw, material, height)} | (domains(draw) if as_tool else points(draw))
    motion = round(height * (draw.between(0.005, 0.03) if active else draw.between(0.02, 0.1)), 3)
    left = 1.0 if active else 0.0
    body["shape"] = {"type": "box", "min": [left, 0], "max": [left + width, height]}
    conditions = [
        {"name": "far", "nodes": {"x": left + width}, "fix": ["x"]},
        # Held along x, the lowest material would be in the way of the wall.
        {"name": "base", "nodes": {"y": 0}, "fix": ["y"]},
    ]
    sign = -1 if active else 1
    others = {}
    if as_tool:
        others["tools"] = [{"name": "wall", "shape": {"type": "box", "min": [left - 0.5, -1], "max": [left, height + 2]}, "ux": sign * motion,
                            "friction": draw.choose(0, 0.2, 0.4)}]
        # The wall, which is no boundary condition, takes up the stress at rest in the first step.
        others["analysis"] = {"initial_imbalance": "equilibrate"}
    else:
        conditions.append({"name": "wall", "nodes": {"x": left}, "ux": sign * motion})
    return deck("wall", structured(left + width + 1, height + 1.5, h), {"soil": material}, [body], conditions, [weight()],
                draw.choose(20, 40), **others)


def pile(draw):
    """A wished-in-place pile of revolution is pushed in: adhesion or friction on its shaft."""
    h = draw.choose(0.1, 0.2)
    radius, length, depth, width = 0.2, draw.choose(0.6, 1.0, 1.4), draw.choose(2.4, 3.0), draw.choose(1.6, 2.0)
    material = clay(draw)[0] if draw.chance(0.6) else sand(draw)
    strength = material.get("cohesion", material.get("undrained_strength"))
    body = {"name": "ground", "material": "soil",
            "shape": {"type": "difference", "from": {"type": "box", "min": [0, 0], "max": [width, depth]},
                      "minus": [{"type": "box", "min": [0, depth - length], "max": [radius, depth]}]},
            "initial_stress": at_rest(draw, material, depth)} | domains(draw)
    tool = {"name": "pile", "shape": {"type": "box", "min": [-radius, depth - length], "max": [radius, depth + 0.5]},
            "uy": -round(radius * draw.between(0.1, 1.0), 3)}
    if "friction_angle" in material:
        tool["friction"] = draw.choose(0.2, 0.4)
    else:
        tool["adhesion"] = round(strength * draw.choose(0.3, 0.5, 0.8))
        tool["friction"] = draw.choose(0, "rough")
    return deck("pile", structured(width, depth + 0.6, h), {"soil": material}, [body], held(width), [weight()], draw.choose(20, 50),
                analysis={"idealisation": "axisymmetric", "initial_imbalance": "equilibrate"}, tools=[tool])


def pipe(draw):
    """A pipe is pressed into the seabed, with weight or without."""
    h = draw.choose(0.125, 0.25)
    radius, depth, width = 0.5, 3.0, draw.choose(3.0, 4.0)
    material = clay(draw)[0] if draw.chance(0.75) else sand(draw)
    body = {"name": "ground", "material": "soil", "shape": {"type": "box", "min": [0, 0], "max": [width, depth]}} | domains(draw)
    loads = []
    if "friction_angle" in material or draw.chance(0.4):
        body["initial_stress"] = at_rest(draw, material, depth)
        loads = [weight()]
    tool = {"name": "pipe", "shape": {"type": "circle", "center": [0, depth + radius], "radius": radius},
            "uy": -draw.between(0.1, 0.5, 2), "friction": draw.choose(0, 0, 0.3)}
    if draw.chance(0.3) and "friction_angle" not in material:
        tool["adhesion"] = round(0.4 * material.get("cohesion", material.get("undrained_strength")))
    return deck("pipe", structured(width, depth + 1.5, h), {"soil": material}, [body], held(width), loads, draw.choose(10, 20, 40), tools=[tool])


def anchor(draw):
    """A plate in the ground is pulled upwards: nodes that are held together."""
    h = draw.choose(0.25, 0.5)
    half, below, cover, width = draw.choose(0.5, 1.0), 2.0, draw.choose(1.0, 2.0, 3.0), 8.0
    material = soil(draw)
    depth = below + cover
    body = {"name": "ground", "material": "soil", "shape": {"type": "box", "min": [0, 0], "max": [width, depth]},
            "initial_stress": at_rest(draw, material, depth)} | points(draw)
    plate = {"name": "anchor", "nodes": {"box": {"min": [0, below], "max": [half, below]}}, "uy": round(draw.between(0.02, 0.15) * half, 3)}
    if draw.chance(0.5):
        plate["ux"] = 0
    content = deck("anchor", structured(width, depth + 1, h), {"soil": material}, [body], [*held(width), plate], [weight()], draw.choose(20, 40))
    return revolved(draw, content, 0.3)


def trapdoor(draw):
    """A door in the floor is lowered or lifted below soil."""
    h = draw.choose(0.25, 0.5)
    half, cover, width = 1.0, draw.choose(2.0, 3.0, 4.0), 6.0
    material = sand(draw) if draw.chance(0.7) else clay(draw)[0]
    body = {"name": "soil", "material": "soil", "shape": {"type": "box", "min": [0, 1], "max": [width, 1 + cover]},
            "initial_stress": at_rest(draw, material, 1 + cover)} | points(draw)
    conditions = [
        {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
        {"name": "right", "nodes": {"x": width}, "fix": ["x"]},
        {"name": "door", "nodes": {"box": {"min": [0, 1], "max": [half, 1]}}, "uy": round(draw.choose(-1, 1) * draw.between(0.005, 0.05), 4)},
        {"name": "base", "nodes": {"box": {"min": [half + h, 1], "max": [width, 1]}}, "fix": ["x", "y"]},
    ]
    return deck("trapdoor", structured(width, cover + 2, h), {"soil": material}, [body], conditions, [weight()], draw.choose(20, 40))


def cantilever(draw):
    """A beam of rubber or metal bends far under a load at its end, its weight or a pressure."""
    length, height = draw.choose(4.0, 6.0, 10.0), draw.choose(0.5, 1.0)
    h = draw.choose(height / 2, height)
    model = draw.choose("hencky", "neo-hookean")
    young = draw.choose(1e6, 1e7)
    material = {"model": model, "young": young, "poisson": draw.choose(0, 0.3), "density": 1000}
    reach = math.ceil(length) + 1
    base = reach
    body = {"name": "beam", "material": "rubber", "shape": {"type": "box", "min": [0, base], "max": [length, base + height]}} | points(draw, solid=True)
    body.setdefault("points_per_cell", 2)
    stiffness = young * height**3 / 12
    # The end sinks by a fifth to three fifths of the length, by linear theory of a load at the end.
    force = round(3 * stiffness / length**3 * length * draw.between(0.2, 0.6), 1)
    others = {}
    if draw.chance(0.5):
        loads = [{"name": "end", "type": "point-force", "body": "beam", "points": {"nearest": [length, base + height / 2], "count": 1},
                  "total": [0, -force]}]
        if body["points_per_cell"] % 2 == 0:
            loads[0]["points"]["count"] = 2
    elif draw.chance(0.5):
        loads = [{"name": "weight", "type": "body-force", "force": [0, -round(2.67 * force / (length * height), 3)]}]
    else:
        others["surfaces"] = [{"name": "top", "body": "beam", "part": {"edge": 2}}]
        loads = [{"name": "pressure", "type": "pressure", "surface": "top", "pressure": round(2.67 * force / length, 3)}]
    conditions = [{"name": "clamp", "nodes": {"x": 0}, "fix": ["x", "y"]}]
    return deck("cantilever", structured(reach, base + 3, h), {"rubber": material}, [body], conditions, loads, draw.choose(10, 20, 40), **others)


def ring(draw):
    """A ring of rubber or clay: squeezed between plates, or under pressure from inside."""
    inner = draw.choose(1.0, 1.5)
    outer = inner + draw.choose(0.5, 0.75, 1.0)
    h = draw.choose(0.125, 0.25)
    size = math.ceil(outer) + 1
    body = {"name": "ring", "material": "m", "shape": {"type": "annulus", "center": [0, 0], "inner": inner, "outer": outer}}
    body |= domains(draw)
    conditions = [{"name": "left", "nodes": {"x": 0}, "fix": ["x"]}, {"name": "bottom", "nodes": {"y": 0}, "fix": ["y"]}]
    others, loads = {}, []
    if draw.chance(0.5):
        material = {"model": draw.choose("hencky", "neo-hookean"), "young": 1e6, "poisson": draw.choose(0.3, 0.45)}
        if draw.chance(0.5):
            travel, friction = round(outer * draw.between(0.05, 0.3), 3), draw.choose(0, 0.2)
            others["tools"] = [
                {"name": name, "shape": {"type": "half-space", "point": [0, side * (outer + 0.01)], "normal": [0, -side]},
                 "uy": -side * travel, "friction": friction}
                for name, side in (("upper", 1), ("lower", -1))
            ]
        else:
            others["surfaces"] = [{"name": "inside", "body": "ring", "part": {"edge": 1}}]
            loads = [{"name": "pressure", "type": "pressure", "surface": "inside", "pressure": round(1e6 * (outer - inner) / outer * draw.between(0.02, 0.1))}]
    else:
        material, strength = clay(draw)
        others["surfaces"] = [{"name": "inside", "body": "ring", "part": {"edge": 1}}]
        # Below the limit 2 s_u ln(b/a) of a cylinder in plane strain.
        limit = 2 * strength * math.log(outer / inner) * (0.85 if "softening" not in material else 0.6)
        loads = [{"name": "pressure", "type": "pressure", "surface": "inside", "pressure": round(limit * draw.between(0.5, 1.0))}]
    grid = structured(2 * size, 2 * size, h) | {"origin": [-size, -size]}
    return deck("ring", grid, {"m": material}, [body], conditions, loads, draw.choose(10, 20), **others)


def upsetting(draw):
    """A billet of metal is compressed by up to two fifths, between smooth, rough or sticking plates."""
    half, height = draw.choose(0.5, 1.0), draw.choose(1.0, 1.5)
    h = draw.choose(0.125, 0.25)
    material = {"model": draw.choose("von-mises", "tresca"), "young": 200e9, "poisson": 0.3}
    if material["model"] == "tresca":
        material["cohesion"] = 150e6
    else:
        material["undrained_strength"] = 150e6
    body = {"name": "billet", "material": "metal", "shape": {"type": "box", "min": [0, 0], "max": [half, height]}} | domains(draw)
    conditions = [{"name": "axis", "nodes": {"x": 0}, "fix": ["x"]}, {"name": "middle", "nodes": {"y": 0}, "fix": ["y"]}]
    travel = round(height * draw.between(0.05, 0.4), 3)
    others = {}
    if draw.chance(0.6):
        others["tools"] = [{"name": "plate", "shape": {"type": "half-space", "point": [0, height], "normal": [0, -1]}, "uy": -travel,
                            "friction": draw.choose(0, 0.1, 0.3, "rough")}]
    else:
        plate = {"name": "plate", "nodes": {"outer_layer": "plate"}, "ux": 0, "uy": -travel}
        conditions.append(plate)
    bodies = [body]
    if "tools" not in others:
        bodies.append({"name": "plate", "material": "metal", "shape": {"type": "box", "min": [0, height], "max": [half, height + 2 * h]}}
                      | {key: body[key] for key in ("points_per_cell", "method") if key in body})
    content = deck("upsetting", structured(math.ceil(2 * half) + 1, height + 1, h), {"metal": material}, bodies, conditions, [],
                   draw.choose(20, 40), **others)
    return revolved(draw, content, 0.4)


FAMILIES = [footing, footing_tool, slope, excavation, wall, pile, pipe, anchor, trapdoor, cantilever, ring, upsetting]


def run(program, path, out):
    """One line of the table: how the run of a deck ends, and what it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run([program, "run", path, "--threads", "1", "--out", out], capture_output=True, text=True, timeout=TIMEOUT)
        code = done.returncode
    except subprocess.TimeoutExpired:
        code = "timeout"
    summary = out / "summary.json"
    result = json.loads(summary.read_text()) if summary.exists() else {}
    diagnosis = result.get("diagnosis") or {}
    asked = result.get("steps_requested")
    return {
        "deck": path.stem,
        "exit": code,
        "outcome": result.get("outcome", "no results" if code != "timeout" else "timeout"),
        "code": result.get("code") or (done.stderr.split("[")[1].split("]")[0] if code == 2 and "[" in done.stderr else ""),
        "kind": diagnosis.get("kind", ""),
        "asked": asked,
        "steps": result.get("steps"),
        "failed": result.get("failed_attempts"),
        "evaluations": result.get("evaluations"),
        "viscous": result.get("viscous_steps"),
        "reason": (result.get("reason") or "").split("\n")[0][:160],
    }


def study(families, description, count):
    """Runs COUNT decks of each family and prints a table, with a line for each family; the exit status is 0 if all are complete."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=count, help="decks of each family")
    parser.add_argument("--only", nargs="*", default=[], help="names of families")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, help="keeps the decks and the table")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    families = [family for family in families if not arguments.only or family.__name__ in arguments.only]
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.out or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for family in families:
            for number in range(arguments.count):
                path = folder / f"{family.__name__}_{number:03}.yaml"
                path.write_text(json.dumps(family(Draw(family.__name__, number, arguments.seed)), indent=1))
                paths.append(path)

        def work(path):
            out = pathlib.Path(temporary) / "results" / path.stem
            row = run(program, path, out)
            shutil.rmtree(out, ignore_errors=True)
            print(*(str(value) for value in row.values()), flush=True)
            return row

        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            rows = list(pool.map(work, paths))
        with open(folder / "engineering.csv", "w", newline="") as file:
            table = csv.DictWriter(file, rows[0])
            table.writeheader()
            table.writerows(rows)
    print(f"{'family':16} {'decks':>6} {'complete':>9} {'slow':>6} {'stopped':>8}")
    total = [0, 0, 0, 0]
    for family in families:
        own = [row for row in rows if row["deck"].rsplit("_", 1)[0] == family.__name__]
        complete = [row for row in own if row["outcome"] == "completed"]
        slow = [row for row in complete if row["steps"] > 3 * row["asked"]]
        counts = [len(own), len(complete), len(slow), len(own) - len(complete)]
        total = [a + b for a, b in zip(total, counts)]
        print(f"{family.__name__:16} {counts[0]:6} {counts[1]:9} {counts[2]:6} {counts[3]:8}")
    print(f"{'all':16} {total[0]:6} {total[1]:9} {total[2]:6} {total[3]:8}")
    sys.exit(0 if total[3] == 0 else 1)


if __name__ == "__main__":
    study(FAMILIES, __doc__, 34)
