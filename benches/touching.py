"""Whether sensible decks with two to five bodies in contact run to the end with defaults.

    python3 benches/touching.py PROGRAM [--count 13] [--only FAMILY ...] [--seed 0] [--out DIRECTORY] [--jobs 1]

Writes COUNT random decks for each of eight families (block on ground, stack, cylinder on ground, footing, block on a slope,
forming between dies, beam on supports, wall between soils): GIMP, CPDI1 and CPDI2, two or three points per cell, elastic
bodies, clay and sand, smooth to rough interfaces, at times with adhesion or tension. Every key that a deck does not need
stays at its default. See `engineering.py` for the table.
"""

import math

from engineering import clay, deck, held, sand, structured, study, weight


def domains(draw, material, is_straight=True):
    """Method and points per cell; mean dilatation for material that flows. Boxes are for straight bodies."""
    body = {"method": draw.choose("cpdi2", "cpdi2", "cpdi1", "gimp"), "points_per_cell": draw.choose(2, 2, 3)}
    if not is_straight and body["method"] == "gimp":
        body["method"] = "cpdi2"
    if material["model"] not in ("hencky", "neo-hookean"):
        body["strain"] = "mean-dilatation"
    return body


def rock(draw):
    return {"model": draw.choose("hencky", "neo-hookean"), "young": draw.choose(2e7, 1e8, 1e9), "poisson": draw.choose(0.0, 0.2, 0.3),
            "density": draw.choose(2000, 2400, 2700)}


def soil(draw):
    """Clay, sand with some cohesion, or elastic ground."""
    kind = draw.choose("clay", "sand", "elastic")
    if kind == "clay":
        return clay(draw)[0]
    if kind == "sand":
        return sand(draw, cohesionless=False)
    return {"model": "hencky", "young": draw.choose(5e6, 2e7), "poisson": draw.choose(0.2, 0.3), "density": 1800}


def box(name, material, low, high):
    return {"name": name, "material": material, "shape": {"type": "box", "min": low, "max": high}}


def interface(draw, first, second=None):
    """An entry of `contacts`; without a second body, between all."""
    entry = {"between": "all" if second is None else [first, second]}
    friction = draw.choose(0, 0.2, 0.3, 0.5, "rough")
    if friction != 0:
        entry["friction"] = friction
    if friction != "rough" and draw.chance(0.2):
        entry["adhesion"] = draw.choose(500, 2000)
        if draw.chance(0.5):
            entry["tension"] = draw.choose(500, 1000)
    return entry


def slip(entry):
    """Coefficient of friction of an interface, at most 0.5."""
    friction = entry.get("friction", 0)
    return 0.5 if friction == "rough" else friction


def moved(body, edge, **motion):
    """A surface of a body and a condition that moves it."""
    name = f"{body}_top"
    return {"name": name, "body": body, "part": {"edge": edge}}, {"name": f"move_{body}", "surface": name} | motion


def block_on_ground(draw):
    """A block stands on ground; its top is pushed down, at times along as well."""
    h = draw.choose(0.25, 0.5)
    width, depth = 8.0, draw.choose(2.0, 3.0)
    start, size, height = draw.choose(2.5, 3.0), draw.choose(1.5, 2.0), draw.choose(1.0, 1.5)
    materials = {"soil": soil(draw), "rock": rock(draw)}
    bodies = [box("ground", "soil", [0, 0], [width, depth]) | domains(draw, materials["soil"]),
              box("block", "rock", [start, depth], [start + size, depth + height]) | domains(draw, materials["rock"])]
    motion = {"uy": -round(draw.between(0.005, 0.04) * size, 4)}
    if draw.chance(0.5):
        motion["ux"] = round(draw.between(0.005, 0.05) * size, 4)
    surface, condition = moved("block", 2, **motion)
    return deck("block on ground", structured(width, depth + height + 1, h), materials, bodies, [*held(width), condition], [],
                draw.choose(5, 10, 20), surfaces=[surface], contacts=[interface(draw, "ground", "block")])


def stack(draw):
    """Two to four blocks on each other and on ground, under their weight, at times pushed from above."""
    h = draw.choose(0.25, 0.5)
    count, height = draw.choose(2, 3, 4), draw.choose(0.75, 1.0) if h == 0.25 else 1.0
    width, depth = 6.0, 1.0
    materials = {"soil": soil(draw), "rock": rock(draw)}
    bodies = [box("ground", "soil", [0, 0], [width, depth]) | domains(draw, materials["soil"])]
    filling = domains(draw, materials["rock"])
    left = 1.5
    for number in range(count):
        size = draw.choose(2.0, 2.5)
        low = depth + number * height
        bodies.append(box(f"block{number}", "rock", [left, low], [left + size, low + height]) | filling)
        left += draw.choose(-h, 0, h)
    others = {}
    conditions = held(width)
    if draw.chance(0.5):
        surface, condition = moved(f"block{count - 1}", 2, uy=-round(draw.between(0.005, 0.03), 4), ux=0)
        conditions.append(condition)
        others["surfaces"] = [surface]
    entry = interface(draw, None)
    entry.setdefault("friction", 0.3)
    return deck("stack", structured(width, depth + count * height + 1, h), materials, bodies, conditions, [weight()],
                draw.choose(5, 10), contacts=[entry], **others)


def cylinder(draw):
    """A round bar is pressed into the ground by the motion of its upper half."""
    h = draw.choose(0.25, 0.5)
    width, depth, radius = 8.0, 3.0, draw.choose(1.0, 1.5)
    materials = {"soil": soil(draw), "rock": rock(draw)}
    bar = {"name": "bar", "material": "rock", "shape": {"type": "circle", "center": [4, depth + radius], "radius": radius}}
    bodies = [box("ground", "soil", [0, 0], [width, depth]) | domains(draw, materials["soil"]), bar | domains(draw, materials["rock"], False)]
    surfaces = [{"name": "upper", "body": "bar", "part": {"half_space": {"point": [4, depth + radius], "normal": [0, 1]}}}]
    condition = {"name": "press", "surface": "upper", "ux": 0, "uy": -round(draw.between(0.05, 0.2) * radius, 3)}
    return deck("cylinder", structured(width, depth + 2 * radius + 1, h), materials, bodies, [*held(width), condition], [],
                draw.choose(10, 20), surfaces=surfaces, contacts=[interface(draw, "ground", "bar")])


def footing(draw):
    """A footing of concrete on soil carries a part of its capacity, at times inclined."""
    h = draw.choose(0.25, 0.5)
    width, depth, start, size, thickness = 10.0, 4.0, 4.0, 2.0, 0.5
    ground = soil(draw)
    strength = ground.get("cohesion", ground.get("undrained_strength", 20e3))
    materials = {"soil": ground, "concrete": {"model": "hencky", "young": draw.choose(1e8, 1e9), "poisson": 0.2, "density": 2400}}
    bodies = [box("ground", "soil", [0, 0], [width, depth]) | domains(draw, ground),
              box("footing", "concrete", [start, depth], [start + size, depth + thickness]) | domains(draw, materials["concrete"])]
    entry = interface(draw, "footing", "ground")
    load = round(draw.between(0.5, 3.5) * strength)
    along = round(draw.between(0.1, 0.7) * min(slip(entry) * load, strength))
    surfaces = [{"name": "top", "body": "footing", "part": {"edge": 2}}]
    loads = [{"name": "column", "type": "traction", "surface": "top", "traction": [along if draw.chance(0.5) else 0, -load]}]
    content = deck("footing", structured(width, depth + 2, h), materials, bodies, held(width), loads, draw.choose(5, 10, 20),
                   surfaces=surfaces, contacts=[entry])
    if not slip(entry):
        # On a smooth interface nothing else holds the footing along x.
        content["boundary_conditions"].append({"name": "guide", "surface": "top", "ux": 0})
        loads[0]["traction"][0] = 0
    return content


def block_on_slope(draw):
    """A block on an inclined plane, steeper or flatter than its friction; a friction below the slope needs a stop."""
    h = draw.choose(0.25, 0.5)
    slope = draw.choose(0.1, 0.2, 0.3)
    materials = {"soil": {"model": "hencky", "young": 5e7, "poisson": 0.3, "density": 2000}, "rock": rock(draw)}
    at = lambda x: round(1 + slope * (8 - x), 6)
    ground = {"name": "slope", "material": "soil", "shape": {"type": "polygon", "vertices": [[0, 0], [8, 0], [8, at(8)], [0, at(0)]]}}
    x, size, height = 3.0, 2.0, 1.0
    cosine, sine = 1 / math.hypot(1, slope), -slope / math.hypot(1, slope)
    corner = lambda a, b: [round(x + a * cosine - b * sine, 6), round(at(x) + a * sine + b * cosine, 6)]
    block = {"name": "block", "material": "rock",
             "shape": {"type": "polygon", "vertices": [corner(0, 0), corner(size, 0), corner(size, height), corner(0, height)]}}
    bodies = [ground | domains(draw, materials["soil"], False), block | domains(draw, materials["rock"], False)]
    friction = draw.choose(1.1, 1.5, 3.0) * slope
    contacts = [{"between": ["slope", "block"], "friction": round(friction, 3)}]
    conditions = [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}, {"name": "left", "nodes": {"x": 0}, "fix": ["x"]},
                  {"name": "right", "nodes": {"x": 8}, "fix": ["x"]}]
    return deck("block on a slope", structured(8, math.ceil(at(0)) + 2, h), materials, bodies, conditions, [weight()],
                draw.choose(5, 10), contacts=contacts)


def forming(draw):
    """A billet is compressed between two elastic dies."""
    h = draw.choose(0.125, 0.25)
    half, height = draw.choose(0.5, 0.75), draw.choose(0.75, 1.0)
    metal = {"model": draw.choose("von-mises", "hencky"), "young": 200e9, "poisson": 0.3}
    if metal["model"] == "von-mises":
        metal["undrained_strength"] = 150e6
    die = {"model": "hencky", "young": 200e9 * draw.choose(1, 3), "poisson": 0.3}
    materials = {"metal": metal, "die": die}
    filling = domains(draw, die)
    bodies = [box("lower", "die", [0, 0], [2, 0.5]) | filling,
              box("billet", "metal", [0, 0.5], [half, 0.5 + height]) | domains(draw, metal),
              box("upper", "die", [0, 0.5 + height], [2, 1 + height]) | filling]
    part = 0.002 if metal["model"] == "hencky" else draw.between(0.02, 0.2)
    surface, condition = moved("upper", 2, ux=0, uy=-round(part * height, 4))
    conditions = [{"name": "axis", "nodes": {"x": 0}, "fix": ["x"]}, {"name": "base", "nodes": {"y": 0}, "fix": ["y"]}, condition]
    entries = [interface(draw, "lower", "billet"), interface(draw, "upper", "billet")]
    for entry in entries:
        entry.pop("adhesion", None), entry.pop("tension", None)
    entries.append({"between": ["lower", "upper"]})
    return deck("forming", structured(2.5, 1.5 + height, h), materials, bodies, conditions, [], draw.choose(10, 20, 40),
                surfaces=[surface], contacts=entries)


def beam(draw):
    """A beam lies on two supports and is pushed in the middle by a stamp."""
    h = draw.choose(0.25, 0.5)
    span = draw.choose(3.0, 4.0)
    materials = {"rubber": {"model": draw.choose("hencky", "neo-hookean"), "young": draw.choose(1e6, 1e7), "poisson": 0.3, "density": 1000},
                 "rock": rock(draw)}
    filling = domains(draw, materials["rock"])
    middle = 4.0
    bodies = [box("left", "rock", [middle - span / 2 - 0.5, 0], [middle - span / 2 + 0.5, 1]) | filling,
              box("right", "rock", [middle + span / 2 - 0.5, 0], [middle + span / 2 + 0.5, 1]) | filling,
              box("beam", "rubber", [0.5, 1], [7.5, 1.5 + draw.choose(0.0, 0.5)]) | domains(draw, materials["rubber"])]
    top = bodies[2]["shape"]["max"][1]
    bodies.append(box("stamp", "rock", [middle - 0.5, top], [middle + 0.5, top + 1]) | filling)
    surface, condition = moved("stamp", 2, ux=0, uy=-round(draw.between(0.02, 0.15), 3))
    conditions = [{"name": "base", "nodes": {"y": 0}, "fix": ["x", "y"]}, condition]
    entry = interface(draw, None)
    entry.setdefault("friction", 0.3)
    return deck("beam on supports", structured(8, 4, h), materials, bodies, conditions, [], draw.choose(10, 20), surfaces=[surface],
                contacts=[entry])


def wall(draw):
    """A wall stands between two layers of soil under their weight, and its top is drawn aside."""
    h = draw.choose(0.25, 0.5)
    width, height, thickness, below = 8.0, draw.choose(2.0, 3.0), 0.5, 1.0
    ground = soil(draw)
    materials = {"soil": ground, "concrete": {"model": "hencky", "young": draw.choose(1e8, 1e9), "poisson": 0.2, "density": 2400}}
    filling = domains(draw, ground)
    bodies = [box("base", "soil", [0, 0], [width, below]) | filling,
              box("behind", "soil", [0, below], [4, below + height]) | filling,
              box("wall", "concrete", [4, below], [4 + thickness, below + height]) | domains(draw, materials["concrete"]),
              box("front", "soil", [4 + thickness, below], [width, below + height]) | filling]
    phi = ground.get("friction_angle", 20)
    for body in (bodies[0], bodies[1], bodies[3]):
        body["initial_stress"] = {"type": "geostatic", "surface": below + height, "k0": round(1 - math.sin(math.radians(phi)), 2)}
    surface, condition = moved("wall", 2, ux=round(draw.between(0.001, 0.01) * height, 4))
    entries = [interface(draw, "wall", other) for other in ("base", "behind", "front")]
    for entry in entries:
        entry.pop("tension", None)
    return deck("wall between soils", structured(width, below + height + 1, h), materials, bodies, [*held(width), condition],
                [weight()], draw.choose(10, 20), surfaces=[surface], contacts=entries, analysis={"initial_imbalance": "equilibrate"})


FAMILIES = [block_on_ground, stack, cylinder, footing, block_on_slope, forming, beam, wall]

if __name__ == "__main__":
    study(FAMILIES, __doc__, 13)
